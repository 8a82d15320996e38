//! `report.json`: what a render did and what it cost.

use std::path::PathBuf;
use std::time::Duration;

use serde::Serialize;

use crate::SampleCounts;

/// Wall time of each stage (s).
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct Seconds {
    /// Reading the scene and its models.
    pub load: f64,
    /// Building the acceleration structure.
    pub build: f64,
    /// Decoding images of materials.
    pub decode: f64,
    /// Tracing rays and filling layers.
    pub render: f64,
    /// Writing files.
    pub write: f64,
    /// All of it.
    pub total: f64,
}

/// A decoded image and its memory.
#[derive(Debug, Clone, Serialize)]
pub struct ImageSize {
    /// Name in the file.
    pub name: String,
    /// Columns and rows.
    pub resolution: [usize; 2],
    /// Bytes of its texels.
    pub bytes: u64,
}

/// Content of `report.json`.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// The program and its version.
    pub software: &'static str,
    /// The scene or model.
    pub scene: PathBuf,
    /// Fingerprint of the scene and its files.
    pub scene_hash: String,
    /// Fingerprint of all layers' values: equal for equal pictures.
    pub image_hash: String,
    /// Columns and rows.
    pub resolution: [u32; 2],
    /// The layers, by their names in files.
    pub layers: Vec<String>,
    /// The backend with its version and mode.
    pub accel: String,
    /// Build quality.
    pub build_quality: String,
    /// Threads of build and render.
    pub threads: usize,
    /// The seed of the samples.
    pub seed: u64,
    /// Samples that every pixel of the picture has.
    pub samples: u32,
    /// Samples a pixel that were asked for: more than it has when the render was stopped.
    pub samples_wanted: u32,
    /// Numbers of samples of the pixels, where they got them until an error was reached.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sample_counts: Option<SampleCounts>,
    /// Wall time of each stage (s).
    pub seconds: Seconds,
    /// Rays traced.
    pub rays: u64,
    /// Rays sent into the camera's lens from the sensor; 0 without a lens.
    pub lens_rays: u64,
    /// Ends of rays inside the lens, as `vignetted at element 3: 12 %`, the greatest loss first;
    /// elements count from 0 on the object side.
    pub lens_losses: Vec<String>,
    /// Millions of rays a second of the tracing, layers included.
    pub mrays_per_second: f64,
    /// Rays looked at a second time in f64, and how many of those changed.
    pub rechecked: u64,
    /// Rays whose answer the second look changed.
    pub corrected: u64,
    /// Triangles as often as they appear.
    pub triangles: u64,
    /// Triangles stored.
    pub triangles_unique: u64,
    /// Placements of meshes.
    pub placements: u64,
    /// Bytes of the acceleration structure.
    pub bvh_bytes: u64,
    /// Bytes of geometry used where it lies in mapped files.
    pub geometry_bytes_mapped: u64,
    /// Bytes of geometry on the heap, copies for the accelerator included.
    pub geometry_bytes_copied: u64,
    /// Bytes of decoded images.
    pub image_bytes: u64,
    /// Each of them.
    pub images: Vec<ImageSize>,
    /// Contributions of light that were not finite and were left out.
    pub not_finite: u64,
    /// The most memory that the process held (bytes), mapped files included; 0 when the system does
    /// not tell.
    pub peak_memory_bytes: u64,
    /// The part of it that is not backed by files: what cannot be given back under pressure.
    pub peak_private_bytes: u64,
    /// Notes on what was dropped, ignored or missing.
    pub notes: Vec<String>,
    /// The files that were written.
    pub files: Vec<PathBuf>,
}

/// A time in seconds.
#[must_use]
pub fn seconds(duration: Duration) -> f64 {
    duration.as_secs_f64()
}

/// The most memory that this process held so far (bytes), and how much of what it holds now is
/// private; zeros when the system does not tell.
#[must_use]
#[expect(clippy::disallowed_methods, reason = "a table of the kernel's, no user's file")]
pub fn memory() -> (u64, u64) {
    let Ok(status) = std::fs::read_to_string("/proc/self/status") else { return (0, 0) };
    let field = |name: &str| {
        let line = status.lines().find_map(|line| line.strip_prefix(name)).unwrap_or_default();
        let kilobytes = line.trim().split(' ').next().and_then(|n| n.parse::<u64>().ok());
        kilobytes.unwrap_or(0) * 1024
    };
    (field("VmHWM:"), field("RssAnon:"))
}
