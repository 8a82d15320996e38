//! Data that layers are filled from, and other frames that they compare a frame with.

use std::fmt::Debug;

use super::pair::FrameStep;
use crate::{LightingContext, SceneView, TracedBatch};

/// Data that layers are filled from: the rays of a batch, what they hit, and the scene.
#[derive(Debug, Clone, Copy)]
pub struct LayerContext<'a> {
    /// The scene.
    pub scene: SceneView<'a>,
    /// The batch.
    pub traced: TracedBatch<'a>,
    /// The scene's light, where it is traced.
    pub light: Option<LightingContext<'a>>,
    /// Columns and rows of the rays on the sensor (pixels from the corner of the top left one); empty where
    /// layers are averaged over samples.
    pub places: [&'a [f64]; 2],
    /// Other frames of the scene, for layers that compare frames.
    pub others: &'a [&'a dyn OtherFrame],
}

/// One number of each ray, as many times as a layer has channels.
pub type Columns = [Vec<f64>; 4];

/// Another frame of the scene, whose camera and objects may be elsewhere.
pub trait OtherFrame: Debug + Sync {
    /// The way to it.
    fn step(&self) -> FrameStep;

    /// Finds where the other camera sees each point that was hit (pixels from the corner of the top left one), objects
    /// having moved: `places` is refilled, with `None` for misses and what has no place there.
    fn follow(&self, seen: &LayerContext<'_>, places: &mut Vec<Option<[f64; 2]>>);

    /// Finds how each of these points is seen there: `sights` is refilled.
    fn look_for(&self, seen: &LayerContext<'_>, sights: &mut Vec<Sight>);
}

/// Visibility of a point of this frame in another one.
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

impl LayerContext<'_> {
    fn other(&self, to: FrameStep) -> Option<&dyn OtherFrame> {
        self.others.iter().copied().find(|other| other.step() == to)
    }

    /// Places of points of this frame in the other, less their places here (pixels); `+inf` for none.
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

    /// Distances that points move to the left on their way to the other frame (pixels); `+inf` for none.
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
