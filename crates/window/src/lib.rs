#![forbid(unsafe_code)]
#![doc = include_str!("../README.md")]
//!
//! | module | idea |
//! |---|---|
//! | `app` | the window's state, and how news and input change it |
//! | `worker` | the thread that renders, always at the latest wish |
//! | `document` | the scene that is edited, with undo and redo |
//! | `form` | widgets for any value that a JSON Schema describes |
//! | `state` | what the window holds besides the scene |
//! | `panels` | one pass of the user interface: the picture in the middle, and what stands around it |
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests set their stage by hand"))]

mod app;
mod document;
#[cfg(test)]
mod driven;
mod form;
mod panels;
mod state;
mod worker;

use std::path::PathBuf;
use std::sync::Arc;

use eframe::{UserEvent, egui};
use etendue::{Options, Refusal};
use winit::event_loop::EventLoopBuilder;

/// The window's first size (points).
const SIZE: [f32; 2] = [1360.0, 860.0];

/// Remedies of a screen that shows no window.
const OVER_SSH: &str =
    "over SSH, connect with X forwarding (ssh -X), or render to files with `etendue render`";

/// An X server is taken before Wayland where there are both: winit knows of files dropped on a window from X alone.
#[cfg_attr(
    not(target_os = "linux"),
    expect(unused_variables, reason = "there is one kind of window there")
)]
fn prefer_x11(builder: &mut EventLoopBuilder<UserEvent>, has_x11: bool) {
    #[cfg(target_os = "linux")]
    if has_x11 {
        use winit::platform::x11::EventLoopBuilderExtX11;
        builder.with_x11();
    }
}

/// Opens a window, on `path` when it is given, and returns when it is closed.
///
/// # Errors
///
/// When there is no display, what draws on it is not there, or it cannot show a window.
pub fn run(path: Option<PathBuf>, options: Options) -> Result<(), Refusal> {
    let is_set = |name| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    let has_x11 = is_set("DISPLAY");
    if cfg!(target_os = "linux") && !has_x11 && !is_set("WAYLAND_DISPLAY") {
        let why =
            "there is no display to show a window on (neither DISPLAY nor WAYLAND_DISPLAY is set)";
        return Err(Refusal::new(why).hint(OVER_SSH));
    }
    #[cfg(target_os = "linux")]
    if !has_x11 && !wayland_sys::egl::is_lib_available() {
        let why =
            "windows are drawn on Wayland by the library libwayland-egl.so.1, which is not here";
        let remedy = "install it (on Debian `apt install libwayland-egl1`), or render to files with `etendue render`";
        return Err(Refusal::new(why).hint(remedy));
    }
    let viewport = egui::ViewportBuilder::default()
        .with_title("etendue")
        .with_app_id("etendue")
        .with_inner_size(SIZE)
        .with_min_inner_size([640.0, 400.0])
        .with_drag_and_drop(true);
    let native = eframe::NativeOptions {
        viewport,
        event_loop_builder: Some(Box::new(move |builder| prefer_x11(builder, has_x11))),
        ..eframe::NativeOptions::default()
    };
    let make = move |context: &eframe::CreationContext<'_>| {
        let painter = context.egui_ctx.clone();
        let wake = Arc::new(move || painter.request_repaint());
        let app = app::App::new(path, options, wake)?;
        Ok(Box::new(app) as Box<dyn eframe::App>)
    };
    eframe::run_native("etendue", native, Box::new(make)).map_err(|error| {
        Refusal::new(format!("the window cannot be opened: {error}")).hint(OVER_SSH)
    })
}
