//! The split of the lights of a node.

use super::cluster::Cluster;

/// Intervals of an axis that a split is looked for between.
const BUCKETS: usize = 12;

/// Puts lights in an order in which those of the first part come first, at least one and not all; how many these
/// are. `evenly`: as many as of the second.
pub(super) fn split(lights: &mut [(u32, Cluster)], evenly: bool) -> usize {
    let half = lights.len() / 2;
    let centre = |light: &(u32, Cluster), axis: usize| light.1.bounds.centre()[axis];
    let range = |axis: usize| {
        let ends = |(low, high): (f64, f64), light| {
            let c = centre(light, axis);
            (low.min(c), high.max(c))
        };
        lights.iter().fold((f64::INFINITY, f64::NEG_INFINITY), ends)
    };
    let widest = (0..3).map(|axis| range(axis).1 - range(axis).0).fold(0.0, f64::max);
    let mut best: Option<(f64, usize, usize)> = None;
    for axis in 0..3 {
        let (low, high) = range(axis);
        if high <= low || evenly {
            continue;
        }
        let place = |light: &(u32, Cluster)| bucket(centre(light, axis), low, high);
        let mut buckets: [Option<Cluster>; BUCKETS] = [None; BUCKETS];
        for light in &*lights {
            let own = &mut buckets[place(light)];
            *own = Some(own.map_or(light.1, |all| all.union(&light.1)));
        }
        let together = |part: &[Option<Cluster>]| {
            part.iter().flatten().copied().reduce(|a, b| a.union(&b)).map(|c| c.cost())
        };
        for end in 1..BUCKETS {
            let (Some(a), Some(b)) = (together(&buckets[..end]), together(&buckets[end..])) else {
                continue;
            };
            let cost = (a + b) * widest / (high - low);
            if best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, axis, end));
            }
        }
    }
    let Some((_, axis, end)) = best else { return half };
    let (low, high) = range(axis);
    lights.sort_by_key(|light| bucket(centre(light, axis), low, high) >= end);
    let middle = lights.partition_point(|light| bucket(centre(light, axis), low, high) < end);
    if middle == 0 || middle == lights.len() { half } else { middle }
}

/// The interval of a place between two ends.
fn bucket(at: f64, low: f64, high: f64) -> usize {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in 0..=1")]
    let bucket = ((at - low) / (high - low) * BUCKETS as f64) as usize;
    bucket.min(BUCKETS - 1)
}
