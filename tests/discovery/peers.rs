//! The same cases for other methods: `benches/discovery/peers.py` reads them.

use super::bench::{Act, Bench};
use super::faults;
use super::judge;
use axiscal::diagnose::candidate_effects::Named;
use axiscal::diagnose::evidence::Evidence;
use axiscal::fit::Fit;
use axiscal::model::catalogue::Catalogue;
use axiscal::search::Search;
use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::io::Write;
use std::path::Path;

/// What a set of cases is.
#[derive(Debug, Clone, Copy)]
pub struct Cases {
    pub name: &'static str,
    /// Is a fault there at all?
    pub faulty: bool,
    pub conditions: judge::Conditions,
}

/// Writes cases: a line of JSON, then the rows of the regression without what the base model follows, 32-bit floats, the residual
/// first and a column for each parameter of each candidate (with the shape that fits best) behind it, each column after the other.
pub fn write(benches: &[Bench], cases: &Cases, count: usize, seed: u64, folder: &Path) {
    std::fs::create_dir_all(folder).unwrap();
    let mut written = 0;
    let mut drawn = 0u64;
    while written < count {
        let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_mul(1_000_003).wrapping_add(drawn));
        let bench = &benches[drawn as usize % benches.len()];
        drawn += 1;
        let base = bench.ordinary(&mut rng);
        let visit_um = cases.conditions.visit_um;
        let (acts, expects): (Vec<Box<Act>>, Vec<String>) = if cases.faulty {
            let fault = faults::draw(bench, &mut rng);
            let peak_um = rng.random_range(3.0..10.0);
            let Some((size, _)) = judge::sized(bench, &base, &fault, cases.conditions, peak_um) else { continue };
            (vec![fault.at_size(size)], fault.expects.clone())
        } else {
            (Vec::new(), Vec::new())
        };
        let all: Vec<&Act> = std::iter::once(&*base).chain(acts.iter().map(|a| &**a)).collect();
        let touches = bench.measure(&all, 1.0, visit_um, true, &mut rng);
        let (fit, settings) = judge::fit(bench, &touches, &[]);
        let d = judge::ask(bench, &fit, &settings);
        let named = d.verdict.is_missing_effect() || d.in_question().is_some();
        let groups = judge::groups(&d);
        let (effects, data) = rows(bench, &fit, visit_um);
        let evidence = Evidence::with_visits(&fit, visit_um / 1000.0);
        let line = serde_json::json!({
            "cases": cases.name, "bench": bench.name, "expects": expects, "rows": data.nrows(), "effects": effects,
            "visits": evidence.visits, "base": evidence.base.rank(), "axiscal": if named { groups } else { Vec::new() },
            "verdict": d.verdict.as_str(),
        });
        let mut file = std::fs::File::create(folder.join(format!("{}-{written:03}.case", cases.name))).unwrap();
        writeln!(file, "{line}").unwrap();
        let bytes: Vec<u8> = data.iter().flat_map(|x| (*x as f32).to_le_bytes()).collect();
        file.write_all(&bytes).unwrap();
        written += 1;
    }
}

/// The effect of each column, and the columns behind the residual.
fn rows(bench: &Bench, fit: &Fit, visit_um: f64) -> (Vec<String>, DMatrix<f64>) {
    let catalogue = Catalogue::built_in().unwrap();
    let evidence = Evidence::with_visits(fit, visit_um / 1000.0);
    let named = Named::for_fit(fit, &evidence, &bench.machine, &catalogue);
    let search = Search::new(evidence.question(), &named.library);
    let mut effects = Vec::new();
    let mut columns = vec![evidence.base.project(&evidence.residual)];
    for (c, effect) in named.effects.iter().enumerate().filter(|(c, _)| search.scores[*c].visible()) {
        let left = evidence.base.project_columns(&search.columns(c));
        for column in left.column_iter().filter(|column| column.norm() > 1e-3) {
            effects.push(effect.id.clone());
            columns.push(column.into_owned());
        }
    }
    (effects, DMatrix::from_columns(&columns))
}
