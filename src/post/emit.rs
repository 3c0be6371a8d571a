//! A proven path → the text of the program. Every word of it comes from the templates of the postprocessor file.

mod find;
mod notes;
mod routines;
mod touch;

use super::as_written::LengthUnit;
use super::nc::{NcProgram, SideFile};
use super::opening::Opening;
use super::spelling::name_of;
use super::{Frame, Postprocessor, log_text};
use crate::axes::{AxisMap, AxisName};
use crate::diag::{Failure, Finding, Findings, Result};
use crate::machine::Machine;
use crate::program::path::{Path, Step, TouchStep};
use crate::program::plan::Plan;
use minijinja::{Value, context};
use std::collections::BTreeMap;

/// What the head of a program says whose X, Y and Z are not axis positions.
pub const TOOL_PLACE: &str = "coordinates are the tool's place in the workpiece";

/// Labels that one step may use.
const LABELS_PER_STEP: usize = 10;

impl Postprocessor {
    /// The program of a path.
    ///
    /// # Errors
    /// When the path does not hang together (a touch does not begin where the ball stands), the control has no
    /// transformation and the plan asks for one, or a template fails.
    pub fn program(&self, machine: &Machine, plan: &Plan, path: &Path) -> Result<NcProgram> {
        let mut writer = Writer::new(self, machine, plan, path)?;
        writer.start()?;
        let (first, rest) = (writer.opening.steps.clone(), writer.opening.rest.clone());
        writer.open(&first)?;
        writer.steps(&rest)?;
        writer.end()?;
        writer.finish()
    }
}

/// Numbers and names of a touch, for messages.
#[derive(Debug, Clone, Default)]
pub(super) struct Named {
    pub(super) id: u64,
    pub(super) says: String,
}

pub(super) struct Writer<'a> {
    pub(super) post: &'a Postprocessor,
    pub(super) plan: &'a Plan,
    pub(super) machine: &'a Machine,
    pub(super) path: &'a Path,
    /// Blocks and faces that are touched: a control without texts in its arguments calls them by their number.
    pub(super) faces: Vec<&'a str>,
    pub(super) frame: Frame<'a>,
    pub(super) axes: Vec<AxisName>,
    pub(super) text: String,
    findings: Findings,
    /// Step that is being written.
    pub(super) index: usize,
    label: usize,
    /// Where the axes stand, as far as the path has said, relative to R.
    pub(super) at: AxisMap,
    /// True after a touch: the axes of the approach stand somewhere before `at`.
    pub(super) loose: bool,
    /// The first moves, which bring the machine from anywhere to a known place.
    pub(super) opening: Opening,
    /// Sense of each rotary axis's last move.
    pub(super) senses: AxisMap,
    /// Orientation of the spindle at the control, deg.
    pub(super) oriented: Option<f64>,
    /// What is mounted in the present part; empty where the program has one part.
    pub(super) mounted: Vec<String>,
    /// Label of the set-up that is open.
    open_setup: Option<usize>,
    /// Its number.
    setup: u32,
    /// The set-up in which each block of what is mounted was touched last.
    pub(super) touched: BTreeMap<String, u32>,
    last: Named,
    /// Approach of the touch made last, and the way back off it: what its retract may use.
    approach: Vec<Value>,
    heading_back: Vec<Value>,
    way: String,
    back_off: String,
    /// What was given to the routines last in this set-up, by its name: a control with one argument a line gives it once.
    pub(super) said: BTreeMap<String, String>,
    /// Where the touch made last began.
    pub(super) began: AxisMap,
    /// A move has been written.
    moving: bool,
    /// What all templates are given that is the same in the whole program.
    of_program: Value,
}

/// The program names the origin of R in the control's own words: between two of its steps it would be another place than that of the
/// machine's description, and everything measured would be off by that.
fn refuse_origin_between_steps(post: &Postprocessor, machine: &Machine) -> Result<()> {
    const SAME: f64 = 1e-6;
    let one = 10f64.powi(-i32::try_from(post.number.decimals).unwrap_or(0));
    let nearest = |axis: AxisName, value: f64| {
        let step = if axis.is_rotary() { one } else { post.number.mm(one) };
        (value / step).round() * step
    };
    let off: Vec<(AxisName, f64, f64)> = machine
        .axes
        .iter()
        .filter_map(|a| machine.origin.get(a.name).map(|v| (a.name, v, nearest(a.name, v))))
        .filter(|(_, value, near)| (value - near).abs() > SAME)
        .collect();
    if off.is_empty() {
        return Ok(());
    }
    let list = |of: &dyn Fn(&(AxisName, f64, f64)) -> f64| -> String {
        let each = off.iter().map(|o| {
            let value = format!("{:.6}", of(o));
            format!("{} = {}", o.0, value.trim_end_matches('0').trim_end_matches('.'))
        });
        each.collect::<Vec<_>>().join(", ")
    };
    Err(Failure::new(
        "post::origin",
        format!(
            "the origin of R lies between the steps of controller {}, whose words have {} decimals in {}: {}",
            post.name,
            post.number.decimals,
            match post.number.unit {
                LengthUnit::Mm => "mm",
                LengthUnit::Inch => "inch",
            },
            list(&|o| o.1)
        ),
    )
    .help(format!(
        "write the nearest place that the control can name into `origin` of machines.toml (mm, deg): {}",
        list(&|o| o.2)
    )))
}

/// Under a transformation a turn goes in steps that take X, Y and Z along: a controller may have no way to write the sense of such a step.
fn refuse_roll_over(post: &Postprocessor, machine: &Machine) -> Result<()> {
    let modulo = post.settings.get("modulo").map_or("", String::as_str);
    let steps = post.tcp.as_ref().is_some_and(|tcp| tcp.roll_over);
    let Some(axis) = machine.rotary().find(|a| !steps && modulo.contains(a.name.letter())) else { return Ok(()) };
    Err(Failure::new(
        "post::roll_over",
        format!(
            "under --tcp controller {} cannot turn axis {}, which counts from 0 to 360 (modulo): a turn goes in steps that take X, Y and Z along, and the sense of such a step is not written",
            post.name, axis.name
        ),
    )
    .help("generate without --tcp; or leave modulo empty, where the control takes angles below 0 and beyond 360 too"))
}

impl<'a> Writer<'a> {
    fn new(post: &'a Postprocessor, machine: &'a Machine, plan: &'a Plan, path: &'a Path) -> Result<Self> {
        refuse_origin_between_steps(post, machine)?;
        let frame = Frame::of_plan(machine, plan);
        let mut at = AxisMap::default();
        if frame.is_tcp() {
            if post.tcp.is_none() {
                return Err(Failure::new(
                    "post::no_tcp",
                    format!("controller {} is not described with a transformation of its own", post.name),
                )
                .help("generate without --tcp, or describe it under [tcp] in the postprocessor file"));
            }
            refuse_roll_over(post, machine)?;
            // the start of the program checks that the rotary axes stand at 0
            machine.rotary().for_each(|a| at.set(a.name, 0.0));
        }
        let axes = AxisName::ALL.into_iter().filter(|a| machine.axis(*a).is_some()).collect();
        let mut writer = Self {
            post,
            plan,
            machine,
            path,
            faces: routines::faces(path),
            frame,
            axes,
            text: String::new(),
            findings: Findings::default(),
            index: 0,
            // the first ones are free for what a template numbers itself
            label: 2 * LABELS_PER_STEP,
            at,
            loose: false,
            opening: Opening::from_path(path, machine, frame.is_tcp()),
            senses: AxisMap::default(),
            oriented: None,
            mounted: path.mounted.clone(),
            open_setup: None,
            setup: 0,
            touched: BTreeMap::new(),
            last: Named::default(),
            approach: Vec::new(),
            heading_back: Vec::new(),
            way: String::new(),
            back_off: String::new(),
            said: BTreeMap::new(),
            began: AxisMap::default(),
            moving: false,
            of_program: Value::UNDEFINED,
        };
        writer.check_input()?;
        writer.of_program = writer.of_program()?;
        Ok(writer)
    }

    fn check_input(&mut self) -> Result<()> {
        self.post.check_program_number()?;
        self.check_find()?;
        if let Some(axis) = self.axes.iter().find(|a| !self.post.result.contains_key(a)) {
            return Err(Failure::new(
                "post::no_result",
                format!("controller {} does not say where the result of axis {axis} stands", self.post.name),
            )
            .help("write it under [result] in the postprocessor file"));
        }
        for step in &self.path.steps {
            if step.touch().is_some_and(|touch| touch.id == 0) {
                return Err(Failure::new("post::touch_zero", "a touch has the number 0")
                    .help("number the touches of the plan from 1: 0 means \"all is well\" at the control"));
            }
        }
        for (n, (entry, why)) in self.post.unverified.iter().enumerate() {
            let says = format!("[{entry}] of controller {} was never tried on a real control: {why}", self.post.name);
            let finding = Finding::warning("post::unverified", says);
            // what to do is the same for all of them, and said once
            let is_last = n + 1 == self.post.unverified.len();
            let help = "run the program in the control's simulation first, and with the feed override down";
            self.findings.push(if is_last { finding.help(help) } else { finding });
        }
        Ok(())
    }

    // ------------------------------------------------------------------------------------------------- rendering

    pub(super) fn render(&mut self, template: &str, context: Value) -> Result<()> {
        let rendered = self.post.render(template, context! { ..context, ..self.common() })?;
        // the head names more of them
        let step = if template == "start" { LABELS_PER_STEP } else { self.post.labels_per_step };
        let names_one = || (self.label..self.label + step).any(|label| rendered.contains(&label.to_string()));
        if self.post.uses_labels(template) && names_one() {
            self.label += step;
            if let Some(last) = self.post.last_label.filter(|last| self.label > *last) {
                let message = format!("the program needs more labels than the {last} of controller {}", self.post.name);
                return Err(Failure::new("post::labels", message).help("split it: fewer touches in one program"));
            }
        }
        let rendered = rendered.strip_suffix('\n').unwrap_or(&rendered);
        if !rendered.is_empty() {
            self.text.push_str(rendered);
            self.text.push('\n');
        }
        Ok(())
    }

    /// What all templates are given.
    fn common(&self) -> Value {
        let next = self.next_touch();
        context! {
            label => self.label,
            next => next.id,
            next_face => self.face(&next.says),
            next_says => next.says,
            last => self.last.id,
            last_face => self.face(&self.last.says),
            last_says => self.last.says.clone(),
            first_move => !self.moving,
            ..self.of_program.clone()
        }
    }

    /// The part of it that stays as it is.
    fn of_program(&self) -> Result<Value> {
        let of_axes = |what: &dyn Fn(AxisName) -> String| map(self.axes.iter().map(|a| (a.to_string(), what(*a))));
        let names = |axes: &[AxisName]| axes.iter().map(ToString::to_string).collect::<Vec<_>>();
        let rotary: Vec<AxisName> = self.axes.iter().copied().filter(|a| a.is_rotary()).collect();
        Ok(context! {
            result => of_axes(&|a| self.result(a)),
            axes => names(&self.axes),
            rotary => names(&rotary),
            tcp => self.frame.is_tcp(),
            stops => !self.path.mounted.is_empty(),
            program => self.plan.program.clone(),
            machine => self.machine.name.clone(),
            origin => of_axes(&|a| self.post.number.position(a, self.machine.origin.get(a).unwrap_or(0.0))),
            names => of_axes(&|a| self.post.number.name(a)),
            numbers => map_of(self.axes.iter().map(|a| (a.to_string(), Value::from(self.axis_number(*a))))),
            nc_name => self.post.nc_name(&self.plan.program),
            unit => if self.post.log.unit == LengthUnit::Inch { "inch" } else { "mm" },
            touches => self.plan.touches.len(),
            find => self.plan.find.is_some(),
            find_room => self.find_room(),
            log_decimals => self.post.log.decimals,
            log_whole_places => self.post.log.whole_places,
            log_modulo => self.post.log.check_modulo.map_or_else(String::new, |m| format!("{m:.0}.")),
            seconds => self.path.seconds,
            slow_feed => self.length(self.machine.probe.slow_feed),
            log_name => self.post.log_name(self.plan)?,
            log_head => log_text::head(self.post, self.plan),
            log_end => log_text::end(self.plan),
            ..self.of_routines()?
        })
    }

    /// The number of an axis at the control.
    fn axis_number(&self, axis: AxisName) -> usize {
        let place = || self.axes.iter().position(|a| *a == axis).map_or(0, |at| at + 1);
        self.post.number.numbers.get(&axis).copied().unwrap_or_else(place)
    }

    /// Where the control keeps the result of a probing move.
    fn result(&self, axis: AxisName) -> String {
        let number = self.axis_number(axis);
        let text = self.post.result.get(&axis).map(String::as_str).unwrap_or_default();
        text.replace("{nn}", &format!("{number:02}"))
            .replace("{n}", &number.to_string())
            .replace("{name}", &self.post.number.name(axis))
    }

    /// The touch that comes next, or the last one when none does.
    pub(super) fn next_touch(&self) -> Named {
        let named = |t: &TouchStep| Named { id: t.id, says: t.says.clone() };
        let touch = |s: &'a Step| s.touch();
        let (before, after) = self.path.steps.split_at(self.index.min(self.path.steps.len()));
        after.iter().find_map(touch).or_else(|| before.iter().rev().find_map(touch)).map(named).unwrap_or_default()
    }

    fn start(&mut self) -> Result<()> {
        let setups = self.path.steps.iter().filter(|s| matches!(s, Step::Setup { .. })).count();
        let mut head = vec![format!(
            "axiscal {}: program {}, machine {}, controller {}",
            env!("CARGO_PKG_VERSION"),
            self.plan.program,
            self.machine.name,
            self.post.name
        )];
        head.extend(self.path.head.iter().cloned());
        // a setting stands there by its name: {folder}
        let place = self
            .post
            .settings
            .iter()
            .fold(self.post.log.place.clone(), |place, (name, value)| place.replace(&format!("{{{name}}}"), value));
        let name = self.post.log_name(self.plan)?;
        let folder = place.ends_with(['\\', '/']);
        head.push(if folder { format!("the log is {place}{name}") } else { format!("the log is {name} in {place}") });
        if let Some(tcp) = self.post.tcp.as_ref().filter(|_| self.frame.is_tcp()) {
            head.push(format!("{TOOL_PLACE}: needs {}", tcp.says));
            head.push("all rotary axes must stand at 0 when it starts".to_owned());
        }
        match self.post.unverified.len() {
            0 => {}
            n => head.push(format!(
                "NOT VERIFIED on a real control: {n} {}, see {}. Try the program in the control's simulation first",
                if n == 1 { "entry" } else { "entries" },
                self.notes_name()
            )),
        }
        let near = self.path.start_near.as_ref().map(|near| {
            let window = |a: &crate::machine::Axis| {
                let [low, high] = near.window(a).map(|v| self.post.number.position(a.name, self.shown(a.name, v)));
                context! { axis => a.name.to_string(), low, high }
            };
            self.machine.rotary().map(window).collect::<Vec<_>>()
        });
        let context = context! {
            head => head,
            start_near => near.unwrap_or_default(),
            setups => setups,
        };
        self.render("start", context)
    }

    fn end(&mut self) -> Result<()> {
        self.close_setup()?;
        self.render("end", context! {})
    }

    fn close_setup(&mut self) -> Result<()> {
        if let Some(label) = self.open_setup.take() {
            self.render("setup_end", context! { label => label })?;
        }
        Ok(())
    }

    // ------------------------------------------------------------------------------------------------- steps

    pub(super) fn steps(&mut self, indices: &[usize]) -> Result<()> {
        let path = self.path;
        for index in indices {
            self.index = *index;
            if let Some(step) = path.steps.get(*index) {
                self.step(step)?;
            }
        }
        Ok(())
    }

    pub(super) fn step(&mut self, step: &Step) -> Result<()> {
        match step {
            Step::Note(text) => self.render("note", context! { text => text.clone() }),
            Step::Setup { number, says, resume } => {
                self.said.clear();
                self.setup(*number, says, resume.as_deref())
            }
            Step::Stop(stop) => self.stop(stop),
            Step::OrientSpindle { deg } => {
                let angle = (deg * self.machine.tool.spindle_sense).rem_euclid(360.0);
                self.oriented = Some(angle);
                self.render("orient", context! { deg => self.number(angle) })
            }
            Step::Rapid { to } => {
                let words = self.words(&self.linear_words(to)?)?;
                let place = self.place(to)?;
                self.render("rapid", context! { to => words, place })?;
                self.moving = true;
                self.moved(to);
                Ok(())
            }
            Step::Rotary { to, sense } => self.rotary(to, sense),
            Step::Protected { to, feed } => {
                // a probing move of no length does not move and leaves the result of the one before it
                if !self.loose && self.post.number.moved(&self.at, to).is_empty() {
                    return Ok(());
                }
                let named = self.linear_words(to)?;
                let place = self.place(to)?;
                if self.is_made_by_touch(self.index) {
                    self.moved(to);
                    return Ok(());
                }
                let words = self.words(&named)?;
                let (heading, length) = self.straight(to, &named);
                let announces = self.announces();
                self.render(
                    "protected",
                    context! { to => words, place, announces, feed => self.feed(*feed)?, heading, length },
                )?;
                self.moved(to);
                Ok(())
            }
            Step::Touch(touch) | Step::Find(touch) => self.touch(touch),
            Step::Found { moves } => self.found(moves),
            Step::Shift { matrix } => {
                let rows = self.shift_rows(matrix);
                self.render("shift", context! { rows })
            }
            Step::FindEnd => self.find_end(),
            Step::Retract { to, feed } => {
                let words = self.words(&self.linear_words(to)?)?;
                let to_start = self.is_start(to);
                let place = if to_start { Value::from(()) } else { self.place(to)? };
                let context = context! {
                    to => words,
                    place,
                    to_start,
                    feed => self.feed(*feed)?,
                    approach => self.approach.clone(),
                    heading => self.heading_back.clone(),
                    way => self.way.clone(),
                    back_off => self.back_off.clone(),
                };
                self.render("retract", context)?;
                self.moved(to);
                Ok(())
            }
        }
    }

    /// Direction of a straight move, of the axes that it names, and its length; nothing where its beginning is not known.
    fn straight(&self, to: &AxisMap, named: &AxisMap) -> (Vec<Value>, String) {
        let known = !self.loose && named.iter().all(|(axis, _)| self.at.get(axis).is_some());
        let delta = self.controller(&to.or(&self.at)).xyz_mm() - self.controller(&self.at).xyz_mm();
        let length = delta.norm();
        if !known || length <= 0.0 {
            return (Vec::new(), self.length(0.0));
        }
        let of = |axis: AxisName| {
            let direction = self.number(delta[axis.index()] / length);
            let vector = self.vector(&(delta / length), axis);
            context! { axis => axis.to_string(), name => self.post.number.name(axis), direction, vector }
        };
        let way = named.iter().map(|(axis, _)| axis).filter(|a| !a.is_rotary()).map(of).collect();
        (way, self.length(length))
    }

    /// A component of a direction, for controls that take a vector of any length: all digits that the control has.
    fn vector(&self, direction: &nalgebra::Vector3<f64>, axis: AxisName) -> String {
        const LONG: f64 = 1000.0;
        let along_one_axis = direction.iter().filter(|d| **d != 0.0).count() == 1;
        self.number(direction[axis.index()] * if along_one_axis { 1.0 } else { LONG })
    }

    /// The set-up in which the block of a touch was touched before, where that is another one than the present: a run
    /// that begins behind it has not met the block yet.
    fn met_before(&mut self, touch: &TouchStep) -> Option<u32> {
        let block = self.plan.touch(touch.id)?.block.to_string();
        let before = self.touched.insert(block, self.setup)?;
        (before != self.setup && touch.search_feed > self.machine.probe.slow_feed).then_some(before)
    }

    fn moved(&mut self, to: &AxisMap) {
        self.at = to.or(&self.at);
        self.loose = false;
    }

    fn feed(&self, feed: f64) -> Result<String> {
        if feed.is_finite() && feed > 0.0 { Ok(self.length(feed)) } else { Err(self.broken(format!("feed {feed}"))) }
    }

    fn setup(&mut self, number: u32, says: &str, resume: Option<&[Step]>) -> Result<()> {
        self.close_setup()?;
        self.open_setup = Some(self.label);
        self.setup = number;
        self.render("setup", context! { number => number, says => says })?;
        let moves = self.resume(resume)?;
        let possible = moves.is_some();
        let mounted = self.mounted.clone();
        self.render("resume", context! { number, possible, moves => moves.unwrap_or_default(), mounted })
    }

    fn rotary(&mut self, to: &AxisMap, sense: &AxisMap) -> Result<()> {
        for (axis, value) in to.iter() {
            let (Some(before), Some(wanted)) = (self.at.get(axis), sense.get(axis)) else { continue };
            if (value - before) * wanted < 0.0 {
                return Err(self.broken(format!(
                    "axis {axis} is to go from {before} to {value} in the sense {wanted:+}, which is the other way"
                )));
            }
        }
        let sign = |s: f64| if s < 0.0 { "-" } else { "+" };
        let senses = map(sense.iter().map(|(a, s)| (a.to_string(), sign(s).to_owned())));
        for place in self.rotary_steps(&self.at, to)? {
            let words = self.words_by(&place, sense)?;
            let turned = self.turned(&place, sense)?;
            self.render("rotary", context! { to => words, turned, sense => senses.clone() })?;
            self.moving = true;
        }
        self.moved(to);
        self.senses = sense.or(&self.senses);
        Ok(())
    }

    fn finish(self) -> Result<NcProgram> {
        let beside = self.beside()?;
        self.post.check_block_numbers(&self.text)?;
        let text = self.post.lines(&self.text);
        let longest = text.lines().enumerate().find(|(_, line)| line.chars().count() > self.post.line_length);
        if let Some((index, line)) = longest {
            return Err(Failure::new(
                "post::line_length",
                format!(
                    "line {} of the program has {} characters, controller {} takes {}: {line}",
                    index + 1,
                    line.chars().count(),
                    self.post.name,
                    self.post.line_length
                ),
            )
            .help("shorten its template in the postprocessor file, or the names of machine, program and blocks where they stand in it; raise line_length there if your control takes longer lines"));
        }
        let text = self.post.ended(text);
        Ok(NcProgram { text, extension: self.post.extension.clone(), beside, findings: self.findings })
    }

    /// The files that the control needs beside the program.
    fn beside(&self) -> Result<Vec<SideFile>> {
        let one = |(index, says): (usize, &String)| {
            let name = self.post.render(&format!("companion {index} name"), self.common())?;
            // this program has no such file
            if name.trim().is_empty() {
                return Ok(None);
            }
            let text = self.post.render(&format!("companion {index}"), self.common())?;
            let text: String = text.lines().filter(|l| self.post.keeps(l)).flat_map(|l| [l, "\n"]).collect();
            let name = name_of(name.trim(), |c| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | '_'));
            Ok(Some(SideFile { name, says: says.clone(), text: self.post.ended(text), to_control: true }))
        };
        let companions = self.post.companions.iter().enumerate().filter_map(|c| one(c).transpose());
        companions.chain([Ok(self.notes())]).collect()
    }
}

fn map_of(pairs: impl IntoIterator<Item = (String, Value)>) -> Value {
    Value::from(pairs.into_iter().collect::<BTreeMap<_, _>>())
}

fn map(pairs: impl IntoIterator<Item = (String, String)>) -> Value {
    Value::from(pairs.into_iter().collect::<BTreeMap<_, _>>())
}

fn xyz(v: &nalgebra::Vector3<f64>) -> AxisMap {
    AxisMap::xyz(v.x, v.y, v.z)
}
