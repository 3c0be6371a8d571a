//! The emitted programs on a real LinuxCNC, black box: the binary, the rig in `tests/linuxcnc`, and files in between.
//!
//! Runs when AXISCAL_LINUXCNC is set (`./run-tests` installs LinuxCNC and sets it); says what it leaves out otherwise.
//! AXISCAL_WARP sets how many times faster than real time LinuxCNC runs (40), AXISCAL_SEED repeats a drawn case.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a panic in a test is a failure with its place

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

mod job;
mod stops;

use job::{Control, Job, Study};

type Check = Result<(), String>;

/// A name and what it does.
type Case = (&'static str, fn() -> Check);

/// A case that asserts: its panic is the reason.
fn unpanicked(case: fn()) -> Check {
    std::panic::catch_unwind(case).map_err(|e| match e.downcast::<String>() {
        Ok(text) => *text,
        Err(e) => e.downcast::<&str>().map_or_else(|_| "panicked".to_owned(), |text| (*text).to_owned()),
    })
}

fn main() {
    let filter: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let cases: [Case; 11] = [
        ("rs274_accepts_every_program", || unpanicked(stops::rs274_accepts_every_program)),
        ("it_stops_with_the_name_of_the_touch", || {
            unpanicked(stops::it_stops_with_the_name_of_the_touch_and_gives_the_settings_back)
        }),
        ("it_can_be_started_again_at_a_set_up", || unpanicked(stops::it_can_be_started_again_at_a_set_up)),
        ("the_papers_order_head_compensate_table_compensate", the_papers_order),
        ("drawn_errors_and_displaced_blocks_in_one_study", drawn_errors),
        ("plain_servo_latch_with_pretravel_in_the_model", servo_latch),
        ("full_with_two_styli_and_its_stops", full_program),
        ("stock_kinematics_of_a_trunnion", stock_trunnion),
        ("stock_kinematics_of_a_swivel_table", stock_swivel_table),
        ("one_sphere_on_a_trunnion", one_sphere),
        ("one_sphere_put_down_by_eye", one_sphere_by_eye),
    ];
    if std::env::args().any(|a| a == "--list") {
        cases.iter().for_each(|(name, _)| println!("{name}: test"));
        return;
    }
    let chosen: Vec<_> = cases
        .iter()
        .filter(|(name, _)| filter.is_empty() || filter.iter().any(|f| name.contains(f.as_str())))
        .collect();
    if std::env::var_os("AXISCAL_LINUXCNC").is_none() {
        println!(
            "\nleft out: {} tests on a real LinuxCNC. They take eight minutes and need Debian's linuxcnc-uspace;",
            chosen.len()
        );
        println!("./run-tests installs it and runs them (AXISCAL_LINUXCNC=required cargo test --test linuxcnc)\n");
        println!("test result: ok. 0 passed; 0 failed; {} ignored; 0 measured; 0 filtered out\n", chosen.len());
        return;
    }
    println!("\nrunning {} tests", chosen.len());
    let mut failed = Vec::new();
    for (name, case) in &chosen {
        let begun = std::time::Instant::now();
        match case() {
            Ok(()) => println!("test {name} ... ok ({:.0} s)", begun.elapsed().as_secs_f64()),
            Err(why) => {
                println!("test {name} ... FAILED\n{why}");
                failed.push(*name);
            }
        }
    }
    let word = if failed.is_empty() { "ok" } else { "FAILED" };
    println!(
        "\ntest result: {word}. {} passed; {} failed; 0 ignored; 0 measured; {} filtered out\n",
        chosen.len() - failed.len(),
        failed.len(),
        cases.len() - chosen.len()
    );
    if !failed.is_empty() {
        std::process::exit(101);
    }
}

// ------------------------------------------------------------------------------------------------- the cases

/// Set 1 of the paper.
const HEAD: [(&str, f64); 5] =
    [("a_BZ", 0.0150), ("b_BZ", -0.0100), ("g_BZ", 0.0200), ("d_xBZ", 0.0300), ("d_yBZ", 0.0250)];
const TABLE: [(&str, f64); 4] = [("a_CY", 0.0150), ("b_CY", -0.0100), ("d_xCY", 0.0300), ("d_yCY", 0.0250)];

/// Head → its values loaded → head again → table → its values loaded → table again.
fn the_papers_order() -> Check {
    let job = Job::new("swivel-head")?;
    job.generate("head", &[])?;
    job.generate("table", &[])?;
    let noise_um = 0.05;
    job.scenario(&[("paper-head", &HEAD), ("paper-table", &TABLE)], &[], noise_um, 7)?;

    job.run("head", "head-1", &Control::plain())?;
    let fit = job.identify("head-1", &Study::new(&["head"], &["head-1"], &["paper-head"], noise_um))?;
    within(&fit, &HEAD, Some(0.3))?;
    job.export("head-1", "comp-b")?;
    let with_b = job.component("comp-b")?;
    job.run("head", "head-2", &with_b)?;
    job.only_noise("head", "head-2", &["paper-head"], noise_um)?;

    job.run("table", "table-1", &with_b)?;
    let study = Study { active: Some("comp-b"), ..Study::new(&["table"], &["table-1"], &["paper-table"], noise_um) };
    let fit = job.identify("table-1", &study)?;
    within(&fit, &TABLE, Some(0.3))?;
    job.export("table-1", "comp-bc")?;
    let with_both = job.component("comp-bc")?;
    job.run("table", "table-2", &with_both)?;
    job.only_noise("table", "table-2", &["paper-table"], noise_um)
}

/// Errors and block displacements drawn now, both logs in one study: 39 unknowns of rank 39.
fn drawn_errors() -> Check {
    let job = Job::new("swivel-head")?;
    let (truth, noise_um) = (draw(&job)?, 0.05);
    job.generate("head", &[])?;
    job.generate("table", &[])?;
    let effects: Vec<(&str, &[(&str, f64)])> = truth.effects.iter().map(|(e, v)| (*e, &v[..])).collect();
    job.scenario(&effects, &truth.blocks, noise_um, truth.seed)?;
    job.run("head", "head", &Control::plain())?;
    job.run("table", "table", &Control::plain())?;
    let fit = job.identify("both", &Study::new(&["head", "table"], &["head", "table"], &MODEL, noise_um))?;
    if (fit["unknowns"].as_u64(), fit["rank"].as_u64()) != (Some(39), Some(39)) {
        return Err(format!("{} unknowns of rank {}, expected 39 of 39", fit["unknowns"], fit["rank"]));
    }
    for (_, values) in &truth.effects[..2] {
        within(&fit, values, None)?;
    }
    // at the ball's height the offsets of C are hardly correlated with its tilts: there the bound holds
    let fit = job.json(&["identify", "both.toml", "--reference", "ball"])?;
    let z = fit["reference_mm"][2].as_f64().ok_or("no reference")?;
    let at_ball = moved(&truth.effects, z);
    for (_, values) in &at_ball {
        within(&fit, values, Some(0.3))?;
    }
    Ok(())
}

/// LinuxCNC's own latch: up to feed × period late.
fn servo_latch() -> Check {
    let job = Job::new("swivel-head")?;
    let truth = draw(&job)?;
    job.generate("head", &[])?;
    job.generate("table", &[])?;
    let effects: Vec<(&str, &[(&str, f64)])> = truth.effects.iter().map(|(e, v)| (*e, &v[..])).collect();
    job.scenario(&effects, &truth.blocks, 0.5, truth.seed)?;
    let servo = Control { latch: "servo", ..Control::plain() };
    job.run("head", "head", &servo)?;
    job.run("table", "table", &servo)?;
    // 60 mm/min for up to 1 ms: uniformly distributed over 1 um, on top of the probe's 0.5 um
    let noise_um = (0.5f64.powi(2) + 1.0 / 12.0).sqrt();
    let fit = job.identify("both", &Study::new(&["head", "table"], &["head", "table"], &MODEL, noise_um))?;
    for (_, values) in &truth.effects[..2] {
        within(&fit, values, None)?;
    }
    let found = parameter(&fit, "pretravel")?["value"].as_f64().unwrap_or(f64::NAN);
    let late_um = 1e3 * (found - truth.effects[2].1[0].1);
    if !(0.2..0.8).contains(&late_um) {
        return Err(format!("the latch comes {late_um:.2} um late on average, expected about 0.5"));
    }
    Ok(())
}

/// One run of `full`: the operator changes the stylus at both stops. The zero of B and the place of its axis, which are
/// one number with a single stylus, come apart. The turntable also runs out once per turn, and the study is not told: the
/// diagnosis finds it in LinuxCNC's own log.
fn full_program() -> Check {
    let job = Job::new("swivel-head")?;
    let noise_um = 0.05;
    job.generate("full", &[])?;
    let effects: [(&str, &[(&str, f64)]); 4] = [
        ("location-b", &[("EX0B", 0.02), ("EZ0B", -0.015), ("EA0B", 0.004), ("EC0B", -0.006)]),
        ("location-c", &[("EX0C", 0.012), ("EY0C", -0.02), ("EA0C", -0.002), ("EB0C", 0.003)]),
        ("zero-b", &[("EB0B", 0.003)]),
        ("pretravel", &[("pretravel", 0.004)]),
    ];
    let blocks = [("full", "a", [0.2, -0.1, 0.15], [0.05, -0.1, 0.08])];
    job.scenario(&effects, &blocks, noise_um, 5)?;
    let run_out = "[[harmonic]]\naxis = \"C\"\ndof = \"dx\"\nk = 1\ncos_um = 3.0\nsin_um = 0.0\n\
                   [[harmonic]]\naxis = \"C\"\ndof = \"dy\"\nk = 1\ncos_um = 0.0\nsin_um = -2.0\n";
    let known = std::fs::read_to_string(job.dir.join("wrong.toml")).map_err(|e| e.to_string())?;
    job.write("wrong.toml", &format!("{known}{run_out}"))?;
    job.run("full", "full", &Control::plain())?;
    let model = ["location-b", "location-c", "zero-b", "block-setup", "pretravel"];
    let study = Study::new(&["full"], &["full"], &model, noise_um);
    job.write("full.toml", &study.text(&job.machine))?;
    let before = job.json(&["identify", "full.toml"])?["rms_um"].as_f64().unwrap_or(f64::NAN);
    let diagnosis = job.json_whatever(&["diagnose", "full.toml"])?;
    let first = &diagnosis["candidates"][0];
    let group: Vec<&str> = std::iter::once(&first["effect"])
        .chain(first["same_as"].as_array().into_iter().flatten())
        .filter_map(Value::as_str)
        .collect();
    println!("  {before:.2} um left; {}: {group:?}", diagnosis["verdict"]);
    if diagnosis["verdict"] != "missing-effect" || !group.contains(&"radial-c-1") {
        return Err(format!("the run-out of C was not found: {diagnosis}"));
    }
    let fit = job.json(&["add", "full.toml", "radial-c-1"])?["after"].clone();
    let after = fit["rms_um"].as_f64().unwrap_or(f64::NAN);
    println!("  {after:.3} um left with it");
    if after.is_nan() || after >= 1.25 * noise_um {
        return Err(format!("{before} um before, {after} um after the run-out was added"));
    }
    for (_, values) in &effects {
        within(&fit, values, None)?;
    }
    Ok(())
}

fn stock_trunnion() -> Check {
    stock(
        "trunnion",
        "xyzac-trt-kins",
        ["location-a", "zero-a"],
        [("EY0A", 0.021), ("EZ0A", -0.017)],
        ("EA0A", 0.006),
        ("EB0A", 0.004),
        "EA0C",
    )
}

fn stock_swivel_table() -> Check {
    stock(
        "swivel-table-b",
        "xyzbc-trt-kins",
        ["location-b", "zero-b"],
        [("EX0B", 0.021), ("EZ0B", -0.017)],
        ("EB0B", 0.006),
        ("EA0B", 0.004),
        "EB0C",
    )
}

/// What stock LinuxCNC can carry (pins, home offsets, axis tables), probed under its own transformation before and after.
fn stock(
    machine: &str,
    kins: &'static str,
    ids: [&str; 2],
    offsets: [(&'static str, f64); 2],
    zero: (&'static str, f64),
    tilt: (&'static str, f64),
    same_as_zero: &str,
) -> Check {
    let job = Job::new(machine)?;
    let noise_um = 0.05;
    job.generate("basic", &[])?;
    let first = [offsets[0], offsets[1], tilt];
    let c = [("EX0C", -0.014), ("EY0C", 0.019)];
    let scales = [("scale-x", [("EXX", 80.0)]), ("scale-y", [("EYY", -60.0)]), ("scale-z", [("EZZ", 50.0)])];
    let mut effects: Vec<(&str, &[(&str, f64)])> =
        vec![(ids[0], &first), (ids[1], std::slice::from_ref(&zero)), ("location-c", &c)];
    for (id, values) in &scales {
        effects.push((id, values));
    }
    job.scenario(&effects, &[], noise_um, 11)?;

    // the machine as it is: axis positions, no transformation
    job.run("basic", "as-is", &Control::plain())?;
    let model = [ids[0], ids[1], "location-c", "scale-x", "scale-y", "scale-z"];
    // a tilt of the turntable about the swivel axis is that axis's zero position: one number, held in one place
    let study = Study { zero: &[same_as_zero], ..Study::new(&["basic"], &["as-is"], &model, noise_um) };
    let fit = job.identify("as-is", &study)?;
    for (_, values) in &effects {
        within(&fit, values, Some(0.3))?;
    }
    job.export("as-is", "comp")?;

    // the same touches in the coordinates of the control's transformation: with nominal pins, then with the new ones
    job.generate("basic", &["--tcp"])?;
    let stock = job.dir.join("comp/stock");
    let nominal = Control { kins: Some(kins), hal: vec![stock.join("restore.hal")], ..Control::plain() };
    job.run("basic", "before", &nominal)?;
    let carried = Control {
        kins: Some(kins),
        hal: vec![stock.join("axiscal.hal")],
        ini: Some(stock.join("axiscal.ini")),
        ..Control::plain()
    };
    job.run("basic", "after", &carried)?;
    // the stock modules move the workpiece's zero: it is set again by touching off, here by the blocks' own set-up
    let shifted = ["block-setup"];
    let (before, after) = (
        job.left("basic", "before", &model, &shifted, noise_um)?,
        job.left("basic", "after", &model, &shifted, noise_um)?,
    );

    // the virtual machine with the same compensation says what must be left: the tilt that no pin carries
    job.call(&[
        "simulate",
        "--plan",
        "basic.plan.json",
        "--machine",
        machine,
        "--scenario",
        "wrong.toml",
        "--controller",
        "linuxcnc",
        "--compensation",
        "comp/stock",
        "--out",
        "predicted.log",
    ])?;
    let predicted = job.left("basic", "predicted", &model, &shifted, noise_um)?;
    println!("  {machine}: {before:.2} um before, {after:.3} um after, {predicted:.3} um predicted");
    if !(after < 0.3 * before && (after - predicted).abs() < 0.05 * predicted + 0.02) {
        return Err(format!("{before:.2} um before, {after:.3} um after, {predicted:.3} um predicted"));
    }
    Ok(())
}

/// The sphere that everybody owns, put down by hand, and a program that nobody has written: measured, compensated, measured again.
fn one_sphere() -> Check {
    let mut job = Job::new("trunnion")?;
    let noise_um = 0.05;
    job.generate("auto", &["--artefact", "sphere", "--minutes", "8"])?;
    job.machines = Some(job.dir.join("machines.toml"));
    let effects: [(&str, &[(&str, f64)]); 3] = [
        ("location-a", &[("EY0A", 0.021), ("EZ0A", -0.017), ("EB0A", 0.004), ("EC0A", -0.003)]),
        ("location-c", &[("EX0C", -0.014), ("EY0C", 0.019), ("EA0C", 0.002), ("EB0C", -0.003)]),
        ("pretravel", &[("pretravel", 0.004)]),
    ];
    job.scenario(&effects, &[("sphere", "ball", [0.4, -0.3, 0.5], [0.0; 3])], noise_um, 5)?;
    job.run("auto", "before", &Control::plain())?;
    let model = ["location-a", "location-c", "sphere-setup", "pretravel"];
    let study = Study { machines: Some("machines.toml"), ..Study::new(&["auto"], &["before"], &model, noise_um) };
    let fit = job.identify("before", &study)?;
    for (_, values) in &effects {
        within(&fit, values, Some(0.3))?;
    }
    job.export("before", "comp")?;
    let loaded = job.component("comp")?;
    job.run("auto", "after", &loaded)?;
    let at_zero: Vec<&str> = effects[..2].iter().flat_map(|(_, v)| v.iter().map(|(name, _)| *name)).collect();
    let study = Study {
        machines: Some("machines.toml"),
        zero: &at_zero,
        ..Study::new(&["auto"], &["after"], &model, noise_um)
    };
    let rms = job.identify("after", &study)?["rms_um"].as_f64().unwrap_or(f64::NAN);
    println!("  {rms:.4} um left of a noise of {noise_um} um");
    if !((0.7 * noise_um)..(1.3 * noise_um)).contains(&rms) {
        return Err(format!("{rms:.4} um left, expected the noise of {noise_um} um"));
    }
    Ok(())
}

/// The sphere stands 2.5 mm off in three directions: the program finds it, and nothing else is touched.
fn one_sphere_by_eye() -> Check {
    let mut job = Job::new("trunnion")?;
    let noise_um = 0.05;
    job.generate("auto", &["--artefact", "sphere", "--minutes", "12", "--placement-tolerance", "3"])?;
    job.machines = Some(job.dir.join("machines.toml"));
    let effects: [(&str, &[(&str, f64)]); 3] = [
        ("location-a", &[("EY0A", 0.021), ("EZ0A", -0.017), ("EB0A", 0.004), ("EC0A", -0.003)]),
        ("location-c", &[("EX0C", -0.014), ("EY0C", 0.019), ("EA0C", 0.002), ("EB0C", -0.003)]),
        ("pretravel", &[("pretravel", 0.004)]),
    ];
    job.scenario(&effects, &[("sphere", "ball", [2.5, -2.5, 2.5], [0.0; 3])], noise_um, 5)?;
    job.run("auto", "found", &Control::plain())?;
    let model = ["location-a", "location-c", "sphere-setup", "pretravel"];
    let study = Study { machines: Some("machines.toml"), ..Study::new(&["auto"], &["found"], &model, noise_um) };
    let fit = job.identify("found", &study)?;
    for (_, values) in &effects {
        within(&fit, values, Some(0.3))?;
    }
    let rms = fit["rms_um"].as_f64().unwrap_or(f64::NAN);
    println!("  {rms:.4} um left of a noise of {noise_um} um");
    if !((0.7 * noise_um)..(1.3 * noise_um)).contains(&rms) {
        return Err(format!("{rms:.4} um left, expected the noise of {noise_um} um"));
    }
    Ok(())
}

const MODEL: [&str; 4] = ["location-b", "location-c", "block-setup", "pretravel"];

// ------------------------------------------------------------------------------------------------- the truth

struct Truth {
    seed: u64,
    effects: Vec<(&'static str, Vec<(&'static str, f64)>)>,
    blocks: Vec<(&'static str, &'static str, [f64; 3], [f64; 3])>,
}

/// Location errors up to 50 um and 0.02 deg, blocks displaced by up to 0.3 mm and 2 mrad.
fn draw(job: &Job) -> Result<Truth, String> {
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).map_or(1, |d| d.as_secs());
    let seed = std::env::var("AXISCAL_SEED").ok().and_then(|s| s.parse().ok()).unwrap_or(now);
    println!("  drawn with AXISCAL_SEED={seed} in {}", job.dir.display());
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut values = |names: [&'static str; 4]| -> Vec<(&'static str, f64)> {
        names
            .into_iter()
            .map(|n| {
                (
                    n,
                    if n.starts_with("EX") || n.starts_with("EY") || n.starts_with("EZ") {
                        rng.random_range(-0.05..0.05)
                    } else {
                        rng.random_range(-0.02..0.02)
                    },
                )
            })
            .collect()
    };
    let effects = vec![
        ("location-b", values(["EX0B", "EZ0B", "EA0B", "EC0B"])),
        ("location-c", values(["EX0C", "EY0C", "EA0C", "EB0C"])),
        ("pretravel", vec![("pretravel", rng.random_range(0.0..0.01))]),
    ];
    let blocks = [("head", "x-"), ("head", "x+"), ("head", "y-"), ("head", "y+"), ("table", "x+")]
        .map(|(m, b)| {
            let shift = [0; 3].map(|_| rng.random_range(-0.3..0.3));
            let tilt = [0; 3].map(|_| rng.random_range(-2e-3f64..2e-3).to_degrees());
            (m, b, shift, tilt)
        })
        .to_vec();
    Ok(Truth { seed, effects, blocks })
}

/// Location errors of C stated at another height: exact for E(d, w) about another point.
fn moved(
    effects: &[(&'static str, Vec<(&'static str, f64)>)],
    z: f64,
) -> Vec<(&'static str, Vec<(&'static str, f64)>)> {
    let mut out = effects[..2].to_vec();
    let c = &mut out[1].1;
    let (a, b) = (c[2].1.to_radians(), c[3].1.to_radians());
    // d' = d + (R - 1) (0, 0, z) with R = Ry(b) Rx(a)
    c[0].1 += z * b.sin() * a.cos();
    c[1].1 += -z * a.sin();
    out
}

fn parameter<'a>(fit: &'a Value, name: &str) -> Result<&'a Value, String> {
    let all = fit["parameters"].as_array().ok_or("no parameters")?;
    all.iter().find(|p| p["name"] == name || p["alias"] == name).ok_or(format!("the fit has no parameter {name}"))
}

/// Every value within 4 sigma, and below `um` and 1e-4 deg where that is asked for.
fn within(fit: &Value, truth: &[(&str, f64)], um: Option<f64>) -> Check {
    for (name, planted) in truth {
        let p = parameter(fit, name)?;
        let (value, sigma) = (p["value"].as_f64().unwrap_or(f64::NAN), p["sigma"].as_f64().unwrap_or(f64::NAN));
        let off = value - planted;
        let bound = match (um, p["unit"].as_str()) {
            (Some(um), Some("mm")) => um * 1e-3,
            (Some(_), Some("deg")) => 1e-4,
            _ => f64::INFINITY,
        };
        if p["status"] != "identified" || !(off.abs() <= 4.0 * sigma && off.abs() <= bound) {
            return Err(format!(
                "{name}: {value} instead of {planted}: off by {off:.3e}, sigma {sigma:.3e}, bound {bound:.1e}, {}",
                p["status"]
            ));
        }
    }
    Ok(())
}
