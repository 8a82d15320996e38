//! `etendue plan`: what a render would do, and why.

use etendue_render::Plan;
use etendue_render::output::Outputs;

use crate::arguments::PlanArguments;
use crate::fault::{Fault, print_json, print_text};
use crate::progress::Stages;
use crate::render::{Memory, load};

pub(crate) fn run(arguments: &PlanArguments) -> Result<(), Fault> {
    let scene = load(&arguments.scene, Memory::Look, Stages::new(arguments.json))?;
    let plan = Plan::new(&scene, Outputs::ALL);
    if arguments.json { print_json(&plan.decisions) } else { print_text(&plan.to_string()) }
}
