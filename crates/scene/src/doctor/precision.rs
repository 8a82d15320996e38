//! How exactly places of a scene can be told, before anything is rendered.

use etendue_geometry::glam::DVec3;
use etendue_geometry::{Bounds, Geometry, Positions};
use serde::Serialize;

/// Steps between neighbouring numbers at the scene's size and distance (m).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct StepSizes {
    /// The largest coordinate in world space (m).
    pub farthest_coordinate: f64,
    /// The step of the coordinates as the files store them, carried into the world (m): finer than
    /// this the input does not say.
    pub input_step: f64,
    /// The step of f32 at the farthest coordinate (m): what a renderer loses that traces world
    /// coordinates in f32.
    pub f32_step_in_world: f64,
    /// The step of f32 at half the scene's size (m): with this the triangle is found, relative to
    /// the scene's centre.
    pub f32_step_from_centre: f64,
    /// The step of f64 at the farthest coordinate (m): with this the hit is measured.
    pub f64_step: f64,
}

impl StepSizes {
    /// The forecast; `None` for a scene without triangles.
    pub(super) fn of(geometry: &Geometry, around: Bounds) -> Option<Self> {
        if around.is_empty() {
            return None;
        }
        let farthest = largest(around.min).max(largest(around.max));
        Some(Self {
            farthest_coordinate: farthest,
            input_step: input_step(geometry),
            f32_step_in_world: step(farthest, f32::EPSILON.into()),
            f32_step_from_centre: step(largest(around.max - around.centre()), f32::EPSILON.into()),
            f64_step: step(farthest, f64::EPSILON),
        })
    }
}

fn largest(v: DVec3) -> f64 {
    v.abs().max_element()
}

/// The step between neighbouring numbers at `value`, for numbers of this relative step.
fn step(value: f64, epsilon: f64) -> f64 {
    if value > 0.0 && value.is_finite() { value.log2().floor().exp2() * epsilon } else { 0.0 }
}

/// The largest step of a stored coordinate, scaled as its placement does.
fn input_step(geometry: &Geometry) -> f64 {
    let steps = geometry.placements.iter().map(|placement| {
        let mesh = geometry.mesh_of(placement);
        if mesh.bounds.is_empty() || !geometry.has_area(placement) {
            return 0.0;
        }
        let epsilon = match mesh.positions {
            Positions::F32(_) => f64::from(f32::EPSILON),
            Positions::F64(_) => f64::EPSILON,
        };
        let local = largest(mesh.bounds.min).max(largest(mesh.bounds.max));
        let linear = placement.world_from_mesh.linear;
        let scale = [linear.x_axis, linear.y_axis, linear.z_axis]
            .iter()
            .fold(0.0, |most: f64, axis| most.max(axis.length()));
        step(local, epsilon) * scale
    });
    steps.fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use etendue_geometry::glam::DMat3;
    use etendue_geometry::{Mesh, Transform, Vertices};

    use super::*;

    #[test]
    fn steps_are_those_of_the_number_formats() {
        assert_eq!(step(1.0, f32::EPSILON.into()), f64::from(f32::EPSILON));
        assert_eq!(step(1e7, f32::EPSILON.into()), 1.0, "above 2²³ f32 has whole numbers only");
        assert_eq!(step(0.0, 1.0), 0.0);
    }

    #[test]
    fn a_scene_far_away_is_found_from_its_centre() {
        let corners = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]];
        let positions = Positions::F32(Vertices::from_arrays(&corners));
        let mesh = Mesh::new("", positions, vec![[0, 1, 2]].into());
        let geometry =
            Geometry::alone(mesh, Transform::new(DMat3::IDENTITY * 0.5, DVec3::splat(1e7)));
        let forecast = StepSizes::of(&geometry, geometry.bounds()).unwrap();
        assert_eq!(forecast.f32_step_in_world, 1.0);
        assert_eq!(forecast.f32_step_from_centre, 0.5 * f64::from(f32::EPSILON));
        assert_eq!(forecast.input_step, f64::from(f32::EPSILON), "2 m stored, halved on placing");
        assert!(StepSizes::of(&Geometry::default(), Bounds::EMPTY).is_none());
    }
}
