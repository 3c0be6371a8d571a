//! What a SINUMERIK does with a block: modes, frames, MEAS, what system variables hold.
//!
//! Sources: Basic Functions 09/2011, 6FC5397-0BP40-2BA0, p. 741 (SUPA); Job Planning 07/2010, 6FC5398-2BP40-0BA0, p. 270
//! ($AC_MEA, $A_PROBE; only the axes of the block are latched: 03/2006, p. 5-24); 808D Programming 05/2012, p. 26 (DC, ACP,
//! ACN). That a search waits for an edge, that M30 gives all modes back, and what $AA_IM and $AA_IW mean under TRAORI, is
//! as the postprocessor file says: from memory.

use super::words::{Way, axis_word};
use crate::axes::{AxisName, Position};
use crate::check::code::{UnknownKind, Values, Var};
use crate::check::doubt::Doubt;
use crate::check::run::{
    Alarm, Dialect, Event, LeftoverMode, Next, Outcome, Probe, Rate, SPINDLE_OFF, Spoken, Start, Vm, own,
};
use crate::machine::Machine;
use crate::post::Postprocessor;
use crate::units::mm_from_inch;
use std::collections::BTreeMap;
use std::sync::Arc;

/// A full turn, deg.
const TURN: f64 = 360.0;
/// Angles that differ by less are the same, deg.
const SAME_DEG: f64 = 1e-6;
/// What a timer counts, s.
const TIMER_S: f64 = 0.001;
/// A program begins at two minutes before midnight, s since midnight: its run goes over the end of the day.
const BEGINS_S: f64 = 86_280.0;
const DAY_S: f64 = 86_400.0;

/// What MEAS has kept.
#[derive(Debug, Clone)]
struct Latched {
    /// The axes of the block.
    named: [bool; 6],
    /// In the control's coordinates.
    at: Position,
    /// Workpiece coordinates, mm and deg.
    work: [f64; 6],
}

/// The state of the control.
#[derive(Debug, Clone)]
pub struct Sinumerik {
    /// Measuring input of the probe.
    input: f64,
    /// The cutting edge that holds the length of the probe.
    edge: f64,
    /// M functions of the builder that the postprocessor file names.
    builder: Vec<f64>,
    /// Axes that count from 0 to 360.
    modulo: [bool; 6],
    /// Machine coordinates at the origin of R.
    origin: Position,
    /// R parameters that the postprocessor file gives to the program: nothing of the user's is in them.
    found_in: Arc<[Var]>,
    inch: bool,
    incremental: bool,
    plane: f64,
    feed_mode: f64,
    exact: bool,
    cutter: bool,
    /// 500: no settable offset; 54 …
    system: f64,
    /// Basic frame, settable offset, programmed offset, mm and deg.
    base: [f64; 6],
    settable: [f64; 6],
    programmed: [f64; 6],
    /// What a basic or a system frame holds beside an offset.
    lasting: Option<LeftoverMode>,
    tool_on: bool,
    /// mm
    tool_mm: f64,
    transformed: bool,
    /// mm/min
    feed: f64,
    own: Values,
    timers: Values,
    /// The control has read ahead of a move or a frame.
    ahead: bool,
    triggered: bool,
    latched: Option<Latched>,
    measuring: [bool; 6],
}

/// M functions whose meaning is the control's own, and never that of a probe: end of program, spindle on and off, tool change,
/// gears. (SINUMERIK Fundamentals, predefined M functions.)
const OWN_FUNCTIONS: [f64; 17] =
    [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 17.0, 19.0, 30.0, 40.0, 41.0, 42.0, 43.0, 44.0, 45.0, 70.0];

impl Sinumerik {
    fn unit(&self, axis: AxisName) -> f64 {
        if self.inch && !axis.is_rotary() { mm_from_inch(1.0) } else { 1.0 }
    }

    /// What a word of the workpiece's coordinates lacks, mm or deg. SUPA leaves the tool's length.
    fn shift(&self, axis: AxisName, supa: bool) -> f64 {
        let i = axis.index();
        let tool = if axis == AxisName::Z && self.tool_on { self.tool_mm } else { 0.0 };
        let settable = if self.system == 500.0 { 0.0 } else { self.settable[i] };
        if supa { tool } else { self.base[i] + settable + self.programmed[i] + tool }
    }

    fn counted(&self, axis: AxisName, value: f64) -> f64 {
        if self.modulo[axis.index()] { value.rem_euclid(TURN) } else { value }
    }

    /// Where the axis itself stands, as the machine counts it.
    fn of_machine(&self, vm: &Vm, at: &Position, axis: AxisName) -> f64 {
        let place = vm.world.axes(vm.part, at).get(axis) + self.origin.get(axis);
        self.counted(axis, place) / self.unit(axis)
    }

    fn of_workpiece(&self, vm: &Vm, axis: AxisName) -> f64 {
        let place = if self.transformed {
            vm.at.get(axis)
        } else {
            vm.world.axes(vm.part, &vm.at).get(axis) + self.origin.get(axis)
        };
        self.counted(axis, place - self.shift(axis, false)) / self.unit(axis)
    }

    fn target(&self, words: &[Spoken], vm: &mut Vm) -> Result<[Option<f64>; 6], String> {
        let supa = words.iter().any(|w| w.address == "SUPA");
        let mut to = [None; 6];
        for word in words {
            let Some((axis, way)) = axis_word(word.address) else { continue };
            let value = word.value * self.unit(axis);
            let place = value + self.shift(axis, supa);
            to[axis.index()] = Some(match way {
                Way::By => vm.at.get(axis) + value,
                Way::Modal if self.incremental => vm.at.get(axis) + value,
                Way::Modal | Way::Absolute if self.modulo[axis.index()] => {
                    return Err(format!("axis {axis} counts from 0 to 360: it needs its sense, DC, ACP or ACN"));
                }
                Way::Modal | Way::Absolute => place,
                Way::Short | Way::Up | Way::Down => self.turn(vm, axis, way, value, place)?,
            });
        }
        Ok(to)
    }

    /// Where an axis that counts from 0 to 360 ends, whole turns counted.
    fn turn(&self, vm: &mut Vm, axis: AxisName, way: Way, value: f64, place: f64) -> Result<f64, String> {
        if !self.modulo[axis.index()] {
            return Err(format!("axis {axis} does not count from 0 to 360: DC, ACP and ACN are not for it"));
        }
        if !(0.0..TURN).contains(&value) {
            return Err(format!("{axis} is sent to {value}: DC, ACP and ACN take 0 to 360 deg"));
        }
        let at = vm.at.get(axis);
        let mut up = (place - at).rem_euclid(TURN);
        if !(SAME_DEG..=TURN - SAME_DEG).contains(&up) {
            up = 0.0;
        }
        let by = match way {
            Way::Down if up > 0.0 => up - TURN,
            Way::Short if up > TURN / 2.0 => up - TURN,
            _ => up,
        };
        if !vm.known[axis.index()] {
            // nobody knows how often it has turned: counted as the plan does from here on
            let near = vm.turned_near.get(axis);
            let end = near + (place - near + TURN / 2.0).rem_euclid(TURN) - TURN / 2.0;
            vm.at.set(axis, end - by);
            return Ok(end);
        }
        Ok(at + by)
    }

    fn mode(&mut self, g: f64) -> Result<(), String> {
        match g as i64 {
            17..=19 => self.plane = g,
            40 => self.cutter = false,
            54..=57 | 500 => self.system = g,
            60 | 64 => self.exact = g == 60.0,
            90 | 91 => self.incremental = g == 91.0,
            93..=95 => self.feed_mode = g,
            700 | 710 => self.inch = g == 700.0,
            _ => return Err(format!("G{g} is not known to axiscal")),
        }
        Ok(())
    }

    fn auxiliary(&self, m: f64, vm: &mut Vm) -> Result<bool, String> {
        match m as i64 {
            30 => return Ok(true),
            0 => vm.note(Event::Wait(String::new())),
            5 => vm.note(Event::Other(SPINDLE_OFF.to_owned())),
            1 => vm.note(Event::Other("optional stop".to_owned())),
            8 => vm.note(Event::Other("coolant on".to_owned())),
            9 => vm.note(Event::Other("coolant off".to_owned())),
            _ if self.builder.contains(&m) => vm.note(Event::Other(format!("M{m}"))),
            _ => return Err(format!("M{m} is not known to axiscal")),
        }
        Ok(false)
    }

    /// A word that stands alone in its block.
    fn alone(&mut self, word: &Spoken, vm: &mut Vm) -> Result<(), String> {
        match word.address {
            "STOPRE" => self.ahead = false,
            "TRAFOOF" | "TRAORI" => (self.transformed, self.ahead) = (word.address == "TRAORI", true),
            "SPOS" if (0.0..=TURN).contains(&word.value) => vm.note(Event::Orient(word.value)),
            _ => return Err(format!("the spindle cannot be turned to {}", word.value)),
        }
        Ok(())
    }

    fn edge(&mut self, d: f64) -> Result<(), String> {
        if d != 0.0 && d != self.edge {
            return Err(format!(
                "D{d} is not the cutting edge that holds the length of the probe (tool_edge: D{})",
                self.edge
            ));
        }
        (self.tool_on, self.ahead) = (d != 0.0, true);
        Ok(())
    }

    fn may_move(&self, vm: &Vm) -> Result<(), String> {
        let tcp = vm.world.is_tcp();
        let wrong = if self.cutter {
            "it moves with cutter compensation on: G40 is missing"
        } else if self.plane != 17.0 {
            "it moves in another plane than G17, in which the length of the tool lies along Z"
        } else if self.transformed && !tcp {
            "it moves under a transformation: TRAFOOF is missing"
        } else if !self.transformed && tcp {
            "it moves without the transformation that the plan counts on: TRAORI is missing"
        } else if tcp && !self.tool_on {
            "it moves under TRAORI without the length of the probe: D is missing"
        } else {
            return Ok(());
        };
        Err(wrong.to_owned())
    }

    /// Every word must be used by something in its block.
    fn unused(words: &[Spoken], motion: Option<f64>) -> Result<(), String> {
        let has = |address: &str| words.iter().any(|w| w.address == address);
        let trans = has("TRANS");
        if trans && words.iter().any(|w| w.address != "TRANS" && axis_word(w.address).is_none()) {
            return Err("TRANS stands in a block with its axes and nothing else".to_owned());
        }
        for word in words {
            let used = match word.address {
                "SUPA" => motion.is_some(),
                "F" | "MEAS" => motion == Some(1.0),
                "STOPRE" | "TRAFOOF" | "TRAORI" | "SPOS" => words.len() == 1,
                "M" => words.len() == 1 || (word.value != 30.0 && word.value != 0.0),
                address => axis_word(address).is_none() || motion.is_some() || trans,
            };
            if !used {
                return Err(match word.address {
                    "STOPRE" | "TRAFOOF" | "TRAORI" | "SPOS" | "M" => {
                        format!("{} stands alone in its block", word.address)
                    }
                    other => format!("nothing in the block uses the word {other}"),
                });
            }
        }
        Ok(())
    }

    fn search(&mut self, words: &[Spoken], input: f64, to: &[Option<f64>; 6], vm: &Vm) -> Result<Next, String> {
        if input != self.input {
            return Err(format!("MEAS={input} is not the rising edge of measuring input {}", self.input));
        }
        if vm.deflected() {
            return Err(
                "the probe is deflected where a search begins: its edge never comes, nothing would stop it".to_owned()
            );
        }
        let named = |axis: AxisName| words.iter().filter_map(|w| axis_word(w.address)).any(|(a, _)| a == axis);
        self.measuring = AxisName::ALL.map(named);
        (self.triggered, self.latched) = (false, None);
        let probe = Probe {
            from: vm.at,
            to: vm.target(to)?,
            feed: self.feed,
            toward: true,
            known: vm.known,
            // a program cannot lock the override: its head tells the operator
            overridden: false,
            alarm: Alarm::Never,
        };
        let touches = vm.known.iter().zip(vm.axes).all(|(k, a)| *k || !a) && vm.world.outcome(vm, &probe).hit;
        if touches && !vm.asked {
            return Err("a search begins without a look at the probe: were it deflected, nothing would stop the move"
                .to_owned());
        }
        Ok(Next::Probe(probe))
    }

    fn system_variable(&self, name: &str, index: &str, vm: &Vm) -> Result<f64, String> {
        let truth = |yes: bool| if yes { 1.0 } else { 0.0 };
        let input = |value: f64| match index.parse::<f64>() {
            Ok(n) if n == self.input => Ok(value),
            _ => Err(format!("the probe is at measuring input {}, not {index}", self.input)),
        };
        let axis = || {
            let axis = index.chars().next().and_then(AxisName::from_letter);
            axis.filter(|a| vm.axes[a.index()]).ok_or_else(|| format!("the machine has no axis {index}"))
        };
        let latched = |axis: AxisName| {
            self.latched.as_ref().filter(|l| l.named[axis.index()]).ok_or_else(|| {
                format!(
                    "the last MEAS has not latched {axis}: it did not trigger, or {axis} does not stand in its block"
                )
            })
        };
        let of_day = (BEGINS_S + vm.clock_s(1.0)).rem_euclid(DAY_S);
        match name {
            "$A_HOUR" => Ok((of_day / 3600.0).floor()),
            "$A_MINUTE" => Ok((of_day / 60.0).floor().rem_euclid(60.0)),
            "$A_SECOND" => Ok(of_day.floor().rem_euclid(60.0)),
            // a condition on an input is run both ways
            "$A_IN" => Ok(0.0),
            "$AC_MEA" => input(truth(self.triggered)),
            "$A_PROBE" => input(truth(vm.deflected())),
            "$P_ACTFRAME" => {
                let holds = |axis: &str, what: LeftoverMode| index.starts_with(axis) && self.lasting == Some(what);
                Ok(match index.split_once(',').map(|(_, component)| component) {
                    Some("RT") => truth(holds("Z", LeftoverMode::Rotated)) * 1.5,
                    Some("SC") => 1.0 + truth(holds("X", LeftoverMode::Scaled)) * 0.002,
                    _ => truth(holds("Y", LeftoverMode::Mirrored)),
                })
            }
            "$AA_IM" => Ok(self.of_machine(vm, &vm.at, axis()?)),
            "$AA_IW" => Ok(self.of_workpiece(vm, axis()?)),
            "$AA_MM" => {
                let axis = axis()?;
                Ok(self.of_machine(vm, &latched(axis)?.at, axis))
            }
            "$AA_MW" => {
                let axis = axis()?;
                Ok(self.counted(axis, latched(axis)?.work[axis.index()]) / self.unit(axis))
            }
            _ => Err(format!("what {name} holds is not known to axiscal")),
        }
    }
}

/// G numbers of one group: a block may hold one of each.
const GROUPS: [&[i64]; 8] =
    [&[0, 1], &[17, 18, 19], &[40], &[54, 55, 56, 57, 500], &[60, 64], &[90, 91], &[93, 94, 95], &[700, 710]];

impl Dialect for Sinumerik {
    /// SUPA takes the frames away.
    fn lasting(tcp: bool) -> &'static [LeftoverMode] {
        if tcp { &[LeftoverMode::Rotated, LeftoverMode::Scaled, LeftoverMode::Mirrored] } else { &[] }
    }

    fn begin(start: Start, post: &Postprocessor, machine: &Machine) -> Self {
        let setting = |name: &str| post.settings.get(name).map_or("", String::as_str);
        let awkward = start == Start::Awkward;
        let third = start == Start::Third;
        let modulo = AxisName::ALL.map(|a| a.is_rotary() && setting("modulo").contains(a.letter()));
        let lines = format!("{} {}", setting("probe_on"), setting("probe_off"));
        let offsets = |awkwardly: f64, thirdly: f64| {
            let factor = if awkward {
                awkwardly
            } else if third {
                thirdly
            } else {
                0.0
            };
            [7.5, -3.25, 11.0, 1.5, -2.0, 0.75].map(|x| x * factor)
        };
        Self {
            input: setting("probe").trim().parse().unwrap_or(1.0),
            edge: setting("tool_edge").trim().trim_start_matches('D').parse().unwrap_or(1.0),
            builder: lines
                .split_whitespace()
                .filter_map(|w| w.strip_prefix('M')?.parse().ok())
                .filter(|m| !OWN_FUNCTIONS.contains(m))
                .collect(),
            modulo,
            origin: machine.origin.position(),
            found_in: ["found_x", "found_y", "found_z", "found_off", "found_room"]
                .map(|name| Var::named(setting(name).trim()))
                .into(),
            inch: awkward,
            incremental: awkward,
            plane: if awkward {
                18.0
            } else if third {
                19.0
            } else {
                17.0
            },
            feed_mode: if awkward {
                95.0
            } else if third {
                93.0
            } else {
                94.0
            },
            exact: false,
            cutter: awkward,
            system: if awkward {
                56.0
            } else if third {
                54.0
            } else {
                500.0
            },
            base: offsets(0.5, 0.0),
            settable: offsets(1.25, -0.75),
            programmed: offsets(-2.0, 1.5),
            lasting: if let Start::LeftoverMode(what) = start { Some(what) } else { None },
            tool_on: awkward || third,
            tool_mm: if awkward || third { 120.25 } else { 0.0 },
            transformed: awkward,
            feed: 0.0,
            own: Values::default(),
            timers: Values::default(),
            ahead: false,
            triggered: awkward,
            latched: None,
            measuring: [false; 6],
        }
    }

    fn unknown(&self, words: &[Spoken], _post: &Postprocessor) -> Vec<(UnknownKind, String)> {
        let known_g = |g: f64| g.fract() == 0.0 && (matches!(g as i64, 0 | 1) || self.clone().mode(g).is_ok());
        let known_m = |m: f64| [0.0, 1.0, 5.0, 8.0, 9.0, 30.0].contains(&m) || self.builder.contains(&m);
        let is_unknown = |w: &&Spoken| match w.address {
            "G" => !known_g(w.value),
            "M" => !known_m(w.value),
            _ => false,
        };
        let numbers = words.iter().filter(|w| w.value.is_finite());
        numbers.filter(is_unknown).map(|w| (UnknownKind::Meaning, format!("{}{}", w.address, w.value))).collect()
    }

    fn block(&mut self, words: &[Spoken], vm: &mut Vm) -> Result<Next, String> {
        let numbers = |address: &'static str| words.iter().filter(move |w| w.address == address).map(|w| w.value);
        let value = |address: &'static str| numbers(address).next();
        let gs: Vec<f64> = numbers("G").collect();
        if let Some(g) = gs.iter().find(|g| g.fract() != 0.0) {
            return Err(format!("G{g} is not known to axiscal"));
        }
        for group in GROUPS {
            if gs.iter().filter(|g| group.contains(&(**g as i64))).count() > 1 {
                return Err("two G words of one group stand in one block".to_owned());
            }
        }
        let axes = words.iter().any(|w| axis_word(w.address).is_some());
        let motion = gs.iter().copied().find(|g| *g == 0.0 || *g == 1.0);
        if motion.is_some() && !axes {
            return Err("no axis word stands with the move".to_owned());
        }
        if axes && motion.is_none() && value("TRANS").is_none() {
            return Err("axis words stand without a G word that uses them".to_owned());
        }
        Self::unused(words, motion)?;
        if let [word @ Spoken { address: "STOPRE" | "TRAFOOF" | "TRAORI" | "SPOS", .. }] = words {
            self.alone(word, vm)?;
            return Ok(Next::On);
        }
        let mut over = false;
        for m in numbers("M").collect::<Vec<_>>() {
            over |= self.auxiliary(m, vm)?;
        }
        for g in gs.iter().filter(|g| **g != 0.0 && **g != 1.0) {
            self.mode(*g)?;
            self.ahead = true;
        }
        if let Some(d) = value("D") {
            self.edge(d)?;
        }
        if value("TRANS").is_some() {
            self.programmed = [0.0; 6];
            for word in words {
                match axis_word(word.address) {
                    Some((axis, Way::Modal)) => self.programmed[axis.index()] = word.value * self.unit(axis),
                    Some((axis, _)) => return Err(format!("TRANS takes {axis} with its value")),
                    None => {}
                }
            }
            self.ahead = true;
            return Ok(Next::On);
        }
        if let Some(f) = value("F") {
            if f <= 0.0 {
                return Err(format!("the feed is {f}"));
            }
            self.feed = f * if self.inch { mm_from_inch(1.0) } else { 1.0 };
        }
        let Some(motion) = motion else { return Ok(if over { Next::End } else { Next::On }) };
        self.may_move(vm)?;
        if let Some(acts) = self.lasting.filter(|_| value("SUPA").is_none()) {
            return Err(format!("it moves under {}: it has not asked for one ($P_ACTFRAME)", acts.says()));
        }
        let to = self.target(words, vm)?;
        self.ahead = true;
        if motion == 1.0 && (self.feed_mode != 94.0 || self.feed <= 0.0) {
            return Err("G1 needs a feed, in mm per minute".to_owned());
        }
        if let Some(input) = value("MEAS") {
            return self.search(words, input, &to, vm);
        }
        vm.go(&to, if motion == 0.0 { Rate::Rapid } else { Rate::Feed(self.feed) }, self.exact)?;
        Ok(Next::On)
    }

    fn read(&self, var: &Var, vm: &Vm) -> Result<f64, String> {
        let Var::Name(name) = var else { return Err(format!("{var} is no variable")) };
        let (name, index) = match name.strip_suffix(']').and_then(|n| n.split_once('[')) {
            Some(parts) => parts,
            None if name.starts_with('$') => (name.as_ref(), ""),
            None => return own(&self.own, var),
        };
        if self.ahead {
            return Err(format!("STOPRE is missing: {var} would be read before the block before it has ended"));
        }
        if name == "$AC_TIMER" {
            return own(&self.timers, var).map(|zero| vm.clock_s(TIMER_S) - zero);
        }
        self.system_variable(name, index, vm)
    }

    fn exists(&self, var: &Var) -> bool {
        self.own.contains_key(var)
    }

    fn doubt(&self, var: &Var, vm: &Vm) -> Option<Doubt> {
        let Var::Name(name) = var else { return None };
        let unmoved = |index: &str| {
            index.chars().next().and_then(AxisName::from_letter).is_some_and(|axis| !vm.known[axis.index()])
        };
        match name.split_once('[').unwrap_or((name, "")) {
            ("$A_HOUR" | "$A_MINUTE" | "$A_SECOND" | "$AC_TIMER" | "$A_IN", _) => Some(Doubt::Outside),
            ("$P_ACTFRAME", _) => Some(Doubt::Stored),
            ("$AA_IM" | "$AA_IW", index) => unmoved(index).then_some(Doubt::Stored),
            _ => None,
        }
    }

    fn is_probe_input(&self, var: &Var) -> bool {
        matches!(var, Var::Name(name) if name.starts_with("$A_PROBE["))
    }

    fn write(&mut self, var: &Var, value: f64, vm: &Vm) -> Result<(), String> {
        match var {
            Var::Name(name) if name.starts_with("$AC_TIMER[") => self.timers.insert(*var, vm.clock_s(TIMER_S) - value),
            Var::Name(name) if !name.starts_with('$') => self.own.insert(*var, value),
            _ => return Err(format!("{var} cannot be written")),
        };
        Ok(())
    }

    fn probed(&mut self, _probe: &Probe, outcome: Outcome, stands: &Position) {
        self.triggered = outcome.hit;
        if outcome.hit {
            let work = AxisName::ALL.map(|a| stands.get(a) - self.shift(a, false));
            self.latched = Some(Latched { named: self.measuring, at: *stands, work });
        }
    }

    /// MEAS latches the axes of its block.
    fn latches_rotary(&self) -> bool {
        false
    }

    /// M30 and a reset bring back the modes that the machine's own data name; what is written into R parameters stays.
    fn settings(&self) -> BTreeMap<String, String> {
        let is_r = |v: &Var| matches!(v, Var::Name(n) if n.strip_prefix('R').is_some_and(|n| n.bytes().all(|b| b.is_ascii_digit())));
        let own = self.own.iter().filter(|(v, _)| is_r(v) && !self.found_in.contains(v));
        let written: BTreeMap<&Var, &f64> = own.collect();
        let written: Vec<String> = written.into_iter().map(|(v, x)| format!("{v}={x:.6}")).collect();
        BTreeMap::from([("R parameters".to_owned(), written.join(" "))])
    }

    /// `%12.4F` keeps room for twelve characters in all.
    fn spell(&self, value: f64, decimals: usize, width: usize) -> String {
        format!("{value:>width$.decimals$}")
    }
}
