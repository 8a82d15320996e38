//! How far hits are from the reference's.

use etendue_accel::Accel;
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Detail, HitBatch, RayBatch};
use rayon::prelude::*;
use serde::Serialize;

/// What a batch of rays hit, one entry a batch.
pub type Hits = Vec<HitBatch>;

/// The closest hits of all `batches` with their normals, on the threads of the current pool.
#[must_use]
pub fn trace(accel: &dyn Accel, batches: &[RayBatch]) -> Hits {
    let closest = |rays| {
        let mut hits = HitBatch::new(Detail::Surface);
        accel.closest(rays, &mut hits);
        hits
    };
    batches.par_iter().map(closest).collect()
}

/// Hits whose distances differ by no more than this share of them are in one place: the rounding of
/// f64 over the cosine of incidence of rays that graze a surface at a quarter of a degree.
const TIE: f64 = 1e-13;

/// The reference's hits whose barycentric coordinates are as near to an edge are on it.
const ON_EDGE: f64 = 1e-9;

/// Beside an edge that is hit, its triangles are in one place to the accuracy of distances in f32.
const TIE_ON_EDGE: f64 = 1e-4;

/// What hits get wrong.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HitErrors {
    /// Rays that were compared.
    pub rays: u64,
    /// Rays that hit something, by the reference.
    pub hits: u64,
    /// Rays that should have hit something and did not.
    pub missed: u64,
    /// Rays that should have hit nothing and did.
    pub false_hits: u64,
    /// Rays that hit another triangle than by the reference, elsewhere.
    pub wrong_triangle: u64,
    /// Rays that hit another triangle where two meet, or that lies in the very same place: which one it
    /// is is anybody's choice.
    pub ties: u64,
    /// Of rays that hit something by both: by how much the distance is off (m).
    pub distance: Option<Quantiles>,
    /// The same as a share of the distance.
    pub relative_distance: Option<Quantiles>,
    /// The angle between geometric normals (degrees).
    pub normal_angle: Option<Quantiles>,
}

/// Errors of many rays in three numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Quantiles {
    /// Half of the rays have no more.
    pub median: f64,
    /// 99.9 % of the rays have no more.
    pub p999: f64,
    /// No ray has more.
    pub max: f64,
}

impl Quantiles {
    /// Of `values`; `None` when there are none.
    #[must_use]
    pub fn of(mut values: Vec<f64>) -> Option<Self> {
        values.sort_unstable_by(f64::total_cmp);
        let last = values.len().checked_sub(1)?;
        // The least value that so many are not above.
        let at = |per_mille: usize| values[(values.len() * per_mille).div_ceil(1000).max(1) - 1];
        Some(Self { median: at(500), p999: at(999), max: values[last] })
    }
}

impl HitErrors {
    /// Compares the hits of the same rays, in whatever batches they came.
    #[must_use]
    pub fn of(hits: &[HitBatch], reference: &[HitBatch]) -> Self {
        let mut errors = Self {
            rays: 0,
            hits: 0,
            missed: 0,
            false_hits: 0,
            wrong_triangle: 0,
            ties: 0,
            distance: None,
            relative_distance: None,
            normal_angle: None,
        };
        let [mut distance, mut relative, mut angle] = [const { Vec::new() }; 3];
        for ((a, i), (b, j)) in each(hits).zip(each(reference)) {
            errors.rays += 1;
            errors.hits += u64::from(b.is_hit(j));
            // Hits of nearly one distance are ties, and no wrong triangles.
            match (a.is_hit(i), b.is_hit(j)) {
                (false, true) => errors.missed += 1,
                (true, false) => errors.false_hits += 1,
                (false, false) => {}
                (true, true) => {
                    let same = [a.placement[i], a.triangle[i]] == [b.placement[j], b.triangle[j]];
                    let off = (a.t[i] - b.t[j]).abs();
                    let share = if off == 0.0 { 0.0 } else { off / b.t[j] };
                    let tie = if is_on_edge(b, j) { TIE_ON_EDGE } else { TIE };
                    errors.ties += u64::from(!same && share <= tie);
                    errors.wrong_triangle += u64::from(!same && share > tie);
                    distance.push(off);
                    relative.push(share);
                    angle.push(degrees(a.normal(i), b.normal(j)));
                }
            }
        }
        errors.distance = Quantiles::of(distance);
        errors.relative_distance = Quantiles::of(relative);
        errors.normal_angle = Quantiles::of(angle);
        errors
    }

    /// Rays with a wrong answer: missed, false, or of another triangle.
    #[must_use]
    pub fn wrong(&self) -> u64 {
        self.missed + self.false_hits + self.wrong_triangle
    }

    /// The share of rays with a wrong answer; 0 without rays.
    #[must_use]
    pub fn wrong_share(&self) -> f64 {
        self.wrong() as f64 / self.rays.max(1) as f64
    }
}

/// Every hit with its place in its batch.
fn each(hits: &[HitBatch]) -> impl Iterator<Item = (&HitBatch, usize)> {
    hits.iter().flat_map(|batch| (0..batch.len()).map(move |i| (batch, i)))
}

fn is_on_edge(hits: &HitBatch, i: usize) -> bool {
    let (u, v) = (hits.u[i], hits.v[i]);
    u.min(v).min(1.0 - u - v) <= ON_EDGE
}

/// The angle between two directions, accurate for small angles too (W. Kahan, "How futile are
/// mindless assessments of roundoff in floating-point computation?", 2006, §12).
fn degrees(a: DVec3, b: DVec3) -> f64 {
    if a == b {
        return 0.0;
    }
    2.0 * (a - b).length().atan2((a + b).length()).to_degrees()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Hits at `t`, of triangle 0; infinity is a miss.
    fn hits(t: &[f64]) -> HitBatch {
        let mut hits = HitBatch::new(Detail::Surface);
        hits.reset(t.len());
        for (i, &t) in t.iter().enumerate().filter(|(_, t)| t.is_finite()) {
            (hits.t[i], hits.placement[i], hits.triangle[i]) = (t, 0, 0);
            hits.normal[2][i] = 1.0;
        }
        hits
    }

    #[test]
    fn each_kind_of_fault_is_counted_once() {
        let none = f64::INFINITY;
        let reference = [hits(&[1.0, 2.0, none]), hits(&[none, 4.0])];
        let mut found = hits(&[1.0, none, 3.0, none, 4.5]);
        (found.triangle[0], found.triangle[4]) = (7, 9);
        (found.normal[2][4], found.normal[0][4]) = (0.0, 1.0);
        let errors = HitErrors::of(&[found], &reference);
        assert_eq!([errors.rays, errors.hits], [5, 3]);
        assert_eq!([errors.missed, errors.false_hits, errors.wrong_triangle], [1, 1, 1]);
        assert_eq!(errors.ties, 1, "in the same place");
        assert_eq!(errors.wrong_share(), 0.6);
        assert_eq!(errors.distance.unwrap(), Quantiles { median: 0.0, p999: 0.5, max: 0.5 });
        assert_eq!(errors.relative_distance.unwrap().max, 0.125);
        assert_eq!(errors.normal_angle.unwrap().max, 90.0);
    }

    #[test]
    fn quantiles_are_of_the_sorted_values() {
        let values = (1..=2000).rev().map(f64::from).collect();
        let quantiles = Quantiles::of(values).unwrap();
        assert_eq!(quantiles, Quantiles { median: 1000.0, p999: 1998.0, max: 2000.0 });
        assert_eq!(Quantiles::of(vec![7.0]).unwrap().p999, 7.0);
        assert_eq!(Quantiles::of(Vec::new()), None);
    }

    #[test]
    fn small_angles_are_not_lost() {
        let angle = 1e-9f64;
        let turned = DVec3::new(angle.sin(), 0.0, angle.cos());
        let found = degrees(DVec3::Z, turned);
        // Directions are rounded to 1e-16, a ten-millionth of this angle.
        assert!((found / angle.to_degrees() - 1.0).abs() < 1e-6, "{found}");
    }
}
