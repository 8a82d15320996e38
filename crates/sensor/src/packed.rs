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
            Self::Raw10 => "a width of one number a pixel that four divide, as RAW10 packs four of them together",
            Self::Raw12 => "an even width of one number a pixel, as RAW12 packs two of them together",
        };
        SensorError::unless(divides, "packed", columns as f64, demand)?;
        let most = image.values.iter().copied().max().unwrap_or(0);
        let demand = match self {
            Self::Raw10 => "numbers of 10 bits at most; set sensor.bit_depth to 10 or less",
            Self::Raw12 => "numbers of 12 bits at most; set sensor.bit_depth to 12 or less",
        };
        SensorError::unless(most >> self.bits() == 0, "packed", f64::from(most), demand)?;
        let low = self.bits() - 8;
        let mut packed = Vec::with_capacity(image.values.len() / count * (count + 1));
        for group in image.values.chunks_exact(count) {
            #[expect(clippy::cast_possible_truncation, reason = "eight bits of ten or twelve")]
            packed.extend(group.iter().map(|value| (value >> low) as u8));
            let rests = group.iter().zip(0..).map(|(value, k)| (value & ((1 << low) - 1)) << (k * low));
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::InvalidValues;

    fn image(width: usize, values: Vec<u16>) -> RawImage {
        let height = values.len() / width;
        RawImage { width, height, depth: 1, values, invalid: InvalidValues::default() }
    }

    #[test]
    fn numbers_are_packed_as_the_kernel_says() {
        // Four pixels of 0b11_1111_1101 down to _00: the fifth byte has the low bits, the first pixel's lowest.
        let four = image(4, vec![0x3FD, 0x0FE, 0x001, 0x203]);
        assert_eq!(Packing::Raw10.pack(&four).unwrap(), [0xFF, 0x3F, 0x00, 0x80, 0b11_01_10_01]);
        let two = image(2, vec![0xABC, 0x123]);
        assert_eq!(Packing::Raw12.pack(&two).unwrap(), [0xAB, 0x12, 0x3C]);
        for (packing, most) in [(Packing::Raw10, 1024), (Packing::Raw12, 4096)] {
            let all: Vec<u16> = (0..most).map(|k: u16| k.wrapping_mul(77) % most).collect();
            let packed = packing.pack(&image(16, all.clone())).unwrap();
            assert_eq!(packed.len() * 8, all.len() * packing.bits() as usize);
            assert_eq!(packing.unpack(&packed), all);
        }
    }

    #[test]
    fn what_does_not_divide_or_fit_is_refused() {
        for (packing, width, value, word) in [
            (Packing::Raw10, 6, 1, "four divide"),
            (Packing::Raw12, 3, 1, "even width"),
            (Packing::Raw10, 4, 1024, "10 bits at most"),
            (Packing::Raw12, 2, 4096, "12 bits at most"),
        ] {
            let error = packing.pack(&image(width, vec![value; width * 2])).unwrap_err().to_string();
            assert!(error.contains(word), "{error}");
        }
    }
}
