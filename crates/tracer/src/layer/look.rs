//! What the numbers of a layer are to the eye.

/// What the numbers of a layer are, and so how a preview shows them.
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
