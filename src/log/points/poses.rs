//! Where the rotary axes were for each orientation of inspection results: a CSV `record,A,C`, which the user writes.

use crate::axes::{AxisMap, AxisName};
use crate::diag::{Finding, Findings, Result, Source};
use crate::log::numbers::{number, whole};
use crate::log::text_lines::Lines;
use crate::machine::Machine;
use std::collections::BTreeMap;

const FORM: &str = "write a header line `record,` and the rotary axes of the machine, then one line for each orientation of the results, counted from 1";

/// The poses by the number of their orientation, deg.
///
/// # Errors
/// When the file is not of this form; every finding has its place.
pub fn read(source: &Source, machine: &Machine) -> Result<BTreeMap<usize, AxisMap>> {
    let mut findings = Findings::default();
    let mut poses = BTreeMap::new();
    let is_text = |l: &[u8]| !l.trim_ascii().is_empty() && !l.trim_ascii().starts_with(b"#");
    let mut lines = Lines::new(source.inner().as_bytes(), 0).filter(|l| is_text(l.bytes));
    let Some(head) = lines.next() else {
        return Err(Finding::error("poses::empty", "the file has no line").help(FORM).at(source, 0..0).into());
    };
    let separator = [b';', b'\t', b','].into_iter().find(|s| head.bytes.contains(s)).unwrap_or(b',');
    let names: Vec<String> =
        head.bytes.split(|b| *b == separator).map(|f| String::from_utf8_lossy(f).trim().to_ascii_uppercase()).collect();
    let axes: Vec<Option<AxisName>> = names.iter().map(|n| rotary_axis(n, machine)).collect();
    let lacks = machine.rotary().find(|a| !axes.contains(&Some(a.name)));
    let is_good = |(name, axis): (&String, &Option<AxisName>)| axis.is_some() || name == "RECORD";
    if !names.iter().zip(&axes).all(is_good) || lacks.is_some() || names.iter().filter(|n| *n == "RECORD").count() != 1
    {
        let axes: Vec<String> = machine.rotary().map(|a| a.name.to_string()).collect();
        let message = format!("the header is not record,{}", axes.join(","));
        return Err(Finding::error("poses::header", message)
            .help(FORM)
            .at(source, head.start..head.start + head.bytes.len())
            .into());
    }
    for line in lines {
        let range = line.start..line.start + line.bytes.len();
        let values: Option<Vec<_>> = line
            .bytes
            .split(|b| *b == separator)
            .map(|f| {
                number(b'.')(f.trim_ascii())
                    .ok()
                    .filter(|(rest, n)| rest.is_empty() && n.value.is_finite())
                    .map(|p| p.1)
            })
            .collect();
        let Some(values) = values.filter(|v| v.len() == names.len()) else {
            let message = format!("expected {} numbers, with decimal points", names.len());
            findings.push(Finding::error("poses::row", message).help(FORM).at(source, range));
            continue;
        };
        let mut pose = AxisMap::default();
        let mut record = None;
        for (value, axis) in values.into_iter().zip(&axes) {
            match axis {
                Some(axis) => pose.set(*axis, value.value),
                None => record = whole(value).and_then(|n| usize::try_from(n).ok()).filter(|n| *n > 0),
            }
        }
        match record {
            None => {
                findings.push(Finding::error("poses::record", "record is not 1, 2, 3 …").help(FORM).at(source, range))
            }
            Some(record) if poses.insert(record, pose).is_some() => {
                let message = format!("record {record} appears twice");
                findings
                    .push(Finding::error("poses::twice", message).help("remove one of the lines").at(source, range));
            }
            Some(_) => {}
        }
    }
    findings.finish(poses).map(|(poses, _)| poses)
}

fn rotary_axis(name: &str, machine: &Machine) -> Option<AxisName> {
    let mut letters = name.chars();
    let axis = AxisName::from_letter(letters.next()?).filter(|_| letters.next().is_none())?;
    machine.axis(axis).filter(|a| a.name.is_rotary()).map(|a| a.name)
}
