//! The page before a study is open: it makes one of the user's files, opens an earlier one, or the demo.
//!
//! What the page sends is written into a folder that did not exist before, under names of plain signs
//! ([`super::upload::kept_names`]); an earlier study is named by its number in the list. When a study is open, its routes take
//! the place of these.

use super::Answered;
use super::desk::{CallVerb, Desk};
use super::guard::Guard;
use super::pages;
use super::recent::Recent;
use super::record;
use super::server::{answer_json, around, fault, guarded, listen, open, page, read, refusal, run};
use super::upload::{kept_name, kept_names};
use crate::diag::{Failure, Result};
use crate::workflow::Disk;
use axum::Router;
use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, State};
use axum::http::StatusCode;
use axum::response::Response;
use axum::routing::{get, post};
use serde::Deserialize;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock, TryLockError};

/// Longest body of a request, bytes: plans and logs of some hundred thousand touches.
const LONGEST: usize = 96 * 1024 * 1024;
const MOST_FILES: usize = 200;
const STUDY: &str = "study.toml";
const DEMO: &str = "axiscal-demo";

struct Start {
    /// Where new studies are made.
    folder: PathBuf,
    recent: Recent,
    call: CallVerb,
    guard: Guard,
    /// The routes of the study, once one is open.
    opened: OnceLock<Router>,
    /// One study is made at a time.
    making: Mutex<()>,
}

/// The start page's server, ready to run.
pub struct StartServer {
    listener: std::net::TcpListener,
    start: Arc<Start>,
}

impl StartServer {
    /// Takes a port (0: any that is free). New studies are made below `folder`.
    ///
    /// # Errors
    /// When the port is taken.
    pub fn new(folder: PathBuf, recent: Recent, call: CallVerb, port: u16) -> Result<Self> {
        let (listener, guard) = listen(port)?;
        let start = Start { folder, recent, call, guard, opened: OnceLock::new(), making: Mutex::new(()) };
        Ok(Self { listener, start: Arc::new(start) })
    }

    /// The address to open, with the token.
    #[must_use]
    pub fn address(&self) -> String {
        self.start.guard.address()
    }

    /// Runs until the process ends.
    ///
    /// # Errors
    /// When no threads can be had.
    pub fn run(self) -> Result<()> {
        let (first, start) = (router(&self.start), self.start);
        run(self.listener, move || start.opened.get().unwrap_or(&first).clone())
    }
}

fn router(start: &Arc<Start>) -> Router {
    let api = Router::new()
        .route("/api/start", get(offered))
        .route("/api/start/recent", post(open_recent))
        .route("/api/start/demo", post(open_demo))
        .route("/api/start/new", post(make_new).layer(DefaultBodyLimit::max(LONGEST)));
    let api = guarded(api, &start.guard, LONGEST);
    around(Router::new().route("/", get(|| page(pages::START))).merge(api), start.guard.clone())
        .with_state(start.clone())
}

/// Why no study is open.
enum NotOpen {
    Failed(Failure),
    /// What the verb said.
    Said(Box<Answered>),
}

impl From<Failure> for NotOpen {
    fn from(failure: Failure) -> Self {
        Self::Failed(failure)
    }
}

impl Start {
    fn open(&self, study: &Path) -> Result<()> {
        let routes = open(Desk::new(study.to_path_buf(), Disk::default(), self.call)?, self.guard.clone())?;
        self.recent.add(study);
        // another tab may have been faster: its study stays
        let _ = self.opened.set(routes);
        Ok(())
    }

    /// Calls a verb on files below the folder, which is the working one.
    fn said(&self, words: &[String], folder: &str) -> std::result::Result<(), NotOpen> {
        let answered = (self.call)(words, folder.to_owned())?;
        if answered.code == 2 { Err(NotOpen::Said(Box::new(answered))) } else { Ok(()) }
    }

    fn demo(&self) -> std::result::Result<(), NotOpen> {
        self.said(&["demo".to_owned(), "--out".to_owned(), DEMO.to_owned()], DEMO)?;
        Ok(self.open(&self.folder.join(DEMO).join(STUDY))?)
    }

    fn new_study(&self, asked: &NewAsked) -> std::result::Result<(), NotOpen> {
        let name = kept_name(&asked.name, "study");
        let folder = self.folder.join(&name);
        std::fs::create_dir(&folder).map_err(|e| {
            let failure = match e.kind() {
                std::io::ErrorKind::AlreadyExists => {
                    Failure::new("new::exists", format!("{name} exists already in {}", self.folder.display()))
                        .help("give the study another name")
                }
                _ => Failure::new("file::unwritable", format!("{} cannot be made: {e}", folder.display()))
                    .help("start the workbench in a folder in which you may write"),
            };
            NotOpen::from(failure)
        })?;
        let made = self.filled(asked, &name).and_then(|()| Ok(self.open(&folder.join(STUDY))?));
        if made.is_err() {
            // it was made a moment ago, and holds copies only
            let _ = std::fs::remove_dir_all(&folder);
        }
        made
    }

    /// Writes the files into the new folder, and the study that names them.
    fn filled(&self, asked: &NewAsked, folder: &str) -> std::result::Result<(), NotOpen> {
        let names = kept_names(asked.files.iter().map(|f| f.name.as_str()), &[STUDY, "study.plan.json", "study.csv"]);
        let mut words = vec!["new".to_owned(), format!("--machine={}", asked.machine)];
        for (file, name) in asked.files.iter().zip(&names) {
            let upload = super::upload::Upload { name: file.name.clone(), data: file.data.clone() };
            crate::files::write_whole(&self.folder.join(folder).join(name), &upload.bytes()?)?;
            words.push(format!("{}={}", file.role.option(), Path::new(folder).join(name).display()));
        }
        if asked.known_blocks {
            words.push("--known-blocks".to_owned());
        }
        if let Some(controller) = &asked.controller {
            words.push(format!("--controller={controller}"));
        }
        words.extend(asked.centres.iter().flat_map(CentresAsked::words));
        words.push(format!("--out={}", Path::new(folder).join(STUDY).display()));
        self.said(&words, folder)
    }
}

/// What a file of the page is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Role {
    Plan,
    Log,
    Centres,
    Machines,
    Effects,
}

impl Role {
    fn option(self) -> &'static str {
        match self {
            Self::Plan => "--plan",
            Self::Log => "--log",
            Self::Centres => "--centres",
            Self::Machines => "--machines",
            Self::Effects => "--effects-file",
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Given {
    role: Role,
    name: String,
    /// Base64.
    data: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct NewAsked {
    name: String,
    machine: String,
    controller: Option<String>,
    #[serde(default)]
    known_blocks: bool,
    /// Plans and logs in the order of the runs.
    files: Vec<Given>,
    centres: Option<CentresAsked>,
}

/// What `axiscal new --centres` asks beside the file; what is left out is taken from the file and the machine.
#[derive(Deserialize)]
#[serde(default, deny_unknown_fields)]
#[derive(Default)]
struct CentresAsked {
    unit: Option<String>,
    kind: Option<String>,
    position_of: Option<String>,
    carrier: Option<String>,
    sigma_um: Option<f64>,
    tool_length: Option<f64>,
    sphere_at: Option<[f64; 3]>,
    zero_at: Option<[f64; 3]>,
}

impl CentresAsked {
    fn words(&self) -> Vec<String> {
        let word = |option: &str, given: &Option<String>| given.as_ref().map(|w| format!("--{option}={w}"));
        let number = |option: &str, given: Option<f64>| given.map(|x| format!("--{option}={x}"));
        let point = |option: &str, given: Option<[f64; 3]>| given.map(|[x, y, z]| format!("--{option}={x},{y},{z}"));
        let all = [
            word("unit", &self.unit),
            word("kind", &self.kind),
            word("position-of", &self.position_of),
            word("carrier", &self.carrier),
            number("sigma-um", self.sigma_um),
            number("tool-length", self.tool_length),
            point("sphere-at", self.sphere_at),
            point("zero-at", self.zero_at),
        ];
        all.into_iter().flatten().collect()
    }
}

/// The controllers that a study may name: a name of the list, and never a path.
fn controllers() -> Vec<String> {
    let mut all = Desk::controllers();
    all.push("csv".to_owned());
    all
}

fn check(asked: &NewAsked) -> Result<()> {
    let unusable = |says: &str, help: &str| Err(Failure::new("workbench::start", says).help(help));
    let count = |role: Role| asked.files.iter().filter(|f| f.role == role).count();
    if asked.controller.as_ref().is_some_and(|c| !controllers().contains(c)) {
        return unusable("no controller has that name", "choose one of the list");
    }
    if asked.files.len() > MOST_FILES {
        return unusable("these are too many files at once", "make the study with `axiscal new`");
    }
    match (count(Role::Centres), count(Role::Plan), count(Role::Log)) {
        (0, 0, 0) => {
            unusable("there is nothing to make a study of", "add a plan and its log, or a file of sphere centres")
        }
        (0, plans, logs) if plans != logs => {
            let count = |n: usize, what: &str| format!("{n} {what}{}", if n == 1 { "" } else { "s" });
            Err(Failure::new("new::pairs", format!("{} and {} do not pair", count(plans, "plan"), count(logs, "log")))
                .help("add one log for each plan"))
        }
        (0, ..) | (1, 0, 0) => Ok(()),
        _ => unusable(
            "a file of sphere centres needs no plan and no log",
            "choose what each file is: one file of centres alone, or plans and logs",
        ),
    }
}

/// What can be chosen.
async fn offered(State(start): State<Arc<Start>>) -> Response {
    let machines = crate::workflow::load_machines(None, &Disk::default()).unwrap_or_default();
    let machines: Vec<_> = machines.iter().map(|m| json!({ "name": m.name, "says": m.says })).collect();
    let part = |p: Option<&std::ffi::OsStr>| p.map_or_else(String::new, |p| p.to_string_lossy().into_owned());
    let recent: Vec<_> = start
        .recent
        .list()
        .iter()
        .map(|study| json!({ "name": part(study.file_name()), "folder": study.parent().map(|f| f.display().to_string()) }))
        .collect();
    let offer = json!({
        "format": "axiscal-start/1", "folder": start.folder.display().to_string(), "machines": machines,
        "controllers": controllers(), "recent": recent, "demo": DEMO, "longest": LONGEST,
    });
    answer_json(offer.to_string().into_bytes())
}

/// Work that takes its time, one at a time.
async fn aside(
    start: Arc<Start>,
    work: impl FnOnce(&Start) -> std::result::Result<(), NotOpen> + Send + 'static,
) -> Response {
    let done = tokio::task::spawn_blocking(move || {
        let _alone = match start.making.try_lock() {
            Ok(alone) => alone,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => {
                return refusal(StatusCode::OK, "busy", "a study is being opened", Some("wait for it"));
            }
        };
        match work(&start) {
            Ok(()) => answer_json(b"{}".to_vec()),
            Err(NotOpen::Failed(failure)) => unusable(json!({ "messages": record::messages(&failure.0) })),
            Err(NotOpen::Said(answered)) => unusable(json!({ "lines": answered.messages })),
        }
    });
    done.await.unwrap_or_else(|_| fault())
}

fn unusable(mut body: serde_json::Value) -> Response {
    body["error"] = json!("unusable");
    answer_json(body.to_string().into_bytes())
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RecentAsked {
    /// Its number in the list, from 0.
    number: usize,
}

async fn open_recent(State(start): State<Arc<Start>>, body: Bytes) -> Response {
    let asked: RecentAsked = match read(&body) {
        Ok(asked) => asked,
        Err(response) => return *response,
    };
    aside(start, move |start| {
        let list = start.recent.list();
        let gone = || Failure::new("workbench::recent", "this study is not there any more").help("load the page again");
        let study = list.get(asked.number).ok_or_else(gone)?;
        Ok(start.open(study)?)
    })
    .await
}

async fn open_demo(State(start): State<Arc<Start>>) -> Response {
    aside(start, Start::demo).await
}

async fn make_new(State(start): State<Arc<Start>>, body: Bytes) -> Response {
    aside(start, move |start| {
        let asked: NewAsked = serde_json::from_slice(&body)
            .map_err(|e| Failure::new("workbench::start", format!("the request cannot be read: {e}")))?;
        check(&asked)?;
        start.new_study(&asked)
    })
    .await
}
