//! The light-field cameras as the scene file writes them.
//!
//! Distances that are not written follow from f-numbers. With p the pitch, D from the exit pupil to the
//! array and d the exit pupil's diameter, images of the pupil through neighbouring lenslets touch at
//! b = p D/(d − p) behind the array; lenslets of focal length f see a plane at a in front of them sharp at
//! 1/b = 1/f − 1/a, and stand in the lens' picture (a = 0) when b = f.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::LightField;
use crate::framing::Subject;
use crate::lens::keys::{is_zero, lens_camera_spec};
use crate::lens::source::{FocusDistance, PlacedSpec, Setup, in_camera};
use crate::lens::spec::{place, thin_lens};
use crate::lens::{CameraResources, LensCamera, LensSource};
use crate::{CameraError, Pose, PoseSpec, SensorSpec};
use crate::{CameraMotionSpec, ShutterSpec};
use etendue_geometry::units::{Degrees, Millimetres};
use etendue_optics::element::{
    ApertureSpec, ElementSpec, Gaps, Grid, LensletShape, LensletSpec, LossesSpec,
    MicrolensArraySpec, PartSpec,
};
use etendue_optics::glass::GlassSpec;
use etendue_optics::train::{Focus, LensFile, OpticalTrain};
use etendue_spectrum::Curve;

lens_camera_spec! {
    /// A lens, lenslets and a sensor; or, as a reference, the views that these have.
    pub struct LightFieldSpec {
        lens {
            /// The focal length of an ideal thin main lens (mm).
            #[serde(default, skip_serializing_if = "Option::is_none")]
            pub focal_length: Option<Millimetres>,
            /// Instead: a lens file's path, or the lens itself as such a file would have it.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            pub lens: Option<LensSource>,
            /// The opening in a thin main lens, a circle by `f_number` when absent.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            pub aperture: Option<ApertureSpec>,
            /// Apertures, filters and other parts in front of a thin main lens and behind it.
            #[serde(default, skip_serializing_if = "Vec::is_empty")]
            pub elements: Vec<PlacedSpec>,
        }
        focus {
            /// The distance of what the lenslets see sharp (m, or "infinity"), along the axis from the entrance
            /// pupil; infinity when absent and the camera has a pose.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            pub focus_distance: Option<FocusDistance>,
            /// The distance at which `refocused.*` is sharp (m, or "infinity"), along the axis from the entrance pupil: by
            /// all views together, or of a focused camera by patches of the raw picture, where it is `focus_distance` when
            /// absent.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            pub refocus_distance: Option<FocusDistance>,
            /// The lenslets.
            pub microlenses: MicrolensesSpec,
            /// Views along each side of the light field; as many as the opening holds in a square when absent.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            pub views: Option<u32>,
            /// From one view to the next on the sensor (pixels); 1 when absent.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            pub view_step: Option<f64>,
        }
        light {
            /// The height of all rows of the sensor (mm), instead of `sensor.pixel_pitch`.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            pub sensor_height: Option<Millimetres>,
        }
        /// The grid of pixels of the sensor behind the lenslets.
        sensor
    }
}

fn one() -> f64 {
    1.0
}

/// The lenslets of a light-field camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MicrolensesSpec {
    /// From a lenslet's centre to its next neighbour's (mm).
    pub pitch: Millimetres,
    /// Square when absent.
    #[serde(default)]
    pub grid: Grid,
    /// Turn of the rows about the axis from +x towards +y of the lens (degrees).
    #[serde(default)]
    pub rotation: Degrees,
    /// Centre of a lenslet (mm from the axis).
    #[serde(default)]
    pub offset: [Millimetres; 2],
    /// Width and height of the array (mm); a little more than the sensor's when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size: Option<[Millimetres; 2]>,
    /// The shape of a lenslet's opening: that of a cell when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub aperture: Option<LensletShape>,
    /// The width of an opening from flat to flat, as a share of the pitch.
    #[serde(default = "one")]
    pub fill: f64,
    /// Gaps between openings: opaque when absent.
    #[serde(default)]
    pub gaps: Gaps,
    /// The focal length of thin lenslets (mm).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub focal_length: Option<Millimetres>,
    /// Instead: the distance to the sensor over the pitch. When neither is given, the images of the main
    /// lens' opening just touch.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub f_number: Option<f64>,
    /// Thick lenslets: radii of their front and rear faces (mm), positive when the centre lies on the
    /// sensor's side; `null` for a flat one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radii: Option<[Option<Millimetres>; 2]>,
    /// From the front vertex to the rear one of thick lenslets (mm).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub thickness: Option<Millimetres>,
    /// Glass of thick lenslets.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub glass: Option<GlassSpec>,
    /// A filter on each lenslet: the share of light that passes (0..=1) by wavelength.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub transmission: Option<Curve>,
    /// Thin lenslets of several types: what differs of each. Distances follow from the first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub types: Vec<LensletSpec>,
    /// Types by place, as of a `microlens_array`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub pattern: Vec<Vec<u32>>,
    /// From the array's last vertex to the sensor (mm); so that the sensor is in focus when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sensor_distance: Option<Millimetres>,
    /// Distance from the array to the main lens' picture in front of it that the lenslets see (mm), negative for
    /// one behind it; 0, in the array itself, when absent.
    #[serde(default)]
    pub picture_distance: Millimetres,
}

/// The lens before the array and what its opening is as seen from there.
struct Main {
    train: OpticalTrain,
    /// z of its picture of what is in focus (mm).
    picture_z: f64,
    /// From the exit pupil to the array, and the pupil's diameter (mm).
    distance: f64,
    diameter: f64,
}

impl LightFieldSpec {
    pub(crate) fn build<'a>(
        &self,
        subject: impl FnOnce() -> Subject<'a>,
        resolve: &dyn CameraResources,
    ) -> Result<(Pose, LensCamera, LightField), CameraError> {
        let main = self.main(resolve)?;
        let train = self.microlenses.behind(&main, self.sensor_size()?)?;
        let focus = match (&self.pose, &self.focus_distance) {
            (_, Some(FocusDistance(distance))) => Some(Focus::Distance(*distance)),
            (Some(_), None) => Some(Focus::Distance(f64::INFINITY)),
            (None, None) => None,
        };
        let setup = Setup {
            f_number: None,
            focus,
            fov: None,
            sensor_height: self.sensor_height.map(|height| height.0),
            sensor_tilt: [Degrees(0.0); 2],
            sensor_decentre: [Millimetres(0.0); 2],
            losses: self.losses.clone(),
            diffraction: false,
            pose: self.pose.as_ref(),
            sensor: &self.sensor,
        };
        let (pose, lens) = place(&train, &setup, subject)?;
        let mut light_field =
            LightField::new(&lens, self.sensor.resolution, self.views, self.view_step)?;
        light_field.refocus = self.refocus_distance.map(|distance| distance.0);
        if let (Some(distance), Some(lenslets)) = (light_field.refocus, lens.lenslets()) {
            let picture = lenslets.view().main.sensor_z(Focus::Distance(distance));
            picture.map_err(|fault| CameraError::new("refocus_distance", fault.to_string()))?;
        }
        Ok((pose, lens, light_field))
    }

    /// The main lens with its stop set, and its picture of what is in focus.
    fn main(&self, resolve: &dyn CameraResources) -> Result<Main, CameraError> {
        // A thin lens with what stands around it, or a lens from its file; its stop set.
        let train = match (&self.focal_length, &self.lens) {
            (Some(Millimetres(focal_length)), None) => {
                let aperture = self.aperture.as_ref();
                thin_lens(*focal_length, aperture, self.f_number, &self.elements, resolve)?
            }
            (None, Some(lens)) if self.aperture.is_none() && self.elements.is_empty() => {
                lens.read(resolve)?
            }
            (None, Some(_)) => {
                let key = if self.aperture.is_some() { "aperture" } else { "elements" };
                let why = "belongs to a `focal_length`; a `lens` has its own in its file";
                return Err(CameraError::new(key, why));
            }
            _ => {
                let why = "give the main lens a `focal_length`, or a `lens`, and not both";
                return Err(CameraError::new("focal_length", why));
            }
        };
        let train = match self.f_number {
            Some(f_number) => train.with_f_number(f_number).map_err(|fault| {
                CameraError::new("f_number", format!("{f_number} cannot be set: {fault}"))
            })?,
            None => train,
        };
        if train.first_array().is_some() {
            let why = "has a microlens array already; the camera `lens` takes such a lens";
            return Err(CameraError::new("lens", why));
        }
        // Where its picture is, and its exit pupil as the lenslets see it.
        let focus = self.focus_distance.map_or(f64::INFINITY, |distance| distance.0);
        let picture_z = train
            .sensor_z(Focus::Distance(focus))
            .map_err(|fault| CameraError::new("focus_distance", fault.to_string()))?;
        let pupil = train
            .paraxial(train.wavelength())
            .map_err(|fault| CameraError::new("lens", fault.to_string()))?
            .exit_pupil;
        let (Some(z), Some(diameter)) = (pupil.z, pupil.diameter) else {
            let why = "the main lens has no exit pupil of finite place and size (it is telecentric \
                       towards its picture, or nothing limits it): lenslets make no images of it";
            return Err(CameraError::new(
                if self.lens.is_some() { "lens" } else { "f_number" },
                why,
            ));
        };
        let distance = picture_z + self.microlenses.picture_distance.0 - z;
        Ok(Main { train, picture_z, distance, diameter })
    }

    /// Width and height of the sensor (mm).
    fn sensor_size(&self) -> Result<[f64; 2], CameraError> {
        let [columns, rows] = self.sensor.resolution.map(f64::from);
        match (self.sensor.pixel_pitch, self.sensor_height) {
            (Some(pitch), None) => Ok([columns, rows].map(|side| 1e-3 * pitch.0 * side)),
            (None, Some(Millimetres(height))) => Ok([height * columns / rows, height]),
            (None, None) => {
                let why = "is missing: behind lenslets the size of the pixels matters\nhint: give this, or \
                           `sensor_height`";
                Err(CameraError::new("sensor.pixel_pitch", why))
            }
            (Some(_), Some(_)) => {
                let why = "is given beside `sensor.pixel_pitch`\nhint: remove one of them";
                Err(CameraError::new("sensor_height", why))
            }
        }
    }
}

impl MicrolensesSpec {
    /// The main lens with the lenslets behind it, and the sensor behind these.
    fn behind(&self, main: &Main, sensor: [f64; 2]) -> Result<OpticalTrain, CameraError> {
        let fault = |key: &str, why: String| CameraError::new(format!("microlenses.{key}"), why);
        let Millimetres(picture) = self.picture_distance;
        let pitch = self.pitch.0;
        if !(pitch > 0.0 && pitch.is_finite()) {
            return Err(fault("pitch", format!("{pitch} mm is not above zero")));
        }
        if !picture.is_finite() || main.distance <= 0.0 {
            let why = format!("{picture} mm puts the array before the main lens' exit pupil");
            return Err(fault("picture_distance", why));
        }
        // Light from the picture to a lenslet's rim would run at more than 45 degrees.
        if picture != 0.0 && 2.0 * picture.abs() < pitch {
            let why = format!(
                "{picture} mm is less than half the pitch of {pitch} mm: no lenslet images a picture so near\
                 \nhint: give a picture farther away, or 0 for an unfocused camera"
            );
            return Err(fault("picture_distance", why));
        }
        if let Some(Millimetres(b)) = self.sensor_distance
            && !(b > 0.0 && b.is_finite())
        {
            return Err(fault("sensor_distance", format!("{b} mm is not above zero")));
        }
        // The array by itself, then where it stands behind the main lens.
        let elements = self.elements(main, sensor)?;
        let file = LensFile::new(elements);
        let rear = file
            .build(&|name: &str| Err(format!("{name}: lenslets have no files")))
            .map_err(|error| in_camera("microlenses", &error))?;
        let gap = main.picture_z + picture - main.train.last_vertex();
        if gap <= 0.0 {
            let why = format!(
                "the array would stand {gap:.3} mm behind the last vertex of the main lens"
            );
            return Err(fault("picture_distance", why));
        }
        let train = main.train.clone().followed_by(&rear, gap);
        let Some(view) = train.behind_lenslets() else {
            let why = "lenslets need a main lens before them whose stop is in it".to_owned();
            return Err(fault("pitch", why));
        };
        // The sensor stands where it is told to, or where the lenslets see sharp.
        let distance = match self.sensor_distance {
            Some(Millimetres(distance)) => distance,
            None => view.sensor_distance(picture),
        };
        if !(distance > 0.0 && distance.is_finite()) {
            let why = format!(
                "is {distance:.4} mm by the lenslets' focal length of {:.4} mm and a picture {picture} mm \
                 in front of them: it must be above zero\nhint: give a picture farther away than the focal length, or \
                 lenslets that gather light and are thinner than their focal length",
                view.focal_length(0)
            );
            return Err(fault("sensor_distance", why));
        }
        Ok(train.with_end(distance))
    }

    /// The array as elements of a lens.
    fn elements(&self, main: &Main, sensor: [f64; 2]) -> Result<Vec<ElementSpec>, CameraError> {
        let size = self
            .size
            .unwrap_or_else(|| sensor.map(|side| Millimetres(side * 1.05 + 4.0 * self.pitch.0)));
        let thin = MicrolensArraySpec {
            size,
            pitch: self.pitch,
            grid: self.grid,
            rotation: self.rotation,
            offset: self.offset,
            aperture: self.aperture,
            fill: self.fill,
            gaps: self.gaps,
            focal_length: None,
            radius: None,
            conic: 0.0,
            glass: None,
            transmission: self.transmission.clone(),
            types: self.types.clone(),
            pattern: self.pattern.clone(),
        };
        // Thin lenslets are one array.
        let Some([front, rear]) = self.radii else {
            let focal_length = match (self.focal_length, self.types.first()) {
                (None, Some(first)) if first.focal_length.is_some() => first.focal_length,
                _ => Some(Millimetres(self.thin_focal_length(main)?)),
            };
            let array = MicrolensArraySpec { focal_length, ..thin };
            return Ok(vec![ElementSpec::new(PartSpec::MicrolensArray(array), 0.0)]);
        };
        // Thick ones are two, with glass between them; a filter stands on the first face.
        let lacks =
            |key: &str| CameraError::new(format!("microlenses.{key}"), "is missing beside `radii`");
        let thickness = self.thickness.ok_or_else(|| lacks("thickness"))?.0;
        let glass = self.glass.clone().ok_or_else(|| lacks("glass"))?;
        if self.focal_length.is_some() || self.f_number.is_some() || !self.types.is_empty() {
            let why = "gives thick lenslets, which have no `focal_length`, `f_number` or `types`\nhint: remove \
                       those, or `radii`";
            return Err(CameraError::new("microlenses.radii", why));
        }
        if front.is_none() && rear.is_none() {
            let why = "are both flat: such lenslets bend no light\nhint: give one face a radius";
            return Err(CameraError::new("microlenses.radii", why));
        }
        let face = |radius: Option<Millimetres>, glass: Option<GlassSpec>, first: bool| match radius
        {
            Some(radius) => {
                let transmission = thin.transmission.clone().filter(|_| first);
                let face = MicrolensArraySpec {
                    radius: Some(radius),
                    glass,
                    transmission,
                    ..thin.clone()
                };
                PartSpec::MicrolensArray(face)
            }
            None => PartSpec::spherical(f64::INFINITY, glass, f64::INFINITY),
        };
        let first = front.is_some();
        Ok(vec![
            ElementSpec::new(face(front, Some(glass), first), thickness),
            ElementSpec::new(face(rear, None, !first), 0.0),
        ])
    }

    /// The focal length of thin lenslets (mm), as written, by their f-number, or so that the images of the
    /// main lens' opening touch.
    fn thin_focal_length(&self, main: &Main) -> Result<f64, CameraError> {
        let Millimetres(picture) = self.picture_distance;
        let pitch = self.pitch.0;
        // The distance of the sensor that a focal length is to go with.
        let distance = match (self.focal_length, self.f_number, self.sensor_distance) {
            (Some(_), Some(_), _) => {
                let why = "is given beside `focal_length`\nhint: remove one of them";
                return Err(CameraError::new("microlenses.f_number", why));
            }
            (Some(Millimetres(focal_length)), None, _) => return Ok(focal_length),
            (None, Some(f_number), None) if f_number > 0.0 && f_number.is_finite() => {
                f_number * pitch
            }
            (None, Some(f_number), None) => {
                let why = format!("{f_number} is not above zero");
                return Err(CameraError::new("microlenses.f_number", why));
            }
            (None, Some(_), Some(_)) => {
                let why =
                    "is given beside `sensor_distance`, which fixes it\nhint: remove one of them";
                return Err(CameraError::new("microlenses.f_number", why));
            }
            (None, None, Some(Millimetres(distance))) => distance,
            (None, None, None) if main.diameter > pitch => {
                pitch * main.distance / (main.diameter - pitch)
            }
            (None, None, None) => {
                let why = format!(
                    "{pitch} mm is more than the main lens' exit pupil of {:.4} mm",
                    main.diameter
                );
                return Err(CameraError::new("microlenses.pitch", why));
            }
        };
        // A picture in front of the array or behind it is focused on the sensor (1/f = 1/a + 1/b).
        let power = 1.0 / distance + if picture == 0.0 { 0.0 } else { 1.0 / picture };
        Ok(1.0 / power)
    }
}
