//! Do errors scatter as their uncertainties say? Full count: `cargo run --release --example coverage [RUNS [VIRTUAL [NAME]]]`,
//! 5000 runs of each case by default, 500 of them measured by the virtual machine with its own noise. NAME: only the cases whose
//! machine or artefact has it in its name; `scatter`: those with a scatter of index positions that is not as declared. Prints every
//! parameter of each case, and at the end the table of docs/method.md.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // an example ends with what went wrong

#[path = "../tests/common/mod.rs"]
mod common;
#[path = "../tests/common/coverage.rs"]
mod coverage;

fn main() {
    let mut words = std::env::args().skip(1);
    let mut count = || words.next().map(|w| w.parse::<usize>().expect("a number of runs"));
    let runs = count().unwrap_or(5000);
    let n_virtual = count().unwrap_or(runs / 10);
    let name = words.next().unwrap_or_default();
    let wanted =
        |case: &&coverage::Case| [Some(case.machine), case.artefact].into_iter().flatten().any(|n| n.contains(&name));
    let mut wrong = Vec::new();
    let mut table = String::new();
    // the machines' own blocks, then every artefact on every machine
    let mut cases: Vec<coverage::Case> =
        coverage::CASES.iter().chain(&coverage::ARTEFACTS).filter(wanted).cloned().collect();
    if name == "scatter" {
        cases = coverage::scatters();
    }
    for case in &cases {
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
        if let Some([low, high]) = summary.shown_um {
            println!("scatter per visit as the residuals show it: {low:.2} to {high:.2} um in 68 % of the runs");
        }
        println!("| parameter | RMS error / Cramér-Rao bound | inside its 95 % interval |\n|---|---|---|");
        let (set_ups, results): (Vec<_>, Vec<_>) = summary.rows.iter().partition(|r| r.name.contains('@'));
        table += &line(case, &summary, &results);
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
        // with a wrong declared value the bounds do not hold: the table shows how far off the uncertainties are
        if name != "scatter" {
            wrong.extend(coverage::check(case, &summary, 0.0));
        }
    }
    println!(
        "\n| machine, programs, τ | χ²/dof | RMS error / bound | inside its 95 % interval |\n|---|---|---|---|\n{table}"
    );
    if !wrong.is_empty() {
        eprintln!("outside of the bounds:\n{}", wrong.join("\n"));
        std::process::exit(1);
    }
}

/// A case in a line, as docs/method.md has it: results only, no set-ups.
fn line(case: &coverage::Case, summary: &coverage::Summary, results: &[&coverage::Row]) -> String {
    let range = |of: &dyn Fn(&coverage::Row) -> f64| {
        results.iter().map(|r| of(r)).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)))
    };
    let (ratio, covered) = (range(&|r| r.ratio), range(&|r| 100.0 * r.covered));
    let tau_um = axiscal::units::um_from_mm(case.tau_mm);
    let tau = if tau_um.fract() == 0.0 {
        format!("{tau_um:.0}")
    } else {
        format!("{tau_um:.2}").trim_end_matches('0').to_owned()
    };
    // a scatter that neither the study states nor the plan can tell is the declared one
    let declared =
        case.tau_mm > 0.0 && case.stated_tau_mm.is_none() && case.declared_tau_mm.is_none() && !summary.tau_estimated;
    let declares = case
        .declared_tau_mm
        .map_or_else(String::new, |mm| format!(", {:.1} µm declared", axiscal::units::um_from_mm(mm)));
    format!(
        "| {} {}{}, {tau} µm{}{declares}{} | {:.3} | {:.3} … {:.3} over {} results | {:.1} … {:.1} % |\n",
        case.machine,
        case.programs.join(" + "),
        case.artefact.map_or_else(String::new, |a| format!(" with {a}")),
        if declared { ", as the machine's file declares it" } else { "" },
        case.planted.iter().map(|(id, _)| format!(", {id} in machine and model")).collect::<String>(),
        summary.chi2_per_dof,
        ratio.0,
        ratio.1,
        results.len(),
        covered.0,
        covered.1
    )
}
