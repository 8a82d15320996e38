//! The meshes that are traced. All are about a metre in size around the origin, except the forest.

use std::sync::Arc;

use etendue_geometry::glam::{DQuat, DVec3};
use etendue_geometry::units::Metres;
use etendue_geometry::{Buffer, Geometry, Mesh, Placement, Positions, Transform, Vertices};
use etendue_scene::import::Wanted;
use etendue_scene::shape::{ShapeError, ShapeSpec};

/// Numbers that look random and are the same on every machine (Steele, Lea and Flood 2014,
/// "Fast splittable pseudorandom number generators": `SplitMix64`).
#[derive(Debug, Clone)]
pub struct Random(u64);

impl Random {
    /// The sequence of `seed`.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next number in 0..1.
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A direction, all of them equally likely.
    pub fn direction(&mut self) -> DVec3 {
        let z = 2.0 * self.unit() - 1.0;
        let angle = std::f64::consts::TAU * self.unit();
        let r = (1.0 - z * z).sqrt();
        DVec3::new(r * angle.cos(), r * angle.sin(), z)
    }

    /// A point of the unit ball, all of them equally likely.
    pub fn in_ball(&mut self) -> DVec3 {
        self.direction() * self.unit().cbrt()
    }
}

/// One mesh where it is.
fn alone(mesh: Mesh) -> Arc<Geometry> {
    Arc::new(Geometry::alone(mesh, Transform::IDENTITY))
}

/// A closed sphere with hills and valleys: coherent surfaces, small triangles.
///
/// # Errors
///
/// When there cannot be so many triangles.
pub fn blob(triangles: u64) -> Result<Arc<Geometry>, ShapeError> {
    blob_mesh(triangles).map(alone)
}

fn blob_mesh(triangles: u64) -> Result<Mesh, ShapeError> {
    let shape = ShapeSpec::Blob { radius: Metres(1.0), triangles, seed: 7, amplitude: 0.25 };
    shape.build(Wanted::NOTHING)
}

/// Triangles anywhere and anyhow in a ball: boxes that overlap, no surface to follow.
#[must_use]
pub fn soup(triangles: u32) -> Arc<Geometry> {
    let mut random = Random::new(11);
    // An edge that keeps the share of rays that get through alike for any number of triangles.
    let edge = 2.0 / f64::from(triangles).sqrt();
    let mut corners = Vec::with_capacity(triangles as usize * 3);
    for _ in 0..triangles {
        let centre = random.in_ball();
        corners.extend((0..3).map(|_| (centre + random.in_ball() * edge).as_vec3().to_array()));
    }
    let indices: Vec<[u32; 3]> = (0..triangles).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let positions = Positions::F32(Vertices::from_arrays(&corners));
    alone(Mesh::new("soup", positions, Buffer::from(indices)))
}

/// Blobs of 10 000 triangles, `side` × `side` of them on the plane y = 0, two metres apart, each
/// turned and scaled.
///
/// # Errors
///
/// Never with these triangles; the shape is asked all the same.
pub fn forest(side: u32) -> Result<Arc<Geometry>, ShapeError> {
    let mut random = Random::new(5);
    let mut placements = Vec::with_capacity(side as usize * side as usize);
    let half = f64::from(side - 1) / 2.0;
    for z in 0..side {
        for x in 0..side {
            let shift = DVec3::new(random.unit() - 0.5, 0.0, random.unit() - 0.5);
            let place = 2.0 * (DVec3::new(f64::from(x) - half, 0.0, f64::from(z) - half)) + shift;
            let turn = DQuat::from_rotation_y(std::f64::consts::TAU * random.unit());
            let scale = DVec3::splat(0.5 + random.unit());
            placements.push(Placement::of(0, Transform::from_trs(place, turn, scale)));
        }
    }
    Ok(Arc::new(Geometry { meshes: vec![blob_mesh(10_000)?], placements }))
}
