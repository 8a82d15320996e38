//! OSLO's lens files (`.len`) to the rows of the lens data sheet.
//!
//! A statement ends at the line's end or at `;`, a comment begins at `//`, and a text stands in double quotes. Statements
//! before `NXT` belong to one surface, the object first, and `END` closes the last, the image. What follows may change
//! thicknesses by configuration (`CFG NEW`) and list fields (`RST NEW`); all else behind `END` is how OSLO is to look at it.
//!
//! # Sources
//!
//! Lambda Research, *OSLO Program Reference* and *OSLO Optics Reference* (2021).

use std::collections::BTreeMap;

use super::ZemaxError;
use super::axes::{Axes, Break};
use super::format::LensFormat;
use super::oslo_statement::{Statement, statements};
use super::oslo_surface::{INFINITE, OsloSurface};
use super::row::{Parameter, SheetRow, SurfaceShape};
use super::sheet::{Aperture, ZemaxSheet};

/// Objects from here on are infinitely far.
const FAR_OBJECT: f64 = 1e8;

/// The wavelengths that a lens has whose file names none (µm): the d, F and C lines.
const LINES: [f64; 3] = [0.587_56, 0.486_13, 0.656_27];

/// The most surfaces and configurations.
const MOST_SURFACES: usize = crate::train::MOST_ELEMENTS;
const MOST_CONFIGURATIONS: usize = 1000;

/// Statements that would change the light's way and have no counterpart.
const NOT_TAKEN: [&str; 22] = [
    "APN", "ATP", "AX1", "AX2", "AY1", "AY2", "AAC", "APK", "GRD", "GDT", "GRT", "DFR", "DOE",
    "HOE", "HV1", "KCO", "SPL", "IGS", "LMA", "EXT", "WRM", "NSS",
];

/// A file on its way to a sheet.
struct OsloReader {
    surfaces: Vec<OsloSurface>,
    /// Number of surfaces behind the object, as `LEN` says.
    declared: Option<usize>,
    /// Values that are those of other surfaces, by surface.
    pickups: Vec<(usize, Statement)>,
    wavelengths: Vec<f64>,
    weights: Vec<f64>,
    /// The system's statement on its aperture, and that on its field.
    aperture: Option<Statement>,
    field: Option<Statement>,
    /// Shares of the field, x and y.
    points: Vec<[f64; 2]>,
    /// Thicknesses by configuration and surface.
    thicknesses: BTreeMap<(usize, usize), f64>,
    table: OsloTable,
    is_whole: bool,
}

/// Table that statements behind the last surface belong to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum OsloTable {
    None,
    Configurations,
    Fields,
    Ignored,
}

impl ZemaxSheet {
    /// Reads the text of a `.len` file at a configuration, from 1; the first without.
    pub(super) fn read_oslo(text: &str, configuration: Option<usize>) -> Result<Self, ZemaxError> {
        let mut sheet = Self::of_camera(LensFormat::Oslo);
        let mut reader = OsloReader {
            surfaces: Vec::new(),
            declared: None,
            pickups: Vec::new(),
            wavelengths: LINES.to_vec(),
            weights: Vec::new(),
            aperture: None,
            field: None,
            points: Vec::new(),
            thicknesses: BTreeMap::new(),
            table: OsloTable::None,
            is_whole: false,
        };
        for statement in statements(text)? {
            sheet.last_line = statement.line;
            match reader.is_whole {
                true => reader.read_footer(statement)?,
                false => reader.read(statement, &mut sheet)?,
            }
        }
        reader.check(&sheet)?;
        reader.choose(configuration, &mut sheet)?;
        reader.pick_up()?;
        reader.check_solves(&mut sheet)?;
        reader.put_rows(&mut sheet)?;
        reader.put_system(&mut sheet)?;
        Ok(sheet)
    }
}

impl OsloReader {
    fn read(&mut self, statement: Statement, sheet: &mut ZemaxSheet) -> Result<(), ZemaxError> {
        let word = statement.word().to_owned();
        if word == "LEN" {
            if self.declared.is_some() {
                return Err(
                    statement.error("a second lens in the file; write it into a file of its own")
                );
            }
            statement.text(2).unwrap_or_default().clone_into(&mut sheet.name);
            self.declared = Some(statement.index(statement.words.len().max(2) - 1)?);
            self.surfaces.push(OsloSurface::at(statement.line));
            return Ok(());
        }
        let own = self.surfaces.len().wrapping_sub(1);
        let Some(surface) = self.surfaces.last_mut() else {
            return Err(statement.error(
                "stands before LEN NEW \"name\" scale surfaces; is it an OSLO lens (.len)?",
            ));
        };
        if surface.read(&statement, own, &self.wavelengths)? {
            return Ok(());
        }
        match word.as_str() {
            "NXT" => {
                if self.surfaces.len() >= MOST_SURFACES {
                    return Err(statement.error(format!("more than {MOST_SURFACES} surfaces")));
                }
                self.surfaces.push(OsloSurface::at(statement.line));
            }
            "END" => self.is_whole = true,
            "PK" => self.pickups.push((own, statement)),
            "EBR" | "NAO" | "FNO" | "NAP" => self.aperture = Some(statement),
            "ANG" | "OBH" | "GIH" => self.field = Some(statement),
            "UNI" => {
                sheet.unit = statement.number(1)?;
                if sheet.unit <= 0.0 {
                    return Err(statement.error("millimetres in a unit must be positive"));
                }
            }
            "WV" => self.wavelengths = statement.numbers()?,
            "WW" => self.weights = statement.numbers()?,
            _ if NOT_TAKEN.contains(&word.as_str()) => {
                return Err(statement.error(
                    "has no counterpart here; known of surfaces: RD, CV, TH, GLA, AIR, RFL, RFH, AP, AST, CC, AD to AG, ASP \
                     with ASn, CVX, RDX, DCX to DCZ, TLA to TLC, TOX to TOZ, DT, BEN, GC, RCO, PFL, GSP, GOR, PK",
                ));
            }
            "LMO" if !statement.text(1).is_some_and(|kind| ["EGR", "ELE"].contains(&kind)) => {
                return Err(
                    statement.error("groups that are not sequential have no counterpart here")
                );
            }
            _ => self.read_indexed(&statement, sheet)?,
        }
        Ok(())
    }

    /// `WV2 0.55`, `WW2 1`; all else is left out.
    fn read_indexed(
        &mut self,
        statement: &Statement,
        sheet: &mut ZemaxSheet,
    ) -> Result<(), ZemaxError> {
        let word = statement.word();
        let number = word.get(2..).and_then(|rest| rest.parse::<usize>().ok());
        let list = match word.get(..2) {
            Some("WV") => Some(&mut self.wavelengths),
            Some("WW") => Some(&mut self.weights),
            _ => None,
        };
        match (list, number.and_then(|number| number.checked_sub(1))) {
            (Some(list), Some(slot)) if slot <= list.len() => {
                let value = statement.number(1)?;
                list.truncate(list.len().max(slot));
                match list.get_mut(slot) {
                    Some(old) => *old = value,
                    None => list.push(value),
                }
            }
            (Some(_), Some(_)) => return Err(statement.error("a wavelength before it is missing")),
            (Some(_) | None, _) => sheet.leave_out(word, statement.line),
        }
        Ok(())
    }

    fn read_footer(&mut self, statement: Statement) -> Result<(), ZemaxError> {
        let is_new = statement.text(1).is_some_and(|word| word.eq_ignore_ascii_case("NEW"));
        match (statement.word(), self.table) {
            (_, OsloTable::Ignored) => {}
            ("CFG", _) if is_new => self.table = OsloTable::Configurations,
            ("RST", _) if is_new => self.table = OsloTable::Fields,
            ("LEN", _) => self.table = OsloTable::Ignored,
            ("END", _) => self.table = OsloTable::None,
            ("TH", OsloTable::Configurations) => {
                let (surface, configuration) = (statement.index(1)?, statement.index(2)?);
                if surface >= self.surfaces.len()
                    || !(1..=MOST_CONFIGURATIONS).contains(&configuration)
                {
                    return Err(statement.error(format!(
                        "there is no surface {surface} or no configuration {configuration}"
                    )));
                }
                self.thicknesses.insert((configuration, surface), statement.number(3)?);
            }
            (_, OsloTable::Configurations) => {
                return Err(statement.error(
                    "what a configuration changes here has no counterpart; known: TH. Take the line out, or save the lens \
                     at that configuration",
                ));
            }
            ("F", OsloTable::Fields) => {
                self.points.push([statement.number(3)?, statement.number(2)?]);
            }
            (_, OsloTable::Fields | OsloTable::None) => {}
        }
        Ok(())
    }

    /// Checks that the file is whole.
    fn check(&self, sheet: &ZemaxSheet) -> Result<(), ZemaxError> {
        let error = |why: String| Err(ZemaxError::new(sheet.last_line.max(1), why));
        let Some(declared) = self.declared else {
            return error("no LEN NEW in the file; is it an OSLO lens (.len)?".to_owned());
        };
        if !self.is_whole {
            return error("the file ends before END: it is cut short".to_owned());
        }
        if self.surfaces.len() != declared + 1 {
            return error(format!(
                "LEN announces {declared} surfaces behind the object, and the file has {}: a part of it is missing",
                self.surfaces.len() - 1
            ));
        }
        Ok(())
    }

    /// Puts the thicknesses of a configuration in place.
    fn choose(
        &mut self,
        configuration: Option<usize>,
        sheet: &mut ZemaxSheet,
    ) -> Result<(), ZemaxError> {
        sheet.configurations =
            self.thicknesses.keys().map(|(number, _)| *number).max().unwrap_or(1);
        // What is beyond them is told by who chooses.
        let chosen = configuration.filter(|chosen| (1..=sheet.configurations).contains(chosen));
        sheet.configuration = chosen.unwrap_or(1);
        for ((number, surface), thickness) in &self.thicknesses {
            if *number == sheet.configuration {
                let surface = &mut self.surfaces[*surface];
                surface.thickness = Some(*thickness);
                surface.solves = None;
            }
        }
        Ok(())
    }

    /// Puts values of other surfaces in place, in the order of surfaces.
    fn pick_up(&mut self) -> Result<(), ZemaxError> {
        for (own, statement) in &self.pickups {
            let from = statement.surface(2, *own)?;
            if from == *own {
                return Err(statement.error("a surface takes values of one before it"));
            }
            let offset = || if statement.text(3).is_some() { statement.number(3) } else { Ok(0.0) };
            let kind = statement.text(1).unwrap_or_default().to_ascii_uppercase();
            let sign = if kind.ends_with('M') { -1.0 } else { 1.0 };
            let source = self.surfaces[from].clone();
            match kind.as_str() {
                "CV" | "CVM" => self.surfaces[*own].take_shape(&source, sign, offset()?),
                "TH" | "THM" => {
                    let thickness = sign * source.thickness.unwrap_or(0.0) + offset()?;
                    self.surfaces[*own].thickness = Some(thickness);
                }
                "LN" | "LNM" => {
                    // The length from one vertex to another.
                    let to = statement.surface(3, *own)?;
                    let to = if to == 0 { *own } else { to };
                    let range = self.surfaces.get(from..to).unwrap_or_default();
                    let length: f64 =
                        range.iter().map(|surface| surface.thickness.unwrap_or(0.0)).sum();
                    let more = if statement.text(4).is_some() { statement.number(4)? } else { 0.0 };
                    self.surfaces[*own].thickness = Some(sign * length + more);
                }
                "AP" => self.surfaces[*own].aperture = source.aperture,
                "GLA" => {
                    if source.mirror {
                        return Err(statement.error("a glass is taken from a mirror"));
                    }
                    self.surfaces[*own].glass = source.glass;
                }
                "TD" | "TDM" => {
                    if source.global.is_some() || source.returns.is_some() || source.bends {
                        return Err(statement.error(
                            "tilts of a surface with GC, RCO or BEN are not taken over; write them out",
                        ));
                    }
                    self.surfaces[*own].take_place(&source, sign);
                }
                other => {
                    return Err(statement.error(format!(
                        "a pickup of {other} has no counterpart here; known: CV, CVM, TH, THM, LN, LNM, AP, GLA, TD, TDM"
                    )));
                }
            }
        }
        Ok(())
    }

    /// Solves are not solved: their values stand, or the sensor goes where one puts it.
    fn check_solves(&mut self, sheet: &mut ZemaxSheet) -> Result<(), ZemaxError> {
        let last = self.surfaces.len().saturating_sub(2);
        for (i, surface) in self.surfaces.iter().enumerate() {
            let Some((line, word, target)) = &surface.solves else { continue };
            let focuses = i == last && word == "PY" && *target == 0.0;
            match (word.as_str(), surface.thickness) {
                ("PU" | "PUC", _) | ("PY" | "PYC" | "EC", Some(_)) => sheet.notes.push(format!(
                    "line {line}: {word} is not solved; the value that stands in the file is taken"
                )),
                _ if focuses && !self.object_is_near() => sheet.notes.push(format!(
                    "line {line}: the sensor stands at the paraxial image of infinity, as {word} 0 has it"
                )),
                _ => {
                    let why = format!("{word}: solves are not solved, and no TH stands in the file; write its value");
                    return Err(ZemaxError::new(*line, why));
                }
            }
        }
        Ok(())
    }

    fn object_is_near(&self) -> bool {
        self.object().is_finite()
    }

    /// From the object to the first surface, in the file's unit.
    fn object(&self) -> f64 {
        let thickness = self.surfaces[0].thickness.unwrap_or(0.0);
        if thickness.abs() >= FAR_OBJECT { f64::INFINITY } else { thickness }
    }

    fn put_rows(&mut self, sheet: &mut ZemaxSheet) -> Result<(), ZemaxError> {
        // OSLO's own stop is the first surface.
        if !self.surfaces.iter().any(|surface| surface.stop) && self.surfaces.len() > 1 {
            self.surfaces[1].stop = true;
        }
        if let Some(last) = self.surfaces.iter().rposition(|surface| surface.stop) {
            self.surfaces[..last].iter_mut().for_each(|surface| surface.stop = false);
        }
        // The image's thickness moves the image.
        if let [.., before, image] = &mut self.surfaces[..] {
            let shift = image.thickness.take().filter(|shift| shift.is_finite() && *shift != 0.0);
            if let (Some(shift), Some(thickness)) = (shift, before.thickness) {
                before.thickness = Some(thickness + shift);
                sheet
                    .notes
                    .push(format!("line {}: the image is moved by its TH, {shift}", image.line));
            }
        }
        let mut rows = Vec::new();
        for surface in &self.surfaces {
            rows.push(surface.row(sheet.unit)?);
        }
        rows[0].thickness = self.object();
        if self.surfaces.iter().skip(1).any(OsloSurface::is_moved) {
            return self.put_moved(rows, sheet);
        }
        sheet.rows = rows;
        Ok(())
    }

    /// Rows with breaks between them that lead from the axes of one surface to those of the next.
    fn put_moved(&self, rows: Vec<SheetRow>, sheet: &mut ZemaxSheet) -> Result<(), ZemaxError> {
        let unit = sheet.unit;
        let mut places: Vec<Axes> = Vec::new();
        let mut next = Axes::default();
        for (i, surface) in self.surfaces.iter().enumerate() {
            let error = |why: &str| ZemaxError::new(surface.line, why);
            let known = |places: &[Axes], number: usize| {
                places
                    .get(number)
                    .copied()
                    .ok_or_else(|| error("GC or RCO names a surface that comes later"))
            };
            let base = match surface.global {
                Some(number) => known(&places, number)?,
                None => next,
            };
            // What stands at the object moves the object alone.
            let own = if i == 0 { base } else { surface.axes(&base, unit) };
            places.push(own);
            let goes_on = match surface.returns {
                Some(number) if number == i => base,
                Some(number) => known(&places, number)?,
                None if surface.bends && !surface.mirror => {
                    return Err(error("BEN: only a mirror (RFL) bends the axis"));
                }
                None if surface.bends => surface.bent(&own),
                None => own,
            };
            let thickness = surface.thickness.unwrap_or(0.0);
            if i > 0 && thickness.abs() >= INFINITE {
                return Err(error("TH is infinite inside the lens"));
            }
            next = if i == 0 { Axes::default() } else { goes_on.advanced(thickness * unit) };
        }
        add_placed(rows, &places, unit, sheet);
        Ok(())
    }

    fn put_system(&self, sheet: &mut ZemaxSheet) -> Result<(), ZemaxError> {
        if self.wavelengths.iter().any(|um| *um <= 0.0) {
            return Err(ZemaxError::new(1, "WV: wavelengths (µm) must be positive"));
        }
        sheet.set_wavelengths(self.wavelengths.clone());
        sheet.wavelength_weights.clone_from(&self.weights);
        let object = self.object();
        if let Some(statement) = &self.aperture {
            let value = statement.number(1)?;
            if value <= 0.0 {
                return Err(statement.error(format!("{value} must be positive")));
            }
            let below_one = |sine: f64| match sine < 1.0 {
                true => Ok(sine),
                false => Err(statement.error(format!("{sine} must be below 1 in air"))),
            };
            let aperture = match statement.word() {
                "EBR" if object.is_infinite() => Aperture::EntrancePupil(2.0 * value),
                // The height at the first surface of the ray from the object's point on the axis.
                "EBR" => Aperture::AtObject((value / object.abs()).atan().sin()),
                "NAO" => Aperture::AtObject(below_one(value)?),
                "NAP" => Aperture::FNumber(0.5 / below_one(value)?),
                _ => Aperture::FNumber(value),
            };
            sheet.aperture = Some((statement.line, aperture));
        }
        let Some(statement) = &self.field else { return Ok(()) };
        let greatest = statement.number(1)?;
        let mut points = self.points.clone();
        if points.is_empty() {
            points = vec![[0.0, 0.0], [0.0, 0.7], [0.0, 1.0]];
        }
        let is_angle = statement.word() == "ANG";
        sheet.fields.kind = match statement.word() {
            "ANG" => 0,
            "OBH" => 1,
            _ => 2,
        };
        // Shares of a field angle are shares of its tangent.
        let value = |share: f64| match is_angle {
            true => (share * greatest.to_radians().tan()).atan().to_degrees(),
            false => share * greatest,
        };
        sheet.fields.x = points.iter().map(|point| value(point[0])).collect();
        sheet.fields.y = points.iter().map(|point| value(point[1])).collect();
        Ok(())
    }
}

/// Adds rows to a sheet, each at its axes (mm): thicknesses and coordinate breaks lead from one to the next.
pub(super) fn add_placed(rows: Vec<SheetRow>, places: &[Axes], unit: f64, sheet: &mut ZemaxSheet) {
    let mut before = Axes::default();
    let count = rows.len();
    for (i, (mut row, place)) in rows.into_iter().zip(places).enumerate() {
        // The object stands before all axes.
        if i == 0 {
            sheet.rows.push(row);
            continue;
        }
        let (gap, turn) = before.to(place);
        // The first stands where the file's axes begin.
        if let (true, Some(last)) = (i > 1, sheet.rows.last_mut()) {
            last.thickness = gap / unit;
        }
        if turn != Break::default() {
            sheet.rows.push(coordinate_break(&turn, row.line, unit));
        }
        before = *place;
        if i + 1 == count {
            row.thickness = 0.0;
        }
        sheet.rows.push(row);
    }
}

fn coordinate_break(by: &Break, line: usize, unit: f64) -> SheetRow {
    let mut row = SheetRow { line, shape: SurfaceShape::CoordinateBreak, ..SheetRow::default() };
    let lengths = by.decentre.map(|length| length / unit);
    for (i, value) in lengths.into_iter().chain(by.tilt).enumerate() {
        row.parameters.insert(i + 1, Parameter { line, value });
    }
    row
}
