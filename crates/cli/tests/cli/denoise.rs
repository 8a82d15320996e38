//! Pictures without their noise, by Open Image Denoise where its library is there.

use serde_json::{Value, json};

use crate::run::{Bench, text};

/// A room with a lamp, in which light goes from wall to wall.
fn room(keys: &Value) -> Bench {
    let wall = |material: &str, rotate: [i32; 4], translate: [f64; 3]| {
        json!({ "shape": "rectangle", "width": 2, "height": 2, "material": material,
                "transform": { "rotate": rotate, "translate": translate } })
    };
    let ball = |material: &str, at: [f64; 3]| json!({ "shape": "sphere", "radius": 0.35, "material": material, "transform": { "translate": at } });
    let mut lamp = wall("lamp", [1, 0, 0, 90], [0.0, 1.99, 0.0]);
    (lamp["width"], lamp["height"]) = (json!(0.5), json!(0.5));
    let matte = |color: [f64; 3]| json!({ "type": "matte", "color": color });
    let mut scene = json!({
        "etendue": 1,
        "camera": {
            "type": "pinhole", "fov": 40, "pose": { "from": [0, 1, 3.6], "look_at": [0, 1, 0] },
            "sensor": { "resolution": [96, 72] }
        },
        "tracer": { "type": "path", "max_bounces": 4 },
        "objects": [
            wall("white", [1, 0, 0, -90], [0.0, 0.0, 0.0]), wall("white", [1, 0, 0, 90], [0.0, 2.0, 0.0]),
            wall("tiles", [1, 0, 0, 0], [0.0, 1.0, -1.0]), wall("red", [0, 1, 0, 90], [-1.0, 1.0, 0.0]),
            wall("green", [0, 1, 0, -90], [1.0, 1.0, 0.0]),
            ball("white", [-0.4, 0.35, -0.2]), ball("mirror", [0.45, 0.35, -0.3]), lamp
        ],
        "materials": {
            "white": matte([0.73; 3]), "red": matte([0.65, 0.05, 0.05]), "green": matte([0.12, 0.45, 0.15]),
            "tiles": { "type": "checker", "colors": [[0.7, 0.7, 0.7], [0.2, 0.3, 0.5]], "squares": 8 },
            "mirror": { "type": "mirror", "color": [0.9, 0.9, 0.9] },
            "lamp": { "type": "emissive", "radiance": [9, 8, 7] }
        }
    });
    for (key, value) in keys.as_object().expect("an object") {
        scene[key] = value.clone();
    }
    Bench::with_scene(&scene.to_string())
}

/// Renders with `--denoise`; `false`, with a word about it, where there is no library and none is named.
fn denoises(bench: &Bench, test: &str, more: &[&str]) -> bool {
    let arguments = ["render", "scene.json", "-o", "out", "--quiet", "--denoise"];
    let output = bench.run(&[&arguments, more].concat());
    let said = text(&output.stderr);
    if std::env::var_os("ETENDUE_OIDN").is_none() && said.contains("is not found") {
        println!("{test} is skipped: no Open Image Denoise here, and ETENDUE_OIDN names none");
        return false;
    }
    assert!(output.status.success(), "{said}");
    true
}

/// The light up to full scale: that of the lamp's edges, nine times as bright, would outweigh all else.
fn shown(values: &[f64]) -> Vec<f64> {
    values.iter().map(|value| value.min(1.0)).collect()
}

fn rms(a: &[f64], b: &[f64]) -> f64 {
    let squares: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
    (squares / a.len() as f64).sqrt()
}

#[test]
fn noise_falls_and_the_picture_keeps_its_own() {
    let bench = room(&json!({}));
    if !denoises(&bench, "noise_falls", &["--samples", "8"]) {
        return;
    }
    let (noisy, denoised) = (bench.array("picture"), bench.array("denoised"));
    assert!(denoises(&bench, "noise_falls", &["--samples", "8", "--threads", "1"]));
    assert_eq!(bench.array("denoised"), denoised, "it does not depend on the number of threads");
    let sidecar = bench.json("out/layers.json");
    assert_eq!(sidecar["picture_png"]["layer"], "Denoised");
    let layers = sidecar["layers"].as_array().unwrap();
    let layer = layers.iter().find(|layer| layer["name"] == "Denoised").unwrap();
    assert!(layer["meaning"]["by"].as_str().unwrap().starts_with("Intel Open Image Denoise"));
    let png = std::fs::read(bench.path("out/picture.png")).unwrap();
    assert!(!bench.path("out/denoised.preview.png").exists());

    bench.render(&["--samples", "8"]);
    assert_eq!(bench.array("picture"), noisy, "the picture is as without --denoise");
    assert_ne!(std::fs::read(bench.path("out/picture.png")).unwrap(), png);
    assert!(!bench.path("out/denoised.npy").exists(), "it went with the render that left it");

    bench.render(&["--samples", "512", "--seed", "7"]);
    let [noisy, denoised, converged] =
        [noisy, denoised, bench.array("picture")].map(|values| shown(&values));
    // The reference has an eighth of the noise itself, 1 % of its square.
    let (before, after) = (rms(&noisy, &converged), rms(&denoised, &converged));
    assert!(after < before / 2.0, "{before} became {after}");
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    // Clipping takes more light from a noisy picture, and the network has a bias of its own.
    let (light, found) = (mean(&converged), mean(&denoised));
    assert!((found / light - 1.0).abs() < 0.05, "{found} for {light}");
}

#[test]
fn what_a_sensor_makes_of_the_light_stays_to_the_bit() {
    let sensor = json!({
        "type": "raw", "resolution": [48, 36], "quantum_efficiency": 0.55, "system_gain": 0.8, "read_noise": 3.0,
        "full_well": 5000, "black_level": 50, "bit_depth": 12, "moments": true
    });
    let camera = json!({
        "type": "pinhole", "fov": 40, "pose": { "from": [0, 1, 3.6], "look_at": [0, 1, 0] }, "sensor": sensor
    });
    let bench = room(&json!({ "camera": camera }));
    if !denoises(&bench, "a_sensor", &["--samples", "4"]) {
        return;
    }
    let files = || {
        let names =
            std::fs::read_dir(bench.path("out")).unwrap().map(|entry| entry.unwrap().file_name());
        let names = names.map(|name| name.into_string().unwrap());
        let is_data = |name: &String| {
            ["raw", "sensor", "camera", "picture.npy"].iter().any(|start| name.starts_with(start))
        };
        let mut names: Vec<String> = names.filter(is_data).collect();
        names.sort();
        names
            .into_iter()
            .map(|name| (std::fs::read(bench.path("out").join(&name)).unwrap(), name))
            .collect::<Vec<_>>()
    };
    let denoised = files();
    std::fs::remove_dir_all(bench.path("out")).unwrap();
    bench.render(&["--samples", "4"]);
    assert!(denoised.len() >= 8, "{denoised:?}");
    for ((found, name), (own, other)) in denoised.iter().zip(files()) {
        assert_eq!(*name, other);
        assert!(*found == own, "{name} is another one");
    }
}

#[test]
fn frames_are_denoised_and_known_as_complete() {
    let frames = json!([{ "render.seed": 1 }, { "render.seed": 2 }]);
    let bench = room(&json!({ "frames": frames }));
    if !denoises(&bench, "frames", &["--samples", "2", "--outputs", "exr,npy"]) {
        return;
    }
    let index = bench.json("out/index.json");
    for number in ["000000", "000001"] {
        assert!(bench.path("out/frames").join(number).join("denoised.npy").exists());
    }
    assert!(index["frames"][1]["files"]["Denoised"]["npy"].is_string(), "{index}");
    let again =
        ["render", "scene.json", "-o", "out", "--samples", "2", "--outputs", "exr,npy", "--resume"];
    let output = bench.run(&[&again[..], &["--denoise"]].concat());
    assert!(
        text(&output.stderr).contains("2 of 2 frames were complete"),
        "{}",
        text(&output.stderr)
    );
    // Without it they are other pictures.
    let output = bench.run(&again);
    assert!(!text(&output.stderr).contains("were complete"), "{}", text(&output.stderr));
    assert!(!bench.path("out/frames/000001/denoised.npy").exists());
}

#[test]
fn without_a_library_it_is_refused_with_the_way_to_one() {
    let bench = room(&json!({}));
    let arguments = ["render", "scene.json", "-o", "out", "--denoise"];
    for library in ["/nonexistent", "libm.so.6"] {
        let output = bench.run_in(&arguments, &[("ETENDUE_OIDN", library)]);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{said}");
        let named = format!("--denoise: {library} cannot be used");
        assert!(said.contains(&named) && said.contains("ETENDUE_OIDN"), "{said}");
        assert!(!bench.path("out").exists());
    }
    // Whether there is a library, this machine decides.
    let output = bench.run_in(&arguments, &[("ETENDUE_OIDN", ""), ("LD_LIBRARY_PATH", "")]);
    let said = text(&output.stderr);
    let is_absent = output.status.code() == Some(2) && said.contains("pip install pyoidn");
    assert!(output.status.success() || is_absent, "{said}");
}

#[test]
fn what_has_no_noise_of_light_is_refused() {
    let sensor = json!({
        "type": "multispectral", "resolution": [8, 8], "bands": { "from": 400, "to": 700, "count": 31 }
    });
    let camera = json!({ "type": "pinhole", "fov": 40, "sensor": sensor });
    let refused =
        |keys: &Value| room(keys).refusal(&["render", "scene.json", "-o", "out", "--denoise"]);
    insta::assert_snapshot!(refused(&json!({ "tracer": { "type": "facing" } })), @r#"
    error: scene.json: --denoise takes away the noise of light, and the picture shows none
    hint: give the scene a `tracer` of light, such as {"type": "path"}, or leave it out
    "#);
    insta::assert_snapshot!(refused(&json!({ "camera": camera })), @"
    error: scene.json: --denoise knows red, green and blue alone, and camera.sensor is `multispectral`: its bands would keep their noise
    hint: leave it out
    ");
}

/// A moving scene is denoised by colours and normals that are averaged over the exposure, as its light is.
#[test]
fn what_moves_keeps_its_light() {
    let mut bench = room(&json!({}));
    let mut scene = bench.json("scene.json");
    scene["camera"]["shutter"] = json!({ "exposure": "10 ms" });
    scene["objects"][5]["motion"] = json!({ "type": "velocity", "velocity": [40, 0, 0] });
    scene["render"] = json!({ "samples": 16 });
    bench = Bench::with_scene(&scene.to_string());
    bench.render(&[]);
    let noisy = bench.array("picture");
    if !denoises(&bench, "what_moves_keeps_its_light", &[]) {
        return;
    }
    let clean = bench.array("denoised");
    let sum = |values: &[f64]| shown(values).iter().sum::<f64>();
    let (found, due) = (sum(&clean), sum(&noisy));
    // The denoiser's own bias, of some thousandths on still rooms.
    assert!((found / due - 1.0).abs() < 0.02, "{found}, not {due}");
    assert!(clean != noisy, "something was done");
}
