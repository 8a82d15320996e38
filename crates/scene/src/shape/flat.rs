//! Shapes with flat faces.

use etendue_geometry::glam::DVec3;
use etendue_geometry::{Mesh, Positions, Vertices};

use crate::import::Wanted;

/// Corners of a face, in units of its half axes, counter-clockwise from the lower left.
const CORNERS: [[f64; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];

/// A face's centre and half axes, to the right and up as seen from its front.
struct Face {
    centre: DVec3,
    right: DVec3,
    up: DVec3,
}

/// A rectangle of half width and half height in the plane z = 0, facing +Z.
pub(super) fn rectangle([width, height]: [f64; 2], wanted: Wanted) -> Mesh {
    let face = Face { centre: DVec3::ZERO, right: DVec3::X * width, up: DVec3::Y * height };
    mesh("rectangle", &[face], wanted)
}

/// A box of these half sizes.
pub(super) fn cuboid([x, y, z]: [f64; 3], wanted: Wanted) -> Mesh {
    let [x, y, z] = [DVec3::X * x, DVec3::Y * y, DVec3::Z * z];
    let faces = [
        Face { centre: x, right: -z, up: y },
        Face { centre: -x, right: z, up: y },
        Face { centre: y, right: x, up: -z },
        Face { centre: -y, right: x, up: z },
        Face { centre: z, right: x, up: y },
        Face { centre: -z, right: -x, up: y },
    ];
    mesh("box", &faces, wanted)
}

fn mesh(name: &str, faces: &[Face], wanted: Wanted) -> Mesh {
    let per_corner = |value: &dyn Fn(&Face, [f64; 2]) -> DVec3| -> Vec<[f32; 3]> {
        let corners = faces.iter().flat_map(|face| CORNERS.map(|corner| value(face, corner)));
        corners.map(|v| v.as_vec3().to_array()).collect()
    };
    let positions = per_corner(&|face, [u, v]| face.centre + face.right * u + face.up * v);
    let first_corners = (0_u32..).step_by(4).take(faces.len());
    let triangles: Vec<[u32; 3]> =
        first_corners.flat_map(|i| [[i, i + 1, i + 2], [i, i + 2, i + 3]]).collect();
    let positions = Positions::F32(Vertices::from_arrays(&positions));
    let mut mesh = Mesh::new(name, positions, triangles.into());
    if wanted.normals {
        let normals = per_corner(&|face, _| face.right.cross(face.up).normalize());
        mesh.normals = Some(Vertices::from_arrays(&normals));
    }
    if wanted.uvs {
        let corner_uvs = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];
        mesh.uvs = vec![Vertices::from_arrays(&corner_uvs.repeat(faces.len()))];
    }
    mesh
}
