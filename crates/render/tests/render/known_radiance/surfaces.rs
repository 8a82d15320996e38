//! Surfaces of every kind in light that is even.

use etendue_scene::Scene;

use super::{assert_shows, check, divide, patch, picture, ways};
use crate::steps::{glow, load};

/// Inside of a closed box whose walls shine by 1 and return ρ: 1 + ρ + ρ² + … = 1/(1 − ρ), and 1 + ρ
/// after one bounce; of few triangles, and of more than are traced without a tree.
#[test]
fn a_closed_furnace() {
    for (albedo, parts) in [(0.2, 1), (0.6, 1), (0.6, 4)] {
        let rest = format!(
            r#""lights": [],
            "objects": [{{"shape": "box", "size": [2, 2, 2], "material": "wall"}}],
            "materials": {{"wall": {{"type": "matte", "color": [{albedo}, {albedo}, {albedo}]}}}}"#
        );
        let shine = |scene: &mut Scene| {
            divide(scene, parts);
            scene.materials[0].emission = Some(glow());
        };
        let eye = [[0.2, 0.1, 0.3], [-0.5, -1.0, 0.2]];
        let name = format!("furnace of {} triangles", 12 * parts * parts);
        check(&name, 64, eye, &rest, shine, 0.0, |tracer| match tracer {
            "path" => 1.0 / (1.0 - albedo),
            _ => 1.0 + albedo,
        });
    }
}

/// A mirror of reflectance 0.7 shows 0.7 of what it sees, and no tracer needs a second surface for
/// the sky.
#[test]
fn a_mirror_under_a_sky() {
    let rest = r#""lights": [{"type": "environment", "radiance": [2, 2, 2]}],
        "objects": [{"shape": "rectangle", "width": 4, "height": 4, "material": "m"}],
        "materials": {"m": {"type": "mirror", "color": [0.7, 0.7, 0.7]}}"#;
    check("mirror", 4, [[1.0, 0.5, 3.0], [0.0; 3]], rest, |_| (), 0.0, |_| 1.4);
}

/// A slab of glass before a wall of radiance 1: with reflectance R of each face, the light that
/// passes after any number of reflections within is (1 − R)/(1 + R). One bounce ends in the slab.
#[test]
fn a_slab_of_glass() {
    let rest = r#""lights": [],
        "objects": [{"shape": "box", "size": [4, 4, 0.2], "material": "glass"},
            {"shape": "rectangle", "width": 40, "height": 40, "material": "lamp",
             "transform": {"translate": [0, 0, -2]}}],
        "materials": {"glass": {"type": "dielectric", "ior": 1.5},
            "lamp": {"type": "emissive", "radiance": [1, 1, 1]}}"#;
    for from in [[0.0, 0.0, 3.0], [2.0, 1.0, 3.0]] {
        let cosine = 3.0 / f64::hypot(f64::hypot(from[0], from[1]), 3.0);
        let (reflectance, _) = etendue_tracer::bsdf::fresnel::dielectric(cosine, 1.5);
        let passed = (1.0 - reflectance) / (1.0 + reflectance);
        check(
            "slab",
            256,
            [from, [0.0; 3]],
            rest,
            |_| (),
            0.0,
            |tracer| match tracer {
                "direct" => 0.0,
                _ => passed,
            },
        );
    }
}

/// White metal, rough as can be, under a white sky looks as white as the sky.
#[test]
fn white_metal_in_a_furnace() {
    for roughness in [0.5, 1.0] {
        let rest = format!(
            r#""lights": [{{"type": "environment"}}],
            "objects": [{{"shape": "rectangle", "width": 9, "height": 9, "material": "m"}}],
            "materials": {{"m": {{"type": "metal", "color": [1, 1, 1], "roughness": {roughness}}}}}"#
        );
        // The table of albedos is exact to 1e-3, which both directions are short of.
        check("metal", 64, [[1.0, 0.5, 3.0], [0.0; 3]], &rest, |_| (), 6e-3, |_| 1.0);
    }
}

/// The slab again, which leaves half of the light after 0.2 m: with a way of 0.2 / cos θ' in the glass,
/// what passes is (1 − R)² T / (1 − R² T²) with T = 0.5 to the power 1 / cos θ'.
#[test]
fn a_slab_of_absorbing_glass() {
    let rest = r#""lights": [],
        "objects": [{"shape": "box", "size": [4, 4, 0.2], "material": "glass"},
            {"shape": "rectangle", "width": 40, "height": 40, "material": "lamp",
             "transform": {"translate": [0, 0, -2]}}],
        "materials": {"glass": {"type": "dielectric", "ior": 1.5,
                "absorption": {"color": [0.5, 0.25, 1], "distance": 0.2}},
            "lamp": {"type": "emissive", "radiance": [1, 1, 1]}}"#;
    for from in [[0.0, 0.0, 3.0], [2.0, 1.0, 3.0]] {
        let cosine = 3.0 / f64::hypot(f64::hypot(from[0], from[1]), 3.0);
        let (reflectance, within) = etendue_tracer::bsdf::fresnel::dielectric(cosine, 1.5);
        let left = 0.5_f64.powf(1.0 / within.unwrap());
        let passed = (1.0 - reflectance).powi(2) * left / (1.0 - (reflectance * left).powi(2));
        let known = |tracer: &str| if tracer == "direct" { 0.0 } else { passed };
        check("absorbing slab", 256, [from, [0.0; 3]], rest, |_| (), 0.0, known);
    }
}

/// A pane that is hardly rough passes what a smooth one does.
#[test]
fn a_slab_of_hardly_rough_glass() {
    let rest = r#""lights": [{"type": "environment"}],
        "objects": [{"shape": "box", "size": [40, 40, 0.2], "material": "glass"}],
        "materials": {"glass": {"type": "dielectric", "ior": 1.5, "roughness": 0.2}}"#;
    // White all around: what its facets lose to one another at α = 0.04 is below 1e-3 a hit.
    for way in ways() {
        let text = patch("path", 256, [0.5, 0.3, 3.0], [0.0; 3], rest);
        assert_shows(&format!("{way:?}"), &picture(load(&text), way), 1.0, 5e-3);
    }
}

/// A ball of rough glass under a sky of radiance 1 shows 1, but for what each of the few surfaces on the way does not
/// give back: up to two percent each. Single scattering alone shows 0.90 and 0.37.
#[test]
fn a_ball_of_rough_glass_in_a_furnace() {
    for roughness in [0.5, 1.0] {
        let rest = format!(
            r#""lights": [{{"type": "environment"}}],
            "objects": [{{"shape": "sphere", "radius": 0.5, "material": "glass"}}],
            "materials": {{"glass": {{"type": "dielectric", "roughness": {roughness}}}}}"#
        );
        for way in ways() {
            let eye = [[0.3, 0.2, 3.0], [0.0; 3]];
            let pixels = picture(load(&patch("path", 256, eye[0], eye[1], &rest)), way);
            let mean = pixels.iter().sum::<f64>() / pixels.len() as f64;
            assert!((0.92..=1.0).contains(&mean), "{roughness}, {way:?}: {mean}");
        }
    }
}

/// White metal returns all light at every roughness, anisotropy and angle: brushed, polished and seen at 88°.
#[test]
fn white_brushed_metal_in_a_furnace() {
    for (roughness, anisotropy) in
        [(0.1, 0.0), (0.1, 1.0), (0.1, 0.5), (0.4, 0.7), (0.8, 1.0), (0.3, 0.2)]
    {
        for (degrees, azimuth) in
            [(0.0_f64, 0.0_f64), (60.0, 20.0), (80.0, 90.0), (80.0, 0.0), (88.0, 45.0)]
        {
            let rest = format!(
                r#""lights": [{{"type": "environment"}}],
                "objects": [{{"shape": "rectangle", "width": 900, "height": 900, "material": "m"}}],
                "materials": {{"m": {{"type": "gltf", "color": [1, 1, 1], "metallic": 1,
                    "roughness": {roughness}, "anisotropy": {anisotropy}}}}}"#
            );
            let ((sin, cos), (y, x)) =
                (degrees.to_radians().sin_cos(), azimuth.to_radians().sin_cos());
            let from = [3.0 * sin * x, 3.0 * sin * y, 3.0 * cos];
            let pixels = picture(load(&patch("path", 256, from, [0.0; 3], &rest)), ways()[0]);
            let name =
                format!("roughness {roughness}, anisotropy {anisotropy}, {degrees}° at {azimuth}°");
            // The table of brushed facets is taken for a hundredth more than it is, which is as exact as it may be.
            assert_shows(&name, &pixels, 1.0, 1.5e-2);
        }
    }
}

/// Sunlight that passes a coloured pane without thickness: E cos θ (1 − F) of the pane's colour, on a white wall.
#[test]
fn the_sun_through_a_pane() {
    for degrees in [0.0_f64, 30.0, 60.0, 75.0] {
        for ior in [1.33, 1.5, 2.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let rest = format!(
                r#""lights": [{{"type": "directional", "direction": [{sin}, 0, {}], "irradiance": [1, 1, 1]}}],
                "objects": [{{"shape": "rectangle", "width": 1, "height": 1, "material": "wall"}},
                    {{"shape": "rectangle", "width": 90, "height": 90, "material": "pane",
                      "transform": {{"translate": [0, 0, 1]}}}}],
                "materials": {{"wall": {{"type": "matte", "color": [1, 1, 1]}},
                    "pane": {{"type": "gltf", "color": [0.4, 0.6, 0.8], "transmission": 1, "roughness": 0,
                        "ior": {ior}}}}}"#,
                -cos
            );
            let (reflected, _) = etendue_tracer::bsdf::fresnel::dielectric(cos, ior);
            let known = 0.4 * (1.0 - reflected) * cos / std::f64::consts::PI;
            let pixels =
                picture(load(&patch("direct", 4, [0.0, 0.2, 0.5], [0.0; 3], &rest)), ways()[0]);
            assert_shows(&format!("{degrees}° {ior}"), &pixels, known, 1e-6);
        }
    }
}
