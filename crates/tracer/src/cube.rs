//! Textures by wavelength: a reflectance or a radiance at each texel, in bands.

use std::f64::consts::PI;
use std::sync::Arc;

use etendue_image::BandAxis;
use etendue_spectrum::{Bands, Curve, NoOverlap, Outside, rgb};

use crate::Color;
use crate::texture::{Filter, Wrap};
use crate::tint::BRIGHTEST;

/// Kind of the numbers of a [`Cube`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CubeKind {
    /// Shares of light, 0 to 1, held beyond the outer bands.
    Reflectance,
    /// Light, 0 or more: none beyond the outer edges.
    Light,
}

/// Reflectances or light over texture coordinates: straight lines join the bands' middles.
#[derive(Debug, Clone, PartialEq)]
pub struct Cube {
    kind: CubeKind,
    /// Columns and rows.
    size: [usize; 2],
    axis: BandAxis,
    /// `[row][column][band]`.
    values: Vec<f32>,
    /// Colour of each texel: linear RGB.
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
    /// A cube of so many columns and rows, whose `values` are `[row][column][band of the axis]`.
    ///
    /// # Errors
    ///
    /// A sentence when there are not as many values, or one is none of this kind.
    pub fn new(
        kind: CubeKind,
        size: [usize; 2],
        axis: BandAxis,
        values: Vec<f32>,
        wrap: Wrap,
        filter: Filter,
    ) -> Result<Self, String> {
        let count = axis.len();
        if size.contains(&0) || values.len() != size[0] * size[1] * count {
            return Err(format!(
                "has {} numbers, which are not {} x {} texels of {count} bands",
                values.len(),
                size[0],
                size[1]
            ));
        }
        #[expect(
            clippy::cast_possible_truncation,
            reason = "a round number below the greatest f32"
        )]
        let most = match kind {
            CubeKind::Reflectance => 1.0,
            CubeKind::Light => BRIGHTEST as f32,
        };
        if let Some(bad) = values.iter().position(|v| !(0.0..=most).contains(v)) {
            let (texel, band) = (bad / count, bad % count);
            let why = match (values[bad].is_nan(), kind) {
                (true, _) => "nothing was measured there; fill it, or cut the cube".to_owned(),
                (_, CubeKind::Reflectance) => {
                    "a reflectance is 0 to 1; scale it, and clip what noise leaves beyond"
                        .to_owned()
                }
                (_, CubeKind::Light) => {
                    format!("light is 0 to {BRIGHTEST:e}; clip what noise leaves below")
                }
            };
            return Err(format!(
                "is {} in band {band} of row {}, column {}: {why}",
                values[bad],
                texel / size[0],
                texel % size[0]
            ));
        }
        let mut cube = Self { kind, size, axis, values, looks: Vec::new(), wrap, filter };
        let color = |part: &Curve| match kind {
            CubeKind::Reflectance => rgb::colour(&part.held_over(360.0, 830.0)),
            // As of any light, before equal energy; none where it is invisible. Of a part it may well be negative.
            CubeKind::Light => rgb::colour(part),
        };
        let colors: Vec<Color> = cube.parts().iter().map(color).collect();
        let look = |texel: &[f32]| {
            std::array::from_fn(|k| {
                let sum: f64 = texel.iter().zip(&colors).map(|(v, c)| f64::from(*v) * c[k]).sum();
                #[expect(clippy::cast_possible_truncation, reason = "to look at")]
                let sum = sum.clamp(0.0, f64::from(most)) as f32;
                sum
            })
        };
        cube.looks = cube.values.chunks_exact(count).map(look).collect();
        Ok(cube)
    }

    /// The curve that 1 in each band and 0 in all others is: their sum is 1, of light between the outer edges.
    #[must_use]
    pub fn parts(&self) -> Vec<Curve> {
        let (middles, [from, to]) = (self.axis.wavelengths(), self.range());
        let part = |i: usize| {
            let of_light = |nm: f64| (self.kind == CubeKind::Light).then_some([nm, 1.0]);
            let before = match i {
                0 => of_light(from),
                _ => Some([middles[i - 1], 0.0]),
            };
            let after = match middles.get(i + 1) {
                None => of_light(to),
                Some(&nm) => Some([nm, 0.0]),
            };
            let points = before.into_iter().chain([[middles[i], 1.0]]).chain(after).collect();
            Curve::sampled(points).unwrap_or(Curve::ONE)
        };
        (0..middles.len()).map(part).collect()
    }

    /// Columns and rows.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Colour of each texel: linear RGB, row by row from the top.
    pub(crate) fn looks(&self) -> &[[f32; 3]] {
        &self.looks
    }

    /// The mean of all texels in each band, as a curve; `None` where all is dark.
    #[must_use]
    pub fn mean(&self) -> Option<Curve> {
        self.mean_of_rows(|_| 1.0)
    }

    /// As [`Self::mean`] over all directions, of which it is the latitude-longitude map.
    #[must_use]
    pub fn mean_over_the_sphere(&self) -> Option<Curve> {
        let rows = self.size[1] as f64;
        self.mean_of_rows(|row| (PI * (row as f64 + 0.5) / rows).sin())
    }

    /// The mean of the texels in each band, each as much as its row weighs.
    fn mean_of_rows(&self, weight: impl Fn(usize) -> f64) -> Option<Curve> {
        let (mut sums, mut all) = (vec![0.0; self.axis.len()], 0.0);
        for (k, texel) in self.values.chunks_exact(sums.len()).enumerate() {
            let weight = weight(k / self.size[0]);
            all += weight;
            sums.iter_mut().zip(texel).for_each(|(sum, value)| *sum += weight * f64::from(*value));
        }
        let means = sums.iter().map(|sum| sum / all);
        let [from, to] = self.range();
        let mut points: Vec<[f64; 2]> =
            self.axis.wavelengths().iter().zip(means).map(|(nm, mean)| [*nm, mean]).collect();
        let [first, last] = [points.first()?[1], points.last()?[1]];
        points.insert(0, [from, first]);
        points.push([to, last]);
        Curve::sampled(points).ok().filter(|curve| curve.extent()[1] > 0.0)
    }

    /// The greatest mean over bands of a texel: also of light that nobody sees.
    #[must_use]
    pub fn brightest(&self) -> f64 {
        let count = self.axis.len();
        let mean = |texel: &[f32]| texel.iter().map(|v| f64::from(*v)).sum::<f64>() / count as f64;
        self.values.chunks_exact(count).map(mean).fold(0.0, f64::max)
    }

    /// The greatest band or colour of a texel.
    pub(crate) fn peak(&self) -> f64 {
        let looks = self.looks.as_flattened().iter();
        f64::from(self.values.iter().chain(looks).copied().fold(0.0, f32::max))
    }

    /// The outer edges of its bands (nm).
    #[must_use]
    pub fn range(&self) -> [f64; 2] {
        let edges = self.axis.edges();
        [edges[0], edges[edges.len() - 1]]
    }

    /// Checks that it shines in any of the bands' wavelengths.
    ///
    /// # Errors
    ///
    /// When its own bands miss them.
    pub(crate) fn overlaps(&self, bands: &Bands) -> Result<(), NoOverlap> {
        let [[low, high], [from, to]] = [self.range(), bands.range()];
        match high <= from || low >= to {
            true => Err(NoOverlap { curve: [low, high], bands: [from, to] }),
            false => Ok(()),
        }
    }

    /// Bytes of a render in `bands`: the cube, its looks and, beside it, its file while it is read or its texels in
    /// those bands, whichever is more.
    #[must_use]
    pub fn bytes_in(&self, bands: &Bands) -> u64 {
        let again = if *bands == Bands::Rgb { 0 } else { bands.count() };
        let again = again.max(self.axis.len());
        (self.looks.len() * (4 * (self.axis.len() + again) + size_of::<[f32; 3]>())) as u64
    }

    /// The texels in other bands: `[row][column][band]`.
    pub(crate) fn in_bands(&self, bands: &Bands) -> Vec<f32> {
        let of = |curve: &Curve| match self.kind {
            CubeKind::Reflectance => bands.from_curve(curve, Outside::Held).unwrap_or_else(|_| {
                (0..bands.count()).map(|i| curve.held(bands.wavelength(i))).collect()
            }),
            CubeKind::Light => {
                bands.from_curve(curve, Outside::Zero).unwrap_or_else(|_| vec![0.0; bands.count()])
            }
        };
        let rows: Vec<Vec<f64>> = self.parts().iter().map(of).collect();
        let most = if self.kind == CubeKind::Reflectance { 1.0 } else { BRIGHTEST };
        let mut all = Vec::with_capacity(self.looks.len() * bands.count());
        for texel in self.values.chunks_exact(self.axis.len()) {
            for band in 0..bands.count() {
                let value: f64 =
                    texel.iter().zip(&rows).map(|(v, row)| f64::from(*v) * row[band]).sum();
                #[expect(clippy::cast_possible_truncation, reason = "as the file has them")]
                all.push(value.clamp(0.0, most) as f32);
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

    /// Colour at (u, v): linear RGB.
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
    use etendue_spectrum::Grid;

    use super::*;

    fn axis(from: f64, to: f64, count: usize) -> BandAxis {
        let grid = Grid::equal(from, to, count).unwrap();
        BandAxis::between(grid.edges().to_vec()).unwrap()
    }

    #[test]
    fn texels_come_back_in_their_own_bands_and_between_them() {
        let axis = axis(400.0, 700.0, 3);
        let values = vec![0.1, 0.5, 0.9, 0.3, 0.3, 0.3];
        let cube = Cube::new(
            CubeKind::Reflectance,
            [2, 1],
            axis.clone(),
            values,
            Wrap::ClampToEdge,
            Filter::Bilinear,
        )
        .unwrap();
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
        let axis = axis(400.0, 700.0, 2);
        let cube = |values: Vec<f32>| {
            let (wrap, filter) = (Wrap::Repeat, Filter::Nearest);
            Cube::new(CubeKind::Reflectance, [1, 2], axis.clone(), values, wrap, filter)
        };
        let above = cube(vec![0.5, 0.5, 0.5, 1.5]).unwrap_err();
        assert!(above.contains("band 1 of row 1, column 0"), "{above}");
        assert!(cube(vec![0.5; 3]).unwrap_err().contains("3 numbers"));
    }
}
