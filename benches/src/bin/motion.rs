//! `motion ROUNDS STILL MOVING`: what motion costs the caster of rays, and what it costs Embree's own motion blur, for
//! `benches/costs.py time`. The scenes are a room of 2 m that its camera sees from (0, 1, 4.9) m, one whose things stand
//! and one in which they move. All trace the same rays, those of the moving scene at times of its exposure: samples of
//! the camera, directions from where those hit, and rays from there to a lamp. For each kind of rays a line is printed:
//! its name, the ratios of each round of ours, and those of Embree.

use std::hint::black_box;
use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result};
use etendue_accel::limit::{BareScene, Mode, RayHit16, Single};
use etendue_accel::{Accel, BlockAccel, BuildOptions, Embree, build_moving};
use etendue_benches::contest::{
    Contestant, LimitPackets, LimitSingles, Ours, Query, Worker, thread_time, time,
};
use etendue_benches::meshes::Random;
use etendue_benches::rays::{BATCH, View};
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Detail, Geometry, HitBatch, HitPrecision, RayBatch, RayBlocks};
use etendue_scene::{LoadOptions, Scene, SceneFile, Wanted};

/// Of how many batches of the camera's rays one is traced.
const THINNED: usize = 8;

/// Above which a ray leaves the surface that it starts on (m).
const CLEAR: f64 = 1e-5;

/// One of both scenes, for ours and for Embree.
struct Room {
    accel: Box<dyn Accel>,
    bare: BareScene,
}

impl Room {
    fn of(geometry: &Arc<Geometry>, exposure: [f64; 2]) -> Result<Self> {
        let options = BuildOptions { exposure, threads: 1, ..BuildOptions::default() };
        let embree = |geometry, options: &BuildOptions| -> Result<Box<dyn Accel>, _> {
            Ok(Box::new(Embree::build(geometry, options)?))
        };
        let accel = build_moving(Arc::clone(geometry), &options, &embree)?;
        let mode = Mode { quality: options.quality, compact: false };
        Ok(Self { accel, bare: BareScene::build_moving(geometry, exposure, mode, 1)? })
    }
}

fn load(path: &str) -> Result<Scene> {
    let file = SceneFile::read(Path::new(path), &[])?;
    Ok(file.load(Wanted::NOTHING, &LoadOptions::default())?)
}

/// Ours in blocks, as light is traced where it can be.
struct InBlocks<'a> {
    blocks: &'a dyn BlockAccel,
    /// Of each batch.
    rays: Vec<RayBlocks>,
    times: Vec<Vec<f64>>,
    query: Query,
    is_coherent: bool,
}

impl<'a> InBlocks<'a> {
    fn of(blocks: &'a dyn BlockAccel, batches: &[RayBatch], query: Query) -> Self {
        let convert = |rays: &RayBatch| {
            let mut converted = RayBlocks::default();
            blocks.convert(rays, &mut converted);
            converted
        };
        let times = batches.iter().map(|rays| rays.times().to_vec()).collect();
        let is_coherent = batches[0].coherent;
        let rays = batches.iter().map(convert).collect();
        Self { blocks, rays, times, query, is_coherent }
    }
}

/// Ours as light is traced: in blocks, or in batches where there are instances of Embree's.
fn ours<'a>(
    accel: &'a dyn Accel,
    batches: &'a [RayBatch],
    query: Query,
) -> Box<dyn Contestant + 'a> {
    match accel.blocks() {
        Some(blocks) => Box::new(InBlocks::of(blocks, batches, query)),
        None => Box::new(Ours { accel, batches, query }),
    }
}

/// Of the precision of light.
fn light(mut rays: RayBatch, from_surface: bool) -> RayBatch {
    rays.precision = HitPrecision::Single;
    rays.from_surface = from_surface;
    rays
}

impl Contestant for InBlocks<'_> {
    fn rays(&self) -> usize {
        self.rays.len() * BATCH
    }

    fn worker(&self) -> Worker<'_> {
        /// As many as other contestants trace between two looks at the clock.
        const CHUNK: usize = 16;
        let mut records: Vec<RayBlocks> = Vec::new();
        Box::new(move |chunk| {
            let own = chunk * CHUNK..self.rays.len().min((chunk + 1) * CHUNK);
            records.clear();
            records.extend_from_slice(&self.rays[own.clone()]);
            let start = thread_time();
            for (rays, times) in records.iter_mut().zip(&self.times[own]) {
                let rays = rays.blocks_mut();
                match self.query {
                    Query::Closest => {
                        self.blocks.closest_of_blocks(rays, times, self.is_coherent);
                    }
                    Query::Occluded => {
                        self.blocks.occluded_of_blocks(rays, times, self.is_coherent);
                    }
                }
            }
            black_box(&records);
            thread_time() - start
        })
    }
}

/// Directions from where rays hit, and rays from there to a lamp.
fn onward(accel: &dyn Accel, from: &[RayBatch]) -> [Vec<RayBatch>; 2] {
    let lamp = DVec3::new(0.0, 1.95, 0.0);
    let (mut random, mut hits) = (Random::new(5), HitBatch::new(Detail::Surface));
    let mut both = [RayBatch::default(), RayBatch::default()];
    let mut batches = [Vec::new(), Vec::new()];
    for rays in from {
        accel.closest(rays, &mut hits);
        for i in (0..rays.len()).filter(|&i| hits.is_hit(i)) {
            let normal = hits.normal(i);
            let normal = normal * -normal.dot(rays.direction(i)).signum();
            let start = rays.origin(i) + rays.direction(i) * hits.t[i] + normal * CLEAR;
            let along = (normal + random.direction()).normalize();
            both[0].push(start, along);
            let (way, length) = (lamp - start, (lamp - start).length());
            both[1].push_between(start, way / length, 0.0, length);
            if both[0].len() == BATCH {
                for (done, open) in batches.iter_mut().zip(&mut both) {
                    done.push(light(std::mem::take(open), true));
                }
            }
        }
    }
    batches
}

/// The same rays at times of an exposure.
fn at_times(batches: &[RayBatch], [open, close]: [f64; 2]) -> Vec<RayBatch> {
    let mut random = Random::new(11);
    let at = |rays: &RayBatch| {
        let mut rays = rays.clone();
        let count = rays.len();
        rays.set_times((0..count).map(|_| open + (close - open) * random.unit()));
        rays
    };
    batches.iter().map(at).collect()
}

fn main() -> Result<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [rounds, still, moving] = &words[..] else {
        anyhow::bail!("ROUNDS STILL MOVING are wanted");
    };
    let rounds: usize = rounds.parse().context("ROUNDS is no number")?;
    let (still, moving) = (load(still)?, load(moving)?);
    let exposure = moving.camera.exposure_span();
    let rooms = [Room::of(&still.geometry, [0.0; 2])?, Room::of(&moving.geometry, exposure)?];
    let view = View { from: DVec3::new(0.0, 1.0, 4.9), look_at: DVec3::Y, fov: 36.0 };
    let camera = view.samples().into_iter().step_by(THINNED);
    let camera: Vec<RayBatch> = camera.map(|rays| light(rays, false)).collect();
    let [bounces, shadows] = onward(&*rooms[0].accel, &camera);
    let kinds = [
        ("samples of the camera", camera, Query::Closest),
        ("directions from where those hit", bounces, Query::Closest),
        ("rays from there to a lamp", shadows, Query::Occluded),
    ];
    for (name, batches, query) in kinds {
        let sets = [batches.clone(), at_times(&batches, exposure)];
        let packets = sets.each_ref().map(|batches| RayHit16::of(batches));
        let singles = sets.each_ref().map(|batches| Single::of(batches));
        let is_coherent = batches[0].coherent;
        let ours = [0, 1].map(|k| ours(&*rooms[k].accel, &sets[k], query));
        let mut ratios = [Vec::new(), Vec::new()];
        for _ in 0..rounds {
            let mut seconds = [[0.0; 2]; 2];
            for k in 0..2 {
                let scene = &rooms[k].bare;
                let in_packets = LimitPackets { scene, packets: &packets[k], query };
                let one_by_one = LimitSingles { scene, singles: &singles[k], query };
                let limit: &dyn Contestant = if is_coherent { &in_packets } else { &one_by_one };
                seconds[k] = [time(&*ours[k], 1, 1), time(limit, 1, 1)];
            }
            for (who, ratios) in ratios.iter_mut().enumerate() {
                ratios.push(seconds[1][who] / seconds[0][who]);
            }
        }
        println!("{}", serde_json::json!([name, ratios[0], ratios[1]]));
    }
    Ok(())
}
