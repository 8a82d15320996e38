//! Bodies in bodies, bodies that touch, and cameras and lamps in them.

use etendue_tracer::bsdf::fresnel;

use super::{assert_shows, check, patch, picture, ways};
use crate::steps::{load, mean};

/// A wall of radiance 1 behind everything.
const LAMP: &str = r#"{"shape": "rectangle", "width": 90, "height": 90, "material": "lamp",
    "transform": {"translate": [0, 0, -2]}}"#;

fn block(size: [f64; 3], z: f64, material: &str) -> String {
    format!(
        r#"{{"shape": "box", "size": {size:?}, "material": "{material}", "transform": {{"translate": [0, 0, {z}]}}}}"#
    )
}

/// Transmittance of a stack of parallel layers whose indices follow one another, from air to air, of light that comes
/// in at a cosine: of boundaries without loss of reflectances Rᵢ, (1 − T)/T = Σ Rᵢ/(1 − Rᵢ) (Stokes 1862).
fn passes(indices: &[f64], cosine: f64) -> f64 {
    let sine = (1.0 - cosine * cosine).sqrt();
    let mut sum = 0.0;
    let mut before = 1.0;
    for &index in indices.iter().chain(&[1.0]) {
        let inside = (1.0 - (sine / before) * (sine / before)).sqrt();
        let (reflectance, _) = fresnel::dielectric(inside, index / before);
        sum += reflectance / (1.0 - reflectance);
        before = index;
    }
    1.0 / (1.0 + sum)
}

/// Stacks of bodies: in one another, overlapping, and face to face, before a wall of radiance 1.
#[test]
fn bodies_in_bodies_refract_by_both_media() {
    let materials = r#""lamp": {"type": "emissive", "radiance": [1, 1, 1]},
        "glass": {"type": "dielectric", "ior": 1.5}, "same": {"type": "dielectric", "ior": 1.5},
        "water": {"type": "dielectric", "ior": 1.33}, "air": {"type": "dielectric", "ior": 1.0}"#;
    let outer = block([40.0, 40.0, 1.0], 0.0, "glass");
    let within = |inner: &str| format!("{outer}, {}", block([30.0, 30.0, 0.4], 0.1, inner));
    let beside = |z: f64, other: &str| format!("{outer}, {}", block([40.0, 40.0, 0.5], z, other));
    let stacks: [(&str, String, &[f64]); 8] = [
        ("glass", outer.clone(), &[1.5]),
        ("the same glass within glass", within("same"), &[1.5]),
        ("water in glass", within("water"), &[1.5, 1.33, 1.5]),
        ("an air bubble in glass", within("air"), &[1.5, 1.0, 1.5]),
        ("water that overlaps glass", beside(0.7, "water"), &[1.33, 1.5]),
        ("water on glass", beside(0.75, "water"), &[1.33, 1.5]),
        ("glass on glass", beside(0.75, "same"), &[1.5]),
        (
            "water that shares a face with its glass",
            format!("{outer}, {}", block([30.0, 30.0, 0.5], 0.25, "water")),
            &[1.33, 1.5],
        ),
    ];
    for from in [[0.0, 0.0, 3.0], [2.0, 1.0, 3.0], [5.0, 0.3, 3.0]] {
        let [x, y, z]: [f64; 3] = [from[0], from[1], from[2] - 0.5];
        let cosine = z / (x * x + y * y + z * z).sqrt();
        for (name, objects, indices) in &stacks {
            let rest = format!(
                r#""lights": [], "objects": [{objects}, {LAMP}], "materials": {{{materials}}}"#
            );
            let known = passes(indices, cosine);
            // Every way face on, and one of them from the side.
            let count = if cosine == 1.0 { usize::MAX } else { 1 };
            for way in ways().into_iter().take(count) {
                let scene = load(&patch("path", 256, from, [0.0, 0.0, 0.5], &rest));
                let shown = mean(&picture(scene, way));
                // Of 16 384 paths, each of which comes through or does not.
                let noise = 4.0 * (known * (1.0 - known) / 16384.0).sqrt();
                assert!((shown - known).abs() <= noise, "{name}, {way:?}: {shown}, not {known}");
            }
        }
    }
}

/// One boundary inside of glass seen face on from the glass, with a wall of radiance 1 in the body behind it: of light
/// that the boundary (R) and the glass' far face (S) throw back and forth, (1 − R)/(1 − R S) comes from the wall, and
/// radiance goes as the square of the index.
#[test]
fn a_boundary_within_a_body_shows_what_is_behind_it_to_a_thousandth() {
    let bare = |index: f64| fresnel::dielectric(1.0, index).0;
    for (inner, ratio) in [("same", 1.0), ("water", 1.33 / 1.5), ("air", 1.0 / 1.5)] {
        let rest = format!(
            r#""lights": [], "objects": [{}, {}, {{"shape": "rectangle", "width": 9, "height": 9, "material": "lamp"}}],
            "materials": {{"glass": {{"type": "dielectric", "ior": 1.5}}, "same": {{"type": "dielectric", "ior": 1.5}},
                "water": {{"type": "dielectric", "ior": 1.33}}, "air": {{"type": "dielectric", "ior": 1.0}},
                "lamp": {{"type": "emissive", "radiance": [1, 1, 1]}}}}"#,
            block([40.0, 40.0, 8.0], 0.0, "glass"),
            block([20.0, 20.0, 2.0], 0.0, inner),
        );
        let (boundary, face) = (bare(ratio), bare(1.5));
        let known = (1.0 - boundary) / (1.0 - boundary * face) / (ratio * ratio);
        for way in [ways()[0], ways()[ways().len() - 1]] {
            // From one place, whose media are found once.
            let text = patch("path", 2048, [0.0, 0.0, 3.0], [0.0; 3], &rest);
            let pinhole = r#""type": "pinhole", "fov": 0.01"#;
            let scene = load(&text.replace(r#""type": "orthographic", "height": 1e-3"#, pinhole));
            let shown = mean(&picture(scene, way));
            // Of 131 072 paths one standard error is 0.05 % where R is 4 %, and a third of it on Sobol points.
            assert!((shown / known - 1.0).abs() < 1e-3, "{inner}, {way:?}: {shown}, not {known}");
        }
    }
}

/// Lenses in a medium and before one: a metre that leaves half of the light leaves half of the picture. Where half of a
/// lens is in it, half of its rays are.
#[test]
fn a_lens_sees_through_the_medium_that_it_is_in_and_that_it_looks_at() {
    let singlet = r#""type": "lens", "lens": {"elements": [
        {"type": "surface", "radius": 50, "thickness": 2, "glass": {"n": 1.5}, "semi_diameter": 5, "stop": true},
        {"type": "surface", "radius": -50, "semi_diameter": 5}]}"#;
    for lens in [r#""type": "thin_lens", "focal_length": 50"#, singlet] {
        let shown = |objects: &str| {
            // Rays are within 2·10⁻⁴ of the axis, and their ways within 10⁻⁷ of what they are along it.
            let scene = load(&format!(
                r#"{{"etendue": 1, "tracer": {{"type": "path"}}, "lights": [{{"type": "environment"}}],
                "camera": {{{lens}, "f_number": 50, "focus_distance": 4, "fov": 0.002,
                    "pose": {{"from": [0, 0, 0], "look_at": [0, 0, -1]}}, "sensor": {{"resolution": [8, 8]}}}},
                "objects": [{objects}{{"shape": "sphere", "radius": 0.1, "material": "half",
                    "transform": {{"translate": [0, 0, 9]}}}}],
                "materials": {{"half": {{"type": "dielectric", "ior": 1.0,
                    "absorption": {{"color": [0.5, 0.5, 0.5], "distance": 1}}}}}},
                "render": {{"samples": 64}}}}"#
            ));
            mean(&picture(scene, ways()[0]))
        };
        let body = |x: f64, near: f64, far: f64| {
            let size = [4.0, 4.0, near - far];
            format!(
                r#"{{"shape": "box", "size": {size:?}, "material": "half",
                    "transform": {{"translate": [{x}, 0, {}]}}}}, "#,
                0.5 * (near + far)
            )
        };
        let open = shown("");
        let is = |what: &str, share: f64, known: f64, within: f64| {
            assert!((share / known - 1.0).abs() < within, "{lens}, {what}: {share}, not {known}");
        };
        is("a slab before it", shown(&body(0.0, -1.0, -2.0)) / open, 0.5, 1e-5);
        // One metre more of the medium that it is in: wherever in the lens rays start, that is half.
        let [one, two] = [-1.0, -2.0].map(|far| shown(&body(0.0, 1.0, far)));
        is("the medium that it is in", two / one, 0.5, 1e-5);
        // A lens is a few millimetres long: as much of a metre.
        is("the way to the medium's end", one / open, 0.5, 5e-3);
        // Rays that start within a tenth of the half-diameter of the medium's face may leave or enter it on their way.
        is("half of a lens", shown(&body(2.0, 1.0, -1.0)) / open, 0.75, 0.02);
    }
}

/// The medium that the camera is in takes from its first segment: one metre at 0.5 per metre, and half of it at 0.25.
#[test]
fn a_camera_within_a_body_sees_through_it() {
    let materials = r#""half": {"type": "dielectric", "ior": 1.0,
            "absorption": {"color": [0.5, 0.5, 0.5], "distance": 1}},
        "quarter": {"type": "dielectric", "ior": 1.0,
            "absorption": {"color": [0.25, 0.25, 0.25], "distance": 1}}"#;
    let outer = block([2.0, 2.0, 2.0], 0.0, "half");
    let inner = block([1.0, 1.0, 1.0], 0.0, "quarter");
    for (name, objects, known) in [
        ("one", outer.clone(), 0.5),
        ("two", format!("{outer}, {inner}"), 0.5_f64.sqrt() * 0.5),
        ("two the other way", format!("{inner}, {outer}"), 0.5_f64.sqrt() * 0.5),
    ] {
        let rest = format!(
            r#""lights": [{{"type": "environment"}}], "objects": [{objects}], "materials": {{{materials}}}"#
        );
        // In f32 each start of a ray takes 10⁻⁶ of a metre off its way.
        check(name, 1, [[0.0; 3], [0.0, 0.0, -3.0]], &rest, |_| (), 2e-6, |_| known);
    }
}

/// A lamp, the wall that it lights and the camera in one absorbing medium: I/(π d²) of the wall's colour, by what the
/// medium leaves over the ways to the wall and from it.
#[test]
fn light_within_a_body_is_absorbed_on_its_way_to_the_wall() {
    let at = |light: &str| {
        format!(
            r#""lights": [{light}],
            "objects": [{}, {}, {{"shape": "rectangle", "width": 1, "height": 1, "material": "wall"}}],
            "materials": {{"wall": {{"type": "matte", "color": [1, 1, 1]}},
                "half": {{"type": "dielectric", "ior": 1.33,
                    "absorption": {{"color": [0.5, 0.5, 0.5], "distance": 1}}}},
                "clear": {{"type": "dielectric", "ior": 1.33}}}}"#,
            block([6.0, 6.0, 6.0], 0.0, "half"),
            block([2.0, 2.0, 0.5], 1.0, "clear"),
        )
    };
    let rest = at(r#"{"type": "point", "at": [0, 0, 2], "intensity": [1, 1, 1]}"#);
    // Two metres down and half a metre up; of both half a metre is in the clear body, but none of the camera's way.
    let known = 1.0 / 4.0 / std::f64::consts::PI * 0.5_f64.powf(1.5 + 0.5);
    for tracer in ["direct", "whitted"] {
        for way in ways() {
            let scene = load(&patch(tracer, 4, [0.0, 0.0, 0.5], [0.0; 3], &rest));
            assert_shows(&format!("{tracer} {way:?}"), &picture(scene, way), known, 2e-6);
        }
    }
}

/// Surfaces between a wall of radiance 1 and its viewer, and between a point and a floor: sheets that are partly there,
/// which each take their share of what is left, and bodies of the index of air, which tint at both boundaries.
#[test]
fn surfaces_that_light_passes_take_their_shares_one_by_one() {
    let materials = r#""lamp": {"type": "emissive", "radiance": [1, 1, 1]},
        "floor": {"type": "matte", "color": [0.5, 0.5, 0.5]},
        "veil": {"type": "gltf", "color": [0, 0, 0], "metallic": 1, "opacity": 0.4},
        "tinted": {"type": "dielectric", "ior": 1.0, "color": [0.5, 0.5, 0.5]}"#;
    let veil = |z: f64| {
        format!(
            r#"{{"shape": "rectangle", "width": 2, "height": 2, "material": "veil", "transform": {{"translate": [0, 0, {z}]}}}}"#
        )
    };
    let floor = r#"{"shape": "rectangle", "width": 9, "height": 9, "material": "floor"}"#;
    let point = r#"{"type": "point", "at": [0, 0, 6], "intensity": [36, 36, 36]}"#;
    let body = block([2.0, 2.0, 0.3], 1.0, "tinted");
    for (name, between, share) in [
        ("a veil", veil(1.0), 0.6),
        ("four veils", [1.0, 1.5, 2.0, 3.5].map(veil).join(", "), 0.6_f64.powi(4)),
        ("a tinted body", body.clone(), 0.25),
        ("a veil and a tinted body", format!("{}, {body}", veil(2.0)), 0.15),
    ] {
        let seen = format!(
            r#""lights": [], "objects": [{between}, {LAMP}], "materials": {{{materials}}}"#
        );
        let lit = format!(
            r#""lights": [{point}], "objects": [{between}, {floor}], "materials": {{{materials}}}"#
        );
        for way in ways() {
            let shown =
                mean(&picture(load(&patch("direct", 256, [0.0, 0.0, 5.0], [0.0; 3], &seen)), way));
            // Of 16 384 paths, each of which comes through or does not.
            let noise = 4.0 * (share * (1.0 - share) / 16384.0).sqrt();
            assert!((shown - share).abs() <= noise, "{name}, {way:?}: {shown}, not {share}");
            // Rays to a point are dimmed by what is there of each, without chance. The patch is as large as a pixel.
            let shown =
                mean(&picture(load(&patch("direct", 4, [8.0, 0.0, 4.0], [0.0; 3], &lit)), way));
            let known = 0.5 * std::f64::consts::FRAC_1_PI * share;
            assert!(
                (shown / known - 1.0).abs() < 1e-5,
                "{name}, lit, {way:?}: {shown}, not {known}"
            );
        }
    }
}

/// A lamp behind a sheet that is not there, or a body of air, is as bright as without it: at any distance from it, tilted, and
/// through it. The same random numbers are drawn, so that roundings alone differ; a lamp hidden by its own surface, which
/// rays end on, would take a tenth and more.
#[test]
fn what_is_not_there_takes_nothing_of_lamps() {
    let materials = r#""lamp": {"type": "emissive", "radiance": [3, 3, 3], "two_sided": true},
        "floor": {"type": "matte", "color": [0.5, 0.5, 0.5]},
        "none": {"type": "gltf", "color": [0, 0, 0], "opacity": 0},
        "air": {"type": "dielectric", "ior": 1.0}"#;
    let sheet = |z: f64, tilt: f64| {
        format!(
            r#", {{"shape": "rectangle", "width": 3, "height": 3, "material": "none",
                "transform": {{"translate": [0.8, 0.1, {z}], "rotate": [1, 0.3, 0, {tilt}]}}}}"#
        )
    };
    let ball = r#", {"shape": "sphere", "radius": 0.6, "material": "air", "transform": {"translate": [0.9, 0.3, 1.2]}}"#;
    let seen = |between: &str, tracer: &str| {
        let rest = format!(
            r#""lights": [], "materials": {{{materials}}}, "objects": [
                {{"shape": "rectangle", "width": 9, "height": 9, "material": "floor"}},
                {{"shape": "disk", "radius": 0.5, "triangles": 16, "material": "lamp",
                    "transform": {{"translate": [0.9, 0.2, 1.1]}}}}{between}]"#
        );
        load(&patch(tracer, 64, [-3.0, 0.5, 2.5], [0.0; 3], &rest))
    };
    let near = [1.0995, 1.07, 1.0, 0.8].map(|z| (format!("at {z} m"), sheet(z, 0.0)));
    let others = [
        ("two".to_owned(), sheet(1.05, 0.0) + &sheet(0.9, 0.0)),
        ("tilted".to_owned(), sheet(0.9, 20.0)),
        ("through it".to_owned(), sheet(1.1, 20.0)),
        ("a body of air".to_owned(), ball.to_owned()),
    ];
    for tracer in ["direct", "path"] {
        for way in ways() {
            let known = mean(&picture(seen("", tracer), way));
            for (name, between) in near.iter().chain(&others) {
                let shown = mean(&picture(seen(between, tracer), way));
                assert!(
                    (shown / known - 1.0).abs() < 1e-4,
                    "{name}, {tracer}, {way:?}: {shown}, not {known}"
                );
            }
        }
    }
}
