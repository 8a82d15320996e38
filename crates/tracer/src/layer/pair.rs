//! Layers of two frames: where what a pixel shows is in another frame of the scene.

use std::borrow::Cow;
use std::fmt::Debug;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Columns, Seen};

/// How many frames on the other frame is: 1 for the next, −1 for the one before.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(try_from = "i32", into = "i32")]
pub struct FrameStep(i32);

impl FrameStep {
    /// Frames from this one to the other; not 0.
    #[must_use]
    pub fn frames(self) -> i32 {
        self.0
    }

    /// The number of the other frame, as seen from frame `number`; `None` before the first.
    #[must_use]
    pub fn from(self, number: usize) -> Option<usize> {
        number.checked_add_signed(isize::try_from(self.0).ok()?)
    }

    /// Which frame it is, as headers say it.
    pub(super) fn meaning(self) -> (&'static str, &'static str) {
        let which = match self.0 {
            1 => "the next one",
            -1 => "the one before",
            step if step > 0 => "as many on as the layer's name says",
            _ => "as many back as the layer's name says",
        };
        ("other frame", which)
    }

    /// `name` with the step: `Flow`, `FlowBack`, `Flow2`, `FlowBack2`.
    pub(super) fn name(self, name: &'static str) -> Cow<'static, str> {
        match self.0 {
            1 => name.into(),
            -1 => format!("{name}Back").into(),
            step if step > 0 => format!("{name}{step}").into(),
            step => format!("{name}Back{}", step.unsigned_abs()).into(),
        }
    }
}

impl Default for FrameStep {
    fn default() -> Self {
        Self(1)
    }
}

impl From<FrameStep> for i32 {
    fn from(step: FrameStep) -> Self {
        step.0
    }
}

impl TryFrom<i32> for FrameStep {
    type Error = &'static str;

    fn try_from(frames: i32) -> Result<Self, Self::Error> {
        match frames {
            0 => Err("`to` is 0: a frame does not move against itself; 1 is the next frame"),
            frames => Ok(Self(frames)),
        }
    }
}

/// Another frame of the scene, whose camera and objects may be elsewhere.
pub trait OtherFrame: Debug + Sync {
    /// How many frames on it is.
    fn step(&self) -> FrameStep;

    /// Where the other camera sees each point that was hit (pixels from the corner of the top left one),
    /// objects having moved: `places` is refilled, with `None` for misses and what has no place there.
    fn follow(&self, seen: &Seen<'_>, places: &mut Vec<Option<[f64; 2]>>);

    /// How each of these points is seen there: `sights` is refilled.
    fn look_for(&self, seen: &Seen<'_>, sights: &mut Vec<Sight>);
}

/// How another frame sees a point of this one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sight {
    /// There is no point.
    Miss,
    /// It is in the picture, and nothing is before it.
    Visible,
    /// Something is before it.
    Hidden,
    /// It is beyond the picture's edge, or behind the camera.
    Outside,
}

impl Seen<'_> {
    fn other(&self, to: FrameStep) -> Option<&dyn OtherFrame> {
        self.others.iter().copied().find(|other| other.step() == to)
    }

    /// Where points of this frame are in the other, less where they are here (pixels); `+inf` for none.
    pub(super) fn flows(&self, to: FrameStep, out: &mut Columns) {
        let mut places = Vec::new();
        if let Some(other) = self.other(to) {
            other.follow(self, &mut places);
        }
        let [columns, rows] = self.places;
        self.each(out, |i| match places.get(i).copied().flatten() {
            Some([column, row]) => [column - columns[i], row - rows[i]],
            None => [f64::INFINITY; 2],
        });
    }

    /// How far points move to the left on their way to the other frame (pixels); `+inf` for none.
    pub(super) fn disparities(&self, to: FrameStep, out: &mut Columns) {
        self.flows(to, out);
        out[0].iter_mut().filter(|flow| flow.is_finite()).for_each(|flow| *flow = -*flow);
    }

    /// 1 where the other frame does not see the point: hidden, and outside.
    pub(super) fn occlusions(&self, to: FrameStep, out: &mut Columns) {
        let mut sights = Vec::new();
        if let Some(other) = self.other(to) {
            other.look_for(self, &mut sights);
        }
        let is = |i: usize, sight| f64::from(u8::from(sights.get(i) == Some(&sight)));
        self.each(out, |i| [is(i, Sight::Hidden), is(i, Sight::Outside)]);
    }
}
