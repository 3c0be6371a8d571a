//! The spindle ran for a part of the time only: the study says when, and the growth is found; without it, it is not.

use crate::common::{machine, plan};
use assert_cmd::Command;
use serde_json::Value;

const STRETCHES: &str = "[[0, 900, 12000], [2700, 3600, 6000]]";

fn axiscal(folder: &std::path::Path, arguments: &[&str]) -> Value {
    let mut command = Command::cargo_bin("axiscal").unwrap();
    let output = command.current_dir(folder).args(arguments).output().unwrap();
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap_or_default()
}

fn study(spindle: &str) -> String {
    format!(
        "machine = \"swivel-head\"\n[[data]]\nplan = \"plan.json\"\nlog = \"log.csv\"\ncontroller = \"csv\"\n{spindle}\n[model]\n\
         effects = [\"location-b\", \"location-c\", \"block-setup\", \"pretravel\", \"spindle-growth\"]\n"
    )
}

#[test]
fn growth_is_found_where_the_study_says_when_the_spindle_ran() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let file = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
    file("plan.json", &plan(&machine("swivel-head"), "full").to_json());
    file(
        "s.toml",
        &format!(
            "seed = 5\nspindle = {STRETCHES}\n[effects.spindle-growth]\nspindle_growth = 24.0\nspindle_tau = 0.3\n[noise]\ntouch_um = 0.5\n"
        ),
    );
    let call =
        ["simulate", "--plan", "plan.json", "--machine", "swivel-head", "--scenario", "s.toml", "--controller", "csv"];
    axiscal(folder, &[&call[..], &["--out", "log.csv"]].concat());
    let fitted = |spindle: &str| {
        file("study.toml", &study(spindle));
        let answer = axiscal(folder, &["identify", "study.toml", "--json"]);
        let of = |name: &str| {
            let all = answer["parameters"].as_array().unwrap();
            all.iter().find(|p| p["name"] == name).unwrap()["value"].as_f64().unwrap()
        };
        (answer["rms_um"].as_f64().unwrap(), of("spindle_growth"), of("spindle_tau"))
    };
    let (rms, growth, tau) = fitted(&format!("spindle = {STRETCHES}"));
    assert!(rms < 0.6 && (growth - 24.0).abs() < 1.0 && (tau - 0.3).abs() < 0.03, "{rms} {growth} {tau}");
    // as if it had run all the time
    let (rms, ..) = fitted("");
    assert!(rms > 1.0, "{rms}");
    // what is no stretch has its place
    for wrong in ["spindle = [[900, 0, 12000]]", "spindle = [[0, 900, 0]]", "spindle = [[0, 900, 1], [800, 1000, 1]]"] {
        file("study.toml", &study(wrong));
        let output = Command::cargo_bin("axiscal")
            .unwrap()
            .current_dir(folder)
            .args(["identify", "study.toml"])
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(
            output.status.code() == Some(2) && said.contains("study.toml:6:") && said.contains("spindle"),
            "{wrong}: {said}"
        );
    }
}
