//! The report as one page: the view as data inside it, the scripts and styles of `web/` with it, nothing from a network.
//!
//! What comes from files of the user's own (names of effects, comments, paths) is text: escaped where it stands in HTML,
//! and without `<`, `>` and `&` where it stands in the data, so that nothing in it can end the script element.

use crate::diag::{Failure, Result};
use crate::diagnose::Verdict;
use crate::view::Level;
use crate::view::View;

const PAGE: &str = include_str!("../../web/report.html");
const STYLE: &str = concat!(include_str!("../../web/tokens.css"), include_str!("../../web/style.css"));
const SCRIPT: &str = include_str!("../../web/report.js");

/// The plots of the report and the workbench.
pub const PLOTS: &str = include_str!("../../web/plots.js");

/// The plotting library (web/vendor-source says how it was made).
pub const PLOTLY: &str = include_str!("../../web/vendor/plotly.min.js");

/// The whole page.
///
/// # Errors
/// Never for a view that JSON can hold.
pub fn page(view: &View) -> Result<String> {
    let (data, charts) = (data(view)?, data(&crate::plots::charts(view))?);
    let runs = view.study.runs.len();
    let about = format!(
        "{}: {} · {} · {} touches in {} · data of {}",
        view.machine.name,
        view.machine.says,
        view.study.name,
        view.errors.touches,
        if runs == 1 { "one run".to_owned() } else { format!("{runs} runs") },
        view.study.date
    );
    let (level, word) = match view.headline.level {
        Level::Good => ("good", "✓ In order"),
        Level::Act => ("act", "▲ Action needed"),
        Level::Unknown => ("unknown", "? Not determined yet"),
    };
    let title = format!("{} – {}", view.machine.name, view.study.name);
    // where the sentence says the figures, they are not said twice
    let detail = match view.diagnosis.answer.verdict {
        Verdict::MissingEffect(_) | Verdict::Unexplained(_) if view.headline.detail != view.headline.sentence => {
            view.headline.detail.as_str()
        }
        _ => "",
    };
    let parts: [(&str, &str); 12] = [
        ("title", &text(&title)),
        ("style", STYLE),
        ("about", &text(&about)),
        ("level", level),
        ("word", word),
        ("sentence", &text(&view.headline.sentence)),
        ("detail", &text(detail)),
        ("view", &data),
        ("charts", &charts),
        ("plotly", PLOTLY),
        ("plots", PLOTS),
        ("script", SCRIPT),
    ];
    Ok(fill(PAGE, &parts))
}

/// Fills `{{ name }}` in one pass: what is filled in is not looked at again.
fn fill(template: &str, parts: &[(&str, &str)]) -> String {
    let mut out = String::with_capacity(template.len() + parts.iter().map(|p| p.1.len()).sum::<usize>());
    let mut rest = template;
    while let Some((before, after)) = rest.split_once("{{ ") {
        out.push_str(before);
        let Some((name, after)) = after.split_once(" }}") else { break };
        out.push_str(parts.iter().find(|p| p.0 == name).map_or("", |p| p.1));
        rest = after;
    }
    out + rest
}

/// A record as JSON that may stand inside a script element.
///
/// # Errors
/// Never for one that JSON can hold.
pub fn data(record: &impl serde::Serialize) -> Result<String> {
    let json = serde_json::to_string(record)
        .map_err(|e| Failure::new("report::view", format!("the view cannot be written: {e}")))?;
    Ok(in_script(&json))
}

/// JSON without the signs that mean something to HTML: they stand in strings only, where JSON has another spelling.
fn in_script(json: &str) -> String {
    json.replace('<', "\\u003c").replace('>', "\\u003e").replace('&', "\\u0026")
}

/// Text inside HTML.
fn text(plain: &str) -> String {
    let mut out = String::with_capacity(plain.len());
    for c in plain.chars() {
        match c {
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '&' => out.push_str("&amp;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_in_the_data_ends_the_script() {
        let evil = serde_json::json!({ "name": "</script><script>alert(1)</script><!-- & \u{2028}" });
        let inside = in_script(&evil.to_string());
        assert!(!inside.contains('<') && !inside.contains('>') && !inside.contains('&'), "{inside}");
        assert_eq!(serde_json::from_str::<serde_json::Value>(&inside).unwrap(), evil);
    }

    #[test]
    fn what_is_filled_in_is_not_filled_again() {
        assert_eq!(fill("a {{ x }} {{ y }} {{ none }}.", &[("x", "{{ y }}"), ("y", "1")]), "a {{ y }} 1 .");
        assert_eq!(text("<b>\"&'"), "&lt;b&gt;&quot;&amp;&#39;");
    }

    #[test]
    fn scripts_and_styles_cannot_end_their_element_and_fetch_nothing() {
        for script in [PLOTLY, PLOTS, SCRIPT] {
            assert!(!script.to_ascii_lowercase().contains("</script"));
        }
        assert!(
            !STYLE.to_ascii_lowercase().contains("</style") && !STYLE.contains("@import") && !STYLE.contains("url(")
        );
        assert!(!PAGE.contains("src=") && !PAGE.contains("http://") && !PAGE.contains("https://"));
        assert!(PAGE.contains("default-src 'none'"));
        // without the data there is room for ten thousand touches in six megabytes
        let fixed = PLOTLY.len() + PLOTS.len() + SCRIPT.len() + STYLE.len() + PAGE.len();
        assert!(fixed < 3_000_000, "{fixed}");
    }
}
