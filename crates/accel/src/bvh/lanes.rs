//! Eight or sixteen single-precision numbers at a time, on whatever the processor has.
//!
//! A [`Lanes`] is a token that can only be had where its instructions exist, so everything here is
//! safe code. The compiler sees through all of it as long as it is inlined into
//! [`Lanes::run`], which is where the instruction set is switched on.
//!
//! Lanes in plain Rust, which the compiler turns into what every processor of the target has.

#[cfg(target_arch = "x86_64")]
mod x86;

use pulp::NullaryFnOnce;

use super::wide::NodeChunk;

/// Arithmetic on some numbers side by side.
pub(super) trait Arithmetic: Copy {
    /// The numbers.
    type F: Copy;

    fn splat(self, value: f32) -> Self::F;
    fn add(self, a: Self::F, b: Self::F) -> Self::F;
    fn sub(self, a: Self::F, b: Self::F) -> Self::F;
    fn mul(self, a: Self::F, b: Self::F) -> Self::F;
    fn div(self, a: Self::F, b: Self::F) -> Self::F;
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
    /// `a` in the lanes whose bits are set, `b` in the others; all their bits, whatever they mean.
    fn select(self, mask: u32, a: Self::F, b: Self::F) -> Self::F;
    /// The least of all lanes. None may be NaN.
    fn least(self, a: Self::F) -> f32;
    /// The greatest of all lanes, which keeps the sign of a 0 that they all are. None may be NaN.
    fn greatest(self, a: Self::F) -> f32;
}

/// An instruction set: eight lanes, and a way to have sixteen.
pub(super) trait Lanes: Arithmetic + Send + Sync {
    /// Arithmetic on sixteen numbers.
    type Sixteen: Arithmetic;

    /// The name for reports.
    const NAME: &'static str;

    /// Runs `f` with these instructions switched on, as far as it is inlined.
    fn run<F: NullaryFnOnce>(self, f: F) -> F::Output;

    /// Begins to fetch the cells from `place` on that a node or a leaf may have.
    fn prefetch(self, cells: &[NodeChunk], place: usize);
    fn load(self, values: &[f32; 8]) -> Self::F;
    fn store(self, values: Self::F) -> [f32; 8];

    fn sixteen(self) -> Self::Sixteen;
    fn load_sixteen(self, values: &[f32; 16]) -> <Self::Sixteen as Arithmetic>::F;
    fn store_sixteen(self, values: <Self::Sixteen as Arithmetic>::F) -> [f32; 16];
}

/// Sixteen lanes as two times eight.
#[derive(Debug, Clone, Copy)]
pub(super) struct Twice<L>(L);

impl<L: Arithmetic> Arithmetic for Twice<L> {
    type F = [L::F; 2];

    #[inline(always)]
    fn splat(self, value: f32) -> [L::F; 2] {
        [self.0.splat(value); 2]
    }

    #[inline(always)]
    fn add(self, [a, b]: [L::F; 2], [c, d]: [L::F; 2]) -> [L::F; 2] {
        [self.0.add(a, c), self.0.add(b, d)]
    }

    #[inline(always)]
    fn sub(self, [a, b]: [L::F; 2], [c, d]: [L::F; 2]) -> [L::F; 2] {
        [self.0.sub(a, c), self.0.sub(b, d)]
    }

    #[inline(always)]
    fn mul(self, [a, b]: [L::F; 2], [c, d]: [L::F; 2]) -> [L::F; 2] {
        [self.0.mul(a, c), self.0.mul(b, d)]
    }

    #[inline(always)]
    fn div(self, [a, b]: [L::F; 2], [c, d]: [L::F; 2]) -> [L::F; 2] {
        [self.0.div(a, c), self.0.div(b, d)]
    }

    #[inline(always)]
    fn mul_sub(self, [a, b]: [L::F; 2], [c, d]: [L::F; 2], [e, f]: [L::F; 2]) -> [L::F; 2] {
        [self.0.mul_sub(a, c, e), self.0.mul_sub(b, d, f)]
    }

    #[inline(always)]
    fn neg_mul_add(self, [a, b]: [L::F; 2], [c, d]: [L::F; 2], [e, f]: [L::F; 2]) -> [L::F; 2] {
        [self.0.neg_mul_add(a, c, e), self.0.neg_mul_add(b, d, f)]
    }

    #[inline(always)]
    fn min(self, [a, b]: [L::F; 2], [c, d]: [L::F; 2]) -> [L::F; 2] {
        [self.0.min(a, c), self.0.min(b, d)]
    }

    #[inline(always)]
    fn max(self, [a, b]: [L::F; 2], [c, d]: [L::F; 2]) -> [L::F; 2] {
        [self.0.max(a, c), self.0.max(b, d)]
    }

    #[inline(always)]
    fn abs(self, [a, b]: [L::F; 2]) -> [L::F; 2] {
        [self.0.abs(a), self.0.abs(b)]
    }

    #[inline(always)]
    fn le(self, [a, b]: [L::F; 2], [c, d]: [L::F; 2]) -> u32 {
        self.0.le(a, c) | self.0.le(b, d) << 8
    }

    #[inline(always)]
    fn select(self, mask: u32, [a, b]: [L::F; 2], [c, d]: [L::F; 2]) -> [L::F; 2] {
        [self.0.select(mask, a, c), self.0.select(mask >> 8, b, d)]
    }

    #[inline(always)]
    fn least(self, [a, b]: [L::F; 2]) -> f32 {
        self.0.least(self.0.min(a, b))
    }

    #[inline(always)]
    fn greatest(self, [a, b]: [L::F; 2]) -> f32 {
        self.0.greatest(self.0.max(a, b))
    }
}

/// By halves, so that four steps are not eight.
#[inline(always)]
fn least(a: [f32; 8]) -> f32 {
    let min = |a: f32, b: f32| if a < b { a } else { b };
    let [a, b, c, d] = [min(a[0], a[4]), min(a[1], a[5]), min(a[2], a[6]), min(a[3], a[7])];
    min(min(a, c), min(b, d))
}

/// The two halves of sixteen numbers.
#[inline(always)]
fn halves(values: &[f32; 16]) -> [[f32; 8]; 2] {
    bytemuck::cast(*values)
}

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
    fn prefetch(self, _: &[NodeChunk], _: usize) {}

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

#[cfg(test)]
mod tests {
    use super::*;

    fn check<L: Lanes>(lanes: L) {
        let name = L::NAME;
        let bits = |value: f32| value.to_bits();
        for zero in [0.0, -0.0_f32] {
            // Which way a ray of no slope runs is told by the sign of its zero.
            let eight = lanes.splat(zero);
            assert_eq!(bits(lanes.least(eight)), bits(zero), "{name}: {zero:?}");
            assert_eq!(bits(lanes.greatest(eight)), bits(zero), "{name}: {zero:?}");
            let sixteen = lanes.load_sixteen(&[zero; 16]);
            assert_eq!(bits(lanes.sixteen().least(sixteen)), bits(zero), "{name}: {zero:?}");
            assert_eq!(bits(lanes.sixteen().greatest(sixteen)), bits(zero), "{name}: {zero:?}");
        }
        let values: [f32; 16] =
            std::array::from_fn(|k| [2.5, -7.0, 1e-38, 0.0][k % 4] * (k as f32));
        let sixteen = lanes.load_sixteen(&values);
        assert_eq!(lanes.sixteen().least(sixteen), -91.0, "{name}");
        assert_eq!(lanes.sixteen().greatest(sixteen), 30.0, "{name}");
    }

    #[test]
    fn least_and_greatest_are_exact_with_every_instruction_set() {
        check(Portable);
        #[cfg(target_arch = "x86_64")]
        {
            pulp::x86::V3::try_new().into_iter().for_each(check);
            pulp::x86::V4::try_new().into_iter().for_each(check);
        }
    }
}
