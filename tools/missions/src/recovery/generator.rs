//! From parameters to a `.pomdp` text.

use crate::model_text::{line, number};

use super::parameters::{ActionParameters, DRIVABLE, Drivable, Fault, ParameterError, Parameters};

const HEAD: &str = "\
# What to do about a fault. Generated: change the parameters, not this file.
#
# A step is one epoch of the supervisor. Rewards are what a robot pays beyond its way. The start is
# an alarm that has just risen: a policy is solved for it; a run of the supervisor begins nominal.
";

/// What a state of the model is.
#[derive(Clone, Copy)]
enum Condition<'a> {
    Nominal,
    Fault(&'a Fault),
    Several,
    Drivable(Drivable),
    Unknown { is_old: bool },
    Done,
}

/// A state.
struct State<'a> {
    name: &'a str,
    condition: Condition<'a>,
}

/// Writes the model, in Cassandra's format.
///
/// # Errors
/// [`ParameterError`] if a parameter means nothing.
pub fn generate(parameters: &Parameters) -> Result<String, ParameterError> {
    parameters.check()?;
    let model = Model {
        parameters,
        states: states(parameters),
    };
    let names: Vec<&str> = model.states.iter().map(|state| state.name).collect();
    let actions = parameters.action.iter().map(|action| action.name.as_str());
    let actions: Vec<&str> = actions.chain([parameters.help.action.as_str()]).collect();
    let mut text = String::from(HEAD);
    line(&mut text, &format!("discount: {}", parameters.discount));
    line(&mut text, "values: reward");
    line(&mut text, &format!("states: {}", names.join(" ")));
    line(&mut text, &format!("actions: {}", actions.join(" ")));
    line(
        &mut text,
        &format!("observations: none {}", names.join(" ")),
    );
    line(&mut text, &format!("start: {}", row(&model.start())));
    write_transitions(&mut text, &model)?;
    write_observations(&mut text, &model);
    write_rewards(&mut text, &model);
    Ok(text)
}

fn write_transitions(text: &mut String, model: &Model<'_>) -> Result<(), ParameterError> {
    line(
        text,
        "\n# What arises, joins, is named, grows old, passes, ends.",
    );
    for action in &model.parameters.action {
        for (from, state) in model.states.iter().enumerate() {
            let next = row(&model.next(action, from)?);
            line(
                text,
                &format!("T: {} : {}\n{next}", action.name, state.name),
            );
        }
    }
    let help = &model.parameters.help.action;
    let [nominal, done] = [0, model.states.len() - 1].map(|state| row(&model.only(state)));
    line(text, &format!("T: {help} : *\n{nominal}"));
    line(text, &format!("T: {help} : DONE\n{done}"));
    Ok(())
}

fn write_observations(text: &mut String, model: &Model<'_>) {
    line(text, "\n# What the evidence of a step speaks for most.");
    let actions = model.parameters.action.iter();
    let actions = actions.map(|action| (action.name.as_str(), action.sees));
    for (action, sees) in actions.chain([(model.parameters.help.action.as_str(), 0.0)]) {
        for (to, state) in model.states.iter().enumerate() {
            let seen = row(&model.seen(sees, to));
            line(text, &format!("O: {action} : {}\n{seen}", state.name));
        }
    }
}

fn write_rewards(text: &mut String, model: &Model<'_>) {
    line(text, "\n# What a step costs.");
    let Parameters {
        action, help, task, ..
    } = model.parameters;
    let helped = help.price + task.price_1_s * help.wait_s;
    let lasts = |state: &&State<'_>| !matches!(state.condition, Condition::Done);
    for state in model.states.iter().filter(lasts) {
        let driven = action.iter().map(|action| {
            let price = model.price(action, state.condition);
            (action.name.as_str(), price)
        });
        for (action, price) in driven.chain([(help.action.as_str(), helped)]) {
            let price = number(-price);
            line(
                text,
                &format!("R: {action} : {} : * : * {price}", state.name),
            );
        }
    }
}

/// States in the model's order: nominal first, the end last.
fn states(parameters: &Parameters) -> Vec<State<'_>> {
    let state = |name, condition| State { name, condition };
    let faults = parameters.fault.iter();
    let faults = faults.map(|fault| state(fault.state.as_str(), Condition::Fault(fault)));
    let drivable = parameters.several.drivable.into_iter();
    let drivable = drivable.map(|of| state(DRIVABLE, Condition::Drivable(of)));
    std::iter::once(state("ND", Condition::Nominal))
        .chain(faults)
        .chain([state("SEVERAL", Condition::Several)])
        .chain(drivable)
        .chain([
            state("UNKNOWN", Condition::Unknown { is_old: false }),
            state("UNKNOWN_OLD", Condition::Unknown { is_old: true }),
            state("DONE", Condition::Done),
        ])
        .collect()
}

struct Model<'a> {
    parameters: &'a Parameters,
    states: Vec<State<'a>>,
}

impl Model<'_> {
    /// A distribution of one state.
    fn only(&self, state: usize) -> Vec<f64> {
        (0..self.states.len())
            .map(|other| f64::from(u8::from(other == state)))
            .collect()
    }

    /// How often each state arises in a healthy robot, 1/h.
    fn arises_1_h(&self) -> impl Iterator<Item = f64> {
        self.states.iter().map(|state| match state.condition {
            Condition::Fault(fault) => fault.arises_1_h,
            Condition::Unknown { is_old: false } => self.parameters.unknown.arises_1_h,
            _ => 0.0,
        })
    }

    /// An alarm that has just risen.
    fn start(&self) -> Vec<f64> {
        let nominal = self.parameters.evidence.nominal_at_an_alarm;
        let sum: f64 = self.arises_1_h().sum();
        let share = |arises_1_h: f64| match sum > 0.0 {
            true => (1.0 - nominal) * arises_1_h / sum,
            false => 0.0,
        };
        let mut start: Vec<f64> = self.arises_1_h().map(share).collect();
        start[0] = 1.0 - start.iter().sum::<f64>();
        start
    }

    /// Distribution of the next state. While a robot stands, nothing is known to happen.
    fn next(&self, action: &ActionParameters, from: usize) -> Result<Vec<f64>, ParameterError> {
        let epoch_s = self.parameters.epoch_s;
        let condition = self.states[from].condition;
        if matches!(condition, Condition::Done) || action.speed_scale == 0.0 {
            return Ok(self.only(from));
        }
        let rates_1_s = self.states.iter().zip(self.arises_1_h());
        let rates_1_s = rates_1_s.map(|(to, arises_1_h)| match condition {
            Condition::Nominal if !matches!(to.condition, Condition::Done) => arises_1_h / 3600.0,
            _ => self.rate_1_s(action, condition, to.condition),
        });
        let mut next: Vec<f64> = rates_1_s.map(|rate_1_s| rate_1_s * epoch_s).collect();
        next[from] = 0.0;
        let sum: f64 = next.iter().sum();
        if sum > 1.0 {
            return Err(ParameterError::Fast {
                state: self.states[from].name.to_owned(),
                sum,
                epoch_s,
            });
        }
        next[from] = 1.0 - sum;
        Ok(next)
    }

    /// How often a state that is not nominal becomes another, and any the end, 1/s.
    fn rate_1_s(&self, action: &ActionParameters, from: Condition<'_>, to: Condition<'_>) -> f64 {
        let Parameters {
            task,
            several,
            unknown,
            ..
        } = self.parameters;
        let is_named = |state: &&State<'_>| matches!(state.condition, Condition::Fault(_));
        match (from, to) {
            (_, Condition::Done) => task.speed_m_s * action.speed_scale / task.rest_m,
            (Condition::Fault(fault), Condition::Nominal) => fault.passes_1_s,
            (Condition::Fault(_), Condition::Several) => {
                let drivable = several.drivable.map_or(0.0, |it| it.share);
                several.arises_1_s * (1.0 - drivable)
            }
            (Condition::Fault(_), Condition::Drivable(it)) => several.arises_1_s * it.share,
            (Condition::Unknown { is_old: false }, Condition::Nominal) => unknown.passes_1_s,
            (Condition::Unknown { is_old: false }, Condition::Fault(_)) => {
                unknown.named_1_s / self.states.iter().filter(is_named).count() as f64
            }
            (Condition::Unknown { is_old: false }, Condition::Unknown { is_old: true }) => {
                unknown.ages_1_s
            }
            _ => 0.0,
        }
    }

    /// Distribution of the observation in a state: none, then every state's name. Nobody sees how
    /// old what is unknown is; the end is always seen.
    fn seen(&self, sees: f64, to: usize) -> Vec<f64> {
        let done = self.states.len() - 1;
        let mut seen = vec![0.0; self.states.len() + 1];
        if to == done {
            seen[done + 1] = 1.0;
            return seen;
        }
        let new = |state: &State<'_>| {
            !matches!(
                state.condition,
                Condition::Unknown { is_old: true } | Condition::Done
            )
        };
        let is_unknown = |at: usize| matches!(self.states[at].condition, Condition::Unknown { .. });
        let spoken: Vec<usize> = (0..done).filter(|at| new(&self.states[*at])).collect();
        let wrong = sees * self.parameters.evidence.confused / (spoken.len() as f64 - 1.0).max(1.0);
        for at in spoken {
            let is_true = at == to || (is_unknown(at) && is_unknown(to));
            seen[at + 1] = if is_true { sees } else { wrong };
        }
        seen[0] = 1.0 - seen.iter().sum::<f64>();
        seen
    }

    /// Price of a step.
    fn price(&self, action: &ActionParameters, condition: Condition<'_>) -> f64 {
        let parameters = self.parameters;
        let scale = action.speed_scale;
        let answers = |state: &str| action.remedies.as_deref() == Some(state);
        let (price_1_m, is_answered) = match condition {
            Condition::Nominal | Condition::Done => (0.0, false),
            Condition::Fault(fault) => match fault.remedied_1_m {
                Some(remedied_1_m) if answers(&fault.state) => (remedied_1_m, true),
                _ => (fault.price_1_m * scale, false),
            },
            Condition::Drivable(it) if answers(DRIVABLE) => (it.remedied_1_m, true),
            Condition::Several | Condition::Drivable(_) => {
                (parameters.several.price_1_m * scale, false)
            }
            Condition::Unknown { .. } => (parameters.unknown.price_1_m * scale, false),
        };
        let needless_1_m = if is_answered {
            0.0
        } else {
            action.needless_1_m
        };
        let way_m = parameters.task.speed_m_s * scale * parameters.epoch_s;
        (price_1_m + needless_1_m) * way_m + parameters.task.price_1_s * parameters.epoch_s
    }
}

fn row(numbers: &[f64]) -> String {
    let numbers: Vec<String> = numbers.iter().map(|value| number(*value)).collect();
    numbers.join(" ")
}
