//! `etendue expose`: what a sensor makes of pictures from elsewhere.

use std::path::{Path, PathBuf};
use std::time::Duration;

use etendue::{ExposeOptions, ExposedFrame, LightImage, Outputs, places, write_frames};
use etendue_files::{Opener, Reach};
use etendue_scene::file::SensorFile;

use crate::arguments::ExposeArguments;
use crate::fault::{Fault, print_text};
use crate::progress::{Phases, say};
use crate::stop;

/// A picture to expose, with the number of its frame where there are several.
struct FrameImage {
    number: Option<u32>,
    path: PathBuf,
}

pub(crate) fn run(arguments: &ExposeArguments) -> Result<(), Fault> {
    stop::listen(say);
    let outputs = sensor_outputs(&arguments.outputs)?;
    let reach = if arguments.allow_outside { Reach::Anywhere } else { Reach::OwnFolder };
    let opener = Opener::new(reach);
    let sensor = SensorFile::named(&opener, Path::new(&arguments.sensor), &arguments.settings)?;
    opener.record(Path::new(&arguments.sensor).exists().then(|| (&arguments.sensor).into()));
    let images: Vec<FrameImage> = match arguments.image.is_dir() {
        false => vec![FrameImage { number: None, path: arguments.image.clone() }],
        true => {
            let found = LightImage::in_folder(&arguments.image)?;
            let many = found.len() > 1;
            let image = |(number, path)| FrameImage { number: many.then_some(number), path };
            found.into_iter().map(image).collect()
        }
    };
    keep_apart(&opener, &images, &sensor, &arguments.output)?;
    let folder_is_new = !arguments.output.exists();
    if folder_is_new {
        stop::made(&arguments.output);
    }
    let mut metered = None;
    let open = |frame: &FrameImage| -> Result<_, etendue::Error> {
        let number = frame.number;
        let image = LightImage::open(
            &frame.path,
            arguments.wavelengths.as_deref(),
            arguments.memory_limit,
        )?;
        let options = ExposeOptions {
            unit: arguments.unit,
            f_number: arguments.f_number,
            magnification: arguments.magnification,
            seed: arguments.seed,
            frame: number.unwrap_or(0),
            memory: arguments.memory_limit,
        };
        let image = image.on(&sensor, &options)?.in_sequence(&mut metered);
        Ok(ExposedFrame { number, image })
    };
    let progress = Phases::new(arguments.quiet).progress(!arguments.quiet);
    let (mut done, of) = (0, images.len());
    let mut report = |frame: Option<u32>, time: Duration| {
        done += 1;
        if let Some(number) = frame.filter(|_| !arguments.quiet) {
            say(&format!("frame {number} ({done} of {of}): {:.2} s", time.as_secs_f64()));
        }
    };
    let all = images.iter().map(open);
    let written = write_frames(all, &arguments.output, outputs, &progress, &mut report);
    drop(progress);
    if written.is_err() && folder_is_new {
        // Goes only when nothing was written into it.
        let _ = std::fs::remove_dir(&arguments.output);
    }
    let written = written?;
    if !arguments.quiet {
        let count = images.len();
        let what = if count == 1 { "1 picture".to_owned() } else { format!("{count} pictures") };
        say(&format!("{what} exposed: {:.2} s", written.time.as_secs_f64()));
    }
    let lines: Vec<String> = written.files.iter().map(|path| path.display().to_string()).collect();
    print_text(&lines.join("\n"))
}

/// Kinds of file of a sensor's images, by a list of names.
pub(crate) fn sensor_outputs(names: &str) -> Result<Outputs, Fault> {
    let outputs = Outputs::from_list(names)
        .map_err(|message| Fault::refused(format!("--outputs: {message}")))?;
    let of_layers = Outputs { png: false, npy: false, dng: false, ..outputs };
    if of_layers != Outputs::NONE || outputs == Outputs::NONE {
        return Err(Fault::refused("--outputs: a sensor's images are written as png, npy or dng"));
    }
    Ok(outputs)
}

/// Refuses a folder in which a result would take the place of a picture or of the sensor's file.
fn keep_apart(
    opener: &Opener,
    images: &[FrameImage],
    sensor: &SensorFile,
    output: &Path,
) -> Result<(), Fault> {
    let mut inputs = opener.found();
    inputs.extend(images.iter().map(|image| image.path.clone()));
    let names = etendue_render::expose::files_of(&sensor.sensor);
    let pattern = etendue::FramePattern::default();
    let folders = images.iter().map(|image| match image.number {
        None => output.to_owned(),
        Some(number) => output.join(pattern.folder(number as usize)),
    });
    let results: Vec<PathBuf> =
        folders.flat_map(|folder| names.iter().map(move |name| folder.join(name))).collect();
    Ok(places::keep_apart(&inputs, &results)?)
}
