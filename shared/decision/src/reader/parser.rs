//! The grammar: preamble, start belief, then T, O and R in any order; later rules win.

use super::assign::{Pick, Table};
use super::lexer::{Placed, Token, tokens};
use super::{ParseError, Position};
use crate::model::{Parts, Pomdp};

/// Most states, actions or observations.
const NAMES_MAX: usize = 100_000;
const RESERVED: [&str; 16] = [
    "discount",
    "values",
    "states",
    "actions",
    "observations",
    "T",
    "O",
    "R",
    "uniform",
    "identity",
    "reward",
    "cost",
    "reset",
    "start",
    "include",
    "exclude",
];

/// Reads a POMDP.
pub(crate) fn parse(text: &str) -> Result<Pomdp, ParseError> {
    let tokens = tokens(text)?;
    let mut parser = Parser {
        tokens: &tokens,
        next: 0,
    };
    let preamble = parser.preamble()?;
    let start = parser.start(&preamble)?;
    let tables = parser.tables(&preamble, &start)?;
    Pomdp::from_parts(Parts {
        discount: preamble.discount,
        states: preamble.states,
        actions: preamble.actions,
        observations: preamble.observations,
        start,
        transition: tables.transition.values,
        observation: tables.observation.values,
        reward: tables.reward.values,
        reward_sign: if preamble.costs { -1.0 } else { 1.0 },
        row_at: [tables.transition_at, tables.observation_at],
    })
}

struct Preamble {
    discount: f64,
    costs: bool,
    states: Vec<String>,
    actions: Vec<String>,
    observations: Vec<String>,
    is_mdp: bool,
}

struct Tables {
    transition: Table,
    observation: Table,
    reward: Table,
    /// Where row (a, s) of T and of O was last written.
    transition_at: Vec<Position>,
    observation_at: Vec<Position>,
}

struct Parser<'a> {
    tokens: &'a [Placed<'a>],
    next: usize,
}

impl<'a> Parser<'a> {
    fn peek(&self) -> Placed<'a> {
        self.tokens[self.next.min(self.tokens.len() - 1)]
    }

    fn take(&mut self) -> Placed<'a> {
        let placed = self.peek();
        self.next += 1;
        placed
    }

    fn wrong<T>(&self, wanted: &str) -> Result<T, ParseError> {
        let Placed { token, at } = self.peek();
        let found = match token {
            Token::Word(word) | Token::Number(word) => format!("'{word}'"),
            Token::Colon => "':'".into(),
            Token::Star => "'*'".into(),
            Token::Plus => "'+'".into(),
            Token::Minus => "'-'".into(),
            Token::End => "the end of the text".into(),
        };
        Err(ParseError::new(
            at,
            format!("found {found}, expected {wanted}"),
        ))
    }

    fn colon(&mut self) -> Result<(), ParseError> {
        if self.peek().token != Token::Colon {
            return self.wrong("':'");
        }
        self.take();
        Ok(())
    }

    fn accept(&mut self, word: &str) -> bool {
        let found = self.peek().token == Token::Word(word);
        self.next += usize::from(found);
        found
    }

    /// A number, with an optional sign.
    fn number(&mut self) -> Result<f64, ParseError> {
        let sign = match self.peek().token {
            Token::Minus => -1.0,
            _ => 1.0,
        };
        if matches!(self.peek().token, Token::Minus | Token::Plus) {
            self.take();
        }
        let Placed { token, at } = self.peek();
        let Token::Number(text) = token else {
            return self.wrong("a number");
        };
        self.take();
        match text.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(sign * value),
            _ => Err(ParseError::new(
                at,
                format!("'{text}' is not a finite number"),
            )),
        }
    }

    fn probability(&mut self) -> Result<f64, ParseError> {
        let at = self.peek().at;
        let p = self.number()?;
        if (0.0..=1.0 + 1e-5).contains(&p) {
            return Ok(p);
        }
        Err(ParseError::new(
            at,
            format!("{p} is not a probability, allowed is 0 to 1"),
        ))
    }

    fn preamble(&mut self) -> Result<Preamble, ParseError> {
        let (mut discount, mut costs) = (None, false);
        let [mut states, mut actions, mut observations] = [const { Vec::new() }; 3];
        loop {
            let at = self.peek().at;
            if self.accept("discount") {
                self.colon()?;
                let value = self.number()?;
                if !(0.0..=1.0).contains(&value) {
                    let message = format!("discount is {value}, allowed is 0 to 1");
                    return Err(ParseError::new(at, message));
                }
                discount = Some(value);
            } else if self.accept("values") {
                self.colon()?;
                costs = match self.take().token {
                    Token::Word("reward") => false,
                    Token::Word("cost") => true,
                    _ => return Err(ParseError::new(at, "values must be reward or cost")),
                };
            } else if self.accept("states") {
                states = self.names()?;
            } else if self.accept("actions") {
                actions = self.names()?;
            } else if self.accept("observations") {
                observations = self.names()?;
            } else {
                break;
            }
        }
        let at = self.peek().at;
        let missing = |what: &str| {
            Err(ParseError::new(
                at,
                format!("{what} is missing before here"),
            ))
        };
        let Some(discount) = discount else {
            return missing("discount:");
        };
        if states.is_empty() {
            return missing("states:");
        }
        if actions.is_empty() {
            return missing("actions:");
        }
        let is_mdp = observations.is_empty();
        if is_mdp {
            observations.push("none".into());
        }
        Ok(Preamble {
            discount,
            costs,
            states,
            actions,
            observations,
            is_mdp,
        })
    }

    /// `: 5`, or `: name name ...`.
    fn names(&mut self) -> Result<Vec<String>, ParseError> {
        self.colon()?;
        let Placed { token, at } = self.peek();
        let limit = |n: usize| {
            (1..=NAMES_MAX).contains(&n).then_some(n).ok_or_else(|| {
                ParseError::new(at, format!("{n} names, allowed are 1 to {NAMES_MAX}"))
            })
        };
        if let Token::Number(text) = token {
            self.take();
            let count = text
                .parse()
                .map_err(|_| ParseError::new(at, format!("'{text}' is not a number of names")))?;
            return Ok((0..limit(count)?).map(|i| i.to_string()).collect());
        }
        let mut names: Vec<String> = Vec::new();
        while let Placed {
            token: Token::Word(word),
            at,
        } = self.peek()
        {
            if RESERVED.contains(&word) {
                break;
            }
            if names.iter().any(|name| name == word) {
                return Err(ParseError::new(at, format!("'{word}' appears twice")));
            }
            names.push(word.to_owned());
            limit(names.len())?;
            self.take();
        }
        if names.is_empty() {
            return self.wrong("a number, or names");
        }
        Ok(names)
    }

    fn index(&mut self, names: &[String], what: &str) -> Result<usize, ParseError> {
        match self.pick(names, what)? {
            Some(index) => Ok(index),
            None => {
                self.next -= 1;
                self.wrong(&format!("one {what}, not all"))
            }
        }
    }

    /// A name, an index, or `*`.
    fn pick(&mut self, names: &[String], what: &str) -> Result<Pick, ParseError> {
        let found = match self.peek().token {
            Token::Star => Some(None),
            Token::Word(word) => names.iter().position(|name| name == word).map(Some),
            Token::Number(text) => text.parse().ok().filter(|i| *i < names.len()).map(Some),
            _ => None,
        };
        match found {
            Some(pick) => {
                self.take();
                Ok(pick)
            }
            None => self.wrong(&format!(
                "a {what}: a name, a number below {}, or *",
                names.len()
            )),
        }
    }

    fn start(&mut self, p: &Preamble) -> Result<Vec<f64>, ParseError> {
        let n = p.states.len();
        let uniform = |of: &dyn Fn(usize) -> bool| {
            let count = (0..n).filter(|&s| of(s)).count() as f64;
            (0..n)
                .map(|s| if of(s) { 1.0 / count } else { 0.0 })
                .collect::<Vec<f64>>()
        };
        if !self.accept("start") {
            return Ok(uniform(&|_| true));
        }
        let at = self.peek().at;
        let (include, exclude) = (self.accept("include"), self.accept("exclude"));
        self.colon()?;
        if include || exclude {
            let mut listed = vec![false; n];
            while !self.at_rule() {
                listed[self.index(&p.states, "state")?] = true;
            }
            let of = |s: usize| listed[s] == include;
            if !(0..n).any(of) {
                return Err(ParseError::new(at, "no state is left to start in"));
            }
            return Ok(uniform(&of));
        }
        if self.accept("uniform") {
            return Ok(uniform(&|_| true));
        }
        let is_one = matches!(self.peek().token, Token::Word(_)) || (n > 1 && self.one_number());
        if is_one {
            let state = self.index(&p.states, "state")?;
            return Ok(uniform(&|s| s == state));
        }
        let belief = (0..n)
            .map(|_| self.probability())
            .collect::<Result<Vec<f64>, _>>()?;
        let sum: f64 = belief.iter().sum();
        if (sum - 1.0).abs() > 1e-5 {
            let message = format!("the start belief sums to {sum}, allowed is 1 within 1e-5");
            return Err(ParseError::new(at, message));
        }
        Ok(belief)
    }

    /// True at the end, or where T, O or R begins.
    fn at_rule(&self) -> bool {
        matches!(self.peek().token, Token::End | Token::Word("T" | "O" | "R"))
    }

    /// True if exactly one number stands before the next rule: a state's index.
    fn one_number(&self) -> bool {
        let after = self.tokens.get(self.next + 1).map(|placed| placed.token);
        matches!(after, Some(Token::End | Token::Word("T" | "O" | "R")))
    }

    fn tables(&mut self, p: &Preamble, start: &[f64]) -> Result<Tables, ParseError> {
        let (s, a, o) = (p.states.len(), p.actions.len(), p.observations.len());
        let at = self.peek().at;
        let mut tables = Tables {
            transition: Table::new(&[a, s, s], "T", at)?,
            observation: Table::new(&[a, s, o], "O", at)?,
            reward: Table::new(&[a, s, s, o], "R", at)?,
            transition_at: vec![at; a * s],
            observation_at: vec![at; a * s],
        };
        if p.is_mdp {
            tables.observation.write(&[], |_| 1.0);
        }
        loop {
            let at = self.peek().at;
            match self.peek().token {
                Token::End => return Ok(tables),
                Token::Word("T") => self.transition(p, start, &mut tables, at)?,
                Token::Word("O") => self.observation(p, &mut tables, at)?,
                Token::Word("R") => self.reward(p, &mut tables)?,
                _ => return self.wrong("T, O, R or the end"),
            }
        }
    }

    /// `a [: x [: y ...]]` after `T`, `O` or `R`.
    fn picks(&mut self, dimensions: &[(&[String], &str)]) -> Result<Vec<Pick>, ParseError> {
        self.take();
        let mut picks = Vec::with_capacity(dimensions.len());
        for (names, what) in dimensions {
            if self.peek().token != Token::Colon {
                break;
            }
            self.take();
            picks.push(self.pick(names, what)?);
        }
        if picks.is_empty() {
            return self.wrong("':' and an action");
        }
        Ok(picks)
    }

    fn transition(
        &mut self,
        p: &Preamble,
        start: &[f64],
        tables: &mut Tables,
        at: Position,
    ) -> Result<(), ParseError> {
        let n = p.states.len();
        let states: (&[String], &str) = (&p.states, "state");
        let picks = self.picks(&[(&p.actions, "action"), states, states])?;
        note_rows(&mut tables.transition_at, n, &picks, at);
        let table = &mut tables.transition;
        match picks.len() {
            3 => {
                let value = self.probability()?;
                table.write(&picks, |_| value);
            }
            2 if self.accept("reset") => table.write(&picks, |i| start[i[2]]),
            _ if self.accept("uniform") => table.write(&picks, |_| 1.0 / n as f64),
            2 => {
                let row = self.probabilities(n)?;
                table.write(&picks, |i| row[i[2]]);
            }
            _ if self.accept("identity") => {
                table.write(&picks, |i| f64::from(u8::from(i[1] == i[2])));
            }
            _ => {
                let matrix = self.probabilities(n * n)?;
                table.write(&picks, |i| matrix[i[1] * n + i[2]]);
            }
        }
        Ok(())
    }

    fn observation(
        &mut self,
        p: &Preamble,
        tables: &mut Tables,
        at: Position,
    ) -> Result<(), ParseError> {
        if p.is_mdp {
            return self.wrong("no O: the model has no observations");
        }
        let (n, k) = (p.states.len(), p.observations.len());
        let dimensions: [(&[String], &str); 3] = [
            (&p.actions, "action"),
            (&p.states, "state"),
            (&p.observations, "observation"),
        ];
        let picks = self.picks(&dimensions)?;
        note_rows(&mut tables.observation_at, n, &picks, at);
        let table = &mut tables.observation;
        match picks.len() {
            3 => {
                let value = self.probability()?;
                table.write(&picks, |_| value);
            }
            _ if self.accept("uniform") => table.write(&picks, |_| 1.0 / k as f64),
            2 => {
                let row = self.probabilities(k)?;
                table.write(&picks, |i| row[i[2]]);
            }
            _ => {
                let matrix = self.probabilities(n * k)?;
                table.write(&picks, |i| matrix[i[1] * k + i[2]]);
            }
        }
        Ok(())
    }

    fn reward(&mut self, p: &Preamble, tables: &mut Tables) -> Result<(), ParseError> {
        let (n, k) = (p.states.len(), p.observations.len());
        let states: (&[String], &str) = (&p.states, "state");
        let observations: (&[String], &str) = (&p.observations, "observation");
        let picks = self.picks(&[(&p.actions, "action"), states, states, observations])?;
        let table = &mut tables.reward;
        match picks.len() {
            4 => {
                let value = self.number()?;
                table.write(&picks, |_| value);
            }
            3 => {
                let row = self.numbers(k)?;
                table.write(&picks, |i| row[i[3]]);
            }
            2 => {
                let matrix = self.numbers(n * k)?;
                table.write(&picks, |i| matrix[i[2] * k + i[3]]);
            }
            _ if p.is_mdp => {
                let matrix = self.numbers(n * n)?;
                table.write(&picks, |i| matrix[i[1] * n + i[2]]);
            }
            _ => return self.wrong("':' and a state: 'R: a' alone is for models without O"),
        }
        Ok(())
    }

    fn probabilities(&mut self, count: usize) -> Result<Vec<f64>, ParseError> {
        (0..count).map(|_| self.probability()).collect()
    }

    fn numbers(&mut self, count: usize) -> Result<Vec<f64>, ParseError> {
        (0..count).map(|_| self.number()).collect()
    }
}

/// Notes where the rows (a, s) that `picks` cover were written.
fn note_rows(rows: &mut [Position], states: usize, picks: &[Pick], at: Position) {
    let (action, state) = (picks[0], picks.get(1).copied().flatten());
    for (row, position) in rows.iter_mut().enumerate() {
        if action.is_none_or(|a| a == row / states) && state.is_none_or(|s| s == row % states) {
            *position = at;
        }
    }
}
