//! Sample counts of a picture's pixels, and what a user should know of them.

/// The share of pixels that may be so without a word.
const FEW: f64 = 0.01;

/// The relative standard error of the picture's variance, by its own samples, from which on it cannot be judged: that
/// of thirty pixels that carry all of it.
const UNJUDGED: f64 = 0.15;

/// Least ratio of that error to the error of as many even pixels: easy and hard parts differ by about two.
const UNEVEN: f64 = 3.0;

/// The least mean variance, as a share of what is allowed, of which it matters how well it is known.
const MATTERS: f64 = 0.1;

/// Unit in which variance, and its square, is counted: whole numbers add up to the same in any order.
const UNIT: f64 = 1000.0;

/// The largest variance of a pixel that is counted, as a share of what is allowed.
const LARGEST: f64 = 1e5;

/// Numbers of samples of the pixels of a picture.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SampleCounts {
    /// The fewest.
    pub least: u32,
    /// The most.
    pub most: u32,
    /// Pixels.
    pub pixels: u64,
    /// Samples of all of them together.
    pub total: u64,
    /// Pixels that were given up at the most samples.
    pub given_up: u64,
    /// Pixels of blocks that were done by what others found, and have more than twice the variance that was allowed: so
    /// many as by their own samples are to be expected.
    #[serde(default)]
    pub over: u64,
    /// The middle of the worst block of these (column and row, from 0), and its error as a share of what
    /// was allowed (of variances).
    pub worst: Option<([u32; 2], f64)>,
    /// The variances of all pixels by their own samples, as shares of what was allowed, and their squares; in
    /// thousandths.
    #[serde(default)]
    pub variances: [u64; 2],
}

impl SampleCounts {
    /// Of a pixel with so many samples, whose own tell this variance as a share of what was allowed.
    pub(super) fn of_pixel(count: u32, variance: f64) -> Self {
        let variance = variance.clamp(0.0, LARGEST);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let variances = [variance, variance * variance].map(|v| (UNIT * v).round() as u64);
        Self {
            least: count,
            most: count,
            pixels: 1,
            total: u64::from(count),
            given_up: 0,
            over: 0,
            worst: None,
            variances,
        }
    }

    /// Of two parts of a picture.
    pub(crate) fn and(self, other: Self) -> Self {
        let worst = [self.worst, other.worst].into_iter().flatten();
        // The first of equals in the order of rows, so that shares give what the whole does.
        let worst = worst.reduce(|a, b| {
            let place = |worst: ([u32; 2], f64)| (worst.0[1], worst.0[0]);
            let first = if place(a) <= place(b) { [a, b] } else { [b, a] };
            if first[1].1 > first[0].1 { first[1] } else { first[0] }
        });
        Self {
            least: self.least.min(other.least),
            most: self.most.max(other.most),
            pixels: self.pixels + other.pixels,
            total: self.total + other.total,
            given_up: self.given_up + other.given_up,
            over: self.over + other.over,
            worst,
            variances: [0, 1].map(|k| self.variances[k].saturating_add(other.variances[k])),
        }
    }

    /// Samples of a pixel in the mean.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.total as f64 / self.pixels.max(1) as f64
    }

    /// The variance of the picture's samples as a share of what was allowed, in the mean over its pixels, by their own
    /// samples; and its standard error as a share of it, by how unevenly the pixels bring it.
    #[must_use]
    pub fn variance(&self) -> [f64; 2] {
        let [sum, squares] = self.variances.map(|sum| sum as f64 / UNIT);
        // Even pixels differ, too: the square of one normal number is 1 ± √2.
        let error = (2.0 / 3.0 * squares).sqrt() / sum.max(f64::MIN_POSITIVE);
        [sum / self.pixels.max(1) as f64, if sum > 0.0 { error } else { 0.0 }]
    }

    /// True if a few pixels bring so much of the picture's variance that nobody can tell how large it is.
    #[must_use]
    pub fn is_unjudged(&self) -> bool {
        let [mean, error] = self.variance();
        let even = (2.0 / self.pixels.max(1) as f64).sqrt();
        mean > MATTERS && error > UNJUDGED.max(UNEVEN * even)
    }

    /// In words.
    #[must_use]
    pub fn words(&self) -> String {
        format!("{} to {}, {:.1} in the mean", self.least, self.most, self.mean())
    }

    /// Notes for the user on pixels that were given up, or stopped too early, and of a picture that cannot be judged.
    #[must_use]
    pub fn notes(&self) -> Vec<String> {
        self.of_pixels().into_iter().chain(self.of_rare_light()).collect()
    }

    fn of_pixels(&self) -> Option<String> {
        let ([column, row], error) = self.worst?;
        let part = |pixels: u64| pixels as f64 / self.pixels.max(1) as f64;
        let many = part(self.over) > FEW;
        let what = match (self.given_up, many) {
            (0, false) => return None,
            (0, true) => None,
            (given_up, _) => Some(format!(
                "{:.2} % of the pixels still have more error than `render.samples` allows after {} samples",
                100.0 * part(given_up),
                self.most
            )),
        };
        let over = many.then(|| {
            format!(
                "{:.2} % of the pixels stopped with more than twice the variance that `render.samples` allows, by their \
                 own samples, of which those beside them saw too little",
                100.0 * part(self.over)
            )
        });
        let what: Vec<String> = what.into_iter().chain(over).collect();
        let remedy = if self.given_up > 0 { "`max`" } else { "`min`" };
        Some(format!(
            "samples: {}; the worst are around column {column}, row {row}, with {error:.1} times the \
             variance; give {remedy} a larger number, or see what shines so unevenly there",
            what.join("; ")
        ))
    }

    fn of_rare_light(&self) -> Option<String> {
        let [mean, error] = self.variance();
        self.is_unjudged().then(|| {
            format!(
                "samples: this picture cannot be judged: rare bright samples carry its error, {mean:.2} times the variance \
                 that `render.samples` allows in the mean, known to {:.0} % only; where none of them fell, more is \
                 missing than what stopped there knows. Give `min` a larger number, or the lamp another size",
                100.0 * error
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(variances: impl Iterator<Item = f64>) -> SampleCounts {
        variances.map(|v| SampleCounts::of_pixel(16, v)).reduce(SampleCounts::and).unwrap()
    }

    /// A picture of few flashes cannot be judged: what a few pixels bring is known to the root of
    /// their number; what all bring by one square each, to √(2/n).
    #[test]
    fn a_picture_of_few_flashes_cannot_be_judged() {
        let flashes = |every: usize| {
            picture((0..4096).map(move |k| if k % every == 0 { 300.0 } else { 0.01 }))
        };
        assert!(flashes(1024).is_unjudged() && !flashes(64).is_unjudged());
        assert!(flashes(1024).notes()[0].contains("cannot be judged"));
        // Squares of evenly spread normal numbers have a mean square of 3.
        let even = picture((0..4096).map(|k| if k % 3 == 0 { 3.0 } else { 0.0 }));
        let [mean, error] = even.variance();
        assert!((mean - 1.0).abs() < 1e-3, "{mean}");
        assert!((error / (2.0_f64 / 4096.0).sqrt() - 1.0).abs() < 1e-3, "{error}");
        assert_eq!(even.notes(), Vec::<String>::new());
        // In the dark nothing matters.
        assert!(!picture((0..64).map(|_| 0.0)).is_unjudged());
    }
}
