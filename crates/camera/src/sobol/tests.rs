use sobol_burley::parts::sobol_rev;

use super::*;

const HALVES: [Half; 2] = [Half::First, Half::Second];

#[test]
fn the_second_dimension_is_that_of_the_crate() {
    // Its table has 16 bits of indices.
    for index in (0..1 << 16).step_by(37) {
        let reversed: u32 = index;
        assert_eq!(second_reversed(index), sobol_rev(reversed.reverse_bits(), 1), "{index}");
        assert_eq!(index, sobol_rev(reversed.reverse_bits(), 0), "{index}");
    }
}

/// Of 2ᵐ points from a multiple of 2ᵐ on, one lies in each box of 2⁻ᵃ by 2ᵃ⁻ᵐ, for all a.
#[test]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below 2¹⁰")]
fn points_are_a_net_in_every_elementary_interval() {
    for (m, first, seed) in [(4, 0, 1), (6, 64, 2), (8, 1 << 15, 3), (10, 3 << 10, 4)] {
        let count = 1_u32 << m;
        let keys: Vec<SobolKey> =
            (first..first + count).map(|index| SobolKey { index, seed }).collect();
        let mut out = vec![[0.0; 2]; keys.len()];
        for half in HALVES {
            points(&keys, half, &mut out);
            for a in 0..=m {
                let mut boxes = vec![0; count as usize];
                for [x, y] in &out {
                    let column = (x * f64::from(1 << a)) as usize;
                    let row = (y * f64::from(1 << (m - a))) as usize;
                    boxes[row << a | column] += 1;
                }
                let are_even = boxes.iter().all(|&points| points == 1);
                assert!(are_even, "2^{m} points, {half:?}, 2^-{a}: {boxes:?}");
            }
        }
    }
}

#[test]
fn many_points_are_those_one_by_one() {
    let keys: Vec<SobolKey> =
        (0..77).map(|i: u32| SobolKey { index: i * 7919, seed: i / 5 }).collect();
    let mut out = vec![[0.0; 2]; keys.len()];
    for half in HALVES {
        points(&keys, half, &mut out);
        assert_eq!(out, keys.iter().map(|&key| point(key, half)).collect::<Vec<_>>());
    }
    let mut both = [out.clone(), out.clone()];
    let [first, second] = &mut both;
    points_of_sets(&keys, [first, second]);
    for (half, found) in HALVES.into_iter().zip(both) {
        points(&keys, half, &mut out);
        assert_eq!(out, found, "{half:?}");
    }
}

/// The mean square of the mean of a function of two pairs over `count` samples, of many sets; `of_pairs` gives the two
/// pairs of a sample of a set.
fn mean_square(
    count: u32,
    function: impl Fn([f64; 2], [f64; 2]) -> f64,
    of_pairs: impl Fn(u32, u32) -> [[f64; 2]; 2],
) -> f64 {
    let sets = (256_000 / count).min(4000);
    let square = |set: u32| {
        let value = |index| {
            let [a, b] = of_pairs(index, set);
            function(a, b)
        };
        ((0..count).map(value).sum::<f64>() / f64::from(count)).powi(2)
    };
    (0..sets).map(square).sum::<f64>() / f64::from(sets)
}

fn of_one_set(index: u32, set: u32) -> [[f64; 2]; 2] {
    HALVES.map(|half| point(SobolKey { index, seed: 77 * set }, half))
}

fn of_two_sets(index: u32, set: u32) -> [[f64; 2]; 2] {
    [0, 1].map(|k| point(SobolKey { index, seed: 77 * set + k }, Half::First))
}

/// Two halves of a set are even together: the product of two smooth functions varies less than a fifth as much as by
/// pairs of two sets, for any power of two.
#[test]
fn the_halves_of_a_set_are_even_together() {
    let smooth = |[x, y]: [f64; 2]| (std::f64::consts::TAU * x).sin() + 2.0 * y - 1.0;
    let product = |a, b| smooth(a) * smooth(b);
    for count in [16, 32, 64, 128] {
        let [one, two] =
            [mean_square(count, product, of_one_set), mean_square(count, product, of_two_sets)];
        assert!(one < 0.2 * two, "{count}: {one} {two}");
    }
}

/// Nor are they worse together than by pairs of two sets where edges run across both, for any power of two: a sequence
/// whose digits lead from one pair to the other fails here from 1024 samples on.
#[test]
fn edges_across_the_halves_of_a_set_are_counted_as_well_as_across_sets() {
    for slope in [-1.5, 0.7, 2.0] {
        let edge = |x: f64, y: f64| if x - 0.5 + slope * (y - 0.5) > 0.0 { 0.5 } else { -0.5 };
        let across = |[ax, ay]: [f64; 2], [bx, by]: [f64; 2]| {
            0.5 * (edge(ax, bx) + edge(ay, by) + edge(ax, by) + edge(ay, bx))
        };
        for count in [16, 64, 256, 1024, 4096] {
            let [one, two] =
                [mean_square(count, across, of_one_set), mean_square(count, across, of_two_sets)];
            // Of 62 sets a mean square is uncertain by 18 %.
            assert!(one < 1.5 * two, "{slope}, {count}: {one} {two}");
        }
    }
}

/// Mean square of the error of discs, wherever they are and whatever their size, by `count` of the points that `of` gives
/// by index and seed.
fn error_of_discs(count: u32, of: impl Fn(u32, u32) -> [f64; 2]) -> f64 {
    let discs = 6000;
    let square = |disc: u32| {
        let [[size, x], [y, _]] = of_two_sets(disc, 3);
        let radius = 0.05 + 0.3 * size;
        let centre = [x, y].map(|x| radius + (1.0 - 2.0 * radius) * x);
        let is_inside = |index: u32| {
            let [x, y] = of(index, disc);
            f64::from(u8::from((x - centre[0]).hypot(y - centre[1]) < radius))
        };
        let share = (0..count).map(is_inside).sum::<f64>() / f64::from(count);
        (share - std::f64::consts::PI * radius * radius).powi(2)
    };
    (0..discs).map(square).sum::<f64>() / f64::from(discs)
}

/// Points keep their distance: the error of discs has at most 0.9 times the mean square that Owen's scrambling alone
/// leaves, by the crate's own points.
#[test]
fn discs_are_counted_better_than_by_scrambling_alone() {
    for count in [16, 64] {
        let by_scrambling = error_of_discs(count, |index, seed| {
            [0, 1].map(|dimension| f64::from(sobol_burley::sample(index, dimension, seed)))
        });
        for half in HALVES {
            let key = |index, seed: u32| SobolKey { index, seed: 77 * seed };
            let own = error_of_discs(count, |index, seed| point(key(index, seed), half));
            let ratio = own / by_scrambling;
            assert!(ratio < 0.9, "{count}, {half:?}: {ratio}");
        }
    }
}

/// A count that is no power of two is better than the power below it: half as many again have at most 0.9 times the
/// mean square.
#[test]
fn any_count_of_samples_is_a_good_one() {
    let of = |count| {
        error_of_discs(count, |i, seed| point(SobolKey { index: i, seed: 77 * seed }, Half::First))
    };
    for power in [16, 32, 64] {
        let ratio = of(power + power / 2) / of(power);
        assert!(ratio < 0.9, "{power}: {ratio}");
    }
}

/// Sets are padded as if at random: of the halves of two pairs in which samples lie, drawn without a loss four by
/// four, the product has a variance of 4/3 over their number. Indices that stay neighbours have 2.
#[test]
fn sets_are_padded_as_if_at_random() {
    let half = |[x, _]: [f64; 2]| if x < 0.5 { -1.0 } else { 1.0 };
    for count in [4, 16, 64] {
        let square = mean_square(count, |a, b| half(a) * half(b), of_two_sets);
        let ratio = f64::from(count) * square;
        // Four standard errors of 4000 squares, of which none is more uneven than a normal number's.
        assert!(
            (ratio - 4.0 / 3.0).abs() < 4.0 / 3.0 * 4.0 * (2.0_f64 / 4000.0).sqrt(),
            "{count}: {ratio}"
        );
    }
}

/// Pairs of one sample do not know of each other: the mean of the product of two uniform numbers is
/// 1/4, with a standard deviation of √(7/144).
#[test]
fn pairs_are_independent() {
    let count = 1 << 14;
    let keys =
        |pair: u32| (0..count).map(move |i| SobolKey { index: i % 64, seed: i / 64 * 8 + pair });
    let product =
        |(a, b): (SobolKey, SobolKey)| point(a, Half::First)[0] * point(b, Half::First)[0];
    let mean = keys(0).zip(keys(1)).map(product).sum::<f64>() / f64::from(count);
    // Four standard errors.
    assert!((mean - 0.25).abs() < 4.0 * 0.2205 / 128.0, "{mean}");
}

/// The last bits are random: what a table of 2²⁴ entries leaves of a number is as even as the
/// number: all 29 bits behind the 24th are set as often as not.
#[test]
fn the_last_bits_are_random() {
    let count = 1 << 16;
    let keys: Vec<SobolKey> =
        (0..count).map(|i| SobolKey { index: i % 256, seed: hash(i / 256) }).collect();
    let mut out = vec![[0.0; 2]; keys.len()];
    points(&keys, Half::Second, &mut out);
    for bit in 25..=53 {
        let set = |x: &f64| (x * f64::from(bit).exp2()).rem_euclid(2.0) >= 1.0;
        for k in 0..2 {
            let share = out.iter().filter(|pair| set(&pair[k])).count() as f64 / out.len() as f64;
            // Four and a half standard errors: one in 10⁵ of 58.
            assert!((share - 0.5).abs() < 4.5 * 0.5 / 256.0, "bit {bit}: {share}");
        }
    }
}
