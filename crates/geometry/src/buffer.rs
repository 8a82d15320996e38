//! Plain values owned by a `Vec` or by a mapped file, so that a mesh does not care which.

use std::fmt;
use std::ops::Deref;
use std::sync::Arc;

use bytemuck::AnyBitPattern;

use etendue_files::MappedFile;

/// A shared, immutable slice of plain values. Cloning shares the values; their address never
/// changes while a clone lives, so a C library may keep a pointer beside one.
#[derive(Clone)]
pub struct Buffer<T> {
    owner: Owner<T>,
}

#[derive(Clone)]
enum Owner<T> {
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
        Some(Self { owner: Owner::Mapped { file: Arc::clone(file), offset, len } })
    }

    /// Whether both are the same values in the same place.
    #[must_use]
    pub fn is_same(&self, other: &Self) -> bool {
        self.as_ptr() == other.as_ptr() && self.len() == other.len()
    }

    /// Whether the values are part of a mapped file.
    #[must_use]
    pub fn is_mapped(&self) -> bool {
        matches!(self.owner, Owner::Mapped { .. })
    }

    /// Bytes on this process' heap: 0 when mapped.
    #[must_use]
    pub fn heap_bytes(&self) -> usize {
        match &self.owner {
            Owner::Heap(values) => values.capacity() * size_of::<T>(),
            Owner::Mapped { .. } => 0,
        }
    }
}

impl<T: AnyBitPattern> Deref for Buffer<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        match &self.owner {
            Owner::Heap(values) => values,
            Owner::Mapped { file, offset, len } => {
                bytemuck::cast_slice(&file.bytes()[*offset..offset + len * size_of::<T>()])
            }
        }
    }
}

impl<T> From<Vec<T>> for Buffer<T> {
    fn from(values: Vec<T>) -> Self {
        Self { owner: Owner::Heap(Arc::new(values)) }
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
