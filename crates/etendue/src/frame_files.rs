//! Places of the files of frames, and which frames are complete.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Component, Path, PathBuf};

use etendue_files::{MANIFEST, Transaction, WriteError, remove_empty_folders};
use etendue_render::output::{HeaderEntry, Outputs, sidecar};

use crate::records::{
    RECORD, Record, frame_numbers, is_rendered, numbered, read_record, record_of, remove_recorded,
};
use crate::{Error, Progress, Rendering, WrittenFiles, places};

/// Names of the files of frames: `{frame}` stands for the frame's number in six digits, `{layer}` for the
/// layer's name, and the ending follows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FramePattern {
    text: String,
    /// The part before `{layer}`, when each frame has a folder to itself.
    folder: Option<String>,
}

impl Default for FramePattern {
    /// A folder a frame.
    fn default() -> Self {
        Self {
            text: "frames/{frame}/{layer}".to_owned(),
            folder: Some("frames/{frame}".to_owned()),
        }
    }
}

impl FramePattern {
    /// From the words of a user.
    ///
    /// # Errors
    ///
    /// When frames or layers would have the same name, or files would lie elsewhere than in the folder.
    pub fn parse(text: &str) -> Result<Self, String> {
        if !text.contains("{frame}") || !text.contains("{layer}") {
            return Err("wants {frame} and {layer} in it, as {layer}/{frame}".to_owned());
        }
        let rest = text.replace("{frame}", "").replace("{layer}", "");
        if rest.contains(['{', '}']) {
            return Err("has braces around other words than {frame} and {layer}".to_owned());
        }
        let is_plain = |part| matches!(part, Component::Normal(_));
        if !Path::new(text).components().all(is_plain) || text.ends_with('/') {
            return Err(
                "wants names below the folder, without . or .. or a / at its ends".to_owned()
            );
        }
        let folder = text.strip_suffix("/{layer}").filter(|folder| !folder.contains("{layer}"));
        Ok(Self { text: text.to_owned(), folder: folder.map(str::to_owned) })
    }

    /// Path of `file`, which is a layer's name with its ending, of frame `number`, as seen from the
    /// folder of all frames.
    #[must_use]
    pub fn place(&self, number: usize, file: &str) -> String {
        let (layer, ending) = file.split_once('.').unwrap_or((file, ""));
        let dot = if ending.is_empty() { "" } else { "." };
        numbered(&self.text, number).replace("{layer}", layer) + dot + ending
    }

    /// The folder in which frame `number` is written: its own, or one from which its files are taken to
    /// their places.
    #[must_use]
    pub fn folder(&self, number: usize) -> String {
        numbered(self.folder.as_deref().unwrap_or("frames/{frame}.unfinished"), number)
    }

    /// The folder that frame `number` has to itself, if each frame has one.
    #[must_use]
    pub fn own_folder(&self, number: usize) -> Option<String> {
        self.folder.as_ref().map(|folder| numbered(folder, number))
    }

    /// True if something of frame `number` may be in `out`.
    #[must_use]
    pub fn is_begun(&self, out: &Path, number: usize) -> bool {
        match &self.folder {
            Some(_) => out.join(self.folder(number)).join("layers.json").exists(),
            None => record_of(out, number).exists(),
        }
    }

    /// True if `out` holds a frame whose headers have these fingerprints, as it was written, with
    /// `files` among its own.
    #[must_use]
    pub fn is_complete(
        &self,
        out: &Path,
        number: usize,
        fingerprints: &[HeaderEntry],
        files: &[String],
    ) -> bool {
        match &self.folder {
            Some(_) => is_rendered(&out.join(self.folder(number)), fingerprints, files),
            None => read_record(&record_of(out, number)).is_some_and(|record| {
                let has_size = |(name, size): &(String, u64)| {
                    out.join(name).metadata().is_ok_and(|data| data.len() == *size)
                };
                let is_listed = |file: &String| {
                    let place = self.place(number, file);
                    record.files.iter().any(|(name, _)| *name == place)
                };
                record.fingerprints == fingerprints
                    && files.iter().all(is_listed)
                    && record.files.iter().all(has_size)
            }),
        }
    }

    /// The place, as seen from the folder of all frames, that lists the files of frame `number`: its own folder
    /// with a manifest, or a record.
    #[must_use]
    pub fn list_of(&self, number: usize) -> String {
        self.own_folder(number).unwrap_or_else(|| numbered(RECORD, number))
    }

    /// Refuses a frame of which a file, of those that are called `names` in a folder of their own, would take
    /// the place of an input; gives their places.
    ///
    /// # Errors
    ///
    /// When there is one; the message names it.
    pub fn keep_apart(
        &self,
        out: &Path,
        number: usize,
        inputs: &[PathBuf],
        names: &[String],
    ) -> Result<Vec<PathBuf>, Error> {
        let places = names.iter().map(|name| out.join(self.place(number, name)));
        let record = self.folder.is_none().then(|| record_of(out, number));
        let places: Vec<PathBuf> = places.chain(record).collect();
        places::keep_apart(inputs, &places)?;
        Ok(places)
    }

    /// Writes a frame. Its files lie in their places when all of them are complete, and what an earlier run
    /// left of it goes.
    ///
    /// # Errors
    ///
    /// As [`Rendering::write`].
    pub fn write(
        &self,
        rendering: &Rendering,
        out: &Path,
        number: usize,
        outputs: Outputs,
        progress: &Progress,
    ) -> Result<WrittenFiles, Error> {
        let folder = out.join(self.folder(number));
        places::folder(&folder)?;
        let mut written = rendering.write_frame(&folder, outputs, progress)?;
        if self.folder.is_none() {
            let record = record_of(out, number);
            let before = read_record(&record).unwrap_or_default();
            // Until the new record is there, the frame is not complete.
            let _ = fs::remove_file(&record);
            let inputs = &rendering.scene.inputs;
            let files = self.take_to_places(out, number, &written.files, inputs)?;
            for (old, _) in before.files.iter().filter(|old| files.iter().all(|new| new.0 != old.0))
            {
                let _ = fs::remove_file(out.join(old));
            }
            let _ = fs::remove_file(folder.join(MANIFEST)).and_then(|()| fs::remove_dir(&folder));
            written.files = files.iter().map(|(name, _)| out.join(name)).collect();
            let fingerprints = rendering.fingerprints().to_vec();
            let to = Transaction::at_once().keeping(&rendering.scene.inputs);
            sidecar::write_json(&to, &record, &Record { fingerprints, files })?;
        }
        Ok(written)
    }

    /// Removes from `out` what an earlier run wrote of frames from `count` on, which the scene no longer has, as
    /// far as it is as it was written; gives their numbers. Known are those of the data set's index and those
    /// that follow the scene's last without a gap.
    pub fn remove_from(&self, out: &Path, count: usize) -> BTreeSet<usize> {
        let following = (count..).take_while(|&number| self.is_begun(out, number));
        let listed = frame_numbers(out).into_iter().filter(|number| *number >= count);
        let gone: BTreeSet<usize> =
            following.chain(listed).filter(|&number| self.is_begun(out, number)).collect();
        gone.iter().for_each(|&number| self.remove(out, number));
        gone
    }

    fn remove(&self, out: &Path, number: usize) {
        if self.folder.is_some() {
            return places::clear(&out.join(self.folder(number)));
        }
        remove_recorded(out, &record_of(out, number));
    }

    fn take_to_places(
        &self,
        out: &Path,
        number: usize,
        files: &[PathBuf],
        inputs: &[PathBuf],
    ) -> Result<Vec<(String, u64)>, WriteError> {
        let folder = out.join(self.folder(number));
        let to = Transaction::new().keeping(inputs);
        let mut moved = Vec::new();
        for path in files {
            let name = path.strip_prefix(&folder).ok().and_then(Path::to_str);
            let Some(name) = name else { continue };
            let place = self.place(number, name);
            let size = to.move_whole(path, &out.join(&place))?;
            remove_empty_folders(&folder, path);
            moved.push((place, size));
        }
        Ok(moved)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_name_every_file_of_every_frame_apart() {
        let own = FramePattern::default();
        assert_eq!(own.place(7, "flow.kitti.png"), "frames/000007/flow.kitti.png");
        assert_eq!(FramePattern::parse("frames/{frame}/{layer}"), Ok(own));
        let layers = FramePattern::parse("{layer}/view_{frame}").unwrap();
        assert_eq!(layers.place(12, "id_object.indexed.png"), "id_object/view_000012.indexed.png");
        assert_eq!(layers.folder(12), "frames/000012.unfinished");
        for bad in [
            "{frame}",
            "{layer}",
            "/{frame}{layer}",
            "../{frame}{layer}",
            "{frame}{layer}/",
            "{frame}{x}{layer}",
        ] {
            assert!(FramePattern::parse(bad).is_err(), "{bad}");
        }
    }
}
