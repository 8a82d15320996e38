//! Materials, ready to be looked up at a hit: what colour a surface has, how it scatters light, and
//! what it gives off itself.

use etendue_spectrum::{Curve, Illuminant, Metal};

use crate::texture::Encoding;
use crate::{LightGroup, TextureUse};

/// Linear RGB with the sRGB primaries, 0..=1 for reflectances.
pub type Color = [f64; 3];

/// A material ready to be looked up at a hit.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// What the file calls it, for messages and overrides.
    pub name: String,
    /// Base colour.
    pub base_color: Paint,
    /// The mesh's vertex colours multiply the base colour (glTF's `COLOR_0`).
    pub vertex_colors: bool,
    /// How light is scattered.
    pub scattering: Scattering,
    /// What the surface gives off.
    pub emission: Option<Emission>,
    /// Where the surface is not there at all.
    pub alpha: Alpha,
    /// The back is not there: rays from the camera, and those that go on from them, pass where they meet it.
    pub one_sided: bool,
    /// Tilts of the normal.
    pub normal_map: Option<NormalMap>,
    /// How much of the light from all around reaches the surface.
    pub occlusion: Option<Occlusion>,
}

/// Light from all around that does not reach a surface, by an image (glTF 2.0, section 3.9.3). Light
/// that is traced finds out by itself what is hidden from it, so only pictures without traced light
/// use it.
#[derive(Debug, Clone, PartialEq)]
pub struct Occlusion {
    /// The image (linear): the share that arrives, in red.
    pub image: TextureUse,
    /// How much of it counts, 0..=1.
    pub strength: f64,
}

/// How a surface scatters light.
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
        named: Option<Metal>,
    },
    /// As a boundary of glass; the front is outside.
    Dielectric(Glass),
    /// As glTF's metallic-roughness surfaces.
    Gltf(Box<GltfSurface>),
}

impl Scattering {
    /// Whether it scatters light in several ways, among which is chosen.
    #[must_use]
    pub fn has_parts(&self) -> bool {
        match self {
            Self::Dielectric(_) | Self::Gltf(_) => true,
            Self::Metal { roughness, .. } => *roughness > 0.0,
            Self::Black | Self::Matte | Self::Unlit | Self::Mirror => false,
        }
    }

    /// Whether it is made to show other surfaces, mirrored or through it.
    #[must_use]
    pub fn shows_others(&self) -> bool {
        match self {
            Self::Mirror | Self::Metal { .. } | Self::Dielectric(_) => true,
            Self::Black | Self::Matte | Self::Unlit | Self::Gltf(_) => false,
        }
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
    /// What is left of light on its way through.
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
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Absorption {
    /// What is left after `distance`.
    pub color: Color,
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
    /// Colour (sRGB).
    pub sheen_color_texture: Option<TextureUse>,
    /// The sheen's roughness, 0..=1.
    pub sheen_roughness: f64,
    /// Roughness in alpha (linear).
    pub sheen_roughness_texture: Option<TextureUse>,
    /// How much rougher highlights are along the surface's grain than across it
    /// (`KHR_materials_anisotropy`), 0..=1.
    pub anisotropy: f64,
    /// Where the grain goes: the angle from growing u towards falling v (rad).
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
            specular_color_texture: None,
            transmission: 0.0,
            transmission_texture: None,
            clearcoat: 0.0,
            clearcoat_texture: None,
            clearcoat_roughness: 0.0,
            clearcoat_roughness_texture: None,
            sheen_color: [0.0; 3],
            sheen_color_texture: None,
            sheen_roughness: 0.0,
            sheen_roughness_texture: None,
            anisotropy: 0.0,
            anisotropy_rotation: 0.0,
            anisotropy_texture: None,
        }
    }
}

/// What a surface gives off.
#[derive(Debug, Clone, PartialEq)]
pub struct Emission {
    /// Radiance, times [`Self::strength`].
    pub radiance: Paint,
    /// Multiplies the radiance (`KHR_materials_emissive_strength`).
    pub strength: f64,
    /// The spectrum that the radiance multiplies; equal energy when absent.
    pub illuminant: Option<Illuminant>,
    /// The back shines too.
    pub two_sided: bool,
    /// The group of lights that it is of, if it names one.
    pub group: Option<LightGroup>,
}

/// Where a surface lets rays pass as if it were not there.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Alpha {
    /// Nowhere.
    #[default]
    Opaque,
    /// Where the base colour's alpha is below the cut-off.
    Mask {
        /// Multiplies the alpha.
        factor: f64,
        /// The cut-off.
        cutoff: f64,
    },
    /// In the share that alpha leaves.
    Blend {
        /// Multiplies the alpha.
        factor: f64,
    },
}

/// Tilts of the normal by an image.
#[derive(Debug, Clone, PartialEq)]
pub struct NormalMap {
    /// The image (linear); x and y over 0..=1 are tilts of −1..=1.
    pub image: TextureUse,
    /// Multiplies the tilts.
    pub scale: f64,
}

impl Material {
    /// A material that scatters in this way and nothing else.
    #[must_use]
    pub fn new(name: impl Into<String>, base_color: Paint, scattering: Scattering) -> Self {
        Self {
            name: name.into(),
            base_color,
            vertex_colors: false,
            scattering,
            emission: None,
            alpha: Alpha::Opaque,
            one_sided: false,
            normal_map: None,
            occlusion: None,
        }
    }

    /// The material of whatever names none: glTF's default white is too bright to show shape, so
    /// this is a light grey only where the file has no material at all.
    #[must_use]
    pub fn unnamed() -> Self {
        let plain = Self::new("", Paint::Plain([0.8; 3]), Scattering::Matte);
        Self { vertex_colors: true, ..plain }
    }

    /// Which textures a render of this scope looks at, and as what.
    #[must_use]
    pub fn textures(&self, scope: TextureScope) -> Vec<(u32, Encoding)> {
        let mut copy = self.clone();
        let uses = copy.textures_mut(scope);
        uses.into_iter().map(|used| (used.texture, used.encoding)).collect()
    }

    /// The uses of textures, to be renumbered.
    pub fn textures_mut(&mut self, scope: TextureScope) -> Vec<&mut TextureUse> {
        let mut uses: Vec<&mut TextureUse> = self.base_color.image_mut().into_iter().collect();
        if scope.ambient {
            uses.extend(self.occlusion.as_mut().map(|occlusion| &mut occlusion.image));
        }
        if !scope.light {
            return uses;
        }
        if let Scattering::Gltf(surface) = &mut self.scattering {
            uses.extend(surface.metallic_roughness.as_mut());
            uses.extend(surface.glossiness_texture.as_mut());
            uses.extend(surface.specular_texture.as_mut());
            uses.extend(surface.specular_color_texture.as_mut());
            uses.extend(surface.transmission_texture.as_mut());
            uses.extend(surface.clearcoat_texture.as_mut());
            uses.extend(surface.clearcoat_roughness_texture.as_mut());
            uses.extend(surface.sheen_color_texture.as_mut());
            uses.extend(surface.sheen_roughness_texture.as_mut());
            uses.extend(surface.anisotropy_texture.as_mut());
        }
        uses.extend(self.emission.as_mut().and_then(|emission| emission.radiance.image_mut()));
        uses.extend(self.normal_map.as_mut().map(|map| &mut map.image));
        uses
    }

    /// Whether anything of it changes over texture coordinates.
    #[must_use]
    pub fn is_patterned(&self) -> bool {
        let shines = self.emission.as_ref().is_some_and(|emission| emission.radiance.needs_uv());
        self.base_color.needs_uv() || shines || !self.textures(TextureScope::ALL).is_empty()
    }

    /// Whether it may be a smooth pane without thickness, which light passes straight
    /// (`KHR_materials_transmission` without roughness).
    #[must_use]
    pub fn is_pane(&self) -> bool {
        let passes = |surface: &GltfSurface| surface.transmission > 0.0 && surface.metallic < 1.0;
        self.scattering.gltf().is_some_and(passes)
    }

    /// What the body behind its front takes from light.
    #[must_use]
    pub fn absorption(&self) -> Option<Absorption> {
        match &self.scattering {
            Scattering::Dielectric(glass) => glass.absorption,
            Scattering::Black
            | Scattering::Matte
            | Scattering::Unlit
            | Scattering::Mirror
            | Scattering::Metal { .. }
            | Scattering::Gltf(_) => None,
        }
    }

    /// Whether rays may pass the surface as if it were not there.
    #[must_use]
    pub fn has_alpha(&self) -> bool {
        self.alpha != Alpha::Opaque || self.one_sided
    }
}

/// How much of a material a render looks at beside the base colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct TextureScope {
    /// All that light transport does.
    pub light: bool,
    /// The occlusion of ambient light.
    pub ambient: bool,
}

impl TextureScope {
    /// All of it.
    pub const ALL: Self = Self { light: true, ambient: true };
}

/// A colour over a surface.
#[derive(Debug, Clone, PartialEq)]
pub enum Paint {
    /// One colour everywhere.
    Plain(Color),
    /// Squares of two colours over texture coordinate set 0.
    Checker {
        /// The two colours.
        colors: [Color; 2],
        /// Squares along one unit of the texture coordinates.
        squares: f64,
    },
    /// An image times a factor.
    Image {
        /// Multiplies the image.
        factor: Color,
        /// Which image, over which coordinates.
        image: TextureUse,
    },
}

impl Paint {
    /// Whether a lookup needs texture coordinates.
    #[must_use]
    pub fn needs_uv(&self) -> bool {
        !matches!(self, Self::Plain(_))
    }

    /// The use of an image, if there is one.
    pub fn image_mut(&mut self) -> Option<&mut TextureUse> {
        if let Self::Image { image, .. } = self { Some(image) } else { None }
    }

    /// The use of an image, if there is one.
    #[must_use]
    pub fn image(&self) -> Option<&TextureUse> {
        if let Self::Image { image, .. } = self { Some(image) } else { None }
    }
}
