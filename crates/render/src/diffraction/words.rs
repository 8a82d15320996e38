//! Notes, in words, on whether waves would show in a picture.

use etendue_camera::LensCamera;
use etendue_geometry::glam::DVec3;
use etendue_report::{Decision, DecisionKind, DecisionValue};
use etendue_scene::Scene;
use etendue_tracer::LayerSpec;

use crate::Plan;

/// The wavelength at which it is judged (nm).
const GREEN: f64 = 550.0;

/// Diameters of the Airy disc, in λN.
const AIRY: f64 = 2.44;

/// Discs of fewer pixels do not show.
const SHOWS: f64 = 1.0;

/// Decision whether light is spread as waves are, with whether that matters; of pictures of light behind a lens.
pub(crate) fn decision(scene: &Scene, plan: &Plan) -> Option<Decision> {
    let lens = scene.camera.lens().filter(|lens| lens.lenslets().is_none())?;
    if !plan.layers.contains(&LayerSpec::Radiance) {
        return None;
    }
    let value = match lens.diffracts() {
        true => DecisionValue::Words("waves".into()),
        false => DecisionValue::Switch(false),
    };
    Some(Decision::new(DecisionKind::Diffraction, value, because(scene, lens)))
}

fn because(scene: &Scene, lens: &LensCamera) -> String {
    let disc = AIRY * 1e3 * lens.airy_unit(GREEN);
    let pixels = disc / lens.focused().pixel_pitch();
    let size = format!("at {GREEN:.0} nm the Airy disc is {disc:.2} um wide, {pixels:.2} pixels");
    let blur = blur(scene, lens);
    let against =
        blur.map_or_else(String::new, |[least, most]| match most < 10.0 * least.max(0.1) {
            _ if most < 0.1 => "; everything is in focus".to_owned(),
            true => format!("; what is there is blurred over {most:.1} pixels at most"),
            false => format!("; blur is from {least:.1} to {most:.1} pixels"),
        });
    let sharpest = blur.map_or(0.0, |blur| blur[0]);
    let shows = pixels > SHOWS && pixels > 0.5 * sharpest;
    let verdict = match (lens.diffracts(), shows) {
        (true, true) => {
            "light is spread by the lens' point spread functions along chief rays: what parts of the pupil see differently is lost"
        }
        (true, false) => {
            "light is spread as waves are, which hardly shows: by rays it would look the same"
        }
        (false, true) => "light is spread by rays alone, and waves would show: set it to true",
        (false, false) => "light is spread by rays alone, and waves would hardly show",
    };
    format!("{verdict}; {size}{against}")
}

/// The nearest and the farthest depth (m) of things before the camera.
pub(super) fn depths(scene: &Scene) -> Option<[f64; 2]> {
    let bounds = scene.geometry.loose_bounds();
    if bounds.is_empty() {
        return None;
    }
    let pose = scene.camera.pose();
    let corners = bounds.corners();
    let depth = |corner: DVec3| (corner - pose.position).dot(pose.forward());
    let depths: Vec<f64> = corners.into_iter().map(depth).collect();
    let far = depths.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if far <= 0.0 {
        return None;
    }
    // Things behind the camera, or in it, are not seen.
    let near = depths.iter().copied().fold(f64::INFINITY, f64::min).max(0.05 * far);
    Some([near, far])
}

/// The least and the greatest diameter (pixels) of blur between the nearest and the farthest thing.
fn blur(scene: &Scene, lens: &LensCamera) -> Option<[f64; 2]> {
    let [near, far] = depths(scene)?;
    let focus = 1.0 / lens.focused().object_distance();
    let waves = |depth: f64| lens.waves_of_defocus(GREEN) * (1.0 / depth - focus);
    let [near, far] = [near, far].map(waves);
    // A cone of W waves at its rim is 8 WλN wide.
    let unit = 8.0 * 1e3 * lens.airy_unit(GREEN) / lens.focused().pixel_pitch();
    let least = if near * far <= 0.0 { 0.0 } else { near.abs().min(far.abs()) };
    Some([least * unit, near.abs().max(far.abs()) * unit])
}
