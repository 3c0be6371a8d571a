//! Identification: weighted nonlinear least squares over the model, with rank, covariance and what cannot be told.

pub mod outcome;
