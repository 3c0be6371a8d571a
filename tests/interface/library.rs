//! The crate as a library: the example of the whole loop.

#[allow(dead_code)] // its `main` is for `cargo run`
#[path = "../../examples/whole_loop.rs"]
mod whole_loop;

#[test]
fn the_error_falls_with_the_effect_that_the_diagnosis_names() {
    let rms_um = whole_loop::run().unwrap();
    assert!(rms_um.len() == 2 && rms_um[1] < 0.5 * rms_um[0] && rms_um[1] < 1.0, "{rms_um:?}");
}
