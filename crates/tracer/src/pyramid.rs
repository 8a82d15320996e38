//! An image in ever fewer texels, each the mean of those that it covers (Williams, "Pyramidal
//! Parametrics", 1983).
//!
//! Means are of linear light, in 16 bits a channel: an 8-bit mean in the file's own curve would be off
//! by half a percent. Those of floats, which have no upper end, are f32. A pyramid takes two thirds of
//! the memory of its image, or a third where that has 16 bits or f32.

use etendue_image::{DecodeError, Raster, Samples, room};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Treatment of texture coordinates outside 0..=1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Wrap {
    /// The image repeats.
    #[default]
    Repeat,
    /// Every other copy is mirrored.
    MirroredRepeat,
    /// The border goes on.
    ClampToEdge,
}

/// The levels above the image itself.
#[derive(Debug, Clone)]
pub(crate) struct Pyramid {
    levels: Vec<Level>,
}

#[derive(Debug, Clone)]
struct Level {
    raster: Raster,
}

impl Pyramid {
    /// Over `image`, whose linear texel of a number is `texel`; `bytes` has that of each byte of a colour, where the
    /// image has bytes.
    ///
    /// # Errors
    ///
    /// When there is no memory for it.
    pub(crate) fn new(
        image: &Raster,
        texel: impl Fn(usize) -> [f64; 4],
        bytes: impl Fn() -> [f64; 256],
    ) -> Result<Self, DecodeError> {
        let mut levels = Vec::new();
        if image.len() <= 1 {
            return Ok(Self { levels });
        }
        let evenly = match image.samples() {
            Samples::U8(values) if is_even(image.size()) => {
                let colour = bytes();
                // Alpha is linear.
                let alpha = std::array::from_fn(|i| i as f64 / 255.0);
                Some(halved_evenly(image.size(), image.channels(), values, [&colour, &alpha])?)
            }
            Samples::U8(_) | Samples::U16(_) | Samples::F16(_) | Samples::F32(_) => None,
        };
        let width = image.size()[0];
        let mut next = match evenly {
            Some(next) => next,
            None => halved(image.size(), image.channels(), |x, y| texel(y * width + x))?,
        };
        loop {
            levels.push(Level::new(&next, image.is_float())?);
            if next.len() == 1 {
                return Ok(Self { levels });
            }
            next = match next.samples() {
                Samples::F32(values) if is_even(next.size()) => {
                    halved_singles(next.size(), next.channels(), values)?
                }
                Samples::U8(_) | Samples::U16(_) | Samples::F16(_) | Samples::F32(_) => {
                    let width = next.size()[0];
                    halved(next.size(), next.channels(), |x, y| next.texel(y * width + x))?
                }
            };
        }
    }

    /// Number of levels above the image.
    pub(crate) fn len(&self) -> usize {
        self.levels.len()
    }

    /// Bytes of all levels.
    pub(crate) fn bytes(&self) -> usize {
        self.levels.iter().map(|level| level.raster.bytes()).sum()
    }

    /// The value at (u, v) of a level, counted from 1, interpolated.
    pub(crate) fn sample(&self, level: usize, [u, v]: [f64; 2], wrap: [Wrap; 2]) -> [f64; 4] {
        let Some(level) = self.levels.get(level.min(self.levels.len()).wrapping_sub(1)) else {
            return [0.0, 0.0, 0.0, 1.0];
        };
        let [width, height] = level.raster.size();
        let (x, y) = (u * width as f64 - 0.5, v * height as f64 - 0.5);
        bilinear([x, y], |x, y| level.texel(x, y, wrap))
    }
}

impl Level {
    /// Keeps `means`, in 16 bits where they have an upper end.
    fn new(means: &Raster, is_float: bool) -> Result<Self, DecodeError> {
        let Samples::F32(values) = means.samples() else { return Err(DecodeError::no_color()) };
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "in 0..=65535; the cast saturates"
        )]
        let samples = if is_float {
            let mut kept = room(values.len())?;
            kept.extend_from_slice(values);
            Samples::F32(kept)
        } else {
            let mut kept = room(values.len())?;
            kept.extend(values.iter().map(|c| (c * 65_535.0).round() as u16));
            Samples::U16(kept)
        };
        Ok(Self { raster: Raster::new(means.size(), means.channels(), samples) })
    }

    fn texel(&self, x: f64, y: f64, wrap: [Wrap; 2]) -> [f64; 4] {
        let [width, height] = self.raster.size();
        let column = wrap[0].apply(x, width);
        let row = wrap[1].apply(y, height);
        self.raster.texel(row * width + column)
    }
}

/// Tests whether each texel of half as many columns and rows is the mean of four.
fn is_even(size: [usize; 2]) -> bool {
    size.iter().all(|side| side.is_multiple_of(2))
}

/// [`halved`] of bytes with even sides, to the bit: what each stands for in a colour, and in alpha, is looked up.
fn halved_evenly(
    size: [usize; 2],
    channels: usize,
    values: &[u8],
    [colour, alpha]: [&[f64; 256]; 2],
) -> Result<Raster, DecodeError> {
    let value = |byte: u8, k: usize| match channels.is_multiple_of(2) && k + 1 == channels {
        true => alpha[usize::from(byte)],
        false => colour[usize::from(byte)],
    };
    match channels {
        1 => means::<1, u8>(size, values, value),
        2 => means::<2, u8>(size, values, value),
        3 => means::<3, u8>(size, values, value),
        _ => means::<4, u8>(size, values, value),
    }
}

/// The same of single precision.
fn halved_singles(
    size: [usize; 2],
    channels: usize,
    values: &[f32],
) -> Result<Raster, DecodeError> {
    let value = |value: f32, _: usize| f64::from(value);
    match channels {
        1 => means::<1, f32>(size, values, value),
        2 => means::<2, f32>(size, values, value),
        3 => means::<3, f32>(size, values, value),
        _ => means::<4, f32>(size, values, value),
    }
}

/// Of each two columns and rows the means of `C` channels, added up as [`halved`] does: a quarter is a power of two,
/// by which the sum may be multiplied in the place of what is summed.
fn means<const C: usize, T: Copy>(
    [width, height]: [usize; 2],
    values: &[T],
    value: impl Fn(T, usize) -> f64,
) -> Result<Raster, DecodeError> {
    let size = [width / 2, height / 2];
    let mut means = room(size[0] * size[1] * C)?;
    for rows in values.chunks_exact(2 * width * C) {
        let (upper, lower) = rows.split_at(width * C);
        for (upper, lower) in upper.chunks_exact(2 * C).zip(lower.chunks_exact(2 * C)) {
            for k in 0..C {
                let upper = value(upper[k], k) + value(upper[C + k], k);
                let sum = upper + value(lower[k], k) + value(lower[C + k], k);
                #[expect(
                    clippy::cast_possible_truncation,
                    reason = "means are kept in f32 or less"
                )]
                means.push((0.25 * sum) as f32);
            }
        }
    }
    Ok(Raster::new(size, C, Samples::F32(means)))
}

/// Half as many columns and rows, rounded down; where that leaves a rest, texels are split among
/// their neighbours, so that the mean of the image stays.
fn halved(
    [width, height]: [usize; 2],
    channels: usize,
    texel: impl Fn(usize, usize) -> [f64; 4],
) -> Result<Raster, DecodeError> {
    let size = [(width / 2).max(1), (height / 2).max(1)];
    let (columns, rows) = (shares(width, size[0]), shares(height, size[1]));
    let mut values = room(size[0] * size[1] * channels)?;
    // Each texel is the mean of those below it, by the share that it has of them.
    for row in &rows {
        for column in &columns {
            let mut sum = [0.0; 4];
            for &(y, share_y) in row {
                for &(x, share_x) in column {
                    let value = texel(x, y);
                    for (sum, value) in sum.iter_mut().zip(value) {
                        *sum += share_x * share_y * value;
                    }
                }
            }
            #[expect(clippy::cast_possible_truncation, reason = "means are kept in f32 or less")]
            let [r, g, b, alpha] = sum.map(|c| c as f32);
            match channels {
                1 => values.push(r),
                2 => values.extend([r, alpha]),
                3 => values.extend([r, g, b]),
                _ => values.extend([r, g, b, alpha]),
            }
        }
    }
    Ok(Raster::new(size, channels, Samples::F32(values)))
}

/// For each of `to` intervals, which of `from` it covers and by what share of itself.
fn shares(from: usize, to: usize) -> Vec<Vec<(usize, f64)>> {
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
                    (k, covered / wide)
                })
                .filter(|(_, share)| *share > 0.0)
                .collect()
        })
        .collect()
}

/// Interpolates between the four texels nearest to a place, whose centres are at whole numbers.
pub(crate) fn bilinear([x, y]: [f64; 2], at: impl Fn(f64, f64) -> [f64; 4]) -> [f64; 4] {
    let (x0, y0) = (x.floor(), y.floor());
    let (fx, fy) = (x - x0, y - y0);
    let (a, b) = (at(x0, y0), at(x0 + 1.0, y0));
    let (c, d) = (at(x0, y0 + 1.0), at(x0 + 1.0, y0 + 1.0));
    std::array::from_fn(|k| {
        let top = a[k] + (b[k] - a[k]) * fx;
        let bottom = c[k] + (d[k] - c[k]) * fx;
        top + (bottom - top) * fy
    })
}

impl Wrap {
    /// Column or row `x` (a whole number) of `size` after wrapping.
    pub(crate) fn apply(self, x: f64, size: usize) -> usize {
        let n = size as f64;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "within the image, where most are"
        )]
        if (0.0..n).contains(&x) {
            return x as usize;
        }
        let wrapped = match self {
            Self::Repeat => x.rem_euclid(n),
            Self::MirroredRepeat => {
                let m = x.rem_euclid(2.0 * n);
                if m < n { m } else { 2.0 * n - 1.0 - m }
            }
            Self::ClampToEdge => x,
        };
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to the image; the cast saturates"
        )]
        let index = wrapped.clamp(0.0, n - 1.0) as usize;
        index.min(size - 1)
    }
}

/// The mean of a wave that is 1 in even intervals of length 1 and −1 in odd ones, over `width` around
/// `x`.
pub(crate) fn mean_of_squares(x: f64, width: f64) -> f64 {
    let (a, b) = (x - 0.5 * width, x + 0.5 * width);
    let (low, high) = (a.floor(), b.floor());
    if low == high || b - a <= 0.0 {
        return if x.floor().rem_euclid(2.0) < 1.0 { 1.0 } else { -1.0 };
    }
    // The wave's integral from 0.
    let integral = |x: f64| {
        let m = x.rem_euclid(2.0);
        if m < 1.0 { m } else { 2.0 - m }
    };
    ((integral(b) - integral(a)) / (b - a)).clamp(-1.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_level_has_the_images_mean() {
        for (width, height) in [(8, 8), (7, 5), (1, 9), (13, 1), (6, 3)] {
            #[expect(clippy::cast_precision_loss, reason = "small numbers")]
            let value = |x: usize, y: usize| ((x * 37 + y * 101) % 16) as f64 / 15.0;
            let image = Raster::new([width, height], 4, Samples::U16(vec![0; 4 * width * height]));
            let at = |k: usize| [value(k % width, k / width), 0.0, 1.0, 0.5];
            let pyramid = Pyramid::new(&image, at, || unreachable!()).unwrap();
            let count = f64::from(u32::try_from(width * height).unwrap());
            let all = (0..width * height).map(|k| value(k % width, k / width));
            let mean: f64 = all.sum::<f64>() / count;
            for (number, level) in pyramid.levels.iter().enumerate() {
                let count = level.raster.len();
                let sum: f64 = (0..count).map(|i| level.raster.texel(i)[0]).sum();
                let own = sum / count as f64;
                // Half a step of 16 bits, and a rounding of f32 a level.
                assert!((own - mean).abs() < 1e-5, "{width} {height} level {number}: {own} {mean}");
            }
            let top = pyramid.levels.last().unwrap();
            assert_eq!(top.raster.size(), [1, 1]);
            assert_eq!(top.raster.texel(0)[1..3], [0.0, 1.0]);
        }
    }

    #[test]
    fn even_sides_are_halved_as_any_are_to_the_bit() {
        let curve: [f64; 256] = std::array::from_fn(|i| (i as f64 / 255.0).powf(2.2));
        let linear: [f64; 256] = std::array::from_fn(|i| i as f64 / 255.0);
        for channels in 1..=4 {
            let size = [12, 8];
            let byte = |i: usize| u8::try_from(i * 89 % 256).unwrap();
            let bytes: Vec<u8> = (0..96 * channels).map(byte).collect();
            // As a texel of so many channels spreads over red, green, blue and alpha.
            let texel = |x: usize, y: usize| {
                let at = |k: usize| usize::from(bytes[(y * 12 + x) * channels + k]);
                match channels {
                    1 => [curve[at(0)], curve[at(0)], curve[at(0)], 1.0],
                    2 => [curve[at(0)], curve[at(0)], curve[at(0)], linear[at(1)]],
                    3 => [curve[at(0)], curve[at(1)], curve[at(2)], 1.0],
                    _ => [curve[at(0)], curve[at(1)], curve[at(2)], linear[at(3)]],
                }
            };
            let bits = |raster: &Raster| match raster.samples() {
                Samples::F32(values) => values.iter().map(|v| v.to_bits()).collect::<Vec<u32>>(),
                _ => panic!("means are single"),
            };
            let any = halved(size, channels, texel).unwrap();
            let even = halved_evenly(size, channels, &bytes, [&curve, &linear]).unwrap();
            assert_eq!(bits(&any), bits(&even), "{channels} channels");
            let Samples::F32(values) = any.samples() else { panic!("means are single") };
            let again = halved(any.size(), channels, |x, y| any.texel(y * 6 + x)).unwrap();
            assert_eq!(bits(&again), bits(&halved_singles(any.size(), channels, values).unwrap()));
        }
    }

    #[test]
    fn squares_have_their_mean() {
        assert_eq!(mean_of_squares(0.5, 0.4), 1.0);
        assert_eq!(mean_of_squares(-0.5, 0.4), -1.0);
        assert_eq!(mean_of_squares(1.5, 0.0), -1.0);
        // Two whole periods, half of each sort, and three quarters of one square.
        assert!(mean_of_squares(0.3, 4.0).abs() < 1e-15);
        assert!(mean_of_squares(1.0, 1.0).abs() < 1e-15);
        assert!((mean_of_squares(0.75, 1.0) - 0.5).abs() < 1e-15);
        assert!(mean_of_squares(0.1, 1e6).abs() < 1e-6);
    }
}
