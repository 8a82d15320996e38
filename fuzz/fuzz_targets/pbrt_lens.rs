#![no_main]
//! `pbrt_lens` of `tests/fuzz`.

libfuzzer_sys::fuzz_target!(|data: &[u8]| etendue_fuzz::guided::read("pbrt_lens", data));
