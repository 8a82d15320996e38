//! A lens as it is measured for the bands of a picture: its exit pupil, itself at each wavelength with what its
//! filters pass of a band, and how bands share rays.

use etendue_optics::glass::GlassError;
use etendue_optics::train::{ExitPupil, MonochromaticTrain, OpticalTrain};
use etendue_spectrum::{Bands, Curve, Outside, Spread};

use super::displacements::Displacements;
use super::nodes::{BandWeights, NextTerm, WeightBounds, place_of};
use super::rims::RimBounds;

/// Wavelengths of a wide band at which rays near rims are looked at. More leave blocks of rays that are traced together
/// nearly empty.
const FEW: usize = 4;

/// The exit pupil measured at the wavelengths that are wanted.
#[derive(Debug)]
pub(super) struct OpenedLens {
    pub(super) bands: Bands,
    /// In the order of [`LensCamera::band_groups`].
    pub(super) groups: Vec<OpenedGroup>,
    pub(super) pupil: ExitPupil,
    /// Sharing of a ray by all bands; `None` where there is none.
    pub(super) paths: Option<BandInterpolation>,
}

/// The lens as it is for a group of bands.
#[derive(Debug)]
pub(super) struct OpenedGroup {
    /// One, or as many as share the group's light.
    pub(super) lenses: Vec<MonochromaticTrain>,
    /// A few between them, where they are many: see [`Self::near_rims`].
    few: Option<Vec<MonochromaticTrain>>,
}

/// Paths by which bands share rays.
#[derive(Debug)]
pub(super) struct BandInterpolation {
    /// The lens at its leading wavelengths, with filters clear.
    pub(super) nodes: Vec<MonochromaticTrain>,
    pub(super) weights: BandWeights,
    pub(super) bounds: WeightBounds,
    pub(super) next: NextTerm,
    /// True if glass takes light.
    pub(super) has_losses: bool,
    /// Distance from a ray's place behind the lens to the start of one that comes back (mm).
    pub(super) lead: f64,
    /// Greatest distance by which places of a ray part: rows of pixels and their size (mm).
    pub(super) reach: f64,
    pub(super) error: f64,
    /// Size of the pixels for which `next` was fitted (mm).
    pub(super) pitch: f64,
    /// Rims as rays of all wavelengths meet them; `None` where they meet them at the same places, or it is not known.
    pub(super) rims: Option<RimBounds>,
    /// Places at other nodes than that at which a ray is traced, where they need not be traced.
    pub(super) displacements: Option<Displacements>,
}

impl BandInterpolation {
    /// Width of the margin beside the film from which rays start (mm): that by which places part, and none where all
    /// bands land on one.
    pub(super) fn margin(&self) -> f64 {
        if self.nodes.len() > 1 { self.reach } else { 0.0 }
    }

    /// The lens that leading rays pass, at each of their wavelengths.
    pub(super) fn leading(&self) -> &[MonochromaticTrain] {
        self.rims.as_ref().map_or(&self.nodes, |rims| &rims.outer)
    }

    /// True if it is looked at each node whether a ray keeps away from rims by what is near it.
    pub(super) fn has_near(&self) -> bool {
        self.rims.as_ref().is_some_and(|rims| rims.near.is_some())
    }

    /// True if no wavelength loses light, neither to glass nor to a filter.
    pub(super) fn is_clear(&self) -> bool {
        !self.has_losses && self.bounds.are_unfiltered()
    }
}

impl OpenedGroup {
    /// Opens the lens for a group of bands at the wavelengths of `spread`.
    pub(super) fn open(
        train: &OpticalTrain,
        bands: &Bands,
        band: usize,
        spread: &Spread,
    ) -> Result<Self, GlassError> {
        let through = |spread: &Spread| through_filters(train, bands, band, spread);
        let few = few_of(&spread.wavelengths);
        let few = few.map(|wavelengths| through(&Spread { wavelengths, overlap: spread.overlap }));
        Ok(Self { lenses: through(spread)?, few: few.transpose()? })
    }

    /// The lenses at which rays near rims are looked at that bands share.
    pub(super) fn near_rims(&self) -> &[MonochromaticTrain] {
        self.few.as_deref().unwrap_or(&self.lenses)
    }

    /// Index of the lens for a place of the spectrum in 0..1.
    pub(super) fn lens_at(&self, u: f64) -> usize {
        place_of(u, self.lenses.len())
    }
}

/// The means of [`FEW`] equal shares of wavelengths that stand for as much light each; `None` if they are no more.
fn few_of(wavelengths: &[f64]) -> Option<Vec<f64>> {
    if wavelengths.len() <= FEW {
        return None;
    }
    let share = wavelengths.len() as f64 / FEW as f64;
    let mean = |part: usize| {
        let [from, to] = [part, part + 1].map(|end| end as f64 * share);
        let within = |i: usize| ((i + 1) as f64).min(to) - (i as f64).max(from);
        let parts = wavelengths.iter().enumerate().map(|(i, nm)| within(i).max(0.0) * nm);
        parts.sum::<f64>() / share
    };
    Some((0..FEW).map(mean).collect())
}

/// Curves of filters that are the same all over and pass some wavelengths better than others.
pub(super) fn uniform_filters(train: &OpticalTrain) -> Vec<&Curve> {
    let filters = train.elements().iter().filter_map(|element| element.part.uniform_curve());
    filters.filter(|curve| curve.as_flat().is_none()).collect()
}

/// The lens at each of a band's wavelengths, with filters that pass what they pass of the band.
///
/// The wavelengths are already those that uniform filters leave, so these pass their mean over the
/// band, all of them together the mean of their product. What a picture of filters passes differs
/// from wavelength to wavelength, about the same mean.
fn through_filters(
    train: &OpticalTrain,
    bands: &Bands,
    band: usize,
    spread: &Spread,
) -> Result<Vec<MonochromaticTrain>, GlassError> {
    let uniform = uniform_filters(train);
    let passes = |curve: &Curve, nm| passed(bands, band, spread, &uniform, curve, nm);
    let lens = |&nm: &f64| train.at_with(nm, &|curve| passes(curve, nm));
    spread.wavelengths.iter().map(lens).collect()
}

/// Transmission of a band, at each of its wavelengths, by all filters together that are the same all over.
pub(super) fn filtered(
    train: &OpticalTrain,
    bands: &Bands,
    band: usize,
    spread: &Spread,
) -> Vec<f64> {
    let uniform = uniform_filters(train);
    let all = || train.elements().iter().filter_map(|element| element.part.uniform_curve());
    let passes = |curve, nm| passed(bands, band, spread, &uniform, curve, nm);
    spread.wavelengths.iter().map(|&nm| all().map(|curve| passes(curve, nm)).product()).collect()
}

/// Transmission of a filter's curve for a band at one of its wavelengths (nm): see [`through_filters`].
fn passed(
    bands: &Bands,
    band: usize,
    spread: &Spread,
    uniform: &[&Curve],
    curve: &Curve,
    nm: f64,
) -> f64 {
    let Spread { wavelengths, overlap } = spread;
    let mean = bands.from_curve(curve, Outside::Held).map_or(0.0, |means| means[band]);
    if uniform.contains(&curve) {
        return mean * overlap.powf(1.0 / uniform.len().max(1) as f64);
    }
    let all: f64 = wavelengths.iter().map(|&nm| curve.held(nm)).sum();
    let share = curve.held(nm) * wavelengths.len() as f64 / all;
    if all > 0.0 { mean * share } else { mean }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four whose mean is that of all, where there are more.
    #[test]
    fn few_wavelengths_stand_for_as_much_light_each() {
        assert_eq!(few_of(&[500.0, 520.0]), None);
        let of_eight = few_of(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]).unwrap();
        assert_eq!(of_eight, [1.5, 3.5, 5.5, 7.5]);
        let of_five = few_of(&[0.0, 5.0, 10.0, 15.0, 20.0]).unwrap();
        let expected = [1.0, 7.0, 13.0, 19.0];
        assert!(of_five.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{of_five:?}");
    }
}
