//! Placement of names: beside a point of their series, on nothing else.

/// A rectangle: left, top, right, bottom (pixels).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LabelArea {
    pub(crate) left: f64,
    pub(crate) top: f64,
    pub(crate) right: f64,
    pub(crate) bottom: f64,
}

impl LabelArea {
    /// The pixels that two areas share (square pixels).
    pub(crate) fn shared(&self, other: &Self) -> f64 {
        let width = self.right.min(other.right) - self.left.max(other.left);
        let height = self.bottom.min(other.bottom) - self.top.max(other.top);
        width.max(0.0) * height.max(0.0)
    }

    /// A square with a place in its middle.
    pub(crate) fn square_at([x, y]: [f64; 2], reach: f64) -> Self {
        Self { left: x - reach, top: y - reach, right: x + reach, bottom: y + reach }
    }

    fn is_inside(&self, other: &Self) -> bool {
        self.left >= other.left
            && self.right <= other.right
            && self.top >= other.top
            && self.bottom <= other.bottom
    }

    /// The place of the area that is nearest to `point`.
    fn nearest(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [x.clamp(self.left, self.right), y.clamp(self.top, self.bottom)]
    }
}

/// Obstacle that a name would rather not cover: marks and lines.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Obstacle {
    pub(crate) area: LabelArea,
    /// Against a pixel of distance.
    pub(crate) weight: f64,
}

/// A name, and the points that it may stand beside.
#[derive(Debug, Clone)]
pub(crate) struct PointName<'a> {
    pub(crate) name: &'a str,
    pub(crate) points: Vec<[f64; 2]>,
}

/// A name that has found its place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PlacedName {
    /// Area that the letters cover.
    pub(crate) area: LabelArea,
    /// A line from the name to its point, where that is not near.
    pub(crate) leader: Option<[[f64; 2]; 2]>,
}

/// Height of a name, and the width of its letters on average: of the widest common sans-serif
/// (`DejaVu Sans`), so that others fit too.
pub(crate) const LINE: f64 = 15.0;
const LETTER: f64 = 7.1;

/// Distances from the point that are tried (pixels).
const REACHES: [f64; 12] =
    [7.0, 12.0, 20.0, 30.0, 42.0, 58.0, 78.0, 102.0, 132.0, 170.0, 220.0, 290.0];

/// Farther than this from its point a name needs a line to it.
const NEAR: f64 = 13.0;

/// A name on another name is worse than anything else.
const ON_A_NAME: f64 = 1e6;

/// Places each of `names` beside one of its points, inside `page`.
pub(crate) fn place(
    names: &[PointName<'_>],
    obstacles: &[Obstacle],
    page: &LabelArea,
) -> Vec<Option<PlacedName>> {
    let mut taken: Vec<LabelArea> = Vec::new();
    let mut places = Vec::new();
    for PointName { name, points } in names {
        let width = LETTER * name.chars().count() as f64 + 4.0;
        let candidates = points.iter().flat_map(|&point| {
            REACHES.iter().flat_map(move |&reach| places_near(point, reach, width))
        });
        let best = candidates
            .filter(|(area, _)| area.is_inside(page))
            .map(|(area, point)| (cost(&area, point, &taken, obstacles), area, point))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        places.push(best.map(|(_, area, point)| {
            taken.push(area);
            let end = area.nearest(point);
            let far = (end[0] - point[0]).hypot(end[1] - point[1]) > NEAR;
            PlacedName { area, leader: far.then_some([end, point]) }
        }));
    }
    places
}

/// Places of a name of `width` at a distance of `reach` around `point`.
fn places_near(
    point: [f64; 2],
    reach: f64,
    width: f64,
) -> impl Iterator<Item = (LabelArea, [f64; 2])> {
    (0..16).map(move |k| {
        let angle = std::f64::consts::TAU * f64::from(k) / 16.0;
        let (x, y) = (point[0] + reach * angle.cos(), point[1] - reach * angle.sin());
        // The name grows away from the point.
        let left = x - width * 0.5 * (1.0 - angle.cos());
        let top = y - LINE * 0.5 * (1.0 + angle.sin());
        (LabelArea { left, top, right: left + width, bottom: top + LINE }, point)
    })
}

fn cost(area: &LabelArea, point: [f64; 2], taken: &[LabelArea], obstacles: &[Obstacle]) -> f64 {
    let names: f64 = taken.iter().map(|other| area.shared(other)).sum();
    let marks: f64 = obstacles.iter().map(|o| o.weight * area.shared(&o.area)).sum();
    let [x, y] = area.nearest(point);
    ON_A_NAME * names + marks + (x - point[0]).hypot(y - point[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_crowded_points_do_not_overlap() {
        let page = LabelArea { left: 0.0, top: 0.0, right: 700.0, bottom: 400.0 };
        // Twelve points within a few pixels.
        let at = |i: u32| [350.0 + f64::from(i % 4), 200.0 + f64::from(i / 4)];
        let name = |i| PointName { name: "embree robust + f64", points: vec![at(i)] };
        let names: Vec<PointName<'_>> = (0..12).map(name).collect();
        let obstacles: Vec<Obstacle> = (0..12)
            .map(|i| Obstacle { area: LabelArea::square_at(at(i), 4.0), weight: 2.0 })
            .collect();
        let placed: Vec<PlacedName> =
            place(&names, &obstacles, &page).into_iter().flatten().collect();
        assert_eq!(placed.len(), 12);
        for (i, a) in placed.iter().enumerate() {
            assert!(a.area.is_inside(&page));
            for b in &placed[..i] {
                assert_eq!(a.area.shared(&b.area), 0.0, "{a:?} {b:?}");
            }
        }
    }
}
