//! A fit that did not converge is an answer "no", exit code 1, in every verb that shows a fit.

use crate::common;

use common::verbs;
use std::path::Path;

/// The exit code, what is said on stderr, and whether there is an answer on stdout all the same.
fn call(folder: &Path, args: &[&str]) -> (i32, String, bool) {
    let out = verbs::axiscal(folder, &[args, &["--json"]].concat());
    let answered =
        serde_json::from_slice::<serde_json::Value>(&out.stdout).is_ok_and(|v| v["format"] != "axiscal-failure/1");
    (out.status.code().unwrap(), String::from_utf8(out.stderr).unwrap(), answered)
}

#[test]
fn every_verb_that_shows_a_fit_says_that_it_did_not_converge() {
    let folder = verbs::folder(&["table"], "[noise]\ntouch_um = 0.5\n", None);
    let at = folder.path();
    let study = std::fs::read_to_string(at.join("study.toml")).unwrap();
    let (head, _) = study.split_once("[model]").unwrap();
    // nothing that is touched depends on it
    std::fs::write(
        at.join("own.toml"),
        "format = \"axiscal-effects/1\"\n[[effect]]\nid = \"far-away\"\nname = \"far away\"\nsays = \"acts where no touch is\"\n\
         look = \"nowhere\"\nat = \"tool\"\nterms = [{ parameter = \"p\", unit = \"um\", dof = \"dz\", formula = \"step(X - 100000)\" }]\n",
    )
    .unwrap();
    let with = |effects: &str| format!("effects_file = [\"own.toml\"]\n{head}[model]\neffects = {effects}\n");
    std::fs::write(at.join("good.toml"), with("[\"location-b\", \"location-c\", \"block-setup\", \"pretravel\"]"))
        .unwrap();
    std::fs::write(at.join("bad.toml"), with("[\"far-away\"]")).unwrap();
    assert_eq!(verbs::json(at, &["identify", "good.toml"]).1, 0);
    let (fit, _) = verbs::json(at, &["identify", "bad.toml"]);
    assert_eq!(fit["converged"], false, "{fit}");
    for verb in [
        &["identify", "bad.toml"][..],
        &["identify", "bad.toml", "--quick"],
        &["compare", "bad.toml"],
        &["diagnose", "bad.toml"],
        &["report", "bad.toml", "--out", "r.html"],
        &["solve", "bad.toml", "--yes", "--at-most", "1"],
    ] {
        let (code, said, answered) = call(at, verb);
        assert_eq!((code, answered), (1, true), "{verb:?}: {said}");
        assert!(said.contains("the fit did not converge"), "{verb:?}: {said}");
    }
    let (code, said, answered) = call(at, &["export", "bad.toml", "--controller", "linuxcnc", "--out", "comp"]);
    assert_eq!((code, answered), (2, false), "{said}");
}
