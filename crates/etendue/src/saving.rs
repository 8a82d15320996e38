//! A changed scene as a file, or as values that another process takes.

use std::io::Write;
use std::path::{Path, PathBuf};

use etendue_files::Transaction;
use etendue_geometry::Mesh;
use etendue_scene::file::FileKind;
use serde_json::Value;

use crate::{Error, Progress, Session, places};

impl Session {
    /// The path of the scene, or where it would stand, the values of the whole scene, whichever frame is
    /// shown, and the [`inputs`](Self::inputs) so far: some, as the camera's file, are named by no value.
    #[must_use]
    pub fn origin(&self) -> (&Path, &Value, Vec<PathBuf>) {
        let file = self.whole();
        (file.path(), file.value(), self.inputs())
    }

    /// Names and meshes that [`insert_mesh`](Self::insert_mesh) brought.
    pub fn meshes(&self) -> impl Iterator<Item = (&str, &Mesh)> {
        self.cache().meshes()
    }

    /// Writes the scene as it is now to `path` as JSON; it may take the place of the file that it was
    /// opened from. Rendered from there, it is the same picture to the bit.
    ///
    /// # Errors
    ///
    /// When the file cannot be written or is another file of the scene, and when the scene names files,
    /// which are found from its own folder, and `path` is in another one.
    pub fn save(&mut self, path: impl AsRef<Path>) -> Result<(), Error> {
        let path = path.as_ref();
        let (own, folder) = (self.file().path().to_owned(), self.file().folder().to_owned());
        let is_model = self.file().kind() == FileKind::Model;
        let inputs = self.scene(&Progress::none())?.inputs.clone();
        let is_scene = |input: &Path| !is_model && input == own;
        let named = inputs.iter().find(|input| !is_scene(input));
        if let Some(named) = named
            && !is_same_folder(path.parent(), &folder)
        {
            return Err(Error::Refused(format!(
                "{}: the scene names files, such as {}, and finds them from its own folder\nhint: save it in {}",
                path.display(),
                named.display(),
                folder.display()
            )));
        }
        let text = format!("{:#}", self.values());
        if path == own && !is_model {
            return Ok(Transaction::at_once().write(path, |part| writeln!(part, "{text}"))?);
        }
        places::keep_apart(&inputs, &[path.to_owned()])?;
        let files = Transaction::at_once().keeping(&inputs);
        Ok(files.write(path, |part| writeln!(part, "{text}"))?)
    }
}

fn is_same_folder(folder: Option<&Path>, own: &Path) -> bool {
    let here = Path::new(".");
    let folder = folder.filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(here);
    match (folder.canonicalize(), own.canonicalize()) {
        (Ok(folder), Ok(own)) => folder == own,
        _ => false,
    }
}
