//! The grammar of programs: running block numbers, L, TCH PROBE 4, FN, formulas, labels, FN 16. What it does not know is an
//! error.
//!
//! Sources: as `postprocessors/heidenhain.toml` says, most of it unverified on a control.

use super::formula::formula;
use super::masks::{Masks, folder, string};
use super::scan::Scan;
use crate::axes::AxisName;
use crate::check::code::{Code, Expr, Instruction, Links, Op, Piece, UnknownKind, Var, Word};
use crate::check::lines::{Line, lines};
use crate::check::run::Fault;
use crate::post::Postprocessor;
use std::ops::Range;
use std::sync::Arc;

/// Reads a program.
///
/// # Errors
/// The first place that is not of this grammar.
pub fn parse(text: &str, post: &Postprocessor, masks: &Masks) -> Result<Code, Fault> {
    let text = &capitals(text, folder(post));
    let mut reader = Reader::new(post, masks);
    let is_end = |line: &Line<'_>| line.text.is_empty() && line.start == text.len();
    let mut numbered = (0..).zip(lines(text)).take_while(|(_, line)| !is_end(line));
    let read = numbered.try_for_each(|(number, line)| reader.line(&line, number));
    // what is not known may be why the rest is not understood: it is said first
    if !reader.code.unknown.is_empty() {
        return Ok(reader.code);
    }
    read?;
    reader.finish(text.len())
}

/// Capitals and small letters are one, but for texts in quotes and names of files. No place changes by that.
fn capitals(text: &str, folder: &str) -> String {
    let line = |line: &str| {
        // names of files count as they are where the folder has small letters
        let names = folder.contains(|c: char| c.is_ascii_lowercase()).then(|| line.find("F-PRINT")).flatten();
        let kept = names.or_else(|| line.find(['"', ';'])).unwrap_or(line.len());
        let (block, rest) = line.split_at(kept);
        block.to_ascii_uppercase() + rest
    };
    text.split_inclusive('\n').map(line).collect()
}

/// A cycle whose further blocks must follow.
struct Open {
    /// Where its first block stands.
    start: usize,
    /// Which block comes next.
    stage: usize,
    words: Vec<Word>,
    kind: Cycle,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Cycle {
    Probe,
    Orientation,
    DatumShift,
    Rotation,
    WorkingPlane,
    Dwell,
}

struct Reader<'a> {
    post: &'a Postprocessor,
    masks: &'a Masks,
    /// What the control calls each axis; longer names first.
    names: Vec<(String, AxisName)>,
    code: Code,
    labels: Links<u32>,
    open: Option<Open>,
    /// Name and unit of BEGIN PGM.
    begun: Option<(String, String)>,
    ended: bool,
}

fn number(address: &'static str, value: f64) -> Word {
    word(address, Expr::Number(value))
}

fn word(address: &'static str, value: Expr) -> Word {
    Word { address, value, point: true }
}

/// What is not known of a block, by its first words.
fn kind(name: &str) -> UnknownKind {
    const PROGRAMS: [&str; 5] = ["CALL PGM", "SEL PGM", "CALL SELECTED", "CYCL DEF 12", "SEL CYCLE"];
    const OUTPUTS: [&str; 2] = ["FN 19", "FN 29"];
    let is_one_of = |names: &[&str]| names.iter().any(|n| name.starts_with(n));
    match name {
        _ if is_one_of(&PROGRAMS) => UnknownKind::Program,
        _ if is_one_of(&OUTPUTS) => UnknownKind::Output,
        _ if name.starts_with("FUNCTION FILE") => UnknownKind::File,
        _ => UnknownKind::Meaning,
    }
}

const ABSOLUTE: [&str; 6] = ["X", "Y", "Z", "A", "B", "C"];
const STEPS: [&str; 6] = ["IX", "IY", "IZ", "IA", "IB", "IC"];

impl<'a> Reader<'a> {
    fn new(post: &'a Postprocessor, masks: &'a Masks) -> Self {
        Self {
            post,
            masks,
            names: post.number.spoken(),
            code: Code::default(),
            labels: Links::default(),
            open: None,
            begun: None,
            ended: false,
        }
    }

    fn line(&mut self, line: &Line<'_>, at: usize) -> Result<(), Fault> {
        let text = line.text.trim_end_matches(' ');
        let mut scan = Scan::new(Line { start: line.start, text }, text, self.post.number.mark);
        // at the end of a line, behind a remark too, it takes the next line into this block
        if let Some(at) = line.text.find('~') {
            let says = "~ goes on in the next line: axiscal reads blocks of one line";
            return Err(line.fault(line.text.get(at..).unwrap_or(""), says));
        }
        if let Some(rule) = &self.post.block_numbers {
            let expected = rule.word.replace("{n}", &(rule.first + at * rule.step).to_string());
            scan.need(&expected, &format!("the block number {}", expected.trim_end()))?;
        }
        if scan.rest().starts_with(';') {
            return Ok(());
        }
        if self.ended {
            return Err(scan.fault("something stands behind END PGM"));
        }
        if let Some(open) = self.open.take() {
            return self.cycle(&mut scan, open);
        }
        if self.begun.is_none() {
            return self.begin(&mut scan);
        }
        self.block(&mut scan)?;
        if self.open.is_some() || self.ended { Ok(()) } else { scan.end() }
    }

    fn begin(&mut self, scan: &mut Scan<'_>) -> Result<(), Fault> {
        let at = scan.place();
        scan.need("BEGIN PGM ", "BEGIN PGM")?;
        let name = scan.up_to(" ", "the program's name")?.to_owned();
        let unit = scan.all().to_owned();
        let inches = match unit.as_str() {
            "MM" => 0.0,
            "INCH" => 1.0,
            _ => return Err(Fault { at, says: format!("the unit is {unit:?}, MM or INCH is expected") }),
        };
        self.begun = Some((name, unit));
        self.code.push(at, Instruction::Block(vec![number("INCH", inches)]));
        Ok(())
    }

    fn block(&mut self, scan: &mut Scan<'_>) -> Result<(), Fault> {
        let at = scan.place();
        let one = |address: &'static str| Instruction::Block(vec![number(address, 0.0)]);
        if scan.rest().starts_with("L ") && scan.take("L") {
            return self.linear(scan, at);
        }
        if scan.take("FN ") {
            return self.function(scan, at);
        }
        if scan.rest().starts_with("QS") {
            let var = string(scan)?;
            scan.need(" = \"", "= and a text in quotes")?;
            let text = scan.up_to("\"", "the quote that ends the text")?;
            self.code
                .push(at, Instruction::SetText { var, most: usize::MAX, text: vec![Piece::Text(Arc::from(text))] });
        } else if scan.rest().starts_with('Q') {
            let var = scan.parameter("a Q parameter")?;
            scan.need(" = ", "= and a formula")?;
            let value = formula(scan, 0)?;
            self.code.push(at, Instruction::Set(var, value));
        } else if scan.take("LBL ") {
            let label = self.label(scan)?;
            if label == 0 {
                self.code.push(at, Instruction::Return(None));
            } else if !self.labels.label(label, &self.code) {
                return Err(Fault { at, says: format!("LBL {label} stands twice") });
            }
        } else if scan.take("CALL LBL ") {
            let label = self.label(scan)?;
            let call = self
                .code
                .push(at.clone(), Instruction::Call { to: 0, gives: Vec::new(), texts: Vec::new(), is_step: true });
            self.labels.leads(call, label, at);
        } else if scan.take("TCH PROBE 4.0 MEASURING IN 3-D") {
            self.opened(at, Cycle::Probe);
            scan.end()?;
        } else if scan.take("CYCL DEF ") {
            let kinds = [
                ("13.0 ORIENTATION", Cycle::Orientation),
                ("9.0 DWELL TIME", Cycle::Dwell),
                ("7.0 DATUM SHIFT", Cycle::DatumShift),
                ("10.0 ROTATION", Cycle::Rotation),
                ("19.0 WORKING PLANE", Cycle::WorkingPlane),
            ];
            let Some((_, kind)) = kinds.into_iter().find(|(name, _)| scan.take(name)) else {
                // its further blocks are told apart by what stands behind the point
                let number: String = scan.rest().chars().take_while(char::is_ascii_digit).collect();
                return self.stranger(scan, at, format!("CYCL DEF {number}"));
            };
            self.opened(at, kind);
            scan.end()?;
        } else if scan.take_whole("PLANE RESET STAY") {
            self.code.push(at, one("PLANE"));
        } else if scan.take_whole("FUNCTION RESET TCPM") {
            self.code.push(at, Instruction::Block(vec![number("M", 129.0)]));
        } else if scan.take_whole("TRANS DATUM RESET") {
            self.code.push(at, one("NO SHIFT"));
        } else if scan.take("TRANS DATUM AXIS") {
            let words = self.axes(scan)?;
            self.code.push(at, Instruction::Block(std::iter::once(number("SHIFT", 0.0)).chain(words).collect()));
        } else if scan.take_whole("STOP") {
            self.code.push(at, Instruction::Wait(Vec::new()));
        } else if scan.take("END PGM ") {
            let (name, unit) = self.begun.clone().unwrap_or_default();
            if scan.all() != format!("{name} {unit}") {
                return Err(Fault { at, says: format!("END PGM {name} {unit} is expected") });
            }
            self.ended = true;
            self.code.push(at, Instruction::End);
        } else if scan.take("M") {
            let m = scan.whole("the number of an M function")?;
            self.code.push(at, Instruction::Block(vec![number("M", f64::from(m))]));
        } else {
            let words: Vec<&str> = scan.rest().split_whitespace().take(3).collect();
            let name: String = words.join(" ").chars().take(24).collect();
            return self.stranger(scan, at, name);
        }
        Ok(())
    }

    /// A block that is not known to axiscal is noted.
    fn stranger(&mut self, scan: &mut Scan<'_>, at: Range<usize>, name: String) -> Result<(), Fault> {
        if scan.rest().is_empty() {
            return Err(scan.expected("a block"));
        }
        self.code.is_unknown_of(kind(&name), at, name);
        scan.all();
        Ok(())
    }

    /// The number of a label that the control has; 0 ends a subprogram.
    fn label(&self, scan: &mut Scan<'_>) -> Result<u32, Fault> {
        let at = scan.place();
        let label = scan.whole("the number of a label")?;
        match self.post.wrong_label(label).filter(|_| label != 0) {
            Some(wrong) => Err(Fault { at, says: format!("LBL {label}: {wrong}") }),
            None => Ok(label),
        }
    }

    /// ` X+10 IC-90`: the axis words that stand here, each behind a blank.
    fn axes(&self, scan: &mut Scan<'_>) -> Result<Vec<Word>, Fault> {
        let mut words: Vec<Word> = Vec::new();
        loop {
            let named = self.names.iter().find_map(|(name, axis)| {
                let before = [(" ", ABSOLUTE), (" I", STEPS)];
                let (blank, addresses) = before.into_iter().find(|(b, _)| {
                    let after = scan.rest().strip_prefix(b).and_then(|r| r.strip_prefix(name.as_str()));
                    after.is_some_and(|r| r.starts_with(['+', '-']))
                })?;
                Some((format!("{blank}{name}"), addresses[axis.index()], *axis))
            });
            let Some((written, address, axis)) = named else { return Ok(words) };
            let taken = |w: &Word| w.address == ABSOLUTE[axis.index()] || w.address == STEPS[axis.index()];
            if words.iter().any(taken) {
                return Err(scan.fault(format!("axis {axis} stands twice")));
            }
            scan.take(&written);
            words.push(word(address, scan.signed("a position with its sign")?));
        }
    }

    /// `X-33 Y-3 R0 F1500 M91`
    fn linear(&mut self, scan: &mut Scan<'_>, at: Range<usize>) -> Result<(), Fault> {
        let mut words = vec![number("L", 0.0)];
        let axes = self.axes(scan)?;
        if axes.is_empty() {
            return Err(scan.expected("an axis and its position with a sign, X+10"));
        }
        words.extend(axes);
        scan.need(" R0", "an axis word, or R0: without cutter compensation")?;
        if scan.take(" FMAX") {
            words.push(number("FMAX", 0.0));
        } else if scan.take(" F") {
            words.push(word("F", scan.feed()?));
        }
        if scan.take_whole(" M91") {
            words.push(number("M91", 0.0));
        }
        self.code.push(at, Instruction::Block(words));
        Ok(())
    }

    fn function(&mut self, scan: &mut Scan<'_>, at: Range<usize>) -> Result<(), Fault> {
        let place = scan.place();
        let n = scan.whole("the number of a function")?;
        scan.need(": ", ": behind the number of the function")?;
        match n {
            0..=4 => self.arithmetic(scan, n, at),
            9..=12 => self.jump(scan, n, at),
            14 => {
                scan.need("ERROR = ", "ERROR = and a number")?;
                let error = scan.whole("the number of a message")?;
                self.code.push(at, Instruction::Abort(vec![Piece::Text(Arc::from(format!("error {error}")))]));
                Ok(())
            }
            16 => self.print(scan, at),
            18 => self.system(scan, at),
            _ => self.stranger(scan, place, format!("FN {n}")),
        }
    }

    /// `FN 0: Q1600 = +1`, `FN 1: Q1 = +Q2 + -5`
    fn arithmetic(&mut self, scan: &mut Scan<'_>, n: u32, at: Range<usize>) -> Result<(), Fault> {
        const WHAT: &str = "a value with its sign";
        let var = scan.parameter("a Q parameter")?;
        scan.need(" = ", "= and a value")?;
        let mut value = scan.signed(WHAT)?;
        if let Some((sign, op)) =
            [(1, (" + ", Op::Add)), (2, (" - ", Op::Sub)), (3, (" * ", Op::Mul)), (4, (" DIV ", Op::Div))]
                .into_iter()
                .find_map(|(k, v)| (k == n).then_some(v))
        {
            scan.need(sign, "the sign of the function")?;
            value = Expr::Two(op, Box::new(value), Box::new(scan.signed(WHAT)?));
        }
        self.code.push(at, Instruction::Set(var, value));
        Ok(())
    }

    /// `FN 9: IF +Q1604 EQU -1 GOTO LBL 90`
    fn jump(&mut self, scan: &mut Scan<'_>, n: u32, at: Range<usize>) -> Result<(), Fault> {
        const WHAT: &str = "a value with its sign";
        let (sign, op) = match n {
            9 => (" EQU ", Op::Eq),
            10 => (" NE ", Op::Ne),
            11 => (" GT ", Op::Gt),
            _ => (" LT ", Op::Lt),
        };
        scan.need("IF ", "IF")?;
        let left = scan.signed(WHAT)?;
        scan.need(sign, &format!("{} of FN {n}", sign.trim()))?;
        let right = scan.signed(WHAT)?;
        scan.need(" GOTO LBL ", "GOTO LBL")?;
        let label = self.label(scan)?;
        let over =
            self.code.push(at.clone(), Instruction::JumpUnless(Expr::Two(op, Box::new(left), Box::new(right)), 0));
        let jump = self.code.push(at.clone(), Instruction::Jump(0));
        self.labels.leads(jump, label, at);
        self.code.aim(over, jump + 1);
        Ok(())
    }

    /// `FN 18: SYSREAD Q1621 = ID240 NR1 IDX1`
    fn system(&mut self, scan: &mut Scan<'_>, at: Range<usize>) -> Result<(), Fault> {
        const WHAT: &str = "system data that axiscal knows";
        scan.need("SYSREAD ", "SYSREAD")?;
        let var = scan.parameter("a Q parameter")?;
        scan.need(" = ", "= and system data")?;
        let place = scan.place();
        scan.need("ID", WHAT)?;
        let id = scan.whole(WHAT)?;
        scan.need(" NR", WHAT)?;
        let nr = scan.whole(WHAT)?;
        scan.need(" IDX", WHAT)?;
        let index = scan.whole(WHAT)?;
        if !matches!((id, nr, index), (240 | 270, 1, 1..=6) | (320, 1, 0) | (210, 1 | 2, 0)) {
            return Err(Fault { at: place, says: format!("ID{id} NR{nr} IDX{index} is not known to axiscal") });
        }
        let several = if id == 210 { format!(" NR{nr}") } else { String::new() };
        let data = Var::named(&format!("ID{id}{several} IDX{index}"));
        self.code.push(at, Instruction::Set(var, Expr::Var(data)));
        Ok(())
    }

    /// `FN 16: F-PRINT mask / file`
    fn print(&mut self, scan: &mut Scan<'_>, at: Range<usize>) -> Result<(), Fault> {
        scan.need("F-PRINT ", "F-PRINT")?;
        let place = scan.place();
        let fault = |says: String| Fault { at: place.clone(), says };
        let path = scan.up_to(" / ", "the mask, / and the file")?;
        let to = scan.all();
        let folder = folder(self.post);
        let name = path.strip_prefix(folder).ok_or_else(|| {
            fault(format!("the mask {path} does not stand in {folder}, where the postprocessor file has it"))
        })?;
        let mask = self.masks.get(name).ok_or_else(|| {
            fault(format!("the mask {name} does not lie beside the program: what is written cannot be said"))
        })?;
        if to == "SCREEN:" {
            self.code.push(at, Instruction::Message(mask.text.clone()));
            return Ok(());
        }
        let append = mask.append.ok_or_else(|| {
            fault(format!("the mask {name} says neither M_APPEND nor M_TRUNCATE: what becomes of the log is not known"))
        })?;
        if !mask.closes {
            return Err(fault(format!(
                "the mask {name} has no M_CLOSE: the log is lost when the program is broken off"
            )));
        }
        // a log elsewhere keeps its whole path: it is then not the one of the plan
        let log = Arc::from(to.strip_prefix(folder).unwrap_or(to));
        self.code.push(at.clone(), Instruction::LogOpen { name: vec![Piece::Text(log)], append });
        self.code.push(at.clone(), Instruction::LogLine(mask.text.clone()));
        self.code.push(at, Instruction::LogClose);
        Ok(())
    }

    fn opened(&mut self, at: Range<usize>, kind: Cycle) {
        self.open = Some(Open { start: at.start, stage: 1, words: Vec::new(), kind });
    }

    /// A further block of a cycle.
    fn cycle(&mut self, scan: &mut Scan<'_>, mut open: Open) -> Result<(), Fault> {
        let at = open.start..scan.place().end;
        match open.kind {
            Cycle::Probe => {
                let done = self.probe(scan, &mut open)?;
                scan.end()?;
                if !done {
                    self.open = Some(open);
                    return Ok(());
                }
                let back = open.words.iter().find(|w| w.address == "MB").map_or(Expr::Number(0.0), |w| w.value.clone());
                self.code.push(at.clone(), Instruction::Block(open.words));
                self.code.push(at, Instruction::Block(vec![word("BACK", back)]));
            }
            Cycle::Orientation => {
                scan.need("CYCL DEF 13.1 ANGLE", "CYCL DEF 13.1 ANGLE")?;
                let angle = scan.signed("an angle with its sign")?;
                scan.end()?;
                self.code.push(at, Instruction::Block(vec![word("ANGLE", angle)]));
            }
            Cycle::Dwell => {
                scan.need("CYCL DEF 9.1 DWELL", "CYCL DEF 9.1 DWELL")?;
                let seconds = scan.unsigned("seconds")?;
                scan.end()?;
                self.code.push(at, Instruction::Block(vec![number("DWELL", seconds)]));
            }
            Cycle::DatumShift => {
                scan.need(&format!("CYCL DEF 7.{}", open.stage), "the next block of the cycle: CYCL DEF 7.1")?;
                let words = self.axes(scan)?;
                scan.end()?;
                self.code.push(at, Instruction::Block(std::iter::once(number("SHIFT", 0.0)).chain(words).collect()));
            }
            Cycle::Rotation => {
                scan.need("CYCL DEF 10.1 ROT+0", "CYCL DEF 10.1 ROT+0: axiscal knows no other rotation")?;
                scan.end()?;
                self.code.push(at, Instruction::Block(vec![number("NO ROTATION", 0.0)]));
            }
            Cycle::WorkingPlane => {
                scan.need("CYCL DEF 19.1 A+0 B+0 C+0", "CYCL DEF 19.1 A+0 B+0 C+0: axiscal knows no other plane")?;
                scan.end()?;
                self.code.push(at, Instruction::Block(vec![number("PLANE", 0.0)]));
            }
        }
        Ok(())
    }

    /// `TCH PROBE 4.1 Q1601`, `4.2 IX+0 IY+0 IZ-1`, `4.3 DIST+4 F60 MB0.5 REFERENCE SYSTEM:1`; true after the last.
    fn probe(&mut self, scan: &mut Scan<'_>, open: &mut Open) -> Result<bool, Fault> {
        let stage = format!("TCH PROBE 4.{}", open.stage);
        scan.need(&stage, &format!("the next block of the cycle, {stage}"))?;
        open.stage += 1;
        if stage.ends_with('1') {
            scan.need(" ", "a Q parameter")?;
            if let Var::Number(first) = scan.parameter("a Q parameter")? {
                open.words.push(number("PROBE", f64::from(first)));
            }
            return Ok(false);
        }
        if stage.ends_with('2') {
            for (address, letter) in [("IX", " IX"), ("IY", " IY"), ("IZ", " IZ")] {
                scan.need(letter, "the direction, IX IY IZ")?;
                open.words.push(word(address, scan.signed("a number with its sign")?));
            }
            return Ok(false);
        }
        scan.need(" DIST", "DIST")?;
        open.words.push(word("DIST", scan.signed("a way with its sign")?));
        scan.need(" F", "F and a feed")?;
        open.words.push(word("F", scan.feed()?));
        scan.need(" MB", "MB and the way back")?;
        open.words.push(number("MB", scan.unsigned("the way back")?));
        scan.need(" REFERENCE SYSTEM:", "REFERENCE SYSTEM:")?;
        let place = scan.place();
        let reference = scan.whole("0 or 1")?;
        if reference > 1 {
            return Err(Fault { at: place, says: format!("there is no reference system {reference}: 0 or 1") });
        }
        open.words.push(number("REFERENCE", f64::from(reference)));
        Ok(true)
    }

    fn finish(mut self, end: usize) -> Result<Code, Fault> {
        if !self.ended {
            return Err(Fault { at: end..end, says: "the program ends without END PGM".to_owned() });
        }
        self.labels
            .resolve(&mut self.code, |_, label, at| Err(Fault { at, says: format!("there is no LBL {label}") }))?;
        Ok(self.code)
    }
}
