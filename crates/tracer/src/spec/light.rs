//! Lights as the scene file writes them, and those that are traced.

use std::sync::Arc;

use etendue_geometry::glam::{DMat3, DQuat, DVec3};
use etendue_spectrum::{Curve, Grid, Illuminant};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::light_motion::LightMotionSpec;
use super::{
    Bound, ColorSpec, CubeSpec, Fault, LightSpectrum, PaintSpec, Supply, emitted, in_bounds,
    luminous, one, radiant_paint, share_of, unit_scale, white,
};
use crate::clear_sky::SUN_DIAMETER;
use crate::goniometric::{Goniometric, Photometry};
use crate::{
    ClearSky, Color, CubeKind, EnvironmentImage, Light, LightGroup, LightKind, ModulationSpec,
    Paint, Projector,
};

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

impl LightSpec {
    /// The light; of a sky the sun, too.
    ///
    /// # Errors
    ///
    /// On the first value that describes no light.
    pub fn build(&self, supply: &mut dyn Supply) -> Result<Vec<Light>, Fault> {
        let modulation = match self.modulation() {
            Some(modulation) => Some(Arc::new(modulation.build()?)),
            None => None,
        };
        let group = self.group();
        let lights = self.shining(supply)?.into_iter();
        Ok(lights.map(|light| Light { group, modulation: modulation.clone(), ..light }).collect())
    }

    /// The light, of no group and as strong all the time.
    fn shining(&self, supply: &mut dyn Supply) -> Result<Vec<Light>, Fault> {
        let (key, color, illuminant) = match self {
            Self::Sky { turbidity, sun, ground_albedo, scale, up, visible, .. } => {
                let sky = ClearSky::new(*turbidity, sun.elevation, *ground_albedo, sun.shines);
                let sky = sky.ok_or_else(|| Fault::new("", "is no sky that the model knows"))?;
                return shining(sky, sun.azimuth, *scale, *up, *visible);
            }
            Self::Point { intensity, illuminant, .. }
            | Self::Spot { intensity, illuminant, .. }
            | Self::Goniometric { intensity, illuminant, .. }
            | Self::Projector { intensity, illuminant, .. } => ("intensity", intensity, illuminant),
            Self::Directional { irradiance, illuminant, .. } => {
                ("irradiance", irradiance, illuminant)
            }
            Self::Environment { radiance, illuminant, .. } => ("radiance", radiance, illuminant),
        };
        let LightSpectrum { color, curve } = emitted(key, color, *illuminant, supply)?;
        let kind = match self {
            Self::Sky { .. } => return Ok(Vec::new()),
            Self::Point { at, .. } => LightKind::Point(DVec3::from(*at)),
            Self::Spot { at, look_at, cone, inner_cone, .. } => {
                let at = DVec3::from(*at);
                if inner_cone > cone {
                    let why = format!("{inner_cone} is wider than `cone`, {cone}");
                    return Err(Fault::new("inner_cone", why));
                }
                LightKind::Spot {
                    at,
                    axis: unit("look_at", DVec3::from(*look_at) - at)?,
                    cos_outer: cone.to_radians().cos(),
                    cos_inner: inner_cone.to_radians().cos(),
                }
            }
            Self::Directional { direction, angle, .. } => LightKind::Directional {
                along: unit("direction", DVec3::from(*direction))?,
                cos_radius: (0.5 * angle).to_radians().cos(),
                visible: false,
            },
            Self::Goniometric { at, file, direction, rotate, .. } => {
                let below = unit("direction", DVec3::from(*direction))?;
                let measured = goniometric(DVec3::from(*at), below, *rotate, file, supply)?;
                LightKind::Goniometric(Box::new(measured))
            }
            Self::Projector { at, look_at, up, fov, aspect, image, .. } => {
                let ends = [*at, *look_at].map(DVec3::from);
                if matches!(image, PaintSpec::Cube(_)) {
                    let why = "is a cube, which a projector does not throw: it throws images and checkers, and their \
                               spectrum is that of its `intensity`";
                    return Err(Fault::new("image", why));
                }
                let (image, spectrum) = radiant_paint("image", image, None, supply)?;
                if spectrum.is_some() || !image.curves().is_empty() {
                    let why = "has a curve; a projector's spectrum is that of its `intensity`";
                    return Err(Fault::new("image", why));
                }
                let up = DVec3::from(*up);
                LightKind::Projector(Box::new(projector(ends, up, *fov, *aspect, image)?))
            }
            Self::Environment { image, rotate, up, visible, radiance, .. } => {
                let stray = match (radiance, &curve) {
                    (ColorSpec::Curve(_), _) => Some("radiance"),
                    (ColorSpec::Rgb(_), Some(_)) => Some("illuminant"),
                    (ColorSpec::Rgb(_), None) => None,
                };
                let image = sky_image(image.as_ref(), stray, supply)?;
                let turn = tilted(*up, *rotate)?;
                LightKind::Environment { image, turn, visible: *visible }
            }
        };
        let color = self.brought_to_flux(color, &kind, curve.as_deref())?;
        Ok(vec![Light { illuminant: curve, ..Light::steady(kind, color) }])
    }

    /// Change of its strength with time, if it changes.
    #[must_use]
    pub fn modulation(&self) -> Option<&ModulationSpec> {
        match self {
            Self::Point { modulation, .. }
            | Self::Spot { modulation, .. }
            | Self::Directional { modulation, .. }
            | Self::Goniometric { modulation, .. }
            | Self::Projector { modulation, .. }
            | Self::Environment { modulation, .. }
            | Self::Sky { modulation, .. } => modulation.as_ref(),
        }
    }

    /// Its motion, and the position that is written (m), if it moves.
    #[must_use]
    pub fn motion(&self) -> Option<(&LightMotionSpec, DVec3)> {
        match self {
            Self::Point { motion, at, .. }
            | Self::Spot { motion, at, .. }
            | Self::Goniometric { motion, at, .. }
            | Self::Projector { motion, at, .. } => Some((motion.as_ref()?, DVec3::from(*at))),
            Self::Directional { .. } | Self::Environment { .. } | Self::Sky { .. } => None,
        }
    }

    /// The colour of a light of this kind and curve with the luminous flux or the illuminance that it is to have.
    fn brought_to_flux(
        &self,
        color: Color,
        kind: &LightKind,
        curve: Option<&Curve>,
    ) -> Result<Color, Fault> {
        // Of a flux the intensity is spread over directions; an illuminance is that of the irradiance itself.
        let (key, wanted, spread) = match (self.lumens(), self) {
            (Some(lumens), _) => ("lumens", lumens, kind.spread().unwrap_or(0.0)),
            (None, Self::Directional { lux: Some(lux), .. }) => ("lux", *lux, 1.0),
            (None, _) => return Ok(color),
        };
        let own = luminous(&color, curve) * spread;
        let scale = share_of(key, wanted, own)?;
        let scaled = color.map(|part| part * scale);
        in_bounds(key, &scaled, Bound::None)?;
        Ok(scaled)
    }

    /// The luminous flux that it is to have (lm), if it says so.
    fn lumens(&self) -> Option<f64> {
        match self {
            Self::Point { lumens, .. }
            | Self::Spot { lumens, .. }
            | Self::Goniometric { lumens, .. } => *lumens,
            Self::Directional { .. }
            | Self::Projector { .. }
            | Self::Environment { .. }
            | Self::Sky { .. } => None,
        }
    }

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

/// The image of an environment; a cube goes with no spectrum of the key `stray`.
fn sky_image(
    image: Option<&SkyImageSpec>,
    stray: Option<&str>,
    supply: &mut dyn Supply,
) -> Result<EnvironmentImage, Fault> {
    let SkyCubeSpec { cube, bands } = match image {
        None => return Ok(EnvironmentImage::Constant),
        Some(SkyImageSpec::Colors(written)) => {
            let found = supply.file(written).map_err(|why| Fault::new("image", why))?;
            return Ok(EnvironmentImage::File(found));
        }
        Some(SkyImageSpec::Cube(spec)) => spec.clone(),
    };
    if let Some(key) = stray {
        let why = "is a spectrum beside a cube of `image`, which has spectra of its own: leave one of them out";
        return Err(Fault::new(key, why));
    }
    let (wrap, filter) = Default::default();
    let spec = CubeSpec { cube, bands, wrap, filter, repeat: unit_scale() };
    let below = |fault: Fault| Fault::new(format!("image.{}", fault.key), fault.why);
    Ok(EnvironmentImage::Cube(Arc::new(supply.cube(&spec, CubeKind::Light).map_err(below)?)))
}

fn unit(key: &str, v: DVec3) -> Result<DVec3, Fault> {
    v.try_normalize().ok_or_else(|| Fault::new(key, "gives no direction"))
}

/// The turn that brings an environment's directions into the world: its top from +Y to `up` the shortest way, after a
/// turn by `rotate` (degrees, counter-clockwise from above).
fn tilted(up: [f64; 3], rotate: f64) -> Result<DMat3, Fault> {
    let tilt = DQuat::from_rotation_arc(DVec3::Y, unit("up", DVec3::from(up))?);
    Ok(DMat3::from_quat(tilt) * DMat3::from_rotation_y(rotate.to_radians()))
}

/// A sky as an environment, and its sun as parallel light from a disk.
fn shining(
    sky: ClearSky,
    azimuth: f64,
    scale: f64,
    up: [f64; 3],
    visible: bool,
) -> Result<Vec<Light>, Fault> {
    in_bounds("scale", &[scale; 3], Bound::None)?;
    if !azimuth.is_finite() {
        return Err(Fault::new("sun.azimuth", format!("{azimuth} is no angle")));
    }
    // Clockwise from above.
    let turn = tilted(up, -azimuth)?;
    let disk = LightKind::Directional {
        along: -(turn * sky.toward_sun()),
        cos_radius: (0.5 * SUN_DIAMETER).to_radians().cos(),
        visible,
    };
    let sun = Light {
        spectrum: sky.sun_spectrum().scaled(scale).ok().map(Arc::new),
        ..Light::steady(disk, sky.sun().map(|part| part * scale))
    };
    let shines = sky.is_sunlit();
    let image = EnvironmentImage::ClearSky(Box::new(sky));
    let kind = LightKind::Environment { image, turn, visible };
    let color = [scale; 3];
    let dome = Light::steady(kind, color);
    Ok(if shines { vec![dome, sun] } else { vec![dome] })
}

/// A projector at the first point (m) that is aimed at the second, of an angle across (degrees), a width over
/// height, and what it throws.
fn projector(
    [at, look_at]: [DVec3; 2],
    up: DVec3,
    fov: f64,
    aspect: Option<f64>,
    image: Paint,
) -> Result<Projector, Fault> {
    let back = unit("look_at", at - look_at)?;
    let right = up.cross(back).try_normalize().ok_or_else(|| {
        let why = "has no length or lies along the view from `at` to `look_at`; choose another, such as \
                   [0, 0, -1]";
        Fault::new("up", why)
    })?;
    if !(fov > 0.0 && fov < 180.0) {
        return Err(Fault::new("fov", format!("{fov} is not between 0 and 180")));
    }
    if let Some(aspect) = aspect.filter(|aspect| !(*aspect > 0.0 && aspect.is_finite())) {
        return Err(Fault::new("aspect", format!("{aspect} is not above zero")));
    }
    let axes = DMat3::from_cols(right, back.cross(right), back);
    Ok(Projector { at, axes, tangent: (0.5 * fov).to_radians().tan(), aspect, image })
}

/// A luminaire at a point (m) whose downward direction is `below` (unit), turned by `rotate` (degrees), by its
/// file.
fn goniometric(
    at: DVec3,
    below: DVec3,
    rotate: f64,
    file: &str,
    supply: &mut dyn Supply,
) -> Result<Goniometric, Fault> {
    let tilt = DMat3::from_quat(DQuat::from_rotation_arc(DVec3::NEG_Y, below));
    let turn = tilt * DMat3::from_rotation_y(rotate.to_radians());
    let path = supply.file(file).map_err(|why| Fault::new("file", why))?;
    let photometry =
        Photometry::read(&path).map_err(|why| Fault::new("file", format!("\"{file}\" {why}")))?;
    // A quarter turn from +X, counter-clockwise from above, is −Z.
    let axes = DMat3::from_cols(turn.x_axis, -turn.z_axis, turn.y_axis);
    Ok(Goniometric { at, axes, file: path, photometry })
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
