//! NC programs of every dialect that `check` reads.
#![no_main]
mod common;

use axiscal::check;
use axiscal::diag::{Source, source};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let program = source("fuzz", text);
    for post in common::POSTS.iter().filter(|p| p.check.is_some()) {
        // the text as a mask of FN 16 as well
        let beside: Vec<(String, Source)> =
            check::wanted_beside(post, &program).into_iter().map(|name| (name, program.clone())).collect();
        if let Err(failure) = check::grammar(post, &program, &beside) {
            assert!(!failure.0.is_empty());
            for finding in failure.0.iter().filter(|f| f.span.is_some()) {
                let span = finding.span.clone().expect("filtered");
                assert!(span.start <= span.end && span.end <= text.len());
                assert!(text.is_char_boundary(span.start) && text.is_char_boundary(span.end));
            }
        }
    }
});
