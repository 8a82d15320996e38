//! Poses of a trajectory, as its file has them.

use etendue_camera::{Convention, Maps, PoseSpec};
use serde_json::Value;

/// A pose of a trajectory, with what else its file says.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Station {
    pub(super) pose: PoseSpec,
    pub(super) time: Option<f64>,
    /// More settings, such as intrinsics.
    pub(super) settings: Vec<(String, Value)>,
}

/// Meaning of the numbers of poses in files that do not say it.
#[derive(Debug, Clone, Copy)]
pub(super) struct PoseAxes {
    pub(super) maps: Maps,
    pub(super) convention: Convention,
}

impl Station {
    pub(super) fn new(pose: PoseSpec) -> Self {
        Self { pose, time: None, settings: Vec::new() }
    }

    /// Of a matrix by rows of four numbers; the last of its four rows may be missing.
    pub(super) fn of_rows(numbers: &[f64], PoseAxes { maps, convention }: PoseAxes) -> Self {
        let mut matrix = [[0.0, 0.0, 0.0, 1.0]; 4];
        for (row, numbers) in matrix.iter_mut().zip(numbers.chunks_exact(4)) {
            row.copy_from_slice(numbers);
        }
        Self::new(PoseSpec::Matrix { matrix, maps, convention })
    }
}
