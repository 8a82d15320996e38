//! One picture, however its render is divided: a scene of each kind, by each accelerator that is built and in each
//! precision of its light, the same to the bit for all threads and shares; and whatever finds the hits, the same but for
//! roundings.

use std::path::Path;

use etendue_accel::AccelName;
use etendue_files::Transaction;
use etendue_geometry::HitPrecision;
use etendue_render::expose::SensorLight;
use etendue_render::output::Outputs;
use etendue_render::{
    BandPaths, Film, FilmFile, Plan, Prepared, RenderState, Rendered, Shard, ShardBy, finish, trace,
};
use etendue_scene::Scene;
use serde_json::{Value, json};

use crate::steps::{bits, layer, load_in, prepare, rendered};

/// Columns of two tiles, and rows of three, which are dealt out to as many shares.
const RESOLUTION: [u32; 2] = [20, 35];
const SAMPLES: u32 = 6;

/// The permitted difference between a picture and the reference's, whose random numbers are the same.
#[derive(Clone, Copy)]
struct Apart {
    /// Share of the values that may differ by more than f32's rounding.
    values: f64,
    /// Relative difference of the means.
    mean: f64,
}

/// Hits within f32's rounding of an edge or of a shadow's are one sample in some thousands, of which the picture has
/// 4200. Three of them, each with twenty times the light of the mean.
const SAME_SAMPLES: Apart = Apart { values: 0.02, mean: 0.015 };

/// Such a sample may let a pixel stop earlier or later, and its neighbours with it: 700 pixels of an error of a quarter,
/// and four times that of the difference of two such means.
const OWN_SAMPLES: Apart = Apart { values: 1.0, mean: 0.055 };

/// A box and a ball on squares below a light, with the keys of `more` in place of its own.
fn scene(more: &Value) -> Value {
    let mut scene = json!({
        "etendue": 1,
        "tracer": { "type": "path", "max_bounces": 3 }, "layers": ["depth", "normal", "ids"],
        "camera": { "type": "pinhole", "fov": 50 },
        "lights": [{ "type": "environment", "radiance": [0.1, 0.12, 0.15] }],
        "objects": [
            { "shape": "rectangle", "width": 6, "height": 6, "material": "floor",
              "transform": { "rotate": [1, 0, 0, -90] } },
            { "shape": "box", "material": "paint", "transform": { "translate": [-0.5, 0.32, 0], "scale": 0.6 } },
            { "shape": "sphere", "material": "ball", "transform": { "translate": [0.5, 0.52, 0.2], "scale": 0.5 } },
            { "shape": "rectangle", "width": 0.8, "height": 0.8, "material": "shine",
              "transform": { "translate": [0.2, 2.2, 0.3], "rotate": [1, 0, 0, 90] } }],
        "materials": {
            "floor": { "type": "checker", "colors": [[0.8, 0.8, 0.7], [0.2, 0.3, 0.4]], "squares": 8 },
            "paint": { "type": "matte", "color": [0.7, 0.2, 0.1] },
            "ball": { "type": "matte", "color": [0.2, 0.5, 0.7] },
            "shine": { "type": "emissive", "radiance": [9, 8, 6] } },
        "render": { "samples": SAMPLES, "seed": 3 },
    });
    for (path, value) in more.as_object().unwrap() {
        if let Some(own) = scene.pointer_mut(path) {
            *own = value.clone();
            continue;
        }
        let (parent, key) = path.rsplit_once('/').unwrap();
        scene.pointer_mut(parent).unwrap()[key] = value.clone();
    }
    let camera = &mut scene["camera"];
    for (key, value) in [
        ("pose", json!({ "from": [0.1, 1, 3.4], "look_at": [0, 0.8, 0] })),
        ("sensor", json!({ "resolution": RESOLUTION })),
    ] {
        if camera.get(key).is_none() {
            camera[key] = value;
        }
    }
    scene
}

/// A camera, light and copies that move and turn while a rolling shutter goes down the picture.
fn moving() -> Value {
    let spin =
        json!({ "type": "velocity", "velocity": [4, 0, 0], "angular_velocity": [0, 3600, 0] });
    let copies = json!([{ "translate": [-0.5, 0.6, 0] }, { "translate": [0.4, 0.4, 0.3] },
                        { "translate": [0, 1.2, -0.4], "rotate": [0, 0, 1, 30] }]);
    scene(&json!({
        "/camera": { "type": "pinhole", "fov": 50,
            "shutter": { "type": "rolling", "line_time": 1e-4, "exposure": 0.01 },
            "motion": { "type": "velocity", "velocity": [5, 0, 0], "angular_velocity": [0, 200, 0] } },
        "/layers": ["depth", "ids", "time"],
        "/lights": [{ "type": "environment", "radiance": [0.3, 0.3, 0.3] },
            { "type": "point", "at": [1, 2, 1], "intensity": [3, 3, 2],
              "motion": { "type": "velocity", "velocity": [-50, 0, 0] } }],
        "/objects/1": { "shape": "box", "size": [0.4, 0.3, 0.2], "material": "paint", "instances": copies,
            "motion": spin },
    }))
}

/// A singlet of N-SF11 with its stop behind it, which parts blue and red by pixels.
fn through_a_lens() -> Value {
    let lens = json!({ "elements": [
        { "type": "surface", "radius": 60, "thickness": 6, "glass": "N-SF11", "semi_diameter": 10 },
        { "type": "surface", "radius": -60, "thickness": 20, "semi_diameter": 10 },
        { "type": "aperture", "shape": "circular", "radius": 3, "thickness": 1, "stop": true }] });
    scene(&json!({
        "/camera": { "type": "lens", "lens": lens, "focus_distance": 3.4, "sensor_height": 26 },
        "/plan": { "shared_paths": true },
    }))
}

/// Lenslets of 0.1 mm behind a lens of 20 mm, before things as near as it is focused.
fn light_field() -> Value {
    scene(&json!({
        "/camera": { "type": "light_field", "focal_length": 20, "f_number": 4, "focus_distance": 0.5,
            "microlenses": { "pitch": 0.1 }, "pose": { "from": [0, 0, 0.5], "look_at": [0, 0, 0] },
            "sensor": { "resolution": [40, 35], "pixel_pitch": 8 } },
        "/objects": [{ "shape": "sphere", "radius": 0.002, "material": "ball" },
            { "shape": "rectangle", "width": 1, "height": 1, "material": "paint",
              "transform": { "translate": [0, 0, -0.1] } }],
    }))
}

/// A scene of its kind, and how far its pictures may be apart.
struct Kind {
    name: &'static str,
    scene: Value,
    apart: Apart,
}

impl Kind {
    fn new(name: &'static str, scene: Value) -> Self {
        Self { name, scene, apart: SAME_SAMPLES }
    }
}

/// One of each kind.
fn kinds() -> Vec<Kind> {
    let glass = json!({ "/materials/ball": { "type": "dielectric", "ior": 1.5 } });
    let image = json!({ "type": "matte", "color": { "image": "waves.png", "repeat": [3, 3] } });
    let images = json!({ "/materials/floor": image, "/materials/paint": image });
    let sky = json!({ "/lights": [{ "type": "sky", "turbidity": 3, "scale": 9,
                                    "sun": { "elevation": 35, "azimuth": 70 } }] });
    let noisy = json!({ "/camera/sensor": { "type": "raw", "cfa": "rggb", "resolution": RESOLUTION,
        "read_noise": 2, "system_gain": 0.5, "exposure": "10 ms" } });
    let until = json!({ "/render/samples": { "relative_error": 0.25, "min": 4, "max": 24 },
                        "/layers": ["depth", "sample_count", "variance"] });
    let unlit = json!({ "/tracer": { "type": "facing" }, "/camera": { "type": "chromatic_real_lens",
        "front_radius": 50, "rear_radius": -50, "thickness": 6, "glass": "N-BK7", "f_number": 4, "fov": 40,
        "focus_distance": 3.4 } });
    // A blob has normals of its own, a box none.
    let plain = json!({ "/tracer": { "type": "facing" }, "/layers": ["depth", "flat"],
        "/objects/2/shape": "blob", "/materials/floor": { "type": "matte", "color": [0.8, 0.8, 0.7] } });
    vec![
        Kind::new("matte surfaces below a light", scene(&json!({}))),
        Kind::new("surfaces of one colour each, without light", scene(&plain)),
        Kind::new("glass", scene(&glass)),
        Kind::new("images on surfaces", scene(&images)),
        Kind::new("a sky", scene(&sky)),
        Kind::new("a lens that disperses", through_a_lens()),
        Kind::new("colours through a lens, without light", scene(&unlit)),
        Kind::new("a light field", light_field()),
        Kind::new("what moves", moving()),
        Kind::new("a sensor with noise", scene(&noisy)),
        Kind {
            apart: OWN_SAMPLES,
            ..Kind::new("samples until an error is reached", scene(&until))
        },
    ]
}

/// All that finds hits: each accelerator that is built in f64, and in f32 where it has that; the reference first.
fn ways() -> Vec<(AccelName, HitPrecision)> {
    let of = |accel: AccelName| {
        let single = accel.has_single().then_some(HitPrecision::Single);
        [HitPrecision::Double].into_iter().chain(single).map(move |precision| (accel, precision))
    };
    AccelName::built().rev().flat_map(of).collect()
}

/// All steps on so many threads.
fn on(threads: usize, scene: &Scene, plan: &Plan) -> Rendered {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| rendered(scene, plan))
}

/// The picture of three shares that are put together from their files, in another order than theirs.
fn in_shares(scene: &Scene, plan: &Plan, by: ShardBy) -> Rendered {
    let (accel, images) = prepare(scene, plan);
    let prepared = Prepared { accel: &*accel, images: &images, others: &[] };
    let folder = tempfile::tempdir().unwrap();
    let traced =
        |state: &RenderState<'_>| trace(scene, plan, prepared, &[], state, &|_: f64| true).unwrap();
    let shares = [2, 3, 1].map(|number| {
        let shard = Shard::new(number, 3).map(|shard| shard.by(by));
        let film = traced(&RenderState { shard, ..RenderState::default() });
        let path = folder.path().join(number.to_string());
        film.write(&Transaction::at_once(), &path, &Vec::new(), &Value::Null).unwrap();
        FilmFile::read(&path).unwrap()
    });
    let film = match by {
        ShardBy::Rows => Film::merged(scene, plan, &shares, &Vec::new()).unwrap(),
        ShardBy::Samples => traced(&RenderState { shares: &shares, ..RenderState::default() }),
    };
    finish(scene, plan, film, Vec::new(), Some(&*accel)).unwrap()
}

/// Digital numbers of the sensor's first exposure, where the scene has one that exposes.
fn exposed(scene: &Scene, done: &Rendered) -> Option<Vec<u16>> {
    let light = SensorLight::new(scene, &done.picture, done.band_film.clone()).unwrap().ok()?;
    let shot = light.sensor().shots().next().unwrap();
    Some(light.expose(shot).unwrap().values)
}

/// That both are one picture, by as many rays.
fn assert_same(scene: &Scene, one: &Rendered, other: &Rendered, what: &str) {
    let [a, b] = [one, other].map(|done| bits(&done.picture));
    let differ = a.iter().zip(&b).filter(|(a, b)| a != b).count();
    assert_eq!((differ, a.len()), (0, b.len()), "{what}");
    assert_eq!(one.picture.header(), other.picture.header(), "{what}");
    assert_eq!((one.rays, one.samples), (other.rays, other.samples), "{what}");
    assert_eq!(one.sample_counts, other.sample_counts, "{what}");
    assert!(exposed(scene, one) == exposed(scene, other), "{what}: raw numbers differ");
}

/// The picture by one way to find hits, which is the same however its render is divided.
fn held(scene: &Scene, light_precision: HitPrecision, what: &str) -> Rendered {
    let plan = Plan { light_precision, ..Plan::new(scene, Outputs::ALL) };
    if scene.plan.shared_paths == Some(true) {
        assert!(matches!(plan.band_paths, BandPaths::Shared(_)), "{what}: {:?}", plan.band_paths);
    }
    let one = on(1, scene, &plan);
    assert_same(scene, &one, &on(3, scene, &plan), &format!("{what}, threads"));
    // Where samples end by pixel, rows alone can be dealt out.
    let by_samples = (!plan.stopping.is_adaptive()).then_some(ShardBy::Samples);
    for by in [ShardBy::Rows].into_iter().chain(by_samples) {
        assert_same(
            scene,
            &one,
            &in_shares(scene, &plan, by),
            &format!("{what}, shares of {by:?}"),
        );
    }
    one
}

/// That a picture is the reference's but for roundings.
fn assert_near(reference: &Rendered, other: &Rendered, most: Apart, what: &str) {
    let apart = |name, same: fn(&f64, &f64) -> bool| {
        let [due, found] = [reference, other].map(|done| layer(&done.picture, name));
        let off = found.iter().zip(&due).filter(|(a, b)| !same(a, b)).count();
        (off as f64 / due.len() as f64, [due, found].map(|values| values.iter().sum::<f64>()))
    };
    // The last bits of what is solved in the frame of a body; a ray along an edge may be decided otherwise.
    let (off, _) = apart("Depth", |a, b| a == b || (a - b).abs() <= 1e-12 * b.abs());
    assert!(off < 2.0 / 700.0, "{what}: {off} of the depths");
    let (off, [due, found]) = apart("", |a, b| (a - b).abs() <= 1e-4 * (1e-3 + b.abs()));
    assert!(off <= most.values, "{what}: {off} of the values");
    assert!(due > 0.0 && (found / due - 1.0).abs() <= most.mean, "{what}: {found}, not {due}");
}

#[test]
fn pictures_are_the_same_for_all_threads_shares_accelerators_and_precisions() {
    let folder = tempfile::tempdir().unwrap();
    save_waves(folder.path());
    for Kind { name, scene, apart } in kinds() {
        let mut scene = load_in(folder.path(), &scene.to_string());
        let mut found = Vec::new();
        for (accel, precision) in ways() {
            let what = format!("{name}, {} in {precision:?}", accel.name());
            scene.render.accel = Some(accel);
            found.push((held(&scene, precision, &what), what));
        }
        let (reference, _) = &found[0];
        found.iter().for_each(|(other, what)| assert_near(reference, other, apart, what));
    }
}

/// An image whose colours change across, none of them dark.
fn save_waves(folder: &Path) {
    let texels = image::RgbImage::from_fn(16, 16, |x, y| {
        let [across, down] = [x, y].map(|k| u8::try_from(70 + 9 * k).unwrap());
        image::Rgb([across, down, 150])
    });
    texels.save(folder.join("waves.png")).unwrap();
}
