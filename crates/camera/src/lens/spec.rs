//! The cameras with a lens as the scene file writes them, and the lens that each one is.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::focused::{FocusedLens, View, positive};
use super::keys::{is_zero, lens_camera_spec};
use super::lens_camera::LensCamera;
use super::source::{CameraResources, FocusDistance, LensSource, PlacedSpec, Setup, in_part};
use crate::framing::{self, FieldExtent, Subject};
use crate::{CameraError, CameraMotionSpec, Pose, PoseSpec, SensorSpec, ShutterSpec};
use etendue_geometry::units::{Degrees, Millimetres};
use etendue_optics::element::{
    ApertureSpec, ElementSpec, LossesSpec, PartSpec, SurfaceSpec, ThinLensSpec,
};
use etendue_optics::glass::GlassSpec;
use etendue_optics::train::{Focus, LensFile, OpticalTrain};

/// Distance (mm) by which parts on the axis reach behind the lens' last vertex at z = `rear`.
fn reach_behind(elements: &[PlacedSpec], rear: f64) -> f64 {
    elements.iter().map(|placed| placed.at.0 - rear).fold(0.0, f64::max)
}

/// Declares a camera by its own keys; those that all cameras with a lens have are added.
macro_rules! camera_with_a_lens {
    ($(#[$about:meta])* pub struct $name:ident { $($(#[$attribute:meta])* pub $key:ident: $kind:ty,)* }) => {
        lens_camera_spec! {
            $(#[$about])*
            pub struct $name {
                lens { $($(#[$attribute])* pub $key: $kind,)* }
                focus {
                    /// The distance of what is in focus (m, or "infinity"), along the axis from the entrance
                    /// pupil.
                    #[serde(default, skip_serializing_if = "Option::is_none")]
                    pub focus_distance: Option<FocusDistance>,
                    /// Instead of `focus_distance`: from the lens' last vertex to the sensor (mm).
                    #[serde(default, skip_serializing_if = "Option::is_none")]
                    pub sensor_distance: Option<Millimetres>,
                    /// The vertical field of view (degrees), when it is to give the size of the pixels.
                    #[serde(default, skip_serializing_if = "Option::is_none")]
                    pub fov: Option<Degrees>,
                    /// The height of all rows of the sensor (mm), when it is to give the size of the pixels.
                    #[serde(default, skip_serializing_if = "Option::is_none")]
                    pub sensor_height: Option<Millimetres>,
                    /// Turns the sensor about the x axis and then about its own y axis (degrees),
                    /// right-handed around its centre: Scheimpflug's rule.
                    #[serde(default, skip_serializing_if = "is_zero")]
                    pub sensor_tilt: [Degrees; 2],
                    /// Moves the sensor across the axis by x and y (mm): shift.
                    #[serde(default, skip_serializing_if = "is_zero")]
                    pub sensor_decentre: [Millimetres; 2],
                }
                light {
                    /// True if light of pictures is spread as waves are, by the lens' own point spread functions,
                    /// instead of as rays are.
                    #[serde(default, skip_serializing_if = "is_zero")]
                    pub diffraction: bool,
                }
                /// The grid of pixels.
                sensor
            }
        }

        impl $name {
            /// Setup that the camera has in common with the others.
            pub(crate) fn setup(&self) -> Result<Setup<'_>, CameraError> {
                let focus = match (self.focus_distance, self.sensor_distance) {
                    (Some(_), Some(_)) => {
                        return Err(CameraError::new(
                            "sensor_distance",
                            "is given beside `focus_distance`, which already fixes it\nhint: remove one \
                             of them",
                        ));
                    }
                    (Some(FocusDistance(distance)), None) => Some(Focus::Distance(distance)),
                    (None, Some(Millimetres(distance))) => Some(Focus::Sensor(distance)),
                    (None, None) => None,
                };
                Ok(Setup {
                    f_number: self.f_number,
                    focus,
                    fov: self.fov.map(|fov| fov.0),
                    sensor_height: self.sensor_height.map(|height| height.0),
                    sensor_tilt: self.sensor_tilt,
                    sensor_decentre: self.sensor_decentre,
                    losses: self.losses.clone(),
                    diffraction: self.diffraction,
                    pose: self.pose.as_ref(),
                    sensor: &self.sensor,
                })
            }
        }
    };
}

/// Gives a camera whose lens is made by `train` the rest of what makes a camera.
macro_rules! build_by_train {
    ($($name:ident),*) => {$(
        impl $name {
            pub(crate) fn build<'a>(
                &self,
                subject: impl FnOnce() -> Subject<'a>,
                resolve: &dyn CameraResources,
            ) -> Result<(Pose, LensCamera), CameraError> {
                let mut setup = self.setup()?;
                setup.measure_past(self.reach_behind());
                place(&self.train(resolve)?, &setup, subject)
            }
        }
    )*};
}

build_by_train!(RealLensCameraSpec, ChromaticRealLensCameraSpec, LensCameraSpec);

camera_with_a_lens! {
    /// An ideal thin lens: every plane is imaged without aberrations.
    pub struct ThinLensCameraSpec {
        /// The focal length (mm). When absent, `fov` and the size of the pixels give it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub focal_length: Option<Millimetres>,
        /// The opening in the lens, a circle by `f_number` when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub aperture: Option<ApertureSpec>,
        /// Apertures, filters and other parts in front of the lens and behind it.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        pub elements: Vec<PlacedSpec>,
    }
}

/// Declares a camera of one thick spherical lens by the key that says what glass it is.
macro_rules! camera_with_a_thick_lens {
    ($(#[$about:meta])* pub struct $name:ident { $(#[$glass_doc:meta])* pub $glass:ident: $kind:ty, }) => {
        camera_with_a_lens! {
            $(#[$about])*
            pub struct $name {
                /// Radius of the front surface (mm), positive when its centre is behind it, as on a
                /// lens that bulges towards the object; flat when absent.
                #[serde(default, skip_serializing_if = "Option::is_none")]
                pub front_radius: Option<Millimetres>,
                /// Radius of the rear surface (mm), negative when its centre is in front of it, as on
                /// a lens that bulges towards the sensor; flat when absent.
                #[serde(default, skip_serializing_if = "Option::is_none")]
                pub rear_radius: Option<Millimetres>,
                /// From vertex to vertex (mm).
                pub thickness: Millimetres,
                $(#[$glass_doc])*
                pub $glass: $kind,
                /// Half the lens' diameter (mm); unlimited when absent.
                #[serde(default, skip_serializing_if = "Option::is_none")]
                pub semi_diameter: Option<Millimetres>,
                /// Apertures, filters and other parts in front of the lens, in it and behind it.
                #[serde(default, skip_serializing_if = "Vec::is_empty")]
                pub elements: Vec<PlacedSpec>,
            }
        }
    };
}

camera_with_a_thick_lens! {
    /// One thick spherical lens of the same refractive index at all wavelengths.
    pub struct RealLensCameraSpec {
        /// The index of the glass.
        pub refractive_index: f64,
    }
}

camera_with_a_thick_lens! {
    /// One thick spherical lens of a glass that disperses.
    pub struct ChromaticRealLensCameraSpec {
        /// The glass: a name of the catalogue, or its dispersion.
        pub glass: GlassSpec,
    }
}

camera_with_a_lens! {
    /// Any lens.
    pub struct LensCameraSpec {
        /// A lens file's path, or the lens itself as such a file would have it.
        pub lens: LensSource,
    }
}

/// Focuses a lens and finds it a place.
pub(crate) fn place<'a>(
    train: &OpticalTrain,
    setup: &Setup<'_>,
    subject: impl FnOnce() -> Subject<'a>,
) -> Result<(Pose, LensCamera), CameraError> {
    let (pose, lens) = focused_at(train, setup, subject)?;
    Ok((pose, if setup.diffraction { lens.with_diffraction()? } else { lens }))
}

fn focused_at<'a>(
    train: &OpticalTrain,
    setup: &Setup<'_>,
    subject: impl FnOnce() -> Subject<'a>,
) -> Result<(Pose, LensCamera), CameraError> {
    let default = Focus::AsWritten;
    let focused = FocusedLens::new(train.clone(), setup, setup.focus.unwrap_or(default))?;
    if let Some(pose) = setup.pose {
        let pose = pose.build().map_err(|error| error.under("pose"))?;
        return Ok((pose, LensCamera::new(focused)?));
    }
    let subject = subject();
    let bounds = subject.bounds;
    let lens = LensCamera::new(focused)?;
    let pose = frame(subject, &lens, setup);
    if setup.focus.is_some() || bounds.is_empty() {
        return Ok((pose, lens));
    }
    // Focusing changes the field a little, and with it the distance: two rounds leave less than the
    // depth of any field.
    let (mut pose, mut lens) = (pose, lens);
    for _ in 0..2 {
        let distance = (bounds.centre() - pose.position).dot(pose.forward());
        let Ok(focused) = FocusedLens::new(train.clone(), setup, Focus::Distance(distance)) else {
            break;
        };
        lens = LensCamera::new(focused)?;
        pose = frame(subject, &lens, setup);
    }
    Ok((pose, lens))
}

/// The nearest place from which the whole box is in the picture.
fn frame(subject: Subject<'_>, lens: &LensCamera, setup: &Setup<'_>) -> Pose {
    match lens.focused().view() {
        View::Perspective(k) => {
            // 60° off the axis, as for distorted pinholes.
            let widest = 3_f64.sqrt();
            let size = setup.sensor.resolution.map(f64::from);
            let reach = FieldExtent::of_picture(size, k.centre, widest, |u, v| lens.tangents(u, v));
            framing::perspective(subject, reach)
        }
        View::Parallel { .. } => framing::orthographic(subject, setup.sensor.aspect()).0,
    }
}

/// A part and its place on the axis (mm).
type PlacedPart = (f64, ElementSpec);

impl ThinLensCameraSpec {
    pub(crate) fn build<'a>(
        &self,
        subject: impl FnOnce() -> Subject<'a>,
        resolve: &dyn CameraResources,
    ) -> Result<(Pose, LensCamera), CameraError> {
        let mut setup = self.setup()?;
        setup.measure_past(reach_behind(&self.elements, 0.0));
        let focal_length = match self.focal_length {
            Some(Millimetres(focal_length)) => focal_length,
            None => {
                let focal_length = self.focal_length_by_fov(&setup)?;
                setup.fov = None;
                focal_length
            }
        };
        place(&self.train(focal_length, resolve)?, &setup, subject)
    }

    /// The focal length (mm) that shows the rows of the sensor under the vertical field of view.
    fn focal_length_by_fov(&self, setup: &Setup<'_>) -> Result<f64, CameraError> {
        let Some(fov) = setup.fov else {
            let why = "is missing\nhint: give this, or `fov`";
            return Err(CameraError::new("focal_length", why));
        };
        if !(fov > 0.0 && fov < 180.0) {
            let why = format!("{fov} is outside 0 to 180 degrees (both excluded)");
            return Err(CameraError::new("fov", why));
        }
        let rows = f64::from(setup.sensor.resolution[1]);
        // The sensor's height, and the distance from which it fills the field of view.
        let height = match (setup.sensor.pixel_pitch, setup.sensor_height) {
            (Some(pitch), None) => 1e-3 * pitch.0 * rows,
            (None, height @ Some(_)) => positive(height, "sensor_height")?,
            (None, None) => {
                let why = "is missing: with `fov` alone the lens has no size\nhint: give this, \
                           `sensor.pixel_pitch` or `sensor_height`";
                return Err(CameraError::new("focal_length", why));
            }
            (Some(_), Some(_)) => {
                let why = "is given beside `sensor.pixel_pitch`\nhint: remove one of them";
                return Err(CameraError::new("sensor_height", why));
            }
        };
        let image = 0.5 * height / (0.5 * fov.to_radians()).tan();
        // That distance is the focal length at infinity, and the image's distance of anything
        // nearer.
        match setup.focus {
            None => Ok(image),
            Some(Focus::Distance(distance)) if distance > 0.0 => {
                Ok(1.0 / (1.0 / image + 1e-3 / distance))
            }
            Some(Focus::Distance(distance)) => {
                let why = format!("{distance} m is not above zero");
                Err(CameraError::new("focus_distance", why))
            }
            Some(_) => Err(CameraError::new(
                "focal_length",
                "is missing: beside `fov`, `sensor_distance` does not give it",
            )),
        }
    }

    /// The lens of the given focal length (mm).
    pub(crate) fn train(
        &self,
        focal_length: f64,
        resolve: &dyn CameraResources,
    ) -> Result<OpticalTrain, CameraError> {
        let aperture = self.aperture.as_ref();
        thin_lens(focal_length, aperture, self.f_number, &self.elements, resolve)
    }
}

/// The thin lens of the given focal length (mm) with an opening, or one that the f-number is to set, and the parts on
/// its axis.
pub(crate) fn thin_lens(
    focal_length: f64,
    aperture: Option<&ApertureSpec>,
    f_number: Option<f64>,
    elements: &[PlacedSpec],
    resolve: &dyn CameraResources,
) -> Result<OpticalTrain, CameraError> {
    if focal_length == 0.0 || !focal_length.is_finite() {
        let why = format!("{focal_length} mm is no focal length");
        return Err(CameraError::new("focal_length", why));
    }
    let has_opening = |e: &PlacedSpec| matches!(e.element.part, PartSpec::Aperture(_));
    let opening = match (aperture, f_number) {
        (Some(aperture), _) => Some(PartSpec::Aperture(aperture.clone())),
        // The f-number sets the radius.
        (None, Some(_)) if !elements.iter().any(|e| e.element.mount.stop) => {
            Some(PartSpec::circular(1.0))
        }
        (None, None) if !elements.iter().any(has_opening) => {
            return Err(CameraError::new(
                "f_number",
                "is missing: a thin lens needs an opening\nhint: give this, or `aperture`",
            ));
        }
        _ => None,
    };
    let lens = ThinLensSpec { focal_length: Millimetres(focal_length), semi_diameter: None };
    let lens = PartSpec::ThinLens(lens);
    let opening = opening.map(|part| (0.0, ElementSpec::new(part, 0.0).as_stop()));
    let lens = [(0.0, ElementSpec::new(lens, 0.0))];
    assemble(lens.into_iter().chain(opening).collect(), elements, resolve)
}

impl RealLensCameraSpec {
    fn reach_behind(&self) -> f64 {
        reach_behind(&self.elements, self.thickness.0)
    }

    fn train(&self, resolve: &dyn CameraResources) -> Result<OpticalTrain, CameraError> {
        if !(self.refractive_index > 0.0 && self.refractive_index.is_finite()) {
            let why = format!("{} is not above zero", self.refractive_index);
            return Err(CameraError::new("refractive_index", why));
        }
        let shape = Thick {
            radii: [self.front_radius, self.rear_radius],
            thickness: self.thickness,
            semi_diameter: self.semi_diameter,
        };
        shape.train(GlassSpec::Constant(self.refractive_index), &self.elements, resolve)
    }
}

impl ChromaticRealLensCameraSpec {
    fn reach_behind(&self) -> f64 {
        reach_behind(&self.elements, self.thickness.0)
    }

    fn train(&self, resolve: &dyn CameraResources) -> Result<OpticalTrain, CameraError> {
        let glass = self.glass.resolve_in(resolve.glasses());
        glass.map_err(|fault| CameraError::new("glass", fault.to_string()))?;
        let shape = Thick {
            radii: [self.front_radius, self.rear_radius],
            thickness: self.thickness,
            semi_diameter: self.semi_diameter,
        };
        shape.train(self.glass.clone(), &self.elements, resolve)
    }
}

impl LensCameraSpec {
    /// The lens' last vertex is that of its last element.
    fn reach_behind(&self) -> f64 {
        0.0
    }

    fn train(&self, resolve: &dyn CameraResources) -> Result<OpticalTrain, CameraError> {
        self.lens.read(resolve)
    }
}

/// A lens of two spherical surfaces.
struct Thick {
    radii: [Option<Millimetres>; 2],
    thickness: Millimetres,
    semi_diameter: Option<Millimetres>,
}

impl Thick {
    fn train(
        self,
        glass: GlassSpec,
        elements: &[PlacedSpec],
        resolve: &dyn CameraResources,
    ) -> Result<OpticalTrain, CameraError> {
        let keys = ["front_radius", "rear_radius"];
        let surfaces = self.radii.into_iter().zip([Some(glass), None]);
        let mut parts: Vec<PlacedPart> = Vec::new();
        for ((radius, glass), (at, key)) in
            surfaces.zip([0.0, self.thickness.0].into_iter().zip(keys))
        {
            let semi_diameter = self.semi_diameter;
            let spec = SurfaceSpec { radius, glass, semi_diameter, ..SurfaceSpec::default() };
            spec.build().map_err(|why| CameraError::new(key, why))?;
            parts.push((at, ElementSpec::new(PartSpec::Surface(spec), 0.0)));
        }
        if self.thickness.0 < 0.0 {
            let why = format!("{} mm is negative", self.thickness.0);
            return Err(CameraError::new("thickness", why));
        }
        assemble(parts, elements, resolve)
    }
}

/// The lens of `own` parts and of those that are put on its axis besides.
fn assemble(
    own: Vec<PlacedPart>,
    besides: &[PlacedSpec],
    resolve: &dyn CameraResources,
) -> Result<OpticalTrain, CameraError> {
    let mut parts = own;
    for (index, placed) in besides.iter().enumerate() {
        let Millimetres(at) = placed.at;
        // Alone first: a fault there is told by the part's number in the camera.
        let alone = LensFile::new(vec![placed.element.clone()]).build(resolve);
        alone.map_err(|fault| in_part(index, &fault))?;
        parts.push((at, placed.element.clone()));
    }
    parts.sort_by(|a, b| a.0.total_cmp(&b.0));
    let places: Vec<f64> = parts.iter().map(|part| part.0).collect();
    let mut elements: Vec<ElementSpec> = parts.into_iter().map(|part| part.1).collect();
    for (element, gap) in elements.iter_mut().zip(places.windows(2)) {
        element.mount.thickness = Millimetres(gap[1] - gap[0]);
    }
    let lens = LensFile::new(elements).build(resolve);
    lens.map_err(|fault| CameraError::new("elements", fault.to_string()))
}

/// The lens focused onto `sensor`, whose pixels have a pitch, at the world's origin.
pub(crate) fn alone(
    train: &OpticalTrain,
    focus: Focus,
    sensor: &SensorSpec,
) -> Result<(Pose, LensCamera), CameraError> {
    let setup = Setup {
        f_number: None,
        focus: None,
        fov: None,
        sensor_height: None,
        sensor_tilt: Default::default(),
        sensor_decentre: Default::default(),
        losses: train.losses().clone(),
        diffraction: false,
        pose: None,
        sensor,
    };
    let focused = FocusedLens::new(train.clone(), &setup, focus)?;
    Ok((Pose::IDENTITY, LensCamera::new(focused)?))
}
