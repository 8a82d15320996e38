//! A report as text for a person.

use std::fmt::{self, Display, Formatter};

use etendue_chart::significant;

use super::{LensReport, Paraxial};

/// What stands where there is no number.
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
        let mut table = TextTable::new(
            &["#", "element", "radius", "thickness", "semi-diameter", "behind it", "index", ""],
            &["", "", "mm", "mm", "mm", "", "", ""],
        );
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
                i.to_string(),
                row.kind.replace('_', " "),
                row.radius.map_or(flat.to_owned(), significant),
                or_none(row.thickness, significant),
                or_none(row.semi_diameter, significant),
                row.medium.clone(),
                format!("{:.6}", row.index),
                remarks.join(", "),
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
        lines.iter().try_for_each(|(what, value)| writeln!(f, "  {what:<30} {value}"))
    }

    fn write_fields(&self, f: &mut Formatter<'_>) -> fmt::Result {
        if self.sensor_z.is_none() {
            return Ok(());
        }
        let mut table = TextTable::new(
            &[
                "field",
                "height",
                "distortion",
                "RMS spot",
                "largest",
                "best RMS",
                "best focus",
                "rays passed",
                "illumination",
            ],
            &["deg", "mm", "%", "um", "um", "um", "mm", "%", "%"],
        );
        // A row for each field, with a dash for what there is none of.
        for &field in &self.fields {
            let spot = self.spots.iter().find(|s| s.field == field);
            let distortion = self.distortion.iter().find(|d| d.field == field);
            let light = self.relative_illumination.iter().find(|l| l.field == field);
            let of_spot = |value: fn(&super::Spot) -> f64| {
                spot.map_or(NONE.to_owned(), |s| significant(value(s)))
            };
            table.push([
                significant(field),
                or_none(light.map(|l| l.image_y), significant),
                or_none(distortion.map(|d| d.percent), |v| format!("{v:.4}")),
                of_spot(|s| 1e3 * s.rms),
                of_spot(|s| 1e3 * s.geometric),
                of_spot(|s| 1e3 * s.best_rms),
                of_spot(|s| s.best_focus),
                of_spot(|s| 100.0 * share(s.rays_passed, s.rays_launched)),
                or_none(light.map(|l| 100.0 * l.relative), |v| format!("{v:.2}")),
            ]);
        }
        writeln!(f, "\nOn the sensor, for points at infinity")?;
        write!(f, "{table}")
    }

    fn write_colour(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let moved = |row: &super::ColourRow| {
            row.paraxial.efl != self.paraxial.efl || row.paraxial.bfl != self.paraxial.bfl
        };
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
        let mut table = TextTable::new(&head, &units);
        for row in &self.colour {
            let mut cells = vec![
                row.wavelength.to_string(),
                or_none(row.paraxial.efl, significant),
                or_none(row.paraxial.bfl, significant),
                or_none(row.longitudinal, significant),
            ];
            cells.extend(row.lateral.iter().map(|shift| or_none(*shift, |v| significant(1e3 * v))));
            table.push(cells);
        }
        writeln!(f, "\nColour against {} nm: longitudinal, and lateral by field", self.wavelength)?;
        write!(f, "{table}")
    }
}

fn or_none(value: Option<f64>, show: impl Fn(f64) -> String) -> String {
    value.map_or(NONE.to_owned(), show)
}

#[expect(clippy::cast_precision_loss, reason = "counts of some hundred rays")]
fn share(part: usize, whole: usize) -> f64 {
    part as f64 / whole.max(1) as f64
}

/// Cells in columns: numbers to the right, words to the left.
struct TextTable {
    rows: Vec<Vec<String>>,
}

impl TextTable {
    fn new(head: &[&str], units: &[&str]) -> Self {
        let row = |cells: &[&str]| cells.iter().map(|&cell| cell.to_owned()).collect();
        Self { rows: vec![row(head), row(units)] }
    }

    fn push(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(cells.into_iter().collect());
    }
}

impl Display for TextTable {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let cells = |column: usize| self.rows.iter().filter_map(move |row| row.get(column));
        let is_number =
            |cell: &String| cell.parse::<f64>().is_ok() || cell == NONE || cell == "flat";
        let shape: Vec<(usize, bool)> = (0..columns)
            .map(|column| {
                let width = cells(column).map(|cell| cell.chars().count()).max().unwrap_or(0);
                (width, cells(column).skip(2).all(is_number))
            })
            .collect();
        for row in &self.rows {
            let mut line = String::new();
            for (cell, &(width, number)) in row.iter().zip(&shape) {
                line.push_str("  ");
                let padding = " ".repeat(width - cell.chars().count());
                match number {
                    true => line.extend([padding.as_str(), cell]),
                    false => line.extend([cell, padding.as_str()]),
                }
            }
            writeln!(f, "{}", line.trim_end())?;
        }
        Ok(())
    }
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
