#![no_main]
//! `lens_report` of `tests/fuzz`.

libfuzzer_sys::fuzz_target!(|data: &[u8]| etendue_fuzz::guided::read("lens_report", data));
