//! A lens with parts of it made clear, or with other rims: what its bounds do not depend on.

use std::sync::Arc;

use crate::element::{LossesSpec, Opening};
use crate::train::{OpticalTrain, Part};

/// Returns the lens with its masks clear: the bound goes around their whole rectangle.
pub(super) fn without_masks(train: &OpticalTrain) -> OpticalTrain {
    let mut train = train.clone();
    for element in &mut train.elements {
        if let Part::Aperture(opening) = &element.part
            && let Opening::Image(picture) = &**opening
        {
            element.part = Part::Aperture(Opening::Image(picture.blank()).into());
        }
    }
    train
}

impl OpticalTrain {
    /// The lens with a rim of each element that is wider by so much (mm; narrower for less than 0), and all else as it is;
    /// `None` where rays are ended by more than a circle or a polygon about an element's axis: at masks, obscurations,
    /// mirrors, arrays and freeforms, and in graded media.
    #[must_use]
    pub fn with_wider_rims(&self, by: &[f64]) -> Option<Self> {
        if self.gradients.iter().any(Option::is_some) {
            return None;
        }
        let mut train = self.clone();
        for (i, element) in train.elements.iter_mut().enumerate() {
            element.part = element.part.with_wider_rim(*by.get(i)?)?;
        }
        Some(train)
    }

    /// The first mask that lets nothing through.
    #[must_use]
    pub fn closed_mask(&self) -> Option<usize> {
        self.elements.iter().position(|element| match element.part.opening() {
            Some(Opening::Image(mask)) => mask.values.iter().all(|value| *value <= 0.0),
            Some(Opening::Circle { .. } | Opening::Polygon { .. } | Opening::Shaped(_)) | None => {
                false
            }
        })
    }
}

/// Returns the lens with filters cleared and mirrors that reflect all wavelengths alike: what is
/// left does not depend on the wavelength but for glass, coatings and orders of diffraction.
pub fn without_filters(train: &OpticalTrain) -> OpticalTrain {
    let mut train = train.clone();
    for element in &mut train.elements {
        if let Part::MicrolensArray(array) = &element.part {
            element.part = Part::MicrolensArray(array.without_filters());
        }
        if let Part::Filter(filter) = &element.part {
            let opening = Opening::Circle { radius: filter.radius() };
            element.part = Part::Aperture(opening.into());
        }
        element.part = element.part.with_mirror(|mirror| mirror.reflectance = None);
    }
    train
}

/// Returns the lens with masks and filters clear, and nothing lost in glass, at mirrors or to other
/// orders of diffraction.
pub fn without_dimming(train: &OpticalTrain) -> OpticalTrain {
    let mut train = without_filters(&without_masks(train)).with_losses(LossesSpec::default());
    for element in &mut train.elements {
        if let Part::Freeform(surface) = &mut element.part {
            Arc::make_mut(surface).lose_no_light();
        }
        element.part = element.part.with_mirror(|mirror| mirror.coating = None);
    }
    train
}
