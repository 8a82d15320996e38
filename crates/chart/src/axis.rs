//! A logarithmic axis in pixels.

use crate::chart::Axis;

/// Room for zeros at the low end of an axis (pixels).
const ZERO: f64 = 36.0;

/// Ticks within a decade where few decades are shown.
const FINE: [f64; 3] = [1.0, 2.0, 5.0];

/// From values to pixels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scale {
    /// The ends in powers of ten.
    exponents: [f64; 2],
    /// Where they are.
    pixels: [f64; 2],
    /// Where zeros are.
    zero: Option<f64>,
}

impl Scale {
    /// `axis` over all positive `values`, and zeros when it names them and there is one, from one of
    /// `pixels` to the other.
    pub(crate) fn new(
        values: impl Iterator<Item = f64> + Clone,
        axis: &Axis,
        [from, to]: [f64; 2],
    ) -> Self {
        let has_zero = axis.zero.is_some() && values.clone().any(|value| value == 0.0);
        let positive = values.filter(|&value| value > 0.0 && value.is_finite());
        let [low, high] = positive
            .fold([f64::INFINITY, 0.0f64], |[low, high], value| [low.min(value), high.max(value)]);
        let [low, high] = if low <= high { [low, high] } else { [0.1, 1.0] };
        let exponents = widened([low.log10(), high.log10()], axis.fits);
        let direction = (to - from).signum();
        let start = if has_zero { from + direction * ZERO } else { from };
        let zero = has_zero.then_some(from + direction * 0.4 * ZERO);
        Self { exponents, pixels: [start, to], zero }
    }

    /// Where `value` is; `None` where it has no place.
    pub(crate) fn at(&self, value: f64) -> Option<f64> {
        if value == 0.0 {
            return self.zero;
        }
        let [low, high] = self.exponents;
        let share = (value.log10() - low) / (high - low);
        let [from, to] = self.pixels;
        (value > 0.0 && share.is_finite()).then_some(from + share * (to - from))
    }

    /// Where zeros are, if anything is there.
    pub(crate) fn zero(&self) -> Option<f64> {
        self.zero
    }

    /// Where the logarithmic part begins.
    pub(crate) fn start(&self) -> f64 {
        self.pixels[0]
    }

    /// The values to be named, and where they are.
    pub(crate) fn ticks(&self) -> Vec<(String, f64)> {
        let [low, high] = self.exponents;
        let (steps, every): (&[f64], i32) = match high - low {
            span if span < 2.2 => (&FINE, 1),
            span if span < 8.5 => (&FINE[..1], 1),
            span => (&FINE[..1], whole((span / 8.0).ceil())),
        };
        let mut ticks = Vec::new();
        for decade in (whole(low.floor())..=whole(high.ceil())).filter(|d| d % every == 0) {
            for step in steps {
                let exponent = f64::from(decade) + step.log10();
                if exponent >= low - 1e-9
                    && exponent <= high + 1e-9
                    && let Some(at) = self.at(10f64.powf(exponent))
                {
                    ticks.push((written(*step, decade), at));
                }
            }
        }
        ticks
    }
}

#[expect(clippy::cast_possible_truncation, reason = "exponents of f64")]
fn whole(value: f64) -> i32 {
    value as i32
}

/// A range of exponents with some room around, ending on ticks where these are far apart.
fn widened([low, high]: [f64; 2], fits: bool) -> [f64; 2] {
    let span = high - low;
    if fits && span > 1.0 {
        return [low - 0.04 * span, high + 0.04 * span];
    }
    if span > 3.0 {
        return [(low - 0.15).floor(), (high + 0.15).ceil()];
    }
    // At least a decade, so that there are ticks to read by.
    let room = (0.12 * span).max(0.5 * (1.0 - span)).max(0.12);
    [low - room, high + room]
}

/// `step`·10^`decade`, plain where that is short.
fn written(step: f64, decade: i32) -> String {
    let value = step * 10f64.powi(decade);
    match decade {
        0..=3 => format!("{value:.0}"),
        -3..=-1 => format!("{value:.*}", usize::try_from(-decade).unwrap_or_default()),
        _ if step == 1.0 => power(decade),
        _ => format!("{step:.0}·{}", power(decade)),
    }
}

/// 10ⁿ in raised characters: programs that draw SVG disagree about where shifted text goes.
fn power(decade: i32) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let raised = |c: char| match c.to_digit(10) {
        Some(digit) => DIGITS[digit as usize],
        None => '⁻',
    };
    format!("10{}", decade.to_string().chars().map(raised).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_keep_their_order_and_zero_lies_below() {
        let values = [0.0, 1e-9, 3e-4, 2.0];
        let named = Axis::new("error").with_zero("none");
        let scale = Scale::new(values.into_iter(), &named, [400.0, 0.0]);
        let places: Vec<f64> = values.iter().map(|&v| scale.at(v).unwrap()).collect();
        // Upwards on a page is towards smaller numbers.
        assert!(places.is_sorted_by(|a, b| a > b), "{places:?}");
        assert!(places.iter().all(|y| (0.0..=400.0).contains(y)));
        assert!(places[0] > scale.start() && scale.start() >= places[1]);
        assert_eq!([scale.at(-1.0), scale.at(f64::NAN), scale.at(f64::INFINITY)], [None; 3]);
        assert_eq!(Scale::new(values.into_iter(), &Axis::new("error"), [400.0, 0.0]).at(0.0), None);
    }

    #[test]
    fn ticks_lie_inside_and_are_few() {
        for [low, high] in [[1.0, 1.0], [0.9, 7.0], [1e-3, 40.0], [1e-17, 1.0], [3e-300, 1e300]] {
            for axis in [Axis::new("error"), Axis::new("error").fitted()] {
                let scale = Scale::new([low, high].into_iter(), &axis, [0.0, 600.0]);
                let ticks = scale.ticks();
                assert!((1..=12).contains(&ticks.len()), "{low} to {high}: {ticks:?}");
                assert!(ticks.iter().all(|(_, at)| (-0.1..=600.1).contains(at)), "{ticks:?}");
            }
        }
        assert_eq!(
            [written(2.0, -3), written(5.0, 1), written(1.0, -12)],
            ["0.002", "50", "10⁻¹²"]
        );
    }
}
