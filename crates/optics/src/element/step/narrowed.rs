//! Elements whose rims are narrower than they were built: rays that pass them pass the others at some distance from
//! their rims.

use std::sync::Arc;

use super::{Action, ElementStep};
use crate::element::aperture::Opening;

impl ElementStep {
    /// The step with a rim that is narrower by so much (mm) and all else as it is; `None` of elements of which rays
    /// are ended by more than a circle or a polygon about the axis.
    pub(crate) fn narrowed(&self, by: f64) -> Option<Self> {
        if self.fold.is_some() || self.graded.is_some() {
            return None;
        }
        Some(Self { action: self.action.narrowed(by)?, ..self.clone() })
    }
}

impl Action {
    fn narrowed(&self, by: f64) -> Option<Self> {
        let mut own = self.clone();
        match &mut own {
            Self::Plane(refraction) | Self::Sphere(refraction) | Self::Conic(refraction) => {
                narrow(&mut refraction.surface.semi_diameter, by);
            }
            Self::ThinLens { semi_diameter, .. } => narrow(semi_diameter, by),
            Self::Opening(opening) => *opening = Arc::new(narrowed(opening, by)?),
            Self::Filter { filter, .. } if filter.is_uniform() => {
                narrow(&mut Arc::make_mut(filter).semi_diameter, by);
            }
            // Where a ray meets these depends on more than its rim, or rims lie within them.
            Self::Asphere(_)
            | Self::Biconic { .. }
            | Self::Filter { .. }
            | Self::Lenslets(_)
            | Self::Freeform { .. }
            | Self::Shadow(_)
            | Self::Turn(_) => return None,
        }
        Some(own)
    }
}

fn narrowed(opening: &Opening, by: f64) -> Option<Opening> {
    let mut own = opening.clone();
    match &mut own {
        Opening::Circle { radius } => narrow(radius, by),
        Opening::Polygon { apothem, .. } => narrow(apothem, by),
        Opening::Image(_) | Opening::Shaped(_) => return None,
    }
    Some(own)
}

fn narrow(radius: &mut f64, by: f64) {
    *radius = (*radius - by).max(0.0);
}
