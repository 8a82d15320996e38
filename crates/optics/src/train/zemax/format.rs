//! Formats of other programs' lens files: which one a file is, and what its own users call things.

use std::path::Path;

/// Programs whose lens files are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LensFormat {
    /// OpticStudio's sequential mode, `.zmx`.
    #[default]
    Zemax,
    /// CODE V, `.seq`.
    CodeV,
    /// OSLO, `.len`.
    Oslo,
    /// optiland's `Optic.to_dict` as JSON.
    Optiland,
    /// Surfaces of ISET's lenses as JSON.
    Iset,
    /// Tables of pbrt's realistic camera, `.dat`.
    Pbrt,
    /// Tables of `PhotonsToPhotos`' Optical Bench, `.txt`.
    PhotonsToPhotos,
}

/// Words of a program's users for what an error is about.
#[derive(Debug)]
pub(super) struct FormatWords {
    /// The file as a source of numbers.
    pub(super) source: &'static str,
    /// Position of the object.
    pub(super) object: &'static str,
    pub(super) thickness: &'static str,
    pub(super) glass: &'static str,
    /// A glass by its index.
    pub(super) index: &'static str,
    pub(super) semi_diameter: &'static str,
    /// Diameter of the entrance pupil, f-number, and numerical aperture at the object.
    pub(super) pupil: &'static str,
    pub(super) f_number: &'static str,
    pub(super) object_aperture: &'static str,
    pub(super) toroid: &'static str,
    /// Name of the format's statements.
    pub(super) commands: &'static str,
    /// The list that surfaces stand in, of a file in which they have no lines.
    pub(super) surfaces: Option<&'static str>,
}

impl LensFormat {
    /// The format that a file's ending names.
    #[must_use]
    pub fn named(path: &Path) -> Option<Self> {
        let ending = path.extension()?.to_str()?.to_ascii_lowercase();
        match ending.as_str() {
            "zmx" => Some(Self::Zemax),
            "seq" => Some(Self::CodeV),
            "len" => Some(Self::Oslo),
            "dat" => Some(Self::Pbrt),
            _ => None,
        }
    }

    /// The format of a file by its ending and, where that does not say it, by its content; `None` for lens files of
    /// our own, scenes, and whatever else is no lens.
    #[must_use]
    pub fn of(path: &Path, bytes: &[u8]) -> Option<Self> {
        let ending = path.extension()?.to_str()?.to_ascii_lowercase();
        let has = |text: &str| contains(bytes, text.as_bytes());
        match ending.as_str() {
            "json" if has("\"surface_group\"") => Some(Self::Optiland),
            "json" if has("\"surfaces\"") || has("\"surfaceArray\"") => {
                (!has("\"elements\"") && !has("\"etendue\"")).then_some(Self::Iset)
            }
            "txt" => has("[lens data]").then_some(Self::PhotonsToPhotos),
            _ => Self::named(path),
        }
    }

    /// True if files of the format may hold several configurations.
    #[must_use]
    pub const fn has_configurations(self) -> bool {
        match self {
            Self::Zemax | Self::Oslo | Self::PhotonsToPhotos => true,
            Self::CodeV | Self::Optiland | Self::Iset | Self::Pbrt => false,
        }
    }

    pub(super) const fn words(self) -> &'static FormatWords {
        match self {
            Self::Zemax => &ZEMAX,
            Self::CodeV => &CODE_V,
            Self::Oslo => &OSLO,
            Self::Optiland => &OPTILAND,
            Self::Iset => &ISET,
            Self::Pbrt => &PBRT,
            Self::PhotonsToPhotos => &PHOTONS_TO_PHOTOS,
        }
    }
}

/// Tests whether `text` stands somewhere in `bytes`, letters in any case.
fn contains(bytes: &[u8], text: &[u8]) -> bool {
    bytes.windows(text.len()).any(|window| window.eq_ignore_ascii_case(text))
}

static ZEMAX: FormatWords = FormatWords {
    source: "a Zemax file",
    object: "SURF 0",
    thickness: "DISZ",
    glass: "GLAS",
    index: "GLAS ___BLANK 1 0 nd vd",
    semi_diameter: "DIAM",
    pupil: "ENPD",
    f_number: "FNUM",
    object_aperture: "OBNA",
    toroid: "TOROIDAL",
    commands: "commands",
    surfaces: None,
};

static CODE_V: FormatWords = FormatWords {
    source: "a CODE V file",
    object: "SO",
    thickness: "the thickness",
    glass: "glass",
    index: "nd:vd",
    semi_diameter: "CIR",
    pupil: "EPD",
    f_number: "FNO",
    object_aperture: "NAO",
    toroid: "YTO",
    commands: "commands",
    surfaces: None,
};

static OSLO: FormatWords = FormatWords {
    source: "an OSLO file",
    object: "surface 0",
    thickness: "TH",
    glass: "GLA",
    index: "GLA MOD nd vd",
    semi_diameter: "AP",
    pupil: "EBR",
    f_number: "FNO",
    object_aperture: "NAO",
    toroid: "CVX",
    commands: "commands",
    surfaces: None,
};

static OPTILAND: FormatWords = FormatWords {
    source: "an optiland file",
    object: "surface 0",
    thickness: "the distance to the next surface",
    glass: "material_post",
    index: "{\"type\": \"AbbeMaterial\", \"index\": nd, \"abbe\": vd}",
    semi_diameter: "aperture",
    pupil: "EPD",
    f_number: "imageFNO",
    object_aperture: "objectNA",
    toroid: "ToroidalGeometry",
    commands: "keys",
    surfaces: Some("surface_group.surfaces"),
};

static ISET: FormatWords = FormatWords {
    source: "a lens of ISET",
    object: "the object",
    thickness: "thickness",
    glass: "ior",
    index: "its number",
    semi_diameter: "semi_aperture",
    pupil: "the entrance pupil",
    f_number: "the f-number",
    object_aperture: "the numerical aperture",
    toroid: "two radii",
    commands: "keys",
    surfaces: Some("surfaces"),
};

static PBRT: FormatWords = FormatWords {
    source: "a table of pbrt's realistic camera",
    object: "the object",
    thickness: "the thickness",
    glass: "the index",
    index: "its number",
    semi_diameter: "the aperture's diameter",
    pupil: "the entrance pupil",
    f_number: "the f-number",
    object_aperture: "the numerical aperture",
    toroid: "a toroid",
    commands: "commands",
    surfaces: None,
};

static PHOTONS_TO_PHOTOS: FormatWords = FormatWords {
    source: "a table of PhotonsToPhotos",
    object: "d0",
    thickness: "the thickness",
    glass: "nd",
    index: "nd and vd in their columns",
    semi_diameter: "the diameter",
    pupil: "the entrance pupil",
    f_number: "F-Number",
    object_aperture: "the numerical aperture",
    toroid: "a toroid",
    commands: "rows and sections",
    surfaces: None,
};
