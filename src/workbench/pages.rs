//! The page, its scripts and its styles: a fixed table of files that are embedded in the program.

use axum::http::HeaderName;

pub const PAGE: &str = include_str!("../../web/workbench.html");

/// The page before a study is open.
pub const START: &str = include_str!("../../web/start.html");

const SCRIPT: &str = "text/javascript; charset=utf-8";
const STYLE: &str = "text/css; charset=utf-8";

/// Name, kind, contents.
const ASSETS: [(&str, &str, &str); 25] = [
    ("plotly.min.js", SCRIPT, include_str!("../../web/vendor/plotly.min.js")),
    ("tokens.css", STYLE, include_str!("../../web/tokens.css")),
    ("workbench.css", STYLE, include_str!("../../web/workbench.css")),
    ("style.css", STYLE, include_str!("../../web/style.css")),
    ("start.css", STYLE, include_str!("../../web/start.css")),
    ("start.js", SCRIPT, include_str!("../../web/start.js")),
    ("ask.js", SCRIPT, include_str!("../../web/workbench/ask.js")),
    ("export.js", SCRIPT, include_str!("../../web/workbench/export.js")),
    ("main.js", SCRIPT, include_str!("../../web/workbench/main.js")),
    ("talk.js", SCRIPT, include_str!("../../web/workbench/talk.js")),
    ("events.js", SCRIPT, include_str!("../../web/workbench/events.js")),
    ("tabs.js", SCRIPT, include_str!("../../web/workbench/tabs.js")),
    ("where.js", SCRIPT, include_str!("../../web/workbench/where.js")),
    ("ladder.js", SCRIPT, include_str!("../../web/workbench/ladder.js")),
    ("next.js", SCRIPT, include_str!("../../web/workbench/next.js")),
    ("results.js", SCRIPT, include_str!("../../web/workbench/results.js")),
    ("plots.js", SCRIPT, include_str!("../../web/workbench/plots.js")),
    ("correlation.js", SCRIPT, include_str!("../../web/workbench/correlation.js")),
    ("frame.js", SCRIPT, include_str!("../../web/workbench/frame.js")),
    ("later.js", SCRIPT, include_str!("../../web/workbench/later.js")),
    ("space.js", SCRIPT, include_str!("../../web/workbench/space.js")),
    ("effects.js", SCRIPT, include_str!("../../web/workbench/effects.js")),
    ("touches.js", SCRIPT, include_str!("../../web/workbench/touches.js")),
    ("formula.js", SCRIPT, include_str!("../../web/workbench/formula.js")),
    ("words.js", SCRIPT, include_str!("../../web/workbench/words.js")),
];

/// Kind and contents of a file of the table.
#[must_use]
pub fn asset(name: &str) -> Option<(&'static str, &'static str)> {
    ASSETS.iter().find(|(n, _, _)| *n == name).map(|(_, kind, text)| (*kind, *text))
}

/// Headers of every answer: scripts of this server alone, no frame around the page, no copy kept.
pub const HEADERS: [(HeaderName, &str); 7] = [
    (
        HeaderName::from_static("content-security-policy"),
        // the plotting library writes styles; it evaluates nothing
        "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; \
         connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
    (HeaderName::from_static("x-content-type-options"), "nosniff"),
    (HeaderName::from_static("x-frame-options"), "DENY"),
    (HeaderName::from_static("referrer-policy"), "no-referrer"),
    (HeaderName::from_static("cache-control"), "no-store"),
    (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_script_that_is_imported_is_in_the_table() {
        let quoted = |text: &str, before: &str| -> Vec<String> {
            let parts = text.split(before).skip(1);
            parts.map(|p| p.split(['"', '\'']).next().unwrap_or_default().to_owned()).collect()
        };
        for name in [PAGE, START].iter().flat_map(|page| quoted(page, "\"/assets/")) {
            assert!(asset(&name).is_some(), "{name}");
        }
        for (of, _, text) in ASSETS.iter().filter(|a| a.1 == SCRIPT && a.0 != "plotly.min.js") {
            for name in quoted(text, "from \"./") {
                assert!(asset(&name).is_some(), "{name} in {of}");
            }
        }
        assert!(asset("../main.js").is_none() && asset("").is_none());
    }
}
