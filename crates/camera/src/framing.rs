//! A sensible place for a camera that was given none: the whole model in the picture, upright.

use std::fmt;

use etendue_geometry::Bounds;
use glam::DVec3;

use crate::Pose;

/// Free border on each side, as a share of the picture.
const MARGIN: f64 = 0.04;

/// A box thinner than this share of its second-smallest side is looked at face on, for each axis it
/// may be thin along: from the corner, a sheet of paper shows its edge. Land lies along Y, and is
/// better seen from the side as long as it has any hills.
const FLAT: [f64; 3] = [0.1, 0.02, 0.1];

/// From the model towards the camera: in front (+Z, where glTF's models look), a little to the right
/// and above.
const THREE_QUARTER: DVec3 = DVec3::new(0.6, 0.45, 1.0);

/// The support function of a set of points: how far they reach.
pub trait SupportFunction {
    /// For each of `directions` (of any length), the greatest dot product of it with a point taken from
    /// `origin`; −∞ without points.
    fn support(&self, origin: DVec3, directions: &[DVec3]) -> Vec<f64>;
}

impl SupportFunction for Bounds {
    fn support(&self, origin: DVec3, directions: &[DVec3]) -> Vec<f64> {
        let corners = self.corners().map(|corner| corner - origin);
        let most = |d: &DVec3| corners.iter().fold(f64::NEG_INFINITY, |m, p| m.max(p.dot(*d)));
        directions.iter().map(most).collect()
    }
}

/// Subject to be framed by a camera that was given no place.
#[derive(Clone, Copy)]
pub struct Subject<'a> {
    /// The tight box around all of it (m).
    pub bounds: Bounds,
    /// Viewpoint from which it is best looked at.
    pub viewpoint: Viewpoint,
    /// Its points; the corners of the box when absent.
    pub points: Option<&'a dyn SupportFunction>,
}

impl fmt::Debug for Subject<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { bounds, viewpoint, .. } = self;
        f.debug_struct("Subject")
            .field("bounds", bounds)
            .field("viewpoint", viewpoint)
            .finish_non_exhaustive()
    }
}

/// Viewpoint on something.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Viewpoint {
    /// From the front right above; face on when it is flat.
    Usual,
    /// Face on, from where this unit vector along an axis of the world points.
    Side(DVec3),
    /// From this place inside of it (m), in the direction that is usual from outside.
    Within(DVec3),
}

impl From<Bounds> for Subject<'_> {
    /// Something to be looked at from the usual side.
    fn from(bounds: Bounds) -> Self {
        Self { bounds, viewpoint: Viewpoint::Usual, points: None }
    }
}

impl Subject<'_> {
    /// Its support function.
    fn support(&self, origin: DVec3, directions: &[DVec3]) -> Vec<f64> {
        match self.points {
            Some(points) => points.support(origin, directions),
            None => self.bounds.support(origin, directions),
        }
    }

    /// The direction that it is looked at in; the position says nothing.
    #[must_use]
    pub fn view(&self) -> Pose {
        let (towards, up) = match self.viewpoint {
            Viewpoint::Side(towards) => (towards, upright(towards)),
            Viewpoint::Usual | Viewpoint::Within(_) => usual(self.bounds),
        };
        Pose::look_at(towards, DVec3::ZERO, up).unwrap_or(Pose::IDENTITY)
    }

    /// The axis that it is so flat along that the usual view is face on.
    #[must_use]
    pub fn flat_axis(&self) -> Option<usize> {
        flat_axis(self.bounds)
    }
}

/// Extent of a picture to each side of the axis: tangents for a perspective picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FieldExtent {
    pub(crate) left: f64,
    pub(crate) right: f64,
    pub(crate) down: f64,
    pub(crate) up: f64,
}

impl FieldExtent {
    /// Extent of a picture of `size` (pixels): the least of what is seen at the middles and corners of each edge, by
    /// `tangents` of a place (right, down), and `widest`. The middles are across from `centre`.
    pub(crate) fn of_picture(
        [width, height]: [f64; 2],
        centre: [f64; 2],
        widest: f64,
        tangents: impl Fn(f64, f64) -> [f64; 2],
    ) -> Self {
        let corners = [tangents(0.0, 0.0), tangents(width, 0.0), tangents(0.0, height)];
        let far = tangents(width, height);
        let [cu, cv] = centre.map(|c| c.max(0.0));
        let (cu, cv) = (cu.min(width), cv.min(height));
        let least = |a: f64, b: f64, c: f64| a.min(b).min(c).min(widest);
        Self {
            left: least(-corners[0][0], -corners[2][0], -tangents(0.0, cv)[0]),
            right: least(corners[1][0], far[0], tangents(width, cv)[0]),
            up: least(-corners[0][1], -corners[1][1], -tangents(cu, 0.0)[1]),
            down: least(corners[2][1], far[1], tangents(cu, height)[1]),
        }
    }

    /// Returns the extent without the picture's margin; `None` when an edge is on the wrong side of
    /// the axis by so much that nothing is left.
    fn inside_margin(self) -> Option<Self> {
        let (x, y) = ((self.left + self.right) * MARGIN, (self.down + self.up) * MARGIN);
        let inner = Self {
            left: self.left - x,
            right: self.right - x,
            down: self.down - y,
            up: self.up - y,
        };
        let open = inner.left + inner.right > 0.0 && inner.down + inner.up > 0.0;
        open.then_some(inner)
    }
}

/// The axis that a box is flat along.
fn flat_axis(bounds: Bounds) -> Option<usize> {
    let size = bounds.max - bounds.min;
    let mut axes = [0, 1, 2];
    axes.sort_by(|&a, &b| size[a].total_cmp(&size[b]));
    let [thin, middle, _] = axes;
    (size[middle] > 0.0 && size[thin] < FLAT[thin] * size[middle]).then_some(thin)
}

/// Direction from which to look at a box, and the one that is up: from the front right above, or face on when it
/// is flat.
fn usual(bounds: Bounds) -> (DVec3, DVec3) {
    let towards = flat_axis(bounds).map_or(THREE_QUARTER, |axis| DVec3::AXES[axis]);
    (towards, upright(towards))
}

/// Upward direction in a view from where `towards` points.
fn upright(towards: DVec3) -> DVec3 {
    if towards.x == 0.0 && towards.z == 0.0 { DVec3::NEG_Z } else { DVec3::Y }
}

/// The nearest pose of a perspective camera that has the whole of its subject in the picture, with
/// even margins, unless it is seen from within.
///
/// With the view's direction fixed, each side of the picture is a plane that all points must lie
/// inside of. Where the planes of an axis touch the subject, given by its support function, is linear in
/// the camera's place: two planes give the least distance and the middle. Along the axis that leaves room
/// at that distance, the planes are brought in by one angle's share on both sides until they touch.
/// An empty box is looked at from 3 m.
pub(crate) fn perspective(subject: Subject<'_>, reach: FieldExtent) -> Pose {
    let (bounds, view) = (subject.bounds, subject.view());
    if let Viewpoint::Within(position) = subject.viewpoint {
        return Pose { position, ..view };
    }
    let Some(reach) = usable(bounds).and_then(|()| reach.inside_margin()) else {
        return Pose { position: bounds.centre() + DVec3::Z * 3.0, ..Pose::IDENTITY };
    };
    let centre = bounds.centre();
    let touch = |across: DVec3, sides: &[[f64; 2]]| {
        let planes = sides.iter().flat_map(|[low, high]| {
            [across + DVec3::Z * *high, -across + DVec3::Z * *low].map(|d| view.rotation * d)
        });
        let far = subject.support(centre, &planes.collect::<Vec<_>>());
        let sides = sides.iter().zip(far.as_chunks::<2>().0);
        sides.map(|(&[low, high], &far)| Touch { low, high, far }).collect::<Vec<_>>()
    };
    let (x, y) = ([reach.left, reach.right], [reach.down, reach.up]);
    let least = [(DVec3::X, x), (DVec3::Y, y)].map(|(axis, side)| touch(axis, &[side]));
    let mut distance =
        least.iter().flatten().fold(f64::NEG_INFINITY, |d, touch| d.max(touch.distance()));
    if bounds.diagonal() == 0.0 {
        distance = 1.0;
    }
    let middle = |axis: DVec3, side, least: &[Touch]| match least {
        // The axis that decides has no room left.
        [touch] if touch.distance() >= distance => touch.across(distance),
        _ => even(distance, side, &|sides: &[[f64; 2]]| touch(axis, sides)),
    };
    let across = [middle(DVec3::X, x, &least[0]), middle(DVec3::Y, y, &least[1])];
    let offset = DVec3::new(across[0], across[1], distance);
    Pose { position: centre + view.rotation * offset, ..view }
}

/// Two opposite sides of the picture as planes, by their tangents, and how far the subject reaches
/// towards each.
#[derive(Debug, Clone, Copy)]
struct Touch {
    low: f64,
    high: f64,
    far: [f64; 2],
}

impl Touch {
    /// The distance from which both planes touch.
    fn distance(&self) -> f64 {
        (self.far[0] + self.far[1]) / (self.low + self.high)
    }

    /// Position of the camera across the axis at a distance; between the two planes when it is farther off.
    fn across(&self, distance: f64) -> f64 {
        let [high, low] = self.far;
        0.5 * ((high - distance * self.high) - (low - distance * self.low))
    }
}

/// Position across of a camera at `distance` at which the margins on both sides are the same share of the picture.
fn even(distance: f64, [low, high]: [f64; 2], touch: &dyn Fn(&[[f64; 2]]) -> Vec<Touch>) -> f64 {
    /// Margins that are tried at once; two rounds leave 1/128 of the picture, within which where the
    /// planes touch is nearly linear.
    const STEPS: u32 = 8;
    let whole = low + high;
    let narrowed = |margin: f64| [low - margin * whole, high - margin * whole];
    let (mut from, mut step) = (0.0, 0.5 / f64::from(STEPS));
    let mut between = Vec::new();
    for _ in 0..2 {
        let margins: Vec<f64> = (0..STEPS).map(|k| from + f64::from(k) * step).collect();
        let tried = touch(&margins.iter().map(|margin| narrowed(*margin)).collect::<Vec<_>>());
        let inside = tried.iter().take_while(|touch| touch.distance() <= distance).count();
        let last = inside.saturating_sub(1);
        from = margins[last];
        between = tried[last..].iter().take(2).copied().collect();
        step /= f64::from(STEPS);
    }
    match between[..] {
        [a, b] if b.distance() > a.distance() => {
            let share = ((distance - a.distance()) / (b.distance() - a.distance())).clamp(0.0, 1.0);
            a.across(distance) * (1.0 - share) + b.across(distance) * share
        }
        [a, ..] => a.across(distance),
        [] => 0.0,
    }
}

/// A pose of an orthographic camera outside the subject's box, and the height (m) of a picture of this
/// width-to-height ratio that holds all of it, in its middle.
pub(crate) fn orthographic(subject: Subject<'_>, aspect: f64) -> (Pose, f64) {
    let bounds = subject.bounds;
    let Some(()) = usable(bounds) else {
        return (Pose { position: bounds.centre() + DVec3::Z * 3.0, ..Pose::IDENTITY }, 2.0);
    };
    let view = subject.view();
    let position = match subject.viewpoint {
        Viewpoint::Within(position) => position,
        Viewpoint::Usual | Viewpoint::Side(_) => {
            let centre = bounds.centre();
            let axes = [view.rotation.x_axis, view.rotation.y_axis];
            let sides = [axes[0], -axes[0], axes[1], -axes[1]];
            let far = subject.support(centre, &sides);
            let middle = axes[0] * (0.5 * (far[0] - far[1])) + axes[1] * (0.5 * (far[2] - far[3]));
            centre + middle - view.forward() * bounds.diagonal().max(1e-3)
        }
    };
    let pose = Pose { position, ..view };
    (pose, orthographic_height(subject, &pose, aspect))
}

/// The height (m) of an orthographic picture from `pose` that holds the whole subject; 2 m for
/// nothing.
pub(crate) fn orthographic_height(subject: Subject<'_>, pose: &Pose, aspect: f64) -> f64 {
    let mut half = 0.0_f64;
    if usable(subject.bounds).is_some() {
        let axes = [pose.rotation.x_axis, pose.rotation.y_axis];
        let sides = [axes[0] / aspect, -axes[0] / aspect, axes[1], -axes[1]];
        half = subject.support(pose.position, &sides).into_iter().fold(half, f64::max);
    }
    if half > 0.0 { 2.0 * half / (1.0 - 2.0 * MARGIN) } else { 2.0 }
}

fn usable(bounds: Bounds) -> Option<()> {
    (!bounds.is_empty() && bounds.min.is_finite() && bounds.max.is_finite()).then_some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const REACH: FieldExtent = FieldExtent { left: 0.5, right: 0.5, down: 0.4, up: 0.4 };

    fn boxes() -> [Bounds; 5] {
        let from = |min: [f64; 3], max: [f64; 3]| Bounds { min: min.into(), max: max.into() };
        [
            from([-1.0; 3], [1.0; 3]),
            from([0.0, 0.0, -0.7], [1.0, 0.7, 0.0]),
            from([1e7, 1e7, 1e7], [1e7 + 2.0, 1e7 + 50.0, 1e7 + 1.0]),
            from([-3.0, 0.0, -3.0], [3.0, 0.0, 3.0]),
            from([-1e-3, -1e-3, 0.0], [1e-3, 2e-3, 0.0]),
        ]
    }

    #[test]
    fn the_whole_box_is_inside_and_touches_the_margin() {
        for bounds in boxes() {
            for reach in [REACH, FieldExtent { left: 0.1, right: 0.9, ..REACH }] {
                let pose = perspective(bounds.into(), reach);
                let mut fullest = 0.0_f64;
                for corner in bounds.corners() {
                    let p = pose.rotation.transpose() * (corner - pose.position);
                    assert!(p.z < 0.0, "in front of the camera: {p}");
                    let (x, y) = (p.x / -p.z, p.y / -p.z);
                    // Shares of the picture, 0 and 1 at its edges.
                    let across = (x + reach.left) / (reach.left + reach.right);
                    let upwards = (y + reach.down) / (reach.down + reach.up);
                    for share in [across, upwards] {
                        assert!((MARGIN - 1e-6..=1.0 - MARGIN + 1e-6).contains(&share), "{share}");
                        fullest = fullest.max((share - 0.5).abs());
                    }
                }
                // 1e-6: the box at 10⁷ m has corners rounded to 2·10⁻⁹ of its 1 m.
                assert!((fullest - (0.5 - MARGIN)).abs() < 1e-6, "no nearer place: {fullest}");
            }
        }
    }

    /// A pyramid fills little of its box: its own corners, not the box's, touch the margins.
    #[test]
    fn margins_are_even_on_both_sides_of_both_axes() {
        struct Points(Vec<DVec3>);
        impl SupportFunction for Points {
            fn support(&self, origin: DVec3, directions: &[DVec3]) -> Vec<f64> {
                let dot = |d: &DVec3| {
                    self.0.iter().map(|p| (*p - origin).dot(*d)).fold(f64::MIN, f64::max)
                };
                directions.iter().map(dot).collect()
            }
        }
        let corners = [[-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]];
        for apex in [[0.0, 0.5, 0.0], [0.0, 6.0, 0.0], [0.9, 3.0, 0.9]] {
            let points = Points(corners.iter().chain([&apex]).map(|p| DVec3::from(*p)).collect());
            let mut bounds = Bounds::EMPTY;
            points.0.iter().for_each(|p| bounds.include(*p));
            for reach in [REACH, FieldExtent { left: 0.1, right: 0.9, ..REACH }] {
                let subject = Subject { points: Some(&points), ..bounds.into() };
                let pose = perspective(subject, reach);
                let shares = |low: f64, high: f64, axis: usize| {
                    let seen =
                        points.0.iter().map(|p| pose.rotation.transpose() * (*p - pose.position));
                    let shares = seen.map(|p| (p[axis] / -p.z + low) / (low + high));
                    shares.fold([f64::MAX, f64::MIN], |[a, b], s| [a.min(s), b.max(s)])
                };
                let across = shares(reach.left, reach.right, 0);
                let upwards = shares(reach.down, reach.up, 1);
                for [least, most] in [across, upwards] {
                    // What is interpolated between two margins 1/128 apart.
                    assert!((least - (1.0 - most)).abs() < 1e-3, "{apex:?}: {least} {most}");
                    assert!(least > MARGIN - 1e-6, "{apex:?}: {least}");
                }
                let fullest = across[0].min(upwards[0]);
                assert!((fullest - MARGIN).abs() < 1e-3, "no nearer place: {fullest}");
            }
        }
    }

    #[test]
    fn solid_boxes_are_seen_from_the_front_right_above() {
        let pose = perspective(boxes()[0].into(), REACH);
        assert!(pose.position.cmpgt(DVec3::ZERO).all(), "{}", pose.position);
        assert!(pose.up().y > 0.5 && pose.right().y == 0.0, "upright");
    }

    #[test]
    fn flat_boxes_are_seen_face_on() {
        let floor = perspective(boxes()[3].into(), REACH);
        assert_eq!((floor.forward(), floor.up()), (DVec3::NEG_Y, DVec3::NEG_Z));
        let wall = perspective(boxes()[4].into(), REACH);
        assert_eq!((wall.forward(), wall.up()), (DVec3::NEG_Z, DVec3::Y));
        let sliver = Bounds { min: DVec3::ZERO, max: DVec3::new(0.9, 70.0, 11.0) };
        assert_eq!(perspective(sliver.into(), REACH).forward(), DVec3::NEG_X);
        let land = Bounds { min: DVec3::ZERO, max: DVec3::new(100.0, 5.0, 120.0) };
        assert!(perspective(land.into(), REACH).forward().z < -0.5, "hills are seen from the side");
    }

    #[test]
    fn orthographic_pictures_hold_the_box_too() {
        for bounds in boxes() {
            let (pose, height) = orthographic(bounds.into(), 1.5);
            for corner in bounds.corners() {
                let p = pose.rotation.transpose() * (corner - pose.position);
                assert!(p.z < 0.0, "in front of the camera: {p}");
                assert!(p.x.abs() <= 0.75 * height && p.y.abs() <= 0.5 * height, "{p} {height}");
            }
        }
    }

    #[test]
    fn nothing_and_a_point_have_a_finite_camera() {
        assert!(perspective(Bounds::EMPTY.into(), REACH).is_finite());
        let point = Bounds { min: DVec3::ONE, max: DVec3::ONE };
        assert!((perspective(point.into(), REACH).position - DVec3::ONE).length() > 0.5);
        let huge = Bounds { min: DVec3::splat(-f64::MAX), max: DVec3::splat(f64::MAX) };
        assert!(orthographic(Bounds::EMPTY.into(), 1.0).0.is_finite());
        let _ = perspective(huge.into(), REACH);
    }

    #[test]
    fn a_side_is_seen_face_on_and_a_room_from_within() {
        let bounds = boxes()[0];
        let side = Viewpoint::Side(DVec3::NEG_Z);
        let pose = perspective(Subject { viewpoint: side, ..bounds.into() }, REACH);
        assert_eq!((pose.forward(), pose.up()), (DVec3::Z, DVec3::Y));
        assert!(pose.position.z < -1.0 && pose.position.x.abs() < 1e-12, "{}", pose.position);
        let place = DVec3::new(0.3, 0.2, 0.5);
        let within = Subject { viewpoint: Viewpoint::Within(place), ..bounds.into() };
        let usual = perspective(bounds.into(), REACH);
        for pose in [perspective(within, REACH), orthographic(within, 1.0).0] {
            assert_eq!((pose.position, pose.rotation), (place, usual.rotation));
        }
    }
}
