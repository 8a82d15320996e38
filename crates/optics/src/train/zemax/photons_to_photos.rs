//! Tables of `PhotonsToPhotos`' Optical Bench to the rows of the lens data sheet.
//!
//! Sections in brackets, cells between tabs. `[lens data]` has a row a surface: its name, radius (`AS` is the stop, `FS` a
//! field stop, `CG` a plane of cover glass), thickness, nd of what follows, diameter, Abbe number. A cell may name a row of
//! `[variable distances]`, whose columns are the configurations. `[aspherical data]` has name, radius, conic constant and
//! coefficients: of r⁴, r⁶, …; of r², r⁴, … with the constant `AsphericalA2`; with `AsphericalOddCount n`, of r³, r⁴, …
//! without gaps until n odd powers are had, and of even ones from there on.
//!
//! # Sources
//!
//! W. Claff's Optical Bench Hub, `photonstophotos.net`, and readers of its files in public: `rayoptics.zemax`'s neighbour
//! `obench` (M. Hayford) and Beam42 (D. Majumdar).

use std::collections::BTreeMap;

use super::ZemaxError;
use super::format::LensFormat;
use super::row::{Parameter, SheetGlass, SheetRow, SurfaceShape};
use super::sheet::{Aperture, ZemaxSheet};
use crate::glass::{GlassSpec, Makers};

/// The most configurations; zoom lenses are stated at three to six.
const MOST_CONFIGURATIONS: usize = 100;

/// A named glass whose nd differs from the stated one by more than this is another one.
const SAME_INDEX: f64 = 1e-3;

/// The F, d and C lines (µm), d first.
const LINES: [f64; 3] = [0.587_56, 0.486_13, 0.656_27];

/// A row of cells with its line.
struct TableRow<'a> {
    line: usize,
    cells: Vec<&'a str>,
}

impl TableRow<'_> {
    fn error(&self, why: impl Into<String>) -> ZemaxError {
        ZemaxError::new(self.line, why)
    }

    /// A cell that is not empty.
    fn cell(&self, i: usize) -> Option<&str> {
        self.cells.get(i).copied().filter(|cell| !cell.is_empty())
    }
}

/// A file taken apart.
#[derive(Default)]
struct OpticalBenchTable<'a> {
    title: String,
    constants: Vec<TableRow<'a>>,
    variables: BTreeMap<String, TableRow<'a>>,
    surfaces: Vec<TableRow<'a>>,
    aspheres: Vec<TableRow<'a>>,
    /// Configurations, from 1.
    count: usize,
    /// The one that is taken, from 0.
    taken: usize,
}

impl ZemaxSheet {
    /// Reads the text of a table at a configuration, from 1; the first without.
    pub(super) fn read_photons_to_photos(
        text: &str,
        configuration: Option<usize>,
    ) -> Result<Self, ZemaxError> {
        let mut sheet = Self::of_camera(LensFormat::PhotonsToPhotos);
        let mut table = OpticalBenchTable::read(text, &mut sheet)?;
        // What is beyond them is told by who chooses.
        let chosen = configuration.filter(|chosen| (1..=table.count).contains(chosen));
        table.taken = chosen.unwrap_or(1) - 1;
        (sheet.configurations, sheet.configuration) = (table.count, table.taken + 1);
        std::mem::take(&mut table.title).clone_into(&mut sheet.name);
        sheet.set_wavelengths(LINES.to_vec());
        let object = table.object()?;
        sheet.rows.push(SheetRow { thickness: object, ..SheetRow::default() });
        for cells in &table.surfaces {
            let row = table.surface(cells, &mut sheet)?;
            sheet.rows.push(row);
        }
        table.put_aspheres(&mut sheet)?;
        sheet.rows.push(SheetRow { line: sheet.last_line, ..SheetRow::default() });
        table.put_system(object.is_infinite(), &mut sheet)?;
        Ok(sheet)
    }
}

impl<'a> OpticalBenchTable<'a> {
    fn read(text: &'a str, sheet: &mut ZemaxSheet) -> Result<Self, ZemaxError> {
        let mut table = Self { count: 1, ..Self::default() };
        let mut section = String::new();
        for (line, written) in text.lines().enumerate().map(|(i, line)| (i + 1, line)) {
            sheet.last_line = line;
            let written = written.split('#').next().unwrap_or_default();
            if written.trim().is_empty() {
                continue;
            }
            if written.trim_start().starts_with('[') {
                section = written.trim().to_ascii_lowercase();
                continue;
            }
            let cells = TableRow { line, cells: written.split('\t').map(str::trim).collect() };
            let key = cells.cell(0).unwrap_or_default().to_owned();
            match section.as_str() {
                "[descriptive data]" => {
                    if key.eq_ignore_ascii_case("title") {
                        cells.cell(1).unwrap_or_default().clone_into(&mut table.title);
                    }
                }
                "[constants]" => table.constants.push(cells),
                "[variable distances]" => {
                    let values = cells.cells[1..].iter().filter(|cell| !cell.is_empty()).count();
                    if values > MOST_CONFIGURATIONS {
                        return Err(cells.error(format!("more than {MOST_CONFIGURATIONS} values")));
                    }
                    table.count = table.count.max(values);
                    table.variables.insert(key, cells);
                }
                "[lens data]" => table.surfaces.push(cells),
                "[aspherical data]" => table.aspheres.push(cells),
                "" => {
                    return Err(cells.error("stands before the first section, such as [lens data]"));
                }
                other => sheet.leave_out(other, line),
            }
        }
        if table.surfaces.is_empty() {
            let why =
                "no row in [lens data]: the file is cut short, or no table of the Optical Bench";
            return Err(ZemaxError::new(sheet.last_line.max(1), why));
        }
        Ok(table)
    }

    /// The value of a variable at the configuration that is taken; one alone counts for all.
    fn variable(&self, name: &str) -> Result<Option<f64>, ZemaxError> {
        let found = self.variables.iter().find(|(known, _)| known.eq_ignore_ascii_case(name));
        let Some((_, cells)) = found else { return Ok(None) };
        let values: Vec<&str> =
            cells.cells[1..].iter().copied().filter(|c| !c.is_empty()).collect();
        let value = match values[..] {
            [] => return Ok(None),
            [one] => one,
            _ => values.get(self.taken).copied().ok_or_else(|| {
                cells.error(format!(
                    "{name} has {} values of {} configurations",
                    values.len(),
                    self.count
                ))
            })?,
        };
        number(value)
            .map(Some)
            .ok_or_else(|| cells.error(format!("{name}: `{value}` is not a number")))
    }

    /// A length in a cell, or of the variable that it names.
    fn length(
        &self,
        cells: &TableRow<'_>,
        i: usize,
        what: &str,
    ) -> Result<Option<f64>, ZemaxError> {
        let Some(word) = cells.cell(i) else { return Ok(None) };
        match number(word) {
            Some(value) => Ok(Some(value)),
            None => match self.variable(word)? {
                Some(value) => Ok(Some(value)),
                None => Err(cells.error(format!(
                    "{what}: `{word}` is neither a number nor a row of [variable distances]"
                ))),
            },
        }
    }

    /// From the object to the first surface.
    fn object(&self) -> Result<f64, ZemaxError> {
        Ok(self.variable("d0")?.unwrap_or(f64::INFINITY))
    }

    fn surface(
        &self,
        cells: &TableRow<'_>,
        sheet: &mut ZemaxSheet,
    ) -> Result<SheetRow, ZemaxError> {
        let word = cells.cell(1).ok_or_else(|| cells.error("a radius is missing"))?;
        let is_plane = ["AS", "FS", "CG"].iter().any(|plane| word.eq_ignore_ascii_case(plane));
        let curvature = match (is_plane, number(word)) {
            (true, _) => 0.0,
            (false, Some(radius)) if radius.is_infinite() || radius == 0.0 => 0.0,
            (false, Some(radius)) => 1.0 / radius,
            (false, None) => {
                return Err(cells.error(format!(
                    "the radius `{word}` is no number; known words: AS, FS, CG, Infinity"
                )));
            }
        };
        let thickness = self.length(cells, 2, "thickness")?;
        let mut row = SheetRow {
            line: cells.line,
            curvature,
            thickness: thickness
                .ok_or_else(|| cells.error("a thickness is missing: the row is cut short"))?,
            stop: word.eq_ignore_ascii_case("AS"),
            ..SheetRow::default()
        };
        let diameter = self.length(cells, 4, "diameter")?.filter(|diameter| diameter.is_finite());
        if diameter.is_some_and(|diameter| diameter < 0.0) {
            return Err(cells.error("the diameter must not be below zero"));
        }
        match row.stop {
            true => row.set_semi_diameter(0.5 * diameter.unwrap_or(0.0)),
            false => row.set_clear(0.5 * diameter.unwrap_or(0.0)),
        }
        row.glass = self.glass(cells, sheet)?;
        Ok(row)
    }

    /// By nd and Abbe number, or the named glass that has this nd.
    fn glass(
        &self,
        cells: &TableRow<'_>,
        sheet: &mut ZemaxSheet,
    ) -> Result<Option<SheetGlass>, ZemaxError> {
        let Some(nd) = self.length(cells, 3, "nd")?.filter(|nd| *nd != 1.0) else {
            return Ok(None);
        };
        if let Some(name) = cells.cell(6) {
            let makers: Vec<&str> = cells.cell(7).into_iter().collect();
            let found = GlassSpec::Named(name.to_owned()).resolve_among(&[], Makers(&makers));
            let index = found.ok().and_then(|glass| glass.index(1e3 * LINES[0]).ok());
            if index.is_some_and(|index| (index - nd).abs() < SAME_INDEX) {
                return Ok(Some(SheetGlass {
                    line: cells.line,
                    name: name.to_owned(),
                    spec: None,
                }));
            }
            sheet.notes.push(format!(
                "line {}: the glass {name} is not one here that has nd {nd}; its numbers are taken",
                cells.line
            ));
        }
        let vd = self.length(cells, 5, "vd")?;
        if vd.is_none() {
            sheet.notes.push(format!(
                "line {}: no Abbe number is given; the glass disperses nothing",
                cells.line
            ));
        }
        let name = format!("{nd}");
        Ok(Some(SheetGlass::model(cells.line, &name, nd, vd.unwrap_or(0.0))))
    }

    /// Number of odd powers, and the first power of all.
    fn powers(&self) -> Result<(usize, usize), ZemaxError> {
        for cells in &self.constants {
            let key = cells.cell(0).unwrap_or_default();
            if key.eq_ignore_ascii_case("AsphericalA2") {
                return Ok((0, 2));
            }
            if key.eq_ignore_ascii_case("AsphericalOddCount") {
                let count = cells.cell(1).and_then(|word| word.parse().ok());
                let why = "AsphericalOddCount: expected a whole number";
                return match count.ok_or_else(|| cells.error(why))? {
                    0 => Ok((0, 4)),
                    count => Ok((count, 3)),
                };
            }
        }
        Ok((0, 4))
    }

    fn put_aspheres(&self, sheet: &mut ZemaxSheet) -> Result<(), ZemaxError> {
        let (odd, first) = self.powers()?;
        for cells in &self.aspheres {
            let name = cells.cell(0).unwrap_or_default();
            let place = self.surfaces.iter().position(|surface| surface.cell(0) == Some(name));
            let place =
                place.ok_or_else(|| cells.error(format!("[lens data] has no surface `{name}`")))?;
            let numbers =
                cells.cells.iter().enumerate().skip(2).filter(|(_, cell)| !cell.is_empty());
            let row = &mut sheet.rows[place + 1];
            let mut coefficients = BTreeMap::new();
            for (i, word) in numbers {
                let value = number(word).filter(|value| value.is_finite());
                let value =
                    value.ok_or_else(|| cells.error(format!("`{word}` is not a number")))?;
                match i.checked_sub(3) {
                    None => row.conic = value,
                    Some(k) if value != 0.0 => {
                        coefficients.insert(power(k, odd, first), value);
                    }
                    Some(_) => {}
                }
            }
            shape(row, cells, &coefficients)?;
        }
        Ok(())
    }

    /// Fields by the angle of view, and the opening by the f-number where the object is at infinity.
    fn put_system(&self, is_far: bool, sheet: &mut ZemaxSheet) -> Result<(), ZemaxError> {
        let line = |name: &str| self.variables.get(name).map_or(1, |cells| cells.line);
        if let Some(angle) =
            self.variable("Angle of View")?.filter(|angle| (0.0..180.0).contains(angle))
        {
            sheet.fields.y = vec![0.0, 0.35 * angle, 0.5 * angle];
        }
        let closed = sheet.rows.iter().any(|row| row.stop && row.semi_diameter().is_some());
        match self.variable("F-Number")?.filter(|number| *number > 0.0 && number.is_finite()) {
            Some(f_number) if is_far => {
                sheet.aperture = Some((line("F-Number"), Aperture::FNumber(f_number)));
            }
            Some(f_number) if closed => sheet.notes.push(format!(
                "line {}: the f-number {f_number} is that of a near object; the stop has the diameter of its row",
                line("F-Number")
            )),
            Some(_) | None => {}
        }
        sheet.stated_efl =
            self.variable("Focal Length")?.filter(|efl| *efl != 0.0 && efl.is_finite() && is_far);
        for (name, cells) in &self.variables {
            let is_known =
                ["Focal Length", "Angle of View", "F-Number", "d0"].contains(&name.as_str());
            let is_named = |surface: &TableRow<'_>| {
                surface.cells.iter().any(|cell| cell.eq_ignore_ascii_case(name))
            };
            if !is_known && !self.surfaces.iter().any(is_named) {
                sheet.leave_out(name, cells.line);
            }
        }
        Ok(())
    }
}

/// The power of coefficient `k`, from 0.
fn power(k: usize, odd: usize, first: usize) -> usize {
    // Pairs of an odd and an even power, then even ones alone.
    let paired = 2 * odd;
    match k < paired {
        true => first + k,
        false => first + paired + usize::from(odd > 0) + 2 * (k - paired),
    }
}

/// Puts coefficients by power of r.
fn shape(
    row: &mut SheetRow,
    cells: &TableRow<'_>,
    coefficients: &BTreeMap<usize, f64>,
) -> Result<(), ZemaxError> {
    let line = cells.line;
    let Some((&highest, _)) = coefficients.last_key_value() else { return Ok(()) };
    if highest > 30 {
        return Err(cells.error(format!(
            "powers beyond r^30 have no counterpart here, and there is r^{highest}"
        )));
    }
    if coefficients.keys().all(|power| power % 2 == 0) {
        row.shape = SurfaceShape::ExtendedAsphere;
        let mut put = |number: usize, value: f64| {
            row.extra.insert(number, Parameter { line, value });
        };
        // As an extended asphere has them: their number, a radius of 1, and r², r⁴, ….
        put(1, 15.0);
        put(2, 1.0);
        for (power, value) in coefficients {
            put(2 + power / 2, *value);
        }
        return Ok(());
    }
    row.shape = SurfaceShape::Freeform;
    let aspheric = coefficients.iter().map(|(power, value)| (power.to_string(), *value)).collect();
    row.freeform = Some(Box::new(crate::element::FreeformSpec { aspheric, ..Default::default() }));
    Ok(())
}

/// A number; `Infinity` is one.
fn number(word: &str) -> Option<f64> {
    if word.to_ascii_lowercase().starts_with("inf") {
        return Some(f64::INFINITY);
    }
    let is_plain = word.starts_with(|c: char| c.is_ascii_digit() || ['-', '+', '.'].contains(&c));
    word.parse::<f64>().ok().filter(|number| is_plain && number.is_finite())
}
