//! Albedo of rough reflection, the light that it returns in all: the table that keeps the layer beneath from
//! returning it a second time.
//!
//! A GGX sheet with Schlick's reflectance f₀ (face on) and f₉₀ (grazing) has the directional albedo
//! `E(μ) = f₀ A(μ, α) + f₉₀ B(μ, α)` (Karis, "Real Shading in Unreal Engine 4", 2013, the split of
//! its integral). What lies beneath is lit by what passes on the way in and seen by what passes on
//! the way out, `(1 − E(μᵢ)) (1 − E(μₒ)) / (1 − Ē)`, with the mean albedo `Ē = 2 ∫ E μ dμ`: reciprocal,
//! and both together never return more than falls in (Shirley et al., "A Practitioners' Assessment of
//! Light Reflection Models", 1997; Kelemen and Szirmay-Kalos 2001).
//!
//! Facets that are rougher along the surface than across it have a table of their own (`brushed`).

use std::sync::LazyLock;

use etendue_geometry::glam::DVec3;

use super::brushed;
use super::ggx::Facets;
#[cfg(test)]
use super::split_sum::{cosine, entry, lacking};
use super::split_sum::{obliquity, place};

/// Knots in α, dense where sheets are smooth. No table of surfaces has settings: all scenes share them, and this one
/// is kept in a file.
pub(super) const ROUGHNESSES: usize = 48;

/// Knots in [`obliquity`].
pub(super) const OBLIQUITIES: usize = 96;

/// The least roughness of the table; smoother sheets differ at μ < 10⁻⁴ alone.
#[cfg(test)]
const SMOOTHEST: f64 = 1e-6;

/// Facets that each entry is averaged over: a lattice by the golden ratio, all of whose points differ along
/// both axes, as the viewer's azimuth changes nothing face on.
#[cfg(test)]
const FACETS: u32 = 1024;

#[derive(Debug)]
pub(super) struct AlbedoTable {
    /// (A, B) by roughness, then [`obliquity`].
    pub(super) entries: Vec<[f64; 2]>,
    /// Their means over directions, and that of what facets of reflectance 1 lack, by roughness.
    pub(super) means: Vec<[f64; 3]>,
}

pub(super) static TABLE: LazyLock<AlbedoTable> = LazyLock::new(AlbedoTable::kept);

/// The table as [`AlbedoTable::new`] made it: numbers of 64 bits, the lowest byte first, entries and then means. A
/// test makes it anew, and writes it with `ETENDUE_GENERATE=1`.
const KEPT: &[u8] = include_bytes!("albedo.bin");

impl AlbedoTable {
    /// The one of the program, for making one takes as long as a small picture.
    fn kept() -> Self {
        let (numbers, _) = KEPT.as_chunks();
        let numbers: Vec<f64> = numbers.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
        let (entries, means) = numbers.split_at(2 * ROUGHNESSES * OBLIQUITIES);
        Self { entries: entries.as_chunks().0.to_vec(), means: means.as_chunks().0.to_vec() }
    }

    #[cfg(test)]
    fn new() -> Self {
        let mut entries = Vec::with_capacity(ROUGHNESSES * OBLIQUITIES);
        let mut means = Vec::with_capacity(ROUGHNESSES);
        for i in 0..ROUGHNESSES {
            let alpha = knot::<ROUGHNESSES>(i).powi(4).max(SMOOTHEST);
            let row: Vec<[f64; 2]> = (0..OBLIQUITIES)
                .map(|k| {
                    let mu = cosine(knot::<OBLIQUITIES>(k), alpha);
                    let wo = DVec3::new((1.0 - mu * mu).sqrt(), 0.0, mu.max(1e-12));
                    entry(wo, alpha, FACETS)
                })
                .collect();
            means.push(mean(&row, alpha));
            entries.extend(row);
        }
        Self { entries, means }
    }
}

/// ∫ 2 μ E dμ = ∫ 4 x³ E dx, x = √μ, of the interpolation, by the midpoint rule.
#[cfg(test)]
fn mean(row: &[[f64; 2]], alpha: f64) -> [f64; 3] {
    const STEPS: u32 = 512;
    let mut sum = [0.0; 3];
    for step in 0..STEPS {
        let x = (f64::from(step) + 0.5) / f64::from(STEPS);
        let (k, share) = place(obliquity(x * x, alpha), OBLIQUITIES);
        let [a, b] = [0, 1].map(|c| row[k][c] * (1.0 - share) + row[k + 1][c] * share);
        for (sum, value) in sum.iter_mut().zip([a, b, lacking(a + b)]) {
            *sum += 4.0 * x.powi(3) * value;
        }
    }
    sum.map(|sum| sum / f64::from(STEPS))
}

/// The place in 0..=1 of knot `k` of `COUNT`.
#[cfg(test)]
fn knot<const COUNT: usize>(k: usize) -> f64 {
    k as f64 / (COUNT - 1) as f64
}

/// The albedo of one roughness, or of two at right angles.
#[derive(Debug, Clone, Copy)]
pub struct Albedo {
    rows: AlbedoRows,
    f0: f64,
    f90: f64,
}

/// Rows of a table, interpolated once.
#[derive(Debug, Clone, Copy)]
enum AlbedoRows {
    /// Of one roughness.
    Even { alpha: f64, row: usize, share: f64 },
    /// Of two.
    Brushed(brushed::Rows),
}

impl AlbedoRows {
    fn new(alpha: f64) -> Self {
        let (row, share) = place(alpha.max(0.0).sqrt().sqrt(), ROUGHNESSES);
        Self::Even { alpha, row, share }
    }

    fn terms(&self, w: DVec3) -> [f64; 2] {
        let (alpha, row, share) = match self {
            Self::Even { alpha, row, share } => (*alpha, *row, *share),
            Self::Brushed(rows) => return rows.terms(w),
        };
        let (k, part) = place(obliquity(w.z.max(0.0), alpha), OBLIQUITIES);
        let at = |row: usize, term: usize| {
            let entry = row * OBLIQUITIES + k;
            TABLE.entries[entry][term] * (1.0 - part) + TABLE.entries[entry + 1][term] * part
        };
        [0, 1].map(|term| at(row, term) * (1.0 - share) + at(row + 1, term) * share)
    }

    fn means(&self) -> [f64; 3] {
        match self {
            Self::Even { row, share, .. } => {
                let [own, next] = [*row, row + 1].map(|row| TABLE.means[row]);
                [0, 1, 2].map(|term| own[term] * (1.0 - share) + next[term] * share)
            }
            Self::Brushed(rows) => rows.means(),
        }
    }
}

impl Albedo {
    /// Of a sheet with roughness `alpha` (0..=1) and reflectances `f0` face on and `f90` grazing.
    #[must_use]
    pub fn new(alpha: impl Into<Facets>, f0: f64, f90: f64) -> Self {
        let facets = alpha.into();
        let rows = match facets.x.to_bits() == facets.y.to_bits() {
            true => AlbedoRows::new(facets.y),
            false => AlbedoRows::Brushed(brushed::Rows::new(facets)),
        };
        Self { rows, f0, f90 }
    }

    /// For a direction in the frame of the facets.
    #[must_use]
    pub fn at(&self, w: DVec3) -> f64 {
        self.of(self.terms(w))
    }

    /// From A and B of some direction, or their means.
    pub(super) fn of(&self, [a, b]: [f64; 2]) -> f64 {
        self.f0 * a + self.f90 * b
    }

    /// A and B for a direction. Their sum is what facets of reflectance 1 return.
    pub(super) fn terms(&self, w: DVec3) -> [f64; 2] {
        self.rows.terms(w)
    }

    /// The means over directions of A and B, and of what facets of reflectance 1 lack.
    pub(super) fn means(&self) -> [f64; 3] {
        self.rows.means()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[expect(clippy::disallowed_methods, reason = "a file of the source is made")]
    fn the_table_that_is_kept_is_the_one_that_is_made() {
        let (made, kept) = (AlbedoTable::new(), AlbedoTable::kept());
        let numbers = |table: &AlbedoTable| {
            [table.entries.as_flattened(), table.means.as_flattened()].concat()
        };
        let (made, kept) = (numbers(&made), numbers(&kept));
        if std::env::var_os("ETENDUE_GENERATE").is_some() {
            let path = concat!(env!("CARGO_MANIFEST_DIR"), "/src/bsdf/albedo.bin");
            let bytes: Vec<u8> = made.iter().flat_map(|number| number.to_le_bytes()).collect();
            std::fs::write(path, bytes).unwrap();
            return;
        }
        assert_eq!(made.len(), kept.len());
        for (made, kept) in made.iter().zip(&kept) {
            // Libraries' sines differ by a unit in the last place, and a thousand are summed.
            assert!((made - kept).abs() < 1e-12, "{made} {kept}");
        }
    }
}
