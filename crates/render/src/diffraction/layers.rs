//! Cells sorted by depth into layers over each of which the spread hardly changes.
//!
//! Layers are even in waves of defocus near focus, and in its logarithm farther away. Nearness is 1 over
//! the distance along the axis, in which defocus is linear.

use etendue_camera::LensCamera;

/// From so many waves of defocus on, layers are so much deeper as it is larger: a tenth of it at steps of 0.35 waves.
const LINEAR: f64 = 3.5;

/// The most layers in front of focus, and behind it, times the waves from one to the next: 60 at steps of 0.35 waves.
const MOST: f64 = 21.0;

/// Cells by their layers.
#[derive(Debug, Clone)]
pub(crate) struct DepthLayers {
    /// The layer of each cell, from the rearmost on.
    pub(crate) of_cell: Vec<u8>,
    /// The mean nearness (1/m) of each.
    pub(crate) nearness: Vec<f64>,
    /// Columns and rows that hold all cells of each: the first, and the one after the last.
    pub(crate) boxes: Vec<[[usize; 2]; 2]>,
    /// Waves of defocus for each 1/m.
    pub(crate) waves: f64,
}

impl DepthLayers {
    /// Sorts cells, rows of so many `columns`, by their depths (m, infinite where there is nothing), for a
    /// lens at a wavelength (nm), into layers a `step` of waves of defocus deep near focus.
    pub(crate) fn of(
        depths: &[f32],
        columns: usize,
        lens: &LensCamera,
        wavelength: f64,
        step: f64,
    ) -> Self {
        let waves = lens.waves_of_defocus(wavelength);
        let focus = lens.focused().object_distance();
        let focus = if focus.is_finite() && focus != 0.0 { 1.0 / focus } else { 0.0 };
        let near = |depth: f32| match depth > 0.0 && depth.is_finite() {
            true => 1.0 / f64::from(depth),
            false => 0.0,
        };
        let number = |depth: f32| number_of(waves * (near(depth) - focus), step);
        let mut sums = vec![(0.0, 0_u64); 2 * most_of(step) + 1];
        for &depth in depths {
            let (sum, count) = &mut sums[number(depth)];
            *sum += near(depth);
            *count += 1;
        }
        let mut own = vec![0_u8; sums.len()];
        let mut nearness = Vec::new();
        for ((sum, count), own) in sums.iter().zip(&mut own) {
            *own = u8::try_from(nearness.len()).unwrap_or(u8::MAX);
            if *count > 0 {
                nearness.push(sum / *count as f64);
            }
        }
        let of_cell: Vec<u8> = depths.iter().map(|&depth| own[number(depth)]).collect();
        let mut boxes = vec![[[usize::MAX; 2], [0; 2]]; nearness.len()];
        for (i, &layer) in of_cell.iter().enumerate() {
            let [low, high] = &mut boxes[usize::from(layer)];
            for (axis, at) in [i % columns, i / columns].into_iter().enumerate() {
                low[axis] = low[axis].min(at);
                high[axis] = high[axis].max(at + 1);
            }
        }
        Self { of_cell, nearness, boxes, waves }
    }

    /// The least and the greatest nearness of a layer (1/m).
    pub(crate) fn span(&self) -> [f64; 2] {
        let first = self.nearness.first().copied().unwrap_or(0.0);
        [first, self.nearness.last().copied().unwrap_or(first)]
    }
}

/// The most layers on one side of focus: numbers of all of them are to fit into a byte.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most 127")]
fn most_of(step: f64) -> usize {
    (MOST / step).round().clamp(1.0, 127.0) as usize
}

/// The layer of so many waves of defocus, counted from the rearmost that there may be, at so many waves a `step`.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most 254")]
fn number_of(waves: f64, step: f64) -> usize {
    let far = waves.abs();
    let steps = match far < LINEAR {
        true => far / step,
        false => LINEAR / step + (far / LINEAR).ln() * LINEAR / step,
    };
    let most = most_of(step) as f64;
    (most + steps.min(most).copysign(waves)).round() as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP: f64 = 0.35;

    #[test]
    fn layers_are_a_third_of_a_wave_or_a_tenth_of_the_defocus_deep() {
        let number_of = |waves| number_of(waves, STEP);
        assert_eq!(most_of(STEP), 60);
        assert_eq!([number_of(-1000.0), number_of(1000.0)], [0, 120]);
        let mut last = number_of(-100.0);
        let mut edges = Vec::new();
        for k in -100_000..=100_000 {
            let waves = f64::from(k) * 1e-3;
            let number = number_of(waves);
            assert!(number == last || number == last + 1, "{waves}");
            if number != last {
                edges.push(waves);
            }
            last = number;
        }
        // From one edge to the next; 2e-3 for the steps in which they are looked for.
        for pair in edges.windows(2) {
            let (deep, far) = (pair[1] - pair[0], pair[0].abs().min(pair[1].abs()));
            assert!(deep <= STEP.max(0.107 * far) + 2e-3, "{pair:?}");
        }
        assert_eq!(number_of(0.0), 60);
    }

    #[test]
    fn half_the_step_makes_twice_the_layers_over_the_same_defocus() {
        for waves in [-100.0, -3.0, 0.5, 2.0, 30.0, 400.0] {
            let from_focus = |step| number_of(waves, step) as f64 - most_of(step) as f64;
            // Both are rounded.
            assert!((from_focus(0.175) - 2.0 * from_focus(0.35)).abs() <= 1.5, "{waves}");
        }
        assert_eq!(2 * most_of(0.17) + 1, 249);
        assert_eq!(most_of(3.5), 6);
    }
}
