//! The scene file's own materials and lights, checked and ready for the tracers.

use etendue_geometry::glam::DVec3;
use etendue_optics::glass::GlassSpec;
use etendue_spectrum::{Curve, Illuminant};
use etendue_tracer::material::{Alpha, GltfSurface};
use etendue_tracer::spec::{BRIGHTEST, ImageSpec, IorSpec, PaintSpec};
use etendue_tracer::{
    Color, Emission, EnvironmentImage, ImageSource, Ior, Light, LightKind, LightSpec, Material,
    MaterialSpec, Paint, Scattering, Texture, TextureUse,
};
use serde_json::Value;

use crate::SceneError;
use crate::file::{SceneFile, join, join_index};
use crate::import::Wanted;
use crate::paths::Folder;
use crate::words::plain;

/// The scene's own materials in the order of their names, and the images that they name.
#[derive(Debug, Default)]
pub(crate) struct OwnMaterials {
    pub(crate) materials: Vec<Material>,
    pub(crate) textures: Vec<Texture>,
}

/// What is wrong with a value: its key below the material or light, and the reason.
type Fault = (String, String);

/// What a colour may be.
#[derive(Clone, Copy, PartialEq)]
enum Bound {
    /// A reflectance.
    One,
    /// A radiance.
    None,
}

impl SceneFile {
    pub(crate) fn named_materials(
        &self,
        folder: &Folder,
        wanted: Wanted,
    ) -> Result<OwnMaterials, SceneError> {
        let mut own = OwnMaterials::default();
        for (name, spec) in &self.spec.materials {
            let mut builder = Builder { folder, wanted, textures: &mut own.textures };
            let material = builder
                .material(name, spec)
                .map_err(|(key, why)| self.fault(&below(&join("materials", name), &key), why))?;
            own.materials.push(material);
        }
        Ok(own)
    }

    /// The scene's own lights; `None` when it does not speak of any.
    pub(crate) fn named_lights(&self, folder: &Folder) -> Result<Option<Vec<Light>>, SceneError> {
        let Some(specs) = &self.spec.lights else { return Ok(None) };
        let mut lights: Vec<Light> = Vec::new();
        for (index, spec) in specs.iter().enumerate() {
            let at = join_index("lights", index);
            let light =
                light(folder, spec).map_err(|(key, why)| self.fault(&below(&at, &key), why))?;
            let is_sky = |l: &Light| matches!(l.kind, LightKind::Environment { .. });
            if is_sky(&light) && lights.iter().any(is_sky) {
                return Err(self.fault(&at, "a second environment; a scene has one at most"));
            }
            lights.push(light);
        }
        Ok(Some(lights))
    }
}

/// The path `key`, which may be of several parts or none, below `at`.
fn below(at: &str, key: &str) -> String {
    if key.is_empty() { at.to_owned() } else { format!("{at}.{key}") }
}

struct Builder<'a> {
    folder: &'a Folder,
    wanted: Wanted,
    textures: &'a mut Vec<Texture>,
}

impl Builder<'_> {
    fn material(&mut self, name: &str, spec: &MaterialSpec) -> Result<Material, Fault> {
        Ok(match spec {
            MaterialSpec::Matte { color } => {
                Material::new(name, self.paint("color", color, Bound::One)?, Scattering::Matte)
            }
            MaterialSpec::Mirror { color } => {
                Material::new(name, self.paint("color", color, Bound::One)?, Scattering::Mirror)
            }
            MaterialSpec::Metal { color, roughness } => {
                let scattering = Scattering::Metal { roughness: *roughness };
                Material::new(name, self.paint("color", color, Bound::One)?, scattering)
            }
            MaterialSpec::Dielectric { ior, color } => {
                let scattering = Scattering::Dielectric(refractive_index(ior)?);
                Material::new(name, self.paint("color", color, Bound::One)?, scattering)
            }
            MaterialSpec::Gltf { color, metallic, roughness, ior, transmission, opacity } => {
                let surface = GltfSurface {
                    metallic: *metallic,
                    roughness: *roughness,
                    ior: *ior,
                    transmission: *transmission,
                    ..GltfSurface::default()
                };
                let paint = self.paint("color", color, Bound::One)?;
                let plain = Material::new(name, paint, Scattering::Gltf(Box::new(surface)));
                let alpha =
                    if *opacity < 1.0 { Alpha::Blend { factor: *opacity } } else { Alpha::Opaque };
                Material { alpha, ..plain }
            }
            MaterialSpec::Emissive { radiance, illuminant, two_sided } => {
                let radiance = self.paint("radiance", radiance, Bound::None)?;
                let emission = Emission {
                    radiance: radiance.clone(),
                    strength: 1.0,
                    illuminant: checked(*illuminant)?,
                    two_sided: *two_sided,
                };
                let plain = Material::new(name, radiance, Scattering::Black);
                Material { emission: Some(emission), ..plain }
            }
            MaterialSpec::Checker { colors, squares } => {
                for color in colors {
                    in_bounds("colors", color, Bound::One)?;
                }
                if squares.is_nan() || *squares <= 0.0 {
                    return Err(("squares".to_owned(), format!("{squares} is not above zero")));
                }
                let paint = Paint::Checker { colors: *colors, squares: *squares };
                Material::new(name, paint, Scattering::Matte)
            }
        })
    }

    fn paint(&mut self, key: &str, spec: &PaintSpec, bound: Bound) -> Result<Paint, Fault> {
        match spec {
            PaintSpec::Color(color) => {
                in_bounds(key, color, bound)?;
                Ok(Paint::Plain(*color))
            }
            PaintSpec::Image(image) => {
                in_bounds(&join(key, "factor"), &image.factor, bound)?;
                self.image(key, image)
            }
        }
    }

    fn image(&mut self, key: &str, spec: &ImageSpec) -> Result<Paint, Fault> {
        let at = |inner: &str| join(key, inner);
        let found = self.folder.find(&spec.image).map_err(|why| (at("image"), why))?;
        if !spec.repeat.iter().all(|r| r.is_finite() && *r != 0.0) {
            return Err((at("repeat"), "is zero, which leaves no image".to_owned()));
        }
        if !self.wanted.textures {
            return Ok(Paint::Plain(spec.factor));
        }
        let path = found.path;
        let same = |t: &Texture| {
            t.file() == Some(&path) && t.wrap == [spec.wrap; 2] && t.filter == spec.filter
        };
        let index = self.textures.iter().position(same).unwrap_or_else(|| {
            self.textures.push(Texture {
                name: spec.image.clone(),
                source: ImageSource::File(path.clone()),
                wrap: [spec.wrap; 2],
                filter: spec.filter,
            });
            self.textures.len() - 1
        });
        let texture = u32::try_from(index).unwrap_or(u32::MAX);
        let [u, v] = spec.repeat;
        let transform = [[u, 0.0, 0.0], [0.0, v, 0.0]];
        let image = TextureUse { texture, uv_set: 0, transform, encoding: spec.encoding };
        Ok(Paint::Image { factor: spec.factor, image })
    }
}

fn in_bounds(key: &str, color: &Color, bound: Bound) -> Result<(), Fault> {
    let fault = |why: String| Err((key.to_owned(), why));
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
    checked.map_err(|error| ("illuminant".to_owned(), error.to_string()))
}

/// The index of a glass, by the lens files' own words, sampled where bands may be.
fn refractive_index(spec: &IorSpec) -> Result<Ior, Fault> {
    let fault = |why: String| ("ior".to_owned(), why);
    let words = match spec {
        IorSpec::Constant(n) if *n >= 1.0 && n.is_finite() => return Ok(Ior::Constant(*n)),
        IorSpec::Constant(n) => {
            return Err(fault(format!("{n} is below 1, the index of air and the least there is")));
        }
        IorSpec::Glass(name) => Value::from(name.as_str()),
        IorSpec::Abbe(abbe) => serde_json::json!({ "nd": abbe.nd, "vd": abbe.vd }),
    };
    let spec: GlassSpec = serde_json::from_value(words).map_err(|e| fault(plain(&e)))?;
    let glass = spec.resolve().map_err(|e| fault(e.to_string()))?;
    let step = 5.0;
    let samples: Vec<[f64; 2]> = (50..=500)
        .map(|k| f64::from(k) * step)
        .filter_map(|nm| Some([nm, glass.index(nm).ok().filter(|n| *n >= 1.0)?]))
        .collect();
    if !glass.is_dispersive()
        && let Some([_, n]) = samples.first()
    {
        return Ok(Ior::Constant(*n));
    }
    Curve::sampled(samples).map(Ior::Dispersive).map_err(|e| fault(e.to_string()))
}

fn light(folder: &Folder, spec: &LightSpec) -> Result<Light, Fault> {
    let (key, color, illuminant) = match spec {
        LightSpec::Point { intensity, illuminant, .. }
        | LightSpec::Spot { intensity, illuminant, .. } => ("intensity", intensity, illuminant),
        LightSpec::Directional { irradiance, illuminant, .. } => {
            ("irradiance", irradiance, illuminant)
        }
        LightSpec::Environment { radiance, illuminant, .. } => ("radiance", radiance, illuminant),
    };
    in_bounds(key, color, Bound::None)?;
    let unit = |key: &str, v: DVec3| {
        v.try_normalize().ok_or_else(|| (key.to_owned(), "gives no direction".to_owned()))
    };
    let kind = match spec {
        LightSpec::Point { at, .. } => LightKind::Point(DVec3::from(*at)),
        LightSpec::Spot { at, look_at, cone, inner_cone, .. } => {
            let at = DVec3::from(*at);
            if inner_cone > cone {
                let why = format!("{inner_cone} is wider than `cone`, {cone}");
                return Err(("inner_cone".to_owned(), why));
            }
            LightKind::Spot {
                at,
                axis: unit("look_at", DVec3::from(*look_at) - at)?,
                cos_outer: cone.to_radians().cos(),
                cos_inner: inner_cone.to_radians().cos(),
            }
        }
        LightSpec::Directional { direction, .. } => {
            LightKind::Directional(unit("direction", DVec3::from(*direction))?)
        }
        LightSpec::Environment { image, rotate, .. } => {
            let image = match image {
                None => EnvironmentImage::Constant,
                Some(written) => {
                    let found = folder.find(written).map_err(|why| ("image".to_owned(), why))?;
                    EnvironmentImage::File(found.path)
                }
            };
            LightKind::Environment { image, rotation: rotate.to_radians() }
        }
    };
    Ok(Light { kind, color: *color, illuminant: checked(*illuminant)? })
}
