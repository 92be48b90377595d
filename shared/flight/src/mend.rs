//! A recording that was cut short, made whole for readers that need an end.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufReader, BufWriter, Read, Seek, SeekFrom};
use std::path::Path;

use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::write::{Metadata, NoSeek};
use mcap::{Attachment, McapError, Writer, parse_record};

use crate::container::options;
use crate::error::FlightError;
use crate::reader::{ABOUT, CUT, FlightReader, RECORD_BYTES_MAX, is_attachment_whole};

/// Size from which a chunk is closed, bytes.
const CHUNK_BYTES: u64 = 1 << 20;

/// What was made of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mended {
    /// Messages that were copied.
    pub messages: u64,
    /// What is wrong where the copy ends; `None` where the file ends.
    pub damage: Option<String>,
}

/// True of a file that ends as a whole one does.
///
/// # Errors
/// The file system's.
pub fn has_end(path: &Path) -> io::Result<bool> {
    let mut file = File::open(path)?;
    let magic = mcap::MAGIC;
    let Ok(from_end) = file.seek(SeekFrom::End(-(magic.len() as i64))) else {
        return Ok(false);
    };
    let mut end = Vec::new();
    file.read_to_end(&mut end)?;
    Ok(from_end > 0 && end == magic)
}

/// Copies what can be read of a recording to a file with an end and an index, which says that it
/// was cut short. A file at `to` is replaced.
///
/// # Errors
/// A file that cannot be read or written, that is no recording of Vigil, that is whole, or of which
/// nothing is whole; then no copy is left.
pub fn mend(from: &Path, to: &Path) -> Result<Mended, FlightError> {
    let unreadable = |source| FlightError::Unreadable {
        path: from.to_owned(),
        source,
    };
    let unwritten = |source| FlightError::File {
        path: to.to_owned(),
        source,
    };
    // Refuses other programs' files.
    drop(FlightReader::open(from)?);
    let source = BufReader::new(File::open(from).map_err(unreadable)?);
    let file = File::create(to).map_err(unwritten)?;
    let copied = copy(source, &file).map_err(|error| match error {
        CopyError::Read(source) => unreadable(source),
        CopyError::Write(McapError::Io(source)) => unwritten(source),
        CopyError::Write(source) => FlightError::Container {
            path: to.to_owned(),
            source,
        },
    });
    let mended = copied.and_then(|copied| match copied {
        None => Err(FlightError::Whole {
            path: from.to_owned(),
        }),
        Some(Mended { messages: 0, .. }) => Err(FlightError::Damaged {
            path: from.to_owned(),
            what: "nothing in it is whole".to_owned(),
        }),
        Some(mended) => file.sync_all().map_err(unwritten).map(|()| mended),
    });
    if mended.is_err() {
        let _ = fs::remove_file(to);
    }
    mended
}

/// Which side failed.
enum CopyError {
    Read(io::Error),
    Write(McapError),
}

/// Copies records until one is not whole or not sound; `None` if all were, and the end was there.
fn copy(mut source: impl Read, file: &File) -> Result<Option<Mended>, CopyError> {
    let chunks = options().chunk_size(Some(CHUNK_BYTES));
    let stream = NoSeek::new(BufWriter::new(file));
    let mut copy = chunks.create(stream).map_err(CopyError::Write)?;
    let limit = LinearReaderOptions::default().with_record_length_limit(RECORD_BYTES_MAX);
    let mut records = LinearReader::new_with_options(limit.with_prevalidate_chunk_crcs(true));
    let mut messages = 0;
    let damage = loop {
        match records.next_event() {
            None => return Ok(None),
            // There is no end.
            Some(Err(McapError::UnexpectedEof)) => break None,
            Some(Err(error)) => break Some(error.to_string()),
            Some(Ok(LinearReadEvent::ReadRequest(bytes))) => {
                match source.read(records.insert(bytes)) {
                    Ok(bytes) => records.notify_read(bytes),
                    Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                    Err(error) => return Err(CopyError::Read(error)),
                }
            }
            Some(Ok(LinearReadEvent::Record { data, opcode })) => {
                if opcode == op::ATTACHMENT && !is_attachment_whole(data) {
                    break Some("an attachment is not whole".to_owned());
                }
                match parse_record(opcode, data).and_then(|record| add(&mut copy, record)) {
                    Err(McapError::Io(error)) => return Err(CopyError::Write(error.into())),
                    Err(error) => break Some(error.to_string()),
                    Ok(()) => messages += u64::from(opcode == op::MESSAGE),
                }
            }
        }
    };
    copy.write_metadata(&Metadata {
        name: ABOUT.to_owned(),
        metadata: BTreeMap::from([(CUT.to_owned(), "true".to_owned())]),
    })
    .map_err(CopyError::Write)?;
    copy.finish().map_err(CopyError::Write)?;
    Ok(Some(Mended { messages, damage }))
}

/// Adds a record; the copy has an index, numbers and an end of its own.
fn add(copy: &mut Writer<NoSeek<BufWriter<&File>>>, record: Record<'_>) -> Result<(), McapError> {
    match record {
        Record::Schema { header, data } => copy
            .add_schema_with_id(header.id, &header.name, &header.encoding, &data)
            .map(|_| ()),
        Record::Channel(it) => copy
            .add_channel_with_id(
                it.id,
                it.schema_id,
                &it.topic,
                &it.message_encoding,
                &it.metadata,
            )
            .map(|_| ()),
        Record::Message { header, data } => copy.write_to_known_channel(&header, &data),
        Record::Metadata(found) => copy.write_metadata(&found),
        Record::Attachment { header, data, .. } => copy.attach(&Attachment {
            log_time: header.log_time,
            create_time: header.create_time,
            name: header.name,
            media_type: header.media_type,
            data,
        }),
        _ => Ok(()),
    }
}
