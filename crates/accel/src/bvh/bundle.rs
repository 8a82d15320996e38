//! Rays side by side in one frame, and bounds of those that run the same way.

use etendue_geometry::glam::Vec3;

use super::lanes::{Arithmetic, Lanes};
use super::ray::{BoxTest, FAR, SKEW_TRIANGLE_ERROR, TriangleTest, axes, box_error, steer};
use crate::parts::{LocalRays, PartInstance};

/// Rays of a packet: as many as there are lanes.
pub(super) const PACKET: usize = 16;

/// Fewer rays than this are traced one by one.
pub(super) const FEWEST: u32 = 4;

/// Rays whose directions differ by more than this along an axis are traced one by one.
const WIDEST: f32 = 0.1;

/// The numbers of the set bits of `mask`, which are below [`PACKET`].
#[inline(always)]
pub(super) fn bits(mask: u32) -> SetBits {
    SetBits(mask)
}

pub(super) struct SetBits(u32);

impl Iterator for SetBits {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        let bit = self.0.trailing_zeros() as usize;
        if self.0 == 0 {
            return None;
        }
        self.0 &= self.0 - 1;
        Some(bit % PACKET)
    }
}

/// Bundle of rays in a frame, each as a [`NarrowRay`](super::ray::NarrowRay).
pub(super) struct FrameRays {
    origin: [[f32; PACKET]; 3],
    direction: [[f32; PACKET]; 3],
    error: [f32; PACKET],
    near: [f32; PACKET],
    length: [f64; PACKET],
    skipped: [f64; PACKET],
    /// Bit by bit: which run backwards along each axis.
    backwards: [u32; 3],
}

impl FrameRays {
    const ZERO: Self = Self {
        origin: [[0.0; PACKET]; 3],
        direction: [[0.0; PACKET]; 3],
        error: [0.0; PACKET],
        near: [0.0; PACKET],
        length: [0.0; PACKET],
        skipped: [0.0; PACKET],
        backwards: [0; 3],
    };

    /// The world's rays in a frame parallel to the world's, when they begin nearby and their directions
    /// are unit; `None` otherwise.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "single precision finds")]
    pub(super) fn parallel(
        instance: &PartInstance,
        origin: [&[f64; PACKET]; 3],
        direction: [&[f64; PACKET]; 3],
        t_min: &[f64; PACKET],
    ) -> Option<Self> {
        let scale = instance.parallel_scale;
        if scale == 0.0 {
            return None;
        }
        let mut rays = Self::ZERO;
        let mut odd = 0_u32;
        for i in 0..PACKET {
            // Far origins and directions of other lengths would lose too much: none of the packet
            // is taken.
            let [x, y, z] = instance.offset([origin[0][i], origin[1][i], origin[2][i]]);
            let distance = x.abs() + y.abs() + z.abs();
            let [dx, dy, dz] = [direction[0][i], direction[1][i], direction[2][i]];
            let stretch = dx * dx + dy * dy + dz * dz - 1.0;
            odd |= u32::from(!((distance * scale <= FAR) & (stretch.abs() < 0.1))) << i;
            // Rounded so that no box is missed: a nearer start, and a margin for the origin.
            let near = (t_min[i] * scale) as f32;
            rays.near[i] = near - near.abs() * f32::EPSILON;
            let size = largest(x.abs(), y.abs(), z.abs()) * scale;
            rays.error[i] = box_error(size as f32, instance.pad_at(distance) as f32);
            rays.origin[0][i] = (-x * scale) as f32;
            rays.origin[1][i] = (-y * scale) as f32;
            rays.origin[2][i] = (-z * scale) as f32;
            rays.direction[0][i] = dx as f32;
            rays.direction[1][i] = dy as f32;
            rays.direction[2][i] = dz as f32;
            rays.length[i] = scale;
        }
        rays.turn();
        (odd == 0).then_some(rays)
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "single precision finds")]
    #[expect(clippy::needless_range_loop, reason = "one lane of many arrays")]
    pub(super) fn new(local: &LocalRays<PACKET>, t_min: &[f64; PACKET]) -> Self {
        let mut rays = Self::ZERO;
        for i in 0..PACKET {
            let [ox, oy, oz] = [local.origin[0][i], local.origin[1][i], local.origin[2][i]];
            let [dx, dy, dz] =
                [local.direction[0][i], local.direction[1][i], local.direction[2][i]];
            let length = (dx * dx + dy * dy + dz * dz).sqrt();
            let inverse = 1.0 / length;
            let distance = (ox * ox + oy * oy + oz * oz).sqrt();
            let skipped = if distance > FAR { distance - 2.0 } else { 0.0 };
            let [dx, dy, dz] = [dx * inverse, dy * inverse, dz * inverse];
            let [ox, oy, oz] = [ox + dx * skipped, oy + dy * skipped, oz + dz * skipped];
            let near = (t_min[i] * length - skipped) as f32;
            let near = near - near.abs() * f32::EPSILON;
            rays.near[i] = if near > 0.0 { near } else { 0.0 };
            rays.length[i] = length;
            rays.skipped[i] = skipped;
            let size = largest(ox.abs(), oy.abs(), oz.abs());
            rays.error[i] = box_error(size as f32, local.pad[i] as f32);
            (rays.origin[0][i], rays.direction[0][i]) = (ox as f32, dx as f32);
            (rays.origin[1][i], rays.direction[1][i]) = (oy as f32, dy as f32);
            (rays.origin[2][i], rays.direction[2][i]) = (oz as f32, dz as f32);
        }
        rays.turn();
        rays
    }

    /// Works out what follows from the directions.
    #[inline(always)]
    fn turn(&mut self) {
        for axis in 0..3 {
            for i in 0..PACKET {
                let backwards = self.direction[axis][i].is_sign_negative();
                self.backwards[axis] |= u32::from(backwards) << i;
            }
        }
    }

    /// The rays of `group` that run towards the same octant as its first.
    #[inline(always)]
    pub(super) fn same_octant(&self, group: u32) -> u32 {
        let first = group.trailing_zeros();
        let mut same = group;
        for backwards in self.backwards {
            same &= if backwards >> first & 1 != 0 { backwards } else { !backwards };
        }
        same
    }

    /// The rays' own distances for `t`, rounded up with room for the error of either.
    #[inline(always)]
    pub(super) fn far(&self, t: &[f64; PACKET]) -> [f32; PACKET] {
        let mut far = [0.0; PACKET];
        for i in 0..PACKET {
            far[i] = self.far_one(i, t[i]);
        }
        far
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "single precision finds")]
    pub(super) fn far_one(&self, i: usize, t: f64) -> f32 {
        let far = ((t * self.length[i] - self.skipped[i]) as f32).max(f32::MIN);
        far + (far.abs() * (4.0 * f32::EPSILON) + self.error[i])
    }

    /// A triangle that ends before this ends before `t`.
    #[inline(always)]
    pub(super) fn surely_far(&self, t: &[f64; PACKET]) -> [f32; PACKET] {
        let mut far = [0.0; PACKET];
        for i in 0..PACKET {
            far[i] = self.surely_far_one(i, t[i]);
        }
        far
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "single precision finds")]
    pub(super) fn surely_far_one(&self, i: usize, t: f64) -> f32 {
        let far = (t * self.length[i] - self.skipped[i]) as f32;
        // Infinity less infinity is no number; everything ends before infinity.
        if far == f32::INFINITY {
            return far;
        }
        far - (far.abs() * (4.0 * f32::EPSILON) + self.error[i])
    }

    /// A triangle that begins behind this begins behind `t`.
    #[inline(always)]
    pub(super) fn surely_near(&self, t: &[f64; PACKET]) -> [f32; PACKET] {
        self.far(t)
    }
}

#[inline(always)]
fn largest(a: f64, b: f64, c: f64) -> f64 {
    let ab = if a > b { a } else { b };
    if ab > c { ab } else { c }
}

/// Bounds of some of the rays, and the rays side by side.
pub(super) struct Bundle<L: Lanes> {
    pub(super) boxes: BoxTest<L>,
    pub(super) triangles: TriangleTest<L::Sixteen>,
}

impl<L: Lanes> Bundle<L> {
    /// Of the rays of `group`, which run towards the same octant. `None` when they are too few or run
    /// too far apart to be worth it.
    #[inline(always)]
    pub(super) fn new(lanes: L, rays: &FrameRays, group: u32) -> Option<Self> {
        if group.count_ones() < FEWEST {
            return None;
        }
        let first = group.trailing_zeros() as usize % PACKET;
        let direction = [
            range(lanes, &rays.direction[0], group, first),
            range(lanes, &rays.direction[1], group, first),
            range(lanes, &rays.direction[2], group, first),
        ];
        for [least, most] in direction {
            if most - least > WIDEST {
                return None;
            }
        }
        let error = range(lanes, &rays.error, group, first)[1];
        Some(Self {
            boxes: box_test(lanes, rays, group, direction, error),
            triangles: triangle_test(lanes, rays, group, first, error),
        })
    }
}

/// The least and the greatest of the numbers of `group`, of which `first` is one.
#[inline(always)]
fn range<L: Lanes>(lanes: L, numbers: &[f32; PACKET], group: u32, first: usize) -> [f32; 2] {
    let l = lanes.sixteen();
    let numbers = l.select(group, lanes.load_sixteen(numbers), l.splat(numbers[first]));
    [l.least(numbers), l.greatest(numbers)]
}

/// A distance to a near plane is at least that from the origin closest to it, at the highest speed;
/// where that is negative it does not matter, for rays begin at 0 or later. Likewise far.
#[inline(always)]
fn box_test<L: Lanes>(
    lanes: L,
    rays: &FrameRays,
    group: u32,
    direction: [[f32; 2]; 3],
    error: f32,
) -> BoxTest<L> {
    let first = group.trailing_zeros() as usize % PACKET;
    let zero = lanes.splat(0.0);
    let mut test = BoxTest {
        backwards: [0; 3],
        inverse_near: [zero; 3],
        inverse_far: [zero; 3],
        near_offset: [zero; 3],
        far_offset: [zero; 3],
        near: lanes.splat(range(lanes, &rays.near, group, first)[0]),
    };
    for (axis, [a, b]) in direction.into_iter().enumerate() {
        let [least, most] = range(lanes, &rays.origin[axis], group, first);
        let (least, most) = (least - error, most + error);
        let backwards = rays.backwards[axis] >> first & 1 != 0;
        // All of one sign: the slowest reciprocal is that of the longest direction.
        let (slow, fast, near, far) =
            if backwards { (a, b, least, most) } else { (b, a, most, least) };
        let (slow, fast) = (1.0 / steer(slow), 1.0 / steer(fast));
        test.backwards[axis] = usize::from(backwards);
        test.inverse_near[axis] = lanes.splat(slow);
        test.inverse_far[axis] = lanes.splat(fast);
        test.near_offset[axis] = lanes.splat(near * slow);
        test.far_offset[axis] = lanes.splat(far * fast);
    }
    test
}

/// Each ray of a packet against one box, as [`BoxTest`] is one ray against eight.
pub(super) struct EachRay<A: Arithmetic> {
    backwards: [bool; 3],
    inverse: [A::F; 3],
    near_offset: [A::F; 3],
    far_offset: [A::F; 3],
    near: A::F,
}

impl<A: Arithmetic> EachRay<A> {
    /// Of the rays of `group`, which run towards the same octant; the others' answers mean nothing.
    #[inline(always)]
    pub(super) fn new<L: Lanes<Sixteen = A>>(lanes: L, rays: &FrameRays, group: u32) -> Self {
        let first = group.trailing_zeros();
        let mut inverse = [[0.0; PACKET]; 3];
        let mut offset = [[[0.0; PACKET]; 3]; 2];
        for axis in 0..3 {
            for i in 0..PACKET {
                let slope = 1.0 / steer(rays.direction[axis][i]);
                let widening = slope.abs() * rays.error[i];
                inverse[axis][i] = slope;
                offset[0][axis][i] = rays.origin[axis][i] * slope + widening;
                offset[1][axis][i] = rays.origin[axis][i] * slope - widening;
            }
        }
        let load = |axes: [[f32; PACKET]; 3]| {
            let [x, y, z] = axes;
            [lanes.load_sixteen(&x), lanes.load_sixteen(&y), lanes.load_sixteen(&z)]
        };
        let [near_offset, far_offset] = offset;
        Self {
            backwards: rays.backwards.map(|backwards| backwards >> first & 1 != 0),
            inverse: load(inverse),
            near_offset: load(near_offset),
            far_offset: load(far_offset),
            near: lanes.load_sixteen(&rays.near),
        }
    }

    /// Mask of the rays that meet the box before `far`.
    #[inline(always)]
    pub(super) fn meet(&self, l: A, [lo, hi]: [[f32; 3]; 2], far: A::F) -> u32 {
        let (mut enter, mut leave) = (self.near, far);
        for axis in 0..3 {
            let (lo, hi) = (l.splat(lo[axis]), l.splat(hi[axis]));
            let (near, far) = if self.backwards[axis] { (hi, lo) } else { (lo, hi) };
            enter = l.max(enter, l.mul_sub(near, self.inverse[axis], self.near_offset[axis]));
            leave = l.min(leave, l.mul_sub(far, self.inverse[axis], self.far_offset[axis]));
        }
        l.le(enter, leave)
    }
}

/// All rays sheared along the same axes. The first ray's longest component is at least 1/√3, and the
/// others' differ by at most [`WIDEST`], so no shear is more than 2.1.
#[inline(always)]
fn triangle_test<L: Lanes>(
    lanes: L,
    rays: &FrameRays,
    group: u32,
    first: usize,
    error: f32,
) -> TriangleTest<L::Sixteen> {
    let l = lanes.sixteen();
    let direction = &rays.direction;
    let axes = axes(Vec3::new(direction[0][first], direction[1][first], direction[2][first]));
    let [x, y, z] = axes;
    let inverse = l.div(l.splat(1.0), lanes.load_sixteen(&direction[z]));
    let near = l.select(group, lanes.load_sixteen(&rays.near), l.splat(f32::INFINITY));
    TriangleTest {
        axes,
        origin: [
            lanes.load_sixteen(&rays.origin[x]),
            lanes.load_sixteen(&rays.origin[y]),
            lanes.load_sixteen(&rays.origin[z]),
        ],
        shear: [
            l.mul(lanes.load_sixteen(&direction[x]), inverse),
            l.mul(lanes.load_sixteen(&direction[y]), inverse),
            inverse,
        ],
        error: l.splat(SKEW_TRIANGLE_ERROR * error),
        near,
    }
}
