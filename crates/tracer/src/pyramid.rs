//! An image in ever fewer texels, each the mean of those that it covers (Williams, "Pyramidal
//! Parametrics", 1983).
//!
//! Means are of linear light, in 16 bits a channel: an 8-bit mean in the file's own curve would be off
//! by half a percent. A pyramid takes two thirds of its image's memory.

use crate::texture::{Wrap, bilinear};

/// The levels above the image itself.
#[derive(Debug, Clone)]
pub(crate) struct Pyramid {
    levels: Vec<Level>,
}

#[derive(Debug, Clone)]
struct Level {
    width: usize,
    height: usize,
    texels: Vec<[u16; 4]>,
}

/// Linear values while levels are made.
struct Floats {
    width: usize,
    height: usize,
    texels: Vec<[f32; 4]>,
}

impl Pyramid {
    /// Over an image of `width` × `height` whose linear texel in a column and row is `texel`.
    pub(crate) fn new(
        [width, height]: [usize; 2],
        texel: impl Fn(usize, usize) -> [f32; 4],
    ) -> Self {
        let mut levels = Vec::new();
        if width * height <= 1 {
            return Self { levels };
        }
        let mut next = halved([width, height], texel);
        loop {
            levels.push(Level::new(&next));
            if next.width * next.height == 1 {
                return Self { levels };
            }
            let Floats { width, height, texels } = next;
            next = halved([width, height], |x, y| texels[y * width + x]);
        }
    }

    /// How many levels there are above the image.
    pub(crate) fn len(&self) -> usize {
        self.levels.len()
    }

    /// Bytes of all levels.
    pub(crate) fn bytes(&self) -> usize {
        self.levels.iter().map(|level| level.texels.len() * size_of::<[u16; 4]>()).sum()
    }

    /// The value at (u, v) of a level, counted from 1, interpolated.
    pub(crate) fn sample(&self, level: usize, [u, v]: [f64; 2], wrap: [Wrap; 2]) -> [f64; 4] {
        let Some(level) = self.levels.get(level.min(self.levels.len()).wrapping_sub(1)) else {
            return [0.0, 0.0, 0.0, 1.0];
        };
        let (x, y) = (u * level.width as f64 - 0.5, v * level.height as f64 - 0.5);
        bilinear([x, y], |x, y| level.texel(x, y, wrap))
    }
}

impl Level {
    fn new(floats: &Floats) -> Self {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "in 0..=65535; the cast saturates"
        )]
        let texels = floats.texels.iter().map(|t| t.map(|c| (c * 65_535.0).round() as u16));
        Self { width: floats.width, height: floats.height, texels: texels.collect() }
    }

    fn texel(&self, x: f64, y: f64, wrap: [Wrap; 2]) -> [f64; 4] {
        let column = wrap[0].apply(x, self.width);
        let row = wrap[1].apply(y, self.height);
        self.texels[row * self.width + column].map(|c| f64::from(c) / 65_535.0)
    }
}

/// Half as many columns and rows, rounded down; where that leaves a rest, texels are split among
/// their neighbours, so that the mean of the image stays.
fn halved([width, height]: [usize; 2], texel: impl Fn(usize, usize) -> [f32; 4]) -> Floats {
    let size = [(width / 2).max(1), (height / 2).max(1)];
    let (columns, rows) = (shares(width, size[0]), shares(height, size[1]));
    let mut texels = Vec::with_capacity(size[0] * size[1]);
    for row in &rows {
        for column in &columns {
            let mut sum = [0.0_f32; 4];
            for &(y, share_y) in row {
                for &(x, share_x) in column {
                    let value = texel(x, y);
                    for (sum, value) in sum.iter_mut().zip(value) {
                        *sum += share_x * share_y * value;
                    }
                }
            }
            texels.push(sum);
        }
    }
    Floats { width: size[0], height: size[1], texels }
}

/// For each of `to` intervals, which of `from` it covers and by what share of itself.
fn shares(from: usize, to: usize) -> Vec<Vec<(usize, f32)>> {
    let wide = from as f64 / to as f64;
    (0..to)
        .map(|i| {
            let (start, end) = (i as f64 * wide, (i + 1) as f64 * wide);
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "counts of texels"
            )]
            let (first, last) = (start.floor() as usize, (end.ceil() as usize).min(from));
            (first..last)
                .map(|k| {
                    let covered = end.min((k + 1) as f64) - start.max(k as f64);
                    #[expect(clippy::cast_possible_truncation, reason = "a weight")]
                    let share = (covered / wide) as f32;
                    (k, share)
                })
                .filter(|(_, share)| *share > 0.0)
                .collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_level_has_the_images_mean() {
        for (width, height) in [(8, 8), (7, 5), (1, 9), (13, 1), (6, 3)] {
            #[expect(clippy::cast_precision_loss, reason = "small numbers")]
            let value = |x: usize, y: usize| ((x * 37 + y * 101) % 16) as f32 / 15.0;
            let pyramid = Pyramid::new([width, height], |x, y| [value(x, y), 0.0, 1.0, 0.5]);
            let count = f64::from(u32::try_from(width * height).unwrap());
            let all = (0..width * height).map(|k| f64::from(value(k % width, k / width)));
            let mean: f64 = all.sum::<f64>() / count;
            for (number, level) in pyramid.levels.iter().enumerate() {
                let sum: f64 = level.texels.iter().map(|t| f64::from(t[0])).sum();
                let own = sum / level.texels.len() as f64 / 65_535.0;
                // Half a step of 16 bits, and a rounding of f32 a level.
                assert!((own - mean).abs() < 1e-5, "{width} {height} level {number}: {own} {mean}");
            }
            let top = pyramid.levels.last().unwrap();
            assert_eq!((top.width, top.height), (1, 1));
            assert_eq!(top.texels[0][1..3], [0, 65_535]);
        }
    }
}
