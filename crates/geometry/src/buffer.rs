//! Shared numbers of meshes, owned by a `Vec` or by a mapped file: plain slices, and vertices that may be interleaved with
//! others.

use std::fmt;
use std::ops::Deref;
use std::sync::Arc;

use bytemuck::AnyBitPattern;
use etendue_files::MappedFile;

/// A shared, immutable slice of plain values. Cloning shares the values; their address never
/// changes while a clone lives, so a C library may keep a pointer beside one.
#[derive(Clone)]
pub struct Buffer<T> {
    owner: Storage<T>,
}

#[derive(Clone)]
enum Storage<T> {
    Heap(Arc<Vec<T>>),
    Mapped { file: Arc<MappedFile>, offset: usize, len: usize },
}

impl<T: AnyBitPattern> Buffer<T> {
    /// `len` values that start at byte `offset` of `file`, without a copy.
    ///
    /// `None` when they do not lie inside the file or are not aligned for `T`.
    #[must_use]
    pub fn from_file(file: &Arc<MappedFile>, offset: usize, len: usize) -> Option<Self> {
        let bytes = len.checked_mul(size_of::<T>())?;
        let slice = file.bytes().get(offset..offset.checked_add(bytes)?)?;
        bytemuck::try_cast_slice::<u8, T>(slice).ok()?;
        Some(Self { owner: Storage::Mapped { file: Arc::clone(file), offset, len } })
    }

    /// True if both are the same values in the same place.
    #[must_use]
    pub fn is_same(&self, other: &Self) -> bool {
        self.as_ptr() == other.as_ptr() && self.len() == other.len()
    }

    /// True if the values are part of a mapped file.
    #[must_use]
    pub fn is_mapped(&self) -> bool {
        matches!(self.owner, Storage::Mapped { .. })
    }

    /// Bytes on this process' heap: 0 when mapped.
    #[must_use]
    pub fn heap_bytes(&self) -> usize {
        match &self.owner {
            Storage::Heap(values) => values.capacity() * size_of::<T>(),
            Storage::Mapped { .. } => 0,
        }
    }
}

impl<T: AnyBitPattern> Deref for Buffer<T> {
    type Target = [T];

    #[inline]
    fn deref(&self) -> &[T] {
        match &self.owner {
            Storage::Heap(values) => values,
            Storage::Mapped { file, offset, len } => {
                bytemuck::cast_slice(&file.bytes()[*offset..offset + len * size_of::<T>()])
            }
        }
    }
}

impl<T> From<Vec<T>> for Buffer<T> {
    fn from(values: Vec<T>) -> Self {
        Self { owner: Storage::Heap(Arc::new(values)) }
    }
}

impl<T: AnyBitPattern> fmt::Debug for Buffer<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Buffer")
            .field("len", &self.len())
            .field("mapped", &self.is_mapped())
            .finish()
    }
}

/// `N` f32 values a vertex, possibly interleaved with others.
#[derive(Debug, Clone)]
pub struct Vertices<const N: usize> {
    floats: Buffer<f32>,
    stride: usize,
    count: usize,
}

impl<const N: usize> Vertices<N> {
    /// `count` vertices that start `stride` floats apart.
    ///
    /// `None` when `floats` is too short for them or `stride` is less than `N`.
    #[must_use]
    pub fn new(floats: Buffer<f32>, stride: usize, count: usize) -> Option<Self> {
        let needed = match count {
            0 => 0,
            _ => (count - 1).checked_mul(stride)?.checked_add(N)?,
        };
        (stride >= N && floats.len() >= needed).then_some(Self { floats, stride, count })
    }

    /// From one array a vertex, tightly packed, with 16 bytes of padding behind the last
    /// (see [`Self::is_padded`]).
    #[must_use]
    pub fn from_arrays(values: &[[f32; N]]) -> Self {
        let mut floats = Vec::with_capacity(values.len() * N + 4);
        floats.extend(values.iter().flatten());
        floats.extend([0.0; 4]);
        Self { floats: floats.into(), stride: N, count: values.len() }
    }

    /// The number of vertices.
    #[must_use]
    pub fn len(&self) -> usize {
        self.count
    }

    /// True if there are no vertices.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The values of vertex `i`.
    #[must_use]
    #[inline]
    #[expect(
        clippy::manual_memcpy,
        reason = "a copy between slices is a call, where instructions differ"
    )]
    pub fn get(&self, i: usize) -> [f32; N] {
        let (floats, start) = (&*self.floats, i * self.stride);
        let (mut own, floats) = ([0.0; N], &floats[start..start + N]);
        for k in 0..N {
            own[k] = floats[k];
        }
        own
    }

    /// True if both are the same values in the same place.
    #[must_use]
    pub fn is_same(&self, other: &Self) -> bool {
        self.floats.is_same(&other.floats)
            && (self.stride, self.count) == (other.stride, other.count)
    }

    /// The values behind the vertices, for a reader that keeps its own loop.
    #[must_use]
    pub fn floats(&self) -> &Buffer<f32> {
        &self.floats
    }

    /// Floats from one vertex to the next.
    #[must_use]
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// True if 16 bytes can be read at the last vertex, as Embree does.
    #[must_use]
    pub fn is_padded(&self) -> bool {
        self.count == 0 || self.floats.len() >= (self.count - 1) * self.stride + 4
    }
}
