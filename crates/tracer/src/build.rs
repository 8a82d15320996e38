//! From materials and lights as the scene file writes them to those that are traced: the limits of
//! their values, and which surface each is.

use std::path::PathBuf;

use etendue_geometry::glam::{DMat3, DQuat, DVec3};
use etendue_spectrum::{Illuminant, Metal, rgb};

use crate::clear_sky::SUN_DIAMETER;
use crate::goniometric::{Goniometric, Photometry};
use crate::material::{Absorption, Alpha, Glass, GltfSurface};
use crate::spec::{AbsorptionSpec, BRIGHTEST, ImageSpec, IorSpec, PaintSpec};
use crate::{
    ClearSky, Color, Emission, EnvironmentImage, Ior, Light, LightKind, LightSpec, Material,
    MaterialSpec, Paint, Projector, Scattering,
};

/// What is wrong with a value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// The key below the material or light.
    pub key: String,
    /// Why.
    pub why: String,
}

impl Fault {
    /// The key that is wrong, and the reason.
    pub fn new(key: impl Into<String>, why: impl Into<String>) -> Self {
        Self { key: key.into(), why: why.into() }
    }
}

/// What specifications name that stands elsewhere: files, and glasses of a catalogue.
pub trait Supply {
    /// An image as a paint.
    ///
    /// # Errors
    ///
    /// When there is no such file; keys are those of the image.
    fn image(&mut self, spec: &ImageSpec) -> Result<Paint, Fault>;

    /// A file by the name that the scene gives it.
    ///
    /// # Errors
    ///
    /// A sentence on why there is none.
    fn file(&mut self, written: &str) -> Result<PathBuf, String>;

    /// A refractive index.
    ///
    /// # Errors
    ///
    /// A sentence on the glass that is not known, or the number that is no index.
    fn index(&mut self, spec: &IorSpec) -> Result<Ior, String>;
}

/// What a colour may be.
#[derive(Clone, Copy, PartialEq)]
enum Bound {
    /// A reflectance.
    One,
    /// A radiance.
    None,
}

impl MaterialSpec {
    /// The surface, called `name`.
    ///
    /// # Errors
    ///
    /// On the first value that describes no surface.
    pub fn build(&self, name: &str, supply: &mut dyn Supply) -> Result<Material, Fault> {
        Ok(match self {
            Self::Matte { color } => {
                Material::new(name, paint("color", color, Bound::One, supply)?, Scattering::Matte)
            }
            Self::Mirror { color } => {
                Material::new(name, paint("color", color, Bound::One, supply)?, Scattering::Mirror)
            }
            Self::Metal { color, metal, roughness } => {
                let scattering = Scattering::Metal { roughness: *roughness, named: *metal };
                let paint = match (color, metal) {
                    (Some(color), None) => paint("color", color, Bound::One, supply)?,
                    (None, Some(metal)) => Paint::Plain(look(*metal)),
                    (None, None) => {
                        let why = "is missing: give it, or a `metal` (\"gold\", \"silver\", …)";
                        return Err(Fault::new("color", why));
                    }
                    (Some(_), Some(_)) => {
                        let why = "is given with `metal`, which has its own: leave one of them out";
                        return Err(Fault::new("color", why));
                    }
                };
                Material::new(name, paint, scattering)
            }
            Self::Dielectric { ior, color, roughness, absorption } => {
                let glass = Glass {
                    ior: supply.index(ior).map_err(|why| Fault::new("ior", why))?,
                    roughness: *roughness,
                    absorption: absorption.as_ref().map(absorbing).transpose()?,
                };
                let scattering = Scattering::Dielectric(glass);
                Material::new(name, paint("color", color, Bound::One, supply)?, scattering)
            }
            Self::Gltf { .. } => self.gltf(name, supply)?,
            Self::Emissive { radiance, illuminant, two_sided, group } => {
                let radiance = paint("radiance", radiance, Bound::None, supply)?;
                let emission = Emission {
                    radiance: radiance.clone(),
                    strength: 1.0,
                    illuminant: checked(*illuminant)?,
                    two_sided: *two_sided,
                    group: *group,
                };
                let plain = Material::new(name, radiance, Scattering::Black);
                Material { emission: Some(emission), ..plain }
            }
            Self::Checker { colors, squares } => {
                for color in colors {
                    in_bounds("colors", color, Bound::One)?;
                }
                if squares.is_nan() || *squares <= 0.0 {
                    return Err(Fault::new("squares", format!("{squares} is not above zero")));
                }
                let paint = Paint::Checker { colors: *colors, squares: *squares };
                Material::new(name, paint, Scattering::Matte)
            }
        })
    }

    /// A glTF surface, and nothing of all others.
    fn gltf(&self, name: &str, supply: &mut dyn Supply) -> Result<Material, Fault> {
        let Self::Gltf {
            color,
            metallic,
            roughness,
            ior,
            transmission,
            clearcoat,
            clearcoat_roughness,
            sheen,
            sheen_roughness,
            anisotropy,
            anisotropy_rotation,
            opacity,
        } = self
        else {
            return Ok(Material::unnamed());
        };
        // Sheen has one colour or an image, and no checker.
        let sheen = paint("sheen", sheen, Bound::One, supply)?;
        let (sheen_color, sheen_color_texture) = match sheen {
            Paint::Plain(color) => (color, None),
            Paint::Image { factor, image } => (factor, Some(image)),
            Paint::Checker { colors, .. } => (colors[0], None),
        };
        // The surface below its colour, and what shows through both.
        let surface = GltfSurface {
            metallic: *metallic,
            roughness: *roughness,
            ior: *ior,
            transmission: *transmission,
            clearcoat: *clearcoat,
            clearcoat_roughness: *clearcoat_roughness,
            sheen_color,
            sheen_color_texture,
            sheen_roughness: *sheen_roughness,
            anisotropy: *anisotropy,
            anisotropy_rotation: anisotropy_rotation.to_radians(),
            ..GltfSurface::default()
        };
        let paint = paint("color", color, Bound::One, supply)?;
        let plain = Material::new(name, paint, Scattering::Gltf(Box::new(surface)));
        let alpha = if *opacity < 1.0 { Alpha::Blend { factor: *opacity } } else { Alpha::Opaque };
        Ok(Material { alpha, ..plain })
    }
}

impl LightSpec {
    /// The light; of a sky the sun, too.
    ///
    /// # Errors
    ///
    /// On the first value that describes no light.
    pub fn build(&self, supply: &mut dyn Supply) -> Result<Vec<Light>, Fault> {
        let (key, color, illuminant) = match self {
            Self::Sky { turbidity, sun, ground_albedo, scale, up, visible, group: _ } => {
                let sky = ClearSky::new(*turbidity, sun.elevation, *ground_albedo, sun.shines);
                let sky = sky.ok_or_else(|| Fault::new("", "is no sky that the model knows"))?;
                let lights = shining(sky, sun.azimuth, *scale, (*up, *visible))?;
                let group = self.group();
                return Ok(lights.into_iter().map(|light| Light { group, ..light }).collect());
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
        in_bounds(key, color, Bound::None)?;
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
            },
            Self::Goniometric { at, file, direction, rotate, .. } => {
                let below = unit("direction", DVec3::from(*direction))?;
                let measured = goniometric(DVec3::from(*at), below, *rotate, (file, supply))?;
                LightKind::Goniometric(Box::new(measured))
            }
            Self::Projector { at, look_at, up, fov, aspect, image, .. } => {
                let at = DVec3::from(*at);
                let back = unit("look_at", at - DVec3::from(*look_at))?;
                let right = unit("up", DVec3::from(*up).cross(back))?;
                if !(*fov > 0.0 && *fov < 180.0) {
                    return Err(Fault::new("fov", format!("{fov} is not between 0 and 180")));
                }
                if let Some(aspect) = aspect.filter(|aspect| !(*aspect > 0.0 && aspect.is_finite()))
                {
                    return Err(Fault::new("aspect", format!("{aspect} is not above zero")));
                }
                LightKind::Projector(Box::new(Projector {
                    at,
                    axes: DMat3::from_cols(right, back.cross(right), back),
                    tangent: (0.5 * fov).to_radians().tan(),
                    aspect: *aspect,
                    image: paint("image", image, Bound::None, supply)?,
                }))
            }
            Self::Environment { image, rotate, up, visible, .. } => {
                let image = match image {
                    None => EnvironmentImage::Constant,
                    Some(written) => {
                        let found = supply.file(written).map_err(|why| Fault::new("image", why))?;
                        EnvironmentImage::File(found)
                    }
                };
                let turn = tilted(*up, *rotate)?;
                LightKind::Environment { image, turn, visible: *visible }
            }
        };
        Ok(vec![Light {
            kind,
            color: *color,
            illuminant: checked(*illuminant)?,
            group: self.group(),
        }])
    }
}

fn unit(key: &str, v: DVec3) -> Result<DVec3, Fault> {
    v.try_normalize().ok_or_else(|| Fault::new(key, "gives no direction"))
}

/// What brings an environment's directions into the world: its top from +Y to `up` the shortest way, after a
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
    (up, visible): ([f64; 3], bool),
) -> Result<Vec<Light>, Fault> {
    in_bounds("scale", &[scale; 3], Bound::None)?;
    if !azimuth.is_finite() {
        return Err(Fault::new("sun.azimuth", format!("{azimuth} is no angle")));
    }
    // Clockwise from above.
    let turn = tilted(up, -azimuth)?;
    let sun = Light {
        kind: LightKind::Directional {
            along: -(turn * sky.toward_sun()),
            cos_radius: (0.5 * SUN_DIAMETER).to_radians().cos(),
        },
        color: sky.sun().map(|part| part * scale),
        illuminant: None,
        group: None,
    };
    let shines = sky.is_sunlit();
    let image = EnvironmentImage::ClearSky(Box::new(sky));
    let kind = LightKind::Environment { image, turn, visible };
    let dome = Light { kind, color: [scale; 3], illuminant: None, group: None };
    Ok(if shines { vec![dome, sun] } else { vec![dome] })
}

/// A luminaire at a point (m) whose downward direction is `below` (unit), turned by `rotate` (degrees), by its
/// file.
fn goniometric(
    at: DVec3,
    below: DVec3,
    rotate: f64,
    (file, supply): (&str, &mut dyn Supply),
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

/// What a metal looks like face on: linear RGB in 0..=1.
fn look(metal: Metal) -> Color {
    rgb::colour(&metal.reflectance(1.0)).map(|part| part.clamp(0.0, 1.0))
}

fn absorbing(spec: &AbsorptionSpec) -> Result<Absorption, Fault> {
    let AbsorptionSpec { color, distance } = *spec;
    in_bounds("absorption.color", &color, Bound::One)?;
    if distance.is_nan() || distance <= 0.0 {
        let why = format!("{distance} is not above zero");
        return Err(Fault::new("absorption.distance", why));
    }
    Ok(Absorption { color, distance })
}

fn paint(
    key: &str,
    spec: &PaintSpec,
    bound: Bound,
    supply: &mut dyn Supply,
) -> Result<Paint, Fault> {
    match spec {
        PaintSpec::Color(color) => {
            in_bounds(key, color, bound)?;
            Ok(Paint::Plain(*color))
        }
        PaintSpec::Image(image) => {
            in_bounds(&format!("{key}.factor"), &image.factor, bound)?;
            let below = |fault: Fault| Fault::new(format!("{key}.{}", fault.key), fault.why);
            supply.image(image).map_err(below)
        }
    }
}

fn in_bounds(key: &str, color: &Color, bound: Bound) -> Result<(), Fault> {
    let fault = |why: String| Err(Fault::new(key, why));
    if !color.iter().all(|c| *c >= 0.0 && c.is_finite()) {
        return fault(format!("{color:?} has a part below zero"));
    }
    if !color.iter().all(|c| *c <= BRIGHTEST) {
        return fault(format!("{color:?} is above {BRIGHTEST:e}; pictures hold no more"));
    }
    if bound == Bound::One && !color.iter().all(|c| *c <= 1.0) {
        return fault(format!("{color:?} is outside 0 to 1; a surface reflects no more"));
    }
    Ok(())
}

fn checked(illuminant: Option<Illuminant>) -> Result<Option<Illuminant>, Fault> {
    let checked = illuminant.map(Illuminant::checked).transpose();
    checked.map_err(|error| Fault::new("illuminant", error.to_string()))
}
