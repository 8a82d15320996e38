//! Sparkles: light that a handful of samples carries, as of small lamps in polished metal or through glass. Where a path
//! finds such light by chance alone, most of a picture's energy may come by a few of a million samples: the mean is right,
//! the picture far from it.

use serde::{Deserialize, Serialize};

/// So many samples are a handful.
const HANDFUL: usize = 16;

/// The share of the picture's light that a handful may carry before it is said.
const SHARE: f64 = 0.01;

/// The fewest samples of a pixel in a batch of which one can stand out.
const FEWEST: usize = 8;

/// The fewest samples of a picture of which a handful is few.
const FEW_OF: u64 = 1000 * HANDFUL as u64;

/// The brightest samples that outshine all others of their pixels together, and all light.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Sparkles {
    samples: u64,
    total: f64,
    /// Excess of each over all others of its pixel, the brightest first.
    brightest: Vec<f64>,
}

impl Sparkles {
    /// Counts the samples of a pixel, by their light.
    pub(crate) fn count(&mut self, light: impl Iterator<Item = f64>) {
        let (mut count, mut sum, mut most) = (0, 0.0, 0.0_f64);
        for light in light {
            count += 1;
            sum += light;
            most = if light > most { light } else { most };
        }
        self.samples += count as u64;
        self.total += sum;
        let over = most - (sum - most);
        if count >= FEWEST && over > 0.0 {
            self.note(over);
        }
    }

    fn note(&mut self, over: f64) {
        let place = self.brightest.partition_point(|&own| own > over);
        if place < HANDFUL {
            self.brightest.insert(place, over);
            self.brightest.truncate(HANDFUL);
        }
    }

    /// Adds what another thread counted.
    pub(crate) fn merge(&mut self, other: &Self) {
        self.samples += other.samples;
        self.total += other.total;
        other.brightest.iter().for_each(|&over| self.note(over));
    }

    /// Note for the user on the sparkles.
    pub(crate) fn note_in_words(&self) -> Option<String> {
        let share = self.brightest.iter().sum::<f64>() / self.total;
        let count = self.brightest.len();
        (self.samples >= FEW_OF && share >= SHARE).then(|| {
            format!(
                "sparkles: {count} of {} samples carry {:.1} % of the picture's light, each of them more than all others \
                 of its pixel: light of small or far lamps that is found by chance, in polished surfaces or through \
                 glass. The mean is right, the picture is noise there: take more samples, larger lamps or rougher \
                 surfaces",
                self.samples,
                100.0 * share
            )
        })
    }
}
