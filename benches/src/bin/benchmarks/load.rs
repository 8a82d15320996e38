//! Loading: wall time from file to mesh, on all cores, the file in the system's cache.

use std::path::{Path, PathBuf};

use anyhow::Context;
use etendue_bench::timing::{Turn, take_turns, wall};
use etendue_benches::effort::Effort;
use etendue_benches::files::Format;
use etendue_benches::meshes;
use etendue_scene::import::{Options, Wanted, import};

use crate::findings::{Contest, Findings, Part, Record};

/// Name of the other program that is timed.
pub(crate) const TOBJ: &str = "OBJ by the crate tobj";
pub(crate) const READ: &str = "reading the GLB's bytes";

pub(crate) const QUESTION: &str = "load";

pub(crate) fn title(format: Format) -> String {
    format.extension().to_uppercase()
}

pub(crate) fn measure(effort: Effort, findings: &mut Findings) -> anyhow::Result<()> {
    for triangles in effort.blobs() {
        let mesh = crate::blob_name(triangles);
        eprintln!("loading {mesh}");
        let folder = tempfile::tempdir().context("a temporary folder")?;
        let geometry = meshes::blob(triangles)?;
        let mut files: Vec<(Format, PathBuf)> = Vec::new();
        for format in Format::ALL {
            let path = folder.path().join("blob").with_extension(format.extension());
            format.write(&path, &geometry).with_context(|| format!("{}", path.display()))?;
            match import(&path, Wanted::NOTHING, &Options::default()) {
                Ok(_) => files.push((format, path)),
                Err(error) => eprintln!("  {} is left out: {error}", title(format)),
            }
        }
        drop(geometry);
        findings.contests.push(contest(effort, mesh, triangles, &files));
    }
    Ok(())
}

fn contest(effort: Effort, mesh: String, triangles: u64, files: &[(Format, PathBuf)]) -> Contest {
    let mut titles = Vec::new();
    let mut turns: Vec<Turn<'_>> = Vec::new();
    let mut sizes = Vec::new();
    let size = |path: &Path| std::fs::metadata(path).ok().map(|file| file.len());
    for (format, path) in files {
        titles.push(title(*format));
        sizes.push(size(path));
        turns.push(Box::new(move || {
            wall(|| import(path, Wanted::NOTHING, &Options::default()).is_ok()).0
        }));
        if *format == Format::Obj {
            titles.push(TOBJ.to_owned());
            sizes.push(size(path));
            turns.push(Box::new(move || {
                wall(|| tobj::load_obj(path, &tobj::LoadOptions::default()).is_ok()).0
            }));
        }
        if *format == Format::Glb {
            titles.push(READ.to_owned());
            sizes.push(size(path));
            turns.push(Box::new(move || wall(|| std::fs::read(path).is_ok()).0));
        }
    }
    let series = take_turns(effort.rounds(), &mut turns);
    let records = titles.into_iter().zip(series).zip(sizes).map(|((who, series), bytes)| Record {
        who,
        series,
        bytes,
    });
    Contest {
        part: Part::Load,
        mesh,
        question: QUESTION.to_owned(),
        items: triangles as f64,
        records: records.collect(),
    }
}
