//! Masks of FN 16: what one `F-PRINT` writes, and whether it goes on with what the file holds.
//!
//! The form of masks: TNC 426/430 Technical Manual p. 6-356; M_APPEND, M_TRUNCATE, M_CLOSE as the postprocessor file says,
//! unverified.

use super::scan::Scan;
use crate::check::code::{Expr, Piece, Text, Var};
use crate::check::lines::lines;
use crate::check::run::Fault;
use crate::diag::{Failure, Finding, Result, Source};
use crate::post::Postprocessor;
use std::collections::BTreeMap;
use std::sync::Arc;

#[derive(Debug, Clone, Default)]
pub struct Mask {
    /// What the file holds is kept; `None`: the mask does not say.
    pub append: Option<bool>,
    /// The text is in the file when the block is done.
    pub closes: bool,
    /// What is written.
    pub text: Text,
}

/// The masks that lie beside a program, by name.
#[derive(Debug, Default)]
pub struct Masks(BTreeMap<String, Mask>);

impl Masks {
    /// Reads the masks that the program names.
    ///
    /// # Errors
    /// When one is not of the grammar, with its own file, line and column.
    pub fn read(program: &str, post: &Postprocessor, beside: &[(String, Source)]) -> Result<Self> {
        let wanted = wanted(program, post);
        let mut masks = BTreeMap::new();
        for (name, source) in beside.iter().filter(|(name, _)| wanted.contains(name)) {
            let mask = mask(source.inner(), post).map_err(|fault| {
                Failure::from(
                    Finding::error("check::not_understood", fault.says)
                        .help("a mask of FN 16: axiscal does not know this; what goes into the log cannot be said")
                        .at(source, fault.at),
                )
            })?;
            masks.insert(name.clone(), mask);
        }
        Ok(Self(masks))
    }

    pub fn get(&self, name: &str) -> Option<&Mask> {
        self.0.get(name)
    }
}

/// The folder of the masks on the control, as the postprocessor file has it.
pub fn folder(post: &Postprocessor) -> &str {
    post.settings.get("folder").map_or("", String::as_str)
}

/// The names of the masks that a program writes with: files that must lie beside it.
pub fn wanted(program: &str, post: &Postprocessor) -> Vec<String> {
    let mut names: Vec<String> = lines(program)
        .filter_map(|line| {
            let (_, after) = line.text.split_once("F-PRINT ")?;
            let (path, _) = after.split_once(" / ")?;
            let name = path.strip_prefix(folder(post))?;
            let plain = |c: char| c.is_ascii_alphanumeric() || "._-".contains(c);
            (name.chars().all(plain) && !name.starts_with('.') && !name.is_empty()).then(|| name.to_owned())
        })
        .collect();
    names.sort_unstable();
    names.dedup();
    names
}

fn mask(text: &str, post: &Postprocessor) -> std::result::Result<Mask, Fault> {
    let mut mask = Mask::default();
    let mut written = false;
    for line in lines(text).filter(|l| !l.text.is_empty()) {
        let mut scan = Scan::new(line, line.text, post.number.mark);
        if mask.closes {
            return Err(scan.fault("something stands behind M_CLOSE"));
        }
        if scan.take("M_CLOSE;") {
            mask.closes = true;
        } else if let Some(append) = [("M_APPEND;", true), ("M_TRUNCATE;", false)].iter().find(|(w, _)| scan.take(w)) {
            if mask.append.is_some() || written {
                return Err(Scan::new(line, line.text, '.').fault("M_APPEND or M_TRUNCATE stands first, and once"));
            }
            mask.append = Some(append.1);
        } else {
            if written {
                return Err(scan.fault("the mask writes a second line"));
            }
            written = true;
            mask.text = written_line(&mut scan)?;
        }
        if !scan.rest().is_empty() {
            return Err(scan.expected("the line's end"));
        }
    }
    if !written {
        return Err(Fault { at: text.len()..text.len(), says: "the mask writes nothing".to_owned() });
    }
    Ok(mask)
}

/// `"P N%1.0LF S%1.0LF",Q1607,Q1608;`
fn written_line(scan: &mut Scan<'_>) -> std::result::Result<Text, Fault> {
    enum Gap {
        Number { width: usize, decimals: usize },
        Text,
    }
    scan.need("\"", "M_APPEND, M_TRUNCATE, M_CLOSE or a text in quotes")?;
    let mut pieces: Vec<(String, Option<Gap>)> = Vec::new();
    loop {
        let plain = scan.rest().find(['%', '"']).ok_or_else(|| scan.expected("the quote that ends the text"))?;
        let before = scan.rest()[..plain].to_owned();
        scan.take(&before);
        if scan.take("\"") {
            pieces.push((before, None));
            break;
        }
        scan.take("%");
        let gap = if scan.take("S") {
            Gap::Text
        } else {
            const WHAT: &str = "a form such as %10.4LF or %S";
            let width = scan.whole(WHAT)? as usize;
            scan.need(".", WHAT)?;
            let decimals = scan.whole(WHAT)? as usize;
            scan.need("LF", WHAT)?;
            if width > 30 || decimals > 9 {
                return Err(scan.fault("more than 30 places, or 9 decimals"));
            }
            Gap::Number { width, decimals }
        };
        pieces.push((before, Some(gap)));
    }
    let mut text = Text::new();
    for (before, gap) in pieces {
        if !before.is_empty() {
            text.push(Piece::Text(Arc::from(before)));
        }
        match gap {
            None => {}
            Some(Gap::Number { width, decimals }) => {
                scan.need(",", "a comma and the Q parameter of the next form")?;
                let value = Expr::Var(scan.parameter("the Q parameter of a number")?);
                text.push(Piece::Fixed { decimals, width, value });
            }
            Some(Gap::Text) => {
                scan.need(",", "a comma and the QS parameter of the next form")?;
                text.push(Piece::Held(string(scan)?));
            }
        }
    }
    scan.need(";", "; behind the last parameter")?;
    Ok(text)
}

/// `QS1600`.
pub fn string(scan: &mut Scan<'_>) -> std::result::Result<Var, Fault> {
    scan.need("QS", "a QS parameter")?;
    let number = scan.whole("the number of the QS parameter")?;
    Ok(Var::named(&format!("QS{number}")))
}
