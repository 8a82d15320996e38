//! Choice of precision: whether f32 is enough for coordinates that a file gives in more digits.

use rayon::prelude::*;

use etendue_geometry::glam::DVec3;
use etendue_geometry::{Bounds, Positions, Vertices};

/// Rounding to f32 may move a vertex by this fraction of the mesh's diagonal; farther, and the
/// mesh keeps f64. Not a setting: it is what f32 rounds the corners of a mesh by that stands at the origin.
const MOST_ROUNDING: f64 = 1e-7;

/// `positions` in f32, or in f64 where rounding would move one too far.
pub(super) fn precise_enough(positions: &[[f64; 3]]) -> Positions {
    let finite = |p: &&[f64; 3]| p.iter().all(|x| x.is_finite());
    let of_chunk = |chunk: &[[f64; 3]]| {
        let mut bounds = Bounds::EMPTY;
        chunk.iter().filter(finite).for_each(|&p| bounds.include(p.into()));
        bounds
    };
    let bounds =
        positions.par_chunks(1 << 14).map(of_chunk).reduce(|| Bounds::EMPTY, Bounds::union);
    let most = MOST_ROUNDING * bounds.diagonal();
    let moved = |p: &[f64; 3]| {
        let rounded = p.map(|x| f64::from(single(x)));
        DVec3::from(rounded).distance(DVec3::from(*p))
    };
    if positions.par_iter().filter(finite).any(|p| moved(p) > most) {
        return Positions::F64(positions.to_vec().into());
    }
    let mut floats = vec![0.0; positions.len() * 3 + 4];
    floats.par_chunks_exact_mut(3).zip(positions).for_each(|(to, from)| {
        to.copy_from_slice(&from.map(single));
    });
    match Vertices::new(floats.into(), 3, positions.len()) {
        Some(vertices) => Positions::F32(vertices),
        None => Positions::F64(positions.to_vec().into()),
    }
}

/// Rounded to f32; infinite where it is too large.
#[expect(clippy::cast_possible_truncation, reason = "rounding is what it is for")]
pub(super) fn single(value: f64) -> f32 {
    value as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn far_from_the_origin_f64_is_kept() {
        let square = |at: f64| {
            vec![[at + 0.1, 0.0, 0.0], [at + 1.1, 0.0, 0.0], [at + 0.1, 1.3, 0.0], [f64::NAN; 3]]
        };
        assert!(matches!(precise_enough(&square(0.0)), Positions::F32(_)));
        assert!(matches!(precise_enough(&square(1e6)), Positions::F64(_)));
        // Whole numbers are exact however far.
        let far = vec![[1e6, 0.0, 0.0], [1e6 + 1.0, 0.0, 0.0], [1e6, 1.0, 0.0]];
        assert!(matches!(precise_enough(&far), Positions::F32(_)));
    }
}
