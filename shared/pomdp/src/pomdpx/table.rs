//! Tables over some of the variables.

use super::scope::Scope;
use super::xml::{Element, short};
use crate::model::check_probability;
use crate::parse_error::ParseError;
use crate::reader::limits::{ENTRIES_MAX, WRITES_MAX};

/// What all tables together may still take.
pub(super) struct Budget {
    entries: usize,
    writes: usize,
}

impl Budget {
    pub(super) const fn new() -> Self {
        Self {
            entries: ENTRIES_MAX,
            writes: WRITES_MAX,
        }
    }

    /// Takes work; an error when it is used up.
    pub(super) fn work(&mut self, writes: usize) -> Result<(), String> {
        self.writes = self.writes.checked_sub(writes).ok_or_else(|| {
            format!("more than {WRITES_MAX} entries to write, allowed are {WRITES_MAX}")
        })?;
        Ok(())
    }

    fn memory(&mut self, entries: Option<usize>) -> Result<usize, String> {
        let left = entries.and_then(|entries| self.entries.checked_sub(entries));
        self.entries = left.ok_or_else(|| {
            format!("the tables have more than {ENTRIES_MAX} entries, allowed are {ENTRIES_MAX}")
        })?;
        Ok(entries.unwrap_or_default())
    }
}

/// A number for every combination of values of some slots, the last running fastest.
pub(super) struct Table {
    pub slots: Vec<usize>,
    sizes: Vec<usize>,
    values: Vec<f64>,
}

/// How an entry names the values of one variable.
#[derive(Clone, Copy, PartialEq)]
enum Place {
    One(usize),
    /// `*`: all alike.
    Same,
    /// `-`: all, each with its own number.
    Each,
}

/// What an entry writes.
enum Content {
    Numbers(Vec<f64>),
    Uniform,
    Identity,
}

impl Table {
    /// Reads the parameter of a `<CondProb>` or a `<Func>`; a probability is over the last slot.
    pub(super) fn read(
        element: Element<'_>,
        scope: &Scope,
        slots: Vec<usize>,
        budget: &mut Budget,
    ) -> Result<Self, ParseError> {
        let parameter = element.child("Parameter")?;
        let kind = parameter.attribute("type").unwrap_or("TBL");
        if kind != "TBL" {
            let found = short(kind);
            let message = format!("a parameter of type '{found}' is not read, allowed is TBL");
            return Err(parameter.wrong(message));
        }
        let size = |slot: &usize| scope.slots[*slot].values.len();
        let sizes: Vec<usize> = slots.iter().map(size).collect();
        let entries = sizes
            .iter()
            .try_fold(1_usize, |n, &size| n.checked_mul(size));
        let entries = budget.memory(entries).map_err(|m| element.wrong(m))?;
        let mut table = Self {
            slots,
            sizes,
            values: vec![0.0; entries],
        };
        let is_probability = element.name() == "CondProb";
        for entry in parameter.named("Entry") {
            table.enter(entry, scope, is_probability, budget)?;
        }
        Ok(table)
    }

    /// The number at an assignment of all slots.
    pub(super) fn at(&self, assignment: &[usize]) -> f64 {
        let pairs = self.slots.iter().zip(&self.sizes);
        let index = pairs.fold(0, |index, (&slot, size)| index * size + assignment[slot]);
        self.values[index]
    }

    fn enter(
        &mut self,
        entry: Element<'_>,
        scope: &Scope,
        is_probability: bool,
        budget: &mut Budget,
    ) -> Result<(), ParseError> {
        let instance = entry.child("Instance")?;
        let text = instance.text();
        let words: Vec<&str> = text.split_whitespace().collect();
        if words.len() != self.slots.len() {
            let (found, wanted) = (words.len(), self.slots.len());
            return Err(instance.wrong(format!("{found} values, wanted are {wanted}")));
        }
        let mut places = Vec::with_capacity(words.len());
        for (word, &slot) in words.iter().zip(&self.slots) {
            let variable = &scope.slots[slot];
            places.push(match *word {
                "*" => Place::Same,
                "-" => Place::Each,
                word => Place::One(variable.find(word).ok_or_else(|| {
                    let (word, name) = (short(word), short(&variable.name));
                    instance.wrong(format!("'{word}' is no value of '{name}'"))
                })?),
            });
        }
        let name = if is_probability {
            "ProbTable"
        } else {
            "ValueTable"
        };
        let element = entry.child(name)?;
        let content = self.content(element, &places, is_probability)?;
        let wide = places.iter().zip(&self.sizes);
        let covered = wide
            .filter(|(place, _)| !matches!(place, Place::One(_)))
            .try_fold(1_usize, |n, (_, &size)| n.checked_mul(size));
        let covered = covered.unwrap_or(usize::MAX);
        budget.work(covered.max(1)).map_err(|m| entry.wrong(m))?;
        self.write(&places, &content, covered);
        Ok(())
    }

    fn content(
        &self,
        element: Element<'_>,
        places: &[Place],
        is_probability: bool,
    ) -> Result<Content, ParseError> {
        let text = element.text();
        let each = places.iter().zip(&self.sizes);
        let each: Vec<usize> = each
            .filter(|(place, _)| **place == Place::Each)
            .map(|(_, &size)| size)
            .collect();
        match text.trim() {
            "uniform" if is_probability => return Ok(Content::Uniform),
            "identity" if is_probability => {
                return match each[..] {
                    [one, other] if one == other => Ok(Content::Identity),
                    _ => Err(element.wrong("identity needs two '-' of equally many values")),
                };
            }
            _ => {}
        }
        let allowed = |value: &f64| {
            value.is_finite() && (!is_probability || check_probability(*value).is_ok())
        };
        let mut numbers = Vec::new();
        for word in text.split_whitespace() {
            let number = word.parse::<f64>().ok().filter(allowed);
            let wanted = if is_probability {
                "0 to 1"
            } else {
                "a finite number"
            };
            let wrong = || element.wrong(format!("'{}', allowed is {wanted}", short(word)));
            // Never a negative zero.
            numbers.push(number.ok_or_else(wrong)? + 0.0);
        }
        let wanted: usize = each.iter().product();
        if numbers.len() != wanted {
            let found = numbers.len();
            return Err(element.wrong(format!("{found} numbers, wanted are {wanted}")));
        }
        Ok(Content::Numbers(numbers))
    }

    fn write(&mut self, places: &[Place], content: &Content, covered: usize) {
        let own = self.sizes.last().copied().unwrap_or(1) as f64;
        let mut at: Vec<usize> = places
            .iter()
            .map(|place| match place {
                Place::One(index) => *index,
                Place::Same | Place::Each => 0,
            })
            .collect();
        for _ in 0..covered {
            let (mut index, mut number) = (0, 0);
            let mut each = [0; 2];
            for ((place, &size), &value) in places.iter().zip(&self.sizes).zip(&at) {
                index = index * size + value;
                if *place == Place::Each {
                    number = number * size + value;
                    each = [each[1], value];
                }
            }
            self.values[index] = match content {
                Content::Numbers(numbers) => numbers[number],
                Content::Uniform => 1.0 / own,
                Content::Identity => f64::from(u8::from(each[0] == each[1])),
            };
            let wide = places.iter().zip(&self.sizes).zip(&mut at).rev();
            for ((_, &size), value) in wide.filter(|((p, _), _)| !matches!(p, Place::One(_))) {
                *value += 1;
                if *value < size {
                    break;
                }
                *value = 0;
            }
        }
    }
}
