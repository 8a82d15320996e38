//! Single and double precision, for formulas that are written once for both.

use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use crate::disk;

/// A number of either precision.
pub trait Float:
    Copy
    + Default
    + Debug
    + Send
    + Sync
    + 'static
    + PartialOrd
    + From<f32>
    + Into<f64>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
    + DivAssign
{
    /// 0.
    const ZERO: Self;
    /// 1.
    const ONE: Self;
    /// Infinity.
    const INFINITY: Self;
    /// The largest finite number.
    const MAX: Self;
    /// Twice the largest relative error of rounding.
    const EPSILON: Self;
    /// The largest number below 1.
    const ONE_BELOW: Self;

    /// A number of double precision, rounded to this one's.
    fn of(x: f64) -> Self;

    /// Square root.
    #[must_use]
    fn sqrt(self) -> Self;

    /// Absolute value.
    #[must_use]
    fn abs(self) -> Self;

    /// The absolute value with another's sign.
    #[must_use]
    fn copysign(self, sign: Self) -> Self;

    /// The nearest whole number, of a number of at least −2²² and at most 2²² (2⁵⁰ in double precision), and its last
    /// bits.
    #[must_use]
    fn nearest(self) -> (Self, u32);

    /// Sine and cosine of an angle (rad) of at most π/4.
    #[must_use]
    fn small_sine_cosine(self) -> (Self, Self);
}

/// Declares what both precisions have by these names.
macro_rules! own_functions {
    () => {
        #[inline(always)]
        fn sqrt(self) -> Self {
            self.sqrt()
        }

        #[inline(always)]
        fn abs(self) -> Self {
            self.abs()
        }

        #[inline(always)]
        fn copysign(self, sign: Self) -> Self {
            self.copysign(sign)
        }
    };
}

impl Float for f64 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
    const INFINITY: Self = Self::INFINITY;
    const MAX: Self = Self::MAX;
    const EPSILON: Self = Self::EPSILON;
    const ONE_BELOW: Self = 1.0 - Self::EPSILON / 2.0;

    #[inline(always)]
    fn of(x: f64) -> Self {
        x
    }

    own_functions!();

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "the low half is wanted")]
    fn nearest(self) -> (Self, u32) {
        // Adding it leaves the nearest whole number in the last bits.
        const WHOLE: f64 = 6_755_399_441_055_744.0;
        let shifted = self + WHOLE;
        (shifted - WHOLE, shifted.to_bits() as u32)
    }

    #[inline(always)]
    fn small_sine_cosine(self) -> (Self, Self) {
        disk::small_sine_cosine(self)
    }
}

impl Float for f32 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
    const INFINITY: Self = Self::INFINITY;
    const MAX: Self = Self::MAX;
    const EPSILON: Self = Self::EPSILON;
    const ONE_BELOW: Self = 1.0 - Self::EPSILON / 2.0;

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "rounding is the purpose")]
    fn of(x: f64) -> Self {
        x as Self
    }

    own_functions!();

    #[inline(always)]
    fn nearest(self) -> (Self, u32) {
        const WHOLE: f32 = 12_582_912.0;
        let shifted = self + WHOLE;
        (shifted - WHOLE, shifted.to_bits() & 0x3f_ffff)
    }

    /// Taylor's series: what is left out is below 4 · 10⁻⁹.
    #[inline(always)]
    fn small_sine_cosine(self) -> (Self, Self) {
        let x = self * self;
        let sine = -1.0 / 6.0 + x * (1.0 / 120.0 + x * (-1.0 / 5_040.0 + x / 362_880.0));
        let cosine = -0.5 + x * (1.0 / 24.0 + x * (-1.0 / 720.0 + x / 40_320.0));
        (self * (1.0 + x * sine), 1.0 + x * cosine)
    }
}
