//! Checkpoints: what there is of a render, kept on disk on the way: after an interruption it goes
//! on from there. And what there is in shares of its samples.

use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use etendue_files::Transaction;
use etendue_optics::element::StatusCounts;
use etendue_scene::Scene;

use crate::film::FilmLayer;
use crate::film_file::{FilmError, FilmFile, Identity, Writing};
use crate::memory::filled;
use crate::samples::Averaging;
use crate::shard::Shard;
use crate::sum::Sum;
use crate::tile::RayCounts;

/// Place and interval of the checkpoints of a render.
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
        shard: Shard,
        samples: u32,
        scene: &Scene,
    ) -> Self {
        let start = Instant::now();
        let state = Mutex::new(KeeperState { written: start, fault: None });
        let files = Transaction::at_once().keeping(&scene.inputs);
        let resolution = scene.camera.resolution();
        Self { checkpoint, identity, shard, samples, resolution, files, start, state }
    }

    /// Reason why the last checkpoint could not be written, if it could not.
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
            .write(&self.files, &self.checkpoint.path, centres, &sums)
            .err()
            .map(|error| format!("no checkpoint could be kept: {error}"));
        state.written = Instant::now();
    }
}

/// Puts the shares of a render's samples together, in the order of the samples, whatever that of the files
/// is: sums with what rounding took from them, and layers that are not sampled from the first share.
pub(crate) fn put_together(
    shares: &[FilmFile],
    resolution: [u32; 2],
    centres: &mut [&mut FilmLayer],
    averaged: &mut [Averaging<'_>],
) -> Result<RayCounts, FilmError> {
    let counts = Mutex::new(RayCounts::default());
    let mut shares: Vec<&FilmFile> = shares.iter().collect();
    shares.sort_by_key(|share| share.header.shard);
    for share in shares {
        let lengths = averaged.iter().map(|part| part.sums().len());
        let mut own = lengths
            .map(|length| filled(Sum::default(), length))
            .collect::<Result<Vec<_>, _>>()
            .map_err(|error| share.error(error.to_string()))?;
        let mut sums: Vec<&mut [Sum]> = own.iter_mut().map(Vec::as_mut_slice).collect();
        let has_data = share.header.shard.has_data();
        share.fill(if has_data { &mut *centres } else { &mut [] }, &mut sums, resolution)?;
        for (part, own) in averaged.iter_mut().zip(&own) {
            part.sums_mut().iter_mut().zip(own).for_each(|(sum, own)| sum.add_sum(*own));
        }
        RayCounts::add(&counts, share.counts(), &StatusCounts::default());
    }
    Ok(counts.into_inner().unwrap_or_else(PoisonError::into_inner))
}
