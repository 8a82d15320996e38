//! `etendue sensor`: presets, the curves of a sensor, and the image series of its characterisation.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use etendue::places;
use etendue_files::{Ledger, Opener, Reach, Transaction};
use etendue_render::output::sidecar;
use etendue_scene::file::SensorFile;
use etendue_sensor::emva::{DESCRIPTOR, EmvaError, MANIFEST, Options, Series};
use etendue_sensor::photon_transfer::{self, PhotonTransfer};
use etendue_sensor::preset::Origin;
use etendue_sensor::{Model, Preset, SensorSpec};
use serde::Serialize;

use crate::arguments::SensorArguments;
use crate::fault::{Fault, print_json, print_text};
use crate::progress::{Phases, say};
use crate::stop;

pub(crate) fn run(arguments: &SensorArguments) -> Result<(), Fault> {
    stop::listen(say);
    let Some(name) = &arguments.sensor else {
        return list(arguments.json);
    };
    let reach = if arguments.allow_outside { Reach::Anywhere } else { Reach::OwnFolder };
    let opener = Opener::new(reach);
    let file = SensorFile::named(&opener, Path::new(name), &arguments.settings)?;
    if !arguments.quiet {
        file.sensor.notes().iter().for_each(|note| say(&format!("note: {note}")));
    }
    opener.record(Path::new(name).exists().then(|| name.into()));
    let inputs = opener.found();
    let drawn = arguments.output.iter().flat_map(|folder| CURVES.map(|name| folder.join(name)));
    places::keep_apart(&inputs, &drawn.collect::<Vec<_>>())?;
    match &arguments.emva {
        Some(folder) => series(arguments, &inputs, &file, folder),
        None => curves(arguments, &inputs, &file),
    }
}

/// A preset, for machines.
#[derive(Debug, Serialize)]
struct Card {
    name: &'static str,
    kind: &'static str,
    facts: Vec<Figure>,
    /// Keys of the figures that nobody has published or measured.
    assumed: Vec<&'static str>,
    sources: &'static str,
}

#[derive(Debug, Serialize)]
struct Figure {
    key: &'static str,
    value: String,
    origin: Origin,
}

impl Card {
    fn new(preset: &'static Preset) -> Self {
        let figure = |(key, value, origin)| Figure { key, value, origin };
        let facts = preset.facts().into_iter().map(figure).collect();
        let Preset { name, kind, sources, .. } = *preset;
        Self { name, kind, facts, assumed: preset.assumed(), sources }
    }

    /// The preset as a paragraph, its sources wrapped.
    fn text(&self) -> String {
        let mut text = format!("{}: {}\n", self.name, self.kind);
        for Figure { key, value, origin } in &self.facts {
            let _ = writeln!(text, "  {key:<26} {value:<28} {}", word(*origin));
        }
        let assumed = format!("assumed, without a source: {}. Sources: ", self.assumed.join(", "));
        let mut line = String::from(" ");
        for word in assumed.split_whitespace().chain(self.sources.split_whitespace()) {
            if line.chars().count() + word.chars().count() >= 100 {
                let _ = writeln!(text, "{line}");
                line = " ".to_owned();
            }
            line.push(' ');
            line.push_str(word);
        }
        text + &line + "\n\n"
    }
}

fn word(origin: Origin) -> &'static str {
    match origin {
        Origin::Published => "published",
        Origin::Measured => "measured",
        Origin::Derived => "derived",
        Origin::Assumed => "assumed",
    }
}

/// Mark of an origin in the list.
fn mark(origin: Origin) -> &'static str {
    match origin {
        Origin::Published => "p",
        Origin::Measured => "m",
        Origin::Derived => "d",
        Origin::Assumed => "a",
    }
}

fn list(as_json: bool) -> Result<(), Fault> {
    let cards: Vec<Card> = Model::ALL.iter().map(|model| Card::new(model.preset())).collect();
    if as_json {
        return print_json(&cards);
    }
    let columns: [(&str, &str, usize); 7] = [
        ("resolution", "pixels", 15),
        ("pixel_pitch", "µm", 7),
        ("bit_depth", "bits", 6),
        ("system_gain", "DN/e⁻", 12),
        ("read_noise", "noise e⁻", 10),
        ("dark_current", "dark e⁻/s", 12),
        ("full_well", "well e⁻", 10),
    ];
    // The titles, and a line for each preset.
    let mut text = format!("{:<11}", "preset");
    for (_, title, width) in columns {
        let _ = write!(text, "{title:>width$}");
    }
    text.push_str("  kind\n");
    for card in &cards {
        let _ = write!(text, "{:<11}", card.name);
        for (key, _, width) in columns {
            let found = card.facts.iter().find(|figure| figure.key == key);
            let cell =
                found.map_or_else(String::new, |f| format!("{} {}", f.value, mark(f.origin)));
            let _ = write!(text, "{cell:>width$}");
        }
        let _ = writeln!(text, "  {}", card.kind);
    }
    text.push_str("p published, m measured, d derived, a assumed; etendue sensor NAME shows more");
    print_text(&text)
}

/// The curves of a sensor, for machines.
#[derive(Debug, Serialize)]
struct Curves<'a> {
    sensor: &'a SensorSpec,
    preset: Option<Card>,
    notes: &'a [String],
    curves: PhotonTransfer,
}

fn curves(arguments: &SensorArguments, inputs: &[PathBuf], file: &SensorFile) -> Result<(), Fault> {
    let name = arguments.sensor.as_deref().unwrap_or_default();
    let options = photon_transfer::Options {
        wavelength: arguments.wavelength,
        seed: arguments.seed,
        ..photon_transfer::Options::default()
    };
    if let Some(folder) = &arguments.output {
        places::folder(folder)?;
    }
    // Measure first; then the files, and what is printed.
    let curves =
        PhotonTransfer::measure(&file.sensor, &options).map_err(|error| file.fault(&error))?;
    let preset = file.spec.model.map(|model| Card::new(model.preset()));
    let found = Curves { sensor: &file.spec, preset, notes: file.sensor.notes(), curves };
    if let Some(folder) = &arguments.output {
        let to = Transaction::at_once().keeping(inputs);
        let [svg, data] = CURVES.map(|name| folder.join(name));
        let file_name = Path::new(name).file_name().unwrap_or_default().to_string_lossy();
        let drawn = found.curves.svg(found.preset.as_ref().map_or(&*file_name, |card| card.name));
        to.write(&svg, |part| part.write_all(drawn.as_bytes()))?;
        sidecar::write_json(&to, &data, &found)?;
        if !arguments.quiet {
            [svg, data].iter().for_each(|path| say(&path.display().to_string()));
        }
    }
    if arguments.json {
        return print_json(&found);
    }
    let heading = match &found.preset {
        Some(card) => card.text(),
        None => format!("{name}\n"),
    };
    print_text(&(heading + &found.curves.table()))
}

/// Files that the curves are written into.
const CURVES: [&str; 2] = ["curves.svg", "curves.json"];

/// The names of all files of a series.
fn names(series: &Series) -> impl Iterator<Item = &str> {
    let steps = series.manifest.steps.iter().chain([&series.manifest.spatial]);
    let images = steps.flat_map(|step| step.bright.iter().chain(&step.dark));
    images.map(String::as_str).chain([MANIFEST, DESCRIPTOR])
}

fn series(
    arguments: &SensorArguments,
    inputs: &[PathBuf],
    file: &SensorFile,
    folder: &Path,
) -> Result<(), Fault> {
    let options = Options {
        steps: arguments.steps,
        seed: arguments.seed,
        wavelength: arguments.wavelength.unwrap_or(Options::default().wavelength),
        ..Options::default()
    };
    let series = Series::plan(&file.sensor, &options).map_err(|error| file.fault(&error))?;
    // Where the images go, which must not be over an input.
    let files: Vec<PathBuf> = names(&series).map(|name| folder.join(name)).collect();
    places::keep_apart(inputs, &files)?;
    places::folder(folder)?;
    let total = series.len();
    let progress = Phases::new(arguments.quiet).begin("expose");
    let start = SystemTime::now();
    // The images, one exposure after the other; those of a series that ends early are listed, too.
    places::recorded(Ledger::open(folder, "sensor --emva"), inputs, |to| {
        let written = series
            .write(&file.sensor, &options, folder, |done| progress(done as f64 / total as f64))
            .map_err(|error| match error {
                EmvaError::Sensor(error) => Fault::from(file.fault(&error)),
                error => error.into(),
            });
        let is_new = |path: &PathBuf| {
            let changed = path.metadata().and_then(|data| data.modified());
            written.is_ok() || changed.is_ok_and(|when| when >= start)
        };
        files.into_iter().filter(is_new).for_each(|path| to.note_finished(path));
        written
    })?;
    drop(progress);
    if !arguments.quiet {
        let [width, height] = series.size;
        let longest = series.manifest.steps.last().map_or(0.0, |step| step.exposure_s);
        say(&format!(
            "{total} images of {width} x {height} pixels at {} nm, exposed for up to {longest} s",
            options.wavelength
        ));
    }
    if arguments.json {
        return print_json(&series.manifest);
    }
    let files = [MANIFEST, DESCRIPTOR].map(|name| folder.join(name).display().to_string());
    print_text(&files.join("\n"))
}
