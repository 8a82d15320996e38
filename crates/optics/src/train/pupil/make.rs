//! Construction of an exit pupil: in closed form, behind lenslets, or measured by rays.

use etendue_report::Refusal;
use glam::DVec2;

use super::clear::without_masks;
use super::coded::MaskView;
use super::disk::Disk;
use super::refusals::{blocked, no_sensor, unbounded};
use super::wavelengths::LensSplit;
use super::{ExitPupil, LensletPupil, NodeLayout, PupilAccuracy, PupilOutline};
use crate::train::OpticalTrain;

impl ExitPupil {
    /// Measures the exit pupil for a sensor of half width and half height `half_size` (mm) at
    /// `sensor_z`, tilted and decentred as the lens file says, for light of all of `wavelengths` (nm): at a few of them,
    /// and checked at the others.
    ///
    /// # Errors
    ///
    /// When no light passes, when nothing bounds the light, or when a glass has no index.
    pub fn new(
        train: &OpticalTrain,
        wavelengths: &[f64],
        sensor_z: f64,
        half_size: [f64; 2],
    ) -> Result<Self, Refusal> {
        Self::within(PupilAccuracy::DEFAULT, train, wavelengths, sensor_z, half_size)
    }

    /// As [`Self::new`], by other numbers.
    ///
    /// # Errors
    ///
    /// As [`Self::new`].
    pub fn within(
        accuracy: PupilAccuracy,
        train: &OpticalTrain,
        wavelengths: &[f64],
        sensor_z: f64,
        half_size: [f64; 2],
    ) -> Result<Self, Refusal> {
        let half_size = DVec2::from(half_size);
        if !half_size.is_finite() || half_size.min_element() < 0.0 || !sensor_z.is_finite() {
            return Err(no_sensor());
        }
        if train.elements.iter().all(|e| !e.clear_radius().is_finite()) {
            return Err(unbounded());
        }
        if wavelengths.is_empty() {
            return Err(no_sensor());
        }
        let symmetric = train.is_rotationally_symmetric();
        let mut pupil = Self {
            sensor: train.sensor_frame(sensor_z),
            half_size,
            layout: if symmetric { NodeLayout::Radial } else { NodeLayout::Planar },
            disk: None,
            nodes: Vec::new(),
            coded: None,
            lenslets: None,
            index2: 1.0,
            radius: half_size.length(),
            accuracy,
        };
        // Behind lenslets each of them has a pupil of its own; other arrays are aimed at as they
        // are.
        if let Some(view) = train.behind_lenslets() {
            pupil.index2 = train.at(wavelengths[0])?.index_before_sensor().powi(2);
            let lenslets = LensletPupil::new(train, view, wavelengths, &pupil)?;
            return Ok(Self { lenslets: Some(Box::new(lenslets)), ..pupil });
        }
        if let Some(first) = train.first_array() {
            let (rear, half_size) = (train.rear_part(first), half_size.to_array());
            return Self::within(accuracy, &rear, wavelengths, sensor_z, half_size);
        }
        // Masks are left out of what is measured: what they pass is drawn from within it.
        if train.closed_mask().is_some() {
            let lens = train.at(wavelengths[0])?;
            return Err(blocked(train, &lens, pupil.sensor.vertex));
        }
        let masked = train;
        let train = &without_masks(masked);
        let lenses = wavelengths.iter().map(|&nm| train.at(nm)).collect::<Result<Vec<_>, _>>()?;
        let Some(first) = lenses.first() else { return Err(no_sensor()) };
        pupil.index2 = first.index_before_sensor().powi(2);
        // A round opening as the only rim is known in closed form.
        pupil.disk = Disk::of(train, &pupil.sensor, half_size);
        if pupil.disk.is_some() {
            return Ok(pupil);
        }
        // All others are measured by rays at nodes over the sensor.
        let lenses = LensSplit::of(train, lenses, accuracy.wavelengths as usize);
        pupil.measure(train, &lenses.measured);
        if pupil.nodes.iter().all(PupilOutline::is_dark) {
            return Err(blocked(train, &train.at(wavelengths[0])?, pupil.sensor.vertex));
        }
        pupil.widen_until_tight(&lenses);
        if train.is_obscured() {
            pupil.narrow_until_tight(&lenses);
        }
        for node in &mut pupil.nodes {
            node.widest = node.reach.into_iter().fold(0.0, f64::max);
        }
        Ok(pupil.aimed_at_mask(masked, wavelengths))
    }

    /// Aims the pupil's samples at its first mask by rays of `wavelengths` (nm), which run apart
    /// where the lens of `train` is dispersive: those that samples will be traced at.
    #[must_use]
    pub fn aimed_at_mask(mut self, train: &OpticalTrain, wavelengths: &[f64]) -> Self {
        if self.lenslets.is_none() && train.first_array().is_none() {
            let aim = self.accuracy.mask_aim;
            self.coded = MaskView::new(train, wavelengths, &self.sensor, self.half_size, aim);
        }
        self
    }

    /// As [`Self::new`], with rays aimed at all of element `first` of the lens from behind, wherever they
    /// may end: what serves where outlines do not follow from place to place, and checks what does.
    ///
    /// # Errors
    ///
    /// As [`Self::new`].
    pub fn of_rear(
        train: &OpticalTrain,
        first: usize,
        wavelengths: &[f64],
        sensor_z: f64,
        half_size: [f64; 2],
    ) -> Result<Self, Refusal> {
        Self::new(&train.rear_part(first), wavelengths, sensor_z, half_size)
    }
}
