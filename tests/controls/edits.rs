//! Programs that somebody edited: what is done to them, and what "moves identically" means when it is looked at from
//! outside.

use axiscal::check::{Against, check};
use axiscal::diag::{Severity, Source, source};
use axiscal::machine::{self, Machine};
use axiscal::post::Postprocessor;
use axiscal::program::plan::Plan;
use axiscal::program::{self, Options};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// A program as it was generated.
pub struct Original {
    pub machine: Machine,
    pub post: Postprocessor,
    pub plan: Plan,
    pub text: String,
    pub beside: Vec<(String, Source)>,
    pub sha256: String,
    pub statements_sha256: String,
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
    let (beside, text) = (nc.sources(), nc.text);
    let against = Against { plan: Some(&plan), beside: &beside, ..Against::default() };
    let checked = check(&machine, &post, &source("original", text.as_str()), &against).unwrap();
    let wrong: Vec<String> = checked.findings.iter().map(ToString::to_string).collect();
    assert!(wrong.is_empty(), "{controller}: {wrong:#?}");
    assert_eq!(checked.touches, plan.touches.len());
    let sha256 = checked.proof.sha256.clone();
    let statements_sha256 = checked.proof.statements_sha256.clone();
    assert!(!statements_sha256.is_empty());
    plan.programs.insert(post.name.clone(), checked.proof);
    Original { machine, post, plan, text, beside, sha256, statements_sha256 }
}

/// What became of an edited program.
#[derive(Debug, Clone, PartialEq)]
pub enum Fate {
    /// Not of the grammar.
    NotRead,
    /// Refused by what it does.
    Refused,
    /// Refused only because it does otherwise than what was written.
    Changed,
    /// Refused only because it is not what was written: in every run that is tried it does the same.
    Unproven,
    /// It moves identically: it is the same statements.
    Same,
    /// Neither refused nor the same: what must not be.
    Escaped,
}

impl Original {
    /// Looks at an edited text.
    pub fn fate(&self, text: &str) -> Fate {
        let against = Against { plan: Some(&self.plan), beside: &self.beside, ..Against::default() };
        match check(&self.machine, &self.post, &source("edited", text), &against) {
            Err(_) => Fate::NotRead,
            Ok(checked) => {
                let errors: Vec<&str> =
                    checked.findings.iter().filter(|f| f.severity == Severity::Error).map(|f| f.code).collect();
                if errors.is_empty() {
                    let proof = &checked.proof;
                    let same = proof.sha256 == self.sha256 && proof.statements_sha256 == self.statements_sha256;
                    return if same { Fate::Same } else { Fate::Escaped };
                }
                match errors.iter().all(|c| *c == "check::changed") {
                    true if checked.proof.sha256 == self.sha256 => Fate::Unproven,
                    true => Fate::Changed,
                    false => Fate::Refused,
                }
            }
        }
    }

    /// Findings of an edited text, by code.
    #[allow(dead_code)] // the example does not ask for it
    pub fn codes(&self, text: &str) -> Vec<&'static str> {
        let against = Against { plan: Some(&self.plan), beside: &self.beside, ..Against::default() };
        match check(&self.machine, &self.post, &source("edited", text), &against) {
            Err(failure) => failure.0.iter().map(|f| f.code).collect(),
            Ok(checked) => checked.findings.iter().map(|f| f.code).collect(),
        }
    }

    /// What is said of an edited text.
    #[allow(dead_code)] // the example does not ask for it
    pub fn says(&self, text: &str) -> Vec<String> {
        let against = Against { plan: Some(&self.plan), beside: &self.beside, ..Against::default() };
        let findings = match check(&self.machine, &self.post, &source("edited", text), &against) {
            Err(failure) => failure.0,
            Ok(checked) => checked.findings,
        };
        findings.into_iter().map(|f| f.message).collect()
    }

    /// What an edited text is refused as changed for, or else its first finding: code, line from 1, what it says.
    #[allow(dead_code)] // the example does not ask for it
    pub fn finding(&self, text: &str) -> (&'static str, usize, String) {
        let against = Against { plan: Some(&self.plan), beside: &self.beside, ..Against::default() };
        let findings = match check(&self.machine, &self.post, &source("edited", text), &against) {
            Err(failure) => failure.0,
            Ok(checked) => checked.findings,
        };
        let changed = findings.iter().find(|f| f.code == "check::changed");
        let finding = changed.or(findings.first()).expect("nothing is found");
        let line = finding.place().and_then(|p| p.split(':').nth(1)?.parse().ok()).unwrap_or(0);
        (finding.code, line, finding.message.clone())
    }

    /// A text that is meant to begin at a set-up, checked; and whether it says that there is no such set-up.
    #[allow(dead_code)] // the example does not ask for it
    pub fn begun(&self, text: &str, from: u32) -> (axiscal::check::Checked, bool) {
        let against = Against { plan: Some(&self.plan), beside: &self.beside, from, ..Against::default() };
        let checked = check(&self.machine, &self.post, &source("edited", text), &against).unwrap();
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
