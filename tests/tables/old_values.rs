//! What the control held before: from the user's backup, by hand, in part, or of another machine.

use crate::controls::{CONTROLS, Planted, accepting, correction, tables, text};
use crate::support::machine;
use axiscal::diag::source;
use axiscal::machine::Machine;
use axiscal::post::tables::{LengthUnit, Tables};
use axiscal::tables::control::backup::{self, Old};
use axiscal::tables::control::{self, Export, Options};

/// Old values are the user's: only the identified change is added, at the user's own point of a line.
#[test]
fn the_user_s_own_values_are_added_to() {
    let machine = machine("trunnion");
    let planted = vec![("location-a", "EY0A", 0.02), ("location-c", "EX0C", 0.01), ("location-c", "EB0C", 0.01)];
    // the builder's C point lies 99.95 mm higher than that of the description, and 0.004 mm aside
    let text_of = "\
N24550 $MC_TRAFO5_BASE_TOOL_1[0]=0.1\n$MC_TRAFO5_BASE_TOOL_1[1]=-0.2 ; remark\n$MC_TRAFO5_BASE_TOOL_1[2]=-250.05EX+00\n\
$MC_TRAFO5_JOINT_OFFSET_PART_1[0]=0.004\n$MC_TRAFO5_JOINT_OFFSET_PART_1[1]=0\n$MC_TRAFO5_JOINT_OFFSET_PART_1[2]=100\n\
$MC_TRAFO5_PART_OFFSET_1[0]=-0.104\n$MC_TRAFO5_PART_OFFSET_1[1]=0.2\n$MC_TRAFO5_PART_OFFSET_1[2]=150.05\n\
$MC_TRAFO5_AXIS1_1[0]=-1\n$MC_TRAFO5_AXIS1_1[1]=0\n$MC_TRAFO5_AXIS1_1[2]=0\n\
$MC_TRAFO5_AXIS2_1[0]=0\n$MC_TRAFO5_AXIS2_1[1]=0\n$MC_TRAFO5_AXIS2_1[2]=-1\n$MC_OTHER[0]='H12'\n";
    let sheet = tables("sinumerik");
    let old = backup::read(&source("backup.ini", text_of), &sheet.backup, &control::names(&machine, &sheet)).unwrap();
    let options = Options { old, ..accepting() };
    let (export, findings) =
        control::export(&machine, "sinumerik", &sheet, &correction(&machine, &planted, None), &options).unwrap();
    assert!(
        !findings.0.iter().any(|f| f.code == "tables::old_assumed" || f.code == "tables::open_chain"),
        "{findings:?}"
    );
    let find = |name: &str| export.values.iter().find(|v| v.names.values().any(|n| n == name)).unwrap().clone();
    let y = find("$MC_TRAFO5_BASE_TOOL_1[1]");
    assert_eq!((y.old, y.new), (-0.2, -0.18));
    // C is stated at the pivot, z = -250: at the user's point, z = -150.05, it is 0.01 deg over 99.95 mm more aside
    let x = find("$MC_TRAFO5_JOINT_OFFSET_PART_1[0]");
    let by_hand = 0.004 + 0.01 + 0.01_f64.to_radians() * 99.95;
    assert!((x.new - by_hand).abs() < 3e-6, "{} {by_hand}", x.new);
    // it closes
    let sum = |k: &str| {
        ["BASE_TOOL", "JOINT_OFFSET_PART", "PART_OFFSET"]
            .map(|n| find(&format!("$MC_TRAFO5_{n}_1[{k}]")).new)
            .iter()
            .sum::<f64>()
    };
    assert!(["0", "1", "2"].iter().all(|k| sum(k).abs() < 1e-9));
    let restore = text(&export, "restore_trafo.ini");
    assert!(restore.contains("$MC_TRAFO5_BASE_TOOL_1[2]=-250.050000 "), "{restore}");
    assert!(text(&export, "axiscal_trafo.ini").contains("; Study sha256: 0123abcd\n"));
}

#[test]
fn a_bad_backup_is_refused_with_its_place() {
    let machine = machine("trunnion");
    let (siemens, fanuc) = (tables("sinumerik"), tables("fanuc"));
    let read = |t: &Tables, text: &str| {
        backup::read(&source("b", text), &t.backup, &control::names(&machine, t)).unwrap_err().to_string()
    };
    for (t, text, expected) in [
        (&siemens, "; x\n$MC_TRAFO5_BASE_TOOL_1[0]=1,5\n", "b:2:1: $MC_TRAFO5_BASE_TOOL_1[0] is no number here"),
        (
            &siemens,
            "$MC_TRAFO5_BASE_TOOL_1[0]=1\n$MC_TRAFO5_BASE_TOOL_1[0]=2\n",
            "b:2:1: $MC_TRAFO5_BASE_TOOL_1[0] stands twice",
        ),
        (&siemens, "$MC_TRAFO5_BASE_TOOL_1[0]=inf\n", "b:1:1: $MC_TRAFO5_BASE_TOOL_1[0] is no number"),
        (&siemens, "", "none of the values"),
        (&siemens, "\u{0}\u{1}garbage=\n==\n", "none of the values"),
        (&fanuc, "%\nN19700Q1M1.0;\nN19701Q1M1.0;\n", "cut off"),
        (&fanuc, "%\nN19700Q1X1.0;\n%\n", "b:2:1: N19700 is no number here"),
        (&fanuc, "%\nN19700Q1M1.0.0;\n%\n", "b:2:1: N19700 is no number here"),
    ] {
        let said = read(t, text);
        assert!(said.contains(expected), "{said}\n{expected}");
    }
    let good = backup::read(
        &source("b", "%\nN01005Q1A1P10000001;\nN19700Q1I1.0;\nN19701Q1M2;\n%\n"),
        &fanuc.backup,
        &control::names(&machine, &fanuc),
    )
    .unwrap();
    assert_eq!(good.values["N19700"], (1.0, Some(LengthUnit::Inch)));
    assert_eq!(good.values["N19701"], (2.0, Some(LengthUnit::Mm)));
}

#[test]
fn what_is_doubtful_is_refused() {
    let trunnion = machine("trunnion");
    let refused = |machine: &Machine, control: &str, planted: &Planted, options: &Options| {
        let t = tables(control);
        let failure = control::export(machine, control, &t, &correction(machine, planted, None), options).unwrap_err();
        failure.0.iter().map(|f| f.code).collect::<Vec<_>>()
    };
    let small: Planted = vec![("location-c", "EX0C", 0.01)];
    for control in CONTROLS {
        assert!(refused(&trunnion, control, &small, &Options::default()).contains(&"tables::unverified"), "{control}");
    }
    // the head's kinds of SINUMERIK are documented throughout
    let t = tables("sinumerik");
    let head = machine("double-head");
    assert!(
        control::export(
            &head,
            "sinumerik",
            &t,
            &correction(&head, &vec![("location-b", "EX0B", 0.01)], None),
            &Options::default()
        )
        .is_ok()
    );
    assert!(
        refused(&trunnion, "sinumerik", &vec![("location-c", "EX0C", 0.6)], &accepting())
            .contains(&"tables::too_large")
    );
    assert!(refused(&head, "haas", &vec![("location-b", "EX0B", 0.01)], &accepting()).contains(&"tables::kind"));
    // another machine's backup: the other sense, another place
    let names = ["$MC_TRAFO5_AXIS2_1[0]", "$MC_TRAFO5_AXIS2_1[1]", "$MC_TRAFO5_AXIS2_1[2]"];
    let values = names.iter().zip([0.0, 0.0, 1.0]).map(|(n, v)| ((*n).to_owned(), (v, None))).collect();
    assert!(
        refused(&trunnion, "sinumerik", &small, &Options { old: Old { values }, ..accepting() })
            .contains(&"tables::other_direction")
    );
    let values = [("$MC_TRAFO5_BASE_TOOL_1[1]".to_owned(), (3.0, None))].into();
    let old = Old { values };
    assert!(
        refused(&trunnion, "sinumerik", &small, &Options { old: old.clone(), ..accepting() })
            .contains(&"tables::other_place")
    );
    let forced = Options { old, force: true, ..accepting() };
    assert!(
        control::export(&trunnion, "sinumerik", &tables("sinumerik"), &correction(&trunnion, &small, None), &forced)
            .is_ok()
    );
}

/// Settings 255 to 257 of Haas: the change is added to what the user gives, and the sheet goes back to that.
#[test]
fn old_settings_of_haas_are_added_to_and_restored() {
    let machine = machine("trunnion");
    let sheet = tables("haas");
    let planted: Planted = vec![("location-a", "EY0A", 0.02), ("location-c", "EX0C", 0.01)];
    let with = |text_of: &str| {
        let names = control::names(&machine, &sheet);
        let old = backup::read(&source("settings.txt", text_of), &sheet.backup, &names).unwrap();
        let options = Options { old, ..accepting() };
        control::export(&machine, "haas", &sheet, &correction(&machine, &planted, None), &options).unwrap()
    };
    let said = |findings: &axiscal::diag::Findings, code: &str| {
        findings.0.iter().find(|f| f.code == code).map(|f| f.message.clone())
    };
    let find = |export: &Export, name: &str| {
        let value = export.values.iter().find(|v| v.names.values().any(|n| n == name)).unwrap();
        (value.old, value.new, value.known)
    };
    // older software: the three are all that there is
    let (export, findings) = with("SETTING 255 = 0.0510\nSETTING 256 = -0.0300\nSETTING 257 = -250.1000\n");
    assert_eq!(said(&findings, "tables::old_lacking"), None);
    assert_eq!(said(&findings, "tables::old_assumed"), None);
    assert_eq!(find(&export, "SETTING 255"), (0.051, 0.061, true));
    assert_eq!(find(&export, "SETTING 256"), (-0.03, -0.01, true));
    assert_eq!(find(&export, "SETTING 257"), (-250.1, -250.1, true));
    let line = |export: &Export, file: &str, name: &str| {
        text(export, file).lines().find(|l| l.starts_with(name)).unwrap().to_owned()
    };
    let restore = line(&export, "restore_worksheet.txt", "SETTING 255");
    assert!(restore.contains("=         0.0510") && restore.contains("instead of 0.0610, change -0.0100"), "{restore}");
    assert!(line(&export, "axiscal_worksheet.txt", "SETTING 300").contains("(ASSUMED)"));
    assert!(!line(&export, "axiscal_worksheet.txt", "SETTING 255").contains("(ASSUMED)"));
    // a part of either set: the others are named
    let (_, findings) = with("SETTING 255 = 0.0510\nSETTING 257 = -250.1000\n");
    assert!(said(&findings, "tables::old_lacking").unwrap().contains("old values of SETTING 256 are"));
    let (export, findings) = with("SETTING 300 = 0.01\nSETTING 301 = 0\nSETTING 302 = -250\nSETTING 303 = 0.0\n");
    assert!(said(&findings, "tables::old_lacking").unwrap().contains("of SETTING 304, SETTING 305 are"));
    assert!(text(&export, "README.txt").contains("NOT KNOWN"));
    // another machine's
    let other = Old { values: [("SETTING 255".to_owned(), (4.0, None))].into() };
    let options = Options { old: other, ..accepting() };
    let refused =
        control::export(&machine, "haas", &sheet, &correction(&machine, &planted, None), &options).unwrap_err();
    assert!(refused.0.iter().any(|f| f.code == "tables::other_place"), "{refused}");
}

/// A backup that holds some of the numbers only: the missing ones are named, for each control.
#[test]
fn what_a_backup_lacks_is_named() {
    let machine = machine("trunnion");
    for (control, text_of, lacks) in [
        ("sinumerik", "$MC_TRAFO5_BASE_TOOL_1[0]=0\n", "$MC_TRAFO5_BASE_TOOL_1[1]"),
        ("fanuc", "%\nN19700Q1M0.0;\nN19701Q1M0.0;\n%\n", "N19702, N19703"),
        ("heidenhain", "FIRST TABLE AXIS X = 0\n", "FIRST TABLE AXIS Y"),
    ] {
        let t = tables(control);
        let old = backup::read(&source("b", text_of), &t.backup, &control::names(&machine, &t)).unwrap();
        let planted: Planted = vec![("location-a", "EY0A", 0.02)];
        let options = Options { old, ..accepting() };
        let (_, findings) =
            control::export(&machine, control, &t, &correction(&machine, &planted, None), &options).unwrap();
        let said = findings.0.iter().find(|f| f.code == "tables::old_lacking").unwrap();
        assert!(said.message.contains(lacks), "{control}: {}", said.message);
    }
}

/// README.txt says how to load what was written, and nothing else.
#[test]
fn the_readme_names_no_file_that_is_not_written() {
    let machine = machine("trunnion");
    for (planted, there) in [
        (vec![("location-c", "EX0C", 0.01)], false),
        (vec![("location-c", "EX0C", 0.01), ("scale-x", "EXX", 20.0)], true),
    ] {
        let export = crate::controls::export(&machine, "sinumerik", &planted, &accepting());
        assert_eq!(export.files.iter().any(|(n, _)| n == "axiscal_cec.ini"), there);
        assert_eq!(text(&export, "README.txt").contains("axiscal_cec.ini"), there);
    }
}
