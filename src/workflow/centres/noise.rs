//! How much a centre scatters: as stated, from the form of fitted spheres, or from poses that were measured again.

use super::points::FittedGroup;
use super::{Centre, at_line};
use crate::diag::{Finding, Findings, Result, Source};
use crate::log::centres::Stated;
use crate::units::{mm_from_um, um_from_mm};
use crate::workflow::new::Beside;

/// Fewer degrees of freedom than this say too little: their 95 % interval for σ spans more than a factor of two.
const LEAST_DOF: usize = 8;

/// Standard deviations that differ by more than this factor are not one.
const ALIKE: f64 = 1.01;

/// What the study states. Where a pose was measured several times one after the other the fit finds the noise by itself.
pub(super) fn of(
    centres: &[Centre],
    stated: &Stated,
    fitted: &[FittedGroup],
    source: &Source,
    findings: &mut Findings,
) -> Result<Beside> {
    let whole = |sigma_mm: f64| Beside { touch_sigma_mm: Some(sigma_mm), visit_sigma_mm: Some(0.0), mounting: None };
    let rows: Vec<f64> = centres.iter().filter_map(|c| c.row.sigma_um).collect();
    let first = centres.first().map_or(1, |c| c.row.line);
    if rows.len() == centres.len() && !rows.is_empty() {
        if stated.sigma_um.is_some() {
            let finding = Finding::error(
                "centres::noise",
                "the noise is stated twice: as sigma_um of the whole file and in a column",
            )
            .help("leave out one of them");
            return Err(at_line(source, first, finding).into());
        }
        let (low, high) = rows.iter().fold((f64::MAX, 0.0_f64), |(l, h), s| (l.min(*s), h.max(*s)));
        let mean = (rows.iter().map(|s| s * s).sum::<f64>() / rows.len() as f64).sqrt();
        if high > ALIKE * low {
            let message = format!(
                "sigma_um is {low} to {high} µm: every centre counts alike, with the root mean square of {mean:.3} µm"
            );
            let finding = Finding::warning("centres::noise", message)
                .help("put centres of very different quality into files of their own");
            findings.push(at_line(source, first, finding));
        }
        return Ok(whole(mm_from_um(mean)));
    }
    if let Some(without) = centres.iter().find(|c| c.row.sigma_um.is_none()).filter(|_| !rows.is_empty()) {
        let finding = Finding::error("centres::noise", "this row has no sigma_um and others have one")
            .help("fill it in, or remove the column");
        return Err(at_line(source, without.row.line, finding).into());
    }
    if let Some(um) = stated.sigma_um {
        return Ok(whole(mm_from_um(um)));
    }
    let immediate: usize = centres.chunk_by(same_pose).map(|g| 3 * (g.len() - 1)).sum();
    if immediate >= LEAST_DOF {
        let message =
            "the noise is not stated: it follows from centres that were measured several times in a row".to_owned();
        findings.push(Finding::info("centres::noise", message));
        return Ok(Beside::default());
    }
    let (sigma_mm, dof, whence) = match again(centres) {
        Some((sigma_mm, dof)) if dof >= LEAST_DOF => (sigma_mm, dof, "poses that were measured again"),
        found => match of_form(fitted) {
            Some((sigma_mm, dof)) if dof >= LEAST_DOF => (sigma_mm, dof, "the residuals of the fitted spheres"),
            _ => {
                let dof = immediate.max(found.map_or(0, |f| f.1));
                let message = format!(
                    "the noise of a centre is not stated, and repeated poses give {dof} degrees of freedom: {LEAST_DOF} are needed"
                );
                let finding = Finding::error("centres::noise", message).help(
                    "add the line `# sigma_um = 1.0` above the header line or give --sigma-um (the standard deviation of each coordinate, \
                     in micrometres), or measure three poses twice",
                );
                return Err(at_line(source, 1, finding).into());
            }
        },
    };
    let message =
        format!("the noise of a centre is {:.3} µm, from {whence} ({dof} degrees of freedom)", um_from_mm(sigma_mm));
    findings.push(
        Finding::info("centres::noise", message)
            .help("write touch_um under [noise] of the study where you know it better"),
    );
    // centres that agree in every digit would divide by nothing
    const LEAST_MM: f64 = 1e-6;
    Ok(whole(sigma_mm.max(LEAST_MM)))
}

fn same_pose(a: &Centre, b: &Centre) -> bool {
    a.row.sphere == b.row.sphere && a.row.run == b.row.run && a.row.rotary == b.row.rotary
}

/// Standard deviation of each coordinate, mm, and degrees of freedom, over all rows of equal pose.
fn again(centres: &[Centre]) -> Option<(f64, usize)> {
    let mut sorted: Vec<&Centre> = centres.iter().collect();
    let key = |c: &Centre| (c.row.run, c.row.sphere.clone(), c.row.rotary.position().0.map(f64::to_bits));
    sorted.sort_by_key(|c| key(c));
    let (mut squares, mut dof) = (0.0, 0);
    for group in sorted.chunk_by(|a, b| same_pose(a, b)) {
        let places = || group.iter().map(|c| c.position.xyz_mm());
        let mean = places().sum::<nalgebra::Vector3<f64>>() / group.len() as f64;
        squares += places().map(|p| (p - mean).norm_squared()).sum::<f64>();
        dof += 3 * (group.len() - 1);
    }
    (dof > 0).then(|| ((squares / dof as f64).sqrt(), dof))
}

/// The same from how far points are off their spheres: the noise of a point, times what it does to a centre.
fn of_form(fitted: &[FittedGroup]) -> Option<(f64, usize)> {
    let squares: f64 = fitted.iter().map(|g| g.fitted.rms.powi(2) * g.n_points as f64).sum();
    let dof: usize = fitted.iter().map(|g| g.n_points.saturating_sub(4)).sum();
    let moved =
        fitted.iter().map(|g| g.fitted.centre_per_noise.norm_squared() / 3.0).sum::<f64>() / fitted.len().max(1) as f64;
    (dof > 0).then(|| ((squares / dof as f64 * moved).sqrt(), dof))
}
