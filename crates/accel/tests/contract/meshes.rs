//! Meshes and rays that tests are made of, the same in every run.

use std::sync::Arc;

use etendue_geometry::glam::{DQuat, DVec3};
use etendue_geometry::{Geometry, Mesh, Placement, Positions, RayBatch, Transform, Vertices};

/// Uniform numbers (Vigna's splitmix64).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// In 0..1.
    pub(crate) fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 * 2f64.powi(-53)
    }

    /// In −1..1, each coordinate.
    pub(crate) fn cube(&mut self) -> DVec3 {
        DVec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }

    pub(crate) fn direction(&mut self) -> DVec3 {
        loop {
            let p = self.cube();
            if p.length() > 0.1 && p.length() <= 1.0 {
                return p.normalize();
            }
        }
    }

    pub(crate) fn rotation(&mut self) -> DQuat {
        DQuat::from_axis_angle(self.direction(), self.unit() * std::f64::consts::TAU)
    }
}

/// A closed, bumpy sphere of radius about 1: an octahedron whose triangles are split into
/// `detail`² each, so 8 `detail`² triangles. Corners are shared.
pub(crate) fn blob(detail: u32) -> Mesh {
    let n = i64::from(detail);
    let mut corners: Vec<[i64; 3]> = Vec::new();
    let mut triangles = Vec::new();
    for octant in 0..8 {
        let sign = [0, 1, 2].map(|axis| if octant >> axis & 1 == 0 { 1 } else { -1 });
        let mut corner = |i: i64, j: i64| {
            corners.push([i * sign[0], j * sign[1], (n - i - j) * sign[2]]);
            corners.len() - 1
        };
        for i in 0..n {
            for j in 0..n - i {
                triangles.push([corner(i, j), corner(i + 1, j), corner(i, j + 1)]);
                if i + j + 1 < n {
                    triangles.push([corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)]);
                }
            }
        }
        // An odd number of mirrors turns the winding over.
        if sign.iter().product::<i64>() < 0 {
            let first = triangles.len() - (n * n) as usize;
            triangles[first..].iter_mut().for_each(|t| t.swap(1, 2));
        }
    }
    let mut unique = corners.clone();
    unique.sort_unstable();
    unique.dedup();
    let find = |corner: usize| unique.binary_search(&corners[corner]).expect("listed") as u32;
    let positions: Vec<[f32; 3]> = unique
        .iter()
        .map(|corner| {
            let p = DVec3::from_array(corner.map(|c| c as f64)).normalize();
            let bump = (5.0 * p.x).sin() * (4.0 * p.y + 1.0).sin() * (3.0 * p.z + 2.0).sin();
            (p * (1.0 + 0.2 * bump)).to_array().map(|c| c as f32)
        })
        .collect();
    let triangles: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(find)).collect();
    mesh("blob", &positions, triangles)
}

/// `count` unconnected triangles of about the given size in the cube −1..1.
pub(crate) fn soup(count: u32, size: f64, seed: u64) -> Mesh {
    let mut random = Random(seed);
    let mut positions = Vec::new();
    for _ in 0..count {
        let centre = random.cube();
        for _ in 0..3 {
            positions.push((centre + random.cube() * size).to_array().map(|c| c as f32));
        }
    }
    mesh("soup", &positions, (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
}

pub(crate) fn mesh(name: &str, positions: &[[f32; 3]], triangles: Vec<[u32; 3]>) -> Mesh {
    Mesh::new(name, Positions::F32(Vertices::from_arrays(positions)), triangles.into())
}

pub(crate) fn placed(mesh: u32, world_from_mesh: Transform) -> Placement {
    Placement::of(mesh, world_from_mesh)
}

/// Each mesh once, where it is.
pub(crate) fn scene(meshes: Vec<Mesh>) -> Arc<Geometry> {
    let placements = (0..meshes.len()).map(|i| placed(i as u32, Transform::IDENTITY)).collect();
    Arc::new(Geometry { meshes, placements })
}

pub(crate) fn at(meshes: Vec<Mesh>, placements: Vec<Placement>) -> Arc<Geometry> {
    Arc::new(Geometry { meshes, placements })
}

/// Rays about `centre`: from outside inwards, from inside outwards, along the axes, and with
/// limits.
pub(crate) fn rays(count: usize, centre: DVec3, size: f64, seed: u64) -> RayBatch {
    let mut random = Random(seed);
    let mut rays = RayBatch::with_capacity(count);
    for i in 0..count {
        let target = random.cube() * 0.9;
        let origin = match i % 3 {
            0 => random.direction() * 4.0,
            1 => random.cube(),
            _ => random.cube() * 0.1,
        };
        let along = (target - origin).normalize();
        let axes = [DVec3::X, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_X];
        let direction = if i % 5 == 4 { axes[i / 5 % 4] } else { along };
        let limits = match i % 7 {
            0 => (0.5, 3.0),
            1 => (0.0, 1.0),
            _ => (0.0, f64::INFINITY),
        };
        let at = centre + origin * size;
        rays.push_between(at, direction, limits.0 * size, limits.1 * size);
    }
    rays
}
