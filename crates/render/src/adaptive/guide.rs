//! Guide of pixels by what their chief rays meet, by which pixels are alike.
//!
//! The variance of a pixel's samples goes with what it shows: a plain wall, an edge, a ball of glass. Colour, normal and
//! distance of what its chief ray meets, and how much they change from pixel to pixel, tell which pixels may know each
//! other's variance (cross-bilateral weights: E. Eisemann and F. Durand, "Flash photography enhancement via intrinsic
//! relighting", 2004; gradients: F. Rousselle, M. Manzi and M. Zwicker, "Robust denoising using feature and color
//! information", 2013). They are the same whatever is sampled, so nothing of them bends a picture.

/// Differences of colour, of normals, and of the logarithm of distances at which pixels are half alike.
const SCALES: [f32; 3] = [0.1, 0.3, 0.2];

/// Numbers of a guide.
pub(super) const FEATURES: usize = 8;

/// Hit of a chief ray: base colour, geometric normal, and the logarithm of its distance; nothing for a miss.
pub(crate) type ChiefHit = [f32; 7];

/// Features that tell which pixels are alike: colour, normal, and the steps of colour, and of
/// normal or distance, to the pixels beside, each in units of what makes half a difference.
pub(super) type Guide = [f32; FEATURES];

/// The guides of the rows of a strip, of `width` columns.
pub(super) fn guides(hits: &[ChiefHit], width: usize) -> Vec<Guide> {
    let height = hits.len() / width.max(1);
    let at = |x: usize, y: usize| &hits[y * width + x];
    let guide = |index: usize| {
        let (x, y) = (index % width, index / width);
        let own = at(x, y);
        let neighbours = [
            (x > 0).then(|| at(x - 1, y)),
            (x + 1 < width).then(|| at(x + 1, y)),
            (y > 0).then(|| at(x, y - 1)),
            (y + 1 < height).then(|| at(x, y + 1)),
        ];
        // The largest step of each part.
        let mut steps = [0.0_f32; 3];
        for other in neighbours.into_iter().flatten() {
            for (step, part) in steps.iter_mut().zip([0..3, 3..6, 6..7]) {
                let squares = part.map(|k| (own[k] - other[k]).powi(2));
                *step = step.max(squares.sum::<f32>().sqrt());
            }
        }
        let [colour, normal, distance] = SCALES;
        std::array::from_fn(|k| match k {
            0..3 => own[k] / colour,
            3..6 => own[k] / normal,
            // Steps beyond a few scales are alike: an edge is an edge.
            6 => (steps[0] / colour).min(3.0),
            _ => (steps[1] / normal).max(steps[2] / distance).min(3.0),
        })
    };
    (0..hits.len()).map(guide).collect()
}

/// Likeness of two pixels, 1 at most.
#[inline]
pub(super) fn likeness(a: &Guide, b: &Guide) -> f32 {
    let square: f32 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    let near = 1.0 / (1.0 + square);
    near * near
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_are_like_edges_and_plains_like_plains() {
        // Four columns and two rows: black up to an edge in the middle, then white.
        let hits: Vec<ChiefHit> = (0..8).map(|k| [f32::from(u8::from(k % 4 > 1)); 7]).collect();
        let guides = guides(&hits, 4);
        let like = |a: usize, b: usize| likeness(&guides[a], &guides[b]);
        assert_eq!(like(0, 4), 1.0);
        assert_eq!(like(1, 5), 1.0);
        assert!(like(0, 1) < 0.01 && like(0, 3) < 0.01 && like(1, 2) < 0.01);
    }
}
