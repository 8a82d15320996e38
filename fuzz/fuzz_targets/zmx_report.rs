#![no_main]
//! `zmx_report` of `tests/fuzz`.

use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;

static FOLDER: LazyLock<tempfile::TempDir> =
    LazyLock::new(|| tempfile::tempdir().expect("a temporary folder"));

fuzz_target!(|data: &[u8]| {
    if let Some(target) = etendue_fuzz::targets::named("zmx_report") {
        (target.run)(data, FOLDER.path());
    }
});
