//! `etendue check`: the scene doctor.

use etendue_scene::doctor;

use crate::arguments::CheckArguments;
use crate::fault::{Fault, print_json, print_text};

pub(crate) fn run(arguments: &CheckArguments) -> Result<(), Fault> {
    let scene = &arguments.scene;
    let diagnosis = doctor::check(&scene.scene, &scene.overrides(), &scene.load_options())?;
    if arguments.json { print_json(&diagnosis) } else { print_text(&diagnosis.to_string()) }
}
