#![no_main]
//! `ply` of `tests/fuzz`.

libfuzzer_sys::fuzz_target!(|data: &[u8]| etendue_fuzz::guided::read("ply", data));
