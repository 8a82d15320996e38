//! Frames of what models bring along: moments of their animations, and their cameras.

use etendue_camera::CameraSpec;
use serde_json::{Value, json};

use super::{Frame, MOST_FRAMES};
use crate::file::{AnimationSpec, CameraPath, ObjectSpec, SceneFile, Source, join, join_index};
use etendue_geometry::units::Seconds;

/// Frames a second where the scene does not say.
const RATE: f64 = 24.0;

/// What a last moment may lie beyond the end, as a share of a frame: times are written in decimals.
const ROUNDING: f64 = 1e-6;

/// A frame for each moment of an animation; the error has the key that is wrong.
pub(super) fn frames(
    file: &SceneFile,
    path: &CameraPath,
) -> Result<Vec<Frame>, (&'static str, String)> {
    let CameraPath::Animation { times, start, end, rate, name, objects } = path else {
        return Ok(Vec::new());
    };
    let times = match (times, end) {
        (Some(times), None) if start.is_none() && rate.is_none() => {
            times.iter().map(|time| time.0).collect()
        }
        (None, Some(end)) => moments(start.map_or(0.0, |start| start.0), end.0, *rate)?,
        _ => return Err(("times", "either `times` or `end` is wanted".to_owned())),
    };
    let objects = moving(file, objects.as_deref())?;
    let frame = |(number, time): (usize, f64)| {
        let moment = AnimationSpec { time: Seconds(time), name: name.clone() };
        // Numbers and words always serialise.
        let value = serde_json::to_value(&moment).unwrap_or_default();
        let setting =
            |object: &usize| (join(&join_index("objects", *object), "animation"), value.clone());
        Frame {
            number,
            time: Some(time),
            settings: objects.iter().map(setting).collect(),
            rig: None,
        }
    };
    Ok(times.into_iter().enumerate().map(frame).collect())
}

fn moments(start: f64, end: f64, rate: Option<f64>) -> Result<Vec<f64>, (&'static str, String)> {
    let rate = rate.unwrap_or(RATE);
    if !(rate > 0.0 && rate.is_finite()) {
        return Err(("rate", format!("{rate} frames a second; a number above 0 is wanted")));
    }
    if end < start {
        return Err(("end", format!("{end} s is before the start, {start} s")));
    }
    let steps = ((end - start) * rate + ROUNDING).floor();
    if steps >= MOST_FRAMES as f64 {
        return Err(("end", format!("{steps} frames; {MOST_FRAMES} are the most")));
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to MOST_FRAMES")]
    let steps = steps as u32;
    Ok((0..=steps).map(|i| start + f64::from(i) / rate).collect())
}

/// The numbers of the objects that move.
fn moving(
    file: &SceneFile,
    wanted: Option<&[usize]>,
) -> Result<Vec<usize>, (&'static str, String)> {
    let objects = &file.spec.objects;
    let is_gltf = |object: &ObjectSpec| match &object.source {
        Source::File(path) => {
            let path = path.to_ascii_lowercase();
            path.ends_with(".gltf") || path.ends_with(".glb")
        }
        Source::Shape(_) => false,
    };
    match wanted {
        Some(wanted) => match wanted.iter().find(|&&i| !objects.get(i).is_some_and(is_gltf)) {
            Some(wrong) => Err(("objects", format!("objects[{wrong}] is no glTF file"))),
            None => Ok(wanted.to_vec()),
        },
        None => {
            let all: Vec<usize> =
                (0..objects.len()).filter(|&i| objects.get(i).is_some_and(is_gltf)).collect();
            match all.is_empty() {
                true => {
                    Err(("type", "no object is a glTF file, which could be animated".to_owned()))
                }
                false => Ok(all),
            }
        }
    }
}

/// A frame for each camera of the models. Of the scene's own camera the sensor is kept, where it has one.
pub(super) fn cameras(
    file: &SceneFile,
    cameras: &[CameraSpec],
) -> Result<Vec<Frame>, (&'static str, String)> {
    if cameras.is_empty() {
        return Err(("type", "no model of the scene has a camera".to_owned()));
    }
    let sensor = file.value().pointer("/camera/sensor").cloned();
    let frame = |(number, camera): (usize, &CameraSpec)| {
        let camera: Value = serde_json::to_value(camera).unwrap_or_else(|_| json!({}));
        let mut settings = vec![("camera".to_owned(), camera)];
        settings.extend(sensor.clone().map(|sensor| ("camera.sensor".to_owned(), sensor)));
        Frame { number, time: None, settings, rig: None }
    };
    Ok(cameras.iter().enumerate().map(frame).collect())
}
