//! Do errors scatter as their uncertainties say? Full count: `cargo run --release --example coverage [RUNS [VIRTUAL]]`,
//! 5000 runs of each case by default, 500 of them measured by the virtual machine with its own noise. Prints the table
//! of docs/method.md.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // an example ends with what went wrong

#[path = "../tests/common/mod.rs"]
mod common;
#[path = "../tests/common/coverage.rs"]
mod coverage;

fn main() {
    let mut words = std::env::args().skip(1).map(|w| w.parse::<usize>().expect("a number of runs"));
    let runs = words.next().unwrap_or(5000);
    let n_virtual = words.next().unwrap_or(runs / 10);
    let mut wrong = Vec::new();
    for case in &coverage::CASES {
        let begun = std::time::Instant::now();
        let summary = coverage::run(case, runs, n_virtual, 20);
        println!(
            "\n{} {}, {} um per touch, {} um per visit: {} runs, chi2/dof {:.4} ({} degrees of freedom; \
             {:.2} % below and {:.2} % above its 95 %), {:.2} touches of 1000 rejected, tau^2 {:.3} of the true one, {:.1} s",
            case.machine,
            case.programs.join(" + "),
            1e3 * case.sigma_mm,
            1e3 * case.tau_mm,
            runs,
            summary.chi2_per_dof,
            summary.dof,
            100.0 * summary.tails[0],
            100.0 * summary.tails[1],
            summary.rejected_per_mille,
            summary.tau2_ratio,
            begun.elapsed().as_secs_f64()
        );
        println!("| parameter | RMS error / Cramér-Rao bound | inside its 95 % interval |\n|---|---|---|");
        let (set_ups, results): (Vec<_>, Vec<_>) = summary.rows.iter().partition(|r| r.name.contains('@'));
        for row in results {
            println!("| {} | {:.3} | {:.1} % |", row.name, row.ratio, 100.0 * row.covered);
        }
        if !set_ups.is_empty() {
            let count = set_ups.len() as f64;
            println!(
                "| {} set-up unknowns, mean | {:.3} | {:.1} % |",
                set_ups.len(),
                set_ups.iter().map(|r| r.ratio).sum::<f64>() / count,
                100.0 * set_ups.iter().map(|r| r.covered).sum::<f64>() / count
            );
        }
        wrong.extend(coverage::check(case, &summary, 0.0));
    }
    if !wrong.is_empty() {
        eprintln!("outside of the bounds:\n{}", wrong.join("\n"));
        std::process::exit(1);
    }
}
