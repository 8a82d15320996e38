//! Pictures of light from elsewhere, and what a sensor makes of them.

mod exposed;

use std::fs;
use std::path::{Path, PathBuf};

use etendue_files::MappedFile;
use etendue_image::{
    Cube, ExrChannels, Limits, MOST_BYTES, Plane, Quantity, Samples, cube, envi, npy,
};
use etendue_render::expose::{BandFilm, LightUnit, PictureLight, PixelLight};
use etendue_render::output::LayerFile;
use etendue_scene::memory::Budget;
use etendue_spectrum::{Bands, Grid};
use serde_json::Value;

use crate::Error;
use crate::words::{LIGHT_UNIT, NOISE_SEED, PITCH, PUPIL};

/// A picture of light: an EXR file in red, green and blue or in the layout of spectral images, an NPY array, an ENVI
/// cube, or a Radiance picture.
#[derive(Debug, Clone)]
pub struct LightImage {
    path: PathBuf,
    /// All files that it was read from.
    inputs: Vec<PathBuf>,
    picture: PictureLight,
    quantity: Quantity,
    /// The unit of its values in its file's words.
    unit: Option<String>,
    /// Of temporal noise, where a render of this program left it.
    noise_seed: Option<u64>,
    /// Of the camera's pupil (sr), likewise.
    solid_angle: Option<f64>,
    /// Of the camera's pixels (µm), likewise.
    pixel_pitch: Option<f64>,
    notes: Vec<String>,
}

/// Options of exposing a sensor to a picture of light.
#[derive(Debug, Clone, Copy, Default)]
pub struct ExposeOptions {
    /// Unit of the picture's values; `None` where the file says so.
    pub unit: Option<LightUnit>,
    /// The f-number of the lens, which makes irradiance of radiance: E = π L / (1 + 4 N² (1 + m)²). `None` where the
    /// file has the pupil of a render's camera.
    pub f_number: Option<f64>,
    /// The magnification m of that lens (≥ 0), as a positive number; far scenes have 0.
    pub magnification: f64,
    /// Seed of temporal noise; `None` takes the one of the render that left the file, or else 0.
    pub seed: Option<u64>,
    /// The number of the frame, from 0: others have noise of their own.
    pub frame: u32,
    /// Memory that may be taken in all (bytes); `None` for what the system has free.
    pub memory: Option<u64>,
}

/// The program itself, its libraries, and buffers of files that are written (bytes).
const BESIDE: u64 = 16 << 20;

/// Data of a file beside its values.
#[derive(Debug, Default)]
struct ImageMetadata {
    unit: Option<String>,
    edges: Option<Vec<f64>>,
    noise_seed: Option<u64>,
    solid_angle: Option<f64>,
    pixel_pitch: Option<f64>,
}

impl ImageMetadata {
    /// From a file's entries, by their names.
    fn of<'t>(entry: impl Fn(&str) -> Option<&'t str>) -> Self {
        let positive = |key: &str| {
            let number = entry(key).and_then(|number| number.parse::<f64>().ok());
            number.filter(|number| *number > 0.0 && number.is_finite())
        };
        Self {
            unit: entry(LIGHT_UNIT).map(str::to_owned),
            edges: None,
            noise_seed: entry(NOISE_SEED).and_then(|seed| seed.parse().ok()),
            solid_angle: positive(PUPIL),
            pixel_pitch: positive(PITCH),
        }
    }

    /// Reads what `layers.json` beside the array at `path` says of it.
    fn of_array(path: &Path) -> Option<(Self, PathBuf)> {
        let json = path.with_file_name("layers.json");
        let bytes = etendue_files::read(&json, 1 << 28).ok()?;
        let value: Value = serde_json::from_slice(&bytes).ok()?;
        let name = path.file_name()?.to_str()?;
        let is_own = |layer: &&Value| {
            let title = layer.get("name").and_then(Value::as_str).unwrap_or_default();
            let title = if title == "RGB" { "" } else { title };
            LayerFile::Array.name(title) == name
        };
        let layer = value.get("layers")?.as_array()?.iter().find(is_own)?;
        let meaning = |key: &str| layer.get("meaning")?.get(key)?.as_str();
        let mut own = Self::of(|key| value.get("header")?.get(key)?.as_str());
        // The header speaks of the picture's light, and so of no other layer.
        let is_light = ["picture.npy", "spectrum.npy"].contains(&name);
        let unit = own.unit.filter(|_| is_light);
        own.unit = unit.or_else(|| meaning("unit").map(str::to_owned));
        own.edges = meaning("band edges nm").and_then(|edges| serde_json::from_str(edges).ok());
        Some((own, json))
    }
}

impl LightImage {
    /// Reads the picture at `path`; of an ENVI cube either of its two files is named. `wavelengths` are the
    /// middles of the bands (nm) of an array that does not say them; `memory` (bytes) is how much may be taken in
    /// all, or what the system has free.
    ///
    /// # Errors
    ///
    /// When it cannot be read, is no picture of light, takes more memory, or its bands make no sense.
    pub fn open(
        path: &Path,
        wavelengths: Option<&[f64]>,
        memory: Option<u64>,
    ) -> Result<Self, Error> {
        let limits = Limits::within(memory);
        let refused = |why: String| refused(path, why);
        let head =
            etendue_files::read_head(path, 16).map_err(|error| refused(error.to_string()))?;
        let is_npy = head.starts_with(b"\x93NUMPY");
        if wavelengths.is_some() && !is_npy {
            let why = "wavelengths are given for NPY arrays, which do not say them; this file says its own";
            return Err(refused(why.to_owned()));
        }
        if is_npy {
            return Self::of_array(path, wavelengths, memory).map_err(refused);
        }
        if envi::is_header(&head) || envi::is_data(path) {
            let (cube, inputs) = read_envi(path, limits)?;
            return Self::of_cube(path, inputs, cube).map_err(refused);
        }
        let bytes =
            etendue_files::read(path, MOST_BYTES).map_err(|error| refused(error.to_string()))?;
        let inputs = vec![path.to_owned()];
        if etendue_image::is_exr(&bytes) {
            let channels = etendue_image::exr_channels(&bytes, limits);
            let channels = channels.map_err(|error| refused(error.to_string()))?;
            if cube::is_spectral(&channels) {
                let cube = Cube::from_exr(channels).map_err(|error| refused(error.to_string()))?;
                let cube = cube.ok_or_else(|| refused("has no spectral channels".to_owned()))?;
                return Self::of_cube(path, inputs, cube).map_err(refused);
            }
            return Self::of_colors(path, channels).map_err(refused);
        }
        let raster = etendue_image::decode(&bytes, limits);
        let raster = raster.map_err(|error| {
            refused(format!(
                "{error}\nhint: pictures of light are EXR, NPY, ENVI and Radiance files"
            ))
        })?;
        if !matches!(raster.samples(), Samples::F16(_) | Samples::F32(_)) {
            let why = "holds codes for a screen and no light; pictures of light are EXR, NPY, ENVI and Radiance \
                       files";
            return Err(refused(why.to_owned()));
        }
        #[expect(clippy::cast_possible_truncation, reason = "values of f32 or less")]
        let plane = |k: usize| (0..raster.len()).map(|i| raster.texel(i)[k] as f32).collect();
        let light = PixelLight::Colors([plane(0), plane(1), plane(2)]);
        Ok(Self::new(
            path,
            inputs,
            PictureLight { size: raster.size(), light },
            ImageMetadata::default(),
        ))
    }

    fn new(
        path: &Path,
        inputs: Vec<PathBuf>,
        picture: PictureLight,
        sidecar: ImageMetadata,
    ) -> Self {
        let ImageMetadata { unit, noise_seed, solid_angle, pixel_pitch, edges: _ } = sidecar;
        let (path, notes) = (path.to_owned(), Vec::new());
        let quantity = Quantity::Light;
        Self { path, inputs, picture, quantity, unit, noise_seed, solid_angle, pixel_pitch, notes }
    }

    fn of_cube(path: &Path, inputs: Vec<PathBuf>, cube: Cube) -> Result<Self, String> {
        let entry = |key: &str| {
            let names = [format!("etendue:{key}"), format!("etendue {key}")];
            names.iter().find_map(|name| cube.texts.get(name)).map(String::as_str)
        };
        let mut sidecar = ImageMetadata::of(entry);
        sidecar.unit = cube.unit.clone().filter(|unit| !unit.is_empty()).or(sidecar.unit);
        let film = film(&cube.axis, cube.values)?;
        let picture = PictureLight { size: cube.size, light: PixelLight::Bands(film) };
        let mut image = Self::new(path, inputs, picture, sidecar);
        (image.quantity, image.notes) = (cube.quantity, cube.notes);
        Ok(image)
    }

    /// The colours, or the grey, of an EXR file.
    fn of_colors(path: &Path, channels: ExrChannels) -> Result<Self, String> {
        let mut sidecar = ImageMetadata::of(|key| {
            channels.texts.get(&format!("etendue:{key}")).map(String::as_str)
        });
        let meaning = channels.texts.get("etendue:RGB");
        let meaning = meaning.and_then(|text| serde_json::from_str::<Value>(text).ok());
        let unit = meaning.as_ref().and_then(|value| value.get("unit")?.as_str());
        sidecar.unit = sidecar.unit.or_else(|| unit.map(str::to_owned));
        let names = || channels.planes.iter().map(|(name, _)| name.as_str());
        let has = |wanted: &str| names().any(|name| name == wanted);
        let wanted = match ["R", "G", "B"].iter().all(|name| has(name)) {
            true => ["R", "G", "B"],
            false if has("Y") => ["Y"; 3],
            false => {
                let names: Vec<&str> = names().take(8).collect();
                return Err(format!(
                    "has neither the channels R, G and B, nor Y, nor those of a spectral image (S0.550,0nm), but {}",
                    names.join(", ")
                ));
            }
        };
        let plane = |wanted: &str| {
            let found = channels.planes.iter().find(|(name, _)| name == wanted);
            match found.map(|(_, plane)| plane) {
                Some(Plane::F32(values)) => values.clone(),
                #[expect(clippy::cast_precision_loss, reason = "light is no number of things")]
                Some(Plane::U32(values)) => values.iter().map(|&value| value as f32).collect(),
                None => Vec::new(),
            }
        };
        let light = PixelLight::Colors(wanted.map(plane));
        let picture = PictureLight { size: channels.size, light };
        Ok(Self::new(path, vec![path.to_owned()], picture, sidecar))
    }

    /// An NPY array: rows and columns of one number, of three, or of one a band.
    fn of_array(
        path: &Path,
        wavelengths: Option<&[f64]>,
        memory: Option<u64>,
    ) -> Result<Self, String> {
        let map = MappedFile::open(path).map_err(|error| error.to_string())?;
        let array = npy::read(map.bytes(), |shape| match shape {
            [0, ..] | [_, 0, ..] | [_, _, 0] => {
                Err(format!("has no value: its shape is {shape:?}"))
            }
            [rows, columns] | [rows, columns, _] if *rows <= 65_535 && *columns <= 65_535 => {
                let depth = shape.get(2).copied().unwrap_or(1);
                let values = (*rows as u64 * *columns as u64).saturating_mul(depth as u64);
                // As it is read, and as films hold it.
                let bytes = values.saturating_mul((size_of::<f64>() + size_of::<f32>()) as u64);
                fits(memory, bytes, [*columns, *rows, depth])
            }
            other => Err(format!(
                "has the shape {other:?} instead of rows × columns or rows × columns × bands, of at most 65535 a \
                 side"
            )),
        })?;
        let (sidecar, json) = ImageMetadata::of_array(path).unzip();
        let sidecar = sidecar.unwrap_or_default();
        let inputs = [path.to_owned()].into_iter().chain(json).collect();
        Self::of_numbers(path, inputs, array, wavelengths, sidecar)
    }

    /// Values of `[row][column]`, `[row][column][red, green, blue]` or, with `wavelengths` (nm), `[row][column][band]`.
    /// `name` stands for its file.
    ///
    /// # Errors
    ///
    /// When the shape is another, or the bands make no sense.
    pub fn from_array(
        name: &Path,
        array: npy::Array,
        wavelengths: Option<&[f64]>,
    ) -> Result<Self, Error> {
        Self::of_numbers(name, Vec::new(), array, wavelengths, ImageMetadata::default())
            .map_err(|why| refused(name, why))
    }

    fn of_numbers(
        path: &Path,
        inputs: Vec<PathBuf>,
        array: npy::Array,
        wavelengths: Option<&[f64]>,
        sidecar: ImageMetadata,
    ) -> Result<Self, String> {
        let (rows, columns, depth) = match array.shape.as_slice() {
            &[rows, columns] => (rows, columns, 1),
            &[rows, columns, depth] => (rows, columns, depth),
            other => {
                return Err(format!("has the shape {other:?} instead of rows × columns × bands"));
            }
        };
        let axis = match (wavelengths, &sidecar.edges) {
            (Some(list), _) => {
                let nm = cube::in_nanometres(list.to_vec(), None)?;
                Some(cube::BandAxis::new(nm, None)?)
            }
            (None, Some(edges)) => Some(cube::BandAxis::between(edges.clone())?),
            (None, None) => None,
        };
        #[expect(clippy::cast_possible_truncation, reason = "films hold f32")]
        let at = |value: &f64| *value as f32;
        let light = match (axis, depth) {
            (Some(axis), _) if axis.len() == depth => {
                PixelLight::Bands(film(&axis, array.numbers.iter().map(at).collect())?)
            }
            (Some(axis), _) => {
                return Err(format!("has {depth} bands, and {} wavelengths are given", axis.len()));
            }
            (None, 1 | 3) => {
                let plane = |k: usize| -> Vec<f32> {
                    array.numbers.iter().skip(k.min(depth - 1)).step_by(depth).map(at).collect()
                };
                PixelLight::Colors([plane(0), plane(1), plane(2)])
            }
            (None, _) => {
                return Err(format!(
                    "has {depth} values a pixel and does not say at which wavelengths\nhint: give them (nm), as \
                     --wavelengths 400,410,…"
                ));
            }
        };
        Ok(Self::new(path, inputs, PictureLight { size: [columns, rows], light }, sidecar))
    }

    /// The pictures of a folder with the numbers of their frames: those in it of one kind, by their names; of a folder
    /// that a render wrote, its picture or those of its frames.
    ///
    /// # Errors
    ///
    /// When there is none, or they are of several kinds.
    pub fn in_folder(folder: &Path) -> Result<Vec<(u32, PathBuf)>, Error> {
        let listed = |folder: &Path| -> Result<Vec<PathBuf>, Error> {
            let entries =
                fs::read_dir(folder).map_err(|error| refused(folder, error.to_string()))?;
            let mut paths: Vec<PathBuf> =
                entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
            paths.sort();
            Ok(paths)
        };
        // What a render left: the EXR has the most.
        let rendered = |folder: &Path| {
            let names = ["layers.exr", "spectrum.hdr", "spectrum.npy", "picture.npy"];
            let is_render = folder.join("layers.json").is_file();
            names.iter().map(|name| folder.join(name)).find(|path| is_render && path.is_file())
        };
        if let Some(path) = rendered(folder) {
            return Ok(vec![(0, path)]);
        }
        let frames = folder.join("frames");
        if frames.is_dir() {
            let number = |path: &PathBuf| path.file_name()?.to_str()?.parse().ok();
            let of = |path: PathBuf| Some((number(&path)?, rendered(&path)?));
            let found: Vec<(u32, PathBuf)> = listed(&frames)?.into_iter().filter_map(of).collect();
            if !found.is_empty() {
                return Ok(found);
            }
        }
        let ending = |path: &PathBuf| Some(path.extension()?.to_str()?.to_ascii_lowercase());
        let known = |path: &PathBuf| {
            ending(path).filter(|ending| ["exr", "npy", "hdr"].contains(&ending.as_str()))
        };
        let mut paths = listed(folder)?;
        paths.retain(|path| path.is_file() && known(path).is_some());
        let mut kinds: Vec<String> = paths.iter().filter_map(known).collect();
        kinds.sort();
        kinds.dedup();
        match kinds.len() {
            0 => Err(refused(
                folder,
                "has no picture of light in it: EXR, NPY, ENVI or Radiance files".to_owned(),
            )),
            1 => Ok((0..).zip(paths).collect()),
            _ => Err(refused(
                folder,
                format!(
                    "has pictures of several kinds in it (.{})\nhint: give each kind a folder",
                    kinds.join(", .")
                ),
            )),
        }
    }

    /// Columns and rows.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        self.picture.size
    }

    /// Light of each pixel.
    #[must_use]
    pub fn light(&self) -> &PixelLight {
        &self.picture.light
    }

    /// The unit of the values in the words of the file.
    #[must_use]
    pub fn unit(&self) -> Option<&str> {
        self.unit.as_deref()
    }

    /// Notes for the user.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }
}

/// The film of a cube.
fn film(axis: &cube::BandAxis, values: Vec<f32>) -> Result<BandFilm, String> {
    let grid = Grid::from_edges(axis.edges().to_vec()).map_err(|error| error.to_string())?;
    Ok(BandFilm { bands: Bands::Spectral(grid), values, parts: Vec::new() })
}

/// The ENVI cube of which `path` is one of the two files, and both.
pub(crate) fn read_envi(path: &Path, limits: Limits) -> Result<(Cube, Vec<PathBuf>), Error> {
    let partner = |names: Vec<PathBuf>| Ok(names.into_iter().find(|name| name.is_file()));
    etendue_scene::read_envi(path, path, limits, partner)
        .map_err(|fault| refused(&fault.path, fault.why))
}

/// Refuses to take so many bytes for a picture of so many columns, rows and values a pixel.
fn fits(memory: Option<u64>, bytes: u64, [columns, rows, depth]: [usize; 3]) -> Result<(), String> {
    let taken = Budget::new(memory).take(bytes.saturating_add(BESIDE));
    taken.map_err(|error| {
        format!("a picture of {columns} x {rows} pixels of {depth} values {error}")
    })
}

fn refused(path: &Path, why: impl std::fmt::Display) -> Error {
    Error::Refused(format!("{}: {why}", path.display()))
}
