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

    /// Rows of T or O. What most actions share is written for all of them, and then the rows of
    /// those that differ.
    fn write_rows(
        &self,
        text: &mut String,
        table: &str,
        row: impl Fn(usize, usize) -> Vec<(usize, f64)>,
    ) {
        let columns = match table {
            "T" => self.states(),
            _ => self.observations(),
        };
        let write = RowWriter {
            table,
            states: self.states(),
            columns,
        };
        let of_state = |state| {
            let rows = (0..self.actions().len()).map(|action| row(action, state));
            rows.collect::<Vec<_>>()
        };
        let rows: Vec<Vec<Row>> = (0..self.states().len()).map(of_state).collect();
        let shared: Vec<Option<&Row>> = rows.iter().map(|rows| most_frequent(rows)).collect();
        write.action(text, "*", &shared, &vec![None; shared.len()]);
        for (a, action) in self.actions().iter().enumerate() {
            let differs = |(rows, shared): (&'_ Vec<Row>, &Option<&Row>)| *shared != Some(&rows[a]);
            let own: Vec<Option<&Row>> = rows
                .iter()
                .zip(&shared)
                .map(|both| differs(both).then_some(&both.0[a]))
                .collect();
            write.action(text, action, &own, &shared);
        }
        text.push('\n');
    }
}

/// Columns and what they hold, without zeros.
type Row = Vec<(usize, f64)>;

/// The row that most of an action's rows are, if that is more than one of several.
fn most_frequent(rows: &[Row]) -> Option<&Row> {
    let count = |row: &Row| rows.iter().filter(|other| *other == row).count();
    let numbered = rows.iter().enumerate();
    let (_, most) = numbered.max_by_key(|(at, row)| (count(row), rows.len() - at))?;
    (rows.len() == 1 || count(most) > 1).then_some(most)
}

/// Writes rows of T or O.
struct RowWriter<'a> {
    table: &'a str,
    states: &'a [String],
    columns: &'a [String],
}

impl RowWriter<'_> {
    /// The rows of one action that there are; `*` stands for all. `before` are those that stand in
    /// the text already.
    fn action(
        &self,
        text: &mut String,
        action: &str,
        rows: &[Option<&Row>],
        before: &[Option<&Row>],
    ) {
        let table = self.table;
        let whole: Option<Vec<&Row>> = rows.iter().copied().collect();
        let is_whole = |is: &dyn Fn(usize, &Row) -> bool| {
            let is = |(state, row): (usize, &&Row)| is(state, row);
            whole
                .as_ref()
                .is_some_and(|rows| rows.iter().enumerate().all(is))
        };
        if is_whole(&|state, row| self.is_identity(state, row)) {
            return put(text, format_args!("{table}: {action} identity"));
        }
        if is_whole(&|_, row| self.is_uniform(row)) {
            return put(text, format_args!("{table}: {action} uniform"));
        }
        for (state, (row, before)) in rows.iter().zip(before).enumerate() {
            if let Some(row) = row {
                let head = format!("{table}: {action} : {}", self.states[state]);
                self.row(text, &head, row, *before);
            }
        }
    }

    fn row(&self, text: &mut String, head: &str, row: &Row, before: Option<&Row>) {
        if self.is_uniform(row) {
            return put(text, format_args!("{head} uniform"));
        }
        let at = |column: usize| {
            row.iter()
                .find(|(to, _)| *to == column)
                .map_or(0.0, |(_, p)| *p)
        };
        let keeps_some = |(to, _): &(usize, f64)| at(*to) == 0.0;
        if before.is_some_and(|before| before.iter().any(keeps_some)) {
            let numbers = (0..self.columns.len()).map(|column| Number(at(column)).to_string());
            let numbers: Vec<String> = numbers.collect();
            return put(text, format_args!("{head}\n{}", numbers.join(" ")));
        }
        for (column, p) in row {
            put(
                text,
                format_args!("{head} : {} {}", self.columns[*column], Number(*p)),
            );
        }
    }

    fn is_uniform(&self, row: &Row) -> bool {
        let width = self.columns.len();
        width > 1 && row.len() == width && row.iter().all(|(_, p)| *p == 1.0 / width as f64)
    }

    fn is_identity(&self, state: usize, row: &Row) -> bool {
        self.table == "T" && self.columns.len() > 1 && *row == [(state, 1.0)]
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
