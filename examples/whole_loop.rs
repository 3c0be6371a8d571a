//! The whole loop, without a machine and without a file on the disk: `cargo run --example whole_loop`.

use axiscal::prelude::*;
use std::path::Path;

fn main() -> Result<()> {
    run().map(drop)
}

/// RMS of the residuals with each model, µm.
pub fn run() -> Result<Vec<f64>> {
    let files = InMemory::default();
    let machine = load_machine("swivel-head", None, &files)?;
    let control = load_controller("linuxcnc", &files)?;

    // a probing program for the control
    let program = load_program("full", &machine, &files)?;
    let made = generate(&machine, &program, &control, &ProgramOptions::default(), &files)?;
    let plan = &made.generated.plan;
    println!("{} touches in {:.0} min", plan.touches.len(), made.seconds / 60.0);

    // the virtual machine runs it: B has two errors, and only the model of the first is in the study below
    let scenario = Scenario::flawless().with_noise(0.5e-3, 0.2e-3, 20);
    let scenario = scenario.with(&machine, "location-b", &[("EX0B", 0.021), ("EA0B", 0.0061)])?;
    let scenario = scenario.with(&machine, "zero-b", &[("EB0B", 0.004)])?;
    let (touches, _) = simulate(&machine, plan, &scenario, None)?;
    let log = simulated_log(&machine, plan, &touches, Some(&control));

    // a study of the log
    let effects = default_effects(&machine, &[plan], false);
    files.write(Path::new("full.plan.json"), Some(plan.to_json().as_bytes()))?;
    files.write(Path::new("full.log"), Some(log.as_bytes()))?;
    let (plan, log) = ("full.plan.json".into(), "full.log".into());
    let run = NewRun { plan, log, controller: "linuxcnc".to_owned(), compensation: None };
    let new = NewStudy { folder: Path::new(""), machines: None, effects: &effects, effects_files: &[], runs: &[run] };
    let study = Path::new("study.toml");
    files.write(study, Some(new.text(&machine, &files)?.as_bytes()))?;
    let mut loaded = load_study(study, &files)?;

    // fit, diagnose, add what is missing, fit again
    let mut rms_um = Vec::new();
    loop {
        let fit = loaded.fit(&loaded.settings())?;
        let found = loaded.diagnose(&loaded.settings(), &fit, &DiagnosisOptions::default())?;
        println!("{:.2} um RMS with {}: {}", fit.outcome.rms_um, fit.outcome.effects.join(", "), found.says);
        rms_um.push(fit.outcome.rms_um);
        let Some(missing) = found.candidates.first().filter(|c| c.proposed) else { break };
        let edit = [missing.effect.clone()];
        loaded = change_study(study, Edit::Add(&edit), None, false, &files)?.loaded;
    }

    // the compensation as the control's own tables
    let request = ExportRequest::new("linuxcnc");
    let form = request.form(&files)?;
    let exported = export(&loaded, &form, &request, &files)?;
    for (name, contents) in exported.files() {
        println!("{name}: {} bytes", contents.len());
    }
    Ok(rms_um)
}
