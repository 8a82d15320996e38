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

/// Bytes per value of the picture and its layers: the film keeps 8, files are made from a copy of
/// 4; `peak_memory_bytes` of the same report, less the structure, gave 10.7 at 4096 × 4096.
const FILM_PER_VALUE: u64 = 12;

/// A forecast (bytes). Images of materials, which are decoded only when a layer shows them, are not
/// in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct MemoryForecast {
    /// Vertices and indices on the heap.
    pub geometry: u64,
    /// Vertices and indices that stay in mapped files: the system may drop and read them again.
    pub mapped: u64,
    /// Embree's structure, estimated from the number of triangles.
    pub structure: u64,
    /// The picture and its layers.
    pub film: u64,
    /// All but the mapped part.
    pub total: u64,
}

impl MemoryForecast {
    pub(super) fn of(scene: &Scene) -> Self {
        let geometry: u64 = scene.geometry.meshes.iter().map(|mesh| mesh.heap_bytes() as u64).sum();
        let uses = scene.geometry.uses();
        let instances: u64 = uses.iter().filter(|&&n| n > 1).map(|&n| u64::from(n)).sum();
        let structure =
            structure(scene.geometry.triangles_unique()) + EMBREE_PER_INSTANCE * instances;
        let film = film(scene.camera.resolution(), &scene.layers);
        let mapped = scene.stats.bytes_mapped;
        Self { geometry, mapped, structure, film, total: geometry + structure + film }
    }
}

/// Bytes of the structure over so many triangles, estimated.
pub(crate) fn structure(triangles: u64) -> u64 {
    EMBREE_PER_TRIANGLE.saturating_mul(triangles)
}

/// Bytes of `layers` of a picture of so many columns and rows, files included.
pub(crate) fn film([width, height]: [u32; 2], layers: &[LayerSpec]) -> u64 {
    let pixels = u64::from(width) * u64::from(height);
    let values = layers.iter().map(|layer| layer.row().channels.len() as u64).sum();
    FILM_PER_VALUE.saturating_mul(pixels).saturating_mul(values)
}

impl fmt::Display for MemoryForecast {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} ({} geometry, about {} structure, {} picture); {} more stay in the files",
            Size(self.total),
            Size(self.geometry),
            Size(self.structure),
            Size(self.film),
            Size(self.mapped)
        )
    }
}
