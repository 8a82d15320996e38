//! The reference tracers (paper, section 4.2): distance, normal, position, ids and base colour of
//! what a ray meets first. No light, no averaging: what a batch hit is written as it is.

use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{Geometry, HitBatch, MISS, Placement, RayBatch};

use crate::{Color, Image, LayerSpec, Material, NormalKind, Paint, Space, TextureUse};

/// The frame that depths and camera-space vectors refer to.
#[derive(Debug, Clone, Copy)]
pub struct View {
    /// The entrance pupil (m, world).
    pub origin: DVec3,
    /// The camera's axes in the world: +X right, +Y up, and +Z, which points backwards.
    pub axes: DMat3,
}

impl View {
    /// The direction in which the camera looks.
    #[must_use]
    pub fn forward(&self) -> DVec3 {
        -self.axes.z_axis
    }
}

/// What looking at a hit needs to know of the scene.
#[derive(Debug, Clone, Copy)]
pub struct Surroundings<'a> {
    /// Meshes and placements.
    pub geometry: &'a Geometry,
    /// Materials, by the index that placements name.
    pub materials: &'a [Material],
    /// Decoded images, by the index that materials name; `None` where the plan needed none.
    pub images: &'a [Option<Image>],
    /// The camera's frame.
    pub view: View,
}

/// One batch's rays and what they hit.
#[derive(Debug, Clone, Copy)]
pub struct Traced<'a> {
    /// The rays.
    pub rays: &'a RayBatch,
    /// Their hits.
    pub hits: &'a HitBatch,
}

impl Surroundings<'_> {
    /// Depth of hit `i` along the camera's axis (m), `+inf` for a miss.
    #[must_use]
    pub fn depth(&self, traced: Traced<'_>, i: usize) -> f64 {
        let t = traced.hits.t[i];
        if t == f64::INFINITY {
            return t;
        }
        let forward = self.view.forward();
        let start = (traced.rays.origin(i) - self.view.origin).dot(forward);
        start + t * traced.rays.direction(i).dot(forward)
    }

    /// The point that ray `i` hit (m), `+inf` for a miss. In camera space nothing is lost far from
    /// the world's origin.
    #[must_use]
    pub fn position(&self, traced: Traced<'_>, i: usize, space: Space) -> DVec3 {
        if !traced.hits.is_hit(i) {
            return DVec3::INFINITY;
        }
        let along = traced.rays.direction(i) * traced.hits.t[i];
        match space {
            Space::World => traced.rays.origin(i) + along,
            Space::Camera => {
                self.view.axes.transpose() * ((traced.rays.origin(i) - self.view.origin) + along)
            }
        }
    }

    /// The unit normal of hit `i` on the side that the ray came from, zero for a miss.
    ///
    /// A shading normal is turned together with the geometric one, so it is on the same side of the
    /// surface even where interpolation tilts it away from the viewer.
    #[must_use]
    pub fn normal(&self, traced: Traced<'_>, i: usize, kind: NormalKind, space: Space) -> DVec3 {
        let geometric = traced.hits.normal(i);
        let side = if geometric.dot(traced.rays.direction(i)) > 0.0 { -1.0 } else { 1.0 };
        let normal = match kind {
            NormalKind::Geometric => geometric,
            NormalKind::Shading => self.shading_normal(traced.hits, i).unwrap_or(geometric),
        };
        match space {
            Space::World => normal * side,
            Space::Camera => self.view.axes.transpose() * normal * side,
        }
    }

    /// The file's vertex normals at hit `i`, interpolated, in world space; `None` without any.
    fn shading_normal(&self, hits: &HitBatch, i: usize) -> Option<DVec3> {
        let placement = self.placement(hits, i)?;
        let mesh = self.geometry.mesh_of(placement);
        let normals = mesh.normals.as_ref()?;
        let corners = mesh.triangles[hits.triangle[i] as usize];
        let [a, b, c] = corners.map(|corner| {
            let [x, y, z] = normals.get(corner as usize);
            DVec3::new(x.into(), y.into(), z.into())
        });
        let (u, v) = (hits.u[i], hits.v[i]);
        let local = a * (1.0 - u - v) + b * u + c * v;
        let place = &placement.world_from_mesh;
        let unmoved = place.linear == DMat3::IDENTITY;
        let world = if unmoved { local } else { place.normal_matrix() * local };
        let world = world.try_normalize()?;
        // Some files' normals point inwards; the triangle's winding decides.
        let geometric = hits.normal(i);
        Some(if world.dot(geometric) < 0.0 { -world } else { world })
    }

    fn placement(&self, hits: &HitBatch, i: usize) -> Option<&Placement> {
        let index = hits.placement[i];
        (index != MISS).then(|| &self.geometry.placements[index as usize])
    }

    /// Number of the object and of the triangle in its mesh that hit `i` met, both from 1; 0 for a
    /// miss.
    #[must_use]
    pub fn ids(&self, hits: &HitBatch, i: usize) -> [u32; 2] {
        match self.placement(hits, i) {
            Some(placement) => [placement.object + 1, hits.triangle[i] + 1],
            None => [0, 0],
        }
    }

    /// Base colour without light at hit `i`, black for a miss.
    #[must_use]
    pub fn flat(&self, hits: &HitBatch, i: usize) -> Color {
        let Some(placement) = self.placement(hits, i) else { return [0.0; 3] };
        let Some(material) = self.materials.get(placement.material as usize) else {
            return [0.0; 3];
        };
        let mut color = match &material.base_color {
            Paint::Plain(color) => *color,
            Paint::Checker { colors, squares } => {
                let [u, v] = self.uv(hits, i, placement, 0);
                // The last bit of the square numbers' sum alternates on both sides of 0. The cast
                // saturates, so absurd coordinates give one colour and no fault.
                #[expect(clippy::cast_possible_truncation, reason = "see above")]
                let number = ((u * squares).floor() + (v * squares).floor()) as i64;
                colors[usize::from(number & 1 != 0)]
            }
            Paint::Image { factor, image } => {
                let texel = self.texel(hits, i, placement, image);
                std::array::from_fn(|k| factor[k] * texel[k])
            }
        };
        if material.vertex_colors
            && let Some(vertex) = self.vertex_color(hits, i, placement)
        {
            color = std::array::from_fn(|k| color[k] * vertex[k]);
        }
        color
    }

    /// Base colour under a headlight at hit `i`: something to look at, not light transport. A little
    /// of it does not depend on the colour, so that black things show their shape as well.
    #[must_use]
    pub fn facing(&self, traced: Traced<'_>, i: usize) -> Color {
        if !traced.hits.is_hit(i) {
            return [0.0; 3];
        }
        let normal = self.normal(traced, i, NormalKind::Shading, Space::World);
        let cosine = normal.dot(-traced.rays.direction(i)).max(0.0);
        self.flat(traced.hits, i).map(|c| (0.08 + 0.92 * c) * (0.15 + 0.85 * cosine))
    }

    fn texel(&self, hits: &HitBatch, i: usize, placement: &Placement, image: &TextureUse) -> Color {
        let Some(Some(pixels)) = self.images.get(image.texture as usize) else { return [1.0; 3] };
        let [u, v] = self.uv(hits, i, placement, image.uv_set as usize);
        let [row_u, row_v] = image.transform;
        let u_image = row_u[0] * u + row_u[1] * v + row_u[2];
        let v_image = row_v[0] * u + row_v[1] * v + row_v[2];
        pixels.sample(u_image, v_image)
    }

    /// Texture coordinates of hit `i`; (0, 0) when the mesh has no such set.
    fn uv(&self, hits: &HitBatch, i: usize, placement: &Placement, set: usize) -> [f64; 2] {
        let mesh = self.geometry.mesh_of(placement);
        let Some(uvs) = mesh.uvs.get(set) else { return [0.0; 2] };
        let weights = weights(hits, i);
        let corners = mesh.triangles[hits.triangle[i] as usize].map(|c| uvs.get(c as usize));
        std::array::from_fn(|k| (0..3).map(|c| weights[c] * f64::from(corners[c][k])).sum())
    }

    fn vertex_color(&self, hits: &HitBatch, i: usize, placement: &Placement) -> Option<Color> {
        let mesh = self.geometry.mesh_of(placement);
        let colors = mesh.colors.as_ref()?;
        let weights = weights(hits, i);
        let corners = mesh.triangles[hits.triangle[i] as usize].map(|c| colors.get(c as usize));
        Some(std::array::from_fn(|k| (0..3).map(|c| weights[c] * f64::from(corners[c][k])).sum()))
    }
}

/// Barycentric weights of the three corners.
fn weights(hits: &HitBatch, i: usize) -> [f64; 3] {
    let (u, v) = (hits.u[i], hits.v[i]);
    [1.0 - u - v, u, v]
}

/// What a layer needs of the mesh and of the hit.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Needs {
    /// Barycentric coordinates or the normal: [`etendue_geometry::Detail::Surface`].
    pub surface: bool,
    /// The mesh's vertex normals.
    pub normals: bool,
    /// Materials, and what they look up (texture coordinates, vertex colours, images).
    pub materials: bool,
}

impl Needs {
    /// Both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self {
            surface: self.surface || other.surface,
            normals: self.normals || other.normals,
            materials: self.materials || other.materials,
        }
    }
}

impl LayerSpec {
    /// What this layer needs.
    #[must_use]
    pub fn needs(self) -> Needs {
        let none = Needs::default();
        match self {
            Self::Depth | Self::Distance | Self::Position { .. } | Self::Ids | Self::Coverage => {
                none
            }
            Self::Normal { kind, .. } => {
                Needs { surface: true, normals: kind == NormalKind::Shading, ..none }
            }
            Self::Flat => Needs { surface: true, materials: true, ..none },
            Self::Facing => Needs { surface: true, normals: true, materials: true },
        }
    }
}
