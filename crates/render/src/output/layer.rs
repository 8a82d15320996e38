//! Layers of a picture: planes of numbers with their names and meaning.

use std::ops::Range;

use rayon::prelude::*;

use etendue_image::cube::emission_channel;
use etendue_tracer::layer::Look;
use serde::{Deserialize, Serialize};

use super::SPECTRUM;

/// Numbers of one channel, a pixel each: row-major, row 0 at the top.
#[derive(Debug, Clone)]
pub enum Values {
    /// Measured or computed values.
    F32(Vec<f32>),
    /// Values with nothing rounded off. An EXR rounds them to f32, an NPY keeps them.
    F64(Vec<f64>),
    /// Digital numbers of a sensor.
    U16(Vec<u16>),
    /// Identities.
    U32(Vec<u32>),
}

impl Values {
    /// The number of values.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::F32(values) => values.len(),
            Self::F64(values) => values.len(),
            Self::U16(values) => values.len(),
            Self::U32(values) => values.len(),
        }
    }

    /// True if there are no values.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The type as numpy writes it: `f4`, `f8`, `u2` or `u4`.
    #[must_use]
    pub fn type_name(&self) -> &'static str {
        match self {
            Self::F32(_) => "f4",
            Self::F64(_) => "f8",
            Self::U16(_) => "u2",
            Self::U32(_) => "u4",
        }
    }

    /// Bytes a value.
    #[must_use]
    pub fn value_bytes(&self) -> usize {
        match self {
            Self::U16(_) => 2,
            Self::F32(_) | Self::U32(_) => 4,
            Self::F64(_) => 8,
        }
    }

    /// The largest value of integers; 0 for other types.
    #[must_use]
    pub fn largest_integer(&self) -> u32 {
        match self {
            Self::U16(values) => values.par_iter().max().copied().unwrap_or(0).into(),
            Self::U32(values) => values.par_iter().max().copied().unwrap_or(0),
            Self::F32(_) | Self::F64(_) => 0,
        }
    }

    /// Value `i` as a number. Exact: f64 holds every value of every type here.
    #[must_use]
    #[inline]
    pub fn at(&self, i: usize) -> f64 {
        match self {
            Self::F32(values) => values[i].into(),
            Self::F64(values) => values[i],
            Self::U16(values) => values[i].into(),
            Self::U32(values) => values[i].into(),
        }
    }

    /// Writes values `range` as little-endian bytes to `out`, `stride` bytes from one to the next.
    pub(crate) fn put_le(&self, range: Range<usize>, out: &mut [u8], stride: usize) {
        match self {
            Self::F32(values) => put(&values[range], out, stride, f32::to_le_bytes),
            Self::F64(values) => put(&values[range], out, stride, f64::to_le_bytes),
            Self::U16(values) => put(&values[range], out, stride, u16::to_le_bytes),
            Self::U32(values) => put(&values[range], out, stride, u32::to_le_bytes),
        }
    }

    /// Takes the values of `range` from `bytes`, little-endian and side by side.
    pub(crate) fn read_le(&mut self, range: Range<usize>, bytes: &[u8]) {
        match self {
            Self::F32(values) => get(&mut values[range], bytes, f32::from_le_bytes),
            Self::F64(values) => get(&mut values[range], bytes, f64::from_le_bytes),
            Self::U16(values) => get(&mut values[range], bytes, u16::from_le_bytes),
            Self::U32(values) => get(&mut values[range], bytes, u32::from_le_bytes),
        }
    }

    /// The index of the first NaN.
    pub(super) fn first_nan(&self) -> Option<usize> {
        match self {
            Self::F32(values) => first(values, |value| value.is_nan()),
            Self::F64(values) => first(values, |value| value.is_nan()),
            Self::U16(_) | Self::U32(_) => None,
        }
    }
}

/// Values that are turned into bytes at a time: few enough to stay in a core's cache.
pub(super) const LE_BAND: usize = 1 << 14;

/// The values of `bytes`, side by side.
fn get<T, const N: usize>(values: &mut [T], bytes: &[u8], value: impl Fn([u8; N]) -> T) {
    for (slot, &bytes) in values.iter_mut().zip(bytes.as_chunks::<N>().0) {
        *slot = value(bytes);
    }
}

/// `bytes` of each value, `stride` bytes from one to the next in `out`.
pub(super) fn put<T: Copy, const N: usize>(
    values: &[T],
    out: &mut [u8],
    stride: usize,
    bytes: impl Fn(T) -> [u8; N],
) {
    if stride == N {
        // Without gaps this is a copy of memory.
        for (slot, &value) in out.as_chunks_mut::<N>().0.iter_mut().zip(values) {
            *slot = bytes(value);
        }
    } else {
        for (slot, &value) in out.chunks_mut(stride).zip(values) {
            slot[..N].copy_from_slice(&bytes(value));
        }
    }
}

/// The index of the first value that is `wanted`, searched by all threads.
fn first<T: Copy + Sync>(values: &[T], wanted: impl Fn(T) -> bool + Sync) -> Option<usize> {
    const BAND: usize = 1 << 15;
    values.par_chunks(BAND).enumerate().find_map_first(|(band, values)| {
        // Without an early exit this is a vector loop, and nearly always finds nothing.
        let any = values.iter().fold(false, |any, &value| any | wanted(value));
        let k = any.then(|| values.iter().position(|&value| wanted(value)))??;
        Some(band * BAND + k)
    })
}

/// One plane of a layer.
#[derive(Debug)]
pub struct Channel {
    /// `Z`, `X`, `R`, `object` …
    pub name: String,
    /// One value a pixel.
    pub values: Values,
}

/// Entry of a file's header, or of what it says of a layer.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "[String; 2]", into = "[String; 2]")]
pub struct HeaderEntry {
    /// Its name.
    pub key: String,
    /// Its content.
    pub text: String,
}

impl HeaderEntry {
    /// A name and a text.
    #[must_use]
    pub fn new(key: impl Into<String>, text: impl Into<String>) -> Self {
        Self { key: key.into(), text: text.into() }
    }
}

impl From<[String; 2]> for HeaderEntry {
    fn from([key, text]: [String; 2]) -> Self {
        Self { key, text }
    }
}

impl From<HeaderEntry> for [String; 2] {
    fn from(HeaderEntry { key, text }: HeaderEntry) -> Self {
        [key, text]
    }
}

/// One named image of a render: `Depth`, `Normal`, … All its channels are of one type.
#[derive(Debug)]
pub struct Layer {
    /// The name before the dot of `Depth.Z`; empty for the picture itself, whose `R G B` stand at
    /// the root of an EXR. Dots inside it make groups.
    pub name: String,
    /// Look of the layer in a preview.
    pub look: Look,
    /// Its planes, in the order that an NPY gives them.
    pub channels: Vec<Channel>,
    /// Meaning of the numbers: `definition`, `unit`, `frame`, `miss` …
    pub meaning: Vec<HeaderEntry>,
}

impl Layer {
    /// The full name of one of its channels, `Depth.Z`; `R` for a layer without a name.
    #[must_use]
    pub fn full_name(&self, channel: &Channel) -> String {
        if self.name.is_empty() {
            channel.name.clone()
        } else {
            format!("{}.{}", self.name, channel.name)
        }
    }

    /// The full name of one of its channels in an EXR: the same, but for light in bands, whose channels
    /// are called as the layout of spectral images has it, `S0.552,5nm` (Fichet, Pacanowski and Wilkie, *An OpenEXR
    /// Layout for Spectral Images*, JCGT 10(3), 2021).
    #[must_use]
    pub fn exr_name(&self, channel: &Channel) -> String {
        let nm = channel.name.strip_suffix("nm").and_then(|nm| nm.replace('_', ".").parse().ok());
        match nm.filter(|_| self.name == SPECTRUM) {
            Some(nm) => emission_channel(nm),
            None => self.full_name(channel),
        }
    }

    /// The type of its channels, as numpy writes it.
    #[must_use]
    pub fn type_name(&self) -> &'static str {
        self.channels.first().map_or("", |channel| channel.values.type_name())
    }

    /// Title of the layer where it needs a name: the picture goes by its channels, `RGB`.
    #[must_use]
    pub fn title(&self) -> String {
        if self.name.is_empty() {
            self.channels.iter().map(|channel| channel.name.as_str()).collect()
        } else {
            self.name.clone()
        }
    }
}
