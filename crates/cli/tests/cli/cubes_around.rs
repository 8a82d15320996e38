//! Light by wavelength from all around: cubes as the image of an environment.

use std::f64::consts::PI;

use etendue_spectrum::rgb;
use serde_json::{Value, json};

use crate::cubes::{BANDS, EVEN, TEXELS, envi, exr, planes, seen};
use crate::expose::npy;
use crate::run::{Bench, under};

/// A floor seen from above by a sensor of bands between `edges` (nm), or by an RGB picture, under these lights.
fn floor(edges: Option<&[f64]>, lights: Value, samples: u32) -> Value {
    let mut scene = json!({
        "etendue": 1,
        "camera": {
            "type": "orthographic", "height": 0.1,
            "pose": { "from": [0, 2, 0], "look_at": [0, 0, 0], "up": [0, 0, -1] },
            "sensor": { "resolution": [4, 4] }
        },
        "tracer": { "type": "direct" }, "render": { "samples": samples },
        "objects": [{ "shape": "rectangle", "width": 9, "height": 9, "material": "a",
                      "transform": { "rotate": [1, 0, 0, -90] } }],
        "materials": { "a": { "type": "matte", "color": [0.5, 0.5, 0.5] } },
        "lights": lights
    });
    if let Some(edges) = edges {
        scene["camera"]["sensor"]["type"] = json!("multispectral");
        scene["camera"]["sensor"]["bands"] = json!(edges);
    }
    scene
}

/// The mean over all pixels of each of `count` bands.
fn means(light: &[f64], count: usize) -> Vec<f64> {
    let pixels = (light.len() / count) as f64;
    (0..count).map(|i| light.iter().skip(i).step_by(count).sum::<f64>() / pixels).collect()
}

/// Edges of `count` bands of some width (nm).
fn edges(from: f64, width: f64, count: u32) -> Vec<f64> {
    (0..=count).map(|i| from + width * f64::from(i)).collect()
}

/// The means over bands of straight lines between the middles of the same bands; the ends are held.
fn in_own_bands(values: &[f32]) -> Vec<f64> {
    let at = |i: usize| f64::from(values[i.min(values.len() - 1)]);
    (0..values.len())
        .map(|i| 0.75 * at(i) + 0.125 * (at(i.saturating_sub(1)) + at(i + 1)))
        .collect()
}

#[test]
#[expect(clippy::cast_possible_truncation, reason = "files of f32")]
fn a_cube_of_one_curve_lights_a_floor_by_that_curve_in_every_band() {
    let bench = Bench::new();
    // A line, a dip to nothing and a slope.
    let values: Vec<f32> = (0..31)
        .map(|i| match i {
            7 => 40.0,
            15..=17 => 0.0,
            i => 1.0 + f64::from(i) as f32 * 0.1,
        })
        .collect();
    bench.write("sky.npy", &npy(&[4, 8, 31], &values.repeat(32)));
    // In visible light, and where no colour tells how bright a direction is.
    for start in [400.0, 900.0] {
        let edges = edges(start, 10.0, 31);
        let sky = json!([{ "type": "environment", "image": { "cube": "sky.npy", "bands": edges },
                           "radiance": [2, 2, 2] }]);
        let light = means(&seen(&bench, &floor(Some(&edges), sky, 256)), 31);
        let expected = in_own_bands(&values);
        let all = light.iter().sum::<f64>() / expected.iter().sum::<f64>();
        for (i, (found, expected)) in light.iter().zip(&expected).enumerate() {
            // All bands have the same paths: f32, of the texels and of the film.
            assert!((found - all * expected).abs() <= 1e-5 * all * expected, "{i}: {found}");
        }
        // A floor of reflectance ½ under a radiance of 2 shows 1. 4096 samples, by place on the sphere and by the
        // cosine, spread by less than their mean: four standard deviations.
        println!("from {start} nm: {all}");
        assert!((all - 1.0).abs() < 4.0 / 64.0, "{all}");
    }
}

/// Irradiance of a patch of 2 by 2 texels, each of a spectrum of its own, as the sum over them of radiance, cosine and
/// solid angle.
#[test]
#[expect(clippy::cast_possible_truncation, reason = "files of f32")]
fn a_small_bright_patch_lights_as_the_sum_over_its_texels() {
    let bench = Bench::new();
    let [columns, rows] = [256_usize, 128];
    let patch = [(40, 30), (41, 30), (40, 31), (41, 31)];
    let spectra =
        [[3.0, 1.0, 0.5, 2.0], [2.0, 2.0, 2.0, 2.0], [1.0, 3.0, 2.0, 0.5], [2.0, 1.0, 4.0, 1.0]];
    let mut values = vec![0.0f32; columns * rows * 4];
    for ((x, y), spectrum) in patch.into_iter().zip(spectra) {
        values[(y * columns + x) * 4..][..4]
            .copy_from_slice(&spectrum.map(|v: f64| (1e3 * v) as f32));
    }
    bench.write("sky.npy", &npy(&[rows, columns, 4], &values));
    for start in [400.0, 900.0] {
        let edges = edges(start, 100.0, 4);
        let sky =
            json!([{ "type": "environment", "image": { "cube": "sky.npy", "bands": edges } }]);
        let light = means(&seen(&bench, &floor(Some(&edges), sky, 256)), 4);
        let mut expected = [0.0; 4];
        for ((_, y), spectrum) in patch.into_iter().zip(spectra) {
            let theta = PI * (y as f64 + 0.5) / rows as f64;
            let solid_angle = 2.0 * PI / columns as f64 * PI / rows as f64 * theta.sin();
            let own = in_own_bands(&spectrum.map(|v| (1e3 * v) as f32));
            for (sum, radiance) in expected.iter_mut().zip(own) {
                *sum += radiance * theta.cos() * solid_angle;
            }
        }
        println!("from {start} nm: {light:?} {expected:?}");
        for (found, irradiance) in light.iter().zip(expected) {
            let ratio = found / (0.5 * irradiance / PI);
            // Directions are chosen by the mean over bands, from which each band is off by up to half and so spreads
            // by some 0.4 of its mean: 4096 samples leave 0.6 %, and this is four of it. Texels that are joined by
            // straight lines over 1.4 degrees are off by 1e-4 besides. Of directions by chance one in 2600 meets the
            // patch: the mean would be off by 80 %.
            assert!((ratio - 1.0).abs() < 0.025, "{ratio}");
        }
    }
}

/// An RGB image of six texels, and a cube of the curves that its colours become: the same in bands, seen and as light,
/// and in a picture of colours.
#[test]
#[expect(clippy::cast_possible_truncation, reason = "files of f32")]
fn a_cube_of_an_image_s_curves_is_that_image() {
    let bench = Bench::new();
    let colors: [[f64; 3]; 6] = [
        [1.0, 0.2, 0.1],
        [0.1, 0.8, 0.3],
        [0.2, 0.1, 2.0],
        [0.5, 0.5, 0.5],
        [3.0, 2.0, 0.1],
        [0.0, 0.4, 0.9],
    ];
    let plane = |k: usize| colors.map(|color| color[k] as f32).to_vec();
    exr(&bench, "sky.exr", &[("R", plane(0)), ("G", plane(1)), ("B", plane(2))]);
    // 5 nm, over all visible light.
    let own = edges(357.5, 5.0, 95);
    let texels = colors.map(|color| {
        let curve = rgb::spectrum(color);
        own.windows(2).map(|edge| curve.held(0.5 * (edge[0] + edge[1])) as f32).collect::<Vec<_>>()
    });
    bench.write("sky.npy", &npy(&[1, 6, 95], &texels.concat()));
    let around = |image: Value| json!([{ "type": "environment", "image": image, "rotate": 40 }]);
    let cube = || json!({ "cube": "sky.npy", "bands": own });
    let bands = edges(400.0, 10.0, 31);
    for edges in [Some(bands.as_slice()), None] {
        let light = |image: Value, outwards: bool| {
            let mut scene = floor(edges, around(image), 64);
            if outwards {
                scene["camera"]["type"] = json!("pinhole");
                scene["camera"]["fov"] = json!(100);
                scene["camera"].as_object_mut().unwrap().remove("height");
                scene["camera"]["pose"] = json!({ "from": [0, 1, 0], "look_at": [1, 1.5, 0.4] });
            }
            match edges {
                Some(_) => seen(&bench, &scene),
                None => {
                    bench.write("scene.json", scene.to_string().as_bytes());
                    bench.render(&["--outputs", "npy"]);
                    bench.array("picture")
                }
            }
        };
        // Seen itself: curves of 5 nm steps for smooth ones, in bands of 10 nm; as colours, of which those outside
        // of sRGB by a little are clipped.
        let count = edges.map_or(3, |edges| edges.len() - 1);
        let seen = [json!("sky.exr"), cube()].map(|image| light(image, true));
        let greatest = seen[0].iter().copied().fold(0.0, f64::max);
        let worst = seen[0].iter().zip(&seen[1]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        println!("{count} bands: {worst} of {greatest}");
        assert!(greatest > 1.0 && worst < 2e-3 * greatest, "{worst} of {greatest}");
        // As light: both are 1024 samples of directions, by the mean over three colours or over bands.
        let lit = [json!("sky.exr"), cube()].map(|image| means(&light(image, false), count));
        for (image, cube) in lit[0].iter().zip(&lit[1]) {
            assert!((cube / image - 1.0).abs() < 0.1, "{lit:?}");
        }
    }
}

#[test]
fn cubes_of_all_forms_are_one_sky() {
    let bench = Bench::new();
    bench.write("a.npy", &npy(&[1, 2, 4], TEXELS.as_flattened()));
    envi(&bench, "a", EVEN, TEXELS);
    exr(&bench, "a.exr", &planes(["S0.450,0nm", "S0.550,0nm", "S0.650,0nm", "S0.750,0nm"]));
    let of = |image: Value| {
        let sky = json!([{ "type": "environment", "image": image }]);
        seen(&bench, &floor(Some(&[350.0, 400.0, 500.0, 600.0, 700.0, 800.0, 900.0]), sky, 16))
    };
    let array = of(json!({ "cube": "a.npy", "bands": BANDS }));
    // Dark beyond the outer edges of its bands.
    let light = means(&array, 6);
    assert!(
        light[0] == 0.0 && light[5] == 0.0 && light[1..5].iter().all(|v| *v > 0.0),
        "{light:?}"
    );
    for name in ["a.hdr", "a.img", "a.exr"] {
        assert_eq!(of(json!({ "cube": name })), array, "{name}");
    }
}

#[test]
fn what_is_no_cube_of_light_is_refused_with_its_place() {
    let bench = Bench::new();
    bench.write("a.npy", &npy(&[1, 2, 4], TEXELS.as_flattened()));
    envi(&bench, "good", EVEN, TEXELS);
    envi(&bench, "share", &format!("{EVEN}reflectance scale factor = 1\n"), TEXELS);
    envi(&bench, "below", EVEN, [TEXELS[0], [0.5, -0.5, 0.5, 0.5]]);
    exr(&bench, "share.exr", &planes(["T.450,0nm", "T.550,0nm", "T.650,0nm", "T.750,0nm"]));
    let good = json!({ "cube": "good.hdr" });
    let skies = [
        json!({ "image": { "cube": "a.npy" } }),
        json!({ "image": { "cube": "a.npy", "bands": [400, 500, 600] } }),
        json!({ "image": { "cube": "good.hdr", "bands": BANDS } }),
        json!({ "image": { "cube": "share.hdr" } }),
        json!({ "image": { "cube": "share.exr" } }),
        json!({ "image": { "cube": "below.hdr" } }),
        json!({ "image": { "cube": "none.hdr" } }),
        json!({ "image": { "cube": "good.hdr", "wrap": "repeat" } }),
        json!({ "image": good, "illuminant": "d65" }),
        json!({ "image": good, "radiance": { "illuminant": "d65" } }),
    ];
    let refused = |edges: &[f64], sky: &Value| {
        let mut light = json!({ "type": "environment" });
        light.as_object_mut().unwrap().extend(sky.as_object().unwrap().clone());
        bench.write("scene.json", floor(Some(edges), json!([light]), 1).to_string().as_bytes());
        let message = bench.refusal(&["render", "scene.json", "-o", "out"]);
        assert!(!bench.path("out").exists(), "{sky}: something was left behind");
        message
    };
    let messages = skies.map(|sky| under(&sky.to_string(), &refused(&BANDS, &sky)));
    insta::assert_snapshot!(messages.concat());
    let beyond = [900.0, 950.0, 1000.0];
    insta::assert_snapshot!(refused(&beyond, &json!({ "image": good })), @r#"
    error: scene.json: a light's spectrum: the curve covers 400..=800 nm, the spectral bands 900..=1000 nm: they do not overlap
    hint: give the light `equal_energy`, `a` or {"black_body": kelvin}, which reach further, or a curve or cube that does, or the sensor a quantum_efficiency or bands that see it
    "#);
}
