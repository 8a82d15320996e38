//! Buffer views compressed by meshoptimizer (`EXT_meshopt_compression`, and
//! `KHR_meshopt_compression`, which adds a second version of its vertex codec and a filter).
//!
//! meshoptimizer itself decodes, by way of crate `meshopt`; what goes in is checked here.

use gltf::json;
use serde::Deserialize;
use serde_json::Value;

use crate::Refusal;
use crate::file::read_value;

const NAMES: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// The most that a byte of a stream can become: of a block of 256 vertices, four bytes of each may
/// be told by one byte of control bits.
const MOST_GROWTH: usize = 1024;

/// Bytes that a stream may have beside its blocks: a header, and the first vertex.
const AROUND: usize = 512;

/// A compressed buffer view.
pub(super) struct MeshoptView<'a> {
    pub name: &'static str,
    written: &'a Value,
}

/// Place and content of the stream of a compressed view.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Stream {
    pub buffer: usize,
    #[serde(rename = "byteOffset", default)]
    pub start: usize,
    #[serde(rename = "byteLength")]
    pub len: usize,
    byte_stride: usize,
    count: usize,
    mode: CompressionMode,
    #[serde(default)]
    filter: MeshoptFilter,
}

#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "SCREAMING_SNAKE_CASE")]
enum CompressionMode {
    Attributes,
    Triangles,
    Indices,
}

#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(rename_all = "SCREAMING_SNAKE_CASE")]
enum MeshoptFilter {
    #[default]
    None,
    Octahedral,
    Quaternion,
    Exponential,
    Color,
}

impl<'a> MeshoptView<'a> {
    /// The compression of `view`; `None` for a plain one.
    pub(super) fn of(view: &'a json::buffer::View) -> Option<Self> {
        let extensions = &view.extensions.as_ref()?.others;
        NAMES.iter().find_map(|name| Some(Self { name, written: extensions.get(*name)? }))
    }

    /// The buffer that the stream is in, when it says one.
    pub(super) fn buffer(&self) -> Option<usize> {
        usize::try_from(self.written.get("buffer")?.as_u64()?).ok()
    }

    /// Description of the stream; an error, in words, when it makes no sense.
    pub(super) fn stream(&self) -> Result<Stream, String> {
        if !self.written.is_object() {
            return Err("expected an object\nhint: export the file again".to_owned());
        }
        let stream: Stream = read_value(self.written).map_err(|(place, why)| {
            Refusal::new(why).at(place).hint("export the file again").to_string()
        })?;
        stream.check()?;
        Ok(stream)
    }
}

impl Stream {
    /// Refuses strides and counts that the extension does not have, and streams that are too short
    /// for what they promise: memory is taken for that.
    fn check(&self) -> Result<(), String> {
        let (stride, count) = (self.byte_stride, self.count);
        let fits = match (self.mode, self.filter) {
            (CompressionMode::Attributes, MeshoptFilter::None | MeshoptFilter::Exponential) => {
                stride.is_multiple_of(4) && (4..=256).contains(&stride)
            }
            (CompressionMode::Attributes, MeshoptFilter::Octahedral | MeshoptFilter::Color) => {
                matches!(stride, 4 | 8)
            }
            (CompressionMode::Attributes, MeshoptFilter::Quaternion) => stride == 8,
            (CompressionMode::Triangles, MeshoptFilter::None) => {
                matches!(stride, 2 | 4) && count.is_multiple_of(3)
            }
            (CompressionMode::Indices, MeshoptFilter::None) => matches!(stride, 2 | 4),
            (CompressionMode::Triangles | CompressionMode::Indices, _) => false,
        };
        if !fits {
            return Err(format!(
                "{count} elements of {stride} bytes (mode {:?}, filter {:?}) are none that the \
                 extension has\nhint: export the file again",
                self.mode, self.filter
            ));
        }
        let most = self.len.saturating_mul(MOST_GROWTH).saturating_add(AROUND);
        match count.checked_mul(stride) {
            Some(bytes) if bytes <= most => Ok(()),
            _ => Err(format!(
                "{count} elements of {stride} bytes cannot come from {} bytes\nhint: export the file again",
                self.len
            )),
        }
    }

    /// The elements that `packed` holds.
    pub(super) fn decode(&self, packed: &[u8]) -> Result<Vec<u8>, String> {
        let broken = || "its stream is damaged\nhint: copy or export the file again".to_owned();
        let bytes = match (self.mode, self.byte_stride) {
            (CompressionMode::Attributes, stride) => attributes(packed, self.count, stride),
            (CompressionMode::Triangles, 2) => {
                meshopt::decode_index_buffer::<u16>(packed, self.count)
                    .ok()
                    .map(|values| to_bytes(&values))
            }
            (CompressionMode::Triangles, _) => {
                meshopt::decode_index_buffer::<u32>(packed, self.count)
                    .ok()
                    .map(|values| to_bytes(&values))
            }
            (CompressionMode::Indices, 2) => {
                meshopt::decode_index_sequence::<u16>(packed, self.count)
                    .ok()
                    .map(|values| to_bytes(&values))
            }
            (CompressionMode::Indices, _) => {
                meshopt::decode_index_sequence::<u32>(packed, self.count)
                    .ok()
                    .map(|values| to_bytes(&values))
            }
        };
        let mut bytes = bytes.ok_or_else(broken)?;
        self.undo_filter(&mut bytes);
        Ok(bytes)
    }

    fn undo_filter(&self, bytes: &mut [u8]) {
        match (self.filter, self.byte_stride) {
            (MeshoptFilter::None, _) => {}
            (MeshoptFilter::Octahedral, 4) => in_place::<i8, 4>(bytes, meshopt::decode_filter_oct),
            (MeshoptFilter::Octahedral, _) => in_place::<i16, 4>(bytes, meshopt::decode_filter_oct),
            (MeshoptFilter::Color, 4) => in_place::<u8, 4>(bytes, meshopt::decode_filter_color),
            (MeshoptFilter::Color, _) => in_place::<u16, 4>(bytes, meshopt::decode_filter_color),
            (MeshoptFilter::Quaternion, _) => {
                in_place::<i16, 4>(bytes, meshopt::decode_filter_quat);
            }
            (MeshoptFilter::Exponential, _) => {
                in_place::<u32, 1>(bytes, meshopt::decode_filter_exp);
            }
        }
    }
}

/// Runs `filter` over `bytes` as vectors of `N` numbers.
fn in_place<T: bytemuck::Pod, const N: usize>(bytes: &mut [u8], filter: impl Fn(&mut [[T; N]])) {
    let mut values: Vec<T> = bytemuck::pod_collect_to_vec(bytes);
    filter(values.as_chunks_mut::<N>().0);
    bytes.copy_from_slice(bytemuck::cast_slice(&values));
}

fn to_bytes<T: bytemuck::NoUninit>(values: &[T]) -> Vec<u8> {
    bytemuck::cast_slice(values).to_vec()
}

/// A vertex of `N` words: the decoder takes strides as types.
#[derive(Clone, Copy)]
struct Vertex<const N: usize>([u32; N]);

impl<const N: usize> Default for Vertex<N> {
    fn default() -> Self {
        Self([0; N])
    }
}

fn vertices<const N: usize>(packed: &[u8], count: usize) -> Option<Vec<u8>> {
    let vertices = meshopt::decode_vertex_buffer::<Vertex<N>>(packed, count).ok()?;
    let mut bytes = Vec::with_capacity(count * N * 4);
    vertices.iter().for_each(|Vertex(words)| bytes.extend_from_slice(bytemuck::cast_slice(words)));
    Some(bytes)
}

/// `count` vertices of `stride` bytes, 4 to 256 by 4.
fn attributes(packed: &[u8], count: usize, stride: usize) -> Option<Vec<u8>> {
    macro_rules! by_words {
        ($($words:literal)*) => {
            match stride / 4 {
                $($words => vertices::<$words>(packed, count),)*
                _ => None,
            }
        };
    }
    by_words!(
        1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32
        33 34 35 36 37 38 39 40 41 42 43 44 45 46 47 48 49 50 51 52 53 54 55 56 57 58 59 60 61 62
        63 64
    )
}
