//! A pair that the paper's plan cannot tell apart, the program that parts it, its log in the study, and the answer.

use assert_cmd::Command;
use std::path::Path;

fn axiscal(dir: &Path, args: &[&str]) -> std::process::Output {
    Command::cargo_bin("axiscal").unwrap().current_dir(dir).args(args).output().unwrap()
}

fn ok(dir: &Path, args: &[&str]) -> String {
    let out = axiscal(dir, args);
    assert!(out.status.success(), "{args:?}: {}", String::from_utf8_lossy(&out.stderr));
    String::from_utf8(out.stdout).unwrap()
}

fn json(dir: &Path, args: &[&str]) -> serde_json::Value {
    serde_json::from_str(&ok(dir, args)).unwrap()
}

/// The paper's two runs of a machine with hidden errors, and their study.
fn study(dir: &Path, hidden: &str) {
    let scenario = format!("seed = 5\n{hidden}\n[noise]\ntouch_um = 1.0\n");
    std::fs::write(dir.join("hidden.toml"), scenario).unwrap();
    for p in ["head", "table"] {
        ok(dir, &["generate", "--machine", "swivel-head", "--program", p, "--controller", "linuxcnc", "--out", "."]);
        simulate(dir, p);
    }
    ok(
        dir,
        &[
            "new",
            "--machine",
            "swivel-head",
            "--plan",
            "head.plan.json",
            "--log",
            "head.log",
            "--plan",
            "table.plan.json",
            "--log",
            "table.log",
        ],
    );
}

fn simulate(dir: &Path, name: &str) {
    let (plan, log) = (format!("{name}.plan.json"), format!("{name}.log"));
    ok(
        dir,
        &[
            "simulate",
            "--plan",
            &plan,
            "--machine",
            "swivel-head",
            "--scenario",
            "hidden.toml",
            "--controller",
            "linuxcnc",
            "--out",
            &log,
        ],
    );
}

fn separation(answer: &serde_json::Value, key: &str) -> f64 {
    answer["pairs"][0][key].as_f64().unwrap()
}

#[test]
fn a_hidden_pair_is_told_apart() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    // counter to C: the part that turns with it is an offset of the block and could not be seen
    study(dir, "[effects.radial-c-1]\nEXC1c = 5.0\nEYC1s = -5.0");
    let text = std::fs::read_to_string(dir.join("study.toml")).unwrap();
    std::fs::write(dir.join("study.toml"), format!("# a comment of mine\n{text}")).unwrap();
    let next = ["plan-next", "study.toml", "--out", ".", "--controller", "linuxcnc"];
    let asked = ["--effects", "radial-c-1,radial-c-3", "--minutes", "10", "--json"];
    let before = json(dir, &[&next[..], &asked[..]].concat());
    // four positions of C alias once per turn with three times
    assert!(separation(&before, "before") < 0.1, "{before}");
    assert!(separation(&before, "after") > 25.0, "{before}");
    assert!(before["time_s"].as_f64().unwrap() <= 1.02 * 600.0, "{before}");
    // the program is an ordinary one: the virtual machine runs it, its log joins the study
    simulate(dir, "next-3");
    ok(dir, &[&next[..], &["--join", "next-3.log"]].concat());
    let text = std::fs::read_to_string(dir.join("study.toml")).unwrap();
    assert!(text.contains("# a comment of mine") && text.matches("[[data]]").count() == 3, "{text}");
    let after = json(dir, &[&next[..], &asked[..]].concat());
    let (told, promised) = (separation(&after, "before"), separation(&before, "after"));
    assert!(told > 25.0 && (0.5..2.0).contains(&(told / promised)), "{told} against {promised}");
    // the block stood still: it has one set-up in both runs, six unknowns and not twelve
    let fit = json(dir, &["identify", "study.toml", "--json"]);
    let names: Vec<&str> = fit["parameters"].as_array().unwrap().iter().map(|p| p["name"].as_str().unwrap()).collect();
    assert_eq!(names.iter().filter(|n| n.starts_with("SX@")).count(), 5, "{names:?}");
    // and the right one of the pair fits, the wrong one does not
    let chi2 = |effect: &str| {
        let with = text.replace("\"pretravel\"]", &format!("\"pretravel\", \"{effect}\"]"));
        std::fs::write(dir.join("with.toml"), with).unwrap();
        let fit = json(dir, &["identify", "with.toml", "--json"]);
        fit["chi2_per_dof"].as_f64().unwrap() * fit["dof"].as_f64().unwrap()
    };
    let (right, wrong) = (chi2("radial-c-1"), chi2("radial-c-3"));
    assert!(wrong - right > 9.0, "chi2 {right} and {wrong}");
}

#[test]
fn moved_blocks_get_a_set_up_of_their_own() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    study(dir, "[effects.tip-eccentricity]\nex = 6.0");
    let next = ["plan-next", "study.toml", "--out", ".", "--controller", "linuxcnc", "--moved"];
    let answer = json(dir, &[&next[..], &["--effects", "tip-eccentricity", "--json"]].concat());
    assert!(answer["mounting"].is_null() && separation(&answer, "after") > 25.0, "{answer}");
    simulate(dir, "next-3");
    // the plan remembers what it was made for: nobody has to say it again
    let join = &next[..next.len() - 1];
    let out = axiscal(dir, &[join, &["--join", "next-3.log"]].concat());
    let said = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success() && said.contains("mounted again"), "{said}");
    let text = std::fs::read_to_string(dir.join("study.toml")).unwrap();
    assert!(!text.contains("mounting"), "{text}");
}

#[test]
fn what_cannot_be_asked_is_said() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    study(dir, "");
    let out =
        axiscal(dir, &["plan-next", "study.toml", "--out", ".", "--controller", "linuxcnc", "--effects", "no-such"]);
    assert_eq!(out.status.code(), Some(2));
    let out = axiscal(dir, &["plan-next", "study.toml", "--out", ".", "--controller", "linuxcnc", "--minutes", "0"]);
    assert_eq!(out.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&out.stderr).contains("--minutes"));
    // nothing is hidden: the pairs that the plan confounds are asked for
    let answer = json(dir, &["plan-next", "study.toml", "--out", ".", "--controller", "linuxcnc", "--json"]);
    assert!(answer["pairs"].as_array().is_some_and(|p| !p.is_empty()), "{answer}");
}

/// What `plan-next` promises of a pair with the leader is what `diagnose` does with the log of its program.
#[test]
fn what_is_promised_is_what_diagnose_then_does() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    study(dir, "[effects.radial-c-1]\nEXC1c = 6.0\nEYC1s = -6.0");
    let diagnosis = |dir: &Path| -> serde_json::Value {
        let out = axiscal(dir, &["diagnose", "study.toml", "--json"]);
        serde_json::from_slice(&out.stdout).unwrap()
    };
    let group = |d: &serde_json::Value| -> Vec<String> {
        let first = &d["candidates"][0];
        let same = first["same_as"].as_array().unwrap().iter().map(|s| s.as_str().unwrap().to_owned());
        std::iter::once(first["effect"].as_str().unwrap().to_owned()).chain(same).collect()
    };
    let before = diagnosis(dir);
    let open = group(&before);
    assert!(open.len() > 1 && open.iter().any(|e| e == "radial-c-1"), "{open:?}");
    let next = ["plan-next", "study.toml", "--out", ".", "--controller", "linuxcnc"];
    let promise = json(dir, &[&next[..], &["--minutes", "12", "--json"]].concat());
    let pairs: Vec<(String, String, f64)> = promise["pairs"]
        .as_array()
        .unwrap()
        .iter()
        .map(|p| {
            let word = |k: &str| p[k].as_str().unwrap().to_owned();
            (word("one"), word("other"), p["told"].as_f64().unwrap())
        })
        .collect();
    // waves of one and of three periods are the same at these positions, so that rounding decides which leads. No touches exclude an
    // effect that includes the leader: only where it does not is it asked about
    let includes_leader = |e: &str| e == "encoder-eccentricity-c" && open[0] == "radial-c-1";
    // every pair of the group is asked for, not the leader's alone
    let n = open.len();
    let asked = |a: &str, b: &str| pairs.iter().any(|(x, y, _)| (x == a && y == b) || (x == b && y == a));
    for (i, a) in open.iter().enumerate() {
        for b in &open[i + 1..] {
            let expected = !includes_leader(a) && !includes_leader(b);
            assert_eq!(asked(a, b), expected, "{a} and {b} of {n}, {} leads: {pairs:?}", open[0]);
        }
    }
    let promised: Vec<&str> = pairs
        .iter()
        .filter(|p| p.2 >= 0.95 && (p.0 == "radial-c-1" || p.1 == "radial-c-1"))
        .map(|p| if p.0 == "radial-c-1" { p.1.as_str() } else { p.0.as_str() })
        .collect();
    assert!(!promised.is_empty(), "{pairs:?}");
    simulate(dir, "next-3");
    ok(dir, &[&next[..], &["--join", "next-3.log"]].concat());
    let after = diagnosis(dir);
    let left = group(&after);
    assert!(left.iter().any(|e| e == "radial-c-1"), "{left:?}");
    for rival in &promised {
        assert!(!left.iter().any(|e| e == rival), "{rival} was to be told apart and was not: {left:?} of {promised:?}");
    }
}

/// A formula of the user's own that has a value at every touch of the study and none at B = 0: the program does not go there, and
/// a warning says so; without it the effect would count as one that leaves no trace.
#[test]
fn poses_at_which_an_effect_has_no_value_are_left_out_and_said() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    study(dir, "");
    let own = "[[effect]]\nid = \"mine\"\nname = \"Mine\"\nat = \"reading\"\nterms = [{ parameter = \"mine\", unit = \"um\", \
               dof = \"X\", formula = \"0 - sX/2 + 0*sqrt(-B)\" }]\n";
    std::fs::write(dir.join("own.toml"), own).unwrap();
    let text = std::fs::read_to_string(dir.join("study.toml")).unwrap();
    std::fs::write(dir.join("study.toml"), format!("effects_file = [\"own.toml\"]\n{text}")).unwrap();
    let asked = ["--effects", "mine,backlash-y", "--minutes", "10", "--moved", "--json"];
    let out =
        axiscal(dir, &[&["plan-next", "study.toml", "--out", ".", "--controller", "linuxcnc"][..], &asked].concat());
    let said = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success(), "{said}\n{}", String::from_utf8_lossy(&out.stdout));
    // the paper's programs tilt the head to one side only
    assert!(said.contains("has no value at") && said.contains("the program does not go there"), "{said}");
    let answer: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    assert!(separation(&answer, "after") > separation(&answer, "before"), "{answer}");
    let plan: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(dir.join("next-3.plan.json")).unwrap()).unwrap();
    for touch in plan["touches"].as_array().unwrap() {
        assert!(touch["pose"]["B"].as_f64().unwrap() <= 0.0, "{touch}");
    }
}

/// What an earlier step added is asked about too, and not only what the last one did.
#[test]
fn groups_of_earlier_steps_are_asked_too() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    study(dir, "[effects.backlash-y]\nbacklash_Y = 6.0\n[effects.scale-z]\nEZZ = 80.0");
    let next = ["plan-next", "study.toml", "--out", ".", "--controller", "linuxcnc", "--json"];
    let asks = |answer: &serde_json::Value, id: &str| {
        let of = |pair: &serde_json::Value| pair["one"] == id || pair["other"] == id;
        answer["pairs"].as_array().unwrap().iter().any(of)
    };
    ok(dir, &["add", "study.toml", "backlash-y"]);
    ok(dir, &["add", "study.toml", "scale-z"]);
    let both = json(dir, &next);
    assert!(asks(&both, "backlash-x") && asks(&both, "scale-z"), "{both}");
    let groups =
        |answer: &serde_json::Value| answer["says"].as_str().unwrap().matches(" explains the remaining error").count();
    assert_eq!(groups(&both), 2, "{both}");
    // while an effect is missing, that is the question
    ok(dir, &["remove", "study.toml", "scale-z"]);
    let one = json(dir, &["plan-next", "study.toml", "--out", "again", "--controller", "linuxcnc", "--json"]);
    assert_eq!(groups(&one), 1, "{one}");
}
