//! Values that a proof cannot know, and the conditions that depend on them.
//!
//! A clock shows another time in each run, and a stored value of the control is the user's. A condition that depends on such
//! a value is run both ways: the run goes on as its values say, and another run ([`Fork`]) begins at the condition and takes
//! the other way. Where the two ways only compute something and meet again, with differences in unknown values alone, there is
//! nothing else to run.

use super::code::{Expr, Instruction, Statement, Var, VarHasher};
use super::run::{Dialect, Run};
use std::collections::BTreeMap;
use std::hash::{BuildHasher as _, BuildHasherDefault};

/// Why a value is not known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Doubt {
    /// A stored value of the control, or the position of an axis that the program has not moved yet. The runs begin with
    /// several of them.
    Stored,
    /// A clock or an input of the machine.
    Outside,
}

impl Doubt {
    /// What the condition depends on, for messages.
    pub fn says(self) -> &'static str {
        match self {
            Self::Stored => "a stored value of the control",
            Self::Outside => "a clock or an input",
        }
    }
}

/// The variables of a program whose values are not known, and the conditions that depended on them.
#[derive(Debug, Clone, Default)]
pub struct Doubts {
    /// Few: variables with how deep their subroutine is called; 0 for those that are not local.
    values: Vec<(usize, Var, Doubt)>,
    /// The bits ([`bit`]) of all variables that were ever among them: most variables are not.
    ever: u64,
    /// By statement: the condition did not hold in a run, it held in one.
    pub taken: Taken,
    /// The other ways of conditions with at least this doubt are kept.
    pub keeps: Option<Doubt>,
    /// How many conditions this run has taken the other way.
    pub depth: usize,
    /// Other ways that were kept.
    pub kept: usize,
    /// The first condition whose other way was not kept, because there are too many.
    pub cut: Option<usize>,
}

impl Doubts {
    /// A subroutine begins at this depth.
    pub fn enters(&mut self, depth: usize) {
        self.values.retain(|(at, ..)| *at != depth);
    }
}

/// One of 64 bits for each variable.
fn bit(var: &Var) -> u64 {
    1 << (BuildHasherDefault::<VarHasher>::default().hash_one(var) % 64)
}

/// By statement: its condition did not hold, it held.
pub type Taken = BTreeMap<usize, [bool; 2]>;

/// A run that takes the other way at a condition.
#[derive(Debug, Clone)]
pub struct Fork<'p, D> {
    /// What the condition depends on.
    pub doubt: Doubt,
    /// The condition.
    pub statement: usize,
    /// The run, behind the condition, with all that happened before it.
    pub run: Run<'p, D>,
}

/// Forks of one run that are kept.
const MOST_FORKS: usize = 64;

/// What a run has computed at a statement since it began to compute only.
struct Computed {
    next: usize,
    written: BTreeMap<Var, (Option<u64>, Option<Doubt>)>,
}

impl<D: Dialect> Run<'_, D> {
    fn depth_of(&self, var: &Var) -> usize {
        if self.dialect.is_local(var) { self.depth() } else { 0 }
    }

    /// Of a variable that the program has given a value.
    fn held_doubt(&self, var: &Var) -> Option<Doubt> {
        if self.doubts.ever & bit(var) == 0 {
            return None;
        }
        let held = |(depth, known, _): &&(usize, Var, Doubt)| known == var && *depth == self.depth_of(var);
        self.doubts.values.iter().find(held).map(|(.., doubt)| *doubt)
    }

    /// Is the value of a variable not known?
    fn doubt_of(&self, var: &Var) -> Option<Doubt> {
        self.held_doubt(var).max(self.dialect.doubt(var, &self.vm))
    }

    /// Is the value of an expression not known?
    pub(super) fn doubt(&self, expr: &Expr) -> Option<Doubt> {
        match expr {
            Expr::Number(_) => None,
            Expr::Var(var) => self.doubt_of(var),
            Expr::Exists(var) => self.dialect.may_exist(var).then_some(Doubt::Stored),
            Expr::Indirect(number) => self.doubt(number).max(self.doubt_of(&self.variable(number).ok()?)),
            Expr::Call(_, of) => self.doubt(of),
            Expr::Two(_, left, right) => self.doubt(left).max(self.doubt(right)),
        }
    }

    /// A variable has been given a value.
    pub(super) fn given(&mut self, var: &Var, doubt: Option<Doubt>) {
        if doubt.is_none() && self.doubts.ever & bit(var) == 0 {
            return;
        }
        self.doubts.ever |= bit(var);
        let depth = self.depth_of(var);
        self.doubts.values.retain(|(at, known, _)| (*at, known) != (depth, var));
        self.doubts.values.extend(doubt.map(|doubt| (depth, *var, doubt)));
    }

    /// A condition that depends on an unknown value: `holds` leads on to `here`, otherwise it leads to `to`.
    pub(super) fn in_doubt(&mut self, doubt: Doubt, holds: bool, to: usize) {
        let (statement, here) = (self.next - 1, self.next);
        self.doubts.taken.entry(statement).or_default()[usize::from(holds)] = true;
        let ways = if holds { [here, to] } else { [to, here] };
        let kept = self.doubts.keeps.is_some_and(|least| doubt >= least);
        if !kept || self.meet(ways) {
            return;
        }
        if self.doubts.kept >= MOST_FORKS {
            self.doubts.cut.get_or_insert(statement);
            return;
        }
        self.doubts.kept += 1;
        let mut run = self.without_record();
        run.vm.trace.clone_from(&self.vm.trace);
        (run.next, run.keeps_forks) = (ways[1], self.keeps_forks);
        (run.doubts.depth, run.doubts.kept) = (self.doubts.depth + 1, 0);
        self.doubted.push(Fork { doubt, statement, run });
    }

    /// Do two ways only compute, and meet with differences in unknown values alone?
    fn meet(&self, ways: [usize; 2]) -> bool {
        let [one, other] = ways.map(|next| self.computes(next));
        one.iter().any(|a| other.iter().any(|b| a.next == b.next && self.same(a, b)))
    }

    fn same(&self, a: &Computed, b: &Computed) -> bool {
        let before = |var: &Var| (self.bits(var), self.held_doubt(var));
        a.written.keys().chain(b.written.keys()).all(|var| {
            let of = |way: &Computed| way.written.get(var).copied().unwrap_or_else(|| before(var));
            let ((x, p), (y, q)) = (of(a), of(b));
            (p.is_some() && q.is_some()) || (x == y && p == q)
        })
    }

    fn bits(&self, var: &Var) -> Option<u64> {
        self.dialect.read(var, &self.vm).ok().map(f64::to_bits)
    }

    /// The states through which a run comes from a statement on as long as it only computes.
    fn computes(&self, next: usize) -> Vec<Computed> {
        const MOST: usize = 40;
        let mut run = self.without_record();
        run.doubts.keeps = None;
        run.next = next;
        let mut written = BTreeMap::new();
        let mut states = vec![Computed { next, written: BTreeMap::new() }];
        while states.len() < MOST {
            let (code, own) = (run.code, run.own());
            let Some(statement) = own.as_deref().or_else(|| code.statements.get(run.next)) else { break };
            if !run.only_computes(statement) {
                break;
            }
            run.next += 1;
            if run.statement(statement).is_err() {
                break;
            }
            if let Instruction::Set(var, _) = &statement.what {
                written.insert(*var, (run.bits(var), run.held_doubt(var)));
            }
            states.push(Computed { next: run.next, written: written.clone() });
        }
        states
    }

    fn only_computes(&self, statement: &Statement) -> bool {
        match &statement.what {
            Instruction::Set(..) | Instruction::Jump(_) => true,
            Instruction::JumpUnless(condition, _) => {
                self.doubt(condition).is_none() && !condition.reads(&|var| self.dialect.is_probe_input(var))
            }
            _ => false,
        }
    }
}
