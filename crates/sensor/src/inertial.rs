//! The errors of an inertial unit: white noise, and biases that walk.
//!
//! # Sources
//!
//! * J. L. Crassidis, "Sigma-Point Kalman Filtering for Integrated GPS and Inertial Navigation", 2006, appendix: of
//!   readings Δt apart, white noise of the density σ has the deviation σ/√Δt, and a bias is moved from one to the next by a
//!   normal deviate of `σ_b √Δt`. Calibrations with Kalibr name the same four numbers.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::mixed_seed;
use crate::normal::pair;
use crate::philox::PhiloxKey;

/// The noise of an inertial unit, as the scene file writes it. A number that is absent is 0.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct InertialNoiseSpec {
    /// Density of the white noise of angular velocities (rad/s/√Hz).
    #[schemars(range(min = 0.0))]
    pub gyro_density: f64,
    /// Density of the white noise of specific forces (m/s²/√Hz).
    #[schemars(range(min = 0.0))]
    pub accel_density: f64,
    /// Random walk of the bias of angular velocities (rad/s²/√Hz).
    #[schemars(range(min = 0.0))]
    pub gyro_walk: f64,
    /// Random walk of the bias of specific forces (m/s³/√Hz).
    #[schemars(range(min = 0.0))]
    pub accel_walk: f64,
    /// The bias of angular velocities before the walk (rad/s).
    pub gyro_bias: [f64; 3],
    /// The bias of specific forces before the walk (m/s²).
    pub accel_bias: [f64; 3],
}

impl InertialNoiseSpec {
    /// The first key whose number makes no noise.
    #[must_use]
    pub fn fault(&self) -> Option<&'static str> {
        let deviations = [
            ("gyro_density", self.gyro_density),
            ("accel_density", self.accel_density),
            ("gyro_walk", self.gyro_walk),
            ("accel_walk", self.accel_walk),
        ];
        let wrong = deviations.iter().find(|(_, value)| !(*value >= 0.0 && value.is_finite()));
        let biases = [("gyro_bias", self.gyro_bias), ("accel_bias", self.accel_bias)];
        let infinite = biases.iter().find(|(_, bias)| bias.iter().any(|value| !value.is_finite()));
        wrong.map(|(key, _)| *key).or(infinite.map(|(key, _)| *key))
    }
}

/// The errors of readings at a rate, one after the other.
#[derive(Debug, Clone)]
pub struct InertialNoise {
    spec: InertialNoiseSpec,
    key: PhiloxKey,
    /// √Hz.
    root_of_rate: f64,
    /// The number of the next reading.
    next: i64,
    /// Of angular velocities and specific forces.
    walked: [[f64; 3]; 2],
}

/// The error of a reading: of the angular velocity (rad/s), and of the specific force (m/s²).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InertialError {
    /// Both biases.
    pub bias: [[f64; 3]; 2],
    /// The white noise of both.
    pub white: [[f64; 3]; 2],
}

impl InertialNoise {
    /// Of readings `rate` times a second (Hz) from number 0 on. The same seed gives the same errors.
    #[must_use]
    pub fn new(spec: InertialNoiseSpec, rate: f64, seed: u64) -> Self {
        let key = PhiloxKey::new(mixed_seed(seed, b"inertial unit"));
        Self { spec, key, root_of_rate: rate.sqrt(), next: 0, walked: [[0.0; 3]; 2] }
    }

    /// Twelve standard normal deviates of reading `number`.
    fn deviates(&self, number: i64) -> [f64; 12] {
        let bits = number.cast_unsigned();
        let [low, high] = [bits & 0xffff_ffff, bits >> 32];
        let mut all = [0.0; 12];
        for (k, two) in (0_u32..).zip(all.chunks_exact_mut(2)) {
            #[expect(clippy::cast_possible_truncation, reason = "halves of 64 bits")]
            let [a, b, c, _] = self.key.words([low as u32, high as u32, k, 0]);
            two.copy_from_slice(&pair([a, b, c]));
        }
        all
    }

    /// The error of reading `number`, which is not before one that was asked for. Biases begin to walk at number 0.
    pub fn error(&mut self, number: i64) -> InertialError {
        let walks = [self.spec.gyro_walk, self.spec.accel_walk];
        while self.next < number && walks != [0.0; 2] {
            let deviates = self.deviates(self.next);
            for (k, walk) in walks.into_iter().enumerate() {
                for (axis, walked) in self.walked[k].iter_mut().enumerate() {
                    *walked += walk / self.root_of_rate * deviates[6 + 3 * k + axis];
                }
            }
            self.next += 1;
        }
        let deviates = self.deviates(number);
        let densities = [self.spec.gyro_density, self.spec.accel_density];
        let start = [self.spec.gyro_bias, self.spec.accel_bias];
        let white =
            |k: usize, axis: usize| densities[k] * self.root_of_rate * deviates[3 * k + axis];
        InertialError {
            bias: [0, 1].map(|k| [0, 1, 2].map(|axis| start[k][axis] + self.walked[k][axis])),
            white: [0, 1].map(|k| [0, 1, 2].map(|axis| white(k, axis))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Deviations of white noise and of the steps of the bias, over many readings, by the sources' formulas.
    #[test]
    fn noise_has_the_deviations_of_its_densities() {
        let (rate, n) = (200.0, 20_000_i64);
        let spec = InertialNoiseSpec {
            gyro_density: 2e-3,
            accel_density: 3e-2,
            gyro_walk: 4e-5,
            accel_walk: 5e-4,
            gyro_bias: [0.1, 0.2, 0.3],
            accel_bias: [0.0; 3],
        };
        let mut noise = InertialNoise::new(spec, rate, 3);
        let errors: Vec<InertialError> = (0..n).map(|number| noise.error(number)).collect();
        assert_eq!(errors[0].bias[0], spec.gyro_bias);
        for k in 0..2 {
            for axis in 0..3 {
                let whites = errors.iter().map(|error| error.white[k][axis]);
                let steps =
                    errors.windows(2).map(|two| two[1].bias[k][axis] - two[0].bias[k][axis]);
                let due = [2e-3, 3e-2][k] * f64::sqrt(rate);
                let due_step = [4e-5, 5e-4][k] / f64::sqrt(rate);
                let deviation = |sum: f64| (sum / n as f64).sqrt();
                let found = deviation(whites.map(|x| x * x).sum());
                let found_step = deviation(steps.map(|x| x * x).sum());
                // A deviation of n values is off by 1/√(2n): four times that.
                let bound = 4.0 / (2.0 * n as f64).sqrt();
                assert!((found / due - 1.0).abs() < bound, "{k} {axis}: {found} {due}");
                assert!((found_step / due_step - 1.0).abs() < bound, "{k} {axis}: {found_step}");
            }
        }
        // The same whatever was asked for before.
        let mut later = InertialNoise::new(spec, rate, 3);
        assert_eq!(Some(&later.error(n - 1)), errors.last());
        assert_ne!(InertialNoise::new(spec, rate, 4).error(5), errors[5]);
    }
}
