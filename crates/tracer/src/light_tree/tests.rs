//! Chances beside picks, and picks beside what lights bring.

use std::f64::consts::{FRAC_PI_2, PI};

use etendue_geometry::Bounds;
use etendue_geometry::glam::DVec3;

use super::*;

/// A point that gets light from above, or from all sides.
fn receiver(point: DVec3, is_one_sided: bool) -> Receiver {
    Receiver { point, normal: if is_one_sided { DVec3::Y } else { DVec3::ZERO } }
}

fn pick(tree: &LightTree, receiver: Receiver, u: f64) -> Choice {
    pick_all(tree, &[(receiver, u)])[0]
}

fn pick_all(tree: &LightTree, asking: &[(Receiver, f64)]) -> Vec<Choice> {
    let mut choices = Choices::default();
    choices.restart(Some(tree), asking.len());
    for (receiver, u) in asking {
        choices.push(receiver, *u);
    }
    for (number, (_, u)) in asking.iter().enumerate() {
        choices.leave_to_tree(number, 1.0, *u);
    }
    tree.pick(&mut choices);
    (0..asking.len()).map(|number| choices.get(number)).collect()
}

/// xorshift*: Vigna 2016.
fn random() -> impl FnMut() -> f64 {
    let mut state = 0x1234_5678_9abc_def1_u64;
    move || {
        state ^= state >> 12;
        state ^= state << 25;
        state ^= state >> 27;
        (state.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

fn at(place: DVec3, axis: DVec3, cone: f64, intensity: f64) -> Cluster {
    let bounds = Bounds { min: place, max: place };
    Cluster { bounds, axis, cone, reach: FRAC_PI_2, intensity }
}

/// Lights that shine to one side, and points, in a room of two metres.
fn lights(count: u32, mut random: impl FnMut() -> f64) -> Vec<NumberedCluster> {
    let mut vector = move || DVec3::from([random(), random(), random()].map(|x| 2.0 * x - 1.0));
    (0..count)
        .map(|k| {
            let (place, axis) = (vector(), vector().normalize());
            let cone = if k % 2 == 0 { PI } else { 0.0 };
            let mut light = at(place, axis, cone, 0.1 + f64::from(k % 7));
            if k % 2 == 1 {
                light.bounds.max += 0.03 * vector().abs();
            }
            NumberedCluster { number: k, cluster: light }
        })
        .collect()
}

#[test]
fn picks_have_the_chances_that_are_stated() {
    let all = lights(200, random());
    let tree = LightTree::new(all.clone(), 200);
    let mut random = random();
    for k in 0..20 {
        let from = DVec3::from([random(), random(), random()].map(|x| 3.0 * x - 1.5));
        // A point that faces up stands below most of them.
        let is_one_sided = k % 2 == 1;
        let from = if is_one_sided { from.with_y(-from.y.abs()) } else { from };
        let from = receiver(from, is_one_sided);
        let chances: Vec<f64> = (0..200).map(|k| tree.chance(&from, k)).collect();
        let sum: f64 = chances.iter().sum();
        // A node may promise what none of its lights keeps, most of all where they are below the horizon.
        assert!((0.3..1.0 + 1e-12).contains(&sum), "{sum}");
        let steps = 20_000;
        let mut counts = vec![0.0; 200];
        for k in 0..steps {
            let u = (f64::from(k) + 0.5) / f64::from(steps);
            let Choice { light, u, chance, .. } = pick(&tree, from, u);
            if chance == 0.0 {
                continue;
            }
            let light = light as usize;
            assert!((chance / chances[light] - 1.0).abs() < 1e-9);
            assert!((0.0..1.0).contains(&u));
            counts[light] += 1.0 / f64::from(steps);
        }
        for (count, chance) in counts.iter().zip(&chances) {
            // A regular grid meets an interval to within one step.
            assert!((count - chance).abs() <= 1.001 / f64::from(steps), "{count} {chance}");
        }
    }
}

/// The choice for a point does not depend, to the bit, on how many others choose with it: whether it goes down in a
/// lane or by itself.
#[test]
fn choices_are_the_same_alone_and_among_others() {
    let mut random = random();
    for count in [5, 9, 100, 2000] {
        let tree = LightTree::new(lights(count, &mut random), count as usize);
        let asking: Vec<_> = (0..1000)
            .map(|k| {
                let from = DVec3::from([random(), random(), random()].map(|x| 3.0 * x - 1.5));
                // Some are so far away that one light is as good as another.
                let from = if k % 50 == 0 { 1e4 * from } else { from };
                (receiver(from, k % 2 == 1), random())
            })
            .collect();
        // Where nothing shines, what is left of the number is of no use.
        let bits = |choice: Choice| match choice.chance > 0.0 {
            true => Some((choice.light, choice.u.to_bits(), choice.chance.to_bits())),
            false => None,
        };
        let alone: Vec<_> =
            asking.iter().map(|(receiver, u)| bits(pick(&tree, *receiver, *u))).collect();
        for at_once in [2, 7, 37, 1000] {
            let together = asking.chunks(at_once).flat_map(|some| pick_all(&tree, some));
            let differ = together.map(bits).zip(&alone).filter(|(own, other)| own != *other);
            assert_eq!(differ.count(), 0, "{count} by {at_once}");
        }
    }
}

/// Wherever a light's front is seen and some of it is above the point's horizon, it may be picked; nothing far
/// below that is.
#[test]
fn nothing_that_shines_is_left_out() {
    let all = lights(200, random());
    let tree = LightTree::new(all.clone(), 200);
    let mut random = random();
    let (mut seen, mut dark) = (0, 0);
    for k in 0..1000 {
        let from = DVec3::from([random(), random(), random()].map(|x| 3.0 * x - 1.5));
        let is_one_sided = k % 2 == 1;
        let from = receiver(from, is_one_sided);
        for NumberedCluster { number, cluster: light } in &all {
            let corners = light.bounds.corners();
            let shines = |corner: &DVec3| (from.point - *corner).dot(light.axis) > 0.0;
            let is_above = |corner: &DVec3| !is_one_sided || corner.y > from.point.y;
            let chance = tree.chance(&from, *number as usize);
            let lights = light.cone >= PI || corners.iter().any(shines);
            if lights && corners.iter().any(is_above) {
                assert!(chance > 0.0, "{number} from {from:?}");
                seen += 1;
            } else if chance == 0.0 {
                dark += 1;
            }
        }
    }
    assert!(seen > 70_000 && dark > 50_000, "{seen} {dark}");
}

/// The variance of one light's share over its chance, Σ eᵢ²/pᵢ − (Σ eᵢ)², of 100 points in a room:
/// less than a third of that by power, and less than a tenth where the tree knows that the floor faces up.
#[test]
fn near_lights_are_picked_more_often() {
    let mut random = random();
    let mut place = || DVec3::from([random(), random(), random()].map(|x| 2.0 * x - 1.0));
    let mut light = |number| {
        let cluster = at(place(), DVec3::Y, PI, 0.02 + 0.04 * f64::from(number % 3));
        NumberedCluster { number, cluster }
    };
    let all: Vec<_> = (0..100).map(&mut light).collect();
    let tree = LightTree::new(all.clone(), 100);
    let power: f64 = all.iter().map(|light| light.cluster.intensity).sum();
    let (mut by_tree, mut by_power) = ([0.0; 2], 0.0);
    for _ in 0..200 {
        // On the floor, which faces +Y.
        let from = DVec3::new(place().x, -1.0, place().z);
        let (mut sum, mut of_tree, mut of_power) = (0.0, [0.0; 2], 0.0);
        for NumberedCluster { number, cluster: light } in &all {
            let way = light.bounds.min - from;
            let brings = light.intensity * way.normalize().y / way.length_squared();
            sum += brings;
            for (of_tree, is_one_sided) in of_tree.iter_mut().zip([false, true]) {
                let chance = tree.chance(&receiver(from, is_one_sided), *number as usize);
                *of_tree += brings * brings / chance;
            }
            of_power += brings * brings / (light.intensity / power);
        }
        for (by_tree, of_tree) in by_tree.iter_mut().zip(of_tree) {
            *by_tree += of_tree / (sum * sum) - 1.0;
        }
        by_power += of_power / (sum * sum) - 1.0;
    }
    assert!(by_tree[0] < by_power / 3.0, "{by_tree:?} {by_power}");
    assert!(by_tree[1] < by_power / 10.0, "{by_tree:?} {by_power}");
}

/// Lights all over a ceiling, asked from the floor: one light's share over its chance differs from the sum by a twentieth
/// of it in the median. By the largest cosines alone it would be by a twelfth.
#[test]
fn lights_on_a_ceiling_are_picked_by_what_they_bring() {
    let place = |k: u32| DVec3::new(f64::from(k % 40) / 39.0, 1.0, f64::from(k / 40) / 24.0);
    let light =
        |number| NumberedCluster { number, cluster: at(place(number), DVec3::NEG_Y, 0.0, 1.0) };
    let all: Vec<_> = (0..1000).map(light).collect();
    let tree = LightTree::new(all.clone(), 1000);
    let deviation = |k: u32| {
        let from = DVec3::new(f64::from(k % 10) / 9.0, 0.0, f64::from(k / 10) / 9.0);
        let (mut sum, mut squares) = (0.0, 0.0);
        for NumberedCluster { number, cluster: light } in &all {
            let way = light.bounds.min - from;
            let brings = way.normalize().y.powi(2) / way.length_squared();
            sum += brings;
            squares += brings * brings / tree.chance(&receiver(from, true), *number as usize);
        }
        (squares / (sum * sum) - 1.0).sqrt()
    };
    let mut deviations: Vec<f64> = (0..100).map(deviation).collect();
    deviations.sort_by(f64::total_cmp);
    assert!(deviations[50] < 0.065, "{} {}", deviations[50], deviations[99]);
}

#[test]
fn lights_in_one_place_and_along_a_line_are_parted_too() {
    for step in [0.0, 1.0] {
        let line = |number: u32| {
            let place = DVec3::X * (step * f64::from(number));
            NumberedCluster { number, cluster: at(place, DVec3::Y, 0.0, 1.0) }
        };
        let tree = LightTree::new((0..1000).map(line).collect(), 1000);
        let from = receiver(DVec3::new(3.0, 4.0, 0.0), false);
        let sum: f64 = (0..1000).map(|k| tree.chance(&from, k)).sum();
        assert!((sum - 1.0).abs() < 1e-12, "{sum}");
    }
    // All face away; along a line, the ball around a far node reaches to the other side.
    let cluster = at(DVec3::X, DVec3::Y, 0.0, 1.0);
    let here = (0..1000).map(|number| NumberedCluster { number, cluster }).collect();
    let behind = receiver(DVec3::new(3.0, -4.0, 0.0), false);
    assert_eq!(pick(&LightTree::new(here, 1000), behind, 0.5).chance, 0.0);
}
