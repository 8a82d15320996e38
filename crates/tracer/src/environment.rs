//! Images of all directions, and directions by how bright they are.
//!
//! An image is a latitude–longitude map: its middle looks along −Z, its left and right edges along
//! +Z, its top to +Y, and +X is right of the middle.

mod sampler;

use std::path::Path;

use etendue_geometry::glam::DVec3;
use etendue_image::Limits;

use crate::angles;
use crate::spectral_sky::{self, Spectrum};
use crate::texture::{ImageError, read_file, read_image};
use crate::tint::BRIGHTEST;
use crate::{Color, Cube};
use etendue_geometry::Float;

pub(crate) use sampler::MapLookup;
pub use sampler::MapSampler;

/// The most cells of the grid that directions are chosen on, across and down. Not a setting: within a cell texels are
/// met evenly and weighed by their own light, so that more cells change the noise of maps above this size alone.
const CELLS: [usize; 2] = [2048, 1024];

/// Radiance from all directions.
#[derive(Debug, Clone)]
pub struct EnvironmentMap {
    width: usize,
    height: usize,
    /// Linear RGB, row 0 at the top.
    texels: Vec<[f32; 3]>,
    /// The same at the wavelengths of a clear sky; empty where the map has colours alone.
    spectra: Vec<[f32; spectral_sky::COUNT]>,
    /// The largest colour of a texel.
    pub(crate) peak: f32,
    /// The largest of any texel at each of those wavelengths.
    pub(crate) spectral_peaks: Spectrum,
    /// Texels that were not finite, below zero or above [`BRIGHTEST`], and count as black.
    pub dropped: u64,
}

impl EnvironmentMap {
    /// Bytes of a texel that is looked at, and of the cell of the table that directions are chosen by.
    pub const LOOK_BYTES: u64 = (size_of::<[f32; 3]>() + 2 * size_of::<f64>()) as u64;

    /// Reads an HDR, EXR, PNG or JPEG file. 8- and 16-bit images are taken for sRGB.
    ///
    /// # Errors
    ///
    /// When the file cannot be read or decoded, or is over `limits`.
    pub fn read(path: &Path, limits: Limits) -> Result<Self, ImageError> {
        let name = path.display().to_string();
        let bytes = read_file(path)?;
        let raster = read_image(&name, &bytes, limits)?;
        drop(bytes);
        let linear = |i| {
            let [r, g, b, _] = raster.linear(i);
            #[expect(clippy::cast_possible_truncation, reason = "radiance is kept as f32")]
            [r, g, b].map(|c| c as f32)
        };
        Ok(Self::new(raster.size(), (0..raster.len()).map(linear).collect()))
    }

    /// Look of a cube of light from all directions.
    #[must_use]
    pub fn of_cube(cube: &Cube) -> Self {
        Self::new(cube.size(), cube.looks().to_vec())
    }

    /// From linear RGB, row by row from the top.
    #[must_use]
    pub fn new([width, height]: [usize; 2], mut texels: Vec<[f32; 3]>) -> Self {
        texels.resize(width * height, [0.0; 3]);
        let mut dropped = 0;
        for texel in &mut texels {
            let is_sound = |c: f32| (0.0..=BRIGHTEST).contains(&f64::from(c));
            if !texel.iter().all(|c| is_sound(*c)) {
                *texel = texel.map(|c| if is_sound(c) { c } else { 0.0 });
                dropped += 1;
            }
        }
        let peak = texels.iter().flatten().copied().fold(0.0, f32::max);
        let (spectra, spectral_peaks) = (Vec::new(), [0.0; spectral_sky::COUNT]);
        Self { width, height, texels, spectra, peak, spectral_peaks, dropped }
    }

    /// The same with the spectra of a clear sky, as many as there are texels.
    pub(crate) fn with_spectra(mut self, spectra: Vec<[f32; spectral_sky::COUNT]>) -> Self {
        if spectra.len() == self.texels.len() {
            for spectrum in &spectra {
                for (peak, value) in self.spectral_peaks.iter_mut().zip(spectrum) {
                    *peak = peak.max(f64::from(*value));
                }
            }
            self.spectra = spectra;
        }
        self
    }

    /// The studio that lights a model which brings no light of its own: a bright grey sky, a darker floor, and a
    /// large soft lamp up on the left before the model.
    #[must_use]
    pub fn studio() -> Self {
        let (width, height) = (256, 128);
        let area_light = DVec3::new(-0.6, 0.7, 0.55).normalize();
        let texels = (0..width * height)
            .map(|k| {
                let at = |i: usize, n: usize| (i as f64 + 0.5) / n as f64;
                let d = direction([at(k % width, width), at(k / width, height)]);
                let sky = 0.3 + 0.2 * d.y;
                let glow = (6.0 * (d.dot(area_light) - 0.82)).clamp(0.0, 1.0);
                #[expect(clippy::cast_possible_truncation, reason = "radiance is kept as f32")]
                let value = (sky + 4.0 * glow * glow * (3.0 - 2.0 * glow)) as f32;
                [value, value, value]
            })
            .collect();
        Self::new([width, height], texels)
    }

    /// Bytes of the texels.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.texels) + size_of_val(&*self.spectra)
    }

    /// Columns and rows.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// Radiance at a [`place`].
    pub(crate) fn radiance_at(&self, at: [f64; 2]) -> Color {
        self.interpolated(&self.texels, at)
    }

    /// The texels of these numbers.
    #[inline(always)]
    fn texels_at<const N: usize>(&self, numbers: &[[u32; N]; 4]) -> CornerTexels<N> {
        let mut taken = [[[0.0_f32; N]; 3]; 4];
        for (taken, numbers) in taken.iter_mut().zip(numbers) {
            for i in 0..N {
                let texel = self.texels[numbers[i] as usize];
                (taken[0][i], taken[1][i], taken[2][i]) = (texel[0], texel[1], texel[2]);
            }
        }
        CornerTexels(taken)
    }

    /// Radiance at a [`place`] and the wavelengths of a clear sky; 0 of a map that has colours alone.
    pub(crate) fn spectrum_at(&self, at: [f64; 2]) -> Spectrum {
        self.interpolated(&self.spectra, at)
    }

    /// Looks up texels of some bands, `[row][column][band]`, at a [`place`]: each of `out`, which are as many as a
    /// texel has.
    pub(crate) fn bands_at(&self, texels: &[f32], [u, v]: [f64; 2], out: &mut [f64]) {
        let count = out.len();
        let about = Corners::<f64, 1>::of([[u], [v]], self.size());
        let corners = about.numbers.map(|[number]| &texels[number as usize * count..][..count]);
        let at = [about.across[0], about.down[0]];
        for (i, out) in out.iter_mut().enumerate() {
            *out = between(corners.map(|texel| f64::from(texel[i])), at);
        }
    }

    /// Values of texels at a [`place`].
    fn interpolated<const N: usize>(&self, texels: &[[f32; N]], [u, v]: [f64; 2]) -> [f64; N] {
        if texels.is_empty() {
            return [0.0; N];
        }
        let about = Corners::<f64, 1>::of([[u], [v]], self.size());
        let corners = about.numbers.map(|[number]| &texels[number as usize]);
        let at = [about.across[0], about.down[0]];
        std::array::from_fn(|k| between(corners.map(|texel| f64::from(texel[k])), at))
    }
}

/// The texels about each of some places, by corner and colour.
struct CornerTexels<const N: usize>([[[f32; N]; 3]; 4]);

impl<const N: usize> CornerTexels<N> {
    /// Brightness of each.
    #[inline(always)]
    fn bright<F: Float>(&self) -> [[F; N]; 4] {
        let mut bright = [[F::ZERO; N]; 4];
        for (bright, [r, g, b]) in bright.iter_mut().zip(&self.0) {
            for i in 0..N {
                bright[i] = mean([r[i].into(), g[i].into(), b[i].into()]);
            }
        }
        bright
    }

    /// The colours of places that are so far, across and down, from the first, a row a colour.
    #[inline(always)]
    #[expect(clippy::needless_range_loop, reason = "a colour is an index into many arrays")]
    fn between<F: Float>(&self, [across, down]: [&[F; N]; 2]) -> [[F; N]; 3] {
        let mut colors = [[F::ZERO; N]; 3];
        for k in 0..3 {
            for i in 0..N {
                let [a, b, c, d] =
                    [self.0[0][k][i], self.0[1][k][i], self.0[2][k][i], self.0[3][k][i]];
                let corners = [F::from(a), F::from(b), F::from(c), F::from(d)];
                colors[k][i] = between(corners, [across[i], down[i]]);
            }
        }
        colors
    }
}

/// The mean of three colours.
#[inline(always)]
fn mean<F: Float>([r, g, b]: [F; 3]) -> F {
    (r + g + b) / F::of(3.0)
}

/// Places worked on side by side.
const LANES: usize = 16;

/// Value between four corners: left and right above, and below.
#[inline(always)]
fn between<F: Float>([a, b, c, d]: [F; 4], [across, down]: [F; 2]) -> F {
    let [left, right] = [a + (c - a) * down, b + (d - b) * down];
    left + (right - left) * across
}

/// The cells of a grid whose middles are about each of some places, and how far each place is from the first of
/// them. Columns go around; there are no more rows above the first and below the last.
#[derive(Debug)]
struct Corners<F, const N: usize> {
    /// Left and right above, and below.
    numbers: [[u32; N]; 4],
    across: [F; N],
    down: [F; N],
    /// The row below, from 0 to as many as there are.
    row: [u32; N],
}

impl<F: Float, const N: usize> Corners<F, N> {
    /// Of a grid of `columns` and `rows`, neither of which is 0.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "sides of images have 32 bits")]
    fn of([u, v]: [[F; N]; 2], [columns, rows]: [usize; 2]) -> Self {
        let (wide, high) = (F::of(columns as f64), F::of(rows as f64));
        let [columns, rows] = [columns as u32, rows as u32];
        let (mut numbers, mut row) = ([[0; N]; 4], [0; N]);
        let [mut across, mut down] = [[F::ZERO; N]; 2];
        for i in 0..N {
            let (x, right) = whole(u[i] * wide + F::of(0.5));
            let (y, below) = whole(v[i] * high + F::of(0.5));
            (across[i], down[i]) = (x, y);
            let (right, below) = (right.min(columns), below.min(rows));
            row[i] = below;
            let left = if right == 0 { columns - 1 } else { right - 1 };
            let right = if right == columns { 0 } else { right };
            let above = below.saturating_sub(1) * columns;
            let below = below.min(rows - 1) * columns;
            numbers[0][i] = above + left;
            numbers[1][i] = above + right;
            numbers[2][i] = below + left;
            numbers[3][i] = below + right;
        }
        Self { numbers, across, down, row }
    }

    /// Distance of the places from the first cell, across and down.
    #[inline(always)]
    fn within(&self) -> [&[F; N]; 2] {
        [&self.across, &self.down]
    }
}

/// Fraction of a number of at least 0, and the whole number before it.
#[inline(always)]
fn whole<F: Float>(x: F) -> (F, u32) {
    let (nearest, bits) = x.nearest();
    let is_above = nearest > x;
    let below = if is_above { nearest - F::of(1.0) } else { nearest };
    (x - below, bits - u32::from(is_above))
}

/// Places (u, v) in 0..1 of a map for a unit direction.
pub(crate) fn place(d: DVec3) -> [f64; 2] {
    angles::places(&[[d.x], [d.y], [d.z]]).map(|[place]| place)
}

/// The direction of a place.
fn direction([u, v]: [f64; 2]) -> DVec3 {
    let ([[x], [y], [z]], _) = angles::directions(&[[u], [v]]);
    DVec3::new(x, y, z)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::sampling::GridCell;

    /// A direction, and what a map has there.
    struct Lit {
        direction: DVec3,
        place: [f64; 2],
        /// 1/sr.
        density: f64,
        color: Color,
    }

    impl Lit {
        /// The first so many of some lanes.
        fn of_lanes(lit: &MapLookup<f64, LANES>, count: usize) -> Vec<Self> {
            let MapLookup { directions: [x, y, z], places: [u, v], densities, colors: [r, g, b] } =
                lit;
            let lane = |i: usize| Self {
                direction: DVec3::new(x[i], y[i], z[i]),
                place: [u[i], v[i]],
                density: densities[i],
                color: [r[i], g[i], b[i]],
            };
            (0..count).map(lane).collect()
        }
    }

    /// Directions by their brightness, for each of `squares`.
    fn sampled(sampler: &MapSampler, map: &EnvironmentMap, squares: &[[f64; 2]]) -> Vec<Lit> {
        let mut cells = Vec::new();
        sampler.cells(squares.iter().copied(), &mut cells);
        let some = |cells: &[GridCell]| {
            let mut patches = [GridCell::default(); LANES];
            patches[..cells.len()].copy_from_slice(cells);
            Lit::of_lanes(&sampler.in_patches(map, &patches), cells.len())
        };
        cells.chunks(LANES).flat_map(some).collect()
    }

    /// What a map has in each of some unit directions.
    fn looked_up(sampler: &MapSampler, map: &EnvironmentMap, directions: &[DVec3]) -> Vec<Lit> {
        let some = |some: &[DVec3]| {
            let mut rows = [[0.0; LANES]; 3];
            for (i, d) in some.iter().enumerate() {
                (rows[0][i], rows[1][i], rows[2][i]) = (d.x, d.y, d.z);
            }
            Lit::of_lanes(&sampler.in_directions(map, rows), some.len())
        };
        directions.chunks(LANES).flat_map(some).collect()
    }

    /// The density (1/sr) of one direction.
    fn pdf(sampler: &MapSampler, map: &EnvironmentMap, d: DVec3) -> f64 {
        let [density] = sampler.in_directions(map, [[d.x], [d.y], [d.z]]).densities;
        density
    }

    fn radiance(map: &EnvironmentMap, d: DVec3) -> Color {
        map.radiance_at(place(d))
    }

    #[test]
    fn places_and_directions_are_inverse() {
        assert!((direction([0.5, 0.5]) - DVec3::NEG_Z).length() < 1e-15);
        assert!((direction([0.75, 0.5]) - DVec3::X).length() < 1e-15);
        assert!((direction([0.3, 0.0]) - DVec3::Y).length() < 1e-15);
        for d in [DVec3::new(0.3, -0.4, 0.5).normalize(), DVec3::new(-0.9, 0.1, -0.2).normalize()] {
            assert!((direction(place(d)) - d).length() < 1e-14);
        }
    }

    #[test]
    fn densities_integrate_to_one_and_follow_the_light() {
        let mut texels = vec![[0.1_f32; 3]; 64 * 32];
        texels[10 * 64 + 20] = [500.0; 3];
        let map = EnvironmentMap::new([64, 32], texels);
        let sampler = MapSampler::new(&map);
        let (mut integral, mut mean, n) = (0.0, 0.0, 512);
        for k in 0..n * n {
            let square = [((k % n) as f64 + 0.5) / n as f64, ((k / n) as f64 + 0.5) / n as f64];
            let d = crate::sampling::sphere_direction(square);
            integral += pdf(&sampler, &map, d) * 4.0 * PI / (n * n) as f64;
            mean += radiance(&map, d)[0] / (n * n) as f64;
        }
        // A bright texel is 16 × 16 points wide here: its edges are met to one in sixteen of 1 − ε.
        assert!((integral - 1.0).abs() < 0.02, "{integral}");
        assert!((sampler.mean / mean - 1.0).abs() < 0.02, "{} {mean}", sampler.mean);
        let bright = direction([20.5 / 64.0, 10.5 / 32.0]);
        assert!(pdf(&sampler, &map, bright) > 50.0 * pdf(&sampler, &map, DVec3::X));
    }

    /// A map of 64 by 32 texels that differ, one of them a sun.
    fn sunny() -> EnvironmentMap {
        let value =
            |k: u32| if k == 661 { 3e3 } else { f32::from(u16::try_from(k * 37 % 101).unwrap()) };
        let texel = |k| [value(k) / 50.0; 3];
        EnvironmentMap::new([64, 32], (0..64 * 32).map(texel).collect())
    }

    #[test]
    fn places_have_the_density_that_is_stated() {
        let map = sunny();
        let sampler = MapSampler::new(&map);
        let n = 1_000;
        let at = |k: i32| (f64::from(k) + 0.5) / f64::from(n);
        let squares: Vec<_> = (0..n * n).map(|k| [at(k % n), at(k / n)]).collect();
        let mut sum = 0.0;
        for Lit { direction, place: [u, _], density, .. } in sampled(&sampler, &map, &squares) {
            assert!((pdf(&sampler, &map, direction) / density - 1.0).abs() < 1e-9);
            sum += u / density / (2.0 * PI * PI) / f64::from(n * n);
        }
        // The integral of u sin πv over the square is 1/π. Most places are in the sun; the others are some 300 by
        // 300, of 64 by 33 patches: the midpoint rule leaves about a thousandth.
        assert!((PI * sum - 1.0).abs() < 3e-3, "{}", PI * sum);
    }

    /// Light over density is the same wherever it comes from, as far as the sphere is as wide all over a row.
    #[test]
    fn each_direction_is_worth_the_same() {
        let map = sunny();
        let sampler = MapSampler::new(&map);
        let at = |i: u32| (f64::from(i) + 0.5) / 200.0;
        let squares: Vec<_> = (0..40_000).map(|k| [at(k % 200), at(k / 200)]).collect();
        let whole = 4.0 * PI * sampler.mean;
        for Lit { direction: d, density, color, .. } in sampled(&sampler, &map, &squares) {
            assert!((radiance(&map, d)[0] / color[0] - 1.0).abs() < 1e-9);
            let worth = color[0] / density;
            // Half a row of 32 is 0.05 radians, by which the sine changes by less than that over its tangent.
            let bound = 0.05 * d.y.abs() / (1.0 - d.y * d.y).sqrt() + 0.01;
            assert!((worth / whole - 1.0).abs() < bound, "{worth} of {whole} from {d}");
        }
    }

    /// Lookups in lanes are lookups alone, at the poles, the seam, and for maps of a texel's
    /// width.
    #[test]
    fn lanes_are_lookups_one_by_one() {
        let small = EnvironmentMap::new([1, 2], vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
        let texel = |k: u16| [1.0, 2.0, f32::from(k % 97)];
        // Of more columns than there are cells, and of a table of its own.
        let wide = EnvironmentMap::new([4096, 4], (0..4 * 4096).map(texel).collect());
        let bright = |map: &EnvironmentMap| {
            MapSampler::by_brightness(map.size(), map.texels.iter().map(|texel| texel[2].into()))
        };
        let maps =
            [(sunny(), None), (sunny(), Some(bright(&sunny()))), (small, None), (wide, None)];
        for (map, sampler) in maps {
            let sampler = sampler.unwrap_or_else(|| MapSampler::new(&map));
            let at = |k: u32, n: u32| (f64::from(k) + 0.5) / f64::from(n);
            let squares: Vec<_> = (0..500).map(|k| [at(k, 500), at(k % 23, 23)]).collect();
            for Lit { direction: d, density, color, .. } in sampled(&sampler, &map, &squares) {
                // Directions are as good as f64, and so is where they are between texels.
                let expected = pdf(&sampler, &map, d);
                assert!((density / expected - 1.0).abs() < 1e-9, "{d}: {density} {expected}");
                for (color, expected) in color.iter().zip(radiance(&map, d)) {
                    assert!((color - expected).abs() < 1e-9 * expected, "{d}: {color} {expected}");
                }
            }
            let axes = [DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z, DVec3::X];
            let seam = [1e-17, -1e-17, 0.0, -0.0].map(|x| DVec3::new(x, 0.0, 1.0));
            let others =
                (0..500).map(|k| direction([f64::from(k) / 499.0, f64::from(k % 23) / 22.0]));
            let asked: Vec<DVec3> = axes.into_iter().chain(seam).chain(others).collect();
            for (d, lit) in asked.iter().copied().zip(looked_up(&sampler, &map, &asked)) {
                assert_eq!(lit.place, place(d));
                assert_eq!(lit.color, radiance(&map, d), "{d}");
                assert_eq!(lit.density, pdf(&sampler, &map, d), "{d}");
            }
        }
    }

    #[test]
    fn what_is_no_radiance_is_dropped_and_counted() {
        let map =
            EnvironmentMap::new([2, 1], vec![[f32::NAN, 1.0, -3.0], [f32::INFINITY, 0.0, 2.0]]);
        assert_eq!(map.dropped, 2);
        assert!(radiance(&map, DVec3::X).iter().all(|c| c.is_finite()));
    }
}
