//! Owen-scrambled Sobol numbers of many samples side by side.
//!
//! The numbers are those of the crate `sobol_burley` (Burley, "Practical hash-based Owen scrambling",
//! 2020), bit for bit. That crate makes one sample's at a time, in a loop over the set bits of its
//! index, which a vector unit cannot share among samples; here every bit is looked at.

use std::array;
use std::sync::LazyLock;

use sobol_burley::NUM_DIMENSIONS;
use sobol_burley::parts::{hash, owen_scramble_rev, sobol_rev, u32_to_f32_norm};

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
    let directions = &*DIRECTIONS;
    let both = [0, 1].map(|k| &directions[(first + k) as usize]);
    scrambled(keys, first, both, out);
}

#[multiversion::multiversion(targets(
    "x86_64+avx512f+avx512dq+avx512vl",
    "x86_64+avx2",
    "aarch64+neon"
))]
fn scrambled(keys: &[Key], first: u32, directions: [&[u32; BITS]; 2], out: &mut [[f64; 2]]) {
    const SHUFFLE: u32 = 0x79c6_8e4a;
    const SEED: u32 = 0x9c8f_2d3b;
    const DIMENSION: [u32; 4] = [0x912f_69ba, 0x174f_18ab, 0x691e_72ca, 0xb40c_c1b8];
    for (keys, out) in keys.chunks(LANES).zip(out.chunks_mut(LANES)) {
        let mut lanes = [Key::default(); LANES];
        lanes[..keys.len()].copy_from_slice(keys);
        let mut index = [0; LANES];
        for (index, key) in index.iter_mut().zip(&lanes) {
            *index = owen_scramble_rev(key.index.reverse_bits(), hash(key.seed ^ SHUFFLE));
        }
        for (k, directions) in directions.into_iter().enumerate() {
            let mut number = [0; LANES];
            for (bit, &direction) in directions.iter().enumerate() {
                for (number, &index) in number.iter_mut().zip(&index) {
                    let is_set = index >> (31 - bit) & 1;
                    *number ^= direction & is_set.wrapping_neg();
                }
            }
            let dimension = first as usize + k;
            let salt = first >> 2 ^ DIMENSION[dimension % 4];
            let mut values = [0.0; LANES];
            for ((value, &number), key) in values.iter_mut().zip(&number).zip(&lanes) {
                let scramble = hash(salt ^ key.seed.wrapping_mul(SEED));
                let scrambled = owen_scramble_rev(number, scramble).reverse_bits();
                *value = f64::from(u32_to_f32_norm(scrambled));
            }
            for (out, value) in out.iter_mut().zip(values) {
                out[k] = value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_of_the_crate_to_the_bit() {
        let keys: Vec<Key> = (0..1000)
            .map(|i: u32| Key { index: i * 7919 % (1 << 16), seed: i.wrapping_mul(0x9e37_79b9) })
            .collect();
        let mut out = vec![[0.0; 2]; keys.len()];
        for first in [0, 2, 4, 18, 254] {
            pairs(&keys, first, &mut out);
            for (key, pair) in keys.iter().zip(&out) {
                let expected = [first, first + 1]
                    .map(|d| f64::from(sobol_burley::sample(key.index, d, key.seed)));
                assert_eq!(*pair, expected, "{key:?}, dimension {first}");
            }
        }
    }
}
