//! From parameters to a `.pomdp` text.

use vigil_decision::state_names::{DONE, NEW, NOMINAL, SEVERAL, SEVERAL_DRIVABLE, UNKNOWN};

use crate::model_text::{line, number};

use super::parameters::{ActionParameters, Drivable, Fault, ParameterError, Parameters};

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
    Unknown,
    Done,
}

/// A state.
struct State<'a> {
    name: String,
    condition: Condition<'a>,
    /// True while evidence of it comes.
    is_new: bool,
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
    let names = model.states.iter().map(|state| state.name.as_str());
    let names: Vec<&str> = names.collect();
    let seen: Vec<&str> = model.shown().map(|state| state.name.as_str()).collect();
    let actions = parameters.action.iter().map(|action| action.name.as_str());
    let actions: Vec<&str> = actions.chain([parameters.help.action.as_str()]).collect();
    let mut text = String::from(HEAD);
    line(&mut text, &format!("discount: {}", parameters.discount));
    line(&mut text, "values: reward");
    line(&mut text, &format!("states: {}", names.join(" ")));
    line(&mut text, &format!("actions: {}", actions.join(" ")));
    line(
        &mut text,
        &format!("observations: none settled {}", seen.join(" ")),
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
        "\n# What arises, joins, is named, settles, passes, ends.",
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
    line(text, &format!("T: {help} : {DONE}\n{done}"));
    Ok(())
}

fn write_observations(text: &mut String, model: &Model<'_>) {
    line(text, "\n# What the evidence of a step speaks for most.");
    let actions = model.parameters.action.iter();
    let actions = actions.map(|action| (action.name.as_str(), action.sees));
    for (action, sees) in actions.chain([(model.parameters.help.action.as_str(), 0.0)]) {
        for state in &model.states {
            let seen = row(&model.seen(sees, state));
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

/// States in the model's order: nominal first, then the new ones, and the end last.
fn states(parameters: &Parameters) -> Vec<State<'_>> {
    let state = |name: &str, condition| State {
        name: name.to_owned(),
        condition,
        is_new: false,
    };
    let faults = parameters.fault.iter();
    let faults = faults.map(|fault| state(&fault.state, Condition::Fault(fault)));
    let drivable = parameters.several.drivable.into_iter();
    let drivable = drivable.map(|of| state(SEVERAL_DRIVABLE, Condition::Drivable(of)));
    let settled: Vec<State<'_>> = std::iter::once(state(NOMINAL, Condition::Nominal))
        .chain(faults)
        .chain([state(SEVERAL, Condition::Several)])
        .chain(drivable)
        .chain([state(UNKNOWN, Condition::Unknown)])
        .collect();
    let new: Vec<State<'_>> = settled.iter().map(State::renewed).collect();
    let all = settled.into_iter().chain(new);
    all.chain([state(DONE, Condition::Done)]).collect()
}

impl State<'_> {
    /// The same, while evidence of it comes.
    fn renewed(&self) -> Self {
        Self {
            name: format!("{}{NEW}", self.name),
            condition: self.condition,
            is_new: true,
        }
    }
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

    /// How often a state arises in a healthy robot, 1/h: all that arises is new.
    fn arises_1_h(&self, state: &State<'_>) -> f64 {
        match state.condition {
            _ if !state.is_new => 0.0,
            Condition::Fault(fault) => fault.arises_1_h,
            Condition::Unknown => self.parameters.unknown.arises_1_h,
            _ => 0.0,
        }
    }

    /// An alarm that has just risen.
    fn start(&self) -> Vec<f64> {
        let faulty = 1.0 - self.parameters.evidence.nominal_at_an_alarm;
        let several = self.parameters.several;
        let sum: f64 = self.states.iter().map(|it| self.arises_1_h(it)).sum();
        let share = |state: &State<'_>| match state.condition {
            _ if !state.is_new || sum <= 0.0 => 0.0,
            Condition::Several => faulty * several.at_an_alarm * (1.0 - self.drivable()),
            Condition::Drivable(_) => faulty * several.at_an_alarm * self.drivable(),
            _ => faulty * (1.0 - several.at_an_alarm) * self.arises_1_h(state) / sum,
        };
        let mut start: Vec<f64> = self.states.iter().map(share).collect();
        let nominal_p = 1.0 - start.iter().sum::<f64>();
        let is_nominal = |it: &State<'_>| it.is_new && matches!(it.condition, Condition::Nominal);
        if let Some(nominal) = self.states.iter().position(is_nominal) {
            start[nominal] = nominal_p;
        }
        start
    }

    /// Share of several faults with which a robot can be driven home.
    fn drivable(&self) -> f64 {
        self.parameters.several.drivable.map_or(0.0, |it| it.share)
    }

    /// Distribution of the next state. While a robot stands, nothing is known to happen.
    fn next(&self, action: &ActionParameters, from: usize) -> Result<Vec<f64>, ParameterError> {
        let epoch_s = self.parameters.epoch_s;
        let before = &self.states[from];
        if matches!(before.condition, Condition::Done) || action.speed_scale == 0.0 {
            return Ok(self.only(from));
        }
        let rates_1_s = self
            .states
            .iter()
            .map(|to| self.rate_1_s(action, before, to));
        let mut next: Vec<f64> = rates_1_s.map(|rate_1_s| rate_1_s * epoch_s).collect();
        let sum: f64 = next.iter().sum();
        if sum > 1.0 {
            return Err(ParameterError::Fast {
                state: before.name.clone(),
                sum,
                epoch_s,
            });
        }
        next[from] = 1.0 - sum;
        Ok(next)
    }

    /// How often a state becomes another, 1/s. What changes is new; what is new settles.
    fn rate_1_s(&self, action: &ActionParameters, from: &State<'_>, to: &State<'_>) -> f64 {
        let Parameters {
            task,
            several,
            unknown,
            evidence,
            ..
        } = self.parameters;
        if matches!(to.condition, Condition::Done) {
            return task.speed_m_s * action.speed_scale / task.rest_m;
        }
        if !to.is_new {
            let settles = from.is_new && from.name == to.renewed().name;
            return if settles { evidence.settles_1_s } else { 0.0 };
        }
        match (from.condition, to.condition) {
            (Condition::Nominal, _) => self.arises_1_h(to) / 3600.0,
            // What is wrong and has settled stays.
            _ if !from.is_new => 0.0,
            (Condition::Fault(fault), Condition::Nominal) => fault.passes_1_s,
            (Condition::Fault(_), Condition::Several) => {
                several.arises_1_s * (1.0 - self.drivable())
            }
            (Condition::Fault(_), Condition::Drivable(_)) => several.arises_1_s * self.drivable(),
            (Condition::Unknown, Condition::Nominal) => unknown.passes_1_s,
            (Condition::Unknown, Condition::Fault(_)) => {
                unknown.named_1_s / self.parameters.fault.len() as f64
            }
            _ => 0.0,
        }
    }

    /// The states that are ever seen.
    fn shown(&self) -> impl Iterator<Item = &State<'_>> {
        let is_shown = |it: &&State<'_>| it.is_new || matches!(it.condition, Condition::Done);
        self.states.iter().filter(is_shown)
    }

    /// Distribution of the observation in a state: none, settled, then the name of every one that
    /// is ever seen. That no more evidence comes is seen, and the end is.
    fn seen(&self, sees: f64, of: &State<'_>) -> Vec<f64> {
        let (sees, confused) = match of.condition {
            Condition::Done => (1.0, 0.0),
            _ if of.is_new => (sees, self.parameters.evidence.confused),
            _ => (0.0, 0.0),
        };
        let others = (self.shown().count() as f64 - 2.0).max(1.0);
        let seen = self.shown().map(|state| match state.condition {
            _ if state.name == of.name => sees,
            Condition::Done => 0.0,
            _ => sees * confused / others,
        });
        let seen: Vec<f64> = seen.collect();
        let is_settled = !of.is_new && !matches!(of.condition, Condition::Done);
        let settled = f64::from(u8::from(is_settled));
        // A sum of 1 may round to more.
        let none = (1.0 - settled - seen.iter().sum::<f64>()).max(0.0);
        [none, settled].into_iter().chain(seen).collect()
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
            Condition::Drivable(it) if answers(SEVERAL_DRIVABLE) => (it.remedied_1_m, true),
            Condition::Several | Condition::Drivable(_) => {
                (parameters.several.price_1_m * scale, false)
            }
            Condition::Unknown => (parameters.unknown.price_1_m * scale, false),
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
