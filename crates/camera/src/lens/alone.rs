//! A lens by itself as a camera.

use etendue_optics::train::{Focus, OpticalTrain};

use super::focused::Focused;
use super::lens_camera::LensCamera;
use super::source::Setup;
use crate::{CameraError, Pose, SensorSpec};

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
    let focused = Focused::new(train.clone(), &setup, focus)?;
    Ok((Pose::IDENTITY, LensCamera::new(focused)?))
}
