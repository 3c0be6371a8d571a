//! `axiscal check` without a plan: conditions on what a proof cannot know are run both ways, and what reaches beyond the program is named.

use crate::edits;

use assert_cmd::Command;
use serde_json::Value;

/// A small program that was written for a control.
struct Written {
    controller: &'static str,
    file: &'static str,
    folder: tempfile::TempDir,
    text: String,
}

impl Written {
    fn new(controller: &'static str, file: &'static str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("small.toml"), edits::SMALL).unwrap();
        let args = ["generate", "--machine", "swivel-head", "--program", "small.toml", "--out", "."];
        Command::cargo_bin("axiscal")
            .unwrap()
            .current_dir(folder.path())
            .args(args)
            .args(["--controller", controller])
            .assert()
            .success();
        let text = std::fs::read_to_string(folder.path().join(file)).unwrap();
        Self { controller, file, folder, text }
    }

    /// Exit code, codes of the findings, and the whole answer.
    fn check(&self, text: &str) -> (i32, Vec<String>, Value) {
        let text = if self.controller == "heidenhain" { numbered(text) } else { text.to_owned() };
        std::fs::write(self.folder.path().join(self.file), text).unwrap();
        let output = Command::cargo_bin("axiscal")
            .unwrap()
            .current_dir(self.folder.path())
            .args(["check", self.file, "--machine", "swivel-head", "--json", "--controller", self.controller])
            .output()
            .unwrap();
        let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
        let codes = answer["findings"].as_array().unwrap().iter().map(|f| f["code"].as_str().unwrap().to_owned());
        (output.status.code().unwrap(), codes.collect(), answer)
    }

    /// With lines behind the first set-up.
    fn with(&self, lines: &str) -> (i32, Vec<String>, Value) {
        let second = self.text.to_lowercase().find("set-up 2,").or_else(|| self.text.find("set-up 2:")).unwrap();
        let begin = self.text[..second].rfind('\n').unwrap() + 1;
        self.check(&format!("{}{lines}\n{}", &self.text[..begin], &self.text[begin..]))
    }
}

/// Blocks of Klartext with their running numbers.
fn numbered(text: &str) -> String {
    let bare = |line: &str| line.trim_start_matches(|c: char| c.is_ascii_digit()).trim_start().to_owned();
    text.lines().enumerate().map(|(n, line)| format!("{n} {}\n", bare(line))).collect()
}

fn each() -> [Written; 5] {
    [
        Written::new("linuxcnc", "small.ngc"),
        Written::new("fanuc", "small.nc"),
        Written::new("haas", "small.nc"),
        Written::new("sinumerik", "small.mpf"),
        Written::new("heidenhain", "small.h"),
    ]
}

fn is_dangerous(codes: &[String]) -> bool {
    codes.iter().any(|c| ["check::limit", "check::collision", "check::unguarded"].contains(&c.as_str()))
}

#[test]
fn what_axiscal_writes_is_accepted() {
    for written in each() {
        let (code, codes, answer) = written.check(&written.text);
        // Fanuc and Haas: where the axes stand before the first move is a value of the control
        let most = if written.controller == "fanuc" || written.controller == "haas" { 1 } else { 0 };
        let runs = answer["both_ways"].as_u64().unwrap();
        assert!(code == 0 && codes.is_empty() && runs <= most, "{}: {answer:#}", written.controller);
    }
}

/// A move into the blocks, behind a condition that does not let it happen in the runs as their values are.
#[test]
fn a_condition_on_what_is_not_known_is_run_both_ways() {
    let mut wrong = Vec::new();
    for written in each() {
        let macro_b = |condition: &str| format!("{condition}GOTO9990\nG0 Z-300.\nN9990");
        let ngc = |condition: &str| format!("o9000 if [{condition}]\nG0 Z-300\no9000 endif");
        let sinumerik =
            |before: &str, condition: &str| format!("{before}\nSTOPRE\nIF {condition}\nG0 SUPA Z=-300\nENDIF");
        let klartext = |before: &str, condition: &str| {
            format!("{before}\nFN 11: IF {condition} GOTO LBL 900\nL Z-300 R0 FMAX M91\nLBL 900")
        };
        let dangers: Vec<String> = match written.controller {
            "linuxcnc" => vec![
                ngc("EXISTS[#<_foo>]"),
                ngc("#5221 GT 1000"),
                ngc("#5214 GT 1000"),
                ngc("#5381 GT 1000"),
                ngc("#[5201 + 20 * #5220] GT 1000"),
                format!("#<value> = [#5222 * 2]\n#7 = [#<value> + 1]\n{}", ngc("#7 GT 1000")),
                format!("o9001 if [#5222 GT 1000]\n{}\no9001 endif", ngc("#5223 GT 1000")),
            ],
            "fanuc" | "haas" => vec![
                macro_b("IF[#3001LT100000.]"),
                macro_b("IF[#3012GT0]"),
                macro_b("IF[#2001LT100000.]"),
                macro_b("IF[#1005EQ0]"),
                macro_b("#20=#3001*2.\n#21=#20+1.\nIF[#21LT1000000.]"),
                // a flag that only the other way sets
                format!("#20=0\nIF[#3001LT100000.]GOTO9980\n#20=1\nN9980\n{}", macro_b("IF[#20EQ0]")),
            ],
            "sinumerik" => vec![
                sinumerik("$AC_TIMER[1]=0", "$AC_TIMER[1]>100000"),
                sinumerik("", "$A_SECOND>100"),
                sinumerik("", "$A_HOUR*3600+$A_MINUTE>1000000"),
                sinumerik("", "$A_IN[1]==1"),
                sinumerik("", "$P_ACTFRAME[X,SC]>10"),
            ],
            _ => vec![
                klartext("FN 18: SYSREAD Q1750 = ID320 NR1 IDX0", "+Q1750 GT +100"),
                klartext("FN 18: SYSREAD Q1750 = ID320 NR1 IDX0\nQ1751 = Q1750 * 2", "+Q1751 GT +100"),
                klartext("FN 18: SYSREAD Q1750 = ID210 NR1 IDX0", "+5 GT +Q1750"),
            ],
        };
        for lines in dangers {
            let (code, codes, answer) = written.with(&lines);
            if code != 1 || !is_dangerous(&codes) {
                wrong.push(format!("{}: {lines}: {code} {answer:#}", written.controller));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Both ways are harmless: the program is accepted, and says how many more runs were made.
#[test]
fn a_condition_whose_ways_are_both_harmless_is_accepted() {
    for written in each() {
        let (lines, runs) = match written.controller {
            "linuxcnc" => ("o9000 if [#5221 GT 1000]\n(MSG,far)\no9000 endif", 1),
            "fanuc" | "haas" => ("IF[#3001LT100000.]GOTO9990\nG4 P100\nN9990", 1),
            "sinumerik" => ("STOPRE\nIF $A_SECOND>100\nMSG(\"late\")\nENDIF", 1),
            // it only computes, and meets again
            _ => (
                "FN 18: SYSREAD Q1750 = ID320 NR1 IDX0\nFN 11: IF +Q1750 GT +100 GOTO LBL 900\nQ1750 = Q1750 + 86400\nLBL 900",
                0,
            ),
        };
        let before = written.check(&written.text).2["both_ways"].as_u64().unwrap();
        let (code, codes, answer) = written.with(lines);
        let expected = (0, &[][..], &Value::from(before + runs));
        assert_eq!((code, &codes[..], &answer["both_ways"]), expected, "{}", written.controller);
    }
}

/// A clock decides whether the program looks at a contact on the way, or stops after one.
#[test]
fn what_goes_wrong_is_followed_on_the_other_way_too() {
    let written = Written::new("fanuc", "small.nc");
    let called = written.folder.path().join("O9102.nc");
    let text = std::fs::read_to_string(&called).unwrap();
    for (line, instead) in [
        ("\nIF[ABS[#5061-#24]", "\nIF[#3001GT100000000.]GOTO2\nIF[ABS[#5061-#24]"),
        ("\nM99 P9\n", "\nIF[#3001GT100000000.]GOTO2\nM99 P9\n"),
    ] {
        let edited = text.replacen(line, instead, 1);
        assert_ne!(edited, text);
        std::fs::write(&called, edited).unwrap();
        let (code, codes, answer) = written.check(&written.text);
        assert!(code == 1 && codes.iter().any(|c| c == "check::goes_on"), "{answer:#}");
    }
}

/// What a block does must not hang on a clock.
#[test]
fn a_move_to_a_time_is_refused() {
    let written = Written::new("fanuc", "small.nc");
    let (code, codes, answer) = written.with("G0 Z[349.-#3001/100000000.]");
    assert!(code == 1 && codes.iter().any(|c| c == "check::not_run"), "{answer:#}");
}

#[test]
fn too_many_conditions_are_said() {
    let written = Written::new("fanuc", "small.nc");
    let one = |n: usize| format!("IF[#3001LT100000.]GOTO{n}\nG4 P100\nN{n}\n");
    let lines: String = (0..30).map(|n| one(9000 + n)).collect();
    let (code, codes, answer) = written.with(lines.trim_end());
    assert_eq!((code, &codes[..]), (1, &["check::too_many_branches".to_owned()][..]), "{answer:#}");
}

/// Another program, an output of the machine, another file: what they do is not in the program.
#[test]
fn what_reaches_beyond_the_program_is_named() {
    let mut wrong = Vec::new();
    for written in each() {
        let named: &[(&str, &str)] = match written.controller {
            "linuxcnc" => &[
                ("M100", "check::foreign_program"),
                ("M98 P100", "check::foreign_program"),
                ("o<elsewhere> call", "check::foreign_program"),
                ("M62 P0", "check::output"),
                ("M68 E0 Q1", "check::output"),
                ("(LOGOPEN,other.ngc)", "check::other_file"),
            ],
            "fanuc" | "haas" => &[
                ("M98 P1000", "check::foreign_program"),
                ("M198 P1000", "check::foreign_program"),
                ("G65 P9999", "check::foreign_program"),
                ("#1132=1", "check::output"),
                // where the program never comes to
                ("GOTO9990\n#1132=1\nN9990", "check::output"),
            ],
            "sinumerik" => &[
                ("EXTCALL(\"OTHER\")", "check::foreign_program"),
                ("CALL \"OTHER\"", "check::foreign_program"),
                ("L10", "check::foreign_program"),
                ("$A_OUT[1]=1", "check::output"),
                ("$A_DBB[4]=1", "check::output"),
                ("DELETE(AXC_ERR,\"OTHER_LOG\")", "check::other_file"),
                ("WRITE(AXC_ERR,\"OTHER_LOG\",\"X\")", "check::other_file"),
            ],
            _ => &[
                ("CALL PGM TNC:\\OTHER.H", "check::foreign_program"),
                ("CYCL DEF 12.0 PGM CALL", "check::foreign_program"),
                ("FN 19: PLC = +1 / +2", "check::output"),
                ("FN 29: PLC LIST = +1 / +2", "check::output"),
                ("FUNCTION FILE DELETE \"TNC:\\OTHER.A\"", "check::other_file"),
            ],
        };
        for (lines, expected) in named {
            let (code, codes, answer) = written.with(lines);
            if (code, &codes[..]) != (1, &[(*expected).to_owned()][..]) {
                wrong.push(format!("{}: {lines}: {code} {answer:#}", written.controller));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
