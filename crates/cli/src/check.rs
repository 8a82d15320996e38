//! `etendue check`: the scene doctor.

use std::time::Instant;

use etendue::{Calibration, Prospect, TimeForecast, read_glasses};
use etendue_render::output::Outputs;
use etendue_render::{Images, Plan, check_extent};
use etendue_report::Span;
use etendue_scene::doctor::{Diagnosis, Finding};
use etendue_scene::file::SceneFile;
use etendue_scene::{LoadOptions, Start, Wanted};

use serde::Serialize;

use crate::arguments::CheckArguments;
use crate::fault::{Fault, VersionedReport, print_json, print_text};

pub(crate) fn run(arguments: &CheckArguments) -> Result<(), Fault> {
    let options = &arguments.scene;
    let start = Instant::now();
    let glasses = read_glasses(&options.glass_catalogs)?;
    let loading = LoadOptions { glasses: &glasses, ..options.load_options() };
    let file = SceneFile::read_with(&loading.opener, &options.scene, &options.overrides())?;
    let scene = file.load(Wanted::EVERYTHING, &loading)?;
    if options.strict
        && let Some(fault) = Images::first_fault(&scene)
    {
        return Err(Fault::refused(fault));
    }
    let load = start.elapsed().as_secs_f64();
    let frames = file.frames(&loading.opener, || Ok(Start::of(&scene)))?;
    let plan = Plan::new(&scene, Outputs::ALL);
    check_extent(&scene, &plan)
        .map_err(|why| Fault::refused(format!("{}: {why}", options.scene.display())))?;
    let prospect = Prospect { scene: &scene, plan: &plan, outputs: Outputs::ALL, load };
    let time = TimeForecast::new(&prospect, &Calibration::of_this_machine()?);
    let mut diagnosis = Diagnosis { memory: plan.memory, ..Diagnosis::of(&scene, file.kind()) };
    if let Some(frames) = frames {
        diagnosis.frames = Some(frames.frames.len());
        diagnosis.findings.extend(frames.notes.iter().map(Finding::from));
    }
    match arguments.json {
        true => print_json(&VersionedReport::new(&CheckReport { diagnosis, time })),
        false => {
            let mut list = diagnosis.table();
            list.put("time", format!("{} ({})", Span(time.total), time.stages()));
            print_text(&list.text())
        }
    }
}

/// A diagnosis, and how long a render will take.
#[derive(Serialize)]
struct CheckReport {
    #[serde(flatten)]
    diagnosis: Diagnosis,
    time: TimeForecast,
}
