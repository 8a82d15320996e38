//! Sheets of GGX facets over a matte base, many hits side by side: rough metal as [`super::metal`] has it, and
//! glTF's surfaces as [`super::layered`] has them without a coat, a sheen, a grain and transmission. Their
//! formulas are one: a metal is a sheet whose base is light that met several facets. Loops here vectorise: what is
//! looked up in the table of albedos is gathered apart.
#![expect(clippy::needless_range_loop, reason = "a lane is an index into many arrays")]

use std::f64::consts::PI;

use etendue_geometry::disk;

use super::albedo::{AlbedoTable, OBLIQUITIES, ROUGHNESSES, TABLE};
use super::metal::{mean_reflectance, multiple};
use super::split_sum::{lacking, obliquity};
use super::{Weights, fresnel};
use etendue_geometry::block::LANES;

/// The sheets of so many hits.
#[derive(Debug)]
pub(crate) struct Sheets<const N: usize = LANES> {
    /// The square of the roughness, above 0, and the share of metal.
    pub(crate) alpha: [f64; N],
    pub(crate) metallic: [f64; N],
    /// The dielectric's reflectance face on, before the highlights' colour, and at grazing incidence.
    pub(crate) f0: [f64; N],
    pub(crate) f90: [f64; N],
    /// The largest bands of the surface's colour, and of the dielectric's reflectance face on.
    pub(crate) base_peak: [f64; N],
    pub(crate) f0_peak: [f64; N],
    /// 1 for [`super::Model::Metal`], which chooses by what its facets return of white light.
    pub(crate) is_metal: [f64; N],
    /// The x and y axes of the shading frames, and the viewer in them.
    axes: [[[f64; N]; 3]; 2],
    wo: [[f64; N]; 3],
    /// Rows of the table and the shares of the next.
    rows: [u32; N],
    shares: [f64; N],
    /// Shares that facets of reflectance 1, and the dielectric, return of light from the viewer; their means over
    /// directions; the mean of what facets of reflectance 1 lack.
    facets: [f64; N],
    dielectric: [f64; N],
    pub(crate) mean: [f64; N],
    dielectric_mean: [f64; N],
    lacking: [f64; N],
    /// Chances of the facets and of the base.
    sheet: [f64; N],
    base: [f64; N],
    values: SheetValues<N>,
}

/// Directions to lights, one for each of so many hits.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LightSamples<'a, F, const N: usize = LANES> {
    /// Unit.
    pub(crate) toward: &'a [[F; N]; 3],
    /// The density with which each was chosen (1/sr); infinite where its light does not shine to there.
    pub(crate) pdf: &'a [F; N],
    /// 1 of a light that is of a single direction, else 0.
    pub(crate) is_delta: &'a [F; N],
}

/// Values times cosine, as [`Weights`], and densities.
#[derive(Debug)]
struct SheetValues<const N: usize> {
    white: [f64; N],
    base: [f64; N],
    highlight: [f64; N],
    dip: [f64; N],
    deep: [f64; N],
    pdf: [f64; N],
}

impl<const N: usize> Default for Sheets<N> {
    fn default() -> Self {
        Self {
            alpha: [0.0; N],
            metallic: [0.0; N],
            f0: [0.0; N],
            f90: [0.0; N],
            base_peak: [0.0; N],
            f0_peak: [0.0; N],
            is_metal: [0.0; N],
            axes: [[[0.0; N]; 3]; 2],
            wo: [[0.0; N]; 3],
            rows: [0; N],
            shares: [0.0; N],
            facets: [0.0; N],
            dielectric: [0.0; N],
            mean: [0.0; N],
            dielectric_mean: [0.0; N],
            lacking: [0.0; N],
            sheet: [0.0; N],
            base: [0.0; N],
            values: SheetValues {
                white: [0.0; N],
                base: [0.0; N],
                highlight: [0.0; N],
                dip: [0.0; N],
                deep: [0.0; N],
                pdf: [0.0; N],
            },
        }
    }
}

impl<const N: usize> Sheets<N> {
    /// The weights that were found last of a lane's value.
    #[inline(always)]
    pub(crate) fn weights(&self, lane: usize) -> Weights {
        let SheetValues { white, base, highlight, dip, deep, .. } = &self.values;
        Weights {
            white: white[lane],
            base: base[lane],
            highlight: highlight[lane],
            dip: dip[lane],
            deep: deep[lane],
            sheen: 0.0,
        }
    }

    /// As seen against `direction` (unit), with these shading normals on the viewer's side.
    pub(crate) fn view(&mut self, shading: &[[f64; N]; 3], direction: &[[f64; N]; 3]) {
        view(self, &TABLE, shading, direction);
    }

    /// Puts the share of light from directions to lights that the surfaces turn to the viewer into `share`, by the power
    /// heuristic against [`Self::scatter`], unless that light is of a single direction, and over the density: 0 where
    /// there is none, and to be multiplied by the weights.
    pub(crate) fn reflect(
        &mut self,
        [normal, shading]: [&[[f64; N]; 3]; 2],
        samples: LightSamples<'_, f64, N>,
        share: &mut [f64; N],
    ) {
        reflect(self, &TABLE, [normal, shading], samples, share);
    }

    /// Directions that light comes from, chosen in proportion to what it contributes by choices and squares, to
    /// `along`; their density to `pdf`, 0 where the light is lost, and value over density to the weights.
    pub(crate) fn scatter(
        &mut self,
        [normal, shading]: [&[[f64; N]; 3]; 2],
        choices: &[f64; N],
        squares: &[[f64; 2]; N],
        along: &mut [[f64; N]; 3],
        pdf: &mut [f64; N],
    ) {
        scatter(self, &TABLE, [normal, shading], choices, squares, along, pdf);
    }
}

/// The knot of `count` below `x` in 0..=1 and the share of the next, as [`super::split_sum::place`] has them.
#[inline(always)]
fn place(x: f64, count: usize) -> (u32, f64) {
    let x = if x > 0.0 { x } else { 0.0 };
    let scaled = if x < 1.0 { x } else { 1.0 } * (count - 1) as f64;
    let last = (count - 2) as f64;
    #[expect(clippy::cast_possible_truncation, reason = "in range")]
    let knot = if scaled < last { scaled } else { last } as i32;
    (knot.cast_unsigned(), scaled - f64::from(knot))
}

/// A and B for the cosines of some directions.
#[inline(always)]
fn terms<const N: usize>(
    sheets: &Sheets<N>,
    table: &AlbedoTable,
    cosines: &[f64; N],
) -> [[f64; N]; 2] {
    let (mut knots, mut parts) = ([0_u32; N], [0.0; N]);
    for i in 0..N {
        let mu = if cosines[i] > 0.0 { cosines[i] } else { 0.0 };
        (knots[i], parts[i]) = place(obliquity(mu, sheets.alpha[i]), OBLIQUITIES);
    }
    let mut both = [[0.0; N]; 2];
    for i in 0..N {
        let first = sheets.rows[i] as usize * OBLIQUITIES + knots[i] as usize;
        let all = &table.entries[first..first + OBLIQUITIES + 2];
        let (part, share) = (parts[i], sheets.shares[i]);
        for term in 0..2 {
            let along = |k: usize| all[k][term] * (1.0 - part) + all[k + 1][term] * part;
            both[term][i] = along(0) * (1.0 - share) + along(OBLIQUITIES) * share;
        }
    }
    both
}

#[multiversion::multiversion(targets = "simd")]
fn view<const N: usize>(
    sheets: &mut Sheets<N>,
    table: &AlbedoTable,
    shading: &[[f64; N]; 3],
    direction: &[[f64; N]; 3],
) {
    for i in 0..N {
        let (x, y, z) = (shading[0][i], shading[1][i], shading[2][i]);
        // Duff et al., "Building an Orthonormal Basis, Revisited", 2017.
        let sign = if z < 0.0 { -1.0 } else { 1.0 };
        let f = -1.0 / (sign + z);
        let g = x * y * f;
        let [u, v] = [[1.0 + sign * x * x * f, sign * g, -sign * x], [g, sign + y * y * f, -y]];
        for axis in 0..3 {
            sheets.axes[0][axis][i] = u[axis];
            sheets.axes[1][axis][i] = v[axis];
        }
        let along = |axis: [f64; 3]| {
            -(direction[0][i] * axis[0] + direction[1][i] * axis[1] + direction[2][i] * axis[2])
        };
        sheets.wo[0][i] = along(u);
        sheets.wo[1][i] = along(v);
        sheets.wo[2][i] = along([x, y, z]);
    }
    for i in 0..N {
        let root = sheets.alpha[i].sqrt().sqrt();
        (sheets.rows[i], sheets.shares[i]) = place(root, ROUGHNESSES);
    }
    let mut means = [[0.0; N]; 3];
    for i in 0..N {
        let row = sheets.rows[i] as usize;
        let [own, next] = [table.means[row], table.means[row + 1]];
        for term in 0..3 {
            means[term][i] = own[term] * (1.0 - sheets.shares[i]) + next[term] * sheets.shares[i];
        }
    }
    let [a, b] = terms(sheets, table, &sheets.wo[2]);
    for i in 0..N {
        let least = |x: f64| if x < 1.0 { x } else { 1.0 };
        let [mean_a, mean_b] = [means[0][i], means[1][i]];
        let (f0, f90) = (sheets.f0_peak[i], sheets.f90[i]);
        sheets.mean[i] = least(mean_a + mean_b);
        sheets.lacking[i] = means[2][i];
        sheets.dielectric_mean[i] = f0 * mean_a + f90 * mean_b;
        sheets.dielectric[i] = f0 * a[i] + f90 * b[i];
        sheets.facets[i] = least(a[i] + b[i]);
        // By what each part returns of a white light.
        let (m, peak, dielectric) =
            (sheets.metallic[i], sheets.base_peak[i], least(sheets.dielectric[i]));
        let sheet = m * (peak * a[i] + b[i]) + (1.0 - m) * dielectric;
        let deep = m * multiple(mean_reflectance(peak, 0.0), sheets.mean[i]);
        let base = (1.0 - m) * (1.0 - dielectric) * peak + deep * (1.0 - sheets.facets[i]);
        let is_metal = sheets.is_metal[i] > 0.0;
        let (sheet, base) =
            if is_metal { (sheets.facets[i], 1.0 - sheets.facets[i]) } else { (sheet, base) };
        let sum = if is_metal { 1.0 } else { sheet + base };
        let scale = if sum > 0.0 { 1.0 / sum } else { 0.0 };
        sheets.sheet[i] = sheet * scale;
        sheets.base[i] = base * scale;
    }
}

/// Values and densities for light from directions in the shading frames, above the surfaces.
#[inline(always)]
fn evaluate<const N: usize>(sheets: &mut Sheets<N>, table: &AlbedoTable, wi: &[[f64; N]; 3]) {
    let [a, b] = terms(sheets, table, &wi[2]);
    let Sheets { alpha, metallic, f0, f90, f0_peak, is_metal, wo, values, .. } = sheets;
    for i in 0..N {
        let [vx, vy, vz] = [wo[0][i], wo[1][i], wo[2][i]];
        let [lx, ly, lz] = [wi[0][i], wi[1][i], wi[2][i]];
        // Facets (`super::ggx`).
        let [hx, hy, hz] = [vx + lx, vy + ly, vz + lz];
        let inverse = 1.0 / (hx * hx + hy * hy + hz * hz).sqrt();
        let [hx, hy, hz] = [hx * inverse, hy * inverse, hz * inverse];
        let squared = alpha[i] * alpha[i];
        let e = (hx * hx + hy * hy) / squared + hz * hz;
        let d = 1.0 / (PI * squared * e * e) / (4.0 * vz);
        let lambda = |x: f64, y: f64, z: f64| {
            0.5 * ((1.0 + squared * (x * x + y * y) / (z * z)).sqrt() - 1.0)
        };
        let [seen, lit] = [lambda(vx, vy, vz), lambda(lx, ly, lz)];
        let value = d / (1.0 + seen + lit);
        let density = d / (1.0 + seen);
        let cosine = vx * hx + vy * hy + vz * hz;
        let w = fresnel::schlick_weight(cosine);
        let m = metallic[i];
        values.white[i] = (m * w + (1.0 - m) * f90[i] * w) * value;
        values.highlight[i] = (1.0 - m) * f0[i] * (1.0 - w) * value;
        values.dip[i] = -is_metal[i] * cosine * (1.0 - cosine) * w * value;
        // What is alike from all sides.
        let shown = lz / PI;
        let left = |returned: f64| if returned < 1.0 { 1.0 - returned } else { 0.0 };
        let passed = left(sheets.dielectric[i]) * left(f0_peak[i] * a[i] + f90[i] * b[i]);
        let below = 1.0 - sheets.dielectric_mean[i];
        let base = if below > 0.0 { (1.0 - m) * passed / below * shown } else { 0.0 };
        let several = lacking(sheets.facets[i]) * lacking(a[i] + b[i]) / sheets.lacking[i];
        values.deep[i] = if sheets.lacking[i] > 0.0 { m * several * shown } else { 0.0 };
        values.base[i] = m * (1.0 - w) * value + base;
        values.pdf[i] = sheets.base[i] * shown + sheets.sheet[i] * density;
    }
}

#[multiversion::multiversion(targets = "simd")]
fn reflect<const N: usize>(
    sheets: &mut Sheets<N>,
    table: &AlbedoTable,
    [normal, shading]: [&[[f64; N]; 3]; 2],
    LightSamples { toward, pdf, is_delta }: LightSamples<'_, f64, N>,
    share: &mut [f64; N],
) {
    let mut wi = [[0.0; N]; 3];
    let mut above = [0.0; N];
    for i in 0..N {
        let along = |axes: &[[f64; N]; 3]| {
            toward[0][i] * axes[0][i] + toward[1][i] * axes[1][i] + toward[2][i] * axes[2][i]
        };
        wi[0][i] = along(&sheets.axes[0]);
        wi[1][i] = along(&sheets.axes[1]);
        wi[2][i] = along(shading);
        above[i] = along(normal);
    }
    evaluate(sheets, table, &wi);
    for i in 0..N {
        let SheetValues { white, base, highlight, deep, pdf: own, .. } = &sheets.values;
        let is_seen = white[i] + base[i] + highlight[i] + deep[i] > 0.0;
        let faces = (sheets.wo[2][i] > 0.0) & (wi[2][i] > 0.0) & (above[i] >= 0.0);
        let ratio = own[i] / pdf[i];
        let balance = if is_delta[i] > 0.0 { 1.0 } else { 1.0 + ratio * ratio };
        let counts = is_seen & faces & (pdf[i] < f64::INFINITY);
        share[i] = if counts { 1.0 / (balance * pdf[i]) } else { 0.0 };
    }
}

#[multiversion::multiversion(targets = "simd")]
fn scatter<const N: usize>(
    sheets: &mut Sheets<N>,
    table: &AlbedoTable,
    [normal, shading]: [&[[f64; N]; 3]; 2],
    choices: &[f64; N],
    squares: &[[f64; 2]; N],
    along: &mut [[f64; N]; 3],
    pdf: &mut [f64; N],
) {
    let mut wi = [[0.0; N]; 3];
    for i in 0..N {
        // A facet's normal by its visible area, and the direction that it mirrors (`super::ggx`).
        let alpha = sheets.alpha[i];
        let [vx, vy, vz] = [sheets.wo[0][i], sheets.wo[1][i], sheets.wo[2][i]];
        let [sx, sy] = [alpha * vx, alpha * vy];
        let inverse = 1.0 / (sx * sx + sy * sy + vz * vz).sqrt();
        let [sx, sy, sz] = [sx * inverse, sy * inverse, vz * inverse];
        let [u, v] = squares[i];
        let (sine, cosine) = disk::turn(u);
        let z = (1.0 - v) * (1.0 + sz) - sz;
        let rest = 1.0 - z * z;
        let r = if rest > 0.0 { rest } else { 0.0 }.sqrt();
        let [hx, hy, hz] = [alpha * (r * cosine + sx), alpha * (r * sine + sy), z + sz];
        let hz = if hz > 0.0 { hz } else { 0.0 };
        let inverse = 1.0 / (hx * hx + hy * hy + hz * hz).sqrt();
        let [hx, hy, hz] = [hx * inverse, hy * inverse, hz * inverse];
        let twice = 2.0 * (vx * hx + vy * hy + vz * hz);
        let mirrored = [twice * hx - vx, twice * hy - vy, twice * hz - vz];
        // Or alike from all sides.
        let [x, y] = disk::point(squares[i]);
        let rest = 1.0 - x * x - y * y;
        let matte = [x, y, if rest > 0.0 { rest } else { 0.0 }.sqrt()];
        let is_mirrored = choices[i] < sheets.sheet[i];
        for axis in 0..3 {
            wi[axis][i] = if is_mirrored { mirrored[axis] } else { matte[axis] };
        }
    }
    evaluate(sheets, table, &wi);
    for i in 0..N {
        let [x, y, z] = [wi[0][i], wi[1][i], wi[2][i]];
        let world = |axis: usize| {
            sheets.axes[0][axis][i] * x + sheets.axes[1][axis][i] * y + shading[axis][i] * z
        };
        let [dx, dy, dz] = [world(0), world(1), world(2)];
        let inverse = 1.0 / (dx * dx + dy * dy + dz * dz).sqrt();
        along[0][i] = dx * inverse;
        along[1][i] = dy * inverse;
        along[2][i] = dz * inverse;
        let above = dx * normal[0][i] + dy * normal[1][i] + dz * normal[2][i];
        let SheetValues { white, base, highlight, dip, deep, pdf: own } = &mut sheets.values;
        let is_seen = white[i] + base[i] + highlight[i] + deep[i] > 0.0;
        let faces = (sheets.wo[2][i] > 0.0) & (z > 0.0) & (above >= 0.0);
        let is_chosen =
            (sheets.is_metal[i] > 0.0) | (choices[i] < sheets.sheet[i] + sheets.base[i]);
        let density = if is_seen & faces & is_chosen { own[i] } else { 0.0 };
        pdf[i] = density;
        let scale = if density > 0.0 { 1.0 / density } else { 0.0 };
        for value in [white, base, highlight, dip, deep] {
            value[i] *= scale;
        }
    }
}

#[cfg(test)]
mod tests;
