#![no_main]
//! `environment_hdr` of `tests/fuzz`.

libfuzzer_sys::fuzz_target!(|data: &[u8]| etendue_fuzz::guided::read("environment_hdr", data));
