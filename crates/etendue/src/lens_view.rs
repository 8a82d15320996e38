//! A camera's lens, to be looked at: its section, its figures, and rays through it.

use std::path::Path;

use etendue_optics::train::drawing::Section;
use etendue_optics::train::{Focus, Inquiry, LensReport};
use etendue_scene::Reach;
use etendue_scene::file::read_lens;
use serde_json::Value;

use crate::{Error, Inspector};

/// What is known of a camera's lens.
#[derive(Debug, Clone)]
pub struct LensView {
    /// Its figures: first-order data, spots, distortion, illumination.
    pub report: LensReport,
    /// The lens cut along its axis.
    pub section: Section,
}

impl Inspector {
    /// The lens of the camera as it is focused; `None` for a camera without one.
    ///
    /// # Errors
    ///
    /// When a glass has no index at a wavelength of the report.
    pub fn lens(&self) -> Result<Option<LensView>, Error> {
        let Some(lens) = self.scene().camera.lens() else { return Ok(None) };
        let focused = lens.focused();
        let (train, distance) =
            (focused.train(), focused.sensor_z() - focused.train().last_vertex());
        let focus = if distance > 0.0 { Focus::Sensor(distance) } else { Focus::AsWritten };
        let refused = |why: String| Error::Refused(format!("camera.lens: {why}"));
        let report = LensReport::new(train, &Inquiry { focus, ..Inquiry::default() })
            .map_err(|error| refused(error.to_string()))?;
        let section = Section::new(train, &report).map_err(|error| refused(error.to_string()))?;
        Ok(Some(LensView { report, section }))
    }

    /// Rays of a place of the picture (pixels) through the lens, as lines of points (z, height over the axis)
    /// in lens coordinates (mm) from the sensor on: see
    /// [`LensCamera::paths`](etendue_camera::LensCamera::paths). None without a lens.
    #[must_use]
    pub fn ray_paths(&self, place: [f64; 2], count: u32) -> Vec<Vec<[f64; 2]>> {
        self.scene().camera.lens().map(|lens| lens.paths(place, count)).unwrap_or_default()
    }
}

/// The lens file at `path`, which a scene may also hold in its place, to be changed there.
///
/// # Errors
///
/// When it cannot be read.
pub fn lens_values(path: &Path) -> Result<Value, Error> {
    let lens = read_lens(path, Reach::Anywhere)?;
    let file =
        lens.file.ok_or_else(|| Error::Refused(format!("{}: is no lens file", path.display())))?;
    serde_json::to_value(file).map_err(|error| Error::Refused(error.to_string()))
}
