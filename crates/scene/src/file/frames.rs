//! `frames`, many pictures of one scene, and `serial`, the slots of one exposure, as the file writes them.

use std::collections::BTreeMap;

use etendue_camera::{Convention, Maps, PoseSpec};
use etendue_geometry::units::{Degrees, Metres, Seconds};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// The pictures of one scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum FramesSpec {
    /// Settings of each frame: paths of the scene and their values, as `{"camera.f_number": 2.8}`.
    List(Vec<BTreeMap<String, Value>>),
    /// A path of the camera.
    Path(CameraPath),
}

/// A path of the camera, which starts from the scene's own pose where it needs one; or of animated models.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum CameraPath {
    /// Around a point.
    Orbit {
        /// The number of frames.
        count: u32,
        /// The point (m); the middle of the scene's box when absent.
        #[serde(default)]
        center: Option<[f64; 3]>,
        /// The axis, around which positive angles turn counter-clockwise as seen from its end.
        #[serde(default = "up")]
        axis: [f64; 3],
        /// The angle of the whole path; a full turn ends one step before its start.
        #[serde(default = "full_turn")]
        angle: Degrees,
    },
    /// Along a straight line.
    Dolly {
        /// The number of frames, the first where the camera stands and the last at `to`.
        count: u32,
        /// The position of the last frame (m).
        to: [f64; 3],
        /// A point that stays in the middle of the picture (m); the camera does not turn when absent.
        #[serde(default)]
        look_at: Option<[f64; 3]>,
    },
    /// Side by side without turning, row by row from the top left as seen along the view: a pair for
    /// stereo, or an array of cameras. The scene's own pose is in its middle.
    Grid {
        /// Cameras in a row.
        columns: u32,
        /// Rows.
        #[serde(default = "one")]
        rows: u32,
        /// From one camera to the next: the baseline.
        spacing: Metres,
    },
    /// Poses in the scene file.
    Poses {
        /// One a frame.
        poses: Vec<PoseSpec>,
        /// When each was taken; absent when nobody knows.
        #[serde(default)]
        times: Option<Vec<Seconds>>,
    },
    /// Moments of the animations of glTF files: of nodes with all that hangs on them, cameras among it.
    Animation {
        /// The moments, one a frame.
        #[serde(default)]
        times: Option<Vec<Seconds>>,
        /// Without `times`: the first moment.
        #[serde(default)]
        start: Option<Seconds>,
        /// The last moment, as far as the rate meets it.
        #[serde(default)]
        end: Option<Seconds>,
        /// Frames a second; 24 when absent.
        #[serde(default)]
        rate: Option<f64>,
        /// Name of one of a file's animations, or its number from 0; the first when absent.
        #[serde(default)]
        name: Option<String>,
        /// The objects that move, by number from 0; all of glTF files when absent.
        #[serde(default)]
        objects: Option<Vec<usize>>,
    },
    /// The cameras that models bring along, one a frame, in the order of their nodes.
    Cameras {},
    /// Several cameras that hold on to each other, such as a pair for stereo, moved as one: a frame for each camera
    /// at each moment, all cameras of the first moment first. `disparity` compares with the next camera of the rig,
    /// `flow` and `occlusion` with the same camera at the next moment, unless `to` says otherwise.
    Rig {
        /// The cameras.
        cameras: Vec<RigCameraSpec>,
        /// Pose of the rig at each moment: any other frames. What these make the camera's pose is the rig's.
        path: Box<FramesSpec>,
    },
    /// Poses of a file: `.npy` of n × 4 × 4 or n × 3 × 4 matrices; TUM's `timestamp tx ty tz qx qy qz qw`;
    /// KITTI's twelve numbers of `[R | t]` a line; COLMAP's `images.txt` or `images.bin`, with the intrinsics of the
    /// `cameras.txt` or `cameras.bin` beside it; `transforms.json` of nerfstudio, instant-ngp and NeRF's synthetic
    /// scenes.
    Trajectory {
        /// The file, relative to the scene file.
        file: String,
        /// Format of the file; known by its name when absent, and of `.txt` by its first line.
        #[serde(default)]
        format: Option<TrajectoryFormat>,
        /// Direction in which the poses map, of NPY, TUM and KITTI files; camera to world when absent.
        #[serde(default)]
        maps: Option<Maps>,
        /// The camera's axes, of NPY, TUM and KITTI files; OpenCV's when absent.
        #[serde(default)]
        convention: Option<Convention>,
    },
}

/// A camera of a rig. Without `at` and `pose` it stands where the rig does, and looks that way.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RigCameraSpec {
    /// Name in `index.json`.
    pub name: Option<String>,
    /// Its place in the rig: to the right, up and back (m). It looks the rig's way.
    pub at: Option<[f64; 3]>,
    /// Its pose in the rig, whose frame takes the world's place: instead of `at`. The rig's axes are the camera's
    /// of the same `convention`.
    pub pose: Option<PoseSpec>,
    /// Settings of its frames, as in a list of frames: `{"camera.fov": 90}`.
    pub settings: BTreeMap<String, Value>,
}

/// A format of trajectories.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TrajectoryFormat {
    /// An array of numpy's.
    Npy,
    /// The TUM RGB-D benchmark's text.
    Tum,
    /// The text of KITTI's odometry benchmark.
    Kitti,
    /// COLMAP's model, as text or binary.
    Colmap,
    /// `transforms.json` of nerfstudio, instant-ngp or NeRF.
    Nerfstudio,
}

fn up() -> [f64; 3] {
    [0.0, 1.0, 0.0]
}

fn full_turn() -> Degrees {
    Degrees(360.0)
}

fn one() -> u32 {
    1
}

/// A part of the exposure, with what is set for it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SlotSpec {
    /// When it starts (s from its row's opening); when the slot before it ends, if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<Seconds>,
    /// Duration (s); when absent, an equal share of what slots with durations leave of the exposure.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub duration: Option<Seconds>,
    /// Share of the slot's light that each pixel takes, 0 to 1; all of it when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pixels: Option<PixelsSpec>,
    /// Settings of it: paths of `camera`, `lights`, `objects` or `materials` and their values, as
    /// `{"camera.pose": …}`. The sensor and the shutter are those of the exposure.
    pub set: BTreeMap<String, Value>,
    /// Frames that are spread over it, each for an equal share: a list of settings, `poses` or a `trajectory`, as `frames`
    /// has them. Times of poses do not count.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub along: Option<FramesSpec>,
}

/// Share of a slot's light that each pixel takes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum PixelsSpec {
    /// A grey picture (PNG or EXR) of the sensor's columns and rows, relative to the scene file.
    File(String),
    /// Rows of a tile that is repeated over the sensor from its top left pixel on.
    Tile(Vec<Vec<f64>>),
}

/// The texts in what a frame or a slot sets: among them are names of files.
#[must_use]
pub fn texts_of(value: &Value) -> Vec<&str> {
    match value {
        Value::String(text) => vec![text],
        Value::Array(list) => list.iter().flat_map(texts_of).collect(),
        Value::Object(members) => members.values().flat_map(texts_of).collect(),
        Value::Null | Value::Bool(_) | Value::Number(_) => Vec::new(),
    }
}
