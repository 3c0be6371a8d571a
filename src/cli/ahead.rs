//! What begins before the call is read: `identify` is called often, and takes a few milliseconds.

use crate::model::catalogue::Catalogue;
use std::time::{Duration, Instant};

/// For so long another thread waits without resting for what it is given: to wake a processor takes longer than most of what it is
/// woken for.
const AWAKE: Duration = Duration::from_millis(10);

/// What `identify` needs of the catalogue takes as long to read as the call itself and the files that it names: another thread
/// begins at once. Is it called?
pub fn of_identify() -> bool {
    let typed: Vec<_> = std::env::args_os().skip(1).collect();
    // the verb is the first word that is no option: none of those before it takes a value
    let verb = typed.iter().find(|word| !word.to_string_lossy().starts_with('-'));
    let is_called = verb.is_some_and(|verb| verb == "identify");
    if is_called && !typed.iter().any(|word| word == "--quick") {
        // a fit waits for nobody but its own parts: this thread works with the others instead of beside them, so that no more run
        // than there are processors. Nobody can have made a pool before: if one stood, it would stay. The first of the others reads as
        // it starts: a job would find it asleep
        let begin = |thread| {
            if thread == 1 {
                // a fault would end the process here; who needs what is read meets it again, and says so
                let _ = std::panic::catch_unwind(read_and_wait);
            }
        };
        let _ = rayon::ThreadPoolBuilder::new().use_current_thread().start_handler(begin).build_global();
    }
    is_called
}

fn read_and_wait() {
    // the C library lets the heap of such a thread grow page by page, each with a call to the system that keeps the others from
    // their memory; what it had once it has again without one: a few large pieces first
    std::hint::black_box([(); 12].map(|()| Vec::<u8>::with_capacity(130_000)));
    let start = Instant::now();
    // between them it helps whoever has something to do
    Catalogue::read_rows(|| {
        rayon::yield_now();
    });
    while start.elapsed() < AWAKE {
        if rayon::yield_now() != Some(rayon::Yield::Executed) {
            std::thread::yield_now();
        }
    }
}
