//! Gross mistakes, tried first where the error is far beyond anything that a machine has: a sign, two axes taken for each
//! other, inches, a log that belongs to another program.

use super::Subject;
use super::answer::{Candidate, Gross, Parameter};
use crate::axes::AxisName;
use crate::fit::{Knowledge, Settings, identify_data};
use crate::log::LogMistake;
use crate::model::data::Data;
use crate::units::mm_from_inch;
use crate::words::diagnose as words;
use rayon::prelude::*;

/// Above this RMS something is wrong that is no error of a machine, µm.
pub const GROSS_UM: f64 = 50.0;

/// A supposition that leaves less than this share of the error is right.
pub(crate) const RIGHT: f64 = 0.1;

/// Effect of the catalogue whose parameters are the suppositions.
pub const EFFECT: &str = "sign-or-axis-swap";

/// The supposition that the log belongs to something else.
pub(super) const ELSEWHERE: &str = "another-program";

/// All suppositions with the error that they leave, best first.
#[must_use]
pub fn hypotheses(subject: Subject) -> Vec<Gross> {
    let mut out = signs_and_swaps(subject);
    out.extend(units(subject));
    out.extend(elsewhere(subject));
    out.sort_by(|a, b| a.rms_um.total_cmp(&b.rms_um));
    out
}

fn settings(subject: Subject) -> Settings {
    let mut settings = subject.settings.clone();
    settings.quick = true;
    settings
}

fn signs_and_swaps(subject: Subject) -> Vec<Gross> {
    let Some(effect) = subject.catalogue.get(EFFECT, subject.machine) else { return Vec::new() };
    if subject.settings.effects.iter().any(|e| e == EFFECT) {
        return Vec::new();
    }
    effect
        .parameters
        .par_iter()
        .filter_map(|supposed| {
            let mut settings = settings(subject);
            settings.effects.push(EFFECT.to_owned());
            for p in &effect.parameters {
                let value = if p.name == supposed.name { 1.0 } else { 0.0 };
                settings.knowledge.insert(p.name.clone(), Knowledge::Fixed(value));
            }
            let fit = identify_data(subject.machine, subject.catalogue, subject.fit.data.clone(), &settings).ok()?;
            Some(Gross {
                hypothesis: supposed.name.clone(),
                says: words::catalogue_mistake(&supposed.name),
                rms_um: fit.outcome.rms_um,
                agrees: None,
                in_place: None,
            })
        })
        .collect()
}

/// Lengths in the other unit.
fn units(subject: Subject) -> Vec<Gross> {
    [(LogMistake::Inches, mm_from_inch(1.0)), (LogMistake::Millimetres, 1.0 / mm_from_inch(1.0))]
        .into_par_iter()
        .filter_map(|(mistake, factor)| {
            let data = scaled(&subject.fit.data, factor);
            let fit = identify_data(subject.machine, subject.catalogue, data, &settings(subject)).ok()?;
            let rms_um = fair(fit.outcome.rms_um, factor, subject.fit.outcome.rms_um);
            Some(Gross {
                hypothesis: mistake.name(),
                says: words::log_mistake(&mistake),
                rms_um,
                agrees: None,
                in_place: None,
            })
        })
        .collect()
}

/// Dividing all lengths by 25.4 divides every error by 25.4, whatever is wrong. What is left is therefore measured in the
/// scaled noise; only where it is still next to nothing then is the supposition true, and the RMS what it says.
fn fair(rms_um: f64, factor: f64, now_um: f64) -> f64 {
    let as_it_was_um = rms_um / factor.min(1.0);
    if as_it_was_um < RIGHT * now_um { rms_um } else { as_it_was_um }
}

fn scaled(data: &Data, factor: f64) -> Data {
    let mut data = data.clone();
    for o in &mut data.observations {
        for axis in AxisName::ALL.into_iter().filter(|a| !a.is_rotary()) {
            let value = o.position.get(axis) * factor;
            o.position.set(axis, value);
            o.state[axis.index()] = value;
        }
    }
    data
}

/// Touches that lie nowhere near their plan: where no sign, swap or unit helps, the log belongs to something else.
fn elsewhere(subject: Subject) -> Option<Gross> {
    const FAR_MM: f64 = 5.0;
    let data = &subject.fit.data;
    let off = |i: usize| {
        let (a, b) = (&data.observations[i].position, &data.nominal[i].position);
        (a.xyz_mm() - b.xyz_mm()).norm()
    };
    let n = data.observations.len();
    let mut by: Vec<f64> = (0..n).map(off).collect();
    by.sort_by(f64::total_cmp);
    let median = by.get(n / 2).copied().unwrap_or(0.0);
    (median > FAR_MM).then(|| Gross {
        hypothesis: ELSEWHERE.to_owned(),
        says: format!(
            "half of the touches are more than {median:.0} mm from their planned positions: the log belongs to another program or \
             machine, or the origin is another one"
        ),
        rms_um: subject.fit.outcome.rms_um,
        agrees: None,
        in_place: None,
    })
}

/// What the reading of the logs supposes where touches lie far from their places.
pub(super) fn of_log(subject: Subject) -> Option<Gross> {
    let s = subject.fit.data.supposed.as_ref()?;
    Some(Gross {
        hypothesis: s.mistake.name(),
        says: words::log_mistake(&s.mistake),
        rms_um: subject.fit.outcome.rms_um,
        agrees: None,
        in_place: Some(s.right as f64 / s.of.max(1) as f64),
    })
}

/// Suppositions that hits and misses speak for alike, as one candidate without a size.
pub(super) fn of_misses(subject: Subject, alike: &[&Gross]) -> Option<Candidate> {
    let mut out = candidate(subject, alike.first()?)?;
    out.name = alike.iter().map(|g| g.says.as_str()).collect::<Vec<_>>().join(", or ");
    // nothing was fitted with it, and nothing is to be added before the touches are made again
    (out.proposed, out.remains, out.share) = (false, None, 0.0);
    if alike.len() > 1 {
        out.parameters.clear();
        out.not_told = alike.iter().map(|g| g.hypothesis.clone()).collect();
    }
    Some(out)
}

/// A supposition of the catalogue as a candidate.
pub(super) fn candidate(subject: Subject, gross: &Gross) -> Option<Candidate> {
    let effect = subject.catalogue.get(EFFECT, subject.machine)?;
    effect.parameters.iter().find(|p| p.name == gross.hypothesis)?;
    Some(Candidate {
        effect: effect.id.clone(),
        name: gross.says.clone(),
        proposed: true,
        rms_after_um: gross.rms_um,
        parameters: vec![Parameter { name: gross.hypothesis.clone(), value: 1.0, unit: "1".into(), sigma: None }],
        says: effect.says.clone(),
        look: effect.look.clone(),
        share: 1.0 - (gross.rms_um / subject.fit.outcome.rms_um).powi(2),
        times_usual: 1.0,
        plausible: true,
        remains: Some(gross.rms_um > GROSS_UM),
        ..Candidate::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inches_do_not_win_by_shrinking_everything() {
        // an axis the wrong way round: 80 mm; the other unit leaves 1/25.4 of the same error
        let (now, shrunk) = (80_000.0, 80_000.0 / 25.4);
        assert!((fair(shrunk, 1.0 / 25.4, now) - now).abs() < 1.0);
        // and where it is true, the noise is left
        assert!((fair(1.1, 1.0 / 25.4, now) - 1.1).abs() < 1e-12);
        assert!((fair(1.1, 25.4, now) - 1.1).abs() < 1e-12);
        assert!((fair(now * 25.4, 25.4, now) - now * 25.4).abs() < 1e-6);
    }
}
