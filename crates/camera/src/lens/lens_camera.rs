//! A lens with a sensor behind it as a camera: chief rays for data, weighted rays of the whole pupil
//! for pictures.
//!
//! # Weights
//!
//! E = ∫ L cos θ dΩ over the exit pupil is Eq. (1) of Nürnberg et al. (2019). A sample's weight is the
//! projected solid angle that it stands for over that of the pupil seen from the axis, with filters
//! and masks clear and before anything vignettes: cos⁴ and vignetting are in it, nothing is painted
//! on. A filter dims, a mask passes what it leaves open, and losses in glass, where they are asked for,
//! are lost.

use std::sync::Arc;

use etendue_geometry::{RayBatch, RaysMut};
use etendue_report::Refusal;
use etendue_spectrum::{Bands, Curve, Outside, Spread};
use glam::{DVec2, DVec3};

use super::accuracy::LensAccuracy;
use super::chief::{ChiefTable, ImageCircle, LensletChiefs};
use super::focused::{FocusedLens, View, unvignetted};
use super::opened::{BandInterpolation, OpenedGroup, OpenedLens, uniform_filters};
use super::traced_at::{BandGroup, TracedAt, grouped};

use crate::{CameraError, Pose};
use etendue_optics::element::{Clip, Ray, RayStatus, Reflection};
use etendue_optics::train::pupil::{
    Disk, SlopeWindow, blocked, dark_array, unbounded, without_dimming, without_filters,
};
use etendue_optics::train::{ExitPupil, MonochromaticTrain, OpticalTrain, Side};

/// A lens with a sensor behind it.
#[derive(Debug, Clone)]
pub struct LensCamera {
    pub(super) focused: FocusedLens,
    design: MonochromaticTrain,
    chief: ChiefTable,
    /// The lenslets that the sensor looks through.
    lenslets: Option<LensletChiefs>,
    /// Region of the sensor where light arrives.
    pub(super) lit: ImageCircle,
    /// Projected solid angle of the unvignetted pupil seen from the axis (sr).
    pub(super) solid_angle: f64,
    pub(super) opened: Option<Arc<OpenedLens>>,
    pub(super) traced_at: TracedAt,
    /// Spreading of light on the sensor.
    pub(super) spread: SpreadBy,
    /// Numbers by which it is measured.
    pub(super) accuracy: LensAccuracy,
}

/// Means by which light of a point is spread on the sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum SpreadBy {
    /// By rays of the whole pupil.
    #[default]
    Rays,
    /// By waves, whoever renders adds them up.
    Waves,
    /// Not at all: each place sees along its chief ray.
    Nothing,
}

impl PartialEq for LensCamera {
    fn eq(&self, other: &Self) -> bool {
        // All else follows from it.
        self.focused == other.focused
            && self.traced_at == other.traced_at
            && self.spread == other.spread
            && self.accuracy == other.accuracy
    }
}

impl LensCamera {
    /// Solves chief rays and finds out whether there is light at all.
    pub(crate) fn new(focused: FocusedLens) -> Result<Self, CameraError> {
        let dark = |refusal: Refusal| CameraError::new("", refusal.to_string());
        let lenslets = LensletChiefs::new(&focused)?;
        // Chief rays of whole pictures go straight through arrays of lenslets.
        let unbent = focused.train().without_arrays();
        let design = match lenslets {
            Some(_) => focused.at_design()?,
            None => unbent
                .at(unbent.wavelength())
                .map_err(|fault| CameraError::new("lens", fault.to_string()))?,
        };
        // A filter may be dark at the design wavelength and pass others, and a mask's holes are smaller
        // than what is looked at.
        let train = &without_dimming(&unbent);
        let clear = train
            .at(train.wavelength())
            .map_err(|fault| CameraError::new("", fault.to_string()))?;
        if train.elements().iter().all(|e| e.clear_radius() == f64::INFINITY) {
            return Err(dark(unbounded()));
        }
        let half = focused.film().half_size();
        let frame = focused.film().frame;
        if unbent.closed_mask().is_some() {
            return Err(dark(blocked(&unbent, &design, frame.vertex)));
        }
        let lit_from =
            |film: DVec2| SlopeWindow::find(train, &clear, frame.point(film.extend(0.0))).is_some();
        let places = [-1.0, 0.0, 1.0].map(|y| [-1.0, 0.0, 1.0].map(|x| DVec2::new(x, y) * half));
        if !lit_from(DVec2::ZERO) && !places.into_iter().flatten().any(lit_from) {
            let closed = train.elements().iter().any(|e| e.clear_radius() == 0.0);
            return Err(dark(match focused.train().first_array() {
                Some(element) if !closed => dark_array(element),
                _ => blocked(train, &clear, frame.vertex),
            }));
        }
        let accuracy = LensAccuracy::DEFAULT;
        let lit = ImageCircle::measure(train, &clear, frame, half, accuracy.pupil.image_circle);
        let solid_angle = unvignetted(focused.train(), &design, &focused);
        let straight = unbent.at(unbent.wavelength()).unwrap_or_else(|_| design.clone());
        let chief = ChiefTable::new(&unbent, &frame, half, &straight);
        let (opened, traced_at, spread) = Default::default();
        Ok(Self {
            focused,
            design,
            chief,
            lenslets,
            lit,
            solid_angle,
            opened,
            traced_at,
            spread,
            accuracy,
        })
    }

    /// The lens and its sensor.
    #[must_use]
    pub fn focused(&self) -> &FocusedLens {
        &self.focused
    }

    /// The lens at its design wavelength.
    pub(super) fn design(&self) -> &MonochromaticTrain {
        &self.design
    }

    /// The numbers by which it is measured.
    #[must_use]
    pub fn accuracy(&self) -> LensAccuracy {
        self.accuracy
    }

    /// Returns the camera measured by other numbers. What was measured of its pupil stays where they are the same.
    pub(crate) fn with_accuracy(&self, accuracy: LensAccuracy) -> Self {
        let mut own = self.clone();
        if accuracy != self.accuracy {
            own.opened = None;
        }
        let error = accuracy.pupil.image_circle;
        if error != self.accuracy.pupil.image_circle {
            own.lit = self.lit_within(error);
        }
        own.accuracy = accuracy;
        own
    }

    /// The region of the sensor where light arrives, its edge to within a share of its distance.
    fn lit_within(&self, error: f64) -> ImageCircle {
        let train = without_dimming(&self.focused.train().without_arrays());
        let film = self.focused.film();
        match train.at(train.wavelength()) {
            Ok(clear) => ImageCircle::measure(&train, &clear, film.frame, film.half_size(), error),
            Err(_) => self.lit.clone(),
        }
    }

    /// Returns the camera on pixels `factor` times as large: what was measured of the pupil holds for them too.
    pub(crate) fn coarser(&self, factor: f64) -> Self {
        Self { focused: self.focused.coarser(factor), ..self.clone() }
    }

    /// The centroid of a lenslet's light on the sensor (pixels from the corner) when the same radiance comes
    /// from everywhere; `None` before the camera is opened for bands, and in the dark.
    #[must_use]
    pub fn image_centroid(&self, cell: [f64; 2]) -> Option<[f64; 2]> {
        let lenslets = self.opened.as_ref()?.pupil.lenslets()?;
        let at = lenslets.image_centroid(cell, self.focused.sensor_z())?;
        Some(self.focused.pixel_of(at))
    }

    /// The lenslets that the sensor looks through as light of each band has them, one for each of
    /// [`Self::band_groups`]; empty where glass does not tell wavelengths apart, or there are none.
    ///
    /// # Errors
    ///
    /// When a glass has no index at a band's wavelength.
    pub fn lenslets_by_band(&self, bands: &Bands) -> Result<Vec<LensletChiefs>, CameraError> {
        if self.lenslets.is_none() || !self.parts_wavelengths() {
            return Ok(Vec::new());
        }
        let wavelengths = self.band_groups(bands).into_iter().filter_map(|group| group.wavelength);
        wavelengths.filter_map(|nm| LensletChiefs::at(&self.focused, nm).transpose()).collect()
    }

    /// The lenslets that the sensor looks through, if it does.
    #[must_use]
    pub fn lenslets(&self) -> Option<&LensletChiefs> {
        self.lenslets.as_ref()
    }

    /// The projected solid angle (sr) of the unvignetted pupil seen from the axis, or of one lenslet from
    /// below its middle: times the mean of weight times radiance, it is the irradiance.
    #[must_use]
    pub fn solid_angle(&self) -> f64 {
        self.solid_angle
    }

    /// Returns the camera with rays that run as at the design wavelength in all bands. What
    /// coloured filters pass stays each band's own.
    pub(crate) fn without_dispersion(&self) -> Self {
        self.running_at(TracedAt::Design)
    }

    /// The same whose neighbouring bands run together in `count` groups, at most, which are even in 1/λ²: the index of
    /// glass moves nearly in proportion to it. `None` where bands differ by more than where they run: where filters,
    /// coatings or glass dim each by its own share.
    pub(crate) fn with_bands_grouped(&self, count: usize) -> Option<Self> {
        let train = self.focused.train();
        let has_filters = !self.filter_curves().is_empty();
        let dims = has_filters || self.dims_wavelengths_apart();
        let is_apart = self.traced_at == TracedAt::Own && self.runs_apart();
        let groups = TracedAt::Grouped(count.max(1));
        (is_apart && !dims && train.first_array().is_none()).then(|| self.running_at(groups))
    }

    /// The same with rays that run at other wavelengths.
    pub(super) fn running_at(&self, traced_at: TracedAt) -> Self {
        Self { traced_at, opened: None, ..self.clone() }
    }

    /// Returns the camera with its light spread another way.
    pub(super) fn spread_by(self, spread: SpreadBy) -> Self {
        Self { spread, ..self }
    }

    /// True if rays of other wavelengths run differently, or lose another share on the way.
    fn tells_wavelengths_apart(&self) -> bool {
        if self.spread == SpreadBy::Nothing {
            return false;
        }
        let train = self.focused.train();
        let mut curves = train.elements().iter().flat_map(|element| element.part.curves());
        curves.any(|curve| curve.as_flat().is_none()) || self.runs_apart()
    }

    /// True if rays of other wavelengths run their own way.
    pub(super) fn parts_wavelengths(&self) -> bool {
        self.traced_at != TracedAt::Design && self.focused.train().is_dispersive()
    }

    /// True if coatings or glass lose another share of each wavelength.
    pub(super) fn dims_wavelengths_apart(&self) -> bool {
        let train = self.focused.train();
        let losses = train.losses();
        let coated =
            matches!(losses.reflection, Some(Reflection::Coated(_) | Reflection::Stack(_)))
                || train.elements().iter().any(|e| e.part.is_coated_or_blazed());
        coated || (losses.absorption && train.media().iter().any(|g| g.absorption(550.0).is_some()))
    }

    /// True if glass, or what it loses, makes another lens of each wavelength.
    pub(super) fn runs_apart(&self) -> bool {
        self.traced_at != TracedAt::Design
            && (self.dims_wavelengths_apart() || self.focused.train().is_dispersive())
    }

    /// Groups of `bands` that need rays of their own: each, or each group, where the lens tells
    /// wavelengths apart and there are several, else none.
    #[must_use]
    pub fn band_groups(&self, bands: &Bands) -> Vec<BandGroup> {
        let count = bands.count();
        if count < 2 || !self.tells_wavelengths_apart() {
            return vec![BandGroup { bands: 0..count, wavelength: None }];
        }
        if let TracedAt::Grouped(groups) = self.traced_at {
            return grouped(bands, groups);
        }
        let group = |i| BandGroup { bands: i..i + 1, wavelength: Some(bands.wavelength(i)) };
        (0..count).map(group).collect()
    }

    /// Opens the camera for `bands`: measures its exit pupil, which takes a moment when it is not yet measured.
    pub(crate) fn opened(&self, bands: &Bands) -> Result<Self, CameraError> {
        if self.opened.as_ref().is_some_and(|opened| opened.bands == *bands) {
            return Ok(self.clone());
        }
        let paths = self.band_paths(bands).ok().map(|paths| self.displaced(paths));
        let opened = self.open(bands, self.focused.train(), paths.as_ref())?;
        let opened = OpenedLens { paths, ..opened };
        Ok(Self { opened: Some(Arc::new(opened)), ..self.clone() })
    }

    /// Opens the camera with its filters clear.
    pub(crate) fn opened_clear(&self, bands: &Bands) -> Result<Self, CameraError> {
        let clear = without_filters(self.focused.train());
        Ok(Self { opened: Some(Arc::new(self.open(bands, &clear, None)?)), ..self.clone() })
    }

    /// The lens opened, of which `train` is as much as light of `bands` is to meet, for rays that start where those of
    /// `paths` do.
    fn open(
        &self,
        bands: &Bands,
        train: &OpticalTrain,
        paths: Option<&BandInterpolation>,
    ) -> Result<OpenedLens, CameraError> {
        let fault = |why: String| CameraError::new("", why);
        for (i, element) in train.elements().iter().enumerate() {
            for curve in element.part.curves() {
                bands
                    .from_curve(curve, Outside::Held)
                    .map_err(|error| fault(format!("the filter elements[{i}]: {error}")))?;
            }
        }
        let (mut groups, mut measured) = (Vec::new(), Vec::new());
        for group in self.band_groups(bands) {
            let spread = self.spread(bands, &group);
            let opened = OpenedGroup::open(train, bands, group.bands.start, &spread)
                .map_err(|error| fault(error.to_string()))?;
            // Between its ends and its middle the pupil changes as little as the index.
            let wavelengths = &spread.wavelengths;
            let last = wavelengths.len() - 1;
            let mut few = vec![wavelengths[0], wavelengths[last / 2], wavelengths[last]];
            few.dedup();
            measured.extend(few);
            groups.push(opened);
        }
        let margin = paths.map_or(0.0, BandInterpolation::margin);
        let half_size = (self.focused.film().half_size() + margin).to_array();
        let clear = without_filters(train);
        let (accuracy, z) = (self.accuracy.pupil, self.focused.sensor_z());
        let wider = paths.and_then(|paths| paths.rims.as_ref()).map(|rims| {
            measured = rims.outer.iter().map(MonochromaticTrain::wavelength).collect();
            &rims.wider
        });
        let pupil = ExitPupil::within(accuracy, wider.unwrap_or(&clear), &measured, z, half_size)
            .map_err(|error| fault(error.to_string()))?;
        let all: Vec<f64> =
            groups.iter().flat_map(|g| &g.lenses).map(MonochromaticTrain::wavelength).collect();
        let pupil =
            if all.len() > measured.len() { pupil.aimed_at_mask(&clear, &all) } else { pupil };
        Ok(OpenedLens { bands: bands.clone(), groups, pupil, paths: None })
    }

    /// The wavelengths at which the rays of a group run: several for wide bands where the lens bends
    /// or dims each in its own way.
    pub(super) fn spread(&self, bands: &Bands, group: &BandGroup) -> Spread {
        let train = self.focused.train();
        let spread = bands.spread(group.bands.start, &uniform_filters(train));
        let one = |nm| Spread { wavelengths: vec![nm], overlap: spread.overlap };
        match group.wavelength {
            Some(nm) if group.bands.len() > 1 => Spread { wavelengths: vec![nm], overlap: 1.0 },
            _ if !self.tells_wavelengths_apart() || group.bands.len() > 1 => {
                Spread { wavelengths: vec![train.wavelength()], overlap: 1.0 }
            }
            Some(nm) if !self.runs_apart() => one(nm),
            None if !self.runs_apart() => one(train.wavelength()),
            _ => spread,
        }
    }

    /// True if the exit pupil is known in closed form: a round opening with nothing behind it that bends rays.
    #[must_use]
    pub fn has_round_pupil(&self) -> bool {
        let film = self.focused.film();
        let train = without_filters(self.focused.train());
        Disk::of(&train, &film.frame, film.half_size()).is_some()
    }

    /// True if the rays of a sample run at a wavelength that is drawn.
    pub fn draws_wavelengths(&self) -> bool {
        let groups = self.opened.iter().flat_map(|opened| &opened.groups);
        groups.into_iter().any(|group| group.lenses.len() > 1)
    }

    /// Greatest number of wavelengths that the rays of one of [`Self::band_groups`] are drawn from.
    #[must_use]
    pub fn wavelengths_a_group(&self, bands: &Bands) -> usize {
        let groups = self.band_groups(bands).into_iter();
        groups.map(|group| self.spread(bands, &group).wavelengths.len()).max().unwrap_or(1)
    }

    fn in_world(&self, pose: &Pose, point: DVec3, direction: DVec3) -> (DVec3, DVec3) {
        let place = pose.position + pose.rotation * self.focused.in_camera(point);
        (place, pose.rotation * direction)
    }

    /// Turns places on the sensor (pixels from the corner), which stand in the first two arrays of
    /// the directions, into chief rays. They start where they pass the camera's origin, and see what
    /// is in front of the lens.
    pub(crate) fn aim(&self, pose: &Pose, rays: &mut RayBatch) {
        let RaysMut { origins, directions, t_min, t_max } = rays.arrays_mut();
        for i in 0..t_min.len() {
            let place = self.focused.film().place(directions[0][i], directions[1][i]);
            let chief = self.chief_ray(place);
            let (origin, direction) = match chief {
                Some((point, direction)) => self.in_world(pose, point, direction),
                None => (pose.position, pose.forward()),
            };
            // From the point that is nearest to the entrance pupil; parallel rays, from the plane
            // through it.
            let towards = pose.position - origin;
            let forward = direction.dot(pose.forward());
            let back = match self.focused.view() {
                View::Perspective(_) => towards.dot(direction),
                View::Parallel { .. } if forward > 0.0 => towards.dot(pose.forward()) / forward,
                View::Parallel { .. } => 0.0,
            };
            let start = origin + direction * back;
            for axis in 0..3 {
                origins[axis][i] = start[axis];
                directions[axis][i] = direction[axis];
            }
            t_min[i] = (-back).max(0.0);
            if chief.is_none() {
                // Nothing lies before a negative distance: the ray hits nothing.
                t_max[i] = -1.0;
            }
        }
    }

    /// The chief ray of a place on the sensor (mm) behind the lens, on the object's side: a point on
    /// the last element that it meets, and its direction. `None` outside of the image circle, and
    /// where the stop's centre cannot be seen.
    pub(super) fn chief_ray(&self, film: DVec2) -> Option<(DVec3, DVec3)> {
        if !self.lit.contains(film) {
            return None;
        }
        let frame = &self.focused.film().frame;
        let start = frame.point(film.extend(0.0));
        // What is seen through a lenslet ends where the lens before it does.
        let (direction, clip) = match &self.lenslets {
            Some(lenslets) => (lenslets.direction(start)?, Clip::On),
            None => {
                let (train, design) = (self.focused.train(), &self.design);
                let direction = match self.spread {
                    // Samples of light are many, and no data.
                    SpreadBy::Nothing => self.chief.direction_nearly(train, frame, design, film)?,
                    _ => self.chief.direction(train, frame, design, film)?,
                };
                (direction, Clip::Off)
            }
        };
        let end = self.design.run(Side::Sensor, clip, Ray::new(start, direction)?);
        let ray = end.ray;
        (end.status == RayStatus::Exited).then(|| (ray.position.into(), ray.direction.into()))
    }

    /// The slopes (right, down) at which a place of the picture (pixels) is seen; infinite when it is
    /// not seen or is seen 90° or more off the axis.
    pub(crate) fn tangents(&self, column: f64, row: f64) -> [f64; 2] {
        let place = self.focused.film().place(column, row);
        let seen = match &self.lenslets {
            Some(lenslets) => {
                lenslets.seen_from(self.focused.film().frame.point(place.extend(0.0)))
            }
            None => self.chief_ray(place),
        };
        match seen {
            Some((_, d)) if d.z < 0.0 => [-d.x / d.z, d.y / d.z],
            _ => {
                let turned = place * self.focused.film().turn;
                [turned.x, -turned.y].map(|x| x.signum() * f64::INFINITY)
            }
        }
    }

    /// Curves of the lens' filters that pass some wavelengths better than others.
    #[must_use]
    pub fn filter_curves(&self) -> Vec<Curve> {
        let curves = self.focused.train().elements().iter().flat_map(|e| e.part.curves());
        curves.filter(|curve| curve.as_flat().is_none()).cloned().collect()
    }

    /// Notes on oddities of the lens, and on what of it is not known at the wavelengths of `bands`.
    #[must_use]
    pub fn out_of_range(&self, bands: &Bands) -> Vec<String> {
        let groups = self.band_groups(bands).into_iter();
        let wavelengths: Vec<f64> =
            groups.flat_map(|group| self.spread(bands, &group).wavelengths).collect();
        self.focused.train().outside_of_range(&wavelengths)
    }
}
