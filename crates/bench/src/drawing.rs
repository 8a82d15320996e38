//! Charts as files: SVG for pages, PNG for everywhere else.

use std::sync::Arc;

use etendue_chart::{Chart, Theme};
use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree, fontdb};

use crate::BenchError;

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

/// Opaque pixels, as the paper covers all of a chart.
fn encode(pixels: &Pixmap) -> Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, pixels.width(), pixels.height());
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    let rgb: Vec<u8> =
        pixels.pixels().iter().flat_map(|p| [p.red(), p.green(), p.blue()]).collect();
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&rgb)?;
    writer.finish()?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use etendue_chart::{Axis, Series};

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
