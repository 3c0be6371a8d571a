//! Touches in the project's own form.
#![no_main]
mod common;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| common::matched(data, axiscal::log::Writer::Csv));
