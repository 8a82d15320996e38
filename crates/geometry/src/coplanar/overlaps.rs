//! The triangles that lie over one, and which of them are near a place.

use glam::DVec3;

use crate::batch::PlacedTriangle;
use crate::{Bounds, Geometry};

/// The triangles over one.
#[derive(Debug, Clone, Default)]
pub(super) struct Overlaps {
    pub(super) all: Vec<PlacedTriangle>,
    /// The box of each (m), as much larger as planes may be apart.
    boxes: Vec<Bounds>,
    /// The axis along which they reach farthest, by whose lower ends they are in order; and how wide the widest is.
    axis: usize,
    widest: f64,
    /// Grid of the places that they cover; `None` where they are few.
    grid: Option<OverlapGrid>,
}

/// As many triangles are looked through.
const FEW: usize = 8;

/// Cells of a grid on a side.
const CELLS: usize = 64;

/// A grid over the two longest sides of the box of some triangles: a bit tells that a triangle's box meets a cell. A floor
/// on which things stand has many small triangles over it, and most places of it none.
#[derive(Debug, Clone)]
struct OverlapGrid {
    whole: Bounds,
    axes: [usize; 2],
    /// Cells in a metre.
    scale: [f64; 2],
    rows: Box<[u64; CELLS]>,
}

impl OverlapGrid {
    /// Those of boxes within `whole`.
    fn of(boxes: &[Bounds], whole: Bounds) -> Self {
        let size = whole.max - whole.min;
        let shortest = size.min_position();
        let axes = [(shortest + 1) % 3, (shortest + 2) % 3];
        let scale = axes.map(|axis| CELLS as f64 / size[axis].max(f64::MIN_POSITIVE));
        let mut cells = Self { whole, axes, scale, rows: Box::new([0; CELLS]) };
        for own in boxes {
            let [columns, rows] = cells.between(own.min, own.max);
            for row in &mut cells.rows[rows[0]..=rows[1]] {
                *row |= bits(columns);
            }
        }
        cells
    }

    /// The first and the last columns and rows between two corners (m). What is outside counts to the outermost ones.
    fn between(&self, low: DVec3, high: DVec3) -> [[usize; 2]; 2] {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "of a grid")]
        let cell = |k: usize, at: f64| {
            (((at - self.whole.min[self.axes[k]]) * self.scale[k]) as usize).min(CELLS - 1)
        };
        [0, 1].map(|k| [low, high].map(|corner| cell(k, corner[self.axes[k]])))
    }

    /// True if a triangle's box may come within `slack` of `point` (m).
    fn may_be_near(&self, point: DVec3, slack: f64) -> bool {
        if !is_near(&self.whole, point, slack) {
            return false;
        }
        let [columns, rows] = self.between(point - slack, point + slack);
        self.rows[rows[0]..=rows[1]].iter().any(|row| row & bits(columns) != 0)
    }
}

/// The bits from one to another.
fn bits([first, last]: [usize; 2]) -> u64 {
    (u64::MAX >> (CELLS - 1 - (last - first))) << first
}

impl Overlaps {
    /// Puts the triangles, whose planes may be so far apart (m), in order, each once.
    pub(super) fn settle(&mut self, geometry: &Geometry, apart: f64) {
        self.all.sort_unstable();
        self.all.dedup();
        let boxed = |id: &PlacedTriangle| {
            let own = Bounds::of_points(corners(geometry, *id));
            Bounds { min: own.min - apart, max: own.max + apart }
        };
        let whole = self.all.iter().map(boxed).fold(Bounds::EMPTY, Bounds::union);
        let axis = (whole.max - whole.min).max_position();
        self.all.sort_by(|a, b| boxed(a).min[axis].total_cmp(&boxed(b).min[axis]));
        self.boxes = self.all.iter().map(boxed).collect();
        self.widest =
            self.boxes.iter().map(|own| own.max[axis] - own.min[axis]).fold(0.0, f64::max);
        self.axis = axis;
        self.grid = (self.all.len() > FEW).then(|| OverlapGrid::of(&self.boxes, whole));
    }

    /// Those that may come within `slack` of `point` (m).
    pub(super) fn near(&self, point: DVec3, slack: f64) -> impl Iterator<Item = PlacedTriangle> {
        let is_any_near = self.grid.as_ref().is_none_or(|grid| grid.may_be_near(point, slack));
        let boxes = if is_any_near { &self.boxes[..] } else { &[] };
        let (at, axis) = (point[self.axis], self.axis);
        let first = boxes.partition_point(|own| own.min[axis] + self.widest + slack < at);
        let near = boxes[first..].iter().take_while(move |own| own.min[axis] - slack <= at);
        let near = self.all[first..].iter().zip(near);
        near.filter(move |(_, own)| is_near(own, point, slack)).map(|(&other, _)| other)
    }
}

/// The corners of a triangle where it stands (m).
pub(super) fn corners(geometry: &Geometry, [placement, triangle]: PlacedTriangle) -> [DVec3; 3] {
    let placement = &geometry.placements[placement as usize];
    let mesh = geometry.mesh_of(placement);
    mesh.corners(triangle as usize).map(|corner| placement.world_from_mesh.point(corner))
}

/// True if a point comes within `slack` of a box (m).
fn is_near(own: &Bounds, point: DVec3, slack: f64) -> bool {
    (own.min - slack).cmple(point).all() && (own.max + slack).cmpge(point).all()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Coplanar, Mesh, Placement, Positions, Transform, Vertices};

    /// Triangles in the plane z = 0, each by its corners (m).
    fn flat(corners: &[[f32; 2]]) -> Mesh {
        let corners: Vec<[f32; 3]> = corners.iter().map(|&[x, y]| [x, y, 0.0]).collect();
        let triangle = |k: usize| [0, 1, 2].map(|i| u32::try_from(3 * k + i).unwrap());
        let triangles: Vec<[u32; 3]> = (0..corners.len() / 3).map(triangle).collect();
        Mesh::new("flat", Positions::F32(Vertices::from_arrays(&corners)), triangles.into())
    }

    /// Of small triangles all over a part of a large one those are found that are near a place, wherever that is: the grid
    /// leaves none out, and tells that there are none where all are far away.
    #[test]
    fn triangles_over_another_are_found_near_any_place() {
        let large = flat(&[[-4.0, -4.0], [8.0, -4.0], [-4.0, 8.0]]);
        let mut corners = Vec::new();
        for k in 0..460_u16 {
            let [x, y] = [f32::from(k % 23) * 0.031, f32::from(k / 23) * 0.047];
            corners.extend([[x, y], [x + 0.02, y], [x, y + 0.03]]);
        }
        let place = |mesh| Placement::of(mesh, Transform::IDENTITY);
        let geometry =
            Geometry { meshes: vec![large, flat(&corners)], placements: vec![place(0), place(1)] };
        let coplanar = Coplanar::of(&geometry);
        let over = coplanar.over([0, 0]).unwrap();
        assert!(over.grid.is_some() && over.all.len() == corners.len() / 3);
        let (mut near, mut far) = (0, 0);
        for i in 0..4000_u32 {
            let [u, v] = [0.754_877_666, 0.569_840_290].map(|step| (step * f64::from(i)).fract());
            let point = DVec3::new(3.0 * u - 1.0, 3.0 * v - 1.0, 0.0);
            let slack = [0.0, 1e-6, 0.05, f64::INFINITY][i as usize % 4];
            let all = over.all.iter().zip(&over.boxes);
            let wanted: Vec<PlacedTriangle> =
                all.filter(|(_, own)| is_near(own, point, slack)).map(|(&id, _)| id).collect();
            let found: Vec<PlacedTriangle> = coplanar.others_near([0, 0], point, slack).collect();
            assert_eq!(found, wanted, "{point} within {slack}");
            near += u32::from(!found.is_empty());
            far += u32::from(!over.grid.as_ref().unwrap().may_be_near(point, slack));
        }
        assert!(near > 1000 && far > 1000, "{near} {far}");
    }
}
