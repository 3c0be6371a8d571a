//! Hidden faults from a generator of its own: kinematics, formulas and logs are written here once more, by hand. It reads neither
//! `effects.toml` nor the virtual machine (`src/simulate`): a mistake that these share with the model would stay hidden otherwise.
//!
//! `forward` moves the machine, `faults` and `more_faults` say what is wrong with it, `mistakes` what the user did wrong, `strange` what is
//! in no catalogue, `bench` makes the logs, `peers` writes cases for other methods, `judge` asks the program and compares its answer with what was planted.
#![allow(dead_code)] // the example and the tests use parts of it

pub mod bench;
pub mod faults;
pub mod forward;
pub mod judge;
pub mod mistakes;
pub mod more_faults;
pub mod peers;
pub mod strange;
