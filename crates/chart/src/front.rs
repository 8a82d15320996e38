//! The Pareto front: the points that no other beats.

/// The `points` for which none other is at most as large on both axes and smaller on one, from left
/// to right. Points that are not finite take no part.
#[must_use]
pub fn front(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let finite = |point: &[f64; 2]| point.iter().all(|value| value.is_finite());
    let mut sorted: Vec<[f64; 2]> = points.iter().copied().filter(finite).collect();
    sorted.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let mut front: Vec<[f64; 2]> = Vec::new();
    for point in sorted {
        if front.last().is_none_or(|last| point[1] < last[1]) {
            front.push(point);
        }
    }
    front
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_front_is_what_nothing_beats() {
        let points = [[3.0, 0.0], [1.0, 5.0], [2.0, 5.0], [2.0, 1.0], [4.0, 0.0], [0.5, f64::NAN]];
        assert_eq!(front(&points), [[1.0, 5.0], [2.0, 1.0], [3.0, 0.0]]);
        assert_eq!(front(&[]), Vec::<[f64; 2]>::new());
        // By the definition, on points of a small grid.
        let many: Vec<[f64; 2]> =
            (0..60).map(|i| [f64::from(i * 37 % 11), f64::from(i * 53 % 13)]).collect();
        let found = front(&many);
        for a in &many {
            let beaten = many.iter().any(|b| b[0] <= a[0] && b[1] <= a[1] && b != a);
            assert_eq!(found.contains(a), !beaten, "{a:?}");
        }
    }
}
