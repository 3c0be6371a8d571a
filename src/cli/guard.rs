//! A fault of the program itself ends the call like any other failure: one line, exit code 2, and no half-written file.

use crate::diag::{Failure, Result};
use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind, set_hook};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

/// The first fault, as it was seen: on whatever thread.
static FIRST: Mutex<Option<String>> = Mutex::new(None);

/// Set where a fault does not end the process: it is then said when it happens.
static AT_ONCE: AtomicBool = AtomicBool::new(false);

/// From here on faults are kept for [`guarded`] instead of printed.
pub(super) fn listen() {
    set_hook(Box::new(|info| {
        let fault = fault(info);
        if AT_ONCE.load(Ordering::Relaxed) {
            use std::io::Write;
            let _ = writeln!(std::io::stderr(), "error: {}", says(&fault));
        }
        FIRST.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(fault);
    }));
}

/// For a verb that goes on after a fault in one of its parts.
pub(super) fn say_at_once() {
    AT_ONCE.store(true, Ordering::Relaxed);
}

/// A verb whose fault is a failure.
pub(super) fn guarded<T>(verb: impl FnOnce() -> Result<T>) -> Result<T> {
    // nothing of the verb is used afterwards: its files are written whole or not at all
    catch_unwind(AssertUnwindSafe(verb)).unwrap_or_else(|_| {
        let fault = FIRST.lock().unwrap_or_else(PoisonError::into_inner).take();
        Err(Failure::new("internal::panic", says(&fault.unwrap_or_default())))
    })
}

/// Place and message.
fn fault(info: &PanicHookInfo<'_>) -> String {
    let place = info.location().map(|at| format!("{}:{}", at.file(), at.line())).unwrap_or_default();
    // a message of several lines would look like several findings
    let payload = info.payload();
    let message =
        payload.downcast_ref::<&str>().copied().or_else(|| payload.downcast_ref::<String>().map(String::as_str));
    let message: Vec<&str> = message.unwrap_or("no message").split_whitespace().collect();
    format!("{place}: {}", message.join(" "))
}

fn says(fault: &str) -> String {
    // words that are no text must not be a fault of their own
    let call: Vec<String> = std::env::args_os().skip(1).map(|word| word.to_string_lossy().into_owned()).collect();
    format!(
        "internal error in `axiscal {}` at {fault}; please report this line together with the files of the call",
        call.join(" ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;

    #[test]
    fn a_fault_is_a_failure_and_leaves_no_file() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("out.csv");
        let code = |result: Result<()>| result.unwrap_err().0[0].code;
        let half = || {
            let file = tempfile::NamedTempFile::new_in(dir.path()).unwrap();
            assert!(file.path().exists());
            panic!("while it was written");
        };
        assert_eq!(code(guarded(half)), "internal::panic");
        // on another thread
        let elsewhere = || {
            (0..64).into_par_iter().for_each(|i| assert!(i != 40, "in a part"));
            crate::files::write_whole(&out, b"done")
        };
        assert_eq!(code(guarded(elsewhere)), "internal::panic");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
        assert_eq!(guarded(|| Ok(1)).unwrap(), 1);
    }
}
