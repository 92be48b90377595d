//! Colours: one for each fault, the same in every page and picture.
//!
//! No hue stands alone for a meaning: faults have names beside them, and beyond eight broken lines.
//! Healthy is green, and no fault is: those who see no red from green tell it by its darkness.

use crate::stroke::Stroke;

/// A colour in light pages, in dark ones, and in pictures that know neither.
struct Tone {
    light: &'static str,
    dark: &'static str,
    middle: &'static str,
}

const fn tone(light: &'static str, dark: &'static str, middle: &'static str) -> Tone {
    Tone {
        light,
        dark,
        middle,
    }
}

const HEALTHY: Tone = tone("#0b7f58", "#35c193", "#1c9a70");
/// Of faults, by their place.
const FAULTS: [Tone; 8] = [
    tone("#0072b2", "#56b4e9", "#2b8ac8"),
    tone("#d05000", "#f58a45", "#da6a20"),
    tone("#8a4fd0", "#b898f5", "#9a70d8"),
    tone("#a07400", "#e6b93c", "#b58a18"),
    tone("#bd3f83", "#ee8fc4", "#cc68a2"),
    tone("#0c8299", "#5fd0e4", "#1f9bb2"),
    tone("#7d5026", "#cba077", "#9a7046"),
    tone("#343aa8", "#8d96ff", "#5f66d6"),
];
/// Colours of things that are no faults.
pub const SERIES: usize = 6;
/// Shades of a share, from weak to strong: of one hue, so that only their darkness tells.
const LIGHT_SHADES: [&str; SHADES] = [
    "#77cced", "#58b7e3", "#3ea3d8", "#2e92d0", "#1776ba", "#0d5da5", "#0e4790", "#103179",
    "#101e61",
];
/// The same in dark pages: the stronger, the brighter.
const DARK_SHADES: [&str; SHADES] = [
    "#293e84", "#2a4f97", "#2a5fa6", "#2b6fb1", "#3f8bc7", "#58a6d8", "#79c2e9", "#9fddf8",
    "#d1f2fe",
];
/// How many shades there are.
pub const SHADES: usize = 9;
/// From this shade on a text is read in the colour of the page's back, below it in that of texts.
const STRONG: usize = 4;

/// What something is drawn in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Colour {
    /// That of the text.
    Ink,
    /// Of what is less important.
    Soft,
    /// Of an alarm, a miss, a damage.
    Alarm,
    /// Of the healthy robot.
    Healthy,
    /// Of a fault that no model explains.
    Unknown,
    /// Of the fault at this place of the fault tree, which is above 0.
    Fault(usize),
    /// Of things that are no faults, from 0.
    Series(usize),
    /// Of a share, from 0: the more, the further from the page's back.
    Shade(usize),
}

impl Colour {
    /// Of a node of a fault tree, or of a state or action of a decision model: the first of them is
    /// what is healthy.
    #[must_use]
    pub const fn node(place: usize) -> Self {
        match place {
            0 => Self::Healthy,
            place => Self::Fault(place),
        }
    }

    /// In the style of the page.
    #[must_use]
    pub fn css(self) -> String {
        match self {
            Self::Ink => "currentColor".to_owned(),
            Self::Soft => "var(--soft)".to_owned(),
            Self::Alarm => "var(--c6)".to_owned(),
            Self::Healthy => "var(--f0)".to_owned(),
            Self::Unknown => "var(--soft)".to_owned(),
            Self::Fault(place) => format!("var(--f{})", hue(place) + 1),
            Self::Series(index) => format!("var(--c{})", index % SERIES + 1),
            Self::Shade(index) => format!("var(--h{})", index.min(SHADES - 1) + 1),
        }
    }

    /// How a line of this colour is drawn: faults of one hue differ in it.
    #[must_use]
    pub const fn stroke(self) -> Stroke {
        match self {
            Self::Unknown => Stroke::Dashed,
            Self::Fault(place) => match place.saturating_sub(1) / FAULTS.len() % 3 {
                0 => Stroke::Solid,
                1 => Stroke::Dashed,
                _ => Stroke::Dotted,
            },
            _ => Stroke::Solid,
        }
    }
}

/// The colour of a text that lies on a shade.
#[must_use]
pub const fn on_shade(index: usize) -> &'static str {
    if index < STRONG {
        "var(--ink)"
    } else {
        "var(--back)"
    }
}

const fn hue(place: usize) -> usize {
    place.saturating_sub(1) % FAULTS.len()
}

/// Colour of [`Colour::node`] in a picture that lies on light and dark: in middle tones.
#[must_use]
pub const fn middle(place: usize) -> &'static str {
    match place {
        0 => HEALTHY.middle,
        place => FAULTS[hue(place)].middle,
    }
}

/// The variables of a page: `--f0` for healthy, `--h1` for the weakest shade.
pub(crate) fn variables(is_dark: bool) -> String {
    let all = [&HEALTHY].into_iter().chain(&FAULTS).enumerate();
    let one = |(at, tone): (usize, &Tone)| {
        let colour = if is_dark { tone.dark } else { tone.light };
        format!("--f{at}:{colour};")
    };
    let shades = if is_dark { DARK_SHADES } else { LIGHT_SHADES };
    let shades = shades.iter().enumerate();
    let shades = shades.map(|(at, colour)| format!("--h{}:{colour};", at + 1));
    all.map(one).chain(shades).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts(colour: &str) -> [f64; 3] {
        let part = |at: usize| u8::from_str_radix(&colour[at..at + 2], 16).unwrap();
        [1, 3, 5].map(|at| f64::from(part(at)) / 255.0)
    }

    /// Relative luminance, as in the guidelines for web content.
    fn luminance(colour: &str) -> f64 {
        let linear = parts(colour).map(|c| match c <= 0.04045 {
            true => c / 12.92,
            false => ((c + 0.055) / 1.055).powf(2.4),
        });
        linear[0] * 0.2126 + linear[1] * 0.7152 + linear[2] * 0.0722
    }

    fn contrast(a: &str, b: &str) -> f64 {
        let (a, b) = (luminance(a), luminance(b));
        (a.max(b) + 0.05) / (a.min(b) + 0.05)
    }

    #[test]
    fn all_tones_are_readable_where_they_lie() {
        for tone in [&HEALTHY].into_iter().chain(&FAULTS) {
            assert!(contrast(tone.light, "#fcfcfb") > 3.0, "{}", tone.light);
            assert!(contrast(tone.dark, "#1a1a19") > 3.0, "{}", tone.dark);
            for back in ["#ffffff", "#000000"] {
                assert!(contrast(tone.middle, back) > 2.7, "{}", tone.middle);
            }
        }
    }

    #[test]
    fn shades_leave_the_back_step_by_step_and_texts_on_them_are_readable() {
        let pages = [
            (LIGHT_SHADES, "#fcfcfb", "#1c1c1a"),
            (DARK_SHADES, "#1a1a19", "#f0f0ea"),
        ];
        for (shades, back, ink) in pages {
            assert!(contrast(shades[0], back) > 1.7, "the weakest is seen");
            for pair in shades.windows(2) {
                assert!(contrast(pair[1], back) > 1.2 * contrast(pair[0], back));
            }
            for (index, shade) in shades.into_iter().enumerate() {
                let text = if on_shade(index) == "var(--ink)" {
                    ink
                } else {
                    back
                };
                assert!(contrast(shade, text) > 4.5, "{shade}");
                let [red, green, blue] = parts(shade);
                assert!(blue > green && green > red, "blue, never red or green");
            }
        }
    }

    #[test]
    fn healthy_is_green_and_faults_of_one_tree_differ() {
        for colour in [HEALTHY.light, HEALTHY.dark, HEALTHY.middle] {
            let [red, green, blue] = parts(colour);
            assert!(green > blue && green > 1.5 * red);
        }
        assert_eq!(Colour::node(0), Colour::Healthy);
        let looks = |place: usize| {
            let colour = Colour::node(place);
            format!("{} {:?}", colour.css(), colour.stroke())
        };
        let all: std::collections::BTreeSet<String> = (0..25).map(looks).collect();
        assert_eq!(all.len(), 25);
        assert_eq!(Colour::node(9).css(), Colour::node(1).css());
        assert_eq!(middle(9), middle(1));
    }
}
