//! A user's own effects are equal to the built-in ones: planted by the virtual machine from the file, predicted by the
//! model from the same file, by two readings that share no code.

use crate::common;
use assert_cmd::Command;
use axiscal::diag::source;
use axiscal::machine::{Machine, Mounting};
use axiscal::model::catalogue::{Catalogue, Effect};
use axiscal::model::data::{Run, assemble};
use axiscal::model::predict::Model;
use axiscal::simulate::{self, Scenario};
use common::more_machines::all_machines;
use common::random::random_plan;
use common::*;
use predicates::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Every place, every word, every function, shapes inside, rows for one side only, values for each block.
const OWN: &str = r#"
format = "axiscal-effects/1"
[[effect]]
id = "own-base"
name = "Column that leans and sinks"
at = "base"
terms = [
  { parameter = "b1", unit = "um", dof = "dx", formula = "sin(2*pi*t/period) + ln(1 + t)" },
  { parameter = "b2", unit = "urad", dof = "ry", formula = "T - 20" },
  { parameter = "b3", unit = "mm", dof = "dz", formula = "1e-3*(gx^2 + gy^2) - 2E-3*abs(gz)" },
]
shape = [ { parameter = "period", unit = "h", start = 1.5, min = 0.1, max = 10 } ]
[[effect]]
id = "own-tool"
at = "tool"
terms = [
  { parameter = "t1", unit = "um", dof = "dx", formula = "(L/L0)^3*cos(S) + feed/100" },
  { parameter = "t2", unit = "urad", dof = "rx", formula = "mx*sqrt(abs(my)) + mz*sign(feed - 100)" },
  { parameter = "t3", unit = "ms", dof = "dz", formula = "feed/60*step(mz - 0.2)" },
]
[[effect]]
id = "own-plate"
at = "workpiece"
arm = "x"
terms = [
  { parameter = "w1", unit = "um", dof = "dz", formula = "(px^2 + py^2)/1e4 + atan2(py, px) + pz/100" },
  { parameter = "w2", unit = "urad", dof = "rz", formula = "exp(-t/2)" },
]
[[effect]]
id = "own-block"
per = "block"
at = "block"
terms = [
  { parameter = "k1", unit = "um", dof = "dx", formula = "bx*edge/10 + ox" },
  { parameter = "k2", unit = "um", dof = "dy", formula = "by*edge/10 + oy*t" },
  { parameter = "k3", unit = "urad", dof = "rz", formula = "bz + oz" },
]
[[effect]]
id = "own-trigger"
at = "trigger"
terms = [ { parameter = "r1", unit = "um", dof = "r", formula = "mod(10*nx + 1.3, 3) + floor(3*ny + 0.5) + tan(nz/2) + asin(nx/2)*acos(ny/2) + atan(nz)" } ]
[[effect]]
id = "own-bent-block"
at = "block"
terms = [
  { parameter = "u1", unit = "um", dof = "dx", formula = "sin(X/40 + Z/70)" },
  { parameter = "u2", unit = "um", dof = "dz", formula = "Y/100*cos(C/2)" },
  { parameter = "u3", unit = "urad", dof = "ry", formula = "step(X - 20)" },
]
[[effect]]
id = "own-late"
at = "trigger"
terms = [ { parameter = "v1", unit = "um", dof = "r", formula = "1 + sin(X/50 - Y/30)*Z/100" } ]
[[effect]]
id = "own-reading"
at = "reading"
terms = [
  { parameter = "i1", unit = "um", dof = "X", formula = "cos(2*pi*X/4) + sX*sY*sZ" },
  { parameter = "i2", unit = "um/m", dof = "Z", formula = "Z" },
]
[[effect]]
id = "own-axes"
at = "X"
terms = [
  { parameter = "x1", unit = "um", dof = "dz", formula = "(X/100)^2 + Y/200", frame = "fixed" },
  { parameter = "x2", unit = "urad", dof = "rx", formula = "X*Y/3e4 + Z/200" },
  { parameter = "x3", unit = "um", dof = "dy", formula = "-(Y/100)^3", at = "Y" },
  { parameter = "x2", unit = "urad", dof = "rz", formula = "1", at = "Z" },
]
[[effect]]
id = "own-turn"
side = "tool"
at = "B"
terms = [
  { parameter = "q1", unit = "um", dof = "dx", formula = "cos(4*B)*sB", frame = "moving" },
  { parameter = "q2", unit = "urad", dof = "rx", formula = "sin(7*B)" },
]
[[effect]]
id = "own-turn"
side = "workpiece"
at = "B"
terms = [ { parameter = "q1", unit = "um", dof = "dx", formula = "cos(4*B)*sB", frame = "moving" } ]
[[effect]]
id = "own-table"
side = "workpiece"
at = "C"
terms = [
  { parameter = "q1", unit = "um", dof = "dx", formula = "cos(4*C)*sC", frame = "moving" },
  { parameter = "q2", unit = "mrad", dof = "ry", formula = "sin(7*C + A/2)" },
  { parameter = "q3", unit = "urad", dof = "C", formula = "sA + sC", at = "reading" },
]
unless = ["B"]
[[effect]]
id = "own-carriage"
at = "X"
about = "ball"
arm = "z"
terms = [ { parameter = "c1", unit = "um", dof = "dz", formula = "X/500" }, { parameter = "c2", unit = "urad", dof = "ry", formula = "{place}/30 + sin(Y/90)" } ]
[[effect]]
id = "own-bearing"
at = "C"
arm = "y"
terms = [ { parameter = "d1", unit = "urad", dof = "rx", formula = "cos(3*C)" }, { parameter = "d2", unit = "urad", dof = "rz", formula = "sin(2*C)" } ]
"#;

fn values(effect: &Effect, n_sets: usize, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let draw = |p: &axiscal::model::catalogue::Parameter, rng: &mut ChaCha8Rng| match p.shape {
        // a lever arm, mm
        Some((0.0, ..)) => rng.random_range(-300.0..300.0),
        Some((start, ..)) => start * rng.random_range(0.8..1.2),
        None => p.typical * rng.random_range(0.3..1.0),
    };
    (0..n_sets).flat_map(|_| effect.parameters.iter().map(|p| draw(p, rng)).collect::<Vec<_>>()).collect()
}

/// Where the probe points along the spindle its angle around it is that of two roundings, and a formula that jumps with it would say
/// another thing of each touch in the prediction and in the virtual machine.
#[test]
fn an_angle_of_nothing_is_the_same_on_both_sides() {
    const AROUND: &str = r#"
[[effect]]
id = "around"
name = "Around"
at = "trigger"
terms = [ { parameter = "around", unit = "um", dof = "r", formula = "1 + cos(4*atan2(my, mx)) + sign(nz) + sign(gx)" } ]
"#;
    let open = |name: &str| Ok(source(name, AROUND));
    let planted = "effects_file = \"mine.toml\"\n[effects.around]\naround = 4.0\n";
    let mut catalogue = Catalogue::default();
    catalogue.add_file(&source("mine.toml", AROUND)).unwrap();
    for machine in machines() {
        let plan = plan(&machine, "full");
        let (scenario, _) = simulate::scenario::parse_with(&source("planted", planted), &machine, &open).unwrap();
        let touches = touch(&machine, &plan, &scenario, None);
        let data = assemble(&machine, &[Run { plan: &plan, touches: &touches, mounting: None, started_s: None }]);
        let effects: Vec<&Effect> = catalogue.iter().collect();
        let model = Model::new(&machine, &effects, &data.set_ups, machine.reference.pivot);
        let along = data.observations.iter().filter(|o| o.state[11].hypot(o.state[12]) < 1e-9).count();
        assert!(along > 50, "{}: {along} touches along the spindle", machine.name);
        for o in &data.observations {
            assert!(model.gap(o, &[4.0]).abs() < 1e-9, "{} touch {}: {:e}", machine.name, o.id, model.gap(o, &[4.0]));
        }
    }
}

/// Largest effect and what is left of it at the planted values, mm.
fn plant(machine: &Machine, mounting: &Mounting, effect: &Effect, rng: &mut ChaCha8Rng) -> (f64, f64) {
    let plan = random_plan(machine, mounting, 40, rng);
    let run = |touches| Run { plan: &plan, touches, mounting: None, started_s: None };
    let touches = touch(machine, &plan, &Scenario::flawless(), None);
    let set_ups = assemble(machine, &[run(&touches)]).set_ups;
    let theta = values(effect, if effect.per_block { set_ups.len() } else { 1 }, rng);
    let mut text = format!(
        "effects_file = \"mine.toml\"\n[temperature]\nprofile = [[0.0, 18.0], [4.0, 25.0]]\n[effects.{}]\n",
        effect.id
    );
    for (i, value) in theta.iter().enumerate() {
        let p = &effect.parameters[i % effect.parameters.len()];
        let block = set_ups.get(i / effect.parameters.len()).filter(|_| effect.per_block);
        let name = block.map_or(p.name.clone(), |b| format!("{}@{}", p.name, b.label));
        text += &format!("{name:?} = {{ value = {value:?}, unit = {:?} }}\n", p.unit);
    }
    let open = |name: &str| Ok(source(name, OWN));
    let (scenario, _) = simulate::scenario::parse_with(&source("planted", &text), machine, &open).unwrap();
    assert_eq!(scenario.planted.len(), theta.len());
    let touches = touch(machine, &plan, &scenario, None);
    let data = assemble(machine, &[run(&touches)]);
    let model = Model::new(machine, &[effect], &data.set_ups, machine.reference.pivot);
    let shape = |i: usize| effect.parameters[i % effect.parameters.len()].shape.is_some();
    let without: Vec<f64> = theta.iter().enumerate().map(|(i, v)| if shape(i) { *v } else { 0.0 }).collect();
    data.observations.iter().fold((0.0, 0.0), |(largest, left): (f64, f64), o| {
        let (bare, planted) = (model.gap(o, &without), model.gap(o, &theta));
        assert!(bare.is_finite() && planted.is_finite());
        (largest.max(bare.abs()), left.max(planted.abs()))
    })
}

#[test]
fn a_users_effect_is_planted_as_it_is_predicted() {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut catalogue = Catalogue::default();
    catalogue.add_file(&source("mine.toml", OWN)).unwrap();
    let (mut n_planted, mut worst) = (0, 0.0_f64);
    let mut does = std::collections::BTreeMap::new();
    for machine in all_machines() {
        for effect in catalogue.iter().filter(|e| e.applies_to(&machine)) {
            for mounting in &machine.mountings {
                let (largest, left) = plant(&machine, mounting, effect, &mut rng);
                assert!(
                    left < 1e-8 * largest + 2e-12,
                    "{} on {} ({}): {left:e} mm of {largest:e} mm left",
                    effect.id,
                    machine.name,
                    mounting.name
                );
                let most = does.entry(effect.id.clone()).or_insert(0.0_f64);
                *most = most.max(largest);
                worst = worst.max(left);
                n_planted += 1;
            }
        }
    }
    println!("{n_planted} plantings of own effects; left at most {worst:e} mm");
    assert!(does.len() == 13 && does.values().all(|mm| *mm > 1e-4), "{does:?}");
}

#[test]
fn both_readings_know_the_same_words() {
    let machine = machine("swivel-head");
    let file = |formula: &str| {
        format!(
            "[[effect]]\nid = \"w\"\nat = \"B\"\nterms = [{{ parameter = \"p\", unit = \"um\", dof = \"dx\", formula = \"0*({formula})\" }}]\n"
        )
    };
    let mut words: Vec<String> = axiscal::model::formula::VARIABLES.map(str::to_owned).to_vec();
    let binary = ["atan2", "mod"];
    for f in axiscal::model::formula::FUNCTIONS {
        words.push(if binary.contains(&f) { format!("{f}(1, 2)") } else { format!("{f}(0.5)") });
    }
    words.extend(["pi", "1.5e-3", "2^3", "-(X^2)"].map(str::to_owned));
    let plan = |formula: &str| {
        let text = "effects_file = [\"w.toml\"]\n[effects.w]\np = 1.0\n";
        let open = |name: &str| Ok(source(name, file(formula)));
        simulate::scenario::parse_with(&source("s.toml", text), &machine, &open).map(|_| ())
    };
    for word in words {
        Catalogue::default().add_file(&source("w.toml", file(&word))).unwrap();
        plan(&word).unwrap();
    }
    for wrong in ["Q", "sine(B)", "sX2", "1 +", "q*2", "(B", "nq", "mw", "x"] {
        assert!(Catalogue::default().add_file(&source("w.toml", file(wrong))).is_err(), "{wrong}");
        let failure = plan(wrong).unwrap_err();
        assert_eq!(failure.0[0].code, "effects::formula", "{wrong}");
        assert!(failure.0[0].place().unwrap().starts_with("w.toml:4:"), "{wrong}: {:?}", failure.0[0].place());
        assert!(failure.0[0].help.as_ref().unwrap().contains("gx gy gz L L0"), "{wrong}");
    }
}

fn axiscal(folder: &std::path::Path) -> Command {
    let mut command = Command::cargo_bin("axiscal").unwrap();
    command.current_dir(folder);
    command
}

const MINE: &str = r#"format = "axiscal-effects/1"
[[effect]]
id = "my-sag"
name = "Sag of the head, steeper than a sine"
says = "The head sinks as it tilts"
look = "Touch tops at several angles"
at = "B"
terms = [ { parameter = "sag", unit = "um", dof = "dz", formula = "-(abs(sin(B))^1.5)", typical = 10 } ]
"#;

#[test]
fn a_users_effect_goes_from_simulation_to_identification() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    file("plan.json", &plan(&machine("swivel-head"), "head").to_json());
    file("my-effects.toml", MINE);
    let scenario = "seed = 3\neffects_file = [\"my-effects.toml\"]\n[effects.my-sag]\nsag = 12.0\n\
                    [effects.paper-head]\na_BZ = 0.015\nd_xBZ = 0.03\n[noise]\ntouch_um = 0.5\n";
    file("s.toml", scenario);
    let call = ["simulate", "--plan", "plan.json", "--machine", "swivel-head", "--scenario", "s.toml"];
    axiscal(folder.path()).args(call).args(["--controller", "csv", "--out", "head.csv"]).assert().success();
    file(
        "study.toml",
        "machine = \"swivel-head\"\neffects_file = [\"my-effects.toml\"]\n[[data]]\nplan = \"plan.json\"\nlog = \"head.csv\"\n\
         controller = \"csv\"\n[noise]\nvisit_um = 0.0\n[model]\neffects = [\"paper-head\", \"my-sag\"]\n",
    );
    let answer = axiscal(folder.path()).args(["identify", "study.toml", "--json"]).assert().success();
    let answer: serde_json::Value = serde_json::from_slice(&answer.get_output().stdout).unwrap();
    let of = |name: &str| answer["parameters"].as_array().unwrap().iter().find(|p| p["name"] == name).unwrap().clone();
    // with this seed all three lie within: 95 of 100 would each
    for (name, truth) in [("sag", 12.0), ("EA0B", 0.015), ("EX0B", 0.03)] {
        let (value, expanded) = (of(name)["value"].as_f64().unwrap(), of(name)["expanded"].as_f64().unwrap());
        assert!((value - truth).abs() < expanded, "{name}: {value} ± {expanded}, planted {truth}");
        assert!(expanded < 0.2 * truth, "{name} is hardly told: {value} ± {expanded}");
    }
    // what it reads is not written over, and what is wrong in it is said with its place
    let over = ["--controller", "csv", "--force", "--out", "my-effects.toml"];
    axiscal(folder.path()).args(call).args(over).assert().code(2);
    file("my-effects.toml", &MINE.replace("sin(B)", "sinus(B)"));
    let run = axiscal(folder.path()).args(call).args(["--out", "other.log"]).assert().code(2);
    run.stderr(predicate::str::contains("my-effects.toml:8:").and(predicate::str::contains("sinus")));
    file("my-effects.toml", &MINE.replace("-(abs(sin(B))^1.5)", "1/sin(B)"));
    let run = axiscal(folder.path()).args(call).args(["--out", "other.log"]).assert().code(2);
    run.stderr(predicate::str::contains("has no value at touch 1"));
    file("my-effects.toml", &MINE.replace("my-sag", "head-sag"));
    let run = axiscal(folder.path()).args(call).args(["--out", "other.log"]).assert().code(2);
    run.stderr(predicate::str::contains("effect \"head-sag\" exists already"));
}

#[test]
fn effects_are_listed_and_shown_at_eighty_columns() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("mine.toml"), OWN).unwrap();
    let said = |arguments: &[&str]| {
        let run = axiscal(folder.path()).arg("effects").args(arguments).assert().success();
        let text = String::from_utf8(run.get_output().stdout.clone()).unwrap();
        let longest = text.lines().map(|l| l.chars().count()).max().unwrap();
        assert!(longest <= 80 || arguments.contains(&"--json"), "{arguments:?}: {longest} columns");
        text
    };
    let all = said(&["--effects-file", "mine.toml"]);
    for part in ["wobble", "radial-c-1", "EXC EYC", "2.2 um", "own-base"] {
        assert!(all.contains(part), "{part}");
    }
    let here = said(&["--machine", "trunnion"]);
    assert!(here.contains("tilt-a-3") && !here.contains("head-sag") && !here.contains("location-b"));
    let one = said(&["show", "warm-up"]);
    for part in ["ISO 230-3", "1 - exp(-t/tau)", "how to confirm", "what mends it", "every machine", "tried: 0.1 "] {
        assert!(one.contains(part), "{part}: {one}");
    }
    let json: serde_json::Value = serde_json::from_str(&said(&["show", "pitch-x", "--json"])).unwrap();
    let row = &json["effects"][0];
    assert_eq!(row["family"], "linear");
    assert_eq!(row["parameters"][2]["shape"]["scan"].as_array().unwrap().len(), 7);
    assert_eq!(row["parameters"][0]["iso"], "EXX");
    axiscal(folder.path()).args(["effects", "show", "head-sag", "-m", "trunnion"]).assert().code(2);
}

/// Effects that have no value anywhere, at some touches, or where B is negative; none of them is in the model.
const NO_VALUE: [(&str, &str); 3] =
    [("own-nowhere", "0*B/(B - B)"), ("own-steep", "1/sin(B)"), ("own-root", "sqrt(B)")];

#[test]
fn an_effect_without_a_value_spoils_no_other_one() {
    use axiscal::design::{Noise, Planned, Request, Task, assess};
    use axiscal::diagnose::{Options, Subject, diagnose};
    use axiscal::fit::{self, Settings, effects_of};
    let machine = machine("swivel-head");
    let plan = plan(&machine, "head");
    let scenario = Scenario::flawless().with_noise(1e-3, 0.0, 5);
    let touches = touch(&machine, &plan, &scenario, None);
    let runs = [Run { plan: &plan, touches: &touches, mounting: None, started_s: None }];
    let ids = ["location-b", "block-setup", "pretravel"].map(str::to_owned).to_vec();
    let settings = Settings { effects: ids.clone(), ..Settings::default() };
    let listed = |which: &[(&str, &str)]| {
        let mut catalogue = Catalogue::built_in().unwrap();
        let rows = which.iter().map(|(id, formula)| {
            let name = id.replace('-', "_");
            format!("[[effect]]\nid = \"{id}\"\nat = \"B\"\nterms = [{{ parameter = \"{name}\", unit = \"um\", dof = \"dy\", formula = \"{formula}\" }}]\n")
        });
        let text: String = rows.collect();
        catalogue.add_file(&source("mine.toml", &text)).unwrap();
        catalogue
    };
    let answers = |catalogue: &Catalogue| {
        let fit = fit::identify(&machine, catalogue, &runs, &settings).unwrap();
        let subject = Subject { machine: &machine, catalogue, settings: &settings, fit: &fit };
        let found = diagnose(subject, &Options { refit: false, ..Options::default() }).unwrap();
        let request = Request {
            task: Task {
                machine: &machine,
                catalogue,
                effects: effects_of(&ids, catalogue, &machine).unwrap(),
                held: Vec::new(),
                reference: machine.reference.pivot,
                temperature: true,
            },
            runs: vec![Planned::new(plan.clone())],
            names: vec!["head".to_owned()],
            probe: Noise { sigma_mm: 1e-3, tau_mm: 0.0 },
            acting_tau_mm: Some(0.0),
        };
        (fit.outcome, found, assess(&request).unwrap())
    };
    let good = [("own-good", "cos(3*B)")];
    let (o, found, a) = answers(&listed(&good));
    assert!(o.parameters.iter().any(|p| p.sigma_with_unmodelled.is_some()));
    let all: Vec<_> = good.iter().chain(&NO_VALUE).copied().collect();
    let (mut o2, mut found2, a2) = answers(&listed(&all));
    for (warnings, verb) in [(&o2.warnings, "identify"), (&found2.warnings, "diagnose"), (&a2.warnings, "assess")] {
        for (id, formula) in NO_VALUE {
            let says = |w: &&String| w.contains(id) && w.contains(&format!("{formula:?}")) && w.contains("touch ");
            assert!(warnings.iter().any(|w| says(&w)), "{verb} says nothing of {id}: {warnings:?}");
        }
        assert!(warnings.iter().all(|w| !w.contains("own-good")), "{verb}: {warnings:?}");
    }
    // and all the rest is the same answer
    o2.warnings = o.warnings.clone();
    found2.warnings = found.warnings.clone();
    assert_eq!(o, o2);
    assert_eq!(serde_json::to_value(&found).unwrap(), serde_json::to_value(&found2).unwrap());
    let seen = |a: &axiscal::design::record::Assessment| {
        let each = a.effects.iter().map(|e| (e.effect.clone(), e.visible, e.same_as.clone(), e.contained_in.clone()));
        each.collect::<Vec<_>>()
    };
    assert_eq!((seen(&a), &a.says, a.alias_pairs), (seen(&a2), &a2.says, a2.alias_pairs));
    for (p, q) in a.parameters.iter().zip(&a2.parameters) {
        assert!(
            (p.sigma_with_unmodelled.unwrap() / q.sigma_with_unmodelled.unwrap() - 1.0).abs() < 1e-9,
            "{p:?} {q:?}"
        );
    }
}

/// Twenty machines, each with its own noise and its blocks anywhere: what is said of a user's effect and of the errors beside
/// it holds the truth as often as it claims, and errors scatter as their uncertainties say.
#[test]
fn a_users_effect_is_covered_by_its_interval() {
    const RUNS: u64 = 20;
    let machine = machine("swivel-head");
    let mut catalogue = Catalogue::built_in().unwrap();
    catalogue.add_file(&source("my-effects.toml", MINE)).unwrap();
    let plan = plan(&machine, "head");
    let settings = axiscal::fit::Settings {
        effects: ["location-b", "block-setup", "pretravel", "my-sag"].map(str::to_owned).to_vec(),
        touch_sigma_mm: Some(1e-3),
        visit_sigma_mm: Some(0.0),
        quick: true,
        ..Default::default()
    };
    let truth =
        [("sag", 12.0), ("EX0B", 0.021), ("EZ0B", -0.015), ("EA0B", 0.0031), ("EC0B", -0.002), ("pretravel", 0.004)];
    let text = "effects_file = [\"my-effects.toml\"]\n[effects.my-sag]\nsag = 12.0\n[effects.pretravel]\npretravel = 0.004\n\
                [effects.location-b]\nEX0B = 0.021\nEZ0B = -0.015\nEA0B = 0.0031\nEC0B = -0.002\n";
    let open = |name: &str| Ok(source(name, MINE));
    let (planted, _) = simulate::scenario::parse_with(&source("s.toml", text), &machine, &open).unwrap();
    let mut covered = std::collections::BTreeMap::<&str, (usize, f64)>::new();
    for seed in 1..=RUNS {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut scenario = planted.clone().with_noise(1e-3, 0.0, seed);
        for block in &machine.mounting(&plan.mounting).unwrap().blocks {
            let shift = [0; 3].map(|_| rng.random_range(-0.1..0.1));
            let tilt = [0; 3].map(|_| rng.random_range(-1e-3..1e-3));
            scenario = scenario.with_block(&plan.mounting, &block.name, shift, tilt);
        }
        let touches = touch(&machine, &plan, &scenario, None);
        let run = Run { plan: &plan, touches: &touches, mounting: None, started_s: None };
        let fit = axiscal::fit::identify(&machine, &catalogue, &[run], &settings).unwrap();
        assert!(fit.outcome.undetermined.is_empty() && fit.outcome.rejected.len() < 3, "{:?}", fit.outcome.warnings);
        for (name, truth) in truth {
            let p = fit.outcome.parameters.iter().find(|p| p.name == name).unwrap();
            let error = p.value - truth;
            let (n, sum) = covered.entry(name).or_default();
            *n += usize::from(error.abs() <= p.expanded.unwrap());
            *sum += (error / p.sigma.unwrap()).powi(2);
        }
    }
    println!("{covered:?}");
    // 19 of 20 are expected; 15 or fewer has a chance of 3 in a thousand, and so has a mean square below 0.37 or above 2
    for (name, (n, sum)) in &covered {
        let mean_square = sum / RUNS as f64;
        assert!(*n >= 16 && (0.37..2.0).contains(&mean_square), "{name}: {n} of {RUNS}, mean square {mean_square}");
    }
    // all together: they share noise and touches
    let n: usize = covered.values().map(|c| c.0).sum();
    let mean_square = covered.values().map(|c| c.1).sum::<f64>() / (RUNS as usize * truth.len()) as f64;
    assert!((106..=119).contains(&n) && (0.6..1.5).contains(&mean_square), "{n} of 120, mean square {mean_square}");
}

/// A time constant of an effect that does not act stands where the search began, and that is not the file's `start`: what is
/// said of it is true.
#[test]
fn a_shape_that_leaves_no_trace_is_said_to_stand_at_the_best_of_its_range() {
    const WARM: &str = "[[effect]]\nid = \"warm-z\"\nat = \"tool\"\nterms = [{ parameter = \"grow\", unit = \"um\", dof = \"dz\", \
                        formula = \"1 - exp(-t/tau)\" }]\nshape = [{ parameter = \"tau\", unit = \"h\", start = 0.5, min = 0.1, max = 5.0 }]\n";
    let machine = machine("swivel-head");
    let mut catalogue = Catalogue::built_in().unwrap();
    catalogue.add_file(&source("warm.toml", WARM)).unwrap();
    let plan = plan(&machine, "head");
    let settings = axiscal::fit::Settings {
        effects: ["location-b", "block-setup", "pretravel", "warm-z"].map(str::to_owned).to_vec(),
        visit_sigma_mm: Some(0.0),
        quick: true,
        ..Default::default()
    };
    let mut stood = Vec::new();
    for seed in 1..=4 {
        let touches = touch(&machine, &plan, &Scenario::flawless().with_noise(1e-3, 0.0, seed), None);
        let run = Run { plan: &plan, touches: &touches, mounting: None, started_s: None };
        let fit = axiscal::fit::identify(&machine, &catalogue, &[run], &settings).unwrap();
        let o = &fit.outcome;
        let tau = o.parameters.iter().find(|p| p.name == "tau").unwrap();
        println!("{seed}: tau {} {:?}; {:?}", tau.value, tau.status, o.undetermined);
        if let Some(u) = o.undetermined.iter().find(|u| u.combination.contains_key("tau")) {
            assert!(u.says.contains("fits best") && !u.says.contains("set to 0"), "{}", u.says);
            stood.push(tau.value);
        }
    }
    assert!(stood.len() >= 2 && stood.iter().any(|v| (v - 0.5).abs() > 1e-6), "{stood:?}");
    assert!(stood.iter().all(|v| (0.1..=5.0).contains(v)), "{stood:?}");
}

/// What a file may not hold, each with its place and what to do.
#[test]
fn what_could_never_be_used_is_refused() {
    let file = |id: &str, parameter: &str, formula: &str, shape: &str| {
        format!(
            "[[effect]]\nid = {id:?}\nat = \"B\"\nterms = [{{ parameter = {parameter:?}, unit = \"um\", dof = \"dx\", formula = {formula:?} }}]\n{shape}"
        )
    };
    let inside =
        |name: &str| format!("shape = [{{ parameter = {name:?}, unit = \"h\", start = 0.5, min = 0.1, max = 5 }}]\n");
    let long = vec!["sin(B)"; 2000].join(" + ");
    let mut cases = vec![
        (file("", "p", "sin(B)", ""), "effects::id", "no id", "w.toml:2:"),
        (file(" ", "p", "sin(B)", ""), "effects::id", "no id", "w.toml:2:"),
        (file("w", "p", "sin(B)", &inside("tau")), "effects::shape", "\"tau\" stands in no formula", "w.toml:5:"),
        // a word of which it is a part is another one
        (
            file("w", "p", "sin(B)*taue", &(inside("tau") + "")),
            "effects::shape",
            "\"tau\" stands in no formula",
            "w.toml:5:",
        ),
        (file("w", "p", &long, ""), "effects::formula", "is 17997 characters long, and 4000 at most", "w.toml:4:"),
    ];
    for word in ["pi", "PI", "e", "E", "L", "sin"] {
        cases.push((file("w", word, "sin(B)", ""), "effects::parameter", "cannot be the name", "w.toml:4:"));
        let both = file("w", "p", "sin(B)", &inside(word));
        cases.push((both, "effects::parameter", "cannot be the name", "w.toml:5:"));
    }
    for (text, code, says, place) in cases {
        let failure = Catalogue::default().add_file(&source("w.toml", &text)).unwrap_err();
        let found = failure.0.iter().find(|f| f.code == code).unwrap_or_else(|| panic!("{code}: {:?}", failure.0));
        assert!(found.message.contains(says), "{}", found.message);
        assert!(found.place().unwrap().starts_with(place), "{says}: {:?}", found.place());
        assert!(found.help.is_some(), "{says}");
    }
    Catalogue::default().add_file(&source("w.toml", file("w", "p", "1 - exp(-t/tau)", &inside("tau")))).unwrap();
    let terms = vec!["sin(B)"; 400].join(" + ");
    Catalogue::default().add_file(&source("w.toml", file("w", "p", &terms, ""))).unwrap();
}

#[test]
fn a_constant_without_a_value_is_refused() {
    for formula in ["0/0", "1/0", "sqrt(-1)", "ln(0 - 2)"] {
        let text = format!(
            "[[effect]]\nid = \"w\"\nat = \"B\"\nterms = [{{ parameter = \"p\", unit = \"um\", dof = \"dx\", formula = \"{formula}\" }}]\n"
        );
        let failure = Catalogue::default().add_file(&source("w.toml", text)).unwrap_err();
        assert_eq!(failure.0[0].code, "effects::no_value", "{formula}");
        assert!(failure.0[0].place().unwrap().starts_with("w.toml:4:"), "{formula}: {:?}", failure.0[0].place());
    }
}

#[test]
fn mistakes_of_a_file_are_said_in_words_and_with_their_place() {
    let file = |formula: &str, unit: &str, dof: &str| {
        format!(
            "[[effect]]\nid = \"w\"\nat = \"B\"\nterms = [\n  {{ parameter = \"p\", unit = \"{unit}\", dof = \"{dof}\", formula = \"{formula}\" }},\n]\n"
        )
    };
    for (formula, wrong, says) in [
        ("1 - cos(Q)", "Q", "unknown word \"Q\" (variables: X Y Z A B C"),
        ("2*(1 - cos(B)", "(1", "not closed"),
        ("sin(B) cos(B)", "cos", "an operator is missing"),
        ("sin(B) +", "+", "a value is missing after"),
        ("1,5*B", ",", "a decimal point is a point"),
    ] {
        let text = file(formula, "um", "dx");
        let failure = Catalogue::default().add_file(&source("w.toml", &text)).unwrap_err();
        let column = 2 + text.lines().nth(4).unwrap().find(formula).unwrap() + formula.rfind(wrong).unwrap() - 1;
        assert!(failure.0[0].message.contains(says), "{formula}: {}", failure.0[0].message);
        assert_eq!(failure.0[0].place().unwrap(), format!("w.toml:5:{column}"), "{formula}");
    }
    for (formula, unit, dof, fits) in [
        ("1", "um", "rx", false),
        ("cos(C)", "um", "rx", false),
        ("cos(C)/L", "um", "rx", true),
        ("sin(B)", "urad", "dx", false),
        ("sin(B)*px", "urad", "dx", true),
        ("sin(B)", "urad", "ry", true),
        ("t", "um/h", "dx", true),
        ("t", "um/h", "rx", false),
    ] {
        let text = file(formula, unit, dof);
        let read = Catalogue::default().add_file(&source("w.toml", &text));
        match read {
            Ok(_) => assert!(fits, "{formula} {unit} {dof}"),
            Err(failure) => {
                assert!(!fits, "{formula} {unit} {dof}: {:?}", failure.0[0]);
                assert_eq!(failure.0[0].code, "effects::unit");
                assert!(failure.0[0].place().unwrap().starts_with("w.toml:5:"), "{:?}", failure.0[0].place());
            }
        }
    }
}
