//! Refusals of lenses through which no light comes, and of sensors that none could reach.

use etendue_report::Refusal;
use glam::DVec3;

use super::search::SlopeWindow;
use crate::element::{Clip, RayStatus, StatusCounts};
use crate::train::{MonochromaticTrain, OpticalTrain, Side};

/// Refusal of a sensor without size, or before the lens.
pub(super) fn no_sensor() -> Refusal {
    Refusal::new("the sensor must lie behind the last element and have a finite size")
}

/// Refusal of a lens of which no element has a rim.
#[must_use]
pub fn unbounded() -> Refusal {
    Refusal::new("the lens passes light in all directions")
        .hint("give its stop a radius, or a surface a semi_diameter")
}

/// Refusal of a microlens array, `element`, whose lenslets no ray gets through.
#[must_use]
pub fn dark_array(element: usize) -> Refusal {
    Refusal::new(format!(
        "no light gets through the microlens array elements[{element}] to the sensor: it stands outside of the light of \
         the lens before it, or its lenslets are closed"
    ))
}

/// Refusal of a lens that not one ray leaves: it names the element on which the rays end that got farthest, and the
/// losses of those from `film`, a point of the sensor (mm), by cause and element.
#[must_use]
pub fn blocked(train: &OpticalTrain, lens: &MonochromaticTrain, film: DVec3) -> Refusal {
    let mut counts = StatusCounts::new(train.elements.len());
    match SlopeWindow::probe(train, film) {
        Some(mut rays) => {
            lens.trace(Side::Sensor, Clip::On, &mut rays);
            counts.add_all(&rays);
        }
        // There is no direction to the nearest rim: it is closed.
        None => {
            let closed = train.elements.iter().rposition(|e| e.clear_radius() == 0.0);
            counts.add(RayStatus::Vignetted { element: closed.unwrap_or(train.stop) });
        }
    }
    // Where the last rays end: nothing gets past it.
    let element = counts.farthest_from_sensor().unwrap_or(train.stop);
    let losses = counts.losses().join(", ");
    Refusal::new(format!(
        "no light passes the lens: nothing gets from the sensor past elements[{element}] ({losses})"
    ))
}
