//! Old values of the control, to which the identified errors are added: from its backup, and as given by hand.

use super::Request;
use crate::diag::{Failure, Finding, Result, Source, source};
use crate::files::text_of;
use crate::machine::Machine;
use crate::post::Release;
use crate::post::tables::Tables;
use crate::tables::Correction;
use crate::tables::control::{self, backup, backup::Old};
use crate::tables::linuxcnc;
use crate::workflow::Environment;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Present pins of the stock kinematics module, by their names without the module's, mm.
pub(super) fn old_pins(
    machine: &Machine,
    release: Option<&Release>,
    mm_per_unit: f64,
    request: &Request,
) -> Result<BTreeMap<String, f64>> {
    let module = release.and_then(|release| Some((linuxcnc::stock::module_of(machine, release).ok()?, release)));
    let Some((module, release)) = module else {
        return Err(Failure::new(
            "export::options",
            "--old is for the pins of a stock kinematics module, and none describes this machine",
        )
        .help(
            "leave it away: the component's pins are all written, the other old values are in the INI file (--ini)",
        ));
    };
    let numbers = release.pins.get(module.name).into_iter().flatten();
    let numbers = numbers.filter(|pin| release.direction_pin.as_ref() != Some(*pin));
    let names = numbers.map(|pin| format!("{}.{pin}", module.name)).collect();
    let mut old = Old::default();
    by_hand(&mut old, &names, request)?;
    for (value, _) in old.values.values_mut() {
        *value *= mm_per_unit;
    }
    backup::within_reach(&old, None, machine)?;
    let pin = |name: &str| name.rsplit_once('.').map_or(name, |(_, pin)| pin).to_owned();
    Ok(old.values.into_iter().map(|(name, (mm, _))| (pin(&name), mm)).collect())
}

/// Old values: the backup, and what was given by hand.
pub(super) fn old_values(
    machine: &Machine,
    tables: &Tables,
    correction: &Correction,
    request: &Request,
    env: &dyn Environment,
) -> Result<Old> {
    let names = control::names(machine, tables);
    let mut old = match request.backup {
        Some(path) => {
            let text = source(path.display().to_string(), read_backup(path, env)?);
            not_its_own(&text, correction)?;
            env.remark(written_by_an_export(&text, correction).as_slice());
            let such_as = control::example(machine, tables).unwrap_or_default();
            let old = backup::read_such_as(&text, &tables.backup, &names, &such_as)?;
            backup::within_reach(&old, Some(&text), machine)?;
            old
        }
        None => Old::default(),
    };
    by_hand(&mut old, &names, request)?;
    backup::within_reach(&old, None, machine)?;
    Ok(old)
}

/// What `--old` gives, checked against the names that there are.
fn by_hand(old: &mut Old, names: &BTreeSet<String>, request: &Request) -> Result<()> {
    for word in request.old {
        let bad = |what: &str| {
            // a table has a thousand names: the nearest are those that may be meant
            let meant = word.split('=').next().unwrap_or_default();
            let shown = crate::simulate::scenario::nearest(meant, names.iter().cloned().collect());
            let more = if names.len() > shown.len() { " …" } else { "" };
            Failure::new("export::old", format!("--old {word:?}: {what}"))
                .help(format!("write NAME=VALUE with one of: {}{more}", shown.join(", ")))
        };
        let (name, value) = word.rsplit_once('=').ok_or_else(|| bad("there is no ="))?;
        let plain = backup::plain_name(name);
        let known =
            names.iter().find(|n| backup::plain_name(n) == plain).ok_or_else(|| bad("no such value is written"))?;
        let digits = value.trim().to_owned();
        let value: f64 = digits.parse().ok().filter(|v: &f64| v.is_finite()).ok_or_else(|| bad("that is no number"))?;
        if old.values.insert(known.clone(), (value, Some(request.unit))).is_some() {
            return Err(bad("it is given twice"));
        }
        old.assumed.remove(known);
        old.texts.insert(known.clone(), digits);
    }
    Ok(())
}

/// The file that this study's own export wrote holds the new values: what was identified would be added twice.
fn not_its_own(backup: &Source, correction: &Correction) -> Result<()> {
    let text = backup.inner().to_ascii_lowercase();
    let own = text.contains(&correction.provenance.study_sha256.to_ascii_lowercase());
    if !own || text.contains("restores") || correction.provenance.study_sha256.is_empty() {
        return Ok(());
    }
    Err(Failure::new(
        "export::own_backup",
        format!("{} was written by an export of this study: its values are the new ones", backup.name()),
    )
    .help("give the control's own backup from before, or the restoring file of that export"))
}

/// New values of another export that were loaded before these touches belong into the study as `compensation`; loaded after
/// them they hold what was identified already.
fn written_by_an_export(backup: &Source, correction: &Correction) -> Option<Finding> {
    let text = backup.inner();
    let new_values = text.contains("Study sha256:") && !text.to_ascii_lowercase().contains("restores");
    (new_values && correction.active.is_none() && correction.transformation).then(|| {
        Finding::warning(
            "export::written_before",
            format!("{} has the new values of an export, and the study names no compensation", backup.name()),
        )
        .help("if they were loaded when these touches were made, name that export as `compensation` in the study; if not, give what the control held then")
    })
}

/// A backup's text: controls write remarks in code pages of their own, and names and numbers in ASCII.
fn read_backup(path: &Path, env: &dyn Environment) -> Result<String> {
    let bytes = env.read(path)?;
    let single = std::str::from_utf8(&bytes).is_err() && !bytes.contains(&0);
    if single { Ok(bytes.iter().map(|b| char::from(*b)).collect()) } else { text_of(path, bytes) }
}
