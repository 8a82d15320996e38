//! Curves that multiply along paths of light, in the bands that the plan chooses, against bands of a
//! nanometre.

use etendue_geometry::glam::DVec3;
use etendue_render::Plan;
use etendue_scene::Scene;
use etendue_spectrum::{Bands, Curve, Grid};
use etendue_tracer::ClearSky;
use serde_json::{Value, json};

use crate::steps::{channels, load_json, plans, rendered};

/// Mean electrons a second of each channel of the scene's sensor, in the bands of a plan.
fn electrons(scene: &Scene, plan: &Plan) -> Vec<f64> {
    let done = rendered(scene, plan);
    let count = plan.bands.count();
    let means: Vec<f64> = match &done.band_film {
        Some(film) => {
            let pixels = film.values.len() / count;
            let band = |k| film.values.iter().skip(k).step_by(count).map(|&v| f64::from(v));
            (0..count).map(|k| band(k).sum::<f64>() / pixels as f64).collect()
        }
        None => {
            let mean = |band: Vec<f64>| band.iter().sum::<f64>() / band.len() as f64;
            channels(&done.picture, "").into_iter().map(mean).collect()
        }
    };
    let sensor = scene.sensor.clone().unwrap().in_bands(plan.bands.clone()).unwrap();
    let channel = |c: usize| -> f64 {
        sensor.electrons_per_unit(c).iter().zip(&means).map(|(e, mean)| e * mean).sum()
    };
    (0..sensor.channels().len()).map(channel).collect()
}

/// The worst of how far electrons in the plan's bands are from those in bands of a nanometre, in each precision; and how
/// many bands the plan has.
fn worst(text: &Value) -> (f64, usize) {
    let folder = tempfile::tempdir().unwrap();
    let scene = load_json(folder.path(), text.clone());
    let (mut worst, mut count) = (0.0, 0);
    for plan in plans(&scene) {
        let [from, to] = plan.bands.range();
        let fine = Bands::Spectral(Grid::of_width(from, to, 1.0).unwrap());
        let exact = electrons(&scene, &Plan { bands: fine, ..plan.clone() });
        let found = electrons(&scene, &plan);
        let off = found.iter().zip(&exact).map(|(found, exact)| (found / exact - 1.0).abs());
        assert!(exact.iter().all(|&e| e > 0.0), "{:?}: {exact:?}", plan.light_precision);
        (worst, count) = (off.fold(worst, f64::max), plan.bands.count());
    }
    (worst, count)
}

fn silicon() -> Value {
    json!([[380, 0.3], [450, 0.6], [530, 0.72], [600, 0.66], [700, 0.45], [780, 0.3]])
}

/// Sensors, in turn.
fn sensor(turn: usize) -> Value {
    let own = [
        json!({}),
        json!({ "quantum_efficiency": silicon() }),
        json!({ "quantum_efficiency": silicon(), "cfa": "rggb" }),
        json!({ "quantum_efficiency": silicon(), "cfa": "rgbw" }),
    ];
    let mut sensor = own[turn % own.len()].clone();
    for (key, value) in [
        ("type", json!("raw")),
        ("radiometry", json!("physical")),
        ("system_gain", json!(1.0)),
        ("noise", json!("none")),
        ("resolution", json!([4, 4])),
    ] {
        sensor[key] = value;
    }
    sensor
}

fn illuminant(turn: usize) -> Value {
    [json!("a"), json!("d65"), json!({ "black_body": 5000 }), Value::Null][turn % 4].clone()
}

/// A scene seen along −Z from z = 2, an orthographic picture a metre high.
fn seen(turn: usize, tracer: Value, objects: Value, materials: Value, lights: Value) -> Value {
    json!({
        "etendue": 1,
        "camera": {
            "type": "orthographic", "height": 0.5, "sensor": sensor(turn),
            "pose": { "from": [0, 0, 2], "look_at": [0, 0, 0] }
        },
        "tracer": tracer, "objects": objects, "materials": materials, "lights": lights,
        "render": { "samples": 4 }
    })
}

fn wall(material: &str) -> Value {
    json!({ "shape": "rectangle", "width": 9, "height": 9, "material": material })
}

fn lamp(turn: usize) -> Value {
    json!({
        "type": "emissive", "radiance": [1, 1, 1], "illuminant": illuminant(turn), "two_sided": true
    })
}

/// A body that absorbs, before a shining wall: from nearly clear to dim.
fn bodies() -> Vec<Value> {
    let body = |color: [f64; 3]| json!({ "type": "dielectric", "ior": 1.0, "absorption": { "color": color, "distance": 0.1 } });
    let colours = [[0.9, 0.5, 0.3], [0.2, 0.6, 0.95], [0.97, 0.99, 0.9]];
    let lengths = [0.05, 0.1, 0.3, 0.8];
    (0..12)
        .map(|i| {
            let slab = json!({
                "shape": "box", "size": [3, 3, lengths[i % 4]], "material": "body",
                "transform": { "translate": [0, 0, 0.7] }
            });
            let materials = json!({ "lamp": lamp(i / 4), "body": body(colours[i / 4]) });
            let tracer = json!({ "type": if i % 2 == 0 { "path" } else { "whitted" } });
            seen(i, tracer, json!([wall("lamp"), slab]), materials, json!([]))
        })
        .collect()
}

/// Sunlight through a tinted pane onto a coloured wall, in direct light.
fn panes() -> Vec<Value> {
    let colours = [[0.9, 0.5, 0.3], [0.8, 0.3, 0.2], [0.3, 0.7, 0.5]];
    let tints = [[0.9, 0.6, 0.4], [0.5, 0.8, 0.95], [0.95, 0.9, 0.7]];
    (0..6)
        .map(|i| {
            let materials = json!({
                "wall": { "type": "matte", "color": colours[i % 3] },
                "pane": { "type": "gltf", "color": tints[(i + i / 3) % 3], "roughness": 0, "transmission": 1 }
            });
            let pane = json!({
                "shape": "rectangle", "width": 20, "height": 20, "material": "pane",
                "transform": { "translate": [0, 4, 0], "rotate": [1, 0, 0, 90] }
            });
            let sun = json!([{
                "type": "directional", "direction": [0, -1, -0.5], "irradiance": [1, 1, 1],
                "illuminant": illuminant(i + 1)
            }]);
            seen(i, json!({ "type": "direct" }), json!([wall("wall"), pane]), materials, sun)
        })
        .collect()
}

/// Light from wall to coloured wall, and a coloured lamp.
fn walls() -> Vec<Value> {
    let colours = [[0.7, 0.4, 0.3], [0.3, 0.6, 0.7], [0.6, 0.6, 0.2]];
    (0..6)
        .map(|i| {
            let tinted = if i % 2 == 0 { [1.0, 1.0, 1.0] } else { [1.0, 0.8, 0.6] };
            let materials = json!({
                "wall": { "type": "matte", "color": colours[i % 3] },
                "other": { "type": "matte", "color": colours[(i + 1) % 3] }
            });
            let beside = json!({
                "shape": "rectangle", "width": 9, "height": 9, "material": "other",
                "transform": { "translate": [-1, 0, 0], "rotate": [0, 1, 0, 90] }
            });
            let light = json!([{
                "type": "point", "at": [2, 1, 2], "intensity": tinted, "illuminant": illuminant(i)
            }]);
            let tracer = json!({ "type": "path", "max_bounces": 3 });
            seen(i, tracer, json!([wall("wall"), beside]), materials, light)
        })
        .collect()
}

/// A measured metal shows a shining wall, alone and through a body.
fn metals() -> Vec<Value> {
    (0..6)
        .map(|i| {
            let materials = json!({
                "metal": { "type": "metal", "metal": (["gold", "copper", "silver"][i % 3]), "roughness": 0 },
                "lamp": lamp(i),
                "body": {
                    "type": "dielectric", "ior": 1.0,
                    "absorption": { "color": [0.6, 0.9, 0.7], "distance": 0.2 }
                }
            });
            let behind = json!({
                "shape": "rectangle", "width": 9, "height": 9, "material": "lamp",
                "transform": { "translate": [0, 0, 3] }
            });
            let slab = json!({
                "shape": "box", "size": [3, 3, 0.3], "material": "body",
                "transform": { "translate": [0, 0, 1] }
            });
            let objects = match i < 3 {
                true => json!([wall("metal"), behind]),
                false => json!([wall("metal"), behind, slab]),
            };
            seen(i, json!({ "type": "whitted" }), objects, materials, json!([]))
        })
        .collect()
}

#[test]
fn electrons_of_thirty_scenes_are_those_of_bands_of_a_nanometre() {
    let scenes = [bodies(), panes(), walls(), metals()].concat();
    assert_eq!(scenes.len(), 30);
    let mut off = Vec::new();
    for (number, scene) in scenes.iter().enumerate() {
        let (worst, bands) = worst(scene);
        println!("scene {number}: {:.4} % in {bands} bands", 100.0 * worst);
        // What is promised.
        if worst > 1e-3 {
            off.push((number, worst, bands));
        }
    }
    assert!(off.is_empty(), "{off:?}");
}

/// A multispectral sensor of bands of 40 nm before a scene under a clear sky at turbidity 3 and its sun at
/// 45 degrees over −Z.
fn under_a_sky(camera: &Value, objects: &Value, shines: bool, samples: u32) -> Scene {
    let mut camera = camera.clone();
    camera["type"] = json!("orthographic");
    camera["height"] = json!(0.5);
    camera["sensor"] = json!({
        "type": "multispectral", "bands": { "from": 400, "to": 720, "count": 8 },
        "radiometry": "physical", "system_gain": 1.0, "noise": "none", "resolution": [4, 4]
    });
    let scene = json!({
        "etendue": 1, "camera": camera, "tracer": { "type": "direct" }, "objects": objects,
        "materials": { "white": { "type": "matte", "color": [1, 1, 1] } },
        "lights": [{ "type": "sky", "turbidity": 3, "sun": { "elevation": 45, "shines": shines } }],
        "render": { "samples": samples }
    });
    load_json(tempfile::tempdir().unwrap().path(), scene)
}

/// Photons of a spectrum between wavelengths (nm), to a factor: its energy times λ.
fn photons(spectrum: &Curve, from: f64) -> f64 {
    let steps = 0..400;
    steps.map(|k| from + 0.1 * (f64::from(k) + 0.5)).map(|nm| spectrum.at(nm).unwrap() * nm).sum()
}

fn shares(of: &[f64]) -> Vec<f64> {
    let sum: f64 = of.iter().sum();
    of.iter().map(|value| value / sum).collect()
}

#[test]
fn a_clear_sky_and_its_sun_have_the_spectra_of_their_authors() {
    let sky = ClearSky::new(3.0, 45.0, 0.2, true).unwrap();
    // By precision.
    let own = |scene: &Scene| -> Vec<Vec<f64>> {
        plans(scene).iter().map(|plan| electrons(scene, plan)).collect()
    };
    let expected = |spectrum: &Curve| -> Vec<f64> {
        (0..8).map(|k| photons(spectrum, 400.0 + 40.0 * f64::from(k))).collect()
    };
    // The dome itself, a third of a right angle beside the zenith and away from the sun; a far wall keeps
    // the scene from being empty.
    let toward = [0.2, 0.9, 0.4];
    let camera = json!({ "pose": { "from": [0, 0, 0], "look_at": toward } });
    let behind = json!([{ "shape": "rectangle", "width": 1, "height": 1, "material": "white",
                          "transform": { "translate": [0, -50, 0] } }]);
    let found = own(&under_a_sky(&camera, &behind, true, 1));
    let known = expected(&sky.dome_spectrum(DVec3::from(toward).normalize()));
    for found in found {
        for (found, known) in shares(&found).iter().zip(shares(&known)) {
            // What bands are to lose at most, and what a map of 0.35 degrees a texel does.
            assert!((found / known - 1.0).abs() < 2e-3, "{found} is not {known}");
        }
    }
    // A floor in the sun less the same in the shade.
    let camera = json!({
        "pose": { "from": [0, 3, 0], "look_at": [0, 0, 0], "up": [0, 0, -1] }
    });
    let floor = json!([{ "shape": "rectangle", "width": 9, "height": 9, "material": "white",
                         "transform": { "rotate": [1, 0, 0, -90] } }]);
    let [lit, shaded] =
        [true, false].map(|shines| own(&under_a_sky(&camera, &floor, shines, 4096)));
    for (lit, shaded) in lit.iter().zip(&shaded) {
        let sun: Vec<f64> = lit.iter().zip(shaded).map(|(lit, shaded)| lit - shaded).collect();
        for (found, known) in shares(&sun).iter().zip(shares(&expected(&sky.sun_spectrum()))) {
            // The noise of 65536 samples, of which most is that of all bands.
            assert!((found / known - 1.0).abs() < 1e-2, "{found} is not {known}");
        }
    }
}
