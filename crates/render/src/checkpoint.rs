//! What there is of a render, kept on disk on the way: after an interruption it goes on from there.

use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use etendue_files::Transaction;
use etendue_scene::Scene;

use crate::film::FilmLayer;
use crate::film_file::{FilmError, FilmFile, Identity, Writing};
use crate::samples::{Averaging, Sum};
use crate::shard::Shard;
use crate::tiles::RayCounts;

/// Where what a render has so far is kept, and how often.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Checkpoint {
    /// The file.
    pub path: PathBuf,
    /// The least time between two writes.
    pub every: Duration,
}

/// Keeps what a render has so far, and finds it again.
pub(crate) struct Keeper<'a> {
    pub(crate) checkpoint: &'a Checkpoint,
    pub(crate) identity: &'a Identity,
    pub(crate) shard: Shard,
    /// Samples of each pixel that are wanted.
    samples: u32,
    pub(crate) resolution: [u32; 2],
    files: Transaction,
    start: Instant,
    state: Mutex<KeeperState>,
}

struct KeeperState {
    written: Instant,
    fault: Option<String>,
}

impl<'a> Keeper<'a> {
    pub(crate) fn new(
        checkpoint: &'a Checkpoint,
        identity: &'a Identity,
        (shard, samples): (Shard, u32),
        scene: &Scene,
    ) -> Self {
        let start = Instant::now();
        let state = Mutex::new(KeeperState { written: start, fault: None });
        let files = Transaction::at_once().keeping(&scene.inputs);
        let resolution = scene.camera.resolution();
        Self { checkpoint, identity, shard, samples, resolution, files, start, state }
    }

    /// Why the last checkpoint could not be written, if it could not.
    pub(crate) fn fault(&self) -> Option<String> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).fault.clone()
    }

    /// Puts back what was kept; `None` when nothing was.
    pub(crate) fn restore(
        &self,
        centres: &mut [&mut FilmLayer],
        averaged: &mut [Averaging<'_>],
    ) -> Result<Option<(u32, RayCounts)>, FilmError> {
        if !self.checkpoint.path.exists() {
            return Ok(None);
        }
        let file = FilmFile::read(&self.checkpoint.path)?;
        let remedy =
            |error: FilmError| error.with_remedy("remove it, or write into another folder");
        file.must_be_of(self.identity).map_err(remedy)?;
        if file.header.shard != self.shard {
            let why = format!("is of share {}, and this is {}", file.header.shard, self.shard);
            return Err(remedy(file.error(why)));
        }
        let kept = file.header.samples;
        if kept > self.samples {
            let why = format!("has {kept} samples a pixel, and {} are asked for", self.samples);
            return Err(file.error(why).with_remedy("ask for as many or more, or remove it"));
        }
        let mut sums: Vec<&mut [Sum]> = averaged.iter_mut().map(Averaging::sums_mut).collect();
        file.fill(centres, &mut sums, self.resolution)?;
        Ok(Some((file.header.samples, file.counts())))
    }

    /// Keeps what every pixel has now, unless that was done a short time ago.
    pub(crate) fn keep(
        &self,
        samples: u32,
        centres: &[&FilmLayer],
        averaged: &[Averaging<'_>],
        counts: &RayCounts,
    ) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        if state.written.elapsed() < self.checkpoint.every {
            return;
        }
        let writing = Writing {
            identity: self.identity,
            origin: &serde_json::Value::Null,
            shard: self.shard,
            samples,
            sample_counts: None,
            counts,
            trace_time: self.start.elapsed(),
            resolution: self.resolution,
        };
        let sums: Vec<&[Sum]> = averaged.iter().map(Averaging::sums).collect();
        // The render is worth more than its checkpoint: what is wrong is told in the end.
        state.fault = writing
            .write((&self.files, &self.checkpoint.path), centres, &sums)
            .err()
            .map(|error| format!("no checkpoint could be kept: {error}"));
        state.written = Instant::now();
    }
}
