//! `check` of the programs that are written for each machine: nothing is wrong with any of them.

use crate::edits;
use axiscal::check::{Against, Checked, check};
use axiscal::diag::source;
use axiscal::machine::{self, Machine};
use axiscal::post::{Postprocessor, parse};
use axiscal::program::{self, Generated, Options};

pub(super) fn machine(name: &str) -> Machine {
    let (machines, _) = machine::load(&source("machines", machine::BUILT_IN)).unwrap();
    machines.into_iter().find(|m| m.name == name).unwrap()
}

pub(super) fn generated(machine: &Machine, program: &str, tcp: bool) -> Generated {
    let spec = program::choose(program::built_in().unwrap(), program, machine).unwrap();
    program::generate(machine, &spec, &Options { strict: false, tcp }).unwrap().0
}

pub(super) fn controller(name: &str) -> Postprocessor {
    Postprocessor::load_built_in_or_file(name).unwrap().0
}

/// A variant of a built-in controller: its file with these lines.
pub(super) fn variant(base: &str, lines: &str) -> Postprocessor {
    let text = format!("format = \"axiscal-postprocessor/1\"\nbased_on = {base:?}\nname = \"mine\"\n{lines}");
    parse(&source("mine.toml", text)).unwrap_or_else(|e| panic!("{e}")).0
}

fn checked(post: &Postprocessor, machine: &Machine, generated: &Generated) -> Checked {
    let nc = post.program(machine, &generated.plan, &generated.path).unwrap();
    let beside = nc.sources();
    let against = Against { plan: Some(&generated.plan), beside: &beside, ..Against::default() };
    check(machine, post, &source(format!("{}.{}", post.name, nc.extension), nc.text), &against)
        .unwrap_or_else(|e| panic!("{} on {}: {:?}", post.name, machine.name, e.0))
}

/// Nothing is wrong with a program, and it makes all its touches.
pub(super) fn is_clean(post: &Postprocessor, machine: &Machine, generated: &Generated) {
    let checked = checked(post, machine, generated);
    let wrong: Vec<String> = checked.findings.iter().map(ToString::to_string).collect();
    assert!(wrong.is_empty(), "{} on {}: {wrong:#?}", post.name, machine.name);
    assert_eq!(checked.touches, generated.plan.touches.len());
    assert!(checked.branches > 4 * checked.touches, "{}", checked.branches);
}

const CONTROLLERS: [&str; 4] = ["linuxcnc", "fanuc", "haas", "heidenhain"];

const PACKAGES: [&str; 2] = ["fanuc-inspection-plus", "haas-inspection-plus"];

#[test]
fn with_a_probing_package() {
    for (machine, program) in [
        ("swivel-head", "head"),
        ("swivel-head", "table"),
        ("double-head", "double-head"),
        ("trunnion", "basic"),
        ("swivel-table-b", "basic"),
        ("nutating-b", "basic"),
        ("trunnion-offset", "basic"),
    ] {
        all_clean(machine, program, false, &PACKAGES);
    }
    all_clean("trunnion", "basic", true, &PACKAGES);
    let machine = machine("swivel-head");
    let generated = generated(&machine, "table", false);
    for base in PACKAGES {
        let lines = "[number]\ndecimals = 4\nunverified = \"ours\"\n[log]\nunit = \"inch\"\ndecimals = 5\nunverified = \"ours\"\n";
        is_clean(&variant(base, lines), &machine, &generated);
    }
}

/// Running numbers stand before blocks only: not before % or an O-word.
#[test]
fn with_block_numbers() {
    let machine = machine("swivel-head");
    let generated = generated(&machine, "table", false);
    let lines = "[file]\nblock_numbers = { first = 10, step = 10, word = \"N{n} \" }\nunverified = \"ours\"\n";
    for base in ["sinumerik", "linuxcnc"] {
        is_clean(&variant(base, lines), &machine, &generated);
    }
    // where they are labels they are refused
    for base in ["fanuc", "haas"] {
        let text = format!("format = \"axiscal-postprocessor/1\"\nbased_on = {base:?}\nname = \"mine\"\n{lines}");
        let failure = parse(&source("mine.toml", text)).unwrap_err();
        assert!(failure.0.iter().any(|f| f.code == "post::block_numbers"), "{failure}");
    }
}

/// Block numbers that the control does not take are refused by their name, not as a word that nobody understands.
#[test]
fn block_numbers_end_somewhere() {
    let file = |base: &str, numbers: &str| {
        let lines = format!("[file]\nblock_numbers = {{ {numbers} }}\nunverified = \"ours\"\n");
        parse(&source(
            "mine.toml",
            format!("format = \"axiscal-postprocessor/1\"\nbased_on = {base:?}\nname = \"mine\"\n{lines}"),
        ))
    };
    for (base, numbers) in [
        ("sinumerik", "first = 10, step = 0, word = \"N{n} \""),
        ("sinumerik", "first = 10, step = 10, word = \"N{n}\""),
        ("sinumerik", "first = 10, step = 10, word = \"N \""),
        ("linuxcnc", "first = 10, step = 0, word = \"N{n} \""),
        ("linuxcnc", "first = 100000, step = 1, word = \"N{n} \""),
        ("linuxcnc", "first = 0, step = 9223372036854775807, word = \"N{n} \""),
        ("heidenhain", "first = 0, step = 1, word = \"{n}\""),
    ] {
        let failure = file(base, numbers).err().unwrap_or_else(|| panic!("{base} {numbers}"));
        let finding = failure.0.iter().find(|f| f.code == "post::block_numbers");
        assert!(finding.is_some_and(|f| f.place().is_some() && f.help.is_some()), "{base} {numbers}: {failure}");
    }
    let machine = machine("swivel-head");
    let generated = generated(&machine, "table", false);
    for (base, numbers, says, help) in [
        ("linuxcnc", "first = 99000, step = 10, word = \"N{n} \"", "is beyond N99999", "a smaller step"),
        ("linuxcnc", "first = 10, step = 1000, word = \"N{n} \"", "is beyond N99999", "a smaller step"),
        ("sinumerik", "first = 99999990, step = 10, word = \"N{n} \"", "is beyond N99999999", "a smaller first number"),
    ] {
        let post = file(base, numbers).unwrap().0;
        let failure = post.program(&machine, &generated.plan, &generated.path).unwrap_err();
        let finding = &failure.0[0];
        assert_eq!(finding.code, "post::block_numbers", "{failure}");
        assert!(finding.message.contains("block_numbers") && finding.message.contains(says), "{failure}");
        assert!(finding.help.as_ref().is_some_and(|h| h.contains(help)), "{base} {numbers}: {:?}", finding.help);
    }
    // LinuxCNC needs no blank behind a number
    is_clean(&file("linuxcnc", "first = 1, step = 1, word = \"N{n}\"").unwrap().0, &machine, &generated);
}

/// The worked example of docs/guide/controllers.md, as it stands there.
#[test]
fn the_variant_of_the_guide() {
    let guide = include_str!("../../docs/guide/controllers.md");
    let example = guide.split("```toml\n").find(|part| part.contains("shop-mill")).unwrap();
    let text = example.split("```").next().unwrap();
    let (post, _) = parse(&source("shop-mill.toml", text)).unwrap_or_else(|e| panic!("{e}"));
    let machine = machine("swivel-head");
    is_clean(&post, &machine, &generated(&machine, "table", false));
    is_clean(&post, &machine, &generated(&machine, "head", false));
}

/// The machines with a small program, for every control.
fn all_clean(machine_name: &str, program: &str, tcp: bool, controllers: &[&str]) {
    let machine = machine(machine_name);
    let generated = generated(&machine, program, tcp);
    for name in controllers {
        is_clean(&controller(name), &machine, &generated);
    }
}

#[test]
fn swivel_head() {
    all_clean("swivel-head", "head", false, &["heidenhain"]);
    all_clean("swivel-head", "table", false, &CONTROLLERS);
}

#[test]
fn double_head() {
    all_clean("double-head", "double-head", false, &CONTROLLERS);
}

#[test]
fn trunnion() {
    all_clean("trunnion", "basic", false, &CONTROLLERS);
}

#[test]
fn swivel_table_b() {
    all_clean("swivel-table-b", "basic", false, &CONTROLLERS);
}

#[test]
fn nutating_b() {
    all_clean("nutating-b", "basic", false, &CONTROLLERS);
}

#[test]
fn trunnion_offset() {
    all_clean("trunnion-offset", "basic", false, &CONTROLLERS);
}

#[test]
fn under_the_control_s_own_transformation() {
    all_clean("trunnion", "basic", true, &CONTROLLERS);
    all_clean("swivel-table-b", "basic", true, &["heidenhain", "fanuc"]);
    all_clean("nutating-b", "basic", true, &["heidenhain", "fanuc"]);
    all_clean("trunnion-offset", "basic", true, &["fanuc", "haas"]);
    // LinuxCNC has no transformation of its own for a head
    all_clean("swivel-head", "table", true, &CONTROLLERS[1..]);
}

#[test]
fn inches() {
    let machine = machine("swivel-head");
    let generated = generated(&machine, "table", false);
    for base in ["fanuc", "haas", "heidenhain", "linuxcnc", "sinumerik"] {
        // LinuxCNC writes six decimals of its own accord
        let log = if base == "linuxcnc" { 6 } else { 5 };
        for decimals in [4, 5] {
            let lines = format!(
                "[number]\ndecimals = {decimals}\nunverified = \"ours\"\n[log]\nunit = \"inch\"\ndecimals = {log}\nunverified = \"ours\"\n"
            );
            is_clean(&variant(base, &lines), &machine, &generated);
        }
    }
}

#[test]
fn names_and_numbers_of_axes() {
    let machine = machine("swivel-head");
    let generated = generated(&machine, "table", false);
    for (base, names) in [
        ("fanuc", "axis_names = { C = \"A\" }\naxis_numbers = { B = 6, C = 4 }"),
        ("haas", "axis_names = { B = \"A\" }"),
        ("heidenhain", "axis_names = { C = \"W\" }"),
    ] {
        let lines = format!("[number]\n{names}\nunverified = \"ours\"\n");
        is_clean(&variant(base, &lines), &machine, &generated);
    }
    // LinuxCNC counts its axes by their letters: one that is called otherwise is refused
    let post = variant("linuxcnc", "[number]\naxis_names = { B = \"A\" }\nsource = \"ours\"\n");
    assert!(!checked(&post, &machine, &generated).findings.is_empty());
}

#[test]
fn axes_of_0_to_360() {
    let machine = machine("swivel-head");
    let generated = generated(&machine, "table", false);
    for base in ["heidenhain", "fanuc", "haas"] {
        is_clean(&variant(base, "[settings]\nmodulo = \"C\"\n"), &machine, &generated);
    }
    // turned the other way round it is another program
    let post = variant("fanuc", "[settings]\nmodulo = \"C\"\n");
    let text = text_of(&post, &machine, &generated);
    assert!(text.contains("G0 C-"), "no turn in the negative sense");
    assert!(!codes(&post, &machine, &generated, &text.replacen("G0 C-", "G0 C", 1)).is_empty());
}

#[test]
fn stops_for_another_stylus() {
    all_clean("trunnion", "full", false, &["heidenhain"]);
}

/// ISO 841 turns a table's axis the other way: some faces, and all of a set-up, are then out of reach. What is left is a program
/// that can begin at each set-up that it has.
#[test]
fn a_swivelling_table_that_turns_the_other_way() {
    for name in ["trunnion", "swivel-table-b"] {
        let mut machine = machine(name);
        machine.axes.iter_mut().find(|a| a.name.is_rotary()).unwrap().sense = -1.0;
        let spec = program::choose(program::built_in().unwrap(), "full", &machine).unwrap();
        let generated = program::generate(&machine, &spec, &Options::default()).unwrap().0;
        for control in ["linuxcnc", "sinumerik"] {
            let post = controller(control);
            is_clean(&post, &machine, &generated);
            let setups = checked(&post, &machine, &generated).setups as usize;
            assert!(setups < spec.setups.len(), "{control} {name}: all {setups} set-ups are within reach");
        }
    }
}

/// Text between two lines, taken out.
pub(super) fn without(text: &str, first: &str, last: &str) -> String {
    let lines: Vec<&str> = text.split_inclusive('\n').collect();
    let from = lines.iter().position(|l| l.contains(first)).unwrap_or_else(|| panic!("no {first}"));
    let to = from + lines[from..].iter().position(|l| l.contains(last)).unwrap_or_else(|| panic!("no {last}"));
    lines[..from].iter().chain(&lines[to + 1..]).copied().collect()
}

/// A program that logs where the axes have come to a stand, or what is left of the touch before, in place of what the control has
/// kept of this one.
#[test]
fn a_log_of_another_place_is_found() {
    let machine = machine("swivel-head");
    let generated = generated(&machine, "table", false);
    for (name, line, instead) in [
        ("fanuc", "#27=#5061", "#27=#5041"),
        ("haas", "#27=#5061", "#27=#5041"),
        ("sinumerik", "AXT_PX=$AA_MM[X]", "AXT_PX=$AA_IM[X]"),
        ("fanuc", "#28=#5062\n", "#28=#5061\n"),
        ("haas", "#28=#5062\n", "#28=#5061\n"),
        ("fanuc", "#30=#5064\n", "#30=0.\n"),
    ] {
        let post = controller(name);
        let text = text_of(&post, &machine, &generated);
        // of a touch; the line of a miss stands behind its own, but for the SINUMERIK, which logs another position then
        let at = text.find(line).unwrap_or_else(|| panic!("{name}: no {line:?}"));
        let edited = format!("{}{instead}{}", &text[..at], &text[at + line.len()..]);
        let found = codes(&post, &machine, &generated, &edited);
        assert!(found.contains(&"check::log"), "{name} {line:?}: {found:?}");
    }
}

#[test]
fn a_number_that_has_lost_its_point_is_no_number() {
    let machine = machine("swivel-head");
    let generated = generated(&machine, "table", false);
    for name in ["fanuc", "haas"] {
        let post = controller(name);
        let text = text_of(&post, &machine, &generated);
        let at = text.find("\nG0 X").unwrap() + 1;
        let point = at + text[at..].find('.').unwrap();
        let edited = format!("{}{}", &text[..point], &text[point + 1..]);
        let nc = post.program(&machine, &generated.plan, &generated.path).unwrap();
        let (program, beside) = edits::parted(&edited, &nc.sources());
        let against = Against { plan: Some(&generated.plan), beside: &beside, ..Against::default() };
        let refused = check(&machine, &post, &source("p.nc", program), &against).unwrap_err();
        assert!(refused.0[0].message.contains("decimal point"), "{:?}", refused.0);
    }
}

/// A program with those that it calls.
pub(super) fn text_of(post: &Postprocessor, machine: &Machine, generated: &Generated) -> String {
    edits::whole(&post.program(machine, &generated.plan, &generated.path).unwrap())
}

/// Findings of an edited program, by code.
pub(super) fn codes(post: &Postprocessor, machine: &Machine, generated: &Generated, text: &str) -> Vec<&'static str> {
    let nc = post.program(machine, &generated.plan, &generated.path).unwrap();
    let (program, beside) = edits::parted(text, &nc.sources());
    let against = Against { plan: Some(&generated.plan), beside: &beside, ..Against::default() };
    match check(machine, post, &source("edited", program), &against) {
        Ok(checked) => checked.findings.iter().map(|f| f.code).collect(),
        Err(failure) => failure.0.iter().map(|f| f.code).collect(),
    }
}

/// The text without its `n`th line (from 0) that holds a word; block numbers are counted anew.
pub(super) fn without_line(post: &Postprocessor, text: &str, word: &str, n: usize) -> String {
    let bare =
        |l: &str| if post.block_numbers.is_some() { l.split_once(' ').unwrap().1.to_owned() } else { l.to_owned() };
    let mut lines: Vec<String> = text.split_inclusive('\n').map(bare).collect();
    let found: Vec<usize> = (0..lines.len()).filter(|i| lines[*i].trim_end() == word).collect();
    lines.remove(*found.get(n).unwrap_or_else(|| panic!("{} has {} lines {word:?}", post.name, found.len())));
    let Some(rule) = &post.block_numbers else { return lines.concat() };
    let number = |n: usize| rule.word.replace("{n}", &(rule.first + n * rule.step).to_string());
    lines.iter().enumerate().map(|(n, l)| number(n) + l).collect()
}

/// A control reads macro statements ahead: without a block to wait the program would compute from where it has not arrived yet.
#[test]
fn a_block_to_wait_that_is_missing_is_found() {
    let machine = machine("trunnion");
    for (control, wait) in [("fanuc", "G53"), ("haas", "G4 P0.1")] {
        for tcp in [false, true] {
            let post = controller(control);
            let generated = generated(&machine, "basic", tcp);
            let text = text_of(&post, &machine, &generated);
            let count = text.lines().filter(|l| *l == wait).count();
            assert!(count >= 3, "{control}: {count}");
            let lacking: Vec<usize> = (0..count)
                .filter(|n| codes(&post, &machine, &generated, &without_line(&post, &text, wait, *n)).is_empty())
                .collect();
            println!("{control} tcp {tcp}: {count} blocks, without these it is the same: {lacking:?}");
            // nothing is read between the first and the second one, but under the transformation; a Haas has waited before the
            // first one already, where it limits reading ahead
            let free: &[usize] = if tcp && control == "fanuc" { &[] } else { &[0] };
            assert!(lacking.iter().all(|n| free.contains(n)), "{control} tcp {tcp}: {lacking:?} of {count}");
            // a dwell does not stop a Fanuc from reading ahead
            if control == "fanuc" {
                let found = codes(&post, &machine, &generated, &text.replace("\nG53\n", "\nG4 P10\n"));
                assert!(found.contains(&"check::not_run"), "{found:?}");
            }
        }
    }
}

/// The time goes on while a program runs: one that writes another time, or none, shows.
#[test]
fn times_follow_the_run() {
    let machine = machine("trunnion");
    let generated = generated(&machine, "basic", false);
    for control in ["fanuc", "haas"] {
        let post = controller(control);
        let text = text_of(&post, &machine, &generated);
        assert!(text.contains("*T#10[50]"), "{control}");
        // the program begins before midnight: without the day that is added its time would go back
        let found =
            codes(&post, &machine, &generated, &text.replace("#10=#10-86400.*FIX[#10/86400.]\n", "#10=#10-86400.\n"));
        assert!(found.contains(&"check::log"), "{control}: {found:?}");
        let found = codes(&post, &machine, &generated, &text.replace("#10=#3012\n", "#10=0.\n"));
        assert!(found.contains(&"check::log"), "{control}: {found:?}");
        // the user's file may say that none is wanted; the log then has none
        let silent = variant(control, "[settings]\ntime = \"no\"\n");
        is_clean(&silent, &machine, &generated);
        assert!(!silent.log.writes_time && post.log.writes_time);
        let text = text_of(&silent, &machine, &generated);
        assert!(!text.contains("#3012") && !text.contains("*T#"));
    }
}

/// A spindle that is not turned as planned, on controls whose word for it is a setting.
#[test]
fn the_spindle_is_oriented() {
    let machine = machine("swivel-head");
    let generated = generated(&machine, "full", false);
    let post = controller("fanuc");
    let text = text_of(&post, &machine, &generated);
    let turned = text.lines().filter(|l| l.starts_with("M19 R")).nth(1).unwrap().to_owned();
    let found = codes(&post, &machine, &generated, &text.replacen(&format!("{turned}\n"), "M19 R77.\n", 1));
    assert!(found.contains(&"check::not_the_plan"), "{turned}: {found:?}");
}
