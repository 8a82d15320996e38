//! From a hit to a surface that light can be scattered by.

use etendue_geometry::MISS;
use etendue_geometry::glam::{DMat3, DVec3};

use crate::material::NormalMap;
use crate::placed::PlacedSurface;
use crate::reference::{SceneView, SurfacePoint};
use crate::spawn::Anchor;
use crate::transport::RayHit;
use crate::{Ior, LightingContext, Material, Tint};

/// A hit seen from its ray.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SurfaceInteraction<'a> {
    pub(crate) point: SurfacePoint<'a>,
    placed: &'a PlacedSurface,
    pub(crate) material: &'a Material,
    pub(crate) anchor: Anchor,
    /// The ray came from the triangle's front.
    pub(crate) front: bool,
    /// Base colour, and alpha.
    pub(crate) base: Tint,
    pub(crate) alpha: f64,
    pub(crate) wo: DVec3,
    /// The placements whose media are on the ray's side and behind; [`MISS`] is air.
    pub(crate) media: [u32; 2],
}

impl<'a> SurfaceInteraction<'a> {
    /// The hit of a ray on a placement, at a point of it.
    pub(crate) fn at(
        ctx: &'a LightingContext<'a>,
        point: SurfacePoint<'a>,
        hit: &RayHit,
    ) -> Option<Self> {
        let &RayHit { origin, direction, t, normal, id: [own, _], .. } = hit;
        let scene = &ctx.scene;
        let placed = ctx.placed.get(own)?;
        let material = scene.material(&point)?;
        let anchor = ctx.anchor(origin + direction * t, normal, origin, placed);
        let front = normal.dot(direction) <= 0.0;
        let (base, alpha) = scene.base_tint(ctx.spectral, material, &point);
        let media = if front { [MISS, own] } else { [own, MISS] };
        Some(Self { point, placed, material, anchor, front, base, alpha, wo: -direction, media })
    }

    /// Share of the surface that is there.
    pub(crate) fn opacity(&self) -> f64 {
        if self.material.one_sided && !self.front {
            return 0.0;
        }
        self.material.alpha.opacity(self.alpha)
    }

    /// The base colour alone, the share of light that a surface can reflect.
    pub(crate) fn color(&self) -> Tint {
        self.base.clamped()
    }

    /// Index behind the surface over the index in front, as seen from its ray, at a wavelength (nm).
    pub(crate) fn eta(&self, scene: &SceneView<'_>, wavelength: f64) -> f64 {
        let index = |medium| scene.index(medium).map_or(1.0, |ior| ior.at(wavelength));
        let [here, behind] = self.media.map(index);
        behind / here
    }

    /// Tests whether the media on its sides part wavelengths.
    pub(crate) fn disperses(&self, scene: &SceneView<'_>) -> bool {
        let disperses = |ior: &Ior| matches!(ior, Ior::Dispersive(_));
        self.media.into_iter().filter_map(|medium| scene.index(medium)).any(disperses)
    }

    /// The geometric and the shading normal on the viewer's side; the latter is the geometric one where the
    /// viewer would see its back.
    pub(crate) fn normals(&self, scene: &SceneView<'_>) -> (DVec3, DVec3) {
        let (turn, front) = (self.placed.turn.as_ref(), self.anchor.normal);
        let geometric = if self.front { front } else { -front };
        if !self.placed.is_tilted {
            return (geometric, geometric);
        }
        let normal = self.point.tilted_normal(scene, self.material, turn, front);
        (geometric, facing(if self.front { normal } else { -normal }, geometric, self.wo))
    }
}

impl SurfacePoint<'_> {
    /// The shading normal on the front, of which `front` is the geometric one; `turn` brings the mesh's
    /// normals into the world.
    pub(crate) fn tilted_normal(
        &self,
        scene: &SceneView<'_>,
        material: &Material,
        turn: Option<&DMat3>,
        front: DVec3,
    ) -> DVec3 {
        let normal = self.turned_normal(turn, front).unwrap_or(front);
        match &material.normal_map {
            Some(map) => self.mapped_normal(scene, map, normal),
            None => normal,
        }
    }

    /// The normal tilted by a normal map: +x along u, +y up the image, against v (glTF 2.0, section
    /// 3.9.3).
    fn mapped_normal(&self, scene: &SceneView<'_>, map: &NormalMap, normal: DVec3) -> DVec3 {
        let Some([tangent, bitangent]) = self.tangents(map.image.uv_set as usize, normal) else {
            return normal;
        };
        let Some(texel) = scene.lookup(&map.image, self) else { return normal };
        let [x, y, z, _] = texel.map(|c| 2.0 * c - 1.0);
        let tilted = tangent * (x * map.scale) + bitangent * (y * map.scale) + normal * z;
        tilted.try_normalize().unwrap_or(normal)
    }

    /// Unit vectors at right angles to `normal` and each other: towards growing u of a set, and towards falling
    /// v, or as the mesh's own tangents have it.
    pub(crate) fn tangents(&self, set: usize, normal: DVec3) -> Option<[DVec3; 2]> {
        let axes = self.tangent_axes(set).or_else(|| {
            let [along_u, along_v] = self.texture_axes(set)?;
            Some([along_u, -along_v])
        });
        let [along, across] = axes?;
        let tangent = (along - normal * normal.dot(along)).try_normalize()?;
        let bitangent = normal.cross(tangent);
        Some([tangent, if bitangent.dot(across) < 0.0 { -bitangent } else { bitangent }])
    }
}

/// Elevation above the surface that the mirrored direction is raised to before it is brought back to unit length, as a
/// share of the viewer's elevation: enough to stay above it in rounding.
pub(crate) const LEAST_ELEVATION: f64 = 0.05;

/// A shading normal as light is scattered by: the geometric one where the viewer would see its back,
/// and bent until it mirrors the viewer along the surface where it would mirror them into it, as a
/// tilted mirror would be black there (Keller et al., "The Iray Light Transport Simulation and
/// Rendering System", 2017, appendix A.3). All unit; `geometric` faces the viewer.
#[inline(always)]
pub(crate) fn facing(normal: DVec3, geometric: DVec3, wo: DVec3) -> DVec3 {
    let cosine = normal.dot(wo);
    let mirrored = 2.0 * cosine * normal - wo;
    let lacking = LEAST_ELEVATION * geometric.dot(wo) - geometric.dot(mirrored);
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
    use etendue_geometry::{Geometry, Mesh, Positions, Tangents, Transform, Vertices};

    use super::*;

    /// A triangle in the plane z = 0 whose u grows along +x and whose v falls along +y, with tangents.
    fn triangle(tangent: [f32; 4], linear: DMat3) -> Geometry {
        let positions = Vertices::from_arrays(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        let mut mesh = Mesh::new("", Positions::F32(positions), vec![[0, 1, 2]].into());
        mesh.normals = Some(Vertices::from_arrays(&[[0.0, 0.0, 1.0]; 3]));
        mesh.uvs = vec![Vertices::from_arrays(&[[0.0, 1.0], [1.0, 1.0], [0.0, 0.0]]); 2];
        let corners = Vertices::from_arrays(&[tangent; 3]);
        mesh.tangents = Some(Tangents { set: 1, corners });
        Geometry::alone(mesh, Transform { linear, ..Transform::IDENTITY })
    }

    #[test]
    fn tangents_are_the_meshs_own_or_follow_from_texture_coordinates() {
        let mirrored = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
        for (tangent, linear, own) in [
            ([1.0, 0.0, 0.0, 1.0], DMat3::IDENTITY, [DVec3::X, DVec3::Y]),
            ([0.0, 1.0, 0.0, 1.0], DMat3::IDENTITY, [DVec3::Y, -DVec3::X]),
            ([0.0, 1.0, 0.0, -1.0], DMat3::IDENTITY, [DVec3::Y, DVec3::X]),
            ([1.0, 0.0, 0.0, 1.0], mirrored, [-DVec3::X, DVec3::Y]),
            ([1.0, 0.0, 0.0, -1.0], mirrored, [-DVec3::X, -DVec3::Y]),
            // Tangents that are none.
            ([0.0, 0.0, 0.0, 1.0], DMat3::IDENTITY, [DVec3::X, DVec3::Y]),
        ] {
            let geometry = triangle(tangent, linear);
            let point = SurfacePoint::corner(&geometry, &geometry.placements[0], 0);
            assert_eq!(point.tangents(1, DVec3::Z), Some(own), "{tangent:?}");
            // The other set's are those of its coordinates.
            let derived = [linear * DVec3::X, DVec3::Y];
            assert_eq!(point.tangents(0, DVec3::Z), Some(derived), "{tangent:?}");
        }
    }

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
