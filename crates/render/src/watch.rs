//! Observer of a render: told how far it is, shown the picture so far, asked whether to go on.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::output::{Picture, PictureError};

/// Watches a render. A function of the share done is enough for those who only want that.
pub trait Watch: Sync {
    /// Told the share done (0..=1) between batches of samples, from many threads; answering `false`
    /// stops.
    fn goes_on(&self, share: f64) -> bool;

    /// Shown the picture so far when all its pixels have one more pass of their samples and not yet
    /// all; nothing is rendered meanwhile.
    fn look(&self, _so_far: &SoFar<'_>) {}
}

impl<F: Fn(f64) -> bool + Sync> Watch for F {
    fn goes_on(&self, share: f64) -> bool {
        self(share)
    }
}

/// A picture on its way.
#[allow(missing_debug_implementations, reason = "holds a function")]
pub struct SoFar<'a> {
    /// The samples that each pixel has, and is to have.
    pub samples: [u32; 2],
    /// The share of the work that is done.
    pub share: f64,
    pub(crate) picture: &'a dyn Fn() -> Result<Picture, PictureError>,
}

impl SoFar<'_> {
    /// The picture alone, without the layers beside it, marked as partial.
    ///
    /// # Errors
    ///
    /// When it is no picture; a fault of this program.
    pub fn picture(&self) -> Result<Picture, PictureError> {
        (self.picture)()
    }
}

/// The render was stopped before it was done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Stopped;

/// Counts what is done of the work.
pub(crate) struct Watcher<'a> {
    watch: &'a dyn Watch,
    done: AtomicU64,
    total: AtomicU64,
    stopped: AtomicBool,
}

impl<'a> Watcher<'a> {
    /// Of work that has `total` rays of the camera.
    pub(crate) fn new(watch: &'a dyn Watch, total: u64) -> Self {
        Self {
            watch,
            done: AtomicU64::new(0),
            total: AtomicU64::new(total),
            stopped: AtomicBool::new(false),
        }
    }

    /// Counts `rays` more.
    pub(crate) fn did(&self, rays: u64) -> Result<(), Stopped> {
        self.done.fetch_add(rays, Ordering::Relaxed);
        if self.stopped.load(Ordering::Relaxed) {
            return Err(Stopped);
        }
        if self.watch.goes_on(self.share()) {
            return Ok(());
        }
        self.stopped.store(true, Ordering::Relaxed);
        Err(Stopped)
    }

    pub(crate) fn share(&self) -> f64 {
        let (done, total) = (&self.done, &self.total);
        done.load(Ordering::Relaxed) as f64 / total.load(Ordering::Relaxed).max(1) as f64
    }

    /// Corrects the work by what is still to come of it, as a multiple of what is done.
    pub(crate) fn expect_more(&self, multiple: f64) {
        let done = self.done.load(Ordering::Relaxed) as f64;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a forecast")]
        self.expect((done * multiple.clamp(0.0, 1e9)) as u64);
    }

    /// Corrects the work by what is still `to_come` of it, in rays of the camera.
    pub(crate) fn expect(&self, to_come: u64) {
        self.total.store(self.done.load(Ordering::Relaxed) + to_come, Ordering::Relaxed);
    }

    pub(crate) fn watch(&self) -> &'a dyn Watch {
        self.watch
    }
}
