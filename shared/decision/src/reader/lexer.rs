//! Words, numbers and signs of a `.pomdp` text. New lines mean nothing; `#` comments a line out.

use super::{ParseError, Position};

/// Longest text that is read, bytes.
const TEXT_BYTES_MAX: usize = 256 << 20;

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
pub(super) struct Placed<'a> {
    pub token: Token<'a>,
    pub at: Position,
}

/// Splits a text into tokens; the last is [`Token::End`].
pub(super) fn tokens(text: &str) -> Result<Vec<Placed<'_>>, ParseError> {
    let mut lexer = Lexer {
        text,
        byte: 0,
        at: Position { line: 1, column: 1 },
    };
    if text.len() > TEXT_BYTES_MAX {
        let message = format!("{} bytes, allowed are {TEXT_BYTES_MAX}", text.len());
        return Err(ParseError::new(lexer.at, message));
    }
    let mut all = Vec::new();
    loop {
        lexer.skip_space();
        let at = lexer.at;
        let token = lexer.next()?;
        all.push(Placed { token, at });
        if token == Token::End {
            return Ok(all);
        }
    }
}

struct Lexer<'a> {
    text: &'a str,
    byte: usize,
    at: Position,
}

impl<'a> Lexer<'a> {
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
                let length = self.rest().find('\n').unwrap_or(self.rest().len());
                self.take(length);
            } else if c == '\n' {
                self.byte += 1;
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

    fn next(&mut self) -> Result<Token<'a>, ParseError> {
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
