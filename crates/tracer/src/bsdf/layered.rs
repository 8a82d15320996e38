//! glTF's metallic-roughness model as one that can be traced: reciprocal, and never brighter than
//! what falls in.
//!
//! The Khronos Group, *glTF 2.0 Specification*, appendix B, mixes a metal and a dielectric by
//! `metallic`; the dielectric is a GGX sheet over a matte base. The specification weighs the base by
//! `1 − F(h)`, which returns more than falls in at grazing angles; here the base gets what the sheet
//! leaves on both ways ([`super::albedo`]). `KHR_materials_specular` and `_ior` set the sheet's
//! reflectances, `KHR_materials_transmission` lets a share of the base through a thin wall. The metal
//! keeps its energy as [`super::metal`] does. `KHR_materials_anisotropy` makes facets rougher along the
//! surface than across it, `KHR_materials_sheen` and `_clearcoat` lie over all of it, in this order.

use std::f64::consts::PI;

use etendue_geometry::glam::DVec3;

use super::albedo::Albedo;
use super::coat::{self, Coat};
use super::ggx::Facets;
use super::metal::{deep, mean_reflectance, multiple};
use super::sheen::{self, Sheen};
use super::{Weights, fresnel, ggx};
use crate::sampling::cosine_direction;

/// The numbers of the model at one hit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Layered {
    /// Share of metal, 0..=1.
    pub metallic: f64,
    /// The square of the roughness, 0..=1; at 0 the sheet is a mirror.
    pub alpha: f64,
    /// The same along the x axis of the shading frame: `alpha` or more.
    pub along: f64,
    /// The dielectric's reflectance face on, before the highlights' colour.
    pub f0: f64,
    /// Its reflectance at grazing incidence (`specularFactor`).
    pub f90: f64,
    /// The dielectric's index, by which a smooth pane reflects.
    pub ior: f64,
    /// Share of the base that is a hole in a thin wall, 0..=1.
    pub transmission: f64,
    /// A sheen over all of it.
    pub sheen: Sheen,
    /// A clear coat over that.
    pub coat: Coat,
}

/// The largest bands of a surface's colours.
#[derive(Debug, Clone, Copy)]
pub(super) struct Peaks {
    pub(super) base: f64,
    pub(super) highlight: f64,
}

/// A sampled direction in the shading frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct LayeredSample {
    pub(super) wi: DVec3,
    pub(super) weights: Weights,
    /// Density per solid angle (1/sr); `+inf` of a specular event.
    pub(super) pdf: f64,
    /// True if the event is specular: the sheet is a mirror or a smooth pane.
    pub(super) is_specular: bool,
}

impl LayeredSample {
    /// A specular event.
    fn specular(wi: DVec3, weights: Weights) -> Self {
        Self { wi, weights, pdf: f64::INFINITY, is_specular: true }
    }

    /// A direction with its value times cosine and its density; `None` where the model never gives it.
    fn of_density(wi: DVec3, value: Weights, pdf: f64) -> Option<Self> {
        (pdf > 0.0).then(|| Self { wi, weights: value.times(1.0 / pdf), pdf, is_specular: false })
    }
}

/// Probabilities of the three parts as seen from one direction.
#[derive(Debug, Clone, Copy)]
struct Chances {
    sheet: f64,
    base: f64,
    through: f64,
}

/// The model as seen from one direction.
#[derive(Debug, Clone, Copy)]
pub(super) struct LayeredView {
    peaks: Peaks,
    /// Of the dielectric.
    albedo: Albedo,
    /// Shares of light from the viewer that the dielectric, and facets of reflectance 1, return.
    dielectric: f64,
    facets: f64,
    /// Their means over directions.
    dielectric_mean: f64,
    pub(super) mean: f64,
    /// The mean of what facets of reflectance 1 lack.
    lacking: f64,
    chances: Chances,
    sheen: Option<sheen::SheenView>,
    coat: Option<coat::CoatView>,
}

impl Layered {
    pub(super) fn is_delta(&self) -> bool {
        let matte = (1.0 - self.metallic) * (1.0 - self.transmission);
        self.alpha == 0.0 && matte == 0.0 && self.is_bare()
    }

    /// Tests whether neither a sheen nor a coat lies over it.
    fn is_bare(&self) -> bool {
        self.coat.share == 0.0 && self.sheen.color.peak() <= 0.0
    }

    fn facets(&self) -> Facets {
        Facets { x: self.along, y: self.alpha }
    }

    /// As seen from `wo`.
    pub(super) fn viewed(&self, wo: DVec3, peaks: &Peaks) -> LayeredView {
        let albedo = Albedo::new(self.facets(), (self.f0 * peaks.highlight).min(1.0), self.f90);
        let ([a, b], [mean_a, mean_b, lacking]) = (albedo.terms(wo), albedo.means());
        let mut viewed = LayeredView {
            peaks: *peaks,
            albedo,
            dielectric: self.returned(wo, &albedo, [a, b]),
            facets: (a + b).min(1.0),
            dielectric_mean: self.returned_mean(&albedo, [mean_a, mean_b]),
            mean: (mean_a + mean_b).min(1.0),
            lacking,
            chances: Chances { sheet: 0.0, base: 0.0, through: 0.0 },
            sheen: self.sheen.seen(wo),
            coat: self.coat.seen(wo),
        };
        viewed.chances = self.chances(&viewed, peaks.base * a + b);
        viewed
    }

    /// By what each part returns of a white light, the metal's facets `metal` of it.
    fn chances(&self, viewed: &LayeredView, metal: f64) -> Chances {
        let m = self.metallic;
        let dielectric = viewed.dielectric.min(1.0);
        let below = (1.0 - m) * (1.0 - dielectric) * viewed.peaks.base;
        let sheet = m * metal + (1.0 - m) * dielectric;
        let lacking = multiple(mean_reflectance(viewed.peaks.base, 0.0), viewed.mean);
        let deep = if self.alpha > 0.0 { m * lacking * (1.0 - viewed.facets) } else { 0.0 };
        let base = below * (1.0 - self.transmission) + deep;
        let through = below * self.transmission;
        let sum = sheet + base + through;
        if sum > 0.0 {
            Chances { sheet: sheet / sum, base: base / sum, through: through / sum }
        } else {
            Chances { sheet: 0.0, base: 0.0, through: 0.0 }
        }
    }

    /// Tests whether the dielectric is a smooth pane, which reflects by Fresnel.
    fn is_pane(&self) -> bool {
        self.alpha == 0.0 && self.transmission > 0.0 && fresnel::normal_reflectance(self.ior) < 1.0
    }

    /// Share of light from a direction that the dielectric returns, for A and B of its albedo.
    fn returned(&self, w: DVec3, albedo: &Albedo, terms: [f64; 2]) -> f64 {
        if !self.is_pane() {
            return albedo.of(terms);
        }
        let share = self.obliqueness(w.z.abs());
        albedo.of([1.0 - share, share])
    }

    /// Its mean over directions: ∫ 2 μ E dμ, by the midpoint rule for panes, which counts where they have a base.
    fn returned_mean(&self, albedo: &Albedo, means: [f64; 2]) -> f64 {
        const STEPS: u32 = 32;
        if !self.is_pane() || self.transmission == 1.0 {
            return albedo.of(means);
        }
        let sum = (0..STEPS).map(|step| {
            let mu = (f64::from(step) + 0.5) / f64::from(STEPS);
            2.0 * mu * self.returned(DVec3::new(0.0, 0.0, mu), albedo, means)
        });
        sum.sum::<f64>() / f64::from(STEPS)
    }

    /// Share of the dielectric's reflectance between that face on and that at grazing incidence: by Fresnel for smooth
    /// panes, else by Schlick as glTF has it.
    fn obliqueness(&self, cosine: f64) -> f64 {
        let face_on = fresnel::normal_reflectance(self.ior);
        if !self.is_pane() {
            return fresnel::schlick_weight(cosine);
        }
        let (reflected, _) = fresnel::dielectric(cosine.clamp(0.0, 1.0), self.ior);
        (reflected - face_on) / (1.0 - face_on)
    }

    /// Reflectance of the sheet for the cosine on its facets.
    fn sheet(&self, cosine: f64) -> Weights {
        let (m, w) = (self.metallic, fresnel::schlick_weight(cosine));
        let v = self.obliqueness(cosine);
        Weights {
            white: m * w + (1.0 - m) * self.f90 * v,
            base: m * (1.0 - w),
            highlight: (1.0 - m) * self.f0 * (1.0 - v),
            ..Weights::default()
        }
    }

    /// Share of light that the dielectric's facets let pass.
    fn passed(&self, cosine: f64, peaks: &Peaks) -> f64 {
        let w = self.obliqueness(cosine);
        let f0 = (self.f0 * peaks.highlight).min(1.0);
        (1.0 - (f0 * (1.0 - w) + self.f90 * w)).max(0.0)
    }

    /// Value times cosine of what is alike from all sides: the base that is seen through the sheet, per
    /// its colour, and light that met several facets of the metal.
    fn matte(&self, wi: DVec3, viewed: &LayeredView) -> Weights {
        let share = (1.0 - self.metallic) * (1.0 - self.transmission);
        let rough = self.metallic > 0.0 && self.alpha > 0.0;
        if share == 0.0 && !rough {
            return Weights::default();
        }
        let [a, b] = viewed.albedo.terms(wi);
        let dielectric = self.returned(wi, &viewed.albedo, [a, b]);
        let below = 1.0 - viewed.dielectric_mean;
        let passed = (1.0 - viewed.dielectric).max(0.0) * (1.0 - dielectric).max(0.0);
        let base = if below > 0.0 { share * passed / below * wi.z / PI } else { 0.0 };
        let metal = deep(viewed.facets, (a + b).min(1.0), viewed.lacking) * wi.z / PI;
        let deep = if rough { self.metallic * metal } else { 0.0 };
        Weights { base, deep, ..Weights::default() }
    }

    /// Value times cosine, and the density of [`Self::sample`].
    pub(super) fn evaluate(&self, wo: DVec3, wi: DVec3, viewed: &LayeredView) -> (Weights, f64) {
        let below = self.evaluate_uncoated(wo, wi, viewed);
        let below = viewed.sheen.map_or(below, |sheen| sheen.over(wo, wi, below));
        viewed.coat.map_or(below, |coat| coat.over(wo, wi, below))
    }

    fn evaluate_uncoated(&self, wo: DVec3, wi: DVec3, viewed: &LayeredView) -> (Weights, f64) {
        let LayeredView { chances, peaks, .. } = viewed;
        if wi.z < 0.0 {
            if self.transmission == 0.0 || self.alpha == 0.0 {
                return (Weights::default(), 0.0);
            }
            let (value, pdf) = self.through(wo, wi, peaks);
            return (Weights::base(value), pdf * chances.through);
        }
        let mut weights = self.matte(wi, viewed);
        let mut pdf = chances.base * wi.z / PI;
        if self.alpha > 0.0 {
            let (value, facets) = ggx::reflection(wo, wi, self.facets());
            let cosine = (wo + wi).try_normalize().map_or(0.0, |h| wo.dot(h));
            weights = weights.plus(self.sheet(cosine).times(value));
            pdf += chances.sheet * facets;
        }
        (weights, pdf)
    }

    /// Value times cosine, and density, of what comes through the wall from `wi` below: as a
    /// reflection turned to the other side (`KHR_materials_transmission`).
    fn through(&self, wo: DVec3, wi: DVec3, peaks: &Peaks) -> (f64, f64) {
        let turned = DVec3::new(wi.x, wi.y, -wi.z);
        let (value, pdf) = ggx::reflection(wo, turned, self.facets());
        let cosine = (wo + turned).try_normalize().map_or(0.0, |h| wo.dot(h));
        let share = (1.0 - self.metallic) * self.transmission;
        (share * self.passed(cosine, peaks) * value, pdf)
    }

    /// Share of light that a smooth wall, with what lies over it, lets pass straight.
    pub(super) fn straight_through(&self, wo: DVec3, peaks: &Peaks) -> Option<Weights> {
        let coat = self.coat.seen(wo).map_or(1.0, |coat| coat.passes(wo));
        let sheen = self.sheen.seen(wo).map_or(1.0, |sheen| sheen.passes(wo));
        Some(self.straight(wo, peaks)?.times(coat * sheen))
    }

    fn straight(&self, wo: DVec3, peaks: &Peaks) -> Option<Weights> {
        let share = (1.0 - self.metallic) * self.transmission;
        let passes = self.alpha == 0.0 && share > 0.0 && wo.z > 0.0;
        passes.then(|| Weights::base(share * self.passed(wo.z, peaks)))
    }

    pub(super) fn sample(
        &self,
        wo: DVec3,
        choice: f64,
        square: [f64; 2],
        viewed: &LayeredView,
    ) -> Option<LayeredSample> {
        let (sheen, coat) = (&viewed.sheen, &viewed.coat);
        if sheen.is_none() && coat.is_none() {
            return self.sample_uncoated(wo, choice, square, viewed);
        }
        let returned = coat.map_or(0.0, |coat| coat.returned);
        let fibres = (1.0 - returned) * sheen.map_or(0.0, |sheen| sheen.chance);
        // The coat, the fibres, or what is below both, which may be one direction alone.
        let wi = match (coat, sheen) {
            (Some(coat), _) if choice < returned => above(coat.sample(wo, square))?,
            (_, Some(_)) if choice < returned + fibres => above(sheen::SheenView::sample(square))?,
            _ => {
                let rest = 1.0 - returned - fibres;
                let choice = ((choice - returned - fibres) / rest).min(1.0);
                let below = self.sample_uncoated(wo, choice, square, viewed)?;
                if below.is_specular {
                    let coat = coat.map_or(1.0, |coat| coat.passes(below.wi));
                    let sheen = sheen.map_or(1.0, |sheen| sheen.passes(below.wi));
                    let weights = below.weights.times(coat * sheen / rest);
                    return Some(LayeredSample { weights, ..below });
                }
                below.wi
            }
        };
        let (value, pdf) = self.evaluate(wo, wi, viewed);
        LayeredSample::of_density(wi, value, pdf)
    }

    fn sample_uncoated(
        &self,
        wo: DVec3,
        choice: f64,
        square: [f64; 2],
        viewed: &LayeredView,
    ) -> Option<LayeredSample> {
        let LayeredView { chances, peaks, .. } = viewed;
        // The reflecting sheet, the base below it, or straight through both.
        let wi = if choice < chances.sheet {
            if self.alpha == 0.0 {
                let weights = self.sheet(wo.z).times(1.0 / chances.sheet);
                return Some(LayeredSample::specular(mirrored(wo), weights));
            }
            self.reflected(wo, square)
        } else if choice < chances.sheet + chances.base {
            cosine_direction(square)
        } else if chances.through > 0.0 {
            if self.alpha == 0.0 {
                let weights = self.straight(wo, peaks)?.times(1.0 / chances.through);
                return Some(LayeredSample::specular(-wo, weights));
            }
            let up = self.reflected(wo, square);
            DVec3::new(up.x, up.y, -up.z)
        } else {
            return None;
        };
        let below = choice >= chances.sheet + chances.base;
        if (wi.z < 0.0) != below || wi.z == 0.0 {
            return None;
        }
        // Weighed by all ways in which this direction could have been found.
        let (value, pdf) = self.evaluate_uncoated(wo, wi, viewed);
        LayeredSample::of_density(wi, value, pdf)
    }

    fn reflected(&self, wo: DVec3, square: [f64; 2]) -> DVec3 {
        let h = ggx::sample_visible(wo, square, self.facets());
        2.0 * wo.dot(h) * h - wo
    }
}

/// A direction above the surface.
fn above(wi: DVec3) -> Option<DVec3> {
    (wi.z > 0.0).then_some(wi)
}

pub(super) fn mirrored(w: DVec3) -> DVec3 {
    DVec3::new(-w.x, -w.y, w.z)
}
