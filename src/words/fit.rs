//! Sentences of a fit: its remarks, why a touch is not used, where the noise comes from, what cannot be determined.

use crate::fit::candidates::NoValue;
use crate::fit::noise::Noise;
use crate::fit::null_space::{Combined, Kind, NullDirection};
use crate::fit::outliers::MOST_SHARE;
use crate::fit::{Contradiction, Found, NoiseSource, Reason, Remark, VisitSource};
use crate::model::lever_arm::{From, SURE, TurningPoint};
use crate::model::temperatures::{NEAR_H, TemperatureGap};
use crate::units::{mm_from_um, significant, um_from_mm};

/// Other values of a shape parameter that are named.
const NAMED: usize = 3;

/// Why a touch is not used.
pub(crate) fn reason(reason: &Reason) -> String {
    match reason {
        Reason::Masked { reason } => format!("excluded: {reason}"),
        Reason::Outlier { off_mm, robust_only: true, .. } => format!(
            "{:+.1} µm off what the other touches predict; a robust fit excludes it together with others: check for a chip, a drop or a double touch",
            um_from_mm(*off_mm)
        ),
        Reason::Outlier { off_mm, standardised, .. } => {
            // of touches without noise the scatter is rounding: its multiples say nothing
            let times = standardised.abs();
            let times = if times < 1000.0 { format!("{times:.1}") } else { "more than 1000".to_owned() };
            format!(
                "{:+.1} µm off what the other touches predict ({times} standard deviations of their scatter): check for a chip, a drop or a double touch",
                um_from_mm(*off_mm)
            )
        }
    }
}

/// What carries the axis does not turn about a point as near its pivot as this.
const FARTHEST_OF_A_GEAR_MM: f64 = 50.0;

/// About which point an axis turns, and what that means.
pub(crate) fn turning_point(point: &TurningPoint) -> String {
    const NEAR_MM: f64 = 20.0;
    let from = if point.from == From::Ball { "ball" } else { "pivot" };
    let letter = |along: usize| ["X", "Y", "Z"][along.min(2)];
    let sigma = point.sigma_mm.map_or_else(String::new, |s| format!(" ± {s:.0}"));
    let far: Vec<(usize, f64)> = point.off_mm.iter().copied().filter(|(_, mm)| mm.abs() >= NEAR_MM).collect();
    let place = match far[..] {
        [] => format!("near the {from}"),
        [(2, mm)] => format!("{:.0}{sigma} mm {} the {from}", mm.abs(), if mm > 0.0 { "above" } else { "below" }),
        [(along, mm)] => {
            format!(
                "{:.0}{sigma} mm from the {from} to {}{}",
                mm.abs(),
                letter(along),
                if mm > 0.0 { "+" } else { "-" }
            )
        }
        _ => {
            let each: Vec<String> = far.iter().map(|&(along, mm)| format!("{} {mm:+.0} mm", letter(along))).collect();
            format!("at {} from the {from}", each.join(", "))
        }
    };
    let axis = point.axis;
    let (what, cause) = if point.about_itself {
        (format!("turn of {axis}"), own_turn(point, far.is_empty()))
    } else if axis.is_rotary() {
        (format!("wobble of {axis}"), "the bearing, not run-out".to_owned())
    } else {
        (format!("turn of the carriage of {axis}"), "the guideway, not straightness or scale".to_owned())
    };
    format!("{what} about a point {place}: {cause}")
}

/// What turns an axis further: its gear does so about the pivot, and what carries it about a point elsewhere.
fn own_turn(point: &TurningPoint, is_near: bool) -> String {
    let axis = point.axis;
    let far_mm = point.off_mm.iter().map(|(_, mm)| mm.abs()).fold(0.0, f64::max);
    match point.sigma_mm {
        Some(sigma) if !is_near && far_mm > SURE * sigma => {
            format!("what carries {axis} gives way, not its gear or clamp")
        }
        Some(sigma) if is_near && SURE * sigma < FARTHEST_OF_A_GEAR_MM => {
            format!("the gear or clamp of {axis} gives way, not what carries it")
        }
        _ => format!("the gear or clamp of {axis} gives way, or what carries it"),
    }
}

/// A remark of a fit.
pub(crate) fn remark(remark: &Remark) -> String {
    let um = um_from_mm;
    match remark {
        Remark::NoTemperature { effect } => {
            format!("Effect {effect} depends on the temperature T, and no touch has one. Log the temperature.")
        }
        Remark::TemperatureGap(gap) => temperature_gap(*gap),
        Remark::NotCounted(bad) => {
            format!("The effect is not counted among those outside of the model: {}.", no_value(bad))
        }
        Remark::NotCredible { name, times } => format!(
            "{name} is more than {times} times its usual size; no machine is like that. Check the plan, units and signs; a combination of parameters may hardly be determined."
        ),
        Remark::FollowsUnseen { meaning, .. } => format!(
            "{meaning} depends on what these touches cannot determine by more than its own uncertainty, and is not determined either."
        ),
        Remark::NotConverged { stopped } => format!("the search did not converge: {stopped}"),
        Remark::NoRedundancy => {
            "There are as many unknowns as touches: nothing is left to check the model with.".into()
        }
        Remark::UnmodelledNotCounted { most_touches } => {
            format!("What effects outside of the model may add is computed for up to {most_touches} touches only.")
        }
        Remark::SetUpMistake { far, of, right, mistake } => format!(
            "{far} of {of} touches are far from their planned positions; {right} would be right if {}. Correct that first: these values come only from the touches that happen to fit.",
            mistake.says()
        ),
        Remark::OutliersBeyond { found, of, excluded } => format!(
            "a robust fit finds {found} outliers among {of} touches ({:.1} %), and the others still do not agree without them. {} excluded (exclusion stops at {:.0} %). Do not trust the values and their uncertainties; look for dirt, a loose block or stylus, or an effect that the model lacks.",
            percent(*found, *of),
            match excluded {
                0 => "None is".into(),
                1 => "Only 1 is".into(),
                n => format!("Only {n} are"),
            },
            100.0 * MOST_SHARE
        ),
        Remark::ManyOutliers { excluded, of } => format!(
            "{excluded} of {of} touches ({:.1} %) are outliers and are excluded. More than {:.0} % points to chips, a loose block or stylus, or an effect that the model lacks; check them before you trust the values.",
            percent(*excluded, *of),
            100.0 * MOST_SHARE
        ),
        Remark::NoiseContradicted { stated_mm, found_mm, dof } => format!(
            "The study states a noise of {:.2} µm ([noise] touch_um); the repeated touches show {:.2} µm ({dof:.0} degrees of freedom). The repeats are used. Remove touch_um, or find out what has changed.",
            um(*stated_mm),
            um(*found_mm)
        ),
        Remark::VisitsContradicted { stated_mm, found_mm, dof } => format!(
            "The study states a scatter of index positions of {:.2} µm ([noise] visit_um); revisited poses show {:.2} µm ({} of freedom). The stated scatter is used, also for the uncertainties. Remove visit_um, or find out what has changed.",
            um(*stated_mm),
            um(*found_mm),
            degrees(*dof)
        ),
        Remark::VisitsBeyond { tau_mm, dof, declared_mm } => format!(
            "Index positions scatter by {:.2} µm (revisited poses, {} of freedom); the axes declare an indexing repeatability of {:.2} µm. Drift, warm-up or a slip that the model lacks counts as scatter here: chi2/dof does not show it, and values may be off by more than their uncertainties. Run `axiscal diagnose`, or declare what the axes repeat to (indexing_repeatability_um in machines.toml).",
            um(*tau_mm),
            degrees(*dof),
            um(*declared_mm)
        ),
        Remark::RepeatsBeyond { sigma_mm, dof, declared_mm } => format!(
            "Repeated touches scatter by {:.2} µm ({dof:.0} degrees of freedom); the machine's file declares a probe repeatability of {:.2} µm. Chips, dirt or a loose stylus count as noise here: chi2/dof does not show them. Clean the ball and the faces, fasten the stylus and measure again, or declare what your probe repeats to (repeatability_um in machines.toml).",
            um(*sigma_mm),
            um(*declared_mm)
        ),
        Remark::CoarseLog { rounding_mm } => format!(
            "The digits of the log take away {:.2} µm, more than the touches' own noise. The same is lost wherever a point is touched again: uncertainties may be too small, and patterns may appear that do not exist. Let the program write more decimals.",
            um(*rounding_mm)
        ),
        Remark::NoiseTooLarge { times_better, sigma_mm, source } => format!(
            "The touches fit {times_better:.1} times better than the {} noise of {:.2} µm. Your probe repeats better than that, and the uncertainties are too large. Set `touch_um` ([noise] of the study).",
            declared_or_stated(*source),
            um(*sigma_mm)
        ),
        Remark::Contradiction(c) => contradiction(c),
        Remark::Misfit { times, with_type_b, noise } => format!(
            "The residuals are {}: something is missing in the model. The uncertainties count {} only. Run `axiscal diagnose`.{}",
            noise.times(*times),
            if *with_type_b { "the noise and the type B rows" } else { "the noise" },
            or_the_probe(noise, *times).map_or_else(String::new, |or| format!(" {or}"))
        ),
        Remark::OutOfRange { name, prior: Some((value, sigma)) } => format!(
            "{name} left its range; its prior is {value} ± {sigma}: touches and prior disagree, or its range is too narrow. It is set to the end of its range that fits both better."
        ),
        Remark::OutOfRange { name, prior: None } => format!(
            "{name} left its range: these touches cannot determine it. It is set to the end of its range that fits better."
        ),
        Remark::OtherValues { name, unit, value, others } => {
            let others: Vec<String> = others.iter().take(NAMED).map(|v| significant(*v, 4)).collect();
            format!(
                "{name} cannot be determined: {} {unit} fits best, {} about as well. What depends on it is as uncertain. Touch at more positions, or set it to what is known of the machine (`value` and `fixed = true` or `sigma`, [model.parameters]).",
                significant(*value, 4),
                others.join(" or ")
            )
        }
        Remark::SizesBesideOneValue { name, unit, value, sizes, quick, most_touches } => format!(
            "{name} cannot be determined. The uncertainty of {} is that at {name} = {} {unit}; {}.",
            sizes.join(", "),
            significant(*value, 4),
            if *quick {
                "`axiscal identify` computes it for all values".to_owned()
            } else {
                format!("for all values it is computed for up to {most_touches} touches only")
            }
        ),
        Remark::LostBesideShapes { shapes, results, n_blocks } => {
            let shapes = shapes.join(", ");
            let blocks = if *n_blocks > 0 { format!(", and {n_blocks} block positions") } else { String::new() };
            format!(
                "{}{blocks} cannot be determined, because {shapes} cannot: with other values of it they may be very different. Remove the effect from the model if nothing needs it, or set {shapes} to what is known of the machine.",
                results.join(", ")
            )
        }
        Remark::NotDetermined { names } => {
            format!("{} cannot be determined: it depends on what these touches cannot determine.", names.join(", "))
        }
        Remark::TypeBPerKelvin { name } => format!(
            "type B: {name} depends on the temperature, and no touch has one. It is counted as if all touches were made 1 K off 20 °C. Multiply its uncertainty by the kelvins that the room may be off, or log the temperature."
        ),
        Remark::TypeBWithoutEffect { name } => format!(
            "type B: {name} has no effect on these touches and adds nothing to any uncertainty. If it depends on the temperature, they are at 20 °C: state the uncertainty of the thermometer, temperature = … (K)."
        ),
        Remark::UnknownMask { id, run } => {
            format!("There is no touch {id} in run {}: its mask has no effect.", run + 1)
        }
    }
}

/// A formula without a usable value at some touches.
pub(crate) fn no_value(bad: &NoValue) -> String {
    let NoValue { effect, formula, .. } = bad;
    format!("formula {formula:?} of effect {effect} has {}", where_no_value(bad))
}

/// The same beside the formula itself.
pub(crate) fn no_value_of_formula(bad: &NoValue) -> String {
    format!("formula {:?} has {}", bad.formula, where_no_value(bad))
}

/// The same for an effect that is only a candidate.
pub(crate) fn not_a_candidate(bad: &NoValue) -> String {
    format!("effect {} is not tested: {}", bad.effect, no_value(bad))
}

fn where_no_value(bad: &NoValue) -> String {
    let NoValue { n_touches, first, too_large, .. } = bad;
    let which = match n_touches {
        1 => format!("1 touch: touch {first}"),
        n => format!("{n} touches: the first is touch {first}"),
    };
    match too_large {
        true => format!("no usable value at {which}, more than a kilometre at its usual size"),
        false => format!("no value at {which}"),
    }
}

fn temperature_gap(gap: TemperatureGap) -> String {
    let TemperatureGap { missing, of, far } = gap;
    match far {
        0 => format!(
            "{missing} of {of} touches have no temperature. It is taken from the readings before and after them."
        ),
        far => format!(
            "{missing} of {of} touches have no temperature, and {far} of them have no reading within {:.0} min. No temperature is \
             used, and no effect of the temperature can be determined. Log one for every touch, or exclude the touches without one.",
            60.0 * NEAR_H
        ),
    }
}

fn percent(count: usize, of: usize) -> f64 {
    100.0 * count as f64 / of.max(1) as f64
}

/// Degrees of freedom as a person reads them: effective ones may be far below one.
fn degrees(dof: f64) -> String {
    match dof {
        d if d < 0.05 => "less than 0.1 degrees".to_owned(),
        d if d < 9.5 => format!("{d:.1} degrees"),
        d => format!("{d:.0} degrees"),
    }
}

fn declared_or_stated(source: NoiseSource) -> &'static str {
    if source == NoiseSource::Study { "stated" } else { "declared" }
}

fn contradiction(c: &Contradiction) -> String {
    let Contradiction { name, unit, stated, .. } = c;
    let (found, doubt) = match c.found {
        Found::Sigma(sigma) => (format!("± {} {unit}", with_digits(sigma, sigma)), sigma),
        Found::Interval([low, high]) => {
            let doubt = 0.25 * (high - low);
            (format!("{unit} (95 % between {} and {})", with_digits(low, doubt), with_digits(high, doubt)), doubt)
        }
    };
    let found = format!("{} {found}, {:.0} standard deviations away", with_digits(c.value, doubt), c.apart);
    match c.sigma {
        Some(sigma) => format!(
            "the touches contradict the prior of {name}, {stated} ± {sigma} {unit}: without it they give {found}. Check it, or give it a larger sigma."
        ),
        None => format!(
            "the touches contradict the held value of {name}, {stated} {unit}: without it they give {found}. Check it, or let it free."
        ),
    }
}

/// A value with two digits of its uncertainty.
fn with_digits(value: f64, sigma: f64) -> String {
    let decimals = if sigma > 0.0 && sigma.is_finite() { (1.0 - sigma.log10().floor()).clamp(0.0, 12.0) } else { 6.0 };
    format!("{value:.*}", decimals as usize)
}

/// Both figures of the noise and where they come from.
pub(crate) fn noise(noise: &Noise) -> String {
    let shown = noise.visits_shown.map_or_else(String::new, |shown| {
        format!("; the residuals show {:.2} µm, and the uncertainties are computed with that", um_from_mm(shown.tau_mm))
    });
    format!(
        "touch {:.2} µm ({}); index position {:.2} µm ({}{shown})",
        um_from_mm(noise.sigma_mm),
        touch_noise(noise),
        um_from_mm(noise.tau_mm),
        visit_scatter(noise)
    )
}

fn touch_noise(noise: &Noise) -> String {
    let sigma = match (noise.source, noise.dof) {
        (NoiseSource::Repeats, dof) => {
            let dof = dof.unwrap_or(0.0);
            match (noise.later_mm, noise.contradicted_mm) {
                (Some(later), _) => format!(
                    "from touches repeated at once, {dof:.0} degrees of freedom; the same points later differ by {:.2} µm, which is more than noise",
                    um_from_mm(later)
                ),
                (None, Some(stated)) => format!(
                    "from repeated touches, {dof:.0} degrees of freedom; they contradict the {:.2} µm that the study states",
                    um_from_mm(stated)
                ),
                (None, None) => format!("from repeated touches, {dof:.0} degrees of freedom"),
            }
        }
        (NoiseSource::Study, _) => "as the study states".to_owned(),
        (NoiseSource::Declared, _) if noise.repeats_agree => {
            "the probe's declared repeatability: the repeats agree exactly within the digits of the log".to_owned()
        }
        (NoiseSource::Declared, _) => "the probe's declared repeatability: the plan has too few repeats".to_owned(),
    };
    if noise.source != NoiseSource::Repeats && noise.rounding_shows() {
        return format!("{sigma}; {:.2} µm of it from the digits of the log", um_from_mm(noise.rounding_mm));
    }
    sigma
}

fn visit_scatter(noise: &Noise) -> String {
    match noise.visit_source {
        // a bound of nothing says nothing
        VisitSource::Revisits if noise.tau_test_mm <= 0.0 => {
            "from revisited poses, which differ by no more than the touches' own noise".to_owned()
        }
        VisitSource::Revisits => format!(
            "from revisited poses, {} of freedom, at most {:.2} µm with 90 % certainty",
            degrees(noise.visit_dof.unwrap_or(0.0)),
            um_from_mm(noise.tau_test_mm)
        ),
        VisitSource::Study => "as the study states".to_owned(),
        VisitSource::OnePose => "only one pose was visited".to_owned(),
        VisitSource::Declared if noise.repeats_agree => {
            "the axes' declared indexing repeatability: repeats that agree exactly cannot determine it".to_owned()
        }
        VisitSource::Declared => {
            "the axes' declared indexing repeatability: the plan has too few revisits to measure it".to_owned()
        }
    }
}

/// What else may explain a misfit of so many times the noise where no repeats measure the noise.
pub(crate) fn or_the_probe(noise: &Noise, times: f64) -> Option<String> {
    let source = noise.unconfirmed()?;
    let with_visits = noise.tau_mm > 0.0 && noise.visit_source == VisitSource::Declared;
    let (axes, how) = if with_visits {
        (
            " or the axes index less exactly than declared",
            "Touch a point several times in a row, and come back to poses",
        )
    } else {
        ("", "Touch a point ten times in a row")
    };
    Some(format!(
        "Or the model is complete, and a touch scatters by up to {:.2} µm in place of the {} {:.2} µm{axes}. {how} to find out.",
        um_from_mm(noise.sigma_mm * times),
        declared_or_stated(source),
        um_from_mm(noise.sigma_mm)
    ))
}

/// A combination that cannot be determined.
pub(crate) fn undetermined(direction: &NullDirection) -> String {
    let NullDirection { members, blocks, .. } = direction;
    let mut named: Vec<String> = members.iter().map(|m| m.meaning.clone()).collect();
    named.extend((!blocks.is_empty()).then(|| {
        let words: Vec<&str> = blocks.parameters.iter().map(|w| set_up_word(w)).collect();
        let of = if blocks.labels.len() > 3 {
            format!("{} blocks", blocks.labels.len())
        } else {
            blocks.labels.iter().cloned().collect::<Vec<_>>().join(", ")
        };
        format!("the position of {of} ({})", words.join(", "))
    }));
    let named = list(&named);
    match direction.kind {
        Kind::Unnamed => "a combination of many parameters has no effect on these touches".to_owned(),
        Kind::Shape => format!(
            "{named} cannot be determined: the touches do not show its effect clearly. It is set to the usual value that fits best. Add touches where the effect changes, or set it to what is known of the machine"
        ),
        Kind::Single => {
            format!("{named} has no effect on these touches; it stays at its start value")
        }
        Kind::Pair => format!(
            "Only {} can be measured, not {named} separately. {}",
            members.first().zip(members.get(1)).map_or_else(String::new, |(a, b)| what_is_seen(a, b)),
            set_to(direction)
        ),
        Kind::OneWithBlocks => {
            format!("{named} cannot be separated: a shifted block looks the same. {}", set_to(direction))
        }
        Kind::Several => format!(
            "{named} cannot all be measured: {} has no effect on these touches. {}",
            trade(members, !blocks.is_empty()),
            set_to(direction)
        ),
    }
}

/// What is set where, so that the rest can be solved for.
fn set_to(direction: &NullDirection) -> String {
    let (shapes, sizes): (Vec<String>, Vec<String>) = direction
        .held
        .iter()
        .cloned()
        .partition(|name| direction.members.iter().any(|m| m.is_shape && m.name == *name));
    let verb = |names: &[String]| if names.len() == 1 { "is" } else { "are" };
    let mut parts = Vec::new();
    if !sizes.is_empty() {
        parts.push(format!("{} {} set to 0", list(&sizes), verb(&sizes)));
    }
    if !shapes.is_empty() {
        parts.push(format!("{} {} set to the start of the search", list(&shapes), verb(&shapes)));
    }
    parts.join("; ")
}

/// What is seen of two results that trade against each other: "the sum EY0C + ey", "EX0B + 3.54 mm/deg * EB0B".
fn what_is_seen(a: &Combined, b: &Combined) -> String {
    let ((in_a, unit_a), (in_b, unit_b)) = (in_mm(a), in_mm(b));
    let factor = -in_a / in_b;
    let sign = if factor < 0.0 { '-' } else { '+' };
    if unit_a == unit_b && (factor.abs() - 1.0).abs() < 1e-3 {
        return format!("the {} {} {sign} {}", if factor < 0.0 { "difference" } else { "sum" }, a.name, b.name);
    }
    let unit = match (unit_a, unit_b) {
        (a, b) if a == b => String::new(),
        (a, "1") => format!(" {a}"),
        (a, b) => format!(" {a}/{b}"),
    };
    format!("{} {sign} {}{unit} * {}", a.name, significant(factor.abs(), 3), b.name)
}

/// How results trade against each other: "+1 mm of EX0B with -0.283 deg of EB0B".
fn trade(members: &[Combined], with_blocks: bool) -> String {
    // the first is changed by one of its unit
    let one = members.first().map_or(1.0, |m| in_mm(m).0);
    let of_member = |m: &Combined| {
        let (amount, unit) = in_mm(m);
        let x = amount / one;
        let unit = if unit == "1" { String::new() } else { format!(" {unit}") };
        format!("{}{}{unit} of {}", if x < 0.0 { '-' } else { '+' }, significant(x.abs(), 3), m.name)
    };
    let mut each: Vec<String> = members.iter().map(of_member).collect();
    if with_blocks {
        each.push("a shift of the blocks to match".to_owned());
    }
    match &each[..] {
        [] => "a change of the block positions together".to_owned(),
        [first, rest @ ..] => format!("{first} with {}", list(rest)),
    }
}

/// An amount of an unknown with its unit; lengths all in mm, so that they compare.
fn in_mm(of: &Combined) -> (f64, &str) {
    if of.unit == "um" { (mm_from_um(of.amount), "mm") } else { (of.amount, of.unit.as_str()) }
}

/// A combination that is determined poorly: parameters with their weights in units of their usual sizes.
pub(crate) fn poorly_determined(weights: &[(String, f64)], times: f64) -> String {
    let what = match weights {
        [(one, _)] => one.clone(),
        several => {
            let each: Vec<String> = several.iter().map(|(meaning, w)| format!("{w:+.2} of {meaning}")).collect();
            format!("the combination {} (each in its usual size)", list(&each))
        }
    };
    format!(
        "{what} is determined to {} times its usual size only: it has hardly any effect on these touches",
        significant(times, 3)
    )
}

fn list(words: &[String]) -> String {
    match words {
        [] => String::new(),
        [one] => one.clone(),
        [all @ .., last] => format!("{} and {last}", all.join(", ")),
    }
}

fn set_up_word(word: &str) -> &str {
    match word {
        "SX" => "X",
        "SY" => "Y",
        "SZ" => "height",
        "SA" => "tilt about X",
        "SB" => "tilt about Y",
        "SC" => "turn about Z",
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axes::AxisName;

    /// Whether an axis itself turns or what carries it is said where the distance shows it.
    #[test]
    fn a_cause_is_said_where_the_distance_shows_it() {
        let says = |mm: f64, sigma_mm: Option<f64>| {
            turning_point(&TurningPoint {
                axis: AxisName::B,
                about_itself: true,
                off_mm: vec![(2, mm)],
                sigma_mm,
                from: From::Pivot,
            })
        };
        let gear = "the gear or clamp of B gives way, not what carries it";
        let ram = "what carries B gives way, not its gear or clamp";
        let open = "the gear or clamp of B gives way, or what carries it";
        assert_eq!(says(180.0, Some(20.0)), format!("turn of B about a point 180 ± 20 mm above the pivot: {ram}"));
        assert_eq!(says(5.0, Some(10.0)), format!("turn of B about a point near the pivot: {gear}"));
        for (mm, sigma_mm) in [(27.0, Some(121.0)), (5.0, Some(60.0)), (-73.0, Some(122.0)), (180.0, None)] {
            assert!(says(mm, sigma_mm).ends_with(open), "{}", says(mm, sigma_mm));
        }
        assert_eq!(says(27.0, Some(121.0)), format!("turn of B about a point 27 ± 121 mm above the pivot: {open}"));
    }

    #[test]
    fn a_wobble_has_its_point_with_its_uncertainty() {
        let mut point = TurningPoint {
            axis: AxisName::C,
            about_itself: false,
            off_mm: vec![(2, -180.0)],
            sigma_mm: Some(12.0),
            from: From::Ball,
        };
        let known = "wobble of C about a point 180 ± 12 mm below the ball: the bearing, not run-out";
        assert_eq!(turning_point(&point), known);
        point.sigma_mm = None;
        assert_eq!(turning_point(&point), known.replace(" ± 12", ""));
    }
}
