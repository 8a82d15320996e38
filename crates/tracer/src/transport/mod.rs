//! Light transport: one tracer, whatever the surfaces, the lights, the bands, the accelerator and the precision.
//!
//! All paths of a batch take their next step together (`trace.rs`): closest hits of all, emission that they
//! meet, then for each that goes on one light to ask (a shadow ray) and one direction to follow. Rays that ended are
//! left out, so each batch that reaches the accelerator is full. Rays are in blocks of sixteen of either precision
//! (`trace/lane.rs`): those of single precision are the accelerator's own packets, those of double precision are carried
//! to its batches.
//!
//! # Sources
//!
//! * Estimators of light and of directions, weighed against each other: Veach, *Robust Monte Carlo
//!   Methods for Light Transport Simulation*, 1997, sections 8.3 and 9.2 (power heuristic).
//! * Russian roulette: Arvo and Kirk, "Particle Transport and Image Synthesis", 1990.
//! * Many wavelengths on one path: Wilkie et al., "Hero Wavelength Spectral Sampling", 2014. Theirs keeps
//!   one of them where a smooth boundary parts them; here all go on, each its way.

mod boundaries;
mod dispersion;
mod encounter;
mod media;
mod rules;
mod trace;

use std::fmt::Debug;
use std::ops::{AddAssign, Range};

use etendue_accel::Accel;
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Geometry, HitPrecision, RayBatch, RayBlocks};

pub(crate) use self::encounter::RayHit;
pub use self::rules::{Follow, Rules};
pub(crate) use self::trace::SIZES;
use self::trace::Workspace;
use crate::bsdf::{Bsdf, Weights, metal};
use crate::emitters::Emitters;
use crate::lights::Lights;
use crate::placed::{PlacedSurface, PlacedSurfaces};
use crate::reference::SceneView;
use crate::spawn::{self, Anchor};
use crate::spectral::Spectral;
use crate::{ConductorId, Ior, Material, Tint};

/// The scene as light sees it.
#[derive(Debug, Clone, Copy)]
pub struct LightingContext<'a> {
    /// Acceleration structure that finds the hits.
    pub accel: &'a dyn Accel,
    /// Meshes, materials and images.
    pub scene: SceneView<'a>,
    /// Sources of the light.
    pub lights: &'a Lights,
    /// The bands.
    pub spectral: &'a Spectral,
    /// Features that its surfaces ask of tracers.
    pub traits: Traits,
    /// The surfaces that shine, where they are few.
    pub emitters: Option<&'a Emitters>,
    /// Surface of each placement, as far as it is known beforehand.
    pub placed: &'a PlacedSurfaces,
    /// Precision of its paths' hits.
    pub precision: HitPrecision,
}

impl LightingContext<'_> {
    /// A hit on a placement, found by a ray from `origin` (m).
    pub(crate) fn anchor(
        &self,
        point: DVec3,
        normal: DVec3,
        origin: DVec3,
        placed: &PlacedSurface,
    ) -> Anchor {
        Anchor::new(point, normal, origin, placed.magnitudes, self.roundings())
    }

    /// Number of roundings of the numbers of a hit, times the spacing of its precision.
    pub(crate) fn roundings(&self) -> f64 {
        spawn::roundings(self.precision)
    }
}

/// Features that the surfaces of a scene ask for: what none asks for is not done.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Traits {
    /// Some surface is not wholly there ([`Material::has_alpha`]).
    pub has_alpha: bool,
    /// Some surface is a smooth pane that light passes straight ([`Material::is_pane`]).
    pub has_panes: bool,
    /// Media are told apart: some body absorbs light on its way through, or bodies may be in one another.
    pub has_media: bool,
    /// Some boundaries between bodies may not be there.
    pub has_nested: bool,
    /// Some glass parts wavelengths.
    pub has_dispersion: bool,
}

impl Traits {
    /// Tests whether paths may pass surfaces as if they were not there.
    pub(crate) fn may_pass(&self) -> bool {
        self.has_alpha || self.has_nested
    }

    /// Those of all placed surfaces.
    #[must_use]
    pub fn of(geometry: &Geometry, materials: &[Material], surfaces: &PlacedSurfaces) -> Self {
        let mut traits = Self::default();
        let (mut has_sheets, mut has_bodies) = (false, false);
        for (i, placement) in (0..).zip(&geometry.placements) {
            let Some(material) = materials.get(placement.material as usize) else { continue };
            traits.has_alpha |= material.has_alpha();
            traits.has_panes |= material.is_pane();
            traits.has_media |= material.absorption().is_some();
            let glass = material.scattering.glass();
            traits.has_dispersion |=
                glass.is_some_and(|glass| matches!(glass.ior, Ior::Dispersive(_)));
            match surfaces.get(i).and_then(|surface| surface.body) {
                Some(body) => {
                    has_bodies = true;
                    traits.has_nested |= body.may_vanish;
                }
                None => has_sheets |= material.scattering.is_body(),
            }
        }
        traits.has_media |= traits.has_nested || (has_sheets && has_bodies);
        traits
    }
}

/// A batch of rays with what they carry.
#[derive(Debug, Clone)]
pub struct RaySamples<'a> {
    /// The rays.
    pub rays: PathRays<'a>,
    /// Random numbers of each ray.
    pub samples: &'a dyn Samples,
    /// The bands that these rays stand for: all, unless the camera sends wavelengths separate ways.
    pub bands: Range<usize>,
    /// Parts of their light that are told apart.
    pub parts: Parts,
}

/// Rays as which paths begin.
#[derive(Debug, Clone, Copy)]
pub enum PathRays<'a> {
    /// In double precision.
    Batch(&'a RayBatch),
    /// So many of one point (m, world), which run close together, in [`Scratch::camera_blocks`]: where
    /// [single precision](LightingContext::fits_single) holds the scene.
    Blocks {
        /// Their number.
        len: usize,
        /// The point where they start.
        from: DVec3,
    },
}

impl<'a> PathRays<'a> {
    /// Number of rays.
    pub(crate) fn len(self) -> usize {
        match self {
            Self::Batch(rays) => rays.len(),
            Self::Blocks { len, .. } => len,
        }
    }

    /// Tests whether they run close together.
    fn are_coherent(self) -> bool {
        match self {
            Self::Batch(rays) => rays.coherent,
            Self::Blocks { .. } => true,
        }
    }

    /// Times (s from the frame's time); none when all are at 0.
    fn times(self) -> &'a [f64] {
        match self {
            Self::Batch(rays) => rays.times(),
            Self::Blocks { .. } => &[],
        }
    }

    /// The origin of ray `i` (m).
    pub(crate) fn origin(self, i: usize) -> DVec3 {
        match self {
            Self::Batch(rays) => rays.origin(i),
            Self::Blocks { from, .. } => from,
        }
    }
}

/// Parts of the light of rays that are told apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Parts {
    /// Nothing: there is one number a band, the whole.
    #[default]
    Whole,
    /// Of how many groups of lights it comes, and how many surfaces scattered it. Behind the whole there are
    /// two numbers a band of each group: of light that one surface scattered at most, and of the rest.
    Groups(usize),
}

impl Parts {
    /// Numbers that there are of each band, the whole first.
    #[must_use]
    pub fn count(self) -> usize {
        match self {
            Self::Whole => 1,
            Self::Groups(groups) => 1 + 2 * groups,
        }
    }

    /// Row that sums up the light of a ray that so many surfaces scattered, from a group's lights.
    fn row(self, ray: u32, scatterings: u32, group: impl FnOnce() -> u32) -> u32 {
        match self {
            Self::Whole => ray,
            Self::Groups(_) => {
                let count = u32::try_from(self.count()).unwrap_or(u32::MAX);
                count * ray + 1 + 2 * group() + u32::from(scatterings > 1)
            }
        }
    }
}

/// Random numbers by ray and pair of dimensions, many at a time.
pub trait Samples: Debug {
    /// A point of the unit square of one pair for each of `rays`: `out` is refilled. Pairs are counted from 0, which
    /// no ray has used before.
    fn squares_of_pair(&self, rays: &[u32], pair: u32, out: &mut Vec<[f64; 2]>);

    /// The same in single precision, the numbers below 1, in two columns.
    fn floats_of_pair(&self, rays: &[u32], pair: u32, out: &mut [Vec<f32>; 2]);
}

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
    /// Pair of random numbers of this use at a step. Two pairs from an even one on are even together: a direction, and
    /// the light that is asked where it leads.
    pub(super) fn pair(self, step: u32) -> u32 {
        match self {
            Self::Light => step * DRAWS,
            Self::Direction => (step + 1) * DRAWS + 1,
            Self::Choice => step * DRAWS + 2,
            Self::Chance => step * DRAWS + 3,
        }
    }
}

/// Statistics of a batch.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct RayStats {
    /// Rays traced for their closest hit.
    pub rays: u64,
    /// Rays traced to a light.
    pub shadow_rays: u64,
    /// Contributions that were not finite, and were left out.
    pub not_finite: u64,
}

impl AddAssign for RayStats {
    fn add_assign(&mut self, other: Self) {
        self.rays += other.rays;
        self.shadow_rays += other.shadow_rays;
        self.not_finite += other.not_finite;
    }
}

/// Memory of one thread, kept between batches.
#[derive(Debug, Default)]
pub struct Scratch {
    single: Workspace<f32>,
    double: Workspace<f64>,
}

impl Scratch {
    /// Blocks for the rays of [`PathRays::Blocks`].
    pub fn camera_blocks(&mut self) -> &mut RayBlocks {
        &mut self.single.rays
    }
}

/// Traces the camera's rays by `rules`.
fn trace(
    rules: Rules,
    ctx: &LightingContext<'_>,
    camera: &RaySamples<'_>,
    scratch: &mut Scratch,
    out: &mut Vec<f64>,
) -> RayStats {
    match ctx.spectral.is_rgb() {
        true => trace_bands::<true>(rules, ctx, camera, scratch, out),
        false => trace_bands::<false>(rules, ctx, camera, scratch, out),
    }
}

fn trace_bands<const RGB: bool>(
    rules: Rules,
    ctx: &LightingContext<'_>,
    camera: &RaySamples<'_>,
    Scratch { single, double }: &mut Scratch,
    out: &mut Vec<f64>,
) -> RayStats {
    out.clear();
    out.resize(camera.rays.len() * camera.parts.count() * ctx.spectral.count(), 0.0);
    let mut tracing = Tracing::<RGB> {
        rules,
        ctx,
        parts: camera.parts,
        times: camera.rays.times(),
        tally: RayStats::default(),
    };
    match matches!(camera.rays, PathRays::Blocks { .. }) || ctx.fits_single() {
        true => tracing.trace::<f32>(camera, single, out),
        false => tracing.trace::<f64>(camera, double, out),
    }
    tracing.tally
}

/// One tracing of a batch. The bands of nearly all pictures are red, green and blue: that there are three, and
/// that colours are what they carry, is then known when the program is compiled.
struct Tracing<'a, const RGB: bool> {
    rules: Rules,
    ctx: &'a LightingContext<'a>,
    parts: Parts,
    /// Times of the camera's rays (s from the frame's time); empty when all are at 0.
    times: &'a [f64],
    tally: RayStats,
}

impl<const RGB: bool> Tracing<'_, RGB> {
    /// Tests whether the next surface that scatters a path is its last.
    #[inline(always)]
    pub(super) fn is_end(&self, bounces: u32) -> bool {
        bounces + 1 >= self.rules.bounces
    }

    /// The same unless it is specular.
    #[inline(always)]
    pub(super) fn is_end_unless_specular(&self, bounces: u32) -> bool {
        self.is_end(bounces) || self.rules.follow == Follow::Single
    }

    /// Number of bands.
    #[inline(always)]
    fn count(&self) -> usize {
        if RGB { 3 } else { self.ctx.spectral.count() }
    }

    /// A colour, with its curve, in band `k`.
    #[inline(always)]
    fn band(&self, tint: &Tint, k: usize) -> f64 {
        if RGB { tint.color[k] } else { self.ctx.spectral.tint(tint, k) }
    }

    /// The light of band `k` that met several facets of a colour, which return `mean` of all light where they reflect all
    /// of it.
    #[inline(always)]
    fn deep_band(&self, base: &Tint, mean: f64, k: usize) -> f64 {
        metal::multiple(metal::mean_reflectance(self.band(base, k), 0.0), mean)
    }

    /// Adds light to one of the [rows](Parts::row), and to the whole of its ray.
    fn add(&mut self, light: &[f64], row: u32, out: &mut [f64]) {
        if !light.iter().all(|band| band.is_finite()) {
            self.tally.not_finite += 1;
            return;
        }
        let mut to = |row: usize| {
            let start = row * self.count();
            let sums = &mut out[start..start + self.count()];
            sums.iter_mut().zip(light).for_each(|(sum, band)| *sum += band);
        };
        let (row, rows) = (row as usize, self.parts.count());
        to(row);
        if rows > 1 {
            to(row - row % rows);
        }
    }

    /// Adds red, green and blue to a ray's light, of which no parts are told apart.
    #[inline(always)]
    fn add_whole(&mut self, light: [f64; 3], ray: u32, out: &mut [f64]) {
        let [red, green, blue] = light;
        if !(red.is_finite() && green.is_finite() && blue.is_finite()) {
            self.tally.not_finite += 1;
            return;
        }
        let start = 3 * ray as usize;
        if let [sum_r, sum_g, sum_b] = &mut out[start..start + 3] {
            (*sum_r, *sum_g, *sum_b) = (*sum_r + red, *sum_g + green, *sum_b + blue);
        }
    }

    /// Value of the weights of a surface in band `k`.
    #[inline]
    fn in_band(&self, bsdf: &Bsdf, value: Weights, k: usize) -> f64 {
        if let Some(named) = bsdf.named() {
            return self.in_band_of_metal(named, bsdf.mean_albedo(), value, k);
        }
        let mut sum = value.white;
        if value.base != 0.0 {
            sum += value.base * self.band(&bsdf.base, k);
        }
        if value.highlight != 0.0 {
            sum += value.highlight * self.band(&bsdf.highlight, k);
        }
        if value.deep != 0.0 {
            sum += value.deep * self.deep_band(&bsdf.base, bsdf.mean_albedo(), k);
        }
        if value.sheen != 0.0 {
            sum += value.sheen * self.band(&bsdf.sheen(), k);
        }
        sum
    }

    /// The same of a metal of measured index, whose facets of reflectance 1 return `mean` of all light.
    fn in_band_of_metal(&self, named: ConductorId, mean: f64, value: Weights, k: usize) -> f64 {
        let [face_on, dip] = self.ctx.spectral.metal(named, k);
        let deep = metal::multiple(metal::mean_reflectance(face_on, dip), mean);
        let sum = value.white + value.base * face_on + value.dip * dip + value.deep * deep;
        sum.max(0.0)
    }
}
