//! `axiscal demo`: the whole loop on built-in data, in seconds, with every file left behind to look at. It calls the very
//! verbs that a user calls, one after the other, and prints each call.

use super::{Answer, Io, call};
use crate::diag::{Failure, Result};
use crate::files;
use crate::fit::{self, Fit};
use crate::report::fit::significant;
use crate::workflow::load_study;
use serde_json::json;
use std::path::{Path, PathBuf};

#[derive(Debug, clap::Args)]
pub struct Args {
    /// The folder to write to
    #[arg(long, default_value = "axiscal-demo")]
    pub out: PathBuf,
}

/// What is wrong with the machine of the demo; no verb but `simulate` is told.
const SCENARIO: &str = include_str!("demo_wrong.toml");

/// Files of an earlier demo: written anew, where the folder is one of the demo.
const WRITTEN: [&str; 8] = [
    "auto.log",
    "study.toml",
    "study.history.json",
    "check-before.log",
    "check-after.log",
    "check-before.toml",
    "check-after.toml",
    "wrong.toml",
];

/// A step: what it is for, and the call; `OUT/` stands for the folder.
const STEPS: [(&str, &str); 17] = [
    (
        "one calibration sphere on a trunnion: a probing program for LinuxCNC, chosen and checked for limits and collisions",
        "generate --machine trunnion --program auto --artefact sphere --minutes 20 --controller linuxcnc --out OUT",
    ),
    (
        "the virtual machine runs it with hidden errors and writes the control's log",
        "simulate --plan OUT/auto.plan.json --machine trunnion --machines OUT/machines.toml --scenario OUT/wrong.toml --controller linuxcnc --out OUT/auto.log",
    ),
    (
        "a study: what was measured, and the effects of the model",
        "new --machine trunnion --machines OUT/machines.toml --plan OUT/auto.plan.json --log OUT/auto.log --controller linuxcnc --out OUT/study.toml",
    ),
    ("the machine's errors with their uncertainty: the model does not fit yet", "identify OUT/study.toml"),
    ("where does it fail?", "compare OUT/study.toml"),
    ("which physical effect is missing?", "diagnose OUT/study.toml"),
    ("the effects are added one by one, until the model is complete", "solve OUT/study.toml --yes"),
    ("every model tried, and the error falling", "history OUT/study.toml"),
    ("the errors again, now that nothing is missing", "identify OUT/study.toml"),
    ("all of it on one page, to look at, mail or print", "report OUT/study.toml --out OUT/report.html"),
    (
        "the compensation as the control's own tables",
        "export OUT/study.toml --controller linuxcnc --out OUT/compensation",
    ),
    (
        "does it work? a program that touches other points",
        "generate --machine trunnion --machines OUT/machines.toml --program OUT/check.toml --controller linuxcnc --out OUT",
    ),
    (
        "run without the compensation",
        "simulate --plan OUT/check.plan.json --machine trunnion --machines OUT/machines.toml --scenario OUT/wrong.toml --controller linuxcnc --out OUT/check-before.log",
    ),
    (
        "run with the compensation",
        "simulate --plan OUT/check.plan.json --machine trunnion --machines OUT/machines.toml --scenario OUT/wrong.toml --controller linuxcnc --compensation OUT/compensation --out OUT/check-after.log",
    ),
    (
        "a study for each of the two runs",
        "new --machine trunnion --machines OUT/machines.toml --plan OUT/check.plan.json --log OUT/check-before.log --controller linuxcnc --out OUT/check-before.toml",
    ),
    (
        "the second one names the compensation that was active",
        "new --machine trunnion --machines OUT/machines.toml --plan OUT/check.plan.json --log OUT/check-after.log --controller linuxcnc --compensation OUT/compensation --out OUT/check-after.toml",
    ),
    ("before and after, side by side", "verify OUT/check-before.toml OUT/check-after.toml"),
];

/// # Errors
/// When the folder cannot be written, or holds something else.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    prepare(&args.out)?;
    let inner = io.inner();
    let study = args.out.join("study.toml");
    let mut before = None;
    let mut done = Vec::new();
    for (i, (what, line)) in STEPS.iter().enumerate() {
        let words: Vec<String> = line.split(' ').map(|w| in_folder(w, &args.out)).collect();
        io.say(format!("\n=== {} of {}: {what}\n$ axiscal {}\n", i + 1, STEPS.len(), words.join(" ")));
        // "no" is an answer: the model that lacks something does not fit
        let answer = call(&words, &inner)?;
        done.push(json!({ "what": what, "call": words, "answer": if answer == Answer::Done { "yes" } else { "no" } }));
        if words[0] == "new" && before.is_none() {
            before = Some(look(&study, &inner)?);
        }
    }
    let Some(before) = before else {
        return Err(
            Failure::new("demo::no_study", "the demo wrote no study").help("report this: it is a fault of the program")
        );
    };
    let after = look(&study, &inner)?;
    let (readings_before, readings_after) =
        (readings(&args.out, "before", &inner)?, readings(&args.out, "after", &inner)?);
    let out = args.out.display();
    io.say(format!(
        "\n=== what the demo has shown\nThe model missed the touches by {} µm RMS, and by {} µm with what was found missing; the noise is {} µm.\n\
         At other points the machine was off by {} µm RMS before, and by {} µm with its compensation.\n",
        significant(before.outcome.rms_um),
        significant(after.outcome.rms_um),
        significant(after.outcome.noise_um),
        significant(readings_before),
        significant(readings_after),
    ));
    io.say("Where to look:");
    for (file, what) in [
        ("auto.ngc", "the program: its head says where to put the sphere, and how to stop"),
        ("auto.log", "what LinuxCNC would have written"),
        ("wrong.toml", "what was wrong with the machine"),
        ("study.toml", "the study, with the effects that were added"),
        ("report.html", "all of it as one page: open it in a browser"),
        ("compensation/README.txt", "how to load the compensation, and what must be set again"),
    ] {
        io.say(format!("  {:<38} {what}", format!("{out}/{file}")));
    }
    io.answer(&json!({
        "out": args.out.display().to_string(), "steps": done,
        "before": brief(&before), "after": brief(&after),
        "check": { "rms_before_um": readings_before, "rms_after_um": readings_after },
    }));
    // the machine is one of our own: an error that does not fall is a fault of the program
    let fell = after.outcome.rms_um < 0.8 * before.outcome.rms_um && readings_after < 0.5 * readings_before;
    Ok(if fell { Answer::Done } else { Answer::No })
}

fn in_folder(word: &str, out: &Path) -> String {
    match word.strip_prefix("OUT") {
        Some(rest) => out.join(rest.trim_start_matches('/')).display().to_string().trim_end_matches('/').to_owned(),
        None => word.to_owned(),
    }
}

/// Takes the files of an earlier demo away, and writes what the machine has wrong with it. A folder of somebody else is
/// left alone: the verbs do not write over what is there.
fn prepare(out: &Path) -> Result<()> {
    if files::read_own(&out.join("wrong.toml")).is_ok_and(|text| text == SCENARIO.as_bytes()) {
        for name in WRITTEN {
            files::remove(&out.join(name))?;
        }
    }
    files::write_whole(&out.join("wrong.toml"), SCENARIO.as_bytes())?;
    files::write_whole(&out.join("check.toml"), include_str!("demo_check.toml").as_bytes())
}

fn look(study: &Path, io: &Io) -> Result<Fit> {
    let loaded = load_study(study, io)?;
    loaded.fit(&loaded.settings())
}

/// RMS of the readings at the check points, µm: only the blocks' places and the probe are solved for.
fn readings(out: &Path, when: &str, io: &Io) -> Result<f64> {
    let loaded = load_study(&out.join(format!("check-{when}.toml")), io)?;
    let mut settings = loaded.settings();
    settings.quick = true;
    settings.effects.retain(|id| loaded.catalogue.get(id, &loaded.machine).is_some_and(|e| e.nuisance));
    Ok(loaded.fit(&settings)?.outcome.rms_um)
}

fn brief(fit: &Fit) -> fit::outcome::Outcome {
    fit::outcome::Outcome { residuals: None, ..fit.outcome.clone() }
}
