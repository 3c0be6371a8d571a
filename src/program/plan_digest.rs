//! Digests of a plan: one for each field that a fit reads, which show what was changed since the plan was written, and one of all
//! of them, which the log carries.
//!
//! They are taken from rounded numbers, so that a plan that has been written and read again keeps them.

use super::plan::{ControllerFrame, Plan, PlanBlock, PlanTouch};
use crate::axes::AxisMap;
use crate::diag::{Finding, Source, in_json};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fmt::Write;

/// From the name of a field to its digest, eight hexadecimal digits.
pub type Fields = BTreeMap<String, String>;

/// The field of a plan's file that holds the digests of the others.
pub(super) const FIELD: &str = "fields_sha256";

/// Numbers are taken in steps of a millionth, mm, deg or s: a nanometre.
const STEPS: f64 = 1e6;

type OfPlan = fn(&mut Canonical, &Plan);
type OfBlock = fn(&mut Canonical, &PlanBlock);
type OfTouch = fn(&mut Canonical, &PlanTouch);

const OF_PLAN: [(&str, OfPlan); 8] = [
    ("machine", |c, p| c.text(&p.machine)),
    ("program", |c, p| c.text(&p.program)),
    ("mounting", |c, p| c.text(&p.mounting)),
    ("blocks_anew", |c, p| c.whole(u64::from(p.blocks_anew))),
    ("controller_frame", |c, p| c.whole(u64::from(p.controller_frame == ControllerFrame::Tcp))),
    ("ball_radius_mm", |c, p| c.number(p.ball_radius_mm)),
    ("tool_length_mm", |c, p| c.number(p.tool_length_mm)),
    ("placement_tolerance_mm", |c, p| {
        c.maybe(p.placement_tolerance_mm);
        // plans of artefacts that stand within it keep the digest that they always had
        if let Some(find) = &p.find {
            c.text(&find.block);
            c.number(find.tolerance_mm);
            c.number(find.room_mm);
            for t in &find.touches {
                c.text(&t.face);
                [&t.start, &t.nominal, &t.end, &t.moves].into_iter().for_each(|map| c.axes(map));
            }
        }
    }),
];

const OF_BLOCKS: [(&str, OfBlock); 5] = [
    ("blocks.name", |c, b| c.text(&b.name)),
    ("blocks.carrier", |c, b| c.text(&b.carrier)),
    ("blocks.mounting", |c, b| c.text(b.mounting.as_deref().unwrap_or_default())),
    ("blocks.centre", |c, b| c.numbers(&b.centre)),
    ("blocks.size", |c, b| {
        c.numbers(&b.size);
        // plans of boxes keep the digest that they always had
        if !b.form.is_box() {
            c.text(b.form.as_str());
            c.maybe(b.diameter);
        }
    }),
];

const OF_TOUCHES: [(&str, OfTouch); 21] = [
    ("touches.id", |c, t| c.whole(t.id)),
    ("touches.stage", |c, t| c.text(&t.stage)),
    ("touches.repeat", |c, t| c.whole(t.repeat.into())),
    ("touches.carrier", |c, t| c.text(&t.carrier)),
    ("touches.mounting", |c, t| c.text(t.mounting.as_deref().unwrap_or_default())),
    ("touches.block", |c, t| c.text(&t.block)),
    ("touches.face", |c, t| c.text(&t.face)),
    ("touches.point", |c, t| c.numbers(&t.point)),
    ("touches.normal", |c, t| c.numbers(&t.normal)),
    ("touches.pose", |c, t| c.axes(&t.pose)),
    ("touches.start", |c, t| c.axes(&t.start)),
    ("touches.nominal", |c, t| c.axes(&t.nominal)),
    ("touches.end", |c, t| c.axes(&t.end)),
    ("touches.time_s", |c, t| c.maybe(t.time_s)),
    ("touches.visit", |c, t| c.maybe(t.visit.map(f64::from))),
    ("touches.feed_mm_min", |c, t| c.maybe(t.feed_mm_min)),
    ("touches.spindle_deg", |c, t| c.maybe(t.spindle_deg)),
    ("touches.tool_length_mm", |c, t| c.maybe(t.tool_length_mm)),
    ("touches.ball_radius_mm", |c, t| c.maybe(t.ball_radius_mm)),
    ("touches.from", |c, t| c.axes(&t.from)),
    ("touches.first", |c, t| c.whole(u64::from(t.first))),
];

/// What a field holds, always written in the same way.
#[derive(Default)]
struct Canonical(Sha256);

impl Canonical {
    fn whole(&mut self, value: u64) {
        self.0.update(value.to_le_bytes());
    }

    fn number(&mut self, value: f64) {
        // beyond the range of whole numbers no plan is usable: there they may all be the same
        self.0.update(((value * STEPS).round() as i64).to_le_bytes());
    }

    fn maybe(&mut self, value: Option<f64>) {
        self.0.update([u8::from(value.is_some())]);
        if let Some(value) = value {
            self.number(value);
        }
    }

    fn numbers(&mut self, values: &[f64; 3]) {
        values.iter().for_each(|v| self.number(*v));
    }

    fn text(&mut self, text: &str) {
        self.whole(text.len() as u64);
        self.0.update(text.as_bytes());
    }

    fn axes(&mut self, map: &AxisMap) {
        for (axis, value) in map.iter() {
            self.0.update([axis.index() as u8]);
            self.number(value);
        }
        self.0.update([u8::MAX]);
    }

    /// The digest of all items of a list.
    fn of<T>(items: &[T], write: fn(&mut Self, &T)) -> String {
        let mut all = Self::default();
        items.iter().for_each(|item| write(&mut all, item));
        hexadecimal(&all.0.finalize()[..4]).to_ascii_lowercase()
    }
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut hex, byte| {
        // writing into a String cannot fail
        let _ = write!(hex, "{byte:02X}");
        hex
    })
}

/// The digest of each field of a plan that a fit reads.
#[must_use]
pub fn field_digests(plan: &Plan) -> Fields {
    let of_touches = |(name, write): &(&str, OfTouch)| ((*name).to_owned(), Canonical::of(&plan.touches, *write));
    let mut fields: Fields = OF_TOUCHES.iter().map(of_touches).collect();
    fields.extend(OF_BLOCKS.iter().map(|(name, write)| ((*name).to_owned(), Canonical::of(&plan.blocks, *write))));
    let whole = std::slice::from_ref(plan);
    fields.extend(OF_PLAN.iter().map(|(name, write)| ((*name).to_owned(), Canonical::of(whole, *write))));
    fields
}

/// The digest that the log of a plan carries: twelve hexadecimal digits of all fields together.
#[must_use]
pub fn digest(plan: &Plan) -> String {
    let text = field_digests(plan).iter().fold(String::new(), |mut text, (name, digest)| {
        let _ = writeln!(text, "{name}={digest}");
        text
    });
    hexadecimal(&Sha256::digest(text.as_bytes())[..6])
}

/// Refuses a plan whose fields are not those with which it was written. Plans of earlier versions hold no digests: of them only the
/// log knows.
#[must_use]
pub fn changed(written: &Fields, now: &Fields, source: &Source) -> Option<Finding> {
    if written.is_empty() {
        return None;
    }
    let other: Vec<&str> =
        now.iter().filter(|(name, digest)| written.get(*name) != Some(digest)).map(|(name, _)| name.as_str()).collect();
    let place = in_json(source.inner(), None, FIELD).unwrap_or(0..0);
    (!other.is_empty()).then(|| {
        Finding::error("plan::changed", format!("the plan was changed after it was written: {}", other.join(", ")))
            .help("use the plan as `axiscal generate` wrote it together with the program; for other touches, change the program and generate it again")
            .at(source, place)
    })
}

/// The digest that logs of earlier versions carry: of names, frame, and nominal and last positions with four decimals.
#[must_use]
pub fn older(plan: &Plan) -> String {
    let mut text = String::new();
    let frame = if plan.controller_frame == ControllerFrame::Tcp { "tcp" } else { "axes" };
    let _ = write!(text, "{} {} {frame}", plan.machine, plan.program);
    for touch in &plan.touches {
        let _ = write!(text, "\n{}", touch.id);
        for value in touch.nominal_position().0.iter().chain(&touch.end_position().0) {
            let _ = write!(text, " {:.4}", value + 0.0);
        }
    }
    hexadecimal(&Sha256::digest(text.as_bytes())[..6])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diag::source;
    use crate::post::tests::{machine, plan};
    use serde_json::{Value, json};

    fn head() -> Plan {
        plan(&machine("swivel-head"), "head", "x+")
    }

    /// Every field of a plan's file has its digest, but for those that no fit reads.
    #[test]
    fn every_field_that_a_fit_reads_has_its_digest() {
        let mut whole = head();
        whole.placement_tolerance_mm = Some(1.0);
        whole.blocks_anew = true;
        whole.controller_frame = ControllerFrame::Tcp;
        whole.blocks[0].mounting = Some("head".to_owned());
        let t = &mut whole.touches[0];
        (t.time_s, t.visit, t.feed_mm_min, t.spindle_deg) = (Some(1.0), Some(1), Some(60.0), Some(90.0));
        (t.tool_length_mm, t.ball_radius_mm, t.mounting) = (Some(200.0), Some(3.0), Some("head".to_owned()));
        (t.from, t.first) = (t.pose, true);
        let written: Value = serde_json::from_str(&whole.to_json()).unwrap();
        let names = |within: &str, of: &Value| -> Vec<String> {
            of.as_object().unwrap().keys().map(|key| format!("{within}{key}")).collect()
        };
        let mut expected = names("", &written);
        expected.extend(names("blocks.", &written["blocks"][0]));
        expected.extend(names("touches.", &written["touches"][0]));
        let unread = ["format", "machine_sha256", FIELD, "blocks", "touches"];
        expected.retain(|name| !unread.contains(&name.as_str()));
        expected.sort();
        assert_eq!(field_digests(&whole).into_keys().collect::<Vec<_>>(), expected);
    }

    #[test]
    fn a_change_of_a_field_is_named_and_another_one_is_not() {
        let text = head().to_json();
        let found = |edit: &dyn Fn(&mut Value)| {
            let mut value: Value = serde_json::from_str(&text).unwrap();
            edit(&mut value);
            match Plan::parse(&source("p", value.to_string())) {
                Ok(_) => String::new(),
                Err(failure) => failure.0.iter().map(|f| format!("{} {}", f.code, f.message)).collect(),
            }
        };
        assert_eq!(found(&|_| {}), "");
        // a name beside it, of a later version, and what no fit reads
        assert_eq!(found(&|p| p[FIELD]["later"] = json!("00000000")), "");
        assert_eq!(found(&|p| p["notes"] = json!(["a remark"])), "");
        let said = found(&|p| p["tool_length_mm"] = json!(202.704));
        assert!(said.starts_with("plan::changed") && said.ends_with(": tool_length_mm"), "{said}");
        let said = found(&|p| p["touches"][2]["start"]["X"] = json!(27.99));
        assert!(said.starts_with("plan::changed") && said.ends_with(": touches.start"), "{said}");
        // an entry that was taken out or edited is no way around it
        let said = found(&|p| drop(p[FIELD].as_object_mut().unwrap().remove("blocks.size")));
        assert!(said.ends_with(": blocks.size"), "{said}");
        let said = found(&|p| p[FIELD]["touches.face"] = json!("00000000"));
        assert!(said.ends_with(": touches.face"), "{said}");
        // all of them taken out: a plan as of earlier versions
        assert_eq!(found(&|p| drop(p.as_object_mut().unwrap().remove(FIELD))), "");
    }

    #[test]
    fn digests_that_are_none_have_their_place() {
        let text = head().to_json();
        let at = text.find(FIELD).unwrap();
        let broken = format!("{}{FIELD}\": 5\n}}\n", &text[..at]);
        let line = broken.lines().count() - 1;
        let failure = Plan::parse(&source("p", broken)).unwrap_err();
        let place = failure.0[0].place().unwrap();
        assert!(failure.0[0].code == "plan::not_json" && place.starts_with(&format!("p:{line}:")), "{place}");
    }

    #[test]
    fn the_digest_of_the_log_knows_every_field() {
        let before = head();
        let mut edited = before.clone();
        edited.tool_length_mm += 0.005;
        assert_ne!(digest(&before), digest(&edited));
        assert_eq!(older(&before), older(&edited));
        assert!(digest(&before).len() == 12 && older(&before).len() == 12);
        edited = before.clone();
        // what rounding leaves
        edited.touches[0].point[0] += 1e-12;
        assert_eq!(digest(&before), digest(&edited));
    }
}
