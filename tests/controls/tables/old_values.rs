//! What the control held before: from the user's backup, by hand, in part, or of another machine.

use super::controls::{CONTROLS, Planted, accepting, correction, tables, text};
use super::support::machine;
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
$MC_TRAFO5_JOINT_OFFSET_1[0]=0.004\n$MC_TRAFO5_JOINT_OFFSET_1[1]=0\n$MC_TRAFO5_JOINT_OFFSET_1[2]=100\n\
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
    let x = find("$MC_TRAFO5_JOINT_OFFSET_1[0]");
    let by_hand = 0.004 + 0.01 + 0.01_f64.to_radians() * 99.95;
    assert!((x.new - by_hand).abs() < 3e-6, "{} {by_hand}", x.new);
    // it closes
    let sum = |k: &str| {
        ["BASE_TOOL", "JOINT_OFFSET", "PART_OFFSET"]
            .map(|n| find(&format!("$MC_TRAFO5_{n}_1[{k}]")).new)
            .iter()
            .sum::<f64>()
    };
    assert!(["0", "1", "2"].iter().all(|k| sum(k).abs() < 1e-9));
    let restore = text(&export, "restore_trafo.ini");
    // with the user's own digits
    assert!(restore.contains("$MC_TRAFO5_BASE_TOOL_1[2]=-250.05EX+00 "), "{restore}");
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
    for control in CONTROLS.into_iter().filter(|c| *c != "sinumerik") {
        assert!(refused(&trunnion, control, &small, &Options::default()).contains(&"tables::unverified"), "{control}");
    }
    // the kinds of SINUMERIK are documented throughout
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
        refused(&trunnion, "sinumerik", &small, &Options { old: Old { values, ..Old::default() }, ..accepting() })
            .contains(&"tables::other_direction")
    );
    let values = [("$MC_TRAFO5_BASE_TOOL_1[1]".to_owned(), (3.0, None))].into();
    let old = Old { values, ..Old::default() };
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
    // the settings that this software has not are not known: they stand on no sheet
    let sheet_text = text(&export, "axiscal_worksheet.txt");
    assert!(sheet_text.contains("SETTING 255") && !sheet_text.contains("SETTING 300"), "{sheet_text}");
    // a part of either set: the others are named
    let (_, findings) = with("SETTING 255 = 0.0510\nSETTING 257 = -250.1000\n");
    assert!(said(&findings, "tables::old_lacking").unwrap().contains("of SETTING 256 are"));
    let (export, findings) = with("SETTING 300 = 0.01\nSETTING 301 = 0\nSETTING 302 = -250\nSETTING 303 = 0.0\n");
    assert!(said(&findings, "tables::old_lacking").unwrap().contains("of SETTING 304, SETTING 305 are"));
    let is_written = |name: &str| export.files.iter().any(|(n, _)| n == name);
    assert!(!is_written("axiscal_worksheet.txt") && !is_written("restore_worksheet.txt"));
    assert!(is_written("axiscal_changes.txt"));
    // another machine's
    let other = Old { values: [("SETTING 255".to_owned(), (4.0, None))].into(), ..Old::default() };
    let options = Options { old: other, ..accepting() };
    let refused =
        control::export(&machine, "haas", &sheet, &correction(&machine, &planted, None), &options).unwrap_err();
    let does = |refused: &axiscal::diag::Failure| {
        let found = refused.0.iter().find(|f| f.code == "tables::other_place").unwrap_or_else(|| panic!("{refused}"));
        found.help.as_ref().unwrap().split_once("--force ").unwrap().1.to_owned()
    };
    assert_eq!(does(&refused), "adds what was found to the old values all the same");
    // touches on which the old values did not act
    let mut given_as_axes = correction(&machine, &planted, None);
    given_as_axes.transformation = false;
    let refused = control::export(&machine, "haas", &sheet, &given_as_axes, &options).unwrap_err();
    assert_eq!(does(&refused), "replaces the old values by the description with what was found all the same");
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
        let export = super::controls::export(&machine, "sinumerik", &planted, &accepting());
        assert_eq!(export.files.iter().any(|(n, _)| n == "axiscal_cec.ini"), there);
        assert_eq!(text(&export, "README.txt").contains("axiscal_cec.ini"), there);
    }
}

fn read_old(machine: &Machine, t: &Tables, text_of: &str) -> Old {
    backup::read(&source("b", text_of), &t.backup, &control::names(machine, t)).unwrap()
}

/// What axiscal wrote says its unit: millimetres are not read as inches.
#[test]
fn a_sheet_of_the_other_unit_is_converted() {
    let machine = machine("trunnion");
    let planted: Planted = vec![("location-a", "EY0A", 0.02)];
    for control in ["haas", "heidenhain", "sinumerik"] {
        let t = tables(control);
        let first = super::controls::export(&machine, control, &planted, &accepting());
        let restore = t.file[0].restore.clone().unwrap();
        let old = read_old(&machine, &t, &text(&first, &restore));
        assert_eq!(old.unit(old.values.keys(), LengthUnit::Inch), Some(LengthUnit::Mm), "{control}");
        let options = Options { old, unit: LengthUnit::Inch, ..accepting() };
        let (inches, findings) =
            control::export(&machine, control, &t, &correction(&machine, &planted, None), &options).unwrap();
        assert!(findings.0.iter().any(|f| f.code == "tables::old_unit"), "{control}: {findings:?}");
        for (a, b) in first.values.iter().zip(&inches.values).filter(|(a, _)| a.unit == "mm") {
            assert!((a.old - b.old * 25.4).abs() < 1e-6, "{control} {}: {} {}", a.id, a.old, b.old);
        }
        // and goes back as it came, whatever the unit of the new values
        let numbers = |e: &Export| {
            let text = text(e, &restore);
            text.lines()
                .filter_map(|l| Some(l.split_once('=')?.1.split(';').next()?.trim().to_owned()))
                .collect::<Vec<_>>()
        };
        assert_eq!(numbers(&first), numbers(&inches), "{control}");
        assert!(text(&inches, &restore).contains("; lengths in mm"), "{control}");
        let readme = text(&inches, "README.txt");
        assert!(readme.contains("The restoring files are in mm, as the old values were given"), "{control}: {readme}");
        assert!(!text(&first, "README.txt").contains("The restoring files are in"), "{control}");
        // found on top of what the control held: where that puts the workpiece the study does not say
        assert!(readme.contains("measured on top of the old values"), "{control}: {readme}");
        let found = correction(&machine, &planted, None);
        let (changes, _) = control::export(&machine, control, &t, &found, &accepting()).unwrap();
        assert!(text(&changes, "README.txt").contains("The workpiece itself stands"), "{control}");
    }
}

/// A restoring file of an export without a backup holds what the machine's description said: it is no backup of the control.
#[test]
fn what_was_assumed_stays_assumed() {
    let machine = machine("trunnion");
    let planted: Planted = vec![("location-a", "EY0A", 0.02)];
    for control in CONTROLS {
        let t = tables(control);
        let first = super::controls::export(&machine, control, &planted, &accepting());
        let restore = t.file[0].restore.clone().unwrap();
        let again = |text_of: &str| {
            let options = Options { old: read_old(&machine, &t, text_of), ..accepting() };
            control::export(&machine, control, &t, &correction(&machine, &planted, None), &options).unwrap()
        };
        let own = text(&first, &restore);
        // as earlier versions marked it
        let names: Vec<&str> =
            own.lines().filter_map(|l| l.strip_prefix('N')?.split_once('Q')).map(|(n, _)| n).collect();
        let names = names.iter().map(|n| format!(" N{n}")).collect::<String>();
        let mark = |line: &str| match line.strip_prefix("%RESTORES THE VALUES BEFORE") {
            Some(rest) => format!("%RESTORES THE VALUES BEFORE - ASSUMED, COMPARE{names}{rest}\n"),
            None if line.contains('=') => format!("{line} (ASSUMED)\n"),
            None => format!("{line}\n"),
        };
        let sheet: String = own.lines().map(mark).collect();
        let (second, findings) = again(&sheet);
        // a control with two spellings has the marked one only
        assert!(second.values.iter().all(|v| !v.known), "{control}: {sheet}");
        assert!(findings.0.iter().any(|f| f.code == "tables::old_assumed"), "{control}: {findings:?}");
        assert!(!second.files.iter().any(|(name, _)| *name == restore || *name == t.file[0].name), "{control}");
        // the control's own numbers are known
        assert!(again(&own).0.values.iter().all(|v| v.known), "{control}");
    }
}

/// What the control held comes back to the last digit, and in the unit in which it was given.
#[test]
fn old_values_go_back_as_they_were_given() {
    let machine = machine("trunnion");
    let t = tables("fanuc");
    let planted: Planted = vec![("location-a", "EY0A", 0.02)];
    let restored = |text_of: &str, file: &str| {
        let options = Options { old: read_old(&machine, &t, text_of), ..accepting() };
        let (export, _) =
            control::export(&machine, "fanuc", &t, &correction(&machine, &planted, None), &options).unwrap();
        text(&export, file)
    };
    let metric =
        "%\nN19700Q1M0.1234;\nN19701Q1M0.;\nN19702Q1M-250.0;\nN19703Q1M0.0;\nN19704Q1M0.00;\nN19705Q1M0.;\n%\n";
    // with or without the path, the blank and the `;` at the end
    let plain = |line: &str| line.trim().trim_end_matches(';').replace("Q1L1", "Q1");
    let lines = |text: &str| text.lines().map(plain).filter(|l| l.starts_with('N')).collect::<Vec<_>>();
    assert_eq!(lines(&restored(metric, "restore_parameters.txt")), lines(metric));
    // inches, in an export of millimetres
    let inches = metric.replace("M0.1234", "I0.0039").replace("-250.0;", "-9.8425;").replace("Q1M", "Q1I");
    assert_eq!(lines(&restored(&inches, "restore_parameters.txt")), lines(&inches));
    let g10 = restored(&inches, "restore_g10.nc");
    assert!(g10.contains("G20\n") && g10.contains("N19700 R0.0039\n"), "{g10}");
    assert!(restored(&inches, "axiscal_g10.nc").contains("G21\n"));
    // one in inches, the others in millimetres: converted without the loss of a digit
    let mixed = metric.replace("M0.1234", "I0.0039");
    assert!(restored(&mixed, "restore_parameters.txt").contains("N19700Q1L1M0.099060 "));
    // a letter that says no unit is in that of --unit, not in that of the others
    let mixed = inches.replace("Q1I-9.8425", " P -249.9995");
    let again = restored(&mixed, "restore_parameters.txt");
    assert!(again.contains("N19702Q1L1M-249.9995 ") && again.contains("N19700Q1L1M0.099060 "), "{again}");
    let options = Options { old: read_old(&machine, &t, &mixed), ..accepting() };
    let (_, findings) =
        control::export(&machine, "fanuc", &t, &correction(&machine, &planted, None), &options).unwrap();
    let found = findings.0.iter().find(|f| f.code == "tables::old_units").unwrap();
    assert!(found.message.contains("N19700 is in inch (line 2 of the backup), others in mm"), "{found:?}");
}

/// Where none of the values is there, the example is one that is always written.
#[test]
fn the_example_of_a_backup_is_no_point_of_a_position_table() {
    let (machine, t) = (machine("trunnion"), tables("sinumerik"));
    let such_as = control::example(&machine, &t).unwrap();
    assert!(!such_as.contains("CEC"), "{such_as}");
    let names = control::names(&machine, &t);
    let refused = backup::read_such_as(&source("b", "; nothing"), &t.backup, &names, &such_as).unwrap_err();
    assert!(refused.to_string().contains(&such_as), "{refused}");
}

/// The same error has the same size whatever the control.
#[test]
fn what_is_left_has_one_definition() {
    let machine = machine("trunnion");
    let planted: Planted = vec![("location-a", "EB0A", 0.0041)];
    let of = |control: &str| {
        let export = super::controls::export(&machine, control, &planted, &accepting());
        export.left.iter().find(|l| l.parameter == "EB0A").unwrap().left_um.unwrap()
    };
    let by_hand = 0.0041_f64.to_radians() * 100.0 * 1e3;
    for control in ["fanuc", "haas", "heidenhain"] {
        assert!((of(control) - by_hand).abs() < 1e-6, "{control}: {}", of(control));
    }
    let found = correction(&machine, &planted, None);
    let (export, _) =
        axiscal::tables::linuxcnc::export(&machine, &found, &axiscal::tables::linuxcnc::Options::default()).unwrap();
    let stock = export.stock.left.iter().find(|l| l.parameter == "EB0A").unwrap();
    assert!((stock.left_um.unwrap() - by_hand).abs() < 1e-6, "{stock:?}");
}

/// Old vectors that do not close: the new ones do, and machine coordinates at rotary zero go by the gap. That stands in the files; above
/// the limit it is refused, and where it is forced, that stands there too.
#[test]
fn vectors_that_do_not_close_are_said_where_they_are_loaded() {
    let machine = machine("trunnion");
    let sheet = tables("sinumerik");
    let planted = vec![("location-a", "EY0A", 0.02)];
    let backup_of = |gap: f64| {
        format!(
            "$MC_TRAFO5_BASE_TOOL_1[0]=0\n$MC_TRAFO5_BASE_TOOL_1[1]=0\n$MC_TRAFO5_BASE_TOOL_1[2]=-250\n\
             $MC_TRAFO5_JOINT_OFFSET_1[0]=0\n$MC_TRAFO5_JOINT_OFFSET_1[1]=0\n$MC_TRAFO5_JOINT_OFFSET_1[2]=0\n\
             $MC_TRAFO5_PART_OFFSET_1[0]=0\n$MC_TRAFO5_PART_OFFSET_1[1]=0\n$MC_TRAFO5_PART_OFFSET_1[2]={}\n\
             $MC_TRAFO5_AXIS1_1[0]=-1\n$MC_TRAFO5_AXIS1_1[1]=0\n$MC_TRAFO5_AXIS1_1[2]=0\n\
             $MC_TRAFO5_AXIS2_1[0]=0\n$MC_TRAFO5_AXIS2_1[1]=0\n$MC_TRAFO5_AXIS2_1[2]=-1\n",
            250.0 + gap
        )
    };
    let export = |gap: f64, force: bool| {
        let read = source("b.ini", backup_of(gap));
        let old = backup::read(&read, &sheet.backup, &control::names(&machine, &sheet)).unwrap();
        control::export(
            &machine,
            "sinumerik",
            &sheet,
            &correction(&machine, &planted, None),
            &Options { old, force, ..accepting() },
        )
    };
    let offsets = |e: &Export| {
        let readme = text(e, "README.txt");
        (readme.contains("at 0 stay right"), readme.contains("Touch off all work offsets again"))
    };
    let (closed, _) = export(0.0, false).unwrap();
    assert_eq!(offsets(&closed), (true, false));
    let (open, findings) = export(0.2, false).unwrap();
    assert!(findings.0.iter().any(|f| f.code == "tables::open_chain"), "{findings:?}");
    assert_eq!(offsets(&open), (false, true));
    assert!(text(&open, "README.txt").contains("+0.2000"), "{}", text(&open, "README.txt"));
    assert!(text(&open, "axiscal_trafo.ini").contains("; The old vectors did not close"));
    // the restoring file brings those back that are open
    let back = text(&open, "restore_trafo.ini");
    assert!(
        back.contains("; The vectors of this file do not close") && !back.contains("did not close, the new ones do:")
    );
    let refused = export(202.67, false).unwrap_err();
    let found = refused.0.iter().find(|f| f.code == "tables::open_chain").unwrap();
    assert!(found.message.contains("202.6700 mm off") && found.help.as_ref().unwrap().contains("--force"), "{found:?}");
    let (forced, _) = export(202.67, true).unwrap();
    for (name, mark) in
        [("README.txt", "FORCED: written with --force"), ("axiscal_trafo.ini", "; FORCED, 1 finding spoke against it")]
    {
        assert!(text(&forced, name).contains(mark), "{name}: {}", text(&forced, name));
    }
    let readme = text(&forced, "README.txt");
    assert!(readme.contains("FORCED, 1 finding spoke against it"), "{readme}");
    assert_eq!(forced.compensation.provenance.forced.len(), 1);
    assert!(!text(&open, "README.txt").contains("FORCED") && open.compensation.provenance.forced.is_empty());
}

/// What rounding leaves is that of the unit in which the values are written.
#[test]
fn the_step_of_an_inch_control_is_in_inches() {
    let machine = machine("trunnion");
    let planted = vec![("location-a", "EY0A", 0.02)];
    for (control, unit, says) in [
        ("fanuc", LengthUnit::Mm, "Rounding to 0.001 mm leaves"),
        ("fanuc", LengthUnit::Inch, "Rounding to 0.0001 inch leaves"),
        ("haas", LengthUnit::Inch, "Rounding to 0.0001 inch leaves"),
    ] {
        let options = Options { unit, ..accepting() };
        let (export, _) =
            control::export(&machine, control, &tables(control), &correction(&machine, &planted, None), &options)
                .unwrap();
        assert!(text(&export, "README.txt").contains(says), "{control}: {}", text(&export, "README.txt"));
    }
}
