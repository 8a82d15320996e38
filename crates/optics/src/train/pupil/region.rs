//! Aiming region of one lenslet: points of it, evenly.

use glam::DVec2;

/// Region that is aimed at: of one lenslet, or of what is between them.
#[derive(Debug, Clone)]
pub(super) enum Region {
    /// All of an opening that is a polygon.
    Whole { centre: DVec2, area: f64, cell: Option<[f64; 2]>, checked: bool },
    /// A polygon.
    Polygon { cell: Option<[f64; 2]>, corners: Vec<DVec2>, area: f64, checked: bool },
    /// All of a round opening.
    Disk { centre: DVec2, radius: f64 },
}

impl Region {
    pub(super) fn polygon(
        cell: Option<[f64; 2]>,
        corners: Vec<DVec2>,
        checked: bool,
    ) -> Option<Self> {
        let area = area_of(&corners);
        (area > 0.0).then_some(Self::Polygon { cell, corners, area, checked })
    }

    pub(super) fn area(&self) -> f64 {
        match self {
            Self::Polygon { area, .. } | Self::Whole { area, .. } => *area,
            Self::Disk { radius, .. } => std::f64::consts::PI * radius * radius,
        }
    }

    /// A point for a place in the unit square, even in area.
    pub(super) fn draw(&self, [u, v]: [f64; 2], opening: &[DVec2]) -> DVec2 {
        match self {
            Self::Whole { centre, area, .. } => *centre + in_polygon(opening, *area, [u, v]),
            Self::Disk { centre, radius } => {
                let [x, y] = etendue_geometry::disk::point([u, v]);
                *centre + DVec2::new(x, y) * *radius
            }
            Self::Polygon { corners, area, .. } => in_polygon(corners, *area, [u, v]),
        }
    }
}

/// A point of a convex polygon for a place in the unit square, even in area.
fn in_polygon(corners: &[DVec2], area: f64, [u, v]: [f64; 2]) -> DVec2 {
    if let [a, b, c, d] = *corners
        && (a + c - b - d).length_squared() < 1e-18 * area
    {
        return a + (b - a) * u + (d - a) * v;
    }
    // A fan of triangles around the first corner.
    let mut left = u * 2.0 * area;
    let last = corners.len() - 2;
    for k in 1..=last {
        let (b, c) = (corners[k] - corners[0], corners[k + 1] - corners[0]);
        let twice = b.perp_dot(c);
        if left <= twice || k == last {
            let share = (left / twice).clamp(0.0, 1.0);
            let root = v.sqrt();
            return corners[0] + (b + (c - b) * share) * root;
        }
        left -= twice;
    }
    corners[0]
}

pub(super) fn area_of(corners: &[DVec2]) -> f64 {
    let Some(&first) = corners.first() else { return 0.0 };
    let pairs = corners.windows(2).skip(1);
    0.5 * pairs.map(|pair| (pair[0] - first).perp_dot(pair[1] - first)).sum::<f64>()
}
