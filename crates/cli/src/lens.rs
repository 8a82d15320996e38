//! `etendue lens`: what a lens does, and where given rays go in it.

use std::io::Write;
use std::path::Path;

use etendue::{places, read_glasses};
use etendue_files::{Reach, Transaction};
use etendue_optics::train::{Inquiry, LensReport, OpticalTrain, ZemaxLens, drawing};
use etendue_render::output::sidecar;
use etendue_scene::escape::one_line;
use etendue_scene::file::{ReadLens, read_lens_at, trace_rays};

use crate::arguments::LensArguments;
use crate::fault::{Fault, VersionedReport, print_json, print_json_line, print_text};
use crate::opencv;
use crate::progress::say;
use crate::psf;
use crate::waves;

pub(crate) fn run(arguments: &LensArguments) -> Result<(), Fault> {
    waves::check(arguments)?;
    let reach = if arguments.allow_outside { Reach::Anywhere } else { Reach::OwnFolder };
    let glasses = read_glasses(&arguments.glass_catalogs)?;
    let mut lens = read_lens_at(&arguments.lens, reach, arguments.configuration, &glasses)?;
    let files: &[&str] = if arguments.fit_opencv { &[opencv::FILE] } else { &DRAWINGS };
    let in_waves: &[&str] = if waves::are_asked(arguments) { &waves::FILES } else { &[] };
    let of_points: &[&str] = if arguments.psf { &psf::FILES } else { &[] };
    let names = || files.iter().chain(in_waves).chain(of_points);
    let drawn = arguments.output.iter().flat_map(|dir| names().map(|name| dir.join(name)));
    let results: Vec<_> =
        drawn.chain(arguments.save.clone()).chain(arguments.report.clone()).collect();
    lens.inputs.extend(arguments.rays.iter().chain(&arguments.glass_catalogs).cloned());
    places::keep_apart(&lens.inputs, &results)?;
    let to = Transaction::at_once().keeping(&lens.inputs);
    if let Some(path) = &arguments.save {
        places::file(path)?;
    }
    if let Some(path) = &arguments.save {
        let file = lens.file.as_ref().ok_or_else(|| {
            Fault::refused("--save: the lens of a scene cannot be saved\nhint: give its own file")
        })?;
        match ZemaxLens::is_named(path) {
            true => {
                let refused =
                    |why: String| Fault::refused(format!("--save {}: {why}", path.display()));
                let text = file.to_zemax().map_err(refused)?;
                to.write(path, |part| part.write_all(text.as_bytes()))?;
            }
            false => sidecar::write_json(&to, path, file)?,
        }
    }
    lens.train = adjusted(lens.train, arguments)?;
    match &arguments.rays {
        _ if arguments.fit_opencv => opencv::fit(&lens, arguments, &to),
        Some(rays) => {
            let traced = trace_rays(&lens.train, rays)?;
            warn(&traced.out_of_range, arguments)?;
            match arguments.json {
                // On one line: there may be millions of them.
                true => print_json_line(&VersionedReport::new(&traced)),
                false => print_text(&traced.to_string()),
            }
        }
        None => report(&lens, arguments, &to),
    }
}

/// The lens at the wavelength and opening asked for.
fn adjusted(mut train: OpticalTrain, arguments: &LensArguments) -> Result<OpticalTrain, Fault> {
    let refused = |option: &str, why: String| Fault::refused(format!("{option}: {why}"));
    if let Some(&wavelength) = arguments.wavelengths.as_ref().and_then(|list| list.first()) {
        train = train
            .with_wavelength(wavelength)
            .map_err(|error| refused("--wavelengths", error.to_string()))?;
    }
    if let Some(f_number) = arguments.f_number {
        train = train
            .with_f_number(f_number)
            .map_err(|error| refused("--f-number", error.to_string()))?;
    }
    Ok(train)
}

fn report(lens: &ReadLens, arguments: &LensArguments, to: &Transaction) -> Result<(), Fault> {
    let named = |list: Vec<f64>| (!list.is_empty()).then_some(list);
    let inquiry = Inquiry {
        wavelengths: arguments.wavelengths.clone().or_else(|| named(lens.wavelengths())),
        fields: arguments.fields.clone().or_else(|| named(lens.fields())),
        stated: lens.file.as_ref().map(|file| file.fields.clone()).unwrap_or_default(),
        focus: arguments.focus.unwrap_or(lens.focus),
    };
    let mut report = LensReport::new(&lens.train, &inquiry)
        .map_err(|error| Fault::refused(format!("{}: {error}", arguments.lens.display())))?;
    report.notes.splice(..0, lens.notes.iter().cloned());
    let waves = match waves::are_asked(arguments) {
        true => Some(waves::analyse(lens, &report, arguments)?),
        false => None,
    };
    if let Some(folder) = &arguments.output {
        draw(&lens.train, &report, to, folder, arguments.quiet)?;
    }
    if arguments.psf {
        psf::write(lens, &report, arguments, to)?;
    }
    if let Some(waves) = &waves {
        waves::write(&lens.train, &report, waves, arguments, to)?;
    }
    if arguments.json {
        warn(&report.out_of_range, arguments)?;
        match &waves {
            Some(waves) => print_json(&VersionedReport::new(&waves::ReportWithWaves {
                report: &report,
                waves,
            })),
            None => print_json(&VersionedReport::new(&report)),
        }
    } else {
        if arguments.strict {
            warn(&report.out_of_range, arguments)?;
        }
        // A name cannot add lines to the table.
        report.name = one_line(&report.name).into_owned();
        for text in report.notes.iter_mut().chain(&mut report.out_of_range) {
            *text = one_line(text).into_owned();
        }
        match waves {
            Some(waves) => print_text(&format!("{report}{waves}")),
            None => print_text(&report.to_string()),
        }
    }
}

/// Files that a lens is drawn into.
const DRAWINGS: [&str; 3] = ["layout.svg", "spots.svg", "illumination.svg"];

/// Draws a lens; each file appears when it is complete.
fn draw(
    train: &OpticalTrain,
    report: &LensReport,
    to: &Transaction,
    folder: &Path,
    quiet: bool,
) -> Result<(), Fault> {
    let pictures = [
        drawing::layout(train, report),
        drawing::spots(train, report),
        drawing::relative_illumination(train, report),
    ];
    places::folder(folder)?;
    for (name, picture) in DRAWINGS.into_iter().zip(pictures) {
        let picture = picture.map_err(|error| Fault::Refused(error.into()))?;
        let path = folder.join(name);
        to.write(&path, |file| file.write_all(picture.as_bytes()))?;
        // Standard output has the numbers.
        if !quiet {
            say(&format!("wrote {}", path.display()));
        }
    }
    Ok(())
}

/// Says on standard error that wavelengths are out of range, or refuses them.
fn warn(out_of_range: &[String], arguments: &LensArguments) -> Result<(), Fault> {
    if arguments.strict
        && let Some(note) = out_of_range.first()
    {
        return Err(Fault::refused(format!("{}: {note}", arguments.lens.display())));
    }
    for note in out_of_range.iter().filter(|_| !arguments.quiet) {
        say(&format!("warning: {}", one_line(note)));
    }
    Ok(())
}
