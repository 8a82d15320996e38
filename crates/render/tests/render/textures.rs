//! Textures as the camera sees them: far away their mean, near by each texel as it is.

use std::path::Path;

use etendue_render::Plan;
use etendue_render::output::Outputs;

use crate::steps::{channels, load_in, prepare, trace};

/// Red and green of all pixels, beside how many images were decoded and their bytes.
fn picture(folder: &Path, text: &str) -> (Vec<[f64; 2]>, Vec<u64>) {
    let scene = load_in(folder, text);
    let plan = Plan::new(&scene, Outputs::from_list("exr").unwrap());
    let (accel, images) = prepare(&scene, &plan);
    let done = trace(&scene, &plan, &*accel, &images);
    let bytes = images.sizes(&scene).iter().map(|size| size.bytes).collect();
    let [red, green, _]: [Vec<f64>; 3] = channels(&done.picture, "").try_into().unwrap();
    (red.into_iter().zip(green).map(|(r, g)| [r, g]).collect(), bytes)
}

/// A PNG of 64 × 64 texels: red is 0 and 255 in turn, green a constant grey.
fn checker(folder: &Path) {
    let texels = image::RgbImage::from_fn(64, 64, |x, y| {
        image::Rgb([if (x + y) % 2 == 0 { 0 } else { 255 }, 188, 0])
    });
    texels.save(folder.join("checker.png")).unwrap();
}

const MATERIAL: &str = r#""materials": {
    "image": {"type": "matte", "color": {"image": "checker.png", "repeat": [8, 8]}},
    "squares": {"type": "checker", "colors": [[0, 0.5, 0], [1, 0.5, 0]], "squares": 512},
    "mirror": {"type": "mirror"}}"#;

/// The plane z = 0 of 8 m with 512 × 512 texels, looked at by `camera`.
fn plane(material: &str, tracer: &str, camera: &str, more: &str) -> String {
    format!(
        r#"{{"etendue": 1, "tracer": {{"type": "{tracer}"}}, "camera": {camera},
        "objects": [{{"shape": "rectangle", "width": 8, "height": 8, "material": "{material}"}}
        {more}],
        "lights": [{{"type": "environment", "radiance": [1, 1, 1]}}], {MATERIAL}}}"#
    )
}

/// sRGB 188 in linear light.
fn grey() -> f64 {
    ((188.0_f64 / 255.0 + 0.055) / 1.055).powf(2.4)
}

#[test]
fn far_away_a_texture_is_its_mean() {
    let folder = tempfile::tempdir().unwrap();
    checker(folder.path());
    // Pixels as wide as 32 and as 37.6 texels, and those of a pinhole, a lens and an oblique view.
    let cameras = [
        r#"{"type": "orthographic", "height": 4, "sensor": {"resolution": [8, 8]},
            "pose": {"from": [0, 0, 9], "look_at": [0, 0, 0]}}"#,
        r#"{"type": "orthographic", "height": 4.7, "sensor": {"resolution": [8, 8]},
            "pose": {"from": [0.123, 0.2, 9], "look_at": [0.123, 0.2, 0], "up": [1, 3, 0]}}"#,
        r#"{"type": "pinhole", "fov": 40, "sensor": {"resolution": [9, 9]},
            "pose": {"from": [0, 0.1, 6], "look_at": [0.01, 0, 0]}}"#,
        r#"{"type": "pinhole", "fov": 10, "sensor": {"resolution": [9, 9]},
            "pose": {"from": [0, -9, 2], "look_at": [0.01, 0, 0], "up": [0, 0, 1]}}"#,
        r#"{"type": "thin_lens", "focal_length": 50, "f_number": 8, "fov": 40, "focus_distance": 6,
            "sensor": {"resolution": [9, 9]},
            "pose": {"from": [0, 0.1, 6], "look_at": [0.01, 0, 0]}}"#,
    ];
    for (number, camera) in cameras.iter().enumerate() {
        for (material, green) in [("image", grey()), ("squares", 0.5)] {
            let (pixels, _) = picture(folder.path(), &plane(material, "flat", camera, ""));
            let on_it = pixels.iter().filter(|[_, g]| *g > 0.0);
            assert!(on_it.clone().count() > 40, "camera {number}");
            for [r, g] in on_it {
                // The filters' own shape: a box of so many squares is off by at most one of them, the
                // pyramid's levels are means of whole blocks.
                let red = r / g * green;
                assert!((red - 0.5).abs() < 0.04, "camera {number}, {material}: {red}");
                // A constant stays, to 16 bits; a lens weighs its samples.
                let same = (g - green).abs() < 1e-5 || camera.contains("lens");
                assert!(same, "camera {number}, {material}: {g} {green}");
            }
        }
    }
}

#[test]
fn near_by_each_texel_is_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    checker(folder.path());
    // Eight pixels a texel of 1/64 m, aligned: a pixel's middle is 1/16 of a texel off an edge at
    // least, and bilinear weights are what they are without a footprint.
    let camera = r#"{"type": "orthographic", "height": 0.015625, "sensor": {"resolution": [8, 8]},
        "pose": {"from": [0.0078125, 0.0078125, 9], "look_at": [0.0078125, 0.0078125, 0]}}"#;
    let (squares, _) = picture(folder.path(), &plane("squares", "flat", camera, ""));
    assert!(
        squares.iter().all(|p| *p == squares[0] && (p[0] == 0.0 || p[0] == 1.0)),
        "{squares:?}"
    );
    let (image, _) = picture(folder.path(), &plane("image", "flat", camera, ""));
    for (k, [r, _]) in image.iter().enumerate() {
        // Bilinear between this texel (odd or even) and its neighbours.
        let weight = |i: usize| {
            let x = (i as f64 + 0.5) / 8.0 - 0.5;
            1.0 - x.abs()
        };
        let (u, v) = (weight(k % 8), weight(k / 8));
        let own = u * v + (1.0 - u) * (1.0 - v);
        let known = if image[27][0] > 0.5 { own } else { 1.0 - own };
        assert!((r - known).abs() < 1e-6, "{k}: {r} {known}");
    }
}

#[test]
fn mirrors_pass_the_footprint_on_and_no_camera_without_one_filters() {
    let folder = tempfile::tempdir().unwrap();
    checker(folder.path());
    // A mirror at 45° below the camera shows the plane; it stands where the plane's lower half ends.
    let mirror = r#", {"shape": "rectangle", "width": 3, "height": 3, "material": "mirror",
        "transform": {"translate": [0, 0, 6], "rotate": [0, 1, 0, 135]}}"#;
    let camera = r#"{"type": "pinhole", "fov": 8, "sensor": {"resolution": [9, 9]},
        "pose": {"from": [5, 0.013, 6.007], "look_at": [0, 0, 6]}}"#;
    let shown = plane("image", "whitted", camera, mirror);
    let (pixels, _) = picture(folder.path(), &shown);
    // Light on the plane is noisy (one sample), its two colours are not: red is half a white's.
    for [r, g] in pixels.iter().filter(|[_, g]| *g > 0.0) {
        assert!((r / g - 0.5 / grey()).abs() < 0.1, "{r} {g}");
    }
    assert!(pixels.iter().filter(|[_, g]| *g > 0.0).count() > 40, "{pixels:?}");
    let fisheye = r#"{"type": "pinhole", "intrinsics": {"fx": 10, "fy": 10, "cx": 4, "cy": 4,
        "pixel_origin": "center"}, "distortion": {"type": "fisheye", "k1": 0.01},
        "sensor": {"resolution": [9, 9]}, "pose": {"from": [0, 0, 6], "look_at": [0.01, 0, 0]}}"#;
    let (pixels, bytes) = picture(folder.path(), &plane("squares", "flat", fisheye, ""));
    assert!(pixels.iter().all(|[r, _]| *r == 0.0 || *r == 1.0), "{pixels:?}");
    assert!(bytes.is_empty());
    let (_, plain) = picture(folder.path(), &plane("image", "flat", fisheye, ""));
    assert_eq!(plain, [64 * 64 * 3], "what is not filtered has no means");
    let pinhole = fisheye.replace(r#""distortion": {"type": "fisheye", "k1": 0.01},"#, "");
    let (_, means) = picture(folder.path(), &plane("image", "flat", &pinhole, ""));
    // 32² + 16² + … + 1 texels of three times 2 bytes.
    assert_eq!(means, [64 * 64 * 3 + 1365 * 6]);
}
