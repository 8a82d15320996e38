//! The reference: the light field that a light-field camera would take, were its lenslets points without
//! size on the sensor's side: every view as an ideal lens has it, side by side.
//!
//! A sample of a pixel draws a point a of its lenslet's opening and a viewpoint u of its part of the
//! entrance pupil; its ray leaves u towards the image of a, at the distance F on which the array's plane is
//! imaged: the point (−a/S, −1) F in the camera's frame, with S as in [`super`]. A point at depth z stands
//! from one view to the next by −B S/p (1/z − 1/F) columns further right, with B the viewpoint's step and p
//! the pitch: its disparity is B S/p (1/z − 1/F), positive in front of F.
//!
//! A pixel's value is that of the lens: cos⁴ of the angle on the array's side, and what the stop passes.

use std::sync::Arc;

use etendue_geometry::{RayBatch, RaysMut, disk};
use etendue_optics::element::{Grid, LensletShape, MicrolensArray, Opening};
use etendue_optics::train::Part;
use glam::{DVec2, DVec3};

use super::{LensletGrid, LightField};
use crate::lens::LensCamera;
use crate::{CameraError, CameraRays, FilmSamples, Pose};

/// Views of one scene from a grid of viewpoints, in one picture: rows and columns of views.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewGrid {
    grid: LensletGrid,
    views: u32,
    array: Arc<MicrolensArray>,
    decentre: DVec2,
    /// S (mm), positive.
    scale: f64,
    /// −1 where the lens turns pictures upside down.
    turn: f64,
    /// The viewpoint's step from view to view, and over a raw pixel (mm).
    baseline: [f64; 2],
    /// Along the rows of lenslets and across them, as unit vectors (right, up).
    axes: [DVec2; 2],
    /// 1/F (1/m): 0 for infinity, negative when the array's plane is imaged to behind the camera.
    vergence: f64,
    /// The slope of the chief ray at the array per distance from the axis (1/mm).
    chief: f64,
    stop: EntranceOpening,
    solid_angle: f64,
    /// Pixels of the picture per pixel of this, as of a coarser camera.
    coarse: f64,
}

/// Opening of the stop, as part of the entrance pupil.
#[derive(Debug, Clone, PartialEq)]
struct EntranceOpening {
    opening: Arc<Opening>,
    /// The stop's radius over the entrance pupil's.
    magnification: f64,
}

impl ViewGrid {
    /// The views of a light-field camera.
    ///
    /// # Errors
    ///
    /// When the main lens is telecentric towards the object, or the array stands at an image of the stop.
    pub fn new(lens: &LensCamera, light_field: &LightField) -> Result<Self, CameraError> {
        let fault = |why: &str| CameraError::new("focus_distance", why);
        let lenslets = lens.lenslets().ok_or_else(|| fault("there are no lenslets"))?;
        let (view, focused) = (lenslets.view(), lens.focused());
        let paraxial = focused.paraxial();
        let (Some(pupil), Some(magnification)) =
            (paraxial.entrance_pupil.z, paraxial.stop_magnification)
        else {
            return Err(fault("the lens is telecentric towards the object: views have no places"));
        };
        // The array as it appears from the entrance pupil: its distance, and its scale.
        let plane = view.front_z - view.principal_distance(0);
        let to_array = view.main.to_plane(plane).map_err(|e| fault(&e.to_string()))?;
        let scale = to_array.image_scale(pupil);
        let focus = 1e-3 * (to_array.conjugate() + pupil);
        if !(focus != 0.0 && scale.abs() > 0.0 && scale.is_finite()) {
            return Err(fault("the array stands at an image of the stop: there are no views"));
        }
        // A view is seen through as much of the opening as one pixel behind a lenslet sees.
        let [slope, _] = lenslets.central();
        let a_pixel = light_field.pupil_share * scale.abs() * slope * 1e-3 * focused.pixel_pitch();
        let stop = &view.main.elements()[view.main.stop()];
        let opening = match &stop.part {
            Part::Aperture(opening) => Arc::clone(opening),
            part => Arc::new(Opening::Circle { radius: part.clear_radius() }),
        };
        Ok(Self {
            grid: light_field.grid.clone(),
            views: light_field.views,
            array: Arc::clone(&view.array),
            decentre: view.decentre,
            scale: scale.abs(),
            turn: -scale.signum(),
            baseline: [a_pixel * light_field.step, a_pixel],
            axes: [[1.0, 0.0], [0.0, -1.0]].map(|[right, up]| {
                DVec2::from_angle(-light_field.rotation).rotate(DVec2::new(right, up))
            }),
            vergence: 1.0 / focus,
            chief: -(to_array.d - pupil * to_array.c) / scale,
            stop: EntranceOpening { opening, magnification },
            solid_angle: lens.solid_angle(),
            coarse: 1.0,
        })
    }

    /// The middle view alone.
    #[must_use]
    pub fn central(&self) -> Self {
        Self { views: 1, ..self.clone() }
    }

    /// Returns the grid on pixels `factor` times as large.
    pub(crate) fn coarser(&self, factor: f64) -> Self {
        Self { coarse: self.coarse * factor, ..self.clone() }
    }

    /// Columns and rows of the picture.
    #[must_use]
    pub fn resolution(&self) -> [u32; 2] {
        [self.grid.cols * self.views, self.grid.rows * self.views]
    }

    /// Columns and rows of a view.
    #[must_use]
    pub fn view_resolution(&self) -> [u32; 2] {
        [self.grid.cols, self.grid.rows]
    }

    /// Views along each side.
    #[must_use]
    pub fn views(&self) -> u32 {
        self.views
    }

    /// Distance of the viewpoint from one view to the next (m).
    #[must_use]
    pub fn baseline(&self) -> f64 {
        1e-3 * self.baseline[0]
    }

    /// The distance at which disparities are 0 (m), along the axis from the entrance pupil; infinite, or
    /// negative when it lies behind the camera, as it may where lenslets see a picture behind themselves.
    #[must_use]
    pub fn focus(&self) -> f64 {
        1.0 / self.vergence
    }

    /// The focal length of a view (pixels of the view, along its rows).
    #[must_use]
    pub fn focal_length(&self) -> f64 {
        self.scale / self.array.lattice.pitch
    }

    /// The viewpoint of a view that is so many views from the middle, along the rows of lenslets and across
    /// them (mm right, mm up).
    fn viewpoint(&self, view: DVec2) -> DVec2 {
        (self.axes[0] * view.x + self.axes[1] * view.y) * self.baseline[0]
    }

    /// Distance from a row of a view to the next (columns): 1, and √¾ in a hexagonal grid.
    #[must_use]
    pub fn row_height(&self) -> f64 {
        self.grid.row_height()
    }

    /// Packing of the lenslets, which is that of the pixels of a view.
    #[must_use]
    pub fn packing(&self) -> Grid {
        self.grid.grid
    }

    /// Rotation of the rows of views against the camera (radians), from right towards down.
    #[must_use]
    pub fn rotation(&self) -> f64 {
        -self.axes[0].to_angle()
    }

    /// The disparity of what is at a depth (m) along the axis: by how many columns less it stands along the
    /// row in the next view along the rows; in the next view across them it is that over
    /// [`row_height`](Self::row_height) rows further up. Positive in front of the focus, 0 there.
    #[must_use]
    pub fn disparity(&self, depth: f64) -> f64 {
        self.baseline() * self.focal_length() * (1.0 / depth - self.vergence)
    }

    /// The projected solid angle (sr) of a lenslet: times weight times radiance, it is the irradiance.
    #[must_use]
    pub fn solid_angle(&self) -> f64 {
        self.solid_angle
    }

    /// Pixels of a place in the picture, from the view's corner, and which view it is in.
    fn place(&self, column: f64, row: f64) -> ViewPlace {
        let split = |at: f64, side: u32| {
            let at = at * self.coarse;
            let side = f64::from(side);
            let view = (at / side).floor().clamp(0.0, f64::from(self.views - 1));
            let within = (at - view * side).clamp(0.0, side);
            let pixel = within.floor().min(side - 1.0);
            (view, pixel, within - pixel)
        };
        let (across, col, right) = split(column, self.grid.cols);
        let (down, row, below) = split(row, self.grid.rows);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a pixel of a view"
        )]
        let cell = self.grid.cell(row as u32, col as u32);
        let middle = 0.5 * f64::from(self.views - 1);
        ViewPlace { view: DVec2::new(across - middle, down - middle), cell, within: [right, below] }
    }

    /// The ray from a viewpoint (mm right, mm up) that meets the array at `a` (mm): origin and direction
    /// in the camera's frame (m).
    fn ray(&self, a: DVec2, u: DVec2) -> (DVec3, DVec3) {
        // The picture is upside down on the array, but for lenses that turn it back.
        let tangents = a * (self.turn / self.scale);
        let origin = u * 1e-3;
        let direction = (tangents - origin * self.vergence).extend(-1.0);
        (origin.extend(0.0), direction.normalize())
    }

    /// The middle of a lenslet and a step along its rows and across them, as the picture has them (mm).
    fn lenslet(&self, cell: [f64; 2], [right, below]: [f64; 2]) -> DVec2 {
        let centre = DVec2::from(self.array.lattice.centre(cell)) + self.decentre;
        let step = [right * self.turn, -below * self.turn];
        centre + DVec2::from(self.array.lattice.turned(step))
    }

    /// Share of a ray's light that arrives on the array.
    fn weight(&self, a: DVec2, u: DVec2) -> f64 {
        // On the pupil mm right and mm up are the lens' own x and y.
        let at_stop = u * self.stop.magnification;
        let open = self.stop.opening.transmission(at_stop.x, at_stop.y);
        let slope = u * (-self.turn / self.scale) + a * self.chief;
        open * (1.0 + slope.length_squared()).powi(-2)
    }

    /// Turns places of the picture (pixels from the corner), which stand in the first two arrays of the
    /// directions, into the rays of the views' own viewpoints.
    pub(crate) fn aim(&self, pose: &Pose, rays: &mut RayBatch) {
        let RaysMut { origins, directions, t_max, .. } = rays.arrays_mut();
        for i in 0..t_max.len() {
            let place = self.place(directions[0][i], directions[1][i]);
            let pitch = self.array.lattice.pitch;
            let a = self.lenslet(place.cell, place.within.map(|share| (share - 0.5) * pitch));
            let (origin, direction) = self.ray(a, self.viewpoint(place.view));
            let origin = pose.position + pose.rotation * origin;
            let direction = pose.rotation * direction;
            for axis in 0..3 {
                origins[axis][i] = origin[axis];
                directions[axis][i] = direction[axis];
            }
        }
    }

    /// The rays of `samples`: over lenslets' openings, and over what a raw pixel sees of the pupil.
    pub(crate) fn sample_rays(&self, pose: &Pose, samples: &FilmSamples, out: &mut CameraRays) {
        out.clear();
        for (i, number) in (0..samples.len()).zip(0_u32..) {
            let place = self.place(samples.columns[i], samples.rows[i]);
            let a = self.lenslet(place.cell, opening_point(&self.array, place.within));
            let [right, below] = samples.pupil[i].map(|share| (share - 0.5) * self.baseline[1]);
            let u = self.viewpoint(place.view) + DVec2::new(right, -below);
            let weight = self.weight(a, u);
            if weight > 0.0 {
                let (origin, direction) = self.ray(a, u);
                out.rays.push(pose.position + pose.rotation * origin, pose.rotation * direction);
                out.weight.push(weight);
                out.sample.push(number);
            }
        }
        out.rays.coherent = true;
    }
}

/// A place of the picture.
struct ViewPlace {
    /// The view, from the middle one: right and down.
    view: DVec2,
    cell: [f64; 2],
    /// From the pixel's corner, 0..=1.
    within: [f64; 2],
}

/// A point of an opening for a place in the unit square, even in area: along the rows and across (mm).
fn opening_point(array: &MicrolensArray, [u, v]: [f64; 2]) -> [f64; 2] {
    let reach = array.reach;
    match array.shape {
        LensletShape::Square => [(2.0 * u - 1.0) * reach, (2.0 * v - 1.0) * reach],
        LensletShape::Round => disk::point([u, v]).map(|x| x * reach),
        LensletShape::Hexagonal => {
            // Three rhombi around the centre.
            let third = (3.0 * u).floor().min(2.0);
            let s = 3.0 * u - third;
            let radius = reach * 2.0 / 3.0_f64.sqrt();
            let corner = |k: f64| DVec2::from_angle((2.0 * k + 0.5) * std::f64::consts::FRAC_PI_3);
            (radius * (corner(third) * s + corner(third + 1.0) * v)).to_array()
        }
    }
}
