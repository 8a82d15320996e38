//! Spreading of light on the sensor as waves: fields of the pupil by place of the picture, depth
//! and wavelength; and what of the light arrives there, which is the same as by rays.

use etendue_optics::analysis::between::{FieldSource, FieldsBetween};
use etendue_optics::analysis::{AnalysisError, ObjectPoint};
use etendue_optics::element::Part;
use etendue_optics::train::{MonochromaticTrain, OpticalTrain};
use etendue_spectrum::Bands;
use glam::{DMat3, DVec2, DVec3};

use super::focused::View;
use super::lens_camera::{LensCamera, SpreadBy};
use super::opened::uniform_filters;
use crate::{Camera, CameraError, CameraRays, FilmSamples};

/// Bands narrower than this are one wavelength (nm).
const NARROW: f64 = 1.0;

/// Nearer than this to 0, an object is at infinity (1/m).
const FAR: f64 = 1e-5;

impl LensCamera {
    /// True if the light of pictures is to be spread as waves are.
    #[must_use]
    pub fn diffracts(&self) -> bool {
        self.spread == SpreadBy::Waves
    }

    /// True if samples are rays of the whole pupil.
    pub(crate) fn has_spread_rays(&self) -> bool {
        self.spread != SpreadBy::Nothing
    }

    /// Returns the camera with its light spread as waves are.
    ///
    /// # Errors
    ///
    /// When there is no one wavefront, or no point that chief rays pass through.
    pub(crate) fn with_diffraction(self) -> Result<Self, CameraError> {
        let refused = |why: &str| Err(CameraError::new("diffraction", why));
        if let Some(element) = self.focused.train().first_array() {
            return refused(&format!(
                "elements[{element}] is a microlens array, behind which there is no one wavefront\
                 \nhint: leave out the array, or `diffraction`"
            ));
        }
        if let View::Parallel { .. } = self.focused.view() {
            return refused(
                "the lens is telecentric towards the object: its picture has no one point that it is \
                 seen from\nhint: leave out `diffraction`",
            );
        }
        Ok(self.spread_by(SpreadBy::Waves))
    }

    /// Returns the camera with its light spread by rays.
    pub(crate) fn without_diffraction(&self) -> Self {
        match self.spread {
            SpreadBy::Waves => self.clone().spread_by(SpreadBy::Rays),
            SpreadBy::Rays | SpreadBy::Nothing => self.clone(),
        }
    }

    /// Returns the camera along chief rays, on pixels a `finer`-th as large.
    pub(crate) fn along_chief_rays(&self, finer: f64) -> Self {
        let mut lens = self.coarser(1.0 / finer).spread_by(SpreadBy::Nothing);
        lens.opened = None;
        lens
    }

    /// The wavelength times the f-number on the axis (mm) at a wavelength (nm): the finest detail of an
    /// image. By the solid angle of the pupil before anything vignettes.
    #[must_use]
    pub fn airy_unit(&self, wavelength: f64) -> f64 {
        let numerical_aperture = (self.solid_angle / std::f64::consts::PI).sqrt();
        0.5e-6 * wavelength / numerical_aperture
    }

    /// True if the lens has no aberrations, and the greatest number of wavelengths that its fields are traced at.
    #[must_use]
    pub fn waves_to_trace(&self) -> (bool, usize) {
        let train = self.focused.train();
        let traced = self.accuracy.waves.wavelengths as usize;
        (is_ideal(train), if self.parts_wavelengths() { traced } else { 1 })
    }

    /// True if what arrives in a picture of so many columns and rows is the same on both sides of its middle, but for
    /// being seen in a mirror: the lens is round, and the picture's middle is on its axis.
    #[must_use]
    pub fn is_mirrored(&self, resolution: [u32; 2]) -> bool {
        let film = self.focused.film();
        let is_centred = film.frame.vertex.truncate() == DVec2::ZERO
            && film.frame.rotation == DMat3::IDENTITY
            && film.centre * 2.0 == DVec2::from(resolution.map(f64::from));
        self.focused.train().is_rotationally_symmetric() && is_centred
    }

    /// Waves of defocus (at the rim, at a wavelength in nm) of something whose nearness differs from
    /// the one in focus by 1/m.
    #[must_use]
    pub fn waves_of_defocus(&self, wavelength: f64) -> f64 {
        let diameter = self.focused.paraxial().entrance_pupil.diameter.unwrap_or(0.0);
        125.0 * diameter * diameter / wavelength
    }
}

fn is_ideal(train: &OpticalTrain) -> bool {
    train.elements().iter().all(|element| match &element.part {
        Part::ThinLens(_) | Part::Aperture(_) | Part::Filter(_) => true,
        Part::Surface(_)
        | Part::Biconic(_)
        | Part::MicrolensArray(_)
        | Part::Mirror(_)
        | Part::Freeform(_)
        | Part::CoordinateBreak(_) => false,
    })
}

/// A lens at the wavelengths of bands, to be asked for fields.
#[derive(Debug)]
pub struct WaveLens<'a> {
    camera: &'a LensCamera,
    train: OpticalTrain,
    lenses: Vec<MonochromaticTrain>,
    /// The wavelengths that each band stands for (nm).
    bands: Vec<Vec<f64>>,
}

impl<'a> WaveLens<'a> {
    /// The lens of a camera for `bands`.
    ///
    /// # Errors
    ///
    /// When a glass has no index.
    pub fn new(camera: &'a LensCamera, bands: &Bands) -> Result<Self, CameraError> {
        let train = camera.focused().train().clone();
        // Filters that are the same all over dim, and leave the field as it is.
        let uniform = uniform_filters(&train);
        let spread = |band: usize| bands.spread(band, &uniform).wavelengths;
        let by_band: Vec<Vec<f64>> = (0..bands.count()).map(spread).collect();
        let all = || by_band.iter().flatten().copied();
        let (low, high) =
            (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
        let disperses = camera.parts_wavelengths();
        let nodes = match disperses && high - low > NARROW {
            true => {
                let count = camera.accuracy.waves.wavelengths;
                let step = |k: u32| (high - low) * f64::from(k) / f64::from(count - 1);
                (0..count).map(|k| low + step(k)).collect()
            }
            false if disperses => vec![0.5 * (low + high)],
            false => vec![train.wavelength()],
        };
        let pass = |curve: &etendue_spectrum::Curve, nm: f64| match uniform.contains(&curve) {
            true => 1.0,
            false => curve.held(nm),
        };
        let at = |&nm: &f64| train.at_with(nm, &|curve| pass(curve, nm));
        let lenses = nodes.iter().map(at).collect::<Result<_, _>>();
        let lenses = lenses.map_err(|fault| CameraError::new("diffraction", fault.to_string()))?;
        drop(uniform);
        Ok(Self { camera, train, lenses, bands: by_band })
    }

    /// The wavelengths that each band stands for (nm).
    #[must_use]
    pub fn wavelengths(&self) -> &[Vec<f64>] {
        &self.bands
    }

    /// The fields of what a place of the picture (pixels from the corner) sees at distances whose inverses
    /// (1/m, from the entrance pupil along the axis) ascend. Nearnesses of the result are 1/mm along the
    /// axis, too.
    ///
    /// # Errors
    ///
    /// When no light arrives there, or the wavefront is too rough.
    pub fn fields(
        &self,
        [column, row]: [f64; 2],
        nearness: &[f64],
    ) -> Result<FieldsBetween, AnalysisError> {
        let film = self.camera.focused().film();
        let place = film.place(column, row);
        let dark = || AnalysisError::Dark { field: format!("pixel ({column:.1}, {row:.1})") };
        let (point, direction) = self.camera.chief_ray(place).ok_or_else(dark)?;
        let origin = self.camera.focused().origin();
        let object = |near: f64| {
            if near.abs() < FAR * 1e-3 {
                let angle = |slope: f64| slope.atan().to_degrees();
                let angles = [direction.x, direction.y].map(|d| angle(d / direction.z));
                return ObjectPoint::Infinity { angles };
            }
            let z = origin - 1.0 / near;
            ObjectPoint::Near { place: point + direction * ((z - point.z) / direction.z) }
        };
        let nearness: Vec<f64> = nearness.iter().map(|near| 1e-3 * near).collect();
        let image: DVec3 = film.frame.point(place.extend(0.0));
        FieldsBetween::new(&FieldSource {
            train: &self.train,
            lenses: &self.lenses,
            nearness: &nearness,
            object: &object,
            image,
            error: self.camera.accuracy.waves.error,
        })
    }

    /// True if the lens has no aberrations: nothing but ideal lenses, openings and filters.
    #[must_use]
    pub fn is_ideal(&self) -> bool {
        is_ideal(&self.train)
    }

    /// As [`LensCamera::is_mirrored`].
    #[must_use]
    pub fn is_mirrored(&self, resolution: [u32; 2]) -> bool {
        self.camera.is_mirrored(resolution)
    }

    /// −1 where the picture is turned on the sensor; else 1.
    #[must_use]
    pub fn turn(&self) -> f64 {
        self.camera.focused().turn()
    }
}

impl Camera {
    /// Relative illumination at places of the picture (pixels from the corner) for a radiance of 1 all over,
    /// by rays of a camera that was [opened](Self::opened), in one of its groups of bands: the mean weight of rays
    /// over the pupil, of which there are `across` a side.
    #[must_use]
    pub fn illumination(&self, places: &[[f64; 2]], group: usize, across: u32) -> Vec<f64> {
        let mut rays = CameraRays::default();
        let mut samples = FilmSamples { group, ..FilmSamples::default() };
        let mean = |&place: &[f64; 2]| {
            samples.clear();
            let share = |k: u32| (f64::from(k) + 0.5) / f64::from(across);
            for k in 0..across * across {
                // Every wavelength of the band with all parts of the pupil.
                let spectrum = (f64::from(k) * 0.618_033_988_749_895).fract();
                samples.push(place, [share(k % across), share(k / across)], spectrum);
            }
            self.sample_rays(&samples, &mut rays);
            rays.weight.iter().sum::<f64>() / f64::from(across * across)
        };
        places.iter().map(mean).collect()
    }
}
