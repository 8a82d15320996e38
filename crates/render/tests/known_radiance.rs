//! Scenes whose radiance is known, by every tracer of light, every accelerator and every precision of
//! hits that it has.
//!
//! The pixels of each picture see the same radiance, so their spread gives the standard error of
//! their mean: it has to be within four of the known value, or within `bias` where a scene is only
//! nearly the one that the formula speaks of.

use std::path::Path;

use etendue_accel::BuildOptions;
use etendue_geometry::glam::DVec3;
use etendue_render::output::Outputs;
use etendue_render::output::Values;
use etendue_render::{Images, Plan, accelerators, build, plan, render};
use etendue_scene::file::{AccelName, LightPrecision, SceneFile};
use etendue_scene::{LoadOptions, Scene};
use etendue_tracer::{ClearSky, Emission, Paint};

const TRACERS: [&str; 3] = ["direct", "whitted", "path"];

/// An accelerator and the precision in which light paths ask it.
type Way = (AccelName, LightPrecision);

/// All accelerators in f64, and Embree in f32, which the others do not have.
fn ways() -> Vec<Way> {
    let double = accelerators().iter().map(|&accel| (accel, LightPrecision::Double));
    let single = accelerators().iter().filter(|&&accel| accel == AccelName::Embree);
    double.chain(single.map(|&accel| (accel, LightPrecision::Single))).collect()
}

fn load(text: &str) -> Scene {
    load_in(tempfile::tempdir().unwrap().path(), text)
}

fn load_in(folder: &Path, text: &str) -> Scene {
    let path = folder.join("scene.json");
    std::fs::write(&path, text).unwrap();
    let file = SceneFile::read(&path, &[]).unwrap();
    file.load(plan::wanted(&file.spec.all_layers()), &LoadOptions::default()).unwrap()
}

/// All pixels' red.
fn picture(mut scene: Scene, (accel, precision): Way) -> Vec<f64> {
    scene.render.accel = Some(accel);
    scene.plan.light_precision = precision;
    let outputs = Outputs::from_list("exr").unwrap();
    let plan = Plan::new(&scene, outputs);
    let accel = build(&scene, &plan, &BuildOptions::default()).unwrap();
    let images = Images::decode(&scene, &plan, None).unwrap();
    let done = render(&scene, &plan, &*accel, &images, Vec::new(), &|_: f64| true).unwrap();
    assert_eq!(done.light.not_finite, 0);
    match &done.picture.layers()[0].channels[0].values {
        Values::F32(values) => values.iter().map(|&v| f64::from(v)).collect(),
        other => panic!("a picture is f32: {other:?}"),
    }
}

fn assert_shows(name: &str, pixels: &[f64], known: f64, bias: f64) {
    let n = pixels.len() as f64;
    let mean = pixels.iter().sum::<f64>() / n;
    let variance = pixels.iter().map(|p| (p - mean).powi(2)).sum::<f64>() / (n - 1.0);
    // Pictures are f32: half a unit in the last place is the least error.
    let bound = 4.0 * (variance / n).sqrt() + bias + 1e-7 * known;
    assert!((mean - known).abs() <= bound, "{name}: {mean} is not {known} within {bound}");
}

/// A picture of `8 × 8` pixels of a tiny patch around `at`, from `from`.
fn patch(tracer: &str, samples: u32, from: [f64; 3], at: [f64; 3], rest: &str) -> String {
    format!(
        r#"{{"etendue": 1, "tracer": {{"type": "{tracer}"}},
        "camera": {{"type": "orthographic", "height": 1e-3,
            "pose": {{"from": {from:?}, "look_at": {at:?}, "up": [0.1, 0.2, 0.9]}},
            "sensor": {{"resolution": [8, 8]}}}},
        "render": {{"samples": {samples}}}, {rest}}}"#
    )
}

/// Runs `text` by every tracer and accelerator against the value that each tracer should find.
fn check(
    name: &str,
    samples: u32,
    [from, at]: [[f64; 3]; 2],
    rest: &str,
    change: impl Fn(&mut Scene),
    bias: f64,
    known: impl Fn(&str) -> f64,
) {
    for tracer in TRACERS {
        for way in ways() {
            let mut scene = load(&patch(tracer, samples, from, at, rest));
            change(&mut scene);
            let pixels = picture(scene, way);
            assert_shows(&format!("{name}, {tracer}, {way:?}"), &pixels, known(tracer), bias);
        }
    }
}

/// Inside of a closed box whose walls shine by 1 and return ρ: 1 + ρ + ρ² + … = 1/(1 − ρ), and 1 + ρ
/// after one bounce.
#[test]
fn a_closed_furnace() {
    for albedo in [0.2, 0.6] {
        let rest = format!(
            r#""lights": [],
            "objects": [{{"shape": "box", "size": [2, 2, 2], "material": "wall"}}],
            "materials": {{"wall": {{"type": "matte", "color": [{albedo}, {albedo}, {albedo}]}}}}"#
        );
        let shine = |scene: &mut Scene| {
            let radiance = Paint::Plain([1.0; 3]);
            scene.materials[0].emission = Some(Emission {
                radiance,
                strength: 1.0,
                illuminant: None,
                two_sided: true,
                group: None,
            });
        };
        let eye = [[0.2, 0.1, 0.3], [-0.5, -1.0, 0.2]];
        check("furnace", 64, eye, &rest, shine, 0.0, |tracer| match tracer {
            "path" => 1.0 / (1.0 - albedo),
            _ => 1.0 + albedo,
        });
    }
}

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
        let lamp = scene.materials.iter_mut().find(|m| m.name == "lamp").unwrap();
        lamp.emission.as_mut().unwrap().radiance = Paint::Plain([f64::NAN, 1.0, f64::INFINITY]);
        scene.render.accel = Some(AccelName::Bvh);
        let plan = Plan::new(&scene, Outputs::from_list("exr").unwrap());
        let accel = build(&scene, &plan, &BuildOptions::default()).unwrap();
        let images = Images::decode(&scene, &plan, None).unwrap();
        let done = render(&scene, &plan, &*accel, &images, Vec::new(), &|_: f64| true).unwrap();
        assert!(done.light.not_finite > 0, "{tracer}");
        for channel in &done.picture.layers()[0].channels {
            let Values::F32(values) = &channel.values else { panic!("a picture is f32") };
            assert!(values.iter().all(|v| v.is_finite()), "{tracer}");
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

/// A closed box in a blinding sky is dark inside: exactly.
#[test]
fn no_light_leaks_into_a_closed_box() {
    for tracer in TRACERS {
        for way in ways() {
            let scene = load(&format!(
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
            let lit = picture(scene, way).iter().filter(|&&p| p != 0.0).count();
            assert_eq!(lit, 0, "{tracer} {way:?}");
        }
    }
}

/// The same scene in millimetres, metres and kilometres, and moved by 10⁶ m, gives the same picture:
/// hits differ by roundings, so a random choice or an edge may fall the other way in a few pixels.
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
