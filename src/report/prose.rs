//! Sentences in the width of the terminal.

use textwrap::{Options, WordSeparator, WordSplitter, WrapAlgorithm};

/// Prose is no easier to read on longer lines.
const LONGEST: usize = 100;

/// Every line that is wider than the paper, broken at blanks; what follows is indented by two more than the line. Lines
/// that fit (tables, plots) stay as they are.
#[must_use]
pub fn wrapped(text: &str, width: usize) -> String {
    let each = text.split('\n').map(|line| {
        if textwrap::core::display_width(line) <= width {
            return line.to_owned();
        }
        let indent = line.len() - line.trim_start_matches(' ').len();
        sentence(line.trim_start_matches(' '), width, indent, indent + 2)
    });
    each.collect::<Vec<_>>().join("\n")
}

/// One paragraph: its first line and those after it begin with so many blanks.
#[must_use]
pub fn sentence(text: &str, width: usize, first: usize, then: usize) -> String {
    let (first, then) = (" ".repeat(first), " ".repeat(then));
    let options = Options::new(width.min(LONGEST))
        .initial_indent(&first)
        .subsequent_indent(&then)
        .word_separator(WordSeparator::AsciiSpace)
        .word_splitter(WordSplitter::NoHyphenation)
        .wrap_algorithm(WrapAlgorithm::FirstFit)
        // a path or a name is not broken: it would not be one any more
        .break_words(false);
    let words = text.split(' ').filter(|w| !w.is_empty()).collect::<Vec<_>>().join(" ");
    textwrap::fill(&words, options)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_fits_stays_and_what_does_not_is_indented() {
        let table = " a    b\n──────\n 1    2";
        assert_eq!(wrapped(table, 20), table);
        let long = "  open: one two three four five six seven";
        assert_eq!(wrapped(long, 20), "  open: one two\n    three four five\n    six seven");
        let path = "see /a/very/long/path/that/has/no/blank now";
        assert!(wrapped(path, 20).contains("/a/very/long/path/that/has/no/blank"));
        assert!(wrapped(&"word ".repeat(100), 160).lines().all(|l| l.len() <= LONGEST));
    }
}
