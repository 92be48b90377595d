//! Colours that colour-blind people tell apart (Okabe and Ito), as terminals of 256 have them. A
//! colour never stands alone: a word or a sign says the same.

use std::ffi::OsStr;

use ratatui::style::{Color, Modifier, Style};

use crate::status::GraphState;

const BLUISH_GREEN: Color = Color::Indexed(36);
const SKY_BLUE: Color = Color::Indexed(74);
const ORANGE: Color = Color::Indexed(214);
const VERMILLION: Color = Color::Indexed(166);
const GREY: Color = Color::Indexed(245);

/// Colours, or none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Palette {
    has_colours: bool,
}

impl Palette {
    /// Without colours.
    pub const PLAIN: Self = Self { has_colours: false };
    /// With colours.
    pub const COLOURED: Self = Self { has_colours: true };

    /// Without colours if NO_COLOR, here its value, is set and not empty, as
    /// <https://no-color.org> has it.
    pub fn new(no_color: Option<&OsStr>) -> Self {
        match no_color.is_some_and(|value| !value.is_empty()) {
            true => Self::PLAIN,
            false => Self::COLOURED,
        }
    }

    const fn with(self, colour: Color) -> Style {
        match self.has_colours {
            true => Style::new().fg(colour),
            false => Style::new(),
        }
    }

    /// Of what is as it should be.
    pub const fn healthy(self) -> Style {
        self.with(BLUISH_GREEN)
    }

    /// Of what needs no action, but attention.
    pub const fn warning(self) -> Style {
        self.with(ORANGE)
    }

    /// Of what is wrong.
    pub const fn wrong(self) -> Style {
        self.with(VERMILLION).add_modifier(Modifier::BOLD)
    }

    /// Of bars and curves that say neither.
    pub const fn neutral(self) -> Style {
        self.with(SKY_BLUE)
    }

    /// Of titles.
    pub const fn title(self) -> Style {
        Style::new().add_modifier(Modifier::BOLD)
    }

    /// Of what is of the past, or explains.
    pub const fn past(self) -> Style {
        match self.has_colours {
            true => Style::new().fg(GREY),
            false => Style::new().add_modifier(Modifier::DIM),
        }
    }

    /// Of a graph's state.
    pub const fn state(self, state: GraphState) -> Style {
        match state {
            GraphState::Ok => self.healthy().add_modifier(Modifier::BOLD),
            GraphState::Degraded | GraphState::Unsupervised => {
                self.warning().add_modifier(Modifier::BOLD)
            }
            _ => self.wrong(),
        }
    }
}
