//! `axiscal workbench`: a study live in the browser.

use super::add::{history_path, read_history};
use super::load::{Loaded, load_study};
use super::{Answer, Io};
use crate::diag::{Failure, Finding, Result};
use crate::files;
use crate::model::data::assemble;
use crate::post::Postprocessor;
use crate::study::Study;
use crate::workbench::server::Server;
use crate::workbench::{Answered, Host, OWN_EFFECTS, Opened, Place, Verb};
use serde_json::{Value, json};
use std::hash::{Hash, Hasher};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Longest time for a verb that the page calls.
const CALL_TIME: Duration = Duration::from_secs(600);

/// Arguments of `workbench`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The study; what is switched in the page is written into it
    pub study: PathBuf,
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
    let host = Desk::new(&args.study)?;
    let server = Server::new(Arc::new(host), args.port)?;
    let address = server.address();
    io.say(format!("{}: {address}", args.study.display()));
    io.say("every step is written into the study at once; Ctrl-C ends the workbench");
    io.answer(
        &json!({ "format": "axiscal-workbench/1", "study": args.study.display().to_string(), "address": address }),
    );
    use std::io::Write as _;
    let _ = std::io::stdout().flush();
    if !args.no_open
        && let Err(e) = open::that_detached(&address)
    {
        io.report(&[Finding::warning("workbench::browser", format!("no browser could be opened: {e}"))
            .help("open the address by hand; --no-open leaves this out")]);
    }
    server.run()?;
    Ok(Answer::Done)
}

/// The disk as the workbench sees it: the study, and what lies beside it under names that the study gives.
struct Desk {
    study: PathBuf,
    folder: PathBuf,
    stem: String,
    /// Findings of the reading that is under way.
    heard: &'static Mutex<Vec<Finding>>,
    reading: Mutex<()>,
}

impl Desk {
    fn new(study: &Path) -> Result<Self> {
        // a later change of the working folder, or a link that is turned elsewhere, must not move the study
        let study = std::path::absolute(study).unwrap_or_else(|_| study.to_path_buf());
        let stem = study.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        if !study.is_file() || stem.is_empty() {
            return Err(Failure::new("file::unreadable", format!("{} is no study", study.display()))
                .help("`axiscal new` writes one"));
        }
        let folder = study.parent().map(Path::to_path_buf).unwrap_or_default();
        // one list for the life of the process
        let heard = Box::leak(Box::default());
        Ok(Self { study, folder, stem, heard, reading: Mutex::new(()) })
    }

    fn loaded(&self) -> Result<(Loaded, Vec<Finding>)> {
        let _one = self.reading.lock().unwrap_or_else(PoisonError::into_inner);
        let take = || std::mem::take(&mut *self.heard.lock().unwrap_or_else(PoisonError::into_inner));
        take();
        let io = Io { heard: Some(self.heard), ..Io::new(true).inner() };
        let loaded = load_study(&self.study, &io)?;
        Ok((loaded, take()))
    }

    fn place(&self, place: Place) -> Result<PathBuf> {
        Ok(match place {
            Place::Study => self.study.clone(),
            Place::History => history_path(&self.study),
            Place::Effects => {
                let text = files::read_text(&self.study)?;
                let (study, _) = Study::parse(&crate::diag::source(self.study.display().to_string(), text))?;
                self.folder.join(self.effects_file(&study))
            }
        })
    }

    /// The folder of a verb beside the study.
    fn out(&self, verb: &Verb) -> String {
        match verb {
            Verb::PlanNext(..) => format!("{}-next", self.stem),
            Verb::Export(controller) => format!("{}-compensation-{controller}", self.stem),
        }
    }
}

impl Host for Desk {
    fn name(&self) -> String {
        self.study.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
    }

    fn open(&self) -> Result<Opened> {
        let bytes = files::read_bytes(&self.study)?;
        let (loaded, remarks) = self.loaded()?;
        if files::read_bytes(&self.study)? != bytes {
            return Err(Failure::new("study::changed", "the study was changed while it was read"));
        }
        let data = assemble(&loaded.machine, &loaded.runs());
        Ok(Opened {
            bytes,
            data: Arc::new(data),
            machine: Arc::new(loaded.machine),
            catalogue: Arc::new(loaded.catalogue),
            study: loaded.study,
            data_sha256: loaded.data_sha256,
            history: read_history(&history_path(&self.study))?.unwrap_or_default(),
            remarks,
        })
    }

    fn alone(&self) -> Result<Box<dyn Send>> {
        Ok(Box::new(files::lock(&self.study)?))
    }

    fn read(&self, place: Place) -> Result<Option<Vec<u8>>> {
        let path = self.place(place)?;
        if path.exists() { files::read_bytes(&path).map(Some) } else { Ok(None) }
    }

    fn write(&self, place: Place, bytes: Option<&[u8]>) -> Result<()> {
        let path = self.place(place)?;
        match bytes {
            Some(bytes) => files::rewrite(&path, bytes),
            None => files::remove(&path),
        }
    }

    fn effects_file(&self, study: &Study) -> String {
        study.effects_files.first().cloned().unwrap_or_else(|| OWN_EFFECTS.to_owned())
    }

    fn mark(&self, study: &Study) -> u64 {
        let data = study.data.iter().flat_map(|d| [Some(&d.plan), Some(&d.log), d.compensation.as_ref()]);
        let named = data.flatten().chain(&study.machines).chain(&study.effects_files);
        let all = std::iter::once(self.study.clone()).chain(named.map(|n| self.folder.join(n)));
        let mut hash = std::hash::DefaultHasher::new();
        for path in all {
            let seen = std::fs::metadata(&path).ok().map(|m| (m.len(), m.modified().ok()));
            (path, seen).hash(&mut hash);
        }
        hash.finish()
    }

    fn call(&self, verb: &Verb) -> Result<Answered> {
        let folder = self.out(verb);
        let study = self.study.display().to_string();
        let out = self.folder.join(&folder).display().to_string();
        let words: Vec<String> = match verb {
            Verb::PlanNext(controller, minutes) => {
                let minutes = format!("--minutes={minutes}");
                vec!["plan-next".into(), study, "--out".into(), out, "--controller".into(), controller.clone(), minutes]
            }
            Verb::Export(controller) => {
                // the page says beside the button what that accepts
                let accept = "--accept-unverified".into();
                vec!["export".into(), study, "--out".into(), out, "--controller".into(), controller.clone(), accept]
            }
        };
        run_verb(&words, folder)
    }

    fn controllers(&self) -> Vec<String> {
        Postprocessor::built_in().map(|all| all.into_iter().map(|p| p.name).collect()).unwrap_or_default()
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
