//! Lenses from files, and rays to trace through them: what `etendue lens` reads.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use etendue_camera::Camera;
use etendue_camera::curve_files::{LONGEST_TABLE, read_curves};
use etendue_files::{InputFolder, Opener, Reach};
use etendue_optics::element::{GlassesAlone, Resolve};
use etendue_optics::glass::AgfCatalogue;
use etendue_optics::train::{
    Focus, LensError, LensFile, LensFormat, OpticalTrain, RayError, RaysFile, TracedRays,
    ZemaxError, ZemaxLens, remove_notes,
};
use etendue_report::Refusal;
use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::camera::{SCENE_KEYS, parse_document, read_bytes, read_document};
use super::document::JsonDocument;
use super::written::WrittenPlaces;
use super::{SceneFile, ScenePath, check, spec, values};
use crate::SceneError;
use crate::load::CameraFiles;

/// The schemas of lens files and of files of rays, made once.
static LENS: LazyLock<Value> = LazyLock::new(lens_schema);
static RAYS: LazyLock<Value> = LazyLock::new(rays_schema);

/// The JSON Schema (2020-12) of a lens file.
#[must_use]
pub fn lens_schema() -> Value {
    schema_of::<LensFile>("etendue lens")
}

/// The JSON Schema (2020-12) of a file of rays.
#[must_use]
pub fn rays_schema() -> Value {
    schema_of::<RaysFile>("rays for etendue lens")
}

fn schema_of<T: JsonSchema>(title: &str) -> Value {
    let mut schema = SchemaSettings::draft2020_12().into_generator().into_root_schema_for::<T>();
    schema.insert("title".to_owned(), title.into());
    let mut schema = schema.to_value();
    spec::allow_notes(&mut schema);
    schema
}

/// A lens, and what its file says beside it.
#[derive(Debug, Clone)]
pub struct ReadLens {
    /// The lens.
    pub train: OpticalTrain,
    /// The lens file that it is, or would be; `None` for a scene's.
    pub file: Option<LensFile>,
    /// Focus setting: where a scene has its sensor; as written in other files.
    pub focus: Focus,
    /// The camera that it is the lens of, of a scene.
    pub camera: Option<Camera>,
    /// Notes on what was changed, assumed or left out when it was imported, as sentences.
    pub notes: Vec<String>,
    /// Every file that it was read from.
    pub inputs: Vec<PathBuf>,
}

impl ReadLens {
    /// Fields (degrees) that its file names.
    #[must_use]
    pub fn fields(&self) -> Vec<f64> {
        self.file.as_ref().map(LensFile::field_angles).unwrap_or_default()
    }

    /// Wavelengths (nm) that its file names, the main one first.
    #[must_use]
    pub fn wavelengths(&self) -> Vec<f64> {
        self.file.as_ref().map(LensFile::wavelengths_nm).unwrap_or_default()
    }

    /// Weights of the wavelengths; empty where the file weighs none.
    #[must_use]
    pub fn weights(&self) -> &[f64] {
        self.file.as_ref().map_or(&[], |file| &file.weights)
    }
}

/// Reads the lens of a lens file (`.json`), of a file of another program ([`LensFormat`]), or that of the camera of a
/// scene. The lens' own files (masks) must lie in its folder, and the scene's lens in the scene's,
/// unless `reach` says otherwise. Glasses are looked up in `glasses` first, the last one before the
/// others.
///
/// # Errors
///
/// When the file is missing, holds no lens, or the lens makes no sense; the message names the place.
pub fn read_lens(
    path: &Path,
    reach: Reach,
    glasses: &[AgfCatalogue],
) -> Result<ReadLens, SceneError> {
    read_lens_at(path, reach, None, glasses)
}

/// As [`read_lens`], at a configuration of another program's file, from 1.
///
/// # Errors
///
/// As [`read_lens`], and when the file has no such configuration.
pub fn read_lens_at(
    path: &Path,
    reach: Reach,
    configuration: Option<usize>,
    glasses: &[AgfCatalogue],
) -> Result<ReadLens, SceneError> {
    if let Some(format) = format_of(path)?
        && (configuration.is_none() || format.has_configurations())
    {
        return import(path, format, configuration, glasses);
    }
    if configuration.is_some() {
        let reason = "has no configurations, which Zemax files (.zmx), those of OSLO (.len) and tables of PhotonsToPhotos \
                      (.txt) may have";
        return Err(SceneError::refused(
            path,
            Refusal::new(reason).hint("leave `--configuration` out"),
        ));
    }
    let (written, value) = read(path)?;
    if !SCENE_KEYS.iter().any(|key| value.get(key).is_some()) {
        return build(&written, value, reach, glasses);
    }
    let folder = folder(path, reach)?;
    let scene = SceneFile::read_with(folder.opener(), path, &[])?;
    let camera = scene.camera_alone(&folder, glasses)?;
    let Some(lens) = camera.lens() else {
        let kind = scene.value().pointer("/camera/type");
        let kind = kind.and_then(Value::as_str).unwrap_or("pinhole");
        let why =
            format!("a \"{kind}\" has no lens to look at\nhint: give a scene whose camera has");
        return Err(scene.fault("camera.type", why));
    };
    let focused = lens.focused();
    let distance = focused.sensor_z() - focused.train().last_vertex();
    Ok(ReadLens {
        train: focused.train().clone(),
        file: None,
        focus: if distance > 0.0 { Focus::Sensor(distance) } else { Focus::AsWritten },
        camera: Some(camera.clone()),
        notes: Vec::new(),
        inputs: inputs(path, &folder),
    })
}

/// Tests whether the file at `path` is a lens by itself: one of another program by its name or
/// content, or JSON that has elements and nothing of a scene.
#[must_use]
pub fn is_lens(path: &Path) -> bool {
    let is_json = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("json"));
    let has_elements = || {
        let Ok((_, value)) = read(path) else { return false };
        value.get("elements").is_some() && !SCENE_KEYS.iter().any(|key| value.get(key).is_some())
    };
    format_of(path).is_ok_and(|format| format.is_some()) || (is_json && has_elements())
}

/// Reads rays and traces them through a lens.
///
/// # Errors
///
/// When the file is missing, is not what the format says, or has a ray that cannot be traced; the
/// message names the place.
pub fn trace_rays(lens: &OpticalTrain, path: &Path) -> Result<TracedRays, SceneError> {
    let (written, value) = read(path)?;
    let file: RaysFile = read_as(&RAYS, &written, &value)?;
    lens.trace_file(&file)
        .map_err(|RayError { index, key, why }| written.fault(format!("rays[{index}].{key}"), why))
}

fn read(path: &Path) -> Result<(WrittenPlaces, Value), SceneError> {
    let (document, value) = read_document(path).map_err(not_a_lens)?;
    Ok(without_notes(path, document, value))
}

fn without_notes(path: &Path, document: JsonDocument, mut value: Value) -> (WrittenPlaces, Value) {
    remove_notes(&mut value);
    (WrittenPlaces::new(&Opener::default(), path, Some(document)), value)
}

/// The lens that `text`, of the lens file `name`, describes, and what is written there; `files` are what it names itself.
pub(crate) fn lens_of_text(
    name: &Path,
    text: String,
    files: Resolve<'_>,
) -> Result<(LensFile, OpticalTrain), SceneError> {
    let (document, value) = parse_document(name, text)?;
    let (written, value) = without_notes(name, document, value);
    lens_of(&written, value, files)
}

/// The lens of a lens file's values, with curves in the place of the files that it names.
fn lens_of(
    written: &WrittenPlaces,
    mut value: Value,
    files: Resolve<'_>,
) -> Result<(LensFile, OpticalTrain), SceneError> {
    let read = &mut |curve: &str| {
        let bytes = etendue_files::read(&files.path(curve)?, LONGEST_TABLE);
        String::from_utf8(bytes.map_err(|error| error.to_string())?)
            .map_err(|_| "is no text".to_owned())
    };
    read_curves(&mut value, read).map_err(|fault| written.fault(fault.key, fault.why))?;
    let file: LensFile = read_as(&LENS, written, &value)?;
    let train = file.build(files).map_err(|error| fault(written, &error))?;
    Ok((file, train))
}

fn read_as<T: DeserializeOwned>(
    schema: &Value,
    written: &WrittenPlaces,
    value: &Value,
) -> Result<T, SceneError> {
    check::check(schema, value).map_err(|problem| written.fault(problem.path, problem.reason))?;
    values::read(value).map_err(|(path, why)| written.fault(path, why))
}

fn folder(file: &Path, reach: Reach) -> Result<InputFolder, SceneError> {
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new("."));
    let opened = Opener::new(reach).folder(folder);
    opened.map_err(|source| SceneError::unreadable(folder, &source))
}

/// `file` and what was found in its folder.
fn inputs(file: &Path, folder: &InputFolder) -> Vec<PathBuf> {
    [vec![file.to_owned()], folder.opener().found()].concat()
}

fn build(
    written: &WrittenPlaces,
    value: Value,
    reach: Reach,
    glasses: &[AgfCatalogue],
) -> Result<ReadLens, SceneError> {
    let folder = folder(&written.path, reach)?;
    let (file, train) = lens_of(written, value, &CameraFiles::new(&folder, glasses))?;
    Ok(ReadLens {
        train,
        file: Some(file),
        focus: Focus::AsWritten,
        camera: None,
        notes: Vec::new(),
        inputs: inputs(&written.path, &folder),
    })
}

/// The other program that a file is of, by its name and, of JSON and text, by its content.
fn format_of(path: &Path) -> Result<Option<LensFormat>, SceneError> {
    let may_tell =
        |ending: &str| path.extension().is_some_and(|own| own.eq_ignore_ascii_case(ending));
    match LensFormat::named(path) {
        Some(format) => Ok(Some(format)),
        None if may_tell("json") || may_tell("txt") => {
            Ok(LensFormat::of(path, &read_bytes(path).map_err(not_a_lens)?))
        }
        None => Ok(None),
    }
}

fn import(
    path: &Path,
    format: LensFormat,
    configuration: Option<usize>,
    glasses: &[AgfCatalogue],
) -> Result<ReadLens, SceneError> {
    let bytes = read_bytes(path).map_err(not_a_lens)?;
    let zemax = |source: ZemaxError| {
        SceneError::Refused(Refusal::new(format!("{}, {source}", path.display())))
    };
    let lens = ZemaxLens::read_as(format, &bytes, configuration, glasses);
    let ZemaxLens { file, notes, .. } = lens.map_err(zemax)?;
    let train = file
        .build(&GlassesAlone(glasses))
        .map_err(|error| zemax(ZemaxError { line: 0, why: error.to_string() }))?;
    let focus = Focus::AsWritten;
    let inputs = vec![path.to_owned()];
    Ok(ReadLens { train, file: Some(file), focus, camera: None, notes, inputs })
}

fn not_a_lens(error: SceneError) -> SceneError {
    match error {
        SceneError::NotAScene { file, reason } => SceneError::not_a_lens(&file, &reason),
        error => error,
    }
}

/// The error with the place in the file that it is about.
fn fault(written: &WrittenPlaces, error: &LensError) -> SceneError {
    let element = |index: &usize| ScenePath::of("elements").index(*index);
    match error {
        LensError::Empty => written.fault("elements", "has no element; a lens needs at least one"),
        LensError::Element { index, why } | LensError::Stop { index, why } => {
            written.fault(element(index), why)
        }
        LensError::Glass { index, source } => {
            written.fault(element(index).key("glass"), source.to_string())
        }
        LensError::Stops { first, second } => {
            let why = format!("{} is the stop already; mark one of them", element(first));
            written.fault(element(second).key("stop"), why)
        }
        LensError::Key { key, why } => written.fault(key, why),
        LensError::Wavelength(_) => written.fault("wavelength", error.to_string()),
        _ => written.fault("", error.to_string()),
    }
}
