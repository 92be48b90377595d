//! What a decision was weighed from, small enough for an event.

use crate::action::{Action, ValueKind};
use crate::health::{Event, EventKind};

/// No index.
const NONE: u8 = u8::MAX;

/// What a decision was weighed from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weighing {
    /// The most probable states of the decision model with their probabilities, at most two, the
    /// more probable first.
    pub states: [Option<(usize, f32)>; 2],
    /// The best of the other actions, and how much less its number is than that of the action
    /// taken: below 0 if it would have been the better one, as where an action stands.
    pub second: Option<(usize, f32)>,
    /// What the numbers are.
    pub measure: ValueKind,
}

impl Weighing {
    /// States below this probability are not told.
    pub const P_MIN: f64 = 0.01;

    /// Of a published decision; none if its numbers are not known.
    #[must_use]
    pub fn new(action: &Action) -> Option<Self> {
        let states = action.belief.iter().take(action.state_count as usize);
        let mut best = [None; 2];
        for (state, p) in states.enumerate().filter(|(_, p)| **p >= Self::P_MIN) {
            let found = Some((state, *p as f32));
            let is_more = |than: Option<(usize, f32)>| than.is_none_or(|(_, q)| *p as f32 > q);
            if is_more(best[0]) {
                best = [found, best[0]];
            } else if is_more(best[1]) {
                best[1] = found;
            }
        }
        let taken = action.action as usize;
        let values = action.value.iter().take(action.action_count as usize);
        let own = *values.clone().nth(taken)?;
        let others = values.enumerate().filter(|(at, _)| *at != taken);
        let second = others.reduce(|best, new| if new.1 > best.1 { new } else { best });
        Some(Self {
            states: best,
            second: second.map(|(at, value)| (at, (own - value) as f32)),
            measure: ValueKind::from_repr(action.value_kind)?,
        })
    }

    /// `what`, `p` and `value` of an [`EventKind::Weighed`].
    #[must_use]
    pub fn to_event(&self) -> (u32, f64, u64) {
        let index = |of: Option<(usize, f32)>| of.and_then(|(at, _)| u8::try_from(at).ok());
        let number = |of: Option<(usize, f32)>| of.map_or(0.0, |(_, number)| number);
        let [first, other] = self.states;
        let bytes = [
            index(first).unwrap_or(NONE),
            index(other).unwrap_or(NONE),
            index(self.second).unwrap_or(NONE),
            self.measure as u8,
        ];
        let low = u64::from(number(other).to_bits());
        let high = u64::from(number(self.second).to_bits());
        let what = u32::from_le_bytes(bytes);
        (what, f64::from(number(first)), high << 32 | low)
    }

    /// Of an event; none if it is another, or damaged.
    #[must_use]
    pub fn from_event(event: &Event) -> Option<Self> {
        if event.kind != EventKind::Weighed as u32 {
            return None;
        }
        let [first, other, second, measure] = event.what.to_le_bytes();
        let with = |at: u8, number: f32| (at != NONE).then_some((usize::from(at), number));
        let (low, high) = (event.value as u32, (event.value >> 32) as u32);
        Some(Self {
            states: [
                with(first, event.p as f32),
                with(other, f32::from_bits(low)),
            ],
            second: with(second, f32::from_bits(high)),
            measure: ValueKind::from_repr(u32::from(measure))?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn action(belief: &[f64], value: &[f64], taken: u32) -> Action {
        let mut action = Action {
            state_count: belief.len() as u32,
            action_count: value.len() as u32,
            action: taken,
            value_kind: ValueKind::Value as u32,
            ..Action::default()
        };
        action.belief[..belief.len()].copy_from_slice(belief);
        action.value[..value.len()].copy_from_slice(value);
        action
    }

    #[test]
    fn the_most_probable_states_and_the_second_best_action_are_found() {
        let of = |belief: &[f64], value: &[f64], taken| {
            let found = Weighing::new(&action(belief, value, taken)).unwrap();
            (found.states, found.second)
        };
        let (states, second) = of(&[0.125, 0.25, 0.625], &[-4.0, -1.5, -2.0], 1);
        assert_eq!(states, [Some((2, 0.625)), Some((1, 0.25))]);
        assert_eq!(second, Some((2, 0.5)));
        // An action that stands although another is better; a state that is certain.
        let (states, second) = of(&[0.0, 1.0], &[3.0, 1.0], 1);
        assert_eq!((states, second), ([Some((1, 1.0)), None], Some((0, -2.0))));
        assert_eq!(of(&[1.0], &[3.0], 0).1, None);
        let unknown = Action {
            value_kind: 9,
            ..action(&[1.0], &[3.0], 0)
        };
        assert_eq!(Weighing::new(&unknown), None);
        assert_eq!(Weighing::new(&Action::default()), None);
    }

    #[test]
    fn an_event_carries_all_of_it() {
        for (belief, value) in [(&[0.25, 0.75][..], &[-1.0, 2.5, 2.0][..]), (&[1.0], &[0.5])] {
            let wanted = Weighing::new(&action(belief, value, 0)).unwrap();
            let (what, p, bits) = wanted.to_event();
            let event = Event {
                kind: EventKind::Weighed as u32,
                what,
                p,
                value: bits,
                ..Event::default()
            };
            assert_eq!(Weighing::from_event(&event), Some(wanted));
            let other = Event {
                kind: EventKind::Action as u32,
                ..event
            };
            assert_eq!(Weighing::from_event(&other), None);
            let damaged = Event { what: 0, ..event };
            assert_eq!(Weighing::from_event(&damaged), None);
        }
    }
}
