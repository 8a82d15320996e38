//! Mean photo-electrons of a run of pixels: each pixel's bands times what they are worth there.

use crate::film::InvalidValues;

/// Worth of bands along a row: `[phase][band]`, the phases taking turns from column to column.
#[derive(Debug, Clone)]
pub(crate) struct Responsivity {
    pub(crate) bands: usize,
    /// Electrons a unit of light, `[phase][band]`.
    pub(crate) electrons: Vec<f64>,
}

impl Responsivity {
    /// Fills `mean` with the photo-electrons of the pixels in `values` (`[column][band]`), the first
    /// of which is in column `start`. Light that is none counts as 0 and as a flaw.
    pub(crate) fn gather(&self, values: &[f32], start: usize, mean: &mut [f64]) -> InvalidValues {
        let clean = match (self.bands, self.electrons.as_slice()) {
            (1, &[worth]) => one_band(values, worth, mean),
            (3, &[..]) => bands_of::<3>(values, &self.electrons, start, mean),
            (1, &[..]) => bands_of::<1>(values, &self.electrons, start, mean),
            _ => self.many_bands(values, start, mean),
        };
        if clean { InvalidValues::default() } else { InvalidValues::of(values) }
    }

    /// Of the bands that are worth anything there: a band's own filter sees few others.
    fn many_bands(&self, values: &[f32], start: usize, mean: &mut [f64]) -> bool {
        let seen = |worth: &[f64]| {
            let first = worth.iter().position(|&worth| worth != 0.0).unwrap_or(0);
            first..worth.iter().rposition(|&worth| worth != 0.0).map_or(first, |last| last + 1)
        };
        let phases: Vec<_> =
            self.electrons.chunks_exact(self.bands).map(|p| (p, seen(p))).collect();
        let pixels = values.chunks_exact(self.bands);
        let phases_of_pixels = phases.iter().cycle().skip(start % phases.len());
        for ((pixel, (worth, seen)), mean) in pixels.zip(phases_of_pixels).zip(mean) {
            let mut sum = 0.0;
            for (&value, worth) in pixel[seen.clone()].iter().zip(&worth[seen.clone()]) {
                sum += light(value) * worth;
            }
            *mean = sum;
        }
        are_light(values)
    }
}

#[multiversion::multiversion(targets = "simd")]
fn one_band(values: &[f32], worth: f64, mean: &mut [f64]) -> bool {
    let mut clean = true;
    for (&value, mean) in values.iter().zip(mean) {
        clean &= is_light(value);
        *mean = light(value) * worth;
    }
    clean
}

fn bands_of<const N: usize>(
    values: &[f32],
    electrons: &[f64],
    start: usize,
    mean: &mut [f64],
) -> bool {
    let mut clean = true;
    let phases = electrons.as_chunks::<N>().0;
    let mut phase = start % phases.len();
    for (pixel, mean) in values.as_chunks::<N>().0.iter().zip(mean) {
        let mut sum = 0.0;
        for (&value, worth) in pixel.iter().zip(&phases[phase]) {
            clean &= is_light(value);
            sum += light(value) * worth;
        }
        *mean = sum;
        phase = if phase + 1 == phases.len() { 0 } else { phase + 1 };
    }
    clean
}

#[multiversion::multiversion(targets = "simd")]
fn are_light(values: &[f32]) -> bool {
    let mut clean = true;
    for &value in values {
        clean &= is_light(value);
    }
    clean
}

#[inline(always)]
fn is_light(value: f32) -> bool {
    (0.0..f32::INFINITY).contains(&value)
}

#[inline(always)]
fn light(value: f32) -> f64 {
    f64::from(if is_light(value) { value } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_ways_of_adding_agree() {
        for bands in [1u16, 2, 3, 5] {
            for phases in [1u16, 2, 3] {
                let electrons: Vec<f64> = (0..bands * phases).map(|i| 1.0 + f64::from(i)).collect();
                let responsivity =
                    Responsivity { bands: bands.into(), electrons: electrons.clone() };
                let values: Vec<f32> = (0..bands * 7).map(|i| f32::from(i) - 2.0).collect();
                let mut mean = [0.0; 7];
                let invalid = responsivity.gather(&values, 4, &mut mean);
                assert_eq!(invalid, InvalidValues { negative: 2, not_finite: 0 });
                for (x, mean) in mean.iter().enumerate() {
                    let phase = (4 + x) % usize::from(phases);
                    let expected: f64 = (0..usize::from(bands))
                        .map(|band| {
                            let value = f64::from(values[x * usize::from(bands) + band]).max(0.0);
                            value * electrons[phase * usize::from(bands) + band]
                        })
                        .sum();
                    assert_eq!(*mean, expected, "{bands} bands, {phases} phases, pixel {x}");
                }
            }
        }
    }
}
