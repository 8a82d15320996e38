//! Bands that share the paths of the scene behind a lens show what each traced by itself does: its energy, its
//! vignetting, and its place; and the picture is the same to the bit, however it is divided.

use std::path::Path;
use std::time::Duration;

use etendue_files::Transaction;
use etendue_render::output::Outputs;
use etendue_render::render::{Prepared, RenderState, finish, trace};
use etendue_render::{BandPaths, Checkpoint, Film, FilmFile, Plan, Rendered, Shard};
use etendue_report::DecisionKind;
use etendue_scene::Scene;
use etendue_spectrum::{Bands, Grid};
use serde_json::{Value, json};

use crate::steps::{channels, load_json, mean, prepare, rendered};

pub(crate) const COLUMNS: usize = 96;
pub(crate) const ROWS: usize = 80;

/// Scene of a sky and of a lamp before it, as `camera` sees it, each pixel by so many samples.
pub(crate) fn scene(mut camera: Value, lamp: bool, samples: u32, more: &Value) -> Scene {
    camera["pose"] = json!({ "from": [0, 0, 4], "look_at": [0, 0, 0] });
    camera["sensor"] = json!({ "resolution": [COLUMNS, ROWS] });
    let mut scene = json!({
        "camera": camera,
        "tracer": { "type": "direct" },
        "plan": { "shared_paths": true },
        "materials": { "lamp": { "type": "emissive", "radiance": [3, 3, 3] } },
        "lights": [{ "type": "environment", "radiance": [1, 1, 1] }],
        "objects": [],
        "render": { "samples": samples },
    });
    if lamp {
        scene["objects"] = json!([{ "shape": "rectangle", "width": 1, "height": 1.6, "material": "lamp",
            "transform": { "translate": [0.9, 0, 0] } }]);
    }
    for (key, value) in more.as_object().unwrap() {
        scene[key] = value.clone();
    }
    load_json(Path::new("."), scene)
}

/// A lens of the example scenes.
fn example(name: &str) -> Value {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/lenses");
    let text = std::fs::read(folder.join(name).with_extension("json")).unwrap();
    serde_json::from_slice(&text).unwrap()
}

/// The double Gauss wide open, whose rims cut the corners.
fn double_gauss() -> Value {
    let lens = example("double-gauss");
    json!({ "type": "lens", "lens": lens, "f_number": 2.2, "focus_distance": 4, "sensor_height": 26 })
}

/// A single lens of N-SF11 with its stop behind it, which parts blue and red by pixels.
fn singlet() -> Value {
    let lens = json!({ "elements": [
        { "type": "surface", "radius": 60, "thickness": 6, "glass": "N-SF11", "semi_diameter": 10 },
        { "type": "surface", "radius": -60, "thickness": 20, "semi_diameter": 10 },
        { "type": "aperture", "shape": "circular", "radius": 3, "thickness": 1, "stop": true }] });
    json!({ "type": "lens", "lens": lens, "focus_distance": 4, "sensor_height": 26 })
}

fn grid() -> Bands {
    Bands::Spectral(Grid::equal(400.0, 710.0, 31).unwrap())
}

#[test]
fn the_scene_says_how_nearly_shared_paths_land() {
    let shared = |error: f64| {
        let more = json!({ "accuracy": { "band_place_error": error } });
        let plan =
            Plan::new(&scene(singlet(), false, 1, &more), Outputs::from_list("exr").unwrap());
        let BandPaths::Shared(shared) = plan.band_paths else { panic!("{:?}", plan.band_paths) };
        assert!(shared.error <= error, "{shared:?}");
        shared.traced
    };
    // One wavelength displaces blue and red by pixels, which half a pixel does not allow.
    assert!(1 < shared(0.5) && shared(0.5) < shared(1e-4), "{} {}", shared(0.5), shared(1e-4));
}

/// The light of each band, with shared paths or without.
pub(crate) fn light(scene: &Scene, bands: &Bands, shares: bool) -> Vec<Vec<f64>> {
    let mut plan = Plan::new(scene, Outputs::from_list("exr").unwrap());
    assert!(plan.band_paths.are_shared(), "{:?}", plan.band_paths);
    plan.bands = bands.clone();
    if !shares {
        plan.band_paths = BandPaths::Apart(String::new());
    }
    let done = rendered(scene, &plan);
    if let Some(film) = &done.band_film {
        let count = film.bands.count();
        let band = |k| film.values.iter().skip(k).step_by(count).map(|&v| f64::from(v)).collect();
        return (0..count).map(band).collect();
    }
    channels(&done.picture, "")
}

/// Means over blocks of `side` pixels a side.
fn blocks(values: &[f64], side: usize) -> Vec<f64> {
    let [columns, rows] = [COLUMNS, ROWS].map(|size| size / side);
    let block = |k: usize| {
        let (left, top) = (k % columns * side, k / columns * side);
        let pixels = (0..side * side).map(|i| (top + i / side) * COLUMNS + left + i % side);
        mean(&pixels.map(|pixel| values[pixel]).collect::<Vec<_>>())
    };
    (0..columns * rows).map(block).collect()
}

/// Under an even sky the double Gauss shows cos⁴ and vignetting alone, which differ by band. Of the samples of
/// a pixel some land beside it: over blocks of 16 by 16 pixels what crosses their edges is a few thousandths, over
/// the picture some 10⁻⁴.
#[test]
fn a_flat_field_keeps_its_energy_and_its_vignetting_by_band() {
    for (bands, samples) in [(Bands::Rgb, 128), (grid(), 32)] {
        let scene = scene(double_gauss(), false, samples, &json!({}));
        let [shared, apart] = [true, false].map(|shares| light(&scene, &bands, shares));
        for (band, (shared, apart)) in shared.iter().zip(&apart).enumerate() {
            let off = mean(shared) / mean(apart) - 1.0;
            let (shared, apart) = (blocks(shared, 16), blocks(apart, 16));
            let worst = shared.iter().zip(&apart).map(|(a, b)| (a / b - 1.0).abs());
            let worst = worst.fold(0.0, f64::max);
            println!("band {band}: {off:.2e}, block {worst:.2e}");
            assert!(off.abs() < 1e-3, "band {band}: {off}");
            assert!(worst < 1e-2, "band {band}: {worst}");
            let darkest = apart.iter().copied().fold(f64::INFINITY, f64::min);
            assert!(darkest < 0.8 * apart[14], "nothing is vignetted: {darkest}");
        }
    }
}

/// Example lenses that disperse keep their energy, also where light comes from beside them, as a
/// fisheye's, of whose rays many end: the means of both ways are known to less than 10⁻³ there.
#[test]
fn example_lenses_keep_their_energy() {
    for (name, height) in [
        ("cooke-triplet", 26),
        ("achromat", 10),
        ("fisheye", 20),
        ("telephoto", 26),
        ("singlet", 10),
    ] {
        let camera = json!({ "type": "lens", "lens": example(name), "focus_distance": 4,
                             "sensor_height": height });
        let scene = scene(camera, false, 32, &json!({}));
        let [shared, apart] = [true, false].map(|shares| light(&scene, &Bands::Rgb, shares));
        for (band, (shared, apart)) in shared.iter().zip(&apart).enumerate() {
            let off = mean(shared) / mean(apart) - 1.0;
            println!("{name}, band {band}: {off:.2e}");
            assert!(off.abs() < 2e-3, "{name}, band {band}: {off}");
        }
    }
}

/// A single lens parts blue and red of a lamp's upright edges by about a pixel: the means of columns are where they
/// are when every band is traced by itself, to three tenths of what the ends of the spectrum are apart.
#[test]
fn edges_lie_where_each_band_has_them() {
    for (bands, samples) in [(Bands::Rgb, 128), (grid(), 32)] {
        let of = |seed: u32, shares| {
            let more = json!({ "render": { "samples": samples, "seed": seed } });
            light(&scene(singlet(), true, samples, &more), &bands, shares)
        };
        let [shared, apart] = [of(1, true), of(2, false)];
        let parted = rms(&profile(&apart[0]), &profile(&apart[apart.len() - 1]));
        for (band, (shared, apart)) in shared.iter().zip(&apart).enumerate() {
            let off = rms(&profile(shared), &profile(apart));
            let mean_off = mean(shared) / mean(apart) - 1.0;
            println!("band {band}: {off:.2e} of {parted:.2e}, mean {mean_off:.2e}");
            assert!(off < 0.3 * parted, "band {band}: {off} of {parted}");
            assert!(mean_off.abs() < 3e-3, "band {band}: {mean_off}");
        }
    }
}

/// The mean of each column.
fn profile(values: &[f64]) -> Vec<f64> {
    let column = |k: usize| values.iter().skip(k).step_by(COLUMNS).sum::<f64>() / ROWS as f64;
    (0..COLUMNS).map(column).collect()
}

fn rms(a: &[f64], b: &[f64]) -> f64 {
    let square: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
    (square / a.len() as f64).sqrt()
}

/// Threads, passes and shares make one picture, the same to the bit on one thread and on three, in
/// one pass and in several, gone on with after a stop, and in shares of its rows and of its samples
/// put together. Light lands on the rows of other shares here, and strips of other threads.
#[test]
fn threads_passes_and_shares_make_one_picture() {
    let scene = scene(singlet(), true, 12, &json!({ "layers": ["direct", "indirect"] }));
    let plan = Plan::new(&scene, Outputs::ALL);
    let BandPaths::Shared(paths) = &plan.band_paths else { panic!("{:?}", plan.band_paths) };
    assert!(paths.rows > 1 && paths.traced > 1, "{paths:?}");
    let on = |threads, plan: &Plan| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| rendered(&scene, plan))
    };
    let one = on(1, &plan);
    let mut single = plan.clone();
    single.passes = std::iter::once(0..12).collect();
    let others = [on(3, &plan), on(3, &single)];
    let (accel, images) = prepare(&scene, &plan);
    let prepared = Prepared { accel: &*accel, images: &images, others: &[] };
    let folder = tempfile::tempdir().unwrap();
    let share = |number, by_samples| {
        let shard = Shard::new(number, 3).map(|shard| match by_samples {
            true => shard.by(etendue_render::ShardBy::Samples),
            false => shard,
        });
        let state = RenderState { shard, ..RenderState::default() };
        let film = trace(&scene, &plan, prepared, &[], &state, &|_: f64| true).unwrap();
        let path = folder.path().join(format!("{number}{by_samples}"));
        film.write(&Transaction::at_once(), &path, &Vec::new(), &Value::Null).unwrap();
        FilmFile::read(&path).unwrap()
    };
    let rows = [2, 3, 1].map(|number| share(number, false));
    let film = Film::merged(&scene, &plan, &rows, &Vec::new()).unwrap();
    let of_rows = finish(&scene, &plan, film, Vec::new(), Some(&*accel)).unwrap();
    let samples = [3, 1, 2].map(|number| share(number, true));
    let state = RenderState { shares: &samples, ..RenderState::default() };
    let film = trace(&scene, &plan, prepared, &[], &state, &|_: f64| true).unwrap();
    let of_samples = finish(&scene, &plan, film, Vec::new(), Some(&*accel)).unwrap();
    // Stopped half-way, and gone on with.
    let checkpoint = Checkpoint { path: folder.path().join("kept"), every: Duration::ZERO };
    let state = RenderState { checkpoint: Some(checkpoint.clone()), ..RenderState::default() };
    let stopped = trace(&scene, &plan, prepared, &[], &state, &|share: f64| share < 0.5).unwrap();
    assert!(!stopped.is_complete() && checkpoint.path.exists());
    let film = trace(&scene, &plan, prepared, &[], &state, &|_: f64| true).unwrap();
    let gone_on = finish(&scene, &plan, film, Vec::new(), Some(&*accel)).unwrap();
    let bits = |done: &Rendered| -> Vec<u64> {
        let layers = ["", "Direct", "Indirect"].map(|name| channels(&done.picture, name).concat());
        layers.concat().into_iter().map(f64::to_bits).collect()
    };
    for other in others.iter().chain([&of_rows, &of_samples, &gone_on]) {
        assert_eq!(bits(&one), bits(other));
        assert_eq!(one.samples, other.samples);
    }
    for other in others.iter().chain([&of_rows, &of_samples]) {
        assert_eq!(one.rays, other.rays);
    }
}

/// Samples until an error is reached, as a scene has them.
fn until_an_error() -> Value {
    json!({ "relative_error": 0.02, "min": 16, "max": 512 })
}

/// Pixels at the lamp's edges get many samples, those beside them few, and light crosses from the ones to the others: it
/// counts by the samples of the pixel that it starts from, or the even field beside an edge would be as many times
/// too bright. The bounds are those of [`edges_lie_where_each_band_has_them`].
#[test]
fn samples_until_an_error_count_by_the_pixel_that_they_start_from() {
    let of = |samples: Value, shares| {
        let more = json!({ "render": { "samples": samples } });
        light(&scene(singlet(), true, 1, &more), &Bands::Rgb, shares)
    };
    let [shared, apart] = [of(until_an_error(), true), of(json!(256), false)];
    let parted = rms(&profile(&apart[0]), &profile(&apart[2]));
    for (band, (shared, apart)) in shared.iter().zip(&apart).enumerate() {
        let off = rms(&profile(shared), &profile(apart));
        let mean_off = mean(shared) / mean(apart) - 1.0;
        println!("band {band}: {off:.2e} of {parted:.2e}, mean {mean_off:.2e}");
        assert!(off < 0.3 * parted, "band {band}: {off} of {parted}");
        assert!(mean_off.abs() < 3e-3, "band {band}: {mean_off}");
    }
}

/// An even sky, which light that starts from a pixel does not show to vary at all: the layer `variance` is of
/// the light that landed, and where that varies by more than was allowed, the render says so.
#[test]
fn the_variance_of_light_that_lands_is_told() {
    let variances = |seed: u32| {
        let samples = json!({ "relative_error": 0.05, "min": 8, "max": 4096 });
        let more =
            json!({ "render": { "samples": samples, "seed": seed }, "layers": ["variance"] });
        let scene = scene(singlet(), false, 1, &more);
        let plan = Plan::new(&scene, Outputs::ALL);
        assert!(plan.band_paths.are_shared() && plan.stopping.is_adaptive());
        let done = rendered(&scene, &plan);
        let counts = done.sample_counts.unwrap();
        assert!(!counts.notes().is_empty(), "{counts:?}");
        [
            channels(&done.picture, "").swap_remove(1),
            channels(&done.picture, "Variance").swap_remove(1),
        ]
    };
    let seeds = 8;
    let (mut stated, mut pictures) = (0.0, Vec::new());
    for seed in 0..seeds {
        let [light, variance] = variances(seed);
        stated += mean(&variance) / f64::from(seeds);
        pictures.push(light);
    }
    let of_pixel = |pixel: usize| {
        let all: Vec<f64> = pictures.iter().map(|picture| picture[pixel]).collect();
        all.iter().map(|x| (x - mean(&all)).powi(2)).sum::<f64>() / f64::from(seeds - 1)
    };
    let found = mean(&(0..pictures[0].len()).map(of_pixel).collect::<Vec<_>>());
    // Neighbours share what lands: of 7680 pixels of eight seeds some hundreds are independent.
    assert!((0.8..1.25).contains(&(stated / found)), "stated {stated:e}, found {found:e}");
}

/// The same to the bit on one thread and on three, and in shares of the rows, which judge the strips from which light
/// lands on theirs; a render that is stopped before light has landed is none.
#[test]
fn samples_until_an_error_make_one_picture() {
    let more = json!({ "render": { "samples": until_an_error() } });
    let scene = scene(singlet(), true, 1, &more);
    let plan = Plan::new(&scene, Outputs::ALL);
    assert!(plan.band_paths.are_shared() && plan.stopping.is_adaptive());
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| rendered(&scene, &plan))
    };
    let [one, three] = [on(1), on(3)];
    let counts = one.sample_counts.unwrap();
    assert!(counts.least < 64 && counts.most > 256, "{counts:?}");
    let (accel, images) = prepare(&scene, &plan);
    let prepared = Prepared { accel: &*accel, images: &images, others: &[] };
    let folder = tempfile::tempdir().unwrap();
    let rows = [2, 3, 1].map(|number| {
        let state = RenderState { shard: Shard::new(number, 3), ..RenderState::default() };
        let film = trace(&scene, &plan, prepared, &[], &state, &|_: f64| true).unwrap();
        let path = folder.path().join(number.to_string());
        film.write(&Transaction::at_once(), &path, &Vec::new(), &Value::Null).unwrap();
        FilmFile::read(&path).unwrap()
    });
    let film = Film::merged(&scene, &plan, &rows, &Vec::new()).unwrap();
    let of_rows = finish(&scene, &plan, film, Vec::new(), Some(&*accel)).unwrap();
    let bits = |done: &Rendered| -> Vec<u64> {
        channels(&done.picture, "").concat().into_iter().map(f64::to_bits).collect()
    };
    for other in [&three, &of_rows] {
        assert_eq!(bits(&one), bits(other));
        assert_eq!(one.sample_counts, other.sample_counts);
        assert_eq!(one.rays, other.rays);
    }
    let state = RenderState::default();
    assert!(trace(&scene, &plan, prepared, &[], &state, &|share: f64| share < 0.7).is_err());
}

/// The plan says how bands travel: bands share paths unless something parts them, and then it says what.
#[test]
fn the_plan_says_how_bands_travel() {
    let how = |camera: Value, more: &Value| {
        let plan = Plan::new(&scene(camera, true, 8, more), Outputs::ALL);
        let found = plan.decisions.into_iter().find(|it| it.kind == DecisionKind::PathsOfBands);
        found.map(|it| (it.value.to_string(), it.reason))
    };
    let choice = |found: Option<(String, String)>| found.unwrap().0;
    assert_eq!(choice(how(double_gauss(), &json!({}))), "shared");
    assert_eq!(choice(how(singlet(), &json!({}))), "shared");
    let path = json!({ "plan": {}, "tracer": { "type": "path" } });
    assert_eq!(choice(how(double_gauss(), &path)), "shared");
    let own = |camera: Value, more: Value, why: &str| {
        let (choice, because) = how(camera, &more).unwrap();
        assert_eq!(choice, "their own");
        assert!(because.contains(why), "{because}");
    };
    own(double_gauss(), json!({ "plan": { "shared_paths": false } }), "the scene has");
    own(double_gauss(), json!({ "plan": {} }), "direct light has less noise");
    let until = json!({ "relative_error": 0.05 });
    let few = json!({ "plan": {}, "tracer": { "type": "path" }, "render": { "samples": until } });
    own(double_gauss(), few, "known too late");
    let asked = json!({ "render": { "samples": until } });
    assert_eq!(choice(how(double_gauss(), &asked)), "shared");
    // Nothing to decide: no lens, or one that takes all bands along the same way.
    assert_eq!(how(json!({ "type": "pinhole", "fov": 40 }), &json!({})), None);
    assert_eq!(how(double_gauss(), &json!({ "plan": { "dispersion": false } })), None);
    let plain = json!({ "layers": ["depth"], "tracer": null });
    assert_eq!(how(double_gauss(), &plain), None);
}
