//! Grey pictures of a stated physical size: coded apertures and filter maps.

use std::io::BufReader;
use std::path::{Path, PathBuf};

use etendue_geometry::files;
use exr::prelude::{FlatSamples, ReadChannels, ReadLayers, read};
use glam::DVec2;

/// Where a lens file's own files are: from the name in the file to a path, or a sentence on why it
/// may not be read.
pub type Resolve<'a> = &'a dyn Fn(&str) -> Result<PathBuf, String>;

/// The most pixels that a picture may have; a coded aperture has thousands.
const MOST_PIXELS: usize = 1 << 26;

/// A grey picture centred on an element's axis. Row 0 is at the top (+y) and column 0 at −x, as seen
/// from the sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Width and height (mm).
    pub size: [f64; 2],
    /// Columns and rows.
    pub pixels: [usize; 2],
    /// Grey values by rows, 1 at full scale.
    pub values: Vec<f64>,
    /// Grey levels from black to white: 255 or 65535; 1 for floats.
    pub levels: f64,
}

impl Picture {
    /// Reads a PNG (values over full scale, without gamma) or an EXR (values as they are). `height`
    /// follows from square pixels when not given.
    ///
    /// # Errors
    ///
    /// A sentence that names the file: it cannot be read, is coloured or transparent, or its size
    /// is not positive.
    pub fn read(
        file: &str,
        width: f64,
        height: Option<f64>,
        resolve: Resolve<'_>,
    ) -> Result<Self, String> {
        let path = resolve(file)?;
        let is_exr = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr"));
        let (pixels, values, levels) = if is_exr { read_exr(&path) } else { read_png(&path) }
            .map_err(|why| format!("{file}: {why}"))?;
        #[expect(clippy::cast_precision_loss, reason = "far fewer pixels than 2⁵³")]
        let height = height.unwrap_or(width * pixels[1] as f64 / pixels[0] as f64);
        let good = |length: f64| length > 0.0 && length.is_finite();
        if !good(width) || !good(height) {
            return Err(format!("{file}: width and height must be positive lengths"));
        }
        Ok(Self { size: [width, height], pixels, values, levels })
    }

    /// A white picture of the same size.
    #[must_use]
    pub fn blank(&self) -> Self {
        Self { size: self.size, pixels: [1, 1], values: vec![1.0], levels: 1.0 }
    }

    /// The index of the pixel that covers the point `x`, `y` (mm); `None` outside of the picture.
    #[must_use]
    pub fn pixel(&self, x: f64, y: f64) -> Option<usize> {
        let across = x / self.size[0] + 0.5;
        let down = 0.5 - y / self.size[1];
        let at = |share: f64, count: usize| {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                clippy::cast_precision_loss,
                reason = "a share in 0..=1 of a count"
            )]
            (0.0..=1.0).contains(&share).then(|| ((share * count as f64) as usize).min(count - 1))
        };
        Some(at(down, self.pixels[1])? * self.pixels[0] + at(across, self.pixels[0])?)
    }

    /// The lower left and the upper right corner of pixel `i` (mm).
    pub(crate) fn bounds_of(&self, i: usize) -> [DVec2; 2] {
        #[expect(clippy::cast_precision_loss, reason = "far fewer pixels than 2⁵³")]
        let corner = |column: usize, row: usize| {
            DVec2::new(
                (column as f64 / self.pixels[0] as f64 - 0.5) * self.size[0],
                (0.5 - row as f64 / self.pixels[1] as f64) * self.size[1],
            )
        };
        let [column, row] = [i % self.pixels[0], i / self.pixels[0]];
        [corner(column, row + 1), corner(column + 1, row)]
    }

    /// The grey value at a point (mm); 0 outside of the picture.
    #[must_use]
    pub fn value(&self, x: f64, y: f64) -> f64 {
        self.pixel(x, y).map_or(0.0, |i| self.values[i])
    }

    /// The radius of the circle around the picture (mm).
    #[must_use]
    pub fn radius(&self) -> f64 {
        0.5 * self.size[0].hypot(self.size[1])
    }
}

type Pixels = ([usize; 2], Vec<f64>, f64);

fn read_png(path: &Path) -> Result<Pixels, String> {
    let image = files::open(path)
        .and_then(|file| image::ImageReader::new(BufReader::new(file)).with_guessed_format())
        .map_err(|e| format!("cannot be read: {e}"))?
        .decode()
        .map_err(|e| format!("is not a picture that can be read: {e}"))?;
    let deep = image.color().bytes_per_pixel() > image.color().channel_count();
    let wide = image.to_rgba16();
    let pixels = [wide.width() as usize, wide.height() as usize];
    check_count(pixels)?;
    let mut values = Vec::with_capacity(pixels[0] * pixels[1]);
    for pixel in wide.pixels() {
        let [red, green, blue, alpha] = pixel.0;
        if red != green || red != blue {
            return Err("is coloured; a mask must be grey".to_owned());
        }
        if alpha != u16::MAX {
            return Err("is transparent in places; a mask must be grey without alpha".to_owned());
        }
        values.push(f64::from(red) / f64::from(u16::MAX));
    }
    Ok((pixels, values, if deep { 65_535.0 } else { 255.0 }))
}

fn read_exr(path: &Path) -> Result<Pixels, String> {
    let file = files::open(path).map_err(|e| format!("cannot be read: {e}"))?;
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(BufReader::new(file))
        .map_err(|e| format!("cannot be read: {e}"))?;
    let layer = &image.layer_data;
    let pixels = [layer.size.0, layer.size.1];
    check_count(pixels)?;
    let mut grey: Option<Vec<f64>> = None;
    for channel in &layer.channel_data.list {
        if channel.name == *"A" {
            continue;
        }
        let values: Vec<f64> = match &channel.sample_data {
            FlatSamples::F16(v) => v.iter().map(|x| f64::from(x.to_f32())).collect(),
            FlatSamples::F32(v) => v.iter().map(|&x| f64::from(x)).collect(),
            FlatSamples::U32(v) => v.iter().map(|&x| f64::from(x)).collect(),
        };
        if grey.as_ref().is_some_and(|first| *first != values) {
            return Err("is coloured; a mask must be grey".to_owned());
        }
        grey = Some(values);
    }
    let values = grey.ok_or("has no channel")?;
    if let Some(bad) = values.iter().find(|v| !(0.0..=1.0).contains(*v)) {
        return Err(format!("has the value {bad}; a mask's values lie in 0..=1"));
    }
    Ok((pixels, values, 1.0))
}

fn check_count([columns, rows]: [usize; 2]) -> Result<(), String> {
    match columns.checked_mul(rows) {
        Some(1..=MOST_PIXELS) => Ok(()),
        _ => Err(format!("has {columns} x {rows} pixels; a mask has 1 to {MOST_PIXELS}")),
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Writes a grey PNG into a fresh folder and reads it back as `width` mm wide.
    pub(crate) fn grey(columns: u32, rows: u32, values: &[u8], width: f64) -> Picture {
        let folder = tempfile::tempdir().unwrap();
        let image = image::GrayImage::from_raw(columns, rows, values.to_vec()).unwrap();
        image.save(folder.path().join("mask.png")).unwrap();
        let resolve = |name: &str| Ok(folder.path().join(name));
        Picture::read("mask.png", width, None, &resolve).unwrap()
    }

    #[test]
    fn the_top_left_of_the_picture_is_at_minus_x_plus_y() {
        let picture = grey(3, 2, &[255, 51, 0, 0, 0, 102], 6.0);
        assert_eq!(picture.size, [6.0, 4.0]);
        assert_eq!(picture.value(-2.5, 1.5), 1.0);
        assert_eq!(picture.value(0.0, 0.5), 0.2);
        assert_eq!(picture.value(2.9, -1.9), 0.4);
        assert_eq!(picture.value(3.0, -2.0), 0.4, "the rim belongs to the picture");
        assert_eq!(picture.value(3.001, 0.0), 0.0);
        assert_eq!(picture.value(f64::NAN, 0.0), 0.0);
    }

    #[test]
    fn a_picture_of_one_pixel_is_a_rectangle_of_one_grey() {
        let picture = grey(1, 1, &[51], 2.0);
        assert_eq!(picture.value(0.99, -0.99), 0.2);
        assert_eq!(picture.value(1.01, 0.0), 0.0);
    }

    #[test]
    fn exr_masks_are_read_as_they_are() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mask.exr");
        exr::prelude::write_rgb_file(&path, 2, 1, |x, _| {
            let grey = 0.25 + 0.5 * x as f32;
            (grey, grey, grey)
        })
        .unwrap();
        let picture = Picture::read("mask.exr", 2.0, Some(1.0), &|_| Ok(path.clone())).unwrap();
        assert_eq!((picture.value(-0.5, 0.0), picture.value(0.5, 0.0)), (0.25, 0.75));
    }

    #[test]
    fn what_is_no_mask_is_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let read = |width| Picture::read("a.png", width, None, &|_| Ok(path.clone())).unwrap_err();
        assert!(read(1.0).contains("a.png: cannot be read"), "{}", read(1.0));
        std::fs::write(&path, b"no picture").unwrap();
        assert!(read(1.0).contains("not a picture"), "{}", read(1.0));
        image::RgbImage::from_raw(1, 1, vec![1, 2, 3]).unwrap().save(&path).unwrap();
        assert!(read(1.0).contains("coloured"));
        image::GrayImage::from_raw(1, 1, vec![9]).unwrap().save(&path).unwrap();
        assert!(read(0.0).contains("positive"));
    }
}
