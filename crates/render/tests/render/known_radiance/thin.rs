//! Thin bodies, walls and gaps that light goes through, wherever they are: f32 where the plan takes it shows what f64 does.

use etendue_accel::AccelName;
use etendue_geometry::HitPrecision;
use etendue_render::Plan;
use etendue_render::output::Outputs;
use etendue_scene::file::LightPrecision;

use super::{picture, ways};
use crate::steps::{load, mean};

/// Scene of a thin thing that light goes through, `d` thick or away from what follows, at the place `at` (m), turned by
/// 35°. All else is as large as it, or more: two things 200 m apart, so that none is as small as a pane is thin.
fn scene(kind: &str, d: f64, at: f64) -> String {
    let scale = d.max(1.0);
    let (side, far) = (3.0 * scale, 100.0 * scale);
    let thing = |x: f64| {
        let size = 9.0 * scale;
        format!(
            r#"{{"shape": "box", "size": [{size}, {size}, {size}], "material": "grey", "transform": {{"translate": [{x}, 0, 0]}}}}"#
        )
    };
    let things = [thing(-far), thing(far)].join(", ");
    let turned = |x: f64, y: f64, z: f64| {
        format!(
            r#""transform": {{"translate": [{}, {}, {}], "rotate": [0, 1, 0, 35]}}"#,
            x + at,
            y + at,
            z + at
        )
    };
    let (sin, cos) = 35.0_f64.to_radians().sin_cos();
    let pane = |material: &str| {
        format!(
            r#"{{"shape": "box", "size": [{side}, {side}, {d}], "material": "{material}", {}}}"#,
            turned(0.0, 0.0, 0.0)
        )
    };
    let sheet = |material: &str, along: f64| {
        let place = turned(along * sin, 0.0, along * cos);
        format!(
            r#"{{"shape": "rectangle", "width": {side}, "height": {side}, "material": "{material}", {place}}}"#
        )
    };
    let objects = match kind {
        "tinted" | "absorbing" => pane(kind),
        "gap" => format!("{}, {}", sheet("wall", d), sheet("grey", 0.0)),
        "double" => format!("{}, {}", sheet("wall", d), sheet("wall", 0.0)),
        _ => panic!("{kind}"),
    };
    // Pixels that f32 tells apart at any of these distances.
    let height = 1e-3 * d.max(1.0);
    format!(
        r#"{{"etendue": 1, "tracer": {{"type": "path"}},
        "camera": {{"type": "orthographic", "height": {height},
            "pose": {{"from": [{at}, {at}, {}], "look_at": [{at}, {at}, {at}]}},
            "sensor": {{"resolution": [8, 8]}}}},
        "lights": [{{"type": "environment"}}],
        "objects": [{objects}, {things}],
        "materials": {{"grey": {{"type": "matte", "color": [0.5, 0.5, 0.5]}},
            "tinted": {{"type": "dielectric", "color": [0.5, 0.5, 0.5]}},
            "absorbing": {{"type": "dielectric", "ior": 1.2,
                "absorption": {{"color": [0.3, 0.3, 0.3], "distance": {d}}}}},
            "wall": {{"type": "gltf", "color": [0.5, 0.5, 0.5], "transmission": 1, "roughness": 0}}}},
        "render": {{"samples": 256}}}}"#,
        at + side
    )
}

#[test]
fn single_precision_is_taken_where_it_shows_what_double_does() {
    if !ways().iter().any(|way| way.1 == LightPrecision::Single) {
        return;
    }
    let mut singles = Vec::new();
    for kind in ["tinted", "absorbing", "gap", "double"] {
        for d in [1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0, 1000.0] {
            for at in [0.0, 20.0, 100.0, 1000.0] {
                let text = scene(kind, d, at);
                let plan = Plan::new(&load(&text), Outputs::from_list("exr").unwrap());
                // f64 is f64: only what the plan takes f32 for is of interest.
                if plan.light_precision != HitPrecision::Single {
                    continue;
                }
                singles.push((kind, d, at));
                let shown = |precision| mean(&picture(load(&text), (AccelName::Embree, precision)));
                let [auto, double] = [LightPrecision::Auto, LightPrecision::Double].map(shown);
                // The promise; of 16384 paths some tens go another way by rounding, each a sixteenth of it, to either side.
                assert!(
                    (auto / double - 1.0).abs() < 1e-3,
                    "{kind} {d} {at}: {auto}, not {double}"
                );
            }
        }
    }
    // Where nothing can be skipped, f32 does.
    for place in [
        ("tinted", 0.01, 20.0),
        ("gap", 0.1, 0.0),
        ("double", 1.0, 100.0),
        ("absorbing", 1000.0, 0.0),
    ] {
        assert!(singles.contains(&place), "{singles:?}");
    }
    assert!(singles.iter().all(|&(_, d, _)| d > 1e-4), "{singles:?}");
}

/// The plan says how thin what is.
#[test]
fn the_plan_names_what_is_thin() {
    let words = |kind: &str, d: f64| {
        let scene = load(&scene(kind, d, 0.0));
        Plan::new(&scene, Outputs::from_list("exr").unwrap()).to_string()
    };
    if !ways().iter().any(|way| way.1 == LightPrecision::Single) {
        return;
    }
    let thin = words("tinted", 1e-4);
    assert!(thin.contains("the thickness of \"tinted\", 1.0e-4 m"), "{thin}");
    let gap = words("gap", 2e-5);
    assert!(
        gap.contains("\"wall\" and \"grey\", 2.0e-5 m")
            || gap.contains("\"grey\" and \"wall\", 2.0e-5 m"),
        "{gap}"
    );
    let wide = words("tinted", 0.1);
    assert!(wide.contains("light goes through, surfaces are over"), "{wide}");
}
