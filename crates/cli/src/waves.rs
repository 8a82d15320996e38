//! `etendue lens --waves` and `--report`: a lens in waves.

use std::io::Write;

use etendue::places;
use etendue_files::Transaction;
use etendue_optics::analysis::AnalysisError;
use etendue_optics::analysis::conjugate::{Conjugate, with_numerical_aperture};
use etendue_optics::analysis::report::{PremiseSources, WaveInquiry, WaveReport, figures, page};
use etendue_optics::analysis::wavefront::Cells;
use etendue_optics::train::{Focus, FocusError, LensReport, OpticalTrain, drawing};
use etendue_scene::escape::one_line;
use etendue_scene::file::ReadLens;
use serde::Serialize;

use crate::arguments::LensArguments;
use crate::fault::Fault;
use crate::progress::say;

/// Files that a lens in waves may be written into.
pub(crate) const FILES: [&str; 14] = [
    "mtf.svg",
    "through-focus.svg",
    "encircled.svg",
    "line-spread.svg",
    "ray-fans.svg",
    "opd-fans.svg",
    "field-curvature.svg",
    "distortion.svg",
    "waves.csv",
    "mtf.csv",
    "mtf-geometric.csv",
    "zernike.csv",
    "field-curvature.csv",
    "seidel.csv",
];

/// Shares of the image circle's radius at which a near object is looked at.
const SHARES: [f64; 4] = [0.0, 0.35, 0.6, 0.8];

/// The focal length of the ideal lens behind an afocal one (mm): a millimetre is a thousandth of a radian.
const EYEPIECE: f64 = 1000.0;

/// A report with what the lens does in waves.
#[derive(Debug, Serialize)]
pub(crate) struct ReportWithWaves<'a> {
    #[serde(flatten)]
    pub(crate) report: &'a LensReport,
    pub(crate) waves: &'a WaveReport,
}

/// True if waves are asked for, by themselves or by what only they obey.
pub(crate) fn are_asked(arguments: &LensArguments) -> bool {
    arguments.waves || arguments.report.is_some() || premise(arguments).is_some()
}

/// The first option that only waves obey.
fn premise(arguments: &LensArguments) -> Option<&'static str> {
    let all = [
        ("--weights", arguments.weights.is_some()),
        ("--frequencies", arguments.frequencies.is_some()),
        ("--cells", arguments.cells.is_some()),
        ("--best-focus", arguments.best_focus),
        ("--afocal", arguments.afocal),
        ("--object-distance", arguments.object_distance.is_some()),
        ("--magnification", arguments.magnification.is_some()),
        ("--numerical-aperture", arguments.numerical_aperture.is_some()),
    ];
    all.into_iter().find(|(_, is_given)| *is_given).map(|(name, _)| name)
}

/// Refuses what only waves obey where something else is asked for.
pub(crate) fn check(arguments: &LensArguments) -> Result<(), Fault> {
    match premise(arguments) {
        Some(name) if arguments.rays.is_some() || arguments.fit_opencv => Err(Fault::refused(
            format!("{name} is for the analysis in waves\nhint: leave out --rays and --fit-opencv"),
        )),
        _ => Ok(()),
    }
}

/// The lens in waves, on the premises of options, its file, or its report.
pub(crate) fn analyse(
    lens: &ReadLens,
    report: &LensReport,
    arguments: &LensArguments,
) -> Result<WaveReport, Fault> {
    let refused = |error: &dyn std::fmt::Display| {
        Fault::refused(format!("{}: {error}", arguments.lens.display()))
    };
    let conjugate = conjugate(arguments);
    let focus = match (conjugate, arguments.focus) {
        (_, Some(focus)) => focus,
        (Conjugate::Infinity, None) => lens.focus,
        (_, None) => Focus::AsWritten,
    };
    let mut train = lens.train.clone();
    if arguments.afocal {
        if let Some(efl) = report.paraxial.efl {
            let why =
                format!("--afocal: the lens has a focal length of {efl} mm\nhint: leave it out");
            return Err(refused(&why));
        }
        train = train.with_eyepiece(EYEPIECE);
    }
    let planes = conjugate.planes(&train, focus).map_err(|error| match error {
        AnalysisError::Focus(FocusError::Afocal) => refused(
            &"the lens is afocal: it images infinity to infinity, and has no focus\nhint: give --afocal to \
              analyse it by angles",
        ),
        error => refused(&error),
    })?;
    if let Some(aperture) = arguments.numerical_aperture {
        train =
            with_numerical_aperture(train, &planes, aperture).map_err(|error| refused(&error))?;
    }
    let (wavelengths, of_wavelengths) = wavelengths(lens, report, arguments);
    let (fields, of_fields) = match (&arguments.fields, planes.magnification) {
        (Some(fields), _) => (fields.clone(), "option"),
        (None, None) if !lens.fields().is_empty() => (lens.fields(), "file"),
        (None, None) => (report.fields.clone(), "default"),
        (None, Some(magnification)) => {
            let radius = report.image_circle.map_or(0.0, |diameter| 0.5 * diameter);
            let height = |share: f64| {
                let height = share * radius / magnification.abs();
                format!("{height:.2e}").parse().unwrap_or(height)
            };
            let shares = if radius > 0.0 { &SHARES[..] } else { &SHARES[..1] };
            (shares.iter().map(|&share| height(share)).collect(), "default")
        }
    };
    let is_near = planes.object_z.is_some();
    // Weights of a file are those of its own wavelengths.
    let (weights, of_weights) = match &arguments.weights {
        Some(weights) => (weights.clone(), "option"),
        None if of_wavelengths == "file" && !lens.weights().is_empty() => {
            (lens.weights().to_vec(), "file")
        }
        None => (Vec::new(), "default"),
    };
    let inquiry = WaveInquiry {
        wavelengths,
        weights,
        fields,
        fields_are_asked: of_fields == "option",
        conjugate,
        focus,
        best_focus: arguments.best_focus,
        is_afocal: arguments.afocal,
        cells: arguments.cells.map_or(Cells::Needed, Cells::Given),
        frequencies: frequencies(arguments)?,
        taken: PremiseSources {
            fields: of_fields,
            wavelengths: of_wavelengths,
            weights: of_weights,
            object: if is_near { "option" } else { "default" },
        },
    };
    let mut waves = WaveReport::new(&train, &inquiry).map_err(|error| refused(&error))?;
    for note in &mut waves.notes {
        *note = one_line(note).into_owned();
    }
    Ok(waves)
}

fn conjugate(arguments: &LensArguments) -> Conjugate {
    match (arguments.object_distance, arguments.magnification) {
        (_, Some(magnification)) => Conjugate::Magnification(magnification),
        (Some(Focus::Distance(metres)), None) => Conjugate::Distance(1e3 * metres),
        _ => Conjugate::Infinity,
    }
}

fn frequencies(arguments: &LensArguments) -> Result<Vec<f64>, Fault> {
    let frequencies = arguments.frequencies.clone().unwrap_or_default();
    match frequencies.iter().find(|f| !(**f >= 0.0 && f.is_finite())) {
        Some(wrong) => Err(Fault::refused(format!(
            "--frequencies: {wrong} cycles/mm is no frequency\nhint: give numbers from 0 on"
        ))),
        None => Ok(frequencies),
    }
}

/// Wavelengths, the main one first, and where they come from.
pub(crate) fn wavelengths(
    lens: &ReadLens,
    report: &LensReport,
    arguments: &LensArguments,
) -> (Vec<f64>, &'static str) {
    let (mut list, from) = match &arguments.wavelengths {
        Some(list) => (list.clone(), "option"),
        None if !lens.wavelengths().is_empty() => (lens.wavelengths(), "file"),
        None => (report.colour.iter().map(|row| row.wavelength).collect(), "default"),
    };
    if from == "default" {
        list.retain(|nm| *nm != report.wavelength);
        list.insert(0, report.wavelength);
    }
    (list, from)
}

/// Writes figures and tables into the folder, and the page.
pub(crate) fn write(
    train: &OpticalTrain,
    report: &LensReport,
    waves: &WaveReport,
    arguments: &LensArguments,
    to: &Transaction,
) -> Result<(), Fault> {
    let mut files = Vec::new();
    if let Some(folder) = &arguments.output {
        let all = figures::figures(waves).into_iter().chain(waves.csv());
        files.extend(all.map(|(name, text)| (folder.join(name), text)));
    }
    if let Some(path) = &arguments.report {
        places::file(path)?;
        let drawn = [drawing::layout(train, report), drawing::spots(train, report)];
        let drawings = drawn.into_iter().collect::<Result<Vec<_>, _>>();
        let drawings = drawings.map_err(|error| Fault::Refused(error.into()))?;
        let name = if report.name.is_empty() { "Lens" } else { &report.name };
        let name = one_line(name);
        files.push((path.clone(), page(&name, &report.to_string(), &drawings, waves)));
    }
    for (path, text) in files {
        to.write(&path, |file| file.write_all(text.as_bytes()))?;
        if !arguments.quiet {
            say(&format!("wrote {}", path.display()));
        }
    }
    Ok(())
}
