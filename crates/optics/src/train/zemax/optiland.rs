//! Lenses of optiland, as its `Optic.to_dict` writes them into JSON, to the rows of the lens data sheet.
//!
//! Each surface has its own coordinate system in the space of the lens: a place (mm) and turns about the fixed x, y and z
//! axes (rad). Infinite numbers are written as Python does. Fields of earlier versions (`field_type`, `is_reflective`,
//! `f`) are read as well.
//!
//! # Sources
//!
//! The source of optiland 0.6.3 (H. Kramer, MIT licence): `optic_serializer.py`, and `to_dict` of its geometries,
//! materials, interactions and apertures.

use std::collections::BTreeMap;

use glam::{DMat3, DVec3};
use serde_json::Value;

use super::ZemaxError;
use super::axes::Axes;
use super::format::LensFormat;
use super::optiland_system::{as_json, finite, list, number};
use super::optiland_system::{put_aperture, put_fields, put_wavelengths};
use super::oslo::add_placed;
use super::row::{Parameter, SheetGlass, SheetOpening, SheetRow, SurfaceShape};
use super::sheet::ZemaxSheet;
use crate::element::{FreeformSpec, PatternSpec, PhaseSpec, SagSpec};
use crate::glass::{GlassSpec, Makers};
use crate::zernike::ZernikeOrder;
use etendue_geometry::units::Millimetres;

/// The most surfaces.
const MOST_SURFACES: usize = crate::train::MOST_ELEMENTS;

/// Ways from one surface to the next that are none (mm).
const NO_WAY: f64 = 1e-9;

/// The deepest that coordinate systems stand in one another.
const DEEPEST: usize = 32;

impl ZemaxSheet {
    /// Reads the text of a lens of optiland.
    pub(super) fn read_optiland(text: &str) -> Result<Self, ZemaxError> {
        let value: Value = serde_json::from_str(&as_json(text)).map_err(|error| {
            let why = format!("broken JSON in column {}", error.column());
            ZemaxError::new(error.line(), why)
        })?;
        let mut sheet = Self::of_camera(LensFormat::Optiland);
        value["name"].as_str().unwrap_or_default().clone_into(&mut sheet.name);
        let Some(surfaces) = value["surface_group"]["surfaces"].as_array() else {
            return Err(ZemaxError::new(0, "surface_group.surfaces: expected a list of surfaces"));
        };
        if surfaces.len() > MOST_SURFACES {
            return Err(ZemaxError::new(0, format!("more than {MOST_SURFACES} surfaces")));
        }
        let (mut rows, mut places) = (Vec::new(), Vec::new());
        for (i, surface) in surfaces.iter().enumerate() {
            let error =
                |why: String| ZemaxError::new(0, format!("surface_group.surfaces[{i}].{why}"));
            let axes = axes(&surface["geometry"]["cs"], 0).map_err(error)?;
            rows.push(row(i + 1, surface).map_err(error)?);
            places.push(axes);
        }
        put_rows(rows, &places, &mut sheet)?;
        let error = |why: String| ZemaxError::new(0, why);
        put_wavelengths(&value["wavelengths"], &mut sheet).map_err(error)?;
        put_aperture(&value["aperture"], &mut sheet).map_err(error)?;
        put_fields(&value["fields"], &mut sheet).map_err(error)?;
        for (key, left_out) in [
            ("pickups", !is_empty(&value["pickups"])),
            ("solves", !is_empty(&value["solves"]["solves"])),
            ("apodization", !value["apodization"].is_null()),
            ("sequences", value.get("sequences").is_some()),
        ] {
            if left_out {
                sheet.leave_out(key, 0);
            }
        }
        Ok(sheet)
    }
}

fn is_empty(value: &Value) -> bool {
    value.as_array().is_none_or(Vec::is_empty)
}

/// 1/radius; 0 for a plane.
fn curvature(value: &Value, key: &str) -> Result<f64, String> {
    let radius = match &value[key] {
        Value::Null => f64::INFINITY,
        written => number(written).ok_or_else(|| format!("geometry.{key}: expected a number"))?,
    };
    Ok(if radius == 0.0 || radius.is_infinite() { 0.0 } else { 1.0 / radius })
}

/// The axes of a coordinate system, which may stand in another.
fn axes(cs: &Value, depth: usize) -> Result<Axes, String> {
    if depth > DEEPEST {
        return Err(format!("geometry.cs: more than {DEEPEST} reference_cs in one another"));
    }
    let place = |key: &str| match &cs[key] {
        Value::Null => Ok(0.0),
        written => number(written).ok_or_else(|| format!("geometry.cs.{key}: expected a number")),
    };
    let origin = DVec3::new(place("x")?, place("y")?, place("z")?);
    let rotation = DMat3::from_rotation_z(place("rz")?)
        * DMat3::from_rotation_y(place("ry")?)
        * DMat3::from_rotation_x(place("rx")?);
    let outer = &cs["reference_cs"];
    if outer.is_null() {
        return Ok(Axes::new(origin, rotation));
    }
    let outer = axes(outer, depth + 1)?;
    Ok(Axes::new(outer.origin() + outer.rotation() * origin, outer.rotation() * rotation))
}

/// Rows with thicknesses, and breaks where a surface does not stand straight on the axis of the one before.
fn put_rows(
    mut rows: Vec<SheetRow>,
    places: &[Axes],
    sheet: &mut ZemaxSheet,
) -> Result<(), ZemaxError> {
    let [object, first, ..] = places else {
        sheet.rows = rows;
        return Ok(());
    };
    let is_finite = |axes: &Axes| axes.origin().is_finite() && axes.rotation().is_finite();
    if let Some(i) = places.iter().skip(1).position(|axes| !is_finite(axes)) {
        let why = format!("surface_group.surfaces[{}].geometry.cs: expected finite numbers", i + 1);
        return Err(ZemaxError::new(0, why));
    }
    let distance = first.origin().z - object.origin().z;
    rows[0].thickness = if distance.is_finite() { distance } else { f64::INFINITY };
    let straight = |axes: &Axes| {
        axes.origin().truncate() == glam::DVec2::ZERO && axes.rotation() == DMat3::IDENTITY
    };
    if !places[1..].iter().all(straight) {
        let mut places = places.to_vec();
        face(&mut rows, &mut places)?;
        add_placed(rows, &places, 1.0, sheet);
        return Ok(());
    }
    for i in 1..rows.len() {
        let next = places.get(i + 1).map_or(places[i].origin().z, |next| next.origin().z);
        rows[i].thickness = next - places[i].origin().z;
    }
    sheet.rows = rows;
    Ok(())
}

/// Turns surfaces about so that their axes run along the light and, behind an odd number of mirrors, against it, as the
/// sheet has them; optiland's may stand either way.
fn face(rows: &mut [SheetRow], places: &mut [Axes]) -> Result<(), ZemaxError> {
    let mut sense = 1.0;
    for i in 1..rows.len() {
        let way = places[i].origin() - places[i.max(2) - 1].origin();
        if sense * places[i].axis().dot(way) < -NO_WAY {
            let turn = DMat3::from_rotation_x(std::f64::consts::PI);
            places[i] = Axes::new(places[i].origin(), places[i].rotation() * turn);
            rows[i].turn_about()?;
        }
        sense = if rows[i].mirror { -sense } else { sense };
    }
    Ok(())
}

/// A surface without its place; an error begins with the key.
fn row(line: usize, surface: &Value) -> Result<SheetRow, String> {
    let geometry = &surface["geometry"];
    let mut row = SheetRow { line, ..SheetRow::default() };
    row.stop = surface["is_stop"].as_bool().unwrap_or(false);
    let interaction = &surface["interaction_model"];
    let acts = |key: &str| match &interaction[key] {
        Value::Null => &surface[key],
        value => value,
    };
    row.mirror = acts("is_reflective").as_bool().unwrap_or(false);
    if !row.mirror {
        row.glass = glass(line, &surface["material_post"])?;
    }
    rim(&surface["aperture"], &mut row)?;
    let focal_length = match (&interaction["focal_length"], &surface["f"]) {
        (Value::Null, Value::Null) => None,
        (Value::Null, f) | (f, _) => Some(f),
    };
    if let Some(written) = focal_length {
        let f = number(written).filter(|f| f.is_finite() && !row.mirror);
        let value = f.ok_or("focal_length: expected the finite number of a lens, no mirror")?;
        row.shape = SurfaceShape::Paraxial;
        row.parameters.insert(1, Parameter { line, value });
        return Ok(row);
    }
    shape(geometry, &mut row).map_err(|why| format!("geometry: {why}"))?;
    phase(interaction, &mut row)?;
    for key in ["coating", "bsdf"] {
        if !acts(key).is_null() && acts(key)["type"] != "FresnelCoating" {
            return Err(format!(
                "{key}: has no counterpart here; take it out, and write a coating into the lens file"
            ));
        }
    }
    Ok(row)
}

/// The medium behind a surface; `None` for air.
fn glass(line: usize, material: &Value) -> Result<Option<SheetGlass>, String> {
    let kind = material["type"].as_str().unwrap_or_default();
    let spec = match kind {
        "" => return Ok(None),
        "IdealMaterial" => {
            let n = finite(material, "index").map_err(|why| format!("material_post.{why}"))?;
            if n == 1.0 {
                return Ok(None);
            }
            GlassSpec::Constant(n)
        }
        "AbbeMaterial" => {
            GlassSpec::Abbe { nd: finite(material, "index")?, vd: finite(material, "abbe")? }
        }
        "Material" => {
            let name = material["name"].as_str().ok_or("material_post.name: a name is missing")?;
            if name.eq_ignore_ascii_case("air") {
                return Ok(None);
            }
            let by_maker = material["reference"].as_str().map(|maker| format!("{maker}:{name}"));
            let known = |name: &String| {
                GlassSpec::Named(name.clone()).resolve_among(&[], Makers(&[])).is_ok()
            };
            let name = by_maker.filter(known).unwrap_or_else(|| name.to_owned());
            return Ok(Some(SheetGlass { line, name, spec: None }));
        }
        other => {
            return Err(format!(
                "material_post: the material {other} has no counterpart here; known: IdealMaterial, AbbeMaterial, Material"
            ));
        }
    };
    Ok(Some(SheetGlass { line, name: spec.to_string(), spec: Some(spec) }))
}

/// Its physical aperture.
fn rim(aperture: &Value, row: &mut SheetRow) -> Result<(), String> {
    if aperture.is_null() {
        return Ok(());
    }
    let number = |key: &str| {
        number(&aperture[key]).ok_or_else(|| format!("aperture.{key}: expected a number"))
    };
    let kind = aperture["type"].as_str().unwrap_or_default();
    match kind {
        "RadialAperture" | "OffsetRadialAperture" => {
            let (outer, inner) = (number("r_max")?, number("r_min")?);
            if !(inner >= 0.0 && inner < outer) {
                return Err("aperture: r_min must be from 0 on and below r_max".to_owned());
            }
            row.set_clear(if outer.is_finite() { outer } else { 0.0 });
            row.inner = inner;
            if kind == "OffsetRadialAperture" {
                row.aperture_decentre = [number("offset_x")?, number("offset_y")?];
            }
        }
        "EllipticalAperture" => {
            row.openings.push(SheetOpening::Ellipse([number("a")?, number("b")?]));
            row.aperture_decentre = [number("offset_x")?, number("offset_y")?];
        }
        "RectangularAperture" => {
            let [left, right, low, high] =
                [number("x_min")?, number("x_max")?, number("y_min")?, number("y_max")?];
            row.openings.push(SheetOpening::Rectangle([0.5 * (right - left), 0.5 * (high - low)]));
            row.aperture_decentre = [0.5 * (left + right), 0.5 * (low + high)];
        }
        other => {
            return Err(format!(
                "aperture: a {other} has no counterpart here; known: RadialAperture, OffsetRadialAperture, \
                 EllipticalAperture, RectangularAperture"
            ));
        }
    }
    let is_open = |opening: &SheetOpening| match opening {
        SheetOpening::Ellipse(half) | SheetOpening::Rectangle(half) => {
            half.iter().all(|half| *half > 0.0 && half.is_finite())
        }
        SheetOpening::Disk(_)
        | SheetOpening::Spider(..)
        | SheetOpening::OpaqueRectangle(_)
        | SheetOpening::OpaqueEllipse(_)
        | SheetOpening::Circle(_) => true,
    };
    match row.openings.iter().all(is_open) && row.aperture_decentre.iter().all(|at| at.is_finite())
    {
        true => Ok(()),
        false => Err("aperture: its half widths must be positive".to_owned()),
    }
}

fn shape(geometry: &Value, row: &mut SheetRow) -> Result<(), String> {
    row.curvature = curvature(geometry, "radius")?;
    row.conic = finite(geometry, "conic")?;
    let mut spec = FreeformSpec::default();
    let norm = |key: &str| {
        finite(geometry, key).and_then(|length| match length > 0.0 {
            true => Ok(Millimetres(length)),
            false => Err(format!("{key} must be positive")),
        })
    };
    match geometry["type"].as_str().unwrap_or_default() {
        "Plane" => row.curvature = 0.0,
        "StandardGeometry" => {}
        "EvenAsphere" => return even(geometry, row),
        "OddAsphere" => spec.aspheric = powers(&list(geometry, "coefficients")?, 1)?,
        "ToroidalGeometry" => {
            row.curvature = curvature(geometry, "radius_y")?;
            row.conic = finite(geometry, "conic_yz")?;
            let across = curvature(geometry, "radius_x")?;
            spec.rotation_radius =
                Some(Millimetres(if across == 0.0 { 0.0 } else { 1.0 / across }));
            spec.aspheric = powers(&list(geometry, "coeffs_poly_y")?, 2)?;
        }
        "ChebyshevPolynomialGeometry" => spec.sag.push(SagSpec::Chebyshev {
            half_size: [norm("norm_x")?, norm("norm_y")?],
            coefficients: grid(geometry)?,
        }),
        "PolynomialGeometry" => spec
            .sag
            .push(SagSpec::Polynomial { radius: Millimetres(1.0), coefficients: grid(geometry)? }),
        "ZernikePolynomialGeometry" => {
            let order = match geometry["zernike_type"].as_str() {
                Some("fringe") => ZernikeOrder::Fringe,
                Some("noll") => ZernikeOrder::Noll,
                other => {
                    return Err(format!(
                        "zernike_type {} has no counterpart here; known: fringe, noll",
                        other.unwrap_or("standard")
                    ));
                }
            };
            let terms = list(geometry, "coefficients")?.into_iter().enumerate();
            let coefficients: BTreeMap<String, f64> =
                terms.filter(|(_, c)| *c != 0.0).map(|(i, c)| ((i + 1).to_string(), c)).collect();
            spec.sag.push(SagSpec::Zernike { radius: norm("norm_radius")?, order, coefficients });
        }
        other => {
            return Err(format!(
                "a {other} has no counterpart here; known: Plane, StandardGeometry, EvenAsphere, OddAsphere, \
                 ToroidalGeometry, ChebyshevPolynomialGeometry, PolynomialGeometry, ZernikePolynomialGeometry"
            ));
        }
    }
    let is_empty = |sag: &SagSpec| match sag {
        SagSpec::Chebyshev { coefficients, .. } | SagSpec::Polynomial { coefficients, .. } => {
            coefficients.is_empty()
        }
        SagSpec::Zernike { coefficients, .. } => coefficients.is_empty(),
        SagSpec::QBfs { .. } | SagSpec::QCon { .. } | SagSpec::HeightMap(_) => false,
    };
    spec.sag.retain(|sag| !is_empty(sag));
    if spec != FreeformSpec::default() {
        row.shape = SurfaceShape::Freeform;
        row.freeform = Some(Box::new(spec));
    }
    Ok(())
}

/// Coefficients of r², r⁴, ….
fn even(geometry: &Value, row: &mut SheetRow) -> Result<(), String> {
    let coefficients = list(geometry, "coefficients")?;
    powers(&coefficients, 2)?;
    let line = row.line;
    let mut put = |number: usize, value: f64| {
        row.extra.insert(number, Parameter { line, value });
    };
    // As an extended asphere has them: their number, a radius of 1, and the coefficients.
    if coefficients.iter().any(|value| *value != 0.0) {
        put(1, 15.0);
        put(2, 1.0);
        for (i, value) in coefficients.iter().take(15).enumerate() {
            put(i + 3, *value);
        }
        row.shape = SurfaceShape::ExtendedAsphere;
    }
    Ok(())
}

/// Coefficients that are not 0 by their power, a step after another.
fn powers(coefficients: &[f64], step: usize) -> Result<BTreeMap<String, f64>, String> {
    let numbered = coefficients.iter().enumerate().map(|(i, value)| (step * (i + 1), *value));
    let used: Vec<(usize, f64)> = numbered.filter(|(_, value)| *value != 0.0).collect();
    match used.iter().find(|(power, _)| *power > 30) {
        Some((power, _)) => Err(format!(
            "coefficients: powers beyond 30 have no counterpart here, and there is {power}"
        )),
        None => Ok(used.into_iter().map(|(power, value)| (power.to_string(), value)).collect()),
    }
}

/// `coefficients[i][j]` as [i, j, c].
fn grid(geometry: &Value) -> Result<Vec<(u32, u32, f64)>, String> {
    let rows =
        geometry["coefficients"].as_array().ok_or("coefficients: expected a list of lists")?;
    let mut found = Vec::new();
    for (i, row) in rows.iter().enumerate() {
        let row = serde_json::json!({ "coefficients": row });
        for (j, value) in
            list(&row, "coefficients")?.into_iter().enumerate().filter(|(_, value)| *value != 0.0)
        {
            let index =
                |i: usize| u32::try_from(i).map_err(|_| "coefficients: too many".to_owned());
            found.push((index(i)?, index(j)?, value));
        }
    }
    Ok(found)
}

fn phase(interaction: &Value, row: &mut SheetRow) -> Result<(), String> {
    match interaction["type"].as_str().unwrap_or_default() {
        "" | "RefractiveReflectiveModel" | "refractive_reflective" => return Ok(()),
        "PhaseInteractionModel" => {}
        other => {
            return Err(format!(
                "interaction_model: a {other} has no counterpart here; known: RefractiveReflectiveModel, \
                 ThinLensInteractionModel, PhaseInteractionModel"
            ));
        }
    }
    let profile = &interaction["phase_profile"];
    let error = |why: &str| format!("interaction_model.phase_profile: {why}");
    let (pattern, order) =
        match profile["phase_type"].as_str().or(profile["type"].as_str()).unwrap_or_default() {
            "linear_grating" => {
                if finite(profile, "efficiency")? != 1.0 {
                    return Err(error("only an efficiency of 1 has a counterpart here"));
                }
                let period = finite(profile, "period")?;
                if period <= 0.0 {
                    return Err(error("the period must be positive"));
                }
                // From +x there, from +y towards −x here.
                let rotation = finite(profile, "angle")?.to_degrees() - 90.0;
                let pattern = PatternSpec::Grating { period: Millimetres(period), rotation };
                (pattern, finite(profile, "order")?)
            }
            "radial" => {
                let coefficients = list(profile, "coefficients")?;
                (PatternSpec::Radial { radius: Millimetres(1.0), coefficients }, 1.0)
            }
            other => {
                return Err(error(&format!(
                    "`{other}` has no counterpart here; known: linear_grating, radial"
                )));
            }
        };
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a whole number of few digits, as is checked"
    )]
    let whole = order as i32;
    if f64::from(whole) != order {
        return Err(error(&format!("the order of diffraction is {order}; only whole ones exist")));
    }
    let mut spec = row.freeform.take().map(|spec| *spec).unwrap_or_default();
    if row.shape == SurfaceShape::ExtendedAsphere {
        let terms = row.extra.range(3..).filter(|(_, p)| p.value != 0.0);
        spec.aspheric = terms.map(|(i, p)| ((2 * (i - 2)).to_string(), p.value)).collect();
    }
    spec.phase = Some(PhaseSpec {
        pattern,
        order: Some(whole),
        blaze_wavelength: None,
        design_wavelength: None,
    });
    (row.shape, row.freeform) = (SurfaceShape::Freeform, Some(Box::new(spec)));
    Ok(())
}
