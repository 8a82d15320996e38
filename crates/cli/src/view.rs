//! `etendue view`: a window onto a scene, a model, a lens or an image.

use crate::arguments::ViewArguments;
use crate::fault::Fault;

#[cfg(feature = "window")]
pub(crate) fn run(arguments: &ViewArguments) -> Result<(), Fault> {
    use etendue_window::WindowError;

    let options = etendue::Options {
        settings: arguments.settings.clone(),
        reach: match arguments.allow_outside {
            true => etendue::Reach::Anywhere,
            false => etendue::Reach::OwnFolder,
        },
        ..etendue::Options::default()
    };
    if let Some(path) = &arguments.scene {
        // What cannot be opened at all is told where the command was given.
        etendue::Viewed::open(path, options.clone())?;
    }
    etendue_window::run(arguments.scene.clone(), options)
        .map_err(|error: WindowError| Fault::refused(error.to_string()))
}

#[cfg(not(feature = "window"))]
pub(crate) fn run(_: &ViewArguments) -> Result<(), Fault> {
    Err(Fault::refused(
        "this etendue was built without the window: build it with \
         `cargo build --release -p etendue-cli --features window`, or run `make view`; without a window \
         there is `etendue render`",
    ))
}
