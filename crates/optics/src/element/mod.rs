//! The parts of a lens. Each file holds one part: how a lens file writes it, and what it does.
//!
//! To add a part: its own file, and a variant of [`Part`] and [`PartSpec`] in `part.rs`.
//!
//! What a lens takes from outside its own text.

mod abcd;
mod actions;
pub(crate) mod aperture;
mod asphere;
mod biconic;
mod coating;
mod coordinate_break;
mod crossings;
mod derivatives;
mod frame;
mod freeform;
pub(crate) mod gradient;
mod lattice;
mod lenslets;
mod losses;
mod microlens_array;
mod mirror;
mod newton;
mod part;
mod rays;
pub(crate) mod real;
mod refract;
mod refraction;
pub(crate) mod shapes;
mod spec;
mod step;
mod surface;
mod thin_lens;

use std::path::PathBuf;

use crate::glass::AgfCatalogue;

pub use abcd::Abcd;
pub use aperture::{
    ApertureSpec, CircularSpec, MaskSpec, Opening, Picture, PolygonSpec, grey_picture,
};
pub use biconic::{Biconic, BiconicSpec};
pub use coating::{MirrorCoating, MirrorCoatingSpec, Stack, StackSpec, ThinFilmSpec};
pub use coordinate_break::{CoordinateBreak, CoordinateBreakSpec};
pub use frame::Frame;
pub use freeform::{Freeform, FreeformSpec, HeightMapSpec, PatternSpec, PhaseSpec, SagSpec};
pub use gradient::{GradedGap, Gradient, GradientSpec, GradientTerms};
pub use lattice::{Grid, Lattice, LatticeCell};
pub(crate) use losses::Loss;
pub use losses::{Coating, Filter, FilterSpec, LossesSpec, Plain, Reflection};
pub use microlens_array::{
    Gaps, Lenslet, LensletShape, LensletSpec, MicrolensArray, MicrolensArraySpec, clipped,
};
pub(crate) use mirror::{Fold, Shadow};
pub use mirror::{Mirror, MirrorMount, MirrorSpec};
pub use part::{Part, PartSpec, Symbol};
pub use rays::{Block, Clip, LANES, LensRays, Ray, RayStatus, StatusCounts};
pub use real::Real;
pub use shapes::{AnnularSpec, BoxSpec, OutlineSpec, Shape, SpiderSpec};
pub use spec::{ElementSpec, Mount, element_schema};
pub(crate) use step::{Action, ElementStep};
pub use surface::{Surface, SurfaceSpec};
pub use thin_lens::{ThinLens, ThinLensSpec};

pub(crate) fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// The files that a lens names, and catalogues of glasses that its user adds. A function from a file's name to
/// its path stands for files alone.
pub trait LensResources {
    /// Path of a file that the lens names.
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

/// Access of lenses that are being built to files and other resources outside of their text.
pub type Resolve<'a> = &'a dyn LensResources;
