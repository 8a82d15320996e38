//! A triangle mesh: corners, triangles and what is known at the corners.
//!
//! Plain values owned by a `Vec` or by a mapped file, so that a mesh does not care which.

use std::sync::Arc;

use glam::DVec3;

use crate::{Bounds, Buffer, Steps, Vertices, is_degenerate};

/// The corners of a mesh, in its own frame (m).
#[derive(Debug, Clone)]
pub enum Positions {
    /// As nearly every file has them.
    F32(Vertices<3>),
    /// For a text file whose coordinates f32 would move: far from the origin, say.
    F64(Buffer<[f64; 3]>),
}

impl Positions {
    /// The number of corners.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::F32(vertices) => vertices.len(),
            Self::F64(vertices) => vertices.len(),
        }
    }

    /// True if there are no corners.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Corner `i` (m), in the mesh's frame.
    #[must_use]
    #[inline]
    pub fn get(&self, i: usize) -> DVec3 {
        match self {
            Self::F32(vertices) => {
                let [x, y, z] = vertices.get(i);
                DVec3::new(x.into(), y.into(), z.into())
            }
            Self::F64(vertices) => vertices[i].into(),
        }
    }
}

/// Tangents of a mesh's corners (glTF 2.0, section 3.7.2.1).
#[derive(Debug, Clone)]
pub struct Tangents {
    /// The set of texture coordinates along whose u they run.
    pub set: usize,
    /// A unit vector a corner, and on which side of it the bitangent is: the normal's product with it, times 1 or −1.
    pub corners: Vertices<4>,
}

/// A triangle mesh in its own frame. Every index in `triangles` is less than the number of
/// positions, and every position that a triangle uses is finite: loaders see to both.
#[derive(Debug, Clone)]
pub struct Mesh {
    /// Name of the mesh in the file, for messages.
    pub name: String,
    /// Corners (m).
    pub positions: Positions,
    /// Three corners a triangle, counter-clockwise from the front.
    pub triangles: Buffer<[u32; 3]>,
    /// Shading normals a corner, when the file has them and somebody wants them.
    pub normals: Option<Vertices<3>>,
    /// Texture coordinates a corner (glTF's TEXCOORD sets by number; v runs down).
    pub uvs: Vec<Vertices<2>>,
    /// Linear colour a corner (RGBA, 0..=1).
    pub colors: Option<Vertices<4>>,
    /// Tangents a corner, when the file has them; of meshes of one shape alone.
    pub tangents: Option<Tangents>,
    /// The box of all triangles that have an area (m): what is a point or a line is not drawn, and sets no
    /// frame.
    pub bounds: Bounds,
    /// Number of triangles that are points or lines ([`is_degenerate`]): accelerators leave them out.
    pub degenerate: u64,
    /// Its shapes while the shutter is open; `None` where it has one, that of `positions`.
    pub steps: Option<Arc<Steps>>,
}

impl Mesh {
    /// A mesh without attributes; bounds and triangles without area are worked out here.
    ///
    /// # Panics
    ///
    /// When a triangle names a position that does not exist.
    #[must_use]
    pub fn new(name: impl Into<String>, positions: Positions, triangles: Buffer<[u32; 3]>) -> Self {
        let mut bounds = Bounds::EMPTY;
        let mut degenerate = 0;
        for triangle in triangles.iter() {
            let corners = triangle.map(|i| positions.get(i as usize));
            match is_degenerate(corners) {
                true => degenerate += 1,
                false => corners.into_iter().for_each(|corner| bounds.include(corner)),
            }
        }
        Self {
            name: name.into(),
            positions,
            triangles,
            normals: None,
            uvs: Vec::new(),
            colors: None,
            tangents: None,
            bounds,
            degenerate,
            steps: None,
        }
    }

    /// A mesh of three coordinates a vertex (m) and three vertices a triangle. Kept in single precision where
    /// that rounds nothing off.
    ///
    /// # Errors
    ///
    /// When a triangle names a vertex that is not there, or one that is not finite.
    pub fn from_arrays(
        name: impl Into<String>,
        vertices: &[[f64; 3]],
        triangles: &[[u32; 3]],
    ) -> Result<Self, String> {
        for (number, triangle) in triangles.iter().enumerate() {
            for &corner in triangle {
                let Some(vertex) = vertices.get(corner as usize) else {
                    let count = vertices.len();
                    return Err(format!("triangle {number} names vertex {corner} of {count}"));
                };
                if !vertex.iter().all(|value| value.is_finite()) {
                    return Err(format!("vertex {corner} of triangle {number} is {vertex:?}"));
                }
            }
        }
        #[expect(clippy::cast_possible_truncation, reason = "checked to be exact")]
        let narrow: Vec<[f32; 3]> = vertices.iter().map(|v| v.map(|x| x as f32)).collect();
        let is_exact = |(wide, narrow): (&[f64; 3], &[f32; 3])| {
            narrow.map(|x| f64::from(x).to_bits()) == wide.map(f64::to_bits)
        };
        let positions = match vertices.iter().zip(&narrow).all(is_exact) {
            true => Positions::F32(Vertices::from_arrays(&narrow)),
            false => Positions::F64(vertices.to_vec().into()),
        };
        Ok(Self::new(name, positions, triangles.to_vec().into()))
    }

    /// True if corners and triangles are those of `other`, in the same place in memory.
    #[must_use]
    pub fn has_surface_of(&self, other: &Self) -> bool {
        let positions = match (&self.positions, &other.positions) {
            (Positions::F32(own), Positions::F32(other)) => own.is_same(other),
            (Positions::F64(own), Positions::F64(other)) => own.is_same(other),
            (Positions::F32(_), Positions::F64(_)) | (Positions::F64(_), Positions::F32(_)) => {
                false
            }
        };
        let steps = match (&self.steps, &other.steps) {
            (Some(own), Some(other)) => Arc::ptr_eq(own, other),
            (None, None) => true,
            (Some(_), None) | (None, Some(_)) => false,
        };
        positions && steps && self.triangles.is_same(&other.triangles)
    }

    /// True if all values are those of `other`, in the same place in memory.
    #[must_use]
    pub fn is_same(&self, other: &Self) -> bool {
        fn same<const N: usize>(own: Option<&Vertices<N>>, other: Option<&Vertices<N>>) -> bool {
            match (own, other) {
                (Some(own), Some(other)) => own.is_same(other),
                (None, None) => true,
                (Some(_), None) | (None, Some(_)) => false,
            }
        }
        self.has_surface_of(other)
            && self.name == other.name
            && same(self.normals.as_ref(), other.normals.as_ref())
            && same(self.colors.as_ref(), other.colors.as_ref())
            && same(self.tangent_corners(), other.tangent_corners())
            && self.uvs.len() == other.uvs.len()
            && self.uvs.iter().zip(&other.uvs).all(|(own, other)| own.is_same(other))
    }

    /// Takes the corners and triangles of `other` in place of its own where they have the same values,
    /// so that they are in memory once.
    pub fn share_surface(&mut self, other: &Self) {
        let is_equal = self.positions.len() == other.positions.len()
            && self.triangles[..] == other.triangles[..]
            && match (&self.positions, &other.positions) {
                (Positions::F32(own), Positions::F32(other)) => (0..own.len())
                    .all(|i| own.get(i).map(f32::to_bits) == other.get(i).map(f32::to_bits)),
                (Positions::F64(own), Positions::F64(other)) => {
                    let bits = |p: &[f64; 3]| p.map(f64::to_bits);
                    own.iter().map(bits).eq(other.iter().map(bits))
                }
                (Positions::F32(_), Positions::F64(_)) | (Positions::F64(_), Positions::F32(_)) => {
                    false
                }
            };
        if is_equal {
            self.positions = other.positions.clone();
            self.triangles = other.triangles.clone();
        }
    }

    /// The corners of triangle `i` (m), in the mesh's frame.
    #[must_use]
    #[inline]
    pub fn corners(&self, i: usize) -> [DVec3; 3] {
        self.triangles[i].map(|corner| self.positions.get(corner as usize))
    }

    /// The corners of triangle `i` (m), in the mesh's frame, at `time` (s from the frame's time).
    #[must_use]
    #[inline]
    pub fn corners_at(&self, i: usize, time: f64) -> [DVec3; 3] {
        let Some(steps) = &self.steps else { return self.corners(i) };
        let moment = steps.moment(time);
        self.triangles[i].map(|corner| steps.corner(moment, corner as usize))
    }

    /// The box around all triangles that have an area (m), in the mesh's frame, at all times.
    #[must_use]
    pub fn bounds_at_all_times(&self) -> Bounds {
        self.steps.as_ref().map_or(self.bounds, |steps| steps.bounds().union(self.bounds))
    }

    /// Bytes of vertices and indices that are in no mapped file.
    #[must_use]
    pub fn heap_bytes(&self) -> usize {
        let positions = match &self.positions {
            Positions::F32(vertices) => vertices.floats().heap_bytes(),
            Positions::F64(vertices) => vertices.heap_bytes(),
        };
        let normals = self.normals.as_ref().map_or(0, |normals| normals.floats().heap_bytes());
        let colors = self.colors.as_ref().map_or(0, |colors| colors.floats().heap_bytes());
        let tangents = self.tangent_corners().map_or(0, |own| own.floats().heap_bytes());
        let uvs: usize = self.uvs.iter().map(|uvs| uvs.floats().heap_bytes()).sum();
        let steps = self.steps.as_ref().map_or(0, |steps| steps.heap_bytes());
        positions + self.triangles.heap_bytes() + normals + uvs + colors + tangents + steps
    }

    fn tangent_corners(&self) -> Option<&Vertices<4>> {
        self.tangents.as_ref().map(|tangents| &tangents.corners)
    }
}
