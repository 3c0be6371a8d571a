//! From a postprocessor file as written to a [`Postprocessor`] that can be relied on; all findings at once.

use super::as_written::{self as w, Entry, axis_of};
use super::environment::environment;
use super::numbers::wrong_block_numbers;
use super::{CheckRule, ColumnRule, CommentRule, LogRule, NumberRule, Postprocessor, Tcp};
use crate::axes::AxisName;
use crate::diag::{Finding, Findings, Result, Source, from_toml};
use minijinja::Environment;
use std::collections::BTreeMap;
use std::ops::Range;
use toml::Spanned;

const FORMAT: &str = "axiscal-postprocessor/1";
/// G numbers of the work offsets beyond G59.
const FANUC_OFFSETS: f64 = 54.1;
const HAAS_OFFSETS: f64 = 154.0;

/// Reads and checks a postprocessor file that is complete by itself.
///
/// # Errors
/// When the text is not TOML of this form, or a template does not compile; every finding has its place and remedy.
pub(super) fn parse(source: &Source) -> Result<(Postprocessor, Findings)> {
    let text = source.inner();
    let file: w::File = toml::from_str(text).map_err(|e| {
        from_toml(&e, source, "post::not_toml")
            .help("`axiscal schema postprocessors` prints the form; `axiscal controllers show linuxcnc` an example")
    })?;
    let mut check = Check { source, findings: Findings::default(), unverified: Vec::new() };
    check.head(&file);
    let number = check.number(&file.number, file.log.unit);
    let comment = check.comment(&file.comment);
    // a file whose setting `time` is "no" writes no time
    let log = check.log(&file.log, file.settings.get("time").is_none_or(|t| t != "no"));
    let result = check.result(&file.result);
    let tcp = file.tcp.as_ref().map(|tcp| {
        check.origin("tcp", &tcp.source, &tcp.unverified, &tcp.rotary_step.span());
        let step = *tcp.rotary_step.get_ref();
        if !(step > 0.0 && step <= 30.0) {
            check.error(
                &tcp.rotary_step.span(),
                "post::rotary_step",
                format!("rotary_step is {step} deg"),
                "more than 0 and at most 30 deg: 2 is a good value",
            );
        }
        Tcp { rotary_step_deg: step, says: tcp.says.clone(), other_stylus: tcp.other_stylus, roll_over: tcp.roll_over }
    });
    if let Some(tables) = &file.tables {
        super::tables::check(&mut check, tables);
    }
    let reading = file.check.as_ref().map(|c| {
        check.origin("check", &c.source, &c.unverified, &c.from.span());
        if !c.call.is_empty() && c.dialect != w::DialectName::MacroB {
            check.error(
                &c.from.span(),
                "post::call",
                "[[check.call]] stands in the file of a control that has no G65".to_owned(),
                "it describes macros of Fanuc and Haas (dialect = \"macro-b\")",
            );
        }
        check.word("from", &c.from, |f| !f.trim().is_empty(), "the variable that the program sets to 1 near its top");
        CheckRule {
            dialect: c.dialect,
            from: c.from.get_ref().clone(),
            feed: c.feed.clone(),
            dry_run: c.dry_run.clone(),
            called_file: c.called_file.clone(),
            harmless: c.harmless.clone(),
            leaves: c.leaves.clone(),
            stays_on: c.stays_on.clone(),
            further_offsets: c.further_offsets.as_ref().map_or(FANUC_OFFSETS, |g| {
                if ![FANUC_OFFSETS, HAAS_OFFSETS].contains(g.get_ref()) {
                    let says = format!("further_offsets is {}", g.get_ref());
                    check.error(&g.span(), "post::further_offsets", says, "54.1 (Fanuc) or 154 (Haas)");
                }
                *g.get_ref()
            }),
            waits: c.waits.clone(),
            after_abort: c.after_abort.clone(),
            field_overflow: c.field_overflow,
            calls: c.call.clone(),
            log_always_open: c.log_always_open,
        }
    });
    let block_numbers = file.file.block_numbers.as_ref();
    if let Some(rule) = block_numbers
        && let Some((says, help)) = wrong_block_numbers(rule.get_ref(), file.check.as_ref().map(|c| c.dialect))
    {
        check.error(&rule.span(), "post::block_numbers", format!("block_numbers of [file]: {says}"), help);
    }
    check.releases(&file);
    let templates = check.templates(&file, &comment, &number);
    let post = Postprocessor {
        name: file.name.get_ref().clone(),
        says: file.says.clone(),
        extension: file.file.extension.get_ref().clone(),
        end_of_line: file.file.end_of_line,
        line_length: *file.file.line_length.get_ref(),
        blank_lines: file.file.blank_lines,
        block_numbers: block_numbers.map(|rule| rule.get_ref().clone()),
        based_on: file.based_on.clone(),
        name_characters: (file.file.name_characters.clone(), file.file.name_other.clone()),
        notes: file.file.notes.clone(),
        labels_per_step: file.file.labels_per_step.unwrap_or(10).clamp(1, 10),
        last_label: file.file.last_label,
        last_program: file.file.last_program,
        companions: file.companion.iter().map(|c| c.says.clone()).collect(),
        coordinates: file.number.coordinates,
        number,
        comment,
        settings: file.settings.clone(),
        result,
        cycle: file.cycle.as_ref().map(|c| (c.name.clone(), c.refused.clone())),
        touch_with_cycle: false,
        tcp,
        check: reading,
        log,
        unverified: std::mem::take(&mut check.unverified),
        tables: file.tables.clone(),
        releases: file.release.clone(),
        dry_run_mm: 0.0,
        without_dry_run: false,
        text: text.clone(),
        templates,
    };
    check.findings.finish(post)
}

pub(super) struct Check<'a> {
    source: &'a Source,
    findings: Findings,
    unverified: Vec<(String, String)>,
}

/// Digits behind the mark that lengths in inches need at least.
const INCH_DECIMALS: usize = 4;

fn power_of_ten(places: usize) -> f64 {
    10f64.powi(i32::try_from(places).unwrap_or(12))
}

impl Check<'_> {
    pub(super) fn error(&mut self, span: &Range<usize>, code: &'static str, message: String, help: &str) {
        self.findings.push(Finding::error(code, message).help(help).at(self.source, span.clone()));
    }

    /// Every statement about a control says where it comes from.
    fn origin(&mut self, entry: &str, source: &Option<String>, unverified: &Option<String>, span: &Range<usize>) {
        match (source, unverified) {
            (_, Some(why)) => self.unverified.push((entry.to_owned(), why.clone())),
            (Some(from), None) if !from.trim().is_empty() => {}
            _ => self.error(
                span,
                "post::no_source",
                format!("[{entry}] does not say where it comes from"),
                "write `source = \"manual, page\"`, or `unverified = \"why\"` where it is not verified",
            ),
        }
    }

    fn word(&mut self, what: &str, value: &Spanned<String>, good: impl Fn(&str) -> bool, help: &str) {
        if !good(value.get_ref()) {
            let message = format!("{what} is {:?}", value.get_ref());
            self.error(&value.span(), "post::word", message, help);
        }
    }

    fn head(&mut self, file: &w::File) {
        if file.format.get_ref() != FORMAT {
            let message = format!("format is {:?}, expected {FORMAT:?}", file.format.get_ref());
            self.error(&file.format.span(), "post::format", message, "write the format line of this version");
        }
        let name = |s: &str| !s.is_empty() && s.chars().all(|c| c.is_ascii_alphanumeric() || c == '-' || c == '_');
        self.word("name", &file.name, name, "letters, digits and -");
        self.word("extension", &file.file.extension, name, "letters and digits, without the dot");
        if *file.file.line_length.get_ref() < 60 {
            let span = file.file.line_length.span();
            let message = format!("line_length is {}", file.file.line_length.get_ref());
            self.error(&span, "post::line_length", message, "a program needs lines of at least 60 characters");
        }
        self.origin("file", &file.file.source, &file.file.unverified, &file.file.extension.span());
    }

    fn mark(&mut self, mark: &Spanned<String>) -> char {
        self.word("decimal_mark", mark, |m| m == "." || m == ",", "\".\" or \",\"");
        if mark.get_ref() == "," { ',' } else { '.' }
    }

    fn decimals(&mut self, decimals: &Spanned<usize>) -> usize {
        let value = *decimals.get_ref();
        if value > 9 {
            self.error(&decimals.span(), "post::decimals", format!("decimals is {value}"), "0 to 9");
        }
        value.min(9)
    }

    /// The places before the mark of a field of a size, and what is taken off a sum in it, where the file does not say them.
    fn field(
        &mut self,
        log: &w::Log,
        field: &Spanned<usize>,
        whole_places: usize,
        check_modulo: Option<f64>,
    ) -> (usize, Option<f64>) {
        let (size, decimals) = (*field.get_ref(), *log.decimals.get_ref());
        if size > 12 || size <= decimals {
            let message = format!("field_places is {size}, decimals {decimals}");
            self.error(&field.span(), "post::field_places", message, "up to 12, and more than decimals");
        }
        let left = size.min(12).saturating_sub(decimals).max(1);
        let whole = if log.whole_places.is_some() { whole_places } else { left };
        let rest = log.check_word.as_ref().filter(|_| log.check_modulo.is_none());
        (whole, check_modulo.or(rest.map(|_| power_of_ten(whole))))
    }

    fn number(&mut self, number: &w::Number, unit: w::LengthUnit) -> NumberRule {
        self.origin("number", &number.source, &number.unverified, &number.decimals.span());
        if unit == w::LengthUnit::Inch && *number.decimals.get_ref() < INCH_DECIMALS {
            let message =
                format!("the program is in inches, and its numbers have {} decimals", number.decimals.get_ref());
            let help = "three would be steps of 0.025 mm: [number] decimals = 4, with a source of its own beside it";
            self.error(&number.decimals.span(), "post::inch_decimals", message, help);
        }
        let both = |s: &str| s.contains("{axis}") && s.contains("{value}");
        self.word("word", &number.word, both, "it holds {axis} and {value}");
        NumberRule {
            decimals: self.decimals(&number.decimals),
            trailing_zeros: number.trailing_zeros,
            always_mark: number.always_mark,
            plus: number.plus,
            mark: self.mark(&number.decimal_mark),
            word: number.word.get_ref().clone(),
            unit,
            names: number.axis_names.clone(),
            numbers: number.axis_numbers.clone(),
        }
    }

    fn comment(&mut self, comment: &w::Comment) -> CommentRule {
        self.origin("comment", &comment.source, &comment.unverified, &comment.width.span());
        let mut replace = BTreeMap::new();
        for (from, to) in &comment.replace {
            let mut characters = from.chars();
            match (characters.next(), characters.next()) {
                (Some(only), None) => {
                    replace.insert(only, to.clone());
                }
                _ => self.error(
                    &comment.width.span(),
                    "post::replace",
                    format!("[comment] replace has {from:?} on the left"),
                    "one character on the left, any text on the right",
                ),
            }
        }
        let width = *comment.width.get_ref();
        if width < 20 {
            self.error(&comment.width.span(), "post::width", format!("width is {width}"), "at least 20 characters");
        }
        CommentRule {
            open: comment.open.clone(),
            close: comment.close.clone(),
            width: width.max(20),
            message_width: comment.message_width,
            replace,
            other: comment.other.clone(),
            capitals: comment.capitals,
            reserved: comment.reserved.clone(),
            reserved_prefix: comment.reserved_prefix.clone(),
        }
    }

    /// The setting `version` names one of the versions, and each says where it comes from.
    fn releases(&mut self, file: &w::File) {
        for release in &file.release {
            self.origin(&format!("release {}", release.name), &release.source, &release.unverified, &file.name.span());
        }
        let meant = file.settings.get(super::VERSION_SETTING).map_or("", String::as_str);
        if !file.release.is_empty() && !file.release.iter().any(|r| r.name == meant) {
            let names: Vec<&str> = file.release.iter().map(|r| r.name.as_str()).collect();
            let help = format!("write one of these into [settings]: {}", names.join(", "));
            self.error(&file.name.span(), "post::version", format!("version is {meant:?}"), &help);
        }
    }

    fn result(&mut self, result: &w::ResultPlaces) -> BTreeMap<AxisName, String> {
        self.origin("result", &result.source, &result.unverified, &(0..0));
        let places = [&result.x, &result.y, &result.z, &result.a, &result.b, &result.c];
        AxisName::ALL.into_iter().zip(places).filter_map(|(a, p)| p.clone().map(|p| (a, p))).collect()
    }

    fn log(&mut self, log: &w::Log, writes_time: bool) -> LogRule {
        self.origin("log", &log.source, &log.unverified, &log.file.span());
        if log.end_of_line.is_empty() {
            let help = "name at least one of \"lf\", \"crlf\", \"cr\"";
            self.error(&log.file.span(), "post::end_of_line", "[log] end_of_line is empty".into(), help);
        }
        let free = |w: &str| w.len() == 1 && w.bytes().all(|b| b.is_ascii_uppercase() && !b"XYZABCNSUHPE".contains(&b));
        let mut letter = |what: &str, word: &Option<Spanned<String>>| {
            word.as_ref().and_then(|word| {
                self.word(what, word, free, "one capital letter that is no axis and none of N S U H P E");
                word.get_ref().bytes().next()
            })
        };
        let check_word = letter("check_word", &log.check_word);
        let time_word = letter("time_word", &log.time_word);
        if let Some(word) = log.time_word.as_ref().filter(|_| check_word == time_word) {
            let help = "two words of a line need two letters";
            self.error(&word.span(), "post::word", "time_word is check_word".into(), help);
        }
        let check_modulo = log.check_modulo.as_ref().and_then(|modulo| {
            let good = *modulo.get_ref() >= 100.0 && modulo.get_ref().is_finite();
            if !good {
                let message = format!("check_modulo is {}", modulo.get_ref());
                let help = "a round number, at least 100: the first that the field of the sum cannot hold";
                self.error(&modulo.span(), "post::check_modulo", message, help);
            }
            good.then_some(*modulo.get_ref())
        });
        let whole_places = log.whole_places.as_ref().map_or(0, |places| {
            if *places.get_ref() > 12 {
                let message = format!("whole_places is {}", places.get_ref());
                self.error(&places.span(), "post::whole_places", message, "0 to 12");
            }
            (*places.get_ref()).min(12)
        });
        let (whole_places, check_modulo) = match &log.field_places {
            Some(field) => self.field(log, field, whole_places, check_modulo),
            None => (whole_places, check_modulo),
        };
        if let (Some(modulo), Some(places)) = (&log.check_modulo, check_modulo) {
            let room = power_of_ten(whole_places);
            if whole_places > 0 && places > room {
                let message = format!(
                    "check_modulo is {places}, and the field of the sum has {whole_places} places before its mark"
                );
                let help = format!("it holds less than {room}: check_modulo = {room:.1}");
                self.error(&modulo.span(), "post::check_modulo", message, &help);
            }
        }
        let mark = if self.mark(&log.decimal_mark) == ',' { b',' } else { b'.' };
        let other_mark = log.other_decimal_mark.as_ref().map(|other| if self.mark(other) == ',' { b',' } else { b'.' });
        if let Some(word) = log.other_decimal_mark.as_ref().filter(|_| other_mark == Some(mark)) {
            let help = "leave it out, or name the mark that decimal_mark does not name";
            self.error(&word.span(), "post::word", "other_decimal_mark is decimal_mark".into(), help);
        }
        let columns = log.columns.as_ref().map(|columns| {
            self.origin("log.columns", &columns.source, &columns.unverified, &columns.axes.span());
            let axes: Vec<_> = columns.axes.get_ref().iter().map(|a| axis_of(a)).collect();
            let linear = [AxisName::X, AxisName::Y, AxisName::Z];
            if linear.iter().any(|a| axes.iter().filter(|b| **b == Some(*a)).count() != 1) {
                let message = "[log.columns] axes must hold X, Y and Z once each".to_owned();
                self.error(&columns.axes.span(), "post::columns", message, "name every column from left to right");
            }
            if columns.per_touch.get_ref().iter().filter(|r| **r == w::Role::Measure).count() != 1 {
                let message = "[log.columns] per_touch must hold \"measure\" once".to_owned();
                let help = "for example [\"search\", \"release\", \"measure\"]";
                self.error(&columns.per_touch.span(), "post::per_touch", message, help);
            }
            ColumnRule {
                axes,
                decimals: columns.decimals,
                per_touch: columns.per_touch.get_ref().clone(),
                prefix: self.around_numbers("prefix", &columns.prefix, false),
                separator: self.around_numbers("separator", &columns.separator, true),
                status: self.around_numbers("status", &columns.status, true),
                suffix: self.around_numbers("suffix", &columns.suffix, true),
                unit: columns.unit,
            }
        });
        LogRule {
            characters: log.characters.clone(),
            place: log.place.clone(),
            end_of_line: log.end_of_line.clone(),
            decimals: self.decimals(&log.decimals),
            exact_decimals: log.exact_decimals,
            mark,
            other_mark,
            unit: log.unit,
            whole_places,
            padding: log.padding,
            prefix: log.prefix.clone(),
            skip: log.skip.clone(),
            time_word,
            time_decimals: log.time_decimals.map_or(self.decimals(&log.decimals), |d| d.min(9)),
            writes_time: time_word.is_some() && writes_time,
            check_word,
            check_modulo,
            columns,
        }
    }

    /// What stands before, between or behind the numbers of a row. `behind`: it follows a number, and may not go on with it.
    fn around_numbers(&mut self, key: &str, text: &Option<Spanned<String>>, behind: bool) -> String {
        let Some(text) = text else { return String::new() };
        let goes_on = |c: char| c.is_ascii_digit() || "+-.eE".contains(c);
        let value = text.get_ref();
        let bad = !value.bytes().all(|b| (b' '..=b'~').contains(&b))
            || value.trim() != value
            || (behind && value.starts_with(goes_on));
        if bad {
            let message = format!("[log.columns] {key} is {value:?}");
            let help = "printable ASCII without blanks around it; what follows a number does not begin with a digit, a sign, a point or E";
            self.error(&text.span(), "post::columns", message, help);
            return String::new();
        }
        value.clone()
    }

    fn templates(&mut self, file: &w::File, comment: &CommentRule, number: &NumberRule) -> Environment<'static> {
        // the number of a block stands in its line too
        const DIGITS: usize = 6;
        let word = |n: &Spanned<w::BlockNumbers>| n.get_ref().word.replace("{n}", "").chars().count();
        let numbered = file.file.block_numbers.as_ref().map_or(0, |n| word(n) + DIGITS);
        let room = file.file.line_length.get_ref().saturating_sub(numbered);
        let mut env = environment(comment, number, room);
        // globals reach into messages and macros too
        env.add_global("settings", minijinja::Value::from(file.settings.clone()));
        let write = &file.write;
        let entries: [(&str, &Entry); 13] = [
            ("start", &write.start),
            ("note", &write.note),
            ("setup", &write.setup),
            ("resume", &write.resume),
            ("setup_end", &write.setup_end),
            ("orient", &write.orient),
            ("rapid", &write.rapid),
            ("rotary", &write.rotary),
            ("protected", &write.protected),
            ("touch", &write.touch),
            ("retract", &write.retract),
            ("message", &write.message),
            ("end", &write.end),
        ];
        for (name, entry) in entries
            .into_iter()
            .chain(write.stop.as_ref().map(|entry| ("stop", entry)))
            .chain(write.arrived.as_ref().map(|entry| ("arrived", entry)))
            .chain(write.found.as_ref().map(|entry| ("found", entry)))
            .chain(write.shift.as_ref().map(|entry| ("shift", entry)))
            .chain(write.find_end.as_ref().map(|entry| ("find_end", entry)))
        {
            self.origin(&format!("write.{name}"), &entry.source, &entry.unverified, &entry.template.span());
            self.template(&mut env, name, &entry.template);
        }
        for (name, part) in &file.parts {
            if entries.iter().any(|(taken, _)| taken == name)
                || ["stop", "arrived", "found", "shift", "find_end", "log_file"].contains(&name.as_str())
            {
                let message = format!("[parts.{name}] has the name of a template of [write]");
                self.error(&part.template.span(), "post::part", message, "give it another name");
            }
            self.origin(&format!("parts.{name}"), &part.source, &part.unverified, &part.template.span());
            // a part stands in lines of its own, whatever follows the tag that includes it; one line end is the engine's
            let text = part.template.get_ref().trim_end_matches('\n');
            // the engine takes the line end behind a tag
            let lines = format!("{text}\n\n{}", if text.ends_with("%}") { "\n" } else { "" });
            self.template(&mut env, name, &Spanned::new(part.template.span(), lines));
        }
        for (index, companion) in file.companion.iter().enumerate() {
            let entry = format!("companion {}", without_places(companion.name.get_ref()));
            self.origin(&entry, &companion.source, &companion.unverified, &companion.template.span());
            self.template(&mut env, &format!("companion {index} name"), &companion.name);
            self.template(&mut env, &format!("companion {index}"), &companion.template);
        }
        if let Some(cycle) = &file.cycle {
            let span = cycle.template.as_ref().map_or_else(|| file.name.span(), Spanned::span);
            self.origin("cycle", &cycle.source, &cycle.unverified, &span);
            match (&cycle.template, &cycle.refused) {
                (Some(template), None) => self.template(&mut env, "cycle", template),
                (None, Some(_)) => {}
                _ => self.error(
                    &span,
                    "post::cycle",
                    "[cycle] says neither how it is called nor why it cannot serve, or both".to_owned(),
                    "write `template`, or `refused = \"why\"`",
                ),
            }
        }
        self.template(&mut env, "log_file", &file.log.file);
        env
    }

    fn template(&mut self, env: &mut Environment<'static>, name: &str, text: &Spanned<String>) {
        if let Err(e) = env.add_template_owned(name.to_owned(), text.get_ref().clone()) {
            let line = e.line().map(|l| format!(" (line {l} of the template)")).unwrap_or_default();
            let detail = e.detail().unwrap_or("not a template");
            let message = format!("template {name}: {detail}{line}");
            let help = "the templates are minijinja (Jinja2): https://docs.rs/minijinja";
            self.error(&text.span(), "post::template", message, help);
        }
    }
}

/// A name with `...` where its template fills something in.
fn without_places(template: &str) -> String {
    let mut parts = template.split("{{");
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |name, part| name + "..." + part.split_once("}}").map_or("", |(_, rest)| rest))
}
