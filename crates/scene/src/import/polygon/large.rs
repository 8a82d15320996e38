//! Ear clipping for polygons of any number of corners, in time near n log n.
//!
//! * Only corners that turn right or not at all can lie in the way of an ear; they are kept in a
//!   tree of boxes (Held, *FIST: fast industrial-strength triangulation of polygons*, 2001, uses a
//!   grid), which finds one in a triangle in about log n steps.
//! * A corner in whose way another lies waits until that one is gone or turns left; nothing else
//!   can make it an ear but its own neighbours' going.
//! * Ears are taken in the order of a queue, with the neighbours of an ear behind all others, which
//!   gives no fans of needles.
//!
//! Sound polygons stay far below [`most_effort`]. Polygons that cross themselves everywhere have no
//! triangulation, and could take time with the square of their corners: past that effort all
//! corners that turn left are taken for ears.

use std::collections::VecDeque;
use std::ops::Range;

use robust::Coord;

use super::ring::Ring;

/// Corners in a leaf of the tree.
const LEAF: usize = 8;

/// Cost of an exact test in steps through the tree.
const EXACT: u64 = 16;

/// No node.
const NOBODY: usize = usize::MAX;

/// The stamp of a corner that was cut off.
const GONE: u32 = u32::MAX;

/// The effort after which a polygon of so many corners is cut as may be.
pub(super) fn most_effort(corners: usize) -> u64 {
    32 * corners as u64 * u64::from(corners.max(2).ilog2())
}

/// Triangles of `polygon`, onto the end of `triangles`; the effort that it took.
pub(super) fn clip(polygon: &[Coord<f64>], triangles: &mut Vec<[u32; 3]>) -> u64 {
    let n = polygon.len();
    let ring = Ring::new(polygon);
    let turns: Vec<f64> = (0..n).map(|i| ring.turn(i)).collect();
    let reflex: Vec<usize> = (0..n).filter(|&i| turns[i] <= 0.0).collect();
    let mut clipper = LargeClipper {
        tree: BoxTree::new(polygon, reflex),
        in_the_way: turns.iter().map(|turn| *turn <= 0.0).collect(),
        queue: (0..n).map(|i| (i, 0)).collect(),
        stamps: vec![0; n],
        waiting: vec![Vec::new(); n],
        straight: Vec::new(),
        blocked: Vec::new(),
        ring,
        effort: 0,
        most: most_effort(n),
    };
    clipper.run(triangles);
    clipper.effort
}

struct LargeClipper<'a> {
    ring: Ring<'a>,
    tree: BoxTree,
    /// True for each corner that is there and does not turn left.
    in_the_way: Vec<bool>,
    /// Corners to be looked at, with the stamp that they had then; the first comes next.
    queue: VecDeque<(usize, u32)>,
    /// Counts the changes around each corner: what was known under another stamp is out of date.
    stamps: Vec<u32>,
    /// For each corner those in whose way it lies.
    waiting: Vec<Vec<usize>>,
    /// Corners that were found to go straight on, and that turn left but are no ears.
    straight: Vec<(usize, u32)>,
    blocked: Vec<(usize, u32)>,
    effort: u64,
    most: u64,
}

impl LargeClipper<'_> {
    fn run(&mut self, triangles: &mut Vec<[u32; 3]>) {
        let mut last = 0;
        while self.ring.left > 3 {
            // Where the polygon crosses itself and has no ear: a corner that does not turn right,
            // or any.
            let ear = self.next_ear();
            let ear = ear.or_else(|| latest(&mut self.straight, &self.stamps));
            let ear = ear.or_else(|| latest(&mut self.blocked, &self.stamps)).unwrap_or(last);
            let (before, behind) = (self.ring.previous[ear], self.ring.next[ear]);
            self.ring.cut(ear, triangles);
            self.stamps[ear] = GONE;
            self.leaves_the_way(ear);
            self.changed(before);
            self.changed(behind);
            last = behind;
        }
        triangles.push(self.ring.triangle(last));
    }

    /// The next corner of the queue that is an ear.
    fn next_ear(&mut self) -> Option<usize> {
        while let Some((corner, stamp)) = self.queue.pop_front() {
            if self.stamps[corner] != stamp {
                continue;
            }
            let turn = self.ring.turn(corner);
            if turn == 0.0 {
                self.straight.push((corner, stamp));
            } else if turn > 0.0 {
                match self.blocker(corner) {
                    None => return Some(corner),
                    Some(blocker) => {
                        self.waiting[blocker].push(corner);
                        self.blocked.push((corner, stamp));
                    }
                }
            }
        }
        None
    }

    /// A corner has another neighbour.
    fn changed(&mut self, corner: usize) {
        self.stamps[corner] = (self.stamps[corner] + 1).min(GONE - 1);
        self.queue.push_back((corner, self.stamps[corner]));
        if self.in_the_way[corner] && self.ring.turn(corner) > 0.0 {
            self.leaves_the_way(corner);
        }
    }

    /// Those that wait for `corner` are to be looked at again.
    fn leaves_the_way(&mut self, corner: usize) {
        if std::mem::replace(&mut self.in_the_way[corner], false) {
            self.tree.forget(corner);
            for waiter in std::mem::take(&mut self.waiting[corner]) {
                if self.stamps[waiter] != GONE {
                    self.queue.push_back((waiter, self.stamps[waiter]));
                }
            }
        }
    }

    /// A corner that lies in the way of the ear at `b`.
    fn blocker(&mut self, b: usize) -> Option<usize> {
        let corners = [self.ring.previous[b], b, self.ring.next[b]];
        let (ring, in_the_way) = (&self.ring, &self.in_the_way);
        let blocks = |other: usize| {
            let is_asked = in_the_way[other] && !corners.contains(&other);
            is_asked.then(|| ring.blocks(corners, other))
        };
        let triangle = corners.map(|corner| ring.polygon[corner]);
        self.tree.find(triangle, &mut self.effort, self.most, blocks)
    }
}

/// The last of `known` that is not out of date.
fn latest(known: &mut Vec<(usize, u32)>, stamps: &[u32]) -> Option<usize> {
    std::iter::from_fn(|| known.pop())
        .find(|&(corner, stamp)| stamps[corner] == stamp)
        .map(|(corner, _)| corner)
}

/// Corners in a tree of boxes, each in one leaf.
struct BoxTree {
    places: Vec<Coord<f64>>,
    /// Leaves have parts of this.
    order: Vec<usize>,
    nodes: Vec<BoxNode>,
    /// For each corner of the polygon its leaf.
    leaf: Vec<usize>,
}

struct BoxNode {
    bounds: Area,
    parent: usize,
    content: BoxContent,
    /// Corners below that are not forgotten.
    count: usize,
}

enum BoxContent {
    Leaf(Range<usize>),
    /// The nodes of the two halves.
    Halves([usize; 2]),
}

impl BoxTree {
    fn new(polygon: &[Coord<f64>], order: Vec<usize>) -> Self {
        let leaf = vec![NOBODY; polygon.len()];
        let mut tree = Self { places: polygon.to_vec(), order, nodes: Vec::new(), leaf };
        tree.grow(0..tree.order.len(), NOBODY);
        tree
    }

    /// Adds the node of a part of `order`, and those below; its number.
    fn grow(&mut self, part: Range<usize>, parent: usize) -> usize {
        let places = &self.places;
        let bounds = Area::of(self.order[part.clone()].iter().map(|&corner| places[corner]));
        let number = self.nodes.len();
        let content = BoxContent::Leaf(part.clone());
        self.nodes.push(BoxNode { bounds, parent, content, count: part.len() });
        if part.len() <= LEAF {
            for &corner in &self.order[part] {
                self.leaf[corner] = number;
            }
            return number;
        }
        let wide = bounds.max.x - bounds.min.x >= bounds.max.y - bounds.min.y;
        let key = |corner: usize| if wide { places[corner].x } else { places[corner].y };
        let middle = part.len() / 2;
        self.order[part.clone()].select_nth_unstable_by(middle, |&a, &b| key(a).total_cmp(&key(b)));
        let middle = part.start + middle;
        let first = self.grow(part.start..middle, number);
        let second = self.grow(middle..part.end, number);
        self.nodes[number].content = BoxContent::Halves([first, second]);
        number
    }

    /// Takes out a corner that is in.
    fn forget(&mut self, corner: usize) {
        let mut node = self.leaf[corner];
        while node != NOBODY {
            self.nodes[node].count -= 1;
            node = self.nodes[node].parent;
        }
    }

    /// A corner in the box around a triangle that `blocks` it. None is found past the `most` effort.
    fn find(
        &self,
        triangle: [Coord<f64>; 3],
        effort: &mut u64,
        most: u64,
        blocks: impl Fn(usize) -> Option<bool>,
    ) -> Option<usize> {
        let bounds = Area::of(triangle.into_iter());
        // As deep as the tree, of which halves are halves.
        let mut open = vec![0];
        while let Some(number) = open.pop() {
            if *effort >= most {
                return None;
            }
            *effort += 1;
            let node = &self.nodes[number];
            if node.count == 0 || !node.bounds.meets(bounds) || node.bounds.is_beside(triangle) {
                continue;
            }
            match &node.content {
                BoxContent::Halves(halves) => open.extend(halves),
                BoxContent::Leaf(part) => {
                    for &corner in &self.order[part.clone()] {
                        *effort += 1;
                        if !bounds.contains(self.places[corner]) {
                            continue;
                        }
                        if let Some(blocks) = blocks(corner) {
                            *effort += EXACT;
                            if blocks {
                                return Some(corner);
                            }
                        }
                    }
                }
            }
        }
        None
    }
}

/// A rectangle along the axes.
#[derive(Clone, Copy)]
struct Area {
    min: Coord<f64>,
    max: Coord<f64>,
}

impl Area {
    fn of(places: impl Iterator<Item = Coord<f64>>) -> Self {
        let [low, high] = [f64::INFINITY, f64::NEG_INFINITY];
        let mut area = Self { min: Coord { x: low, y: low }, max: Coord { x: high, y: high } };
        for Coord { x, y } in places {
            area.min = Coord { x: area.min.x.min(x), y: area.min.y.min(y) };
            area.max = Coord { x: area.max.x.max(x), y: area.max.y.max(y) };
        }
        area
    }

    fn contains(self, Coord { x, y }: Coord<f64>) -> bool {
        (self.min.x..=self.max.x).contains(&x) && (self.min.y..=self.max.y).contains(&y)
    }

    fn meets(self, other: Self) -> bool {
        self.min.x <= other.max.x
            && other.min.x <= self.max.x
            && self.min.y <= other.max.y
            && other.min.y <= self.max.y
    }

    /// True if all of it lies to the right of a side of the triangle, whose corners run
    /// counter-clockwise. In doubt it does not.
    fn is_beside(self, [a, b, c]: [Coord<f64>; 3]) -> bool {
        // Five roundings of 2⁻⁵³ each.
        const ROUNDING: f64 = 1e-15;
        [(a, b), (b, c), (c, a)].into_iter().any(|(from, to)| {
            let (dx, dy) = (to.x - from.x, to.y - from.y);
            // The corner that is farthest to the left.
            let x = if dy > 0.0 { self.min.x } else { self.max.x };
            let y = if dx > 0.0 { self.max.y } else { self.min.y };
            let (first, second) = (dx * (y - from.y), dy * (x - from.x));
            first - second < -ROUNDING * (first.abs() + second.abs())
        })
    }
}
