//! A glass: its refractive index at a wavelength, and what it absorbs there.

use etendue_report::Refusal;

use super::dispersion::{Dispersion, FRAUNHOFER_C, FRAUNHOFER_D, FRAUNHOFER_F};

/// Error of a glass whose index cannot be found.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GlassError {
    /// A name that no catalogue has.
    #[error("unknown glass \"{name}\"; {}", offer(nearest))]
    Unknown {
        /// The name.
        name: String,
        /// The most similar names of the catalogue, best first.
        nearest: Vec<String>,
    },
    /// Inline numbers that describe no glass.
    #[error("{law} glass: {why}")]
    Inline {
        /// Name of the dispersion law.
        law: &'static str,
        /// Description of the error.
        why: &'static str,
    },
    /// The formula gives no index at this wavelength.
    #[error(
        "glass {name} has no refractive index at {wavelength} nm: its formula gives no positive \
         finite number there"
    )]
    NoIndex {
        /// The glass.
        name: String,
        /// The wavelength (nm).
        wavelength: f64,
    },
    /// A line of the built-in table that cannot be read.
    #[error("the glass catalogue cannot be read at the entry {name}")]
    Table {
        /// The entry's first column.
        name: String,
    },
}

impl From<GlassError> for Refusal {
    fn from(error: GlassError) -> Self {
        Self::of(&error)
    }
}

/// A medium whose index can be asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct Glass {
    /// For messages: the catalogue's name, or the inline numbers.
    pub name: String,
    /// The wavelengths for which the formula is stated (nm); 0 to infinity when it has no limits.
    pub range: [f64; 2],
    /// Source of the numbers, empty for inline ones.
    pub source: String,
    /// Maker of the glass; `None` for substances and inline numbers.
    pub maker: Option<String>,
    /// Other makers whose glass of the same name is not meant.
    pub namesakes: Vec<String>,
    pub(super) dispersion: Dispersion,
    /// `[nm, k]`: extinction coefficients in ascending order of wavelength.
    pub(super) extinction: Vec<[f64; 2]>,
}

impl Glass {
    /// Air, which surrounds lenses: index 1 at every wavelength.
    #[must_use]
    pub fn air() -> Self {
        Self::inline("air", Dispersion::Constant(1.0))
    }

    pub(super) fn inline(name: impl Into<String>, dispersion: Dispersion) -> Self {
        Self {
            name: name.into(),
            range: [0.0, f64::INFINITY],
            source: String::new(),
            maker: None,
            namesakes: Vec::new(),
            dispersion,
            extinction: Vec::new(),
        }
    }

    /// The refractive index at `wavelength` (nm), by the formula also where [`Self::covers`] says
    /// that it is not stated.
    ///
    /// # Errors
    ///
    /// When the formula gives no positive finite number.
    pub fn index(&self, wavelength: f64) -> Result<f64, GlassError> {
        self.dispersion
            .index(wavelength)
            .ok_or_else(|| GlassError::NoIndex { name: self.name.clone(), wavelength })
    }

    /// True if the formula is stated for `wavelength` (nm).
    #[must_use]
    pub fn covers(&self, wavelength: f64) -> bool {
        wavelength >= self.range[0] && wavelength <= self.range[1]
    }

    /// The wavelengths for which a glass of one maker or another is stated (nm).
    pub const RANGE_OF_ALL: [f64; 2] = [240.0, 14_000.0];

    /// True if the range in which the formula is valid is [known](Self::range). Numbers of a lens
    /// file come without one; air needs none.
    #[must_use]
    pub fn states_range(&self) -> bool {
        self.range != [0.0, f64::INFINITY] || self.dispersion == Dispersion::Constant(1.0)
    }

    /// True if the index depends on the wavelength.
    #[must_use]
    pub fn is_dispersive(&self) -> bool {
        self.dispersion.varies()
    }

    /// The absorption coefficient α at `wavelength` (nm) in 1/mm, so that a path of `d` mm passes
    /// exp(−α d). `None` where the catalogue has no extinction: outside its samples, too.
    #[must_use]
    pub fn absorption(&self, wavelength: f64) -> Option<f64> {
        let after = self.extinction.partition_point(|s| s[0] < wavelength);
        let &[right, above] = self.extinction.get(after)?;
        let k = if right == wavelength {
            above
        } else {
            let [left, below] = self.extinction[after.checked_sub(1)?];
            below + (above - below) * (wavelength - left) / (right - left)
        };
        Some(4.0 * std::f64::consts::PI * k / (wavelength * 1e-6))
    }

    /// Abbe's number (nd − 1)/(nF − nC); `None` for a glass without dispersion.
    #[must_use]
    pub fn abbe_number(&self) -> Option<f64> {
        let [f, d, c] =
            [FRAUNHOFER_F, FRAUNHOFER_D, FRAUNHOFER_C].map(|nm| self.dispersion.index(nm));
        let vd = (d? - 1.0) / (f? - c?);
        vd.is_finite().then_some(vd)
    }
}

/// The extinction coefficient at `wavelength` (nm) of which `thickness` (mm) pass a share.
pub(super) fn extinction_of(wavelength: f64, passed: f64, thickness: f64) -> f64 {
    -passed.ln() / thickness * wavelength * 1e-6 / (4.0 * std::f64::consts::PI)
}

/// The end of the sentence on an unknown glass.
fn offer(nearest: &[String]) -> String {
    format!(
        "the nearest names known are {}; a catalogue of your own is added with --glass-catalog FILE.agf, or by \
         `glass_catalogs` of a lens file",
        nearest.join(", ")
    )
}
