//! One ray through a tree of eight boxes a node, from near to far.

use super::lanes::Lanes;
use super::ray::BoxTest;
use super::wide::{Child, WideNode};
use crate::tree::MAX_DEPTH;

/// Children still to visit, each with the distance at which the ray enters it in the upper half
/// and the [`Child`] in the lower: positive floats order like their bits.
pub(super) struct Stack(Box<[u64; STACK]>);

/// Seven siblings a level, rounded up to a power of two so that an index can be masked.
const STACK: usize = (7 * MAX_DEPTH + 1).next_power_of_two();

impl Stack {
    pub(super) fn new() -> Self {
        Self(Box::new([0; STACK]))
    }
}

#[inline(always)]
fn entry(near: f32, child: Child) -> u64 {
    u64::from(near.to_bits()) << 32 | u64::from(child.0)
}

/// Which of the eight boxes of a node the ray meets before `far`, and where.
#[inline(always)]
pub(super) fn meet<L: Lanes>(
    lanes: L,
    node: &WideNode,
    test: &BoxTest<L>,
    far: L::F,
) -> (u32, L::F) {
    let l = lanes;
    let plane = |axis: usize, side: usize| l.load(&node.bounds[axis][side & 1]);
    let near = |axis: usize| {
        let plane = plane(axis, test.backwards[axis]);
        l.mul_sub(plane, test.inverse_near[axis], test.near_offset[axis])
    };
    let end = |axis: usize| {
        let plane = plane(axis, 1 - test.backwards[axis]);
        l.mul_sub(plane, test.inverse_far[axis], test.far_offset[axis])
    };
    let enter = l.max(l.max(near(0), near(1)), l.max(near(2), test.near));
    let leave = l.min(l.min(end(0), end(1)), l.min(end(2), far));
    (l.le(enter, leave), enter)
}

/// Shows every leaf that the ray meets before `far` to `see`, near ones first, which answers how
/// far to look from there on, or `None` to end.
#[inline(always)]
pub(super) fn traverse<L: Lanes>(
    lanes: L,
    nodes: &[WideNode],
    test: &BoxTest<L>,
    mut far: f32,
    stack: &mut Stack,
    mut see: impl FnMut(Child, f32) -> Option<f32>,
) {
    let stack = &mut *stack.0;
    let mut height = 0;
    let mut current = Child(0);
    let mut far_lanes = lanes.splat(far);
    loop {
        if current.count() > 0 {
            match see(current, far) {
                Some(limit) => far = limit,
                None => return,
            }
            far_lanes = lanes.splat(far);
        } else {
            let Some(node) = nodes.get(current.node()) else { return };
            let (mut met, near) = meet(lanes, node, test, far_lanes);
            if met != 0 {
                let near = lanes.store(near);
                let mut next = || {
                    let slot = met.trailing_zeros() as usize & 7;
                    met &= met - 1;
                    (entry(near[slot], node.child[slot]), met != 0)
                };
                let (mut closest, more) = next();
                if more {
                    let base = height;
                    let mut more = true;
                    while more {
                        let other;
                        (other, more) = next();
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
                }
                #[expect(clippy::cast_possible_truncation, reason = "the lower half")]
                let child = Child(closest as u32);
                current = child;
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
                #[expect(clippy::cast_possible_truncation, reason = "the lower half")]
                let child = Child(top as u32);
                break child;
            }
        };
    }
}
