#![no_main]
//! `environment_exr` of `tests/fuzz`.

libfuzzer_sys::fuzz_target!(|data: &[u8]| etendue_fuzz::guided::read("environment_exr", data));
