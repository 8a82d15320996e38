//! The reference tracers (paper, section 4.2): distance, normal, position, ids and base colour of
//! what a ray meets first. No light, no averaging: what a batch hit is written as it is.

use std::sync::Arc;

use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{Geometry, HitBatch, MISS, Mesh, Placement, RayBatch, Vertices};

use crate::material::Alpha;
use crate::pyramid::mean_of_squares;
use crate::{
    Color, Footprint, Image, Ior, Material, NormalKind, Paint, Pixel, SceneCurve, Space, Spectral,
    TextureUse, Tint, TintSpectrum,
};

/// The frame that depths and camera-space vectors refer to.
#[derive(Debug, Clone, Copy)]
pub struct View {
    /// The entrance pupil (m, world).
    pub origin: DVec3,
    /// The camera's axes in the world: +X right, +Y up, and +Z, which points backwards.
    pub axes: DMat3,
    /// Extent that a sample of the picture covers, where the camera tells.
    pub pixel: Option<Pixel>,
}

impl View {
    /// The direction in which the camera looks.
    #[must_use]
    pub fn forward(&self) -> DVec3 {
        -self.axes.z_axis
    }

    /// The axes of a frame in the world.
    #[must_use]
    pub fn axes_of(&self, space: Space) -> DMat3 {
        let DMat3 { x_axis, y_axis, z_axis } = self.axes;
        match space {
            Space::World => DMat3::IDENTITY,
            Space::Camera => self.axes,
            Space::Opencv => DMat3::from_cols(x_axis, -y_axis, -z_axis),
        }
    }
}

/// Parts of the scene that looking at a hit needs.
#[derive(Debug, Clone, Copy)]
pub struct SceneView<'a> {
    /// Meshes and placements.
    pub geometry: &'a Geometry,
    /// Materials, by the index that placements name.
    pub materials: &'a [Material],
    /// Decoded images, by the index that materials name; `None` where the plan needed none.
    pub images: &'a [Option<Arc<Image>>],
    /// The camera's frame.
    pub view: View,
}

/// One batch's rays and what they hit.
#[derive(Debug, Clone, Copy)]
pub struct TracedBatch<'a> {
    /// The rays.
    pub rays: &'a RayBatch,
    /// Their hits.
    pub hits: &'a HitBatch,
}

impl SceneView<'_> {
    /// The point that ray `i` hit (m), `+inf` for a miss. In camera space nothing is lost far from
    /// the world's origin.
    #[must_use]
    pub fn position(&self, traced: TracedBatch<'_>, i: usize, space: Space) -> DVec3 {
        if !traced.hits.is_hit(i) {
            return DVec3::INFINITY;
        }
        let along = traced.rays.direction(i) * traced.hits.t[i];
        match space {
            Space::World => traced.rays.origin(i) + along,
            Space::Camera | Space::Opencv => {
                let from_camera = (traced.rays.origin(i) - self.view.origin) + along;
                self.view.axes_of(space).transpose() * from_camera
            }
        }
    }

    /// The unit normal of hit `i` on the side that the ray came from, zero for a miss.
    ///
    /// A shading normal is turned together with the geometric one, so it is on the same side of the
    /// surface even where interpolation tilts it away from the viewer.
    #[must_use]
    pub fn normal(
        &self,
        traced: TracedBatch<'_>,
        i: usize,
        kind: NormalKind,
        space: Space,
    ) -> DVec3 {
        let geometric = traced.hits.normal(i);
        let side = if geometric.dot(traced.rays.direction(i)) > 0.0 { -1.0 } else { 1.0 };
        let normal = match kind {
            NormalKind::Geometric => geometric,
            NormalKind::Shading => self.shading_normal(traced.hits, i).unwrap_or(geometric),
        };
        match space {
            Space::World => normal * side,
            Space::Camera | Space::Opencv => self.view.axes_of(space).transpose() * normal * side,
        }
    }

    /// The file's vertex normals at hit `i`, interpolated, in world space; `None` without any.
    fn shading_normal(&self, hits: &HitBatch, i: usize) -> Option<DVec3> {
        self.point(hits, i)?.shading_normal(hits.normal(i))
    }

    /// Place of hit `i` on its mesh; `None` for a miss.
    #[must_use]
    pub fn point(&self, hits: &HitBatch, i: usize) -> Option<SurfacePoint<'_>> {
        let placement = self.placement(hits, i)?;
        let (u, v) = (hits.u[i], hits.v[i]);
        let weights = [1.0 - u - v, u, v];
        let point = SurfacePoint::corner(self.geometry, placement, hits.triangle[i] as usize);
        Some(SurfacePoint { weights, time: hits.time(i), ..point })
    }

    /// The material of a point.
    #[must_use]
    pub fn material(&self, point: &SurfacePoint<'_>) -> Option<&Material> {
        self.materials.get(point.placement.material as usize)
    }

    /// The index of the glass of a placement; `None` of all else.
    pub(crate) fn index(&self, placement: u32) -> Option<&Ior> {
        let placement = self.geometry.placements.get(placement as usize)?;
        let material = self.materials.get(placement.material as usize)?;
        Some(&material.scattering.glass()?.ior)
    }

    fn placement(&self, hits: &HitBatch, i: usize) -> Option<&Placement> {
        let index = hits.placement[i];
        (index != MISS).then(|| &self.geometry.placements[index as usize])
    }

    /// Numbers of the object, the copy, the node and the triangle in its mesh that hit `i` met, all
    /// from 1; 0 for a miss.
    #[must_use]
    pub fn ids(&self, hits: &HitBatch, i: usize) -> [u32; 4] {
        match self.placement(hits, i) {
            Some(Placement { object, instance, node, .. }) => {
                [object, instance, node, &hits.triangle[i]].map(|index| index.saturating_add(1))
            }
            None => [0; 4],
        }
    }

    /// Place that ray `i` of the camera hit, with its footprint; `None` for a miss.
    fn seen(&self, traced: TracedBatch<'_>, i: usize) -> Option<SurfacePoint<'_>> {
        let direction = traced.rays.direction(i);
        let cone = self.view.cone(direction).map(|cone| cone.after(traced.hits.t[i]));
        let footprint = cone.map(|cone| Footprint { direction, width: cone.width });
        Some(SurfacePoint { footprint, ..self.point(traced.hits, i)? })
    }

    /// Base colour without light at hit `i` of the camera's rays, averaged over their footprint;
    /// black for a miss.
    #[must_use]
    pub fn flat(&self, traced: TracedBatch<'_>, i: usize) -> Color {
        let Some(point) = self.seen(traced, i) else { return [0.0; 3] };
        let Some(material) = self.material(&point) else { return [0.0; 3] };
        let [r, g, b, _] = self.base_color(material, &point);
        [r, g, b]
    }

    /// Base colour at the very point of hit `i`, black for a miss.
    #[must_use]
    pub fn albedo(&self, hits: &HitBatch, i: usize) -> Color {
        let Some(point) = self.point(hits, i) else { return [0.0; 3] };
        let Some(material) = self.material(&point) else { return [0.0; 3] };
        let [r, g, b, _] = self.base_color(material, &point);
        [r, g, b]
    }

    /// Number of the material of hit `i`, counted from 1; 0 for a miss.
    #[must_use]
    pub fn material_id(&self, hits: &HitBatch, i: usize) -> u32 {
        self.placement(hits, i).map_or(0, |placement| placement.material.saturating_add(1))
    }

    /// Texture coordinates of the first set at hit `i`; (0, 0) without any.
    #[must_use]
    pub fn first_uv(&self, hits: &HitBatch, i: usize) -> [f64; 2] {
        self.point(hits, i).map_or([0.0; 2], |point| point.uv(0))
    }

    /// Base colour and alpha, vertex colours included.
    ///
    /// There is no mean over a footprint where alpha cuts holes: the mean of alpha against a cut-off
    /// is not the share that is cut.
    #[must_use]
    pub fn base_color(&self, material: &Material, point: &SurfacePoint<'_>) -> [f64; 4] {
        let mut color = if material.alpha != Alpha::Opaque {
            self.paint(&material.base_color, &SurfacePoint { footprint: None, ..*point })
        } else {
            self.paint(&material.base_color, point)
        };
        if material.vertex_colors
            && let Some(vertex) = point.vertex_color()
        {
            color = std::array::from_fn(|k| color[k] * vertex[k]);
        }
        color
    }

    /// Base colour with its curve, and alpha, vertex colours included: as [`Self::base_color`] where no curve is.
    pub(crate) fn base_tint(
        &self,
        spectral: &Spectral,
        material: &Material,
        point: &SurfacePoint<'_>,
    ) -> (Tint, f64) {
        let [r, g, b, alpha] = self.base_color(material, point);
        if spectral.is_rgb() || !material.base_color.has_spectrum() {
            return (Tint::from([r, g, b]), alpha);
        }
        let seen = match material.alpha {
            Alpha::Opaque => *point,
            Alpha::Mask { .. } | Alpha::Blend { .. } => SurfacePoint { footprint: None, ..*point },
        };
        let mut tint = match &material.base_color {
            Paint::Plain(color) => Tint::from(*color),
            Paint::Curve { curve, .. } => Tint { color: [1.0; 3], spectrum: curve.spectrum() },
            Paint::Checker { colors, curves, squares } => {
                match (curves, squares_at(&seen, *squares)) {
                    (None, _) => Tint::from(colors[0]),
                    (Some(curves), Squares::One(number)) => {
                        Tint { color: [1.0; 3], spectrum: curves[number].spectrum() }
                    }
                    (Some(curves), Squares::Mean(wave)) => {
                        let numbers = [curves[0].number, curves[1].number];
                        let peak = curves[0].curve.extent()[1].max(curves[1].curve.extent()[1]);
                        let spectrum = TintSpectrum::Mixed { numbers, share: 0.5 + wave, peak };
                        Tint { color: [1.0; 3], spectrum }
                    }
                }
            }
            Paint::Cube { cube, repeat } => {
                let [u, v] = seen.uv(0);
                let at = [u * repeat[0], v * repeat[1]];
                let spectrum = TintSpectrum::Texel { number: cube.number, at };
                Tint { color: [1.0; 3], spectrum }
            }
            Paint::Image { curve, image, .. } => {
                let [r, g, b, _] = self.tint(image, &seen);
                let spectrum = curve.as_ref().map_or(TintSpectrum::White, SceneCurve::spectrum);
                Tint { color: [r, g, b], spectrum }
            }
        };
        if material.vertex_colors
            && let Some(vertex) = point.vertex_color()
        {
            tint.color = std::array::from_fn(|k| tint.color[k] * vertex[k]);
        }
        (tint, alpha)
    }

    /// A paint's colour and alpha.
    #[must_use]
    pub fn paint(&self, paint: &Paint, point: &SurfacePoint<'_>) -> [f64; 4] {
        match paint {
            Paint::Plain([r, g, b]) | Paint::Curve { look: [r, g, b], .. } => [*r, *g, *b, 1.0],
            Paint::Checker { colors, squares, .. } => {
                let [r, g, b] = match squares_at(point, *squares) {
                    Squares::Mean(wave) => std::array::from_fn(|k| {
                        colors[0][k] * (0.5 + wave) + colors[1][k] * (0.5 - wave)
                    }),
                    Squares::One(number) => colors[number],
                };
                [r, g, b, 1.0]
            }
            Paint::Cube { cube, repeat } => {
                let [u, v] = point.uv(0);
                let [r, g, b] = cube.cube.look([u * repeat[0], v * repeat[1]]);
                [r, g, b, 1.0]
            }
            Paint::Image { factor, image, .. } => {
                let [r, g, b, a] = self.tint(image, point);
                [factor[0] * r, factor[1] * g, factor[2] * b, a]
            }
        }
    }

    /// The colour that a use of an image has at a point, whatever its encoding: the magenta checker
    /// where the image cannot be had, white where nobody asked for it.
    #[must_use]
    pub fn tint(&self, image: &TextureUse, point: &SurfacePoint<'_>) -> [f64; 4] {
        self.decoded(image).map_or([1.0; 4], |pixels| Self::over(pixels, image, point))
    }

    /// Value of an image of data (a roughness, a share) at a point; 1 without the image.
    #[must_use]
    pub fn texel(&self, image: &TextureUse, point: &SurfacePoint<'_>) -> [f64; 4] {
        self.lookup(image, point).unwrap_or([1.0; 4])
    }

    /// Value of an image of data at a point; `None` without the image.
    #[must_use]
    pub fn lookup(&self, image: &TextureUse, point: &SurfacePoint<'_>) -> Option<[f64; 4]> {
        // Magenta is for looking at, not a roughness or a tilt.
        let pixels = self.decoded(image).filter(|pixels| !pixels.stands_in())?;
        Some(Self::over(pixels, image, point))
    }

    fn decoded(&self, image: &TextureUse) -> Option<&Image> {
        self.images.get(image.texture as usize)?.as_deref()
    }

    /// The pixels of a use of an image, averaged over the point's footprint.
    fn over(pixels: &Image, image: &TextureUse, point: &SurfacePoint<'_>) -> [f64; 4] {
        let set = image.uv_set as usize;
        let [u, v] = point.uv(set);
        let at = image.transform.map(|[a, b, c]| a * u + b * v + c);
        match point.extent(set) {
            None => pixels.sample(at, image.encoding),
            Some(axes) => {
                let axes = axes.map(|[u, v]| image.transform.map(|[a, b, _]| a * u + b * v));
                pixels.sample_over(at, axes, image.encoding)
            }
        }
    }

    /// Share of ambient light that reaches hit `i`.
    pub(crate) fn unoccluded(&self, traced: TracedBatch<'_>, i: usize) -> f64 {
        let Some(point) = self.seen(traced, i) else { return 1.0 };
        let occlusion = self.material(&point).and_then(|material| material.occlusion.as_ref());
        let Some(occlusion) = occlusion else { return 1.0 };
        let [arrives, ..] = self.texel(&occlusion.image, &point);
        1.0 + occlusion.strength.clamp(0.0, 1.0) * (arrives - 1.0)
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

/// Data of the mesh and of the hit that a layer needs.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Needs {
    /// Barycentric coordinates or the normal: [`etendue_geometry::Detail::Surface`].
    pub surface: bool,
    /// The mesh's vertex normals.
    pub normals: bool,
    /// Materials, and what they look up (vertex colours, images).
    pub materials: bool,
    /// Texture coordinates.
    pub uvs: bool,
    /// Lights, and all that materials say of light.
    pub light: bool,
    /// The occlusion of ambient light.
    pub ambient: bool,
}

impl Needs {
    /// Both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self {
            surface: self.surface || other.surface,
            normals: self.normals || other.normals,
            materials: self.materials || other.materials,
            uvs: self.uvs || other.uvs,
            light: self.light || other.light,
            ambient: self.ambient || other.ambient,
        }
    }
}
