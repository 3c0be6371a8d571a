//! What is in no catalogue: planted by the virtual machine, searched for by code that cannot see it.
#![allow(dead_code)] // the example and the tests use parts of it

pub mod find;
pub mod plant;
pub mod strange;
