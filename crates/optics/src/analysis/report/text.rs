//! The report as text for a person, and as comma-separated values.

use std::fmt::{self, Display, Formatter};

use etendue_chart::significant;
use etendue_report::{Cell, Table};

use super::WaveReport;

fn number(value: f64) -> Cell {
    Cell::number(value, significant(value))
}

fn some(value: Option<f64>) -> Cell {
    value.map_or_else(Cell::none, number)
}

/// Of frequencies, lengths and small lengths on the image.
pub(super) fn units_of(report: &WaveReport) -> [&'static str; 3] {
    match report.image_unit {
        "mrad" => ["cycles/mrad", "mrad", "urad"],
        _ => ["cycles/mm", "mm", "um"],
    }
}

fn of_mtf(report: &WaveReport, values: [fn(&super::Modulation) -> f64; 2]) -> Table {
    let mut titles = vec!["frequency".to_owned()];
    let [frequency, ..] = units_of(report);
    let mut units = vec![frequency];
    for field in &report.fields {
        titles.extend([format!("{} tangential", field.name), format!("{} sagittal", field.name)]);
        units.extend(["", ""]);
    }
    let titles: Vec<&str> = titles.iter().map(String::as_str).collect();
    let mut table = Table::new(&titles).with_units(&units).indented(2);
    let rows = report.fields.first().map_or(0, |field| field.mtf.len());
    for row in 0..rows {
        let mut cells = vec![number(report.fields[0].mtf[row].frequency)];
        for field in &report.fields {
            let at = &field.mtf[row];
            let shown = |value: f64| Cell::number(value, format!("{value:.4}"));
            cells.extend(values.map(|value| shown(value(at))));
        }
        table.push(cells);
    }
    table
}

fn stop_shifts(shifts: &[super::super::seidel::StopShift]) -> Table {
    let mut table = Table::new(&["without", "stop z", "entrance pupil z", "S_II", "S_III", "C_II"])
        .with_units(&["", "mm", "mm", "", "", ""])
        .indented(2);
    for shift in shifts {
        let sums = [shift.total.coma, shift.total.astigmatism, shift.total.lateral_colour];
        // No minus before zeros.
        let shown = |value: f64| format!("{:.6}", (value * 1e6).round() / 1e6 + 0.0);
        let without = Cell::word(shift.without.replace('_', " "));
        let places = [some(shift.stop_z), some(shift.entrance_pupil_z)];
        let sums = sums.map(|value| Cell::number(value, shown(value)));
        table.push([without].into_iter().chain(places).chain(sums));
    }
    table
}

impl WaveReport {
    /// Fields in waves.
    fn fields_table(&self) -> Table {
        let unit = if self.planes.object_z.is_none() { "deg" } else { "mm" };
        let [_, image, small] = units_of(self);
        let mut table = Table::new(&[
            "field",
            "image y",
            "RMS",
            "P-V",
            "best RMS",
            "best focus",
            "Strehl",
            "f-number t",
            "f-number s",
            "Airy radius",
            "illumination",
            "cells",
        ])
        .with_units(&[
            unit, image, "waves", "waves", "waves", "mm", "", "", "", small, "%", "a side",
        ])
        .indented(2);
        for field in &self.fields {
            let refocus = field.best_fit.centre[2] - field.sphere.centre[2];
            table.push([
                number(field.field),
                number(field.sphere.centre[1]),
                number(field.rms),
                number(field.peak_to_valley),
                number(field.best_fit.rms),
                number(refocus),
                Cell::number(field.strehl, format!("{:.4}", field.strehl)),
                number(field.working_f_number[0]),
                number(field.working_f_number[1]),
                number(1e3 * field.airy_radius),
                number(100.0 * field.relative_pupil),
                Cell::count(field.cells as u64),
            ]);
        }
        table
    }

    /// Fringe terms of every field.
    fn zernike_table(&self) -> Table {
        let mut titles = vec!["#".to_owned(), "Fringe term".to_owned()];
        titles.extend(self.fields.iter().map(|field| field.name.clone()));
        let titles: Vec<&str> = titles.iter().map(String::as_str).collect();
        let mut table = Table::new(&titles).indented(2);
        let Some(first) = self.fields.first() else { return table };
        for (i, term) in first.fringe.coefficients.iter().enumerate() {
            let mut cells = vec![Cell::count(term.index as u64), Cell::word(term.name.clone())];
            let waves = self.fields.iter().map(|field| field.fringe.coefficients[i].waves);
            // No minus before zeros.
            let shown = |waves: f64| format!("{:.4}", (waves * 1e4).round() / 1e4 + 0.0);
            cells.extend(waves.map(|waves| Cell::number(waves, shown(waves))));
            table.push(cells);
        }
        table
    }

    fn seidel_table(&self) -> Option<Table> {
        let seidel = self.seidel.as_ref()?;
        let mut table =
            Table::new(&["#", "S_I", "S_II", "S_III", "S_IV", "S_V", "C_I", "C_II"]).indented(2);
        let all = seidel.surfaces.iter().enumerate().map(|(i, sums)| (i.to_string(), sums));
        for (name, s) in all.chain([("all".to_owned(), &seidel.total)]) {
            let values = [
                s.spherical,
                s.coma,
                s.astigmatism,
                s.petzval,
                s.distortion,
                s.longitudinal_colour,
                s.lateral_colour,
            ];
            let shown = values.map(|value| Cell::number(value, format!("{value:.6}")));
            table.push([Cell::word(name)].into_iter().chain(shown));
        }
        Some(table)
    }

    fn foci_table(&self) -> Table {
        let mut table =
            Table::new(&["field", "image y", "tangential focus", "sagittal focus", "chief ray"])
                .with_units(&["", units_of(self)[1], "mm", "mm", "deg"])
                .indented(2);
        for foci in &self.foci {
            table.push([
                Cell::word(foci.field.clone()),
                number(foci.height),
                some(foci.tangential),
                some(foci.sagittal),
                number(foci.chief_angle),
            ]);
        }
        table
    }

    /// Tables by name, for spreadsheets.
    #[must_use]
    pub fn csv(&self) -> Vec<(&'static str, String)> {
        let mut files = vec![
            ("waves.csv", self.fields_table().csv()),
            ("mtf.csv", of_mtf(self, [|m| m.tangential, |m| m.sagittal]).csv()),
            (
                "mtf-geometric.csv",
                of_mtf(self, [|m| m.geometric_tangential, |m| m.geometric_sagittal]).csv(),
            ),
            ("zernike.csv", self.zernike_table().csv()),
            ("field-curvature.csv", self.foci_table().csv()),
        ];
        files.extend(self.seidel_table().map(|table| ("seidel.csv", table.csv())));
        files
    }

    /// Tables with their headings, as text.
    pub(super) fn tables(&self) -> Vec<(String, Table)> {
        let mut all = vec![
            (self.heading(), self.fields_table()),
            (
                "Modulation, by diffraction".to_owned(),
                of_mtf(self, [|m| m.tangential, |m| m.sagittal]),
            ),
            (
                "Modulation, by rays".to_owned(),
                of_mtf(self, [|m| m.geometric_tangential, |m| m.geometric_sagittal]),
            ),
        ];
        if let (Some(seidel), Some(table)) = (&self.seidel, self.seidel_table()) {
            let [short, long] = seidel.colours;
            let what = format!(
                "Seidel's sums (mm) for {}; C_I and C_II from {short} to {long} nm",
                seidel.field
            );
            all.push((what, table));
            if !seidel.stop_shifts.is_empty() {
                all.push((
                    "Stop shift: where the stop would have to be (same marginal ray)".to_owned(),
                    stop_shifts(&seidel.stop_shifts),
                ));
            }
        }
        if !self.foci.is_empty() {
            all.push((
                "Foci of narrow fans from the image plane (Coddington)".to_owned(),
                self.foci_table(),
            ));
        }
        let circle = "Zernike terms, Fringe (waves), on the circle about the chief ray that the lit \
                      pupil fits in";
        all.push((circle.to_owned(), self.zernike_table()));
        all
    }

    fn heading(&self) -> String {
        let pairs = self.wavelengths.iter().zip(&self.weights);
        let colours: Vec<String> =
            pairs.map(|(nm, weight)| format!("{nm} nm x {}", significant(*weight))).collect();
        let object = match (self.planes.object_z, self.planes.magnification) {
            (Some(z), Some(m)) => {
                format!("object at z = {} mm, magnification {}", significant(z), significant(m))
            }
            _ => "object at infinity".to_owned(),
        };
        let place = match self.image_unit {
            "mrad" => "by angles, behind an ideal lens of 1000 mm".to_owned(),
            _ => format!("on the plane z = {} mm", significant(self.planes.image_z)),
        };
        format!(
            "In waves {place} ({}); {}. Taken: fields ({}), wavelengths ({}), weights \
             ({}), object ({})",
            object,
            colours.join(", "),
            self.taken.fields,
            self.taken.wavelengths,
            self.taken.weights,
            self.taken.object,
        )
    }
}

impl Display for WaveReport {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        for (heading, table) in self.tables() {
            write!(f, "\n{heading}\n{table}")?;
        }
        if !self.notes.is_empty() {
            writeln!(f)?;
        }
        self.notes.iter().try_for_each(|note| writeln!(f, "note: {note}"))
    }
}
