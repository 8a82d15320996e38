//! Light in blocks of rays against light in batches: the same paths by two ways, whose random numbers are the same.

use std::sync::Arc;

use etendue_accel::{Accel, BuildOptions, BuildReport, Bvh};
use etendue_geometry::{HitBatch, RayBatch};
use etendue_render::Plan;
use etendue_render::output::Outputs;

use crate::steps::{channels, load, prepare, trace};

/// A structure that traces batches alone.
#[derive(Debug)]
struct Batches<'a>(&'a dyn Accel);

impl Accel for Batches<'_> {
    fn closest(&self, rays: &RayBatch, hits: &mut HitBatch) {
        self.0.closest(rays, hits);
    }

    fn occluded(&self, rays: &RayBatch, blocked: &mut Vec<bool>) {
        self.0.occluded(rays, blocked);
    }

    fn report(&self) -> BuildReport {
        self.0.report()
    }
}

/// A room with a lamp, boxes and a ball, by what is put into it.
fn room(tracer: &str, lights: &str, more: &str, ball: &str) -> String {
    format!(
        r#"{{"etendue": 1, "tracer": {tracer}, "lights": [{lights}],
        "layers": ["direct", "indirect"],
        "camera": {{"type": "pinhole", "fov": 40,
            "pose": {{"from": [0.1, 1, 3.4], "look_at": [0, 0.9, 0]}},
            "sensor": {{"resolution": [48, 48]}}}},
        "objects": [
            {{"shape": "rectangle", "width": 4, "height": 4, "material": "floor",
                "transform": {{"rotate": [1, 0, 0, -90]}}}},
            {{"shape": "box", "material": "red", "transform": {{"translate": [-0.5, 0.3, 0], "scale": 0.6}}}},
            {{"shape": "{ball}", "material": "green",
                "transform": {{"translate": [0.6, 0.5, 0.2], "scale": 0.5}}}}
            {more}],
        "materials": {{
            "floor": {{"type": "checker", "colors": [[0.8, 0.8, 0.7], [0.2, 0.3, 0.4]], "squares": 8}},
            "red": {{"type": "matte", "color": [0.7, 0.1, 0.1]}},
            "green": {{"type": "matte", "color": [0.1, 0.5, 0.2]}},
            "lamp": {{"type": "emissive", "radiance": [9, 8, 6]}}}},
        "render": {{"samples": 16}}, "plan": {{"light_precision": "single"}}}}"#
    )
}

const LAMP: &str = r#", {"shape": "rectangle", "material": "lamp", "width": 0.6, "height": 0.6,
    "transform": {"rotate": [1, 0, 0, 90], "translate": [0.2, 2.2, 0.3]}}"#;

const POINTS: &str = r#"{"type": "point", "at": [1, 2, 1], "intensity": [1, 2, 3]},
    {"type": "directional", "direction": [0.2, -1, -0.3], "irradiance": [0.5, 0.5, 0.5]},
    {"type": "spot", "at": [-1, 2, 1], "look_at": [0, 0, 0], "cone": 50, "intensity": [2, 2, 1]}"#;

#[test]
fn blocks_and_batches_follow_the_same_paths() {
    let path = r#"{"type": "path", "max_bounces": 7}"#;
    let direct = r#"{"type": "direct"}"#;
    let sky = r#"{"type": "environment", "radiance": [0.6, 0.7, 0.9]}"#;
    let both = format!("{sky}, {POINTS}");
    let scenes = [
        ("lamp, path", room(path, "", LAMP, "sphere")),
        ("lamp, direct", room(direct, "", LAMP, "box")),
        ("points", room(path, POINTS, "", "sphere")),
        ("sky", room(path, sky, "", "sphere")),
        ("sky, direct", room(direct, sky, "", "box")),
        ("all", room(path, &both, LAMP, "sphere")),
    ];
    for (name, text) in scenes {
        let scene = load(&text);
        let plan = Plan::new(&scene, Outputs::from_list("exr").unwrap());
        let (accel, images) = prepare(&scene, &plan);
        let bvh = Bvh::build(Arc::clone(&scene.geometry), &BuildOptions::default()).unwrap();
        let structures: [&dyn Accel; 2] = [&*accel, &bvh];
        for accel in structures {
            let name = format!("{name}, {}", accel.report().backend);
            if accel.blocks().is_none() {
                continue;
            }
            let blocks = trace(&scene, &plan, accel, &images);
            let batches = trace(&scene, &plan, &Batches(accel), &images);
            for layer in ["", "direct", "indirect"] {
                let [own, other] =
                    [&blocks, &batches].map(|done| channels(&done.picture, layer).concat());
                let total: f64 = other.iter().sum();
                assert!(layer == "indirect" || total > 0.0, "{name}: {layer} is dark");
                let apart = |(a, b): (&f64, &f64)| (a - b).abs() > 1e-4 * (1e-3 + b.abs());
                let differ = own.iter().zip(&other).filter(|&pair| apart(pair)).count();
                // Hits within f32's rounding of an edge or of a shadow's: one sample in some thousands.
                assert!(differ * 50 <= own.len(), "{name}: {differ} of {} in {layer:?}", own.len());
                let sum: f64 = own.iter().sum();
                assert!((sum - total).abs() <= 1e-3 * total.abs(), "{name}: {sum} {total}");
            }
            let rays = [&blocks, &batches].map(|done| done.light.rays as f64);
            assert!((rays[0] / rays[1] - 1.0).abs() < 1e-3, "{name}: {rays:?}");
        }
    }
}
