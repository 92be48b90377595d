//! What each encoder does, given how the robot moves: a small hidden Markov model per wheel.
//!
//! Given the motion, the wheels' readings do not depend on each other, so any number of broken
//! encoders costs no more than one.

use vigil_blocks::{SizeKind, WHEELS};
use vigil_checkpoint::CheckpointValue;
use vigil_robot::learned::steer_reading::ANYTHING;
use vigil_robot::learned::wheel_evidence::{BREAKAGE_SHARES, BREAKAGES};

use crate::identify::sized_ways::{BIAS, DELAY, DRIFT, GAIN, SIZED_SHARES, WAYS};

/// First state of an encoder that is off by a size. Those before it: whole, and the breakages.
pub const SIZED: usize = 1 + BREAKAGES.len();
/// State of a whole encoder whose wheel turns at a rate of its own, in the unknown.
pub const OWN_RATE: usize = SIZED + WAYS;
/// State of a whole encoder that reads exactly zero, as its wheel stands: many do, without noise.
pub const SILENT: usize = OWN_RATE + 1;
/// State of a late encoder.
pub const LATE: usize = SIZED + DELAY;
/// State of an encoder that reads exactly zero, the first of the breakages. State 0 is whole, so
/// that each state of these is one beyond its index among [`BREAKAGES`]: see [`breakage`].
pub const ZERO: usize = 1;
/// State of an encoder that repeats itself exactly, the second of the breakages.
pub const FROZEN: usize = 2;
/// State of an encoder that reads noise, the third of the breakages.
const NOISE: usize = 3;
/// State of a dead encoder, the last of the breakages.
pub const DEAD: usize = BREAKAGES.len();

/// Index of a broken state among the ways to break, which do not count a whole encoder.
#[must_use]
pub const fn breakage(state: usize) -> usize {
    state - 1
}

/// Share of whole encoders that read exactly zero on a standing wheel: most read noise there too.
/// Chosen: a silent stuck wheel waits 2.3 nats longer, a noisy one gains 0.1.
const SILENT_SHARE: f64 = 0.1;
/// Share of wheels at a rate of their own among those that do anything, in the unknown. Chosen: in
/// the unknown rather the wheel's doing than its encoder's, by 0.8 nats.
const ANYTHING_OWN_RATE: f64 = 0.7;

/// An observation speaks against a state of one encoder by this much at most (natural logarithm):
/// the product over all wheels stays a number. Eight wheels: e^-640, where a double ends at e^-708.
const AGAINST_MAX: f64 = -80.0;

/// States of an encoder: whole, broken in one way, whole on a wheel with a rate of its own, whole
/// and silent on a standing wheel.
pub const STATES: usize = SILENT + 1;

/// Names of the ways to break, in the order of the states, and which of [`super::sizes`] has one.
pub const WAYS_TO_BREAK: [(SizeKind, Option<usize>); BREAKAGES.len() + WAYS] = [
    (SizeKind::Zero, None),
    (SizeKind::Frozen, None),
    (SizeKind::Noise, None),
    (SizeKind::Dead, None),
    (SizeKind::Gain, Some(GAIN)),
    (SizeKind::BiasRadS, Some(BIAS)),
    (SizeKind::DriftRadS2, Some(DRIFT)),
    (SizeKind::DelayS, Some(DELAY)),
];

/// Prior rates of the ways to break, over that of an encoder which loses its wheel's rate, in the
/// order of the states. Those of a size come on top: an encoder dies no less often for them.
pub const SHARES: [f64; BREAKAGES.len() + WAYS] = {
    let (mut shares, mut i) = ([0.0; BREAKAGES.len() + WAYS], 0);
    while i < BREAKAGES.len() + WAYS {
        shares[i] = match i < BREAKAGES.len() {
            true => BREAKAGE_SHARES[i],
            false => SIZED_SHARES[i - BREAKAGES.len()],
        };
        i += 1;
    }
    shares
};

/// Probability with which an encoder breaks in one observation, over [`SHARES`], at most: then it
/// breaks for certain. Reached only where a robot's description has faults every second.
pub const BIRTH_MAX: f64 = {
    let (mut sum, mut i) = (0.0, 0);
    while i < SHARES.len() {
        sum += SHARES[i];
        i += 1;
    }
    1.0 / sum
};

/// Log-likelihoods of one observation's readings in each state, prepared for many hypotheses.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct Likelihoods {
    logs: [[f64; STATES]; WHEELS],
    /// Relative to the largest of a wheel, which is 1.
    relative: [[f64; STATES]; WHEELS],
    log_largest: [f64; WHEELS],
    wheels: usize,
    /// Wheels, as bits, whose late encoder reads what a whole one does, whatever that is.
    timely: u32,
}

impl Likelihoods {
    /// Of the first `wheels` wheels: `log_likelihood(wheel, state)`.
    pub fn new(wheels: usize, log_likelihood: impl Fn(usize, usize) -> f64) -> Self {
        let mut out = Self {
            logs: [[0.0; STATES]; WHEELS],
            relative: [[1.0; STATES]; WHEELS],
            log_largest: [0.0; WHEELS],
            wheels: wheels.min(WHEELS),
            timely: 0,
        };
        for wheel in 0..out.wheels {
            out.logs[wheel] = std::array::from_fn(|state| log_likelihood(wheel, state));
            out.scale(wheel);
        }
        out
    }

    /// The late encoders of these wheels (bits) read what whole ones do.
    #[must_use]
    pub const fn timely(self, wheels: u32) -> Self {
        Self {
            timely: wheels,
            ..self
        }
    }

    /// Takes what another one says of a wheel.
    pub fn replace(&mut self, wheel: usize, other: &Self) {
        self.logs[wheel] = other.logs[wheel];
        self.relative[wheel] = other.relative[wheel];
        self.log_largest[wheel] = other.log_largest[wheel];
    }

    /// Another log-likelihood of a whole encoder.
    pub fn replace_whole(&mut self, wheel: usize, log_likelihood: f64) {
        self.logs[wheel][0] = log_likelihood;
        self.scale(wheel);
    }

    fn scale(&mut self, wheel: usize) {
        let logs = self.logs[wheel];
        let largest = logs.into_iter().fold(f64::NEG_INFINITY, f64::max);
        // Else the readings say nothing more: what was said before stays, at first nothing at all.
        if largest.is_finite() {
            self.relative[wheel] = logs.map(|log| (log - largest).max(AGAINST_MAX).exp());
            self.log_largest[wheel] = largest;
        }
    }
}

/// Probabilities of the encoders' states.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct Encoders {
    p: [[f64; STATES]; WHEELS],
    onset: [u64; WHEELS],
}

impl Encoders {
    /// All encoders are healthy at `t_ns`.
    #[must_use]
    pub fn healthy(t_ns: u64) -> Self {
        let mut whole = [0.0; STATES];
        whole[0] = 1.0;
        Self {
            p: [whole; WHEELS],
            onset: [t_ns; WHEELS],
        }
    }

    /// Each encoder may be broken from `t_ns` on, or its wheel may do what a broken encoder would
    /// tell: in the unknown these are the same.
    #[must_use]
    pub fn unsure(t_ns: u64) -> Self {
        let mut p = [0.0; STATES];
        p[0] = 1.0 - ANYTHING;
        for (p, share) in p[1..OWN_RATE].iter_mut().zip(SHARES) {
            *p = ANYTHING * (1.0 - ANYTHING_OWN_RATE) * share / SHARES.iter().sum::<f64>();
        }
        p[OWN_RATE] = ANYTHING * ANYTHING_OWN_RATE;
        Self {
            p: [p; WHEELS],
            onset: [t_ns; WHEELS],
        }
    }

    /// Takes one encoder to be whole at `t_ns`, whatever it seemed: what it reads has found another
    /// explanation, that its wheel stands.
    pub fn suppose_whole(&mut self, wheel: usize, t_ns: u64) {
        self.p[wheel] = [0.0; STATES];
        self.p[wheel][0] = 1.0;
        self.onset[wheel] = t_ns;
    }

    /// Another wheel begins to drag, and changes the rate of this one: that its encoder was off by
    /// a size, if it was not believed, is not taken up to explain that.
    pub fn forget_doubted_size(&mut self, wheel: usize) {
        let p = &mut self.p[wheel];
        let sized: f64 = p[SIZED..OWN_RATE].iter().sum();
        if sized < 0.5 {
            p[0] += sized;
            p[SIZED..OWN_RATE].fill(0.0);
        }
    }

    /// The wheel sticks: a whole encoder reads zero from now on, with noise or exactly.
    pub fn stick(&mut self, wheel: usize) {
        let p = &mut self.p[wheel];
        let whole = p[0] + p[SILENT];
        (p[0], p[SILENT]) = ((1.0 - SILENT_SHARE) * whole, SILENT_SHARE * whole);
    }

    /// The wheel turns again.
    pub fn release(&mut self, wheel: usize) {
        let p = &mut self.p[wheel];
        (p[0], p[SILENT]) = (p[0] + p[SILENT], 0.0);
    }

    /// One observation: encoder w breaks with the probability `births[w]`, recovers with `death`;
    /// the wheels `stuck` (bits) stand. What an encoder on a standing wheel reads when it breaks to
    /// zero or freezes is what it read before: nobody could see it, so neither happens there, and
    /// no prior moves the odds of what the readings cannot tell. Nor does an encoder become late or
    /// timely while nothing shows it. While a wheel drags, the others' rates are known too poorly
    /// for an encoder to begin to be off by a size. Returns the log-evidence of all readings.
    pub fn step(
        &mut self,
        births: &[f64; WHEELS],
        death: f64,
        stuck: u32,
        likelihoods: &Likelihoods,
        t_ns: u64,
    ) -> f64 {
        let (mut evidence, mut product) = (0.0, 1.0);
        let wheels = births.iter().enumerate().take(likelihoods.wheels);
        for (wheel, &birth) in wheels {
            let p = &mut self.p[wheel];
            let is_timely = likelihoods.timely >> wheel & 1 == 1;
            if stuck >> wheel & 1 == 0 {
                // The onset is that of the mass that came last in quantity.
                if p[0] * birth > p[1..OWN_RATE].iter().sum() {
                    self.onset[wheel] = t_ns;
                }
                exchange(p, birth, death, stuck != 0, is_timely);
            } else {
                let birth = birth * SHARES[breakage(NOISE)];
                let (noisy, silent, noise) = (p[0], p[SILENT], p[NOISE]);
                let back = noise * death;
                p[0] = noisy * (1.0 - birth) + back * (1.0 - SILENT_SHARE);
                p[SILENT] = silent * (1.0 - birth) + back * SILENT_SHARE;
                p[NOISE] = noise - back + (noisy + silent) * birth;
            }
            let relative = &likelihoods.relative[wheel];
            let mut joint: [f64; STATES] = std::array::from_fn(|state| p[state] * relative[state]);
            if is_timely {
                joint[LATE] = p[LATE] * relative[0];
            }
            let total: f64 = joint.iter().sum();
            evidence += likelihoods.log_largest[wheel];
            product *= total;
            if total > 0.0 {
                *p = joint.map(|joint| joint / total);
            }
        }
        // No factor is too small for their product to need more than one logarithm.
        evidence + product.ln()
    }

    /// Probabilities of all states of this wheel's encoder.
    #[must_use]
    pub const fn states(&self, wheel: usize) -> &[f64; STATES] {
        &self.p[wheel]
    }

    /// Probability that this wheel's encoder is broken.
    #[must_use]
    pub fn p_broken(&self, wheel: usize) -> f64 {
        self.p[wheel][1..OWN_RATE].iter().sum::<f64>().min(1.0)
    }

    /// Probability, at most, that any encoder is broken.
    #[must_use]
    pub fn p_any_broken(&self) -> f64 {
        let all: f64 = (0..WHEELS).map(|wheel| self.p_broken(wheel)).sum();
        all.min(1.0)
    }

    /// Of each wheel: probability, at most, that the encoder of another one is broken.
    #[must_use]
    pub fn p_other_broken(&self) -> [f64; WHEELS] {
        let p: [f64; WHEELS] = std::array::from_fn(|wheel| self.p_broken(wheel));
        let all: f64 = p.iter().sum();
        p.map(|own| (all - own).clamp(0.0, 1.0))
    }

    /// Probability that this wheel's encoder is dead: that it reads what a standing wheel's does.
    #[must_use]
    pub const fn p_dead(&self, wheel: usize) -> f64 {
        self.p[wheel][DEAD]
    }

    /// Probability that this wheel's encoder is whole and its wheel turns.
    #[must_use]
    pub const fn p_whole(&self, wheel: usize) -> f64 {
        self.p[wheel][0]
    }

    /// Probability that this wheel's encoder is off by a size in this way.
    #[must_use]
    pub const fn p_sized(&self, wheel: usize, way: usize) -> f64 {
        self.p[wheel][SIZED + way]
    }

    /// Probabilities of the ways in which this wheel's encoder is broken, in the order of the
    /// states.
    #[must_use]
    pub fn ways(&self, wheel: usize) -> &[f64] {
        &self.p[wheel][1..OWN_RATE]
    }

    /// Onset of this wheel's broken encoder, if it is broken.
    #[must_use]
    pub const fn onset(&self, wheel: usize) -> u64 {
        self.onset[wheel]
    }

    /// The same encoders, but that of a wheel is in these states.
    #[cfg(test)]
    pub fn with_states(mut self, wheel: usize, states: &[(usize, f64)]) -> Self {
        self.p[wheel] = [0.0; STATES];
        for &(state, p) in states {
            self.p[wheel][state] = p;
        }
        self
    }
}

/// The encoder of a wheel that turns breaks and recovers; not so that its size would show only
/// poorly, as others drag, nor so that nothing shows, as it `is_timely` either way.
fn exchange(p: &mut [f64; STATES], birth: f64, death: f64, others_drag: bool, is_timely: bool) {
    let whole = p[0];
    for (i, share) in SHARES.into_iter().enumerate() {
        let state = 1 + i;
        if state == LATE && is_timely {
            continue;
        }
        let born = match state >= SIZED && others_drag {
            true => 0.0,
            false => whole * birth * share,
        };
        let mended = p[state] * death;
        p[state] += born - mended;
        p[0] += mended - born;
    }
}

#[cfg(test)]
mod tests;
