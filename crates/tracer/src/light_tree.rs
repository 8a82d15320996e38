//! A tree over lights of a place: from a point, one of them is chosen by its distance, its power and where
//! it shines, in a time that grows as the logarithm of their number.
//!
//! Each node knows of its lights a box, a cone of directions about which they shine, and the sum of their
//! intensities. From the root down one of two nodes is chosen by what it may send to the point,
//!
//! ```text
//! I cos θ' / max(d², r²),  θ' = max(0, θ − θₒ − θᵤ), and nothing where θ' ≥ θₑ
//! ```
//!
//! with `d` to the box's centre, `r` half its diagonal, `θ` between the cone's axis and the point, `θₒ` the
//! cone's half-angle, `θₑ` how far beyond it a light shines, and `θᵤ` the half-angle of the box's sphere.
//!
//! # Sources
//!
//! A. Conty Estevez and C. Kulla, "Importance Sampling of Many Lights with Adaptive Tree Splitting", HPG
//! 2018 (cones, the cost of a split); Pharr, Jakob and Humphreys, *Physically Based Rendering*, 4th
//! edition, section 12.6.3 (the bound of `cos θ'`, trails of bits from a light to the root). The point's
//! own normal is not asked: light may come through a surface. Where all lights of a node shine the same way and the
//! point is far from it, one is chosen by its intensity at once: going down would change little and costs time.

use std::f64::consts::{FRAC_PI_2, PI};

use etendue_geometry::Bounds;
use etendue_geometry::glam::DVec3;

use crate::sampling::ONE_BELOW;

/// Fewer lights are chosen by their power where none is far away.
pub(crate) const LEAST: usize = 5;

/// So are more.
pub(crate) const MOST: usize = 1 << 16;

/// Intervals of an axis that a split is looked for between.
const BUCKETS: usize = 12;

/// From this depth on nodes are halved, whatever that costs: no trail has more bits than 64.
const DEEP: u32 = 32;

/// Squared distance over squared radius from which on a node's lights are as good as in one place.
const FAR: f64 = 16.0;

/// Half-angle (radians) of a cone within which lights shine the same way.
const ALIKE: f64 = 0.3;

/// Lights that are near to each other, or one.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cluster {
    pub(crate) bounds: Bounds,
    /// About which they shine.
    pub(crate) axis: DVec3,
    /// Half-angle of the cone within which their own axes lie (radians).
    pub(crate) cone: f64,
    /// How far beyond it they shine (radians).
    pub(crate) reach: f64,
    /// The sum of their intensities (W/sr) along their axes.
    pub(crate) intensity: f64,
}

impl Cluster {
    /// Both together.
    fn union(&self, other: &Self) -> Self {
        if self.intensity <= 0.0 || other.intensity <= 0.0 {
            return if self.intensity > 0.0 { *self } else { *other };
        }
        let (axis, cone) = cone_around([self.axis, other.axis], [self.cone, other.cone]);
        Self {
            bounds: self.bounds.union(other.bounds),
            axis,
            cone,
            reach: self.reach.max(other.reach),
            intensity: self.intensity + other.intensity,
        }
    }

    /// What it costs to have these lights in one node, to a factor: equation 2 of the source.
    fn cost(&self) -> f64 {
        let extent = self.bounds.max - self.bounds.min;
        let area = extent.x * extent.y + extent.y * extent.z + extent.z * extent.x;
        let (cone, wide) = (self.cone, (self.cone + self.reach).min(PI));
        let angle = 2.0 * PI * (1.0 - cone.cos())
            + FRAC_PI_2
                * (2.0 * wide * cone.sin() - (cone - 2.0 * wide).cos() - 2.0 * cone * cone.sin()
                    + cone.cos());
        self.intensity * area * angle
    }
}

/// The cone around two cones: its axis and half-angle.
fn cone_around([a, b]: [DVec3; 2], [of_a, of_b]: [f64; 2]) -> (DVec3, f64) {
    let between = a.angle_between(b);
    if (between + of_b).min(PI) <= of_a {
        return (a, of_a);
    }
    if (between + of_a).min(PI) <= of_b {
        return (b, of_b);
    }
    let half = 0.5 * (of_a + between + of_b);
    let turn = a.cross(b).try_normalize().filter(|_| half < PI);
    match turn {
        // Rodrigues' rotation of `a` towards `b`.
        Some(turn) => {
            let (sin, cos) = (half - of_a).sin_cos();
            (a * cos + turn.cross(a) * sin, half)
        }
        None => (a, PI),
    }
}

/// A cluster as it is asked.
#[derive(Debug, Clone, Copy)]
struct Node {
    centre: DVec3,
    /// The squared half diagonal.
    squared_radius: f64,
    axis: DVec3,
    /// Cosine and sine of the cone.
    cone: [f64; 2],
    cos_reach: f64,
    intensity: f64,
    /// It shines to all sides.
    around: bool,
    /// Its lights shine the same way.
    alike: bool,
    /// The second child, the first being next; 0 of a leaf.
    next: u32,
    /// Which of the lights in the tree's order are below it.
    lights: [u32; 2],
}

impl Node {
    fn new(cluster: &Cluster) -> Self {
        let (sin, cos) = cluster.cone.sin_cos();
        Self {
            centre: cluster.bounds.centre(),
            squared_radius: 0.25 * cluster.bounds.diagonal().powi(2),
            axis: cluster.axis,
            cone: [cos, sin],
            cos_reach: cluster.reach.cos(),
            intensity: cluster.intensity,
            around: cluster.cone >= PI,
            alike: cluster.cone <= ALIKE,
            next: 0,
            lights: [0; 2],
        }
    }

    /// Whether one of its lights is chosen for a point (m) by intensity.
    #[inline]
    fn is_end(&self, from: DVec3) -> bool {
        let far = || (from - self.centre).length_squared() > FAR * self.squared_radius;
        self.next == 0 || (self.alike && far())
    }

    /// What it may send to a point (m), to a factor.
    #[inline]
    fn importance(&self, from: DVec3) -> f64 {
        let way = from - self.centre;
        let squared = way.length_squared();
        let near = self.intensity / squared.max(self.squared_radius).max(f64::MIN_POSITIVE);
        let near = near.min(1e290);
        if self.around || squared <= self.squared_radius {
            return near;
        }
        let cosine = (way.dot(self.axis) / squared.sqrt()).clamp(-1.0, 1.0);
        let angle = less([cosine, (1.0 - cosine * cosine).sqrt()], self.cone);
        let sine = self.squared_radius / squared;
        let [cosine, _] = less(angle, [(1.0 - sine).sqrt(), sine.sqrt()]);
        // A light at the very end of its reach is met by a bound with room for rounding.
        if cosine + 1e-9 <= self.cos_reach { 0.0 } else { near * cosine.max(1e-9) }
    }
}

/// Cosine and sine of the first angle less the second, 0 at least.
#[inline]
fn less([cos_a, sin_a]: [f64; 2], [cos_b, sin_b]: [f64; 2]) -> [f64; 2] {
    if cos_a >= cos_b {
        return [1.0, 0.0];
    }
    [cos_a * cos_b + sin_a * sin_b, sin_a * cos_b - cos_a * sin_b]
}

/// The tree.
#[derive(Debug, Default)]
pub(crate) struct LightTree {
    nodes: Vec<Node>,
    /// Numbers of the lights in the tree's order, and the sum of all intensities before each and at the end.
    order: Vec<u32>,
    below: Vec<f64>,
    /// By the light's number: its place in that order, and its trail, from the root down, the lowest bit first, whether the second child is taken;
    /// `None` for lights that are in no tree.
    trails: Vec<Option<(u32, u64)>>,
}

impl LightTree {
    /// Over `lights` by their numbers below `count`; those without intensity are left out.
    pub(crate) fn new(mut lights: Vec<(u32, Cluster)>, count: usize) -> Self {
        lights.retain(|(_, cluster)| cluster.intensity > 0.0);
        let mut tree = Self { below: vec![0.0], trails: vec![None; count], ..Self::default() };
        if !lights.is_empty() {
            tree.grow(&mut lights, 0, 0);
        }
        tree
    }

    /// Adds the node of `lights` and all below it; whether they shine the same way.
    fn grow(&mut self, lights: &mut [(u32, Cluster)], trail: u64, depth: u32) -> (Cluster, bool) {
        let [place, begin] = [self.nodes.len(), self.order.len()];
        if let [(number, cluster)] = lights {
            let sum = self.below[begin] + cluster.intensity;
            self.order.push(*number);
            self.below.push(sum);
            let begin = u32::try_from(begin).unwrap_or(u32::MAX);
            self.trails[*number as usize] = Some((begin, trail));
            self.nodes.push(Node { lights: [begin, begin + 1], ..Node::new(cluster) });
            let is_point = cluster.cone >= PI && cluster.bounds.diagonal() == 0.0;
            return (*cluster, is_point);
        }
        let middle = part(lights, depth);
        let (first, second) = lights.split_at_mut(middle);
        self.nodes.push(Node::new(&first[0].1));
        let (first, of_points) = self.grow(first, trail, depth + 1);
        let next = u32::try_from(self.nodes.len()).unwrap_or(u32::MAX);
        let (second, of_more) = self.grow(second, trail | 1 << depth, depth + 1);
        let (both, of_points) = (first.union(&second), of_points && of_more);
        let alike = of_points || (both.cone <= ALIKE && first.reach == second.reach);
        // Beside others that are brighter by 10¹⁶ they have no share that a sum would tell.
        let alike = alike && self.below[self.order.len()] > self.below[begin];
        let lights = [begin, self.order.len()].map(|k| u32::try_from(k).unwrap_or(u32::MAX));
        self.nodes[place] = Node { next, lights, alike, ..Node::new(&both) };
        (both, of_points)
    }

    /// The chance of the second child of an inner node; `None` when neither sends anything.
    #[inline]
    fn second(&self, at: usize, from: DVec3) -> Option<f64> {
        let first = self.nodes[at + 1].importance(from);
        let second = self.nodes[self.nodes[at].next as usize].importance(from);
        let sum = first + second;
        (sum > 0.0).then(|| second / sum)
    }

    /// A light for a point (m) by `u` in 0..1: its number, what is left of `u`, and its chance. `None` where
    /// none shines.
    pub(crate) fn pick(&self, from: DVec3, mut u: f64) -> Option<(usize, f64, f64)> {
        self.nodes.first().filter(|root| root.importance(from) > 0.0)?;
        let (mut at, mut chance) = (0, 1.0);
        while !self.nodes[at].is_end(from) {
            let second = self.second(at, from)?;
            let first = 1.0 - second;
            if u < first {
                (at, u, chance) = (at + 1, u / first, chance * first);
            } else {
                (at, u, chance) =
                    (self.nodes[at].next as usize, (u - first) / second, chance * second);
            }
            u = u.clamp(0.0, ONE_BELOW);
        }
        let [begin, end] = self.nodes[at].lights.map(|k| k as usize);
        if end - begin == 1 {
            return Some((self.order[begin] as usize, u, chance));
        }
        let place = self.below[begin] + u * (self.below[end] - self.below[begin]);
        let k = begin + self.below[begin + 1..end].partition_point(|&sum| sum <= place);
        let rest = (place - self.below[k]) / (self.below[k + 1] - self.below[k]);
        let chance = chance * self.share(k, [begin, end]);
        (chance > 0.0).then_some((self.order[k] as usize, rest.clamp(0.0, ONE_BELOW), chance))
    }

    /// The share of the `k`-th light in the intensity of those of a node.
    #[inline]
    fn share(&self, k: usize, [begin, end]: [usize; 2]) -> f64 {
        if end - begin == 1 {
            return 1.0;
        }
        (self.below[k + 1] - self.below[k]) / (self.below[end] - self.below[begin])
    }

    /// What its lights may send to a point (m) that faces them all (W/m²).
    pub(crate) fn importance(&self, from: DVec3) -> f64 {
        self.nodes.first().map_or(0.0, |root| root.importance(from))
    }

    /// Whether a light is in it.
    pub(crate) fn holds(&self, number: usize) -> bool {
        self.trails.get(number).is_some_and(Option::is_some)
    }

    /// The chance with which [`Self::pick`] picks a light for a point (m).
    pub(crate) fn chance(&self, from: DVec3, number: usize) -> f64 {
        let Some(Some((k, mut trail))) = self.trails.get(number).copied() else { return 0.0 };
        let (mut at, mut chance) = (0, 1.0);
        if self.nodes[at].importance(from) <= 0.0 {
            return 0.0;
        }
        while !self.nodes[at].is_end(from) {
            let Some(second) = self.second(at, from) else { return 0.0 };
            if trail & 1 == 1 {
                (at, chance) = (self.nodes[at].next as usize, chance * second);
            } else {
                (at, chance) = (at + 1, chance * (1.0 - second));
            }
            trail >>= 1;
        }
        chance * self.share(k as usize, self.nodes[at].lights.map(|k| k as usize))
    }
}

/// Puts the lights of a node in an order in which those of its first child come first, at least one and not
/// all; how many these are.
fn part(lights: &mut [(u32, Cluster)], depth: u32) -> usize {
    let half = lights.len() / 2;
    let centre = |light: &(u32, Cluster), axis: usize| light.1.bounds.centre()[axis];
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
        if high <= low || depth >= DEEP {
            continue;
        }
        let place = |light: &(u32, Cluster)| bucket(centre(light, axis), low, high);
        let mut buckets: [Option<Cluster>; BUCKETS] = [None; BUCKETS];
        for light in &*lights {
            let own = &mut buckets[place(light)];
            *own = Some(own.map_or(light.1, |all| all.union(&light.1)));
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

#[cfg(test)]
mod tests {
    use super::*;

    /// xorshift*: Vigna 2016.
    fn random() -> impl FnMut() -> f64 {
        let mut state = 0x1234_5678_9abc_def1_u64;
        move || {
            state ^= state >> 12;
            state ^= state << 25;
            state ^= state >> 27;
            (state.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) as f64 / (1_u64 << 53) as f64
        }
    }

    fn at(place: DVec3, axis: DVec3, cone: f64, intensity: f64) -> Cluster {
        let bounds = Bounds { min: place, max: place };
        Cluster { bounds, axis, cone, reach: FRAC_PI_2, intensity }
    }

    /// Lamps that shine to one side, and points, in a room of two metres.
    fn lights(count: u32, mut random: impl FnMut() -> f64) -> Vec<(u32, Cluster)> {
        let mut vector = move || DVec3::from([random(), random(), random()].map(|x| 2.0 * x - 1.0));
        (0..count)
            .map(|k| {
                let (place, axis) = (vector(), vector().normalize());
                let cone = if k % 2 == 0 { PI } else { 0.0 };
                let mut light = at(place, axis, cone, 0.1 + f64::from(k % 7));
                if k % 2 == 1 {
                    light.bounds.max += 0.03 * vector().abs();
                }
                (k, light)
            })
            .collect()
    }

    #[test]
    fn picks_have_the_chances_that_are_stated() {
        let all = lights(200, random());
        let tree = LightTree::new(all.clone(), 200);
        let mut random = random();
        for _ in 0..20 {
            let from = DVec3::from([random(), random(), random()].map(|x| 3.0 * x - 1.5));
            let chances: Vec<f64> = (0..200).map(|k| tree.chance(from, k)).collect();
            let sum: f64 = chances.iter().sum();
            // A node may promise what none of its lights keeps.
            assert!((0.5..1.0 + 1e-12).contains(&sum), "{sum}");
            let steps = 20_000;
            let mut counts = vec![0.0; 200];
            for k in 0..steps {
                let u = (f64::from(k) + 0.5) / f64::from(steps);
                let Some((number, rest, chance)) = tree.pick(from, u) else { continue };
                assert!((chance / chances[number] - 1.0).abs() < 1e-9);
                assert!((0.0..1.0).contains(&rest));
                counts[number] += 1.0 / f64::from(steps);
            }
            for (count, chance) in counts.iter().zip(&chances) {
                // A regular grid meets an interval to within one step.
                assert!((count - chance).abs() <= 1.001 / f64::from(steps), "{count} {chance}");
            }
        }
    }

    /// Wherever a lamp's front is seen, it may be picked.
    #[test]
    fn nothing_that_shines_is_left_out() {
        let all = lights(200, random());
        let tree = LightTree::new(all.clone(), 200);
        let mut random = random();
        let (mut seen, mut dark) = (0, 0);
        for _ in 0..500 {
            let from = DVec3::from([random(), random(), random()].map(|x| 3.0 * x - 1.5));
            for (number, light) in &all {
                let corners = light.bounds.corners();
                let shines = |corner: &DVec3| (from - *corner).dot(light.axis) > 0.0;
                let chance = tree.chance(from, *number as usize);
                if light.cone >= PI || corners.iter().any(shines) {
                    assert!(chance > 0.0, "{number} from {from}");
                    seen += 1;
                } else if chance == 0.0 {
                    dark += 1;
                }
            }
        }
        assert!(seen > 50_000 && dark > 10_000, "{seen} {dark}");
    }

    /// The variance of one light's share over its chance, Σ eᵢ²/pᵢ − (Σ eᵢ)², of 100 points in a room:
    /// less than a third of that by power.
    #[test]
    fn near_lights_are_picked_more_often() {
        let mut random = random();
        let mut place = || DVec3::from([random(), random(), random()].map(|x| 2.0 * x - 1.0));
        let all: Vec<_> = (0..100)
            .map(|k| (k, at(place(), DVec3::Y, PI, 0.02 + 0.04 * f64::from(k % 3))))
            .collect();
        let tree = LightTree::new(all.clone(), 100);
        let power: f64 = all.iter().map(|(_, light)| light.intensity).sum();
        let (mut by_tree, mut by_power) = (0.0, 0.0);
        for _ in 0..200 {
            // On the floor, which faces +Y.
            let from = DVec3::new(place().x, -1.0, place().z);
            let (mut sum, mut of_tree, mut of_power) = (0.0, 0.0, 0.0);
            for (number, light) in &all {
                let way = light.bounds.min - from;
                let brings = light.intensity * way.normalize().y / way.length_squared();
                sum += brings;
                of_tree += brings * brings / tree.chance(from, *number as usize);
                of_power += brings * brings / (light.intensity / power);
            }
            by_tree += of_tree / (sum * sum) - 1.0;
            by_power += of_power / (sum * sum) - 1.0;
        }
        assert!(by_tree < by_power / 3.0, "{by_tree} {by_power}");
    }

    #[test]
    fn lights_in_one_place_and_along_a_line_are_parted_too() {
        for step in [0.0, 1.0] {
            let line = |k: u32| (k, at(DVec3::X * (step * f64::from(k)), DVec3::Y, 0.0, 1.0));
            let tree = LightTree::new((0..1000).map(line).collect(), 1000);
            let from = DVec3::new(3.0, 4.0, 0.0);
            let sum: f64 = (0..1000).map(|k| tree.chance(from, k)).sum();
            assert!((sum - 1.0).abs() < 1e-12, "{sum}");
        }
        // All face away; along a line, the ball around a far node reaches to the other side.
        let here = (0..1000).map(|k| (k, at(DVec3::X, DVec3::Y, 0.0, 1.0))).collect();
        let behind = DVec3::new(3.0, -4.0, 0.0);
        assert!(LightTree::new(here, 1000).pick(behind, 0.5).is_none());
    }
}
