//! What a point has of the lights of a node: eight branches side by side, in single precision.

use std::f64::consts::PI;

use etendue_geometry::MISS;
use etendue_geometry::glam::{DVec3, Vec3};

use super::cluster::Cluster;
use crate::light_sampler::Receiver;
use crate::sampling::ONE_BELOW;

/// Branches of a node.
pub(super) const WIDTH: usize = 8;

/// Squared distance over squared radius from which on a branch's lights are as good as in one place.
const FAR: f32 = 256.0;

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
pub(super) struct Node {
    pub(super) centre: [Lanes; 3],
    /// Half the diagonal.
    pub(super) radius: Lanes,
    pub(super) axis: [Lanes; 3],
    /// Cosine and sine of the cone.
    pub(super) cone: [Lanes; 2],
    pub(super) cos_reach: Lanes,
    pub(super) intensity: Lanes,
    /// What it may send to points between its lights.
    pub(super) within: Lanes,
    /// All shine to all sides.
    pub(super) is_isotropic: bool,
    pub(super) branches: [Branch; WIDTH],
}

/// The lights of a branch.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Branch {
    /// The node that parts them; [`MISS`] where there is one alone.
    pub(super) node: u32,
    /// They shine the same way.
    pub(super) alike: bool,
    /// Which of the lights in the tree's order they are: the first, and the first behind them.
    pub(super) lights: [u32; 2],
}

/// The extent of all lights, in which lengths are told, and the sum of their intensities.
#[derive(Debug, Clone, Copy)]
pub(super) struct Extent {
    /// m.
    pub(super) centre: DVec3,
    /// Per metre.
    pub(super) scale: f64,
    /// W/sr.
    pub(super) intensity: f64,
}

/// A point that asks for light, as nodes see it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Viewer {
    pub(super) point: [f32; 3],
    pub(super) normal: [f32; 3],
    pub(super) is_one_sided: bool,
}

impl Default for Extent {
    fn default() -> Self {
        Self { centre: DVec3::ZERO, scale: 1.0, intensity: 1.0 }
    }
}

impl Extent {
    pub(super) fn of(all: &Cluster) -> Self {
        let diagonal = all.bounds.diagonal();
        let scale = if diagonal > 0.0 { 1.0 / diagonal } else { 1.0 };
        Self { centre: all.bounds.centre(), scale, intensity: all.intensity }
    }

    fn local(&self, point: DVec3) -> Vec3 {
        let limit = DVec3::splat(FARTHEST);
        ((point - self.centre) * self.scale).clamp(-limit, limit).as_vec3()
    }

    #[inline(always)]
    pub(super) fn viewer(&self, receiver: &Receiver) -> Viewer {
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
    pub(super) fn set(&mut self, lane: usize, extent: &Extent, cluster: &Cluster, branch: Branch) {
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
        self.is_isotropic = cluster.cone >= PI && (lane == 0 || self.is_isotropic);
        self.branches[lane] = branch;
    }

    /// The squared distance to the centre of a branch, and its height above the viewer's horizon.
    #[inline(always)]
    pub(super) fn way(&self, k: usize, viewer: &Viewer) -> [f32; 2] {
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
    pub(super) fn isotropic(&self, k: usize, squared: f32) -> f32 {
        let near = self.intensity[k] / squared;
        let near = if near < MOST_IMPORTANCE { near } else { MOST_IMPORTANCE };
        let is_within = squared <= self.radius[k] * self.radius[k];
        if is_within { self.within[k] } else { near }
    }

    /// The same where they shine ahead.
    #[inline(always)]
    pub(super) fn directed(&self, k: usize, from: [f32; 3], squared: f32) -> f32 {
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
    pub(super) fn is_end(&self, lane: usize, squared: f32) -> bool {
        let Branch { node, alike, .. } = self.branches[lane];
        node == MISS || (alike && squared > FAR * self.radius[lane] * self.radius[lane])
    }

    /// What the viewer has of each branch: what the branch may send, to a factor, and the squared distance.
    #[inline(always)]
    pub(super) fn view(&self, viewer: &Viewer) -> View {
        let (mut squared, mut above, mut importance) = ([0.0; WIDTH], [0.0; WIDTH], [0.0; WIDTH]);
        for k in 0..WIDTH {
            [squared[k], above[k]] = self.way(k, viewer);
        }
        if self.is_isotropic {
            for k in 0..WIDTH {
                importance[k] = self.isotropic(k, squared[k]);
            }
        } else {
            for k in 0..WIDTH {
                importance[k] = self.directed(k, viewer.point, squared[k]);
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
pub(super) struct View {
    /// What the branch may send, to a factor.
    pub(super) importance: [f64; WIDTH],
    /// The squared distance to its centre.
    pub(super) squared: Lanes,
}

impl View {
    /// The sums of what the branches up to each send.
    #[inline(always)]
    pub(super) fn sums(&self) -> [f64; WIDTH] {
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
    pub(super) fn pick(&self, u: f64) -> Option<(usize, f64, f64)> {
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
    pub(super) fn share(&self, lane: usize) -> f64 {
        match self.importance[lane] {
            own if own > 0.0 => own / self.sums()[WIDTH - 1],
            _ => 0.0,
        }
    }
}
