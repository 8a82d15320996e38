//! The noise that the sensor puts over each pixel, as a measure of the errors of its light.

use etendue_scene::Scene;
use etendue_sensor::{NoiseFloor, Sensor};
use etendue_spectrum::Bands;
use etendue_tracer::LayerSpec;

use super::film::light_factor;
use crate::sum::variance_of_mean;

/// Parts of the way between the light of two sets of samples in which it is looked at how much of it is clipped. Not a
/// setting: it is looked at only where one set is clipped and the other is not.
const PARTS: u32 = 32;

/// The share by which slopes may differ that are taken for one.
const ALIKE: f64 = 1e-6;

/// The sensor's noise at each pixel of a picture.
pub(crate) struct NoiseOfPixels {
    sensor: Sensor,
    exposures: Vec<ExposureResponse>,
}

/// Response of the sensor to light in one of its exposure times.
struct ExposureResponse {
    /// Seconds.
    exposure: f64,
    /// Mean photo-electrons that a unit of each number of the picture makes, by channel (e⁻).
    electrons: Vec<Vec<f64>>,
}

impl NoiseOfPixels {
    /// The noise of `scene`'s sensor over its picture, which is kept in `bands`; `None` where there is no
    /// sensor or no noise.
    pub(crate) fn of(scene: &Scene, bands: &Bands) -> Option<Self> {
        let sensor = scene.sensor.as_ref()?;
        let lit = scene.picture == Some(LayerSpec::Radiance);
        let own = if lit { bands.clone() } else { Bands::Rgb };
        // Base colours are brought into the sensor's bands where it has no use for three.
        let (sensor, from_rgb) = match sensor.clone().in_bands(own) {
            Ok(sensor) => (sensor, None),
            Err(_) => (sensor.clone(), Some(sensor.bands().from_rgb())),
        };
        let factor = light_factor(scene, &sensor);
        let mut exposures: Vec<f64> = sensor.shots().map(|shot| shot.exposure).collect();
        exposures.dedup();
        let response = |exposure: f64| {
            let floor = sensor.noise_floor(exposure)?;
            let electrons = (0..sensor.channels().len()).map(|channel| {
                let units: Vec<f64> =
                    floor.electrons_per_unit(channel).map(|e| e * factor).collect();
                match &from_rgb {
                    None => units,
                    Some(rows) => (0..3)
                        .map(|k| units.iter().zip(rows).map(|(unit, row)| unit * row[k]).sum())
                        .collect(),
                }
            });
            Some(ExposureResponse { exposure, electrons: electrons.collect() })
        };
        let exposures = exposures.into_iter().map(response).collect::<Option<_>>()?;
        Some(Self { sensor, exposures })
    }

    /// The variance of the mean of a pixel's samples, carried through exposure, quantum efficiency and
    /// gain, as a share of the sensor's own at that signal: the largest over exposures, the mean over
    /// channels. `light` is what each of the two sets of samples has of each band.
    pub(crate) fn share(&self, pixel: [u32; 2], light: impl Fn(usize, usize) -> f64) -> f64 {
        let shares = self.exposures.iter().filter_map(|response| {
            let floor = self.sensor.noise_floor(response.exposure)?;
            Some(match self.sensor.depth() {
                1 => {
                    let [column, row] = pixel.map(|place| place as usize);
                    response.share(floor, self.sensor.channel_at(row, column), &light)
                }
                channels => {
                    let each = (0..channels).map(|channel| response.share(floor, channel, &light));
                    each.sum::<f64>() / channels as f64
                }
            })
        });
        shares.fold(0.0, f64::max)
    }
}

impl ExposureResponse {
    /// The share at one channel.
    fn share(
        &self,
        floor: NoiseFloor<'_>,
        channel: usize,
        light: impl Fn(usize, usize) -> f64,
    ) -> f64 {
        let units = self.electrons[channel].iter().enumerate();
        let [a, b] = [0, 1]
            .map(|set| units.clone().map(|(band, unit)| unit * light(set, band)).sum::<f64>());
        let slope = secant(&|electrons| floor.slope(electrons), a, b);
        slope * slope * variance_of_mean(a - b) / floor.variance(0.5 * (a + b))
    }
}

/// The mean of a slope from `a` to `b`. Where one set of samples has met a lamp and the other has not, their mean may
/// be clipped, which the pixel is not.
fn secant(slope: &dyn Fn(f64) -> f64, a: f64, b: f64) -> f64 {
    let ends = [a, b].map(slope);
    if (ends[0] - ends[1]).abs() <= ALIKE * ends[0].max(ends[1]) {
        return ends[0];
    }
    let at = |k: u32| a + (b - a) * (f64::from(k) + 0.5) / f64::from(PARTS);
    (0..PARTS).map(|k| slope(at(k))).sum::<f64>() / f64::from(PARTS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_one_set_alone_clips_is_not_clipped() {
        let clipped = |electrons: f64| if electrons < 100.0 { 2.0 } else { 0.0 };
        assert_eq!(secant(&clipped, 0.0, 50.0), 2.0);
        assert_eq!(secant(&clipped, 200.0, 300.0), 0.0);
        // From 0 to 1000 a tenth is below the well, of 32 parts three.
        let found = secant(&clipped, 0.0, 1000.0);
        assert!((found - 2.0 * 3.0 / 32.0).abs() < 1e-12, "{found}");
    }
}
