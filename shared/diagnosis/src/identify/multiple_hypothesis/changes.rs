//! How the filter's hypotheses change: a fault more, one less, or another one.

use nalgebra::Vector3;
use vigil_blocks::WHEELS;
use vigil_inference::bank::Hypothesis;
use vigil_inference::track::Displacement;
use vigil_robot::learned::wheels::steering_angle;
use vigil_robot::learned::{Mover, Observation, WheelEvidence};

use super::{FLOOR, MultipleHypothesis};
use crate::identify::angles::Angles;
use crate::identify::encoders::Encoders;
use crate::identify::hypothesis_state::HypothesisState;
use crate::identify::rate_offsets::RateOffsets;
use crate::identify::servo_fault::ServoFault;
use crate::identify::wheel_update::{
    EXPLAINED_S, WheelUpdate, age_s, changes_several, newly_stuck,
};

/// A wheel that sticks so soon after another, s, has the same cause. Chosen by hand: the time in
/// which a rock or a rut reaches the next wheel at the rover's speed.
const SOON_S: f64 = 1.0;
/// Then it is this many times as likely as one that sticks by itself. Chosen by hand, not measured:
/// three nats; smaller names a second stuck wheel later, larger takes a dead encoder for one.
const SOON: f64 = 20.0;

impl MultipleHypothesis {
    /// New hypotheses: a fault more, one less, or another one, or several wheels at once where
    /// these read so; from the most probable hypothesis of each kind.
    pub(super) fn spawn(&mut self, observation: &Observation, evidence: Option<&WheelEvidence>) {
        let modes = &self.modes;
        let best = |wanted: &dyn Fn(Mover) -> bool| {
            self.bank.best(|mode| wanted(modes[mode].moved)).copied()
        };
        const NEXT: usize = WHEELS + 1;
        let sources: [_; WHEELS + 3] = std::array::from_fn(|count| match count {
            0 => best(&|moved| moved == Mover::Nominal),
            1..=WHEELS => best(&|moved| moved.stuck().count_ones() as usize == count),
            NEXT => best(&|moved| matches!(moved, Mover::Steer(_) | Mover::Pose)),
            _ => best(&Mover::is_unknown),
        });
        for from in sources.into_iter().flatten() {
            let before = self.modes[from.mode].moved;
            let read = evidence.map_or([before.stuck(); 3], |evidence| {
                let update = WheelUpdate {
                    model: &self.model,
                    robot: &self.robot,
                    observation,
                    evidence,
                };
                update.changed_sets(before.stuck(), &from.state.encoders)
            });
            for mode in 0..self.modes.len() {
                let after = self.modes[mode].moved;
                if changes_several(before, after) && !read.contains(&after.stuck()) {
                    continue;
                }
                let log_weight = from.log_weight + self.p_change(&from, mode, observation).ln();
                if log_weight <= FLOOR || log_weight.is_nan() {
                    continue;
                }
                self.bank.add(Hypothesis {
                    mode,
                    onset: observation.t_first_ns,
                    log_weight,
                    state: self.changed(&from, mode, observation),
                });
            }
        }
    }

    /// Probability that one observation changes `from` to another mode. An encoder that died in the
    /// last observation may as well be another wheel that stuck then: both are about equally
    /// likely before the motion tells.
    pub(super) fn p_change(
        &self,
        from: &Hypothesis<HypothesisState>,
        mode: usize,
        observation: &Observation,
    ) -> f64 {
        let (before, after) = (self.modes[from.mode].moved, self.modes[mode].moved);
        let p_other = from.state.encoders.p_any_broken();
        let mut p = self.rates.rate_1_s(before, after, p_other) * observation.dt_s;
        let joins = before.stuck() & after.stuck() != 0 && p > 0.0;
        if let Some(wheel) = newly_stuck(before, after).filter(|_| joins) {
            let t_ns = observation.t_first_ns;
            if age_s(t_ns, from.onset) < SOON_S {
                p *= SOON;
            }
            let encoders = &from.state.encoders;
            let age_s = age_s(t_ns, encoders.onset(wheel));
            // In the last observation, whose length may differ from this one's by up to a half.
            let was_last = age_s > 0.0 && age_s < 1.5 * observation.dt_s;
            // The term is one encoder's: it makes no change of several wheels likelier.
            if was_last && !changes_several(before, after) {
                p += encoders.p_dead(wheel);
            }
        }
        p * self.modes[mode].share
    }

    /// What becomes of a hypothesis when its mode changes.
    pub(super) fn changed(
        &self,
        from: &Hypothesis<HypothesisState>,
        mode: usize,
        observation: &Observation,
    ) -> HypothesisState {
        let (before, after) = (self.modes[from.mode].moved, self.modes[mode].moved);
        let (curvature, speed) = (observation.curvature, observation.speed);
        let noise = self.modes[mode].noise_at(&self.model, curvature, speed);
        let context = match before {
            Mover::Nominal => from.state.track.context(),
            _ => self.context,
        };
        let mut track = from.state.track.enter(&context, &noise);
        if before.is_immobile() && after.is_immobile() {
            // Another wheel changes nothing of a motion that is none.
            track = from.state.track;
        } else if before.stuck().count_ones().max(after.stuck().count_ones()) > 1 {
            track.predict(&self.lagged(from, mode, observation), &noise);
        }
        let fresh = match before.stuck() {
            0 => u32::MAX,
            stuck => stuck ^ after.stuck(),
        };
        track.diffuse(self.modes[mode].jump);
        let t_ns = observation.t_first_ns;
        let mut encoders = match (before, after) {
            (_, Mover::UnknownAny) => Encoders::unsure(t_ns),
            (Mover::UnknownAny, _) => Encoders::healthy(t_ns),
            _ => from.state.encoders,
        };
        for wheel in 0..WHEELS {
            if before.stuck() == 0 && after.stuck() != 0 {
                encoders.forget_doubted_size(wheel);
            }
            match (before.is_stuck(wheel), after.is_stuck(wheel)) {
                (false, true) => {
                    if age_s(t_ns, encoders.onset(wheel)) < EXPLAINED_S {
                        encoders.suppose_whole(wheel, t_ns);
                    }
                    encoders.stick(wheel);
                }
                (true, false) => encoders.release(wheel),
                _ => {}
            }
        }
        HypothesisState {
            track,
            encoders,
            offsets: RateOffsets::default(),
            angles: Angles::default(),
            servo: match after {
                Mover::Steer(wheel) => {
                    let angle = steering_angle(&self.robot, wheel, observation.command[0]);
                    Some(ServoFault::new(&self.servo, angle))
                }
                _ => None,
            },
            jump_m: None,
            log_material: 0.0,
            was_thrown: false,
            fresh,
        }
    }

    /// By how much more the robot moves at a change of its mode than it would if the new mode's
    /// motion began at once: the body follows within the lag, as if the old one lasted so long.
    fn lagged(
        &self,
        from: &Hypothesis<HypothesisState>,
        to: usize,
        at: &Observation,
    ) -> Displacement {
        let limit = self.model.command.curvature_max_1_m;
        let motion = |mode: usize| {
            let motion = &self.modes[mode].motion;
            Vector3::from(motion.per_metre(at.curvature, at.speed, limit))
        };
        let excess = motion(from.mode) + from.state.track.deviation() - motion(to);
        let travel_m = at.speed * self.model.command.lag_s;
        Displacement {
            per_metre: excess.into(),
            travel_m,
            extra: (excess * travel_m).map(|excess| excess * excess).into(),
        }
    }
}
