//! From a hit to a surface that light can be scattered by.

use etendue_geometry::glam::DVec3;
use etendue_geometry::{HitBatch, RayBatch};

use crate::bsdf::{Bsdf, Layered, Model, fresnel};
use crate::material::{Alpha, GltfSurface, NormalMap};
use crate::reference::{SceneView, SurfacePoint};
use crate::spawn::Anchor;
use crate::{Color, Footprint, Material, Scattering};

/// A hit seen from its ray.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SurfaceInteraction<'a> {
    pub(crate) spot: SurfacePoint<'a>,
    pub(crate) material: &'a Material,
    pub(crate) anchor: Anchor,
    /// The ray came from the triangle's front.
    pub(crate) front: bool,
    /// Base colour and alpha.
    pub(crate) base: [f64; 4],
    wo: DVec3,
}

impl<'a> SurfaceInteraction<'a> {
    /// Hit `i`; `None` for a miss.
    pub(crate) fn new(
        around: &'a SceneView<'a>,
        rays: &RayBatch,
        hits: &HitBatch,
        i: usize,
        footprint: Option<Footprint>,
    ) -> Option<Self> {
        let spot = SurfacePoint { footprint, ..around.spot(hits, i)? };
        let material = around.material(&spot)?;
        let (origin, direction) = (rays.origin(i), rays.direction(i));
        let normal = hits.normal(i);
        let anchor =
            Anchor::new(origin + direction * hits.t[i], normal, origin, spot.placement, spot.mesh);
        let front = normal.dot(direction) <= 0.0;
        let base = around.base_color(material, &spot);
        Some(Self { spot, material, anchor, front, base, wo: -direction })
    }

    /// Share of the surface that is there.
    pub(crate) fn opacity(&self) -> f64 {
        match self.material.alpha {
            Alpha::Opaque => 1.0,
            Alpha::Mask { factor, cutoff } => f64::from(u8::from(factor * self.base[3] >= cutoff)),
            Alpha::Blend { factor } => (factor * self.base[3]).clamp(0.0, 1.0),
        }
    }

    /// The base colour alone, contribution to what a surface can reflect.
    pub(crate) fn color(&self) -> Color {
        let [r, g, b, _] = self.base;
        [r, g, b].map(|c| c.clamp(0.0, 1.0))
    }

    /// How it scatters light of the wavelength (nm).
    pub(crate) fn bsdf(&self, around: &SceneView<'_>, wavelength: f64) -> Bsdf {
        let side = if self.front { 1.0 } else { -1.0 };
        let geometric = self.anchor.normal * side;
        let model = match &self.material.scattering {
            Scattering::Black | Scattering::Unlit => Model::Black,
            Scattering::Matte => Model::Matte,
            Scattering::Mirror => Model::Mirror,
            Scattering::Metal { roughness } => Model::Metal { alpha: roughness * roughness },
            Scattering::Dielectric(ior) => {
                let n = ior.at(wavelength);
                Model::Dielectric { eta: if self.front { n } else { 1.0 / n } }
            }
            Scattering::Gltf(surface) => return self.layered(around, surface, geometric),
        };
        let shading = self.shading(around, geometric);
        Bsdf::new(model, [geometric, shading], self.wo, [self.color(), [1.0; 3]])
    }

    fn layered(&self, around: &SceneView<'_>, own: &GltfSurface, geometric: DVec3) -> Bsdf {
        let texel = |image: &Option<_>| match image {
            Some(image) => around.texel(image, &self.spot),
            None => [1.0; 4],
        };
        let rough = texel(&own.metallic_roughness);
        let roughness = match &own.glossiness_texture {
            Some(_) => 1.0 - (1.0 - own.roughness) * texel(&own.glossiness_texture)[3],
            None => own.roughness * rough[1],
        };
        let roughness = roughness.clamp(0.0, 1.0);
        let specular = (own.specular * texel(&own.specular_texture)[3]).clamp(0.0, 1.0);
        let face_on = fresnel::normal_reflectance(own.ior);
        let tint = own.specular_color_texture.as_ref();
        let tint = tint.map_or([1.0; 4], |image| around.tint(image, &self.spot));
        // The extension caps the reflectance face on at 1.
        let most = if face_on > 0.0 { 1.0 / face_on } else { f64::INFINITY };
        let highlight = std::array::from_fn(|k| (own.specular_color[k] * tint[k]).min(most));
        let model = Model::Layered(Layered {
            metallic: (own.metallic * rough[2]).clamp(0.0, 1.0),
            alpha: roughness * roughness,
            f0: face_on * specular,
            f90: specular,
            transmission: (own.transmission * texel(&own.transmission_texture)[0]).clamp(0.0, 1.0),
        });
        let base = self.color();
        let shading = self.shading(around, geometric);
        Bsdf::new(model, [geometric, shading], self.wo, [base, highlight])
    }

    /// The shading normal on the viewer's side; the geometric one where the viewer would see its
    /// back.
    fn shading(&self, around: &SceneView<'_>, geometric: DVec3) -> DVec3 {
        let front = self.anchor.normal;
        let mut normal = self.spot.shading_normal(front).unwrap_or(front);
        if let Some(map) = &self.material.normal_map {
            normal = self.tilted(around, map, normal);
        }
        if !self.front {
            normal = -normal;
        }
        if normal.dot(self.wo) > 0.0 { outward(normal, geometric, self.wo) } else { geometric }
    }

    /// The normal tilted by a normal map: +x along u, +y up the image, against v (glTF 2.0, section
    /// 3.9.3).
    fn tilted(&self, around: &SceneView<'_>, map: &NormalMap, normal: DVec3) -> DVec3 {
        let Some([along_u, along_v]) = self.spot.texture_axes(map.image.uv_set as usize) else {
            return normal;
        };
        let Some(texel) = around.lookup(&map.image, &self.spot) else { return normal };
        let [x, y, z, _] = texel.map(|c| 2.0 * c - 1.0);
        let Some(tangent) = (along_u - normal * normal.dot(along_u)).try_normalize() else {
            return normal;
        };
        let across = normal.cross(tangent);
        let bitangent = if across.dot(along_v) > 0.0 { -across } else { across };
        let tilted = tangent * (x * map.scale) + bitangent * (y * map.scale) + normal * z;
        tilted.try_normalize().unwrap_or(normal)
    }
}

/// A shading normal that mirrors the viewer into the surface, bent until it mirrors them along it: a
/// tilted mirror would be black there (Keller et al., "The Iray Light Transport Simulation and
/// Rendering System", 2017, appendix A.3). All unit; `normal` and `geometric` face the viewer.
fn outward(normal: DVec3, geometric: DVec3, wo: DVec3) -> DVec3 {
    /// How far above the surface the mirrored direction is raised before it is contribution back to unit
    /// length, as a share of the viewer's elevation: enough to stay above it in rounding.
    const LEAST: f64 = 0.05;
    let mirrored = 2.0 * normal.dot(wo) * normal - wo;
    let lacking = LEAST * geometric.dot(wo) - geometric.dot(mirrored);
    let slope = normal.dot(geometric);
    if lacking <= 0.0 || slope <= 0.0 {
        return normal;
    }
    let raised = (mirrored + normal * (lacking / slope)).try_normalize();
    raised.and_then(|raised| (wo + raised).try_normalize()).unwrap_or(normal)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bent_normals_mirror_outwards() {
        let unit = |azimuth: f64, cosine: f64| {
            let sine = (1.0 - cosine * cosine).sqrt();
            DVec3::new(azimuth.cos() * sine, azimuth.sin() * sine, cosine)
        };
        let mut bent = 0;
        for k in 0..4000 {
            let share = |step: f64| (f64::from(k) * step).fract();
            let wo = unit(std::f64::consts::TAU * share(0.618), 0.01 + 0.99 * share(0.7549));
            let normal = unit(std::f64::consts::TAU * share(0.5698), 0.01 + 0.99 * share(0.8191));
            if normal.dot(wo) <= 0.0 {
                continue;
            }
            let outward = outward(normal, DVec3::Z, wo);
            let mirrored = |n: DVec3| (2.0 * n.dot(wo) * n - wo).z;
            assert!((outward.length() - 1.0).abs() < 1e-12);
            assert!(mirrored(outward) > 0.0, "{normal} {wo}: {outward}");
            if mirrored(normal) >= 0.05 * wo.z {
                assert_eq!(outward, normal, "untouched where it need not be");
            } else {
                bent += 1;
            }
        }
        assert!(bent > 500, "{bent}");
    }
}
