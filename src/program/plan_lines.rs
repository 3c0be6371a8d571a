//! The lines of touches as [`Plan::to_json`] writes them, read in one go: what the library reads, for lines without anything
//! unusual, in two thirds of its time. A plan has twenty numbers and thirty known words for every touch, always in one order.
//!
//! Nothing is decided here: whatever is not exactly so (other blanks, another order, an escaped letter, a field that is not known)
//! is `None`, and the library has the word. A test compares the two.

use super::plan::{Plan, PlanTouch};
use crate::axes::{AxisMap, AxisName};
use compact_str::CompactString;
use memchr::{memchr_iter, memmem};
use rayon::prelude::*;

/// Below this number of lines threads are not worth their start.
const FEW: usize = 2000;

/// Digits that are surely below 2^64 as one number.
const DIGITS: usize = 19;

const POWERS: [f64; DIGITS + 1] =
    [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19];

/// The plan of a text, where it is written as usual, and the text without its touches.
pub(super) fn read(text: &str) -> Option<(Plan, String)> {
    const BEGIN: &str = "\n  \"touches\": [";
    const END: &str = "\n  ]";
    // many bytes at a time: the end is some megabytes behind the beginning
    let find = |within: &str, what: &str| memmem::find(within.as_bytes(), what.as_bytes());
    let begin = find(text, BEGIN)? + BEGIN.len();
    let end = begin + find(&text[begin..], END)?;
    let lines = text[begin..end].strip_prefix('\n')?;
    let ends = memchr_iter(b'\n', lines.as_bytes()).chain([lines.len()]);
    let from = |from: &mut usize, end| Some(&lines[std::mem::replace(from, end + 1)..end]);
    let lines: Vec<&str> = ends.scan(0, from).collect();
    let n = lines.len();
    let touch = |(i, line): (usize, &&str)| {
        let line = if i + 1 < n { line.strip_suffix(',')? } else { line };
        self::touch(line)
    };
    let touches = if n < FEW || rayon::current_num_threads() < 2 {
        let mut out = Vec::with_capacity(n);
        for line in lines.iter().enumerate() {
            out.push(touch(line)?);
        }
        out
    } else {
        // each straight into its place: they are larger than their lines
        let mut read = Vec::new();
        lines.par_iter().enumerate().map(touch).collect_into_vec(&mut read);
        read.into_iter().collect::<Option<Vec<PlanTouch>>>()?
    };
    let frame = format!("{}{}", &text[..begin], &text[end + END.len() - 1..]);
    // a field of that name inside of another one is not what is meant
    if frame.matches("\"touches\"").count() != 1 {
        return None;
    }
    let plan: Plan = serde_json::from_str(&frame).ok()?;
    plan.touches.is_empty().then_some((Plan { touches, ..plan }, frame))
}

fn touch(line: &str) -> Option<PlanTouch> {
    let mut at = Cursor { rest: line.strip_prefix("    {\"id\":")?.as_bytes() };
    let id = at.whole()?;
    let stage = at.after(",\"stage\":")?.text()?;
    let repeat = if at.goes_on(",\"repeat\":") { u32::try_from(at.whole()?).ok()? } else { 1 };
    let carrier = at.after(",\"carrier\":")?.text()?;
    let mounting = if at.goes_on(",\"mounting\":") { Some(at.text()?.into_string()) } else { None };
    let block = at.after(",\"block\":")?.text()?;
    let face = at.after(",\"face\":")?.text()?;
    let point = at.after(",\"point\":")?.vector()?;
    let normal = at.after(",\"normal\":")?.vector()?;
    let pose = at.after(",\"pose\":")?.axes()?;
    let start = at.after(",\"start\":")?.axes()?;
    let nominal = at.after(",\"nominal\":")?.axes()?;
    let end = at.after(",\"end\":")?.axes()?;
    let time_s = at.number_if(",\"time_s\":")?;
    let visit = if at.goes_on(",\"visit\":") { Some(u32::try_from(at.whole()?).ok()?) } else { None };
    let feed_mm_min = at.number_if(",\"feed_mm_min\":")?;
    let spindle_deg = at.number_if(",\"spindle_deg\":")?;
    let tool_length_mm = at.number_if(",\"tool_length_mm\":")?;
    let ball_radius_mm = at.number_if(",\"ball_radius_mm\":")?;
    let from = if at.goes_on(",\"from\":") { at.axes()? } else { AxisMap::default() };
    let first = at.goes_on(",\"first\":true");
    (at.rest == b"}").then_some(PlanTouch {
        id,
        stage,
        repeat,
        carrier,
        mounting,
        block,
        face,
        point,
        normal,
        pose,
        start,
        nominal,
        end,
        time_s,
        visit,
        feed_mm_min,
        spindle_deg,
        tool_length_mm,
        ball_radius_mm,
        from,
        first,
    })
}

/// What is left of a line.
struct Cursor<'a> {
    rest: &'a [u8],
}

impl Cursor<'_> {
    /// Behind a word, if it stands here.
    fn goes_on(&mut self, word: &str) -> bool {
        let rest = self.rest.strip_prefix(word.as_bytes());
        self.rest = rest.unwrap_or(self.rest);
        rest.is_some()
    }

    fn after(&mut self, word: &str) -> Option<&mut Self> {
        self.goes_on(word).then_some(self)
    }

    /// A text in quotes without anything escaped.
    fn text(&mut self) -> Option<CompactString> {
        let rest = self.rest.strip_prefix(b"\"")?;
        let end = rest.iter().position(|b| matches!(b, b'"' | b'\\' | 0..=31))?;
        if rest[end] != b'"' {
            return None;
        }
        self.rest = &rest[end + 1..];
        CompactString::from_utf8(&rest[..end]).ok()
    }

    /// How many digits stand here (no more than there is room for), and what they make of a value.
    fn digits(&mut self, mut value: u64, room: usize) -> Option<(usize, u64)> {
        let mut count = 0;
        loop {
            let digit = self.rest.get(count)?.wrapping_sub(b'0');
            if digit > 9 {
                break;
            }
            if count == room {
                return None;
            }
            value = value * 10 + u64::from(digit);
            count += 1;
        }
        self.rest = &self.rest[count..];
        Some((count, value))
    }

    fn whole(&mut self) -> Option<u64> {
        let begins_with_0 = self.rest.first() == Some(&b'0');
        let (count, value) = self.digits(0, DIGITS)?;
        let ends = !matches!(self.rest.first(), Some(b'.' | b'e' | b'E'));
        (count == 1 || count > 1 && !begins_with_0).then_some(value).filter(|_| ends)
    }

    fn number(&mut self) -> Option<f64> {
        let here = self.rest;
        self.plain_number().or_else(|| {
            // an exponent, or more digits
            let of_number = |b: &u8| matches!(b, b'0'..=b'9' | b'-' | b'+' | b'.' | b'e' | b'E');
            let end = here.iter().position(|b| !of_number(b))?;
            self.rest = &here[end..];
            by_the_library(&here[..end])
        })
    }

    fn plain_number(&mut self) -> Option<f64> {
        let negative = self.goes_on("-");
        let begins_with_0 = self.rest.first() == Some(&b'0');
        let (whole, mut value) = self.digits(0, DIGITS)?;
        if whole == 0 || whole > 1 && begins_with_0 {
            return None;
        }
        let mut places = 0;
        if self.goes_on(".") {
            (places, value) = self.digits(value, DIGITS - whole)?;
            if places == 0 {
                return None;
            }
        }
        if matches!(self.rest.first(), Some(b'e' | b'E')) {
            return None;
        }
        // as the library does it, to the last bit
        let size = value as f64 / POWERS[places];
        Some(if negative { -size } else { size })
    }

    /// `Some(None)`: there is none; `None`: it is unusual.
    #[allow(clippy::option_option)]
    fn number_if(&mut self, word: &str) -> Option<Option<f64>> {
        if self.goes_on(word) { Some(Some(self.number()?)) } else { Some(None) }
    }

    fn vector(&mut self) -> Option<[f64; 3]> {
        let x = self.after("[")?.number()?;
        let y = self.after(",")?.number()?;
        let z = self.after(",")?.number()?;
        self.after("]")?;
        Some([x, y, z])
    }

    fn axes(&mut self) -> Option<AxisMap> {
        let mut out = AxisMap::default();
        self.after("{")?;
        while !self.goes_on("}") {
            if !out.is_empty() {
                self.after(",")?;
            }
            let [b'"', letter, b'"', b':', ..] = self.rest else { return None };
            let axis = AxisName::ALL.into_iter().find(|a| a.letter() == char::from(*letter))?;
            self.rest = &self.rest[4..];
            out.set(axis, self.number()?);
        }
        Some(out)
    }
}

fn by_the_library(bytes: &[u8]) -> Option<f64> {
    serde_json::from_slice(bytes).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diag::source;
    use proptest::prelude::*;

    fn plan(touches: Vec<PlanTouch>) -> Plan {
        let frame = r#"{"format": "axiscal-plan/1", "machine": "m", "program": "p", "mounting": "p", "ball_radius_mm": 3.0,
            "tool_length_mm": 200.0, "blocks": [{"name": "a", "carrier": "C", "centre": [0, 0, 0], "size": [10, 10, 10]}],
            "touches": []}"#;
        Plan { touches, ..serde_json::from_str(frame).unwrap() }
    }

    fn number() -> impl Strategy<Value = f64> {
        prop_oneof![
            (-500_000i32..500_000).prop_map(|n| f64::from(n) / 1000.0),
            (-1e3..1e3f64),
            Just(-0.0),
            Just(1e-9),
            Just(1e22),
            any::<f64>().prop_filter("JSON has no such number", |v| v.is_finite()),
        ]
    }

    fn axes() -> impl Strategy<Value = AxisMap> {
        proptest::collection::vec(proptest::option::of(number()), 6).prop_map(|values| {
            let all = AxisName::ALL.into_iter().zip(values);
            all.fold(AxisMap::default(), |out, (axis, v)| v.map_or(out, |v| out.with(axis, v)))
        })
    }

    prop_compose! {
        fn a_touch()(
            id in 0..u64::MAX, repeat in any::<u32>(), visit in proptest::option::of(any::<u32>()),
            words in proptest::array::uniform4("[a-zA-Z+ \"\\\\\u{e9}-]{0,20}"), mounting in proptest::option::of("[a-z#2]{0,9}"),
            point in proptest::array::uniform3(number()), normal in proptest::array::uniform3(number()),
            maps in proptest::collection::vec(axes(), 5), some in proptest::collection::vec(proptest::option::of(number()), 5),
            first in any::<bool>(),
        ) -> PlanTouch {
            let [stage, carrier, block, face] = words.map(CompactString::from);
            PlanTouch {
                id, stage, repeat, carrier, mounting, block, face, point, normal, pose: maps[0], start: maps[1],
                nominal: maps[2], end: maps[3], time_s: some[0], visit, feed_mm_min: some[1], spindle_deg: some[2],
                tool_length_mm: some[3], ball_radius_mm: some[4], from: maps[4], first,
            }
        }
    }

    proptest! {
        #[test]
        fn what_is_read_quickly_is_what_the_library_reads(touches in proptest::collection::vec(a_touch(), 1..6)) {
            let text = plan(touches).to_json();
            let whole: Plan = serde_json::from_str(&text).unwrap();
            if let Some((quick, _)) = read(&text) {
                prop_assert_eq!(format!("{quick:?}"), format!("{whole:?}"));
            }
            let usual = |t: &PlanTouch| {
                let words = [&t.stage, &t.carrier, &t.block, &t.face];
                t.id < 10_000_000_000_000_000_000 && !words.iter().any(|w| w.contains(['"', '\\']))
            };
            prop_assert_eq!(read(&text).is_some(), whole.touches.iter().all(usual));
        }

        /// One letter of a usual plan is another one, is missing or stands twice.
        #[test]
        fn a_slip_is_read_as_the_library_reads_it_or_not_at_all(
            touch in a_touch(), at in any::<proptest::sample::Index>(), by in "[0-9eE.,:\"{}\\[\\]+ \n-]{0,2}",
        ) {
            let mut text = plan(vec![PlanTouch { id: 7, ..touch.clone() }, PlanTouch { id: 12, ..touch }]).to_json();
            let places: Vec<usize> = text.char_indices().map(|(i, _)| i).collect();
            let from = *at.get(&places);
            let to = from + text[from..].chars().next().map_or(0, char::len_utf8);
            text.replace_range(from..to, &by);
            if let Some((quick, _)) = read(&text) {
                let whole: Result<Plan, _> = serde_json::from_str(&text);
                prop_assert!(whole.is_ok(), "{}", text);
                prop_assert_eq!(format!("{quick:?}"), format!("{:?}", whole.unwrap()));
            }
        }
    }

    #[test]
    fn touches_inside_of_something_else_are_not_meant() {
        let text = plan(Vec::new()).to_json();
        let inside = "\n  \"extra\": {\n  \"touches\": [\n    {\"id\":1,\"stage\":\"s\",\"carrier\":\"C\",\"block\":\"a\",\"face\":\"+Z\",\"point\":[0,0,0],\"normal\":[0,0,1],\"pose\":{},\"start\":{},\"nominal\":{},\"end\":{}}\n  ]},\n  \"touches\": []";
        let text = text.replacen("\n  \"touches\": []", inside, 1);
        assert!(text.contains("extra"));
        assert!(read(&text).is_none());
        assert!(Plan::parse(&source("p", text)).unwrap().0.touches.is_empty());
    }

    #[test]
    fn many_lines_are_read_by_several_threads_in_their_order() {
        let line = r#"{"id":1,"stage":"s","carrier":"C","block":"a","face":"+Z","point":[0,0.5,-1e-3],"normal":[0,0,1],"pose":{"B":-30.0},"start":{},"nominal":{"X":1},"end":{"X":1}}"#;
        let one: PlanTouch = serde_json::from_str(line).unwrap();
        let all: Vec<PlanTouch> = (1..=5000).map(|id| PlanTouch { id, ..one.clone() }).collect();
        let text = plan(all.clone()).to_json();
        assert_eq!(read(&text).unwrap().0.touches, all);
        assert_eq!(Plan::parse(&source("p", text)).unwrap().0.touches, all);
    }
}
