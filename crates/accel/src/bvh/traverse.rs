//! One ray through a tree of eight boxes a node, from near to far.

use super::lanes::Lanes;
use super::ray::BoxTest;
use super::wide::{Child, NodeChunk, WideNode};
use crate::tree::MAX_DEPTH;

/// Children still to visit, each with the distance at which the ray enters it in the upper half
/// and the [`Child`] in the lower: positive floats order like their bits.
pub(super) struct TraversalStack(Box<[u64; STACK]>);

/// Seven siblings a level, rounded up to a power of two so that an index can be masked.
const STACK: usize = (7 * MAX_DEPTH + 1).next_power_of_two();

impl TraversalStack {
    pub(super) fn new() -> Self {
        Self(Box::new([0; STACK]))
    }
}

#[inline(always)]
fn entry(near: f32, child: f32) -> u64 {
    u64::from(near.to_bits()) << 32 | u64::from(child.to_bits())
}

#[inline(always)]
fn node_at(cells: &[NodeChunk], child: Child) -> Option<&WideNode> {
    cells.get(child.place()..child.place() + 7)?.first_chunk()
}

#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "the lower half")]
fn child(entry: u64) -> Child {
    Child(entry as u32)
}

/// Mask of the eight boxes of a node that the ray meets before `far`, and the distances.
#[inline(always)]
pub(super) fn meet<L: Lanes>(
    lanes: L,
    node: &WideNode,
    test: &BoxTest<L>,
    far: L::F,
) -> (u32, L::F) {
    let l = lanes;
    let [x, y, z] = [0, 1, 2];
    let enter = l.max(
        l.max(near(l, node, test, x), near(l, node, test, y)),
        l.max(near(l, node, test, z), test.near),
    );
    let leave = l.min(
        l.min(end(l, node, test, x), end(l, node, test, y)),
        l.min(end(l, node, test, z), far),
    );
    (l.le(enter, leave), enter)
}

/// Distances at which the ray passes the eight near planes across `axis`, or before.
#[inline(always)]
fn near<L: Lanes>(l: L, node: &WideNode, test: &BoxTest<L>, axis: usize) -> L::F {
    let plane = l.load(&node[2 * axis + (test.backwards[axis] & 1)].0);
    l.mul_sub(plane, test.inverse_near[axis], test.near_offset[axis])
}

/// Distances at which the ray passes the eight far planes across `axis`, or behind.
#[inline(always)]
fn end<L: Lanes>(l: L, node: &WideNode, test: &BoxTest<L>, axis: usize) -> L::F {
    let plane = l.load(&node[2 * axis + (!test.backwards[axis] & 1)].0);
    l.mul_sub(plane, test.inverse_far[axis], test.far_offset[axis])
}

/// Visitor of leaves. (A trait and no closure, because only what is marked so is inlined, and only
/// what is inlined may use the lanes.)
pub(super) trait Leaves {
    /// Looks into `leaf`; answers how far to look from there on, or `None` to end.
    fn see(&mut self, leaf: Child, far: f32) -> Option<f32>;
}

/// Shows every leaf that the ray meets before `far`, near ones first.
#[inline(always)]
pub(super) fn traverse<L: Lanes>(
    lanes: L,
    cells: &[NodeChunk],
    test: &BoxTest<L>,
    mut far: f32,
    stack: &mut TraversalStack,
    leaves: &mut impl Leaves,
) {
    let stack = &mut *stack.0;
    let mut height = 0;
    let mut current = Child::ROOT;
    let mut far_lanes = lanes.splat(far);
    loop {
        if current.count() > 0 {
            match leaves.see(current, far) {
                Some(limit) => far = limit,
                None => return,
            }
            far_lanes = lanes.splat(far);
        } else {
            let Some(node) = node_at(cells, current) else { return };
            let (mut children, near) = meet(lanes, node, test, far_lanes);
            if children != 0 {
                let slot = children.trailing_zeros() as usize & 7;
                children &= children - 1;
                if children == 0 {
                    current = Child(node[6].0[slot].to_bits());
                    continue;
                }
                let near = lanes.store(near);
                let mut closest = entry(near[slot], node[6].0[slot]);
                let base = height;
                while children != 0 {
                    let slot = children.trailing_zeros() as usize & 7;
                    children &= children - 1;
                    let other = entry(near[slot], node[6].0[slot]);
                    lanes.prefetch(cells, child(other).place());
                    let farther = closest.max(other);
                    closest = closest.min(other);
                    // Keep what is pushed in order, the nearest on top.
                    let mut place = height;
                    while place > base && stack[(place - 1) % STACK] < farther {
                        stack[place % STACK] = stack[(place - 1) % STACK];
                        place -= 1;
                    }
                    stack[place % STACK] = farther;
                    height += 1;
                }
                current = child(closest);
                continue;
            }
        }
        current = loop {
            if height == 0 {
                return;
            }
            height -= 1;
            let top = stack[height % STACK];
            if f32::from_bits((top >> 32) as u32) <= far {
                break child(top);
            }
        };
    }
}
