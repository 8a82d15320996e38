//! The structure over a scene's surfaces, by the backend that the scene names.

use std::sync::Arc;

use etendue_accel::{Accel, AccelName, BuildOptions, build_moving, check_scale};
use etendue_geometry::Geometry;
use etendue_report::Refusal;
use etendue_scene::Scene;

use crate::error::RenderError;
use crate::plan::{Plan, Unseen};

/// Options of a build of the structure over `scene`.
fn options_for(scene: &Scene, plan: &Plan, options: &BuildOptions) -> BuildOptions {
    let exposure = scene.camera.exposure_span();
    BuildOptions { quality: plan.quality, refine: plan.refine, exposure, ..options.clone() }
}

/// Refuses a scene of which no structure can be built, before anything is.
///
/// # Errors
///
/// When it is too large or too small without what no ray of the picture can meet.
pub fn check_extent(scene: &Scene, plan: &Plan) -> Result<(), RenderError> {
    let bounds = match &plan.unseen {
        Some(unseen) => unseen.left_out_of(&scene.geometry).loose_bounds(),
        None => scene.geometry.loose_bounds(),
    };
    Ok(check_scale(bounds)?)
}

/// Builds `scene`'s acceleration structure with the backend that it names, or else the best.
///
/// # Errors
///
/// When the backend is not built in, cannot be told the options, or cannot build: memory, size, or a
/// stop.
pub fn build(
    scene: &Scene,
    plan: &Plan,
    options: &BuildOptions,
) -> Result<Box<dyn Accel>, RenderError> {
    build_over(Arc::clone(&scene.geometry), scene, plan, options)
}

/// As [`build`], without what no ray of the picture can meet: for that picture's rays alone.
///
/// # Errors
///
/// As [`build`].
pub fn build_without(
    unseen: &Unseen,
    scene: &Scene,
    plan: &Plan,
    options: &BuildOptions,
) -> Result<Box<dyn Accel>, RenderError> {
    build_over(Arc::new(unseen.left_out_of(&scene.geometry)), scene, plan, options)
}

pub(crate) fn build_over(
    geometry: Arc<Geometry>,
    scene: &Scene,
    plan: &Plan,
    options: &BuildOptions,
) -> Result<Box<dyn Accel>, RenderError> {
    let options = options_for(scene, plan, options);
    let name = scene.render.accel.unwrap_or_else(AccelName::best);
    if options.isa.is_some() && name != AccelName::Embree {
        let why = "only Embree can be told an instruction set";
        let remedy = "leave `--isa` out, or use `--accel embree`";
        return Err(Refusal::new(why).hint(remedy).into());
    }
    if !name.is_built() {
        let why = "this program was built without Embree";
        let remedy = "use `--accel bvh`, or build it with the feature";
        return Err(Refusal::new(why).hint(remedy).into());
    }
    Ok(build_moving(geometry, &options, &|geometry, options| name.build(geometry, options))?)
}

/// As [`build`], after `before` was built for the same scene, of which parts have changed since: what of
/// it has not is kept, where the backend can.
///
/// # Errors
///
/// As [`build`].
pub fn rebuild(
    scene: &Scene,
    plan: &Plan,
    options: &BuildOptions,
    before: Option<&dyn Accel>,
) -> Result<Box<dyn Accel>, RenderError> {
    let with_quality = options_for(scene, plan, options);
    let again = |before: &dyn Accel| before.rebuilt(Arc::clone(&scene.geometry), &with_quality);
    let stands = scene.geometry.moving_within(with_quality.exposure).next().is_none();
    match before.filter(|_| stands).and_then(again) {
        Some(rebuilt) => Ok(rebuilt?),
        None => build(scene, plan, options),
    }
}
