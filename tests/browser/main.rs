//! The report and the workbench in a real browser: this only finds out whether there is one, and runs `run.mjs`.
//!
//! Needs Chromium, Node and the packages of `package-lock.json` (`install.sh` brings all of them). Where they are missing
//! plain `cargo test` says so and leaves the tests out; with AXISCAL_BROWSER=required that is a failure. Screenshots and
//! times go to `target/browser/`; AXISCAL_PICTURES=1 writes those of the guide as well.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a panic in a test is a failure with its place

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};

fn there(program: &str) -> bool {
    let found = Command::new(program).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    found.is_ok_and(|s| s.success())
}

fn main() -> ExitCode {
    if std::env::args().any(|a| a == "--list") {
        println!("in_a_real_browser: test");
        return ExitCode::SUCCESS;
    }
    let filter: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let here = root.join("tests/browser");
    let chromium = std::env::var("AXISCAL_CHROMIUM").unwrap_or_else(|_| "chromium".into());
    let mut missing = Vec::new();
    if !there(&chromium) {
        missing.push("chromium");
    }
    if !there("node") {
        missing.push("node");
    }
    if ["playwright-core", "axe-core"].iter().any(|p| !here.join("node_modules").join(p).is_dir()) {
        missing.push("the packages of tests/browser/package-lock.json");
    }
    if !missing.is_empty() {
        println!("\nleft out: the tests in a real browser: {} missing;", missing.join(", "));
        println!("./run-tests installs what they need and runs them (or tests/browser/install.sh)\n");
        let required = std::env::var_os("AXISCAL_BROWSER").is_some();
        println!(
            "test result: {}. 0 passed; {} failed; {} ignored; 0 measured; 0 filtered out\n",
            if required { "FAILED" } else { "ok" },
            u8::from(required),
            u8::from(!required)
        );
        return if required { ExitCode::FAILURE } else { ExitCode::SUCCESS };
    }
    let out: PathBuf = root.join("target/browser");
    std::fs::create_dir_all(&out).unwrap();
    let status = Command::new("node")
        .arg(here.join("run.mjs"))
        .args(&filter)
        .env("AXISCAL", env!("CARGO_BIN_EXE_axiscal"))
        .env("AXISCAL_CHROMIUM", which(&chromium))
        .env("AXISCAL_BROWSER_OUT", &out)
        .env("AXISCAL_ROOT", root)
        .status()
        .unwrap();
    if status.success() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// The whole path of a program: a driver asks for that.
fn which(program: &str) -> PathBuf {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let found = std::env::split_paths(&path).map(|p| p.join(program)).find(|p| p.is_file());
    found.unwrap_or_else(|| PathBuf::from(program))
}
