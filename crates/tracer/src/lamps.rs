//! Emissive triangles: as one point sees them, and those of one radiance ready to be asked many times.

use std::f64::consts::PI;

use etendue_geometry::Placement;
use etendue_geometry::glam::DVec3;

use crate::light::mean;
use crate::reference::{SceneView, SurfacePoint};
use crate::spawn::magnitudes;
use crate::{Material, Paint};

/// More emissive triangles than this are not kept ready.
pub(crate) const MOST: usize = 4096;

/// A triangle in the world.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Shape {
    /// From the first corner to the others (m).
    pub(crate) edges: [DVec3; 2],
    /// Unit normal on the front.
    pub(crate) normal: DVec3,
    /// m².
    pub(crate) area: f64,
}

impl Shape {
    /// The triangle of a spot; `None` without area.
    fn of(spot: &SurfacePoint<'_>) -> Option<Self> {
        let place = &spot.placement.world_from_mesh;
        let [a, b, c] = spot.mesh.corners(spot.triangle);
        let edges = [place.linear * (b - a), place.linear * (c - a)];
        let cross = edges[0].cross(edges[1]);
        let length = cross.length();
        let normal = cross / length * place.handedness();
        normal.is_finite().then_some(Self { edges, normal, area: 0.5 * length })
    }
}

/// A triangle that shines, as seen from a point.
pub(crate) struct EmissiveTriangle<'a> {
    pub(crate) id: [u32; 2],
    pub(crate) spot: SurfacePoint<'a>,
    /// The first corner from the point (m).
    pub(crate) corner: DVec3,
    pub(crate) shape: Shape,
}

impl<'a> EmissiveTriangle<'a> {
    pub(crate) fn new(
        around: &SceneView<'a>,
        number: u32,
        triangle: u32,
        from: DVec3,
    ) -> Option<Self> {
        let placement = around.geometry.placements.get(number as usize)?;
        let spot = SurfacePoint::corner(around.geometry, placement, triangle as usize);
        let [corner, ..] = spot.mesh.corners(spot.triangle);
        let corner = placement.world_from_mesh.point_from(corner, from);
        Some(Self { id: [number, triangle], corner, shape: Shape::of(&spot)?, spot })
    }
}

/// A triangle that shines alike all over.
#[derive(Debug, Clone)]
pub(crate) struct AreaLight {
    /// Placement and triangle.
    pub(crate) id: [u32; 2],
    /// The first corner, turned into the world, and the placement's translation (m): its high part
    /// and its low one.
    pub(crate) corner: DVec3,
    pub(crate) translation: [DVec3; 2],
    pub(crate) shape: Shape,
    pub(crate) two_sided: bool,
    /// What the placement's own numbers add to the rounding of a point on it (m).
    pub(crate) magnitudes: DVec3,
}

impl AreaLight {
    /// Triangle `id`; `None` when its radiance is not alike all over, or it has no area.
    pub(crate) fn new(around: &SceneView<'_>, id: [u32; 2]) -> Option<Self> {
        let placement = around.geometry.placements.get(id[0] as usize)?;
        let spot = SurfacePoint::corner(around.geometry, placement, id[1] as usize);
        let emission = around.material(&spot)?.emission.as_ref()?;
        let Paint::Plain(_) = emission.radiance else { return None };
        let place = &placement.world_from_mesh;
        let [corner, ..] = spot.mesh.corners(spot.triangle);
        Some(Self {
            id,
            corner: place.linear * corner,
            translation: [place.translation, place.translation_low],
            shape: Shape::of(&spot)?,
            two_sided: emission.two_sided,
            magnitudes: magnitudes(placement, spot.mesh),
        })
    }
}

/// Power of an emissive triangle (W), by the paint at its middle and corners.
pub(crate) fn triangle_power(
    around: &SceneView<'_>,
    placement: &Placement,
    triangle: usize,
    material: &Material,
) -> f64 {
    let Some(emission) = &material.emission else { return 0.0 };
    let spot = SurfacePoint::corner(around.geometry, placement, triangle);
    let Some(Shape { area, .. }) = Shape::of(&spot) else { return 0.0 };
    let third = 1.0 / 3.0;
    let weights = [[third, third, third], [0.8, 0.1, 0.1], [0.1, 0.8, 0.1], [0.1, 0.1, 0.8]];
    let radiance: f64 = weights
        .map(|weights| {
            let [r, g, b, _] = around.paint(&emission.radiance, &SurfacePoint { weights, ..spot });
            mean(&[r, g, b])
        })
        .iter()
        .sum();
    let sides = if emission.two_sided { 2.0 } else { 1.0 };
    // A texture may be dark at all four and shine between them: no triangle is passed over.
    let least = match &emission.radiance {
        Paint::Plain(_) => 0.0,
        Paint::Checker { colors, .. } => mean(&colors[0]).max(mean(&colors[1])),
        Paint::Image { factor, .. } => 0.05 * mean(factor),
    };
    sides * PI * area * emission.strength * (radiance / 4.0).max(0.1 * least)
}
