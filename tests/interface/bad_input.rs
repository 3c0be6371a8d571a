//! Bad input through the binary: a clear message with the place, exit code 2 (or a warning and 0 where the rest is usable),
//! never a panic, never a half-written file.

use std::path::PathBuf;
use std::process::{Command, Output};

struct Job(tempfile::TempDir);

impl Job {
    /// A folder with a program, its plan, and a good log of the virtual machine.
    fn new() -> Self {
        let job = Self(tempfile::tempdir().unwrap());
        let ok = job.call(&[
            "generate",
            "--machine",
            "swivel-head",
            "--program",
            "table",
            "--controller",
            "linuxcnc",
            "--out",
            ".",
        ]);
        assert!(ok.status.success(), "{}", said(&ok));
        job.write("wrong.toml", "seed = 3\n[effects.paper-table]\nd_xCY = 0.03\n[noise]\ntouch_um = 0.2\n");
        let ok = job.call(&[
            "simulate",
            "--plan",
            "table.plan.json",
            "--machine",
            "swivel-head",
            "--scenario",
            "wrong.toml",
            "--controller",
            "linuxcnc",
            "--out",
            "good.log",
        ]);
        assert!(ok.status.success(), "{}", said(&ok));
        job
    }

    fn call(&self, args: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_axiscal")).args(args).current_dir(self.0.path()).output().unwrap()
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), bytes).unwrap();
    }

    fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }

    /// Parses a log into touches.csv; the file is written when, and only when, the exit code is 0.
    fn parse(&self, log: &str) -> Output {
        let _ = std::fs::remove_file(self.path("touches.csv"));
        let out =
            self.call(&["parse", log, "--controller", "linuxcnc", "--plan", "table.plan.json", "--out", "touches.csv"]);
        assert_eq!(self.path("touches.csv").exists(), out.status.code() == Some(0), "{}", said(&out));
        self.unbroken(&out);
        out
    }

    /// No panic, and nothing temporary left behind.
    fn unbroken(&self, out: &Output) {
        let text = said(out);
        assert!(!text.contains("panicked") && out.status.code().is_some_and(|c| (0..=2).contains(&c)), "{text}");
        for entry in std::fs::read_dir(self.0.path()).unwrap() {
            let name = entry.unwrap().file_name();
            assert!(!name.to_string_lossy().starts_with(".axiscal-"), "{name:?} is left behind");
        }
    }
}

fn said(out: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&out.stdout), String::from_utf8_lossy(&out.stderr))
}

/// The exit code, and words that the message must hold.
#[track_caller]
fn expect(out: &Output, code: i32, words: &[&str]) {
    let text = said(out);
    assert_eq!(out.status.code(), Some(code), "{text}");
    for word in words {
        assert!(text.contains(word), "{word:?} is missing in:\n{text}");
    }
}

#[test]
fn damaged_logs() {
    let job = Job::new();
    let good = job.read("good.log");
    let lines: Vec<&str> = good.lines().collect();
    let replaced = |n: usize, with: &str| -> String {
        let mut all: Vec<String> = lines.iter().map(|l| (*l).to_owned()).collect();
        all[n] = with.to_owned();
        all.join("\n") + "\n"
    };

    job.write("half.log", &good[..good.len() / 2]);
    expect(&job.parse("half.log"), 0, &["half.log:", "warning"]);

    job.write("crlf.log", good.replace('\n', "\r\n"));
    expect(&job.parse("crlf.log"), 0, &["154"]);

    job.write("empty.log", "");
    expect(&job.parse("empty.log"), 2, &["empty.log", "help:"]);

    let noise: Vec<u8> = (0..4000u32).map(|i| (i * 7919 % 251) as u8).collect();
    job.write("binary.log", noise);
    expect(&job.parse("binary.log"), 2, &["binary.log", "help:"]);

    job.write("nan.log", replaced(10, &lines[10].replacen('X', "XNAN ", 1)));
    expect(&job.parse("nan.log"), 0, &["nan.log:11:"]);

    // a line that somebody edited does not add up any more
    job.write("edited.log", replaced(10, &lines[10].replace(" S1 ", " S0 ")));
    expect(&job.parse("edited.log"), 0, &["edited.log:11:", "not used"]);

    // a miss is a touch without a trigger: kept, marked, and never a measurement
    job.write("moved.toml", "[[block]]\nmounting = \"table\"\nname = \"x+\"\nshift = [0.0, 0.0, -2.5]\n");
    let args = ["simulate", "--plan", "table.plan.json", "--machine", "swivel-head", "--scenario", "moved.toml"];
    let ok = job.call(&[&args[..], &["--controller", "linuxcnc", "--out", "miss.log"]].concat());
    assert!(ok.status.success(), "{}", said(&ok));
    expect(&job.parse("miss.log"), 0, &["miss.log:2:", "missed"]);
    assert!(job.read("touches.csv").contains("miss"));

    // X and Z exchanged in every line
    let swapped: String =
        good.lines().map(|l| l.replace('X', "q").replace('Z', "X").replace('q', "Z") + "\n").collect();
    job.write("swapped.log", swapped.replacen("H ZZISCZL", "H AXISCAL", 1));
    let out = job.parse("swapped.log");
    assert_ne!(out.status.code(), Some(0), "{}", said(&out));

    // a second run behind the first: the last complete one is taken, and that is said
    job.write("twice.log", format!("{good}{good}"));
    expect(&job.parse("twice.log"), 0, &["run"]);
}

#[test]
fn a_log_of_another_program_is_refused() {
    let job = Job::new();
    let ok = job.call(&[
        "generate",
        "--machine",
        "swivel-head",
        "--program",
        "head",
        "--controller",
        "linuxcnc",
        "--out",
        ".",
    ]);
    assert!(ok.status.success());
    let out = job.call(&[
        "parse",
        "good.log",
        "--controller",
        "linuxcnc",
        "--plan",
        "head.plan.json",
        "--out",
        "touches.csv",
    ]);
    job.unbroken(&out);
    expect(&out, 2, &["good.log:1:", "plan"]);
    assert!(!job.path("touches.csv").exists());
}

#[test]
fn unusable_calls_name_the_remedy() {
    let job = Job::new();
    let cases: [(&[&str], &[&str]); 8] = [
        (
            &["generate", "--machine", "nonsense", "--program", "head", "--controller", "linuxcnc", "--out", "o"],
            &["nonsense", "swivel-head"],
        ),
        (
            &[
                "generate",
                "--machine",
                "swivel-head",
                "--program",
                "nonsense",
                "--controller",
                "linuxcnc",
                "--out",
                "o",
            ],
            &["nonsense", "head"],
        ),
        (
            &["generate", "--machine", "swivel-head", "--program", "head", "--controller", "nonsense", "--out", "o"],
            &["nonsense", "linuxcnc"],
        ),
        (
            &["generate", "--machine", "trunnion", "--program", "head", "--controller", "linuxcnc", "--out", "o"],
            &["head", "trunnion"],
        ),
        (&["parse", "absent.log", "--controller", "linuxcnc", "--plan", "table.plan.json"], &["absent.log"]),
        (&["parse", "good.log", "--controller", "linuxcnc", "--plan", "good.log"], &["good.log:1:"]),
        (&["identify", "absent.toml"], &["absent.toml"]),
        (
            &[
                "simulate",
                "--plan",
                "table.plan.json",
                "--machine",
                "double-head",
                "--controller",
                "linuxcnc",
                "--out",
                "x.log",
            ],
            &["swivel-head", "double-head"],
        ),
    ];
    for (args, words) in cases {
        let out = job.call(args);
        job.unbroken(&out);
        expect(&out, 2, words);
        assert!(said(&out).contains("help:"), "{args:?} gives no remedy:\n{}", said(&out));
    }
    assert!(!job.path("o").exists() && !job.path("x.log").exists(), "a refused call wrote something");
}

#[test]
fn broken_toml_has_line_and_column() {
    let job = Job::new();
    job.write("broken.toml", "format = \"axiscal-machines/1\"\n[[machine]\nname = \"m\"\n");
    expect(&job.call(&["machines", "--machines", "broken.toml"]), 2, &["broken.toml:2:"]);
    job.write("study.toml", "machine = \"swivel-head\"\n[[data]]\nplan = 3\n");
    expect(&job.call(&["identify", "study.toml"]), 2, &["study.toml:3:"]);
    job.write("study.toml", "machine = \"swivel-head\"\n[[data]]\nplan = \"table.plan.json\"\nlog = \"good.log\"\ncontroller = \"linuxcnc\"\n[model]\neffects = [\"paper-tabel\"]\n");
    expect(&job.call(&["identify", "study.toml"]), 2, &["paper-tabel", "paper-table"]);
    job.write("wrong.toml", "[effects.paper-table]\nd_xCY = nan\n");
    let args = [
        "simulate",
        "--plan",
        "table.plan.json",
        "--machine",
        "swivel-head",
        "--scenario",
        "wrong.toml",
        "--controller",
        "linuxcnc",
        "--out",
        "x.log",
    ];
    expect(&job.call(&args), 2, &["wrong.toml:2:"]);
    assert!(!job.path("x.log").exists());
}

#[test]
fn a_machine_with_several_mistakes_gets_all_findings_at_once() {
    let job = Job::new();
    let text = include_str!("../../machines.toml");
    let damaged = text
        .replacen("parent = \"base\"\n", "", 1) // X has no parent
        .replacen("direction = [0.0, 1.0, 0.0]\n", "", 1) // Y has no direction
        .replacen("range = [-350.0, 350.0]", "range = [350.0, -350.0]", 1) // Z the wrong way round
        .replacen("[machine.tool]\nparent = \"B\"", "[[machine.tool]]\nparent = \"B\"\npivot = [0, 0, 0]\ndirection = [0, 0, 1]\nlength = 1.0\n[[machine.tool]]\nparent = \"B\"", 1);
    job.write("own.toml", damaged);
    let out = job.call(&["machines", "--machines", "own.toml"]);
    expect(&out, 2, &["axis X", "no parent", "axis Y", "no direction", "axis Z", "lowest before highest", "2 tools"]);
    assert!(said(&out).matches("help:").count() >= 4);
    // and a chain that bears itself
    job.write("cyclic.toml", text.replacen("name = \"X\"\nparent = \"base\"", "name = \"X\"\nparent = \"C\"", 1));
    expect(&job.call(&["machines", "--machines", "cyclic.toml"]), 2, &["cyclic"]);
}

#[test]
fn an_unwritable_folder_leaves_nothing_behind() {
    let job = Job::new();
    job.write("a-file", "");
    let out = job.call(&[
        "generate",
        "--machine",
        "swivel-head",
        "--program",
        "head",
        "--controller",
        "linuxcnc",
        "--out",
        "a-file/below",
    ]);
    job.unbroken(&out);
    expect(&out, 2, &["a-file"]);
}

#[test]
fn a_study_is_never_overwritten() {
    let job = Job::new();
    job.write("study.toml", "# mine\n");
    let out = job.call(&[
        "new",
        "--machine",
        "swivel-head",
        "--plan",
        "table.plan.json",
        "--log",
        "good.log",
        "--out",
        "study.toml",
    ]);
    expect(&out, 2, &["exists"]);
    assert_eq!(job.read("study.toml"), "# mine\n");
}

#[test]
fn a_file_of_zeros_is_refused() {
    let job = Job::new();
    // a sparse file: no disk is used, and it is read no further than it must be
    let file = std::fs::File::create(job.path("huge.log")).unwrap();
    file.set_len(64 << 20).unwrap();
    let out = job.parse("huge.log");
    expect(&out, 2, &["huge.log"]);
}

/// Every touch is taken out: too little data, said before any search, and no panic.
#[test]
fn a_study_without_a_touch_that_is_used() {
    let job = Job::new();
    let made = job.call(&[
        "new",
        "--machine",
        "swivel-head",
        "--plan",
        "table.plan.json",
        "--log",
        "good.log",
        "--controller",
        "linuxcnc",
        "--out",
        "study.toml",
    ]);
    expect(&made, 0, &[]);
    let plan: serde_json::Value = serde_json::from_str(&job.read("table.plan.json")).unwrap();
    let masks: String = plan["touches"]
        .as_array()
        .unwrap()
        .iter()
        .map(|t| format!("\n[[mask]]\nrun = 1\nid = {}\nreason = \"knocked\"\n", t["id"]))
        .collect();
    job.write("study.toml", job.read("study.toml") + &masks);
    for verb in [
        &["diagnose", "study.toml"][..],
        &["compare", "study.toml"],
        &["report", "study.toml", "--out", "r.html", "--plots", "plots"],
    ] {
        let out = job.call(verb);
        job.unbroken(&out);
        assert_ne!(out.status.code(), Some(2), "{verb:?}: {}", said(&out));
        if verb[0] != "compare" {
            assert!(said(&out).contains("Too few touches to judge"), "{verb:?}: {}", said(&out));
        }
    }
}

/// A mask of a touch that no plan has is a wrong number. The next call after `new` can be copied as it is.
#[test]
fn a_masked_touch_must_be_in_the_plan() {
    let job = Job::new();
    let mut new = vec!["new", "--machine", "swivel-head", "--plan", "table.plan.json", "--log", "good.log"];
    new.extend(["--controller", "linuxcnc", "--out", "studie ä.toml"]);
    expect(&job.call(&new), 0, &["next: axiscal identify \"studie ä.toml\"\n"]);
    let text = job.read("studie ä.toml");
    let mask = |id: u32| format!("{text}\n[[mask]]\nrun = 1\nid = {id}\nreason = \"x\"\n");
    let line = text.lines().count() + 4;
    job.write("masked.toml", mask(9999));
    let place = format!("masked.toml:{line}:6: ");
    for verb in ["identify", "diagnose"] {
        let says = "there is no touch 9999 in the plan of run 1";
        expect(&job.call(&[verb, "masked.toml"]), 2, &[&place, says, "help:"]);
    }
    // the plan has it and the log does not: a remark
    job.write("masked.toml", mask(2));
    let log: String =
        job.read("good.log").lines().filter(|l| !l.starts_with("P N2 ")).map(|l| format!("{l}\n")).collect();
    assert_ne!(log, job.read("good.log"));
    job.write("good.log", log);
    expect(&job.call(&["identify", "masked.toml", "--verbose"]), 0, &["There is no touch 2 in run 1"]);
}

/// A reference point that no machine has is a slip of the keyboard: values stated there would be of no use.
#[test]
fn a_reference_beyond_any_machine_is_refused() {
    let job = Job(tempfile::tempdir().unwrap());
    let call = |at: &str| job.call(&["assess", "--machine", "swivel-head", "--plan", "table", "--reference", at]);
    for at in ["1e300,0,0", "0,-1000001,0", "0,0,1e7"] {
        let out = call(at);
        assert_eq!(out.status.code(), Some(2), "{at}: {}", said(&out));
        assert!(
            said(&out).contains("more than a kilometre off") && said(&out).contains("X,Y,Z in mm"),
            "{}",
            said(&out)
        );
    }
    for at in ["nan,0,0", "1,2", "here"] {
        let out = call(at);
        assert!(out.status.code() == Some(2) && said(&out).contains("is no point"), "{at}: {}", said(&out));
    }
    assert_eq!(call("0,0,-202.684").status.code(), Some(0));
}

/// An edit of a plan, of its JSON.
type Edit = fn(&mut serde_json::Value);

#[test]
fn a_plan_that_cannot_be_so_is_refused_by_every_verb() {
    let job = Job::new();
    let good = job.read("table.plan.json");
    let edits: [(&str, Edit); 3] = [
        // the second coordinate of every point, and nothing else
        ("point", |p| p["touches"].as_array_mut().unwrap().iter_mut().for_each(|t| t["point"][1] = 0.0.into())),
        ("ball_radius_mm", |p| p["ball_radius_mm"] = 1e12.into()),
        ("tool_length_mm", |p| p["tool_length_mm"] = 0.0.into()),
    ];
    let new = [
        "new",
        "--machine",
        "swivel-head",
        "--plan",
        "table.plan.json",
        "--log",
        "good.log",
        "--controller",
        "linuxcnc",
        "--out",
        "study.toml",
    ];
    expect(&job.call(&new), 0, &[]);
    for (field, edit) in edits {
        let mut plan: serde_json::Value = serde_json::from_str(&good).unwrap();
        edit(&mut plan);
        job.write("table.plan.json", serde_json::to_string(&plan).unwrap());
        let verbs: [&[&str]; 9] = [
            &["identify", "study.toml"],
            &["compare", "study.toml"],
            &["diagnose", "study.toml"],
            &["report", "study.toml", "--out", "r.html"],
            &["export", "study.toml", "--controller", "linuxcnc", "--out", "comp"],
            &["parse", "good.log", "--controller", "linuxcnc", "--plan", "table.plan.json", "--out", "t.csv"],
            &["assess", "--machine", "swivel-head", "--plan", "table.plan.json"],
            &[
                "check",
                "table.ngc",
                "--machine",
                "swivel-head",
                "--controller",
                "linuxcnc",
                "--plan",
                "table.plan.json",
            ],
            &[
                "simulate",
                "--plan",
                "table.plan.json",
                "--machine",
                "swivel-head",
                "--scenario",
                "wrong.toml",
                "--controller",
                "linuxcnc",
                "--out",
                "x.log",
            ],
        ];
        for verb in verbs {
            let out = job.call(verb);
            assert_eq!(out.status.code(), Some(2), "{field} {verb:?}: {}", said(&out));
        }
        for file in ["r.html", "comp", "t.csv", "x.log"] {
            assert!(!job.path(file).exists(), "{field} {file}");
        }
    }
}

#[test]
fn a_backup_far_beyond_the_machine_is_refused() {
    let job = Job::new();
    let new = [
        "new",
        "--machine",
        "swivel-head",
        "--plan",
        "table.plan.json",
        "--log",
        "good.log",
        "--controller",
        "linuxcnc",
        "--out",
        "study.toml",
    ];
    expect(&job.call(&new), 0, &[]);
    let export = [
        "export",
        "study.toml",
        "--controller",
        "sinumerik",
        "--out",
        "comp",
        "--accept-unverified",
        "--force",
        "--backup",
        "bk.ini",
        "--json",
    ];
    for value in ["1e308", "1e6", "-5000"] {
        job.write("bk.ini", format!("CHANDATA(1)\n$TC_CARR5[1]={value}\n$TC_CARR15[1]=0\nM17\n"));
        let out = job.call(&export);
        assert_eq!(out.status.code(), Some(2), "{value}: {}", said(&out));
        assert!(!job.path("comp").exists());
    }
}
