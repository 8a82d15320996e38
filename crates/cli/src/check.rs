//! `etendue check`: the scene doctor.

use etendue_render::output::Outputs;
use etendue_render::{Images, Plan};
use etendue_scene::Wanted;
use etendue_scene::doctor::Diagnosis;
use etendue_scene::file::SceneFile;

use crate::arguments::CheckArguments;
use crate::fault::{Fault, print_json, print_text};

pub(crate) fn run(arguments: &CheckArguments) -> Result<(), Fault> {
    let options = &arguments.scene;
    let file = SceneFile::read(&options.scene, &options.overrides())?;
    let scene = file.load(Wanted::EVERYTHING, &options.load_options())?;
    if options.strict
        && let Some(fault) = Images::first_fault(&scene)
    {
        return Err(Fault::refused(fault));
    }
    let memory = Plan::new(&scene, Outputs::ALL).memory;
    let diagnosis = Diagnosis { memory, ..Diagnosis::of(&scene, file.kind()) };
    if arguments.json { print_json(&diagnosis) } else { print_text(&diagnosis.to_string()) }
}
