//! The navigator's tasks.

use vigil_blocks::{RecoveryKind, Symptoms};

/// A task, and what is left of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Task {
    /// Stand.
    Stand,
    /// Follow the path.
    Follow,
    /// Look for an opening; how long it has looked, s.
    Look { passed_s: f64 },
    /// Go through the opening, up to a distance along the path, m; for how long, s; and whether
    /// what blocked it was a phantom.
    Pass {
        end_m: f64,
        passed_s: f64,
        is_phantom: bool,
    },
    /// Think about another path, s.
    Plan { passed_s: f64 },
    /// Find the own place, s.
    Locate { passed_s: f64 },
    /// Move away from where it began, x and y in m.
    Back { from: [f64; 2], passed_s: f64 },
    /// Wait for help, s.
    Wait { passed_s: f64 },
}

impl Task {
    /// The task that an action starts, for a robot whose believed position is `place`.
    pub(super) const fn begin(kind: RecoveryKind, place: [f64; 2]) -> Self {
        let passed_s = 0.0;
        match kind {
            RecoveryKind::None | RecoveryKind::Stop | RecoveryKind::GiveUp | RecoveryKind::Own => {
                Self::Stand
            }
            RecoveryKind::GoOn
            | RecoveryKind::SlowDown
            | RecoveryKind::Compensate
            | RecoveryKind::IgnoreEncoder
            | RecoveryKind::LimpHome => Self::Follow,
            RecoveryKind::CallForHelp => Self::Wait { passed_s },
            RecoveryKind::NewPath => Self::Plan { passed_s },
            RecoveryKind::Relocalise => Self::Locate { passed_s },
            RecoveryKind::GoThrough => Self::Look { passed_s },
            RecoveryKind::MoveAway => Self::Back {
                from: place,
                passed_s,
            },
        }
    }
}

/// Symptoms that the outcome of an action shows: an observation of the paper, or 0.
pub(super) const fn symptoms_of(kind: RecoveryKind, succeeded: bool) -> u32 {
    match (kind, succeeded) {
        (RecoveryKind::GoThrough, true) => Symptoms::BO,
        (RecoveryKind::NewPath, true) => Symptoms::ALT,
        (RecoveryKind::NewPath, false) => Symptoms::NNA,
        _ => 0,
    }
}
