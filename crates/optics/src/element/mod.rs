//! The parts of a lens. Each file holds one part: how a lens file writes it, and what it does.
//!
//! To add a part: its own file, and a variant of [`Part`] and [`PartSpec`] in `part.rs`.
//!
//! Where an element stands: on the axis, or tilted and decentred.
//!
//! What a lens takes from outside its own text.

mod abcd;
pub(crate) mod aperture;
mod biconic;
mod coating;
mod coordinate_break;
mod crossings;
mod derivatives;
mod freeform;
pub(crate) mod gradient;
mod lattice;
mod lenslets;
mod losses;
mod microlens_array;
mod mirror;
mod newton;
mod part;
mod rays;
pub(crate) mod real;
mod refract;
pub(crate) mod shapes;
mod step;
mod surface;
mod thin_lens;

use std::borrow::Cow;
use std::path::PathBuf;

use glam::{DMat3, DVec3};
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::{DeserializeOwned, Error as _};
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::{Map, Value};

use crate::glass::AgfCatalogue;
use etendue_geometry::units::{Degrees, Millimetres};

pub use abcd::Abcd;
pub use aperture::{
    ApertureSpec, CircularSpec, MaskSpec, Opening, Picture, PolygonSpec, grey_picture,
};
pub use biconic::{Biconic, BiconicSpec};
pub use coating::{MirrorCoating, MirrorCoatingSpec, Stack, StackSpec, ThinFilmSpec};
pub use coordinate_break::{CoordinateBreak, CoordinateBreakSpec};
pub use freeform::{Freeform, FreeformSpec, HeightMapSpec, PatternSpec, PhaseSpec, SagSpec};
pub use gradient::{GradedGap, Gradient, GradientSpec, GradientTerms};
pub use lattice::{Grid, Lattice, LatticeCell};
pub(crate) use losses::Loss;
pub use losses::{Coating, Filter, FilterSpec, LossesSpec, Plain, Reflection};
pub use microlens_array::{
    Gaps, Lenslet, LensletShape, LensletSpec, MicrolensArray, MicrolensArraySpec, clipped,
};
pub(crate) use mirror::{Fold, Shadow};
pub use mirror::{Mirror, MirrorMount, MirrorSpec};
pub use part::{Part, PartSpec, Symbol};
pub use rays::{Block, LANES, LensRays, Ray, RayStatus, StatusCounts};
use rays::{moved, turned};
pub use real::Real;
pub(crate) use refract::Refraction;
pub use shapes::{AnnularSpec, BoxSpec, OutlineSpec, Shape, SpiderSpec};
pub use step::Clip;
pub(crate) use step::{Action, ElementStep};
pub use surface::{Surface, SurfaceSpec};
pub use thin_lens::{ThinLens, ThinLensSpec};

/// An element of a lens file: a part, and how it is mounted.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ElementSpec {
    /// Its kind.
    #[serde(flatten)]
    pub part: PartSpec,
    /// Its mount.
    #[serde(flatten)]
    pub mount: Mount,
}

/// Mount of an element.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Mount {
    /// From this element's vertex to the next one's along the axis (mm); behind the last element,
    /// to the sensor.
    #[serde(skip_serializing_if = "is_default")]
    pub thickness: Millimetres,
    /// True if this is the aperture stop, which chief rays pass in the middle.
    #[serde(skip_serializing_if = "is_default")]
    pub stop: bool,
    /// Turns about the x axis and then about the element's own y axis (degrees), right-handed,
    /// around its vertex. The elements behind are not moved.
    #[serde(skip_serializing_if = "is_default")]
    pub tilt: [Degrees; 2],
    /// Moved across the axis by x and y (mm). The elements behind are not moved.
    #[serde(skip_serializing_if = "is_default")]
    pub decentre: [Millimetres; 2],
    /// Change of the index of the glass behind a surface from place to place; it is the same everywhere when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gradient: Option<GradientSpec>,
}

pub(crate) fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// The keys of [`Mount`].
const MOUNT_KEYS: [&str; 5] = ["thickness", "stop", "tilt", "decentre", "gradient"];

impl ElementSpec {
    /// A part on the axis, `thickness` (mm) before the next one.
    #[must_use]
    pub fn new(part: PartSpec, thickness: f64) -> Self {
        let mount = Mount { thickness: Millimetres(thickness), ..Mount::default() };
        Self { part, mount }
    }

    /// Marks the element as the aperture stop.
    #[must_use]
    pub fn as_stop(mut self) -> Self {
        self.mount.stop = true;
        self
    }
}

// Parts and mounts both refuse unknown keys, which serde cannot combine with flattening: so the
// mount's keys are taken out by hand, and the part sees all others.
impl<'de> Deserialize<'de> for ElementSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut keys = Map::deserialize(deserializer)?;
        let mut mount = Map::new();
        for key in MOUNT_KEYS {
            if let Some(value) = keys.remove(key) {
                mount.insert(key.to_owned(), value);
            }
        }
        let mount = read::<Mount>(mount);
        let part = read::<PartSpec>(keys).map_err(D::Error::custom)?;
        Ok(Self { part, mount: mount.map_err(D::Error::custom)? })
    }
}

/// Reads an object; the error names the key that is wrong.
fn read<T: DeserializeOwned>(keys: Map<String, Value>) -> Result<T, String> {
    serde_path_to_error::deserialize(Value::Object(keys)).map_err(|error| {
        let path = error.path().to_string();
        let why = error.into_inner().to_string();
        if path == "." { why } else { format!("{path}: {why}") }
    })
}

impl JsonSchema for ElementSpec {
    fn schema_name() -> Cow<'static, str> {
        "ElementSpec".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        element_schema(generator, Map::new(), &[])
    }
}

/// The schema of a part with the mount's keys, `extra` ones that are required, and not those of
/// `without`. As with reading, flattening would lose the refusal of unknown keys.
pub fn element_schema(
    generator: &mut SchemaGenerator,
    extra: Map<String, Value>,
    without: &[&str],
) -> Schema {
    let mut mount = Mount::json_schema(generator);
    let required: Vec<Value> = extra.keys().map(|key| key.as_str().into()).collect();
    let mut keys = extra;
    if let Some(Value::Object(members)) = mount.ensure_object().remove("properties") {
        keys.extend(members.into_iter().filter(|(key, _)| !without.contains(&key.as_str())));
    }
    let mut schema = PartSpec::json_schema(generator);
    if let Some(Value::Array(kinds)) = schema.get_mut("oneOf") {
        for kind in kinds {
            mount_on(kind, &keys, &required);
        }
    }
    schema
}

/// Adds `keys` to all objects that a schema chooses between, which refuse all others.
fn mount_on(schema: &mut Value, keys: &Map<String, Value>, required: &[Value]) {
    let Value::Object(schema) = schema else { return };
    schema.remove("unevaluatedProperties");
    let mut known = keys.clone();
    if let Some(Value::Object(own)) = schema.get("properties") {
        known.extend(own.clone());
    }
    if let Some(Value::Array(shapes)) = schema.get_mut("oneOf") {
        // The tag has been looked at when it comes to the shapes.
        known.insert("type".to_owned(), Value::Bool(true));
        for shape in shapes {
            mount_on(shape, &known, required);
        }
        return;
    }
    if let Some(Value::Array(all)) = schema.get_mut("required") {
        all.extend_from_slice(required);
    }
    schema.insert("properties".to_owned(), Value::Object(known));
    schema.insert("additionalProperties".to_owned(), Value::Bool(false));
}

/// An element's place in lens coordinates (mm). The element is moved across the axis first and then
/// turned about its own vertex.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// The vertex.
    pub vertex: DVec3,
    /// From the element's frame to lens coordinates: about x first, then about the element's y.
    pub rotation: DMat3,
}

impl Frame {
    /// On the axis at `z`.
    #[must_use]
    pub fn on_axis(z: f64) -> Self {
        Self { vertex: DVec3::new(0.0, 0.0, z), rotation: DMat3::IDENTITY }
    }

    /// Moved by `decentre` (mm) across the axis and turned by `tilt` (degrees) about the x and y
    /// axes, right-handed.
    #[must_use]
    pub fn placed(z: f64, decentre: [f64; 2], tilt: [f64; 2]) -> Self {
        let [about_x, about_y] = tilt.map(f64::to_radians);
        Self {
            vertex: DVec3::new(decentre[0], decentre[1], z),
            rotation: DMat3::from_rotation_x(about_x) * DMat3::from_rotation_y(about_y),
        }
    }

    /// True if the element is centred on the axis and square to it.
    #[must_use]
    pub fn is_axial(&self) -> bool {
        self.rotation == DMat3::IDENTITY && self.vertex.x == 0.0 && self.vertex.y == 0.0
    }

    /// A point of the element's frame in lens coordinates.
    #[must_use]
    pub fn point(&self, local: DVec3) -> DVec3 {
        self.vertex + self.rotation * local
    }

    pub(crate) fn enter<T: Real>(&self, ray: Ray<T>) -> Ray<T> {
        let back = self.rotation.transpose();
        let place = moved(ray.position, -self.vertex);
        Ray { position: turned(&back, place), direction: turned(&back, ray.direction) }
    }

    pub(crate) fn leave<T: Real>(&self, ray: Ray<T>) -> Ray<T> {
        let place = turned(&self.rotation, ray.position);
        let direction = turned(&self.rotation, ray.direction);
        Ray { position: moved(place, self.vertex), direction }
    }
}

/// The files that a lens names, and catalogues of glasses that its user adds. A function from a file's name to
/// its path stands for files alone.
pub trait LensResources {
    /// Path of a file that the lens names.
    ///
    /// # Errors
    ///
    /// A sentence on why it may not be read.
    fn path(&self, name: &str) -> Result<PathBuf, String>;

    /// Catalogues in which glasses are looked up before the built-in one, the last before the others.
    fn glasses(&self) -> &[AgfCatalogue] {
        &[]
    }
}

impl<F: Fn(&str) -> Result<PathBuf, String>> LensResources for F {
    fn path(&self, name: &str) -> Result<PathBuf, String> {
        self(name)
    }
}

/// Catalogues of glasses for lenses that name no files.
#[derive(Debug, Clone, Copy, Default)]
pub struct GlassesAlone<'a>(pub &'a [AgfCatalogue]);

impl LensResources for GlassesAlone<'_> {
    fn path(&self, name: &str) -> Result<PathBuf, String> {
        Err(format!("{name}: a lens of this kind has no files"))
    }

    fn glasses(&self) -> &[AgfCatalogue] {
        self.0
    }
}

/// Access of lenses that are being built to files and other resources outside of their text.
pub type Resolve<'a> = &'a dyn LensResources;

#[cfg(test)]
mod tests {
    use super::*;

    fn read(json: &str) -> Result<ElementSpec, String> {
        let spec: ElementSpec = serde_json::from_str(json).map_err(|e| e.to_string())?;
        let text = serde_json::to_string(&spec).unwrap();
        let again: ElementSpec = serde_json::from_str(&text).unwrap();
        assert_eq!(spec, again, "{text}");
        Ok(spec)
    }

    #[test]
    fn elements_read_as_the_design_writes_them() {
        let surface = read(
            r#"{ "type": "surface", "radius": 84.83, "thickness": 0.12, "semi_diameter": 12.6,
             "conic": -0.5, "aspheric": { "4": 1e-6 }, "tilt": [1, "30 arcmin"] }"#,
        )
        .unwrap();
        assert_eq!(surface.mount.thickness, Millimetres(0.12));
        assert_eq!(surface.mount.tilt, [Degrees(1.0), Degrees(0.5)]);
        let PartSpec::Surface(spec) = &surface.part else { panic!("{surface:?}") };
        assert_eq!(spec.aspheric["4"], 1e-6);
        let stop = read(
            r#"{ "type": "aperture", "shape": "circular", "radius": 8.55, "thickness": 4.5,
             "stop": true }"#,
        );
        assert_eq!(stop.unwrap(), ElementSpec::new(PartSpec::circular(8.55), 4.5).as_stop());
        assert!(read(r#"{"type": "thin_lens", "focal_length": "50 mm"}"#).is_ok());
        assert!(read(r#"{"type": "filter", "transmission": [[400, 0.1], [700, 0.9]]}"#).is_ok());
    }

    #[test]
    fn the_schema_knows_the_keys_of_part_and_mount_and_refuses_others() {
        fn leaves<'a>(schema: &'a Value, found: &mut Vec<&'a Value>) {
            match schema.get("oneOf").and_then(Value::as_array) {
                Some(kinds) => kinds.iter().for_each(|kind| leaves(kind, found)),
                None => found.push(schema),
            }
        }
        let schema = schemars::schema_for!(ElementSpec).to_value();
        let mut kinds = Vec::new();
        leaves(&schema, &mut kinds);
        assert_eq!(kinds.len(), 16, "eight shapes of apertures");
        for kind in kinds {
            assert_eq!(kind["additionalProperties"], false, "{kind}");
            let keys = kind["properties"].as_object().unwrap();
            assert!(MOUNT_KEYS.iter().all(|key| keys.contains_key(*key)), "{kind}");
            assert!(keys.len() > MOUNT_KEYS.len() + 1 && keys.contains_key("type"), "{kind}");
        }
    }

    #[test]
    fn unknown_keys_and_types_are_refused_by_name() {
        let error = |json| read(json).unwrap_err();
        assert!(error(r#"{"type": "surface", "radios": 3}"#).contains("unknown field `radios`"));
        assert!(error(r#"{"type": "prism"}"#).contains("unknown variant `prism`"));
        assert!(error(r#"{"radius": 3}"#).contains("missing field `type`"));
        let stop = r#"{"type": "surface", "stop": "yes"}"#;
        assert!(error(stop).contains("invalid type: string \"yes\""), "{}", error(stop));
        let thick = r#"{"type": "surface", "thickness": "3 mn"}"#;
        assert!(error(thick).contains("unknown unit `mn`"), "{}", error(thick));
    }

    #[test]
    fn tilts_turn_about_the_vertex_and_come_back() {
        let frame = Frame::placed(10.0, [1.0, 2.0], [30.0, -10.0]);
        assert_eq!(frame.point(DVec3::ZERO), DVec3::new(1.0, 2.0, 10.0));
        // A turn about x by a right angle takes +z to −y.
        let quarter = Frame::placed(0.0, [0.0; 2], [90.0, 0.0]);
        assert!((quarter.point(DVec3::Z) + DVec3::Y).length() < 1e-15);
        let ray = Ray { position: [3.0, -1.0, 4.0], direction: [0.6, 0.0, 0.8] };
        let back = frame.leave(frame.enter(ray));
        for axis in 0..3 {
            assert!((back.position[axis] - ray.position[axis]).abs() < 1e-14);
            assert!((back.direction[axis] - ray.direction[axis]).abs() < 1e-15);
        }
        assert!(!frame.is_axial() && Frame::on_axis(3.0).is_axial());
    }
}
