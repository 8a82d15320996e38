//! Owen-scrambled Sobol numbers of many samples side by side, to the last bit of an f64 below 1.
//!
//! The first 23 bits are those of the crate `sobol_burley` (Burley, "Practical hash-based Owen
//! scrambling", 2020), which gives f32. A table of 2¹⁹ entries leaves four of them for what comes
//! after the choice, so the scrambled number's other 9 bits are kept, and 21 random ones go behind:
//! of at most 2¹⁶ points, Owen's scrambling makes all bits behind the 16th random (Owen,
//! "Randomly permuted (t, m, s)-nets and (t, s)-sequences", 1995). That crate makes one sample's at a
//! time, in a loop over the set bits of its index, which a vector unit cannot share among samples;
//! here every bit is looked at.

use std::array;
use std::sync::LazyLock;

use sobol_burley::NUM_DIMENSIONS;
use sobol_burley::parts::{hash, owen_scramble_rev, sobol_rev};

/// Samples worked on side by side.
const LANES: usize = 16;

/// Bits of an index.
const BITS: usize = 16;

/// For each dimension, what each bit of the reversed index adds (exclusive or) to the reversed number.
static DIRECTIONS: LazyLock<Vec<[u32; BITS]>> = LazyLock::new(|| {
    let direction = |dimension, bit: usize| sobol_rev(1_u32 << (31 - bit), dimension);
    (0..NUM_DIMENSIONS).map(|d| array::from_fn(|bit| direction(d, bit))).collect()
});

/// A sample of a scrambled set.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Key {
    /// Which sample, below 2¹⁶.
    pub(crate) index: u32,
    /// Which scrambling.
    pub(crate) seed: u32,
}

/// The numbers of each of `keys` in dimensions `first` and `first + 1`; `first` is even. `out` is as
/// long as `keys`.
pub(crate) fn pairs(keys: &[Key], first: u32, out: &mut [[f64; 2]]) {
    scrambled(keys, first, both(first), out);
}

/// The numbers of one key in dimensions `first` and `first + 1`; `first` is even.
pub(crate) fn pair(key: Key, first: u32) -> [f64; 2] {
    let [numbers] = side_by_side([key], first, both(first));
    numbers
}

fn both(first: u32) -> [&'static [u32; BITS]; 2] {
    let directions = &*DIRECTIONS;
    [0, 1].map(|k| &directions[(first + k) as usize])
}

#[multiversion::multiversion(targets = "simd")]
fn scrambled(keys: &[Key], first: u32, directions: [&[u32; BITS]; 2], out: &mut [[f64; 2]]) {
    for (keys, out) in keys.chunks(LANES).zip(out.chunks_mut(LANES)) {
        let mut lanes = [Key::default(); LANES];
        lanes[..keys.len()].copy_from_slice(keys);
        let numbers = side_by_side(lanes, first, directions);
        out.copy_from_slice(&numbers[..keys.len()]);
    }
}

#[inline(always)]
fn side_by_side<const N: usize>(
    keys: [Key; N],
    first: u32,
    directions: [&[u32; BITS]; 2],
) -> [[f64; 2]; N] {
    const SHUFFLE: u32 = 0x79c6_8e4a;
    const SEED: u32 = 0x9c8f_2d3b;
    const DIMENSION: [u32; 4] = [0x912f_69ba, 0x174f_18ab, 0x691e_72ca, 0xb40c_c1b8];
    let mut out = [[0.0; 2]; N];
    let mut index = [0; N];
    for (index, key) in index.iter_mut().zip(&keys) {
        *index = owen_scramble_rev(key.index.reverse_bits(), hash(key.seed ^ SHUFFLE));
    }
    for (k, directions) in directions.into_iter().enumerate() {
        let mut number = [0; N];
        for (bit, &direction) in directions.iter().enumerate() {
            for (number, &index) in number.iter_mut().zip(&index) {
                let is_set = index >> (31 - bit) & 1;
                *number ^= direction & is_set.wrapping_neg();
            }
        }
        let salt = first >> 2 ^ DIMENSION[(first as usize + k) % 4];
        for i in 0..N {
            let scramble = hash(salt ^ keys[i].seed.wrapping_mul(SEED));
            let high = owen_scramble_rev(number[i], scramble).reverse_bits();
            let low = hash(high ^ scramble) >> 11;
            out[i][k] = (f64::from(high) + f64::from(low) / TWO_TO_21) / TWO_TO_32;
        }
    }
    out
}

const TWO_TO_21: f64 = 2_097_152.0;
const TWO_TO_32: f64 = 4_294_967_296.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_begin_as_those_of_the_crate() {
        let keys: Vec<Key> = (0..1000)
            .map(|i: u32| Key { index: i * 7919 % (1 << 16), seed: i.wrapping_mul(0x9e37_79b9) })
            .collect();
        let mut out = vec![[0.0; 2]; keys.len()];
        for first in [0, 2, 4, 18, 254] {
            pairs(&keys, first, &mut out);
            for (key, pair) in keys.iter().zip(&out) {
                let expected = [first, first + 1]
                    .map(|d| f64::from(sobol_burley::sample(key.index, d, key.seed)));
                // The crate's have 23 bits.
                let cut = pair.map(|x| (x * 8_388_608.0).floor() / 8_388_608.0);
                assert_eq!(cut, expected, "{key:?}, dimension {first}");
                assert_eq!(*pair, super::pair(*key, first));
            }
        }
    }
    /// What a table of 2²⁴ entries leaves of a number is as even as the number: all 29 bits behind the
    /// 24th are set as often as not.
    #[test]
    fn the_last_bits_are_random() {
        let count = 1 << 16;
        let keys: Vec<Key> =
            (0..count).map(|i| Key { index: i % 256, seed: hash(i / 256) }).collect();
        let mut out = vec![[0.0; 2]; keys.len()];
        pairs(&keys, 2, &mut out);
        for bit in 25..=53 {
            let set = |x: &f64| (x * f64::from(bit).exp2()).rem_euclid(2.0) >= 1.0;
            for k in 0..2 {
                let share =
                    out.iter().filter(|pair| set(&pair[k])).count() as f64 / out.len() as f64;
                // Four and a half standard errors: one in 10⁵ of 58.
                assert!((share - 0.5).abs() < 4.5 * 0.5 / 256.0, "bit {bit}: {share}");
            }
        }
    }
}
