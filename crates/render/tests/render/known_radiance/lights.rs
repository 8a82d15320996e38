//! Lights of every kind over planes.

use etendue_geometry::glam::DVec3;
use etendue_scene::Scene;
use etendue_tracer::{ClearSky, Paint};

use super::{TRACERS, assert_shows, check, patch, picture, ways};
use crate::steps::{self, load, load_in, mean};

/// A Lambert plane under a point light, ρ I cos θ / (π d²), and under the sun, ρ E cos θ / π: without
/// noise.
#[test]
fn the_cosine_law() {
    let plane = r#""objects": [{"shape": "rectangle", "width": 10, "height": 10, "material": "m"}],
        "materials": {"m": {"type": "matte", "color": [0.5, 0.5, 0.5]}}"#;
    let eye = [[1.0, 0.5, 3.0], [0.0, 0.0, 0.0]];
    let pi = std::f64::consts::PI;
    let point = format!(
        r#""lights": [{{"type": "point", "at": [0, 3, 4], "intensity": [10, 10, 10]}}], {plane}"#
    );
    // The patch is 1 mm wide and the light 5 m away: its mean differs by (1e-3 / 5)².
    check("point", 16, eye, &point, |_| (), 1e-7, |_| 0.5 * 10.0 * 0.8 / (pi * 25.0));
    let sun = format!(
        r#""lights": [{{"type": "directional", "direction": [3, 0, -4],
        "irradiance": [2, 2, 2]}}], {plane}"#
    );
    check("sun", 4, eye, &sun, |_| (), 0.0, |_| 0.5 * 2.0 * 0.8 / pi);
    // From behind the plane is dark.
    let below = [[1.0, 0.5, -3.0], [0.0, 0.0, 0.0]];
    check("behind", 4, below, &sun, |_| (), 0.0, |_| 0.0);
}

/// A spot light of intensity I: I cos θ / (π d²) inside the inner cone, nothing outside of the cone, and
/// between them the square of the share that the cosine has gone (`KHR_lights_punctual`).
#[test]
fn a_spot_light_by_its_cones() {
    let pi = std::f64::consts::PI;
    for (angle, share) in [(20.0_f64, 1.0), (50.0, 2.0), (70.0, 0.0)] {
        let off = angle.to_radians().tan();
        let cosine = angle.to_radians().cos();
        let between = |degrees: f64| degrees.to_radians().cos();
        let share = if share == 2.0 {
            ((cosine - between(60.0)) / (between(40.0) - between(60.0))).powi(2)
        } else {
            share
        };
        let rest = format!(
            r#""lights": [{{"type": "spot", "at": [{off}, 0, 1], "look_at": [{off}, 0, 0],
                "intensity": [10, 10, 10], "cone": 60, "inner_cone": 40}}],
            "objects": [{{"shape": "rectangle", "width": 10, "height": 10, "material": "m"}}],
            "materials": {{"m": {{"type": "matte", "color": [0.5, 0.5, 0.5]}}}}"#
        );
        // d = 1 / cos θ. The patch is 1 mm wide, over which the square bends by a millionth.
        let known = share * 0.5 * 10.0 * cosine.powi(3) / pi;
        check("spot", 16, [[1.0, 0.5, 3.0], [0.0; 3]], &rest, |_| (), 1e-5, |_| known);
    }
}

/// A sun of radius r high over a plane: the mean cosine over its disk is (1 + cos r) / 2 of that of its
/// middle, and where the edge of a wall hides one half of the disk, half of it is left.
#[test]
fn a_sun_with_a_disk() {
    let scene = |more: &str| {
        format!(
            r#""lights": [{{"type": "directional", "direction": [0, 0, -1], "irradiance": [2, 2, 2], "angle": 60}}],
            "objects": [{{"shape": "rectangle", "width": 10, "height": 10, "material": "m"}}{more}],
            "materials": {{"m": {{"type": "matte", "color": [0.5, 0.5, 0.5]}}}}"#
        )
    };
    let eye = [[1.0, 0.5, 0.4], [0.0, 0.0, 0.0]];
    let open = 0.5 * 2.0 / std::f64::consts::PI * 0.5 * (1.0 + 30_f64.to_radians().cos());
    check("disk", 64, eye, &scene(""), |_| (), 0.0, |_| open);
    let wall = r#", {"shape": "rectangle", "width": 100, "height": 100, "transform": {"translate": [-50, 0, 1]}}"#;
    let black = |scene: &mut Scene| {
        scene.materials.iter_mut().filter(|m| m.name.is_empty()).for_each(|material| {
            material.base_color = Paint::Plain([0.0; 3]);
        });
    };
    // The patch is 1 mm wide, and the wall 1 m away: a mean over it differs by less than 10⁻³.
    check("half of it", 256, eye, &scene(wall), black, 1e-3 * open, |_| 0.5 * open);
}

/// A luminaire of I₀ cos θ in the plane of its horizontal angle 0 and half of that across, over a plane: what a
/// point light of that intensity gives, ρ I cos θ / (π r²), without noise.
#[test]
fn a_luminaire_by_its_file() {
    let folder = tempfile::tempdir().unwrap();
    let list = |step: f64, count: u32| (0..count).map(move |k| f64::from(k) * step);
    let words = |all: &mut dyn Iterator<Item = f64>| {
        all.map(|x| x.to_string()).collect::<Vec<_>>().join("\n")
    };
    let values =
        |share: f64| words(&mut list(5.0, 19).map(|v| share * 10.0 * v.to_radians().cos()));
    let (vertical, all, half) = (words(&mut list(5.0, 19)), values(1.0), values(0.5));
    let text = format!(
        "IESNA:LM-63-1995\nTILT=NONE\n1 1000 1 19 2 1 2 0 0 0\n1 1 40\n{vertical}\n0 90\n{all}\n{half}\n"
    );
    std::fs::write(folder.path().join("lamp.ies"), text).unwrap();
    // Down along −Z, its angle 0 along +X, or turned by a quarter.
    for (rotate, shares) in [(0, [1.0, 0.5]), (90, [0.5, 1.0])] {
        let rest = format!(
            r#""lights": [{{"type": "goniometric", "at": [0, 0, 3], "direction": [0, 0, -1], "file": "lamp.ies",
                "rotate": {rotate}}}],
            "objects": [{{"shape": "rectangle", "width": 20, "height": 20, "material": "m"}}],
            "materials": {{"m": {{"type": "matte", "color": [0.5, 0.5, 0.5]}}}}"#
        );
        for (at, share) in [([3.0, 0.0, 0.0], shares[0]), ([0.0, -3.0, 0.0], shares[1])] {
            let text = patch("direct", 4, [0.3, 0.2, 3.0], at, &rest);
            let pixels = picture(load_in(folder.path(), &text), ways()[0]);
            let known = 0.5 * share * 10.0 * 0.5 / (std::f64::consts::PI * 18.0);
            // The patch is 1 mm wide: linear over it but for (1e-3 / 3)², and over the file's five degrees.
            assert_shows(&format!("{rotate} {at:?}"), &pixels, known, 1e-4 * known);
        }
    }
}

/// A projector over a plane that faces it: ρ I / (π z²) all over its image, without noise, by the four
/// texels of an image that lie where they lie as seen from the projector, and nothing beside it.
#[test]
fn a_projector_and_its_image() {
    let folder = tempfile::tempdir().unwrap();
    let texels = image::RgbImage::from_fn(2, 2, |x, y| {
        image::Rgb([[[255, 204], [102, 51]][y as usize][x as usize]; 3])
    });
    texels.save(folder.path().join("four.png")).unwrap();
    let rest = r#""lights": [{"type": "projector", "at": [0, 0, 4], "look_at": [0, 0, 0], "fov": 60,
            "intensity": [8, 8, 8],
            "image": {"image": "four.png", "encoding": "linear", "filter": "nearest"}}],
        "objects": [{"shape": "rectangle", "width": 20, "height": 20, "material": "m"}],
        "materials": {"m": {"type": "matte", "color": [0.5, 0.5, 0.5]}}"#;
    let full = 0.5 * 8.0 / (std::f64::consts::PI * 16.0);
    // Half of the image is tan 30° · 4 m = 2.309 m across.
    for (at, share) in [
        ([-2.2, 1.9, 0.0], 1.0),
        ([2.2, 0.1, 0.0], 0.8),
        ([-0.1, -2.2, 0.0], 0.4),
        ([2.2, -2.2, 0.0], 0.2),
        ([2.4, 1.0, 0.0], 0.0),
        ([1.0, -2.4, 0.0], 0.0),
    ] {
        for tracer in TRACERS {
            for way in ways() {
                let text = patch(tracer, 4, [0.3, 0.2, 3.0], at, rest);
                let pixels = picture(load_in(folder.path(), &text), way);
                assert_shows(&format!("{at:?}, {tracer}, {way:?}"), &pixels, full * share, 0.0);
            }
        }
    }
}

/// A square lamp of radiance L close over a plane: ρ L times its form factor (Howell, B-4, four times).
/// It fills so much of the sky that half of its light is found by directions that nobody aimed; a ball
/// under the plane makes lamps few among the scene's triangles, so that these ask the lamps first.
#[test]
fn a_lamp_close_over_a_plane() {
    let rest = r#""lights": [],
        "objects": [
            {"shape": "rectangle", "width": 10, "height": 10, "material": "m"},
            {"shape": "sphere", "triangles": 2000, "material": "m",
             "transform": {"translate": [0, 0, -3]}},
            {"shape": "rectangle", "width": 4, "height": 4, "material": "lamp",
             "transform": {"rotate": [1, 0, 0, 180], "translate": [0, 0, 1]}}],
        "materials": {"m": {"type": "matte", "color": [0.5, 0.5, 0.5]},
            "lamp": {"type": "emissive", "radiance": [2, 2, 2]}}"#;
    let corner = 2.0 / 5.0_f64.sqrt() * (2.0 / 5.0_f64.sqrt()).atan() / std::f64::consts::PI;
    let known = 0.5 * 2.0 * 4.0 * corner;
    let eye = [[0.3, 0.0, 0.5], [0.0, 0.0, 0.0]];
    check("lamp", 256, eye, rest, |_| (), 0.0, |_| known);
}

/// A Lambert plane under a sky of radiance L shows ρ L.
#[test]
fn a_plane_under_a_sky() {
    let rest = r#""lights": [{"type": "environment", "radiance": [2, 2, 2]}],
        "objects": [{"shape": "rectangle", "width": 10, "height": 10, "material": "m"}],
        "materials": {"m": {"type": "matte", "color": [0.5, 0.5, 0.5]}}"#;
    let eye = [[1.0, 0.5, 3.0], [0.0, 0.0, 0.0]];
    check("sky", 64, eye, rest, |_| (), 0.0, |_| 1.0);
}

/// Lambert planes under a clear sky and its sun, by integration of the model over the hemispheres that they see: one
/// that lies on the ground, and a wall that the sun does not reach.
#[test]
fn planes_under_a_clear_sky() {
    let sky = ClearSky::new(3.0, 40.0, 0.3, true).unwrap();
    let (albedo, pi) = (0.5, std::f64::consts::PI);
    let steps = 400;
    // Red that falls on a plane with the normal from the dome and from ground of this radiance.
    let falling = |normal: DVec3, ground: f64| {
        let mut sum = 0.0;
        for k in 0..steps * steps {
            let at = |i: usize| (i as f64 + 0.5) / steps as f64;
            // Squares of the height resolve the horizon.
            let (u, phi) = (at(k % steps), 2.0 * pi * at(k / steps));
            let (y, weight) = (u * u, 2.0 * u * 2.0 * pi / (steps * steps) as f64);
            let r = (1.0 - y * y).sqrt();
            let up = DVec3::new(r * phi.sin(), y, -r * phi.cos());
            let down = DVec3::new(up.x, -up.y, up.z);
            sum += sky.dome(up)[0] * up.dot(normal).max(0.0) * weight;
            sum += ground * down.dot(normal).max(0.0) * weight;
        }
        sum
    };
    let sun = sky.sun()[0];
    let floor = falling(DVec3::Y, 0.0) + sun * sky.toward_sun().y;
    let ground = 0.3 * floor / pi;
    // Rectangles face +Z, and the sun stands over −Z, or over −X where it is turned.
    let away = falling(DVec3::Z, ground);
    let rest = |turn: &str| {
        format!(
            r#""lights": [{{"type": "sky", "turbidity": 3, "ground_albedo": 0.3, "scale": 2,
                "sun": {{"elevation": 40, "azimuth": -90}}}}],
            "objects": [{{"shape": "rectangle", "width": 10, "height": 10, "material": "m",
                "transform": {{"rotate": {turn}}}}}],
            "materials": {{"m": {{"type": "matte", "color": [{albedo}, {albedo}, {albedo}]}}}}"#
        )
    };
    // The map blurs the horizon by 0.35°, and the midpoint rules are exact to less than that.
    let shown = |falling: f64| 2.0 * albedo * falling / pi;
    let eye = [[1.0, 3.0, 0.5], [0.0; 3]];
    check(
        "floor",
        256,
        eye,
        &rest("[1, 0, 0, -90]"),
        |_| (),
        1e-3 * shown(floor),
        |_| shown(floor),
    );
    let eye = [[3.0, 1.0, 0.5], [0.0; 3]];
    check("wall", 256, eye, &rest("[0, 1, 0, 90]"), |_| (), 2e-3 * shown(away), |_| shown(away));
}

/// A sphere of radiance L over a plane: its form factor is (r/d)² cos θ (Howell, *A Catalog of
/// Radiation Heat Transfer Configuration Factors*, B-34), so the plane shows ρ L (r/d)² cos θ.
#[test]
fn a_sphere_light_over_a_plane() {
    let rest = r#""lights": [],
        "objects": [{"shape": "rectangle", "width": 10, "height": 10, "material": "m"},
            {"shape": "sphere", "radius": 0.5, "triangles": 20000, "material": "lamp",
             "transform": {"translate": [0.9, 0, 1.2]}}],
        "materials": {"m": {"type": "matte", "color": [0.8, 0.8, 0.8]},
            "lamp": {"type": "emissive", "radiance": [3, 3, 3]}}"#;
    let eye = [[-1.0, 0.3, 2.0], [0.0, 0.0, 0.0]];
    let known = 0.8 * 3.0 * (0.25 / 2.25) * (1.2 / 1.5);
    // The triangles' edges cut about 3e-4 off the sphere's outline.
    check("sphere light", 256, eye, rest, |_| (), 1e-3 * known, |_| known);
}

/// A sky of which the upper half is red, tilted to +X: who looks there sees red, and black where it is
/// hidden.
#[test]
fn a_tilted_and_hidden_sky() {
    let folder = tempfile::tempdir().unwrap();
    let half = |_: u32, y: u32| {
        if y < 16 { image::Rgb([1.0_f32, 0.0, 0.0]) } else { image::Rgb([0.0, 0.0, 0.0]) }
    };
    let sky = image::Rgb32FImage::from_fn(64, 32, half);
    image::DynamicImage::from(sky).save(folder.path().join("sky.hdr")).unwrap();
    let scene = |at: [f64; 3], visible: bool| {
        let sky = format!(
            r#""lights": [{{"type": "environment", "image": "sky.hdr", "up": [1, 0, 0],
                "visible": {visible}}}], "objects": [{{"shape": "sphere", "radius": 0.1,
                "transform": {{"translate": [0, 9, 0]}}}}]"#
        );
        let text = patch("path", 64, at, [0.0; 3], &sky);
        picture(load_in(folder.path(), &text), ways()[0])
    };
    let facing = scene([3.0, 0.1, 0.2], true);
    assert!(facing.iter().all(|&p| p < 1e-6), "looking to −X, away from the top: black");
    let facing = scene([-3.0, 0.1, 0.2], true);
    assert!(facing.iter().all(|&p| (p - 1.0).abs() < 0.01), "looking to +X: red");
    let hidden = scene([-3.0, 0.1, 0.2], false);
    assert!(hidden.iter().all(|&p| p == 0.0));
}

/// A small lamp through a ball of glass comes by a few paths, which is said with their share; an even sky does not.
#[test]
fn sparkles_are_told() {
    let notes = |light: &str| {
        let scene = load(&format!(
            r#"{{"etendue": 1, "tracer": {{"type": "path"}},
            "camera": {{"type": "pinhole", "pose": {{"from": [0, 2, 3], "look_at": [0, 0.2, 0]}},
                "sensor": {{"resolution": [48, 48]}}}},
            "lights": [{light}], "objects": [
                {{"shape": "rectangle", "width": 9, "height": 9, "material": "floor", "transform": {{"rotate": [1, 0, 0, -90]}}}},
                {{"shape": "sphere", "radius": 0.5, "triangles": 2000, "material": "glass",
                  "transform": {{"translate": [0, 0.7, 0]}}}},
                {{"shape": "sphere", "radius": 0.1, "triangles": 80, "material": "lamp",
                  "transform": {{"translate": [0, 4, 0]}}}}],
            "materials": {{"floor": {{"type": "matte", "color": [0.5, 0.5, 0.5]}}, "glass": {{"type": "dielectric"}},
                "lamp": {{"type": "emissive", "radiance": [300, 300, 300]}}}},
            "render": {{"samples": 64}}}}"#
        ));
        let plan = etendue_render::Plan::new(
            &scene,
            etendue_render::output::Outputs::from_list("exr").unwrap(),
        );
        steps::rendered(&scene, &plan).notes
    };
    let told = notes("");
    let is_told = |note: &String| {
        note.starts_with("sparkles: ") && note.contains(" of 147456 samples carry ")
    };
    assert!(told.iter().any(is_told), "{told:?}");
    // The same lamp, lost in the light of a sky.
    let even = notes(r#"{"type": "environment", "radiance": [1000, 1000, 1000]}"#);
    assert!(!even.iter().any(|note| note.starts_with("sparkles")), "{even:?}");
}

/// A projector beside a sky that moves next to nothing while the shutter is open lights what it lights at rest: how far lights
/// reach, by which places choose among them, may be any share of the way to these. A ninth of all light was lost once.
#[test]
fn lights_that_reach_next_to_nowhere_are_chosen_from_afar() {
    let scene = |motion: &str| {
        format!(
            r#"{{"etendue": 1,
                "camera": {{"type": "pinhole", "fov": 40, "pose": {{"from": [0, 2, 4], "look_at": [0, 0.2, 0]}},
                    "sensor": {{"resolution": [24, 18]}}, "shutter": {{"type": "global", "exposure": 0.1}}}},
                "tracer": {{"type": "direct"}},
                "objects": [{{"shape": "rectangle", "width": 6, "height": 6, "material": "floor",
                    "transform": {{"rotate": [1, 0, 0, -90]}}}}],
                "materials": {{"floor": {{"type": "matte", "color": [0.6, 0.6, 0.6]}}}},
                "lights": [{{"type": "projector", "at": [-1.5, 2.5, 0.3], "look_at": [0, 0.3, 0], "fov": 60,
                        "image": [0.5, 0.5, 0.5], "aspect": 1, "intensity": [9, 9, 9]{motion}}},
                    {{"type": "environment", "radiance": [0.3, 0.3, 0.3]}}],
                "render": {{"samples": 256}}}}"#
        )
    };
    for way in ways() {
        let known = mean(&picture(load(&scene("")), way));
        for exponent in [-14, -9, -6, -3] {
            let motion =
                format!(r#", "motion": {{"type": "velocity", "velocity": [1e{exponent}, 0, 0]}}"#);
            let shown = mean(&picture(load(&scene(&motion)), way));
            // Noise of 432 pixels of 256 samples, of which each is off by a few percent.
            assert!(
                (shown / known - 1.0).abs() < 0.005,
                "1e{exponent} m/s, {way:?}: {shown}, not {known}"
            );
        }
    }
}

/// The middle 20° of what a camera sees by way of `objects` with two materials, under light from a disk 10° across
/// straight ahead.
fn before_a_disk(tracer: &str, objects: &str, lights: &str) -> String {
    format!(
        r#"{{"etendue": 1, "tracer": {{"type": "{tracer}"}},
        "camera": {{"type": "pinhole", "fov": 20, "pose": {{"from": [1, 0, 3], "look_at": [0, 0, 0]}},
            "sensor": {{"resolution": [64, 64]}}}},
        "render": {{"samples": 64}}, "lights": [{lights}], "objects": [{objects}],
        "materials": {{"mirror": {{"type": "mirror", "color": [0.7, 0.7, 0.7]}},
            "pane": {{"type": "gltf", "color": [1, 1, 1], "transmission": 1, "roughness": 0, "ior": 1.5}},
            "glass": {{"type": "dielectric", "ior": 1.5}},
            "matte": {{"type": "matte", "color": [0.5, 0.5, 0.5]}}}}}}"#
    )
}

/// A disk far away of half-angle r and irradiance E has the radiance E / (2π (1 − cos r)), and in the middle of a picture
/// f across the share π tan² r / (4 tan² (f/2)) of it. Mirrors, panes and glass show it, but not to surfaces that scatter
/// light, which ask for it; the camera sees the sun of a clear sky alone.
#[test]
fn mirrors_and_glass_show_the_disk_of_the_sun() {
    use std::f64::consts::PI;
    let share = PI * 5_f64.to_radians().tan().powi(2) / (4.0 * 10_f64.to_radians().tan().powi(2));
    let radiance = 2.0 / (2.0 * PI * (1.0 - 5_f64.to_radians().cos()));
    let disk = |along: &str| {
        format!(
            r#"{{"type": "directional", "direction": {along}, "irradiance": [2, 2, 2], "angle": 10}}"#
        )
    };
    let (ahead, mirrored) = (disk("[1, 0, 3]"), disk("[1, 0, -3]"));
    let plane = |material: &str| {
        format!(r#"{{"shape": "rectangle", "width": 9, "height": 9, "material": "{material}"}}"#)
    };
    let slab = r#"{"shape": "box", "size": [90, 90, 0.2], "material": "glass"}"#;
    // Of the pane the first surface alone, as it has no thickness; of the slab all reflections within.
    let (reflected, _) = etendue_tracer::bsdf::fresnel::dielectric(3.0 / 10_f64.sqrt(), 1.5);
    let slab_passes = (1.0 - reflected) / (1.0 + reflected);
    for (name, objects, light, passed) in [
        ("nothing", String::new(), &ahead, 0.0),
        ("mirror", plane("mirror"), &mirrored, 0.7),
        ("pane", plane("pane"), &ahead, 1.0 - reflected),
        ("slab", slab.to_owned(), &ahead, slab_passes),
    ] {
        for way in ways() {
            let pixels = picture(load(&before_a_disk("path", &objects, light)), way);
            // The 1250 pixels of the disk have 120 at its rim, of which 64 samples miss 0.02 at most by chance; a tenth
            // of them, at most, are reflected at random by glass.
            let (found, known) = (mean(&pixels), radiance * share * passed);
            assert!((found - known).abs() <= 3e-3 * known, "{name}, {way:?}: {found}, not {known}");
        }
    }
    // A matte wall before a mirror, which sees the sun in it alone: nobody asks a mirror for light.
    let wall = r#"{"shape": "rectangle", "width": 9, "height": 9, "material": "matte"},
        {"shape": "rectangle", "width": 90, "height": 90, "material": "mirror",
         "transform": {"translate": [0, 0, 9]}}"#;
    let pixels = picture(load(&before_a_disk("path", wall, &disk("[0, 0, 1]"))), ways()[0]);
    assert_eq!(mean(&pixels), 0.0);
    // The camera's own sight: a clear sky's sun beyond its dome.
    let mut seen = [true, false].map(|visible| {
        [true, false].map(|shines| {
            let sky = format!(
                r#"{{"type": "sky", "sun": {{"elevation": 30, "shines": {shines}}}, "visible": {visible}}}"#
            );
            let scene = load(&before_a_disk("direct", "", &sky).replace(
                r#""from": [1, 0, 3], "look_at": [0, 0, 0]"#,
                &format!(r#""from": [0, 0, 0], "look_at": [0, 0.5, {}]"#, -(0.75_f64.sqrt())),
            ).replace(r#""fov": 20"#, r#""fov": 2"#));
            let sun = scene.lights.iter().find(|light| {
                matches!(light.kind, etendue_tracer::LightKind::Directional { .. })
            });
            (mean(&picture(scene.clone(), ways()[0])), sun.map(|light| light.color[0]))
        })
    });
    let [[(whole, sun), (dome, _)], [(hidden, _), (nothing, _)]] = &mut seen;
    let half: f64 = (0.5_f64 * 0.533).to_radians();
    let share = PI * half.tan().powi(2) / (4.0 * 1_f64.to_radians().tan().powi(2));
    let known = sun.unwrap() / (2.0 * PI * (1.0 - half.cos())) * share;
    // The disk has 230 pixels, 54 of them at its rim.
    assert!((*whole - *dome - known).abs() <= 5e-3 * known, "{whole}, {dome}, {known}");
    assert_eq!([*hidden, *nothing], [0.0; 2]);
}
