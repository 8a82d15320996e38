//! Files that somebody wants to look at, by what they are; an image file by itself: its layers, how each is shown, and the values of its pixels.

use std::path::Path;

use etendue_image::{Cube, ExrChannels, Limits, MOST_BYTES, Plane, Raster, Samples, cube, envi};
use etendue_render::expose::{BandFilm, SPECTRUM};
use etendue_render::output::{Channel, HeaderEntry, Layer, Look, Picture, Screen, Values};
use etendue_scene::file::{FileKind, is_lens};
use etendue_spectrum::{Bands, Grid};
use etendue_tracer::LayerSpec;
use serde_json::Value;

use crate::lens_view::through;
use crate::light_image::read_envi;
use crate::preview::layer_reading;
use crate::{Error, Options, Session};

/// A file that was opened to be looked at, by what it is.
#[derive(Debug)]
pub enum ViewedFile {
    /// A scene.
    Scene(Box<Session>),
    /// A model, in a scene that frames it.
    Model(Box<Session>),
    /// A lens file or a Zemax file, in a scene that looks through it at a board of squares.
    Lens(Box<Session>),
    /// An image.
    Image(Box<Still>),
}

impl ViewedFile {
    /// Opens the file at `path`: images and Zemax files are told by their endings, lens files by what is in
    /// them, all others as by [`Session::open_with`]. Settings are of scenes, models and lenses.
    ///
    /// # Errors
    ///
    /// When the file cannot be read or makes no sense as what it is, and when a lens by itself makes no
    /// picture.
    pub fn open(path: &Path, options: Options) -> Result<Self, Error> {
        if Still::is_named(path) {
            return Still::open(path).map(|still| Self::Image(Box::new(still)));
        }
        if is_lens(path) {
            return through(path, options).map(|session| Self::Lens(Box::new(session)));
        }
        let session = Box::new(Session::open_with(path, options)?);
        Ok(match session.file().kind() {
            FileKind::Model => Self::Model(session),
            FileKind::Scene => Self::Scene(session),
        })
    }
}

/// The layer of the bands of reflectance or transmittance of a spectral image.
const REFLECTANCE: &str = "T";

/// An image file (EXR, Radiance, PNG, JPEG, ENVI cubes) with its layers.
#[derive(Debug)]
pub struct Still {
    picture: Picture,
    /// The texels as the file has them, where those are integers.
    codes: Option<Raster>,
    notes: Vec<String>,
}

impl Still {
    /// True if a file's name ends like that of an image.
    #[must_use]
    pub fn is_named(path: &Path) -> bool {
        let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
        let known = ["exr", "hdr", "png", "jpg", "jpeg"];
        known.iter().any(|known| ending.eq_ignore_ascii_case(known)) || envi::is_data(path)
    }

    /// Reads the image at `path`: of an EXR file all channels, in layers by what stands before their last
    /// dot.
    ///
    /// # Errors
    ///
    /// When it cannot be read, is no image, or takes more than 2 GiB.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let refused = |why: String| Error::Refused(format!("{}: {why}", path.display()));
        let bytes =
            etendue_files::read(path, MOST_BYTES).map_err(|error| refused(error.to_string()))?;
        let limits = Limits::default();
        if envi::is_header(&bytes) || envi::is_data(path) {
            let (cube, _) = read_envi(path, Limits::default())?;
            return Self::of_cube(cube).map_err(|error| refused(error.to_string()));
        }
        if etendue_image::is_exr(&bytes) {
            let channels = etendue_image::exr_channels(&bytes, limits);
            return Self::of_channels(channels.map_err(|error| refused(error.to_string()))?)
                .map_err(|error| refused(error.to_string()));
        }
        let raster = etendue_image::decode(&bytes, limits);
        Self::of_raster(raster.map_err(|error| refused(error.to_string()))?)
            .map_err(|error| refused(error.to_string()))
    }

    fn of_channels(channels: ExrChannels) -> Result<Self, Error> {
        let [width, height] = channels.size;
        let (mut layers, mut missing) = (Vec::<Layer>::new(), 0);
        for (full_name, mut plane) in channels.planes {
            let (name, channel) = place_of(&full_name);
            let (title, channel) = match spectral_place(&full_name) {
                Some((title, channel)) => (title.to_owned(), channel),
                None => (fit(name), fit(channel)),
            };
            missing += without_nan(&mut plane);
            let values = match plane {
                Plane::F32(values) => Values::F32(values),
                Plane::U32(values) => Values::U32(values),
            };
            let meaning = meaning(channels.texts.get(&format!("etendue:{title}")));
            let channel = Channel { name: channel, values };
            match layers.iter_mut().find(|layer| layer.name == title) {
                Some(layer) => layer.channels.push(channel),
                None => layers.push(Layer {
                    name: title,
                    look: Look::Cube,
                    channels: vec![channel],
                    meaning,
                }),
            }
        }
        layers.iter_mut().for_each(arrange);
        // The picture comes first.
        layers.sort_by_key(|layer| !layer.name.is_empty());
        let picture = Picture::new(width, height, layers, Vec::new()).map_err(in_words)?;
        let notes = match missing {
            0 => Vec::new(),
            _ => vec![missing_values(missing)],
        };
        Ok(Self { picture, codes: None, notes })
    }

    /// The bands, and what they look like in red, green and blue.
    fn of_cube(cube: Cube) -> Result<Self, Error> {
        let [width, height] = cube.size;
        let grid = Grid::from_edges(cube.axis.edges().to_vec()).map_err(in_words)?;
        let film =
            BandFilm { bands: Bands::Spectral(grid), values: cube.values, parts: Vec::new() };
        let (count, mut missing) = (cube.axis.len(), 0);
        let channel = |(k, nm): (usize, &f64)| {
            let mut plane =
                Plane::F32(film.values.iter().skip(k).step_by(count).copied().collect());
            missing += without_nan(&mut plane);
            let Plane::F32(values) = plane else { return Vec::new() };
            vec![Channel { name: band_name(*nm), values: Values::F32(values) }]
        };
        let channels = cube.axis.wavelengths().iter().enumerate().flat_map(channel).collect();
        let meaning = cube.unit.map(|unit| HeaderEntry::new("unit", unit)).into_iter().collect();
        let bands = Layer { name: SPECTRUM.to_owned(), look: Look::Cube, channels, meaning };
        let finite = |value: &f32| if value.is_finite() { *value } else { 0.0 };
        let values = film.values.iter().map(finite).collect();
        let colors = BandFilm { bands: film.bands.clone(), values, parts: Vec::new() }
            .colors()
            .map_err(in_words)?;
        let channels = ["R", "G", "B"].into_iter().zip(colors);
        let channels = channels
            .map(|(name, plane)| Channel { name: name.to_owned(), values: Values::F32(plane) })
            .collect();
        let light = Layer { name: String::new(), look: Look::Color, channels, meaning: Vec::new() };
        let picture = Picture::new(width, height, vec![light, bands], Vec::new());
        let mut notes = cube.notes;
        notes.extend((missing > 0).then(|| missing_values(missing)));
        Ok(Self { picture: picture.map_err(in_words)?, codes: None, notes })
    }

    fn of_raster(raster: Raster) -> Result<Self, Error> {
        let [width, height] = raster.size();
        let names: &[&str] = if raster.channels() < 3 { &["Y"] } else { &["R", "G", "B"] };
        let channel = |(k, name): (usize, &&str)| {
            #[expect(clippy::cast_possible_truncation, reason = "light of a file of f32 or less")]
            let light = (0..raster.len()).map(|i| raster.linear(i)[k] as f32);
            Channel { name: (*name).to_owned(), values: Values::F32(light.collect()) }
        };
        let channels = names.iter().enumerate().map(channel).collect();
        let light = Layer { name: String::new(), look: Look::Color, channels, meaning: Vec::new() };
        let picture = Picture::new(width, height, vec![light], Vec::new()).map_err(in_words)?;
        let codes = (!raster.is_float()).then_some(raster);
        Ok(Self { picture, codes, notes: Vec::new() })
    }

    /// The layers, the picture first where there is one; its name is empty.
    #[must_use]
    pub fn layers(&self) -> &[Layer] {
        self.picture.layers()
    }

    /// Columns and rows.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        [self.picture.width(), self.picture.height()]
    }

    /// The file's own integers, where it has them: those of each channel but alpha, with its name.
    #[must_use]
    pub fn numbers(&self) -> Option<Vec<(String, Vec<f64>)>> {
        let raster = self.codes.as_ref()?;
        let channels = self.layers().first()?.channels.iter().enumerate();
        let full = if matches!(raster.samples(), Samples::U8(_)) { 255.0 } else { 65_535.0 };
        let values =
            |k: usize| (0..raster.len()).map(|i| (raster.texel(i)[k] * full).round()).collect();
        Some(channels.map(|(k, channel)| (channel.name.clone(), values(k))).collect())
    }

    /// Notes for the user.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// A layer for a screen; the picture's name is empty.
    ///
    /// # Errors
    ///
    /// When there is no such layer.
    pub fn screen(&self, layer: &str) -> Result<Screen, Error> {
        Ok(Screen::of_layer(&self.picture, layer)?)
    }

    /// Reads the file's values at column and row coordinates `place` (pixels): names and values with their units; of
    /// integers the numbers themselves beside their linear light. Empty outside of the picture.
    #[must_use]
    pub fn reading(&self, place: [f64; 2]) -> Vec<(String, String)> {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below 0 is 0")]
        let [x, y] = place.map(|at| at.floor() as usize);
        let (width, height) = (self.picture.width(), self.picture.height());
        if x >= width || y >= height {
            return Vec::new();
        }
        let i = y * width + x;
        let codes = self.codes.as_ref().map(|raster| ("file".to_owned(), codes_at(raster, i)));
        let layers = self.layers().iter().map(|layer| layer_reading(layer, i));
        codes.into_iter().chain(layers).collect()
    }
}

/// The layer and the channel of a full name: `Depth` and `Z`; R, G and B by themselves are the picture's,
/// and any other channel without a layer is one of its own.
fn place_of(full_name: &str) -> (&str, &str) {
    match full_name.rsplit_once('.') {
        Some(place) => place,
        None if ["R", "G", "B"].contains(&full_name) => ("", full_name),
        None => (full_name, full_name),
    }
}

/// Layer and channel name of a channel of a spectral image, named as this program names its bands.
fn spectral_place(full_name: &str) -> Option<(&'static str, String)> {
    let (component, nm) = cube::spectral_channel(full_name)?;
    let layer = match component {
        cube::Component::Stokes(0) => SPECTRUM,
        cube::Component::Reflectance => REFLECTANCE,
        cube::Component::Stokes(_) => return None,
    };
    Some((layer, band_name(nm)))
}

/// `552_5nm`: to a thousandth of a nanometre, as [`Bands::names`] has it.
fn band_name(nm: f64) -> String {
    fit(&format!("{}nm", (nm * 1e3).round() / 1e3).replace('.', "_"))
}

/// The wavelength (nm) in such a name.
fn wavelength(name: &str) -> f64 {
    let number = name.strip_suffix("nm").map(|nm| nm.replace('_', "."));
    number.and_then(|nm| nm.parse().ok()).unwrap_or(f64::INFINITY)
}

fn missing_values(count: usize) -> String {
    format!("{count} values are no numbers (NaN); they count as infinite")
}

/// A name as layers may have it: letters, digits and `.`, `_`, `-`, at most 60.
fn fit(name: &str) -> String {
    let is_fit = |c: char| c.is_ascii_alphanumeric() || "._-".contains(c);
    let kept = name.chars().take(60).map(|c| if is_fit(c) { c } else { '_' });
    kept.collect()
}

/// Makes NaN infinite; how many there were.
fn without_nan(plane: &mut Plane) -> usize {
    let Plane::F32(values) = plane else { return 0 };
    let missing = values.iter_mut().filter(|value| value.is_nan());
    missing.map(|value| *value = f32::INFINITY).count()
}

/// The unit that this program's files state of a layer, as JSON.
fn meaning(text: Option<&String>) -> Vec<HeaderEntry> {
    let value = text.and_then(|text| serde_json::from_str::<Value>(text).ok());
    let unit = value.as_ref().and_then(|value| value.get("unit")?.as_str());
    unit.map(|unit| HeaderEntry::new("unit", unit)).into_iter().collect()
}

/// Look of a layer of this name, by the table of layers; other programs' layers are told by their channels.
fn look_by_name(name: &str) -> Option<Look> {
    if name.starts_with(SPECTRUM) || name == REFLECTANCE {
        return Some(Look::Cube);
    }
    LayerSpec::from_file_name(name).map(|spec| spec.row().look)
}

/// Puts a layer's channels in order, and chooses how it is shown.
fn arrange(layer: &mut Layer) {
    let is_colour = layer.channels.iter().all(|channel| "RGBAY".contains(&*channel.name));
    if is_colour {
        layer.channels.sort_by_key(|channel| "RGBA".find(&*channel.name));
        // How much a pixel covers is no colour.
        layer.channels.truncate(3);
    }
    if [SPECTRUM, REFLECTANCE].contains(&&*layer.name) {
        // An EXR file has them in the order of their names.
        layer.channels.sort_by(|a, b| wavelength(&a.name).total_cmp(&wavelength(&b.name)));
    }
    let count = layer.channels.len();
    let own = match count {
        3 if is_colour => Look::Color,
        1 if layer.name == "Y" => Look::Color,
        1..=3 => Look::Extent,
        _ => Look::Cube,
    };
    let look = look_by_name(&layer.name).filter(|look| match look {
        Look::Distance | Look::Share => count == 1,
        Look::Direction => count == 3,
        Look::Color => count == 3 && is_colour,
        Look::Extent => (1..=3).contains(&count),
        Look::Ids | Look::Cube | Look::Counts { .. } => true,
    });
    layer.look = look.unwrap_or(own);
    let is_float = layer.channels.iter().any(|channel| matches!(channel.values, Values::F32(_)));
    if layer.look == Look::Ids || (is_float && layer.type_name() != "f4") || count > 1 {
        unite(layer, is_float);
    }
}

/// Makes the channels of a layer of one type: integers for ids, else floats where one of them is.
fn unite(layer: &mut Layer, is_float: bool) {
    let ids = layer.look == Look::Ids;
    for channel in &mut layer.channels {
        let values = &channel.values;
        let all = (0..values.len()).map(|i| values.at(i));
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let united = match (values, ids, is_float) {
            (Values::F32(_), true, _) => Values::U32(all.map(|value| value as u32).collect()),
            (Values::U32(_), false, true) => Values::F32(all.map(|value| value as f32).collect()),
            _ => continue,
        };
        channel.values = united;
    }
}

fn codes_at(raster: &Raster, i: usize) -> String {
    let first = i * raster.channels();
    let range = first..first + raster.channels();
    let (codes, full): (Vec<String>, u32) = match raster.samples() {
        Samples::U8(values) => (values[range].iter().map(u8::to_string).collect(), 255),
        Samples::U16(values) => (values[range].iter().map(u16::to_string).collect(), 65_535),
        Samples::F16(_) | Samples::F32(_) => (Vec::new(), 1),
    };
    format!("{} of {full}", codes.join(", "))
}

fn in_words(error: impl std::fmt::Display) -> Error {
    Error::Refused(error.to_string())
}
