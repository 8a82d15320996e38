//! How deep the scene is where the camera looks.

use etendue_accel::Accel;
use etendue_camera::Camera;
use etendue_geometry::{Detail, HitBatch, RayBatch};
use etendue_scene::Scene;
use etendue_tracer::LightKind;
use etendue_tracer::light::EnvironmentImage;

use super::{FIELD, Place};

/// Chief rays across each cell of the field.
const ACROSS: u32 = 8;

/// Places of the picture, each with the depths (m) that its neighbourhood shows: the nearest, the middle one
/// and the farthest; infinity where an environment's image is seen. A place whose neighbourhood shows nothing
/// has none.
pub(super) fn places(scene: &Scene, accel: &dyn Accel) -> Vec<Place> {
    let [width, height] = scene.camera.resolution().map(f64::from);
    let [columns, rows] = FIELD;
    let share = |i: u32, count: u32| f64::from(i) / f64::from(count - 1);
    let is_pictured = |kind: &LightKind| matches!(kind, LightKind::Environment { image, .. } if *image != EnvironmentImage::Constant);
    let sees_infinity = scene.lights.iter().any(|light| is_pictured(&light.kind));
    let mut places = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let at = [share(column, columns) * width, share(row, rows) * height];
            let size = [width / f64::from(columns - 1), height / f64::from(rows - 1)];
            let depths = around(&scene.camera, accel, (at, size), sees_infinity);
            places.push(Place { column: at[0], row: at[1], depths });
        }
    }
    places
}

/// The depths (m) in a cell of the picture of a middle and a size (pixels).
fn around(
    camera: &Camera,
    accel: &dyn Accel,
    (middle, size): ([f64; 2], [f64; 2]),
    sees_infinity: bool,
) -> Vec<f64> {
    let picture = camera.resolution().map(f64::from);
    let (mut columns, mut rows) = (Vec::new(), Vec::new());
    // Chief rays through even places around the middle, as far as the picture goes.
    for y in 0..ACROSS {
        for x in 0..ACROSS {
            let share = |i: u32| (f64::from(i) + 0.5) / f64::from(ACROSS) - 0.5;
            let at = [middle[0] + share(x) * size[0], middle[1] + share(y) * size[1]];
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
