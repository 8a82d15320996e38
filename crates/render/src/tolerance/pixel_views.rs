//! Views of a camera from places of its picture: where their rays run, in pixels, at any depth.
//!
//! A ray is a straight line, so where it meets the plane at the depth z is, in tangents from the entrance
//! pupil, a + b/z: its slope, and its offset in the pupil's plane over the depth. The mean and the variance
//! of a pixel's rays at every depth follow from their moments, and nothing is traced twice.
//!
//! Beside it the depths of the scene where the camera looks.

use super::small_things::PictureGrid;
use super::taken::Place;
use etendue_accel::Accel;
use etendue_camera::{Camera, CameraRays, FilmSamples, Pose, Sampler};
use etendue_geometry::glam::{DVec2, DVec3};
use etendue_geometry::{Detail, HitBatch, RayBatch};
use etendue_scene::Scene;
use etendue_spectrum::Bands;
use etendue_tracer::LightKind;
use etendue_tracer::light::EnvironmentImage;

/// View from one place.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PlaceView {
    /// The chief ray; `None` where the camera sees nothing.
    pub(super) chief: Option<LightRay>,
    /// The light of each band.
    pub(super) bands: Vec<BandRays>,
}

/// A straight line: its slope, and its offset (m) in the entrance pupil's plane. x right, y down.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct LightRay {
    slope: DVec2,
    offset: DVec2,
}

/// A line with the weight of its light.
struct WeightedRay {
    ray: LightRay,
    weight: f64,
}

/// The rays of a band that arrive.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct BandRays {
    /// Light of the picture for a radiance of 1.
    pub(super) light: f64,
    /// Their mean.
    middle: LightRay,
    /// The variances of slope and offset, and their covariance, over both axes together.
    spread: [f64; 3],
}

impl LightRay {
    /// Returns its place at a depth whose inverse (1/m) is given, in tangents.
    pub(super) fn at(&self, nearness: f64) -> DVec2 {
        self.slope + self.offset * nearness
    }

    /// A ray of the world in the camera's frame; `None` for one that does not run forwards.
    fn of(pose: &Pose, origin: DVec3, direction: DVec3) -> Option<Self> {
        let turn = pose.rotation.transpose();
        let (o, d) = (turn * (origin - pose.position), turn * direction);
        if d.z >= 0.0 {
            return None;
        }
        let slope = DVec2::new(d.x, -d.y) / -d.z;
        let offset = DVec2::new(o.x, -o.y) + slope * o.z;
        Some(Self { slope, offset })
    }
}

impl BandRays {
    /// Of weighted lines, `count` rays having been sent.
    fn of(lines: &[WeightedRay], count: usize) -> Self {
        let sum: f64 = lines.iter().map(|line| line.weight).sum();
        if sum <= 0.0 {
            return Self::default();
        }
        let mean = |of: &dyn Fn(&LightRay) -> DVec2| {
            lines.iter().map(|line| of(&line.ray) * line.weight).sum::<DVec2>() / sum
        };
        let middle =
            LightRay { slope: mean(&|line| line.slope), offset: mean(&|line| line.offset) };
        let spread = lines.iter().fold([0.0; 3], |[a, b, c], WeightedRay { ray, weight }| {
            let (slope, offset) = (ray.slope - middle.slope, ray.offset - middle.offset);
            [
                a + weight * slope.length_squared() / sum,
                b + weight * offset.length_squared() / sum,
                c + weight * slope.dot(offset) / sum,
            ]
        });
        Self { light: sum / count as f64, middle, spread }
    }

    /// The middle of its light at a nearness (1/m), in tangents; `None` in the dark.
    pub(super) fn centroid(&self, nearness: f64) -> Option<DVec2> {
        (self.light > 0.0).then(|| self.middle.at(nearness))
    }

    /// The root of the mean squared distance from there, in tangents.
    pub(super) fn blur(&self, nearness: f64) -> f64 {
        let [slope, offset, both] = self.spread;
        (slope + nearness * (2.0 * both + nearness * offset)).max(0.0).sqrt()
    }
}

impl PlaceView {
    /// The middle of the light of all bands together, each counted alike.
    pub(super) fn centroid(&self, nearness: f64) -> Option<DVec2> {
        let lit: Vec<DVec2> =
            self.bands.iter().filter_map(|band| band.centroid(nearness)).collect();
        (!lit.is_empty()).then(|| lit.iter().sum::<DVec2>() / lit.len() as f64)
    }
}

/// The chief rays of `camera` from `places`; `None` where it sees nothing.
pub(super) fn chief_rays(camera: &Camera, places: &[Place]) -> Vec<Option<LightRay>> {
    let (columns, rows): (Vec<f64>, Vec<f64>) =
        places.iter().map(|place| (place.column, place.row)).unzip();
    let mut rays = RayBatch::default();
    camera.rays_through(&columns, &rows, &mut rays);
    let line = |i: usize| {
        let line = || LightRay::of(camera.pose(), rays.origin(i), rays.direction(i));
        (rays.t_max()[i] >= 0.0).then(line).flatten()
    };
    (0..places.len()).map(line).collect()
}

/// View of `camera`, opened for `bands`, from each of `places` in the bands that are `chosen`, by
/// `rays` of each band or group of bands; by one where it has no pupil.
pub(super) fn seen(
    camera: &Camera,
    bands: &Bands,
    chosen: &[usize],
    places: &[Place],
    rays: u32,
) -> Vec<PlaceView> {
    // Without a pupil all rays of a place are one.
    let rays = if camera.has_pupil() { rays } else { 1 };
    let groups = camera.band_groups(bands);
    let mut samples = FilmSamples::default();
    let mut out = CameraRays::default();
    let mut all = Vec::with_capacity(places.len());
    for (place, chief) in places.iter().zip(chief_rays(camera, places)) {
        let mut seen = PlaceView { chief, bands: Vec::new() };
        // The same places of the pupil for every camera, and everywhere.
        let points = Sampler::Sobol.pixel(0, 0, 0, rays);
        for (number, group) in groups.iter().enumerate() {
            let of_group = chosen.iter().filter(|band| group.bands.contains(band)).count();
            if of_group == 0 {
                continue;
            }
            samples.clear();
            samples.group = number;
            for k in 0..rays {
                let [spectrum, _] = points.square(k, 2);
                samples.push([place.column, place.row], points.square(k, 1), spectrum);
            }
            camera.sample_rays(&samples, &mut out);
            let lines: Vec<WeightedRay> = (0..out.rays.len())
                .filter_map(|k| {
                    let (origin, direction) = (out.rays.origin(k), out.rays.direction(k));
                    let ray = LightRay::of(camera.pose(), origin, direction)?;
                    Some(WeightedRay { ray, weight: out.weight[k] })
                })
                .collect();
            let band = BandRays::of(&lines, rays as usize);
            seen.bands.extend(std::iter::repeat_n(band, of_group));
        }
        all.push(seen);
    }
    all
}

/// Chief rays across each cell of the field, at least.
const ACROSS: u32 = 8;

/// Pixels between them, where there may be so many.
const STEP: f64 = 2.0;

/// Places of the picture, each with the depths (m) that its neighbourhood shows: the nearest, the middle one
/// and the farthest; infinity where an environment's image is seen. A place whose neighbourhood shows nothing
/// has none. Things that these rays may pass by are looked for by their boxes. `most_across` is how many chief rays are sent across a neighbourhood, at most.
pub(super) fn places(
    scene: &Scene,
    accel: &dyn Accel,
    size: [u32; 2],
    most_across: u32,
) -> Vec<Place> {
    let [width, height] = scene.camera.resolution().map(f64::from);
    let [columns, rows] = size;
    let share = |i: u32, count: u32| f64::from(i) / f64::from(count - 1);
    let is_pictured = |kind: &LightKind| matches!(kind, LightKind::Environment { image, .. } if *image != EnvironmentImage::Constant);
    let sees_infinity = scene.lights.iter().any(|light| is_pictured(&light.kind));
    let mut places = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let at = [share(column, columns) * width, share(row, rows) * height];
            let size = [width / f64::from(columns - 1), height / f64::from(rows - 1)];
            let depths = depths_in_cell(&scene.camera, accel, at, size, most_across, sees_infinity);
            places.push(Place { column: at[0], row: at[1], depths });
        }
    }
    let step = [width / f64::from(columns - 1), height / f64::from(rows - 1)];
    let across = step.map(|side| side / f64::from(rays_across(side, most_across)));
    let cells = PictureGrid {
        count: size.map(|count| count as usize),
        step,
        ray_step: across[0].max(across[1]),
    };
    cells.look_for_small(&scene.geometry, accel, &scene.camera, &mut places);
    places
}

/// Even rays across a cell of so many pixels.
fn rays_across(side: f64, most: u32) -> u32 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "it saturates")]
    let wanted = (side / STEP).ceil() as u32;
    wanted.clamp(ACROSS, most.max(ACROSS))
}

/// The depths (m) in a cell of the picture of a middle and a size (pixels).
fn depths_in_cell(
    camera: &Camera,
    accel: &dyn Accel,
    middle: [f64; 2],
    size: [f64; 2],
    most_across: u32,
    sees_infinity: bool,
) -> Vec<f64> {
    let picture = camera.resolution().map(f64::from);
    let (mut columns, mut rows) = (Vec::new(), Vec::new());
    // Chief rays through even places around the middle, as far as the picture goes.
    let [across, down] = size.map(|side| rays_across(side, most_across));
    for y in 0..down {
        for x in 0..across {
            let share = |i: u32, count: u32| (f64::from(i) + 0.5) / f64::from(count) - 0.5;
            let at = [middle[0] + share(x, across) * size[0], middle[1] + share(y, down) * size[1]];
            if (0..2).all(|axis| at[axis] > 0.0 && at[axis] < picture[axis]) {
                columns.push(at[0]);
                rows.push(at[1]);
            }
        }
    }
    let mut rays = RayBatch::default();
    camera.rays_through(&columns, &rows, &mut rays);
    let mut hits = HitBatch::new(Detail::Distance);
    accel.closest(&rays, &mut hits);
    // Depths along the axis; misses count as infinity where the camera sees so far.
    let pose = camera.pose();
    let depth = |i: usize| match hits.is_hit(i) {
        true => {
            let point = rays.origin(i) + rays.direction(i) * hits.t[i];
            Some((point - pose.position).dot(pose.forward()))
        }
        false => (sees_infinity && rays.t_max()[i] >= 0.0).then_some(f64::INFINITY),
    };
    let mut depths: Vec<f64> = (0..rays.len()).filter_map(depth).filter(|z| *z > 0.0).collect();
    depths.sort_by(f64::total_cmp);
    let Some(last) = depths.len().checked_sub(1) else { return depths };
    // The nearest, the median and the farthest.
    let mut few = vec![depths[0], depths[last / 2], depths[last]];
    few.dedup();
    few
}
