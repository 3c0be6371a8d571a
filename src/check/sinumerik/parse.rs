//! The grammar: declarations, IF blocks and loops, jumps, messages, WRITE. What it does not know is an error.
//!
//! Sources: NC Programming 12/2019, 6FC5398-2EP40-0BA0, pp. 565-566 (WRITE); Arbeitsvorbereitung 10/2015,
//! 6FC5398-2BP40-5AA3, pp. 92-94 (SPRINT); Job Planning 07/2010, 6FC5398-2BP40-0BA0, p. 270 (measuring); the rest as the
//! postprocessor file says, unverified where it says so.

use super::expression::{Names, Type, identifier, quoted};
use super::words::{means_something, words};
use crate::axes::AxisName;
use crate::check::code::{Code, Expr, Function, Instruction, Piece, Text, UnknownKind, Var};
use crate::check::lines::{Line, blanks, lines};
use crate::check::run::Fault;
use crate::post::Postprocessor;
use nom::character::complete::{char, digit1};
use nom::multi::separated_list1;
use nom::sequence::delimited;
use nom::{IResult, Parser};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::Arc;

/// Variables that switch outputs or go to the PLC.
const OUTPUTS: [&str; 6] = ["$A_OUT[", "$A_OUTA[", "$A_DBB[", "$A_DBW[", "$A_DBD[", "$A_DBR["];

mod structure;

use structure::{Direction, Jump, Open};

type Failed<'a> = nom::Err<nom::error::Error<&'a str>>;

/// Reads a program. The names of the axes are those of the postprocessor file.
///
/// # Errors
/// The first place that is not of this grammar.
pub fn parse(text: &str, post: &Postprocessor) -> Result<Code, Fault> {
    let text = &capitals(text);
    let axes = AxisName::ALL.into_iter().map(|a| (post.number.name(a), a)).collect();
    let mut reader = Reader { names: Names { types: BTreeMap::new(), axes }, ..Reader::default() };
    let read = lines(text).try_for_each(|line| reader.line(&line));
    // what is not known may be why the rest is not understood: it is said first
    if !reader.code.unknown.is_empty() {
        return Ok(reader.code);
    }
    read?;
    reader.finish(text.len())
}

/// Capitals and small letters are one, but for texts in quotes. No place changes by that.
fn capitals(text: &str) -> String {
    let mut quoted = false;
    let capital = |c: char| {
        quoted = (quoted != (c == '"')) && c != '\n';
        if quoted { c } else { c.to_ascii_uppercase() }
    };
    text.chars().map(capital).collect()
}

/// A program that is called: its parameters, and where it begins.
struct Procedure {
    start: usize,
    parameters: Vec<(Arc<str>, Type)>,
}

/// A call: the statement, the name, what is given.
struct Called {
    statement: usize,
    name: String,
    at: Range<usize>,
}

#[derive(Default)]
struct Reader {
    code: Code,
    names: Names,
    /// The program that is read: 0 is the program itself.
    program: usize,
    /// Names that are declared in any of the programs.
    declared: BTreeSet<Arc<str>>,
    /// Programs that are declared by EXTERN.
    external: BTreeMap<String, Vec<Type>>,
    procedures: BTreeMap<String, Procedure>,
    calls: Vec<Called>,
    labels: BTreeMap<(usize, String), (usize, Vec<usize>)>,
    jumps: Vec<Jump>,
    open: Vec<(Open, usize, Range<usize>)>,
    /// Structures so far: each has its number.
    structures: usize,
    begun: bool,
    running: bool,
    ended: bool,
}

impl Reader {
    fn line(&mut self, line: &Line<'_>) -> Result<(), Fault> {
        let body = without_comment(line.text);
        let body = body.trim_end_matches([' ', '\t']);
        // the line as far as it acts: what is expected behind its end is said there
        let line = &Line { start: line.start, text: body };
        let rest = blanks(body).map_err(|e| line.unread(&e, "a block"))?.0;
        if rest.is_empty() {
            return Ok(());
        }
        let first = !std::mem::replace(&mut self.begun, true);
        if let Some(name) = rest.strip_prefix("%_N_").filter(|_| !self.ended) {
            let good = name.strip_suffix("_MPF").is_some_and(|n| identifier(n).is_ok_and(|(left, _)| left.is_empty()));
            return if first && good {
                Ok(())
            } else {
                Err(line.fault(rest, "the head of a file stands first: %_N_NAME_MPF"))
            };
        }
        let rest = without_number(rest);
        if let Some(after) = rest.strip_prefix("PROC ") {
            return self.procedure(line, after);
        }
        let rest = match label(rest) {
            Some((after, name)) => {
                self.label(line, rest, name)?;
                blanks(after).map_err(|e| line.unread(&e, "a block"))?.0
            }
            None => rest,
        };
        if rest.is_empty() { Ok(()) } else { self.statement(line, rest) }
    }

    fn statement(&mut self, line: &Line<'_>, rest: &str) -> Result<(), Fault> {
        let (after, keyword) = identifier(rest).unwrap_or((rest, ""));
        if keyword == "DEF" {
            return self.declaration(line, after);
        }
        if keyword == "EXTERN" && self.program == 0 && !self.running {
            return self.external(line, after);
        }
        self.running = true;
        let at = line.rest(rest);
        let left = match keyword {
            "IF" => self.condition(line, after, at)?,
            "ELSE" | "ENDIF" | "WHILE" | "ENDWHILE" | "LOOP" | "ENDLOOP" | "REPEAT" | "UNTIL" => {
                self.structure(line, rest, keyword, after, at)?
            }
            "GOTO" | "GOTOF" | "GOTOB" => self.goto(line, rest, at)?,
            "MSG" => {
                let (left, text) = self.in_brackets(line, after, |names, i| match i.strip_prefix(')') {
                    Some(_) => Ok((i, Text::new())),
                    None => names.text(i, true),
                })?;
                self.code.push(at, Instruction::Message(text));
                left
            }
            "RET" if self.program > 0 => self.leave(line, after, at)?,
            name if self.external.contains_key(name) => self.call(line, after, name.to_owned(), at)?,
            "SETAL" => self.alarm(line, after, at)?,
            "WRITE" => {
                let (left, (error, name, text)) = self.in_brackets(line, after, |names, i| {
                    let (i, (error, _, name, _)) = (error_variable(names), comma, quoted, comma).parse(i)?;
                    let (i, text) = names.text(i, false)?;
                    Ok((i, (error, Arc::<str>::from(name), text)))
                })?;
                self.code.push(at, Instruction::LogWrite { error, name: vec![Piece::Text(name)], text });
                left
            }
            "DELETE" => {
                let (left, (error, name)) = self.in_brackets(line, after, |names, i| {
                    let (i, (error, _, name)) = (error_variable(names), comma, quoted).parse(i)?;
                    Ok((i, (error, Arc::<str>::from(name))))
                })?;
                self.code.push(at, Instruction::LogDelete { error, name: vec![Piece::Text(name)] });
                left
            }
            _ if OUTPUTS.iter().any(|output| rest.starts_with(output)) => {
                let name = rest.split_once('=').map_or(rest, |(name, _)| name).trim_end();
                self.code.is_unknown_of(UnknownKind::Output, at, name);
                return Ok(());
            }
            _ if rest.starts_with('$') => {
                let (after, var) = self.names.system(rest).map_err(|e| line.unread(&e, "a system variable"))?;
                self.assignment(line, after, var, Type::Real, at)?
            }
            name if after.starts_with('=') && self.names.axis(name).is_none() => {
                let own = self.names.types.get(name).copied();
                let r = self.names.number(name).map(|_| Type::Real);
                match own.or(r) {
                    Some(kind) => self.assignment(line, after, Var::named(name), kind, at)?,
                    None => return self.block(line, rest),
                }
            }
            _ => return self.block(line, rest),
        };
        let left = blanks(left).map_err(|e| line.unread(&e, "the end of the block"))?.0;
        if left.is_empty() { Ok(()) } else { Err(line.not_understood(left, "the end of the block")) }
    }

    fn block(&mut self, line: &Line<'_>, rest: &str) -> Result<(), Fault> {
        let words = words(&self.names, line, rest, &mut self.code)?;
        let ends = |w: &crate::check::code::Word| w.address == "M" && w.value == Expr::Number(30.0);
        self.ended |= words.iter().any(ends);
        self.code.push(line.rest(rest), Instruction::Block(words));
        Ok(())
    }

    fn in_brackets<'a, T>(
        &self,
        line: &Line<'_>,
        rest: &'a str,
        inside: impl Fn(&Names, &'a str) -> IResult<&'a str, T>,
    ) -> Result<(&'a str, T), Fault> {
        delimited((char('('), blanks), |i| inside(&self.names, i), (blanks, char(')')))
            .parse(rest)
            .map_err(|e: Failed<'_>| line.not_understood(place(&e), "what stands in these brackets"))
    }

    fn declaration(&mut self, line: &Line<'_>, rest: &str) -> Result<(), Fault> {
        if self.running {
            return Err(line.fault(rest, "DEF stands before everything else"));
        }
        let (after, kind) = (blanks, declared)
            .parse(rest)
            .map(|(after, (_, kind))| (after, kind))
            .map_err(|e: Failed<'_>| line.not_understood(place(&e), "INT, REAL or STRING[200]"))?;
        let mut left = after;
        loop {
            let at = line.rest(left);
            let (after, name) = (blanks, identifier)
                .parse(left)
                .map(|(after, (_, name))| (after, name))
                .map_err(|e: Failed<'_>| line.not_understood(place(&e), "a name"))?;
            self.free(line, left, name)?;
            self.declared.insert(Arc::from(name));
            self.names.types.insert(Arc::from(name), kind);
            let var = Var::named(name);
            left = if after.starts_with('=') {
                self.assignment(line, after, var, kind, at)?
            } else {
                let what = match kind {
                    Type::Text(most) => Instruction::SetText { var, most, text: Text::new() },
                    _ => Instruction::Set(var, Expr::Number(0.0)),
                };
                self.code.push(at, what);
                after
            };
            left = blanks(left).map_err(|e| line.unread(&e, "a name"))?.0;
            match left.strip_prefix(',') {
                Some(next) => left = next,
                None if left.is_empty() => return Ok(()),
                None => return Err(line.not_understood(left, "a comma or the end of the block")),
            }
        }
    }

    /// `EXTERN AXC_TOUCH(INT,STRING[60],REAL)`
    fn external(&mut self, line: &Line<'_>, rest: &str) -> Result<(), Fault> {
        let unread = |rest: &str| line.not_understood(rest, "the name of a program and the kinds of what it is given");
        let (after, (_, name)) = (blanks, identifier).parse(rest).map_err(|e: Failed<'_>| unread(place(&e)))?;
        let kind = |i| (blanks, kind_alone, blanks).parse(i).map(|(i, (_, kind, _))| (i, kind));
        let (left, kinds) = delimited(char('('), separated_list1(char(','), kind), char(')'))
            .parse(after)
            .map_err(|e: Failed<'_>| unread(place(&e)))?;
        self.free(line, rest, name)?;
        if !left.is_empty() || self.external.insert(name.to_owned(), kinds).is_some() {
            return Err(unread(left));
        }
        Ok(())
    }

    /// `PROC AXC_TOUCH(INT AXT_ID,STRING[60] AXT_SAYS)`: another program begins.
    fn procedure(&mut self, line: &Line<'_>, rest: &str) -> Result<(), Fault> {
        let unread = |rest: &str| line.not_understood(rest, "the name of a program and what it is given");
        if !self.ended || !self.open.is_empty() {
            return Err(line.fault(rest, "a program that is called stands in a file of its own"));
        }
        if self.program > 0 && !self.returns() {
            return Err(line.fault(rest, "the program before this one does not end with RET"));
        }
        let (after, (_, name)) = (blanks, identifier).parse(rest).map_err(|e: Failed<'_>| unread(place(&e)))?;
        let parameter = |i| {
            let (i, (_, kind, _, name, _)) = (blanks, declared, blanks, identifier, blanks).parse(i)?;
            Ok((i, (Arc::<str>::from(name), kind)))
        };
        let (left, parameters) = delimited(char('('), separated_list1(char(','), parameter), char(')'))
            .parse(after)
            .map_err(|e: Failed<'_>| unread(place(&e)))?;
        if !left.is_empty() {
            return Err(unread(left));
        }
        self.program += 1;
        self.running = false;
        self.names.types.clear();
        for (parameter, kind) in &parameters {
            self.free(line, rest, parameter)?;
            self.declared.insert(parameter.clone());
            self.names.types.insert(parameter.clone(), *kind);
        }
        let start = self.code.statements.len();
        match self.procedures.insert(name.to_owned(), Procedure { start, parameters }) {
            Some(_) => Err(line.fault(rest, format!("the program {name} stands twice"))),
            None => Ok(()),
        }
    }

    /// Does what was read last go back to where it was called?
    fn returns(&self) -> bool {
        matches!(self.code.statements.last().map(|s| &s.what), Some(Instruction::Return(_)))
    }

    /// `RET`, or `RET("AXC_END")`: back to a label of the program itself.
    fn leave<'a>(&mut self, line: &Line<'_>, after: &'a str, at: Range<usize>) -> Result<&'a str, Fault> {
        if after.is_empty() {
            self.code.push(at, Instruction::Return(None));
            return Ok(after);
        }
        let (left, label) = self.in_brackets(line, after, |_, i| quoted(i).map(|(i, label)| (i, label.to_owned())))?;
        let statement = self.code.push(at.clone(), Instruction::Leave(0));
        let jump =
            Jump { statement, label: (0, label), direction: Direction::Both, at: at.clone(), inside: Vec::new() };
        self.jumps.push(jump);
        // the control comes to nothing behind it
        self.code.push(at, Instruction::Return(None));
        Ok(left)
    }

    /// `AXC_TOUCH(1,"block x-",-33)`
    fn call<'a>(&mut self, line: &Line<'_>, after: &'a str, name: String, at: Range<usize>) -> Result<&'a str, Fault> {
        let kinds = self.external.get(&name).cloned().unwrap_or_default();
        let (mut gives, mut texts) = (Vec::new(), Vec::new());
        let mut left = after.strip_prefix('(').ok_or_else(|| line.not_understood(after, "( and what it is given"))?;
        for (n, kind) in (0..).zip(&kinds) {
            let unread = |e: &Failed<'_>| line.not_understood(place(e), "what the program is given");
            if n > 0 {
                left = comma(left).map_err(|e| unread(&e))?.0;
            }
            // its names are known when its own file has been read
            let var = Var::Number(n);
            left = if matches!(kind, Type::Text(_)) {
                let (rest, text) = self.names.text(left, false).map_err(|e| unread(&e))?;
                texts.push((var, text));
                rest
            } else {
                let (rest, value) = self.names.value_of(left).map_err(|e| unread(&e))?;
                gives.push((var, value));
                rest
            };
        }
        let left =
            left.strip_prefix(')').ok_or_else(|| line.not_understood(left, ") behind the last of what it is given"))?;
        let what = Instruction::Call { to: 0, gives, texts, is_step: true };
        let statement = self.code.push(at.clone(), what);
        self.calls.push(Called { statement, name, at });
        Ok(left)
    }

    /// A name that nothing else has.
    fn free(&self, line: &Line<'_>, rest: &str, name: &str) -> Result<(), Fault> {
        const LENGTH: std::ops::RangeInclusive<usize> = 2..=31;
        let taken = self.declared.contains(name) || self.external.contains_key(name) || self.names.axis(name).is_some();
        if taken || means_something(name) || self.names.number(name).is_some() {
            return Err(line.fault(rest, format!("{name} already means something else")));
        }
        if !LENGTH.contains(&name.len()) {
            return Err(line.fault(rest, format!("{name}: a name has 2 to 31 characters")));
        }
        Ok(())
    }

    fn assignment<'a>(
        &mut self,
        line: &Line<'_>,
        rest: &'a str,
        var: Var,
        kind: Type,
        at: Range<usize>,
    ) -> Result<&'a str, Fault> {
        let value = rest.strip_prefix('=').ok_or_else(|| line.not_understood(rest, "= and a value"))?;
        let unread = |e: &Failed<'_>| line.not_understood(place(e), "a value");
        if let Type::Text(most) = kind {
            let (left, text) = self.names.text(value, false).map_err(|e| unread(&e))?;
            self.code.push(at, Instruction::SetText { var, most, text });
            return Ok(left);
        }
        let (left, value) = self.names.value_of(value).map_err(|e| unread(&e))?;
        let value = match value {
            // a whole number is rounded when something else is put into it
            value if kind == Type::Int && !matches!(value, Expr::Number(_)) => {
                Expr::Call(Function::Round, Box::new(value))
            }
            value => value,
        };
        self.code.push(at, Instruction::Set(var, value));
        Ok(left)
    }

    /// SETAL is shown; whether it stops depends on its number and the machine: the program must stop by itself.
    fn alarm<'a>(&mut self, line: &Line<'_>, rest: &'a str, at: Range<usize>) -> Result<&'a str, Fault> {
        let (left, (number, mut text)) = self.in_brackets(line, rest, |names, i| {
            let (i, number) = digit1(i)?;
            match comma(i) {
                Ok((i, _)) => names.text(i, true).map(|(i, text)| (i, (number, text))),
                Err(_) => Ok((i, (number, Text::new()))),
            }
        })?;
        if !matches!(number.parse::<u32>(), Ok(60_000..=69_999)) {
            return Err(line.fault(rest, "alarms of programs have numbers from 60000 to 69999"));
        }
        text.insert(0, Piece::Text(Arc::from(format!("{number} "))));
        self.code.push(at, Instruction::Message(text));
        Ok(left)
    }

    fn finish(mut self, end: usize) -> Result<Code, Fault> {
        if let Some((_, _, at)) = self.open.pop() {
            return Err(Fault {
                at,
                says: "what begins here has no end: ENDIF, ENDWHILE, ENDLOOP or UNTIL".to_owned(),
            });
        }
        if !self.ended {
            return Err(Fault { at: end..end, says: "the program has no M30".to_owned() });
        }
        if self.program > 0 && !self.returns() {
            return Err(Fault { at: end..end, says: "the last program does not end with RET".to_owned() });
        }
        self.link()?;
        for jump in std::mem::take(&mut self.jumps) {
            let label = &jump.label.1;
            let lacks = |says: String| Fault { at: jump.at.clone(), says };
            let (to, inside) =
                self.labels.get(&jump.label).cloned().ok_or_else(|| lacks(format!("there is no label {label}:")))?;
            let onward = to > jump.statement;
            if (onward && jump.direction == Direction::Back) || (!onward && jump.direction == Direction::Onward) {
                return Err(lacks(format!("the label {label} stands in the other direction")));
            }
            if !jump.inside.starts_with(&inside) {
                return Err(lacks(format!("the label {label} stands inside of an IF or a loop")));
            }
            self.code.aim(jump.statement, to);
        }
        Ok(self.code)
    }
}

impl Reader {
    /// Lets calls lead to their programs, and gives what they are given to the names there.
    fn link(&mut self) -> Result<(), Fault> {
        for Called { statement, name, at } in std::mem::take(&mut self.calls) {
            let Some(procedure) = self.procedures.get(&name) else {
                self.code.is_unknown_of(UnknownKind::Program, at, name);
                continue;
            };
            let kinds: Vec<Type> = procedure.parameters.iter().map(|(_, kind)| *kind).collect();
            if self.external.get(&name) != Some(&kinds) {
                return Err(Fault { at, says: format!("EXTERN {name} does not name what PROC {name} is given") });
            }
            let named = |var: &mut Var| {
                if let Var::Number(n) = var
                    && let Some((name, _)) = procedure.parameters.get(*n as usize)
                {
                    *var = Var::named(name);
                }
            };
            if let Some(Instruction::Call { to, gives, texts, .. }) =
                self.code.statements.get_mut(statement).map(|s| &mut s.what)
            {
                *to = procedure.start;
                gives.iter_mut().for_each(|(var, _)| named(var));
                texts.iter_mut().for_each(|(var, _)| named(var));
            }
        }
        Ok(())
    }
}

/// What nom could not read.
fn place<'a>(error: &Failed<'a>) -> &'a str {
    match error {
        nom::Err::Error(e) | nom::Err::Failure(e) => e.input,
        nom::Err::Incomplete(_) => "",
    }
}

/// A line up to a semicolon that stands outside of quotation marks.
fn without_comment(text: &str) -> &str {
    let mut quoted = false;
    for (place, character) in text.char_indices() {
        match character {
            '"' => quoted = !quoted,
            ';' if !quoted => return text.get(..place).unwrap_or(text),
            _ => {}
        }
    }
    text
}

/// A block behind its number, of eight digits at most; a number alone is that of a remark.
fn without_number(rest: &str) -> &str {
    const DIGITS: usize = 8;
    let number = (char('N'), digit1::<&str, nom::error::Error<&str>>).parse(rest);
    let behind = number.map_or(rest, |(after, (_, digits))| if digits.len() > DIGITS { rest } else { after });
    let block = behind.trim_start_matches([' ', '\t']);
    if behind.is_empty() || block.len() < behind.len() { block } else { rest }
}

/// `AXC_END:`
fn label(rest: &str) -> Option<(&str, &str)> {
    let (after, name) = identifier(rest).ok()?;
    let after = after.strip_prefix(':')?;
    (!after.starts_with('=')).then_some((after, name))
}

fn comma(input: &str) -> IResult<&str, char> {
    delimited(blanks, char(','), blanks).parse(input)
}

/// `INT`, `REAL`, `STRING[200]`, whatever follows.
fn kind_alone(input: &str) -> IResult<&str, Type> {
    let end = input.find([',', ')']).unwrap_or(input.len());
    let (kind, _) = input.split_at(end);
    let padded = format!("{kind} ");
    match declared(&padded) {
        Ok((_, kind)) => Ok((&input[end..], kind)),
        Err(_) => Err(nom::Err::Error(nom::error::Error::new(input, nom::error::ErrorKind::Alt))),
    }
}

/// `INT`, `REAL`, `STRING[200]`
fn declared(input: &str) -> IResult<&str, Type> {
    let bad = || nom::Err::Error(nom::error::Error::new(input, nom::error::ErrorKind::Alt));
    let (after, word) = identifier(input)?;
    let (after, kind) = match word {
        "INT" => (after, Type::Int),
        "REAL" => (after, Type::Real),
        "STRING" => {
            let (after, most) = delimited(char('['), digit1, char(']')).parse(after)?;
            (after, Type::Text(most.parse().ok().filter(|n| (1..=200).contains(n)).ok_or_else(bad)?))
        }
        _ => return Err(bad()),
    };
    if after.starts_with([' ', '\t']) { Ok((after, kind)) } else { Err(bad()) }
}

/// The variable for the error number of a function.
fn error_variable<'a>(names: &Names) -> impl Fn(&'a str) -> IResult<&'a str, Var> {
    move |input| match identifier(input)? {
        (after, name) if names.types.get(name) == Some(&Type::Int) => Ok((after, Var::named(name))),
        _ => Err(nom::Err::Error(nom::error::Error::new(input, nom::error::ErrorKind::Verify))),
    }
}

#[cfg(test)]
mod tests;
