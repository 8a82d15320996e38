//! The exit pupil as each point of the sensor sees it, and samples of it.
//!
//! Rays that leave the sensor in directions in which no light can come are wasted: around a double
//! Gauss at f/2 a third of those aimed at a rectangle around the pupil. Here the outline of the
//! passing directions is known at nodes over the sensor, in slopes (x/−z, y/−z), as a frame (centre
//! and half axes) and a table of radii by angle in that frame. Frames and radii are joined by
//! straight lines over the sensor and over the angle, so the bound has no steps and a picture no
//! rings.
//!
//! # No bias
//!
//! A bound that cuts off part of the pupil would darken the picture, so each radius in the table is
//! the greatest of those measured at the nine nearest places of a grid twice as fine, in the sensor
//! and in the angle, plus a margin; the interpolated bound is then at least the true outline at all
//! measured places between. What the fine grid itself could miss is looked for with random rays just
//! outside the bound when it is built, and the bound is widened until none of them passes. Radii are
//! those of the outermost passing ray, so an outline needs not be convex.
//!
//! # Obscuration
//!
//! Where something may stand in the middle of the light, the innermost passing rays are measured in the same way as
//! the outermost, the least of those nearby less a margin is kept, and random rays just inside of it are let through
//! until none passes: samples are drawn between the two.
//!
//! # Weights
//!
//! For the irradiance of Eq. (1) of Nürnberg et al. (2019), E = ∫ L cos θ dΩ: a sample stands for
//! dm = π a b ρ² of slopes, in which dΩ = cos³θ dm, θ from the axis, and the sensor sees it under its
//! own cosine. In a medium of index n before the sensor the radiance is n² that of the object.
//!
//! The bounds that this replaces: C. Kolb, D. Mitchell, P. Hanrahan, "A realistic camera model for
//! computer graphics", 1995; M. Pharr, W. Jakob, G. Humphreys, *Physically Based Rendering*, 6.4.5.

mod accuracy;
mod bound;
mod clear;
mod coded;
mod disk;
mod lenslets;
mod mask_cells;
mod mask_map;
mod mask_region;
mod measure;
mod outline_table;
mod place;
mod refusals;
mod region;
mod search;
mod wavelengths;

use etendue_report::Refusal;
use glam::{DVec2, DVec3};

use self::bound::PupilBound;
use self::clear::without_masks;
use self::coded::MaskView;
use self::place::turn_of;
use self::refusals::no_sensor;
use self::wavelengths::LensSplit;
use super::aim::towards_lens;
use super::{MonochromaticTrain, OpticalTrain};
use crate::element::{Frame, LensRays, RayStatus};

pub use accuracy::PupilAccuracy;
pub use bound::PupilSamples;
pub use clear::{without_dimming, without_filters};
pub use disk::Disk;
pub use lenslets::LensletPupil;
pub use measure::lit_radius;
pub use refusals::{blocked, dark_array, unbounded};
pub use search::SlopeWindow;

/// Angles in the table of a node. Not a setting: tables have this size when they are compiled, and what angles miss
/// between them is [`PupilAccuracy::margin`]'s.
const ANGLES: usize = 128;

/// One sample of the exit pupil.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PupilSample {
    /// The unit direction from the point of the sensor into the lens, in lens coordinates.
    pub direction: DVec3,
    /// Projected solid angle that the sample stands for (sr): the mean of weight times radiance
    /// over samples, blocked ones counted as 0, is the irradiance.
    pub weight: f64,
}

/// Exit pupil: the directions from which light can come, for each point of a sensor.
#[derive(Debug, Clone)]
pub struct ExitPupil {
    sensor: Frame,
    half_size: DVec2,
    layout: NodeLayout,
    /// The pupil in closed form; there are no nodes then.
    disk: Option<Disk>,
    nodes: Vec<PupilOutline>,
    /// The first mask, which is sampled by what it passes.
    coded: Option<MaskView>,
    /// The lenslets through which light comes; there are no nodes then.
    lenslets: Option<Box<LensletPupil>>,
    index2: f64,
    /// Distance from the sensor's centre to the outermost node of a radial layout (mm).
    radius: f64,
    accuracy: PupilAccuracy,
}

/// Layout of the nodes on the sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum NodeLayout {
    /// On a radius, for all directions across the sensor.
    Radial,
    /// On a grid.
    Planar,
}

/// The passing directions from one point of the sensor.
#[derive(Debug, Clone)]
struct PupilOutline {
    /// The middle of the frame in slopes.
    centre: DVec2,
    /// The frame's half axes in slopes; 0 when nothing passes.
    half: DVec2,
    /// Radii in the frame by angle; the first again at the end.
    reach: [f64; ANGLES + 1],
    /// Radii within which nothing passes, by angle; the first again at the end. 0 where nothing obscures.
    inner: [f64; ANGLES + 1],
    /// The greatest of the outer ones.
    widest: f64,
    /// The slopes of the chief ray.
    chief: Option<DVec2>,
}

impl PupilOutline {
    const DARK: Self = Self {
        centre: DVec2::ZERO,
        half: DVec2::ZERO,
        reach: [0.0; ANGLES + 1],
        inner: [0.0; ANGLES + 1],
        widest: 0.0,
        chief: None,
    };

    fn is_dark(&self) -> bool {
        self.half == DVec2::ZERO
    }
}

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

    /// The lenslets through which light comes, if it does.
    #[must_use]
    pub fn lenslets(&self) -> Option<&LensletPupil> {
        self.lenslets.as_deref()
    }

    /// True if one radius of nodes serves the whole sensor; otherwise a coarser grid of nodes does,
    /// and more rays are lost.
    #[must_use]
    pub fn is_radial(&self) -> bool {
        self.layout == NodeLayout::Radial
    }

    /// The pupil in closed form, if it has one.
    pub fn disk(&self) -> Option<&Disk> {
        self.disk.as_ref()
    }

    /// A point of the sensor in lens coordinates (mm), from its place on the sensor: x and y from
    /// the sensor's centre (mm), in the lens' axes. Images are upside down there.
    #[must_use]
    pub fn film_point(&self, film: DVec2) -> DVec3 {
        self.sensor.point(film.extend(0.0))
    }

    /// The direction for the point `u` of the unit square, as seen from `film` on the sensor (mm), for a
    /// ray of `wavelength` (nm): uniform in area over the bound, or towards what a mask passes, in proportion
    /// to it. `None` where no light arrives.
    ///
    /// Neighbouring points of the square give neighbouring directions.
    #[must_use]
    pub fn sample(&self, film: DVec2, u: [f64; 2], wavelength: f64) -> Option<PupilSample> {
        if let Some(lenslets) = &self.lenslets {
            let (slopes, area) = lenslets.draw(self.film_point(film), u)?;
            return Some(self.weigh(slopes, area));
        }
        let bound = self.bound(film)?;
        if let Some(coded) = &self.coded
            && let Ok(aimed) = coded.aim(wavelength, film, u, &bound.rectangle())
        {
            return aimed.map(|aimed| self.weigh(aimed.slopes, 1.0 / aimed.density));
        }
        let (slopes, area) = match self.disk {
            Some(disk) => disk.draw(&self.sensor, self.film_point(film), u),
            None => bound.draw(u)?,
        };
        Some(self.weigh(slopes, area))
    }

    /// The sample along slopes that stands for an area of slopes.
    fn weigh(&self, slopes: DVec2, area: f64) -> PupilSample {
        let direction = towards_lens(slopes);
        let on_sensor = direction.dot(self.sensor.rotation.z_axis).abs();
        let cosine = -direction.z;
        let weight = self.index2 * area * cosine.powi(3) * on_sensor;
        PupilSample { direction, weight }
    }

    /// The bound from a point of the sensor (mm); `None` where no light arrives.
    fn bound(&self, film: DVec2) -> Option<PupilBound<'_>> {
        let bound = if let Some(disk) = &self.disk {
            let (centre, radius) = disk.seen_from(self.film_point(film));
            PupilBound { nodes: &[], place: None, frame: [centre, DVec2::splat(radius)] }
        } else {
            let place = self.place(film)?;
            let mut frame = [DVec2::ZERO; 2];
            for (node, weight) in place.nodes {
                frame[0] += self.nodes[node].centre * weight;
                frame[1] += self.nodes[node].half * weight;
            }
            PupilBound { nodes: &self.nodes, place: Some(place), frame }
        };
        (bound.frame[1].min_element() > 0.0).then_some(bound)
    }

    /// Appends one ray for each point of the sensor (mm) and point of the unit square, ready to be
    /// traced at `wavelength` (nm) from [`Side::Sensor`](super::Side); its throughput is its weight. Where no light
    /// arrives the ray has ended and weighs 0.
    pub fn push_rays(&self, film: &[DVec2], u: &[[f64; 2]], wavelength: f64, rays: &mut LensRays) {
        for (&film, &u) in film.iter().zip(u) {
            let at = self.film_point(film);
            match self.sample(film, u, wavelength) {
                Some(sample) => rays.push_weighted(at, sample.direction, sample.weight),
                None => {
                    rays.push_weighted(at, DVec3::NEG_Z, 0.0);
                    rays.set_status(rays.len() - 1, RayStatus::Vignetted { element: 0 });
                }
            }
        }
    }

    /// The direction of the chief ray from `film` (mm), which passes the stop's centre; `None` where
    /// the stop's centre cannot be seen.
    #[must_use]
    pub fn chief_direction(
        &self,
        train: &OpticalTrain,
        at: &MonochromaticTrain,
        film: DVec2,
    ) -> Option<DVec3> {
        let start = self.place(film).and_then(|place| {
            let mut slopes = DVec2::ZERO;
            for (node, weight) in place.nodes {
                slopes += self.nodes[node].chief? * weight;
            }
            Some(place.turned(slopes))
        });
        train.chief_direction_from(at, self.film_point(film), start)
    }

    /// The bound as a polygon of slopes around the passing directions from `film`, for drawing;
    /// empty where no light arrives.
    #[must_use]
    pub fn outline(&self, film: DVec2) -> Vec<DVec2> {
        if let Some(disk) = &self.disk {
            let (centre, radius) = disk.seen_from(self.film_point(film));
            let angle = |i| DVec2::from_angle(turn_of(i) * std::f64::consts::TAU);
            return (0..ANGLES).map(|i| centre + angle(i) * radius).collect();
        }
        let Some(place) = self.place(film) else { return Vec::new() };
        let mut corners = Vec::with_capacity(ANGLES);
        for i in 0..ANGLES {
            let angle = turn_of(i) * std::f64::consts::TAU;
            let mut corner = [DVec2::ZERO, DVec2::ZERO];
            let mut reach = 0.0;
            for (node, weight) in place.nodes {
                let outline = &self.nodes[node];
                corner[0] += outline.centre * weight;
                corner[1] += outline.half * weight;
                reach += outline.reach[i] * weight;
            }
            corners.push(place.turned(corner[0] + DVec2::from_angle(angle) * corner[1] * reach));
        }
        corners
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::{Focus, LensFile};

    const CHECKS: u32 = PupilAccuracy::DEFAULT.checks;

    pub(super) fn preset(name: &str) -> OpticalTrain {
        let path = format!("{}/../../scenes/lenses/{name}.json", env!("CARGO_MANIFEST_DIR"));
        let file = LensFile::from_json(&std::fs::read_to_string(path).unwrap()).unwrap();
        file.build(&|name: &str| Err(format!("{name}: presets have no files"))).unwrap()
    }

    /// The proof of the margin: the bound was closed with rays of the first rounds, and of the
    /// rounds after them, with which it had nothing to do, none passes outside of it.
    #[test]
    fn of_a_million_rays_just_outside_of_the_bound_none_passes() {
        // The last is searched coarsely.
        for name in ["double-gauss", "fisheye", "telephoto", "asphere", "gradient-singlet"] {
            let train = preset(name);
            let z = train.sensor_z(Focus::Infinity).unwrap();
            let lens = train.at(587.56).unwrap();
            assert_eq!(lens.is_costly(), name == "gradient-singlet");
            let pupil = ExitPupil::new(&train, &[587.56], z, [18.0, 12.0]).unwrap();
            let (mut looked_at, mut passed) = (0, 0);
            for round in 16..32 {
                passed += pupil.strays(&lens, round * CHECKS..(round + 1) * CHECKS).len();
                looked_at += CHECKS;
            }
            assert_eq!(passed, 0, "{name}: of {looked_at}");
        }
    }

    #[test]
    fn a_bound_drawn_too_tight_is_widened() {
        let train = preset("double-gauss");
        let z = train.sensor_z(Focus::Infinity).unwrap();
        let lens = train.at(587.56).unwrap();
        let mut pupil = ExitPupil::new(&train, &[587.56], z, [18.0, 12.0]).unwrap();
        for reach in pupil.nodes.iter_mut().flat_map(|node| &mut node.reach) {
            *reach *= 0.95;
        }
        let before = pupil.strays(&lens, 0..CHECKS).len();
        pupil.widen_until_tight(&LensSplit::of(&train, vec![lens.clone()], 5));
        let after = pupil.strays(&lens, 20 * CHECKS..21 * CHECKS).len();
        assert!(before > 1000 && after * 100 < before, "{before} and then {after}");
    }

    #[test]
    fn an_error_names_what_blocks_the_light() {
        let closed = preset("double-gauss").with_stop_radius(0.0).unwrap();
        let z = closed.sensor_z(Focus::Infinity).unwrap();
        let error = ExitPupil::new(&closed, &[587.56], z, [18.0, 12.0]).unwrap_err();
        assert!(error.why().contains("past elements[5]"), "{error}");
        assert!(error.why().contains("vignetted at element 5"), "{error}");
        let open =
            LensFile::from_json(r#"{"elements": [{"type": "thin_lens", "focal_length": 9}]}"#);
        let open = open.unwrap().build(&|_: &str| Err(String::new())).unwrap();
        let error = ExitPupil::new(&open, &[587.56], 9.0, [1.0, 1.0]).unwrap_err();
        assert_eq!(error, unbounded());
    }
}
