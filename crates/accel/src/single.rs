//! Rays in single precision, as fast backends trace them: relative to an origin near the scene, and
//! started where they enter its box, so that f32's 24 bits are spent on the scene alone.

use etendue_geometry::block::LANES;
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Bounds, HitPrecision, RayBatch, RayBlock, RayBlocks};

/// The box of a scene and the origin that single-precision coordinates are relative to.
#[derive(Debug, Clone, Copy)]
pub struct F32Frame {
    /// Origin of the single-precision coordinates (m, world).
    pub(crate) origin: DVec3,
    /// Centre of the scene's box, from `origin` (m).
    centre: DVec3,
    /// Half the box's diagonal (m), at least the smallest normal f32.
    pub(crate) radius: f64,
    /// Half the box's extents (m), grown by what f32 rounding may move a vertex.
    half: DVec3,
}

/// Boxes whose centre is farther from the world's origin than this many half-diagonals get an origin
/// of their own. Up to here f32 loses at most two bits more than it must, and buffers stay shared.
const NEAR: f64 = 4.0;

/// Two unit vectors, far from each other and from the ways that rays and edges mostly run.
const ODD_AXES: [[f64; 3]; 2] = [[0.48, 0.6, 0.64], [-0.64, 0.48, -0.6]];

/// Rays that start farther from the box than this many half-diagonals are started nearer.
const FAR: f64 = 1.5;

/// Amount by which rays are turned aside on purpose, in units in the last place.
///
/// A ray aimed exactly at a vertex slips between its triangles in single precision about once in a
/// hundred times, even in Embree's robust mode: the signs of the edge functions around the vertex are
/// then all noise, which grows with the distance (by six such units at worst and mostly one). A few
/// units beside the vertex they are not. The turn is towards the centre of the scene's box, so that at
/// the outline, where a miss could never be checked, rays err on the side of hitting, and f64 decides;
/// and a little across, for rays that pass the centre.
const NUDGE: f64 = 3.0 * F32_EPSILON;

/// Sideways error of a ray in single precision at any distance: the nudge, and as much again for
/// roundings of the ray and of what it meets.
const BLUR: f64 = 2.0 * NUDGE;

/// From 1 to the next f32.
pub(crate) const F32_EPSILON: f64 = f32::EPSILON as f64;

/// Single precision's distances are trusted to this many times its lateral error: up to a cosine of
/// incidence of one in so many.
const SLOPE: f64 = 32.0;

/// Rays that start farther from the scene's centre than this many half-diagonals miss it: f64 could
/// not tell where they pass.
const MOST_RADII: f64 = 1e12;

/// Margin of the sphere around the scene's box that a ray must meet to be traced: f64's rounding in
/// telling so, at distances of up to 10¹² radii.
const SPHERE_SLACK: f64 = 1e-3;

/// Start of the rays of a camera near the scene, in single precision, from a frame's origin (m).
#[derive(Debug, Clone, Copy)]
pub struct BlockOrigin {
    position: [f32; 3],
    /// The box's centre, from here.
    centre: [f32; 3],
    far: f32,
    /// Radius of the sphere around the box that a ray must meet to be traced.
    sphere: f32,
}

/// Origins of rays in blocks are at most this many half-diagonals from the box's centre: single precision then misplaces
/// rays by a millionth of the scene, as it does the scene's own corners.
const NEAR_ORIGIN: f64 = 16.0;

impl BlockOrigin {
    /// Starts rays here that were [reset](RayBlocks::reset), and whose unit directions are set: those that may meet the
    /// scene count all hits ahead, others are not traced.
    pub fn start(&self, blocks: &mut RayBlocks) {
        let len = blocks.len();
        start_blocks(self, blocks.blocks_mut(), len);
    }
}

#[multiversion::multiversion(targets = "simd")]
fn start_blocks(from: &BlockOrigin, blocks: &mut [RayBlock], len: usize) {
    let BlockOrigin { position, centre: [cx, cy, cz], far, sphere } = *from;
    for (block, first) in blocks.iter_mut().zip((0..).step_by(LANES)) {
        let RayBlock { origin, direction, t_max, .. } = block;
        let [dx, dy, dz] = &*direction;
        let mut start = [0.0; LANES];
        for i in 0..LANES {
            let foot = cx * dx[i] + cy * dy[i] + cz * dz[i];
            let (fx, fy, fz) = (cx - foot * dx[i], cy - foot * dy[i], cz - foot * dz[i]);
            let meets = (fx * fx + fy * fy + fz * fz <= sphere * sphere) & (foot >= -sphere);
            // As of rays of batches only far ones are moved ahead.
            start[i] = (foot - far).max(0.0);
            t_max[i] = if meets & (first + i < len) { f32::INFINITY } else { 0.0 };
        }
        for ((origins, from), along) in origin.iter_mut().zip(position).zip(&*direction) {
            for i in 0..LANES {
                origins[i] = from + along[i] * start[i];
            }
        }
    }
}

impl F32Frame {
    /// The frame of nothing, which no ray meets.
    pub(crate) const EMPTY: &'static Self = &Self {
        origin: DVec3::ZERO,
        centre: DVec3::ZERO,
        radius: f32::MIN_POSITIVE as f64,
        half: DVec3::NEG_INFINITY,
    };

    /// Origin of the coordinates (m, world).
    #[must_use]
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// A point that rays start from (m, world); `None` of one so far from the scene that they have to be worked out in
    /// double precision.
    #[must_use]
    pub fn block_origin(&self, position: DVec3) -> Option<BlockOrigin> {
        let own = position - self.origin;
        let centre = self.centre - own;
        let is_near = centre.length() <= NEAR_ORIGIN * self.radius;
        is_near.then(|| BlockOrigin {
            position: own.to_array().map(round),
            centre: centre.to_array().map(round),
            far: round(FAR * self.radius),
            sphere: round((1.0 + SPHERE_SLACK) * self.radius),
        })
    }

    pub(crate) fn of(bounds: Bounds) -> Self {
        let radius = (bounds.diagonal() * 0.5).max(f64::from(f32::MIN_POSITIVE));
        let centre = bounds.centre();
        let origin = if centre.length() > NEAR * radius { centre } else { DVec3::ZERO };
        Self::relative(bounds, origin)
    }

    /// The frame of a box with this origin (m, world); `None` where that is too far away.
    pub(crate) fn near(bounds: Bounds, origin: DVec3) -> Option<Self> {
        let radius = 0.5 * bounds.diagonal();
        let is_near = (bounds.centre() - origin).length() <= NEAR * radius;
        (radius > 0.0 && is_near).then(|| Self::relative(bounds, origin))
    }

    fn relative(bounds: Bounds, origin: DVec3) -> Self {
        let radius = (bounds.diagonal() * 0.5).max(f64::from(f32::MIN_POSITIVE));
        let centre = bounds.centre();
        let half = if bounds.is_empty() {
            DVec3::NEG_INFINITY
        } else {
            (bounds.max - bounds.min) * 0.5 + 1e-6 * (radius + (centre - origin).length())
        };
        Self { origin, centre: centre - origin, radius, half }
    }

    /// Refills `blocks` with `rays` as they are: what single precision hits there is not decided again.
    pub(crate) fn convert(&self, rays: &RayBatch, blocks: &mut RayBlocks) {
        blocks.reset(rays.len());
        convert_blocks(blocks.blocks_mut(), rays, self);
    }

    /// True if ray `i`'s line may meet the scene's box, by separating axes along the cross products
    /// of the line with the box's axes. Safe rather than tight.
    pub(crate) fn may_meet(&self, rays: &RayBatch, i: usize) -> bool {
        let d = rays.direction(i);
        let moment = (self.centre - (rays.origin(i) - self.origin)).cross(d).abs();
        let (h, a) = (self.half, d.abs());
        let reach = DVec3::new(h.y * a.z + h.z * a.y, h.z * a.x + h.x * a.z, h.x * a.y + h.y * a.x);
        moment.cmple(reach).all()
    }
}

/// A batch of rays in single precision.
#[derive(Debug, Default)]
pub(crate) struct Rays32 {
    pub(crate) origin: [Vec<f32>; 3],
    pub(crate) direction: [Vec<f32>; 3],
    /// Before the nearest distance that counts, and behind the farthest, by what single precision
    /// may be off.
    pub(crate) t_near: Vec<f32>,
    pub(crate) t_far: Vec<f32>,
    /// Distance (m) by which each ray was moved ahead of its true origin. Rays that start within the scene are moved
    /// back a little, so that what they start on lies ahead of them whichever way it rounds.
    pub(crate) advance: Vec<f64>,
}

impl Rays32 {
    pub(crate) fn len(&self) -> usize {
        self.t_near.len()
    }

    /// Lateral distance (m) by which single precision may misplace ray `i` at `t` (m, from where it
    /// was moved to).
    pub(crate) fn blur(&self, i: usize, t: f64) -> f64 {
        let size = self.origin.iter().fold(0.0, |sum, axis| sum + f64::from(axis[i]).abs());
        BLUR * (size + t.max(0.0))
    }

    /// Greatest error (m) of single precision's distance `t` (m, likewise). What counts at a limit
    /// of a ray within this is decided in f64.
    pub(crate) fn slack(&self, i: usize, t: f64) -> f64 {
        SLOPE * self.blur(i, t)
    }

    /// Distance (m, likewise) within which ray `i` may meet anything in `frame`.
    pub(crate) fn reach(&self, i: usize, frame: &F32Frame) -> f64 {
        let [x, y, z] = self.origin.each_ref().map(|axis| f64::from(axis[i]));
        frame.centre.distance(DVec3::new(x, y, z)) + frame.radius
    }

    /// True if ray `i` is sound and ends behind the scene's beginning.
    pub(crate) fn can_hit(&self, i: usize) -> bool {
        self.t_far[i] > 0.0
    }

    /// Starts and ends rays of surfaces clear of these, by what single precision's distances may be off:
    /// for modes that do not look again, where each would meet the surface that it leaves. What is
    /// nearer than that to either end is passed by.
    pub(crate) fn keep_clear(&mut self, rays: &RayBatch) {
        for i in 0..self.len() {
            if !self.can_hit(i) {
                continue;
            }
            let near = rays.t_min()[i] - self.advance[i] + self.slack(i, 0.0);
            let end = rays.t_max()[i] - self.advance[i];
            self.t_near[i] = round(near.max(0.0));
            if end.is_finite() {
                self.t_far[i] = round(end - self.slack(i, end)).max(self.t_near[i]);
            }
        }
    }

    fn resize(&mut self, len: usize) {
        for array in self.origin.iter_mut().chain(&mut self.direction) {
            array.resize(len, 0.0);
        }
        self.t_near.resize(len, 0.0);
        self.t_far.resize(len, 0.0);
        self.advance.resize(len, 0.0);
    }

    /// Converts `rays` for a scene in `frame`, turned aside a little where their hits are to be decided
    /// in f64.
    pub(crate) fn convert(&mut self, rays: &RayBatch, frame: &F32Frame) {
        let nudge = match rays.precision {
            HitPrecision::Double => NUDGE,
            HitPrecision::Single => 0.0,
        };
        self.resize(rays.len());
        convert(self, rays, frame, nudge);
    }

    /// Appends ray `i` of `from`, moved sideways by `shift` (m).
    pub(crate) fn push_shifted(&mut self, from: &Self, i: usize, shift: DVec3) {
        for axis in 0..3 {
            self.origin[axis].push(round(f64::from(from.origin[axis][i]) + shift[axis]));
            self.direction[axis].push(from.direction[axis][i]);
        }
        self.t_near.push(from.t_near[i]);
        self.t_far.push(from.t_far[i]);
        self.advance.push(from.advance[i]);
    }

    /// Appends ray `i` of `rays` without turning it, ahead as `from` has it.
    pub(crate) fn push_unturned(&mut self, rays: &RayBatch, from: &Self, i: usize) {
        self.push_shifted(from, i, DVec3::ZERO);
        for axis in 0..3 {
            if let Some(last) = self.direction[axis].last_mut() {
                *last = round(rays.directions()[axis][i]);
            }
        }
    }

    pub(crate) fn clear(&mut self) {
        self.resize(0);
    }
}

#[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is the purpose")]
#[inline]
pub(crate) fn round(x: f64) -> f32 {
    x as f32
}

/// Rays of a batch, as their arrays.
struct RayArrays<'a> {
    origins: [&'a [f64]; 3],
    directions: [&'a [f64]; 3],
    t_min: &'a [f64],
    t_max: &'a [f64],
}

/// A ray in single precision.
struct Ray32 {
    origin: [f32; 3],
    direction: [f32; 3],
    t_near: f32,
    t_far: f32,
    advance: f64,
}

impl<'a> RayArrays<'a> {
    #[inline(always)]
    fn of(rays: &'a RayBatch, first: usize, count: usize) -> Self {
        let end = first + count;
        let [ox, oy, oz] = rays.origins();
        let [dx, dy, dz] = rays.directions();
        Self {
            origins: [&ox[first..end], &oy[first..end], &oz[first..end]],
            directions: [&dx[first..end], &dy[first..end], &dz[first..end]],
            t_min: &rays.t_min()[first..end],
            t_max: &rays.t_max()[first..end],
        }
    }

    /// Ray `i` for a scene in `frame`, turned aside by `nudge`.
    #[inline(always)]
    fn ray(&self, i: usize, frame: &F32Frame, nudge: f64) -> Ray32 {
        let Self { origins: [ox, oy, oz], directions: [dx, dy, dz], t_min, t_max } = self;
        let far = FAR * frame.radius;
        let pull = nudge / frame.radius;
        // As BLUR is to NUDGE.
        let blur = 2.0 * nudge;
        let sphere = (1.0 + SPHERE_SLACK) * frame.radius;
        let x = ox[i] - frame.origin.x;
        let y = oy[i] - frame.origin.y;
        let z = oz[i] - frame.origin.z;
        // Distances along the ray to the foot of the perpendicular from the box's centre, and past
        // the box's sphere.
        let (cx, cy, cz) = (frame.centre.x - x, frame.centre.y - y, frame.centre.z - z);
        let foot = cx * dx[i] + cy * dy[i] + cz * dz[i];
        let (fx, fy, fz) = (cx - foot * dx[i], cy - foot * dy[i], cz - foot * dz[i]);
        let distance = cx.abs() + cy.abs() + cz.abs();
        let reach = sphere + f64::EPSILON * 4.0 * distance;
        // Embree wants finite numbers below 10¹⁸. Any comparison with NaN is false.
        let meets = (fx * fx + fy * fy + fz * fz <= reach * reach) & (foot >= -reach);
        let unit = dx[i] * dx[i] + dy[i] * dy[i] + dz[i] * dz[i] > 0.5;
        let sound = unit & (distance <= frame.radius * MOST_RADII) & (t_min[i] <= t_max[i]);
        // Only a far ray is moved ahead, to `far` before the foot.
        let start = (foot - far).max(0.0);
        let (x, y, z) = (x + dx[i] * start, y + dy[i] * start, z + dz[i] * start);
        let pad = SLOPE * blur * (x.abs() + y.abs() + z.abs());
        // The others are moved back.
        let back = if start > 0.0 { 0.0 } else { pad };
        let ahead = start - back;
        // Sideways: towards the box's centre, the more the farther out, and a little across.
        let [first, second] = ODD_AXES;
        let along = first[0] * dx[i] + first[1] * dy[i] + first[2] * dz[i];
        let odd = |axis: usize| if along.abs() < 0.8 { first[axis] } else { second[axis] };
        let sx = pull * fx + nudge * (odd(1) * dz[i] - odd(2) * dy[i]);
        let sy = pull * fy + nudge * (odd(2) * dx[i] - odd(0) * dz[i]);
        let sz = pull * fz + nudge * (odd(0) * dy[i] - odd(1) * dx[i]);
        let near = t_min[i] - ahead;
        let near = (near - (pad + SLOPE * blur * near)).max(0.0);
        let end = t_max[i] - ahead;
        // Without blur there is nothing to add, and 0 times infinity is no number.
        let more = if blur > 0.0 { pad + SLOPE * blur * end.max(0.0) } else { 0.0 };
        let end = (end + more).max(near);
        // A ray that cannot hit is put beside the scene, pointing away.
        let traced = meets & sound;
        let choose = |value: f64, otherwise: f64| round(if traced { value } else { otherwise });
        let t_near = choose(near, 0.0);
        Ray32 {
            origin: [
                choose(x - dx[i] * back, frame.centre.x + 2.0 * far),
                choose(y - dy[i] * back, frame.centre.y),
                choose(z - dz[i] * back, frame.centre.z),
            ],
            direction: [choose(dx[i] + sx, 1.0), choose(dy[i] + sy, 0.0), choose(dz[i] + sz, 0.0)],
            t_near,
            // Embree takes no ray that ends before it starts.
            t_far: choose(end, 0.0).max(t_near),
            advance: ahead,
        }
    }
}

#[multiversion::multiversion(targets = "simd")]
fn convert(out: &mut Rays32, rays: &RayBatch, frame: &F32Frame, nudge: f64) {
    let n = rays.len();
    let rays = RayArrays::of(rays, 0, n);
    let [px, py, pz] = out.origin.each_mut().map(|array| &mut array[..n]);
    let [qx, qy, qz] = out.direction.each_mut().map(|array| &mut array[..n]);
    let (t_near, t_far) = (&mut out.t_near[..n], &mut out.t_far[..n]);
    let advance = &mut out.advance[..n];
    for i in 0..n {
        let ray = rays.ray(i, frame, nudge);
        [px[i], py[i], pz[i]] = ray.origin;
        [qx[i], qy[i], qz[i]] = ray.direction;
        (t_near[i], t_far[i], advance[i]) = (ray.t_near, ray.t_far, ray.advance);
    }
}

/// The rays of a batch as blocks that have room for them.
#[multiversion::multiversion(targets = "simd")]
fn convert_blocks(blocks: &mut [RayBlock], batch: &RayBatch, frame: &F32Frame) {
    for (block, first) in blocks.iter_mut().zip((0..).step_by(LANES)) {
        // Of a length that is not known when the program is compiled: a loop of sixteen steps would be unrolled.
        let count = LANES.min(batch.len() - first);
        let rays = RayArrays::of(batch, first, count);
        let RayBlock { origin: [px, py, pz], direction: [qx, qy, qz], t_min, t_max, .. } = block;
        let (px, py, pz) = (&mut px[..count], &mut py[..count], &mut pz[..count]);
        let (qx, qy, qz) = (&mut qx[..count], &mut qy[..count], &mut qz[..count]);
        let (t_min, t_max) = (&mut t_min[..count], &mut t_max[..count]);
        for i in 0..count {
            let ray = rays.ray(i, frame, 0.0);
            [px[i], py[i], pz[i]] = ray.origin;
            [qx[i], qy[i], qz[i]] = ray.direction;
            (t_min[i], t_max[i]) = (ray.t_near, ray.t_far);
        }
    }
}
