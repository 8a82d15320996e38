//! Ctrl-C and the signals like it: what is left, and what is said.

use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use crate::run::{Bench, text};

/// A picture that nobody could wait for.
const ENDLESS: &str = r#"{"etendue": 1, "tracer": {"type": "path"}, "layers": ["depth"],
    "camera": {"type": "pinhole", "sensor": {"resolution": [48, 32]}},
    "objects": [{"shape": "sphere"}, {"shape": "rectangle", "width": 9, "height": 9,
        "transform": {"translate": [0, 0, -2]}}],
    "render": {"samples": 1048576}}"#;

/// A shape that takes its time.
const LARGE: &str = r#"{"etendue": 1, "layers": ["depth"],
    "camera": {"type": "pinhole", "sensor": {"resolution": [8, 8]}},
    "objects": [{"shape": "blob", "triangles": 60000000}]}"#;

/// A running command, killed when the test is done with it.
struct Running(Child);

impl Running {
    /// Heeding signals that tests are started to ignore: Ctrl-C in the background, SIGHUP under `nohup`.
    fn start(bench: &Bench, arguments: &[&str]) -> Self {
        let command = ["--default-signal=INT,TERM,HUP", env!("CARGO_BIN_EXE_etendue")];
        Self::spawn(Command::new("env").args(command).args(arguments), bench)
    }

    fn spawn(command: &mut Command, bench: &Bench) -> Self {
        let command = command.current_dir(bench.path("")).stdout(Stdio::piped());
        Self(command.stderr(Stdio::piped()).spawn().expect("the command runs"))
    }

    fn signal(&self, name: &str) {
        let id = self.0.id().to_string();
        // The shell's own: a bare system has no other.
        let sent = Command::new("sh").args(["-c", r#"kill -s "$0" "$1""#, name, &id]).status();
        let sent = sent.expect("a shell");
        assert!(sent.success());
    }

    /// Waits for a file. The limit is there for a test that would hang.
    fn wait_for(&mut self, file: &Path) {
        self.wait_until(&file.display().to_string(), || file.exists());
    }

    /// Waits for something else.
    fn wait_until(&mut self, what: &str, is_so: impl Fn() -> bool) {
        let start = Instant::now();
        while !is_so() {
            assert!(self.0.try_wait().expect("a child").is_none(), "ended before {what}");
            assert!(start.elapsed() < Duration::from_secs(300), "no {what}");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// End of the process: exit status, standard output and standard error.
    fn end(mut self) -> (ExitStatus, String, String) {
        let start = Instant::now();
        while self.0.try_wait().expect("a child").is_none() {
            assert!(start.elapsed() < Duration::from_secs(300), "does not stop");
            std::thread::sleep(Duration::from_millis(5));
        }
        let read = |pipe: Option<&mut dyn std::io::Read>| {
            let mut bytes = Vec::new();
            pipe.expect("a pipe").read_to_end(&mut bytes).expect("output");
            text(&bytes)
        };
        let (mut out, mut err) = (self.0.stdout.take(), self.0.stderr.take());
        let status = self.0.wait().expect("a child");
        (status, read(out.as_mut().map(|p| p as _)), read(err.as_mut().map(|p| p as _)))
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

const RENDER: [&str; 5] = ["render", "scene.json", "-o", "out", "--quiet"];

#[test]
fn a_stopped_picture_is_kept_and_says_what_it_is() {
    for signal in ["INT", "TERM", "HUP"] {
        let bench = Bench::with_scene(ENDLESS);
        let arguments = [&RENDER[..], &["--report", "report.json"]].concat();
        let mut running = Running::start(&bench, &arguments);
        running.wait_for(&bench.path("out/picture.so-far.png"));
        running.signal(signal);
        let (status, out, err) = running.end();
        assert_eq!(status.code(), Some(1), "{signal}: {err}");
        let report = bench.json("report.json");
        let samples = report["samples"].as_u64().expect("a number");
        assert!(samples >= 4 && report["samples_wanted"] == 1_048_576, "{report}");
        let words = format!("stopped after {samples} of 1048576 samples a pixel");
        assert!(err.contains(&words) && err.contains("the picture so far is in out"), "{err}");
        assert!(report["notes"].to_string().contains(&words), "{report}");
        let header = &bench.json("out/layers.json")["header"];
        assert_eq!(header["partial"], words);
        assert_eq!(header["samples"], samples.to_string());
        assert!(out.contains("out/layers.exr"), "{out}");
        let file = std::fs::read(bench.path("out/layers.exr")).expect("an EXR");
        let exr = exr::meta::MetaData::read_from_buffered(&file[..], false).expect("an EXR");
        assert!(format!("{exr:?}").contains(&words), "the header of the EXR says so, too");
        assert!(!bench.path("out/picture.so-far.png").exists());
        // It is the picture of so many samples.
        let partial = bench.array("picture");
        bench.render(&["--samples", &samples.to_string()]);
        assert_eq!(partial, bench.array("picture"), "{signal}");
    }
}

#[test]
fn a_stopped_picture_does_not_replace_a_complete_one() {
    let bench = Bench::with_scene(ENDLESS);
    bench.render(&["--samples", "4"]);
    let complete = std::fs::read(bench.path("out/layers.exr")).expect("an EXR");
    let mut running = Running::start(&bench, &RENDER);
    running.wait_for(&bench.path("out/picture.so-far.png"));
    running.signal("INT");
    let (status, _, err) = running.end();
    // What was shown on the way is no file of it.
    assert!(
        bench
            .json("out/partial/etendue-manifest.json")
            .pointer("/files/render/picture.png")
            .is_some()
    );
    let listed = bench.json("out/partial/etendue-manifest.json").to_string();
    assert!(!listed.contains("so-far"), "{listed}");
    assert!(
        status.code() == Some(1) && err.contains("the picture so far is in out/partial"),
        "{err}"
    );
    assert_eq!(complete, std::fs::read(bench.path("out/layers.exr")).expect("an EXR"));
    assert!(bench.json("out/partial/layers.json")["header"]["partial"].is_string());
    // The next complete one ends its stay.
    bench.render(&["--samples", "4"]);
    assert!(!bench.path("out/partial").exists());
}

#[test]
fn a_stopped_picture_does_not_replace_one_that_was_stopped_later() {
    let bench = Bench::with_scene(ENDLESS);
    let so_far = bench.path("out/picture.so-far.png");
    let shown = || so_far.metadata().and_then(|about| about.modified()).ok();
    let mut running = Running::start(&bench, &RENDER);
    running.wait_for(&so_far);
    // It is shown again when a hundred times as long has gone by as showing it takes.
    let first = shown();
    running
        .wait_until("the picture is shown again", || shown().is_some_and(|at| Some(at) != first));
    running.signal("INT");
    let samples = |said: &str| -> u64 {
        let rest = said.split("stopped after ").nth(1).expect("how many samples there are");
        rest.split(' ').next().and_then(|number| number.parse().ok()).expect("a number")
    };
    let (_, _, err) = running.end();
    let many = samples(&err);
    let before = std::fs::read(bench.path("out/layers.exr")).expect("an EXR");

    let mut running = Running::start(&bench, &RENDER);
    running.wait_for(&so_far);
    running.signal("INT");
    let (status, out, err) = running.end();
    assert_eq!(status.code(), Some(1), "{err}");
    let few = samples(&err);
    let is_same = std::fs::read(bench.path("out/layers.exr")).expect("an EXR") == before;
    assert_eq!(is_same, few <= many, "{many} samples, and then {few}");
    if few < many {
        let stays = format!("the picture of {many} samples in out stays");
        assert!(err.contains(&stays) && out.is_empty(), "{err}");
    }
    // Of another scene it is another picture.
    let mut running = Running::start(&bench, &[&RENDER[..], &["--seed", "9"]].concat());
    running.wait_for(&so_far);
    running.signal("INT");
    let (_, out, err) = running.end();
    assert!(out.contains("out/layers.exr") && !err.contains("stays"), "{err}");
}

#[test]
fn what_a_stopped_render_goes_on_from_is_left_alone_by_others() {
    let bench = Bench::with_scene(ENDLESS);
    let arguments = [&RENDER[..], &["--checkpoint", "0.001"]].concat();
    let mut running = Running::start(&bench, &arguments);
    running.wait_for(&bench.path("out/checkpoint.film"));
    running.signal("INT");
    let (status, _, err) = running.end();
    assert_eq!(status.code(), Some(1), "{err}");
    bench.render(&["--samples", "4"]);
    assert!(bench.path("out/checkpoint.film").exists());
}

/// Views by an ideal lens are rendered while files are written.
const VIEWS: &str = r#"{"etendue": 1, "tracer": {"type": "facing"}, "render": {"samples": 256},
    "objects": [{"shape": "sphere", "radius": 0.03}],
    "camera": {"type": "light_field", "focal_length": 20, "f_number": 4, "focus_distance": 0.5,
        "microlenses": {"pitch": 0.1}, "pose": {"from": [0, 0, 0.5], "look_at": [0, 0, 0]},
        "sensor": {"resolution": [240, 180], "pixel_pitch": 8}}}"#;

#[test]
fn a_set_that_is_stopped_while_it_is_written_leaves_the_one_before_whole() {
    let bench = Bench::with_scene(VIEWS);
    bench.render(&["--samples", "1"]);
    let names = ["picture.npy", "white.npy", "views.npy", "reference.npy", "layers.json"];
    let contents = || names.map(|name| std::fs::read(bench.path("out").join(name)).expect(name));
    let before = contents();
    let mut running = Running::start(&bench, &[&RENDER[..], &["--seed", "5"]].concat());
    let is_begun = || {
        let files = std::fs::read_dir(bench.path("out")).expect("a folder");
        let names = files.map(|entry| entry.expect("an entry").file_name());
        names.into_iter().any(|name| name.to_string_lossy().starts_with(".picture.npy."))
    };
    running.wait_until("the picture's part file", is_begun);
    running.signal("INT");
    let (status, out, err) = running.end();
    assert_eq!((status.code(), out.as_str()), (Some(1), ""), "{err}");
    assert!(contents() == before, "of one render");
    let left = std::fs::read_dir(bench.path("out")).expect("a folder").map(|e| e.expect("one"));
    let left = left.filter(|entry| entry.file_name().to_string_lossy().ends_with(".part")).count();
    assert_eq!(left, 0);
}

#[test]
fn nothing_is_left_where_nothing_is_to_be_kept() {
    let bench = Bench::with_scene(ENDLESS);
    let arguments = [&RENDER[..], &["--discard-partial"]].concat();
    let mut running = Running::start(&bench, &arguments);
    running.wait_for(&bench.path("out/picture.so-far.png"));
    running.signal("INT");
    let (status, out, err) = running.end();
    assert_eq!((status.code(), out.as_str()), (Some(1), ""), "{err}");
    insta::assert_snapshot!(err, @"error: stopped; no unfinished file was left");
    assert!(!bench.path("out").exists(), "a new folder goes when nothing was written into it");
}

#[test]
fn loading_and_building_stop_too() {
    let bench = Bench::with_scene(LARGE);
    let mut running = Running::start(&bench, &RENDER);
    running.wait_for(&bench.path("out"));
    running.signal("INT");
    let (status, out, err) = running.end();
    assert_eq!((status.code(), out.as_str()), (Some(1), ""), "{err}");
    assert_eq!(err, "error: stopped; no unfinished file was left\n");
    assert!(!bench.path("out").exists());
}

#[test]
fn the_second_signal_ends_at_once_and_one_that_nohup_ignores_does_nothing() {
    let bench = Bench::with_scene(ENDLESS);
    let script = format!(
        "trap '' HUP; exec env --default-signal=INT '{}' render scene.json -o out --quiet",
        env!("CARGO_BIN_EXE_etendue")
    );
    let mut running = Running::spawn(Command::new("sh").args(["-c", &script]), &bench);
    running.wait_for(&bench.path("out/picture.so-far.png"));
    running.signal("HUP");
    running.signal("INT");
    let (status, _, err) = running.end();
    assert_eq!(status.code(), Some(1), "{err}");
    // Had the first been heard, the second would have ended it.
    assert!(err.contains("the picture so far is in out"), "{err}");
}

/// Exit code 1: it is not the input that has to be mended.
#[test]
fn a_folder_that_vanishes_is_no_fault_of_the_input() {
    let bench = Bench::with_scene(ENDLESS);
    let mut running = Running::start(&bench, &RENDER);
    running.wait_for(&bench.path("out/picture.so-far.png"));
    // A look may be written into it just then.
    while std::fs::remove_dir_all(bench.path("out")).is_err() {}
    running.signal("INT");
    let (status, _, err) = running.end();
    assert_eq!(status.code(), Some(1), "{err}");
    assert!(err.contains("error: cannot write out/"), "{err}");
}
