//! Lines to the rows of the lens data sheet.
//!
//! A line is a command and its values. Commands of surfaces belong to the `SURF` above them, however lines
//! are indented: what a command is about is in its name.

use std::collections::BTreeMap;

use super::ZemaxError;
use super::fields::Fields;
use super::format::LensFormat;
use super::line::{ConfigurationValue, SheetLine};
use super::row::{Parameter, SheetRow};

/// The most surfaces.
const MOST_SURFACES: usize = crate::train::MOST_ELEMENTS;

/// The most wavelengths, as OpticStudio has it.
const MOST_WAVELENGTHS: usize = 24;

/// The most surfaces of which a note of one kind is made.
const MOST_NOTED: usize = 5;

/// A whole file.
#[derive(Debug, Default)]
pub(super) struct ZemaxSheet {
    pub(super) format: LensFormat,
    pub(super) name: String,
    /// Millimetres in the file's unit of length.
    pub(super) unit: f64,
    pub(super) rows: Vec<SheetRow>,
    /// The system's aperture and its line.
    pub(super) aperture: Option<(usize, Aperture)>,
    /// In the order in which glasses are looked for.
    pub(super) makers: Vec<String>,
    /// In the file's unit.
    pub(super) stated_efl: Option<f64>,
    pub(super) last_line: usize,
    pub(super) wavelengths: Vec<f64>,
    pub(super) primary: usize,
    pub(super) fields: Fields,
    /// Number of configurations, the one in place from 1, and the values of all.
    pub(super) configurations: usize,
    pub(super) configuration: usize,
    pub(super) values: Vec<ConfigurationValue>,
    /// Of the wavelengths, in their order; empty where all weigh the same.
    pub(super) wavelength_weights: Vec<f64>,
    /// Sentences on what the file says, for its user.
    pub(super) notes: Vec<String>,
    pub(super) ignored: BTreeMap<String, IgnoredCommand>,
}

/// Width of the beam.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Aperture {
    /// The entrance pupil's diameter, in the file's unit.
    EntrancePupil(f64),
    FNumber(f64),
    /// The sine of the half angle of the cone from the object's point on the axis.
    AtObject(f64),
}

#[derive(Debug)]
pub(super) struct IgnoredCommand {
    first: usize,
    times: usize,
}

impl ZemaxSheet {
    pub(super) fn read(text: &str) -> Result<Self, ZemaxError> {
        let mut sheet = Self { unit: 1.0, configurations: 1, configuration: 1, ..Self::default() };
        let mut in_surface = false;
        for (number, written) in text.lines().enumerate().map(|(i, line)| (i + 1, line)) {
            // A command, and what it is given.
            let trimmed = written.trim();
            let (command, rest) = trimmed.split_once(char::is_whitespace).unwrap_or((trimmed, ""));
            let line = SheetLine { number, command, rest: rest.trim() };
            sheet.last_line = number;
            let known = match command {
                "" => true,
                "SURF" => {
                    sheet.begin_surface(&line)?;
                    in_surface = true;
                    true
                }
                _ if sheet.read_header(&line)? => {
                    in_surface = false;
                    true
                }
                _ => match sheet.rows.last_mut() {
                    Some(row) if in_surface => row.read(&line)?,
                    // What would change the light's way is not dropped.
                    _ if SheetRow::default().read(&line)? => {
                        return Err(line.error(
                            "it belongs to a surface, and none is begun here: write it below its SURF",
                        ));
                    }
                    _ => false,
                },
            };
            if !known {
                sheet.leave_out(line.command, line.number);
            }
        }
        if sheet.rows.is_empty() {
            return Err(ZemaxError::new(1, "no SURF in the file; is it a sequential Zemax lens?"));
        }
        sheet.check_end(in_surface && ends_inside_of_a_line(text))?;
        Ok(sheet)
    }

    /// Refuses a file whose end is missing: its last surface is no image. `in_line` is whether the text ends inside
    /// of a line of it.
    fn check_end(&self, in_line: bool) -> Result<(), ZemaxError> {
        // What has no surface between is told by who wants one.
        let [_, .., image] = self.rows.as_slice() else { return Ok(()) };
        let number = self.rows.len() - 1;
        let why = if in_line && image.is_closed {
            "the last line has no end".to_owned()
        } else if !image.is_closed {
            format!("SURF {number} has no DISZ")
        } else if image.thickness != 0.0 {
            format!(
                "the last surface, SURF {number}, has a distance of {} behind it (DISZ)",
                image.thickness
            )
        } else if image.glass.is_some() || image.mirror || image.stop {
            format!(
                "the last surface, SURF {number}, is a glass, a mirror or the stop, and no image"
            )
        } else {
            return Ok(());
        };
        let why = format!(
            "{why}: the file is cut short. Save it again; where it is whole, end it by an image surface with DISZ 0 and a \
             line break"
        );
        Err(ZemaxError::new(self.last_line, why))
    }

    fn begin_surface(&mut self, line: &SheetLine<'_>) -> Result<(), ZemaxError> {
        if line.index(0)? != self.rows.len() {
            return Err(line.error(format!("expected surface {} here", self.rows.len())));
        }
        if self.rows.len() >= MOST_SURFACES {
            return Err(line.error(format!("more than {MOST_SURFACES} surfaces")));
        }
        self.rows.push(SheetRow { line: line.number, ..SheetRow::default() });
        Ok(())
    }

    /// Reads a line of the header; false if it is not understood.
    fn read_header(&mut self, line: &SheetLine<'_>) -> Result<bool, ZemaxError> {
        match line.command {
            "NAME" => line.rest.trim_matches('"').clone_into(&mut self.name),
            "MODE" if line.word(0) == Some("SEQ") => {}
            "MODE" => return Err(line.error("only sequential lenses (MODE SEQ) can be imported")),
            "UNIT" => self.unit = unit(line)?,
            "ENPD" | "FNUM" | "OBNA" => self.set_aperture(line)?,
            // The stop's own size.
            "FLOA" => self.aperture = None,
            "GCAT" => self.makers = line.rest.split_whitespace().map(maker).collect(),
            "WAVM" => {
                let (number, weight) = (line.index(0)?, line.number_or(2, 1.0)?);
                self.set_wavelength(number, line.number(1)?);
                let slot = number.clamp(1, MOST_WAVELENGTHS) - 1;
                self.wavelength_weights.resize(self.wavelength_weights.len().max(slot + 1), 1.0);
                self.wavelength_weights[slot] = weight;
            }
            "WWGT" | "WWGN" => self.wavelength_weights = line.numbers()?,
            "FWGT" | "FWGN" => self.fields.weights = line.numbers()?,
            "VDXN" => self.fields.vignetting[0] = line.numbers()?,
            "VDYN" => self.fields.vignetting[1] = line.numbers()?,
            "VCXN" | "VCYN" => {
                // At 1 nothing is left of the pupil.
                let factors = line.numbers()?;
                if let Some(factor) = factors.iter().find(|factor| **factor >= 1.0) {
                    return Err(line.error(format!("the factor {factor} must be below 1")));
                }
                self.fields.vignetting[if line.command == "VCXN" { 2 } else { 3 }] = factors;
            }
            "VANN" => self.fields.vignetting[4] = line.numbers()?,
            "WAVL" | "WAVN" => self.wavelengths = line.numbers()?,
            "PWAV" | "PRIM" => self.primary = line.index(0)?,
            "FTYP" => self.fields.set_kind(line)?,
            "XFLN" => self.fields.x = line.numbers()?,
            "YFLN" => self.fields.y = line.numbers()?,
            "MNUM" => {
                self.configurations = line.index(0)?.max(1);
                self.configuration = line.index(1).unwrap_or(1);
            }
            "EFFL" => self.state_focal_length(line)?,
            "NOTE" => {
                self.stated_efl = self.stated_efl.or_else(|| focal_length_in_words(line.rest));
                return Ok(false);
            }
            _ => match ConfigurationValue::read(line)? {
                Some(value) if self.configurations > 1 => self.values.push(value),
                Some(_) | None => return Ok(false),
            },
        }
        if line.command == "NAME" {
            self.stated_efl = self.stated_efl.or_else(|| focal_length_in_words(line.rest));
        }
        Ok(true)
    }

    fn set_aperture(&mut self, line: &SheetLine<'_>) -> Result<(), ZemaxError> {
        let value = line.number(0)?;
        // Files list apertures that are not in use with the value 0.
        if value == 0.0 {
            return Ok(());
        }
        if value < 0.0 {
            return Err(line.error(format!("{value} must be positive")));
        }
        let aperture = match line.command {
            "ENPD" => Aperture::EntrancePupil(value),
            // The half angle of the cone of light at the object (degrees).
            // OpticStudio's aperture type 5, "object cone angle": the marginal ray's angle off the axis in
            // degrees (its help on SYPR code 10 and on system apertures); type 2 is the numerical aperture.
            "OBNA" if line.number_or(1, 0.0)? == 1.0 => {
                if value >= 90.0 {
                    return Err(line.error(format!("a cone of {value} degrees must be below 90")));
                }
                Aperture::AtObject(value.to_radians().sin())
            }
            "OBNA" if value >= 1.0 => {
                return Err(line.error(format!("{value} must be below 1 in air")));
            }
            "OBNA" => Aperture::AtObject(value),
            _ => Aperture::FNumber(value),
        };
        self.aperture = Some((line.number, aperture));
        Ok(())
    }

    /// All wavelengths (µm), in their order.
    pub(super) fn set_wavelengths(&mut self, micrometres: Vec<f64>) {
        // As many as there are: none is a slot that is not in use.
        self.fields.wavelengths = Some(micrometres.len());
        self.wavelengths = micrometres;
    }

    /// The primary one, from 1.
    pub(super) fn set_primary(&mut self, number: usize) {
        self.primary = number;
    }

    /// Counts a command that is left out.
    pub(super) fn leave_out(&mut self, command: &str, line: usize) {
        let ignored = self
            .ignored
            .entry(command.to_owned())
            .or_insert(IgnoredCommand { first: line, times: 0 });
        ignored.times += 1;
    }

    fn set_wavelength(&mut self, number: usize, micrometres: f64) {
        // Numbered from 1.
        let slot = number.clamp(1, MOST_WAVELENGTHS) - 1;
        if self.wavelengths.len() <= slot {
            self.wavelengths.resize(slot + 1, micrometres);
        }
        self.wavelengths[slot] = micrometres;
    }

    /// `EFFL value`, or the operand of the merit function with a target that has a weight.
    fn state_focal_length(&mut self, line: &SheetLine<'_>) -> Result<(), ZemaxError> {
        let numbers = line.numbers()?;
        let stated = match numbers[..] {
            [value] => Some(value),
            [_, _, _, _, _, _, target, weight, ..] if weight != 0.0 => Some(target),
            _ => None,
        };
        self.stated_efl = stated.filter(|efl| *efl != 0.0).or(self.stated_efl);
        Ok(())
    }

    /// Wavelengths (nm) in use, the primary one first, and their weights; none where the file weighs none.
    pub(super) fn wavelengths_nm(&self) -> (Vec<f64>, Vec<f64>) {
        let used = match self.fields.wavelengths {
            Some(count) if count > 0 => count,
            // Slots that are not in use repeat the same value.
            _ => {
                let last = self.wavelengths.last();
                let fill = self.wavelengths.iter().rev().take_while(|w| Some(*w) == last).count();
                self.wavelengths.len() + 1 - fill.max(1)
            }
        };
        let used = &self.wavelengths[..used.min(self.wavelengths.len()).min(MOST_WAVELENGTHS)];
        let (mut all, mut weights): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
        let primary = self.primary.max(1) - 1;
        let primary = if primary < used.len() { primary } else { 0 };
        for i in std::iter::once(primary).chain(0..used.len()) {
            let Some(micrometres) = used.get(i) else { continue };
            // Micrometres to three decimals more than anyone writes: 0.55 * 1000 is 550.
            let nanometres = (micrometres * 1e9).round() / 1e6;
            if nanometres > 0.0 && !all.contains(&nanometres) {
                all.push(nanometres);
                weights.push(self.wavelength_weights.get(i).copied().unwrap_or(1.0));
            }
        }
        // Those that make no mean weigh nothing against each other.
        let is_mean = weights.iter().all(|weight| *weight >= 0.0 && weight.is_finite())
            && weights.iter().any(|weight| *weight > 0.0);
        let are_equal = weights.iter().all(|weight| Some(weight) == weights.first());
        if are_equal || !is_mean {
            weights.clear();
        }
        (all, weights)
    }

    /// Place of something in the file, for messages: a line or, in files in which surfaces have
    /// none, a surface.
    pub(super) fn place(&self, line: usize) -> String {
        match (self.format.words().surfaces, line) {
            (None, line) => format!("line {line}"),
            (Some(_), 0) => "the file".to_owned(),
            (Some(surfaces), number) => format!("{surfaces}[{}]", number - 1),
        }
    }

    /// Sentences on numbers of surfaces that their type has no use for here.
    fn unread_parameters(&self) -> Vec<String> {
        let unread = |row: &SheetRow| {
            let known = row.shape.parameters();
            let is_unread = |(number, parameter): &(&usize, &Parameter)| {
                !known.contains(*number) && parameter.value != 0.0
            };
            let numbers: Vec<(usize, usize)> = row
                .parameters
                .iter()
                .filter(is_unread)
                .map(|(number, parameter)| (*number, parameter.line))
                .collect();
            let (_, line) = *numbers.first()?;
            let names: Vec<String> =
                numbers.iter().map(|(number, _)| format!("PARM {number}")).collect();
            let which = names.join(", ");
            Some(format!(
                "line {line}: {which} of this type of surface is left out; it is read as if it were 0"
            ))
        };
        self.rows.iter().filter_map(unread).take(MOST_NOTED).collect()
    }

    pub(super) fn what_is_left_out(&self) -> Vec<String> {
        let mut notes = self.notes.clone();
        notes.extend(self.unread_parameters());
        if self.configurations > 1 {
            notes.push(format!(
                "of {} configurations, number {} is taken",
                self.configurations, self.configuration
            ));
        }
        if self.wavelengths.iter().any(|&micrometres| micrometres <= 0.0) {
            notes.push("a wavelength of 0 or less is none, and is left out".to_owned());
        }
        if !self.wavelengths.is_empty() && self.primary > self.wavelengths.len() {
            notes.push(format!(
                "the primary wavelength is number {} of {}; the first is taken",
                self.primary,
                self.wavelengths.len()
            ));
        }
        let mut left_out: Vec<(&String, &IgnoredCommand)> = self.ignored.iter().collect();
        left_out.sort_by_key(|(_, ignored)| ignored.first);
        let words: Vec<String> = left_out
            .iter()
            .map(|(command, ignored)| match ignored.times {
                1 => format!("{command} ({})", self.place(ignored.first)),
                times => {
                    format!("{command} ({times} times, first in {})", self.place(ignored.first))
                }
            })
            .collect();
        if !words.is_empty() {
            notes.push(format!("{} left out: {}", self.format.words().commands, words.join(", ")));
        }
        notes
    }
}

fn unit(line: &SheetLine<'_>) -> Result<f64, ZemaxError> {
    match line.word(0) {
        Some("MM") => Ok(1.0),
        Some("CM") => Ok(10.0),
        Some("IN" | "INCH") => Ok(25.4),
        Some("M" | "METER") => Ok(1000.0),
        other => {
            let found = other.unwrap_or_default();
            Err(line.error(format!("unknown unit `{found}`; known: MM, CM, IN, METER")))
        }
    }
}

/// True if a text may have lost the rest of its last line: there is no line break behind it, nor an
/// exponent of two digits, which programs write in full.
fn ends_inside_of_a_line(text: &str) -> bool {
    let exponent = text.rsplit_once(['e', 'E']).map_or("", |(_, exponent)| exponent);
    let digits = exponent.trim_start_matches(['+', '-']);
    let is_whole = digits.len() >= 2 && digits.bytes().all(|byte| byte.is_ascii_digit());
    !(text.ends_with(['\n', '\r']) || is_whole)
}

/// A catalogue's name as ours: `SCHOTT_2000` is Schott.
fn maker(catalogue: &str) -> String {
    catalogue.split(['_', '-']).next().unwrap_or_default().to_owned()
}

/// `EFL 50`, `EFL=50 mm`, `EFFL: 50` somewhere in a title or a note.
fn focal_length_in_words(text: &str) -> Option<f64> {
    let upper = text.to_ascii_uppercase();
    ["EFFL", "EFL"].iter().find_map(|word| {
        let after = &upper[upper.find(word)? + word.len()..];
        let after = after.trim_start_matches([' ', '=', ':', '\t']);
        let end = after
            .find(|c: char| !(c.is_ascii_digit() || c == '.' || c == '-' || c == '+'))
            .unwrap_or(after.len());
        after[..end].parse().ok().filter(|efl: &f64| *efl != 0.0)
    })
}
