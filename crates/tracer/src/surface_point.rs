//! A place on a mesh, and what the mesh says of it.

use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{Geometry, Mesh, Placement, Vertices};

use crate::Footprint;
use crate::pyramid::mean_of_squares;

/// A place on a mesh.
#[derive(Debug, Clone, Copy)]
pub struct SurfacePoint<'a> {
    /// Placement of the mesh.
    pub placement: &'a Placement,
    /// Its mesh.
    pub mesh: &'a Mesh,
    /// Index of the triangle in the mesh.
    pub triangle: usize,
    /// Barycentric weights of its corners.
    pub weights: [f64; 3],
    /// Time at which it is looked at (s from the frame's time), as far as that counts: 0 where nothing moves.
    pub time: f64,
    /// Area of the surface that is seen at once; a point when absent.
    pub footprint: Option<Footprint>,
}

impl<'a> SurfacePoint<'a> {
    /// The first corner of a triangle.
    #[must_use]
    pub fn corner(geometry: &'a Geometry, placement: &'a Placement, triangle: usize) -> Self {
        let mesh = geometry.mesh_of(placement);
        Self { placement, mesh, triangle, weights: [1.0, 0.0, 0.0], time: 0.0, footprint: None }
    }

    /// The axes of the ellipse that the footprint covers, in texture coordinates of a set; `None`
    /// where there is no footprint or no texture coordinates.
    #[must_use]
    pub fn extent(&self, set: usize) -> Option<[[f64; 2]; 2]> {
        let footprint = self.footprint?;
        let uvs = self.mesh.uvs.get(set)?;
        let linear = &self.linear();
        let [p0, p1, p2] = self.mesh.corners_at(self.triangle, self.time);
        let edges = [*linear * (p1 - p0), *linear * (p2 - p0)];
        let corners =
            self.mesh.triangles[self.triangle].map(|k| uvs.get(k as usize).map(f64::from));
        footprint.extent(edges, corners)
    }

    /// Values at the three corners, weighted.
    fn mix<const N: usize>(&self, values: &Vertices<N>) -> [f64; N] {
        let [a, b, c] = self.mesh.triangles[self.triangle];
        let (a, b, c) = (values.get(a as usize), values.get(b as usize), values.get(c as usize));
        let [of_a, of_b, of_c] = self.weights;
        let mut mixed = [0.0; N];
        for k in 0..N {
            mixed[k] = of_a * f64::from(a[k]) + of_b * f64::from(b[k]) + of_c * f64::from(c[k]);
        }
        mixed
    }

    /// Texture coordinates of a set; (0, 0) when the mesh has no such set.
    #[must_use]
    pub fn uv(&self, set: usize) -> [f64; 2] {
        self.mesh.uvs.get(set).map_or([0.0; 2], |uvs| self.mix(uvs))
    }

    /// The mesh's colour, when it has any; what is outside 0..=1 is contribution there.
    #[must_use]
    pub fn vertex_color(&self) -> Option<[f64; 4]> {
        let colors = self.mesh.colors.as_ref()?;
        Some(self.mix(colors).map(|c| c.clamp(0.0, 1.0)))
    }

    /// The mesh's own normal in world space, on the side of the unit normal `geometric`; `None` when
    /// the mesh has none.
    #[must_use]
    pub fn shading_normal(&self, geometric: DVec3) -> Option<DVec3> {
        let place = &self.placement.world_from_mesh;
        let turn = (place.linear != DMat3::IDENTITY).then(|| place.normal_matrix());
        self.turned_normal(turn.as_ref(), geometric)
    }

    /// Matrix that turns and stretches the mesh, at its time.
    pub(crate) fn linear(&self) -> DMat3 {
        match &self.placement.motion {
            None => self.placement.world_from_mesh.linear,
            Some(motion) => motion.at(self.time).linear,
        }
    }

    /// [`Self::shading_normal`] with the placement's matrix for normals, or none where it turns
    /// nothing; of a placement that moves its own is taken, at its time.
    pub(crate) fn turned_normal(&self, turn: Option<&DMat3>, geometric: DVec3) -> Option<DVec3> {
        let local = self.local_normal()?;
        let world = match &self.placement.motion {
            None => turn.map_or(local, |turn| *turn * local),
            Some(motion) => motion.at(self.time).normal_matrix() * local,
        };
        let world = world.try_normalize()?;
        // Some files' normals point inwards; the triangle's winding decides.
        Some(if world.dot(geometric) < 0.0 { -world } else { world })
    }

    /// The mesh's own normal in its frame, of any length, at the time.
    fn local_normal(&self) -> Option<DVec3> {
        let Some(steps) = &self.mesh.steps else {
            return Some(DVec3::from(self.mix(self.mesh.normals.as_ref()?)));
        };
        let moment = steps.moment(self.time);
        let [a, b, c] = self.mesh.triangles[self.triangle];
        let [a, b, c] = [a, b, c].map(|corner| steps.normal(moment, corner as usize));
        Some(a? * self.weights[0] + b? * self.weights[1] + c? * self.weights[2])
    }

    /// Directions in the world of the mesh's own tangent along a set of texture coordinates, and of its bitangent (glTF
    /// 2.0, section 3.7.2.1). `None` where the mesh has none.
    pub(crate) fn tangent_axes(&self, set: usize) -> Option<[DVec3; 2]> {
        let tangents = self.mesh.tangents.as_ref().filter(|tangents| tangents.set == set)?;
        let [x, y, z, side] = self.mix(&tangents.corners);
        let tangent = DVec3::new(x, y, z);
        let bitangent = self.local_normal()?.cross(tangent) * side;
        let is_told = tangent != DVec3::ZERO && bitangent != DVec3::ZERO;
        is_told.then(|| [tangent, bitangent].map(|axis| self.linear() * axis))
    }

    /// Change of the world's places along the texture coordinates of a set: the directions of
    /// growing u and of growing v. `None` where they do not tell.
    #[must_use]
    pub fn texture_axes(&self, set: usize) -> Option<[DVec3; 2]> {
        let uvs = self.mesh.uvs.get(set)?;
        let linear = &self.linear();
        let [p0, p1, p2] = self.mesh.corners_at(self.triangle, self.time);
        let (e1, e2) = (*linear * (p1 - p0), *linear * (p2 - p0));
        let [a, b, c] =
            self.mesh.triangles[self.triangle].map(|k| uvs.get(k as usize).map(f64::from));
        let (du1, dv1, du2, dv2) = (b[0] - a[0], b[1] - a[1], c[0] - a[0], c[1] - a[1]);
        // The sign of the area in texture space; its size is lost in normalisation.
        let sign = (du1 * dv2 - du2 * dv1).signum();
        let along_u = (e1 * dv2 - e2 * dv1) * sign;
        let along_v = (e2 * du1 - e1 * du2) * sign;
        Some([along_u.try_normalize()?, along_v.try_normalize()?])
    }
}

/// The squares of a checker that a place sees.
pub(crate) enum Squares {
    /// A mean of both, by how far the first is above a half.
    Mean(f64),
    /// One of them.
    One(usize),
}

impl Squares {
    /// The share of each.
    pub(crate) fn shares(&self) -> [f64; 2] {
        match self {
            Self::Mean(wave) => [0.5 + wave, 0.5 - wave],
            Self::One(0) => [1.0, 0.0],
            Self::One(_) => [0.0, 1.0],
        }
    }
}

/// The squares of a checker, of so many along one unit of the texture coordinates, that a place sees.
pub(crate) fn squares_at(point: &SurfacePoint<'_>, squares: f64) -> Squares {
    let [u, v] = point.uv(0);
    if let Some([a, b]) = point.extent(0) {
        let mean =
            |x: f64, k: usize| mean_of_squares(x * squares, (a[k].abs() + b[k].abs()) * squares);
        return Squares::Mean(0.5 * mean(u, 0) * mean(v, 1));
    }
    // The last bit of the square numbers' sum alternates on both sides of 0. The cast saturates, so absurd
    // coordinates give one colour and no fault.
    #[expect(clippy::cast_possible_truncation, reason = "see above")]
    let number = ((u * squares).floor() + (v * squares).floor()) as i64;
    Squares::One(usize::from(number & 1 != 0))
}
