//! Lights that are traced, of those that a scene file writes: the limits of their values, and which light each is.

use std::sync::Arc;

use etendue_geometry::glam::{DMat3, DQuat, DVec3};
use etendue_spectrum::Curve;

use super::{LightSpec, SkyCubeSpec, SkyImageSpec};
use crate::clear_sky::SUN_DIAMETER;
use crate::goniometric::{Goniometric, Photometry};
use crate::spec::color::{Bound, LightSpectrum, emitted, in_bounds, luminous, share_of};
use crate::spec::light_motion::LightMotionSpec;
use crate::spec::modulation::ModulationSpec;
use crate::spec::paint::{PaintSpec, radiant_paint};
use crate::spec::supply::{ColorSpec, CubeSpec, Fault, Supply, unit_scale};
use crate::{
    ClearSky, Color, CubeKind, EnvironmentImage, Light, LightGroup, LightKind, Paint, Projector,
};

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
