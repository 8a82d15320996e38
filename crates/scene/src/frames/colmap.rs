//! COLMAP's sparse models, as text or binary: the poses of `images`, and the intrinsics of the `cameras` beside it
//! (<https://colmap.github.io/format.html>).
//!
//! COLMAP's binary files, in little-endian order: `images.bin` and `cameras.bin`
//! (`src/colmap/scene/reconstruction_io.cc`).
//!
//! COLMAP's camera models (`src/colmap/sensor/models.h`), as pinholes with OpenCV's distortion.
//!
//! COLMAP's text: `images.txt` and `cameras.txt`.

use std::collections::BTreeMap;

use super::frame::Station;
use super::transforms::{FileCamera, distortion};
use etendue_camera::{Convention, Maps, PoseSpec};

pub(super) use self::{
    cameras_in_binary as binary_cameras, cameras_in_text as text_cameras,
    images_in_binary as binary_images, images_in_text as text_images,
};

/// An image that was reconstructed.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ColmapImage {
    /// Place of the image in its file, as sentences go on: `in line 3`.
    place: String,
    /// World to camera, the real part first.
    quaternion: [f64; 4],
    /// World to camera.
    translation: [f64; 3],
    /// The number of its camera.
    camera: u32,
    name: String,
}

/// Cameras by their numbers.
pub(super) type Cameras = BTreeMap<u32, FileCamera>;

/// The images in the order of their names, as COLMAP's own tools have them; without `cameras` they have the
/// scene's. The error goes on after the name of the file of images.
pub(super) fn stations(
    mut images: Vec<ColmapImage>,
    cameras: Option<&Cameras>,
) -> Result<Vec<Station>, String> {
    images.sort_by(|a, b| a.name.cmp(&b.name));
    let station = |image: ColmapImage| {
        let ColmapImage { place, quaternion: [w, x, y, z], translation, camera, .. } = image;
        let pose = PoseSpec::Quaternion {
            quaternion: [x, y, z, w],
            translation,
            maps: Maps::CameraFromWorld,
            convention: Convention::Opencv,
        };
        let settings = match cameras.map(|cameras| cameras.get(&camera)) {
            None => Vec::new(),
            Some(Some(of)) => of
                .settings()
                .map_err(|why| format!("names camera {camera} {place}, which has {why}"))?,
            Some(None) => {
                return Err(format!(
                    "names camera {camera} {place}, and the file of cameras beside it has none of that number"
                ));
            }
        };
        Ok(Station { settings, ..Station::new(pose) })
    };
    images.into_iter().map(station).collect()
}

/// The bytes of a point that an image sees: two coordinates and a number.
const POINT_BYTES: u64 = 24;

/// The images. The error goes on after the file's name.
pub(in crate::frames) fn images_in_binary(bytes: &[u8]) -> Result<Vec<ColmapImage>, String> {
    let mut rest = ByteCursor { bytes, at: 0 };
    let mut images = Vec::new();
    for _ in 0..rest.long()? {
        let place = format!("at byte {}", rest.at);
        rest.word()?;
        let quaternion = rest.numbers()?;
        let translation = rest.numbers()?;
        let camera = rest.word()?;
        let name = rest.text()?;
        let points = rest.long()?;
        rest.skip(points.saturating_mul(POINT_BYTES))?;
        images.push(ColmapImage { place, quaternion, translation, camera, name });
    }
    rest.end()?;
    Ok(images)
}

/// The cameras. The error goes on after the file's name.
pub(in crate::frames) fn cameras_in_binary(bytes: &[u8]) -> Result<Cameras, String> {
    let mut rest = ByteCursor { bytes, at: 0 };
    let mut cameras = Cameras::new();
    for _ in 0..rest.long()? {
        let at = rest.at;
        let wrong = |why: String| format!("has at byte {at} {why}");
        let id = rest.word()?;
        let model = ColmapModel::by_number(i32::from_le_bytes(rest.take()?)).map_err(wrong)?;
        let mut side = || {
            let side = rest.long()?;
            u32::try_from(side)
                .map_err(|_| wrong(format!("a picture with a side of {side} pixels")))
        };
        let resolution = [side()?, side()?];
        let parameters =
            (0..model.count()).map(|_| rest.number()).collect::<Result<Vec<_>, _>>()?;
        cameras.insert(id, model.camera(resolution, &parameters).map_err(wrong)?);
    }
    rest.end()?;
    match cameras.is_empty() {
        true => Err("has no camera\nhint: export the model again, or remove the file".to_owned()),
        false => Ok(cameras),
    }
}

/// Cursor over bytes that are still to be read.
struct ByteCursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl ByteCursor<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let taken = self.bytes[self.at..].first_chunk().copied().ok_or_else(|| self.cut_off())?;
        self.at += N;
        Ok(taken)
    }

    fn cut_off(&self) -> String {
        format!("ends inside what begins at byte {}\nhint: copy it again", self.at)
    }

    fn word(&mut self) -> Result<u32, String> {
        self.take().map(u32::from_le_bytes)
    }

    fn long(&mut self) -> Result<u64, String> {
        self.take().map(u64::from_le_bytes)
    }

    fn number(&mut self) -> Result<f64, String> {
        let at = self.at;
        let number = f64::from_le_bytes(self.take()?);
        let fault = || format!("has {number} at byte {at}, where a finite number is due");
        number.is_finite().then_some(number).ok_or_else(fault)
    }

    fn numbers<const N: usize>(&mut self) -> Result<[f64; N], String> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = self.number()?;
        }
        Ok(numbers)
    }

    /// Text up to a byte of zero.
    fn text(&mut self) -> Result<String, String> {
        let rest = &self.bytes[self.at..];
        let length = rest.iter().position(|&byte| byte == 0).ok_or_else(|| self.cut_off())?;
        self.at += length + 1;
        Ok(String::from_utf8_lossy(&rest[..length]).into_owned())
    }

    fn skip(&mut self, count: u64) -> Result<(), String> {
        let left = (self.bytes.len() - self.at) as u64;
        let count = usize::try_from(count).ok().filter(|_| count <= left);
        self.at += count.ok_or_else(|| self.cut_off())?;
        Ok(())
    }

    fn end(&self) -> Result<(), String> {
        match self.bytes.len() - self.at {
            0 => Ok(()),
            more => Err(format!("has {more} bytes after its last entry; is it COLMAP's?")),
        }
    }
}

/// A camera model.
#[derive(Debug, Clone, Copy)]
struct ColmapModel {
    /// Its number in binary files.
    number: i32,
    /// Its name in text files.
    name: &'static str,
    /// Focal lengths: 1 of both axes, or 2.
    focals: usize,
    bend: Bend,
}

/// Distortion of a model beside a pinhole.
#[derive(Debug, Clone, Copy)]
enum Bend {
    Nothing,
    /// OpenCV's standard model, with these coefficients.
    BrownConrady(&'static [&'static str]),
    /// OpenCV's fisheye model.
    Fisheye(&'static [&'static str]),
    /// Something that no camera here does, with so many coefficients.
    Unknown(usize),
}

const MODELS: [ColmapModel; 12] = [
    ColmapModel { number: 0, name: "SIMPLE_PINHOLE", focals: 1, bend: Bend::Nothing },
    ColmapModel { number: 1, name: "PINHOLE", focals: 2, bend: Bend::Nothing },
    ColmapModel { number: 2, name: "SIMPLE_RADIAL", focals: 1, bend: Bend::BrownConrady(&["k1"]) },
    ColmapModel { number: 3, name: "RADIAL", focals: 1, bend: Bend::BrownConrady(&["k1", "k2"]) },
    ColmapModel {
        number: 4,
        name: "OPENCV",
        focals: 2,
        bend: Bend::BrownConrady(&["k1", "k2", "p1", "p2"]),
    },
    ColmapModel {
        number: 5,
        name: "OPENCV_FISHEYE",
        focals: 2,
        bend: Bend::Fisheye(&["k1", "k2", "k3", "k4"]),
    },
    ColmapModel {
        number: 6,
        name: "FULL_OPENCV",
        focals: 2,
        bend: Bend::BrownConrady(&["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"]),
    },
    ColmapModel { number: 7, name: "FOV", focals: 2, bend: Bend::Unknown(1) },
    ColmapModel {
        number: 8,
        name: "SIMPLE_RADIAL_FISHEYE",
        focals: 1,
        bend: Bend::Fisheye(&["k1"]),
    },
    ColmapModel {
        number: 9,
        name: "RADIAL_FISHEYE",
        focals: 1,
        bend: Bend::Fisheye(&["k1", "k2"]),
    },
    ColmapModel { number: 10, name: "THIN_PRISM_FISHEYE", focals: 2, bend: Bend::Unknown(8) },
    ColmapModel {
        number: 11,
        name: "RAD_TAN_THIN_PRISM_FISHEYE",
        focals: 2,
        bend: Bend::Unknown(12),
    },
];

impl ColmapModel {
    /// The model of this name; the error says which are known.
    fn by_name(name: &str) -> Result<Self, String> {
        let found = MODELS.into_iter().find(|model| model.name == name);
        found.ok_or_else(|| unknown(name))
    }

    /// The model of this number.
    fn by_number(number: i32) -> Result<Self, String> {
        let found = MODELS.into_iter().find(|model| model.number == number);
        found.ok_or_else(|| unknown(&format!("model {number}")))
    }

    /// Number of parameters.
    fn count(self) -> usize {
        let coefficients = match self.bend {
            Bend::Nothing => 0,
            Bend::BrownConrady(keys) | Bend::Fisheye(keys) => keys.len(),
            Bend::Unknown(count) => count,
        };
        self.focals + 2 + coefficients
    }

    /// The camera of these parameters, of which there are [`count`](Self::count).
    fn camera(self, resolution: [u32; 2], parameters: &[f64]) -> Result<FileCamera, String> {
        let (focals, rest) = parameters.split_at(self.focals);
        let (centre, coefficients) = rest.split_at(2);
        let of = |kind, keys: &[&'static str]| {
            distortion(kind, keys.iter().copied().zip(coefficients.iter().copied()))
        };
        let distortion = match self.bend {
            Bend::Nothing => None,
            Bend::BrownConrady(keys) => Some(of("brown_conrady", keys)),
            Bend::Fisheye(keys) => Some(of("fisheye", keys)),
            Bend::Unknown(_) => return Err(unknown(self.name)),
        };
        Ok(FileCamera {
            focal: [focals[0], focals[self.focals - 1]],
            centre: [centre[0], centre[1]],
            resolution: Some(resolution),
            distortion,
        })
    }
}

/// That there is no such camera here, with what there is.
fn unknown(what: &str) -> String {
    let is_known = |model: &ColmapModel| !matches!(model.bend, Bend::Unknown(_));
    let known: Vec<&str> = MODELS.iter().filter(|m| is_known(m)).map(|model| model.name).collect();
    format!(
        "a {what} camera\nhint: known: {}. `colmap image_undistorter` makes PINHOLE cameras of the others",
        known.join(", ")
    )
}

/// Tolerance of the length of an image's quaternion from 1. COLMAP writes all digits.
const UNIT: f64 = 1e-3;

/// `IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME`, each followed by a line of points
/// `X, Y, POINT3D_ID, …`, which may be empty and which some tools leave out: a line after an image is of points
/// when it is empty, or its words come in threes of two numbers and a whole one; else it is the next image.
pub(in crate::frames) fn images_in_text(text: &str) -> Result<Vec<ColmapImage>, String> {
    let mut images = Vec::new();
    let lines = (1..).zip(text.lines()).filter(|(_, line)| !line.trim_start().starts_with('#'));
    let mut is_after_image = false;
    for (number, line) in lines {
        let words: Vec<&str> = line.split_whitespace().collect();
        let may_be_points = are_points(&words);
        match (may_be_points, may_be_image(&words)) {
            (true, true) if is_after_image => {
                return Err(format!(
                    "has line {number}, which may be an image and may be the points of the one before\
                     \nhint: write an empty line after each image, or rename this one"
                ));
            }
            (true, false) if is_after_image => is_after_image = false,
            (true, false) if words.is_empty() => {}
            (true, false) => {
                return Err(format!(
                    "has a line of points, {number}, where an image is due: COLMAP's lines are an image's and \
                     its points' in turn"
                ));
            }
            (_, true) | (false, false) => {
                images.push(image(&words, number)?);
                is_after_image = true;
            }
        }
    }
    Ok(images)
}

/// True if a line may be one of points.
fn are_points(words: &[&str]) -> bool {
    let is_number = |word: &str| word.parse::<f64>().is_ok();
    let is_point = |p: &[&str]| is_number(p[0]) && is_number(p[1]) && p[2].parse::<i128>().is_ok();
    words.len().is_multiple_of(3) && words.chunks(3).all(is_point)
}

/// True if a line may be one of an image.
fn may_be_image(words: &[&str]) -> bool {
    image(words, 0).is_ok_and(|image| {
        let length: f64 = image.quaternion.iter().map(|q| q * q).sum::<f64>().sqrt();
        (length - 1.0).abs() < UNIT
    })
}

fn image(words: &[&str], number: usize) -> Result<ColmapImage, String> {
    let [id, pose @ .., camera, _] = &words[..words.len().min(10)] else {
        return Err(short(words, number));
    };
    if pose.len() != 7 {
        return Err(short(words, number));
    }
    whole(id, number)?;
    let [w, x, y, z, a, b, c] = numbers(pose, number)?;
    Ok(ColmapImage {
        place: format!("in line {number}"),
        quaternion: [w, x, y, z],
        translation: [a, b, c],
        camera: whole(camera, number)?,
        name: words[9..].join(" "),
    })
}

fn short(words: &[&str], number: usize) -> String {
    format!(
        "has {} words in line {number}; COLMAP's images have ten: id, qw, qx, qy, qz, tx, ty, tz, camera and \
         name",
        words.len()
    )
}

/// `CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]`. The error goes on after the file's name.
pub(in crate::frames) fn cameras_in_text(text: &str) -> Result<Cameras, String> {
    let mut cameras = Cameras::new();
    for (number, line) in (1..).zip(text.lines()) {
        let words: Vec<&str> = line.split_whitespace().collect();
        if words.first().is_none_or(|word| word.starts_with('#')) {
            continue;
        }
        let [id, model, width, height, parameters @ ..] = words.as_slice() else {
            return Err(format!(
                "has {} words in line {number}; COLMAP's cameras have id, model, width, height and \
                 parameters: export the model again",
                words.len()
            ));
        };
        let model =
            ColmapModel::by_name(model).map_err(|why| format!("has in line {number} {why}"))?;
        if parameters.len() != model.count() {
            return Err(format!(
                "has {} parameters in line {number}, where {} has {}",
                parameters.len(),
                model.name,
                model.count()
            ));
        }
        let parsed: [f64; 16] = numbers(parameters, number)?;
        let resolution = [whole(width, number)?, whole(height, number)?];
        let camera = model
            .camera(resolution, &parsed[..model.count()])
            .map_err(|why| format!("has in line {number} {why}"))?;
        if cameras.insert(whole(id, number)?, camera).is_some() {
            return Err(format!("has camera {id} a second time in line {number}"));
        }
    }
    match cameras.is_empty() {
        true => Err("has no camera\nhint: export the model again, or remove the file".to_owned()),
        false => Ok(cameras),
    }
}

fn whole(word: &str, number: usize) -> Result<u32, String> {
    word.parse()
        .map_err(|_| format!("has \"{word}\" in line {number}, where a whole number is due"))
}

/// Numbers of a line of text, all finite; 0 beyond its last.
pub(super) fn numbers<const N: usize>(words: &[&str], line: usize) -> Result<[f64; N], String> {
    let mut numbers = [0.0; N];
    for (number, word) in numbers.iter_mut().zip(words) {
        *number = word.parse().ok().filter(|value: &f64| value.is_finite()).ok_or_else(|| {
            format!("has \"{word}\" in line {line}, where a finite number is due")
        })?;
    }
    Ok(numbers)
}
