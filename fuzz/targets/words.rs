//! Logs of words (`P N1 S1 X…`), as each controller that is built in spells them.
#![no_main]
mod common;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    for post in common::POSTS.iter() {
        if let Ok((parsed, _)) = axiscal::log::parse(data, "fuzz", post) {
            common::sound(data, &parsed);
        }
        common::matched(data, axiscal::log::Writer::Controller(post));
    }
});
