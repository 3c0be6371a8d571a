//! Formulas of Q parameters: `Q1605 = 0 - ( Q1603 - 8 ) * 1`. Every sign, name and bracket stands between blanks.

use super::scan::Scan;
use crate::check::code::{Expr, Function, Op};
use crate::check::run::Fault;

/// How deep brackets may stand in each other.
const DEEPEST: usize = 20;

const FUNCTIONS: [(&str, Function); 5] = [
    ("ABS ", Function::Abs),
    ("INT ", Function::Truncate),
    ("SGN ", Function::Sign),
    ("SQRT ", Function::Sqrt),
    ("NEG ", Function::Minus),
];

/// A sum, up to the end of the block or a closing bracket.
///
/// # Errors
/// The first place that is no formula.
pub fn formula(scan: &mut Scan<'_>, depth: usize) -> Result<Expr, Fault> {
    chain(scan, depth, product, &[(" + ", Op::Add), (" - ", Op::Sub)])
}

fn product(scan: &mut Scan<'_>, depth: usize) -> Result<Expr, Fault> {
    chain(scan, depth, value, &[(" * ", Op::Mul), (" / ", Op::Div)])
}

fn chain(
    scan: &mut Scan<'_>,
    depth: usize,
    of: fn(&mut Scan<'_>, usize) -> Result<Expr, Fault>,
    signs: &[(&str, Op)],
) -> Result<Expr, Fault> {
    let mut left = of(scan, depth)?;
    while let Some((_, op)) = signs.iter().find(|(sign, _)| scan.take(sign)) {
        left = Expr::Two(*op, Box::new(left), Box::new(of(scan, depth)?));
    }
    Ok(left)
}

fn value(scan: &mut Scan<'_>, depth: usize) -> Result<Expr, Fault> {
    const WHAT: &str = "a number, a Q parameter, a function or ( ";
    if depth > DEEPEST {
        return Err(scan.fault("brackets stand too deep in each other"));
    }
    if let Some((_, function)) = FUNCTIONS.iter().find(|(name, _)| scan.take(name)) {
        return Ok(Expr::Call(*function, Box::new(value(scan, depth + 1)?)));
    }
    if scan.take("( ") {
        let inner = formula(scan, depth + 1)?;
        scan.need(" )", "an operation or )")?;
        return Ok(inner);
    }
    if scan.rest().starts_with('Q') {
        return scan.parameter(WHAT).map(Expr::Var);
    }
    if scan.rest().starts_with(['+', '-']) {
        return scan.signed(WHAT);
    }
    scan.unsigned(WHAT).map(Expr::Number)
}
