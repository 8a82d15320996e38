//! Models of a lens by their kinds, how far they are from the lens, and what is taken of a tolerance.

use std::fmt;

use etendue_camera::Camera;
use etendue_scene::file::ToleranceSpec;
use serde::{Serialize, Serializer};

use super::detail::TakenDetail;

/// Kind of a model of a lens, or the lens itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LensModelKind {
    /// Its entrance pupil as a point.
    Pinhole,
    /// A pinhole with OpenCV's distortion.
    Opencv,
    /// OpenCV's camera with the lens' falloff of light.
    Falloff,
    /// A thin lens.
    Thin,
    /// A thin lens with its stop apart.
    Thick,
    /// All of the lens, at its design wavelength.
    Undispersed,
    /// All of the lens, with its bands in groups.
    Grouped,
    /// All of the lens.
    Full,
}

impl LensModelKind {
    /// Its name in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Pinhole => "pinhole",
            Self::Opencv => "opencv",
            Self::Falloff => "falloff",
            Self::Thin => "thin",
            Self::Thick => "thick",
            Self::Undispersed => "undispersed",
            Self::Grouped => "grouped",
            Self::Full => "full",
        }
    }
}

impl fmt::Display for LensModelKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl Serialize for LensModelKind {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// Errors that a model may have.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Tolerance {
    /// Of places, blur and shifts of colour (pixels).
    pub pixels: f64,
    /// Of light, as a share of that on the axis; not judged when absent.
    pub light: Option<f64>,
}

/// Errors of a model, and its cost.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ModelError {
    /// Kind of the model.
    pub model: LensModelKind,
    /// Distance of chief rays from the train's (pixels).
    pub chief_ray: Worst,
    /// Distance of the middle of a pixel's light from the train's (pixels).
    pub centroid: Worst,
    /// The difference of the blur, the root mean square radius of a pixel's light in a band (pixels).
    pub blur: Worst,
    /// The difference of where a band lies among all bands (pixels).
    pub colour: Worst,
    /// The difference of a pixel's light in a band, as a share of that on the axis.
    pub light: Worst,
    /// True if it stays within the tolerance.
    pub is_within: bool,
    /// The time of a sample of a pixel (s); `null` without a picture to time.
    pub seconds_a_sample: Option<f64>,
    /// Speed as a multiple of the full train's.
    pub speed: Option<f64>,
}

impl ModelError {
    /// The greatest displacement, of whatever kind (pixels).
    #[must_use]
    pub fn displacement(&self) -> f64 {
        let all = [self.chief_ray, self.centroid, self.blur, self.colour];
        all.into_iter().map(|worst| worst.value).fold(0.0, f64::max)
    }
}

/// The greatest difference, and where it is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Worst {
    /// As the quantity says.
    pub value: f64,
    /// The column and row of its place (pixels from the corner).
    pub at: [f64; 2],
    /// Its depth (m); `null` for infinity, or where the depth plays no part.
    pub depth: Option<f64>,
}

impl Worst {
    pub(super) fn raise(&mut self, value: f64, place: &Place, nearness: Option<f64>) {
        if value > self.value {
            let depth = nearness.map(|nearness| 1.0 / nearness).filter(|depth| depth.is_finite());
            *self = Self { value, at: [place.column, place.row], depth };
        }
    }
}

/// Part of a scene's tolerance that is used.
#[derive(Debug, Clone, PartialEq)]
pub struct Approximations {
    /// The tolerance.
    pub tolerance: ToleranceSpec,
    /// The camera that light is sampled by, in the place of the scene's.
    pub camera: Option<TakenCamera>,
    /// Number of surfaces to which light is followed, less than the scene's tracer does.
    pub bounces: Option<TakenBounces>,
    /// Detail that is left out of the scene's meshes.
    pub detail: Option<TakenDetail>,
    /// Number of the scene's images decoded in as few texels as the nearest view can tell apart.
    pub images: usize,
    /// Reasons why not more is used, in sentences.
    pub notes: Vec<String>,
}

impl Approximations {
    /// Nothing but the detail of meshes yet.
    pub(super) fn nothing(tolerance: ToleranceSpec, detail: Option<TakenDetail>) -> Self {
        Self { tolerance, camera: None, bounces: None, detail, images: 0, notes: Vec::new() }
    }
}

/// A simpler model of a lens that is taken.
#[derive(Debug, Clone, PartialEq)]
pub struct TakenCamera {
    /// The camera.
    pub camera: Camera,
    /// Its errors.
    pub finding: ModelError,
}

/// Fewer surfaces to which light is followed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TakenBounces {
    /// Number of surfaces to which light is followed.
    pub bounces: u32,
    /// The share of light that the others bring, in 99 % of blocks of 8 × 8 pixels.
    pub share: f64,
}

/// The tolerance of a scene as models are judged by.
impl From<ToleranceSpec> for Tolerance {
    fn from(spec: ToleranceSpec) -> Self {
        Self { pixels: spec.displacement.0, light: Some(spec.light.0) }
    }
}

/// A place of the picture.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Place {
    /// Its column (pixels from the outer corner of the top left pixel).
    pub column: f64,
    /// Its row.
    pub row: f64,
    /// Depths (m) that are seen around it, the nearest first.
    #[serde(serialize_with = "finite_or_null")]
    pub depths: Vec<f64>,
}

fn finite_or_null<S: Serializer>(values: &[f64], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(values.iter().map(|x| x.is_finite().then_some(*x)))
}
