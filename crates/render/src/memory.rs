//! Memory of a picture's size, asked for before it is taken.

use etendue_report::Size;
use etendue_scene::memory::has_room;

/// The system has less memory than the pixels of a picture take.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "the system has too little memory for {} more of the picture\nhint: ask for fewer pixels, layers or bands",
    Size(*bytes)
)]
pub struct NoMemory {
    /// Size of the allocation that failed (bytes).
    pub bytes: u64,
}

/// Checks that there is memory for so many bytes now: for a library that would abort without.
pub(crate) fn check_room(bytes: usize) -> Result<(), NoMemory> {
    let bytes = bytes as u64;
    if has_room(bytes) { Ok(()) } else { Err(NoMemory { bytes }) }
}

/// `count` times `value`, where there is memory for it.
pub(crate) fn filled<T: Clone>(value: T, count: usize) -> Result<Vec<T>, NoMemory> {
    let mut values = Vec::new();
    let bytes = (count as u64).saturating_mul(size_of::<T>() as u64);
    values.try_reserve_exact(count).map_err(|_| NoMemory { bytes })?;
    values.resize(count, value);
    Ok(values)
}
