//! The parameter file of the navigation model.

use serde::Deserialize;

use crate::parameter_number::{NumberError, at_most_one, out_of_range};

/// Everything that the model is made from.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// What the file is for: `navigation`.
    pub model: String,
    /// Discount per decision step, 0 to below 1.
    pub discount: f64,
    /// Chance per step that the exception arises in a nominal robot.
    pub arises: PerException,
    /// Chance per step that the exception passes by itself.
    pub passes: PerException,
    /// What actions mend.
    pub remedies: Remedies,
    /// Which monitors fire.
    pub symptoms: Symptoms,
    /// What the outcomes of actions say.
    pub outcomes: Outcomes,
    /// What things are worth.
    pub rewards: Rewards,
}

/// One number for each exception; 0 where none is given.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PerException {
    /// Non-navigable path: the way is blocked.
    pub nnp: f64,
    /// Hardware problem.
    pub hp: f64,
    /// Reactive problem: local control is caught, or swings to and fro.
    pub rt: f64,
    /// Perception problem: an obstacle is seen where none is.
    pub pp: f64,
    /// Wrong direction.
    pub wd: f64,
    /// Robot lost.
    pub lst: f64,
}

/// One number for each state; 0 where none is given.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PerState {
    /// Nominal.
    pub nom: f64,
    /// Non-navigable path.
    pub nnp: f64,
    /// Hardware problem.
    pub hp: f64,
    /// Reactive problem.
    pub rt: f64,
    /// Perception problem.
    pub pp: f64,
    /// Wrong direction.
    pub wd: f64,
    /// Robot lost.
    pub lst: f64,
}

/// Chance that an action mends an exception, 0 to 1. Following the path mends nothing; giving up
/// begins the next task.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Remedies {
    /// Request a new path.
    pub np: PerException,
    /// Re-localise.
    pub rl: PerException,
    /// Go through an opening.
    pub go: PerException,
    /// Move away from the current position.
    pub ma: PerException,
    /// Send a message for assistance.
    pub sh: PerException,
}

/// Chance per step that a monitor fires, by the state; eps and epm exclude each other.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Symptoms {
    /// Error in position while stopped.
    pub eps: PerState,
    /// Error in position while moving.
    pub epm: PerState,
    /// Loop detected.
    pub ld: PerState,
    /// Spinning detected.
    pub sd: PerState,
}

/// Chance that an action reports an outcome, by the state that it leads to.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Outcomes {
    /// GO: blockage overtaken.
    pub bo: PerState,
    /// NP: alternative path found.
    pub alt: PerState,
    /// NP: no alternative that can be navigated.
    pub nna: PerState,
}

/// Rewards, in units of what a nominal robot makes in one step.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rewards {
    /// Following the path, by the state in which it is done.
    pub fp: PerState,
    /// What the other actions cost in any state.
    pub prices: Prices,
}

/// What an action costs in any state.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Prices {
    /// Request a new path.
    pub np: f64,
    /// Re-localise.
    pub rl: f64,
    /// Go through an opening.
    pub go: f64,
    /// Move away.
    pub ma: f64,
    /// Send for help.
    pub sh: f64,
    /// Give up.
    pub gu: f64,
}

impl PerException {
    /// In the order of [`super::STATES`] without the nominal one.
    #[must_use]
    pub const fn values(&self) -> [f64; 6] {
        [self.nnp, self.hp, self.rt, self.pp, self.wd, self.lst]
    }
}

impl PerState {
    /// In the order of [`super::STATES`].
    #[must_use]
    pub const fn values(&self) -> [f64; 7] {
        [
            self.nom, self.nnp, self.hp, self.rt, self.pp, self.wd, self.lst,
        ]
    }
}

impl Parameters {
    /// Checks ranges and sums.
    ///
    /// # Errors
    /// The first [`NumberError`].
    pub fn check(&self) -> Result<(), NumberError> {
        if !(0.0..1.0).contains(&self.discount) {
            let allowed = "0 to below 1";
            return Err(out_of_range("discount", self.discount, allowed));
        }
        let remedies = &self.remedies;
        let exceptions = [
            ("arises", self.arises),
            ("passes", self.passes),
            ("remedies.np", remedies.np),
            ("remedies.rl", remedies.rl),
            ("remedies.go", remedies.go),
            ("remedies.ma", remedies.ma),
            ("remedies.sh", remedies.sh),
        ];
        for (key, table) in exceptions {
            probabilities(key, &table.values())?;
        }
        let (symptoms, outcomes) = (&self.symptoms, &self.outcomes);
        let states = [
            ("symptoms.eps", symptoms.eps),
            ("symptoms.epm", symptoms.epm),
            ("symptoms.ld", symptoms.ld),
            ("symptoms.sd", symptoms.sd),
            ("outcomes.bo", outcomes.bo),
            ("outcomes.alt", outcomes.alt),
            ("outcomes.nna", outcomes.nna),
        ];
        for (key, table) in states {
            probabilities(key, &table.values())?;
        }
        at_most_one("arises", self.arises.values().iter().sum(), 0.0)?;
        for (key, one, other) in [
            ("symptoms.eps + symptoms.epm", symptoms.eps, symptoms.epm),
            ("outcomes.alt + outcomes.nna", outcomes.alt, outcomes.nna),
        ] {
            for (a, b) in one.values().iter().zip(other.values()) {
                at_most_one(key, a + b, 0.0)?;
            }
        }
        self.check_rewards()
    }

    fn check_rewards(&self) -> Result<(), NumberError> {
        let allowed = "any finite number";
        let fp = self.rewards.fp.values();
        if let Some(&found) = fp.iter().find(|r| !r.is_finite()) {
            return Err(out_of_range("rewards.fp", found, allowed));
        }
        let Prices {
            np,
            rl,
            go,
            ma,
            sh,
            gu,
        } = self.rewards.prices;
        match [np, rl, go, ma, sh, gu]
            .into_iter()
            .find(|p| !(p.is_finite() && *p >= 0.0))
        {
            Some(found) => {
                let allowed = "any finite number from 0";
                Err(out_of_range("rewards.prices", found, allowed))
            }
            None => Ok(()),
        }
    }
}

fn probabilities(key: &str, values: &[f64]) -> Result<(), NumberError> {
    match values.iter().find(|p| !(0.0..=1.0).contains(*p)) {
        Some(&found) => Err(out_of_range(key, found, "0 to 1")),
        None => Ok(()),
    }
}
