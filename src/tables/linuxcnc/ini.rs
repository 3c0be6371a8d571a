//! The machine's INI file, read for what a compensation touches: which joint moves which axis, and the old values.
//!
//! Not a checker of INI files: what the export does not touch is not looked at. What says which joint is which axis is: the
//! letters, the count of joints and their types must agree, or a value would go to another joint.

use super::component::coordinates;
use crate::axes::AxisName;
use crate::diag::{Failure, Finding, Findings, Result, Source};
use crate::machine::Machine;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// A home offset beyond this is a typing error: no axis of a machine is so long, mm, inch or deg.
const FARTHEST_HOME: f64 = 1e5;

/// What is read from an INI file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct UserIni {
    /// Its name, for messages.
    pub name: String,
    /// `[KINS] KINEMATICS`, as it stands.
    pub kinematics: Option<String>,
    /// `[KINS] JOINTS`, as it stands.
    pub joints: Option<String>,
    /// Letters in the order of the joints.
    pub letters: Vec<char>,
    /// 25.4 where `[TRAJ] LINEAR_UNITS` is inch, else 1.
    pub mm_per_unit: f64,
    /// `[JOINT_n] HOME_OFFSET`, deg or machine units.
    pub home_offset: BTreeMap<usize, f64>,
    /// `[JOINT_n] COMP_FILE` and `COMP_FILE_TYPE`, as they stand.
    pub comp_file: BTreeMap<usize, (String, String)>,
    /// `[JOINT_n] BACKLASH` other than 0.
    pub backlash: BTreeMap<usize, f64>,
}

/// Numbers of the joints that move an axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Joints {
    letters: Vec<char>,
}

impl Joints {
    /// From the INI, or LinuxCNC's standard order X Y Z A B C of the machine's axes.
    ///
    /// # Errors
    /// When the INI lacks one of the machine's axes.
    pub fn for_machine(machine: &Machine, ini: Option<&UserIni>) -> Result<Self> {
        let letters: Vec<char> = match ini {
            Some(ini) => ini.letters.clone(),
            None => coordinates(machine).chars().collect(),
        };
        let missing: Vec<String> =
            machine.axes.iter().filter(|a| !letters.contains(&a.name.letter())).map(|a| a.name.to_string()).collect();
        if !missing.is_empty() {
            let name = ini.map_or("", |i| i.name.as_str());
            return Err(Failure::new(
                "ini::axis_missing",
                format!("{name}: no joint moves axis {} of machine {:?}", missing.join(", "), machine.name),
            )
            .help("[TRAJ] COORDINATES (or coordinates= in [KINS] KINEMATICS) must hold every axis of the machine"));
        }
        Ok(Self { letters })
    }

    /// The joints of an axis; two of them on an axis with two motors.
    #[must_use]
    pub fn numbers(&self, axis: AxisName) -> Vec<usize> {
        let matches = |(n, letter): (usize, &char)| (*letter == axis.letter()).then_some(n);
        self.letters.iter().enumerate().filter_map(matches).collect()
    }

    /// Their letters in order, as `coordinates=` takes them.
    #[must_use]
    pub fn coordinates(&self) -> String {
        self.letters.iter().collect()
    }

    /// How many there are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.letters.len()
    }
}

impl UserIni {
    /// Reads an INI file.
    ///
    /// # Errors
    /// When a line that matters cannot be read, each with its place.
    pub fn read(source: &Source) -> Result<Self> {
        let mut ini = Self { name: source.name().to_owned(), mm_per_unit: 1.0, ..Self::default() };
        let mut findings = Findings::default();
        let mut section = String::new();
        let mut traj = String::new();
        let mut joints_at = 0..0;
        let mut types: BTreeMap<usize, (String, Range<usize>)> = BTreeMap::new();
        // LinuxCNC uses the first line of a value: a second one shows that the file is not what its author meant
        let mut seen: BTreeMap<(usize, String), usize> = BTreeMap::new();
        let (mut start, mut number) = (0, 0);
        for line in source.inner().split_inclusive('\n') {
            let span = start..start + line.trim_end().len();
            start += line.len();
            number += 1;
            let text = line.trim();
            if text.starts_with("#INCLUDE") {
                let says = format!("{text:?}: what stands in that file is not read");
                findings.push(
                    Finding::error("ini::include", says)
                        .help(
                            "LinuxCNC writes the whole file beside it at each start (NAME.ini.expanded): give that one",
                        )
                        .at(source, span),
                );
                continue;
            }
            if text.is_empty() || text.starts_with(['#', ';']) {
                continue;
            }
            if let Some(name) = text.strip_prefix('[') {
                section = name.split(']').next().unwrap_or_default().trim().to_owned();
                continue;
            }
            let Some((key, value)) = text.split_once('=') else { continue };
            let (key, value) = (key.trim(), without_comment(value));
            let mut wrong = |message: String, help: &str| {
                findings.push(Finding::error("ini::value", message).help(help).at(source, span.clone()));
            };
            match (section.as_str(), key) {
                // the first one counts, as in LinuxCNC
                ("KINS", "KINEMATICS") if ini.kinematics.is_none() => ini.kinematics = Some(value.to_owned()),
                ("KINS", "JOINTS") if ini.joints.is_none() => {
                    (ini.joints, joints_at) = (Some(value.to_owned()), span.clone());
                }
                ("TRAJ", "COORDINATES") if traj.is_empty() => value.clone_into(&mut traj),
                ("TRAJ", "LINEAR_UNITS") => match value.to_ascii_lowercase().as_str() {
                    "mm" | "metric" => ini.mm_per_unit = 1.0,
                    "inch" | "in" | "imperial" => ini.mm_per_unit = crate::units::mm_from_inch(1.0),
                    _ => wrong(format!("LINEAR_UNITS is {value:?}"), "write mm or inch"),
                },
                ("TRAJ", "ANGULAR_UNITS")
                    if !matches!(value.to_ascii_lowercase().as_str(), "deg" | "degree" | "degrees") =>
                {
                    wrong(format!("ANGULAR_UNITS is {value:?}"), "only degree is written: the values would be wrong");
                }
                (joint, "TYPE") => {
                    let Some(n) = joint.strip_prefix("JOINT_").and_then(|n| n.parse::<usize>().ok()) else { continue };
                    // the first one counts
                    types.entry(n).or_insert_with(|| (value.to_ascii_uppercase(), span.clone()));
                }
                (joint, "HOME_OFFSET" | "BACKLASH" | "COMP_FILE" | "COMP_FILE_TYPE") => {
                    let Some(n) = joint.strip_prefix("JOINT_").and_then(|n| n.parse::<usize>().ok()) else { continue };
                    if let Some(first) = seen.get(&(n, key.to_owned())) {
                        wrong(
                            format!("[{joint}] {key} stands twice, first in line {first}"),
                            "LinuxCNC takes the first: take the other one away",
                        );
                    } else if !ini.joint(n, key, value) {
                        wrong(
                            format!("[{joint}] {key} is {value:?}, expected a number up to {FARTHEST_HOME}"),
                            "LinuxCNC itself reads what is no number as 0",
                        );
                    }
                    seen.entry((n, key.to_owned())).or_insert(number);
                }
                _ => {}
            }
        }
        let named = ini
            .kinematics
            .as_deref()
            .and_then(|k| k.split_whitespace().find_map(|word| word.strip_prefix("coordinates=")).map(str::to_owned));
        let letters = |text: &str| -> Vec<char> {
            text.chars().filter(|c| !c.is_whitespace()).map(|c| c.to_ascii_uppercase()).collect()
        };
        ini.letters = letters(named.as_deref().unwrap_or(&traj));
        let of_traj = letters(&traj);
        if named.is_some() && !of_traj.is_empty() && set(&of_traj) != set(&ini.letters) {
            let says = format!(
                "{}: coordinates= of [KINS] KINEMATICS has the axes {}, [TRAJ] COORDINATES has {}",
                ini.name,
                String::from_iter(&ini.letters),
                String::from_iter(&of_traj)
            );
            findings.push(Finding::error("ini::coordinates", says).help(AGREE));
        }
        ini.agrees(source, &joints_at, &types, &mut findings);
        if ini.letters.is_empty() {
            findings.push(
                Finding::error("ini::no_coordinates", format!("{}: no axis letters", ini.name))
                    .help("is this the INI file of the machine? it needs [TRAJ] COORDINATES"),
            );
        }
        Ok(findings.finish(ini)?.0)
    }

    /// Count and types of the joints against the letters.
    fn agrees(
        &self,
        source: &Source,
        joints_at: &Range<usize>,
        types: &BTreeMap<usize, (String, Range<usize>)>,
        findings: &mut Findings,
    ) {
        if self.letters.is_empty() {
            return;
        }
        let count = self.letters.len();
        if let Some(joints) = self.joints.as_ref().filter(|j| j.parse::<usize>() != Ok(count)) {
            let says = format!(
                "[KINS] JOINTS is {joints}, but the letters {} name {count} joints",
                String::from_iter(&self.letters)
            );
            findings.push(Finding::error("ini::joints", says).help(AGREE).at(source, joints_at.clone()));
        }
        for (n, (kind, span)) in types {
            let Some(letter) = self.letters.get(*n) else { continue };
            let expected = if "ABC".contains(*letter) { "ANGULAR" } else { "LINEAR" };
            if kind != expected {
                let says =
                    format!("[JOINT_{n}] TYPE is {kind}, but joint {n} moves axis {letter}, which is {expected}");
                findings.push(Finding::error("ini::joint_type", says).help(AGREE).at(source, span.clone()));
            }
        }
    }

    /// Takes a value of a joint; false when it is not a number where one is needed.
    fn joint(&mut self, n: usize, key: &str, value: &str) -> bool {
        let number = value.parse::<f64>().ok().filter(|v| v.abs() <= FARTHEST_HOME);
        match key {
            "HOME_OFFSET" => number.is_some_and(|v| {
                self.home_offset.insert(n, v);
                true
            }),
            "BACKLASH" => number.is_some_and(|v| {
                if v != 0.0 {
                    self.backlash.insert(n, v);
                }
                true
            }),
            "COMP_FILE" => {
                value.clone_into(&mut self.comp_file.entry(n).or_default().0);
                true
            }
            _ => {
                value.clone_into(&mut self.comp_file.entry(n).or_default().1);
                true
            }
        }
    }
}

/// What to do where the INI contradicts itself.
const AGREE: &str = "give the INI file with which the machine runs: the joints are counted from 0 in the order of the letters \
                     (coordinates= in [KINS] KINEMATICS, else [TRAJ] COORDINATES), JOINTS is their count, A B C are ANGULAR";

fn set(letters: &[char]) -> BTreeSet<char> {
    letters.iter().copied().collect()
}

/// A value without a trailing comment: `#` or `;` after a blank.
fn without_comment(value: &str) -> &str {
    let cut = value
        .char_indices()
        .zip(value.chars().skip(1))
        .find(|((_, before), c)| before.is_whitespace() && matches!(c, '#' | ';'))
        .map_or(value.len(), |((at, _), _)| at);
    value[..cut].trim()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diag::source;

    #[test]
    fn the_values_that_matter_are_read() {
        let text = "[KINS]\r\nKINEMATICS = trivkins coordinates=xyyzbc\nJOINTS=6 # six\n[TRAJ]\nCOORDINATES = X Y Z B C\n\
                    LINEAR_UNITS = inch\n[JOINT_4]\nHOME_OFFSET = -1.5 ; B\nCOMP_FILE = b.comp\nCOMP_FILE_TYPE = 1\n\
                    [HAL]\nHALFILE = x.hal\nHALFILE = y.hal\n";
        let ini = UserIni::read(&source("m.ini", text)).unwrap();
        assert_eq!(ini.kinematics.as_deref(), Some("trivkins coordinates=xyyzbc"));
        assert_eq!(ini.joints.as_deref(), Some("6"));
        assert_eq!(ini.letters, ['X', 'Y', 'Y', 'Z', 'B', 'C']);
        assert_eq!(ini.mm_per_unit, 25.4);
        assert_eq!(ini.home_offset[&4], -1.5);
        assert_eq!(ini.comp_file[&4], ("b.comp".to_owned(), "1".to_owned()));
        let joints = Joints { letters: ini.letters };
        assert_eq!(joints.numbers(AxisName::Y), [1, 2]);
    }

    /// Which joint is which axis must be said once: what contradicts itself is refused, each with its place.
    #[test]
    fn count_letters_and_types_agree() {
        let good = "[KINS]\nKINEMATICS = xyzac-trt-kins\nJOINTS = 5\n[TRAJ]\nCOORDINATES = XYZAC\n[JOINT_2]\nTYPE = LINEAR\n\
                    [JOINT_3]\nTYPE = ANGULAR\n[JOINT_4]\nTYPE = angular\n[JOINT_9]\nTYPE = LINEAR\n";
        let codes = |from: &str, to: &str| -> Vec<String> {
            assert!(good.contains(from));
            let text = good.replacen(from, to, 1);
            match UserIni::read(&source("m.ini", text)) {
                Ok(_) => Vec::new(),
                Err(failure) => {
                    failure.0.iter().map(|f| format!("{} {}", f.code, f.place().unwrap_or_default())).collect()
                }
            }
        };
        assert!(codes("JOINTS = 5", "JOINTS = 5").is_empty());
        assert!(codes("JOINTS = 5\n", "").is_empty(), "what is not said contradicts nothing");
        assert_eq!(codes("JOINTS = 5", "JOINTS = 6"), ["ini::joints m.ini:3:1"]);
        assert_eq!(codes("JOINTS = 5", "JOINTS = five"), ["ini::joints m.ini:3:1"]);
        assert_eq!(codes("TYPE = ANGULAR", "TYPE = LINEAR"), ["ini::joint_type m.ini:9:1"]);
        assert_eq!(codes("TYPE = LINEAR", "TYPE = ANGULAR"), ["ini::joint_type m.ini:7:1"]);
        assert_eq!(codes("XYZAC", "XYZCA").len(), 0);
        assert_eq!(codes("trt-kins", "trt-kins coordinates=XYZBC"), ["ini::coordinates "]);
        assert!(codes("trt-kins", "trt-kins coordinates=xyzac").is_empty());
        assert_eq!(codes("XYZAC", "XYZAAC"), ["ini::joints m.ini:3:1"]);
    }

    /// What LinuxCNC would read otherwise than this program is refused.
    #[test]
    fn what_would_be_read_otherwise_is_refused() {
        let of = |more: &str| {
            let text = format!("[TRAJ]\nCOORDINATES = XYZBC\n{more}");
            UserIni::read(&source("m.ini", text)).map_err(|f| (f.0[0].code, f.0[0].place().unwrap_or_default()))
        };
        let place = |line: usize| format!("m.ini:{line}:1");
        assert!(of("[JOINT_3]\nHOME_OFFSET = 12\n[JOINT_4]\nHOME_OFFSET = 1\n").is_ok());
        assert!(of("ANGULAR_UNITS = degree\n").is_ok());
        for (more, code, line) in [
            ("[JOINT_3]\nHOME_OFFSET = 1e308\n", "ini::value", 4),
            ("[JOINT_3]\nHOME_OFFSET = 12\nHOME_OFFSET = 14\n", "ini::value", 5),
            ("[JOINT_3]\nHOME_OFFSET = 12\n[JOINT_4]\n[JOINT_3]\nHOME_OFFSET = 14\n", "ini::value", 7),
            ("#INCLUDE j3.inc\n", "ini::include", 3),
            ("ANGULAR_UNITS = radian\n", "ini::value", 3),
        ] {
            assert_eq!(of(more), Err((code, place(line))), "{more}");
        }
    }

    #[test]
    fn a_bad_value_has_its_place() {
        let bad = UserIni::read(&source("m.ini", "[TRAJ]\nCOORDINATES = XYZBC\n[JOINT_3]\nHOME_OFFSET = x\n"));
        assert!(bad.unwrap_err().to_string().starts_with("m.ini:4:1: "));
        let none = UserIni::read(&source("m.ini", "hello"));
        assert_eq!(none.unwrap_err().0[0].code, "ini::no_coordinates");
    }
}
