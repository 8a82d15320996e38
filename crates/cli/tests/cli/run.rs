//! Running the command and reading what it left.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A folder of its own for one test, with a scene in it.
pub(crate) struct Bench {
    folder: tempfile::TempDir,
}

impl Bench {
    pub(crate) fn new() -> Self {
        Self { folder: tempfile::tempdir().expect("a temporary folder") }
    }

    /// A bench whose `scene.json` is `scene`.
    pub(crate) fn with_scene(scene: &str) -> Self {
        let bench = Self::new();
        bench.write("scene.json", scene.as_bytes());
        bench
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, bytes: &[u8]) {
        std::fs::write(self.path(name), bytes).expect("a writable folder");
    }

    /// Runs `etendue` in the folder.
    pub(crate) fn run(&self, arguments: &[&str]) -> Output {
        self.run_in(arguments, &[])
    }

    /// Runs `etendue` in the folder, with more in its environment.
    pub(crate) fn run_in(&self, arguments: &[&str], environment: &[(&str, &str)]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_etendue"))
            .args(arguments)
            .current_dir(self.folder.path())
            .envs(environment.iter().copied())
            // What is measured of the machine is not left at home.
            .env("XDG_CACHE_HOME", env!("CARGO_TARGET_TMPDIR"))
            .output()
            .expect("the command runs")
    }

    /// Renders `scene.json` into `out` and panics with the command's words when that fails.
    pub(crate) fn render(&self, more: &[&str]) {
        let arguments = [&["render", "scene.json", "-o", "out", "--quiet"], more].concat();
        let output = self.run(&arguments);
        assert!(output.status.success(), "{}", text(&output.stderr));
    }

    /// The messages of a command apart from its results, with `FOLDER` for the bench's own: for a snapshot of them all.
    pub(crate) fn said(&self, output: &Output) -> String {
        let named = self.folder.path();
        let real = named.canonicalize().expect("the bench's folder");
        let said = text(&output.stderr).replace(&*real.to_string_lossy(), "FOLDER");
        said.replace(&*named.to_string_lossy(), "FOLDER")
    }

    /// The whole message of a command that refuses what it is given.
    pub(crate) fn refusal(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        let said = self.said(&output);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
        said
    }

    /// The numbers of `out/NAME.npy`, row by row, whatever their type.
    pub(crate) fn array(&self, name: &str) -> Vec<f64> {
        read_npy(&self.path("out").join(format!("{name}.npy")))
    }

    /// A JSON file of the folder.
    pub(crate) fn json(&self, name: &str) -> serde_json::Value {
        let text = std::fs::read(self.path(name)).expect("a JSON file");
        serde_json::from_slice(&text).expect("JSON")
    }
}

pub(crate) fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// A message below what provoked it, for one snapshot of many.
pub(crate) fn under(heading: &str, message: &str) -> String {
    format!("# {heading}\n{message}\n")
}

/// The notes in what a command said, without the times and the memory beside them.
pub(crate) fn notes_in(said: &str) -> String {
    let notes: Vec<&str> = said.lines().filter(|line| line.starts_with("note: ")).collect();
    notes.join("\n")
}

/// The format of numpy's NEP 1, as far as the command writes it.
pub(crate) fn read_npy(path: &Path) -> Vec<f64> {
    let bytes = std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    assert_eq!(&bytes[..6], b"\x93NUMPY");
    let start = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let header = text(&bytes[10..start]);
    let values = &bytes[start..];
    if header.contains("<f8") {
        values.as_chunks().0.iter().map(|&b| f64::from_le_bytes(b)).collect()
    } else if header.contains("<f4") {
        values.as_chunks().0.iter().map(|&b| f64::from(f32::from_le_bytes(b))).collect()
    } else if header.contains("<u2") {
        values.as_chunks().0.iter().map(|&b| f64::from(u16::from_le_bytes(b))).collect()
    } else {
        assert!(header.contains("<u4"), "{header}");
        values.as_chunks().0.iter().map(|&b| f64::from(u32::from_le_bytes(b))).collect()
    }
}

/// The folder of reference data, or `None` with a word about it.
pub(crate) fn assets(test: &str) -> Option<PathBuf> {
    let beside = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared");
    let folder = std::env::var_os("ETENDUE_ASSETS").map_or_else(|| beside.into(), PathBuf::from);
    let found = folder.join("data").is_dir();
    if !found {
        println!("{test} is skipped: ETENDUE_ASSETS names no folder with `data` in it");
    }
    found.then_some(folder)
}
