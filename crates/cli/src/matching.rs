//! `etendue match`: what makes a simulation match a photograph.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use etendue::{
    Channel, Layer, Look, Options, Outputs, PhotoMatch, Picture, RawPhoto, Session, Values,
    match_photo, places,
};
use etendue_chart::{Axis, Chart, Series, Theme};
use etendue_files::{Reach, Transaction};
use etendue_render::output::{HeaderEntry, npy, png, sidecar};
use etendue_report::{Cell, Table};
use etendue_sensor::matching::{Estimate, Matched};
use serde::Serialize;

use crate::arguments::MatchArguments;
use crate::fault::{Fault, print_json, print_text};
use crate::progress::{Phases, say};
use crate::stop;

/// Files that are written.
const FILES: [&str; 4] = ["match.json", "residuals.npy", "residuals.png", "residuals.svg"];

/// Standard deviations that are black and white in the picture of residuals.
const SHOWN: f32 = 4.0;

/// A structure from which the scene is told not to be the photograph's: chance leaves 1.
const STRUCTURED: f64 = 1.5;

/// For machines.
#[derive(Debug, Serialize)]
struct MatchReport<'a> {
    version: u32,
    photo: String,
    scene: String,
    exposure_s: f64,
    photo_exposure_s: Option<f64>,
    #[serde(flatten)]
    matched: &'a Matched,
    settings: &'a [(String, f64)],
}

pub(crate) fn run(arguments: &MatchArguments) -> Result<(), Fault> {
    stop::listen(say);
    let photo = RawPhoto::open(&arguments.photo)?;
    let options = Options {
        settings: arguments.settings.clone(),
        reach: if arguments.allow_outside { Reach::Anywhere } else { Reach::OwnFolder },
        outputs: Outputs::NONE,
        ..Options::default()
    };
    let mut session = Session::open_with(&arguments.scene, options)?;
    let progress = Phases::new(arguments.quiet || arguments.json).progress(false);
    let found = match_photo(&mut session, &arguments.photo, &photo, &progress)?;
    drop(progress);
    let mut inputs = session.inputs();
    inputs.push(arguments.photo.clone());
    let report = MatchReport {
        version: 1,
        photo: arguments.photo.display().to_string(),
        scene: arguments.scene.display().to_string(),
        exposure_s: found.exposure,
        photo_exposure_s: found.photo_exposure,
        matched: &found.matched,
        settings: &found.settings,
    };
    if let Some(folder) = &arguments.output {
        write(folder, &inputs, &found, &report, arguments.quiet)?;
    }
    if !arguments.quiet && found.matched.structure > STRUCTURED {
        say(&format!(
            "note: residuals are {:.1} times as uneven as noise: the scene is not quite what the photograph shows, and its gain \
             and noise take the difference for noise; look at the residuals (-o)",
            found.matched.structure
        ));
    }
    if arguments.json {
        return print_json(&report);
    }
    print_text(&text(&found))
}

fn text(found: &PhotoMatch) -> String {
    let matched = &found.matched;
    let row = |name: String, unit: &'static str, Estimate { value, sigma }: Estimate| {
        vec![
            ("parameter", Cell::word(&name)),
            ("value", Cell::number(value, format!("{value:.6}"))),
            ("sigma", Cell::number(sigma, format!("{sigma:.6}"))),
            ("unit", Cell::word(unit)),
        ]
    };
    let mut rows = vec![
        row("system_gain".to_owned(), "DN/e-", matched.system_gain),
        row("read_noise".to_owned(), "e-", matched.read_noise),
        row("black_level".to_owned(), "DN", matched.black_level),
        row("exposure".to_owned(), "s", matched.exposure),
    ];
    let levels = matched.levels.iter();
    rows.extend(levels.map(|level| row(format!("light of {}", level.channel), "1", level.level)));
    let mut text = Table::of_rows(rows).to_string();
    let _ = write!(
        text,
        "\n{} of {} pixels; residuals {:.2} times as uneven as noise\n",
        matched.used, matched.of, matched.structure
    );
    for (path, value) in &found.settings {
        let _ = write!(text, "\n--set {path}={value}");
    }
    text
}

fn write(
    folder: &Path,
    inputs: &[std::path::PathBuf],
    found: &PhotoMatch,
    report: &MatchReport<'_>,
    quiet: bool,
) -> Result<(), Fault> {
    let paths = FILES.map(|name| folder.join(name));
    places::keep_apart(inputs, &paths)?;
    places::folder(folder)?;
    let to = Transaction::at_once().keeping(inputs);
    let [json, numbers, shown, drawn] = &paths;
    sidecar::write_json(&to, json, report)?;
    let residuals = &found.matched.residuals;
    let [width, height] = found.size;
    let picture = |values: Vec<f32>, look: Look| {
        let channels = vec![Channel { name: "Y".to_owned(), values: Values::F32(values) }];
        let meaning = [("definition", "residuals over their standard deviations"), ("unit", "1")];
        let meaning = meaning.map(|(key, text)| HeaderEntry::new(key, text)).into();
        let layer = Layer { name: "Residuals".to_owned(), look, channels, meaning };
        Picture::new(width, height, vec![layer], Vec::new())
            .map_err(|error| Fault::failed(error.to_string()))
    };
    npy::write(&to, numbers, &picture(residuals.clone(), Look::Cube)?, "Residuals")?;
    let grey = |r: &f32| if r.is_finite() { (0.5 + 0.5 * r / SHOWN).clamp(0.0, 1.0) } else { 0.0 };
    let grey = residuals.iter().map(grey).collect();
    png::write(&to, shown, &picture(grey, Look::Share)?, "Residuals", png::Bits::Eight)?;
    to.write(drawn, |file| file.write_all(histogram(residuals).as_bytes()))?;
    if !quiet {
        paths.iter().for_each(|path| say(&format!("wrote {}", path.display())));
    }
    Ok(())
}

/// Histogram of the residuals, beside the normal distribution.
fn histogram(residuals: &[f32]) -> String {
    const BINS: usize = 48;
    let width = 2.0 * f64::from(SHOWN) / BINS as f64;
    let mut counts = [0.0; BINS];
    let mut all = 0.0;
    for &residual in residuals.iter().filter(|r| r.is_finite()) {
        all += 1.0;
        let place = (f64::from(residual) + f64::from(SHOWN)) / width;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "checked before"
        )]
        if (0.0..BINS as f64).contains(&place) {
            counts[place as usize] += 1.0;
        }
    }
    let middle = |k: usize| (k as f64 + 0.5) * width - f64::from(SHOWN);
    let found: Vec<[f64; 2]> =
        (0..BINS).map(|k| [middle(k), counts[k] / f64::max(all, 1.0) / width]).collect();
    let normal = |x: f64| (-0.5 * x * x).exp() / std::f64::consts::TAU.sqrt();
    let normal: Vec<[f64; 2]> = (0..BINS).map(|k| [middle(k), normal(middle(k))]).collect();
    let series = vec![
        Series::curve("residuals".to_owned(), found),
        Series { colour: 1, ..Series::curve("normal distribution".to_owned(), normal) },
    ];
    let axes = [Axis::linear("standard deviations"), Axis::linear("density")];
    let title = "Photograph less simulation".to_owned();
    Chart { title, axes, series, ..Chart::default() }.svg(Theme::Reader)
}
