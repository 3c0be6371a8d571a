//! The forms in which controls give their values out, and what a backup must not be taken for.

use super::controls::{Planted, accepting, correction, tables, text};
use super::support::machine;
use axiscal::diag::{Finding, Severity, source};
use axiscal::post::tables::Tables;
use axiscal::tables::compensation::Compensation;
use axiscal::tables::control::backup::{self, Old};
use axiscal::tables::control::{self, Export, Options};

fn read(t: &Tables, text: &str) -> Result<Old, String> {
    let names = control::names(&machine("trunnion"), t);
    backup::read(&source("b", text), &t.backup, &names).map_err(|f| f.to_string())
}

/// Every value of a trunnion's machine data, at 0 but for directions, with these lines in their places.
fn machine_data(instead: &[(&str, &str)]) -> String {
    let mut out = String::new();
    for (name, values) in [
        ("PART_OFFSET", ["0", "0", "250"]),
        ("BASE_TOOL", ["0", "0", "-250"]),
        ("JOINT_OFFSET", ["0", "0", "0"]),
        ("AXIS1", ["-1", "0", "0"]),
        ("AXIS2", ["0", "0", "-1"]),
    ] {
        for (k, value) in values.iter().enumerate() {
            let name = format!("$MC_TRAFO5_{name}_1[{k}]");
            let value = instead.iter().find(|(n, _)| *n == name).map_or(*value, |(_, v)| v);
            out += &format!("N24500 {name}={value}\n");
        }
    }
    out
}

fn exported(control: &str, old: Old, active: Option<&Compensation>) -> Result<(Export, Vec<Finding>), Vec<Finding>> {
    let machine = machine("trunnion");
    let planted: Planted = vec![("location-a", "EY0A", 0.02), ("location-c", "EX0C", 0.01)];
    let found = correction(&machine, &planted, active);
    control::export(&machine, control, &tables(control), &found, &Options { old, ..accepting() })
        .map(|(export, findings)| (export, findings.0))
        .map_err(|failure| failure.0)
}

fn said<'f>(findings: &'f [Finding], code: &str) -> Option<&'f Finding> {
    findings.iter().find(|f| f.code == code)
}

#[test]
fn machine_data_are_read_as_the_control_writes_them() {
    let t = tables("sinumerik");
    const NAME: &str = "$MC_TRAFO5_BASE_TOOL_1[0]";
    // a checksum behind the value, no blank behind the block number, small letters
    for line in [
        "N24550 $MC_TRAFO5_BASE_TOOL_1[0]=0.005 '2F34",
        "N24550 $MC_TRAFO5_BASE_TOOL_1[0]=0.005 '2F34 ;x",
        "N24550 $MC_TRAFO5_BASE_TOOL_1[0]=0.005'af",
        "N24550$MC_TRAFO5_BASE_TOOL_1[0]=0.005",
        "$mc_trafo5_base_tool_1 [ 0 ] = 0.005",
    ] {
        let old = read(&t, line).unwrap_or_else(|e| panic!("{line}: {e}"));
        assert_eq!((old.values[NAME].0, old.texts[NAME].as_str()), (0.005, "0.005"), "{line}");
    }
    for line in [
        "$MC_TRAFO5_BASE_TOOL_1[0]='2F34",
        "$MC_TRAFO5_BASE_TOOL_1[0]=0.005 'xyz",
        "$MC_TRAFO5_BASE_TOOL_1[0]=0.005 2F34",
    ] {
        assert!(read(&t, line).unwrap_err().contains("no number"), "{line}");
    }
}

#[test]
fn the_channel_that_is_written_is_the_one_that_is_read() {
    let t = tables("sinumerik");
    const NAME: &str = "$MC_TRAFO5_BASE_TOOL_1[0]";
    let both = format!("CHANDATA(2)\n{NAME}=90\n$AN_CEC[0,0]=0.003\nCHANDATA( 1 ) ; first\n{NAME}=0.005\n");
    let old = read(&t, &both).unwrap();
    assert_eq!(old.values[NAME].0, 0.005);
    // what is of no channel counts wherever it stands
    assert_eq!(old.values["$AN_CEC[0,0]"].0, 0.003);
    assert!(old.said[0].contains("CHANDATA(1)"), "{:?}", old.said);
    let (_, findings) = exported("sinumerik", Old { values: [].into(), ..old }, None).unwrap();
    assert!(said(&findings, "tables::old_chosen").is_some());
    let other = read(&t, &format!("CHANDATA(2)\n{NAME}=90\n")).unwrap_err();
    assert!(other.contains("CHANDATA(2) only"), "{other}");
}

/// The form of an 802D: blanks, and a point in place of the comma.
#[test]
fn points_of_position_tables_are_known_in_every_spelling() {
    let t = tables("sinumerik");
    for line in ["$AN_CEC [0.1] =0.003", "$AN_CEC[0, 1] = 0.003", "$an_cec[0,1]=0.003"] {
        assert_eq!(read(&t, line).unwrap().values["$AN_CEC[0,1]"].0, 0.003, "{line}");
    }
}

#[test]
fn parameters_are_read_as_the_control_punches_them() {
    let t = tables("fanuc");
    let value = |line: &str| read(&t, &format!("%\n{line}\n%\n")).map(|old| old.values["N19700"].0);
    for line in [
        "N19700Q1M0.012;",
        "N19700Q1L1M0.012",
        "N19700L1M0.012L2M9.0",
        "N19700 P 0.012",
        "N19700Q1L1P0.012",
        "N19700Q1L2M9.0L1M0.012",
    ] {
        assert_eq!(value(line), Ok(0.012), "{line}");
    }
    assert!(read(&t, "%\nN19700L1M0.012L2M9.0\n%\n").unwrap().said[0].contains("path 1"));
    let two = read(&t, "%\nN19700Q1L1M0.012\nN19700Q1L2M9.0\n%\n").unwrap();
    assert_eq!((two.values["N19700"].0, two.said.len()), (0.012, 1));
    for (line, says) in [
        ("N19700A1M0.012A2M0.0", "which one is meant"),
        ("N19700Q1P12", "least increment"),
        ("N19700Q1L2M0.012", "path 2 (L2) only"),
        ("N19700Q1L1M0.012L1M0.013", "no number"),
        ("N19700Q1M", "no number"),
        ("N19700Q1L", "no number"),
        ("N19700Q", "no number"),
        ("N19700Q1L99999999999M1.0", "no number"),
    ] {
        let failed = value(line).unwrap_err();
        assert!(failed.contains(says), "{line}: {failed}");
    }
}

/// What was active during the measurement is in the control: a backup from before it would lose it.
#[test]
fn a_backup_from_before_the_active_compensation_is_refused() {
    for (control, zero, line, wrote) in [
        ("sinumerik", machine_data(&[]), "$MC_TRAFO5_BASE_TOOL_1[1]", "= 0.02 mm"),
        (
            "fanuc",
            "%\nN19700Q1M0.0;\nN19701Q1M0.0;\nN19702Q1M-250.0;\nN19703Q1M0.0;\nN19704Q1M0.0;\nN19705Q1M0.0;\n%\n"
                .to_owned(),
            "N19701",
            "= 0.02 mm",
        ),
    ] {
        let t = tables(control);
        let first = exported(control, read(&t, &zero).unwrap(), None).unwrap().0;
        let before = &first.compensation;
        // from before it: refused, with both values, also where the record is of an older version
        let mut older = before.clone();
        older.tables.as_mut().unwrap().values.clear();
        for active in [before, &older] {
            let findings = exported(control, read(&t, &zero).unwrap(), Some(active)).unwrap_err();
            let finding =
                said(&findings, "tables::old_not_active").unwrap_or_else(|| panic!("{control}: {findings:?}"));
            assert_eq!(finding.severity, Severity::Error);
            assert!(finding.message.contains(line) || finding.message.contains("more differ"), "{control}: {finding}");
            assert!(finding.message.contains(wrote) || finding.message.contains("= 0.01 mm"), "{control}: {finding}");
        }
        // from after it, and none at all: the same numbers, on top of it
        let loaded = text(&first, &t.file[0].name);
        let after = exported(control, read(&t, &loaded).unwrap(), Some(before)).unwrap().0;
        let none = exported(control, Old::default(), Some(before)).unwrap().0;
        let new = |e: &Export| e.values.iter().map(|v| v.new).collect::<Vec<_>>();
        assert!(new(&after).iter().zip(new(&none)).all(|(a, b)| (a - b).abs() < 2e-6), "{control}");
        let of = |e: &Export| e.values.iter().find(|v| v.names.values().any(|n| n == line)).unwrap().new;
        assert!((of(&after) - 0.04).abs() < 2e-3, "{control}: {}", of(&after));
    }
}

/// Machine data and swivel data are two tables: each is added to its own old values.
#[test]
fn each_table_has_its_own_old_values() {
    let t = tables("sinumerik");
    let swivel = |x: &str| {
        let numbers = [
            ("4", x),
            ("5", "0"),
            ("6", "-250"),
            ("15", "0"),
            ("16", "0"),
            ("17", "0"),
            ("18", "0"),
            ("19", "0"),
            ("20", "250"),
            ("7", "-1"),
            ("8", "0"),
            ("9", "0"),
            ("10", "0"),
            ("11", "0"),
            ("12", "-1"),
        ];
        numbers.map(|(n, v)| format!("$TC_CARR{n}[1]={v}\n")).concat()
    };
    let data = machine_data(&[("$MC_TRAFO5_BASE_TOOL_1[0]", "0.005"), ("$MC_TRAFO5_PART_OFFSET_1[0]", "-0.005")]);
    let line = |e: &Export, file: &str, begins: &str| {
        text(e, file).lines().find(|l| l.starts_with(begins)).unwrap_or_default().to_owned()
    };
    let (base, carr) = ("$MC_TRAFO5_BASE_TOOL_1[0]=", "$TC_CARR4[1]=");
    // both, and they differ
    let (export, findings) =
        exported("sinumerik", read(&t, &(data.clone() + &swivel("0.105"))).unwrap(), None).unwrap();
    assert!(line(&export, "restore_trafo.ini", base).starts_with(&format!("{base}0.005 ")));
    assert!(line(&export, "restore_tcarr.ini", carr).starts_with(&format!("{carr}0.105 ")));
    assert!(line(&export, "axiscal_trafo.ini", base).starts_with(&format!("{base}0.005")));
    assert!(line(&export, "axiscal_tcarr.ini", carr).starts_with(&format!("{carr}0.105")));
    let differ = said(&findings, "tables::old_differ").unwrap();
    assert!(differ.message.contains("= 0.005 and") && differ.message.contains("= 0.105"), "{differ}");
    assert!(!text(&export, "restore_trafo.ini").contains("ASSUMED"));
    // one of them: the other's are not known, so that it is not written, and that is said
    let is_written = |e: &Export, name: &str| e.files.iter().any(|(n, _)| n == name);
    let (export, findings) = exported("sinumerik", read(&t, &swivel("0.005")).unwrap(), None).unwrap();
    assert_eq!(said(&findings, "tables::old_elsewhere").unwrap().severity, Severity::Warning);
    assert!(!is_written(&export, "restore_trafo.ini") && !is_written(&export, "axiscal_trafo.ini"));
    assert!(is_written(&export, "restore_tcarr.ini") && !is_written(&export, "axiscal_changes.txt"));
    assert_eq!(export.compensation.tables.as_ref().unwrap().files, ["axiscal_tcarr.ini"]);
    let (export, findings) = exported("sinumerik", read(&t, &data).unwrap(), None).unwrap();
    assert_eq!(said(&findings, "tables::old_elsewhere").unwrap().severity, Severity::Info);
    assert!(said(&findings, "tables::old_differ").is_none());
    assert!(!is_written(&export, "restore_tcarr.ini") && is_written(&export, "restore_trafo.ini"));
}

/// The head of a file stands first: the control looks for it in the first line.
#[test]
fn the_head_of_the_position_tables_stands_first() {
    let planted: Planted = vec![("scale-x", "EXX", 20.0)];
    let export = super::controls::export(&machine("trunnion"), "sinumerik", &planted, &accepting());
    for name in ["axiscal_cec.ini", "restore_cec.ini"] {
        assert!(text(&export, name).starts_with("%_N_NC_CEC_INI\n;"), "{}", text(&export, name));
    }
}

#[test]
fn a_direction_that_is_no_unit_vector_is_said() {
    let t = tables("sinumerik");
    let old = read(&t, &machine_data(&[("$MC_TRAFO5_AXIS2_1[2]", "-2")])).unwrap();
    let (_, findings) = exported("sinumerik", old, None).unwrap();
    assert!(said(&findings, "tables::direction_length").unwrap().message.contains("2.0000"));
}
