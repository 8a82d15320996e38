//! Materials, ready to be looked up at a hit: what colour a surface has and what it gives off itself. How it
//! scatters light is [`crate::scattering`].

use std::sync::Arc;

use etendue_spectrum::Curve;

use crate::scattering::{Absorption, Scattering};
use crate::texture::Encoding;
use crate::{Color, LightGroup, Modulation, SceneCube, SceneCurve, TextureUse};

/// A material ready to be looked up at a hit.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// Name in the file, for messages and overrides.
    pub name: String,
    /// Base colour.
    pub base_color: Paint,
    /// The mesh's vertex colours multiply the base colour (glTF's `COLOR_0`).
    pub vertex_colors: bool,
    /// Way in which light is scattered.
    pub scattering: Scattering,
    /// Light that the surface gives off.
    pub emission: Option<Emission>,
    /// Places where the surface is not there at all.
    pub alpha: Alpha,
    /// The back is not there: rays from the camera, and those that go on from them, pass where they meet it.
    pub one_sided: bool,
    /// Tilts of the normal.
    pub normal_map: Option<NormalMap>,
    /// Share of the light from all directions that reaches the surface.
    pub occlusion: Option<Occlusion>,
}

/// Light from all around that does not reach a surface, by an image (glTF 2.0, section 3.9.3). Light
/// that is traced finds out by itself what is hidden from it, so only pictures without traced light
/// use it.
#[derive(Debug, Clone, PartialEq)]
pub struct Occlusion {
    /// The image (linear): the share that arrives, in red.
    pub image: TextureUse,
    /// Share of it that counts, 0..=1.
    pub strength: f64,
}

/// Light that a surface gives off.
#[derive(Debug, Clone, PartialEq)]
pub struct Emission {
    /// Radiance, times [`Self::strength`].
    pub radiance: Paint,
    /// Multiplies the radiance (`KHR_materials_emissive_strength`).
    pub strength: f64,
    /// The spectrum that the radiance multiplies; equal energy when absent.
    pub illuminant: Option<Arc<Curve>>,
    /// The back shines too.
    pub two_sided: bool,
    /// The group of lights that it is of, if it names one.
    pub group: Option<LightGroup>,
    /// Change of its strength with time, in the frame's clock; `None` when it does not change.
    pub modulation: Option<Arc<Modulation>>,
}

/// Places where a surface lets rays pass as if it were not there.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Alpha {
    /// Nowhere.
    #[default]
    Opaque,
    /// At points where the base colour's alpha is below the cut-off.
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

impl Alpha {
    /// The share that is there, where the base colour has this alpha.
    pub(crate) fn opacity(self, alpha: f64) -> f64 {
        match self {
            Self::Opaque => 1.0,
            Self::Mask { factor, cutoff } => f64::from(u8::from(factor * alpha >= cutoff)),
            Self::Blend { factor } => (factor * alpha).clamp(0.0, 1.0),
        }
    }
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

    /// Textures that a render of this scope looks at, each with its encoding.
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
        uses.extend(self.scattering.textures_mut());
        uses.extend(self.emission.as_mut().and_then(|emission| emission.radiance.image_mut()));
        uses.extend(self.normal_map.as_mut().map(|map| &mut map.image));
        uses
    }

    /// Tests whether anything of it changes over texture coordinates.
    #[must_use]
    pub fn is_patterned(&self) -> bool {
        let shines = self.emission.as_ref().is_some_and(|emission| emission.radiance.needs_uv());
        self.base_color.needs_uv() || shines || !self.textures(TextureScope::ALL).is_empty()
    }

    /// The curves of what it reflects and lets pass.
    #[must_use]
    pub fn curves(&self) -> Vec<&SceneCurve> {
        let mut curves: Vec<&SceneCurve> = self.base_color.curves().iter().collect();
        match &self.scattering {
            Scattering::Metal { named: Some(metal), .. } => curves.extend(metal.curves()),
            Scattering::Dielectric(glass) => {
                curves.extend(glass.absorption.as_ref().and_then(|a| a.curve.as_ref()));
            }
            Scattering::Gltf(surface) => {
                curves.extend(&surface.sheen_curve);
                curves.extend(&surface.specular_curve);
            }
            Scattering::Black
            | Scattering::Matte
            | Scattering::Unlit
            | Scattering::Mirror
            | Scattering::Metal { named: None, .. } => {}
        }
        curves
    }

    /// The cube of what it reflects, if it has one.
    #[must_use]
    pub fn reflected_cube(&self) -> Option<&SceneCube> {
        self.base_color.cube().filter(|_| self.scattering != Scattering::Black)
    }

    /// The cube of what it gives off, if it has one.
    #[must_use]
    pub fn emitted_cube(&self) -> Option<&SceneCube> {
        self.emission.as_ref().and_then(|emission| emission.radiance.cube())
    }

    /// Its cubes.
    pub fn cubes(&self) -> impl Iterator<Item = &SceneCube> {
        self.reflected_cube().into_iter().chain(self.emitted_cube())
    }

    /// Tests whether it may be a smooth pane without thickness, which light passes straight
    /// (`KHR_materials_transmission` without roughness).
    #[must_use]
    pub fn is_pane(&self) -> bool {
        self.scattering.is_pane()
    }

    /// Absorption of light by the body behind its front.
    #[must_use]
    pub fn absorption(&self) -> Option<Absorption> {
        self.scattering.absorption()
    }

    /// Tests whether rays may pass the surface as if it were not there.
    #[must_use]
    pub fn has_alpha(&self) -> bool {
        self.alpha != Alpha::Opaque || self.one_sided
    }
}

/// Parts of a material, other than the base colour, that a render looks at.
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
    /// One curve everywhere.
    Curve {
        /// Its look as linear RGB: the colour where light is traced in no bands of wavelengths.
        look: Color,
        /// The curve.
        curve: SceneCurve,
    },
    /// Squares of two colours over texture coordinate set 0.
    Checker {
        /// The two colours; of curves what they look like.
        colors: [Color; 2],
        /// Their curves, if either is one.
        curves: Option<Box<[SceneCurve; 2]>>,
        /// Squares along one unit of the texture coordinates.
        squares: f64,
    },
    /// An image times a factor.
    Image {
        /// Multiplies the image.
        factor: Color,
        /// A curve of which the factor is the look, and which multiplies the image in its place in bands of wavelengths.
        curve: Option<SceneCurve>,
        /// Image, and the coordinates that it is looked up by.
        image: TextureUse,
    },
    /// A reflectance, or of light a radiance, by wavelength over texture coordinate set 0.
    Cube {
        /// The cube.
        cube: SceneCube,
        /// Copies along one unit of the texture coordinates, along u and v.
        repeat: [f64; 2],
    },
}

impl Paint {
    /// Tests whether a lookup needs texture coordinates.
    #[must_use]
    pub fn needs_uv(&self) -> bool {
        !matches!(self, Self::Plain(_) | Self::Curve { .. })
    }

    /// Tests whether it has more than the three numbers of a colour.
    #[must_use]
    pub fn has_spectrum(&self) -> bool {
        matches!(self, Self::Cube { .. }) || !self.curves().is_empty()
    }

    /// Its cube.
    #[must_use]
    pub fn cube(&self) -> Option<&SceneCube> {
        if let Self::Cube { cube, .. } = self { Some(cube) } else { None }
    }

    /// Its curves.
    #[must_use]
    pub fn curves(&self) -> &[SceneCurve] {
        match self {
            Self::Plain(_) | Self::Checker { curves: None, .. } | Self::Cube { .. } => &[],
            Self::Curve { curve, .. } => std::slice::from_ref(curve),
            Self::Checker { curves: Some(curves), .. } => &**curves,
            Self::Image { curve, .. } => curve.as_slice(),
        }
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
