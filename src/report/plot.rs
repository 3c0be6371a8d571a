//! Plots in the terminal: braille where a person looks, plain ASCII in a pipe.

use unicode_plot::border::BorderType;
use unicode_plot::canvas::CanvasType;
use unicode_plot::{LineplotOptions, Plot, lineplot, scatterplot};

/// What a plot is drawn on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Paper {
    /// Columns of the terminal.
    pub width: usize,
    /// Letters, digits and signs only.
    pub ascii: bool,
    /// May colour be used?
    pub colour: bool,
}

impl Paper {
    /// Columns that are left for the canvas itself beside the numbers of the axis.
    fn canvas(&self) -> usize {
        self.width.saturating_sub(16).clamp(20, 120)
    }

    fn options(&self, title: &str, height: usize) -> LineplotOptions {
        let mut options = LineplotOptions::default();
        options.title = Some(title.to_owned());
        options.width = self.canvas();
        options.height = height;
        options.margin = 1;
        options.canvas = if self.ascii { CanvasType::Dot } else { CanvasType::Braille };
        options.border = if self.ascii { BorderType::Corners } else { BorderType::Solid };
        options.grid = true;
        options
    }

    fn text(&self, plot: Plot<unicode_plot::GridCanvas>) -> String {
        let mut bytes = Vec::new();
        if plot.render(&mut bytes, self.colour).is_err() {
            return String::new();
        }
        let text = String::from_utf8_lossy(&bytes).into_owned();
        // the crate's borders are no ASCII: the shape of the frame is kept
        let text = if self.ascii { text.chars().map(plain).collect() } else { text };
        text.lines().map(str::trim_end).collect::<Vec<_>>().join("\n") + "\n"
    }
}

/// The nearest ASCII sign.
fn plain(c: char) -> char {
    match c {
        c if c.is_ascii() => c,
        '─' | '━' | '⠤' | '⠒' => '-',
        '│' | '┃' | '⡇' => '|',
        '┌' | '┐' | '└' | '┘' | '┼' | '├' | '┤' => '+',
        '·' => '.',
        '…' => '~',
        _ => ' ',
    }
}

/// Points; empty where none is finite.
#[must_use]
pub fn scatter(title: &str, points: &[(f64, f64)], paper: Paper) -> String {
    let finite: Vec<(f64, f64)> = points.iter().copied().filter(|(x, y)| x.is_finite() && y.is_finite()).collect();
    let (x, y): (Vec<f64>, Vec<f64>) = finite.into_iter().unzip();
    scatterplot(&x, &y, paper.options(title, 10)).map_or_else(|_| String::new(), |plot| paper.text(plot))
}

/// A line through points in their order; empty where fewer than two are finite.
#[must_use]
pub fn line(title: &str, points: &[(f64, f64)], paper: Paper) -> String {
    let finite: Vec<(f64, f64)> = points.iter().copied().filter(|(x, y)| x.is_finite() && y.is_finite()).collect();
    if finite.len() < 2 {
        return String::new();
    }
    let top = finite.iter().map(|p| p.1).fold(0.0, f64::max);
    let (x, y): (Vec<f64>, Vec<f64>) = finite.into_iter().unzip();
    let mut options = paper.options(title, 8);
    options.ylim = (0.0, if top > 0.0 { 1.05 * top } else { 1.0 });
    lineplot(&x, &y, options).map_or_else(|_| String::new(), |plot| paper.text(plot))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plot_fits_its_paper_and_is_ascii_where_asked() {
        let points: Vec<(f64, f64)> = (0..60).map(|i| (f64::from(i), 1e-3 * f64::from(i * i))).collect();
        for width in [80, 160] {
            for ascii in [true, false] {
                let text = scatter("residual", &points, Paper { width, ascii, colour: false });
                assert!(text.lines().count() > 10, "{text}");
                assert!(text.lines().all(|l| l.chars().count() <= width), "{text}");
                assert_eq!(text.is_ascii(), ascii, "{text}");
                assert!(!text.contains('\u{1b}'));
            }
        }
        assert!(scatter("none", &[], Paper { width: 80, ascii: true, colour: false }).is_empty());
        assert!(line("one", &[(1.0, 1.0)], Paper { width: 80, ascii: true, colour: false }).is_empty());
    }
}
