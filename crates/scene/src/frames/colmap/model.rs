//! COLMAP's camera models (`src/colmap/sensor/models.h`), as pinholes with OpenCV's distortion.

use super::super::intrinsics::{FileCamera, distortion};

/// A camera model.
#[derive(Debug, Clone, Copy)]
pub(super) struct Model {
    /// Its number in binary files.
    number: i32,
    /// Its name in text files.
    pub(super) name: &'static str,
    /// Focal lengths: 1 of both axes, or 2.
    focals: usize,
    bend: Bend,
}

/// What a model does beside a pinhole.
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

const MODELS: [Model; 12] = [
    Model { number: 0, name: "SIMPLE_PINHOLE", focals: 1, bend: Bend::Nothing },
    Model { number: 1, name: "PINHOLE", focals: 2, bend: Bend::Nothing },
    Model { number: 2, name: "SIMPLE_RADIAL", focals: 1, bend: Bend::BrownConrady(&["k1"]) },
    Model { number: 3, name: "RADIAL", focals: 1, bend: Bend::BrownConrady(&["k1", "k2"]) },
    Model {
        number: 4,
        name: "OPENCV",
        focals: 2,
        bend: Bend::BrownConrady(&["k1", "k2", "p1", "p2"]),
    },
    Model {
        number: 5,
        name: "OPENCV_FISHEYE",
        focals: 2,
        bend: Bend::Fisheye(&["k1", "k2", "k3", "k4"]),
    },
    Model {
        number: 6,
        name: "FULL_OPENCV",
        focals: 2,
        bend: Bend::BrownConrady(&["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"]),
    },
    Model { number: 7, name: "FOV", focals: 2, bend: Bend::Unknown(1) },
    Model { number: 8, name: "SIMPLE_RADIAL_FISHEYE", focals: 1, bend: Bend::Fisheye(&["k1"]) },
    Model { number: 9, name: "RADIAL_FISHEYE", focals: 1, bend: Bend::Fisheye(&["k1", "k2"]) },
    Model { number: 10, name: "THIN_PRISM_FISHEYE", focals: 2, bend: Bend::Unknown(8) },
    Model { number: 11, name: "RAD_TAN_THIN_PRISM_FISHEYE", focals: 2, bend: Bend::Unknown(12) },
];

impl Model {
    /// The model of this name; the error says which are known.
    pub(super) fn by_name(name: &str) -> Result<Self, String> {
        let found = MODELS.into_iter().find(|model| model.name == name);
        found.ok_or_else(|| unknown(name))
    }

    /// The model of this number.
    pub(super) fn by_number(number: i32) -> Result<Self, String> {
        let found = MODELS.into_iter().find(|model| model.number == number);
        found.ok_or_else(|| unknown(&format!("model {number}")))
    }

    /// How many parameters it has.
    pub(super) fn count(self) -> usize {
        let coefficients = match self.bend {
            Bend::Nothing => 0,
            Bend::BrownConrady(keys) | Bend::Fisheye(keys) => keys.len(),
            Bend::Unknown(count) => count,
        };
        self.focals + 2 + coefficients
    }

    /// The camera of these parameters, of which there are [`count`](Self::count).
    pub(super) fn camera(
        self,
        resolution: [u32; 2],
        parameters: &[f64],
    ) -> Result<FileCamera, String> {
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
    let is_known = |model: &Model| !matches!(model.bend, Bend::Unknown(_));
    let known: Vec<&str> = MODELS.iter().filter(|m| is_known(m)).map(|model| model.name).collect();
    format!(
        "a {what} camera; known: {}. `colmap image_undistorter` makes PINHOLE cameras of the others",
        known.join(", ")
    )
}
