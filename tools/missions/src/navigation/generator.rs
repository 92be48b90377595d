//! From parameters to the text of a `.pomdp` file.

use super::{ACTIONS, NumberError, Parameters, STATES};
use crate::model_text::{line, number};

const HEAD: &str = "\
# What a robot does about exceptions of its navigation: the model of Verma, Fernandez and Simmons
# (2002), section 3. States, actions and basic observations are the paper's, with a nominal state
# added; the paper publishes no numbers. These are ours: navigation.toml, with a reason for each.
# Written by `vigil pomdp generate`; change the parameters, not this file.
#
# NOM nominal, NNP non-navigable path, HP hardware problem, RT reactive problem, PP perception
# problem, WD wrong direction, LST robot lost.
# FP follow the planned path, NP request a new path, RL re-localise, GO go through an opening, MA
# move away, SH send for help, GU give up this task (the next one begins).
# EPS error in position (stopped), EPM the same (moving), LD loop, SD spinning, BO blockage
# overtaken, ALT alternative path, NNA no alternative that can be navigated.
";

/// Writes the model, in Cassandra's format.
///
/// # Errors
/// [`NumberError`] if a parameter means nothing.
pub fn generate(parameters: &Parameters) -> Result<String, NumberError> {
    parameters.check()?;
    let mut text = String::from(HEAD);
    let names: Vec<String> = observations().map(|o| o.name()).collect();
    line(&mut text, &format!("discount: {}", parameters.discount));
    line(&mut text, "values: reward");
    line(&mut text, &format!("states: {}", STATES.join(" ")));
    line(&mut text, &format!("actions: {}", ACTIONS.join(" ")));
    line(&mut text, "observations:");
    for chunk in names.chunks(8) {
        line(&mut text, &format!("  {}", chunk.join(" ")));
    }
    // A task begins as any step does: nominal, but for what may just have arisen.
    let arises = parameters.arises.values();
    let nominal = 1.0 - arises.iter().sum::<f64>();
    let start: Vec<String> = std::iter::once(nominal).chain(arises).map(number).collect();
    line(&mut text, &format!("start: {}", start.join(" ")));
    transitions(&mut text, parameters, &start);
    observe_rows(&mut text, parameters);
    rewards(&mut text, parameters);
    Ok(text)
}

/// What mends or passes leads to NOM; nothing else changes between exceptions.
fn transitions(text: &mut String, parameters: &Parameters, nominal_row: &[String]) {
    line(
        text,
        "\n# What arises, what passes by itself, what an action mends.",
    );
    line(text, "T: * identity");
    line(text, &format!("T: * : NOM\n{}", nominal_row.join(" ")));
    let remedies = &parameters.remedies;
    let none = super::PerException::default();
    let table = [
        ("FP", none),
        ("NP", remedies.np),
        ("RL", remedies.rl),
        ("GO", remedies.go),
        ("MA", remedies.ma),
        ("SH", remedies.sh),
    ];
    for (action, remedy) in table {
        let passes = parameters.passes.values();
        for ((state, mends), passes) in STATES[1..].iter().zip(remedy.values()).zip(passes) {
            let back = 1.0 - (1.0 - mends) * (1.0 - passes);
            if back > 0.0 {
                let (back, stays) = (number(back), number(1.0 - back));
                line(text, &format!("T: {action} : {state} : NOM {back}"));
                line(text, &format!("T: {action} : {state} : {state} {stays}"));
            }
        }
    }
    line(text, "T: GU : * reset");
}

/// Which error in position an observation holds.
const POSITIONS: [&str; 3] = ["", "EPS", "EPM"];
/// Which outcome an observation holds.
const OUTCOMES: [&str; 4] = ["", "BO", "ALT", "NNA"];

/// An observation: a set of basic ones.
#[derive(Debug, Clone, Copy)]
struct Observation {
    position: usize,
    is_loop: bool,
    is_spin: bool,
    outcome: usize,
}

impl Observation {
    fn name(self) -> String {
        let parts = [
            POSITIONS[self.position],
            if self.is_loop { "LD" } else { "" },
            if self.is_spin { "SD" } else { "" },
            OUTCOMES[self.outcome],
        ];
        let present: Vec<&str> = parts.into_iter().filter(|part| !part.is_empty()).collect();
        if present.is_empty() {
            "none".to_owned()
        } else {
            present.join("_")
        }
    }

    /// p(z|a,s'): `outcomes` are the chances of OUTCOMES after the action.
    fn probability(self, parameters: &Parameters, state: usize, outcomes: [f64; 4]) -> f64 {
        let symptoms = &parameters.symptoms;
        let of = |table: &super::PerState| table.values()[state];
        let (eps, epm) = (of(&symptoms.eps), of(&symptoms.epm));
        let position = [1.0 - eps - epm, eps, epm][self.position];
        let flag = |is_on: bool, p: f64| if is_on { p } else { 1.0 - p };
        position
            * flag(self.is_loop, of(&symptoms.ld))
            * flag(self.is_spin, of(&symptoms.sd))
            * outcomes[self.outcome]
    }
}

fn observations() -> impl Iterator<Item = Observation> {
    (0..OUTCOMES.len() * POSITIONS.len() * 4).map(|i| Observation {
        position: i / 4 % POSITIONS.len(),
        is_loop: i / 2 % 2 == 1,
        is_spin: i % 2 == 1,
        outcome: i / (4 * POSITIONS.len()),
    })
}

/// p(z|a,s') as the product over the basic observations; rules for any action first, then GO and
/// NP, which report outcomes.
fn observe_rows(text: &mut String, parameters: &Parameters) {
    line(
        text,
        "\n# Monitors are independent given the state reached; EPS and EPM exclude each",
    );
    line(
        text,
        "# other. Outcomes answer GO (BO) and NP (ALT, NNA) only.",
    );
    for action in ["*", "GO", "NP"] {
        for (index, state) in STATES.iter().enumerate() {
            let outcomes = outcome_chances(parameters, action, index);
            for observation in observations() {
                let p = observation.probability(parameters, index, outcomes);
                // What the rule for any action has given is taken back where it cannot be.
                if p > 0.0 || (action != "*" && observation.outcome == 0) {
                    let (name, p) = (observation.name(), number(p));
                    line(text, &format!("O: {action} : {state} : {name} {p}"));
                }
            }
        }
    }
}

/// Chances of OUTCOMES after `action` led to a state.
fn outcome_chances(parameters: &Parameters, action: &str, state: usize) -> [f64; 4] {
    let of = |table: &super::PerState| table.values()[state];
    let outcomes = &parameters.outcomes;
    match action {
        "GO" => {
            let bo = of(&outcomes.bo);
            [1.0 - bo, bo, 0.0, 0.0]
        }
        "NP" => {
            let (alt, nna) = (of(&outcomes.alt), of(&outcomes.nna));
            [1.0 - alt - nna, 0.0, alt, nna]
        }
        _ => [1.0, 0.0, 0.0, 0.0],
    }
}

fn rewards(text: &mut String, parameters: &Parameters) {
    line(
        text,
        "\n# In units of what a nominal robot makes in one step.",
    );
    let rewards = &parameters.rewards;
    for (state, value) in STATES.iter().zip(rewards.fp.values()) {
        line(text, &format!("R: FP : {state} : * : * {}", number(value)));
    }
    let prices = &rewards.prices;
    let table = [
        prices.np, prices.rl, prices.go, prices.ma, prices.sh, prices.gu,
    ];
    for (action, price) in ACTIONS[1..].iter().zip(table) {
        line(text, &format!("R: {action} : * : * : * {}", number(-price)));
    }
}
