//! Sixteen neighbouring rays at a time: through the tree as one bundle, through triangles side by
//! side.
//!
//! A bundle visits what any of its rays may visit. Its box test is that of a single ray
//! ([`BoxTest`]), with reciprocals and offsets that bound those of all its rays, so a node costs the
//! bundle what it costs one ray (interval arithmetic, after S. Boulos et al., "Packet-based Whitted and
//! distribution ray tracing", 2007). For bounds to exist the rays must run towards the same octant;
//! a packet that does not is taken apart into bundles that do.

use etendue_geometry::RayBatch;
use etendue_geometry::glam::{DVec3, Vec3};
use pulp::NullaryFnOnce;

use super::Bvh;
use super::lanes::Lanes;
use super::placed::PlacedTriangles;
use super::ray::{BoxTest, NarrowRay, TriangleTest, axes, safe_reciprocal};
use super::single::{Search, Sink, Stacks, Visit};
use super::traverse::{Leaves, Stack, traverse};
use super::wide::{Cell, Child, leaf_numbers};
use crate::nearest::Query;
use crate::parts::Instance;

/// Rays of a packet: two times eight lanes.
pub(super) const PACKET: usize = 16;

/// Fewer rays than this are traced one by one.
const FEWEST: u32 = 4;

/// Rays whose directions differ by more than this along an axis are traced one by one.
const WIDEST: f32 = 0.25;

/// Sixteen rays and what has become of them.
pub(super) struct Packet<S> {
    queries: [Query; PACKET],
    sinks: [S; PACKET],
    /// How far each looks.
    t_max: [f64; PACKET],
    /// A bit for every ray that may still hit something.
    active: u32,
    /// A bit for every ray that could at first.
    sound: u32,
}

/// The numbers of the set bits of `mask`.
#[inline(always)]
fn bits(mask: u32) -> Bits {
    Bits(mask)
}

struct Bits(u32);

impl Iterator for Bits {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        let bit = self.0.trailing_zeros() as usize;
        self.0 &= self.0.wrapping_sub(1);
        (bit < 32).then_some(bit)
    }
}

impl<S: Sink> Packet<S> {
    /// The rays of a batch from `first` on.
    #[inline(always)]
    pub(super) fn of(rays: &RayBatch, first: usize) -> Self {
        let mut sound = 0;
        let queries: [Query; PACKET] = std::array::from_fn(|lane| {
            if let Some(query) = Query::of(rays, first + lane) {
                sound |= 1 << lane;
                query
            } else {
                Query { origin: DVec3::ZERO, direction: DVec3::X, t_min: 0.0, t_max: -1.0 }
            }
        });
        let sinks = std::array::from_fn(|lane| S::new(&queries[lane]));
        let t_max = std::array::from_fn(|lane| queries[lane].t_max);
        Self { queries, sinks, t_max, active: sound, sound }
    }

    #[inline(always)]
    pub(super) fn trace<L: Lanes>(&mut self, lanes: L, bvh: &Bvh, stacks: &mut Stacks) {
        if let [instance] = &bvh.layout.instances[..] {
            let group = self.active;
            let stack = &mut stacks.inner;
            lanes.run(VisitTogether { lanes, bvh, packet: self, instance, group, stack });
        } else if !bvh.top.cells.is_empty() {
            let world = &bvh.layout.world;
            let narrow = self.narrow(world, self.active);
            let mut rest = self.active;
            while rest != 0 {
                let group = octant(&narrow, rest);
                rest &= !group;
                self.trace_instances(lanes, bvh, &narrow, group, stacks);
            }
        }
    }

    /// Hands over the answers of all rays that could hit.
    #[inline(always)]
    pub(super) fn finish(self, mut sink: impl FnMut(usize, S)) {
        for (lane, answer) in self.sinks.into_iter().enumerate() {
            if self.sound & 1 << lane != 0 {
                sink(lane, answer);
            }
        }
    }

    /// The rays of `group` in `instance`'s frame, and copies of one of them elsewhere.
    #[inline(always)]
    fn narrow(&self, instance: &Instance, group: u32) -> [NarrowRay; PACKET] {
        let some = group.trailing_zeros() as usize % PACKET;
        let mut narrow = [NarrowRay::new(instance, &self.queries[some]); PACKET];
        for lane in bits(group) {
            narrow[lane] = NarrowRay::new(instance, &self.queries[lane]);
        }
        narrow
    }

    #[inline(always)]
    fn trace_instances<L: Lanes>(
        &mut self,
        lanes: L,
        bvh: &Bvh,
        narrow: &[NarrowRay; PACKET],
        group: u32,
        stacks: &mut Stacks,
    ) {
        let Some(bundle) = Bundle::new(lanes, narrow, group) else {
            for lane in bits(group) {
                let mut search = self.search(lanes, bvh, lane, &mut stacks.inner);
                search.run(&mut stacks.outer);
            }
            return;
        };
        let stack = &mut stacks.inner;
        let far = self.farthest(narrow, group);
        let mut leaves = InstanceLeaves { lanes, bvh, packet: self, narrow, group, stack };
        traverse(lanes, &bvh.top.cells, &bundle.boxes, far, &mut stacks.outer, &mut leaves);
    }

    #[inline(always)]
    fn search<'a, L: Lanes>(
        &'a mut self,
        lanes: L,
        bvh: &'a Bvh,
        lane: usize,
        stack: &'a mut Stack,
    ) -> Search<'a, L, S> {
        let t_max = self.t_max[lane];
        Search { lanes, bvh, query: &self.queries[lane], t_max, sink: &mut self.sinks[lane], stack }
    }

    /// The farthest that any active ray of `group` looks.
    #[inline(always)]
    fn farthest(&self, narrow: &[NarrowRay; PACKET], group: u32) -> f32 {
        bits(group & self.active)
            .fold(f32::NEG_INFINITY, |far, lane| far.max(narrow[lane].far(self.t_max[lane])))
    }
}

/// The rays of `group` that run towards the same octant as its first.
#[inline(always)]
fn octant(narrow: &[NarrowRay; PACKET], group: u32) -> u32 {
    let signs = |lane: usize| {
        let d = narrow[lane % PACKET].direction;
        [d.x.is_sign_negative(), d.y.is_sign_negative(), d.z.is_sign_negative()]
    };
    let first = signs(group.trailing_zeros() as usize);
    bits(group).filter(|&lane| signs(lane) == first).fold(0, |mask, lane| mask | 1 << lane)
}

/// Bounds of a group of rays, and the rays side by side.
struct Bundle<L: Lanes> {
    boxes: BoxTest<L>,
    triangles: [TriangleTest<L>; 2],
}

impl<L: Lanes> Bundle<L> {
    /// `None` when the rays are too few or run too far apart to be worth it.
    #[inline(always)]
    fn new(lanes: L, narrow: &[NarrowRay; PACKET], group: u32) -> Option<Self> {
        if group.count_ones() < FEWEST {
            return None;
        }
        let first = narrow[group.trailing_zeros() as usize % PACKET];
        let mut bounds = RayBounds::new(&first);
        for lane in bits(group) {
            bounds.include(&narrow[lane % PACKET]);
        }
        if (bounds.direction[1] - bounds.direction[0]).max_element() > WIDEST {
            return None;
        }
        Some(Self {
            boxes: bounds.box_test(lanes),
            triangles: [
                bounds.triangle_test(lanes, narrow, group, 0),
                bounds.triangle_test(lanes, narrow, group, 8),
            ],
        })
    }
}

/// What the numbers of some rays lie between.
struct RayBounds {
    /// Least and greatest.
    origin: [Vec3; 2],
    direction: [Vec3; 2],
    /// Sizes of the reciprocals of directions.
    inverse: [Vec3; 2],
    error: f32,
    near: f32,
    first: Vec3,
}

impl RayBounds {
    #[inline(always)]
    fn new(ray: &NarrowRay) -> Self {
        let inverse = safe_reciprocal(ray.direction).abs();
        Self {
            origin: [ray.origin; 2],
            direction: [ray.direction; 2],
            inverse: [inverse; 2],
            error: ray.error,
            near: ray.near,
            first: ray.direction,
        }
    }

    #[inline(always)]
    fn include(&mut self, ray: &NarrowRay) {
        let inverse = safe_reciprocal(ray.direction).abs();
        self.origin = [self.origin[0].min(ray.origin), self.origin[1].max(ray.origin)];
        self.direction =
            [self.direction[0].min(ray.direction), self.direction[1].max(ray.direction)];
        self.inverse = [self.inverse[0].min(inverse), self.inverse[1].max(inverse)];
        self.error = self.error.max(ray.error);
        self.near = self.near.min(ray.near);
    }

    /// A distance to a near plane is at least that from the origin closest to it, at the highest
    /// speed; where that is negative it does not matter, for rays begin at 0 or later. Likewise far.
    #[inline(always)]
    fn box_test<L: Lanes>(&self, l: L) -> BoxTest<L> {
        let [least, most] = self.origin;
        let (least, most) = (least - self.error, most + self.error);
        let zero = l.splat(0.0);
        let mut test = BoxTest {
            backwards: [0; 3],
            inverse_near: [zero; 3],
            inverse_far: [zero; 3],
            near_offset: [zero; 3],
            far_offset: [zero; 3],
            near: l.splat(self.near),
        };
        for axis in 0..3 {
            let backwards = self.first[axis].is_sign_negative();
            let (sign, near_origin, far_origin) = if backwards {
                (-1.0, least[axis], most[axis])
            } else {
                (1.0, most[axis], least[axis])
            };
            let (slow, fast) = (sign * self.inverse[0][axis], sign * self.inverse[1][axis]);
            test.backwards[axis] = usize::from(backwards);
            test.inverse_near[axis] = l.splat(slow);
            test.inverse_far[axis] = l.splat(fast);
            test.near_offset[axis] = l.splat(near_origin * slow);
            test.far_offset[axis] = l.splat(far_origin * fast);
        }
        test
    }

    /// Eight rays from `first` on, all sheared along the same axes. No direction is much longer along
    /// the others, because the rays differ by at most [`WIDEST`].
    #[inline(always)]
    fn triangle_test<L: Lanes>(
        &self,
        l: L,
        narrow: &[NarrowRay; PACKET],
        group: u32,
        first: usize,
    ) -> TriangleTest<L> {
        let axes = axes(self.first);
        let mut origin = [[0.0; 8]; 3];
        let mut shear = [[0.0; 8]; 3];
        let mut near = [f32::INFINITY; 8];
        for lane in 0..8 {
            let ray = &narrow[(first + lane) % PACKET];
            let inverse = 1.0 / ray.direction[axes[2]];
            for k in 0..3 {
                origin[k][lane] = ray.origin[axes[k]];
                shear[k][lane] = if k == 2 { inverse } else { ray.direction[axes[k]] * inverse };
            }
            if group & 1 << (first + lane) != 0 {
                near[lane] = ray.near - 8.0 * self.error;
            }
        }
        TriangleTest {
            axes,
            origin: [l.load(&origin[0]), l.load(&origin[1]), l.load(&origin[2])],
            shear: [l.load(&shear[0]), l.load(&shear[1]), l.load(&shear[2])],
            error: l.splat(8.0 * self.error),
            near: l.load(&near),
        }
    }
}

/// Leaves of the tree over the instances.
struct InstanceLeaves<'a, L, S> {
    lanes: L,
    bvh: &'a Bvh,
    packet: &'a mut Packet<S>,
    narrow: &'a [NarrowRay; PACKET],
    group: u32,
    stack: &'a mut Stack,
}

impl<L: Lanes, S: Sink> Leaves for InstanceLeaves<'_, L, S> {
    #[inline(always)]
    fn see(&mut self, leaf: Child, _: f32) -> Option<f32> {
        let (lanes, bvh) = (self.lanes, self.bvh);
        for number in leaf_numbers(&bvh.top.cells, leaf)?.get(..leaf.count())? {
            let instance = bvh.layout.instances.get(number.to_bits() as usize)?;
            let group = self.group & self.packet.active;
            let (packet, stack) = (&mut *self.packet, &mut *self.stack);
            lanes.run(VisitTogether { lanes, bvh, packet, instance, group, stack });
        }
        if self.group & self.packet.active == 0 {
            return None;
        }
        Some(self.packet.farthest(self.narrow, self.group))
    }
}

/// The visit of the rays of `group` to one instance.
struct VisitTogether<'a, L, S> {
    lanes: L,
    bvh: &'a Bvh,
    packet: &'a mut Packet<S>,
    instance: &'a Instance,
    group: u32,
    stack: &'a mut Stack,
}

impl<L: Lanes, S: Sink> NullaryFnOnce for VisitTogether<'_, L, S> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { lanes, bvh, packet, instance, mut group, stack } = self;
        if group == 0 {
            return;
        }
        let narrow = packet.narrow(instance, group);
        while group != 0 {
            let together = octant(&narrow, group);
            group &= !together;
            if let Some(bundle) = Bundle::new(lanes, &narrow, together) {
                trace_bundle(lanes, bvh, packet, instance, &narrow, (bundle, together), stack);
                continue;
            }
            for lane in bits(together) {
                let mut search = packet.search(lanes, bvh, lane, stack);
                let go_on = lanes.run(Visit { search: &mut search, instance });
                packet.t_max[lane] = search.t_max;
                if !go_on {
                    packet.active &= !(1 << lane);
                }
            }
        }
    }
}

#[inline(always)]
fn trace_bundle<L: Lanes, S: Sink>(
    lanes: L,
    bvh: &Bvh,
    packet: &mut Packet<S>,
    instance: &Instance,
    narrow: &[NarrowRay; PACKET],
    (bundle, group): (Bundle<L>, u32),
    stack: &mut Stack,
) {
    let cells: &[Cell] = &bvh.parts[instance.part as usize].tree.cells;
    let mut far = [f32::NEG_INFINITY; PACKET];
    for lane in bits(group) {
        far[lane] = narrow[lane].far(packet.t_max[lane]);
    }
    let farthest = packet.farthest(narrow, group);
    let triangles = PlacedTriangles::new(bvh, instance);
    let Bundle { boxes, triangles: tests } = bundle;
    let mut leaves = TriangleLeaves { lanes, cells, triangles, packet, narrow, group, far, tests };
    traverse(lanes, cells, &boxes, farthest, stack, &mut leaves);
}

/// Leaves of a part.
struct TriangleLeaves<'a, L: Lanes, S> {
    lanes: L,
    cells: &'a [Cell],
    triangles: PlacedTriangles<'a>,
    packet: &'a mut Packet<S>,
    narrow: &'a [NarrowRay; PACKET],
    group: u32,
    /// How far each ray looks in this frame; −∞ for rays of no concern.
    far: [f32; PACKET],
    tests: [TriangleTest<L>; 2],
}

impl<L: Lanes, S: Sink> Leaves for TriangleLeaves<'_, L, S> {
    #[inline(always)]
    fn see(&mut self, leaf: Child, far: f32) -> Option<f32> {
        let n = leaf.count();
        let numbers = leaf_numbers(self.cells, leaf)?;
        let mut any = false;
        for i in 0..n {
            let (low, high) = (self.far.first_chunk()?, self.far.last_chunk()?);
            let [a, b] = &self.tests;
            let low = a.maybe_rays(self.lanes, numbers, n, i, self.lanes.load(low));
            let high = b.maybe_rays(self.lanes, numbers, n, i, self.lanes.load(high));
            let maybe = low | high << 8;
            if maybe != 0 {
                any = true;
                self.test(numbers, n, i, maybe)?;
            }
        }
        if !any {
            return Some(far);
        }
        if self.group & self.packet.active == 0 {
            return None;
        }
        Some(self.far.iter().fold(f32::NEG_INFINITY, |most, &far| most.max(far)))
    }
}

impl<L: Lanes, S: Sink> TriangleLeaves<'_, L, S> {
    /// The exact test of triangle `i` of a leaf for some rays.
    #[inline(always)]
    fn test(
        &mut self,
        numbers: &[f32; 8 * super::wide::LEAF_CELLS],
        n: usize,
        i: usize,
        maybe: u32,
    ) -> Option<()> {
        let (placed, triangle, corners) = self.triangles.get(numbers, n, i)?;
        for lane in bits(maybe) {
            let lane = lane % PACKET;
            let t_max = &mut self.packet.t_max[lane];
            let Some(hit) = self.packet.queries[lane].test(&placed.view, corners) else { continue };
            if hit.t > *t_max {
                continue;
            }
            match self.packet.sinks[lane].take(hit, placed.placement, triangle) {
                Some(limit) => {
                    *t_max = limit;
                    self.far[lane] = self.narrow[lane].far(limit);
                }
                None => {
                    self.packet.active &= !(1 << lane);
                    self.far[lane] = f32::NEG_INFINITY;
                }
            }
        }
        Some(())
    }
}
