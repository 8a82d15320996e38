//! Emissive triangles of one radiance each, ready to be asked many times: what [`crate::light`] works
//! out anew for every ray, worked out once.

use etendue_geometry::glam::DVec3;

use crate::Paint;
use crate::reference::{Spot, Surroundings};
use crate::spawn::magnitudes;

/// More emissive triangles than this are not kept ready.
pub(crate) const MOST: usize = 4096;

/// A triangle that shines alike all over.
#[derive(Debug, Clone)]
pub(crate) struct Lamp {
    /// Placement and triangle.
    pub(crate) id: [u32; 2],
    /// The first corner, turned into the world, and the placement's translation (m): its high part
    /// and its low one.
    pub(crate) corner: DVec3,
    pub(crate) translation: [DVec3; 2],
    /// From the first corner to the others (m).
    pub(crate) edges: [DVec3; 2],
    /// Unit normal on the front.
    pub(crate) normal: DVec3,
    /// m².
    pub(crate) area: f64,
    pub(crate) two_sided: bool,
    /// What the placement's own numbers add to the rounding of a point on it (m).
    pub(crate) magnitudes: DVec3,
}

impl Lamp {
    /// Triangle `id`; `None` when its radiance is not alike all over, or it has no area.
    pub(crate) fn new(around: &Surroundings<'_>, id: [u32; 2]) -> Option<Self> {
        let placement = around.geometry.placements.get(id[0] as usize)?;
        let spot = Spot::corner(around.geometry, placement, id[1] as usize);
        let emission = around.material(&spot)?.emission.as_ref()?;
        let Paint::Plain(_) = emission.radiance else { return None };
        let place = &placement.world_from_mesh;
        let [a, b, c] = spot.mesh.corners(spot.triangle);
        let edges = [place.linear * (b - a), place.linear * (c - a)];
        let cross = edges[0].cross(edges[1]);
        let length = cross.length();
        let normal = cross / length * place.handedness();
        normal.is_finite().then_some(Self {
            id,
            corner: place.linear * a,
            translation: [place.translation, place.translation_low],
            edges,
            normal,
            area: 0.5 * length,
            two_sided: emission.two_sided,
            magnitudes: magnitudes(placement, spot.mesh),
        })
    }
}
