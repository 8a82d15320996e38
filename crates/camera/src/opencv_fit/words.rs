//! A fit in words.

use std::fmt;

use super::{FitRegion, OpencvFit};

impl fmt::Display for OpencvFit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [[fx, _, cx], [_, fy, cy], _] = self.k;
        writeln!(
            f,
            "K           fx {fx:.4}  fy {fy:.4}  cx {cx:.4}  cy {cy:.4} px, counted from the centre of the \
             top left pixel"
        )?;
        // The camera, by the names that OpenCV gives.
        let names: &[&str] = match self.model {
            "fisheye" => &["k1", "k2", "k3", "k4"],
            _ => &["k1", "k2", "p1", "p2", "k3"],
        };
        let terms = names.iter().zip(&self.coefficients);
        let terms: Vec<String> = terms.map(|(name, value)| format!("{name} {value:.6e}")).collect();
        writeln!(f, "distortion  {}: {}", self.model, terms.join("  "))?;
        match self.distance {
            Some(distance) => writeln!(f, "fitted at   {distance:.4} m, the distance in focus")?,
            None => writeln!(f, "fitted at   infinity, the distance in focus")?,
        }
        // How well it fits, and how far it holds.
        let residuals = &self.residuals;
        writeln!(
            f,
            "residuals   rms {:.5} px, largest {:.5} px, of chief rays of {} places of the picture\n",
            residuals.rms, residuals.largest, residuals.places
        )?;
        writeln!(f, "radius (px)  field (deg)  rms (px)  largest (px)")?;
        for ring in &residuals.rings {
            writeln!(
                f,
                "{:11.1}  {:11.3}  {:8.5}  {:12.5}",
                ring.radius, ring.field, ring.rms, ring.largest
            )?;
        }
        writeln!(f, "\nholds       {}", self.holds)?;
        writeln!(
            f,
            "chief rays  pass up to {:.4} mm from the middle of the entrance pupil",
            self.holds.pupil_wander
        )?;
        for note in &self.notes {
            writeln!(f, "note        {note}")?;
        }
        let camera = serde_json::to_string_pretty(&self.camera).map_err(|_| fmt::Error)?;
        write!(f, "\nThe camera for a scene:\n\"camera\": {camera}")
    }
}

impl fmt::Display for FitRegion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let tolerance = self.tolerance;
        if self.share < 1.0 {
            return write!(
                f,
                "within {tolerance} px in {:.1} % of the picture: up to {:.1} px from its principal point, \
                 {:.2} degrees from the axis",
                100.0 * self.share,
                self.radius,
                self.field
            );
        }
        write!(f, "within {tolerance} px all over the picture, of what is ")?;
        match (self.nearest, self.farthest) {
            (Some(nearest), Some(farthest)) => write!(f, "{nearest:.3} to {farthest:.3} m away"),
            (Some(nearest), None) => write!(f, "{nearest:.3} m away or farther"),
            (None, _) => write!(f, "at the distance of the fit"),
        }
    }
}
