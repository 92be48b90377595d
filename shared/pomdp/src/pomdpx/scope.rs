//! The variables, and one slot for each: actions, states before, states after, observations.

use std::collections::HashMap;
use std::ops::Range;

use super::xml::{Element, short};
use crate::parse_error::ParseError;
use crate::reader::limits::{NAMES_MAX, check};

/// Most variables of a model: their product is larger than any table long before.
const VARIABLES_MAX: usize = 64;
/// Longest name of a state, an action or an observation, bytes.
const NAME_BYTES_MAX: usize = 256;

/// A variable's values.
pub(super) struct Slot {
    pub name: String,
    pub values: Vec<String>,
    index: HashMap<String, usize>,
}

impl Slot {
    fn new(name: &str, values: Vec<String>) -> Self {
        let index = values.iter().cloned().zip(0..).collect();
        Self {
            name: name.to_owned(),
            values,
            index,
        }
    }

    /// The index of a value.
    pub(super) fn find(&self, value: &str) -> Option<usize> {
        self.index.get(value).copied()
    }
}

/// All variables. An assignment of values is an array with an index for every slot.
pub(super) struct Scope {
    pub slots: Vec<Slot>,
    names: HashMap<String, usize>,
    actions: usize,
    /// State variables; each has a slot before and one after.
    states: usize,
    /// State variables that are observed.
    observed: Vec<usize>,
}

impl Scope {
    pub(super) fn read(element: Element<'_>) -> Result<Self, ParseError> {
        let (mut before, mut after, mut observed) = (Vec::new(), Vec::new(), Vec::new());
        for variable in element.named("StateVar") {
            let values = values(variable, "s")?;
            if variable.attribute("fullyObs") == Some("true") {
                observed.push(before.len());
            }
            let previous = variable.needed_attribute("vnamePrev")?;
            before.push(Slot::new(previous, values.clone()));
            after.push(Slot::new(variable.needed_attribute("vnameCurr")?, values));
            check_count(element, before.len())?;
        }
        let mut slots = Vec::new();
        for variable in element.named("ActionVar") {
            let name = variable.needed_attribute("vname")?;
            slots.push(Slot::new(name, values(variable, "a")?));
            check_count(element, slots.len())?;
        }
        let (states, actions) = (before.len(), slots.len());
        if states == 0 || actions == 0 {
            return Err(element.wrong("wanted are a <StateVar> and an <ActionVar> at least"));
        }
        slots.extend(before);
        slots.extend(after);
        for variable in element.named("ObsVar") {
            let name = variable.needed_attribute("vname")?;
            slots.push(Slot::new(name, values(variable, "o")?));
            check_count(element, slots.len() - actions - 2 * states)?;
        }
        let mut names = HashMap::new();
        for (slot, variable) in slots.iter().enumerate() {
            if names.insert(variable.name.clone(), slot).is_some() {
                let message = format!("two variables are called '{}'", short(&variable.name));
                return Err(element.wrong(message));
            }
        }
        let scope = Self {
            slots,
            names,
            actions,
            states,
            observed,
        };
        for (range, what) in [
            (scope.action_slots(), "actions"),
            (scope.before(), "states"),
            (scope.seen(), "observations"),
        ] {
            check(scope.size_of(range), NAMES_MAX, element.at(), what)?;
        }
        let all = scope.observation_slots();
        check(
            scope.product(all.into_iter()),
            NAMES_MAX,
            element.at(),
            "observations",
        )?;
        Ok(scope)
    }

    /// The slot of a name.
    pub(super) fn find(&self, name: &str) -> Option<usize> {
        self.names.get(name).copied()
    }

    pub(super) fn action_slots(&self) -> Range<usize> {
        0..self.actions
    }

    pub(super) fn before(&self) -> Range<usize> {
        self.actions..self.actions + self.states
    }

    pub(super) fn after(&self) -> Range<usize> {
        self.before().end..self.before().end + self.states
    }

    /// Observation variables of the file.
    pub(super) fn seen(&self) -> Range<usize> {
        self.after().end..self.slots.len()
    }

    /// What an observation consists of: state variables after the step, then observation variables.
    pub(super) fn observation_slots(&self) -> Vec<usize> {
        let observed = self.observed.iter().map(|i| self.after().start + i);
        observed.chain(self.seen()).collect()
    }

    pub(super) fn states(&self) -> usize {
        self.size_of(self.before()).unwrap_or(usize::MAX)
    }

    pub(super) fn actions(&self) -> usize {
        self.size_of(self.action_slots()).unwrap_or(usize::MAX)
    }

    pub(super) fn observations(&self) -> usize {
        let slots = self.observation_slots();
        self.product(slots.into_iter()).unwrap_or(usize::MAX)
    }

    pub(super) fn state_names(&self) -> Result<Vec<String>, ParseError> {
        self.joined(&self.before().collect::<Vec<_>>())
    }

    pub(super) fn action_names(&self) -> Result<Vec<String>, ParseError> {
        self.joined(&self.action_slots().collect::<Vec<_>>())
    }

    /// `none` alone if nothing is observed.
    pub(super) fn observation_names(&self) -> Result<Vec<String>, ParseError> {
        let slots = self.observation_slots();
        if slots.is_empty() {
            return Ok(vec!["none".to_owned()]);
        }
        self.joined(&slots)
    }

    /// Sets the slots to combination number `index`, the last running fastest.
    pub(super) fn assign(&self, slots: &[usize], mut index: usize, to: &mut [usize]) {
        for &slot in slots.iter().rev() {
            let size = self.slots[slot].values.len();
            to[slot] = index % size;
            index /= size;
        }
    }

    /// The number of the combination that the slots hold.
    pub(super) fn index(&self, slots: impl Iterator<Item = usize>, of: &[usize]) -> usize {
        slots.fold(0, |index, slot| {
            index * self.slots[slot].values.len() + of[slot]
        })
    }

    fn size_of(&self, range: Range<usize>) -> Option<usize> {
        self.product(range)
    }

    fn product(&self, mut slots: impl Iterator<Item = usize>) -> Option<usize> {
        slots.try_fold(1_usize, |product, slot| {
            product.checked_mul(self.slots[slot].values.len())
        })
    }

    fn joined(&self, slots: &[usize]) -> Result<Vec<String>, ParseError> {
        let longest = |slot: &usize| {
            let lengths = self.slots[*slot].values.iter().map(String::len);
            lengths.max().unwrap_or(0) + 1
        };
        let length: usize = slots.iter().map(longest).sum();
        let at = crate::parse_error::Position { line: 1, column: 1 };
        check(Some(length), NAME_BYTES_MAX, at, "bytes of a name")?;
        let mut names = vec![String::new()];
        for (i, &slot) in slots.iter().enumerate() {
            let separator = if i == 0 { "" } else { "_" };
            let values = &self.slots[slot].values;
            let longer = names.iter().flat_map(|name| {
                let join = move |value| format!("{name}{separator}{value}");
                values.iter().map(join)
            });
            names = longer.collect();
        }
        Ok(names)
    }
}

fn check_count(element: Element<'_>, count: usize) -> Result<(), ParseError> {
    if count <= VARIABLES_MAX {
        return Ok(());
    }
    Err(element.wrong(format!(
        "more than {VARIABLES_MAX} variables, allowed are {VARIABLES_MAX} of a kind"
    )))
}

/// `<NumValues>` or `<ValueEnum>`.
fn values(variable: Element<'_>, prefix: &str) -> Result<Vec<String>, ParseError> {
    let values: Vec<String> = if let Some(count) = variable.optional("NumValues") {
        let text = count.text();
        let number = text.trim().parse().ok();
        let number = number.filter(|n| (1..=NAMES_MAX).contains(n));
        let number = number.ok_or_else(|| {
            let found = short(text.trim());
            count.wrong(format!("'{found}' values, allowed are 1 to {NAMES_MAX}"))
        })?;
        (0..number).map(|i| format!("{prefix}{i}")).collect()
    } else {
        let list = variable.child("ValueEnum")?.text();
        list.split_whitespace().map(str::to_owned).collect()
    };
    check(Some(values.len()), NAMES_MAX, variable.at(), "values")?;
    let different: std::collections::HashSet<&String> = values.iter().collect();
    if values.is_empty() || different.len() < values.len() {
        return Err(variable.wrong("wanted are different values, one at least"));
    }
    Ok(values)
}
