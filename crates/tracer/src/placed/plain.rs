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
    /// Their facets; empty where all are matte.
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
    /// The largest bands of the surface's colour, and of the dielectric's reflectance face on.
    pub(crate) base_peak: f64,
    pub(crate) f0_peak: f64,
    /// It is [`Scattering::Metal`].
    pub(crate) is_metal: bool,
    /// Index of refraction; 0 of mirrors and sheets.
    pub(crate) ior: f64,
    pub(crate) highlight: [f64; 3],
    /// What a measured metal's reflectance lacks of Schlick's.
    pub(crate) dip: [f64; 3],
}

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
        let (mut all, mut facets, mut rough_by) = (Vec::new(), Vec::new(), Vec::new());
        for (placed, placement) in placed.iter().zip(&geometry.placements) {
            let material = materials.get(placement.material as usize)?;
            let mesh = geometry.mesh_of(placement);
            let mut own = PlainSurface::of(placed.as_ref()?, material, (placement, mesh))?;
            facets.push(PlainFacets::default());
            if matches!(own.kind, PlainKind::Sheet | PlainKind::Smooth) {
                let of_own = facets.last_mut()?;
                *of_own = PlainFacets::of(placed.as_ref()?, material, spectral)?;
                if let Some(face_on) = of_own.measure(material, spectral) {
                    own.color = face_on.map(single);
                    own.is_varied = own.is_mapped;
                }
                if let Scattering::Gltf(surface) = &material.scattering {
                    own.has_own_facets = surface.plain_sheet(spectral).is_none();
                    own.is_varied |= own.has_own_facets;
                    rough_by.extend(surface.metallic_roughness.as_ref().map(|image| image.texture));
                    // Its roughness is 0 where the image says so.
                    if surface.glossiness_texture.is_some() && surface.roughness <= 0.0 {
                        return None;
                    }
                }
            }
            all.push(own);
        }
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
        let color = placed.color.filter(|_| scatters);
        Some(Self {
            color: color.map_or([0.0; 3], |tint| tint.color.map(single)),
            magnitudes: placed.magnitudes.to_array().map(single),
            is_there: true,
            kind,
            shines: placed.is_seen,
            is_varied: scatters && (color.is_none() || is_mapped),
            has_own_facets: false,
            is_mapped,
            turn,
        })
    }
}

impl PlainFacets {
    /// Those of a surface; of what is not alike all over none.
    fn of(placed: &PlacedSurface, material: &Material, spectral: &Spectral) -> Option<Self> {
        let own = Self { highlight: [1.0; 3], ..Self::default() };
        match &material.scattering {
            Scattering::Metal { roughness, .. } => {
                let alpha = roughness * roughness;
                Some(Self { alpha, metallic: 1.0, is_metal: true, ..own })
            }
            Scattering::Gltf(surface) => {
                let Some(sheet) = surface.plain_sheet(spectral) else { return Some(own) };
                let base_peak = placed.color.map_or(0.0, |color| color.peak());
                Some(Self::of_sheet(&sheet, base_peak))
            }
            Scattering::Dielectric(glass) => {
                Some(Self { ior: glass.ior.at(spectral.wavelength(0)), ..own })
            }
            Scattering::Mirror => Some(own),
            Scattering::Black | Scattering::Matte | Scattering::Unlit => None,
        }
    }

    /// Those of a rough sheet over a surface whose colour has this largest band.
    pub(crate) fn of_sheet(sheet: &SheetSurface, base_peak: f64) -> Self {
        Self {
            alpha: sheet.alpha,
            metallic: sheet.metallic,
            f0: sheet.f0,
            f90: sheet.f90,
            base_peak,
            f0_peak: (sheet.f0 * sheet.highlight.peak()).min(1.0),
            highlight: sheet.highlight.color,
            ..Self::default()
        }
    }

    /// Takes the dip of a metal by whose measured index the surface reflects; what that reflects face on.
    fn measure(&mut self, material: &Material, spectral: &Spectral) -> Option<[f64; 3]> {
        let Scattering::Metal { named: Some(named), .. } = &material.scattering else {
            return None;
        };
        let id = Conductor::id(named);
        let of_band = |k| spectral.metal(id, k);
        let bands = [of_band(0), of_band(1), of_band(2)];
        self.dip = bands.map(|[_, dip]| dip);
        Some(bands.map(|[face_on, _]| face_on))
    }
}

#[expect(clippy::cast_possible_truncation, reason = "single precision is the purpose")]
fn single(x: f64) -> f32 {
    x as f32
}
