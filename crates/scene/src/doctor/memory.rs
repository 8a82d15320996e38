//! What a render will need, from counts alone.

use std::fmt;

use etendue_tracer::LayerSpec;
use serde::Serialize;

use crate::Scene;
use crate::memory::Size;

/// Bytes of Embree's structure per triangle: 92, 90 and 88 for blobs of 0.1, 1 and 4 million at low
/// quality, 63 and 70 for 0.1 and 0.3 million at medium. As `bvh_bytes` in the report of
/// `etendue render SCENE --report` with Embree 3.13.5, AVX2, robust.
const EMBREE_PER_TRIANGLE: u64 = 92;

/// The same per placement of a mesh that is placed twice or more: 132 for 1000, 76 for 20 000.
const EMBREE_PER_INSTANCE: u64 = 132;

/// Bytes of the program itself with its libraries and the threads' working memory: 20 to 23 MiB are the
/// peak of renders of a few pixels.
const PROGRAM: u64 = 22 << 20;

/// A forecast (bytes), of counts alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct MemoryForecast {
    /// The program itself, with its libraries.
    pub program: u64,
    /// Vertices and indices on the heap.
    pub geometry: u64,
    /// Vertices and indices that stay in mapped files: the system may drop and read them again.
    pub mapped: u64,
    /// Embree's structure, estimated from the number of triangles.
    pub structure: u64,
    /// Images of materials and of the environment, decoded.
    pub images: u64,
    /// The planes of the picture and its layers, spectral bands included.
    pub film: u64,
    /// Sums of samples that are kept from pass to pass.
    pub sums: u64,
    /// What the sensor's exposures take, with the light in its bands.
    pub sensor: u64,
    /// What is made of the planes on the way to files and for a look at the picture so far.
    pub files: u64,
    /// What the views of a light field take: they are made when all of the former is done.
    pub views: u64,
    /// All but the mapped part. Sums are gone when the sensor's images and files are made.
    pub total: u64,
}

impl MemoryForecast {
    /// What is known without a plan of the render: geometry, structure, and planes of layers.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        let geometry: u64 = scene.geometry.meshes.iter().map(|mesh| mesh.heap_bytes() as u64).sum();
        let uses = scene.geometry.uses();
        let instances: u64 = uses.iter().filter(|&&n| n > 1).map(|&n| u64::from(n)).sum();
        let structure =
            structure(scene.geometry.triangles_unique()) + EMBREE_PER_INSTANCE * instances;
        let film = film(scene.camera.resolution(), &scene.layers);
        let mapped = scene.stats.bytes_mapped;
        Self { program: PROGRAM, geometry, mapped, structure, film, ..Self::default() }.summed()
    }

    /// With the total of its parts.
    #[must_use]
    pub fn summed(mut self) -> Self {
        let lasting = [self.program, self.geometry, self.structure, self.images, self.film];
        let passing = self.sums.max(self.sensor).saturating_add(self.files).max(self.views);
        self.total = lasting.into_iter().fold(passing, u64::saturating_add);
        self
    }

    /// What a render takes beyond what the program holds when the scene is loaded.
    #[must_use]
    pub fn to_come(&self) -> u64 {
        self.total - self.program - self.geometry
    }
}

/// Bytes of the structure over so many triangles, estimated.
pub(crate) fn structure(triangles: u64) -> u64 {
    EMBREE_PER_TRIANGLE.saturating_mul(triangles)
}

/// The least that `layers` of a picture of so many columns and rows take (bytes): planes of f32.
pub(crate) fn film([width, height]: [u32; 2], layers: &[LayerSpec]) -> u64 {
    let pixels = u64::from(width) * u64::from(height);
    let values = layers.iter().map(|layer| layer.row().channels.len() as u64).sum();
    pixels.saturating_mul(values).saturating_mul(size_of::<f32>() as u64)
}

impl fmt::Display for MemoryForecast {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parts = [
            ("program", self.program),
            ("geometry", self.geometry),
            ("structure", self.structure),
            ("images", self.images),
            ("layers", self.film),
            ("sums of passes", self.sums),
            ("sensor", self.sensor),
            ("files", self.files),
            ("views", self.views),
        ];
        let parts = parts.iter().filter(|(_, bytes)| *bytes > 0);
        let parts: Vec<String> =
            parts.map(|(name, bytes)| format!("{} {name}", Size(*bytes))).collect();
        write!(f, "about {} ({})", Size(self.total), parts.join(", "))?;
        match self.mapped {
            0 => Ok(()),
            mapped => write!(f, "; {} more stay in the files", Size(mapped)),
        }
    }
}
