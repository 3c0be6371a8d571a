//! Times of the rooms on the way from a log to an answer: `cargo bench --bench speed`.
//!
//! Touches x unknowns as in `benches/peers/README.md`. As `cargo test` calls it, everything runs once at small size.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a benchmark that cannot run says where
#![allow(missing_docs)] // of what the macros write

mod problems;

use axiscal::diag::source;
use axiscal::diagnose::candidate_effects::Named;
use axiscal::diagnose::evidence::Evidence;
use axiscal::fit::normal::Touches;
use axiscal::fit::solve::Problem as _;
use axiscal::fit::{self, Settings};
use axiscal::log::{self, Writer};
use axiscal::post::{LogRecord, Postprocessor};
use axiscal::program::plan::Plan;
use criterion::{BatchSize, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::DVector;
use problems::{Problem, SIGMA_MM};
use std::time::Duration;

/// Problems of every size for a group of benchmarks; small ones only where nothing is timed, and none that the first word of
/// the call (criterion's filter) leaves out.
fn each(group: &str, mut with: impl FnMut(Problem, u64, usize)) {
    let timed = std::env::args().any(|a| a == "--bench");
    let filter = std::env::args().skip(1).find(|a| !a.starts_with('-')).unwrap_or_default();
    for n_touches in [356, 10_000, 100_000] {
        for n_unknowns in [15, 60, 120] {
            if (timed || n_touches == 356) && format!("{group}/{n_touches}/{n_unknowns}").contains(&filter) {
                with(Problem::new(n_touches, n_unknowns, SIGMA_MM), n_touches as u64, n_unknowns);
            }
        }
    }
}

/// Gaps of all touches.
fn prediction(c: &mut Criterion) {
    let mut group = c.benchmark_group("prediction");
    each("prediction", |problem, n_touches, n_unknowns| {
        let data = problem.data();
        let model = problem.model(&data);
        let (batch, theta) = (model.prepare(&data.observations), model.start());
        let mut scratch = batch.scratch();
        group.throughput(Throughput::Elements(n_touches));
        group.bench_function(BenchmarkId::new(n_touches.to_string(), n_unknowns), |b| {
            b.iter(|| {
                let at = batch.at(&theta);
                (0..batch.len()).map(|i| at.gap(i, &mut scratch)).sum::<f64>()
            });
        });
    });
}

/// Gaps of all touches and their derivatives with respect to the unknowns that each of them sees.
fn jacobian(c: &mut Criterion) {
    let mut group = c.benchmark_group("jacobian");
    each("jacobian", |problem, n_touches, n_unknowns| {
        let data = problem.data();
        let model = problem.model(&data);
        let (batch, theta) = (model.prepare(&data.observations), model.start());
        let mut scratch = batch.scratch();
        let mut row = vec![0.0; model.layout().row_length(0)];
        group.throughput(Throughput::Elements(n_touches));
        group.bench_function(BenchmarkId::new(n_touches.to_string(), n_unknowns), |b| {
            b.iter(|| {
                let at = batch.at(&theta);
                (0..batch.len()).map(|i| at.gap_and_row(i, &mut scratch, &mut row) + row[0]).sum::<f64>()
            });
        });
    });
}

/// Rank, fit and covariance of touches in memory.
fn whole_fit(c: &mut Criterion) {
    let mut group = c.benchmark_group("fit");
    group.sample_size(10).measurement_time(Duration::from_secs(3));
    each("fit", |problem, n_touches, n_unknowns| {
        let data = problem.data();
        let model = problem.model(&data);
        group.throughput(Throughput::Elements(n_touches));
        group.bench_function(BenchmarkId::new(n_touches.to_string(), n_unknowns), |b| {
            b.iter(|| problems::solve(&model, &data));
        });
    });
}

/// Gram matrix of all touches and its inverse: the covariance where the solution is known.
fn covariance(c: &mut Criterion) {
    let mut group = c.benchmark_group("covariance");
    each("covariance", |problem, n_touches, n_unknowns| {
        let data = problem.data();
        let model = problem.model(&data);
        let batch = model.prepare(&data.observations);
        let free: Vec<usize> = (0..n_unknowns).collect();
        let touches = Touches::new(&batch, &data.visits, model.start(), &free, &[], (SIGMA_MM, 0.0));
        let theta = DVector::from_vec(model.start());
        group.throughput(Throughput::Elements(n_touches));
        group.bench_function(BenchmarkId::new(n_touches.to_string(), n_unknowns), |b| {
            b.iter(|| touches.normal(&theta, true).gram.cholesky().unwrap().inverse());
        });
    });
}

/// All of `identify` on touches in memory: noise, snooping and uncertainty budget too.
fn identify(c: &mut Criterion) {
    let mut group = c.benchmark_group("identify");
    group.sample_size(10).measurement_time(Duration::from_secs(3));
    each("identify", |problem, n_touches, n_unknowns| {
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

/// Columns of everything that the model leaves out: what `diagnose` tests.
fn candidates(c: &mut Criterion) {
    let mut group = c.benchmark_group("candidates");
    group.sample_size(10).measurement_time(Duration::from_secs(3));
    each("candidates", |problem, n_touches, n_unknowns| {
        if n_unknowns != 60 || n_touches > 10_000 {
            return; // one size of a model, and sizes at which somebody waits for a diagnosis
        }
        let settings = Settings { quick: true, ..problem.settings() };
        let fit = fit::identify_data(&problem.machine, &problem.catalogue, problem.data(), &settings).unwrap();
        let evidence = Evidence::from_fit(&fit);
        group.bench_function(BenchmarkId::new(n_touches.to_string(), n_unknowns), |b| {
            b.iter(|| Named::for_fit(&fit, &evidence, &problem.machine, &problem.catalogue));
        });
    });
}

/// A controller's log to touches that are matched to the plan.
fn parse(c: &mut Criterion) {
    let mut group = c.benchmark_group("parse");
    let (post, _) = Postprocessor::load_built_in_or_file("linuxcnc").unwrap();
    each("parse", |problem, n_touches, n_unknowns| {
        if n_unknowns != 15 {
            return; // a log knows no unknowns
        }
        let Problem { machine, plan, touches, .. } = &problem;
        let records: Vec<LogRecord> = touches
            .iter()
            .map(|t| LogRecord { id: t.id, status: t.status, position: t.position, time_s: None })
            .collect();
        let text = post.log_text(machine, plan, &records);
        group.throughput(Throughput::Bytes(text.len() as u64));
        group.bench_function(BenchmarkId::new(n_touches.to_string(), n_unknowns), |b| {
            b.iter(|| log::read(text.as_bytes(), "run.log", Writer::Controller(&post), machine, plan).unwrap());
        });
    });
}

/// A plan's file to a plan: to be compared with the row of as many touches under `fit`.
fn read_plan(c: &mut Criterion) {
    let mut group = c.benchmark_group("read_plan");
    each("read_plan", |problem, n_touches, n_unknowns| {
        if n_unknowns != 60 {
            return; // a plan knows no unknowns, but blocks: those of the middle size
        }
        let text = source("run.plan.json", problem.plan.to_json());
        group.throughput(Throughput::Bytes(text.inner().len() as u64));
        group.bench_function(BenchmarkId::new(n_touches.to_string(), n_unknowns), |b| {
            b.iter(|| Plan::parse(&text).unwrap());
        });
    });
}

criterion_group!(benches, prediction, jacobian, whole_fit, covariance, identify, candidates, parse, read_plan);
criterion_main!(benches);
