//! A film as a file of a share, and a film of all shares.

use std::path::Path;
use std::sync::{Mutex, PoisonError};

use etendue_files::Transaction;
use etendue_optics::element::StatusCounts;
use etendue_report::Refusal;
use etendue_scene::Scene;

use crate::Plan;
use crate::adaptive::SampleCounts;
use crate::error::RenderError;
use crate::film::FilmLayer;
use crate::film_file::{FilmFile, Identity, Writing, must_be_whole};
use crate::output::OutputError;
use crate::render::empty_film;
use crate::shard::Shard;
use crate::state::Film;
use crate::tile::RayCounts;
use crate::tiles::SamplesTaken;

impl Film {
    /// Writes it to a file: which render it is of, and how that was asked for, goes with it.
    ///
    /// # Errors
    ///
    /// When the file cannot be written.
    pub fn write(
        &self,
        files: &Transaction,
        path: &Path,
        identity: &Identity,
        origin: &serde_json::Value,
    ) -> Result<(), OutputError> {
        let (shard, sums) = (self.shard, &self.sums);
        let is_written = |layer: &&FilmLayer| match shard.is_of_samples() {
            true => shard.has_data() && self.centres.contains(&layer.spec),
            false => true,
        };
        let layers: Vec<&FilmLayer> = self.layers.iter().filter(is_written).collect();
        let writing = Writing {
            identity,
            origin,
            shard,
            samples: self.passed.samples,
            sample_counts: self.passed.counts,
            counts: &self.counts,
            trace_time: self.trace_time,
            resolution: self.resolution,
        };
        writing.write(files, path, &layers, &sums.iter().map(Vec::as_slice).collect::<Vec<_>>())
    }

    /// Puts the shares of a render's rows together.
    ///
    /// # Errors
    ///
    /// When one is of another render, is there twice, or is missing.
    pub fn merged(
        scene: &Scene,
        plan: &Plan,
        shares: &[FilmFile],
        identity: &Identity,
    ) -> Result<Self, RenderError> {
        let resolution = scene.camera.resolution();
        let mut layers = empty_film(scene, plan)?;
        must_be_whole(shares, identity).map_err(Refusal::new)?;
        let counts = Mutex::new(RayCounts::default());
        // Each fills its own pixels, or adds its own samples.
        for share in shares {
            share.fill(&mut layers.iter_mut().collect::<Vec<_>>(), &mut [], resolution)?;
            RayCounts::add(&counts, share.counts(), &StatusCounts::default());
        }
        let counts = counts.into_inner().unwrap_or_else(PoisonError::into_inner);
        // Samples by pixel, where the shares counted them.
        let of_pixels = shares.iter().filter_map(|share| share.header.sample_counts);
        let of_pixels = of_pixels.reduce(SampleCounts::and);
        // Those that every pixel has, whoever counted them: slots of an exposure tell no more than that.
        let samples = shares.iter().map(|share| share.header.samples).fold(plan.samples, u32::min);
        let passed = SamplesTaken { samples, is_complete: true, counts: of_pixels };
        Ok(Self {
            layers,
            resolution,
            shard: Shard::ALL,
            counts,
            passed,
            sums: Vec::new(),
            centres: Vec::new(),
            trace_time: shares.iter().map(FilmFile::trace_time).sum(),
            notes: Vec::new(),
            camera: None,
        })
    }
}
