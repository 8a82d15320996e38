//! Another frame of a scene, as layers see it that compare two frames: its camera, its geometry, and the
//! structure that says what hides what.

use std::collections::HashMap;

use etendue_accel::Accel;
use etendue_camera::Camera;
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Detail, Geometry, HitBatch, MISS, Placement, RayBatch};
use etendue_scene::Scene;
use etendue_tracer::layer::{FrameStep, LayerContext, OtherFrame, Sight};

/// Share of a point's distance within which something nearer does not hide it: the point was
/// interpolated and its ray aimed with roundings of 10⁻¹⁵, which grazing surfaces stretch.
const SAME_DEPTH: f64 = 1e-9;

/// Looks for the row of a moving point; what moves by less than a row while one is read needs a few.
const STEPS: usize = 60;

/// Moments (s) that differ by less are one.
const SAME_MOMENT: f64 = 1e-12;

/// Another frame that layers are compared with.
#[derive(Debug, Clone)]
pub struct FollowedFrame<'a> {
    step: FrameStep,
    camera: &'a Camera,
    geometry: &'a Geometry,
    accel: &'a dyn Accel,
    /// Change of each placement of this frame, and its number there; `None` when all stand still.
    motions: Option<Vec<(PlacementChange, u32)>>,
}

/// Motion of a placement on the way to the other frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum PlacementChange {
    Still,
    Moved,
    /// Its mesh is another one, whose points have nothing to do with this one's.
    Gone,
}

impl<'a> FollowedFrame<'a> {
    /// The frame that is `step` on from `scene`: `other`, over whose geometry `accel` was built.
    #[must_use]
    pub fn new(step: FrameStep, scene: &Scene, other: &'a Scene, accel: &'a dyn Accel) -> Self {
        let (from, geometry) = (&*scene.geometry, &*other.geometry);
        let moves = from.moves() || geometry.moves();
        let motions = (moves || !from.has_surfaces_of(geometry)).then(|| {
            let there: HashMap<Name, u32> =
                (0..).zip(names(geometry)).map(|(i, n)| (n, i)).collect();
            let of = |(name, placement)| match there.get(&name) {
                Some(&number) => (motion(from, placement, geometry, number), number),
                None => (PlacementChange::Gone, MISS),
            };
            names(from).into_iter().zip(&from.placements).map(of).collect()
        });
        Self { step, camera: &other.camera, geometry, accel, motions }
    }

    /// True if there is something that cannot be followed, because its mesh is another one there.
    #[must_use]
    pub fn loses_some(&self) -> bool {
        self.motions
            .as_ref()
            .is_some_and(|motions| motions.iter().any(|one| one.0 == PlacementChange::Gone))
    }

    /// Change of a placement of this frame, and its number in the other one.
    fn motion(&self, number: u32) -> (PlacementChange, u32) {
        self.motions
            .as_ref()
            .map_or((PlacementChange::Still, number), |motions| motions[number as usize])
    }

    /// From the other camera, in its frame's pose, to the point of hit `i` (m) at `time` (s from the other frame's time).
    fn offset(&self, seen: &LayerContext<'_>, i: usize, time: f64) -> Option<DVec3> {
        let (traced, origin) = (seen.traced, self.camera.pose().position);
        let number = traced.hits.placement[i];
        if number == MISS {
            return None;
        }
        let (motion, number) = self.motion(number);
        match motion {
            PlacementChange::Still => {
                // Far from the world's origin the difference of the two cameras is what counts.
                let along = traced.rays.direction(i) * traced.hits.t[i];
                Some((traced.rays.origin(i) - origin) + along)
            }
            PlacementChange::Moved => {
                let placement = &self.geometry.placements[number as usize];
                let mesh = self.geometry.mesh_of(placement);
                let corners = mesh.corners_at(traced.hits.triangle[i] as usize, time);
                let (u, v) = (traced.hits.u[i], traced.hits.v[i]);
                let local =
                    corners[0] + u * (corners[1] - corners[0]) + v * (corners[2] - corners[0]);
                Some(placement.world_from_mesh_at(time).point_from(local, origin))
            }
            PlacementChange::Gone => None,
        }
    }

    /// The place in the other picture where the point of hit `i` arrives: the row says when it is seen, and that where
    /// it is.
    fn place(&self, seen: &LayerContext<'_>, i: usize) -> Option<[f64; 2]> {
        let [_, rows] = self.camera.resolution().map(f64::from);
        let mut time = self.camera.truth_time(0.5 * rows);
        let mut place = None;
        for _ in 0..STEPS {
            let found = self.camera.place_of(self.offset(seen, i, time)?)?;
            place = Some(found);
            let then = self.camera.truth_time(found[1]);
            if (then - time).abs() < SAME_MOMENT {
                break;
            }
            time = then;
        }
        place
    }

    fn is_in_picture(&self, [column, row]: [f64; 2]) -> bool {
        let [width, height] = self.camera.resolution().map(f64::from);
        (0.0..=width).contains(&column) && (0.0..=height).contains(&row)
    }
}

/// Name of a placement, whatever else is in the scene: its object, and which copy of it, which node
/// of that and which mesh of that it is.
type Name = [u32; 4];

/// The names of all placements. Copies and nodes are counted through all objects, so their numbers depend
/// on those before.
fn names(geometry: &Geometry) -> Vec<Name> {
    let mut names: Vec<Name> = Vec::with_capacity(geometry.placements.len());
    let before = std::iter::once(None).chain(geometry.placements.iter().map(Some));
    for (placement, before) in geometry.placements.iter().zip(before) {
        let name = match (before, names.last()) {
            (Some(before), Some(&[object, copy, node, mesh]))
                if before.object == placement.object =>
            {
                if before.instance != placement.instance {
                    [object, copy + 1, 0, 0]
                } else if before.node != placement.node {
                    [object, copy, node + 1, 0]
                } else {
                    [object, copy, node, mesh + 1]
                }
            }
            _ => [placement.object, 0, 0, 0],
        };
        names.push(name);
    }
    names
}

fn motion(from: &Geometry, placement: &Placement, to: &Geometry, number: u32) -> PlacementChange {
    let there = &to.placements[number as usize];
    let (mesh, mesh_there) = (from.mesh_of(placement), to.mesh_of(there));
    let is_same_mesh = mesh.has_surface_of(mesh_there);
    if mesh.triangles.len() != mesh_there.triangles.len() {
        return PlacementChange::Gone;
    }
    // A mesh of the same triangles with its corners elsewhere was bent.
    if !is_same_mesh && mesh.triangles[..] != mesh_there.triangles[..] {
        return PlacementChange::Gone;
    }
    let moves = placement.motion.is_some() || there.motion.is_some();
    match is_same_mesh && !moves && placement.world_from_mesh == there.world_from_mesh {
        true => PlacementChange::Still,
        false => PlacementChange::Moved,
    }
}

impl OtherFrame for FollowedFrame<'_> {
    fn step(&self) -> FrameStep {
        self.step
    }

    fn follow(&self, seen: &LayerContext<'_>, places: &mut Vec<Option<[f64; 2]>>) {
        places.clear();
        let rays = 0..seen.traced.rays.len();
        places.extend(rays.map(|i| self.place(seen, i)));
    }

    fn look_for(&self, seen: &LayerContext<'_>, sights: &mut Vec<Sight>) {
        let mut places = Vec::new();
        self.follow(seen, &mut places);
        sights.clear();
        sights.extend((0..places.len()).map(|i| match places[i] {
            _ if !seen.traced.hits.is_hit(i) => Sight::Miss,
            Some(place) if self.is_in_picture(place) => Sight::Visible,
            _ => Sight::Outside,
        }));
        let asked: Vec<usize> =
            (0..sights.len()).filter(|&i| sights[i] == Sight::Visible).collect();
        let at = |k: usize| asked.iter().filter_map(|&i| Some(places[i]?[k])).collect::<Vec<f64>>();
        let (mut rays, mut hits) = (RayBatch::default(), HitBatch::new(Detail::Distance));
        self.camera.rays_through(&at(0), &at(1), &mut rays);
        self.accel.closest(&rays, &mut hits);
        for (ray, &i) in asked.iter().enumerate() {
            let Some(offset) = self.offset(seen, i, rays.time(ray)) else { continue };
            let start = rays.origin(ray) - self.camera.pose().position;
            let distance = (offset - start).dot(rays.direction(ray));
            let (_, number) = self.motion(seen.traced.hits.placement[i]);
            let own = (number, seen.traced.hits.triangle[i]);
            let is_itself = (hits.placement[ray], hits.triangle[ray]) == own;
            if !is_itself && hits.t[ray] < distance * (1.0 - SAME_DEPTH) {
                sights[i] = Sight::Hidden;
            }
        }
    }
}
