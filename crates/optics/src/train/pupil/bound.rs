//! The bound around the passing directions from one point of the sensor, joined from those of the nodes
//! around it: samples of it.

use glam::DVec2;

use super::PupilOutline;
use super::coded::Anywhere;
use super::place::{NodePlace, between};

/// The outline from one point of the sensor.
pub(super) struct PupilBound<'a> {
    pub(super) nodes: &'a [PupilOutline],
    /// Between which nodes; `None` for a disk.
    pub(super) place: Option<NodePlace>,
    /// Centre and half axes in slopes, as the nodes are turned.
    pub(super) frame: [DVec2; 2],
}

impl PupilBound<'_> {
    /// The radius in the frame at a share of a full turn.
    fn reach(&self, turn: f64) -> f64 {
        self.place.as_ref().map_or(1.0, |place| {
            let reach =
                |&(node, weight): &(usize, f64)| between(&self.nodes[node].reach, turn) * weight;
            place.nodes.iter().map(reach).sum()
        })
    }

    /// The radius within which nothing passes.
    fn inner(&self, turn: f64) -> f64 {
        self.place.as_ref().map_or(0.0, |place| {
            let inner =
                |&(node, weight): &(usize, f64)| between(&self.nodes[node].inner, turn) * weight;
            place.nodes.iter().map(inner).sum()
        })
    }

    fn turned(&self, slopes: DVec2) -> DVec2 {
        self.place.as_ref().map_or(slopes, |place| place.turned(slopes))
    }

    /// A rectangle around the bound.
    pub(super) fn rectangle(&self) -> Anywhere {
        let widest = self.place.as_ref().map_or(1.0, |place| {
            place.nodes.iter().map(|&(node, weight)| self.nodes[node].widest * weight).sum()
        });
        let axis = self.place.as_ref().map_or(DVec2::X, |place| place.axis);
        Anywhere { centre: self.frame[0], half: self.frame[1] * widest, axis }
    }

    /// Slopes for a place in the unit square, uniform in area at each angle, and the area of slopes that
    /// they stand for; `None` when the bound is empty there.
    pub(super) fn draw(&self, u: [f64; 2]) -> Option<(DVec2, f64)> {
        let (disc_radius, turn) = concentric(u);
        let reach = self.reach(turn);
        let [centre, half] = self.frame;
        let angle = DVec2::from_angle(turn * std::f64::consts::TAU);
        let inner = self.inner(turn);
        if inner > 0.0 && inner < reach {
            let squares = [inner * inner, reach * reach];
            let rest = squares[1] - squares[0];
            let radius = (squares[0] + rest * disc_radius * disc_radius).sqrt();
            let area = std::f64::consts::PI * half.x * half.y * rest;
            return Some((self.turned(centre + angle * half * radius), area));
        }
        let area = std::f64::consts::PI * half.x * half.y * reach * reach;
        (reach > 0.0).then(|| (self.turned(centre + angle * half * (reach * disc_radius)), area))
    }
}

/// From the unit square to the disk: radius and share of a full turn, with equal areas staying
/// equal (P. Shirley and K. Chiu, "A low distortion map between disk and square", 1997).
fn concentric(u: [f64; 2]) -> (f64, f64) {
    let [a, b] = u.map(|x| 2.0 * x - 1.0);
    if a == 0.0 && b == 0.0 {
        return (0.0, 0.0);
    }
    let (radius, eighths) = if a.abs() > b.abs() { (a, b / a) } else { (b, 2.0 - a / b) };
    let turn = eighths / 8.0 + if radius < 0.0 { 0.5 } else { 0.0 };
    (radius.abs(), turn.rem_euclid(1.0))
}

#[cfg(test)]
mod tests {
    use super::concentric;

    #[test]
    fn the_map_from_the_square_keeps_areas_and_neighbours() {
        let mut inside = 0;
        for i in 0..10_000 {
            let u = [f64::from(i % 100) / 100.0 + 0.005, f64::from(i / 100) / 100.0 + 0.005];
            let (radius, turn) = concentric(u);
            assert!((0.0..=1.0).contains(&radius) && (0.0..1.0).contains(&turn));
            inside += u32::from(radius <= 0.5);
        }
        assert_eq!(inside, 2500, "a quarter of the disk's area is a quarter of the square's");
        assert_eq!(concentric([0.5, 0.5]), (0.0, 0.0));
        assert_eq!(concentric([1.0, 0.5]), (1.0, 0.0));
        assert_eq!(concentric([0.5, 1.0]), (1.0, 0.25));
        assert_eq!(concentric([0.0, 0.5]), (1.0, 0.5));
    }
}
