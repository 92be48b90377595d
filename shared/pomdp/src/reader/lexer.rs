//! Words, numbers and signs of a `.pomdp` text. New lines mean nothing; `#` comments a line out.

use super::limits;
use crate::parse_error::{ParseError, Position};

/// A piece of the text.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Token<'a> {
    /// Letters, digits, `-`, `_`, beginning with a letter.
    Word(&'a str),
    /// Digits with an optional fraction and exponent; no sign.
    Number(&'a str),
    Colon,
    Star,
    Plus,
    Minus,
    End,
}

/// A token and where it begins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PlacedToken<'a> {
    pub token: Token<'a>,
    pub at: Position,
}

/// Reads one token after the other.
#[derive(Debug, Clone)]
pub(super) struct Lexer<'a> {
    text: &'a str,
    byte: usize,
    at: Position,
}

impl<'a> Lexer<'a> {
    /// Begins at the start of a text; a byte order mark is passed over.
    pub(super) fn new(text: &'a str) -> Result<Self, ParseError> {
        let at = Position { line: 1, column: 1 };
        let bytes = Some(text.len());
        limits::check(bytes, limits::TEXT_BYTES_MAX, at, "bytes of text")?;
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        Ok(Self { text, byte: 0, at })
    }

    /// The next token; [`Token::End`] again and again at the end.
    pub(super) fn next(&mut self) -> Result<PlacedToken<'a>, ParseError> {
        self.skip_space();
        let at = self.at;
        let token = self.token()?;
        Ok(PlacedToken { token, at })
    }

    fn rest(&self) -> &'a str {
        &self.text[self.byte..]
    }

    fn take(&mut self, length: usize) -> &'a str {
        let taken = &self.text[self.byte..self.byte + length];
        self.byte += length;
        self.at.column += taken.chars().count();
        taken
    }

    fn skip_space(&mut self) {
        while let Some(c) = self.rest().chars().next() {
            if c == '#' {
                let end = self.rest().find(['\n', '\r']);
                self.take(end.unwrap_or(self.rest().len()));
            } else if c == '\n' || c == '\r' {
                // A line ends with LF, CR LF or CR.
                self.byte += if self.rest().starts_with("\r\n") {
                    2
                } else {
                    1
                };
                self.at = Position {
                    line: self.at.line + 1,
                    column: 1,
                };
            } else if c.is_whitespace() {
                self.take(c.len_utf8());
            } else {
                return;
            }
        }
    }

    fn token(&mut self) -> Result<Token<'a>, ParseError> {
        let at = self.at;
        let Some(c) = self.rest().chars().next() else {
            return Ok(Token::End);
        };
        let word = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        Ok(match c {
            ':' => self.single(Token::Colon),
            '*' => self.single(Token::Star),
            '+' => self.single(Token::Plus),
            '-' => self.single(Token::Minus),
            c if c.is_ascii_alphabetic() => {
                let length = self.rest().find(|c| !word(c)).unwrap_or(self.rest().len());
                Token::Word(self.take(length))
            }
            c if c.is_ascii_digit() || c == '.' => Token::Number(self.number()),
            c => return Err(ParseError::new(at, format!("'{c}' has no meaning here"))),
        })
    }

    fn single(&mut self, token: Token<'a>) -> Token<'a> {
        self.take(1);
        token
    }

    fn number(&mut self) -> &'a str {
        let bytes = self.rest().as_bytes();
        let digits = |mut i: usize| {
            while bytes.get(i).is_some_and(u8::is_ascii_digit) {
                i += 1;
            }
            i
        };
        let mut end = digits(0);
        if bytes.get(end) == Some(&b'.') {
            end = digits(end + 1);
        }
        if matches!(bytes.get(end), Some(b'e' | b'E')) {
            let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
            if bytes.get(end + 1 + sign).is_some_and(u8::is_ascii_digit) {
                end = digits(end + 1 + sign);
            }
        }
        self.take(end)
    }
}
