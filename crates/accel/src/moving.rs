//! Bodies that move while the shutter is open, over any backend: each is traced in its own frame, into
//! which a ray is carried at its time in f64.
//!
//! What stands still is in one structure of the backend, which is as it would be without the others. The
//! mesh of each moving placement has a structure in the mesh's frame, shared by all that place it: the backend's, or, of a
//! mesh that changes its shape, [one of its own](crate::deforming). A ray asks it when it meets the box that the body sweeps while the shutter is open. All backends agree, and
//! hits are as exact as those of a body that stands at the place where it is at the ray's time.

mod blocks;

use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;
use std::time::Instant;

use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{
    Bounds, Detail, Geometry, HitBatch, HitPrecision, MISS, Mesh, Motion, PlacedTriangle,
    Positions, RayBatch, Transform, Vertices,
};

use crate::deforming::Deforming;
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
        true => Ok(Box::new(Moving::build(&geometry, options, build)?)),
    }
}

/// A structure whose bodies move.
struct Moving {
    still: Box<dyn Accel>,
    /// One for each mesh that moves.
    shapes: Vec<Box<dyn Accel>>,
    bodies: Vec<Body>,
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

/// A placement that moves.
#[derive(Debug)]
struct Body {
    placement: u32,
    shape: usize,
    motion: Arc<Motion>,
    /// Where it is while the shutter is open (m, world).
    swept: Bounds,
    /// Its mesh changes its shape, so that its structure wants times.
    deforms: bool,
}

/// Rays of a body, in its frame.
#[derive(Default)]
struct Carried {
    rays: RayBatch,
    hits: HitBatch,
    blocked: Vec<bool>,
    /// Of each, which of the batch it is, how long its unit is in the body's frame, and what carries normals back.
    from: Vec<(usize, f64, DMat3)>,
}

/// Distances that differ by no more than this, of the largest coordinate of the ray's origin and of the
/// distance, are one: as in the rule of surfaces in one plane.
const ONE_PLACE: f64 = 64.0 * f64::EPSILON;

/// [`ONE_PLACE`], or a wider one.
#[derive(Clone, Copy)]
struct OnePlace(f64);

impl Moving {
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
                        Some(steps) => Box::new(Deforming::build(mesh, steps, options)?),
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
            bodies.push(Body { placement, shape, motion, swept, deforms });
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
        report.bytes += (bodies.capacity() * size_of::<Body>() + tree.bytes()) as u64;
        report.backend = format!("{}, {} moving", report.backend, bodies.len());
        report.time = start.elapsed();
        let far = |body: &Body| body.swept.min.abs().max(body.swept.max.abs()).max_element();
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

    /// Carries those of the rays `near` a body into its frame that meet it no farther than `t_max` says.
    fn carry(
        &self,
        (body, near): (&Body, &[[u32; 2]]),
        rays: &RayBatch,
        t_max: impl Fn(usize) -> Option<f64>,
        carried: &mut Carried,
    ) {
        carried.rays.clear();
        carried.rays.coherent = rays.coherent;
        carried.rays.from_surface = rays.from_surface;
        // Offsets by which rays leave surfaces are bounds in the world: f64 has them in every frame.
        carried.rays.precision = HitPrecision::Double;
        carried.from.clear();
        let [open, close] = self.exposure;
        for i in near.iter().map(|&[_, ray]| ray as usize) {
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
            match rays.endpoint_triangles() {
                None => {
                    carried.rays.push_between(start, turned / stretch, limits[0], limits[1]);
                }
                Some(ends) => {
                    let own = |[placement, triangle]: [u32; 2]| match placement == body.placement {
                        true => [0, triangle],
                        false => [MISS; 2],
                    };
                    let ends = ends[i].map(own);
                    carried.rays.push_between_triangles(start, turned / stretch, limits, ends);
                }
            }
            carried.from.push((i, stretch, place.normal_matrix()));
        }
        if body.deforms {
            let times = carried.from.iter().map(|(i, ..)| rays.time(*i));
            carried.rays.set_times(times);
        }
    }
}

/// A body's number.
fn number(body: usize) -> u32 {
    u32::try_from(body).unwrap_or(MISS)
}

/// A tree over the boxes that bodies sweep.
fn over(bodies: &[Body], options: &BuildOptions) -> Result<Boxes, BuildError> {
    let watch = BuildWatch::new(options, bodies.len() as u64);
    let refs = bodies.iter().enumerate().map(|(i, body)| {
        let (lo, hi) = outward([body.swept.min, body.swept.max]);
        Ref { lo, first: number(i), hi, second: number(i) }
    });
    let tree = Tree::build(refs.collect(), LeafSize { most: 1, block: 1 }, &watch)?;
    Ok(Boxes::refitted(tree, |[i, _]| bodies[i as usize].swept))
}

/// Whether a ray meets a box at distances (m) within `limits`, rounding in favour of yes.
fn meets(bounds: Bounds, origin: DVec3, direction: DVec3, [t_min, t_max]: [f64; 2]) -> bool {
    let size = origin.abs().max(bounds.min.abs()).max(bounds.max.abs()).max_element();
    let pad = DVec3::splat(8.0 * f64::EPSILON * size);
    let (low, high) = (bounds.min - pad - origin, bounds.max + pad - origin);
    let (mut near, mut far) = (t_min, t_max);
    for axis in 0..3 {
        if direction[axis] == 0.0 {
            if low[axis] > 0.0 || high[axis] < 0.0 {
                return false;
            }
            continue;
        }
        let [a, b] = [low[axis] / direction[axis], high[axis] / direction[axis]];
        near = near.max(a.min(b));
        far = far.min(a.max(b));
    }
    near <= far + ONE_PLACE * (size + far.abs())
}

impl Moving {
    /// Puts bodies into hits that are nearer than what those have.
    fn closest_of_bodies(&self, rays: &RayBatch, hits: &mut HitBatch, one_place: OnePlace) {
        let OnePlace(one_place) = one_place;
        let mut carried = Carried::default();
        carried.hits.detail = hits.detail;
        let reach = |hits: &HitBatch, i: usize| {
            let t = hits.t[i].min(rays.t_max()[i]);
            // As far as what is in the same place.
            let t = t + one_place * t.abs().max(rays.origin(i).abs().max_element());
            Some(if t.is_nan() { f64::INFINITY } else { t.min(rays.t_max()[i]) })
        };
        let near = self.near(rays, |i| reach(hits, i));
        for near in near.chunk_by(|a, b| a[0] == b[0]) {
            let body = &self.bodies[near[0][0] as usize];
            self.carry((body, near), rays, |i| reach(hits, i), &mut carried);
            if carried.from.is_empty() {
                continue;
            }
            self.shapes[body.shape].closest(&carried.rays, &mut carried.hits);
            for (k, &(i, stretch, turn)) in carried.from.iter().enumerate() {
                let found = &carried.hits;
                if !found.is_hit(k) {
                    continue;
                }
                let t = found.t[k] / stretch;
                let size = t.abs().max(rays.origin(i).abs().max_element());
                // What is carried is exact in itself.
                let known = hits.placement[i];
                let same = if self.moves.get(known as usize) == Some(&true) {
                    ONE_PLACE
                } else {
                    one_place
                };
                let is_nearer = match hits.is_hit(i) {
                    false => true,
                    true if body.placement > known => t <= hits.t[i] + same * size,
                    true => t < hits.t[i] - same * size,
                };
                if !is_nearer {
                    continue;
                }
                hits.t[i] = t;
                hits.placement[i] = body.placement;
                hits.triangle[i] = found.triangle[k];
                if hits.detail == Detail::Surface {
                    (hits.u[i], hits.v[i]) = (found.u[k], found.v[k]);
                    let normal = (turn * found.normal(k)).normalize_or_zero();
                    for axis in 0..3 {
                        hits.normal[axis][i] = normal[axis];
                    }
                }
            }
        }
    }

    /// Says of rays that nothing blocked yet whether bodies do.
    fn occluded_by_bodies(&self, rays: &RayBatch, blocked: &mut [bool]) {
        let mut carried = Carried::default();
        let reach = |blocked: &[bool], i: usize| (!blocked[i]).then(|| rays.t_max()[i]);
        let near = self.near(rays, |i| reach(blocked, i));
        for near in near.chunk_by(|a, b| a[0] == b[0]) {
            let body = &self.bodies[near[0][0] as usize];
            self.carry((body, near), rays, |i| reach(blocked, i), &mut carried);
            if carried.from.is_empty() {
                continue;
            }
            self.shapes[body.shape].occluded(&carried.rays, &mut carried.blocked);
            for (&(i, ..), &is_blocked) in carried.from.iter().zip(&carried.blocked) {
                blocked[i] |= is_blocked;
            }
        }
    }
}

impl Accel for Moving {
    fn closest(&self, rays: &RayBatch, hits: &mut HitBatch) {
        self.still.closest(&self.with_still_ends(rays), hits);
        hits.set_times(rays.times());
        self.closest_of_bodies(rays, hits, OnePlace(ONE_PLACE));
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

impl fmt::Debug for Moving {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Moving")
            .field("still", &self.still)
            .field("bodies", &self.bodies)
            .finish_non_exhaustive()
    }
}
