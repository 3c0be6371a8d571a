//! Candidates and their columns, stacked so that one product serves all.

use nalgebra::{DMatrix, DMatrixView, DVectorView};
use std::borrow::Borrow;
use std::ops::Range;

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

/// Candidates with their columns: derivative of the whitened gap by each parameter in units of its typical size.
#[derive(Debug, Clone, Default)]
pub struct Library {
    n_rows: usize,
    data: Vec<f64>,
    candidates: Vec<Candidate>,
}

impl Library {
    /// An empty library for a regression of so many rows.
    #[must_use]
    pub fn new(n_rows: usize) -> Self {
        Self { n_rows, ..Self::default() }
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
            if columns.nrows() != self.n_rows {
                continue;
            }
            let (first, from) = (self.n_columns(), self.data.len());
            self.data.extend_from_slice(columns.as_slice());
            clear_rounding(&mut self.data[from..], self.n_rows);
            spans.push(Variant { shape, columns: first..first + columns.ncols() });
        }
        if !spans.is_empty() {
            self.candidates.push(Candidate {
                id: id.into(),
                origin,
                variants: spans,
                n_scanned,
                expected: false,
                positive: Vec::new(),
            });
        }
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
        self.data.extend_from_slice(&other.data);
        self.candidates.extend(other.candidates.into_iter().map(|mut c| {
            for v in &mut c.variants {
                v.columns = v.columns.start + shift..v.columns.end + shift;
            }
            c
        }));
    }

    /// The candidates.
    #[must_use]
    pub fn candidates(&self) -> &[Candidate] {
        &self.candidates
    }

    /// Index of a candidate.
    #[must_use]
    pub fn position(&self, id: &str) -> Option<usize> {
        self.candidates.iter().position(|c| c.id == id)
    }

    /// Rows.
    #[must_use]
    pub fn n_rows(&self) -> usize {
        self.n_rows
    }

    /// Columns of all candidates and variants.
    #[must_use]
    pub fn n_columns(&self) -> usize {
        self.data.len().checked_div(self.n_rows).unwrap_or(0)
    }

    /// All columns.
    #[must_use]
    pub fn matrix(&self) -> DMatrixView<'_, f64> {
        DMatrixView::from_slice(&self.data, self.n_rows, self.n_columns())
    }

    /// The same candidates with columns that were whitened otherwise, in the same order; `None` for a matrix of another shape.
    #[must_use]
    pub fn with_columns(&self, columns: DMatrix<f64>) -> Option<Self> {
        if columns.ncols() != self.n_columns() {
            return None;
        }
        let mut data = Vec::from(columns.data);
        let n_rows = data.len().checked_div(self.n_columns()).unwrap_or(0);
        clear_rounding(&mut data, n_rows);
        Some(Self { n_rows, data, candidates: self.candidates.clone() })
    }

    /// A library of one of the candidates, with all its variants.
    #[must_use]
    pub fn only(&self, candidate: usize) -> Self {
        let mut own = Self::new(self.n_rows);
        let mut one = self.candidates[candidate].clone();
        for variant in &mut one.variants {
            let span = variant.columns.clone();
            let first = own.n_columns();
            own.data.extend_from_slice(&self.data[span.start * self.n_rows..span.end * self.n_rows]);
            variant.columns = first..first + span.len();
        }
        own.candidates.push(one);
        own
    }

    /// Columns of one variant, N × q.
    #[must_use]
    pub fn columns(&self, candidate: usize, variant: usize) -> DMatrix<f64> {
        let span = self.candidates[candidate].variants[variant].columns.clone();
        self.matrix().columns(span.start, span.len()).into_owned()
    }
}
