//! Textures by wavelength: a reflectance at each texel, in bands.

use std::sync::Arc;

use etendue_spectrum::{Bands, Curve, Grid, Outside, rgb};

use crate::Color;
use crate::texture::{Filter, Wrap};

/// Reflectances over texture coordinates: straight lines join the bands' middles.
#[derive(Debug, Clone, PartialEq)]
pub struct Cube {
    /// Columns and rows.
    size: [usize; 2],
    grid: Grid,
    /// `[row][column][band]`, 0..=1.
    values: Vec<f32>,
    /// What each texel looks like: linear RGB.
    looks: Vec<[f32; 3]>,
    wrap: Wrap,
    filter: Filter,
}

/// A cube of a scene, and its number in the table of [`Spectral`](crate::Spectral).
#[derive(Debug, Clone, PartialEq)]
pub struct SceneCube {
    /// The number, from 0.
    pub number: u32,
    /// The cube.
    pub cube: Arc<Cube>,
}

/// Texels and their shares.
pub(crate) type Corners = [(usize, f64); 4];

impl Cube {
    /// A cube of so many columns and rows, whose `values` are `[row][column][band of the grid]`.
    ///
    /// # Errors
    ///
    /// A sentence when there are not as many values, or one is no reflectance.
    pub fn new(
        size: [usize; 2],
        grid: Grid,
        values: Vec<f32>,
        (wrap, filter): (Wrap, Filter),
    ) -> Result<Self, String> {
        let count = grid.len();
        if size.contains(&0) || values.len() != size[0] * size[1] * count {
            return Err(format!(
                "has {} numbers, which are not {} x {} texels of {count} bands",
                values.len(),
                size[0],
                size[1]
            ));
        }
        if let Some(bad) = values.iter().position(|v| !(0.0..=1.0).contains(v)) {
            let (texel, band) = (bad / count, bad % count);
            return Err(format!(
                "is {} in band {band} of row {}, column {}: a reflectance is 0 to 1; scale it, and clip what noise \
                 leaves beyond",
                values[bad],
                texel / size[0],
                texel % size[0]
            ));
        }
        let mut cube = Self { size, grid, values, looks: Vec::new(), wrap, filter };
        let colors: Vec<Color> =
            cube.parts().iter().map(|part| rgb::colour(&part.held_over(360.0, 830.0))).collect();
        let look = |texel: &[f32]| {
            std::array::from_fn(|k| {
                let sum: f64 = texel.iter().zip(&colors).map(|(v, c)| f64::from(*v) * c[k]).sum();
                #[expect(clippy::cast_possible_truncation, reason = "to look at")]
                let sum = sum.clamp(0.0, 1.0) as f32;
                sum
            })
        };
        cube.looks = cube.values.chunks_exact(count).map(look).collect();
        Ok(cube)
    }

    /// The curve that 1 in each band and 0 in all others is: their sum is 1.
    #[must_use]
    pub fn parts(&self) -> Vec<Curve> {
        let middles: Vec<f64> = self.grid.centres().collect();
        let part = |i: usize| {
            let before = (i > 0).then(|| [middles[i - 1], 0.0]);
            let after = middles.get(i + 1).map(|&nm| [nm, 0.0]);
            let points = before.into_iter().chain([[middles[i], 1.0]]).chain(after).collect();
            Curve::sampled(points).unwrap_or(Curve::ONE)
        };
        (0..middles.len()).map(part).collect()
    }

    /// The wavelengths of its bands (nm).
    #[must_use]
    pub fn range(&self) -> [f64; 2] {
        self.grid.range()
    }

    /// The texels in other bands: `[row][column][band]`.
    pub(crate) fn in_bands(&self, bands: &Bands) -> Vec<f32> {
        let held = |curve: &Curve| {
            bands.from_curve(curve, Outside::Held).unwrap_or_else(|_| {
                (0..bands.count()).map(|i| curve.held(bands.wavelength(i))).collect()
            })
        };
        let rows: Vec<Vec<f64>> = self.parts().iter().map(held).collect();
        let mut all = Vec::with_capacity(self.looks.len() * bands.count());
        for texel in self.values.chunks_exact(self.grid.len()) {
            for band in 0..bands.count() {
                let value: f64 =
                    texel.iter().zip(&rows).map(|(v, row)| f64::from(*v) * row[band]).sum();
                #[expect(clippy::cast_possible_truncation, reason = "as the file has them")]
                all.push(value.clamp(0.0, 1.0) as f32);
            }
        }
        all
    }

    /// The texels around (u, v), of which (0, 0) is the upper left corner, and their shares.
    pub(crate) fn corners(&self, [u, v]: [f64; 2]) -> Corners {
        let [width, height] = self.size;
        let at = |x: f64, y: f64| self.wrap.apply(y, height) * width + self.wrap.apply(x, width);
        if !(u.is_finite() && v.is_finite()) {
            return [(0, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)];
        }
        let (x, y) = (u * width as f64, v * height as f64);
        if self.filter == Filter::Nearest {
            let texel = at(x.floor(), y.floor());
            return [(texel, 1.0), (texel, 0.0), (texel, 0.0), (texel, 0.0)];
        }
        let (x, y) = (x - 0.5, y - 0.5);
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = (x - x0, y - y0);
        [
            (at(x0, y0), (1.0 - fx) * (1.0 - fy)),
            (at(x0 + 1.0, y0), fx * (1.0 - fy)),
            (at(x0, y0 + 1.0), (1.0 - fx) * fy),
            (at(x0 + 1.0, y0 + 1.0), fx * fy),
        ]
    }

    /// What it looks like at (u, v): linear RGB.
    #[must_use]
    pub fn look(&self, at: [f64; 2]) -> Color {
        let corners = self.corners(at);
        std::array::from_fn(|k| {
            corners.iter().map(|&(texel, share)| share * f64::from(self.looks[texel][k])).sum()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texels_come_back_in_their_own_bands_and_between_them() {
        let grid = Grid::equal(400.0, 700.0, 3).unwrap();
        let values = vec![0.1, 0.5, 0.9, 0.3, 0.3, 0.3];
        let cube =
            Cube::new([2, 1], grid.clone(), values, (Wrap::ClampToEdge, Filter::Bilinear)).unwrap();
        // Flat stays flat in any bands, and means of straight lines are theirs.
        let fine = cube.in_bands(&Bands::Spectral(Grid::equal(450.0, 650.0, 2).unwrap()));
        for (found, expected) in fine.iter().zip([0.3, 0.7, 0.3, 0.3]) {
            assert!((found - expected).abs() < 1e-6, "{fine:?}");
        }
        let look = cube.look([0.75, 0.5]);
        assert!(look.iter().all(|c| (c - 0.3).abs() < 1e-3), "grey: {look:?}");
        let middle = cube.corners([0.5, 0.5]);
        let share = |texel| middle.iter().filter(|c| c.0 == texel).map(|c| c.1).sum::<f64>();
        assert_eq!([share(0), share(1)], [0.5, 0.5]);
    }

    #[test]
    fn what_is_no_reflectance_is_refused_with_its_place() {
        let grid = Grid::equal(400.0, 700.0, 2).unwrap();
        let look = (Wrap::Repeat, Filter::Nearest);
        let above = Cube::new([1, 2], grid.clone(), vec![0.5, 0.5, 0.5, 1.5], look).unwrap_err();
        assert!(above.contains("band 1 of row 1, column 0"), "{above}");
        assert!(Cube::new([1, 2], grid, vec![0.5; 3], look).unwrap_err().contains("3 numbers"));
    }
}
