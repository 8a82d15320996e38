//! Sensors: their noise, their files, and the standard's own characterisation of them.

mod bands;
mod emva;
mod environment;
mod light;
mod noise;
mod raw_file;
mod refused;
mod slanted_edge;
