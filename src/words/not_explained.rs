//! What is said of a residual that no effect explains.

use super::diagnose::{against, candidate_names, plain};
use super::headline::capital;
use crate::diagnose::answer::{Finding, Where};
use crate::diagnose::verdict::{NotNamed, Unexplained};
use crate::diagnose::{Diagnosis, setup_mistakes};
use crate::fit::Fit;

/// On what the residual depends: the first, what goes with it as much, and where the touches lie that are not used.
fn depends_on(d: &Diagnosis) -> String {
    /// Shares that differ by less are equal.
    const AS_MUCH: f64 = 0.03;
    let Some(first) = d.depends.first() else { return String::new() };
    let mut out = first.says.clone();
    let of_touches = |w: &&Where| w.finding == Finding::Outliers;
    // only these have shares of the same sum
    let is_pattern = |w: &Where| matches!(w.finding, Finding::Pattern | Finding::Effect);
    let as_much =
        |w: &&Where| is_pattern(first) && is_pattern(w) && w.by != first.by && w.share > first.share - AS_MUCH;
    let rival = d.depends[1..].iter().find(as_much);
    if let Some(rival) = rival {
        out += &format!(". {} explains as much ({:.0} %)", capital(&plain(&rival.by)), 100.0 * rival.share);
    }
    if let Some(heap) = d.depends[1..].iter().find(of_touches) {
        out += &format!(". {}", heap.says);
    }
    out
}

pub(super) fn not_explained(d: &Diagnosis, unexplained: &Unexplained, fit: &Fit) -> String {
    let depends = &depends_on(d);
    let mistake = d.gross.first().filter(|g| g.rms_um < setup_mistakes::RIGHT * d.rms_um);
    let cause = match mistake {
        Some(mistake) => format!(" Probable cause: {}.", mistake.says),
        None if depends.is_empty() => String::new(),
        None => format!(" {depends}."),
    };
    let missing = format!("Something is missing in the model: {}.", against(d));
    match &unexplained.why {
        NotNamed::WeakPattern => {
            format!(
                "The model fits within the noise: {}. {}. Measure more touches to see whether it is real.",
                against(d),
                weak_pattern(depends)
            )
        }
        NotNamed::Scatter => format!("{depends}. The residual is {}.", against(d)),
        NotNamed::PatternExplainsMore { alone } => {
            let patterns = match alone {
                true => "A pattern that no listed effect explains fits clearly better",
                false => "Several patterns that no listed effect explains fit clearly better together",
            };
            let part = looks_like("it", &candidate_names(d), d.candidates.first().map_or(0.0, |c| c.share));
            format!("{missing} No listed effect explains all of it. {part}. {patterns}.{cause}")
        }
        NotNamed::NotConfirmed => format!(
            "{missing} It may be {}: it passes the test, but unused measurements do not confirm it, so no effect is named.{cause} \
             Measure more index positions to decide.",
            candidate_names(d)
        ),
        NotNamed::CannotBeConfirmed(effects) => match &effects[..] {
            [one] => format!(
                "{missing} One listed effect explains it ({one}), but there are too few poses to confirm it on unused \
                 measurements.{cause}"
            ),
            several => format!(
                "{missing} One of {} listed effects explains it; there are too few poses to decide which. The best match is {}.{cause}",
                several.len(),
                several.first().map_or("", String::as_str)
            ),
        },
        NotNamed::NoEffectPasses => {
            let or = fit.noise.or_the_probe(fit.outcome.chi2_per_dof.sqrt());
            let or = or.map_or_else(String::new, |or| format!(" {or}"));
            format!("{missing} No listed effect explains it.{or}{cause}")
        }
    }
}

/// The pattern that is left within the noise. `depends` says what it depends on, and is empty where nothing was found.
fn weak_pattern(depends: &str) -> String {
    match depends {
        "" => "A weak pattern is left that depends on nothing that these touches show".to_owned(),
        depends => format!("A weak pattern is left: {depends}"),
    }
}

/// What is said where a model with the named effects still fails; one that is named alone may be a part of what acts.
pub(super) fn remains(d: &Diagnosis) -> String {
    match d.proposed() {
        [c] if c.remains == Some(true) => {
            let part = looks_like("the residual", &candidate_names(d), c.share);
            format!(" {part}: something else is missing as well.")
        }
        [first, second] if first.remains == Some(true) => format!(
            " A part of the residual looks like {} and {} together: something else is missing as well.",
            first.effect, second.effect
        ),
        _ => String::new(),
    }
}

/// How much of the residual an effect explains that does not explain all of it.
fn looks_like(what: &str, names: &str, share: f64) -> String {
    let percent = (100.0 * share).round();
    if percent >= 100.0 {
        format!("Nearly all of {what} looks like {names}")
    } else {
        format!("A part of {what} looks like {names} ({percent:.0} %)")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pattern_says_what_it_depends_on_and_a_part_is_less_than_all() {
        assert_eq!(weak_pattern(""), "A weak pattern is left that depends on nothing that these touches show");
        assert_eq!(weak_pattern("40 % depends on C"), "A weak pattern is left: 40 % depends on C");
        assert_eq!(looks_like("it", "radial-a-2", 0.998), "Nearly all of it looks like radial-a-2");
        assert_eq!(looks_like("it", "radial-a-2", 0.994), "A part of it looks like radial-a-2 (99 %)");
    }
}
