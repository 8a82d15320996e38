//! CODE V's sequential files (`.seq`) to the rows of the same lens data sheet.
//!
//! A command ends at the line's end or at `;`, goes on behind `&`, and a comment begins at `!`. `SO`, `S` and `SI` begin a
//! surface with radius, thickness and glass; what follows belongs to it.
//!
//! # Sources
//!
//! The commands are those of CODE V's *Lens System Setup Reference Manual* as files in the wild have them. Its α and β turn
//! left-handed, γ right-handed.

use super::ZemaxError;
use super::format::LensFormat;
use super::row::{Parameter, SheetGlass, SheetOpening, SheetRow, SurfaceShape};
use super::sheet::{Aperture, ZemaxSheet};
use crate::glass::{GlassSpec, Makers};

/// Thicknesses from here on are infinite.
const INFINITE: f64 = 1e10;

/// Letters of the coefficients of r⁴, r⁶, ….
const LETTERS: [&str; 9] = ["A", "B", "C", "D", "E", "F", "G", "H", "J"];

/// Commands that would change the light's way and have no counterpart.
const NOT_TAKEN: [&str; 24] = [
    "CYL", "XTO", "YTO", "AAS", "DIF", "GRT", "GRO", "GRX", "GRY", "GRZ", "DOE", "HOE", "SPS",
    "UDS", "ZRN", "XDD", "YDD", "GRN", "RET", "REV", "ZDE", "GLB", "NSS", "MFL",
];

/// Surface as it is read, before it becomes rows.
#[derive(Debug, Default)]
struct CodeVSurface {
    row: SheetRow,
    line: usize,
    decentre: [f64; 2],
    /// α, β and γ (degrees).
    angles: [f64; 3],
    returns: bool,
    bends: bool,
    half_box: [Option<f64>; 2],
    half_ellipse: [Option<f64>; 2],
}

/// One command with its place.
struct CodeVCommand<'a> {
    line: usize,
    words: Vec<&'a str>,
}

impl CodeVCommand<'_> {
    fn error(&self, why: impl std::fmt::Display) -> ZemaxError {
        ZemaxError::new(self.line, format!("{}: {why}", self.words[0]))
    }

    /// The number at `i`, behind a surface such as `S3` where there is one.
    fn number(&self, i: usize) -> Result<f64, ZemaxError> {
        let word = self.words.get(i).ok_or_else(|| self.error("a number is missing"))?;
        // The program itself writes 0.1e21.
        if word.eq_ignore_ascii_case("inf") {
            return Ok(1e20);
        }
        let number = word.parse::<f64>().ok().filter(|number| number.is_finite());
        number.ok_or_else(|| self.error(format!("`{word}` is not a number")))
    }

    fn numbers(&self) -> Result<Vec<f64>, ZemaxError> {
        (1..self.words.len()).map(|i| self.number(i)).collect()
    }
}

/// The commands of a text: lines taken apart and put together.
fn commands(text: &str) -> Vec<CodeVCommand<'_>> {
    let mut found: Vec<CodeVCommand<'_>> = Vec::new();
    let mut goes_on = false;
    for (number, line) in text.lines().enumerate().map(|(i, line)| (i + 1, line)) {
        let line = line.split('!').next().unwrap_or_default().trim();
        for (i, part) in line.split(';').enumerate() {
            let continues = part.trim_end().ends_with('&');
            let words = part.trim().trim_end_matches('&').split_whitespace();
            match found.last_mut() {
                Some(last) if goes_on && i == 0 => last.words.extend(words),
                _ => {
                    let words: Vec<&str> = words.collect();
                    if !words.is_empty() {
                        found.push(CodeVCommand { line: number, words });
                    }
                }
            }
            goes_on = continues;
        }
    }
    found
}

impl ZemaxSheet {
    /// Reads the text of a `.seq` file.
    pub(super) fn read_code_v(text: &str) -> Result<Self, ZemaxError> {
        let mut sheet = Self { format: LensFormat::CodeV, ..Self::default() };
        (sheet.unit, sheet.configurations, sheet.configuration) = (1.0, 1, 1);
        let mut surface: Option<CodeVSurface> = None;
        let (mut by_radius, mut is_whole) = (true, false);
        let mut in_catalogue = false;
        for command in commands(text) {
            sheet.last_line = command.line;
            let word = command.words[0].to_ascii_uppercase();
            // Glasses of the file's own.
            if in_catalogue || word == "PRV" {
                in_catalogue = word != "END";
                if word == "PRV" {
                    sheet.leave_out("PRV", command.line);
                }
                continue;
            }
            match word.as_str() {
                "RDM" => {
                    by_radius =
                        !command.words.get(1).is_some_and(|yes| yes.starts_with(['N', 'n']));
                }
                "LEN" | "GO" => {}
                "S" | "SO" | "SI" => {
                    if let Some(surface) = surface.take() {
                        surface.end(&mut sheet)?;
                    } else if word != "SO" {
                        return Err(command.error("the object (SO) comes first"));
                    }
                    surface = Some(begin(&command, by_radius)?);
                    is_whole |= word == "SI";
                }
                _ => {
                    let known = match &mut surface {
                        Some(surface) => {
                            surface.read(&word, &command)? || sheet.header(&word, &command)?
                        }
                        None => sheet.header(&word, &command)?,
                    };
                    if !known {
                        sheet.leave_out(&word, command.line);
                    }
                }
            }
        }
        match surface {
            Some(surface) if is_whole => surface.end(&mut sheet)?,
            Some(_) => {
                let why = "the file ends before its image (SI): it is cut short";
                return Err(ZemaxError::new(sheet.last_line.max(1), why));
            }
            None => {
                return Err(ZemaxError::new(1, "no SO in the file; is it a CODE V lens (.seq)?"));
            }
        }
        Ok(sheet)
    }

    /// True if a command of the whole system is understood.
    fn header(&mut self, word: &str, command: &CodeVCommand<'_>) -> Result<bool, ZemaxError> {
        let aperture = |value: f64, aperture: fn(f64) -> Aperture| {
            let why = || command.error(format!("{value} must be positive"));
            (value > 0.0).then(|| aperture(value)).ok_or_else(why)
        };
        match word {
            "TIT" | "TITLE" => {
                command.words[1..].join(" ").trim_matches(['\'', '"']).clone_into(&mut self.name);
            }
            "DIM" => {
                self.unit = match command.words.get(1).map(|unit| unit.to_ascii_uppercase()) {
                    Some(unit) if unit.starts_with('M') => 1.0,
                    Some(unit) if unit.starts_with('C') => 10.0,
                    Some(unit) if unit.starts_with('I') => 25.4,
                    _ => return Err(command.error("expected M, C or I")),
                }
            }
            "WL" => {
                let micrometres = command.numbers()?.into_iter().map(|nm| nm * 1e-3);
                self.set_wavelengths(micrometres.collect());
            }
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a count, and it saturates"
            )]
            "REF" => self.set_primary(command.number(1)? as usize),
            "EPD" => {
                self.aperture =
                    Some((command.line, aperture(command.number(1)?, Aperture::EntrancePupil)?));
            }
            "FNO" => {
                self.aperture =
                    Some((command.line, aperture(command.number(1)?, Aperture::FNumber)?));
            }
            "NAO" => {
                let sine = command.number(1)?;
                if sine >= 1.0 {
                    return Err(command.error(format!("{sine} must be below 1 in air")));
                }
                self.aperture = Some((command.line, aperture(sine, Aperture::AtObject)?));
            }
            "XAN" | "YAN" => {
                let values = command.numbers()?;
                let fields = if word == "XAN" { &mut self.fields.x } else { &mut self.fields.y };
                *fields = values;
            }
            _ => return Ok(false),
        }
        Ok(true)
    }
}

/// A surface by `S radius thickness glass`.
fn begin(command: &CodeVCommand<'_>, by_radius: bool) -> Result<CodeVSurface, ZemaxError> {
    let number = |i: usize| match command.words.get(i) {
        None => Ok(0.0),
        // Values that are solved for stand with their number elsewhere.
        Some(_) => command.number(i),
    };
    let (shape, thickness) = (number(1)?, number(2)?);
    let curvature = match (by_radius, shape) {
        (_, 0.0) => 0.0,
        (true, radius) if radius.abs() >= INFINITE => 0.0,
        (true, radius) => 1.0 / radius,
        (false, curvature) => curvature,
    };
    let mut surface = CodeVSurface { line: command.line, ..CodeVSurface::default() };
    surface.row.line = command.line;
    surface.row.curvature = curvature;
    surface.row.thickness = if thickness >= INFINITE { f64::INFINITY } else { thickness };
    match command.words.get(3) {
        None => {}
        Some(word) if word.eq_ignore_ascii_case("REFL") => surface.row.mirror = true,
        Some(word) if word.eq_ignore_ascii_case("REFR") || word.eq_ignore_ascii_case("AIR") => {}
        Some(word) => surface.row.glass = Some(glass(command, word)?),
    }
    Ok(surface)
}

/// `NBK7_SCHOTT`, `'BSM24'`, `517000.642000` or `1.517:64.2`.
fn glass(command: &CodeVCommand<'_>, word: &str) -> Result<SheetGlass, ZemaxError> {
    let word = word.trim_matches(['\'', '"']);
    let line = command.line;
    let model = |nd: f64, vd: f64| SheetGlass::model(line, word, nd, vd);
    if let Some((nd, vd)) = word.split_once(':')
        && let (Ok(nd), Ok(vd)) = (nd.parse::<f64>(), vd.parse::<f64>())
    {
        return Ok(model(nd, vd));
    }
    if let Some((index, abbe)) = word.split_once('.') {
        let digits =
            |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
        if digits(index) && digits(abbe) {
            let share = |text: &str| format!("0.{text}").parse::<f64>().unwrap_or(0.0);
            return Ok(model(1.0 + share(index), 100.0 * share(abbe)));
        }
    }
    let (name, maker) = match word.split_once('_') {
        Some((name, maker)) => (name, Some(maker)),
        None => (word, None),
    };
    let makers: Vec<&str> = maker.into_iter().collect();
    Ok(SheetGlass { line, name: hyphened(name, &makers), spec: None })
}

/// A name as the catalogue has it: NBK7 is N-BK7, and SLAH53 S-LAH53.
pub(super) fn hyphened(name: &str, makers: &[&str]) -> String {
    let hyphened = (name.len() > 1 && name.is_char_boundary(1))
        .then(|| format!("{}-{}", &name[..1], &name[1..]));
    let known =
        |name: &str| GlassSpec::Named(name.to_owned()).resolve_among(&[], Makers(makers)).is_ok();
    match hyphened {
        Some(hyphened) if !known(name) && known(&hyphened) => hyphened,
        _ => name.to_owned(),
    }
}

impl CodeVSurface {
    /// True if a command of a surface is understood.
    fn read(&mut self, word: &str, command: &CodeVCommand<'_>) -> Result<bool, ZemaxError> {
        if NOT_TAKEN.contains(&word) {
            return Err(command.error(
                "has no counterpart here; known of surfaces: SPH, CON, ASP, K, A to J, STO, CIR, REX, REY, ELX, ELY, ADX, ADY, \
                 XDE, YDE, ADE, BDE, DAR, BEN, REFL",
            ));
        }
        let row = &mut self.row;
        match word {
            "STO" => row.stop = true,
            "SPH" | "CON" | "SLB" => {}
            "ASP" => row.shape = SurfaceShape::ExtendedAsphere,
            "K" => row.conic = command.number(1)?,
            "CIR" => match command.words.get(1).map(|word| word.to_ascii_uppercase()).as_deref() {
                Some("OBS") => row.openings.push(SheetOpening::Disk(command.number(2)?)),
                Some("EDG") => row.set_semi_diameter(command.number(2)?),
                Some("HOL") => row.inner = command.number(2)?,
                _ => row.set_clear(command.number(1)?),
            },
            "REX" => self.half_box[0] = Some(command.number(1)?),
            "REY" => self.half_box[1] = Some(command.number(1)?),
            "ELX" => self.half_ellipse[0] = Some(command.number(1)?),
            "ELY" => self.half_ellipse[1] = Some(command.number(1)?),
            "ADX" => row.aperture_decentre[0] = command.number(1)?,
            "ADY" => row.aperture_decentre[1] = command.number(1)?,
            "XDE" => self.decentre[0] = command.number(1)?,
            "YDE" => self.decentre[1] = command.number(1)?,
            "ADE" => self.angles[0] = command.number(1)?,
            "BDE" => self.angles[1] = command.number(1)?,
            "CDE" => self.angles[2] = command.number(1)?,
            "DAR" => self.returns = true,
            "BEN" => self.bends = true,
            "CUY" => row.curvature = command.number(command.words.len() - 1)?,
            "THI" => row.thickness = command.number(command.words.len() - 1)?,
            letter if LETTERS.contains(&letter) => {
                let i = LETTERS.iter().position(|known| *known == letter).unwrap_or(0);
                let value = command.number(1)?;
                row.shape = SurfaceShape::ExtendedAsphere;
                let mut put = |number: usize, value: f64| {
                    row.extra.insert(number, Parameter { line: command.line, value });
                };
                // As an extended asphere has them: their number, a radius of 1, and r², r⁴, ….
                put(1, 10.0);
                put(2, 1.0);
                put(i + 4, value);
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// The rows that it becomes.
    fn end(mut self, sheet: &mut ZemaxSheet) -> Result<(), ZemaxError> {
        for (half, shape) in [
            (self.half_box, SheetOpening::Rectangle as fn([f64; 2]) -> SheetOpening),
            (self.half_ellipse, SheetOpening::Ellipse),
        ] {
            match half {
                [None, None] => {}
                [Some(x), Some(y)] if x > 0.0 && y > 0.0 => self.row.openings.push(shape([x, y])),
                _ => {
                    let why = "an aperture has two positive half widths (REX and REY, ELX and ELY)";
                    return Err(ZemaxError::new(self.line, why));
                }
            }
        }
        let [alpha, beta, gamma] = self.angles;
        let values = [self.decentre[0], self.decentre[1], -alpha, -beta, gamma];
        if values.iter().all(|value| *value == 0.0) {
            sheet.rows.push(self.row);
            return Ok(());
        }
        let line = self.line;
        let turn = |values: [f64; 5], flag: f64, thickness: f64| {
            let mut row = SheetRow::default();
            (row.line, row.thickness) = (line, thickness);
            row.shape = SurfaceShape::CoordinateBreak;
            for (i, value) in values.into_iter().chain([flag]).enumerate() {
                row.parameters.insert(i + 1, Parameter { line, value });
            }
            row
        };
        let thickness = std::mem::take(&mut self.row.thickness);
        sheet.rows.extend([turn(values, 0.0, 0.0), self.row]);
        if self.returns {
            sheet.rows.push(turn(values.map(|value| -value), 1.0, thickness));
        } else if self.bends {
            // The turns once more, in the other order.
            let [_, _, about_x, about_y, _] = values;
            sheet.rows.push(turn([0.0, 0.0, 0.0, about_y, 0.0], 0.0, 0.0));
            sheet.rows.push(turn([0.0, 0.0, about_x, 0.0, 0.0], 0.0, thickness));
        } else if let Some(last) = sheet.rows.last_mut() {
            last.thickness = thickness;
        }
        Ok(())
    }
}
