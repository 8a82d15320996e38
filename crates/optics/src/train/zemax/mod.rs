//! Lenses from other programs' files: Zemax OpticStudio's sequential `.zmx` files and, by way of the same lens data
//! sheet, those of CODE V, OSLO, optiland, ISET, pbrt and `PhotonsToPhotos`.
//!
//! | module | idea |
//! |---|---|
//! | `sheet`, `row` | lines to the lens data sheet, and to its rows |
//! | `parts` | a row to what it is |
//! | `line` | bytes to text, UTF-8 or UTF-16, and a line to its command and values |
//! | `configuration` | the values of one position of a zoom lens |
//! | `fields` | field points to field angles |
//! | `axes` | coordinate breaks to tilts and decentrings |
//! | `format` | which program a file is of, and what its users call things |
//! | `code_v` | lines of CODE V's files to the same rows |
//! | `oslo`, `oslo_statement`, `oslo_surface` | OSLO's files, their statements, and what those say of one surface |
//! | `optiland`, `optiland_system` | surfaces of optiland's JSON, what it says of the whole, and its numbers |
//! | `stop` | the stop's opening |
//! | `pbrt`, `iset` | tables of pbrt's realistic camera, and ISET's JSON, which has the same |
//! | `photons_to_photos` | tables of `PhotonsToPhotos`' Optical Bench |
//! | `write`, `write_surface` | a lens file to lines, and those of a surface |
//! | here | rows to the elements of a lens file |
//!
//! What has no counterpart here and would change the light's way is an error that names its line;
//! what is left out is listed.
//!
//! # Sources
//!
//! The format has no public specification. What the lines mean is taken from files in the wild and
//! from OpticStudio's knowledge base ("Rotation Matrix and Tilt About X/Y/Z in OpticStudio", 2021).

mod axes;
mod code_v;
mod configuration;
mod fields;
mod format;
mod iset;
mod line;
mod optiland;
mod optiland_system;
mod oslo;
mod oslo_statement;
mod oslo_surface;
mod parts;
mod pbrt;
mod photons_to_photos;
mod row;
mod sheet;
mod stop;
mod write;
mod write_surface;

use std::path::Path;

use glam::DVec3;

use super::{Isometry, LensFile, OpticalTrain, SensorMount};
use crate::element::{ApertureSpec, ElementSpec, PartSpec};
use crate::glass::{AgfCatalogue, GlassSpec, Makers};
use axes::{Axes, Break};
use etendue_geometry::units::{Degrees, Millimetres, Nanometres};
pub use format::LensFormat;
pub use line::ZemaxError;
use row::{SheetGlass, SheetRow, SurfaceShape};
use sheet::ZemaxSheet;
use stop::open_stop;

/// A difference of focal lengths that is more than rounding (share).
const SAME_FOCAL_LENGTH: f64 = 1e-3;

/// A lens as another program's file has it.
#[derive(Debug, Clone, PartialEq)]
pub struct ZemaxLens {
    /// The lens, with its fields and wavelengths.
    pub file: LensFile,
    /// Notes on what was changed, assumed or left out, as sentences.
    pub notes: Vec<String>,
    /// The effective focal length that the file states (mm).
    pub stated_efl: Option<f64>,
}

impl ZemaxLens {
    /// True if a file's name ends like that of a Zemax file.
    #[must_use]
    pub fn is_named(path: &Path) -> bool {
        path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("zmx"))
    }

    /// Reads the bytes of a file of any format, with the values of a configuration, from 1; those that the file stands
    /// at without.
    ///
    /// # Errors
    ///
    /// When it is no such file, has a surface, glass or number that has no counterpart here, or has no such
    /// configuration; the error names the line, or the surface of a file whose surfaces have none.
    pub fn read_as(
        format: LensFormat,
        bytes: &[u8],
        configuration: Option<usize>,
        glasses: &[AgfCatalogue],
    ) -> Result<Self, ZemaxError> {
        let text = line::decode(bytes)?;
        // The lines of the file, and the elements that they describe.
        let mut sheet = match format {
            LensFormat::Zemax => ZemaxSheet::read(&text)?,
            LensFormat::CodeV => ZemaxSheet::read_code_v(&text)?,
            LensFormat::Oslo => ZemaxSheet::read_oslo(&text, configuration)?,
            LensFormat::Optiland => ZemaxSheet::read_optiland(&text)?,
            LensFormat::Iset => ZemaxSheet::read_iset(&text)?,
            LensFormat::Pbrt => ZemaxSheet::read_pbrt(&text)?,
            LensFormat::PhotonsToPhotos => {
                ZemaxSheet::read_photons_to_photos(&text, configuration)?
            }
        };
        if let Some(configuration) = configuration {
            sheet.choose(configuration)?;
        }
        Self::of_sheet(&sheet, glasses).map_err(|error| match format.words().surfaces {
            Some(_) if error.line > 0 => {
                ZemaxError::new(0, format!("{}: {}", sheet.place(error.line), error.why))
            }
            _ => error,
        })
    }

    /// Reads the bytes of one of CODE V's `.seq` files.
    ///
    /// # Errors
    ///
    /// As [`Self::read`].
    pub fn read_code_v(bytes: &[u8], glasses: &[AgfCatalogue]) -> Result<Self, ZemaxError> {
        Self::read_as(LensFormat::CodeV, bytes, None, glasses)
    }

    /// Reads the bytes of a `.zmx` file.
    ///
    /// # Errors
    ///
    /// When it is no such file, or has a surface, glass or number that has no counterpart here; the
    /// error names the line.
    pub fn read(bytes: &[u8], glasses: &[AgfCatalogue]) -> Result<Self, ZemaxError> {
        Self::read_configuration(bytes, None, glasses)
    }

    /// As [`Self::read`], with the values of a configuration, from 1; those that the file stands at without.
    ///
    /// # Errors
    ///
    /// As [`Self::read`], and when there is no such configuration or it changes what has no counterpart here.
    pub fn read_configuration(
        bytes: &[u8],
        configuration: Option<usize>,
        glasses: &[AgfCatalogue],
    ) -> Result<Self, ZemaxError> {
        Self::read_as(LensFormat::Zemax, bytes, configuration, glasses)
    }

    /// The lens of a data sheet.
    fn of_sheet(sheet: &ZemaxSheet, glasses: &[AgfCatalogue]) -> Result<Self, ZemaxError> {
        let mut importer =
            Importer { sheet, glasses, elements: Vec::new(), notes: Vec::new(), object_z: None };
        let sensor = importer.convert()?;
        let Importer { elements, mut notes, object_z, .. } = importer;
        if elements.is_empty() {
            return Err(ZemaxError::new(
                sheet.last_line,
                "the file has no surface that does anything",
            ));
        }
        // The lens that a lens file would hold.
        let mut file = LensFile { name: sheet.name.clone(), elements, ..LensFile::default() };
        sheet.format.words().source.clone_into(&mut file.source);
        file.sensor = (sensor != SensorMount::default()).then_some(sensor);
        let (wavelengths, weights) = sheet.wavelengths_nm();
        file.wavelength = wavelengths.first().copied().map(Nanometres);
        file.wavelengths = wavelengths.into_iter().map(Nanometres).collect();
        file.weights = weights;
        // What only the built train tells: the stop, field angles, and whether the focal length is
        // as stated.
        let train = open_stop(&mut file, sheet, glasses, object_z, &mut notes)?;
        let (fields, left_out) = sheet.fields.angles(sheet.unit, &train, object_z);
        notes.extend(left_out);
        file.fields = fields;
        let stated_efl = sheet.stated_efl.map(|efl| efl * sheet.unit);
        let mut lens = Self { file, notes, stated_efl };
        lens.compare_focal_length(&train);
        lens.notes.extend(sheet.what_is_left_out());
        Ok(lens)
    }

    fn compare_focal_length(&mut self, train: &OpticalTrain) {
        let Some(stated) = self.stated_efl else { return };
        let found = train.paraxial(train.wavelength()).ok().and_then(|paraxial| paraxial.efl);
        self.notes.push(match found {
            Some(efl) if (efl - stated).abs() <= SAME_FOCAL_LENGTH * stated.abs() => {
                format!("the file states a focal length of {stated} mm, and it is {efl:.5} mm here")
            }
            Some(efl) => format!(
                "the file states a focal length of {stated} mm, BUT IT IS {efl:.5} mm HERE: the \
                 lens was changed, or the file is at odds with itself"
            ),
            None => format!(
                "the file states a focal length of {stated} mm, BUT THE LENS IS AFOCAL HERE"
            ),
        });
    }
}

/// Rows on their way to elements.
struct Importer<'a> {
    sheet: &'a ZemaxSheet,
    /// Catalogues of the user's.
    glasses: &'a [AgfCatalogue],
    elements: Vec<ElementSpec>,
    notes: Vec<String>,
    /// z of an object at a finite distance in lens coordinates (mm).
    object_z: Option<f64>,
}

impl Importer<'_> {
    /// Fills the elements, and says how the sensor stands.
    fn convert(&mut self) -> Result<SensorMount, ZemaxError> {
        let rows = &self.sheet.rows;
        let unit = self.sheet.unit;
        let ([object, inner @ .., image], true) = (rows.as_slice(), rows.len() >= 3) else {
            let why = format!(
                "the file has {} surfaces; a lens needs an object, surfaces and an image",
                rows.len()
            );
            return Err(ZemaxError::new(self.sheet.last_line, why));
        };
        self.look_at_ends(object, image)?;
        let mut axes = Axes::default();
        let mut medium_is_air = true;
        let mut first_z = None;
        let mut way = LightWay { space: Isometry::ONE, sense: 1.0, last_z: None, run: None };
        for (i, row) in inner.iter().enumerate() {
            if row.shape == SurfaceShape::CoordinateBreak {
                let by = row.coordinate_break(unit);
                axes = axes.broken(&by);
                way.run = way.run.filter(|_| by == Break::default());
            } else {
                let flat_in_air =
                    row.is_flat() && medium_is_air && row.glass.is_none() && !row.mirror;
                let here = axes.unfolded(&way.space, way.sense);
                // A system's aperture makes the stop round, whatever else stands there.
                let may_be_alone = flat_in_air && (!row.stop || self.sheet.aperture.is_none());
                let alone = may_be_alone.then(|| row.opening_alone(unit)).flatten();
                let is_alone = alone.is_some();
                for (opening, decentre) in
                    alone.map_or_else(|| row.sheets(unit), |sheet| vec![sheet])
                {
                    check_turn(row, &here)?;
                    self.place_sheet(opening, decentre, &here, &mut way);
                    first_z = first_z.or(Some(here.placed().z));
                }
                if is_alone {
                    self.elements
                        .iter_mut()
                        .last()
                        .into_iter()
                        .for_each(|e| e.mount.stop = row.stop);
                } else if let Some(part) = self.part(row, flat_in_air)? {
                    if !row.is_round() {
                        check_turn(row, &here)?;
                    }
                    first_z = first_z.or(Some(here.placed().z));
                    self.place(part, row, &here, &mut way);
                    if row.mirror {
                        let turned = after_breaks(axes, &rows[i + 2..], unit);
                        self.fold(&here, &turned, &mut way);
                    }
                }
                medium_is_air = if row.mirror { medium_is_air } else { row.glass.is_none() };
            }
            if !row.thickness.is_finite() {
                let why =
                    format!("{} is infinite inside the lens", self.sheet.format.words().thickness);
                return Err(ZemaxError::new(row.line, why));
            }
            axes = axes.advanced(row.thickness * unit);
            way.run = way.run.map(|run| run + row.thickness * unit);
        }
        let here = axes.unfolded(&way.space, way.sense);
        let image = here.placed();
        self.close_gap(&here, &mut way);
        // Lens coordinates begin at the first element, which need not be the first row.
        self.object_z = (object.thickness.is_finite())
            .then(|| -object.thickness * unit - first_z.unwrap_or_default());
        let tilt = image.tilt.map(|angle| Degrees(signed(way.sense, angle)));
        Ok(SensorMount { tilt, decentre: image.decentre.map(Millimetres) })
    }

    /// Goes on behind a mirror that stands as `here` in the unfolded space before it, where the file's axes go on
    /// as `turned`: the axis is folded where that is what the mirror's vertex does to it.
    fn fold(&mut self, here: &Axes, turned: &Axes, way: &mut LightWay) {
        way.sense = -way.sense;
        let normal = here.axis();
        let leaves = way.space.direction(turned.axis()) * way.sense;
        let reflected = DVec3::Z - 2.0 * normal.z * normal;
        let is_tilted = normal.truncate().length() > SAME_AXIS;
        let folds = is_tilted && (reflected - leaves).length() < SAME_AXIS;
        if let (true, Some(element)) = (folds, self.elements.last_mut()) {
            match &mut element.part {
                PartSpec::Mirror(mirror) => mirror.fold = true,
                PartSpec::Freeform(surface) => surface.fold = true,
                _ => {}
            }
        }
        let plane = if folds { normal } else { DVec3::Z };
        way.space = Isometry::reflection(here.origin(), plane).after(&way.space);
    }

    fn look_at_ends(&mut self, object: &SheetRow, image: &SheetRow) -> Result<(), ZemaxError> {
        if let Some(glass) = &object.glass {
            let why = format!(
                "the object stands in a glass, and lenses here begin in air: take the line out, or put the glass and its \
                 surface behind {}",
                self.sheet.format.words().object
            );
            return Err(ZemaxError::new(glass.line, why));
        }
        if object.thickness.is_finite() {
            self.notes.push(format!(
                "the file's object stands {} mm in front of the first surface; the sensor stays \
                 where the file has its image",
                object.thickness * self.sheet.unit
            ));
        }
        if !image.is_flat() {
            let place = self.sheet.place(image.line);
            self.notes.push(format!("{place}: the curved image surface is taken flat"));
        }
        Ok(())
    }

    fn glass(&self, glass: &SheetGlass) -> Result<GlassSpec, ZemaxError> {
        let words = self.sheet.format.words();
        let spec = glass.spec.clone().unwrap_or_else(|| GlassSpec::Named(glass.name.clone()));
        let makers: Vec<&str> = self.sheet.makers.iter().map(String::as_str).collect();
        let found = spec.resolve_among(self.glasses, Makers(&makers)).map_err(|error| {
            let remedy = match glass.spec {
                None => format!("; write its index into the file as {}", words.index),
                Some(_) => String::new(),
            };
            let why = format!("{} {}: {error}{remedy}", words.glass, glass.name);
            ZemaxError::new(glass.line, why)
        })?;
        Ok(match (&spec, &found.maker) {
            // With its maker in front, so that the lens file says which one is meant.
            (GlassSpec::Named(name), Some(maker)) if !found.namesakes.is_empty() => {
                GlassSpec::Named(format!("{maker}:{name}"))
            }
            _ => spec,
        })
    }

    fn place(&mut self, part: PartSpec, row: &SheetRow, here: &Axes, way: &mut LightWay) {
        self.close_gap(here, way);
        let placed = here.placed();
        let mut element = ElementSpec::new(part, 0.0);
        element.mount.stop = row.stop;
        element.mount.tilt = placed.tilt.map(|angle| Degrees(signed(way.sense, angle)));
        element.mount.decentre = placed.decentre.map(Millimetres);
        self.elements.push(element);
    }

    /// An aperture at the vertex of a row, moved across its axis.
    fn place_sheet(
        &mut self,
        opening: ApertureSpec,
        decentre: [f64; 2],
        here: &Axes,
        way: &mut LightWay,
    ) {
        let moved = here.shifted(decentre);
        self.close_gap(&moved, way);
        let moved = moved.placed();
        let mut element = ElementSpec::new(PartSpec::Aperture(opening), 0.0);
        element.mount.tilt = moved.tilt.map(|angle| Degrees(signed(way.sense, angle)));
        element.mount.decentre = moved.decentre.map(Millimetres);
        self.elements.push(element);
    }

    /// Ends the gap behind the last element where `here` stands.
    fn close_gap(&mut self, here: &Axes, way: &mut LightWay) {
        let z = here.placed().z;
        if let (Some(last), Some(before)) = (self.elements.last_mut(), way.last_z) {
            let along = way.run.filter(|_| here.axis() == DVec3::Z);
            let gap = along.unwrap_or_else(|| signed(way.sense, z - before));
            last.mount.thickness = Millimetres(gap);
        }
        (way.last_z, way.run) = (Some(z), Some(0.0));
    }
}

/// The way of light so far.
struct LightWay {
    /// From the file's space to the unfolded one.
    space: Isometry,
    /// −1 where light runs against the file's axis.
    sense: f64,
    /// z of the last element (mm).
    last_z: Option<f64>,
    /// The thicknesses since then (mm), as the file has them, where nothing breaks the axis: differences of z
    /// would round them.
    run: Option<f64>,
}

/// Axes (their sines) that count as one.
const SAME_AXIS: f64 = 1e-9;

/// A number that changes its sign where light runs against the axis; 0 keeps its own.
fn signed(sense: f64, value: f64) -> f64 {
    if value == 0.0 { value } else { sense * value }
}

/// The axes behind the coordinate breaks that come next, up to one from which light goes on a way.
fn after_breaks(mut axes: Axes, rows: &[SheetRow], unit: f64) -> Axes {
    for row in rows.iter().take_while(|row| row.shape == SurfaceShape::CoordinateBreak) {
        axes = axes.broken(&row.coordinate_break(unit));
        if row.thickness != 0.0 {
            break;
        }
    }
    axes
}

fn check_turn(row: &SheetRow, here: &Axes) -> Result<(), ZemaxError> {
    if here.is_turned() {
        let why = "a surface or an aperture that is not round is turned about its own axis by a coordinate break; turn \
                   the rows before and behind it instead, or write it round";
        return Err(ZemaxError::new(row.line, why));
    }
    Ok(())
}

#[cfg(test)]
mod tests;
