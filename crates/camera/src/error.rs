//! Why a camera cannot be built.

/// A camera's description that makes no camera: where in it, and why.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{at}: {why}")]
pub struct CameraError {
    /// The key inside the camera, with dots and indices (`sensor.resolution`, `pose.up`).
    pub at: String,
    /// What is wrong and what would do.
    pub why: String,
}

impl CameraError {
    /// At the key `at`, because of `why`.
    #[must_use]
    pub fn new(at: impl Into<String>, why: impl Into<String>) -> Self {
        Self { at: at.into(), why: why.into() }
    }
}
