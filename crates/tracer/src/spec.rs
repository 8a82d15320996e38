//! Materials and lights as the scene file writes them.

use etendue_spectrum::{Illuminant, Metal};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::texture::{Filter, Wrap};
use crate::{Color, LightGroup};

/// The brightest that a light or a surface may be, in whichever unit: pictures hold no number above
/// 3·10³⁸, and the powers of all lights are added up.
pub const BRIGHTEST: f64 = 1e30;

/// A material as the scene file writes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum MaterialSpec {
    /// A Lambert reflector.
    Matte {
        /// Reflectance: linear RGB, each 0..=1, or an image.
        color: PaintSpec,
    },
    /// A perfect mirror.
    Mirror {
        /// Reflectance: linear RGB, each 0..=1, or an image.
        #[serde(default)]
        color: PaintSpec,
    },
    /// A metal with GGX facets: of a colour, or of a measured metal.
    Metal {
        /// Reflectance face on: linear RGB, each 0..=1, or an image. Either this or `metal`.
        #[serde(default)]
        color: Option<PaintSpec>,
        /// The metal whose measured index decides what is reflected at which wavelength.
        #[serde(default)]
        metal: Option<Metal>,
        /// Roughness, 0 (a mirror) to 1.
        #[serde(default = "default_roughness")]
        #[schemars(range(min = 0.0, max = 1.0))]
        roughness: f64,
    },
    /// A boundary of glass, water or the like. The front of its triangles is outside.
    Dielectric {
        /// Refractive index: a number (at least 1), a glass of the catalogue, or `{"nd", "vd"}`.
        #[serde(default)]
        ior: IorSpec,
        /// Tint of what passes: linear RGB, each 0..=1.
        #[serde(default)]
        color: PaintSpec,
        /// Roughness, 0 (smooth) to 1: facets reflect and refract.
        #[serde(default)]
        #[schemars(range(min = 0.0, max = 1.0))]
        roughness: f64,
        /// What the body takes from light on its way through; nothing when absent.
        #[serde(default)]
        absorption: Option<AbsorptionSpec>,
    },
    /// glTF's metallic-roughness surface.
    Gltf {
        /// Base colour: linear RGB, each 0..=1, or an image.
        #[serde(default)]
        color: PaintSpec,
        /// Share of metal, 0 to 1.
        #[serde(default)]
        #[schemars(range(min = 0.0, max = 1.0))]
        metallic: f64,
        /// Roughness, 0 to 1.
        #[serde(default = "default_gltf_roughness")]
        #[schemars(range(min = 0.0, max = 1.0))]
        roughness: f64,
        /// Refractive index of the coat, at least 1.
        #[serde(default = "default_ior")]
        #[schemars(range(min = 1.0))]
        ior: f64,
        /// Share of the base that lets light through a thin wall, 0 to 1.
        #[serde(default)]
        #[schemars(range(min = 0.0, max = 1.0))]
        transmission: f64,
        /// Share of the surface under a clear coat, 0 to 1.
        #[serde(default)]
        #[schemars(range(min = 0.0, max = 1.0))]
        clearcoat: f64,
        /// Roughness of the clear coat, 0 to 1.
        #[serde(default)]
        #[schemars(range(min = 0.0, max = 1.0))]
        clearcoat_roughness: f64,
        /// Reflectance of a sheen of fibres over all of it but the coat: linear RGB, each 0..=1, or an image.
        #[serde(default = "no_sheen")]
        sheen: PaintSpec,
        /// Roughness of the sheen, 0 to 1.
        #[serde(default = "default_gltf_roughness")]
        #[schemars(range(min = 0.0, max = 1.0))]
        sheen_roughness: f64,
        /// How much rougher highlights are along the surface's grain than across it, 0 to 1.
        #[serde(default)]
        #[schemars(range(min = 0.0, max = 1.0))]
        anisotropy: f64,
        /// Where the grain goes: degrees from growing u of the texture coordinates, counter-clockwise as the
        /// image is seen.
        #[serde(default)]
        anisotropy_rotation: f64,
        /// Share of the surface that is there, 0 to 1.
        #[serde(default = "one")]
        #[schemars(range(min = 0.0, max = 1.0))]
        opacity: f64,
    },
    /// A surface that shines and reflects nothing.
    Emissive {
        /// Radiance: linear RGB (not below zero), or an image.
        radiance: PaintSpec,
        /// The spectrum that the radiance multiplies; equal energy when absent.
        #[serde(default)]
        illuminant: Option<Illuminant>,
        /// The back shines too.
        #[serde(default)]
        two_sided: bool,
        /// The group that the layer request `light_groups` shows it with.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        group: Option<LightGroup>,
    },
    /// Matte squares of two colours over the surface's texture coordinates.
    Checker {
        /// The two reflectances, linear RGB.
        #[serde(default = "default_checker_colors")]
        colors: [Color; 2],
        /// Squares along one unit of the texture coordinates (> 0).
        #[serde(default = "default_checker_squares")]
        squares: f64,
    },
}

fn default_checker_colors() -> [Color; 2] {
    [[0.8; 3], [0.2; 3]]
}

fn default_checker_squares() -> f64 {
    8.0
}

fn default_roughness() -> f64 {
    0.2
}

fn default_gltf_roughness() -> f64 {
    0.5
}

fn default_ior() -> f64 {
    1.5
}

fn no_sheen() -> PaintSpec {
    PaintSpec::Color([0.0; 3])
}

fn one() -> f64 {
    1.0
}

fn white() -> Color {
    [1.0; 3]
}

/// A colour, or an image of colours.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum PaintSpec {
    /// Linear RGB.
    Color(Color),
    /// An image over the surface's texture coordinates.
    Image(ImageSpec),
}

impl Default for PaintSpec {
    fn default() -> Self {
        Self::Color([1.0; 3])
    }
}

/// An image file over the surface's texture coordinates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImageSpec {
    /// A PNG, JPEG, Radiance or EXR file, relative to the scene file.
    pub image: String,
    /// Multiplies the image: linear RGB.
    #[serde(default = "white")]
    pub factor: Color,
    /// What the file's numbers are: colours by the sRGB curve, or plain.
    #[serde(default)]
    pub encoding: crate::texture::Encoding,
    /// What happens outside of 0..=1, along both axes.
    #[serde(default)]
    pub wrap: Wrap,
    /// How texels are read.
    #[serde(default)]
    pub filter: Filter,
    /// Copies of the image along one unit of the texture coordinates, along u and v.
    #[serde(default = "unit_scale")]
    pub repeat: [f64; 2],
}

fn unit_scale() -> [f64; 2] {
    [1.0; 2]
}

/// A refractive index as the scene file writes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum IorSpec {
    /// The same for all wavelengths, at least 1.
    Constant(f64),
    /// A glass of the catalogue.
    Glass(String),
    /// By the index and Abbe number of the helium d line.
    Abbe(AbbeSpec),
}

/// Index and dispersion of a glass.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AbbeSpec {
    /// Index at 587.56 nm, at least 1.
    pub nd: f64,
    /// Abbe number (> 0).
    pub vd: f64,
}

impl Default for IorSpec {
    fn default() -> Self {
        Self::Constant(1.5)
    }
}

/// Absorption of a body, by Beer and Lambert.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AbsorptionSpec {
    /// What is left of light after `distance`: linear RGB, each 0..=1.
    pub color: Color,
    /// m (> 0).
    pub distance: f64,
}

/// A light as the scene file writes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum LightSpec {
    /// A point that shines alike in all directions.
    Point {
        /// Where it is (m).
        at: [f64; 3],
        /// Radiant intensity, linear RGB: at 1 m it gives this irradiance.
        intensity: Color,
        /// The spectrum that the intensity multiplies; equal energy when absent.
        #[serde(default)]
        illuminant: Option<Illuminant>,
        /// The group that the layer request `light_groups` shows it with.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        group: Option<LightGroup>,
    },
    /// A point that shines into a cone.
    Spot {
        /// Where it is (m).
        at: [f64; 3],
        /// A point that it is aimed at (m).
        look_at: [f64; 3],
        /// Radiant intensity within the inner cone, linear RGB.
        intensity: Color,
        /// Half-angle of the cone (degrees, at most 90).
        #[serde(default = "default_cone")]
        #[schemars(range(min = 0.0, max = 90.0))]
        cone: f64,
        /// Half-angle within which the light is at its full (degrees); from there it falls to 0.
        #[serde(default)]
        #[schemars(range(min = 0.0, max = 90.0))]
        inner_cone: f64,
        /// The spectrum that the intensity multiplies; equal energy when absent.
        #[serde(default)]
        illuminant: Option<Illuminant>,
        /// The group that the layer request `light_groups` shows it with.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        group: Option<LightGroup>,
    },
    /// Parallel light, as from the sun.
    Directional {
        /// Where the light goes.
        direction: [f64; 3],
        /// Irradiance on a surface that faces it, linear RGB.
        irradiance: Color,
        /// Diameter of the disk that it comes from, as seen from the scene (degrees; the sun's is 0.53).
        /// Shadows have soft edges by it; no ray of the camera meets the disk.
        #[serde(default)]
        #[schemars(range(min = 0.0, max = 90.0))]
        angle: f64,
        /// The spectrum that the irradiance multiplies; equal energy when absent.
        #[serde(default)]
        illuminant: Option<Illuminant>,
        /// The group that the layer request `light_groups` shows it with.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        group: Option<LightGroup>,
    },
    /// A point that shines by a measured distribution.
    Goniometric {
        /// Where it is (m).
        at: [f64; 3],
        /// An IES file (LM-63, type C), relative to the scene file.
        file: String,
        /// Where the luminaire's downward direction points: the plane of the horizontal angle 0 is turned from
        /// +X the shortest way.
        #[serde(default = "downwards")]
        direction: [f64; 3],
        /// Turns it about that direction (degrees, counter-clockwise from above).
        #[serde(default)]
        rotate: f64,
        /// Multiplies the file's candela: linear RGB.
        #[serde(default = "white")]
        intensity: Color,
        /// The spectrum that the intensity multiplies; equal energy when absent.
        #[serde(default)]
        illuminant: Option<Illuminant>,
        /// The group that the layer request `light_groups` shows it with.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        group: Option<LightGroup>,
    },
    /// A point that throws an image, as for structured light.
    Projector {
        /// Where it is (m).
        at: [f64; 3],
        /// A point that it is aimed at (m).
        look_at: [f64; 3],
        /// What is up in the image.
        #[serde(default = "upwards")]
        up: [f64; 3],
        /// Angle across the image (degrees).
        #[serde(default = "default_throw")]
        #[schemars(range(min = 0.0, max = 179.0))]
        fov: f64,
        /// Width over height; that of the image when absent, of a plain colour 1.
        #[serde(default)]
        aspect: Option<f64>,
        /// What is thrown: an image, or a colour. It is seen as from the projector.
        #[serde(default)]
        image: PaintSpec,
        /// Radiant intensity along the axis where the image is white, linear RGB: on a screen that faces it at
        /// 1 m the image has this irradiance all over.
        intensity: Color,
        /// The spectrum that the intensity multiplies; equal energy when absent.
        #[serde(default)]
        illuminant: Option<Illuminant>,
        /// The group that the layer request `light_groups` shows it with.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        group: Option<LightGroup>,
    },
    /// Light from all around.
    Environment {
        /// Radiance, linear RGB; multiplies the image.
        #[serde(default = "white")]
        radiance: Color,
        /// A latitude-longitude image (HDR, EXR, PNG or JPEG), relative to the scene file. Its middle
        /// is at −Z, its top at +Y.
        #[serde(default)]
        image: Option<String>,
        /// Turns the image about its top (degrees, counter-clockwise from above).
        #[serde(default)]
        rotate: f64,
        /// Where the image's top is: the image is tilted the shortest way from +Y.
        #[serde(default = "upwards")]
        up: [f64; 3],
        /// The camera sees it where nothing is in the way; if not, it lights, and is seen in mirrors and
        /// through glass.
        #[serde(default = "yes")]
        visible: bool,
        /// The spectrum that the radiance multiplies; equal energy when absent.
        #[serde(default)]
        illuminant: Option<Illuminant>,
        /// The group that the layer request `light_groups` shows it with.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        group: Option<LightGroup>,
    },
    /// A clear sky with its sun, and the ground below the horizon. It is the scene's environment.
    Sky {
        /// How hazy the air is: 1 (none but air) to 10.
        #[serde(default = "default_turbidity")]
        #[schemars(range(min = 1.0, max = 10.0))]
        turbidity: f64,
        /// The sun.
        #[serde(default)]
        sun: SunSpec,
        /// Reflectance of the ground, 0 to 1.
        #[serde(default = "default_ground")]
        #[schemars(range(min = 0.0, max = 1.0))]
        ground_albedo: f64,
        /// Multiplies all of it: at 1, radiance 1 is 1 W/(m² sr nm).
        #[serde(default = "one")]
        #[schemars(range(min = 0.0))]
        scale: f64,
        /// Where the zenith is: the sky is tilted the shortest way from +Y.
        #[serde(default = "upwards")]
        up: [f64; 3],
        /// The camera sees it where nothing is in the way.
        #[serde(default = "yes")]
        visible: bool,
        /// The group that the layer request `light_groups` shows it with.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        group: Option<LightGroup>,
    },
}

/// Where the sun of a sky stands.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SunSpec {
    /// Degrees above the horizon, 0 to 90.
    #[schemars(range(min = 0.0, max = 90.0))]
    pub elevation: f64,
    /// Degrees from −Z, clockwise from above: at 90 it stands over +X.
    pub azimuth: f64,
    /// The sun itself shines; if not, its sky alone does, as when a cloud hides it.
    pub shines: bool,
}

impl Default for SunSpec {
    fn default() -> Self {
        Self { elevation: 45.0, azimuth: 0.0, shines: true }
    }
}

fn default_turbidity() -> f64 {
    3.0
}

fn default_ground() -> f64 {
    0.2
}

impl LightSpec {
    /// The group that it is of, if it names one.
    #[must_use]
    pub fn group(&self) -> Option<LightGroup> {
        match self {
            Self::Point { group, .. }
            | Self::Spot { group, .. }
            | Self::Directional { group, .. }
            | Self::Goniometric { group, .. }
            | Self::Projector { group, .. }
            | Self::Environment { group, .. }
            | Self::Sky { group, .. } => *group,
        }
    }
}

impl MaterialSpec {
    /// The group of lights that it is of, if it shines and names one.
    #[must_use]
    pub fn group(&self) -> Option<LightGroup> {
        match self {
            Self::Emissive { group, .. } => *group,
            Self::Matte { .. }
            | Self::Mirror { .. }
            | Self::Metal { .. }
            | Self::Dielectric { .. }
            | Self::Gltf { .. }
            | Self::Checker { .. } => None,
        }
    }
}

fn upwards() -> [f64; 3] {
    [0.0, 1.0, 0.0]
}

fn downwards() -> [f64; 3] {
    [0.0, -1.0, 0.0]
}

fn yes() -> bool {
    true
}

fn default_throw() -> f64 {
    40.0
}

fn default_cone() -> f64 {
    30.0
}
