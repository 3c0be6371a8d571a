//! Tables in the width of the paper: a number is never broken, and stands beside its unit.

use comfy_table::{Cell, ColumnConstraint, Table, Width};
use textwrap::core::display_width;

/// Blanks around the content of a column.
const PADDING: usize = 2;

/// Between two columns there is one blank more, where a table with lines has its line.
const BETWEEN: usize = 1;

/// A column of text is made no narrower than this while anything else can give way.
const LEAST_WORD: usize = 6;

/// How narrow a column may become.
#[derive(Debug, Clone, Copy)]
struct Needs {
    /// Its numbers whole; names are broken.
    numbers: usize,
    /// Its figures on one line each, no word broken.
    words: usize,
    /// Nothing broken at all.
    all: usize,
}

/// Lays a table out in so many columns. Columns whose heads are `optional` are left out, the first one first, where all of
/// them would not fit with whole numbers and whole words; returned are the heads of those that were.
pub fn lay(t: &mut Table, width: usize, optional: &[&str]) -> Vec<String> {
    let n = t.column_count();
    let needs: Vec<Needs> = (0..n).map(|i| needs(t, i)).collect();
    let heads: Vec<String> = t.header().map_or_else(Vec::new, |h| h.cell_iter().map(Cell::content).collect());
    let mut shown = vec![true; n];
    let total = |shown: &[bool], of: &dyn Fn(&Needs) -> usize| -> usize {
        let each = (0..n).filter(|&i| shown[i]).map(|i| of(&needs[i]) + PADDING + BETWEEN);
        each.sum::<usize>().saturating_sub(BETWEEN)
    };
    let mut left_out = Vec::new();
    for head in optional {
        if total(&shown, &|x| x.words) <= width {
            break;
        }
        if let Some(i) = heads.iter().position(|h| h == head) {
            shown[i] = false;
            left_out.push((*head).to_owned());
        }
    }
    let whole_words = total(&shown, &|x| x.words) <= width;
    let least_of = move |x: &Needs| if whole_words { x.words } else { x.numbers };
    let least: Vec<usize> = needs.iter().map(least_of).collect();
    let free = width.saturating_sub(total(&shown, &least_of));
    let widths = grown(&least, &needs, &shown, free);
    t.set_width(width.try_into().unwrap_or(u16::MAX));
    for (i, column) in t.column_iter_mut().enumerate() {
        column.set_constraint(if shown[i] {
            ColumnConstraint::Absolute(Width::Fixed((widths[i] + PADDING).try_into().unwrap_or(u16::MAX)))
        } else {
            ColumnConstraint::Hidden
        });
    }
    left_out
}

/// What is free goes round, a column at a time, until every one has what it needs: first whole words, then whole lines.
fn grown(least: &[usize], needs: &[Needs], shown: &[bool], mut free: usize) -> Vec<usize> {
    let mut widths = least.to_vec();
    for wanted in [|x: &Needs| x.words, |x: &Needs| x.all] {
        while free > 0 {
            let before = free;
            for i in 0..widths.len() {
                if free > 0 && shown[i] && widths[i] < wanted(&needs[i]) {
                    widths[i] += 1;
                    free -= 1;
                }
            }
            if free == before {
                break;
            }
        }
    }
    widths
}

fn needs(t: &Table, column: usize) -> Needs {
    let mut out = Needs { numbers: 1, words: 1, all: 1 };
    let longest = |text: &str| text.split_whitespace().map(display_width).max().unwrap_or(0);
    if let Some(head) = t.header().and_then(|h| h.cell_iter().nth(column)).map(Cell::content) {
        out.numbers = out.numbers.max(longest(&head).min(LEAST_WORD));
        out.words = out.words.max(longest(&head));
        out.all = out.all.max(display_width(&head));
    }
    for content in t.column_cells_iter(column).flatten().map(Cell::content) {
        out.numbers = out.numbers.max(widest_number(&content)).max(longest(&content).min(LEAST_WORD));
        // a value with its uncertainty is one figure
        let figure = content.split_whitespace().all(|w| is_number(w) || is_sign(w));
        out.words = out.words.max(if figure { display_width(&content) } else { longest(&content) });
        out.all = out.all.max(content.lines().map(display_width).max().unwrap_or(0));
    }
    Needs { words: out.words.max(out.numbers), all: out.all.max(out.words).max(out.numbers), ..out }
}

/// The widest number of a text; a sign in front of it (`± 0.2`) is a part of it.
fn widest_number(text: &str) -> usize {
    let mut before = 0;
    let mut widest = 0;
    for word in text.split_whitespace() {
        let own = display_width(word);
        if is_number(word) {
            widest = widest.max(before + own);
        }
        before = if is_sign(word) { own + 1 } else { 0 };
    }
    widest
}

/// A word that is (or holds, as `B-30.0` does) a number: one letter at most beside its digits.
fn is_number(word: &str) -> bool {
    let letters = word.chars().filter(|c| c.is_alphabetic()).count();
    letters < 2 && word.chars().any(|c| c.is_ascii_digit())
}

fn is_sign(word: &str) -> bool {
    !word.chars().any(|c| c.is_alphanumeric())
}

#[cfg(test)]
mod tests {
    use super::super::fit::{number, table};
    use super::*;

    fn example() -> Table {
        let mut t = table(&["parameter", "value", "unit", "probe noise", "95 %", "status"]);
        for (name, value) in [("EXC2c", "-0.000052"), ("a-name-as-long-as-they-come", "12.3")] {
            t.add_row(vec![
                Cell::new(name),
                number(value),
                Cell::new("mm"),
                number("0.0000714"),
                number("± 0.000140"),
                Cell::new("unknown"),
            ]);
        }
        t
    }

    #[test]
    fn numbers_stay_whole_at_any_width() {
        let whole = |text: &str| ["-0.000052", "± 0.000140", " mm ", "12.3"].iter().all(|w| text.contains(w));
        let mut seen = 0;
        for width in (49..=140).rev() {
            let mut t = example();
            let left_out = lay(&mut t, width, &["probe noise"]);
            let text = t.to_string();
            assert!(whole(&text), "{width}: {text}");
            assert!(text.lines().all(|l| display_width(l) <= width), "{width}: {text}");
            assert_eq!(left_out.is_empty(), text.contains("0.0000714"), "{width}: {text}");
            seen += usize::from(!left_out.is_empty());
        }
        assert!((10..80).contains(&seen), "{seen}");
        // no paper is too narrow for a number: the line is longer then
        let mut t = example();
        lay(&mut t, 20, &[]);
        assert!(whole(&t.to_string()), "{t}");
    }

    #[test]
    fn what_fits_is_not_changed() {
        let (plain, mut laid) = (example(), example());
        assert!(lay(&mut laid, 140, &["probe noise"]).is_empty());
        assert_eq!(plain.to_string(), laid.to_string());
    }

    #[test]
    fn names_are_words_and_numbers_are_not() {
        for w in ["-0.1", "1e-13", "B-30.0", "±0.2", "100", "3/4", "1.0:"] {
            assert!(is_number(w), "{w}");
        }
        for w in ["EXC2c", "radial-c-2", "mm", "±", "not"] {
            assert!(!is_number(w), "{w}");
        }
    }
}
