//! Properties of each placement that are known before any ray meets it: worked out once, looked up at each
//! hit.

mod table;

use etendue_geometry::glam::DMat3;
use etendue_geometry::{Coplanar, Geometry, Placement};

use self::table::plain_tint;
pub(crate) use self::table::{
    Facets, LEAST_ALPHA, PlacedSurface, SurfaceKind, SurfaceRow, SurfaceTable,
};
use crate::bodies::{Body, bodies};
use crate::spawn::magnitudes;
use crate::transport::Traits;
use crate::{Material, Scattering, Spectral};

/// Properties of the placements of a scene that light has to know, by their numbers.
#[derive(Debug, Clone, Default)]
pub struct PlacedSurfaces {
    /// `None` for a placement whose material there is none of.
    all: Vec<Option<PlacedSurface>>,
    /// The boundaries of bodies that lie over one another.
    pub(crate) touching: Coplanar,
    /// The table that is looked up for each hit.
    table: SurfaceTable,
    /// Single precision holds their places.
    fits_single: bool,
    /// The diagonal of the box around all (m).
    size: f64,
}

impl PlacedSurfaces {
    /// Those of a scene.
    #[must_use]
    pub fn of(geometry: &Geometry, materials: &[Material], spectral: &Spectral) -> Self {
        let bodies = bodies(geometry, materials);
        let surface = |(placement, body): (&Placement, Option<Body>)| {
            let material = materials.get(placement.material as usize)?;
            let mesh = geometry.mesh_of(placement);
            let place = &placement.world_from_mesh;
            let colored = material.vertex_colors && mesh.colors.is_some();
            Some(PlacedSurface {
                magnitudes: magnitudes(placement, mesh),
                turn: (place.linear != DMat3::IDENTITY).then(|| place.normal_matrix()),
                is_seen: material.emission.is_some() || material.scattering == Scattering::Unlit,
                has_alpha: material.has_alpha(),
                is_opaque: !material.has_alpha() && !material.scattering.lets_pass(),
                absorption: material.absorption(),
                body,
                is_tilted: material.normal_map.is_some() || mesh.normals.is_some(),
                color: if colored { None } else { plain_tint(&material.base_color, spectral) },
            })
        };
        // Bodies that move touch others for no time at all.
        let stands = |i: usize| geometry.placements[i].motion.is_none();
        let may_touch = |i: usize| stands(i) && bodies[i].is_some_and(|body: Body| body.may_vanish);
        let touching = match bodies.iter().flatten().any(|body| body.may_vanish) {
            true => Coplanar::among(geometry, &may_touch),
            false => Coplanar::default(),
        };
        let all: Vec<_> = geometry.placements.iter().zip(bodies).map(surface).collect();
        let bounds = geometry.loose_bounds();
        let size = bounds.diagonal();
        let [least, most] = crate::transport::SIZES;
        let fits_single = size >= least && size + bounds.centre().length() <= most;
        let table = SurfaceTable::default();
        let mut own = Self { all, touching, table, fits_single, size };
        let traits = Traits::of(geometry, materials, &own);
        own.table = SurfaceTable::of(&own.all, geometry, materials, spectral, &traits);
        own
    }

    /// The table that is looked up for each hit.
    pub(crate) fn table(&self) -> &SurfaceTable {
        &self.table
    }

    /// Tests whether single precision holds their places.
    pub(crate) fn fits_single(&self) -> bool {
        self.fits_single
    }

    /// The diagonal of the box around all (m).
    pub(crate) fn size(&self) -> f64 {
        self.size
    }

    /// All bodies.
    pub(crate) fn bodies(&self) -> impl Iterator<Item = &Body> {
        self.all.iter().flatten().filter_map(|placed| placed.body.as_ref())
    }

    /// That of a placement; `None` for [`MISS`](etendue_geometry::MISS), too.
    pub(crate) fn get(&self, placement: u32) -> Option<&PlacedSurface> {
        self.all.get(placement as usize)?.as_ref()
    }
}
