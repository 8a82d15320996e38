//! Views by colour and by band.

use etendue_render::Plan;
use etendue_spectrum::Bands;

use super::{OUTPUTS, array, camera, on_the_wall, save_wave, shift, write_scene};
use crate::steps::{load, rendered};

/// Thickness of the lenslets of [`by_color`] (mm).
const THICKNESS: f64 = 0.5;

/// Index of N-SF11 at a wavelength (nm): Sellmeier's formula with the coefficients of Schott's data sheet.
fn index_of_nsf11(nm: f64) -> f64 {
    let squared = (nm / 1000.0).powi(2);
    let terms = [
        (1.737_596_95, 0.013_188_707),
        (0.313_747_346, 0.062_306_814_2),
        (1.898_781_01, 155.236_29),
    ];
    let term = |(b, c): (f64, f64)| b * squared / (squared - c);
    (1.0 + terms.into_iter().map(term).sum::<f64>()).sqrt()
}

/// Of the views of a wall with waves behind lenslets of N-SF11, by colour: how far the middle one stands beside the ideal
/// lens' in the left third and in the right one, the disparity along the middle row (columns), and how far the centres of
/// images in that colour are from those of the design wavelength in both thirds (pixels).
fn by_color(accuracy: &str) -> (serde_json::Value, [[f64; 5]; 3]) {
    let folder = tempfile::tempdir().unwrap();
    save_wave(folder.path(), [128, 1]);
    let depth = 0.25;
    let (width, z) = (40.0 * on_the_wall(7.0, depth), 0.5 - depth);
    let microlenses =
        format!(r#", "glass": "N-SF11", "radii": [0.33, null], "thickness": {THICKNESS}"#);
    let camera = camera("light_field", &microlenses, [480, 30], r#""views": 5,"#);
    let geometry = write_scene(
        folder.path(),
        &format!(
            r#"{{"etendue": 1, "tracer": {{"type": "flat"}}, "render": {{"samples": 64}},
            "accuracy": {{"view_psnr": 40 {accuracy}}}, "camera": {camera},
            "materials": {{"a": {{"type": "matte",
                "color": {{"image": "wave.png", "encoding": "linear", "repeat": [40, 1]}}}}}},
            "objects": [{{"shape": "rectangle", "width": {width}, "height": {width}, "material": "a",
                "transform": {{"translate": [0.0003, 0, {z}]}}}}]}}"#
        ),
    );
    let (shape, views) = array(&folder.path().join("views.npy"));
    let (_, reference) = array(&folder.path().join("reference.npy"));
    let [n, _, rows, cols, channels] = shape[..] else { panic!("{shape:?}") };
    let thirds = [[0, cols / 3], [cols - cols / 3, cols]];
    let place =
        |key: &serde_json::Value, row: usize, col: usize| key[row][col][0].as_f64().unwrap();
    let measured = std::array::from_fn(|color| {
        let part = |values: &[f64], across: usize, [from, to]: [usize; 2]| -> Vec<Vec<f64>> {
            let start = (n / 2 * n + across) * rows * cols;
            let pixel =
                |row: usize, col: usize| values[(start + row * cols + col) * channels + color];
            (0..rows).map(|row| (from..to).map(|col| pixel(row, col)).collect()).collect()
        };
        let beside = |third| shift(&part(&reference, n / 2, third), &part(&views, n / 2, third));
        let ends = [0, n - 1].map(|across| part(&views, across, [0, cols]));
        let apart = |[from, to]: [usize; 2]| -> f64 {
            let (own, design) = (&geometry["centres_by_color_px"][color], &geometry["centres_px"]);
            let cells = (0..rows).flat_map(|row| (from..to).map(move |col| (row, col)));
            let away = cells.map(|(row, col)| place(own, row, col) - place(design, row, col));
            away.sum::<f64>() / (rows * (to - from)) as f64
        };
        let disparity = -shift(&ends[0], &ends[1]) / (n - 1) as f64;
        let [left, right] = thirds;
        [beside(left), beside(right), disparity, apart(left), apart(right)]
    });
    (geometry, measured)
}

/// Behind thick lenslets of a glass that disperses the images of red, green and blue have their own middles, at which
/// views are sampled. By rays the worst view has 41.3 dB, which the scene's `accuracy` lets through. The same raw picture
/// sampled at the middles of the design wavelength instead has waves that stand beside that by the disparity over a step
/// times how far the middles are apart: of 0.04 pixels, 0.006 columns.
#[test]
fn views_of_each_colour_are_sampled_at_its_own_middles() {
    let (geometry, own) = by_color("");
    let (same, common) = by_color(r#", "view_color_shift": 9"#);
    assert_eq!(geometry["views_by_color"], true, "{}", geometry["color_centres_apart_px"]);
    assert_eq!(same["views_by_color"], false);
    assert!(geometry["color_centres_apart_px"].as_f64().unwrap() > 0.04);
    let number = |key: &str| geometry[key].as_f64().unwrap();
    let expected = number("expected_disparity");
    println!("{own:.5?} {common:.5?}, {expected:.5}");
    for color in 0..3 {
        for third in 0..2 {
            let moved = common[color][third] - own[color][third];
            let known = expected / number("step_px") * own[color][3 + third];
            // The noise is that of the same raw picture.
            assert!((moved - known).abs() < 3e-4, "{color}, {third}: {moved}, not {known}");
        }
    }
    let fringe = |of: &[[f64; 5]; 3]| (of[2][0] - of[0][0]).abs();
    assert!(fringe(&common) > 8e-3 && fringe(&own) < 0.5 * fringe(&common), "red against blue");
    // A pixel is seen through the gap behind the lenslet and its thickness over the index, the less the higher that is:
    // from so much farther beside the middle is what it sees in blue, and less far in red, than at the design wavelength.
    let gap = geometry["array"]["sensor_distance_mm"].as_f64().unwrap();
    let behind = |nm: f64| gap + THICKNESS / index_of_nsf11(nm);
    for (color, within) in [(0, 0.01), (1, 0.005), (2, 0.01)] {
        let known = expected * behind(587.56) / behind(Bands::Rgb.wavelength(color));
        let share = own[color][2] / known;
        assert!((share - 1.0).abs() < within, "{color}: {share} of the disparity by Snell's law");
    }
}

/// A hyperspectral light field: what a pinhole with the same sensor sees of a wall of one colour is what
/// every pixel of every view has in each band, once its own cos⁴ is allowed for.
#[test]
fn spectra_of_views_are_those_of_what_they_see() {
    let scene = |camera: &str| {
        format!(
            r#"{{"etendue": 1, "tracer": {{"type": "direct"}}, "render": {{"samples": 16}},
            "camera": {camera},
            "materials": {{"a": {{"type": "emissive", "radiance": [0.7, 0.4, 0.1]}}}},
            "objects": [{{"shape": "rectangle", "width": 1, "height": 1, "material": "a"}}]}}"#
        )
    };
    let sensor = |resolution: [u32; 2]| {
        format!(
            r#""type": "multispectral", "bands": [450, 520, 590, 660], "noise": "none",
            "resolution": {resolution:?}"#
        )
    };
    let folder = tempfile::tempdir().unwrap();
    let ours = camera("light_field", r#", "f_number": 3.4"#, [120, 60], "")
        .replace(r#""resolution": [120, 60]"#, &sensor([120, 60]));
    let geometry = write_scene(folder.path(), &scene(&ours));
    let bands = 3;
    let [n, rows, cols] = ["views", "rows", "cols"]
        .map(|key| usize::try_from(geometry[key].as_u64().unwrap()).unwrap());
    let (shape, decoded) = array(&folder.path().join("views_spectrum.npy"));
    let (same, reference) = array(&folder.path().join("reference_spectrum.npy"));
    assert_eq!(shape, [n, n, rows, cols, bands]);
    assert_eq!(same, shape);
    let pinhole = format!(
        r#"{{"type": "pinhole", "fov": 20, "pose": {{"from": [0, 0, 0.5], "look_at": [0, 0, 0]}},
            "sensor": {{{}}}}}"#,
        sensor([4, 4])
    );
    let spectrum = spectrum_of(&scene(&pinhole));
    assert!(spectrum[0] < 0.5 * spectrum[2], "{spectrum:?}: the wall is red");
    let middle = (n / 2 * n + n / 2) * rows * cols;
    for (name, values, off) in [("reference", &reference, 2e-3), ("views", &decoded, 5e-3)] {
        let pixel = |k: usize| &values[k * bands..(k + 1) * bands];
        // In the middle view's middle cos⁴ of f/4 is within a lenslet 1 − 4/3/8²/4 of 1.
        let found = pixel(middle + rows / 2 * cols + cols / 2);
        for (band, (found, expected)) in found.iter().zip(&spectrum).enumerate() {
            assert!((found / expected - 1.0).abs() < 0.015, "{name} {band}: {found} {expected}");
        }
        // Elsewhere all bands are dimmed alike.
        for k in 0..n * n * rows * cols {
            let share = pixel(k)[1] / spectrum[1];
            for (found, expected) in pixel(k).iter().zip(&spectrum) {
                assert!((found / expected - share).abs() < off, "{name} {k}: {found} {expected}");
            }
        }
    }
}

/// The bands of the pixel in the middle of a scene's picture.
fn spectrum_of(text: &str) -> Vec<f64> {
    let scene = load(text);
    let picture = rendered(&scene, &Plan::new(&scene, OUTPUTS)).picture;
    let layer = picture.layer("Spectrum").unwrap();
    let middle = picture.height() / 2 * picture.width() + picture.width() / 2;
    layer.channels.iter().map(|channel| channel.values.at(middle)).collect()
}

/// A chart of measured patches in 31 bands: every view has the same numbers, those of the curves.
#[test]
#[expect(clippy::cast_possible_truncation, reason = "inside the view")]
fn every_view_of_a_chart_has_its_reflectances() {
    let folder = tempfile::tempdir().unwrap();
    let mut scene = crate::curves::chart();
    // Patches 9 mm apart, in views that are 57.6 mm wide at the plane in focus.
    for object in scene["objects"].as_array_mut().unwrap() {
        for key in ["width", "height"] {
            object[key] = 8.6e-3.into();
        }
        for axis in 0..2 {
            let at = object["transform"]["translate"][axis].as_f64().unwrap();
            object["transform"]["translate"][axis] = (9e-3 * at).into();
        }
    }
    let spectra = folder.path().join("spectra");
    std::fs::create_dir(&spectra).unwrap();
    let table = crate::curves::scenes().join("spectra/colorchecker.csv");
    std::fs::copy(table, spectra.join("colorchecker.csv")).unwrap();
    scene["camera"] =
        serde_json::from_str(&camera("light_field_reference", "", [300, 200], "")).unwrap();
    scene["camera"]["sensor"] = serde_json::json!({
        "type": "multispectral", "resolution": [300, 200], "pixel_pitch": 8,
        "bands": { "from": 400, "to": 700, "count": 31 }
    });
    scene["render"] = serde_json::json!({ "samples": 4 });
    let geometry = write_scene(folder.path(), &scene.to_string());
    let [n, rows, cols] = ["views", "rows", "cols"]
        .map(|key| usize::try_from(geometry[key].as_u64().unwrap()).unwrap());
    let (shape, views) = array(&folder.path().join("views_spectrum.npy"));
    assert_eq!(shape, [n, n, rows, cols, 31]);
    let grid = etendue_spectrum::Grid::equal(400.0, 700.0, 31).unwrap();
    let lamp = etendue_spectrum::Illuminant::D65.curve().unwrap();
    for view in 0..n * n {
        let pixel = |k: usize| {
            let (x, y) = ((k % 6) as f64 - 2.5, 1.5 - (k / 6) as f64);
            let column = (cols as f64 * (0.5 + 9e-3 * x / on_the_wall(cols as f64, 0.5))) as usize;
            let row = (rows as f64 * (0.5 - 9e-3 * y / on_the_wall(rows as f64, 0.5))) as usize;
            ((view * rows + row) * cols + column) * 31
        };
        for (k, patch) in etendue_spectrum::colorchecker::PATCHES.iter().enumerate() {
            // Away from the axis all bands of a pixel are dimmed alike.
            let found = &views[pixel(k)..pixel(k) + 31];
            let known: Vec<f64> = (grid.bands())
                .map(|b| patch.mean(b.from, b.to) * lamp.mean(b.from, b.to))
                .collect();
            let dimmed = found.iter().sum::<f64>() / known.iter().sum::<f64>();
            for (found, known) in found.iter().zip(&known) {
                // f32, and sums of a few samples.
                let off = (found - dimmed * known).abs();
                assert!(off < 1e-5 * dimmed, "view {view}, patch {k}: {off} of {known}");
            }
            assert!(dimmed > 0.9 && dimmed < 1.001, "view {view}, patch {k}: {dimmed}");
        }
    }
}
