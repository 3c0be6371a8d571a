//! The answer of `assess` as text.

use super::fit::{number, significant, table};
use super::lay::lay;
use super::plot::Paper;
use crate::design::record::{Advice, Assessment, Seen};
use comfy_table::Cell;

/// Effects that contain another one are listed up to so many.
const MOST_INSIDE: usize = 3;

/// Touches that would help, and what they help, are listed up to so many.
const MOST_SHOWN: usize = 6;

/// The whole answer.
#[must_use]
pub fn assessment(a: &Assessment, paper: Paper) -> String {
    let mut out = String::new();
    if a.compared.is_empty() {
        one(a, paper, &mut out);
    } else {
        side_by_side(a, paper, &mut out);
    }
    let each = std::iter::once(a).chain(&a.compared);
    let mut said: Vec<&String> = each.flat_map(|a| &a.warnings).collect();
    said.dedup();
    for w in said {
        out += &format!("warning: {w}\n");
    }
    paper.plain(out)
}

fn one(a: &Assessment, paper: Paper, out: &mut String) {
    *out += &format!(
        "{} with {}: {} touches in {}; {} unknowns of rank {}\n",
        a.machine,
        a.plan.join(" and "),
        a.touches,
        time(a.time_s),
        a.unknowns,
        a.rank
    );
    *out += &format!("model: {}\n", a.model.join(", "));
    *out += &format!("this plan is {}: {}\n\n", a.score.word(), a.says);
    let mut t =
        table(&["parameter", "unit", "probe noise alone", "with indexing", "with unmodelled effects", "includes"]);
    for p in &a.parameters {
        let name = p.alias.as_ref().map_or_else(|| p.name.clone(), |alias| format!("{} ({alias})", p.name));
        let size = |s: Option<f64>| number(s.map_or_else(|| "unknown".into(), significant));
        t.add_row(vec![
            Cell::new(name),
            Cell::new(&p.unit),
            size(p.sigma),
            size(p.sigma_with_visits),
            size(p.sigma_with_unmodelled),
            Cell::new(p.holds.join(", ")),
        ]);
    }
    lay(&mut t, paper.width.min(120), &[]);
    *out += &format!(
        "expected standard uncertainty at {} µm noise of a touch ({} µm scatter of index positions in the second and third)\n{t}\n\n",
        significant(a.noise_um),
        significant(a.visit_um)
    );
    for u in &a.undetermined {
        *out += &format!("cannot be determined: {}\n", u.says);
    }
    if !a.parted_together.is_empty() {
        *out += &super::fit::together(&a.parted_together, a.never_determined);
    }
    let visible = a.effects.iter().filter(|e| e.visible).count();
    *out += &format!(
        "\neffects that are not in the model: {visible} of {} have an effect on the touches\n",
        a.effects.len()
    );
    let mut t = table(&["effect", "found from, µm", "usual, µm", "cannot be separated from"]);
    for e in a.effects.iter().filter(|e| e.visible) {
        t.add_row(vec![
            Cell::new(&e.effect),
            number(e.minimal_detectable_um.map_or_else(|| "never".into(), significant)),
            number(significant(e.typical_um)),
            Cell::new(short(e, a)),
        ]);
    }
    lay(&mut t, paper.width.min(120), &[]);
    *out += &format!("{t}\n");
    let invisible: Vec<&Seen> = a.effects.iter().filter(|e| !e.visible).collect();
    if !invisible.is_empty() {
        *out += "\ncannot be seen at any size:\n";
        for e in invisible {
            *out += &format!("  {}: {}\n", e.effect, e.tell_apart);
        }
    }
    if !a.alias_groups.is_empty() {
        *out += &format!(
            "\ncannot be separated ({} pairs in all, with those of which only one explains the other):\n",
            a.alias_pairs
        );
        for (g, number) in a.alias_groups.iter().zip(1..) {
            *out += &format!("  group {number}: {}\n", g.join(" = "));
            if let Some(how) = group_parted(g, a) {
                *out += &format!("    {how}\n");
            }
        }
    }
    if !a.advice.is_empty() {
        *out += "\nwhat would help most for its time:\n";
        for x in &a.advice {
            let mut gains = Vec::new();
            if x.determines > 0 {
                gains.push(format!("determines {} more combination(s)", x.determines));
            }
            if !x.shows.is_empty() {
                gains.push(format!("shows {}", listed(&x.shows)));
            }
            if x.parts > 0 {
                gains.push(format!("separates {} pair{}", x.parts, if x.parts == 1 { "" } else { "s" }));
            }
            *out += &format!("  +{} {}: {}\n", time(x.time_s), x.says, gains.join(", "));
        }
    }
}

fn side_by_side(first: &Assessment, paper: Paper, out: &mut String) {
    let all: Vec<&Assessment> = std::iter::once(first).chain(&first.compared).collect();
    let names: Vec<String> = all.iter().map(|a| a.plan.join("+")).collect();
    let mut head = vec![first.machine.as_str()];
    head.extend(names.iter().map(String::as_str));
    let mut t = table(&head);
    let mut row = |what: &str, of: &dyn Fn(&Assessment) -> String| {
        let mut cells = vec![Cell::new(what)];
        cells.extend(all.iter().map(|a| number(of(a))));
        t.add_row(cells);
    };
    row("score", &|a| a.score.word().into());
    row("touches", &|a| a.touches.to_string());
    row("time", &|a| time(a.time_s));
    row("combinations not determined", &|a| a.undetermined.len().to_string());
    row("effects that show", &|a| format!("{} of {}", a.effects.iter().filter(|e| e.visible).count(), a.effects.len()));
    row("pairs not separated", &|a| a.alias_pairs.to_string());
    for p in &first.parameters {
        let of = |a: &Assessment| a.parameters.iter().find(|q| q.name == p.name).cloned();
        row(&format!("{} ({})", p.name, p.unit), &|a| {
            of(a).and_then(|q| q.sigma).map_or_else(|| "unknown".into(), significant)
        });
        row("  with indexing", &|a| {
            of(a).and_then(|q| q.sigma_with_visits).map_or_else(|| "unknown".into(), significant)
        });
        row("  with unmodelled", &|a| {
            of(a).and_then(|q| q.sigma_with_unmodelled).map_or_else(|| "unknown".into(), significant)
        });
    }
    lay(&mut t, paper.width.min(160), &[]);
    *out += &format!("{t}\n");
    for (a, name) in all.iter().zip(&names) {
        *out += &format!("{name} is {}: {}\n", a.score.word(), a.says);
    }
    let shown = |a: &Assessment, id: &str| a.effects.iter().find(|e| e.effect == id).is_some_and(|e| e.visible);
    for (a, name) in all.iter().zip(&names).skip(1) {
        let only = |x: &Assessment, y: &Assessment| -> Vec<String> {
            x.effects.iter().filter(|e| e.visible && !shown(y, &e.effect)).map(|e| e.effect.clone()).collect()
        };
        for (left, right, better, worse) in [(first, *a, &names[0], name), (*a, first, name, &names[0])] {
            let gained = only(left, right);
            if !gained.is_empty() {
                *out += &format!("{better} shows what {worse} does not: {}\n", gained.join(", "));
            }
        }
    }
}

/// What an effect cannot be told from, shortened.
fn short(e: &Seen, a: &Assessment) -> String {
    let group = a.alias_groups.iter().position(|g| g.contains(&e.effect));
    let mut words: Vec<String> = group.iter().map(|i| format!("group {}", i + 1)).collect();
    let others = e.contained_in.iter().filter(|s| !group.is_some_and(|g| a.alias_groups[g].contains(s)));
    words.extend(others.map(|s| format!("in {s}")));
    if words.len() > MOST_INSIDE {
        return format!("{} and {} more", words[..MOST_INSIDE].join(", "), words.len() - MOST_INSIDE);
    }
    words.join(", ")
}

/// What parts a group: the variation that helps most of its members.
fn group_parted(group: &[String], a: &Assessment) -> Option<String> {
    let members: Vec<&Seen> = a.effects.iter().filter(|e| group.contains(&e.effect)).collect();
    let helps = |habit: &str| members.iter().filter(|e| e.habits.iter().any(|h| h == habit)).count();
    // the most members, then the least time: the advice has the quickest gain first, which is not the same
    let order = |x: &&Advice, y: &&Advice| helps(&x.habit).cmp(&helps(&y.habit)).then(y.time_s.total_cmp(&x.time_s));
    let best = a.advice.iter().max_by(order).filter(|x| helps(&x.habit) > 0);
    match best {
        Some(x) => {
            Some(format!("{} (+{}) helps with {} of {}", x.says, time(x.time_s), helps(&x.habit), members.len()))
        }
        None => members.iter().map(|e| &e.tell_apart).find(|t| !t.is_empty()).cloned(),
    }
}

fn listed(words: &[String]) -> String {
    if words.len() <= MOST_SHOWN {
        return words.join(", ");
    }
    format!("{} and {} more", words[..MOST_SHOWN].join(", "), words.len() - MOST_SHOWN)
}

fn time(seconds: f64) -> String {
    // as `generate` says it
    let minutes = (seconds / 60.0).round().max(1.0);
    if minutes < 100.0 { format!("{minutes:.0} min") } else { format!("{:.1} h", seconds / 3600.0) }
}
