//! Hits worked on side by side: one array a number, of so many lanes.

use etendue_geometry::MISS;
use etendue_geometry::glam::DVec3;

use super::media::Crossing;
use crate::area_light::AreaLight;
use crate::bsdf::sheets::Sheets;
use crate::bsdf::smooth::Smooth;
use crate::bsdf::{Bsdf, Weights};
use crate::light_sampler::Receiver;
use crate::light_tree::Choices;
use crate::spawn::Anchor;
use crate::target::{Target, TargetKind};
use crate::{ConductorId, LANES, Row, Tint};

/// Hits of f32 are beside an edge of their triangle where their least barycentric weight is below this: only
/// triangles that are less than some hundred of the bounds of [`spawn`](crate::spawn) high have others as near
/// to one, and a mesh of those has no sharp corners that it can resolve.
pub(super) const BESIDE: f64 = 1.0 / 256.0;

/// Hits and what leaves them.
#[derive(Debug, Default)]
pub(super) struct Patch {
    pub(super) count: usize,
    /// Some shading normal is not that of its triangle.
    pub(super) is_tilted: bool,
    /// Of each path: its number, and which of those that go on it is.
    pub(super) path: Vec<(usize, usize)>,
    pub(super) seen: Seen,
    pub(super) away: Away,
    pub(super) picks: Picks,
    pub(super) choices: Choices,
    pub(super) targets: Targets,
    /// The colours of matte surfaces.
    pub(super) colors: Vec<Tint>,
    /// The surfaces that are not matte, and what each turns to the viewer of the light that it asks.
    pub(super) bsdfs: Vec<Bsdf>,
    pub(super) weights: Vec<Weights>,
    /// The surfaces that are smooth.
    pub(super) smooth: Smooth,
    /// The surfaces that are sheets of facets over a matte base, and their colours.
    pub(super) sheets: Box<Sheets>,
    pub(super) sheet_colors: Vec<SheetColors>,
    /// The media on their sides, where they part any.
    pub(super) crossings: Vec<Option<Crossing>>,
    /// What each light that was chosen gives off: `[lane][band]`.
    pub(super) radiance: Vec<f64>,
}

/// The colours of a sheet of facets over a matte base.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct SheetColors {
    pub(super) highlight: Tint,
    /// The metal by whose measured index it reflects.
    pub(super) named: Option<ConductorId>,
}

/// The hits.
#[derive(Debug)]
pub(super) struct Seen {
    pub(super) origin: [Row; 3],
    pub(super) direction: [Row; 3],
    pub(super) t: Row,
    /// The triangle's normal, on the viewer's side once measured.
    pub(super) normal: [Row; 3],
    /// The one that light is scattered by, likewise.
    pub(super) shading: [Row; 3],
    pub(super) point: [Row; 3],
    /// What the placement's own numbers add to the rounding of the hit (m), and what that comes to.
    pub(super) magnitudes: [Row; 3],
    pub(super) error: Row,
    /// 1 where it is beside an edge, and what rays that leave start behind by (m).
    pub(super) is_beside: Row,
    pub(super) back: [Row; 3],
}

/// The places on lights that the hits ask, as [`Target`] has them.
#[derive(Debug)]
pub(super) struct Targets {
    pub(super) id: [[u32; 2]; LANES],
    /// The number of the light, where it is no triangle.
    pub(super) light: [u32; LANES],
    pub(super) place: [[Row; 3]; 3],
    pub(super) normal: [Row; 3],
    pub(super) magnitudes: [Row; 3],
    pub(super) density: Row,
    /// 1 where it is a direction; where it is a triangle; where that shines on both sides.
    pub(super) is_far: Row,
    pub(super) is_triangle: Row,
    pub(super) two_sided: Row,
    /// 1 where no direction meets it by chance.
    pub(super) is_delta: Row,
}

/// Which light each hit asks.
#[derive(Debug)]
pub(super) struct Picks {
    /// The number of the light.
    pub(super) index: [u32; LANES],
    /// Of the number that picked it what is left, and the other of the pair: a place on the light.
    pub(super) square: [Row; 2],
    /// With which it was picked; 0 where none was.
    pub(super) chance: Row,
}

/// Rays that leave the hits.
#[derive(Debug)]
pub(super) struct Away {
    pub(super) start: [Row; 3],
    pub(super) along: [Row; 3],
    /// How far (m).
    pub(super) reach: Row,
    /// From the hit itself to its light (unit), and the density of that (1/sr); `+inf` where it sends
    /// nothing.
    pub(super) toward: [Row; 3],
    pub(super) pdf: Row,
    /// The share of light that a matte surface turns to the viewer per colour, over the density of the
    /// direction; or the density itself where the direction was drawn.
    pub(super) value: Row,
}

const ZERO: Row = [0.0; LANES];

impl Default for Seen {
    fn default() -> Self {
        Self {
            origin: [ZERO; 3],
            direction: [ZERO; 3],
            t: ZERO,
            normal: [ZERO; 3],
            shading: [ZERO; 3],
            point: [ZERO; 3],
            magnitudes: [ZERO; 3],
            error: ZERO,
            is_beside: ZERO,
            back: [ZERO; 3],
        }
    }
}

impl Default for Targets {
    fn default() -> Self {
        Self {
            id: [[MISS; 2]; LANES],
            light: [MISS; LANES],
            place: [[ZERO; 3]; 3],
            normal: [ZERO; 3],
            magnitudes: [ZERO; 3],
            density: ZERO,
            is_far: ZERO,
            is_triangle: ZERO,
            two_sided: ZERO,
            is_delta: ZERO,
        }
    }
}

impl Default for Picks {
    fn default() -> Self {
        Self { index: [MISS; LANES], square: [ZERO; 2], chance: ZERO }
    }
}

impl Default for Away {
    fn default() -> Self {
        Self {
            start: [ZERO; 3],
            along: [ZERO; 3],
            reach: ZERO,
            toward: [ZERO; 3],
            pdf: ZERO,
            value: ZERO,
        }
    }
}

impl Patch {
    /// Empties it.
    pub(super) fn clear(&mut self) {
        self.count = 0;
        self.is_tilted = false;
        self.path.clear();
        self.colors.clear();
        self.bsdfs.clear();
        self.weights.clear();
        self.crossings.clear();
    }

    fn point(&self, lane: usize) -> DVec3 {
        at(&self.seen.point, lane)
    }

    /// Where a ray starts that leaves the hit of a lane along `towards`.
    pub(super) fn leave(&self, lane: usize, towards: DVec3) -> DVec3 {
        let normal = at(&self.seen.normal, lane);
        let anchor = Anchor { point: self.point(lane), normal, error: self.seen.error[lane] };
        anchor.leave(towards) + at(&self.seen.back, lane)
    }
}

impl Seen {
    /// The hit of a lane as lights are chosen for it: a matte surface or a sheet, unless it has another model.
    #[inline(always)]
    pub(super) fn receiver(&self, lane: usize, bsdf: Option<&Bsdf>) -> Receiver {
        let normal = bsdf.map_or_else(|| at(&self.shading, lane), Bsdf::receiving_normal);
        Receiver { point: at(&self.point, lane), normal }
    }
}

impl Targets {
    /// Sets what a lane aims at: the place on a triangle with these weights of its second and third corner.
    #[inline(always)]
    pub(super) fn set_triangle(
        &mut self,
        lane: usize,
        triangle: &AreaLight,
        weights: [f64; 2],
        chance: f64,
    ) {
        self.id[lane] = triangle.id;
        let [corner, rest] = triangle.corner;
        for (rows, part) in self.place.iter_mut().zip([corner, rest, triangle.across(weights)]) {
            put(rows, lane, part);
        }
        put(&mut self.normal, lane, triangle.shape.normal);
        put(&mut self.magnitudes, lane, triangle.magnitudes);
        self.density[lane] = chance / triangle.shape.area;
        (self.is_far[lane], self.is_delta[lane], self.is_triangle[lane]) = (0.0, 0.0, 1.0);
        self.two_sided[lane] = f64::from(u8::from(triangle.two_sided));
    }

    /// Sets what a lane aims at: the light of that number, a point (m) that was chosen with this chance.
    #[inline(always)]
    pub(super) fn set_point(&mut self, lane: usize, light: u32, point: DVec3, chance: f64) {
        self.id[lane] = [MISS; 2];
        self.light[lane] = light;
        let [first, rest @ ..] = &mut self.place;
        put(first, lane, point);
        rest.iter_mut().for_each(|part| put(part, lane, DVec3::ZERO));
        put(&mut self.normal, lane, DVec3::ZERO);
        put(&mut self.magnitudes, lane, DVec3::ZERO);
        self.density[lane] = chance;
        (self.is_far[lane], self.is_delta[lane], self.is_triangle[lane]) = (0.0, 1.0, 0.0);
        self.two_sided[lane] = 0.0;
    }

    /// Sets what a lane aims at: a unit direction of this density (1/sr) to a light of that number; nothing where
    /// the density is 0.
    #[inline(always)]
    pub(super) fn set_far(&mut self, lane: usize, light: u32, direction: DVec3, density: f64) {
        self.id[lane] = [MISS; 2];
        self.light[lane] = light;
        put(&mut self.place[0], lane, direction);
        put(&mut self.normal, lane, DVec3::ZERO);
        self.density[lane] = if density > 0.0 { density } else { f64::INFINITY };
        (self.is_far[lane], self.is_delta[lane], self.is_triangle[lane]) = (1.0, 0.0, 0.0);
    }

    /// Sets what a lane aims at; at nothing when there is no light.
    #[inline]
    pub(super) fn set(&mut self, lane: usize, target: Option<&Target>) {
        let Some(target) = target else {
            self.density[lane] = f64::INFINITY;
            return;
        };
        self.id[lane] = target.id;
        self.light[lane] = target.light;
        for (rows, part) in self.place.iter_mut().zip(target.place) {
            put(rows, lane, part);
        }
        put(&mut self.normal, lane, target.normal);
        put(&mut self.magnitudes, lane, target.magnitudes);
        self.density[lane] = target.density;
        let flag = |yes: bool| f64::from(u8::from(yes));
        self.is_far[lane] = flag(matches!(target.kind, TargetKind::Far | TargetKind::Parallel));
        self.is_delta[lane] = flag(matches!(target.kind, TargetKind::Point | TargetKind::Parallel));
        self.is_triangle[lane] = flag(matches!(target.kind, TargetKind::Triangle { .. }));
        self.two_sided[lane] = flag(target.kind == TargetKind::Triangle { two_sided: true });
    }
}

/// Those of a patch's picked lanes that are worked on further, by their numbers. Put side by side without a branch,
/// as nothing tells beforehand which they are.
pub(super) struct Compressed {
    numbers: [u8; LANES],
    count: usize,
}

impl Compressed {
    /// Those of so many picked lanes, at most as many as a patch has, that are `wanted`.
    #[inline(always)]
    pub(super) fn of(picked: usize, wanted: impl Fn(usize) -> bool) -> Self {
        let (mut numbers, mut count) = ([0; LANES], 0);
        for (n, number) in (0..picked.min(LANES)).zip(0_u8..) {
            numbers[count] = number;
            count += usize::from(wanted(n));
        }
        Self { numbers, count }
    }

    /// Their numbers, in order.
    #[inline(always)]
    pub(super) fn numbers(&self) -> impl Iterator<Item = usize> {
        self.numbers[..self.count].iter().map(|&number| usize::from(number))
    }
}

#[inline]
pub(super) fn at(axes: &[Row; 3], lane: usize) -> DVec3 {
    DVec3::new(axes[0][lane], axes[1][lane], axes[2][lane])
}

#[inline]
pub(super) fn put(axes: &mut [Row; 3], lane: usize, vector: DVec3) {
    (axes[0][lane], axes[1][lane], axes[2][lane]) = vector.into();
}
