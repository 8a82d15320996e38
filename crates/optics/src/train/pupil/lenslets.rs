//! The pupil of a sensor behind lenslets: each place looks through its own lenslet at the lens before the
//! array, and through its neighbours where their images overlap.
//!
//! The exit pupil of the lens before the array is measured on the array's plane as that of any lens is,
//! and kept at nodes over it by the extent of its outline in 16 directions. To first order (see
//! [`lenslets`](crate::train::lenslets)) what passes the lens before, from p by the lenslet of centre c, is
//! the outline scaled into the array's plane; what passes the lenslet is its opening there. A ray is aimed
//! at a point of what both have in common, evenly over all lenslets of which that is not empty.
//!
//! # No bias
//!
//! Regions of different lenslets do not overlap, and the outline is wider by a margin than what was
//! measured. When the pupil is made, random rays look for what passes outside of all regions, and the
//! margin grows until there are none. Points of a region that lie in another cell, as beside circles, are
//! lost.

use glam::{DVec2, DVec3};

use super::{ExitPupil, ExitPupilError, without_filters};
use crate::element::{Clip, Gaps, Grid, LensRays, LensletShape, RayStatus, clipped};
use crate::train::aim::towards_lens;
use crate::train::lenslets::Sight;
use crate::train::{BehindLenslets, MonochromaticTrain, OpticalTrain, Side};

/// Directions in which the outline's extent is kept.
const NORMALS: usize = 16;

/// Nodes over each side of the array.
const NODES: u32 = 17;

/// Directions from the middle of an outline in which it is found.
const ANGLES: u32 = 64;

/// How outlines are found: steps inwards, and halvings.
const STEPS: u32 = 12;
const HALVINGS: u32 = 6;

/// Added to the outline on all sides, as a share of its width, to begin with.
const MARGIN: f64 = 0.002;

/// By how much the margin grows, and how often at most.
const GROWTH: f64 = 1.6;
const ROUNDS: u32 = 10;

/// Random rays of a round of the check.
const CHECKS: u32 = 1 << 14;

/// The light that reaches a sensor through an array of lenslets.
#[derive(Debug, Clone)]
pub struct LensletPupil {
    view: BehindLenslets,
    table: Table,
    /// The opening of a lenslet around its centre, in the array's axes (mm).
    opening: Vec<DVec2>,
    /// The same of the other arrays, by kind and array.
    others: Vec<Vec<DVec2>>,
    /// Its area (mm²), and the radius of the circle around it (mm).
    area: f64,
    around: f64,
    /// How the slopes towards the pupil change over the array (1/mm).
    drift: f64,
    margin: f64,
}

/// What is aimed at of one lenslet, or of what is between them.
#[derive(Debug, Clone)]
enum Region {
    /// All of an opening that is a polygon.
    Whole { centre: DVec2, area: f64, cell: Option<[f64; 2]>, checked: bool },
    /// A polygon.
    Polygon { cell: Option<[f64; 2]>, corners: Vec<DVec2>, area: f64, checked: bool },
    /// All of a round opening.
    Disk { centre: DVec2, radius: f64 },
}

impl Region {
    fn polygon(cell: Option<[f64; 2]>, corners: Vec<DVec2>, checked: bool) -> Option<Self> {
        let area = area_of(&corners);
        (area > 0.0).then_some(Self::Polygon { cell, corners, area, checked })
    }

    fn area(&self) -> f64 {
        match self {
            Self::Polygon { area, .. } | Self::Whole { area, .. } => *area,
            Self::Disk { radius, .. } => std::f64::consts::PI * radius * radius,
        }
    }

    /// A point for a place in the unit square, even in area.
    fn draw(&self, [u, v]: [f64; 2], opening: &[DVec2]) -> DVec2 {
        match self {
            Self::Whole { centre, area, .. } => *centre + in_polygon(opening, *area, [u, v]),
            Self::Disk { centre, radius } => {
                let [x, y] = etendue_geometry::disk::point([u, v]);
                *centre + DVec2::new(x, y) * *radius
            }
            Self::Polygon { corners, area, .. } => in_polygon(corners, *area, [u, v]),
        }
    }
}

/// A point of a convex polygon for a place in the unit square, even in area.
fn in_polygon(corners: &[DVec2], area: f64, [u, v]: [f64; 2]) -> DVec2 {
    if let [a, b, c, d] = *corners
        && (a + c - b - d).length_squared() < 1e-18 * area
    {
        return a + (b - a) * u + (d - a) * v;
    }
    // A fan of triangles around the first corner.
    let mut left = u * 2.0 * area;
    let last = corners.len() - 2;
    for k in 1..=last {
        let (b, c) = (corners[k] - corners[0], corners[k + 1] - corners[0]);
        let twice = b.perp_dot(c);
        if left <= twice || k == last {
            let share = (left / twice).clamp(0.0, 1.0);
            let root = v.sqrt();
            return corners[0] + (b + (c - b) * share) * root;
        }
        left -= twice;
    }
    corners[0]
}

fn area_of(corners: &[DVec2]) -> f64 {
    let Some(&first) = corners.first() else { return 0.0 };
    let pairs = corners.windows(2).skip(1);
    0.5 * pairs.map(|pair| (pair[0] - first).perp_dot(pair[1] - first)).sum::<f64>()
}

impl LensletPupil {
    /// Measures it for a sensor of half width and half height `half_size` (mm) at all of `lenses`.
    pub(super) fn new(
        train: &OpticalTrain,
        view: BehindLenslets,
        wavelengths: &[f64],
        pupil: &ExitPupil,
    ) -> Result<Self, ExitPupilError> {
        let array = &view.array;
        let turned = |corners: Vec<[f64; 2]>| -> Vec<DVec2> {
            corners.into_iter().map(|p| DVec2::from(array.lattice.turned(p))).collect()
        };
        let opening = turned(array.opening_corners());
        let around = opening.iter().map(|p| p.length()).fold(0.0, f64::max);
        let others = view
            .openings(0, pupil.sensor.vertex.z)
            .map(|(_, other)| turned(other.opening_corners()))
            .collect();
        let main = super::without_masks(&without_filters(&view.main));
        let drift = match view.exit_pupil_z() {
            Some(z) if (view.front_z - z).abs() > 1e-9 => -1.0 / (view.front_z - z),
            _ => 0.0,
        };
        let table = Table::new(&main, &view, wavelengths, pupil, drift)?;
        let lenses = wavelengths.iter().map(|&nm| train.at(nm)).collect::<Result<Vec<_>, _>>()?;
        let area = area_of(&opening);
        let mut own = Self { view, table, opening, others, area, around, drift, margin: MARGIN };
        own.widen_until_tight(&lenses, pupil)?;
        Ok(own)
    }

    /// Slopes for a place in the unit square as seen from a point of the sensor (mm), and the area of
    /// slopes that they stand for; `None` where no light arrives, and for points of a region that are
    /// not its own.
    pub(super) fn draw(&self, film: DVec3, [u, v]: [f64; 2]) -> Option<(DVec2, f64)> {
        let sight = self.view.sight(0, film.z);
        let regions = self.regions(film, &sight);
        let total: f64 = regions.iter().map(Region::area).sum();
        let mut left = u * total;
        let last = regions.len().checked_sub(1)?;
        for (i, region) in regions.iter().enumerate() {
            let area = region.area();
            if left <= area || i == last {
                let at = region.draw([(left / area).clamp(0.0, 1.0), v], &self.opening);
                if !self.owns(region, at) {
                    return None;
                }
                let (slopes, area) = self.view.aim(film, at);
                return Some((slopes, total * area));
            }
            left -= area;
        }
        None
    }

    /// Whether a point of a region belongs to it.
    fn owns(&self, region: &Region, at: DVec2) -> bool {
        let (Region::Polygon { cell, checked: true, .. }
        | Region::Whole { cell, checked: true, .. }) = region
        else {
            return true;
        };
        let local = at - self.view.decentre;
        let found = self.view.array.lattice.cell(local.x, local.y);
        match cell {
            Some(cell) => found.index == *cell,
            None => !self.view.array.is_open(found.local),
        }
    }

    /// Whether a point of the array is aimed at from a point of the sensor (mm).
    fn aims_at(&self, film: DVec3, at: DVec2) -> bool {
        let sight = self.view.sight(0, film.z);
        self.regions(film, &sight).iter().any(|region| match region {
            Region::Disk { centre, radius } => at.distance(*centre) <= *radius,
            Region::Whole { cell, .. } => {
                let local = at - self.view.decentre;
                let found = self.view.array.lattice.cell(local.x, local.y);
                Some(found.index) == *cell && self.view.array.is_open(found.local)
            }
            Region::Polygon { corners, .. } => {
                let side = |k: usize| {
                    let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
                    (b - a).perp_dot(at - a) >= -1e-12
                };
                (0..corners.len()).all(side) && self.owns(region, at)
            }
        })
    }

    /// Where the chief ray of the lens before crosses the array on its way to a point of the sensor (mm),
    /// were it not bent, and how far from there lenslets may matter.
    fn middle(&self, film: DVec3, sight: &Sight) -> Option<(DVec2, f64)> {
        let [slope, _] = sight.central(self.view.principal_distance(0));
        let start = film.truncate();
        let mut at = start;
        let mut extent = self.table.at(at)?;
        for _ in 0..4 {
            at = start + centre_of(&extent) / slope;
            extent = self.table.at(at)?;
        }
        let widest = self.widest(&extent) * (1.0 + 2.0 * self.margin);
        let kappa = (sight.slope[0] - self.drift * sight.height[0]).abs();
        let sigma = (sight.slope[1] - self.drift * sight.height[1] - self.drift).abs();
        Some((at, (widest + kappa * self.around) / sigma + 1e-9))
    }

    #[expect(clippy::unused_self, reason = "belongs to the table's normals")]
    fn widest(&self, extent: &[f64; NORMALS]) -> f64 {
        let centre = centre_of(extent);
        let reach = |k: usize| extent[k] - normal(k).dot(centre);
        (0..NORMALS).map(reach).fold(0.0, f64::max) / (std::f64::consts::PI / NORMALS as f64).cos()
    }

    fn regions(&self, film: DVec3, sight: &Sight) -> Vec<Region> {
        let mut regions = Vec::new();
        let Some((middle, reach)) = self.middle(film, sight) else { return regions };
        let array = &self.view.array;
        let local = middle - self.view.decentre;
        for cell in array.lattice.cells_near(local.to_array(), reach) {
            let kind = array.type_at(cell);
            let own;
            let sight = if kind == 0 {
                sight
            } else {
                own = self.view.sight(kind, film.z);
                &own
            };
            regions.extend(self.region(film, cell, kind, sight));
        }
        if array.gaps == Gaps::Clear
            && (array.shape == LensletShape::Round
                || array.reach < 0.5 * array.lattice.pitch
                || self.mixed())
        {
            regions.extend(self.gap(film, middle));
        }
        regions
    }

    /// Whether openings are of another shape than cells.
    fn mixed(&self) -> bool {
        !matches!(
            (self.view.array.lattice.grid, self.view.array.shape),
            (Grid::Square, LensletShape::Square) | (Grid::Hexagonal, LensletShape::Hexagonal)
        )
    }

    /// What is aimed at through a lenslet.
    fn region(&self, film: DVec3, cell: [f64; 2], kind: usize, sight: &Sight) -> Option<Region> {
        let array = &self.view.array;
        let centre = self.view.centre(cell);
        let outside = (centre - self.view.decentre).abs() - DVec2::from(array.half_size);
        if outside.max_element() > self.around {
            return None;
        }
        let extent = self.table.at(centre)?;
        let away = centre - film.truncate();
        let kappa = sight.slope[0] - self.drift * sight.height[0];
        let shift = away * (sight.slope[1] - self.drift * sight.height[1]);
        let reach = kappa.abs() * self.around;
        let mut cut = false;
        for k in 0..NORMALS {
            let here = normal(k).dot(shift);
            let limit = self.limit(&extent, k);
            if here - reach > limit {
                return None;
            }
            cut |= here + reach > limit;
        }
        let round = array.shape == LensletShape::Round;
        let checked = array.shape == LensletShape::Round || self.mixed();
        if !cut && self.others.is_empty() {
            if round {
                return Some(Region::Disk { centre, radius: array.reach });
            }
            let area = self.area;
            return Some(Region::Whole { centre, area, cell: Some(cell), checked });
        }
        let mut corners: Vec<[f64; 2]> = self.opening.iter().map(|p| p.to_array()).collect();
        if cut {
            let seen = self.outline(&extent).map(|m| ((m - shift) / kappa).to_array());
            corners = clipped(&corners, &seen);
        }
        for (([ya, yd], _), opening) in self.view.openings(kind, film.z).zip(&self.others) {
            if ya.abs() > 1e-9 {
                let wide = 1.0 + 2.0 * self.margin;
                let seen = opening.iter().map(|o| ((*o * wide - away * yd) / ya).to_array());
                let seen: Vec<[f64; 2]> = seen.collect();
                corners = clipped(&corners, &seen);
            }
        }
        let corners = corners.into_iter().map(|p| centre + DVec2::from(p)).collect();
        Region::polygon(Some(cell), corners, checked || array.gaps == Gaps::Clear)
    }

    /// What is aimed at between lenslets.
    fn gap(&self, film: DVec3, middle: DVec2) -> Option<Region> {
        let extent = self.table.at(middle)?;
        let sight = self.view.sight_past(film.z);
        let kappa = sight.slope[0] - self.drift * sight.height[0];
        let shift = (middle - film.truncate()) * (sight.slope[1] - self.drift * sight.height[1]);
        let corners = self.outline(&extent).map(|m| middle + (m - shift) / kappa);
        Region::polygon(None, corners.to_vec(), true)
    }

    /// The extent of the outline in a direction, with its margin.
    fn limit(&self, extent: &[f64; NORMALS], k: usize) -> f64 {
        extent[k] + self.margin * (extent[k] + extent[(k + NORMALS / 2) % NORMALS])
    }

    /// The corners of the outline with its margin, in slopes.
    fn outline(&self, extent: &[f64; NORMALS]) -> [DVec2; NORMALS] {
        let sine = (std::f64::consts::TAU / NORMALS as f64).sin();
        std::array::from_fn(|k| {
            let next = (k + 1) % NORMALS;
            let (a, b) = (normal(k), normal(next));
            let (h, g) = (self.limit(extent, k), self.limit(extent, next));
            DVec2::new(h * b.y - g * a.y, g * a.x - h * b.x) / sine
        })
    }

    /// Looks for rays that pass and are not aimed at, and widens the margin until there are none.
    fn widen_until_tight(
        &mut self,
        lenses: &[MonochromaticTrain],
        pupil: &ExitPupil,
    ) -> Result<(), ExitPupilError> {
        for round in 0..ROUNDS {
            let (mut passed, mut strays) = (0, 0);
            for lens in lenses {
                let found = self.strays(lens, pupil, round * CHECKS);
                passed += found[0];
                strays += found[1];
            }
            if round == 0 && passed == 0 {
                return Err(ExitPupilError::Array { element: self.view.rear });
            }
            // One in a thousand of what passes is less than what other approximations leave.
            if strays * 2000 <= passed {
                return Ok(());
            }
            self.margin *= GROWTH;
        }
        Ok(())
    }

    /// How many of random rays around what is aimed at pass, and how many of these are not aimed at.
    fn strays(&self, lens: &MonochromaticTrain, pupil: &ExitPupil, first: u32) -> [u32; 2] {
        let mut rays = LensRays::with_capacity(CHECKS as usize);
        let mut aims = Vec::with_capacity(CHECKS as usize);
        for i in first..first + CHECKS {
            let u = super::measure::ROBERTS.map(|alpha| (0.5 + alpha * f64::from(i)).fract());
            let place = (2.0 * DVec2::new(u[0], u[3]) - 1.0) * pupil.half_size;
            let film = pupil.film_point(place);
            let sight = self.view.sight(0, film.z);
            let Some((middle, reach)) = self.middle(film, &sight) else { continue };
            let radius = 1.2 * (reach + self.around) * u[2].sqrt();
            let at = middle + DVec2::from_angle(u[1] * std::f64::consts::TAU) * radius;
            rays.push(film, towards_lens(self.view.aim(film, at).0));
            aims.push((film, at));
        }
        lens.trace(Side::Sensor, Clip::On, &mut rays);
        let (mut passed, mut strays) = (0, 0);
        for (i, (film, at)) in aims.into_iter().enumerate() {
            if rays.fate(i) == RayStatus::Exited {
                passed += 1;
                strays += u32::from(!self.aims_at(film, at));
            }
        }
        [passed, strays]
    }
}

/// The outward normal of a direction in which extents are kept.
fn normal(k: usize) -> DVec2 {
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

/// The middle of an outline, by its extents.
fn centre_of(extent: &[f64; NORMALS]) -> DVec2 {
    0.5 * DVec2::new(extent[0] - extent[8], extent[4] - extent[12])
}

/// The exit pupil of the lens before, over the plane of the array: extents of its outline in slopes.
#[derive(Debug, Clone)]
struct Table {
    main: ExitPupil,
    half: DVec2,
    nodes: Vec<Option<[f64; NORMALS]>>,
}

impl Table {
    fn new(
        main: &OpticalTrain,
        view: &BehindLenslets,
        wavelengths: &[f64],
        pupil: &ExitPupil,
        drift: f64,
    ) -> Result<Self, ExitPupilError> {
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
        let main = ExitPupil::new(main, wavelengths, view.front_z, half.to_array())?;
        let share = |i: u32| 2.0 * f64::from(i) / f64::from(NODES - 1) - 1.0;
        let at = |i: u32| DVec2::new(share(i % NODES), share(i / NODES)) * half;
        let exact = main.disk().is_some();
        let node = |i: u32| match exact {
            true => extent_of(&main.outline(at(i))),
            false => extent_of(&tight_outline(&main, &lenses, at(i))),
        };
        let nodes = (0..NODES * NODES).map(node).collect();
        Ok(Self { main, half, nodes })
    }

    /// The outline from a point of the array (mm); `None` in the dark.
    fn at(&self, at: DVec2) -> Option<[f64; NORMALS]> {
        let last = f64::from(NODES - 1);
        let place = (0.5 * (at / self.half + 1.0) * last).clamp(DVec2::ZERO, DVec2::splat(last));
        let low = place.floor().min(DVec2::splat(last - 1.0));
        let share = place - low;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "between 0 and the number of nodes"
        )]
        let first = low.y as usize * NODES as usize + low.x as usize;
        let next = first + NODES as usize;
        let corners = [first, first + 1, next, next + 1].map(|i| self.nodes[i].as_ref());
        let [Some(a), Some(b), Some(c), Some(d)] = corners else {
            return extent_of(&self.main.outline(at));
        };
        let weights = [
            (1.0 - share.x) * (1.0 - share.y),
            share.x * (1.0 - share.y),
            (1.0 - share.x) * share.y,
            share.x * share.y,
        ];
        Some(std::array::from_fn(|k| {
            weights[0] * a[k] + weights[1] * b[k] + weights[2] * c[k] + weights[3] * d[k]
        }))
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
            let exited = (0..rays.len()).map(|i| rays.fate(i) == RayStatus::Exited);
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
