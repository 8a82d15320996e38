//! `etendue check`: the scene doctor.

use etendue_scene::doctor;
use etendue_scene::import::Strictness;
use etendue_scene::{LoadOptions, Reach};

use crate::arguments::CheckArguments;
use crate::fault::{Fault, print_json, print_text};

pub(crate) fn run(arguments: &CheckArguments) -> Result<(), Fault> {
    let options = LoadOptions {
        strictness: if arguments.strict { Strictness::Strict } else { Strictness::Tolerant },
        reach: if arguments.allow_outside { Reach::Anywhere } else { Reach::OwnFolder },
        ..LoadOptions::default()
    };
    let diagnosis = doctor::check(&arguments.file, &[], &options)?;
    if arguments.json { print_json(&diagnosis) } else { print_text(&diagnosis.to_string()) }
}
