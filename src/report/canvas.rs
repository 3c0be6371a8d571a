//! Drawing with characters: points and lines in a frame, with the limits of both axes. A character holds 2 x 4 dots in braille, and two
//! dots above each other in ASCII.

const GREY: u8 = 90;
const GREEN: u8 = 32;
const WHITE: u8 = 37;

/// The dots of one character, from top to bottom: left column, right column.
const BRAILLE: [[u8; 4]; 2] = [[0x01, 0x02, 0x04, 0x40], [0x08, 0x10, 0x20, 0x80]];

/// No dot, the lower one, the upper one, both.
const ASCII: [char; 4] = [' ', '.', '\'', ':'];

/// An axis: the values at its beginning and end, and the dots along it. The vertical one begins at the top.
#[derive(Debug, Clone, Copy)]
struct Axis {
    from: f64,
    to: f64,
    dots: usize,
}

impl Axis {
    /// The dot of a value, from 0; beyond either end it is the next one outside.
    fn dot(&self, value: f64) -> i64 {
        let share = (value - self.from) / (self.to - self.from);
        let dots = self.dots as f64;
        // the end itself is inside
        let at = if value == self.to { dots - 1.0 } else { (share * dots).floor() };
        at.clamp(-1.0, dots) as i64
    }

    /// Values that have a dot each.
    fn values(self) -> impl Iterator<Item = f64> {
        (0..self.dots).map(move |i| self.from + (self.to - self.from) * (i as f64 + 0.5) / self.dots as f64)
    }
}

/// What is drawn on.
#[derive(Debug)]
pub(super) struct Canvas {
    is_ascii: bool,
    columns: usize,
    x: Axis,
    y: Axis,
    /// The dots of each character, row by row, and whether they belong to the data.
    cells: Vec<(u8, bool)>,
}

impl Canvas {
    /// An empty one with lines where either axis is 0; `None` where the limits are no range.
    pub(super) fn new((columns, rows): (usize, usize), is_ascii: bool, x: (f64, f64), y: (f64, f64)) -> Option<Self> {
        let is_range = |(low, high): (f64, f64)| low < high && (high - low).is_finite();
        if !is_range(x) || !is_range(y) || columns == 0 || rows == 0 {
            return None;
        }
        let (across, down) = if is_ascii { (1, 2) } else { (2, 4) };
        let mut canvas = Self {
            is_ascii,
            columns,
            x: Axis { from: x.0, to: x.1, dots: columns * across },
            y: Axis { from: y.1, to: y.0, dots: rows * down },
            cells: vec![(0, false); columns * rows],
        };
        canvas.zero_lines();
        Some(canvas)
    }

    fn zero_lines(&mut self) {
        let is_inside = |axis: Axis| axis.from * axis.to < 0.0;
        let (x, y) = (self.x, self.y);
        if is_inside(y) {
            x.values().for_each(|value| self.set((x.dot(value), y.dot(0.0)), false));
        }
        if is_inside(x) {
            y.values().for_each(|value| self.set((x.dot(0.0), y.dot(value)), false));
        }
    }

    fn set(&mut self, (x, y): (i64, i64), is_data: bool) {
        let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else { return };
        if x >= self.x.dots || y >= self.y.dots {
            return;
        }
        let (cell, bit) = if self.is_ascii {
            ((y / 2) * self.columns + x, 2 >> (y % 2))
        } else {
            ((y / 4) * self.columns + x / 2, BRAILLE[x % 2][y % 4])
        };
        let (bits, of_data) = &mut self.cells[cell];
        *bits |= bit;
        *of_data |= is_data;
    }

    /// Draws a point.
    pub(super) fn point(&mut self, (x, y): (f64, f64)) {
        self.set((self.x.dot(x), self.y.dot(y)), true);
    }

    /// Draws a straight line.
    pub(super) fn line(&mut self, from: (f64, f64), to: (f64, f64)) {
        let (x, y) = (self.x.dot(from.0), self.y.dot(from.1));
        let (dx, dy) = (self.x.dot(to.0) - x, self.y.dot(to.1) - y);
        let steps = dx.abs().max(dy.abs()).max(1);
        for step in 0..=steps {
            self.set((x + (dx * step).div_euclid(steps), y + (dy * step).div_euclid(steps)), true);
        }
    }

    /// The drawing in its frame, with a title above it.
    pub(super) fn text(&self, title: &str, colour: bool) -> String {
        let painted =
            |text: &str, code: u8| if colour { format!("\u{1b}[{code}m{text}\u{1b}[39m") } else { text.to_owned() };
        let frame =
            if self.is_ascii { ["+", " ", "+", " ", "+", "+"] } else { ["┌", "─", "┐", "│", "└", "┘"] };
        let [top_left, edge, top_right, side, bottom_left, bottom_right] = frame;
        let labels = (self.y.from.to_string(), self.y.to.to_string());
        let width = labels.0.len().max(labels.1.len());
        let border = |left: &str, right: &str| {
            format!("   {:width$}{}", "", painted(&format!("{left}{}{right}", edge.repeat(self.columns)), GREY))
        };
        let in_the_middle = (self.columns + width + 6).saturating_sub(title.chars().count()) / 2;
        let bold = if colour { format!("\u{1b}[1m{title}\u{1b}[22m") } else { title.to_owned() };
        let mut lines = vec![format!("{:in_the_middle$}{bold}", ""), border(top_left, top_right)];
        let rows = self.cells.chunks(self.columns);
        let last = rows.len() - 1;
        for (i, row) in rows.enumerate() {
            let label = match i {
                0 => &labels.0,
                _ if i == last => &labels.1,
                _ => "",
            };
            let label = painted(&format!("{label:>width$}"), GREY);
            let dots: String = row
                .chunk_by(|a, b| a.1 == b.1)
                .map(|same| {
                    let glyphs: String = same.iter().map(|(bits, _)| self.glyph(*bits)).collect();
                    if same[0].1 { painted(&glyphs, GREEN) } else { glyphs }
                })
                .collect();
            let side = painted(side, GREY);
            lines.push(format!("  {label} {side}{dots}{side}"));
        }
        lines.push(border(bottom_left, bottom_right));
        let (left, right) = (self.x.from.to_string(), self.x.to.to_string());
        let between = (self.columns + 2).saturating_sub(left.len() + right.len());
        let limits = painted(&format!("{left}{:between$}{right}", ""), WHITE);
        lines.push(format!("   {:width$}{limits}", ""));
        lines.iter().map(|line| line.trim_end().to_owned() + "\n").collect()
    }

    fn glyph(&self, bits: u8) -> char {
        if self.is_ascii {
            ASCII[usize::from(bits & 3)]
        } else {
            char::from_u32(0x2800 + u32::from(bits)).unwrap_or(' ')
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn canvas(is_ascii: bool) -> Canvas {
        let mut canvas = Canvas::new((8, 3), is_ascii, (0.0, 7.5), (-1.0, 2.5)).unwrap();
        canvas.point((0.0, 2.5));
        canvas.point((7.5, -1.0));
        canvas.line((0.0, -1.0), (4.0, 2.0));
        canvas
    }

    #[test]
    fn a_drawing_has_its_frame_and_limits() {
        let ascii = [
            "      title",
            "      +        +",
            "  2.5  '  .'",
            "        .'",
            "   -1  :'''''':",
            "      +        +",
            "      0      7.5",
        ];
        assert_eq!(canvas(true).text("title", false).lines().collect::<Vec<_>>(), ascii);
        let braille = [
            "      title",
            "      ┌────────┐",
            "  2.5 │⠁⠀⠀⡠⠂⠀⠀⠀│",
            "      │⠀⢀⠎⠀⠀⠀⠀⠀│",
            "   -1 │⡝⠉⠉⠉⠉⠉⠉⢉│",
            "      └────────┘",
            "      0      7.5",
        ];
        assert_eq!(canvas(false).text("title", false).lines().collect::<Vec<_>>(), braille);
    }

    #[test]
    fn colours_are_closed() {
        let text = canvas(false).text("title", true);
        let count = |code: &str| text.matches(code).count();
        assert_eq!(count("\u{1b}[39m"), count("\u{1b}[90m") + count("\u{1b}[32m") + count("\u{1b}[37m"));
        assert!(count("\u{1b}[32m") > 0 && count("\u{1b}[1m") == 1 && count("\u{1b}[22m") == 1);
    }

    #[test]
    fn what_is_no_range_has_no_drawing() {
        for (low, high) in [(1.0, 1.0), (2.0, 1.0), (f64::NAN, 1.0), (-1e308, 1e308), (0.0, f64::INFINITY)] {
            assert!(Canvas::new((8, 3), true, (low, high), (0.0, 1.0)).is_none(), "{low} {high}");
        }
        let mut canvas = Canvas::new((8, 3), true, (0.0, 1.0), (0.0, 1.0)).unwrap();
        canvas.line((-1e300, 1e300), (f64::NAN, 0.5));
        assert!(!canvas.text("", false).is_empty());
    }
}
