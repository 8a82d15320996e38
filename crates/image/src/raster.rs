//! Texels as a file has them.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use exr::prelude::f16;

/// Texels by rows, row 0 at the top; grey, grey and alpha, RGB or RGBA.
#[derive(Debug, Clone)]
pub struct Raster {
    size: [usize; 2],
    channels: usize,
    samples: Samples,
}

/// The values of all texels, channel by channel.
#[derive(Debug, Clone)]
pub enum Samples {
    /// 255 is full scale.
    U8(Vec<u8>),
    /// 65 535 is full scale.
    U16(Vec<u16>),
    /// Linear, half precision.
    F16(Vec<f16>),
    /// Linear, single precision.
    F32(Vec<f32>),
}

impl Raster {
    /// Of `size` columns and rows.
    ///
    /// # Panics
    ///
    /// When there are not as many samples as texels times `channels`, which are 1 to 4.
    #[must_use]
    pub fn new(size: [usize; 2], channels: usize, samples: Samples) -> Self {
        assert!((1..=4).contains(&channels), "{channels} channels");
        let raster = Self { size, channels, samples };
        assert_eq!(raster.len() * channels, raster.values(), "samples of {size:?}");
        raster
    }

    /// Columns and rows.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Grey (1), grey and alpha (2), RGB (3) or RGBA (4).
    #[must_use]
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// The number of texels.
    #[must_use]
    pub fn len(&self) -> usize {
        self.size[0] * self.size[1]
    }

    /// True if there are no texels.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The values themselves.
    #[must_use]
    pub fn samples(&self) -> &Samples {
        &self.samples
    }

    /// The values themselves, taken out.
    #[must_use]
    pub fn into_samples(self) -> Samples {
        self.samples
    }

    /// True if the values are linear light without an upper end.
    #[must_use]
    pub fn is_float(&self) -> bool {
        match self.samples {
            Samples::U8(_) | Samples::U16(_) => false,
            Samples::F16(_) | Samples::F32(_) => true,
        }
    }

    fn values(&self) -> usize {
        match &self.samples {
            Samples::U8(values) => values.len(),
            Samples::U16(values) => values.len(),
            Samples::F16(values) => values.len(),
            Samples::F32(values) => values.len(),
        }
    }

    /// Bytes of all values.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let each = match self.samples {
            Samples::U8(_) => 1,
            Samples::U16(_) | Samples::F16(_) => 2,
            Samples::F32(_) => 4,
        };
        self.values() * each
    }

    /// RGBA of texel `index`, by rows: integers over their full scale, floats as they are.
    #[must_use]
    #[inline]
    pub fn texel(&self, index: usize) -> [f64; 4] {
        match &self.samples {
            Samples::U8(values) => self.spread(index, |k| f64::from(values[k]) / 255.0),
            Samples::U16(values) => self.spread(index, |k| f64::from(values[k]) / 65_535.0),
            Samples::F16(values) => self.spread(index, |k| f64::from(values[k].to_f32())),
            Samples::F32(values) => self.spread(index, |k| f64::from(values[k])),
        }
    }

    /// RGBA of texel `index` in linear light, integers by the sRGB curve; floats are linear already.
    #[must_use]
    #[inline]
    pub fn linear(&self, index: usize) -> [f64; 4] {
        let [r, g, b, alpha] = match &self.samples {
            Samples::U8(values) => self.spread(index, |k| EIGHT[usize::from(values[k])]),
            Samples::U16(values) => self.spread(index, |k| SIXTEEN[usize::from(values[k])]),
            Samples::F16(_) | Samples::F32(_) => return self.texel(index),
        };
        // Alpha is linear.
        let alpha = if self.channels.is_multiple_of(2) { self.texel(index)[3] } else { alpha };
        [r, g, b, alpha]
    }

    #[inline]
    fn spread(&self, index: usize, at: impl Fn(usize) -> f64) -> [f64; 4] {
        let first = index * self.channels;
        match self.channels {
            1 => {
                let grey = at(first);
                [grey, grey, grey, 1.0]
            }
            2 => {
                let grey = at(first);
                [grey, grey, grey, at(first + 1)]
            }
            3 => [at(first), at(first + 1), at(first + 2), 1.0],
            _ => [at(first), at(first + 1), at(first + 2), at(first + 3)],
        }
    }

    /// Makes numbers that are not finite or below zero black; how many texels had one.
    pub fn drop_unsound(&mut self) -> u64 {
        let Samples::F32(values) = &mut self.samples else { return 0 };
        let mut dropped = 0;
        for texel in values.chunks_mut(self.channels) {
            if !texel.iter().all(|c| c.is_finite() && *c >= 0.0) {
                texel.iter_mut().for_each(|c| *c = if c.is_finite() { c.max(0.0) } else { 0.0 });
                dropped += 1;
            }
        }
        dropped
    }

    /// Converts the raster to half precision, where it holds every value as it is.
    #[must_use]
    pub fn packed(self) -> Self {
        let Samples::F32(values) = &self.samples else { return self };
        let is_half = |v: &f32| f16::from_f32(*v).to_f32().to_bits() == v.to_bits();
        if !values.iter().all(is_half) {
            return self;
        }
        let halves = values.iter().map(|&v| f16::from_f32(v)).collect();
        Self { samples: Samples::F16(halves), ..self }
    }
}

/// Linear light of each 8-bit sRGB value.
static EIGHT: LazyLock<[f64; 256]> =
    LazyLock::new(|| std::array::from_fn(|i| linear_from_srgb(i as f64 / 255.0)));

/// Linear light of each 16-bit sRGB value.
static SIXTEEN: LazyLock<Vec<f64>> =
    LazyLock::new(|| (0..=65_535_u16).map(|i| linear_from_srgb(f64::from(i) / 65_535.0)).collect());

/// Linear light of each 8-bit sRGB value.
pub(crate) fn linear_of_bytes() -> &'static [f64; 256] {
    &EIGHT
}

/// Linear light of an sRGB value in 0..=1 (IEC 61966-2-1, section 5.2).
#[must_use]
pub fn linear_from_srgb(c: f64) -> f64 {
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

/// The values of one channel of an EXR file, by rows.
#[derive(Debug, Clone, PartialEq)]
pub enum Plane {
    /// Half or single precision.
    F32(Vec<f32>),
    /// Integers.
    U32(Vec<u32>),
}

/// All channels of an EXR file.
#[derive(Debug, Clone, PartialEq)]
pub struct ExrChannels {
    /// Columns and rows.
    pub size: [usize; 2],
    /// The channels by their full names (`R`, `Depth.Z`), in the file's order: that of their names.
    pub planes: Vec<(String, Plane)>,
    /// Attributes of the header that are text.
    pub texts: BTreeMap<String, String>,
}
