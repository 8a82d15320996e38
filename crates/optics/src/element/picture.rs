//! Grey pictures of a stated physical size: coded apertures and filter maps.

use std::path::Path;

use etendue_image::{Limits, Samples};
use glam::DVec2;

use super::resources::Resolve;

/// The most bytes that a picture may take when it is decoded: a coded aperture has thousands of
/// pixels, and this is 8192 × 8192 in 16-bit RGBA.
const MOST_BYTES: u64 = 1 << 29;

/// The most pixels of one: their values take 0.5 GiB.
const MOST_PIXELS: usize = 1 << 26;

/// The longest file of a picture that is read (bytes).
const LONGEST: u64 = 1 << 30;

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
        let path = resolve.path(file)?;
        let (pixels, values, levels) = read(&path).map_err(|why| format!("{file}: {why}"))?;
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

fn read(path: &Path) -> Result<Pixels, String> {
    let bytes = etendue_files::read(path, LONGEST).map_err(|e| format!("cannot be read: {e}"))?;
    let limits = Limits::within(Some(MOST_BYTES));
    let raster = etendue_image::decode(&bytes, limits)
        .map_err(|e| format!("is not a picture that can be read: {e}"))?;
    if raster.len() > MOST_PIXELS {
        let [width, height] = raster.size();
        return Err(format!(
            "has {width} x {height} texels, and a mask has {MOST_PIXELS} at most: make it smaller"
        ));
    }
    let mut values = etendue_image::room(raster.len()).map_err(|_| "does not fit into memory")?;
    for [red, green, blue, alpha] in (0..raster.len()).map(|i| raster.texel(i)) {
        if red != green || red != blue {
            return Err("is coloured; a mask must be grey".to_owned());
        }
        // The alpha of EXR files has never counted: masks are written with and without.
        if alpha != 1.0 && !raster.is_float() {
            return Err("is transparent in places; a mask must be grey without alpha".to_owned());
        }
        if !(0.0..=1.0).contains(&red) {
            return Err(format!("has the value {red}; a mask's values lie in 0..=1"));
        }
        values.push(red);
    }
    let levels = match raster.samples() {
        Samples::U8(_) => 255.0,
        Samples::U16(_) => 65_535.0,
        Samples::F16(_) | Samples::F32(_) => 1.0,
    };
    Ok((raster.size(), values, levels))
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
        let picture =
            Picture::read("mask.exr", 2.0, Some(1.0), &|_: &str| Ok(path.clone())).unwrap();
        assert_eq!((picture.value(-0.5, 0.0), picture.value(0.5, 0.0)), (0.25, 0.75));
    }

    #[test]
    fn what_is_no_mask_is_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let read =
            |width| Picture::read("a.png", width, None, &|_: &str| Ok(path.clone())).unwrap_err();
        assert!(read(1.0).contains("a.png: cannot be read"), "{}", read(1.0));
        std::fs::write(&path, b"no picture").unwrap();
        assert!(read(1.0).contains("not a picture"), "{}", read(1.0));
        image::RgbImage::from_raw(1, 1, vec![1, 2, 3]).unwrap().save(&path).unwrap();
        assert!(read(1.0).contains("coloured"));
        image::GrayImage::from_raw(1, 1, vec![9]).unwrap().save(&path).unwrap();
        assert!(read(0.0).contains("positive"));
    }
}
