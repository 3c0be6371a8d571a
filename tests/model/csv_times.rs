//! Times of a CSV: on a clock of its own with `started`, else on the study's.

use crate::common::verbs::{json, ok};
use crate::common::{machine, plan};

/// Two runs 8000 s apart; in each the machine drifts anew by 20 µm/h. On one clock that is hardly a steady drift, and with both runs in
/// the same hours it is one.
#[test]
fn started_places_a_csv_whose_times_begin_anew() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let file = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
    file("plan.json", &plan(&machine("swivel-head"), "head").to_json());
    for (run, started_s) in [(1, 0.0), (2, 8000.0)] {
        let scenario = format!(
            "seed = {run}\n[time]\nstarted_s = {started_s:?}\n[effects.drift-linear]\nvz = 20.0\n[noise]\ntouch_um = 1.0\n"
        );
        file("s.toml", &scenario);
        let out = format!("{run}.csv");
        let call = ["simulate", "--plan", "plan.json", "--machine", "swivel-head", "--scenario", "s.toml"];
        ok(folder, &[&call[..], &["--controller", "csv", "--out", &out]].concat());
    }
    // the same run on a clock that began with it
    let text = std::fs::read_to_string(folder.join("2.csv")).unwrap();
    let column = text.lines().next().unwrap().split(',').position(|name| name == "time_s").unwrap();
    let anew = |line: &str| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if let Ok(time_s) = cells[column].parse::<f64>() {
            cells[column] = format!("{:.2}", time_s - 8000.0);
        }
        cells.join(",") + "\n"
    };
    file("2-anew.csv", &text.lines().map(anew).collect::<String>());
    let mut drifts = Vec::new();
    for (second, started) in [("2.csv", false), ("2.csv", true), ("2-anew.csv", true), ("2-anew.csv", false)] {
        let data = |log: &str, started_s: f64| {
            let started = if started { format!("started = {started_s:?}\n") } else { String::new() };
            format!(
                "[[data]]\nplan = \"plan.json\"\nlog = \"{log}\"\ncontroller = \"csv\"\nmounting = \"one\"\n{started}"
            )
        };
        let effects = "[\"location-b\", \"block-setup\", \"pretravel\", \"drift-linear\"]";
        let runs = data("1.csv", 0.0) + &data(second, 8000.0);
        file("study.toml", &format!("machine = \"swivel-head\"\n{runs}[model]\neffects = {effects}\n"));
        let (answer, _) = json(folder, &["identify", "study.toml"]);
        let all = answer["parameters"].as_array().unwrap();
        drifts.push(all.iter().find(|p| p["name"] == "vz").unwrap()["value"].as_f64().unwrap());
    }
    assert!(drifts[..3].iter().all(|drift| (drift - drifts[0]).abs() < 1e-6 && drift.abs() < 2.0), "{drifts:?}");
    assert!((drifts[3] - 20.0).abs() < 4.0, "{drifts:?}");
}
