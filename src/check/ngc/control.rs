//! What LinuxCNC does with a block: modes, coordinate systems, parameters, probing.
//!
//! Sources: LinuxCNC 2.9 manual 11.4.3.1 (parameters), 11.5 (G), 11.6 (M); what a probing move does with a triggered
//! probe, when a coordinate system is read again and what M73 brings back was observed on LinuxCNC 2.9.0~pre1.

mod parameters;

use crate::axes::{AxisName, Position};
use crate::check::code::{UnknownKind, VALUE, Values, Var};
use crate::check::doubt::Doubt;
use crate::check::run::{Alarm, Dialect, Event, Next, Outcome, Probe, Rate, SPINDLE_OFF, Spoken, Start, Vm, own};
use crate::machine::Machine;
use crate::post::Postprocessor;
use crate::units::mm_from_inch;
use parameters::READ_ONLY;
use std::cell::RefCell;
use std::collections::{BTreeMap, HashMap};

/// How many coordinate systems there are: G54 … G59.3.
const SYSTEMS: usize = 9;

/// Memory is kept for so many variables when a subroutine begins.
const ARGUMENTS: usize = 14;

/// The modes that M73 keeps.
#[derive(Debug, Clone, PartialEq)]
struct Modes {
    inch: bool,
    incremental: bool,
    /// 0: G54 … 8: G59.3.
    system: usize,
    /// 93, 94, 95
    feed_mode: u32,
    /// 17, 18, 19
    plane: u32,
    /// 40: off
    cutter: u32,
    /// 61, 64; 61.1 is 611
    path: u32,
    tool_on: bool,
    /// mm/min
    feed: f64,
    override_on: bool,
}

/// The state of the control.
#[derive(Debug, Clone)]
pub struct Ngc {
    modes: Modes,
    /// Kept by M73, one place for each subroutine that is open.
    kept: Vec<Option<Modes>>,
    /// Offsets X Y Z A B C and rotation of each system, as the parameters 5221 … hold them, mm and deg.
    systems: [[f64; 7]; SYSTEMS],
    /// The offsets that act: those of the chosen system when it was chosen.
    acting: [f64; 7],
    /// Parameters 5211 … 5216.
    g92: [f64; 6],
    g92_on: bool,
    /// Length offsets that act, mm.
    tool: [f64; 3],
    /// Those of the tool table.
    table: [f64; 3],
    globals: Values,
    /// Named parameters that an earlier program has left.
    found: Values,
    locals: Vec<Values>,
    /// 5061 … 5066 in mm and deg, in the acting coordinates, and 5070.
    probed: [f64; 6],
    hit: bool,
}

impl Ngc {
    /// The control before the program.
    fn new(start: Start) -> Self {
        let fresh = Modes {
            inch: false,
            incremental: false,
            system: 0,
            feed_mode: 94,
            plane: 17,
            cutter: 40,
            path: 64,
            tool_on: false,
            feed: 0.0,
            override_on: true,
        };
        let mut ngc = Self {
            modes: fresh,
            kept: Vec::new(),
            systems: [[0.0; 7]; SYSTEMS],
            acting: [0.0; 7],
            g92: [0.0; 6],
            g92_on: false,
            tool: [0.0; 3],
            table: [0.0, 0.0, 51.25],
            globals: Values::default(),
            found: Values::default(),
            locals: vec![Values::default()],
            probed: [0.0; 6],
            hit: false,
        };
        if start == Start::Awkward {
            let system = 1;
            ngc.modes = Modes {
                inch: true,
                incremental: true,
                system,
                feed_mode: 93,
                plane: 18,
                cutter: 41,
                path: 64,
                tool_on: true,
                feed: 12.5,
                override_on: true,
            };
            for (n, offsets) in ngc.systems.iter_mut().enumerate() {
                *offsets = [11.0, -7.5, 3.25, 1.5, -2.5, 4.0, 30.0].map(|x| x * (1.0 + n as f64 / 8.0));
            }
            ngc.acting = ngc.systems[system];
            ngc.g92 = [2.0, -3.0, 5.0, 0.5, 0.25, -0.75];
            ngc.g92_on = true;
            ngc.tool = [0.125, -0.25, 77.5];
        }
        if start == Start::Third {
            // the very coordinate system that a program may take for itself
            ngc.modes =
                Modes { system: 8, feed_mode: 95, plane: 19, path: 61, tool_on: true, feed: 300.0, ..ngc.modes };
            ngc.systems[8] = [-3.5, 6.25, 12.5, 0.75, -1.25, 2.0, 0.0];
            ngc.acting = ngc.systems[8];
            ngc.tool = ngc.table;
        }
        ngc
    }

    fn unit(&self, axis: AxisName) -> f64 {
        if self.modes.inch && !axis.is_rotary() { mm_from_inch(1.0) } else { 1.0 }
    }

    /// Machine coordinate less program coordinate, mm or deg.
    fn shift(&self, axis: AxisName) -> f64 {
        let i = axis.index();
        let g92 = if self.g92_on { self.g92[i] } else { 0.0 };
        self.acting[i] + g92 + self.tool.get(i).copied().unwrap_or(0.0)
    }

    /// The program's coordinate of a place, in its units.
    fn shown(&self, axis: AxisName, at: &Position) -> f64 {
        (at.get(axis) - self.shift(axis)) / self.unit(axis)
    }

    fn choose(&mut self, system: usize) {
        // the same system again is not read again
        if self.modes.system != system {
            self.modes.system = system;
            self.acting = self.systems[system];
        }
    }

    fn restore(&mut self, kept: Modes) {
        self.choose(kept.system);
        self.tool = if kept.tool_on { self.table } else { [0.0; 3] };
        self.modes = kept;
    }

    /// Where a block sends the axes, machine coordinates.
    fn targets(&self, words: &[Spoken], vm: &Vm) -> [Option<f64>; 6] {
        AxisName::ALL.map(|axis| {
            let word = words.iter().find(|w| w.address.starts_with(axis.letter()))?;
            let way = word.value * self.unit(axis);
            Some(if self.modes.incremental { vm.at.get(axis) + way } else { way + self.shift(axis) })
        })
    }

    fn feed(&mut self, words: &[Spoken]) -> Result<(), String> {
        if let Some(f) = words.iter().find(|w| w.address == "F") {
            if f.value <= 0.0 {
                return Err(format!("the feed is {}", f.value));
            }
            self.modes.feed = f.value * if self.modes.inch { mm_from_inch(1.0) } else { 1.0 };
        }
        Ok(())
    }

    fn may_move(&self) -> Result<(), String> {
        if self.modes.cutter != 40 {
            return Err("it moves with cutter compensation on: G40 is missing".to_owned());
        }
        if self.acting[6] != 0.0 {
            return Err("it moves in a coordinate system that is turned by G10 R".to_owned());
        }
        Ok(())
    }

    fn auxiliary(&mut self, m: f64, words: &[Spoken], vm: &mut Vm) -> Result<bool, String> {
        let value = |address: &str| words.iter().find(|w| w.address == address).map(|w| w.value);
        let tenth = (m * 10.0).round() as i64;
        match tenth {
            20 | 300 => return Ok(true),
            0 => vm.note(Event::Wait(String::new())),
            50 => vm.note(Event::Other(SPINDLE_OFF.to_owned())),
            10 => vm.note(Event::Other("optional stop".to_owned())),
            80 => vm.note(Event::Other("coolant on".to_owned())),
            90 => vm.note(Event::Other("coolant off".to_owned())),
            190 => vm.note(Event::Orient(value("R").ok_or("M19 needs R")?)),
            500 => self.modes.override_on = value("P") != Some(0.0),
            620 | 630 | 640 | 650 => {
                let p = value("P").ok_or_else(|| format!("M{m} needs P"))?;
                vm.note(Event::Other(format!("M{m} P{p}")));
            }
            660 => {
                if (value("E"), value("L")) != (Some(0.0), Some(0.0)) {
                    return Err("of M66 only E0 L0 is known".to_owned());
                }
            }
            730 => match self.kept.last_mut() {
                Some(place) => *place = Some(self.modes.clone()),
                None => return Err("M73 outside of a subroutine".to_owned()),
            },
            1000..=1990 if tenth % 10 == 0 => vm.note(Event::Other(format!("M{m}"))),
            _ => return Err(format!("M{m} is not known to axiscal")),
        }
        Ok(false)
    }

    fn mode(&mut self, tenth: i64, words: &[Spoken]) -> Result<(), String> {
        let value = |letter: char| words.iter().find(|w| w.address.starts_with(letter)).map(|w| w.value);
        match tenth {
            170 | 180 | 190 => self.modes.plane = (tenth / 10) as u32,
            200 | 210 => self.modes.inch = tenth == 200,
            400 => self.modes.cutter = 40,
            431 => {
                let unit = self.unit(AxisName::X);
                for (i, letter) in ['X', 'Y', 'Z'].into_iter().enumerate() {
                    if let Some(x) = value(letter) {
                        self.tool[i] = x * unit;
                    }
                }
                self.modes.tool_on = true;
            }
            490 => {
                self.tool = [0.0; 3];
                self.modes.tool_on = false;
            }
            540 | 550 | 560 | 570 | 580 => self.choose((tenth / 10 - 54) as usize),
            590..=593 => self.choose((tenth - 590 + 5) as usize),
            610 | 640 => self.modes.path = (tenth / 10) as u32,
            800 => {}
            900 | 910 => self.modes.incremental = tenth == 910,
            922 => self.g92_on = false,
            923 => self.g92_on = true,
            930 | 940 | 950 => self.modes.feed_mode = (tenth / 10) as u32,
            _ => return Err(format!("G{} is not known to axiscal", tenth as f64 / 10.0)),
        }
        Ok(())
    }
}

/// The G numbers (in tenths) of one modal group: a block may hold one of each.
const GROUPS: [&[i64]; 10] = [
    &[0, 10, 383, 385, 382, 384, 800],
    &[170, 180, 190],
    &[900, 910],
    &[930, 940, 950],
    &[200, 210],
    &[400],
    &[431, 490],
    &[540, 550, 560, 570, 580, 590, 591, 592, 593],
    &[610, 640],
    &[100, 922, 923],
];

impl Dialect for Ngc {
    fn unknown(&self, words: &[Spoken], post: &Postprocessor) -> Vec<(UnknownKind, String)> {
        let tenth = |value: f64| (value * 10.0).round();
        let whole = |value: f64| (value * 10.0 - tenth(value)).abs() < 1e-6;
        let known_g = |g: i64| matches!(g, 0 | 10 | 100 | 382..=385) || self.clone().mode(g, &[]).is_ok();
        let switches = |m: f64| {
            let lines = ["probe_on", "probe_off"].into_iter().filter_map(|name| post.settings.get(name));
            let mut words = lines.flat_map(|line| line.split_whitespace());
            words.any(|word| word.strip_prefix(['M', 'm']).and_then(|n| n.parse().ok()) == Some(m))
        };
        let known_m = |m: f64| match m {
            // what they do stands outside of the program: outputs of the machine, programs of the user
            62.0..=65.0 | 67.0..=68.0 | 98.0 | 100.0..=199.0 => switches(m),
            _ => [0.0, 1.0, 2.0, 5.0, 8.0, 9.0, 19.0, 30.0, 50.0, 66.0, 73.0].contains(&m) || switches(m),
        };
        let mut unknown = Vec::new();
        for word in words.iter().filter(|w| w.value.is_finite()) {
            let known = match word.address {
                "G" => whole(word.value) && known_g(tenth(word.value) as i64),
                "M" => known_m(word.value),
                _ => true,
            };
            let kind = match (word.address, word.value) {
                ("M", 62.0..=65.0 | 67.0..=68.0) => UnknownKind::Output,
                ("M", 98.0 | 100.0..=199.0) => UnknownKind::Program,
                _ => UnknownKind::Meaning,
            };
            if !known {
                unknown.push((kind, format!("{}{}", word.address, word.value)));
            }
        }
        let functions = || words.iter().filter(|w| matches!(w.address, "G" | "M"));
        if unknown.is_empty() && functions().all(|w| w.value.is_finite()) {
            let gs: Vec<i64> = words.iter().filter(|w| w.address == "G").map(|w| tenth(w.value) as i64).collect();
            let with = functions().next_back().map_or_else(String::new, |w| format!(" with {}{}", w.address, w.value));
            unknown.extend(
                Self::unused(words, &gs).map(|letter| (UnknownKind::Meaning, format!("the word {letter}{with}"))),
            );
        }
        unknown
    }

    fn begin(start: Start, _post: &Postprocessor, _machine: &Machine) -> Self {
        Self::new(start)
    }

    fn after_abort(&self) -> Option<Self> {
        let mut next = self.clone();
        next.kept.clear();
        next.found.clone_from(&next.globals);
        next.locals = vec![Values::default()];
        Some(next)
    }

    fn block(&mut self, words: &[Spoken], vm: &mut Vm) -> Result<Next, String> {
        let numbers = |address: &'static str| words.iter().filter(move |w| w.address == address).map(|w| w.value);
        let tenth = |g: f64| {
            let t = (g * 10.0).round();
            if (g * 10.0 - t).abs() > 1e-6 { Err(format!("G{g} is not known to axiscal")) } else { Ok(t as i64) }
        };
        let gs: Vec<i64> = numbers("G").map(tenth).collect::<Result<_, _>>()?;
        for group in GROUPS {
            if gs.iter().filter(|g| group.contains(g)).count() > 1 {
                return Err("two G words of one group stand in one line".to_owned());
            }
        }
        let motion: Option<i64> = gs.iter().copied().find(|g| matches!(g, 0 | 10 | 382..=385));
        let takes_axes = motion.is_some() || gs.iter().any(|g| matches!(g, 100 | 431));
        let has = |letters: &str| words.iter().any(|w| letters.contains(w.address));
        if has("XYZABC") != takes_axes && !(gs.contains(&431)) {
            return Err(if takes_axes {
                "no axis word stands with the move".to_owned()
            } else {
                "axis words stand without a G word that uses them".to_owned()
            });
        }
        if let Some(letter) = Self::unused(words, &gs) {
            return Err(format!("what the word {letter} does in the line is not known to axiscal"));
        }
        for g in gs.iter().filter(|g| matches!(g, 930 | 940 | 950)) {
            self.mode(*g, words)?;
        }
        // units before the feed, as all that follows reads them
        for g in gs.iter().filter(|g| matches!(g, 200 | 210)) {
            self.mode(*g, words)?;
        }
        self.feed(words)?;
        let mut over = false;
        for m in numbers("M").collect::<Vec<_>>() {
            over |= self.auxiliary(m, words, vm)?;
        }
        for g in &gs {
            if !matches!(g, 0 | 10 | 382..=385 | 100 | 200 | 210 | 930 | 940 | 950) {
                self.mode(*g, words)?;
            }
        }
        if gs.contains(&100) {
            self.set_system(words)?;
        }
        let Some(motion) = motion else { return Ok(if over { Next::End } else { Next::On }) };
        self.may_move()?;
        let to = self.targets(words, vm);
        if motion >= 382 {
            if self.modes.feed_mode != 94 {
                return Err("it probes in a feed mode other than G94".to_owned());
            }
            if self.modes.feed <= 0.0 {
                return Err("it probes without a feed".to_owned());
            }
            return Ok(Next::Probe(Probe {
                from: vm.at,
                to: vm.target(&to)?,
                feed: self.modes.feed,
                toward: motion <= 383,
                known: vm.known,
                overridden: self.modes.override_on,
                alarm: if matches!(motion, 382 | 384) { Alarm::WithoutEvent } else { Alarm::Never },
            }));
        }
        let rate = match motion {
            0 => Rate::Rapid,
            _ if self.modes.feed_mode != 94 || self.modes.feed <= 0.0 => {
                return Err("G1 needs a feed, in mm per minute".to_owned());
            }
            _ => Rate::Feed(self.modes.feed),
        };
        vm.go(&to, rate, self.modes.path == 61)?;
        Ok(Next::On)
    }

    fn read(&self, var: &Var, vm: &Vm) -> Result<f64, String> {
        let own_value = |values: Option<&Values>| own(values.unwrap_or(&self.globals), var);
        match var {
            Var::Number(n) if *n <= 30 => own_value(self.locals.last()),
            Var::Number(n) => match self.parameter(*n, vm) {
                Some(x) => Ok(x),
                None if *n < 5000 => own(&self.globals, var),
                None => Err(format!("what {var} holds is not known to axiscal")),
            },
            Var::Name(name) if name.starts_with('_') => match self.globals.get(var) {
                Some(x) => Ok(*x),
                None => self.named(name, vm).ok_or_else(|| format!("#<{name}> has no value")),
            },
            Var::Name(_) => own_value(self.locals.last()),
        }
    }

    /// Units, distance mode, G92 on or off and tool length on or off are found both ways by the runs themselves.
    fn doubt(&self, var: &Var, vm: &Vm) -> Option<Doubt> {
        let unmoved = |letter: &str| {
            let axis = letter.chars().next().filter(|_| letter.len() == 1).and_then(AxisName::from_letter);
            axis.is_some_and(|axis| !vm.known[axis.index()])
        };
        let stored = match var {
            Var::Number(5211..=5216 | 5220..=5400) => true,
            Var::Number(n @ 5420..=5425) => !vm.known[(*n - 5420) as usize],
            Var::Name(name) => unmoved(name.strip_prefix("_abs_").or_else(|| name.strip_prefix('_')).unwrap_or("")),
            Var::Number(_) => false,
        };
        stored.then_some(Doubt::Stored)
    }

    fn may_exist(&self, var: &Var) -> bool {
        let is_global = matches!(var, Var::Name(name) if name.starts_with('_'));
        is_global && (self.found.contains_key(var) || !self.globals.contains_key(var))
    }

    fn is_local(&self, var: &Var) -> bool {
        match var {
            Var::Number(n) => *n <= 30,
            Var::Name(name) => !name.starts_with('_'),
        }
    }

    fn exists(&self, var: &Var) -> bool {
        self.globals.contains_key(var) || self.locals.last().is_some_and(|l| l.contains_key(var))
    }

    fn write(&mut self, var: &Var, value: f64, _vm: &Vm) -> Result<(), String> {
        match var {
            Var::Number(n @ 5221..=5400) => {
                let (system, place) = (((n - 5221) / 20) as usize, (n - 5221) % 20);
                let offsets = self.systems.get_mut(system).ok_or_else(|| format!("{var} cannot be written"))?;
                match place {
                    0..=5 => offsets[place as usize] = value,
                    6..=8 => {}
                    9 => offsets[6] = value,
                    _ => return Err(format!("{var} cannot be written")),
                }
            }
            Var::Number(n) if (1..=30).contains(n) => {
                self.locals.last_mut().map(|l| l.insert(*var, value));
            }
            Var::Number(n) if (31..5000).contains(n) => {
                self.globals.insert(*var, value);
            }
            Var::Number(_) => return Err(format!("{var} cannot be written")),
            Var::Name(name) if name.starts_with('_') => {
                if &**name == "_value" || READ_ONLY.contains(&&**name) {
                    return Err(format!("#<{name}> is the control's own and cannot be written"));
                }
                self.globals.insert(*var, value);
            }
            Var::Name(_) => {
                self.locals.last_mut().map(|l| l.insert(*var, value));
            }
        }
        Ok(())
    }

    fn probed(&mut self, _probe: &Probe, outcome: Outcome, stands: &Position) {
        for axis in AxisName::ALL {
            self.probed[axis.index()] = stands.get(axis) - self.shift(axis);
        }
        self.hit = outcome.hit;
    }

    fn entered(&mut self) {
        self.kept.push(None);
        self.locals.push(Values::with_capacity_and_hasher(ARGUMENTS, Default::default()));
    }

    fn left(&mut self, value: Option<f64>, _vm: &Vm) {
        self.locals.pop();
        if let Some(Some(kept)) = self.kept.pop() {
            self.restore(kept);
        }
        self.globals.insert(*VALUE, value.unwrap_or(0.0));
    }

    fn settings(&self) -> BTreeMap<String, String> {
        let m = &self.modes;
        let mut out = BTreeMap::from([
            ("units".to_owned(), if m.inch { "G20" } else { "G21" }.to_owned()),
            ("distance".to_owned(), if m.incremental { "G91" } else { "G90" }.to_owned()),
            ("coordinate system".to_owned(), format!("number {}", m.system + 1)),
            ("feed mode".to_owned(), format!("G{}", m.feed_mode)),
            ("plane".to_owned(), format!("G{}", m.plane)),
            ("cutter compensation".to_owned(), format!("G{}", m.cutter)),
            ("path mode".to_owned(), format!("G{}", m.path)),
            ("tool length".to_owned(), format!("{} {}", if m.tool_on { "on" } else { "off" }, numbers(&self.tool))),
            ("feed".to_owned(), numbers(&[m.feed])),
            ("feed override".to_owned(), m.override_on.to_string()),
            ("G92".to_owned(), format!("{} {}", if self.g92_on { "on" } else { "off" }, numbers(&self.g92))),
            ("offsets that act".to_owned(), numbers(&self.acting)),
        ]);
        for (i, offsets) in self.systems.iter().enumerate() {
            out.insert(format!("offsets of coordinate system {}", i + 1), numbers(offsets));
        }
        out
    }
}

impl Ngc {
    /// A word that nothing in its block uses, as far as axiscal knows.
    fn unused(words: &[Spoken], gs: &[i64]) -> Option<&'static str> {
        let m = |n: f64| words.iter().any(|w| w.address == "M" && w.value == n);
        let used = |word: &Spoken| match word.address {
            "P" => gs.contains(&100) || m(50.0) || [62.0, 63.0, 64.0, 65.0].into_iter().any(m),
            "L" => gs.contains(&100) || m(66.0),
            "R" => gs.contains(&100) || m(19.0),
            "E" => m(66.0),
            "S" | "D" | "Q" => false,
            _ => true,
        };
        words.iter().find(|word| !used(word)).map(|word| word.address)
    }
}

/// Numbers in one text. Most of them are the same at the end of each of a hundred thousand branches: they are written once.
fn numbers(values: &[f64]) -> String {
    const MOST: usize = 200;
    thread_local! {
        static WRITTEN: RefCell<HashMap<Vec<u64>, String>> = RefCell::default();
    }
    let key: Vec<u64> = values.iter().map(|x| x.to_bits()).collect();
    WRITTEN.with_borrow_mut(|written| {
        if let Some(text) = written.get(&key) {
            return text.clone();
        }
        if written.len() >= MOST {
            written.clear();
        }
        let text = values.iter().map(|x| format!("{:.6}", x + 0.0)).collect::<Vec<_>>().join(" ");
        written.insert(key, text.clone());
        text
    })
}
