//! Verbs that the page calls (sketch, plan-next, export), and the files that they wrote.

use super::desk::Desk;
use super::export::{self, ExportAnswers, Exported};
use super::record::{self, Job};
use super::server::{Shared, answer_json, aside, fault, lock, read, refusal, refused, snapshot};
use super::session::Refused;
use super::{Answered, Verb, evidence};
use crate::diag::Failure;
use axum::body::Bytes;
use axum::extract::{Path, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use serde_json::json;
use std::sync::Arc;
use std::sync::atomic::Ordering;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CallAsked {
    version: u64,
    verb: VerbAsWritten,
    controller: String,
    minutes: Option<f64>,
    answers: Option<ExportAnswers>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum VerbAsWritten {
    PlanNext,
    Export,
}

/// Begins a verb; its answer comes as an event.
pub(super) async fn call(State(shared): State<Arc<Shared>>, body: Bytes) -> Response {
    let asked: CallAsked = match read(&body) {
        Ok(asked) => asked,
        Err(response) => return *response,
    };
    let now = snapshot(&shared);
    if now.version != asked.version {
        return refused(Refused::Stale(now.version));
    }
    let unusable =
        |says: &str, help: &str| refused(Refused::Unusable(Failure::new("workbench::call", says).help(help)));
    // a word of the table, and never a path
    if !Desk::controllers().contains(&asked.controller) {
        return unusable("no controller has that name", "choose one of the list");
    }
    let minutes = asked.minutes.unwrap_or(10.0);
    if !(minutes > 0.0 && minutes <= 600.0) {
        return unusable("the time is no usable number", "up to 600 minutes");
    }
    let (name, verb) = match asked.verb {
        VerbAsWritten::PlanNext => ("plan-next", Verb::PlanNext(asked.controller, minutes)),
        VerbAsWritten::Export => ("export", Verb::Export(asked.controller, asked.answers.unwrap_or_default())),
    };
    if shared.busy.swap(true, Ordering::SeqCst) {
        return refusal(StatusCode::OK, "busy", "another task is still running", Some("wait for its end"));
    }
    let began = Job { verb: name, version: now.version, answered: None, failed: Vec::new() };
    *lock(&shared.job) = Some(began.clone());
    shared.tell("job", now.version);
    tokio::task::spawn_blocking(move || {
        let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| called(&shared, &verb)));
        let done = match result {
            Ok(Ok(answered)) => Job { answered: Some(answered), ..began },
            Ok(Err(failure)) => Job { failed: record::messages(&failure.0), ..began },
            Err(_) => {
                let failure = Failure::new("workbench::fault", "a fault of the program");
                Job { failed: record::messages(&failure.0), ..began }
            }
        };
        *lock(&shared.job) = Some(done);
        shared.busy.store(false, Ordering::SeqCst);
        shared.tell("job", now.version);
    });
    (StatusCode::ACCEPTED, [(header::CONTENT_TYPE, "application/json")], "{}").into_response()
}

/// Calls the verb, and keeps what an export wrote.
fn called(shared: &Shared, verb: &Verb) -> crate::diag::Result<Answered> {
    let answered = shared.desk.call(verb)?;
    if matches!(verb, Verb::Export(..)) {
        let written =
            if answered.code == 0 { Exported::read(&answered, shared.desk.folder())? } else { Exported::default() };
        *lock(&shared.exported) = written;
    }
    Ok(answered)
}

/// What each control asks.
pub(super) async fn export_form(State(shared): State<Arc<Shared>>) -> Response {
    let now = snapshot(&shared);
    match export::forms(&now) {
        Ok(forms) => answer_json(serde_json::to_vec(&forms).unwrap_or_default()),
        Err(failure) => refused(Refused::Unusable(failure)),
    }
}

/// What the last export wrote, as one file.
pub(super) async fn exported_zip(State(shared): State<Arc<Shared>>) -> Response {
    let exported = lock(&shared.exported).clone();
    if exported.files.is_empty() {
        return none();
    }
    match tokio::task::spawn_blocking(move || exported.zip()).await {
        Ok(Ok(bytes)) => ([(header::CONTENT_TYPE, "application/zip")], bytes).into_response(),
        Ok(Err(failure)) => refused(Refused::Unusable(failure)),
        Err(_) => fault(),
    }
}

/// One of the files that the last export wrote, by its number in the answer.
pub(super) async fn exported_file(State(shared): State<Arc<Shared>>, Path(number): Path<usize>) -> Response {
    match lock(&shared.exported).files.get(number) {
        Some((_, bytes)) => ([(header::CONTENT_TYPE, "application/octet-stream")], bytes.clone()).into_response(),
        None => none(),
    }
}

fn none() -> Response {
    refusal(StatusCode::NOT_FOUND, "export", "no compensation has been written yet", Some("write it first"))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SketchAsked {
    version: u64,
}

/// A starting formula for what no known effect explains, as the formula box takes it. Writes nothing.
pub(super) async fn sketch(State(shared): State<Arc<Shared>>, body: Bytes) -> Response {
    aside(shared, move |shared| {
        let asked: SketchAsked = match read(&body) {
            Ok(asked) => asked,
            Err(response) => return *response,
        };
        let now = snapshot(shared);
        if now.version != asked.version {
            return refused(Refused::Stale(now.version));
        }
        match evidence::sketched(&now) {
            Ok((draft, says)) => answer_json(json!({ "draft": draft, "says": says }).to_string().into_bytes()),
            Err(failure) => refused(Refused::Unusable(failure)),
        }
    })
    .await
}
