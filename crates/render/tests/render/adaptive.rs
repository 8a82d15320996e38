//! Samples that go on until an error is reached: they reach it, stop there, and do not bend the picture.

use std::path::Path;

use etendue_files::Transaction;
use etendue_render::output::Outputs;
use etendue_render::{Film, FilmFile, Plan, Prepared, RenderState, Rendered, Shard, finish, trace};
use etendue_scene::Scene;
use serde_json::{Value, json};

use crate::steps::{self, layer, mean, prepare};

fn loaded(scene: Value) -> Scene {
    steps::load_json(Path::new("."), scene)
}

fn rendered(scene: &Scene) -> Rendered {
    steps::rendered(scene, &Plan::new(scene, Outputs::ALL))
}

/// White strips that cover `share` of each pixel of a parallel camera, before black.
fn strips([width, height]: [u32; 2], share: f64, render: &Value) -> Value {
    let strip = |column: u32| {
        let x = f64::from(column) + 0.5 - 0.5 * f64::from(width);
        json!({ "shape": "rectangle", "width": share, "height": f64::from(2 * height), "material": "white",
            "transform": { "translate": [x, 0, 0] } })
    };
    json!({
        "tracer": { "type": "flat" }, "layers": ["sample_count", "variance"], "render": render,
        "camera": { "type": "orthographic", "height": height,
            "pose": { "from": [0, 0, 3], "look_at": [0, 0, 0] },
            "sensor": { "resolution": [width, height] } },
        "objects": (0..width).map(strip).collect::<Vec<_>>(),
        "materials": { "white": { "type": "matte", "color": [1, 1, 1] } },
    })
}

/// A blob, and a sphere of glass, under a lamp; the sensor sees some hundred electrons at most.
fn room(samples: &Value, more: &Value) -> Value {
    let mut scene = json!({
        "tracer": { "type": "path", "max_bounces": 4 },
        "layers": ["sample_count", "variance"],
        "camera": { "type": "pinhole", "fov": 40,
            "pose": { "from": [0.5, 1, 4], "look_at": [0, 0, 0] },
            "sensor": { "type": "rgb", "resolution": [45, 37], "pixel_pitch": 2.4, "bit_depth": 10,
                "system_gain": 2.5, "read_noise": 2.5, "dark_current": 1, "exposure": 0.01,
                "quantum_efficiency": 0.6, "black_level": 16, "full_well": 15000 } },
        "materials": { "a": { "type": "dielectric", "ior": 1.5 },
            "b": { "type": "matte", "color": [0.8, 0.3, 0.2] },
            "lamp": { "type": "emissive", "radiance": [9, 9, 9] } },
        "lights": [{ "type": "environment", "radiance": [0.2, 0.2, 0.2] }],
        "objects": [{ "shape": "blob", "triangles": 500, "material": "b" },
            { "shape": "sphere", "radius": 0.5, "material": "a", "transform": { "translate": [0.7, 0, 1] } },
            { "shape": "rectangle", "width": 9, "height": 9, "material": "b",
              "transform": { "translate": [0, 0, -2] } },
            { "shape": "rectangle", "width": 1, "height": 1, "material": "lamp",
              "transform": { "translate": [0, 3, 0], "rotate": [1, 0, 0, 90] } }],
        "render": { "samples": samples },
    });
    for (key, value) in more.as_object().into_iter().flatten() {
        *scene.pointer_mut(key).unwrap() = value.clone();
    }
    scene
}

/// The share of a pixel that is white is known. Of a thousand pictures of four blocks, which stop
/// when their own error is small, the mean is that share to less than a thousandth of it, although the
/// numbers of samples differ from picture to picture and the pixels that stop early are the even ones.
#[test]
fn stopping_does_not_bend_the_picture() {
    for share in [0.5, 0.25] {
        let samples = json!({ "relative_error": 0.25, "min": 4, "max": 4096 });
        let render = json!({ "samples": samples, "sampler": "independent" });
        let mut scene = loaded(strips([16, 16], share, &render));
        let plan = Plan::new(&scene, Outputs::NONE);
        let (accel, images) = prepare(&scene, &plan);
        let (mut means, mut numbers) = (Vec::new(), Vec::new());
        for seed in 0..1000 {
            scene.render.seed = seed;
            let done = steps::trace(&scene, &plan, &*accel, &images).picture;
            means.push(mean(&layer(&done, "")));
            numbers.push(mean(&layer(&done, "SampleCount")));
        }
        let spread = means.iter().map(|m| (m - share).powi(2)).sum::<f64>().sqrt() / 1000.0;
        let bias = mean(&means) / share - 1.0;
        println!(
            "share {share}: bias {:.4} %, one standard error {:.4} %, {:.1} samples a pixel",
            100.0 * bias,
            100.0 * spread / share,
            mean(&numbers)
        );
        numbers.sort_by(f64::total_cmp);
        assert!(numbers[0] < 0.95 * numbers[999], "numbers depend on chance");
        assert!(bias.abs() < 1e-3, "{share}: {bias}");
    }
}

/// Pixels of one colour of a chessboard are uneven, those of the other are black: each half is decided by the
/// other, so the uneven ones stop with the fewest samples. The note counts them by their own.
#[test]
fn what_stopped_too_early_is_counted_and_said() {
    let side = 16_u32;
    let samples = json!({ "relative_error": 0.05, "min": 8, "max": 64 });
    let mut scene =
        strips([side, side], 0.3, &json!({ "samples": samples, "sampler": "independent" }));
    let middle = |k: u32| f64::from(k) + 0.5 - 0.5 * f64::from(side);
    let places = (0..side * side).map(|k| [k % side, k / side]).filter(|[x, y]| (x ^ y) & 1 == 0);
    let square = |[x, y]: [u32; 2]| {
        json!({ "shape": "rectangle", "width": 0.3, "height": 0.9, "material": "white",
            "transform": { "translate": [middle(x), -middle(y), 0] } })
    };
    scene["objects"] = places.map(square).collect();
    let counts = rendered(&loaded(scene)).sample_counts.unwrap();
    assert_eq!(counts.pixels, u64::from(side * side));
    // Of 32 pixels with 8 samples each, the variance is 0.27/0.3²/8, where a four hundredth is allowed.
    assert_eq!(counts.over, u64::from(side * side / 2), "{counts:?}");
    let note = counts.notes().concat();
    assert!(
        note.contains("50.00 % of the pixels stopped with more than twice the variance"),
        "{note}"
    );
    // An even picture says nothing; neither does one whose blocks have four pixels a half, where 16 samples make
    // the variance what is allowed: the mean of their eight squares is over twice that by chance in 4 of 100.
    for (resolution, error) in [([32, 32], 0.2), ([1024, 1], 0.25)] {
        let even = json!({ "relative_error": error, "min": 16, "max": 4096 });
        let scene = strips(resolution, 0.5, &json!({ "samples": even, "sampler": "independent" }));
        let counts = rendered(&loaded(scene)).sample_counts.unwrap();
        assert_eq!(counts.notes(), Vec::<String>::new(), "{counts:?}");
    }
}

/// A caustic behind a ball of glass under a lamp of 4 mm: whose paths are so rare that seeds differ by more than a
/// quarter of the floor's light there. Pictures say that they cannot be judged, or what of them is not reached.
#[test]
fn a_picture_of_rare_paths_says_that_it_cannot_be_judged() {
    let mut scene = loaded(json!({
        "tracer": { "type": "path", "max_bounces": 5 }, "layers": [],
        "camera": { "type": "pinhole", "fov": 12, "pose": { "from": [0, 2, 3], "look_at": [0, 0, 0] },
            "sensor": { "resolution": [32, 32] } },
        "lights": [{ "type": "environment", "radiance": [0.02, 0.02, 0.02] }],
        "objects": [
            { "shape": "rectangle", "width": 9, "height": 9, "material": "floor",
              "transform": { "rotate": [1, 0, 0, -90] } },
            { "shape": "sphere", "radius": 0.5, "triangles": 2000, "material": "glass",
              "transform": { "translate": [0, 0.7, 0] } },
            { "shape": "sphere", "radius": 0.02, "triangles": 320, "material": "lamp",
              "transform": { "translate": [0, 2, 0] } },
        ],
        "materials": { "floor": { "type": "matte", "color": [0.5, 0.5, 0.5] }, "glass": { "type": "dielectric" },
            "lamp": { "type": "emissive", "radiance": [2000, 2000, 2000] } },
        "render": { "samples": { "relative_error": 0.3, "max": 256 } },
    }));
    let plan = Plan::new(&scene, Outputs::NONE);
    let (accel, images) = prepare(&scene, &plan);
    let (mut means, mut said) = (Vec::new(), 0);
    let seeds = 24_u32;
    for seed in 0..seeds {
        scene.render.seed = seed.into();
        let done = steps::trace(&scene, &plan, &*accel, &images);
        let own = mean(&layer(&done.picture, ""));
        means.push(own);
        let counts = done.sample_counts.unwrap();
        println!("{own:.4} {:?} {counts:?}", counts.variance());
        said += u32::from(!counts.notes().is_empty());
    }
    let spread =
        means.iter().map(|m| (m - mean(&means)).powi(2)).sum::<f64>() / f64::from(seeds - 1);
    assert!(spread.sqrt() > 0.05 * mean(&means), "paths are not rare: {means:?}");
    assert!(6 * said >= 5 * seeds, "{said} of {seeds} say so");
}

/// The variance that the layer tells is that of the pictures: against the known share, over pixels and
/// seeds. And it is what was asked for.
#[test]
fn the_variance_is_that_of_the_picture() {
    let wanted = 0.2;
    for sampler in ["sobol", "independent"] {
        let samples = json!({ "relative_error": wanted, "min": 16, "max": 4096 });
        let render = json!({ "samples": samples, "sampler": sampler });
        let mut scene = loaded(strips([32, 16], 0.3, &render));
        let (mut told, mut found) = (0.0, 0.0);
        for seed in 0..8 {
            scene.render.seed = seed;
            let done = rendered(&scene).picture;
            // The three channels are one.
            let red = |name: &str| layer(&done, name)[..512].to_vec();
            told += mean(&red("Variance")) / 8.0;
            found += red("").iter().map(|value| (value - 0.3).powi(2)).sum::<f64>() / 512.0 / 8.0;
        }
        println!("{sampler}: told {:.4}, found {:.4}", told.sqrt() / 0.3, found.sqrt() / 0.3);
        // 4096 squares of normal numbers: their mean is known to 2.2 %; four times that, and the told one
        // as well.
        assert!((told / found - 1.0).abs() < 0.15, "{sampler}: {told} {found}");
        // A test that is taken until it is passed is passed a little early.
        let error = found.sqrt() / 0.3;
        assert!(error < 1.1 * wanted && error > 0.5 * wanted, "{sampler}: {error}");
    }
}

/// The error of the samples against a converged picture, carried to digital numbers, is the share of the
/// sensor's own variance that was asked for, where pixels were not given up; and pixels get different
/// numbers of samples.
#[test]
fn samples_stop_at_the_noise_of_the_sensor() {
    let fraction = 0.2;
    let samples = json!({ "until": "sensor-noise", "fraction": fraction, "min": 16, "max": 2048 });
    let scene = loaded(room(&samples, &json!({})));
    let done = rendered(&scene);
    let counts = done.sample_counts.unwrap();
    println!("{}", counts.words());
    assert!(counts.least == 16 && counts.mean() < 0.6 * f64::from(counts.most), "{counts:?}");
    let numbers = layer(&done.picture, "SampleCount");
    assert_eq!(numbers.iter().sum::<f64>(), counts.total as f64);
    let converged = rendered(&loaded(room(&json!(4096), &json!({ "/layers": [] }))));
    let sensor = scene.sensor.clone().unwrap().in_bands(etendue_spectrum::Bands::Rgb).unwrap();
    let floor = sensor.noise_floor(0.01).unwrap();
    let [found, expected] = [&done, &converged].map(|done| layer(&done.picture, ""));
    let pixels = numbers.len();
    let (mut sum, mut count) = (0.0, 0.0);
    for i in (0..pixels).filter(|&i| numbers[i] < 2048.0) {
        for channel in 0..3 {
            let electrons = |values: &[f64]| -> f64 {
                floor
                    .electrons_per_unit(channel)
                    .zip(0..)
                    .map(|(e, k)| e * values[k * pixels + i])
                    .sum()
            };
            let (found, expected) = (electrons(&found), electrons(&expected));
            let error = floor.slope(expected) * (found - expected);
            sum += error * error / floor.variance(expected);
            count += 1.0;
        }
    }
    println!("error {:.3} of the sensor's variance", sum / count);
    // The converged picture has some noise itself, and blocks differ.
    assert!(sum / count < 1.3 * fraction, "{}", sum / count);
}

/// Threads and shares make one picture, the same to the bit on one thread and on three, and in
/// shares put together; the shares' notes and counts are the whole's, too.
#[test]
fn threads_and_shares_make_one_picture() {
    let samples = json!({ "until": "sensor-noise", "fraction": 0.3, "min": 16, "max": 64 });
    let scene = loaded(room(&samples, &json!({})));
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| rendered(&scene))
    };
    let (one, three) = (on(1), on(3));
    let plan = Plan::new(&scene, Outputs::ALL);
    let (accel, images) = prepare(&scene, &plan);
    let prepared = Prepared { accel: &*accel, images: &images, others: &[] };
    let folder = tempfile::tempdir().unwrap();
    let share = |number| {
        let state = RenderState { shard: Shard::new(number, 2), ..RenderState::default() };
        let film = trace(&scene, &plan, prepared, &[], &state, &|_: f64| true).unwrap();
        let path = folder.path().join(number.to_string());
        film.write(&Transaction::at_once(), &path, &Vec::new(), &Value::Null).unwrap();
        FilmFile::read(&path).unwrap()
    };
    let film = Film::merged(&scene, &plan, &[share(2), share(1)], &Vec::new()).unwrap();
    let merged = finish(&scene, &plan, film, Vec::new(), Some(&*accel)).unwrap();
    for name in ["", "SampleCount", "Variance"] {
        let bits = |done: &Rendered| -> Vec<u64> {
            layer(&done.picture, name).into_iter().map(f64::to_bits).collect()
        };
        assert_eq!(bits(&one), bits(&three), "{name}");
        assert_eq!(bits(&one), bits(&merged), "{name}");
    }
    for other in [&three, &merged] {
        assert_eq!(one.sample_counts, other.sample_counts);
        assert_eq!(one.notes, other.notes);
        assert_eq!(one.picture.header(), other.picture.header());
        assert_eq!((one.rays, one.samples), (other.rays, other.samples));
    }
    assert!(one.notes.iter().any(|note| note.contains("around column")), "{:?}", one.notes);
}

/// Without noise there is nothing to stop at: a relative error stands in, and it is said.
#[test]
fn without_noise_a_relative_error_stands_in() {
    let samples = json!({ "until": "sensor-noise", "max": 16 });
    for sensor in [
        json!({ "type": "rgb", "resolution": [8, 8], "noise": "none" }),
        json!({ "resolution": [8, 8] }),
    ] {
        let scene = loaded(room(&samples, &json!({ "/camera/sensor": sensor })));
        let done = rendered(&scene);
        let said = |note: &String| note.contains("nothing to stop at") && note.contains("0.02");
        assert!(done.notes.iter().any(said), "{:?}", done.notes);
        assert!(Plan::new(&scene, Outputs::ALL).to_string().contains("nothing to stop at"));
    }
}

/// A time gives every pixel the same number of samples, and the picture is that of this number.
#[test]
fn a_time_gives_the_picture_of_some_number_of_samples() {
    let picture = |samples: &Value| rendered(&loaded(room(samples, &json!({ "/layers": [] }))));
    let timed = picture(&json!({ "time": "200 ms" }));
    assert!(timed.samples >= 4 && timed.samples_wanted == timed.samples, "{}", timed.samples);
    assert!(timed.picture.header().iter().all(|entry| entry.key != "partial"));
    let counted = picture(&json!(timed.samples));
    assert_eq!(layer(&timed.picture, ""), layer(&counted.picture, ""));
    let few = picture(&json!({ "time": "1 min", "max": 6 }));
    assert_eq!(few.samples, 6);
}

/// Checkpoints and shares that cannot be kept or divided are refused by name.
#[test]
fn checkpoints_of_such_samples_and_shares_of_a_time_are_refused() {
    let refused = |samples: &Value, state: RenderState<'_>| {
        let scene = loaded(room(samples, &json!({ "/layers": [] })));
        let plan = Plan::new(&scene, Outputs::ALL);
        let (accel, images) = prepare(&scene, &plan);
        let prepared = Prepared { accel: &*accel, images: &images, others: &[] };
        let found = trace(&scene, &plan, prepared, &[], &state, &|_: f64| true);
        found.map(|_| ()).unwrap_err()
    };
    let path = Path::new("unused").to_owned();
    let kept = etendue_render::Checkpoint { path, every: std::time::Duration::ZERO };
    let checkpoint = RenderState { checkpoint: Some(kept), ..RenderState::default() };
    let shard = RenderState { shard: Shard::new(1, 2), ..RenderState::default() };
    let error = refused(&json!({ "relative_error": 0.1 }), checkpoint.clone());
    assert!(error.to_string().starts_with("--checkpoint: samples"), "{error}");
    for state in [checkpoint, shard] {
        let error = refused(&json!({ "time": 1 }), state);
        assert!(error.to_string().contains("time"), "{error}");
    }
}
