//! What a lens takes from outside its own text.

use std::path::PathBuf;

use crate::glass::AgfCatalogue;

/// The files that a lens names, and catalogues of glasses that its user adds. A function from a file's name to
/// its path stands for files alone.
pub trait LensResources {
    /// Where a file is that the lens names.
    ///
    /// # Errors
    ///
    /// A sentence on why it may not be read.
    fn path(&self, name: &str) -> Result<PathBuf, String>;

    /// Catalogues in which glasses are looked up before the built-in one, the last before the others.
    fn glasses(&self) -> &[AgfCatalogue] {
        &[]
    }
}

impl<F: Fn(&str) -> Result<PathBuf, String>> LensResources for F {
    fn path(&self, name: &str) -> Result<PathBuf, String> {
        self(name)
    }
}

/// Catalogues of glasses for lenses that name no files.
#[derive(Debug, Clone, Copy, Default)]
pub struct GlassesAlone<'a>(pub &'a [AgfCatalogue]);

impl LensResources for GlassesAlone<'_> {
    fn path(&self, name: &str) -> Result<PathBuf, String> {
        Err(format!("{name}: a lens of this kind has no files"))
    }

    fn glasses(&self) -> &[AgfCatalogue] {
        self.0
    }
}

/// How lenses that are built get at what is outside of their text.
pub type Resolve<'a> = &'a dyn LensResources;
