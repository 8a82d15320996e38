//! The reference tracers (paper, section 4.2): distance, normal, position, ids and base colour of
//! what a ray meets first. No light, no averaging: what a batch hit is written as it is.

use std::sync::Arc;

use etendue_geometry::glam::DVec3;
use etendue_geometry::{Geometry, HitBatch, MISS, Placement, RayBatch};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::material::Alpha;
use crate::surface_point::{Squares, squares_at};
use crate::{
    Color, Footprint, Image, Ior, Material, Paint, SceneCurve, Space, Spectral, TextureUse, Tint,
    TintSpectrum, View,
};

pub use crate::surface_point::SurfacePoint;

/// One of a surface's two normals.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum NormalKind {
    /// The plane of the triangle.
    #[default]
    Geometric,
    /// Interpolated from the file's vertex normals, where it has them.
    Shading,
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
