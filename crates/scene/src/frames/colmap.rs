//! COLMAP's text model: `images.txt`, and the intrinsics of `cameras.txt`
//! (<https://colmap.github.io/format.html>).

use std::collections::BTreeMap;

use etendue_camera::{Convention, Maps, PoseSpec};
use serde_json::{Value, json};

use super::intrinsics::pinhole;
use super::{Station, numbers};

/// `IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME`, each followed by a line of points. In the
/// order of the images' names, as COLMAP's own tools have them.
pub(super) fn read(images: &str, cameras: Option<&str>) -> Result<Vec<Station>, String> {
    let cameras = cameras.map(intrinsics).transpose()?.unwrap_or_default();
    let mut named = Vec::new();
    let mut lines =
        (1..).zip(images.lines()).filter(|(_, line)| !line.trim_start().starts_with('#'));
    while let Some((number, line)) = lines.next() {
        let words: Vec<&str> = line.split_whitespace().collect();
        if words.is_empty() {
            continue;
        }
        if words.len() < 10 {
            return Err(format!(
                "has {} words in line {number}; COLMAP's images have ten: id, qw, qx, qy, qz, tx, ty, \
                 tz, camera and name",
                words.len()
            ));
        }
        let [w, x, y, z, a, b, c] = numbers(&words[1..8], number)?;
        let pose = PoseSpec::Quaternion {
            quaternion: [x, y, z, w],
            translation: [a, b, c],
            maps: Maps::CameraFromWorld,
            convention: Convention::Opencv,
        };
        let settings = match cameras.get(words[8]) {
            Some(settings) => settings.clone(),
            None if cameras.is_empty() => Vec::new(),
            None => {
                return Err(format!(
                    "names camera {} in line {number}, and cameras.txt has none of that number",
                    words[8]
                ));
            }
        };
        named.push((words[9..].join(" "), Station { settings, ..Station::new(pose) }));
        // The points that the image sees.
        lines.next();
    }
    named.sort_by(|a, b| a.0.cmp(&b.0));
    Ok(named.into_iter().map(|(_, station)| station).collect())
}

type Settings = Vec<(String, Value)>;

/// `CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]`, as settings of a pinhole.
fn intrinsics(text: &str) -> Result<BTreeMap<&str, Settings>, String> {
    let mut cameras = BTreeMap::new();
    for (number, line) in (1..).zip(text.lines()) {
        let words: Vec<&str> = line.split_whitespace().collect();
        let [id, model, width, height, parameters @ ..] = words.as_slice() else { continue };
        if id.starts_with('#') {
            continue;
        }
        let wrong = |why: String| format!("stands beside a cameras.txt that {why}");
        let count = match *model {
            "SIMPLE_PINHOLE" => 3,
            "PINHOLE" | "SIMPLE_RADIAL" => 4,
            "RADIAL" => 5,
            "OPENCV" | "OPENCV_FISHEYE" => 8,
            "FULL_OPENCV" => 12,
            other => {
                return Err(wrong(format!(
                    "has a {other} camera in line {number}; known: SIMPLE_PINHOLE, PINHOLE, \
                     SIMPLE_RADIAL, RADIAL, OPENCV, OPENCV_FISHEYE, FULL_OPENCV"
                )));
            }
        };
        if parameters.len() != count {
            let found = parameters.len();
            return Err(wrong(format!(
                "has {found} parameters in line {number}, where {model} has {count}"
            )));
        }
        let mut p = [0.0; 12];
        let parsed: [f64; 12] = numbers(parameters, number).map_err(&wrong)?;
        p[..count].copy_from_slice(&parsed[..count]);
        let side = |word: &str| {
            word.parse::<u32>()
                .map_err(|_| wrong(format!("has no size in line {number}: \"{word}\"")))
        };
        let resolution = [side(width)?, side(height)?];
        let one_focal = matches!(*model, "SIMPLE_PINHOLE" | "SIMPLE_RADIAL" | "RADIAL");
        let (f, rest) = if one_focal { ([p[0]; 2], &p[1..]) } else { ([p[0], p[1]], &p[2..]) };
        let (c, d) = ([rest[0], rest[1]], &rest[2..]);
        let of = |kind: &str, keys: &[&str]| {
            let mut distortion = json!({ "type": kind });
            keys.iter().zip(d).for_each(|(key, k)| distortion[*key] = json!(k));
            Some(distortion)
        };
        // The order of OpenCV's vector.
        let brown = ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"];
        let distortion = match *model {
            "SIMPLE_RADIAL" => of("brown_conrady", &["k1"]),
            "RADIAL" => of("brown_conrady", &["k1", "k2"]),
            "OPENCV" => of("brown_conrady", &brown[..4]),
            "FULL_OPENCV" => of("brown_conrady", &brown),
            "OPENCV_FISHEYE" => of("fisheye", &["k1", "k2", "k3", "k4"]),
            _ => None,
        };
        cameras.insert(*id, pinhole((f, c), resolution, distortion));
    }
    Ok(cameras)
}
