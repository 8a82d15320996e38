//! `etendue plan`: what a render would do, and why.

use etendue::{Calibration, Options, Session, TimeForecast};
use etendue_bench::tolerance::{self, Tolerance};
use etendue_render::check_extent;
use etendue_report::{Decision, DecisionKind, DecisionValue, Tabled};

use crate::arguments::{PlanArguments, SceneArguments};
use crate::fault::{Fault, VersionedReport, print_json, print_text};
use crate::job::{options, verified};
use crate::progress::{Phases, say};
use crate::stop;

pub(crate) fn run(arguments: &PlanArguments) -> Result<(), Fault> {
    if arguments.models {
        return compare_models(arguments);
    }
    let progress = Phases::new(arguments.json).progress(false);
    let options = Options { to_render: false, ..options(&arguments.scene) };
    let mut session = Session::open_with(&arguments.scene.scene, options)?;
    let frames = session.frames(&progress)?;
    let mut plan = session.plan(&progress)?.clone();
    if arguments.verify {
        say(&verified(&mut session, &progress)?);
    }
    let machine = Calibration::of_this_machine()?;
    let prospect = session.prospect(&progress)?;
    check_extent(prospect.scene, prospect.plan)
        .map_err(|why| Fault::refused(format!("{}: {why}", arguments.scene.scene.display())))?;
    let time = TimeForecast::new(&prospect, &machine);
    plan.decisions.push(time.decision());
    plan.decisions.extend(frames.map(|frames| {
        let because =
            "each is a picture of its own; all above is of one, of the scene as it stands";
        Decision::new(DecisionKind::Frames, DecisionValue::Count(frames.len() as u64), because)
    }));
    match (arguments.json, arguments.markdown) {
        (true, _) => print_json(&plan.decisions),
        (false, true) => print_text(&Tabled(&plan.decisions).markdown()),
        (false, false) => print_text(&plan.to_string()),
    }
}

/// `--models`: what simpler models of the lens miss, and what they cost.
fn compare_models(arguments: &PlanArguments) -> Result<(), Fault> {
    stop::listen(say);
    let phases = Phases::new(arguments.json);
    // The tolerance is what models are judged by here, not what is taken of the scene's.
    let own = SceneArguments { tolerance: None, ..arguments.scene.clone() };
    let mut session = Session::open_with(&arguments.scene.scene, options(&own))?;
    let (scene, accel) = session.scene_and_accel(&phases.progress(false))?;
    let progress = phases.begin("models");
    let goes_on = |share| progress(share);
    let of_scene = scene
        .tolerance
        .map(|spec| Tolerance { pixels: spec.displacement.0, light: Some(spec.light.0) });
    let by_itself = Tolerance { pixels: 0.5, light: None };
    let judged = arguments.scene.tolerance.or(of_scene).unwrap_or(by_itself);
    let compared = tolerance::compare(scene, accel, judged, &goes_on).map_err(|error| {
        match Fault::from(error) {
            Fault::Refused(why) => {
                Fault::refused(format!("{}: {why}", arguments.scene.scene.display()))
            }
            fault => fault,
        }
    })?;
    if arguments.json {
        print_json(&VersionedReport::new(&compared))
    } else {
        print_text(&compared.to_string())
    }
}
