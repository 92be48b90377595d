//! Why a graph is not started, or its launcher fails.

use std::io;
use std::path::PathBuf;

use vigil_cycle::PortError;
use vigil_recording::frames::FramesError;
use vigil_setup::{NotRunning, SetupError};

/// What the launcher cannot do.
#[derive(Debug, thiserror::Error)]
pub enum LauncherError {
    /// `--inject` with another source than the simulator.
    #[error("--inject: only the simulator can be broken; the source is another")]
    NotSimulated,
    /// `--rate` with recorded frames.
    #[error("--rate: recorded frames have their own; change it with --speed or sensor.speed")]
    RecordedRate,
    /// The configuration was refused.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// Recorded frames cannot be read.
    #[error(transparent)]
    Frames(#[from] FramesError),
    /// Recorded frames cannot be played at this speed.
    #[error("{}: {reason}", path.display())]
    PlaybackRate {
        /// The recording.
        path: PathBuf,
        /// What is wrong with its rate.
        reason: String,
    },
    /// What the services have refused, a line each, in their words.
    #[error("{}", .0.join("\n"))]
    Refused(Vec<String>),
    /// A file or program cannot be used.
    #[error("{}: {cause}", path.display())]
    File {
        /// Which.
        path: PathBuf,
        /// What the system said.
        cause: io::Error,
    },
    /// The checked configuration cannot be handed to the services.
    #[error("configuration for the services: {0}")]
    Document(io::Error),
    /// A core cannot be kept awake.
    #[error("--keep-awake: {0}")]
    KeepAwake(io::Error),
    /// There is no such graph to adopt.
    #[error(transparent)]
    NotRunning(#[from] NotRunning),
    /// The transport failed.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The summary cannot be written as JSON.
    #[error("summary: {0}")]
    Json(#[from] serde_json::Error),
}

impl LauncherError {
    /// For a file or program that the system refuses.
    pub fn file(path: impl Into<PathBuf>, cause: io::Error) -> Self {
        Self::File {
            path: path.into(),
            cause,
        }
    }
}
