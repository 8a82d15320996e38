//! Surfaces that shine, by themselves: a direction that is followed for its light alone asks these
//! first, and the whole scene only where one of them is met.
//!
//! A path adds the same light as if the whole scene were asked for its closest hit. Most such
//! directions meet no light, and those that do need a shadow ray, which is cheaper than a closest hit.

use std::sync::Arc;

use etendue_accel::{Accel, BuildOptions, Bvh};
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Float, Geometry, HitBatch, MISS, RayBatch};

use crate::Material;

/// Emissive surfaces are kept apart when they are at most this share of the scene's triangles.
const MOST: f64 = 0.125;

/// The emissive surfaces of a scene.
#[derive(Debug)]
pub struct Emitters {
    /// `None` when nothing shines.
    accel: Option<Bvh>,
    /// The scene's number of each placement of the structure.
    numbers: Vec<u32>,
    /// A sphere around them (m): its centre, and its radius with room for rounding.
    centre: DVec3,
    radius: f64,
}

/// A sphere around all emissive surfaces.
#[derive(Debug, Clone, Copy)]
pub(crate) struct EmitterSphere<F> {
    /// m.
    pub(crate) centre: [F; 3],
    /// m; below zero where nothing shines.
    pub(crate) radius: F,
}

impl Emitters {
    /// The emissive surfaces among the placements of `geometry`; `None` when there are too many for
    /// this to be of use, or one of them moves.
    #[must_use]
    pub fn of(geometry: &Geometry, materials: &[Material]) -> Option<Self> {
        let mut own = Geometry { meshes: geometry.meshes.clone(), placements: Vec::new() };
        let mut numbers = Vec::new();
        for (number, placement) in (0_u32..).zip(&geometry.placements) {
            let material = materials.get(placement.material as usize);
            if material.is_some_and(|material| material.emission.is_some()) {
                // Where it is, only the whole scene's structure knows.
                if placement.motion.is_some() {
                    return None;
                }
                own.placements.push(placement.clone());
                numbers.push(number);
            }
        }
        if numbers.is_empty() {
            return Some(Self { accel: None, numbers, centre: DVec3::ZERO, radius: -1.0 });
        }
        if own.triangles() as f64 > MOST * geometry.triangles() as f64 {
            return None;
        }
        keep_placed_meshes(&mut own);
        let bounds = own.loose_bounds();
        let centre = bounds.centre();
        let rounding = 1e-9 * (bounds.diagonal() + centre.length());
        let radius = 0.5 * bounds.diagonal() + rounding;
        let accel = Bvh::build(Arc::new(own), &BuildOptions::default()).ok()?;
        Some(Self { accel: Some(accel), numbers, centre, radius })
    }

    /// Tests whether nothing shines.
    pub(crate) fn is_empty(&self) -> bool {
        self.accel.is_none()
    }

    /// A sphere around them, relative to `origin` (m), with room for rounding.
    pub(crate) fn sphere<F: Float>(&self, origin: DVec3) -> EmitterSphere<F> {
        let centre = self.centre - origin;
        let epsilon: f64 = F::EPSILON.into();
        let room = 4.0 * epsilon * (centre.length() + self.radius);
        let radius = if self.radius >= 0.0 { self.radius + room } else { -1.0 };
        EmitterSphere { centre: centre.to_array().map(F::of), radius: F::of(radius) }
    }

    /// The closest emissive surface along each ray, by the scene's numbers.
    pub(crate) fn closest(&self, rays: &RayBatch, hits: &mut HitBatch) {
        match &self.accel {
            Some(accel) => accel.closest(rays, hits),
            None => hits.reset(rays.len()),
        }
        for number in hits.placement.iter_mut().filter(|number| **number != MISS) {
            *number = self.numbers[*number as usize];
        }
    }
}

/// Leaves out meshes that nothing places, which a structure would be built over.
fn keep_placed_meshes(geometry: &mut Geometry) {
    let mut number = vec![None; geometry.meshes.len()];
    let mut kept = Vec::new();
    for placement in &mut geometry.placements {
        let old = placement.mesh as usize;
        let new = *number[old].get_or_insert_with(|| {
            kept.push(geometry.meshes[old].clone());
            u32::try_from(kept.len() - 1).unwrap_or(u32::MAX)
        });
        placement.mesh = new;
    }
    geometry.meshes = kept;
}
