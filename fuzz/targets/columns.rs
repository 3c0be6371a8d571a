//! Logs of nothing but columns, matched by place.
#![no_main]
mod common;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    for post in common::POSTS.iter().filter(|p| p.log.columns.is_some()) {
        if let Ok((parsed, _)) = axiscal::log::parse(data, "fuzz", post) {
            common::sound(data, &parsed);
        }
        common::matched(data, axiscal::log::Writer::Controller(post));
    }
});
