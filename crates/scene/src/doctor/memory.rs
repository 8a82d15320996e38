//! Forecast of a render's memory, from counts alone.

use etendue_geometry::Coplanar;
use etendue_report::{Decision, DecisionKind, DecisionValue, Size, listed};
use etendue_tracer::LayerSpec;
use serde::Serialize;

use crate::Scene;

/// Bytes of Embree's structure per triangle: 92, 90 and 88 for blobs of 0.1, 1 and 4 million at low
/// quality, 63 and 70 for 0.1 and 0.3 million at medium. As `bvh_bytes` in the report of
/// `etendue render SCENE --report` with Embree 3.13.5, AVX2, robust.
const EMBREE_PER_TRIANGLE: u64 = 92;

/// Bytes per placement of a mesh that is placed twice or more, all in all: where it stands in the file, in the
/// scene and while it is framed, and Embree's instance of it or ours. 890 to 1290 were held for 0.04 to 1 million
/// copies of one object; `benches/forecasts.py memory`, with `--accel bvh`, too.
const PER_COPY: u64 = 1000;

/// Bytes of a placement that moves while the shutter is open, beside what copies have: its motion, with what the structure keeps of
/// it in place of an instance. Counted of the types; keys and links come on top of it.
const PER_MOVING: u64 = 300;

/// Bytes of the program itself with its libraries and the threads' working memory: 24 to 31 MiB are the
/// peak of renders of a few pixels.
const PROGRAM: u64 = 26 << 20;

/// Bytes of the rays by which the exit pupil of a lens is measured: pictures of a few pixels through lenses
/// hold 12 to 20 MiB more than others.
const LENS: u64 = 12 << 20;

/// A forecast (bytes), of counts alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct MemoryForecast {
    /// The program itself, with its libraries, and the rays by which a lens is measured.
    pub program: u64,
    /// Vertices and indices on the heap.
    pub geometry: u64,
    /// Vertices and indices that stay in mapped files: the system may drop and read them again.
    pub mapped: u64,
    /// Embree's structure, estimated from the number of triangles, and the list of those that may lie in one plane with
    /// another copy's while it is made.
    pub structure: u64,
    /// Placements of meshes that are placed more than once, in the scene and in the structure.
    pub copies: u64,
    /// Placements that move while the shutter is open, and the boxes of meshes that change their shapes then.
    pub moving: u64,
    /// Images of materials and of the environment, decoded.
    pub images: u64,
    /// The planes of the picture and its layers, spectral bands included.
    pub film: u64,
    /// Sums of samples that are kept from pass to pass.
    pub sums: u64,
    /// Bytes of the sensor's exposures, with the light in its bands.
    pub sensor: u64,
    /// Bytes of what is made of the planes on the way to files and for a look at the picture so far.
    pub files: u64,
    /// Bytes of the views of a light field, which are made when all of the former is done.
    pub views: u64,
    /// All but the mapped part. Sums are gone when the sensor's images and files are made.
    pub total: u64,
}

impl MemoryForecast {
    /// Forecasts what is known without a plan of the render: geometry, structure, and planes of
    /// layers.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        let geometry: u64 = scene.geometry.meshes.iter().map(|mesh| mesh.heap_bytes() as u64).sum();
        let structure =
            structure(scene.geometry.triangles_unique()) + Coplanar::bytes_at_most(&scene.geometry);
        let copies = copies(scene.placed_copies());
        let moving = moving(scene);
        let film = film(scene.camera.resolution(), &scene.layers);
        let mapped = scene.stats.bytes_mapped;
        let is_measured = scene.camera.lens().is_some() && scene.camera.light_field().is_none();
        let program = PROGRAM + if is_measured { LENS } else { 0 };
        let forecast =
            Self { program, geometry, mapped, structure, copies, moving, film, ..Self::default() };
        forecast.summed()
    }

    /// With the total of its parts.
    #[must_use]
    pub fn summed(mut self) -> Self {
        let lasting = [
            self.program,
            self.geometry,
            self.structure,
            self.copies,
            self.moving,
            self.images,
            self.film,
        ];
        let passing = self.sums.max(self.sensor).saturating_add(self.files).max(self.views);
        self.total = lasting.into_iter().fold(passing, u64::saturating_add);
        self
    }

    /// Memory that a render takes beyond what the program holds when the scene is loaded (bytes).
    #[must_use]
    pub fn to_come(&self) -> u64 {
        self.total - self.program - self.geometry
    }
}

/// Bytes of the structure over so many triangles, estimated.
pub(crate) fn structure(triangles: u64) -> u64 {
    EMBREE_PER_TRIANGLE.saturating_mul(triangles)
}

/// Bytes of so many placements of meshes that are placed more than once, estimated.
pub(crate) fn copies(placements: u64) -> u64 {
    match placements {
        0 | 1 => 0,
        many => PER_COPY.saturating_mul(many),
    }
}

/// Bytes of what moves while the shutter is open, beside the steps of shapes, which are geometry.
fn moving(scene: &Scene) -> u64 {
    let span = scene.camera.exposure_span();
    let motions: u64 = scene
        .geometry
        .moving_within(span)
        .map(|(_, motion)| PER_MOVING + motion.heap_bytes() as u64)
        .sum();
    let boxes = scene.geometry.meshes.iter().filter_map(|mesh| {
        let steps = mesh.steps.as_ref()?.times().len() as u64;
        Some(steps.saturating_mul(STEP_BYTES.saturating_mul(mesh.triangles.len() as u64)))
    });
    motions.saturating_add(boxes.sum())
}

/// Bytes a triangle and step of the structure of a mesh that changes its shape: at most one and a half nodes of six numbers of
/// f32.
pub(crate) const STEP_BYTES: u64 = 36;

/// The least that `layers` of a picture of so many columns and rows take (bytes): planes of f32.
pub(crate) fn film([width, height]: [u32; 2], layers: &[LayerSpec]) -> u64 {
    let pixels = u64::from(width) * u64::from(height);
    let values = layers.iter().map(|layer| layer.row().channels.len() as u64).sum();
    pixels.saturating_mul(values).saturating_mul(size_of::<f32>() as u64)
}

impl MemoryForecast {
    /// Its parts (bytes) by name, those that are not 0.
    pub fn parts(&self) -> impl Iterator<Item = (&'static str, u64)> {
        let parts = [
            ("program", self.program),
            ("geometry", self.geometry),
            ("structure", self.structure),
            ("copies", self.copies),
            ("motion", self.moving),
            ("images", self.images),
            ("layers", self.film),
            ("sums of passes", self.sums),
            ("sensor", self.sensor),
            ("files", self.files),
            ("views", self.views),
        ];
        parts.into_iter().filter(|(_, bytes)| *bytes > 0)
    }

    /// The total as a decision of the plan, because of its parts.
    #[must_use]
    pub fn decision(&self) -> Decision {
        let parts = listed(self.parts().map(|(name, bytes)| format!("{} {name}", Size(bytes))));
        let mapped = match self.mapped {
            0 => String::new(),
            mapped => format!("; {} more stay in the files", Size(mapped)),
        };
        let total = DecisionValue::Bytes(self.total);
        Decision::new(DecisionKind::Memory, total, parts + &mapped)
    }
}
