//! A function of wavelength: a quantum efficiency, a transmission, a refractive index, a power
//! density. Straight lines join its samples; integrals are exact for them.

mod text;

/// A function of wavelength (nm): one number for all of them, or samples joined by straight lines.
///
/// In JSON it is a number, or a list of `[nm, value]` in ascending order:
///
/// ```
/// use etendue_spectrum::Curve;
///
/// let flat: Curve = serde_json::from_str("0.6")?;
/// assert_eq!(flat.at(1234.0), Some(0.6));
///
/// let ramp: Curve = serde_json::from_str("[[400, 0.2], [500, 0.4], [700, 0.0]]")?;
/// assert_eq!(ramp.range(), [400.0, 700.0]);
/// assert_eq!(ramp.at(450.0), Some(0.30000000000000004));
/// assert_eq!(ramp.at(399.0), None);
/// assert_eq!(ramp.held(399.0), 0.2);
/// # Ok::<(), serde_json::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    shape: CurveShape,
}

#[derive(Debug, Clone, PartialEq)]
enum CurveShape {
    Flat(f64),
    /// At least two, all finite, wavelengths positive and strictly ascending.
    Sampled(Vec<[f64; 2]>),
}

/// Value of a curve where it is not known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outside {
    /// Nothing: an emission, a quantum efficiency.
    Zero,
    /// The value at its nearer end: a reflectance, a refractive index.
    Held,
}

/// Error of numbers that make no curve.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CurveError {
    /// No samples at all.
    #[error("the curve is empty: give a number, or at least two samples as [nm, value]")]
    Empty,
    /// A single sample, which has no range.
    #[error(
        "the curve has a single sample at {wavelength} nm and so covers no wavelengths: give the \
         number alone if it holds everywhere, or at least two samples"
    )]
    Single {
        /// Wavelength of the sample (nm).
        wavelength: f64,
    },
    /// Wavelengths do not ascend.
    #[error(
        "sample {index} of the curve is at {wavelength} nm, after one at {previous} nm: sort the \
         samples by wavelength and give each wavelength once"
    )]
    Unsorted {
        /// Index of the sample, counted from 0.
        index: usize,
        /// Its wavelength (nm).
        wavelength: f64,
        /// The wavelength before it (nm).
        previous: f64,
    },
    /// A NaN or an infinity, or a wavelength that is not positive.
    #[error(
        "sample {index} of the curve is [{wavelength}, {value}]: the wavelength must be a positive \
         finite number of nanometres and the value a finite number"
    )]
    NotFinite {
        /// Index of the sample, counted from 0.
        index: usize,
        /// Its wavelength (nm).
        wavelength: f64,
        /// Its value.
        value: f64,
    },
    /// Wavelengths that are micrometres by mistake.
    #[error(
        "the curve's wavelengths are {first} to {last}: did you mean nm? Wavelengths are nanometres; \
         multiply micrometres by 1000"
    )]
    Micrometres {
        /// The first wavelength.
        first: f64,
        /// The last.
        last: f64,
    },
    /// A value outside of the bounds that its meaning sets.
    #[error("the curve is {value} at {}: it must lie in {low}..={high}", place(*wavelength))]
    OutOfBounds {
        /// Wavelength of the value (nm; `None` for a number that holds everywhere).
        wavelength: Option<f64>,
        /// The value there.
        value: f64,
        /// The least it may be.
        low: f64,
        /// The most it may be.
        high: f64,
    },
}

/// Wavelengths up to here are micrometres: nothing that a lens or a sensor is for lies below 20 nm.
const MICROMETRES: f64 = 20.0;

/// Place of a value, for messages.
fn place(wavelength: Option<f64>) -> String {
    match wavelength {
        Some(nm) => format!("{nm} nm"),
        None => "every wavelength".to_owned(),
    }
}

impl Curve {
    /// Makes a curve of one value at every wavelength.
    ///
    /// # Errors
    ///
    /// When `value` is not finite.
    pub fn flat(value: f64) -> Result<Self, CurveError> {
        if !value.is_finite() {
            return Err(CurveError::NotFinite { index: 0, wavelength: f64::NAN, value });
        }
        Ok(Self { shape: CurveShape::Flat(value) })
    }

    /// Samples `[nm, value]` joined by straight lines.
    ///
    /// # Errors
    ///
    /// When there are fewer than two, one is not finite, or their wavelengths do not ascend.
    pub fn sampled(samples: Vec<[f64; 2]>) -> Result<Self, CurveError> {
        for (index, &[wavelength, value]) in samples.iter().enumerate() {
            if !(wavelength > 0.0 && wavelength.is_finite() && value.is_finite()) {
                return Err(CurveError::NotFinite { index, wavelength, value });
            }
        }
        for (index, pair) in samples.windows(2).enumerate() {
            let [previous, wavelength] = [pair[0][0], pair[1][0]];
            if wavelength <= previous {
                return Err(CurveError::Unsorted { index: index + 1, wavelength, previous });
            }
        }
        if let [[first, _], .., [last, _]] = samples[..]
            && last <= MICROMETRES
        {
            return Err(CurveError::Micrometres { first, last });
        }
        match samples.as_slice() {
            [] => Err(CurveError::Empty),
            &[[wavelength, _]] => Err(CurveError::Single { wavelength }),
            _ => Ok(Self { shape: CurveShape::Sampled(samples) }),
        }
    }

    /// 1 at every wavelength.
    pub const ONE: Self = Self { shape: CurveShape::Flat(1.0) };

    /// Samples that this crate makes and whose tests see to their order.
    pub(crate) fn trusted(samples: Vec<[f64; 2]>) -> Self {
        debug_assert!(Self::sampled(samples.clone()).is_ok(), "samples out of order");
        Self { shape: CurveShape::Sampled(samples) }
    }

    /// Equally spaced samples: `values[i]` is at `start + i·step` (nm).
    ///
    /// # Errors
    ///
    /// As [`Self::sampled`].
    pub fn uniform(start: f64, step: f64, values: &[f64]) -> Result<Self, CurveError> {
        let at = |(i, &value): (usize, &f64)| [start + step * i as f64, value];
        Self::sampled(values.iter().enumerate().map(at).collect())
    }

    /// The wavelengths at which the curve is known (nm), both ends included: all of them, 0 to
    /// infinity, for a flat one.
    #[must_use]
    pub fn range(&self) -> [f64; 2] {
        match &self.shape {
            CurveShape::Flat(_) => [0.0, f64::INFINITY],
            CurveShape::Sampled(s) => [s[0][0], s[s.len() - 1][0]],
        }
    }

    /// The value of a curve that is the same everywhere by definition.
    #[must_use]
    pub fn as_flat(&self) -> Option<f64> {
        match self.shape {
            CurveShape::Flat(value) => Some(value),
            CurveShape::Sampled(_) => None,
        }
    }

    /// The samples `[nm, value]`; none for a flat curve.
    #[must_use]
    pub fn samples(&self) -> &[[f64; 2]] {
        match &self.shape {
            CurveShape::Flat(_) => &[],
            CurveShape::Sampled(samples) => samples,
        }
    }

    /// The value at `wavelength` (nm); `None` outside of the range.
    #[must_use]
    pub fn at(&self, wavelength: f64) -> Option<f64> {
        let [first, last] = self.range();
        (wavelength >= first && wavelength <= last).then(|| self.held(wavelength))
    }

    /// The value at `wavelength` (nm), with the values at the ends of the range held beyond them.
    #[must_use]
    pub fn held(&self, wavelength: f64) -> f64 {
        let samples = match &self.shape {
            CurveShape::Flat(value) => return *value,
            CurveShape::Sampled(samples) => samples,
        };
        let after = samples.partition_point(|&[nm, _]| nm <= wavelength);
        if after == 0 {
            return samples[0][1];
        }
        let Some(&[right, above]) = samples.get(after) else {
            return samples[samples.len() - 1][1];
        };
        let [left, below] = samples[after - 1];
        below + (above - below) * ((wavelength - left) / (right - left))
    }

    /// The curve with the values at the ends of its range held over `from..=to` (nm) as far as it does
    /// not reach them.
    #[must_use]
    pub fn held_over(&self, from: f64, to: f64) -> Self {
        let CurveShape::Sampled(samples) = &self.shape else { return self.clone() };
        let mut samples = samples.clone();
        let [first, last] = [samples[0], samples[samples.len() - 1]];
        if from > 0.0 && from < first[0] {
            samples.insert(0, [from, first[1]]);
        }
        if to.is_finite() && to > last[0] {
            samples.push([to, last[1]]);
        }
        Self { shape: CurveShape::Sampled(samples) }
    }

    /// The least and the greatest value.
    #[must_use]
    pub fn extent(&self) -> [f64; 2] {
        match &self.shape {
            CurveShape::Flat(value) => [*value, *value],
            CurveShape::Sampled(samples) => {
                samples.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], s| {
                    [low.min(s[1]), high.max(s[1])]
                })
            }
        }
    }

    /// Wavelength of the greatest value (nm): the first such sample; `None` for a flat one.
    #[must_use]
    pub fn peak(&self) -> Option<f64> {
        let mut peak: Option<[f64; 2]> = None;
        for &sample in self.samples() {
            if peak.is_none_or(|[_, value]| sample[1] > value) {
                peak = Some(sample);
            }
        }
        peak.map(|[nm, _]| nm)
    }

    /// Passes the curve on when all its values lie in `low..=high`: a transmission or a quantum
    /// efficiency must lie in 0..=1.
    ///
    /// # Errors
    ///
    /// [`CurveError::OutOfBounds`] with the first value that does not.
    pub fn within(self, low: f64, high: f64) -> Result<Self, CurveError> {
        let outside = |value: f64| !(low..=high).contains(&value);
        let found = match &self.shape {
            CurveShape::Flat(value) => outside(*value).then_some((None, *value)),
            CurveShape::Sampled(samples) => {
                samples.iter().find(|s| outside(s[1])).map(|s| (Some(s[0]), s[1]))
            }
        };
        match found {
            Some((wavelength, value)) => {
                Err(CurveError::OutOfBounds { wavelength, value, low, high })
            }
            None => Ok(self),
        }
    }

    /// The curve times `factor`.
    ///
    /// # Errors
    ///
    /// When a product is not finite.
    pub fn scaled(&self, factor: f64) -> Result<Self, CurveError> {
        match &self.shape {
            CurveShape::Flat(value) => Self::flat(value * factor),
            CurveShape::Sampled(samples) => {
                Self::sampled(samples.iter().map(|&[nm, value]| [nm, value * factor]).collect())
            }
        }
    }

    /// The sum of two curves, each 0 outside of its range but for a flat one. Where one begins or ends with
    /// another value than 0, a millionth of a nanometre is a slope.
    #[must_use]
    pub fn plus(&self, other: &Self) -> Self {
        const EDGE: f64 = 1e-6;
        if let (CurveShape::Flat(a), CurveShape::Flat(b)) = (&self.shape, &other.shape) {
            return Self { shape: CurveShape::Flat(a + b) };
        }
        let at = |curve: &Self, nm: f64| curve.at(nm).unwrap_or(0.0);
        let mut knots: Vec<f64> = Vec::new();
        for curve in [self, other] {
            let samples = curve.samples();
            knots.extend(samples.iter().map(|s| s[0]));
            let ends = samples.first().zip(samples.last());
            if let Some((first, last)) = ends {
                knots.extend((first[1] != 0.0).then(|| (first[0] - EDGE).max(EDGE)));
                knots.extend((last[1] != 0.0).then_some(last[0] + EDGE));
            }
        }
        knots.sort_by(f64::total_cmp);
        knots.dedup();
        Self::trusted(knots.into_iter().map(|nm| [nm, at(self, nm) + at(other, nm)]).collect())
    }

    /// ∫ curve dλ over `from..to` (nm), the curve being 0 outside of its range.
    #[must_use]
    pub fn integral(&self, from: f64, to: f64) -> f64 {
        integral(&[self], from, to)
    }

    /// The mean over `from..to` (nm), the curve being 0 outside of its range. An empty interval
    /// gives the value there.
    #[must_use]
    pub fn mean(&self, from: f64, to: f64) -> f64 {
        if to > from { self.integral(from, to) / (to - from) } else { self.at(from).unwrap_or(0.0) }
    }
}

/// ∫ Π curves dλ over `from..to` (nm), each curve being 0 outside of its range.
///
/// Exact for up to six curves but for rounding: between neighbouring samples the product is a
/// polynomial of that degree at most, and a four-point Gauss–Legendre rule integrates degree 7.
#[must_use]
pub fn integral(curves: &[&Curve], from: f64, to: f64) -> f64 {
    let [low, high] = curves.iter().fold([from, to], |[low, high], curve| {
        let [first, last] = curve.range();
        [low.max(first), high.min(last)]
    });
    if low >= high || !(high - low).is_finite() {
        return 0.0;
    }
    let inside = |&nm: &f64| nm > low && nm < high;
    let mut knots: Vec<f64> = vec![low, high];
    knots.extend(curves.iter().flat_map(|c| c.samples()).map(|s| s[0]).filter(inside));
    knots.sort_by(f64::total_cmp);
    knots.dedup();
    let product = |nm: f64| curves.iter().map(|curve| curve.held(nm)).product::<f64>();
    knots.windows(2).map(|ends| gauss_legendre(ends[0], ends[1], product)).sum()
}

/// The four-point Gauss–Legendre rule (Abramowitz & Stegun 1964, table 25.4).
fn gauss_legendre(from: f64, to: f64, f: impl Fn(f64) -> f64) -> f64 {
    const NODES: [[f64; 2]; 2] = [
        [0.339_981_043_584_856_26, 0.652_145_154_862_546_1],
        [0.861_136_311_594_052_6, 0.347_854_845_137_453_85],
    ];
    let (centre, half) = (0.5 * (from + to), 0.5 * (to - from));
    let pair = |[x, weight]: [f64; 2]| weight * (f(centre - half * x) + f(centre + half * x));
    half * NODES.into_iter().map(pair).sum::<f64>()
}

impl TryFrom<Vec<[f64; 2]>> for Curve {
    type Error = CurveError;

    fn try_from(samples: Vec<[f64; 2]>) -> Result<Self, CurveError> {
        Self::sampled(samples)
    }
}

/// The mean of a curve over an interval (nm) that may reach beyond its range.
pub(crate) fn mean(curve: &Curve, from: f64, to: f64, outside: Outside) -> f64 {
    let [low, high] = curve.range();
    let inside = curve.integral(from, to);
    let held = match outside {
        Outside::Zero => 0.0,
        Outside::Held => {
            let before = (low.min(to) - from).max(0.0);
            let after = (to - high.max(from)).max(0.0);
            before * curve.held(low) + after * curve.held(high)
        }
    };
    (inside + held) / (to - from)
}

/// The curve with its ends held over `from..to` (nm), or itself where it is to be 0.
pub(crate) fn known_everywhere(curve: &Curve, from: f64, to: f64, outside: Outside) -> Curve {
    if outside == Outside::Zero {
        return curve.clone();
    }
    curve.held_over(from, to)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp() -> Curve {
        Curve::sampled(vec![[400.0, 0.0], [500.0, 1.0], [700.0, 0.5]]).unwrap()
    }

    #[test]
    fn straight_lines_join_samples_and_the_range_is_kept() {
        let curve = ramp();
        assert_eq!(curve.range(), [400.0, 700.0]);
        assert_eq!(curve.at(450.0), Some(0.5));
        assert_eq!(curve.at(600.0), Some(0.75));
        assert_eq!(curve.at(700.0), Some(0.5));
        assert_eq!(curve.at(700.1), None);
        assert_eq!(curve.at(399.9), None);
        assert_eq!(curve.held(1000.0), 0.5);
        assert_eq!(curve.held(100.0), 0.0);
        assert_eq!(curve.at(f64::NAN), None);
        assert_eq!(curve.extent(), [0.0, 1.0]);
        assert_eq!(curve.peak(), Some(500.0));
    }

    #[test]
    fn integrals_are_those_of_the_polygon() {
        let curve = ramp();
        let area = 0.5 * 100.0 + 0.75 * 200.0;
        // A few roundings of sums near 200.
        assert!((curve.integral(0.0, 2000.0) - area).abs() < 1e-11);
        assert!((curve.integral(450.0, 500.0) - 37.5).abs() < 1e-12);
        assert_eq!(curve.integral(700.0, 900.0), 0.0);
        assert!((curve.mean(600.0, 800.0) - 62.5 / 200.0).abs() < 1e-14);
        assert_eq!(curve.mean(500.0, 500.0), 1.0);
        let flat = Curve::flat(2.0).unwrap();
        assert!((flat.integral(400.0, 410.0) - 20.0).abs() < 1e-13);
        // On 400..500 the ramp is x = (λ − 400)/100, and ∫ x³ dλ = 100/4.
        let cube = integral(&[&curve, &curve, &curve], 400.0, 500.0);
        assert!((cube - 25.0).abs() < 1e-12, "{cube}");
    }

    #[test]
    fn what_is_no_curve_is_refused_with_its_place() {
        let error = |text: &str| serde_json::from_str::<Curve>(text).unwrap_err().to_string();
        assert!(error("[]").contains("empty"));
        assert!(error("[[500, 1]]").contains("single sample at 500"));
        assert!(error("[[500, 1], [400, 1]]").contains("sample 1 of the curve is at 400 nm"));
        assert!(error("[[500, 1], [500, 1]]").contains("each wavelength once"));
        assert!(error("[[-5, 1], [500, 1]]").contains("sample 0 of the curve is [-5, 1]"));
        assert!(error("\"red\"").contains("a list of [nanometres, value]"));
        assert!(error("[500, 1]").contains("expected an array of length 2"));
        assert!(matches!(
            Curve::sampled(vec![[400.0, 1.0], [500.0, f64::NAN]]),
            Err(CurveError::NotFinite { index: 1, .. })
        ));
        assert!(Curve::flat(f64::INFINITY).is_err());
        assert!(matches!(
            ramp().within(0.0, 0.9),
            Err(CurveError::OutOfBounds { wavelength: Some(500.0), .. })
        ));
    }

    #[test]
    fn both_forms_survive_json() {
        for curve in [ramp(), Curve::flat(0.25).unwrap()] {
            let text = serde_json::to_string(&curve).unwrap();
            assert_eq!(serde_json::from_str::<Curve>(&text).unwrap(), curve);
        }
        assert_eq!(serde_json::from_str::<Curve>("1").unwrap().as_flat(), Some(1.0));
    }
}
