//! From tests to the answer: candidates with sizes in their units, what was not found, touches that come back.

use super::answer::{Candidate, Diagnosis, FORMAT, Finding, Gross, Outlier, Parameter, Power, Shape, Weakened, Where};
use super::decide::{Decision, Findings, Kind as Decided, OtherEvidence};
use super::evidence::Evidence;
use super::first_order::FirstOrder;
use super::folds::Folds;
use super::next_step::MachineCheck;
use super::{Examination, Subject, noise_um, other_causes, separating_touches, setup_mistakes};
use crate::fit::candidates::NoValue;
use crate::fit::{Fit, VisitSource, declared_tau_mm};
use crate::model::data::Origin;
use crate::search::dependence::Dependence;
use crate::search::groups::Group;
use crate::search::multiplicity::FAMILY_LEVEL;
use crate::search::pattern_tests::{Features, Kind};
use crate::search::{Score, power, side_by_side};
use crate::units::{mm_from_um, um_from_mm};
use crate::words::diagnose as words;
use nalgebra::DMatrix;

/// A parameter is flagged when an added effect makes it this many times less certain.
const WEAKENED: f64 = 3.0;

/// A shape that does not pass among all shapes is named when its own p-value is below this.
const WORTH_A_WORD: f64 = 1e-3;

/// Shares that differ by less are the same.
const AS_MUCH: f64 = 0.02;

/// Most variables that are named.
const MOST_WHERE: usize = 5;

pub(super) fn put_together(
    subject: Subject,
    seen: &Examination,
    features: &Features,
    (decision, beside): (Decision, &OtherEvidence),
    gross: Vec<Gross>,
    options: &super::Options,
) -> Diagnosis {
    let fit = subject.fit;
    let mut decided = decision.kind;
    // what passes the test and is not confirmed stays a question, too
    let asked = decided == Decided::MissingEffect || (decision.named && !beside.shapes_win);
    let open = if asked { super::unresolved_pairs::open(seen) } else { super::unresolved_pairs::Open::default() };
    let folds = Folds::new(fit, seen.evidence);
    let mut candidates: Vec<Candidate> = Vec::new();
    let gross_found = gross.first().is_some_and(|g| g.rms_um < setup_mistakes::RIGHT * fit.outcome.rms_um);
    if let Some(first) = gross.first().filter(|_| gross_found)
        && let Some(candidate) = setup_mistakes::candidate(subject, first)
    {
        decided = Decided::MissingEffect;
        candidates.push(candidate);
    }
    if decided != Decided::TooFewTouches {
        let first_order = FirstOrder::from_fit(fit);
        let tell_apart = separating_touches::words(subject, seen, options);
        candidates.extend(seen.groups.iter().zip(tell_apart).enumerate().map(|(i, (group, told))| Candidate {
            tell_apart: told.says,
            never_parted: told.never,
            ..candidate(fit, seen, (&first_order, &folds), group, (i, decision.confirmed))
        }));
    }
    candidates.truncate(options.at_most.max(seen.first_names().len()));
    let found: Vec<&Group> = seen
        .groups
        .iter()
        .filter(|g| g.members.iter().any(|m| seen.search.scores[m.candidate].p_adjusted < FAMILY_LEVEL))
        .collect();
    let powers = if options.power {
        let detectable = seen.search.power(&|candidate| seen.named.raw_um(&[(candidate, 0)]).swap_remove(0));
        let not_found = detectable.iter().filter(|p| !found.iter().any(|g| g.holds(p.candidate)));
        // how far what would be found is from the usual size: noncentrality goes with the square of the size
        let mut powers: Vec<(f64, Power)> = not_found
            .filter_map(|p| {
                let effect = seen.named.effects[p.candidate].id.clone();
                let from_usual = (power::SEEN / p.at_typical.max(f64::MIN_POSITIVE)).ln().abs();
                Some((from_usual, Power { effect, minimal_detectable_um: p.minimal_detectable? }))
            })
            .collect();
        // what could nearly have been seen, or only just, goes first: the hopeless need another program
        powers.sort_by(|a, b| a.0.total_cmp(&b.0));
        powers.into_iter().map(|p| p.1).collect()
    } else {
        Vec::new()
    };
    // where a named effect passes, the best shape is worth a word even if it would not pass among all shapes
    let significant = || {
        let mut best: Vec<_> = seen.dependences.iter().filter(|d| d.p_adjusted < FAMILY_LEVEL).collect();
        if best.is_empty() {
            best.extend(seen.dependences.first().filter(|d| d.p < WORTH_A_WORD));
        }
        best.into_iter()
    };
    let named_axes = |name: &str| subject.machine.axes.iter().any(|a| a.name.to_string() == name && a.name.is_rotary());
    let by = |on: &str| words::by(on, &named_axes);
    let mut own_curve = None;
    let mut depends: Vec<Where> = if decided == Decided::Adequate {
        Vec::new()
    } else {
        significant()
            .take(MOST_WHERE)
            .map(|d| {
                let share = beyond_the_noise(seen.evidence, d.share, d.terms.len());
                Where {
                    by: by(&d.on),
                    share,
                    p_adjusted: d.p_adjusted,
                    says: words::says(d, share, fit, subject.machine),
                    id: d.id.clone(),
                    on: d.on.clone(),
                    finding: Finding::Pattern,
                }
            })
            .collect()
    };
    // an effect that explains more than any shape without a name says on what its own formulas depend
    let best_shape =
        seen.dependences.iter().filter(|d| d.p_adjusted < FAMILY_LEVEL).map(|d| d.share).fold(0.0, f64::max);
    let by_itself = |c: &&Candidate| c.proposed && c.together_with.is_none() && c.share + AS_MUCH >= best_shape;
    if let Some(first) = candidates.first().filter(by_itself)
        && let Some(effect) = subject.catalogue.get(&first.effect, subject.machine)
        && let Some(on) =
            effect.terms.iter().find_map(|t| t.formula.variables().into_iter().find(|v| words::is_plain(v)))
    {
        let share = beyond_the_noise(seen.evidence, first.share, first.parameters.len() + first.not_told.len());
        depends.retain(|w| w.by != by(on));
        own_curve = super::effect_curve::curve(seen, features, on, &by(on));
        depends.insert(
            0,
            Where {
                by: by(on),
                share,
                p_adjusted: first.p_adjusted,
                says: format!(
                    "{:.0} % of the residual changes with {} like {}",
                    100.0 * share,
                    words::plain(&by(on)),
                    match &first.same_as[..] {
                        [] => format!("{} ({})", effect.id, effect.name),
                        others => words::list(&[std::slice::from_ref(&effect.id), others].concat()),
                    }
                ),
                id: effect.id.clone(),
                on: on.to_owned(),
                finding: Finding::Effect,
            },
        );
    }
    beside_the_tests(&mut depends, seen, fit, (beside, decided == Decided::MissingEffect));
    // as the splits of `compare` and the sentences count: of what the noise does not explain
    let gross_first = usize::from(candidates.first().is_some_and(|c| c.effect == setup_mistakes::EFFECT));
    for (c, group) in candidates.iter_mut().skip(gross_first).zip(&seen.groups) {
        let both = seen.both.filter(|_| c.together_with.is_some()).map(|both| both.n_parameters);
        let n_parameters = both.unwrap_or(seen.order().scores[group.first()].n_parameters);
        c.share = beyond_the_noise(seen.evidence, c.share, n_parameters);
    }
    // the curve is of what is named first
    let drawn = significant().find(|d| depends.first().is_some_and(|w| w.by == by(&d.on)));
    let shape = own_curve.filter(|c| depends.first().is_some_and(|w| w.by == c.by)).or_else(|| {
        let d = drawn?;
        let variable = d.on.strip_suffix("*block").unwrap_or(&d.on);
        let kind = features.variables.iter().find(|v| v.name == variable).map(|v| v.kind);
        let moved = words::moved_block(d, fit);
        let to_deg = |x: f64| if kind == Some(Kind::Rotary) { crate::units::deg_from_rad(x) } else { x };
        // a block or a face stands out or lies deep; only where the probe is the cause a late trigger is what counts
        let outward = matches!(d.on.as_str(), "block" | "face") && d.direction == "approach";
        let sign = if outward { -1.0 } else { 1.0 };
        (!d.curve.is_empty()).then(|| Shape {
            by: by(&d.on),
            x_unit: x_unit(kind).to_owned(),
            y_unit: d.unit.clone(),
            direction: if outward {
                "outward (+: the faces stand out, the block is larger)".to_owned()
            } else {
                super::features::direction_words(&d.direction, subject.machine)
            },
            x: d.curve.iter().map(|p| to_deg(p.x)).collect(),
            y: d.curve.iter().map(|p| sign * p.y).collect(),
            band: d.curve.iter().map(|p| 1.96 * p.sigma).collect(),
            labels: d.groups.iter().filter_map(|&g| words::group(&d.on, g, fit, features)).collect(),
            block: moved.map(str::to_owned),
            // where an effect is named, its own words say what does that
            kind: if candidates.iter().any(|c| c.proposed) { String::new() } else { words::kind(d, fit) },
        })
    });
    let unexplained = decided == Decided::Unexplained;
    let first_by = depends.first().map_or("", |w| w.by.as_str());
    let faces = if unexplained && first_by == "face" { faces(fit, seen, features, drawn) } else { Vec::new() };
    let blocks: Vec<String> = match drawn.filter(|d| unexplained && first_by == "block" && d.on == "block") {
        Some(d) => {
            let found = super::outlying_groups::groups(seen.evidence, features, d, &features.block);
            found.into_iter().filter_map(|b| words::group("block", b, fit, features)).collect()
        }
        None => Vec::new(),
    };
    if let (Some(first), false) = (depends.first_mut(), faces.is_empty()) {
        first.says += &format!(": {}", faces.join(", "));
    } else if let (Some(first), false) = (depends.first_mut(), blocks.is_empty()) {
        first.says += &format!(": block {} is not like the rest", blocks.join(", then "));
    }
    // scatter and bad touches that lie together are put right at the machine, not by a formula
    let sketchable = unexplained
        && depends.first().is_some_and(|w| matches!(w.finding, Finding::Pattern | Finding::Effect))
        && super::sketch::best(&seen.dependences, fit).is_ok();
    let moved_block = drawn.filter(|_| unexplained).and_then(|d| words::moved_block(d, fit)).map(str::to_owned);
    let check = match moved_block {
        _ if !faces.is_empty() => MachineCheck::NamedFaces(faces),
        _ if !blocks.is_empty() => MachineCheck::NamedBlocks(blocks),
        Some(block) => MachineCheck::MovedBlock(block),
        None => MachineCheck::from_dependence(depends.first(), words::visits_come_back(fit)),
    };
    let findings = Findings {
        subject,
        decision,
        beside,
        candidates: &candidates,
        depends: &depends,
        gross: &gross,
        check,
        sketchable,
    };
    let verdict = findings.verdict(decided);
    other_causes::jump_of_what(seen, features, &mut candidates);
    let needs_temperature = other_causes::without_temperature(fit, seen);
    other_causes::room_or_time(fit, seen, &mut candidates);
    Diagnosis {
        format: FORMAT,
        verdict,
        says: String::new(),
        consequences: Vec::new(),
        oversized: Vec::new(),
        rms_um: fit.outcome.rms_um,
        held_out_rms_um: folds.model().map(|h| h.rms_um),
        held_out_se_um: folds.model().and_then(|h| h.standard_error_um),
        all_touches: None,
        noise_um: noise_um(fit),
        declared_noise_um: fit.noise.repeats_beyond_mm.map(um_from_mm),
        visit_um: um_from_mm(seen.evidence.tau_mm),
        declared_visit_um: hidden_in_scatter(subject, seen).map(um_from_mm),
        visit_source: fit.noise.visit_source,
        noise_says: noise_says(seen, fit),
        lack_of_fit_p: seen.lack_of_fit.p,
        depends,
        shape,
        candidates,
        gross,
        outliers: outliers(fit),
        tested: seen.search.scores.iter().filter(|s| s.visible()).count(),
        power: powers,
        needs_temperature,
        not_seen: seen
            .search
            .scores
            .iter()
            .filter(|s| !s.visible())
            .map(|s| seen.named.effects[s.candidate].id.clone())
            .collect(),
        warnings: seen.named.left_out.iter().map(NoValue::left_out).collect(),
        open,
    }
}

/// The declared scatter of index positions, mm, where no revisits measure it and the tests allow for so much more that an effect may
/// be hidden in it.
fn hidden_in_scatter(subject: Subject, seen: &Examination) -> Option<f64> {
    const TIMES: f64 = 2.0;
    let fit = subject.fit;
    let declared_mm = declared_tau_mm(subject.machine, &fit.data.observations);
    let far = declared_mm > 0.0 && seen.evidence.tau_mm > TIMES * declared_mm;
    (fit.noise.visit_source == VisitSource::Declared && far).then_some(declared_mm)
}

/// Unit of what a misfit is drawn against.
pub(super) fn x_unit(kind: Option<Kind>) -> &'static str {
    match kind {
        Some(Kind::Rotary) => "deg",
        Some(Kind::Linear) => "mm",
        Some(Kind::Time) => "h",
        Some(Kind::Temperature) => "degC",
        _ => "1",
    }
}

/// Faces that lie elsewhere: those on which touches were left out, or else those that stand out from the others, each with the
/// face opposite to it.
fn faces(fit: &Fit, seen: &Examination, features: &Features, drawn: Option<&Dependence>) -> Vec<String> {
    let of_touches = super::clustered_rejections::faces(fit, features);
    let named = |number: usize| words::group("face", number, fit, features);
    // a chip lies at some touches of a face: where the others show it too, or four of five are excluded, the whole face differs
    let whole = |face: usize| {
        let here = || (0..features.face.len()).filter(|&i| features.face[i] == face);
        drawn.is_some_and(|d| d.on == "face")
            || 5 * here().filter(|i| fit.rejected.contains_key(i)).count() >= 4 * here().count()
    };
    let found: Vec<(usize, bool)> = if of_touches.is_empty() {
        let Some(d) = drawn.filter(|d| d.on == "face") else { return Vec::new() };
        let out = super::outlying_groups::groups(seen.evidence, features, d, &features.face);
        out.into_iter().map(|face| (face, true)).collect()
    } else {
        of_touches.iter().map(|&i| (features.face[i], whole(features.face[i]))).collect()
    };
    let mut out: Vec<usize> = Vec::new();
    for (face, whole) in found {
        let other = if whole { super::outlying_groups::opposite(fit, features, face) } else { None };
        for one in std::iter::once(face).chain(other) {
            if !out.contains(&one) {
                out.push(one);
            }
        }
    }
    out.into_iter().filter_map(named).collect()
}

/// What is no shape and no effect, but a finding: scatter of visits, and bad touches that lie together.
fn beside_the_tests(depends: &mut Vec<Where>, seen: &Examination, fit: &Fit, (beside, named): (&OtherEvidence, bool)) {
    if let Some((tau_mm, declared_mm)) = beside.scatter {
        let (sigma2, tau2) = (fit.noise.sigma_mm.powi(2), tau_mm.powi(2));
        let finding = Where {
            by: "visit".to_owned(),
            share: tau2 / (sigma2 + tau2),
            p_adjusted: 0.0,
            says: format!(
                "The rotary axes do not come back exactly: index positions scatter by {:.1} µm (from revisited poses; the machine file \
                 declares {:.1} µm). Check clamping and looseness",
                um_from_mm(tau_mm),
                um_from_mm(declared_mm)
            ),
            id: "scatter:visit".to_owned(),
            on: "visit".to_owned(),
            finding: Finding::Scatter,
        };
        depends.retain(|w| w.by != "visit");
        // what makes most of the misfit by itself makes the visits differ, too
        let named = named || depends.first().is_some_and(|w| w.share > 0.5);
        depends.insert(if named { depends.len() } else { 0 }, finding);
    }
    // an effect that is missing makes good touches look bad: those come back with it
    if let Some(g) = beside.gathered.as_ref().filter(|g| !named && depends.iter().all(|w| w.by != g.by)) {
        let residual2 = |i: usize| fit.residual_mm[i].powi(2);
        let all: f64 = (0..fit.residual_mm.len()).map(residual2).sum();
        let rejected: f64 = fit.rejected.keys().map(|&i| residual2(i)).sum();
        let finding = Where {
            by: g.by.to_owned(),
            share: if all > 0.0 { rejected / all } else { 0.0 },
            p_adjusted: g.p,
            says: format!("{} ({})", g.says(fit), g.kind()),
            id: format!("not-used:{}", g.by),
            on: g.by.to_owned(),
            finding: Finding::Outliers,
        };
        let strong = depends.first().is_some_and(|w| w.p_adjusted < FAMILY_LEVEL);
        if strong && seen.dependences.first().is_some_and(|d| d.p_adjusted < g.p) {
            depends.push(finding);
        } else {
            depends.insert(0, finding);
        }
    }
}

/// Noise and scatter with their sources, and what the tests take of it.
fn noise_says(seen: &Examination, fit: &Fit) -> String {
    let mut out = fit.noise.says();
    if (seen.evidence.tau_mm - fit.noise.tau_mm).abs() > 0.1 * fit.noise.tau_mm {
        let tau_um = um_from_mm(seen.evidence.tau_mm);
        out += &format!("; the tests use {tau_um:.2} µm, the scatter that is left with what is found");
    }
    out
}

/// A share of the misfit as one of what the noise does not explain: what functions of no meaning would take away is taken off
/// on both sides. As `compare` counts its shares.
pub(super) fn beyond_the_noise(evidence: &Evidence, share: f64, n_parameters: usize) -> f64 {
    let question = evidence.question();
    let total = question.base.project(question.residual).norm_squared();
    let (dof, q) = (evidence.dof() as f64, n_parameters as f64);
    let taken = share * total;
    let per_dof = ((total - taken) / (dof - q).max(1.0)).max(1.0);
    ((taken - q * per_dof) / (total - dof).max(4.0 * (2.0 * dof).sqrt())).clamp(0.0, 1.0)
}

fn candidate(
    fit: &Fit,
    seen: &Examination,
    (first_order, folds): (&FirstOrder, &Folds),
    group: &Group,
    (place, borne_out): (usize, bool),
) -> Candidate {
    let first = place == 0;
    let chosen = group.first();
    // sizes and what is left come from the order, probabilities from the tests
    let score = &seen.scores(place)[chosen];
    let both = seen.both.filter(|_| place < 2);
    let tested_in = if both.is_some() { seen.scores(place) } else { &seen.search.scores };
    let tests = || group.members.iter().map(|m| &tested_in[m.candidate]);
    let p = tests().map(|s| s.p).fold(1.0, f64::min);
    // two effects that are named together pass their test together
    let p_adjusted = match both {
        Some(both) => both.p_adjusted,
        None => tests().map(|s| s.p_adjusted).fold(1.0, f64::min),
    };
    let effect = seen.named.effects[chosen];
    let held = match (seen.nested.as_ref().filter(|_| first), both) {
        (_, Some(_)) => {
            let of = |place: usize| {
                let candidate = seen.groups[place].first();
                (candidate, seen.scores(place)[candidate].variant)
            };
            folds.both(seen.evidence, seen.named, [of(0), of(1)])
        }
        (Some(nested), None) => folds.chosen(seen.evidence, seen.named, nested),
        (None, None) => folds.given(seen.evidence, seen.named, chosen),
    };
    let errors = folds.errors(&held);
    let told = told(&score.covariance);
    // an order that leaves out the scatter of visits says nothing of the doubt: that is with it
    let tested = &tested_in[chosen];
    let sigma = |i: usize| {
        let both = [Some(score), Some(tested).filter(|t| t.estimate.len() == score.estimate.len())];
        both.into_iter().flatten().map(|s| s.covariance[(i, i)].max(0.0).sqrt()).fold(0.0, f64::max)
    };
    let names = seen.named.columns[chosen].iter().zip(&told);
    let not_told: Vec<String> = names.filter(|(_, told)| !**told).map(|(c, _)| c.name.clone()).collect();
    let mut parameters: Vec<Parameter> = seen.named.columns[chosen]
        .iter()
        .enumerate()
        .filter(|(i, _)| told[*i])
        .map(|(i, c)| Parameter {
            name: c.name.clone(),
            value: score.estimate[i] * c.typical,
            unit: c.unit.clone(),
            sigma: Some(sigma(i) * c.typical),
        })
        .collect();
    let says = match &not_told[..] {
        [] => effect.says.clone(),
        _ if effect.per_block => {
            let odd = super::odd_block::odd_block(&seen.named.columns[chosen], score.estimate.as_slice());
            words::differences_of_blocks(&effect.says, odd.as_ref())
        }
        some => words::without_sizes(&effect.says, some),
    };
    if let Some(scanned) = &seen.named.scanned[chosen] {
        parameters.push(Parameter {
            name: scanned.name.clone(),
            value: seen.named.library.candidates()[chosen].variants[score.variant].shape,
            unit: scanned.unit.clone(),
            sigma: None,
        });
    }
    let raw_um = seen.raw_um(place, chosen);
    let moves = moves(seen, score, &raw_um);
    // of two that are named together the error that is left, and what becomes less certain, are those with both
    let with_both = both.and_then(|_| {
        let other = seen.groups.get(1 - place)?.first();
        Some(side_by_side(&[raw_um.clone(), seen.raw_um(1 - place, other)]))
    });
    let question = seen.order().question;
    let total = question.base.project(question.residual).norm_squared().max(f64::MIN_POSITIVE);
    let raw_mm = with_both.as_ref().unwrap_or(&raw_um).map(mm_from_um);
    let taken = both.map_or(score.delta_ss, |both| both.delta_ss);
    Candidate {
        effect: effect.id.clone(),
        name: effect.name.clone(),
        // the group is one finding: its figures are those of its most significant member
        p,
        p_adjusted,
        proposed: (first || both.is_some()) && borne_out && p_adjusted < FAMILY_LEVEL,
        rms_after_um: first_order.rms_um(&raw_mm),
        held_out_before_um: errors.before_um,
        held_out_after_um: errors.after_um,
        held_out_se_um: errors.fall_se_um,
        nested: first && seen.nested.is_some() && !seen.given,
        parameters,
        not_told,
        moves_um: moves.map(|m| m.0),
        moves_sigma_um: moves.map(|m| m.1),
        same_as: group
            .members
            .iter()
            .filter(|m| m.candidate != chosen)
            .map(|m| seen.named.effects[m.candidate].id.clone())
            .collect(),
        together_with: both.and_then(|_| seen.first_names().get(1 - place).map(|id| (*id).to_owned())),
        or_else: None,
        tell_apart: String::new(),
        never_parted: false,
        says,
        look: effect.look.clone(),
        too_large: effect.too_large.clone(),
        share: taken / total,
        times_usual: score.relative_size(),
        plausible: score.relative_size() <= crate::search::groups::PLAUSIBLE,
        wrong_sign: {
            let names = &seen.named.columns[chosen];
            score.wrong_signs(&seen.named.library).into_iter().map(|k| names[k].name.clone()).collect()
        },
        weakens: weakened(fit, first_order, &raw_mm),
        remains: None,
    }
}

/// Sizes of an effect with a shape that was scanned, from the fit with it: beside one value of the shape they would look surer than
/// they are.
pub(super) fn sizes_of_refit(candidate: &mut Candidate, again: &Fit) {
    if !candidate.is_beside_a_shape() {
        return;
    }
    let mut lost = Vec::new();
    for mut p in std::mem::take(&mut candidate.parameters) {
        match again.outcome.parameters.iter().find(|fitted| fitted.name == p.name) {
            Some(fitted) if fitted.sigma.is_some() => {
                (p.value, p.sigma) = (fitted.value, fitted.sigma);
                candidate.parameters.push(p);
            }
            Some(_) if p.sigma.is_some() => lost.push(p.name),
            _ => candidate.parameters.push(p),
        }
    }
    if !lost.is_empty() {
        candidate.says = words::without_sizes(&candidate.says, &lost);
        candidate.not_told.extend(lost);
    }
}

/// By how much an effect of the expected size moves the touch that it moves most, with its standard uncertainty, µm: told
/// where its parameters are not told one by one.
fn moves(seen: &Examination, score: &Score, raw_um: &DMatrix<f64>) -> Option<(f64, f64)> {
    let at = raw_um * &score.estimate;
    let most = seen.evidence.used.iter().copied().max_by(|&a, &b| at[a].abs().total_cmp(&at[b].abs()))?;
    let row = raw_um.row(most).transpose();
    Some((at[most].abs(), row.dot(&(&score.covariance * &row)).max(0.0).sqrt()))
}

/// Which parameters of an effect have a size: those whose direction lies within what the plan sees of it. The covariance
/// has the rank of that.
fn told(covariance: &DMatrix<f64>) -> Vec<bool> {
    let n = covariance.nrows();
    let scale = |i: usize| covariance[(i, i)].max(0.0).sqrt();
    let scaled = DMatrix::from_fn(n, n, |i, j| {
        let by = scale(i) * scale(j);
        if by > 0.0 { covariance[(i, j)] / by } else { 0.0 }
    });
    let eigen = scaled.symmetric_eigen();
    (0..n)
        .map(|i| {
            let seen: f64 =
                (0..n).filter(|&k| eigen.eigenvalues[k] > 1e-9).map(|k| eigen.eigenvectors[(i, k)].powi(2)).sum();
            scale(i) > 0.0 && seen > 1.0 - 1e-6
        })
        .collect()
}

/// Results that an added effect makes less certain, from the one fit.
fn weakened(fit: &Fit, first_order: &FirstOrder, raw_mm: &DMatrix<f64>) -> Vec<Weakened> {
    let (covariance, added) = (&first_order.covariance, first_order.added_variance(raw_mm));
    let mut out = Vec::new();
    for (c, &i) in fit.free.iter().enumerate() {
        let u = &fit.model.unknowns[i];
        let p = &fit.outcome.parameters[i];
        if u.nuisance || p.sigma.is_none() || p.status != crate::fit::outcome::Status::Identified {
            continue;
        }
        let (before, after) = (covariance[(c, c)], covariance[(c, c)] + added[c]);
        if after > WEAKENED * WEAKENED * before {
            out.push(Weakened {
                name: u.name.clone(),
                unit: u.unit.clone(),
                sigma_before: before.sqrt(),
                sigma_after: after.sqrt(),
            });
        }
    }
    out
}

/// Outliers of a fit.
pub(super) fn outliers(fit: &Fit) -> Vec<Outlier> {
    let each = fit.rejected.iter().filter(|(_, reason)| reason.is_outlier()).map(|(&i, reason)| {
        let o = &fit.data.observations[i];
        let Origin { block, face, .. } = fit.data.origins[i].clone();
        Outlier { id: o.id, run: o.run + 1, reason: reason.says(), block, face, comes_back: false }
    });
    each.collect()
}

/// Outliers that are used again with the first candidate in the model.
pub(super) fn outliers_again(out: &mut Diagnosis, before: &Fit, after: &Fit) {
    for (&i, _) in before.rejected.iter().filter(|(i, _)| after.weight[**i] > 0.0) {
        let o = &before.data.observations[i];
        if let Some(outlier) = out.outliers.iter_mut().find(|x| x.id == o.id && x.run == o.run + 1) {
            outlier.comes_back = true;
        }
    }
}
