//! What a TNC does with a block: L, touch probe cycle 4, datum shift, M128, M91, system data.
//!
//! What cycle 4 does is as the postprocessor file says, unverified on a control: it moves along a vector until the probe
//! triggers, keeps where that was in three Q parameters and -1 in the fourth where it did not, and goes back by MB, but
//! not past its beginning. With the probe deflected at its beginning the control may stop by itself; here the cycle ends at
//! once, and the program must see to it.

use crate::axes::{AxisName, Position};
use crate::check::code::{UnknownKind, Values, Var};
use crate::check::doubt::Doubt;
use crate::check::hidden_rotation::HiddenRotation;
use crate::check::run::{
    Alarm, Dialect, Event, LeftoverMode, Next, Outcome, Probe, Rate, SPINDLE_OFF, Spoken, Start, Vm, own,
};
use crate::machine::Machine;
use crate::post::Postprocessor;
use crate::units::mm_from_inch;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The state of the control.
#[derive(Debug, Clone)]
pub struct Heidenhain {
    inch: bool,
    /// The preset that is active: machine coordinate of the datum, mm and deg.
    preset: [f64; 6],
    /// Length of the tool that is called, mm.
    tool_mm: f64,
    /// Of TRANS DATUM or cycle 7, mm and deg.
    shift: [f64; 6],
    /// Basic rotation of the preset, deg.
    rotation: f64,
    /// A basic rotation in space (SPA, SPB).
    skew: HiddenRotation,
    tilted: bool,
    tcpm: Tcpm,
    /// M126: rotary axes take the short way.
    short_way: bool,
    /// mm/min
    feed: f64,
    /// Of cycle 13, deg.
    angle: Option<f64>,
    own: Values,
    last: Last,
    /// M functions of the builder that switch the probe.
    builder: Arc<[f64]>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Tcpm {
    Off,
    /// On before the program began.
    Found,
    /// Switched on by the program.
    On,
}

/// The last run of cycle 4.
#[derive(Debug, Clone, Copy, Default)]
struct Last {
    first: u32,
    in_machine: bool,
    hit: bool,
    /// The way that it made, mm.
    made: [f64; 3],
}

/// The Q parameters that a program may use: free for the user, TNC 640 User's Manual, "Q parameters".
const OWN: std::ops::RangeInclusive<u32> = 1600..=1999;

impl Heidenhain {
    fn unit(&self, axis: AxisName) -> f64 {
        if self.inch && !axis.is_rotary() { mm_from_inch(1.0) } else { 1.0 }
    }

    /// Machine coordinate less the coordinate that a word without M91 means, mm or deg.
    fn offset(&self, axis: AxisName) -> f64 {
        let tool = if axis == AxisName::Z { self.tool_mm } else { 0.0 };
        self.preset[axis.index()] + self.shift[axis.index()] + tool
    }

    fn target(&self, words: &[Spoken], vm: &Vm) -> Result<[Option<f64>; 6], String> {
        let m91 = words.iter().any(|w| w.address == "M91");
        let mut to = [None; 6];
        for axis in AxisName::ALL {
            let letter = axis.letter();
            let of = |w: &&Spoken| w.address.strip_prefix('I').unwrap_or(w.address).starts_with(letter);
            let Some(word) = words.iter().filter(|w| w.address != "L").find(of) else { continue };
            let way = word.value * self.unit(axis);
            to[axis.index()] = Some(match (word.address.starts_with('I'), m91) {
                (true, true) => return Err("a step stands with M91".to_owned()),
                (true, false) => vm.at.get(axis) + way,
                (false, true) => way,
                (false, false) => way + self.offset(axis),
            });
        }
        Ok(to)
    }

    fn may_move(&self, vm: &Vm) -> Result<(), String> {
        if self.tilted {
            return Err("it moves in the tilted plane: PLANE RESET STAY is missing".to_owned());
        }
        match (self.tcpm, vm.world.is_tcp()) {
            (Tcpm::Found, _) => Err("it moves under the M128 of before: M129 is missing".to_owned()),
            (Tcpm::Off, true) => Err("the plan is for the control's transformation: M128 is missing".to_owned()),
            (Tcpm::On, true) if self.rotation != 0.0 => {
                Err("it moves under a basic rotation, which turns its way: it has not asked for one (ID210 NR1)"
                    .to_owned())
            }
            (Tcpm::On, false) => Err("it moves under M128, and no plan says for which touches".to_owned()),
            _ => Ok(()),
        }
    }

    fn feed_of(&mut self, words: &[Spoken]) -> Result<(), String> {
        if let Some(f) = words.iter().find(|w| w.address == "F") {
            if f.value <= 0.0 {
                return Err(format!("the feed is {}", f.value));
            }
            self.feed = f.value * self.unit(AxisName::X);
        }
        Ok(())
    }

    fn linear(&mut self, words: &[Spoken], vm: &mut Vm) -> Result<Next, String> {
        self.may_move(vm)?;
        self.feed_of(words)?;
        let to = self.target(words, vm)?;
        let turns = AxisName::ALL.iter().any(|a| a.is_rotary() && to[a.index()].is_some());
        if turns && self.short_way {
            return Err("a rotary axis may take the short way: M127 is missing".to_owned());
        }
        let rate = if words.iter().any(|w| w.address == "FMAX") {
            Rate::Rapid
        } else if self.feed > 0.0 {
            Rate::Feed(self.feed)
        } else {
            return Err("L without a feed".to_owned());
        };
        vm.go(&to, rate, true)?;
        Ok(Next::On)
    }

    fn probe(&mut self, words: &[Spoken], vm: &Vm) -> Result<Next, String> {
        self.may_move(vm)?;
        let value = |address: &str| words.iter().find(|w| w.address == address).map_or(0.0, |w| w.value);
        let in_machine = value("REFERENCE") == 1.0;
        if in_machine && self.tcpm == Tcpm::On {
            return Err("REFERENCE SYSTEM:1 stands under M128".to_owned());
        }
        if !in_machine && self.tcpm != Tcpm::On {
            return Err(
                "cycle 4 moves in the system of the workpiece, where a basic rotation turns its way: REFERENCE SYSTEM:1 is missing"
                    .to_owned(),
            );
        }
        let first = value("PROBE") as u32;
        if !OWN.contains(&first) || !OWN.contains(&(first + 3)) {
            return Err(format!(
                "Q{first} to Q{} are not the program's own: Q1600 to Q1999 are",
                first.saturating_add(3)
            ));
        }
        let along = [value("IX"), value("IY"), value("IZ")];
        let length = along.iter().map(|d| d * d).sum::<f64>().sqrt();
        if !(length > 1e-9 && length.is_finite()) {
            return Err("cycle 4 has no direction".to_owned());
        }
        let way = value("DIST") * self.unit(AxisName::X);
        if way <= 0.0 {
            return Err(format!("cycle 4 is to move by {way} mm"));
        }
        self.last = Last { first, in_machine, ..Last::default() };
        let mut to = [None; 6];
        for (axis, part) in AxisName::ALL.into_iter().zip(along).filter(|(_, part)| *part != 0.0) {
            to[axis.index()] = Some(vm.at.get(axis) + way * part / length);
        }
        let feed = value("F") * self.unit(AxisName::X);
        if feed <= 0.0 {
            return Err(format!("the feed is {feed}"));
        }
        let to = vm.target(&to)?;
        self.skew.may_probe(&vm.at, &to, "a basic rotation in space (SPA, SPB)")?;
        Ok(Next::Probe(Probe {
            from: vm.at,
            to,
            feed,
            toward: true,
            known: vm.known,
            // the head of the program says at what it must stand; a program cannot switch it off
            overridden: false,
            alarm: Alarm::Never,
        }))
    }

    /// Back from the face, as cycle 4 does by itself.
    fn back(&self, mm: f64, vm: &mut Vm) {
        let made = self.last.made.iter().map(|d| d * d).sum::<f64>().sqrt();
        let back = mm.min(made);
        if !self.last.hit || back <= 0.0 {
            return;
        }
        let from = vm.at;
        for (slot, way) in vm.at.0.iter_mut().zip(self.last.made) {
            *slot -= way * back / made;
        }
        vm.note(Event::Release { from, to: vm.at });
    }

    /// An M function. A new one stands in `KNOWN` (of `unknown`) too.
    fn auxiliary(&mut self, m: f64, vm: &mut Vm) -> Result<Next, String> {
        match m as u32 {
            0 => vm.note(Event::Wait(String::new())),
            5 => vm.note(Event::Other(SPINDLE_OFF.to_owned())),
            9 => vm.note(Event::Other("coolant off".to_owned())),
            19 => vm.note(Event::Orient(self.angle.ok_or("M19 without cycle 13: to which angle?")?)),
            30 => return Ok(Next::End),
            126 | 127 => self.short_way = m == 126.0,
            // FUNCTION TCPM has settings that M128 lacks: what is left of them is not known
            128 if self.tcpm == Tcpm::Found => {
                return Err("M128 stands under the transformation of before: M129 is missing".to_owned());
            }
            128 => self.tcpm = Tcpm::On,
            129 => self.tcpm = Tcpm::Off,
            _ if self.builder.contains(&m) => vm.note(Event::Other(format!("M{m}"))),
            _ => return Err(format!("M{m} is not known to axiscal")),
        }
        Ok(Next::On)
    }

    fn system(&self, data: &str, vm: &Vm) -> Option<f64> {
        let (id, index) = data.strip_prefix("ID")?.split_once(" IDX")?;
        let index: usize = index.parse().ok()?;
        // any time: what a program makes of it is the difference of two; the control counts whole seconds
        const CLOCK_S: f64 = 1000.0;
        let axis = || AxisName::ALL.get(index.checked_sub(1)?).copied().filter(|a| vm.axes[a.index()]);
        Some(match id {
            // of the preset, and of cycle 10
            "210 NR1" => self.rotation,
            "210 NR2" => 0.0,
            "320" => CLOCK_S + vm.clock_s(1.0),
            "240" => axis().map(|axis| vm.at.get(axis) + self.skew.off(axis, &vm.at))?,
            "270" => {
                let axis = axis()?;
                vm.at.get(axis) - self.offset(axis)
            }
            _ => return None,
        })
    }
}

/// The M functions with which a file switches the probe on and off; those that mean something else to every control are not the
/// builder's.
fn builder(post: &Postprocessor) -> Arc<[f64]> {
    const EVERYBODY_S: [f64; 13] = [1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 13.0, 14.0, 91.0, 92.0, 98.0, 99.0, 130.0];
    let lines = ["probe_on", "probe_off"].into_iter().filter_map(|name| post.settings.get(name));
    let words = lines.flat_map(|text| text.split_whitespace()).filter_map(|word| word.strip_prefix('M'));
    words.filter_map(|digits| digits.parse().ok()).filter(|m| !EVERYBODY_S.contains(m)).collect()
}

impl Dialect for Heidenhain {
    /// With M91 and in the machine's system nothing of it acts.
    fn lasting(tcp: bool) -> &'static [LeftoverMode] {
        if tcp { &[LeftoverMode::Rotated] } else { &[] }
    }

    fn may_be_rotated(tcp: bool) -> bool {
        tcp
    }

    fn begin(start: Start, post: &Postprocessor, _machine: &Machine) -> Self {
        let awkward = start == Start::Awkward;
        let third = start == Start::Third;
        let some = |values: [f64; 6], when: bool| if when { values } else { [0.0; 6] };
        Self {
            inch: false,
            preset: some([7.5, -3.25, 11.0, 1.5, -2.0, 0.75], awkward || third),
            tool_mm: if awkward || third { 120.25 } else { 0.0 },
            shift: some([-4.0, 2.5, 6.0, 0.5, 0.25, -1.0], awkward),
            rotation: if start == Start::LeftoverMode(LeftoverMode::Rotated) { 1.5 } else { 0.0 },
            skew: HiddenRotation::from_start(start),
            tilted: awkward,
            tcpm: if awkward || third { Tcpm::Found } else { Tcpm::Off },
            short_way: awkward,
            feed: 0.0,
            angle: None,
            own: Values::default(),
            last: Last::default(),
            builder: builder(post),
        }
    }

    fn unknown(&self, words: &[Spoken], _post: &Postprocessor) -> Vec<(UnknownKind, String)> {
        // what `auxiliary` runs: a program without a plan is asked here, one with a plan there
        const KNOWN: [f64; 9] = [0.0, 5.0, 9.0, 19.0, 30.0, 126.0, 127.0, 128.0, 129.0];
        let known = |m: &f64| KNOWN.contains(m) || self.builder.contains(m);
        let numbers = words.iter().filter(|w| w.address == "M" && w.value.is_finite()).map(|w| w.value);
        numbers.filter(|m| !known(m)).map(|m| (UnknownKind::Meaning, format!("M{m}"))).collect()
    }

    fn block(&mut self, words: &[Spoken], vm: &mut Vm) -> Result<Next, String> {
        let Some(head) = words.first() else { return Ok(Next::On) };
        self.skew.reckon(&vm.at);
        match head.address {
            "L" => return self.linear(words, vm),
            "PROBE" => return self.probe(words, vm),
            "BACK" => self.back(head.value * self.unit(AxisName::X), vm),
            "M" => return self.auxiliary(head.value, vm),
            "INCH" => self.inch = head.value == 1.0,
            "PLANE" => self.tilted = false,
            "ANGLE" => self.angle = Some(head.value),
            // the only rotation of cycle 10 that is read is none
            "NO ROTATION" | "DWELL" => {}
            "NO SHIFT" => self.shift = [0.0; 6],
            "SHIFT" => {
                if words.iter().any(|w| w.address.starts_with('I')) {
                    return Err("a datum shift by a step is not known to axiscal".to_owned());
                }
                for axis in AxisName::ALL {
                    if let Some(word) = words.iter().find(|w| w.address.starts_with(axis.letter())) {
                        self.shift[axis.index()] = word.value * self.unit(axis);
                    }
                }
            }
            other => return Err(format!("{other} is not known to axiscal")),
        }
        Ok(Next::On)
    }

    fn read(&self, var: &Var, vm: &Vm) -> Result<f64, String> {
        match var {
            Var::Number(n) if OWN.contains(n) => own(&self.own, var).map_err(|_| format!("Q{n} has no value")),
            Var::Number(n) => Err(format!("what Q{n} holds is not known to axiscal")),
            Var::Name(data) => self.system(data, vm).ok_or_else(|| format!("{data} is no system data of this machine")),
        }
    }

    fn doubt(&self, var: &Var, vm: &Vm) -> Option<Doubt> {
        let Var::Name(data) = var else { return None };
        let (id, index) = data.split_once(" IDX")?;
        let unmoved = || {
            let place = index.parse::<usize>().ok().and_then(|n| n.checked_sub(1));
            place.and_then(|n| vm.known.get(n)).is_some_and(|known| !known)
        };
        match id {
            "ID320" => Some(Doubt::Outside),
            "ID240" | "ID270" => unmoved().then_some(Doubt::Stored),
            _ => id.starts_with("ID210").then_some(Doubt::Stored),
        }
    }

    fn exists(&self, var: &Var) -> bool {
        self.own.contains_key(var)
    }

    fn write(&mut self, var: &Var, value: f64, _vm: &Vm) -> Result<(), String> {
        match var {
            Var::Number(n) if OWN.contains(n) => {
                self.own.insert(*var, value);
                Ok(())
            }
            Var::Number(n) => Err(format!("Q{n} is not the program's own: Q1600 to Q1999 are")),
            Var::Name(name) => Err(format!("{name} cannot be written")),
        }
    }

    fn probed(&mut self, probe: &Probe, outcome: Outcome, stands: &Position) {
        let Last { first, in_machine, .. } = self.last;
        self.last.hit = outcome.hit;
        for (number, axis) in (first..).zip([AxisName::X, AxisName::Y, AxisName::Z]) {
            self.last.made[axis.index()] = stands.get(axis) - probe.from.get(axis);
            let offset = if in_machine { 0.0 } else { self.offset(axis) };
            self.own.insert(Var::Number(number), (stands.get(axis) - offset) / self.unit(axis));
        }
        self.own.insert(Var::Number(first + 3), if outcome.hit { 0.0 } else { -1.0 });
    }

    fn latches(&self) -> bool {
        false
    }

    fn settings(&self) -> BTreeMap<String, String> {
        let numbers = |values: &[f64]| values.iter().map(|x| format!("{:.6}", x + 0.0)).collect::<Vec<_>>().join(" ");
        let on = |yes: bool| if yes { "on" } else { "off" }.to_owned();
        BTreeMap::from([
            ("tilted plane".to_owned(), on(self.tilted)),
            (
                "tool centre point control".to_owned(),
                match self.tcpm {
                    Tcpm::Off => "off",
                    Tcpm::Found => "on",
                    Tcpm::On => "switched on by the program",
                }
                .to_owned(),
            ),
            ("short way".to_owned(), on(self.short_way)),
            ("datum shift".to_owned(), numbers(&self.shift)),
        ])
    }

    fn spell(&self, value: f64, decimals: usize, width: usize) -> String {
        format!("{value:>width$.decimals$}")
    }
}
