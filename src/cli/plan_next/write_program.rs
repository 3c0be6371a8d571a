//! What was chosen, for the person who waits: the files, and what they will tell.

use super::{Answer, Args, Io};
use crate::design::choose_touches::Separation;
use crate::diag::Result;
use crate::files;
use crate::post::Postprocessor;
use crate::program;
use crate::report::fit::{number, significant};
use crate::workflow::Loaded;
use crate::workflow::generate::prove;
use crate::workflow::new::relative;
use crate::workflow::plan_next::{Program, SAFELY};
use comfy_table::Cell;
use serde_json::json;
use std::path::Path;

/// Pairs that are listed: those that matter most for the person who waits.
const MOST_LISTED: usize = 20;

/// Writes program, plan and program file, and says what they will tell.
pub(super) fn write(
    args: &Args,
    loaded: &Loaded,
    post: &Postprocessor,
    plan_file: &Path,
    Program { questions, chosen }: &Program,
    io: &Io,
) -> Result<Answer> {
    let plan = &chosen.generated.plan;
    let nc = post.program(&loaded.machine, plan, &chosen.generated.path)?;
    io.report(&nc.findings.0);
    let program_file = args.out.join(format!("{}.{}", plan.program, nc.extension));
    let form_file = args.out.join(format!("{}.toml", plan.program));
    let name = format!("{}.{}", plan.program, nc.extension);
    let proof = prove(&loaded.machine, post, plan, &name, &nc, io)?;
    let mut proven = plan.clone();
    proven.blocks_anew = chosen.label.is_none();
    proven.programs.extend(proof.map(|(p, _)| (post.name.clone(), p)));
    let plan_text = proven.to_json();
    let own = [(plan_file.to_path_buf(), plan_text.as_bytes()), (form_file.clone(), chosen.text.as_bytes())];
    let programs = nc.files(&plan.program).into_iter().map(|(name, text)| (args.out.join(name), text.as_bytes()));
    files::write_together(&own.into_iter().chain(programs).collect::<Vec<_>>())?;
    let seconds = chosen.generated.path.seconds;
    io.say(&questions.says);
    io.say(format!(
        "{} touches on mounting {:?}, about {}",
        plan.touches.len(),
        plan.mounting,
        program::duration(seconds)
    ));
    match &chosen.label {
        Some(_) => io.say("leave the blocks as the last run left them"),
        None => io.say("put the blocks up first; the time for it is not counted"),
    }
    say_separations(&chosen.separations, io);
    let turns =
        chosen.separations.iter().filter(|s| s.told < SAFELY && s.told_if_room_turns.is_some_and(|p| p >= SAFELY));
    let turns = match turns.count() {
        0 => None,
        n => Some(format!(
            "{n} more only if the room's temperature does not go on as in the runs so far, but turns or swings while the \
             program runs (reckoned with {:.0} K up and down in {:.0} min: open a gate, switch the heating, or run it at another \
             time of day); where the room goes on as before, what goes with it and what goes with time stay one",
            crate::design::linearised_plan::SWING_K,
            crate::design::linearised_plan::SWING_S / 60.0
        )),
    };
    turns.iter().for_each(|says| io.say(says));
    for pair in &chosen.never {
        io.say(format!("no touches of this machine separate {pair}: check at the machine which it is"));
    }
    let log = args.out.join(format!("{}.log", plan.program));
    io.say(format!(
        "written: {}\n         {}\n         {}",
        program_file.display(),
        plan_file.display(),
        form_file.display()
    ));
    for beside in nc.beside.iter().filter(|beside| beside.to_control) {
        let file = args.out.join(&beside.name);
        io.say(format!("{} goes to the control with the program: {}", file.display(), beside.says));
    }
    io.say(format!(
        "when it has run: axiscal plan-next {} --out {} --controller {} {}--join {}\nor by hand:\n\n{}",
        args.study.display(),
        args.out.display(),
        args.controller.as_deref().unwrap_or(&post.name),
        if args.moved { "--moved " } else { "" },
        log.display(),
        entry(
            &relative(plan_file, loaded.folder()),
            &relative(&log, loaded.folder()),
            args.controller.as_deref().unwrap_or(&post.name),
            chosen.label.as_deref()
        )
    ));
    io.answer(&json!({
        "format": "axiscal-next/1",
        "says": questions.says,
        "pairs": chosen.separations,
        "separates": separates(&chosen.separations),
        "room": turns,
        "never": chosen.never,
        "touches": plan.touches.len(),
        "time_s": seconds,
        "mounting": chosen.label,
        "program": program_file.display().to_string(),
        "plan": plan_file.display().to_string(),
    }));
    Ok(Answer::Done)
}

/// What is separated now, and what will be.
pub(super) fn say_separations(separations: &[Separation], io: &Io) {
    let mut t = crate::report::fit::table(&["is it", "or", "separation now", "with these touches", "separated"]);
    for s in separations.iter().take(MOST_LISTED) {
        t.add_row(vec![
            Cell::new(&s.one),
            Cell::new(s.other.as_deref().unwrap_or("nothing")),
            number(significant(s.before)),
            number(significant(s.after)),
            number(will_separate(s)),
        ]);
    }
    crate::report::lay::lay(&mut t, io.paper(false).width.min(120), &[]);
    io.say(io.paper(false).plain(t.to_string()));
    io.say(format!("{}; a separation of 25 or more is nearly always enough", separated_count(separations)));
}

/// Will a pair be separated?
fn will_separate(s: &Separation) -> String {
    match s.told {
        p if p >= SAFELY => format!("yes ({:.0} %)", (100.0 * p).floor()),
        _ if s.told_if_room_turns.is_some_and(|p| p >= SAFELY) => "if the room turns".to_owned(),
        p if p >= 0.5 => format!("likely ({:.0} %)", 100.0 * p),
        p => format!("no ({:.0} %)", 100.0 * p),
    }
}

fn separated_count(separations: &[Separation]) -> String {
    let told = separations.iter().filter(|s| s.told >= SAFELY).count();
    format!(
        "{told} of {} pairs will be separated by `diagnose` (with 95 % or more, whichever of the two acts)",
        separations.len()
    )
}

/// The lines that a page shows: the count of pairs, then each pair.
pub(super) fn separates(separations: &[Separation]) -> Vec<String> {
    let pair =
        |s: &Separation| format!("{} or {}: {}", s.one, s.other.as_deref().unwrap_or("nothing"), will_separate(s));
    std::iter::once(separated_count(separations)).chain(separations.iter().take(MOST_LISTED).map(pair)).collect()
}

/// The study's table of the run, as a person would write it.
fn entry(plan: &str, log: &str, controller: &str, label: Option<&str>) -> String {
    let mounting = label.map_or_else(String::new, |l| {
        let before = l.split('/').next().unwrap_or(l);
        format!("mounting = \"{l}\"        # and in the [[data]] before it: mounting = \"{before}\"\n")
    });
    format!("[[data]]\nplan = \"{plan}\"\nlog = \"{log}\"\ncontroller = \"{controller}\"\n{mounting}")
}
