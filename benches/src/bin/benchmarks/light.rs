//! The least that light can take: Embree's bare loop over the rays of a camera with a lens, and over
//! as many rays to a light.

use std::path::Path;

use anyhow::Context;
use etendue_accel::limit::{BareScene, Mode, Packet};
use etendue_accel::{Accel, BuildOptions, Embree};
use etendue_benches::contest::{LimitPackets, Query, thread_time, time};
use etendue_benches::meshes::{self, Random};
use etendue_benches::rays::BATCH;
use etendue_camera::{Camera, CameraRays, FilmSamples};
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Detail, HitBatch, RayBatch};
use etendue_scene::import::Wanted;
use etendue_scene::{LoadOptions, SceneFile};
use etendue_spectrum::Bands;
use serde_json::json;

/// Side of a tile of pixels.
const TILE: u32 = 16;

/// Of how many tiles one is traced; times are scaled up.
const ONE_IN: u32 = 8;

/// Prints as JSON what all cores take for the camera's rays of the scene at `path` over the blob of
/// `triangles`, and for a ray from each hit to `light` (s).
pub(crate) fn print_bound(path: &Path, triangles: u64, light: DVec3) -> anyhow::Result<()> {
    let file = SceneFile::read(path, &[])?;
    let scene = file.load(Wanted::NOTHING, &LoadOptions::default())?;
    let camera = scene.camera.opened(&Bands::Rgb).context("the camera")?;
    let primary = camera_rays(&camera, scene.render.samples.most(), &scene.render);
    let geometry = meshes::blob(triangles)?;
    let accel = Embree::build(geometry.clone(), &BuildOptions::default())?;
    let shadow = rays_to(light, &accel, &primary);
    let bounces = bounces(&accel, &primary);
    let single: Vec<RayBatch> = bounces.iter().flat_map(one_a_batch).collect();
    let [compacted, one_by_one] = [&bounces, &single].map(|rays| traced_in(&accel, rays));
    drop((accel, single));
    let bare = BareScene::build(geometry, Mode::default(), 0)?;
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let seconds = |rays: &[RayBatch], query: Query| {
        let packets = Packet::of(rays);
        let limit = LimitPackets { scene: &bare, packets: &packets, query };
        let mut times: Vec<f64> = (0..5).map(|_| time(&limit, cores, 1)).collect();
        times.sort_by(f64::total_cmp);
        times[2] * f64::from(ONE_IN)
    };
    let count = |rays: &[RayBatch]| rays.len() * BATCH * ONE_IN as usize;
    println!(
        "{}",
        json!({"camera": seconds(&primary, Query::Closest), "camera_rays": count(&primary),
               "shadow": seconds(&shadow, Query::Occluded), "shadow_rays": count(&shadow),
               "compacted": compacted, "one_by_one": one_by_one})
    );
    Ok(())
}

/// The rays of every eighth tile in batches, those of one pixel side by side.
fn camera_rays(
    camera: &Camera,
    samples: u32,
    settings: &etendue_scene::file::RenderSpec,
) -> Vec<RayBatch> {
    let [width, height] = camera.resolution();
    let (mut film, mut rays) = (FilmSamples::default(), CameraRays::default());
    let mut chopped = Chopped::default();
    for (number, (left, top)) in (0_u32..)
        .zip((0..height).step_by(16).flat_map(|y| (0..width).step_by(16).map(move |x| (x, y))))
    {
        // A diagonal pattern, so that all parts of the picture have their share.
        if !(number + 3 * (top / TILE)).is_multiple_of(ONE_IN) {
            continue;
        }
        film.clear();
        for (x, y) in (0..TILE * TILE).map(|k| (left + k % TILE, top + k / TILE)) {
            let numbers = settings.sampler.pixel(settings.seed, x, y, samples);
            for index in 0..samples {
                let [u, v] = numbers.square(index, 0);
                film.push([f64::from(x) + u, f64::from(y) + v], numbers.square(index, 1), 0.5);
            }
        }
        camera.sample_rays(&film, &mut rays);
        for i in 0..rays.rays.len() {
            chopped.push(rays.rays.origin(i), rays.rays.direction(i), f64::INFINITY);
        }
    }
    chopped.batches
}

/// From each hit of `primary` to `light`.
fn rays_to(light: DVec3, accel: &dyn Accel, primary: &[RayBatch]) -> Vec<RayBatch> {
    let mut hits = HitBatch::new(Detail::Distance);
    let mut chopped = Chopped::default();
    for rays in primary {
        accel.closest(rays, &mut hits);
        for i in (0..rays.len()).filter(|&i| hits.is_hit(i)) {
            // A little before the surface, on the camera's side: Embree's f32 knows it no better.
            let from = rays.origin(i) + rays.direction(i) * (hits.t[i] * (1.0 - 1e-5));
            let way = light - from;
            chopped.push(from, way.normalize(), way.length());
        }
    }
    chopped.batches
}

/// From each hit of `primary` anywhere above the surface, as a path goes on.
fn bounces(accel: &dyn Accel, primary: &[RayBatch]) -> Vec<RayBatch> {
    let mut hits = HitBatch::new(Detail::Surface);
    let mut random = Random::new(11);
    let mut chopped = Chopped::default();
    for rays in primary {
        accel.closest(rays, &mut hits);
        for i in (0..rays.len()).filter(|&i| hits.is_hit(i)) {
            let direction = rays.direction(i);
            let normal = hits.normal(i) * -hits.normal(i).dot(direction).signum();
            let up = (normal + random.direction()).try_normalize().unwrap_or(normal);
            // Clear of the surface by about what f64 knows of it.
            let from = rays.origin(i) + direction * hits.t[i] + normal * (1e-12 * hits.t[i]);
            chopped.push(from, up, f64::INFINITY);
        }
    }
    chopped.batches.iter_mut().for_each(|rays| rays.from_surface = true);
    chopped.batches
}

fn one_a_batch(rays: &RayBatch) -> impl Iterator<Item = RayBatch> + '_ {
    // A quarter is enough.
    (0..rays.len()).step_by(4).map(|i| {
        let mut one = RayBatch::default().from_surfaces();
        one.push(rays.origin(i), rays.direction(i));
        one
    })
}

/// Millions of rays a second that one thread traces for closest hits: the median of five.
fn traced_in(accel: &dyn Accel, batches: &[RayBatch]) -> f64 {
    let mut hits = HitBatch::new(Detail::Surface);
    let count: usize = batches.iter().map(RayBatch::len).sum();
    let mut times: Vec<f64> = (0..5)
        .map(|_| {
            let start = thread_time();
            for rays in batches {
                accel.closest(rays, &mut hits);
                std::hint::black_box(&hits);
            }
            thread_time() - start
        })
        .collect();
    times.sort_by(f64::total_cmp);
    count as f64 / times[2] / 1e6
}

/// Rays in full batches; what does not fill one is left out.
#[derive(Default)]
struct Chopped {
    open: RayBatch,
    batches: Vec<RayBatch>,
}

impl Chopped {
    fn push(&mut self, origin: DVec3, direction: DVec3, length: f64) {
        self.open.push_between(origin, direction, 0.0, length);
        if self.open.len() == BATCH {
            self.batches.push(std::mem::take(&mut self.open));
        }
    }
}
