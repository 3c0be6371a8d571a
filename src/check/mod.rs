//! An NC program is read back, run on the virtual machine with everything that may happen, and judged.
//!
//! ```text
//! text → ngc, macro_b, heidenhain (grammar of a dialect) → code → run (one machine) → explore (what may happen)
//!      → judge, touches (limits, shapes, plan, stops, settings), proof, statements (is it still what was written?)
//! ```
//!
//! The grammars are strict: what they do not know is an error with its place, never skipped. Nothing here knows how a
//! program was made; shapes and the proof of a single move come from [`crate::program`], contacts from
//! [`crate::simulate`].

mod branches;
mod by_eye;
mod called;
mod checked_program;
mod code;
mod dialect;
mod doubt;
mod explore;
mod harmless;
mod heidenhain;
mod hidden_rotation;
mod judge;
mod ladder;
mod lines;
mod macro_b;
mod needs_plan;
mod ngc;
mod run;
mod runs;
mod seconds;
mod settings;
mod sinumerik;
mod statements;
mod touches;
mod vm;
mod world;

use crate::diag::{Failure, Finding, Result, Severity, Source};
use crate::machine::{Machine, Mounting};
use crate::post::Postprocessor;
use crate::program::plan::{ControllerFrame, Plan, Proof};
use crate::program::scene::Scene;
use crate::simulate::Errorless;
use crate::units::Plain;
use checked_program::CheckedProgram;
use code::{Unknown, UnknownKind};
use judge::Judge;
use nalgebra::Vector3;
use run::Event;
use runs::Kind;
use statements::Compared;
use std::ops::Range;
use std::sync::Arc;
use world::World;

/// What a program is checked against.
#[derive(Debug, Clone, Copy, Default)]
pub struct Against<'a> {
    /// The plan of its touches.
    pub plan: Option<&'a Plan>,
    /// Name of the mounting, where there is no plan; `None`: the one on which most touches are made.
    pub mounting: Option<&'a str>,
    /// The set-up at which it is meant to begin.
    pub from: u32,
    /// Files that the control needs beside the program: name, contents.
    pub beside: &'a [(String, Source)],
    /// The dry run is checked first: where it has errors, they are the only findings.
    pub dry_run_first: bool,
}

/// What came out.
#[derive(Debug, Clone)]
pub struct Checked {
    /// What is wrong: the program is safe and what the plan asks for when there is no error among them.
    pub findings: Vec<Finding>,
    /// What the program does.
    pub proof: Proof,
    /// The mountings, in the order in which they are up.
    pub mountings: Vec<String>,
    /// Touches that it makes.
    pub touches: usize,
    /// Moves of the whole program.
    pub moves: usize,
    /// Times that it waits for a person.
    pub stops: usize,
    /// Set-ups at which it can begin.
    pub setups: u32,
    /// Those at which it says that it cannot: the way there is not known.
    pub declined: Vec<u32>,
    /// Ways on which something happens otherwise that were followed.
    pub branches: usize,
    /// Runs that took the other way at conditions on values that a proof cannot know.
    pub both_ways: usize,
    /// Run time without the stops, s.
    pub seconds: f64,
    /// It was run: without that there are findings only.
    pub ran: bool,
}

/// A part of a program: what is mounted, and the machine with its stylus.
struct Part {
    machine: Machine,
    mounting: Mounting,
}

/// Checks a program.
///
/// # Errors
/// When the text is not of the dialect's grammar, or plan and machine do not belong together.
pub fn check(machine: &Machine, post: &Postprocessor, source: &Source, against: &Against<'_>) -> Result<Checked> {
    let whole = called::Whole::new(source, post, against.beside);
    match check_whole(machine, post, &whole.source, against) {
        Ok(mut checked) => {
            checked.findings = whole.each_in_its_file(checked.findings);
            Ok(checked)
        }
        Err(Failure(findings)) => Err(Failure(whole.each_in_its_file(findings))),
    }
}

/// A program with those that it calls, as one text.
fn check_whole(machine: &Machine, post: &Postprocessor, source: &Source, against: &Against<'_>) -> Result<Checked> {
    let mut program = read(post, source, against.beside)?;
    let unknown = match against.plan {
        // what was edited comes first, and then what the control says to it
        Some(_) => program.unknown_of_grammar().to_vec(),
        None => program.unknown(machine, post),
    };
    let foreign = refuse_unknown(&unknown, source)?;
    if !foreign.is_empty() {
        return Ok(Checked::not_run(foreign));
    }
    match against.plan {
        Some(plan) => {
            let number = number(post, &program, source)?;
            let written = plan.programs.get(&post.name);
            let compared = written.filter(|w| !w.steps_sha256.is_empty()).map(|w| program.compare(w, post));
            let mut checked = with_plan(machine, post, source, against, &program, plan)?;
            match (written, compared) {
                (Some(written), Some(compared)) => {
                    as_written(written, &compared, &program, source, &checked.proof, &mut checked.findings);
                }
                (Some(_), None) => checked.findings.push(older_plan(plan)),
                (None, _) => {}
            }
            checked.findings.extend(number);
            Ok(checked)
        }
        None => without_plan(machine, post, source, against, &program),
    }
}

impl Checked {
    /// A program that was read and not run.
    fn not_run(findings: Vec<Finding>) -> Self {
        Self {
            findings,
            proof: Proof::default(),
            mountings: Vec::new(),
            touches: 0,
            moves: 0,
            stops: 0,
            setups: 0,
            declined: Vec::new(),
            branches: 0,
            both_ways: 0,
            seconds: 0.0,
            ran: false,
        }
    }
}

/// Everything that is not known, each with its first place: a person corrects or rewrites the program once. Where words are known and
/// only what they reach is not (another program, an output, another file), these are the answer.
fn refuse_unknown(unknown: &[Unknown], source: &Source) -> Result<Vec<Finding>> {
    const SHOWN: usize = 20;
    let mut counts: Vec<(&Unknown, usize)> = Vec::new();
    for one in unknown {
        match counts.iter_mut().find(|(first, _)| first.name == one.name && first.kind == one.kind) {
            Some((_, count)) => *count += 1,
            None => counts.push((one, 1)),
        }
    }
    let mut findings: Vec<Finding> =
        counts.iter().take(SHOWN).map(|(first, count)| of_unknown(first, *count, source)).collect();
    if counts.len() > SHOWN {
        let rest = format!("and {} more that are not known", counts.len() - SHOWN);
        findings.push(Finding::error("check::not_known", rest).help(NOT_KNOWN_HELP));
    }
    let is_meaning = |(first, _): &(&Unknown, usize)| first.kind == UnknownKind::Meaning;
    if counts.iter().any(is_meaning) { Err(Failure(findings)) } else { Ok(findings) }
}

const NOT_KNOWN_HELP: &str = "it may be right; whether it is safe cannot be said";

/// Something that is not known, at its first place, and how often it stands in the program.
fn of_unknown(first: &Unknown, count: usize, source: &Source) -> Finding {
    let times = if count > 1 { format!(" (it stands {count} times)") } else { String::new() };
    let name = &first.name;
    let (code, says, help) = match first.kind {
        UnknownKind::Meaning => ("check::not_known", format!("{name} is not known to axiscal"), NOT_KNOWN_HELP),
        UnknownKind::Program => (
            "check::foreign_program",
            format!("{name} calls another program: what it does cannot be proven"),
            "take the call out, or have the postprocessor file describe it (probe_on, probe_off, [[check.call]])",
        ),
        UnknownKind::Output => (
            "check::output",
            format!("{name} switches an output of the machine: what it does cannot be proven"),
            "take it out, or have the postprocessor file name it (probe_on, probe_off)",
        ),
        UnknownKind::File => (
            "check::other_file",
            format!("{name} is not the log of the program: it would be written or deleted"),
            "write to one log only, and delete no other file",
        ),
    };
    Finding::error(code, says + &times).help(help).at(source, first.at.clone())
}

/// Beside its plan, a program has the number that the settings gave it. Another one harms nothing, unless the program would call itself.
fn number(post: &Postprocessor, program: &runs::Program, source: &Source) -> Result<Option<Finding>> {
    let Some((digits, at)) = program.number() else { return Ok(None) };
    if let Some(wrong) = post.impossible_program_number(digits) {
        return Err(Finding::error("check::not_understood", format!("O{digits}: {wrong}"))
            .help("give it another number")
            .at(source, at.clone())
            .into());
    }
    Ok(post.other_program_number(digits).map(|other| {
        Finding::warning("check::program_number", format!("O{digits}: {other}"))
            .help("is no other program of that number at the control? nothing else depends on it")
            .at(source, at.clone())
    }))
}

/// Is a text a program of the control's dialect, as far as the grammar says?
///
/// # Errors
/// The first place that is not of the grammar, in the file where it stands.
pub fn grammar(post: &Postprocessor, source: &Source, beside: &[(String, Source)]) -> Result<()> {
    let whole = called::Whole::new(source, post, beside);
    let read_whole = || {
        let foreign = refuse_unknown(read(post, &whole.source, beside)?.unknown_of_grammar(), &whole.source)?;
        if foreign.is_empty() { Ok(()) } else { Err(Failure(foreign)) }
    };
    read_whole().map_err(|Failure(findings)| Failure(whole.each_in_its_file(findings)))
}

fn read(post: &Postprocessor, source: &Source, beside: &[(String, Source)]) -> Result<runs::Program> {
    let rule = post.check.as_ref().ok_or_else(|| {
        Failure::new(
            "check::no_dialect",
            format!("controller {} does not say how its programs are read back", post.name),
        )
        .help("write [check] dialect = \"ngc\" (macro-b, sinumerik, klartext) in the postprocessor file")
    })?;
    let text = source.inner();
    let masks = beside.iter().map(|(_, mask)| mask);
    if let Some(marked) = std::iter::once(source).chain(masks).find(|s| s.inner().starts_with(lines::BYTE_ORDER_MARK)) {
        let says = "it begins with a byte order mark, which an editor has put there: LinuxCNC refuses it, what other controls do is not known";
        return Err(Finding::error("check::not_understood", says)
            .help("save it as plain ASCII, or as UTF-8 without that mark")
            .at(marked, 0..lines::BYTE_ORDER_MARK.len_utf8())
            .into());
    }
    if let Some(line) = lines::lines(text).find(|l| l.text.chars().count() > post.line_length) {
        let says = format!("the line is longer than the {} characters that the control takes", post.line_length);
        return Err(Finding::error("check::line_length", says).at(source, line.all()).into());
    }
    if let Some(at) = lines::control_byte(text) {
        let byte = text.as_bytes().get(at).copied().unwrap_or_default();
        let says = format!("byte 0x{byte:02X} is no text: some controls end a block there, others skip it");
        return Err(Finding::error("check::not_understood", says)
            .help("take it out; lines end with LF or CR LF")
            .at(source, at..at + 1)
            .into());
    }
    let masks = heidenhain::Masks::read(text, post, beside)?;
    runs::Program::parse(post, rule, text, &masks).map_err(|fault| {
        Finding::error("check::not_understood", fault.says)
            .help("axiscal does not know this; whether it is safe cannot be said")
            .at(source, fault.at)
            .into()
    })
}

/// The names of the files that a program needs beside it at the control and that say what it writes.
#[must_use]
pub fn wanted_beside(post: &Postprocessor, program: &Source) -> Vec<String> {
    let masks = if post.companions.is_empty() { Vec::new() } else { heidenhain::wanted(program.inner(), post) };
    masks.into_iter().chain(called::wanted(program.inner(), post)).collect()
}

/// Against a plan: where the artefact was put down by eye, also at each corner of the box in which it may stand.
fn with_plan(
    machine: &Machine,
    post: &Postprocessor,
    source: &Source,
    against: &Against<'_>,
    program: &runs::Program,
    plan: &Plan,
) -> Result<Checked> {
    let parts = || parts_of_plan(machine, plan);
    let Some(find) = &plan.find else {
        return with_parts(machine, post, source, against, program, parts()?, against.plan);
    };
    let there = |off_mm: &Vector3<f64>| {
        let expected = plan.relative_to(machine, off_mm);
        let against = Against { plan: Some(&expected), ..*against };
        let parts = by_eye::displaced(machine, plan, parts()?, off_mm);
        with_parts(machine, post, source, &against, program, parts, Some(plan))
    };
    let mut checked = there(&Vector3::zeros())?;
    if checked.findings.iter().all(|f| f.severity != Severity::Error) {
        for corner in by_eye::corners(find) {
            by_eye::add(&mut checked, there(&corner)?, &corner);
        }
    }
    Ok(checked)
}

/// Tries each mounting of the machine and takes the one on which most touches are made.
fn without_plan(
    machine: &Machine,
    post: &Postprocessor,
    source: &Source,
    against: &Against<'_>,
    program: &runs::Program,
) -> Result<Checked> {
    // the text alone shows it: there is nothing to run
    program.transforms(source).map_or(Ok(()), Err)?;
    let named = against.mounting.map(|name| {
        machine.mounting(name).ok_or_else(|| {
            let there: Vec<&str> = machine.mountings.iter().map(|m| m.name.as_str()).collect();
            Failure::new("check::mounting", format!("{} has no mounting {name:?}", machine.name))
                .help(format!("there are: {}", there.join(", ")))
        })
    });
    let candidates: Vec<&Mounting> = match named {
        Some(mounting) => vec![mounting?],
        None => machine.mountings.iter().collect(),
    };
    let mut best: Option<Checked> = None;
    for mounting in candidates {
        let part = Part { machine: machine.clone(), mounting: mounting.clone() };
        let checked = with_parts(machine, post, source, against, program, vec![part], None)?;
        let better = |b: &Checked| (checked.touches, b.findings.len()) > (b.touches, checked.findings.len());
        if best.as_ref().is_none_or(better) {
            best = Some(checked);
        }
    }
    best.ok_or_else(|| {
        Failure::new("check::mounting", format!("{} has no mounting to run the program on", machine.name))
            .help("describe the blocks in the machine's file")
    })
}

/// What is mounted in each part of a plan's program.
fn parts_of_plan(machine: &Machine, plan: &Plan) -> Result<Vec<Part>> {
    if plan.machine != machine.name {
        return Err(Failure::new(
            "check::machine",
            format!("the plan was made for machine {:?}, not for {:?}", plan.machine, machine.name),
        )
        .help("name the plan's machine with --machine, or make the plan again"));
    }
    let mut keys: Vec<(&str, f64, f64)> = Vec::new();
    for touch in &plan.touches {
        let key = (
            touch.mounting.as_deref().unwrap_or(&plan.mounting),
            touch.tool_length_mm.unwrap_or(plan.tool_length_mm),
            touch.ball_radius_mm.unwrap_or(plan.ball_radius_mm),
        );
        if keys.last() != Some(&key) {
            keys.push(key);
        }
    }
    keys.into_iter()
        .map(|(name, length_mm, radius_mm)| {
            let lacks = |what: String| {
                Failure::new("check::plan", format!("the plan is for {what}, which {} lacks", machine.name))
                    .help("plan and machine belong together: make the plan again")
            };
            Ok(Part {
                machine: machine.with_stylus_of(length_mm, radius_mm).ok_or_else(|| {
                    lacks(format!("a stylus of {} mm with a ball of radius {} mm", Plain(length_mm), Plain(radius_mm)))
                })?,
                mounting: machine.mounting(name).ok_or_else(|| lacks(format!("mounting {name:?}")))?.clone(),
            })
        })
        .collect()
}

fn with_parts(
    machine: &Machine,
    post: &Postprocessor,
    source: &Source,
    against: &Against<'_>,
    program: &runs::Program,
    parts: Vec<Part>,
    written: Option<&Plan>,
) -> Result<Checked> {
    let tcp = against.plan.is_some_and(|p| p.controller_frame == ControllerFrame::Tcp);
    let step = post.number.mm(10f64.powi(-(post.number.decimals as i32)));
    // half a step of three words: what was proven before they were rounded
    let slack_mm = 0.5 * 3f64.sqrt() * step;
    let scenes: Vec<Scene<'_>> =
        parts.iter().map(|p| Ok(Scene::new(&p.machine, &p.mounting)?.rounded(slack_mm))).collect::<Result<_>>()?;
    let bodies = parts.iter().map(|p| Errorless::new(&p.machine, Some(&p.mounting))).collect();
    let world = Arc::new(World::new(bodies, &machine.origin, tcp));
    // missed touches and interruptions are followed with the artefact at its nominal position
    let only_trunks = against.plan.zip(written).is_some_and(|(plan, written)| plan.touches != written.touches);
    let stage = runs::Stage { machine, post, plan: against.plan, program, world: &world, scenes: &scenes, only_trunks };
    let opening = runs::opening(stage);
    // what the control rounds, and under a transformation what the rounding of three words does
    // a search that is a way along a vector: begin, way and end are rounded each
    let roundings = if program.is_relative() { 3.0 } else { 1.0 };
    // under a transformation the rounding of one word shows in the others as well
    let turned = if tcp { 3f64.sqrt() } else { 1.0 };
    let found = if against.plan.is_some_and(|p| p.find.is_some()) { by_eye::FOUND_MM } else { 0.0 };
    let same = 0.51 * roundings * turned * step + 1e-6 + if tcp { 1e-4 } else { 0.0 } + found;
    let case = CheckedProgram {
        machine,
        post,
        plan: against.plan,
        written,
        scenes: &scenes,
        mountings: &parts.iter().map(|p| &p.mounting).collect::<Vec<_>>(),
        world: &world,
        source,
        same,
        clear_from_anywhere: opening.clear_from_anywhere,
        neutral: &opening.neutral,
    };
    if against.dry_run_first
        && let Some(dry) = runs::dry(stage, &opening)
    {
        let mut judge = Judge::new(&case);
        judge.dry(&dry);
        let findings = judge.finish();
        if findings.iter().any(|f| f.severity == Severity::Error) {
            return Ok(Checked::not_run(findings));
        }
    }
    let mut judge = Judge::new(&case);
    let (mut declined, mut branches, mut both_ways) = (Vec::new(), 0, 0);
    let told = runs::all(stage, &opening, &mut |kind, told| match kind {
        Kind::Begun => {
            judge.run(told);
            branches += told.branches.len();
            if told.declines() && told.from <= program.setups() {
                declined.push(told.from);
            }
        }
        Kind::Dry => judge.dry(told),
        Kind::Other => judge.other(told),
        Kind::Refused => {}
        Kind::Doubted => {
            judge.doubted(told);
            both_ways += usize::from(!told.otherwise.is_empty());
        }
    });
    if against.plan.is_none() {
        program.waits_for_a_mounting(&told.whole.trunk, source).map_or(Ok(()), Err)?;
        program.finds(&told.whole.trunk, source).map_or(Ok(()), Err)?;
    }
    let mut findings = judge.finish();
    findings.extend(told.beyond.map(|at| too_many(source, at)));
    findings.extend(
        told.findings.iter().map(|(at, says)| Finding::error("check::start", says.clone()).at(source, at.clone())),
    );
    findings.extend(begins(post, program, against.from.max(1), source));
    findings.extend(dry_run(post, program, source));
    let proof = program.record(post, source.inner());
    let trunk = told.whole.trunk.as_slice();
    Ok(Checked {
        mountings: parts.iter().map(|p| p.mounting.name.clone()).collect(),
        touches: trunk.iter().filter(|h| matches!(&h.event, Event::Log(t) if t.starts_with('P'))).count(),
        moves: trunk.iter().filter(|h| matches!(h.event, Event::Move { .. } | Event::Probe { .. })).count(),
        stops: told.stops,
        setups: told.setups,
        declined,
        branches,
        both_ways,
        seconds: seconds::seconds(trunk),
        ran: true,
        findings,
        proof,
    })
}

/// The first condition on an unknown value whose other way was not run.
fn too_many(source: &Source, at: Range<usize>) -> Finding {
    let says = "too many conditions depend on a clock or on stored values of the control: from here on their other ways were not run";
    Finding::error("check::too_many_branches", says)
        .help("let fewer conditions depend on them; each is run both ways")
        .at(source, at)
}

/// It is written for a dry run.
fn dry_run(post: &Postprocessor, program: &runs::Program, source: &Source) -> Option<Finding> {
    let (height, at) = program.dry_run().filter(|(height, _)| *height != 0.0)?;
    if height.is_nan() || height < 0.0 {
        let says = "the height of the dry run is below 0: all moves would be lower";
        return Some(Finding::error("check::dry_run", says).help("0 measures, 50 is a good height").at(source, at));
    }
    if post.dry_run_mm > 0.0 {
        return None;
    }
    let says = "the program makes a dry run: its moves are higher, and it measures nothing";
    Some(Finding::info("check::dry_run", says).help("write 0 there to measure").at(source, at))
}

fn begins(post: &Postprocessor, program: &runs::Program, meant: u32, source: &Source) -> Option<Finding> {
    let begins = program.begins_at()?;
    // a run behind the last set-up gives the settings back, where the postprocessor file says so
    let gives_back = post.check.as_ref().is_some_and(|rule| !rule.after_abort.is_empty());
    let (setups, last) = (program.setups(), program.setups() + u32::from(gives_back));
    let there_are = match setups {
        1 => "the program has one".to_owned(),
        n => format!("the program has {n}"),
    };
    let lacks = |says: String| {
        Finding::error("check::no_setup", says)
            .help(format!("a number from 1 to {setups}"))
            .at(source, program.begins_in())
    };
    match begins {
        u32::MAX => Some(lacks("the program is told to begin at a number that is no set-up".to_owned())),
        n if !(1..=last).contains(&n) => Some(lacks(format!("the program begins at set-up {n}: {there_are}"))),
        _ if meant > last => Some(lacks(format!("there is no set-up {meant}: {there_are}"))),
        n if n != meant => Some(
            Finding::error("check::begins_later", format!("the program begins at set-up {n}"))
                .help(format!("write 1 back, or say that it is meant so with --from {n}"))
                .at(source, program.begins_in()),
        ),
        _ => None,
    }
}

/// A plan that holds nothing that a program could be compared with. Moves that are relative to what was found are only proven
/// for the program that was written: no older version wrote such plans.
fn older_plan(plan: &Plan) -> Finding {
    let says = "the plan is of an older version and does not hold the program's statements: whether this is still the program that was written is not known";
    let finding = if plan.find.is_some() { Finding::error } else { Finding::warning };
    finding("check::older_plan", says).help("`axiscal generate` writes plan and program anew")
}

/// Is the program still what `generate` wrote? What was changed without harm is named.
fn as_written(
    written: &Proof,
    compared: &Compared,
    program: &runs::Program,
    source: &Source,
    now: &Proof,
    findings: &mut Vec<Finding>,
) {
    if let Some(other) = compared.other {
        let says = "this is not the statement that axiscal wrote: what the program does here, in every run that may come, is not proven";
        let help =
            "was it edited? `axiscal generate` writes it anew; change the postprocessor file rather than the program";
        // the edited line stands before all that follows from it
        findings.insert(0, Finding::error("check::changed", says).help(help).at(source, program.place(other)));
        return;
    }
    const SHOWN: usize = 8;
    let mut remark = |at: Option<Range<usize>>, says: String| {
        let finding = Finding::info("check::edited", says);
        findings.push(at.map_or(finding.clone(), |at| finding.at(source, at)));
    };
    for (statement, what) in compared.inserted.iter().take(SHOWN) {
        remark(Some(program.place(*statement)), format!("{}: it harms nothing", what.says()));
    }
    if compared.inserted.len() > SHOWN {
        remark(None, format!("and {} more lines that were put in and harm nothing", compared.inserted.len() - SHOWN));
    }
    if compared.other_texts {
        remark(None, "the text of a message was changed: it harms nothing".to_owned());
    }
    if compared.inserted.is_empty() && !compared.other_texts && written.text_sha256 != now.text_sha256 {
        let says = "remarks, blanks, block numbers or the spelling of numbers were changed, or a switch in the head: the program makes the moves that were written";
        remark(None, says.to_owned());
    }
}
