//! The search on a real machine's measurements with a published answer: 44 pointings of the Rubin Auxiliary Telescope
//! (tstn-014 of lsst-tstn, © 2020 AURA, CC BY 4.0). The data stand beside the project and are not part of it.

use axiscal::search::held_out::{Choice, held_out};
use axiscal::search::{Basis, KEPT, Library, Origin, Question, Search};
use nalgebra::{DMatrix, DVector};
use std::path::PathBuf;

const ARCSEC_PER_DEG: f64 = 3600.0;

/// Azimuth and elevation, rad; differences to the encoders, arcsec.
struct Pointing {
    azimuth: f64,
    elevation: f64,
    d_azimuth: f64,
    d_elevation: f64,
}

fn pointings() -> Option<Vec<Pointing>> {
    let root = std::env::var_os("AXISCAL_SHARED_DATA")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/data"), PathBuf::from);
    let file = root.join("auxtel/2020-03-14.dat");
    let Ok(text) = std::fs::read_to_string(&file) else {
        let missing = format!("left out: {} is not there (AXISCAL_SHARED_DATA names another place)", file.display());
        assert!(std::env::var_os("AXISCAL_REQUIRE_SHARED_DATA").is_none(), "{missing}");
        println!("{missing}");
        return None;
    };
    let number = |word: &str| word.parse::<f64>().ok();
    let rows = text.lines().filter_map(|line| {
        let fields: Vec<f64> = line.split_whitespace().map_while(number).collect();
        let [az, el, az_encoder, el_encoder, _rotator] = fields[..] else { return None };
        let wrap = |d: f64| (d + 180.0).rem_euclid(360.0) - 180.0;
        Some(Pointing {
            azimuth: az.to_radians(),
            elevation: el.to_radians(),
            d_azimuth: wrap(az_encoder - az) * ARCSEC_PER_DEG,
            d_elevation: (el_encoder - el) * ARCSEC_PER_DEG,
        })
    });
    Some(rows.collect())
}

/// Two rows per pointing: across (azimuth × cos elevation) and along elevation.
fn column(data: &[Pointing], term: impl Fn(&Pointing) -> (f64, f64)) -> DVector<f64> {
    DVector::from_iterator(2 * data.len(), data.iter().flat_map(|p| <[f64; 2]>::from(term(p))))
}

fn term(data: &[Pointing], name: &str) -> DVector<f64> {
    column(data, |p| {
        let (sin_az, cos_az) = p.azimuth.sin_cos();
        let (sin_el, cos_el) = p.elevation.sin_cos();
        match name {
            "IA" => (cos_el, 0.0),
            "IE" => (0.0, 1.0),
            "AN" => (sin_az * sin_el, cos_az),
            "AW" => (cos_az * sin_el, -sin_az),
            "CA" => (1.0, 0.0),
            "NPAE" => (sin_el, 0.0),
            "TF" => (0.0, cos_el),
            "TX" => (0.0, cos_el / sin_el),
            _ => panic!("{name}"),
        }
    })
}

fn model(data: &[Pointing], names: &[&str]) -> Basis {
    Basis::new(&DMatrix::from_columns(&names.iter().map(|n| term(data, n)).collect::<Vec<_>>()))
}

fn named(data: &[Pointing]) -> Library {
    let mut library = Library::new(2 * data.len());
    for name in ["CA", "NPAE", "TF", "TX"] {
        let c = term(data, name);
        library.push(name, Origin::Catalogue, &DMatrix::from_columns(&[c]));
    }
    library
}

/// sin and cos of k·El and k·Az up to k = 9, on either residual: the repertoire that over-fits.
fn harmonics(data: &[Pointing], library: &mut Library) {
    for k in 1..=9 {
        for (axis, word) in [("Az", "A"), ("El", "E")] {
            for on in ["S", "E"] {
                for sine in [true, false] {
                    let c = column(data, |p| {
                        let x = f64::from(k) * if axis == "Az" { p.azimuth } else { p.elevation };
                        let value = if sine { x.sin() } else { x.cos() };
                        if on == "S" { (value, 0.0) } else { (0.0, value) }
                    });
                    let name = format!("H{on}{}{word}{k}", if sine { "S" } else { "C" });
                    library.push(name, Origin::Generic, &DMatrix::from_columns(&[c]));
                }
            }
        }
    }
}

fn id(library: &Library, candidate: usize) -> &str {
    &library.candidates()[candidate].id
}

const TILT: [&str; 4] = ["IA", "IE", "AN", "AW"];

#[test]
fn published_ladder_and_the_pair_that_cannot_be_told_apart() {
    let Some(data) = pointings() else { return };
    assert_eq!(data.len(), 44);
    let r = column(&data, |p| (p.d_azimuth * p.elevation.cos(), p.d_elevation));
    let rms = |names: &[&str]| (model(&data, names).project(&r).norm_squared() / data.len() as f64).sqrt();
    let with = |more: &[&'static str]| [&TILT[..], more].concat();
    for (names, arcsec) in [
        (with(&[]), 32.05),
        (with(&["CA"]), 23.96),
        (with(&["CA", "NPAE"]), 23.86),
        (with(&["CA", "NPAE", "TF"]), 19.56),
        (with(&["CA", "NPAE", "TF", "TX"]), 18.47),
        (with(&["NPAE"]), 23.88),
        (with(&["TF"]), 29.02),
    ] {
        assert!((rms(&names) - arcsec).abs() < 0.005, "{names:?}: {}", rms(&names));
    }

    // the first finding is the pair, not a name
    let library = named(&data);
    let base = model(&data, &TILT);
    let question = Question { residual: &r, base: &base, pure: None };
    let search = Search::new(question, &library);
    let groups = search.groups(3);
    let mut first: Vec<&str> = groups[0].members.iter().map(|m| id(&library, m.candidate)).collect();
    first.sort_unstable();
    assert_eq!(first, ["CA", "NPAE"]);
    assert!(groups[0].members.iter().all(|m| m.separation < 25.0));
    assert!(search.scores[groups[0].leader].proposed());

    // with CA in, TF goes before NPAE, and NPAE says nothing
    let base = model(&data, &with(&["CA"]));
    let search = Search::new(Question { residual: &r, base: &base, pure: None }, &library);
    let order: Vec<&str> = search.ranking().into_iter().map(|c| id(&library, c)).collect();
    let at = |name: &str| order.iter().position(|o| *o == name);
    assert_eq!(order[0], "TF");
    assert!(at("NPAE").unwrap() > 0 && at("CA").is_none(), "{order:?}");
    let npae = &search.scores[library.position("NPAE").unwrap()];
    let t = npae.estimate[0] / npae.covariance[(0, 0)].sqrt();
    assert!(t.abs() < 1.0 && npae.p > 0.3, "{t}");
    assert!(search.scores[library.position("TF").unwrap()].proposed());
}

#[test]
fn cancelling_harmonics_are_refused_and_the_reason_is_shown() {
    let Some(data) = pointings() else { return };
    let r = column(&data, |p| (p.d_azimuth * p.elevation.cos(), p.d_elevation));
    let mut library = named(&data);
    harmonics(&data, &mut library);
    let base = model(&data, &TILT);
    // a term must also predict an eighth of the sky that had no part in its choice
    let sky: Vec<usize> = data.iter().flat_map(|p| [(p.azimuth.to_degrees() / 45.0) as usize; 2]).collect();
    let (mut basis, mut residual) = (base.clone(), base.project(&r));
    let mut taken: Vec<&str> = Vec::new();
    let shape = loop {
        let now = Question { residual: &residual, base: &basis, pure: None };
        let search = Search::new(now, &library);
        let Some(leader) = search.leader() else { break search.leading_shape().unwrap() };
        assert!(held_out(now, &library, &sky, Choice::Redone).falls());
        let added = search.group_of(leader, &search.ranking()).first();
        taken.push(id(&library, added));
        let mut larger = basis.clone();
        larger.extend(&library.columns(added, 0), KEPT);
        residual = larger.project(&residual);
        basis = larger;
    };
    // which name of the inseparable pair goes first is arbitrary
    assert!(["CA", "NPAE"].contains(&taken[0]), "{taken:?}");
    assert_eq!(taken[1..], ["TF", "TX"]);

    // what is left goes with the elevation, and it is said; but a shape without a cause is not taken
    let (index, end) = (shape, basis.clone());
    let refused = &Search::new(Question { residual: &residual, base: &end, pure: None }, &library).scores[index];
    let shape = id(&library, index);
    assert!(shape.starts_with("HE") && shape.contains('E') && refused.p_adjusted < 1e-6, "{shape}");
    println!(
        "not taken: {shape}, {:.0} arcsec, p {:.0e}: a shape without a cause",
        refused.estimate[0], refused.p_adjusted
    );

    // were that one shape accepted, the published companions of it have nothing left to explain ...
    let published = ["HESE5", "HECE7", "HESE8"];
    let position = |name: &str| library.position(name).unwrap();
    let mut basis = end.clone();
    basis.extend(&library.columns(index, 0), KEPT);
    let accepted = Search::new(Question { residual: &residual, base: &basis, pure: None }, &library);
    assert!(accepted.leader().is_none() && accepted.leading_shape().is_none());
    // ... and sizes of hundreds of arcsec come only out of many harmonics next to each other, which cancel
    let mut crowd = end.clone();
    for k in 1..=9 {
        for name in [format!("HESE{k}"), format!("HECE{k}")].iter().filter(|n| !published.contains(&n.as_str())) {
            crowd.extend(&library.columns(position(name), 0), KEPT);
        }
    }
    let crowded = Search::new(Question { residual: &residual, base: &crowd, pure: None }, &library);
    for name in published.iter().filter(|n| **n != shape) {
        let (alone, among) = (&accepted.scores[position(name)], &crowded.scores[position(name)]);
        println!(
            "{name}: {:+.0} ± {:.0} arcsec, p {:.2}, over all tests {:.2}; next to all other harmonics of elevation it keeps {:.3} of its trace",
            alone.estimate[0],
            alone.covariance[(0, 0)].sqrt(),
            alone.p,
            alone.p_adjusted,
            among.kept
        );
        assert!(!alone.proposed() && alone.estimate[0].abs() < 100.0);
        assert!(among.kept < 0.1 * alone.kept, "{} {}", alone.kept, among.kept);
    }
}
