//! A report as text for a person.

use std::fmt::{self, Display, Formatter};

use etendue_chart::significant;
use etendue_report::{Cell, Table};

use super::{LensReport, Paraxial};

/// Mark for a missing number.
const NONE: &str = "-";

impl Display for LensReport {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let name = if self.name.is_empty() { "Lens" } else { &self.name };
        writeln!(f, "{name}")?;
        if !self.source.is_empty() {
            writeln!(f, "{}", self.source)?;
        }
        writeln!(f)?;
        self.write_elements(f)?;
        self.write_paraxial(f)?;
        self.write_fields(f)?;
        self.write_colour(f)?;
        let notes = || self.notes.iter().chain(&self.out_of_range);
        if notes().next().is_some() {
            writeln!(f)?;
        }
        notes().try_for_each(|note| writeln!(f, "note: {note}"))
    }
}

impl LensReport {
    fn write_elements(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let mut table = Table::new(&[
            "#",
            "element",
            "radius",
            "thickness",
            "semi-diameter",
            "behind it",
            "index",
            "",
        ])
        .with_units(&["", "", "mm", "mm", "mm", "", "", ""])
        .indented(2);
        for (i, row) in self.elements.iter().enumerate() {
            let mut remarks = Vec::new();
            if i == self.stop {
                remarks.push("stop".to_owned());
            }
            if !row.shape.is_empty() {
                remarks.push(row.shape.clone());
            }
            let flat = if row.kind == "surface" { "flat" } else { NONE };
            table.push([
                Cell::count(i as u64),
                Cell::word(row.kind.replace('_', " ")),
                row.radius.map_or(Cell::number(flat, flat), digits),
                number(row.thickness, significant),
                number(row.semi_diameter, significant),
                Cell::word(row.medium.clone()),
                Cell::number(row.index, format!("{:.6}", row.index)),
                Cell::word(remarks.join(", ")),
            ]);
        }
        write!(f, "{table}")
    }

    fn write_paraxial(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Paraxial { entrance_pupil, exit_pupil, .. } = self.paraxial;
        let p = &self.paraxial;
        let mm = |value: Option<f64>| or_none(value, |v| format!("{} mm", significant(v)));
        let degrees = |value: Option<f64>| or_none(value, |v| format!("{} deg", significant(v)));
        let at = |z: Option<f64>| or_none(z, |z| format!("z = {} mm", significant(z)));
        let pupil = |z: Option<f64>, diameter: Option<f64>| {
            format!(
                "{}, diameter {}",
                z.map_or("at infinity".to_owned(), |z| at(Some(z))),
                mm(diameter)
            )
        };
        writeln!(f, "\nAt {} nm; z = 0 at the first vertex, towards the sensor", self.wavelength)?;
        let lines = [
            ("effective focal length (EFL)", mm(p.efl)),
            ("back focal length (BFL)", mm(p.bfl)),
            ("front focal point", at(p.ffl)),
            ("rear focal point", at(p.image_z)),
            ("front principal plane", at(p.front_principal_z)),
            ("rear principal plane", at(p.rear_principal_z)),
            ("entrance pupil", pupil(entrance_pupil.z, entrance_pupil.diameter)),
            ("exit pupil", pupil(exit_pupil.z, exit_pupil.diameter)),
            ("f-number", or_none(p.f_number, |n| format!("f/{}", significant(n)))),
            ("sensor", at(self.sensor_z)),
            ("image circle, diameter", mm(self.image_circle)),
            ("field of view, full angle", degrees(self.field_of_view)),
        ];
        let mut list = Table::list(31).indented(2);
        lines.into_iter().for_each(|(what, value)| list.put(what, value));
        write!(f, "{list}")
    }

    fn write_fields(&self, f: &mut Formatter<'_>) -> fmt::Result {
        if self.sensor_z.is_none() {
            return Ok(());
        }
        let mut table = Table::new(&[
            "field",
            "height",
            "distortion",
            "RMS spot",
            "largest",
            "best RMS",
            "best focus",
            "rays passed",
            "illumination",
        ])
        .with_units(&["deg", "mm", "%", "um", "um", "um", "mm", "%", "%"])
        .indented(2);
        // A row for each field, with a dash for what there is none of.
        for &field in &self.fields {
            let spot = self.spots.iter().find(|s| s.field == field);
            let distortion = self.distortion.iter().find(|d| d.field == field);
            let light = self.relative_illumination.iter().find(|l| l.field == field);
            let of_spot = |value: fn(&super::Spot) -> f64| number(spot.map(value), significant);
            table.push([
                digits(field),
                number(light.map(|l| l.image_y), significant),
                number(distortion.map(|d| d.percent), |v| format!("{v:.4}")),
                of_spot(|s| 1e3 * s.rms),
                of_spot(|s| 1e3 * s.geometric),
                of_spot(|s| 1e3 * s.best_rms),
                of_spot(|s| s.best_focus),
                of_spot(|s| 100.0 * s.passed()),
                number(light.map(|l| 100.0 * l.relative), |v| format!("{v:.2}")),
            ]);
        }
        writeln!(f, "\nOn the sensor, for points at infinity")?;
        write!(f, "{table}")?;
        self.write_vignetted(f)
    }

    fn write_vignetted(&self, f: &mut Formatter<'_>) -> fmt::Result {
        if self.vignetted.is_empty() {
            return Ok(());
        }
        let mut table =
            Table::new(&["field", "factors leave", "rims leave", "RMS spot", "largest"])
                .with_units(&["deg", "%", "%", "um", "um"])
                .indented(2);
        for row in &self.vignetted {
            let values = [
                row.spot.field,
                100.0 * row.stated,
                100.0 * row.passed,
                1e3 * row.spot.rms,
                1e3 * row.spot.geometric,
            ];
            table.push(values.map(digits));
        }
        writeln!(f, "\nThe same over what the file's vignetting factors leave of the pupil")?;
        write!(f, "{table}")
    }

    fn write_colour(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let moved = |row: &super::ColourRow| {
            row.paraxial.efl != self.paraxial.efl || row.paraxial.bfl != self.paraxial.bfl
        };
        if let [one] = &*self.colour {
            return writeln!(f, "\nColour: of {} nm alone", significant(one.wavelength));
        }
        if !self.colour.iter().any(moved) {
            return writeln!(f, "\nColour: all wavelengths run alike");
        }
        let lateral: Vec<String> =
            self.fields.iter().map(|&field| format!("at {} deg", significant(field))).collect();
        let shown = if self.sensor_z.is_some() { &lateral[..] } else { &[] };
        let mut head = vec!["wavelength", "EFL", "BFL", "longitudinal"];
        head.extend(shown.iter().map(String::as_str));
        let mut units = vec!["nm", "mm", "mm", "mm"];
        units.resize(head.len(), "um");
        let mut table = Table::new(&head).with_units(&units).indented(2);
        for row in &self.colour {
            let mut cells = vec![
                Cell::number(row.wavelength, row.wavelength.to_string()),
                number(row.paraxial.efl, significant),
                number(row.paraxial.bfl, significant),
                number(row.longitudinal, significant),
            ];
            cells.extend(row.lateral.iter().map(|shift| number(*shift, |v| significant(1e3 * v))));
            table.push(cells);
        }
        writeln!(f, "\nColour against {} nm: longitudinal, and lateral by field", self.wavelength)?;
        write!(f, "{table}")
    }
}

/// A number as `show` rounds it, or a dash.
fn number(value: Option<f64>, show: impl Fn(f64) -> String) -> Cell {
    value.map_or_else(Cell::none, |value| Cell::number(value, show(value)))
}

fn digits(value: f64) -> Cell {
    Cell::number(value, significant(value))
}

fn or_none(value: Option<f64>, show: impl Fn(f64) -> String) -> String {
    value.map_or(NONE.to_owned(), show)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_six_digits() {
        assert_eq!(significant(50.0), "50");
        assert_eq!(significant(-39.730_001), "-39.73");
        assert_eq!(significant(0.001_234_567), "0.00123457");
        assert_eq!(significant(123_456.7), "123457");
        assert_eq!(significant(-2.5e-9), "-2.5000e-9");
        assert_eq!(significant(0.0), "0");
    }
}
