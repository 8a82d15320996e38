//! Sensors: their noise, their files, and the standard's own characterisation of them.
#![allow(clippy::disallowed_methods, reason = "tests set their stage by hand")]

mod bands;
mod emva;
mod environment;
mod light;
mod matching;
mod noise;
mod raw_file;
mod readout;
mod refused;
mod slanted_edge;
