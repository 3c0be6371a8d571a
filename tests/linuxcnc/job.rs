//! The binary and the rig: a job is a folder with one machine, its programs, logs and studies.

use super::Check;
use serde_json::Value;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

/// How LinuxCNC is set up.
#[derive(Clone)]
pub struct Control {
    pub latch: &'static str,
    pub kins: Option<&'static str>,
    pub kins_c: Option<PathBuf>,
    pub hal: Vec<PathBuf>,
    pub ini: Option<PathBuf>,
}

impl Control {
    pub fn plain() -> Self {
        Self { latch: "edge", kins: None, kins_c: None, hal: Vec::new(), ini: None }
    }
}

/// What a study holds.
pub struct Study<'a> {
    pub programs: &'a [&'a str],
    pub logs: &'a [&'a str],
    pub effects: &'a [&'a str],
    /// Parameters that are held at 0.
    pub zero: &'a [&'a str],
    pub noise_um: f64,
    /// The compensation that was active.
    pub active: Option<&'a str>,
    /// A machines file beside the study.
    pub machines: Option<&'a str>,
}

impl<'a> Study<'a> {
    pub fn new(programs: &'a [&'a str], logs: &'a [&'a str], effects: &'a [&'a str], noise_um: f64) -> Self {
        Self { programs, logs, effects, zero: &[], noise_um, active: None, machines: None }
    }

    pub fn text(&self, machine: &str) -> String {
        let mut text = format!("machine = \"{machine}\"\n");
        if let Some(machines) = self.machines {
            let _ = writeln!(text, "machines = \"{machines}\"");
        }
        for (program, log) in self.programs.iter().zip(self.logs) {
            let _ = writeln!(
                text,
                "[[data]]\nplan = \"{program}.plan.json\"\nlog = \"{log}.log\"\ncontroller = \"linuxcnc\""
            );
            if let Some(active) = self.active {
                let _ = writeln!(text, "compensation = \"{active}\"");
            }
        }
        let _ = writeln!(text, "[model]\neffects = {:?}", self.effects);
        for name in self.zero {
            let _ = writeln!(text, "[model.parameters.{name}]\nvalue = 0.0\nfixed = true");
        }
        let _ = writeln!(text, "[noise]\ntouch_um = {}", self.noise_um);
        // the axes of the virtual probe's machine come back exactly, and without revisits the program would take the declared scatter
        if self.programs != ["full"] {
            text += "visit_um = 0.0\n";
        }
        text
    }
}

pub struct Job {
    pub dir: PathBuf,
    pub machine: String,
    /// The machines file, where it is not the built-in one.
    pub machines: Option<PathBuf>,
}

impl Job {
    pub fn new(machine: &str) -> Result<Self, String> {
        let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("linuxcnc-{machine}-{}", unique()));
        std::fs::create_dir_all(&dir).map_err(|e| e.to_string())?;
        Ok(Self { dir, machine: machine.into(), machines: None })
    }

    /// Calls the binary in the job's folder; exit code 0 is expected.
    pub fn call(&self, args: &[&str]) -> Result<String, String> {
        let out = Command::new(env!("CARGO_BIN_EXE_axiscal"))
            .args(args)
            .current_dir(&self.dir)
            .output()
            .map_err(|e| e.to_string())?;
        if !out.status.success() {
            return Err(format!(
                "axiscal {}\n{}{}",
                args.join(" "),
                String::from_utf8_lossy(&out.stdout),
                String::from_utf8_lossy(&out.stderr)
            ));
        }
        Ok(String::from_utf8_lossy(&out.stdout).into_owned())
    }

    /// The answer, whether it is yes or no.
    pub fn json_whatever(&self, args: &[&str]) -> Result<Value, String> {
        let out = Command::new(env!("CARGO_BIN_EXE_axiscal"))
            .args(args)
            .arg("--json")
            .current_dir(&self.dir)
            .output()
            .map_err(|e| e.to_string())?;
        serde_json::from_slice(&out.stdout).map_err(|e| format!("{e}: {}", String::from_utf8_lossy(&out.stderr)))
    }

    pub fn json(&self, args: &[&str]) -> Result<Value, String> {
        let text = self.call(&[args, &["--json"]].concat())?;
        serde_json::from_str(&text).map_err(|e| format!("{e}: {text}"))
    }

    pub fn generate(&self, program: &str, more: &[&str]) -> Check {
        let args =
            ["generate", "--machine", &self.machine, "--program", program, "--controller", "linuxcnc", "--out", "."];
        self.call(&[&args[..], more].concat()).map(|_| ())
    }

    pub fn write(&self, name: &str, text: &str) -> Check {
        std::fs::write(self.dir.join(name), text).map_err(|e| format!("{name}: {e}"))
    }

    pub fn scenario(
        &self,
        effects: &[(&str, &[(&str, f64)])],
        blocks: &[(&str, &str, [f64; 3], [f64; 3])],
        noise_um: f64,
        seed: u64,
    ) -> Check {
        let mut text = format!("seed = {seed}\n");
        for (effect, values) in effects {
            let _ = writeln!(text, "[effects.{effect}]");
            values.iter().for_each(|(name, value)| {
                let _ = writeln!(text, "{name} = {value:?}");
            });
        }
        for (mounting, name, shift, tilt) in blocks {
            let _ = writeln!(
                text,
                "[[block]]\nmounting = \"{mounting}\"\nname = \"{name}\"\nshift = {shift:?}\ntilt = {tilt:?}"
            );
        }
        let _ = writeln!(text, "[noise]\ntouch_um = {noise_um}");
        self.write("wrong.toml", &text)
    }

    /// Runs a program on LinuxCNC; `log` is the name that its log gets.
    ///
    /// Should LinuxCNC itself lose its race after a probing move ("Queue is not empty after probing", see
    /// `linuxcnc/taskshim.c`), that is no verdict on the program: the run is made again, nearer to real time.
    pub fn run(&self, program: &str, log: &str, control: &Control) -> Check {
        let warp: u32 = std::env::var("AXISCAL_WARP").ok().and_then(|w| w.parse().ok()).unwrap_or(40);
        let mut last = String::new();
        for warp in [warp, warp.div_ceil(2), warp.div_ceil(4)] {
            match self.run_at(program, log, control, warp) {
                Err(why) if why.contains("Queue is not empty after probing") => {
                    println!("  {log}: LinuxCNC lost a race at {warp} times real time");
                    last = why;
                }
                other => return other,
            }
        }
        Err(last)
    }

    pub fn run_at(&self, program: &str, log: &str, control: &Control, warp: u32) -> Check {
        let tree = Path::new(env!("CARGO_MANIFEST_DIR"));
        let out = self.dir.join(format!("rig-{log}"));
        let mut rig = Command::new("/usr/bin/python3");
        rig.arg(tree.join("tests/linuxcnc/rig.py"))
            .arg("--machines")
            .arg(self.machines.clone().unwrap_or_else(|| tree.join("machines.toml")))
            .args(["--machine", &self.machine, "--latch", control.latch])
            .args(["--warp", &warp.to_string()])
            .args(["--plan".as_ref(), self.dir.join(format!("{program}.plan.json")).as_os_str()])
            .args(["--program".as_ref(), self.dir.join(format!("{program}.ngc")).as_os_str()])
            .args(["--scenario".as_ref(), self.dir.join("wrong.toml").as_os_str()])
            .args(["--out".as_ref(), out.as_os_str()]);
        if let Some(kins) = control.kins {
            rig.args(["--kins", kins]);
        }
        if let Some(source) = &control.kins_c {
            rig.args(["--kins-c".as_ref(), source.as_os_str()]);
        }
        for hal in &control.hal {
            rig.args(["--hal".as_ref(), hal.as_os_str()]);
        }
        if let Some(ini) = &control.ini {
            rig.args(["--ini-extra".as_ref(), ini.as_os_str()]);
        }
        let answer = rig.output().map_err(|e| e.to_string())?;
        let said = format!("{}{}", String::from_utf8_lossy(&answer.stdout), String::from_utf8_lossy(&answer.stderr));
        if !answer.status.success() {
            return Err(format!("rig: {program} as {log}: {said}"));
        }
        let text = std::fs::read_to_string(out.join("result.json")).map_err(|e| e.to_string())?;
        let result: Value = serde_json::from_str(&text).map_err(|e| e.to_string())?;
        self.unharmed(program, &result).map_err(|e| format!("{program} as {log}: {e}"))?;
        let written = out.join(format!("{program}.log"));
        std::fs::copy(&written, self.dir.join(format!("{log}.log")))
            .map_err(|e| format!("{}: {e}", written.display()))?;
        Ok(())
    }

    /// Nothing but the ball touched anything, not deeper than the probe allows, and the user's settings are as before.
    pub fn unharmed(&self, program: &str, result: &Value) -> Check {
        let plan: Value = serde_json::from_str(
            &std::fs::read_to_string(self.dir.join(format!("{program}.plan.json"))).map_err(|e| e.to_string())?,
        )
        .map_err(|e| e.to_string())?;
        let finds = plan["find"]["touches"].as_array().map_or(0, Vec::len);
        let n_touches = (plan["touches"].as_array().map_or(0, Vec::len) + finds) as u64;
        for (what, expected) in
            [("block_touches", 2 * n_touches), ("solid_touches", 0), ("stem_touches", 0), ("collisions", 0)]
        {
            if result[what].as_u64() != Some(expected) {
                return Err(format!("{what} is {}, expected {expected}", result[what]));
            }
        }
        let (deep, allowed) = (result["max_overtravel_mm"].as_f64(), result["overtravel_allowed_mm"].as_f64());
        if !matches!((deep, allowed), (Some(d), Some(a)) if d < a) {
            return Err(format!("overtravel {deep:?} of {allowed:?} mm"));
        }
        if result["g54_unchanged"] != true {
            return Err("the user's G54 was changed".into());
        }
        // the first word of G is the motion of the last block: no setting
        let modes = |v: &Value| v["gcodes"].as_array().map(|g| g[1..].to_vec());
        if modes(&result["before"]) != modes(&result["after"]) {
            return Err(format!("modal state {} became {}", result["before"]["gcodes"], result["after"]["gcodes"]));
        }
        Ok(())
    }

    /// A study and its fit.
    pub fn identify(&self, name: &str, study: &Study) -> Result<Value, String> {
        self.write(&format!("{name}.toml"), &study.text(&self.machine))?;
        let fit = self.json(&["identify", &format!("{name}.toml")])?;
        // a good touch beyond 4 standard deviations is rare, but hundreds are made
        if fit["converged"] != true || fit["rejected"].as_array().is_none_or(|r| r.len() > 1) {
            return Err(format!("{name}: converged {}, rejected {}", fit["converged"], fit["rejected"]));
        }
        Ok(fit)
    }

    /// RMS of the readings of an errorless model, um; `free` effects may explain what they can.
    pub fn left(
        &self,
        program: &str,
        log: &str,
        effects: &[&str],
        free: &[&str],
        noise_um: f64,
    ) -> Result<f64, String> {
        let catalogue = self.json(&["effects", "--machine", &self.machine])?;
        let rows = catalogue["effects"].as_array().ok_or("no effects")?;
        let of = |id: &str| rows.iter().find(|e| e["id"] == id).and_then(|e| e["parameters"].as_array().cloned());
        let names: Vec<String> = effects
            .iter()
            .filter_map(|id| of(id))
            .flatten()
            .filter_map(|p| p["name"].as_str().map(str::to_owned))
            .collect();
        let zero: Vec<&str> = names.iter().map(String::as_str).collect();
        let (programs, logs, all) = ([program], [log], [effects, free].concat());
        let study = Study { zero: &zero, ..Study::new(&programs, &logs, &all, noise_um) };
        let name = format!("{log}-left");
        self.write(&format!("{name}.toml"), &study.text(&self.machine))?;
        self.json(&["identify", &format!("{name}.toml")])?["rms_um"].as_f64().ok_or("no rms".into())
    }

    /// With the compensation loaded, an errorless model fits to the noise.
    pub fn only_noise(&self, program: &str, log: &str, effects: &[&str], noise_um: f64) -> Check {
        let rms = self.left(program, log, effects, &[], noise_um)?;
        println!("  {log}: {rms:.4} um left of a noise of {noise_um} um");
        // 154 touches and more: the RMS scatters by 6 % of itself
        if !((0.75 * noise_um)..(1.25 * noise_um)).contains(&rms) {
            return Err(format!("{program} as {log}: {rms:.4} um left, expected the noise of {noise_um} um"));
        }
        Ok(())
    }

    pub fn export(&self, study: &str, out: &str) -> Check {
        // the rig's own control: identity kinematics, no home offsets, no axis tables
        let letters = match self.machine.as_str() {
            "double-head" => "XYZAB",
            "trunnion" => "XYZAC",
            _ => "XYZBC",
        };
        let n = letters.len();
        let mut ini = format!(
            "[KINS]\nKINEMATICS = trivkins coordinates={letters}\nJOINTS = {n}\n[TRAJ]\nCOORDINATES = {letters}\nLINEAR_UNITS = mm\n"
        );
        for (joint, letter) in letters.chars().enumerate() {
            let kind = if "ABC".contains(letter) { "ANGULAR" } else { "LINEAR" };
            ini += &format!("[JOINT_{joint}]\nTYPE = {kind}\n");
        }
        let path = self.dir.join("rig.ini");
        std::fs::write(&path, ini).map_err(|e| e.to_string())?;
        let (study, path) = (format!("{study}.toml"), path.display().to_string());
        self.call(&["export", &study, "--controller", "linuxcnc", "--ini", &path, "--out", out]).map(|_| ())
    }

    /// LinuxCNC with an exported component and its values.
    pub fn component(&self, out: &str) -> Result<Control, String> {
        let dir = self.dir.join(out);
        let source = std::fs::read_dir(&dir)
            .map_err(|e| e.to_string())?
            .filter_map(|f| f.ok().map(|f| f.path()))
            .find(|p| p.extension().is_some_and(|e| e == "c"))
            .ok_or("the export holds no component")?;
        Ok(Control { kins_c: Some(source), hal: vec![dir.join("axiscal.hal")], ..Control::plain() })
    }
}

fn unique() -> String {
    use std::sync::atomic::{AtomicUsize, Ordering};
    static NEXT: AtomicUsize = AtomicUsize::new(0);
    format!("{}-{}", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed))
}
