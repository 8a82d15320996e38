//! Files of a light-field camera, read back: the views decoded from its raw picture are those of an
//! ideal lens, and things stand in them where the formula says.

mod colours;
mod focused;

use std::f64::consts::TAU;
use std::path::Path;

use etendue_files::Transaction;
use etendue_render::light_field;
use etendue_render::output::Outputs;
use etendue_render::{Plan, RenderedScene};

use crate::steps::{load_in, prepare, trace};

const OUTPUTS: Outputs = Outputs { npy: true, ..Outputs::NONE };

/// Writes the set of a scene, whose file is put into the folder, too.
fn write_scene(folder: &Path, text: &str) -> serde_json::Value {
    let scene = load_in(folder, text);
    let plan = Plan::new(&scene, OUTPUTS);
    let (accel, images) = prepare(&scene, &plan);
    let rendered = trace(&scene, &plan, &*accel, &images);
    let rendering = RenderedScene { scene: &scene, accel: &*accel, images: &images };
    let set = light_field::write(
        rendering,
        &rendered.picture,
        &Transaction::at_once(),
        folder,
        OUTPUTS,
        &|_: f64| true,
    )
    .unwrap();
    let promised = light_field::file_names(&scene);
    for file in &set.files {
        let name = file.strip_prefix(folder).unwrap().to_str().unwrap();
        assert!(promised.iter().any(|promised| promised == name), "{name}");
        assert!(file.exists(), "{name}");
    }
    serde_json::from_slice(&std::fs::read(folder.join("geometry.json")).unwrap()).unwrap()
}

/// Of a wall at `depth` (m) before a lens of 20 mm that is focused at 0.5 m: the width of `columns` columns
/// of a view, each 0.1 mm wide at 20.8333 mm behind the lens.
fn on_the_wall(columns: f64, depth: f64) -> f64 {
    columns * depth * 0.1 / (1.0 / (1.0 / 20.0 - 1.0 / 500.0))
}

/// A camera of 20 mm f/4 with lenslets of 0.1 mm.
fn camera(kind: &str, microlenses: &str, resolution: [u32; 2], more: &str) -> String {
    format!(
        r#"{{"type": "{kind}", "focal_length": 20, "f_number": 4, "focus_distance": 0.5,
            "microlenses": {{"pitch": 0.1 {microlenses}}}, {more}
            "pose": {{"from": [0, 0, 0.5], "look_at": [0, 0, 0]}},
            "sensor": {{"resolution": {resolution:?}, "pixel_pitch": 8}}}}"#
    )
}

/// Writes the set of a camera that looks at a wall of squares at `depth` (m), each of which is 3.5 columns
/// of a view wide. Of 32 samples the noise alone leaves round lenslets 40 dB, of 64 it leaves 44.
fn write(folder: &Path, depth: f64, kind: &str, microlenses: &str) -> serde_json::Value {
    let (width, z) = (80.0 * on_the_wall(3.5, depth), 0.5 - depth);
    // Stripes, nearly: a row sees one square above the other at most once.
    let height = 40.0 * width;
    let camera = camera(kind, microlenses, [640, 100], "");
    write_scene(
        folder,
        &format!(
            r#"{{"etendue": 1, "tracer": {{"type": "flat"}}, "render": {{"samples": 64}},
            "camera": {camera},
            "materials": {{"a": {{"type": "checker", "colors": [[0.9, 0.8, 0.7], [0.1, 0.2, 0.3]], "squares": 80}}}},
            "objects": [{{"shape": "rectangle", "width": {width}, "height": {height}, "material": "a",
                "transform": {{"translate": [0.0003, 0.0007, {z}]}}}}]}}"#
        ),
    )
}

/// The same before waves of 7 columns of a view, which have no harmonics: pixels of a view that sample
/// squares take their thirteenth and fifteenth for their first.
fn write_waves(folder: &Path, depth: f64, camera: &str, samples: u32) -> serde_json::Value {
    write_waves_by(folder, depth, camera, (samples, 0))
}

/// The same by samples of a seed.
fn write_waves_by(
    folder: &Path,
    depth: f64,
    camera: &str,
    (samples, seed): (u32, u32),
) -> serde_json::Value {
    save_wave(folder, [128, 1]);
    let (width, z) = (40.0 * on_the_wall(7.0, depth), 0.5 - depth);
    write_scene(
        folder,
        &format!(
            r#"{{"etendue": 1, "tracer": {{"type": "flat"}}, "render": {{"samples": {samples}, "seed": {seed}}},
            "camera": {camera},
            "materials": {{"a": {{"type": "matte",
                "color": {{"image": "wave.png", "encoding": "linear", "repeat": [40, 1]}}}}}},
            "objects": [{{"shape": "rectangle", "width": {width}, "height": {width}, "material": "a",
                "transform": {{"translate": [0.0003, 0, {z}]}}}}]}}"#
        ),
    )
}

/// Saves a period of a wave between 0.1 and 0.9, along columns, or of the product of one along columns and one along
/// rows.
fn save_wave(folder: &Path, [columns, rows]: [u32; 2]) {
    let cosine = |at: u32, of: u32| match of {
        1 => 1.0,
        of => (TAU * (f64::from(at) + 0.5) / f64::from(of)).cos(),
    };
    let wave = |x: u32, y: u32| {
        let value = 0.5 + 0.4 * cosine(x, columns) * cosine(y, rows);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "16 bits")]
        image::Luma([(65535.0 * value).round() as u16])
    };
    image::ImageBuffer::from_fn(columns, rows, wave).save(folder.join("wave.png")).unwrap();
}

/// An array of f32 of a file: its shape and values.
fn array(path: &Path) -> (Vec<usize>, Vec<f64>) {
    let bytes = std::fs::read(path).unwrap();
    let end = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let header = std::str::from_utf8(&bytes[10..end]).unwrap();
    let shape = header.split('(').nth(1).unwrap().split(')').next().unwrap();
    let shape = shape.split(',').filter_map(|n| n.trim().parse().ok()).collect();
    let numbers = bytes[end..].chunks(4).map(|b| f32::from_le_bytes(b.try_into().unwrap()).into());
    (shape, numbers.collect())
}

/// Green of one view, row by row.
fn view(shape: &[usize], values: &[f64], across: usize, down: usize) -> Vec<Vec<f64>> {
    let [_, n, rows, cols, channels] = shape[..] else { panic!("{shape:?}") };
    let start = (down * n + across) * rows * cols * channels;
    let row = |row: usize| {
        (0..cols).map(|col| values[start + (row * cols + col) * channels + 1]).collect()
    };
    (0..rows).map(row).collect()
}

/// Shift of the waves of one view to the right against those of another (columns): by the phase of
/// their period of 7 columns, in a Hann window.
fn shift(from: &[Vec<f64>], to: &[Vec<f64>]) -> f64 {
    let wave = |row: &[f64]| {
        let n = row.len() as f64;
        let window = |i: usize| 1.0 - (TAU * (i as f64 + 0.5) / n).cos();
        // Without its mean, of which the window would let some through.
        let mean: f64 = row.iter().enumerate().map(|(i, v)| window(i) * v).sum::<f64>() / n;
        row.iter().enumerate().fold([0.0; 2], |[re, im], (i, value)| {
            let (sine, cosine) = (TAU * i as f64 / 7.0).sin_cos();
            let value = window(i) * (value - mean);
            [re + value * cosine, im - value * sine]
        })
    };
    let pairs = from.iter().zip(to).map(|(a, b)| (wave(a), wave(b)));
    let [re, im] = pairs.fold([0.0; 2], |[re, im], (a, b)| {
        [re + a[0] * b[0] + a[1] * b[1], im + a[0] * b[1] - a[1] * b[0]]
    });
    -im.atan2(re) * 7.0 / TAU
}

/// The least PSNR of the decoded views against an ideal lens' (dB).
fn worst_view(folder: &Path) -> f64 {
    worst_view_of_two([folder, folder])
}

/// The same of two renders whose noise has nothing to do with each other, without it: the product of what both say of
/// an error is its square in the mean.
fn worst_view_of_two(folders: [&Path; 2]) -> f64 {
    let [(shape, first), (_, second)] = folders.map(|folder| {
        let (shape, mut off) = array(&folder.join("views.npy"));
        let (same, reference) = array(&folder.join("reference.npy"));
        assert_eq!(shape, same);
        off.iter_mut().zip(&reference).for_each(|(off, reference)| *off -= reference);
        (shape, off)
    });
    let size = shape[2..].iter().product::<usize>();
    let psnr = first.chunks(size).zip(second.chunks(size)).map(|(a, b)| {
        let squares: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
        -10.0 * (squares / size as f64).max(1e-9).log10()
    });
    psnr.fold(f64::INFINITY, f64::min)
}

#[test]
fn decoded_views_are_those_of_an_ideal_lens() {
    for microlenses in ["", r#", "rotation": 2"#, r#", "grid": "hexagonal", "aperture": "round""#] {
        let folder = tempfile::tempdir().unwrap();
        let geometry = write(folder.path(), 0.45, "light_field", microlenses);
        let worst = worst_view(folder.path());
        assert!(geometry["views"].as_u64().unwrap() > 1, "{geometry}");
        println!("{microlenses}: worst view {worst:.1} dB");
        assert!(worst > 40.0, "{microlenses}: {worst}");
    }
}

/// Views that are written have 40 dB of an ideal lens' views, whatever the lenslets are; and nothing is written where a
/// note says why. Waves stand in front of the focus, at a disparity of 0.13.
fn views_are_those_of_an_ideal_lens_or_none(cases: &[(String, Option<bool>)], samples: [u32; 2]) {
    for (microlenses, written) in cases {
        let folders = [0, 1].map(|_| tempfile::tempdir().unwrap());
        let camera = camera("light_field", microlenses, [120, 60], r#""views": 3,"#);
        let geometry = write_waves(folders[0].path(), 0.32, &camera, samples[0]);
        let views = geometry["views"].as_u64().unwrap();
        println!("{microlenses}: {views} views, {}", geometry["no_views"]);
        assert!(written.is_none_or(|written| written == (views > 0)), "{microlenses}: {geometry}");
        assert_eq!(views == 0, geometry["no_views"].is_string(), "{microlenses}");
        assert_eq!(views > 0, folders[0].path().join("views.npy").exists(), "{microlenses}");
        if views > 0 {
            let seed = samples[1];
            let mut pair = [folders[0].path(); 2];
            if seed > 0 {
                write_waves_by(folders[1].path(), 0.32, &camera, (samples[0], seed));
                pair[1] = folders[1].path();
            }
            let worst = worst_view_of_two(pair);
            println!("worst view {worst:.1} dB, by rays {}", geometry["psnr_by_rays"]);
            assert!(worst > 40.0, "{microlenses}: {worst}");
        }
    }
}

#[test]
fn views_that_are_written_are_those_of_an_ideal_lens() {
    let cases = [
        (String::new(), Some(true)),
        (r#", "rotation": 17"#.to_owned(), Some(true)),
        (r#", "grid": "hexagonal", "aperture": "round", "rotation": -40"#.to_owned(), Some(true)),
        (
            r#", "grid": "hexagonal", "types": [{"focal_length": 0.425}, {"focal_length": 0.432},
                {"focal_length": 0.418}]"#
                .to_owned(),
            Some(true),
        ),
        (r#", "picture_distance": 0.3"#.to_owned(), Some(false)),
        (r#", "picture_distance": -0.9"#.to_owned(), Some(false)),
    ];
    views_are_those_of_an_ideal_lens_or_none(&cases, [24, 0]);
}

/// Behind thick lenslets a raw picture of 64 samples has noise of 36 to 46 dB, which two renders tell from what views
/// are off by. Biconvex ones, whose faces cut each other's light, are just below the bound of the rays.
#[test]
fn views_of_thick_lenslets_are_those_of_an_ideal_lens() {
    let thick = |radii: &str| {
        (format!(r#", "glass": "N-BK7", "radii": {radii}, "thickness": 0.1"#), Some(true))
    };
    let biconvex = (thick("[0.2, -0.2]").0, None);
    let cases = [thick("[0.215, null]"), thick("[null, -0.215]"), biconvex];
    views_are_those_of_an_ideal_lens_or_none(&cases, [64, 7]);
}

/// The amplitude of waves of 7 columns, in a Hann window over the columns.
fn amplitude(rows: &[Vec<f64>]) -> f64 {
    let sum = rows.iter().fold([0.0; 2], |sum, row| {
        let n = row.len() as f64;
        let window = |i: usize| 1.0 - (TAU * (i as f64 + 0.5) / n).cos();
        let mean: f64 = row.iter().enumerate().map(|(i, v)| window(i) * v).sum::<f64>() / n;
        row.iter().enumerate().fold(sum, |[re, im], (i, value)| {
            let (sine, cosine) = (TAU * i as f64 / 7.0).sin_cos();
            let value = window(i) * (value - mean);
            [re + value * cosine, im - value * sine]
        })
    });
    sum[0].hypot(sum[1])
}

/// The share of a wave of 7 columns that the mean of `n` views along a row has of it which are `disparity` apart and are
/// moved by `moved` each, between pixels by cubic convolution (Keys 1981).
fn share_left(n: usize, disparity: f64, moved: f64) -> f64 {
    let keys = |t: f64| match t.abs() {
        t if t <= 1.0 => (1.5 * t - 2.5) * t * t + 1.0,
        t if t < 2.0 => ((-0.5 * t + 2.5) * t - 4.0) * t + 2.0,
        _ => 0.0,
    };
    let sum = (0..n).fold([0.0; 2], |sum, k| {
        let step = k as f64 - 0.5 * (n as f64 - 1.0);
        let at = -moved * step;
        (-3..=3).fold(sum, |[re, im], neighbour| {
            let column = at.floor() + f64::from(neighbour);
            let (sine, cosine) = (TAU / 7.0 * (column + disparity * step)).sin_cos();
            let weight = keys(at - column) / n as f64;
            [re + weight * cosine, im + weight * sine]
        })
    });
    sum[0].hypot(sum[1])
}

/// With a distance of its own a camera that has views leaves their mean, in which a wall there is as sharp as in a view,
/// and one elsewhere blurred by as many steps as there are views.
#[test]
fn views_together_are_sharp_at_the_distance_that_is_asked_for() {
    let depth = 0.3;
    for distance in [depth, 0.5, 2.0] {
        let folder = tempfile::tempdir().unwrap();
        let more = format!(r#""refocus_distance": {distance},"#);
        let camera = camera("light_field", "", [640, 40], &more);
        let geometry = write_waves(folder.path(), depth, &camera, 8);
        assert_eq!(geometry["refocused_m"], distance);
        let (shape, views) = array(&folder.path().join("views.npy"));
        let (size, refocused) = array(&folder.path().join("refocused.npy"));
        assert_eq!(size, shape[2..], "a picture as large as a view");
        let green: Vec<f64> = refocused.iter().skip(1).step_by(3).copied().collect();
        let refocused: Vec<Vec<f64>> = green.chunks(size[1]).map(<[f64]>::to_vec).collect();
        let n = shape[0];
        // Outer views have half a percent less of the waves than the middle one.
        let single = (0..n * n).map(|k| amplitude(&view(&shape, &views, k % n, k / n)));
        let found = amplitude(&refocused) / (single.sum::<f64>() / (n * n) as f64);
        let [wall, asked] = {
            let [baseline, focal] = ["baseline_m", "focal_length_px"]
                .map(|key| geometry["disparity"][key].as_f64().unwrap());
            [depth, distance].map(|z| baseline * focal * (1.0 / z - 2.0))
        };
        let known = share_left(n, wall, asked);
        println!("{distance} m: {found:.4} of the waves, {known:.4} by the formula, {n} views");
        // Noise. Views that are not moved as they should lose 0.013.
        assert!((found - known).abs() < 2e-3, "{distance}: {found}, not {known}");
    }
}

#[test]
fn disparity_against_depth_has_the_slope_of_the_formula() {
    let mut points = Vec::new();
    for depth in [0.36, 0.42, 0.5, 0.8, 1.5] {
        let folder = tempfile::tempdir().unwrap();
        let camera = camera("light_field", "", [640, 40], "");
        let geometry = write_waves(folder.path(), depth, &camera, 16);
        let (shape, views) = array(&folder.path().join("views.npy"));
        let n = shape[0];
        let middle = n / 2;
        let [first, last] = [0, n - 1].map(|across| view(&shape, &views, across, middle));
        let measured = -shift(&first, &last) / (n - 1) as f64;
        let expected = geometry["expected_disparity"].as_f64().unwrap();
        let [baseline, focal] = ["baseline_m", "focal_length_px"]
            .map(|key| geometry["disparity"][key].as_f64().unwrap());
        assert!((expected - baseline * focal * (1.0 / depth - 2.0)).abs() < 1e-9, "{depth}");
        println!("{depth} m: {measured:.5} and {expected:.5}");
        // cos⁴ falls across each lenslet, by 4 s/b of its light a length at slope s: its middle moves by
        // that times pitch²/12, which is 0.0016 columns a view at all depths. The formula itself holds ray
        // by ray (camera/tests/light_field.rs).
        assert!((measured - expected - 0.0016).abs() < 4e-4, "{depth}: {measured} {expected}");
        points.push([expected, measured]);
        let pfm = std::fs::read(folder.path().join("central_disparity.pfm")).unwrap();
        let value = f32::from_le_bytes(pfm[pfm.len() - 4..].try_into().unwrap());
        assert!((f64::from(value) - expected).abs() < 1e-6, "a wall square to the axis");
    }
    let count = points.len() as f64;
    let mean = [0, 1].map(|k| points.iter().map(|p| p[k]).sum::<f64>() / count);
    let sum =
        |k: usize| -> f64 { points.iter().map(|p| (p[0] - mean[0]) * (p[k] - mean[k])).sum() };
    let slope = sum(1) / sum(0);
    println!("slope {slope:.5} of the formula's");
    assert!((slope - 1.0).abs() < 0.005, "{slope}");
}

#[test]
fn a_reference_camera_leaves_its_views_alone() {
    let folder = tempfile::tempdir().unwrap();
    let geometry = write(folder.path(), 0.4, "light_field_reference", "");
    let (shape, _) = array(&folder.path().join("views.npy"));
    assert_eq!(geometry["rows"], shape[2] as u64);
    assert!(geometry["centres_px"].is_null(), "there is no raw picture");
    assert!(!folder.path().join("white.npy").exists());
    assert!(!folder.path().join("reference.npy").exists());
}

/// Distance of plain centroids of the white picture, over circles as wide as the images are apart, from the places of
/// `key` (pixels): the worst of those within `within` (pixels) of the picture's middle column.
fn worst_centroid(folder: &Path, geometry: &serde_json::Value, key: &str, within: f64) -> f64 {
    let (shape, white) = array(&folder.join("white.npy"));
    let width = shape[1];
    let places = |key: &str| -> Vec<[f64; 2]> {
        let rows = geometry[key].as_array().unwrap().iter();
        rows.flat_map(|row| row.as_array().unwrap())
            .map(|place| [0, 1].map(|k| place[k].as_f64().unwrap()))
            .collect()
    };
    let reach = 0.5 * geometry["pitch_px"].as_f64().unwrap() + 0.5;
    let mut worst = 0.0_f64;
    for ([x, y], expected) in places("centres_px").into_iter().zip(places(key)) {
        if (x - 0.5 * width as f64).abs() > within {
            continue;
        }
        let (mut sum, mut mean) = (0.0, [0.0; 2]);
        for (k, value) in white.iter().skip(1).step_by(3).enumerate() {
            let at = [(k % width) as f64, (k / width) as f64];
            if (at[0] - x).hypot(at[1] - y) < reach {
                sum += value;
                mean = [mean[0] + value * at[0], mean[1] + value * at[1]];
            }
        }
        worst = worst.max((mean[0] / sum - expected[0]).hypot(mean[1] / sum - expected[1]));
    }
    println!("{key} within {within} px: worst {worst:.4} px");
    worst
}

/// Lenslets that are slower than the main lens leave dark pixels between their images, so that a centroid is
/// that of one image.
#[test]
fn white_images_stand_where_the_geometry_says() {
    let folder = tempfile::tempdir().unwrap();
    let geometry = write(folder.path(), 0.4, "light_field", r#", "f_number": 3.4, "rotation": 1"#);
    // Further out cos⁴ moves the centroid by more: 4 × slope × 0.1 × a quarter of the radius.
    let worst = worst_centroid(folder.path(), &geometry, "centres_px", 120.0);
    assert!(worst < 0.05, "{worst}");
    let worst = worst_centroid(folder.path(), &geometry, "centroids_px", f64::INFINITY);
    assert!(worst < 0.05, "{worst}");
}

/// A ring before the lens cuts into the light of the outer lenslets: their images are no longer round, and
/// the centroids stand a pixel beside the chief rays.
#[test]
fn centroids_of_vignetted_images_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let ring =
        r#""elements": [{"type": "aperture", "shape": "circular", "radius": 2.6, "at": -15}],"#;
    let camera = camera("light_field", r#", "f_number": 3.4"#, [640, 60], ring);
    let text = format!(
        r#"{{"etendue": 1, "tracer": {{"type": "flat"}}, "render": {{"samples": 1}},
        "accuracy": {{"white_samples": 256}},
        "camera": {camera}, "objects": [{{"shape": "sphere"}}]}}"#
    );
    let geometry = write_scene(folder.path(), &text);
    let beside = worst_centroid(folder.path(), &geometry, "centres_px", f64::INFINITY);
    assert!(beside > 0.5, "{beside}: it cuts");
    let worst = worst_centroid(folder.path(), &geometry, "centroids_px", f64::INFINITY);
    assert!(worst < 0.05, "{worst}");
}
