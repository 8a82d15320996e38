//! Points that ask for light, and importance of the lights of a node to them, in single precision: of eight branches side by side, or many of one.

use std::f64::consts::PI;

use etendue_geometry::MISS;
use etendue_geometry::glam::{DVec3, Vec3};

use super::cluster::Cluster;
use crate::sampling::ONE_BELOW;

/// Branches of a node.
pub(super) const WIDTH: usize = 8;

/// Points at one node that are worked on side by side.
pub(super) const LANES: usize = 16;

/// Branches of two nodes.
const TWICE: usize = 2 * WIDTH;

/// Squared distance over squared radius from which on a branch's lights are as good as in one place. Not a setting, as
/// none of a light tree's numbers: they change which light is asked how often, and so noise, but no mean.
const FAR: f32 = 256.0;

/// Sums of eight of these are finite, and so are their squares in double.
const MOST_IMPORTANCE: f32 = 1e30;

/// Points are looked at no farther out than so many extents of all lights, in their own direction: squares and their
/// inverses stay numbers.
const FARTHEST: f64 = 1e15;

/// Share of the largest cosine that any light of a branch may have, in what is taken for all of them; the rest is that
/// of the branch's centre. What can bring light keeps this share of each of its two bounds.
const SHARE_OF_MOST: f32 = 0.125;

/// Bound, with room, on what rounding may take from a cosine in single precision.
const ROOM: f32 = 1e-5;

/// A point that asks for light.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Receiver {
    /// m.
    pub(crate) point: DVec3,
    /// The unit normal of the one side that it gets light from, by which that is weighed; zero where light comes
    /// from both.
    pub(crate) normal: DVec3,
}

/// Clusters of lights, as they are asked side by side; what is not there has no intensity.
#[derive(Debug, Clone)]
pub(super) struct Clusters<const N: usize> {
    pub(super) centre: [[f32; N]; 3],
    /// Half the diagonal.
    radius: [f32; N],
    axis: [[f32; N]; 3],
    /// Cosine and sine of the cone.
    cone: [[f32; N]; 2],
    pub(super) cos_reach: [f32; N],
    pub(super) intensity: [f32; N],
    /// Light that it may send to points between its lights.
    within: [f32; N],
    /// All shine to all sides.
    is_isotropic: bool,
}

/// The branches of a node.
#[derive(Debug, Clone, Default)]
pub(super) struct Node {
    pub(super) clusters: Clusters<WIDTH>,
    /// Squared distances from which on a light of each is chosen by intensity.
    pub(super) limits: [f32; WIDTH],
    pub(super) branches: [Branch; WIDTH],
}

/// The lights of a branch.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Branch {
    /// The node that parts them; [`MISS`] where there is one alone.
    pub(super) node: u32,
    /// They shine the same way.
    pub(super) alike: bool,
    /// Range of its lights in the tree's order: the first, and the first behind them.
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
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Viewer {
    pub(super) point: [f32; 3],
    /// Zero of one that gets light from both sides.
    pub(super) normal: [f32; 3],
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

    pub(super) fn local(&self, point: DVec3) -> Vec3 {
        let at = (point - self.centre) * self.scale;
        let [[x], [y], [z]] = local([[at.x], [at.y], [at.z]]);
        Vec3::new(x, y, z)
    }

    #[inline(always)]
    pub(super) fn viewer(&self, receiver: &Receiver) -> Viewer {
        Viewer {
            point: self.local(receiver.point).to_array(),
            normal: receiver.normal.as_vec3().to_array(),
        }
    }
}

/// Points in extents of all lights, none of them too far.
#[inline(always)]
pub(super) fn local<const N: usize>(points: [[f64; N]; 3]) -> [[f32; N]; 3] {
    let (mut shrink, mut local) = ([1.0; N], [[0.0; N]; 3]);
    for axis in &points {
        for k in 0..N {
            let most = FARTHEST / axis[k].abs();
            shrink[k] = if most < shrink[k] { most } else { shrink[k] };
        }
    }
    for axis in 0..3 {
        for k in 0..N {
            local[axis][k] = single(points[axis][k] * shrink[k]);
        }
    }
    local
}

#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is the purpose")]
fn single(x: f64) -> f32 {
    x as f32
}

impl<const N: usize> Default for Clusters<N> {
    fn default() -> Self {
        Self {
            centre: [[0.0; N]; 3],
            radius: [0.0; N],
            axis: [[0.0; N]; 3],
            cone: [[0.0; N]; 2],
            cos_reach: [0.0; N],
            intensity: [0.0; N],
            within: [0.0; N],
            is_isotropic: false,
        }
    }
}

impl Clusters<WIDTH> {
    fn set(&mut self, lane: usize, extent: &Extent, cluster: &Cluster) {
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
    }

    /// One of them, many times.
    #[inline(always)]
    pub(super) fn spread<const N: usize>(&self, k: usize) -> Clusters<N> {
        let [x, y, z] = &self.centre;
        let [along_x, along_y, along_z] = &self.axis;
        let [cosine, sine] = &self.cone;
        Clusters {
            centre: [[x[k]; N], [y[k]; N], [z[k]; N]],
            radius: [self.radius[k]; N],
            axis: [[along_x[k]; N], [along_y[k]; N], [along_z[k]; N]],
            cone: [[cosine[k]; N], [sine[k]; N]],
            cos_reach: [self.cos_reach[k]; N],
            intensity: [self.intensity[k]; N],
            within: [self.within[k]; N],
            is_isotropic: self.is_isotropic,
        }
    }
}

impl Node {
    pub(super) fn set(&mut self, lane: usize, extent: &Extent, cluster: &Cluster, branch: Branch) {
        self.clusters.set(lane, extent, cluster);
        self.branches[lane] = branch;
        let radius = self.clusters.radius[lane];
        self.limits[lane] = match branch {
            // At any distance.
            Branch { node: MISS, .. } => -1.0,
            Branch { alike: true, .. } => FAR * radius * radius,
            Branch { .. } => f32::INFINITY,
        };
    }

    /// The squared distance to the centre of a branch.
    #[inline(always)]
    pub(super) fn squared(&self, k: usize, viewer: &Viewer) -> f32 {
        let way = |axis: usize| self.clusters.centre[axis][k] - viewer.point[axis];
        way(0) * way(0) + way(1) * way(1) + way(2) * way(2)
    }

    /// Tests whether one of the lights of a branch at this squared distance is chosen by intensity.
    #[inline(always)]
    pub(super) fn is_end(&self, lane: usize, squared: f32) -> bool {
        squared > self.limits[lane]
    }

    /// View that the viewer has of each branch: what the branch may send, to a factor, and the squared distance.
    #[inline(always)]
    pub(super) fn view(&self, viewer: &Viewer) -> View {
        let [view, _] = Self::views([self; 2], [viewer; 2]);
        view
    }

    /// The same of two nodes by a viewer each, side by side: so many numbers as fill a register.
    #[inline(always)]
    pub(super) fn views([a, b]: [&Self; 2], [from, to]: [&Viewer; 2]) -> [View; 2] {
        let points = spread([&from.point, &to.point]);
        let normals = spread([&from.normal, &to.normal]);
        let both = Clusters::of_two(&a.clusters, &b.clusters);
        let (sent, squared) = both.sent(&points, Some(&normals));
        let mut views = [View::default(), View::default()];
        for k in 0..WIDTH {
            views[0].importance[k] = f64::from(sent[k]);
            views[1].importance[k] = f64::from(sent[WIDTH + k]);
            views[0].squared[k] = squared[k];
            views[1].squared[k] = squared[WIDTH + k];
        }
        views
    }
}

/// A number of each of two points or nodes, many times.
#[inline(always)]
fn spread([a, b]: [&[f32; 3]; 2]) -> [[f32; TWICE]; 3] {
    let mut all = [[0.0; TWICE]; 3];
    for axis in 0..3 {
        for k in 0..WIDTH {
            all[axis][k] = a[axis];
            all[axis][WIDTH + k] = b[axis];
        }
    }
    all
}

/// The numbers of one node's branches and of another's.
#[inline(always)]
#[expect(
    clippy::manual_memcpy,
    reason = "a copy between slices is a call, where instructions differ"
)]
fn twice(a: &[f32; WIDTH], b: &[f32; WIDTH]) -> [f32; TWICE] {
    let mut both = [0.0; TWICE];
    for k in 0..WIDTH {
        both[k] = a[k];
        both[WIDTH + k] = b[k];
    }
    both
}

impl Clusters<TWICE> {
    /// The branches of two nodes. (What maps arrays is a function of its own, compiled without wide registers.)
    #[inline(always)]
    fn of_two(a: &Clusters<WIDTH>, b: &Clusters<WIDTH>) -> Self {
        let (mut centre, mut axis) = ([[0.0; TWICE]; 3], [[0.0; TWICE]; 3]);
        for k in 0..3 {
            centre[k] = twice(&a.centre[k], &b.centre[k]);
            axis[k] = twice(&a.axis[k], &b.axis[k]);
        }
        Self {
            centre,
            radius: twice(&a.radius, &b.radius),
            axis,
            cone: [twice(&a.cone[0], &b.cone[0]), twice(&a.cone[1], &b.cone[1])],
            cos_reach: twice(&a.cos_reach, &b.cos_reach),
            intensity: twice(&a.intensity, &b.intensity),
            within: twice(&a.within, &b.within),
            is_isotropic: a.is_isotropic && b.is_isotropic,
        }
    }
}

impl<const N: usize> Clusters<N> {
    /// Light that each may send to a point, to a factor, and the squared distance; the normals of the points are asked
    /// where they get light from one side alone, and are zero where they do not.
    ///
    /// All is worked out for all of them, and from local arrays: else compilers do it one by one.
    #[inline(always)]
    pub(super) fn sent(
        &self,
        points: &[[f32; N]; 3],
        normals: Option<&[[f32; N]; 3]>,
    ) -> ([f32; N], [f32; N]) {
        let (mut squared, mut above, mut along) = ([0.0; N], [0.0; N], [0.0; N]);
        for axis in 0..3 {
            let (centre, own, from) = (self.centre[axis], self.axis[axis], points[axis]);
            for k in 0..N {
                let way = centre[k] - from[k];
                squared[k] += way * way;
                along[k] -= way * own[k];
            }
            if let Some(normals) = normals {
                for k in 0..N {
                    above[k] += (centre[k] - from[k]) * normals[axis][k];
                }
            }
        }
        let (radius, intensity, within) = (self.radius, self.intensity, self.within);
        let (mut inverse, mut sent, mut ball) = ([0.0; N], [0.0; N], [[0.0; N]; 2]);
        for k in 0..N {
            inverse[k] = 1.0 / squared[k].sqrt();
        }
        for k in 0..N {
            let near = intensity[k] * inverse[k] * inverse[k];
            sent[k] = if near < MOST_IMPORTANCE { near } else { MOST_IMPORTANCE };
        }
        // The half-angle of the branch's ball.
        for k in 0..N {
            ball[1][k] = radius[k] * inverse[k];
            ball[0][k] = other(ball[1][k]);
        }
        if !self.is_isotropic {
            let (cone, reach) = (self.cone, self.cos_reach);
            for k in 0..N {
                // The angle to the axis, less the cone's, less the ball's.
                let cosine = cosine(along[k] * inverse[k]);
                let angle = less([cosine, other(cosine)], [cone[0][k], cone[1][k]]);
                let [cosine, _] = less(angle, [ball[0][k], ball[1][k]]);
                // A light at the very end of its reach is met by a bound with room for rounding.
                let facing = typical_cosine(if cosine > ROOM { cosine } else { ROOM }, angle[0]);
                sent[k] = if cosine + ROOM > reach[k] { sent[k] * facing } else { 0.0 };
            }
        }
        for k in 0..N {
            sent[k] = if squared[k] <= radius[k] * radius[k] { within[k] } else { sent[k] };
        }
        if let Some(normals) = normals {
            let mut length = [0.0; N];
            for axis in normals {
                for k in 0..N {
                    length[k] += axis[k] * axis[k];
                }
            }
            // The most that the cosine is under which the point gets the light.
            for k in 0..N {
                let own = cosine(above[k] * inverse[k]);
                let [cosine, _] = less([own, other(own)], [ball[0][k], ball[1][k]]);
                let facing = typical_cosine(if cosine > ROOM { cosine } else { ROOM }, own);
                let facing = if cosine > -ROOM { facing } else { 0.0 };
                let facing = if length[k] > 0.0 { facing } else { 1.0 };
                let is_within = squared[k] <= radius[k] * radius[k];
                sent[k] *= if is_within { 1.0 } else { facing };
            }
        }
        (sent, squared)
    }
}

/// Cosine that is assumed where its maximum and its value at the centre are known: nearer to the mean over the lights
/// than either.
#[inline(always)]
fn typical_cosine(most: f32, at_centre: f32) -> f32 {
    let centre = if at_centre > 0.0 { at_centre } else { 0.0 };
    let centre = if centre < most { centre } else { most };
    SHARE_OF_MOST * most + (1.0 - SHARE_OF_MOST) * centre
}

/// A cosine that rounding may have put beyond 1.
#[inline(always)]
fn cosine(x: f32) -> f32 {
    let x = if x < 1.0 { x } else { 1.0 };
    if x > -1.0 { x } else { -1.0 }
}

/// The sine to a cosine, or the other way round; 0 where rounding went beyond 1.
#[inline(always)]
fn other(cosine: f32) -> f32 {
    let rest = 1.0 - cosine * cosine;
    (if rest > 0.0 { rest } else { 0.0 }).sqrt()
}

/// Cosine and sine of the first angle less the second, 0 at least.
#[inline(always)]
fn less([cos_a, sin_a]: [f32; 2], [cos_b, sin_b]: [f32; 2]) -> [f32; 2] {
    let is_more = cos_a < cos_b;
    let (cos, sin) = (cos_a * cos_b + sin_a * sin_b, sin_a * cos_b - cos_a * sin_b);
    [if is_more { cos } else { 1.0 }, if is_more { sin } else { 0.0 }]
}

/// View that a point has of each branch of a node.
#[derive(Debug, Default)]
pub(super) struct View {
    /// Light that the branch may send, to a factor.
    pub(super) importance: [f64; WIDTH],
    /// The squared distance to its centre.
    pub(super) squared: [f32; WIDTH],
}

impl View {
    /// The sums of what the branches up to each send.
    #[inline(always)]
    pub(super) fn sums(&self) -> [f64; WIDTH] {
        let mut sums = self.importance;
        for k in 1..WIDTH {
            sums[k] += sums[k - 1];
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
        Some((lane, rest, own / sums[WIDTH - 1]))
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
