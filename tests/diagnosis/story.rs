//! The guide's pages that tell a whole loop, run as they stand: every command of its `sh` blocks, with the file that it shows, and every line of
//! its `text` blocks must be in the answers of the commands before it.

use assert_cmd::Command;

/// Blocks of a page: (language, text).
fn blocks(page: &str) -> Vec<(String, String)> {
    let mut out = Vec::new();
    let mut lines = page.lines();
    while let Some(line) = lines.next() {
        if let Some(language) = line.strip_prefix("```").filter(|l| !l.is_empty()) {
            let text: Vec<&str> = lines.by_ref().take_while(|l| !l.starts_with("```")).collect();
            out.push((language.to_owned(), text.join("\n")));
        }
    }
    out
}

#[test]
fn the_commands_of_the_story_do_what_it_says() {
    let n_commands = run_page("story.md");
    assert!(n_commands >= 12, "{n_commands}");
}

#[test]
fn the_commands_of_the_page_of_the_sphere_do_what_it_says() {
    let n_commands = run_page("sphere.md");
    assert!(n_commands >= 10, "{n_commands}");
}

/// Runs the commands of a page of the guide; how many there are.
fn run_page(name: &str) -> usize {
    let page = std::fs::read_to_string(format!("{}/docs/guide/{name}", env!("CARGO_MANIFEST_DIR"))).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let mut said = String::new();
    let mut n_commands = 0;
    for (language, text) in blocks(&page) {
        match language.as_str() {
            "toml" | "csv" => {
                let name = text.lines().next().unwrap().trim_start_matches("# ").to_owned();
                std::fs::write(folder.path().join(name), text).unwrap();
            }
            "sh" => {
                said.clear();
                for line in text.lines() {
                    let words: Vec<&str> = line.split_whitespace().skip(1).collect();
                    assert!(line.starts_with("axiscal "), "{line}");
                    let out = Command::cargo_bin("axiscal")
                        .unwrap()
                        .current_dir(folder.path())
                        .args(&words)
                        .output()
                        .unwrap();
                    let code = out.status.code();
                    // "no" is what diagnose says as long as something is missing
                    let fine = code == Some(0) || (words[0] == "diagnose" && code == Some(1));
                    assert!(fine, "{line}: {code:?}\n{}", String::from_utf8_lossy(&out.stderr));
                    said += &String::from_utf8_lossy(&out.stdout);
                    said += &String::from_utf8_lossy(&out.stderr);
                    n_commands += 1;
                }
            }
            "text" => {
                let flat = said.split_whitespace().collect::<Vec<_>>().join(" ");
                for line in text.lines() {
                    assert!(flat.contains(line.trim()), "not said: {line}\n{said}");
                }
            }
            other => panic!("a block of {other:?} in the story"),
        }
    }
    n_commands
}

#[test]
fn the_commands_of_the_page_on_sphere_centres_do_what_it_says() {
    assert_eq!(run_page("centres.md"), 3);
}

/// The README's main command: it ends well, with a compensation and the page.
#[test]
fn the_demo_goes_to_its_end() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("demo");
    let run = Command::cargo_bin("axiscal").unwrap().arg("demo").arg("--out").arg(&out).output().unwrap();
    let said = String::from_utf8_lossy(&run.stdout);
    assert!(run.status.success(), "{said}\n{}", String::from_utf8_lossy(&run.stderr));
    assert!(said.contains("what the demo has shown") && said.contains("the end: the model is complete"), "{said}");
    // both effects that it hides are in the model at the end
    let study = std::fs::read_to_string(out.join("study.toml")).unwrap();
    assert!(study.contains("scale-y") && study.contains("positioning-c-2"), "{study}");
    for name in ["compensation/compensation.json", "report.html", "study.toml"] {
        assert!(std::fs::metadata(out.join(name)).is_ok_and(|m| m.len() > 0), "{name}");
    }
}
