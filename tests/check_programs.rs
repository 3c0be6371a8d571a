//! `check` of the programs that are written for each machine: nothing is wrong with any of them.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)] // a failure has its place

use axiscal::check::{Against, Checked, check};
use axiscal::diag::source;
use axiscal::machine::{self, Machine};
use axiscal::post::{Postprocessor, parse};
use axiscal::program::{self, Generated, Options};

fn machine(name: &str) -> Machine {
    let (machines, _) = machine::load(&source("machines", machine::BUILT_IN)).unwrap();
    machines.into_iter().find(|m| m.name == name).unwrap()
}

fn generated(machine: &Machine, program: &str, tcp: bool) -> Generated {
    let spec = program::choose(program::built_in().unwrap(), program, machine).unwrap();
    program::generate(machine, &spec, &Options { strict: false, tcp }).unwrap().0
}

fn controller(name: &str) -> Postprocessor {
    Postprocessor::load_built_in_or_file(name).unwrap().0
}

/// A variant of a built-in controller: its file with these lines.
fn variant(base: &str, lines: &str) -> Postprocessor {
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
fn is_clean(post: &Postprocessor, machine: &Machine, generated: &Generated) {
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

/// The worked example of docs/guide/controllers.md, as it stands there.
#[test]
fn the_variant_of_the_guide() {
    let guide = include_str!("../docs/guide/controllers.md");
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
fn under_the_control_s_own_transformation() {
    all_clean("trunnion", "basic", true, &CONTROLLERS);
    all_clean("swivel-table-b", "basic", true, &["heidenhain", "fanuc"]);
    // LinuxCNC has no transformation of its own for a head
    all_clean("swivel-head", "table", true, &CONTROLLERS[1..]);
}

#[test]
fn inches() {
    let machine = machine("swivel-head");
    let generated = generated(&machine, "table", false);
    for base in ["fanuc", "haas", "heidenhain"] {
        for decimals in [4, 5] {
            let lines = format!(
                "[number]\ndecimals = {decimals}\nunverified = \"ours\"\n[log]\nunit = \"inch\"\ndecimals = 5\nunverified = \"ours\"\n"
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
    let text = post.program(&machine, &generated.plan, &generated.path).unwrap().text;
    assert!(text.contains("G0 C-"), "no turn in the negative sense");
    let against = Against { plan: Some(&generated.plan), ..Against::default() };
    let other = check(&machine, &post, &source("p.nc", text.replacen("G0 C-", "G0 C", 1)), &against).unwrap();
    assert!(!other.findings.is_empty());
}

#[test]
fn stops_for_another_stylus() {
    all_clean("trunnion", "full", false, &["heidenhain"]);
}

/// Text between two lines, taken out.
fn without(text: &str, first: &str, last: &str) -> String {
    let lines: Vec<&str> = text.split_inclusive('\n').collect();
    let from = lines.iter().position(|l| l.contains(first)).unwrap_or_else(|| panic!("no {first}"));
    let to = from + lines[from..].iter().position(|l| l.contains(last)).unwrap_or_else(|| panic!("no {last}"));
    lines[..from].iter().chain(&lines[to + 1..]).copied().collect()
}

#[test]
fn under_a_transformation_the_rotary_axes_must_stand_at_0_when_it_begins() {
    let machine = machine("trunnion");
    let generated = generated(&machine, "basic", true);
    for (name, guard) in [("fanuc", "IF[ABS[#50"), ("haas", "IF[ABS[#50")] {
        let post = controller(name);
        let text = post.program(&machine, &generated.plan, &generated.path).unwrap().text;
        let edited = without(&text, guard, "GOTO9");
        let against = Against { plan: Some(&generated.plan), ..Against::default() };
        let found = check(&machine, &post, &source("p.nc", edited), &against).unwrap();
        assert!(found.findings.iter().any(|f| f.code == "check::start"), "{name}: {:?}", found.findings);
    }
}

/// A program that logs where the axes have come to a stand, or what is left of the touch before, in place of what the control has
/// kept of this one.
#[test]
fn a_log_of_another_place_is_found() {
    let machine = machine("swivel-head");
    let generated = generated(&machine, "table", false);
    for (name, line, instead) in [
        ("fanuc", "#21=#5061", "#21=#5041"),
        ("haas", "#21=#5061", "#21=#5041"),
        ("sinumerik", "AXC_X=$AA_MM[X]", "AXC_X=$AA_IM[X]"),
        ("fanuc", "#22=#5062\n", ""),
        ("haas", "#22=#5062\n", ""),
        ("fanuc", "#24=#5064\n", "#24=0.\n"),
    ] {
        let post = controller(name);
        let text = post.program(&machine, &generated.plan, &generated.path).unwrap().text;
        // in one of the first touches; each has the line of a miss behind its own
        let at = text.match_indices(line).nth(8).unwrap_or_else(|| panic!("{name}: no {line:?}")).0;
        let edited = format!("{}{instead}{}", &text[..at], &text[at + line.len()..]);
        let against = Against { plan: Some(&generated.plan), ..Against::default() };
        let found = check(&machine, &post, &source("p.nc", edited), &against).unwrap();
        assert!(found.findings.iter().any(|f| f.code == "check::log"), "{name} {line:?}: {:?}", found.findings);
    }
}

#[test]
fn a_number_that_has_lost_its_point_is_no_number() {
    let machine = machine("swivel-head");
    let generated = generated(&machine, "table", false);
    for name in ["fanuc", "haas"] {
        let post = controller(name);
        let text = post.program(&machine, &generated.plan, &generated.path).unwrap().text;
        let at = text.find("\nG0 X").unwrap() + 1;
        let point = at + text[at..].find('.').unwrap();
        let edited = format!("{}{}", &text[..point], &text[point + 1..]);
        let against = Against { plan: Some(&generated.plan), ..Against::default() };
        let refused = check(&machine, &post, &source("p.nc", edited), &against).unwrap_err();
        assert!(refused.0[0].message.contains("decimal point"), "{:?}", refused.0);
    }
}
