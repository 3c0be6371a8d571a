//! The study that is being worked on: one writer, steps with versions, undo and redo.
//!
//! A step is made in this order: what is asked is worked out on a copy, fitted, and only when the fit stands are the
//! files written (the effects file before the study that names it) and the copy put in the place of the old state. A
//! step that fails leaves everything as it was; a process that is killed leaves whole files of before or after the step.

use super::desk::Desk;
use super::draft::{self, Draft, Mistake};
use super::shelf::Shelf;
use super::{Opened, Place};
use crate::diag::{Failure, Result, source};
use crate::fit::Fit;
use crate::study::history::{History, Step as Rung};
use crate::study::{edit, mask};
use crate::workflow::change::Edit;
use crate::workflow::history::step_without_validation;
use std::sync::Arc;

const MOST_STEPS: usize = 500;

#[derive(Debug)]
pub enum Refused {
    /// It was asked of an older state; the number of the present one.
    Stale(u64),
    /// It cannot be done.
    Unusable(Failure),
    /// What was typed is wrong.
    Mistakes(Vec<Mistake>),
}

impl From<Failure> for Refused {
    fn from(failure: Failure) -> Self {
        Self::Unusable(failure)
    }
}

/// Contents of the files that steps change. `effects` is `None` where a step has nothing to do with that file.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Files {
    study: Vec<u8>,
    effects: Option<Option<Vec<u8>>>,
}

#[derive(Debug, Clone)]
struct Made {
    says: String,
    before: Files,
    after: Files,
}

#[derive(Debug, Clone)]
pub enum Ask {
    /// An effect into the model, or out of it.
    Switch {
        effect: String,
        on: bool,
    },
    /// Touches taken out.
    Mask {
        /// Run (from 0) and number of each.
        touches: Vec<(usize, u64)>,
        reason: String,
    },
    /// Touches taken back in.
    Unmask {
        /// Run (from 0) and number of each.
        touches: Vec<(usize, u64)>,
    },
    /// An effect of the user's own into the effects file, and into the model if so wanted.
    Save {
        draft: Box<Draft>,
        /// Into the model, too?
        on: bool,
    },
    /// Back to a model of the ladder: these effects and no others.
    Model {
        effects: Vec<String>,
    },
    Undo,
    /// The step that was taken back made again.
    Redo,
}

/// A state as others see it: nothing in it changes any more.
#[derive(Debug, Clone)]
pub struct Snapshot {
    pub version: u64,
    /// Number of the reading: touches and effects are the same while it is.
    pub inputs: u64,
    pub opened: Arc<Opened>,
    /// Its fit, without the figures that need the whole catalogue.
    pub fit: Arc<Fit>,
    /// What undo would take back.
    pub undo: Option<String>,
    /// What redo would make again.
    pub redo: Option<String>,
    /// Why the study on the disk cannot be used, where it cannot.
    pub fault: Option<Failure>,
    /// Milliseconds that the fit took; none where it was made before.
    pub fit_ms: f64,
}

pub struct Session {
    desk: Arc<Desk>,
    shelf: Arc<Shelf>,
    state: Snapshot,
    past: Vec<Made>,
    future: Vec<Made>,
    mark: u64,
    /// The ladder as it was last read or written.
    ladder: History,
}

impl Session {
    /// Opens the study.
    ///
    /// # Errors
    /// When it cannot be read or fitted.
    pub fn open(desk: Arc<Desk>) -> Result<Self> {
        let opened = desk.open()?;
        let mark = desk.mark(&opened.study);
        let shelf = Arc::new(Shelf::default());
        let (fit, fit_ms) = shelf.fit(&opened, 1, opened.quick_settings())?;
        let mut opened = opened;
        let ladder = opened.history.clone();
        opened.history.push(step_without_validation(&opened, &fit));
        let state = Snapshot {
            version: 1,
            inputs: 1,
            opened: Arc::new(opened),
            fit,
            undo: None,
            redo: None,
            fault: None,
            fit_ms,
        };
        Ok(Self { desk, shelf, state, past: Vec::new(), future: Vec::new(), mark, ladder })
    }

    /// The models that were fitted already.
    #[must_use]
    pub fn shelf(&self) -> Arc<Shelf> {
        self.shelf.clone()
    }

    #[must_use]
    pub fn snapshot(&self) -> Snapshot {
        Snapshot {
            undo: self.past.last().map(|m| m.says.clone()),
            redo: self.future.last().map(|m| m.says.clone()),
            ..self.state.clone()
        }
    }

    /// Makes a step that was asked of state `version`.
    ///
    /// # Errors
    /// When that is not the present state, or the step cannot be made; nothing has changed then.
    pub fn step(&mut self, version: u64, ask: Ask) -> std::result::Result<Snapshot, Refused> {
        self.follow();
        if version != self.state.version {
            return Err(Refused::Stale(self.state.version));
        }
        if let Some(fault) = &self.state.fault {
            return Err(Refused::Unusable(fault.clone()));
        }
        match ask {
            Ask::Undo => self.turn_back()?,
            Ask::Redo => self.turn_forward()?,
            Ask::Save { draft, on } => self.save(&draft, on)?,
            Ask::Switch { .. } | Ask::Mask { .. } | Ask::Unmask { .. } | Ask::Model { .. } => {
                let (text, says) = self.edited(&ask)?;
                let after = Files { study: self.state.opened.with_text(&text)?.bytes, effects: None };
                self.make(says, after)?;
            }
        }
        Ok(self.snapshot())
    }

    /// Looks at the disk: has somebody else changed the study? True when the state has changed.
    pub fn follow(&mut self) -> bool {
        let mark = self.desk.mark(&self.state.opened.study);
        if mark == self.mark {
            return false;
        }
        self.mark = mark;
        let read = self.read_anew();
        self.state.version += 1;
        match read {
            Ok((mut opened, fit, fit_ms)) => {
                self.state.fault = None;
                // the files may name others than before
                self.mark = self.desk.mark(&opened.study);
                if opened.bytes != self.state.opened.bytes {
                    let made = Made {
                        says: "change of the study's file".into(),
                        before: Files { study: self.state.opened.bytes.clone(), effects: None },
                        after: Files { study: opened.bytes.clone(), effects: None },
                    };
                    self.remember(made);
                }
                self.ladder = opened.history.clone();
                opened.history.push(step_without_validation(&opened, &fit));
                self.state.inputs += 1;
                self.state.opened = Arc::new(opened);
                self.state.fit = fit;
                self.state.fit_ms = fit_ms;
            }
            Err(failure) => self.state.fault = Some(failure),
        }
        true
    }

    /// Puts the errors on touches left out (by index visit, and of the last run) into the ladder, once they are known.
    pub fn enter_held_out(&mut self, version: u64, by_visit: Option<f64>, later_run: Option<f64>) {
        if version != self.state.version || self.state.fault.is_some() {
            return;
        }
        let mut opened = Opened::clone(&self.state.opened);
        let step = Rung {
            held_out_rms_um: by_visit,
            later_run_rms_um: later_run,
            ..step_without_validation(&opened, &self.state.fit)
        };
        opened.history.push(step);
        self.state.opened = Arc::new(opened);
        self.write_ladder(version);
    }

    /// Writes the ladder beside the study. Not within a step, whose answer need not wait for it: a ladder that lacks its
    /// last model is no damage, and the next one puts it there.
    pub fn write_ladder(&mut self, version: u64) {
        // who only looks leaves no file
        if version != self.state.version || version == 1 || self.state.fault.is_some() {
            return;
        }
        // one that cannot be written is no reason to stop
        let _ = self.merge_ladder();
    }

    /// Puts the models that were tried here behind those that others have written meanwhile.
    fn merge_ladder(&mut self) -> Result<()> {
        let _alone = self.desk.alone()?;
        let there = match self.desk.read(Place::History)? {
            Some(bytes) => {
                let text = String::from_utf8_lossy(&bytes).into_owned();
                History::parse(&source("the history of the study", text))?
            }
            None => History::default(),
        };
        let own = &self.state.opened.history;
        let merged = if there == self.ladder { own.clone() } else { there.followed_by(own, &self.ladder) };
        self.desk.write(Place::History, Some(merged.to_json()?.as_bytes()))?;
        let mut opened = Opened::clone(&self.state.opened);
        opened.history.clone_from(&merged);
        self.state.opened = Arc::new(opened);
        self.ladder = merged;
        Ok(())
    }

    /// The text of the study with what is asked for, and what that is in words.
    fn edited(&self, ask: &Ask) -> Result<(String, String)> {
        let text = self.state.opened.text();
        let opened = &self.state.opened;
        let count = |n: usize| if n == 1 { "1 touch".to_owned() } else { format!("{n} touches") };
        let name =
            |id: &String| opened.catalogue.get(id, &opened.machine).map_or_else(|| id.clone(), |e| e.name.clone());
        match ask {
            Ask::Switch { effect, on: true } => {
                Ok((Edit::Add(std::slice::from_ref(effect)).text(opened)?, format!("{} added", name(effect))))
            }
            Ask::Switch { effect, on: false } => {
                Ok((Edit::Remove(std::slice::from_ref(effect)).text(opened)?, format!("{} removed", name(effect))))
            }
            Ask::Model { effects } => {
                let says = format!("back to an earlier model with {} effects", effects.len());
                Ok((Edit::Become(effects).text(opened)?, says))
            }
            Ask::Mask { touches, reason } => {
                every_touch_exists(opened, touches)?;
                some_are_left(opened, touches)?;
                Ok((
                    mask::mask(&text, touches, reason)?,
                    format!("{} excluded: {}", count(touches.len()), reason.trim()),
                ))
            }
            Ask::Unmask { touches } => {
                Ok((mask::unmask(&text, touches)?, format!("{} taken back", count(touches.len()))))
            }
            Ask::Save { .. } | Ask::Undo | Ask::Redo => {
                Err(Failure::new("workbench::step", "this step is no edit of the study"))
            }
        }
    }

    /// Writes the effect into the user's file and names that file in the study.
    fn save(&mut self, draft: &Draft, on: bool) -> std::result::Result<(), Refused> {
        let opened = &self.state.opened;
        let typed = draft::check(draft, &opened.catalogue, &opened.study.effects).map_err(Refused::Mistakes)?;
        let file = Desk::effects_file(&opened.study);
        let before = self.desk.read(Place::Effects)?;
        let old = String::from_utf8(before.clone().unwrap_or_default())
            .map_err(|_| Failure::new("workbench::effects", format!("{file} is not text")).help("save it as UTF-8"))?;
        let new = if typed.replaces {
            draft::replaced(&old, draft).ok_or_else(|| Refused::Mistakes(vec![draft::elsewhere(draft, &file)]))?
        } else {
            draft::appended(&old, draft)
        };
        // the file as a whole must be readable, or the study that names it is not
        crate::model::catalogue::Catalogue::built_in()?.add_file(&source(&file, new.clone()))?;
        let mut text = mask::name_effects_file(&opened.text(), &file)?;
        if on {
            text = edit::add(&text, std::slice::from_ref(&draft.id))?;
        }
        let after = Files { study: self.state.opened.with_text(&text)?.bytes, effects: Some(Some(new.into_bytes())) };
        let before = Files { study: opened.bytes.clone(), effects: Some(before) };
        let says = format!("{} saved in {file}{}", draft.id, if on { " and added" } else { "" });
        let made = Made { says, before, after };
        self.put(&made.before, &made.after)?;
        self.remember(made);
        Ok(())
    }

    fn make(&mut self, says: String, after: Files) -> Result<()> {
        let before = Files { study: self.state.opened.bytes.clone(), effects: None };
        if before == after {
            return Ok(());
        }
        self.put(&before, &after)?;
        self.remember(Made { says, before, after });
        Ok(())
    }

    fn remember(&mut self, made: Made) {
        self.future.clear();
        self.past.push(made);
        if self.past.len() > MOST_STEPS {
            self.past.remove(0);
        }
    }

    fn turn_back(&mut self) -> Result<()> {
        let Some(made) = self.past.last().cloned() else {
            return Err(Failure::new("workbench::undo", "there is nothing to undo"));
        };
        self.put(&made.after, &made.before)?;
        self.past.pop();
        self.future.push(made);
        Ok(())
    }

    fn turn_forward(&mut self) -> Result<()> {
        let Some(made) = self.future.last().cloned() else {
            return Err(Failure::new("workbench::redo", "there is nothing to make again"));
        };
        self.put(&made.before, &made.after)?;
        self.future.pop();
        self.past.push(made);
        Ok(())
    }

    /// Puts files in the place of those that are there, and the state that belongs to them in the place of the old one.
    fn put(&mut self, from: &Files, to: &Files) -> Result<()> {
        // from what is compared to what is written nobody else changes the study
        let _alone = self.desk.alone()?;
        let changed = || {
            Failure::new("workbench::changed", "a file of the study was changed meanwhile")
                .help("nothing was written: look at the new state and try again")
        };
        if self.desk.read(Place::Study)?.as_deref() != Some(&from.study[..]) {
            return Err(changed());
        }
        if let Some(effects) = &from.effects
            && self.desk.read(Place::Effects)? != *effects
        {
            return Err(changed());
        }
        let effects_change = to.effects.as_ref().filter(|_| to.effects != from.effects);
        let mut opened = Opened::clone(&self.state.opened);
        opened.loaded = opened.with_bytes(to.study.clone())?;
        let same_inputs = opened.study.data == self.state.opened.study.data
            && opened.study.machine == self.state.opened.study.machine
            && opened.study.machines == self.state.opened.study.machines
            && opened.study.effects_files == self.state.opened.study.effects_files
            && effects_change.is_none();
        let putting = Putting { desk: &self.desk, from, to, effects: effects_change };
        let (fit, fit_ms) = if same_inputs {
            let fitted = self.shelf.fit(&opened, self.state.inputs, opened.quick_settings())?;
            putting.write()?;
            fitted
        } else {
            // what the study names is read anew from the disk; where that fails everything is put back
            putting.write()?;
            let history = opened.history.clone();
            match self.read_anew() {
                Ok((read, fit, ms)) => {
                    opened = Opened { history, ..read };
                    (fit, ms)
                }
                Err(failure) => {
                    putting.undo()?;
                    return Err(failure);
                }
            }
        };
        opened.history.push(step_without_validation(&opened, &fit));
        self.mark = self.desk.mark(&opened.study);
        self.state = Snapshot {
            version: self.state.version + 1,
            inputs: self.state.inputs + u64::from(!same_inputs),
            opened: Arc::new(opened),
            fit,
            undo: None,
            redo: None,
            fault: None,
            fit_ms,
        };
        Ok(())
    }

    /// The study as it lies on the disk, with its fit.
    fn read_anew(&self) -> Result<(Opened, Arc<Fit>, f64)> {
        let opened = self.desk.open()?;
        let (fit, ms) = self.shelf.fit(&opened, self.state.inputs + 1, opened.quick_settings())?;
        Ok((opened, fit, ms))
    }
}

/// Files on their way to the disk, in an order in which the study never names what is not there.
struct Putting<'a> {
    desk: &'a Desk,
    from: &'a Files,
    to: &'a Files,
    effects: Option<&'a Option<Vec<u8>>>,
}

impl Putting<'_> {
    fn write(&self) -> Result<()> {
        self.in_order(self.to, self.effects.map(Option::as_deref))
    }

    fn undo(&self) -> Result<()> {
        let effects = self.effects.and(self.from.effects.as_ref());
        self.in_order(self.from, effects.map(Option::as_deref))
    }

    fn in_order(&self, files: &Files, effects: Option<Option<&[u8]>>) -> Result<()> {
        match effects {
            // a longer file goes before the study that uses it, a shorter one behind the study that no longer does
            Some(Some(bytes)) if bytes.len() >= self.size_there() => {
                self.desk.write(Place::Effects, Some(bytes))?;
                self.desk.write(Place::Study, Some(&files.study))
            }
            Some(effects) => {
                self.desk.write(Place::Study, Some(&files.study))?;
                self.desk.write(Place::Effects, effects)
            }
            None => self.desk.write(Place::Study, Some(&files.study)),
        }
    }

    fn size_there(&self) -> usize {
        self.desk.read(Place::Effects).ok().flatten().map_or(0, |b| b.len())
    }
}

/// Without any touch a fit says that everything is zero.
fn some_are_left(opened: &Opened, touches: &[(usize, u64)]) -> Result<()> {
    let out: std::collections::HashSet<(usize, u64)> =
        touches.iter().copied().chain(opened.study.masked.iter().map(|m| (m.run, m.id))).collect();
    if opened.data.observations.iter().any(|o| !out.contains(&(o.run, o.id))) {
        return Ok(());
    }
    Err(Failure::new("workbench::all_touches", "these are all the touches that there are")
        .help("a fit needs touches: exclude only those with which something was wrong"))
}

fn every_touch_exists(opened: &Opened, touches: &[(usize, u64)]) -> Result<()> {
    if touches.is_empty() {
        return Err(Failure::new("workbench::no_touches", "no touch is chosen")
            .help("choose touches in a plot or in the table"));
    }
    let known: std::collections::HashSet<(usize, u64)> =
        opened.data.observations.iter().map(|o| (o.run, o.id)).collect();
    match touches.iter().find(|t| !known.contains(t)) {
        None => Ok(()),
        Some((run, id)) => {
            Err(Failure::new("workbench::no_touch", format!("there is no touch {id} in run {}", run.saturating_add(1)))
                .help("touches without a reading are not used anyway"))
        }
    }
}
