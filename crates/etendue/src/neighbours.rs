//! The other frames that layers of a frame compare it with.

use std::collections::BTreeSet;
use std::sync::Arc;

use etendue_accel::Accel;
use etendue_camera::TruthAt;
use etendue_render::FollowedFrame;
use etendue_render::output::HeaderEntry;
use etendue_scene::{Frame, Scene};
use etendue_tracer::LayerSpec;
use etendue_tracer::layer::{FrameStep, RowMoment, StepAxis};

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

/// The frame itself at the moments of its exposure that its layers compare it with.
pub(crate) fn moments(scene: &Scene) -> Vec<Neighbour> {
    let moment = |step: FrameStep| {
        let truth_at = match step.moment()? {
            RowMoment::Open => TruthAt::Open,
            RowMoment::Close => TruthAt::Close,
        };
        let mut then = scene.clone();
        then.camera = then.camera.with_truth_at(truth_at);
        Some(Neighbour { step, scene: Arc::new(then), accel: None })
    };
    steps(&scene.layers).into_iter().filter_map(moment).collect()
}

/// The frames that are these steps away from frame `number`, as far as there are such.
pub(crate) fn in_steps<'f>(
    frames: &'f [Frame],
    number: usize,
    steps: &BTreeSet<FrameStep>,
) -> Vec<(FrameStep, &'f Frame)> {
    let Some(shown) = frames.get(number) else { return Vec::new() };
    let frame = |&step: &FrameStep| Some((step, frames.get(target(shown, step)?)?));
    steps.iter().filter(|step| step.moment().is_none()).filter_map(frame).collect()
}

/// The number of the frame that is a step away from `frame`, if the rig has such a camera.
fn target(frame: &Frame, step: FrameStep) -> Option<usize> {
    let Some(rig) = &frame.rig else { return step.from(frame.number) };
    let (moment, camera) = match step.along() {
        StepAxis::Frames => (step.from(rig.moment)?, rig.camera),
        StepAxis::Cameras => {
            (rig.moment, step.from(rig.camera).filter(|camera| *camera < rig.count)?)
        }
        StepAxis::Exposure => return None,
    };
    moment.checked_mul(rig.count)?.checked_add(camera)
}

/// Refuses layers that compare frames further apart than any of the scene's are.
pub(crate) fn refuse_far(scene: &Scene, frames: &[Frame]) -> Result<(), Error> {
    let rig = frames.first().and_then(|frame| frame.rig.as_ref());
    let extent = |step: &FrameStep| match (rig, step.along()) {
        (None, _) => (frames.len(), "the scene's frames"),
        (Some(rig), StepAxis::Frames) => (frames.len() / rig.count, "the rig's moments"),
        (Some(rig), StepAxis::Cameras | StepAxis::Exposure) => (rig.count, "the rig's cameras"),
    };
    let is_far = |step: &FrameStep| {
        step.moment().is_none() && step.count().unsigned_abs() as usize >= extent(step).0
    };
    match steps(&scene.layers).into_iter().find(is_far) {
        Some(step) => {
            let (count, what) = extent(&step);
            Err(Error::Refused(format!(
                "{}: layers: `to`: {} leads out of {what}, which are 0..{count}, from each of them\nhint: name a \
                 nearer one, or leave the layer out",
                scene.path.display(),
                step.count()
            )))
        }
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

    /// Entry in the header of files that tells which frame it was.
    pub(crate) fn header(&self) -> Result<HeaderEntry, Error> {
        let way = if self.step.count() > 0 { "on" } else { "back" };
        let along = match self.step.along() {
            StepAxis::Frames => "",
            StepAxis::Cameras => "camera_",
            StepAxis::Exposure => "exposure_",
        };
        let key = format!("scene_hash_{along}{}_{way}", self.step.count().unsigned_abs());
        Ok(HeaderEntry { key, text: self.scene.hash()?.to_string() })
    }
}

/// A camera that has no one place for a point, and moments of an exposure that has several cameras.
pub(crate) fn refuse_views(scene: &Scene) -> Result<(), Error> {
    if scene.slots > 0
        && scene.layers.iter().any(|layer| layer.step().is_some_and(|to| to.moment().is_some()))
    {
        return Err(Error::Refused(format!(
            "{}: layers: `to`: \"open\" and \"close\" are moments of one camera's exposure\nhint: leave them out, or `serial`",
            scene.path.display()
        )));
    }
    let is_views = scene.camera.opencv().projection == etendue_camera::ProjectionName::Views;
    match scene.layers.iter().any(|layer| layer.step().is_some()) && is_views {
        true => Err(Error::Refused(format!(
            "{}: layers: flow, disparity and occlusion want a camera that shows a point in one place; a \
             light_field_reference shows it in every view\nhint: leave these layers out, or take another camera",
            scene.path.display()
        ))),
        false => Ok(()),
    }
}
