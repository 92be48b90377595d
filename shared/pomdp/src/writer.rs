//! Writer of Cassandra's `.pomdp` format: what is read back is the same model, bit by bit.

mod reward_rules;

use std::fmt::Write as _;

use crate::model::Pomdp;

/// A number that reads back to the same bits.
#[derive(Clone, Copy)]
struct Number(f64);

impl std::fmt::Display for Number {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let size = self.0.abs();
        if size != 0.0 && !(1e-5..1e15).contains(&size) {
            write!(f, "{:e}", self.0)
        } else {
            write!(f, "{}", self.0)
        }
    }
}

impl Pomdp {
    /// The model as a `.pomdp` text, by names and without zeros. [`Pomdp::parse`] makes the same
    /// model of it, bit by bit.
    #[must_use]
    pub fn to_cassandra(&self) -> String {
        let mut text = String::new();
        self.write_preamble(&mut text);
        self.write_start(&mut text);
        self.write_rows(&mut text, "T", |action, state| {
            self.successors(state, action).to_vec()
        });
        if !self.is_mdp() {
            self.write_rows(&mut text, "O", |action, state| {
                let z = 0..self.observations().len();
                z.map(|z| (z, self.likelihood(action, z)[state]))
                    .filter(|(_, p)| *p != 0.0)
                    .collect()
            });
        }
        reward_rules::write(self, &mut text);
        text
    }

    fn write_preamble(&self, text: &mut String) {
        let values = if self.is_cost() { "cost" } else { "reward" };
        put(text, format_args!("discount: {}", Number(self.discount())));
        put(text, format_args!("values: {values}"));
        let mut names = |what, names: &[String]| {
            put(text, format_args!("{what}: {}", name_list(names)));
        };
        names("states", self.states());
        names("actions", self.actions());
        if !self.is_mdp() {
            names("observations", self.observations());
        }
        text.push('\n');
    }

    fn write_start(&self, text: &mut String) {
        let (start, states) = (self.start(), self.states());
        let inside = start.iter().filter(|p| **p != 0.0).count();
        let share = 1.0 / inside as f64;
        let is_equal = start.iter().all(|p| *p == 0.0 || *p == share);
        let line = match (is_equal, inside) {
            (true, _) if inside == states.len() => "start: uniform".to_owned(),
            (true, 1..) => {
                let listed = states.iter().zip(start).filter(|(_, p)| **p != 0.0);
                let listed: Vec<&str> = listed.map(|(name, _)| name.as_str()).collect();
                format!("start include: {}", listed.join(" "))
            }
            _ => {
                let numbers: Vec<String> = start.iter().map(|p| Number(*p).to_string()).collect();
                format!("start: {}", numbers.join(" "))
            }
        };
        put(text, format_args!("{line}\n"));
    }

    /// Rows of T or O, for every action at once where all have the same.
    fn write_rows(
        &self,
        text: &mut String,
        table: &str,
        row: impl Fn(usize, usize) -> Vec<(usize, f64)>,
    ) {
        let (n, is_square) = (self.states().len(), table == "T");
        let width = if is_square {
            n
        } else {
            self.observations().len()
        };
        let columns = if is_square {
            self.states()
        } else {
            self.observations()
        };
        let same = |state| (1..self.actions().len()).all(|a| row(a, state) == row(0, state));
        let uniform = |row: &[(usize, f64)]| {
            row.len() == width && row.iter().all(|(_, p)| *p == 1.0 / width as f64)
        };
        let is_identity =
            |state: usize, row: &[(usize, f64)]| is_square && width > 1 && *row == [(state, 1.0)];
        let is_uniform = |row: &[(usize, f64)]| width > 1 && uniform(row);
        // The rows of one action; `*` stands for all.
        let mut write_action = |action: &str, a: usize, states: &[usize]| {
            let rows: Vec<_> = states.iter().map(|&state| (state, row(a, state))).collect();
            let is_whole = rows.len() == n;
            if is_whole && rows.iter().all(|(state, row)| is_identity(*state, row)) {
                put(text, format_args!("{table}: {action} identity"));
                return;
            }
            if is_whole && rows.iter().all(|(_, row)| is_uniform(row)) {
                put(text, format_args!("{table}: {action} uniform"));
                return;
            }
            for (state, row) in rows {
                let name = &self.states()[state];
                if is_uniform(&row) {
                    put(text, format_args!("{table}: {action} : {name} uniform"));
                    continue;
                }
                for (column, p) in row {
                    let (to, p) = (&columns[column], Number(p));
                    put(text, format_args!("{table}: {action} : {name} : {to} {p}"));
                }
            }
        };
        let (shared, own): (Vec<usize>, Vec<usize>) = (0..n).partition(|&state| same(state));
        write_action("*", 0, &shared);
        if !own.is_empty() {
            for (a, action) in self.actions().iter().enumerate() {
                write_action(action, a, &own);
            }
        }
        text.push('\n');
    }
}

/// `0 1 2` as the number 3; other names one by one.
fn name_list(names: &[String]) -> String {
    let mut numbers = names.iter().enumerate();
    if numbers.all(|(i, name)| *name == i.to_string()) {
        return names.len().to_string();
    }
    names.join(" ")
}

/// Adds a line. To write to a string cannot fail.
fn put(text: &mut String, line: std::fmt::Arguments<'_>) {
    let _ = writeln!(text, "{line}");
}
