//! Lanes in plain Rust, which the compiler turns into what every processor of the target has.

use pulp::NullaryFnOnce;

use super::{Arithmetic, Cell, Lanes, Twice, halves, least};

/// The token of them: there is nothing to switch on.
#[derive(Debug, Clone, Copy)]
pub(in crate::bvh) struct Portable;

#[inline(always)]
fn each(f: impl Fn(usize) -> f32) -> [f32; 8] {
    std::array::from_fn(f)
}

impl Arithmetic for Portable {
    type F = [f32; 8];

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
    fn div(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        each(|i| a[i] / b[i])
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
        each(|i| a[i].abs())
    }

    #[inline(always)]
    fn le(self, a: [f32; 8], b: [f32; 8]) -> u32 {
        (0..8).fold(0, |mask, i| mask | u32::from(a[i] <= b[i]) << i)
    }

    #[inline(always)]
    fn select(self, mask: u32, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        each(|i| if mask >> i & 1 != 0 { a[i] } else { b[i] })
    }

    #[inline(always)]
    fn least(self, a: [f32; 8]) -> f32 {
        least(a)
    }

    #[inline(always)]
    fn greatest(self, a: [f32; 8]) -> f32 {
        // From −0: 0 − 0 is 0, whose opposite is −0.
        -least(self.sub([-0.0; 8], a))
    }
}

impl Lanes for Portable {
    type Sixteen = Twice<Self>;

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
    fn sixteen(self) -> Twice<Self> {
        Twice(self)
    }

    #[inline(always)]
    fn load_sixteen(self, values: &[f32; 16]) -> [[f32; 8]; 2] {
        halves(values)
    }

    #[inline(always)]
    fn store_sixteen(self, values: [[f32; 8]; 2]) -> [f32; 16] {
        bytemuck::cast(values)
    }
}
