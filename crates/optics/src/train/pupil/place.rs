//! Interpolation between the nodes of a measured pupil: the place of a sensor point among them, and
//! values there.

use glam::DVec2;

use super::{ANGLES, ExitPupil, NodeLayout};

impl ExitPupil {
    pub(super) fn place(&self, film: DVec2) -> Option<NodePlace> {
        match self.layout {
            _ if self.nodes.is_empty() => None,
            NodeLayout::Radial => self.radial_place(film),
            NodeLayout::Planar => self.planar_place(film),
        }
    }

    fn radial_place(&self, film: DVec2) -> Option<NodePlace> {
        let r = film.length();
        let intervals = self.nodes.len() - 1;
        #[expect(clippy::cast_precision_loss, reason = "a few dozen nodes")]
        let at = if self.radius > 0.0 { r / self.radius * intervals as f64 } else { 0.0 };
        let (low, share) = split(at, intervals)?;
        let axis = if r > 0.0 { film / r } else { DVec2::X };
        let nodes = [(low, 1.0 - share), (low + 1, share), (low, 0.0), (low, 0.0)];
        Some(NodePlace { axis, nodes })
    }

    fn planar_place(&self, film: DVec2) -> Option<NodePlace> {
        let intervals = self.accuracy.planar_intervals;
        let count = intervals as usize;
        let along = |x: f64, half: f64| {
            let share = if half > 0.0 { 0.5 * (x / half + 1.0) } else { 0.0 };
            split(share * f64::from(intervals), count)
        };
        let (column, right) = along(film.x, self.half_size.x)?;
        let (row, down) = along(film.y, self.half_size.y)?;
        let node = |c: usize, r: usize| (row + r) * (count + 1) + column + c;
        let nodes = [
            (node(0, 0), (1.0 - right) * (1.0 - down)),
            (node(1, 0), right * (1.0 - down)),
            (node(0, 1), (1.0 - right) * down),
            (node(1, 1), right * down),
        ];
        Some(NodePlace { axis: DVec2::X, nodes })
    }
}

/// Nodes around a point of the sensor with their weights, and the turn of the point against them.
pub(super) struct NodePlace {
    /// The direction on the sensor that is the nodes' +x.
    pub(super) axis: DVec2,
    pub(super) nodes: [(usize, f64); 4],
}

impl NodePlace {
    pub(super) fn turned(&self, slopes: DVec2) -> DVec2 {
        self.axis.rotate(slopes)
    }
}

/// The interval that holds `at`, and the share of it that is passed; `None` beyond the last.
fn split(at: f64, intervals: usize) -> Option<(usize, f64)> {
    #[expect(clippy::cast_precision_loss, reason = "a few dozen nodes")]
    let last = intervals as f64;
    if !is_among(at, last) {
        return None;
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 0 and a few dozen"
    )]
    let low = (at.max(0.0) as usize).min(intervals.saturating_sub(1));
    #[expect(clippy::cast_precision_loss, reason = "a few dozen nodes")]
    let share = (at - low as f64).clamp(0.0, 1.0);
    Some((low, share))
}

/// True if a place is not beyond the last of intervals; points on the very rim may be rounded past it.
#[inline(always)]
pub(super) fn is_among(at: f64, last: f64) -> bool {
    (at >= -1e-9) & (at <= last * (1.0 + 1e-9) + 1e-9)
}

#[expect(clippy::cast_precision_loss, reason = "at most 256 angles")]
pub(super) fn turn_of(i: usize) -> f64 {
    i as f64 / ANGLES as f64
}

/// A place between two angles of a table.
#[derive(Debug, Clone, Copy)]
pub(super) struct TableAngle {
    /// The angle below.
    low: usize,
    /// The share of the way to the next.
    share: f64,
}

impl TableAngle {
    pub(super) const FIRST: Self = Self { low: 0, share: 0.0 };
}

/// The place in a table of a share of a full turn, 0..=1.
#[inline(always)]
pub(super) fn angle_below(turn: f64) -> TableAngle {
    #[expect(clippy::cast_precision_loss, reason = "128 angles")]
    let at = turn * ANGLES as f64;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a turn is in 0..=1"
    )]
    let low = (at as usize).min(ANGLES - 1);
    #[expect(clippy::cast_precision_loss, reason = "128 angles")]
    let share = at - low as f64;
    TableAngle { low, share }
}

/// The table's value at an angle.
#[inline(always)]
pub(super) fn between(table: &[f64; ANGLES + 1], TableAngle { low, share }: TableAngle) -> f64 {
    table[low] + (table[low + 1] - table[low]) * share
}
