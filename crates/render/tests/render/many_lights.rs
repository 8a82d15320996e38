//! A million lights: a ceiling of as many shining triangles over a floor, whose brightness is known.

use npyz::WriterBuilder;

use crate::steps::{channels, load_in, mean, pictures};

/// Half the ceiling's sides (m), 1 m above the floor.
const HALF: [f64; 2] = [8.0, 4.0];

/// Tiles along each side; each is two triangles.
const TILES: [u32; 2] = [1000, 500];

/// Form factor of a small surface to a rectangle parallel to it at distance 1, with a corner straight
/// above: Howell, *A Catalog of Radiation Heat Transfer Configuration Factors*, B-4.
fn corner_factor(a: f64, b: f64) -> f64 {
    let (x, y) = ((1.0 + a * a).sqrt(), (1.0 + b * b).sqrt());
    (a / x * (b / x).atan() + b / y * (a / y).atan()) / std::f64::consts::TAU
}

#[test]
fn a_million_triangles_shine_as_the_plane_that_they_make() {
    let folder = tempfile::tempdir().unwrap();
    let size = [0, 1].map(|k| 2.0 * HALF[k] / f64::from(TILES[k]));
    let mut rows: Vec<f64> = Vec::new();
    for (x, y) in (0..TILES[0]).flat_map(|x| (0..TILES[1]).map(move |y| (x, y))) {
        let place = |k: usize, i: u32| (f64::from(i) + 0.5) * size[k] - HALF[k];
        // Turned over about x: the front looks down.
        rows.extend([size[0], 0.0, 0.0, place(0, x)]);
        rows.extend([0.0, -size[1], 0.0, place(1, y)]);
        rows.extend([0.0, 0.0, -1.0, 1.0]);
    }
    let file = std::fs::File::create(folder.path().join("tiles.npy")).unwrap();
    let count = u64::from(TILES[0] * TILES[1]);
    let mut npy = npyz::WriteOptions::new()
        .default_dtype()
        .shape(&[count, 3, 4])
        .writer(std::io::BufWriter::new(file))
        .begin_nd()
        .unwrap();
    npy.extend(rows).unwrap();
    npy.finish().unwrap();
    let text = r#"{"etendue": 1, "tracer": {"type": "direct"}, "lights": [],
        "camera": {"type": "orthographic", "height": 1e-3, "sensor": {"resolution": [8, 8]},
            "pose": {"from": [0.3, 0, 0.9], "look_at": [0, 0, 0]}},
        "objects": [{"shape": "rectangle", "material": "floor"},
            {"shape": "rectangle", "material": "lamp", "instances": "tiles.npy"}],
        "materials": {"floor": {"type": "matte", "color": [0.5, 0.5, 0.5]},
            "lamp": {"type": "emissive", "radiance": [2, 2, 2]}},
        "render": {"samples": 256}}"#;
    let scene = load_in(folder.path(), text);
    assert_eq!(scene.geometry.triangles(), 1_000_002);
    for (precision, picture) in pictures(&scene) {
        let pixels = channels(&picture, "").swap_remove(0);
        let n = pixels.len() as f64;
        let mean = mean(&pixels);
        let spread = pixels.iter().map(|p| (p - mean).powi(2)).sum::<f64>() / (n - 1.0);
        let known = 0.5 * 2.0 * 4.0 * corner_factor(HALF[0], HALF[1]);
        // Four standard errors.
        let bound = 4.0 * (spread / n).sqrt();
        let off = (mean - known).abs();
        assert!(off <= bound, "{precision:?}: {mean} is not {known} within {bound}");
        assert!(bound < 0.02 * known, "{precision:?}: the test can tell: {bound}");
    }
}
