//! Shapes that need no file: tessellated on load, the same on every machine and for any number of
//! threads.
//!
//! Round shapes are made of rings ([`globe`]) and have shared vertices, so they are closed. With
//! texture coordinates the vertices of one meridian exist twice, at the same place to the bit.

mod flat;
mod globe;
mod relief;
mod turn;

use etendue_camera::length::Metres;
use etendue_geometry::Mesh;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::import::Wanted;
use globe::Globe;
use relief::Relief;

/// The most triangles of a shape: 12 GiB of indices.
const MOST_TRIANGLES: u64 = 1 << 30;

/// A shape as the scene file writes it. All are centred on the origin of their own frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "shape", rename_all = "snake_case", deny_unknown_fields)]
pub enum ShapeSpec {
    /// A rectangle in the plane z = 0 that faces +Z. Texture coordinates start at its upper left.
    Rectangle {
        /// Along x (m).
        #[serde(default = "one_metre")]
        width: Metres,
        /// Along y (m).
        #[serde(default = "one_metre")]
        height: Metres,
    },
    /// A box along the axes. Each face has the whole range of texture coordinates.
    Box {
        /// Along x, y and z (m).
        #[serde(default = "one_metre_each")]
        size: [Metres; 3],
    },
    /// A sphere: rings of triangles whose corners are on it.
    Sphere {
        /// Its radius (m).
        #[serde(default = "one_metre")]
        radius: Metres,
        /// How many triangles, counted as for a blob.
        #[serde(default = "sphere_triangles")]
        triangles: u64,
    },
    /// A disk in the plane z = 0 that faces +Z: a polygon whose corners are on the circle.
    Disk {
        /// Its radius (m).
        #[serde(default = "one_metre")]
        radius: Metres,
        /// At least as many triangles, the next 4 n².
        #[serde(default = "disk_triangles")]
        triangles: u64,
    },
    /// A sphere with hills and valleys, closed, of any number of triangles.
    Blob {
        /// The mean radius (m).
        #[serde(default = "one_metre")]
        radius: Metres,
        /// How many triangles: exactly as many from 128 on, an odd number rounded up; the next
        /// 8 n² below.
        #[serde(default = "sphere_triangles")]
        triangles: u64,
        /// Which blob.
        #[serde(default)]
        seed: u64,
        /// The largest displacement as a fraction of the radius (0..=0.9).
        #[serde(default = "default_amplitude")]
        amplitude: f64,
    },
}

fn one_metre() -> Metres {
    Metres(1.0)
}

fn one_metre_each() -> [Metres; 3] {
    [Metres(1.0); 3]
}

fn sphere_triangles() -> u64 {
    32_768
}

fn disk_triangles() -> u64 {
    4_096
}

fn default_amplitude() -> f64 {
    0.25
}

/// A key of a shape that holds an impossible value.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{key}` {reason}")]
pub struct ShapeError {
    /// The key.
    pub key: &'static str,
    /// What is wrong, and what would do.
    pub reason: String,
}

impl ShapeSpec {
    /// The word behind `shape` in the file.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Rectangle { .. } => "rectangle",
            Self::Box { .. } => "box",
            Self::Sphere { .. } => "sphere",
            Self::Disk { .. } => "disk",
            Self::Blob { .. } => "blob",
        }
    }

    /// Makes the mesh, with normals and texture coordinates where `wanted`.
    ///
    /// # Errors
    ///
    /// When a size is not positive or a number of triangles is out of range.
    pub fn build(&self, wanted: Wanted) -> Result<Mesh, ShapeError> {
        match *self {
            Self::Rectangle { width, height } => {
                let half = [half("width", width)?, half("height", height)?];
                Ok(flat::rectangle(half, wanted))
            }
            Self::Box { size } => {
                let [x, y, z] = size;
                Ok(flat::cuboid([half("size", x)?, half("size", y)?, half("size", z)?], wanted))
            }
            Self::Sphere { radius, triangles } => {
                let relief = Relief::none(positive("radius", radius)?);
                Ok(Globe::new(in_range(triangles)?).build("sphere", &relief, wanted))
            }
            Self::Disk { radius, triangles } => {
                let radius = positive("radius", radius)?;
                Ok(globe::disk(radius, in_range(triangles)?, wanted))
            }
            Self::Blob { radius, triangles, seed, amplitude } => {
                let radius = positive("radius", radius)?;
                if !(0.0..=0.9).contains(&amplitude) {
                    let reason = format!("is {amplitude}; it has to be from 0 to 0.9");
                    return Err(ShapeError { key: "amplitude", reason });
                }
                let relief = Relief::new(radius, amplitude, seed);
                Ok(Globe::new(in_range(triangles)?).build("blob", &relief, wanted))
            }
        }
    }
}

fn positive(key: &'static str, length: Metres) -> Result<f64, ShapeError> {
    // Within these bounds squares of f32 coordinates neither vanish nor overflow.
    if (1e-18..=1e18).contains(&length.0) {
        Ok(length.0)
    } else {
        let reason = format!("is {} m; it has to be a length from 1e-18 m to 1e18 m", length.0);
        Err(ShapeError { key, reason })
    }
}

fn half(key: &'static str, length: Metres) -> Result<f64, ShapeError> {
    positive(key, length).map(|length| length / 2.0)
}

fn in_range(triangles: u64) -> Result<u64, ShapeError> {
    if (1..=MOST_TRIANGLES).contains(&triangles) {
        Ok(triangles)
    } else {
        let reason = format!("is {triangles}; it has to be from 1 to {MOST_TRIANGLES}");
        Err(ShapeError { key: "triangles", reason })
    }
}
