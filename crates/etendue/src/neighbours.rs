//! The other frames that layers of a frame compare it with.

use std::collections::BTreeSet;
use std::sync::Arc;

use etendue_accel::Accel;
use etendue_render::FollowedFrame;
use etendue_scene::{Frame, Scene};
use etendue_tracer::LayerSpec;
use etendue_tracer::layer::FrameStep;

use crate::Error;

/// Another frame of the scene, loaded.
#[derive(Debug)]
pub(crate) struct Neighbour {
    pub(crate) step: FrameStep,
    pub(crate) scene: Arc<Scene>,
    /// The structure over it, once it is built.
    pub(crate) accel: Option<Arc<dyn Accel>>,
}

/// The steps to other frames that `layers` want.
pub(crate) fn steps(layers: &[LayerSpec]) -> BTreeSet<FrameStep> {
    layers.iter().filter_map(|layer| layer.step()).collect()
}

/// The frames that are these steps away from frame `number`, as far as there are such.
pub(crate) fn around<'f>(
    frames: &'f [Frame],
    number: usize,
    steps: &BTreeSet<FrameStep>,
) -> Vec<(FrameStep, &'f Frame)> {
    let frame = |&step: &FrameStep| Some((step, frames.get(step.from(number)?)?));
    steps.iter().filter_map(frame).collect()
}

/// Refuses layers that compare frames further apart than any of the scene's `count` frames are.
pub(crate) fn refuse_far(scene: &Scene, count: usize) -> Result<(), Error> {
    let is_far = |step: &FrameStep| step.frames().unsigned_abs() as usize >= count;
    match steps(&scene.layers).into_iter().find(is_far) {
        Some(step) => Err(Error::Refused(format!(
            "{}: layers: `to`: {} leads out of the scene's frames, which are 0..{count}, from each of \
             them: name a nearer frame, or leave the layer out",
            scene.path.display(),
            step.frames()
        ))),
        None => Ok(()),
    }
}

/// Leaves out the layers of `scene` that compare it with a frame which is not there, unless it has no others:
/// then its picture is one of misses, and that is the note.
#[must_use]
pub(crate) fn leave_out(
    scene: &mut Scene,
    shown: Option<usize>,
    neighbours: &[Neighbour],
) -> Option<String> {
    let is_there = |step| neighbours.iter().any(|neighbour| neighbour.step == step);
    let is_kept = |layer: &LayerSpec| layer.step().is_none_or(is_there);
    if scene.layers.iter().any(is_kept) {
        scene.layers.retain(is_kept);
        return None;
    }
    let number = shown.filter(|_| !scene.layers.is_empty())?;
    Some(format!(
        "frame {number}: the scene has no frame that its layers could compare it with; all of it is a miss"
    ))
}

impl Neighbour {
    /// The frame as a render follows what `scene` shows to it.
    pub(crate) fn followed<'n>(&'n self, scene: &Scene) -> Option<FollowedFrame<'n>> {
        Some(FollowedFrame::new(self.step, scene, &self.scene, self.accel.as_deref()?))
    }

    /// What tells, in the header of files, which frame it was.
    pub(crate) fn header(&self) -> Result<(String, String), Error> {
        let (frames, way) = match self.step.frames() {
            on if on > 0 => (on.unsigned_abs(), "on"),
            back => (back.unsigned_abs(), "back"),
        };
        let key = format!("scene_hash_{frames}_{way}");
        Ok((key, self.scene.hash()?.to_string()))
    }
}

/// A camera that has no one place for a point.
pub(crate) fn refuse_views(scene: &Scene) -> Result<(), Error> {
    let is_views = scene.camera.opencv().projection == etendue_camera::ProjectionName::Views;
    match scene.layers.iter().any(|layer| layer.step().is_some()) && is_views {
        true => Err(Error::Refused(format!(
            "{}: layers: flow, disparity and occlusion want a camera that shows a point in one place; a \
             light_field_reference shows it in every view",
            scene.path.display()
        ))),
        false => Ok(()),
    }
}
