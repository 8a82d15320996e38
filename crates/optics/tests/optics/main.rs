//! Lenses and what they are made of, against closed forms, references and each other.
#![allow(clippy::disallowed_methods, reason = "tests set their stage by hand")]

mod asphere_crossings;
mod code_v;
mod components;
mod coordinate_breaks;
mod every_kind;
mod exit_pupil;
mod gradients;
mod lens_formats;
mod lens_limits;
mod lens_properties;
mod microlens_array;
mod mirrors;
mod openings;
mod optics_reference;
mod reports;
mod schmidt_cassegrain;
mod second_opinion;
mod small_openings;
mod waves;
mod zemax_commands;
mod zemax_components;

use etendue_optics::train::{LensFile, OpticalTrain};

/// A lens from the text of its file; the message when it is refused. Other files are not there.
fn try_build(json: &str) -> Result<OpticalTrain, String> {
    let file = LensFile::from_json(json).map_err(|e| e.to_string())?;
    file.build(&|name: &str| Err(format!("{name}: no files"))).map_err(|e| e.to_string())
}

fn build(json: &str) -> OpticalTrain {
    try_build(json).unwrap_or_else(|e| panic!("{e}"))
}

/// A lens of `scenes/lenses`.
fn preset(name: &str) -> OpticalTrain {
    let path = format!("{}/../../scenes/lenses/{name}.json", env!("CARGO_MANIFEST_DIR"));
    build(&std::fs::read_to_string(path).unwrap())
}
