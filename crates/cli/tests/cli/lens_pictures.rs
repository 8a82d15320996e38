//! Pictures through lenses, with closed-form answers.

use serde_json::{Value, json};

use crate::run::{Bench, text, under};

/// A white wall at 3 m, and what is special about the camera in front of it.
fn wall(camera: &str, more: &str) -> Bench {
    Bench::with_scene(&format!(
        r#"{{"etendue": 1, "camera": {{{camera}, "pose": {{"from": [0, 0, 0], "look_at": [0, 0, -1]}}}},
            "objects": [{{"shape": "rectangle", "width": 200, "height": 200, "material": "white",
                          "transform": {{"translate": [0, 0, -3]}}}}],
            "materials": {{"white": {{"type": "matte", "color": [1, 1, 1]}}}}, {more}}}"#
    ))
}

#[test]
fn a_white_wall_falls_off_with_the_fourth_power_of_the_cosine() {
    let bench = wall(
        r#""type": "thin_lens", "focal_length": 50, "f_number": 32, "sensor_distance": 50,
           "sensor": {"resolution": [48, 32], "pixel_pitch": 750}"#,
        r#""tracer": {"type": "flat"}, "render": {"samples": 64}"#,
    );
    bench.render(&["--outputs", "npy", "--report", "report.json"]);
    let picture = bench.array("picture");
    let (mut errors, mut worst) = (0.0, 0.0_f64);
    for (i, pixel) in picture.chunks(3).enumerate() {
        let (x, y) = (0.75 * ((i % 48) as f64 - 23.5), 0.75 * ((i / 48) as f64 - 15.5));
        let expected = (1.0 + (x * x + y * y) / 2500.0).powi(-2);
        let error = pixel[1] / expected - 1.0;
        errors += error / (48.0 * 32.0);
        worst = worst.max(error.abs());
    }
    // A round pupil is sampled as it is: what is left is that f/32 and a pixel's width are no points,
    // 2e-4 over all pixels.
    assert!(worst < 0.08, "{worst}");
    assert!(errors.abs() < 1.5e-3, "{errors}");
    let report = bench.json("report.json");
    assert_eq!(report["lens_rays"], 48 * 32 * 64);
    assert_eq!(report["lens_losses"], serde_json::json!([]), "no sample misses the pupil");
}

/// The integral over a disk of radius 25 at the distance 50, `offset` off its axis, of cosⁿθ dA/d², by cells.
fn over_the_disk(offset: f64, power: i32) -> f64 {
    let cells = 400;
    let step = 25.0 / f64::from(cells);
    let turn = std::f64::consts::TAU / f64::from(cells);
    let cell = |i: i32, k: i32| {
        let (radius, angle) = ((f64::from(i) + 0.5) * step, (f64::from(k) + 0.5) * turn);
        let (x, y) = (radius * angle.cos() - offset, radius * angle.sin());
        let cosine = (1.0 + (x * x + y * y) / 2500.0).powf(-0.5);
        cosine.powi(power) * radius * step * turn / 2500.0
    };
    (0..cells).map(|i| (0..cells).map(|k| cell(i, k)).sum::<f64>()).sum()
}

/// A wide pupil has the exponent that docs/explanation/paper.md gives for Eq. (1) of Nürnberg et
/// al. 2019: behind a wide pupil the picture is ∫ L cosθ dΩ = ∫ L cos⁴θ dA/d², and neither cos⁴ of
/// the chief ray nor ∫ L cos⁴θ dΩ = ∫ L cos⁷θ dA/d².
#[test]
fn a_wide_pupil_gives_the_cosine_over_its_solid_angle() {
    let bench = wall(
        r#""type": "thin_lens", "focal_length": 50, "f_number": 1, "sensor_distance": 50,
           "sensor": {"resolution": [48, 32], "pixel_pitch": 750}"#,
        r#""tracer": {"type": "flat"}, "render": {"samples": 256}"#,
    );
    bench.render(&["--outputs", "npy"]);
    // A disk that shines evenly, seen from a plane that is parallel to it (Foote 1915; Walsh 1958).
    let irradiance = |squared: f64| {
        let [near, sum] = [-625.0, 625.0].map(|area| 2500.0 + squared + area);
        std::f64::consts::FRAC_PI_2 * (1.0 - near / (sum * sum - 2500.0 * squared).sqrt())
    };
    let pupil = bench.json("out/camera.json")["lens"]["pupil_solid_angle_sr"].as_f64().unwrap();
    assert!((pupil / irradiance(0.0) - 1.0).abs() < 1e-12, "{pupil}");
    let (mut cosine, mut chief, mut printed) = (0.0_f64, 0.0_f64, 0.0_f64);
    for (i, pixel) in bench.array("picture").chunks(3).enumerate() {
        let (x, y) = (0.75 * ((i % 48) as f64 - 23.5), 0.75 * ((i / 48) as f64 - 15.5));
        let squared = x * x + y * y;
        let light = pixel[1] * pupil;
        cosine = cosine.max((light / irradiance(squared) - 1.0).abs());
        chief = chief.max((pixel[1] * (1.0 + squared / 2500.0).powi(2) - 1.0).abs());
        // In a corner, where it differs most.
        if i == 0 {
            let offset = squared.sqrt();
            // The closed form is the integral over area of the fourth power; cells leave 1e-6 of it.
            assert!((over_the_disk(offset, 4) / irradiance(squared) - 1.0).abs() < 2e-6);
            printed = over_the_disk(offset, 7) / light;
        }
    }
    // 256 points of Sobol's over a pupil whose weights differ by a few percent: 2e-4 at worst.
    assert!(cosine < 1e-3, "{cosine}");
    // 0.110 in the corner by the closed form: cos⁴ of the chief ray is that of a small pupil.
    assert!((chief - 0.110).abs() < 2e-3, "{chief}");
    // 0.762 of it, by the integral over cells: the fourth power over solid angle counts cos³ twice.
    assert!((printed - 0.762).abs() < 2e-3, "{printed}");
    // Under an even sky, whose irradiance is π: the midpoint rule over polar angles, to 1e-6 of it.
    let sky = |power: i32| -> f64 {
        let step = std::f64::consts::FRAC_PI_2 / 4096.0;
        let rings = (0..4096).map(|ring| (f64::from(ring) + 0.5) * step);
        rings.map(|t| std::f64::consts::TAU * t.cos().powi(power) * t.sin() * step).sum()
    };
    assert!((sky(1) / std::f64::consts::PI - 1.0).abs() < 1e-6);
    assert!((sky(4) / (0.4 * std::f64::consts::PI) - 1.0).abs() < 1e-6);
}

#[test]
fn data_through_a_lens_are_those_of_the_chief_ray() {
    let bench = wall(
        r#""type": "lens", "lens": {"elements": [
             {"type": "surface", "radius": 22.01359, "thickness": 3.25896, "glass": "N-SK16", "semi_diameter": 7},
             {"type": "surface", "radius": -435.76044, "thickness": 6.00755, "semi_diameter": 6.25},
             {"type": "surface", "radius": -22.21328, "thickness": 0.99997, "glass": "F2", "semi_diameter": 4.05},
             {"type": "surface", "radius": 20.29192, "thickness": 4.75041, "semi_diameter": 3.8, "stop": true},
             {"type": "surface", "radius": 79.6836, "thickness": 2.95208, "glass": "N-SK16", "semi_diameter": 5.4},
             {"type": "surface", "radius": -18.39533, "semi_diameter": 6}]},
           "focus_distance": 3, "sensor": {"resolution": [24, 16], "pixel_pitch": 1000}"#,
        r#""layers": ["depth", "distance", "position", "coverage"]"#,
    );
    bench.render(&["--outputs", "npy"]);
    let [depth, distance, position] = ["depth", "distance", "position"].map(|l| bench.array(l));
    let camera = bench.json("out/camera.json");
    assert_eq!((&camera["projection"], &camera["distortion"]), (&"lens".into(), &().into()));
    let focal = camera["K"][0][0].as_f64().unwrap();
    for (i, point) in position.chunks(3).enumerate() {
        let (x, y) = ((i % 24) as f64 - 11.5, (i / 24) as f64 - 7.5);
        assert!((depth[i] - 3.0).abs() < 1e-12, "{i}: {}", depth[i]);
        // The chief ray passes the pupil's centre but for the pupil's aberration, under a millimetre.
        let straight = point.iter().map(|x| x * x).sum::<f64>().sqrt();
        assert!((distance[i] / straight - 1.0).abs() < 1e-3, "{i}");
        // The triplet's distortion is under 1 % here: K is near, and upright.
        let [u, v] = [point[0] / 3.0 * focal, -point[1] / 3.0 * focal];
        assert!((u - x).abs() < 0.01 * x.abs() + 1e-3, "{i}: {u} for {x}");
        assert!((v - y).abs() < 0.01 * y.abs() + 1e-3, "{i}: {v} for {y}");
    }
}

#[test]
fn the_plan_says_how_a_lens_that_disperses_is_looked_through() {
    let bench = wall(
        r#""type": "chromatic_real_lens", "front_radius": 50, "rear_radius": -50, "thickness": 6,
           "glass": "N-BK7", "f_number": 4, "fov": 20, "focus_distance": 2,
           "sensor": {"resolution": [64, 48]}"#,
        r#""tracer": {"type": "facing"}, "layers": ["depth"], "render": {"samples": 5}"#,
    );
    let plan = |more: &[&str]| text(&bench.run(&[&["plan", "scene.json"], more].concat()).stdout);
    let many = plan(&[]);
    assert!(many.contains("their own") && many.contains("exit pupil (f/4.00)"), "{many}");
    assert!(many.contains("drawn from 16 wavelengths") && !many.contains("is noise"), "{many}");
    let one = plan(&["--set", "render.samples=1"]);
    assert!(one.contains("1 sample a pixel is one ray") && one.contains("`--samples`"), "{one}");
}

/// A uniform radiance L, a thin lens of f-number N focused on it at the magnification m = f/(s − f):
/// on the axis E = π L sin²θ′ = π L/(1 + 4 N² (1 + m)²), as tan θ′ = 1/(2 N (1 + m)); and the mean of
/// a pixel is E·A·T·η/(hc) · ∫ λ dλ electrons.
#[test]
fn the_electrons_of_a_uniform_scene_are_those_of_the_camera_equation() {
    for (f_number, distance) in [(1.4, 0.3), (1.4, 2.0), (2.8, 0.15), (8.0, 1.0)] {
        let bench = Bench::with_scene(&format!(
            r#"{{"etendue": 1, "tracer": {{"type": "direct"}}, "lights": [],
                "camera": {{"type": "thin_lens", "focal_length": 50, "f_number": {f_number},
                    "focus_distance": {distance},
                    "pose": {{"from": [0, 0, 0], "look_at": [0, 0, -1]}},
                    "sensor": {{"type": "raw", "resolution": [4, 4], "pixel_pitch": 4,
                        "quantum_efficiency": 0.5, "system_gain": 1, "noise": "none",
                        "radiometry": "physical", "exposure": 0.02}}}},
                "objects": [{{"shape": "rectangle", "width": 9, "height": 9, "material": "glow",
                    "transform": {{"translate": [0, 0, -{distance}]}}}}],
                "materials": {{"glow": {{"type": "emissive", "radiance": [1e-3, 1e-3, 1e-3]}}}},
                "render": {{"samples": 1024}}}}"#
        ));
        bench.render(&["--outputs", "npy"]);
        let m = 0.05 / (distance - 0.05);
        let t = 2.0 * f_number * (1.0 + m);
        let irradiance = std::f64::consts::PI * 1e-3 / (1.0 + t * t);
        // A = (4 µm)², hc of the SI, ∫ λ dλ over 380 to 780 nm.
        let photons = 16e-12 * 0.02 / 1.986_445_857e-25 * 2.32e5 * 1e-9;
        let expected = 0.5 * irradiance * photons;
        let raw = bench.array("raw");
        let mean = raw.iter().sum::<f64>() / raw.len() as f64;
        // A few in a hundred of 16 384 samples are lost at the pupil's rim, which is worth √(0.03/16 384)
        // if random, and all numbers are rounded to an electron.
        let bound = 4.0 * 1.4e-3 * expected + 0.5;
        assert!((mean - expected).abs() < bound, "f/{f_number}, {distance} m: {mean} {expected}");
        assert!(expected > 500.0, "{expected} electrons are no test");
    }
}

#[test]
fn a_lens_that_passes_nothing_is_refused_with_what_blocks() {
    let thin = r#""type": "thin_lens", "focal_length": 50, "fov": 20"#;
    let lenses = [
        r#""aperture": {"shape": "circular", "radius": 0}"#,
        r#""f_number": 4, "elements": [{"type": "filter", "transmission": 0, "at": 3}]"#,
        r#""f_number": 4, "elements": [{"type": "aperture", "shape": "circular", "radius": 1,
            "at": 9, "decentre": [40, 0]}]"#,
    ];
    let messages = lenses.map(|elements| {
        let bench = wall(&format!("{thin}, {elements}"), r#""tracer": {"type": "flat"}"#);
        let message = bench.refusal(&["render", "scene.json", "-o", "out"]);
        assert!(!bench.path("out").exists(), "nothing is written");
        under(elements, &message)
    });
    insta::assert_snapshot!(messages.concat());
}

/// Mirrors and orders of diffraction dim a picture as a filter does, by what they reflect and by
/// their share of the light: by as much, out of the lens that loses none.
#[test]
fn mirrors_and_orders_dim_pictures_as_filters_do() {
    let mean = |elements: &Value| {
        let scene = json!({
            "etendue": 1,
            "camera": {
                "type": "lens", "lens": { "elements": elements },
                "sensor": { "resolution": [8, 6], "pixel_pitch": 100 },
            },
            "tracer": { "type": "direct" }, "render": { "samples": 16 },
            "objects": [{ "shape": "sphere", "radius": 0.01, "transform": { "translate": [0, 500, 0] } }],
            "lights": [{ "type": "environment", "radiance": [1, 1, 1] }],
        });
        let bench = Bench::with_scene(&scene.to_string());
        bench.render(&[]);
        let values = bench.array("picture");
        values.iter().sum::<f64>() / values.len() as f64
    };
    let mirror = |more: &Value| {
        let mut mirror = json!({
            "type": "mirror", "radius": -200, "conic": -1, "semi_diameter": 10, "stop": true, "thickness": -100,
        });
        for (key, value) in more.as_object().unwrap() {
            mirror[key] = value.clone();
        }
        mean(&json!([mirror]))
    };
    let bare = mirror(&json!({}));
    // The same rays: what differs is the rounding of f32.
    assert!((mirror(&json!({ "reflectance": 0.5 })) / bare - 0.5).abs() < 1e-6);
    // Fresnel's ((n − 1)/(n + 1))²; at 3 degrees it is the same to 10⁻⁴.
    assert!((mirror(&json!({ "coating": { "index": 1.5 } })) / bare / 0.04 - 1.0).abs() < 1e-3);
    let order = |number: i32, blaze: Option<f64>| {
        let pattern = json!({ "type": "radial", "radius": 10, "coefficients": [] });
        let mut phase = json!({ "pattern": pattern, "order": number });
        if let Some(nm) = blaze {
            phase["blaze_wavelength"] = json!(nm);
        }
        mean(&json!([
            { "type": "freeform", "semi_diameter": 10, "stop": true, "phase": phase },
            { "type": "thin_lens", "focal_length": 50, "semi_diameter": 30, "thickness": 50 },
        ]))
    };
    let all = order(1, None);
    // sinc²(550/λ − 1) of the bands' wavelengths is 0.9 and more in the mean; of the second order a tenth at most.
    let [first, second] = [1, 2].map(|number| order(number, Some(550.0)) / all);
    assert!(first > 0.85 && first < 1.0 && second > 0.0 && second < 0.15, "{first} {second}");
}
