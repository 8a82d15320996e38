//! Hills and valleys on a sphere: a sum of plane waves with random directions, evaluated on it.

use etendue_geometry::glam::DVec3;

use super::turn::sin_cos_turns;

/// How many waves, from 0.4 on a radius to 7.2, each 1.3 times as many as the one before.
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
