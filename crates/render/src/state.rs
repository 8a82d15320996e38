//! Data that a frame is rendered from, the scope of a render, and the film that it leaves.

use std::time::Duration;

use etendue_accel::Accel;
use etendue_camera::Camera;
use etendue_report::Refusal;
use etendue_scene::Scene;
use etendue_tracer::LayerSpec;

use crate::Plan;
use crate::checkpoint::Checkpoint;
use crate::error::RenderError;
use crate::film::FilmLayer;
use crate::film_file::{FilmFile, Identity, must_be_whole};
use crate::images::Images;
use crate::other_frame::FollowedFrame;
use crate::output::HeaderEntry;
use crate::shard::Shard;
use crate::stopping::Stopping;
use crate::sum::Sum;
use crate::tile::RayCounts;
use crate::tiles::SamplesTaken;
use crate::watch::Watch;

/// Data made ready for a frame.
#[derive(Debug, Clone, Copy)]
pub struct Prepared<'a> {
    /// The structure over the scene's geometry.
    pub accel: &'a dyn Accel,
    /// The images that the plan wants.
    pub images: &'a Images,
    /// The frames that layers compare this one with; a layer whose frame is not here finds nothing there.
    pub others: &'a [FollowedFrame<'a>],
}

/// The scene, its structure and its images, as they were rendered.
#[derive(Clone, Copy)]
#[expect(missing_debug_implementations, reason = "holds an accelerator")]
pub struct RenderedScene<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Its structure.
    pub accel: &'a dyn Accel,
    /// Its images.
    pub images: &'a Images,
}

/// Scope of a render: which part of it is wanted, and where it is kept on the way.
#[derive(Debug, Clone, Default)]
pub struct RenderState<'a> {
    /// The share of the picture's rows, or of its samples; all of it when absent.
    pub shard: Option<Shard>,
    /// Shares of the samples, which are put together instead of being traced.
    pub shares: &'a [FilmFile],
    /// Checkpoint: where what there is so far is kept, and found again.
    pub checkpoint: Option<Checkpoint>,
    /// Identity of the render, which other shares, and what was kept, must have too.
    pub identity: Identity,
}

impl RenderState<'_> {
    /// Refuses what cannot be kept, or put together.
    pub(crate) fn allows(&self, stopping: Stopping) -> Result<(), RenderError> {
        if !self.shares.is_empty() {
            must_be_whole(self.shares, &self.identity).map_err(Refusal::new)?;
        }
        let is_kept = self.checkpoint.is_some();
        match stopping {
            Stopping::Time(_) if is_kept || self.shard.is_some() => Err(RenderError::timed()),
            _ if stopping.is_adaptive() && is_kept => Err(RenderError::adaptive_checkpoint()),
            _ if stopping.is_adaptive() && self.shard.is_some_and(Shard::is_of_samples) => {
                Err(RenderError::adaptive_shares())
            }
            _ => Ok(()),
        }
    }
}

/// A film with what was traced onto it.
#[derive(Debug)]
pub struct Film {
    pub(crate) layers: Vec<FilmLayer>,
    pub(crate) resolution: [u32; 2],
    pub(crate) shard: Shard,
    pub(crate) counts: RayCounts,
    pub(crate) passed: SamplesTaken,
    pub(crate) trace_time: Duration,
    /// Of a share of the samples, the sums of what is averaged.
    pub(crate) sums: Vec<Vec<Sum>>,
    /// The layers that are not averaged.
    pub(crate) centres: Vec<LayerSpec>,
    pub(crate) notes: Vec<String>,
    /// The camera as it was opened for it.
    pub(crate) camera: Option<Camera>,
}

impl Film {
    /// One on which nothing was traced, without layers, of a share of a picture of so many columns and rows.
    pub(crate) fn without_layers(resolution: [u32; 2], shard: Shard, samples: u32) -> Self {
        Self {
            layers: Vec::new(),
            resolution,
            shard,
            counts: RayCounts::default(),
            passed: SamplesTaken { samples, is_complete: true, counts: None },
            trace_time: Duration::ZERO,
            sums: Vec::new(),
            centres: Vec::new(),
            notes: Vec::new(),
            camera: None,
        }
    }

    /// True if the film has all samples that were wanted: a film of a render that was stopped has not.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.passed.is_complete
    }

    /// Notes on the film for the user.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Wall time of its tracing alone.
    #[must_use]
    pub fn trace_time(&self) -> Duration {
        self.trace_time
    }
}

/// A function that traces a scene as planned, given a header, onto a film.
pub(crate) type TraceFn = fn(
    &Scene,
    &Plan,
    Prepared<'_>,
    &[HeaderEntry],
    &RenderState<'_>,
    &dyn Watch,
) -> Result<Film, RenderError>;
