//! Paths of a camera that formulas make.
//!
//! Frames of what models bring along: moments of their animations, and their cameras.
//!
//! Rigs: several cameras that hold on to each other, at every moment of other frames.

use std::f64::consts::TAU;

use serde_json::{Value, json};

use super::frame::{Frame, MOST_FRAMES, RigCamera, Start, Station, too_many};
use crate::file::{
    AnimationSpec, CameraPath, ObjectSpec, RigCameraSpec, SceneFile, ScenePath, Source,
};
use etendue_camera::{CameraSpec, Convention, Maps, Pose, PoseSpec};
use etendue_geometry::glam::{DMat3, DQuat, DVec3};
use etendue_geometry::units::Seconds;

/// The stations of a path; the error has the key that is wrong.
pub(super) fn made(
    path: &CameraPath,
    start: &Start,
) -> Result<Vec<Station>, (&'static str, String)> {
    let poses = match path {
        CameraPath::Orbit { count, center, axis, angle } => {
            let center = center.map_or(start.center, DVec3::from);
            let axis = DVec3::from(*axis)
                .try_normalize()
                .ok_or_else(|| ("axis", "the axis has no direction".to_owned()))?;
            let count = some("count", *count)?;
            let whole = angle.0.to_radians();
            // A full turn would show its first picture twice.
            let is_closed = (whole.abs() / TAU).fract() == 0.0;
            let steps = if is_closed { count } else { (count - 1).max(1) };
            let turned = |i: u32| {
                let turn = DQuat::from_axis_angle(axis, whole * f64::from(i) / f64::from(steps));
                Pose {
                    rotation: DMat3::from_quat(turn) * start.pose.rotation,
                    position: center + turn * (start.pose.position - center),
                }
            };
            (0..count).map(turned).collect()
        }
        CameraPath::Dolly { count, to, look_at } => {
            let count = some("count", *count)?;
            let at = |i: u32| -> Result<Pose, (&'static str, String)> {
                let share = f64::from(i) / f64::from((count - 1).max(1));
                let position = start.pose.position.lerp(DVec3::from(*to), share);
                match look_at {
                    None => Ok(Pose { position, ..start.pose }),
                    Some(target) => Pose::look_at(position, DVec3::from(*target), start.pose.up())
                        .ok_or_else(|| {
                            ("look_at", format!("frame {i} would stand in it, or look up"))
                        }),
                }
            };
            (0..count).map(at).collect::<Result<Vec<_>, _>>()?
        }
        CameraPath::Grid { columns, rows, spacing } => {
            let (columns, rows) = (some("columns", *columns)?, some("rows", *rows)?);
            let count = columns as usize * rows as usize;
            if count > MOST_FRAMES {
                return Err(("columns", too_many(count)));
            }
            let offset = |i: u32, of: u32| (f64::from(i) - 0.5 * f64::from(of - 1)) * spacing.0;
            let right = |column: u32| start.pose.right() * offset(column, columns);
            let down = |row: u32| -start.pose.up() * offset(row, rows);
            let all = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
            all.map(|(row, column)| Pose {
                position: start.pose.position + right(column) + down(row),
                ..start.pose
            })
            .collect()
        }
        CameraPath::Poses { .. }
        | CameraPath::Trajectory { .. }
        | CameraPath::Animation { .. }
        | CameraPath::Cameras {}
        | CameraPath::Rig { .. } => Vec::new(),
    };
    Ok(poses.into_iter().map(|pose| Station::new(spec_of(&pose))).collect())
}

fn some(key: &'static str, count: u32) -> Result<u32, (&'static str, String)> {
    match count {
        0 => Err((key, "at least one frame is needed".to_owned())),
        count if count as usize > MOST_FRAMES => Err((key, too_many(count as usize))),
        count => Ok(count),
    }
}

/// A pose in the words of a scene file.
pub(super) fn spec_of(pose: &Pose) -> PoseSpec {
    let matrix = pose.world_from_camera(Convention::Opengl).transpose().to_cols_array_2d();
    PoseSpec::Matrix { matrix, maps: Maps::WorldFromCamera, convention: Convention::Opengl }
}

/// Frames a second where the scene does not say.
const RATE: f64 = 24.0;

/// Tolerance of a last moment beyond the end, as a share of a frame: times are written in decimals.
const ROUNDING: f64 = 1e-6;

/// A frame for each moment of an animation; the error has the key that is wrong.
pub(super) fn animation_frames(
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
        let setting = |object: &usize| {
            let own = file.spec.objects.get(*object).and_then(|spec| spec.animation.as_ref());
            let plays = own.is_some_and(|own| own.plays);
            let moment = AnimationSpec { time: Seconds(time), name: name.clone(), plays };
            // Numbers and words always serialise.
            let value = serde_json::to_value(&moment).unwrap_or_default();
            (ScenePath::of("objects").index(*object).key("animation").to_string(), value)
        };
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

/// Place in a scene that lists the cameras.
const CAMERAS: &str = "frames.cameras";

/// The most cameras of a rig.
const MOST_CAMERAS: usize = 10_000;

/// A frame for each camera at each of `moments`; the error has the place that is wrong. `start` is where the rig
/// stands at moments that do not move it.
pub(super) fn rig_frames(
    file: &SceneFile,
    cameras: &[RigCameraSpec],
    moments: &[Frame],
    start: &Pose,
) -> Result<Vec<Frame>, (ScenePath, String)> {
    let count = cameras.len();
    if count == 0 || count > MOST_CAMERAS {
        let why = format!("{count} cameras; a rig has 1 to {MOST_CAMERAS}");
        return Err((CAMERAS.into(), why));
    }
    if count.saturating_mul(moments.len()) > MOST_FRAMES {
        return Err((CAMERAS.into(), too_many(count.saturating_mul(moments.len()))));
    }
    let places = (0..).zip(cameras).map(|(i, camera)| {
        place(camera).map_err(|(key, why)| (ScenePath::of(CAMERAS).index(i).join(key), why))
    });
    let places = places.collect::<Result<Vec<Pose>, _>>()?;
    let mut frames = Vec::with_capacity(count * moments.len());
    for moment in moments {
        let in_path = |why| ("frames.path".into(), format!("frame {}: {why}", moment.number));
        let rig = pose_at(file, moment, start).map_err(in_path)?;
        for (camera, place) in places.iter().enumerate() {
            let pose = Pose {
                rotation: rig.rotation * place.rotation,
                position: rig.position + rig.rotation * place.position,
            };
            let mut settings = moment.settings.clone();
            let own = cameras[camera].settings.iter().map(|(k, v)| (k.clone(), v.clone()));
            settings.extend(own);
            // A pose is made of numbers and words only, which always serialise.
            let pose = serde_json::to_value(spec_of(&pose)).unwrap_or_default();
            settings.push(("camera.pose".to_owned(), pose));
            let rig = RigCamera {
                moment: moment.number,
                camera,
                count,
                name: cameras[camera].name.clone(),
            };
            frames.push(Frame {
                number: frames.len(),
                time: moment.time,
                settings,
                rig: Some(rig),
            });
        }
    }
    Ok(frames)
}

/// Pose of a camera in its rig.
fn place(camera: &RigCameraSpec) -> Result<Pose, (&'static str, String)> {
    let RigCameraSpec { at, pose, settings, .. } = camera;
    if let Some(path) = settings.keys().find(|path| path.starts_with("camera.pose")) {
        return Err((
            "settings",
            format!("{path} is where the rig stands\nhint: set `at` or `pose` instead"),
        ));
    }
    match (at, pose) {
        (Some(_), Some(_)) => Err(("at", "is given beside `pose`, which has a place".to_owned())),
        (at, None) => {
            let position = DVec3::from(at.unwrap_or_default());
            let fault = || ("at", "is not finite".to_owned());
            position.is_finite().then_some(Pose { position, ..Pose::IDENTITY }).ok_or_else(fault)
        }
        (None, Some(spec)) => {
            let pose = spec.build().map_err(|error| ("pose", error.under("pose").to_string()))?;
            Ok(match spec {
                PoseSpec::Matrix { convention: Convention::Opencv, .. }
                | PoseSpec::Quaternion { convention: Convention::Opencv, .. } => {
                    // The rig's axes, too, are those of the convention.
                    let flip = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
                    Pose { rotation: flip * pose.rotation, position: flip * pose.position }
                }
                PoseSpec::LookAt { .. } | PoseSpec::Matrix { .. } | PoseSpec::Quaternion { .. } => {
                    pose
                }
            })
        }
    }
}

/// Pose of the rig at a moment.
fn pose_at(file: &SceneFile, moment: &Frame, start: &Pose) -> Result<Pose, String> {
    let moves = |(path, _): &&(String, _)| path == "camera" || path.starts_with("camera.pose");
    let value = match moment.settings.iter().rev().find(moves) {
        None => return Ok(*start),
        Some((path, value)) if path == "camera.pose" => value.clone(),
        Some(_) => {
            let shown = file.at(moment).map_err(|error| error.to_string())?;
            let pose = shown.value().pointer("/camera/pose").cloned();
            pose.ok_or("its camera has no pose; a rig wants one")?
        }
    };
    let spec: PoseSpec = serde_json::from_value(value).map_err(|error| error.to_string())?;
    spec.build().map_err(|error| error.under("pose").to_string())
}
