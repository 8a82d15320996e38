//! Models of the scattering of light by surfaces: each as a function to evaluate, to sample, and the density of
//! the sampling.
//!
//! Every model's value is a sum of a few colours, white, the surface's own, that of its highlights and
//! that of light that met several facets, times plain numbers ([`Weights`]). So directions, Fresnel terms and facets are worked out once a
//! hit, whatever the number of bands, and a band costs two multiplications.
//!
//! Directions point away from the surface; `wo` is where the light goes (to the viewer), `wi` where it
//! comes from. Reflection and transmission are told apart by the geometric normal, lengths are
//! measured with the shading normal (Veach 1997, section 5.3).

pub mod albedo;
mod boundary;
mod brushed;
mod coat;
pub mod fresnel;
pub mod ggx;
mod layered;
mod losses;
pub(crate) mod metal;
mod sheen;
pub(crate) mod sheets;
pub(crate) mod smooth;
mod split_sum;
mod weights;

use etendue_geometry::glam::DVec3;

use self::layered::mirrored;
use crate::sampling::Frame;
use crate::{ConductorId, Tint};
pub use coat::Coat;
pub use layered::Layered;
pub use metal::SECOND_COSINE;
pub use sheen::Sheen;
pub use weights::Weights;

/// The models.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Model {
    /// GGX facets of metal: the colour face on, white at grazing incidence (Schlick).
    Metal {
        /// The square of the roughness, 0..=1; at 0 a mirror.
        alpha: f64,
        /// Its reflectance by its measured index, in place of the colour.
        named: Option<ConductorId>,
    },
    /// A boundary of glass.
    Dielectric {
        /// The square of the roughness, 0..=1; at 0 smooth.
        alpha: f64,
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
    pub base: Tint,
    /// The colour of its highlights.
    pub highlight: Tint,
    /// Part of the model that follows from the viewer's direction alone.
    seen: ModelView,
}

/// Part of a model that follows from the viewer's direction alone.
#[derive(Debug, Clone, Copy)]
enum ModelView {
    Plain,
    Metal(metal::RoughMetal),
    Glass(boundary::RoughBoundary),
    Layered(layered::LayeredView),
}

/// A direction that light comes from, chosen in proportion to what it contributes.
#[derive(Debug, Clone, Copy)]
pub struct BsdfSample {
    /// Direction that light comes from (unit, world).
    pub direction: DVec3,
    /// Value times cosine over density.
    pub weights: Weights,
    /// Density per solid angle (1/sr); `+inf` of a specular event.
    pub pdf: f64,
    /// True if the event is specular: only this model can give the direction.
    pub is_specular: bool,
}

impl Bsdf {
    /// A surface with `model`, looked at along −`wo`; the normals are on the side of `wo`.
    #[must_use]
    pub fn new(
        model: Model,
        [geometric, shading]: [DVec3; 2],
        wo: DVec3,
        colors: [impl Into<Tint>; 2],
    ) -> Self {
        Self::turned(model, geometric, Frame::around(shading), wo, colors.map(Into::into))
    }

    /// As [`Self::new`], with a frame around the shading normal whose x axis goes along the surface's grain.
    pub(crate) fn turned(
        model: Model,
        geometric: DVec3,
        frame: Frame,
        wo: DVec3,
        [base, highlight]: [Tint; 2],
    ) -> Self {
        let local = frame.local(wo);
        let seen = match model {
            Model::Metal { alpha, .. } if alpha > 0.0 => {
                ModelView::Metal(metal::RoughMetal::new(alpha, local))
            }
            Model::Dielectric { alpha, eta } if alpha > 0.0 => {
                ModelView::Glass(boundary::RoughBoundary::new(alpha, eta, local))
            }
            Model::Layered(layered) => {
                ModelView::Layered(layered.viewed(local, &peaks([&base, &highlight])))
            }
            Model::Metal { .. } | Model::Dielectric { .. } => ModelView::Plain,
        };
        Self { model, frame, geometric, wo: local, base, highlight, seen }
    }

    /// The metal by whose measured index it reflects.
    pub(crate) fn named(&self) -> Option<ConductorId> {
        match self.model {
            Model::Metal { named, .. } => named,
            Model::Dielectric { .. } | Model::Layered(_) => None,
        }
    }

    /// The share of light that facets of reflectance 1 return at once, over all directions.
    pub(crate) fn mean_albedo(&self) -> f64 {
        match self.seen {
            ModelView::Plain | ModelView::Glass(_) => 1.0,
            ModelView::Metal(rough) => rough.mean,
            ModelView::Layered(viewed) => viewed.mean,
        }
    }

    /// The colour of its sheen.
    pub(crate) fn sheen(&self) -> Tint {
        match self.model {
            Model::Layered(layered) => layered.sheen.color,
            Model::Metal { .. } | Model::Dielectric { .. } => Tint::BLACK,
        }
    }

    /// Tests whether light of one direction only can be scattered to `wo` (no light can be aimed at).
    #[must_use]
    pub fn is_delta(&self) -> bool {
        match self.model {
            Model::Metal { alpha, .. } | Model::Dielectric { alpha, .. } => alpha == 0.0,
            Model::Layered(layered) => layered.is_delta(),
        }
    }

    /// The shading normal of the one side that light comes from; zero where it comes from both.
    pub(crate) fn receiving_normal(&self) -> DVec3 {
        let is_one_sided = match self.model {
            Model::Metal { .. } => true,
            Model::Dielectric { .. } => false,
            Model::Layered(layered) => layered.transmission == 0.0,
        };
        if is_one_sided { self.frame.z } else { DVec3::ZERO }
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
        match (&self.model, &self.seen) {
            (Model::Layered(layered), ModelView::Layered(viewed)) => {
                layered.evaluate(self.wo, local, viewed)
            }
            (_, ModelView::Glass(rough)) => rough.evaluate(self.wo, local),
            (_, ModelView::Metal(rough)) if !transmits => rough.evaluate(self.wo, local),
            // All of their directions are single rays, or on the other side.
            (
                Model::Metal { .. } | Model::Dielectric { .. } | Model::Layered(_),
                ModelView::Plain | ModelView::Metal(_) | ModelView::Layered(_),
            ) => (Weights::default(), 0.0),
        }
    }

    /// A direction by `square`, after `choice` (both in 0..1) has picked among the model's parts;
    /// `None` when the light is lost.
    #[must_use]
    pub fn sample(&self, choice: f64, square: [f64; 2]) -> Option<BsdfSample> {
        if self.wo.z <= 0.0 {
            return None;
        }
        match &self.model {
            Model::Metal { .. } => {
                let ModelView::Metal(rough) = &self.seen else {
                    return self.single(mirrored(self.wo), metal::facets(self.wo.z));
                };
                self.sampled(rough.sample(self.wo, choice, square))
            }
            Model::Dielectric { eta, .. } => {
                let ModelView::Glass(rough) = &self.seen else {
                    return self.boundary(*eta, choice);
                };
                self.sampled(rough.sample(self.wo, choice, square)?)
            }
            Model::Layered(layered) => {
                let ModelView::Layered(viewed) = &self.seen else { return None };
                let found = layered.sample(self.wo, choice, square, viewed)?;
                if found.is_specular {
                    self.single(found.wi, found.weights)
                } else {
                    self.given(found.wi, found.weights, found.pdf)
                }
            }
        }
    }

    /// A sampled direction with what [`Self::evaluate`] says of it.
    fn sampled(&self, local: DVec3) -> Option<BsdfSample> {
        let (value, pdf) = match &self.seen {
            ModelView::Metal(rough) if local.z > 0.0 => rough.evaluate(self.wo, local),
            ModelView::Glass(rough) => rough.evaluate(self.wo, local),
            ModelView::Plain | ModelView::Metal(_) | ModelView::Layered(_) => return None,
        };
        if pdf <= 0.0 {
            return None;
        }
        self.given(local, value.times(1.0 / pdf), pdf)
    }

    /// Light that passes a smooth pane without thickness straight on, over what arrives; `None` for all other surfaces.
    #[must_use]
    pub fn straight_through(&self) -> Option<Weights> {
        let Model::Layered(layered) = &self.model else { return None };
        layered.straight_through(self.wo, &peaks([&self.base, &self.highlight]))
    }

    /// Reflects or refracts by Snell and Fresnel.
    fn boundary(&self, eta: f64, choice: f64) -> Option<BsdfSample> {
        if choice < self.reflectance(eta) { self.mirrored() } else { self.refracted(eta) }
    }

    /// Share of light that a smooth boundary of relative index `eta` reflects to `wo`.
    pub(crate) fn reflectance(&self, eta: f64) -> f64 {
        fresnel::dielectric(self.wo.z, eta).0
    }

    /// The mirrored direction, at weight 1.
    pub(crate) fn mirrored(&self) -> Option<BsdfSample> {
        self.single(mirrored(self.wo), Weights::white(1.0))
    }

    /// The refracted direction behind a smooth boundary of relative index `eta`; `None` under total
    /// reflection. Radiance is compressed by the square of the index (Veach 1997, section 5.2.2).
    pub(crate) fn refracted(&self, eta: f64) -> Option<BsdfSample> {
        let cos_out = fresnel::dielectric(self.wo.z, eta).1?;
        let wi = DVec3::new(-self.wo.x / eta, -self.wo.y / eta, -cos_out);
        self.single(wi, Weights::base(1.0 / (eta * eta)))
    }

    fn given(&self, local: DVec3, weights: Weights, pdf: f64) -> Option<BsdfSample> {
        let direction = self.frame.world(local).try_normalize()?;
        // The shading normal may lean a reflection through the surface.
        let transmits = direction.dot(self.geometric) < 0.0;
        if transmits != (local.z < 0.0) || pdf <= 0.0 || weights.is_zero() {
            return None;
        }
        Some(BsdfSample { direction, weights, pdf, is_specular: false })
    }

    fn single(&self, local: DVec3, weights: Weights) -> Option<BsdfSample> {
        let sample = self.given(local, weights, f64::INFINITY)?;
        Some(BsdfSample { is_specular: true, ..sample })
    }
}

/// The largest bands of the two colours, for choosing among parts.
fn peaks(colors: [&Tint; 2]) -> layered::Peaks {
    let [base, highlight] = colors.map(Tint::peak);
    layered::Peaks { base, highlight }
}

#[cfg(test)]
mod tests;
