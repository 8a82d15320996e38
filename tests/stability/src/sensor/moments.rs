//! Mean and variance of digital numbers, from hardly an electron to a full well and from one bit to sixteen.

use anyhow::Result;
use etendue_sensor::{Exposure, Film};
use serde_json::json;

use crate::{Case, Outcome, Scale};

pub(super) const MOMENTS: Case = Case {
    name: "moments",
    regime: "0.01 to 10⁵ electrons of light, converters of 1 to 16 bits whose range is 10 electrons, the light's \
        and ten times the light's, without read noise and with 2.45 and 10 e⁻, black at 0 and at a sixteenth of the range",
    must: "`moments` are those of the sum over all counts of electrons and all digital numbers: the mean to 10⁻³ of \
        what it is above black and 10⁻⁶ DN, the variance to 10⁻³ and 10⁻⁶ DN²",
    limit: None,
    run: moments,
};

/// Law of one pixel: what it is under.
#[derive(Debug, Clone, Copy)]
struct Law {
    electrons: f64,
    read_noise: f64,
    gain: f64,
    black: f64,
    white: f64,
}

fn moments(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let all = [0.01, 0.2, 1.0, 7.0, 60.0, 1e3, 1e4, 1e5];
    let electrons: &[f64] = scale.pick(&all[..6], &all);
    let (mut worst, mut count) = ([0.0_f64; 2], 0);
    for bits in [1_i32, 2, 4, 8, 12, 16] {
        let white = 2.0_f64.powi(bits) - 1.0;
        for &mean in electrons {
            for range in [10.0, mean, 10.0 * mean] {
                for read_noise in [0.0, 2.45, 10.0] {
                    for black in [0.0, (white / 16.0).floor()] {
                        let gain = white / range;
                        let law = Law { electrons: mean, read_noise, gain, black, white };
                        let [off, spread] = law.off(bits)?;
                        worst = [worst[0].max(off), worst[1].max(spread)];
                        count += 1;
                        outcome.must(off <= 1.0 && spread <= 1.0, || {
                            format!("{law:?}: {off} and {spread} of what is allowed")
                        });
                    }
                }
            }
        }
    }
    outcome.measured(format!(
        "{count} laws; means at most {:.3} and variances {:.3} of that off",
        worst[0], worst[1]
    ));
    Ok(outcome)
}

impl Law {
    /// Errors of the sensor's mean and variance, as shares of what is allowed.
    fn off(&self, bits: i32) -> Result<[f64; 2]> {
        let keys = json!({
            "system_gain": self.gain, "read_noise": self.read_noise, "black_level": self.black,
            "bit_depth": bits
        });
        let sensor = super::sensor(1, &keys)?;
        let worth = sensor.electrons_per_unit(0)[0];
        #[expect(clippy::cast_possible_truncation, reason = "films hold f32")]
        let light = (self.electrons / worth) as f32;
        let shot = Exposure { exposure: 0.01, frame: 0 };
        let found = sensor.moments(Film { values: &[light] }, shot)?;
        // As many as f32 makes of it.
        let exact = Self { electrons: f64::from(light) * worth, ..*self }.summed();
        let allowed = [1e-3 * (exact[0] - self.black).abs() + 1e-6, 1e-3 * exact[1] + 1e-6];
        // Moments are f32: half a unit in their last place is not theirs.
        let found = [f64::from(found.mean[0]), f64::from(found.variance[0])];
        let off = |i: usize| ((found[i] - exact[i]).abs() - 6e-8 * exact[i]).max(0.0) / allowed[i];
        Ok([off(0), off(1)])
    }

    /// Mean and variance by Poisson's weights, one by one, and the normal distribution between the middles of the
    /// converter's steps.
    fn summed(&self) -> [f64; 2] {
        let reach = 9.0 * self.electrons.sqrt() + 30.0;
        let (first, last) =
            ((self.electrons - reach).max(0.0).floor(), (self.electrons + reach).ceil());
        // ln k! by its sum, and from there on by steps.
        let mut logarithm = log_factorial(first);
        let (mut mass, mut sums) = (0.0, [0.0; 2]);
        let centre = self.quantised(self.electrons);
        let mut k = first;
        while k <= last {
            let weight = (k * self.electrons.ln() - self.electrons - logarithm).exp();
            let [once, twice] = self.of_count(k, centre);
            mass += weight;
            sums = [sums[0] + weight * once, sums[1] + weight * twice];
            k += 1.0;
            logarithm += k.ln();
        }
        let [once, twice] = sums.map(|sum| sum / mass);
        [centre + once, twice - once * once]
    }

    fn quantised(&self, electrons: f64) -> f64 {
        (self.gain * electrons + self.black).round_ties_even().clamp(0.0, self.white)
    }

    /// Mean and mean square of the digital number less `centre` of so many electrons.
    fn of_count(&self, electrons: f64, centre: f64) -> [f64; 2] {
        let sigma = self.gain * self.read_noise;
        if sigma == 0.0 {
            let off = self.quantised(electrons) - centre;
            return [off, off * off];
        }
        let level = self.gain * electrons + self.black;
        let end = |z: f64| (level + z * sigma).round().clamp(0.0, self.white);
        let (low, high) = (end(-8.5), end(8.5));
        let (mut sums, mut below, mut number) = ([0.0; 2], 0.0, low);
        // Steps far finer than the noise are taken some at a time, whose own spread is added; but for the first and
        // the last, where the clipped ones lie.
        let stride = (sigma / 40.0).floor().max(1.0);
        while number <= high {
            let next = if number == low || number == high {
                number + 1.0
            } else {
                (number + stride).min(high)
            };
            let up_to = if next > high { 1.0 } else { normal_cdf((next - 0.5 - level) / sigma) };
            let off = 0.5 * (number + next - 1.0) - centre;
            let own = ((next - number).powi(2) - 1.0) / 12.0;
            sums[0] += (up_to - below) * off;
            sums[1] += (up_to - below) * (off * off + own);
            (below, number) = (up_to, next);
        }
        sums
    }
}

/// ln k! for a whole k, summed.
fn log_factorial(k: f64) -> f64 {
    let (mut sum, mut i) = (0.0, 2.0);
    while i <= k {
        sum += f64::ln(i);
        i += 1.0;
    }
    sum
}

/// P(Z ≤ z), by the series of G. Marsaglia, "Evaluating the Normal Distribution" (2004).
fn normal_cdf(z: f64) -> f64 {
    if z.abs() > 8.5 {
        return f64::from(u8::from(z > 0.0));
    }
    let (mut sum, mut term, mut i) = (z, z, 1.0);
    while sum + term != sum {
        i += 2.0;
        term *= z * z / i;
        sum += term;
    }
    0.5 + sum * (-0.5 * z * z - 0.918_938_533_204_672_7).exp()
}
