//! Charts as files: SVG for pages, PNG for everywhere else.

use std::sync::Arc;

use etendue_chart::{Chart, Theme};
use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree, fontdb};

use crate::BenchError;
use crate::target::Strip;

/// Letters for machines without fonts; `data/DejaVuSans-LICENSE` tells where they come from.
const FONT: &[u8] = include_bytes!("../data/DejaVuSans-Latin.ttf");

/// Pixels of a PNG for one of the SVG: sharp on dense screens.
const SCALE: f32 = 2.0;

/// The chart as the bytes of a PNG, in light colours.
///
/// # Errors
///
/// When the chart's own SVG cannot be read back or has no size: a fault of this program.
pub fn png(chart: &Chart) -> Result<Vec<u8>, BenchError> {
    let fault = |why: String| BenchError::Drawing(why);
    let mut fonts = fontdb::Database::new();
    fonts.load_font_data(FONT.to_vec());
    fonts.set_sans_serif_family("DejaVu Sans");
    let options = Options { fontdb: Arc::new(fonts), ..Options::default() };
    let tree =
        Tree::from_str(&chart.svg(Theme::Light), &options).map_err(|e| fault(e.to_string()))?;
    let size = tree.size().to_int_size().scale_by(SCALE);
    let size = size.ok_or_else(|| fault("it has no size".to_owned()))?;
    let pixels = Pixmap::new(size.width(), size.height());
    let mut pixels = pixels.ok_or_else(|| fault("it is too large".to_owned()))?;
    resvg::render(&tree, Transform::from_scale(SCALE, SCALE), &mut pixels.as_mut());
    encode(&pixels).map_err(|error| fault(error.to_string()))
}

/// Pictures side by side, with a white line between, as the bytes of a PNG.
///
/// # Errors
///
/// When they are larger than a PNG may be: a fault of this program.
pub fn strip(strip: &Strip) -> Result<Vec<u8>, BenchError> {
    const LINE: [u8; 6] = [255; 6];
    let ([width, height], count) = (strip.side, strip.pictures.len());
    let mut rgb = Vec::new();
    for row in 0..height {
        for (k, picture) in strip.pictures.iter().enumerate() {
            rgb.extend(&LINE[..if k > 0 { LINE.len() } else { 0 }]);
            rgb.extend(&picture[3 * row * width..3 * (row + 1) * width]);
        }
    }
    let fault = |why: String| BenchError::Drawing(why);
    let columns = (width + LINE.len() / 3) * count - LINE.len() / 3;
    let side = |side: usize| u32::try_from(side).map_err(|error| fault(error.to_string()));
    encode_rgb([side(columns)?, side(height)?], &rgb).map_err(|error| fault(error.to_string()))
}

/// Opaque pixels, as the paper covers all of a chart.
fn encode(pixels: &Pixmap) -> Result<Vec<u8>, png::EncodingError> {
    let rgb: Vec<u8> =
        pixels.pixels().iter().flat_map(|p| [p.red(), p.green(), p.blue()]).collect();
    encode_rgb([pixels.width(), pixels.height()], &rgb)
}

fn encode_rgb([width, height]: [u32; 2], rgb: &[u8]) -> Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(rgb)?;
    writer.finish()?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use etendue_chart::{Axis, Series};

    #[test]
    fn a_strip_has_its_pictures_side_by_side() {
        let strip = Strip {
            side: [2, 1],
            corner: [0, 0],
            pictures: vec![vec![0, 0, 0, 9, 9, 9], vec![5, 6, 7, 1, 2, 3]],
        };
        let bytes = super::strip(&strip).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        assert_eq!([info.width, info.height], [6, 1]);
        assert_eq!(pixels[..6], [0, 0, 0, 9, 9, 9]);
        assert_eq!(pixels[6..12], [255; 6]);
        assert_eq!(pixels[12..], [5, 6, 7, 1, 2, 3]);
    }

    #[test]
    fn a_png_has_lines_and_letters() {
        let chart = |title: &str| Chart {
            title: title.to_owned(),
            axes: [Axis::new("time (µs)"), Axis::new("error")],
            series: vec![Series::line("a", [[1.0, 1.0], [10.0, 0.1]])],
            ..Chart::default()
        };
        let dark_pixels = |bytes: &[u8]| {
            let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
            let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
            let info = reader.next_frame(&mut pixels).unwrap();
            assert!(info.width > 1000 && info.height > 600, "{info:?}");
            pixels.as_chunks::<3>().0.iter().filter(|p| p.iter().all(|&v| v < 100)).count()
        };
        let bare = dark_pixels(&png(&chart("")).unwrap());
        let titled = dark_pixels(&png(&chart("Primary rays")).unwrap());
        // Twelve letters of about 20 x 20 pixels at this scale, a fifth of it ink.
        assert!(titled > bare + 500, "{bare} {titled}");
    }
}
