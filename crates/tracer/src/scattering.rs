//! Scattering of light by materials, and the models of surfaces for it.

use etendue_spectrum::Curve;

use crate::{Color, Conductor, SceneCurve, TextureUse};

/// Way in which a surface scatters light.
#[derive(Debug, Clone, PartialEq)]
pub enum Scattering {
    /// Not at all.
    Black,
    /// Alike in all directions (Lambert).
    Matte,
    /// Not at all, but it shows its base colour to whoever looks (`KHR_materials_unlit`).
    Unlit,
    /// As a mirror.
    Mirror,
    /// As metal with GGX facets.
    Metal {
        /// Roughness, 0..=1; its square is GGX's α.
        roughness: f64,
        /// The metal whose measured index it has, in place of the base colour.
        named: Option<Conductor>,
    },
    /// As a boundary of glass; the front is outside.
    Dielectric(Glass),
    /// As glTF's metallic-roughness surfaces.
    Gltf(Box<GltfSurface>),
}

impl Scattering {
    /// Tests whether it is made to show other surfaces, mirrored or through it.
    #[must_use]
    pub fn shows_others(&self) -> bool {
        match self {
            Self::Mirror | Self::Metal { .. } | Self::Dielectric(_) => true,
            Self::Black | Self::Matte | Self::Unlit | Self::Gltf(_) => false,
        }
    }

    /// The glass of the body behind its front.
    #[inline]
    #[must_use]
    pub fn glass(&self) -> Option<&Glass> {
        match self {
            Self::Dielectric(glass) => Some(glass),
            Self::Black
            | Self::Matte
            | Self::Unlit
            | Self::Mirror
            | Self::Metal { .. }
            | Self::Gltf(_) => None,
        }
    }

    /// True if it is the boundary of a body that light goes through.
    #[inline]
    #[must_use]
    pub fn is_body(&self) -> bool {
        self.glass().is_some()
    }

    /// True if it may be a smooth pane without thickness, which light passes straight
    /// (`KHR_materials_transmission` without roughness).
    #[must_use]
    pub fn is_pane(&self) -> bool {
        match self {
            Self::Gltf(surface) => surface.transmission > 0.0 && surface.metallic < 1.0,
            Self::Black
            | Self::Matte
            | Self::Unlit
            | Self::Mirror
            | Self::Metal { .. }
            | Self::Dielectric(_) => false,
        }
    }

    /// True if light may go through it: a body's boundary or a pane.
    #[must_use]
    pub fn lets_pass(&self) -> bool {
        self.is_body() || self.is_pane()
    }

    /// Absorption of light by the body behind its front.
    #[must_use]
    pub fn absorption(&self) -> Option<Absorption> {
        self.glass()?.absorption.clone()
    }

    /// The metal whose measured index it has.
    #[inline]
    #[must_use]
    pub fn measured_metal(&self) -> Option<&Conductor> {
        match self {
            Self::Metal { named, .. } => named.as_ref(),
            Self::Black
            | Self::Matte
            | Self::Unlit
            | Self::Mirror
            | Self::Dielectric(_)
            | Self::Gltf(_) => None,
        }
    }

    /// The textures that it looks at.
    pub(crate) fn textures_mut(&mut self) -> impl Iterator<Item = &mut TextureUse> {
        let surface = if let Self::Gltf(surface) = self { Some(surface) } else { None };
        let textures = surface.map(|surface| {
            [
                &mut surface.metallic_roughness,
                &mut surface.glossiness_texture,
                &mut surface.specular_texture,
                &mut surface.specular_color_texture,
                &mut surface.transmission_texture,
                &mut surface.clearcoat_texture,
                &mut surface.clearcoat_roughness_texture,
                &mut surface.sheen_color_texture,
                &mut surface.sheen_roughness_texture,
                &mut surface.anisotropy_texture,
            ]
        });
        textures.into_iter().flatten().flatten()
    }

    /// The glTF surface, of one.
    #[must_use]
    pub fn gltf(&self) -> Option<&GltfSurface> {
        match self {
            Self::Gltf(surface) => Some(surface),
            Self::Black
            | Self::Matte
            | Self::Unlit
            | Self::Mirror
            | Self::Metal { .. }
            | Self::Dielectric(_) => None,
        }
    }
}

/// A body of glass, water or the like.
#[derive(Debug, Clone, PartialEq)]
pub struct Glass {
    /// Its refractive index.
    pub ior: Ior,
    /// Roughness of its surface, 0..=1; its square is GGX's α.
    pub roughness: f64,
    /// Absorption of light on its way through.
    pub absorption: Option<Absorption>,
}

impl Glass {
    /// Smooth and clear.
    #[must_use]
    pub fn clear(ior: Ior) -> Self {
        Self { ior, roughness: 0.0, absorption: None }
    }
}

/// Light that a body takes away on the way through it, by Beer and Lambert: after a way `s` there is
/// `color` to the power `s` / `distance` left (`KHR_materials_volume`).
#[derive(Debug, Clone, PartialEq)]
pub struct Absorption {
    /// Share of light that is left after `distance`.
    pub color: Color,
    /// The same as a curve, of which the colour is the look.
    pub curve: Option<SceneCurve>,
    /// m, above 0.
    pub distance: f64,
}

/// A refractive index.
#[derive(Debug, Clone, PartialEq)]
pub enum Ior {
    /// The same for all wavelengths.
    Constant(f64),
    /// By wavelength (nm).
    Dispersive(Curve),
}

impl Ior {
    /// The index at a wavelength (nm).
    #[must_use]
    pub fn at(&self, wavelength: f64) -> f64 {
        match self {
            Self::Constant(n) => *n,
            Self::Dispersive(curve) => curve.held(wavelength),
        }
    }
}

/// glTF's metallic-roughness parameters. Textures multiply their factors, by the channels that glTF
/// prescribes.
#[derive(Debug, Clone, PartialEq)]
pub struct GltfSurface {
    /// Share of metal, 0..=1.
    pub metallic: f64,
    /// Roughness, 0..=1; its square is GGX's α.
    pub roughness: f64,
    /// Roughness in green, metal in blue (linear).
    pub metallic_roughness: Option<TextureUse>,
    /// Glossiness in alpha, which makes the roughness 1 − (1 − roughness) · alpha in place of
    /// [`Self::metallic_roughness`] (`KHR_materials_pbrSpecularGlossiness`).
    pub glossiness_texture: Option<TextureUse>,
    /// Refractive index of the dielectric (`KHR_materials_ior`).
    pub ior: f64,
    /// Strength of the dielectric's reflection (`KHR_materials_specular`), 0..=1.
    pub specular: f64,
    /// Strength in alpha (linear).
    pub specular_texture: Option<TextureUse>,
    /// Colour of the dielectric's reflection face on; may exceed 1.
    pub specular_color: Color,
    /// The same as a curve, of which the colour is the look.
    pub specular_curve: Option<SceneCurve>,
    /// Colour (sRGB).
    pub specular_color_texture: Option<TextureUse>,
    /// Share of light that passes a thin wall (`KHR_materials_transmission`), 0..=1.
    pub transmission: f64,
    /// Share in red (linear).
    pub transmission_texture: Option<TextureUse>,
    /// Share of a clear coat over all of it (`KHR_materials_clearcoat`), 0..=1.
    pub clearcoat: f64,
    /// Share in red (linear).
    pub clearcoat_texture: Option<TextureUse>,
    /// The coat's roughness, 0..=1.
    pub clearcoat_roughness: f64,
    /// Roughness in green (linear).
    pub clearcoat_roughness_texture: Option<TextureUse>,
    /// Reflectance of a sheen (`KHR_materials_sheen`); black where there is none.
    pub sheen_color: Color,
    /// The same as a curve, of which the colour is the look.
    pub sheen_curve: Option<SceneCurve>,
    /// Colour (sRGB).
    pub sheen_color_texture: Option<TextureUse>,
    /// The sheen's roughness, 0..=1.
    pub sheen_roughness: f64,
    /// Roughness in alpha (linear).
    pub sheen_roughness_texture: Option<TextureUse>,
    /// Degree to which highlights are rougher along the surface's grain than across it
    /// (`KHR_materials_anisotropy`), 0..=1.
    pub anisotropy: f64,
    /// Direction of the grain: the angle from growing u towards falling v (rad).
    pub anisotropy_rotation: f64,
    /// The grain in red and green (over 0..=1 what is −1..=1), strength in blue (linear).
    pub anisotropy_texture: Option<TextureUse>,
}

impl Default for GltfSurface {
    fn default() -> Self {
        Self {
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness: None,
            glossiness_texture: None,
            ior: 1.5,
            specular: 1.0,
            specular_texture: None,
            specular_color: [1.0; 3],
            specular_curve: None,
            specular_color_texture: None,
            transmission: 0.0,
            transmission_texture: None,
            clearcoat: 0.0,
            clearcoat_texture: None,
            clearcoat_roughness: 0.0,
            clearcoat_roughness_texture: None,
            sheen_color: [0.0; 3],
            sheen_curve: None,
            sheen_color_texture: None,
            sheen_roughness: 0.0,
            sheen_roughness_texture: None,
            anisotropy: 0.0,
            anisotropy_rotation: 0.0,
            anisotropy_texture: None,
        }
    }
}

impl GltfSurface {
    /// Tests whether there is nothing but a sheet of facets over a base that lets no light through, which may be smooth
    /// here and there by a texture alone.
    pub(crate) fn is_bare_sheet(&self) -> bool {
        let is_rough = self.roughness > 0.0 || self.glossiness_texture.is_some();
        let is_covered = self.clearcoat > 0.0 || self.sheen_color != [0.0; 3];
        is_rough && !is_covered && self.anisotropy == 0.0 && self.transmission == 0.0
    }
}
