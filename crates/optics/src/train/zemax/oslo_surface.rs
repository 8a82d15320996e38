//! OSLO statements of one surface, and the row that they become.
//!
//! # Sources
//!
//! Lambda Research, *OSLO Program Reference* (surface data, pp. 46 to 74) and *OSLO Optics Reference* (2021), chapter 5: tilts
//! about −x, −y and +z in this order after the decentring, or before it and in the other order where `DT` is −1.

use std::collections::BTreeMap;

use glam::{DMat3, DVec3};

use super::ZemaxError;
use super::axes::Axes;
use super::iset::glass_through;
use super::oslo_statement::Statement;
use super::row::{Parameter, SheetGlass, SheetRow, SurfaceShape};
use crate::element::{FreeformSpec, PatternSpec, PhaseSpec, SagSpec};
use crate::glass::{GlassSpec, Makers};
use etendue_geometry::units::Millimetres;

/// Thicknesses from here on are infinite; files round 1e10.
pub(super) const INFINITE: f64 = 9.9e9;

/// The most terms of a general asphere.
const MOST_TERMS: usize = 256;

/// The kinds of general aspheres that are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Asphere {
    /// AD to AG.
    #[default]
    Four,
    /// `ASR`: `ASn` of r²ⁿ.
    Even,
    /// `ARA`: `ASn` of rⁿ.
    Every,
    /// `ASX`: `ASn` of xⁱ yʲ by degree, x first.
    Plane,
}

/// A surface as statements fill it, in the file's unit.
#[derive(Debug, Clone, Default)]
pub(super) struct OsloSurface {
    pub(super) line: usize,
    curvature: f64,
    pub(super) thickness: Option<f64>,
    pub(super) glass: Option<SheetGlass>,
    pub(super) mirror: bool,
    pub(super) stop: bool,
    /// Its radius, and whether rays are checked against it.
    pub(super) aperture: Option<(f64, bool)>,
    conic: f64,
    asphere: Asphere,
    /// By power of r.
    four: BTreeMap<usize, f64>,
    general: BTreeMap<usize, f64>,
    curvature_x: Option<f64>,
    pub(super) decentre: [f64; 3],
    /// TLA, TLB and TLC (degrees).
    pub(super) tilt: [f64; 3],
    pivot: [f64; 3],
    tilts_first: bool,
    pub(super) bends: bool,
    /// Whose coordinates it stands in, and whose go on behind it.
    pub(super) global: Option<usize>,
    pub(super) returns: Option<usize>,
    focal_length: Option<f64>,
    /// Spacing and order of a grating.
    spacing: f64,
    order: Option<f64>,
    /// A solve that stands for its curvature or thickness.
    pub(super) solves: Option<(usize, String, f64)>,
}

impl OsloSurface {
    /// A plane in air that begins in a line.
    pub(super) fn at(line: usize) -> Self {
        Self { line, ..Self::default() }
    }

    /// Reads a statement of a surface; false if it is not one. `own` is the surface's number, and
    /// `wavelengths` are those so far (µm).
    pub(super) fn read(
        &mut self,
        statement: &Statement,
        own: usize,
        wavelengths: &[f64],
    ) -> Result<bool, ZemaxError> {
        let word = statement.word();
        let number = || statement.number(1);
        match word {
            "AIR" | "AIF" => (self.glass, self.mirror) = (None, false),
            "RFL" | "RFH" => (self.glass, self.mirror) = (None, true),
            "GLA" | "GLF" => (self.glass, self.mirror) = (glass(statement, wavelengths)?, false),
            "RD" | "RDF" => self.curvature = inverse(number()?),
            "CV" | "CVF" => self.curvature = number()?,
            "CVX" => self.curvature_x = Some(number()?),
            "RDX" => self.curvature_x = Some(inverse(number()?)),
            "TH" | "THF" => {
                let thickness = number()?;
                let is_far = thickness.abs() >= INFINITE;
                self.thickness =
                    Some(if is_far { f64::INFINITY.copysign(thickness) } else { thickness });
            }
            "AP" | "APF" => {
                let is_flag =
                    |flag: &str| ["CHK", "UNC"].contains(&flag.to_ascii_uppercase().as_str());
                let flagged = statement.text(1).is_some_and(is_flag);
                let radius = statement.number(if flagged { 2 } else { 1 })?;
                if radius < 0.0 {
                    return Err(statement.error("the radius must not be below zero"));
                }
                let checked =
                    statement.text(1).is_some_and(|flag| flag.eq_ignore_ascii_case("CHK"));
                self.aperture = (radius > 0.0 && radius < INFINITE).then_some((radius, checked));
            }
            "AST" => self.stop = true,
            "CC" => self.conic = number()?,
            "AD" | "AE" | "AF" | "AG" => {
                let power = 4 + 2 * usize::from(word.as_bytes()[1] - b'D');
                self.four.insert(power, number()?);
            }
            "ASP" => self.asphere = asphere(statement)?,
            "DCX" => self.decentre[0] = number()?,
            "DCY" => self.decentre[1] = number()?,
            "DCZ" => self.decentre[2] = number()?,
            "TLA" => self.tilt[0] = number()?,
            "TLB" => self.tilt[1] = number()?,
            "TLC" => self.tilt[2] = number()?,
            "TOX" => self.pivot[0] = number()?,
            "TOY" => self.pivot[1] = number()?,
            "TOZ" => self.pivot[2] = number()?,
            "DT" => self.tilts_first = number()? < 0.0,
            "BEN" => self.bends = true,
            "GC" => self.global = Some(statement.surface(1, own)?),
            "RCO" => {
                // Without a surface, or with 0 as old files have it, back to where it would stand without its own.
                let named = statement.text(1).is_some_and(|word| word != "0");
                self.returns = Some(if named { statement.surface(1, own)? } else { own });
            }
            "PFL" => self.focal_length = Some(number()?),
            "GSP" => self.spacing = number()?,
            "GOR" => self.order = Some(number()?),
            "PY" | "PYC" | "PU" | "PUC" | "EC" => {
                self.solves = Some((statement.line, word.to_owned(), number()?));
            }
            _ => {
                let Some(index) = word.strip_prefix("AS").and_then(|n| n.parse::<usize>().ok())
                else {
                    return Ok(false);
                };
                if index > MOST_TERMS {
                    return Err(statement.error(format!("more than {MOST_TERMS} terms")));
                }
                self.general.insert(index, number()?);
            }
        }
        Ok(true)
    }

    /// Takes the shape of another surface, with an offset of its curvature.
    pub(super) fn take_shape(&mut self, from: &Self, sign: f64, offset: f64) {
        self.curvature = sign * from.curvature + offset;
        self.curvature_x = from.curvature_x.map(|curvature| sign * curvature);
        (self.conic, self.asphere) = (from.conic, from.asphere);
        let signed = |terms: &BTreeMap<usize, f64>| {
            terms.iter().map(|(power, value)| (*power, sign * value)).collect()
        };
        (self.four, self.general) = (signed(&from.four), signed(&from.general));
    }

    /// Takes the place of another in its own coordinates.
    pub(super) fn take_place(&mut self, from: &Self, sign: f64) {
        self.decentre = from.decentre.map(|length| sign * length);
        self.tilt = from.tilt.map(|angle| sign * angle);
        self.pivot = from.pivot;
        self.tilts_first = from.tilts_first != (sign < 0.0);
    }

    /// True if the surface stands otherwise than on the axis before it.
    pub(super) fn is_moved(&self) -> bool {
        let moves = self.decentre.iter().chain(&self.tilt).any(|value| *value != 0.0);
        moves || self.global.is_some() || self.returns.is_some() || self.bends
    }

    /// Its axes, where `base` are those that it is decentred and tilted in (mm).
    pub(super) fn axes(&self, base: &Axes, unit: f64) -> Axes {
        let rotation = self.turn();
        let [shift, pivot] =
            [self.decentre, self.pivot].map(|place| unit * DVec3::from_array(place));
        let shift = if self.tilts_first { rotation * shift } else { shift };
        let shift = shift + pivot - rotation * pivot;
        Axes::new(base.origin() + base.rotation() * shift, base.rotation() * rotation)
    }

    fn turn(&self) -> DMat3 {
        let [about_x, about_y, about_z] =
            [-self.tilt[0], -self.tilt[1], self.tilt[2]].map(f64::to_radians);
        let [x, y, z] = [
            DMat3::from_rotation_x(about_x),
            DMat3::from_rotation_y(about_y),
            DMat3::from_rotation_z(about_z),
        ];
        if self.tilts_first { z * y * x } else { x * y * z }
    }

    /// The axes on which light goes on behind a mirror that bends the axis: its tilt once more.
    pub(super) fn bent(&self, own: &Axes) -> Axes {
        Axes::new(own.origin(), own.rotation() * self.turn())
    }

    /// The row without its place. `unit` is the file's in millimetres.
    pub(super) fn row(&self, unit: f64) -> Result<SheetRow, ZemaxError> {
        let line = self.line;
        let mut row = SheetRow {
            line,
            curvature: self.curvature,
            conic: self.conic,
            thickness: self.thickness.unwrap_or(0.0),
            glass: self.glass.clone(),
            mirror: self.mirror,
            stop: self.stop,
            ..SheetRow::default()
        };
        match self.aperture {
            Some((radius, true)) => row.set_clear(radius),
            Some((radius, false)) => row.set_semi_diameter(radius),
            None => {}
        }
        let mut put = |number: usize, value: f64| {
            row.parameters.insert(number, Parameter { line, value });
        };
        if let Some(focal_length) = self.focal_length {
            put(1, focal_length);
            row.shape = SurfaceShape::Paraxial;
            return Ok(row);
        }
        let (powers, plane) = self.terms(unit)?;
        let is_grating = self.spacing != 0.0 && self.order != Some(0.0);
        match self.curvature_x {
            Some(_) if is_grating || !plane.is_empty() => {
                return Err(ZemaxError::new(
                    line,
                    "CVX with a grating or with ASP ASX has no counterpart here",
                ));
            }
            Some(curvature) => {
                let rotation = if curvature == 0.0 { 0.0 } else { unit / curvature };
                row.shape = SurfaceShape::Freeform;
                row.freeform = Some(Box::new(FreeformSpec {
                    rotation_radius: Some(Millimetres(rotation)),
                    aspheric: powers,
                    ..FreeformSpec::default()
                }));
            }
            None if powers.is_empty() && plane.is_empty() && !is_grating => {}
            None => {
                let phase = if is_grating { Some(self.grating(unit)?) } else { None };
                let sag = SagSpec::Polynomial { radius: Millimetres(1.0), coefficients: plane };
                let is_flat = matches!(&sag, SagSpec::Polynomial { coefficients, .. } if coefficients.is_empty());
                row.shape = SurfaceShape::Freeform;
                row.freeform = Some(Box::new(FreeformSpec {
                    aspheric: powers,
                    sag: if is_flat { Vec::new() } else { vec![sag] },
                    phase,
                    ..FreeformSpec::default()
                }));
            }
        }
        Ok(row)
    }

    /// Coefficients by power of r, and those of x and y, in millimetres.
    #[expect(clippy::type_complexity, reason = "two lists as elements have them")]
    fn terms(
        &self,
        unit: f64,
    ) -> Result<(BTreeMap<String, f64>, Vec<(u32, u32, f64)>), ZemaxError> {
        let scaled =
            |power: usize, value: f64| value * unit.powi(1 - i32::try_from(power).unwrap_or(0));
        let mut powers = BTreeMap::new();
        let mut plane = Vec::new();
        let radial = |step: usize| self.general.iter().map(move |(n, value)| (step * n, *value));
        let all: Vec<(usize, f64)> = match self.asphere {
            Asphere::Four => self.four.iter().map(|(power, value)| (*power, *value)).collect(),
            Asphere::Even => radial(2).collect(),
            Asphere::Every => radial(1).collect(),
            Asphere::Plane => {
                for (&n, &value) in self.general.iter().filter(|(_, value)| **value != 0.0) {
                    let (i, j) = powers_of(n);
                    plane.push((i, j, scaled((i + j) as usize, value)));
                }
                Vec::new()
            }
        };
        for (power, value) in all.into_iter().filter(|(_, value)| *value != 0.0) {
            if !(1..=30).contains(&power) {
                let why =
                    format!("a term of r^{power} has no counterpart here; known: r^1 to r^30");
                return Err(ZemaxError::new(self.line, why));
            }
            powers.insert(power.to_string(), scaled(power, value));
        }
        Ok((powers, plane))
    }

    fn grating(&self, unit: f64) -> Result<PhaseSpec, ZemaxError> {
        let order = self.order.unwrap_or(1.0);
        #[expect(
            clippy::cast_possible_truncation,
            reason = "a whole number of few digits, as is checked"
        )]
        let whole = order as i32;
        if self.spacing < 0.0 || f64::from(whole) != order {
            let why = "a grating has a positive spacing (GSP) and a whole order (GOR)";
            return Err(ZemaxError::new(self.line, why));
        }
        let pattern =
            PatternSpec::Grating { period: Millimetres(self.spacing * unit), rotation: 0.0 };
        Ok(PhaseSpec {
            pattern,
            order: Some(whole),
            blaze_wavelength: None,
            design_wavelength: None,
        })
    }
}

/// The powers of x and y of term `n`: by degree, and in each from x alone to y alone.
fn powers_of(n: usize) -> (u32, u32) {
    let (mut degree, mut first) = (0, 0);
    while first + degree < n {
        first += degree + 1;
        degree += 1;
    }
    let of_y = n - first;
    (u32::try_from(degree - of_y).unwrap_or(0), u32::try_from(of_y).unwrap_or(0))
}

fn inverse(radius: f64) -> f64 {
    if radius == 0.0 || radius.abs() >= INFINITE { 0.0 } else { 1.0 / radius }
}

fn asphere(statement: &Statement) -> Result<Asphere, ZemaxError> {
    let kind = statement.text(1).unwrap_or_default().to_ascii_uppercase();
    match kind.as_str() {
        "ADO" | "0" => Ok(Asphere::Four),
        "ASR" | "1" => Ok(Asphere::Even),
        "ASX" | "2" => Ok(Asphere::Plane),
        "ARA" => Ok(Asphere::Every),
        other => Err(statement.error(format!(
            "the asphere {other} has no counterpart here; known: ADO, ASR, ARA, ASX"
        ))),
    }
}

/// `GLA BK7`, `GLA 1.57 1.58 1.56`, `GLA MOD 1.62 60.3`, `GLA MOD NAME 1.62 1.63 1.61`.
fn glass(statement: &Statement, wavelengths: &[f64]) -> Result<Option<SheetGlass>, ZemaxError> {
    let line = statement.line;
    let words: Vec<&str> = (1..).map_while(|i| statement.text(i)).collect();
    let (is_model, words) = match words.split_first() {
        Some((word, rest)) if word.eq_ignore_ascii_case("MOD") => (true, rest),
        _ => (false, &words[..]),
    };
    let as_number = |word: &str| word.parse::<f64>().ok().filter(|number| number.is_finite());
    let (name, values) = match words.split_first() {
        None => return Err(statement.error("a glass is missing")),
        Some((first, rest)) if as_number(first).is_none() => (*first, rest),
        Some(_) => ("", words),
    };
    let indices = values.iter().map(|word| {
        as_number(word).ok_or_else(|| statement.error(format!("`{word}` is not a number")))
    });
    let indices = indices.collect::<Result<Vec<f64>, _>>()?;
    let own = if name.is_empty() { "by index" } else { name };
    match indices[..] {
        [] if is_model => Err(statement.error("a model glass needs its indices")),
        [] => Ok(Some(SheetGlass { line, name: of_catalogue(name), spec: None })),
        [nd, vd] if is_model && vd > 10.0 => Ok(Some(SheetGlass::model(line, own, nd, vd))),
        _ => {
            let count = wavelengths.len();
            if indices.len() > 1 && indices.len() != count {
                let why = format!("{} indices for {count} wavelengths (WV)", indices.len());
                return Err(statement.error(why));
            }
            let at = &wavelengths[..indices.len().min(count)];
            let spec = match indices.len() {
                1 => GlassSpec::Constant(indices[0]),
                _ => glass_through(at, &indices).map_err(|why| statement.error(why))?,
            };
            let is_air = spec == GlassSpec::Constant(1.0);
            Ok((!is_air).then(|| SheetGlass { line, name: own.to_owned(), spec: Some(spec) }))
        }
    }
}

/// A name as the catalogue has it; H_ and O_ are Hoya's and Ohara's.
fn of_catalogue(name: &str) -> String {
    let upper = name.to_ascii_uppercase();
    let known =
        |name: &str| GlassSpec::Named(name.to_owned()).resolve_among(&[], Makers(&[])).is_ok();
    if known(&upper) {
        return upper;
    }
    let maker = match upper.split_once('_') {
        Some(("H", rest)) => Some(("HOYA", rest)),
        Some(("O", rest)) => Some(("OHARA", rest)),
        Some(("S", rest)) => Some(("SCHOTT", rest)),
        Some(_) | None => None,
    };
    match maker {
        Some((maker, rest)) if known(&format!("{maker}:{rest}")) => format!("{maker}:{rest}"),
        Some((maker, rest)) => super::code_v::hyphened(rest, &[maker]),
        None => super::code_v::hyphened(&upper, &[]),
    }
}
