//! `etendue plan`: what a render would do, and why.

use etendue::{Options, Session};

use crate::arguments::PlanArguments;
use crate::fault::{Fault, print_json, print_text};
use crate::progress::Phases;
use crate::render::options;

pub(crate) fn run(arguments: &PlanArguments) -> Result<(), Fault> {
    let progress = Phases::new(arguments.json).progress(false);
    let options = Options { to_render: false, ..options(&arguments.scene) };
    let mut session = Session::open_with(&arguments.scene.scene, options)?;
    let plan = session.plan(&progress)?;
    if arguments.json { print_json(&plan.decisions) } else { print_text(&plan.to_string()) }
}
