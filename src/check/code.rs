//! A program as all dialects give it to the one interpreter: statements in a row, jumps by place, expressions as trees.
//!
//! What a word, a variable or a G number *means* is not here: that is the dialect's (`run::Dialect`).

use super::run::Fault;
use internment::Intern;
use std::collections::{BTreeMap, HashMap};
use std::hash::{BuildHasherDefault, Hasher};
use std::ops::Range;
use std::sync::{Arc, LazyLock};

/// A variable of the control.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Var {
    /// `#5061`, `Q115`
    Number(u32),
    /// `#<_axiscal_from>`, `$AA_MM[X]`, `AXC_LINE`
    Name(Intern<str>),
}

impl Var {
    /// A variable that has a name. Each name is kept once, until axiscal ends.
    pub fn named(name: &str) -> Self {
        Self::Name(Intern::from(name))
    }
}

impl std::fmt::Display for Var {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Number(n) => write!(f, "#{n}"),
            Self::Name(name) => f.write_str(name),
        }
    }
}

/// An operation of two numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Op {
    /// Sum.
    Add,
    /// Difference.
    Sub,
    /// Product.
    Mul,
    /// Quotient.
    Div,
    /// Remainder.
    Mod,
    /// Power.
    Pow,
    /// Equal.
    Eq,
    /// Not equal.
    Ne,
    /// Greater.
    Gt,
    /// Greater or equal.
    Ge,
    /// Less.
    Lt,
    /// Less or equal.
    Le,
    /// Both.
    And,
    /// At least one.
    Or,
    /// Exactly one.
    Xor,
}

/// A function of one number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Function {
    /// Without its sign.
    Abs,
    /// Square root.
    Sqrt,
    /// Next whole number below.
    Floor,
    /// Next whole number above.
    Ceil,
    /// Nearest whole number.
    Round,
    /// Sign changed.
    Minus,
    /// What stands behind the point is cut off.
    Truncate,
    /// 1, 0 or -1.
    Sign,
}

#[derive(Debug, Clone, PartialEq)]
pub enum Expr {
    Number(f64),
    /// What a variable holds.
    Var(Var),
    /// The variable whose number this is.
    Indirect(Box<Expr>),
    /// Does the variable exist?
    Exists(Var),
    /// A function of one number.
    Call(Function, Box<Expr>),
    /// An operation of two.
    Two(Op, Box<Expr>, Box<Expr>),
}

/// A piece of a text that the program writes.
#[derive(Debug, Clone, PartialEq)]
pub enum Piece {
    /// As it stands.
    Text(Arc<str>),
    /// A number with so many digits after the point.
    Fixed {
        /// Digits after the point.
        decimals: usize,
        /// Whole digits that room is kept for, with blanks; 0: none.
        width: usize,
        /// What is written.
        value: Expr,
    },
    /// The text that a variable holds.
    Held(Var),
}

/// A text that the program writes.
pub type Text = Vec<Piece>;

/// A word of a block: address and value.
#[derive(Debug, Clone, PartialEq)]
pub struct Word {
    /// `X`, `G`, `MEAS`: one of the words that the dialect knows.
    pub address: &'static str,
    pub value: Expr,
    /// Written with a decimal point: some controls count in thousandths without one.
    pub point: bool,
}

/// What a statement does.
#[derive(Debug, Clone, PartialEq)]
pub enum Instruction {
    /// Moves, modes, auxiliary functions.
    Block(Vec<Word>),
    /// A value is kept.
    Set(Var, Expr),
    /// A value is kept in a variable whose number is computed.
    SetIndirect(Expr, Expr),
    /// On at another statement.
    Jump(usize),
    /// On at another statement when the condition does not hold.
    JumpUnless(Expr, usize),
    /// A text is kept, at most so many characters of it.
    SetText {
        var: Var,
        /// The longest text that it takes.
        most: usize,
        text: Text,
    },
    /// A subroutine: the number of its first statement, and what its own variables are given.
    Call {
        to: usize,
        /// By variable of the subroutine; those that are not named have no value.
        gives: Vec<(Var, Expr)>,
        /// The same of those that hold a text.
        texts: Vec<(Var, Text)>,
        /// It is a step of the program's body: what happens within is told at the place of the call.
        is_step: bool,
    },
    /// Back to where it was called.
    Return(Option<Expr>),
    /// Out of all subroutines, on at a statement of the program itself.
    Leave(usize),
    /// A message to the operator.
    Message(Text),
    /// A log is opened; `append`: what it holds is kept.
    LogOpen {
        name: Text,
        /// What it holds is kept.
        append: bool,
    },
    LogLine(Text),
    LogClose,
    /// A line is added to a log that need not be opened, and may be full: the variable then holds what is wrong.
    LogWrite {
        /// 0 when the line is in the log.
        error: Var,
        /// Name of the log.
        name: Text,
        /// The line.
        text: Text,
    },
    /// A log that need not be opened is thrown away.
    LogDelete {
        /// 0 when it was there.
        error: Var,
        /// Name of the log.
        name: Text,
    },
    /// The program waits for a person, who is shown a text.
    Wait(Text),
    /// The program is broken off with a message.
    Abort(Text),
    End,
}

/// A statement and its place in the text.
#[derive(Debug, Clone, PartialEq)]
pub struct Statement {
    /// Bytes.
    pub at: Range<usize>,
    pub what: Instruction,
}

/// A program.
#[derive(Debug, Clone, Default)]
pub struct Code {
    /// In the order of the text.
    pub statements: Vec<Statement>,
    /// What the grammar knows to be there and does not know the meaning of: the program is refused with all of it.
    pub unknown: Vec<Unknown>,
    /// The program's own number, as it is written.
    pub number: Option<(String, Range<usize>)>,
}

/// Something in a program whose meaning is not known to axiscal. It may be right all the same.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unknown {
    /// Bytes of the text.
    pub at: Range<usize>,
    /// As a person calls it: `G4`, `P with G64`, `o repeat`.
    pub name: String,
    /// What of it is not known.
    pub kind: UnknownKind,
}

/// What is not known of a word or a block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum UnknownKind {
    Meaning,
    /// It calls another program: what that does.
    Program,
    /// It switches an output or writes to the PLC: what that moves.
    Output,
    /// It writes or deletes another file than the log of the program.
    File,
}

impl Code {
    /// Notes what is not known.
    pub fn is_unknown(&mut self, at: Range<usize>, name: impl Into<String>) {
        self.is_unknown_of(UnknownKind::Meaning, at, name);
    }

    /// Notes what is not known, and what of it.
    pub fn is_unknown_of(&mut self, kind: UnknownKind, at: Range<usize>, name: impl Into<String>) {
        self.unknown.push(Unknown { at, name: name.into(), kind });
    }

    /// Lets a jump or a call lead to a statement.
    pub fn aim(&mut self, statement: usize, target: usize) {
        if let Some(
            Instruction::Jump(to)
            | Instruction::Leave(to)
            | Instruction::JumpUnless(_, to)
            | Instruction::Call { to, .. },
        ) = self.statements.get_mut(statement).map(|s| &mut s.what)
        {
            *to = target;
        }
    }

    /// Lets a jump lead to the statement that comes next.
    pub fn aim_here(&mut self, statement: usize) {
        self.aim(statement, self.statements.len());
    }

    /// Adds a statement and gives its place.
    pub fn push(&mut self, at: Range<usize>, what: Instruction) -> usize {
        self.statements.push(Statement { at, what });
        self.statements.len() - 1
    }
}

/// Labels and what leads to them, which may stand before them.
#[derive(Debug)]
pub struct Links<K> {
    places: BTreeMap<K, usize>,
    jumps: Vec<(usize, K, Range<usize>)>,
}

impl<K> Default for Links<K> {
    fn default() -> Self {
        Self { places: BTreeMap::new(), jumps: Vec::new() }
    }
}

impl<K: Ord> Links<K> {
    /// A label stands before the statement that comes next; `false`: it stands twice.
    pub fn label(&mut self, label: K, code: &Code) -> bool {
        self.places.insert(label, code.statements.len()).is_none()
    }

    pub fn has(&self, label: &K) -> bool {
        self.places.contains_key(label)
    }

    /// A statement leads to a label.
    pub fn leads(&mut self, statement: usize, label: K, at: Range<usize>) {
        self.jumps.push((statement, label, at));
    }

    /// Lets all of them lead there. `lacks` is told of labels that stand nowhere.
    ///
    /// # Errors
    /// Those of `lacks`.
    pub fn resolve(
        self,
        code: &mut Code,
        mut lacks: impl FnMut(&mut Code, K, Range<usize>) -> Result<(), Fault>,
    ) -> Result<(), Fault> {
        for (statement, label, at) in self.jumps {
            match self.places.get(&label) {
                Some(to) => code.aim(statement, *to),
                None => lacks(code, label, at)?,
            }
        }
        Ok(())
    }
}

/// Variables and their values.
pub type Values = HashMap<Var, f64, BuildHasherDefault<VarHasher>>;

/// The variable in which LinuxCNC keeps what a subroutine gives back.
pub static VALUE: LazyLock<Var> = LazyLock::new(|| Var::named("_value"));

/// An odd number whose bits look drawn: 2⁶⁴ over the golden ratio.
const ODD: u64 = 0x9E37_79B9_7F4A_7C15;

/// A fast hash of few words: a variable (its number, or the address of its name), or the bits of a place.
#[derive(Debug, Default, Clone, Copy)]
pub struct VarHasher(u64);

impl Hasher for VarHasher {
    fn finish(&self) -> u64 {
        let mixed = (self.0 ^ (self.0 >> 32)).wrapping_mul(ODD);
        mixed ^ (mixed >> 32)
    }

    fn write(&mut self, bytes: &[u8]) {
        for eight in bytes.chunks(8) {
            let mut word = [0; 8];
            word.iter_mut().zip(eight).for_each(|(slot, byte)| *slot = *byte);
            self.write_u64(u64::from_le_bytes(word));
        }
    }

    fn write_u64(&mut self, word: u64) {
        self.0 = (self.0.rotate_left(5) ^ word).wrapping_mul(ODD);
    }

    fn write_u32(&mut self, word: u32) {
        self.write_u64(u64::from(word));
    }

    fn write_usize(&mut self, word: usize) {
        self.write_u64(word as u64);
    }
}

/// Numbers that differ by less are equal to every control here.
const SAME: f64 = 1e-9;

impl Expr {
    /// Does it read a variable of this kind?
    pub fn reads(&self, kind: &dyn Fn(&Var) -> bool) -> bool {
        match self {
            Self::Var(var) => kind(var),
            Self::Number(_) | Self::Exists(_) => false,
            Self::Indirect(of) | Self::Call(_, of) => of.reads(kind),
            Self::Two(_, left, right) => left.reads(kind) || right.reads(kind),
        }
    }

    /// The value.
    ///
    /// # Errors
    /// What cannot be computed, and why.
    pub fn value(
        &self,
        read: &dyn Fn(&Var) -> Result<f64, String>,
        exists: &dyn Fn(&Var) -> bool,
    ) -> Result<f64, String> {
        let truth = |yes: bool| if yes { 1.0 } else { 0.0 };
        match self {
            Self::Number(x) => Ok(*x),
            Self::Var(var) => read(var),
            Self::Exists(var) => Ok(truth(exists(var))),
            Self::Indirect(number) => read(&numbered(number.value(read, exists)?)?),
            Self::Call(function, of) => {
                let x = of.value(read, exists)?;
                match function {
                    Function::Abs => Ok(x.abs()),
                    Function::Minus => Ok(-x),
                    Function::Sqrt if x < 0.0 => Err(format!("the root of {x} does not exist")),
                    Function::Sqrt => Ok(x.sqrt()),
                    Function::Floor => Ok(x.floor()),
                    Function::Ceil => Ok(x.ceil()),
                    Function::Round => Ok(x.round()),
                    Function::Truncate => Ok(x.trunc()),
                    Function::Sign => Ok(if x == 0.0 { 0.0 } else { x.signum() }),
                }
            }
            Self::Two(op, left, right) => {
                let (a, b) = (left.value(read, exists)?, right.value(read, exists)?);
                match op {
                    Op::Add => Ok(a + b),
                    Op::Sub => Ok(a - b),
                    Op::Mul => Ok(a * b),
                    Op::Div | Op::Mod if b == 0.0 => Err("a division by 0".to_owned()),
                    Op::Div => Ok(a / b),
                    Op::Mod => Ok(a.rem_euclid(b)),
                    Op::Pow => Ok(a.powf(b)),
                    Op::Eq => Ok(truth((a - b).abs() < SAME)),
                    Op::Ne => Ok(truth((a - b).abs() >= SAME)),
                    Op::Gt => Ok(truth(a > b)),
                    Op::Ge => Ok(truth(a >= b)),
                    Op::Lt => Ok(truth(a < b)),
                    Op::Le => Ok(truth(a <= b)),
                    Op::And => Ok(truth(a != 0.0 && b != 0.0)),
                    Op::Or => Ok(truth(a != 0.0 || b != 0.0)),
                    Op::Xor => Ok(truth((a != 0.0) != (b != 0.0))),
                }
            }
        }
    }
}

/// The variable of a computed number.
///
/// # Errors
/// When it is no whole number of a variable.
pub fn numbered(number: f64) -> Result<Var, String> {
    if number.fract().abs() > SAME || !(0.0..1e6).contains(&number) {
        return Err(format!("there is no variable number {number}"));
    }
    Ok(Var::Number(number.round() as u32))
}
