//! Reading of CSV tables, plain or gzip-compressed, with messages that name row and column.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use flate2::bufread::MultiGzDecoder;

/// Largest size of a decompressed table, bytes: a compressed file must not exhaust the memory.
const TABLE_BYTES_MAX: u64 = 4 << 30;

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

/// An open table: its header is read.
pub(crate) struct Table {
    path: PathBuf,
    reader: csv::Reader<Box<dyn Read>>,
    columns: Vec<String>,
    record: csv::StringRecord,
    row: u64,
}

impl Table {
    /// Opens a file; compression is recognised by its content.
    pub(crate) fn open(path: &Path) -> Result<Self, TableError> {
        let io = |error| TableError::Io {
            path: path.to_path_buf(),
            error,
        };
        let mut plain = BufReader::new(File::open(path).map_err(io)?);
        let compressed = plain.fill_buf().map_err(io)?.starts_with(&[0x1f, 0x8b]);
        let content: Box<dyn Read> = if compressed {
            Box::new(MultiGzDecoder::new(plain).take(TABLE_BYTES_MAX))
        } else {
            Box::new(plain.take(TABLE_BYTES_MAX))
        };
        Self::new(path, content)
    }

    /// Reads the header of `content`; `path` only names it.
    pub(crate) fn new(path: &Path, content: Box<dyn Read>) -> Result<Self, TableError> {
        let mut reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
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

    /// Positions of the columns, all of which must exist.
    pub(crate) fn require(&self, names: &[String]) -> Result<Vec<usize>, TableError> {
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
        Ok(names.iter().filter_map(|n| self.position(n)).collect())
    }

    /// Position of a column, if it exists.
    pub(crate) fn position(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|column| column == name)
    }

    /// Reads the next row; false at the end.
    pub(crate) fn advance(&mut self) -> Result<bool, TableError> {
        self.row += 1;
        self.reader
            .read_record(&mut self.record)
            .map_err(|e| wrong_row(&self.path, self.row, e.to_string()))
    }

    /// Text of a field of the present row.
    pub(crate) fn text(&self, column: usize) -> &str {
        self.record.get(column).unwrap_or("")
    }

    /// A finite number of the present row.
    pub(crate) fn number(&self, column: usize) -> Result<f64, TableError> {
        let text = self.text(column);
        match text.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => {
                let name = &self.columns[column];
                Err(self.wrong(format!("{name} is '{text}', allowed is a finite number")))
            }
        }
    }

    /// A whole number of the present row.
    pub(crate) fn whole(&self, column: usize) -> Result<u32, TableError> {
        let text = self.text(column);
        text.parse().map_err(|_| {
            let name = &self.columns[column];
            self.wrong(format!(
                "{name} is '{text}', allowed is a whole number from 0"
            ))
        })
    }

    /// An error about the present row.
    pub(crate) fn wrong(&self, message: String) -> TableError {
        wrong_row(&self.path, self.row, message)
    }
}

fn wrong_row(path: &Path, row: u64, message: String) -> TableError {
    TableError::Row {
        path: path.to_path_buf(),
        row,
        message,
    }
}
