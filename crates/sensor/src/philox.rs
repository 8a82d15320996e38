//! Random numbers by counting: a block cipher turns (who, where, when) into 128 random bits.
//!
//! There is no state to pass along, so any pixel of any frame can be drawn at any time by any
//! thread, alone or eight at a time, and always comes out the same.
//!
//! # Sources
//!
//! Philox4x32-10: J. K. Salmon, M. A. Moraes, R. O. Dror, D. E. Shaw, "Parallel Random Numbers: As
//! Easy as 1, 2, 3", SC 2011. It passes `TestU01`'s `BigCrush`; the tests hold its known answers.

/// Multipliers of a round.
const MULTIPLIER: [u64; 2] = [0xD251_1F53, 0xCD9E_8D57];

/// Increment of the key from round to round.
const WEYL: [u32; 2] = [0x9E37_79B9, 0xBB67_AE85];

const ROUNDS: usize = 10;

/// The low half of a 64-bit band.
const LOW: u64 = 0xFFFF_FFFF;

/// A random sequence: the seed of temporal noise, or the serial number of a sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct PhiloxKey([u32; ROUNDS], [u32; ROUNDS]);

impl PhiloxKey {
    #[expect(clippy::cast_possible_truncation, reason = "the halves of a word")]
    pub(crate) fn new(seed: u64) -> Self {
        let halves = [seed as u32, (seed >> 32) as u32];
        let [even, odd] = [0, 1].map(|half| {
            std::array::from_fn(|round| {
                halves[half].wrapping_add(WEYL[half].wrapping_mul(round as u32))
            })
        });
        Self(even, odd)
    }

    /// The sequence of temporal noise of one sensor: those of two serial numbers are as unlike as
    /// those of two seeds.
    #[expect(clippy::cast_possible_truncation, reason = "the halves of a word")]
    pub(crate) fn temporal(seed: u64, serial: u64) -> Self {
        let [a, b, ..] = Self::new(seed).words([
            serial as u32,
            (serial >> 32) as u32,
            0,
            DrawUse::PhiloxKey as u32,
        ]);
        Self::new(a | b << 32)
    }

    /// 128 random bits for this counter, as four words in the low halves.
    #[inline(always)]
    pub(crate) fn words(&self, counter: [u32; 4]) -> [u64; 4] {
        let [mut a, mut b, mut c, mut d] = counter.map(u64::from);
        for round in 0..ROUNDS {
            let [first, second] = [MULTIPLIER[0] * a, MULTIPLIER[1] * c];
            a = (second >> 32) ^ b ^ u64::from(self.0[round]);
            b = second & LOW;
            c = (first >> 32) ^ d ^ u64::from(self.1[round]);
            d = first & LOW;
        }
        [a, b, c, d]
    }
}

/// A seed for whatever `identity` names: as unlike that of another identity as that of another seed.
#[must_use]
pub fn mixed_seed(seed: u64, identity: &[u8]) -> u64 {
    let mut mixed = seed;
    for part in identity.chunks(8) {
        let mut bytes = [0; 8];
        bytes[..part.len()].copy_from_slice(part);
        let word = u64::from_le_bytes(bytes);
        #[expect(clippy::cast_possible_truncation, reason = "the halves of a word")]
        let counter =
            [word as u32, (word >> 32) as u32, part.len() as u32, DrawUse::PhiloxKey as u32];
        let [a, b, ..] = PhiloxKey::new(mixed).words(counter);
        mixed = a | b << 32;
    }
    mixed
}

/// Use of a random number. Two uses never share a counter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub(crate) enum DrawUse {
    /// The first try at electrons, and the read noise.
    Temporal = 1,
    /// Further tries at electrons.
    Electrons = 2,
    /// The row's offset: of a frame, or of all.
    Row = 3,
    /// The column's offset, likewise.
    Column = 4,
    /// PRNU, DSNU and what is wrong with the pixel.
    Pattern = 5,
    /// Strength of a hot pixel.
    HotPixel = 6,
    /// Keys of other sequences. It is no pixel's: uses of pixels stand in the highest bits.
    PhiloxKey = 7,
    /// DCNU.
    DarkCurrent = 8,
}

/// Channels that a counter has room for.
pub(crate) const MOST_CHANNELS: usize = 4096;

/// Site of a random number: where on the sensor, when and what for. The counter without the column.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Site {
    pub(crate) row: u32,
    pub(crate) channel: u16,
    pub(crate) frame: u32,
}

impl Site {
    /// The counter of a column; `draw` counts tries of one use.
    #[inline(always)]
    pub(crate) fn counter(self, column: u32, draw_use: DrawUse, draw: u16) -> [u32; 4] {
        let place = (draw_use as u32) << 28 | u32::from(self.channel) << 16 | u32::from(draw);
        [column, self.row, self.frame, place]
    }
}

/// A number in (0, 1) from a word, in steps of 2⁻³².
#[inline(always)]
pub(crate) fn unit32(word: u64) -> f64 {
    // The mantissa of a number in [1, 2) with a half step added: no conversion of integers, which
    // vector units lack.
    f64::from_bits(0x3FF0_0000_0000_0000 | word << 20 | 1 << 19) - 1.0
}

/// A number in (0, 1] from two words, in steps of 2⁻⁵².
#[inline(always)]
pub(crate) fn unit52(high: u64, low: u64) -> f64 {
    2.0 - f64::from_bits(0x3FF0_0000_0000_0000 | high << 20 | low >> 12)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_answers() {
        // Random123 1.14, tests/kat_vectors, "philox4x32 10".
        let seed = |low: u32, high: u32| u64::from(low) | u64::from(high) << 32;
        let answers = [
            ([0; 4], seed(0, 0), [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]),
            (
                [0xffff_ffff; 4],
                seed(0xffff_ffff, 0xffff_ffff),
                [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd],
            ),
            (
                [0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344],
                seed(0xa409_3822, 0x299f_31d0),
                [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1],
            ),
        ];
        for (counter, seed, expected) in answers {
            assert_eq!(PhiloxKey::new(seed).words(counter), expected);
        }
    }

    #[test]
    fn seeds_of_other_identities_differ() {
        let seeds: Vec<u64> =
            [&b""[..], b"a", b"b", b"a\0", b"longer than a word", b"longer than a worf"]
                .map(|identity| mixed_seed(3, identity))
                .into();
        for (i, seed) in seeds.iter().enumerate() {
            assert!(!seeds[..i].contains(seed), "{seeds:?}");
        }
        assert_eq!((mixed_seed(3, b""), mixed_seed(3, b"a")), (3, mixed_seed(3, b"a")));
        let key = |seed, serial| PhiloxKey::temporal(seed, serial);
        assert!(key(1, 2) != key(2, 1) && key(1, 2) != key(1, 3) && key(0, 1) != key(1, 0));
    }

    #[test]
    fn units_stay_inside() {
        assert_eq!(unit52(0, 0), 1.0);
        assert_eq!(unit52(LOW, LOW), f64::EPSILON);
        assert_eq!(unit32(0), 0.5 / 4_294_967_296.0);
        assert_eq!(unit32(LOW), 1.0 - 0.5 / 4_294_967_296.0);
    }

    #[test]
    fn no_two_stages_share_a_counter() {
        let site = Site { row: 3, channel: 4095, frame: 9 };
        let other = Site { channel: 0, ..site };
        assert_ne!(
            site.counter(7, DrawUse::Temporal, u16::MAX),
            other.counter(7, DrawUse::Electrons, u16::MAX)
        );
        const { assert!(MOST_CHANNELS << 16 <= 1 << 28, "a channel reaches into the use") };
    }
}
