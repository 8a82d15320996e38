//! Points of the object, their chief rays, and rays from them over the pupil.
//!
//! A ray of a beam has two coordinates. From infinity they are places (mm) on a plane square to the
//! beam through the middle of the entrance pupil; from a near point they are the direction cosines L
//! and M at that point. In both an even grid of rays carries even power: of a far point that lights
//! the entrance evenly, and of a near one in a flat object that radiates by Lambert's law.

use etendue_report::Refusal;
use glam::{DVec2, DVec3};

use super::AnalysisError;
use crate::element::{Clip, LensRays, Ray, RayStatus};
use crate::train::aim::{follow, solve};
use crate::train::optical_path::{PathEnd, ThinLensPhases};
use crate::train::{MonochromaticTrain, OpticalTrain, Side};

/// A point of the object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ObjectPoint {
    /// At infinity: angles off the axis (degrees) in x and in y; light goes towards
    /// (tan x, tan y, 1). Up to 90°; a field in y alone may be wider.
    Infinity {
        /// Degrees.
        angles: [f64; 2],
    },
    /// At a place in front of the lens, or behind its front when the object is virtual (mm).
    Near {
        /// Place in lens coordinates (mm).
        place: DVec3,
    },
}

impl ObjectPoint {
    /// A point at infinity, `degrees` off the axis in y.
    #[must_use]
    pub fn field(degrees: f64) -> Self {
        Self::Infinity { angles: [0.0, degrees] }
    }

    /// z of the object (mm); `None` at infinity.
    #[must_use]
    pub fn z(&self) -> Option<f64> {
        match self {
            Self::Infinity { .. } => None,
            Self::Near { place } => Some(place.z),
        }
    }

    /// In words.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Infinity { angles: [0.0, y] } => format!("{y}\u{b0}"),
            Self::Infinity { angles: [x, y] } => format!("{x}\u{b0} in x and {y}\u{b0} in y"),
            Self::Near { place } if place.x == 0.0 => format!("height {} mm", place.y),
            Self::Near { place } => format!("({}, {}) mm", place.x, place.y),
        }
    }

    /// The point's share of the way from the axis.
    fn share(&self, share: f64) -> Self {
        match *self {
            Self::Infinity { angles } => Self::Infinity { angles: angles.map(|a| a * share) },
            Self::Near { place } => {
                Self::Near { place: DVec3::new(place.x * share, place.y * share, place.z) }
            }
        }
    }
}

/// Start of the rays of an object point.
#[derive(Debug, Clone, Copy)]
struct Launch {
    origin: DVec3,
    direction: DVec3,
    across: [DVec3; 2],
    is_near: bool,
}

impl Launch {
    fn new(train: &OpticalTrain, object: &ObjectPoint, pupil: f64) -> Self {
        match *object {
            ObjectPoint::Infinity { angles: [x, y] } => {
                let [x, y] = [x, y].map(f64::to_radians);
                let direction = match x == 0.0 {
                    true => DVec3::new(0.0, y.sin(), y.cos()),
                    false => DVec3::new(x.tan(), y.tan(), 1.0).normalize(),
                };
                // Square to the beam: x as near to x as can be, y in its plane with the axis for x = 0.
                let across_x = (DVec3::X - direction * direction.x).normalize();
                let across_y = direction.cross(across_x);
                let middle = DVec3::new(0.0, 0.0, pupil);
                let origin = middle - direction * train.far_in_front(pupil);
                Self { origin, direction, across: [across_x, across_y], is_near: false }
            }
            ObjectPoint::Near { place } => Self {
                origin: place,
                direction: DVec3::Z,
                across: [DVec3::X, DVec3::Y],
                is_near: true,
            },
        }
    }

    fn ray(&self, at: DVec2) -> Option<Ray> {
        if self.is_near {
            let rest = 1.0 - at.length_squared();
            return (rest > 0.0)
                .then_some(())
                .and_then(|()| Ray::new(self.origin, at.extend(rest.sqrt())));
        }
        let place = self.origin + self.across[0] * at.x + self.across[1] * at.y;
        Ray::new(place, self.direction)
    }
}

/// The light of one object point at one wavelength.
#[derive(Debug)]
pub struct Beam<'a> {
    pub(crate) train: &'a OpticalTrain,
    pub(crate) at: &'a MonochromaticTrain,
    pub(crate) object: ObjectPoint,
    launch: Launch,
    phases: ThinLensPhases,
    /// Coordinates of the chief ray.
    pub(crate) chief: DVec2,
    /// The chief ray behind the lens.
    pub(crate) chief_end: PathEnd,
    /// A size of the beam in its coordinates, to begin looking for its edges.
    reach: f64,
}

impl<'a> Beam<'a> {
    /// The beam of a point, with its chief ray aimed at the stop's middle.
    ///
    /// # Errors
    ///
    /// When there is no chief ray, a glass has no index, or the lens has an array of lenslets.
    pub fn new(
        train: &'a OpticalTrain,
        at: &'a MonochromaticTrain,
        object: ObjectPoint,
    ) -> Result<Self, AnalysisError> {
        if let Some(array) = train.first_array() {
            let why = format!(
                "elements[{array}] is a microlens array: behind it there is no one wavefront"
            );
            return Err(Refusal::new(why).hint("analyse the lens without it").into());
        }
        let pupil = train.paraxial(at.wavelength())?.entrance_pupil;
        let z = pupil.z.unwrap_or(0.0);
        let scale = train.lateral_scale();
        let radius = pupil.diameter.map_or(scale, |diameter| 0.5 * diameter);
        // Towards the middle of the entrance pupil.
        let guess = |object: &ObjectPoint| match *object {
            ObjectPoint::Infinity { .. } => DVec2::ZERO,
            ObjectPoint::Near { .. } if pupil.z.is_none() => DVec2::ZERO,
            ObjectPoint::Near { place } => {
                let way = DVec3::new(0.0, 0.0, z) - place;
                way.truncate() / way.length().copysign(way.z)
            }
        };
        let size = match object {
            ObjectPoint::Infinity { .. } => scale,
            ObjectPoint::Near { place } => (scale / (z - place.z).abs().max(1e-9)).min(1.0),
        };
        let miss = |object: ObjectPoint| {
            let launch = Launch::new(train, &object, z);
            move |place: DVec2| {
                at.crossing(Side::Object, train.stop(), launch.ray(place)?).map(DVec2::from)
            }
        };
        let chief = solve(miss(object), guess(&object), size)
            .or_else(|| follow(|share| miss(object.share(share)), DVec2::ZERO, size));
        let none = || AnalysisError::NoChiefRay { field: object.name() };
        let chief = chief.ok_or_else(none)?;
        let launch = Launch::new(train, &object, z);
        let ray = launch.ray(chief).ok_or_else(none)?;
        let phases = ThinLensPhases::new(train, at, object.z(), ray)?;
        let chief_end = at.run_with_path(Clip::Off, ray, &phases);
        if chief_end.status != RayStatus::Exited {
            return Err(none());
        }
        let reach = match object {
            ObjectPoint::Infinity { .. } => radius,
            ObjectPoint::Near { place } => match pupil.z {
                Some(z) => (radius / radius.hypot(z - place.z)).min(0.5),
                None => 0.2,
            },
        };
        Ok(Self { train, at, object, launch, phases, chief, chief_end, reach })
    }

    /// The ray at coordinates of the beam as it leaves the lens; `None` when it starts nowhere.
    pub(crate) fn run(&self, clip: Clip, place: DVec2) -> Option<PathEnd> {
        Some(self.at.run_with_path(clip, self.launch.ray(place)?, &self.phases))
    }

    /// Crossing of the ray with an element, in the element's own frame (mm), whether rims stop it
    /// there or not.
    pub(crate) fn crossing(&self, element: usize, place: DVec2) -> Option<DVec2> {
        self.at.crossing(Side::Object, element, self.launch.ray(place)?).map(DVec2::from)
    }

    /// The ray as it leaves, whether rims stop it or not; `None` when it does not leave.
    pub(crate) fn run_on(&self, place: DVec2) -> Option<PathEnd> {
        self.run(Clip::Off, place).filter(|end| end.status == RayStatus::Exited)
    }

    /// Share of the ray's light that the lens passes (0..=1).
    pub(crate) fn throughput(&self, place: DVec2) -> f64 {
        match self.run(Clip::On, place) {
            Some(end) if end.status == RayStatus::Exited => end.throughput,
            _ => 0.0,
        }
    }

    /// Share of each ray's light that the lens passes: as [`Self::throughput`], in batches.
    pub(crate) fn throughputs(&self, places: &[DVec2]) -> Vec<f64> {
        /// Rays of a batch, which stay in the second-level cache.
        const BATCH: usize = 1024;
        let mut rays = LensRays::with_capacity(BATCH.min(places.len()));
        let mut passed = Vec::with_capacity(places.len());
        for batch in places.chunks(BATCH) {
            rays.clear();
            batch.iter().for_each(|&place| rays.push_ray(self.launch.ray(place), 1.0));
            self.at.trace(Side::Object, Clip::On, &mut rays);
            passed.extend((0..batch.len()).map(|i| match rays.status(i) {
                RayStatus::Exited => rays.throughput(i),
                _ => 0.0,
            }));
        }
        passed
    }

    /// The chief ray as it is begun.
    pub(crate) fn start(&self) -> Option<Ray> {
        self.launch.ray(self.chief)
    }

    /// Half the paraxial entrance pupil in coordinates of the beam.
    pub(crate) fn reach(&self) -> f64 {
        self.reach
    }

    /// The rectangle of coordinates that light passes, a little too large: low and high corner.
    ///
    /// # Errors
    ///
    /// When no light passes, or nothing ends it.
    pub fn bounds(&self) -> Result<[DVec2; 2], AnalysisError> {
        /// Looks over wider and wider squares, and cells across one.
        const LOOKS: i32 = 7;
        const CELLS: u32 = 48;
        let whole = |half: f64| [self.chief - DVec2::splat(half), self.chief + DVec2::splat(half)];
        let mut found = None;
        for look in 0..LOOKS {
            let half = 1.3 * self.reach * 1.7_f64.powi(look);
            let square = whole(half);
            let Some(lit) = self.lit(square, CELLS) else { continue };
            let inside = lit[0].cmpgt(square[0]).all() && lit[1].cmplt(square[1]).all();
            found = Some((lit, inside));
            if inside {
                break;
            }
        }
        match found {
            None => Err(AnalysisError::Dark { field: self.object.name() }),
            Some((_, false)) if !self.launch.is_near => Err(AnalysisError::unlimited()),
            // A closer look at a small rectangle has smaller cells to spare.
            Some((lit, _)) => Ok(self.lit(lit, CELLS).unwrap_or(lit)),
        }
    }

    /// The rectangle of lit cells of a grid over a rectangle, and a cell more on each side; the grid's
    /// own rectangle where lit cells touch its edge.
    fn lit(&self, [low, high]: [DVec2; 2], cells: u32) -> Option<[DVec2; 2]> {
        let size = (high - low) / f64::from(cells);
        let cell = |k: u32| DVec2::new(f64::from(k % cells) + 0.5, f64::from(k / cells) + 0.5);
        let places: Vec<DVec2> = (0..cells * cells).map(|k| low + cell(k) * size).collect();
        let mut found: Option<[[u32; 2]; 2]> = None;
        for (k, passed) in (0..).zip(self.throughputs(&places)) {
            if passed > 0.0 {
                let (column, row) = (k % cells, k / cells);
                let [least, most] = found.get_or_insert([[column, row]; 2]);
                *least = [least[0].min(column), least[1].min(row)];
                *most = [most[0].max(column), most[1].max(row)];
            }
        }
        let [least, most] = found?;
        let start = |i: u32| f64::from(i.saturating_sub(1));
        let end = |i: u32| f64::from((i + 2).min(cells));
        Some([
            low + DVec2::new(start(least[0]), start(least[1])) * size,
            low + DVec2::new(end(most[0]), end(most[1])) * size,
        ])
    }
}
