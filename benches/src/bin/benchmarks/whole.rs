//! From file to pixels: the `etendue` command as a user runs it, against the least that Embree can
//! take for the same; and what a render holds in memory, stage by stage.

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, ensure};
use etendue_accel::limit::{BareScene, Mode, RayHit16};
use etendue_accel::{BuildOptions, Quality};
use etendue_bench::timing::ProcessMemory;
use etendue_bench::timing::{Turn, take_turns, wall};
use etendue_benches::contest::{LimitPackets, Query, time};
use etendue_benches::effort::Effort;
use etendue_benches::meshes;
use etendue_benches::rays::View;
use etendue_render::output::Outputs;
use etendue_render::{Images, Plan, plan};
use etendue_scene::{LoadOptions, SceneFile};
use serde_json::{Value, json};

use crate::findings::{Contest, Findings, Part, Record};

/// The command of this program that prints the memory of a render.
pub(crate) const MEMORY: &str = "memory";

/// The contestants, as the page shows them.
pub(crate) const ETENDUE: &str = "`etendue render`, whole process";
pub(crate) const LEAST: &str = "read + default build + limit's traversal";
pub(crate) const SAMPLED: &str = "`etendue render --samples 16`, whole process";

pub(crate) const QUESTION: &str = "GLB to EXR";

/// The most that Embree holds by its own count while it builds in low quality (bytes).
pub(crate) const EMBREE_PEAK: &str = "embree peak";

/// The stages of a report, in order.
pub(crate) const STAGES: [&str; 5] = ["load", "build", "render", "write", "total"];

/// The stages of [`print_memory`], in order.
pub(crate) const HELD: [&str; 4] = ["start", "load", "build", "render"];

pub(crate) fn measure(effort: Effort, findings: &mut Findings) -> anyhow::Result<()> {
    let program = std::env::current_exe()?.with_file_name("etendue");
    ensure!(program.exists(), "{} is missing; build it first", program.display());
    for triangles in effort.blobs() {
        let mesh = crate::blob_name(triangles);
        eprintln!("{mesh}, from file to pixels");
        let folder = tempfile::tempdir().context("a temporary folder")?;
        crate::write_models(folder.path(), triangles, &[])?;
        let job = Job { program: program.clone(), folder: folder.path().to_owned() };
        findings.contests.push(contest(effort, &mesh, triangles, &job)?);
        let (file, report) = job.report()?;
        for (name, value) in report {
            findings.numbers.insert(format!("{mesh}: {name}"), value);
        }
        findings.numbers.insert(format!("{mesh}: file"), file);
        for (name, value) in job.memory()? {
            findings.numbers.insert(format!("{mesh}: {name}"), value);
        }
        let mode = Mode { quality: Quality::Low, compact: false };
        let bare = BareScene::build(meshes::blob(triangles)?, mode, 0)?;
        findings.numbers.insert(format!("{mesh}: {EMBREE_PEAK}"), bare.peak_bytes() as f64);
    }
    Ok(())
}

struct Job {
    program: PathBuf,
    folder: PathBuf,
}

impl Job {
    fn scene(&self) -> PathBuf {
        self.folder.join("glb.json")
    }

    fn render(&self, more: &[&str]) -> anyhow::Result<()> {
        let mut command = Command::new(&self.program);
        command.arg("render").arg(self.scene()).args(["--outputs", "exr", "--quiet", "-o"]);
        command.arg(self.folder.join("out")).args(more).stdout(Stdio::null());
        let status = command.status().context("starting etendue")?;
        ensure!(status.success(), "etendue failed: {status}");
        Ok(())
    }

    /// The model's bytes, and the numbers of a report.
    fn report(&self) -> anyhow::Result<(f64, Vec<(String, f64)>)> {
        let path = self.folder.join("report.json");
        self.render(&["--report", &path.display().to_string()])?;
        let report: Value = serde_json::from_slice(&std::fs::read(path)?)?;
        let mut numbers = Vec::new();
        for stage in STAGES {
            let seconds = report["seconds"][stage].as_f64().unwrap_or(f64::NAN);
            numbers.push((format!("{stage} s"), seconds));
        }
        for name in ["bvh_bytes", "peak_memory_bytes", "mrays_per_second"] {
            numbers.push((name.to_owned(), report[name].as_f64().unwrap_or(f64::NAN)));
        }
        let file = std::fs::metadata(self.folder.join("blob.glb"))?.len();
        Ok((file as f64, numbers))
    }

    /// Memory that a process of its own holds after each stage.
    fn memory(&self) -> anyhow::Result<Vec<(String, f64)>> {
        let output =
            Command::new(std::env::current_exe()?).arg(MEMORY).arg(self.scene()).output()?;
        ensure!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let stages: Value = serde_json::from_slice(&output.stdout)?;
        let mut numbers = Vec::new();
        for stage in HELD {
            for kind in ["private", "mapped"] {
                let bytes = stages[stage][kind].as_f64().unwrap_or(f64::NAN);
                numbers.push((format!("{stage} {kind}"), bytes));
            }
        }
        Ok(numbers)
    }
}

fn contest(effort: Effort, mesh: &str, triangles: u64, job: &Job) -> anyhow::Result<Contest> {
    let geometry = meshes::blob(triangles)?;
    let packets = RayHit16::of(&View::framing(geometry.bounds()).primary());
    let model = job.folder.join("blob.glb");
    let fault: RefCell<Option<anyhow::Error>> = RefCell::new(None);
    let run = |more: &[&str]| {
        let (seconds, result) = wall(|| job.render(more));
        if let Err(error) = result {
            fault.borrow_mut().get_or_insert(error);
        }
        seconds
    };
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let least = || {
        let (seconds, _) = wall(|| -> anyhow::Result<()> {
            std::fs::read(&model)?;
            let scene = BareScene::build(geometry.clone(), Mode::default(), 0)?;
            let limit = LimitPackets { scene: &scene, packets: &packets, query: Query::Closest };
            std::hint::black_box(time(&limit, cores, 1));
            Ok(())
        });
        seconds
    };
    let mut turns: Vec<Turn<'_>> = vec![
        Box::new(|| run(&[])),
        Box::new(least),
        Box::new(|| run(&["--layers", "facing", "--samples", "16"])),
    ];
    let series = take_turns(effort.rounds(), &mut turns);
    drop(turns);
    if let Some(error) = fault.into_inner() {
        return Err(error);
    }
    let names = [ETENDUE, LEAST, SAMPLED].map(str::to_owned);
    let records =
        names.into_iter().zip(series).map(|(who, series)| Record { who, series, bytes: None });
    Ok(Contest {
        part: Part::Whole,
        mesh: mesh.to_owned(),
        question: QUESTION.to_owned(),
        items: triangles as f64,
        records: records.collect(),
    })
}

/// Renders the scene at `path` in this process, and prints what it holds after each stage.
pub(crate) fn print_memory(path: &Path) -> anyhow::Result<()> {
    let start = ProcessMemory::now();
    let file = SceneFile::read(path, &[])?;
    let scene = file.load(plan::wanted(&file.spec.all_layers()), &LoadOptions::default())?;
    let plan = Plan::new(&scene, Outputs { exr: true, ..Outputs::NONE });
    let load = ProcessMemory::now();
    let accel = etendue_render::build(&scene, &plan, &BuildOptions::default())?;
    let build = ProcessMemory::now();
    let images = Images::decode(&scene, &plan, None)?;
    let rendered =
        etendue_render::render(&scene, &plan, &*accel, &images, Vec::new(), &|_: f64| true)?;
    let render = ProcessMemory::now();
    drop(rendered);
    let show = |memory: ProcessMemory| json!({"private": memory.private, "mapped": memory.mapped});
    println!(
        "{}",
        json!({"start": show(start), "load": show(load), "build": show(build),
               "render": show(render)})
    );
    Ok(())
}
