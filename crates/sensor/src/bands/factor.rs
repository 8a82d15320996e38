//! Products of curves that light may meet on its way.

use etendue_spectrum::Curve;

/// The part of white that bodies and metals leave of it, below which their light need not be better.
pub(super) const DIM: f64 = 0.003;

/// Steps between the lengths of way that are tried.
const STEP: f64 = 1.4;

/// Share of light that the shortest way that is tried leaves.
const NEARLY_CLEAR: f64 = 0.98;

/// The most lengths of way that are tried.
const MOST_LENGTHS: usize = 32;

/// A curve that light may be multiplied by, beside lights, filters and colours.
#[derive(Debug, Clone, PartialEq)]
pub struct Factor {
    /// Share of the light that is left, 0 to 1; held beyond its ends.
    pub curve: Curve,
    /// Number of times that light meets the factor.
    pub times: Times,
}

/// Number of times that light is multiplied by a curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Times {
    /// Once to so many times: what surfaces reflect one after the other.
    UpTo(u8),
    /// To any power: what a body leaves after a way through it.
    AnyPower,
}

/// Spectra and filters that the bands of a render have to tell apart.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Illumination {
    /// Spectra of the lights, to any factor; none for equal energy.
    pub spectra: Vec<Curve>,
    /// Curves of filters in front of the sensor, each of which may be what light passes.
    pub filters: Vec<Curve>,
    /// Number of coloured factors that light meets on its way to the sensor: its own colour and
    /// those of surfaces; more than three count as three.
    pub colored: usize,
    /// Other curves that light may be multiplied by on its way.
    pub factors: Vec<Factor>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_are_all_there_is_room_for_and_the_simple_ones_first() {
        assert_eq!([0, 1, 2, 3, 9].map(|n| of_colors(n).len()), [1, 4, 10, 20, 20]);
        let powers = [vec![1.0, 2.0], vec![0.5]];
        let all = Products::of(1, &powers, &[true; 2], 1000).unwrap();
        // Four colours with nothing, three powers and one pair.
        assert_eq!((all.all.len(), all.complete), (4 * 5, true));
        let few = Products::of(1, &powers, &[true; 2], 7).unwrap();
        assert_eq!((few.all.len(), few.complete), (7, false));
        let once = Products::of(0, &[vec![1.0], vec![1.0]], &[false; 2], 1000).unwrap();
        assert_eq!(once.all.len(), 3, "no pair where light is scattered once");
        assert!(few.all[4..].iter().all(|p| p.colors.is_empty() && p.factors.len() == 1));
        assert_eq!(Products::of(3, &powers, &[true; 2], 19), None);
    }

    #[test]
    fn lengths_of_way_go_from_nearly_clear_to_dim() {
        let powers = Times::AnyPower.powers(|p| [(-0.001 * p).exp(); 2]);
        assert!((-0.001 * powers[0]).exp() >= 0.98 && powers.len() < MOST_LENGTHS);
        assert!((-0.001 * powers[powers.len() - 1]).exp() < DIM);
        assert_eq!(Times::UpTo(2).powers(|_| [1.0; 2]), [1.0, 2.0]);
    }
}

impl Times {
    /// True if light may meet a second curve after it.
    pub(super) fn may_repeat(self) -> bool {
        self != Self::UpTo(1)
    }

    /// The powers that are tried; `left` tells what one leaves of white light in the channels that it leaves least
    /// and most of.
    pub(super) fn powers(self, left: impl Fn(f64) -> [f64; 2]) -> Vec<f64> {
        let most = match self {
            Self::UpTo(times) => return (1..=times).map(f64::from).collect(),
            Self::AnyPower => MOST_LENGTHS,
        };
        let mut power = 1.0;
        let mut steps = 0;
        while left(power)[0] < NEARLY_CLEAR && steps < 200 {
            power /= STEP;
            steps += 1;
        }
        while left(power * STEP)[0] > NEARLY_CLEAR && steps < 200 {
            power *= STEP;
            steps += 1;
        }
        let mut powers = Vec::new();
        while powers.len() < most {
            powers.push(power);
            if left(power)[1] < DIM {
                break;
            }
            power *= STEP;
        }
        powers
    }
}

/// Colours, of the three primaries, and factors with their powers.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Product {
    pub(super) colors: Vec<usize>,
    pub(super) factors: Vec<(usize, f64)>,
}

impl Product {
    /// Its value where each primary and each factor has one.
    pub(super) fn of(&self, color: impl Fn(usize) -> f64, factor: impl Fn(usize) -> f64) -> f64 {
        let colors: f64 = self.colors.iter().map(|&k| color(k)).product();
        self.factors.iter().fold(colors, |all, &(k, power)| all * factor(k).powf(power))
    }
}

/// The products that are tried.
#[derive(Debug, PartialEq)]
pub(super) struct Products {
    pub(super) all: Vec<Product>,
    /// True if none is left out.
    pub(super) complete: bool,
}

impl Products {
    /// All products of up to `colored` colours with no factor, each factor to each of its `powers`, and two
    /// of them half way; `most` at most, those of many curves left out first. `None` where there is no room
    /// for those of colours alone.
    pub(super) fn of(
        colored: usize,
        powers: &[Vec<f64>],
        may_repeat: &[bool],
        most: usize,
    ) -> Option<Self> {
        let colors = of_colors(colored);
        if colors.len() > most {
            return None;
        }
        let mut factors = vec![Vec::new()];
        for (k, powers) in powers.iter().enumerate() {
            factors.extend(powers.iter().map(|&power| vec![(k, power)]));
        }
        // Two bodies one behind the other, each of which leaves about half.
        let middle = |k: usize| powers[k].get(powers[k].len() / 2).map(|&power| (k, power));
        for i in 0..powers.len() {
            let pairs = (0..i).filter(|&k| may_repeat[k] || may_repeat[i]);
            factors.extend(pairs.filter_map(|k| Some(vec![middle(k)?, middle(i)?])));
        }
        let mut all: Vec<Product> = factors
            .iter()
            .flat_map(|factors| {
                colors
                    .iter()
                    .map(|colors| Product { colors: colors.clone(), factors: factors.clone() })
            })
            .collect();
        let complete = all.len() <= most;
        all.sort_by_key(|product| match product.factors.len() {
            0 => 0,
            count => count + product.colors.len(),
        });
        all.truncate(most);
        Some(Self { all, complete })
    }
}

/// None of the primaries, each, and two and three of them one behind the other.
fn of_colors(colored: usize) -> Vec<Vec<usize>> {
    let mut all = vec![Vec::new()];
    let mut last = all.clone();
    for _ in 0..colored.min(3) {
        let longer = |colors: &Vec<usize>| {
            let first = colors.last().copied().unwrap_or(0);
            let colors = colors.clone();
            (first..3).map(move |k| colors.iter().copied().chain([k]).collect())
        };
        last = last.iter().flat_map(longer).collect();
        all.extend(last.iter().cloned());
    }
    all
}
