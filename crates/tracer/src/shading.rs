//! Scattering of light by a surface where it was hit: from the numbers and textures of its material to a [`Bsdf`].

use etendue_geometry::glam::DVec3;

use crate::bsdf::{Bsdf, Coat, Layered, Model, Sheen, fresnel};
use crate::reference::{SceneView, SurfacePoint};
use crate::sampling::Frame;
use crate::scattering::GltfSurface;
use crate::spectral::part;
use crate::surface::SurfaceInteraction;
use crate::{Conductor, Scattering, Spectral, TextureUse, Tint};

/// The least α across a grain.
const SMOOTHEST_GRAIN: f64 = 1e-3;

/// A sheet of facets over a matte or metallic base, at one point.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SheetSurface {
    /// Share of metal, 0..=1.
    pub(crate) metallic: f64,
    /// The square of the roughness, 0..=1.
    pub(crate) alpha: f64,
    /// The dielectric's reflectance face on, before the highlights' colour, and at grazing incidence.
    pub(crate) f0: f64,
    pub(crate) f90: f64,
    /// The colour of its highlights.
    pub(crate) highlight: Tint,
}

impl SurfaceInteraction<'_> {
    /// Its scattering of light of the wavelength (nm); `None` of surfaces that are worked out in lanes alone.
    pub(crate) fn bsdf(
        &self,
        scene: &SceneView<'_>,
        spectral: &Spectral,
        wavelength: f64,
    ) -> Option<Bsdf> {
        self.material.scattering.bsdf(self, scene, spectral, wavelength)
    }
}

impl Scattering {
    /// Its model at a hit, for light of a wavelength (nm), if it has one by itself.
    fn bsdf(
        &self,
        interaction: &SurfaceInteraction<'_>,
        scene: &SceneView<'_>,
        spectral: &Spectral,
        wavelength: f64,
    ) -> Option<Bsdf> {
        let model = match self {
            Self::Black | Self::Unlit | Self::Matte | Self::Mirror => return None,
            Self::Metal { roughness, named } => Model::Metal {
                alpha: roughness * roughness,
                named: named.as_ref().map(Conductor::id),
            },
            Self::Dielectric(glass) => Model::Dielectric {
                alpha: glass.roughness * glass.roughness,
                eta: interaction.eta(scene, wavelength),
            },
            Self::Gltf(surface) => return Some(surface.bsdf(interaction, scene, spectral)),
        };
        let (geometric, shading) = interaction.normals(scene);
        let colors = [interaction.color(), Tint::WHITE];
        Some(Bsdf::new(model, [geometric, shading], interaction.wo, colors))
    }
}

impl GltfSurface {
    /// Its sheet of facets at a point.
    pub(crate) fn sheet(
        &self,
        point: &SurfacePoint<'_>,
        scene: &SceneView<'_>,
        spectral: &Spectral,
    ) -> SheetSurface {
        let texel = |image: &Option<_>| match image {
            Some(image) => scene.texel(image, point),
            None => [1.0; 4],
        };
        let tint = self.specular_color_texture.as_ref();
        let tint = tint.map_or([1.0; 4], |image| scene.tint(image, point));
        self.sheet_of(texel, tint, spectral)
    }

    /// Its sheet of facets, where no image is laid over it.
    pub(crate) fn plain_sheet(&self, spectral: &Spectral) -> Option<SheetSurface> {
        let images = [
            &self.metallic_roughness,
            &self.glossiness_texture,
            &self.specular_texture,
            &self.specular_color_texture,
        ];
        let are_none = images.iter().all(|image| image.is_none());
        are_none.then(|| self.sheet_of(|_| [1.0; 4], [1.0; 4], spectral))
    }

    /// Its sheet of facets, where images say so much and tint its highlights so.
    fn sheet_of(
        &self,
        texel: impl Fn(&Option<TextureUse>) -> [f64; 4],
        tint: [f64; 4],
        spectral: &Spectral,
    ) -> SheetSurface {
        let rough = texel(&self.metallic_roughness);
        let roughness = match &self.glossiness_texture {
            Some(_) => 1.0 - (1.0 - self.roughness) * texel(&self.glossiness_texture)[3],
            None => self.roughness * rough[1],
        };
        let roughness = roughness.clamp(0.0, 1.0);
        let specular = (self.specular * texel(&self.specular_texture)[3]).clamp(0.0, 1.0);
        let face_on = fresnel::normal_reflectance(self.ior);
        // The extension caps the reflectance face on at 1.
        let most = if face_on > 0.0 { 1.0 / face_on } else { f64::INFINITY };
        SheetSurface {
            metallic: (self.metallic * rough[2]).clamp(0.0, 1.0),
            alpha: roughness * roughness,
            f0: face_on * specular,
            f90: specular,
            highlight: {
                let (color, spectrum) =
                    part(spectral, self.specular_color, self.specular_curve.as_ref());
                Tint { color: std::array::from_fn(|k| (color[k] * tint[k]).min(most)), spectrum }
            },
        }
    }

    /// Its layers at a hit.
    fn bsdf(
        &self,
        interaction: &SurfaceInteraction<'_>,
        scene: &SceneView<'_>,
        spectral: &Spectral,
    ) -> Bsdf {
        let texel = |image: &Option<_>| match image {
            Some(image) => scene.texel(image, &interaction.point),
            None => [1.0; 4],
        };
        let SheetSurface { metallic, alpha, f0, f90, highlight } =
            self.sheet(&interaction.point, scene, spectral);
        let (geometric, shading) = interaction.normals(scene);
        let grain = self.grain(interaction, scene, shading);
        let strength = grain.map_or(0.0, |(_, strength)| strength);
        let model = Model::Layered(Layered {
            metallic,
            // A grain has no single directions, however smooth it is across.
            alpha: if strength > 0.0 { alpha.max(SMOOTHEST_GRAIN) } else { alpha },
            along: alpha + (1.0 - alpha) * strength * strength,
            f0,
            f90,
            ior: self.ior,
            transmission: (self.transmission * texel(&self.transmission_texture)[0])
                .clamp(0.0, 1.0),
            sheen: match self.sheen_color {
                [0.0, 0.0, 0.0] => Sheen::default(),
                look => {
                    let (color, spectrum) = part(spectral, look, self.sheen_curve.as_ref());
                    let tint = self.sheen_color_texture.as_ref();
                    let tint = tint.map_or([1.0; 4], |image| scene.tint(image, &interaction.point));
                    Sheen {
                        color: Tint {
                            color: std::array::from_fn(|k| (color[k] * tint[k]).clamp(0.0, 1.0)),
                            spectrum,
                        },
                        roughness: self.sheen_roughness * texel(&self.sheen_roughness_texture)[3],
                    }
                }
            },
            coat: match self.clearcoat {
                0.0 => Coat::default(),
                share => Coat {
                    share: (share * texel(&self.clearcoat_texture)[0]).clamp(0.0, 1.0),
                    alpha: (self.clearcoat_roughness * texel(&self.clearcoat_roughness_texture)[1])
                        .clamp(0.0, 1.0)
                        .powi(2),
                },
            },
        });
        let frame = match grain {
            Some((along, _)) => Frame::along(shading, along),
            None => Frame::around(shading),
        };
        Bsdf::turned(model, geometric, frame, interaction.wo, [interaction.color(), highlight])
    }

    /// Direction of the grain, and its strength; `None` where there is none, or where no texture coordinates
    /// give a direction.
    fn grain(
        &self,
        interaction: &SurfaceInteraction<'_>,
        scene: &SceneView<'_>,
        normal: DVec3,
    ) -> Option<(DVec3, f64)> {
        if self.anisotropy == 0.0 {
            return None;
        }
        let image = self.anisotropy_texture.as_ref();
        let [x, y, share, _] = match image.and_then(|image| scene.lookup(image, &interaction.point))
        {
            Some([x, y, share, _]) => [2.0 * x - 1.0, 2.0 * y - 1.0, share, 1.0],
            None => [1.0, 0.0, 1.0, 1.0],
        };
        let (sin, cos) = self.anisotropy_rotation.sin_cos();
        let [tangent, bitangent] =
            interaction.point.tangents(image.map_or(0, |i| i.uv_set as usize), normal)?;
        let along = tangent * (cos * x - sin * y) + bitangent * (sin * x + cos * y);
        Some((along, (self.anisotropy * share).clamp(0.0, 1.0)))
    }
}
