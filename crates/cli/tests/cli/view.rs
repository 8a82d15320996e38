//! The window, as far as there is none.

use crate::run::Bench;

#[test]
#[cfg(not(feature = "window"))]
fn a_command_without_the_window_says_how_to_get_it() {
    insta::assert_snapshot!(Bench::new().refusal(&["view", "scene.json"]), @"
    error: this etendue was built without the window
    hint: build it with `cargo build --release -p etendue-cli --features window`, or run `make view`; without a window there is `etendue render`
    ");
}

#[test]
#[cfg(feature = "window")]
fn what_cannot_be_opened_is_told_where_the_command_was_given() {
    insta::assert_snapshot!(Bench::new().refusal(&["view", "scene.json"]), @"error: scene.json: no such file");
}
