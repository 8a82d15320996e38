//! Rigs: several cameras that hold on to each other, at every moment of other frames.

use etendue_camera::{Convention, Pose, PoseSpec};
use etendue_geometry::glam::{DMat3, DVec3};

use super::path::spec_of;
use super::{Frame, MOST_FRAMES, RigCamera, too_many};
use crate::file::{RigCameraSpec, SceneFile, join, join_index};

/// Where a scene lists the cameras.
const CAMERAS: &str = "frames.cameras";

/// The most cameras of a rig.
const MOST_CAMERAS: usize = 10_000;

/// A frame for each camera at each of `moments`; the error has the place that is wrong. `start` is where the rig
/// stands at moments that do not move it.
pub(super) fn frames(
    file: &SceneFile,
    cameras: &[RigCameraSpec],
    moments: &[Frame],
    start: &Pose,
) -> Result<Vec<Frame>, (String, String)> {
    let count = cameras.len();
    if count == 0 || count > MOST_CAMERAS {
        let why = format!("{count} cameras; a rig has 1 to {MOST_CAMERAS}");
        return Err((CAMERAS.to_owned(), why));
    }
    if count.saturating_mul(moments.len()) > MOST_FRAMES {
        return Err((CAMERAS.to_owned(), too_many(count.saturating_mul(moments.len()))));
    }
    let places = (0..).zip(cameras).map(|(i, camera)| {
        place(camera).map_err(|(key, why)| (join(&join_index(CAMERAS, i), key), why))
    });
    let places = places.collect::<Result<Vec<Pose>, _>>()?;
    let mut frames = Vec::with_capacity(count * moments.len());
    for moment in moments {
        let in_path = |why| ("frames.path".to_owned(), format!("frame {}: {why}", moment.number));
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

/// Where a camera is in its rig.
fn place(camera: &RigCameraSpec) -> Result<Pose, (&'static str, String)> {
    let RigCameraSpec { at, pose, settings, .. } = camera;
    if let Some(path) = settings.keys().find(|path| path.starts_with("camera.pose")) {
        return Err((
            "settings",
            format!("{path} is where the rig stands; set `at` or `pose` instead"),
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
            let pose =
                spec.build().map_err(|error| ("pose", format!("{}: {}", error.at, error.why)))?;
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

/// Where the rig stands at a moment.
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
    spec.build().map_err(|error| format!("{}: {}", error.at, error.why))
}
