#![forbid(unsafe_code)]
//! Readers of files, under inputs that nobody meant to write.
//!
//! | module | idea |
//! |---|---|
//! | [`targets`] | one function a reader, from bytes to nothing: what `fuzz/` and the harness share |
//! | [`seeds`] | inputs to start from: the repository's scenes, and small files made here |
//! | [`mutate`] | inputs from inputs |
//! | [`run`] | many inputs in a process of their own, with limits for each |
//! | [`guided`] | the same limit of time for inputs that libFuzzer makes |
//!
//! A target passes when it returns, whatever the reader said. A panic, an abort, more memory than
//! [`run::MOST_MEMORY`] or more processor time than [`run::MOST_TIME`] for one input is a failure.
#![allow(
    clippy::disallowed_methods,
    reason = "programs of measurements and tests write their own files"
)]

pub mod guided;
pub mod mutate;
pub mod run;
pub mod seeds;
pub mod targets;
