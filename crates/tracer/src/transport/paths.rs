//! Paths under way and what each remembers; the workspace of a thread.
//!
//! All paths of a batch have taken equally many steps, so what a path remembers is little. What no surface of the
//! scene asks for is not remembered: those columns stay empty.

use etendue_geometry::glam::DVec3;
use etendue_geometry::{HitBatch, PlacedTriangle, RayBatch, RayBlock};

use super::media::{Coincident, Media};
use super::rays::Rays;
use super::{LightingContext, RaySamples};
use crate::footprint::Cone;
use crate::light_sampler::Receiver;
use crate::placed::SurfaceKind;
use crate::sampling::power_heuristic;
use crate::sky::SkySamples;

/// Use that a path makes of random numbers at each step.
#[derive(Debug, Clone, Copy)]
pub(super) enum Draw {
    /// Choosing among the ways in which a surface scatters.
    Choice,
    /// Choosing a light and a place on it; or the band that stays where glass splits them.
    Light,
    /// The direction to follow.
    Direction,
    /// Deciding whether a surface is there, and whether a path goes on.
    Chance,
}

/// Number of uses.
pub(super) const DRAWS: u32 = 4;

impl Draw {
    pub(super) const ALL: [Self; DRAWS as usize] =
        [Self::Choice, Self::Light, Self::Direction, Self::Chance];
}

/// Paths under way that have taken equally many steps.
#[derive(Debug, Default)]
pub(super) struct Paths<R> {
    pub(super) rays: R,
    pub(super) carried: Carried,
}

/// Data that each path, or each ray to a light, carries.
#[derive(Debug, Default)]
pub(super) struct Carried {
    /// The camera's ray; or the [row](super::Parts::row) that its light is added to.
    pub(super) ray: Vec<u32>,
    /// Of paths alone.
    pub(super) ways: Vec<Way>,
    /// Cone that each path stands for, as long as it only met mirrors and clear boundaries; as wide as where its ray
    /// starts. Empty before the first surface, and where all surfaces are matte.
    pub(super) cones: Vec<Option<Cone>>,
    /// The surfaces that were not there; empty where all are.
    pub(super) passages: Vec<Passage>,
    /// The media that each is in; empty where they do not count.
    pub(super) media: Vec<Media>,
    /// The wavelength (nm) of the one band left, after a glass has parted them; empty where none does.
    pub(super) wavelengths: Vec<Option<f64>>,
    /// The triangle that each leaves, of last directions alone.
    pub(super) left: Vec<PlacedTriangle>,
    /// No path can meet the light of this ray; empty of paths, and where there are no panes.
    pub(super) is_delta: Vec<bool>,
    /// `[path][band]`.
    pub(super) throughput: Vec<f64>,
}

/// Way in which a path came to its direction.
#[derive(Debug, Clone, Copy)]
pub(super) struct Way {
    /// Density (1/sr) of the direction; unused where it is specular.
    pub(super) pdf: f64,
    /// No light was asked in its stead: it is the camera's, a mirror's or a smooth boundary's.
    pub(super) is_specular: bool,
    /// It looks for light and goes no farther.
    pub(super) is_last: bool,
    /// Of the surface that it left, by which lights were chosen for it ([`Receiver::normal`]).
    pub(super) normal: [f32; 3],
}

impl Way {
    pub(super) const CAMERA: Self =
        Self { pdf: 0.0, is_specular: true, is_last: false, normal: [0.0; 3] };

    /// The point (m) that it left, as lights were chosen for it.
    pub(super) fn receiver(self, point: DVec3) -> Receiver {
        Receiver { point, normal: self.normal.map(f64::from).into() }
    }

    /// The weight of light that was met against having asked for it with density `pdf` (1/sr).
    pub(super) fn weight_against(self, pdf: f64) -> f64 {
        if self.is_specular { 1.0 } else { power_heuristic(self.pdf, pdf) }
    }
}

/// The surfaces that a path passed since they were not there.
#[derive(Debug, Clone, Copy)]
pub(super) struct Passage {
    /// On the whole path.
    pub(super) surfaces: u32,
    /// The place (m) from which it came, if the last surface that it met was one.
    pub(super) from: Option<DVec3>,
}

impl Carried {
    pub(super) fn clear(&mut self) {
        self.ray.clear();
        self.ways.clear();
        self.cones.clear();
        self.passages.clear();
        self.media.clear();
        self.wavelengths.clear();
        self.left.clear();
        self.is_delta.clear();
        self.throughput.clear();
    }

    /// The media that a path is in.
    pub(super) fn media_of(&self, i: usize) -> Media {
        self.media.get(i).copied().unwrap_or(Media::NONE)
    }

    /// The wavelength (nm) of a path that has but one band.
    pub(super) fn wavelength_of(&self, i: usize) -> Option<f64> {
        self.wavelengths.get(i).copied().flatten()
    }
}

impl<R: Rays> Paths<R> {
    pub(super) fn restart(&mut self, ctx: &LightingContext<'_>) {
        self.rays.restart(ctx);
        self.carried.clear();
    }

    /// Surfaces that have scattered a path, which has taken so many steps.
    #[inline(always)]
    pub(super) fn bounces(&self, steps: u32, i: usize) -> u32 {
        steps - self.carried.passages.get(i).map_or(0, |passage| passage.surfaces)
    }

    /// Point where the direction of a path begins (m).
    #[inline(always)]
    pub(super) fn from(&self, i: usize) -> DVec3 {
        let from = self.carried.passages.get(i).and_then(|passage| passage.from);
        from.unwrap_or_else(|| self.rays.origin(i))
    }
}

/// The kinds of surfaces that paths go on from, in the order in which they are worked on.
pub(super) const KINDS: [SurfaceKind; 4] =
    [SurfaceKind::Matte, SurfaceKind::Sheet, SurfaceKind::Smooth, SurfaceKind::Other];

/// Directions in which paths go on.
#[derive(Debug, Default)]
pub(super) struct Onward<R> {
    pub(super) next: Paths<R>,
    /// Last directions, which ask only what shines.
    pub(super) last: RayBatch,
    pub(super) of_last: Carried,
}

/// Memory of one thread, kept between batches.
#[derive(Debug, Default)]
pub(super) struct Workspace<R> {
    pub(super) now: Paths<R>,
    pub(super) onward: Onward<R>,
    pub(super) shadows: Paths<R>,
    /// Shadow rays behind surfaces that let light pass, and which those are.
    pub(super) behind: R,
    pub(super) open: Vec<u32>,
    /// Hits of last directions.
    pub(super) hits: HitBatch,
    /// The placement that each path hit, or [`MISS`](etendue_geometry::MISS).
    pub(super) placements: Vec<u32>,
    /// Boundaries of other bodies in the place of each hit; empty where bodies do not touch.
    pub(super) coincident: Vec<Coincident>,
    /// Paths that go on by the kind of surface that they met, in the order of [`KINDS`]; of them one after the
    /// other the camera's rays, and their random numbers by use.
    pub(super) kinds: [Vec<u32>; KINDS.len()],
    pub(super) alive: Vec<u32>,
    pub(super) drawn: [Vec<[f64; 2]>; DRAWS as usize],
    /// Hits of one kind put side by side, and those of sheets that turned out to be smooth: their paths, and which
    /// of those that go on they are.
    pub(super) side_by_side: Vec<RayBlock>,
    pub(super) smooth: Vec<(usize, usize)>,
    /// Paths that met nothing, and what is asked of the sky together.
    pub(super) missed: Vec<u32>,
    pub(super) asked: SkySamples,
    /// Lanes of a patch that are worked on.
    pub(super) picked: Vec<usize>,
    /// Light of one hit by band.
    pub(super) radiance: Vec<f64>,
}

impl<R> Workspace<R> {
    /// The numbers of the `k`-th path that goes on, for one use.
    #[inline(always)]
    pub(super) fn number(&self, draw: Draw, k: usize) -> [f64; 2] {
        self.drawn[draw as usize].get(k).copied().unwrap_or([0.5; 2])
    }
}

/// Data that all paths of a batch have in common at one step.
pub(super) struct Step<'a> {
    pub(super) camera: &'a RaySamples<'a>,
    /// Surfaces that the paths have met.
    pub(super) number: u32,
    /// Last directions ask only what shines, but for specular ones.
    pub(super) asks_emitters: bool,
    /// Hits may be of several kinds.
    pub(super) is_mixed: bool,
}
