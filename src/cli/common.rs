//! What every verb shares: printing, exit codes, and the machine that is named.

use crate::diag::{Failure, Finding, Result, Severity, shown};
use crate::fit::outcome::Outcome;
use crate::machine::Machine;
use crate::report::plot::Paper;
use crate::workflow::{Environment, load_machine};
use std::io::{ErrorKind, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer {
    /// Exit code 0.
    Done,
    /// Exit code 1: the answer is "no".
    No,
}

/// What a verb answers that shows a fit: one that did not converge is said, and the answer is "no".
pub fn of_fit(outcome: &Outcome, answer: Answer, io: &Io) -> Answer {
    if outcome.converged {
        return answer;
    }
    io.report(&[Finding::warning("fit::not_converged", format!("the fit did not converge: {}", outcome.stopped)).help(
        "its values are no results: check plan and log, start values and formulas of effects of your own, and use fewer effects",
    )]);
    Answer::No
}

/// Set when something that was printed did not arrive.
static OUTPUT_LOST: AtomicBool = AtomicBool::new(false);

/// Set when the JSON answer was printed.
static ANSWERED: AtomicBool = AtomicBool::new(false);

/// A finding as JSON: code, severity, what it says and what to do, and its place where it has one.
pub fn finding_record(finding: &Finding) -> serde_json::Value {
    let place = finding.place();
    // a file may have colons in its name
    let mut parts = place.as_deref().unwrap_or("").rsplitn(3, ':');
    let column = parts.next().and_then(|c| c.parse::<usize>().ok());
    let line = parts.next().and_then(|l| l.parse::<usize>().ok());
    let file = parts.next();
    let severity = match finding.severity {
        Severity::Error => "error",
        Severity::Warning => "warning",
        Severity::Info => "note",
    };
    serde_json::json!({
        "code": finding.code, "severity": severity, "says": finding.message, "help": finding.help,
        "file": file, "line": line, "column": column,
    })
}

/// Prints a line; a reader that has gone away (`| head`) is no error, a full disk is.
pub fn print(text: &str) {
    if let Err(e) = writeln!(std::io::stdout(), "{text}")
        && e.kind() != ErrorKind::BrokenPipe
    {
        OUTPUT_LOST.store(true, Ordering::Relaxed);
    }
}

/// Columns of the terminal, or as `COLUMNS` states them; `None` in a pipe of no stated width.
fn columns() -> Option<usize> {
    let stated = std::env::var("COLUMNS").ok().and_then(|c| c.parse::<usize>().ok()).filter(|c| *c > 0);
    let terminal = std::io::IsTerminal::is_terminal(&std::io::stdout());
    // a terminal of no columns does not know how wide it is
    let measured =
        || console::Term::stdout().size_checked().map(|(_, columns)| usize::from(columns)).filter(|c| *c > 0);
    stated.or_else(|| measured().filter(|_| terminal)).map(|c| c.clamp(40, 400))
}

#[derive(Debug, Clone, Copy)]
pub struct Io {
    /// One JSON object on stdout, messages on stderr.
    pub json: bool,
    /// A verb that another one calls: it says and answers nothing, findings go to stderr all the same.
    pub within: bool,
}

impl Io {
    /// For a call with or without `--json`.
    #[must_use]
    pub fn new(json: bool) -> Self {
        Self { json, within: false }
    }

    /// For a verb that this one calls: the caller answers.
    #[must_use]
    pub fn inner(&self) -> Self {
        Self { within: self.json, ..*self }
    }

    /// What plots and wide tables are drawn on: the terminal as it is; in a pipe 80 columns of ASCII.
    #[must_use]
    pub fn paper(&self, ascii: bool) -> Paper {
        let terminal = std::io::IsTerminal::is_terminal(&std::io::stdout());
        let width = columns().unwrap_or(80);
        let colour = terminal && !ascii && std::env::var_os("NO_COLOR").is_none_or(|v| v.is_empty());
        Paper { width, ascii: ascii || !terminal, colour }
    }

    /// A line for the person: stdout, or nothing when JSON was asked for. Prose is wrapped to the terminal; in a pipe of
    /// no stated width a sentence stays on its line, where `grep` finds it.
    pub fn say(&self, text: impl AsRef<str>) {
        if !self.json && !self.within {
            match columns() {
                Some(width) => print(&crate::report::prose::wrapped(text.as_ref(), width)),
                None => print(text.as_ref()),
            }
        }
    }

    /// A line that must stay as it is: what a person copies into a shell or a file.
    pub fn say_as_it_is(&self, text: impl AsRef<str>) {
        if !self.json && !self.within {
            print(text.as_ref());
        }
    }

    /// The answer as one JSON object, when it was asked for.
    pub fn answer(&self, value: &impl serde::Serialize) {
        if self.json && !self.within {
            let text = serde_json::to_string_pretty(value).unwrap_or_else(|e| format!("{{\"error\": \"{e}\"}}"));
            print(&text);
            ANSWERED.store(true, Ordering::Relaxed);
        }
    }

    /// Findings to stderr, each with its place and remedy; of very many the first ones.
    pub fn report(&self, findings: &[Finding]) {
        let findings = shown(findings);
        for finding in &findings {
            let place = finding.place().map(|p| format!("{p}: ")).unwrap_or_default();
            let word = match finding.severity {
                Severity::Error => "error",
                Severity::Warning => "warning",
                Severity::Info => "note",
            };
            let mut err = std::io::stderr();
            // one line that tools can read (file:line:column), then the picture for the person
            let _ = writeln!(err, "{place}{word}: {}", finding.message);
            if finding.source.is_some() && finding.span.as_ref().is_some_and(|s| !s.is_empty()) {
                let mut text = String::new();
                let handler = miette::NarratableReportHandler::new();
                let graphical = miette::GraphicalReportHandler::new().with_width(100);
                let drawn = if std::env::var_os("NO_COLOR").is_some() || !std::io::IsTerminal::is_terminal(&err) {
                    handler.render_report(&mut text, &Bare(finding))
                } else {
                    graphical.render_report(&mut text, &Bare(finding))
                };
                if drawn.is_ok() && std::io::IsTerminal::is_terminal(&err) {
                    let _ = write!(err, "{text}");
                }
            }
            if let Some(help) = &finding.help {
                let _ = writeln!(err, "  help: {help}");
            }
        }
    }

    /// Prints what failed and gives the exit code.
    #[must_use]
    pub fn finish(&self, answer: Result<Answer>) -> ExitCode {
        let lost = std::io::stdout().flush().err().filter(|e| e.kind() != ErrorKind::BrokenPipe).is_some();
        if lost || OUTPUT_LOST.load(Ordering::Relaxed) {
            let _ = writeln!(std::io::stderr(), "error: the answer could not be written to stdout: is the disk full?");
            return ExitCode::from(2);
        }
        match answer {
            Ok(Answer::Done) => ExitCode::SUCCESS,
            Ok(Answer::No) => ExitCode::from(1),
            Err(Failure(findings)) => {
                self.report(&findings);
                // one object on stdout, whatever comes of the call
                if !ANSWERED.load(Ordering::Relaxed) {
                    let findings: Vec<serde_json::Value> = shown(&findings).iter().map(finding_record).collect();
                    self.answer(&serde_json::json!({ "format": "axiscal-failure/1", "findings": findings }));
                }
                ExitCode::from(2)
            }
        }
    }
}

/// A finding without its help: that is printed on its own line.
#[derive(Debug)]
struct Bare<'a>(&'a Finding);

impl std::fmt::Display for Bare<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.0.message)
    }
}
impl std::error::Error for Bare<'_> {}
impl miette::Diagnostic for Bare<'_> {
    fn severity(&self) -> Option<miette::Severity> {
        self.0.severity()
    }
    fn source_code(&self) -> Option<&dyn miette::SourceCode> {
        self.0.source_code()
    }
    fn labels(&self) -> Option<Box<dyn Iterator<Item = miette::LabeledSpan> + '_>> {
        self.0.labels()
    }
}

impl Environment for Io {
    fn remark(&self, findings: &[Finding]) {
        self.report(findings);
    }
}

/// `--machines FILE`, shared by every verb that names a machine.
#[derive(Debug, Clone, clap::Args)]
pub struct MachineArgs {
    /// Name of the machine (`axiscal machines` lists them)
    #[arg(long, short)]
    pub machine: String,
    /// A machines.toml of your own (default: the one built in)
    #[arg(long, value_name = "FILE")]
    pub machines: Option<PathBuf>,
}

impl MachineArgs {
    /// The machine that is meant.
    ///
    /// # Errors
    /// When the file is unusable or has no machine of that name.
    pub fn load(&self, io: &Io) -> Result<Machine> {
        load_machine(&self.machine, self.machines.as_deref(), io)
    }
}
