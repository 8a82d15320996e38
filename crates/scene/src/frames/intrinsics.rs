//! Intrinsics of a trajectory's file, as settings of a scene.

use serde_json::{Value, json};

/// A pinhole of focal lengths and principal point (pixels from the corner of the top left one), columns and
/// rows, and distortion.
pub(super) fn pinhole(
    ([fx, fy], [cx, cy]): ([f64; 2], [f64; 2]),
    resolution: [u32; 2],
    distortion: Option<Value>,
) -> Vec<(String, Value)> {
    let k = json!({"fx": fx, "fy": fy, "cx": cx, "cy": cy, "pixel_origin": "corner"});
    let mut settings = vec![
        ("camera.type".to_owned(), json!("pinhole")),
        ("camera.sensor.resolution".to_owned(), json!(resolution)),
        ("camera.intrinsics".to_owned(), k),
    ];
    settings.extend(distortion.map(|distortion| ("camera.distortion".to_owned(), distortion)));
    settings
}
