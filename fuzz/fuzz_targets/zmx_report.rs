#![no_main]
//! `zmx_report` of `tests/fuzz`.

libfuzzer_sys::fuzz_target!(|data: &[u8]| etendue_fuzz::guided::read("zmx_report", data));
