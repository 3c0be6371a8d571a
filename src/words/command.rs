//! Commands that a person copies into a terminal: they run as they are written, in the folder in which the report was
//! written.

use crate::post::Postprocessor;
use crate::view::Material;
use std::path::Path;

/// What stands for the control where the touches come from no control's log.
pub(crate) const SUPPOSED_CONTROLLER: &str = "linuxcnc";

/// A word as a shell takes it: POSIX shells, cmd and PowerShell agree on double quotes around spaces.
pub(crate) fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./\\:+,=@~".contains(c);
    // what begins with a minus sign would be an option
    let word = if word.starts_with('-') { format!("./{word}") } else { word.to_owned() };
    if !word.is_empty() && word.chars().all(plain) && !word.starts_with('~') {
        return word;
    }
    // a backslash before another sign than these is one to every shell
    if word.contains(['"', '$', '`', '!', '%']) || word.contains("\\\\") || word.ends_with('\\') {
        return format!("'{}'", word.replace('\'', "'\\''"));
    }
    format!("\"{word}\"")
}

/// The same of a path.
pub(crate) fn quoted_path(path: &Path) -> String {
    quoted(&path.display().to_string())
}

/// The path of a file that the study names, as the caller of the program sees it.
pub(crate) fn beside_the_study(m: &Material, name: &str) -> String {
    m.path.parent().unwrap_or(Path::new("")).join(name).display().to_string()
}

/// Where the commands run: their paths begin there.
pub(crate) fn run_in(path: &Path) -> String {
    use std::path::Component;
    match (path.components().next(), path.components().count()) {
        (Some(Component::Normal(file)), 1) => format!("Run the commands in the folder of {}.", file.display()),
        (Some(Component::Normal(folder)), _) => {
            format!("Run the commands in the folder that contains the folder {}.", folder.display())
        }
        (Some(Component::ParentDir | Component::CurDir), _) => {
            format!("Run the commands in the folder from which the path {} leads to the study.", path.display())
        }
        _ => String::new(),
    }
}

/// The study.
pub(crate) fn study(m: &Material) -> String {
    quoted_path(m.path)
}

/// The control that wrote the logs.
pub(crate) fn controller(m: &Material) -> Option<String> {
    let is_file = |word: &str| word.ends_with(".toml") || word.contains('/');
    // others only read what another program has measured, and no program can be written for them
    let word = m.runs.iter().map(|r| r.controller).find(|c| Postprocessor::is_built_in(c) || is_file(c))?;
    Some(quoted(&if is_file(word) { beside_the_study(m, word) } else { word.to_owned() }))
}

/// `--controller NAME`.
pub(crate) fn for_controller(m: &Material) -> String {
    format!("--controller {}", controller(m).unwrap_or_else(|| SUPPOSED_CONTROLLER.to_owned()))
}

/// What must be said beside a command whose control is only supposed.
pub(crate) fn about_controller(m: &Material) -> &'static str {
    if controller(m).is_some() { "" } else { " Write the name of your control in place of linuxcnc." }
}

/// The larger program for the study's machine.
pub(crate) fn larger_program(m: &Material) -> String {
    let machines = m.machines_file.map_or_else(String::new, |file| {
        let path = beside_the_study(m, file);
        format!(" --machines {}", quoted(&path))
    });
    let built_in = crate::program::built_in().unwrap_or_default();
    let program = if crate::program::choose(built_in, "full", m.machine).is_ok() { "full" } else { "auto" };
    format!(
        "axiscal generate --machine {}{machines} --program {program} {} --out larger-program",
        quoted(&m.machine.name),
        for_controller(m)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shell_takes_every_word_as_one() {
        for (word, expected) in [
            ("study.toml", "study.toml"),
            ("a b/my study.toml", "\"a b/my study.toml\""),
            ("it's.toml", "\"it's.toml\""),
            ("$HOME.toml", "'$HOME.toml'"),
            ("a'$b", "'a'\\''$b'"),
            ("a;b", "\"a;b\""),
            ("-x.toml", "./-x.toml"),
            ("C:\\data\\study.toml", "C:\\data\\study.toml"),
            ("C:\\my data\\study.toml", "\"C:\\my data\\study.toml\""),
            ("", "\"\""),
        ] {
            assert_eq!(quoted(word), expected);
        }
    }

    #[test]
    fn commands_run_where_their_paths_begin() {
        assert_eq!(run_in(Path::new("study.toml")), "Run the commands in the folder of study.toml.");
        let below = "Run the commands in the folder that contains the folder demo.";
        assert_eq!(run_in(Path::new("demo/a/study.toml")), below);
        assert!(run_in(Path::new("../study.toml")).contains("../study.toml leads to the study"));
        assert_eq!(run_in(Path::new("/data/study.toml")), "");
    }

    #[cfg(unix)]
    #[test]
    fn a_real_shell_reads_the_words_back() {
        for word in [
            "a b",
            "it's",
            "$HOME `id` \\ \"x\"",
            "a'\"$b",
            "!x %y",
            "*?[a]{b,c}",
            "a;b&c|d>e<f(g)#h\t~",
            "é µ",
            "C:\\my data\\new",
        ] {
            let out = std::process::Command::new("sh").arg("-c").arg(format!("printf %s {}", quoted(word))).output();
            assert_eq!(String::from_utf8_lossy(&out.unwrap().stdout), word);
        }
    }
}
