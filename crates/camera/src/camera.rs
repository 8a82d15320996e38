//! A camera ready to send rays: what cameras of all kinds can do.

use std::sync::Arc;

use etendue_geometry::RayBatch;
use etendue_spectrum::Bands;

use crate::lens::{self, LensAccuracy, focused::View};
use crate::{
    BandGroup, BandLandings, CameraError, CameraRays, CameraTime, Distortion, DistortionSpec,
    FilmSamples, Intrinsics, LensCamera, LightField, Orthographic, Pinhole, PinholeLanes,
    PixelBlock, Pose, SensorSpec, ViewGrid,
};
use etendue_geometry::units::Micrometres;
use etendue_optics::train::{Focus, OpticalTrain};

/// A camera ready to send rays.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    pub(crate) pose: Pose,
    pub(crate) sensor: SensorSpec,
    pub(crate) projection: Projection,
    pub(crate) light_field: Option<Arc<LightField>>,
    /// Its shutter and motion; `None` of a camera that stands still and is open all the time.
    pub(crate) time: Option<Arc<CameraTime>>,
}

/// Projection of a camera: how its rays run in its own frame.
#[derive(Debug, Clone, PartialEq)]
pub enum Projection {
    /// Through one point.
    Pinhole(Pinhole),
    /// In parallel.
    Orthographic(Orthographic),
    /// Through a lens.
    Lens(Arc<LensCamera>),
    /// From a grid of viewpoints, each in its own part of the picture.
    Views(Arc<ViewGrid>),
}

/// Extent of a pixel in the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PixelExtent {
    /// A side per distance along the axis, at its middle.
    Angle(f64),
    /// A side (m).
    Width(f64),
}

impl Camera {
    /// A lens by itself as a camera at the world's origin: focused, with a sensor whose pixels have a
    /// [pitch](SensorSpec::pixel_pitch).
    ///
    /// # Errors
    ///
    /// When the two make no camera: the error names the key that a scene would have.
    pub fn of_lens(
        train: &OpticalTrain,
        focus: Focus,
        sensor: SensorSpec,
    ) -> Result<Self, CameraError> {
        sensor.check()?;
        let (pose, lens) = lens::alone(train, focus, &sensor)?;
        let projection = Projection::Lens(Arc::new(lens));
        Ok(Self { pose, sensor, projection, light_field: None, time: None })
    }

    /// Columns and rows of the picture.
    #[must_use]
    pub fn resolution(&self) -> [u32; 2] {
        self.sensor.resolution
    }

    /// The views of a light-field camera.
    #[must_use]
    pub fn light_field(&self) -> Option<&LightField> {
        self.light_field.as_deref()
    }

    /// Reason why a light-field camera's picture holds no views; `None` of other cameras, of an
    /// ideal one, and where it does.
    #[must_use]
    pub fn no_views(&self) -> Option<&str> {
        self.lens()?;
        self.light_field()?.no_views.as_deref()
    }

    /// A light-field camera's views as an ideal lens has them.
    ///
    /// # Errors
    ///
    /// When the camera has no views, or they have no places.
    pub fn reference_views(&self) -> Result<Self, CameraError> {
        let none = || CameraError::new("type", "is no light_field: it has no views");
        let light_field = self.light_field.as_ref().ok_or_else(none)?;
        let lens = self.lens().ok_or_else(none)?;
        let grid = ViewGrid::new(lens, light_field)?;
        Ok(self.looking(grid))
    }

    /// Returns the light-field camera with other views.
    #[must_use]
    pub fn with_light_field(&self, light_field: LightField) -> Self {
        Self { light_field: Some(Arc::new(light_field)), ..self.clone() }
    }

    /// The middle view of a reference camera.
    #[must_use]
    pub fn central_view(&self) -> Option<Self> {
        match &self.projection {
            Projection::Views(views) => Some(self.looking(views.central())),
            Projection::Pinhole(_) | Projection::Orthographic(_) | Projection::Lens(_) => None,
        }
    }

    fn looking(&self, grid: ViewGrid) -> Self {
        let sensor = SensorSpec { resolution: grid.resolution(), pixel_pitch: None };
        let projection = Projection::Views(Arc::new(grid));
        Self { sensor, projection, ..self.clone() }
    }

    /// True if rays are spread over a pupil.
    #[must_use]
    pub fn has_pupil(&self) -> bool {
        match &self.projection {
            Projection::Lens(lens) => lens.has_spread_rays(),
            Projection::Views(_) => true,
            Projection::Pinhole(_) | Projection::Orthographic(_) => false,
        }
    }

    /// The projected solid angle (sr) that a pixel's value is relative to, of cameras with a pupil.
    #[must_use]
    pub fn pupil_solid_angle(&self) -> Option<f64> {
        match &self.projection {
            Projection::Lens(lens) => Some(lens.solid_angle()),
            Projection::Views(views) => Some(views.solid_angle()),
            Projection::Pinhole(_) | Projection::Orthographic(_) => None,
        }
    }

    /// From one pixel's centre to the next (µm): as the file says, or as the lens and its field of
    /// view make it.
    #[must_use]
    pub fn pixel_pitch(&self) -> Option<f64> {
        match &self.projection {
            Projection::Lens(lens) => Some(lens.focused().pixel_pitch()),
            Projection::Pinhole(_) | Projection::Orthographic(_) | Projection::Views(_) => {
                self.sensor.pixel_pitch.map(|pitch| pitch.0)
            }
        }
    }

    /// Extent of a pixel in the scene; `None` where the camera bends directions by more than a
    /// little (OpenCV's fisheye model).
    ///
    /// With a lens it is what the paraxial camera says: the cone from any point of the pupil over a
    /// pixel of the plane in focus.
    #[must_use]
    pub fn pixel_extent(&self) -> Option<PixelExtent> {
        let perspective =
            |k: Intrinsics| PixelExtent::Angle(1.0 / (k.focal[0] * k.focal[1]).sqrt());
        match &self.projection {
            Projection::Pinhole(pinhole) => {
                let bent = pinhole.distortion().map(Distortion::spec);
                let fisheye = matches!(bent, Some(DistortionSpec::Fisheye(_)));
                (!fisheye).then(|| perspective(pinhole.intrinsics()))
            }
            Projection::Orthographic(parallel) => {
                Some(PixelExtent::Width(parallel.metres_per_pixel()))
            }
            Projection::Views(views) => Some(PixelExtent::Angle(1.0 / views.focal_length())),
            Projection::Lens(lens) => Some(match lens.focused().view() {
                View::Perspective(k) => perspective(k),
                View::Parallel { metres_per_pixel, .. } => PixelExtent::Width(metres_per_pixel),
            }),
        }
    }

    /// The lens, if there is one.
    #[must_use]
    pub fn lens(&self) -> Option<&LensCamera> {
        match &self.projection {
            Projection::Lens(lens) => Some(lens),
            Projection::Pinhole(_) | Projection::Orthographic(_) | Projection::Views(_) => None,
        }
    }

    /// Groups of `bands` that have to be traced apart: all in one group unless the lens tells
    /// wavelengths apart and there are several bands.
    #[must_use]
    pub fn band_groups(&self, bands: &Bands) -> Vec<BandGroup> {
        match &self.projection {
            Projection::Lens(lens) => lens.band_groups(bands),
            Projection::Pinhole(_) | Projection::Orthographic(_) | Projection::Views(_) => {
                vec![BandGroup { bands: 0..bands.count(), wavelength: None }]
            }
        }
    }

    /// Returns the camera with rays of its lens that run as at the design wavelength in all bands:
    /// colours are neither displaced nor blurred by it.
    #[must_use]
    pub fn without_dispersion(&self) -> Self {
        let projection = match &self.projection {
            Projection::Lens(lens) => Projection::Lens(Arc::new(lens.without_dispersion())),
            other @ (Projection::Pinhole(_)
            | Projection::Orthographic(_)
            | Projection::Views(_)) => other.clone(),
        };
        Self { projection, ..self.clone() }
    }

    /// Returns the camera with rays of its lens that run together in `count` groups of neighbouring bands, at most;
    /// `None` where there is no lens that bends each its own way, or one that also dims each by its own share.
    #[must_use]
    pub fn with_bands_grouped(&self, count: usize) -> Option<Self> {
        let lens = self.lens()?.with_bands_grouped(count)?;
        Some(Self { projection: Projection::Lens(Arc::new(lens)), ..self.clone() })
    }

    /// Returns the camera with its lens measured by other numbers.
    #[must_use]
    pub fn with_lens_accuracy(&self, accuracy: LensAccuracy) -> Self {
        self.with_lens(|lens| lens.with_accuracy(accuracy))
    }

    /// Returns the camera, in its place and with its pixels, shutter and motion, whose rays run as those of `other`.
    #[must_use]
    pub fn seen_through(&self, other: &Self) -> Self {
        Self { projection: other.projection.clone(), ..self.clone() }
    }

    /// The camera with all measured that sampling its pupil for `bands` needs; to be done once,
    /// before [`Self::sample_rays`] is asked from many threads.
    ///
    /// # Errors
    ///
    /// When no light gets through at these wavelengths: the error names what blocks it.
    pub fn opened(&self, bands: &Bands) -> Result<Self, CameraError> {
        let projection = match &self.projection {
            Projection::Lens(lens) if lens.has_spread_rays() => {
                Projection::Lens(Arc::new(lens.opened(bands)?))
            }
            other @ (Projection::Lens(_)
            | Projection::Pinhole(_)
            | Projection::Orthographic(_)
            | Projection::Views(_)) => other.clone(),
        };
        Ok(Self { projection, ..self.clone() })
    }

    /// Opens the camera as [`opened`](Self::opened) does, with the filters of lens and lenslets clear.
    ///
    /// # Errors
    ///
    /// When no light gets through: the error names what blocks it.
    pub fn opened_clear(&self, bands: &Bands) -> Result<Self, CameraError> {
        let mut opened = self.clone();
        if let Projection::Lens(lens) = &self.projection {
            opened.projection = Projection::Lens(Arc::new(lens.opened_clear(bands)?));
        }
        Ok(opened)
    }

    /// Returns the view on pixels `factor` times as large, by rays alone. Columns and rows that do
    /// not fill a pixel are left out on the right and below, and at least one is left.
    #[must_use]
    pub fn coarser(&self, factor: u32) -> Self {
        let factor = factor.max(1);
        let times = f64::from(factor);
        let projection = match &self.projection {
            Projection::Pinhole(pinhole) => Projection::Pinhole(pinhole.coarser(times)),
            Projection::Orthographic(parallel) => Projection::Orthographic(parallel.coarser(times)),
            Projection::Lens(lens) => {
                Projection::Lens(Arc::new(lens.without_diffraction().coarser(times)))
            }
            Projection::Views(views) => Projection::Views(Arc::new(views.coarser(times))),
        };
        let sensor = SensorSpec {
            resolution: self.sensor.resolution.map(|side| (side / factor).max(1)),
            pixel_pitch: self.sensor.pixel_pitch.map(|pitch| Micrometres(pitch.0 * times)),
        };
        let time = self.time.as_ref().map(|time| {
            Arc::new(CameraTime { shutter: time.shutter.coarser(times), ..CameraTime::clone(time) })
        });
        Self { pose: self.pose, sensor, projection, light_field: self.light_field.clone(), time }
    }

    /// True if the light of its pictures is to be spread as waves are.
    #[must_use]
    pub fn diffracts(&self) -> bool {
        self.lens().is_some_and(LensCamera::diffracts)
    }

    /// Returns the camera with light spread by rays alone.
    #[must_use]
    pub fn without_diffraction(&self) -> Self {
        self.with_lens(LensCamera::without_diffraction)
    }

    /// Returns the camera with chief rays alone, and `finer` times as many columns and rows: what
    /// its lens shows before light is spread, at an illumination of 1 all over.
    #[must_use]
    pub fn along_chief_rays(&self, finer: u32) -> Self {
        let finer = finer.max(1);
        let camera = self.with_lens(|lens| lens.along_chief_rays(f64::from(finer)));
        let sensor = SensorSpec {
            resolution: self.sensor.resolution.map(|side| side.saturating_mul(finer)),
            pixel_pitch: self
                .sensor
                .pixel_pitch
                .map(|pitch| Micrometres(pitch.0 / f64::from(finer))),
        };
        Self { sensor, ..camera }
    }

    fn with_lens(&self, change: impl Fn(&LensCamera) -> LensCamera) -> Self {
        match &self.projection {
            Projection::Lens(lens) => {
                Self { projection: Projection::Lens(Arc::new(change(lens))), ..self.clone() }
            }
            Projection::Pinhole(_) | Projection::Orthographic(_) | Projection::Views(_) => {
                self.clone()
            }
        }
    }

    /// Place and axes. `z` depths are measured from its position along its forward axis.
    #[must_use]
    pub fn pose(&self) -> &Pose {
        &self.pose
    }

    /// Projection of the camera's rays.
    #[must_use]
    pub fn projection(&self) -> &Projection {
        &self.projection
    }

    /// The chief rays of the centres of a block of pixels, row by row: `rays` is refilled.
    ///
    /// Directions have length 1; origins are the entrance pupil, or lie in the plane through the
    /// camera's origin for parallel rays.
    pub fn chief_rays(&self, block: PixelBlock, rays: &mut RayBatch) {
        rays.reset(block.len());
        rays.coherent = true;
        let [columns, rows, _] = rays.arrays_mut().directions;
        for (((column, row), u), v) in block.pixels().zip(columns).zip(rows) {
            *u = f64::from(column) + 0.5;
            *v = f64::from(row) + 0.5;
        }
        self.aim(rays);
        if self.is_timed() {
            let rows: Vec<f64> = block.pixels().map(|(_, row)| f64::from(row) + 0.5).collect();
            self.carry_chief(&rows, rays);
        }
    }

    /// The chief rays of given places on the sensor: column and row coordinates (pixels) counted
    /// from the outer corner of the top left pixel, whose centre is (0.5, 0.5). `rays` is refilled;
    /// a longer array's surplus is left out.
    pub fn rays_through(&self, columns: &[f64], rows: &[f64], rays: &mut RayBatch) {
        self.rays_at(columns, rows, rays);
        self.carry_chief(rows, rays);
    }

    /// Sets up the rays of a camera that stands in the frame's pose.
    fn rays_at(&self, columns: &[f64], rows: &[f64], rays: &mut RayBatch) {
        let len = columns.len().min(rows.len());
        rays.reset(len);
        rays.coherent = true;
        let [x, y, _] = rays.arrays_mut().directions;
        x.copy_from_slice(&columns[..len]);
        y.copy_from_slice(&rows[..len]);
        self.aim(rays);
    }

    /// The rays of `samples` that leave the camera, each with its weight: `out` is refilled.
    ///
    /// Places that a distorted camera does not see have no ray.
    ///
    /// # Panics
    ///
    /// When a camera with a lens was not [opened](Self::opened), or has no such
    /// [group](FilmSamples::group) of the bands that it was opened for.
    pub fn sample_rays(&self, samples: &FilmSamples, out: &mut CameraRays) {
        self.sample_still(samples, out);
        self.carry_samples(samples, out);
    }

    fn sample_still(&self, samples: &FilmSamples, out: &mut CameraRays) {
        if let Projection::Lens(lens) = &self.projection
            && lens.has_spread_rays()
        {
            return lens.sample_rays(&self.pose, samples, out);
        }
        if let Projection::Views(views) = &self.projection {
            return views.sample_rays(&self.pose, samples, out);
        }
        self.rays_at(&samples.columns, &samples.rows, &mut out.rays);
        out.sample.clear();
        out.sample.extend(0..u32::try_from(samples.len()).unwrap_or(u32::MAX));
        out.drop_unseen();
        out.weight.clear();
        out.weight.resize(out.rays.len(), 1.0);
        if let Projection::Pinhole(pinhole) = &self.projection {
            for (weight, &sample) in out.weight.iter_mut().zip(&out.sample) {
                let i = sample as usize;
                *weight = pinhole.light_at([samples.columns[i], samples.rows[i]]);
            }
        }
    }

    /// The rays of `samples` that all bands share behind a lens that tells wavelengths apart, and where the
    /// light of each band lands: both are refilled.
    ///
    /// # Panics
    ///
    /// When the camera has no lens, or one whose bands do not share rays as it was
    /// [opened](LensCamera::opened_paths).
    pub fn sample_band_rays(
        &self,
        samples: &FilmSamples,
        out: &mut CameraRays,
        landings: &mut BandLandings,
    ) {
        let lens = self.lens().expect("bands share rays behind lenses");
        lens.sample_band_rays(&self.pose, self.resolution(), samples, out, landings);
        self.carry_samples(samples, out);
    }

    /// The camera in single precision, where its rays are straight, start in one point at one time, and count alike.
    #[must_use]
    pub fn pinhole_lanes(&self) -> Option<PinholeLanes> {
        match &self.projection {
            Projection::Pinhole(pinhole) if self.time.is_none() => {
                pinhole.lanes(&self.pose, self.resolution())
            }
            _ => None,
        }
    }

    fn aim(&self, rays: &mut RayBatch) {
        match &self.projection {
            Projection::Pinhole(pinhole) => pinhole.aim(&self.pose, rays),
            Projection::Orthographic(orthographic) => orthographic.aim(&self.pose, rays),
            Projection::Lens(lens) => lens.aim(&self.pose, rays),
            Projection::Views(views) => views.aim(&self.pose, rays),
        }
    }
}
