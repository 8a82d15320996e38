//! Inputs from inputs: few and plain changes, as likely to keep a file whole as to break it.

use fastrand::Rng;

/// The longest input (bytes).
pub const LONGEST: usize = 1 << 20;

/// Words that readers trip over.
const WORDS: [&str; 24] = [
    "0",
    "-1",
    "1",
    "4",
    "255",
    "65536",
    "67108864",
    "2147483647",
    "4294967295",
    "4294967296",
    "1e9",
    "1e400",
    "-1e-320",
    "nan",
    "inf",
    "null",
    "[]",
    "{}",
    "\"\"",
    "true",
    "\n",
    "\r",
    "\\",
    "../a",
];

/// `input` changed at one to eight places; `other` may lend a part.
#[must_use]
pub fn mutate(rng: &mut Rng, input: &[u8], other: &[u8]) -> Vec<u8> {
    let mut bytes = input.to_vec();
    for _ in 0..1 << rng.u32(0..4) {
        step(rng, &mut bytes, other);
    }
    bytes.truncate(LONGEST);
    bytes
}

fn step(rng: &mut Rng, bytes: &mut Vec<u8>, other: &[u8]) {
    let at = rng.usize(0..=bytes.len());
    let part = part_of(rng, bytes);
    match rng.u32(0..9) {
        0 => {
            if let Some(byte) = bytes.get_mut(at) {
                *byte ^= 1 << rng.u32(0..8);
            }
        }
        1 => {
            if let Some(byte) = bytes.get_mut(at) {
                *byte = rng.u8(..);
            }
        }
        2 => drop(bytes.drain(part)),
        3 => {
            let word = WORDS[rng.usize(0..WORDS.len())];
            bytes.splice(at..at, word.bytes());
        }
        // A number as text becomes another.
        4 => {
            if let Some(number) = number_at(bytes, at) {
                let word = WORDS[rng.usize(0..WORDS.len())];
                bytes.splice(number, word.bytes());
            }
        }
        // A number as bytes becomes one at the end of its range, or next to it.
        5 => {
            let value = [0, 1, 3, 0x7fff_ffff, 0xffff_ffff, 0x7f80_0000, 1 << 26][rng.usize(0..7)];
            let word = u32::to_le_bytes(value);
            let size = [1, 2, 4][rng.usize(0..3)];
            if let Some(to) = bytes.get_mut(at..at.saturating_add(size)) {
                to.copy_from_slice(&word[..size]);
            }
        }
        // A part again, once or very often.
        6 => {
            let part = bytes[part].to_vec();
            let times = if rng.u32(0..8) == 0 { 1 << rng.u32(0..14) } else { 1 };
            let times = times.min(LONGEST.saturating_sub(bytes.len()) / part.len().max(1));
            bytes.splice(at..at, part.repeat(times));
        }
        7 => {
            let part = part_of(rng, other);
            bytes.splice(at..at, other[part].iter().copied());
        }
        _ => bytes.truncate(at),
    }
}

/// A part of `bytes`, mostly short.
fn part_of(rng: &mut Rng, bytes: &[u8]) -> std::ops::Range<usize> {
    let start = rng.usize(0..=bytes.len());
    let longest = (1 << rng.u32(0..12)).min(bytes.len() - start);
    start..start + rng.usize(0..=longest)
}

/// The digits around byte `at`, or behind it.
fn number_at(bytes: &[u8], at: usize) -> Option<std::ops::Range<usize>> {
    let is_part = |byte: &u8| byte.is_ascii_digit() || matches!(byte, b'.' | b'-' | b'e');
    let start = at + bytes.get(at..)?.iter().position(&is_part)?;
    let length = bytes[start..].iter().take_while(|byte| is_part(byte)).count();
    Some(start..start + length)
}
