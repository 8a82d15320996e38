//! Wave analysis of a lens as one report: for tables, JSON and figures.

pub mod figures;
mod text;

use glam::DVec2;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use super::AnalysisError;
use super::astigmatism::{FieldFoci, foci};
use super::colours::wavefronts;
use super::conjugate::{Conjugate, Planes};
use super::fans::{Fans, GridPoint, distortion_grid, fans};
use super::object::ObjectPoint;
use super::seidel::{SeidelTable, seidel};
use super::spread::{PointSpread, WeightedFields, shares, strehl_of};
use super::transfer::{Transfer, geometric_modulation, geometric_modulations, modulation_at};
use super::wavefront::{Cells, ReferenceSphere, USUAL_CELLS, Wavefront};
use super::zernike::ZernikeFit;
use crate::sentence;
use crate::train::{Focus, MonochromaticTrain, OpticalTrain};
use crate::zernike::{FRINGE_TERMS, ZernikeOrder};

pub use figures::page;

/// Frequencies of a table (shares of the limit).
const SHARES: u32 = 20;

/// Planes through focus, and how far they reach: in units of λN², twice the depth of focus.
const PLANES: i32 = 10;

/// Radii of encircled energy, up to this many radii of the Airy disc.
const RADII: u32 = 40;

/// Field points of the curve of foci.
const FOCI: u32 = 12;

/// Points a side of the distortion grid.
const GRID: u32 = 9;

/// Inputs of a wave analysis of a lens, and where each came from.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct WaveInquiry {
    /// Wavelengths (nm), the main one first.
    pub wavelengths: Vec<f64>,
    /// Weight of each wavelength; equal weights when empty.
    pub weights: Vec<f64>,
    /// Field angles (degrees), or heights (mm) of a near object.
    pub fields: Vec<f64>,
    /// True if a field without light is an error, false if it is only noted.
    pub fields_are_asked: bool,
    /// Position of the object.
    pub conjugate: Conjugate,
    /// Focus setting, which places the sensor.
    pub focus: Focus,
    /// True if the image plane is moved to where the wavefront on the axis is flattest.
    pub best_focus: bool,
    /// True if the train ends with an [eyepiece](OpticalTrain::with_eyepiece) of 1000 mm behind an
    /// afocal lens, so that lengths on the image are thousandths of a radian.
    pub is_afocal: bool,
    /// Cells over the pupil.
    pub cells: Cells,
    /// Frequencies (cycles/mm); shares of the limit on the axis when empty.
    pub frequencies: Vec<f64>,
    /// Origin of the fields, wavelengths, weights and the object's position.
    pub taken: PremiseSources,
}

/// Sources of a report's premises: `option`, `file` or `default`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, JsonSchema)]
pub struct PremiseSources {
    /// Of the fields.
    pub fields: &'static str,
    /// Of the wavelengths.
    pub wavelengths: &'static str,
    /// Of the weights.
    pub weights: &'static str,
    /// Of the object's place.
    pub object: &'static str,
}

/// Analysis of a lens in waves.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct WaveReport {
    /// Sources of the premises.
    pub taken: PremiseSources,
    /// Unit of lengths on the image: `mm`; `mrad` of an afocal lens.
    pub image_unit: &'static str,
    /// Object and image.
    pub planes: Planes,
    /// From the sensor's plane to `planes.image_z` (mm): other than 0 with the best focus.
    pub refocused: f64,
    /// Wavelengths (nm), the main one first.
    pub wavelengths: Vec<f64>,
    /// Weight of each; 1 in all.
    pub weights: Vec<f64>,
    /// Fields that light reaches.
    pub fields: Vec<FieldWaves>,
    /// Seidel's sums for the widest field; `null` when a pupil is at infinity.
    pub seidel: Option<SeidelTable>,
    /// Foci of narrow fans up to the widest field; empty unless the lens is round.
    pub foci: Vec<FieldFoci>,
    /// Distortion over a square with the widest field in its corners.
    pub distortion_grid: Vec<GridPoint>,
    /// Notes on what is missing, and why.
    pub notes: Vec<String>,
}

/// One field in waves.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct FieldWaves {
    /// The angle (degrees), or the height of a near object (mm).
    pub field: f64,
    /// In words.
    pub name: String,
    /// The reference sphere, about where the main wavelength's chief ray meets the image plane.
    pub sphere: ReferenceSphere,
    /// Cells over the pupil, a side.
    pub cells: usize,
    /// The greatest change of a wavefront from cell to cell, of all wavelengths (waves).
    pub steepest: f64,
    /// Root mean square of the main wavelength's waves about their mean.
    pub rms: f64,
    /// From the least to the greatest.
    pub peak_to_valley: f64,
    /// Root mean square about the sphere that fits best, and that sphere's centre (mm).
    pub best_fit: BestFit,
    /// The Fringe set at the main wavelength.
    pub fringe: ZernikeFit,
    /// Noll's set at the main wavelength, as many terms.
    pub noll: ZernikeFit,
    /// Strehl's ratio of all wavelengths together.
    pub strehl: f64,
    /// Brightest point, from the sphere's centre (mm in x and y).
    pub brightest: [f64; 2],
    /// 1 over the width of the cone of light in y and in x (direction cosines): f-numbers.
    pub working_f_number: [f64; 2],
    /// 1.22 λN of the main wavelength, N the mean of those (mm).
    pub airy_radius: f64,
    /// Area of the lit pupil in direction cosines over that of the first field: relative illumination.
    pub relative_pupil: f64,
    /// Modulation.
    pub mtf: Vec<Modulation>,
    /// Share of light within a radius (mm) about the brightest point.
    pub encircled: Vec<[f64; 2]>,
    /// Irradiance of a line along x against y, and of one along y against x (mm, 1/mm), of power 1.
    pub line_spread: [Vec<[f64; 2]>; 2],
    /// Modulation through focus, at a quarter of the limit.
    pub through_focus: ThroughFocus,
    /// Ray fans by wavelength.
    pub fans: Vec<Fans>,
}

/// The sphere of least root mean square.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct BestFit {
    /// Its centre (mm).
    pub centre: [f64; 3],
    /// Root mean square there (waves).
    pub rms: f64,
}

/// Modulation at a frequency.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Modulation {
    /// Cycles/mm.
    pub frequency: f64,
    /// Of waves along y.
    pub tangential: f64,
    /// Of waves along x.
    pub sagittal: f64,
    /// Along y, by rays.
    pub geometric_tangential: f64,
    /// Along x, by rays.
    pub geometric_sagittal: f64,
}

/// Modulation at planes before and behind the image's.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ThroughFocus {
    /// Cycles/mm.
    pub frequency: f64,
    /// Defocus (mm), and modulation along y and x; `null` where the cells are too few.
    pub planes: Vec<(f64, Option<[f64; 2]>)>,
}

/// One problem's premises.
struct AnalysisSetup<'a> {
    train: &'a OpticalTrain,
    lenses: Vec<MonochromaticTrain>,
    weights: Vec<f64>,
    planes: Planes,
    cells: Cells,
    frequencies: Vec<f64>,
}

impl WaveReport {
    /// Looks at a lens in waves.
    ///
    /// # Errors
    ///
    /// When there is no image, a field that was asked for has no light, the weights make no mean, or
    /// the cells are too few for a wavefront.
    pub fn new(train: &OpticalTrain, inquiry: &WaveInquiry) -> Result<Self, AnalysisError> {
        let weights = inquiry.weights()?;
        let mut planes = inquiry.conjugate.planes(train, inquiry.focus)?;
        let lenses = inquiry.wavelengths.iter().map(|&nm| train.at(nm));
        let lenses = lenses.collect::<Result<Vec<_>, _>>()?;
        let mut refocused = 0.0;
        if inquiry.best_focus {
            refocused = best_focus(train, &lenses, &planes, &weights)?;
            planes.image_z += refocused;
        }
        let mut bench = AnalysisSetup {
            train,
            lenses,
            weights: weights.clone(),
            planes,
            cells: inquiry.cells,
            frequencies: inquiry.frequencies.clone(),
        };
        let (mut fields, mut notes): (Vec<FieldWaves>, Vec<String>) = (Vec::new(), Vec::new());
        let mut first_area = None;
        for &field in &inquiry.fields {
            match bench.field(field, &mut first_area) {
                Ok(waves) => fields.push(waves),
                Err(error) if inquiry.fields_are_asked || !error.is_of_the_field() => {
                    return Err(error);
                }
                Err(error) => {
                    let name = planes.point(field).name();
                    notes.push(format!("no waves of {name}: {}", sentence(&error)));
                }
            }
        }
        if fields.is_empty() {
            return Err(AnalysisError::Dark { field: "all fields".to_owned() });
        }
        let widest = fields
            .iter()
            .map(|f| f.field)
            .fold(0.0_f64, |a, b| if b.abs() > a.abs() { b } else { a });
        let colours = inquiry.wavelengths.iter().copied();
        let ends = [colours.clone().fold(f64::INFINITY, f64::min), colours.fold(0.0, f64::max)];
        let seidel = match seidel(train, &planes.point(widest), ends) {
            Ok(table) => Some(table),
            Err(error) => {
                notes.push(format!("no Seidel sums: {}", sentence(&error)));
                None
            }
        };
        let foci = bench.foci(widest)?;
        if foci.is_empty() {
            let why = match train.is_graded() {
                true => "the index of a medium changes from place to place",
                false => "the lens is not round about its axis",
            };
            notes.push(format!("no field curvature: {why}"));
        }
        let distortion_grid = bench.grid(widest)?;
        Ok(Self {
            taken: inquiry.taken.clone(),
            image_unit: if inquiry.is_afocal { "mrad" } else { "mm" },
            planes,
            refocused,
            wavelengths: inquiry.wavelengths.clone(),
            weights,
            fields,
            seidel,
            foci,
            distortion_grid,
            notes,
        })
    }
}

impl WaveInquiry {
    /// Weights of a sum of 1.
    fn weights(&self) -> Result<Vec<f64>, AnalysisError> {
        let count = self.wavelengths.len();
        let weights = match self.weights.is_empty() {
            true => vec![1.0; count],
            false => self.weights.clone(),
        };
        shares(&weights, count)
    }
}

/// From the image plane to the mean, by weight, of where the wavefronts on the axis are flattest (mm).
fn best_focus(
    train: &OpticalTrain,
    lenses: &[MonochromaticTrain],
    planes: &Planes,
    weights: &[f64],
) -> Result<f64, AnalysisError> {
    let mut sum = 0.0;
    for (at, weight) in lenses.iter().zip(weights).filter(|(_, weight)| **weight > 0.0) {
        let wave = Wavefront::new(train, at, planes.point(0.0), planes.image_z, Cells::Needed)?;
        sum += weight * (wave.best_fit()?.sphere.centre[2] - planes.image_z);
    }
    Ok(sum)
}

impl AnalysisSetup<'_> {
    fn field(&mut self, field: f64, area: &mut Option<f64>) -> Result<FieldWaves, AnalysisError> {
        let object = self.planes.point(field);
        let image_z = self.planes.image_z;
        let waves = wavefronts(self.train, &self.lenses, object, image_z, self.cells)?;
        let Some(main) = waves.first().cloned() else {
            return Err(AnalysisError::Dark { field: object.name() });
        };
        let pupils: Vec<_> = waves.into_iter().map(|wave| wave.pupil).collect();
        let steepest = pupils.iter().map(super::PupilField::steepest).fold(0.0, f64::max);
        let fields = WeightedFields::new(pupils, &self.weights)?;
        let statistics = main.pupil.statistics();
        let fit = |order| ZernikeFit::new(&main.pupil, order, FRINGE_TERMS);
        let (fringe, noll) = rayon::join(|| fit(ZernikeOrder::Fringe), || fit(ZernikeOrder::Noll));
        let (fringe, noll) = (fringe?, noll?);
        let spread = PointSpread::by_fft(&fields, 1);
        let transfer = Transfer::of(&spread);
        let (brightest, ratio) = strehl_of(&fields, &spread);
        let widths = widths(&main);
        let working_f_number = widths.map(|width| 1.0 / width);
        let mean = 2.0 / (widths[0] + widths[1]);
        let airy_radius = 1.22 * main.pupil.wavelength * 1e-6 * mean;
        if self.frequencies.is_empty() {
            let limit = round(widths[0] / (main.pupil.wavelength * 1e-6));
            self.frequencies =
                (0..=SHARES).map(|k| limit * f64::from(k) / f64::from(SHARES)).collect();
        }
        let lit: f64 = main.pupil.clear.iter().sum::<f64>() * main.pupil.step.powi(2);
        let relative_pupil = lit / *area.get_or_insert(lit);
        let radii: Vec<f64> =
            (0..=RADII).map(|k| 5.0 * airy_radius * f64::from(k) / f64::from(RADII)).collect();
        let encircled = transfer.encircled(brightest, &radii);
        let encircled = radii.iter().zip(encircled).map(|(radius, share)| [*radius, share]);
        let [along_x, along_y] = spread.lines();
        let near = |line: Vec<[f64; 2]>| -> Vec<[f64; 2]> {
            line.into_iter().filter(|[at, _]| at.abs() <= 12.0 * airy_radius).collect()
        };
        let frequency = round(0.25 * widths[0] / (main.pupil.wavelength * 1e-6));
        let depth = 2.0 * main.pupil.wavelength * 1e-6 * mean * mean;
        let at_chief = main.sphere.centre;
        let centre = DVec2::new(at_chief[0], at_chief[1]);
        let of_colour = |at| fans(self.train, at, object, image_z, Some(centre));
        let fans = self.lenses.iter().map(of_colour).collect::<Result<Vec<_>, _>>()?;
        let best = main.clone().best_fit()?;
        Ok(FieldWaves {
            field,
            name: object.name(),
            sphere: main.sphere,
            cells: main.pupil.cells,
            steepest,
            rms: statistics.rms,
            peak_to_valley: statistics.peak_to_valley,
            best_fit: BestFit { centre: best.sphere.centre, rms: best.pupil.statistics().rms },
            fringe,
            noll,
            strehl: ratio,
            brightest: brightest.into(),
            working_f_number,
            airy_radius,
            relative_pupil,
            mtf: modulation(&transfer, &fields, &self.frequencies),
            encircled: encircled.collect(),
            line_spread: [near(along_y), near(along_x)],
            through_focus: through_focus(&self.coarser(object, fields)?, frequency, depth),
            fans,
        })
    }

    /// Fields on half as many cells a side, where there are more than the usual number of them: one frequency at many
    /// planes needs no more, and what grows with defocus is small beside what made the cells many.
    fn coarser(
        &self,
        object: ObjectPoint,
        fields: WeightedFields,
    ) -> Result<WeightedFields, AnalysisError> {
        let cells = fields.fields().first().map_or(0, |(field, _)| field.cells);
        if self.cells != Cells::Needed || cells <= USUAL_CELLS {
            return Ok(fields);
        }
        let cells = Cells::Given((cells / 2).max(USUAL_CELLS));
        match wavefronts(self.train, &self.lenses, object, self.planes.image_z, cells) {
            Ok(waves) => WeightedFields::new(
                waves.into_iter().map(|wave| wave.pupil).collect(),
                &self.weights,
            ),
            Err(AnalysisError::Coarse { .. }) => Ok(fields),
            Err(error) => Err(error),
        }
    }

    fn foci(&self, widest: f64) -> Result<Vec<FieldFoci>, AnalysisError> {
        let Some(at) = self.lenses.first() else { return Ok(Vec::new()) };
        let mut all = Vec::new();
        for k in 0..=FOCI {
            let point = self.planes.point(widest * f64::from(k) / f64::from(FOCI));
            match foci(self.train, at, point, self.planes.image_z)? {
                Some(one) => all.push(one),
                None => return Ok(Vec::new()),
            }
        }
        Ok(all)
    }

    fn grid(&self, widest: f64) -> Result<Vec<GridPoint>, AnalysisError> {
        let Some(at) = self.lenses.first() else { return Ok(Vec::new()) };
        let corner = self.planes.point(widest);
        let efl = self.train.paraxial(at.wavelength())?.efl;
        let is_wide = matches!(corner, ObjectPoint::Infinity { .. }) && widest.abs() >= 85.0;
        let scale = self.planes.magnification.or(efl).filter(|_| !is_wide && widest != 0.0);
        Ok(scale.map_or_else(Vec::new, |scale| {
            distortion_grid(self.train, at, &corner, self.planes.image_z, scale, GRID)
        }))
    }
}

fn modulation(
    transfer: &Transfer,
    fields: &WeightedFields,
    frequencies: &[f64],
) -> Vec<Modulation> {
    let step = frequencies.get(1).copied().unwrap_or(0.0);
    let is_even = |(k, f): (usize, &f64)| (f - k as f64 * step).abs() <= 1e-9 * step;
    let geometric = match step > 0.0 && frequencies.iter().enumerate().all(is_even) {
        true => geometric_modulations(fields, step, frequencies.len()),
        false => frequencies.par_iter().map(|&f| geometric_modulation(fields, f)).collect(),
    };
    let at = |(&frequency, [geometric_tangential, geometric_sagittal]): (&f64, [f64; 2])| {
        let [tangential, sagittal] = transfer.modulation(frequency);
        Modulation { frequency, tangential, sagittal, geometric_tangential, geometric_sagittal }
    };
    frequencies.iter().zip(geometric).map(at).collect()
}

fn through_focus(fields: &WeightedFields, frequency: f64, depth: f64) -> ThroughFocus {
    let plane = |k: i32| {
        let defocus = 2.0 * depth * f64::from(k) / f64::from(PLANES);
        let there = fields.at_focus(defocus).ok();
        (defocus, there.map(|fields| modulation_at(&fields, frequency)))
    };
    ThroughFocus { frequency, planes: (-PLANES..=PLANES).into_par_iter().map(plane).collect() }
}

/// Widths of the lit pupil in y and in x (direction cosines), over what is in its middle and however much it passes.
fn widths(wave: &Wavefront) -> [f64; 2] {
    let pupil = &wave.pupil;
    let most = pupil.lit().map(|i| pupil.clear[i].min(1.0)).fold(f64::MIN_POSITIVE, f64::max);
    [DVec2::Y, DVec2::X].map(|along| {
        // Each line of cells goes from its first to its last one, which may be covered in part.
        let mut lines: Vec<Option<[(usize, f64); 2]>> = vec![None; pupil.cells];
        for i in pupil.lit() {
            let (row, column) = (i / pupil.cells, i % pupil.cells);
            let (line, place) = if along == DVec2::Y { (column, row) } else { (row, column) };
            let own = (place, pupil.clear[i].min(1.0) / most);
            let [first, last] = lines[line].get_or_insert([own; 2]);
            *first = if place < first.0 { own } else { *first };
            *last = if place > last.0 { own } else { *last };
        }
        let length = |[(first, begin), (last, end)]: [(usize, f64); 2]| match last - first {
            0 => begin,
            cells => cells as f64 - 1.0 + begin + end,
        };
        lines.into_iter().flatten().map(length).fold(0.0, f64::max) * pupil.step
    })
}

/// Two significant digits: frequencies that are chosen need no more.
fn round(frequency: f64) -> f64 {
    format!("{frequency:.1e}").parse().unwrap_or(frequency)
}
