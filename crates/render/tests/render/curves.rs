//! Measured curves as colours: what bands hold of them, and what sensors count.

use std::path::{Path, PathBuf};

use etendue_render::Plan;
use etendue_render::output::Outputs;
use etendue_scene::Scene;
use etendue_spectrum::colorchecker::PATCHES;
use etendue_spectrum::{Bands, Grid};
use serde_json::{Value, json};

use crate::steps::{channels, load_json, plans, rendered};

pub(crate) fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes")
}

/// The scene of the chart, as text.
pub(crate) fn chart() -> Value {
    let text = std::fs::read_to_string(scenes().join("color-checker.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// The pixel in the middle of each patch of a chart in a picture of this width and height.
#[expect(clippy::cast_possible_truncation, reason = "inside the picture")]
fn middles([width, height]: [usize; 2]) -> Vec<usize> {
    let at = |k: usize| {
        // 4.2 m high, patches a metre apart.
        let (x, y) = ((k % 6) as f64 - 2.5, 1.5 - (k / 6) as f64);
        let scale = height as f64 / 4.2;
        let place = |middle: usize, offset: f64| (middle as f64 * 0.5 + offset * scale) as usize;
        place(height, -y) * width + place(width, x)
    };
    (0..24).map(at).collect()
}

/// Singular values, greatest first: one-sided Jacobi (Golub and Van Loan, section 8.6.3).
fn singular_values(mut columns: Vec<Vec<f64>>) -> Vec<f64> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    for _ in 0..60 {
        for p in 0..columns.len() {
            for q in p + 1..columns.len() {
                let [a, b, c] = [
                    dot(&columns[p], &columns[p]),
                    dot(&columns[q], &columns[q]),
                    dot(&columns[p], &columns[q]),
                ];
                if c == 0.0 {
                    continue;
                }
                let zeta = (b - a) / (2.0 * c);
                let t = zeta.signum() / (zeta.abs() + (1.0 + zeta * zeta).sqrt());
                let cos = 1.0 / (1.0 + t * t).sqrt();
                let sin = cos * t;
                for i in 0..columns[p].len() {
                    let (x, y) = (columns[p][i], columns[q][i]);
                    (columns[p][i], columns[q][i]) = (cos * x - sin * y, sin * x + cos * y);
                }
            }
        }
    }
    let mut values: Vec<f64> = columns.iter().map(|c| dot(c, c).sqrt()).collect();
    values.sort_by(|a, b| b.total_cmp(a));
    values
}

#[test]
fn thirty_one_bands_hold_the_reflectances_of_all_patches() {
    let mut scene = chart();
    scene["lights"][0]["illuminant"] = json!("equal_energy");
    scene["camera"]["sensor"]["resolution"] = json!([96, 64]);
    let loaded = load_json(&scenes(), scene);
    for (bands, light) in seen_in_each_precision(&loaded, &middles([96, 64])) {
        assert_eq!(bands.count(), 31);
        let grid = Grid::equal(400.0, 700.0, 31).unwrap();
        let (mut sum, mut matrix) = (0.0, vec![Vec::new(); 24]);
        for ((patch, row), light) in PATCHES.iter().zip(&mut matrix).zip(light) {
            for (band, value) in grid.bands().zip(light) {
                // Irradiance π on a matte surface shows its reflectance.
                sum += (value - patch.mean(band.from, band.to)).powi(2);
                row.push(value);
            }
        }
        let rms = (sum / (24.0 * 31.0)).sqrt();
        assert!(rms < 1e-6, "f32 keeps seven digits: {rms}");
        let values = singular_values(matrix);
        let held = values.iter().filter(|&&value| value > 1e-3 * values[0]).count();
        assert_eq!(held, 14, "{values:?}");
    }
}

/// The bands and a picture's values in them, of pixels in each patch: `[patch][band]`.
pub(crate) fn seen(scene: &Scene, pixels: &[usize]) -> (Bands, Vec<Vec<f64>>) {
    seen_by(scene, Plan::new(scene, Outputs::from_list("exr").unwrap()), pixels)
}

/// The same with hits in each precision, f64 first.
fn seen_in_each_precision(scene: &Scene, pixels: &[usize]) -> Vec<(Bands, Vec<Vec<f64>>)> {
    plans(scene).into_iter().map(|plan| seen_by(scene, plan, pixels)).collect()
}

fn seen_by(scene: &Scene, plan: Plan, pixels: &[usize]) -> (Bands, Vec<Vec<f64>>) {
    let count = plan.bands.count();
    let done = rendered(scene, &plan);
    let of = |pixel: &usize| match &done.band_film {
        Some(film) => {
            film.values[pixel * count..(pixel + 1) * count].iter().map(|&v| f64::from(v)).collect()
        }
        None => channels(&done.picture, "").iter().map(|band| band[*pixel]).collect(),
    };
    (plan.bands, pixels.iter().map(of).collect())
}

/// Electrons of each channel of the scene's sensor where it sees light in bands.
pub(crate) fn counted(scene: &Scene, (bands, light): (&Bands, &[f64])) -> Vec<f64> {
    let sensor = scene.sensor.clone().unwrap().in_bands(bands.clone()).unwrap();
    let channel =
        |c: usize| sensor.electrons_per_unit(c).iter().zip(light).map(|(e, l)| e * l).sum();
    (0..sensor.channels().len()).map(channel).collect()
}

/// CIELAB of XYZ before a white (CIE 015:2018, section 8.2.1).
pub(crate) fn lab(xyz: [f64; 3], white: [f64; 3]) -> [f64; 3] {
    let f = |t: f64| match t > (6.0f64 / 29.0).powi(3) {
        true => t.cbrt(),
        false => t * (29.0f64 / 6.0).powi(2) / 3.0 + 4.0 / 29.0,
    };
    let [x, y, z] = std::array::from_fn(|k| f(xyz[k] / white[k]));
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// CIEDE2000 (Sharma, Wu and Dalal 2005).
pub(crate) fn delta_e([l1, a1, b1]: [f64; 3], [l2, a2, b2]: [f64; 3]) -> f64 {
    let c = 0.5 * (a1.hypot(b1) + a2.hypot(b2));
    let g = 0.5 * (1.0 - (c.powi(7) / (c.powi(7) + 25f64.powi(7))).sqrt());
    let (a1, a2) = ((1.0 + g) * a1, (1.0 + g) * a2);
    let (c1, c2) = (a1.hypot(b1), a2.hypot(b2));
    let hue = |a: f64, b: f64| b.atan2(a).to_degrees().rem_euclid(360.0);
    let (h1, h2) = (hue(a1, b1), hue(a2, b2));
    let turn = match h2 - h1 {
        _ if c1 * c2 == 0.0 => 0.0,
        d if d > 180.0 => d - 360.0,
        d if d < -180.0 => d + 360.0,
        d => d,
    };
    let (dl, dc) = (l2 - l1, c2 - c1);
    let dh = 2.0 * (c1 * c2).sqrt() * (0.5 * turn).to_radians().sin();
    let (l, c) = (0.5 * (l1 + l2), 0.5 * (c1 + c2));
    let h = match (h1 - h2).abs() {
        _ if c1 * c2 == 0.0 => h1 + h2,
        d if d <= 180.0 => 0.5 * (h1 + h2),
        _ if h1 + h2 < 360.0 => 0.5 * (h1 + h2 + 360.0),
        _ => 0.5 * (h1 + h2 - 360.0),
    };
    let cos = |degrees: f64| degrees.to_radians().cos();
    let t = 1.0 - 0.17 * cos(h - 30.0) + 0.24 * cos(2.0 * h) + 0.32 * cos(3.0 * h + 6.0)
        - 0.20 * cos(4.0 * h - 63.0);
    let s_l = 1.0 + 0.015 * (l - 50.0).powi(2) / (20.0 + (l - 50.0).powi(2)).sqrt();
    let (s_c, s_h) = (1.0 + 0.045 * c, 1.0 + 0.015 * c * t);
    let rotation = -2.0
        * (c.powi(7) / (c.powi(7) + 25f64.powi(7))).sqrt()
        * (60.0 * (-((h - 275.0) / 25.0).powi(2)).exp()).to_radians().sin();
    let (l, c, h) = (dl / s_l, dc / s_c, dh / s_h);
    (l * l + c * c + h * h + rotation * c * h).sqrt()
}

/// The light of the chart's scene in turn.
fn light(name: &str) -> Value {
    match name {
        "lasers" => json!([{ "line": 532, "width": 1 }, { "line": 638, "width": 1, "scale": 1.5 }]),
        "three_lasers" => json!([
            { "line": 460, "width": 1 }, { "line": 532, "width": 1 },
            { "line": 638, "width": 1, "scale": 1.5 }
        ]),
        name => json!({ "illuminant": name }),
    }
}

/// The chart as a colorimeter sees it, beside sums of 1 nm by numpy and colour-science (`curves.py`).
#[test]
fn patches_have_their_colours_under_every_lamp() {
    // Two pairs of Sharma's table: the formula is right.
    let near = |a: f64, b: f64| (a - b).abs() < 5e-5;
    assert!(near(delta_e([50.0, 2.6772, -79.7751], [50.0, 0.0, -82.7485]), 2.0425));
    assert!(near(delta_e([2.0776, 0.0795, -1.1350], [0.9033, -0.0636, -0.5514]), 0.9082));
    let text = include_str!("colorchecker_lab.csv");
    let rows: Vec<Vec<&str>> = text.lines().skip(2).map(|row| row.split(',').collect()).collect();
    for of_light in rows.chunks(24) {
        let name = of_light[0][0];
        let mut scene = chart();
        scene["lights"][0] = json!({
            "type": "directional", "direction": [0, 0, -1], "irradiance": light(name)
        });
        scene["camera"]["sensor"] =
            json!({ "type": "multispectral", "channels": "cie_1931", "resolution": [96, 64] });
        // White instead of the gap between the patches.
        scene["materials"]["white"] = json!({ "type": "matte", "color": [1, 1, 1] });
        let wall = json!({
            "shape": "rectangle", "width": 9, "height": 9, "material": "white",
            "transform": { "translate": [0, 0, -1] }
        });
        scene["objects"].as_array_mut().unwrap().push(wall);
        let scene = load_json(&scenes(), scene);
        // The corner of the picture is white.
        let pixels: Vec<usize> = middles([96, 64]).into_iter().chain([0]).collect();
        for (bands, light) in seen_in_each_precision(&scene, &pixels) {
            let xyz: Vec<[f64; 3]> = light
                .iter()
                .map(|light| counted(&scene, (&bands, light)).try_into().unwrap())
                .collect();
            let mut worst = 0.0f64;
            for (row, found) in of_light.iter().zip(&xyz) {
                let known: [f64; 3] = std::array::from_fn(|k| row[k + 2].parse().unwrap());
                worst = worst.max(delta_e(lab(*found, xyz[24]), known));
            }
            println!("{name}: {worst:.4} in {} bands", bands.count());
            assert!(worst <= 0.1, "{name}: {worst} in {} bands", bands.count());
        }
    }
}

/// Electrons behind narrow filters and under lines, beside sums of 0.01 nm by numpy (`curves.py`).
#[test]
fn electrons_of_lines_and_notches_are_counted() {
    let cases: Vec<Value> = serde_json::from_str(include_str!("electrons.json")).unwrap();
    assert_eq!(cases.len(), 8);
    for case in cases {
        let scene = load_json(
            &scenes(),
            json!({
                "etendue": 1,
                "camera": {
                    "type": "orthographic", "height": 0.5,
                    "pose": { "from": [0, 0, 2], "look_at": [0, 0, 0] },
                    "sensor": {
                        "type": "multispectral", "radiometry": "physical", "resolution": [4, 4],
                        "pixel_pitch": 5, "exposure": 0.01, "system_gain": 1, "noise": "none",
                        "quantum_efficiency": case["qe"],
                        "channels": [{ "name": "seen", "curve": case["filter"] }]
                    }
                },
                "tracer": { "type": "direct" },
                "objects": [
                    { "shape": "rectangle", "width": 9, "height": 9, "material": "patch" }
                ],
                "materials": {
                    "patch": {
                        "type": "matte",
                        "color": { "file": "spectra/colorchecker.csv", "column": case["patch"] }
                    }
                },
                "lights": [{
                    "type": "directional", "direction": [0, 0, -1], "irradiance": case["lamp"]
                }],
                "render": { "samples": 1 }
            }),
        );
        for (bands, light) in seen_in_each_precision(&scene, &[5]) {
            // Electrons a second.
            let found = 0.01 * counted(&scene, (&bands, &light[0]))[0];
            let off = found / case["electrons"].as_f64().unwrap() - 1.0;
            println!("{}: {off:.1e} in {} bands", case["name"], bands.count());
            assert!(off.abs() < 1e-3, "{}: {off} in {} bands", case["name"], bands.count());
        }
    }
}

/// An NPY file of little-endian f32.
pub(crate) fn npy(shape: [usize; 3], values: &[f32]) -> Vec<u8> {
    let [rows, columns, bands] = shape;
    let mut header = format!(
        "{{'descr': '<f4', 'fortran_order': False, 'shape': ({rows}, {columns}, {bands}), }}"
    );
    header.push_str(&" ".repeat((64 - (header.len() + 11) % 64) % 64));
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend(u16::try_from(header.len()).unwrap().to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
    bytes
}

/// A surface of two texels by wavelength, and squares of two curves: each has its own numbers in every band.
#[test]
fn cubes_and_checkers_of_curves_are_seen_band_by_band() {
    let folder = tempfile::tempdir().unwrap();
    let (left, right) = ([0.1f32, 0.8, 0.2, 0.6], [0.9f32, 0.3, 0.5, 0.0]);
    std::fs::write(folder.path().join("two.npy"), npy([1, 2, 4], &[left, right].concat())).unwrap();
    let scene = |color: Value| {
        json!({
            "etendue": 1,
            "camera": {
                "type": "orthographic", "height": 1, "pose": { "from": [0, 0, 2], "look_at": [0, 0, 0] },
                "sensor": { "type": "multispectral", "resolution": [4, 4], "bands": [400, 500, 600, 700, 800] }
            },
            "tracer": { "type": "path" }, "render": { "samples": 1 },
            "objects": [{ "shape": "rectangle", "width": 1, "height": 1, "material": "a" }],
            "materials": { "a": { "type": "matte", "color": color } },
            "lights": [{ "type": "directional", "direction": [0, 0, -1],
                         "irradiance": ([std::f64::consts::PI; 3]) }]
        })
    };
    let bands = json!([400, 500, 600, 700, 800]);
    let cube = json!({ "cube": "two.npy", "bands": bands, "filter": "nearest" });
    let of_cube = load_json(folder.path(), scene(cube));
    // The means over a band of straight lines between the bands' middles: half of a slope's step is outside.
    let means = |v: [f32; 4]| -> Vec<f64> {
        let v = v.map(f64::from);
        let at = |i: usize, k: isize| v[(i as isize + k).clamp(0, 3) as usize];
        (0..4).map(|i| 0.75 * v[i] + 0.125 * (at(i, -1) + at(i, 1))).collect()
    };
    for (_, light) in seen_in_each_precision(&of_cube, &[4, 7]) {
        for (found, expected) in light.iter().zip([means(left), means(right)]) {
            for (found, expected) in found.iter().zip(expected) {
                // Texels and films are f32.
                assert!((found - expected).abs() < 1e-6, "{light:?}");
            }
        }
    }
    let square = |from: f64, to: f64| json!({ "curve": [[400, from], [800, to]] });
    let checker = json!({ "checker": [square(0.0, 0.8), square(0.9, 0.5)], "squares": 2 });
    let of_checker = load_json(folder.path(), scene(checker));
    let both = seen_in_each_precision(&of_checker, &[0, 3]);
    for found in both.into_iter().flat_map(|(_, light)| light) {
        // A pixel sees both squares, mixed alike in every band.
        let of = |share: f64, band: usize| {
            let [a, b] = [[0.1, 0.85], [0.3, 0.75], [0.5, 0.65], [0.7, 0.55]][band];
            share * a + (1.0 - share) * b
        };
        let share = (found[0] - 0.85) / (0.1 - 0.85);
        // Films are f32: a share of all is one to seven digits.
        let is_share = share > -1e-6 && share < 1.0 + 1e-6;
        assert!((share - 0.5).abs() > 0.1 && is_share, "{share}: mostly one");
        for (band, found) in found.iter().enumerate() {
            assert!((found - of(share, band)).abs() < 1e-6, "{found} in band {band}");
        }
    }
}

/// A mirror, a metal and its n and k, and a body: curves have the closed form's numbers in every band.
#[test]
fn other_surfaces_have_their_curves_too() {
    let folder = tempfile::tempdir().unwrap();
    let ramp = json!({ "curve": [[400, 0.2], [800, 0.6]] });
    let scene = |material: Value, objects: Value| {
        json!({
            "etendue": 1,
            "camera": {
                "type": "orthographic", "height": 1, "pose": { "from": [0, 0, 2], "look_at": [0, 0, 0] },
                "sensor": { "type": "multispectral", "resolution": [4, 4], "bands": [400, 500, 600, 700, 800] }
            },
            "tracer": { "type": "path" }, "render": { "samples": 1 },
            "objects": objects, "materials": { "a": material },
            "lights": [{ "type": "environment", "radiance": { "curve": [[300, 2], [900, 2]] } }]
        })
    };
    let wall = json!([{ "shape": "rectangle", "width": 3, "height": 3, "material": "a" }]);
    let slab = json!([{ "shape": "box", "size": [3, 3, 0.5], "material": "a" }]);
    let n = json!({ "curve": [[400, 1.0], [800, 1.0]] });
    let k = json!({ "curve": [[400, 2.0], [800, 2.0]] });
    let cases = [
        (json!({ "type": "mirror", "color": ramp }), &wall, [0.5, 0.7, 0.9, 1.1]),
        (json!({ "type": "metal", "roughness": 0, "color": ramp }), &wall, [0.5, 0.7, 0.9, 1.1]),
        // |n + ik − 1|² / |n + ik + 1|² of n = 1 and k = 2 is a half.
        (json!({ "type": "metal", "roughness": 0, "metal": { "n": n, "k": k } }), &wall, [1.0; 4]),
        // Through half a metre of what leaves the mean of a band after one: its root.
        (
            json!({ "type": "dielectric", "ior": 1, "absorption": { "color": ramp, "distance": 1 } }),
            &slab,
            [0.25f64, 0.35, 0.45, 0.55].map(|left| 2.0 * left.sqrt()),
        ),
    ];
    for (material, objects, expected) in cases {
        let scene = load_json(folder.path(), scene(material.clone(), objects.clone()));
        for (_, light) in seen_in_each_precision(&scene, &[5]) {
            for (found, expected) in light[0].iter().zip(expected) {
                assert!((found - expected).abs() < 1e-5, "{material}: {light:?}");
            }
        }
    }
}
