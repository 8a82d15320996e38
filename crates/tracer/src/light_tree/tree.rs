//! The tree itself: how lights are parted, and what is known of them for a point.

use etendue_geometry::MISS;
use etendue_geometry::glam::DVec3;

use super::cluster::{Cluster, NumberedCluster};
use super::node::{Branch, Extent, Node, Receiver, Viewer, WIDTH};

/// From this depth on nodes are parted into equal numbers of lights, whatever that costs: no branch is longer than
/// this and the logarithm of that number.
const DEEP: u32 = 12;

/// The node whose one branch has all lights, and the one that parts them.
pub(super) const ALL: usize = 0;

pub(super) const FIRST: usize = 1;

/// Half-angle (radians) of a cone within which lights shine the same way.
const ALIKE: f64 = 0.3;

/// Intervals of an axis that a split is looked for between.
const BUCKETS: usize = 12;

/// The branch with a light at a place of the tree's order that [`descend`](super::descent::descend) may come to from a node, and its chance.
#[multiversion::multiversion(targets = "simd")]
fn descend_to(nodes: &[Node], mut at: usize, viewer: &Viewer, place: u32) -> Option<(Branch, f64)> {
    let mut chance = 1.0;
    loop {
        let node = nodes.get(at)?;
        let holds = |branch: &Branch| (branch.lights[0]..branch.lights[1]).contains(&place);
        let lane = node.branches.iter().position(holds)?;
        let view = node.view(viewer);
        chance *= view.share(lane);
        let branch = node.branches[lane];
        if chance == 0.0 || node.is_end(lane, view.squared[lane]) {
            return Some((branch, chance));
        }
        at = branch.node as usize;
    }
}

/// The tree.
#[derive(Debug, Default)]
pub(crate) struct LightTree {
    /// The first has one branch, of all lights.
    pub(super) nodes: Vec<Node>,
    pub(super) extent: Extent,
    /// Numbers of the lights in the tree's order, and the sum of all intensities before each and at the end.
    pub(super) order: Vec<u32>,
    pub(super) below: Vec<f64>,
    /// The place of each light in that order, by its number; [`MISS`] of lights that are in no tree.
    places: Vec<u32>,
}

/// Branch that lights became in the tree, and their cluster.
struct BranchCluster {
    cluster: Cluster,
    /// They are all points.
    is_points: bool,
    branch: Branch,
}

impl LightTree {
    /// Over `lights` by their numbers below `count`; those without intensity are left out.
    pub(crate) fn new(mut lights: Vec<NumberedCluster>, count: usize) -> Self {
        lights.retain(|light| light.cluster.intensity > 0.0);
        let mut tree = Self { below: vec![0.0], places: vec![MISS; count], ..Self::default() };
        let all = lights.iter().map(|light| light.cluster).reduce(|a, b| a.union(&b));
        if let Some(all) = all {
            tree.extent = Extent::of(&all);
            tree.nodes.push(Node::default());
            let BranchCluster { cluster, branch, .. } = tree.grow(&mut lights, 0);
            let extent = tree.extent;
            tree.nodes[ALL].set(0, &extent, &cluster, branch);
        }
        tree
    }

    /// Adds what is below a branch.
    fn grow(&mut self, lights: &mut [NumberedCluster], depth: u32) -> BranchCluster {
        let begin = self.order.len();
        if let [NumberedCluster { number, cluster }] = lights {
            let sum = self.below[begin] + cluster.intensity;
            self.places[*number as usize] = place(begin);
            self.order.push(*number);
            self.below.push(sum);
            let is_points = cluster.is_point();
            let branch = Branch { node: MISS, alike: true, lights: [begin, begin + 1].map(place) };
            return BranchCluster { cluster: *cluster, is_points, branch };
        }
        let (at, sizes) = (self.nodes.len(), parts(lights, depth >= DEEP));
        self.nodes.push(Node::default());
        let (mut node, mut all, mut is_points) = (Node::default(), Cluster::DARK, true);
        let (mut rest, count) = (lights, sizes.len());
        for (lane, size) in sizes.into_iter().enumerate() {
            let (part, after) = rest.split_at_mut(size);
            rest = after;
            let grown = self.grow(part, depth + 1);
            node.set(lane, &self.extent, &grown.cluster, grown.branch);
            all = all.union(&grown.cluster);
            is_points &= grown.is_points;
        }
        let reach_as_far =
            node.clusters.cos_reach[..count].iter().all(|&cos| cos == node.clusters.cos_reach[0]);
        let alike = is_points || (all.cone <= ALIKE && reach_as_far);
        self.nodes[at] = node;
        // Beside others that are brighter by 10¹⁶ they have no share that a sum would tell.
        let end = self.order.len();
        let alike = alike && self.below[end] > self.below[begin];
        let branch = Branch { node: place(at), alike, lights: [begin, end].map(place) };
        BranchCluster { cluster: all, is_points, branch }
    }

    /// Node at which a point begins to ask: the one that parts all lights, unless it need not ([`ALL`]).
    pub(super) fn start(&self, viewer: &Viewer) -> usize {
        let goes_on = |whole: &Node| !whole.is_end(0, whole.squared(0, viewer));
        usize::from(self.nodes.first().is_some_and(goes_on))
    }

    /// The share of the `k`-th light in the intensity of those of a branch.
    #[inline]
    pub(super) fn share(&self, k: usize, [begin, end]: [usize; 2]) -> f64 {
        if end - begin == 1 {
            return 1.0;
        }
        (self.below[k + 1] - self.below[k]) / (self.below[end] - self.below[begin])
    }

    /// Irradiance that a point that faces all lights may get from them, in units of the tree.
    pub(super) fn sent(&self, viewer: &Viewer) -> f64 {
        let Some(whole) = self.nodes.first() else { return 0.0 };
        let ([sent], _) = whole.clusters.spread::<1>(0).sent(&viewer.point.map(|x| [x]), None);
        f64::from(sent)
    }

    /// Irradiance that a point (m) that faces all of its lights may get from them (W/m²).
    pub(crate) fn importance(&self, from: DVec3) -> f64 {
        let [importance] = self.importances(&self.extent.local(from).to_array().map(|x| [x]));
        importance
    }

    /// The same of some points, as the tree sees them.
    #[inline(always)]
    pub(super) fn importances<const N: usize>(&self, points: &[[f32; N]; 3]) -> [f64; N] {
        let Some(whole) = self.nodes.first() else { return [0.0; N] };
        let (sent, _) = whole.clusters.spread::<N>(0).sent(points, None);
        let Extent { scale, intensity, .. } = self.extent;
        let most = f64::MAX.sqrt();
        sent.map(|sent| (f64::from(sent) * intensity * scale * scale).min(most))
    }

    /// Tests whether a light is in it.
    pub(crate) fn holds(&self, number: usize) -> bool {
        self.places.get(number).is_some_and(|&place| place != MISS)
    }

    /// The chance with which [`Self::pick`] picks a light for a point.
    pub(crate) fn chance(&self, receiver: &Receiver, number: usize) -> f64 {
        let Some(&place) = self.places.get(number).filter(|&&place| place != MISS) else {
            return 0.0;
        };
        let viewer = self.extent.viewer(receiver);
        let (branch, chance) = match self.start(&viewer) {
            ALL if self.sent(&viewer) > 0.0 => (self.nodes[ALL].branches[0], 1.0),
            ALL => return 0.0,
            at => match descend_to(&self.nodes, at, &viewer, place) {
                Some(found) => found,
                None => return 0.0,
            },
        };
        chance * self.share(place as usize, branch.lights.map(|k| k as usize))
    }
}

/// Puts the lights of a node in the order of its branches, and says how many each has: again and again the branch
/// that costs most is split, or the one of most lights where they are to be parted evenly.
fn parts(lights: &mut [NumberedCluster], evenly: bool) -> Vec<usize> {
    let cost = |lights: &[NumberedCluster]| match evenly {
        true => lights.len() as f64,
        false => {
            let all = lights.iter().map(|light| light.cluster).reduce(|a, b| a.union(&b));
            all.map_or(0.0, |all| all.cost())
        }
    };
    let mut parts = vec![(lights.len(), cost(lights))];
    while parts.len() < WIDTH {
        let by_cost = |a: &(usize, (usize, f64)), b: &(usize, (usize, f64))| {
            a.1.1.total_cmp(&b.1.1).then(a.1.0.cmp(&b.1.0))
        };
        let several = parts.iter().copied().enumerate().filter(|(_, (size, _))| *size > 1);
        let Some((k, (size, _))) = several.max_by(by_cost) else { break };
        let start = parts[..k].iter().map(|part| part.0).sum();
        let whole: &mut [NumberedCluster] = &mut lights[start..start + size];
        let middle = split(whole, evenly);
        let (first, second) = whole.split_at(middle);
        parts.splice(k..=k, [first, second].map(|part| (part.len(), cost(part))));
    }
    parts.into_iter().map(|part| part.0).collect()
}

/// Puts lights in an order in which those of the first part come first, at least one and not all; how many these
/// are. `evenly`: as many as of the second.
fn split(lights: &mut [NumberedCluster], evenly: bool) -> usize {
    let half = lights.len() / 2;
    let centre = |light: &NumberedCluster, axis: usize| light.cluster.bounds.centre()[axis];
    let range = |axis: usize| {
        let ends = |(low, high): (f64, f64), light| {
            let c = centre(light, axis);
            (low.min(c), high.max(c))
        };
        lights.iter().fold((f64::INFINITY, f64::NEG_INFINITY), ends)
    };
    let widest = (0..3).map(|axis| range(axis).1 - range(axis).0).fold(0.0, f64::max);
    let mut best: Option<(f64, usize, usize)> = None;
    for axis in 0..3 {
        let (low, high) = range(axis);
        if high <= low || evenly {
            continue;
        }
        let place = |light: &NumberedCluster| bucket(centre(light, axis), low, high);
        let mut buckets: [Option<Cluster>; BUCKETS] = [None; BUCKETS];
        for light in &*lights {
            let own = &mut buckets[place(light)];
            *own = Some(own.map_or(light.cluster, |all| all.union(&light.cluster)));
        }
        let together = |part: &[Option<Cluster>]| {
            part.iter().flatten().copied().reduce(|a, b| a.union(&b)).map(|c| c.cost())
        };
        for end in 1..BUCKETS {
            let (Some(a), Some(b)) = (together(&buckets[..end]), together(&buckets[end..])) else {
                continue;
            };
            let cost = (a + b) * widest / (high - low);
            if best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, axis, end));
            }
        }
    }
    let Some((_, axis, end)) = best else { return half };
    let (low, high) = range(axis);
    lights.sort_by_key(|light| bucket(centre(light, axis), low, high) >= end);
    let middle = lights.partition_point(|light| bucket(centre(light, axis), low, high) < end);
    if middle == 0 || middle == lights.len() { half } else { middle }
}

/// The interval of a place between two ends.
fn bucket(at: f64, low: f64, high: f64) -> usize {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in 0..=1")]
    let bucket = ((at - low) / (high - low) * BUCKETS as f64) as usize;
    bucket.min(BUCKETS - 1)
}

/// A place in a list of the tree, which has at most [`MOST`](super::MOST) lights.
fn place(k: usize) -> u32 {
    u32::try_from(k).unwrap_or(MISS)
}
