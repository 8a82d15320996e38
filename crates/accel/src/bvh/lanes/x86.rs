//! Lanes of x86-64: eight by AVX2 or AVX-512, sixteen by AVX-512.

use std::arch::x86_64::{__m256, __m512, _CMP_LE_OQ, _MM_HINT_T0};

use pulp::x86::{V3, V4};
use pulp::{NullaryFnOnce, cast};

use super::{Arithmetic, Lanes, NodeChunk, Twice, halves, least};

macro_rules! eight_lanes {
    ($Token:ty) => {
        impl Arithmetic for $Token {
            type F = __m256;

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
            fn div(self, a: __m256, b: __m256) -> __m256 {
                self.avx._mm256_div_ps(a, b)
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

            #[inline(always)]
            fn select(self, mask: u32, a: __m256, b: __m256) -> __m256 {
                // Moves each lane's bit of the mask to where the blend looks: its sign.
                let bits = self.avx._mm256_set1_epi32(mask.cast_signed());
                let up = self.avx._mm256_setr_epi32(31, 30, 29, 28, 27, 26, 25, 24);
                let signs = self.avx2._mm256_sllv_epi32(bits, up);
                self.avx._mm256_blendv_ps(b, a, self.avx._mm256_castsi256_ps(signs))
            }

            #[inline(always)]
            fn least(self, a: __m256) -> f32 {
                least(cast(a))
            }

            #[inline(always)]
            fn greatest(self, a: __m256) -> f32 {
                // From −0: 0 − 0 is 0, whose opposite is −0.
                -least(cast(self.sub(self.splat(-0.0), a)))
            }
        }
    };
}

macro_rules! lanes {
    () => {
        #[inline(always)]
        fn run<F: NullaryFnOnce>(self, f: F) -> F::Output {
            self.vectorize(f)
        }

        #[inline(always)]
        fn prefetch(self, cells: &[NodeChunk], place: usize) {
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
    };
}

eight_lanes!(V3);
eight_lanes!(V4);

/// AVX2 and fused multiply-add.
impl Lanes for V3 {
    type Sixteen = Twice<Self>;

    const NAME: &'static str = "avx2";

    lanes!();

    #[inline(always)]
    fn sixteen(self) -> Twice<Self> {
        Twice(self)
    }

    #[inline(always)]
    fn load_sixteen(self, values: &[f32; 16]) -> [__m256; 2] {
        let [a, b] = halves(values);
        [cast(a), cast(b)]
    }

    #[inline(always)]
    fn store_sixteen(self, values: [__m256; 2]) -> [f32; 16] {
        let halves: [[f32; 8]; 2] = [cast(values[0]), cast(values[1])];
        bytemuck::cast(halves)
    }
}

/// AVX-512: the same eight lanes on twice the registers, and sixteen in one.
impl Lanes for V4 {
    type Sixteen = Sixteen;

    const NAME: &'static str = "avx512";

    lanes!();

    #[inline(always)]
    fn sixteen(self) -> Sixteen {
        Sixteen(self)
    }

    #[inline(always)]
    fn load_sixteen(self, values: &[f32; 16]) -> __m512 {
        cast(*values)
    }

    #[inline(always)]
    fn store_sixteen(self, values: __m512) -> [f32; 16] {
        cast(values)
    }
}

/// Sixteen lanes of AVX-512.
#[derive(Debug, Clone, Copy)]
pub(in crate::bvh) struct Sixteen(V4);

impl Arithmetic for Sixteen {
    type F = __m512;

    #[inline(always)]
    fn splat(self, value: f32) -> __m512 {
        self.0.avx512f._mm512_set1_ps(value)
    }

    #[inline(always)]
    fn add(self, a: __m512, b: __m512) -> __m512 {
        self.0.avx512f._mm512_add_ps(a, b)
    }

    #[inline(always)]
    fn sub(self, a: __m512, b: __m512) -> __m512 {
        self.0.avx512f._mm512_sub_ps(a, b)
    }

    #[inline(always)]
    fn mul(self, a: __m512, b: __m512) -> __m512 {
        self.0.avx512f._mm512_mul_ps(a, b)
    }

    #[inline(always)]
    fn div(self, a: __m512, b: __m512) -> __m512 {
        self.0.avx512f._mm512_div_ps(a, b)
    }

    #[inline(always)]
    fn mul_sub(self, a: __m512, b: __m512, c: __m512) -> __m512 {
        self.0.avx512f._mm512_fmsub_ps(a, b, c)
    }

    #[inline(always)]
    fn neg_mul_add(self, a: __m512, b: __m512, c: __m512) -> __m512 {
        self.0.avx512f._mm512_fnmadd_ps(a, b, c)
    }

    #[inline(always)]
    fn min(self, a: __m512, b: __m512) -> __m512 {
        self.0.avx512f._mm512_min_ps(a, b)
    }

    #[inline(always)]
    fn max(self, a: __m512, b: __m512) -> __m512 {
        self.0.avx512f._mm512_max_ps(a, b)
    }

    #[inline(always)]
    fn abs(self, a: __m512) -> __m512 {
        self.0.avx512f._mm512_abs_ps(a)
    }

    #[inline(always)]
    fn le(self, a: __m512, b: __m512) -> u32 {
        self.0.avx512f._mm512_cmp_ps_mask::<_CMP_LE_OQ>(a, b).into()
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "sixteen lanes")]
    fn select(self, mask: u32, a: __m512, b: __m512) -> __m512 {
        self.0.avx512f._mm512_mask_blend_ps(mask as u16, b, a)
    }

    #[inline(always)]
    fn least(self, a: __m512) -> f32 {
        self.0.avx512f._mm512_reduce_min_ps(a)
    }

    #[inline(always)]
    fn greatest(self, a: __m512) -> f32 {
        self.0.avx512f._mm512_reduce_max_ps(a)
    }
}
