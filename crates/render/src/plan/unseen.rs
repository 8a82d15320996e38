//! Surfaces that no ray of a picture can meet: those that stand outside of all chief rays of layers that look along
//! these alone. They are left out of the structure.
//!
//! Chief rays are taken as they are traced, for every kind of camera: their origins lie in a box of the camera's
//! frame, and their slopes between bounds. What a ray passes on its way forward then lies between four planes and in
//! front of a fifth, and a mesh whose box lies behind one of these is met by none.

use std::sync::Arc;

use etendue_camera::{Camera, Distortion, Pose, Projection};
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Bounds, Geometry, Mesh, Placement, Positions, RayBatch, Vertices};
use rayon::prelude::*;

/// Least distance of a box from a plane to lie behind it, as a share of the distance of it and of
/// the origins: what rounding to f32 may move.
const MARGIN: f64 = 1e-6;

/// Columns and rows of the rays by which it is judged whether it pays to take all.
const FEW: u32 = 16;

/// The placements of a scene that no ray of a picture can meet.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unseen {
    is_unseen: Arc<[bool]>,
    placements: usize,
    triangles: u64,
}

impl Unseen {
    /// Finds the parts of `geometry` that the chief rays of `camera` cannot meet; `None` where that
    /// is nothing, or where it would cost more to find than to build.
    #[must_use]
    pub fn of(geometry: &Geometry, camera: &Camera) -> Option<Self> {
        let [width, height] = camera.resolution();
        let pixels = u64::from(width) * u64::from(height);
        // Fewer rays have narrower bounds: what they may meet, all may.
        let few = Hull::of(camera, [width, height].map(|side| side.div_ceil(FEW).max(1)))?;
        let guess = Self::outside(&few, geometry)?;
        if is_linear(camera) {
            return Some(guess);
        }
        if guess.triangles < pixels {
            return None;
        }
        Self::outside(&Hull::of(camera, [1; 2])?, geometry)
    }

    fn outside(hull: &Hull, geometry: &Geometry) -> Option<Self> {
        let is_unseen = |placement: &Placement| {
            let bounds = geometry.loose_bounds_of(placement);
            placement.motion.is_none() && !bounds.is_empty() && hull.misses(&bounds)
        };
        let is_unseen: Vec<bool> = geometry.placements.par_iter().map(is_unseen).collect();
        let all = geometry.placements.iter().zip(&is_unseen);
        // A mesh that stands in sight, too, is built once for all.
        let mut is_needed = vec![false; geometry.meshes.len()];
        for (placement, _) in all.clone().filter(|(_, unseen)| !**unseen) {
            is_needed[placement.mesh as usize] = true;
        }
        let mut is_counted = is_needed;
        let mut triangles = 0;
        for (placement, _) in all.filter(|(_, unseen)| **unseen) {
            if !std::mem::replace(&mut is_counted[placement.mesh as usize], true) {
                triangles += geometry.mesh_of(placement).triangles.len() as u64;
            }
        }
        let placements = is_unseen.iter().filter(|unseen| **unseen).count();
        (placements > 0).then(|| Self { is_unseen: is_unseen.into(), placements, triangles })
    }

    /// Number of placements.
    #[must_use]
    pub fn placements(&self) -> usize {
        self.placements
    }

    /// Number of triangles that are not built, each stored one once.
    #[must_use]
    pub fn triangles(&self) -> u64 {
        self.triangles
    }

    /// True if nothing of this is missing in what was built without `other`.
    #[must_use]
    pub fn is_served_without(&self, other: &Self) -> bool {
        self.is_unseen.len() == other.is_unseen.len()
            && other.is_unseen.iter().zip(&*self.is_unseen).all(|(lacks, unseen)| *unseen || !lacks)
    }

    /// `geometry` with nothing in the places of these: the numbers of all placements are as they were.
    #[must_use]
    pub fn left_out_of(&self, geometry: &Geometry) -> Geometry {
        let mut left = geometry.clone();
        let none = u32::try_from(left.meshes.len()).unwrap_or(u32::MAX);
        let nothing = Positions::F32(Vertices::from_arrays(&[]));
        left.meshes.push(Mesh::new("nothing", nothing, Vec::new().into()));
        let placements = left.placements.iter_mut().zip(&*self.is_unseen);
        placements.filter(|(_, unseen)| **unseen).for_each(|(placement, _)| placement.mesh = none);
        left
    }
}

/// True if slopes are linear in columns and rows, so that those of the outermost pixels bound all.
fn is_linear(camera: &Camera) -> bool {
    let is_plain = |distortion: Option<&Distortion>| distortion.is_none();
    !camera.is_timed()
        && match camera.projection() {
            Projection::Pinhole(pinhole) => is_plain(pinhole.distortion()),
            Projection::Orthographic(_) => true,
            Projection::Lens(_) | Projection::Views(_) => false,
        }
}

/// Bounds of chief rays in the camera's frame: x right, y up, z forward.
#[derive(Debug, Clone, Copy)]
struct Hull {
    pose: Pose,
    origins: Bounds,
    /// Slopes to the right and up, the least and the greatest of each.
    slopes: [[f64; 2]; 2],
}

impl Hull {
    /// Of the chief rays of every so many columns and rows, the last ones among them; `None` where a ray does not
    /// run forward, or none sees anything.
    fn of(camera: &Camera, step: [u32; 2]) -> Option<Self> {
        let [width, height] = camera.resolution();
        let middles = |side: u32, step: u32| {
            let places = (0..side).step_by(step as usize).chain([side - 1]);
            places.map(|place| f64::from(place) + 0.5).collect::<Vec<_>>()
        };
        let (columns, rows) = (middles(width, step[0]), middles(height, step[1]));
        let pose = *camera.pose();
        let nothing =
            Self { pose, origins: Bounds::EMPTY, slopes: [[f64::INFINITY, f64::NEG_INFINITY]; 2] };
        let of_row = |row: &f64| {
            let mut rays = RayBatch::default();
            camera.rays_through(&columns, &vec![*row; columns.len()], &mut rays);
            (0..rays.len()).try_fold(nothing, |hull, i| hull.with(&rays, i))
        };
        let hulls = rows.par_iter().map(of_row);
        let hull = hulls.try_reduce(|| nothing, |a, b| Some(a.union(b)))?;
        (!hull.origins.is_empty()).then_some(hull)
    }

    fn in_frame(&self, direction: DVec3) -> DVec3 {
        let Pose { rotation, .. } = &self.pose;
        let DVec3 { x, y, z } = rotation.transpose() * direction;
        DVec3::new(x, y, -z)
    }

    /// These and a ray, unless that runs backwards or sideways.
    fn with(mut self, rays: &RayBatch, i: usize) -> Option<Self> {
        if rays.t_max()[i] < 0.0 {
            return Some(self);
        }
        let way = self.in_frame(rays.direction(i));
        if way.z <= 0.0 {
            return None;
        }
        self.origins.include(self.in_frame(rays.origin(i) - self.pose.position));
        for (slopes, slope) in self.slopes.iter_mut().zip([way.x / way.z, way.y / way.z]) {
            *slopes = [slopes[0].min(slope), slopes[1].max(slope)];
        }
        Some(self)
    }

    fn union(mut self, other: Self) -> Self {
        self.origins = self.origins.union(other.origins);
        for (slopes, other) in self.slopes.iter_mut().zip(other.slopes) {
            *slopes = [slopes[0].min(other[0]), slopes[1].max(other[1])];
        }
        self
    }

    /// True if no ray meets a box of the world.
    ///
    /// A ray from z = o passes z ≥ o at x ≤ ox + m (z − o), m its slope. Of all origins that is at most
    /// max ox + M (z − o), where o is the least for a greatest slope M ≥ 0 and the greatest for M < 0; linear
    /// in x and z, so that a box lies beyond where its corners do.
    fn misses(&self, bounds: &Bounds) -> bool {
        let corners = bounds.corners().map(|corner| self.in_frame(corner - self.pose.position));
        let Bounds { min, max } = self.origins;
        let reach = corners.iter().fold(min.length().max(max.length()), |r, c| r.max(c.length()));
        let margin = MARGIN * reach;
        let beyond = |of: &dyn Fn(&DVec3) -> f64| corners.iter().all(|corner| of(corner) > margin);
        let depth = |corner: &DVec3, is_far: bool| corner.z - if is_far { max.z } else { min.z };
        beyond(&|corner| min.z - corner.z)
            || (0..2).any(|axis| {
                let [least, most] = self.slopes[axis];
                // The slope counts for the distance from the plane, too.
                let steep = |slope: f64| 1.0 / slope.hypot(1.0);
                beyond(&|c| (c[axis] - max[axis] - most * depth(c, most < 0.0)) * steep(most))
                    || beyond(&|c| {
                        (min[axis] - c[axis] + least * depth(c, least > 0.0)) * steep(least)
                    })
            })
    }
}
