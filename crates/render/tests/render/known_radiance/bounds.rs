//! Tests of what no picture may do: show what is no number, light where none can be, or the scale of its scene.

use etendue_accel::AccelName;
use etendue_render::output::{Outputs, Values};
use etendue_render::{Plan, render};
use etendue_scene::file::LightPrecision;
use etendue_tracer::Paint;

use super::{TRACERS, divide, patch, picture, ways};
use crate::steps::{load, prepare};

/// Radiance that is no number is left out and counted, and the picture has numbers only.
#[test]
fn what_is_not_finite_is_counted_and_left_out() {
    for tracer in TRACERS {
        let mut scene = load(&patch(
            tracer,
            4,
            [0.0, 0.0, 3.0],
            [0.0; 3],
            r#""lights": [{"type": "environment"}], "objects": [
                {"shape": "rectangle", "width": 4, "height": 4, "material": "m"},
                {"shape": "rectangle", "width": 1, "height": 1, "material": "lamp",
                 "transform": {"translate": [0, 0, -1]}}],
            "materials": {"lamp": {"type": "emissive", "radiance": [1, 1, 1]},
                "m": {"type": "gltf", "color": [1, 1, 1], "opacity": 0.5}}"#,
        ));
        let emitter = scene.materials.iter_mut().find(|m| m.name == "lamp").unwrap();
        emitter.emission.as_mut().unwrap().radiance = Paint::Plain([f64::NAN, 1.0, f64::INFINITY]);
        scene.render.accel = Some(AccelName::Bvh);
        let plan = Plan::new(&scene, Outputs::from_list("exr").unwrap());
        let (accel, images) = prepare(&scene, &plan);
        let done = render(&scene, &plan, &*accel, &images, Vec::new(), &|_: f64| true).unwrap();
        assert!(done.light.not_finite > 0, "{tracer}");
        for channel in &done.picture.layers()[0].channels {
            let Values::F32(values) = &channel.values else { panic!("a picture is f32") };
            assert!(values.iter().all(|v| v.is_finite()), "{tracer}");
        }
    }
}

/// A closed box in a blinding sky is dark inside: exactly.
#[test]
fn no_light_leaks_into_a_closed_box() {
    assert_dark_inside(1);
}

/// Nor where it has more than the 64 triangles that are traced without a tree: by the accelerator itself, through edges
/// and corners all over its faces.
#[test]
fn no_light_leaks_into_a_closed_box_of_many_triangles() {
    assert_dark_inside(8);
}

/// That a closed box is dark whose triangles are each divided into `n`².
fn assert_dark_inside(n: u32) {
    for tracer in TRACERS {
        for way in ways() {
            let mut scene = load(&format!(
                r#"{{"etendue": 1, "tracer": {{"type": "{tracer}"}},
                "camera": {{"type": "pinhole", "fov": 100,
                    "pose": {{"from": [0.3, 0.1, 0.2], "look_at": [-1, -1, -1]}},
                    "sensor": {{"resolution": [48, 48]}}}},
                "lights": [{{"type": "environment", "radiance": [1e6, 1e6, 1e6]}},
                    {{"type": "point", "at": [0, 5, 0], "intensity": [1e6, 1e6, 1e6]}}],
                "objects": [{{"shape": "box", "size": [2, 2, 2], "material": "m"}},
                    {{"shape": "box", "size": [0.5, 0.5, 0.5], "material": "m",
                      "transform": {{"translate": [-0.75, -0.75, -0.75]}}}}],
                "materials": {{"m": {{"type": "matte", "color": [0.9, 0.9, 0.9]}}}},
                "render": {{"samples": {}}}}}"#,
                // Paths of f32 alone: three million rays.
                if tracer == "path" && way.1 == LightPrecision::Single { 64 } else { 16 }
            ));
            divide(&mut scene, n);
            assert_eq!(scene.geometry.triangles(), 24 * u64::from(n * n));
            let lit = picture(scene, way).iter().filter(|&&p| p != 0.0).count();
            assert_eq!(lit, 0, "{tracer} {way:?}");
        }
    }
}

/// A scene in millimetres, metres and kilometres, and moved by 10⁶ m, gives the same picture: hits
/// differ by roundings, so a random choice or an edge may fall the other way in a few pixels.
#[test]
fn neither_scale_nor_place_changes_the_picture() {
    let at = |scale: f64, far: f64| {
        let place = |x: f64, y: f64, z: f64| [x * scale + far, y * scale + far, z * scale + far];
        load(&format!(
            r#"{{"etendue": 1, "tracer": {{"type": "path", "max_bounces": 4}},
            "camera": {{"type": "pinhole", "fov": 40,
                "pose": {{"from": {:?}, "look_at": {:?}}},
                "sensor": {{"resolution": [32, 32]}}}},
            "lights": [{{"type": "environment", "radiance": [0.5, 0.5, 0.5]}},
                {{"type": "directional", "direction": [1, -2, -1], "irradiance": [2, 2, 2]}}],
            "objects": [
                {{"shape": "rectangle", "width": {}, "height": {}, "material": "m",
                  "transform": {{"translate": {:?}, "rotate": [1, 0, 0, -90]}}}},
                {{"shape": "sphere", "radius": {}, "triangles": 2000, "material": "g",
                  "transform": {{"translate": {:?}}}}}],
            "materials": {{"m": {{"type": "matte", "color": [0.5, 0.6, 0.7]}},
                "g": {{"type": "gltf", "metallic": 0.2, "roughness": 0.3}}}},
            "render": {{"samples": 8}}}}"#,
            place(2.0, 2.0, 3.0),
            place(0.0, 0.3, 0.0),
            10.0 * scale,
            10.0 * scale,
            place(0.0, 0.0, 0.0),
            scale,
            place(0.0, 1.0, 0.0),
        ))
    };
    for way in ways() {
        let metres = picture(at(1.0, 0.0), way);
        // So far away f32 is no choice: the plan takes f64.
        let fars: &[f64] = if way.1 == LightPrecision::Single { &[] } else { &[1e6] };
        let moved = fars.iter().map(|&far| (1.0, far));
        for (scale, far) in [(1e-3, 0.0), (1e3, 0.0)].into_iter().chain(moved) {
            let other = picture(at(scale, far), way);
            let differ = |(a, b): &(&f64, &f64)| (*a - *b).abs() > 1e-4 * a.max(0.1);
            let count = metres.iter().zip(&other).filter(differ).count();
            // One in a hundred pixels, each of 8 paths of up to 4 bounces.
            assert!(count <= 10, "{way:?} scale {scale} far {far}: {count} of 1024 differ");
        }
    }
}
