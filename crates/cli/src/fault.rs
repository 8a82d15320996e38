//! Errors as the user sees them: one message and an exit code.

use std::io::Write;
use std::process::ExitCode;

use etendue_accel::BuildError;
use etendue_bench::BenchError;
use etendue_render::RenderError;
use etendue_render::expose::ExposeError;
use etendue_render::output::OutputError;
use etendue_scene::SceneError;
use etendue_sensor::emva::EmvaError;

/// Why a command failed.
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

    pub(crate) fn print(&self) {
        let (Self::Refused(error) | Self::Failed(error)) = self;
        let mut message = error.to_string();
        for cause in error.chain().skip(1) {
            let cause = cause.to_string();
            // Some errors already quote what caused them.
            if !message.contains(&cause) {
                message.push_str(": ");
                message.push_str(&cause);
            }
        }
        // When standard error is gone there is nobody to tell.
        let _ = writeln!(std::io::stderr(), "error: {}", printable(&message));
    }

    pub(crate) fn exit_code(&self) -> ExitCode {
        match self {
            Self::Refused(_) => ExitCode::from(2),
            Self::Failed(_) => ExitCode::FAILURE,
        }
    }
}

impl From<SceneError> for Fault {
    fn from(error: SceneError) -> Self {
        match error {
            SceneError::Stopped => Self::Failed(anyhow::Error::msg(STOPPED)),
            error => Self::Refused(error.into()),
        }
    }
}

impl From<RenderError> for Fault {
    fn from(error: RenderError) -> Self {
        match error {
            RenderError::Stopped | RenderError::Build(BuildError::Stopped) => {
                Self::Failed(anyhow::Error::msg(STOPPED))
            }
            RenderError::Picture(_) | RenderError::Build(BuildError::OutOfMemory { .. }) => {
                Self::Failed(error.into())
            }
            error => Self::Refused(error.into()),
        }
    }
}

impl From<OutputError> for Fault {
    fn from(error: OutputError) -> Self {
        match error {
            OutputError::Stopped { .. } => Self::Failed(anyhow::Error::msg(STOPPED)),
            // A folder that cannot be written to is the caller's to mend.
            error => Self::Refused(error.into()),
        }
    }
}

impl From<ExposeError> for Fault {
    fn from(error: ExposeError) -> Self {
        match error {
            ExposeError::Output(error) => error.into(),
            ExposeError::Stopped => Self::Failed(anyhow::Error::msg(STOPPED)),
            error => Self::Failed(error.into()),
        }
    }
}

impl From<BenchError> for Fault {
    fn from(error: BenchError) -> Self {
        match error {
            BenchError::Stopped | BenchError::Build(BuildError::Stopped) => {
                Self::Failed(anyhow::Error::msg(STOPPED))
            }
            BenchError::Drawing(_) => Self::Failed(error.into()),
            error => Self::Refused(error.into()),
        }
    }
}

/// `text` without what a damaged file might tell the terminal to do: control characters are spelled
/// out.
fn printable(text: &str) -> String {
    let mut printable = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '\n' | '\t' => printable.push(c),
            c if c.is_control() => printable.extend(c.escape_unicode()),
            c => printable.push(c),
        }
    }
    printable
}

impl From<EmvaError> for Fault {
    fn from(error: EmvaError) -> Self {
        match error {
            EmvaError::Stopped => Self::Failed(anyhow::Error::msg(STOPPED)),
            error => Self::Refused(error.into()),
        }
    }
}

const STOPPED: &str = "stopped; no unfinished file was left";

/// Prints `value` as indented JSON to standard output.
pub(crate) fn print_json(value: &impl serde::Serialize) -> Result<(), Fault> {
    let json = serde_json::to_string_pretty(value).map_err(|error| Fault::Failed(error.into()))?;
    print_text(&json)
}

/// Prints `text` and a line end to standard output. A closed pipe is no fault: who closed it has had
/// enough.
pub(crate) fn print_text(text: &str) -> Result<(), Fault> {
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{}", text.trim_end_matches('\n')).and_then(|()| out.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Fault::Failed(error.into()))
        }
        _ => Ok(()),
    }
}
