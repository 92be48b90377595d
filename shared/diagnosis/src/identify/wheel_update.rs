//! Log-likelihoods of one observation's wheels in one motion mode, once for all hypotheses.

use vigil_blocks::WHEELS;
use vigil_checkpoint::CheckpointValue;
use vigil_robot::Description;
use vigil_robot::learned::wheel_evidence::WheelDrag;
use vigil_robot::learned::{Model, MotionMode, Mover, Observation, WheelEvidence};

use crate::identify::encoders::{
    DEAD, Encoders, FROZEN, Likelihoods, OWN_RATE, SILENT, SIZED, ZERO, breakage,
};
use crate::identify::rate_offsets::RateOffsets;
use crate::identify::sized_ways::{BIAS, DRIFT};
use crate::identify::sizes::EncoderSizes;

/// Of one motion mode.
#[derive(Debug, Clone, Copy, CheckpointValue)]
pub struct WheelTerms {
    /// In general, and at the mode's onset.
    likelihoods: [Likelihoods; 2],
    /// Wheels whose rates are learned on the way, and how they are expected to turn.
    dragged: [Option<WheelDrag>; WHEELS],
    stuck: u32,
}

/// One observation and its wheels.
#[derive(Debug, Clone, Copy)]
pub struct WheelUpdate<'a> {
    /// The model.
    pub model: &'a Model,
    /// Its robot.
    pub robot: &'a Description,
    /// The observation.
    pub observation: &'a Observation,
    /// What its wheels say.
    pub evidence: &'a WheelEvidence,
}

impl WheelUpdate<'_> {
    /// What the wheels say in one motion mode, `sized` being what they say of encoders that are off
    /// by a size.
    #[must_use]
    pub fn terms(&self, mode: &MotionMode, sized: &EncoderSizes) -> WheelTerms {
        let stuck = mode.moved.stuck();
        WheelTerms {
            likelihoods: [false, true].map(|is_new| self.likelihoods(mode, is_new, sized)),
            dragged: std::array::from_fn(|wheel| {
                let is_wheel = wheel < self.robot.wheels.len();
                (is_wheel && mode.learns_rate(wheel)).then(|| {
                    let (model, observation) = (self.model, self.observation);
                    self.evidence.dragged(model, observation, mode, wheel)
                })
            }),
            stuck,
        }
    }

    fn likelihoods(&self, mode: &MotionMode, is_new: bool, off: &EncoderSizes) -> Likelihoods {
        let (evidence, moved) = (self.evidence, mode.moved);
        let likelihoods = Likelihoods::new(self.robot.wheels.len(), |wheel, state| {
            match (state, moved) {
                (0, Mover::UnknownAny) | (_, Mover::Unknown) => evidence.healthy[wheel],
                (0, _) => evidence.whole(self.model, self.observation, mode, is_new, wheel),
                (OWN_RATE, Mover::UnknownAny) => evidence.own_rate[wheel],
                // A wheel that reads as if it stood stands, or its encoder alone is dead.
                (ZERO | DEAD, Mover::UnknownAny) => f64::NEG_INFINITY,
                (FROZEN, Mover::UnknownAny) if self.reads_zero(wheel) => f64::NEG_INFINITY,
                (OWN_RATE, _) => f64::NEG_INFINITY,
                // What reads alike shares one likelihood, broken or not.
                (SILENT, _) if moved.is_stuck(wheel) => evidence.broken[wheel][breakage(ZERO)],
                (SILENT, _) => f64::NEG_INFINITY,
                (sized, _) if sized >= SIZED => self.off(mode, wheel, sized - SIZED, off),
                (broken, _) => evidence.broken[wheel][breakage(broken)],
            }
        });
        // Whatever it was late by: a wheel that stands reads as one that stood.
        likelihoods.timely(!off.late | moved.stuck())
    }

    /// A wheel's readings by an encoder that is off in this way.
    fn off(&self, mode: &MotionMode, wheel: usize, way: usize, sizes: &EncoderSizes) -> f64 {
        let is_stuck = mode.moved.is_stuck(wheel);
        match (is_stuck, way) {
            (true, BIAS | DRIFT) => sizes.standing[wheel],
            // Any gain makes nothing of nothing.
            (true, _) => self.evidence.standing(wheel),
            (false, _) => sizes.logs[wheel][way],
        }
    }

    /// Steps the encoders of a hypothesis in this mode, each with these probabilities to break and
    /// to recover; returns the log-likelihood of the readings. The wheels `fresh` (bits) have just
    /// changed.
    pub fn weigh(
        &self,
        terms: &WheelTerms,
        births: &[f64; WHEELS],
        death: f64,
        fresh: u32,
        encoders: &mut Encoders,
        offsets: &mut RateOffsets,
    ) -> f64 {
        let (observation, evidence) = (self.observation, self.evidence);
        let [general, at_onset] = &terms.likelihoods;
        let mut likelihoods = *general;
        for wheel in (0..WHEELS).filter(|wheel| fresh >> wheel & 1 == 1) {
            likelihoods.replace(wheel, at_onset);
        }
        let dragged = terms.dragged.iter().enumerate();
        let dragged = dragged.filter_map(|(wheel, dragged)| Some((wheel, dragged.as_ref()?)));
        let dragged = dragged.filter(|(wheel, _)| fresh >> wheel & 1 == 0);
        for (wheel, dragged) in dragged.clone() {
            let log = offsets.log_likelihood(self.model, observation, evidence, wheel, dragged);
            likelihoods.replace_whole(wheel, log);
        }
        let (stuck, t_ns) = (terms.stuck, observation.t_first_ns);
        let gained = encoders.step(births, death, stuck, &likelihoods, t_ns);
        for (wheel, dragged) in dragged {
            if encoders.p_broken(wheel) < 0.5 {
                offsets.learn(observation, evidence, wheel, dragged);
            }
        }
        gained
    }

    /// Sets of stuck wheels that may have come of the set `before`, if several wheels stuck or
    /// turned again at once, by what the wheels read: these stick besides, those turn again, both.
    #[must_use]
    pub fn changed_sets(&self, before: u32, encoders: &Encoders) -> [u32; 3] {
        let (mut stood, mut turned) = (0, 0);
        for wheel in 0..self.robot.wheels.len().min(WHEELS) {
            let is_whole = encoders.p_broken(wheel) < 0.5;
            let age_s = age_s(self.observation.t_first_ns, encoders.onset(wheel));
            match (before >> wheel & 1 == 1, self.stands(wheel)) {
                (false, true) if is_whole || age_s < EXPLAINED_S => stood |= 1 << wheel,
                (true, false) if is_whole => turned |= 1 << wheel,
                _ => {}
            }
        }
        [before | stood, before & !turned, (before | stood) & !turned]
    }

    /// True if a wheel's readings are exactly zero, which one that repeats itself reads as well.
    fn reads_zero(&self, wheel: usize) -> bool {
        let broken = &self.evidence.broken[wheel];
        broken[breakage(ZERO)] >= broken[breakage(FROZEN)]
    }

    /// True if a wheel's readings may well be those of a standing one.
    fn stands(&self, wheel: usize) -> bool {
        let evidence = self.evidence;
        let silent = evidence.broken[wheel][breakage(ZERO)];
        evidence.standing(wheel).max(silent) + DOUBT > evidence.any[wheel]
    }
}

/// Readings that a standing wheel makes less probable than that it does anything, by up to this
/// much (natural logarithm), may still be its: one in a thousand lies so far out.
const DOUBT: f64 = 2.0;
/// An encoder that broke this short before its wheel is supposed to have stuck may never have been
/// broken, s: a stuck wheel's reads the same, and the motion tells within about this time. By the
/// pose alone 98.9 % of stuck wheels are named after 1 s, all after 2 s.
pub const EXPLAINED_S: f64 = 2.0;

/// So long after a supposed onset, ns, wheels may still read as before: 0.1 s of lag, a reading.
const ONSET_BLUR_NS: u64 = 150_000_000;

/// True while a stuck wheel's encoder may read anything, and the others may still turn as before.
pub const fn is_new(t_ns: u64, onset_ns: u64) -> bool {
    t_ns.saturating_sub(onset_ns) < ONSET_BLUR_NS
}

/// Time since an onset, s.
pub fn age_s(t_ns: u64, onset_ns: u64) -> f64 {
    t_ns.saturating_sub(onset_ns) as f64 * 1e-9
}

/// True if more than one wheel sticks or turns again; not if a single stuck wheel was another one.
pub fn changes_several(before: Mover, after: Mover) -> bool {
    let is_unknown = after.is_unknown();
    let (before, after) = (before.stuck(), after.stuck());
    let is_another = before.count_ones() == 1 && after.count_ones() == 1;
    (before ^ after).count_ones() > 1 && !is_another && !is_unknown
}

/// The wheel that sticks besides those that do.
pub fn newly_stuck(before: Mover, after: Mover) -> Option<usize> {
    let new = after.stuck() & !before.stuck();
    (new != 0).then(|| new.trailing_zeros() as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn several_wheels_change_where_more_than_one_sticks_or_turns() {
        use Mover::{Nominal, Stuck, UnknownAny};
        for (before, after, several) in [
            (Nominal, Stuck(0b1), false),
            (Nominal, Stuck(0b11), true),
            (Stuck(0b1), Stuck(0b10), false),
            (Stuck(0b1), Stuck(0b11), false),
            (Stuck(0b1), Stuck(0b110), true),
            (Stuck(0b111), Stuck(0b1), true),
            (Stuck(0b11), UnknownAny, false),
        ] {
            let found = changes_several(before, after);
            assert_eq!(found, several, "{before:?} to {after:?}");
        }
    }

    #[test]
    fn the_new_stuck_wheel_is_the_one_that_turned() {
        use Mover::{Nominal, Stuck};
        assert_eq!(newly_stuck(Nominal, Stuck(0b100)), Some(2));
        assert_eq!(newly_stuck(Stuck(0b1), Stuck(0b1001)), Some(3));
        assert_eq!(newly_stuck(Stuck(0b11), Stuck(0b1)), None);
    }

    #[test]
    fn an_onset_blurs_for_its_time() {
        assert!(is_new(1_000 + ONSET_BLUR_NS - 1, 1_000) && is_new(5, 1_000));
        assert!(!is_new(1_000 + ONSET_BLUR_NS, 1_000));
        assert_eq!((age_s(2_500_000_000, 500_000_000), age_s(1, 2)), (2.0, 0.0));
    }
}
