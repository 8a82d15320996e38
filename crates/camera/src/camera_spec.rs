//! The closed set of cameras as a scene file writes them, and how one is built.

use std::sync::Arc;

use etendue_geometry::units::{Degrees, Metres};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::framing::Subject;
use crate::lens::CameraResources;
use crate::{
    Camera, CameraError, CameraMotionSpec, CameraTime, ChromaticRealLensCameraSpec, LensCameraSpec,
    LightFieldSpec, OrthographicSpec, PinholeSpec, Pose, PoseSpec, Projection, RealLensCameraSpec,
    SensorSpec, Shutter, ShutterSpec, ThinLensCameraSpec, Trajectory, ViewGrid,
};

/// Rows of the picture of a camera that comes without a resolution.
const DEFAULT_ROWS: u32 = 1024;

/// A camera as the scene file writes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum CameraSpec {
    /// Every ray passes through one point.
    Pinhole(PinholeSpec),
    /// All rays are parallel.
    Orthographic(OrthographicSpec),
    /// An ideal thin lens with an aperture.
    ThinLens(ThinLensCameraSpec),
    /// One thick spherical lens.
    RealLens(RealLensCameraSpec),
    /// One thick spherical lens that disperses.
    ChromaticRealLens(ChromaticRealLensCameraSpec),
    /// Any lens, by its file or in place.
    Lens(LensCameraSpec),
    /// A lens with an array of microlenses where its picture is: a plenoptic camera.
    LightField(LightFieldSpec),
    /// The views that the same camera takes, as an ideal lens has them, in one picture.
    LightFieldReference(LightFieldSpec),
}

/// Evaluates an expression for every kind of camera.
macro_rules! for_each_kind {
    ($camera:expr, $spec:ident => $value:expr) => {
        match $camera {
            Self::Pinhole($spec) => $value,
            Self::Orthographic($spec) => $value,
            Self::ThinLens($spec) => $value,
            Self::RealLens($spec) => $value,
            Self::ChromaticRealLens($spec) => $value,
            Self::Lens($spec) => $value,
            Self::LightField($spec) | Self::LightFieldReference($spec) => $value,
        }
    };
}

impl Default for CameraSpec {
    /// A pinhole that frames the scene.
    fn default() -> Self {
        Self::Pinhole(PinholeSpec::default())
    }
}

impl CameraSpec {
    /// A perspective camera by its vertical field of view (radians) and width-to-height ratio:
    /// 1024 rows, as many columns as the ratio asks for.
    #[must_use]
    pub fn perspective(pose: Pose, fov: f64, aspect: f64) -> Self {
        Self::Pinhole(PinholeSpec {
            fov: Some(Degrees(fov.to_degrees())),
            intrinsics: None,
            distortion: None,
            falloff: None,
            pose: Some(PoseSpec::from(pose)),
            shutter: None,
            motion: None,
            sensor: SensorSpec::new(resolution_of(aspect)),
        })
    }

    /// An orthographic camera by the height of its picture (m) and width-to-height ratio: 1024
    /// rows, as many columns as the ratio asks for.
    #[must_use]
    pub fn orthographic(pose: Pose, height: f64, aspect: f64) -> Self {
        Self::Orthographic(OrthographicSpec {
            height: Some(Metres(height)),
            pose: Some(PoseSpec::from(pose)),
            shutter: None,
            motion: None,
            sensor: SensorSpec::new(resolution_of(aspect)),
        })
    }

    /// The word behind `type` in the file.
    #[must_use]
    pub fn type_name(&self) -> &'static str {
        match self {
            Self::Pinhole(_) => "pinhole",
            Self::Orthographic(_) => "orthographic",
            Self::ThinLens(_) => "thin_lens",
            Self::RealLens(_) => "real_lens",
            Self::ChromaticRealLens(_) => "chromatic_real_lens",
            Self::Lens(_) => "lens",
            Self::LightField(_) => "light_field",
            Self::LightFieldReference(_) => "light_field_reference",
        }
    }

    /// True if the file gives the camera's pose.
    #[must_use]
    pub fn has_pose(&self) -> bool {
        for_each_kind!(self, spec => spec.pose.is_some()) || self.moves_through_poses()
    }

    /// Shutter, which says when rows are open, if the file gives one.
    #[must_use]
    pub fn shutter(&self) -> Option<&ShutterSpec> {
        for_each_kind!(self, spec => spec.shutter.as_ref())
    }

    /// Shutter of the specification, to be changed.
    pub fn shutter_mut(&mut self) -> &mut Option<ShutterSpec> {
        for_each_kind!(self, spec => &mut spec.shutter)
    }

    /// Motion of the camera, if the file gives one.
    #[must_use]
    pub fn motion(&self) -> Option<&CameraMotionSpec> {
        for_each_kind!(self, spec => spec.motion.as_ref())
    }

    /// Motion of the specification, to be changed.
    pub fn motion_mut(&mut self) -> &mut Option<CameraMotionSpec> {
        for_each_kind!(self, spec => &mut spec.motion)
    }

    fn pose_mut(&mut self) -> &mut Option<PoseSpec> {
        for_each_kind!(self, spec => &mut spec.pose)
    }

    fn moves_through_poses(&self) -> bool {
        matches!(self.motion(), Some(CameraMotionSpec::Poses { .. }))
    }

    /// The shutter, and the trajectory of a camera whose pose is its poses'.
    fn built_time(&self) -> Result<(Shutter, Option<Trajectory>), CameraError> {
        let shutter = self.shutter().cloned().unwrap_or_default();
        let shutter = shutter.build(self.sensor().resolution[1])?;
        if shutter.rows_differ() && matches!(self, Self::LightFieldReference(_)) {
            let why = "rows of a reference's views are no rows of a sensor, which are read one after another\
                       \nhint: set \"global\"";
            return Err(CameraError::new("shutter.type", why));
        }
        if !self.moves_through_poses() {
            return Ok((shutter, None));
        }
        if for_each_kind!(self, spec => spec.pose.is_some()) {
            let why = "is given beside `motion`, whose poses already say where the camera is\nhint: remove one";
            return Err(CameraError::new("pose", why));
        }
        let trajectory = self.motion().map(|motion| motion.build(None)).transpose()?;
        Ok((shutter, trajectory))
    }

    /// The sensor.
    #[must_use]
    pub fn sensor(&self) -> &SensorSpec {
        for_each_kind!(self, spec => &spec.sensor)
    }

    /// The sensor, to be changed.
    pub fn sensor_mut(&mut self) -> &mut SensorSpec {
        for_each_kind!(self, spec => &mut spec.sensor)
    }

    /// The camera. `subject` is what it may have to frame, or its box (m), asked for only when the
    /// file leaves the pose or the field to us. `resolve` turns paths that the camera names (lens
    /// files, masks) into paths to be opened, or says why not.
    ///
    /// # Errors
    ///
    /// When the description makes no camera: the error names the key.
    pub fn build<'a, S: Into<Subject<'a>>>(
        &self,
        subject: impl FnOnce() -> S,
        resolve: &dyn CameraResources,
    ) -> Result<Camera, CameraError> {
        self.sensor().check()?;
        if self.shutter().is_none() && self.motion().is_none() {
            return self.build_still(subject, resolve);
        }
        // The frame's pose is that at which data layers see the middle of the picture.
        let (shutter, trajectory) = self.built_time()?;
        let mut time = CameraTime {
            shutter,
            motion: None,
            trajectory: None,
            things_move: false,
            lights_change: false,
        };
        let middle = time.middle(self.sensor().resolution[1]);
        let mut still = self.clone();
        if let Some(trajectory) = &trajectory {
            *still.pose_mut() = Some(PoseSpec::from(trajectory.at(middle)));
        }
        let mut camera = still.build_still(subject, resolve)?;
        let trajectory = match (trajectory, self.motion()) {
            (None, Some(motion)) => Some(motion.build(Some(camera.pose))?),
            (trajectory, _) => trajectory,
        };
        if let Some(trajectory) = trajectory {
            camera.pose = trajectory.at(middle);
            let stands = trajectory.is_still(time.shutter.whole_span());
            time.motion = (!stands).then(|| trajectory.clone());
            time.trajectory = Some(trajectory);
        }
        if !camera.pose.is_finite() {
            return Err(CameraError::new("motion", "leads to where numbers end"));
        }
        camera.time = Some(Arc::new(time));
        Ok(camera)
    }

    fn build_still<'a, S: Into<Subject<'a>>>(
        &self,
        subject: impl FnOnce() -> S,
        resolve: &dyn CameraResources,
    ) -> Result<Camera, CameraError> {
        let subject = || subject().into();
        let (mut sensor, mut light_field) = (self.sensor().clone(), None);
        let lens = |(pose, lens)| (pose, Projection::Lens(Arc::new(lens)));
        // What each kind makes of its keys.
        let (pose, projection) = match self {
            Self::Pinhole(spec) => {
                let (pose, pinhole) = spec.build(subject)?;
                (pose, Projection::Pinhole(pinhole))
            }
            Self::Orthographic(spec) => {
                let (pose, orthographic) = spec.build(subject)?;
                (pose, Projection::Orthographic(orthographic))
            }
            Self::ThinLens(spec) => lens(spec.build(subject, resolve)?),
            Self::RealLens(spec) => lens(spec.build(subject, resolve)?),
            Self::ChromaticRealLens(spec) => lens(spec.build(subject, resolve)?),
            Self::Lens(spec) => lens(spec.build(subject, resolve)?),
            Self::LightField(spec) => {
                let (pose, lens, views) = spec.build(subject, resolve)?;
                light_field = Some(Arc::new(views));
                (pose, Projection::Lens(Arc::new(lens)))
            }
            Self::LightFieldReference(spec) => {
                let (pose, lens, views) = spec.build(subject, resolve)?;
                let grid = ViewGrid::new(&lens, &views)?;
                sensor = SensorSpec { resolution: grid.resolution(), pixel_pitch: None };
                sensor.check()?;
                light_field = Some(Arc::new(views));
                (pose, Projection::Views(Arc::new(grid)))
            }
        };
        if !pose.is_finite() {
            return Err(CameraError::new("pose", "no finite place frames a scene of this size"));
        }
        Ok(Camera { pose, sensor, projection, light_field, time: None })
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "rounded and clamped to what a sensor may have"
)]
fn resolution_of(aspect: f64) -> [u32; 2] {
    let columns = (f64::from(DEFAULT_ROWS) * aspect).round().clamp(1.0, 16_384.0);
    [columns as u32, DEFAULT_ROWS]
}
