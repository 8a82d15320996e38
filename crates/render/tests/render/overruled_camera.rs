//! Parts of a camera and of a hit that the plan leaves out, against the fuller model, which the
//! test forces: the same to the bit, or within the error that the decision allows.

use std::path::Path;

use etendue_geometry::Detail;
use etendue_render::output::Outputs;
use etendue_render::{Plan, Precision, Rendered};
use etendue_report::{DecisionKind, DecisionValue};
use etendue_scene::Scene;
use etendue_spectrum::{Bands, Grid};
use serde_json::{Value, json};

use crate::steps::{self, layer, load_json};

/// A grey blob before a wall, seen by `camera`.
fn scene(camera: &Value, more: &Value) -> Scene {
    let mut camera = camera.clone();
    camera["pose"] = json!({ "from": [0.5, 1, 4], "look_at": [0, 0, 0] });
    camera["sensor"] = json!({ "resolution": [36, 30] });
    let mut scene = json!({
        "camera": camera,
        "materials": { "grey": { "type": "matte", "color": [0.5, 0.5, 0.5] } },
        "objects": [{ "shape": "blob", "triangles": 2000, "seed": 3, "material": "grey" },
            { "shape": "rectangle", "width": 9, "height": 9, "material": "grey",
              "transform": { "translate": [0, 0, -2] } }],
    });
    for (key, value) in more.as_object().unwrap() {
        scene[key] = value.clone();
    }
    load_json(Path::new("."), scene)
}

/// The picture as planned, or as `forced`.
fn rendered(scene: &Scene, forced: impl FnOnce(&mut Plan)) -> Rendered {
    let mut plan = Plan::new(scene, Outputs::ALL);
    forced(&mut plan);
    steps::rendered(scene, &plan)
}

fn choice(scene: &Scene, kind: DecisionKind) -> DecisionValue {
    let decisions = Plan::new(scene, Outputs::ALL).decisions;
    decisions.into_iter().find(|decision| decision.kind == kind).unwrap().value
}

fn bits(done: &Rendered, name: &str) -> Vec<u64> {
    layer(&done.picture, name).into_iter().map(f64::to_bits).collect()
}

/// The root of the mean squared difference, relative to the mean.
fn difference(a: &[f64], b: &[f64]) -> f64 {
    let mean = a.iter().sum::<f64>() / a.len() as f64;
    let square: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
    (square / a.len() as f64).sqrt() / mean
}

fn double_gauss() -> Value {
    let lens = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/lenses/double-gauss.json");
    let lens: Value = serde_json::from_slice(&std::fs::read(lens).unwrap()).unwrap();
    json!({ "type": "lens", "lens": lens, "f_number": 4, "focus_distance": 4, "sensor_height": 24 })
}

/// Data are taken along chief rays: measuring the pupil and spreading rays over it changes no bit of them.
#[test]
fn data_do_not_depend_on_the_pupil() {
    let scene = scene(&double_gauss(), &json!({ "layers": ["distance", "normal"] }));
    assert_eq!(choice(&scene, DecisionKind::Pupil), DecisionValue::Switch(false));
    let own = rendered(&scene, |plan| assert!(!plan.pupil));
    let full = rendered(&scene, |plan| plan.pupil = true);
    for name in ["Distance", "Normal"] {
        assert_eq!(bits(&own, name), bits(&full, name), "{name}");
    }
}

/// A pinhole is what a lens comes to when it is closed: at f/5000 the blur is under a hundredth of a pixel,
/// and the corners of 7 degrees lack 1 − cos⁴(4.5°) = 1.2 % of the light.
#[test]
fn a_pinhole_without_a_pupil_is_a_closed_lens() {
    let more = json!({ "tracer": { "type": "facing" }, "render": { "samples": 64 } });
    let pinhole = scene(&json!({ "type": "pinhole", "fov": 7 }), &more);
    let lens = json!({ "type": "thin_lens", "focal_length": 50, "fov": 7, "f_number": 5000,
                       "focus_distance": 4 });
    let closed = scene(&lens, &more);
    assert_eq!(
        [&pinhole, &closed].map(|of| choice(of, DecisionKind::Pupil)),
        [false, true].map(DecisionValue::Switch)
    );
    let [own, full] = [pinhole, closed].map(|scene| layer(&rendered(&scene, |_| {}).picture, ""));
    let off = difference(&own, &full);
    assert!(off > 0.0 && off < 0.012, "{off}");
}

/// Bands share rays where no glass parts them. A glass that parts them by 10⁻⁷ of its index gives
/// each its own, and the same picture: the samples are the same, and so is all but a few edges.
#[test]
fn bands_share_rays_where_nothing_parts_them() {
    let lens = |glass: Value| {
        json!({ "type": "lens", "focus_distance": 4, "f_number": 4, "sensor_height": 8, "lens": { "elements": [
            { "type": "surface", "radius": 50, "thickness": 5, "glass": glass, "semi_diameter": 10, "stop": true },
            { "type": "surface", "radius": -50, "semi_diameter": 10 }] } })
    };
    let more = json!({ "tracer": { "type": "direct" }, "render": { "samples": 64 },
                       "lights": [{ "type": "environment", "radiance": [1, 1, 1] }] });
    let shared = scene(&lens(json!({ "n": 1.5 })), &more);
    let apart = scene(&lens(json!({ "power": [[2.25, 0], [1e-7, -2]] })), &more);
    let what = DecisionKind::RaysOfBands;
    assert_eq!(
        (choice(&shared, what), choice(&apart, what)),
        ("shared".into(), "their own".into())
    );
    let [own, full] = [shared, apart].map(|scene| layer(&rendered(&scene, |_| {}).picture, ""));
    let off = difference(&own, &full);
    assert!(off > 0.0 && off < 0.01, "{off}");
}

/// A lens taken as at its design wavelength shows a grey scene grey to the bit, with a third of the rays; with
/// each band on its own way, its paths included, edges are coloured, by the tenth of a pixel that the lens displaces them.
#[test]
fn a_lens_without_dispersion_takes_one_ray_for_all_bands() {
    let more = |plan: Value| {
        json!({ "tracer": { "type": "direct" }, "render": { "samples": 64 }, "plan": plan,
                "lights": [{ "type": "environment", "radiance": [1, 1, 1] }] })
    };
    let own = scene(&double_gauss(), &more(json!({ "shared_paths": false })));
    let shared = scene(&double_gauss(), &more(json!({ "dispersion": false })));
    let what = DecisionKind::RaysOfBands;
    assert_eq!((choice(&own, what), choice(&shared, what)), ("their own".into(), "shared".into()));
    let [own, shared] = [own, shared].map(|scene| rendered(&scene, |_| {}));
    let is_grey = |done: &Rendered| {
        let values = bits(done, "");
        let (red, rest) = values.split_at(values.len() / 3);
        rest.chunks(red.len()).all(|band| band == red)
    };
    assert!(is_grey(&shared) && !is_grey(&own));
    // Rays to the sky go on from what was hit, so these are about a third.
    let share = shared.light.rays as f64 / own.light.rays as f64;
    assert!((share - 1.0 / 3.0).abs() < 0.01, "{share}");
    let off = difference(&layer(&own.picture, ""), &layer(&shared.picture, ""));
    assert!(off > 0.0 && off < 0.02, "{off}");
}

/// Red, green and blue are enough of a grey scene under even light: 31 bands, which the test forces, see it
/// alike along the same paths.
#[test]
fn three_bands_are_enough_of_what_is_grey() {
    let scene = scene(
        &json!({ "type": "pinhole", "fov": 40 }),
        &json!({ "tracer": { "type": "path", "max_bounces": 3 }, "render": { "samples": 16 },
                 "lights": [{ "type": "environment", "radiance": [1, 1, 1] }] }),
    );
    let own = rendered(&scene, |plan| assert_eq!(plan.bands, Bands::Rgb));
    let full = rendered(&scene, |plan| {
        plan.bands = Bands::Spectral(Grid::equal(400.0, 700.0, 31).unwrap());
    });
    let film = full.band_film.as_ref().unwrap();
    let pixels = film.values.as_chunks::<31>().0;
    // Of three planes, red.
    for (own, bands) in layer(&own.picture, "").into_iter().zip(pixels) {
        for band in bands {
            // A grey of 0.5 as a spectrum is that grey to the fit of a smooth curve.
            assert!((f64::from(*band) - own).abs() < 0.01, "{band} {own}");
        }
    }
}

/// Of hits, distance and ids alone where no layer asks for more; and of numbers, what an EXR holds.
#[test]
fn what_is_not_asked_of_hits_changes_nothing() {
    let scene = scene(&json!({ "type": "pinhole", "fov": 40 }), &json!({ "layers": ["distance"] }));
    assert_eq!(choice(&scene, DecisionKind::Surface), DecisionValue::Switch(false));
    let own = rendered(&scene, |plan| assert_eq!(plan.detail, Detail::Distance));
    let full = rendered(&scene, |plan| plan.detail = Detail::Surface);
    assert_eq!(bits(&own, "Distance"), bits(&full, "Distance"));
    let single = rendered(&scene, |plan| plan.precision = Precision::Single);
    #[expect(clippy::cast_possible_truncation, reason = "what is tested")]
    let round = |x: &f64| f64::from(*x as f32).to_bits();
    let rounded: Vec<u64> = layer(&own.picture, "Distance").iter().map(round).collect();
    assert_eq!(bits(&single, "Distance"), rounded);
}

/// The whole film in one pass, as a film too large for its sums has it, is the same to the bit.
#[test]
fn passes_change_no_bit() {
    let scene = scene(
        &json!({ "type": "thin_lens", "focal_length": 50, "fov": 30, "f_number": 2,
                 "focus_distance": 3 }),
        &json!({ "tracer": { "type": "facing" }, "render": { "samples": 64 } }),
    );
    let own = rendered(&scene, |plan| assert!(plan.passes.len() > 1));
    let full = rendered(&scene, |plan| plan.passes = std::iter::once(0..64).collect());
    assert_eq!(bits(&own, ""), bits(&full, ""));
}

/// Grey surfaces and lights have the same light in all bands: one that is traced for all is what each would have by
/// itself, to the rounding of the sums that make a band of a colour.
#[test]
fn one_band_of_a_grey_scene_is_traced_for_all() {
    let scene = |color: [f64; 3], camera: Value| {
        let scene = json!({
            "camera": camera, "tracer": { "type": "path", "max_bounces": 4 }, "layers": ["direct"],
            "plan": { "light_precision": "double" },
            "lights": [{ "type": "environment", "radiance": [0.7, 0.7, 0.7] },
                { "type": "point", "at": [1, 2, 1], "intensity": [3, 3, 3] }],
            "materials": { "grey": { "type": "matte", "color": color },
                "glass": { "type": "dielectric", "ior": 1.5 },
                "checks": { "type": "checker", "colors": [[0.2, 0.2, 0.2], [0.9, 0.9, 0.9]] } },
            "objects": [{ "shape": "sphere", "radius": 0.5, "material": "glass" },
                { "shape": "sphere", "radius": 0.3, "material": "grey", "transform": { "translate": [0.7, 0.1, 0.2] } },
                { "shape": "rectangle", "width": 6, "height": 6, "material": "checks",
                  "transform": { "translate": [0, -0.5, 0], "rotate": [1, 0, 0, -90] } }],
            "render": { "samples": 16 },
        });
        load_json(tempfile::tempdir().unwrap().path(), scene)
    };
    let sensor = json!({ "type": "multispectral", "resolution": [24, 18],
        "bands": { "from": 400, "to": 700, "count": 30 } });
    let pose = json!({ "from": [0, 0.5, 3], "look_at": [0, 0, 0] });
    let pinhole = json!({ "type": "pinhole", "pose": pose, "sensor": sensor });
    // Behind a lens that disperses, bands share the paths of the scene and land apart.
    let lens = json!({ "type": "lens", "focus_distance": 3, "sensor_height": 24, "pose": pose, "sensor": sensor,
        "lens": { "elements": [
            { "type": "surface", "radius": 51.68, "thickness": 6, "glass": { "nd": 1.5168, "vd": 64.2 }, "semi_diameter": 8 },
            { "type": "surface", "radius": -51.68, "thickness": 1, "semi_diameter": 8 },
            { "type": "aperture", "shape": "circular", "radius": 5, "stop": true }] } });
    for camera in [pinhole.clone(), lens] {
        let scene = scene([0.5; 3], camera);
        let plan = Plan::new(&scene, Outputs::from_list("npy").unwrap());
        assert!(plan.alike && plan.bands.count() == 30);
        let own = steps::rendered(&scene, &plan).picture;
        let all = steps::rendered(&scene, &Plan { alike: false, ..plan }).picture;
        for name in ["Spectrum", "Direct"] {
            let (own, all) = (layer(&own, name), layer(&all, name));
            assert!(own.len() >= 24 * 18 * 3 && own.iter().any(|value| *value > 0.1), "{name}");
            for (a, b) in own.iter().zip(&all) {
                // Some surfaces, each a sum of three that is 1 to 2⁻⁵³; files of spectra are kept in f32.
                assert!((a - b).abs() <= 1e-6 * b.abs() + 1e-12, "{name}: {a} {b}");
            }
        }
    }
    // A little colour of one surface, and each band is its own.
    let scene = scene([0.5, 0.5, 0.5001], pinhole);
    assert!(!Plan::new(&scene, Outputs::ALL).alike);
}
