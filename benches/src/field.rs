//! All contestants on one scene, ready to trace.

use std::sync::Arc;

use etendue_accel::{Accel, BuildOptions, Bvh, Embree, Exact};
use etendue_geometry::{Geometry, RayBatch};

use crate::contest::{Contestant, LimitPackets, LimitSingles, Ours, Query};
use crate::rays::one_by_one;
use etendue_accel::limit::{BareScene, Mode, RayHit16, Single};

/// The structures of every contestant over one geometry.
#[derive(Debug)]
pub struct Field {
    /// Scene that is traced.
    pub geometry: Arc<Geometry>,
    /// Embree, bare.
    pub limit: BareScene,
    /// Embree behind our interface.
    pub embree: Embree,
    /// The pure-Rust tree.
    pub bvh: Bvh,
    /// The reference, where it is wanted.
    pub exact: Option<Exact>,
}

/// Part that the reference takes: it needs much memory and time on heavy scenes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reference {
    /// It does.
    Included,
    /// It does not.
    LeftOut,
}

impl Field {
    /// Builds all of them, in Embree's default quality.
    ///
    /// # Errors
    ///
    /// When one cannot be built.
    pub fn build(geometry: &Arc<Geometry>, reference: Reference) -> anyhow::Result<Self> {
        let options = BuildOptions::default();
        let exact = match reference {
            Reference::Included => Some(Exact::build(Arc::clone(geometry), &options)?),
            Reference::LeftOut => None,
        };
        Ok(Self {
            geometry: Arc::clone(geometry),
            limit: BareScene::build(Arc::clone(geometry), Mode::default(), 0)?,
            embree: Embree::build(Arc::clone(geometry), &options)?,
            bvh: Bvh::build(Arc::clone(geometry), &options)?,
            exact,
        })
    }
}

/// One set of rays in the forms that the contestants take.
#[derive(Debug)]
pub struct Rays {
    /// As a render has them.
    pub batches: Vec<RayBatch>,
    /// Not to be put into packets.
    pub scattered: Vec<RayBatch>,
    /// As the bare loop takes them; empty for rays that are no packets.
    pub packets: Vec<RayHit16>,
    /// As the other bare loop takes them.
    pub singles: Vec<Single>,
    /// Question that is asked of them.
    pub query: Query,
}

impl Rays {
    /// Prepares `batches` for everyone.
    #[must_use]
    pub fn new(batches: Vec<RayBatch>, query: Query) -> Self {
        let coherent = batches.first().is_some_and(|rays| rays.coherent);
        let packets = if coherent { RayHit16::of(&batches) } else { Vec::new() };
        let scattered = one_by_one(&batches);
        Self { packets, scattered, singles: Single::of(&batches), query, batches }
    }

    /// True if packets are of use.
    #[must_use]
    pub fn are_coherent(&self) -> bool {
        !self.packets.is_empty()
    }
}

/// A contestant with its name.
pub type Named<'a> = (&'static str, Box<dyn Contestant + 'a>);

/// The names of the contestants.
pub mod names {
    /// Embree's bare loop over packets.
    pub const LIMIT_PACKETS: &str = "limit, packets";
    /// Embree's bare loop over single rays.
    pub const LIMIT_SINGLE: &str = "limit, single";
    /// Our Embree backend in packets.
    pub const EMBREE_PACKETS: &str = "embree, packets";
    /// Our Embree backend, single rays.
    pub const EMBREE_SINGLE: &str = "embree, single";
    /// Our pure-Rust backend.
    pub const BVH: &str = "bvh";
    /// Our reference.
    pub const EXACT: &str = "exact";
}

/// Everyone who can trace `rays` through `field`.
#[must_use]
pub fn contestants<'a>(field: &'a Field, rays: &'a Rays) -> Vec<Named<'a>> {
    let Rays { query, singles, packets, .. } = rays;
    let (scene, query) = (&field.limit, *query);
    let ours = |accel: &'a dyn Accel, batches: &'a [RayBatch]| -> Box<dyn Contestant + 'a> {
        Box::new(Ours { accel, batches, query })
    };
    let mut all: Vec<Named<'a>> = Vec::new();
    if rays.are_coherent() {
        all.push((names::LIMIT_PACKETS, Box::new(LimitPackets { scene, packets, query })));
        all.push((names::EMBREE_PACKETS, ours(&field.embree, &rays.batches)));
    }
    all.push((names::LIMIT_SINGLE, Box::new(LimitSingles { scene, singles, query })));
    all.push((names::EMBREE_SINGLE, ours(&field.embree, &rays.scattered)));
    all.push((names::BVH, ours(&field.bvh, &rays.batches)));
    if let Some(exact) = &field.exact {
        all.push((names::EXACT, ours(exact, &rays.batches)));
    }
    all
}
