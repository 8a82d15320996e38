//! The noise floor of a sensor, which hides what is below it: its temporal variance at a signal, against which an error
//! of the light is small or is not.

use crate::Sensor;
use crate::normal::normal_cdf;
use crate::spec::{NoiseModel, Radiometry};

/// A sensor's noise in one exposure.
#[derive(Debug, Clone, Copy)]
pub struct NoiseFloor<'a> {
    sensor: &'a Sensor,
    exposure: f64,
}

impl Sensor {
    /// The noise of an exposure of so long (s); `None` for a sensor without any.
    #[must_use]
    pub fn noise_floor(&self, exposure: f64) -> Option<NoiseFloor<'_>> {
        let is_noisy = self.noise() != NoiseModel::None;
        is_noisy.then_some(NoiseFloor { sensor: self, exposure })
    }
}

impl NoiseFloor<'_> {
    /// Mean photo-electrons that a unit of each band makes at a channel (e⁻).
    pub fn electrons_per_unit(&self, channel: usize) -> impl Iterator<Item = f64> + '_ {
        let factor = match self.sensor.radiometry() {
            Radiometry::Digital => 1.0,
            Radiometry::Physical => self.exposure,
        };
        self.sensor.electrons_per_unit(channel).iter().map(move |electrons| electrons * factor)
    }

    /// Variance over frames of the number of a pixel of `electrons` mean photo-electrons (DN²), before
    /// anything is clipped: `K²·(μ + μ_I·T + σ_read² + row² + column²) + 1/12`, by the linear model of EMVA
    /// 1288 (Release 4.0, equations 9 and 11) with quantisation.
    #[must_use]
    pub fn variance(&self, electrons: f64) -> f64 {
        let dark = self.sensor.dark_noise(self.exposure).powi(2);
        let gain = self.sensor.system_gain();
        gain * gain * (electrons.max(0.0) + dark) + 1.0 / 12.0
    }

    /// The share of a small change of the light that is one of the number (DN/e⁻): the gain, less
    /// where the well or the converter is full. It is the gain times the probability that a number is
    /// not clipped, the derivative of a clipped normal variable's mean.
    #[must_use]
    pub fn slope(&self, electrons: f64) -> f64 {
        let gain = self.sensor.system_gain();
        let dark = self.sensor.dark_current() * self.exposure;
        let level = gain * (electrons.max(0.0) + dark);
        let sigma = self.variance(electrons).sqrt();
        let white = gain * self.sensor.saturation();
        let black = -self.sensor.black_level();
        let clipped = normal_cdf((black - level) / sigma) + normal_cdf((level - white) / sigma);
        gain * (1.0 - clipped).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use crate::{Exposure, Film, Sensor, SensorSpec};

    fn sensor(more: &str) -> Sensor {
        let text = format!(
            r#"{{ "type": "raw", "model": "imx183", "resolution": [256, 256], "quantum_efficiency": 0.8,
            "prnu": 0, "dsnu": 0 {more} }}"#
        );
        Sensor::new(&serde_json::from_str::<SensorSpec>(&text).unwrap()).unwrap()
    }

    /// The variance is that of drawn numbers, and the slope that of their means, from black to beyond
    /// full scale.
    #[test]
    fn variance_and_slope_are_those_of_exposed_numbers() {
        let sensor = sensor(r#", "read_noise": 3, "system_gain": 0.3"#);
        let shot = Exposure { exposure: 0.01, frame: 0 };
        let floor = sensor.noise_floor(shot.exposure).unwrap();
        let bands = sensor.bands().count();
        let count = 256.0 * 256.0;
        let drawn = |light: f32| {
            let film = vec![light; 256 * 256 * bands];
            let image = sensor.expose(Film { values: &film }, shot, 1).unwrap();
            let mean = image.values.iter().map(|&y| f64::from(y)).sum::<f64>() / count;
            let square = image.values.iter().map(|&y| (f64::from(y) - mean).powi(2)).sum::<f64>();
            [mean, square / count]
        };
        let electrons =
            |light: f32| floor.electrons_per_unit(0).map(|per| per * f64::from(light)).sum::<f64>();
        for light in [0.05, 0.3, 0.8, 0.9995, 1.1] {
            let [mean, variance] = drawn(light);
            let expected = floor.variance(electrons(light));
            let step = 0.01 * light;
            let ([more, _], [less, _]) = (drawn(light + step), drawn(light - step));
            let slope = (more - less) / (electrons(light + step) - electrons(light - step));
            if light < 0.95 {
                // √(2/65536) of a normal variable's variance is 0.6 %: five of these.
                assert!((variance / expected - 1.0).abs() < 0.03, "{light}: {variance} {expected}");
                let noise = 2.0 * (expected / count).sqrt();
                let bound = 5.0 * noise / (electrons(2.0 * step)) + 1e-3;
                assert!((slope - floor.slope(electrons(light))).abs() < bound, "{light}: {slope}");
            }
            if light > 1.05 {
                assert_eq!((mean, variance), (4095.0, 0.0));
                assert!(floor.slope(electrons(light)) < 1e-9 * sensor.system_gain());
            }
        }
        // Where the mean is the end of the scale, half of all numbers are clipped.
        let full = floor.slope(sensor.saturation() - sensor.dark_current() * shot.exposure);
        assert!((full / sensor.system_gain() - 0.5).abs() < 1e-6, "{full}");
    }

    #[test]
    fn a_sensor_without_noise_has_no_floor() {
        assert!(sensor(r#", "noise": "none""#).noise_floor(0.01).is_none());
        assert!(sensor("").noise_floor(0.01).is_some());
    }
}
