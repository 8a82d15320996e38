//! The exit pupil of the lens before an array of lenslets, over the array's plane: the extent of its outline
//! in 16 directions, at nodes.

use etendue_report::Refusal;
use glam::DVec2;

use super::{ExitPupil, NORMALS, OutlineNode, OutlineTable};
use crate::element::{Clip, LensRays, RayStatus};
use crate::train::aim::towards_lens;
use crate::train::{BehindLenslets, MonochromaticTrain, OpticalTrain, Side};

/// Directions from the middle of an outline in which it is found, more than are kept. Not a setting: what lies between
/// them is the margin's (`lenslet_margin`).
const ANGLES: u32 = 64;

/// Steps inwards of the search for outlines, and its halvings.
const STEPS: u32 = 12;
const HALVINGS: u32 = 6;

/// The outward normal of a direction in which extents are kept.
pub(super) fn normal(k: usize) -> DVec2 {
    NORMAL_TABLE[k]
}

/// cos and sin of multiples of 22.5°.
const NORMAL_TABLE: [DVec2; NORMALS] = {
    const C: f64 = 0.923_879_532_511_286_7;
    const S: f64 = 0.382_683_432_365_089_8;
    const R: f64 = std::f64::consts::FRAC_1_SQRT_2;
    [
        DVec2::new(1.0, 0.0),
        DVec2::new(C, S),
        DVec2::new(R, R),
        DVec2::new(S, C),
        DVec2::new(0.0, 1.0),
        DVec2::new(-S, C),
        DVec2::new(-R, R),
        DVec2::new(-C, S),
        DVec2::new(-1.0, 0.0),
        DVec2::new(-C, -S),
        DVec2::new(-R, -R),
        DVec2::new(-S, -C),
        DVec2::new(0.0, -1.0),
        DVec2::new(S, -C),
        DVec2::new(R, -R),
        DVec2::new(C, -S),
    ]
};

/// The corners of an outline (slopes), by its extent in each direction.
pub(super) fn outline(extent: impl Fn(usize) -> f64) -> [DVec2; NORMALS] {
    let sine = (std::f64::consts::TAU / NORMALS as f64).sin();
    std::array::from_fn(|k| {
        let next = (k + 1) % NORMALS;
        let (a, b) = (normal(k), normal(next));
        let (h, g) = (extent(k), extent(next));
        DVec2::new(h * b.y - g * a.y, g * a.x - h * b.x) / sine
    })
}

/// The middle of an outline, by its extents.
pub(super) fn centre_of(extent: &[f64; NORMALS]) -> DVec2 {
    0.5 * DVec2::new(extent[0] - extent[8], extent[4] - extent[12])
}

impl OutlineTable {
    pub(super) fn new(
        main: &OpticalTrain,
        view: &BehindLenslets,
        wavelengths: &[f64],
        pupil: &ExitPupil,
        drift: f64,
    ) -> Result<Self, Refusal> {
        let corners = [[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]];
        let mut half = DVec2::ZERO;
        for corner in corners {
            let film = pupil.film_point(DVec2::from(corner) * pupil.half_size);
            let sight = view.sight(0, film.z);
            // Straight towards the pupil's middle: slopes are `drift` times the height.
            let projected = film.truncate() / (1.0 - drift * sight.distance).max(0.1);
            half = half.max(film.truncate().abs()).max(projected.abs());
        }
        let half = half * 1.05 + DVec2::splat(4.0 * view.array.lattice.pitch);
        let lenses = wavelengths.iter().map(|&nm| main.at(nm)).collect::<Result<Vec<_>, _>>()?;
        let (accuracy, side) = (pupil.accuracy, half.to_array());
        let main = ExitPupil::within(accuracy, main, wavelengths, view.front_z, side)?;
        let across = accuracy.lenslet_nodes;
        let share = |i: u32| 2.0 * f64::from(i) / f64::from(across - 1) - 1.0;
        let at = |i: u32| DVec2::new(share(i % across), share(i / across)) * half;
        let exact = main.disk().is_some();
        let node = |i: u32| match exact {
            true => extent_of(&main.outline(at(i))),
            false => extent_of(&tight_outline(&main, &lenses, at(i))),
        };
        let with_centre = |extent| OutlineNode { extent, centre: centre_of(&extent) };
        let nodes = (0..across * across).map(|i| node(i).map(with_centre)).collect();
        Ok(Self { main, half, across, nodes })
    }

    /// The outline from a point of the array (mm); `None` in the dark.
    pub(super) fn at(&self, at: DVec2) -> Option<[f64; NORMALS]> {
        self.between(self.corners(at).as_ref(), at)
    }

    /// The same of a point whose [`corners`](Self::corners) are known.
    pub(super) fn between(
        &self,
        corners: Option<&NodeCorners<'_>>,
        at: DVec2,
    ) -> Option<[f64; NORMALS]> {
        let Some(corners) = corners else { return extent_of(&self.main.outline(at)) };
        let mut extent = [0.0; NORMALS];
        for (k, extent) in extent.iter_mut().enumerate() {
            *extent = corners.extent(k);
        }
        Some(extent)
    }

    /// The middle of that outline.
    pub(super) fn centre_at(&self, at: DVec2) -> Option<DVec2> {
        match self.corners(at) {
            Some(NodeCorners { nodes: [a, b, c, d], weights: [p, q, r, s] }) => {
                Some(a.centre * p + b.centre * q + c.centre * r + d.centre * s)
            }
            None => extent_of(&self.main.outline(at)).map(|extent| centre_of(&extent)),
        }
    }

    /// The nodes around a point of the array (mm) and their weights, where there is light at all of them.
    pub(super) fn corners(&self, at: DVec2) -> Option<NodeCorners<'_>> {
        let last = f64::from(self.across - 1);
        let place = (0.5 * (at / self.half + 1.0) * last).clamp(DVec2::ZERO, DVec2::splat(last));
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "between 0 and the number of nodes"
        )]
        let [column, row] = place.to_array().map(|at| (at as u32).min(self.across - 2));
        let (x, y) = (place.x - f64::from(column), place.y - f64::from(row));
        let first = (row * self.across + column) as usize;
        let next = first + self.across as usize;
        let node = |i: usize| self.nodes[i].as_ref();
        Some(NodeCorners {
            nodes: [node(first)?, node(first + 1)?, node(next)?, node(next + 1)?],
            weights: [(1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y],
        })
    }
}

/// Nodes around a point and their weights.
pub(super) struct NodeCorners<'a> {
    nodes: [&'a OutlineNode; 4],
    weights: [f64; 4],
}

impl NodeCorners<'_> {
    /// The extent in a direction.
    #[inline]
    pub(super) fn extent(&self, k: usize) -> f64 {
        let [a, b, c, d] = self.nodes;
        let [p, q, r, s] = self.weights;
        a.extent[k] * p + b.extent[k] * q + c.extent[k] * r + d.extent[k] * s
    }
}

/// The direction in which extents are kept that is next to that of a vector, of every other one.
pub(super) fn nearest_normal(vector: DVec2) -> usize {
    // tan 22.5°.
    const HALF: f64 = std::f64::consts::SQRT_2 - 1.0;
    let DVec2 { x, y } = vector;
    if y.abs() <= HALF * x.abs() {
        return if x > 0.0 { 0 } else { 8 };
    }
    if x.abs() <= HALF * y.abs() {
        return if y > 0.0 { 4 } else { 12 };
    }
    match (x > 0.0, y > 0.0) {
        (true, true) => 2,
        (false, true) => 6,
        (false, false) => 10,
        (true, false) => 14,
    }
}

fn extent_of(outline: &[DVec2]) -> Option<[f64; NORMALS]> {
    if outline.is_empty() {
        return None;
    }
    let extent = |k: usize| outline.iter().map(|m| normal(k).dot(*m)).fold(f64::MIN, f64::max);
    Some(std::array::from_fn(extent))
}

/// The outline of what passes from a point of the array (mm), nearer than the bound of `main`, which is
/// wider where it is joined from place to place.
fn tight_outline(main: &ExitPupil, lenses: &[MonochromaticTrain], at: DVec2) -> Vec<DVec2> {
    let bound = main.outline(at);
    if bound.is_empty() {
        return bound;
    }
    let centre = 0.5
        * (bound.iter().copied().reduce(DVec2::min).unwrap_or_default()
            + bound.iter().copied().reduce(DVec2::max).unwrap_or_default());
    let every = bound.len() / ANGLES as usize;
    let ends: Vec<DVec2> = bound.iter().step_by(every.max(1)).copied().collect();
    let film = main.film_point(at);
    let passes = |places: &[(usize, f64)]| -> Vec<bool> {
        let mut passed = vec![false; places.len()];
        for lens in lenses {
            let mut rays = LensRays::with_capacity(places.len());
            for &(i, share) in places {
                rays.push(film, towards_lens(centre + (ends[i] - centre) * share));
            }
            lens.trace(Side::Sensor, Clip::On, &mut rays);
            let exited = (0..rays.len()).map(|i| rays.status(i) == RayStatus::Exited);
            passed.iter_mut().zip(exited).for_each(|(any, one)| *any |= one);
        }
        passed
    };
    let step = 0.25 / f64::from(STEPS);
    let scan: Vec<(usize, f64)> = (0..ends.len())
        .flat_map(|i| (0..=STEPS).map(move |s| (i, 1.02 - step * f64::from(s))))
        .collect();
    // The outermost that passes, and what does not beyond it; the bound where none does.
    let mut found = vec![None; ends.len()];
    for (&(i, share), passed) in scan.iter().zip(passes(&scan)) {
        if passed && found[i].is_none() {
            found[i] = Some(share);
        }
    }
    let mut width = step;
    for _ in 0..HALVINGS {
        width *= 0.5;
        let middles: Vec<(usize, f64)> =
            (0..ends.len()).filter_map(|i| Some((i, found[i]? + width))).collect();
        for (&(i, share), passed) in middles.iter().zip(passes(&middles)) {
            if passed {
                found[i] = Some(share);
            }
        }
    }
    let reach = |i: usize| found[i].map_or(1.0, |share| share + width);
    (0..ends.len()).map(|i| centre + (ends[i] - centre) * reach(i)).collect()
}
