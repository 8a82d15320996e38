//! Images in as few texels as the nearest view can tell apart: the picture stays what it is with whole ones.

use std::path::Path;

use etendue_image::Coarseness;
use etendue_render::output::Outputs;
use etendue_render::tolerance::coarse_images;
use etendue_render::{Images, Plan, build};
use etendue_scene::Scene;
use serde_json::{Value, json};

use crate::steps::{layer, load_json, trace};

/// Texels a side.
const SIDE: u32 = 1024;

/// A sign of 0.4 m with an image, over a plain ground, at 3 m.
fn sign(folder: &Path, changes: &[(&str, Value)]) -> Scene {
    let file = folder.join("stripes.png");
    if !file.exists() {
        let wave = |x: u32, y: u32| {
            let phase = f64::from(x) / 90.0 + (f64::from(y) / 160.0).sin();
            let fine = if (x / 2 + y / 2).is_multiple_of(2) { 30.0 } else { -30.0 };
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "8 to 248")]
            let byte = (128.0 + 90.0 * phase.sin() + fine) as u8;
            byte
        };
        let image =
            image::RgbImage::from_fn(SIDE, SIDE, |x, y| image::Rgb([wave(x, y), wave(y, x), 200]));
        image.save(file).unwrap();
    }
    let mut scene = json!({
        "camera": { "type": "pinhole", "fov": 30, "sensor": { "resolution": [64, 48] },
            "pose": { "from": [0.3, 0.9, 3], "look_at": [0, 0.3, 0] } },
        "tracer": { "type": "direct" },
        "tolerance": { "displacement": "0.5 px", "light": "2 %" },
        "lights": [{ "type": "environment", "radiance": [1, 1, 1] }],
        "materials": { "white": { "type": "matte", "color": [0.7, 0.7, 0.7] },
            "image": { "type": "matte", "color": { "image": "stripes.png" } } },
        "objects": [
            { "shape": "rectangle", "width": 0.4, "height": 0.4, "material": "image",
                "transform": { "translate": [0, 0.3, 0], "rotate": [0, 1, 0, 20] } },
            { "shape": "rectangle", "width": 9, "height": 9, "material": "white",
                "transform": { "rotate": [1, 0, 0, -90] } }],
        "render": { "samples": 4 },
    });
    for (pointer, value) in changes {
        let (parent, key) = pointer.rsplit_once('/').unwrap();
        scene.pointer_mut(parent).unwrap()[key] = value.clone();
    }
    load_json(folder, scene)
}

fn plan(scene: &Scene) -> Plan {
    Plan::new(scene, Outputs::from_list("exr").unwrap())
}

/// The picture with images that may be `coarse`, and texels a side of the first one.
fn picture(scene: &Scene, coarse: &[Option<Coarseness>]) -> (Vec<f64>, usize) {
    let plan = plan(scene);
    let accel = build(scene, &plan, &Default::default()).unwrap();
    let images = Images::default().renewed(scene, &plan, None, coarse).unwrap();
    let done = trace(scene, &plan, &*accel, &images);
    (layer(&done.picture, ""), images.sizes(scene)[0].resolution[0])
}

/// Means over blocks of 8 × 8 pixels, channel by channel.
fn blocks(values: &[f64]) -> Vec<f64> {
    let mut sums = vec![0.0; values.len() / 64];
    for (i, value) in values.iter().enumerate() {
        let [x, y] = [i % 64 / 8, i / 64 / 8];
        sums[y * 8 + x] += value / 64.0;
    }
    sums
}

fn farthest(own: &[f64], all: &[f64]) -> f64 {
    own.iter().zip(all).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn the_nearest_view_cannot_tell_an_image_in_fewer_texels_from_the_whole_one() {
    let folder = tempfile::tempdir().unwrap();
    let scene = sign(folder.path(), &[]);
    let coarse = coarse_images(&scene, &plan(&scene));
    let Some(found) = coarse[0] else { panic!("the image is whole") };
    // At 2.9 m a pixel of 30° in 48 rows is 32 mm wide at the axis, one of four samples half of that, and three quarters
    // are counted on in the corners: 0.4 m of 1024 texels has some 30 in them.
    let texels = found.footprint * f64::from(SIDE);
    assert!((24.0..32.0).contains(&texels), "{found:?}");
    let (whole, side) = picture(&scene, &[]);
    assert_eq!(side, SIDE as usize);
    let (own, side) = picture(&scene, &coarse);
    assert_eq!(side, SIDE as usize / 16);
    // Levels of the whole image are rounded to 16 bits, and light of 1 is scattered by 0.7 at most.
    let off = farthest(&own, &whole);
    assert!(off < 1e-4, "{off}");
    // The same images eight times as coarse are told apart by the same comparison.
    let wide = Coarseness { footprint: 8.0 * found.footprint, ..found };
    let off = farthest(&picture(&scene, &[Some(wide)]).0, &whole);
    assert!(off > 1e-2, "{off}");
    // Light that was scattered finds means where it found points: blocks of 8 × 8 pixels stay what they are.
    let path = json!({ "type": "path", "max_bounces": 4 });
    let lit = sign(folder.path(), &[("/tracer", path)]);
    let [whole, own] = [&[][..], &coarse].map(|coarse| blocks(&picture(&lit, coarse).0));
    let off = farthest(&own, &whole);
    assert!(off < 0.005 && off > 0.0, "{off}");
    // Four times as many samples are half as wide; from a thirtieth as far it is looked at in full.
    let more = sign(folder.path(), &[("/render/samples", json!(16))]);
    let found = coarse_images(&more, &plan(&more))[0].unwrap();
    assert_eq!(found.halvings([SIDE as usize; 2]), 3);
    let near = json!({ "from": [0, 0.3, 0.1], "look_at": [0, 0.3, 0] });
    let near = sign(folder.path(), &[("/camera/pose", near)]);
    let halvings = coarse_images(&near, &plan(&near))[0].map(|it| it.halvings([SIDE as usize; 2]));
    assert_eq!(halvings.unwrap_or(0), 0);
}

#[test]
fn images_are_whole_where_they_may_be_looked_at_by_the_point() {
    let folder = tempfile::tempdir().unwrap();
    let is_coarse = |changes: &[(&str, Value)]| {
        let scene = sign(folder.path(), changes);
        coarse_images(&scene, &plan(&scene))[0].is_some()
    };
    assert!(is_coarse(&[]));
    let image = json!({ "image": "stripes.png" });
    let cases = [
        ("no tolerance", vec![("/tolerance", Value::Null)]),
        ("layers of data", vec![("/layers", json!(["albedo"]))]),
        ("alpha", vec![("/render/alpha", json!(true))]),
        (
            "what shines",
            vec![("/materials/image", json!({ "type": "emissive", "radiance": image }))],
        ),
        ("the nearest texel", vec![("/materials/image/color/filter", json!("nearest"))]),
        (
            "what moves",
            vec![
                ("/camera/motion", json!({ "type": "velocity", "velocity": [1, 0, 0] })),
                ("/camera/shutter", json!({ "exposure": 0.01 })),
            ],
        ),
        ("no filter", vec![("/plan", json!({ "texture_filter": false }))]),
    ];
    for (what, changes) in cases {
        if what == "no tolerance" {
            let mut scene = sign(folder.path(), &[]);
            scene.tolerance = None;
            assert!(coarse_images(&scene, &plan(&scene))[0].is_none(), "{what}");
            continue;
        }
        assert!(!is_coarse(&changes), "{what}");
    }
}
