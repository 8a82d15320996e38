//! The pictures that the soonest settings and a few others give in one time, side by side, as papers show them.

use super::Race;
use super::forecast::{Forecast, apart};
use crate::BenchError;
use crate::target::{AS_IT_IS, EqualTime, Outcome, Run, Strip, Verification};

/// The most settings that are shown: the scene as it is, the soonest, and those next to it.
const MOST: usize = 4;

/// The share of a render's time that its samples take, at least.
const LEAST_OF_SAMPLES: f64 = 0.1;

/// Side of what is shown of the picture, at most (pixels).
const SIDE: usize = 192;

impl<E: From<BenchError>> Race<'_, E> {
    /// Renders the scene as it is, the soonest and those next to it, each with as many samples as fit into the time that
    /// the soonest took; the converged picture stands first among the pictures. What there is no time for is left out.
    pub(super) fn equal_time(
        &mut self,
        found: &Verification,
    ) -> Result<(Vec<EqualTime>, Option<Strip>), E> {
        let mut order: Vec<usize> = (0..self.entries.len()).collect();
        order.sort_by(|&a, &b| {
            self.time_of(&self.entries[a]).total_cmp(&self.time_of(&self.entries[b]))
        });
        let is_first = |who: &usize| {
            let name = &self.entries[*who].contender.name;
            (name != AS_IT_IS, *name != found.name)
        };
        order.sort_by_key(is_first);
        let (mut rows, mut pictures) = (Vec::new(), vec![self.converged.clone()]);
        let mut shape = [0; 3];
        for who in order {
            if rows.len() == MOST || found.seconds > self.left(1.0) {
                break;
            }
            let Some(Forecast { samples, .. }) = within(&self.entries[who].points, found.seconds)
            else {
                continue;
            };
            self.seed += 1;
            let contender = &self.entries[who].contender;
            let run = Run { contender, samples, seed: self.seed };
            let Outcome::Done(run) = (self.program)(run)? else { continue };
            let (_, render) = self.judged(contender.name.clone(), samples, &run);
            shape = run.shape;
            rows.push(EqualTime {
                name: render.name,
                samples,
                seconds: render.seconds,
                error: render.error,
                relative_mse: render.relative_mse,
            });
            pictures.push(run.values);
        }
        if rows.is_empty() {
            self.notes.push(
                "no time was left for pictures of one time; more --seconds have them".to_owned(),
            );
        }
        Ok((rows, strip(&pictures, shape)))
    }
}

/// The samples that fit into so many seconds, by the last two renders, one at least; `None` where there are not two.
fn within(points: &[super::TrialRender], seconds: f64) -> Option<Forecast> {
    let (one, two) = apart(points)?;
    let [n, m] = [one, two].map(|point| f64::from(point.samples));
    // Two short times may be alike by chance: a tenth of the longer one is its samples', at least.
    let least = LEAST_OF_SAMPLES * two.seconds / m;
    let slope = ((two.seconds - one.seconds) / (m - n)).max(least).max(f64::MIN_POSITIVE);
    let samples = (m + (seconds - two.seconds) / slope).clamp(1.0, super::forecast::MOST_SAMPLES);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to a million")]
    Some(Forecast { samples: samples as u32, seconds })
}

/// Part that is shown of pictures of one `shape`, the converged one first: where the second differs from it most. `None`
/// where there are no two, or they are none.
fn strip(pictures: &[Vec<f64>], shape @ [width, height, depth]: [usize; 3]) -> Option<Strip> {
    let [converged, second, ..] = pictures else { return None };
    let is_whole = |values: &Vec<f64>| values.len() == shape.iter().product::<usize>();
    if width == 0 || !pictures.iter().all(is_whole) {
        return None;
    }
    let side = [width, height].map(|side| side.min(SIDE));
    let starts = |all: usize, side: usize| {
        (0..=all - side).step_by((side / 2).max(1)).chain(std::iter::once(all - side))
    };
    let difference = |&[left, top]: &[usize; 2]| -> f64 {
        let row = |y: usize| ((y * width + left) * depth)..((y * width + left + side[0]) * depth);
        let pixels = (top..top + side[1]).flat_map(row);
        pixels.map(|at| (second[at] - converged[at]).powi(2)).sum()
    };
    let places =
        starts(height, side[1]).flat_map(|top| starts(width, side[0]).map(move |left| [left, top]));
    let [left, top] = places.max_by(|a, b| difference(a).total_cmp(&difference(b)))?;
    // White is what a hundredth of the converged picture is brighter than.
    let mut sorted = converged.clone();
    sorted.sort_by(f64::total_cmp);
    let white = sorted[(sorted.len() - 1) * 99 / 100].max(f64::MIN_POSITIVE);
    let shown = |values: &Vec<f64>| -> Vec<u8> {
        let pixel = |x: usize, y: usize| {
            let first = (y * width + x) * depth;
            let colour = |k: usize| values[first + if depth >= 3 { k } else { 0 }];
            [0, 1, 2].map(colour).map(|value| {
                let grey = 255.0 * (value / white).clamp(0.0, 1.0).powf(1.0 / 2.2);
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "clamped"
                )]
                let grey = grey.round() as u8;
                grey
            })
        };
        let rows = top..top + side[1];
        rows.flat_map(|y| (left..left + side[0]).flat_map(move |x| pixel(x, y))).collect()
    };
    Some(Strip { side, corner: [left, top], pictures: pictures.iter().map(shown).collect() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::target::race::TrialRender;

    #[test]
    fn as_many_samples_as_fit_are_told_by_two_renders() {
        let point = |samples: u32| TrialRender {
            samples,
            seconds: 0.5 + 0.01 * f64::from(samples),
            square: 0.0,
        };
        let found = within(&[point(4), point(16)], 2.5).unwrap();
        assert!((199..=200).contains(&found.samples), "{found:?}");
        assert_eq!(within(&[point(4), point(16)], 0.1).unwrap().samples, 1);
        assert_eq!(within(&[point(4)], 1.0), None);
        // Times that do not differ are no reason for a million.
        let same = [4, 16].map(|samples| TrialRender { samples, seconds: 0.5, square: 0.0 });
        assert_eq!(within(&same, 1.0).unwrap().samples, 176);
    }

    /// Of a wide picture the part is shown where the second differs, in the grey of the converged one's white.
    #[test]
    fn a_strip_shows_where_pictures_differ_most() {
        let shape = [600, 100, 1];
        let converged = vec![4.0; 60_000];
        let mut other = converged.clone();
        other[50 * 600 + 500] = 1.0;
        let strip = strip(&[converged, other], shape).unwrap();
        assert_eq!(strip.side, [192, 100]);
        assert!(strip.corner[0] > 500 - 192 && strip.corner[0] <= 500, "{:?}", strip.corner);
        let at = 3 * (50 * 192 + 500 - strip.corner[0]);
        assert_eq!(strip.pictures[0][at..at + 3], [255; 3]);
        // A quarter to the power of 1/2.2.
        assert_eq!(strip.pictures[1][at..at + 3], [136; 3]);
        assert!(super::strip(&[vec![1.0; 4], vec![1.0; 4]], shape).is_none());
    }
}
