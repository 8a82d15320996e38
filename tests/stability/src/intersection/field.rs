//! Meshes, rays, and the difference between two answers.

use std::f64::consts::TAU;
use std::ops::Add;
use std::sync::Arc;

use etendue_accel::{Accel, AccelName, BuildError, BuildOptions};
use etendue_geometry::glam::DVec3;
use etendue_geometry::units::Metres;
use etendue_geometry::{
    Detail, Geometry, HitBatch, Mesh, Placement, Positions, RayBatch, Transform, Vertices,
};
use etendue_scene::import::Wanted;
use etendue_scene::shape::{ShapeError, ShapeSpec};
use fastrand::Rng;
use rayon::prelude::*;

/// Rays in a batch, as a render has them.
pub(super) const BATCH: usize = 256;

type Build = Box<dyn Fn(Arc<Geometry>) -> Result<Box<dyn Accel>, BuildError>>;

/// All backends in their default modes.
pub(super) fn backends() -> impl Iterator<Item = (&'static str, Build)> {
    AccelName::ALL.into_iter().map(|name| -> (_, Build) {
        (name.name(), Box::new(move |geometry| built(name, geometry)))
    })
}

fn built(name: AccelName, geometry: Arc<Geometry>) -> Result<Box<dyn Accel>, BuildError> {
    name.build(geometry, &BuildOptions::default())
}

pub(super) fn embree(geometry: Arc<Geometry>) -> Result<Box<dyn Accel>, BuildError> {
    built(AccelName::Embree, geometry)
}

pub(super) fn bvh(geometry: Arc<Geometry>) -> Result<Box<dyn Accel>, BuildError> {
    built(AccelName::Bvh, geometry)
}

pub(super) fn exact(geometry: Arc<Geometry>) -> Result<Box<dyn Accel>, BuildError> {
    built(AccelName::Exact, geometry)
}

/// A closed surface with hills, of mean radius 1, seen whole from its centre.
pub(super) fn blob(triangles: u64) -> Result<Mesh, ShapeError> {
    let shape = ShapeSpec::Blob { radius: Metres(1.0), triangles, seed: 7, amplitude: 0.1 };
    shape.build(Wanted::NOTHING)
}

/// A cube of half-edge 1.
pub(super) fn cube() -> Result<Mesh, ShapeError> {
    ShapeSpec::Box { size: [Metres(2.0); 3] }.build(Wanted::NOTHING)
}

pub(super) fn mesh(name: &str, corners: &[[f32; 3]], triangles: Vec<[u32; 3]>) -> Mesh {
    Mesh::new(name, Positions::F32(Vertices::from_arrays(corners)), triangles.into())
}

/// Triangles of three corners each, which share none.
pub(super) fn loose(name: &str, corners: &[[f32; 3]]) -> Mesh {
    let triangles = (0..).step_by(3).take(corners.len() / 3).map(|i| [i, i + 1, i + 2]);
    mesh(name, corners, triangles.collect())
}

pub(super) fn placed(mesh: u32, world_from_mesh: Transform) -> Placement {
    Placement::of(mesh, world_from_mesh)
}

/// Each mesh once, where it is.
pub(super) fn scene(meshes: Vec<Mesh>) -> Arc<Geometry> {
    let placements = (0..).take(meshes.len()).map(|i| placed(i, Transform::IDENTITY)).collect();
    Arc::new(Geometry { meshes, placements })
}

pub(super) fn at(mesh: Mesh, places: &[Transform]) -> Arc<Geometry> {
    let placements = places.iter().map(|&place| placed(0, place)).collect();
    Arc::new(Geometry { meshes: vec![mesh], placements })
}

/// A direction, all of them equally likely.
pub(super) fn direction(random: &mut Rng) -> DVec3 {
    let z = 2.0 * random.f64() - 1.0;
    let (sin, cos) = (TAU * random.f64()).sin_cos();
    let r = (1.0 - z * z).sqrt();
    DVec3::new(r * cos, r * sin, z)
}

/// A point of the cube −1..1.
pub(super) fn in_cube(random: &mut Rng) -> DVec3 {
    DVec3::new(random.f64(), random.f64(), random.f64()) * 2.0 - 1.0
}

/// Rays given one after the other, in batches.
#[derive(Debug, Default)]
pub(super) struct Rays {
    pub(super) batches: Vec<RayBatch>,
}

impl Rays {
    pub(super) fn push(&mut self, origin: DVec3, direction: DVec3) {
        if self.batches.last().is_none_or(|batch| batch.len() == BATCH) {
            self.batches.push(RayBatch::with_capacity(BATCH));
        }
        if let Some(batch) = self.batches.last_mut() {
            batch.push(origin, direction);
        }
    }

    pub(super) fn len(&self) -> usize {
        self.batches.iter().map(RayBatch::len).sum()
    }

    /// The same rays traced as packets, or one by one.
    pub(super) fn set_coherent(&mut self, coherent: bool) {
        self.batches.iter_mut().for_each(|batch| batch.coherent = coherent);
    }

    /// The same rays, which leave surfaces.
    pub(super) fn set_from_surface(&mut self) {
        self.batches.iter_mut().for_each(|batch| batch.from_surface = true);
    }
}

/// `count` rays from a sphere of radius 4 to anywhere within `reach` of the centre of `place`.
pub(super) fn inwards(count: usize, reach: f64, place: &Transform, seed: u64) -> Rays {
    let mut random = Rng::with_seed(seed);
    let mut rays = Rays::default();
    for _ in 0..count {
        let origin = place.point(direction(&mut random) * 4.0);
        let way = place.point_from(in_cube(&mut random) * reach, origin);
        rays.push(origin, way.normalize());
    }
    rays
}

pub(super) fn closest(accel: &dyn Accel, rays: &RayBatch) -> HitBatch {
    let mut hits = HitBatch::new(Detail::Surface);
    accel.closest(rays, &mut hits);
    hits
}

/// By how much one backend's answers differ from another's.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Difference {
    pub(super) rays: usize,
    /// Hits of the other alone.
    pub(super) missed: usize,
    /// Hits of this one alone.
    pub(super) invented: usize,
    /// Hits on another triangle at another distance.
    pub(super) other: usize,
    /// Rays whose occlusion is not what the other's closest hit says.
    pub(super) occlusion: usize,
    /// The largest error of a distance on the same triangle, over the size of the coordinates that it
    /// is a difference of.
    pub(super) distance: f64,
    /// The largest angle (rad) between normals of the same triangle.
    pub(super) normal: f64,
}

impl Difference {
    /// Rays that do not see the same.
    pub(super) fn hits(&self) -> usize {
        self.missed + self.invented + self.other + self.occlusion
    }

    pub(super) fn is_none(&self) -> bool {
        self.hits() == 0 && self.distance == 0.0 && self.normal == 0.0
    }

    /// Differences of the answers of `ours` from those of `truth`.
    pub(super) fn between(truth: &dyn Accel, ours: &dyn Accel, rays: &Rays) -> Self {
        let batches = rays.batches.par_iter();
        let each = batches.map(|rays| {
            let mut blocked = Vec::new();
            ours.occluded(rays, &mut blocked);
            Self::of(&closest(truth, rays), &closest(ours, rays), &blocked, rays)
        });
        each.reduce(Self::default, Self::add)
    }

    fn of(truth: &HitBatch, ours: &HitBatch, blocked: &[bool], rays: &RayBatch) -> Self {
        let mut all = Self { rays: rays.len(), ..Self::default() };
        for (i, &blocked) in blocked.iter().enumerate() {
            all.occlusion += usize::from(blocked != truth.is_hit(i));
            match (truth.is_hit(i), ours.is_hit(i)) {
                (false, false) => continue,
                (true, false) => all.missed += 1,
                (false, true) => all.invented += 1,
                (true, true) => {}
            }
            let same =
                (truth.placement[i], truth.triangle[i]) == (ours.placement[i], ours.triangle[i]);
            let size = truth.t[i] + rays.origin(i).abs().max_element();
            let distance = (ours.t[i] - truth.t[i]).abs() / size;
            if same {
                all.distance = all.distance.max(distance);
                all.normal = all.normal.max(ours.normal(i).distance(truth.normal(i)));
            } else if truth.is_hit(i) && ours.is_hit(i) {
                // Where two triangles meet, either may come first by the last digit.
                all.other += usize::from(distance > 1e-12);
            }
        }
        all
    }
}

impl Add for Difference {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            rays: self.rays + other.rays,
            missed: self.missed + other.missed,
            invented: self.invented + other.invented,
            other: self.other + other.other,
            occlusion: self.occlusion + other.occlusion,
            distance: self.distance.max(other.distance),
            normal: self.normal.max(other.normal),
        }
    }
}

/// 12345678 as 12 345 678.
pub(super) fn grouped(count: usize) -> String {
    let digits = count.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(' ');
        }
        text.push(digit);
    }
    text
}
