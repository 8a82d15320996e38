//! Coded apertures: samples of a mask in proportion to what it passes.
//!
//! Of rays that are aimed at a mask's whole rectangle, a coded aperture stops half and a small hole
//! nearly all. So a point of the mask is drawn from its own pixels ([`MaskCells`]), within what the other
//! rims leave visible ([`MaskRegion`]), and the ray is aimed at that point by a map that was solved for
//! ([`MaskMap`]).
//!
//! # No bias
//!
//! A ray that is aimed at a point of the mask lands a little beside it. The density is therefore
//! that of the open pixels widened as far as the map was measured to err; and one sample in
//! [`ANYWHERE`] is drawn from a rectangle around the whole pupil, with the density of both ways together in its
//! weight (the one-sample estimate of E. Veach and L. Guibas, "Optimally combining sampling techniques",
//! 1995). Whatever passes can then be met, and what is met has the weight of its true density.

use glam::DVec2;

use super::mask_cells::{MaskCells, first_mask, open_bounds, open_reach};
use super::mask_map::{MappedScene, MaskMap, MaskScene, NO_TERMS};
use super::mask_region::MaskRegion;
use crate::element::{Frame, Opening};
use crate::train::{MonochromaticTrain, OpticalTrain, Part};

/// The share of samples that is drawn from the whole pupil.
const ANYWHERE: f64 = 0.01;

/// Factor on the misses: they may be greater between the places where they are measured.
const SAFETY: f64 = 1.5;

/// A mask as the points of a sensor see it.
#[derive(Debug, Clone)]
pub(super) struct MaskView {
    cells: MaskCells,
    region: MaskRegion,
    /// One for each wavelength (nm), or one for all.
    maps: Vec<(f64, MaskMap)>,
}

/// A direction drawn from a mask.
#[derive(Debug, Clone, Copy)]
pub(super) struct MaskSample {
    /// Slopes x/−z, y/−z.
    pub(super) slopes: DVec2,
    /// Their density per area of slopes.
    pub(super) density: f64,
}

/// A rectangle of slopes that holds all that passes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Anywhere {
    pub(super) centre: DVec2,
    pub(super) half: DVec2,
    /// The direction in which its sides are turned.
    pub(super) axis: DVec2,
}

impl Anywhere {
    fn draw(&self, u: [f64; 2]) -> DVec2 {
        self.axis.rotate(self.centre + (2.0 * DVec2::from(u) - 1.0) * self.half)
    }

    fn density(&self, slopes: DVec2) -> f64 {
        let inside = DVec2::new(self.axis.x, -self.axis.y).rotate(slopes) - self.centre;
        let held = inside.abs().cmple(self.half).all();
        if held { 0.25 / (self.half.x * self.half.y) } else { 0.0 }
    }
}

impl MaskView {
    /// Looks at the first mask of a lens from a sensor, by rays of `wavelengths` (nm), which land where they are aimed
    /// within `aim` of a pixel, when polynomials can do it; `None` when it has none that dims anything, or when no
    /// direction towards it is found.
    pub(super) fn new(
        train: &OpticalTrain,
        wavelengths: &[f64],
        sensor: &Frame,
        half_size: DVec2,
        aim: f64,
    ) -> Option<Self> {
        let (element, mask) = first_mask(train)?;
        let bounds = open_bounds(mask)?;
        let mut clear = super::clear::without_masks(train);
        clear.elements[element].part =
            Part::Aperture(Opening::Circle { radius: f64::INFINITY }.into());
        let mut wavelengths = wavelengths.to_vec();
        wavelengths.sort_by(f64::total_cmp);
        wavelengths.dedup();
        if !clear.is_dispersive() {
            wavelengths.truncate(1);
        }
        let lenses: Vec<MonochromaticTrain> =
            wavelengths.iter().filter_map(|&nm| clear.at(nm).ok()).collect();
        let scene = |lens| MaskScene { clear: &clear, lens, element, sensor, half_size };
        #[expect(clippy::cast_precision_loss, reason = "far fewer pixels than 2⁵³")]
        let pixel = DVec2::from(mask.size) / DVec2::from(mask.pixels.map(|n| n as f64));
        let reach = open_reach(mask, -clear.elements[element].frame.vertex.truncate());
        let mut maps = Vec::with_capacity(lenses.len());
        let mut miss = DVec2::ZERO;
        let mut degree = 1;
        for lens in &lenses {
            let (map, missed) = MaskMap::new(&scene(lens), bounds, reach, aim * pixel, degree)?;
            degree = map.degree();
            miss = miss.max(missed);
            maps.push((lens.wavelength(), map));
        }
        let cells = MaskCells::new(mask, bounds, SAFETY * miss)?;
        // What is visible differs little from one wavelength to the next.
        let mut few = vec![0, lenses.len() / 2, lenses.len() - 1];
        few.dedup();
        let mapped = |i: usize| MappedScene { scene: scene(&lenses[i]), map: &maps[i].1 };
        let few: Vec<MappedScene<'_>> = few.into_iter().map(mapped).collect();
        let region = MaskRegion::new(&few, &cells)?;
        Some(Self { cells, region, maps })
    }

    /// The map for rays of a wavelength (nm), or of the nearest that there is.
    fn map(&self, wavelength: f64) -> &MaskMap {
        let after = self.maps.partition_point(|(nm, _)| *nm < wavelength);
        let nearer = |i: &usize| (self.maps[*i].0 - wavelength).abs();
        let neighbours = after.saturating_sub(1)..=after.min(self.maps.len() - 1);
        let nearest = neighbours.min_by(|a, b| nearer(a).total_cmp(&nearer(b))).unwrap_or(0);
        &self.maps[nearest].1
    }

    /// A direction from a point of the sensor (mm) for rays of a wavelength (nm) and a place in the unit
    /// square: towards a point of the mask for most of the square, and within `anywhere` for the rest.
    /// `None` when the place is given up; the density counts it as drawn. `Err` where nothing is known of
    /// the mask.
    pub(super) fn aim(
        &self,
        wavelength: f64,
        film: DVec2,
        [u, v]: [f64; 2],
        anywhere: &Anywhere,
    ) -> Result<Option<MaskSample>, UnknownMask> {
        let mut room = NO_TERMS;
        let local = self.map(wavelength).at(film, &mut room).ok_or(UnknownMask)?;
        let both = |slopes: DVec2, own: f64| {
            let density = (1.0 - ANYWHERE) * own + ANYWHERE * anywhere.density(slopes);
            (density > 0.0).then_some(MaskSample { slopes, density })
        };
        if u < ANYWHERE {
            let slopes = anywhere.draw([u / ANYWHERE, v]);
            let own = local
                .point(slopes)
                .map_or(0.0, |(at, area)| self.region.density(&self.cells, film, at) / area);
            return Ok(both(slopes, own));
        }
        let u = (u - ANYWHERE) / (1.0 - ANYWHERE);
        let Some(drawn) = self.region.draw(&self.cells, film, [u, v]) else { return Ok(None) };
        let (slopes, area) = local.slopes(drawn.at);
        if area.is_nan() || area <= 0.0 {
            return Ok(None);
        }
        Ok(both(slopes, drawn.density / area))
    }
}

/// Nothing is known of the mask from a point of the sensor.
pub(super) struct UnknownMask;
