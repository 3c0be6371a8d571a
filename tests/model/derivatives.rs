//! Every effect, on every machine to which it applies: the analytic derivative of a touch against central differences.

use crate::common;
use axiscal::axes::{AxisName, Position};
use axiscal::diag::source;
use axiscal::machine::{Carrier, Machine, Side};
use axiscal::model::catalogue::Catalogue;
use axiscal::model::formula::{State, slot};
use axiscal::model::predict::{Model, Observation, SetUp};
use axiscal::model::surface::{Body, Surface};
use common::more_machines::all_machines;
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// An effect at every place of the chain, with shape parameters inside: what the catalogue does not yet use.
const OWN: &str = r#"
[[effect]]
id = "own-everywhere"
at = "X"
terms = [
  { parameter = "p1", unit = "um/m", dof = "dy", formula = "X" },
  { parameter = "p2", unit = "urad", dof = "rz", formula = "Y/300" },
  { parameter = "p3", unit = "um", dof = "dz", formula = "1 - exp(-t/tau)", at = "Z" },
  { parameter = "p4", unit = "mm", dof = "dx", formula = "cos(k*X)", at = "tool" },
  { parameter = "p5", unit = "mrad", dof = "rx", formula = "ny", at = "tool" },
  { parameter = "p12", unit = "um/h", dof = "dy", formula = "t", at = "base" },
  { parameter = "p13", unit = "urad", dof = "rx", formula = "nz", at = "base" },
  { parameter = "p6", unit = "um", dof = "dx", formula = "T - 20", at = "workpiece" },
  { parameter = "p7", unit = "urad", dof = "ry", formula = "1", at = "workpiece" },
  { parameter = "p8", unit = "um", dof = "r", formula = "mx^2 - my^2", at = "trigger" },
  { parameter = "p9", unit = "um", dof = "X", formula = "sX", at = "reading" },
  { parameter = "p10", unit = "um", dof = "Z", formula = "1", at = "reading" },
  { parameter = "p11", unit = "um", dof = "Y", formula = "Y", at = "reading" },
]
shape = [
  { parameter = "tau", unit = "h", start = 0.5, min = 0.01, max = 10 },
  { parameter = "k", unit = "1", start = 0.1 },
]
[[effect]]
id = "own-b"
at = "B"
terms = [
  { parameter = "q1", unit = "urad", dof = "ry", formula = "sin(2*B)" },
  { parameter = "q2", unit = "urad", dof = "rx", formula = "1", frame = "moving" },
  { parameter = "q3", unit = "urad", dof = "B", formula = "1", at = "reading" },
]
[[effect]]
id = "own-c"
at = "C"
terms = [
  { parameter = "w1", unit = "um", dof = "dx", formula = "cos(C)" },
  { parameter = "w2", unit = "urad", dof = "ry", formula = "1", frame = "moving" },
  { parameter = "w3", unit = "urad", dof = "C", formula = "sC", at = "reading" },
]
[[effect]]
id = "own-a"
at = "A"
terms = [
  { parameter = "v1", unit = "urad", dof = "rx", formula = "1", frame = "moving" },
  { parameter = "v2", unit = "urad", dof = "A", formula = "1", at = "reading" },
]
"#;

/// Standard deviation of a touch that whitens the residuals, mm.
const SIGMA_MM: f64 = 1e-3;

/// Parameters without a derivative, each with the reason.
const WITHOUT_DERIVATIVE: [(&str, &str, &str); 2] = [
    ("block-slip", "from_h", "a step in time has no slope: the hour is found by trying (scan)"),
    ("lost-position-", "lost_h_", "as above, for each axis"),
];

fn random_touch(machine: &Machine, carriers: &[Carrier], rng: &mut ChaCha8Rng) -> Observation {
    let mut position = Position::default();
    for axis in &machine.axes {
        let [low, high] = if axis.name.is_rotary() { [-170.0, 170.0] } else { [-200.0, 200.0] };
        position.set(axis.name, rng.random_range(low..high));
    }
    let mut state: State = std::array::from_fn(|_| rng.random_range(0.1..1.0));
    for name in AxisName::ALL {
        state[slot::AXES + name.index()] = position.mm_or_rad(name);
        state[slot::SENSES + name.index()] = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
    }
    for k in 0..3 {
        state[slot::NORMAL_IN_PROBE + k] = rng.random_range(-1.0..1.0);
    }
    state[slot::HOURS] = rng.random_range(0.1..2.0);
    state[slot::TEMPERATURE] = rng.random_range(15.0..30.0);
    state[slot::FEED] = rng.random_range(30.0..200.0);
    let unit = |rng: &mut ChaCha8Rng| {
        Vector3::new(rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0), rng.random_range(0.1..1.0)).normalize()
    };
    let (point, normal) = (unit(rng) * 40.0, unit(rng));
    // the ball is far from where it touches: a body as far away has the curvature that matters
    let surface = match rng.random_range(0..3) {
        0 => Surface::Plane { point, normal },
        1 => Surface::Sphere { centre: point - normal * 12.5, radius: 12.5 },
        _ => Surface::Cylinder { centre: point - normal * 12.5, radius: 12.5, sense: -1.0 },
    };
    let mut touch = Observation {
        run: 0,
        id: 1,
        set_up: rng.random_range(0..carriers.len()),
        point,
        normal,
        surface,
        ball_radius: 3.0,
        ball_at_zero: machine.tool.ball_at_zero(180.0),
        position,
        state,
        has_temperature: true,
    };
    touch.run = touch.set_up % 2;
    touch
}

/// A parameter inside formulas: its step must be small against its own size.
fn stands_inside(model: &Model, j: usize) -> bool {
    model.unknowns[j].start != 0.0
}

#[test]
fn analytic_derivatives_agree_with_central_differences_for_every_effect_and_machine() {
    let machines = all_machines();
    let mut catalogue = Catalogue::built_in().unwrap();
    catalogue.add_file(&source("own.toml", OWN)).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut n_checked = 0;
    let mut slopes = std::collections::BTreeMap::new();
    for machine in &machines {
        let mut carriers = vec![Carrier::Table];
        carriers.extend(machine.side(Side::Workpiece).filter(|a| a.name.is_rotary()).map(|a| Carrier::Axis(a.name)));
        let set_ups: Vec<SetUp> = carriers
            .iter()
            .enumerate()
            .map(|(i, c)| SetUp {
                label: format!("b{i}"),
                carrier: *c,
                body: [Body::Box, Body::Sphere, Body::CylinderWithEnd][i % 3],
                centre: Vector3::new(30.0, -10.0, -200.0),
                runs: vec![0, 1],
            })
            .collect();
        for effect in catalogue.iter().filter(|e| e.applies_to(machine)) {
            let model = Model::new(machine, &[effect], &set_ups, machine.reference.pivot);
            let mut row = vec![0.0; model.n_unknowns()];
            let mut largest = vec![0.0f64; model.n_unknowns()];
            for _ in 0..60 {
                let touch = random_touch(machine, &carriers, &mut rng);
                // sizes far above usual ones, so that an error of second order would show
                let theta: Vec<f64> = model
                    .unknowns
                    .iter()
                    .map(|u| {
                        if effect.discrete {
                            rng.random_range(-0.5..0.5)
                        } else if u.start == 0.0 {
                            rng.random_range(-20.0..20.0) * u.typical
                        } else {
                            u.start * rng.random_range(0.8..1.2)
                        }
                    })
                    .collect();
                model.gap_and_row(&touch, &theta, &mut row);
                for j in 0..theta.len() {
                    // a swapped sign moves a touch by metres: what a central difference leaves is of third order
                    let small = stands_inside(&model, j) || effect.discrete;
                    let step = if small { 1e-5 } else { 1e-4 } * model.unknowns[j].typical;
                    let mut at = theta.clone();
                    at[j] += step;
                    let plus = model.gap(&touch, &at) / SIGMA_MM;
                    at[j] = theta[j] - step;
                    let minus = model.gap(&touch, &at) / SIGMA_MM;
                    let numeric = (plus - minus) / (2.0 * step);
                    let analytic = row[j] / SIGMA_MM;
                    let scale = analytic.abs().max(1.0 / model.unknowns[j].typical);
                    assert!(
                        (analytic - numeric).abs() < 2e-5 * scale,
                        "{} {} {}: analytic {} numeric {}",
                        machine.name,
                        effect.id,
                        model.unknowns[j].name,
                        analytic,
                        numeric
                    );
                    largest[j] = largest[j].max(row[j].abs());
                    n_checked += 1;
                }
            }
            // an error may leave no trace on one machine (a turn about the stylus itself), but not on all
            for (u, size) in model.unknowns.iter().zip(&largest) {
                let name = u.name.split('@').next().unwrap_or_default().to_owned();
                let most = slopes.entry((u.effect.clone(), name)).or_insert(0.0_f64);
                *most = most.max(*size);
            }
        }
    }
    for ((effect, name), most) in &slopes {
        let excused = WITHOUT_DERIVATIVE.iter().any(|(e, p, _)| effect.starts_with(e) && name.starts_with(p));
        assert!(*most > 0.0 || excused, "{effect} {name} never has a derivative");
    }
    assert!(n_checked > 10_000, "{n_checked}");
}

/// The touches of two programs with the scatter of visits in their noise: the whitened Jacobian is the derivative of the
/// whitened residuals, the normal equations are its sums, and whitening is by V = σ²·I + τ²·Σ N·Nᵀ itself.
#[test]
fn whitened_rows_are_derivatives_also_where_visits_scatter() {
    use axiscal::fit::effects_of;
    use axiscal::fit::normal::Touches;
    use axiscal::fit::solve::Problem;
    use axiscal::model::data::{Run, assemble};
    use axiscal::simulate::Scenario;
    use nalgebra::{DMatrix, DVector};
    let (sigma_mm, tau_mm) = (1e-3, 0.7e-3);
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let catalogue = Catalogue::built_in().unwrap();
    for (name, programs, location) in [
        ("swivel-head", &["head", "table"][..], ["location-b", "location-c"]),
        ("trunnion", &["basic"], ["location-a", "location-c"]),
    ] {
        let machine = common::machine(name);
        let plans: Vec<_> = programs.iter().map(|p| common::plan(&machine, p)).collect();
        let scenario = Scenario::flawless().with_noise(sigma_mm, tau_mm, 3);
        let touches: Vec<_> = plans.iter().map(|p| common::touch(&machine, p, &scenario, None)).collect();
        let runs: Vec<Run> = plans
            .iter()
            .zip(&touches)
            .map(|(plan, touches)| Run { plan, touches, mounting: None, started_s: None })
            .collect();
        let data = assemble(&machine, &runs);
        let ids = [location[0], location[1], "block-setup", "pretravel", "backlash-x"].map(str::to_owned);
        let effects = effects_of(&ids, &catalogue, &machine).unwrap();
        let model = Model::new(&machine, &effects, &data.set_ups, machine.reference.pivot);
        let free: Vec<usize> = (0..model.n_unknowns()).collect();
        let batch = model.prepare(&data.observations);
        let priors = [(0, 0.001, 0.02)];
        let mut problem = Touches::new(&batch, &data.visits, model.start(), &free, &priors, (sigma_mm, tau_mm));
        // one touch is not used
        let mut weights = vec![1.0; data.observations.len()];
        weights[5] = 0.0;
        problem.set_weights(weights.clone());
        let typical = |j: usize| model.unknowns[j].typical;
        let theta = DVector::from_fn(free.len(), |j, _| rng.random_range(-3.0..3.0) * typical(j));
        let (residual, jacobian) = problem.dense(&theta);
        for j in 0..free.len() {
            let step = 1e-4 * typical(j);
            let mut at = theta.clone();
            at[j] += step;
            let plus = problem.dense(&at).0;
            at[j] -= 2.0 * step;
            let numeric = (plus - problem.dense(&at).0) / (2.0 * step);
            let off = (&numeric - jacobian.column(j)).amax();
            let scale = jacobian.column(j).amax().max(1.0 / typical(j));
            assert!(off < 2e-5 * scale, "{name} {}: {off:e} of {scale:e}", model.unknowns[j].name);
        }
        let normal = problem.normal(&theta, true);
        let close = |a: f64, b: f64, scale: f64| (a - b).abs() < 1e-9 * scale;
        assert!(close(normal.sum, residual.norm_squared(), residual.norm_squared()), "{name}");
        let (gradient, gram) = (jacobian.tr_mul(&residual), jacobian.tr_mul(&jacobian));
        for i in 0..free.len() {
            let scale = gram[(i, i)].sqrt() * residual.norm();
            assert!(close(normal.gradient[i], gradient[i], scale), "{name} {}", model.unknowns[i].name);
            for j in 0..free.len() {
                let scale = (gram[(i, i)] * gram[(j, j)]).sqrt();
                assert!(close(normal.gram[(i, j)], gram[(i, j)], scale), "{name} {i} {j}");
            }
        }
        // V itself, without any of the above
        let used: Vec<usize> = (0..weights.len()).filter(|&i| weights[i] > 0.0).collect();
        let n = |i: usize| Vector3::from_fn(|k, _| data.observations[i].state[slot::NORMAL_IN_R + k]);
        let v = DMatrix::from_fn(used.len(), used.len(), |a, b| {
            let shared = if data.visits[used[a]] == data.visits[used[b]] { n(used[a]).dot(&n(used[b])) } else { 0.0 };
            tau_mm * tau_mm * shared + if a == b { sigma_mm * sigma_mm } else { 0.0 }
        });
        let gaps = problem.gaps(&theta);
        let gaps = DVector::from_iterator(used.len(), used.iter().map(|&i| gaps[i]));
        let prior = ((theta[0] - 0.001) / 0.02_f64).powi(2);
        let sum = gaps.dot(&v.cholesky().unwrap().solve(&gaps)) + prior;
        assert!(close(sum, normal.sum, sum), "{name}: {sum} and {}", normal.sum);
    }
}
