//! Layers of two frames: where what a pixel shows is in another frame of the scene.

use std::borrow::Cow;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The way from a frame to the other one: 1 for the next, −1 for the one before; or to the end or the beginning of its
/// own exposure.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(try_from = "WrittenStep", into = "WrittenStep")]
pub struct FrameStep {
    count: i32,
    along: StepAxis,
}

/// Axis along which the frames of a step are counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum StepAxis {
    /// Time: the same camera of a rig, where there is one.
    Frames,
    /// The cameras of a rig at one moment; frames where there is no rig.
    Cameras,
    /// The exposure of each row of the frame itself: its opening (−1) and its closing (1).
    Exposure,
}

/// A moment of the exposure of each row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RowMoment {
    /// When its shutter opens.
    Open,
    /// When its shutter closes.
    Close,
}

/// A step as files write it: a number, `"open"` or `"close"`, or `{"cameras": 1}`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum WrittenStep {
    /// So many frames on; of `disparity` so many cameras on, where there is a rig.
    Frames(i32),
    /// The same frame, when the shutter of the row opens or closes.
    Moment(RowMoment),
    /// So many cameras of the rig on.
    Cameras {
        /// 1 for the next camera, −1 for the one before.
        cameras: i32,
    },
}

impl FrameStep {
    /// Steps from this frame to the other; not 0.
    #[must_use]
    pub fn count(self) -> i32 {
        self.count
    }

    /// Axis along which they are counted.
    #[must_use]
    pub fn along(self) -> StepAxis {
        self.along
    }

    /// As many steps along the cameras of a rig; the same within an exposure.
    #[must_use]
    pub fn across(self) -> Self {
        match self.along {
            StepAxis::Exposure => self,
            StepAxis::Frames | StepAxis::Cameras => Self { along: StepAxis::Cameras, ..self },
        }
    }

    /// The moment of the frame's own exposure, where it is one.
    #[must_use]
    pub fn moment(self) -> Option<RowMoment> {
        (self.along == StepAxis::Exposure).then_some(match self.count {
            ..0 => RowMoment::Open,
            _ => RowMoment::Close,
        })
    }

    /// The number that is this many steps on from `number`; `None` below 0.
    #[must_use]
    pub fn from(self, number: usize) -> Option<usize> {
        number.checked_add_signed(isize::try_from(self.count).ok()?)
    }

    /// Entry of headers that says which frame it is.
    pub(super) fn meaning(self) -> (&'static str, &'static str) {
        let which = match (self.along, self.count) {
            (StepAxis::Exposure, ..0) => "this one, when the shutter of the row opens",
            (StepAxis::Exposure, _) => "this one, when the shutter of the row closes",
            (StepAxis::Frames, 1) => "the next one",
            (StepAxis::Frames, -1) => "the one before",
            (StepAxis::Frames, 1..) => "as many on as the layer's name says",
            (StepAxis::Frames, _) => "as many back as the layer's name says",
            (StepAxis::Cameras, 1) => "that of the rig's next camera; without a rig the next one",
            (StepAxis::Cameras, -1) => {
                "that of the rig's camera before; without a rig the one before"
            }
            (StepAxis::Cameras, 1..) => {
                "that of the rig's camera as many on as the layer's name says; without a rig as many frames on"
            }
            (StepAxis::Cameras, _) => {
                "that of the rig's camera as many back as the layer's name says; without a rig as many frames \
                 back"
            }
        };
        ("other frame", which)
    }

    /// `name` with the step: `Flow`, `FlowBack`, `Flow2`, `FlowBack2`; `FlowCamera` and so on along cameras; `FlowOpen`
    /// and `FlowClose`.
    pub(super) fn name(self, name: &'static str) -> Cow<'static, str> {
        let along = match self.along {
            StepAxis::Frames => "",
            StepAxis::Cameras => "Camera",
            StepAxis::Exposure if self.count < 0 => return format!("{name}Open").into(),
            StepAxis::Exposure => return format!("{name}Close").into(),
        };
        match self.count {
            1 if along.is_empty() => name.into(),
            1 => format!("{name}{along}").into(),
            -1 => format!("{name}{along}Back").into(),
            step if step > 0 => format!("{name}{along}{step}").into(),
            step => format!("{name}{along}Back{}", step.unsigned_abs()).into(),
        }
    }
}

impl Default for FrameStep {
    fn default() -> Self {
        Self { count: 1, along: StepAxis::Frames }
    }
}

impl From<FrameStep> for WrittenStep {
    fn from(step: FrameStep) -> Self {
        match step.along {
            StepAxis::Frames => Self::Frames(step.count),
            StepAxis::Cameras => Self::Cameras { cameras: step.count },
            StepAxis::Exposure if step.count < 0 => Self::Moment(RowMoment::Open),
            StepAxis::Exposure => Self::Moment(RowMoment::Close),
        }
    }
}

impl TryFrom<WrittenStep> for FrameStep {
    type Error = &'static str;

    fn try_from(written: WrittenStep) -> Result<Self, Self::Error> {
        let (count, along) = match written {
            WrittenStep::Frames(count) => (count, StepAxis::Frames),
            WrittenStep::Cameras { cameras } => (cameras, StepAxis::Cameras),
            WrittenStep::Moment(RowMoment::Open) => (-1, StepAxis::Exposure),
            WrittenStep::Moment(RowMoment::Close) => (1, StepAxis::Exposure),
        };
        match count {
            0 => Err("`to` is 0: a frame does not move against itself; 1 is the next frame"),
            count => Ok(Self { count, along }),
        }
    }
}
