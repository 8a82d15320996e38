//! Survey of which copy each chief ray hits, and what each would cover if nothing were before it.

use std::ops::Range;
use std::sync::Arc;

use etendue_accel::{Accel, BuildOptions};
use etendue_camera::Convention;
use etendue_files::SOFTWARE;
use etendue_geometry::{Bounds, Detail, Geometry, HitBatch, MISS, RayBatch};
use etendue_scene::Scene;
use rayon::prelude::*;

use super::model::{MM, truth_time};
use super::rigid::{RigidFrame, copies};
use super::runs::RunLengths;
use super::{Annotated, AnnotationError, Instance, PinholeCamera, Silhouette};
use crate::build::build_over;
use crate::output::Outputs;
use crate::{Plan, RenderError};

/// BOP's customary step of depth (mm), which reaches 6.5 m in 16 bits; what is farther away takes steps ten times as long,
/// and so on.
const DEPTH_STEP: f64 = 0.1;

/// Bytes that a pixel takes: copy and depth, once by columns and once together, and steps of depth as numbers and as the
/// bytes of a file.
pub(super) const BYTES_A_PIXEL: u64 = 2 * (4 + 8 + 4) + 2 + 2;

/// Copy that each pixel sees, and its depth, down the columns.
struct CopiesByPixel {
    /// Index of the copy, or [`MISS`].
    copy: Vec<u32>,
    /// z of the camera (m); infinite where nothing is.
    depth: Vec<f64>,
}

/// The copies in the picture of `scene`, over which `accel` was built, and z of the camera in steps of
/// [`Annotated::depth_scale_mm`], row by row, 0 where nothing is; of outputs without BOP's the list is empty.
///
/// # Errors
///
/// When a copy's own structure cannot be built, or `progress`, told the share done, says stop.
pub fn survey(
    scene: &Scene,
    accel: &dyn Accel,
    outputs: Outputs,
    progress: &(dyn Fn(f64) -> bool + Sync),
) -> Result<(Annotated, Vec<u16>), AnnotationError> {
    let [width, height] = scene.camera.resolution();
    let pixels = copies_by_pixel(scene, accel);
    let copies = copies(&scene.geometry);
    let mut visible: Vec<RunLengths> = Vec::new();
    for (pixel, &copy) in (0..).zip(&pixels.copy).filter(|(_, copy)| **copy != MISS) {
        let copy = copy as usize;
        if visible.len() <= copy {
            visible.resize_with(copy + 1, RunLengths::default);
        }
        visible[copy].push(pixel);
    }
    let time = truth_time(scene);
    let plan = outputs.bop.then(|| Plan::new(scene, outputs));
    let mut instances = Vec::new();
    for (done, (&copy, placements)) in copies.iter().enumerate() {
        if !progress(done as f64 / copies.len() as f64) {
            return Err(RenderError::Stopped.into());
        }
        let geometry = &*scene.geometry;
        let runs = visible.get(copy as usize).cloned().unwrap_or_default();
        let visible = runs.mask([height, width]);
        let silhouette = match &plan {
            Some(plan) => Some(silhouette(scene, plan, placements)?),
            None => None,
        };
        let is_there = silhouette.as_ref().map_or(visible.area() > 0, |whole| whole.all_pixels > 0);
        if !is_there {
            continue;
        }
        let object = geometry.placements[placements[0]].object;
        let frame = plan.as_ref().and_then(|_| RigidFrame::of(geometry, placements, time));
        instances.push(Instance {
            instance: copy + 1,
            object: object + 1,
            name: scene.objects.get(object as usize).cloned().unwrap_or_default(),
            visible,
            silhouette,
            pose: frame.map(|frame| frame.pose(geometry, placements, time)),
        });
    }
    let (scale, depth) = match outputs.bop {
        true => steps(&pixels.depth, [width, height]),
        false => (DEPTH_STEP, Vec::new()),
    };
    let annotated = Annotated {
        software: SOFTWARE.to_owned(),
        width,
        height,
        camera: outputs.bop.then(|| camera(scene)).flatten(),
        depth_scale_mm: outputs.bop.then_some(scale),
        instances,
    };
    Ok((annotated, depth))
}

/// The camera by its K and its pose when data layers see the middle row.
fn camera(scene: &Scene) -> Option<PinholeCamera> {
    let file = scene.camera.opencv();
    let mut k = file.k?;
    // OpenCV counts from the centre of the top left pixel.
    let corner = etendue_camera::PixelOrigin::Center.to_corner() - file.pixel_origin.to_corner();
    k[0][2] -= corner;
    k[1][2] -= corner;
    let pose = scene.camera.pose_at(truth_time(scene));
    let matrix = pose.camera_from_world(Convention::Opencv).transpose();
    Some(PinholeCamera { k, camera_from_world: matrix.to_cols_array_2d() })
}

/// Columns of pixels, each traced as one batch.
fn copies_by_pixel(scene: &Scene, accel: &dyn Accel) -> CopiesByPixel {
    let [width, height] = scene.camera.resolution();
    let column = |x: u32| {
        let (mut rays, mut hits) = (RayBatch::default(), HitBatch::new(Detail::Distance));
        aim(scene, i64::from(x), 0..i64::from(height), &mut rays);
        accel.closest(&rays, &mut hits);
        let pixel = |y: usize| {
            if hits.placement[y] == MISS {
                return (MISS, f64::INFINITY);
            }
            let pose = scene.camera.pose_at(scene.camera.truth_time(y as f64 + 0.5));
            let copy = scene.geometry.placements[hits.placement[y] as usize].instance;
            (copy, hits.t[y] * rays.direction(y).dot(pose.forward()))
        };
        (0..hits.len()).map(pixel).collect::<Vec<_>>()
    };
    let columns: Vec<_> = (0..width).into_par_iter().map(column).collect();
    let (copy, depth) = columns.into_iter().flatten().unzip();
    CopiesByPixel { copy, depth }
}

/// The chief rays of rows of a column.
fn aim(scene: &Scene, x: i64, rows: Range<i64>, rays: &mut RayBatch) {
    let columns = vec![x as f64 + 0.5; usize::try_from(rows.end - rows.start).unwrap_or(0)];
    let rows: Vec<f64> = rows.map(|row| row as f64 + 0.5).collect();
    scene.camera.rays_through(&columns, &rows, rays);
}

/// Silhouette that the copy of these placements would have if nothing were before it.
fn silhouette(
    scene: &Scene,
    plan: &Plan,
    placements: &[usize],
) -> Result<Silhouette, AnnotationError> {
    let [width, height] = scene.camera.resolution();
    let alone = Arc::new(alone(&scene.geometry, placements));
    let [columns, rows] = reach(scene, &alone);
    let mut pixels = Vec::new();
    if !columns.is_empty() && !rows.is_empty() {
        let accel = build_over(alone, scene, plan, &BuildOptions::default())?;
        let column = |x: i64| {
            let (mut rays, mut hits) = (RayBatch::default(), HitBatch::new(Detail::Distance));
            aim(scene, x, rows.clone(), &mut rays);
            accel.closest(&rays, &mut hits);
            let is_hit = |(k, _): &(usize, i64)| hits.is_hit(*k);
            let hit = rows.clone().enumerate().filter(is_hit);
            hit.map(|(_, y)| [x, y]).collect::<Vec<_>>()
        };
        let found: Vec<_> = columns.into_par_iter().map(column).collect();
        pixels = found.into_iter().flatten().collect();
    }
    // Those in the picture, and the box around all.
    let (mut runs, mut inside) = (RunLengths::default(), 0);
    let (mut least, mut most) = ([i64::MAX; 2], [i64::MIN; 2]);
    for &[x, y] in &pixels {
        least = [least[0].min(x), least[1].min(y)];
        most = [most[0].max(x), most[1].max(y)];
        if let (Ok(x), Ok(y)) = (u32::try_from(x), u32::try_from(y))
            && x < width
            && y < height
        {
            runs.push(x * height + y);
            inside += 1;
        }
    }
    let bounds = match pixels.is_empty() {
        true => [-1; 4],
        false => [least[0], least[1], most[0] - least[0], most[1] - least[1]],
    };
    let all_pixels = u32::try_from(pixels.len()).unwrap_or(u32::MAX);
    Ok(Silhouette { mask: runs.mask([height, width]), pixels: inside, all_pixels, bounds })
}

/// These placements with their meshes, and nothing else.
fn alone(geometry: &Geometry, placements: &[usize]) -> Geometry {
    let mut alone = Geometry::default();
    let mut numbers: Vec<u32> = Vec::new();
    for &index in placements {
        let mut placement = geometry.placements[index].clone();
        let known = numbers.iter().position(|&mesh| mesh == placement.mesh);
        let number = known.unwrap_or_else(|| {
            numbers.push(placement.mesh);
            alone.meshes.push(geometry.mesh_of(&placement).clone());
            numbers.len() - 1
        });
        placement.mesh = u32::try_from(number).unwrap_or(u32::MAX);
        alone.placements.push(placement);
    }
    alone
}

/// The columns and rows that `geometry` may be seen in: of what is wholly before the camera the box around the corners
/// of its box, else all from one picture's width and height before the picture to as far behind it.
fn reach(scene: &Scene, geometry: &Geometry) -> [Range<i64>; 2] {
    let sides = scene.camera.resolution().map(i64::from);
    let all = sides.map(|side| -side..2 * side);
    if geometry.moves() || scene.camera.motion().is_some() {
        return all;
    }
    let Bounds { min, max } = geometry.loose_bounds();
    if min.cmpgt(max).any() {
        return [0..0, 0..0];
    }
    let origin = scene.camera.pose().position;
    let corners = Bounds { min, max }.corners();
    let places: Option<Vec<[f64; 2]>> =
        corners.iter().map(|corner| scene.camera.place_of(*corner - origin)).collect();
    let Some(places) = places else { return all };
    [0, 1].map(|axis| {
        let ends = places.iter().map(|place| place[axis]);
        let least = ends.clone().fold(f64::INFINITY, f64::min).floor();
        let most = ends.fold(f64::NEG_INFINITY, f64::max).ceil();
        #[expect(clippy::cast_possible_truncation, reason = "saturates, and is cut right after")]
        let (least, most) = (least as i64 - 1, most as i64 + 1);
        least.max(all[axis].start)..most.min(all[axis].end)
    })
}

/// Depth down the columns as 16-bit steps by rows, with the length of a step (mm).
fn steps(depth: &[f64], [width, height]: [u32; 2]) -> (f64, Vec<u16>) {
    let farthest = depth.iter().copied().filter(|z| z.is_finite()).fold(0.0, f64::max) * MM;
    let mut scale = DEPTH_STEP;
    while farthest / scale > f64::from(u16::MAX) {
        scale *= 10.0;
    }
    let [width, height] = [width, height].map(|side| side as usize);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within 16 bits")]
    let step = |z: f64| if z.is_finite() { (z * MM / scale).round().max(1.0) as u16 } else { 0 };
    let by_rows = (0..width * height).map(|i| step(depth[i % width * height + i / width]));
    (scale, by_rows.collect())
}
