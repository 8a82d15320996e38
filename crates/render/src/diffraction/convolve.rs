//! Layers of a picture on cells, each spread and laid over those behind it, on pixels.
//!
//! Spreads differ over the picture: light belongs to the nodes around it by shares that add up to 1, and
//! each node's light is spread by the node's own, by FFT. What is behind a layer's edge, and beyond the picture's, is not known: a spread
//! picture is divided by the spread of where it is known, so that it goes on there as it is seen.

use rayon::prelude::*;
use rustfft::num_complex::Complex64;
use rustfft::{Fft, FftPlanner};
use std::sync::Arc;

use super::illumination::IlluminationGrid;
use super::layers::DepthLayers;
use super::spreads::Spreads;
use etendue_optics::analysis::CellSpread;
use etendue_optics::analysis::quick_length;

/// Share of a spread that has to be known, as otherwise nothing is.
const KNOWN: f64 = 1e-6;

/// The scene along chief rays on cells of pixels.
pub(crate) struct CellPicture {
    /// Columns and rows of cells.
    pub(crate) size: [usize; 2],
    /// Cells a side of a pixel.
    pub(crate) cells: usize,
    /// Light by layer and band.
    pub(crate) light: Vec<Vec<Vec<f32>>>,
    /// Depths (m).
    pub(crate) depths: Vec<f32>,
}

/// Planes of one layer that are spread: its light, where it is, and where it could be seen.
struct LayerPlanes {
    light: Vec<Vec<f64>>,
    /// Of the rearmost, which nothing shines through, it is not asked.
    covers: Option<Vec<f64>>,
    known: Vec<f64>,
}

/// Light of one band on the cells of a picture, with what spreads it.
#[derive(Clone, Copy)]
struct BandLight<'a> {
    picture: &'a CellPicture,
    layers: &'a DepthLayers,
    spreads: &'a Spreads,
    band: usize,
    arrives: &'a IlluminationGrid,
}

/// Others' spreads reach at most so many times as far as those of a layer's own nodes.
const FARTHER: usize = 3;

/// The light of a band on pixels, for each layer of light, spread and multiplied by what arrives.
pub(crate) fn composed(
    picture: &CellPicture,
    layers: &DepthLayers,
    spreads: &Spreads,
    band: usize,
    arrives: &IlluminationGrid,
) -> Vec<Vec<f32>> {
    let band_light = BandLight { picture, layers, spreads, band, arrives };
    let pixels = picture.size.map(|side| side / picture.cells);
    let count = pixels[0] * pixels[1];
    let mut out = vec![vec![0.0_f64; count]; picture.light.len()];
    // What is black in front of nothing else changes nothing.
    let mut shines = vec![false; layers.nearness.len()];
    for light in &picture.light {
        for (&layer, &light) in layers.of_cell.iter().zip(&light[band]) {
            shines[usize::from(layer)] |= light != 0.0;
        }
    }
    let first = shines.iter().position(|shines| *shines).unwrap_or(shines.len());
    for layer in first..layers.nearness.len() {
        let LayerPlanes { light, covers, known } = spread_layer(band_light, layer, layer > first);
        for i in 0..count {
            if known[i] <= KNOWN {
                continue;
            }
            let behind =
                covers.as_ref().map_or(0.0, |covers| 1.0 - (covers[i] / known[i]).clamp(0.0, 1.0));
            for (out, light) in out.iter_mut().zip(&light) {
                out[i] = light[i] / known[i] + behind * out[i];
            }
        }
    }
    #[expect(clippy::cast_possible_truncation, reason = "as the film is kept")]
    let single = |plane: Vec<f64>| plane.into_iter().map(|value| value.max(0.0) as f32).collect();
    out.into_iter().map(single).collect()
}

/// A layer's light, cover where it is wanted, and knowledge, spread over the pixels.
fn spread_layer(band_light: BandLight<'_>, layer: usize, covers: bool) -> LayerPlanes {
    let BandLight { picture, layers, spreads, band, .. } = band_light;
    let pixels = picture.size.map(|side| side / picture.cells);
    let count = pixels[0] * pixels[1];
    let nodes = spreads.side * spreads.side;
    let windows: Vec<CellWindow> =
        (0..nodes).map(|node| CellWindow::of(node, spreads, picture.size)).collect();
    // The layer's cells, and how far their light gets.
    let grown = |margin: usize| {
        let [low, high] = layers.boxes[layer];
        [low.map(|at| at.saturating_sub(margin)), high.map(|at| at + margin)]
    };
    let meets = |node: usize, margin: usize| windows[node].within(grown(margin)).is_some();
    let farthest = |spreads: &[Option<CellSpread>]| {
        spreads.iter().flatten().map(|spread| spread.half).max().unwrap_or(0)
    };
    let of_layer = spreads.of_layer(|node| meets(node, 0), layer, band);
    let reach = farthest(&of_layer);
    // What is known is asked wherever that light gets.
    let margin = reach.saturating_mul(FARTHER + 1);
    let rest = spreads.of_layer(
        |node| meets(node, margin) && spreads.of_node(&of_layer, node).is_none(),
        layer,
        band,
    );
    let of_layer: Vec<_> = of_layer.into_iter().zip(rest).map(|(own, rest)| own.or(rest)).collect();
    let blocks: Vec<Vec<ConvolutionBlock>> = (0..nodes)
        .into_par_iter()
        .map(|node| {
            let Some((spread, mirrored)) = spreads.of_node(&of_layer, node) else {
                return Vec::new();
            };
            let Some(window) = windows[node].within(grown(reach + spread.half)) else {
                return Vec::new();
            };
            let filled = window.filled(band_light, layer, covers);
            if filled.iter().all(|plane| plane.iter().all(|value| *value == 0.0)) {
                return Vec::new();
            }
            window.spread(filled, spread, mirrored, picture)
        })
        .collect();
    let planes = picture.light.len() + usize::from(covers) + 1;
    let mut sums = vec![vec![0.0; count]; planes];
    for node in blocks {
        for (sum, block) in sums.iter_mut().zip(node) {
            block.add_to(sum, pixels[0]);
        }
    }
    let known = sums.pop().unwrap_or_default();
    let covers = if covers { sums.pop() } else { None };
    LayerPlanes { light: sums, covers, known }
}

/// Pixels of a part of the picture.
struct ConvolutionBlock {
    left: usize,
    top: usize,
    width: usize,
    values: Vec<f64>,
}

impl ConvolutionBlock {
    fn add_to(&self, sum: &mut [f64], width: usize) {
        for (row, values) in self.values.chunks(self.width.max(1)).enumerate() {
            let start = (self.top + row) * width + self.left;
            sum[start..start + self.width].iter_mut().zip(values).for_each(|(sum, v)| *sum += v);
        }
    }
}

/// The cells that light of a node belongs to, with its share of each column and row.
struct CellWindow {
    start: [usize; 2],
    shares: [Vec<f64>; 2],
}

impl CellWindow {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside a picture")]
    fn of(node: usize, spreads: &Spreads, size: [usize; 2]) -> Self {
        let side = spreads.side;
        let along = |node: usize, size: usize| {
            if spreads.is_uniform {
                let [first, last] = [node, node + 1].map(|node| node * size / side);
                return (first, vec![1.0; last - first]);
            }
            let step = size as f64 / (side - 1) as f64;
            let place = node as f64 * step;
            let first = (place - step).max(0.0).floor() as usize;
            let last = ((place + step).ceil() as usize).min(size);
            let share = |cell: usize| (1.0 - (cell as f64 + 0.5 - place).abs() / step).max(0.0);
            (first, (first..last).map(share).collect::<Vec<f64>>())
        };
        let (left, columns) = along(node % side, size[0]);
        let (top, rows) = along(node / side, size[1]);
        Self { start: [left, top], shares: [columns, rows] }
    }

    fn size(&self) -> [usize; 2] {
        [self.shares[0].len(), self.shares[1].len()]
    }

    /// The part of it that lies in a rectangle of cells; `None` where there is none.
    fn within(&self, [low, high]: [[usize; 2]; 2]) -> Option<Self> {
        let along = |axis: usize| {
            let (start, shares) = (self.start[axis], &self.shares[axis]);
            let first = low[axis].max(start) - start;
            let last = high[axis].min(start + shares.len()).saturating_sub(start);
            (first < last).then(|| (start + first, shares[first..last].to_vec()))
        };
        let ((left, columns), (top, rows)) = (along(0)?, along(1)?);
        Some(Self { start: [left, top], shares: [columns, rows] })
    }

    /// Light of each layer of light, cover where it is wanted, and what is known, by cell.
    fn filled(&self, band_light: BandLight<'_>, layer: usize, covers: bool) -> Vec<Vec<f64>> {
        let BandLight { picture, layers, band, arrives, .. } = band_light;
        let [width, height] = self.size();
        let kinds = picture.light.len();
        let known = kinds + usize::from(covers);
        let mut planes = vec![vec![0.0; width * height]; known + 1];
        let fine = picture.cells as f64;
        for row in 0..height {
            let y = self.start[1] + row;
            for column in 0..width {
                let x = self.start[0] + column;
                let at = y * picture.size[0] + x;
                let own = usize::from(layers.of_cell[at]);
                // What lies in front hides what is here.
                if own > layer {
                    continue;
                }
                let share = self.shares[0][column] * self.shares[1][row];
                let to = row * width + column;
                planes[known][to] = share;
                if own == layer {
                    if covers {
                        planes[kinds][to] = share;
                    }
                    let place = [x, y].map(|cell| (cell as f64 + 0.5) / fine);
                    let share = share * arrives.at(place);
                    for (plane, light) in planes.iter_mut().zip(&picture.light) {
                        plane[to] = share * f64::from(light[band][at]);
                    }
                }
            }
        }
        planes
    }

    /// The planes spread, on pixels.
    fn spread(
        &self,
        planes: Vec<Vec<f64>>,
        spread: &CellSpread,
        mirrored: [bool; 2],
        picture: &CellPicture,
    ) -> Vec<ConvolutionBlock> {
        let [width, height] = self.size();
        let half = spread.half;
        let size = [width, height].map(|side| quick_length(side + 2 * half));
        let transform = Fft2d::new(size);
        let side = 2 * half + 1;
        let mut kernel = vec![Complex64::ZERO; size[0] * size[1]];
        for row in 0..side {
            for column in 0..side {
                let share = spread.share([column, row], mirrored);
                kernel[row * size[0] + column] = Complex64::from(share);
            }
        }
        let kernel = transform.forward(kernel);
        let mut spread = Vec::with_capacity(planes.len());
        // Two real planes at a time, as one of complex numbers: the spread is real.
        for pair in planes.chunks(2) {
            let mut grid = vec![Complex64::ZERO; size[0] * size[1]];
            for row in 0..height {
                for column in 0..width {
                    let value = |plane: &Vec<f64>| plane[row * width + column];
                    let both = Complex64::new(value(&pair[0]), pair.get(1).map_or(0.0, value));
                    grid[row * size[0] + column] = both;
                }
            }
            let mut grid = transform.forward(grid);
            grid.iter_mut().zip(&kernel).for_each(|(value, by)| *value *= by);
            let grid = transform.back(grid);
            spread.push(self.binned(&grid, size, half, picture, |value| value.re));
            if pair.len() > 1 {
                spread.push(self.binned(&grid, size, half, picture, |value| value.im));
            }
        }
        spread
    }

    /// A spread plane's cells inside the picture, as means over pixels.
    fn binned(
        &self,
        grid: &[Complex64],
        size: [usize; 2],
        half: usize,
        picture: &CellPicture,
        part: impl Fn(&Complex64) -> f64,
    ) -> ConvolutionBlock {
        let n = picture.cells;
        // Cells of the picture that the light gets to: cell c of it is c + half - start of the grid.
        let range = |axis: usize| {
            let (start, len) = (self.start[axis], self.size()[axis]);
            (start.saturating_sub(half), (start + len + half).min(picture.size[axis]))
        };
        let ([x0, x1], [y0, y1]) = ([range(0).0, range(0).1], [range(1).0, range(1).1]);
        let (left, top) = (x0 / n, y0 / n);
        let width = x1.div_ceil(n) - left;
        let rows = y1.div_ceil(n) - top;
        let mut values = vec![0.0; width * rows];
        let scale = 1.0 / (n * n) as f64;
        for y in y0..y1 {
            let line = &grid[(y + half - self.start[1]) * size[0]..][..size[0]];
            let to = &mut values[(y / n - top) * width..][..width];
            for x in x0..x1 {
                to[x / n - left] += scale * part(&line[x + half - self.start[0]]);
            }
        }
        ConvolutionBlock { left, top, width, values }
    }
}

/// Two-dimensional transforms of one size.
struct Fft2d {
    size: [usize; 2],
    plans: [[Arc<dyn Fft<f64>>; 2]; 2],
}

impl Fft2d {
    fn new(size: [usize; 2]) -> Self {
        let mut planner = FftPlanner::new();
        let plans =
            size.map(|side| [planner.plan_fft_forward(side), planner.plan_fft_inverse(side)]);
        Self { size, plans }
    }

    /// The transform, columns and rows exchanged.
    fn forward(&self, mut grid: Vec<Complex64>) -> Vec<Complex64> {
        self.plans[0][0].process(&mut grid);
        let mut turned = transposed(&grid, self.size[0]);
        self.plans[1][0].process(&mut turned);
        turned
    }

    /// Its inverse.
    fn back(&self, mut turned: Vec<Complex64>) -> Vec<Complex64> {
        self.plans[1][1].process(&mut turned);
        let mut grid = transposed(&turned, self.size[1]);
        self.plans[0][1].process(&mut grid);
        let scale = 1.0 / (self.size[0] * self.size[1]) as f64;
        grid.iter_mut().for_each(|value| *value *= scale);
        grid
    }
}

/// Rows of so many values as columns.
fn transposed(grid: &[Complex64], width: usize) -> Vec<Complex64> {
    /// Squares of values that stay in the nearest cache.
    const SQUARE: usize = 16;
    let height = grid.len() / width.max(1);
    let mut turned = vec![Complex64::ZERO; grid.len()];
    for top in (0..height).step_by(SQUARE) {
        for left in (0..width).step_by(SQUARE) {
            for y in top..(top + SQUARE).min(height) {
                for x in left..(left + SQUARE).min(width) {
                    turned[x * height + y] = grid[y * width + x];
                }
            }
        }
    }
    turned
}
