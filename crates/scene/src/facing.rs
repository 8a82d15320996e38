//! From where a scene shows its fronts: rooms are looked into, and not at from behind their walls.
//!
//! From each side a coarse picture is drawn of which triangles are nearest, and whether their fronts
//! or their backs are seen. A view of backs is a view of something from its wrong side: the walls of a
//! room have their fronts inside.

use etendue_camera::{Pose, Subject, Viewpoint};
use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{Bounds, Geometry, Placement, Transform};

use crate::world_vertices::{WorldVertices, tight};

/// Columns and rows of a coarse picture.
const CELLS: usize = 48;

/// Above this share of backs another view is looked for. A cube without its front wall shows half of
/// them from the front right above; leaves and cloth show as many from anywhere, and stay.
const MOST_BACKS: f64 = 0.4;

/// A view is of one kind when this share of it is.
const MOSTLY: f64 = 0.9;

/// A scene of more triangles than these is looked at from the usual side: coarse pictures of it would
/// take seconds.
const MOST_TRIANGLES: u64 = 10_000_000;

/// Depth below the sides of the box from which something counts as inside of a room, as a share of the box.
const INSIDE: f64 = 0.1;

/// Subject that a camera without a pose has to frame, and its viewpoint.
pub(crate) fn subject<'a>(vertices: &'a WorldVertices<'a>) -> Subject<'a> {
    let geometry = vertices.geometry;
    let subject = Subject { points: Some(vertices), ..Subject::from(tight(*vertices)) };
    let bounds = subject.bounds;
    let is_box = !bounds.is_empty() && (bounds.max - bounds.min).is_finite();
    if !is_box || bounds.diagonal() == 0.0 || geometry.triangles() > MOST_TRIANGLES {
        return subject;
    }
    let usual = CoarseCounts::of(geometry, bounds, &subject.view());
    if usual.backs() <= MOST_BACKS {
        return subject;
    }
    Subject { viewpoint: viewpoint(vertices, &subject), ..subject }
}

/// From where to look at something that turns its back to the usual view.
fn viewpoint(vertices: &WorldVertices<'_>, subject: &Subject<'_>) -> Viewpoint {
    let (geometry, bounds) = (vertices.geometry, subject.bounds);
    if let Some(axis) = subject.flat_axis() {
        // Land is seen from above, whichever way its triangles face.
        return match axis {
            1 => Viewpoint::Usual,
            _ => Viewpoint::Side(-DVec3::AXES[axis]),
        };
    }
    let mut is_closed = true;
    for side in [DVec3::Z, DVec3::NEG_Z, DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y] {
        if !(vertices.go_on)() {
            return Viewpoint::Usual;
        }
        let view = Subject { viewpoint: Viewpoint::Side(side), ..*subject }.view();
        let seen = CoarseCounts::of(geometry, bounds, &view);
        if seen.backs() < 1.0 - MOSTLY && (side.y == 0.0 || seen.is_full() && is_low(bounds)) {
            return Viewpoint::Side(side);
        }
        is_closed &= seen.backs() > MOSTLY && seen.is_full();
    }
    if is_closed && has_something_inside(geometry, bounds) {
        return Viewpoint::Within(place_within(geometry, bounds, subject.view().forward()));
    }
    Viewpoint::Usual
}

/// True if something is no higher than it is wide or deep: only then is it looked at from above or
/// below, into a room without a ceiling. Trees and towers are seen from the side, though their
/// leaves and roofs show their fronts to the sky.
fn is_low(bounds: Bounds) -> bool {
    let size = bounds.max - bounds.min;
    size.y <= size.x.max(size.z)
}

/// Counts of what a coarse parallel picture shows.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct CoarseCounts {
    fronts: u32,
    backs: u32,
    nothing: u32,
}

impl CoarseCounts {
    /// A picture of `bounds` in the direction of `view`.
    fn of(geometry: &Geometry, bounds: Bounds, view: &Pose) -> Self {
        let mut picture = Coarse::new(bounds, view);
        for placement in &geometry.placements {
            picture.draw(geometry, placement);
        }
        let mut seen = Self::default();
        for (_, front) in &picture.nearest {
            match front {
                Some(true) => seen.fronts += 1,
                Some(false) => seen.backs += 1,
                None => seen.nothing += 1,
            }
        }
        seen
    }

    /// Share of backs in what is seen.
    fn backs(self) -> f64 {
        f64::from(self.backs) / f64::from(self.fronts + self.backs).max(1.0)
    }

    /// True if nothing of the box's outline is seen through.
    fn is_full(self) -> bool {
        f64::from(self.nothing) < (1.0 - MOSTLY) * f64::from(self.fronts + self.backs)
    }
}

/// A parallel picture of a few cells: how near the nearest triangle is, and whether its front is seen.
struct Coarse {
    /// From the world to cells (x, y) and towards the viewer (z, m).
    cells_from_world: Transform,
    nearest: Vec<(f64, Option<bool>)>,
}

impl Coarse {
    fn new(bounds: Bounds, view: &Pose) -> Self {
        let turn = view.rotation.transpose();
        let centre = bounds.centre();
        let seen = bounds.corners().map(|corner| turn * (corner - centre));
        let half = seen.iter().fold(DVec3::ZERO, |half, p| half.max(p.abs()));
        let scale = |half: f64| if half > 0.0 { 0.5 * CELLS as f64 / half } else { 1.0 };
        let linear = DMat3::from_diagonal(DVec3::new(scale(half.x), scale(half.y), 1.0)) * turn;
        let middle = DVec3::new(0.5 * CELLS as f64, 0.5 * CELLS as f64, 0.0);
        Self {
            cells_from_world: Transform::new(linear, middle - linear * centre),
            nearest: vec![(f64::NEG_INFINITY, None); CELLS * CELLS],
        }
    }

    fn draw(&mut self, geometry: &Geometry, placement: &Placement) {
        let mesh = geometry.mesh_of(placement);
        let cells_from_mesh = self.cells_from_world.then_inner(&placement.world_from_mesh);
        let handedness = placement.world_from_mesh.handedness();
        for triangle in 0..mesh.triangles.len() {
            let corners = mesh.corners(triangle).map(|corner| cells_from_mesh.point(corner));
            self.draw_triangle(corners, handedness);
        }
    }

    /// Draws a triangle of corners in cells; its front is where they run counter-clockwise, unless
    /// mirrored.
    fn draw_triangle(&mut self, [a, b, c]: [DVec3; 3], handedness: f64) {
        let (ab, ac) = (b - a, c - a);
        let area = ab.x * ac.y - ab.y * ac.x;
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        if area == 0.0 || !area.is_finite() || !(low.is_finite() && high.is_finite()) {
            return;
        }
        let front = area * handedness > 0.0;
        // Cells whose middle is within the triangle's box; the casts saturate.
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "see above")]
        let range = |low: f64, high: f64| {
            let first = (low - 0.5).ceil().max(0.0) as usize;
            first..((high + 0.5).floor().max(0.0) as usize).min(CELLS)
        };
        for row in range(low.y, high.y) {
            for column in range(low.x, high.x) {
                let (x, y) = (column as f64 + 0.5 - a.x, row as f64 + 0.5 - a.y);
                let u = (x * ac.y - y * ac.x) / area;
                let v = (ab.x * y - ab.y * x) / area;
                let depth = a.z + u * ab.z + v * ac.z;
                let cell = &mut self.nearest[row * CELLS + column];
                if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && depth > cell.0 {
                    *cell = (depth, Some(front));
                }
            }
        }
    }
}

/// True if some triangle stands clear of the sides of the box.
fn has_something_inside(geometry: &Geometry, bounds: Bounds) -> bool {
    let margin = (bounds.max - bounds.min) * INSIDE;
    let (low, high) = (bounds.min + margin, bounds.max - margin);
    let is_inside = |p: DVec3| p.cmpgt(low).all() && p.cmplt(high).all();
    geometry.placements.iter().any(|placement| {
        let mesh = geometry.mesh_of(placement);
        let world = |corner| placement.world_from_mesh.point(corner);
        (0..mesh.triangles.len()).any(|t| mesh.corners(t).map(world).into_iter().all(is_inside))
    })
}

/// The near end of the longest free way along the line of sight through the box's centre, of those
/// that begin before it: just behind the wall, as a rule.
fn place_within(geometry: &Geometry, bounds: Bounds, forward: DVec3) -> DVec3 {
    /// Off the wall, as a share of the free way.
    const STEP: f64 = 0.02;
    let centre = bounds.centre();
    let mut walls: Vec<f64> = Vec::new();
    for placement in &geometry.placements {
        let mesh = geometry.mesh_of(placement);
        for triangle in 0..mesh.triangles.len() {
            let [a, b, c] =
                mesh.corners(triangle).map(|p| placement.world_from_mesh.point(p) - centre);
            let normal = (b - a).cross(c - a);
            let along = a.dot(normal) / forward.dot(normal);
            let at = forward * along;
            let inside = [(a, b), (b, c), (c, a)]
                .iter()
                .all(|(p, q)| (*q - *p).cross(at - *p).dot(normal) >= 0.0);
            if along.is_finite() && inside {
                walls.push(along);
            }
        }
    }
    walls.sort_by(f64::total_cmp);
    let ways = walls.windows(2).filter(|way| way[0] < 0.0);
    let longest = ways.max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])));
    let start = longest.map_or(0.0, |way| way[0] + STEP * (way[1] - way[0]));
    centre + forward * start.min(0.0)
}

#[cfg(test)]
mod tests {
    use etendue_geometry::{Mesh, Positions, Vertices};

    use super::*;

    fn viewpoint_of(geometry: &Geometry) -> Viewpoint {
        subject(&geometry.into()).viewpoint
    }

    /// The corner of a box of these half-sides whose number's bits are x, y and z.
    fn corner(half: [f32; 3], number: u32) -> [f32; 3] {
        [0, 1, 2].map(|axis| if number >> axis & 1 == 1 { half[axis] } else { -half[axis] })
    }

    /// A box whose fronts are outside; `sides` are −x, +x, −y, +y, −z, +z.
    fn sides(half: [f32; 3], sides: &[usize]) -> Mesh {
        const CORNERS: [[u32; 4]; 6] =
            [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let positions: Vec<[f32; 3]> = (0..8).map(|k| corner(half, k)).collect();
        let two = |&side: &usize| {
            let [a, b, c, d] = CORNERS[side];
            [[a, b, c], [a, c, d]]
        };
        let triangles: Vec<[u32; 3]> = sides.iter().flat_map(two).collect();
        Mesh::new("", Positions::F32(Vertices::from_arrays(&positions)), triangles.into())
    }

    fn at(mesh: u32, scale: DVec3, place: DVec3) -> Placement {
        let world_from_mesh = Transform::new(DMat3::from_diagonal(scale), place);
        Placement::of(mesh, world_from_mesh)
    }

    /// A box of the given sides, turned inside out by a map that leaves its triangles alone, and what
    /// else is in it.
    fn room(open: &[usize], furniture: bool) -> Geometry {
        let walls: Vec<usize> = (0..6).filter(|side| !open.contains(side)).collect();
        let mut mesh = sides([2.0, 1.5, 3.0], &walls);
        let turned: Vec<[u32; 3]> = mesh.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
        mesh = Mesh::new("", mesh.positions, turned.into());
        let mut placements = vec![at(0, DVec3::ONE, DVec3::new(7.0, 0.0, 0.0))];
        if furniture {
            placements.push(at(1, DVec3::ONE, DVec3::new(7.0, -0.4, 0.0)));
        }
        Geometry { meshes: vec![mesh, sides([0.4; 3], &[0, 1, 2, 3, 4, 5])], placements }
    }

    #[test]
    fn solids_are_seen_from_the_usual_side() {
        let all = [0, 1, 2, 3, 4, 5];
        for scale in [DVec3::ONE, DVec3::new(-1.0, 1.0, 1.0), DVec3::splat(-2.0)] {
            let geometry = Geometry {
                meshes: vec![sides([1.0, 2.0, 3.0], &all)],
                placements: vec![at(0, scale, DVec3::X)],
            };
            assert_eq!(viewpoint_of(&geometry), Viewpoint::Usual, "{scale}");
        }
        assert_eq!(viewpoint_of(&Geometry::default()), Viewpoint::Usual);
    }

    #[test]
    fn a_room_with_an_open_side_is_looked_into() {
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        for open in 0..6 {
            let out = axes[open / 2] * if open % 2 == 0 { -1.0 } else { 1.0 };
            for furniture in [false, true] {
                let found = viewpoint_of(&room(&[open], furniture));
                assert_eq!(found, Viewpoint::Side(out), "open at {out}");
            }
        }
    }

    #[test]
    fn a_closed_room_is_seen_from_within() {
        let geometry = room(&[], true);
        let vertices = WorldVertices::from(&geometry);
        let subject = subject(&vertices);
        let Viewpoint::Within(place) = subject.viewpoint else { panic!("{subject:?}") };
        let (low, high) = (subject.bounds.min, subject.bounds.max);
        assert!(place.cmpgt(low).all() && place.cmplt(high).all(), "{place}");
        let ahead = (subject.bounds.centre() - place).dot(subject.view().forward());
        assert!(ahead > 0.5, "the middle is in front: {ahead}");
    }

    /// Leaves around the top of a trunk, tilted outwards: single triangles whose fronts look up.
    fn palm(height: f32, leaves: u32) -> Geometry {
        let mut positions = Vec::new();
        let mut triangles = Vec::new();
        for leaf in 0..leaves {
            let angle = |k: f32| std::f32::consts::TAU * (leaf as f32 + k) / leaves as f32;
            let first = u32::try_from(positions.len()).unwrap();
            positions.push([0.0, height, 0.0]);
            for k in [0.9, 0.0] {
                let (sin, cos) = angle(k).sin_cos();
                positions.push([cos, 0.5 * height, sin]);
            }
            triangles.push([first, first + 1, first + 2]);
        }
        let mesh =
            Mesh::new("", Positions::F32(Vertices::from_arrays(&positions)), triangles.into());
        Geometry { meshes: vec![mesh], placements: vec![at(0, DVec3::ONE, DVec3::ZERO)] }
    }

    #[test]
    fn a_tree_is_seen_from_the_side() {
        for height in [2.0, 5.0] {
            for leaves in [6, 40] {
                let geometry = palm(height, leaves);
                let vertices = WorldVertices::from(&geometry);
                let up = subject(&vertices).view().forward().y.abs();
                assert!(up < 0.7, "{leaves} leaves at {height}: looked at along {up}");
            }
        }
    }

    /// Nothing tells an empty shell from a box whose triangles are wound the wrong way.
    #[test]
    fn an_empty_shell_is_seen_from_outside() {
        assert_eq!(viewpoint_of(&room(&[], false)), Viewpoint::Usual);
    }

    #[test]
    fn sheets_are_seen_from_their_front_and_land_from_above() {
        for (side, towards) in [(0, DVec3::NEG_X), (4, DVec3::NEG_Z)] {
            let mut half = [1.0; 3];
            half[side / 2] = 0.0;
            let geometry = Geometry {
                meshes: vec![sides(half, &[side])],
                placements: vec![at(0, DVec3::ONE, DVec3::ZERO)],
            };
            assert_eq!(viewpoint_of(&geometry), Viewpoint::Side(towards));
        }
        let land = Geometry {
            meshes: vec![sides([1.0, 0.0, 1.0], &[2])],
            placements: vec![at(0, DVec3::ONE, DVec3::ZERO)],
        };
        assert_eq!(viewpoint_of(&land), Viewpoint::Usual);
    }
}
