//! Emissive triangles, ready to be asked many times.

use std::f64::consts::{FRAC_PI_2, PI};

use etendue_geometry::glam::DVec3;
use etendue_geometry::{Bounds, Geometry, Mesh, Placement, Sweep};

use crate::light::mean;
use crate::light_tree::Cluster;
use crate::material::{Alpha, Emission};
use crate::reference::{SceneView, SurfacePoint};
use crate::spawn::magnitudes;
use crate::{Color, Material, Paint, SceneCurve};

/// More emissive triangles than this are not kept ready.
pub(crate) const MOST: usize = 1 << 16;

/// A triangle in the world.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LightTriangle {
    /// From the first corner to the others (m).
    pub(crate) edges: [DVec3; 2],
    /// Unit normal on the front.
    pub(crate) normal: DVec3,
    /// m².
    pub(crate) area: f64,
}

impl LightTriangle {
    /// The triangle of a point at its time; `None` without area.
    pub(crate) fn of(point: &SurfacePoint<'_>) -> Option<Self> {
        let place = &point.placement.world_from_mesh_at(point.time);
        let [a, b, c] = point.mesh.corners_at(point.triangle, point.time);
        let edges = [place.linear * (b - a), place.linear * (c - a)];
        let cross = edges[0].cross(edges[1]);
        let length = cross.length();
        let normal = cross / length * place.handedness();
        normal.is_finite().then_some(Self { edges, normal, area: 0.5 * length })
    }
}

/// A triangle that shines, ready to be asked.
#[derive(Debug, Clone)]
pub(crate) struct AreaLight {
    /// Placement and triangle.
    pub(crate) id: [u32; 2],
    /// The first corner in the world (m): what f64 holds of it, and what is left.
    pub(crate) corner: [DVec3; 2],
    pub(crate) shape: LightTriangle,
    pub(crate) two_sided: bool,
    /// It shines alike all over.
    pub(crate) is_plain: bool,
    /// Magnitudes of the placement's own numbers, which add to the rounding of a point on it (m).
    pub(crate) magnitudes: DVec3,
}

impl AreaLight {
    /// Triangle `id` at a time (s from the frame's time); `None` when it does not shine or has no area.
    pub(crate) fn at(scene: &SceneView<'_>, id: [u32; 2], time: f64) -> Option<Self> {
        let placement = scene.geometry.placements.get(id[0] as usize)?;
        let corner = SurfacePoint::corner(scene.geometry, placement, id[1] as usize);
        let point = SurfacePoint { time, ..corner };
        let material = scene.material(&point)?;
        let emission = material.emission.as_ref()?;
        let place = &placement.world_from_mesh_at(time);
        let [corner, ..] = point.mesh.corners_at(point.triangle, time);
        let (turned, far) = (place.linear * corner, place.translation);
        // Knuth's sum of two numbers without loss.
        let sum = turned + far;
        let of_turned = sum - far;
        let lost = (turned - of_turned) + (far - (sum - of_turned));
        Some(Self {
            id,
            corner: [sum, lost + place.translation_low],
            shape: LightTriangle::of(&point)?,
            two_sided: emission.two_sided,
            is_plain: matches!(emission.radiance, Paint::Plain(_) | Paint::Curve { .. })
                && material.alpha == Alpha::Opaque,
            magnitudes: magnitudes(placement, point.mesh),
        })
    }

    /// From a point of the world to the place with these weights of the second and third corner (m).
    pub(crate) fn offset(&self, from: DVec3, [u, v]: [f64; 2]) -> DVec3 {
        let [corner, rest] = self.corner;
        ((corner - from) + rest) + self.across([u, v])
    }

    /// From the first corner to that place (m).
    pub(crate) fn across(&self, [u, v]: [f64; 2]) -> DVec3 {
        self.shape.edges[0] * u + self.shape.edges[1] * v
    }
}

/// Cluster of an emissive triangle of some power (W): where it is and shines, at a time (s from the frame's time) or,
/// of a placement that moves, while it does; `None` without area.
pub(crate) fn cluster(
    scene: &SceneView<'_>,
    id: [u32; 2],
    time: f64,
    power: f64,
    way: Option<&AreaLightMotion<'_>>,
) -> Option<Cluster> {
    let AreaLight { corner, shape, two_sided, .. } = AreaLight::at(scene, id, time)?;
    let mut bounds = Bounds::default();
    for offset in [DVec3::ZERO, shape.edges[0], shape.edges[1]] {
        bounds.include(corner[0] + offset);
    }
    let sides = if two_sided { 2.0 } else { 1.0 };
    let (cone, bounds) = match way {
        None => (if two_sided { PI } else { 0.0 }, bounds),
        Some(way) => (if two_sided || way.turns { PI } else { 0.0 }, way.bounds_of(id[1] as usize)),
    };
    let intensity = power / (sides * PI);
    Some(Cluster { bounds, axis: shape.normal, cone, reach: FRAC_PI_2, intensity })
}

/// Corners of triangles at steps of a mesh that changes its shape, beyond which all are taken to be anywhere in its box.
const MOST_CORNERS: usize = 1 << 16;

/// The way of a placement that shines and moves.
pub(crate) struct AreaLightMotion<'a> {
    mesh: &'a Mesh,
    sweep: Sweep,
    /// Its triangles do not shine the same way all the time.
    turns: bool,
    /// The box around all of them (m, world), where that is taken for the box of each.
    whole: Option<Bounds>,
}

impl<'a> AreaLightMotion<'a> {
    /// That of a placement between two times (s from the frame's time); `None` of one without a motion.
    pub(crate) fn of(
        geometry: &'a Geometry,
        placement: &Placement,
        span: [f64; 2],
    ) -> Option<Self> {
        let motion = placement.motion.as_ref()?;
        let mesh = geometry.mesh_of(placement);
        let local = mesh.bounds_at_all_times();
        if local.is_empty() {
            return None;
        }
        let sweep = motion.sweep(local, span);
        let turns = motion.turns_within(span) || mesh.steps.is_some();
        let steps = mesh.steps.as_ref().map_or(1, |steps| steps.times().len());
        let are_many = steps > 1 && steps * mesh.triangles.len() > MOST_CORNERS;
        let whole = are_many.then(|| sweep.bounds_of(&local.corners()));
        Some(Self { mesh, sweep, turns, whole })
    }

    /// A box (m, world) around all places of a triangle.
    fn bounds_of(&self, triangle: usize) -> Bounds {
        let places = |at: f64| self.mesh.corners_at(triangle, at);
        self.whole.unwrap_or_else(|| match &self.mesh.steps {
            None => self.sweep.bounds_of(&places(0.0)),
            Some(steps) => {
                let corners: Vec<DVec3> = steps.times().iter().flat_map(|&at| places(at)).collect();
                self.sweep.bounds_of(&corners)
            }
        })
    }
}

/// Power of an emissive triangle (W) at a time (s from the frame's time), by the paint at its middle and corners.
pub(crate) fn triangle_power(
    scene: &SceneView<'_>,
    placement: &Placement,
    triangle: usize,
    material: &Material,
    time: f64,
) -> f64 {
    let Some(emission) = &material.emission else { return 0.0 };
    let corner = SurfacePoint::corner(scene.geometry, placement, triangle);
    let point = SurfacePoint { time, ..corner };
    let Some(LightTriangle { area, .. }) = LightTriangle::of(&point) else { return 0.0 };
    let third = 1.0 / 3.0;
    let weights = [[third, third, third], [0.8, 0.1, 0.1], [0.1, 0.8, 0.1], [0.1, 0.1, 0.8]];
    let radiance: f64 = weights
        .map(|weights| {
            let [r, g, b, _] = scene.paint(&emission.radiance, &SurfacePoint { weights, ..point });
            mean(&[r, g, b])
        })
        .iter()
        .sum();
    let sides = if emission.two_sided { 2.0 } else { 1.0 };
    // A texture may be dark at all four and shine between them: no triangle is passed over.
    let least = match &emission.radiance {
        Paint::Plain(_) | Paint::Curve { .. } => 0.0,
        // Light that nobody sees, too.
        Paint::Cube { cube, .. } => cube.cube.brightest(),
        Paint::Checker { colors, curves, .. } => {
            let unseen = curves.iter().flat_map(|both| both.each_ref());
            let unseen = unseen.map(|one| one.curve.extent()[1]).fold(0.0, f64::max);
            mean(&colors[0]).max(mean(&colors[1])).max(unseen)
        }
        Paint::Image { factor, .. } => 0.05 * mean(factor),
    };
    sides * PI * area * emission.strength * (radiance / 4.0).max(0.1 * least)
}

/// A bound of what a surface gives off where its spectrum is that of its paint, per band (W/(m² sr)).
pub(crate) fn brightest(scene: &SceneView<'_>, emission: &Emission) -> f64 {
    let most = |color: &Color| color.iter().copied().fold(0.0, f64::max);
    let peak = |curve: &SceneCurve| curve.curve.extent()[1];
    let of_paint = match &emission.radiance {
        Paint::Plain(color) => most(color),
        Paint::Curve { look, curve } => most(look).max(peak(curve)),
        Paint::Checker { colors, curves, .. } => {
            let curves = curves.iter().flat_map(|both| both.each_ref()).map(peak);
            curves.fold(most(&colors[0]).max(most(&colors[1])), f64::max)
        }
        Paint::Image { factor, curve, image } => {
            let of_image = scene.images.get(image.texture as usize).and_then(Option::as_ref);
            let factor = curve.as_ref().map_or(0.0, peak).max(most(factor));
            factor * of_image.map_or(1.0, |image| image.brightest())
        }
        Paint::Cube { cube, .. } => cube.cube.peak(),
    };
    emission.strength * of_paint
}
