//! A fingerprint of a picture's values, to see at a glance whether two renders are the same.

use std::fmt;

use xxhash_rust::xxh3::Xxh3Default;

use super::layer::LE_BAND;
use super::{Picture, Values};

/// The XXH3 fingerprint (128 bits) of a picture. It depends on the size, on the channels' names
/// and on every bit of their values; not on the order of layers, on the threads, on any file
/// format, nor on the header. It tells pictures apart and is no seal against forgery.
///
/// The bytes are, so that other programs can work it out: `etendue image 1`, a zero byte, width and
/// height as u64; then for each channel in byte order of the full names: the name, a zero byte, the
/// type (`f4`, `f8`, `u2`, `u4`), a zero byte, the values row by row. All numbers little-endian.
///
/// Source: Collet, *xxHash fast digest algorithm*, XXH3 of release 0.8.0 (2020), seed 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ImageHash(pub u128);

impl ImageHash {
    /// The fingerprint of `picture`.
    #[must_use]
    pub fn of(picture: &Picture) -> Self {
        let mut state = Xxh3Default::new();
        state.update(b"etendue image 1\0");
        state.update(&(picture.width() as u64).to_le_bytes());
        state.update(&(picture.height() as u64).to_le_bytes());
        for (name, values) in picture.sorted_channels() {
            state.update(name.as_bytes());
            state.update(b"\0");
            state.update(values.type_name().as_bytes());
            state.update(b"\0");
            update(&mut state, values);
        }
        Self(state.digest128())
    }
}

fn update(state: &mut Xxh3Default, values: &Values) {
    let mut bytes = Vec::new();
    for start in (0..values.len()).step_by(LE_BAND) {
        let end = values.len().min(start + LE_BAND);
        bytes.resize((end - start) * values.value_bytes(), 0);
        values.put_le(start..end, &mut bytes, values.value_bytes());
        state.update(&bytes);
    }
}

impl fmt::Display for ImageHash {
    /// 32 hexadecimal digits.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Channel, Layer, Look};
    use super::*;

    fn layer(name: &str, values: Values) -> Layer {
        let channels = vec![Channel { name: "Z".into(), values }];
        Layer { name: name.into(), look: Look::Distance, channels, meaning: Vec::new() }
    }

    fn hash(width: usize, height: usize, layers: Vec<Layer>) -> ImageHash {
        ImageHash::of(&Picture::new(width, height, layers, Vec::new()).unwrap())
    }

    #[test]
    fn every_bit_name_type_and_side_counts() {
        let base = hash(2, 1, vec![layer("A", Values::F32(vec![0.0, 1.0]))]);
        let others = [
            hash(2, 1, vec![layer("A", Values::F32(vec![-0.0, 1.0]))]),
            hash(2, 1, vec![layer("A", Values::F32(vec![0.0, 1.0_f32.next_up()]))]),
            hash(2, 1, vec![layer("B", Values::F32(vec![0.0, 1.0]))]),
            hash(2, 1, vec![layer("A", Values::U32(vec![0, 1.0_f32.to_bits()]))]),
            hash(1, 2, vec![layer("A", Values::F32(vec![0.0, 1.0]))]),
            hash(2, 1, vec![layer("A", Values::F64(vec![0.0, 1.0]))]),
        ];
        for (i, other) in others.iter().enumerate() {
            assert_ne!(*other, base, "case {i}");
        }
    }

    #[test]
    fn order_of_layers_does_not_count() {
        let a = || layer("A", Values::F32(vec![1.0]));
        let b = || layer("B", Values::U16(vec![2]));
        assert_eq!(hash(1, 1, vec![a(), b()]), hash(1, 1, vec![b(), a()]));
    }

    #[test]
    fn bands_do_not_show() {
        let values: Vec<f32> = (0_u16..u16::MAX).map(f32::from).collect();
        assert!(values.len() > LE_BAND);
        let mut bytes = b"etendue image 1\0".to_vec();
        bytes.extend((values.len() as u64).to_le_bytes());
        bytes.extend(1_u64.to_le_bytes());
        bytes.extend(b"A.Z\0f4\0");
        bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        let expected = xxhash_rust::xxh3::xxh3_128(&bytes);
        assert_eq!(hash(values.len(), 1, vec![layer("A", Values::F32(values))]).0, expected);
    }
}
