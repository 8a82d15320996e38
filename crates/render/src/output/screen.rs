//! Layers and a sensor's images as a screen shows them, at once and without a file.

use etendue_sensor::{RawImage, Sensor};
use rayon::prelude::*;

use super::look::{ColourType, LayerImage, show, spread, srgb};
use super::png::Bits;
use super::{Layer, Look, OutputError, Picture, Values};

/// An image for a screen: sRGB with straight alpha, 8 bits a channel.
#[derive(Debug, Clone, PartialEq)]
pub struct Screen {
    /// Columns and rows.
    pub size: [usize; 2],
    /// Red, green, blue and alpha of each pixel, rows from the top.
    pub rgba: Vec<u8>,
    /// Explanation of how to read the colours.
    pub note: String,
    /// Scale of the colours of a layer of distances.
    pub scale: Option<DistanceScale>,
}

/// Colours of distances, even in the reciprocal distance where none is below zero: near is bright.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DistanceScale {
    /// The nearest distance that is told apart (m): the first hundredth of the pixels is no farther.
    pub near: f64,
    /// The farthest (m): the last hundredth of the pixels is no nearer.
    pub far: f64,
}

impl DistanceScale {
    /// Position of `distance` (m) on the scale: 0 at the far end, 1 at the near one.
    #[must_use]
    pub fn share(&self, distance: f64) -> f64 {
        let nearness = |d: f64| if self.near > 0.0 { d.recip() } else { -d };
        let (low, high) = (nearness(self.far), nearness(self.near));
        match high > low {
            true => (nearness(distance.clamp(self.near, self.far)) - low) / (high - low),
            false => 1.0,
        }
    }

    /// The distance (m) at `share` of the scale: the inverse of [`Self::share`].
    #[must_use]
    pub fn distance(&self, share: f64) -> f64 {
        match self.near > 0.0 {
            true => (self.far.recip() + share * (self.near.recip() - self.far.recip())).recip(),
            false => self.far + share * (self.near - self.far),
        }
    }

    /// The colour at `share` of the scale.
    #[must_use]
    pub fn color(share: f64) -> [u8; 3] {
        viridis(share.clamp(0.0, 1.0))
    }
}

/// The colour map viridis (Smith and van der Walt, 2015) at `t` (0 to 1), from its values at nine even
/// steps; to within a few of 255.
fn viridis(t: f64) -> [u8; 3] {
    const STEPS: [[f64; 3]; 9] = [
        [68.0, 1.0, 84.0],
        [71.0, 44.0, 122.0],
        [59.0, 81.0, 139.0],
        [44.0, 113.0, 142.0],
        [33.0, 144.0, 141.0],
        [39.0, 173.0, 129.0],
        [92.0, 200.0, 99.0],
        [170.0, 220.0, 50.0],
        [253.0, 231.0, 37.0],
    ];
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 7")]
    let step = ((t * 8.0) as usize).min(7);
    let share = t * 8.0 - step as f64;
    std::array::from_fn(|k| {
        byte((STEPS[step][k] * (1.0 - share) + STEPS[step + 1][k] * share) / 255.0)
    })
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to 0..=255")]
fn byte(value: f64) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

impl Screen {
    /// The layer of `picture` that files call `name` (empty for the picture itself). Distances are
    /// coloured; all else is as a PNG of it.
    ///
    /// # Errors
    ///
    /// When there is no such layer.
    pub fn of_layer(picture: &Picture, name: &str) -> Result<Self, OutputError> {
        let layer = picture.require(name)?;
        let size = [picture.width(), picture.height()];
        let shown = match (layer.look, name) {
            (Look::Distance, _) => return Ok(Self::of_distances(size, layer)),
            (Look::Color, "") => picture.show(layer, Bits::Eight),
            _ => show(layer, Bits::Eight),
        }?;
        let rgba = rgba(&shown, size[0] * size[1]);
        Ok(Self { size, rgba, note: shown.note, scale: None })
    }

    fn of_distances(size: [usize; 2], layer: &Layer) -> Self {
        let plane: &Values = &layer.channels[0].values;
        let scale = spread(plane).map(|(near, far)| DistanceScale { near, far });
        let color = |i: usize| match scale {
            Some(scale) if plane.at(i).is_finite() => {
                let [r, g, b] = DistanceScale::color(scale.share(plane.at(i)));
                [r, g, b, 255]
            }
            _ => [0; 4],
        };
        let rgba = (0..size[0] * size[1]).into_par_iter().flat_map_iter(color).collect();
        let note = "viridis, near is bright; transparent is a miss".to_owned();
        Self { size, rgba, note, scale }
    }

    /// The digital numbers of a sensor as they are, black to saturation, through the sRGB curve: a
    /// mosaic is grey, and of more than three channels the first is shown.
    #[must_use]
    pub fn of_numbers(sensor: &Sensor, image: &RawImage) -> Self {
        let white = sensor.saturation_level().max(1.0);
        let shade = |value: u16| byte(f64::from(srgb(f64::from(value) / white)));
        let pixel = |values: &[u16]| match *values {
            [r, g, b] => [shade(r), shade(g), shade(b), 255],
            [grey, ..] => [shade(grey), shade(grey), shade(grey), 255],
            [] => [0; 4],
        };
        let rgba = image.values.par_chunks_exact(image.depth.max(1)).flat_map_iter(pixel).collect();
        let note = format!("digital numbers through the sRGB curve; white is {white} DN");
        Self { size: [image.width, image.height], rgba, note, scale: None }
    }

    /// The image of a sensor as its preview file shows it: demosaiced and white balanced.
    #[must_use]
    pub fn of_sensor(sensor: &Sensor, image: &RawImage) -> Self {
        let method = sensor.spec().demosaic.unwrap_or_default();
        let developed = sensor.developed(image, method);
        let pixel = |rgb: [f32; 3]| {
            let [r, g, b] = rgb.map(|part| byte(f64::from(srgb(f64::from(part)))));
            [r, g, b, 255]
        };
        let rgba = developed.into_par_iter().flat_map_iter(pixel).collect();
        let note = "sRGB; demosaiced and white balanced".to_owned();
        Self { size: [image.width, image.height], rgba, note, scale: None }
    }

    /// Number of pixels with each of the 256 values of red, green and blue; transparent ones are left out.
    #[must_use]
    pub fn histogram(&self) -> [[u32; 256]; 3] {
        let mut counts = [[0; 256]; 3];
        for pixel in self.rgba.chunks_exact(4).filter(|pixel| pixel[3] > 0) {
            for (counts, &value) in counts.iter_mut().zip(pixel) {
                counts[usize::from(value)] += 1;
            }
        }
        counts
    }
}

/// `shown` with four bytes a pixel.
fn rgba(shown: &LayerImage, pixels: usize) -> Vec<u8> {
    let bytes = &shown.bytes;
    let step = match (shown.channels, shown.bits) {
        (ColourType::Rgba, Bits::Eight) => return bytes.clone(),
        (ColourType::Rgb, _) => 3,
        (ColourType::Rgba, _) => 4,
        (ColourType::Grey | ColourType::Indexed, _) => 1,
    };
    // Of 16 bits, big-endian, the first byte.
    let width = if shown.bits == Bits::Sixteen { 2 } else { 1 };
    let pixel = |i: usize| {
        let at = |k: usize| bytes[(i * step + k) * width];
        match step {
            1 => [at(0), at(0), at(0), 255],
            3 => [at(0), at(1), at(2), 255],
            _ => [at(0), at(1), at(2), at(3)],
        }
    };
    (0..pixels).into_par_iter().flat_map_iter(pixel).collect()
}

#[cfg(test)]
mod tests {
    use super::super::Channel;
    use super::*;

    #[test]
    fn distances_are_coloured_from_near_to_far() {
        let channel =
            Channel { name: "Z".into(), values: Values::F64(vec![1.0, 2.0, f64::INFINITY, 4.0]) };
        let depth = Layer {
            name: "Depth".into(),
            look: Look::Distance,
            channels: vec![channel],
            meaning: vec![],
        };
        let picture = Picture::new(2, 2, vec![depth], vec![]).unwrap();
        let screen = Screen::of_layer(&picture, "Depth").unwrap();
        assert_eq!(screen.scale, Some(DistanceScale { near: 1.0, far: 4.0 }));
        assert_eq!(screen.rgba[..4], [253, 231, 37, 255], "the nearest is viridis' bright end");
        assert_eq!(screen.rgba[8..12], [0; 4], "a miss is transparent");
        assert_eq!(screen.rgba[12..], [68, 1, 84, 255], "the farthest is its dark end");
        let scale = screen.scale.unwrap();
        // Reciprocal distances: 2 m is (1/2 − 1/4) / (1 − 1/4) of the way.
        assert!((scale.share(2.0) - 1.0 / 3.0).abs() < 1e-15, "a rounding or two");
        assert!((scale.distance(scale.share(2.0)) - 2.0).abs() < 1e-14, "a rounding or two");
        assert!(Screen::of_layer(&picture, "Normal").is_err());
    }

    #[test]
    fn a_screen_shows_what_the_png_does() {
        let rgb = ["R", "G", "B"].map(|name| Channel {
            name: name.into(),
            values: Values::F32(vec![0.0, 0.18, 1.0, 7.0]),
        });
        let layer =
            Layer { name: String::new(), look: Look::Color, channels: rgb.into(), meaning: vec![] };
        let picture = Picture::new(4, 1, vec![layer], vec![]).unwrap();
        let screen = Screen::of_layer(&picture, "").unwrap();
        // IEC 61966-2-1: 0.18 is 0.461356 of 255.
        let expected = [0, 118, 255, 255].map(|v| [v, v, v, 255]);
        assert_eq!(screen.rgba, expected.as_flattened());
        let counts = screen.histogram();
        assert_eq!((counts[0][0], counts[1][118], counts[2][255]), (1, 1, 2));
    }
}
