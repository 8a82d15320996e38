//! A tree over lights of a place: from a point, one of them is chosen by its distance, its power and where
//! it shines, in a time that grows as the logarithm of their number.
//!
//! Each branch of a node knows of its lights a box, a cone of directions about which they shine, and the sum of
//! their intensities. From the top down one of a node's branches is chosen by what it may send to the point,
//!
//! ```text
//! I cos θ' / max(d², r²),  θ' = max(0, θ − θₒ − θᵤ), and nothing where θ' ≥ θₑ
//! ```
//!
//! with `d` to the box's centre, `r` half its diagonal, `θ` between the cone's axis and the point, `θₒ` the
//! cone's half-angle, `θₑ` how far beyond it a light shines, and `θᵤ` the half-angle of the box's sphere.
//! Nodes have eight branches, which are asked side by side: what bounds the time is how long one answer takes,
//! and a choice among eight knows more of the lights than three among two.
//!
//! # Sources
//!
//! A. Conty Estevez and C. Kulla, "Importance Sampling of Many Lights with Adaptive Tree Splitting", HPG
//! 2018 (cones, the cost of a split); Pharr, Jakob and Humphreys, *Physically Based Rendering*, 4th
//! edition, section 12.6.3 (the bound of `cos θ'`). The point's own normal is not asked: light may come through
//! a surface. Where all lights of a branch shine the same way and the point is far from it, one is chosen by its
//! intensity at once: going down would change little and costs time.

mod cluster;
mod split;
#[cfg(test)]
mod tests;

use std::f64::consts::PI;

use etendue_geometry::MISS;
use etendue_geometry::glam::DVec3;

pub(crate) use self::cluster::Cluster;
use self::split::split;
use crate::sampling::ONE_BELOW;

/// Fewer lights are chosen by their power where none is far away.
pub(crate) const LEAST: usize = 5;

/// So are more.
pub(crate) const MOST: usize = 1 << 16;

/// Branches of a node.
const WIDTH: usize = 8;

/// From this depth on nodes are parted into equal numbers of lights, whatever that costs: no branch is longer than
/// this and the logarithm of that number.
const DEEP: u32 = 12;

/// Squared distance over squared radius from which on a branch's lights are as good as in one place.
const FAR: f64 = 16.0;

/// The node whose one branch has all lights.
const ALL: usize = 0;

/// Half-angle (radians) of a cone within which lights shine the same way.
const ALIKE: f64 = 0.3;

/// A number of each branch.
type Lanes = [f64; WIDTH];

/// Clusters of lights, as they are asked; what is not there has no intensity.
#[derive(Debug, Clone, Default)]
struct Node {
    centre: [Lanes; 3],
    /// Half the diagonal.
    radius: Lanes,
    axis: [Lanes; 3],
    /// Cosine and sine of the cone.
    cone: [Lanes; 2],
    cos_reach: Lanes,
    intensity: Lanes,
    /// What it may send to points between its lights.
    within: Lanes,
    /// All shine to all sides.
    is_around: bool,
    branches: [Branch; WIDTH],
}

/// The lights of a branch.
#[derive(Debug, Clone, Copy, Default)]
struct Branch {
    /// The node that parts them; [`MISS`] where there is one alone.
    node: u32,
    /// They shine the same way.
    alike: bool,
    /// Which of the lights in the tree's order they are: the first, and the first behind them.
    lights: [u32; 2],
}

impl Node {
    fn set(&mut self, lane: usize, cluster: &Cluster, branch: Branch) {
        let (sin, cos) = cluster.cone.sin_cos();
        let radius = 0.5 * cluster.bounds.diagonal();
        for (axis, (centre, along)) in self.centre.iter_mut().zip(&mut self.axis).enumerate() {
            centre[lane] = cluster.bounds.centre()[axis];
            along[lane] = cluster.axis[axis];
        }
        self.radius[lane] = radius;
        (self.cone[0][lane], self.cone[1][lane]) = (cos, sin);
        self.cos_reach[lane] = cluster.reach.cos();
        self.intensity[lane] = cluster.intensity;
        let within = cluster.intensity / (radius * radius).max(f64::MIN_POSITIVE);
        self.within[lane] = within.min(MOST_IMPORTANCE);
        self.is_around = cluster.cone >= PI && (lane == 0 || self.is_around);
        self.branches[lane] = branch;
    }

    /// The centre of the first branch (m).
    #[inline]
    fn first_centre(&self) -> DVec3 {
        self.centre.map(|axis| axis[0]).into()
    }

    /// What a branch may send to a point at a squared distance (m²), where all shine to all sides.
    #[inline(always)]
    fn around(&self, k: usize, squared: f64) -> f64 {
        let near = self.intensity[k] / squared;
        let near = if near < MOST_IMPORTANCE { near } else { MOST_IMPORTANCE };
        let is_within = squared <= self.radius[k] * self.radius[k];
        if is_within { self.within[k] } else { near }
    }

    /// The same where they shine ahead.
    #[inline(always)]
    fn ahead(&self, k: usize, from: [f64; 3], squared: f64) -> f64 {
        let inverse = 1.0 / squared.sqrt();
        let near = self.intensity[k] * inverse * inverse;
        let near = if near < MOST_IMPORTANCE { near } else { MOST_IMPORTANCE };
        // The angle to the axis, less the cone's, less the ball's.
        let along = |axis: usize| (from[axis] - self.centre[axis][k]) * self.axis[axis][k];
        let along = along(0) + along(1) + along(2);
        let cosine = (along * inverse).clamp(-1.0, 1.0);
        let angle =
            less([cosine, (1.0 - cosine * cosine).sqrt()], [self.cone[0][k], self.cone[1][k]]);
        let sine = self.radius[k] * inverse;
        let rest = 1.0 - sine * sine;
        let ball = if rest > 0.0 { rest } else { 0.0 };
        let [cosine, _] = less(angle, [ball.sqrt(), sine]);
        // A light at the very end of its reach is met by a bound with room for rounding.
        let reaches = cosine + 1e-9 > self.cos_reach[k];
        let facing = if cosine > 1e-9 { cosine } else { 1e-9 };
        let outside = if reaches { near * facing } else { 0.0 };
        let is_within = squared <= self.radius[k] * self.radius[k];
        if is_within { self.within[k] } else { outside }
    }

    /// Whether one of the lights of a branch at this squared distance (m²) is chosen by intensity.
    fn is_end(&self, lane: usize, squared: f64) -> bool {
        let Branch { node, alike, .. } = self.branches[lane];
        node == MISS || (alike && squared > FAR * self.radius[lane] * self.radius[lane])
    }
}

/// What a point has of each branch of a node.
#[derive(Debug, Default)]
struct View {
    /// What the branch may send, to a factor.
    importance: Lanes,
    /// The squared distance to its centre (m²).
    squared: Lanes,
}

/// Sums of eight of these are finite.
const MOST_IMPORTANCE: f64 = 1e290;

/// What a point (m) has of each branch.
#[multiversion::multiversion(targets = "simd")]
fn view(node: &Node, from: DVec3, view: &mut View) {
    let from = [from.x, from.y, from.z];
    view.squared = [0.0; WIDTH];
    for (axis, from) in from.into_iter().enumerate() {
        for k in 0..WIDTH {
            let way = from - node.centre[axis][k];
            view.squared[k] += way * way;
        }
    }
    if node.is_around {
        for k in 0..WIDTH {
            view.importance[k] = node.around(k, view.squared[k]);
        }
        return;
    }
    for k in 0..WIDTH {
        view.importance[k] = node.ahead(k, from, view.squared[k]);
    }
}

/// Cosine and sine of the first angle less the second, 0 at least.
#[inline(always)]
fn less([cos_a, sin_a]: [f64; 2], [cos_b, sin_b]: [f64; 2]) -> [f64; 2] {
    let is_more = cos_a < cos_b;
    let (cos, sin) = (cos_a * cos_b + sin_a * sin_b, sin_a * cos_b - cos_a * sin_b);
    [if is_more { cos } else { 1.0 }, if is_more { sin } else { 0.0 }]
}

impl View {
    /// The sums of what the branches up to each send.
    fn sums(&self) -> Lanes {
        let mut sum = 0.0;
        self.importance.map(|importance| {
            sum += importance;
            sum
        })
    }

    /// A branch by `u` in 0..1, what is left of `u`, and its share; `None` where none sends anything.
    fn pick(&self, u: f64) -> Option<(usize, f64, f64)> {
        let sums = self.sums();
        let place = u * sums[WIDTH - 1];
        let lane = sums.iter().filter(|&&sum| sum <= place).count();
        // Rounding may put the place at the very end.
        let lane = match lane {
            WIDTH => self.importance.iter().rposition(|&importance| importance > 0.0)?,
            lane => lane,
        };
        let before = if lane == 0 { 0.0 } else { sums[lane - 1] };
        let own = self.importance[lane];
        let rest = ((place - before) / own).clamp(0.0, ONE_BELOW);
        Some((lane, rest, own / sums[WIDTH - 1]))
    }

    /// The share of a branch.
    fn share(&self, lane: usize) -> f64 {
        match self.importance[lane] {
            own if own > 0.0 => own / self.sums()[WIDTH - 1],
            _ => 0.0,
        }
    }
}

/// The tree.
#[derive(Debug, Default)]
pub(crate) struct LightTree {
    /// The first has one branch, of all lights.
    nodes: Vec<Node>,
    /// Numbers of the lights in the tree's order, and the sum of all intensities before each and at the end.
    order: Vec<u32>,
    below: Vec<f64>,
    /// The place of each light in that order, by its number; [`MISS`] of lights that are in no tree.
    places: Vec<u32>,
}

/// What lights have become in the tree.
struct Grown {
    cluster: Cluster,
    /// They are all points.
    is_points: bool,
    branch: Branch,
}

impl LightTree {
    /// Over `lights` by their numbers below `count`; those without intensity are left out.
    pub(crate) fn new(mut lights: Vec<(u32, Cluster)>, count: usize) -> Self {
        lights.retain(|(_, cluster)| cluster.intensity > 0.0);
        let mut tree = Self { below: vec![0.0], places: vec![MISS; count], ..Self::default() };
        if !lights.is_empty() {
            tree.nodes.push(Node::default());
            let Grown { cluster, branch, .. } = tree.grow(&mut lights, 0);
            tree.nodes[0].set(0, &cluster, branch);
        }
        tree
    }

    /// Adds what is below a branch.
    fn grow(&mut self, lights: &mut [(u32, Cluster)], depth: u32) -> Grown {
        let begin = self.order.len();
        if let [(number, cluster)] = lights {
            let sum = self.below[begin] + cluster.intensity;
            self.places[*number as usize] = place(begin);
            self.order.push(*number);
            self.below.push(sum);
            let is_points = cluster.is_point();
            let branch = Branch { node: MISS, alike: true, lights: [begin, begin + 1].map(place) };
            return Grown { cluster: *cluster, is_points, branch };
        }
        let (at, sizes) = (self.nodes.len(), parts(lights, depth >= DEEP));
        self.nodes.push(Node::default());
        let (mut node, mut all, mut is_points) = (Node::default(), Cluster::DARK, true);
        let (mut rest, count) = (lights, sizes.len());
        for (lane, size) in sizes.into_iter().enumerate() {
            let (part, after) = rest.split_at_mut(size);
            rest = after;
            let grown = self.grow(part, depth + 1);
            node.set(lane, &grown.cluster, grown.branch);
            all = all.union(&grown.cluster);
            is_points &= grown.is_points;
        }
        let reach_as_far = node.cos_reach[..count].iter().all(|&cos| cos == node.cos_reach[0]);
        let alike = is_points || (all.cone <= ALIKE && reach_as_far);
        self.nodes[at] = node;
        // Beside others that are brighter by 10¹⁶ they have no share that a sum would tell.
        let end = self.order.len();
        let alike = alike && self.below[end] > self.below[begin];
        let branch = Branch { node: place(at), alike, lights: [begin, end].map(place) };
        Grown { cluster: all, is_points, branch }
    }

    /// Where a point (m) begins to ask: what parts all lights, unless it need not ([`ALL`]).
    fn start(&self, from: DVec3) -> usize {
        let goes_on = |whole: &Node| !whole.is_end(0, from.distance_squared(whole.first_centre()));
        usize::from(self.nodes.first().is_some_and(goes_on))
    }

    /// A light for a point (m) by `u` in 0..1: its number, what is left of `u`, and its chance. `None` where
    /// none shines.
    pub(crate) fn pick(&self, from: DVec3, mut u: f64) -> Option<(usize, f64, f64)> {
        let mut chance = 1.0;
        let branch = match self.start(from) {
            ALL if self.importance(from) > 0.0 => self.nodes[ALL].branches[0],
            ALL => return None,
            mut at => {
                let mut seen = View::default();
                loop {
                    let node = self.nodes.get(at)?;
                    view(node, from, &mut seen);
                    let (lane, rest, share) = seen.pick(u)?;
                    (u, chance) = (rest, chance * share);
                    let branch = node.branches[lane];
                    if node.is_end(lane, seen.squared[lane]) {
                        break branch;
                    }
                    at = branch.node as usize;
                }
            }
        };
        let [begin, end] = branch.lights.map(|k| k as usize);
        if end - begin == 1 {
            return Some((self.order[begin] as usize, u, chance));
        }
        let place = self.below[begin] + u * (self.below[end] - self.below[begin]);
        let k = begin + self.below[begin + 1..end].partition_point(|&sum| sum <= place);
        let rest = (place - self.below[k]) / (self.below[k + 1] - self.below[k]);
        let chance = chance * self.share(k, [begin, end]);
        (chance > 0.0).then_some((self.order[k] as usize, rest.clamp(0.0, ONE_BELOW), chance))
    }

    /// The share of the `k`-th light in the intensity of those of a branch.
    #[inline]
    fn share(&self, k: usize, [begin, end]: [usize; 2]) -> f64 {
        if end - begin == 1 {
            return 1.0;
        }
        (self.below[k + 1] - self.below[k]) / (self.below[end] - self.below[begin])
    }

    /// What its lights may send to a point (m) that faces them all (W/m²).
    pub(crate) fn importance(&self, from: DVec3) -> f64 {
        let Some(whole) = self.nodes.first() else { return 0.0 };
        let squared = from.distance_squared(whole.first_centre());
        match whole.is_around {
            true => whole.around(0, squared),
            false => whole.ahead(0, from.to_array(), squared),
        }
    }

    /// Whether a light is in it.
    pub(crate) fn holds(&self, number: usize) -> bool {
        self.places.get(number).is_some_and(|&place| place != MISS)
    }

    /// The chance with which [`Self::pick`] picks a light for a point (m).
    pub(crate) fn chance(&self, from: DVec3, number: usize) -> f64 {
        let Some(&place) = self.places.get(number).filter(|&&place| place != MISS) else {
            return 0.0;
        };
        let (mut at, mut chance) = (self.start(from), 1.0);
        if at == ALL {
            let lights = self.nodes[ALL].branches[0].lights.map(|k| k as usize);
            let is_seen = self.importance(from) > 0.0;
            return if is_seen { self.share(place as usize, lights) } else { 0.0 };
        }
        let mut seen = View::default();
        while let Some(node) = self.nodes.get(at) {
            let holds = |branch: &Branch| (branch.lights[0]..branch.lights[1]).contains(&place);
            let Some(lane) = node.branches.iter().position(holds) else { return 0.0 };
            view(node, from, &mut seen);
            chance *= seen.share(lane);
            let branch = node.branches[lane];
            if chance == 0.0 || node.is_end(lane, seen.squared[lane]) {
                return chance * self.share(place as usize, branch.lights.map(|k| k as usize));
            }
            at = branch.node as usize;
        }
        0.0
    }
}

/// Puts the lights of a node in the order of its branches, and says how many each has: again and again the branch
/// that costs most is split, or the one of most lights where they are to be parted evenly.
fn parts(lights: &mut [(u32, Cluster)], evenly: bool) -> Vec<usize> {
    let cost = |lights: &[(u32, Cluster)]| match evenly {
        true => lights.len() as f64,
        false => {
            let all = lights.iter().map(|light| light.1).reduce(|a, b| a.union(&b));
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
        let whole: &mut [(u32, Cluster)] = &mut lights[start..start + size];
        let middle = split(whole, evenly);
        let (first, second) = whole.split_at(middle);
        parts.splice(k..=k, [first, second].map(|part| (part.len(), cost(part))));
    }
    parts.into_iter().map(|part| part.0).collect()
}

/// A place in a list of the tree, which has at most [`MOST`] lights.
fn place(k: usize) -> u32 {
    u32::try_from(k).unwrap_or(MISS)
}
