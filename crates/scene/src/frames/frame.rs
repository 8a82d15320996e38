//! A frame: what is set for a picture of a scene; and the poses that frames are made of.

use std::collections::BTreeMap;

use etendue_camera::{CameraSpec, Convention, Maps, Pose, PoseSpec};
use etendue_geometry::glam::DVec3;
use serde_json::Value;

use crate::Scene;
use crate::file::ScenePath;
use crate::import::Note;

/// The most frames of a scene. All are made before the first is shown, of a few kilobytes each.
pub(super) const MOST_FRAMES: usize = 100_000;

/// One picture of a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Its number, from 0.
    pub number: usize,
    /// Time of the frame (s), where the scene says.
    pub time: Option<f64>,
    /// Settings of the frame: paths of the scene and values.
    pub settings: Vec<(String, Value)>,
    /// Camera of a rig that takes the frame, where there is one.
    pub rig: Option<RigCamera>,
}

impl Frame {
    /// True if the frame sets some of the scene's keys `roots`, or what is inside of them.
    #[must_use]
    pub fn sets(&self, roots: &[&str]) -> bool {
        let is_in =
            |path: &String| ScenePath::of(path).root().is_some_and(|it| roots.contains(&it));
        self.settings.iter().any(|(path, _)| is_in(path))
    }
}

/// A camera of a rig, at a moment of the rig's path.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RigCamera {
    /// The number of the moment, from 0.
    pub moment: usize,
    /// The number of the camera, from 0.
    pub camera: usize,
    /// Number of cameras of the rig. The frame's number is `moment × count + camera`.
    pub count: usize,
    /// Name of the camera in the scene.
    pub name: Option<String>,
}

/// The pictures of a scene, in order.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Frames {
    /// One a picture.
    pub frames: Vec<Frame>,
    /// Notes on the file that the frames come from.
    pub notes: Vec<Note>,
}

/// Starting values of the camera's paths.
#[derive(Debug, Clone, PartialEq)]
pub struct Start {
    /// The scene's own camera.
    pub pose: Pose,
    /// The middle of the scene's box (m).
    pub center: DVec3,
    /// The cameras of the models.
    pub cameras: Vec<CameraSpec>,
}

impl Start {
    /// Of a scene that is loaded.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        Self {
            pose: *scene.camera.pose(),
            center: scene.geometry.loose_bounds().centre(),
            cameras: scene.cameras.iter().map(|camera| camera.spec.clone()).collect(),
        }
    }
}

/// A frame for each entry of a list.
pub(crate) fn listed(list: &[BTreeMap<String, Value>]) -> Vec<Frame> {
    let frame = |(number, settings): (usize, &BTreeMap<String, Value>)| Frame {
        number,
        time: None,
        settings: settings.iter().map(|(k, v)| (k.clone(), v.clone())).collect(),
        rig: None,
    };
    list.iter().enumerate().map(frame).collect()
}

pub(super) fn too_many(count: usize) -> String {
    format!("{count} frames; {MOST_FRAMES} are the most")
}

/// A pose of a trajectory, with what else its file says.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Station {
    pub(super) pose: PoseSpec,
    pub(super) time: Option<f64>,
    /// More settings, such as intrinsics.
    pub(super) settings: Vec<(String, Value)>,
}

/// Meaning of the numbers of poses in files that do not say it.
#[derive(Debug, Clone, Copy)]
pub(super) struct PoseAxes {
    pub(super) maps: Maps,
    pub(super) convention: Convention,
}

impl Station {
    pub(super) fn new(pose: PoseSpec) -> Self {
        Self { pose, time: None, settings: Vec::new() }
    }

    /// Of a matrix by rows of four numbers; the last of its four rows may be missing.
    pub(super) fn of_rows(numbers: &[f64], PoseAxes { maps, convention }: PoseAxes) -> Self {
        let mut matrix = [[0.0, 0.0, 0.0, 1.0]; 4];
        for (row, numbers) in matrix.iter_mut().zip(numbers.chunks_exact(4)) {
            row.copy_from_slice(numbers);
        }
        Self::new(PoseSpec::Matrix { matrix, maps, convention })
    }
}
