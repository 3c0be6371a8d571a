//! The tables of a correction: the mapping against an independent calculation, the C component against the Rust one, the
//! stock modules as installed, and what an export writes.

mod again;
mod backups;
mod by_hand;
mod component;
mod controls;
mod each_parameter;
mod export;
mod hand;
mod mapping;
mod old_values;
mod rows;
mod said;
mod stock;
mod support;
