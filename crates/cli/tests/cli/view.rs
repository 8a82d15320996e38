//! The window, as far as there is none.

use crate::run::{Bench, text};

#[test]
#[cfg(not(feature = "window"))]
fn a_command_without_the_window_says_how_to_get_it() {
    let output = Bench::new().run(&["view", "scene.json"]);
    assert_eq!(output.status.code(), Some(2));
    let said = text(&output.stderr);
    assert!(said.contains("--features window") && said.contains("etendue render"), "{said}");
}

#[test]
#[cfg(feature = "window")]
fn what_cannot_be_opened_is_told_where_the_command_was_given() {
    let output = Bench::new().run(&["view", "scene.json"]);
    assert_eq!(output.status.code(), Some(2));
    let said = text(&output.stderr);
    assert!(said.contains("scene.json"), "{said}");
}
