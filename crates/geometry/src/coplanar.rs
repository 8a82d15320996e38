//! Triangles of different placements that lie in one plane, over one another: a lamp in a floor, a decal on a wall.
//!
//! Which of them a ray meets first is nobody's to say but a rule's, and single precision cannot tell them apart. They
//! are found once: the triangles of placements whose boxes meet are sorted by the distance of their planes from one
//! place, and those of one distance are compared along the longest axis.

use std::collections::{BTreeMap, HashMap};
use std::hash::{DefaultHasher, Hash, Hasher};

use glam::DVec3;

use self::overlaps::{Overlaps, corners};
use crate::batch::PlacedTriangle;
use crate::{Bounds, Geometry, Placement};

mod overlaps;

/// Greatest distance (units of 2⁻²³ of the largest coordinate) at which two planes are taken for one that
/// single precision cannot tell apart.
const APART: f64 = 4.0 * f32::EPSILON as f64;

/// The least share of the shorter edge that two triangles must overlap by: neighbours that share an edge do not.
const OVERLAP: f64 = 1e-6;

/// Cells of planes, of so many times [`APART`].
const KEYS: f64 = 8.0;

/// Placements of scenes in which none are looked for, and pairs of placements and of triangles, and triangles looked at,
/// after which no more are.
const MOST_PLACED: usize = 1 << 16;
const MOST_PLACEMENTS: usize = 1 << 18;
const MOST_TRIANGLES: usize = 1 << 24;
const MOST_VISITS: usize = 1 << 23;

/// For each triangle the others in its plane that lie over it, of other placements.
#[derive(Debug, Clone, Default)]
pub struct Coplanar {
    others: BTreeMap<PlacedTriangle, Overlaps>,
    /// By placement a bit a triangle: it has others over it. Empty where none has.
    covered: Vec<Vec<u64>>,
    /// The last placement of the same mesh in the very same place, by placement; empty where no two are.
    last: Vec<u32>,
}

/// A triangle that may lie in one plane with one of another placement, in one number, as there may be millions: the
/// cell of the plane's distance from the middle of all, the placement and the triangle, from the high bits on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct CoplanarityKey(u64);

/// Bits of a placement and of a triangle.
const PLACEMENT: u32 = MOST_PLACED.trailing_zeros();
const TRIANGLE: u32 = MOST_VISITS.trailing_zeros();

/// Cells before and behind the middle; planes beyond them, of triangles that reach far out of what is shared, are
/// in the outermost ones, and compared.
const MOST_CELLS: f64 = (1_u64 << (63 - PLACEMENT - TRIANGLE)) as f64;

impl CoplanarityKey {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the cells"
    )]
    fn new(cell: f64, [placement, triangle]: PlacedTriangle) -> Self {
        let cell = (cell.floor() + MOST_CELLS).clamp(0.0, 2.0 * MOST_CELLS - 1.0) as u64;
        let place = u64::from(placement) << TRIANGLE;
        Self(cell << (PLACEMENT + TRIANGLE) | place | u64::from(triangle))
    }

    fn cell(self) -> u64 {
        self.0 >> (PLACEMENT + TRIANGLE)
    }

    #[expect(clippy::cast_possible_truncation, reason = "the bits of a placement and a triangle")]
    fn id(self) -> PlacedTriangle {
        let bits = |from: u32, count: u32| (self.0 >> from & ((1 << count) - 1)) as u32;
        [bits(TRIANGLE, PLACEMENT), bits(0, TRIANGLE)]
    }
}

impl Coplanar {
    /// Those of a scene.
    #[must_use]
    pub fn of(geometry: &Geometry) -> Self {
        Self::among(geometry, &|_| true)
    }

    /// Those among the placements of a scene that are `wanted`.
    #[must_use]
    pub fn among(geometry: &Geometry, wanted: &dyn Fn(usize) -> bool) -> Self {
        if geometry.placements.len() > MOST_PLACED {
            return Self::default();
        }
        let mut found = Self { last: last_in_place(geometry), ..Self::default() };
        let is_last = |i: usize| found.last.get(i).is_none_or(|&last| last as usize == i);
        let shared = shared_boxes(geometry, &|i| wanted(i) && is_last(i));
        let all = shared.iter().copied().fold(Bounds::EMPTY, Bounds::union);
        if all.is_empty() {
            return found;
        }
        let apart = APART * all.min.abs().max(all.max.abs()).max_element();
        if !(apart > 0.0 && apart.is_finite()) {
            return found;
        }
        let (mut candidates, mut visits) = (Vec::new(), MOST_VISITS);
        for (placement, shared) in (0..).zip(&shared) {
            if shared.is_empty() {
                continue;
            }
            let mesh = geometry.mesh_of(&geometry.placements[placement as usize]);
            let Some(fewer) = visits.checked_sub(mesh.triangles.len()) else { break };
            visits = fewer;
            for triangle in (0..).take(mesh.triangles.len()) {
                let corners = corners(geometry, [placement, triangle]);
                if !meet(shared, &Bounds::of_points(corners)) {
                    continue;
                }
                let Some(key) = key(corners, all.centre()) else { continue };
                candidates.push(CoplanarityKey::new(key / (KEYS * apart), [placement, triangle]));
            }
        }
        candidates.sort_unstable();
        let mut left = MOST_TRIANGLES;
        let mut planes = candidates.chunk_by(|a, b| a.cell() == b.cell()).peekable();
        while let Some(plane) = planes.next() {
            let placed: Vec<&[CoplanarityKey]> =
                plane.chunk_by(|a, b| a.id()[0] == b.id()[0]).collect();
            // One plane's triangles may fall into two cells.
            let beyond = planes.peek().filter(|next| next[0].cell() == plane[0].cell() + 1);
            let beyond: Vec<&[CoplanarityKey]> = beyond.map_or_else(Vec::new, |next| {
                next.chunk_by(|a, b| a.id()[0] == b.id()[0]).collect()
            });
            for (i, one) in placed.iter().enumerate() {
                for other in placed[i + 1..].iter().chain(&beyond) {
                    if one[0].id()[0] != other[0].id()[0] {
                        found.compare(geometry, [one, other], apart, &mut left);
                    }
                }
            }
        }
        found.others.values_mut().for_each(|others| others.settle(geometry, apart));
        if !found.others.is_empty() {
            found.covered = vec![Vec::new(); geometry.placements.len()];
            for &[placement, triangle] in found.others.keys() {
                let own = &mut found.covered[placement as usize];
                let count =
                    geometry.mesh_of(&geometry.placements[placement as usize]).triangles.len();
                own.resize(count.div_ceil(64), 0);
                own[triangle as usize / 64] |= 1 << (triangle % 64);
            }
        }
        found
    }

    /// Bytes of the list of candidates that [`of`](Self::of) makes, at most: that of the triangles of all placements
    /// whose boxes meet others'.
    #[must_use]
    pub fn bytes_at_most(geometry: &Geometry) -> u64 {
        if geometry.placements.len() > MOST_PLACED {
            return 0;
        }
        let shared = shared_boxes(geometry, &|_| true);
        let meeting = geometry.placements.iter().zip(&shared).filter(|(_, own)| !own.is_empty());
        let triangles = meeting.map(|(own, _)| geometry.mesh_of(own).triangles.len());
        triangles.sum::<usize>().min(MOST_VISITS) as u64 * size_of::<CoplanarityKey>() as u64
    }

    /// Notes which triangles of two placements in about one plane lie over one another.
    fn compare(
        &mut self,
        geometry: &Geometry,
        [one, other]: [&[CoplanarityKey]; 2],
        apart: f64,
        left: &mut usize,
    ) {
        let (few, many) = if one.len() < other.len() { (one, other) } else { (other, one) };
        let boxed =
            |own: &CoplanarityKey| (Bounds::of_points(corners(geometry, own.id())), own.id());
        let mut few: Vec<(Bounds, PlacedTriangle)> = few.iter().map(boxed).collect();
        let whole = few.iter().fold(Bounds::EMPTY, |all, (own, _)| all.union(*own));
        let axis = (whole.max - whole.min).max_position();
        few.sort_unstable_by(|a, b| a.0.min[axis].total_cmp(&b.0.min[axis]));
        let widest = few.iter().map(|(c, _)| c.max[axis] - c.min[axis]).fold(0.0, f64::max);
        for (own, id) in many.iter().map(boxed) {
            let grown = Bounds { min: own.min - apart, max: own.max + apart };
            let first = few.partition_point(|(c, _)| c.min[axis] + widest < grown.min[axis]);
            for &(bounds, other) in &few[first..] {
                if bounds.min[axis] > grown.max[axis] {
                    break;
                }
                let Some(fewer) = left.checked_sub(1) else { return };
                *left = fewer;
                if meet(&grown, &bounds)
                    && overlap(corners(geometry, id), corners(geometry, other), apart)
                {
                    self.others.entry(id).or_default().all.push(other);
                    self.others.entry(other).or_default().all.push(id);
                }
            }
        }
    }

    /// True if there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.others.is_empty() && self.last.is_empty()
    }

    /// The last placement of the same mesh in the very same place.
    #[must_use]
    pub fn last(&self, placement: u32) -> u32 {
        self.last.get(placement as usize).copied().unwrap_or(placement)
    }

    /// True if a triangle has others over it.
    #[must_use]
    #[inline]
    pub fn has_others(&self, [placement, triangle]: PlacedTriangle) -> bool {
        let own = self.covered.get(placement as usize);
        let bits = own.and_then(|own| own.get(triangle as usize / 64));
        bits.is_some_and(|bits| bits >> (triangle % 64) & 1 != 0)
    }

    /// The triangles that lie over one, and of them those that may come within `slack` of `point` (m).
    pub fn others_near(
        &self,
        id: PlacedTriangle,
        point: DVec3,
        slack: f64,
    ) -> impl Iterator<Item = PlacedTriangle> {
        self.over(id).into_iter().flat_map(move |others| others.near(point, slack))
    }

    fn over(&self, id: PlacedTriangle) -> Option<&Overlaps> {
        if self.has_others(id) { self.others.get(&id) } else { None }
    }

    /// The pairs of placements of which triangles that face the same side lie over one another. (A box that stands on a floor faces the other side.)
    #[must_use]
    pub fn pairs(&self, geometry: &Geometry) -> Vec<CoplanarPair> {
        let mut pairs: BTreeMap<[u32; 2], usize> = BTreeMap::new();
        let normal = |id: PlacedTriangle| {
            let [a, b, c] = corners(geometry, id);
            let place = &geometry.placements[id[0] as usize].world_from_mesh;
            (b - a).cross(c - a) * place.handedness()
        };
        for (id, others) in &self.others {
            let facing = others.all.iter().filter(|other| normal(*id).dot(normal(**other)) > 0.0);
            let mut later: Vec<u32> = facing.map(|other| other[0]).collect();
            later.sort_unstable();
            later.dedup();
            for other in later.into_iter().filter(|&other| other > id[0]) {
                *pairs.entry([id[0], other]).or_default() += 1;
            }
        }
        for (own, &last) in (0..).zip(&self.last) {
            if own < last {
                let mesh = geometry.mesh_of(&geometry.placements[own as usize]);
                pairs.insert([own, last], mesh.triangles.len());
            }
        }
        let pair = |(placements, triangles)| CoplanarPair { placements, triangles };
        pairs.into_iter().map(pair).collect()
    }
}

/// Two placements of which triangles lie over one another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CoplanarPair {
    /// Their numbers, the earlier first.
    pub placements: [u32; 2],
    /// Triangles of the earlier one that do.
    pub triangles: usize,
}

/// The last placement of each mesh and place, by placement; empty where no two are in one place.
fn last_in_place(geometry: &Geometry) -> Vec<u32> {
    let key = |placement: &Placement| {
        let place = &placement.world_from_mesh;
        let numbers = place.linear.to_cols_array().map(f64::to_bits);
        let low = place.translation_low.to_array().map(f64::to_bits);
        (placement.mesh, numbers, place.translation.to_array().map(f64::to_bits), low)
    };
    let placements = || (0_u32..).zip(&geometry.placements);
    let hash = |placement: &Placement| {
        let mut hasher = DefaultHasher::new();
        key(placement).hash(&mut hasher);
        hasher.finish()
    };
    let last: HashMap<u64, u32> = placements().map(|(i, own)| (hash(own), i)).collect();
    if last.len() == geometry.placements.len() {
        return Vec::new();
    }
    let find = |(i, own): (u32, &Placement)| {
        let last = last.get(&hash(own)).copied().unwrap_or(i);
        if key(&geometry.placements[last as usize]) == key(own) { last } else { i }
    };
    placements().map(find).collect()
}

/// Of each placement the box that it shares with all whose boxes meet its own; empty where there is none.
fn shared_boxes(geometry: &Geometry, wanted: &dyn Fn(usize) -> bool) -> Vec<Bounds> {
    let boxes: Vec<Bounds> =
        geometry.placements.iter().map(|placement| geometry.loose_bounds_of(placement)).collect();
    let mut shared = vec![Bounds::EMPTY; boxes.len()];
    let mut order: Vec<usize> =
        (0..boxes.len()).filter(|&i| wanted(i) && !boxes[i].is_empty()).collect();
    order.sort_unstable_by(|&a, &b| boxes[a].min.x.total_cmp(&boxes[b].min.x));
    let mut active: Vec<usize> = Vec::new();
    let mut left = MOST_PLACEMENTS;
    for i in order {
        let own = boxes[i];
        let reach = APART * own.min.abs().max(own.max.abs()).max_element();
        active.retain(|&k| boxes[k].max.x + reach >= own.min.x);
        for &k in &active {
            let Some(fewer) = left.checked_sub(1) else { return shared };
            left = fewer;
            let both = Bounds {
                min: own.min.max(boxes[k].min) - reach,
                max: own.max.min(boxes[k].max) + reach,
            };
            if !both.is_empty() {
                shared[i] = shared[i].union(both);
                shared[k] = shared[k].union(both);
            }
        }
        active.push(i);
    }
    shared
}

fn meet(a: &Bounds, b: &Bounds) -> bool {
    a.min.cmple(b.max).all() && b.min.cmple(a.max).all()
}

/// A number that triangles of one plane share, whichever side they face: the plane's distance from `centre` (m).
fn key([a, b, c]: [DVec3; 3], centre: DVec3) -> Option<f64> {
    /// No face of a model is likely to be along it.
    const OFF: DVec3 = DVec3::new(0.381_966, 0.618_034, 0.236_068);
    let normal = (b - a).cross(c - a).try_normalize()?;
    let side = if normal.dot(OFF) < 0.0 { -1.0 } else { 1.0 };
    let key = side * normal.dot(a - centre);
    key.is_finite().then_some(key)
}

/// True if two triangles lie in one plane, within `apart` (m), and over one another by more than an edge.
fn overlap(one: [DVec3; 3], other: [DVec3; 3], apart: f64) -> bool {
    let normal_of = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a).normalize_or_zero();
    let (normal, second) = (normal_of(one), normal_of(other));
    let lies = |normal: DVec3, on: DVec3, corners: [DVec3; 3]| {
        corners.into_iter().all(|corner| normal.dot(corner - on).abs() <= apart)
    };
    // Each corner of the smaller one is in the plane of the larger, which has the better normal.
    if !(lies(normal, one[0], other) || lies(second, other[0], one)) {
        return false;
    }
    // No edge of either parts them.
    for (own, [a, b, c]) in [(normal, one), (second, other)] {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            let outward = (to - from).cross(own);
            let reach = |corners: [DVec3; 3]| {
                corners
                    .map(|corner| outward.dot(corner - from))
                    .into_iter()
                    .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
                        [low.min(x), high.max(x)]
                    })
            };
            let ([low, high], [other_low, other_high]) = (reach(one), reach(other));
            let least = OVERLAP * (high - low).min(other_high - other_low);
            if high.min(other_high) - low.max(other_low) <= least {
                return false;
            }
        }
    }
    true
}
