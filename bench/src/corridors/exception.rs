//! What goes wrong in a corridor.

/// What an exception is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Group {
    /// Nothing went wrong.
    Nothing,
    /// The way ahead.
    Way,
    /// Where the robot is and heads.
    Place,
    /// The hardware.
    Hardware,
    /// Two of these.
    Two,
}

impl Group {
    /// All.
    pub const ALL: [Self; 5] = [
        Self::Nothing,
        Self::Way,
        Self::Place,
        Self::Hardware,
        Self::Two,
    ];

    /// In words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Nothing => "nothing",
            Self::Way => "the way",
            Self::Place => "the place",
            Self::Hardware => "the hardware",
            Self::Two => "two at once",
        }
    }
}

/// Something that goes wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exception {
    /// Something fills the corridor, and stays.
    Blocked,
    /// People fill the corridor, and leave after a while.
    People,
    /// Something stands in the way that can be passed.
    Opening,
    /// The range sensor sees what is not there.
    Phantom,
    /// The range sensor sees nothing, and something stands in the way that can be passed.
    Blind,
    /// The believed pose is wrong.
    Lost,
    /// The robot steers into another direction than its path's.
    WrongHeading,
    /// A wheel is stuck.
    Stuck,
    /// An encoder is broken.
    Encoder,
}

impl Exception {
    /// Those of the way.
    pub(super) const WAY: [Self; 5] = [
        Self::Blocked,
        Self::People,
        Self::Opening,
        Self::Phantom,
        Self::Blind,
    ];
    /// Those of the place.
    pub(super) const PLACE: [Self; 2] = [Self::Lost, Self::WrongHeading];
    /// Those of the hardware.
    pub(super) const HARDWARE: [Self; 2] = [Self::Stuck, Self::Encoder];

    /// In words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Blocked => "blocked",
            Self::People => "people",
            Self::Opening => "opening",
            Self::Phantom => "phantom",
            Self::Blind => "blind",
            Self::Lost => "lost",
            Self::WrongHeading => "wrong heading",
            Self::Stuck => "stuck wheel",
            Self::Encoder => "broken encoder",
        }
    }

    /// What it is about.
    #[must_use]
    pub const fn group(self) -> Group {
        match self {
            Self::Blocked | Self::People | Self::Opening | Self::Phantom | Self::Blind => {
                Group::Way
            }
            Self::Lost | Self::WrongHeading => Group::Place,
            Self::Stuck | Self::Encoder => Group::Hardware,
        }
    }
}
