//! The thinnest bodies, walls and gaps that light goes through, against how far f32 moves the rays that leave their
//! surfaces: a ray that starts behind the next surface skips it.
//!
//! From places on each triangle that light crosses, or that lies beside one, a probe goes along its normal to both sides,
//! as far as such a start can reach. All triangles near are held against all probes once, through a grid of the
//! probes' places, so it costs some ten nanoseconds a triangle. Of meshes of very many triangles probes are of every
//! so-manieth: what is thin over a thousandth of its surface is found, and a mere contact (a ball on a floor) does not
//! count.

use etendue_geometry::glam::{DVec3, UVec3};
use etendue_geometry::{Bounds, HitPrecision, Placement};
use etendue_scene::Scene;
use etendue_tracer::Material;
use etendue_tracer::material::Alpha;
use etendue_tracer::spawn::{magnitudes, roundings};

/// Triangles up to which each is probed in four places. Not a setting: how many are probed at all is one
/// (`path_probes`).
const FEW: usize = 4096;

/// Cells of the grid of probes along an axis.
const CELLS: u32 = 32;

/// Crossed placements up to which the boxes of others are held against each.
const MOST_BOXES: usize = 1024;

/// A thin place: how far it is to the next surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Gap {
    /// m.
    pub(crate) distance: f64,
    /// Distance (m) by which f32 moves the start of a ray there.
    pub(crate) offset: f64,
    /// The placements of the surfaces on both sides; twice the same of a body or wall.
    pub(crate) between: [usize; 2],
}

/// Surfaces that light crosses where f32 moves rays.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct CrossedSurfaces {
    /// The thinnest place that is too thin for f32.
    pub(crate) gap: Option<Gap>,
    /// The greatest change of what a medium takes (a share), and the placement whose it is.
    pub(crate) absorption: Option<(f64, usize)>,
    /// A placement that is too small for f32: its extent and how far rays start off it (m).
    pub(crate) small: Option<([f64; 2], usize)>,
    /// The distance (m) above which surfaces that light crosses are; `None` where it crosses none.
    pub(crate) cleared: Option<f64>,
}

/// True if light goes through a surface.
fn lets_pass(material: &Material) -> bool {
    material.scattering.lets_pass() || matches!(material.alpha, Alpha::Blend { .. })
}

/// Distances by which rays start off surfaces in f32, by where those are.
struct Offsets {
    /// The farthest that a ray comes from (m from the world's origin).
    farthest: f64,
}

impl Offsets {
    /// At a point of a placement (m), `own` being its [`magnitudes`].
    fn at(&self, point: DVec3, own: f64) -> f64 {
        roundings(HitPrecision::Single) * (point.length() + self.farthest + own)
    }
}

/// A place from which it is looked along the normal to both sides.
struct NormalProbe {
    point: DVec3,
    normal: DVec3,
    /// Distance up to which it looks, and the distance within which it is the same place (m).
    reach: f64,
    least: f64,
    area: f64,
    placement: usize,
    triangle: usize,
    found: Option<(f64, usize)>,
}

/// A placement that light crosses, or that is beside one.
struct Near<'a> {
    placement: &'a Placement,
    index: usize,
    is_crossed: bool,
}

/// Finds what is thin among the surfaces that light crosses; rays come from no farther than
/// `farthest` (m) from the world's origin.
pub(crate) fn crossed_surfaces(scene: &Scene, farthest: f64) -> CrossedSurfaces {
    let offsets = Offsets { farthest };
    let geometry = &scene.geometry;
    let material = |p: &Placement| scene.materials.get(p.material as usize);
    let is_crossed = |p: &Placement| material(p).is_some_and(lets_pass);
    let own = |p: &Placement| magnitudes(p, geometry.mesh_of(p)).length();
    let mut found = CrossedSurfaces::default();
    // The boxes of what light crosses, as far as a start may be moved, and what absorbs.
    let mut boxes: Vec<Bounds> = Vec::new();
    for (index, placement) in geometry.placements.iter().enumerate() {
        let bounds = geometry.loose_bounds_of(placement);
        if !is_crossed(placement) || bounds.is_empty() {
            continue;
        }
        let corner = bounds.min.abs().max(bounds.max.abs());
        let offset = offsets.at(corner, own(placement));
        let reach = scene.accuracy.path_clearance * offset;
        let extent = (bounds.max - bounds.min).max_element();
        if offset > scene.accuracy.path_offset_of_extent * extent && found.small.is_none() {
            found.small = Some(([extent, offset], index));
        }
        boxes.push(Bounds { min: bounds.min - reach, max: bounds.max + reach });
        found.cleared = Some(found.cleared.unwrap_or(0.0).max(reach));
        let absorption = material(placement).and_then(Material::absorption);
        if let Some(absorption) = absorption {
            let least = absorption.color.into_iter().filter(|c| *c > 0.0).fold(1.0, f64::min);
            let share = -least.ln() * offset / absorption.distance;
            if found.absorption.is_none_or(|(most, _)| share > most) {
                found.absorption = Some((share, index));
            }
        }
    }
    if boxes.is_empty() {
        return found;
    }
    if boxes.len() > MOST_BOXES {
        boxes = vec![boxes.into_iter().fold(Bounds::EMPTY, Bounds::union)];
    }
    let is_near = |bounds: &Bounds| boxes.iter().any(|own| meet(own, bounds));
    let near = geometry.placements.iter().enumerate().filter_map(|(index, placement)| {
        let near = Near { placement, index, is_crossed: is_crossed(placement) };
        let bounds = geometry.loose_bounds_of(placement);
        (near.is_crossed || (!bounds.is_empty() && is_near(&bounds))).then_some(near)
    });
    let near: Vec<Near<'_>> = near.collect();
    let mut probes = probes(scene, &near, &offsets, &is_near);
    probe(scene, &near, &mut probes);
    found.gap = thinnest(&probes, &offsets, scene);
    found
}

fn meet(a: &Bounds, b: &Bounds) -> bool {
    a.min.cmple(b.max).all() && b.min.cmple(a.max).all()
}

/// The corners of a triangle in the world (m).
fn corners(scene: &Scene, placement: &Placement, triangle: usize) -> [DVec3; 3] {
    let mesh = scene.geometry.mesh_of(placement);
    mesh.corners(triangle).map(|corner| placement.world_from_mesh.point(corner))
}

fn probes(
    scene: &Scene,
    near: &[Near<'_>],
    offsets: &Offsets,
    is_near: &dyn Fn(&Bounds) -> bool,
) -> Vec<NormalProbe> {
    /// The middle, and places towards each corner.
    const PLACES: [[f64; 3]; 4] = [
        [1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0],
        [0.7, 0.19, 0.11],
        [0.11, 0.7, 0.19],
        [0.19, 0.11, 0.7],
    ];
    let count = |near: &Near<'_>| scene.geometry.mesh_of(near.placement).triangles.len();
    let all: usize = near.iter().map(count).sum();
    let step = all.div_ceil(scene.accuracy.path_probes as usize).max(1);
    let places = if all <= FEW { &PLACES[..] } else { &PLACES[..1] };
    let mut probes = Vec::new();
    let mut number = 0;
    for near in near {
        let own = magnitudes(near.placement, scene.geometry.mesh_of(near.placement)).length();
        let first = (step - number % step) % step;
        number += count(near);
        for triangle in (first..count(near)).step_by(step) {
            let [a, b, c] = corners(scene, near.placement, triangle);
            let twice = (b - a).cross(c - a);
            let Some(normal) = twice.try_normalize() else { continue };
            if !near.is_crossed && !is_near(&Bounds::of_points([a, b, c])) {
                continue;
            }
            for [x, y, z] in places {
                let point = a * *x + b * *y + c * *z;
                let offset = offsets.at(point, own);
                let same = roundings(HitPrecision::Double) / roundings(HitPrecision::Single);
                probes.push(NormalProbe {
                    point,
                    normal,
                    reach: scene.accuracy.path_clearance * offset,
                    least: offset * same,
                    area: twice.length(),
                    placement: near.index,
                    triangle,
                    found: None,
                });
            }
        }
    }
    probes
}

/// Holds every triangle that is near against the probes about it.
fn probe(scene: &Scene, near: &[Near<'_>], probes: &mut [NormalProbe]) {
    let mut bounds = Bounds::EMPTY;
    probes.iter().for_each(|probe| bounds.include(probe.point));
    let most = probes.iter().map(|probe| probe.reach).fold(0.0, f64::max);
    let size = (bounds.max - bounds.min).max(DVec3::splat(f64::MIN_POSITIVE));
    let cell = |point: DVec3| {
        let share = (point - bounds.min) / size * f64::from(CELLS);
        share.clamp(DVec3::ZERO, DVec3::splat(f64::from(CELLS - 1))).as_uvec3()
    };
    let number = |cell: UVec3| ((cell.x * CELLS + cell.y) * CELLS + cell.z) as usize;
    // With each its place, by which nearly all are left out.
    let mut grid: Vec<Vec<(DVec3, u32)>> = vec![Vec::new(); CELLS.pow(3) as usize];
    for (i, probe) in (0..).zip(probes.iter()) {
        grid[number(cell(probe.point))].push((probe.point, i));
    }
    for near in near {
        for triangle in 0..scene.geometry.mesh_of(near.placement).triangles.len() {
            let corners = corners(scene, near.placement, triangle);
            let own = Bounds::of_points(corners);
            let grown = Bounds { min: own.min - most, max: own.max + most };
            if !meet(&grown, &bounds) {
                continue;
            }
            let (from, to) = (cell(grown.min), cell(grown.max));
            for x in from.x..=to.x {
                for y in from.y..=to.y {
                    for z in from.z..=to.z {
                        for &(point, i) in &grid[number(UVec3::new(x, y, z))] {
                            let is_within =
                                point.cmpge(grown.min).all() & point.cmple(grown.max).all();
                            if !is_within {
                                continue;
                            }
                            hold(&mut probes[i as usize], near, triangle, corners, scene);
                        }
                    }
                }
            }
        }
    }
}

/// Holds a triangle against a probe. Of two surfaces light crosses at least one.
fn hold(
    probe: &mut NormalProbe,
    near: &Near<'_>,
    triangle: usize,
    [a, b, c]: [DVec3; 3],
    scene: &Scene,
) {
    /// Shares of a triangle beyond its edges: a probe at the edge of two meets one of them.
    const BEYOND: f64 = 1e-9;
    if (probe.placement, probe.triangle) == (near.index, triangle) {
        return;
    }
    let normal = probe.normal;
    let (e, f, s) = (b - a, c - a, probe.point - a);
    let (h, q) = (normal.cross(f), s.cross(e));
    let inverse = 1.0 / e.dot(h);
    let (u, v, t) = (s.dot(h) * inverse, normal.dot(q) * inverse, f.dot(q) * inverse);
    let is_met = u >= -BEYOND && v >= -BEYOND && u + v <= 1.0 + BEYOND;
    let distance = t.abs();
    if !(is_met && distance > probe.least && distance < probe.reach) {
        return;
    }
    let own = &scene.geometry.placements[probe.placement];
    let crosses = scene.materials.get(own.material as usize).is_some_and(lets_pass);
    if (crosses || near.is_crossed) && probe.found.is_none_or(|(least, _)| distance < least) {
        probe.found = Some((distance, near.index));
    }
}

/// The thinnest place against its offset, of placements that are thin over more than contacts.
fn thinnest(probes: &[NormalProbe], offsets: &Offsets, scene: &Scene) -> Option<Gap> {
    let mut gap: Option<Gap> = None;
    // Probes of a placement stand together.
    for own in probes.chunk_by(|a, b| a.placement == b.placement) {
        let area: f64 = own.iter().map(|probe| probe.area).sum();
        let thin = own.iter().filter(|probe| probe.found.is_some()).map(|probe| probe.area);
        if thin.sum::<f64>() <= scene.accuracy.path_contact * area {
            continue;
        }
        for probe in own {
            let Some((distance, other)) = probe.found else { continue };
            let placement = &scene.geometry.placements[probe.placement];
            let numbers = magnitudes(placement, scene.geometry.mesh_of(placement)).length();
            let offset = offsets.at(probe.point, numbers);
            if gap.is_none_or(|gap| distance / offset < gap.distance / gap.offset) {
                gap = Some(Gap { distance, offset, between: [probe.placement, other] });
            }
        }
    }
    gap
}
