//! The chief rays of a whole sensor: solved at nodes once, and from there for each place.
//!
//! Between nodes a straight line gives slopes that are right to a millionth; Newton's method then
//! needs a step or two to pass the stop's centre to within 10⁻⁹ mm.

use glam::{DVec2, DVec3};

use etendue_optics::element::Frame;
use etendue_optics::train::{MonochromaticTrain, OpticalTrain};

/// Nodes over the half diagonal, for lenses with rotational symmetry.
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
        (train, frame): (&OpticalTrain, &Frame),
        at: &MonochromaticTrain,
        film: DVec2,
    ) -> Option<DVec3> {
        let point = frame.point(film.extend(0.0));
        let slopes = train.chief_slopes_near(at, point, self.nearly(film)?)?;
        Some(slopes.extend(-1.0).normalize())
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
