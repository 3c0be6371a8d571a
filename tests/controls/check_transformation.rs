//! `check` of what acts on a program's words: the control's own transformation, tool lengths, offsets and functions that last
//! beyond programs. Each is as it must be before anything moves, and as it was found at the end.

use crate::check_programs::{codes, controller, generated, is_clean, machine, text_of, variant, without, without_line};
use axiscal::program::Generated;
use rayon::prelude::*;

#[test]
fn under_a_transformation_the_rotary_axes_must_stand_at_0_when_it_begins() {
    let machine = machine("trunnion");
    let generated = generated(&machine, "basic", true);
    for (name, guard) in [("fanuc", "IF[ABS[#50"), ("haas", "IF[ABS[#50")] {
        let post = controller(name);
        let text = text_of(&post, &machine, &generated);
        let edited = without(&text, guard, "GOTO9");
        let found = codes(&post, &machine, &generated, &edited);
        assert!(found.contains(&"check::start"), "{name}: {found:?}");
    }
}

/// `full` under each control's own transformation, where it takes it: stops for another stylus, and machines that LinuxCNC has no
/// transformation for, are refused when the program is made.
#[test]
fn the_full_program_under_the_control_s_own_transformation() {
    let of = |name: &str| -> usize {
        let machine = machine(name);
        let generated = generated(&machine, "full", true);
        let proven = ["linuxcnc", "fanuc", "haas", "heidenhain", "sinumerik"].par_iter().filter(|control| {
            let post = controller(control);
            match post.program(&machine, &generated.plan, &generated.path) {
                Ok(_) => is_clean(&post, &machine, &generated),
                Err(failure) => {
                    let head = **control == "linuxcnc" && name.contains("head");
                    assert!(head || failure.0[0].code == "post::other_stylus", "{control} {name}: {failure}");
                    return false;
                }
            }
            true
        });
        proven.count()
    };
    let proven: usize = ["swivel-head", "double-head", "nutating-b", "trunnion-offset"].map(of).iter().sum();
    println!("{proven} programs");
    assert!(proven >= 12, "{proven}");
}

/// Functions are off and given back: one that the program has switched on itself, and one of before under which M128 would stand.
#[test]
fn the_transformation_is_switched_off_again() {
    let machine = machine("trunnion");
    let generated = generated(&machine, "basic", true);
    let post = controller("heidenhain");
    let text = text_of(&post, &machine, &generated);
    let of = |word: &str, n: usize| codes(&post, &machine, &generated, &without_line(&post, &text, word, n));
    assert!(of("M129", 0).contains(&"check::not_run"), "{:?}", of("M129", 0));
    assert!(of("M129", 1).contains(&"check::not_restored"), "{:?}", of("M129", 1));
}

/// At its end a program under `--tcp` has the control as it found it: each line that switches something off or gives it back counts.
/// Where it stops by itself it moves nothing, so the length stays on there, and its alarm says so.
#[test]
fn under_a_transformation_the_end_is_as_the_beginning() {
    for (name, program) in [("trunnion", "basic"), ("swivel-head", "table")] {
        let machine = machine(name);
        let generated = generated(&machine, program, true);
        for (control, alarm) in [("fanuc", "AXISCAL STOPPED TCP IS ON"), ("haas", "STOPPED TCP ON")] {
            let post = controller(control);
            let text = text_of(&post, &machine, &generated);
            let (touches, end) = text.split_at(text.find("DPRNT[E").unwrap());
            assert!(!touches.lines().any(|l| !l.starts_with('(') && l.contains("G49")), "{control}");
            assert!(end.contains(&format!("\n#3000=1({alarm})\n")), "{control}: {end}");
            let off = end.lines().find(|l| l.starts_with("G0 G49 Z[")).unwrap();
            let local = end.lines().find(|l| l.starts_with("G52 ")).unwrap();
            let with = |line: &str, other: &str| {
                let found = codes(&post, &machine, &generated, &format!("{touches}{}", end.replacen(line, other, 1)));
                println!("{control} {name}, {other:?} for {line:?}: {found:?}");
                found
            };
            for line in [off, local, "G#11 G#12 G#13 G#14", "G#15"] {
                assert!(with(line, "").contains(&"check::not_restored"), "{control} {line}");
            }
            // neither where Z goes elsewhere, nor before the rotary axes stand at 0
            assert!(!with(off, "G0 G49 Z0.").is_empty(), "{control}");
            assert!(!with(off, "G49").is_empty(), "{control}");
            let back = touches.rfind("\nG0 ").unwrap() + 1;
            let turned = format!("{}{}", &touches[..back], touches[back..].split_once('\n').unwrap().1);
            let found = codes(&post, &machine, &generated, &format!("{turned}{end}"));
            assert!(found.contains(&"check::not_run"), "{control}: {found:?}");
            // a stop that takes the length off moves: which axes is not known, the block may be near
            let wait = post.settings["wait"].clone();
            let stop = format!("N9\n{wait}\n{off}\n");
            let found = codes(&post, &machine, &generated, &format!("{touches}{}", end.replacen("N9\n", &stop, 1)));
            assert!(found.contains(&"check::goes_on"), "{control}: {found:?}");
        }
    }
}

/// A function that a user has left on turns, scales or shifts what a program says: it is taken off or asked for before anything moves.
#[test]
fn what_lasts_beyond_programs_is_seen_before_anything_moves() {
    let machine = machine("trunnion");
    let plain = generated(&machine, "basic", false);
    for (control, look, label) in [
        ("fanuc", "cancel = \"G40 G50 G15 G69 G80\\nG54.2 P0\"", "54.2"),
        ("haas", "cancel = \"G40 G50 G15 G69 G80\"", "51"),
    ] {
        let post = controller(control);
        let text = text_of(&post, &machine, &plain);
        // each of them by itself
        for asked in text.lines().filter(|l| l.starts_with("#4=#4*ABS[#40")) {
            let found = codes(&post, &machine, &plain, &text.replacen(&format!("{asked}\n"), "", 1));
            assert!(found.contains(&"check::start"), "{control} {asked}: {found:?}");
        }
        assert!(text.contains(&format!("-{label}]\n")), "{control}");
        // taken off, where the control has them: nothing is asked for
        let all = variant(control, &format!("[settings]\n{look}\n"));
        let text = text_of(&all, &machine, &plain);
        assert!(!text.contains("#4=#4*ABS[#40"), "{control}");
        is_clean(&all, &machine, &plain);
    }
    let haas = controller("haas");
    let text = text_of(&haas, &machine, &plain);
    let found = codes(&haas, &machine, &plain, &text.replacen("G255\n", "", 1));
    assert!(found.contains(&"check::start"), "{found:?}");
    let fanuc = controller("fanuc");
    let text = text_of(&fanuc, &machine, &plain);
    let found = codes(&fanuc, &machine, &plain, &text.replacen("G40 G69 G80\n", "G40 G69 G80\nG54.2 P1\n", 1));
    assert!(found.contains(&"check::not_run"), "{found:?}");
    // under the transformation words are of the workpiece's system
    let table = generated(&machine, "basic", true);
    // what no variable shows: the first moves do
    for (control, plan, line) in [
        ("fanuc", &plain, "IF[#4LT0.01]GOTO"),
        ("fanuc", &table, "IF[#4LT0.01]GOTO"),
        ("haas", &plain, "IF[#4LT0.01]GOTO"),
        ("heidenhain", &table, "FN 12: IF +Q1620 LT +0.01 GOTO LBL"),
    ] {
        let post = controller(control);
        let text = text_of(&post, &machine, plan);
        assert_eq!(text.matches(line).count(), 3, "{control}");
        assert!(codes(&post, &machine, plan, &text).is_empty(), "{control}");
        // it looks, and goes on whatever it sees
        let blind = text.replace(line, &line.replace("0.01", "9000.01"));
        let found = codes(&post, &machine, plan, &blind);
        assert!(found.contains(&"check::start"), "{control}: {found:?}");
    }
    // a look from one place only, in one axis, of one sense, at the first set-up: each leaves something unseen, and is not written
    let fanuc = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/postprocessors/fanuc.toml")).unwrap();
    let (_, look) = fanuc.split_once("[write.arrived]\ntemplate = \"\"\"\n").unwrap();
    let (look, _) = look.split_once("\"\"\"").unwrap();
    let own = |look: &str| {
        variant("fanuc", &format!("[write.arrived]\nsource = \"tried\"\ntemplate = \"\"\"\n{look}\"\"\"\n"))
    };
    for (what, from, to) in [
        ("one axis", "{% for w in stands %}", "{% for w in stands if w.axis == \"Z\" %}"),
        ("a sum with signs", "#4=#4+ABS[", "#4=#4+["),
        ("half a millimetre", "\"0.01\"", "\"0.5\""),
        ("the beginning only", "{{ settings.wait }}", "IF[#1GT1]GOTO{{ label }}\n{{ settings.wait }}"),
    ] {
        let changed = look.replacen(from, to, 1);
        assert_ne!(changed, look, "{what}");
        let post = own(&changed);
        let text = text_of(&post, &machine, &plain);
        let found = codes(&post, &machine, &plain, &text);
        assert!(found.contains(&"check::start"), "{what}: {found:?}");
    }
    is_clean(&own(look), &machine, &plain);
    // where it arrives, it has made no way when it is simply started again: it goes some way to see
    let post = controller("fanuc");
    let text = text_of(&post, &machine, &plain);
    let lines: Vec<&str> = text.lines().collect();
    let looks: Vec<usize> = (0..lines.len()).filter(|i| lines[*i].starts_with("IF[#4LT0.01]")).collect();
    let once = [&lines[..looks[0] + 5], &lines[looks[2] + 7..], &[""]].concat().join("\n");
    let found = codes(&post, &machine, &plain, &once);
    assert!(found.contains(&"check::start"), "{found:?}");
    // where the control has the function, it is taken off
    let off = variant("fanuc", "[settings]\ncancel = \"G40 G69 G80\\nG54.4 P0\"\n");
    let text = text_of(&off, &machine, &plain);
    assert!(codes(&off, &machine, &plain, &text.replace("IF[#4LT0.01]", "IF[#4LT9000.]")).is_empty());
    let found = codes(&off, &machine, &plain, &text.replacen("G54.4 P0", "G54.4 P1", 1));
    assert!(found.contains(&"check::not_run"), "{found:?}");
    for (control, line, instead) in [
        ("heidenhain", "FN 18: SYSREAD Q1620 = ID210 NR1 IDX0", "FN 0: Q1620 = +0"),
        ("sinumerik", "+ABS($P_ACTFRAME[Z,RT])", ""),
        ("sinumerik", "+ABS($P_ACTFRAME[X,SC]-1)", ""),
        ("sinumerik", "+$P_ACTFRAME[Y,MI]", ""),
    ] {
        let post = controller(control);
        let text = text_of(&post, &machine, &table);
        assert!(text.contains(line), "{control} {line}");
        assert!(codes(&post, &machine, &table, &text).is_empty(), "{control}");
        let found = codes(&post, &machine, &table, &text.replacen(line, instead, 1));
        assert!(found.contains(&"check::start"), "{control} {line}: {found:?}");
    }
}

/// Axes that count from 0 to 360 are not turned under a transformation by a controller that cannot write the sense of each step.
#[test]
fn a_roll_over_axis_under_the_transformation_is_refused_by_its_name() {
    let machine = machine("trunnion");
    let table = generated(&machine, "basic", true);
    for control in ["fanuc", "haas", "heidenhain"] {
        let post = variant(control, "[settings]\nmodulo = \"C\"\n");
        let refused = post.program(&machine, &table.plan, &table.path).unwrap_err();
        assert_eq!(refused.0[0].code, "post::roll_over", "{control}");
        assert!(refused.0[0].message.contains("axis C"), "{control}: {refused}");
    }
    is_clean(&variant("sinumerik", "[settings]\nmodulo = \"C\"\n"), &machine, &table);
}

/// Each tool offset holds another length: one whose length is read from another one's variable would move Z where it begins to act.
#[test]
fn the_length_that_is_counted_on_is_that_of_the_offset_that_acts() {
    let machine = machine("trunnion");
    let generated = generated(&machine, "basic", true);
    let of = |control: &str, lines: &str| {
        let post = variant(control, &format!("[settings]\n{lines}\n"));
        let text = text_of(&post, &machine, &generated);
        codes(&post, &machine, &generated, &text)
    };
    for (control, own) in [("fanuc", "#11025"), ("haas", "#2025")] {
        let pair = |length: &str| of(control, &format!("tool_offset = \"25\"\ntool_length = \"{length}\""));
        assert!(pair(own).is_empty(), "{control}: {:?}", pair(own));
        assert!(pair("#2024").contains(&"check::not_run"), "{control}: {:?}", pair("#2024"));
        let offset = of(control, "tool_offset = \"25\"");
        assert!(offset.contains(&"check::not_run"), "{control}: {offset:?}");
        let length = of(control, &format!("tool_length = \"{own}\""));
        assert!(length.contains(&"check::not_run"), "{control}: {length:?}");
    }
}

/// With No. 5006#6 (TOS) = 0 a G49 takes Z along by the length that acts: the program begins only where none does, and takes its own
/// off where Z stands.
#[test]
fn a_tool_length_is_never_taken_off_by_a_move_that_nobody_has_proven() {
    let machine = machine("trunnion");
    let (plain, table) = (generated(&machine, "basic", false), generated(&machine, "basic", true));
    for control in ["fanuc", "haas"] {
        let post = controller(control);
        let of = |generated: &Generated| text_of(&post, &machine, generated);
        let text = of(&plain);
        assert!(!text.lines().any(|l| !l.starts_with('(') && l.contains("G49")), "{control}");
        // it does not look whether a length acts
        let look = text.lines().find(|l| l.starts_with("IF[#4008EQ49]")).unwrap();
        let blind = without(&text, look, "GOTO9");
        let found = codes(&post, &machine, &plain, &blind);
        assert!(found.contains(&"check::start"), "{control}: {found:?}");
        // nor when it takes it off by itself
        let found = codes(&post, &machine, &plain, &blind.replacen("G40 G69 G80", "G40 G49 G69 G80", 1));
        assert!(found.contains(&"check::start"), "{control}: {found:?}");
        // with the rotary axes turned which axes a G49 moves is not known
        let text = of(&table);
        let end = text.rfind("M5\n").unwrap();
        let found = codes(&post, &machine, &table, &format!("{}G49\n{}", &text[..end], &text[end..]));
        assert!(!found.is_empty(), "{control}");
    }
    // at a stop for another stylus: where Z stands, and nowhere else
    let long = generated(&machine, "full", true);
    let post = controller("fanuc");
    let text = text_of(&post, &machine, &long);
    let off = text.lines().find(|l| l.starts_with("G0 G49 Z[")).unwrap();
    // and the local system is off as well before a person is asked to do something
    assert!(text.contains(&format!("{off}\nG52 X0. Y0. Z0. A0. C0.\n#18=0\n#3006=1(")), "{off}");
    let found = codes(&post, &machine, &long, &text.replace(off, "G49"));
    assert!(
        found.iter().any(|c| [
            "check::collision",
            "check::unguarded",
            "check::unknown_start",
            "check::not_run",
            "check::start"
        ]
        .contains(c)),
        "{found:?}"
    );
}

/// What a program finds: further work offsets, an offset of all, a local system, a mirror image.
#[test]
fn a_program_sees_what_acts_on_its_coordinates() {
    let machine = machine("trunnion");
    let generated = generated(&machine, "basic", false);
    for control in ["fanuc", "haas"] {
        let post = controller(control);
        let text = text_of(&post, &machine, &generated);
        // the guard against an offset that the program cannot take off
        let guard = text.lines().find(|l| l.starts_with("IF[#4LT0.02]GOTO")).unwrap();
        let unguarded = without(&text, guard, "GOTO9");
        let found = codes(&post, &machine, &generated, &unguarded);
        assert!(found.contains(&"check::start"), "{control}: {found:?}");
        // an offset that is taken as it is, and is 0 in some state
        let taken = text.lines().find(|l| l.starts_with("G52 X#27")).unwrap();
        let found = codes(&post, &machine, &generated, &text.replacen(taken, "G52 X0. Y0. Z0. A0. C0.", 1));
        assert!(!found.is_empty(), "{control}");
    }
    // the user's further work offset comes back
    let post = controller("fanuc");
    let text = text_of(&post, &machine, &generated);
    let found = codes(&post, &machine, &generated, &without_line(&post, &text, "G54.1 P#16", 0));
    assert!(found.contains(&"check::not_restored"), "{found:?}");
    // Haas cannot give it back: the program does not begin
    let post = controller("haas");
    let text = text_of(&post, &machine, &generated);
    let found = codes(&post, &machine, &generated, &without(&text, "IF[#15LT59.5]", "GOTO9"));
    assert!(found.contains(&"check::not_restored"), "{found:?}");
}
