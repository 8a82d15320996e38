//! The part of the sensor that light reaches: the image circle, which is no circle behind a lens
//! without rotational symmetry.

use glam::DVec2;

use etendue_optics::element::Frame;
use etendue_optics::train::pupil::{Window, lit_radius};
use etendue_optics::train::{MonochromaticTrain, OpticalTrain};

/// Directions from the sensor's centre in which its edge is looked for.
const DIRECTIONS: usize = 32;

/// How far beyond the sensor's border the edge is looked for, in its distances: a line from an edge
/// on the sensor to one far outside of it cuts nothing off.
const BEYOND: f64 = 2.0;

/// How near to the edge of the light a search comes, as a share of its distance.
const CLOSE: f64 = 5e-3;

/// How far from the sensor's centre light arrives (mm).
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum ImageCircle {
    /// The same in all directions.
    Circle(f64),
    /// By direction, evenly over a full turn from +x; straight lines join them.
    Outline(Vec<LightReach>),
    /// Nothing is known: the centre is dark.
    Unknown,
}

/// How far light arrives in one direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LightReach {
    /// To its edge, or as far as was looked (mm).
    distance: f64,
    /// Whether it is dark behind.
    ends: bool,
}

impl ImageCircle {
    /// Measures it on a sensor of half width and height `half` (mm) that stands at `frame`.
    pub(crate) fn measure(
        train: &OpticalTrain,
        lens: &MonochromaticTrain,
        frame: Frame,
        half: DVec2,
    ) -> Self {
        if train.is_rotationally_symmetric() {
            let lenses = std::slice::from_ref(lens);
            return Self::Circle(lit_radius(train, lenses, frame.vertex.z, half.length()));
        }
        let lit = |film: DVec2| Window::find(train, lens, frame.point(film.extend(0.0))).is_some();
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
            while high - low > CLOSE * high {
                let middle = 0.5 * (low + high);
                if lit(axis * middle) { low = middle } else { high = middle }
            }
            LightReach { distance: high, ends: true }
        };
        Self::Outline((0..DIRECTIONS).map(edge).collect())
    }

    /// Whether light arrives at a place on the sensor (mm from its centre).
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
