//! Tables of pbrt's realistic camera to the rows of the lens data sheet.
//!
//! Four numbers an interface, from the object side to the film: radius of curvature, thickness, index behind it, and the
//! diameter of its aperture (mm). A radius of 0 is the stop. `#` begins a comment.
//!
//! # Sources
//!
//! M. Pharr, W. Jakob and G. Humphreys, *Physically Based Rendering*, 4th edition, section 5.3 (online), and
//! `RealisticCamera` of its program.

use super::ZemaxError;
use super::format::LensFormat;
use super::row::{Parameter, SheetGlass, SheetRow, SurfaceShape};
use super::sheet::ZemaxSheet;
use crate::glass::GlassSpec;

/// One surface of a camera that traces through a table of them (mm).
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Interface {
    /// As rows have it.
    pub(super) line: usize,
    /// Along x and along y; 0 for the stop.
    pub(super) radius: [f64; 2],
    pub(super) conic: [f64; 2],
    pub(super) thickness: f64,
    /// Medium behind the interface; `None` for air.
    pub(super) glass: Option<GlassSpec>,
    /// Half its clear diameter; 0 where nothing limits it.
    pub(super) semi_aperture: f64,
    /// True if the interface is a diaphragm.
    pub(super) is_stop: bool,
}

impl ZemaxSheet {
    /// Reads the text of a `.dat` table.
    pub(super) fn read_pbrt(text: &str) -> Result<Self, ZemaxError> {
        let mut sheet = Self::of_camera(LensFormat::Pbrt);
        let mut numbers: Vec<(usize, f64)> = Vec::new();
        for (line, written) in text.lines().enumerate().map(|(i, line)| (i + 1, line)) {
            let (values, comment) = written.split_once('#').unwrap_or((written, ""));
            // The first thing that is said of it.
            let comment = comment.trim().trim_matches('"');
            if sheet.name.is_empty() && numbers.is_empty() && comment.contains(char::is_alphabetic)
            {
                comment.clone_into(&mut sheet.name);
            }
            for word in values.split([' ', '\t', ',']).filter(|word| !word.trim().is_empty()) {
                let number = word.trim().parse::<f64>().ok().filter(|number| number.is_finite());
                let why = || ZemaxError::new(line, format!("`{}` is not a number", word.trim()));
                numbers.push((line, number.ok_or_else(why)?));
            }
            sheet.last_line = line;
        }
        if numbers.len() % 4 == 1 && numbers.get(1).is_some_and(|next| next.0 != numbers[0].0) {
            let (line, focal_length) = numbers.remove(0);
            sheet.notes.push(format!(
                "line {line}: a number alone before the table, {focal_length}, is a focal length of pbrt-v2-spectral, \
                 and is left out"
            ));
        }
        let (rows, rest) = numbers.as_chunks::<4>();
        if let Some((line, _)) = rest.first() {
            let why = format!(
                "the table has {} numbers, which is no multiple of four (radius, thickness, index, diameter): it is cut \
                 short, or a number is missing",
                numbers.len()
            );
            return Err(ZemaxError::new(*line, why));
        }
        let interfaces = rows.iter().map(|[radius, thickness, index, diameter]| {
            let glass = (index.1 != 0.0 && index.1 != 1.0).then_some(GlassSpec::Constant(index.1));
            Interface {
                line: radius.0,
                radius: [radius.1; 2],
                conic: [0.0; 2],
                thickness: thickness.1,
                glass,
                semi_aperture: 0.5 * diameter.1,
                is_stop: radius.1 == 0.0,
            }
        });
        let interfaces: Vec<Interface> = interfaces.collect();
        sheet.add_interfaces(&interfaces)?;
        Ok(sheet)
    }

    /// A sheet for a table of a camera, in millimetres, that names neither wavelengths nor fields.
    pub(super) fn of_camera(format: LensFormat) -> Self {
        Self { format, unit: 1.0, configurations: 1, configuration: 1, ..Self::default() }
    }

    /// Adds the rows of a table, between an object at infinity and the film.
    pub(super) fn add_interfaces(&mut self, interfaces: &[Interface]) -> Result<(), ZemaxError> {
        let Some(last) = interfaces.last() else {
            let why = "the table has no surface\nhint: give it rows of radius, thickness, index and aperture";
            return Err(ZemaxError::new(self.last_line, why));
        };
        if last.thickness != 0.0 {
            self.notes.push(format!(
                "{}: the film stands {} mm behind the last surface, as the table has it; the camera that it is for \
                 focuses by itself",
                self.place(last.line),
                last.thickness
            ));
        }
        self.rows.push(SheetRow { thickness: f64::INFINITY, ..SheetRow::default() });
        let (mut has_stop, mut in_glass) = (false, false);
        for interface in interfaces {
            let mut row = interface.row()?;
            if interface.is_stop {
                if in_glass || interface.glass.is_some() {
                    let why = "the stop (radius 0) bends no light, and a glass touches it\nhint: give it an index of 0 or 1 \
                               and air in front, or write a plane as a radius of 1e9";
                    return Err(ZemaxError::new(interface.line, why));
                }
                if has_stop {
                    let why = "a second stop (radius 0): a lens has one\nhint: write another diaphragm as a radius of \
                               1e9 with its diameter";
                    return Err(ZemaxError::new(interface.line, why));
                }
                (has_stop, row.stop) = (true, true);
            }
            in_glass = row.glass.is_some();
            self.rows.push(row);
        }
        self.rows.push(SheetRow { line: last.line, ..SheetRow::default() });
        Ok(())
    }
}

impl Interface {
    fn row(&self) -> Result<SheetRow, ZemaxError> {
        let numbers = [self.radius, self.conic, [self.thickness, self.semi_aperture]];
        if numbers.as_flattened().iter().any(|number| !number.is_finite()) {
            return Err(ZemaxError::new(self.line, "a number is infinite or none"));
        }
        if self.semi_aperture < 0.0 {
            return Err(ZemaxError::new(self.line, "the aperture must not be below zero"));
        }
        let bend = |radius: f64| if radius == 0.0 { 0.0 } else { 1.0 / radius };
        let glass = self.glass.clone().map(|spec| SheetGlass {
            line: self.line,
            name: spec.to_string(),
            spec: Some(spec),
        });
        let mut row = SheetRow {
            line: self.line,
            curvature: bend(self.radius[1]),
            conic: self.conic[1],
            thickness: self.thickness,
            glass,
            ..SheetRow::default()
        };
        row.set_clear(self.semi_aperture);
        if self.radius[0] != self.radius[1] || self.conic[0] != self.conic[1] {
            row.shape = SurfaceShape::Biconic;
            for (i, value) in [(1, self.radius[0]), (2, self.conic[0])] {
                row.parameters.insert(i, Parameter { line: self.line, value });
            }
        }
        Ok(row)
    }
}
