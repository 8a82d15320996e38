//! Placements as light meets them, and a table of what is looked up of them for each hit, in single precision. What is not alike all over, as textures
//! have it, is looked up where it is hit.

use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{Geometry, Mesh, Placement};

use crate::bodies::Body;
use crate::scattering::Absorption;
use crate::shading::SheetSurface;
use crate::transport::Traits;
use crate::{Conductor, ConductorId, Material, Paint, Scattering, Spectral, Tint};

/// A placement as light meets it.
#[derive(Debug, Clone)]
pub(crate) struct PlacedSurface {
    /// Magnitudes of its own numbers, which add to the rounding of a hit (m).
    pub(crate) magnitudes: DVec3,
    /// The matrix that brings its mesh's normals into the world; `None` where none has to.
    pub(crate) turn: Option<DMat3>,
    /// It shines, or shows itself without light.
    pub(crate) is_seen: bool,
    /// It is partly not there.
    pub(crate) has_alpha: bool,
    /// No light passes it.
    pub(crate) is_opaque: bool,
    /// Its shading normal is not that of its triangles.
    pub(crate) is_tilted: bool,
    /// Absorption of light by the body behind its front.
    pub(crate) absorption: Option<Absorption>,
    /// The body that it encloses, of glass that is closed.
    pub(crate) body: Option<Body>,
    /// Its colour, where that is alike all over.
    pub(crate) color: Option<Tint>,
}

impl PlacedSurface {
    /// True if rays may pass it as if it were not there.
    pub(crate) fn may_vanish(&self) -> bool {
        self.has_alpha || self.body.is_some_and(|body| body.may_vanish)
    }
}

/// The colour of a paint that is alike all over, 0..=1.
pub(super) fn plain_tint(paint: &Paint, spectral: &Spectral) -> Option<Tint> {
    match paint {
        Paint::Plain(color) => Some(Tint::from(*color).clamped()),
        Paint::Curve { look, .. } if spectral.is_rgb() => Some(Tint::from(*look).clamped()),
        Paint::Curve { curve, .. } => Some(Tint { color: [1.0; 3], spectrum: curve.spectrum() }),
        Paint::Checker { .. } | Paint::Image { .. } | Paint::Cube { .. } => None,
    }
}

/// The surfaces of a scene by their placements.
#[derive(Debug, Clone, Default)]
pub(crate) struct SurfaceTable {
    /// Behind the last one that is not there.
    pub(crate) all: Vec<SurfaceRow>,
    /// Their facets, by material; empty where all are matte.
    pub(crate) facets: Vec<Facets>,
    /// Some scatter light about other normals than those of their triangles.
    pub(crate) are_tilted: bool,
    /// Some are mirrors or boundaries of smooth glass.
    pub(crate) are_smooth: bool,
    /// Some are not alike all over.
    pub(crate) are_varied: bool,
    /// The cones of paths count behind mirrors and smooth boundaries, too.
    pub(crate) carry_cones: bool,
    /// The colours of materials that are alike all over, `[material][band]`; 0 of others. Of measured metals what they
    /// reflect face on.
    colors: Vec<f32>,
    /// Those of their facets' highlights, and the dips of measured metals, likewise; empty where all are matte, and where
    /// bands are red, green and blue.
    facet_bands: Vec<[f64; 2]>,
    count: usize,
}

/// A surface that scatters light, or only shines, in a line of a processor's cache.
#[derive(Debug, Clone, Copy, Default)]
#[repr(align(64))]
pub(crate) struct SurfaceRow {
    /// [`PlacedSurface::magnitudes`] (m).
    pub(crate) magnitudes: [f32; 3],
    /// Index of its material.
    pub(crate) material: u32,
    pub(crate) is_there: bool,
    pub(crate) kind: SurfaceKind,
    pub(crate) shines: bool,
    /// Its colour, its facets or its normals are those of the place where it is hit; its facets are, and its normals, as
    /// where they are mapped or move.
    pub(crate) is_varied: bool,
    pub(crate) has_own_facets: bool,
    pub(crate) is_mapped: bool,
    /// It scatters light about normals of its mesh's corners, which this carries into the world, row by row.
    pub(crate) turn: Option<[[f32; 3]; 3]>,
}

const _: () = assert!(size_of::<SurfaceRow>() == 64, "one line of a cache");

/// As what the hits of a surface are worked on, where it is there.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) enum SurfaceKind {
    /// It scatters nothing.
    #[default]
    Black,
    /// Lambert's.
    Matte,
    /// A sheet of facets over a matte base ([`crate::bsdf::sheets`]): rough metal, and glTF's surfaces without
    /// more over them.
    Sheet,
    /// A mirror, or a smooth boundary of glass.
    Smooth,
    /// Of any other kind, or a sheet smoother than [`LEAST_ALPHA`]: worked out hit by hit.
    Other,
}

impl SurfaceKind {
    fn of(scattering: &Scattering) -> Self {
        match scattering {
            Scattering::Black | Scattering::Unlit => Self::Black,
            Scattering::Matte => Self::Matte,
            Scattering::Metal { roughness, .. } if *roughness > 0.0 => Self::Sheet,
            Scattering::Gltf(surface) if surface.is_bare_sheet() => Self::Sheet,
            Scattering::Mirror | Scattering::Metal { .. } => Self::Smooth,
            Scattering::Dielectric(glass) if glass.roughness == 0.0 => Self::Smooth,
            Scattering::Dielectric(_) | Scattering::Gltf(_) => Self::Other,
        }
    }
}

/// Properties of a sheet of facets, or of a smooth surface, as [`crate::bsdf::sheets::Sheets`] takes them.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Facets {
    /// The square of the roughness, and the share of metal.
    pub(crate) alpha: f64,
    pub(crate) metallic: f64,
    /// The dielectric's reflectance face on, before the highlights' colour, and at grazing incidence.
    pub(crate) f0: f64,
    pub(crate) f90: f64,
    /// The largest band of the dielectric's reflectance face on, and of the colour.
    pub(crate) f0_peak: f64,
    pub(crate) base_peak: f64,
    /// It is [`Scattering::Metal`].
    pub(crate) is_metal: bool,
    /// Index of refraction; 0 of mirrors and sheets.
    pub(crate) ior: f64,
    /// The highlights' red, green and blue; and what a measured metal's reflectance lacks of Schlick's. Unused where bands
    /// are others.
    pub(crate) highlight: [f64; 3],
    pub(crate) dip: [f64; 3],
}

/// The least square of a roughness whose densities, and directions within whose highlights, single precision holds.
pub(crate) const LEAST_ALPHA: f64 = 1e-6;

impl SurfaceTable {
    /// Tests whether some are not matte, or not alike all over.
    pub(crate) fn are_rich(&self) -> bool {
        !self.facets.is_empty() || self.are_varied
    }

    /// Number of bands.
    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// The bands of a material's colour.
    #[inline(always)]
    pub(crate) fn color_of(&self, material: u32) -> &[f32] {
        let first = material as usize * self.count;
        self.colors.get(first..first + self.count).unwrap_or_default()
    }

    /// Red, green and blue of a material's colour, where these are the bands.
    #[inline(always)]
    pub(crate) fn rgb_of(&self, material: u32) -> &[f32; 3] {
        let (rows, _) = self.colors.as_chunks();
        rows.get(material as usize).unwrap_or(&[0.0; 3])
    }

    /// Bands of the highlights and the dip of a material's facets.
    #[inline(always)]
    pub(crate) fn facet_bands_of(&self, material: u32) -> &[[f64; 2]] {
        let first = material as usize * self.count;
        self.facet_bands.get(first..first + self.count).unwrap_or_default()
    }

    /// Those of a scene.
    pub(super) fn of(
        placed: &[Option<PlacedSurface>],
        geometry: &Geometry,
        materials: &[Material],
        spectral: &Spectral,
        traits: &Traits,
    ) -> Self {
        // Many copies are of few materials.
        let mut all = Vec::with_capacity(placed.len() + 1);
        for (placed, placement) in placed.iter().zip(&geometry.placements) {
            let material = materials.get(placement.material as usize);
            let mesh = geometry.mesh_of(placement);
            all.push(match (placed, material) {
                (Some(placed), Some(material)) => {
                    SurfaceRow::of(placed, material, placement, mesh, spectral, traits)
                }
                _ => SurfaceRow::default(),
            });
        }
        let mut facets: Vec<_> =
            materials.iter().map(|material| Facets::of(material, spectral)).collect();
        let has = |kind| all.iter().any(|own: &SurfaceRow| own.kind == kind);
        let (has_smooth, has_sheets) = (has(SurfaceKind::Smooth), has(SurfaceKind::Sheet));
        if !has_smooth && !has_sheets {
            facets.clear();
        }
        // What is worked out by itself may be smooth, and has normals of its own.
        let has_others = has(SurfaceKind::Other) || all.iter().any(|own| own.has_own_facets);
        let are_smooth = has_smooth || has_others;
        let are_tilted = has_others || all.iter().any(|surface| surface.turn.is_some());
        let are_varied = all.iter().any(|surface| surface.is_varied);
        let has_alpha = materials.iter().any(Material::has_alpha);
        let carry_cones = are_smooth && (are_varied || has_alpha);
        let count = spectral.count();
        let (mut colors, mut facet_bands) = (Vec::new(), Vec::new());
        for material in materials {
            colors.extend((0..count).map(|k| single(face_on(material, spectral, k))));
            if !facets.is_empty() && !spectral.is_rgb() {
                facet_bands.extend((0..count).map(|k| bands_of_facets(material, spectral, k)));
            }
        }
        all.push(SurfaceRow::default());
        Self {
            all,
            facets,
            are_tilted,
            are_smooth,
            are_varied,
            carry_cones,
            colors,
            facet_bands,
            count,
        }
    }
}

impl SurfaceRow {
    fn of(
        placed: &PlacedSurface,
        material: &Material,
        placement: &Placement,
        mesh: &Mesh,
        spectral: &Spectral,
        traits: &Traits,
    ) -> Self {
        let parts_media = traits.has_media || traits.has_dispersion;
        let kind = match SurfaceKind::of(&material.scattering) {
            // What media there are on its sides is known where it is hit.
            SurfaceKind::Smooth if parts_media && material.scattering.is_body() => {
                SurfaceKind::Other
            }
            kind => kind,
        };
        let scatters = kind != SurfaceKind::Black;
        let is_tilted = scatters && placed.is_tilted;
        let moves = placement.motion.is_some() || mesh.steps.is_some();
        let is_mapped = is_tilted && (moves || material.normal_map.is_some());
        // Directions alone count: what a mesh is scaled by would leave the range of single precision.
        let rows = || {
            let turn = placed.turn.unwrap_or(DMat3::IDENTITY).transpose();
            let largest = turn.to_cols_array().into_iter().fold(0.0, |a: f64, x| a.max(x.abs()));
            turn.to_cols_array_2d().map(|row| row.map(|x| single(x / largest)))
        };
        let turn = is_tilted.then(rows);
        let has_own_facets = match &material.scattering {
            Scattering::Gltf(surface) => {
                kind == SurfaceKind::Sheet && surface.plain_sheet(spectral).is_none()
            }
            _ => false,
        };
        let is_resolved = has_own_facets || Facets::of(material, spectral).alpha >= LEAST_ALPHA;
        let kind =
            if kind == SurfaceKind::Sheet && !is_resolved { SurfaceKind::Other } else { kind };
        let is_known = measured(material).is_some() || placed.color.is_some();
        let is_varied = !is_known || is_mapped || has_own_facets || kind == SurfaceKind::Other;
        Self {
            magnitudes: placed.magnitudes.to_array().map(single),
            material: placement.material,
            is_there: true,
            kind,
            // What may not be there is met before it is known whether it is.
            shines: placed.is_seen && !placed.may_vanish(),
            is_varied: scatters && is_varied,
            has_own_facets,
            is_mapped,
            turn,
        }
    }
}

/// The metal by whose measured index a material reflects.
fn measured(material: &Material) -> Option<ConductorId> {
    match &material.scattering {
        Scattering::Metal { named, .. } => named.as_ref().map(Conductor::id),
        _ => None,
    }
}

/// Reflectance in a band of a material that is alike all over: of a measured metal face on.
fn face_on(material: &Material, spectral: &Spectral, band: usize) -> f64 {
    match measured(material) {
        Some(metal) => spectral.metal(metal, band)[0],
        None => {
            let tint = plain_tint(&material.base_color, spectral);
            tint.map_or(0.0, |tint| spectral.tint(&tint, band))
        }
    }
}

/// The colour of a material's highlights in a band, and what a measured metal's reflectance lacks of Schlick's.
fn bands_of_facets(material: &Material, spectral: &Spectral, band: usize) -> [f64; 2] {
    let highlight = match &material.scattering {
        Scattering::Gltf(surface) => surface.plain_sheet(spectral).map(|sheet| sheet.highlight),
        _ => None,
    };
    let dip = measured(material).map_or(0.0, |metal| spectral.metal(metal, band)[1]);
    [highlight.map_or(1.0, |tint| spectral.tint(&tint, band)), dip]
}

impl Facets {
    /// Those of a material; of what is not alike all over none.
    fn of(material: &Material, spectral: &Spectral) -> Self {
        let base = plain_tint(&material.base_color, spectral);
        let base_peak = base.map_or(0.0, |tint| tint.peak());
        let own = Self { highlight: [1.0; 3], base_peak, ..Self::default() };
        match &material.scattering {
            Scattering::Metal { roughness, .. } => {
                let dip = match spectral.is_rgb() {
                    true => [0, 1, 2].map(|k| bands_of_facets(material, spectral, k)[1]),
                    false => [0.0; 3],
                };
                let alpha = roughness * roughness;
                Self { alpha, metallic: 1.0, is_metal: true, dip, ..own }
            }
            Scattering::Gltf(surface) => {
                let sheet = surface.plain_sheet(spectral);
                sheet.map_or(own, |sheet| Self { base_peak, ..Self::of_sheet(&sheet) })
            }
            Scattering::Dielectric(glass) => {
                Self { ior: glass.ior.at(spectral.wavelength(0)), ..own }
            }
            Scattering::Mirror | Scattering::Black | Scattering::Matte | Scattering::Unlit => own,
        }
    }

    /// Those of a rough sheet.
    pub(crate) fn of_sheet(sheet: &SheetSurface) -> Self {
        Self {
            alpha: sheet.alpha,
            metallic: sheet.metallic,
            f0: sheet.f0,
            f90: sheet.f90,
            f0_peak: (sheet.f0 * sheet.highlight.peak()).min(1.0),
            highlight: sheet.highlight.color,
            ..Self::default()
        }
    }
}

#[expect(clippy::cast_possible_truncation, reason = "single precision is the purpose")]
fn single(x: f64) -> f32 {
    x as f32
}
