//! Sizes of lenses and sensors that no camera has.

use super::lens_camera::LensCamera;

/// Focal lengths that lenses of cameras have (mm): from an endoscope's to a telescope's.
const PLAUSIBLE_FOCAL_LENGTHS: std::ops::RangeInclusive<f64> = 0.2..=2e4;

/// The least diagonal of a sensor that is not told (mm); those of endoscopes have 1.
const LEAST_DIAGONAL: f64 = 2.0;

impl LensCamera {
    /// Sizes that no camera has, in sentences: most likely a unit that was not meant.
    #[must_use]
    pub fn implausible(&self) -> Vec<String> {
        let mut notes = Vec::new();
        let efl = self.focused.paraxial().efl.map(f64::abs);
        if let Some(efl) = efl.filter(|efl| !PLAUSIBLE_FOCAL_LENGTHS.contains(efl)) {
            let meant = if efl < 1.0 { "metres" } else { "micrometres" };
            notes.push(format!(
                "the focal length is {efl:.4} mm: did you mean {meant}? Lengths inside a lens are \
                 millimetres, or strings with a unit"
            ));
        }
        notes.extend(self.mismatch());
        let [width, height] = (2.0 * self.focused.film().half_size()).to_array();
        if width.hypot(height) < LEAST_DIAGONAL {
            notes.push(format!(
                "the sensor is {width:.3} x {height:.3} mm with pixels of {:.4} um: a crop of \
                 nearly any sensor; give more pixels, or their size by `sensor_height` or `fov`",
                self.focused.pixel_pitch()
            ));
        }
        notes
    }

    /// A sentence on lenslets whose f-number is not that of the lens before them.
    fn mismatch(&self) -> Option<String> {
        let [diameter, pitch] = self.lenslets()?.fit();
        let share = diameter / pitch;
        let [diameter, pitch] = [diameter, pitch].map(|length| 1e3 * length);
        if share > 1.02 {
            return Some(format!(
                "the main lens is faster than the lenslets: its opening's images are {diameter:.2} um \
                 wide and {pitch:.2} um apart, so neighbours overlap; close the main lens, or put the \
                 sensor nearer to the lenslets"
            ));
        }
        (share < 0.9).then(|| {
            format!(
                "the main lens is slower than the lenslets: its opening's images are {diameter:.2} um \
                 wide and {pitch:.2} um apart, so pixels between them are dark; open the main lens, or \
                 put the sensor farther from the lenslets"
            )
        })
    }
}
