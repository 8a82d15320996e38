//! Numbers of samplers as light asks for them: how evenly they fill the square.

use etendue_camera::{PixelRun, PixelSample, SampleKeys, Sampler};

/// Samples that are looked at together.
const COUNT: u32 = 64;

/// Pairs of dimensions that the camera and the first surfaces of a path use.
const PAIRS: u32 = 12;

/// One pair of dimensions of some samples by each way in which it is asked for: of all of them, of picked ones, and of
/// picked ones in single precision.
fn asked(samples: &[PixelSample], pair: u32) -> [Vec<[f64; 2]>; 3] {
    let mut keys = SampleKeys::default();
    let run = |of: &PixelSample| PixelRun { pixel: of.pixel, numbers: of.index..of.index + 1 };
    keys.refill(samples.iter().map(run));
    let picked: Vec<u32> = (0..COUNT).rev().collect();
    let (mut all, mut some) = (Vec::new(), Vec::new());
    let mut floats = [Vec::new(), Vec::new()];
    keys.squares_of_all(pair, &mut all);
    keys.squares_of_pair(&picked, pair, &mut some);
    keys.floats_of_pair(&picked, pair, &mut floats);
    let [x, y] = floats;
    let floats = x.into_iter().zip(y).map(|(x, y)| [x, y].map(f64::from)).collect();
    [all, some, floats]
}

/// Numbers of points in the boxes of a grid of so many columns and rows.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below 64")]
fn boxes(points: &[[f64; 2]], [columns, rows]: [u32; 2]) -> Vec<u32> {
    let mut boxes = vec![0; (columns * rows) as usize];
    for [x, y] in points {
        let (column, row) = (x * f64::from(columns), y * f64::from(rows));
        boxes[row as usize * columns as usize + column as usize] += 1;
    }
    boxes
}

/// The last samples of a pixel, from the number `first` on.
fn samples(sampler: Sampler, [column, row]: [u32; 2], first: u32) -> Vec<PixelSample> {
    let pixel = sampler.pixel(7, column, row, first + COUNT);
    pixel.samples(first..first + COUNT).collect()
}

/// Of 64 samples from a multiple of 64 on each box of 2⁻ᵃ by 2ᵃ⁻⁶ has one, for all a, the 8 by 8 among them.
#[test]
fn each_elementary_interval_has_one_of_64_samples() {
    for sampler in [Sampler::Sobol, Sampler::BlueNoise] {
        for (pixel, first) in [([0, 0], 0), ([5, 3], 64), ([638, 479], 192), ([17, 2], 1 << 16)] {
            let samples = samples(sampler, pixel, first);
            for pair in 0..PAIRS {
                for (way, points) in asked(&samples, pair).iter().enumerate() {
                    assert_eq!(points.len(), samples.len());
                    for a in 0..=6_u32 {
                        let boxes = boxes(points, [1 << a, 1 << (6 - a)]);
                        assert!(
                            boxes.iter().all(|&points| points == 1),
                            "{sampler:?}, pixel {pixel:?} from {first}, pair {pair}, way {way}, 2^-{a}: {boxes:?}"
                        );
                    }
                }
            }
        }
    }
}

/// `stratified` takes a grid that is as square as it can be, and puts one sample into each of its cells.
#[test]
fn each_of_8_by_8_cells_has_one_of_64_stratified_samples() {
    let samples = samples(Sampler::Stratified, [638, 479], 0);
    for pair in 0..PAIRS {
        for points in asked(&samples, pair) {
            let boxes = boxes(&points, [8, 8]);
            assert!(boxes.iter().all(|&points| points == 1), "pair {pair}: {boxes:?}");
        }
    }
}
