//! Lights as the scene file writes them.

mod build;

use etendue_spectrum::{Grid, Illuminant};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::light_motion::LightMotionSpec;
use super::modulation::ModulationSpec;
use super::paint::PaintSpec;
use super::supply::{ColorSpec, one, white};
use crate::LightGroup;

/// A light as the scene file writes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum LightSpec {
    /// A point that shines alike in all directions.
    Point {
        /// Its position (m).
        at: [f64; 3],
        /// Radiant intensity, linear RGB: at 1 m it gives this irradiance.
        intensity: ColorSpec,
        /// Luminous flux (lm): brings the intensity to it, which then says the spectrum alone.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(range(min = 0.0))]
        lumens: Option<f64>,
        /// The spectrum that the intensity multiplies; equal energy when absent.
        #[serde(default)]
        illuminant: Option<Illuminant>,
        /// The group that the layer request `light_groups` shows it with.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        group: Option<LightGroup>,
        /// Change of its strength with time; none when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        modulation: Option<ModulationSpec>,
        /// Its motion while the shutter is open; it stands still when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        motion: Option<LightMotionSpec>,
    },
    /// A point that shines into a cone.
    Spot {
        /// Its position (m).
        at: [f64; 3],
        /// A point that it is aimed at (m).
        look_at: [f64; 3],
        /// Radiant intensity within the inner cone, linear RGB.
        intensity: ColorSpec,
        /// Luminous flux (lm): brings the intensity to it, which then says the spectrum alone.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(range(min = 0.0))]
        lumens: Option<f64>,
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
        /// Change of its strength with time; none when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        modulation: Option<ModulationSpec>,
        /// Its motion while the shutter is open; it stands still when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        motion: Option<LightMotionSpec>,
    },
    /// Parallel light, as from the sun.
    Directional {
        /// Direction in which the light goes.
        direction: [f64; 3],
        /// Irradiance on a surface that faces it, linear RGB.
        irradiance: ColorSpec,
        /// Illuminance on a surface that faces it (lx): brings the irradiance to it, which then says the spectrum alone.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(range(min = 0.0))]
        lux: Option<f64>,
        /// Diameter of the disk that it comes from, as seen from the scene (degrees; the sun's is 0.53).
        /// Shadows have soft edges by it; mirrors and smooth glass show the disk, the camera itself does not see it.
        #[serde(default)]
        #[schemars(range(min = 0.0, max = 90.0))]
        angle: f64,
        /// The spectrum that the irradiance multiplies; equal energy when absent.
        #[serde(default)]
        illuminant: Option<Illuminant>,
        /// The group that the layer request `light_groups` shows it with.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        group: Option<LightGroup>,
        /// Change of its strength with time; none when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        modulation: Option<ModulationSpec>,
    },
    /// A point that shines by a measured distribution.
    Goniometric {
        /// Its position (m).
        at: [f64; 3],
        /// An IES file (LM-63, type C), relative to the scene file.
        file: String,
        /// Direction that the luminaire's downward direction points in: the plane of the horizontal angle 0 is turned from
        /// +X the shortest way.
        #[serde(default = "downwards")]
        direction: [f64; 3],
        /// Turns it about that direction (degrees, counter-clockwise from above).
        #[serde(default)]
        rotate: f64,
        /// Multiplies the file's candela: linear RGB.
        #[serde(default = "white")]
        intensity: ColorSpec,
        /// Luminous flux (lm): brings the intensity to it, which then says the spectrum alone.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(range(min = 0.0))]
        lumens: Option<f64>,
        /// The spectrum that the intensity multiplies; equal energy when absent.
        #[serde(default)]
        illuminant: Option<Illuminant>,
        /// The group that the layer request `light_groups` shows it with.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        group: Option<LightGroup>,
        /// Change of its strength with time; none when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        modulation: Option<ModulationSpec>,
        /// Its motion while the shutter is open; it stands still when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        motion: Option<LightMotionSpec>,
    },
    /// A point that throws an image, as for structured light.
    Projector {
        /// Its position (m).
        at: [f64; 3],
        /// A point that it is aimed at (m).
        look_at: [f64; 3],
        /// Direction that is up in the image.
        #[serde(default = "upwards")]
        up: [f64; 3],
        /// Angle across the image (degrees).
        #[serde(default = "default_throw")]
        #[schemars(range(min = 0.0, max = 179.0))]
        fov: f64,
        /// Width over height; that of the image when absent, of a plain colour 1.
        #[serde(default)]
        aspect: Option<f64>,
        /// The image that is thrown, or a colour. It is seen as from the projector.
        #[serde(default)]
        image: PaintSpec,
        /// Radiant intensity along the axis where the image is white, linear RGB: on a screen that faces it at
        /// 1 m the image has this irradiance all over.
        intensity: ColorSpec,
        /// The spectrum that the intensity multiplies; equal energy when absent.
        #[serde(default)]
        illuminant: Option<Illuminant>,
        /// The group that the layer request `light_groups` shows it with.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        group: Option<LightGroup>,
        /// Change of its strength with time; none when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        modulation: Option<ModulationSpec>,
        /// Its motion while the shutter is open; it stands still when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        motion: Option<LightMotionSpec>,
    },
    /// Light from all around.
    Environment {
        /// Radiance, linear RGB; multiplies the image.
        #[serde(default = "white")]
        radiance: ColorSpec,
        /// A latitude-longitude image (HDR, EXR, PNG or JPEG), relative to the scene file, or a cube. Its middle
        /// is at −Z, its top at +Y.
        #[serde(default)]
        image: Option<SkyImageSpec>,
        /// Turns the image about its top (degrees, counter-clockwise from above).
        #[serde(default)]
        rotate: f64,
        /// Direction of the image's top: the image is tilted the shortest way from +Y.
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
        /// Change of its strength with time; none when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        modulation: Option<ModulationSpec>,
    },
    /// A clear sky with its sun, and the ground below the horizon. It is the scene's environment.
    Sky {
        /// Turbidity, the haze of the air: 1 (none but air) to 10.
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
        /// Direction of the zenith: the sky is tilted the shortest way from +Y.
        #[serde(default = "upwards")]
        up: [f64; 3],
        /// The camera sees it where nothing is in the way.
        #[serde(default = "yes")]
        visible: bool,
        /// The group that the layer request `light_groups` shows it with.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        group: Option<LightGroup>,
        /// Change of its strength with time; none when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        modulation: Option<ModulationSpec>,
    },
}

/// A latitude-longitude image of light from all around.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum SkyImageSpec {
    /// A file of colours: HDR, EXR, PNG or JPEG, relative to the scene file.
    Colors(String),
    /// A file of light by wavelength.
    Cube(SkyCubeSpec),
}

/// A file of light by wavelength, of 0 or more, from all around: dark beyond the outer edges of its bands.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SkyCubeSpec {
    /// The file, relative to the scene file: NPY, `[row][column][band]`; ENVI, by its header or its numbers; or EXR
    /// with channels `S0.550,0nm` (Fichet et al. 2021).
    pub cube: String,
    /// The wavelengths of the bands (nm) of an NPY file; the others say their own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bands: Option<Grid>,
}

/// Position of the sun of a sky.
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
