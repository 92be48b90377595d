//! Blocks and events of a recording, one after the other.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::ops::Range;
use std::path::{Path, PathBuf};

use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{McapError, parse_record};
use vigil_cycle::topic::Topic;
use vigil_setup::{Document, Setup};
use vigil_timeline::TimelineEntry;

use crate::container::{FOREIGN, LIBRARY, RAW};
use crate::error::FlightError;

/// Largest record that is read, bytes. A chunk has some 1 MiB, and so has the graph's document.
pub(crate) const RECORD_BYTES_MAX: usize = 64 << 20;
/// Code and length that stand before each record, bytes.
const RECORD_HEAD: usize = 9;
/// What stands in a chunk before its records, if it is not compressed, bytes.
const CHUNK_HEAD: usize = 40;
/// The attachment that holds what the graph ran on.
const DOCUMENT: &str = "document.toml";
/// The metadata that say why the file was written.
pub(crate) const ABOUT: &str = "vigil";
/// What they say of a file that was cut short, and has an end since.
pub(crate) const CUT: &str = "cut";

/// One thing that was recorded. Times are since 1970.
#[derive(Debug, Clone, PartialEq)]
pub enum Recorded<'a> {
    /// A block, as it was published. [`crate::read_block`] reads it.
    Block {
        /// Where it was published.
        topic: Topic,
        /// When, ns.
        log_time_ns: u64,
        /// Its bytes.
        bytes: &'a [u8],
    },
    /// An event.
    Event {
        /// When it happened, ns.
        log_time_ns: u64,
        /// What.
        entry: Box<TimelineEntry>,
    },
}

/// What a channel holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Content {
    Blocks(Topic),
    Events,
    /// Blocks of another version.
    Foreign,
}

/// Where a message stands in the chunk.
struct Message {
    content: Content,
    log_time_ns: u64,
    data: Range<usize>,
}

/// Reads a recording that [`crate::FlightWriter`] wrote, a chunk at a time.
///
/// A file that was cut short is read up to its last whole chunk.
pub struct FlightReader {
    path: PathBuf,
    file: BufReader<File>,
    records: LinearReader,
    channels: BTreeMap<u16, Content>,
    /// Records of the present chunk.
    chunk: Vec<u8>,
    /// Where the next of them begins.
    at: usize,
    document: Option<String>,
    about: BTreeMap<String, String>,
    is_ours: bool,
    is_cut: bool,
    is_over: bool,
    foreign_count: u64,
}

/// What a channel of this name holds; `None` for what follows from other channels.
fn content(name: &str) -> Option<Content> {
    if name.starts_with(FOREIGN) {
        return Some(Content::Foreign);
    }
    let topic = name.strip_prefix(RAW)?;
    if topic == "events" {
        return Some(Content::Events);
    }
    let topic = Topic::ALL.iter().find(|it| it.name() == topic);
    Some(topic.map_or(Content::Foreign, |topic| Content::Blocks(*topic)))
}

/// True if an attachment has room for all that it says it has. The container's own reader takes
/// this for granted.
pub(crate) fn is_attachment_whole(bytes: &[u8]) -> bool {
    // Two times; then name and type, each after its length; then length and checksum.
    let skip_text = |at: usize| {
        let length = bytes.get(at..at.checked_add(4)?)?.try_into().ok()?;
        at.checked_add(4 + u32::from_le_bytes(length) as usize)
    };
    let end = skip_text(16).and_then(skip_text);
    end.and_then(|end| end.checked_add(12))
        .is_some_and(|end| end <= bytes.len())
}

impl FlightReader {
    /// Opens a recording, and reads what stands before its first block.
    ///
    /// # Errors
    /// The file cannot be read, is no MCAP file, or is no recording of Vigil.
    pub fn open(path: &Path) -> Result<Self, FlightError> {
        let unreadable = |source| FlightError::Unreadable {
            path: path.to_owned(),
            source,
        };
        let mut file = BufReader::new(File::open(path).map_err(unreadable)?);
        let mut magic = Vec::new();
        let mut head = (&mut file).take(mcap::MAGIC.len() as u64);
        head.read_to_end(&mut magic).map_err(unreadable)?;
        if magic != mcap::MAGIC {
            return Err(FlightError::NotMcap {
                path: path.to_owned(),
            });
        }
        let options = LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_emit_chunks(true)
            .with_record_length_limit(RECORD_BYTES_MAX);
        let mut reader = Self {
            path: path.to_owned(),
            file,
            records: LinearReader::new_with_options(options),
            channels: BTreeMap::new(),
            chunk: Vec::new(),
            at: 0,
            document: None,
            about: BTreeMap::new(),
            is_ours: false,
            is_cut: false,
            is_over: false,
            foreign_count: 0,
        };
        reader.next_chunk()?;
        reader.look_for_channels()?;
        match reader.is_ours {
            true => Ok(reader),
            false => Err(FlightError::NotOfVigil { path: reader.path }),
        }
    }

    /// What the graph ran on, if it was recorded: the text that `vigil_setup::Document` reads.
    #[must_use]
    pub fn document(&self) -> Option<&str> {
        self.document.as_deref()
    }

    /// What the graph ran on.
    ///
    /// # Errors
    /// It was not recorded, or is not what this version reads.
    pub fn setup(&self) -> Result<Setup, FlightError> {
        let text = self
            .document
            .clone()
            .ok_or_else(|| FlightError::NoDocument {
                path: self.path.clone(),
            })?;
        let document = Document::from_text(&self.path, text);
        let setup = document.and_then(|document| document.check());
        setup.map_err(|source| FlightError::Document { source })
    }

    /// Why the file was written, by name. Before the end it may be less than at the end.
    #[must_use]
    pub const fn about(&self) -> &BTreeMap<String, String> {
        &self.about
    }

    /// True once the file was found to end before its end, or to have been cut short before it was
    /// mended.
    #[must_use]
    pub fn is_cut(&self) -> bool {
        self.is_cut || self.about.contains_key(CUT)
    }

    /// How many blocks and events of another version were passed over so far.
    #[must_use]
    pub const fn foreign_count(&self) -> u64 {
        self.foreign_count
    }

    /// The next block or event, in the order of the file; `None` at its end.
    ///
    /// # Errors
    /// The file cannot be read, or is damaged. Nothing follows then.
    #[expect(clippy::should_implement_trait)] // An item borrows from the reader.
    pub fn next(&mut self) -> Result<Option<Recorded<'_>>, FlightError> {
        loop {
            let Some(message) = self.next_message()? else {
                if self.is_over {
                    return Ok(None);
                }
                self.next_chunk()?;
                continue;
            };
            let log_time_ns = message.log_time_ns;
            match message.content {
                Content::Blocks(topic) => {
                    let bytes = self.chunk.get(message.data).unwrap_or_default();
                    return Ok(Some(Recorded::Block {
                        topic,
                        log_time_ns,
                        bytes,
                    }));
                }
                Content::Events => {
                    let bytes = self.chunk.get(message.data).unwrap_or_default();
                    if let Ok(entry) = serde_json::from_slice(bytes) {
                        let entry = Box::new(entry);
                        return Ok(Some(Recorded::Event { log_time_ns, entry }));
                    }
                    self.foreign_count += 1;
                }
                Content::Foreign => self.foreign_count += 1,
            }
        }
    }

    fn damaged(&mut self, what: impl ToString) -> FlightError {
        self.is_over = true;
        (self.chunk, self.at) = (Vec::new(), 0);
        FlightError::Damaged {
            path: self.path.clone(),
            what: what.to_string(),
        }
    }

    /// Reads until there is another chunk, or nothing more.
    fn next_chunk(&mut self) -> Result<(), FlightError> {
        self.chunk.clear();
        self.at = 0;
        while self.chunk.is_empty() && !self.is_over {
            let found = match self.records.next_event() {
                None => {
                    self.is_over = true;
                    continue;
                }
                Some(Ok(LinearReadEvent::ReadRequest(count))) => {
                    let read = self.file.read(self.records.insert(count));
                    match read {
                        Ok(count) => self.records.notify_read(count),
                        Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                        Err(source) => {
                            self.is_over = true;
                            let path = self.path.clone();
                            return Err(FlightError::Unreadable { path, source });
                        }
                    }
                    continue;
                }
                Some(Ok(LinearReadEvent::Record { data, opcode })) => {
                    (self.chunk).extend_from_slice(data);
                    opcode
                }
                Some(Err(McapError::UnexpectedEof)) => {
                    (self.is_cut, self.is_over) = (true, true);
                    continue;
                }
                Some(Err(error)) => return Err(self.damaged(error)),
            };
            let record = std::mem::take(&mut self.chunk);
            self.take(found, record)?;
        }
        Ok(())
    }

    /// Takes a record that stands in no chunk, or a chunk.
    fn take(&mut self, code: u8, mut bytes: Vec<u8>) -> Result<(), FlightError> {
        let is_of_use = match code {
            op::HEADER | op::CHUNK | op::METADATA => true,
            op::ATTACHMENT => is_attachment_whole(&bytes),
            _ => false,
        };
        if !is_of_use {
            return Ok(());
        }
        let record = match parse_record(code, &bytes) {
            Ok(record) => record,
            Err(error) => return Err(self.damaged(error)),
        };
        match record {
            Record::Header(header) => self.is_ours |= header.library.starts_with(LIBRARY),
            Record::Metadata(found) if found.name == ABOUT => self.about.extend(found.metadata),
            Record::Attachment { header, data, .. } if header.name == DOCUMENT => {
                self.document = String::from_utf8(data.into_owned()).ok();
                self.is_ours = true;
            }
            Record::Chunk { header, .. } if !header.compression.is_empty() => {
                self.is_over = true;
                let (path, how) = (self.path.clone(), header.compression);
                return Err(match self.is_ours {
                    true => FlightError::Compressed { path, how },
                    false => FlightError::NotOfVigil { path },
                });
            }
            Record::Chunk { header, data } => {
                let sum = header.uncompressed_crc;
                let (is_right, length) = (sum == crc32fast::hash(&data), data.len());
                if sum != 0 && !is_right {
                    return Err(self.damaged("the checksum of a chunk does not fit"));
                }
                bytes.drain(..CHUNK_HEAD);
                bytes.truncate(length);
                self.chunk = bytes;
            }
            _ => {}
        }
        Ok(())
    }

    /// The next message of the chunk that is of use, if there is one.
    fn next_message(&mut self) -> Result<Option<Message>, FlightError> {
        while self.at < self.chunk.len() {
            let Some((code, body)) = self.next_record() else {
                return Err(self.damaged("a record reaches beyond its chunk"));
            };
            let bytes = self.chunk.get(body.clone()).unwrap_or_default();
            if ![op::CHANNEL, op::MESSAGE].contains(&code) {
                continue;
            }
            match parse_record(code, bytes) {
                Ok(Record::Channel(channel)) => self.learn(channel.id, &channel.topic),
                Ok(Record::Message { header, data }) => {
                    if let Some(content) = self.channels.get(&header.channel_id) {
                        return Ok(Some(Message {
                            content: *content,
                            log_time_ns: header.log_time,
                            data: body.end - data.len()..body.end,
                        }));
                    }
                }
                Ok(_) => {}
                Err(error) => return Err(self.damaged(error)),
            }
        }
        Ok(None)
    }

    /// Code and place of the next record of the chunk.
    fn next_record(&mut self) -> Option<(u8, Range<usize>)> {
        let head = self.chunk.get(self.at..)?.first_chunk::<RECORD_HEAD>()?;
        let [code, length @ ..] = *head;
        let length = usize::try_from(u64::from_le_bytes(length)).ok()?;
        let begin = self.at + RECORD_HEAD;
        let end = begin.checked_add(length)?;
        (end <= self.chunk.len()).then(|| {
            self.at = end;
            (code, begin..end)
        })
    }

    fn learn(&mut self, id: u16, topic: &str) {
        if let Some(content) = content(topic) {
            self.is_ours = true;
            self.channels.insert(id, content);
        }
    }

    /// Tools that repair files put their own name in: the channels of the first chunk say whose it
    /// is.
    fn look_for_channels(&mut self) -> Result<(), FlightError> {
        while !self.is_ours && self.next_message()?.is_some() {}
        self.at = 0;
        Ok(())
    }
}
