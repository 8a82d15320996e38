//! Each decision of the plan against the fuller model, which the scene forces: the same to the bit, or
//! within the error that the decision allows.

use std::path::Path;

use etendue_render::output::Outputs;
use etendue_render::{Plan, Rendered};
use etendue_report::{Decision, DecisionKind, DecisionValue};
use etendue_scene::Scene;
use serde_json::{Value, json};

use crate::steps::{layer, load_json, prepare, trace};

/// A blob with an image on the ground, decided by the words `plan`.
fn scene(folder: &Path, plan: &Value) -> Scene {
    let texels = image::RgbImage::from_fn(64, 64, |x, y| {
        image::Rgb([if (x + y) % 2 == 0 { 0 } else { 255 }, 188, 40])
    });
    texels.save(folder.join("checker.png")).unwrap();
    let scene = json!({
        "tracer": { "type": "path", "max_bounces": 3 }, "layers": ["distance", "normal"], "plan": plan,
        "camera": { "type": "pinhole", "fov": 40, "sensor": { "resolution": [48, 40] },
            "pose": { "from": [0.5, 1, 4], "look_at": [0, 0, 0] } },
        "materials": {
            "image": { "type": "matte", "color": { "image": "checker.png", "repeat": [4, 4] } } },
        "lights": [{ "type": "environment", "radiance": [0.5, 0.5, 0.5] }],
        "objects": [{ "shape": "blob", "triangles": 20000, "seed": 3 },
            { "shape": "rectangle", "width": 6, "height": 6, "material": "image",
              "transform": { "translate": [0, -0.9, 0], "rotate": [1, 0, 0, -90] } }],
        "render": { "samples": 64 },
    });
    load_json(folder, scene)
}

/// The picture with the plan's decision of a kind.
fn rendered(plan: &Value, kind: DecisionKind) -> (Rendered, Decision) {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene(folder.path(), plan);
    let plan = Plan::new(&scene, Outputs::ALL);
    let (accel, images) = prepare(&scene, &plan);
    assert_eq!(accel.report().quality, plan.quality);
    let done = trace(&scene, &plan, &*accel, &images);
    (done, plan.decisions.into_iter().find(|decision| decision.kind == kind).unwrap())
}

fn bits(done: &Rendered) -> Vec<Vec<u64>> {
    let layer = |name| layer(&done.picture, name).into_iter().map(f64::to_bits).collect();
    ["", "Distance", "Normal"].map(layer).into()
}

/// The largest difference of finite numbers, and the root of the mean square, relative to the mean.
fn differ(a: &[f64], b: &[f64]) -> [f64; 2] {
    let pairs: Vec<(f64, f64)> = a
        .iter()
        .copied()
        .zip(b.iter().copied())
        .filter(|(a, b)| a.is_finite() && b.is_finite())
        .collect();
    let mean = pairs.iter().map(|(a, _)| a.abs()).sum::<f64>() / pairs.len() as f64;
    let worst = pairs.iter().map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let square = pairs.iter().map(|(a, b)| (a - b).powi(2)).sum::<f64>() / pairs.len() as f64;
    [worst / mean, square.sqrt() / mean]
}

#[test]
fn the_quality_of_the_build_leaves_the_picture_in_f64_as_it_is() {
    let of = |quality: &str| {
        rendered(
            &json!({ "light_precision": "double", "build_quality": quality }),
            DecisionKind::BuildQuality,
        )
    };
    let (own, decision) =
        rendered(&json!({ "light_precision": "double" }), DecisionKind::BuildQuality);
    assert_eq!((decision.key, decision.is_forced), (Some("plan.build_quality"), false));
    for quality in ["low", "medium", "high"] {
        let (forced, decision) = of(quality);
        assert_eq!(bits(&own), bits(&forced), "{quality}");
        assert!(decision.is_forced && decision.reason.contains("by itself"), "{decision:?}");
        assert_eq!(decision.value, quality.to_owned().into());
    }
}

/// f32 has 24 bits: of numbers as large as the scene, distances are off by some 10⁻⁷ of them. What data
/// layers show is then Embree's own answer, and not the same.
#[test]
#[cfg(feature = "embree")]
fn refinement_is_what_the_plan_takes_and_f32_is_as_near_as_it_may_be() {
    let (own, _) = rendered(&json!({}), DecisionKind::Refinement);
    let (refined, _) = rendered(&json!({ "refine": true }), DecisionKind::Refinement);
    assert_eq!(bits(&own), bits(&refined));
    let (coarse, decision) = rendered(&json!({ "refine": false }), DecisionKind::Refinement);
    assert_eq!((decision.value, decision.is_forced), (DecisionValue::Switch(false), true));
    let [worst, _] = differ(&layer(&own.picture, "Distance"), &layer(&coarse.picture, "Distance"));
    assert!(worst > 1e-9 && worst < 1e-5, "{worst}");
}

/// Light in f32 differs from light in f64 by less than its own noise at so many samples does: the same
/// samples find the same surfaces but at a few edges.
#[test]
#[cfg(feature = "embree")]
fn light_in_f32_is_within_the_noise_of_light_in_f64() {
    let (own, decision) = rendered(&json!({}), DecisionKind::LightPaths);
    assert_eq!((decision.value, decision.is_forced), (DecisionValue::Bits(32), false));
    let (double, decision) =
        rendered(&json!({ "light_precision": "double" }), DecisionKind::LightPaths);
    assert_eq!((decision.value, decision.is_forced), (DecisionValue::Bits(64), true));
    let [_, difference] = differ(&layer(&own.picture, ""), &layer(&double.picture, ""));
    // 64 samples of light with a standard deviation of about its mean: 12 %; a Sobol set has less.
    assert!(difference < 0.03, "{difference}");
}

#[test]
fn without_images_surfaces_have_their_factors() {
    let (own, _) = rendered(&json!({}), DecisionKind::Textures);
    let (full, _) = rendered(&json!({ "textures": true }), DecisionKind::Textures);
    assert_eq!(bits(&own), bits(&full));
    let (plain, decision) = rendered(&json!({ "textures": false }), DecisionKind::Textures);
    assert_eq!(decision.value, DecisionValue::from("without images"));
    assert_eq!(decision.saving.map(|saving| saving.images), Some(Some(1)), "{decision:?}");
    assert_eq!(layer(&own.picture, "Distance"), layer(&plain.picture, "Distance"));
    // The ground's factor is white: its light is at least that of the image everywhere.
    let (own, plain) = (layer(&own.picture, ""), layer(&plain.picture, ""));
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    assert!(mean(&plain) > 1.1 * mean(&own), "{} {}", mean(&plain), mean(&own));
}

/// Means over footprints and samples at points have the same mean over the picture: to the noise of 64
/// samples a pixel, over 1920 of them.
#[test]
fn filtered_images_have_the_mean_of_samples() {
    let (own, decision) = rendered(&json!({}), DecisionKind::TextureFilter);
    assert_eq!((decision.value, decision.is_forced), ("footprint".into(), false));
    let (points, decision) =
        rendered(&json!({ "texture_filter": false }), DecisionKind::TextureFilter);
    assert_eq!((decision.value, decision.is_forced), ("none".into(), true));
    let mean = |done: &Rendered| layer(&done.picture, "").iter().sum::<f64>();
    assert!((mean(&points) / mean(&own) - 1.0).abs() < 0.01, "{} {}", mean(&points), mean(&own));
    assert_ne!(bits(&own), bits(&points));
}
