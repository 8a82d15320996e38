//! `etendue calibrate`: the pictures by which a camera is calibrated.

use etendue::{CalibrationOptions, Options, Session, calibrate};
use etendue_files::Reach;
use etendue_sensor::{Packing, Window};

use crate::arguments::{CalibrateArguments, PackedArgument};
use crate::expose::sensor_outputs;
use crate::fault::{Fault, print_text};
use crate::progress::{Phases, say};
use crate::stop;

pub(crate) fn run(arguments: &CalibrateArguments) -> Result<(), Fault> {
    stop::listen(say);
    let outputs = sensor_outputs(&arguments.outputs)?;
    let options = CalibrationOptions {
        frames: arguments.frames,
        level: arguments.level,
        boards: arguments.boards,
        squares: arguments.squares,
        square: arguments.square,
        distance: arguments.distance,
        window: Window { region: arguments.region, binning: arguments.binning },
        packed: arguments.packed.map(|packed| match packed {
            PackedArgument::Raw10 => Packing::Raw10,
            PackedArgument::Raw12 => Packing::Raw12,
        }),
        f_number: arguments.f_number,
        outputs,
    };
    let of_scene = Options {
        settings: arguments.settings.clone(),
        reach: if arguments.allow_outside { Reach::Anywhere } else { Reach::OwnFolder },
        ..Options::default()
    };
    let mut session = Session::open_with(&arguments.scene, of_scene)?;
    let folder_is_new = !arguments.output.exists();
    if folder_is_new {
        stop::made(&arguments.output);
    }
    let progress = Phases::new(arguments.quiet).progress(!arguments.quiet);
    let written = calibrate(&mut session, &options, &arguments.output, &progress);
    drop(progress);
    if written.is_err() && folder_is_new {
        // Goes only when nothing was written into it.
        let _ = std::fs::remove_dir(&arguments.output);
    }
    let written = written?;
    if !arguments.quiet {
        let count = written.files.len();
        say(&format!("{count} files: {:.2} s", written.time.as_secs_f64()));
    }
    let lines: Vec<String> = written.files.iter().map(|path| path.display().to_string()).collect();
    print_text(&lines.join("\n"))
}
