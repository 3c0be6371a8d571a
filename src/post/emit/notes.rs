//! The notes beside a program: what was not verified on a real control, what the control needs, and its touches by number.

use super::Writer;
use crate::post::SideFile;
use crate::post::spelling::name_of;
use std::fmt::Write as _;

impl Writer<'_> {
    pub(super) fn notes_name(&self) -> String {
        let plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | '_');
        format!("{}.notes.txt", name_of(&self.plan.program, plain))
    }

    /// For the person, not for the control.
    pub(super) fn notes(&self) -> SideFile {
        let mut text = format!(
            "Notes on program {} for {}, controller {}. They stay with you, not at the control.\n",
            self.plan.program, self.machine.name, self.post.name
        );
        // writing into a String cannot fail
        if !self.post.notes.is_empty() {
            text.push_str("\nWhat the control needs\n");
            for line in &self.post.notes {
                let _ = writeln!(text, "- {line}");
            }
        }
        if !self.post.unverified.is_empty() {
            let _ = writeln!(text, "\nNot verified on a real control ({})", self.post.unverified.len());
            for (entry, why) in &self.post.unverified {
                let _ = writeln!(text, "- {entry}: {why}");
            }
        }
        text.push_str("\nTouches by number\n");
        for (first, last, says) in self.touch_ranges() {
            let _ = match last == first {
                true => writeln!(text, "{first}: {says}"),
                false => writeln!(text, "{first} to {last}: {says}"),
            };
        }
        SideFile {
            name: self.notes_name(),
            says: "what was not verified, what the control needs, the touches by number".to_owned(),
            text,
            to_control: false,
        }
    }

    /// Touches of one face that follow each other, in the order of the program.
    fn touch_ranges(&self) -> Vec<(u64, u64, &str)> {
        let mut ranges: Vec<(u64, u64, &str)> = Vec::new();
        for step in &self.path.steps {
            let Some(touch) = step.touch() else { continue };
            match ranges.last_mut() {
                Some((_, last, says)) if *says == touch.says && *last + 1 == touch.id => *last = touch.id,
                _ => ranges.push((touch.id, touch.id, &touch.says)),
            }
        }
        ranges
    }
}
