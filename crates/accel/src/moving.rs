//! Bodies that move while the shutter is open, over any backend: each is traced in its own frame, into
//! which a ray is carried at its time in f64.
//!
//! What stands still is in one structure of the backend, which is as it would be without the others. The
//! mesh of each moving placement has a structure in the mesh's frame, shared by all that place it: the backend's, or, of a
//! mesh that changes its shape, [one of its own](crate::deforming). A ray asks it when it meets the box that the body sweeps while the shutter is open. All backends agree, and
//! hits are as exact as those of a body that stands at the place where it is at the ray's time.

mod blocks;
mod body;

use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;
use std::time::Instant;

use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{
    Bounds, Detail, Geometry, HitBatch, HitPrecision, MISS, Mesh, PlacedTriangle, Positions,
    RayBatch, Transform, Vertices,
};

use self::body::{BodyHit, BodyRays, MovingPlacement};
use crate::deforming::DeformingMesh;
use crate::exact::Boxes;
use crate::parts::{LocalRay, outward};
use crate::single::F32Frame;
use crate::tree::{LeafSize, MAX_DEPTH, Ref, Tree};
use crate::{Accel, BlockAccel, BuildError, BuildOptions, BuildReport, BuildWatch, Counts};

/// Builds a structure of one backend.
pub type Build<'a> = &'a dyn Fn(Arc<Geometry>, &BuildOptions) -> Result<Box<dyn Accel>, BuildError>;

/// The structure over `geometry` of the backend that `build` builds, with all that moves within the
/// [exposure](BuildOptions::exposure): the backend's own where nothing does.
///
/// # Errors
///
/// Those of the backend.
pub fn build_moving(
    geometry: Arc<Geometry>,
    options: &BuildOptions,
    build: Build<'_>,
) -> Result<Box<dyn Accel>, BuildError> {
    let moves = geometry.moving_within(options.exposure).next().is_some();
    match moves {
        false => build(geometry, options),
        true => Ok(Box::new(MovingScene::build(&geometry, options, build)?)),
    }
}

/// A structure whose bodies move.
struct MovingScene {
    still: Box<dyn Accel>,
    /// One for each mesh that moves.
    shapes: Vec<Box<dyn Accel>>,
    bodies: Vec<MovingPlacement>,
    /// Over the boxes that they sweep.
    tree: Boxes,
    /// Of each placement, whether it moves.
    moves: Vec<bool>,
    exposure: [f64; 2],
    /// The largest coordinate of a box (m), and the box around all of them (m, world).
    size: f64,
    swept: Bounds,
    /// The frame of rays in blocks.
    frame: Option<F32Frame>,
    report: BuildReport,
}

/// Rays of a body, in its frame.
#[derive(Default)]
struct RaysInFrame {
    rays: RayBatch,
    hits: HitBatch,
    blocked: Vec<bool>,
    /// Of each, which of the batch it is, how long its unit is in the body's frame, and what turns and stretches that.
    from: Vec<(usize, f64, DMat3)>,
}

/// Distances that differ by no more than this, of the largest coordinate of the ray's origin and of the
/// distance, are one: as in the rule of surfaces in one plane.
const ONE_PLACE: f64 = 64.0 * f64::EPSILON;

impl MovingScene {
    fn build(
        geometry: &Arc<Geometry>,
        options: &BuildOptions,
        build: Build<'_>,
    ) -> Result<Self, BuildError> {
        let start = Instant::now();
        // Placements keep their numbers: those that move have nothing that stands still.
        let mut still = (**geometry).clone();
        let nothing = u32::try_from(still.meshes.len()).unwrap_or(MISS);
        let none: &[[f32; 3]] = &[];
        let positions = Positions::F32(Vertices::from_arrays(none));
        still.meshes.push(Mesh::new("nothing", positions, Vec::new().into()));
        let mut moves = vec![false; still.placements.len()];
        let mut of_mesh = vec![None; geometry.meshes.len()];
        let (mut shapes, mut bodies) = (Vec::<Box<dyn Accel>>::new(), Vec::new());
        for (i, motion) in geometry.moving_within(options.exposure) {
            still.placements[i].mesh = nothing;
            moves[i] = true;
            let placement = &geometry.placements[i];
            let mesh = geometry.mesh_of(placement);
            let bounds = mesh.bounds_at_all_times();
            if bounds.is_empty() {
                continue;
            }
            let shape = match of_mesh[placement.mesh as usize] {
                Some(shape) => shape,
                None => {
                    shapes.push(match &mesh.steps {
                        Some(steps) => Box::new(DeformingMesh::build(mesh, steps, options)?),
                        None => {
                            let alone = Geometry::alone(mesh.clone(), Transform::IDENTITY);
                            build(Arc::new(alone), options)?
                        }
                    });
                    shapes.len() - 1
                }
            };
            of_mesh[placement.mesh as usize] = Some(shape);
            let deforms = mesh.steps.is_some();
            let swept = motion.swept(bounds, options.exposure);
            let placement = u32::try_from(i).unwrap_or(MISS);
            let motion = Arc::clone(motion);
            bodies.push(MovingPlacement {
                placement,
                shape,
                motion,
                swept,
                local: bounds,
                deforms,
            });
        }
        let tree = over(&bodies, options)?;
        let standing = still.loose_bounds();
        let still = build(Arc::new(still), options)?;
        let mut report = still.report();
        for shape in &shapes {
            let BuildReport { bytes, copied_bytes, .. } = shape.report();
            report.bytes += bytes;
            report.copied_bytes += copied_bytes;
        }
        report.bytes += (bodies.capacity() * size_of::<MovingPlacement>() + tree.bytes()) as u64;
        report.backend = format!("{}, {} moving", report.backend, bodies.len());
        report.time = start.elapsed();
        let far =
            |body: &MovingPlacement| body.swept.min.abs().max(body.swept.max.abs()).max_element();
        let size = bodies.iter().map(far).fold(0.0, f64::max);
        let exposure = options.exposure;
        let swept = bodies.iter().fold(Bounds::EMPTY, |all, body| all.union(body.swept));
        let frame = Self::frame_of_blocks(&*still, standing, swept);
        Ok(Self { still, shapes, bodies, tree, moves, exposure, size, swept, frame, report })
    }

    /// The rays with those triangles at their ends that stand still.
    fn with_still_ends<'r>(&self, rays: &'r RayBatch) -> Cow<'r, RayBatch> {
        let Some(ends) = rays.endpoint_triangles() else { return Cow::Borrowed(rays) };
        let moves = |end: &PlacedTriangle| self.moves.get(end[0] as usize) == Some(&true);
        if !ends.iter().flatten().any(moves) {
            return Cow::Borrowed(rays);
        }
        let still = |end: PlacedTriangle| if moves(&end) { [MISS; 2] } else { end };
        let mut own = rays.clone();
        own.end_on_triangles(ends.iter().map(|ends| ends.map(still)));
        Cow::Owned(own)
    }

    /// The bodies whose boxes each ray meets no farther than `t_max` says, with it: in order.
    fn near(&self, rays: &RayBatch, t_max: impl Fn(usize) -> Option<f64>) -> Vec<[u32; 2]> {
        let [open, close] = self.exposure;
        let (mut near, mut stack) = (Vec::new(), Vec::with_capacity(MAX_DEPTH));
        for i in 0..rays.len() {
            let Some(mut t_max) = t_max(i) else { continue };
            let ray = u32::try_from(i).unwrap_or(MISS);
            if !(open..=close).contains(&rays.time(i)) {
                // It may be anywhere then.
                near.extend((0..self.bodies.len()).map(|body| [number(body), ray]));
                continue;
            }
            let (origin, direction) = (rays.origin(i), rays.direction(i));
            let pad = 8.0 * f64::EPSILON * origin.abs().max_element().max(self.size);
            let local = LocalRay { origin, direction, pad };
            self.tree.visit(
                &local,
                rays.t_min()[i],
                &mut t_max,
                &mut stack,
                &mut |[body, _], _| {
                    near.push([body, ray]);
                    true
                },
            );
        }
        near.sort_unstable();
        near
    }

    /// The pairs `near` by body.
    fn by_body<'a>(&'a self, near: &'a [[u32; 2]]) -> impl Iterator<Item = BodyRays<'a>> {
        let pairs = near.chunk_by(|a, b| a[0] == b[0]);
        pairs.map(|near| BodyRays { body: &self.bodies[near[0][0] as usize], near })
    }

    /// Carries those of a body's rays into its frame that meet it no farther than `t_max` says.
    fn carry(
        &self,
        own: &BodyRays<'_>,
        rays: &RayBatch,
        t_max: impl Fn(usize) -> Option<f64>,
        carried: &mut RaysInFrame,
    ) {
        carried.rays.clear();
        carried.rays.coherent = rays.coherent;
        carried.rays.from_surface = rays.from_surface;
        // Offsets by which rays leave surfaces are bounds in the world: f64 has them in every frame.
        carried.rays.precision = HitPrecision::Double;
        carried.from.clear();
        let [open, close] = self.exposure;
        let body = own.body;
        for i in own.numbers() {
            let Some(t_max) = t_max(i) else { continue };
            let (origin, direction, time) = (rays.origin(i), rays.direction(i), rays.time(i));
            let limits = [rays.t_min()[i], t_max];
            // At other times the body may be anywhere.
            let is_swept = time >= open && time <= close;
            if is_swept && !meets(body.swept, origin, direction, limits) {
                continue;
            }
            let place = body.motion.at(time);
            let inverse = place.linear.inverse();
            let turned = inverse * direction;
            let stretch = turned.length();
            if !(stretch > 0.0 && stretch.is_finite()) {
                continue;
            }
            let start = inverse * -place.offset_from(origin);
            let limits = limits.map(|t| t * stretch);
            if !meets(body.local, start, turned / stretch, limits) {
                continue;
            }
            match rays.endpoint_triangles() {
                None => {
                    carried.rays.push_between(start, turned / stretch, limits[0], limits[1]);
                }
                Some(ends) => {
                    let in_frame =
                        |[placement, triangle]: [u32; 2]| match placement == body.placement {
                            true => [0, triangle],
                            false => [MISS; 2],
                        };
                    let ends = ends[i].map(in_frame);
                    carried.rays.push_between_triangles(start, turned / stretch, limits, ends);
                }
            }
            carried.from.push((i, stretch, place.linear));
        }
        if body.deforms {
            let times = carried.from.iter().map(|(i, ..)| rays.time(*i));
            carried.rays.set_times(times);
        }
    }
}

/// A normal of a body's frame in the world (unit), by what turns and stretches the frame.
fn turned_normal(linear: DMat3, normal: DVec3) -> DVec3 {
    (Transform::new(linear, DVec3::ZERO).normal_matrix() * normal).normalize_or_zero()
}

/// A body's number.
fn number(body: usize) -> u32 {
    u32::try_from(body).unwrap_or(MISS)
}

/// A tree over the boxes that bodies sweep.
fn over(bodies: &[MovingPlacement], options: &BuildOptions) -> Result<Boxes, BuildError> {
    let watch = BuildWatch::new(options, bodies.len() as u64);
    let refs = bodies.iter().enumerate().map(|(i, body)| {
        let (lo, hi) = outward([body.swept.min, body.swept.max]);
        Ref { lo, first: number(i), hi, second: number(i) }
    });
    let tree = Tree::build(refs.collect(), LeafSize { most: 1, block: 1 }, &watch)?;
    Ok(Boxes::refitted(tree, |[i, _]| bodies[i as usize].swept))
}

/// Tests whether a ray meets a box at distances (m) within `limits`, rounding in favour of yes.
fn meets(bounds: Bounds, origin: DVec3, direction: DVec3, limits: [f64; 2]) -> bool {
    span(bounds, origin, direction, limits).is_some()
}

/// Ends of the part of a ray in a box within `limits` (m), rounding in favour of longer.
fn span(
    bounds: Bounds,
    origin: DVec3,
    direction: DVec3,
    [t_min, t_max]: [f64; 2],
) -> Option<[f64; 2]> {
    let size = origin.abs().max(bounds.min.abs()).max(bounds.max.abs()).max_element();
    let pad = DVec3::splat(8.0 * f64::EPSILON * size);
    let (low, high) = (bounds.min - pad - origin, bounds.max + pad - origin);
    let (mut near, mut far) = (t_min, t_max);
    for axis in 0..3 {
        if direction[axis] == 0.0 {
            if low[axis] > 0.0 || high[axis] < 0.0 {
                return None;
            }
            continue;
        }
        let [a, b] = [low[axis] / direction[axis], high[axis] / direction[axis]];
        near = near.max(a.min(b));
        far = far.min(a.max(b));
    }
    (near <= far + ONE_PLACE * (size + far.abs())).then_some([near, far])
}

/// Distance up to which ray `i`, whose hit is in `hits`, looks: as far as what is in the same place.
fn reach(rays: &RayBatch, hits: &HitBatch, i: usize, one_place: f64) -> f64 {
    let t = hits.t[i].min(rays.t_max()[i]);
    let t = t + one_place * t.abs().max(rays.origin(i).abs().max_element());
    if t.is_nan() { f64::INFINITY } else { t.min(rays.t_max()[i]) }
}

impl MovingScene {
    /// Puts bodies into hits that are nearer than what those have.
    fn closest_of_bodies(&self, rays: &RayBatch, hits: &mut HitBatch) {
        let mut carried = RaysInFrame::default();
        carried.hits.detail = hits.detail;
        let near = self.near(rays, |i| Some(reach(rays, hits, i, ONE_PLACE)));
        for own in self.by_body(&near) {
            self.closest_of_body(&own, rays, hits, ONE_PLACE, &mut carried);
        }
    }

    /// Finds the closest hits on one body; distances that differ by the share `one_place` are one.
    fn closest_of_body(
        &self,
        own: &BodyRays<'_>,
        rays: &RayBatch,
        hits: &mut HitBatch,
        one_place: f64,
        carried: &mut RaysInFrame,
    ) {
        let body = own.body;
        self.carry(own, rays, |i| Some(reach(rays, hits, i, one_place)), carried);
        if carried.from.is_empty() {
            return;
        }
        self.shapes[body.shape].closest(&carried.rays, &mut carried.hits);
        let found = &carried.hits;
        for (k, &(i, stretch, linear)) in carried.from.iter().enumerate() {
            if !found.is_hit(k) {
                continue;
            }
            let t = found.t[k] / stretch;
            if !body.is_nearest(rays, hits, i, t, one_place) {
                continue;
            }
            let has_surface = hits.detail == Detail::Surface;
            let hit = BodyHit {
                t,
                triangle: found.triangle[k],
                weights: if has_surface { [found.u[k], found.v[k]] } else { [0.0; 2] },
                normal: match has_surface {
                    true => turned_normal(linear, found.normal(k)),
                    false => DVec3::ZERO,
                },
            };
            hit.put(hits, i, body.placement);
        }
    }

    /// Says of rays that nothing blocked yet whether bodies do.
    fn occluded_by_bodies(&self, rays: &RayBatch, blocked: &mut [bool]) {
        let mut carried = RaysInFrame::default();
        let near = self.near(rays, |i| (!blocked[i]).then(|| rays.t_max()[i]));
        for own in self.by_body(&near) {
            self.occluded_by_body(&own, rays, blocked, &mut carried);
        }
    }

    /// Tests for occlusion by one body.
    fn occluded_by_body(
        &self,
        own: &BodyRays<'_>,
        rays: &RayBatch,
        blocked: &mut [bool],
        carried: &mut RaysInFrame,
    ) {
        let reach = |i: usize| (!blocked[i]).then(|| rays.t_max()[i]);
        self.carry(own, rays, reach, carried);
        if carried.from.is_empty() {
            return;
        }
        self.shapes[own.body.shape].occluded(&carried.rays, &mut carried.blocked);
        for (&(i, ..), &is_blocked) in carried.from.iter().zip(&carried.blocked) {
            blocked[i] |= is_blocked;
        }
    }
}

impl Accel for MovingScene {
    fn closest(&self, rays: &RayBatch, hits: &mut HitBatch) {
        self.still.closest(&self.with_still_ends(rays), hits);
        hits.set_times(rays.times());
        self.closest_of_bodies(rays, hits);
    }

    fn occluded(&self, rays: &RayBatch, blocked: &mut Vec<bool>) {
        self.still.occluded(&self.with_still_ends(rays), blocked);
        self.occluded_by_bodies(rays, blocked);
    }

    fn blocks(&self) -> Option<&dyn BlockAccel> {
        self.frame.is_some().then_some(self)
    }

    fn report(&self) -> BuildReport {
        self.report.clone()
    }

    fn counts(&self) -> Counts {
        let all = self.shapes.iter().chain([&self.still]).map(|accel| accel.counts());
        all.fold(Counts::default(), |sum, counts| Counts {
            rechecked: sum.rechecked + counts.rechecked,
            corrected: sum.corrected + counts.corrected,
        })
    }
}

impl fmt::Debug for MovingScene {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("MovingScene")
            .field("still", &self.still)
            .field("bodies", &self.bodies)
            .finish_non_exhaustive()
    }
}
