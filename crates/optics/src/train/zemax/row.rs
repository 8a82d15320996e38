//! A row of the lens data sheet, and the lines of a Zemax file that fill it.

use std::collections::BTreeMap;

use super::ZemaxError;
use super::axes::Break;
use super::line::SheetLine;
use crate::element::FreeformSpec;
use crate::glass::GlassSpec;

/// A surface.
#[derive(Debug, Default)]
pub(super) struct SheetRow {
    pub(super) line: usize,
    pub(super) shape: SurfaceShape,
    pub(super) curvature: f64,
    pub(super) conic: f64,
    pub(super) thickness: f64,
    /// True if the file states the thickness.
    pub(super) is_closed: bool,
    pub(super) glass: Option<SheetGlass>,
    /// True if the glass is MIRROR.
    pub(super) mirror: bool,
    /// Openings that stop light beside the rim, in the file's unit.
    pub(super) openings: Vec<SheetOpening>,
    /// Shift of the openings across the surface's axis.
    pub(super) aperture_decentre: [f64; 2],
    /// Its own inner radius.
    pub(super) inner: f64,
    pub(super) stop: bool,
    pub(super) parameters: BTreeMap<usize, Parameter>,
    pub(super) extra: BTreeMap<usize, Parameter>,
    /// Of a [`SurfaceShape::Freeform`]: all that it has beside its base, glass and rim, in millimetres.
    pub(super) freeform: Option<Box<FreeformSpec>>,
    pub(super) semi_diameter: Option<f64>,
    pub(super) fixed: bool,
    pub(super) clear: Option<f64>,
}

/// Radii from here on are no limit, as files write it (in any unit).
const OPEN: f64 = 1e10;

/// The types that have a counterpart here.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum SurfaceShape {
    #[default]
    Standard,
    EvenAsphere,
    ExtendedAsphere,
    Paraxial,
    CoordinateBreak,
    OddAsphere,
    Toroidal,
    Biconic,
    Grating,
    Binary2,
    ZernikeStandard,
    ZernikeFringe,
    Fresnel,
    Tilted,
    Freeform,
}

impl SurfaceShape {
    /// The numbers of the parameters that it reads.
    pub(super) fn parameters(self) -> std::ops::RangeInclusive<usize> {
        match self {
            // PARM 0 is not in use, and what others mean is in extra data.
            Self::Standard | Self::Freeform => usize::MAX..=usize::MAX,
            Self::EvenAsphere | Self::OddAsphere | Self::Toroidal => 1..=8,
            Self::ZernikeStandard | Self::ZernikeFringe | Self::Fresnel => 1..=8,
            Self::ExtendedAsphere => usize::MAX..=usize::MAX,
            Self::Paraxial => 1..=1,
            Self::CoordinateBreak => 1..=6,
            Self::Biconic | Self::Grating | Self::Tilted => 1..=2,
            Self::Binary2 => 0..=8,
        }
    }
}

/// An aperture of a surface that is no rim.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum SheetOpening {
    /// A disk of this radius in the way.
    Disk(f64),
    /// By half its sides.
    Rectangle([f64; 2]),
    /// By half its axes.
    Ellipse([f64; 2]),
    /// A rectangle in the way, by half its sides.
    OpaqueRectangle([f64; 2]),
    /// An ellipse in the way, by half its axes.
    OpaqueEllipse([f64; 2]),
    /// Width and number of arms.
    Spider(f64, u32),
    /// A circle that stands beside the axis, by its radius.
    Circle(f64),
}

#[derive(Debug, Clone)]
pub(super) struct SheetGlass {
    pub(super) line: usize,
    pub(super) name: String,
    /// Specification of the glass where its name does not give it.
    pub(super) spec: Option<GlassSpec>,
}

impl SheetGlass {
    /// A glass by nd and Abbe number; one of 0 is a glass without dispersion.
    pub(super) fn model(line: usize, name: &str, nd: f64, vd: f64) -> Self {
        let spec = match vd {
            0.0 => GlassSpec::Constant(nd),
            _ => GlassSpec::Abbe { nd, vd },
        };
        Self { line, name: name.to_owned(), spec: Some(spec) }
    }
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Parameter {
    pub(super) line: usize,
    pub(super) value: f64,
}

impl SheetRow {
    /// Reads a line of a surface; false if it is not understood.
    pub(super) fn read(&mut self, line: &SheetLine<'_>) -> Result<bool, ZemaxError> {
        match line.command {
            "STOP" => self.stop = true,
            "TYPE" => self.shape = shape(line)?,
            "CURV" => self.curvature = line.number(0)?,
            "CONI" => self.conic = line.number(0)?,
            "DISZ" => {
                let is_far = line.rest.starts_with("INF");
                self.thickness = if is_far { f64::INFINITY } else { line.number(0)? };
                self.is_closed = true;
            }
            "GLAS" if line.word(0) == Some("MIRROR") => self.mirror = true,
            "GLAS" => self.glass = glass(line)?,
            "PARM" => {
                let parameter = Parameter { line: line.number, value: line.number(1)? };
                self.parameters.insert(line.index(0)?, parameter);
            }
            "XDAT" => {
                let parameter = Parameter { line: line.number, value: line.number(1)? };
                self.extra.insert(line.index(0)?, parameter);
            }
            "DIAM" => {
                let length = line.number(0)?;
                if length < 0.0 {
                    return Err(
                        line.error(format!("a semi-diameter of {length} must not be below zero"))
                    );
                }
                self.semi_diameter = Some(length).filter(|length| *length > 0.0);
                self.fixed = line.number_or(1, 0.0)? == 1.0;
            }
            // The tab of a surface's tilts and decentres.
            "SCBD" if line.rest.split_whitespace().any(|word| word.parse() != Ok(0.0)) => {
                return Err(line.error(
                    "the tilt or decentre of a surface by itself cannot be imported; write COORDBRK before and behind \
                     it (in OpticStudio: Tilt/Decenter Elements)",
                ));
            }
            _ => return self.read_aperture(line),
        }
        Ok(true)
    }

    /// Reads a line of an aperture; false if it is not one.
    fn read_aperture(&mut self, line: &SheetLine<'_>) -> Result<bool, ZemaxError> {
        match line.command {
            // Without an end is how a file writes that there is none outside.
            "CLAP" | "FLAP" => {
                let is_open = |i: usize| line.word(i).is_some_and(|word| word.starts_with("INF"));
                if is_open(0) {
                    return Ok(true);
                }
                self.inner = line.number(0)?;
                let clear = if is_open(1) { f64::INFINITY } else { line.number(1)? };
                self.clear = Some(clear).filter(|length| *length > 0.0 && *length < OPEN);
                if self.inner < 0.0 || self.clear.is_some_and(|clear| self.inner >= clear) {
                    return Err(
                        line.error("the inner radius must be from 0 on and below the outer one")
                    );
                }
            }
            "OBDC" => self.aperture_decentre = [line.number(0)?, line.number_or(1, 0.0)?],
            // One that covers nothing.
            "OBSC" if line.number_or(1, 0.0)? == 0.0 => {}
            "OBSC" if line.number(0)? == 0.0 && line.number(1)? > 0.0 => {
                self.openings.push(SheetOpening::Disk(line.number(1)?));
            }
            "SQAP" | "ELAP" | "SQOB" | "ELOB" => {
                let half = [line.number(0)?, line.number(1)?];
                let obscures = line.command.ends_with("OB");
                if half.iter().any(|half| *half <= 0.0) {
                    // One in the way that covers nothing.
                    if obscures && half.iter().all(|half| *half >= 0.0) {
                        return Ok(true);
                    }
                    return Err(line.error("both half widths must be positive"));
                }
                self.openings.push(match (line.command.starts_with("SQ"), obscures) {
                    (true, false) => SheetOpening::Rectangle(half),
                    (false, false) => SheetOpening::Ellipse(half),
                    (true, true) => SheetOpening::OpaqueRectangle(half),
                    (false, true) => SheetOpening::OpaqueEllipse(half),
                });
            }
            "SPID" => {
                let arms = u32::try_from(line.index(1)?).unwrap_or(u32::MAX);
                self.openings.push(SheetOpening::Spider(line.number(0)?, arms));
            }
            "OBSC" => {
                return Err(line.error(
                    "a ring in the way cannot be imported; write OBSC 0 and a radius, or take the line out and add the \
                     ring to the lens file that --save writes, as an `aperture` with a mask (\"shape\": \"image\")",
                ));
            }
            // Its points stand in a file of OpticStudio's own folder.
            "UDAP" | "UDAD" | "USAP" | "USOB" => {
                return Err(line.error(
                    "an aperture by points of the user's cannot be imported; take the line out, and add the points to \
                     the lens file that --save writes, as an `aperture` of \"shape\": \"outline\" with its `corners`",
                ));
            }
            // The substrate of a mirror, of which every surface has one; a mirror is GLAS MIRROR.
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// Puts another glass by its name; none for the air.
    pub(super) fn change_glass(&mut self, line: usize, name: &str) -> Result<(), ZemaxError> {
        let is_mirror = name.eq_ignore_ascii_case("MIRROR");
        if is_mirror != self.mirror {
            let why = "GLSS: a configuration makes a mirror of a surface, or none of one, which has no counterpart";
            return Err(ZemaxError::new(line, why));
        }
        let is_air = ["AIR", "0", "\"\""].iter().any(|air| name.eq_ignore_ascii_case(air));
        if !is_mirror {
            let glass = SheetGlass { line, name: name.to_owned(), spec: None };
            self.glass = (!is_air).then_some(glass);
        }
        Ok(())
    }

    /// Radius from the axis within which light passes, in the file's unit.
    pub(super) fn semi_diameter(&self) -> Option<f64> {
        // One that stands beside the axis is a sheet of its own, and rims of rectangles are corners.
        let is_decentred = self.aperture_decentre != [0.0; 2];
        match self.clear {
            Some(_) if is_decentred => None,
            Some(clear) => Some(clear),
            None if is_decentred || self.has_corners() => None,
            None => self.semi_diameter,
        }
    }

    /// Sets the radius of its clear aperture, in the file's unit.
    pub(super) fn set_clear(&mut self, radius: f64) {
        self.clear = Some(radius).filter(|radius| *radius > 0.0);
    }

    /// Sets that of its edge.
    pub(super) fn set_semi_diameter(&mut self, radius: f64) {
        self.semi_diameter = Some(radius).filter(|radius| *radius > 0.0);
    }

    /// The radius of its own clear aperture.
    pub(super) fn clear_radius(&self) -> Option<f64> {
        self.clear
    }

    pub(super) fn has_corners(&self) -> bool {
        let is_shape = |opening: &SheetOpening| {
            matches!(opening, SheetOpening::Rectangle(_) | SheetOpening::Ellipse(_))
        };
        self.openings.iter().any(is_shape)
    }

    /// True if the surface is meant to stop light.
    pub(super) fn has_fixed_rim(&self) -> bool {
        self.clear.is_some() || (self.fixed && self.semi_diameter.is_some())
    }

    pub(super) fn coordinate_break(&self, unit: f64) -> Break {
        let parameter = |i: usize| self.parameters.get(&i).map_or(0.0, |p| p.value);
        Break {
            decentre: [parameter(1) * unit, parameter(2) * unit],
            tilt: [parameter(3), parameter(4), parameter(5)],
            turned_first: parameter(6) != 0.0,
        }
    }
}

fn shape(line: &SheetLine<'_>) -> Result<SurfaceShape, ZemaxError> {
    match line.word(0) {
        Some("STANDARD") => Ok(SurfaceShape::Standard),
        Some("EVENASPH") => Ok(SurfaceShape::EvenAsphere),
        Some("XASPHERE") => Ok(SurfaceShape::ExtendedAsphere),
        Some("PARAXIAL") => Ok(SurfaceShape::Paraxial),
        Some("COORDBRK") => Ok(SurfaceShape::CoordinateBreak),
        Some("ODDASPHE") => Ok(SurfaceShape::OddAsphere),
        Some("TOROIDAL") => Ok(SurfaceShape::Toroidal),
        Some("BICONICX") => Ok(SurfaceShape::Biconic),
        Some("DGRATING") => Ok(SurfaceShape::Grating),
        Some("BINARY_2") => Ok(SurfaceShape::Binary2),
        Some("SZERNSAG") => Ok(SurfaceShape::ZernikeStandard),
        Some("FZERNSAG") => Ok(SurfaceShape::ZernikeFringe),
        Some("FRESNELS") => Ok(SurfaceShape::Fresnel),
        Some("TILTSURF") => Ok(SurfaceShape::Tilted),
        other => Err(line.error(format!(
            "the surface type {} has no counterpart here; known: STANDARD, EVENASPH, XASPHERE, ODDASPHE, \
             TOROIDAL, BICONICX, SZERNSAG, FZERNSAG, FRESNELS, TILTSURF, DGRATING, BINARY_2, PARAXIAL, COORDBRK",
            other.unwrap_or_default()
        ))),
    }
}

fn glass(line: &SheetLine<'_>) -> Result<Option<SheetGlass>, ZemaxError> {
    let name = line.word(0).ok_or_else(|| line.error("a name is missing"))?;
    // Old files name the air.
    if name == "AIR" {
        return Ok(None);
    }
    let is_model = name == "___BLANK" || line.word(1) == Some("1");
    Ok(Some(match is_model {
        // OpticStudio takes an Abbe number of 0 for a glass without dispersion.
        true => SheetGlass::model(line.number, name, line.number(3)?, line.number_or(4, 0.0)?),
        false => SheetGlass { line: line.number, name: name.to_owned(), spec: None },
    }))
}
