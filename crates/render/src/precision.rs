//! Precision of the hits of light paths: in f32 where what that misplaces is lost in the picture's
//! noise and under its smallest things, in f64 where it is not.

use etendue_accel::AccelName;
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Bounds, HitPrecision, RayBatch};
use etendue_scene::Scene;
use etendue_scene::file::LightPrecision;
use etendue_tracer::spawn::roundings;

use crate::gaps::{CrossedSurfaces, Gap, crossed_surfaces};
use crate::tolerance::hidden_offset;

/// A pixel must be so many times as wide as f32 rounds the camera's rays by, or its rays fall beside it: a
/// start and a direction, along two axes each, are rounded by half a unit in the last place.
const ROUNDINGS_A_PIXEL: f64 = 4.0;

/// The precision of a scene's light paths for so many samples a pixel, and why.
pub(crate) fn light_precision(scene: &Scene, samples: u32) -> (HitPrecision, String) {
    // What the scene asks for goes first.
    match scene.plan.light_precision {
        LightPrecision::Double => {
            return (HitPrecision::Double, "the scene asks for it".to_owned());
        }
        LightPrecision::Single => {
            return (HitPrecision::Single, "the scene asks for it".to_owned());
        }
        LightPrecision::Auto => {}
    }
    if !scene.render.accel.unwrap_or_else(AccelName::best).has_single() {
        return (HitPrecision::Double, "the accelerator works in f64".to_owned());
    }
    // By how much f32 misplaces rays, against the smallest triangle and what noise hides.
    let bounds = scene.geometry.loose_bounds_within(scene.camera.exposure_span());
    let [nearest, camera] = camera_reach(scene);
    let offset = offset(bounds, camera);
    let noise = scene.accuracy.path_noise / f64::from(samples).sqrt();
    let Some((least, edge)) = smallest(scene) else {
        return (HitPrecision::Single, "there is nothing to hit".to_owned());
    };
    let far = match reach(bounds).max(camera) {
        most if most > 2.0 * reach(scene.geometry.loose_bounds()).max(nearest) => {
            format!(" while things move as far as {most:.1e} m away")
        }
        _ => String::new(),
    };
    let words = |than: &str| format!("f32 misplaces rays by up to {offset:.1e} m{far}, {than}");
    let is_too_fine = offset > scene.accuracy.path_offset_of_edge * edge;
    let hidden = if is_too_fine { hidden_offset(scene) } else { None };
    let hidden = hidden.filter(|hidden| offset <= *hidden);
    if is_too_fine && hidden.is_none() {
        let why = words(&format!("too much for triangles with edges of {edge:.1e} m"));
        return (HitPrecision::Double, why);
    }
    if offset > noise * least {
        let than =
            format!("more of a thing of {least:.1e} m than noise hides at {samples} samples");
        return (HitPrecision::Double, words(&than));
    }
    // Against what a pixel sees.
    let farthest = reach(bounds).max(camera);
    let pixel = pixel_width(scene, farthest);
    let rounding = f64::from(f32::EPSILON) * farthest;
    if pixel.is_some_and(|pixel| pixel < ROUNDINGS_A_PIXEL * rounding) {
        let pixel = pixel.unwrap_or_default();
        let why = format!(
            "f32 rounds camera rays by {rounding:.1e} m, too much for pixels of {pixel:.1e} m"
        );
        return (HitPrecision::Double, why);
    }
    // Against what light goes through: no ray may skip the next surface, and no medium may take another share.
    let crossed = crossed_surfaces(scene, farthest);
    if let Some(why) = too_thin(scene, &crossed) {
        return (HitPrecision::Double, why);
    }
    let cleared = crossed.cleared.map_or_else(String::new, |distance| {
        format!("; where light goes through, surfaces are over {distance:.1e} m apart")
    });
    let hidden = hidden.map_or_else(String::new, |hidden| {
        format!(" and than the {hidden:.1e} m that the tolerance hides of edges of {edge:.1e} m")
    });
    let than =
        format!("less of the smallest thing, {least:.1e} m, than noise hides{hidden}{cleared}");
    (HitPrecision::Single, words(&than))
}

/// Reason why f32 does not do for what light goes through; `None` where it does.
fn too_thin(scene: &Scene, crossed: &CrossedSurfaces) -> Option<String> {
    let name = |placement: usize| {
        let placement = &scene.geometry.placements[placement];
        let material = scene.materials.get(placement.material as usize);
        material.map_or("", |material| material.name.as_str())
    };
    if let Some(Gap { distance, offset, between: [one, other] }) = crossed.gap {
        let of = match one == other {
            true => format!("the thickness of \"{}\"", name(one)),
            false => format!("the gap between \"{}\" and \"{}\"", name(one), name(other)),
        };
        return Some(format!(
            "f32 misplaces rays by up to {offset:.1e} m there, too much for {of}, {distance:.1e} m, which light \
             goes through"
        ));
    }
    if let Some(([extent, offset], placement)) = crossed.small {
        return Some(format!(
            "f32 misplaces rays by up to {offset:.1e} m, too much for \"{}\", {extent:.1e} m across, which light goes \
             through",
            name(placement)
        ));
    }
    let (share, placement) =
        crossed.absorption.filter(|(share, _)| *share > scene.accuracy.path_absorption)?;
    let percent = 100.0 * share;
    let name = name(placement);
    Some(format!(
        "f32 misplaces rays so far that \"{name}\" would absorb up to {percent:.1e} % more or less of light"
    ))
}

/// Greatest distance (m) by which rays start off surfaces in f32: what tracing reckons for a hit at
/// the edge of the scene's `bounds` (m), seen from a camera so far from the world's origin (m).
fn offset(bounds: Bounds, camera: f64) -> f64 {
    if bounds.is_empty() {
        return 0.0;
    }
    let farthest = reach(bounds);
    // The hit, the placement's own numbers, and where the ray came from.
    roundings(HitPrecision::Single) * (2.0 * farthest + farthest.max(camera))
}

/// The farthest from the world's origin that anything of a box is (m).
fn reach(bounds: Bounds) -> f64 {
    if bounds.is_empty() { 0.0 } else { bounds.min.abs().max(bounds.max.abs()).length() }
}

/// Least and greatest distance of the camera from the world's origin (m) when its shutter opens and
/// closes: of what moves along a line, the most of all.
fn camera_reach(scene: &Scene) -> [f64; 2] {
    let [open, close] = scene.camera.exposure_span();
    let away = |time: f64| scene.camera.pose_at(time).position.length();
    let (first, last) = (away(open), away(close));
    [first.min(last), first.max(last)]
}

/// Distance (m) between the chief rays of two pixels in the middle of the picture at `distance` (m)
/// from the camera; `None` where they have none.
fn pixel_width(scene: &Scene, distance: f64) -> Option<f64> {
    let mut rays = RayBatch::default();
    let [column, row] = scene.camera.resolution().map(|pixels| f64::from(pixels) / 2.0);
    scene.camera.rays_through(&[column, column + 1.0], &[row, row], &mut rays);
    let [one, next] = [0, 1].map(|i| rays.origin(i) + distance * rays.direction(i));
    let width = one.distance(next);
    (width > 0.0 && width.is_finite()).then_some(width)
}

/// The extent of the smallest thing and the shortest mean edge of a mesh (m); `None` without any.
fn smallest(scene: &Scene) -> Option<(f64, f64)> {
    let drawn = scene.geometry.placements.iter().filter(|p| scene.geometry.has_area(p));
    let sizes = drawn.filter_map(|placement| {
        let mesh = scene.geometry.mesh_of(placement);
        let (linear, size) = (&placement.world_from_mesh.linear, mesh.bounds.max - mesh.bounds.min);
        let extent: DVec3 = linear.x_axis.abs() * size.x
            + linear.y_axis.abs() * size.y
            + linear.z_axis.abs() * size.z;
        let extent = extent.max_element();
        // A surface of n triangles is about √(n/2) edges wide.
        let edges = (mesh.triangles.len() as f64 / 2.0).sqrt().max(1.0);
        (extent > 0.0).then_some((extent, extent / edges))
    });
    sizes.reduce(|a, b| (a.0.min(b.0), a.1.min(b.1)))
}

#[cfg(test)]
mod tests {
    use etendue_scene::LoadOptions;
    use etendue_scene::file::SceneFile;
    use serde_json::json;

    use super::*;
    use crate::plan::wanted;

    /// A sphere of 2000 triangles, and a cube of some size (m) at some place (m).
    fn decided(size: f64, place: f64, samples: u32, plan: &serde_json::Value) -> HitPrecision {
        let camera = json!({ "type": "pinhole" });
        held_to(&json!({}), camera, (size, place, samples), plan)
    }

    /// Chosen precision of a scene held to other numbers, seen by a camera 4 m away.
    fn held_to(
        accuracy: &serde_json::Value,
        mut camera: serde_json::Value,
        (size, place, samples): (f64, f64, u32),
        plan: &serde_json::Value,
    ) -> HitPrecision {
        camera["pose"] =
            json!({ "from": [place, place, place + 4.0], "look_at": [place, place, place] });
        let shift = |x: f64| json!({ "translate": [place + x, place, place] });
        let scene = json!({
            "tracer": { "type": "path" }, "plan": plan, "accuracy": accuracy, "render": { "accel": "embree" },
            "camera": camera,
            "objects": [
                { "shape": "sphere", "triangles": 2000, "transform": shift(0.0) },
                { "shape": "box", "size": [size, size, size], "transform": shift(2.0) },
            ],
        });
        let file =
            SceneFile::from_json(&LoadOptions::default().opener, std::path::Path::new("."), scene)
                .unwrap();
        let layers = file.spec.all_layers();
        let scene = file.load(wanted(&layers), &LoadOptions::default()).unwrap();
        light_precision(&scene, samples).0
    }

    #[test]
    #[cfg(feature = "embree")]
    fn single_precision_is_chosen_where_its_error_is_lost() {
        use HitPrecision::{Double, Single};
        let auto = json!({});
        assert_eq!(decided(0.5, 0.0, 64, &auto), Single);
        // 10⁵ times smaller than the scene, far from the origin, or of next to no noise.
        assert_eq!(decided(1e-5, 0.0, 64, &auto), Double);
        assert_eq!(decided(0.5, 1e6, 64, &auto), Double);
        assert_eq!(decided(0.01, 0.0, 1 << 20, &auto), Double);
        // Held to less, and to more.
        let pinhole = || json!({ "type": "pinhole" });
        let held = |key: &str, value: f64, size| {
            held_to(&json!({ key: value }), pinhole(), (size, 0.0, 64), &auto)
        };
        assert_eq!(held("path_noise", 1e-6, 0.5), Double);
        assert_eq!(held("path_offset_of_edge", 1e-6, 0.5), Double);
        let held_much =
            held_to(&json!({ "path_noise": 1e3 }), pinhole(), (0.01, 0.0, 1 << 20), &auto);
        assert_eq!(held_much, Single);
        // Pixels that f32 cannot tell apart: rows of some 10⁻⁵ and 10⁻¹⁰ m, and of 10⁻⁴ and 10⁻⁹ of a degree.
        let seen = |camera| held_to(&json!({}), camera, (0.5, 0.0, 64), &auto);
        let narrow = |fov: f64| json!({ "type": "pinhole", "fov": fov });
        let orthographic = |height: f64| json!({ "type": "orthographic", "height": height });
        assert_eq!(seen(orthographic(4.8e-3)), Single);
        assert_eq!(seen(orthographic(4.8e-8)), Double);
        assert_eq!(seen(narrow(0.1)), Single);
        assert_eq!(seen(narrow(4.8e-7)), Double);
        // The file's word goes before.
        assert_eq!(decided(0.5, 0.0, 64, &json!({ "light_precision": "double" })), Double);
        assert_eq!(decided(1e-5, 0.0, 64, &json!({ "light_precision": "single" })), Single);
    }
}
