//! `axiscal workbench`: a study live in the browser, or a page on which one is made.

use super::{Answer, Io};
use crate::diag::{Failure, Finding, Result};
use crate::files;
use crate::workbench::Answered;
use crate::workbench::desk::Desk;
use crate::workbench::recent::Recent;
use crate::workbench::server::Server;
use crate::workbench::start::StartServer;
use crate::workflow::Disk;
use serde_json::{Value, json};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Longest time for a verb that the page calls.
const CALL_TIME: Duration = Duration::from_secs(600);

#[derive(Debug, clap::Args)]
pub struct Args {
    /// The study; what is switched in the page is written into it. Without it a page opens on which you choose or make one
    pub study: Option<PathBuf>,
    /// Port on 127.0.0.1 (default: any that is free)
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub port: u16,
    /// Only print the address, and leave the browser alone
    #[arg(long)]
    pub no_open: bool,
}

/// Runs `workbench`, until it is ended.
///
/// # Errors
/// When the study is unusable or the port is taken.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    super::guard::say_at_once();
    let recent = Recent::new(data_folder());
    let Some(given) = &args.study else { return start(args, recent, io) };
    // a later change of the working folder, or a link that is turned elsewhere, must not move the study
    let study = std::path::absolute(given).unwrap_or_else(|_| given.clone());
    let server = Server::new(Desk::new(study.clone(), Disk::default(), run_verb)?, args.port)?;
    recent.add(&study);
    let address = server.address();
    io.say(format!("{}: {address}", given.display()));
    io.say("every step is written into the study at once; Ctrl-C ends the workbench");
    io.answer(&json!({ "format": "axiscal-workbench/1", "study": given.display().to_string(), "address": address }));
    show(&address, args, io);
    server.run()?;
    Ok(Answer::Done)
}

/// The page on which a study is chosen or made.
fn start(args: &Args, recent: Recent, io: &Io) -> Result<Answer> {
    let folder = std::env::current_dir().map_err(|e| {
        Failure::new("workbench::folder", format!("the working folder cannot be used: {e}"))
            .help("change to a folder in which new studies may be made")
    })?;
    let server = StartServer::new(folder.clone(), recent, run_verb, args.port)?;
    let address = server.address();
    io.say(format!("choose or make a study: {address}"));
    io.say(format!("new studies are made below {}; Ctrl-C ends the workbench", folder.display()));
    io.answer(&json!({ "format": "axiscal-workbench/1", "study": null, "address": address }));
    show(&address, args, io);
    server.run()?;
    Ok(Answer::Done)
}

/// Where programs keep data of the user, as the system says.
fn data_folder() -> Option<PathBuf> {
    let named = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let home = || named("HOME");
    let all = if cfg!(windows) {
        named("LOCALAPPDATA")
    } else if cfg!(target_os = "macos") {
        home().map(|h| h.join("Library/Application Support"))
    } else {
        named("XDG_DATA_HOME").or_else(|| home().map(|h| h.join(".local/share")))
    };
    all.map(|folder| folder.join("axiscal"))
}

/// Opens the address in the user's browser, where that is wanted.
fn show(address: &str, args: &Args, io: &Io) {
    use std::io::Write as _;
    let _ = std::io::stdout().flush();
    if !args.no_open
        && let Err(e) = open::that_detached(address)
    {
        io.report(&[Finding::warning("workbench::browser", format!("no browser could be opened: {e}"))
            .help("open the address by hand; --no-open leaves this out")]);
    }
}

/// Calls this program: the very verb that a user would type, in a process of its own that cannot hurt this one.
fn run_verb(words: &[String], folder: String) -> Result<Answered> {
    let fail = |e: std::io::Error| {
        Failure::new("workbench::call", format!("{} cannot be called: {e}", words[0])).help("call it in the terminal")
    };
    let program = std::env::current_exe().map_err(fail)?;
    // files, because nobody reads a pipe while the process is waited for
    let (said, noted) = (tempfile::tempfile().map_err(fail)?, tempfile::tempfile().map_err(fail)?);
    let mut child = Command::new(program)
        .arg("--json")
        .arg(format!("--max-input={}", files::max_input()))
        .args(words)
        .env("NO_COLOR", "1")
        .stdin(Stdio::null())
        .stdout(said.try_clone().map_err(fail)?)
        .stderr(noted.try_clone().map_err(fail)?)
        .spawn()
        .map_err(fail)?;
    let began = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().map_err(fail)? {
            break status;
        }
        if began.elapsed() > CALL_TIME {
            let _ = child.kill();
            let _ = child.wait();
            return Err(Failure::new("workbench::slow", format!("{} takes too long", words[0]))
                .help("call it in the terminal, where it may take its time"));
        }
        std::thread::sleep(Duration::from_millis(20));
    };
    let answer: Value = serde_json::from_str(&contents(said).map_err(fail)?).unwrap_or(Value::Null);
    let messages = contents(noted).map_err(fail)?.lines().map(|l| l.trim_end().to_owned()).collect();
    Ok(Answered { code: status.code().unwrap_or(2), answer, messages, folder })
}

fn contents(mut file: std::fs::File) -> std::io::Result<String> {
    use std::io::{Read, Seek};
    file.rewind()?;
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes)?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}
