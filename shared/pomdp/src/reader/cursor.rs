//! Walks over the tokens: one ahead, words and numbers, names and indices.

use std::collections::HashMap;

use super::lexer::{Lexer, PlacedToken, Token};
use super::limits::NAMES_MAX;
use crate::model::check_probability;
use crate::parse_error::{ParseError, Position};

/// Words with a meaning of their own; never names.
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

/// True if `word` cannot be a name.
pub(crate) fn is_reserved(word: &str) -> bool {
    RESERVED.contains(&word)
}

/// An index that is fixed, or all of them.
pub(super) type Pick = Option<usize>;

/// Names in their order, found by hash.
#[derive(Debug, Default)]
pub(super) struct Names {
    names: Vec<String>,
    index: HashMap<String, usize>,
}

impl Names {
    /// `0`, `1`, ...; they are found as numbers.
    pub(super) fn numbered(count: usize) -> Self {
        let names = (0..count).map(|i| i.to_string()).collect();
        let index = HashMap::new();
        Self { names, index }
    }

    /// Adds a name; false if it is there already.
    pub(super) fn add(&mut self, name: &str) -> bool {
        let next = self.names.len();
        if self.index.insert(name.to_owned(), next).is_some() {
            return false;
        }
        self.names.push(name.to_owned());
        true
    }

    /// How many.
    pub(super) fn len(&self) -> usize {
        self.names.len()
    }

    /// The name at an index; empty beyond the last.
    pub(super) fn name(&self, index: usize) -> &str {
        self.names.get(index).map_or("", String::as_str)
    }

    pub(super) fn into_names(self) -> Vec<String> {
        self.names
    }
}

/// A place in the text.
pub(super) struct Cursor<'a> {
    lexer: Lexer<'a>,
    ahead: PlacedToken<'a>,
}

impl<'a> Cursor<'a> {
    pub(super) fn new(text: &'a str) -> Result<Self, ParseError> {
        let mut lexer = Lexer::new(text)?;
        let ahead = lexer.next()?;
        Ok(Self { lexer, ahead })
    }

    /// The token that comes next.
    pub(super) const fn peek(&self) -> Token<'a> {
        self.ahead.token
    }

    /// Where it begins.
    pub(super) const fn at(&self) -> Position {
        self.ahead.at
    }

    /// The token after the next one.
    pub(super) fn peek_second(&self) -> Result<Token<'a>, ParseError> {
        Ok(self.lexer.clone().next()?.token)
    }

    /// Passes over a token.
    pub(super) fn take(&mut self) -> Result<Token<'a>, ParseError> {
        let token = self.ahead.token;
        self.ahead = self.lexer.next()?;
        Ok(token)
    }

    /// An error that says what is here, and what should be.
    pub(super) fn wrong<T>(&self, wanted: &str) -> Result<T, ParseError> {
        let found = match self.peek() {
            Token::Word(word) | Token::Number(word) => format!("'{word}'"),
            Token::Colon => "':'".to_owned(),
            Token::Star => "'*'".to_owned(),
            Token::Plus => "'+'".to_owned(),
            Token::Minus => "'-'".to_owned(),
            Token::End => "the end".to_owned(),
        };
        let message = format!("{found}, wanted is {wanted}");
        Err(ParseError::new(self.at(), message))
    }

    pub(super) fn colon(&mut self) -> Result<(), ParseError> {
        if self.peek() != Token::Colon {
            return self.wrong("':'");
        }
        self.take()?;
        Ok(())
    }

    /// Passes over `word` if it comes next.
    pub(super) fn accept(&mut self, word: &str) -> Result<bool, ParseError> {
        let found = self.peek() == Token::Word(word);
        if found {
            self.take()?;
        }
        Ok(found)
    }

    /// True at the end, or where T, O or R begins.
    pub(super) fn is_at_rule(&self) -> bool {
        begins_rule(self.peek())
    }

    /// True if exactly one number stands before the next rule: an index.
    pub(super) fn is_one_number(&self) -> Result<bool, ParseError> {
        Ok(begins_rule(self.peek_second()?))
    }

    /// A number, with an optional sign.
    pub(super) fn number(&mut self) -> Result<f64, ParseError> {
        let sign = match self.peek() {
            Token::Minus => -1.0,
            _ => 1.0,
        };
        if matches!(self.peek(), Token::Minus | Token::Plus) {
            self.take()?;
        }
        let at = self.at();
        let Token::Number(text) = self.peek() else {
            return self.wrong("a number");
        };
        self.take()?;
        match text.parse::<f64>() {
            // Never a negative zero.
            Ok(value) if value.is_finite() => Ok(sign * value + 0.0),
            _ => {
                let message = format!("'{text}' is not a finite number");
                Err(ParseError::new(at, message))
            }
        }
    }

    pub(super) fn probability(&mut self) -> Result<f64, ParseError> {
        let at = self.at();
        let p = self.number()?;
        check_probability(p).map_err(|message| ParseError::new(at, message))?;
        Ok(p)
    }

    /// `: 5`, or `: name name ...`.
    pub(super) fn names(&mut self) -> Result<Names, ParseError> {
        self.colon()?;
        let at = self.at();
        let check = |n: usize| {
            let message = || format!("{n} names, allowed are 1 to {NAMES_MAX}");
            let is_allowed = (1..=NAMES_MAX).contains(&n);
            is_allowed
                .then_some(())
                .ok_or_else(|| ParseError::new(at, message()))
        };
        if let Token::Number(text) = self.peek() {
            self.take()?;
            let wrong = |_| ParseError::new(at, format!("'{text}' is not a number of names"));
            let count = text.parse().map_err(wrong)?;
            check(count)?;
            return Ok(Names::numbered(count));
        }
        let mut names = Names::default();
        while let Token::Word(word) = self.peek() {
            if is_reserved(word) {
                break;
            }
            if !names.add(word) {
                let message = format!("'{word}' appears twice");
                return Err(ParseError::new(self.at(), message));
            }
            check(names.len())?;
            self.take()?;
        }
        if names.len() == 0 {
            return self.wrong("a number, or names");
        }
        Ok(names)
    }

    /// A name or an index.
    pub(super) fn one(&mut self, names: &Names, what: &str) -> Result<usize, ParseError> {
        if self.peek() == Token::Star {
            return self.wrong(&format!("one {what}, not all"));
        }
        // `*` was excluded.
        Ok(self.pick(names, what)?.unwrap_or_default())
    }

    /// A name, an index, or `*`.
    pub(super) fn pick(&mut self, names: &Names, what: &str) -> Result<Pick, ParseError> {
        let found = match self.peek() {
            Token::Star => Some(None),
            Token::Word(word) => names.index.get(word).map(|&i| Some(i)),
            Token::Number(text) => {
                let index = text.parse().ok().filter(|i| *i < names.len());
                index.map(Some)
            }
            _ => None,
        };
        let Some(pick) = found else {
            let count = names.len();
            return self.wrong(&format!("a {what}: a name, a number below {count}, or *"));
        };
        self.take()?;
        Ok(pick)
    }
}

const fn begins_rule(token: Token<'_>) -> bool {
    match token {
        Token::End => true,
        Token::Word(word) => matches!(word.as_bytes(), b"T" | b"O" | b"R"),
        _ => false,
    }
}
