//! `etendue lens --psf`: point spread functions by depth, field and wavelength, as files.

use std::path::Path;

use etendue_files::Transaction;
use etendue_geometry::glam::DVec3;
use etendue_optics::analysis::between::airy_unit;
use etendue_optics::analysis::wavefront::Cells;
use etendue_optics::analysis::{
    AnalysisError, CellGrid, CellSpread, ObjectPoint, PointSpread, PupilField, ReferenceSphere,
    Wavefront,
};
use etendue_optics::train::{Focus, LensReport};
use etendue_render::output::{
    Channel, HeaderEntry, Layer, Look, Picture, Values, exr, npy, sidecar,
};
use etendue_scene::file::ReadLens;
use serde::Serialize;

use crate::arguments::LensArguments;
use crate::fault::Fault;
use crate::progress::say;
use crate::waves;

/// Files that are written.
pub(crate) const FILES: [&str; 3] = ["psf.npy", "psf.exr", "psf.json"];

/// Cells across the finest detail, where nothing is said.
const FINE: f64 = 4.0;

/// The most cells from the middle to a side that light is looked for on.
const MOST_HALF: usize = 2047;

/// The most bytes of all of them.
const MOST_BYTES: usize = 1 << 30;

/// The most waves that Huygens' sums add up: some minutes.
const MOST_TERMS: f64 = 2e10;

/// Description of the arrays.
#[derive(Debug, Serialize)]
struct Meaning {
    version: u32,
    /// `[depth][field][wavelength][row][column]`
    axes: [&'static str; 5],
    shape: [usize; 5],
    definition: &'static str,
    /// µm
    pitch: f64,
    /// mm; `null` for infinity
    depths: Vec<Option<f64>>,
    /// degrees
    fields: Vec<f64>,
    /// nm
    wavelengths: Vec<f64>,
    sensor_z: f64,
    /// Of each function in the order of the array: where its chief ray meets the sensor (mm), which the
    /// middle cell's middle is.
    middles: Vec<[f64; 2]>,
    /// The share of the light that lies on the cells.
    held: Vec<f64>,
}

/// One point's light.
struct PointField {
    pupil: PupilField,
    sphere: ReferenceSphere,
}

/// Writes the point spread functions into the folder.
pub(crate) fn write(
    lens: &ReadLens,
    report: &LensReport,
    arguments: &LensArguments,
    to: &Transaction,
) -> Result<(), Fault> {
    let Some(folder) = &arguments.output else { return Ok(()) };
    let refused =
        |why: String| Fault::refused(format!("{}: --psf: {why}", arguments.lens.display()));
    let (wavelengths, _) = waves::wavelengths(lens, report, arguments);
    let Some(sensor_z) = report.sensor_z else {
        return Err(refused("the lens has no place for a sensor\nhint: give --focus".to_owned()));
    };
    let depths = depths(report, arguments).map_err(refused)?;
    let fields = report.fields.clone();
    let asked = match arguments.psf_size {
        Some(size) if size % 2 == 1 => Some(size as usize / 2),
        Some(size) => {
            return Err(refused(format!(
                "--psf-size {size} has no middle\nhint: give an odd number"
            )));
        }
        None => None,
    };
    let count = depths.len() * fields.len() * wavelengths.len();
    // A side, where there is room for all of them.
    let check = |half: usize| {
        let side = 2 * half + 1;
        let bytes = count.saturating_mul(side * side * size_of::<f32>());
        match bytes > MOST_BYTES {
            true => Err(refused(format!(
                "{count} functions of {side} x {side} cells take {} MiB, and 1024 are the most\nhint: give \
                 a smaller --psf-size, a larger --psf-pitch, or fewer fields",
                bytes >> 20
            ))),
            false => Ok(side),
        }
    };
    asked.map(check).transpose()?;
    let points =
        points(lens, report, sensor_z, [&fields, &wavelengths], &depths).map_err(refused)?;
    let finest = points.iter().map(|point| airy_unit(&point.pupil)).fold(f64::INFINITY, f64::min);
    let pitch = arguments.psf_pitch.map_or(finest / FINE, |pitch| 1e-3 * pitch);
    // The sensor is looked at as a picture of it would be, x to the right and y upwards.
    let grid = CellGrid { pitch, turn: 1.0, most: MOST_HALF };
    let spreads: Vec<CellSpread> = points
        .iter()
        .map(|point| CellSpread::of(std::slice::from_ref(&point.pupil), &grid))
        .collect();
    let half = asked.or_else(|| spreads.iter().map(|spread| spread.half).max()).unwrap_or(0);
    let side = check(half)?;
    let cropped: Vec<Vec<f32>> = match arguments.huygens {
        false => spreads.iter().map(|spread| cropped(spread, half)).collect(),
        true => by_huygens(&points, side, pitch, finest).map_err(refused)?,
    };
    let held = cropped.iter().map(|plane| plane.iter().map(|&v| f64::from(v)).sum()).collect();
    let meaning = Meaning {
        version: 1,
        axes: ["depth", "field", "wavelength", "row", "column"],
        shape: [depths.len(), fields.len(), wavelengths.len(), side, side],
        definition: match arguments.huygens {
            false => {
                "share of a point's light on each cell, by diffraction; rows go down, against y"
            }
            true => {
                "share of a point's light on each cell, by Huygens' sum; rows go down, against y"
            }
        },
        pitch: 1e3 * pitch,
        depths,
        fields,
        wavelengths,
        sensor_z,
        middles: points
            .iter()
            .map(|point| [point.sphere.centre[0], point.sphere.centre[1]])
            .collect(),
        held,
    };
    files(to, folder, &meaning, cropped)?;
    if !arguments.quiet {
        FILES.iter().for_each(|name| say(&format!("wrote {}", folder.join(name).display())));
    }
    Ok(())
}

/// Distances from the entrance pupil (mm); none for infinity.
fn depths(report: &LensReport, arguments: &LensArguments) -> Result<Vec<Option<f64>>, String> {
    let Some(asked) = &arguments.depths else {
        let focused = match arguments.focus {
            Some(Focus::Distance(metres)) if metres.is_finite() => Some(1e3 * metres),
            _ => None,
        };
        return Ok(vec![focused]);
    };
    if report.paraxial.entrance_pupil.z.is_none() {
        return Err("--depths: the entrance pupil is at infinity, and depths are counted from it"
            .to_owned());
    }
    let depth = |focus: &Focus| match *focus {
        Focus::Infinity => Ok(None),
        Focus::Distance(metres) if metres > 0.0 => Ok(metres.is_finite().then_some(1e3 * metres)),
        _ => Err("--depths: expected distances above 0, such as \"infinity,2 m\"".to_owned()),
    };
    asked.iter().map(depth).collect()
}

/// All points, in the order of the array; why one has no light, or too rough a wavefront.
fn points(
    lens: &ReadLens,
    report: &LensReport,
    sensor_z: f64,
    [fields, wavelengths]: [&[f64]; 2],
    depths: &[Option<f64>],
) -> Result<Vec<PointField>, String> {
    let mut points = Vec::new();
    for &depth in depths {
        for &field in fields {
            for &nm in wavelengths {
                let point = point(lens, report, sensor_z, depth, field, nm).map_err(|error| {
                    let at = depth.map_or("infinity".to_owned(), |mm| format!("{mm} mm"));
                    format!("field {field}, {nm} nm, {at}: {error}")
                })?;
                points.push(point);
            }
        }
    }
    Ok(points)
}

fn point(
    lens: &ReadLens,
    report: &LensReport,
    sensor_z: f64,
    depth: Option<f64>,
    field: f64,
    nm: f64,
) -> Result<PointField, AnalysisError> {
    let at = lens.train.at(nm)?;
    let pupil = report.paraxial.entrance_pupil.z.unwrap_or(0.0);
    let object = match depth {
        None => ObjectPoint::field(field),
        // Its light goes towards (0, tan, 1) through the pupil's middle.
        Some(depth) => {
            let place = DVec3::new(0.0, -depth * field.to_radians().tan(), pupil - depth);
            ObjectPoint::Near { place }
        }
    };
    let front = Wavefront::new(&lens.train, &at, object, sensor_z, Cells::Needed)?;
    Ok(PointField { pupil: front.pupil, sphere: front.sphere })
}

/// Huygens' sums in the middles of cells, times their area.
#[expect(clippy::cast_possible_truncation, reason = "shares below 1")]
fn by_huygens(
    points: &[PointField],
    side: usize,
    pitch: f64,
    finest: f64,
) -> Result<Vec<Vec<f32>>, String> {
    if pitch > finest / 3.0 * (1.0 + 1e-9) {
        return Err(format!(
            "--huygens takes the light in the middle of each cell, and cells of {} um are wider than a \
             third of the finest detail\nhint: give --psf-pitch \"{:.3} um\" or less",
            1e3 * pitch,
            1e3 * finest / 3.0
        ));
    }
    let terms: f64 =
        points.iter().map(|p| p.pupil.lit().count() as f64).sum::<f64>() * (side * side) as f64;
    if terms > MOST_TERMS {
        return Err(format!(
            "--huygens would add up {terms:.1e} waves, and {MOST_TERMS:.0e} are the most\nhint: give a smaller \
             --psf-size, or fewer fields"
        ));
    }
    let plane = |point: &PointField| {
        let spread = PointSpread::by_huygens(&point.pupil, &point.sphere, side, pitch);
        let rows = spread.values.chunks(side).rev();
        rows.flatten().map(|value| (value * pitch * pitch) as f32).collect()
    };
    Ok(points.iter().map(plane).collect())
}

/// The cells up to `half` from the middle.
#[expect(clippy::cast_possible_truncation, reason = "shares below 1")]
fn cropped(spread: &CellSpread, half: usize) -> Vec<f32> {
    let (side, own) = (2 * half + 1, 2 * spread.half + 1);
    let mut plane = vec![0.0; side * side];
    for row in 0..side {
        for column in 0..side {
            let from = |k: usize| (k + spread.half).checked_sub(half).filter(|&k| k < own);
            if let (Some(r), Some(c)) = (from(row), from(column)) {
                plane[row * side + column] = spread.shares[r * own + c] as f32;
            }
        }
    }
    plane
}

fn files(
    to: &Transaction,
    folder: &Path,
    meaning: &Meaning,
    planes: Vec<Vec<f32>>,
) -> Result<(), Fault> {
    let shape: Vec<u64> = meaning.shape.iter().map(|&side| side as u64).collect();
    let all: Vec<f32> = planes.iter().flatten().copied().collect();
    npy::write_array(to, &folder.join(FILES[0]), &shape, &all)?;
    let [_, fields, wavelengths, side, _] = meaning.shape;
    // A layer for each depth and field, a channel for each wavelength.
    let mut layers: Vec<Layer> = Vec::new();
    for (k, plane) in planes.into_iter().enumerate() {
        let (depth, field, nm) = (
            k / (fields * wavelengths),
            k / wavelengths % fields,
            meaning.wavelengths[k % wavelengths],
        );
        let name = format!("PSF.d{depth}f{field}");
        let channel = format!("{nm}nm").replace('.', "_");
        let channel = Channel { name: channel, values: Values::F32(plane) };
        match layers.last_mut().filter(|layer| layer.name == name) {
            Some(layer) => layer.channels.push(channel),
            None => {
                let about = [
                    ("definition", meaning.definition.to_owned()),
                    (
                        "depth",
                        meaning.depths[depth].map_or("infinity".into(), |mm| format!("{mm} mm")),
                    ),
                    ("field", format!("{} degrees", meaning.fields[field])),
                    ("pitch", format!("{} um", meaning.pitch)),
                ];
                let about = about.map(|(key, text)| HeaderEntry::new(key, text)).into();
                layers.push(Layer {
                    name,
                    look: Look::Cube,
                    channels: vec![channel],
                    meaning: about,
                });
            }
        }
    }
    let picture = Picture::new(side, side, layers, Vec::new())
        .map_err(|error| Fault::failed(error.to_string()))?;
    exr::write(to, &folder.join(FILES[1]), &picture, &exr::Options::default())?;
    sidecar::write_json(to, &folder.join(FILES[2]), meaning)?;
    Ok(())
}
