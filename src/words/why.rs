//! The grounds of the verdict in three lines: the size of the residual, what was looked for, and what unused measurements
//! or the tolerance say.

use super::headline::{named, um};
use crate::diagnose::Verdict;
use crate::diagnose::answer::Candidate;
use crate::diagnose::verdict::{NotNamed, Unexplained};
use crate::view::Material;
use crate::view::record::{Judgement, ParameterRecord};

/// The lines.
pub(crate) fn why(m: &Material, parameters: &[ParameterRecord]) -> Vec<String> {
    let d = m.diagnosis;
    vec![size(m), d.mistake().map_or_else(|| search(m), |mistake| set_up(m, &mistake)), confirmed(m, parameters)]
}

fn size(m: &Material) -> String {
    let d = m.diagnosis;
    if m.fit.dof == 0 {
        return format!(
            "{} touches are used for {} unknowns: no residual remains to judge by.",
            m.fit.n_used(),
            m.fit.free.len()
        );
    }
    let ratio = d.rms_um / d.noise_um;
    let compared = if ratio >= 1.15 {
        format!("{ratio:.1} times the probe noise of {}", um(d.noise_um))
    } else {
        format!("not more than the probe noise of {} explains", um(d.noise_um))
    };
    format!("The residual of {} touches is {} RMS, {compared}.", m.fit.n_used(), um(d.rms_um))
}

/// A set-up mistake comes before every effect.
fn set_up(m: &Material, mistake: &str) -> String {
    let unusable = m.fit.data.unusable.len();
    if unusable > 0 {
        let all = unusable + m.fit.data.observations.len();
        return format!("{unusable} of {all} touches gave no usable reading. It would fit: {mistake}.");
    }
    match m.diagnosis.gross.first() {
        Some(gross) => format!("With the correction of this mistake the residual is {}: {mistake}.", um(gross.rms_um)),
        None => format!("It would fit: {mistake}."),
    }
}

fn search(m: &Material) -> String {
    let d = m.diagnosis;
    let tested = d.tested;
    if tested == 0 {
        return "No effect could be tested with these touches.".to_owned();
    }
    let by_noise = |c: &Candidate| {
        if c.p_adjusted < 1e-4 { "less than 1 in 10 000".to_owned() } else { format!("1 in {:.0}", 1.0 / c.p_adjusted) }
    };
    match (&d.verdict, d.candidates.first()) {
        (Verdict::Unexplained(Unexplained { why: NotNamed::CannotBeConfirmed(open), .. }), _) if open.len() > 1 => {
            let first: Vec<String> = open.iter().take(3).map(|id| named(m, id)).collect();
            format!(
                "{} of {tested} known effects explain it equally well with these poses, for example {}.",
                open.len(),
                first.join("; ")
            )
        }
        (Verdict::MissingEffect(_) | Verdict::Unexplained(_), Some(c)) if c.p_adjusted < 0.05 => {
            let (who, with) = match d.proposed() {
                [first, second] => (format!("{} and {} together explain", first.name, second.name), "both"),
                _ => (format!("{} explains", c.name), "it"),
            };
            format!(
                "Of {tested} known effects, {who} most: {} remain with {with}. Probability by noise alone: {}.",
                um(c.rms_after_um),
                by_noise(c)
            )
        }
        (Verdict::TooLittleData(_), _) => {
            format!("{tested} known effects were tested. These touches are too few to decide.")
        }
        _ => format!("{tested} known effects were tested on the residual. None passes the test."),
    }
}

fn confirmed(m: &Material, parameters: &[ParameterRecord]) -> String {
    let d = m.diagnosis;
    if d.verdict == Verdict::Adequate {
        return tolerance(parameters);
    }
    match d.candidates.first().map(|c| (c.held_out_before_um, c.held_out_after_um)) {
        Some((Some(before), Some(after))) if before > 0.0 || after > 0.0 => format!(
            "At index positions that were left out of the fit the error is {} without {it} and {} with {it}.",
            um(before),
            um(after),
            it = if d.proposed().len() > 1 { "both" } else { "it" }
        ),
        _ => match d.held_out_rms_um {
            Some(error) => format!("At index positions that were left out of the fit the error is {}.", um(error)),
            None => "No index position can be left out of the fit to confirm it: there are too few poses.".to_owned(),
        },
    }
}

/// The result that decides the verdict against its tolerance.
fn tolerance(parameters: &[ParameterRecord]) -> String {
    let ratio = |p: &&ParameterRecord| match (p.tolerance, p.expanded) {
        (Some(limit), Some(doubt)) if limit > 0.0 => (p.value.abs() + doubt) / limit,
        _ => 0.0,
    };
    let worst =
        |judgement| parameters.iter().filter(|p| p.judgement == judgement).max_by(|a, b| ratio(a).total_cmp(&ratio(b)));
    let deciding = [Judgement::Beyond, Judgement::Open, Judgement::Within].into_iter().find_map(worst);
    let Some(p) = deciding else { return "No determined error has a tolerance to compare it with.".to_owned() };
    let digits = |x: f64| crate::report::fit::significant(x);
    let unit = if p.unit == "deg" { "°".to_owned() } else { crate::report::fit::unit(&p.unit) };
    let says = format!(
        "{} is {} ± {} {} (95 %), and its tolerance is {} {}",
        p.name,
        crate::report::fit::digits(p.value, p.sigma),
        p.expanded.map_or_else(String::new, |e| crate::report::fit::digits(e, p.sigma)),
        unit,
        p.tolerance.map_or_else(String::new, digits),
        unit
    );
    match p.judgement {
        Judgement::Beyond => format!("{says}: too large even if the uncertainty is subtracted."),
        Judgement::Open => format!("{says}: the uncertainty includes the limit."),
        _ => format!("{says}: within it even if the uncertainty is added. All others use less of their tolerance."),
    }
}
