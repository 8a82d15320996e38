//! A tree over lights of a place: for a point, one of them is chosen by its distance, its power, where it shines
//! and where the point faces, in a time that grows as the logarithm of their number.
//!
//! Each branch of a node knows of its lights a box, a cone of directions about which they shine, and the sum of
//! their intensities. From the top down one of a node's branches is chosen by what it may send to the point,
//!
//! ```text
//! I cos θ' cos θᵢ' / max(d², r²),  θ' = max(0, θ − θₒ − θᵤ),  θᵢ' = max(0, θᵢ − θᵤ),
//! and nothing where θ' ≥ θₑ or θᵢ' ≥ π/2
//! ```
//!
//! with `d` to the box's centre, `r` half its diagonal, `θ` between the cone's axis and the point, `θₒ` the
//! cone's half-angle, `θₑ` how far beyond it a light shines, `θᵢ` between the point's normal and the box's centre,
//! and `θᵤ` the half-angle of the box's sphere. Where light may come through a surface the normal is not asked.
//! Nodes have eight branches, which are asked side by side: what bounds the time is how long one answer takes,
//! and a choice among eight knows more of the lights than three among two.
//!
//! All that is compared is single: lengths in the extent of all lights, intensities in their sum. Chances are those
//! of the very numbers that were drawn by, in double, so what rounding does to them changes no mean.
//!
//! # Sources
//!
//! A. Conty Estevez and C. Kulla, "Importance Sampling of Many Lights with Adaptive Tree Splitting", HPG
//! 2018 (cones, the cost of a split); Pharr, Jakob and Humphreys, *Physically Based Rendering*, 4th
//! edition, section 12.6.3 (the bounds of `cos θ'` and `cos θᵢ'`). Where all lights of a branch shine the same way
//! and the point is far from it, one is chosen by its intensity at once: going down would change little and costs
//! time.

mod cluster;
mod split;
#[cfg(test)]
mod tests;

use std::f64::consts::PI;

use etendue_geometry::MISS;
use etendue_geometry::glam::{DVec3, Vec3};

pub(crate) use self::cluster::Cluster;
use self::split::split;
use crate::light_sampler::Receiver;
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
const FAR: f32 = 256.0;

/// The node whose one branch has all lights.
const ALL: usize = 0;

/// Half-angle (radians) of a cone within which lights shine the same way.
const ALIKE: f64 = 0.3;

/// Sums of eight of these are finite, and so are their squares in double.
const MOST_IMPORTANCE: f32 = 1e30;

/// Points are looked at no farther out than so many extents of all lights: squares and their inverses stay numbers.
const FARTHEST: f64 = 1e6;

/// What rounding may take from a cosine in single precision, with room.
const ROOM: f32 = 1e-5;

/// A number of each branch.
type Lanes = [f32; WIDTH];

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

/// The extent of all lights, in which lengths are told, and the sum of their intensities.
#[derive(Debug, Clone, Copy)]
struct Extent {
    /// m.
    centre: DVec3,
    /// Per metre.
    scale: f64,
    /// W/sr.
    intensity: f64,
}

/// A point that asks for light, as nodes see it.
#[derive(Debug, Clone, Copy)]
struct Viewer {
    point: [f32; 3],
    normal: [f32; 3],
    is_one_sided: bool,
}

impl Default for Extent {
    fn default() -> Self {
        Self { centre: DVec3::ZERO, scale: 1.0, intensity: 1.0 }
    }
}

impl Extent {
    fn of(all: &Cluster) -> Self {
        let diagonal = all.bounds.diagonal();
        let scale = if diagonal > 0.0 { 1.0 / diagonal } else { 1.0 };
        Self { centre: all.bounds.centre(), scale, intensity: all.intensity }
    }

    fn local(&self, point: DVec3) -> Vec3 {
        let limit = DVec3::splat(FARTHEST);
        ((point - self.centre) * self.scale).clamp(-limit, limit).as_vec3()
    }

    #[inline(always)]
    fn viewer(&self, receiver: &Receiver) -> Viewer {
        Viewer {
            point: self.local(receiver.point).to_array(),
            normal: receiver.normal.as_vec3().to_array(),
            is_one_sided: receiver.is_one_sided(),
        }
    }
}

#[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is the purpose")]
fn single(x: f64) -> f32 {
    x as f32
}

impl Node {
    fn set(&mut self, lane: usize, extent: &Extent, cluster: &Cluster, branch: Branch) {
        let (sin, cos) = cluster.cone.sin_cos();
        let radius = single(0.5 * cluster.bounds.diagonal() * extent.scale);
        let centre = extent.local(cluster.bounds.centre());
        for axis in 0..3 {
            self.centre[axis][lane] = centre[axis];
            self.axis[axis][lane] = single(cluster.axis[axis]);
        }
        self.radius[lane] = radius;
        (self.cone[0][lane], self.cone[1][lane]) = (single(cos), single(sin));
        self.cos_reach[lane] = single(cluster.reach.cos());
        self.intensity[lane] = single(cluster.intensity / extent.intensity);
        let within = self.intensity[lane] / (radius * radius).max(f32::MIN_POSITIVE);
        self.within[lane] = within.min(MOST_IMPORTANCE);
        self.is_around = cluster.cone >= PI && (lane == 0 || self.is_around);
        self.branches[lane] = branch;
    }

    /// The squared distance to the centre of a branch, and its height above the viewer's horizon.
    #[inline(always)]
    fn way(&self, k: usize, viewer: &Viewer) -> [f32; 2] {
        let (mut squared, mut above) = (0.0, 0.0);
        for axis in 0..3 {
            let way = self.centre[axis][k] - viewer.point[axis];
            squared += way * way;
            above += way * viewer.normal[axis];
        }
        [squared, above]
    }

    /// What a branch may send to a point at a squared distance, where all shine to all sides.
    #[inline(always)]
    fn around(&self, k: usize, squared: f32) -> f32 {
        let near = self.intensity[k] / squared;
        let near = if near < MOST_IMPORTANCE { near } else { MOST_IMPORTANCE };
        let is_within = squared <= self.radius[k] * self.radius[k];
        if is_within { self.within[k] } else { near }
    }

    /// The same where they shine ahead.
    #[inline(always)]
    fn ahead(&self, k: usize, from: [f32; 3], squared: f32) -> f32 {
        let inverse = 1.0 / squared.sqrt();
        let near = self.intensity[k] * inverse * inverse;
        let near = if near < MOST_IMPORTANCE { near } else { MOST_IMPORTANCE };
        // The angle to the axis, less the cone's, less the ball's.
        let along = |axis: usize| (from[axis] - self.centre[axis][k]) * self.axis[axis][k];
        let along = along(0) + along(1) + along(2);
        let cosine = (along * inverse).clamp(-1.0, 1.0);
        let angle = less([cosine, other(cosine)], [self.cone[0][k], self.cone[1][k]]);
        let sine = self.radius[k] * inverse;
        let [cosine, _] = less(angle, [other(sine), sine]);
        // A light at the very end of its reach is met by a bound with room for rounding.
        let reaches = cosine + ROOM > self.cos_reach[k];
        let facing = if cosine > ROOM { cosine } else { ROOM };
        let outside = if reaches { near * facing } else { 0.0 };
        let is_within = squared <= self.radius[k] * self.radius[k];
        if is_within { self.within[k] } else { outside }
    }

    /// The most that the cosine is under which a point gets the light of a branch: at this height of its centre
    /// above the point's horizon and this squared distance.
    #[inline(always)]
    fn received(&self, k: usize, above: f32, squared: f32) -> f32 {
        let inverse = 1.0 / squared.sqrt();
        let (sine, along) = (self.radius[k] * inverse, (above * inverse).clamp(-1.0, 1.0));
        let [cosine, _] = less([along, other(along)], [other(sine), sine]);
        let facing = if cosine > ROOM { cosine } else { ROOM };
        let facing = if cosine > -ROOM { facing } else { 0.0 };
        let is_within = squared <= self.radius[k] * self.radius[k];
        if is_within { 1.0 } else { facing }
    }

    /// Whether one of the lights of a branch at this squared distance is chosen by intensity.
    #[inline(always)]
    fn is_end(&self, lane: usize, squared: f32) -> bool {
        let Branch { node, alike, .. } = self.branches[lane];
        node == MISS || (alike && squared > FAR * self.radius[lane] * self.radius[lane])
    }

    /// What the viewer has of each branch: what the branch may send, to a factor, and the squared distance.
    #[inline(always)]
    fn view(&self, viewer: &Viewer) -> View {
        let (mut squared, mut above, mut importance) = ([0.0; WIDTH], [0.0; WIDTH], [0.0; WIDTH]);
        for k in 0..WIDTH {
            [squared[k], above[k]] = self.way(k, viewer);
        }
        if self.is_around {
            for k in 0..WIDTH {
                importance[k] = self.around(k, squared[k]);
            }
        } else {
            for k in 0..WIDTH {
                importance[k] = self.ahead(k, viewer.point, squared[k]);
            }
        }
        if viewer.is_one_sided {
            for k in 0..WIDTH {
                importance[k] *= self.received(k, above[k], squared[k]);
            }
        }
        View { importance: importance.map(f64::from), squared }
    }
}

/// The sine to a cosine, or the other way round; 0 where rounding went beyond 1.
#[inline(always)]
fn other(cosine: f32) -> f32 {
    let rest = 1.0 - cosine * cosine;
    if rest > 0.0 { rest.sqrt() } else { 0.0 }
}

/// Cosine and sine of the first angle less the second, 0 at least.
#[inline(always)]
fn less([cos_a, sin_a]: [f32; 2], [cos_b, sin_b]: [f32; 2]) -> [f32; 2] {
    let is_more = cos_a < cos_b;
    let (cos, sin) = (cos_a * cos_b + sin_a * sin_b, sin_a * cos_b - cos_a * sin_b);
    [if is_more { cos } else { 1.0 }, if is_more { sin } else { 0.0 }]
}

/// What a point has of each branch of a node.
#[derive(Debug)]
struct View {
    /// What the branch may send, to a factor.
    importance: [f64; WIDTH],
    /// The squared distance to its centre.
    squared: Lanes,
}

impl View {
    /// The sums of what the branches up to each send.
    #[inline(always)]
    fn sums(&self) -> [f64; WIDTH] {
        let mut sums = self.importance;
        // By halves: three steps one after the other in place of seven.
        for step in [1, 2, 4] {
            let before = sums;
            for k in step..WIDTH {
                sums[k] = before[k] + before[k - step];
            }
        }
        sums
    }

    /// A branch by `u` in 0..1, what is left of `u`, and its share; `None` where none sends anything.
    #[inline(always)]
    fn pick(&self, u: f64) -> Option<(usize, f64, f64)> {
        let sums = self.sums();
        let place = u * sums[WIDTH - 1];
        let mut lane = 0;
        for sum in sums {
            lane += usize::from(sum <= place);
        }
        // Rounding may put the place at the very end.
        if lane == WIDTH {
            lane = self.importance.iter().rposition(|&importance| importance > 0.0)?;
        }
        let before = if lane == 0 { 0.0 } else { sums[lane - 1] };
        let own = self.importance[lane];
        let rest = ((place - before) / own).clamp(0.0, ONE_BELOW);
        // Sums by halves may be out of order by their last bit.
        (own > 0.0).then_some((lane, rest, own / sums[WIDTH - 1]))
    }

    /// The share of a branch.
    #[inline(always)]
    fn share(&self, lane: usize) -> f64 {
        match self.importance[lane] {
            own if own > 0.0 => own / self.sums()[WIDTH - 1],
            _ => 0.0,
        }
    }
}

/// Goes down from a node by `u` in 0..1 to a branch of which one light is chosen by intensity: that, what is left
/// of `u`, and its chance.
#[multiversion::multiversion(targets = "simd")]
fn descend(
    nodes: &[Node],
    mut at: usize,
    viewer: &Viewer,
    mut u: f64,
) -> Option<(Branch, f64, f64)> {
    let mut chance = 1.0;
    loop {
        let node = nodes.get(at)?;
        let view = node.view(viewer);
        let (lane, rest, share) = view.pick(u)?;
        (u, chance) = (rest, chance * share);
        let branch = node.branches[lane];
        if node.is_end(lane, view.squared[lane]) {
            return Some((branch, u, chance));
        }
        at = branch.node as usize;
    }
}

/// The branch with a light at a place of the tree's order that [`descend`] may come to from a node, and its chance.
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
    nodes: Vec<Node>,
    extent: Extent,
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
        let all = lights.iter().map(|light| light.1).reduce(|a, b| a.union(&b));
        if let Some(all) = all {
            tree.extent = Extent::of(&all);
            tree.nodes.push(Node::default());
            let Grown { cluster, branch, .. } = tree.grow(&mut lights, 0);
            let extent = tree.extent;
            tree.nodes[ALL].set(0, &extent, &cluster, branch);
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
            node.set(lane, &self.extent, &grown.cluster, grown.branch);
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

    /// Where a point begins to ask: what parts all lights, unless it need not ([`ALL`]).
    fn start(&self, viewer: &Viewer) -> usize {
        let goes_on = |whole: &Node| !whole.is_end(0, whole.way(0, viewer)[0]);
        usize::from(self.nodes.first().is_some_and(goes_on))
    }

    /// A light for a point by `u` in 0..1: its number, what is left of `u`, and its chance. `None` where none
    /// shines.
    pub(crate) fn pick(&self, receiver: &Receiver, u: f64) -> Option<(usize, f64, f64)> {
        let viewer = self.extent.viewer(receiver);
        let (branch, u, chance) = match self.start(&viewer) {
            ALL if self.sent(&viewer) > 0.0 => (self.nodes[ALL].branches[0], u, 1.0),
            ALL => return None,
            at => descend(&self.nodes, at, &viewer, u)?,
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

    /// What all lights may send to a point that faces them, in units of the tree.
    fn sent(&self, viewer: &Viewer) -> f32 {
        let Some(whole) = self.nodes.first() else { return 0.0 };
        let [squared, _] = whole.way(0, viewer);
        match whole.is_around {
            true => whole.around(0, squared),
            false => whole.ahead(0, viewer.point, squared),
        }
    }

    /// What its lights may send to a point (m) that faces them all (W/m²).
    pub(crate) fn importance(&self, from: DVec3) -> f64 {
        let Extent { scale, intensity, .. } = self.extent;
        let sent = f64::from(self.sent(&self.extent.viewer(&Receiver::open(from))));
        (sent * intensity * scale * scale).min(f64::MAX.sqrt())
    }

    /// Whether a light is in it.
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
