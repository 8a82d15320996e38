//! Exposures in slots: sums of their parts, noise that is drawn once, and what is refused.

use serde_json::{Value, json};

use crate::run::{Bench, read_npy, text, under};

const SIZE: [usize; 2] = [12, 10];

/// The exposure (s).
const EXPOSURE: f64 = 0.012;

/// A ball that flies before a checkered wall, and a camera that moves through a rolling shutter.
fn scene() -> Value {
    json!({
        "etendue": 1,
        "tracer": { "type": "path" },
        "layers": ["depth", "time", "direct", "light_groups"],
        "camera": {
            "type": "pinhole", "fov": 50, "pose": { "from": [0, 0, 3], "look_at": [0, 0, 0] },
            "shutter": { "type": "rolling", "line_time": "100 us" },
            "motion": { "type": "velocity", "velocity": [5, 0, 0] },
            "sensor": { "type": "raw", "cfa": "rggb", "resolution": SIZE, "read_noise": 3, "system_gain": 0.5,
                        "exposure": EXPOSURE }
        },
        "lights": [
            { "type": "point", "at": [1, 2, 3], "intensity": [9, 8, 7], "group": "key",
              "modulation": { "type": "sine", "frequency": 90 } },
            { "type": "environment", "radiance": [0.2, 0.3, 0.4] }
        ],
        "objects": [
            { "shape": "rectangle", "width": 6, "height": 6, "material": "tiles", "transform": { "translate": [0, 0, -1] } },
            { "shape": "sphere", "radius": 0.5, "motion": { "type": "velocity", "velocity": [0, 30, 0] } }
        ],
        "materials": { "tiles": { "type": "checker" } },
        "render": { "samples": 16, "seed": 7 }
    })
}

fn slots() -> Value {
    json!([
        { "duration": "2 ms" },
        { "duration": "5 ms", "pixels": [[1, 0.25], [0, 0.5]], "set": { "camera.pose.from": [0.3, 0.1, 3] } },
        { "start": "6 ms", "pixels": [[0, 1, 0.5]], "set": { "camera.fov": 40, "lights[1].radiance": [1, 0, 0] } }
    ])
}

/// Times of each of the slots: the third for what the others leave, from within the second on.
const SPANS: [[f64; 2]; 3] = [[0.0, 0.002], [0.002, 0.007], [0.006, 0.011]];

fn rendered(scene: &Value, more: &[&str]) -> Bench {
    let bench = Bench::with_scene(&scene.to_string());
    run(&bench, &[&["render", "scene.json", "-o", "out"], more].concat());
    bench
}

fn run(bench: &Bench, arguments: &[&str]) {
    let output = bench.run(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
}

/// Set by hand, each slot is a picture of its own: of the shutter's open interval, with its seed.
#[test]
fn an_exposure_is_the_sum_of_its_slots_before_noise() {
    let mut serial = scene();
    serial["serial"] = slots();
    let whole = rendered(&serial, &[]);
    let mut sums: Vec<(&str, Vec<f64>)> = Vec::new();
    for (number, span) in SPANS.iter().enumerate() {
        let mut part = scene();
        part["camera"]["shutter"]["open"] = json!([span]);
        part["render"]["seed"] = json!(7 + number);
        match number {
            1 => part["camera"]["pose"]["from"] = json!([0.3, 0.1, 3]),
            2 => {
                part["camera"]["fov"] = json!(40);
                part["lights"][1]["radiance"] = json!([1, 0, 0]);
            }
            _ => {}
        }
        let share = |x: usize, y: usize| match number {
            1 => [[1.0, 0.25], [0.0, 0.5]][y % 2][x % 2],
            2 => [0.0, 1.0, 0.5][x % 3],
            _ => 1.0,
        };
        let part = rendered(&part, &[]);
        for (k, name) in ["picture", "direct", "light_key", "light_other"].into_iter().enumerate() {
            let values = part.array(name);
            let shared = values.iter().enumerate().map(|(i, value)| {
                let pixel = i / 3;
                share(pixel % SIZE[0], pixel / SIZE[0]) * value
            });
            match sums.get_mut(k) {
                None => sums.push((name, shared.collect())),
                Some((_, sums)) => sums.iter_mut().zip(shared).for_each(|(sum, part)| *sum += part),
            }
        }
    }
    for (name, due) in &sums {
        let found = whole.array(name);
        assert_eq!(found.len(), due.len(), "{name}");
        assert!(due.iter().any(|value| *value > 0.0), "{name}");
        for (found, due) in found.iter().zip(due) {
            // The sum of three numbers is rounded to f32 once.
            assert!((found - due).abs() <= 6e-8 * due, "{name}: {found}, not {due}");
        }
    }
    // What is no light is of the scene by itself.
    let mut plain = scene();
    plain["serial"] = json!([]);
    let plain = rendered(&plain, &[]);
    for name in ["depth", "time"] {
        let [found, due] = [&whole, &plain].map(|bench| bench.array(name));
        assert!(found.iter().zip(&due).all(|(a, b)| a.to_bits() == b.to_bits()), "{name}");
    }
}

#[test]
fn rows_of_an_exposure_in_slots_are_put_together() {
    let mut serial = scene();
    serial["serial"] = slots();
    serial["camera"]["sensor"]["resolution"] = json!([12, 40]);
    let bench = rendered(&serial, &["--threads", "1"]);
    run(&bench, &["render", "scene.json", "-o", "threads", "--threads", "3"]);
    for share in ["1/2", "2/2"] {
        run(&bench, &["render", "scene.json", "-o", "rows", "--shard", share]);
    }
    run(&bench, &["merge", "merged", "rows/shard-1-of-2.film", "rows/shard-2-of-2.film"]);
    for file in ["picture.npy", "raw.npy", "depth.npy"] {
        let [whole, threads, merged] = ["out", "threads", "merged"]
            .map(|folder| std::fs::read(bench.path(folder).join(file)).unwrap());
        assert!(whole == threads && whole == merged, "{file}");
    }
}

/// The header of rows that are put together is that of the whole: where samples stop by themselves every pixel has
/// other ones, and the header says how many all have.
#[test]
fn rows_of_slots_tell_the_samples_of_the_whole() {
    let mut serial = scene();
    serial["serial"] = slots();
    serial["layers"] = json!([]);
    serial["camera"]["sensor"]["resolution"] = json!([12, 40]);
    serial["render"]["samples"] = json!({ "relative_error": 0.5, "min": 4, "max": 64 });
    let bench = rendered(&serial, &["--report", "whole.json"]);
    for share in ["1/2", "2/2"] {
        run(&bench, &["render", "scene.json", "-o", "rows", "--shard", share]);
    }
    let shares = ["rows/shard-1-of-2.film", "rows/shard-2-of-2.film"];
    run(&bench, &["merge", "merged", shares[0], shares[1], "--report", "merged.json"]);
    let header = |folder: &str| bench.json(&format!("{folder}/layers.json"))["header"].clone();
    let [whole, merged] = ["out", "merged"].map(header);
    assert_eq!(whole, merged);
    // Fewer than are allowed, which is what nobody who knew no better would say.
    let samples = whole["samples"].as_str().and_then(|words| words.parse::<u32>().ok());
    assert!(samples.is_some_and(|samples| samples < 64), "{whole}");
    let [whole, merged] = ["whole.json", "merged.json"].map(|report| bench.json(report));
    for key in ["samples", "samples_wanted", "image_hash"] {
        assert_eq!(whole[key], merged[key], "{key}");
    }
}

/// A white wall in 16 slots: the variance in electrons is the mean and the read noise once, not 16 times.
#[test]
fn noise_is_drawn_once() {
    let read_noise = 30.0;
    let side = 64;
    let scene = json!({
        "etendue": 1, "tracer": { "type": "direct" }, "lights": [],
        "camera": { "type": "orthographic", "height": 1, "pose": { "from": [0, 0, 3], "look_at": [0, 0, 0] },
            "sensor": { "type": "raw", "cfa": "wwww", "resolution": [side, side], "read_noise": read_noise,
                        "system_gain": 1, "bit_depth": 16, "black_level": 1000, "full_well": 60000,
                        "dark_current": 0, "quantum_efficiency": 0.5, "exposure": 0.016 } },
        "objects": [{ "shape": "rectangle", "width": 9, "height": 9, "material": "lamp" }],
        "materials": { "lamp": { "type": "emissive", "radiance": [0.02, 0.02, 0.02] } },
        "render": { "samples": 1 }
    });
    let mut serial = scene.clone();
    serial["serial"] = json!(vec![json!({}); 16]);
    let statistics = |scene: &Value| {
        let bench = rendered(scene, &[]);
        let numbers = read_npy(&bench.path("out").join("raw.npy"));
        let n = numbers.len() as f64;
        let mean = numbers.iter().sum::<f64>() / n;
        let variance = numbers.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
        [mean - 1000.0, variance]
    };
    let [mean, variance] = statistics(&serial);
    let due = mean + read_noise * read_noise;
    // The variance of n values is off by √(2/n): four times that. A draw a slot would be 16 · 900.
    let n = (side * side) as f64;
    assert!(mean > 100.0, "{mean}");
    assert!(
        (variance / due - 1.0).abs() < 4.0 * (2.0 / n).sqrt(),
        "{variance}, not {due} of {mean}"
    );
    let [whole, _] = statistics(&scene);
    // Both means are off by √(due / n).
    assert!((mean - whole).abs() < 6.0 * (due / n).sqrt(), "{mean} {whole}");
}

/// Frames that are spread over a slot are slots that are written one by one.
#[test]
fn frames_along_a_slot_are_slots_of_their_own() {
    let poses = [0.0, 0.2, -0.3].map(|x| json!({ "from": [x, 0.5 * x, 3], "look_at": [0, 0, 0] }));
    let by_hand = |serial: Value| {
        let mut scene = scene();
        scene["serial"] = serial;
        rendered(&scene, &[]).array("picture")
    };
    let along = by_hand(json!([
        { "duration": "6 ms", "pixels": [[1, 0.5]], "along": { "type": "poses", "poses": poses } },
        { "along": [{ "camera.fov": 40 }, { "camera.fov": 60, "lights[1].radiance": [1, 0, 0] }] }
    ]));
    let mut each: Vec<Value> = poses
        .iter()
        .map(|pose| json!({ "duration": "2 ms", "pixels": [[1, 0.5]], "set": { "camera.pose": pose } }))
        .collect();
    each.push(json!({ "set": { "camera.fov": 40 } }));
    each.push(json!({ "set": { "camera.fov": 60, "lights[1].radiance": [1, 0, 0] } }));
    let each = by_hand(json!(each));
    assert!(along.iter().any(|value| *value > 0.0));
    for (along, each) in along.iter().zip(&each) {
        // Starts of slots are rounded in f64 by another sum.
        assert!((along - each).abs() <= 1e-6 * each, "{along}, not {each}");
    }
}

#[test]
fn what_is_no_slot_is_refused_by_its_place() {
    let with = |slots: Value| {
        let mut scene = scene();
        scene["serial"] = slots;
        scene
    };
    let mut instant = with(json!([{}]));
    instant["camera"]["sensor"] = json!({ "resolution": SIZE });
    let mut reset = with(json!([{}]));
    reset["camera"]["shutter"]["type"] = json!("global_reset");
    let mut coded = with(json!([{ "duration": "6 ms" }, { "duration": "6 ms" }]));
    coded["camera"]["shutter"]["code"] = json!("10");
    let mut facing = with(json!([{}]));
    facing["tracer"] = json!({ "type": "facing" });
    facing["layers"] = json!([]);
    let slots = [
        json!([{ "duration": "13 ms" }]),
        json!([{ "duration": "12 ms" }, {}]),
        json!([{ "start": -1 }]),
        json!([{ "set": { "camera.sensor.resolution": [1, 1] } }]),
        json!([{ "set": { "camera": {} } }]),
        json!([{ "set": { "render.seed": 1 } }]),
        json!([{ "set": { "camera.f_stop": 1 } }]),
        json!([{}, { "along": { "type": "orbit", "count": 4 } }]),
        json!([{ "along": [] }]),
        json!([{ "along": [{}, { "camera.sensor.exposure": 1 }] }]),
        json!([{ "along": { "type": "trajectory", "file": "none.txt" } }]),
        json!([{ "pixels": [[1], [1, 0]] }]),
        json!([{ "pixels": [[2]] }]),
        json!([{ "pixels": "none.png" }]),
    ];
    let render = ["render", "scene.json", "-o", "out"];
    let refused = |scene: &Value| Bench::with_scene(&scene.to_string()).refusal(&render);
    let mut all = slots.map(|slots| under(&slots.to_string(), &refused(&with(slots)))).concat();
    for (what, scene) in [
        ("no exposure", instant),
        ("global reset", reset),
        ("a coded shutter", coded),
        ("no light", facing),
    ] {
        all += &under(what, &refused(&scene));
    }
    let bench = Bench::with_scene(&with(json!([{}])).to_string());
    for more in [&["--checkpoint", "1"][..], &["--shard", "1/2", "--shard-by", "samples"]] {
        all += &under(&more.join(" "), &bench.refusal(&[&render, more].concat()));
    }
    insta::assert_snapshot!(all);
    // A mask of another size than the sensor.
    let bench = Bench::with_scene(&with(json!([{ "pixels": "small.png" }])).to_string());
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 2, 2);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.write_header().unwrap().write_image_data(&[255; 4]).unwrap();
    bench.write("small.png", &bytes);
    insta::assert_snapshot!(bench.refusal(&render), @r#"error: scene.json, line 1, column 791: serial[0].pixels: "small.png" has 2 x 2 pixels, and the sensor 12 x 10; a mask has one for each"#);
}
