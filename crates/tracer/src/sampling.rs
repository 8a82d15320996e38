//! Numbers in 0..1 become directions, and indices by their weights.
//!
//! # Sources
//!
//! * Cosine-weighted directions: Shirley and Chiu, "A Low Distortion Map Between Disk and Square",
//!   1997, projected up (Malley).
//! * Orthonormal frames: Duff et al., "Building an Orthonormal Basis, Revisited", 2017.
//! * Choice by weight: Walker 1977 and Vose 1991 (alias tables), constant time for any number.

use std::f64::consts::{PI, TAU};

use etendue_geometry::disk;
use etendue_geometry::glam::DVec3;

/// Three unit vectors at right angles; z is a surface's normal.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    x: DVec3,
    y: DVec3,
    /// The third, which the frame was made around.
    pub z: DVec3,
}

impl Frame {
    /// A frame around the unit vector `z`.
    #[must_use]
    pub fn around(z: DVec3) -> Self {
        let (x, y) = z.any_orthonormal_pair();
        Self { x, y, z }
    }

    /// Components of `world` along the three.
    #[must_use]
    pub fn local(&self, world: DVec3) -> DVec3 {
        DVec3::new(world.dot(self.x), world.dot(self.y), world.dot(self.z))
    }

    /// The vector of these components.
    #[must_use]
    pub fn world(&self, local: DVec3) -> DVec3 {
        self.x * local.x + self.y * local.y + self.z * local.z
    }
}

/// A direction about +z with density cos θ / π.
#[must_use]
pub fn cosine_direction(square: [f64; 2]) -> DVec3 {
    let [x, y] = disk::point(square);
    DVec3::new(x, y, (1.0 - x * x - y * y).max(0.0).sqrt())
}

/// A direction with density 1/4π.
#[must_use]
pub fn sphere_direction([u, v]: [f64; 2]) -> DVec3 {
    let z = 1.0 - 2.0 * u;
    let (sin, cos) = (TAU * v).sin_cos();
    let r = (1.0 - z * z).max(0.0).sqrt();
    DVec3::new(r * cos, r * sin, z)
}

/// A direction within the cone of half-angle arccos(`cos_max`) about +z, uniform over its solid
/// angle.
#[must_use]
pub fn cone_direction([u, v]: [f64; 2], cos_max: f64) -> DVec3 {
    let z = 1.0 - u * (1.0 - cos_max);
    let (sin, cos) = (TAU * v).sin_cos();
    let r = (1.0 - z * z).max(0.0).sqrt();
    DVec3::new(r * cos, r * sin, z)
}

/// Solid angle of that cone (sr).
#[must_use]
pub fn cone_angle(cos_max: f64) -> f64 {
    2.0 * PI * (1.0 - cos_max)
}

/// Barycentric weights of the second and third corner, uniform over a triangle (Turk 1990).
#[must_use]
pub fn triangle_point([u, v]: [f64; 2]) -> [f64; 2] {
    let root = u.sqrt();
    [root * (1.0 - v), root * v]
}

/// The weight of the first of two sampling techniques by the power heuristic of exponent 2 (Veach
/// 1997, section 9.2.4), for densities `of` and `other`.
#[must_use]
pub fn power_heuristic(of: f64, other: f64) -> f64 {
    if of == f64::INFINITY {
        return 1.0;
    }
    // Ratios do not overflow where squares do.
    let ratio = other / of;
    1.0 / (1.0 + ratio * ratio)
}

/// Indices by weight in constant time.
#[derive(Debug, Clone, Default)]
pub struct AliasTable {
    /// How much of a slot is its own index's, and whose the rest is.
    slots: Vec<(f64, u32)>,
    /// Probability of each index.
    probability: Vec<f64>,
}

impl AliasTable {
    /// A table of `weights`; those that are not finite or below zero count as zero. Without any
    /// weight all are alike.
    #[must_use]
    pub fn new(weights: &[f64]) -> Self {
        let sound = |w: f64| if w.is_finite() && w > 0.0 { w } else { 0.0 };
        // The largest first keeps the sum finite.
        let most = weights.iter().copied().map(sound).fold(0.0, f64::max);
        let n = weights.len();
        let mut probability: Vec<f64> = if most > 0.0 {
            weights.iter().map(|&w| sound(w) / most).collect()
        } else {
            vec![1.0; n]
        };
        let total: f64 = probability.iter().sum();
        probability.iter_mut().for_each(|p| *p /= total);
        let mut slots: Vec<(f64, u32)> = Vec::with_capacity(n);
        let (mut under, mut over): (Vec<u32>, Vec<u32>) = (Vec::new(), Vec::new());
        for (i, p) in (0_u32..).zip(&probability) {
            let share = p * n as f64;
            slots.push((share, i));
            if share < 1.0 { under.push(i) } else { over.push(i) }
        }
        while let (Some(&small), Some(&large)) = (under.last(), over.last()) {
            under.pop();
            slots[small as usize].1 = large;
            let left = slots[large as usize].0 + slots[small as usize].0 - 1.0;
            slots[large as usize].0 = left;
            if left < 1.0 {
                over.pop();
                under.push(large);
            }
        }
        // What is left is whole but for rounding.
        for i in under.into_iter().chain(over) {
            slots[i as usize].0 = 1.0;
        }
        Self { slots, probability }
    }

    /// How many indices there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.slots.len()
    }

    /// Whether there is no index.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }

    /// The index for `u` in 0..1, and `u` stretched to 0..1 again for the next choice.
    #[must_use]
    pub fn pick(&self, u: f64) -> (usize, f64) {
        let n = self.slots.len();
        let scaled = u * n as f64;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "u is in 0..1, and the cast saturates"
        )]
        let slot = (scaled as usize).min(n - 1);
        let within = scaled - slot as f64;
        let (own, other) = self.slots[slot];
        if within < own {
            (slot, (within / own).min(ONE_BELOW))
        } else {
            (other as usize, ((within - own) / (1.0 - own)).min(ONE_BELOW))
        }
    }

    /// The probability of `index`.
    #[must_use]
    pub fn probability(&self, index: usize) -> f64 {
        self.probability[index]
    }
}

/// The largest number below 1.
pub(crate) const ONE_BELOW: f64 = 1.0 - f64::EPSILON / 2.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_pick_by_weight() {
        let weights = [1.0, 0.0, 3.0, f64::NAN, 4.0, -1.0];
        let table = AliasTable::new(&weights);
        let mut counts = [0_u32; 6];
        let n = 80_000;
        for k in 0..n {
            let (index, rest) = table.pick((f64::from(k) + 0.5) / f64::from(n));
            assert!((0.0..1.0).contains(&rest));
            counts[index] += 1;
        }
        // A regular grid of u hits each interval's length to within one step an interval.
        for (i, expected) in [1.0, 0.0, 3.0, 0.0, 4.0, 0.0].iter().enumerate() {
            let share = f64::from(counts[i]) / f64::from(n);
            assert!((share - expected / 8.0).abs() < 2e-4, "{counts:?}");
            assert!((table.probability(i) - expected / 8.0).abs() < 1e-15);
        }
        let alike = AliasTable::new(&[0.0, 0.0]);
        assert_eq!(alike.probability(1), 0.5);
    }

    #[test]
    fn directions_have_the_mean_of_their_density() {
        let n = 256;
        let grid = (0..n * n).map(|k| {
            [(f64::from(k % n) + 0.5) / f64::from(n), (f64::from(k / n) + 0.5) / f64::from(n)]
        });
        let (mut cosine, mut sphere, mut cone) = (0.0, DVec3::ZERO, 0.0);
        for square in grid {
            cosine += cosine_direction(square).z;
            sphere += sphere_direction(square);
            cone += cone_direction(square, 0.5).z;
        }
        let count = f64::from(n * n);
        // Midpoint rule: errors of 1/n², and of 1/n^1.5 where a root ends at the disk's edge.
        assert!((cosine / count - 2.0 / 3.0).abs() < 1e-3);
        assert!((sphere / count).length() < 1e-4);
        assert!((cone / count - 0.75).abs() < 1e-4);
    }
}
