//! The chief rays of a whole sensor: solved at nodes once, and from there for each place.
//!
//! Between nodes a straight line gives slopes that are right to a millionth; Newton's method then
//! needs a step or two to pass the stop's centre to within 10⁻⁹ mm.
//!
//! A camera's lenslets: which of them a place on the sensor belongs to, and the ray through its middle.
//!
//! The part of the sensor that light reaches: the image circle, which is no circle behind a lens
//! without rotational symmetry.

use glam::{DVec2, DVec3};

use super::focused::FocusedLens;
use crate::CameraError;
use etendue_optics::element::{Clip, Frame, Ray, RayStatus};
use etendue_optics::train::pupil::{SlopeWindow, lit_radius};
use etendue_optics::train::{BehindLenslets, MonochromaticTrain, OpticalTrain, Side};

/// Nodes over the half diagonal, for lenses with rotational symmetry. No setting, as those of other lenses: from nodes
/// farther apart Newton's method comes to the same rays, and nodes are solved when a camera is read.
const RADIAL_NODES: u32 = 257;

/// Nodes over each side of the sensor for other lenses.
const PLANAR_NODES: u32 = 17;

/// Slopes of chief rays at nodes over the sensor; `None` where the stop's centre cannot be seen.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ChiefTable {
    nodes: Vec<Option<DVec2>>,
    /// Half the sensor (mm) for a grid of nodes; nodes on a radius of that length when `None`.
    half_size: Option<DVec2>,
    radius: f64,
}

impl ChiefTable {
    /// Solves the nodes for a sensor of half width and height `half_size` (mm) that stands at `frame`.
    pub(crate) fn new(
        train: &OpticalTrain,
        frame: &Frame,
        half_size: DVec2,
        at: &MonochromaticTrain,
    ) -> Self {
        let radius = half_size.length();
        if train.is_rotationally_symmetric() {
            let nodes = along_radius(train, frame, at, radius);
            return Self { nodes, half_size: None, radius };
        }
        let mut nodes = Vec::new();
        let share = |i: u32| 2.0 * f64::from(i) / f64::from(PLANAR_NODES - 1) - 1.0;
        for row in 0..PLANAR_NODES {
            for column in 0..PLANAR_NODES {
                let film = DVec2::new(share(column), share(row)) * half_size;
                let point = frame.point(film.extend(0.0));
                nodes.push(train.chief_direction(at, point).map(slopes_of));
            }
        }
        Self { nodes, half_size: Some(half_size), radius }
    }

    /// The direction from a place on the sensor (mm from its centre) to the stop's centre.
    pub(crate) fn direction(
        &self,
        train: &OpticalTrain,
        frame: &Frame,
        at: &MonochromaticTrain,
        film: DVec2,
    ) -> Option<DVec3> {
        let point = frame.point(film.extend(0.0));
        let slopes = train.chief_slopes_near(at, point, self.nearly(film)?)?;
        Some(slopes.extend(-1.0).normalize())
    }

    /// Variant of [`Self::direction`] that does not solve for it, for a lens with rotational symmetry: the line through
    /// nodes is right to a millionth of the way to the stop. Of others as [`Self::direction`].
    pub(crate) fn direction_nearly(
        &self,
        train: &OpticalTrain,
        frame: &Frame,
        at: &MonochromaticTrain,
        film: DVec2,
    ) -> Option<DVec3> {
        match self.half_size {
            None => Some(self.nearly(film)?.extend(-1.0).normalize()),
            Some(_) => self.direction(train, frame, at, film),
        }
    }

    /// The slopes of that direction to about a millionth.
    pub(crate) fn nearly(&self, film: DVec2) -> Option<DVec2> {
        match self.half_size {
            None => self.radial_start(film),
            Some(half_size) => self.planar_start(film / half_size),
        }
    }

    fn radial_start(&self, film: DVec2) -> Option<DVec2> {
        let r = film.length();
        let axis = if r > 0.0 { film / r } else { DVec2::X };
        let (low, share) = interval(r / self.radius, RADIAL_NODES);
        let start = match (self.nodes[low], self.nodes[low + 1]) {
            (Some(near), Some(far)) => near.lerp(far, share),
            (near, far) => near.or(far)?,
        };
        Some(axis.rotate(start))
    }

    fn planar_start(&self, at: DVec2) -> Option<DVec2> {
        let (column, right) = interval(0.5 * (at.x + 1.0), PLANAR_NODES);
        let (row, down) = interval(0.5 * (at.y + 1.0), PLANAR_NODES);
        let node = |c: usize, r: usize| self.nodes[(row + r) * PLANAR_NODES as usize + column + c];
        let corners = [node(0, 0), node(1, 0), node(0, 1), node(1, 1)];
        if let [Some(a), Some(b), Some(c), Some(d)] = corners {
            return Some(a.lerp(b, right).lerp(c.lerp(d, right), down));
        }
        corners.into_iter().flatten().next()
    }
}

/// From the axis outwards, each begun where the last two point; there is nothing behind the first
/// that cannot be solved.
fn along_radius(
    train: &OpticalTrain,
    frame: &Frame,
    at: &MonochromaticTrain,
    radius: f64,
) -> Vec<Option<DVec2>> {
    let mut nodes: Vec<Option<DVec2>> = vec![None; RADIAL_NODES as usize];
    for i in 0..RADIAL_NODES as usize {
        #[expect(clippy::cast_precision_loss, reason = "a few hundred nodes")]
        let film = DVec2::new(radius * i as f64 / f64::from(RADIAL_NODES - 1), 0.0);
        let point = frame.point(film.extend(0.0));
        let before = |steps: usize| i.checked_sub(steps).and_then(|i| nodes[i]);
        let guess = match (before(1), before(2)) {
            (Some(last), Some(one)) => Some(last + (last - one)),
            (last, _) => last,
        };
        let found = match guess {
            None => train.chief_direction(at, point).map(slopes_of),
            Some(guess) => train
                .chief_slopes_near(at, point, guess)
                .or_else(|| train.chief_slopes_near(at, point, before(1)?)),
        };
        if found.is_none() {
            break;
        }
        nodes[i] = found;
    }
    nodes
}

fn slopes_of(direction: DVec3) -> DVec2 {
    -direction.truncate() / direction.z
}

/// The node below `share` of the way over all of `nodes`, and how far it is to the next.
fn interval(share: f64, nodes: u32) -> (usize, f64) {
    let at = (share * f64::from(nodes - 1)).clamp(0.0, f64::from(nodes - 1));
    let low = at.floor().min(f64::from(nodes - 2));
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 0 and a few hundred"
    )]
    let index = low as usize;
    (index, at - low)
}

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
    pub(crate) fn new(focused: &FocusedLens) -> Result<Option<Self>, CameraError> {
        Self::in_train(focused, focused.train())
    }

    fn in_train(focused: &FocusedLens, train: &OpticalTrain) -> Result<Option<Self>, CameraError> {
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

    /// Chief rays of light of a wavelength (nm), through a lens that stands where it is.
    pub(crate) fn at(focused: &FocusedLens, wavelength: f64) -> Result<Option<Self>, CameraError> {
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
        let direction = self.table.direction(&self.view.main, &self.plane, &self.main, at)?;
        Some(-direction.truncate() / direction.z)
    }

    /// Point where the chief ray of the lens before through a lenslet's middle meets the sensor (mm
    /// across the axis): the middle of the image that the lenslet makes of the opening.
    #[must_use]
    pub fn image_centre(&self, cell: [f64; 2]) -> Option<DVec2> {
        self.view.image_centre(cell, self.sensor_z, |at| self.chief_slopes(at))
    }

    /// Variant of [`Self::image_centre`] that is accurate to about a millionth of the way from pupil to array.
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

/// Directions from the sensor's centre in which its edge is looked for. Not a setting: what straight lines between them
/// cut off of a border is known to no more than where it is in each.
const DIRECTIONS: usize = 32;

/// Reach of the search for the edge beyond the sensor's border, in its distances: a line from an
/// edge on the sensor to one far outside of it cuts nothing off.
const BEYOND: f64 = 2.0;

/// Distance from the sensor's centre within which light arrives (mm).
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum ImageCircle {
    /// One radius in all directions.
    Circle(f64),
    /// By direction, evenly over a full turn from +x; straight lines join them.
    Outline(Vec<LightReach>),
    /// Nothing is known: the centre is dark.
    Unknown,
}

/// Reach of the light in one direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LightReach {
    /// To its edge, or as far as was looked (mm).
    distance: f64,
    /// True if it is dark behind.
    ends: bool,
}

impl ImageCircle {
    /// Measures it on a sensor of half width and height `half` (mm) that stands at `frame`, to within an `error`, a
    /// share of the distance of its edge.
    pub(crate) fn measure(
        train: &OpticalTrain,
        lens: &MonochromaticTrain,
        frame: Frame,
        half: DVec2,
        error: f64,
    ) -> Self {
        if train.is_rotationally_symmetric() {
            let lenses = std::slice::from_ref(lens);
            return Self::Circle(lit_radius(train, lenses, frame.vertex.z, half.length(), error));
        }
        let lit =
            |film: DVec2| SlopeWindow::find(train, lens, frame.point(film.extend(0.0))).is_some();
        if !lit(DVec2::ZERO) {
            return Self::Unknown;
        }
        let edge = |i: usize| {
            let axis = direction(i);
            let border = BEYOND * (half / axis.abs()).min_element();
            if lit(axis * border) {
                return LightReach { distance: border, ends: false };
            }
            let (mut low, mut high) = (0.0, border);
            while high - low > error * high {
                let middle = 0.5 * (low + high);
                if lit(axis * middle) { low = middle } else { high = middle }
            }
            LightReach { distance: high, ends: true }
        };
        Self::Outline((0..DIRECTIONS).map(edge).collect())
    }

    /// Tests whether light arrives at a place on the sensor (mm from its centre).
    pub(crate) fn contains(&self, film: DVec2) -> bool {
        match self {
            Self::Circle(radius) => film.length() <= *radius,
            Self::Unknown => true,
            Self::Outline(reaches) => {
                let turn = film.to_angle().rem_euclid(std::f64::consts::TAU);
                let at = turn / std::f64::consts::TAU * DIRECTIONS as f64;
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "0 to the number of directions"
                )]
                let low = (at as usize).min(DIRECTIONS - 1);
                let ends = [low, (low + 1) % DIRECTIONS];
                // A place before the chord between the two edges is lit. Where both directions are
                // lit beyond the sensor's border, so is its corner between them.
                let [a, b] = ends.map(|i| direction(i) * reaches[i].distance);
                !ends.iter().any(|&i| reaches[i].ends) || (b - a).perp_dot(film - a) >= 0.0
            }
        }
    }
}

fn direction(i: usize) -> DVec2 {
    DVec2::from_angle(std::f64::consts::TAU * i as f64 / DIRECTIONS as f64)
}
