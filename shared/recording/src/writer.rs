//! Frames as a file: what [`crate::frames::read`] reads.

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use flate2::Compression;
use flate2::write::GzEncoder;

use crate::table::TableError;

/// Text that is kept before it is written, bytes.
const KEPT: usize = 1 << 16;

/// A file of frames that is being written.
pub struct FrameWriter {
    path: PathBuf,
    out: Output,
    text: String,
}

enum Output {
    Plain(File),
    Compressed(GzEncoder<File>),
}

impl FrameWriter {
    /// A file with these columns after `run` and `t`; compressed if its name ends in `.gz`.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn create(path: &Path, columns: &[String]) -> Result<Self, TableError> {
        let file = File::create(path).map_err(|error| unwritten(path, error))?;
        let is_compressed = path.extension().is_some_and(|ending| ending == "gz");
        Ok(Self {
            path: path.to_path_buf(),
            out: if is_compressed {
                Output::Compressed(GzEncoder::new(file, Compression::default()))
            } else {
                Output::Plain(file)
            },
            text: format!("run,t,{}\n", columns.join(",")),
        })
    }

    /// Adds a row: a value for each column, none where nothing was measured.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn row(
        &mut self,
        run: u32,
        t_s: f64,
        values: impl IntoIterator<Item = Option<f64>>,
    ) -> Result<(), TableError> {
        self.text.push_str(&format!("{run},{}", rounded(t_s)));
        for value in values {
            self.text.push(',');
            if let Some(value) = value {
                self.text.push_str(&rounded(value).to_string());
            }
        }
        self.text.push('\n');
        match self.text.len() > KEPT {
            true => self.flush(),
            false => Ok(()),
        }
    }

    fn flush(&mut self) -> Result<(), TableError> {
        let written = match &mut self.out {
            Output::Plain(file) => file.write_all(self.text.as_bytes()),
            Output::Compressed(encoder) => encoder.write_all(self.text.as_bytes()),
        };
        self.text.clear();
        written.map_err(|error| unwritten(&self.path, error))
    }

    /// Writes what is left, to the disk.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn finish(mut self) -> Result<(), TableError> {
        self.flush()?;
        let finished = match self.out {
            Output::Plain(file) => file.sync_all(),
            Output::Compressed(encoder) => encoder.finish().and_then(|file| file.sync_all()),
        };
        finished.map_err(|error| unwritten(&self.path, error))
    }
}

fn unwritten(path: &Path, error: io::Error) -> TableError {
    TableError::Io {
        path: path.to_path_buf(),
        error,
    }
}

/// To twelve digits: finer than any sensor and any clock, and the text stays short.
fn rounded(value: f64) -> f64 {
    let digits = 11 - value.abs().max(1e-9).log10().floor() as i32;
    let scale = 10_f64.powi(digits);
    let rounded = (value * scale).round() / scale;
    if rounded.is_finite() { rounded } else { value }
}
