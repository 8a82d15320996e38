//! Nerfstudio's `transforms.json` (<https://docs.nerf.studio/quickstart/data_conventions.html>): camera-to-world
//! matrices with OpenGL's axes, intrinsics for all frames or for each.

use etendue_camera::{Convention, Maps, PoseSpec};
use serde::Deserialize;
use serde_json::{Map, Value, json};

use super::Station;
use super::intrinsics::pinhole;

#[derive(Deserialize)]
struct Transforms {
    #[serde(flatten)]
    all: Map<String, Value>,
    frames: Vec<OneFrame>,
}

#[derive(Deserialize)]
struct OneFrame {
    transform_matrix: [[f64; 4]; 4],
    #[serde(flatten)]
    own: Map<String, Value>,
}

pub(super) fn read(text: &str) -> Result<Vec<Station>, String> {
    let file: Transforms = serde_json::from_str(text)
        .map_err(|error| format!("is no transforms.json of nerfstudio: {error}"))?;
    let station = |(number, frame): (usize, &OneFrame)| {
        let value = |key: &str| frame.own.get(key).or_else(|| file.all.get(key));
        let settings = settings(&value).map_err(|why| format!("has a frame {number} {why}"))?;
        let pose = PoseSpec::Matrix {
            matrix: frame.transform_matrix,
            maps: Maps::WorldFromCamera,
            convention: Convention::Opengl,
        };
        let time = value("time").and_then(Value::as_f64);
        Ok(Station { pose, time, settings })
    };
    file.frames.iter().enumerate().map(station).collect()
}

/// Intrinsics as settings; none where the file has none.
fn settings<'v>(value: &dyn Fn(&str) -> Option<&'v Value>) -> Result<Vec<(String, Value)>, String> {
    let number = |key: &str| value(key).and_then(Value::as_f64);
    let Some(fx) = number("fl_x") else { return Ok(Vec::new()) };
    let fy = number("fl_y").unwrap_or(fx);
    // Intrinsics, with the centre in the middle unless it is given.
    let side = |key: &str| {
        let side = value(key).and_then(Value::as_u64).and_then(|side| u32::try_from(side).ok());
        side.ok_or_else(|| format!("with a focal length and without its size \"{key}\""))
    };
    let resolution = [side("w")?, side("h")?];
    let [width, height] = resolution.map(f64::from);
    let centre = [number("cx").unwrap_or(0.5 * width), number("cy").unwrap_or(0.5 * height)];
    // Distortion by the name of the camera model; terms that are zero are left out.
    let model = value("camera_model").and_then(Value::as_str).unwrap_or("OPENCV");
    let of = |keys: &[&'static str]| -> Vec<(&'static str, f64)> {
        keys.iter()
            .filter_map(|key| Some((*key, number(key)?)))
            .filter(|(_, k)| *k != 0.0)
            .collect()
    };
    let (kind, coefficients) = match model {
        "OPENCV" | "PINHOLE" | "SIMPLE_PINHOLE" => {
            ("brown_conrady", of(&["k1", "k2", "p1", "p2", "k3"]))
        }
        "OPENCV_FISHEYE" => ("fisheye", of(&["k1", "k2", "k3", "k4"])),
        other => {
            return Err(format!(
                "with the camera model \"{other}\"; known: OPENCV, OPENCV_FISHEYE, PINHOLE, SIMPLE_PINHOLE"
            ));
        }
    };
    let needed = kind == "fisheye" || !coefficients.is_empty();
    let distortion = needed.then(|| {
        let mut distortion = json!({ "type": kind });
        coefficients.iter().for_each(|(key, k)| distortion[*key] = json!(k));
        distortion
    });
    Ok(pinhole(([fx, fy], centre), resolution, distortion))
}
