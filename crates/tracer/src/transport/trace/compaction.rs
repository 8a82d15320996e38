//! Masks of lanes, and the lanes of a mask put side by side.
#![expect(
    clippy::manual_memcpy,
    reason = "a copy between slices is a call, of functions with more instructions"
)]

use std::hint::select_unpredictable;

use etendue_geometry::block::LANES;

/// Bits that are all set in lanes of which something holds, and 0 in the others: rows of `bool` are worked out one by
/// one.
pub(super) type Mask = [u32; LANES];

/// The bits of a lane in a [`Mask`].
#[inline(always)]
pub(super) fn mask(holds: bool) -> u32 {
    select_unpredictable(holds, u32::MAX, 0)
}

/// The lanes of a mask, in order, which go side by side.
pub(super) struct Compaction {
    /// The lanes, and 0 behind the last.
    lanes: [u8; LANES],
    pub(super) count: usize,
    #[cfg(target_arch = "x86_64")]
    by_register: Option<(pulp::x86::V4, u16)>,
}

/// The instructions of AVX-512 that do so, where the machine has them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Instructions {
    #[cfg(target_arch = "x86_64")]
    simd: Option<pulp::x86::V4>,
}

impl Instructions {
    /// Those of this machine.
    pub(super) fn of_machine() -> Self {
        Self {
            #[cfg(target_arch = "x86_64")]
            simd: pulp::x86::V4::try_new(),
        }
    }
}

impl Compaction {
    /// Without a branch, as nothing tells beforehand which they are.
    #[inline(always)]
    pub(super) fn new(mask: &Mask, instructions: Instructions) -> Self {
        let Instructions {
            #[cfg(target_arch = "x86_64")]
            simd,
        } = instructions;
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = simd {
            let register = pulp::cast(*mask);
            let bits = simd.avx512f._mm512_test_epi32_mask(register, register);
            let by_register = Some((simd, bits));
            return Self { lanes: [0; LANES], count: bits.count_ones() as usize, by_register };
        }
        let (mut lanes, mut count) = ([0; LANES], 0);
        for (lane, &is_in) in (0_u8..).zip(mask) {
            lanes[count & (LANES - 1)] = lane;
            count += usize::from(is_in != 0);
        }
        Self {
            lanes,
            count,
            #[cfg(target_arch = "x86_64")]
            by_register: None,
        }
    }

    /// Puts the lanes of a row into a column, which has room for all.
    #[inline(always)]
    pub(super) fn put<T: Word>(&self, row: &[T; LANES], column: &mut [T], at: usize) {
        let to = &mut column[at..at + LANES];
        #[cfg(target_arch = "x86_64")]
        if let Some((simd, bits)) = self.by_register {
            // A copy between slices would be a call.
            let own = T::compress(simd, bits, *row);
            for i in 0..LANES {
                to[i] = own[i];
            }
            return;
        }
        for (to, &lane) in to.iter_mut().zip(&self.lanes) {
            *to = row[usize::from(lane) & (LANES - 1)];
        }
    }
}

/// A number that can be put side by side.
pub(in crate::transport) trait Word: Copy {
    /// The lanes of a mask side by side, and 0 behind them.
    #[cfg(target_arch = "x86_64")]
    fn compress(simd: pulp::x86::V4, bits: u16, row: [Self; LANES]) -> [Self; LANES];
}

impl Word for f32 {
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    fn compress(simd: pulp::x86::V4, bits: u16, row: [Self; LANES]) -> [Self; LANES] {
        pulp::cast(simd.avx512f._mm512_maskz_compress_ps(bits, pulp::cast(row)))
    }
}

impl Word for u32 {
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    fn compress(simd: pulp::x86::V4, bits: u16, row: [Self; LANES]) -> [Self; LANES] {
        pulp::cast(simd.avx512f._mm512_maskz_compress_epi32(bits, pulp::cast(row)))
    }
}

impl Word for f64 {
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    fn compress(simd: pulp::x86::V4, bits: u16, row: [Self; LANES]) -> [Self; LANES] {
        let [low, high]: [[Self; LANES / 2]; 2] = pulp::cast(row);
        let [of_low, of_high] = bits.to_le_bytes();
        let avx512f = simd.avx512f;
        let low: [Self; LANES / 2] =
            pulp::cast(avx512f._mm512_maskz_compress_pd(of_low, pulp::cast(low)));
        let high: [Self; LANES / 2] =
            pulp::cast(avx512f._mm512_maskz_compress_pd(of_high, pulp::cast(high)));
        let first = of_low.count_ones() as usize;
        let (mut whole, behind) = ([0.0; LANES], first..first + LANES / 2);
        for i in 0..LANES / 2 {
            whole[i] = low[i];
        }
        for (to, from) in whole[behind].iter_mut().zip(high) {
            *to = from;
        }
        whole
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lanes_come_side_by_side_by_instruction_and_without() {
        let row: [u32; LANES] = std::array::from_fn(|lane| 100 + u32::try_from(lane).unwrap());
        for mask in [0_u32, 1, 0x8000, 0xffff, 0x5a5a, 0x0ff0, 0x1234] {
            let mask: Mask = std::array::from_fn(|lane| (mask >> lane & 1) * u32::MAX);
            let is_in = |(&own, is_in): (&u32, u32)| (is_in != 0).then_some(own);
            let wanted: Vec<u32> = row.iter().zip(mask).filter_map(is_in).collect();
            let none = Instructions {
                #[cfg(target_arch = "x86_64")]
                simd: None,
            };
            for instructions in [Instructions::of_machine(), none] {
                let compaction = Compaction::new(&mask, instructions);
                let mut column = [7_u32; 3 + LANES];
                compaction.put(&row, &mut column, 3);
                assert_eq!(compaction.count, wanted.len());
                assert_eq!(column[3..3 + compaction.count], wanted[..]);
                assert_eq!(column[..3], [7; 3]);
            }
        }
    }
}
