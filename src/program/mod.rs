//! What is to be touched, in which order and along which path: controller-neutral.
//!
//! `programs/*.toml` → [`plan::Plan`] (the touches) → `path` (every move, proven safe).

pub mod path;
pub mod plan;
