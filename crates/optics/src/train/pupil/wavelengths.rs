//! Choice of the wavelengths that outlines are measured at and checked at.
//!
//! The rims of a lens, as they are seen from the sensor, move over the spectrum as its glasses' indices do: nearly in
//! proportion to 1/λ² (A.-L. Cauchy, 1836), so that what passes at any wavelength lies between what passes at a few. A
//! bound around these is held against random rays of all others, and widened where one passes outside of it.

use super::ExitPupil;
use crate::element::Part;
use crate::train::{MonochromaticTrain, OpticalTrain};

/// A ray that passes outside of the bound.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stray {
    pub(super) nodes: [(usize, f64); 4],
    pub(super) turn: f64,
    /// In its frame.
    pub(super) radius: f64,
}

/// The lenses at which outlines are measured, and all others, each in the order in which they were given.
pub(super) struct LensSplit {
    pub(super) measured: Vec<MonochromaticTrain>,
    pub(super) checked: Vec<MonochromaticTrain>,
}

impl LensSplit {
    /// Of the lens `train` at some wavelengths: both ends, and those that lie evenly between them in 1/λ², at `most` so
    /// many. All are measured where orders of diffraction part them by more than glass does.
    pub(super) fn of(train: &OpticalTrain, lenses: Vec<MonochromaticTrain>, most: usize) -> Self {
        let diffracts = train
            .elements
            .iter()
            .any(|element| matches!(&element.part, Part::Freeform(it) if it.is_dispersive()));
        if diffracts || lenses.len() <= most {
            return Self { measured: lenses, checked: Vec::new() };
        }
        let places: Vec<f64> = lenses.iter().map(|lens| lens.wavelength().powi(-2)).collect();
        let [low, high] = places
            .iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], &x| [a.min(x), b.max(x)]);
        let mut is_measured = vec![false; lenses.len()];
        for k in 0..most {
            let wanted = low + (high - low) * k as f64 / (most - 1) as f64;
            let off = |i: &usize| (places[*i] - wanted).abs();
            let nearest = (0..places.len()).min_by(|a, b| off(a).total_cmp(&off(b)));
            nearest.into_iter().for_each(|i| is_measured[i] = true);
        }
        let (mut measured, mut checked) = (Vec::new(), Vec::new());
        for (lens, is_measured) in lenses.into_iter().zip(is_measured) {
            if is_measured { measured.push(lens) } else { checked.push(lens) }
        }
        Self { measured, checked }
    }
}

impl ExitPupil {
    /// The rays of one round of the closing check that `find` finds: one round for each of the lenses that are
    /// measured, and one round together for all that are checked.
    pub(super) fn found_in_round(
        &self,
        LensSplit { measured, checked }: &LensSplit,
        round: u32,
        find: impl Fn(&Self, &MonochromaticTrain, std::ops::Range<u32>) -> Vec<Stray>,
    ) -> Vec<Stray> {
        let checks = self.accuracy.checks;
        let (first, last) = (round * checks, (round + 1) * checks);
        let mut found: Vec<Stray> =
            measured.iter().flat_map(|lens| find(self, lens, first..last)).collect();
        let count = u32::try_from(checked.len()).unwrap_or(u32::MAX);
        let share = checks / count.max(1);
        for (lens, k) in checked.iter().zip(0..) {
            let from = first + k * share;
            found.extend(find(self, lens, from..from + share));
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::preset;
    use super::*;
    use crate::train::Focus;
    use crate::train::pupil::PupilAccuracy;

    const CHECKS: u32 = PupilAccuracy::DEFAULT.checks;

    /// Thirty bands of 10 nm, of which five are measured: of a million rays at all thirty none passes outside of the
    /// bound, which the bound of the middle wavelength alone lets pass.
    #[test]
    fn what_is_measured_at_five_wavelengths_bounds_all_thirty() {
        let wavelengths: Vec<f64> = (0..30).map(|k| 405.0 + 10.0 * f64::from(k)).collect();
        let mut passed_one = 0;
        for name in ["double-gauss", "fisheye", "telephoto", "asphere"] {
            let train = preset(name);
            let z = train.sensor_z(Focus::Infinity).unwrap();
            let lenses: Vec<_> = wavelengths.iter().map(|&nm| train.at(nm).unwrap()).collect();
            let divided = LensSplit::of(&train, lenses.clone(), 5);
            let measured: Vec<f64> =
                divided.measured.iter().map(MonochromaticTrain::wavelength).collect();
            assert_eq!((measured.len(), divided.checked.len()), (5, 25), "{measured:?}");
            assert_eq!([measured[0], measured[4]], [405.0, 695.0]);
            let ends = LensSplit::of(&train, lenses.clone(), 2).measured;
            let ends: Vec<f64> = ends.iter().map(MonochromaticTrain::wavelength).collect();
            assert_eq!(ends, [405.0, 695.0]);
            let all = ExitPupil::new(&train, &wavelengths, z, [18.0, 12.0]).unwrap();
            let one = ExitPupil::new(&train, &[545.0], z, [18.0, 12.0]).unwrap();
            let mut passed = 0;
            for (lens, k) in lenses.iter().zip(0..) {
                // Rays with which the bound had nothing to do: rounds from 16 on.
                let rays = |from: u32| 16 * CHECKS + from..16 * CHECKS + from + CHECKS / 2;
                passed += all.strays(lens, rays(k * CHECKS / 2)).len();
                passed_one += one.strays(lens, rays(k * CHECKS / 2)).len();
            }
            assert_eq!(passed, 0, "{name}");
        }
        assert!(passed_one > 100, "one wavelength bounds all others, too: {passed_one}");
    }
}
