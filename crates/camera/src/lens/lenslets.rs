//! A camera's lenslets: which of them a place on the sensor belongs to, and the ray through its middle.

use glam::{DVec2, DVec3};

use super::chief::ChiefTable;
use super::focused::Focused;
use crate::CameraError;
use etendue_optics::element::{Clip, Frame, Ray, RayStatus};
use etendue_optics::train::{BehindLenslets, MonochromaticTrain, OpticalTrain, Side};

/// The lenslets before a sensor, and the chief rays of the lens before them.
#[derive(Debug, Clone)]
pub struct LensletChiefs {
    view: BehindLenslets,
    sensor_z: f64,
    /// The plane of the array's front.
    plane: Frame,
    table: ChiefTable,
    main: MonochromaticTrain,
}

impl LensletChiefs {
    /// Solves chief rays over the array; `None` when the camera does not look through lenslets.
    pub(crate) fn new(focused: &Focused) -> Result<Option<Self>, CameraError> {
        Self::in_train(focused, focused.train())
    }

    fn in_train(focused: &Focused, train: &OpticalTrain) -> Result<Option<Self>, CameraError> {
        let Some(view) = train.behind_lenslets() else { return Ok(None) };
        let fault =
            |error: etendue_optics::glass::GlassError| CameraError::new("lens", error.to_string());
        let main = view.main.at(view.main.wavelength()).map_err(fault)?;
        let plane = Frame::on_axis(view.front_z);
        let array = view.array.radius() + view.decentre.length();
        let sensor = focused.film().half_size().length() * 1.5 + view.array.lattice.pitch;
        let half = DVec2::splat(array.min(sensor));
        let table = ChiefTable::new(&view.main, &plane, half, &main);
        Ok(Some(Self { view, sensor_z: focused.sensor_z(), plane, table, main }))
    }

    /// The same as light of a wavelength (nm) has it, of a lens that stands where it is.
    pub(crate) fn at(focused: &Focused, wavelength: f64) -> Result<Option<Self>, CameraError> {
        let fault =
            |error: etendue_optics::train::LensError| CameraError::new("lens", error.to_string());
        let train = focused.train().clone().with_wavelength(wavelength).map_err(fault)?;
        Self::in_train(focused, &train)
    }

    /// The lens before the array and the lenslets, to first order.
    #[must_use]
    pub fn view(&self) -> &BehindLenslets {
        &self.view
    }

    /// z of the sensor (mm).
    pub(crate) fn sensor_z(&self) -> f64 {
        self.sensor_z
    }

    /// The slopes of the chief ray of the lens before at a point of the array (mm), to within 10⁻⁹ mm of
    /// the stop's middle.
    #[must_use]
    pub fn chief_slopes(&self, at: DVec2) -> Option<DVec2> {
        let direction = self.table.direction((&self.view.main, &self.plane), &self.main, at)?;
        Some(-direction.truncate() / direction.z)
    }

    /// Where the chief ray of the lens before through a lenslet's middle meets the sensor (mm across the
    /// axis): the middle of the image that the lenslet makes of the opening.
    #[must_use]
    pub fn image_centre(&self, cell: [f64; 2]) -> Option<DVec2> {
        self.view.image_centre(cell, self.sensor_z, |at| self.chief_slopes(at))
    }

    /// The same to about a millionth of the way from pupil to array.
    #[must_use]
    pub fn image_centre_nearly(&self, cell: [f64; 2]) -> Option<DVec2> {
        self.view.image_centre(cell, self.sensor_z, |at| self.table.nearly(at))
    }

    /// The slope in front of a lenslet of the ray through its middle, per distance from there to the
    /// sensor's point (1/mm), and where it meets the rearmost array.
    #[must_use]
    pub fn central(&self) -> [f64; 2] {
        self.view.sight(0, self.sensor_z).central(self.view.principal_distance(0))
    }

    /// The cell of the lenslet that a point of the sensor (mm, in lens coordinates) belongs to.
    #[must_use]
    pub fn own_cell(&self, film: DVec3) -> Option<[f64; 2]> {
        self.view.own_cell(film, |at| self.table.nearly(at))
    }

    /// The direction from a point of the sensor (mm) through the middle of its own lenslet.
    #[must_use]
    pub(crate) fn direction(&self, film: DVec3) -> Option<DVec3> {
        let slopes = self.view.central_slopes(film, self.own_cell(film)?);
        Some(slopes.extend(-1.0).normalize())
    }

    /// The chief ray of the lens before through the middle of the lenslet that a point of the sensor (mm)
    /// belongs to, on the object's side: where the picture as a whole looks there.
    pub(crate) fn seen_from(&self, film: DVec3) -> Option<(DVec3, DVec3)> {
        let at = self.view.centre(self.own_cell(film)?);
        let direction = self.chief_slopes(at)?.extend(-1.0).normalize();
        let start = Ray::new(at.extend(self.view.front_z), direction)?;
        let end = self.main.run(Side::Sensor, Clip::Off, start);
        (end.status == RayStatus::Exited)
            .then(|| (end.ray.position.into(), end.ray.direction.into()))
    }
}
