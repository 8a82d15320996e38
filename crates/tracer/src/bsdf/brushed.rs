//! Albedo of facets that are rougher along the surface than across it: [`super::albedo`]'s table with two more
//! axes, worked out once a surface asks for it.

use std::f64::consts::FRAC_PI_2;
use std::sync::LazyLock;

use etendue_geometry::glam::DVec3;

use super::ggx::Facets;
use super::split_sum::{EXACT, cosine, entry, obliquity, place};

/// Knots in the fourth root of the smaller α.
const ROUGHNESSES: usize = 16;

/// Knots in the anisotropy that takes the smaller α to the larger one, as glTF has it.
const STRENGTHS: usize = 9;

/// Knots in azimuth, from the rough axis to the other.
const AZIMUTHS: usize = 7;

/// Knots in [`obliquity`].
const OBLIQUITIES: usize = 32;

/// The least α of the table.
const SMOOTHEST: f64 = 1e-6;

/// Facets that each entry is averaged over.
const FACETS: u32 = 256;

/// Factor by which entries are raised, as the table is exact to less: so nothing returns more than falls in.
const MARGIN: f64 = 1.01;

/// Knots in roughness, strength, azimuth and obliquity.
const KNOTS: [usize; 4] = [ROUGHNESSES, STRENGTHS, AZIMUTHS, OBLIQUITIES];

#[derive(Debug)]
struct BrushedTable {
    /// (A, B), obliquity running fastest.
    entries: Vec<[f64; 2]>,
    /// Of (A, B) and of what facets of reflectance 1 lack, over all directions: roughness, then strength.
    means: Vec<[f64; 3]>,
}

static TABLE: LazyLock<BrushedTable> = LazyLock::new(BrushedTable::new);

fn knot(k: usize, count: usize) -> f64 {
    k as f64 / (count - 1) as f64
}

/// The larger α, from the smaller one and the anisotropy.
fn larger(alpha: f64, strength: f64) -> f64 {
    alpha + (1.0 - alpha) * strength * strength
}

/// The α by which facets are masked in an azimuth.
fn seen_alpha([x, y]: [f64; 2], azimuth: f64) -> f64 {
    (x * azimuth.cos()).hypot(y * azimuth.sin())
}

impl BrushedTable {
    fn new() -> Self {
        let mut table = Self { entries: Vec::new(), means: Vec::new() };
        for i in 0..ROUGHNESSES {
            for s in 0..STRENGTHS {
                let y = knot(i, ROUGHNESSES).powi(4).max(SMOOTHEST);
                let x = larger(y, knot(s, STRENGTHS));
                for a in 0..AZIMUTHS {
                    let azimuth = knot(a, AZIMUTHS) * FRAC_PI_2;
                    let seen = seen_alpha([x, y], azimuth);
                    table.entries.extend((0..OBLIQUITIES).map(|k| {
                        let mu = cosine(knot(k, OBLIQUITIES), seen).max(1e-12);
                        let sine = (1.0 - mu * mu).sqrt();
                        let wo = DVec3::new(sine * azimuth.cos(), sine * azimuth.sin(), mu);
                        let [a, b] = entry(wo, Facets { x, y }, FACETS);
                        let more = MARGIN.min(1.0 / (a + b).max(f64::MIN_POSITIVE)).max(1.0);
                        [a * more, b * more]
                    }));
                }
            }
        }
        for i in 0..ROUGHNESSES {
            for s in 0..STRENGTHS {
                let y = knot(i, ROUGHNESSES).powi(4).max(SMOOTHEST);
                let facets = Facets { x: larger(y, knot(s, STRENGTHS)), y };
                let mean = table.mean(facets);
                table.means.push(mean);
            }
        }
        table
    }

    /// ∫∫ 4 x³ E dx, x = √μ, over azimuths, by the midpoint rule.
    fn mean(&self, facets: Facets) -> [f64; 3] {
        const STEPS: [u32; 2] = [96, 12];
        let at = |step: u32, of: u32| (f64::from(step) + 0.5) / f64::from(of);
        let mut sum = [0.0; 3];
        for step in 0..STEPS[0] {
            let root = at(step, STEPS[0]);
            for turn in 0..STEPS[1] {
                let azimuth = at(turn, STEPS[1]) * FRAC_PI_2;
                let mu = root * root;
                let sine = (1.0 - mu * mu).sqrt();
                let w = DVec3::new(sine * azimuth.cos(), sine * azimuth.sin(), mu);
                let [a, b] = self.terms(&Rows::new(facets), w);
                let weight = 4.0 * root.powi(3) / f64::from(STEPS[0] * STEPS[1]);
                sum[0] += weight * a;
                sum[1] += weight * b;
                sum[2] += weight * (1.0 - EXACT - a - b).max(0.0);
            }
        }
        sum
    }

    fn terms(&self, rows: &Rows, w: DVec3) -> [f64; 2] {
        let (x, y) = if rows.is_turned { (w.y.abs(), w.x.abs()) } else { (w.x.abs(), w.y.abs()) };
        let azimuth = if x + y > 0.0 { y.atan2(x) } else { 0.0 };
        let turn = place(azimuth / FRAC_PI_2, AZIMUTHS);
        // Where the horizon begins follows from the azimuth itself.
        let seen = seen_alpha(rows.alphas, azimuth);
        let height = place(obliquity(w.z.max(0.0), seen), OBLIQUITIES);
        let places = [rows.rough, rows.strength, turn, height];
        let mut sum = [0.0; 2];
        for corner in 0..16_usize {
            let (mut index, mut weight) = (0, 1.0);
            for (axis, ((knot, share), count)) in places.into_iter().zip(KNOTS).enumerate() {
                let up = corner >> axis & 1;
                index = index * count + knot + up;
                weight *= if up == 1 { share } else { 1.0 - share };
            }
            let entry = self.entries[index];
            sum[0] += weight * entry[0];
            sum[1] += weight * entry[1];
        }
        sum
    }
}

/// Rows of the table for some facets, found once.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rows {
    rough: (usize, f64),
    strength: (usize, f64),
    /// The larger α and the smaller one.
    alphas: [f64; 2],
    /// They are rougher along y.
    is_turned: bool,
}

impl Rows {
    pub(super) fn new(Facets { x, y }: Facets) -> Self {
        let (larger, smaller) = (x.max(y), x.min(y).max(SMOOTHEST));
        let strength = ((larger - smaller) / (1.0 - smaller).max(SMOOTHEST)).max(0.0).sqrt();
        Self {
            rough: place(smaller.sqrt().sqrt(), ROUGHNESSES),
            strength: place(strength, STRENGTHS),
            alphas: [larger, smaller],
            is_turned: y > x,
        }
    }

    /// A and B for a direction in the frame of the facets.
    pub(super) fn terms(&self, w: DVec3) -> [f64; 2] {
        TABLE.terms(self, w)
    }

    /// The means of A and B, and of what facets of reflectance 1 lack.
    pub(super) fn means(&self) -> [f64; 3] {
        let ((i, across), (s, along)) = (self.rough, self.strength);
        let at = |i: usize, s: usize| TABLE.means[i * STRENGTHS + s];
        std::array::from_fn(|c| {
            let of = |i: usize| at(i, s)[c] * (1.0 - along) + at(i, s + 1)[c] * along;
            of(i) * (1.0 - across) + of(i + 1) * across
        })
    }
}
