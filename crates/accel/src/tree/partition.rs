//! Refs moved to the sides of a split.

use rayon::prelude::*;

use super::bins::{BinGrid, Bins, Split};
use super::extent::RefBounds;
use super::{CHUNK, Ref};

/// One side of a split.
pub(super) struct SplitSide {
    pub(super) len: usize,
    pub(super) extent: RefBounds,
}

/// The first and the second half of `refs`, as they stand.
pub(super) fn halve(refs: &[Ref]) -> [SplitSide; 2] {
    let (a, b) = refs.split_at(refs.len() / 2);
    [a, b].map(|half| SplitSide { len: half.len(), extent: RefBounds::of(half) })
}

/// Brings the left refs to the front, in place.
pub(super) fn partition(
    refs: &mut [Ref],
    grid: &BinGrid,
    split: Split,
    bins: &Bins,
) -> [SplitSide; 2] {
    let mut len = 0;
    // Swaps whether it must or not: which side a ref goes to cannot be predicted.
    for i in 0..refs.len() {
        let is_left = grid.is_left(refs[i].corners(), split);
        refs.swap(len, i);
        len += usize::from(is_left);
    }
    let [mut left, mut right] = bins.sides(grid, split);
    let (left_refs, right_refs) = refs.split_at(len);
    left.include_centroids(left_refs);
    right.include_centroids(right_refs);
    [SplitSide { len, extent: left }, SplitSide { len: right_refs.len(), extent: right }]
}

/// As [`partition`], in parallel: every chunk is told where its left and right refs go.
pub(super) fn partition_wide(
    refs: &mut [Ref],
    spare: &mut [Ref],
    grid: &BinGrid,
    split: Split,
) -> [SplitSide; 2] {
    // How much of each chunk goes to which side.
    let chunks: Vec<[SplitSide; 2]> = refs
        .par_chunks(CHUNK)
        .map(|chunk| {
            let mut sides =
                [RefBounds::EMPTY, RefBounds::EMPTY].map(|extent| SplitSide { len: 0, extent });
            for r in chunk {
                let corners = r.corners();
                let side = &mut sides[usize::from(!grid.is_left(corners, split))];
                side.len += 1;
                side.extent.include(corners);
            }
            sides
        })
        .collect();
    let mut sides = [RefBounds::EMPTY, RefBounds::EMPTY].map(|extent| SplitSide { len: 0, extent });
    for chunk in &chunks {
        for (side, part) in sides.iter_mut().zip(chunk) {
            side.len += part.len;
            side.extent = side.extent.union(part.extent);
        }
    }
    // Each chunk has a part of both sides to itself.
    let (mut lefts, mut rights) = spare[..refs.len()].split_at_mut(sides[0].len);
    let mut targets = Vec::with_capacity(chunks.len());
    for [left, right] in &chunks {
        let (mine, rest) = lefts.split_at_mut(left.len);
        lefts = rest;
        let (mine_right, rest) = rights.split_at_mut(right.len);
        rights = rest;
        targets.push((mine, mine_right));
    }
    refs.par_chunks(CHUNK).zip(targets).for_each(|(chunk, (left, right))| {
        let (mut left, mut right) = (left.iter_mut(), right.iter_mut());
        for r in chunk {
            let side = if grid.is_left(r.corners(), split) { &mut left } else { &mut right };
            if let Some(place) = side.next() {
                *place = *r;
            }
        }
    });
    refs.par_chunks_mut(CHUNK).zip(spare.par_chunks(CHUNK)).for_each(|(to, from)| {
        to.copy_from_slice(&from[..to.len()]);
    });
    sides
}
