//! Options of a calibration set: what it is to hold.

use etendue_render::output::Outputs;
use etendue_sensor::{Packing, Window};

use crate::Error;

/// Options of a calibration set.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibrationOptions {
    /// Frames of the darks, flats and white images (1 to 1000), and of each pose of the board.
    pub frames: u32,
    /// The share of saturation that the brightest of flats and white images reach (above 0, up to 1).
    pub level: f64,
    /// Poses of the board; none without.
    pub boards: u32,
    /// Squares of the board, columns and rows (3 to 64).
    pub squares: [u32; 2],
    /// A side of a square (m); what lets the board fill about a half of the picture when absent.
    pub square: Option<f64>,
    /// Distance of the board (m); that at which the lens is focused when absent.
    pub distance: Option<f64>,
    /// Part of the chip that is read out.
    pub window: Window,
    /// Also the numbers as bytes of a packed format.
    pub packed: Option<Packing>,
    /// The f-number that DNGs say where the camera's lens does not.
    pub f_number: Option<f64>,
    /// Kinds of files: PNG, NPY, DNG.
    pub outputs: Outputs,
}

impl Default for CalibrationOptions {
    fn default() -> Self {
        Self {
            frames: 16,
            level: 0.5,
            boards: 12,
            squares: [9, 6],
            square: None,
            distance: None,
            window: Window::default(),
            packed: None,
            f_number: None,
            outputs: Outputs { png: true, npy: true, dng: true, ..Outputs::NONE },
        }
    }
}

pub(super) fn check(options: &CalibrationOptions) -> Result<(), Error> {
    let refuse = |why: String| Err(Error::Refused(why));
    let CalibrationOptions { frames, level, boards, squares, square, distance, .. } = *options;
    if !(1..=1000).contains(&frames) {
        return refuse(format!("--frames {frames}: expected 1 to 1000"));
    }
    if !(level > 0.0 && level <= 1.0) {
        return refuse(format!("--level {level}: expected a share of saturation above 0, up to 1"));
    }
    if boards > 1000 {
        return refuse(format!("--boards {boards}: expected 1000 at most"));
    }
    if squares.iter().any(|count| !(3..=64).contains(count)) {
        let [columns, rows] = squares;
        return refuse(format!("--squares {columns},{rows}: expected 3 to 64 along each side"));
    }
    for (name, length) in [("--square", square), ("--distance", distance)] {
        if length.is_some_and(|length| !(length > 0.0 && length.is_finite())) {
            return refuse(format!("{name}: expected a length above 0"));
        }
    }
    Ok(())
}
