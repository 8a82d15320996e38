//! How a surface scatters light: each model as a function to evaluate, to sample, and the density of
//! the sampling.
//!
//! Every model's value is a sum of three colours, white, the surface's own and that of its highlights,
//! times plain numbers ([`Weights`]). So directions, Fresnel terms and facets are worked out once a
//! hit, whatever the number of bands, and a band costs two multiplications.
//!
//! Directions point away from the surface; `wo` is where the light goes (to the viewer), `wi` where it
//! comes from. Reflection and transmission are told apart by the geometric normal, lengths are
//! measured with the shading normal (Veach 1997, section 5.3).

pub mod albedo;
pub mod fresnel;
pub mod ggx;
mod layered;

use std::f64::consts::PI;

use etendue_geometry::glam::DVec3;

use crate::Color;
use crate::sampling::{Frame, cosine_direction};
pub use layered::Layered;

/// A value as multiples of white, the surface's colour and its highlights' colour.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Weights {
    /// Of white.
    pub white: f64,
    /// Of the surface's colour.
    pub base: f64,
    /// Of the highlights' colour.
    pub highlight: f64,
}

impl Weights {
    /// That many times white.
    #[must_use]
    pub fn white(white: f64) -> Self {
        Self { white, ..Self::default() }
    }

    /// That many times the surface's colour.
    #[must_use]
    pub fn base(base: f64) -> Self {
        Self { base, ..Self::default() }
    }

    /// Whether nothing is left.
    #[must_use]
    pub fn is_zero(&self) -> bool {
        *self == Self::default()
    }

    fn plus(self, other: Self) -> Self {
        Self {
            white: self.white + other.white,
            base: self.base + other.base,
            highlight: self.highlight + other.highlight,
        }
    }

    fn times(self, factor: f64) -> Self {
        Self {
            white: self.white * factor,
            base: self.base * factor,
            highlight: self.highlight * factor,
        }
    }
}

/// The models.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Model {
    /// Nothing comes back.
    Black,
    /// Lambert.
    Matte,
    /// All in the mirror's direction.
    Mirror,
    /// GGX facets of metal: the colour face on, white at grazing incidence (Schlick).
    Metal {
        /// The square of the roughness, 0..=1; at 0 a mirror.
        alpha: f64,
    },
    /// A smooth boundary of glass.
    Dielectric {
        /// Index behind the surface over the index in front, as seen from `wo`.
        eta: f64,
    },
    /// A rough or smooth sheet over a matte, metallic or transmitting base: glTF's model.
    Layered(Layered),
}

/// A surface at one hit, seen from `wo`.
#[derive(Debug, Clone, Copy)]
pub struct Bsdf {
    model: Model,
    frame: Frame,
    geometric: DVec3,
    wo: DVec3,
    /// The surface's colour.
    pub base: Color,
    /// The colour of its highlights.
    pub highlight: Color,
}

/// A direction that light comes from, chosen in proportion to what it contributes.
#[derive(Debug, Clone, Copy)]
pub struct BsdfSample {
    /// Where from (unit, world).
    pub direction: DVec3,
    /// Value times cosine over density.
    pub weights: Weights,
    /// Density per solid angle (1/sr); `+inf` for a direction that only this model can give.
    pub pdf: f64,
}

impl Bsdf {
    /// A surface with `model`, looked at along −`wo`; the normals are on the side of `wo`.
    #[must_use]
    pub fn new(
        model: Model,
        [geometric, shading]: [DVec3; 2],
        wo: DVec3,
        [base, highlight]: [Color; 2],
    ) -> Self {
        let frame = Frame::around(shading);
        Self { model, frame, geometric, wo: frame.local(wo), base, highlight }
    }

    /// Whether light of one direction only can be scattered to `wo` (no light can be aimed at).
    #[must_use]
    pub fn is_delta(&self) -> bool {
        match self.model {
            Model::Black | Model::Mirror | Model::Dielectric { .. } => true,
            Model::Metal { alpha } => alpha == 0.0,
            Model::Layered(layered) => layered.is_delta(),
            Model::Matte => false,
        }
    }

    /// Whether [`Self::sample`] may give a direction that only this model can give.
    #[must_use]
    pub fn has_single(&self) -> bool {
        self.is_delta() || matches!(self.model, Model::Layered(_))
    }

    /// Value times cosine for light from `wi`, and the density (1/sr) with which [`Self::sample`]
    /// gives that direction. Directions of single rays are not among them.
    #[must_use]
    pub fn evaluate(&self, wi: DVec3) -> (Weights, f64) {
        let local = self.frame.local(wi);
        let transmits = wi.dot(self.geometric) < 0.0;
        if transmits != (local.z < 0.0) || local.z == 0.0 || self.wo.z <= 0.0 {
            return (Weights::default(), 0.0);
        }
        let black = (Weights::default(), 0.0);
        match self.model {
            Model::Layered(layered) => layered.evaluate(self.wo, local, &self.peaks()),
            Model::Matte | Model::Metal { .. } if transmits => black,
            Model::Matte => (Weights::base(local.z / PI), local.z / PI),
            // All of their directions are single rays.
            Model::Black
            | Model::Mirror
            | Model::Metal { alpha: 0.0 }
            | Model::Dielectric { .. } => black,
            Model::Metal { alpha } => {
                let (value, pdf) = ggx::reflection(self.wo, local, alpha);
                (metal(self.wo, local).times(value), pdf)
            }
        }
    }

    /// A direction by `square`, after `choice` (both in 0..1) has picked among the model's parts;
    /// `None` when the light is lost.
    #[must_use]
    pub fn sample(&self, choice: f64, square: [f64; 2]) -> Option<BsdfSample> {
        if self.wo.z <= 0.0 {
            return None;
        }
        match self.model {
            Model::Black => None,
            Model::Matte => {
                let local = cosine_direction(square);
                self.given(local, Weights::base(1.0), local.z / PI)
            }
            Model::Mirror => self.single(mirrored(self.wo), Weights::base(1.0)),
            Model::Metal { alpha: 0.0 } => {
                let wi = mirrored(self.wo);
                self.single(wi, metal(self.wo, wi))
            }
            Model::Metal { alpha } => {
                let h = ggx::sample_visible(self.wo, square, alpha);
                let wi = 2.0 * self.wo.dot(h) * h - self.wo;
                let (value, pdf) = ggx::reflection(self.wo, wi, alpha);
                if pdf <= 0.0 {
                    return None;
                }
                self.given(wi, metal(self.wo, wi).times(value / pdf), pdf)
            }
            Model::Dielectric { eta } => self.boundary(eta, choice),
            Model::Layered(layered) => {
                let found = layered.sample(self.wo, choice, square, &self.peaks())?;
                if found.pdf == f64::INFINITY {
                    self.single(found.wi, found.weights)
                } else {
                    self.given(found.wi, found.weights, found.pdf)
                }
            }
        }
    }

    /// What passes a smooth pane without thickness straight on, over what arrives; `None` for all other
    /// surfaces.
    #[must_use]
    pub fn straight_through(&self) -> Option<Weights> {
        let Model::Layered(layered) = &self.model else { return None };
        layered.straight_through(self.wo, &self.peaks())
    }

    /// Reflects or refracts by Snell and Fresnel. Radiance is compressed by the square of the index
    /// (Veach 1997, section 5.2.2).
    fn boundary(&self, eta: f64, choice: f64) -> Option<BsdfSample> {
        let (reflectance, cos_out) = fresnel::dielectric(self.wo.z, eta);
        match cos_out {
            Some(cos_out) if choice >= reflectance => {
                let wi = DVec3::new(-self.wo.x / eta, -self.wo.y / eta, -cos_out);
                self.single(wi, Weights::base(1.0 / (eta * eta)))
            }
            _ => self.single(mirrored(self.wo), Weights::white(1.0)),
        }
    }

    /// The largest bands of the two colours, for choosing among parts.
    fn peaks(&self) -> layered::Peaks {
        let peak = |c: &Color| c[0].max(c[1]).max(c[2]);
        layered::Peaks { base: peak(&self.base), highlight: peak(&self.highlight) }
    }

    fn given(&self, local: DVec3, weights: Weights, pdf: f64) -> Option<BsdfSample> {
        let direction = self.frame.world(local).try_normalize()?;
        // The shading normal may lean a reflection through the surface.
        let transmits = direction.dot(self.geometric) < 0.0;
        if transmits != (local.z < 0.0) || pdf <= 0.0 || weights.is_zero() {
            return None;
        }
        Some(BsdfSample { direction, weights, pdf })
    }

    fn single(&self, local: DVec3, weights: Weights) -> Option<BsdfSample> {
        self.given(local, weights, f64::INFINITY)
    }
}

fn mirrored(w: DVec3) -> DVec3 {
    DVec3::new(-w.x, -w.y, w.z)
}

/// Schlick's reflectance of a metal of the surface's colour.
fn metal(wo: DVec3, wi: DVec3) -> Weights {
    let cosine = (wo + wi).try_normalize().map_or(0.0, |h| wo.dot(h));
    let w = fresnel::schlick_weight(cosine);
    Weights { white: w, base: 1.0 - w, highlight: 0.0 }
}

#[cfg(test)]
mod tests;
