//! Spectra, lumens and luminances of what shines, and the colours of a colorimeter's preview.

use std::f64::consts::PI;
use std::path::Path;

use etendue_spectrum::colour::{FINE_OBSERVER, srgb_encode, srgb_of_reflectance};
use etendue_spectrum::{Illuminant, colorchecker::PATCHES, rgb};
use serde_json::{Value, json};

use crate::cubes::seen;
use crate::run::{Bench, text, under};

/// A matte wall of reflectance ½ that fills the picture, before a sensor of bands between `edges` (nm).
fn wall(edges: &[f64], lights: Value) -> Value {
    json!({
        "etendue": 1,
        "camera": {
            "type": "orthographic", "height": 0.001, "pose": { "from": [0, 0, 2], "look_at": [0, 0, 0] },
            "sensor": { "type": "multispectral", "resolution": [4, 4], "bands": edges }
        },
        "tracer": { "type": "direct" }, "render": { "samples": 1 },
        "objects": [{ "shape": "rectangle", "width": 1, "height": 1, "material": "a" }],
        "materials": { "a": { "type": "matte", "color": [0.5, 0.5, 0.5] } },
        "lights": lights
    })
}

/// Bands of a nanometre over what the eye sees.
fn fine() -> Vec<f64> {
    (0..=470).map(|i| 360.0 + f64::from(i)).collect()
}

/// The luminance (cd/m²) of the first pixel of light in the bands of [`fine`]: 683.002 lm/W ∫ L V dλ.
fn luminance(light: &[f64]) -> f64 {
    let bands = light[..470].iter().zip(360..);
    let seen = |nm: i32| FINE_OBSERVER[1].mean(f64::from(nm), f64::from(nm + 1));
    683.002 * bands.map(|(light, nm)| light * seen(nm)).sum::<f64>()
}

const IES: &[u8] =
    b"IESNA:LM-63-2002\nTILT=NONE\n1 1000 1 2 1 1 2 0 0 0\n1 1 40\n0 180\n0\n100 100\n";

#[test]
fn lumens_are_the_flux_of_points_cones_and_measured_lamps() {
    let bench = Bench::new();
    bench.write("even.ies", IES);
    let spectra = [
        json!([1, 1, 1]),
        json!([1, 0.5, 0.2]),
        json!({ "illuminant": { "black_body": 2700 } }),
        json!({ "illuminant": "fl11", "scale": 1e-6 }),
        json!([{ "line": 532, "width": 2 }, { "line": 638, "width": 3, "scale": 2 }]),
        // Half of it is not seen.
        json!({ "curve": [[500, 1], [1200, 1]] }),
    ];
    let lamp = |spectrum: &Value, mut keys: Value| {
        keys["intensity"] = spectrum.clone();
        keys["lumens"] = json!(800);
        keys["at"] = json!([0, 0, 1]);
        keys
    };
    // glTF's fall-off over the cosine, in steps of a millionth.
    let cone = |inner: f64, outer: f64| {
        let [inner, outer] = [inner, outer].map(|degrees: f64| degrees.to_radians().cos());
        let falloff = |c: f64| ((c - outer) / (inner - outer)).clamp(0.0, 1.0).powi(2);
        let steps = 1_000_000;
        let each = (1.0 - outer) / f64::from(steps);
        let sum: f64 = (0..steps).map(|k| falloff(outer + each * (f64::from(k) + 0.5))).sum();
        2.0 * PI * sum * each
    };
    let forms = [
        (json!({ "type": "point" }), 4.0 * PI),
        (json!({ "type": "goniometric", "file": "even.ies" }), 4.0 * PI),
        (
            json!({ "type": "spot", "look_at": [0, 0, 0], "cone": 60, "inner_cone": 20 }),
            cone(20.0, 60.0),
        ),
        (json!({ "type": "spot", "look_at": [0, 0, 0], "cone": 40 }), cone(0.0, 40.0)),
    ];
    for spectrum in &spectra {
        for (form, spread) in &forms {
            let scene = wall(&fine(), json!([lamp(spectrum, form.clone())]));
            let found = luminance(&seen(&bench, &scene));
            // A metre away: lm/sr are lux, of which a wall of ½ sends back 1/(2π) a steradian.
            let expected = 800.0 / spread * 0.5 / PI;
            // Means over bands of a nanometre beside products, a wall of a millimetre at a metre, and films of f32.
            assert!((found / expected - 1.0).abs() < 1e-4, "{spectrum} {form}: {found} {expected}");
        }
    }
    // As they are with an illuminant beside the colour.
    let mut beside = lamp(&json!([2, 2, 2]), json!({ "type": "point", "illuminant": "a" }));
    let found = luminance(&seen(&bench, &wall(&fine(), json!([beside]))));
    assert!((found / (800.0 / (8.0 * PI * PI)) - 1.0).abs() < 1e-4, "{found}");
    beside["lumens"] = json!(-1);
    let lights = [
        lamp(&json!({ "line": 940 }), json!({ "type": "point" })),
        beside,
        json!({ "type": "directional", "direction": [0, 0, -1], "irradiance": [1, 1, 1], "lumens": 5 }),
    ];
    let messages = lights.map(|light| {
        bench.write("scene.json", wall(&fine(), json!([light])).to_string().as_bytes());
        let message = bench.refusal(&["render", "scene.json", "-o", "none"]);
        assert!(!bench.path("none").exists());
        under(&light.to_string(), &message)
    });
    insta::assert_snapshot!(messages.concat());
}

/// Under so many lux, a matte wall of reflectance ½ has the luminance E/(2π), whatever the spectrum and the angle.
#[test]
fn lux_are_the_illuminance_of_parallel_light() {
    let bench = Bench::new();
    for spectrum in
        [json!([1, 1, 1]), json!([0.2, 0.5, 1]), json!({ "illuminant": "fl11", "scale": 1e-6 })]
    {
        for (direction, cosine) in [([0.0, 0.0, -1.0], 1.0), ([0.0, -1.0, -1.0], 0.5_f64.sqrt())] {
            let sun = json!({
                "type": "directional", "direction": direction, "irradiance": spectrum, "lux": 10_000,
            });
            let found = luminance(&seen(&bench, &wall(&fine(), json!([sun]))));
            let expected = 10_000.0 * cosine * 0.5 / PI;
            // Light in f32, in bands of a nanometre.
            assert!(
                (found / expected - 1.0).abs() < 1e-4,
                "{spectrum} {direction:?}: {found} {expected}"
            );
        }
    }
    let dark = json!([{
        "type": "directional", "direction": [0, 0, -1], "irradiance": { "line": 940 }, "lux": 5,
    }]);
    bench.write("scene.json", wall(&fine(), dark).to_string().as_bytes());
    insta::assert_snapshot!(bench.refusal(&["render", "scene.json", "-o", "none"]), @"error: scene.json, line 1, column 3051: lights[0].lux: is wanted of light that the eye does not see: give its spectrum visible light, or its power itself");
}

#[test]
fn a_luminance_is_that_of_a_surface() {
    let bench = Bench::new();
    let shining = |material: Value| {
        let mut scene = wall(&fine(), json!([]));
        scene["materials"]["a"] = material;
        scene["materials"]["a"]["type"] = json!("emissive");
        scene
    };
    for material in [
        json!({ "radiance": [1, 1, 1], "luminance": 250 }),
        json!({ "radiance": [1, 0.2, 0.1], "luminance": 250, "illuminant": "led_b3" }),
        json!({ "radiance": { "illuminant": "fl11", "scale": 7 }, "luminance": 250 }),
    ] {
        let found = luminance(&seen(&bench, &shining(material.clone())));
        // Products of means over a nanometre, and films of f32.
        assert!((found / 250.0 - 1.0).abs() < 1e-4, "{material}: {found}");
    }
    let refused = |material: Value| {
        bench.write("scene.json", shining(material).to_string().as_bytes());
        bench.refusal(&["render", "scene.json", "-o", "none"])
    };
    let checker = json!({ "checker": [[1, 1, 1], [0, 0, 0]] });
    insta::assert_snapshot!(refused(json!({ "radiance": checker, "luminance": 250 })), @"error: scene.json, line 1, column 3023: materials.a.luminance: is of one spectrum, a colour's, a curve's or that of an image's factor, and `radiance` is a checker or a cube: give those their radiance themselves");
    let line = json!({ "line": 940 });
    insta::assert_snapshot!(refused(json!({ "radiance": line, "luminance": 250 })), @"error: scene.json, line 1, column 3023: materials.a.luminance: is wanted of light that the eye does not see: give its spectrum visible light, or its power itself");
}

/// Two squares of a lamp: seen, each has its own spectrum, dark beyond its ends; as light they are the mean of both, in
/// bands that nobody sees, too.
#[test]
fn squares_of_a_lamp_have_spectra_of_their_own() {
    let bench = Bench::new();
    let edges = [400.0, 500.0, 600.0, 700.0, 800.0];
    let curve = json!({ "curve": [[450, 1], [750, 4]] });
    // By hand: 450 to 500 of the first band, and 700 to 750 of the last.
    let of_curve = [0.5 * 1.25, 2.0, 3.0, 0.5 * 3.75];
    let color = [0.9, 0.5, 0.1];
    let of_color: Vec<f64> =
        edges.windows(2).map(|edge| rgb::spectrum(color).mean(edge[0], edge[1])).collect();
    let checker = |second: Value| json!({ "checker": [curve, second], "squares": 2 });
    let lamp = |radiance: Value, illuminant: Value| {
        let mut scene = wall(&edges, json!([]));
        scene["camera"]["height"] = json!(1);
        scene["materials"]["a"] = json!({ "type": "emissive", "radiance": radiance });
        if !illuminant.is_null() {
            scene["materials"]["a"]["illuminant"] = illuminant;
        }
        scene
    };
    let light = seen(&bench, &lamp(checker(json!(color)), Value::Null));
    // A pixel sees both squares, mixed alike in every band; by how much, the third tells, where they differ most.
    let mut shares = Vec::new();
    for found in light.chunks(4) {
        let share = (found[2] - of_color[2]) / (of_curve[2] - of_color[2]);
        for band in 0..4 {
            let known = share * of_curve[band] + (1.0 - share) * of_color[band];
            // Films of f32, and a share that is told to as much.
            assert!((found[band] - known).abs() < 1e-5, "{band}: {found:?} {known}");
        }
        shares.push(share);
    }
    shares.sort_by(f64::total_cmp);
    let [least, most] = [shares[0], shares[15]];
    assert!((-1e-5..0.3).contains(&least) && (0.7..1.0 + 1e-5).contains(&most), "{shares:?}");
    // A floor below squares of one curve is lit as below that curve.
    for start in [400.0, 900.0] {
        let edges = [0.0, 100.0, 200.0].map(|nm| start + nm);
        let one = json!({ "curve": [[start, 1], [start + 200.0, 3]] });
        let under = |radiance: Value| {
            let mut scene = wall(&edges, json!([]));
            scene["materials"]["lamp"] = json!({ "type": "emissive", "radiance": radiance });
            scene["objects"].as_array_mut().unwrap().push(json!({
                "shape": "rectangle", "width": 1, "height": 1, "material": "lamp",
                "transform": { "rotate": [1, 0, 0, 90], "translate": [0, 0.9, 0.6] }
            }));
            scene["render"]["samples"] = json!(256);
            let light = seen(&bench, &scene);
            [0, 1].map(|i| light.iter().skip(i).step_by(2).sum::<f64>() / 16.0)
        };
        let whole = under(one.clone());
        let squares = under(json!({ "checker": [one, one], "squares": 3 }));
        for (squares, whole) in squares.iter().zip(whole) {
            // Each 4096 samples of one lamp, spread by about its mean.
            assert!(
                whole > 0.0 && (squares / whole - 1.0).abs() < 0.05,
                "{start}: {squares} {whole}"
            );
        }
    }
    let negative = checker(json!({ "curve": [[400, 1], [800, -1]] }));
    let thrown = wall(
        &edges,
        json!([{ "type": "projector", "intensity": [1, 1, 1], "at": [0, 0, 1],
                                       "look_at": [0, 0, 0], "image": checker(json!(color)) }]),
    );
    let messages = [
        ("an illuminant beside", lamp(checker(json!(color)), json!("d65"))),
        ("a negative square", lamp(negative, Value::Null)),
        ("thrown by a projector", thrown),
    ]
    .map(|(what, scene)| {
        bench.write("scene.json", scene.to_string().as_bytes());
        under(what, &bench.refusal(&["render", "scene.json", "-o", "none"]))
    });
    insta::assert_snapshot!(messages.concat());
}

/// That colours of three numbers are a guess under a line is said once, and not of curves.
#[test]
fn what_colours_cannot_know_under_a_line_is_said_once() {
    let bench = Bench::new();
    let edges = [500.0, 550.0, 600.0];
    let told = |color: Value, lamp: Value| {
        let light = json!([{ "type": "point", "at": [0, 0, 1], "intensity": lamp }]);
        let mut scene = wall(&edges, light);
        scene["materials"]["a"]["color"] = color;
        // Once more, as another material.
        scene["materials"]["b"] = scene["materials"]["a"].clone();
        scene["objects"]
            .as_array_mut()
            .unwrap()
            .push(json!({ "shape": "sphere", "radius": 0.001, "material": "b" }));
        seen(&bench, &scene);
        let notes = bench.json("report.json")["notes"].to_string();
        (notes.matches("what they reflect of it is a guess").count(), notes)
    };
    let line = || json!({ "line": 532, "width": 1 });
    let (count, notes) = told(json!([0.2, 0.5, 0.1]), line());
    assert_eq!(count, 1, "{notes}");
    insta::assert_snapshot!(notes, @r#"["picture: 100 % of what the camera sees is black: `--set render.exposure=auto`, or a number of stops, mends picture.png; EXR and NPY keep the radiance as it is","light near 532 nm is a line 1.5 nm wide, and colours of three numbers are known as smooth mixtures of red, green and blue: what they reflect of it is a guess; give those materials measured curves"]"#);
    for (color, lamp) in [
        (json!({ "curve": [[400, 0.2], [700, 0.5]] }), line()),
        (json!([0.2, 0.5, 0.1]), json!({ "illuminant": "d65" })),
        (json!([0.5, 0.5, 0.5]), line()),
    ] {
        let (count, notes) = told(color, lamp);
        assert_eq!(count, 0, "{notes}");
    }
}

/// The preview of a colorimeter's picture in daylight has sRGB's colours of the 24 patches.
#[test]
fn a_colorimeter_shows_a_chart_in_daylight_by_its_colours() {
    let bench = Bench::new();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let scene = root.join("scenes/color-checker-xyz.json");
    let size = ["--set", "camera.sensor.resolution=[96,64]", "--outputs", "png"];
    let scene = scene.to_string_lossy();
    let render = [&["render", &scene, "-o", "out", "-q"][..], &size].concat();
    let output = bench.run(&render);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let file = std::fs::File::open(bench.path("out/raw.preview.png")).expect("a preview");
    let mut reader = png::Decoder::new(std::io::BufReader::new(file)).read_info().expect("a PNG");
    let mut bytes = vec![0; reader.output_buffer_size().expect("a size")];
    reader.next_frame(&mut bytes).expect("pixels");
    let known: Vec<[f64; 3]> =
        PATCHES.iter().map(|patch| srgb_of_reflectance(patch, Illuminant::D65).unwrap()).collect();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "within the picture"
    )]
    let pixel = |k: usize| {
        let (x, y) = ((k % 6) as f64 - 2.5, (k / 6) as f64 - 1.5);
        let [column, row] = [96.0 * (0.5 + x / 6.3), 64.0 * (0.5 + y / 4.2)].map(|at| at as usize);
        &bytes[3 * (96 * row + column)..][..3]
    };
    // How bright the picture is, by the white patch, which is neither clipped nor dark.
    let shown = |exposure: f64, k: usize| known[k].map(|part| 255.0 * srgb_encode(exposure * part));
    let exposure = (1..2000).map(|k| f64::from(k) * 1e-3).min_by_key(|&exposure| {
        let off = shown(exposure, 18)[1] - f64::from(pixel(18)[1]);
        #[expect(clippy::cast_possible_truncation, reason = "to compare")]
        let off = (1e3 * off.abs()) as i64;
        off
    });
    let exposure = exposure.unwrap();
    for k in 0..24 {
        for (found, known) in pixel(k).iter().zip(shown(exposure, k)) {
            // A step of 8 bits, and bands that lose 2e-4; dark codes are steep.
            let off = (f64::from(*found) - known.clamp(0.0, 255.0)).abs();
            assert!(off < 1.6, "patch {k} at {exposure}: {:?} {:?}", pixel(k), shown(exposure, k));
        }
    }
}
