//! Photons counted by the whole program, against sums by the nanometre that know nothing of it.

use serde_json::{Value, json};

use crate::run::{Bench, text};

const HC: f64 = 6.626_070_15e-34 * 299_792_458.0;

/// CIE standard illuminant A (CIE 15:2018, equation 4.1), 1 at 560 nm.
fn illuminant_a(nm: f64) -> f64 {
    let term = |nm: f64| (1.435e7 / (2848.0 * nm)).exp() - 1.0;
    (560.0 / nm).powi(5) * term(560.0) / term(nm)
}

/// Planck's law for a temperature (K), 1 at 560 nm.
fn black_body(kelvin: f64) -> impl Fn(f64) -> f64 {
    let power = move |nm: f64| nm.powi(-5) / ((1.438_776_877e7 / (nm * kelvin)).exp() - 1.0);
    move |nm| power(nm) / power(560.0)
}

/// A polygon through `[nm, value]`, 0 outside.
fn polygon(points: &[[f64; 2]], nm: f64) -> f64 {
    let between = points.windows(2).find(|p| p[0][0] <= nm && nm <= p[1][0]);
    between.map_or(0.0, |p| p[0][1] + (p[1][1] - p[0][1]) * (nm - p[0][0]) / (p[1][0] - p[0][0]))
}

/// Electrons of 10 ms on a pixel of 4 µm under an irradiance of 3e-4 W·m⁻²·nm⁻¹ times `light`, by the
/// rule of midpoints in steps of a nanometre.
fn electrons([from, to]: [u32; 2], light: impl Fn(f64) -> f64, seen: impl Fn(f64) -> f64) -> f64 {
    let middle = |nm: u32| f64::from(nm) + 0.5;
    let sum: f64 = (from..to).map(middle).map(|nm| light(nm) * seen(nm) * nm * 1e-9).sum();
    3e-4 * 16e-12 * 0.01 * sum / HC
}

/// A wall that shines by `illuminant` all over the picture, before a sensor that counts photons
/// without noise, 16 bit and 0.5 DN an electron.
fn shining(illuminant: &Value, keys: &Value) -> Bench {
    let mut sensor = json!({
        "type": "raw", "resolution": [4, 4], "pixel_pitch": 4, "system_gain": 0.5, "noise": "none",
        "radiometry": "physical"
    });
    if keys.get("exposures").is_none() {
        sensor["exposure"] = json!(0.01);
    }
    for (key, value) in keys.as_object().expect("an object") {
        sensor[key] = value.clone();
    }
    let scene = json!({
        "etendue": 1,
        "camera": {
            "type": "orthographic", "height": 1, "sensor": sensor,
            "pose": { "from": [0, 0, 2], "look_at": [0, 0, 0] }
        },
        "tracer": { "type": "direct" },
        "objects": [{ "shape": "rectangle", "width": 9, "height": 9, "material": "lamp" }],
        "materials": {
            "lamp": { "type": "emissive", "radiance": [3e-4, 3e-4, 3e-4], "illuminant": illuminant, "two_sided": true }
        }
    });
    Bench::with_scene(&scene.to_string())
}

/// The numbers of `raw.npy`, as electrons. A DN is two of them, so each is known to one.
fn counted(bench: &Bench) -> Vec<f64> {
    bench.render(&["--samples", "1"]);
    bench.array("raw").into_iter().map(|y| 2.0 * y).collect()
}

fn assert_counts(found: f64, expected: f64, what: &str) {
    // What the plan promises, and the rounding to a DN.
    assert!((found - expected).abs() <= 1e-3 * expected + 1.0, "{what}: {found}, not {expected}");
    assert!(expected > 1000.0 && expected < 130_000.0, "{what}: {expected} e⁻ are no test");
}

#[test]
fn coloured_light_is_counted_by_the_nanometre() {
    let blue = [[400.0, 0.0], [450.0, 0.9], [500.0, 0.0]];
    let visible = [380, 780];
    let flat = |_: f64| 1.0;
    let a = json!("a");
    // Clear and blue pixels of one pattern, of a sensor whose quantum efficiency is a number.
    let keys = json!({ "cfa": "rgbw", "filters": { "b": blue } });
    let pixels = counted(&shining(&a, &keys));
    let clear = electrons(visible, illuminant_a, flat);
    assert_counts(pixels[5], clear, "clear under A");
    assert_counts(
        pixels[4],
        electrons(visible, illuminant_a, |nm| polygon(&blue, nm)),
        "blue under A",
    );
    // Without filters, by a curve, and by ideal filters and a curve, it is the same clear pixel.
    let curve = json!([[380, 1], [780, 1]]);
    for keys in [
        json!({}),
        json!({ "quantum_efficiency": curve }),
        json!({ "cfa": "rgbw", "quantum_efficiency": curve }),
        json!({ "cfa": "rgbw" }),
    ] {
        assert_counts(counted(&shining(&a, &keys))[5], clear, &keys.to_string());
    }
    // Blue is the same whether 1 is written as a number or as a curve.
    let [number, curve] =
        [json!({ "cfa": "rgbw" }), json!({ "cfa": "rgbw", "quantum_efficiency": curve })]
            .map(|keys| counted(&shining(&a, &keys))[4]);
    assert_counts(number, curve, "ideal blue");
}

#[test]
fn bands_of_a_multispectral_sensor_count_what_falls_into_them() {
    let keys = json!({ "type": "multispectral", "bands": [400, 450, 500, 550, 600, 650, 700] });
    let found = counted(&shining(&json!("a"), &keys));
    for (k, from) in [400, 450, 500, 550, 600, 650].into_iter().enumerate() {
        let expected = electrons([from, from + 50], illuminant_a, |_| 1.0);
        // Half a DN and a thousandth, of which bands of 50 nm were off by up to 17.
        assert!(
            (found[k] - expected).abs() <= 1e-3 * expected + 1.0,
            "{from}: {} {expected}",
            found[k]
        );
    }
}

#[test]
fn light_beyond_the_visible_counts_where_the_sensor_sees_it() {
    let silicon = [[300.0, 0.1], [550.0, 0.8], [900.0, 0.2], [1100.0, 0.0]];
    let near = [[700.0, 0.3], [960.0, 0.6]];
    let body = json!({ "black_body": 3200 });
    for (light, range, curve, power) in [
        (&json!("equal_energy"), [300, 1100], &silicon[..], &(|_| 1.0) as &dyn Fn(f64) -> f64),
        (&json!("a"), [300, 1100], &silicon[..], &illuminant_a),
        (&body, [300, 1100], &silicon[..], &black_body(3200.0)),
        (&json!("equal_energy"), [700, 960], &near[..], &|_| 1.0),
        (&body, [700, 960], &near[..], &black_body(3200.0)),
    ] {
        let bench = shining(light, &json!({ "quantum_efficiency": curve }));
        let expected = electrons(range, power, |nm| polygon(curve, nm));
        assert_counts(counted(&bench)[0], expected, &format!("{light} {curve:?}"));
        // What nobody knows of colours out there is said, once.
        let said = text(&bench.run(&["render", "scene.json", "-o", "out"]).stderr);
        assert_eq!(said.matches("colours are known from 380 to 780 nm").count(), 1, "{said}");
    }
    // Daylight is known up to 830 nm: nothing of it is seen here, and what would do is named.
    let bench = shining(&json!("d65"), &json!({ "quantum_efficiency": [[900, 0.3], [1000, 0.3]] }));
    insta::assert_snapshot!(bench.refusal(&["render", "scene.json", "-o", "out"]), @r#"
    error: scene.json: a light's spectrum: the curve covers 300..=830 nm, the spectral bands 900..=1000 nm: they do not overlap
    hint: give the light `equal_energy`, `a` or {"black_body": kelvin}, which reach further, or a curve or cube that does, or the sensor a quantum_efficiency or bands that see it
    "#);
}

#[test]
fn the_plan_tells_how_many_bands_there_are_and_how_good_they_are() {
    let plan = |illuminant: &Value, keys: &Value| {
        let bench = shining(illuminant, keys);
        text(&bench.run(&["plan", "scene.json"]).stdout)
    };
    let silicon = json!({ "quantum_efficiency": [[400, 0.4], [530, 0.8], [1000, 0.1]] });
    let table = plan(&json!("a"), &silicon);
    let line = table.lines().find(|line| line.starts_with("wavelengths")).expect("a line");
    assert!(
        line.contains("1 (400 to 1000 nm)") && line.contains("0.1 % of an integration by 1 nm"),
        "{line}"
    );
    // Nothing is coloured: one number is all that there is to tell.
    let even = plan(&json!("equal_energy"), &json!({}));
    assert!(
        even.lines().any(|line| line.starts_with("wavelengths") && line.contains(" 1 ")),
        "{even}"
    );
}

/// Pearson's correlation.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let (ma, mb) = (mean(a), mean(b));
    let sum = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
        a.iter().zip(b).map(|(x, y)| f(x - ma, y - mb)).sum()
    };
    sum(&|x, y| x * y) / (sum(&|x, _| x * x) * sum(&|_, y| y * y)).sqrt()
}

#[test]
fn cameras_of_one_seed_draw_noise_of_their_own() {
    let frame = |keys: &Value, from: f64| {
        let mut sensor = json!({
            "type": "raw", "resolution": [128, 128], "system_gain": 1, "bit_depth": 12,
            "read_noise": 5, "black_level": 100
        });
        for (key, value) in keys.as_object().expect("an object") {
            sensor[key] = value.clone();
        }
        let scene = json!({
            "etendue": 1,
            "camera": {
                "type": "orthographic", "height": 1, "sensor": sensor,
                "pose": { "from": [from, 0, 2], "look_at": [from, 0, 0] }
            },
            "tracer": { "type": "flat" },
            "objects": [{ "shape": "rectangle", "width": 9, "height": 9, "material": "paint" }],
            "materials": { "paint": { "type": "matte", "color": [0.3, 0.3, 0.3] } }
        });
        let bench = Bench::with_scene(&scene.to_string());
        bench.render(&[]);
        bench.array("raw")
    };
    let one = frame(&json!({ "serial": 1 }), 0.0);
    assert_eq!(one, frame(&json!({ "serial": 1 }), 0.0), "the same twice");
    // 16384 pixels: a correlation by chance is 0.0078; five of these.
    let apart = |other: &[f64], what: &str| {
        let found = correlation(&one, other);
        assert!(found.abs() < 0.04, "{what}: {found}");
    };
    apart(&frame(&json!({ "serial": 2 }), 0.0), "another serial number");
    apart(&frame(&json!({ "serial": 1 }), 0.5), "another place of the camera");
    // The pattern belongs to the sensor alone: two cameras of one serial number share it.
    let keys = json!({ "serial": 1, "dsnu": 100 });
    let found = correlation(&frame(&keys, 0.0), &frame(&keys, 0.5));
    // Of the variance, 100² of 100² + 5² + 1200 e⁻ is the pattern's: 0.89.
    assert!((found - 0.891).abs() < 0.02, "{found}");
    let other = json!({ "serial": 2, "dsnu": 100 });
    assert!(correlation(&frame(&keys, 0.0), &frame(&other, 0.0)).abs() < 0.04);
}

#[test]
fn what_saturates_is_white_and_says_which_key_mends_it() {
    // Full wells come first: 500 e⁻ are 265 DN of 4095.
    let keys = json!({
        "type": "rgb", "full_well": 500, "black_level": 15, "bit_depth": 12, "noise": "poisson",
        "read_noise": 2, "quantum_efficiency": [[380, 0.9], [780, 0.3]]
    });
    let bench = shining(&json!("equal_energy"), &keys);
    let output = bench.run(&["render", "scene.json", "-o", "out"]);
    let said = text(&output.stderr);
    assert!(output.status.success(), "{said}");
    for word in ["every pixel is saturated", "265 DN", "the sensor's `exposure`"] {
        assert!(said.contains(word), "{word} in {said}");
    }
    assert_eq!(bench.json("out/sensor.json")["saturation_level_dn"], 265.0);
    let file = std::fs::File::open(bench.path("out/raw.preview.png")).expect("a preview");
    let mut reader = png::Decoder::new(std::io::BufReader::new(file)).read_info().expect("a PNG");
    let mut bytes = vec![0; reader.output_buffer_size().expect("a size")];
    reader.next_frame(&mut bytes).expect("pixels");
    // Read noise of 2 e⁻ of 500 leaves pixels a hair below white in some channel.
    assert!(bytes.iter().all(|&byte| byte >= 252), "{bytes:?}");
    let dim = json!({ "exposure": 1e-9, "noise": "poisson" });
    let said = text(&shining(&json!("a"), &dim).run(&["render", "scene.json", "-o", "o"]).stderr);
    assert!(
        said.contains("every pixel is black") && said.contains("the sensor's `exposure`"),
        "{said}"
    );
    // No exposure that a sensor refuses is recommended.
    for (radiance, says) in
        [("1e15", "no exposure is as short"), ("1e-20", "no exposure is as long")]
    {
        let light = format!("materials.lamp.radiance=[{radiance},{radiance},{radiance}]");
        let bench = shining(&json!("a"), &json!({ "noise": "poisson" }));
        let said = text(&bench.run(&["render", "scene.json", "-o", "o", "--set", &light]).stderr);
        assert!(said.contains(says), "{radiance}: {said}");
    }
    let fine = shining(&json!("a"), &json!({ "noise": "poisson" }));
    let said = text(&fine.run(&["render", "scene.json", "-o", "o"]).stderr);
    assert!(!said.contains("every pixel"), "{said}");
}

#[test]
fn moments_are_written_once_an_exposure_time() {
    let keys =
        json!({ "exposures": [0.001, 0.01], "frames": 40, "moments": true, "noise": "poisson" });
    let bench = shining(&json!("a"), &keys);
    bench.render(&["--samples", "1"]);
    let names: Vec<String> = std::fs::read_dir(bench.path("out"))
        .expect("a folder")
        .map(|entry| entry.expect("a file").file_name().into_string().expect("a name"))
        .collect();
    let of = |stem: &str| names.iter().filter(|name| name.starts_with(stem)).count();
    let counts = [of("raw_0"), of("raw_mean"), of("raw_variance")];
    assert_eq!(counts, [80 * 4, 2, 2], "{names:?}");
    let shots = bench.json("out/sensor.json")["shots"].clone();
    assert_eq!(
        (&shots[39]["mean"], &shots[40]["mean"]),
        (&json!("raw_mean_000.npy"), &json!("raw_mean_001.npy"))
    );
    // Of one exposure time there is one, without a number.
    let one = shining(&json!("a"), &json!({ "frames": 3, "moments": true, "noise": "poisson" }));
    one.render(&["--samples", "1"]);
    assert!(one.path("out/raw_mean.npy").exists() && !one.path("out/raw_mean_000.npy").exists());
}

#[test]
fn a_pattern_that_few_converters_read_is_told() {
    let wide = json!({ "cfa": ["rrgg", "rrgg", "ggbb", "ggbb"] });
    let said = |keys: &Value| {
        let bench = shining(&json!("a"), keys);
        text(&bench.run(&["render", "scene.json", "-o", "out"]).stderr)
    };
    let wide = said(&wide);
    assert!(wide.contains("pattern of 4 by 4 filters"), "{wide}");
    assert!(!said(&json!({ "cfa": "rggb" })).contains("pattern of"));
}

#[test]
fn wells_are_filled_before_black_is_added() {
    // 100 e⁻ at 0.5 DN an electron stand on a black level of 200 DN: 250 at most.
    let keys = json!({ "full_well": 100, "black_level": 200 });
    assert_eq!(counted(&shining(&json!("a"), &keys))[0], 500.0);
}

/// `AsShotNeutral` of a little-endian DNG: tag 50728, three fractions of u32.
fn neutral(file: &[u8]) -> [f64; 3] {
    let short = |at: usize| usize::from(u16::from_le_bytes([file[at], file[at + 1]]));
    let long = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap());
    let start = long(4) as usize;
    let entries = (0..short(start)).map(|k| start + 2 + 12 * k);
    let entry = entries.into_iter().find(|&at| short(at) == 50_728).expect("a neutral");
    let values = long(entry + 8) as usize;
    [0, 1, 2].map(|k| f64::from(long(values + 8 * k)) / f64::from(long(values + 8 * k + 4)))
}

/// The white of a DNG is what the sensor makes of the scene's light, and not of equal energy.
#[test]
fn a_raw_file_says_what_white_is_in_the_light_of_the_scene() {
    let ends = [
        [[580.0, 0.0], [600.0, 1.0], [700.0, 1.0]],
        [[500.0, 0.0], [540.0, 1.0], [590.0, 0.0]],
        [[400.0, 0.0], [450.0, 0.9], [500.0, 0.0]],
    ];
    let keys = json!({ "cfa": "rggb", "filters": { "r": ends[0], "g": ends[1], "b": ends[2] } });
    for (illuminant, light) in [
        (json!("a"), &illuminant_a as &dyn Fn(f64) -> f64),
        (json!("equal_energy"), &|_: f64| 1.0),
        (json!({ "black_body": 9000 }), &black_body(9000.0)),
    ] {
        let bench = shining(&illuminant, &keys);
        bench.render(&["--samples", "1"]);
        let seen = ends.map(|filter| electrons([380, 780], light, |nm| polygon(&filter, nm)));
        let most = seen.into_iter().fold(0.0, f64::max);
        let file = std::fs::read(bench.path("out/raw.dng")).unwrap();
        for (found, known) in neutral(&file).into_iter().zip(seen.map(|seen| seen / most)) {
            // What bands are to lose at most, and the four digits of the file.
            assert!((found - known).abs() < 1e-3 + 1e-4, "{illuminant}: {found}, not {known}");
        }
    }
}
