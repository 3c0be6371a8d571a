//! Programs that somebody edited: what is done to them, and what "moves identically" means when it is looked at from
//! outside.

use axiscal::check::{Against, Checked, check};
use axiscal::diag::{Failure, Severity, Source, source};
use axiscal::machine::{self, Machine};
use axiscal::post::{NcProgram, Postprocessor};
use axiscal::program::plan::Plan;
use axiscal::program::{self, Options};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// Begins the line between two files of a program.
const FILE: &str = "@@ ";

/// A program with those that it calls, as one text: what is edited may be in any of them.
pub fn whole(nc: &NcProgram) -> String {
    let called = nc.beside.iter().filter(|f| is_program(&f.name));
    called.fold(nc.text.clone(), |text, f| format!("{text}{FILE}{}\n{}", f.name, f.text))
}

fn is_program(name: &str) -> bool {
    name.ends_with(".nc") || name.ends_with(".spf")
}

/// The program itself, and all that lies beside it. `beside`: as it was generated.
pub fn parted(text: &str, beside: &[(String, Source)]) -> (String, Vec<(String, Source)>) {
    let mut parts: Vec<(String, String)> = vec![(String::new(), String::new())];
    for line in text.split_inclusive('\n') {
        match line.strip_prefix(FILE) {
            Some(name) => parts.push((name.trim().to_owned(), String::new())),
            None => parts.last_mut().unwrap().1.push_str(line),
        }
    }
    let called = parts.split_off(1).into_iter().map(|(name, text)| (name.clone(), source(name, text)));
    let others = beside.iter().filter(|(name, _)| !is_program(name)).cloned();
    (parts.remove(0).1, called.chain(others).collect())
}

/// A program as it was generated.
pub struct Original {
    pub machine: Machine,
    pub post: Postprocessor,
    pub plan: Plan,
    pub text: String,
    pub beside: Vec<(String, Source)>,
    pub steps_sha256: String,
}

/// A program of a few touches of one block at two angles: all kinds of moves, small enough for thousands of edits.
pub const SMALL: &str = r#"
format = "axiscal-programs/1"
name = "small"
machine = "swivel-head"
says = "a few touches"
mounting = "head"
faces_in = "machine"

[[grid]]
name = "one"
u = [0.0]
v = [0.0]

[[grid]]
name = "side"
u = [0.0]
depth = [3.5]

[[stage]]
name = "small"

[[stage.setup]]
pose = { B = 0.0 }
blocks = ["x-"]
touch = [{ faces = ["+Z"], grid = "one" }, { faces = ["-X"], grid = "side" }]

[[stage.setup]]
pose = { B = -30.0, C = 90.0 }
from = { B = 1 }
blocks = ["x-"]
touch = [{ faces = ["+Z"], grid = "one" }]
"#;

/// The small program for a control, or a built-in one.
pub fn original(controller: &str, built_in: Option<&str>) -> Original {
    of(Postprocessor::load_built_in_or_file(controller).unwrap().0, built_in)
}

/// The same for a control of one's own.
pub fn of(post: Postprocessor, built_in: Option<&str>) -> Original {
    let controller = &post.name;
    let (machines, _) = machine::load(&source("machines", machine::BUILT_IN)).unwrap();
    let machine = machines.into_iter().find(|m| m.name == "swivel-head").unwrap();
    let spec = match built_in {
        Some(name) => program::choose(program::built_in().unwrap(), name, &machine).unwrap(),
        None => program::load(&source("small.toml", SMALL)).unwrap().0,
    };
    let (generated, _) = program::generate(&machine, &spec, &Options::default()).unwrap();
    let mut plan = generated.plan;
    let nc = post.program(&machine, &plan, &generated.path).unwrap();
    let (beside, text) = (nc.sources(), whole(&nc));
    let against = Against { plan: Some(&plan), beside: &beside, ..Against::default() };
    let checked = check(&machine, &post, &source("original", nc.text.as_str()), &against).unwrap();
    let wrong: Vec<String> = checked.findings.iter().map(ToString::to_string).collect();
    assert!(wrong.is_empty(), "{controller}: {wrong:#?}");
    assert_eq!(checked.touches, plan.touches.len());
    let steps_sha256 = checked.proof.steps_sha256.clone();
    assert!(!steps_sha256.is_empty());
    plan.programs.insert(post.name.clone(), checked.proof);
    Original { machine, post, plan, text, beside, steps_sha256 }
}

/// What became of an edited program.
#[derive(Debug, Clone, PartialEq)]
pub enum Fate {
    /// Not of the grammar.
    NotRead,
    /// Refused by what it does.
    Refused,
    /// Refused only because it is not what was written.
    Unproven,
    /// It moves identically: it is the same statements.
    Same,
    /// It passes with a remark that names what was put in.
    Remarked,
    /// Neither refused nor the same, and nothing is said: what must not be.
    Escaped,
}

impl Original {
    /// Looks at an edited text.
    pub fn fate(&self, text: &str) -> Fate {
        match self.checked(text) {
            Err(_) => Fate::NotRead,
            Ok(checked) => {
                let errors: Vec<&str> =
                    checked.findings.iter().filter(|f| f.severity == Severity::Error).map(|f| f.code).collect();
                if errors.is_empty() {
                    let remarked = checked.findings.iter().any(|f| f.code == "check::edited");
                    return match checked.proof.steps_sha256 == self.steps_sha256 {
                        true => Fate::Same,
                        false if remarked => Fate::Remarked,
                        false => Fate::Escaped,
                    };
                }
                if errors.iter().all(|c| *c == "check::changed") { Fate::Unproven } else { Fate::Refused }
            }
        }
    }

    /// An edited text, checked.
    pub fn checked(&self, text: &str) -> Result<Checked, Failure> {
        self.checked_from(text, 0)
    }

    fn checked_from(&self, text: &str, from: u32) -> Result<Checked, Failure> {
        let (program, beside) = parted(text, &self.beside);
        let against = Against { plan: Some(&self.plan), beside: &beside, from, ..Against::default() };
        check(&self.machine, &self.post, &source("edited", program), &against)
    }

    /// Findings of an edited text, by code.
    #[allow(dead_code)] // the example does not ask for it
    pub fn codes(&self, text: &str) -> Vec<&'static str> {
        match self.checked(text) {
            Err(failure) => failure.0.iter().map(|f| f.code).collect(),
            Ok(checked) => checked.findings.iter().map(|f| f.code).collect(),
        }
    }

    /// What is said of an edited text.
    #[allow(dead_code)] // the example does not ask for it
    pub fn says(&self, text: &str) -> Vec<String> {
        let findings = match self.checked(text) {
            Err(failure) => failure.0,
            Ok(checked) => checked.findings,
        };
        findings.into_iter().map(|f| f.message).collect()
    }

    /// What an edited text is refused as changed for, or else its first finding: code, line from 1, what it says.
    #[allow(dead_code)] // the example does not ask for it
    pub fn finding(&self, text: &str) -> (&'static str, usize, String) {
        let findings = match self.checked(text) {
            Err(failure) => failure.0,
            Ok(checked) => checked.findings,
        };
        let changed = findings.iter().find(|f| f.code == "check::changed");
        let finding = changed.or(findings.first()).expect("nothing is found");
        let place = finding.place().unwrap_or_default();
        let mut parts = place.split(':');
        let file = parts.next().unwrap_or_default();
        let line = parts.next().and_then(|n| n.parse::<usize>().ok()).unwrap_or(0);
        // of the whole text: behind the line with the name of the file
        let before = text.lines().position(|l| l.strip_prefix(FILE).is_some_and(|name| name == file));
        (finding.code, line + before.map_or(0, |n| n + 1), finding.message.clone())
    }

    /// A text that is meant to begin at a set-up, checked; and whether it says that there is no such set-up.
    #[allow(dead_code)] // the example does not ask for it
    pub fn begun(&self, text: &str, from: u32) -> (axiscal::check::Checked, bool) {
        let checked = self.checked_from(text, from).unwrap();
        let no_setup = checked.findings.iter().any(|f| f.code == "check::no_setup");
        (checked, no_setup)
    }

    /// The text without its block numbers, where it has any.
    pub fn without_numbers(&self) -> String {
        if self.post.block_numbers.is_none() {
            return self.text.clone();
        }
        self.text.split_inclusive('\n').map(|l| l.split_once(' ').unwrap().1).collect()
    }

    /// A text with block numbers, where the control has any.
    pub fn numbered(&self, text: &str) -> String {
        let Some(rule) = &self.post.block_numbers else { return text.to_owned() };
        let number = |n: usize| rule.word.replace("{n}", &(rule.first + n * rule.step).to_string());
        text.split_inclusive('\n').enumerate().map(|(n, line)| number(n) + line).collect()
    }

    /// The fates of many random edits, with what was done.
    pub fn fates(&self, count: u64, seed: u64) -> Vec<(String, Fate)> {
        (0..count)
            .into_par_iter()
            .map(|n| {
                let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_mul(1_000_003).wrapping_add(n));
                // the control numbers its blocks anew when one is taken out there; an editor elsewhere does not
                let renumbers = self.post.block_numbers.is_some() && !n.is_multiple_of(8);
                let (what, text) = if renumbers {
                    let (what, text) = edit(&self.without_numbers(), &mut rng);
                    (what, self.numbered(&text))
                } else {
                    edit(&self.text, &mut rng)
                };
                let fate = self.fate(&text);
                (what, fate)
            })
            .collect()
    }
}

/// One random edit: a line deleted, doubled or swapped with the next, a digit, a sign, a point, a word, a character.
pub fn edit(text: &str, rng: &mut ChaCha8Rng) -> (String, String) {
    loop {
        let mut lines: Vec<String> = text.split_inclusive('\n').map(str::to_owned).collect();
        let i = rng.random_range(0..lines.len());
        let line = lines[i].clone();
        let what = rng.random_range(0..8);
        let pick = |rng: &mut ChaCha8Rng, good: &dyn Fn(u8) -> bool| -> Option<usize> {
            let places: Vec<usize> = line.bytes().enumerate().filter(|(_, b)| good(*b)).map(|(p, _)| p).collect();
            if places.is_empty() { None } else { Some(places[rng.random_range(0..places.len())]) }
        };
        let says = match what {
            0 => {
                lines.remove(i);
                "deleted"
            }
            1 => {
                lines.insert(i, line.clone());
                "doubled"
            }
            2 => {
                if i + 1 >= lines.len() || lines[i] == lines[i + 1] {
                    continue;
                }
                lines.swap(i, i + 1);
                "swapped with the next"
            }
            3 => {
                let Some(p) = pick(rng, &|b| b.is_ascii_digit()) else { continue };
                let new = b'0' + (line.as_bytes()[p] - b'0' + rng.random_range(1..10)) % 10;
                lines[i].replace_range(p..=p, &(new as char).to_string());
                "another digit"
            }
            4 => {
                // a sign lost, or put before a number
                if let Some(p) = pick(rng, &|b| b == b'-').filter(|_| rng.random_bool(0.5)) {
                    lines[i].replace_range(p..=p, "");
                } else {
                    let starts: Vec<usize> = (1..line.len())
                        .filter(|p| line.as_bytes()[*p].is_ascii_digit() && line.as_bytes()[p - 1].is_ascii_uppercase())
                        .collect();
                    if starts.is_empty() {
                        continue;
                    }
                    lines[i].insert(starts[rng.random_range(0..starts.len())], '-');
                }
                "another sign"
            }
            5 => {
                let Some(p) = pick(rng, &|b| b == b'.') else { continue };
                lines[i].replace_range(p..=p, "");
                "a point lost"
            }
            6 => {
                let words: Vec<&str> = line.trim_end().split(' ').collect();
                if words.len() < 2 {
                    continue;
                }
                let gone = rng.random_range(0..words.len());
                let kept: Vec<&str> = words.iter().enumerate().filter(|(k, _)| *k != gone).map(|(_, w)| *w).collect();
                lines[i] = format!("{}\n", kept.join(" "));
                "a word lost"
            }
            _ => {
                let Some(p) = pick(rng, &|b| b.is_ascii_graphic()) else { continue };
                lines[i].replace_range(p..=p, "");
                "a character lost"
            }
        };
        let edited = lines.concat();
        if edited != text {
            return (
                format!(
                    "line {}, {says}: {:?} is now {:?}",
                    i + 1,
                    line.trim_end(),
                    lines.get(i).map_or("", |l| l.trim_end())
                ),
                edited,
            );
        }
    }
}
