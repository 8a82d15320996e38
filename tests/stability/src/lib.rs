#![forbid(unsafe_code)]
//! Every method taken to where it is known to fail.
//!
//! A [`Case`] names a regime, what must happen there, and a function that goes there and measures. The
//! tests run all of them at [`Scale::Quick`]; `cargo run --release -p etendue-stability` runs them at
//! [`Scale::Full`] and writes `docs/measurements/stability.md` from what they report.
#![allow(
    clippy::disallowed_methods,
    reason = "programs of measurements and tests write their own files"
)]

pub mod accumulation;
mod case;
pub mod intersection;
pub mod light;
pub mod optics;
pub mod page;
mod rendered;
pub mod sampling;
pub mod sensor;

pub use case::{Case, Method, Outcome, Scale};

/// The methods, in the order of the page.
pub const METHODS: [&Method; 6] = [
    &intersection::METHOD,
    &optics::METHOD,
    &sampling::METHOD,
    &sensor::METHOD,
    &accumulation::METHOD,
    &light::METHOD,
];
