//! Layers of scenes whose values have a closed form.

use std::f64::consts::FRAC_PI_2;

use etendue_render::Plan;
use etendue_render::output::Outputs;

use crate::steps::{channels, load, rendered};

/// The values of each layer of a scene, channel by channel.
fn layers(scene: &str) -> Vec<Vec<f64>> {
    let scene = load(scene);
    let done = rendered(&scene, &Plan::new(&scene, Outputs::ALL));
    done.picture.layers().iter().flat_map(|layer| channels(&done.picture, &layer.name)).collect()
}

#[test]
fn the_incidence_of_parallel_rays_is_the_tilt_of_what_they_hit() {
    for tilt in [0.0, 1e-6, 30.0, 89.0_f64] {
        let [incidence]: [Vec<f64>; 1] = layers(&format!(
            r#"{{"etendue": 1, "layers": ["incidence"],
                "camera": {{"type": "orthographic", "height": 1,
                    "pose": {{"from": [0, 0, 100], "look_at": [0, 0, 0]}},
                    "sensor": {{"resolution": [8, 8]}}}},
                "objects": [{{"shape": "rectangle", "width": 1, "height": 100,
                    "transform": {{"rotate": [1, 0, 0, {tilt}]}}}}]}}"#
        ))
        .try_into()
        .unwrap();
        for angle in incidence {
            // The mesh's corners are rounded to 32 bits: 6e-8 of its length.
            assert!((angle - tilt.to_radians()).abs() < 1e-7, "{tilt}: {angle}");
        }
    }
}

#[test]
fn the_incidence_on_a_wall_is_the_field_angle_and_a_miss_is_infinite() {
    let channels = layers(
        r#"{"etendue": 1, "layers": ["incidence", "position"],
            "camera": {"type": "pinhole", "fov": 80,
                "pose": {"from": [0, 0, 0], "look_at": [0, 0, -1]},
                "sensor": {"resolution": [32, 16]}},
            "objects": [{"shape": "rectangle", "width": 2, "height": 9,
                "transform": {"translate": [0, 0, -2]}}]}"#,
    );
    let [incidence, x, y, _] = &channels[..] else { panic!("{}", channels.len()) };
    let (mut hits, mut misses) = (0, 0);
    for ((angle, x), y) in incidence.iter().zip(x).zip(y) {
        if x.is_finite() {
            // Rounding alone: both are worked out in 64 bits.
            assert!((angle - x.hypot(*y).atan2(2.0)).abs() < 1e-12, "{x} {y}: {angle}");
            assert!((0.0..=FRAC_PI_2).contains(angle));
            hits += 1;
        } else {
            assert_eq!(*angle, f64::INFINITY);
            misses += 1;
        }
    }
    assert!(hits > 100 && misses > 100, "{hits} {misses}");
}

#[test]
fn guides_of_denoisers_are_means_over_the_samples_of_the_picture() {
    // A pixel of which half shows a matte wall, and half a mirror that is turned by 60°.
    let channels = layers(
        r#"{"etendue": 1, "tracer": {"type": "direct"}, "layers": ["mean_albedo", "mean_normal"],
            "render": {"samples": 256},
            "camera": {"type": "orthographic", "height": 1,
                "pose": {"from": [0, 0, 9], "look_at": [0, 0, 0]},
                "sensor": {"resolution": [1, 1]}},
            "materials": {"wall": {"type": "matte", "color": [0.2, 0.4, 0.6]},
                "mirror": {"type": "mirror", "color": [0.9, 0.9, 0.9]}},
            "objects": [{"shape": "rectangle", "width": 0.5, "height": 9, "material": "wall",
                    "transform": {"translate": [-0.25, 0, 0]}},
                {"shape": "rectangle", "width": 1, "height": 9, "material": "mirror",
                    "transform": {"rotate": [0, 1, 0, 60], "translate": [0.25, 0, 0]}}]}"#,
    );
    let guides: Vec<f64> = channels[3..].iter().map(|channel| channel[0]).collect();
    let sine = 60.0_f64.to_radians().sin();
    let expected = [0.6, 0.7, 0.8, 0.5 * sine, 0.0, 0.75];
    for (found, expected) in guides.iter().zip(expected) {
        // Of 256 stratified samples one may lie on the other side of the middle.
        assert!((found - expected).abs() <= 1.0 / 256.0 + 1e-6, "{guides:?}");
    }
}
