//! Inspection results.
#![no_main]
mod common;

use axiscal::log::points::{PointsForm, parse};
use libfuzzer_sys::fuzz_target;
use std::sync::LazyLock;

static FORMS: LazyLock<Vec<PointsForm>> = LazyLock::new(|| PointsForm::built_in().expect("shipped"));

fuzz_target!(|data: &[u8]| {
    for form in FORMS.iter() {
        for run in [None, Some(2)] {
            if let Ok((read, _)) = parse(data, "fuzz", form, run) {
                assert!(!read.points.is_empty());
                assert!(read.points.iter().all(|p| p.in_part(&p.centre).iter().all(|v| !v.is_nan())));
            }
        }
        common::matched(data, axiscal::log::Writer::Points(form));
    }
});
