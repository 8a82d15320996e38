//! `etendue check`: the scene doctor.

use etendue_render::Images;
use etendue_scene::file::SceneFile;
use etendue_scene::{Wanted, doctor};

use crate::arguments::{CheckArguments, SceneArguments};
use crate::fault::{Fault, print_json, print_text};

pub(crate) fn run(arguments: &CheckArguments) -> Result<(), Fault> {
    let scene = &arguments.scene;
    let diagnosis = doctor::check(&scene.scene, &scene.overrides(), &scene.load_options())?;
    if scene.strict {
        refuse_broken_images(scene)?;
    }
    if arguments.json { print_json(&diagnosis) } else { print_text(&diagnosis.to_string()) }
}

/// Decodes every image that the scene or its models name, and refuses the first that is broken.
fn refuse_broken_images(arguments: &SceneArguments) -> Result<(), Fault> {
    let file = SceneFile::read(&arguments.scene, &arguments.overrides())?;
    let scene = file.load(Wanted::EVERYTHING, &arguments.load_options())?;
    match Images::first_fault(&scene) {
        Some(fault) => Err(Fault::refused(fault)),
        None => Ok(()),
    }
}
