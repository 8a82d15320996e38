//! Axes, from values to pixels with ticks and the place of zero; the Pareto front of points; numbers as
//! people write them.

/// Room for zeros at the low end of an axis (pixels).
const ZERO: f64 = 36.0;

/// Ticks within a decade where few decades are shown.
const FINE: [f64; 3] = [1.0, 2.0, 5.0];

/// The least distance of ticks on a linear axis (pixels).
const APART: f64 = 64.0;

/// From values to pixels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct AxisScale {
    /// The ends: values on a linear axis, else powers of ten.
    ends: [f64; 2],
    linear: bool,
    /// Positions of the ends (pixels).
    pixels: [f64; 2],
    /// Position of zeros, when they have a place of their own.
    zero: Option<f64>,
}

impl AxisScale {
    /// `axis` over all `values` that it has a place for, from one of `pixels` to the other.
    pub(crate) fn new(
        values: impl Iterator<Item = f64> + Clone,
        axis: &Axis,
        [from, to]: [f64; 2],
    ) -> Self {
        let finite = values.clone().filter(|value| value.is_finite());
        let ends = |of: [f64; 2], [low, high]: [f64; 2]| [of[0].min(low), of[1].max(high)];
        if axis.linear {
            let [low, high] = finite.fold([0.0; 2], |of, value| ends(of, [value; 2]));
            let high = if low < high { high } else { low + 1.0 };
            return Self { ends: [low, high], linear: true, pixels: [from, to], zero: None };
        }
        let has_zero = axis.zero.is_some() && values.clone().any(|value| value == 0.0);
        let positive = finite.filter(|&value| value > 0.0);
        let [low, high] = positive.fold([f64::INFINITY, 0.0], |of, value| ends(of, [value; 2]));
        let [low, high] = if low <= high { [low, high] } else { [0.1, 1.0] };
        let ends = widened([low.log10(), high.log10()], axis.fits);
        let direction = (to - from).signum();
        let start = if has_zero { from + direction * ZERO } else { from };
        let zero = has_zero.then_some(from + direction * 0.4 * ZERO);
        Self { ends, linear: false, pixels: [start, to], zero }
    }

    /// Position of `value`; `None` where it has no place.
    pub(crate) fn at(&self, value: f64) -> Option<f64> {
        if value == 0.0 && !self.linear {
            return self.zero;
        }
        let [low, high] = self.ends;
        let along = if self.linear { value } else { value.log10() };
        let share = (along - low) / (high - low);
        let [from, to] = self.pixels;
        share.is_finite().then_some(from + share * (to - from))
    }

    /// Position of zeros, if anything is there.
    pub(crate) fn zero(&self) -> Option<f64> {
        self.zero
    }

    /// Position where the place of zeros ends.
    pub(crate) fn start(&self) -> f64 {
        self.pixels[0]
    }

    /// The values to be named, and where they are.
    pub(crate) fn ticks(&self) -> Vec<(String, f64)> {
        if self.linear { self.even_ticks() } else { self.ticks_by_decade() }
    }

    fn even_ticks(&self) -> Vec<(String, f64)> {
        let ([low, high], [from, to]) = (self.ends, self.pixels);
        let span = high - low;
        let most = ((to - from).abs() / APART).floor().max(1.0);
        let least = span / most;
        let decade = 10f64.powf(least.log10().floor());
        let steps = [1.0, 2.0, 5.0, 10.0].map(|step| step * decade);
        let step = steps.into_iter().find(|step| *step >= least * (1.0 - 1e-9)).unwrap_or(span);
        let numbers = whole((low / step).ceil())..=whole((high / step + 1e-9).floor());
        let tick = |number: i32| {
            let value = f64::from(number) * step;
            self.at(value).map(|at| (short(value), at))
        };
        numbers.filter_map(tick).collect()
    }

    fn ticks_by_decade(&self) -> Vec<(String, f64)> {
        let [low, high] = self.ends;
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

#[expect(clippy::cast_possible_truncation, reason = "exponents and numbers of ticks")]
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

/// 1, 2 or 5 times a power of ten, not above `most`: the length of a scale's bar, or a tick's step.
#[must_use]
pub fn round_length(most: f64) -> f64 {
    if !(most > 0.0 && most.is_finite()) {
        return 1.0;
    }
    let decade = 10_f64.powf(most.log10().floor());
    [5.0, 2.0, 1.0]
        .into_iter()
        .map(|step| step * decade)
        .find(|step| *step <= most)
        .unwrap_or(decade)
}

/// A number with at most four significant digits.
#[must_use]
pub fn short(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let text = format!("{value:.3e}");
    text.parse::<f64>().map_or(text, |rounded| rounded.to_string())
}

/// Six significant digits, without zeros at the end.
#[must_use]
pub fn significant(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let size = value.abs().log10().floor();
    if !(-5.0..7.0).contains(&size) {
        return format!("{value:.4e}");
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 10")]
    let decimals = (5.0 - size).max(0.0) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// The `points` for which none other is at most as large on both axes and smaller on one, from left
/// to right. Points that are not finite take no part.
#[must_use]
pub fn front(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let finite = |point: &[f64; 2]| point.iter().all(|value| value.is_finite());
    let mut sorted: Vec<[f64; 2]> = points.iter().copied().filter(finite).collect();
    sorted.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let mut front: Vec<[f64; 2]> = Vec::new();
    for point in sorted {
        if front.last().is_none_or(|last| point[1] < last[1]) {
            front.push(point);
        }
    }
    front
}

/// An axis, logarithmic unless it is said to be linear.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Axis {
    /// Quantity on the axis, with its unit.
    pub label: String,
    /// Name of a value of exactly zero. With it, zeros have a place of their own below all other
    /// values; without it, they are left out.
    pub zero: Option<String>,
    /// True if the axis ends where the values do, and not at the next power of ten.
    pub fits: bool,
    /// True if the axis is linear, from 0 on.
    pub linear: bool,
}

impl Axis {
    /// A logarithmic axis whose zeros are left out.
    #[must_use]
    pub fn new(label: impl Into<String>) -> Self {
        Self { label: label.into(), ..Self::default() }
    }

    /// A linear axis from 0 on.
    #[must_use]
    pub fn linear(label: impl Into<String>) -> Self {
        Self { linear: true, ..Self::new(label) }
    }

    /// Returns the axis ending where the values do.
    #[must_use]
    pub fn fitted(self) -> Self {
        Self { fits: true, ..self }
    }

    /// Returns the axis with a place for zeros, called `name`.
    #[must_use]
    pub fn with_zero(self, name: impl Into<String>) -> Self {
        Self { zero: Some(name.into()), ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_keep_their_order_and_zero_lies_below() {
        let values = [0.0, 1e-9, 3e-4, 2.0];
        let named = Axis::new("error").with_zero("none");
        let scale = AxisScale::new(values.into_iter(), &named, [400.0, 0.0]);
        let places: Vec<f64> = values.iter().map(|&v| scale.at(v).unwrap()).collect();
        // Upwards on a page is towards smaller numbers.
        assert!(places.is_sorted_by(|a, b| a > b), "{places:?}");
        assert!(places.iter().all(|y| (0.0..=400.0).contains(y)));
        assert!(places[0] > scale.start() && scale.start() >= places[1]);
        assert_eq!([scale.at(-1.0), scale.at(f64::NAN), scale.at(f64::INFINITY)], [None; 3]);
        assert_eq!(
            AxisScale::new(values.into_iter(), &Axis::new("error"), [400.0, 0.0]).at(0.0),
            None
        );
    }

    #[test]
    fn a_linear_axis_begins_at_zero_and_has_round_ticks() {
        let named = |values: &[f64], pixels: [f64; 2]| {
            let scale = AxisScale::new(values.iter().copied(), &Axis::linear("height"), pixels);
            scale.ticks().into_iter().map(|(name, _)| name).collect::<Vec<_>>()
        };
        assert_eq!(named(&[3.0, 21.6], [0.0, 600.0]), ["0", "5", "10", "15", "20"]);
        assert_eq!(named(&[1.0], [300.0, 0.0]), ["0", "0.5", "1"]);
        assert_eq!(named(&[-1.0, 1.0], [0.0, 300.0]), ["-1", "-0.5", "0", "0.5", "1"]);
        assert_eq!(named(&[], [0.0, 300.0]), named(&[1.0, f64::NAN], [0.0, 300.0]));
        let scale = AxisScale::new([0.0, 20.0].into_iter(), &Axis::linear("height"), [100.0, 0.0]);
        assert_eq!([0.0, 5.0, 20.0].map(|value| scale.at(value)), [100.0, 75.0, 0.0].map(Some));
        assert_eq!((scale.at(f64::NAN), scale.zero()), (None, None));
    }

    #[test]
    fn ticks_lie_inside_and_are_few() {
        for [low, high] in [[1.0, 1.0], [0.9, 7.0], [1e-3, 40.0], [1e-17, 1.0], [3e-300, 1e300]] {
            for axis in [Axis::new("error"), Axis::new("error").fitted()] {
                let scale = AxisScale::new([low, high].into_iter(), &axis, [0.0, 600.0]);
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

    #[test]
    fn lengths_of_scales_are_round() {
        assert_eq!(round_length(140.0), 100.0);
        assert_eq!(round_length(0.0049), 0.002);
        assert_eq!(round_length(5.0), 5.0);
        assert_eq!(round_length(0.0), 1.0);
        assert_eq!(short(0.123_456), "0.1235");
        assert_eq!(short(-20.0), "-20");
        // Twice half of 6.942.
        assert_eq!(significant(6.941_999_999_999_999), "6.942");
        assert_eq!(significant(-1500.0), "-1500");
    }

    #[test]
    fn the_front_is_what_nothing_beats() {
        let points = [[3.0, 0.0], [1.0, 5.0], [2.0, 5.0], [2.0, 1.0], [4.0, 0.0], [0.5, f64::NAN]];
        assert_eq!(front(&points), [[1.0, 5.0], [2.0, 1.0], [3.0, 0.0]]);
        assert_eq!(front(&[]), Vec::<[f64; 2]>::new());
        // By the definition, on points of a small grid.
        let many: Vec<[f64; 2]> =
            (0..60).map(|i| [f64::from(i * 37 % 11), f64::from(i * 53 % 13)]).collect();
        let found = front(&many);
        for a in &many {
            let beaten = many.iter().any(|b| b[0] <= a[0] && b[1] <= a[1] && b != a);
            assert_eq!(found.contains(a), !beaten, "{a:?}");
        }
    }
}
