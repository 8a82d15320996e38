//! Scrambled Sobol points of many samples side by side, to the last bit of an f64 below 1.
//!
//! Every pair of numbers is a point of the first two dimensions of Sobol's sequence, which are the best stratified that
//! there are (of any 2ᵐ points from a multiple of 2ᵐ on, one lies in each elementary interval of area 2⁻ᵐ). Two pairs
//! are a *set* of four dimensions, scrambled and shuffled for itself (Burley, "Practical hash-based Owen scrambling",
//! 2020, section 3: shuffling pads such sets to any number of dimensions). The second pair of a set is at an index that
//! an upper triangular matrix over {0, 1} makes of the first one's, which leaves it a sequence as good
//! (Ahmed, Skopenkov, Hadwiger and Wonka, "Analysis and Synthesis of Digital Dyadic Sequences", 2023), and of which the
//! four dimensions together are even: found among products of three shifts by the variance of smooth functions, edges and
//! discs across both pairs, of 8 to 4096 points.
//!
//! Shuffling keeps neighbouring indices together as Owen's scrambling does: they lie in different halves of one pair and
//! of every other one, which doubles what the product of two pairs varies by. Which of four indices are neighbours is
//! therefore drawn for each four: from four points on sets are padded as if at random.
//!
//! The first dimension is the reversed index. The second multiplies it by Pascal's triangle modulo 2,
//! which is 1 where the bits of a row's number are among those of the column's (Lucas 1878): a sum over
//! supersets, five shifts (Ahmed, "An Implementation Algorithm of 2D Sobol Sequence Fast, Elegant, and
//! Compact", 2024).
//!
//! Points of Sobol's sequence may lie close together, and Owen's scrambling leaves it to chance: an edge of a light or of a
//! shadow then counts some of them twice. Each dimension is therefore multiplied by a lower triangular matrix, which
//! leaves a sequence as good (Matoušek, "On the L2-discrepancy for anchored boxes", 1998), and its first eight
//! bits are shifted, the same ones of all points, as keeps points apart that are; Owen's scrambling is left to what is
//! below. The two matrices are products of three shifts, found by climbing from random ones by the mean squares of the
//! errors of discs, half-planes and smooth bells, of 4 to 256 points, against those by Owen's scrambling alone. (Widest
//! distances of nets: Grünschloß and Keller, "(t, m, s)-nets and maximized minimum distance, part II", 2009.)
//!
//! 32 bits are scrambled, and 21 random ones go behind them: a table of 2²⁴ entries leaves as many even
//! ones for what comes after the choice.

use sobol_burley::parts::{hash, owen_scramble_rev};

/// Samples worked on side by side.
const LANES: usize = 16;

/// A half of a set's four dimensions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Half {
    First,
    Second,
}

/// A sample of a scrambled set.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct SobolKey {
    /// Index of the sample, below 2¹⁶.
    pub(crate) index: u32,
    /// Seed of the scrambling.
    pub(crate) seed: u32,
}

impl SobolKey {
    /// Returns the key of the sample in another scrambling.
    #[inline(always)]
    pub(crate) fn shifted(self, shift: u32) -> Self {
        Self { seed: self.seed.wrapping_add(shift), ..self }
    }
}

/// The point of each of `keys` in two dimensions of its set. `out` is as long as `keys`.
pub(crate) fn points(keys: &[SobolKey], half: Half, out: &mut [[f64; 2]]) {
    scrambled(keys, half, out);
}

/// The points of both halves of the sets of `keys`, which `out` is as long as.
pub(crate) fn points_of_sets(keys: &[SobolKey], out: [&mut [[f64; 2]]; 2]) {
    scrambled_sets(keys, out);
}

/// The points of those of `keys` that are picked, of scramblings shifted by `shift`, to 24 bits in two columns as long
/// as `picked`.
pub(crate) fn floats(
    keys: &[SobolKey],
    shift: u32,
    picked: &[u32],
    half: Half,
    out: [&mut [f32]; 2],
) {
    scrambled_floats(keys, shift, picked, half, out);
}

/// The first 24 bits of a number below 1.
#[expect(
    clippy::cast_possible_truncation,
    reason = "a whole number below 2²⁴ is one of single precision"
)]
pub(crate) fn float(x: f64) -> f32 {
    ((x * TWO_TO_24).floor() / TWO_TO_24) as f32
}

/// The point of one key in two dimensions of its set.
pub(crate) fn point(key: SobolKey, half: Half) -> [f64; 2] {
    let [point] = SetSamples::of([key.index], [key.seed]).points(half);
    point
}

#[multiversion::multiversion(targets = "simd")]
fn scrambled(keys: &[SobolKey], half: Half, out: &mut [[f64; 2]]) {
    let (whole, rest) = keys.as_chunks::<LANES>();
    let (to, to_rest) = out.as_chunks_mut::<LANES>();
    for (keys, out) in whole.iter().zip(to) {
        *out = set_samples(keys).points(half);
    }
    if !rest.is_empty() {
        to_rest.copy_from_slice(&set_samples(&filled(rest)).points(half)[..rest.len()]);
    }
}

#[multiversion::multiversion(targets = "simd")]
fn scrambled_sets(keys: &[SobolKey], [first, second]: [&mut [[f64; 2]]; 2]) {
    let (whole, rest) = keys.as_chunks::<LANES>();
    let (first, first_rest) = first.as_chunks_mut::<LANES>();
    let (second, second_rest) = second.as_chunks_mut::<LANES>();
    for ((keys, first), second) in whole.iter().zip(first).zip(second) {
        let samples = set_samples(keys);
        (*first, *second) = (samples.points(Half::First), samples.points(Half::Second));
    }
    if !rest.is_empty() {
        let samples = set_samples(&filled(rest));
        first_rest.copy_from_slice(&samples.points(Half::First)[..rest.len()]);
        second_rest.copy_from_slice(&samples.points(Half::Second)[..rest.len()]);
    }
}

/// Some keys or numbers, and the first of them for what is missing to a chunk.
#[inline(always)]
fn filled<T: Copy>(rest: &[T]) -> [T; LANES] {
    let mut lanes = [rest[0]; LANES];
    for (lane, &own) in lanes.iter_mut().zip(rest) {
        *lane = own;
    }
    lanes
}

#[multiversion::multiversion(targets = "simd")]
fn scrambled_floats(
    keys: &[SobolKey],
    shift: u32,
    picked: &[u32],
    half: Half,
    [x, y]: [&mut [f32]; 2],
) {
    let (whole, rest) = picked.as_chunks::<LANES>();
    let ((x, x_rest), (y, y_rest)) = (x.as_chunks_mut::<LANES>(), y.as_chunks_mut::<LANES>());
    for ((picked, x), y) in whole.iter().zip(x).zip(y) {
        [*x, *y] = floats_of(keys, shift, picked, half);
    }
    if !rest.is_empty() {
        let [a, b] = floats_of(keys, shift, &filled(rest), half);
        x_rest.copy_from_slice(&a[..rest.len()]);
        y_rest.copy_from_slice(&b[..rest.len()]);
    }
}

/// The upper 24 bits of the points of some keys, which single precision holds.
#[inline(always)]
fn floats_of(
    keys: &[SobolKey],
    shift: u32,
    picked: &[u32; LANES],
    half: Half,
) -> [[f32; LANES]; 2] {
    let (mut index, mut seeds) = ([0; LANES], [0; LANES]);
    for i in 0..LANES {
        let SobolKey { index: at, seed } = keys[picked[i] as usize];
        (index[i], seeds[i]) = (at, seed);
    }
    for seed in &mut seeds {
        *seed = seed.wrapping_add(shift);
    }
    let [(across, _), (up, _)] = SetSamples::of(index, seeds).upper_bits(half);
    let (mut x, mut y) = ([0.0; LANES], [0.0; LANES]);
    for i in 0..LANES {
        x[i] = (across[i] >> 8) as f32 / 16_777_216.0;
        y[i] = (up[i] >> 8) as f32 / 16_777_216.0;
    }
    [x, y]
}

#[inline(always)]
fn set_samples(keys: &[SobolKey; LANES]) -> SetSamples<LANES> {
    let (mut index, mut seeds) = ([0; LANES], [0; LANES]);
    for i in 0..LANES {
        (index[i], seeds[i]) = (keys[i].index, keys[i].seed);
    }
    SetSamples::of(index, seeds)
}

/// The second dimension of point `index`, its bits reversed.
#[inline(always)]
fn second_reversed(index: u32) -> u32 {
    let mut bits = index;
    bits ^= (bits >> 1) & 0x5555_5555;
    bits ^= (bits >> 2) & 0x3333_3333;
    bits ^= (bits >> 4) & 0x0f0f_0f0f;
    bits ^= (bits >> 8) & 0x00ff_00ff;
    bits ^ ((bits >> 16) & 0x0000_ffff)
}

/// Samples of a set: the hashes of their scramblings, and their shuffled indices.
#[derive(Clone, Copy)]
struct SetSamples<const N: usize> {
    keys: [u32; N],
    at: [u32; N],
}

impl<const N: usize> SetSamples<N> {
    #[inline(always)]
    fn of(index: [u32; N], seeds: [u32; N]) -> Self {
        let (mut keys, mut at) = ([0; N], [0; N]);
        for i in 0..N {
            keys[i] = hash(seeds[i]);
        }
        for i in 0..N {
            let own = paired(index[i], keys[i]).reverse_bits();
            at[i] = owen_scramble_rev(own, keys[i]).reverse_bits();
        }
        Self { keys, at }
    }

    /// The scrambled upper 32 bits of each dimension of a half, with what they were scrambled by.
    #[inline(always)]
    fn upper_bits(&self, half: Half) -> [([u32; N], [u32; N]); 2] {
        const SALTS: [[u32; 2]; 2] = [[0x912f_69ba, 0x174f_18ab], [0x912f_69bc, 0x174f_18ad]];
        let mut at = self.at;
        let salts = match half {
            Half::First => SALTS[0],
            Half::Second => {
                for at in &mut at {
                    *at = of_second_half(*at);
                }
                SALTS[1]
            }
        };
        let mut second = [0; N];
        for i in 0..N {
            second[i] = second_reversed(at[i]);
        }
        let mut out = [([0; N], [0; N]); 2];
        let dimensions = out.iter_mut().zip([at, second]).zip(salts).zip(SPREADS);
        for ((((high, scrambles), number), salt), masks) in dimensions {
            let salt = hash(salt);
            for i in 0..N {
                scrambles[i] = hash(self.keys[i] ^ salt);
                let digits = spread(number[i], masks);
                let nested = owen_scramble_rev(digits, scrambles[i]);
                let shifted = digits ^ (scrambles[i] >> 7);
                high[i] = (nested & !SHIFTED | shifted & SHIFTED).reverse_bits();
            }
        }
        out
    }

    /// The points of a half: 32 bits that are scrambled, and 21 more by hashing.
    #[inline(always)]
    fn points(&self, half: Half) -> [[f64; 2]; N] {
        let mut rows = [[0.0; N]; 2];
        for (row, (high, scrambles)) in rows.iter_mut().zip(self.upper_bits(half)) {
            for i in 0..N {
                let low = hash(high[i] ^ scrambles[i]) >> 11;
                row[i] = (f64::from(high[i]) + f64::from(low) / TWO_TO_21) / TWO_TO_32;
            }
        }
        let mut out = [[0.0; 2]; N];
        for i in 0..N {
            out[i] = [rows[0][i], rows[1][i]];
        }
        out
    }
}

/// An index among its four, of which `key` draws the neighbours, that differ in the last bit alone: the first of four is
/// the second's, the third's or the last's.
#[inline(always)]
fn paired(index: u32, key: u32) -> u32 {
    let drawn = hash(key ^ (index >> 2).wrapping_mul(0x9e37_79b9)) >> 16;
    let way = (drawn * 3) >> 16;
    let (low, high) = (index & 1, (index >> 1) & 1);
    let third = (low << 1) | high;
    let last = ((low ^ high) << 1) | low;
    let turned = if way == 1 { third } else { last };
    (index & !3) | if way == 0 { index & 3 } else { turned }
}

/// The index at which the second half of a set is the first.
#[inline(always)]
fn of_second_half(index: u32) -> u32 {
    let mut bits = index;
    bits ^= (bits >> 1) & 0x6e70;
    bits ^= (bits >> 2) & 0x6edf;
    bits ^ ((bits >> 3) & 0x87df)
}

/// A dimension's number, its bits reversed, by a lower triangular matrix over {0, 1}: three shifts.
#[inline(always)]
fn spread(reversed: u32, [once, twice, thrice]: [u32; 3]) -> u32 {
    let mut bits = reversed;
    bits ^= (bits << 1) & once;
    bits ^= (bits << 2) & twice;
    bits ^ ((bits << 3) & thrice)
}

/// The first bits of a number, reversed, that are shifted and not scrambled.
const SHIFTED: u32 = 0xff;

/// The masks by which each dimension of a pair is spread.
const SPREADS: [[u32; 3]; 2] = [[0x5a, 0xd7, 0x72], [0xac, 0x90, 0x67]];

const TWO_TO_24: f64 = 16_777_216.0;
const TWO_TO_21: f64 = 2_097_152.0;
const TWO_TO_32: f64 = 4_294_967_296.0;

#[cfg(test)]
mod tests;
