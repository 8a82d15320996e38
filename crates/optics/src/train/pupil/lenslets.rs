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

use etendue_report::Refusal;
use glam::{DVec2, DVec3};

use super::clear::{without_filters, without_masks};
use super::outline_table::{centre_of, nearest_normal, normal, outline};
use super::region::{Region, area_of};
use super::{ExitPupil, LensletPupil, NORMALS, OutlineTable, dark_array};
use crate::element::{Clip, Gaps, Grid, LensRays, LensletShape, RayStatus, clipped};
use crate::train::aim::towards_lens;
use crate::train::lenslets::Sight;
use crate::train::{BehindLenslets, MonochromaticTrain, OpticalTrain, Side};

/// Factor by which the margin grows, and the most rounds of it.
const GROWTH: f64 = 1.6;
const ROUNDS: u32 = 10;

impl LensletPupil {
    /// Measures it for a sensor of half width and half height `half_size` (mm) at all of `lenses`.
    pub(super) fn new(
        train: &OpticalTrain,
        view: BehindLenslets,
        wavelengths: &[f64],
        pupil: &ExitPupil,
    ) -> Result<Self, Refusal> {
        let array = &view.array;
        let turned = |corners: Vec<[f64; 2]>| -> Vec<DVec2> {
            corners.into_iter().map(|p| DVec2::from(array.lattice.turned(p))).collect()
        };
        // The openings of this array and of the others, from a lenslet's centre, and what is
        // between them.
        let opening = turned(array.opening_corners());
        let opening_radius = opening.iter().map(|p| p.length()).fold(0.0, f64::max);
        let others = view
            .openings(0, pupil.sensor.vertex.z)
            .map(|(_, other)| turned(other.opening_corners()))
            .collect();
        let open = |piece: &Vec<DVec2>| area_of(piece) > 1e-9 * array.lattice.pitch.powi(2);
        let gaps = match array.gaps {
            Gaps::Clear => {
                array.gap_pieces().iter().map(|p| turned(p.to_vec())).filter(open).collect()
            }
            Gaps::Opaque => Vec::new(),
        };
        // Outlines of the main lens' light over the array, in slopes without their drift with the
        // place.
        let main = without_masks(&without_filters(&view.main));
        let drift = match view.exit_pupil_z() {
            Some(z) if (view.front_z - z).abs() > 1e-9 => -1.0 / (view.front_z - z),
            _ => 0.0,
        };
        let table = OutlineTable::new(&main, &view, wavelengths, pupil, drift)?;
        let lenses = wavelengths.iter().map(|&nm| train.at(nm)).collect::<Result<Vec<_>, _>>()?;
        let area = area_of(&opening);
        let mut own = Self {
            view,
            table,
            opening,
            others,
            gaps,
            area,
            opening_radius,
            drift,
            margin: pupil.accuracy.lenslet_margin,
        };
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

    /// True if a point that was drawn from a region belongs to it.
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

    /// The centroid of the light that a lenslet sends to the sensor's plane at z (mm) when the same radiance
    /// comes from everywhere (mm across the axis): of its image of the main lens' outline, in which
    /// irradiance falls with cos⁴ of the angle towards the lenslet. What lenslets blur spreads to all sides
    /// alike. `None` in the dark.
    #[must_use]
    pub fn image_centroid(&self, cell: [f64; 2], z: f64) -> Option<DVec2> {
        let centre = self.view.centre(cell);
        let extent = self.table.at(centre)?;
        let kind = self.view.array.type_at(cell);
        let [slope, _] = self.view.sight(kind, z).central(self.view.principal_distance(kind));
        let place = |m: DVec2| centre - m / slope;
        let weight = |at: DVec2| {
            let slopes = self.view.central_slopes(at.extend(z), cell);
            (1.0 + slopes.length_squared()).powi(-2)
        };
        let corners = outline(|k| extent[k]).map(place);
        let middle = place(centre_of(&extent));
        let (mut sum, mut mean) = (0.0, DVec2::ZERO);
        for k in 0..NORMALS {
            let (a, b) = (corners[k], corners[(k + 1) % NORMALS]);
            let area = (a - middle).perp_dot(b - middle).abs();
            // The midpoints of a triangle's edges: exact for parabolas.
            for at in [0.5 * (a + b), 0.5 * (a + middle), 0.5 * (b + middle)] {
                let light = area * weight(at);
                (sum, mean) = (sum + light, mean + (at - middle) * light);
            }
        }
        (sum > 0.0).then(|| middle + mean / sum)
    }

    /// True if a point of the array is among those aimed at from a point of the sensor (mm).
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

    /// Point where the chief ray of the lens before crosses the array on its way to a point of the
    /// sensor (mm), were it not bent, and the distance from there within which lenslets may matter.
    fn middle(&self, film: DVec3, sight: &Sight) -> Option<(DVec2, f64)> {
        let [slope, _] = sight.central(self.view.principal_distance(0));
        let start = film.truncate();
        let mut at = start;
        for _ in 0..4 {
            at = start + self.table.centre_at(at)? / slope;
        }
        let extent = self.table.at(at)?;
        let widest = self.widest(&extent) * (1.0 + 2.0 * self.margin);
        let kappa = (sight.slope[0] - self.drift * sight.height[0]).abs();
        let sigma = (sight.slope[1] - self.drift * sight.height[1] - self.drift).abs();
        Some((at, (widest + kappa * self.opening_radius) / sigma + 1e-9))
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
        if !self.gaps.is_empty() {
            self.add_gaps(film, middle, &mut regions);
        }
        regions
    }

    /// True if the openings have another shape than the cells.
    fn mixed(&self) -> bool {
        !matches!(
            (self.view.array.lattice.grid, self.view.array.shape),
            (Grid::Square, LensletShape::Square) | (Grid::Hexagonal, LensletShape::Hexagonal)
        )
    }

    /// Region that is aimed at through a lenslet.
    fn region(&self, film: DVec3, cell: [f64; 2], kind: usize, sight: &Sight) -> Option<Region> {
        let array = &self.view.array;
        let centre = self.view.centre(cell);
        let outside = (centre - self.view.decentre).abs() - DVec2::from(array.half_size);
        if outside.max_element() > self.opening_radius {
            return None;
        }
        // The main lens' opening as the sensor sees it through the lenslet: scaled by kappa, and
        // shifted.
        let corners = self.table.corners(centre);
        let away = centre - film.truncate();
        let kappa = sight.slope[0] - self.drift * sight.height[0];
        let shift = away * (sight.slope[1] - self.drift * sight.height[1]);
        let reach = kappa.abs() * self.opening_radius;
        // Most lenslets that show nothing show it in the direction of the shift.
        if let Some(corners) = &corners {
            let k = nearest_normal(shift);
            let ends = [corners.extent(k), corners.extent((k + NORMALS / 2) % NORMALS)];
            if normal(k).dot(shift) - reach > self.widened(ends) {
                return None;
            }
        }
        let extent = self.table.between(corners.as_ref(), centre)?;
        // Whether the opening, or another array's, cuts the lenslet's own.
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
        // Uncut, the region is the opening itself.
        if !cut && self.others.is_empty() {
            if round {
                return Some(Region::Disk { centre, radius: array.reach });
            }
            let area = self.area;
            return Some(Region::Whole { centre, area, cell: Some(cell), checked });
        }
        // Else it is what of the opening the others leave.
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

    /// Adds what is aimed at between lenslets: of each piece what lies in the outline as seen past them.
    fn add_gaps(&self, film: DVec3, middle: DVec2, regions: &mut Vec<Region>) {
        let Some(extent) = self.table.at(middle) else { return };
        let sight = self.view.sight_past(film.z);
        // The main lens' opening in the array's plane, as it is seen through gaps, which have no
        // power.
        let kappa = sight.slope[0] - self.drift * sight.height[0];
        let shift = (middle - film.truncate()) * (sight.slope[1] - self.drift * sight.height[1]);
        let seen = self.outline(&extent).map(|m| middle + (m - shift) / kappa);
        let centre = seen.iter().sum::<DVec2>() / NORMALS as f64;
        let widest = seen.iter().map(|p| p.distance(centre)).fold(0.0, f64::max);
        let inside = |p: &DVec2| {
            (0..NORMALS).all(|k| (seen[(k + 1) % NORMALS] - seen[k]).perp_dot(*p - seen[k]) >= 0.0)
        };
        let clip = seen.map(|p| p.to_array());
        // The pieces of gaps that lie in it or are cut by it.
        let array = &self.view.array;
        let pitch = array.lattice.pitch;
        let local = (centre - self.view.decentre).to_array();
        for cell in array.lattice.cells_near(local, widest + pitch) {
            let at = self.view.centre(cell);
            for piece in &self.gaps {
                let corners: Vec<DVec2> = piece.iter().map(|p| at + *p).collect();
                if corners[0].distance(centre) > widest + pitch {
                    continue;
                }
                if corners.iter().all(inside) {
                    regions.extend(Region::polygon(None, corners, true));
                    continue;
                }
                let corners: Vec<[f64; 2]> = corners.iter().map(|p| p.to_array()).collect();
                let corners = clipped(&corners, &clip).into_iter().map(DVec2::from).collect();
                regions.extend(Region::polygon(None, corners, true));
            }
        }
    }

    /// The extent of the outline in a direction, with its margin.
    fn limit(&self, extent: &[f64; NORMALS], k: usize) -> f64 {
        self.widened([extent[k], extent[(k + NORMALS / 2) % NORMALS]])
    }

    /// An extent with its margin, by it and that in the opposite direction.
    fn widened(&self, [here, opposite]: [f64; 2]) -> f64 {
        here + self.margin * (here + opposite)
    }

    /// The corners of the outline with its margin, in slopes.
    fn outline(&self, extent: &[f64; NORMALS]) -> [DVec2; NORMALS] {
        outline(|k| self.limit(extent, k))
    }

    /// Looks for rays that pass and are not aimed at, and widens the margin until there are none.
    fn widen_until_tight(
        &mut self,
        lenses: &[MonochromaticTrain],
        pupil: &ExitPupil,
    ) -> Result<(), Refusal> {
        for round in 0..ROUNDS {
            let (mut passed, mut strays) = (0, 0);
            for lens in lenses {
                let found = self.strays(lens, pupil, round);
                passed += found[0];
                strays += found[1];
            }
            if round == 0 && passed == 0 {
                return Err(dark_array(self.view.rear));
            }
            // One in a thousand of what passes is less than what other approximations leave.
            if strays * 2000 <= passed {
                return Ok(());
            }
            self.margin *= GROWTH;
        }
        Ok(())
    }

    /// Counts of random rays of a round around what is aimed at: those that pass, and those of them that
    /// are not aimed at.
    fn strays(&self, lens: &MonochromaticTrain, pupil: &ExitPupil, round: u32) -> [u32; 2] {
        let checks = pupil.accuracy.lenslet_checks;
        let mut rays = LensRays::with_capacity(checks as usize);
        let mut aims = Vec::with_capacity(checks as usize);
        for i in round * checks..(round + 1) * checks {
            let u = super::measure::ROBERTS.map(|alpha| (0.5 + alpha * f64::from(i)).fract());
            let place = (2.0 * DVec2::new(u[0], u[3]) - 1.0) * pupil.half_size;
            let film = pupil.film_point(place);
            let sight = self.view.sight(0, film.z);
            let Some((middle, reach)) = self.middle(film, &sight) else { continue };
            let radius = 1.2 * (reach + self.opening_radius) * u[2].sqrt();
            let at = middle + DVec2::from_angle(u[1] * std::f64::consts::TAU) * radius;
            rays.push(film, towards_lens(self.view.aim(film, at).0));
            aims.push((film, at));
        }
        lens.trace(Side::Sensor, Clip::On, &mut rays);
        let (mut passed, mut strays) = (0, 0);
        for (i, (film, at)) in aims.into_iter().enumerate() {
            if rays.status(i) == RayStatus::Exited {
                passed += 1;
                strays += u32::from(!self.aims_at(film, at));
            }
        }
        [passed, strays]
    }
}
