//! Progress of work: its observer, and how it is stopped.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use etendue_render::{SoFar, Watch};

/// A phase of the work on a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Phase {
    /// The scene and its models are read.
    Load,
    /// The acceleration structure is built.
    Build,
    /// Rays are traced.
    Render,
    /// Layers are written.
    Write,
    /// The sensor's exposures are made and written.
    Expose,
    /// A light-field camera's views are rendered, decoded and written.
    LightField,
    /// Copies of objects are told apart, and what annotates them is written.
    Annotate,
}

impl Phase {
    /// A word for it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Load => "load",
            Self::Build => "build",
            Self::Render => "render",
            Self::Write => "write",
            Self::Expose => "expose",
            Self::LightField => "views",
            Self::Annotate => "annotate",
        }
    }
}

type OnPhase = dyn Fn(Phase, f64) -> bool + Send + Sync;
type OnLook = dyn Fn(&SoFar<'_>) + Send + Sync;
type OnNote = dyn Fn(&str) + Send + Sync;

/// Progress callbacks, and a flag that stops the work. Clones share the flag, so one of them may cancel
/// from another thread:
///
/// ```
/// let progress = etendue::Progress::none();
/// let other = progress.clone();
/// std::thread::spawn(move || other.cancel()).join().unwrap();
/// assert!(progress.is_cancelled());
/// ```
#[derive(Clone, Default)]
pub struct Progress {
    on_phase: Option<Arc<OnPhase>>,
    on_look: Option<Arc<OnLook>>,
    on_note: Option<Arc<OnNote>>,
    cancelled: Arc<AtomicBool>,
}

impl fmt::Debug for Progress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Progress").field("cancelled", &self.is_cancelled()).finish_non_exhaustive()
    }
}

impl Progress {
    /// Progress of which nobody hears; [`Self::cancel`] stops.
    #[must_use]
    pub fn none() -> Self {
        Self::default()
    }

    /// Calls `on_phase` with the phase and the share of it that is done (0..=1), now and then and from
    /// many threads; answering `false` stops.
    #[must_use]
    pub fn new(on_phase: impl Fn(Phase, f64) -> bool + Send + Sync + 'static) -> Self {
        Self { on_phase: Some(Arc::new(on_phase)), ..Self::default() }
    }

    /// Shows the picture so far to `look` after each pass over its pixels but the last.
    #[must_use]
    pub fn with_looks(mut self, look: impl Fn(&SoFar<'_>) + Send + Sync + 'static) -> Self {
        self.on_look = Some(Arc::new(look));
        self
    }

    /// Calls `note` with each sentence that a user should know, as soon as it is known.
    #[must_use]
    pub fn with_notes(mut self, note: impl Fn(&str) + Send + Sync + 'static) -> Self {
        self.on_note = Some(Arc::new(note));
        self
    }

    /// Stops the work, soon. A render that has samples of every pixel gives what it has; any other
    /// work ends with an error of which [`Error::is_stopped`](crate::Error::is_stopped) is true.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// True if [`Self::cancel`] was called.
    #[must_use]
    pub fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    /// Reports, and answers whether to go on.
    pub(crate) fn goes_on(&self, phase: Phase, share: f64) -> bool {
        let goes_on = self.on_phase.as_ref().is_none_or(|on_phase| on_phase(phase, share));
        goes_on && !self.is_cancelled()
    }

    pub(crate) fn note(&self, note: &str) {
        if let Some(on_note) = &self.on_note {
            on_note(note);
        }
    }

    /// The progress of one phase, for a build.
    pub(crate) fn of(&self, phase: Phase) -> Arc<dyn Fn(f64) -> bool + Send + Sync> {
        let progress = self.clone();
        Arc::new(move |share| progress.goes_on(phase, share))
    }
}

impl Watch for Progress {
    fn goes_on(&self, share: f64) -> bool {
        Self::goes_on(self, Phase::Render, share)
    }

    fn look(&self, so_far: &SoFar<'_>) {
        if let Some(look) = &self.on_look {
            look(so_far);
        }
    }
}
