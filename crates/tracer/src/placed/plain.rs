//! Surfaces in single precision: matte, sheets of facets, mirrors and smooth glass. What is not alike all over, as
//! textures have it, is looked up where it is hit.

use etendue_geometry::glam::DMat3;
use etendue_geometry::{Geometry, Mesh, Placement};

use super::{PlacedSurface, SurfaceKind};
use crate::shading::SheetSurface;
use crate::{Conductor, Material, Scattering, Spectral};

/// The surfaces of a scene by their placements, where each is of one of these kinds and wholly there.
#[derive(Debug, Clone)]
pub(crate) struct PlainSurfaces {
    /// Behind the last one that is not there.
    pub(crate) all: Vec<PlainSurface>,
    /// Their facets, by material; empty where all are matte.
    pub(crate) facets: Vec<PlainFacets>,
    /// Some scatter light about other normals than those of their triangles.
    pub(crate) are_tilted: bool,
    /// Some are mirrors or boundaries of smooth glass.
    pub(crate) are_smooth: bool,
    /// Some are not alike all over.
    pub(crate) are_varied: bool,
    /// The textures by which surfaces are rough, which leave none smooth where all their green is above 0.
    pub(crate) rough_by: Vec<u32>,
}

/// A surface that scatters light, or only shines.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct PlainSurface {
    /// Of a measured metal what it reflects face on.
    pub(crate) color: [f32; 3],
    /// [`PlacedSurface::magnitudes`] (m).
    pub(crate) magnitudes: [f32; 3],
    /// Index of its material.
    pub(crate) material: u32,
    pub(crate) is_there: bool,
    pub(crate) kind: PlainKind,
    pub(crate) shines: bool,
    /// Its colour, its facets or its normals are those of the place where it is hit; its facets are, and its normals, as
    /// where they are mapped or move.
    pub(crate) is_varied: bool,
    pub(crate) has_own_facets: bool,
    pub(crate) is_mapped: bool,
    /// It scatters light about normals of its mesh's corners, which this carries into the world, row by row.
    pub(crate) turn: Option<[[f32; 3]; 3]>,
}

/// How a plain surface scatters light.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) enum PlainKind {
    /// Not at all.
    #[default]
    Black,
    Matte,
    /// [`SurfaceKind::Sheet`].
    Sheet,
    /// [`SurfaceKind::Smooth`].
    Smooth,
}

/// What a sheet of facets has, or a smooth surface, as [`crate::bsdf::sheets::Sheets`] takes it.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct PlainFacets {
    /// The square of the roughness, and the share of metal.
    pub(crate) alpha: f64,
    pub(crate) metallic: f64,
    /// The dielectric's reflectance face on, before the highlights' colour, and at grazing incidence.
    pub(crate) f0: f64,
    pub(crate) f90: f64,
    /// The largest band of the dielectric's reflectance face on.
    pub(crate) f0_peak: f64,
    /// It is [`Scattering::Metal`].
    pub(crate) is_metal: bool,
    /// Index of refraction; 0 of mirrors and sheets.
    pub(crate) ior: f64,
    pub(crate) highlight: [f64; 3],
    /// What a measured metal's reflectance lacks of Schlick's.
    pub(crate) dip: [f64; 3],
}

/// The least square of a roughness whose densities, and directions within whose highlights, single precision holds.
pub(crate) const LEAST_ALPHA: f64 = 1e-6;

impl PlainSurfaces {
    /// Tests whether some are not matte, or not alike all over.
    pub(crate) fn are_rich(&self) -> bool {
        !self.facets.is_empty() || self.are_varied
    }

    /// `None` if one is not plain.
    pub(super) fn of(
        placed: &[Option<PlacedSurface>],
        (geometry, materials): (&Geometry, &[Material]),
        spectral: &Spectral,
    ) -> Option<Self> {
        // Many copies are of few materials.
        let mut all = Vec::with_capacity(placed.len() + 1);
        for (placed, placement) in placed.iter().zip(&geometry.placements) {
            let material = materials.get(placement.material as usize)?;
            let mesh = geometry.mesh_of(placement);
            all.push(PlainSurface::of(placed.as_ref()?, material, (placement, mesh), spectral)?);
        }
        let rough_by = materials.iter().filter_map(|material| match &material.scattering {
            Scattering::Gltf(surface) => surface.metallic_roughness.as_ref(),
            _ => None,
        });
        let mut rough_by: Vec<u32> = rough_by.map(|image| image.texture).collect();
        let mut facets: Vec<_> =
            materials.iter().map(|material| PlainFacets::of(material, spectral)).collect();
        let has = |kind| all.iter().any(|own: &PlainSurface| own.kind == kind);
        let (are_smooth, has_sheets) = (has(PlainKind::Smooth), has(PlainKind::Sheet));
        if !are_smooth && !has_sheets {
            facets.clear();
        }
        let are_tilted = all.iter().any(|surface| surface.turn.is_some());
        let are_varied = all.iter().any(|surface| surface.is_varied);
        all.push(PlainSurface::default());
        rough_by.sort_unstable();
        rough_by.dedup();
        Some(Self { all, facets, are_tilted, are_smooth, are_varied, rough_by })
    }
}

impl PlainSurface {
    /// `None` of a surface of another kind.
    fn of(
        placed: &PlacedSurface,
        material: &Material,
        (placement, mesh): (&Placement, &Mesh),
        spectral: &Spectral,
    ) -> Option<Self> {
        let kind = match placed.kind {
            SurfaceKind::Black => PlainKind::Black,
            SurfaceKind::Matte => PlainKind::Matte,
            SurfaceKind::Sheet => PlainKind::Sheet,
            SurfaceKind::Smooth => PlainKind::Smooth,
            SurfaceKind::Other => return None,
        };
        let is_unlit = material.scattering == Scattering::Unlit;
        if placed.has_alpha || placed.may_vanish() || is_unlit {
            return None;
        }
        let scatters = kind != PlainKind::Black;
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
            Scattering::Gltf(surface) if kind == PlainKind::Sheet => {
                // Where its image says so its roughness is 0.
                if surface.glossiness_texture.is_some() && surface.roughness <= 0.0 {
                    return None;
                }
                surface.plain_sheet(spectral).is_none()
            }
            _ => false,
        };
        let is_resolved = kind != PlainKind::Sheet
            || has_own_facets
            || PlainFacets::of(material, spectral).alpha >= LEAST_ALPHA;
        if !is_resolved {
            return None;
        }
        let color = match measured(material, spectral) {
            Some(bands) => Some(bands.map(|[face_on, _]| face_on)),
            None => placed.color.map(|tint| tint.color),
        };
        let is_varied = color.is_none() || is_mapped || has_own_facets;
        Some(Self {
            color: color.filter(|_| scatters).unwrap_or_default().map(single),
            magnitudes: placed.magnitudes.to_array().map(single),
            material: placement.material,
            is_there: true,
            kind,
            shines: placed.is_seen,
            is_varied: scatters && is_varied,
            has_own_facets,
            is_mapped,
            turn,
        })
    }
}

/// What a measured metal reflects face on in each band, and what its reflectance lacks of Schlick's; `None` of others.
fn measured(material: &Material, spectral: &Spectral) -> Option<[[f64; 2]; 3]> {
    let Scattering::Metal { named: Some(named), .. } = &material.scattering else { return None };
    let id = Conductor::id(named);
    Some([0, 1, 2].map(|band| spectral.metal(id, band)))
}

impl PlainFacets {
    /// Those of a material; of what is not alike all over none.
    fn of(material: &Material, spectral: &Spectral) -> Self {
        let own = Self { highlight: [1.0; 3], ..Self::default() };
        match &material.scattering {
            Scattering::Metal { roughness, .. } => {
                let dip = measured(material, spectral).map(|bands| bands.map(|[_, dip]| dip));
                let (alpha, dip) = (roughness * roughness, dip.unwrap_or_default());
                Self { alpha, metallic: 1.0, is_metal: true, dip, ..own }
            }
            Scattering::Gltf(surface) => {
                let sheet = surface.plain_sheet(spectral);
                sheet.map_or(own, |sheet| Self::of_sheet(&sheet))
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
