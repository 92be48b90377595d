//! Recordings of ROS 2 message by message: MCAP, and rosbag2's SQLite (`.db3`), plain or under
//! zstd (`.db3.zstd`, `.mcap.zstd`).

use std::collections::BTreeMap;
use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};

use rusqlite::{Connection, MAIN_DB};
use vigil_recording::table::wrong_row;

use super::ImportError;

/// Largest file that is read, bytes, also after decompression.
const FILE_BYTES_MAX: u64 = 4 << 30;
/// First bytes of a SQLite file, as its format says.
const SQLITE_MARK: &[u8] = b"SQLite format 3\0";
/// First bytes of a zstd frame (RFC 8878).
const ZSTD_MARK: &[u8] = &[0x28, 0xb5, 0x2f, 0xfd];

/// One message of a recording.
pub(super) struct BagMessage<'a> {
    /// Its topic.
    pub topic: &'a str,
    /// Its type: `nav_msgs/msg/Odometry`.
    pub kind: &'a str,
    /// What the recording says its type is; empty if it says nothing.
    pub definition: &'a str,
    /// When it was recorded, ns.
    pub log_time_ns: u64,
    /// The message in CDR, its encapsulation included.
    pub data: &'a [u8],
}

/// A recording that ends in the middle, as after a loss of power: what comes before is used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CutBag {
    /// The file.
    pub path: PathBuf,
    /// Messages that were read, of all topics.
    pub messages: u64,
    /// What was found at its end.
    pub found: String,
}

/// Hands every message to `take`: of a file, in its order, or of all files of a rosbag2 folder, one
/// after the other. Says which file is cut off.
///
/// # Errors
/// A file that cannot be read, or is no recording; what `take` returns.
pub(super) fn visit(
    path: &Path,
    take: &mut dyn FnMut(&BagMessage<'_>) -> Result<(), ImportError>,
) -> Result<Option<CutBag>, ImportError> {
    let mut cut = None;
    for file in files(path)? {
        let content = content(&file)?;
        let found = match content.starts_with(SQLITE_MARK) {
            true => visit_sqlite(&file, &content, take).map(|()| None),
            false => visit_mcap(&file, &content, take),
        };
        cut = cut.or(found?);
    }
    Ok(cut)
}

/// The file itself; of a folder its recordings, as rosbag2 numbers them: `drive_2` before
/// `drive_10`.
fn files(path: &Path) -> Result<Vec<PathBuf>, ImportError> {
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let io = |error| ImportError::Io {
        path: path.to_owned(),
        error,
    };
    let mut found = Vec::new();
    for entry in fs::read_dir(path).map_err(io)? {
        let name = entry
            .map_err(io)?
            .file_name()
            .to_string_lossy()
            .into_owned();
        let stem = name.strip_suffix(".zstd").unwrap_or(&name);
        let stem = stem.strip_suffix(".mcap").or(stem.strip_suffix(".db3"));
        if let Some(stem) = stem {
            let number = stem
                .rsplit('_')
                .next()
                .and_then(|end| end.parse::<u64>().ok());
            found.push((number, name));
        }
    }
    found.sort();
    if found.is_empty() {
        let message = "no .mcap or .db3 file is in this folder".to_owned();
        return Err(wrong_row(path, 0, message).into());
    }
    Ok(found.into_iter().map(|(_, name)| path.join(name)).collect())
}

/// The bytes of a file, decompressed.
fn content(path: &Path) -> Result<Vec<u8>, ImportError> {
    let io = |error| ImportError::Io {
        path: path.to_owned(),
        error,
    };
    let too_large = |bytes: u64| -> ImportError {
        let message = format!("{bytes} bytes: allowed are {FILE_BYTES_MAX}");
        wrong_row(path, 0, message).into()
    };
    let bytes = fs::metadata(path).map_err(io)?.len();
    if bytes > FILE_BYTES_MAX {
        return Err(too_large(bytes));
    }
    let content = fs::read(path).map_err(io)?;
    if !content.starts_with(ZSTD_MARK) {
        return Ok(content);
    }
    let mut plain = Vec::new();
    let decoder = zstd::stream::Decoder::new(content.as_slice()).map_err(io)?;
    let bytes = decoder.take(FILE_BYTES_MAX + 1).read_to_end(&mut plain);
    match bytes.map_err(io)? as u64 {
        bytes if bytes > FILE_BYTES_MAX => Err(too_large(bytes)),
        _ => Ok(plain),
    }
}

fn visit_mcap(
    path: &Path,
    content: &[u8],
    take: &mut dyn FnMut(&BagMessage<'_>) -> Result<(), ImportError>,
) -> Result<Option<CutBag>, ImportError> {
    let wrong = |row: u64, message: String| ImportError::from(wrong_row(path, row, message));
    let foreign = |error: mcap::McapError| -> ImportError {
        wrong(0, format!("neither MCAP nor SQLite of rosbag2: {error}"))
    };
    let stream = mcap::MessageStream::new(content).map_err(foreign)?;
    for (messages, message) in (0_u64..).zip(stream) {
        let message = match message {
            Ok(message) => message,
            Err(error) if messages > 0 && is_cut(&error) => {
                return Ok(Some(CutBag {
                    path: path.to_owned(),
                    messages,
                    found: error.to_string(),
                }));
            }
            Err(error) if messages == 0 => return Err(foreign(error)),
            Err(error) => return Err(wrong(messages, error.to_string())),
        };
        let kind = message.channel.schema.as_ref();
        // Of the languages of definitions only that of `.msg` files is read.
        let definition = kind.filter(|schema| schema.encoding == "ros2msg");
        let definition = definition.and_then(|schema| std::str::from_utf8(&schema.data).ok());
        take(&BagMessage {
            topic: &message.channel.topic,
            kind: kind.map_or("", |schema| schema.name.as_str()),
            definition: definition.unwrap_or(""),
            log_time_ns: message.log_time,
            data: &message.data,
        })?;
    }
    Ok(None)
}

/// True for what is found where a file was cut off.
const fn is_cut(error: &mcap::McapError) -> bool {
    use mcap::McapError as Error;
    matches!(
        error,
        Error::UnexpectedEof
            | Error::UnexpectedEoc
            | Error::BadMagic
            | Error::BadChunkLength { .. }
            | Error::DecompressionError(_)
    )
}

fn visit_sqlite(
    path: &Path,
    content: &[u8],
    take: &mut dyn FnMut(&BagMessage<'_>) -> Result<(), ImportError>,
) -> Result<(), ImportError> {
    let wrong = |error: rusqlite::Error| -> ImportError {
        let message = format!("no readable SQLite recording of rosbag2: {error}");
        wrong_row(path, 0, message).into()
    };
    let mut bag = Connection::open_in_memory().map_err(wrong)?;
    bag.deserialize_read_exact(MAIN_DB, content, content.len(), true)
        .map_err(wrong)?;
    let definitions = definitions(&bag);
    let mut rows = bag
        .prepare(
            "SELECT topics.name, topics.type, messages.timestamp, messages.data FROM messages \
             JOIN topics ON topics.id = messages.topic_id ORDER BY messages.timestamp, messages.id",
        )
        .map_err(wrong)?;
    let mut rows = rows.query([]).map_err(wrong)?;
    while let Some(row) = rows.next().map_err(wrong)? {
        let text = |i: usize| row.get_ref(i)?.as_str().map_err(rusqlite::Error::from);
        let data = row.get_ref(3).map_err(wrong)?.as_blob();
        let kind = text(1).map_err(wrong)?;
        take(&BagMessage {
            topic: text(0).map_err(wrong)?,
            kind,
            definition: definitions.get(kind).map_or("", String::as_str),
            log_time_ns: row.get::<_, i64>(2).map_err(wrong)?.max(0) as u64,
            data: data.map_err(|error| wrong(error.into()))?,
        })?;
    }
    Ok(())
}

/// Definitions of types, which newer recordings of rosbag2 carry; older ones have no such table.
fn definitions(bag: &Connection) -> BTreeMap<String, String> {
    let sql = "SELECT topic_type, encoded_message_definition FROM message_definitions \
               WHERE encoding = 'ros2msg'";
    let Ok(mut rows) = bag.prepare(sql) else {
        return BTreeMap::new();
    };
    let pair = |row: &rusqlite::Row<'_>| Ok((row.get(0)?, row.get(1)?));
    match rows.query_map([], pair) {
        Ok(found) => found.filter_map(Result::ok).collect(),
        Err(_) => BTreeMap::new(),
    }
}
