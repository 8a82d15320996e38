//! Which scenes are plain.

use etendue_accel::Accel;
use etendue_geometry::glam::DVec3;

use super::lamps::Lamps;
use crate::area_light::AreaLight;
use crate::light::{Light, LightKind};
use crate::lights::Lights;
use crate::placed::{PlacedSurfaces, PlainSurface};
use crate::{Spectral, Traits};

/// Single precision holds squares of lengths, and densities over areas, of scenes between these sizes (m).
pub(crate) const SIZES: [f64; 2] = [1e-6, 1e9];

/// The least area of a lamp over the square of the scene's size that it holds.
const LEAST_AREA: f64 = 1e-12;

/// A scene whose light takes its steps in single precision: opaque surfaces, matte or rough sheets of facets, in red,
/// green and blue.
#[derive(Debug)]
pub struct PlainScene {
    /// One a placement, and none behind the last.
    pub(super) surfaces: Vec<PlainSurface>,
    pub(super) lamps: Lamps,
    /// What blocks' coordinates are relative to (m).
    pub(super) origin: DVec3,
    /// Some surface is a sheet of facets.
    pub(super) has_sheets: bool,
    /// Light that leaves a surface is weighed by the normal there.
    pub(super) has_receivers: bool,
}

impl PlainScene {
    /// That of a scene; `None` of one that is not plain, and where rays do not go in blocks.
    #[must_use]
    pub fn of(
        accel: &dyn Accel,
        lights: &Lights,
        (placed, traits): (&PlacedSurfaces, Traits),
        spectral: &Spectral,
    ) -> Option<Self> {
        let is_taken = spectral.is_rgb()
            && !(traits.may_pass() || traits.has_media || traits.has_panes)
            && !lights.is_dark();
        let surfaces = placed.plain().filter(|_| is_taken)?.to_vec();
        let origin = accel.blocks()?.origin();
        let least = LEAST_AREA * placed.size().powi(2);
        // Triangles without area send nothing.
        let fits = |own: &AreaLight| own.shape.area > least;
        let is_near = |light: &Light| match &light.kind {
            LightKind::Point(at) | LightKind::Spot { at, .. } => is_within_reach(*at - origin),
            LightKind::Projector(projector) => is_within_reach(projector.at - origin),
            LightKind::Goniometric(measured) => is_within_reach(measured.at - origin),
            LightKind::Environment { .. } | LightKind::Directional { .. } => true,
        };
        let are_taken = lights.ready_triangles()?.iter().flatten().all(fits)
            && lights.bare().iter().all(|light| light.motion.is_none() && is_near(light));
        let lamps = are_taken.then(|| Lamps::new(lights, origin))?;
        let has_sheets = surfaces.iter().any(|surface| surface.is_sheet);
        let has_receivers = lights.few().is_none() || lights.has_environment();
        Some(Self { surfaces, lamps, origin, has_sheets, has_receivers })
    }
}

fn is_within_reach(way: DVec3) -> bool {
    way.length() < SIZES[1]
}
