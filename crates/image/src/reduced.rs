//! Images in fewer texels than their files have: each the mean of those that it covers, of linear light.
//!
//! Sides are halved as often as they are even, a row at a time, so that of a PNG file no more than a few rows are held.
//! The means are those of a pyramid over the whole image (L. Williams, "Pyramidal parametrics", 1983) before it is
//! rounded to 16 bits.

use std::io::Cursor;

use crate::raster::linear_of_bytes;
use crate::{Coarseness, DecodeError, Limits, Raster, Samples, room};

/// `raster` as coarse as it may be; as it is where that is as fine.
pub(crate) fn reduced(raster: Raster, coarse: Coarseness) -> Result<Raster, DecodeError> {
    let (size, channels) = (raster.size(), raster.channels());
    let mut rows = RowReduction::new(size, channels, coarse)?;
    if rows.halvings == 0 {
        return Ok(raster);
    }
    let mut row = room(size[0] * channels)?;
    for y in 0..size[1] {
        row.clear();
        for index in y * size[0]..(y + 1) * size[0] {
            let [r, g, b, alpha] = match coarse.is_srgb {
                true => raster.linear(index),
                false => raster.texel(index),
            };
            match channels {
                1 => row.push(r),
                2 => row.extend([r, alpha]),
                3 => row.extend([r, g, b]),
                _ => row.extend([r, g, b, alpha]),
            }
        }
        rows.push(&row);
    }
    Ok(rows.finish())
}

/// Decodes a PNG file of bytes, row by row, as coarse as it may be; `None` of other files, and where it is to be as fine
/// as it is.
pub(crate) fn png(bytes: &[u8], limits: Limits) -> Result<Option<Raster>, DecodeError> {
    let Some(coarse) = limits.coarse.filter(|_| bytes.starts_with(b"\x89PNG\r\n\x1a\n")) else {
        return Ok(None);
    };
    let fault = |error: png::DecodingError| {
        let format = image::error::ImageFormatHint::Exact(image::ImageFormat::Png);
        let error = image::error::DecodingError::new(format, error);
        DecodeError::Decoder(image::ImageError::Decoding(error))
    };
    // What the decoder keeps beside the texels: lines, tables, profiles.
    let own = usize::try_from(limits.bytes.saturating_add(1 << 26)).unwrap_or(usize::MAX);
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), png::Limits { bytes: own });
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(fault)?;
    let (color, depth) = reader.output_color_type();
    let size = [reader.info().width, reader.info().height];
    let is_plain = depth == png::BitDepth::Eight && !reader.info().interlaced;
    let channels = color.samples();
    limits.judge(
        size.map(u64::from),
        channels as u64 * if depth == png::BitDepth::Sixteen { 2 } else { 1 },
    )?;
    let size = size.map(|side| side as usize);
    let mut rows = RowReduction::new(size, channels, coarse)?;
    if !is_plain || rows.halvings == 0 {
        return Ok(None);
    }
    let linear: [f64; 256] = std::array::from_fn(|byte| byte as f64 / 255.0);
    let colour = if coarse.is_srgb { linear_of_bytes() } else { &linear };
    let alpha = channels.is_multiple_of(2).then_some(channels - 1);
    let mut row = room(size[0] * channels)?;
    while let Some(texels) = reader.next_row().map_err(fault)? {
        row.clear();
        match alpha {
            None => row.extend(texels.data().iter().map(|&byte| colour[usize::from(byte)])),
            Some(alpha) => {
                for texel in texels.data().chunks_exact(channels) {
                    row.extend(texel[..alpha].iter().map(|&byte| colour[usize::from(byte)]));
                    row.push(linear[usize::from(texel[alpha])]);
                }
            }
        }
        rows.push(&row);
    }
    Ok(Some(rows.finish()))
}

/// Rows on their way to fewer.
struct RowReduction {
    size: [usize; 2],
    channels: usize,
    halvings: u32,
    /// Of each halving a row that waits for the one below it, of what it is halved from.
    waiting: Vec<Vec<f64>>,
    /// A row of means, while it is made.
    means: Vec<f64>,
    made: Vec<f32>,
}

impl RowReduction {
    fn new(size: [usize; 2], channels: usize, coarse: Coarseness) -> Result<Self, DecodeError> {
        let halvings = coarse.halvings(size);
        let made = (size[0] >> halvings) * (size[1] >> halvings) * channels;
        let waiting = vec![Vec::new(); halvings as usize];
        let made = room(if halvings > 0 { made } else { 0 })?;
        Ok(Self { size, channels, halvings, waiting, means: Vec::new(), made })
    }

    /// The next row of the image.
    fn push(&mut self, row: &[f64]) {
        self.push_at(0, row);
    }

    fn push_at(&mut self, level: usize, row: &[f64]) {
        let Some(upper) = self.waiting.get_mut(level) else {
            #[expect(clippy::cast_possible_truncation, reason = "they were rounded to it")]
            self.made.extend(row.iter().map(|&mean| mean as f32));
            return;
        };
        if upper.is_empty() {
            upper.extend_from_slice(row);
            return;
        }
        let mut means = std::mem::take(&mut self.means);
        means.clear();
        let channels = self.channels;
        for (upper, lower) in upper.chunks_exact(2 * channels).zip(row.chunks_exact(2 * channels)) {
            for k in 0..channels {
                let sum = upper[k] + upper[channels + k] + lower[k] + lower[channels + k];
                // As a level of a pyramid keeps it.
                #[expect(clippy::cast_possible_truncation, reason = "means are kept in f32")]
                means.push(f64::from((0.25 * sum) as f32));
            }
        }
        upper.clear();
        self.push_at(level + 1, &means);
        self.means = means;
    }

    fn finish(mut self) -> Raster {
        let size = self.size.map(|side| side >> self.halvings);
        // A file that ends too soon is black from there on.
        self.made.resize(size[0] * size[1] * self.channels, 0.0);
        Raster::new(size, self.channels, Samples::F32(self.made))
    }
}

#[cfg(test)]
mod tests {
    use image::{DynamicImage, ImageFormat};

    use super::*;
    use crate::{decode, linear_from_srgb};

    fn encoded(image: &DynamicImage, format: ImageFormat) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        image.write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    }

    fn noise(width: u32, height: u32) -> DynamicImage {
        let mut state = 1_u32;
        let mut byte = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state.to_be_bytes()[0]
        };
        let texels = (0..4 * width * height).map(|_| byte()).collect();
        DynamicImage::ImageRgba8(image::RgbaImage::from_raw(width, height, texels).unwrap())
    }

    fn within(footprint: f64, is_srgb: bool) -> Limits {
        Limits::default().coarse(Some(Coarseness { footprint, is_srgb }))
    }

    #[test]
    fn sides_are_halved_as_long_as_texels_are_no_wider_than_what_is_averaged() {
        let halvings =
            |footprint: f64, size| Coarseness { footprint, is_srgb: true }.halvings(size);
        // Of 4096 texels a share of 21 of them is at least 16 wide.
        assert_eq!(halvings(21.0 / 4096.0, [4096, 4096]), 4);
        assert_eq!(halvings(16.0 / 4096.0, [4096, 4096]), 4);
        assert_eq!(halvings(15.9 / 4096.0, [4096, 4096]), 3);
        assert_eq!(halvings(0.5 / 4096.0, [4096, 4096]), 0, "magnified");
        // The shorter side counts, and odd sides are left.
        assert_eq!(halvings(16.0 / 1024.0, [4096, 1024]), 4);
        assert_eq!(halvings(0.5, [3000, 3000]), 3);
        assert_eq!(halvings(f64::NAN, [64, 64]), 0);
    }

    #[test]
    fn means_are_of_linear_light_and_the_same_by_rows_as_of_the_whole_image() {
        for channels in 1..=4_u8 {
            let image = noise(24, 16);
            let image = match channels {
                1 => DynamicImage::ImageLuma8(image.to_luma8()),
                2 => DynamicImage::ImageLumaA8(image.to_luma_alpha8()),
                3 => DynamicImage::ImageRgb8(image.to_rgb8()),
                _ => image,
            };
            let bytes = encoded(&image, ImageFormat::Png);
            let whole = decode(&bytes, Limits::default()).unwrap();
            for is_srgb in [true, false] {
                // A quarter of 16 rows: four texels a side.
                let rows = png(&bytes, within(0.25, is_srgb)).unwrap().expect("by rows");
                assert_eq!((rows.size(), rows.channels()), ([6, 4], usize::from(channels)));
                let coarse = Coarseness { footprint: 0.25, is_srgb };
                let other = reduced(whole.clone(), coarse).unwrap();
                for i in 0..rows.len() {
                    assert_eq!(rows.texel(i), other.texel(i), "{channels} channels");
                    let mut sum = [0.0; 4];
                    for k in 0..16 {
                        let at = (4 * (i / 6) + k / 4) * 24 + 4 * (i % 6) + k % 4;
                        let texel = if is_srgb { whole.linear(at) } else { whole.texel(at) };
                        sum.iter_mut().zip(texel).for_each(|(sum, c)| *sum += c / 16.0);
                    }
                    for (own, sum) in rows.texel(i).into_iter().zip(sum) {
                        // Two roundings of f32.
                        assert!((own - sum).abs() < 2e-7, "{channels} channels: {own} {sum}");
                    }
                }
            }
        }
        // Black and white are half of the light, not of the bytes.
        let checker = |x: u32, y: u32| image::Luma([255 * u8::from((x + y).is_multiple_of(2))]);
        let checker = DynamicImage::ImageLuma8(image::ImageBuffer::from_fn(8, 8, checker));
        let bytes = encoded(&checker, ImageFormat::Png);
        let mean = decode(&bytes, within(1.0, true)).unwrap();
        assert_eq!((mean.size(), mean.linear(0)[0]), ([1, 1], 0.5));
        assert!(linear_from_srgb(0.5) < 0.22);
    }

    #[test]
    fn other_files_are_decoded_whole_and_then_reduced() {
        let grey =
            DynamicImage::ImageRgb8(image::RgbImage::from_pixel(64, 32, image::Rgb([128; 3])));
        let jpeg = decode(&encoded(&grey, ImageFormat::Jpeg), within(8.0 / 32.0, true)).unwrap();
        assert_eq!(jpeg.size(), [8, 4]);
        assert!((jpeg.linear(5)[1] - linear_from_srgb(128.0 / 255.0)).abs() < 1e-6);
        let deep = DynamicImage::ImageLuma16(image::ImageBuffer::from_pixel(
            16,
            16,
            image::Luma([40_000]),
        ));
        let deep = decode(&encoded(&deep, ImageFormat::Png), within(2.0 / 16.0, false)).unwrap();
        assert_eq!(deep.size(), [8, 8]);
        assert!((deep.texel(0)[0] - 40_000.0 / 65_535.0).abs() < 1e-6);
        // Too coarse for nothing: as fine as the file.
        let fine = decode(&encoded(&grey, ImageFormat::Png), within(0.5 / 32.0, true)).unwrap();
        assert_eq!((fine.size(), fine.is_float()), ([64, 32], false));
    }

    #[test]
    fn what_is_broken_or_too_large_is_refused_as_it_is_else() {
        let bytes = encoded(&noise(64, 64), ImageFormat::Png);
        let cut = decode(&bytes[..bytes.len() / 2], within(0.5, true));
        assert!(matches!(cut, Err(DecodeError::Decoder(_))), "{cut:?}");
        let small = Limits { bytes: 100, ..within(0.5, true) };
        assert!(matches!(decode(&bytes, small), Err(DecodeError::Size { .. })));
    }
}
