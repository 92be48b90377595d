//! Frames as a file.

use std::fs::File;
use std::io::Write;
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;

use super::{ImportError, ImportedLog};

/// Writes the frames as CSV, compressed if the name ends in `.gz`.
///
/// # Errors
/// [`ImportError::Io`].
pub fn write(imported: &ImportedLog, path: &Path) -> Result<(), ImportError> {
    let io = |error| ImportError::Io {
        path: path.to_path_buf(),
        error,
    };
    let file = File::create(path).map_err(io)?;
    if path.extension().is_some_and(|ending| ending == "gz") {
        let mut encoder = GzEncoder::new(file, Compression::default());
        rows(imported, &mut encoder).map_err(io)?;
        encoder.finish().map_err(io)?.sync_all().map_err(io)
    } else {
        let mut file = file;
        rows(imported, &mut file).map_err(io)?;
        file.sync_all().map_err(io)
    }
}

fn rows(imported: &ImportedLog, out: &mut impl Write) -> std::io::Result<()> {
    let mut text = format!("run,t,{}\n", imported.columns.join(","));
    for run in &imported.runs {
        for row in &run.rows {
            text.push_str(&run.id.to_string());
            for value in row {
                text.push_str(&format!(",{}", rounded(*value)));
            }
            text.push('\n');
            if text.len() > 1 << 16 {
                out.write_all(text.as_bytes())?;
                text.clear();
            }
        }
    }
    out.write_all(text.as_bytes())
}

/// To a millionth: finer than any sensor, and the text stays short.
fn rounded(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}
