//! The whole way on a drawn machine: program → virtual machine → log → identify → export → the virtual machine with the
//! compensation → a second program at other points → what is left, and whether it was foretold.

use super::draw;
use axiscal::diag::source;
use axiscal::fit::{self, Fit, Settings};
use axiscal::log::{self, Writer};
use axiscal::machine::{Machine, Side};
use axiscal::model::catalogue::Catalogue;
use axiscal::model::data::{Run, assemble};
use axiscal::model::predict::Model;
use axiscal::post::{LogRecord, Postprocessor};
use axiscal::program::plan::{ControllerFrame, Plan};
use axiscal::simulate::{self, Compensation, Scenario};
use axiscal::tables::compensation::Provenance;
use axiscal::tables::control;
use axiscal::tables::correction::{Correction, During};
use axiscal::tables::linuxcnc;
use axiscal::units::{mm_from_um, um_from_mm};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

pub const CONTROLLERS: [&str; 5] = ["linuxcnc", "sinumerik", "fanuc", "heidenhain", "haas"];

/// Noise of a touch that is planted and stated, µm.
const NOISE_UM: f64 = 0.5;

/// What a log with few decimals and the control's resolution may leave without any noise, µm.
const RESOLUTION_UM: f64 = 0.15;

/// The blocks of both programs stand within this of the ball at zero, mm.
const BLOCKS_WITHIN_MM: f64 = 100.0;

/// How a draw ended.
#[derive(Debug, Clone, PartialEq)]
pub enum Ended {
    /// What is left is within 1.15 times the noise.
    Compensated,
    /// What is left beyond that was foretold: by the covariance of the exported values or by the listed remainder.
    Foretold,
    /// Nothing was exported, for a reason.
    Refused(String),
    /// Neither: a fault.
    Wrong(String),
}

/// What an export gives: the compensation as the control loads it, and the remainder that it lists, µm.
struct Exported {
    loaded: Compensation,
    remainder_um: f64,
}

fn export(machine: &Machine, controller: &str, catalogue: &Catalogue, fit: &Fit) -> Result<Exported, String> {
    let reason = |e: axiscal::diag::Failure| e.0.first().map_or_else(String::new, |f| f.code.to_string());
    let during = During { loaded: None, transformation: false };
    let (correction, findings) =
        Correction::collect(machine, catalogue, &fit.outcome, during, Provenance::default()).map_err(reason)?;
    // what is said to stay of a combination that the touches do not part
    let combined = findings.0.iter().any(|f| f.code == "tables::combination");
    let parts = fit.outcome.undetermined.iter().filter_map(|u| u.moves_um).filter(|_| combined);
    let combined_um: f64 = parts.sum();
    // what stays is stated at the radius at which the blocks stand about the table's last axis
    let ball = machine.reference.ball;
    let about = machine.side(Side::Workpiece).filter(|a| a.name.is_rotary()).last();
    let away = about.map_or(0.0, |a| a.direction.cross(&(ball - a.point)).norm());
    let radius_mm = (away + BLOCKS_WITHIN_MM).max(100.0);
    if controller == linuxcnc::CONTROLLER {
        let options = linuxcnc::Options { radius_mm, ..linuxcnc::Options::default() };
        let (made, _) = linuxcnc::export(machine, &correction, &options).map_err(reason)?;
        let json = made.component.compensation.to_json().map_err(reason)?;
        let loaded = Compensation::parse(&source("compensation.json", json), machine).map_err(reason)?.0;
        // LinuxCNC lists the combinations among what is left
        let remainder_um = made.component.left.iter().filter_map(|l| l.left_um).sum();
        return Ok(Exported { loaded, remainder_um });
    }
    let posts = Postprocessor::built_in().map_err(reason)?;
    let tables = posts.into_iter().find(|p| p.name == controller).and_then(|p| p.tables).unwrap();
    let unknown = control::Options { radius_mm, accept_unverified: true, ..control::Options::default() };
    // the control holds the machine's description: with its present values the files are written that it reads
    let (sheet, _) = control::export(machine, controller, &tables, &correction, &unknown).map_err(reason)?;
    let mut options = unknown;
    for value in &sheet.values {
        options.old.values.extend(value.names.values().map(|name| (name.clone(), (value.old, None))));
    }
    let grids = sheet.compensation.tables.iter().flat_map(|t| &t.grids);
    let points = grids.filter_map(|g| tables.grid.as_ref()?.point_name(g.number, 0));
    options.old.values.extend(points.map(|name| (name, (0.0, None))));
    let (made, _) = control::export(machine, controller, &tables, &correction, &options).map_err(reason)?;
    let text = |name: &str| {
        let (_, bytes) = made.files.iter().find(|(n, _)| n == name).unwrap();
        source(name, String::from_utf8(bytes.clone()).unwrap())
    };
    let loaded =
        Compensation::parse_with(&text("compensation.json"), machine, &|name| Ok(text(name))).map_err(reason)?.0;
    Ok(Exported { loaded, remainder_um: made.rest_um + made.rounding_um + combined_um })
}

/// The touches of a program as they come back from the log of this control.
fn touches(
    machine: &Machine,
    post: &Postprocessor,
    plan: &Plan,
    scenario: &Scenario,
    compensation: Option<&Compensation>,
) -> Result<Vec<log::Touch>, String> {
    let (raw, _) = simulate::run(machine, plan, scenario, compensation).map_err(|e| format!("virtual machine: {e}"))?;
    let record =
        |t: &log::RawTouch| LogRecord { id: t.id.unwrap(), status: t.status, position: t.position, time_s: t.time_s };
    let records: Vec<LogRecord> = raw.iter().map(record).collect();
    let text = post.log_text(machine, plan, &records);
    let (read, _) = log::read(text.as_bytes(), "run.log", Writer::Controller(post), machine, plan)
        .map_err(|e| format!("log: {e}"))?;
    Ok(read.touches)
}

fn identify(
    machine: &Machine,
    catalogue: &Catalogue,
    plan: &Plan,
    touches: &[log::Touch],
    effects: &[&str],
) -> Result<Fit, String> {
    let runs = [Run { plan, touches, mounting: None, started_s: None }];
    let settings = Settings {
        effects: effects.iter().map(|e| (*e).to_owned()).collect(),
        touch_sigma_mm: Some(mm_from_um(NOISE_UM)),
        visit_sigma_mm: Some(0.0),
        bare: true,
        all_in: true,
        ..Settings::default()
    };
    fit::identify(machine, catalogue, &runs, &settings).map_err(|e| format!("fit: {e}"))
}

fn rms_um(fit: &Fit) -> f64 {
    let n = fit.residual_mm.len() as f64;
    um_from_mm((fit.residual_mm.iter().map(|r| r * r).sum::<f64>() / n).sqrt())
}

/// What the uncertainty of the identified values makes of the touches of another program: RMS of one standard deviation, µm.
fn spread_um(
    machine: &Machine,
    catalogue: &Catalogue,
    effects: &[&str],
    fit: &Fit,
    plan: &Plan,
    touches: &[log::Touch],
) -> f64 {
    let rows: Vec<_> = effects.iter().map(|id| catalogue.get(id, machine).unwrap()).collect();
    let data = assemble(machine, &[Run { plan, touches, mounting: None, started_s: None }]);
    let model = Model::new(machine, &rows, &data.set_ups, fit.model.reference);
    let exported: Vec<usize> = (0..model.n_unknowns()).filter(|&i| !model.unknowns[i].is_set_up()).collect();
    let mut sum = 0.0;
    let mut row = vec![0.0; model.n_unknowns()];
    for o in &data.nominal {
        model.gap_and_row(o, &fit.theta, &mut row);
        for &i in &exported {
            for &j in &exported {
                sum += row[i] * row[j] * fit.covariance[(i, j)];
            }
        }
    }
    um_from_mm((sum / data.nominal.len() as f64).max(0.0).sqrt())
}

/// One draw.
pub fn way(seed: u64, controller: &str) -> (Ended, &'static str) {
    let catalogue = Catalogue::built_in().unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (machine, chain) = draw::machine(&mut rng);
    let post = Postprocessor::built_in().unwrap().into_iter().find(|p| p.name == controller).unwrap();
    let is_linuxcnc = controller == linuxcnc::CONTROLLER;
    let planted = draw::effects(&machine, &catalogue, is_linuxcnc, &mut rng);
    let first = draw::program(&machine, ControllerFrame::Axes, (16, 0.0), &mut rng);
    // vectors act under the control's transformation; the kinematics component on axis positions
    let frame = if is_linuxcnc { ControllerFrame::Axes } else { ControllerFrame::Tcp };
    let second = draw::program(&machine, frame, (9, 25.0), &mut rng);
    let values: u64 = rng.random();
    for noise_um in [0.0, NOISE_UM] {
        let mut rng = ChaCha8Rng::seed_from_u64(values);
        let scenario = draw::scenario(&machine, &catalogue, &planted, noise_um, &mut rng);
        let mut effects: Vec<&str> = planted.iter().map(String::as_str).collect();
        effects.extend(["block-setup", "pretravel"]);
        let result = (|| -> Result<Ended, String> {
            let made = touches(&machine, &post, &first, &scenario, None)?;
            let fit = identify(&machine, &catalogue, &first, &made, &effects)?;
            let exported = match export(&machine, controller, &catalogue, &fit) {
                Ok(exported) => exported,
                Err(code) => return Ok(Ended::Refused(code)),
            };
            let made = touches(&machine, &post, &second, &scenario, Some(&exported.loaded))?;
            // the workpiece is touched off again
            let after = rms_um(&identify(&machine, &catalogue, &second, &made, &["block-setup", "pretravel"])?);
            if after <= if noise_um == 0.0 { RESOLUTION_UM } else { 1.15 * NOISE_UM } {
                return Ok(Ended::Compensated);
            }
            let spread = spread_um(&machine, &catalogue, &effects, &fit, &second, &made);
            // without noise the values are right, however uncertain they are called
            let uncertain = if noise_um == 0.0 { 0.0 } else { 5.0 * spread };
            let told = noise_um.hypot(uncertain).hypot(RESOLUTION_UM) + exported.remainder_um;
            if after <= told {
                return Ok(Ended::Foretold);
            }
            let before = {
                let made = touches(&machine, &post, &second, &scenario, None)?;
                rms_um(&identify(&machine, &catalogue, &second, &made, &["block-setup", "pretravel"])?)
            };
            Ok(Ended::Wrong(format!(
                "{after:.3} um are left of {before:.3} at a noise of {noise_um} um; one standard deviation {spread:.3}, \
                 listed remainder {:.3}; planted {}",
                exported.remainder_um,
                planted.join(", ")
            )))
        })();
        match result {
            Ok(Ended::Compensated | Ended::Foretold) if noise_um == 0.0 => {}
            Ok(ended) => return (ended, chain),
            Err(failure) => return (Ended::Wrong(failure), chain),
        }
    }
    (Ended::Compensated, chain)
}
