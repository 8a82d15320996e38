//! Choices of a light on their way down the tree: those at one node side by side, a lane each.
#![expect(clippy::needless_range_loop, reason = "a lane is an index into many arrays")]

use std::hint::select_unpredictable;
use std::ops::Range;

use etendue_geometry::block::lanes;
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Float, MISS};

#[cfg(test)]
use super::node::Receiver;
use super::node::{self, Branch, Extent, LANES, Node, View, Viewer, WIDTH};
use super::tree::LightTree;
use crate::sampling::ONE_BELOW;

/// Points that ask for a light each, a column a number with room for [`LANES`] behind the last, and what is chosen for
/// them. Memory is kept.
#[derive(Debug, Default)]
pub(crate) struct Choices {
    len: usize,
    /// Of the tree.
    extent: Extent,
    /// Points as a tree sees them.
    local: [Vec<f32>; 3],
    /// That of the side that gets light ([`Receiver::normal`]).
    normal: [Vec<f32>; 3],
    /// In 0..1, by which one is chosen; then what is left of that.
    pub(super) u: Vec<f64>,
    pub(super) light: Vec<u32>,
    pub(super) chance: Vec<f64>,
    /// Irradiance that each may get from all lights of a tree (W/m²).
    pub(super) importance: Vec<f64>,
    pub(super) descent: Descent,
}

/// A light that was chosen.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Choice {
    /// Its number.
    pub(crate) light: u32,
    /// Rest of the number in 0..1 that chose it.
    pub(crate) u: f64,
    /// With which it was chosen; 0 where none shines.
    pub(crate) chance: f64,
}

impl Choices {
    /// Makes ready for so many points that choose by a tree, if there is one.
    pub(crate) fn restart(&mut self, tree: Option<&LightTree>, most: usize) {
        (self.len, self.extent) = (0, tree.map_or_else(Extent::default, |tree| tree.extent));
        let room = most + LANES;
        self.local.iter_mut().chain(&mut self.normal).for_each(|axis| axis.resize(room, 0.0));
        self.u.resize(room, 0.0);
        self.light.resize(room, 0);
        self.chance.resize(room, 0.0);
        self.descent.order.clear();
    }

    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// Appends a point that chooses by `u` in 0..1.
    #[cfg(test)]
    #[inline(always)]
    pub(crate) fn push(&mut self, receiver: &Receiver, u: f64) {
        let (point, normal) = (self.extent.local(receiver.point), receiver.normal.as_vec3());
        for axis in 0..3 {
            self.local[axis][self.len] = point[axis];
            self.normal[axis][self.len] = normal[axis];
        }
        self.u[self.len] = u;
        self.len += 1;
    }

    /// Appends some of sixteen points, relative to `origin` (m), with their normals and the numbers by which they choose:
    /// `compress` puts those that are wanted of a row side by side, and says how many they are.
    #[inline(always)]
    pub(crate) fn push_some<F: Float>(
        &mut self,
        points: &[[F; LANES]; 3],
        origin: DVec3,
        normals: &[[F; LANES]; 3],
        u: &[F; LANES],
        compress: impl Fn(&[f32; LANES], &mut [f32]) -> usize,
        compress_wide: impl Fn(&[f64; LANES], &mut [f64]),
    ) {
        let Extent { centre, scale, .. } = self.extent;
        let (at, mut count, mut wide) = (self.len, 0, [0.0; LANES]);
        let (mut scaled, mut normal) = ([[0.0; LANES]; 3], [0.0; LANES]);
        for axis in 0..3 {
            let offset = origin[axis] - centre[axis];
            for i in 0..LANES {
                let point: f64 = points[axis][i].into();
                scaled[axis][i] = (point + offset) * scale;
            }
        }
        let local = node::local(scaled);
        for axis in 0..3 {
            for i in 0..LANES {
                normal[i] = f32::of(normals[axis][i].into());
            }
            compress(&local[axis], &mut self.local[axis][at..at + LANES]);
            count = compress(&normal, &mut self.normal[axis][at..at + LANES]);
        }
        for i in 0..LANES {
            wide[i] = u[i].into();
        }
        compress_wide(&wide, &mut self.u[at..at + LANES]);
        self.len += count;
    }

    #[inline(always)]
    pub(crate) fn get(&self, number: usize) -> Choice {
        Choice { light: self.light[number], u: self.u[number], chance: self.chance[number] }
    }

    /// Irradiance that a point may get from all lights of a tree (W/m²), once that is known
    /// ([`LightTree::sum_importance`]).
    #[inline(always)]
    pub(crate) fn importance(&self, number: usize) -> f64 {
        self.importance[number]
    }

    #[inline(always)]
    pub(crate) fn set(&mut self, number: usize, Choice { light, u, chance }: Choice) {
        (self.light[number], self.u[number], self.chance[number]) = (light, u, chance);
    }

    /// Leaves the choice of a light to the tree, with this chance and by what is left of the number.
    #[inline(always)]
    pub(crate) fn leave_to_tree(&mut self, number: usize, chance: f64, u: f64) {
        (self.chance[number], self.u[number]) = (chance, u);
        self.descent.order.push(u32::try_from(number).unwrap_or(MISS));
    }

    /// So many from one on as a tree sees them; those behind the last are anywhere.
    #[inline(always)]
    pub(super) fn points(&self, first: usize) -> ([[f32; LANES]; 3], usize) {
        let mut points = [[0.0; LANES]; 3];
        for axis in 0..3 {
            points[axis] = lanes(&self.local[axis], first);
        }
        (points, LANES.min(self.len - first))
    }

    #[inline(always)]
    pub(super) fn viewer(&self, number: usize) -> Viewer {
        let at = |axes: &[Vec<f32>; 3]| [axes[0][number], axes[1][number], axes[2][number]];
        Viewer { point: at(&self.local), normal: at(&self.normal) }
    }
}

/// Choices on their way down a tree.
#[derive(Debug, Default)]
pub(super) struct Descent {
    /// Their numbers: at first all that go down, then side by side those that have come to one node.
    pub(super) order: Vec<u32>,
    sorted: Vec<u32>,
    /// The branches that they took, by their place in the order, or [`ENDS`].
    branches: Vec<u32>,
    /// Nodes, and which part of the order has come there.
    pub(super) nodes: Vec<(usize, Range<usize>)>,
    /// Those that came to a node with few others.
    pub(super) walkers: Vec<Walker>,
}

/// A choice that goes down by itself.
#[derive(Debug, Default)]
pub(super) struct Walker {
    /// Its index among the choices.
    pub(super) number: usize,
    viewer: Viewer,
    /// The node that it is at; [`END`] once it has a branch of which a light is chosen by intensity, or none.
    at: usize,
    pub(super) u: f64,
    /// That of the branch.
    pub(super) chance: f64,
    pub(super) branch: Branch,
}

/// No node.
const END: usize = usize::MAX;

/// No branch.
const ENDS: u32 = u32::MAX;

/// So many at one node are worked on side by side, a lane each; fewer one by one, a lane for each branch.
const TOGETHER: usize = 6;

impl Walker {
    /// Goes to one of a node's branches by what it has of them; whether it goes on from there.
    #[inline(always)]
    fn step(&mut self, node: &Node, view: &View) -> bool {
        let Some((lane, rest, share)) = view.pick(self.u) else {
            (self.chance, self.at) = (0.0, END);
            return false;
        };
        (self.u, self.chance) = (rest, self.chance * share);
        self.branch = node.branches[lane];
        let is_end = node.is_end(lane, view.squared[lane]);
        self.at = if is_end { END } else { self.branch.node as usize };
        !is_end
    }
}

impl LightTree {
    /// Chooses one of a branch's lights by their intensity.
    #[inline(always)]
    pub(super) fn settle(&self, choices: &mut Choices, number: usize, branch: &Branch) {
        let [begin, end] = branch.lights.map(|k| k as usize);
        if end - begin == 1 {
            choices.light[number] = self.order[begin];
            return;
        }
        let place = self.below[begin] + choices.u[number] * (self.below[end] - self.below[begin]);
        let k = begin + self.below[begin + 1..end].partition_point(|&sum| sum <= place);
        let rest = (place - self.below[k]) / (self.below[k + 1] - self.below[k]);
        choices.light[number] = self.order[k];
        choices.u[number] = rest.clamp(0.0, ONE_BELOW);
        choices.chance[number] *= self.share(k, [begin, end]);
    }
}

/// Brings choices down, those at one node together; those that have few others beside them become walkers.
#[multiversion::multiversion(targets = "simd")]
pub(super) fn descend_together(tree: &LightTree, choices: &mut Choices) {
    let mut descent = std::mem::take(&mut choices.descent);
    let Descent { order, sorted, branches, nodes, walkers } = &mut descent;
    while let Some((at, here)) = nodes.pop() {
        let node = &tree.nodes[at];
        let rest = here.len() % LANES;
        let apart = if rest < TOGETHER { here.end - rest } else { here.end };
        walkers.extend(order[apart..here.end].iter().map(|&number| {
            let number = number as usize;
            let Choice { u, chance, .. } = choices.get(number);
            let viewer = choices.viewer(number);
            Walker { number, viewer, at, u, chance, branch: Branch::default() }
        }));
        let order = &mut order[here.start..apart];
        branches.clear();
        let mut counts = [0_usize; WIDTH];
        for numbers in order.chunks(LANES) {
            let taken = take_branches(node, &choices.branch_queries(numbers));
            for (i, &number) in numbers.iter().enumerate() {
                let (number, code) = (number as usize, taken.codes[i]);
                let chance = choices.chance[number] * taken.share[i];
                (choices.chance[number], choices.u[number]) = (chance, taken.rest[i]);
                let goes_on = (code as usize) < WIDTH && chance > 0.0;
                branches.push(if goes_on { code } else { ENDS });
                if goes_on {
                    counts[code as usize] += 1;
                } else if chance > 0.0 {
                    tree.settle(choices, number, &node.branches[code as usize - WIDTH]);
                }
            }
        }
        // Those that go on by the branch that they took.
        sorted.clear();
        sorted.extend_from_slice(order);
        let (mut ends, mut sum) = ([0; WIDTH], 0);
        for (lane, count) in counts.into_iter().enumerate() {
            if count > 0 {
                let child = node.branches[lane].node as usize;
                nodes.push((child, here.start + sum..here.start + sum + count));
            }
            ends[lane] = sum;
            sum += count;
        }
        for (&number, &branch) in sorted.iter().zip(&*branches) {
            if let Some(end) = ends.get_mut(branch as usize) {
                order[*end] = number;
                *end += 1;
            }
        }
    }
    choices.descent = descent;
}

/// Brings all walkers down, step by step: a step of one does not wait for that of another.
#[multiversion::multiversion(targets = "simd")]
pub(super) fn descend(nodes: &[Node], walkers: &mut [Walker]) {
    let (pairs, rest) = walkers.as_chunks_mut::<2>();
    let mut is_under_way = true;
    while is_under_way {
        is_under_way = false;
        for [a, b] in &mut *pairs {
            let (first, second) = (nodes.get(a.at), nodes.get(b.at));
            // One that has come to its end is taken along.
            let Some(any) = first.or(second) else { continue };
            let views =
                Node::views([first.unwrap_or(any), second.unwrap_or(any)], [&a.viewer, &b.viewer]);
            if let Some(node) = first {
                is_under_way |= a.step(node, &views[0]);
            }
            if let Some(node) = second {
                is_under_way |= b.step(node, &views[1]);
            }
        }
        for walker in &mut *rest {
            if let Some(node) = nodes.get(walker.at) {
                let view = node.view(&walker.viewer);
                is_under_way |= walker.step(node, &view);
            }
        }
    }
}

/// Points at one node that ask for a branch each.
#[derive(Debug, Default)]
struct BranchQueries {
    points: [[f32; LANES]; 3],
    normals: [[f32; LANES]; 3],
    u: [f64; LANES],
}

impl Choices {
    /// Those of some numbers that ask for a branch.
    #[inline(always)]
    fn branch_queries(&self, numbers: &[u32]) -> BranchQueries {
        let mut queries = BranchQueries::default();
        let (first, last) = (numbers[0] as usize, numbers[numbers.len() - 1] as usize);
        if last - first < numbers.len() {
            // They stand side by side, as all do at first.
            for axis in 0..3 {
                queries.points[axis] = lanes(&self.local[axis], first);
                queries.normals[axis] = lanes(&self.normal[axis], first);
            }
            queries.u = lanes(&self.u, first);
            return queries;
        }
        for (i, &number) in numbers.iter().enumerate() {
            let Viewer { point, normal } = self.viewer(number as usize);
            for axis in 0..3 {
                (queries.points[axis][i], queries.normals[axis][i]) = (point[axis], normal[axis]);
            }
            queries.u[i] = self.u[number as usize];
        }
        queries
    }
}

/// The branches that points at one node took.
#[derive(Debug)]
struct BranchPicks {
    /// The branch; and [`WIDTH`] more where a light of it is chosen by intensity.
    codes: [u32; LANES],
    /// Rests of the numbers that chose them.
    rest: [f64; LANES],
    /// 0 where none sends anything.
    share: [f64; LANES],
}

/// Takes a branch for each of some points, as [`View::pick`] does for one, to the bit.
#[inline(always)]
fn take_branches(node: &Node, queries: &BranchQueries) -> BranchPicks {
    let (mut sent, mut codes) = ([[0.0_f32; LANES]; WIDTH], [[0.0_f32; LANES]; WIDTH]);
    let mut code = 0.0;
    for k in 0..WIDTH {
        // What is not there sends nothing.
        if node.clusters.intensity[k] > 0.0 {
            let clusters = node.clusters.spread::<LANES>(k);
            let (own, squared) = clusters.sent(&queries.points, Some(&queries.normals));
            let (goes_on, ends, limit) = (code, code + WIDTH as f32, node.limits[k]);
            for i in 0..LANES {
                codes[k][i] = select_unpredictable(squared[i] > limit, ends, goes_on);
            }
            sent[k] = own;
        }
        code += 1.0;
    }
    let mut total = [0.0; LANES];
    for own in &sent {
        for i in 0..LANES {
            total[i] += f64::from(own[i]);
        }
    }
    let (mut place, mut below) = ([0.0; LANES], [0.0; LANES]);
    for i in 0..LANES {
        place[i] = queries.u[i] * total[i];
    }
    let [mut before, mut chosen, mut code] = [[0.0; LANES]; 3];
    for k in 0..WIDTH {
        for i in 0..LANES {
            let own = f64::from(sent[k][i]);
            // The last of which this holds, wherever rounding puts the place.
            let is_chosen = (below[i] <= place[i]) & (own > 0.0);
            before[i] = select_unpredictable(is_chosen, below[i], before[i]);
            chosen[i] = select_unpredictable(is_chosen, own, chosen[i]);
            code[i] = select_unpredictable(is_chosen, f64::from(codes[k][i]), code[i]);
            below[i] += own;
        }
    }
    let (mut rest, mut share) = ([0.0; LANES], [0.0; LANES]);
    for i in 0..LANES {
        let left = (place[i] - before[i]) / chosen[i];
        let left = if left > 0.0 { left } else { 0.0 };
        rest[i] = if left < ONE_BELOW { left } else { ONE_BELOW };
        share[i] = if chosen[i] > 0.0 { chosen[i] / total[i] } else { 0.0 };
    }
    let mut numbers = [0; LANES];
    for i in 0..LANES {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 15")]
        let number = code[i] as u32;
        numbers[i] = number;
    }
    BranchPicks { codes: numbers, rest, share }
}

/// Tests whether any point is so far away that one light of a tree is as good as another.
#[multiversion::multiversion(targets = "simd")]
pub(super) fn is_any_far(whole: &Node, choices: &Choices) -> bool {
    let (centre, mut farthest) = (whole.clusters.spread::<LANES>(0).centre, [0.0_f32; LANES]);
    for first in (0..choices.len()).step_by(LANES) {
        let (points, _) = choices.points(first);
        let mut squared = [0.0; LANES];
        for axis in 0..3 {
            for i in 0..LANES {
                let way = centre[axis][i] - points[axis][i];
                squared[i] += way * way;
            }
        }
        for i in 0..LANES {
            farthest[i] = if squared[i] > farthest[i] { squared[i] } else { farthest[i] };
        }
    }
    farthest.iter().any(|&squared| whole.is_end(0, squared))
}
