//! `closest FOLDER`: the ray caster called from Rust, for `benches/python_peers.py`. The folder has the mesh
//! and the rays as plain numbers: `vertices.f64`, `faces.u32`, `origins.f64`, `directions.f64`. For each line
//! on standard input all rays are traced once, and the seconds and the sum of the distances are printed.

#![allow(clippy::disallowed_methods, reason = "it reads what it is told to")]

use std::io::{BufRead, stdin};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use anyhow::{Context, Result};
use etendue_accel::{Accel, BuildOptions, Embree};
use etendue_geometry::{Detail, Geometry, HitBatch, Mesh, RayBatch, Transform};
use rayon::prelude::*;

/// Rays in a batch, as the Python package has it.
const BATCH: usize = 1024;

fn main() -> Result<()> {
    let folder = std::env::args().nth(1).context("a folder is wanted")?;
    let read = |name: &str| std::fs::read(Path::new(&folder).join(name)).context(name.to_owned());
    let rows =
        |name: &str| -> Result<Vec<[f64; 3]>> { Ok(bytemuck::pod_collect_to_vec(&read(name)?)) };
    let faces: Vec<[u32; 3]> = bytemuck::pod_collect_to_vec(&read("faces.u32")?);
    let mesh =
        Mesh::from_arrays("mesh", &rows("vertices.f64")?, &faces).map_err(anyhow::Error::msg)?;
    let geometry = Arc::new(Geometry::alone(mesh, Transform::IDENTITY));
    let accel = Embree::build(geometry, &BuildOptions::default())?;
    let (origins, directions) = (rows("origins.f64")?, rows("directions.f64")?);
    let mut batches: Vec<(RayBatch, HitBatch)> = origins
        .chunks(BATCH)
        .zip(directions.chunks(BATCH))
        .map(|(origins, directions)| {
            let mut rays = RayBatch::with_capacity(BATCH).with_coherence(true);
            for (origin, direction) in origins.iter().zip(directions) {
                rays.push((*origin).into(), (*direction).into());
            }
            (rays, HitBatch::new(Detail::Surface))
        })
        .collect();
    for line in stdin().lock().lines() {
        line?;
        let start = Instant::now();
        batches.par_iter_mut().for_each(|(rays, hits)| accel.closest(rays, hits));
        let seconds = start.elapsed().as_secs_f64();
        let found = batches.iter().flat_map(|(_, hits)| &hits.t).filter(|t| t.is_finite());
        println!("answer: [{seconds}, {}]", found.sum::<f64>());
    }
    Ok(())
}
