//! `report` from outside: one page that holds everything and fetches nothing, whatever stands in the user's files; the plots
//! without a browser; the tolerance.

use assert_cmd::Command;
use predicates::prelude::*;
use std::path::Path;

fn axiscal(folder: &Path) -> Command {
    let mut command = Command::cargo_bin("axiscal").unwrap();
    command.current_dir(folder).env("NO_COLOR", "1").env_remove("COLUMNS");
    command
}

/// A machine whose turntable wanders once per turn, and does not stand where it should.
const HIDDEN: &str = "seed = 20\n[effects.location-c]\nEX0C = -0.017\n[effects.radial-c-1]\nEXC1c = 3.0\nEXC1s = 0.0\nEYC1c = 0.0\nEYC1s = -3.0\n[noise]\ntouch_um = 0.5\nvisit_um = 0.2\n";

const EVIL: &str = "</script><script>document.title='broken'</script><!-- <b>";

fn folder(program: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("s.toml"), HIDDEN).unwrap();
    let common = ["--machine", "swivel-head", "--controller", "linuxcnc", "--out"];
    let plan = format!("{program}.plan.json");
    axiscal(folder.path()).args(["generate", "--program", program]).args(common).arg(".").assert().success();
    let simulate = ["simulate", "--plan", &plan, "--scenario", "s.toml"];
    axiscal(folder.path()).args(simulate).args(common).arg("run.log").assert().success();
    axiscal(folder.path())
        .args(["new", "--plan", &plan, "--log", "run.log"])
        .args(common)
        .arg("study.toml")
        .assert()
        .success();
    folder
}

/// The data inside a page.
fn data(page: &str) -> serde_json::Value {
    let from = page.split_once(r#"<script type="application/json" id="view">"#).unwrap().1;
    serde_json::from_str(from.split_once("</script>").unwrap().0).unwrap()
}

#[test]
fn one_page_holds_everything_and_fetches_nothing() {
    let folder = folder("full");
    // a user's effect whose words would end the script, in the model and so on the page
    let own = format!(
        "[[effect]]\nid = \"mine\"\nname = \"{EVIL}\"\nsays = \"{EVIL}\"\nlook = \"{EVIL}\"\nat = \"B\"\nterms = [{{ parameter = \"mine\", unit = \"um\", dof = \"dz\", formula = \"1 - cos(B)\" }}]\n"
    );
    std::fs::write(folder.path().join("own.toml"), own).unwrap();
    let study = std::fs::read_to_string(folder.path().join("study.toml")).unwrap();
    let study = study
        .replacen("[[data]]", "effects_file = [\"own.toml\"]\n\n[[data]]", 1)
        .replace("\"block-setup\"", "\"block-setup\", \"mine\"");
    std::fs::write(folder.path().join("study.toml"), study + "\n[tolerance]\nerror_um = 4\n").unwrap();
    let run = axiscal(folder.path())
        .args(["report", "study.toml", "--out", "r.html", "--plots", "plots", "--view", "view.json", "--json"])
        .output()
        .unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let answer: serde_json::Value = serde_json::from_slice(&run.stdout).unwrap();

    let page = std::fs::read_to_string(folder.path().join("r.html")).unwrap();
    assert_eq!(answer["bytes"], page.len());
    assert!(page.len() < 6_000_000, "{}", page.len());
    assert_eq!(page.matches("</script").count(), 5, "something has ended a script");
    assert!(!page.contains("document.title='broken'</script>"));
    for asks in ["src=\"", "<link rel=\"stylesheet", "@import", "<iframe", "<img", "<form"] {
        assert!(!page.split("<script type=").next().unwrap().contains(asks), "{asks}");
    }
    let view = data(&page);
    let beside: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(folder.path().join("view.json")).unwrap()).unwrap();
    assert_eq!(view, beside);
    assert_eq!(view["format"], "axiscal-view/1");
    assert!(view["diagnosis"]["effects"]["mine"]["name"] == EVIL, "{}", view["diagnosis"]["effects"]);
    the_view_says_what_the_verbs_say(folder.path(), &view);
    every_plot_has_its_files(folder.path(), &answer, &view);
}

fn the_view_says_what_the_verbs_say(folder: &Path, view: &serde_json::Value) {
    let ask = |verb: &str| -> serde_json::Value {
        serde_json::from_slice(&axiscal(folder).args([verb, "study.toml", "--json"]).output().unwrap().stdout).unwrap()
    };
    let (compared, diagnosed) = (ask("compare"), ask("diagnose"));
    assert_eq!(view["diagnosis"]["verdict"], diagnosed["verdict"]);
    assert_eq!(view["diagnosis"]["verdict"], "missing-effect");
    assert_eq!(view["diagnosis"]["candidates"][0]["effect"], "radial-c-1");
    assert_eq!(view["headline"]["level"], "act");
    let ladder = view["ladder"].as_array().unwrap();
    let kinds: Vec<&str> = ladder.iter().map(|r| r["kind"].as_str().unwrap()).collect();
    assert_eq!(kinds, ["uncorrected", "current", "proposed"]);
    let rms = |i: usize| ladder[i]["rms_um"].as_f64().unwrap();
    assert!((rms(1) - compared["rms_um"].as_f64().unwrap()).abs() < 1e-9);
    assert!(rms(0) > rms(1) && rms(1) > 1.5 * rms(2), "{} {} {}", rms(0), rms(1), rms(2));
    // the residuals of the touches are those of compare, and their RMS that of the ladder
    let (t, points) = (&view["touches"], compared["points"].as_array().unwrap());
    assert_eq!(t["n"], points.len());
    let (mut sum, mut used) = (0.0, 0);
    for (i, p) in points.iter().enumerate() {
        let r = t["residual_um"][1][i].as_f64().unwrap();
        assert!((r - p["residual_um"].as_f64().unwrap()).abs() < 1e-3);
        assert_eq!((&t["id"][i], &t["line"][i]), (&p["id"], &p["line"]));
        assert_eq!(t["rejected"][i].is_null(), p["used"].as_bool().unwrap());
        if p["used"] == true {
            sum += r * r;
            used += 1;
        }
    }
    assert!(used > 700 && ((sum / f64::from(used)).sqrt() - rms(1)).abs() < 1e-3);
    // the curve of what is proposed against C is a wave once per turn of about the planted size
    let curve = view["curves"]
        .as_array()
        .unwrap()
        .iter()
        .find(|c| c["variable"] == "C" && c["direction"] == "X" && c["from"] == 1 && c["to"] == 2);
    let y: Vec<f64> = curve.unwrap()["y_um"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
    assert!(y.iter().any(|v| *v > 0.5) && y.iter().any(|v| *v < -0.5), "{y:?}");
    // the tolerance of the study, as millimetres and as an angle at 100 mm
    let of = |name: &str| view["parameters"].as_array().unwrap().iter().find(|p| p["name"] == name).unwrap();
    assert!((of("EX0C")["tolerance"].as_f64().unwrap() - 0.004).abs() < 1e-12);
    assert!((of("EA0C")["tolerance"].as_f64().unwrap() - (0.004f64 / 100.0).to_degrees()).abs() < 1e-12);
    assert_eq!(of("EX0C")["judgement"], "beyond");
}

fn every_plot_has_its_files(folder: &Path, answer: &serde_json::Value, view: &serde_json::Value) {
    let names: Vec<&str> = answer["plots"].as_array().unwrap().iter().map(|p| p.as_str().unwrap()).collect();
    // error, results, ladder, machine, candidates, correlation, and one for each variable
    assert_eq!(names.len(), 3 * (6 + view["variables"].as_array().unwrap().len()));
    for name in names {
        let bytes = std::fs::read(folder.join(name)).unwrap();
        if name.ends_with(".png") {
            assert!(bytes.starts_with(b"\x89PNG\r\n"), "{name}");
            // black on white: letters and lines are there
            assert!(bytes.len() > 8000, "{name}: {}", bytes.len());
        } else {
            let text = String::from_utf8(bytes).unwrap();
            assert!(name.ends_with(".csv") && text.lines().count() > 1 || text.starts_with("<svg"), "{name}");
            assert!(name.ends_with(".csv") || !text.contains("<script"), "{name}");
        }
    }
    let csv = std::fs::read_to_string(folder.join("plots/residual-c.csv")).unwrap();
    assert!(csv.starts_with("series,\"angle of axis C, deg\",\"residual, µm\",note\n"), "{}", &csv[..80]);
    assert!(csv.contains("run.log:"), "the source line of a touch is behind each point");
}

#[test]
fn rubbish_is_refused_with_a_place() {
    let folder = folder("head");
    let study = std::fs::read_to_string(folder.path().join("study.toml")).unwrap();
    std::fs::write(folder.path().join("bad.toml"), format!("{study}\n[tolerance]\nerror_um = -1\n")).unwrap();
    axiscal(folder.path())
        .args(["report", "bad.toml", "--out", "bad.html"])
        .assert()
        .code(2)
        .stderr(predicate::str::contains("error_um of the tolerance is no usable number"));
    assert!(!folder.path().join("bad.html").exists());
    axiscal(folder.path()).args(["report", "none.toml"]).assert().code(2);
    // a folder that is a file, and a page that is a folder
    std::fs::write(folder.path().join("file"), "x").unwrap();
    axiscal(folder.path()).args(["report", "study.toml", "--out", "file/r.html"]).assert().code(2);
    std::fs::write(folder.path().join("study.history.json"), "{ not json").unwrap();
    axiscal(folder.path())
        .args(["report", "study.toml", "--out", "r.html"])
        .assert()
        .code(2)
        .stderr(predicate::str::contains("study.history.json"));
}
