//! Reading of CSV tables, plain or gzip-compressed, with messages that name row and column.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use flate2::bufread::MultiGzDecoder;

/// Largest size of a decompressed table, bytes: a compressed file must not exhaust the memory.
const TABLE_BYTES_MAX: u64 = 4 << 30;
/// Longest text of a field that a message repeats, characters.
const QUOTED_CHARS_MAX: usize = 40;

/// Why a table was refused. Rows count from 1, the header not included.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// The file cannot be read.
    #[error("{path}: {error}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        error: io::Error,
    },
    /// Columns are missing.
    #[error("{path}: missing columns {missing}; expected are {expected}")]
    Columns {
        /// The file.
        path: PathBuf,
        /// What is missing.
        missing: String,
        /// All columns that are needed.
        expected: String,
    },
    /// A column that is needed stands twice in the header: which one counts is not known.
    #[error("{path}: column {name} appears twice")]
    Repeated {
        /// The file.
        path: PathBuf,
        /// The column.
        name: String,
    },
    /// A row is malformed.
    #[error("{path}: row {row}: {message}")]
    Row {
        /// The file.
        path: PathBuf,
        /// Row, from 1.
        row: u64,
        /// What is wrong and what is allowed.
        message: String,
    },
}

/// Refuses content longer than a limit, where `Read::take` would pass off its first part as whole.
struct LimitedReader<R> {
    content: R,
    /// Bytes that may still come.
    left: u64,
}

impl<R: Read> Read for LimitedReader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.content.read(buffer)?;
        self.left = self.left.checked_sub(count as u64).ok_or_else(|| {
            let message = format!("larger than {TABLE_BYTES_MAX} bytes, which are allowed");
            io::Error::new(io::ErrorKind::FileTooLarge, message)
        })?;
        Ok(count)
    }
}

/// How a table is laid out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// Separator of columns.
    pub delimiter: u8,
    /// Rows before the one that names the columns.
    pub skip_rows: usize,
}

impl Default for Layout {
    fn default() -> Self {
        Self {
            delimiter: b',',
            skip_rows: 0,
        }
    }
}

/// An open table: its header is read.
pub struct Table {
    path: PathBuf,
    reader: csv::Reader<Box<dyn Read>>,
    columns: Vec<String>,
    record: csv::StringRecord,
    row: u64,
}

impl Table {
    /// Opens a file; compression is recognised by its content.
    ///
    /// # Errors
    /// A file that cannot be read, or without a header.
    pub fn open(path: &Path) -> Result<Self, TableError> {
        Self::open_as(path, Layout::default())
    }

    /// Opens a file of another layout.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn open_as(path: &Path, layout: Layout) -> Result<Self, TableError> {
        let io = |error| TableError::Io {
            path: path.to_path_buf(),
            error,
        };
        let mut plain = BufReader::new(File::open(path).map_err(io)?);
        let compressed = plain.fill_buf().map_err(io)?.starts_with(&[0x1f, 0x8b]);
        let content: Box<dyn Read> = if compressed {
            Box::new(MultiGzDecoder::new(plain))
        } else {
            Box::new(plain)
        };
        let left = TABLE_BYTES_MAX;
        let mut content = BufReader::new(LimitedReader { content, left });
        let mut skipped = Vec::new();
        for _ in 0..layout.skip_rows {
            skipped.clear();
            content.read_until(b'\n', &mut skipped).map_err(io)?;
        }
        Self::delimited(path, Box::new(content), layout.delimiter)
    }

    /// Reads the header of `content`; `path` only names it.
    #[cfg(test)]
    pub fn new(path: &Path, content: Box<dyn Read>) -> Result<Self, TableError> {
        Self::delimited(path, content, b',')
    }

    fn delimited(path: &Path, content: Box<dyn Read>, by: u8) -> Result<Self, TableError> {
        let mut reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .delimiter(by)
            .from_reader(content);
        let headers = reader
            .headers()
            .map_err(|e| wrong_row(path, 0, e.to_string()))?;
        let columns = headers.iter().map(str::to_owned).collect();
        let record = csv::StringRecord::new();
        Ok(Self {
            path: path.to_path_buf(),
            reader,
            columns,
            record,
            row: 0,
        })
    }

    /// Positions of the columns, each of which must exist, and once.
    ///
    /// # Errors
    /// Columns that are missing, or stand twice.
    pub fn require(&self, names: &[String]) -> Result<Vec<usize>, TableError> {
        let missing: Vec<&str> = names
            .iter()
            .filter(|n| self.position(n).is_none())
            .map(String::as_str)
            .collect();
        if !missing.is_empty() {
            return Err(TableError::Columns {
                path: self.path.clone(),
                missing: missing.join(", "),
                expected: names.join(", "),
            });
        }
        let times = |name: &String| self.columns.iter().filter(|c| *c == name).count();
        if let Some(name) = names.iter().find(|name| times(name) > 1) {
            let (path, name) = (self.path.clone(), name.clone());
            return Err(TableError::Repeated { path, name });
        }
        Ok(names.iter().filter_map(|n| self.position(n)).collect())
    }

    /// Names of all columns, as they stand in the file.
    pub fn columns(&self) -> &[String] {
        &self.columns
    }

    /// Position of a column, if it exists.
    pub fn position(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|column| column == name)
    }

    /// Reads the next row; false at the end.
    ///
    /// # Errors
    /// A row that is no row of this table.
    pub fn advance(&mut self) -> Result<bool, TableError> {
        self.row += 1;
        self.reader
            .read_record(&mut self.record)
            .map_err(|e| wrong_row(&self.path, self.row, e.to_string()))
    }

    /// Text of a field of the present row.
    pub fn text(&self, column: usize) -> &str {
        self.record.get(column).unwrap_or("")
    }

    /// A finite number of the present row.
    ///
    /// # Errors
    /// Text that is none.
    pub fn number(&self, column: usize) -> Result<f64, TableError> {
        let text = self.text(column);
        match text.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => {
                let (name, text) = (&self.columns[column], quoted(text));
                Err(self.wrong(format!("{name} is '{text}', allowed is a finite number")))
            }
        }
    }

    /// A whole number of the present row.
    ///
    /// # Errors
    /// Text that is none.
    pub fn whole(&self, column: usize) -> Result<u32, TableError> {
        let text = self.text(column);
        text.parse().map_err(|_| {
            let (name, text) = (&self.columns[column], quoted(text));
            self.wrong(format!(
                "{name} is '{text}', allowed is a whole number from 0"
            ))
        })
    }

    /// An error about the present row.
    pub fn wrong(&self, message: String) -> TableError {
        wrong_row(&self.path, self.row, message)
    }
}

/// Text from a file as a message may show it on a terminal: short, without control characters.
pub fn quoted(text: &str) -> String {
    let mut shown: String = text.chars().take(QUOTED_CHARS_MAX).collect();
    if shown.len() < text.len() {
        shown.push_str("...");
    }
    shown.replace(char::is_control, "?")
}

/// The refusal of a row, which counts from 1 without the header.
pub fn wrong_row(path: &Path, row: u64, message: String) -> TableError {
    TableError::Row {
        path: path.to_path_buf(),
        row,
        message,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &'static str) -> Table {
        Table::new(Path::new("a.csv"), Box::new(text.as_bytes())).unwrap()
    }

    #[test]
    fn content_at_the_limit_is_read_and_beyond_it_refused() {
        let read = |left: u64| {
            let mut text = String::new();
            let content = &b"0123456789"[..];
            LimitedReader { content, left }
                .read_to_string(&mut text)
                .map(|_| text)
        };
        assert_eq!(read(10).unwrap(), "0123456789");
        assert_eq!(read(9).unwrap_err().kind(), io::ErrorKind::FileTooLarge);
    }

    #[test]
    fn a_needed_column_that_appears_twice_is_refused() {
        let table = table("t,x,t,x,y\n");
        assert_eq!(table.require(&["y".to_owned()]).unwrap(), [4]);
        let error = table.require(&["y".to_owned(), "x".to_owned()]);
        assert_eq!(
            error.unwrap_err().to_string(),
            "a.csv: column x appears twice"
        );
    }

    #[test]
    fn messages_repeat_no_long_text_and_no_control_characters() {
        assert_eq!(quoted("12,5"), "12,5");
        assert_eq!(quoted("\x1b[2J"), "?[2J");
        assert_eq!(quoted(&"x".repeat(40)), "x".repeat(40));
        assert_eq!(quoted(&"y".repeat(41)), format!("{}...", "y".repeat(40)));
    }
}
