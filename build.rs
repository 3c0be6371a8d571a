//! The built-in catalogue is read once, while the program is built: `effects.toml`, row by row, as MessagePack, which a process
//! reads in a tenth of the time, and its formulas as program text. Nothing is changed here, and nothing is checked but that a formula can
//! be read: tests compare what comes of both with what a user's file becomes (`model::catalogue`).

#[path = "src/model/spelling.rs"]
mod spelling;
#[path = "src/model/words.rs"]
#[allow(dead_code)] // only the names are needed here
mod words;

use spelling::{Steps, bare_number, fold};
use std::collections::BTreeSet;
use std::error::Error;
use std::fmt::Write as _;
use std::path::PathBuf;
use words::{One, Two};

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=src/model/spelling.rs");
    println!("cargo::rerun-if-changed=src/model/words.rs");
    println!("cargo::rerun-if-changed=effects.toml");
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    let file: toml::Table = toml::from_str(&std::fs::read_to_string("effects.toml")?)?;
    let rows = file.get("effect").and_then(toml::Value::as_array).ok_or("effects.toml has no [[effect]]")?;
    let (mut bytes, mut ends) = (Vec::new(), Vec::new());
    for row in rows {
        let id = row.get("id").and_then(toml::Value::as_str).ok_or("a row of effects.toml has no id")?;
        bytes.extend(rmp_serde::to_vec_named(row)?);
        ends.push((id, bytes.len()));
    }
    std::fs::write(out.join("effects.msgpack"), &bytes)?;
    std::fs::write(out.join("effects_ends.rs"), format!("&{ends:?}"))?;
    std::fs::write(out.join("formulas.rs"), formulas(rows)?)?;
    Ok(())
}

/// Every formula of the rows, in the order of their texts, as `model::expression::built_in` has them.
fn formulas(rows: &[toml::Value]) -> Result<String, Box<dyn Error>> {
    let all = |list, word| {
        let entries = rows.iter().filter_map(move |row| row.get(list)?.as_array()).flatten();
        entries.filter_map(move |entry| entry.get(word)?.as_str()).collect::<BTreeSet<&str>>()
    };
    let shapes = all("shape", "parameter");
    let (mut functions, mut table) = (String::new(), String::from("pub(super) static ALL: &[BuiltIn] = &["));
    for (i, text) in all("terms", "formula").into_iter().filter(|text| bare_number(text).is_none()).enumerate() {
        let Code { code, variables } = fold(text).map_err(|says| format!("effects.toml: formula {text:?}: {says}"))?;
        let bound: String =
            variables.iter().enumerate().map(|(at, name)| format!("let v_{name} = v[{at}]; ")).collect();
        writeln!(functions, "fn f{i}<V: Value>(v: &[V]) -> V {{ let _ = v; {bound}{code} }}")?;
        let has_shape = variables.iter().any(|name| shapes.contains(name.as_str()));
        let dual = if has_shape { format!("Some(f{i}::<Dual>)") } else { "None".to_owned() };
        writeln!(
            table,
            "BuiltIn {{ text: {text:?}, variables: &{variables:?}, value: f{i}::<f64>, dual: {dual} }},",
            variables = variables.iter().collect::<Vec<_>>()
        )?;
    }
    Ok(format!("{functions}{table}];\n"))
}

/// The text of a program that computes a part of a formula.
struct Code {
    code: String,
    variables: BTreeSet<String>,
}

impl Code {
    fn then(self, step: &str) -> Self {
        Self { code: format!("{}{step}", self.code), ..self }
    }

    fn two(mut self, name: &str, right: Self) -> Self {
        self.variables.extend(right.variables);
        Self { code: format!("{}.two(Two::{name}, {})", self.code, right.code), ..self }
    }

    fn number_of(value: f64) -> Self {
        Self { code: format!("V::number({value:?})"), variables: BTreeSet::new() }
    }
}

impl Steps for Code {
    fn number(value: f64) -> Self {
        Self::number_of(value)
    }

    fn word(name: &str) -> Self {
        words::constant(name).map_or_else(
            || Self { code: format!("v_{name}"), variables: BTreeSet::from([name.to_owned()]) },
            Self::number_of,
        )
    }

    fn negative(self) -> Self {
        self.then(".one(One::Negative)")
    }

    fn operator(self, sign: char, right: Self) -> Self {
        self.two(&format!("{:?}", Two::operator(sign)), right)
    }

    fn call(name: &str, arguments: Vec<Self>) -> Self {
        let one = One::named(name).map(|of| format!(".one(One::{of:?})"));
        let two = Two::named(name).map(|of| format!("{of:?}"));
        let mut arguments = arguments.into_iter();
        match (arguments.next(), arguments.next(), one, two) {
            (Some(x), None, Some(of), _) => x.then(&of),
            (Some(a), Some(b), _, Some(of)) => a.two(&of, b),
            // the compiler says where this is
            _ => Self { code: format!("no function {name}"), variables: BTreeSet::new() },
        }
    }

    fn in_brackets(self) -> Self {
        self
    }
}
