//! Requests in, answers out: routes, limits, and the threads that work behind the page.
//!
//! Every answer but the page itself and its scripts needs the token. Bodies, heads, connections and times are limited; a
//! panic in a handler is the answer 500 and leaves the session as it was, because a step puts its result in place last.

use super::desk::Desk;
use super::draft::Draft;
use super::guard::{Denied, Guard};
use super::record::{self, Behind, Job};
use super::session::{Ask, Refused, Session, Snapshot};
use super::shelf::Shelf;
use super::{calls, evidence, pages};
use crate::diag::{Failure, Result};
use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::{DefaultBodyLimit, Path, Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use hyper::service::Service as _;
use serde::Deserialize;
use serde_json::json;
use std::net::{Ipv4Addr, SocketAddr};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, mpsc};
use std::time::Duration;
use tokio::sync::{Semaphore, broadcast};

/// Longest body of a request, bytes: 30 000 touches chosen at once are 300 kB.
const LONGEST_BODY: usize = 512 * 1024;
/// The same where a file of the control comes with it.
const LONGEST_CALL: usize = 16 * 1024 * 1024;
const MOST_CONNECTIONS: usize = 64;
/// Streams of events at a time: the other connections stay free for requests. The tabs of a browser share one.
const MOST_STREAMS: usize = 24;
const HEAD_TIME: Duration = Duration::from_secs(10);
const ANSWER_TIME: Duration = Duration::from_secs(120);
/// How often the disk is looked at.
const LOOK_EVERY: Duration = Duration::from_millis(300);
/// How long what is worked out behind the fit waits after a step.
const PAINTS_FIRST: Duration = Duration::from_millis(100);

/// What all requests share.
pub struct Shared {
    pub(super) session: Mutex<Session>,
    shelf: Arc<Shelf>,
    behind: Mutex<Behind>,
    pub(super) job: Mutex<Option<Job>>,
    pub(super) busy: AtomicBool,
    /// The files that the last export wrote: their names and contents.
    pub(super) exported: Mutex<super::export::Exported>,
    wake: Mutex<mpsc::Sender<()>>,
    events: broadcast::Sender<String>,
    streams: Arc<Semaphore>,
    guard: Guard,
    pub(super) desk: Arc<Desk>,
}

/// A panic elsewhere has left what the lock guards as it was before: see the head of this file.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Shared {
    pub(super) fn tell(&self, what: &str, version: u64) {
        // nobody listening is no error
        let _ = self.events.send(json!({ "what": what, "version": version }).to_string());
    }

    /// Opens the study.
    ///
    /// # Errors
    /// When it is unusable.
    fn new(desk: Desk, guard: Guard) -> Result<(Arc<Self>, mpsc::Receiver<()>)> {
        let desk = Arc::new(desk);
        let session = Session::open(desk.clone())?;
        let (wake, woken) = mpsc::channel();
        let shared = Arc::new(Self {
            shelf: session.shelf(),
            session: Mutex::new(session),
            behind: Mutex::default(),
            job: Mutex::new(None),
            busy: AtomicBool::new(false),
            exported: Mutex::default(),
            wake: Mutex::new(wake),
            events: broadcast::channel(64).0,
            streams: Arc::new(Semaphore::new(MOST_STREAMS)),
            guard,
            desk,
        });
        Ok((shared, woken))
    }

    /// A new state: the page hears of it, and the thread behind begins.
    fn changed(&self, version: u64) {
        self.tell("state", version);
        let _ = lock(&self.wake).send(());
    }
}

/// A server that is ready to run.
pub struct Server {
    listener: std::net::TcpListener,
    shared: Arc<Shared>,
    woken: mpsc::Receiver<()>,
}

impl Server {
    /// Opens the study and takes a port (0: any that is free).
    ///
    /// # Errors
    /// When the study is unusable or the port is taken.
    pub fn new(desk: Desk, port: u16) -> Result<Self> {
        let (listener, guard) = listen(port)?;
        let (shared, woken) = Shared::new(desk, guard)?;
        Ok(Self { listener, shared, woken })
    }

    /// The address to open, with the token.
    #[must_use]
    pub fn address(&self) -> String {
        self.shared.guard.address()
    }

    /// Runs until the process ends.
    ///
    /// # Errors
    /// When no threads can be had.
    pub fn run(self) -> Result<()> {
        let router = begin(self.shared, self.woken)?;
        run(self.listener, move || router.clone())
    }
}

/// Takes a port of this machine (0: any that is free), and makes the guard of what is answered there.
///
/// # Errors
/// When the port is taken.
pub(super) fn listen(port: u16) -> Result<(std::net::TcpListener, Guard)> {
    let taken = |e: std::io::Error| {
        Failure::new("workbench::port", format!("port {port} of 127.0.0.1 cannot be used: {e}"))
            .help("name another one with --port, or none: then a free one is taken")
    };
    let listener = std::net::TcpListener::bind(SocketAddr::from((Ipv4Addr::LOCALHOST, port))).map_err(taken)?;
    listener.set_nonblocking(true).map_err(taken)?;
    let port = listener.local_addr().map_err(taken)?.port();
    Ok((listener, Guard::new(port, super::guard::token()?)))
}

fn no_threads(e: std::io::Error) -> Failure {
    Failure::new("workbench::threads", format!("no thread can be had: {e}"))
}

/// Opens a study behind a guard that is there already, and begins the work behind it: its routes.
///
/// # Errors
/// When the study is unusable.
pub(super) fn open(desk: Desk, guard: Guard) -> Result<Router> {
    let (shared, woken) = Shared::new(desk, guard)?;
    begin(shared, woken)
}

fn begin(shared: Arc<Shared>, woken: mpsc::Receiver<()>) -> Result<Router> {
    let own = shared.clone();
    let work = move || work_behind(&own, &woken);
    std::thread::Builder::new().name("evidence".into()).spawn(work).map_err(no_threads)?;
    let own = shared.clone();
    std::thread::Builder::new().name("disk".into()).spawn(move || look_at_disk(&own)).map_err(no_threads)?;
    let version = lock(&shared.session).snapshot().version;
    shared.changed(version);
    Ok(router(shared))
}

/// Answers requests by the routes that hold when they come, until the process ends.
///
/// # Errors
/// When no threads can be had.
pub(super) fn run(
    listener: std::net::TcpListener,
    current: impl Fn() -> Router + Clone + Send + Sync + 'static,
) -> Result<()> {
    let runtime =
        tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().map_err(no_threads)?;
    runtime.block_on(serve(listener, current)).map_err(no_threads)
}

async fn serve(
    listener: std::net::TcpListener,
    current: impl Fn() -> Router + Clone + Send + Sync + 'static,
) -> std::io::Result<()> {
    let listener = tokio::net::TcpListener::from_std(listener)?;
    let places = Arc::new(Semaphore::new(MOST_CONNECTIONS));
    loop {
        let Ok(place) = places.clone().acquire_owned().await else { return Ok(()) };
        let Ok((stream, _)) = listener.accept().await else {
            // too many open files, or a connection that went away: neither is a reason to end
            tokio::time::sleep(Duration::from_millis(50)).await;
            continue;
        };
        let _ = stream.set_nodelay(true);
        let current = current.clone();
        // a connection outlives the opening of a study
        let service = hyper::service::service_fn(move |request| {
            hyper_util::service::TowerToHyperService::new(current()).call(request)
        });
        tokio::spawn(async move {
            let connection = hyper::server::conn::http1::Builder::new()
                .timer(hyper_util::rt::TokioTimer::new())
                .header_read_timeout(HEAD_TIME)
                .max_buf_size(64 * 1024)
                .serve_connection(hyper_util::rt::TokioIo::new(stream), service);
            let _ = connection.await;
            drop(place);
        });
    }
}

pub fn router(shared: Arc<Shared>) -> Router {
    let api = Router::new()
        .route("/api/state", get(state))
        .route("/api/inputs", get(inputs))
        .route("/api/evidence", get(evidence_of))
        .route("/api/events", get(events))
        .route("/api/step", post(step))
        .route("/api/try", post(try_out))
        .route("/api/expect", post(expect))
        .route("/api/sketch", post(calls::sketch))
        .route("/api/call", post(calls::call).layer(DefaultBodyLimit::max(LONGEST_CALL)))
        .route("/api/export", get(calls::export_form))
        .route("/api/export/zip", get(calls::exported_zip))
        .route("/api/export/file/{number}", get(calls::exported_file));
    let api = guarded(api, &shared.guard, LONGEST_CALL);
    let guard = shared.guard.clone();
    around(Router::new().route("/", get(|| page(pages::PAGE))).merge(api), guard).with_state(shared)
}

/// Routes that need the token, and take no body longer than that of the longest request.
pub(super) fn guarded<S: Clone + Send + Sync + 'static>(api: Router<S>, guard: &Guard, longest: usize) -> Router<S> {
    api.layer(from_fn_with_state((guard.clone(), longest), with_token))
}

/// What holds for every request: scripts and styles, limits, and the check where it comes from.
pub(super) fn around<S: Clone + Send + Sync + 'static>(routes: Router<S>, guard: Guard) -> Router<S> {
    routes
        .route("/assets/{name}", get(asset))
        .fallback(|| async { refusal(StatusCode::NOT_FOUND, "path", "there is nothing here", None) })
        .layer(from_fn_with_state(guard, from_here))
        .layer(DefaultBodyLimit::max(LONGEST_BODY))
        .layer(tower_http::timeout::TimeoutLayer::with_status_code(StatusCode::REQUEST_TIMEOUT, ANSWER_TIME))
        .layer(tower_http::catch_panic::CatchPanicLayer::custom(|_: Box<dyn std::any::Any + Send>| fault()))
}

pub(super) fn answer_json(bytes: Vec<u8>) -> Response {
    ([(header::CONTENT_TYPE, "application/json")], bytes).into_response()
}

pub(super) fn refusal(status: StatusCode, code: &str, says: &str, help: Option<&str>) -> Response {
    let body = json!({ "error": code, "messages": [{ "severity": "error", "message": says, "help": help }] });
    (status, [(header::CONTENT_TYPE, "application/json")], body.to_string()).into_response()
}

pub(super) fn fault() -> Response<Body> {
    refusal(
        StatusCode::INTERNAL_SERVER_ERROR,
        "fault",
        "a fault of the program: nothing was changed",
        Some("report it with the study; the page can be used further"),
    )
}

/// What a person asked and cannot have is an answer with its reason, and no HTTP error: that would stand in the browser's
/// console as if the page were faulty.
pub(super) fn refused(why: Refused) -> Response {
    let body = match why {
        Refused::Stale(version) => json!({ "error": "stale", "version": version, "messages": [{ "severity": "warning",
            "message": "the study has changed meanwhile, in another tab or on the disk",
            "help": "nothing was done: the page now shows the new state, do it again if it is still wanted" }] }),
        Refused::Unusable(failure) => json!({ "error": "unusable", "messages": record::messages(&failure.0) }),
        Refused::Mistakes(mistakes) => json!({ "error": "mistakes", "mistakes": mistakes }),
    };
    answer_json(body.to_string().into_bytes())
}

fn denied(d: Denied) -> Response {
    refusal(d.status, d.code, d.says, None)
}

/// Is the request from the page of this server? And headers that keep the page to itself.
async fn from_here(State(guard): State<Guard>, request: Request, next: Next) -> Response {
    let mut response = match guard.check_origin(request.method(), request.headers()) {
        Ok(()) => next.run(request).await,
        Err(d) => denied(d),
    };
    for (name, value) in pages::HEADERS {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

async fn with_token(State((guard, longest)): State<(Guard, usize)>, request: Request, next: Next) -> Response {
    if let Err(d) = guard.check_token(request.headers()) {
        return denied(d);
    }
    // a body that is promised too long is not waited for
    let promised = request.headers().get(header::CONTENT_LENGTH).and_then(|v| v.to_str().ok()?.parse::<u64>().ok());
    if promised.is_some_and(|n| n > longest as u64) {
        return refusal(StatusCode::PAYLOAD_TOO_LARGE, "length", "the request is too long", None);
    }
    let json = |h: &HeaderMap| {
        let kind = h.get(header::CONTENT_TYPE).and_then(|v| v.to_str().ok()).unwrap_or_default();
        kind.split(';').next().is_some_and(|k| k.trim().eq_ignore_ascii_case("application/json"))
    };
    if request.method() == axum::http::Method::POST && !json(request.headers()) {
        return refusal(StatusCode::UNSUPPORTED_MEDIA_TYPE, "type", "requests are application/json", None);
    }
    next.run(request).await
}

pub(super) async fn page(text: &'static str) -> Response {
    ([(header::CONTENT_TYPE, "text/html; charset=utf-8")], text).into_response()
}

async fn asset(Path(name): Path<String>) -> Response {
    match pages::asset(&name) {
        Some((kind, text)) => ([(header::CONTENT_TYPE, kind)], text).into_response(),
        None => refusal(StatusCode::NOT_FOUND, "path", "there is nothing here", None),
    }
}

/// Work that takes the session, off the threads that answer.
pub(super) async fn aside(shared: Arc<Shared>, work: impl FnOnce(&Shared) -> Response + Send + 'static) -> Response {
    tokio::task::spawn_blocking(move || work(&shared)).await.unwrap_or_else(|_| fault())
}

pub(super) fn snapshot(shared: &Shared) -> Snapshot {
    lock(&shared.session).snapshot()
}

async fn state(State(shared): State<Arc<Shared>>) -> Response {
    aside(shared, |shared| {
        let now = snapshot(shared);
        let job = lock(&shared.job).clone();
        answer_json(record::live(&now, job.as_ref()))
    })
    .await
}

async fn inputs(State(shared): State<Arc<Shared>>) -> Response {
    aside(shared, |shared| answer_json(super::inputs::inputs(&snapshot(shared)))).await
}

async fn evidence_of(State(shared): State<Arc<Shared>>) -> Response {
    aside(shared, |shared| answer_json(record::evidence(&lock(&shared.behind)))).await
}

async fn events(State(shared): State<Arc<Shared>>) -> Response {
    let Ok(place) = shared.streams.clone().try_acquire_owned() else {
        let says = "the workbench is open in too many browsers at the same time";
        let help = "close some of them: this page looks again by itself";
        return refusal(StatusCode::SERVICE_UNAVAILABLE, "streams", says, Some(help));
    };
    let heard = shared.events.subscribe();
    let version = snapshot(&shared).version;
    let hello = json!({ "what": "hello", "version": version }).to_string();
    let stream = futures_util::stream::unfold((heard, Some(hello), place), |(mut heard, hello, place)| async move {
        if let Some(hello) = hello {
            return Some((Ok::<_, std::convert::Infallible>(Event::default().data(hello)), (heard, None, place)));
        }
        let text = match heard.recv().await {
            Ok(text) => text,
            // who was too slow looks at everything again
            Err(broadcast::error::RecvError::Lagged(_)) => "{\"what\":\"lagged\"}".to_owned(),
            Err(broadcast::error::RecvError::Closed) => return None,
        };
        Some((Ok(Event::default().data(text)), (heard, None, place)))
    });
    Sse::new(stream).keep_alive(KeepAlive::new().interval(Duration::from_secs(15))).into_response()
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StepAsked {
    version: u64,
    ask: AskAsWritten,
}

/// Touches are pairs of run (from 1) and number.
#[derive(Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
enum AskAsWritten {
    Switch { effect: String, on: bool },
    Mask { touches: Vec<(usize, u64)>, reason: String },
    Unmask { touches: Vec<(usize, u64)> },
    Save { draft: Box<Draft>, on: bool },
    Model { effects: Vec<String> },
    Undo,
    Redo,
}

impl AskAsWritten {
    fn ask(self) -> Result<Ask> {
        let from_zero = |touches: Vec<(usize, u64)>| -> Result<Vec<(usize, u64)>> {
            let each = touches.into_iter().map(|(run, id)| Some((run.checked_sub(1)?, id)));
            each.collect::<Option<Vec<_>>>().ok_or_else(|| Failure::new("workbench::run", "runs are counted from 1"))
        };
        Ok(match self {
            Self::Switch { effect, on } => Ask::Switch { effect, on },
            Self::Mask { touches, reason } => Ask::Mask { touches: from_zero(touches)?, reason },
            Self::Unmask { touches } => Ask::Unmask { touches: from_zero(touches)? },
            Self::Save { draft, on } => Ask::Save { draft, on },
            Self::Model { effects } => Ask::Model { effects },
            Self::Undo => Ask::Undo,
            Self::Redo => Ask::Redo,
        })
    }
}

pub(super) fn read<'a, T: Deserialize<'a>>(body: &'a Bytes) -> std::result::Result<T, Box<Response>> {
    serde_json::from_slice(body).map_err(|e| {
        Box::new(refusal(StatusCode::BAD_REQUEST, "json", &format!("the request cannot be read: {e}"), None))
    })
}

async fn step(State(shared): State<Arc<Shared>>, body: Bytes) -> Response {
    aside(shared, move |shared| {
        let asked: StepAsked = match read(&body) {
            Ok(asked) => asked,
            Err(response) => return *response,
        };
        let ask = match asked.ask.ask() {
            Ok(ask) => ask,
            Err(failure) => return refused(Refused::Unusable(failure)),
        };
        let mut session = lock(&shared.session);
        let before = session.snapshot().version;
        let made = session.step(asked.version, ask);
        let now = session.snapshot();
        drop(session);
        if now.version != before {
            shared.changed(now.version);
        }
        match made {
            Ok(now) => {
                let job = lock(&shared.job).clone();
                answer_json(record::live(&now, job.as_ref()))
            }
            Err(why) => refused(why),
        }
    })
    .await
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TryAsked {
    version: u64,
    effect: Option<String>,
    draft: Option<Draft>,
}

/// What an effect would do at each touch, without a step.
async fn try_out(State(shared): State<Arc<Shared>>, body: Bytes) -> Response {
    aside(shared, move |shared| {
        let asked: TryAsked = match read(&body) {
            Ok(asked) => asked,
            Err(response) => return *response,
        };
        let now = snapshot(shared);
        if now.version != asked.version {
            return refused(Refused::Stale(now.version));
        }
        match record::tried(&now, &shared.shelf, asked.effect.as_deref(), asked.draft.as_ref()) {
            Ok(bytes) => answer_json(bytes),
            Err(why) => refused(why),
        }
    })
    .await
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ExpectAsked {
    version: u64,
    effect: String,
}

/// What an effect would leave, to first order: shown until the fit is there.
async fn expect(State(shared): State<Arc<Shared>>, body: Bytes) -> Response {
    aside(shared, move |shared| {
        let asked: ExpectAsked = match read(&body) {
            Ok(asked) => asked,
            Err(response) => return *response,
        };
        let now = snapshot(shared);
        if now.version != asked.version {
            return refused(Refused::Stale(now.version));
        }
        answer_json(record::expected(&now, &asked.effect))
    })
    .await
}

/// Works out what the touches say of every effect, the newest state first; what a newer one overtakes is thrown away.
fn work_behind(shared: &Arc<Shared>, woken: &mpsc::Receiver<()>) {
    // the next click must find a free processor
    let n = std::thread::available_parallelism().map_or(1, |n| n.get().saturating_sub(1).max(1));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(n).thread_name(|i| format!("evidence-{i}")).build();
    let mut done = 0;
    while woken.recv().is_ok() {
        // the page paints first, and of quick clicks only the last one is worked out
        while woken.recv_timeout(PAINTS_FIRST).is_ok() {}
        let now = snapshot(shared);
        if now.version == done {
            continue;
        }
        done = now.version;
        let current = || lock(&shared.session).snapshot().version == now.version;
        lock(&shared.session).write_ladder(now.version);
        let work = || {
            let began = std::time::Instant::now();
            if let Some(known) = shared.shelf.behind(&now) {
                let (by_visit, later_run) = (known.held_out_rms_um, known.later_run_rms_um);
                lock(&shared.session).enter_held_out(now.version, by_visit, later_run);
                *lock(&shared.behind) = known.clone();
                shared.tell("evidence", now.version);
                shared.shelf.ahead(&now, &known, current);
                return;
            }
            let mut behind = Behind { version: now.version, ..Behind::default() };
            behind.scores = Some(evidence::scores(&now));
            behind.ms = began.elapsed().as_secs_f64() * 1e3;
            *lock(&shared.behind) = behind.clone();
            shared.tell("scores", now.version);
            if !current() {
                return;
            }
            let held_out = crate::fit::held_out::by_visit(&now.fit).map(|h| h.rms_um);
            let later = crate::fit::held_out::later_run(&now.fit).map(|h| h.rms_um);
            lock(&shared.session).enter_held_out(now.version, held_out, later);
            behind.held_out_rms_um = held_out;
            behind.later_run_rms_um = later;
            if !current() {
                return;
            }
            match evidence::diagnosis(&now) {
                Ok(found) => {
                    let (headline, next) = shared.desk.verdict(&now, &shared.shelf, &found);
                    behind.headline = Some(headline);
                    behind.next = next;
                    behind.diagnosis = Some(found);
                }
                Err(failure) => behind.failed = record::messages(&failure.0),
            }
            behind.complete = true;
            behind.ms = began.elapsed().as_secs_f64() * 1e3;
            shared.shelf.keep_behind(&now, &behind);
            *lock(&shared.behind) = behind.clone();
            shared.tell("evidence", now.version);
            shared.shelf.ahead(&now, &behind, current);
        };
        let worked = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| match &pool {
            Ok(pool) => pool.install(work),
            Err(_) => work(),
        }));
        if worked.is_err() {
            let failure = Failure::new("workbench::fault", "the diagnosis ended in a fault of the program");
            let failed = record::messages(&failure.0);
            *lock(&shared.behind) = Behind { version: now.version, complete: true, failed, ..Behind::default() };
            shared.tell("evidence", now.version);
        }
    }
}

/// Follows what others do to the study's files.
fn look_at_disk(shared: &Arc<Shared>) {
    loop {
        std::thread::sleep(LOOK_EVERY);
        let looked = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            let mut session = lock(&shared.session);
            session.follow().then(|| session.snapshot().version)
        }));
        if let Ok(Some(version)) = looked {
            shared.changed(version);
        }
    }
}
