//! Raw numbers of 10 and 12 bits packed as cameras send them over MIPI CSI-2.
//!
//! # Sources
//!
//! MIPI Alliance, "Camera Serial Interface 2" (CSI-2), RAW10 and RAW12; the Linux kernel's "10-bit packed Bayer formats"
//! (`V4L2_PIX_FMT_SRGGB10P`) and "12-bit packed Bayer formats" (`V4L2_PIX_FMT_SRGGB12P`): the upper eight bits of some
//! pixels, a byte each, and then a byte with what is left of all of them, the first pixel in the lowest bits.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{RawImage, SensorError};

/// A packed format.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Packing {
    /// Four pixels of 10 bits in five bytes.
    Raw10,
    /// Two pixels of 12 bits in three bytes.
    Raw12,
}

impl Packing {
    /// Bits of a number.
    #[must_use]
    pub fn bits(self) -> u32 {
        match self {
            Self::Raw10 => 10,
            Self::Raw12 => 12,
        }
    }

    /// Numbers that are packed together.
    #[must_use]
    pub fn together(self) -> usize {
        match self {
            Self::Raw10 => 4,
            Self::Raw12 => 2,
        }
    }

    /// The numbers of an image of one number a pixel, packed row after row without gaps.
    ///
    /// # Errors
    ///
    /// When its rows do not divide, or a number has more bits.
    pub fn pack(self, image: &RawImage) -> Result<Vec<u8>, SensorError> {
        let count = self.together();
        let columns = image.width * image.depth;
        let divides = image.depth == 1 && columns.is_multiple_of(count);
        let demand = match self {
            Self::Raw10 => {
                "a width of one number a pixel that four divide, as RAW10 packs four of them together"
            }
            Self::Raw12 => {
                "an even width of one number a pixel, as RAW12 packs two of them together"
            }
        };
        SensorError::unless(divides, "packed", columns as f64, demand)?;
        let most = image.values.iter().copied().max().unwrap_or(0);
        let demand = match self {
            Self::Raw10 => "numbers of 10 bits at most\nhint: set sensor.bit_depth to 10 or less",
            Self::Raw12 => "numbers of 12 bits at most\nhint: set sensor.bit_depth to 12 or less",
        };
        SensorError::unless(most >> self.bits() == 0, "packed", f64::from(most), demand)?;
        let low = self.bits() - 8;
        let mut packed = Vec::with_capacity(image.values.len() / count * (count + 1));
        for group in image.values.chunks_exact(count) {
            #[expect(clippy::cast_possible_truncation, reason = "eight bits of ten or twelve")]
            packed.extend(group.iter().map(|value| (value >> low) as u8));
            let rests =
                group.iter().zip(0..).map(|(value, k)| (value & ((1 << low) - 1)) << (k * low));
            #[expect(clippy::cast_possible_truncation, reason = "eight bits in all")]
            packed.push(rests.sum::<u16>() as u8);
        }
        Ok(packed)
    }

    /// The numbers of packed bytes; what is left of the last group is none.
    #[must_use]
    pub fn unpack(self, bytes: &[u8]) -> Vec<u16> {
        let (count, low) = (self.together(), self.bits() - 8);
        let groups = bytes.chunks_exact(count + 1);
        groups
            .flat_map(|group| {
                let rest = u16::from(group[count]);
                (0..count).map(move |k| {
                    let shift = u32::try_from(k).unwrap_or(0) * low;
                    u16::from(group[k]) << low | (rest >> shift & ((1 << low) - 1))
                })
            })
            .collect()
    }
}
