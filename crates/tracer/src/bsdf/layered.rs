//! glTF's metallic-roughness model as one that can be traced: reciprocal, and never brighter than
//! what falls in.
//!
//! The Khronos Group, *glTF 2.0 Specification*, appendix B, mixes a metal and a dielectric by
//! `metallic`; the dielectric is a GGX sheet over a matte base. The specification weighs the base by
//! `1 − F(h)`, which returns more than falls in at grazing angles; here the base gets what the sheet
//! leaves on both ways ([`super::albedo`]). `KHR_materials_specular` and `_ior` set the sheet's
//! reflectances, `KHR_materials_transmission` lets a share of the base through a thin wall.

use std::f64::consts::PI;

use etendue_geometry::glam::DVec3;

use super::albedo::Albedo;
use super::{Weights, fresnel, ggx, mirrored};
use crate::sampling::cosine_direction;

/// The numbers of the model at one hit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Layered {
    /// Share of metal, 0..=1.
    pub metallic: f64,
    /// The square of the roughness, 0..=1; at 0 the sheet is a mirror.
    pub alpha: f64,
    /// The dielectric's reflectance face on, before the highlights' colour.
    pub f0: f64,
    /// Its reflectance at grazing incidence (`specularFactor`).
    pub f90: f64,
    /// Share of the base that is a hole in a thin wall, 0..=1.
    pub transmission: f64,
}

/// The largest bands of a surface's colours.
#[derive(Debug, Clone, Copy)]
pub(super) struct Peaks {
    pub(super) base: f64,
    pub(super) highlight: f64,
}

/// A sampled direction in the shading frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Found {
    pub(super) wi: DVec3,
    pub(super) weights: Weights,
    pub(super) pdf: f64,
}

/// Probabilities of the three parts as seen from one direction.
#[derive(Debug, Clone, Copy)]
struct Chances {
    sheet: f64,
    base: f64,
    through: f64,
}

impl Layered {
    pub(super) fn is_delta(&self) -> bool {
        let matte = (1.0 - self.metallic) * (1.0 - self.transmission);
        self.alpha == 0.0 && matte == 0.0
    }

    fn albedo(&self, peaks: &Peaks) -> Albedo {
        Albedo::new(self.alpha, (self.f0 * peaks.highlight).min(1.0), self.f90)
    }

    fn chances(&self, wo: DVec3, peaks: &Peaks) -> Chances {
        let m = self.metallic;
        let dielectric = self.albedo(peaks).at(wo.z).min(1.0);
        let metal = Albedo::new(self.alpha, peaks.base, 1.0).at(wo.z);
        let below = (1.0 - m) * (1.0 - dielectric) * peaks.base;
        let sheet = m * metal + (1.0 - m) * dielectric;
        let (base, through) = (below * (1.0 - self.transmission), below * self.transmission);
        let sum = sheet + base + through;
        if sum > 0.0 {
            Chances { sheet: sheet / sum, base: base / sum, through: through / sum }
        } else {
            Chances { sheet: 0.0, base: 0.0, through: 0.0 }
        }
    }

    /// Reflectance of the sheet for the cosine on its facets.
    fn sheet(&self, cosine: f64) -> Weights {
        let (m, w) = (self.metallic, fresnel::schlick_weight(cosine));
        Weights {
            white: m * w + (1.0 - m) * self.f90 * w,
            base: m * (1.0 - w),
            highlight: (1.0 - m) * self.f0 * (1.0 - w),
        }
    }

    /// What the dielectric's facets let pass.
    fn passed(&self, cosine: f64, peaks: &Peaks) -> f64 {
        let w = fresnel::schlick_weight(cosine);
        let f0 = (self.f0 * peaks.highlight).min(1.0);
        (1.0 - (f0 * (1.0 - w) + self.f90 * w)).max(0.0)
    }

    /// Value times cosine of the base that is seen through the sheet, per its colour.
    fn matte(&self, wo: DVec3, wi: DVec3, peaks: &Peaks) -> f64 {
        let share = (1.0 - self.metallic) * (1.0 - self.transmission);
        if share == 0.0 {
            return 0.0;
        }
        let albedo = self.albedo(peaks);
        let below = 1.0 - albedo.mean();
        if below <= 0.0 {
            return 0.0;
        }
        let seen = (1.0 - albedo.at(wo.z)).max(0.0) * (1.0 - albedo.at(wi.z)).max(0.0);
        share * seen / below * wi.z / PI
    }

    pub(super) fn evaluate(&self, wo: DVec3, wi: DVec3, peaks: &Peaks) -> (Weights, f64) {
        let chances = self.chances(wo, peaks);
        if wi.z < 0.0 {
            if self.transmission == 0.0 || self.alpha == 0.0 {
                return (Weights::default(), 0.0);
            }
            let (value, pdf) = self.through(wo, wi, peaks);
            return (Weights::base(value), pdf * chances.through);
        }
        let mut weights = Weights::base(self.matte(wo, wi, peaks));
        let mut pdf = chances.base * wi.z / PI;
        if self.alpha > 0.0 {
            let (value, facets) = ggx::reflection(wo, wi, self.alpha);
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
        let (value, pdf) = ggx::reflection(wo, turned, self.alpha);
        let cosine = (wo + turned).try_normalize().map_or(0.0, |h| wo.dot(h));
        let share = (1.0 - self.metallic) * self.transmission;
        (share * self.passed(cosine, peaks) * value, pdf)
    }

    /// What a smooth wall lets pass straight.
    pub(super) fn straight_through(&self, wo: DVec3, peaks: &Peaks) -> Option<Weights> {
        let share = (1.0 - self.metallic) * self.transmission;
        let passes = self.alpha == 0.0 && share > 0.0 && wo.z > 0.0;
        passes.then(|| Weights::base(share * self.passed(wo.z, peaks)))
    }

    pub(super) fn sample(
        &self,
        wo: DVec3,
        choice: f64,
        square: [f64; 2],
        peaks: &Peaks,
    ) -> Option<Found> {
        let chances = self.chances(wo, peaks);
        let wi = if choice < chances.sheet {
            if self.alpha == 0.0 {
                let weights = self.sheet(wo.z).times(1.0 / chances.sheet);
                return Some(Found { wi: mirrored(wo), weights, pdf: f64::INFINITY });
            }
            self.reflected(wo, square)
        } else if choice < chances.sheet + chances.base {
            cosine_direction(square)
        } else if chances.through > 0.0 {
            if self.alpha == 0.0 {
                let weights = self.straight_through(wo, peaks)?.times(1.0 / chances.through);
                return Some(Found { wi: -wo, weights, pdf: f64::INFINITY });
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
        let (weights, pdf) = self.evaluate(wo, wi, peaks);
        (pdf > 0.0).then(|| Found { wi, weights: weights.times(1.0 / pdf), pdf })
    }

    fn reflected(&self, wo: DVec3, square: [f64; 2]) -> DVec3 {
        let h = ggx::sample_visible(wo, square, self.alpha);
        2.0 * wo.dot(h) * h - wo
    }
}
