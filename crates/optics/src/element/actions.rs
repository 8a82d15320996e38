//! Effect of a part on light: its power, and its actions on light of either side.

use std::sync::Arc;

use etendue_spectrum::Curve;

use super::crossings::Slopes;
use super::freeform::{Freeform, FreeformSurface};
use super::lenslets::Lenslets;
use super::mirror::Mirror;
use super::part::Part;
use super::refract::IndexPair;
use super::refraction::Refraction;
use super::step::Action;

impl Part {
    /// The paraxial power (1/mm) between media of index `before` and `behind` at a wavelength (nm). An array of lenslets has
    /// none: what is paraxial is the picture that the lens before it makes, which its lenslets sample.
    pub(crate) fn power(&self, before: f64, behind: f64, wavelength: f64) -> f64 {
        match self {
            Self::Surface(surface) => (behind - before) * surface.paraxial_curvature(),
            // As drawings and tables, it sees the section along y.
            Self::Biconic(surface) => (behind - before) * surface.curvature[1],
            Self::ThinLens(lens) => before * lens.power,
            Self::Mirror(mirror) => -(before + behind) * mirror.surface.paraxial_curvature(),
            Self::Freeform(surface) => {
                let change = match surface.mirror {
                    Some(_) => -(before + behind),
                    None => behind - before,
                };
                change * surface.paraxial_curvature() + surface.phase_power(wavelength)
            }
            Self::Aperture(_)
            | Self::Filter(_)
            | Self::MicrolensArray(_)
            | Self::CoordinateBreak(_) => 0.0,
        }
    }

    /// Returns the part as seen by light that runs against the axis, as it does behind an odd
    /// number of mirrors.
    #[must_use]
    pub fn flipped(self) -> Self {
        match self {
            Self::Surface(surface) => Self::Surface(surface.flipped()),
            Self::Biconic(surface) => Self::Biconic(surface.flipped()),
            Self::Mirror(mirror) => {
                Self::Mirror(Mirror { surface: mirror.surface.flipped(), ..mirror })
            }
            Self::MicrolensArray(array) => Self::MicrolensArray(array.flipped().into()),
            Self::Freeform(surface) => Self::Freeform(surface.flipped().into()),
            // A break is made by the way of light.
            Self::ThinLens(_) | Self::Aperture(_) | Self::Filter(_) | Self::CoordinateBreak(_) => {
                self
            }
        }
    }

    /// Actions on light of a wavelength (nm) from the object, and on light traced from the sensor.
    /// `transmission` gives the share that a filter's curve passes.
    pub(crate) fn actions(
        &self,
        before: f64,
        behind: f64,
        wavelength: f64,
        transmission: &dyn Fn(&Curve) -> f64,
    ) -> [Action; 2] {
        let both = |action: Action| [action.clone(), action];
        // From the object's side, and from the sensor's.
        match self {
            Self::Surface(surface) => [
                Action::refract(Refraction::new(surface.clone(), before, behind)),
                Action::refract(Refraction::new(surface.clone(), behind, before)),
            ],
            Self::Biconic(surface) => {
                [[before, behind], [behind, before]].map(|[before, behind]| {
                    let (surface, media) = (surface.clone(), IndexPair::new(before, behind));
                    let slopes = Slopes::of_biconic(&surface);
                    Action::Biconic { surface, media, slopes }
                })
            }
            Self::Mirror(mirror) => [
                Action::refract(Refraction::mirror(mirror.surface.clone())),
                Action::refract(Refraction::mirror(mirror.surface.flipped())),
            ],
            Self::Freeform(surface) => {
                let is_mirror = surface.mirror.is_some();
                let action = |shape: Arc<Freeform>, before, behind| Action::Freeform {
                    efficiency: shape.efficiency(wavelength),
                    surface: FreeformSurface::new(shape, behind, wavelength),
                    media: if is_mirror {
                        IndexPair::MIRROR
                    } else {
                        IndexPair::new(before, behind)
                    },
                };
                let from_behind = match is_mirror {
                    true => Arc::new(surface.flipped()),
                    false => Arc::clone(surface),
                };
                [action(Arc::clone(surface), before, behind), action(from_behind, behind, before)]
            }
            Self::ThinLens(lens) => [lens.power, -lens.power]
                .map(|power| Action::ThinLens { power, semi_diameter: lens.semi_diameter }),
            Self::CoordinateBreak(turn) => [Action::Turn(*turn), Action::Turn(turn.reversed())],
            Self::Aperture(opening) => both(Action::Opening(Arc::clone(opening))),
            Self::Filter(filter) => {
                let transmissions = filter.curves.iter().map(transmission).collect();
                both(Action::Filter { filter: Arc::clone(filter), transmissions })
            }
            Self::MicrolensArray(array) => {
                let passes: Vec<f64> = array.curves.iter().map(transmission).collect();
                [
                    Action::Lenslets(Lenslets::new(array, [before, behind], 1.0, passes.clone())),
                    Action::Lenslets(Lenslets::new(array, [behind, before], -1.0, passes)),
                ]
            }
        }
    }
}
