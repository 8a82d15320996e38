//! Rows of the lens data sheet to the parts of a lens file.

use std::collections::BTreeMap;

use etendue_geometry::units::{Degrees, Millimetres};

use super::row::{Parameter, SheetOpening, SheetRow, SurfaceShape};
use super::{Importer, ZemaxError};
use crate::element::{
    AnnularSpec, ApertureSpec, BiconicSpec, BoxSpec, CircularSpec, FreeformSpec, MirrorSpec,
    PartSpec, PatternSpec, PhaseSpec, SagSpec, SpiderSpec, SurfaceSpec, ThinLensSpec,
};
use crate::zernike::ZernikeOrder;

impl Importer<'_> {
    /// Converts a row to a part; `None` for a plane between air and air that does nothing.
    pub(super) fn part(
        &mut self,
        row: &SheetRow,
        flat_in_air: bool,
    ) -> Result<Option<PartSpec>, ZemaxError> {
        let unit = self.sheet.unit;
        let semi_diameter = row.semi_diameter().map(|length| length * unit);
        if row.shape == SurfaceShape::Paraxial {
            return row.thin_lens(unit).map(Some);
        }
        if flat_in_air {
            if !row.stop && !row.has_fixed_rim() {
                if row.sheets(unit).is_empty() {
                    self.notes.push(format!(
                        "{}: a plane in air that does nothing is left out",
                        self.sheet.place(row.line)
                    ));
                }
                return Ok(None);
            }
            // Nothing limits a stop of unknown size yet; the system's aperture may.
            let radius = semi_diameter.unwrap_or(0.0);
            return Ok(Some(PartSpec::circular(radius)));
        }
        let glass = row.glass.as_ref().map(|glass| self.glass(glass)).transpose()?;
        let curvature = (row.curvature != 0.0).then_some(row.curvature / unit);
        let semi_diameter = semi_diameter.map(Millimetres);
        let conic = if row.curvature == 0.0 { 0.0 } else { row.conic };
        let aspheric = row.aspheric(unit)?;
        let hole = Millimetres(if row.mirror { row.inner * unit } else { 0.0 });
        let is_plain = matches!(
            row.shape,
            SurfaceShape::Standard | SurfaceShape::EvenAsphere | SurfaceShape::ExtendedAsphere
        );
        Ok(Some(match (is_plain, row.mirror) {
            (true, false) => PartSpec::Surface(SurfaceSpec {
                curvature,
                glass,
                semi_diameter,
                conic,
                aspheric,
                radius: None,
            }),
            (true, true) => PartSpec::Mirror(MirrorSpec {
                curvature,
                semi_diameter,
                hole,
                conic,
                aspheric,
                ..MirrorSpec::default()
            }),
            (false, _) if row.shape == SurfaceShape::Biconic && !row.mirror => {
                PartSpec::Biconic(BiconicSpec {
                    radius: curvature.map(|c| Millimetres(1.0 / c)),
                    conic,
                    radius_x: row.length(1, unit).map(Millimetres),
                    conic_x: row.parameter(2),
                    glass,
                    semi_diameter,
                })
            }
            (false, _) if row.shape == SurfaceShape::Freeform => PartSpec::Freeform(FreeformSpec {
                curvature,
                glass,
                semi_diameter,
                conic,
                mirror: row.mirror,
                hole,
                ..row.freeform.as_deref().cloned().unwrap_or_default()
            }),
            (false, _) => PartSpec::Freeform(FreeformSpec {
                curvature,
                glass,
                semi_diameter,
                conic,
                aspheric,
                mirror: row.mirror,
                hole,
                fresnel: row.shape == SurfaceShape::Fresnel,
                rotation_radius: row.rotation_radius(unit),
                sag: row.sag(unit, self.sheet.format.words().toroid)?,
                phase: row.phase(unit)?,
                ..FreeformSpec::default()
            }),
        }))
    }
}

impl SheetRow {
    /// A paraxial lens.
    fn thin_lens(&self, unit: f64) -> Result<PartSpec, ZemaxError> {
        let focal_length = self.parameters.get(&1).map_or(100.0, |p| p.value) * unit;
        if focal_length == 0.0 {
            return Err(ZemaxError::new(self.line, "a paraxial lens of focal length 0"));
        }
        Ok(PartSpec::ThinLens(ThinLensSpec {
            focal_length: Millimetres(focal_length),
            semi_diameter: self.semi_diameter().map(|length| Millimetres(length * unit)),
        }))
    }

    /// True if the row is a plane that only separates media.
    pub(super) fn is_flat(&self) -> bool {
        let bends = |(number, parameter): (&usize, &Parameter)| {
            parameter.value != 0.0 && (self.shape == SurfaceShape::EvenAsphere || *number > 2)
        };
        let terms = match self.shape {
            SurfaceShape::EvenAsphere => &self.parameters,
            SurfaceShape::ExtendedAsphere => &self.extra,
            SurfaceShape::Standard => return self.curvature == 0.0,
            _ => return false,
        };
        self.curvature == 0.0 && !terms.iter().any(bends)
    }

    /// Coefficients by power, in millimetres.
    fn aspheric(&self, unit: f64) -> Result<BTreeMap<String, f64>, ZemaxError> {
        let mut terms = BTreeMap::new();
        let mut add = |power: usize, value: f64| {
            let scale = unit.powi(1 - i32::try_from(power).unwrap_or(0));
            if value != 0.0 {
                terms.insert(power.to_string(), value * scale);
            }
        };
        match self.shape {
            // PARM 1 to 8 are the coefficients of r² to r¹⁶.
            SurfaceShape::EvenAsphere
            | SurfaceShape::Binary2
            | SurfaceShape::ZernikeStandard
            | SurfaceShape::ZernikeFringe
            | SurfaceShape::Fresnel => {
                for (&number, parameter) in self.parameters.iter().filter(|p| (1..=8).contains(p.0))
                {
                    add(2 * number, parameter.value);
                }
            }
            // XDAT 1 is the number of terms, 2 the radius that r is divided by, and the
            // coefficients follow.
            SurfaceShape::ExtendedAsphere => {
                let terms = self.extra.get(&1).map_or(0.0, |p| p.value);
                let radius = self.extra.get(&2).map_or(1.0, |p| p.value);
                let last = self.extra.range(3..).rfind(|(_, p)| p.value != 0.0);
                if let Some((_, parameter)) = last.filter(|(number, _)| **number > 17) {
                    let why = "XDAT: powers beyond r^30 have no counterpart here";
                    return Err(ZemaxError::new(parameter.line, why));
                }
                for (&number, parameter) in self.extra.range(3..18) {
                    let power = 2 * (number - 2);
                    #[expect(clippy::cast_precision_loss, reason = "at most 15")]
                    let counts = (number - 2) as f64 <= terms;
                    if counts {
                        let power_of_radius = radius.powi(i32::try_from(power).unwrap_or(0));
                        add(power, parameter.value / power_of_radius);
                    }
                }
            }
            SurfaceShape::OddAsphere => {
                for (&number, parameter) in self.parameters.iter().filter(|p| (1..=8).contains(p.0))
                {
                    add(number, parameter.value);
                }
            }
            // PARM 1 is the radius of rotation, and the coefficients of y² to y¹⁴ follow.
            SurfaceShape::Toroidal => {
                for (&number, parameter) in self.parameters.iter().filter(|p| (2..=8).contains(p.0))
                {
                    add(2 * (number - 1), parameter.value);
                }
            }
            SurfaceShape::Standard
            | SurfaceShape::Paraxial
            | SurfaceShape::CoordinateBreak
            | SurfaceShape::Biconic
            | SurfaceShape::Freeform
            | SurfaceShape::Tilted
            | SurfaceShape::Grating => {}
        }
        Ok(terms)
    }

    /// True if a turn about its axis changes nothing.
    pub(super) fn is_round(&self) -> bool {
        !matches!(
            self.shape,
            SurfaceShape::Toroidal
                | SurfaceShape::Biconic
                | SurfaceShape::Grating
                | SurfaceShape::Tilted
                | SurfaceShape::ZernikeStandard
                | SurfaceShape::ZernikeFringe
        ) && self.freeform.as_ref().is_none_or(|spec| spec.sag.is_empty() && spec.phase.is_none())
    }

    /// Converts the surface to a frame that is turned about its x axis by half a turn.
    pub(super) fn turn_about(&mut self) -> Result<(), ZemaxError> {
        if !self.is_round() || self.shape == SurfaceShape::CoordinateBreak {
            let why = "a surface that is not round stands with its back to the light; turn its coordinates by half a turn";
            return Err(ZemaxError::new(self.line, why));
        }
        self.curvature = -self.curvature;
        self.aperture_decentre[1] = -self.aperture_decentre[1];
        // Of an extended asphere the first two are a number and a radius.
        self.extra.range_mut(3..).for_each(|(_, parameter)| parameter.value = -parameter.value);
        if let Some(spec) = &mut self.freeform {
            spec.aspheric.values_mut().for_each(|value| *value = -*value);
        }
        Ok(())
    }

    fn parameter(&self, number: usize) -> f64 {
        self.parameters.get(&number).map_or(0.0, |parameter| parameter.value)
    }

    /// A radius by its parameter (mm); `None` for 0, which is a plane.
    fn length(&self, number: usize, unit: f64) -> Option<f64> {
        Some(self.parameter(number) * unit).filter(|length| *length != 0.0)
    }

    /// Of a toroid; 0 for a cylinder.
    fn rotation_radius(&self, unit: f64) -> Option<Millimetres> {
        (self.shape == SurfaceShape::Toroidal).then(|| Millimetres(self.parameter(1) * unit))
    }

    /// XDAT 1 is the number of terms, 2 a radius, and the coefficients follow.
    fn coefficients(&self) -> Result<(f64, Vec<f64>), ZemaxError> {
        let radius = self.extra.get(&2).map_or(0.0, |parameter| parameter.value);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a count, and it saturates"
        )]
        let count = self.extra.get(&1).map_or(0, |parameter| parameter.value as usize);
        if count > 0 && radius <= 0.0 {
            let line = self.extra.get(&2).map_or(self.line, |parameter| parameter.line);
            return Err(ZemaxError::new(line, "XDAT 2: the radius of the terms must be positive"));
        }
        let value = |i: usize| self.extra.get(&(i + 3)).map_or(0.0, |parameter| parameter.value);
        Ok((radius, (0..count.min(400)).map(value).collect()))
    }

    fn sag(&self, unit: f64, toroid: &str) -> Result<Vec<SagSpec>, ZemaxError> {
        let order = match self.shape {
            SurfaceShape::ZernikeStandard => ZernikeOrder::Noll,
            SurfaceShape::ZernikeFringe => ZernikeOrder::Fringe,
            // The tangents of a plane's angles along x and y.
            SurfaceShape::Tilted => {
                let coefficients = vec![(1, 0, self.parameter(1)), (0, 1, self.parameter(2))];
                return Ok(vec![SagSpec::Polynomial { radius: Millimetres(1.0), coefficients }]);
            }
            SurfaceShape::Biconic => {
                let why = format!(
                    "a biconic mirror has no counterpart here; write a toroid ({toroid}), or a glass"
                );
                return Err(ZemaxError::new(self.line, why));
            }
            _ => return Ok(Vec::new()),
        };
        let (radius, values) = self.coefficients()?;
        let numbered = values.iter().enumerate().filter(|(_, value)| **value != 0.0);
        let coefficients: BTreeMap<String, f64> =
            numbered.map(|(i, value)| ((i + 1).to_string(), value * unit)).collect();
        if coefficients.is_empty() {
            return Ok(Vec::new());
        }
        Ok(vec![SagSpec::Zernike { radius: Millimetres(radius * unit), order, coefficients }])
    }

    fn phase(&self, unit: f64) -> Result<Option<PhaseSpec>, ZemaxError> {
        let (pattern, order) = match self.shape {
            SurfaceShape::Grating => {
                // Lines in a micrometre, in whatever unit the file is.
                let density = self.parameter(1);
                if density == 0.0 {
                    return Ok(None);
                }
                let period = Millimetres(1e-3 / density.abs());
                (
                    PatternSpec::Grating { period, rotation: 0.0 },
                    self.parameter(2) * density.signum(),
                )
            }
            SurfaceShape::Binary2 => {
                let (radius, coefficients) = self.coefficients()?;
                if coefficients.is_empty() {
                    return Ok(None);
                }
                let order = self.parameters.get(&0).map_or(1.0, |parameter| parameter.value);
                (PatternSpec::Radial { radius: Millimetres(radius * unit), coefficients }, order)
            }
            _ => return Ok(None),
        };
        #[expect(
            clippy::cast_possible_truncation,
            reason = "a whole number of few digits, as is checked"
        )]
        let whole = order as i32;
        if f64::from(whole) != order {
            let why = format!("the order of diffraction is {order}; only whole ones exist");
            return Err(ZemaxError::new(self.line, why));
        }
        Ok(Some(PhaseSpec {
            pattern,
            order: Some(whole),
            blaze_wavelength: None,
            design_wavelength: None,
        }))
    }

    /// The one aperture that a plane in air is, where it is one with an end of its own: a rectangle, an ellipse, a ring or
    /// a spider in one.
    pub(super) fn opening_alone(&self, unit: f64) -> Option<(ApertureSpec, [f64; 2])> {
        let radius = self.clear_radius().map(|radius| Millimetres(radius * unit));
        let inner_radius = Millimetres(self.inner * unit);
        // The edge of a stop that has no other is its semi-diameter.
        if self.stop && radius.is_none() && !self.has_corners() {
            return None;
        }
        let is_ring = self.inner > 0.0 || radius.is_some();
        let sheets = self.sheets(unit);
        let spec = match &sheets[..] {
            [(spec @ (ApertureSpec::Rectangular(shape) | ApertureSpec::Elliptical(shape)), _)]
                if !shape.obscures && radius.is_none() =>
            {
                spec.clone()
            }
            [(ApertureSpec::Annular(_), _)] if self.inner > 0.0 => {
                ApertureSpec::Annular(AnnularSpec { inner_radius, radius })
            }
            [(ApertureSpec::Spider(spider), _)] | [(ApertureSpec::Spider(spider), _), _]
                if is_ring && self.aperture_decentre == [0.0; 2] =>
            {
                ApertureSpec::Spider(SpiderSpec { inner_radius, radius, ..spider.clone() })
            }
            _ => return None,
        };
        Some((spec, self.aperture_decentre.map(|value| value * unit)))
    }

    /// Its apertures beside its rim, and where they stand across its axis (mm).
    pub(super) fn sheets(&self, unit: f64) -> Vec<(ApertureSpec, [f64; 2])> {
        let length = |value: f64| Millimetres(value * unit);
        let decentre = self.aperture_decentre.map(|value| value * unit);
        let mut openings = self.openings.clone();
        if self.inner > 0.0 && !self.mirror {
            openings.push(SheetOpening::Disk(self.inner));
        }
        if let (Some(radius), true) = (self.clear_radius(), decentre != [0.0; 2]) {
            openings.push(SheetOpening::Circle(radius));
        }
        let boxed = |half: [f64; 2], obscures: bool| BoxSpec {
            width: length(2.0 * half[0]),
            height: length(2.0 * half[1]),
            rotation: Degrees(0.0),
            obscures,
        };
        let spec = |opening: SheetOpening| match opening {
            SheetOpening::Disk(radius) => {
                ApertureSpec::Annular(AnnularSpec { inner_radius: length(radius), radius: None })
            }
            SheetOpening::Rectangle(half) => ApertureSpec::Rectangular(boxed(half, false)),
            SheetOpening::Ellipse(half) => ApertureSpec::Elliptical(boxed(half, false)),
            SheetOpening::OpaqueRectangle(half) => ApertureSpec::Rectangular(boxed(half, true)),
            SheetOpening::OpaqueEllipse(half) => ApertureSpec::Elliptical(boxed(half, true)),
            SheetOpening::Circle(radius) => {
                ApertureSpec::Circular(CircularSpec { radius: length(radius) })
            }
            SheetOpening::Spider(width, arms) => ApertureSpec::Spider(SpiderSpec {
                arms,
                width: length(width),
                rotation: Degrees(0.0),
                inner_radius: Millimetres(0.0),
                radius: None,
            }),
        };
        openings.into_iter().map(|opening| (spec(opening), decentre)).collect()
    }
}
