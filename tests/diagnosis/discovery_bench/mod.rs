//! Hidden effects: planted by the virtual machine's own physics, searched for by code that cannot see them.
#![allow(dead_code)] // the example and the tests use parts of it

pub mod find;
pub mod measure;
pub mod plant;
pub mod strange;
