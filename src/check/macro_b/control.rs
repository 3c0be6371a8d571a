//! What a Fanuc or a Haas does with a block: modes, work offsets, system variables, G31.
//!
//! What a skip move leaves in #5061 … where no signal came (the end point), what #5021 and #5041 mean, and that a number
//! without its point counts thousandths, is as the postprocessor files say: unverified on a real control. Macro statements
//! are read ahead of the blocks before them: what the control shows of its position is refused until a block has made them wait: which blocks do is said under `[check]` (`waits`).

mod places;
mod variables;

use super::leftover_modes;
use super::machine_builder::Builder;
use crate::axes::{AxisName, Position};
use crate::check::code::{UnknownKind, Values, Var};
use crate::check::doubt::Doubt;
use crate::check::hidden_rotation::HiddenRotation;
use crate::check::run::{
    Alarm, Dialect, Event, LeftoverMode, Next, Outcome, Probe, Rate, SPINDLE_OFF, Spoken, Start, Vm, own,
};
use crate::machine::Machine;
use crate::post::{CallRule, Does, Postprocessor};
use crate::units::mm_from_inch;
use places::SAME_DEG;
use std::collections::BTreeMap;
use std::sync::Arc;
use variables::MILLISECOND_S;

/// The state of the control.
#[derive(Debug, Clone)]
pub struct MacroB {
    /// Number of each axis at the control, by place in [`AxisName::ALL`].
    numbers: [Option<u32>; 6],
    inch: bool,
    incremental: bool,
    plane: f64,
    feed_mode: f64,
    /// 54 … 59, 54.1, 154
    system: f64,
    /// P of 54.1
    system_p: f64,
    cutter: bool,
    rotated: bool,
    tool_on: bool,
    /// mm
    tool_mm: f64,
    /// Length of tool offset 0 if it had one, mm: see [`MacroB::stored_mm`].
    stored_from_mm: f64,
    /// Do work offsets hold anything?
    offsets: bool,
    /// The offset that adds to all of them (EXT), mm and deg.
    external: [f64; 6],
    /// mm or deg
    local: [f64; 6],
    /// X of the program runs against the axis: a mirror image that none of its words takes off.
    mirrored: bool,
    /// What the user has left on.
    lasting: Option<LeftoverMode>,
    /// A workpiece setting error compensation (G54.4).
    skew: HiddenRotation,
    /// Blocks before this place may not have been done yet.
    ahead: bool,
    /// mm/min
    feed: f64,
    /// #3004
    holds: f64,
    lookahead: f64,
    /// Local variables, one set for each program that is called.
    own: Vec<Values>,
    /// The common variable in which the touch stands at which it stopped.
    common: Values,
    /// In work coordinates, mm and deg.
    skipped: [f64; 6],
    /// When #3001 was 0, s since the program began.
    seconds: f64,
    /// What the macros of a package do.
    calls: Arc<[CallRule]>,
    /// What the builder has made otherwise.
    builder: Arc<Builder>,
    /// Axes that count from 0 to 360.
    modulo: [bool; 6],
}

impl MacroB {
    fn mode(&mut self, tenth: i64, words: &[Spoken]) -> Result<(), String> {
        let value = |address: &str| words.iter().find(|w| w.address == address).map(|w| w.value);
        let waits = self.builder.waits('G', tenth as f64 / 10.0);
        self.ahead = !waits;
        if tenth == 544 {
            if value("P") != Some(0.0) {
                return Err("G54.4 is known with P0 only, which ends it".to_owned());
            }
            self.skew = HiddenRotation::None;
            return Ok(());
        }
        if let Some(ended) = leftover_modes::ended_by(tenth, value("P"))? {
            self.lasting = self.lasting.filter(|acts| *acts != ended);
            return Ok(());
        }
        match tenth {
            170 | 180 | 190 => self.plane = tenth as f64 / 10.0,
            200 | 210 => self.inch = tenth == 200,
            400 => self.cutter = false,
            // what it does where a length acts: `without_length`
            490 => self.tool_on = false,
            540 | 550 | 560 | 570 | 580 | 590 => (self.system, self.system_p) = (tenth as f64 / 10.0, 0.0),
            541 | 1540 => {
                (self.system, self.system_p) = (tenth as f64 / 10.0, value("P").ok_or("the work offset needs P")?);
            }
            690 => self.rotated = false,
            800 => {}
            900 | 910 => self.incremental = tenth == 910,
            930 | 940 | 950 => self.feed_mode = tenth as f64 / 10.0,
            1030 => self.lookahead = value("P").ok_or("G103 needs P")?,
            40 => {
                value("P").ok_or("G4 needs P")?;
            }
            // without an axis it moves nothing; with one its block is refused: no move of ours is one
            530 => {}
            _ => return Err(format!("G{} is not known to axiscal", tenth as f64 / 10.0)),
        }
        Ok(())
    }

    /// An M function that is not known says so before a word that goes with it.
    fn knows(&self, m: f64) -> Result<(), String> {
        let known = [0.0, 1.0, 5.0, 8.0, 9.0, 30.0].contains(&m);
        if known || self.builder.orients(m).is_some() || self.builder.is_waiting_function(m) || self.builder.switches(m)
        {
            return Ok(());
        }
        Err(format!("M{m} is not known to axiscal"))
    }

    /// An M function. A new one stands in `knows` too, which is asked without a plan.
    fn auxiliary(&mut self, m: f64, words: &[Spoken], vm: &mut Vm) -> Result<bool, String> {
        let value = |address: &str| words.iter().find(|w| w.address == address).map(|w| w.value);
        let whole = m.round() as i64;
        if let Some(word) = self.builder.orients(m) {
            vm.note(Event::Orient(value(word).ok_or_else(|| format!("M{m} needs {word}"))?));
            return Ok(false);
        }
        if self.builder.waits('M', m) {
            self.ahead = false;
        }
        if self.builder.is_waiting_function(m) {
            return Ok(false);
        }
        if self.builder.switches(m) {
            vm.note(Event::Other(format!("M{m}")));
            return Ok(false);
        }
        if (m - m.round()).abs() > 1e-9 {
            return Err(format!("M{m} is not known to axiscal"));
        }
        match whole {
            30 => return Ok(true),
            0 => vm.note(Event::Wait(String::new())),
            5 => vm.note(Event::Other(SPINDLE_OFF.to_owned())),
            1 => vm.note(Event::Other("optional stop".to_owned())),
            8 => vm.note(Event::Other("coolant on".to_owned())),
            9 => vm.note(Event::Other("coolant off".to_owned())),
            _ => return Err(format!("M{m} is not known to axiscal")),
        }
        Ok(false)
    }

    /// G65: a macro of a package, as the postprocessor file describes it.
    fn call(&mut self, words: &[Spoken], vm: &mut Vm) -> Result<Next, String> {
        let value = |address: &str| words.iter().find(|w| w.address == address).map(|w| w.value);
        let number = value("P").ok_or("G65 needs P")?;
        let calls = Arc::clone(&self.calls);
        let rule = calls.iter().find(|c| f64::from(c.program) == number).ok_or_else(|| {
            format!(
                "what G65 P{number} does is not known to axiscal: [[check.call]] of the postprocessor file may say it"
            )
        })?;
        let given = |w: &&Spoken| !matches!(w.address, "G" | "P");
        match rule.does {
            Does::NothingMoves => {
                if let Some(word) = words.iter().find(given) {
                    return Err(format!("G65 P{number} is not known with the word {}", word.address));
                }
                vm.note(Event::Other(format!("P{number}")));
                Ok(Next::On)
            }
            Does::GuardedMove => {
                if let Some(word) = words.iter().filter(given).find(|w| !"XYZF".contains(w.address)) {
                    return Err(format!("G65 P{number} is not known with the word {}", word.address));
                }
                if !words.iter().any(|w| "XYZ".contains(w.address)) {
                    return Err("no axis word stands with the move".to_owned());
                }
                self.may_move()?;
                let feed = value("F").filter(|f| *f > 0.0).ok_or("a guarded move needs a feed")?;
                self.feed = feed * if self.inch { mm_from_inch(1.0) } else { 1.0 };
                if self.feed_mode != 94.0 || self.incremental {
                    return Err(format!("G65 P{number} needs G90 and G94"));
                }
                self.probe(words, vm, Alarm::AtEvent)
            }
        }
    }

    /// A move that a signal ends, at the feed that acts.
    fn probe(&self, words: &[Spoken], vm: &mut Vm, alarm: Alarm) -> Result<Next, String> {
        let to = self.target(words, vm);
        let to = vm.target(&to)?;
        self.skew.may_probe(&vm.at, &to, "a workpiece setting error compensation (G54.4)")?;
        Ok(Next::Probe(Probe {
            from: vm.at,
            to,
            feed: self.feed,
            toward: true,
            known: vm.known,
            overridden: (self.holds as u32) & 2 == 0,
            alarm,
        }))
    }

    /// G49 while a length acts. With No. 5006#6 (TOS) = 0 it moves Z by that length where no Z stands in its block, with 1 it does
    /// not (B-63943EN-1/02 p. 1654): here it does, and where Z then stands is not known. With a Z both go there.
    fn without_length(&mut self, names_z: bool, vm: &mut Vm) -> Result<(), String> {
        const SAME: f64 = 1e-6;
        let axes = vm.world.axes(vm.part, &vm.at);
        let turned = AxisName::ALL.into_iter().any(|a| a.is_rotary() && axes.get(a).abs() > SAME);
        if vm.world.is_tcp() && turned {
            return Err("G49 ends the transformation while the rotary axes do not stand at 0: which axes then move is not known"
                .to_owned());
        }
        self.tool_on = false;
        if names_z {
            return Ok(());
        }
        let mut to = [None; 6];
        to[AxisName::Z.index()] = Some(vm.at.get(AxisName::Z) - self.tool_mm);
        vm.go(&to, Rate::Rapid, true)?;
        vm.known[AxisName::Z.index()] = false;
        self.ahead = true;
        Ok(())
    }

    fn may_move(&self) -> Result<(), String> {
        if self.cutter {
            return Err("it moves with cutter compensation on: G40 is missing".to_owned());
        }
        if self.rotated {
            return Err("it moves in a rotated coordinate system: G69 is missing".to_owned());
        }
        if let Some(acts) = self.lasting {
            return Err(format!("it moves under {}: {} is missing", acts.says(), leftover_modes::ends(acts)));
        }
        Ok(())
    }

    fn unused(&self, words: &[Spoken], gs: &[i64]) -> Option<&'static str> {
        let moves = gs.iter().any(|g| matches!(g, 0 | 10 | 310));
        let used = |word: &Spoken| match word.address {
            _ if self.builder.uses(word, words) => true,
            "P" => gs.iter().any(|g| matches!(g, 40 | 1030 | 541 | 542 | 544 | 1540)),
            "R" | "S" => false,
            "H" => gs.iter().any(|g| matches!(g, 434 | 2340)),
            "F" => moves,
            "G" | "M" => true,
            _ => moves || gs.iter().any(|g| matches!(g, 520 | 434 | 2340)),
        };
        words.iter().find(|word| !used(word)).map(|word| word.address)
    }
}

/// The G numbers (in tenths) of one modal group: a block may hold one of each.
const GROUPS: [&[i64]; 7] = [
    &[0, 10, 310],
    &[170, 180, 190],
    &[900, 910],
    &[930, 940, 950],
    &[200, 210],
    &[490, 434, 2340],
    &[540, 550, 560, 570, 580, 590, 541, 1540],
];

/// A word that calls a program, where its number is one of these.
fn calls_if(word: &Spoken, numbers: &[f64]) -> UnknownKind {
    if numbers.contains(&word.value) { UnknownKind::Program } else { UnknownKind::Meaning }
}

impl Dialect for MacroB {
    const OBSTRUCTED: &'static [Start] = &[Start::Obstructed, Start::LengthActs];

    fn lasting(_tcp: bool) -> &'static [LeftoverMode] {
        leftover_modes::ALL
    }

    fn may_be_rotated(_tcp: bool) -> bool {
        true
    }

    fn begin(start: Start, post: &Postprocessor, machine: &Machine) -> Self {
        let mut numbers = [None; 6];
        let there = AxisName::ALL.into_iter().filter(|a| machine.axis(*a).is_some());
        for (axis, place) in there.zip(1_usize..) {
            numbers[axis.index()] = u32::try_from(*post.number.numbers.get(&axis).unwrap_or(&place)).ok();
        }
        let awkward = start == Start::Awkward;
        let third = start == Start::Third;
        // an axis that the machine lacks has no offset
        let some = |values: [f64; 6]| {
            AxisName::ALL.map(|a| if awkward && numbers[a.index()].is_some() { values[a.index()] } else { 0.0 })
        };
        Self {
            numbers,
            inch: awkward,
            incremental: awkward || third,
            plane: if awkward {
                18.0
            } else if third {
                19.0
            } else {
                17.0
            },
            feed_mode: if awkward {
                93.0
            } else if third {
                95.0
            } else {
                94.0
            },
            system: match start {
                Start::Awkward => 56.0,
                Start::Third => post.check.as_ref().map_or(54.0, |c| c.further_offsets),
                _ => 54.0,
            },
            system_p: if third { 7.0 } else { 0.0 },
            cutter: awkward,
            rotated: awkward,
            tool_on: start == Start::LengthActs,
            tool_mm: if start == Start::LengthActs { 33.5 } else { 0.0 },
            stored_from_mm: match start {
                Start::Awkward => 119.875,
                Start::Third => 84.5,
                _ => 61.25,
            },
            offsets: awkward || third,
            external: some([0.625, -1.5, 2.25, 0.125, 0.25, -0.5]),
            local: some([-2.0, 0.75, 1.125, -0.25, 0.5, 0.375]),
            mirrored: start == Start::Obstructed,
            lasting: match start {
                Start::LeftoverMode(what) => Some(what).filter(|what| leftover_modes::may_act(*what, post)),
                _ => None,
            },
            skew: HiddenRotation::from_start(start),
            ahead: false,
            feed: 0.0,
            holds: 0.0,
            lookahead: 0.0,
            own: vec![Values::default()],
            common: Values::default(),
            skipped: [0.0; 6],
            seconds: 0.0,
            calls: post.check.iter().flat_map(|c| c.calls.iter().cloned()).collect(),
            builder: Arc::new(Builder::from_settings(post)),
            modulo: AxisName::ALL.map(|a| {
                a.is_rotary() && post.settings.get("modulo").is_some_and(|letters| letters.contains(a.letter()))
            }),
        }
    }

    fn unknown(&self, words: &[Spoken], _post: &Postprocessor) -> Vec<(UnknownKind, String)> {
        let tenth = |value: f64| (value * 10.0).round() as i64;
        let of = |address: &'static str| words.iter().filter(move |w| w.address == address && w.value.is_finite());
        // a G number that needs a P has one
        let given = [Spoken { address: "P", value: 0.0, point: true }];
        let known_g = |g: f64| {
            (g * 10.0 - (g * 10.0).round()).abs() < 1e-6
                && (matches!(tenth(g), 0 | 10 | 310 | 434 | 520 | 650 | 2340)
                    || self.clone().mode(tenth(g), &given).is_ok())
        };
        let calls_unknown = |p: f64| !self.calls.iter().any(|c| f64::from(c.program) == p);
        let calls = of("P").filter(|w| of("G").any(|g| g.value == 65.0) && calls_unknown(w.value));
        let calls = calls.map(|w| (UnknownKind::Program, format!("G65 P{}", w.value)));
        let gs = of("G").filter(|w| !known_g(w.value)).map(|w| (calls_if(w, &[66.0, 66.1]), format!("G{}", w.value)));
        let ms = of("M").filter(|w| self.knows(w.value).is_err());
        let ms = ms.map(|w| (calls_if(w, &[97.0, 98.0, 198.0]), format!("M{}", w.value)));
        calls.chain(gs).chain(ms).collect()
    }

    fn is_output(&self, var: &Var) -> bool {
        matches!(var, Var::Number(1100..=1199))
    }

    fn block(&mut self, words: &[Spoken], vm: &mut Vm) -> Result<Next, String> {
        self.skew.reckon(&vm.at);
        let numbers = |address: &'static str| words.iter().filter(move |w| w.address == address).map(|w| w.value);
        let tenth = |g: f64| {
            let t = (g * 10.0).round();
            if (g * 10.0 - t).abs() > 1e-6 { Err(format!("G{g} is not known to axiscal")) } else { Ok(t as i64) }
        };
        let gs: Vec<i64> = numbers("G").map(tenth).collect::<Result<_, _>>()?;
        for group in GROUPS {
            if gs.iter().filter(|g| group.contains(g)).count() > 1 {
                return Err("two G words of one group stand in one block".to_owned());
            }
        }
        if gs.contains(&650) {
            if gs.len() > 1 {
                return Err("another G word stands before G65".to_owned());
            }
            return self.call(words, vm);
        }
        let axes = words.iter().any(|w| "XYZABC".contains(w.address));
        let motion = gs.iter().copied().find(|g| matches!(g, 0 | 10 | 310));
        if motion.is_some() && !axes {
            return Err("no axis word stands with the move".to_owned());
        }
        if axes && motion.is_none() && !gs.iter().any(|g| matches!(g, 520 | 434 | 2340)) {
            // a G word that is not known may be the one that would use them
            let mut other = self.clone();
            gs.iter().try_for_each(|g| other.mode(*g, words))?;
            return Err("axis words stand without a G word that uses them".to_owned());
        }
        numbers("M").try_for_each(|m| self.knows(m))?;
        if let Some(letter) = self.unused(words, &gs) {
            return Err(format!("what the word {letter} does in the block is not known to axiscal"));
        }
        let mut over = false;
        for m in numbers("M").collect::<Vec<_>>() {
            over |= self.auxiliary(m, words, vm)?;
        }
        if gs.contains(&490) && self.tool_on {
            self.without_length(motion.is_some() && words.iter().any(|w| w.address == "Z"), vm)?;
        }
        for g in gs.iter().filter(|g| !matches!(g, 0 | 10 | 310 | 520 | 434 | 2340)) {
            self.mode(*g, words)?;
        }
        if gs.contains(&520) {
            self.ahead = true;
            for axis in AxisName::ALL {
                if let Some(word) = words.iter().find(|w| w.address.starts_with(axis.letter())) {
                    self.local[axis.index()] = self.length(word, axis);
                }
            }
        }
        if gs.iter().any(|g| matches!(g, 434 | 2340)) {
            (self.tool_on, self.tool_mm, self.ahead) = (true, self.chosen_mm(words)?, true);
            let to = self.target(words, vm);
            let moves = |axis: &AxisName| to[axis.index()].is_some_and(|to| (to - vm.at.get(*axis)).abs() > SAME_DEG);
            if let Some(axis) = AxisName::ALL.into_iter().find(moves) {
                return Err(format!(
                    "the block that switches the transformation on moves {axis}: is the length that the program counts on (tool_length) that of its H (tool_offset)?"
                ));
            }
        }
        if let Some(f) = words.iter().find(|w| w.address == "F") {
            if f.value <= 0.0 {
                return Err(format!("the feed is {}", f.value));
            }
            self.feed = f.value * if self.inch { mm_from_inch(1.0) } else { 1.0 };
        }
        let Some(motion) = motion else { return Ok(if over { Next::End } else { Next::On }) };
        self.may_move()?;
        if motion == 310 {
            if self.feed_mode != 94.0 || self.feed <= 0.0 {
                return Err("G31 needs a feed, in mm per minute".to_owned());
            }
            return self.probe(words, vm, Alarm::Never);
        }
        let to = self.target(words, vm);
        let rate = match motion {
            0 => Rate::Rapid,
            _ if self.feed_mode != 94.0 || self.feed <= 0.0 => {
                return Err("G1 needs a feed, in mm per minute".to_owned());
            }
            _ => Rate::Feed(self.feed),
        };
        self.ahead = true;
        vm.go(&to, rate, true)?;
        Ok(Next::On)
    }

    fn read(&self, var: &Var, vm: &Vm) -> Result<f64, String> {
        match var {
            Var::Number(n) if *n < 100 => own(self.own.last().unwrap_or(&self.common), var),
            Var::Number(n) if *n < 1000 => own(&self.common, var),
            Var::Number(n)
                if self.ahead && (matches!(n, 5021..=5026 | 5041..=5046) || self.builder.is_probe_input(*n)) =>
            {
                Err(format!(
                    "{var} is read while blocks before it may not be done yet: a block to wait ({}) is missing",
                    self.builder.wait_word()
                ))
            }
            // what is a tool offset at a Fanuc is an input at a Haas
            Var::Number(n)
                if self.builder.is_probe_input(*n)
                    && (matches!(n, 11_001..=11_999) || self.system_variable(*n, vm).is_none()) =>
            {
                Ok(f64::from(vm.deflected()))
            }
            Var::Number(n) => {
                self.system_variable(*n, vm).ok_or_else(|| format!("what {var} holds is not known to axiscal"))
            }
            Var::Name(_) => Err(format!("{var} is no variable")),
        }
    }

    fn exists(&self, var: &Var) -> bool {
        self.own.last().is_some_and(|own| own.contains_key(var)) || self.common.contains_key(var)
    }

    /// Modes of two or three kinds (plane, distance, units, feed mode, length) are found each way by the runs themselves.
    fn doubt(&self, var: &Var, vm: &Vm) -> Option<Doubt> {
        let Var::Number(n) = var else { return None };
        let unmoved = |number: u32| self.axis(number).is_some_and(|axis| !vm.known[axis.index()]);
        match n {
            1000..=1063 | 3001 | 3012 if !self.builder.is_probe_input(*n) => Some(Doubt::Outside),
            _ if self.builder.is_probe_input(*n) => None,
            2001..=2200 | 11_001..=11_999 | 4012 | 4014 | 4130 => Some(Doubt::Stored),
            5021..=5026 => unmoved(n - 5020).then_some(Doubt::Stored),
            5041..=5046 => unmoved(n - 5040).then_some(Doubt::Stored),
            _ => None,
        }
    }

    fn is_probe_input(&self, var: &Var) -> bool {
        matches!(var, Var::Number(n) if self.builder.is_probe_input(*n))
    }

    fn write(&mut self, var: &Var, value: f64, vm: &Vm) -> Result<(), String> {
        match var {
            Var::Number(3001) => self.seconds = vm.clock_s(MILLISECOND_S) - value / 1000.0,
            // bit 0 takes feed hold away, bit 2 exact stop
            Var::Number(3004) if value != 0.0 && value != 2.0 => {
                return Err(format!(
                    "#3004={value} is not known to axiscal: 2 takes the feed override away, 0 gives it back"
                ));
            }
            Var::Number(3004) => self.holds = value,
            Var::Number(1..=33) => {
                self.own.last_mut().map(|own| own.insert(*var, value));
            }
            Var::Number(n) if self.builder.common.contains(n) => {
                self.common.insert(*var, value);
            }
            _ => return Err(format!("{var} is not the program's own: only #1 to #33 are")),
        }
        Ok(())
    }

    fn is_local(&self, var: &Var) -> bool {
        matches!(var, Var::Number(1..=33))
    }

    fn entered(&mut self) {
        self.own.push(Values::default());
    }

    fn left(&mut self, _value: Option<f64>, _vm: &Vm) {
        self.own.pop();
    }

    fn probed(&mut self, _probe: &Probe, _outcome: Outcome, stands: &Position) {
        for axis in AxisName::ALL {
            self.skipped[axis.index()] = self.sense(axis) * (stands.get(axis) - self.shift(axis));
        }
        self.ahead = false;
    }

    fn settings(&self) -> BTreeMap<String, String> {
        let numbers = |values: &[f64]| values.iter().map(|x| format!("{:.6}", x + 0.0)).collect::<Vec<_>>().join(" ");
        let acts = |what: LeftoverMode| if self.lasting == Some(what) { "on" } else { "off" }.to_owned();
        BTreeMap::from([
            ("scaling".to_owned(), acts(LeftoverMode::Scaled)),
            ("polar coordinates".to_owned(), acts(LeftoverMode::Polar)),
            ("dynamic fixture offset".to_owned(), acts(LeftoverMode::TurnsAlong)),
            ("units".to_owned(), if self.inch { "G20" } else { "G21" }.to_owned()),
            ("distance".to_owned(), if self.incremental { "G91" } else { "G90" }.to_owned()),
            ("plane".to_owned(), format!("G{}", self.plane)),
            ("feed mode".to_owned(), format!("G{}", self.feed_mode)),
            ("work offset".to_owned(), format!("G{} P{}", self.system, self.system_p)),
            ("cutter compensation".to_owned(), if self.cutter { "on" } else { "off" }.to_owned()),
            ("rotation".to_owned(), if self.rotated { "on" } else { "off" }.to_owned()),
            ("tool length".to_owned(), if self.tool_on { numbers(&[self.tool_mm]) } else { "off".to_owned() }),
            ("local coordinate system".to_owned(), numbers(&self.local)),
            ("#3004".to_owned(), numbers(&[self.holds])),
            ("look-ahead".to_owned(), numbers(&[self.lookahead])),
        ])
    }

    /// A number that is too large for its field: Haas makes the field larger (96-8000 Rev AC, p. 116), Fanuc is taken to write
    /// the last places only.
    fn spell(&self, value: f64, decimals: usize, width: usize) -> String {
        let text = format!("{:.decimals$}", value.abs());
        let whole = text.find('.').unwrap_or(text.len());
        let cut = if self.builder.cuts && width > 0 { whole.saturating_sub(width) } else { 0 };
        let zero = !text.bytes().any(|b| (b'1'..=b'9').contains(&b));
        let sign = if value.is_sign_negative() && !zero { "-" } else { "" };
        format!("{sign}{}", &text[cut..])
    }
}
