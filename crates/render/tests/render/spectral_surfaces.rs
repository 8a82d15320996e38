//! Curves of what surfaces are made of beside their plain colour: layers of a glTF surface, images, files of metals, and
//! pairs of surfaces that one lamp alone tells apart.

use etendue_spectrum::colour::{FINE_OBSERVER, inverse};
use etendue_spectrum::{Curve, Illuminant, integral};
use serde_json::{Value, json};

use crate::curves::{counted, delta_e, lab, seen};
use crate::steps::load_json;

/// The means of [`ramp`] over the bands.
const MEANS: [f64; 4] = [0.25, 0.35, 0.45, 0.55];

fn ramp() -> Value {
    json!({ "curve": [[400, 0.2], [800, 0.6]] })
}

/// A wall that fills the picture, before a sensor of four bands, lit from aside.
fn wall(material: &Value) -> Value {
    json!({
        "etendue": 1,
        "camera": {
            "type": "orthographic", "height": 1, "pose": { "from": [0, 0, 2], "look_at": [0, 0, 0] },
            "sensor": { "type": "multispectral", "resolution": [4, 4], "bands": [400, 500, 600, 700, 800] }
        },
        "tracer": { "type": "direct" }, "render": { "samples": 1 },
        "objects": [{ "shape": "rectangle", "width": 3, "height": 3, "material": "a" }],
        "materials": { "a": material },
        "lights": [{ "type": "directional", "direction": [-1, 0, -2],
                     "irradiance": { "curve": [[300, 3], [900, 3]] } }]
    })
}

/// A curve acts in a band as a grey of its mean there does. A sheen leaves the coat below what the brightest of its
/// curve does not take (`KHR_materials_sheen`), and so all bands have the coat of the grey of its greatest value.
#[test]
fn sheen_and_highlights_have_their_curves_in_every_band() {
    let folder = tempfile::tempdir().unwrap();
    let light = |key: &str, color: Value| {
        let mut material = json!({ "type": "gltf", "color": [0, 0, 0], "roughness": 0.7 });
        material[key] = color;
        seen(&load_json(folder.path(), wall(&material)), &[5]).1[0].clone()
    };
    let highlight = light("specular_color", ramp());
    for (band, mean) in MEANS.into_iter().enumerate() {
        let grey = light("specular_color", json!([mean, mean, mean]))[band];
        // Films are f32.
        assert!(grey > 1e-3 && (highlight[band] / grey - 1.0).abs() < 1e-5, "{highlight:?} {grey}");
    }
    let sheen = light("sheen", ramp());
    let brightest = light("sheen", json!([0.6, 0.6, 0.6]))[0];
    let of_one = (sheen[3] - sheen[0]) / (MEANS[3] - MEANS[0]);
    assert!(of_one > 1e-3, "{sheen:?}");
    for (found, mean) in sheen.iter().zip(MEANS) {
        // Films are f32, of numbers near 0.03.
        assert!((brightest - found - (0.6 - mean) * of_one).abs() < 2e-8, "{sheen:?} {brightest}");
    }
}

#[test]
fn an_image_is_multiplied_by_the_curve_of_its_factor() {
    let folder = tempfile::tempdir().unwrap();
    image::RgbImage::from_pixel(2, 2, image::Rgb([188; 3]))
        .save(folder.path().join("grey.png"))
        .unwrap();
    let color = json!({ "image": "grey.png", "factor": ramp() });
    let of = |material: Value| seen(&load_json(folder.path(), wall(&material)), &[5]).1[0].clone();
    let matte = of(json!({ "type": "matte", "color": color }));
    let white = of(json!({ "type": "matte", "color": [1, 1, 1] }));
    // sRGB's curve (IEC 61966-2-1).
    let grey = ((188.0f64 / 255.0 + 0.055) / 1.055).powf(2.4);
    for ((found, white), mean) in matte.iter().zip(&white).zip(MEANS) {
        // Films are f32.
        assert!((found / white - grey * mean).abs() < 1e-6, "{matte:?} of {white:?}");
    }
    let shining = of(json!({ "type": "emissive", "radiance": color }));
    for (found, mean) in shining.iter().zip(MEANS) {
        assert!((found - grey * mean).abs() < 1e-6, "{shining:?}");
    }
}

/// |n + ik − 1|² / |n + ik + 1|² of n = 1 and k = 2 is a half, of k = 0 nothing.
#[test]
fn a_metal_of_a_file_reflects_by_its_indices() {
    let folder = tempfile::tempdir().unwrap();
    let yml = "DATA:\n  - type: tabulated nk\n    data: |\n        0.3 1 2\n        0.6 1 2\n        0.600001 1 0\n        0.9 1 0\n";
    std::fs::write(folder.path().join("m.yml"), yml).unwrap();
    let mut scene = wall(&json!({ "type": "metal", "roughness": 0, "metal": { "file": "m.yml" } }));
    scene["tracer"] = json!({ "type": "path" });
    scene["lights"] =
        json!([{ "type": "environment", "radiance": { "curve": [[300, 2], [900, 2]] } }]);
    let (_, light) = seen(&load_json(folder.path(), scene), &[5]);
    for (found, expected) in light[0].iter().zip([1.0, 1.0, 0.0, 0.0]) {
        // Between the two tables a nanometre's thousandth is neither.
        assert!((found - expected).abs() < 1e-4, "{light:?}");
    }
}

/// Two reflectances of which daylight makes the same X, Y and Z: a grey, and that grey with humps which cancel.
#[test]
fn metamers_part_under_another_lamp() {
    let day = Illuminant::D65.curve().unwrap();
    let hump = |middle: f64| {
        let at = |nm: f64| [nm, (1.0 - (nm - middle).abs() / 40.0).max(0.0)];
        let samples = (38..=78).map(|k| at(10.0 * f64::from(k)));
        Curve::sampled(samples.collect()).unwrap()
    };
    let humps = [450.0, 530.0, 610.0, 650.0].map(hump);
    let seen_by = |k: usize, hump: &Curve| integral(&[hump, &day, &FINE_OBSERVER[k]], 380.0, 780.0);
    let matrix = std::array::from_fn(|k| std::array::from_fn(|i| seen_by(k, &humps[i])));
    let last: [f64; 3] = std::array::from_fn(|k| -seen_by(k, &humps[3]));
    let inverse = inverse(&matrix).unwrap();
    let weights: Vec<f64> =
        (0..3).map(|i| (0..3).map(|k| inverse[i][k] * last[k]).sum()).chain([1.0]).collect();
    let most = weights.iter().map(|weight: &f64| weight.abs()).fold(0.0, f64::max);
    let samples: Vec<[f64; 2]> = (38..=78)
        .map(|k| {
            let nm = 10.0 * f64::from(k);
            let sum: f64 = humps.iter().zip(&weights).map(|(h, w)| w * h.held(nm)).sum();
            [nm, 0.5 + 0.3 * sum / most]
        })
        .collect();
    let folder = tempfile::tempdir().unwrap();
    let under = |lamp: &str| {
        let mut scene = wall(&json!({ "type": "matte", "color": [1, 1, 1] }));
        scene["camera"]["sensor"] = json!({
            "type": "multispectral", "channels": "cie_1931", "resolution": [4, 4]
        });
        scene["lights"][0]["irradiance"] = json!({ "illuminant": lamp });
        scene["materials"]["grey"] =
            json!({ "type": "matte", "color": { "curve": [[380, 0.5], [780, 0.5]] } });
        scene["materials"]["humps"] = json!({ "type": "matte", "color": { "curve": samples } });
        for (x, material) in [(-0.375, "grey"), (0.375, "humps")] {
            scene["objects"].as_array_mut().unwrap().push(json!({
                "shape": "rectangle", "width": 0.25, "height": 1, "material": material,
                "transform": { "translate": [x, 0, 0.1] }
            }));
        }
        let scene = load_json(folder.path(), scene);
        let (bands, light) = seen(&scene, &[4, 7, 5]);
        let [grey, humps, white] =
            [0, 1, 2].map(|k| <[f64; 3]>::try_from(counted(&scene, (&bands, &light[k]))).unwrap());
        delta_e(lab(grey, white), lab(humps, white))
    };
    let [day, tube] = ["d65", "fl11"].map(under);
    println!("{day} in daylight, {tube} under a fluorescent lamp");
    // What bands may lose of the electrons is some 0.1 of ΔE; a difference of 2 is seen at a glance.
    assert!(day < 0.2 && tube > 2.0, "{day} {tube}");
}
