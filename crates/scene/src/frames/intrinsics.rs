//! Intrinsics of a trajectory's file, as settings of a scene.

use serde_json::{Value, json};

/// A pinhole camera that a trajectory's file describes.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct FileCamera {
    /// Focal lengths along rows and columns (pixels).
    pub(super) focal: [f64; 2],
    /// The principal point (pixels from the corner of the top left one).
    pub(super) centre: [f64; 2],
    /// Columns and rows; the scene's own when absent.
    pub(super) resolution: Option<[u32; 2]>,
    /// Distortion in the words of a scene.
    pub(super) distortion: Option<Value>,
}

impl FileCamera {
    /// Settings of a scene that make its camera this one.
    ///
    /// # Errors
    ///
    /// When a focal length or a side is not above 0; the sentence goes on after what has them.
    pub(super) fn settings(&self) -> Result<Vec<(String, Value)>, String> {
        let [fx, fy] = self.focal;
        if !self.focal.iter().all(|focal| *focal > 0.0 && focal.is_finite()) {
            return Err(format!("the focal lengths {fx} and {fy} px; both must be above 0"));
        }
        if let Some([width, height]) = self.resolution.filter(|sides| sides.contains(&0)) {
            return Err(format!("{width} x {height} pixels; both must be at least 1"));
        }
        let [cx, cy] = self.centre;
        let k = json!({"fx": fx, "fy": fy, "cx": cx, "cy": cy, "pixel_origin": "corner"});
        let mut settings = vec![("camera.type".to_owned(), json!("pinhole"))];
        let resolution = self.resolution.map(|sides| json!(sides));
        settings.extend(resolution.map(|sides| ("camera.sensor.resolution".to_owned(), sides)));
        settings.push(("camera.intrinsics".to_owned(), k));
        let distortion = self.distortion.clone();
        settings.extend(distortion.map(|distortion| ("camera.distortion".to_owned(), distortion)));
        Ok(settings)
    }
}

/// Distortion in the words of a scene: `kind`, and coefficients by their names.
pub(super) fn distortion<'a>(
    kind: &str,
    coefficients: impl IntoIterator<Item = (&'a str, f64)>,
) -> Value {
    let mut distortion = json!({ "type": kind });
    coefficients.into_iter().for_each(|(key, k)| distortion[key] = json!(k));
    distortion
}
