//! A fit in words.

use std::fmt;

use etendue_report::{Cell, Table};

use super::{FitRegion, OpencvFit, ResidualRing};

impl fmt::Display for OpencvFit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [[fx, _, cx], [_, fy, cy], _] = self.k;
        let mut list = Table::list(12);
        list.put(
            "K",
            format_args!(
                "fx {fx:.4}  fy {fy:.4}  cx {cx:.4}  cy {cy:.4} px, counted from the centre of the top left pixel"
            ),
        );
        // The camera, by the names that OpenCV gives.
        let names: &[&str] = match self.model {
            "fisheye" => &["k1", "k2", "k3", "k4"],
            _ => &["k1", "k2", "p1", "p2", "k3"],
        };
        let terms = names.iter().zip(&self.coefficients);
        let terms: Vec<String> = terms.map(|(name, value)| format!("{name} {value:.6e}")).collect();
        list.put("distortion", format_args!("{}: {}", self.model, terms.join("  ")));
        let distance = match self.distance {
            Some(distance) => format!("{distance:.4} m"),
            None => "infinity".to_owned(),
        };
        list.put("fitted at", format_args!("{distance}, the distance in focus"));
        // How well it fits, and how far it holds.
        let residuals = &self.residuals;
        list.put(
            "residuals",
            format_args!(
                "rms {:.5} px, largest {:.5} px, of chief rays of {} places of the picture",
                residuals.rms, residuals.largest, residuals.places
            ),
        );
        writeln!(f, "{list}")?;
        let digits =
            |value: f64, decimals: usize| Cell::number(value, format!("{value:.decimals$}"));
        let ring = |ring: &ResidualRing| {
            vec![
                ("radius (px)", digits(ring.radius, 1)),
                ("field (deg)", digits(ring.field, 3)),
                ("rms (px)", digits(ring.rms, 5)),
                ("largest (px)", digits(ring.largest, 5)),
            ]
        };
        writeln!(f, "{}", Table::of_rows(residuals.rings.iter().map(ring).collect()))?;
        let mut list = Table::list(12);
        list.put("holds", self.holds);
        let wander = self.holds.pupil_wander;
        list.put(
            "chief rays",
            format_args!("pass up to {wander:.4} mm from the middle of the entrance pupil"),
        );
        self.notes.iter().for_each(|note| list.put("note", note));
        write!(f, "{list}")?;
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
