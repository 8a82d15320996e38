//! Hills and valleys on a sphere: a sum of plane waves with random directions, evaluated on it.
//!
//! Sine and cosine of whole turns, the same to the last bit on every machine: the system's own
//! functions may differ in it, and a scene's hash must not.
//!
//! # Sources
//!
//! Coefficients of `__kernel_sin` and `__kernel_cos` of Sun's fdlibm 5.3 (1993), good to less than
//! one unit in the last place on ±π/4.

use std::f64::consts::TAU;

use etendue_geometry::glam::DVec3;

const SIN: [f64; 6] = [
    -1.666_666_666_666_663_2e-1,
    8.333_333_333_322_49e-3,
    -1.984_126_982_985_795e-4,
    2.755_731_370_707_007e-6,
    -2.505_076_025_340_686_3e-8,
    1.589_690_995_211_55e-10,
];
const COS: [f64; 6] = [
    4.166_666_666_666_66e-2,
    -1.388_888_888_887_411e-3,
    2.480_158_728_947_673e-5,
    -2.755_731_435_139_066_3e-7,
    2.087_572_321_298_175e-9,
    -1.135_964_755_778_819_5e-11,
];

/// (sin 2πt, cos 2πt), exact at quarter turns. |t| should stay below 2⁵⁰.
#[inline]
pub(super) fn sin_cos_turns(turns: f64) -> (f64, f64) {
    let quarters = (turns * 4.0).round_ties_even();
    let angle = (turns - quarters * 0.25) * TAU;
    let square = angle * angle;
    let polynomial = |c: &[f64; 6]| {
        c[0] + square * (c[1] + square * (c[2] + square * (c[3] + square * (c[4] + square * c[5]))))
    };
    let sin = angle + angle * square * polynomial(&SIN);
    let cos = 1.0 - 0.5 * square + square * square * polynomial(&COS);
    #[expect(clippy::cast_possible_truncation, reason = "whole, and below 2⁵²")]
    let quadrant = quarters as i64 & 3;
    let (sin, cos) = if quadrant & 1 == 1 { (cos, -sin) } else { (sin, cos) };
    if quadrant >= 2 { (-sin, -cos) } else { (sin, cos) }
}

/// Number of waves, from 0.4 on a radius to 7.2, each 1.3 times as many as the one before.
const WAVES: usize = 12;

/// The distance of the surface from the centre, by direction.
#[derive(Debug, Clone)]
pub(super) struct Relief {
    radius: f64,
    /// The waves; none for a sphere.
    waves: Vec<Wave>,
}

/// `height · sin 2π(along · d + phase)` for a unit direction d.
#[derive(Debug, Clone, Copy)]
struct Wave {
    /// Direction, times waves on a radius.
    along: DVec3,
    /// In turns.
    phase: f64,
    /// As a fraction of the radius.
    height: f64,
}

impl Relief {
    /// A plain sphere.
    pub(super) fn none(radius: f64) -> Self {
        Self { radius, waves: Vec::new() }
    }

    /// Waves whose heights, which fall with the wavelength, sum up to `amplitude`.
    pub(super) fn new(radius: f64, amplitude: f64, seed: u64) -> Self {
        let mut random = Random(seed);
        let frequencies: Vec<f64> =
            std::iter::successors(Some(0.4), |f| Some(f * 1.3)).take(WAVES).collect();
        let total: f64 = frequencies.iter().map(|frequency| 1.0 / frequency).sum();
        let wave = |frequency: f64| Wave {
            along: random.direction() * frequency,
            phase: random.unit(),
            height: amplitude / (frequency * total),
        };
        Self { radius, waves: frequencies.into_iter().map(wave).collect() }
    }

    /// The point of the surface in unit direction `d`.
    #[inline]
    pub(super) fn point(&self, d: DVec3) -> DVec3 {
        let mut height = 1.0;
        for wave in &self.waves {
            height += wave.height * sin_cos_turns(wave.along.dot(d) + wave.phase).0;
        }
        d * (self.radius * height)
    }

    /// The surface's unit normal in unit direction `d`.
    ///
    /// For r(d)·d the tangents are r·t + (∇r·t)·d for each t across d; both are normal to
    /// r·d − ∇r, with ∇r across d.
    #[inline]
    pub(super) fn normal(&self, d: DVec3) -> DVec3 {
        let (mut height, mut gradient) = (1.0, DVec3::ZERO);
        for wave in &self.waves {
            let (sin, cos) = sin_cos_turns(wave.along.dot(d) + wave.phase);
            height += wave.height * sin;
            gradient += wave.along * (wave.height * std::f64::consts::TAU * cos);
        }
        (d * height - (gradient - d * gradient.dot(d))).normalize()
    }
}

/// `SplitMix64` (Steele, Lea, Flood, *Fast splittable pseudorandom number generators*, 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// In 0..1.
    #[expect(clippy::cast_precision_loss, reason = "53 bits fit")]
    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 * 2.0_f64.powi(-53)
    }

    /// Uniform over the sphere: heights are, by Archimedes.
    fn direction(&mut self) -> DVec3 {
        let height = 2.0 * self.unit() - 1.0;
        let (sin, cos) = sin_cos_turns(self.unit());
        let across = (1.0 - height * height).sqrt();
        DVec3::new(across * cos, height, across * sin)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_the_system_and_is_exact_at_quarters() {
        for i in -4000..4000 {
            let turns = f64::from(i) * 0.000_73;
            let (sin, cos) = sin_cos_turns(turns);
            let (expected_sin, expected_cos) = (turns * TAU).sin_cos();
            // The reference rounds 2πt, |t| < 3, before it looks: 19 · 2⁻⁵³.
            assert!((sin - expected_sin).abs() < 3e-15, "{turns}: {sin} {expected_sin}");
            assert!((cos - expected_cos).abs() < 3e-15, "{turns}: {cos} {expected_cos}");
        }
        let quarters: Vec<_> = (0..5).map(|q| sin_cos_turns(f64::from(q) * 0.25)).collect();
        assert_eq!(quarters, [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0), (0.0, 1.0)]);
    }
}
