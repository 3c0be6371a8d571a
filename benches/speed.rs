//! Times of the rooms on the way from a log to an answer: `cargo bench --bench speed`.
//!
//! Touches x unknowns as in `benches/peers/README.md`. As `cargo test` calls it, everything runs once at small size.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a benchmark that cannot run says where
#![allow(missing_docs)] // of what the macros write

mod problems;

use axiscal::fit;
use axiscal::log::{self, Writer};
use axiscal::model::predict::Model;
use axiscal::post::{LogRecord, Postprocessor};
use criterion::{BatchSize, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use problems::{Problem, SIGMA_MM};
use std::hint::black_box;
use std::time::Duration;

/// Problems of every size; small ones only where nothing is timed.
fn each(mut with: impl FnMut(Problem, u64, usize)) {
    let timed = std::env::args().any(|a| a == "--bench");
    for n_touches in [356, 10_000, 100_000] {
        for n_unknowns in [15, 60, 120] {
            if timed || n_touches == 356 {
                with(Problem::new(n_touches, n_unknowns, SIGMA_MM), n_touches as u64, n_unknowns);
            }
        }
    }
}

fn model(problem: &Problem) -> Model {
    let effects = fit::effects_of(&problem.effects, &problem.catalogue, &problem.machine).unwrap();
    Model::new(&problem.machine, &effects, &problem.data().set_ups, problem.machine.reference.pivot)
}

/// Gaps of all touches.
fn prediction(c: &mut Criterion) {
    let mut group = c.benchmark_group("prediction");
    each(|problem, n_touches, n_unknowns| {
        let (data, model) = (problem.data(), model(&problem));
        let (theta, mut scratch) = (model.start(), model.scratch());
        group.throughput(Throughput::Elements(n_touches));
        group.bench_function(BenchmarkId::new(n_touches.to_string(), n_unknowns), |b| {
            b.iter(|| data.observations.iter().map(|o| model.gap(o, &theta, &mut scratch)).sum::<f64>());
        });
    });
}

/// Gaps of all touches and their derivatives by all unknowns.
fn jacobian(c: &mut Criterion) {
    let mut group = c.benchmark_group("jacobian");
    each(|problem, n_touches, n_unknowns| {
        let (data, model) = (problem.data(), model(&problem));
        let (theta, mut scratch) = (model.start(), model.scratch());
        let mut row = vec![0.0; n_unknowns];
        group.throughput(Throughput::Elements(n_touches));
        group.bench_function(BenchmarkId::new(n_touches.to_string(), n_unknowns), |b| {
            b.iter(|| {
                for o in &data.observations {
                    black_box(model.gap_and_row(o, &theta, &mut scratch, &mut row));
                }
            });
        });
    });
}

/// From the touches in memory to the answer, with everything that `identify` says of them.
fn whole_fit(c: &mut Criterion) {
    let mut group = c.benchmark_group("fit");
    group.sample_size(10).measurement_time(Duration::from_secs(3));
    each(|problem, n_touches, n_unknowns| {
        let (data, settings) = (problem.data(), problem.settings());
        group.throughput(Throughput::Elements(n_touches));
        group.bench_function(BenchmarkId::new(n_touches.to_string(), n_unknowns), |b| {
            b.iter_batched(
                || data.clone(),
                |data| fit::identify_data(&problem.machine, &problem.catalogue, data, &settings).unwrap(),
                BatchSize::LargeInput,
            );
        });
    });
}

/// A controller's log to touches that are matched to the plan.
fn parse(c: &mut Criterion) {
    let mut group = c.benchmark_group("parse");
    let (post, _) = Postprocessor::load_built_in_or_file("linuxcnc").unwrap();
    each(|problem, n_touches, n_unknowns| {
        if n_unknowns != 15 {
            return; // a log knows no unknowns
        }
        let Problem { machine, plan, touches, .. } = &problem;
        let records: Vec<LogRecord> =
            touches.iter().map(|t| LogRecord { id: t.id, status: t.status, position: t.position }).collect();
        let text = post.log_text(machine, plan, &records);
        group.throughput(Throughput::Bytes(text.len() as u64));
        group.bench_function(n_touches.to_string(), |b| {
            b.iter(|| log::read(text.as_bytes(), "run.log", Writer::Controller(&post), machine, plan).unwrap());
        });
    });
}

criterion_group!(benches, prediction, jacobian, whole_fit, parse);
criterion_main!(benches);
