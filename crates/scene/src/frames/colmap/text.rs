//! COLMAP's text: `images.txt` and `cameras.txt`.

use super::super::trajectory::numbers;
use super::model::Model;
use super::{Cameras, Image};

/// How far from 1 the length of an image's quaternion may be. COLMAP writes all digits.
const UNIT: f64 = 1e-3;

/// `IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME`, each followed by a line of points
/// `X, Y, POINT3D_ID, …`, which may be empty and which some tools leave out: a line after an image is of points
/// when it is empty, or its words come in threes of two numbers and a whole one; else it is the next image.
pub(in super::super) fn images(text: &str) -> Result<Vec<Image>, String> {
    let mut images = Vec::new();
    let lines = (1..).zip(text.lines()).filter(|(_, line)| !line.trim_start().starts_with('#'));
    let mut is_after_image = false;
    for (number, line) in lines {
        let words: Vec<&str> = line.split_whitespace().collect();
        let may_be_points = are_points(&words);
        match (may_be_points, may_be_image(&words)) {
            (true, true) if is_after_image => {
                return Err(format!(
                    "has line {number}, which may be an image and may be the points of the one before; \
                     write an empty line after each image, or rename this one"
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

/// Whether a line may be one of points.
fn are_points(words: &[&str]) -> bool {
    let is_number = |word: &str| word.parse::<f64>().is_ok();
    let is_point = |p: &[&str]| is_number(p[0]) && is_number(p[1]) && p[2].parse::<i128>().is_ok();
    words.len().is_multiple_of(3) && words.chunks(3).all(is_point)
}

/// Whether a line may be one of an image.
fn may_be_image(words: &[&str]) -> bool {
    image(words, 0).is_ok_and(|image| {
        let length: f64 = image.quaternion.iter().map(|q| q * q).sum::<f64>().sqrt();
        (length - 1.0).abs() < UNIT
    })
}

fn image(words: &[&str], number: usize) -> Result<Image, String> {
    let [id, pose @ .., camera, _] = &words[..words.len().min(10)] else {
        return Err(short(words, number));
    };
    if pose.len() != 7 {
        return Err(short(words, number));
    }
    whole(id, number)?;
    let [w, x, y, z, a, b, c] = numbers(pose, number)?;
    Ok(Image {
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
pub(in super::super) fn cameras(text: &str) -> Result<Cameras, String> {
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
        let model = Model::by_name(model).map_err(|why| format!("has in line {number} {why}"))?;
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
        true => Err("has no camera; export the model again, or remove the file".to_owned()),
        false => Ok(cameras),
    }
}

fn whole(word: &str, number: usize) -> Result<u32, String> {
    word.parse()
        .map_err(|_| format!("has \"{word}\" in line {number}, where a whole number is due"))
}
