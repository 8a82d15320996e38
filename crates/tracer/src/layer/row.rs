//! A row of the table of layers, and its words.

use std::borrow::Cow;

use crate::Needs;

/// A row of the table of layers: what is known of a layer without rendering it.
#[derive(Debug, Clone)]
pub struct Layer {
    /// The name in files.
    pub name: Cow<'static, str>,
    /// The channels in files, in order. [`LayerSpec::Radiance`](super::LayerSpec::Radiance) has one a band instead, where the
    /// bands are others than red, green and blue.
    pub channels: &'static [&'static str],
    /// Format in which the numbers are kept.
    pub kept: ValueKind,
    /// Rays of a pixel that they are taken from.
    pub taken: RaySource,
    /// Way in which a preview shows them.
    pub look: Look,
    /// Data of the meshes and of hits that filling it needs.
    pub needs: Needs,
    /// Meaning of the numbers, by key: `definition`, `unit`, `frame`, `miss` and their like.
    pub meaning: Vec<(&'static str, &'static str)>,
    /// The definition of each channel, where each is a layer of its own in files, `Id.object.X`:
    /// the form that Blender reads.
    pub apart: Option<&'static [&'static str]>,
}

impl Layer {
    /// The names of the layers that it is in files.
    #[must_use]
    pub fn names_in_files(&self) -> Vec<String> {
        match self.apart {
            Some(_) => self.channels.iter().map(|c| format!("{}.{c}", self.name)).collect(),
            None => vec![self.name.clone().into_owned()],
        }
    }
}

/// Kind of the numbers of a layer, and so the way in which a preview shows them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Look {
    /// Linear light, one channel (grey) or three (red, green, blue), 1 being full scale. Shown
    /// through the sRGB curve; what is brighter than 1 is clipped.
    Color,
    /// One channel of distances: the nearest hundredth white, farther ones darker, linear in the
    /// reciprocal; a miss (not finite) black.
    Distance,
    /// Three channels of a unit vector n, shown as (n + 1)/2; a miss (the zero vector)
    /// transparent.
    Direction,
    /// One to three channels, each stretched from its least to its greatest finite value (one alone is grey):
    /// positions, texture coordinates, numbers of samples. A pixel that is not finite is transparent.
    Extent,
    /// Integers that name things, each in a colour of its own; 0 (a miss) transparent. Only the
    /// first channel is shown.
    Ids,
    /// One channel of shares in 0..=1, linear grey: coverage, vignetting.
    Share,
    /// Any number of channels of linear light, shown as the grey of their mean.
    Cube,
    /// One channel or three of a sensor's digital numbers of so many bits. Not a preview: a PNG
    /// holds the numbers themselves, unscaled, in 16 bits.
    Counts {
        /// Bits of a number, 1 to 16.
        bits: u8,
    },
}

/// Format in which numbers are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ValueKind {
    /// As 64-bit floats where a file is wanted that holds them, else 32-bit: measurements.
    Measured,
    /// As 32-bit floats: colours and shares.
    Shown,
    /// As 32-bit integers, counted from 1: names of things.
    Counted,
}

/// Rays of a pixel that a layer is taken from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum RaySource {
    /// The chief ray of its centre.
    ChiefRay,
    /// The mean over its samples. What is averaged is three numbers a ray, of which the camera sends
    /// each its own way where wavelengths part, as it does with red, green and blue.
    Samples,
    /// The mean over the samples of the picture, even if that is one alone: what the picture is to
    /// be judged by.
    PictureSamples,
    /// The light of the samples of the picture, which a tracer follows: one number a spectral band.
    Light,
    /// The sum of the first number over the samples of the picture, as a share of the sum of the
    /// second.
    PictureShare,
    /// Statistics of the picture's own sampling.
    Sampling,
}

impl RaySource {
    /// Tests whether the layer is taken where the picture's own samples are.
    #[must_use]
    pub fn with_picture(self) -> bool {
        match self {
            Self::ChiefRay | Self::Samples | Self::Light | Self::Sampling => false,
            Self::PictureSamples | Self::PictureShare => true,
        }
    }
}

/// A half or a quarter of the pupil, as the camera sees it from behind.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PupilPart {
    /// Left, else right.
    pub left: bool,
    /// Above, below, or both.
    pub top: Option<bool>,
}

impl PupilPart {
    /// Tests whether a place of the entrance pupil, to the right of its middle and above it, is in this part. The
    /// middle is right and above.
    #[must_use]
    pub fn contains(self, [right, up]: [f64; 2]) -> bool {
        self.left == (right < 0.0) && self.top.is_none_or(|top| top == (up >= 0.0))
    }
}
