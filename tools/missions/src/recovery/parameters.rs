//! The parameter file of the recovery model.

use serde::{Deserialize, Serialize};
use vigil_decision::state_names::{DONE, NEW, NOMINAL, SEVERAL, SEVERAL_DRIVABLE, UNKNOWN};

/// Everything that the model is made from. Prices are in units of the
/// user's choice, the same for all.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// What the file is for: `recovery`.
    pub model: String,
    /// Discount per step, 0 to below 1.
    pub discount: f64,
    /// Length of a step: `supervisor.epoch_ms`, in s.
    pub epoch_s: f64,
    /// What the robot has to do.
    pub task: Task,
    /// Help.
    pub help: Help,
    /// What the robot can do.
    pub action: Vec<ActionParameters>,
    /// Faults of the fault tree.
    pub fault: Vec<Fault>,
    /// Two faults or more.
    pub several: Several,
    /// What nothing explains.
    pub unknown: Unknown,
    /// What a step's evidence speaks for.
    pub evidence: Evidence,
}

/// What the robot has to do.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Task {
    /// Usual speed, m/s.
    pub speed_m_s: f64,
    /// Way to the end of a task, in the mean, m.
    pub rest_m: f64,
    /// Price of a second.
    pub price_1_s: f64,
}

/// Help.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Help {
    /// Name of the action.
    pub action: String,
    /// Price of a call.
    pub price: f64,
    /// Time until help has come, s.
    pub wait_s: f64,
}

/// Something that the robot can do.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ActionParameters {
    /// Its name.
    pub name: String,
    /// Share of the usual speed, 0 to 1.
    pub speed_scale: f64,
    /// Chance that a step's evidence speaks for the truth, 0 to 1.
    pub sees: f64,
    /// The faults that it answers, by their `state`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remedies: Option<String>,
    /// Price of a metre where there is none of these.
    #[serde(default)]
    pub needless_1_m: f64,
}

/// Faults that have one state: what is done about one is done about each of them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fault {
    /// Name of the state: that of a leaf of the fault tree, of a node above leaves, or of a kind of
    /// faults in capitals, `STUCK` for `stuck:LF`. `FAULT` is every leaf that no other has.
    pub state: String,
    /// How often one of them arises, 1/h.
    pub arises_1_h: f64,
    /// How often a fault passes by itself, 1/s.
    pub passes_1_s: f64,
    /// Price of a metre at full speed; at less the less.
    pub price_1_m: f64,
    /// Price of a metre where it is answered, whatever the speed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remedied_1_m: Option<f64>,
}

/// Two faults or more.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Several {
    /// How often another fault joins one, 1/s.
    pub arises_1_s: f64,
    /// Chance, given that something is wrong at an alarm, that it is several faults, 0 to 1.
    pub at_an_alarm: f64,
    /// Price of a metre at full speed.
    pub price_1_m: f64,
    /// Those with which a robot can be driven home.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drivable: Option<Drivable>,
}

/// Two faults or more with which a robot can be driven home: the state `SEVERAL_DRIVABLE`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drivable {
    /// Their share of the faults that join one, 0 to 1.
    pub share: f64,
    /// Price of a metre where all are answered, whatever the speed.
    pub remedied_1_m: f64,
}

/// What nothing explains.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Unknown {
    /// How often it arises, 1/h.
    pub arises_1_h: f64,
    /// How often a new one passes by itself, 1/s.
    pub passes_1_s: f64,
    /// Price of a metre at full speed.
    pub price_1_m: f64,
    /// How often a new one turns out to have a name, 1/s.
    pub named_1_s: f64,
}

/// What a step's evidence speaks for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Evidence {
    /// Chance that it speaks for a wrong state, as a share of that for the true one.
    pub confused: f64,
    /// Chance that nothing is wrong where a policy is begun. A policy is solved for an alarm that
    /// has just risen: the live belief is the identifier's from the first cycle on.
    pub nominal_at_an_alarm: f64,
    /// How often evidence ends, 1/s: what is in doubt by then stays in doubt.
    pub settles_1_s: f64,
}

/// Why parameters were refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ParameterError {
    /// A number is out of range.
    #[error("{key} is {found}; allowed is {allowed}")]
    Range {
        /// Key in the file.
        key: String,
        /// The number.
        found: f64,
        /// What it may be.
        allowed: &'static str,
    },
    /// Two states have one name.
    #[error(
        "state '{0}' appears twice; ND, SEVERAL, SEVERAL_DRIVABLE, UNKNOWN, DONE and what ends in \
         _NEW have a meaning of their own"
    )]
    SameState(String),
    /// An action answers a fault that is not there.
    #[error(
        "action '{action}' remedies '{fault}'; allowed is the state of a [[fault]], and with \
         [several.drivable] SEVERAL_DRIVABLE"
    )]
    NoFault {
        /// Name of the action.
        action: String,
        /// What it remedies.
        fault: String,
    },
    /// Rates are so large that a step may leave a state more than once.
    #[error("the rates out of state {state} sum to {sum} in a step of {epoch_s} s; allowed is 1")]
    Fast {
        /// The state.
        state: String,
        /// The sum.
        sum: f64,
        /// Length of a step, s.
        epoch_s: f64,
    },
}

impl Parameters {
    /// Checks ranges and names.
    ///
    /// # Errors
    /// The first [`ParameterError`].
    pub fn check(&self) -> Result<(), ParameterError> {
        let within = |key: String, found: f64, is: bool, allowed: &'static str| match is {
            true => Ok(()),
            false => Err(ParameterError::Range {
                key,
                found,
                allowed,
            }),
        };
        let share =
            |key: String, found: f64| within(key, found, (0.0..=1.0).contains(&found), "0 to 1");
        let discount = self.discount;
        let below_one = (0.0..1.0).contains(&discount);
        within("discount".into(), discount, below_one, "0 to below 1")?;
        for (key, found) in [
            ("epoch_s", self.epoch_s),
            ("task.speed_m_s", self.task.speed_m_s),
            ("task.rest_m", self.task.rest_m),
        ] {
            let is = found.is_finite() && found > 0.0;
            within(key.into(), found, is, "any finite number above 0")?;
        }
        for (key, found) in self.amounts() {
            let is = found.is_finite() && found >= 0.0;
            within(key, found, is, "any finite number from 0")?;
        }
        share("evidence.confused".into(), self.evidence.confused)?;
        let nominal = self.evidence.nominal_at_an_alarm;
        share("evidence.nominal_at_an_alarm".into(), nominal)?;
        share("several.at_an_alarm".into(), self.several.at_an_alarm)?;
        if let Some(drivable) = self.several.drivable {
            share("several.drivable.share".into(), drivable.share)?;
        }
        let always = [NOMINAL, SEVERAL, SEVERAL_DRIVABLE, UNKNOWN, DONE];
        for (at, fault) in self.fault.iter().enumerate() {
            let before = self.fault[..at].iter().map(|other| other.state.as_str());
            let is_taken = before.chain(always).any(|name| name == fault.state);
            if is_taken || fault.state.ends_with(NEW) {
                return Err(ParameterError::SameState(fault.state.clone()));
            }
        }
        for action in &self.action {
            share(
                format!("action {}.speed_scale", action.name),
                action.speed_scale,
            )?;
            // The wrong states have a share on top of the true one's.
            let seen = action.sees * (1.0 + self.evidence.confused);
            let key = format!("action {}.sees, with what is confused", action.name);
            share(key, seen)?;
            let remedied = action.remedies.as_deref();
            let has_drivable = self.several.drivable.is_some();
            let is_there = |state: &str| {
                let of_faults = self.fault.iter().any(|fault| fault.state == state);
                of_faults || (has_drivable && state == SEVERAL_DRIVABLE)
            };
            if let Some(state) = remedied.filter(|state| !is_there(state)) {
                return Err(ParameterError::NoFault {
                    action: action.name.clone(),
                    fault: state.to_owned(),
                });
            }
        }
        Ok(())
    }

    /// Rates and prices.
    fn amounts(&self) -> Vec<(String, f64)> {
        let (several, unknown) = (self.several, self.unknown);
        let mut amounts: Vec<(String, f64)> = [
            ("task.price_1_s", self.task.price_1_s),
            ("help.price", self.help.price),
            ("help.wait_s", self.help.wait_s),
            ("several.arises_1_s", several.arises_1_s),
            ("several.price_1_m", several.price_1_m),
            ("unknown.arises_1_h", unknown.arises_1_h),
            ("unknown.passes_1_s", unknown.passes_1_s),
            ("unknown.price_1_m", unknown.price_1_m),
            ("unknown.named_1_s", unknown.named_1_s),
            ("evidence.settles_1_s", self.evidence.settles_1_s),
        ]
        .map(|(key, found)| (key.to_owned(), found))
        .to_vec();
        if let Some(drivable) = several.drivable {
            let key = "several.drivable.remedied_1_m".to_owned();
            amounts.push((key, drivable.remedied_1_m));
        }
        for fault in &self.fault {
            let key = |name: &str| format!("fault {}.{name}", fault.state);
            amounts.push((key("arises_1_h"), fault.arises_1_h));
            amounts.push((key("passes_1_s"), fault.passes_1_s));
            amounts.push((key("price_1_m"), fault.price_1_m));
            let remedied = fault.remedied_1_m.unwrap_or(fault.price_1_m);
            amounts.push((key("remedied_1_m"), remedied));
        }
        for action in &self.action {
            amounts.push((
                format!("action {}.needless_1_m", action.name),
                action.needless_1_m,
            ));
        }
        amounts
    }
}
