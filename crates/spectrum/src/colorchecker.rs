//! The 24 patches of the ColorChecker Classic.
//!
//! # Source
//!
//! The mean reflectances of 30 charts, measured by Danny Pascale (BabelColor, 2012), as
//! colour-science 0.4.7 publishes them (BSD 3-clause), 380 to 730 nm.

use std::sync::LazyLock;

use crate::Curve;
use crate::table::Column;
use crate::table::CurveTable;

/// The patches, row by row from the dark skin to black.
pub static PATCHES: LazyLock<Vec<Curve>> = LazyLock::new(|| {
    let table = CurveTable::read(include_str!("colorchecker.csv"));
    let column = |k| table.as_ref().ok()?.column(Some(&Column::Number(k))).ok();
    (1..=24).filter_map(column).collect()
});

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_are_twenty_four_patches_and_white_is_the_brightest() {
        assert_eq!(PATCHES.len(), 24);
        let brightest =
            |nm: f64| (0..24).max_by(|&a, &b| PATCHES[a].held(nm).total_cmp(&PATCHES[b].held(nm)));
        assert!([450.0, 550.0].iter().all(|&nm| brightest(nm) == Some(18)));
    }

    /// The crate has its own copy, as it is published without the scenes.
    #[test]
    #[expect(clippy::disallowed_methods, reason = "a file of the source is read")]
    fn the_scenes_have_the_same_table() {
        let scenes = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/spectra/colorchecker.csv");
        assert_eq!(std::fs::read_to_string(scenes).unwrap(), include_str!("colorchecker.csv"));
    }
}
