//! Who commands.

/// A commander.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Arm {
    /// Detector, identifier and supervisor as they ship.
    Vigil,
    /// Nobody watches: as planned, whatever happens.
    Without,
    /// Rules over detector and identifier, see [`super::Escalation`].
    Escalation,
    /// Stops at an alarm of the detector and calls for help.
    StopAndCall,
    /// Told the fault when it begins; the best action for the known state.
    Oracle,
}

impl Arm {
    /// All; Vigil first.
    pub const ALL: [Self; 5] = [
        Self::Vigil,
        Self::Without,
        Self::Escalation,
        Self::StopAndCall,
        Self::Oracle,
    ];

    /// In words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Vigil => "with Vigil",
            Self::Without => "without",
            Self::Escalation => "escalation",
            Self::StopAndCall => "stop and call",
            Self::Oracle => "told the fault",
        }
    }
}
