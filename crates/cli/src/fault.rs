//! Errors as the user sees them: one message and an exit code.

use std::io::Write;
use std::process::ExitCode;

use etendue_accel::BuildError;
use etendue_bench::BenchError;
use etendue_files::WriteError;
use etendue_render::RenderError;
use etendue_render::output::OutputError;
use etendue_report::Refusal;
use etendue_scene::SceneError;
use etendue_scene::escape::{printable, printable_json};
use etendue_sensor::emva::EmvaError;

use crate::progress::say;
use crate::stop::STOPPED;

/// Error of a command that failed.
#[derive(Debug)]
pub(crate) enum Fault {
    /// The input was refused: exit code 2.
    Refused(anyhow::Error),
    /// Something else: exit code 1.
    Failed(anyhow::Error),
}

impl Fault {
    pub(crate) fn refused(message: impl Into<String>) -> Self {
        Self::Refused(anyhow::Error::msg(message.into()))
    }

    /// The user stopped it, or the system did not let it.
    pub(crate) fn failed(message: impl Into<String>) -> Self {
        Self::Failed(anyhow::Error::msg(message.into()))
    }

    pub(crate) fn print(&self) {
        let (Self::Refused(error) | Self::Failed(error)) = self;
        say(&format!("error: {}", Refusal::of(error.as_ref())));
    }

    pub(crate) fn exit_code(&self) -> ExitCode {
        match self {
            Self::Refused(_) => ExitCode::from(2),
            Self::Failed(_) => ExitCode::FAILURE,
        }
    }
}

impl From<etendue::Error> for Fault {
    fn from(error: etendue::Error) -> Self {
        match error {
            error if error.is_stopped() => Self::failed(STOPPED),
            error if error.is_refused() => Self::Refused(error.into()),
            error => Self::Failed(error.into()),
        }
    }
}

/// Converts errors of the library's parts as the library does.
macro_rules! as_the_library {
    ($($error:ty),*) => {$(
        impl From<$error> for Fault {
            fn from(error: $error) -> Self {
                etendue::Error::from(error).into()
            }
        }
    )*};
}

as_the_library!(SceneError, RenderError, OutputError, WriteError);

impl From<BenchError> for Fault {
    fn from(error: BenchError) -> Self {
        match error {
            BenchError::Stopped | BenchError::Build(BuildError::Stopped) => Self::failed(STOPPED),
            BenchError::Drawing(_) => Self::Failed(error.into()),
            error => Self::Refused(error.into()),
        }
    }
}

impl From<EmvaError> for Fault {
    fn from(error: EmvaError) -> Self {
        match error {
            EmvaError::Stopped => Self::failed(STOPPED),
            EmvaError::Write(error) => error.into(),
            error => Self::Refused(error.into()),
        }
    }
}

/// Prints `value` as indented JSON to standard output.
pub(crate) fn print_json(value: &impl serde::Serialize) -> Result<(), Fault> {
    let json = serde_json::to_string_pretty(value).map_err(|error| Fault::Failed(error.into()))?;
    print_raw(&printable_json(&json))
}

/// Output that a program reads, with the version of its keys: a key that goes, or means something else, makes the next
/// one.
#[derive(serde::Serialize)]
pub(crate) struct VersionedReport<'a, T> {
    version: u32,
    #[serde(flatten)]
    value: &'a T,
}

impl<'a, T> VersionedReport<'a, T> {
    pub(crate) fn new(value: &'a T) -> Self {
        Self { version: 1, value }
    }
}

/// Prints `value` as JSON on one line to standard output.
pub(crate) fn print_json_line(value: &impl serde::Serialize) -> Result<(), Fault> {
    let json = serde_json::to_string(value).map_err(|error| Fault::Failed(error.into()))?;
    print_raw(&printable_json(&json))
}

/// Prints `text` and a line end to standard output, without what a name in a file might tell the
/// terminal to do.
pub(crate) fn print_text(text: &str) -> Result<(), Fault> {
    print_raw(&printable(text))
}

/// Prints `text` and a line end to standard output. A closed pipe is no fault: who closed it has had
/// enough.
fn print_raw(text: &str) -> Result<(), Fault> {
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{}", text.trim_end_matches('\n')).and_then(|()| out.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Fault::Failed(error.into()))
        }
        _ => Ok(()),
    }
}
