#![no_main]
//! `mask_exr` of `tests/fuzz`.

libfuzzer_sys::fuzz_target!(|data: &[u8]| etendue_fuzz::guided::read("mask_exr", data));
