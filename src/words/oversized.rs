//! Values that are far larger than machines have them, in words.

use crate::diagnose::Verdict;
use crate::diagnose::oversized::Oversized;

/// A value that is far larger than machines have it. Only a complete model shows its cause, and there the
/// next step says what to check.
pub(super) fn finding(o: &Oversized, verdict: &Verdict) -> String {
    let Oversized { parameter, effect, value, unit, times, cause, check, .. } = o;
    let cause = cause.trim_end_matches('.');
    let check = check.trim_end_matches('.');
    let what = if o.wrong_sign {
        format!("But {parameter} = {value:.3} {unit}: {effect} cannot be negative.")
    } else if o.combined {
        let most = crate::units::significant(*value, 3);
        format!("But {effect} ({parameter}) moves a touch by {most} µm, {times:.0} times its usual size.")
    } else {
        format!("But {parameter} = {value:.3} {unit} is {times:.0} times the usual size of {effect}.")
    };
    match verdict {
        Verdict::Adequate => format!("{what} Probable cause: {cause}."),
        Verdict::TooLittleData(_) => format!("{what} Probable cause: {cause}. Check at the machine: {check}."),
        Verdict::MissingEffect(_) | Verdict::Unexplained(_) => format!(
            "{what} This may come from the effect that the model lacks. Look at it again when the model is complete. If it \
             stays so, check at the machine: {check}."
        ),
    }
}

pub(super) fn more(more: usize) -> String {
    match more {
        0 => String::new(),
        1 => " 1 more value is too large (--json lists it).".to_owned(),
        n => format!(" {n} more values are too large (--json lists them)."),
    }
}

/// What to do about it.
pub(super) fn check(o: &Oversized) -> String {
    format!("check {} before you use these values. {}", o.effect, o.check)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::verdict::{Missing, TooLittle};

    fn large() -> Oversized {
        Oversized {
            parameter: "EA0C".to_owned(),
            effect: "location-c".to_owned(),
            value: 0.015,
            sigma: 0.0001,
            unit: "deg".to_owned(),
            times: 8.3,
            wrong_sign: false,
            combined: false,
            cause: "The position of C in the machine file is wrong".to_owned(),
            check: "Turn C by 180 degrees against a fixed indicator".to_owned(),
        }
    }

    #[test]
    fn a_value_that_is_too_large_has_a_cause_where_the_model_is_complete() {
        let says = finding(&large(), &Verdict::Adequate);
        assert!(says.contains("8 times the usual size of location-c. Probable cause: The position of C"), "{says}");
        // the next step has the check
        assert!(check(&large()).contains("Turn C by 180 degrees"));
        let says = finding(&large(), &Verdict::TooLittleData(TooLittle::NoneUsed { excluded: 3 }));
        assert!(says.contains("Probable cause: The position of C") && says.contains("Turn C by 180 degrees"), "{says}");
    }

    #[test]
    fn an_oversized_value_of_an_incomplete_model_has_no_cause_yet() {
        let says = finding(&large(), &Verdict::MissingEffect(Missing::Effect(None)));
        assert!(!says.contains("The position of C") && !says.contains("cause"), "{says}");
        assert!(says.contains("may come from the effect that the model lacks") && says.contains("Turn C by"), "{says}");
        assert_eq!(more(0), "");
        assert!(more(2).contains("2 more values"));
    }
}
