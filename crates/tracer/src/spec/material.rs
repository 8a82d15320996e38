//! Materials as the scene file writes them, and the surfaces that they are.

use std::sync::Arc;

use etendue_spectrum::{CurveSpec, Illuminant, Metal, table};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::color::{Bound, Reflectance, curve, in_bounds, look, luminous, reflectance, share_of};
use super::modulation::ModulationSpec;
use super::paint::{PaintSpec, checker, default_checker_squares, paint, radiant_paint};
use super::supply::{ColorSpec, Fault, IorSpec, Supply, one, white};
use crate::bsdf::SECOND_COSINE;
use crate::material::Alpha;
use crate::scattering::{Absorption, Glass, GltfSurface};
use crate::{Conductor, Emission, LightGroup, Material, Paint, Scattering, SceneCurve};

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
        /// The metal whose measured index decides what is reflected at which wavelength: a name, curves of `n` and
        /// `k`, or a `.yml` file of refractiveindex.info.
        #[serde(default)]
        metal: Option<MetalSpec>,
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
        /// Absorption of light on its way through the body; none when absent.
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
        /// Colour of the reflection of what is no metal, face on: linear RGB, each 0..=1, or a curve.
        #[serde(default = "white")]
        specular_color: ColorSpec,
        /// Anisotropy: by how much rougher highlights are along the surface's grain than across it, 0 to 1.
        #[serde(default)]
        #[schemars(range(min = 0.0, max = 1.0))]
        anisotropy: f64,
        /// Direction of the grain: degrees from growing u of the texture coordinates, counter-clockwise as the
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
        /// Radiance: linear RGB (not below zero), a curve, an image, a cube or squares of two of the first.
        radiance: PaintSpec,
        /// The spectrum that the radiance multiplies; equal energy when absent.
        #[serde(default)]
        illuminant: Option<Illuminant>,
        /// Luminance (cd/m²): brings the radiance to it, which then says the spectrum alone; of an image where that is
        /// white.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(range(min = 0.0))]
        luminance: Option<f64>,
        /// The back shines too.
        #[serde(default)]
        two_sided: bool,
        /// The group that the layer request `light_groups` shows it with.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        group: Option<LightGroup>,
        /// Change of its strength with time; none when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        modulation: Option<ModulationSpec>,
    },
    /// Matte squares of two colours over the surface's texture coordinates.
    Checker {
        /// The two reflectances: linear RGB, or curves.
        #[serde(default = "default_checker_colors")]
        colors: [ColorSpec; 2],
        /// Squares along one unit of the texture coordinates (> 0).
        #[serde(default = "default_checker_squares")]
        squares: f64,
    },
}

/// A metal as the scene file writes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum MetalSpec {
    /// One of the tables.
    Named(Metal),
    /// Curves of its index.
    Index(MetalIndexSpec),
    /// A measured file.
    File(MetalFileSpec),
}

/// The index n + i k of a metal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MetalIndexSpec {
    /// n by wavelength.
    pub n: CurveSpec,
    /// k by wavelength.
    pub k: CurveSpec,
}

/// The index of a metal in a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MetalFileSpec {
    /// A `.yml` file of refractiveindex.info with n and k, relative to the scene file.
    pub file: String,
}

/// Absorption of a body, by Beer and Lambert.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AbsorptionSpec {
    /// Share of light that is left after `distance`: linear RGB, each 0..=1, or a curve.
    pub color: ColorSpec,
    /// m (> 0).
    pub distance: f64,
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
                Material::new(name, paint("color", color, supply)?, Scattering::Matte)
            }
            Self::Mirror { color } => {
                Material::new(name, paint("color", color, supply)?, Scattering::Mirror)
            }
            Self::Metal { color, metal, roughness } => {
                let (paint, named) = match (color, metal) {
                    (Some(color), None) => (paint("color", color, supply)?, None),
                    (None, Some(metal)) => {
                        let conductor = conductor(metal, supply)?;
                        (Paint::Plain(look(&conductor.face_on())), Some(conductor))
                    }
                    (None, None) => {
                        let why = "is missing: give it, or a `metal` (\"gold\", \"silver\", …)";
                        return Err(Fault::new("color", why));
                    }
                    (Some(_), Some(_)) => {
                        let why = "is given with `metal`, which has its own: leave one of them out";
                        return Err(Fault::new("color", why));
                    }
                };
                Material::new(name, paint, Scattering::Metal { roughness: *roughness, named })
            }
            Self::Dielectric { ior, color, roughness, absorption } => {
                let glass = Glass {
                    ior: supply.index(ior).map_err(|why| Fault::new("ior", why))?,
                    roughness: *roughness,
                    absorption: match absorption {
                        Some(spec) => Some(absorbing(spec, supply)?),
                        None => None,
                    },
                };
                let scattering = Scattering::Dielectric(glass);
                Material::new(name, paint("color", color, supply)?, scattering)
            }
            Self::Gltf { .. } => self.gltf(name, supply)?,
            Self::Emissive { radiance, illuminant, luminance, two_sided, group, modulation } => {
                let (mut radiance, illuminant) =
                    radiant_paint("radiance", radiance, *illuminant, supply)?;
                if let Some(wanted) = *luminance {
                    let (Paint::Plain(color) | Paint::Image { factor: color, .. }) = &mut radiance
                    else {
                        let why = "is of one spectrum, a colour's, a curve's or that of an image's factor, and `radiance` \
                                   is a checker or a cube: give those their radiance themselves";
                        return Err(Fault::new("luminance", why));
                    };
                    let own = luminous(color, illuminant.as_deref());
                    let scale = share_of("luminance", wanted, own)?;
                    *color = color.map(|part| part * scale);
                    in_bounds("luminance", color, Bound::None)?;
                }
                let emission = Emission {
                    radiance: radiance.clone(),
                    strength: 1.0,
                    illuminant,
                    two_sided: *two_sided,
                    group: *group,
                    modulation: match modulation {
                        Some(modulation) => Some(Arc::new(modulation.build()?)),
                        None => None,
                    },
                };
                let plain = Material::new(name, look_of(radiance), Scattering::Black);
                Material { emission: Some(emission), ..plain }
            }
            Self::Checker { colors, squares } => {
                let paint = checker("colors", colors, *squares, supply)?;
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
            specular_color,
            anisotropy,
            anisotropy_rotation,
            opacity,
        } = self
        else {
            return Ok(Material::unnamed());
        };
        // Sheen has one colour or an image, and no checker.
        let sheen = paint("sheen", sheen, supply)?;
        let (sheen_color, sheen_curve, sheen_color_texture) = match sheen {
            Paint::Plain(color) => (color, None, None),
            Paint::Curve { look, curve } => (look, Some(curve), None),
            Paint::Image { factor, curve, image } => (factor, curve, Some(image)),
            Paint::Checker { .. } | Paint::Cube { .. } => {
                let why = "is a checker or a cube; a sheen is of one colour, a curve or an image";
                return Err(Fault::new("sheen", why));
            }
        };
        let highlights = reflectance("specular_color", specular_color, supply)?;
        // The surface below its colour, and what shows through both.
        let surface = GltfSurface {
            metallic: *metallic,
            roughness: *roughness,
            ior: *ior,
            transmission: *transmission,
            clearcoat: *clearcoat,
            clearcoat_roughness: *clearcoat_roughness,
            sheen_color,
            sheen_curve,
            sheen_color_texture,
            specular_color: highlights.look,
            specular_curve: highlights.curve,
            sheen_roughness: *sheen_roughness,
            anisotropy: *anisotropy,
            anisotropy_rotation: anisotropy_rotation.to_radians(),
            ..GltfSurface::default()
        };
        let paint = paint("color", color, supply)?;
        let plain = Material::new(name, paint, Scattering::Gltf(Box::new(surface)));
        let alpha = if *opacity < 1.0 { Alpha::Blend { factor: *opacity } } else { Alpha::Opaque };
        Ok(Material { alpha, ..plain })
    }

    /// Change of its strength with time, if it shines and changes.
    #[must_use]
    pub fn modulation(&self) -> Option<&ModulationSpec> {
        match self {
            Self::Emissive { modulation, .. } => modulation.as_ref(),
            Self::Matte { .. }
            | Self::Mirror { .. }
            | Self::Metal { .. }
            | Self::Dielectric { .. }
            | Self::Gltf { .. }
            | Self::Checker { .. } => None,
        }
    }

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

/// The look of a surface that shines by `radiance` and of which nothing is reflected.
fn look_of(radiance: Paint) -> Paint {
    match radiance {
        Paint::Checker { colors, squares, .. } => Paint::Checker { colors, curves: None, squares },
        paint @ (Paint::Plain(_)
        | Paint::Curve { .. }
        | Paint::Image { .. }
        | Paint::Cube { .. }) => paint,
    }
}

/// A metal by its name, curves or file.
fn conductor(spec: &MetalSpec, supply: &mut dyn Supply) -> Result<Conductor, Fault> {
    let [n, k] = match spec {
        MetalSpec::Named(metal) => return Ok(Conductor::Named(*metal)),
        MetalSpec::Index(MetalIndexSpec { n, k }) => {
            [curve("metal.n", n, supply)?, curve("metal.k", k, supply)?]
        }
        MetalSpec::File(MetalFileSpec { file }) => supply
            .text(file)
            .and_then(|text| table::refractive_index_info(&text))
            .map_err(|why| Fault::new("metal.file", format!("\"{file}\": {why}")))?,
    };
    if n.extent()[0] < 0.0 || k.extent()[0] < 0.0 {
        let why = "has n or k below zero, where no light is reflected by any formula";
        return Err(Fault::new("metal", why));
    }
    let mut at = |cosine: f64| {
        let curve = etendue_spectrum::metal::reflectance_of([&n, &k], cosine);
        let curve = curve.map_err(|error| Fault::new("metal", error.to_string()))?;
        Ok(SceneCurve { number: supply.curve_number(), curve: Arc::new(curve) })
    };
    Ok(Conductor::Measured([at(1.0)?, at(SECOND_COSINE)?]))
}

fn absorbing(spec: &AbsorptionSpec, supply: &mut dyn Supply) -> Result<Absorption, Fault> {
    let AbsorptionSpec { color, distance } = spec;
    let Reflectance { look, curve } = reflectance("absorption.color", color, supply)?;
    if distance.is_nan() || *distance <= 0.0 {
        let why = format!("{distance} is not above zero");
        return Err(Fault::new("absorption.distance", why));
    }
    Ok(Absorption { color: look, curve, distance: *distance })
}

fn default_checker_colors() -> [ColorSpec; 2] {
    [ColorSpec::Rgb([0.8; 3]), ColorSpec::Rgb([0.2; 3])]
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
