//! Images of all directions, and directions by how bright they are.
//!
//! An image is a latitude–longitude map: its middle looks along −Z, its left and right edges along
//! +Z, its top to +Y, and +X is right of the middle.

use std::f64::consts::{PI, TAU};
use std::path::Path;

use etendue_geometry::glam::DVec3;
use etendue_image::Limits;

use crate::Color;
use crate::sampling::{GridCell, GridDistribution, ONE_BELOW, linear_place};
use crate::spec::BRIGHTEST;
use crate::spectral_sky::{self, Spectrum};
use crate::texture::{ImageError, read_file, read_image};

/// The most cells of the grid that directions are chosen on, across and down.
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
    /// Texels that were not finite, below zero or above [`BRIGHTEST`], and count as black.
    pub dropped: u64,
}

impl EnvironmentMap {
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
        Self { width, height, texels, spectra: Vec::new(), dropped }
    }

    /// The same with the spectra of a clear sky, as many as there are texels.
    pub(crate) fn with_spectra(mut self, spectra: Vec<[f32; spectral_sky::COUNT]>) -> Self {
        if spectra.len() == self.texels.len() {
            self.spectra = spectra;
        }
        self
    }

    /// What lights a model that brings no light of its own: a bright grey sky, a darker floor, and a
    /// large soft lamp up on the left before the model.
    #[must_use]
    pub fn studio() -> Self {
        let (width, height) = (256, 128);
        let lamp = DVec3::new(-0.6, 0.7, 0.55).normalize();
        let texels = (0..width * height)
            .map(|k| {
                let at = |i: usize, n: usize| (i as f64 + 0.5) / n as f64;
                let d = direction([at(k % width, width), at(k / width, height)]);
                let sky = 0.3 + 0.2 * d.y;
                let glow = (6.0 * (d.dot(lamp) - 0.82)).clamp(0.0, 1.0);
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

    /// Radiance from the unit direction `d`, interpolated.
    #[must_use]
    pub fn radiance(&self, d: DVec3) -> Color {
        self.radiance_at(place(d))
    }

    /// Radiance at a [`place`].
    pub(crate) fn radiance_at(&self, at: [f64; 2]) -> Color {
        self.interpolated(&self.texels, at)
    }

    /// Radiance at a [`place`] and the wavelengths of a clear sky, where the map has them.
    pub(crate) fn spectrum_at(&self, at: [f64; 2]) -> Option<Spectrum> {
        (!self.spectra.is_empty()).then(|| self.interpolated(&self.spectra, at))
    }

    /// Values of texels at a [`place`].
    fn interpolated<const N: usize>(&self, texels: &[[f32; N]], [u, v]: [f64; 2]) -> [f64; N] {
        if texels.is_empty() {
            return [0.0; N];
        }
        let (x, y) = (u * self.width as f64 - 0.5, v * self.height as f64 - 0.5);
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = (x - x0, y - y0);
        let texel = |x: f64, y: f64| &texels[self.number(x, y)];
        let [a, b] = [texel(x0, y0), texel(x0 + 1.0, y0)];
        let [c, d] = [texel(x0, y0 + 1.0), texel(x0 + 1.0, y0 + 1.0)];
        std::array::from_fn(|k| {
            let top = f64::from(a[k]) * (1.0 - fx) + f64::from(b[k]) * fx;
            let bottom = f64::from(c[k]) * (1.0 - fx) + f64::from(d[k]) * fx;
            top * (1.0 - fy) + bottom * fy
        })
    }

    /// The number of the texel of a column from −1 to the width, around, and of a row, of which there are no more
    /// above the first and below the last.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "wrapped, clamped")]
    fn number(&self, x: f64, y: f64) -> usize {
        let width = self.width as f64;
        let around = if x < 0.0 { x + width } else { x };
        let column = if around >= width { around - width } else { around } as usize;
        let row = y.clamp(0.0, (self.height - 1) as f64) as usize;
        row * self.width + column.min(self.width - 1)
    }
}

/// Places (u, v) in 0..1 of a map for a unit direction.
pub(crate) fn place(d: DVec3) -> [f64; 2] {
    [0.5 + d.x.atan2(-d.z) / TAU, d.y.clamp(-1.0, 1.0).acos() / PI]
}

/// The direction of a place.
fn direction([u, v]: [f64; 2]) -> DVec3 {
    let (sin_theta, cos_theta) = (PI * v).sin_cos();
    let (sin_phi, cos_phi) = (TAU * (u - 0.5)).sin_cos();
    DVec3::new(sin_theta * sin_phi, cos_theta, -sin_theta * cos_phi)
}

/// What cells get of their neighbours, along each axis 1/8 of both. Columns go around, rows end.
fn blurred(bright: &[f64], [columns, rows]: [usize; 2]) -> Vec<f64> {
    let along = |row: usize, x: usize| {
        let row = &bright[row * columns..(row + 1) * columns];
        0.75 * row[x] + 0.125 * (row[(x + columns - 1) % columns] + row[(x + 1) % columns])
    };
    let down = |x: usize, y: usize| {
        let above_and_below = along(y.saturating_sub(1), x) + along((y + 1).min(rows - 1), x);
        0.75 * along(y, x) + 0.125 * above_and_below
    };
    (0..columns * rows).map(|k| down(k % columns, k / columns)).collect()
}

/// How bright a map is, in cells: texels, or the means of some.
#[derive(Debug, Clone)]
struct Cells {
    /// Columns and rows.
    size: [usize; 2],
    /// The mean of the three colours of each.
    bright: Vec<f32>,
}

impl Cells {
    /// The brightness at the corners of a patch between the middles of cells: left and right above, and below.
    #[inline]
    fn corners(&self, [x, y]: [usize; 2]) -> [[f64; 2]; 2] {
        let [columns, rows] = self.size;
        let next = if x + 1 == columns { 0 } else { x + 1 };
        [y.saturating_sub(1), y.min(rows - 1)].map(|row| {
            let row = &self.bright[row * columns..(row + 1) * columns];
            [f64::from(row[x]), f64::from(row[next])]
        })
    }

    /// Where a row of patches begins and ends, in rows of cells.
    #[inline]
    fn ends(&self, row: usize) -> [f64; 2] {
        [row as f64 - 0.5, row as f64 + 0.5].map(|v| v.clamp(0.0, self.size[1] as f64))
    }
}

/// Directions by the brightness of a map, as it is interpolated: first a patch between the middles of four
/// cells, then a place in it by a density that is linear along both axes (Pharr, Jakob and Humphreys,
/// *Physically Based Rendering*, 4th edition, sections 12.5 and A.5.2). What the sphere narrows towards the
/// poles is taken to be as at the middle of each row of patches.
#[derive(Debug, Clone)]
pub struct MapSampler {
    cells: Cells,
    /// One row more than there are cells, of which the first and the last are half as high.
    patches: GridDistribution,
    /// By row of patches, the density over the unit square where the brightness is 1.
    scale: Vec<f64>,
    /// Mean radiance over all directions, the mean of the three colours.
    pub mean: f64,
}

impl MapSampler {
    /// For `map`.
    #[must_use]
    pub fn new(map: &EnvironmentMap) -> Self {
        let size = [map.width.clamp(1, CELLS[0]), map.height.clamp(1, CELLS[1])];
        let [columns, rows] = size;
        let mut bright = vec![0.0; columns * rows];
        for (k, texel) in map.texels.iter().enumerate() {
            let (x, y) = (k % map.width * columns / map.width, k / map.width * rows / map.height);
            bright[y * columns + x] += f64::from(texel[0] + texel[1] + texel[2]) / 3.0;
        }
        let texels_a_cell = map.texels.len() as f64 / bright.len() as f64;
        bright.iter_mut().for_each(|bright| *bright /= texels_a_cell);
        let sine = |v: f64| (PI * v / rows as f64).sin();
        let bands = bright.chunks(columns).enumerate();
        let sums = bands.map(|(y, band)| band.iter().sum::<f64>() * sine(y as f64 + 0.5));
        // The mean of sin θ over rows is 2/π.
        let mean = sums.sum::<f64>() / (columns * rows) as f64 * PI / 2.0;
        if texels_a_cell > 1.0 {
            // Where a texel shines beyond its own cell there is some chance, too.
            bright = blurred(&bright, size);
        }
        #[expect(clippy::cast_possible_truncation, reason = "brightness is kept as f32")]
        let cells = Cells { size, bright: bright.iter().map(|&b| b as f32).collect() };
        let sines: Vec<f64> =
            (0..=rows).map(|row| sine(0.5 * cells.ends(row).iter().sum::<f64>())).collect();
        let mut weights = Vec::with_capacity(columns * (rows + 1));
        for (y, sine) in sines.iter().enumerate() {
            let [start, end] = cells.ends(y);
            for x in 0..columns {
                let sum: f64 = cells.corners([x, y]).as_flattened().iter().sum();
                weights.push(0.25 * sum * sine * (end - start));
            }
        }
        let whole: f64 = weights.iter().sum();
        let of_one = if whole > 0.0 { (columns * rows) as f64 / whole } else { 0.0 };
        let scale = sines.iter().map(|sine| sine * of_one).collect();
        Self { cells, patches: GridDistribution::new(columns, &weights), scale, mean }
    }

    /// A direction and its density (1/sr) for each of `squares`; their [`place`]s stay in `places`.
    pub(crate) fn sample(
        &self,
        squares: impl Iterator<Item = [f64; 2]>,
        places: &mut PlacesOnMap,
        mut each: impl FnMut(usize, DVec3, f64),
    ) {
        let PlacesOnMap { cells, chosen } = places;
        self.patches.cells(squares, cells);
        chosen.clear();
        chosen.extend(cells.iter().map(|cell| self.place_in(cell)));
        for (k, &(at, density)) in chosen.iter().enumerate() {
            let d = direction(at);
            let sin_theta = (d.x * d.x + d.z * d.z).sqrt();
            each(k, d, over_the_sphere(density, sin_theta));
        }
    }

    /// The place in a patch that was chosen, and its density over the unit square.
    #[inline]
    fn place_in(&self, patch: &GridCell) -> ([f64; 2], f64) {
        let [columns, rows] = self.cells.size.map(|cells| cells as f64);
        let ([x, y], [across, down]) = (patch.at, patch.rest);
        let [[a, b], [c, d]] = self.cells.corners(patch.at);
        let down = linear_place(down, [a + b, c + d]);
        let [left, right] = [a + (c - a) * down, b + (d - b) * down];
        let across = linear_place(across, [left, right]);
        let bright = left + (right - left) * across;
        let [start, end] = self.cells.ends(y);
        let u = (x as f64 + 0.5 + across) / columns;
        let v = (start + down * (end - start)) / rows;
        ([if u < 1.0 { u } else { u - 1.0 }, v.min(ONE_BELOW)], bright * self.scale[y])
    }

    /// The density (1/sr) of a unit direction.
    #[must_use]
    pub fn pdf(&self, d: DVec3) -> f64 {
        self.pdf_at(d, place(d))
    }

    /// [`Self::pdf`] of a direction whose [`place`] is known.
    pub(crate) fn pdf_at(&self, d: DVec3, [u, v]: [f64; 2]) -> f64 {
        let [columns, rows] = self.cells.size;
        let (x, y) = (u * columns as f64 - 0.5, v * rows as f64 - 0.5);
        let x = if x < 0.0 { x + columns as f64 } else { x };
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "from 0 to the size of the grid; the cast saturates"
        )]
        let (column, row) = ((x as usize).min(columns - 1), ((y + 1.0) as usize).min(rows));
        let [[a, b], [c, e]] = self.cells.corners([column, row]);
        let (across, down) = (x - column as f64, y + 1.0 - row as f64);
        let [left, right] = [a + (c - a) * down, b + (e - b) * down];
        let bright = left + (right - left) * across;
        over_the_sphere(bright * self.scale[row], (d.x * d.x + d.z * d.z).sqrt())
    }
}

/// Places on a map that are chosen together; kept for the next.
#[derive(Debug, Default)]
pub(crate) struct PlacesOnMap {
    cells: Vec<GridCell>,
    /// Places (u, v) and their density over the unit square.
    pub(crate) chosen: Vec<([f64; 2], f64)>,
}

/// A density over the map's places as one over solid angles (1/sr), by the sine of the polar angle.
fn over_the_sphere(density: f64, sin_theta: f64) -> f64 {
    if sin_theta <= 0.0 {
        return 0.0;
    }
    density / (2.0 * PI * PI * sin_theta)
}

#[cfg(test)]
mod tests {
    use super::*;

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
            integral += sampler.pdf(d) * 4.0 * PI / (n * n) as f64;
            mean += map.radiance(d)[0] / (n * n) as f64;
        }
        // A bright texel is 16 × 16 points wide here: its edges are met to one in sixteen of 1 − ε.
        assert!((integral - 1.0).abs() < 0.02, "{integral}");
        assert!((sampler.mean / mean - 1.0).abs() < 0.02, "{} {mean}", sampler.mean);
        let bright = direction([20.5 / 64.0, 10.5 / 32.0]);
        assert!(sampler.pdf(bright) > 50.0 * sampler.pdf(DVec3::X));
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
        let sampler = MapSampler::new(&sunny());
        let n = 1_000;
        let at = |k: i32| (f64::from(k) + 0.5) / f64::from(n);
        let squares = (0..n * n).map(|k| [at(k % n), at(k / n)]);
        let (mut places, mut sum) = (PlacesOnMap::default(), 0.0);
        sampler.sample(squares, &mut places, |_, d, pdf| {
            assert!((sampler.pdf(d) / pdf - 1.0).abs() < 1e-9);
        });
        for &([u, v], density) in &places.chosen {
            sum += u * (PI * v).sin() / density / f64::from(n * n);
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
        let squares = (0..40_000).map(|k| [k % 200, k / 200].map(|i| (f64::from(i) + 0.5) / 200.0));
        let whole = 4.0 * PI * sampler.mean;
        sampler.sample(squares, &mut PlacesOnMap::default(), |_, d, pdf| {
            let worth = map.radiance(d)[0] / pdf;
            // Half a row of 32 is 0.05 radians, by which the sine changes by less than that over its tangent.
            let bound = 0.05 * d.y.abs() / (1.0 - d.y * d.y).sqrt() + 0.01;
            assert!((worth / whole - 1.0).abs() < bound, "{worth} of {whole} from {d}");
        });
    }

    #[test]
    fn what_is_no_radiance_is_dropped_and_counted() {
        let map =
            EnvironmentMap::new([2, 1], vec![[f32::NAN, 1.0, -3.0], [f32::INFINITY, 0.0, 2.0]]);
        assert_eq!(map.dropped, 2);
        assert!(map.radiance(DVec3::X).iter().all(|c| c.is_finite()));
    }
}
