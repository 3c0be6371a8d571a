//! Plots in the terminal: braille where a person looks, plain ASCII in a pipe.

use super::canvas::Canvas;

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

    /// Text as this paper can show it (cells before the table is laid out: `..` is wider than `…`): in a pipe rules and signs become ASCII. `±` stays: no number is without it.
    #[must_use]
    pub fn plain(&self, text: String) -> String {
        if self.ascii {
            text.replace(['─', '━'], "-").replace('…', "..").replace('·', ".").replace('█', "#").replace('░', ":")
        } else {
            text
        }
    }

    /// Limits that a person can read: outwards to a round number, so that the axis is labelled with few digits.
    fn rounded(low: f64, high: f64) -> (f64, f64) {
        let span = high - low;
        if span <= 0.0 || !span.is_finite() {
            return (low, high);
        }
        let step = 10f64.powf((span / 10.0).log10().floor());
        let round = |x: f64, up: bool| {
            let n = x / step;
            // what is round already stays, whatever the last bit says
            let n = if (n - n.round()).abs() < 1e-9 {
                n.round()
            } else if up {
                n.ceil()
            } else {
                n.floor()
            };
            // twelve decimals: no trace of the binary form of the step
            (n * step * 1e12).round() / 1e12
        };
        (round(low, false), round(high, true))
    }

    /// A drawing with so many rows, if there is anything to draw.
    fn drawing(&self, title: &str, rows: usize, limits: [(f64, f64); 2], draw: impl FnOnce(&mut Canvas)) -> String {
        let [x, y] = limits;
        let Some(mut canvas) = Canvas::new((self.canvas(), rows), self.ascii, x, y) else { return String::new() };
        draw(&mut canvas);
        let title: String = if self.ascii { title.chars().map(plain).collect() } else { title.to_owned() };
        canvas.text(&title, self.colour)
    }
}

/// The nearest ASCII sign.
fn plain(c: char) -> char {
    match c {
        c if c.is_ascii() => c,
        '─' | '━' => '-',
        '·' => '.',
        '…' => '~',
        'µ' => 'u',
        _ => ' ',
    }
}

/// Limits of an axis with these values; room on both sides where they are all the same.
fn limits(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
    let room = if low == high { 1.0 } else { 0.0 };
    Paper::rounded(low - room, high + room)
}

fn finite(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    points.iter().copied().filter(|(x, y)| x.is_finite() && y.is_finite()).collect()
}

/// A number at an axis that spans so much: no more digits than the eye can use.
#[must_use]
pub fn axis_label(value: f64, span: f64) -> String {
    let decimals =
        if span > 0.0 && span.is_finite() { (2.0 - span.log10()).ceil().clamp(0.0, 6.0) as usize } else { 3 };
    let text = format!("{value:.decimals$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

/// Points; empty where none is finite.
#[must_use]
pub fn scatter(title: &str, points: &[(f64, f64)], paper: Paper) -> String {
    let points = finite(points);
    let limits = [limits(points.iter().map(|p| p.0)), limits(points.iter().map(|p| p.1))];
    paper.drawing(title, 10, limits, |canvas| points.iter().for_each(|p| canvas.point(*p)))
}

/// A line through points in their order; empty where fewer than two are finite.
#[must_use]
pub fn line(title: &str, points: &[(f64, f64)], paper: Paper) -> String {
    let points = finite(points);
    if points.len() < 2 {
        return String::new();
    }
    let top = points.iter().map(|p| p.1).fold(0.0, f64::max);
    let y = (0.0, if top > 0.0 { Paper::rounded(0.0, 1.05 * top).1 } else { 1.0 });
    let x = limits(points.iter().map(|p| p.0));
    paper.drawing(title, 8, [x, y], |canvas| points.windows(2).for_each(|pair| canvas.line(pair[0], pair[1])))
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
        // limits are round numbers: no 310.00000000000006 at an axis
        let odd = [(0.1 + 0.2, -6.953), (1.0, 7.01), (310.123_456, 0.0)];
        let text = scatter("odd", &odd, Paper { width: 80, ascii: true, colour: false });
        let digits = |w: &str| w.chars().filter(char::is_ascii_digit).count();
        assert!(text.split_whitespace().all(|w| digits(w) <= 3), "{text}");
        assert_eq!(axis_label(-0.000_1, 10.0), "0");
        assert_eq!(axis_label(0.123_456, 0.5), "0.123");
        assert_eq!(axis_label(359.999, 360.0), "360");
        assert!(scatter("none", &[], Paper { width: 80, ascii: true, colour: false }).is_empty());
        assert!(line("one", &[(1.0, 1.0)], Paper { width: 80, ascii: true, colour: false }).is_empty());
    }
}
