//! At how many samples, and when, a contender reaches the target, by its last renders.

/// The most samples that are foretold, and rendered.
pub(super) const MOST_SAMPLES: f64 = 1e6;

/// One render of a contender.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TrialRender {
    pub(super) samples: u32,
    pub(super) seconds: f64,
    /// The squared error over the squared mean, less that of the converged picture.
    pub(super) square: f64,
}

/// Samples and time (s) at which the target is reached.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Forecast {
    pub(super) samples: u32,
    pub(super) seconds: f64,
}

/// The render with most samples, and one before it with half as many at most, where there is one: what two of nearly
/// one number differ by is noise, and that a number is a power of two.
pub(super) fn apart(points: &[TrialRender]) -> Option<(&TrialRender, &TrialRender)> {
    let (two, before) = points.split_last()?;
    let half = before.iter().rev().find(|one| 2 * one.samples <= two.samples);
    Some((half.or(before.first())?, two))
}

/// The last two renders carried on to a squared error: as b² + v/n, and a + c n. `None` where no number of samples
/// is enough, or nothing is known.
pub(super) fn forecast(points: &[TrialRender], target: f64) -> Option<Forecast> {
    let (one, two) = apart(points)?;
    let [n, m] = [one, two].map(|point| f64::from(point.samples));
    let fallen = (one.square - two.square) / (1.0 / n - 1.0 / m);
    // Faster than 1/n leaves nothing that samples do not mend; no fall at all is noise or such a rest.
    let (variance, rest) = match two.square - fallen / m {
        rest if fallen <= 0.0 => (0.0, rest.max(two.square)),
        rest if rest > 0.0 => (fallen, rest),
        _ => (two.square * m, 0.0),
    };
    let left = target * target - rest;
    let samples = if left > 0.0 { (variance / left).max(1.0) } else { f64::INFINITY };
    if samples > MOST_SAMPLES {
        return None;
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to a million")]
    let samples = samples.ceil() as u32;
    Some(Forecast { samples, seconds: seconds_of(points, samples) })
}

/// The time (s) of so many samples by the last two renders: as a + c n.
pub(super) fn seconds_of(points: &[TrialRender], samples: u32) -> f64 {
    let Some((one, two)) = apart(points) else { return f64::INFINITY };
    let [n, m] = [one, two].map(|point| f64::from(point.samples));
    let slope = ((two.seconds - one.seconds) / (m - n)).max(0.0);
    (two.seconds + slope * (f64::from(samples) - m)).max(0.0)
}
