//! The functions of a model: which table gives which variable.

use super::scope::Scope;
use super::table::{Budget, Table};
use super::xml::{Element, short};
use crate::parse_error::ParseError;

/// A variable and its probabilities given others.
pub(super) struct Factor {
    pub slot: usize,
    pub table: Table,
}

/// All tables. Factors are in an order in which each depends on earlier ones alone.
pub(super) struct Factors {
    pub start: Vec<Factor>,
    pub transition: Vec<Factor>,
    pub observation: Vec<Factor>,
    /// They add up.
    pub reward: Vec<Table>,
    pub budget: Budget,
}

impl Factors {
    pub(super) fn read(root: Element<'_>, scope: &Scope) -> Result<Self, ParseError> {
        let mut budget = Budget::new();
        let mut group = |name: &str, of: std::ops::Range<usize>, given: &[usize]| {
            if of.is_empty() {
                return Ok(Vec::new());
            }
            let element = root.child(name)?;
            factors(element, scope, (of, given), &mut budget)
        };
        let slots = |ranges: &[std::ops::Range<usize>]| -> Vec<usize> {
            ranges.iter().cloned().flatten().collect()
        };
        let (acts, before, after) = (scope.action_slots(), scope.before(), scope.after());
        let start = group(
            "InitialStateBelief",
            before.clone(),
            &slots(std::slice::from_ref(&before)),
        )?;
        let known = slots(&[acts.clone(), before, after.clone()]);
        let transition = group("StateTransitionFunction", after.clone(), &known)?;
        let known = slots(&[acts, after, scope.seen()]);
        let observation = group("ObsFunction", scope.seen(), &known)?;
        let mut reward = Vec::new();
        for function in root.child("RewardFunction")?.named("Func") {
            let slots = parents(function, scope)?;
            reward.push(Table::read(function, scope, slots, &mut budget)?);
        }
        Ok(Self {
            start,
            transition,
            observation,
            reward,
            budget,
        })
    }
}

/// The slots that `<Parent>` names; `null` is none.
fn parents(function: Element<'_>, scope: &Scope) -> Result<Vec<usize>, ParseError> {
    let Some(element) = function.optional("Parent") else {
        return Ok(Vec::new());
    };
    let text = element.text();
    let mut slots = Vec::new();
    for name in text.split_whitespace().filter(|name| *name != "null") {
        let slot = scope.find(name);
        let slot = slot.filter(|slot| !slots.contains(slot));
        let wrong = || element.wrong(format!("'{}' is no variable, or named twice", short(name)));
        slots.push(slot.ok_or_else(wrong)?);
    }
    Ok(slots)
}

/// One factor for each slot of `of`, which may depend on `given`.
fn factors(
    element: Element<'_>,
    scope: &Scope,
    (of, given): (std::ops::Range<usize>, &[usize]),
    budget: &mut Budget,
) -> Result<Vec<Factor>, ParseError> {
    let mut waiting: Vec<Factor> = Vec::new();
    for function in element.named("CondProb") {
        let variable = function.child("Var")?;
        let text = variable.text();
        let name = text.trim();
        let slot = scope.find(name).filter(|slot| of.contains(slot));
        let slot = slot.filter(|slot| waiting.iter().all(|factor| factor.slot != *slot));
        let slot = slot.ok_or_else(|| {
            let place = element.name();
            let name = short(name);
            variable.wrong(format!(
                "'{name}' is no variable of <{place}>, or given twice"
            ))
        })?;
        let mut slots = parents(function, scope)?;
        if let Some(other) = slots.iter().find(|s| !given.contains(s) || **s == slot) {
            let other = &scope.slots[*other].name;
            let message = format!("'{}' cannot depend on '{}' here", short(name), short(other));
            return Err(function.wrong(message));
        }
        slots.push(slot);
        let table = Table::read(function, scope, slots, budget)?;
        waiting.push(Factor { slot, table });
    }
    if let Some(slot) = of.clone().find(|s| waiting.iter().all(|f| f.slot != *s)) {
        let name = short(&scope.slots[slot].name);
        return Err(element.wrong(format!("no <CondProb> gives '{name}'")));
    }
    let mut ordered: Vec<Factor> = Vec::new();
    while !waiting.is_empty() {
        let is_free = |factor: &Factor| {
            let mut others = waiting.iter().map(|other| other.slot);
            others.all(|slot| slot == factor.slot || !factor.table.slots.contains(&slot))
        };
        let Some(next) = waiting.iter().position(is_free) else {
            return Err(element.wrong("variables depend on each other in a circle"));
        };
        ordered.push(waiting.remove(next));
    }
    Ok(ordered)
}
