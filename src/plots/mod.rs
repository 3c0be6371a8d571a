//! The plots of the report without a browser: SVG and PNG for people who write reports, and the numbers behind each as CSV.
//!
//! `charts` picks from a view what is drawn, `chart` is the record of it, `on_paper` makes points and lines of it, and `render` draws these.
//! The page draws the same record (`web/plots.js`).

pub mod chart;
mod charts;
mod machine;
mod on_paper;
mod render;

pub use charts::charts;

use crate::diag::Result;
use crate::view::View;

/// Every plot of a view: name of the file, and contents.
///
/// # Errors
/// When a plot cannot be drawn.
pub fn files(view: &View) -> Result<Vec<(String, Vec<u8>)>> {
    let mut out = Vec::new();
    for chart in charts(view).iter().map(|chart| on_paper::on_paper(chart, view)) {
        out.push((format!("{}.svg", chart.name), render::svg(&chart)?.into_bytes()));
        out.push((format!("{}.png", chart.name), render::png(&chart)?));
        out.push((format!("{}.csv", chart.name), chart.to_csv().into_bytes()));
    }
    Ok(out)
}
