//! `etendue render --shard` and `etendue merge`: renders that are divided, and their pictures.

use std::path::{Path, PathBuf};

use clap::Parser;
use etendue::{Progress, Session, Shard, Shares, places};
use serde_json::{Value, json};

use crate::arguments::{Cli, Command, MergeArguments, RenderArguments};
use crate::fault::{Fault, print_text};
use crate::job;
use crate::progress::Phases;

/// Renders a share of the picture into its file in the folder.
pub(crate) fn render_shard(
    arguments: &RenderArguments,
    session: &mut Session,
    shard: Shard,
    progress: &Progress,
) -> Result<(), Fault> {
    if arguments.report.is_some() {
        return Err(Fault::refused(
            "--report is of a whole picture\nhint: give it to `etendue merge`",
        ));
    }
    let folder = &arguments.output;
    let what = if shard.is_of_samples() { "samples" } else { "shard" };
    let stem = format!("{what}-{}", shard.to_string().replace('/', "-of-"));
    let path = folder.join(format!("{stem}.film"));
    let name = format!("{stem}.checkpoint.film");
    let checkpoint = job::keep(arguments, session, folder, &name);
    session.scene(progress)?;
    places::keep_apart(&session.inputs(), std::slice::from_ref(&path))?;
    session.render_shard(shard, &path, &origin()?, progress)?;
    print_text(&path.display().to_string())?;
    checkpoint.map_or(Ok(()), job::remove)
}

/// Call of this command, for `etendue merge`.
fn origin() -> Result<Value, Fault> {
    let folder = std::env::current_dir()
        .map_err(|error| Fault::failed(format!("the current folder cannot be told: {error}")))?;
    let arguments = std::env::args_os().map(|word| word.to_string_lossy().into_owned());
    Ok(json!({ "folder": folder, "arguments": arguments.collect::<Vec<_>>() }))
}

pub(crate) fn run(arguments: &MergeArguments) -> Result<(), Fault> {
    let shares = Shares::read(&arguments.shares)?;
    let asked = as_asked(arguments, &shares)?;
    job::carry_out(&asked, |outputs| {
        places::folder(&asked.output)?;
        let mut session = job::open(&asked, outputs)?;
        let progress = Phases::new(asked.quiet).progress(!asked.quiet);
        let results = session.check_place(&asked.output, &[], &progress)?;
        places::keep_apart(&arguments.shares, &results)?;
        job::check_report_path(&asked, &session, &results)?;
        let rendering = session.merge(&shares, &progress)?;
        job::write(&asked, &rendering, outputs, progress)
    })
}

/// The arguments that the shares were rendered with, as far as they tell of the picture.
fn as_asked(arguments: &MergeArguments, shares: &Shares) -> Result<RenderArguments, Fault> {
    let first = arguments.shares.first().map(|path| path.display().to_string()).unwrap_or_default();
    let unknown = || {
        Fault::refused(format!(
            "{first}: does not say how it was rendered: it is a checkpoint, and no share"
        ))
    };
    // The command line that rendered the shares, and where that was.
    let origin = shares.origin().ok_or_else(unknown)?;
    let folder = origin.get("folder").and_then(Value::as_str).map(Path::new).ok_or_else(unknown)?;
    let words = origin.get("arguments").and_then(Value::as_array).ok_or_else(unknown)?;
    let words = words.iter().filter_map(Value::as_str);
    let Ok(Cli { command: Some(Command::Render(mut asked)), .. }) = Cli::try_parse_from(words)
    else {
        return Err(unknown());
    };
    // Its files are relative to that place; where results go is this command's own.
    let own = |path: &PathBuf| folder.join(path);
    asked.scene.glass_catalogs = asked.scene.glass_catalogs.iter().map(own).collect();
    asked.scene.scene = arguments.scene.clone().unwrap_or_else(|| own(&asked.scene.scene));
    asked.output.clone_from(&arguments.output);
    asked.report.clone_from(&arguments.report);
    asked.quiet = arguments.quiet;
    (asked.shard, asked.checkpoint) = (None, None);
    if !asked.scene.scene.exists() {
        let scene = asked.scene.scene.display();
        let why = match arguments.scene {
            Some(_) => "--scene names no file",
            None => {
                "the shares are of this scene, which is not here\nhint: say by --scene where it is"
            }
        };
        return Err(Fault::refused(format!("{scene}: {why}")));
    }
    Ok(asked)
}
