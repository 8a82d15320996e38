#![no_main]
//! `photons_to_photos` of `tests/fuzz`.

libfuzzer_sys::fuzz_target!(|data: &[u8]| etendue_fuzz::guided::read("photons_to_photos", data));
