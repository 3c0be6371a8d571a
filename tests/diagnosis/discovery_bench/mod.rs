//! Faults of the virtual machine: planted by `plant`, looked at by `find`, which cannot see them.

pub mod find;
pub mod plant;
