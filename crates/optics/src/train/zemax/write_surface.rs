//! The lines of one surface of a Zemax file, of an element of a lens file.

use crate::element::{
    ApertureSpec, BoxSpec, ElementSpec, FreeformSpec, PartSpec, PatternSpec, PhaseSpec, SagSpec,
};
use crate::glass::GlassSpec;
use crate::zernike::ZernikeOrder;
use etendue_geometry::units::Millimetres;

/// The lines of one surface.
#[derive(Default)]
pub(super) struct SurfaceLines {
    pub(super) lines: Vec<String>,
    pub(super) thickness: f64,
}

impl SurfaceLines {
    pub(super) fn new(kind: &str) -> Self {
        Self { lines: vec![format!("TYPE {kind}")], thickness: 0.0 }
    }

    pub(super) fn push(&mut self, line: String) {
        self.lines.push(line);
    }

    pub(super) fn parameter(&mut self, number: usize, value: f64) {
        self.push(format!("PARM {number} {value:e}"));
    }

    fn curved(&mut self, curvature: f64, conic: f64) {
        self.push(format!("CURV {curvature:e} 0 0 0 0 \"\""));
        if conic != 0.0 {
            self.push(format!("CONI {conic:e}"));
        }
    }

    /// XDAT 1 and 2, and the values from 3 on.
    fn data(&mut self, radius: f64, values: &[f64]) {
        self.push(format!("XDAT 1 {}", values.len()));
        self.push(format!("XDAT 2 {radius:e}"));
        for (i, value) in values.iter().enumerate().filter(|(_, value)| **value != 0.0) {
            self.push(format!("XDAT {} {value:e}", i + 3));
        }
    }
}

/// The row of an element between media.
pub(super) fn surface(
    element: &ElementSpec,
    before: Option<&GlassSpec>,
) -> Result<SurfaceLines, String> {
    let none =
        |what: &str| Err(format!("Zemax files have no counterpart for {what}; leave it out"));
    let rim = |row: &mut SurfaceLines, radius: Option<f64>| {
        if let Some(radius) = radius {
            row.push(format!("DIAM {radius:e} 1 0 0 1 \"\""));
        }
    };
    let length = |length: Option<Millimetres>| length.map(|l| l.0);
    let bend = |radius: Option<Millimetres>, curvature: Option<f64>| {
        radius.map_or(curvature.unwrap_or(0.0), |radius| 1.0 / radius.0)
    };
    let mut row = match &element.part {
        PartSpec::Surface(spec) => {
            let mut row = even(&spec.aspheric)?;
            row.curved(bend(spec.radius, spec.curvature), spec.conic);
            rim(&mut row, length(spec.semi_diameter));
            row
        }
        PartSpec::Mirror(spec) if spec.reflectance.is_none() && spec.coating.is_none() => {
            let mut row = even(&spec.aspheric)?;
            row.curved(bend(spec.radius, spec.curvature), spec.conic);
            match (spec.hole.0, length(spec.semi_diameter)) {
                (0.0, radius) => rim(&mut row, radius),
                (hole, Some(radius)) => row.push(format!("CLAP {hole:e} {radius:e} 0")),
                (_, None) => return none("a mirror with a hole and no semi_diameter"),
            }
            row
        }
        PartSpec::Mirror(_) => return none("what a mirror reflects"),
        PartSpec::Biconic(spec) => {
            let mut row = SurfaceLines::new("BICONICX");
            row.curved(bend(spec.radius, None), spec.conic);
            row.parameter(1, spec.radius_x.map_or(0.0, |radius| radius.0));
            row.parameter(2, spec.conic_x);
            rim(&mut row, length(spec.semi_diameter));
            row
        }
        PartSpec::ThinLens(spec) => {
            let mut row = SurfaceLines::new("PARAXIAL");
            row.parameter(1, spec.focal_length.0);
            rim(&mut row, length(spec.semi_diameter));
            row
        }
        PartSpec::Aperture(spec) => opening(spec)?,
        PartSpec::Freeform(spec) => {
            let mut row = freeform(spec)?;
            row.curved(bend(spec.radius, spec.curvature), spec.conic);
            rim(&mut row, length(spec.semi_diameter));
            row
        }
        PartSpec::CoordinateBreak(_) => return none("this break"),
        PartSpec::Filter(_) => return none("a filter"),
        PartSpec::MicrolensArray(_) => return none("an array of lenslets"),
    };
    let is_mirror = match &element.part {
        PartSpec::Mirror(_) => true,
        PartSpec::Freeform(spec) => spec.mirror,
        _ => false,
    };
    // Sheets stand in the medium before them.
    let behind = match element.part.medium_behind() {
        Some(behind) => behind,
        None => before,
    };
    match (is_mirror, behind) {
        (true, _) => row.push("GLAS MIRROR 0 0 1.5 40 0 0 0 0 0 0".to_owned()),
        (false, None) => {}
        (false, Some(glass)) => row.push(format!("GLAS {}", named(glass)?)),
    }
    Ok(row)
}

/// A plane in air with an opening, or with what is in the way.
fn opening(spec: &ApertureSpec) -> Result<SurfaceLines, String> {
    let mut row = SurfaceLines::new("STANDARD");
    row.curved(0.0, 0.0);
    let turned = || {
        Err("Zemax files have no counterpart for an aperture that is turned; leave rotation out, or save the lens as \
             .json"
            .to_owned())
    };
    let half_widths = |row: &mut SurfaceLines, command: &str, spec: &BoxSpec| {
        row.push(format!("{command} {:e} {:e} 0", 0.5 * spec.width.0, 0.5 * spec.height.0));
    };
    // Without an end, as OpticStudio has it.
    let outer = |radius: Option<Millimetres>| radius.map_or(1e10, |radius| radius.0);
    match spec {
        ApertureSpec::Circular(spec) => row.push(format!("DIAM {:e} 1 0 0 1 \"\"", spec.radius.0)),
        ApertureSpec::Rectangular(spec) | ApertureSpec::Elliptical(spec)
            if spec.rotation.0 != 0.0 =>
        {
            return turned();
        }
        ApertureSpec::Rectangular(spec) => {
            half_widths(&mut row, if spec.obscures { "SQOB" } else { "SQAP" }, spec);
        }
        ApertureSpec::Elliptical(spec) => {
            half_widths(&mut row, if spec.obscures { "ELOB" } else { "ELAP" }, spec);
        }
        ApertureSpec::Annular(spec) => {
            row.push(format!("CLAP {:e} {:e} 0", spec.inner_radius.0, outer(spec.radius)));
        }
        ApertureSpec::Spider(spec) => {
            if spec.rotation.0 != 0.0 {
                return turned();
            }
            row.push(format!("CLAP {:e} {:e} 0", spec.inner_radius.0, outer(spec.radius)));
            row.push(format!("SPID {:e} {} 0", spec.width.0, spec.arms));
        }
        ApertureSpec::Polygon(_) | ApertureSpec::Image(_) | ApertureSpec::Outline(_) => {
            return Err("Zemax files have no counterpart for an aperture with blades, a mask or corners; save the lens \
                        as .json"
                .to_owned());
        }
    }
    Ok(row)
}

/// `NAME 0 0 …`, or a model glass.
fn named(glass: &GlassSpec) -> Result<String, String> {
    match glass {
        GlassSpec::Named(name) => {
            let name = name.split_once(':').map_or(name.as_str(), |(_, name)| name);
            Ok(format!("{name} 0 0 1.5 40 0 0 0 0 0 0"))
        }
        GlassSpec::Constant(n) => Ok(format!("___BLANK 1 0 {n:e} 0 0 0 0 0 0 0")),
        GlassSpec::Abbe { nd, vd } => Ok(format!("___BLANK 1 0 {nd:e} {vd:e} 0 0 0 0 0 0")),
        GlassSpec::Sellmeier { .. } | GlassSpec::Power(_) | GlassSpec::Cauchy(_) => {
            Err("a glass by a formula has no counterpart in Zemax files; put it into an AGF catalogue and name it".to_owned())
        }
    }
}

/// Powers of r by the type that has them.
fn even(terms: &std::collections::BTreeMap<String, f64>) -> Result<SurfaceLines, String> {
    let powers = powers(terms)?;
    let highest = powers.iter().map(|(power, _)| *power).max().unwrap_or(0);
    if highest > 16 {
        let mut row = SurfaceLines::new("XASPHERE");
        let mut values = vec![0.0; highest / 2];
        for (power, value) in powers {
            values[power / 2 - 1] = value;
        }
        row.data(1.0, &values);
        return Ok(row);
    }
    let mut row = SurfaceLines::new(if powers.is_empty() { "STANDARD" } else { "EVENASPH" });
    for (power, value) in powers {
        row.parameter(power / 2, value);
    }
    Ok(row)
}

fn powers(terms: &std::collections::BTreeMap<String, f64>) -> Result<Vec<(usize, f64)>, String> {
    let terms = terms.iter().map(|(key, value)| {
        let power = key.parse::<usize>().map_err(|_| format!("aspheric has the power \"{key}\""));
        Ok((power?, *value))
    });
    terms.collect()
}

fn freeform(spec: &FreeformSpec) -> Result<SurfaceLines, String> {
    let none =
        |what: &str| Err(format!("Zemax files have no counterpart for {what}; leave it out"));
    if spec.reflectance.is_some() || spec.hole.0 != 0.0 {
        return none("the hole or reflectance of a freeform mirror");
    }
    let powers = powers(&spec.aspheric)?;
    let evens = |row: &mut SurfaceLines| {
        for (power, value) in &powers {
            if power % 2 == 1 || *power > 16 {
                return Err(format!(
                    "the power {power} of r with what else this surface has has no counterpart in Zemax files"
                ));
            }
            row.parameter(power / 2, *value);
        }
        Ok(())
    };
    let plain = spec.phase.is_none() && !spec.fresnel && spec.rotation_radius.is_none();
    let mut row = match (&spec.sag[..], &spec.phase) {
        ([], None) if spec.fresnel && spec.rotation_radius.is_none() => {
            let mut row = SurfaceLines::new("FRESNELS");
            evens(&mut row)?;
            row
        }
        ([], None) if plain => {
            let mut row = SurfaceLines::new("ODDASPHE");
            for (power, value) in &powers {
                if *power > 8 {
                    return none("powers of r beyond 8 with odd ones among them");
                }
                row.parameter(*power, *value);
            }
            row
        }
        ([], None) if !spec.fresnel => {
            let mut row = SurfaceLines::new("TOROIDAL");
            row.parameter(1, spec.rotation_radius.map_or(0.0, |radius| radius.0));
            for (power, value) in &powers {
                if power % 2 == 1 || *power > 14 {
                    return none("powers of y of a toroid that are odd or beyond 14");
                }
                row.parameter(power / 2 + 1, *value);
            }
            row
        }
        ([SagSpec::Zernike { radius, order, coefficients }], None) if plain => {
            let mut row = SurfaceLines::new(match order {
                ZernikeOrder::Fringe => "FZERNSAG",
                ZernikeOrder::Noll => "SZERNSAG",
            });
            evens(&mut row)?;
            let mut values = Vec::new();
            for (key, value) in coefficients {
                let number = key.parse::<usize>().ok().filter(|n| (1..=400).contains(n));
                let number =
                    number.ok_or_else(|| format!("sag[0]: no term has the number \"{key}\""))?;
                values.resize(values.len().max(number), 0.0);
                values[number - 1] = *value;
            }
            row.data(radius.0, &values);
            row
        }
        ([], Some(phase)) if !spec.fresnel && spec.rotation_radius.is_none() => {
            let mut row = diffracting(phase)?;
            if matches!(phase.pattern, PatternSpec::Grating { .. }) && !powers.is_empty() {
                return none("an aspheric grating");
            }
            evens(&mut row)?;
            row
        }
        _ => return none("what is added to this surface, or these together"),
    };
    if row.lines.is_empty() {
        row = SurfaceLines::new("STANDARD");
    }
    Ok(row)
}

fn diffracting(phase: &PhaseSpec) -> Result<SurfaceLines, String> {
    let none =
        |what: &str| Err(format!("Zemax files have no counterpart for {what}; leave it out"));
    if phase.blaze_wavelength.is_some() || phase.design_wavelength.is_some() {
        return none("a phase with a blaze_wavelength or design_wavelength");
    }
    let order = f64::from(phase.order.unwrap_or(1));
    match &phase.pattern {
        PatternSpec::Grating { period, rotation: 0.0 } => {
            let mut row = SurfaceLines::new("DGRATING");
            row.parameter(1, 1e-3 / period.0);
            row.parameter(2, order);
            Ok(row)
        }
        PatternSpec::Radial { radius, coefficients } => {
            let mut row = SurfaceLines::new("BINARY_2");
            row.parameter(0, order);
            row.data(radius.0, coefficients);
            Ok(row)
        }
        PatternSpec::Grating { .. }
        | PatternSpec::Polynomial { .. }
        | PatternSpec::Image { .. } => none("this pattern of phase"),
    }
}
