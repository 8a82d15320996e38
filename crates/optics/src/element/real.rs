//! Numbers that sags, phases and what surfaces do to rays are written in once: as they are, or with their derivatives.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// Number type of the computation of sags, phases and rays.
pub trait Real:
    Copy
    + Default
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// A number that depends on nothing.
    fn constant(value: f64) -> Self;
    /// Its value.
    fn value(self) -> f64;
    /// Its square root; where it is 0, without a derivative.
    fn root(self) -> Self;
    /// It with the sign of another.
    #[must_use]
    fn signed_as(self, sign: Self) -> Self;
    /// `factor` times it.
    #[must_use]
    #[inline(always)]
    fn times(self, factor: f64) -> Self {
        self * Self::constant(factor)
    }
    /// It and `more`.
    #[must_use]
    #[inline(always)]
    fn plus(self, more: f64) -> Self {
        self + Self::constant(more)
    }
    /// It, or `least` where it is less.
    #[must_use]
    #[inline(always)]
    fn at_least(self, least: f64) -> Self {
        if self.value() >= least { self } else { Self::constant(least) }
    }
}

impl Real for f64 {
    #[inline(always)]
    fn constant(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn value(self) -> f64 {
        self
    }

    #[inline(always)]
    fn root(self) -> Self {
        self.sqrt()
    }

    #[inline(always)]
    fn signed_as(self, sign: Self) -> Self {
        self.copysign(sign)
    }
}

/// A number with its derivatives by x and y (W. K. Clifford's dual numbers, two of them). Of dual numbers it has the
/// second derivatives.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Dual<T> {
    /// The value.
    pub(crate) v: T,
    /// The derivatives.
    pub(crate) d: [T; 2],
}

impl<T: Real> Dual<T> {
    /// The coordinates themselves.
    pub(crate) fn place([x, y]: [T; 2]) -> [Self; 2] {
        let (zero, one) = (T::constant(0.0), T::constant(1.0));
        [Self { v: x, d: [one, zero] }, Self { v: y, d: [zero, one] }]
    }

    fn map(self, v: T, derivative: T) -> Self {
        Self { v, d: self.d.map(|d| d * derivative) }
    }
}

impl<T: Real> Add for Dual<T> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { v: self.v + other.v, d: [0, 1].map(|i| self.d[i] + other.d[i]) }
    }
}

impl<T: Real> Sub for Dual<T> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self { v: self.v - other.v, d: [0, 1].map(|i| self.d[i] - other.d[i]) }
    }
}

#[expect(clippy::suspicious_arithmetic_impl, reason = "the rule of products")]
impl<T: Real> Mul for Dual<T> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let d = [0, 1].map(|i| self.d[i] * other.v + self.v * other.d[i]);
        Self { v: self.v * other.v, d }
    }
}

#[expect(clippy::suspicious_arithmetic_impl, reason = "the rule of quotients")]
impl<T: Real> Div for Dual<T> {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let v = self.v / other.v;
        Self { v, d: [0, 1].map(|i| (self.d[i] - v * other.d[i]) / other.v) }
    }
}

impl<T: Real> Neg for Dual<T> {
    type Output = Self;
    fn neg(self) -> Self {
        Self { v: -self.v, d: self.d.map(|d| -d) }
    }
}

impl<T: Real> Real for Dual<T> {
    fn constant(value: f64) -> Self {
        Self { v: T::constant(value), d: [T::constant(0.0); 2] }
    }

    fn value(self) -> f64 {
        self.v.value()
    }

    fn root(self) -> Self {
        let root = self.v.root();
        if root.value() > 0.0 {
            self.map(root, T::constant(0.5) / root)
        } else {
            Self::constant(0.0)
        }
    }

    fn signed_as(self, sign: Self) -> Self {
        let is_turned = self.value().is_sign_negative() != sign.value().is_sign_negative();
        if is_turned { -self } else { self }
    }

    fn times(self, factor: f64) -> Self {
        Self { v: self.v.times(factor), d: self.d.map(|d| d.times(factor)) }
    }

    fn plus(self, more: f64) -> Self {
        Self { v: self.v.plus(more), ..self }
    }
}

/// `number` to a whole power.
pub(crate) fn power<T: Real>(number: T, exponent: u32) -> T {
    let (mut product, mut square, mut rest) = (T::constant(1.0), number, exponent);
    while rest > 0 {
        if rest % 2 == 1 {
            product = product * square;
        }
        rest /= 2;
        if rest > 0 {
            square = square * square;
        }
    }
    product
}
