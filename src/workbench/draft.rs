//! The formula box: an effect as a person types it, checked with the place of each mistake in the line that was typed.

use super::session::Refused;
use crate::diag::{Failure, Finding, source};
use crate::fit::candidates::{NO_VALUE_HELP, NoValue, without_value};
use crate::machine::Machine;
use crate::model::catalogue::Catalogue;
use crate::model::formula::{Formula, VARIABLES};
use crate::model::predict::Observation;
use crate::model::{degrees_in_formula, formula_errors};
use serde::{Deserialize, Serialize};
use toml_edit::{Array, ArrayOfTables, DocumentMut, InlineTable, Item, Table, value};

/// Longest text of one field, in bytes.
const LONGEST: usize = 600;

/// Most terms and shapes of an effect that is typed.
const MOST_ROWS: usize = 24;

/// An effect as it was typed.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Draft {
    /// Short name, used in studies.
    pub id: String,
    /// Name for people.
    #[serde(default)]
    pub name: String,
    #[serde(default)]
    pub says: String,
    /// How to confirm it on the machine.
    #[serde(default)]
    pub look: String,
    /// An axis of the chain, or base, tool, workpiece, block, trigger, reading.
    pub at: String,
    /// What each has a size of its own: `block` or `run`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub per: Option<String>,
    /// The displacements.
    pub terms: Vec<DraftTerm>,
    /// Parameters that stand inside the formulas.
    #[serde(default)]
    pub shape: Vec<DraftShape>,
}

/// A displacement as it was typed.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DraftTerm {
    /// Name of its factor.
    pub parameter: String,
    /// Unit of the factor.
    pub unit: String,
    /// dx dy dz rx ry rz, r, or the letter of an axis.
    pub dof: String,
    /// The function of the state.
    pub formula: String,
    /// Usual size of the factor, in its unit; none counts as the unit's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub typical: Option<f64>,
}

/// A parameter inside the formulas, as it was typed.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DraftShape {
    /// Its name in the formulas.
    pub parameter: String,
    pub unit: String,
    /// Where the search begins.
    pub start: f64,
    /// Lowest value.
    pub min: Option<f64>,
    /// Highest value.
    pub max: Option<f64>,
}

/// What is wrong with a draft, and where it was typed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Mistake {
    /// `id`, `at`, `terms.0.formula`, …; empty where it is the whole.
    pub field: String,
    /// First sign that is wrong, counted in signs from 0; none where it is the whole field.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub from: Option<usize>,
    /// The sign behind the last one that is wrong.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub to: Option<usize>,
    /// What is wrong.
    pub message: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub help: Option<String>,
}

impl Mistake {
    fn new(field: impl Into<String>, message: impl Into<String>, help: &str) -> Self {
        Self { field: field.into(), from: None, to: None, message: message.into(), help: Some(help.into()) }
    }
}

impl Draft {
    /// The draft that a row of an effects file is.
    ///
    /// # Errors
    /// When the row has what the form does not.
    pub fn from_row(toml: &str) -> crate::diag::Result<Self> {
        #[derive(Deserialize)]
        struct Rows {
            effect: [Draft; 1],
        }
        let rows: Rows = toml::from_str(toml).map_err(|e| {
            Failure::new("workbench::row", format!("the formula does not fit into the form: {}", e.message()))
                .help("`axiscal sketch-effect` writes it into a file")
        })?;
        let [draft] = rows.effect;
        Ok(draft)
    }
}

/// The row of the effects file.
#[must_use]
pub fn row(draft: &Draft) -> String {
    let mut tables = ArrayOfTables::new();
    tables.push(table(draft));
    let mut doc = DocumentMut::new();
    doc["effect"] = Item::ArrayOfTables(tables);
    doc.to_string()
}

fn table(draft: &Draft) -> Table {
    let mut table = Table::new();
    table["id"] = value(&draft.id);
    for (word, text) in [("name", &draft.name), ("says", &draft.says), ("look", &draft.look)] {
        if !text.trim().is_empty() {
            table[word] = value(text.trim());
        }
    }
    table["at"] = value(&draft.at);
    if let Some(per) = &draft.per {
        table["per"] = value(per);
    }
    let mut terms = Array::new();
    for t in &draft.terms {
        let mut term = InlineTable::new();
        for (word, text) in [("parameter", &t.parameter), ("unit", &t.unit), ("dof", &t.dof), ("formula", &t.formula)] {
            term.insert(word, text.trim().into());
        }
        if let Some(typical) = t.typical {
            term.insert("typical", typical.into());
        }
        terms.push(term);
    }
    table["terms"] = value(in_lines(terms));
    let mut shapes = Array::new();
    for s in &draft.shape {
        let mut shape = InlineTable::new();
        shape.insert("parameter", s.parameter.trim().into());
        shape.insert("unit", s.unit.trim().into());
        shape.insert("start", s.start.into());
        for (word, bound) in [("min", s.min), ("max", s.max)] {
            if let Some(bound) = bound {
                shape.insert(word, bound.into());
            }
        }
        shapes.push(shape);
    }
    if !shapes.is_empty() {
        table["shape"] = value(in_lines(shapes));
    }
    table
}

/// The effects file with the draft in the place of the row of that id; what the form does not ask for stays as it is.
/// Nothing where no single row has that id.
#[must_use]
pub fn replaced(before: &str, draft: &Draft) -> Option<String> {
    let mut doc: DocumentMut = before.parse().ok()?;
    let rows = doc.get_mut("effect")?.as_array_of_tables_mut()?;
    let is_own = |row: &Table| row.get("id").and_then(Item::as_str) == Some(draft.id.as_str());
    if rows.iter().filter(|row| is_own(row)).count() != 1 {
        return None;
    }
    let row = rows.iter_mut().find(|row| is_own(row))?;
    let typed = table(draft);
    if typed.get("shape").is_none() {
        row.remove("shape");
    }
    for (word, item) in typed {
        let same = row.get(&word).is_some_and(|old| old.to_string().trim() == item.to_string().trim());
        if !same {
            row.insert(&word, item);
        }
    }
    Some(doc.to_string())
}

/// The row of that id stands in a file that the form does not write.
#[must_use]
pub fn elsewhere(draft: &Draft, file: &str) -> Mistake {
    let message = format!("effect {:?} exists already, and not once in {file}", draft.id);
    Mistake::new("id", message, "choose another short name, or change it in its own file")
}

/// One item a line, as a person would write it.
fn in_lines(mut array: Array) -> Array {
    for item in array.iter_mut() {
        item.decor_mut().set_prefix("\n  ");
    }
    array.set_trailing("\n");
    array.set_trailing_comma(true);
    array
}

/// The effects file with the draft at its end.
#[must_use]
pub fn appended(before: &str, draft: &Draft) -> String {
    let gap = match before.trim_end() {
        "" => "",
        _ if before.ends_with('\n') => "\n",
        _ => "\n\n",
    };
    format!("{before}{gap}{}", row(draft))
}

/// A draft that can be fitted.
#[derive(Debug)]
pub struct Typed {
    /// The catalogue with the draft in it.
    pub catalogue: Catalogue,
    /// The id under which it stands there.
    pub id: String,
    /// Is it a new form of an effect of the user's own?
    pub replaces: bool,
    /// What can be fitted and may not be what is meant: degrees where radians are.
    pub hints: Vec<Mistake>,
}

/// The catalogue with the draft in it. An effect of the user's own that is not in the model may be typed anew: it then
/// stands there under another id, beside the old one.
///
/// # Errors
/// What is wrong with it, each with its field.
pub fn check(draft: &Draft, catalogue: &Catalogue, model: &[String]) -> Result<Typed, Vec<Mistake>> {
    let mut mistakes = words(draft);
    let replaces = catalogue.iter().any(|e| e.id == draft.id && !e.built_in);
    if replaces && model.contains(&draft.id) {
        let help = "switch it off to change it, or choose another short name";
        mistakes.push(Mistake::new("id", format!("effect {:?} is in the model", draft.id), help));
    }
    let shapes: Vec<&str> = draft.shape.iter().map(|s| s.parameter.trim()).collect();
    for (i, t) in draft.terms.iter().enumerate() {
        if let Err(message) = Formula::parse(t.formula.trim(), &shapes) {
            let lead = t.formula.len() - t.formula.trim_start().len();
            let found = formula_errors::find(t.formula.trim(), &shapes);
            let help = found.as_ref().and_then(|m| m.help).map(str::to_owned);
            let at = found.map_or(0..t.formula.trim().len(), |m| m.at);
            let signs = |byte: usize| t.formula.get(..lead + byte).map_or(0, |text| text.chars().count());
            let (from, to) = (signs(at.start), signs(at.end));
            mistakes.push(Mistake {
                field: format!("terms.{i}.formula"),
                from: Some(from),
                to: Some(to),
                message,
                help,
            });
        }
    }
    if !mistakes.is_empty() {
        return Err(mistakes);
    }
    let mut id = draft.id.clone();
    while replaces && catalogue.knows(&id) {
        id += "-typed";
    }
    let text = row(&Draft { id: id.clone(), ..draft.clone() });
    let mut all = catalogue.clone();
    match all.add_file(&source("formula box", text.clone())) {
        Ok(_) => Ok(Typed { catalogue: all, id, replaces, hints: hints(draft, &shapes) }),
        Err(Failure(findings)) => Err(findings.iter().map(|f| from_finding(f, &text, draft)).collect()),
    }
}

fn hints(draft: &Draft, shapes: &[&str]) -> Vec<Mistake> {
    let of = |(i, t): (usize, &DraftTerm)| {
        let found = degrees_in_formula::find(t.formula.trim(), shapes)?;
        Some(Mistake::new(format!("terms.{i}.formula"), found.to_string(), &found.remedy()))
    };
    draft.terms.iter().enumerate().filter_map(of).collect()
}

/// The formulas of a draft that have no value at some of the touches.
///
/// # Errors
/// Each as a mistake in its field.
pub fn check_values(draft: &Draft, typed: &Typed, machine: &Machine, touches: &[Observation]) -> Result<(), Refused> {
    let Some(effect) = typed.catalogue.get(&typed.id, machine) else { return Ok(()) };
    let mistake = |bad: &NoValue| Mistake {
        field: format!("terms.{}.formula", bad.term),
        from: None,
        to: None,
        message: crate::words::fit::no_value_of_formula(bad),
        help: Some(NO_VALUE_HELP.to_owned()),
    };
    let mistakes: Vec<Mistake> =
        without_value(effect, touches).iter().filter(|bad| bad.term < draft.terms.len()).map(mistake).collect();
    if mistakes.is_empty() { Ok(()) } else { Err(Refused::Mistakes(mistakes)) }
}

/// What the file's own form would let pass, but a person cannot mean.
fn words(draft: &Draft) -> Vec<Mistake> {
    let mut out = Vec::new();
    let id = &draft.id;
    let good = !id.is_empty()
        && id.len() <= 40
        && id.starts_with(|c: char| c.is_ascii_lowercase())
        && id.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-');
    if !good {
        out.push(Mistake::new(
            "id",
            "the short name is not usable",
            "small letters, digits and -, a letter first, up to 40 signs: my-sag",
        ));
    }
    if draft.terms.is_empty() || draft.terms.len() > MOST_ROWS || draft.shape.len() > MOST_ROWS {
        out.push(Mistake::new("", format!("an effect has 1 to {MOST_ROWS} terms"), "add a term, or take some away"));
    }
    let fields = [("name", &draft.name), ("says", &draft.says), ("look", &draft.look), ("at", &draft.at)];
    let mut all: Vec<(String, &String)> = fields.iter().map(|(w, t)| ((*w).to_owned(), *t)).collect();
    for (i, t) in draft.terms.iter().enumerate() {
        for (w, text) in [("parameter", &t.parameter), ("unit", &t.unit), ("dof", &t.dof), ("formula", &t.formula)] {
            all.push((format!("terms.{i}.{w}"), text));
        }
    }
    for (i, s) in draft.shape.iter().enumerate() {
        all.push((format!("shape.{i}.parameter"), &s.parameter));
        all.push((format!("shape.{i}.unit"), &s.unit));
    }
    for (field, text) in all {
        if text.len() > LONGEST || text.chars().any(char::is_control) {
            out.push(Mistake::new(field, "too long, or more than one line", "write it shorter, in one line"));
        }
    }
    out
}

/// A finding about the row, as a mistake in the field that it is about.
fn from_finding(f: &Finding, text: &str, draft: &Draft) -> Mistake {
    let help = f.help.clone();
    let field = f.span.as_ref().and_then(|span| {
        let wrong = text.get(span.clone())?.trim_matches(['"', '\'']);
        // which of the terms, and of the shapes behind them: those whose own line begins before the place
        let term = text.get(..span.start)?.matches("{ parameter").count().checked_sub(1);
        let shape = term.and_then(|i| i.checked_sub(draft.terms.len()));
        if let Some((i, s)) = shape.and_then(|i| draft.shape.get(i).map(|s| (i, s))) {
            let known = [("parameter", &s.parameter), ("unit", &s.unit)];
            let word = known.iter().find(|(_, typed)| typed.trim() == wrong).map_or("start", |(w, _)| *w);
            return Some(format!("shape.{i}.{word}"));
        }
        let found = match term.and_then(|i| draft.terms.get(i).map(|t| (i, t))) {
            Some((i, t)) => [("parameter", &t.parameter), ("unit", &t.unit), ("dof", &t.dof), ("formula", &t.formula)]
                .iter()
                .find(|(_, typed)| typed.trim() == wrong)
                .map(|(w, _)| format!("terms.{i}.{w}")),
            None if wrong == draft.id => Some("id".to_owned()),
            None if wrong == draft.at => Some("at".to_owned()),
            None => None,
        };
        found.or_else(|| (wrong == draft.at).then(|| "at".to_owned()))
    });
    Mistake { field: field.unwrap_or_default(), from: None, to: None, message: f.message.clone(), help }
}

/// What each variable of a formula is.
pub const MEANING: [(&str, &str); VARIABLES.len()] = [
    ("X", "position of X, mm"),
    ("Y", "position of Y, mm"),
    ("Z", "position of Z, mm"),
    ("A", "position of A, radians"),
    ("B", "position of B, radians"),
    ("C", "position of C, radians"),
    ("t", "hours since the first touch of the study"),
    ("T", "temperature, °C (20 where the log has none)"),
    ("nx", "outward normal of the touched face, its X part, in the machine's frame"),
    ("ny", "the same, its Y part"),
    ("nz", "the same, its Z part"),
    ("mx", "outward normal in the probe's frame, which turns with head and spindle, its x part"),
    ("my", "the same, its y part"),
    ("mz", "the same, its z part"),
    ("sX", "direction of the last motion of X: +1 or -1, 0 while it is not known"),
    ("sY", "direction of the last motion of Y"),
    ("sZ", "direction of the last motion of Z"),
    ("sA", "direction of the last motion of A"),
    ("sB", "direction of the last motion of B"),
    ("sC", "direction of the last motion of C"),
    ("feed", "feed of the touch, mm/min"),
    ("S", "turn of the spindle (M19), radians"),
    ("gx", "which way is down, in the tool's frame, its x part"),
    ("gy", "the same, its y part"),
    ("gz", "the same, its z part: -1 for an upright spindle"),
    ("L", "pivot to ball of this stylus, mm"),
    ("L0", "pivot to ball of the machine's own stylus, mm"),
    ("bx", "outward normal in the frame of what carries the block, all axes at 0, its x part"),
    ("by", "the same, its y part"),
    ("bz", "the same, its z part"),
    ("px", "planned contact, in the frame of what carries the block, x, mm"),
    ("py", "the same, y, mm"),
    ("pz", "the same, z, mm"),
    ("ox", "from the carrier's centre line to the block, unit vector, x part"),
    ("oy", "the same, y part"),
    ("oz", "the same, z part"),
    (
        "edge",
        "length of the block along the touched face's normal, mm; of what is round its diameter, of a hole the negative one",
    ),
    ("wA", "where A stood before it came to this place, radians"),
    ("wB", "the same of B"),
    ("wC", "the same of C"),
    ("wayA", "how far A has gone since it last reversed, radians, with the sign of its direction"),
    ("wayB", "the same of B"),
    ("wayC", "the same of C"),
    ("speed1", "speed of the spindle in the latest stretch in which it ran, over the highest of the study"),
    ("on1", "when that stretch began, hours after the first touch"),
    ("off1", "when it ended, hours; now, while it runs"),
    ("speed2", "the same of the stretch before"),
    ("on2", "the same of the stretch before"),
    ("off2", "the same of the stretch before"),
    ("speed3", "the same of the third last"),
    ("on3", "the same of the third last"),
    ("off3", "the same of the third last"),
    ("speed4", "the same of the fourth last"),
    ("on4", "the same of the fourth last"),
    ("off4", "the same of the fourth last"),
    ("hx", "which way is down, in the frame of what carries the block, its x part"),
    ("hy", "the same, its y part"),
    ("hz", "the same, its z part: -1 while the table is level"),
];

#[cfg(test)]
mod tests {
    use super::*;

    fn draft(formula: &str) -> Draft {
        Draft {
            id: "my-sag".into(),
            name: "It \"sags\"".into(),
            at: "B".into(),
            terms: vec![DraftTerm {
                parameter: "sag".into(),
                unit: "um".into(),
                dof: "dz".into(),
                formula: formula.into(),
                typical: None,
            }],
            ..Draft::default()
        }
    }

    #[test]
    fn a_row_is_the_draft_that_wrote_it() {
        let mut written = draft("1 - exp(-t/tau)");
        written.per = Some("block".into());
        written.terms[0].typical = Some(2.5);
        written.shape.push(DraftShape {
            parameter: "tau".into(),
            unit: "h".into(),
            start: 0.5,
            min: Some(0.1),
            max: None,
        });
        assert_eq!(Draft::from_row(&row(&written)).unwrap(), written);
        assert!(Draft::from_row("[[effect]]\nid = 3").is_err());
    }

    #[test]
    fn every_variable_has_its_meaning() {
        assert_eq!(MEANING.map(|m| m.0), VARIABLES);
    }

    #[test]
    fn a_good_draft_is_a_row_of_an_effects_file() {
        let built_in = Catalogue::built_in().unwrap();
        let all = check(&draft("1 - cos(B)"), &built_in, &[]).unwrap().catalogue;
        assert!(all.knows("my-sag") && !built_in.knows("my-sag"));
        let two = appended(
            "# mine\n[[effect]]\nid = \"other\"\nat = \"B\"\nterms = [{ parameter = \"p\", unit = \"um\", dof = \"dx\", formula = \"B\" }]",
            &draft("1 - cos(B)"),
        );
        let mut read = Catalogue::default();
        read.add_file(&source("f", two.clone())).unwrap();
        assert!(read.knows("my-sag") && read.knows("other") && two.starts_with("# mine"), "{two}");
    }

    #[test]
    fn an_effect_of_ones_own_is_typed_anew_while_it_is_out_of_the_model() {
        let mut all = Catalogue::built_in().unwrap();
        let before = appended("# mine\n", &draft("1 - cos(B)")).replace("at = ", "mends = \"oil\"\nat = ");
        all.add_file(&source("f", before.clone())).unwrap();
        let typed = check(&draft("sin(B)"), &all, &[]).unwrap();
        assert!(typed.replaces && typed.id != "my-sag" && typed.catalogue.knows(&typed.id));
        assert_eq!(check(&draft("sin(B)"), &all, &["my-sag".to_owned()]).unwrap_err()[0].field, "id");
        // the same again changes nothing; another formula takes the place of the old one, and the rest stays
        let mut same = draft("1 - cos(B)");
        assert_eq!(replaced(&before, &same).unwrap(), before);
        same.terms[0].formula = "sin(B)".into();
        let after = replaced(&before, &same).unwrap();
        assert!(
            after.starts_with("# mine\n") && after.contains("mends = \"oil\"") && after.contains("\"sin(B)\""),
            "{after}"
        );
        assert!(!after.contains("cos") && after.matches("[[effect]]").count() == 1, "{after}");
        Catalogue::built_in().unwrap().add_file(&source("f", after)).unwrap();
        assert_eq!(replaced("# none\n", &same), None);
        assert_eq!(replaced(&format!("{before}\n{before}"), &same), None);
    }

    #[test]
    fn a_formula_without_a_value_has_its_field() {
        let machine = crate::machine::built_in("swivel-head").unwrap().unwrap();
        let mut d = draft("1");
        d.terms.push(DraftTerm { formula: " 1 / C ".into(), ..d.terms[0].clone() });
        let typed = check(&d, &Catalogue::built_in().unwrap(), &[]).unwrap();
        let touch = Observation {
            run: 0,
            id: 1,
            set_up: 0,
            point: nalgebra::Vector3::zeros(),
            normal: nalgebra::Vector3::z(),
            surface: crate::model::surface::Surface::Plane {
                point: nalgebra::Vector3::zeros(),
                normal: nalgebra::Vector3::z(),
            },
            ball_radius: 3.0,
            ball_at_zero: nalgebra::Vector3::zeros(),
            position: crate::axes::Position::default(),
            state: [0.0; VARIABLES.len()],
            has_temperature: false,
        };
        let touches = [touch.clone(), touch];
        let Err(Refused::Mistakes(mistakes)) = check_values(&d, &typed, &machine, &touches) else {
            panic!("no mistake")
        };
        assert_eq!((mistakes.len(), mistakes[0].field.as_str()), (1, "terms.1.formula"));
        assert!(mistakes[0].message.contains("has no value at 2 touches"), "{}", mistakes[0].message);
    }

    #[test]
    fn mistakes_have_their_place() {
        let built_in = Catalogue::built_in().unwrap();
        for (formula, from, to) in [
            ("1 - cos(Q)", 8, 9),
            ("  1 - kos(B)", 6, 9),
            ("1 - cos(B", 7, 8),
            ("B) + 1", 1, 2),
            ("B +", 2, 3),
            ("", 0, 0),
            ("B ° 2", 2, 3),
            ("BB + B", 0, 2),
            ("BB + B + Ω", 9, 10),
        ] {
            let mistakes = check(&draft(formula), &built_in, &[]).unwrap_err();
            let first = &mistakes[0];
            assert_eq!(first.field, "terms.0.formula", "{formula}");
            assert_eq!((first.from, first.to), (Some(from), Some(to)), "{formula}: {}", first.message);
        }
    }

    #[test]
    fn mistakes_of_other_fields_name_the_field() {
        let built_in = Catalogue::built_in().unwrap();
        let good = draft("1 - cos(B)");
        let with = |change: &dyn Fn(&mut Draft)| {
            let mut d = good.clone();
            change(&mut d);
            check(&d, &built_in, &[]).unwrap_err()[0].field.clone()
        };
        assert_eq!(with(&|d| d.id = "../evil".into()), "id");
        assert_eq!(with(&|d| d.id = "location-b".into()), "id");
        assert_eq!(with(&|d| d.terms[0].unit = "inch".into()), "terms.0.unit");
        assert_eq!(with(&|d| d.terms[0].dof = "dq".into()), "terms.0.dof");
        assert_eq!(with(&|d| d.at = "Q".into()), "at");
        assert_eq!(with(&|d| d.terms[0].parameter = "X".into()), "terms.0.parameter");
        assert_eq!(with(&|d| d.name = "a\nb".into()), "name");
        assert_eq!(with(&|d| d.terms.clear()), "");
    }
}
