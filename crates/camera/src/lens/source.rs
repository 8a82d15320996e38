//! A lens as a camera names it: a file or the lens itself; parts put on a lens' axis; distances in focus; and
//! what all cameras with a lens set up around it.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::{Map, Value};

use crate::{CameraError, PoseSpec, SensorSpec};
use etendue_geometry::units::{Degrees, Metres, Millimetres};
use etendue_optics::element::{ElementSpec, LensResources, LossesSpec, Resolve, element_schema};
use etendue_optics::glass::AgfCatalogue;
use etendue_optics::train::{Focus, LensError, LensFile, LensFormat, OpticalTrain, ZemaxLens};

/// The longest text that is read as a lens (bytes).
const LONGEST: u64 = 16 << 20;

/// Source of a lens.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum LensSource {
    /// The path of a lens file, from the scene's folder.
    File(String),
    /// The lens itself, as its file would have it.
    Inline(LensFile),
}

impl LensSource {
    /// The lens. `resolve` turns paths that start at the scene's folder into paths to be opened.
    ///
    /// # Errors
    ///
    /// When a file may not be read or is no lens; the error names the place in it.
    pub(crate) fn read(&self, resolve: &dyn CameraResources) -> Result<OpticalTrain, CameraError> {
        match self {
            Self::Inline(file) => file.build(resolve).map_err(|error| in_camera("lens", &error)),
            Self::File(written) => {
                let error = |why: String| CameraError::new("lens", why);
                let path = resolve.path(written).map_err(error)?;
                let bytes = etendue_files::read(&path, LONGEST)
                    .map_err(|why| error(format!("{written}: cannot be read: {why}")))?;
                if let Some(format) = LensFormat::of(&path, &bytes) {
                    let fault = |why: String| error(format!("{written}, {why}"));
                    let lens = ZemaxLens::read_as(format, &bytes, None, resolve.glasses());
                    let lens = lens.map_err(|e| fault(e.to_string()))?;
                    return lens.file.build(resolve).map_err(|e| fault(e.to_string()));
                }
                let text = String::from_utf8(bytes)
                    .map_err(|_| error(format!("{written}: is not UTF-8 text")))?;
                let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
                let folder = Path::new(written).parent().unwrap_or(Path::new(""));
                let files = LensFolder { folder, scene: resolve };
                resolve.lens(written, text, &files).map_err(error)
            }
        }
    }
}

/// What a camera takes from outside its own text: what a lens takes, and lenses from lens files. A function from a file's
/// name to its path stands for files alone.
pub trait CameraResources: LensResources {
    /// The lens that `text`, of the lens file `name`, describes; `files` are what it names itself. Who knows the places
    /// in a text reads it; otherwise [`LensFile::from_json`] does, and curves in files are not read.
    ///
    /// # Errors
    ///
    /// A sentence that starts with the file and the place in it.
    fn lens(&self, name: &str, text: &str, files: Resolve<'_>) -> Result<OpticalTrain, String> {
        let lens = LensFile::from_json(text).and_then(|file| file.build(files));
        lens.map_err(|fault| format!("{name}: {fault}"))
    }
}

impl<F: Fn(&str) -> Result<PathBuf, String>> CameraResources for F {}

/// Resources of a lens file: its own paths start at its own folder.
struct LensFolder<'a> {
    folder: &'a Path,
    scene: &'a dyn CameraResources,
}

impl LensResources for LensFolder<'_> {
    fn path(&self, name: &str) -> Result<PathBuf, String> {
        match Path::new(name).is_absolute() {
            true => self.scene.path(name),
            false => self.scene.path(&self.folder.join(name).to_string_lossy()),
        }
    }

    fn glasses(&self) -> &[AgfCatalogue] {
        self.scene.glasses()
    }
}

/// The fault of a lens that is written in the camera at `key`.
pub(crate) fn in_camera(key: &str, error: &LensError) -> CameraError {
    in_element(error, key, |index| format!("{key}.elements[{index}]"))
}

/// The fault of a part that is built alone, as the camera's element `index`.
pub(crate) fn in_part(index: usize, error: &LensError) -> CameraError {
    in_element(error, "", |_| format!("elements[{index}]"))
}

/// The fault of a lens: of one of its elements where `at` says, of all of it at `key`.
fn in_element(error: &LensError, key: &str, at: impl Fn(usize) -> String) -> CameraError {
    match error {
        LensError::Element { index, why } => CameraError::new(at(*index), why.clone()),
        LensError::Glass { index, source } => {
            CameraError::new(format!("{}.glass", at(*index)), source.to_string())
        }
        _ => CameraError::new(key, error.to_string()),
    }
}

/// A part at a place of its own on a lens' axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PlacedSpec {
    /// Place of its vertex on the axis (mm): from the lens' first vertex, negative in front of it.
    pub at: Millimetres,
    /// The part and how it is mounted, as in a lens file but without `thickness`.
    #[serde(flatten)]
    pub element: ElementSpec,
}

impl<'de> Deserialize<'de> for PlacedSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut keys = Map::deserialize(deserializer)?;
        let at = keys.remove("at").ok_or_else(|| D::Error::missing_field("at"))?;
        if keys.contains_key("thickness") {
            let why = "`thickness` has no place beside `at`, which says where the part is";
            return Err(D::Error::custom(why));
        }
        let at = Millimetres::deserialize(at).map_err(D::Error::custom)?;
        let element = ElementSpec::deserialize(Value::Object(keys)).map_err(D::Error::custom)?;
        Ok(Self { at, element })
    }
}

impl JsonSchema for PlacedSpec {
    fn schema_name() -> Cow<'static, str> {
        "PlacedSpec".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let mut at = generator.subschema_for::<Millimetres>();
        let about = "Place of its vertex on the axis (mm): from the lens' first vertex, negative in \
                     front of it.";
        at.insert("description".to_owned(), about.into());
        let keys = Map::from_iter([("at".to_owned(), at.to_value())]);
        element_schema(generator, keys, &["thickness"])
    }
}

/// The distance of what is in focus (m); a file may write "infinity".
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FocusDistance(pub f64);

/// Words for an object at infinity in files.
const INFINITY: [&str; 2] = ["infinity", "inf"];

impl Serialize for FocusDistance {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0 == f64::INFINITY {
            true => serializer.serialize_str(INFINITY[0]),
            false => Metres(self.0).serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for FocusDistance {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = serde_json::Value::deserialize(deserializer)?;
        if value.as_str().is_some_and(|text| INFINITY.contains(&text.trim())) {
            return Ok(Self(f64::INFINITY));
        }
        Metres::deserialize(value).map(|metres| Self(metres.0)).map_err(D::Error::custom)
    }
}

impl JsonSchema for FocusDistance {
    fn schema_name() -> Cow<'static, str> {
        "FocusDistance".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let mut schema = Metres::json_schema(generator);
        let about = "A number in m, a string with a unit, or \"infinity\".";
        schema.insert("description".to_owned(), about.into());
        schema.insert("x-also".to_owned(), INFINITY.as_slice().into());
        schema
    }
}

/// Setup that the cameras with a lens have in common.
#[derive(Debug, Clone)]
pub(crate) struct Setup<'a> {
    pub(crate) f_number: Option<f64>,
    pub(crate) focus: Option<Focus>,
    pub(crate) fov: Option<f64>,
    pub(crate) sensor_height: Option<f64>,
    pub(crate) sensor_tilt: [Degrees; 2],
    pub(crate) sensor_decentre: [Millimetres; 2],
    pub(crate) losses: LossesSpec,
    pub(crate) diffraction: bool,
    pub(crate) pose: Option<&'a PoseSpec>,
    pub(crate) sensor: &'a SensorSpec,
}

impl Setup<'_> {
    /// Counts `sensor_distance` from a vertex that is `reach` (mm) in front of the last element's.
    pub(super) fn measure_past(&mut self, reach: f64) {
        if let Some(Focus::Sensor(distance)) = &mut self.focus {
            *distance -= reach;
        }
    }
}
