//! Eight single-precision numbers at a time, on whatever the processor has.
//!
//! A [`Lanes`] is a token that can only be had where its instructions exist, so everything here is
//! safe code. The compiler sees through all of it as long as it is inlined into
//! [`Lanes::run`], which is where the instruction set is switched on.

use pulp::NullaryFnOnce;

use super::wide::Cell;

/// An instruction set with eight lanes of f32.
pub(super) trait Lanes: Copy + Send + Sync {
    /// Eight numbers.
    type F: Copy;

    /// The name for reports.
    const NAME: &'static str;

    /// Runs `f` with these instructions switched on, as far as it is inlined.
    fn run<F: NullaryFnOnce>(self, f: F) -> F::Output;

    /// Begins to fetch the cells from `place` on that a node or a leaf may have.
    fn prefetch(self, cells: &[Cell], place: usize);
    fn load(self, values: &[f32; 8]) -> Self::F;
    fn store(self, values: Self::F) -> [f32; 8];
    fn splat(self, value: f32) -> Self::F;
    fn add(self, a: Self::F, b: Self::F) -> Self::F;
    fn sub(self, a: Self::F, b: Self::F) -> Self::F;
    fn mul(self, a: Self::F, b: Self::F) -> Self::F;
    /// `a b − c`
    fn mul_sub(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F;
    /// `c − a b`
    fn neg_mul_add(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F;
    /// The smaller of both; either where one is NaN.
    fn min(self, a: Self::F, b: Self::F) -> Self::F;
    /// The larger of both; either where one is NaN.
    fn max(self, a: Self::F, b: Self::F) -> Self::F;
    fn abs(self, a: Self::F) -> Self::F;
    /// Bit i: whether `a ≤ b` in lane i.
    fn le(self, a: Self::F, b: Self::F) -> u32;
}

/// Plain Rust, which the compiler turns into what every processor of the target has.
#[derive(Debug, Clone, Copy)]
pub(super) struct Portable;

#[inline(always)]
fn each(f: impl Fn(usize) -> f32) -> [f32; 8] {
    std::array::from_fn(f)
}

impl Lanes for Portable {
    type F = [f32; 8];

    const NAME: &'static str = "portable";

    #[inline(always)]
    fn run<F: NullaryFnOnce>(self, f: F) -> F::Output {
        f.call()
    }

    #[inline(always)]
    fn prefetch(self, _: &[Cell], _: usize) {}

    #[inline(always)]
    fn load(self, values: &[f32; 8]) -> [f32; 8] {
        *values
    }

    #[inline(always)]
    fn store(self, values: [f32; 8]) -> [f32; 8] {
        values
    }

    #[inline(always)]
    fn splat(self, value: f32) -> [f32; 8] {
        [value; 8]
    }

    #[inline(always)]
    fn add(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        each(|i| a[i] + b[i])
    }

    #[inline(always)]
    fn sub(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        each(|i| a[i] - b[i])
    }

    #[inline(always)]
    fn mul(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        each(|i| a[i] * b[i])
    }

    #[inline(always)]
    fn mul_sub(self, a: [f32; 8], b: [f32; 8], c: [f32; 8]) -> [f32; 8] {
        each(|i| a[i] * b[i] - c[i])
    }

    #[inline(always)]
    fn neg_mul_add(self, a: [f32; 8], b: [f32; 8], c: [f32; 8]) -> [f32; 8] {
        each(|i| c[i] - a[i] * b[i])
    }

    #[inline(always)]
    fn min(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        each(|i| if a[i] < b[i] { a[i] } else { b[i] })
    }

    #[inline(always)]
    fn max(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        each(|i| if a[i] > b[i] { a[i] } else { b[i] })
    }

    #[inline(always)]
    fn abs(self, a: [f32; 8]) -> [f32; 8] {
        a.map(f32::abs)
    }

    #[inline(always)]
    fn le(self, a: [f32; 8], b: [f32; 8]) -> u32 {
        (0..8).fold(0, |mask, i| mask | u32::from(a[i] <= b[i]) << i)
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::arch::x86_64::{__m256, _CMP_LE_OQ, _MM_HINT_T0};

    use pulp::x86::{V3, V4};
    use pulp::{NullaryFnOnce, cast};

    use super::{Cell, Lanes};

    macro_rules! eight_lanes {
        ($Token:ty, $name:literal) => {
            impl Lanes for $Token {
                type F = __m256;

                const NAME: &'static str = $name;

                #[inline(always)]
                fn run<F: NullaryFnOnce>(self, f: F) -> F::Output {
                    self.vectorize(f)
                }

                #[inline(always)]
                fn prefetch(self, cells: &[Cell], place: usize) {
                    // Only a hint: nothing is read through the pointer.
                    let line = cells.as_ptr().wrapping_add(place).cast::<i8>();
                    self.sse._mm_prefetch::<_MM_HINT_T0>(line);
                    self.sse._mm_prefetch::<_MM_HINT_T0>(line.wrapping_add(64));
                    self.sse._mm_prefetch::<_MM_HINT_T0>(line.wrapping_add(128));
                    self.sse._mm_prefetch::<_MM_HINT_T0>(line.wrapping_add(192));
                }

                #[inline(always)]
                fn load(self, values: &[f32; 8]) -> __m256 {
                    cast(*values)
                }

                #[inline(always)]
                fn store(self, values: __m256) -> [f32; 8] {
                    cast(values)
                }

                #[inline(always)]
                fn splat(self, value: f32) -> __m256 {
                    self.avx._mm256_set1_ps(value)
                }

                #[inline(always)]
                fn add(self, a: __m256, b: __m256) -> __m256 {
                    self.avx._mm256_add_ps(a, b)
                }

                #[inline(always)]
                fn sub(self, a: __m256, b: __m256) -> __m256 {
                    self.avx._mm256_sub_ps(a, b)
                }

                #[inline(always)]
                fn mul(self, a: __m256, b: __m256) -> __m256 {
                    self.avx._mm256_mul_ps(a, b)
                }

                #[inline(always)]
                fn mul_sub(self, a: __m256, b: __m256, c: __m256) -> __m256 {
                    self.fma._mm256_fmsub_ps(a, b, c)
                }

                #[inline(always)]
                fn neg_mul_add(self, a: __m256, b: __m256, c: __m256) -> __m256 {
                    self.fma._mm256_fnmadd_ps(a, b, c)
                }

                #[inline(always)]
                fn min(self, a: __m256, b: __m256) -> __m256 {
                    self.avx._mm256_min_ps(a, b)
                }

                #[inline(always)]
                fn max(self, a: __m256, b: __m256) -> __m256 {
                    self.avx._mm256_max_ps(a, b)
                }

                #[inline(always)]
                fn abs(self, a: __m256) -> __m256 {
                    self.avx._mm256_andnot_ps(self.avx._mm256_set1_ps(-0.0), a)
                }

                #[inline(always)]
                fn le(self, a: __m256, b: __m256) -> u32 {
                    let mask = self.avx._mm256_cmp_ps::<_CMP_LE_OQ>(a, b);
                    self.avx._mm256_movemask_ps(mask).cast_unsigned()
                }
            }
        };
    }

    eight_lanes!(V3, "avx2");
    // The same instructions on twice the registers.
    eight_lanes!(V4, "avx512");
}
