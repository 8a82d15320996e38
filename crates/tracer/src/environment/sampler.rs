//! Directions by how bright a map of all directions is.

use std::f64::consts::PI;

use super::{CELLS, Corners, EnvironmentMap, LANES, between, mean};
use crate::angles;
use crate::sampling::{GridCell, GridDistribution, linear_place};
use etendue_geometry::Float;

/// Cells blurred by their neighbours, along each axis by 1/8 of both. Columns go around, rows end.
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

/// Brightness of a map in cells: texels, or the means of some.
#[derive(Debug, Clone)]
struct LuminanceGrid {
    /// Columns and rows.
    size: [usize; 2],
    /// The mean over the colours or bands of each. Empty where the texels of a map of colours are the cells: what they
    /// shine is read in any case, and memory is what a map takes its time for.
    bright: Vec<f32>,
}

impl LuminanceGrid {
    /// The cells at the corners of a patch between the middles of four: left and right above, and below.
    #[inline]
    fn about(&self, [x, y]: [usize; 2]) -> [u32; 4] {
        let [columns, rows] = self.size;
        let next = if x + 1 == columns { 0 } else { x + 1 };
        let (above, below) = (y.saturating_sub(1) * columns, y.min(rows - 1) * columns);
        #[expect(clippy::cast_possible_truncation, reason = "maps have fewer texels")]
        [above + x, above + next, below + x, below + next].map(|cell| cell as u32)
    }

    /// Beginning and end of a row of patches, in rows of cells.
    #[inline]
    fn ends(&self, row: usize) -> [f64; 2] {
        let within = |v: f64| v.clamp(0.0, self.size[1] as f64);
        [within(row as f64 - 0.5), within(row as f64 + 0.5)]
    }
}

/// Directions by the brightness of a map, as it is interpolated: first a patch between the middles of four
/// cells, then a place in it by a density that is linear along both axes (Pharr, Jakob and Humphreys,
/// *Physically Based Rendering*, 4th edition, sections 12.5 and A.5.2). What the sphere narrows towards the
/// poles is taken to be as at the middle of each row of patches.
#[derive(Debug, Clone)]
pub struct MapSampler {
    cells: LuminanceGrid,
    /// One row more than there are cells, of which the first and the last are half as high.
    patches: GridDistribution,
    /// By row of patches, the density over the unit square where the brightness is 1.
    scale: Vec<f64>,
    /// Mean radiance over all directions, the mean over colours or bands.
    pub mean: f64,
}

impl MapSampler {
    /// For `map`, by the mean of its three colours.
    #[must_use]
    pub fn new(map: &EnvironmentMap) -> Self {
        let bright = map.texels.iter().map(|texel| mean(texel.map(f64::from)));
        Self::of_texels(map.size(), bright, true)
    }

    /// For a map of so many columns and rows by how bright each of its texels is, row by row from the top.
    pub(crate) fn by_brightness(size: [usize; 2], texels: impl Iterator<Item = f64>) -> Self {
        Self::of_texels(size, texels, false)
    }

    /// The same; whether it is the mean of the colours that the map itself has.
    fn of_texels(
        [width, height]: [usize; 2],
        texels: impl Iterator<Item = f64>,
        are_colors: bool,
    ) -> Self {
        let size = [width.clamp(1, CELLS[0]), height.clamp(1, CELLS[1])];
        let [columns, rows] = size;
        let mut bright = vec![0.0; columns * rows];
        for (k, texel) in texels.enumerate() {
            let (x, y) = (k % width * columns / width, k / width * rows / height);
            bright[y * columns + x] += texel;
        }
        let texels_a_cell = (width * height) as f64 / bright.len() as f64;
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
        let kept: Vec<f32> = match are_colors && size == [width, height] {
            true => Vec::new(),
            false => bright.iter().map(|&b| b as f32).collect(),
        };
        // Patches are as probable as what is kept has it: where that is 0, none is chosen.
        bright.iter_mut().zip(&kept).for_each(|(bright, kept)| *bright = f64::from(*kept));
        let cells = LuminanceGrid { size, bright: kept };
        let sines: Vec<f64> =
            (0..=rows).map(|row| sine(0.5 * cells.ends(row).iter().sum::<f64>())).collect();
        let mut weights = Vec::with_capacity(columns * (rows + 1));
        for (y, sine) in sines.iter().enumerate() {
            let [start, end] = cells.ends(y);
            for x in 0..columns {
                let sum: f64 = cells.about([x, y]).iter().map(|&k| bright[k as usize]).sum();
                weights.push(0.25 * sum * sine * (end - start));
            }
        }
        let whole: f64 = weights.iter().sum();
        let of_one = if whole > 0.0 { (columns * rows) as f64 / whole } else { 0.0 };
        let scale = sines.iter().map(|sine| sine * of_one).collect();
        Self { cells, patches: GridDistribution::new(columns, &weights), scale, mean }
    }

    /// The patches for each of `squares`; `cells` is refilled.
    pub(crate) fn cells(&self, squares: impl Iterator<Item = [f64; 2]>, cells: &mut Vec<GridCell>) {
        self.patches.cells(squares, cells);
    }

    /// True if the cells are the texels of a map of colours.
    fn is_of_texels(&self) -> bool {
        self.cells.bright.is_empty()
    }

    /// Brightness of cells of the table.
    #[inline(always)]
    fn bright_at<F: Float, const N: usize>(&self, numbers: &[[u32; N]; 4]) -> [[F; N]; 4] {
        let mut bright = [[F::ZERO; N]; 4];
        for corner in 0..4 {
            for i in 0..N {
                bright[corner][i] = self.cells.bright[numbers[corner][i] as usize].into();
            }
        }
        bright
    }

    /// Directions in the patches that were chosen, with what the map has there.
    #[inline(always)]
    pub(crate) fn in_patches<F: Float>(
        &self,
        map: &EnvironmentMap,
        patches: &[GridCell; LANES],
    ) -> MapLookup<F, LANES> {
        let mut numbers = [[0; LANES]; 4];
        for (i, patch) in patches.iter().enumerate() {
            let about = self.cells.about([patch.at[0] as usize, patch.at[1] as usize]);
            for corner in 0..4 {
                numbers[corner][i] = about[corner];
            }
        }
        let (places, over_square, colors) = if self.is_of_texels() {
            let texels = map.texels_at(&numbers);
            let (places, [across, down], density) = self.places_in(patches, &texels.bright());
            (places, density, texels.between([&across, &down]))
        } else {
            let (places, _, density) = self.places_in(patches, &self.bright_at(&numbers));
            let about = Corners::of(places, map.size());
            (places, density, map.texels_at(&about.numbers).between(about.within()))
        };
        let (directions, sines) = angles::directions(&places);
        let mut densities = [F::ZERO; LANES];
        for i in 0..LANES {
            densities[i] = over_the_sphere(over_square[i], sines[i]);
        }
        MapLookup { directions, places, densities, colors }
    }

    /// Lookups of the map in unit directions.
    #[inline(always)]
    pub(crate) fn in_directions<F: Float, const N: usize>(
        &self,
        map: &EnvironmentMap,
        directions: [[F; N]; 3],
    ) -> MapLookup<F, N> {
        let [x, _, z] = &directions;
        let mut sines = [F::ZERO; N];
        for i in 0..N {
            sines[i] = (x[i] * x[i] + z[i] * z[i]).sqrt();
        }
        let places = angles::places(&directions);
        let about = Corners::of(places, map.size());
        let colors = map.texels_at(&about.numbers).between(about.within());
        let densities = self.pdf_of(&places, sines, &about, &colors);
        MapLookup { directions, places, densities, colors }
    }

    /// Places in the patches that were chosen, of which the corners shine so, how far they are from the first of
    /// these, and their density over the unit square.
    #[inline(always)]
    fn places_in<F: Float>(
        &self,
        patches: &[GridCell; LANES],
        corners: &[[F; LANES]; 4],
    ) -> ([[F; LANES]; 2], [[F; LANES]; 2], [F; LANES]) {
        let [columns, rows] = self.cells.size.map(|cells| F::of(cells as f64));
        // What there is in memory of each.
        let mut scale = [F::ZERO; LANES];
        let [mut start, mut end, mut x] = [[F::ZERO; LANES]; 3];
        let (mut across, mut down) = ([F::ZERO; LANES], [F::ZERO; LANES]);
        for (i, patch) in patches.iter().enumerate() {
            (across[i], down[i]) = (F::of(patch.rest[0]), F::of(patch.rest[1]));
            scale[i] = F::of(self.scale[patch.at[1] as usize]);
            let [from, to] = self.cells.ends(patch.at[1] as usize);
            (start[i], end[i]) = (F::of(from), F::of(to));
            x[i] = F::of(f64::from(patch.at[0]));
        }
        let (mut places, mut density) = ([[F::ZERO; LANES]; 2], [F::ZERO; LANES]);
        for i in 0..LANES {
            // Densities stay in the range of single precision where they are squared.
            let (a, b) = (corners[0][i] * scale[i], corners[1][i] * scale[i]);
            let (c, d) = (corners[2][i] * scale[i], corners[3][i] * scale[i]);
            down[i] = linear_place(down[i], [a + b, c + d]);
            let (left, right) = (a + (c - a) * down[i], b + (d - b) * down[i]);
            across[i] = linear_place(across[i], [left, right]);
            density[i] = left + (right - left) * across[i];
        }
        for i in 0..LANES {
            let u = (x[i] + F::of(0.5) + across[i]) / columns;
            places[0][i] = if u < F::of(1.0) { u } else { u - F::of(1.0) };
            let v = (start[i] + down[i] * (end[i] - start[i])) / rows;
            places[1][i] = if v < F::ONE_BELOW { v } else { F::ONE_BELOW };
        }
        (places, [across, down], density)
    }

    /// Densities (1/sr) of places with the sines of their polar angles, about which the texels are known, and the colours
    /// there.
    #[inline(always)]
    fn pdf_of<F: Float, const N: usize>(
        &self,
        places: &[[F; N]; 2],
        sines: [F; N],
        about: &Corners<F, N>,
        colors: &[[F; N]; 3],
    ) -> [F; N] {
        let mut pdf = [F::ZERO; N];
        let rows = match self.is_of_texels() {
            true => {
                for i in 0..N {
                    pdf[i] = mean([colors[0][i], colors[1][i], colors[2][i]]);
                }
                about.row
            }
            false => {
                let about = Corners::of(*places, self.cells.size);
                let bright: [[F; N]; 4] = self.bright_at(&about.numbers);
                for i in 0..N {
                    let corners = [bright[0][i], bright[1][i], bright[2][i], bright[3][i]];
                    pdf[i] = between(corners, [about.across[i], about.down[i]]);
                }
                about.row
            }
        };
        let mut scale = [F::ZERO; N];
        for i in 0..N {
            scale[i] = F::of(self.scale[rows[i] as usize]);
        }
        for i in 0..N {
            pdf[i] = over_the_sphere(pdf[i] * scale[i], sines[i]);
        }
        pdf
    }
}

/// Lookups of a map in directions side by side, a row a number.
pub(crate) struct MapLookup<F, const N: usize> {
    /// Unit.
    pub(crate) directions: [[F; N]; 3],
    pub(crate) places: [[F; N]; 2],
    /// 1/sr.
    pub(crate) densities: [F; N],
    pub(crate) colors: [[F; N]; 3],
}

/// A density over the map's places as one over solid angles (1/sr), by the sine of the polar angle.
#[inline(always)]
fn over_the_sphere<F: Float>(density: F, sin_theta: F) -> F {
    let over = density / (F::of(2.0 * PI * PI) * sin_theta);
    if sin_theta > F::ZERO { over } else { F::ZERO }
}
