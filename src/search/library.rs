//! Candidates and their columns, stacked so that one product serves all.

use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut, DVectorView};
use rayon::prelude::*;
use std::borrow::Borrow;
use std::ops::Range;
use std::sync::{Arc, OnceLock};

/// A column of less than this, in units of the noise at typical size, is the rounding of a column of nothing.
const LEAST_TRACE: f64 = 1e-6;

/// Whitened columns, per typical size, with those that are only rounding set to nothing: the sine of twice C at C = 0 and 90
/// leaves 1e-16, which is no direction and explains no other effect.
pub fn without_rounding(columns: &mut DMatrix<f64>) {
    let rows = columns.nrows();
    clear_rounding(columns.as_mut_slice(), rows);
}

fn clear_rounding(columns: &mut [f64], rows: usize) {
    for column in columns.chunks_exact_mut(rows.max(1)) {
        if DVectorView::from_slice(column, rows).norm() < LEAST_TRACE {
            column.fill(0.0);
        }
    }
}

/// The columns of several candidates in one matrix; all have as many rows.
#[must_use]
pub fn side_by_side(candidates: &[DMatrix<f64>]) -> DMatrix<f64> {
    let columns: Vec<_> = candidates.iter().flat_map(DMatrix::column_iter).collect();
    DMatrix::from_columns(&columns)
}

/// Where a candidate comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// The built-in catalogue.
    Catalogue,
    /// The user's own file.
    User,
    /// A shape without a physical name.
    Generic,
}

/// The columns of a candidate at one value of its shape parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Variant {
    /// Value of the shape parameter (0 where there is none), in the shape's unit.
    pub shape: f64,
    /// Which columns of the library.
    pub columns: Range<usize>,
}

/// Something that might be missing in the model.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Id, unique.
    pub id: String,
    /// Where it comes from.
    pub origin: Origin,
    /// One per scanned value of a shape parameter, neighbours next to each other; at least one.
    pub variants: Vec<Variant>,
    /// Shape parameters that the scan searches: each counts as a parameter.
    pub n_scanned: usize,
    /// One of a few shapes that are looked for before all others, with a share of the level of their own.
    pub expected: bool,
    /// Parameters (by place in a variant) whose size is positive by nature.
    pub positive: Vec<usize>,
}

/// Makes whitened columns, by their numbers, at some rows (`None`: at all).
pub type Make = Arc<dyn Fn(&[usize], Option<&[usize]>) -> DMatrix<f64> + Send + Sync>;

/// Rows up to which columns of effects are kept in memory.
const MOST_ROWS_KEPT: usize = 4_000;

/// Columns that are worked on at once.
const CHUNK: usize = 128;

/// Numbers in them: 16 MB. Larger pieces of memory may be handed back to the system after each use, and cleared before the next.
const CHUNK_NUMBERS: usize = 2_000_000;

#[derive(Clone)]
enum Columns {
    /// In memory, one after the other; libraries of the same columns share them.
    Kept(Arc<Vec<f64>>),
    /// Nowhere: made when they are needed. Those of which nothing is left but rounding are zero; which these are is known once
    /// a whole column has been made.
    Made { make: Make, numbers: Vec<usize>, nothing: Vec<OnceLock<bool>> },
}

impl std::fmt::Debug for Columns {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Kept(data) => write!(f, "Kept({} numbers)", data.len()),
            Self::Made { numbers, .. } => write!(f, "Made({} columns)", numbers.len()),
        }
    }
}

/// Columns one after the other that are all kept or all made.
#[derive(Debug, Clone)]
struct Part {
    span: Range<usize>,
    columns: Columns,
}

/// Candidates with their columns: derivative of the whitened gap by each parameter in units of its typical size.
#[derive(Debug, Clone, Default)]
pub struct Library {
    n_rows: usize,
    parts: Vec<Part>,
    candidates: Vec<Candidate>,
}

impl Library {
    /// An empty library for a regression of so many rows.
    #[must_use]
    pub fn new(n_rows: usize) -> Self {
        Self { n_rows, ..Self::default() }
    }

    /// Are columns of so many rows kept in memory? Effects have thousands, with all values of their scans.
    #[must_use]
    pub fn keeps(n_rows: usize) -> bool {
        n_rows <= MOST_ROWS_KEPT
    }

    /// Columns that may be in libraries ([`Library::put`]), one after the other: those of rounding are nothing.
    #[must_use]
    pub fn part(n_rows: usize, mut columns: Vec<f64>) -> Arc<Vec<f64>> {
        clear_rounding(&mut columns, n_rows);
        Arc::new(columns)
    }

    /// Puts such columns at the end where they are, without a copy: candidates are [`Library::place`]d on them. Work on many
    /// small parts takes longer than on one.
    pub fn put(&mut self, data: &Arc<Vec<f64>>) -> Range<usize> {
        let first = self.n_columns();
        let span = first..first + data.len().checked_div(self.n_rows).unwrap_or(0);
        if !span.is_empty() {
            self.parts.push(Part { span: span.clone(), columns: Columns::Kept(data.clone()) });
        }
        span
    }

    /// A library of columns that are made when they are needed: where memory does not hold them, or where it takes as long to
    /// get memory for them as to make them again.
    #[must_use]
    pub fn made(n_rows: usize, count: usize, make: Make) -> Self {
        let columns = Columns::Made { make, numbers: (0..count).collect(), nothing: vec![OnceLock::new(); count] };
        let part = Part { span: 0..count, columns };
        Self { n_rows, parts: vec![part], candidates: Vec::new() }
    }

    /// A candidate whose columns are there already: the shape's value and which columns, for each variant.
    pub fn place(&mut self, id: impl Into<String>, origin: Origin, variants: Vec<Variant>, n_scanned: usize) {
        if variants.is_empty() {
            return;
        }
        let (expected, positive) = (false, Vec::new());
        self.candidates.push(Candidate { id: id.into(), origin, variants, n_scanned, expected, positive });
    }

    /// Adds a candidate without a scan. `columns`: N × q, whitened, scaled by typical size.
    pub fn push(&mut self, id: impl Into<String>, origin: Origin, columns: &DMatrix<f64>) {
        self.push_scan(id, origin, [(0.0, columns)], 0);
    }

    /// Adds a candidate with a scanned shape; `variants` gives the shape's value and N × q columns. Matrices with
    /// another number of rows, and candidates without a variant, are passed over; columns that are only rounding are nothing.
    pub fn push_scan(
        &mut self,
        id: impl Into<String>,
        origin: Origin,
        variants: impl IntoIterator<Item = (f64, impl Borrow<DMatrix<f64>>)>,
        n_scanned: usize,
    ) {
        let mut spans = Vec::new();
        for (shape, columns) in variants {
            let columns = columns.borrow();
            if columns.nrows() == self.n_rows {
                spans.push(Variant { shape, columns: self.keep(columns) });
            }
        }
        self.place(id, origin, spans, n_scanned);
    }

    /// Columns at the end, in memory.
    fn keep(&mut self, columns: &DMatrix<f64>) -> Range<usize> {
        let first = self.n_columns();
        let span = first..first + columns.ncols();
        // columns that another library has too stay as they are
        let own = |part: &Part| matches!(&part.columns, Columns::Kept(data) if Arc::strong_count(data) == 1);
        if !self.parts.last().is_some_and(own) {
            self.parts.push(Part { span: first..first, columns: Columns::Kept(Arc::default()) });
        }
        if let Some(Part { span: all, columns: Columns::Kept(data) }) = self.parts.last_mut() {
            let data = Arc::make_mut(data);
            let from = data.len();
            data.extend_from_slice(columns.as_slice());
            clear_rounding(&mut data[from..], self.n_rows);
            all.end = span.end;
        }
        span
    }

    /// The last candidate is one of the few shapes that are looked for before all others.
    pub(super) fn expect_last(&mut self) {
        if let Some(last) = self.candidates.last_mut() {
            last.expected = true;
        }
    }

    /// Sizes of the last candidate that are positive by nature, by place in its variants.
    pub fn positive_of_last(&mut self, places: Vec<usize>) {
        if let Some(last) = self.candidates.last_mut() {
            last.positive = places;
        }
    }

    /// Moves all candidates of another library of equal rows to the end of this one.
    pub fn append(&mut self, other: Library) {
        if other.n_rows != self.n_rows {
            return;
        }
        let shift = self.n_columns();
        let behind = |span: &Range<usize>| span.start + shift..span.end + shift;
        self.parts.extend(other.parts.into_iter().map(|part| Part { span: behind(&part.span), ..part }));
        self.candidates.extend(other.candidates.into_iter().map(|mut c| {
            for v in &mut c.variants {
                v.columns = behind(&v.columns);
            }
            c
        }));
    }

    #[must_use]
    pub fn candidates(&self) -> &[Candidate] {
        &self.candidates
    }

    /// Index of a candidate.
    #[must_use]
    pub fn position(&self, id: &str) -> Option<usize> {
        self.candidates.iter().position(|c| c.id == id)
    }

    #[must_use]
    pub fn n_rows(&self) -> usize {
        self.n_rows
    }

    /// Columns of all candidates and variants.
    #[must_use]
    pub fn n_columns(&self) -> usize {
        self.parts.last().map_or(0, |part| part.span.end)
    }

    /// All columns, as a copy.
    #[must_use]
    pub fn matrix(&self) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(self.n_rows, self.n_columns());
        for part in &self.parts {
            self.with(part.span.clone(), |own| out.columns_mut(part.span.start, part.span.len()).copy_from(&own));
        }
        out
    }

    /// Columns of one part of the library as they are, or made.
    pub(super) fn with<T>(&self, span: Range<usize>, work: impl FnOnce(DMatrixView<'_, f64>) -> T) -> T {
        let part = self.parts.iter().find(|part| part.span.start <= span.start && span.end <= part.span.end);
        match part.map(|part| (&part.columns, part.span.start)) {
            Some((Columns::Kept(data), first)) => {
                let (from, to) = ((span.start - first) * self.n_rows, (span.end - first) * self.n_rows);
                work(DMatrixView::from_slice(&data[from..to], self.n_rows, span.len()))
            }
            Some((Columns::Made { make, numbers, nothing }, first)) => {
                let own = span.start - first..span.end - first;
                let columns = made(make, &numbers[own.clone()], &nothing[own], None);
                work(columns.as_view())
            }
            None => work(DMatrix::zeros(self.n_rows, span.len()).as_view()),
        }
    }

    /// All columns in pieces of some, each within one part, and no variant in two of them.
    pub(super) fn chunks(&self) -> Vec<Range<usize>> {
        let mut out: Vec<Range<usize>> = Vec::new();
        let ends = |at: usize| self.parts.iter().any(|part| part.span.start == at);
        let mut spans: Vec<&Range<usize>> =
            self.candidates.iter().flat_map(|c| &c.variants).map(|v| &v.columns).collect();
        spans.sort_by_key(|span| span.start);
        let small = |columns: usize| columns * self.n_rows <= CHUNK_NUMBERS;
        for span in spans {
            match out.last_mut() {
                Some(last)
                    if last.end == span.start
                        && last.len() < CHUNK
                        && small(last.len() + span.len())
                        && !ends(span.start) =>
                {
                    last.end = span.end;
                }
                _ => out.push(span.clone()),
            }
        }
        out
    }

    /// All columns at some rows.
    pub(super) fn at_rows(&self, rows: &[usize]) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(rows.len(), self.n_columns());
        for part in &self.parts {
            let mut own = out.columns_mut(part.span.start, part.span.len());
            match &part.columns {
                Columns::Kept(data) => {
                    for (mut to, from) in own.column_iter_mut().zip(data.chunks_exact(self.n_rows.max(1))) {
                        for (t, &i) in to.iter_mut().zip(rows) {
                            *t = from[i];
                        }
                    }
                }
                Columns::Made { make, numbers, nothing } => own.copy_from(&made(make, numbers, nothing, Some(rows))),
            }
        }
        out
    }

    /// The same candidates with columns that were whitened otherwise, variant by variant.
    #[must_use]
    pub fn with_variants(&self, n_rows: usize, columns: &[DMatrix<f64>]) -> Self {
        let (mut out, mut candidates) = (Self::new(n_rows), self.candidates.clone());
        for (variant, columns) in candidates.iter_mut().flat_map(|c| &mut c.variants).zip(columns) {
            variant.columns = out.keep(columns);
        }
        Self { candidates, ..out }
    }

    /// The same candidates in a regression whose rows a change makes of this one's; `None` where columns are not kept in memory.
    #[must_use]
    pub fn changed(mut self, change: super::Change) -> Option<Self> {
        let n_rows = self.n_rows;
        let of_part = |part: &mut Part| {
            let Columns::Kept(data) = &mut part.columns else { return None };
            // in place, unless another library has them too
            Arc::make_mut(data).par_chunks_mut((CHUNK * n_rows).max(1)).for_each(|some| {
                let columns = some.len() / n_rows;
                change(DMatrixViewMut::from_slice(some, n_rows, columns));
            });
            Some(())
        };
        self.parts.par_iter_mut().map(of_part).collect::<Option<()>>()?;
        Some(self)
    }

    /// A library of one of the candidates, with all its variants.
    #[must_use]
    pub fn only(&self, candidate: usize) -> Self {
        self.some(|c| c == candidate)
    }

    /// A library of most of the candidates, by their index: with the columns of the others, which no test asks for.
    #[must_use]
    pub fn most(&self, wanted: impl Fn(usize) -> bool) -> Self {
        let some = self.candidates.iter().enumerate().filter(|(i, _)| wanted(*i));
        let candidates = some.map(|(_, candidate)| candidate.clone()).collect();
        Self { n_rows: self.n_rows, parts: self.parts.clone(), candidates }
    }

    /// A library of some of the candidates, by their index.
    #[must_use]
    pub fn some(&self, wanted: impl Fn(usize) -> bool) -> Self {
        let mut out = Self::new(self.n_rows);
        let some = self.candidates.iter().enumerate().filter(|(i, _)| wanted(*i));
        let mut candidates: Vec<Candidate> = some.map(|(_, candidate)| candidate.clone()).collect();
        // in the order of the columns: neighbours may be made together
        let mut variants: Vec<&mut Variant> = candidates.iter_mut().flat_map(|c| &mut c.variants).collect();
        variants.sort_by_key(|variant| variant.columns.start);
        for part in &self.parts {
            let ends = variants.partition_point(|variant| variant.columns.start < part.span.end);
            let own = variants.drain(..ends).collect::<Vec<_>>();
            let is_whole = own.iter().map(|variant| variant.columns.len()).sum::<usize>() == part.span.len();
            match &part.columns {
                // without a copy
                Columns::Kept(data) if is_whole => {
                    let at = out.put(data).start;
                    let moved = |columns: &Range<usize>| {
                        columns.start - part.span.start + at..columns.end - part.span.start + at
                    };
                    own.into_iter().for_each(|variant| variant.columns = moved(&variant.columns));
                }
                _ => own.into_iter().for_each(|variant| variant.columns = out.take(self, &variant.columns)),
            }
        }
        Self { candidates, ..out }
    }

    /// Columns of another library at the end of this one.
    fn take(&mut self, other: &Self, span: &Range<usize>) -> Range<usize> {
        let part = other.parts.iter().find(|part| part.span.start <= span.start && span.end <= part.span.end);
        let Some(Part { span: all, columns: Columns::Made { make, numbers, nothing } }) = part else {
            return other.with(span.clone(), |columns| self.keep(&columns.into_owned()));
        };
        let first = self.n_columns();
        let (own, at) = (span.start - all.start..span.end - all.start, first..first + span.len());
        match self.parts.last_mut() {
            Some(Part { span, columns: Columns::Made { make: before, numbers: n, nothing: o } })
                if Arc::ptr_eq(before, make) =>
            {
                n.extend_from_slice(&numbers[own.clone()]);
                o.extend_from_slice(&nothing[own]);
                span.end = at.end;
            }
            _ => {
                let (numbers, nothing) = (numbers[own.clone()].to_vec(), nothing[own].to_vec());
                let columns = Columns::Made { make: make.clone(), numbers, nothing };
                self.parts.push(Part { span: at.clone(), columns });
            }
        }
        at
    }

    /// Columns of one variant, N × q.
    #[must_use]
    pub fn columns(&self, candidate: usize, variant: usize) -> DMatrix<f64> {
        let span = self.candidates[candidate].variants[variant].columns.clone();
        self.with(span, |columns| columns.into_owned())
    }
}

/// Made columns, those of rounding as nothing.
fn made(make: &Make, numbers: &[usize], nothing: &[OnceLock<bool>], rows: Option<&[usize]>) -> DMatrix<f64> {
    let mut columns = make(numbers, rows);
    for (i, mut column) in columns.column_iter_mut().enumerate() {
        let norm = || if rows.is_none() { column.norm() } else { make(&numbers[i..=i], None).norm() };
        if *nothing[i].get_or_init(|| norm() < LEAST_TRACE) {
            column.fill(0.0);
        }
    }
    columns
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn some_candidates_share_whole_parts_which_stay_as_they_are() {
        let columns = DMatrix::from_fn(5, 6, |i, k| (10 * k + i) as f64);
        let part = |from: usize, n: usize| Library::part(5, columns.columns(from, n).iter().copied().collect());
        let mut all = Library::new(5);
        let spans = [part(0, 1), part(1, 2), part(3, 3)].map(|part| all.put(&part));
        assert_eq!((spans, all.matrix()), ([0..1, 1..3, 3..6], columns.clone()));
        let variant = |columns: Range<usize>| Variant { shape: 0.0, columns };
        all.place("left out", Origin::Catalogue, vec![variant(0..1)], 0);
        all.place("piece", Origin::Catalogue, vec![variant(2..3)], 0);
        all.place("whole", Origin::Catalogue, vec![variant(5..6), variant(3..5)], 0);
        let mut some = all.some(|c| c != 0);
        let is_shared = |of: &Library| {
            let parts = of.parts.iter().filter_map(|part| match &part.columns {
                Columns::Kept(data) => Some(data),
                Columns::Made { .. } => None,
            });
            let Columns::Kept(whole) = &all.parts[2].columns else { return 0 };
            parts.filter(|data| Arc::ptr_eq(data, whole)).count()
        };
        assert_eq!(is_shared(&some), 1);
        some.push("more", Origin::Catalogue, &(columns.columns(0, 1) * 3.0));
        assert_eq!((is_shared(&some), some.n_columns()), (1, 5));
        for (candidate, variant, first, n) in [(0, 0, 2, 1), (1, 0, 5, 1), (1, 1, 3, 2)] {
            assert_eq!(some.columns(candidate, variant), columns.columns(first, n), "{candidate} {variant}");
        }
        assert_eq!(some.columns(2, 0), columns.columns(0, 1) * 3.0);
        // and each may be changed alone
        let doubled = all.clone().changed(&|mut columns| columns *= 2.0).unwrap();
        assert_eq!((doubled.matrix(), all.matrix()), (&columns * 2.0, columns));
    }
}
