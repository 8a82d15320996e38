//! Memory for a tree: on huge pages where there are any, because rays jump about in it and would
//! miss the processor's page tables more often than its caches.

use std::ops::Deref;

use memmap2::MmapMut;

use super::wide::Cell;

/// Cells that do not move any more.
#[derive(Debug, Default)]
pub(super) enum Arena {
    #[default]
    Empty,
    /// Mapped memory, which begins on a page.
    Mapped(MmapMut),
    /// Where mapping failed.
    Heap(Vec<Cell>),
}

impl Arena {
    /// `len` cells of zeros, which `fill` sets.
    pub(super) fn new(len: usize, fill: impl FnOnce(&mut [Cell])) -> Self {
        if len == 0 {
            return Self::Empty;
        }
        match MmapMut::map_anon(len * size_of::<Cell>()) {
            Ok(mut map) => {
                // Only a wish: without huge pages the same memory works.
                #[cfg(target_os = "linux")]
                let _ = map.advise(memmap2::Advice::HugePage);
                fill(bytemuck::cast_slice_mut(&mut map));
                Self::Mapped(map)
            }
            Err(_) => {
                let mut cells = vec![Cell([0.0; 8]); len];
                fill(&mut cells);
                Self::Heap(cells)
            }
        }
    }
}

impl Deref for Arena {
    type Target = [Cell];

    #[inline]
    fn deref(&self) -> &[Cell] {
        match self {
            Self::Empty => &[],
            Self::Mapped(map) => bytemuck::cast_slice(map),
            Self::Heap(cells) => cells,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_begins_as_zeros_and_keeps_what_is_written() {
        let arena = Arena::new(1000, |cells| {
            assert!(cells.iter().all(|cell| cell.0 == [0.0; 8]));
            cells[999].0[7] = 1.0;
        });
        assert_eq!((arena.len(), arena[999].0[7]), (1000, 1.0));
        assert!(Arena::new(0, |_| ()).is_empty());
    }
}
