//! A million lights: a ceiling of as many shining triangles over a floor, whose brightness is known.

use etendue_accel::BuildOptions;
use etendue_render::output::{Outputs, Values};
use etendue_render::{Images, Plan, build, plan, render};
use etendue_scene::LoadOptions;
use etendue_scene::file::SceneFile;
use npyz::WriterBuilder;

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
    let path = folder.path().join("scene.json");
    std::fs::write(&path, text).unwrap();
    let file = SceneFile::read(&path, &[]).unwrap();
    let wanted = plan::wanted(&file.spec.all_layers());
    let scene = file.load(wanted, &LoadOptions::default()).unwrap();
    assert_eq!(scene.geometry.triangles(), 1_000_002);
    let plan = Plan::new(&scene, Outputs::from_list("exr").unwrap());
    let accel = build(&scene, &plan, &BuildOptions::default()).unwrap();
    let images = Images::decode(&scene, &plan, None).unwrap();
    let done = render(&scene, &plan, &*accel, &images, Vec::new(), &|_: f64| true).unwrap();
    let Values::F32(pixels) = &done.picture.layers()[0].channels[0].values else {
        panic!("a picture is f32")
    };
    let n = pixels.len() as f64;
    let mean = pixels.iter().map(|&p| f64::from(p)).sum::<f64>() / n;
    let spread = pixels.iter().map(|&p| (f64::from(p) - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let known = 0.5 * 2.0 * 4.0 * corner_factor(HALF[0], HALF[1]);
    // Four standard errors.
    let bound = 4.0 * (spread / n).sqrt();
    assert!((mean - known).abs() <= bound, "{mean} is not {known} within {bound}");
    assert!(bound < 0.02 * known, "the test can tell: {bound}");
}
