//! From a hit to a surface that light can be scattered by.

use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{HitBatch, RayBatch};

use crate::bsdf::{Bsdf, Coat, Layered, Model, Sheen, fresnel};
use crate::material::{Alpha, GltfSurface, NormalMap};
use crate::placed::PlacedSurface;
use crate::reference::{SceneView, SurfacePoint};
use crate::sampling::Frame;
use crate::spawn::Anchor;
use crate::{Color, Footprint, Ior, LightingContext, Material, Scattering};

/// The least α across a grain.
const SMOOTHEST_GRAIN: f64 = 1e-3;

/// A hit seen from its ray.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SurfaceInteraction<'a> {
    pub(crate) spot: SurfacePoint<'a>,
    placed: &'a PlacedSurface,
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
        stage: &'a LightingContext<'a>,
        rays: &RayBatch,
        hits: &HitBatch,
        i: usize,
        footprint: Option<Footprint>,
    ) -> Option<Self> {
        let around = &stage.surroundings;
        let placed = stage.placed.get(hits.placement[i])?;
        let spot = SurfacePoint { footprint, ..around.spot(hits, i)? };
        let material = around.material(&spot)?;
        let (origin, direction) = (rays.origin(i), rays.direction(i));
        let normal = hits.normal(i);
        let anchor = stage.anchor(origin + direction * hits.t[i], normal, origin, placed);
        let front = normal.dot(direction) <= 0.0;
        let base = around.base_color(material, &spot);
        Some(Self { spot, placed, material, anchor, front, base, wo: -direction })
    }

    /// Share of the surface that is there.
    pub(crate) fn opacity(&self) -> f64 {
        if self.material.one_sided && !self.front {
            return 0.0;
        }
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
            Scattering::Metal { roughness, named } => {
                Model::Metal { alpha: roughness * roughness, named: *named }
            }
            Scattering::Dielectric(glass) => Model::Dielectric {
                alpha: glass.roughness * glass.roughness,
                eta: self.eta(&glass.ior, wavelength),
            },
            Scattering::Gltf(surface) => return self.layered(around, surface, geometric),
        };
        let shading = self.shading(around, geometric);
        Bsdf::new(model, [geometric, shading], self.wo, [self.color(), [1.0; 3]])
    }

    /// Index behind the surface over the index in front, as seen from its ray, at a wavelength (nm).
    pub(crate) fn eta(&self, ior: &Ior, wavelength: f64) -> f64 {
        let n = ior.at(wavelength);
        if self.front { n } else { 1.0 / n }
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
        let shading = self.shading(around, geometric);
        let alpha = roughness * roughness;
        let grain = self.grain(around, own, shading);
        let strength = grain.map_or(0.0, |(_, strength)| strength);
        let model = Model::Layered(Layered {
            metallic: (own.metallic * rough[2]).clamp(0.0, 1.0),
            // A grain has no single directions, however smooth it is across.
            alpha: if strength > 0.0 { alpha.max(SMOOTHEST_GRAIN) } else { alpha },
            along: alpha + (1.0 - alpha) * strength * strength,
            f0: face_on * specular,
            f90: specular,
            transmission: (own.transmission * texel(&own.transmission_texture)[0]).clamp(0.0, 1.0),
            sheen: match own.sheen_color {
                [0.0, 0.0, 0.0] => Sheen::default(),
                color => {
                    let tint = own.sheen_color_texture.as_ref();
                    let tint = tint.map_or([1.0; 4], |image| around.tint(image, &self.spot));
                    Sheen {
                        color: std::array::from_fn(|k| (color[k] * tint[k]).clamp(0.0, 1.0)),
                        roughness: own.sheen_roughness * texel(&own.sheen_roughness_texture)[3],
                    }
                }
            },
            coat: match own.clearcoat {
                0.0 => Coat::default(),
                share => Coat {
                    share: (share * texel(&own.clearcoat_texture)[0]).clamp(0.0, 1.0),
                    alpha: (own.clearcoat_roughness * texel(&own.clearcoat_roughness_texture)[1])
                        .clamp(0.0, 1.0)
                        .powi(2),
                },
            },
        });
        let frame = match grain {
            Some((along, _)) => Frame::along(shading, along),
            None => Frame::around(shading),
        };
        Bsdf::turned(model, (geometric, frame), self.wo, [self.color(), highlight])
    }

    /// Where the grain goes, and how strong it is; `None` where there is none, or where no texture coordinates
    /// tell where.
    fn grain(
        &self,
        around: &SceneView<'_>,
        own: &GltfSurface,
        normal: DVec3,
    ) -> Option<(DVec3, f64)> {
        if own.anisotropy == 0.0 {
            return None;
        }
        let image = own.anisotropy_texture.as_ref();
        let [x, y, share, _] = match image.and_then(|image| around.lookup(image, &self.spot)) {
            Some([x, y, share, _]) => [2.0 * x - 1.0, 2.0 * y - 1.0, share, 1.0],
            None => [1.0, 0.0, 1.0, 1.0],
        };
        let (sin, cos) = own.anisotropy_rotation.sin_cos();
        let [tangent, bitangent] =
            self.spot.tangents(image.map_or(0, |i| i.uv_set as usize), normal)?;
        let along = tangent * (cos * x - sin * y) + bitangent * (sin * x + cos * y);
        Some((along, (own.anisotropy * share).clamp(0.0, 1.0)))
    }

    /// The shading normal on the viewer's side; the geometric one where the viewer would see its
    /// back.
    fn shading(&self, around: &SceneView<'_>, geometric: DVec3) -> DVec3 {
        if !self.placed.is_tilted {
            return geometric;
        }
        let (turn, front) = (self.placed.turn.as_ref(), self.anchor.normal);
        let normal = self.spot.tilted_normal(around, self.material, turn, front);
        facing(if self.front { normal } else { -normal }, geometric, self.wo)
    }
}

impl SurfacePoint<'_> {
    /// The shading normal on the front, of which `front` is the geometric one; `turn` brings the mesh's
    /// normals into the world.
    pub(crate) fn tilted_normal(
        &self,
        around: &SceneView<'_>,
        material: &Material,
        turn: Option<&DMat3>,
        front: DVec3,
    ) -> DVec3 {
        let normal = self.turned_normal(turn, front).unwrap_or(front);
        match &material.normal_map {
            Some(map) => self.mapped_normal(around, map, normal),
            None => normal,
        }
    }

    /// The normal tilted by a normal map: +x along u, +y up the image, against v (glTF 2.0, section
    /// 3.9.3).
    fn mapped_normal(&self, around: &SceneView<'_>, map: &NormalMap, normal: DVec3) -> DVec3 {
        let Some([tangent, bitangent]) = self.tangents(map.image.uv_set as usize, normal) else {
            return normal;
        };
        let Some(texel) = around.lookup(&map.image, self) else { return normal };
        let [x, y, z, _] = texel.map(|c| 2.0 * c - 1.0);
        let tilted = tangent * (x * map.scale) + bitangent * (y * map.scale) + normal * z;
        tilted.try_normalize().unwrap_or(normal)
    }

    /// Unit vectors at right angles to `normal` and each other: towards growing u of a set, and towards falling
    /// v.
    fn tangents(&self, set: usize, normal: DVec3) -> Option<[DVec3; 2]> {
        let [along_u, along_v] = self.texture_axes(set)?;
        let tangent = (along_u - normal * normal.dot(along_u)).try_normalize()?;
        let across = normal.cross(tangent);
        Some([tangent, if across.dot(along_v) > 0.0 { -across } else { across }])
    }
}

/// A shading normal as light is scattered by: the geometric one where the viewer would see its back,
/// and bent until it mirrors the viewer along the surface where it would mirror them into it, as a
/// tilted mirror would be black there (Keller et al., "The Iray Light Transport Simulation and
/// Rendering System", 2017, appendix A.3). All unit; `geometric` faces the viewer.
#[inline(always)]
pub(crate) fn facing(normal: DVec3, geometric: DVec3, wo: DVec3) -> DVec3 {
    /// How far above the surface the mirrored direction is raised before it is brought back to unit
    /// length, as a share of the viewer's elevation: enough to stay above it in rounding.
    const LEAST: f64 = 0.05;
    let cosine = normal.dot(wo);
    let mirrored = 2.0 * cosine * normal - wo;
    let lacking = LEAST * geometric.dot(wo) - geometric.dot(mirrored);
    let slope = normal.dot(geometric);
    let raised = mirrored + normal * (lacking / slope);
    let half = wo + raised * (1.0 / raised.length());
    let bent = half * (1.0 / half.length());
    let is_sound = bent.x.abs() + bent.y.abs() + bent.z.abs() <= 2.0;
    let bends = (lacking > 0.0) & (slope > 0.0) & is_sound;
    let pick = |yes: bool, a: DVec3, b: DVec3| {
        let pick = |a, b| if yes { a } else { b };
        DVec3::new(pick(a.x, b.x), pick(a.y, b.y), pick(a.z, b.z))
    };
    pick(cosine > 0.0, pick(bends, bent, normal), geometric)
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
            let outward = facing(normal, DVec3::Z, wo);
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
