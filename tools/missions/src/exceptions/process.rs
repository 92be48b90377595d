//! The decision process that parameters describe.

use vigil_pomdp::Process;

use super::parameters::{Action, Exception, Parameters, Signs};

/// Name of the state in which nothing is wrong.
pub const NOMINAL: &str = "NOM";
/// Name of the observation of nothing.
const NONE: &str = "none";

/// What is wrong: of each kind an exception, by its number, or none.
type Set = Vec<Option<usize>>;

/// Exceptions, several at once, and what is done about them.
pub struct ExceptionProcess<'a> {
    parameters: &'a Parameters,
    kinds: Vec<&'a str>,
    sets: Vec<Set>,
    observations: Vec<Vec<&'a str>>,
}

impl<'a> ExceptionProcess<'a> {
    /// Of checked parameters.
    pub fn new(parameters: &'a Parameters) -> Self {
        let kinds = parameters.kinds();
        let mut sets: Vec<Set> = vec![Vec::new()];
        for kind in &kinds {
            let exceptions = parameters.exceptions.iter().enumerate();
            let of_kind: Vec<usize> = exceptions
                .filter(|(_, e)| e.kind == *kind)
                .map(|(i, _)| i)
                .collect();
            let options = std::iter::once(None).chain(of_kind.into_iter().map(Some));
            let options: Vec<Option<usize>> = options.collect();
            let longer = |set: &Set| {
                let set = set.clone();
                let with = move |option: &Option<usize>| [set.clone(), vec![*option]].concat();
                options.iter().map(with).collect::<Vec<_>>()
            };
            sets = sets.iter().flat_map(longer).collect();
        }
        sets.retain(|set| members(set).count() <= parameters.at_once_max);
        sets.sort_by_key(|set| members(set).count());
        let observations = observations(parameters);
        Self {
            parameters,
            kinds,
            sets,
            observations,
        }
    }

    fn exception(&self, number: usize) -> &'a Exception {
        &self.parameters.exceptions[number]
    }

    fn action(&self, action: usize) -> &'a Action {
        &self.parameters.actions[action]
    }

    /// What may follow in one kind, and whether it has just arisen.
    fn next_of_kind(
        &self,
        kind: &str,
        present: Option<usize>,
        action: &Action,
    ) -> Vec<(Option<usize>, f64)> {
        let exceptions = self.parameters.exceptions.iter().enumerate();
        let Some(number) = present else {
            let of_kind = exceptions.filter(|(_, e)| e.kind == kind);
            let mut next: Vec<_> = of_kind.map(|(i, e)| (Some(i), e.arises)).collect();
            let arises: f64 = next.iter().map(|(_, p)| p).sum();
            // Nothing arises in so many steps, or in a part of one.
            let quiet = (1.0 - arises).powf(action.lasts);
            let share = if arises > 0.0 {
                (1.0 - quiet) / arises
            } else {
                0.0
            };
            next.iter_mut().for_each(|(_, p)| *p *= share);
            next.push((None, quiet));
            return next;
        };
        let exception = self.exception(number);
        let mended = exception.mended.get(&action.name).copied().unwrap_or(0.0);
        let stays = (1.0 - mended) * (1.0 - exception.passes).powf(action.lasts);
        let mut next = vec![(None, 1.0 - stays)];
        let mut rest = 1.0;
        for (name, p) in exception.turns.get(&action.name).into_iter().flatten() {
            let other = exceptions.clone().find(|(_, e)| e.name == *name);
            next.push((other.map(|(i, _)| i), stays * p));
            rest -= p;
        }
        next.push((present, stays * rest));
        next
    }

    /// The chances of what follows upon a set, with repetitions.
    fn next(&self, set: &Set, action: &Action) -> Vec<(usize, f64)> {
        let mut next: Vec<(Set, f64)> = vec![(Vec::new(), 1.0)];
        for (kind, present) in self.kinds.iter().zip(set) {
            let of_kind = self.next_of_kind(kind, *present, action);
            let mut longer = Vec::new();
            for (prefix, p) in &next {
                for (exception, q) in of_kind.iter().filter(|(_, q)| *q > 0.0) {
                    longer.push(([prefix.clone(), vec![*exception]].concat(), p * q));
                }
            }
            next = longer;
        }
        let known = |mut next: Set| {
            // What arises while there is no room for it does not.
            for (at, present) in set.iter().enumerate().rev() {
                let is_full = members(&next).count() > self.parameters.at_once_max;
                if is_full && present.is_none() {
                    next[at] = None;
                }
            }
            self.sets.iter().position(|of| *of == next)
        };
        let known = |(next, p)| known(next).map(|state| (state, p));
        next.into_iter().filter_map(known).collect()
    }

    /// Chance that the task is done: in the share of it that the action drives, if it does.
    fn ends(&self, set: &Set, action: &Action) -> f64 {
        let drives = action.follows && members(set).all(|i| self.exception(i).follow.is_none());
        match self.parameters.task_steps {
            Some(steps) if drives => (action.speed_scale / steps).min(1.0),
            _ => 0.0,
        }
    }

    /// The signs of what is wrong and not remedied by the action; of several in the file's order.
    fn signs(&self, set: &Set, action: &Action) -> Vec<&'a Signs> {
        let open = members(set).filter(|number| !remedies(action, self.exception(*number)));
        open.map(|number| &self.exception(number).signs).collect()
    }

    /// Chance of `name` among symptoms that exclude each other; `None` of none of them.
    fn symptom(&self, group: &[String], name: Option<&str>, signs: &[&Signs], shows: f64) -> f64 {
        let of = |signs: &Signs, name: &str| {
            let p = signs.symptoms.get(name).copied().unwrap_or(0.0);
            shows * p
        };
        let any = |signs: &Signs| group.iter().map(|name| of(signs, name)).sum::<f64>();
        let nominal = [&self.parameters.nominal];
        let signs = if signs.is_empty() { &nominal } else { signs };
        let none: f64 = signs.iter().map(|signs| 1.0 - any(signs)).product();
        let all: f64 = signs.iter().map(|signs| any(signs)).sum();
        match name {
            None => none,
            Some(_) if all == 0.0 => 0.0,
            Some(name) => {
                let share: f64 = signs.iter().map(|signs| of(signs, name)).sum();
                (1.0 - none) * share / all
            }
        }
    }

    /// Chance of the outcome `name` among those that the action reports; `None` of none. The first
    /// exception that says something about them decides.
    fn outcome(&self, action: &Action, name: Option<&str>, signs: &[&Signs]) -> f64 {
        let says = |signs: &&&Signs| {
            let mut reports = action.reports.iter();
            reports.any(|name| signs.outcomes.contains_key(name))
        };
        let signs = signs.iter().find(says).copied();
        let signs = signs.unwrap_or(&self.parameters.nominal);
        let of = |name: &str| signs.outcomes.get(name).copied().unwrap_or(0.0);
        match name {
            Some(name) if action.reports.iter().any(|of| of == name) => of(name),
            Some(_) => 0.0,
            None => 1.0 - action.reports.iter().map(|name| of(name)).sum::<f64>(),
        }
    }
}

impl Process for ExceptionProcess<'_> {
    fn discount(&self) -> f64 {
        self.parameters.discount
    }

    fn states(&self) -> Vec<String> {
        let name = |set: &Set| {
            let names: Vec<&str> = members(set)
                .map(|i| self.exception(i).name.as_str())
                .collect();
            match names.is_empty() {
                true => NOMINAL.to_owned(),
                false => names.join("-"),
            }
        };
        self.sets.iter().map(name).collect()
    }

    fn actions(&self) -> Vec<String> {
        self.parameters
            .actions
            .iter()
            .map(|action| action.name.clone())
            .collect()
    }

    fn observations(&self) -> Vec<String> {
        let name = |set: &Vec<&str>| match set.is_empty() {
            true => NONE.to_owned(),
            false => set.join("_"),
        };
        self.observations.iter().map(name).collect()
    }

    /// A task begins as any step does: nominal, but for what may just have arisen.
    fn start(&self) -> Vec<(usize, f64)> {
        let follow = self.parameters.actions.iter().find(|action| action.follows);
        let nominal: Set = vec![None; self.kinds.len()];
        follow.map_or(Vec::new(), |follow| self.next(&nominal, follow))
    }

    fn transition(&self, state: usize, action: usize) -> Vec<(usize, f64)> {
        let action = self.action(action);
        if action.ends {
            return self.start();
        }
        let ends = self.ends(&self.sets[state], action);
        let next = self.next(&self.sets[state], action).into_iter();
        let begins = self.start().into_iter().filter(|_| ends > 0.0);
        let goes_on = next.map(|(state, p)| (state, (1.0 - ends) * p));
        goes_on
            .chain(begins.map(|(state, p)| (state, ends * p)))
            .collect()
    }

    fn observation(&self, action: usize, next: usize) -> Vec<(usize, f64)> {
        let action = self.action(action);
        let signs = self.signs(&self.sets[next], action);
        let p = |set: &Vec<&str>| {
            let within = |names: &[String]| {
                let mut found = set.iter().filter(|name| names.iter().any(|n| n == *name));
                found.next().copied()
            };
            let symptoms = self.parameters.symptoms.iter();
            let symptoms: f64 = symptoms
                .map(|group| self.symptom(group, within(group), &signs, action.shows))
                .product();
            let is_symptom = |name: &&&str| {
                self.parameters
                    .symptoms
                    .iter()
                    .flatten()
                    .any(|n| n == **name)
            };
            let outcome = set.iter().find(|name| !is_symptom(name)).copied();
            symptoms * self.outcome(action, outcome, &signs)
        };
        let all = self.observations.iter().map(p).enumerate();
        all.filter(|(_, p)| *p > 0.0).collect()
    }

    fn reward(&self, state: usize, action: usize) -> f64 {
        let (set, action) = (&self.sets[state], self.action(action));
        let present = || members(set).map(|number| self.exception(number));
        let follow = match action.follows {
            false => 0.0,
            true if present().all(|e| e.follow.is_none()) => action.speed_scale,
            true => present().filter_map(|e| e.follow).sum(),
        };
        let moves = |e: &Exception| match remedies(action, e) {
            true => e.remedied_price,
            false => e.price,
        };
        let price: f64 = present().map(moves).sum();
        let is_needed = action.remedies.is_empty() || present().any(|e| remedies(action, e));
        let needless = if is_needed {
            0.0
        } else {
            action.needless_price
        };
        follow - action.price - needless - action.speed_scale * price
    }
}

/// The exceptions of a set, in the order of their kinds.
fn members(set: &Set) -> impl Iterator<Item = usize> {
    set.iter().flatten().copied()
}

fn remedies(action: &Action, exception: &Exception) -> bool {
    action.remedies.contains(&exception.name)
}

/// Every set of symptoms that do not exclude each other, alone and with each outcome.
fn observations(parameters: &Parameters) -> Vec<Vec<&str>> {
    let mut sets: Vec<Vec<&str>> = vec![Vec::new()];
    for group in &parameters.symptoms {
        let names: Vec<&str> = group.iter().map(String::as_str).collect();
        let with = extended(&sets, &names);
        sets = sets.into_iter().chain(with).collect();
    }
    let reports = parameters.actions.iter().flat_map(|action| &action.reports);
    let outcomes: Vec<&str> = reports.map(String::as_str).collect();
    let with = extended(&sets, &outcomes);
    sets.into_iter().chain(with).collect()
}

/// Every set with each of the names.
fn extended<'a>(sets: &[Vec<&'a str>], names: &[&'a str]) -> Vec<Vec<&'a str>> {
    let mut longer = Vec::new();
    for name in names {
        for set in sets {
            longer.push([set.as_slice(), &[*name]].concat());
        }
    }
    longer
}
