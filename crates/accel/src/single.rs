//! Rays in single precision, as fast backends trace them: relative to an origin near the scene, and
//! started where they enter its box, so that f32's 24 bits are spent on the scene alone.

use etendue_geometry::glam::DVec3;
use etendue_geometry::{Bounds, RayBatch};

/// The box of a scene and the origin that single-precision coordinates are relative to.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Frame {
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

/// A unit vector that no sensible ray runs along.
const ODD_AXIS: [f64; 3] = [0.48, 0.6, 0.64];

/// Rays that start farther from the box than this many half-diagonals are started nearer.
const FAR: f64 = 4.0;

impl Frame {
    pub(crate) fn of(bounds: Bounds) -> Self {
        let radius = (bounds.diagonal() * 0.5).max(f64::from(f32::MIN_POSITIVE));
        let centre = bounds.centre();
        let origin = if centre.length() > NEAR * radius { centre } else { DVec3::ZERO };
        let half = if bounds.is_empty() {
            DVec3::NEG_INFINITY
        } else {
            (bounds.max - bounds.min) * 0.5 + 1e-6 * (radius + (centre - origin).length())
        };
        Self { origin, centre: centre - origin, radius, half }
    }

    /// Lateral distance (m) by which rays are moved on purpose before they are rounded.
    ///
    /// A ray aimed exactly at a vertex slips between its triangles in single precision about once in
    /// a hundred times, even in Embree's robust mode: the signs of the edge functions around the
    /// vertex are then all noise. A few units in the last place beside the vertex they are not. The
    /// move is towards the centre of the scene's box, so that at the outline, where a miss could
    /// never be checked, rays err on the side of hitting, and f64 decides.
    fn nudge(&self) -> f64 {
        2.0 * f64::from(f32::EPSILON) * (self.centre.length() + FAR * self.radius)
    }

    /// Whether ray `i`'s line may meet the scene's box: separating axes along the cross products of
    /// the line with the box's axes. Safe rather than tight.
    pub(crate) fn may_meet(&self, rays: &RayBatch, i: usize) -> bool {
        let d = rays.direction(i);
        let moment = (self.centre - (rays.origin(i) - self.origin)).cross(d).abs();
        let (h, a) = (self.half, d.abs());
        let reach = DVec3::new(h.y * a.z + h.z * a.y, h.z * a.x + h.x * a.z, h.x * a.y + h.y * a.x);
        moment.cmple(reach).all()
    }

    /// Lateral distance (m) by which single precision may misplace a ray against the scene: a few
    /// units in the last place of the largest coordinate there is.
    pub(crate) fn blur(&self) -> f64 {
        8.0 * f64::from(f32::EPSILON) * (self.centre.length() + (1.0 + FAR) * self.radius)
    }
}

/// A batch of rays in single precision.
#[derive(Debug, Default)]
pub(crate) struct Rays32 {
    pub(crate) origin: [Vec<f32>; 3],
    pub(crate) direction: [Vec<f32>; 3],
    pub(crate) t_near: Vec<f32>,
    pub(crate) t_far: Vec<f32>,
    /// How far (m) each ray was moved ahead of its true origin.
    pub(crate) advance: Vec<f64>,
}

impl Rays32 {
    pub(crate) fn len(&self) -> usize {
        self.t_near.len()
    }

    fn resize(&mut self, len: usize) {
        for array in self.origin.iter_mut().chain(&mut self.direction) {
            array.resize(len, 0.0);
        }
        self.t_near.resize(len, 0.0);
        self.t_far.resize(len, 0.0);
        self.advance.resize(len, 0.0);
    }

    /// Converts `rays` for a scene in `frame`.
    pub(crate) fn convert(&mut self, rays: &RayBatch, frame: &Frame) {
        self.resize(rays.len());
        convert(self, rays, frame);
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

    pub(crate) fn clear(&mut self) {
        self.resize(0);
    }
}

#[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is the purpose")]
#[inline]
pub(crate) fn round(x: f64) -> f32 {
    x as f32
}

#[multiversion::multiversion(targets(
    "x86_64+avx512f+avx512dq+avx512vl",
    "x86_64+avx2",
    "aarch64+neon"
))]
fn convert(out: &mut Rays32, rays: &RayBatch, frame: &Frame) {
    let n = rays.t_min.len();
    let [ox, oy, oz] = rays.origin.each_ref().map(|array| &array[..n]);
    let [dx, dy, dz] = rays.direction.each_ref().map(|array| &array[..n]);
    let (t_min, t_max) = (&rays.t_min[..n], &rays.t_max[..n]);
    let [px, py, pz] = out.origin.each_mut().map(|array| &mut array[..n]);
    let [qx, qy, qz] = out.direction.each_mut().map(|array| &mut array[..n]);
    let (t_near, t_far) = (&mut out.t_near[..n], &mut out.t_far[..n]);
    let advance = &mut out.advance[..n];
    let far = FAR * frame.radius;
    let pull = frame.nudge() / frame.radius;
    let push = 0.5 * frame.nudge();
    for i in 0..n {
        let x = ox[i] - frame.origin.x;
        let y = oy[i] - frame.origin.y;
        let z = oz[i] - frame.origin.z;
        // Distances along the ray to the foot of the perpendicular from the box's centre, and past
        // the box's sphere.
        let (cx, cy, cz) = (frame.centre.x - x, frame.centre.y - y, frame.centre.z - z);
        let foot = cx * dx[i] + cy * dy[i] + cz * dz[i];
        // Only a far ray is moved ahead, to `far` before the foot.
        let ahead = (foot - far).max(0.0);
        advance[i] = ahead;
        // Sideways: towards the box's centre, the more the farther out, and a little across.
        let sx = pull * (cx - foot * dx[i]) + push * (ODD_AXIS[1] * dz[i] - ODD_AXIS[2] * dy[i]);
        let sy = pull * (cy - foot * dy[i]) + push * (ODD_AXIS[2] * dx[i] - ODD_AXIS[0] * dz[i]);
        let sz = pull * (cz - foot * dz[i]) + push * (ODD_AXIS[0] * dy[i] - ODD_AXIS[1] * dx[i]);
        px[i] = round(x + dx[i] * ahead + sx);
        py[i] = round(y + dy[i] * ahead + sy);
        pz[i] = round(z + dz[i] * ahead + sz);
        qx[i] = round(dx[i]);
        qy[i] = round(dy[i]);
        qz[i] = round(dz[i]);
        t_near[i] = round((t_min[i] - ahead).max(0.0) * (1.0 - 1e-6));
        // Embree takes no ray that ends before it starts.
        t_far[i] = round((t_max[i] - ahead) * (1.0 + 1e-6)).max(t_near[i]);
    }
}
