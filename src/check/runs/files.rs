//! Files of the control that a program writes or deletes beside its log.

use crate::check::code::{Code, Instruction, Piece, Text, Unknown, UnknownKind};
use std::ops::Range;

/// All but the log: the file into which the first line is written.
pub(super) fn others(code: &Code) -> Vec<Unknown> {
    let (mut log, mut open): (Option<&Text>, Option<&Text>) = (None, None);
    let mut named: Vec<(&Range<usize>, &Text)> = Vec::new();
    for statement in &code.statements {
        match &statement.what {
            Instruction::LogOpen { name, .. } => {
                open = Some(name);
                named.push((&statement.at, name));
            }
            Instruction::LogLine(_) => log = log.or(open),
            Instruction::LogWrite { name, .. } => {
                log = log.or(Some(name));
                named.push((&statement.at, name));
            }
            Instruction::LogDelete { name, .. } => named.push((&statement.at, name)),
            _ => {}
        }
    }
    let others = named.into_iter().filter(|(_, name)| Some(*name) != log);
    others.map(|(at, name)| Unknown { at: at.clone(), name: plain(name), kind: UnknownKind::File }).collect()
}

fn plain(name: &Text) -> String {
    let piece = |piece: &Piece| match piece {
        Piece::Text(text) => text.to_string(),
        Piece::Held(_) | Piece::Fixed { .. } => "…".to_owned(),
    };
    name.iter().map(piece).collect()
}
