//! The MCAP file itself: channels, chunks, and the way to a whole file.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;
use mcap::write::{Metadata, NoSeek};
use mcap::{Attachment, McapError, WriteOptions, Writer};

use crate::cdr::Cdr;
use crate::error::FlightError;
use crate::message_times::MessageTimes;
use crate::messages::message::Message;
use crate::part::{lock, part_path};
use crate::summary::FlightSummary;
use crate::topics::RosTopic;

/// Longest recorded time in a chunk, ns: what an interruption takes with it at most.
const CHUNK_NS: u64 = 1_000_000_000;
/// Size from which a chunk is closed, bytes.
const CHUNK_BYTES: usize = 1 << 20;

/// What channels of blocks and events as they were begin with.
pub(crate) const RAW: &str = "/vigil/raw/";
/// What channels of blocks of another version begin with.
pub(crate) const FOREIGN: &str = "/vigil/foreign/";
/// The program that writes, up to its version.
pub(crate) const LIBRARY: &str = "vigil ";

/// What the messages of a channel are.
pub(crate) struct ChannelForm {
    /// How they are encoded.
    pub(crate) message_encoding: &'static str,
    /// Name of their type; empty if it has none.
    pub(crate) type_name: &'static str,
    /// What the type consists of, in the words of ROS 2; empty for other messages. Readers of ROS 2
    /// refuse a whole file for one definition in words that they do not know.
    pub(crate) definition: String,
    /// What else there is to know, by name.
    pub(crate) notes: BTreeMap<String, String>,
}

/// A channel of the file.
#[derive(Debug, Clone, Copy)]
struct Channel {
    id: u16,
    count: u64,
}

/// A file under way.
pub(crate) struct Container {
    // Without seeking, a chunk is held in memory and written as a whole: what is on the disk is
    // never half a chunk, unless the disk is full.
    writer: Writer<NoSeek<BufWriter<File>>>,
    /// The same file, to synchronise it.
    file: File,
    path: PathBuf,
    part_path: PathBuf,
    channels: BTreeMap<String, Channel>,
    /// When the open chunk began, since 1970, ns.
    chunk_ns: Option<u64>,
    chunk_bytes: usize,
    bounds_ns: Option<[u64; 2]>,
    /// Kept for its memory.
    cdr: Cdr,
}

/// How files are written, but for their chunks.
pub(crate) fn options() -> WriteOptions {
    WriteOptions::new()
        .compression(None)
        .profile("ros2")
        .library(format!("{LIBRARY}{}", env!("CARGO_PKG_VERSION")))
        .disable_seeking(true)
}

impl Container {
    /// An empty file.
    pub(crate) fn create(path: &Path) -> Result<Self, FlightError> {
        let part_path = part_path(path);
        let failed = |source| FlightError::File {
            path: part_path.clone(),
            source,
        };
        let file = File::create(&part_path).map_err(failed)?;
        // Nobody mends what is still being written.
        lock(&file);
        let stream = BufWriter::new(file.try_clone().map_err(failed)?);
        let writer = options()
            .chunk_size(None)
            .create(NoSeek::new(stream))
            .map_err(|source| FlightError::Container {
                path: part_path.clone(),
                source,
            })?;
        Ok(Self {
            writer,
            file,
            path: path.to_owned(),
            part_path,
            channels: BTreeMap::new(),
            chunk_ns: None,
            chunk_bytes: 0,
            bounds_ns: None,
            cdr: Cdr::new(),
        })
    }

    fn container_error(&self, source: McapError) -> FlightError {
        let path = self.part_path.clone();
        match source {
            // The container's own text says nothing of what the system said.
            McapError::Io(source) => FlightError::File { path, source },
            source => FlightError::Container { path, source },
        }
    }

    /// When the latest message was, since 1970, ns.
    pub(crate) fn last_ns(&self) -> Option<u64> {
        self.bounds_ns.map(|[_, last_ns]| last_ns)
    }

    /// Writes a message of ROS 2.
    pub(crate) fn write(
        &mut self,
        topic: &RosTopic,
        times: MessageTimes,
        message: &impl Message,
    ) -> Result<(), FlightError> {
        let mut cdr = std::mem::replace(&mut self.cdr, Cdr::new());
        cdr.clear();
        message.encode(&mut cdr);
        let form = || ChannelForm {
            message_encoding: "cdr",
            type_name: topic.definition.name,
            definition: topic.definition.text(),
            notes: BTreeMap::new(),
        };
        let written = self.write_bytes(topic.name, times, cdr.bytes(), form);
        self.cdr = cdr;
        written
    }

    /// Writes a message of any form; `form` is asked for if the channel is a new one.
    pub(crate) fn write_bytes(
        &mut self,
        topic: &str,
        times: MessageTimes,
        bytes: &[u8],
        form: impl FnOnce() -> ChannelForm,
    ) -> Result<(), FlightError> {
        if !self.channels.contains_key(topic) {
            let added = self.add_channel(topic, &form());
            let id = added.map_err(|source| self.container_error(source))?;
            let channel = Channel { id, count: 0 };
            self.channels.insert(topic.to_owned(), channel);
        }
        let Some(channel) = self.channels.get_mut(topic) else {
            return Ok(());
        };
        channel.count += 1;
        let header = MessageHeader {
            channel_id: channel.id,
            sequence: times.sequence,
            log_time: times.log_ns,
            publish_time: times.capture_ns,
        };
        self.end_chunk_before(times.log_ns)?;
        let written = self.writer.write_to_known_channel(&header, bytes);
        written.map_err(|source| self.container_error(source))?;
        self.chunk_bytes += bytes.len();
        let [first_ns, last_ns] = self.bounds_ns.unwrap_or([times.log_ns; 2]);
        self.bounds_ns = Some([first_ns.min(times.log_ns), last_ns.max(times.log_ns)]);
        Ok(())
    }

    fn add_channel(&mut self, topic: &str, form: &ChannelForm) -> Result<u16, McapError> {
        let encoding = if form.definition.is_empty() {
            ""
        } else {
            "ros2msg"
        };
        // Number 0 is that of no schema.
        let schema = match form.type_name {
            "" => 0,
            name => {
                let definition = form.definition.as_bytes();
                self.writer.add_schema(name, encoding, definition)?
            }
        };
        self.writer
            .add_channel(schema, topic, form.message_encoding, &form.notes)
    }

    /// Closes the chunk if it is large, or if this instant lies too far from its beginning.
    fn end_chunk_before(&mut self, log_ns: u64) -> Result<(), FlightError> {
        let began_ns = *self.chunk_ns.get_or_insert(log_ns);
        if log_ns.abs_diff(began_ns) < CHUNK_NS && self.chunk_bytes < CHUNK_BYTES {
            return Ok(());
        }
        self.flush()?;
        self.chunk_ns = Some(log_ns);
        Ok(())
    }

    /// Hands all that was written to the system: readers find it, whatever happens to this process.
    pub(crate) fn flush(&mut self) -> Result<(), FlightError> {
        (self.chunk_ns, self.chunk_bytes) = (None, 0);
        let flushed = self.writer.flush();
        flushed.map_err(|source| self.container_error(source))
    }

    /// Adds a file within the file, written at `now_ns` since 1970.
    pub(crate) fn attach(
        &mut self,
        name: &str,
        media_type: &str,
        bytes: &[u8],
        now_ns: u64,
    ) -> Result<(), FlightError> {
        let attachment = Attachment {
            log_time: now_ns,
            create_time: now_ns,
            name: name.to_owned(),
            media_type: media_type.to_owned(),
            data: bytes.into(),
        };
        let attached = self.writer.attach(&attachment);
        attached.map_err(|source| self.container_error(source))?;
        self.flush()
    }

    /// Adds named texts.
    pub(crate) fn metadata(
        &mut self,
        name: &str,
        texts: &BTreeMap<String, String>,
    ) -> Result<(), FlightError> {
        let metadata = Metadata {
            name: name.to_owned(),
            metadata: texts.clone(),
        };
        let written = self.writer.write_metadata(&metadata);
        written.map_err(|source| self.container_error(source))?;
        self.flush()
    }

    /// Writes the index, brings everything to the disk and gives the file its name.
    pub(crate) fn finish(mut self) -> Result<FlightSummary, FlightError> {
        let finished = self.writer.finish();
        finished.map_err(|source| self.container_error(source))?;
        let mut stream = self.writer.into_inner().into_inner();
        let failed = |source| FlightError::File {
            path: self.part_path.clone(),
            source,
        };
        io::Write::flush(&mut stream).map_err(failed)?;
        self.file.sync_all().map_err(failed)?;
        let bytes = self.file.metadata().map_err(failed)?.len();
        fs::rename(&self.part_path, &self.path).map_err(failed)?;
        sync_folder(&self.path).map_err(failed)?;
        let channels = self.channels.into_iter();
        Ok(FlightSummary {
            path: self.path,
            bytes,
            messages: channels
                .map(|(topic, channel)| (topic, channel.count))
                .collect(),
            first_unix_ns: self.bounds_ns.map(|[first_ns, _]| first_ns),
            last_unix_ns: self.bounds_ns.map(|[_, last_ns]| last_ns),
            raw_only: 0,
        })
    }
}

/// Brings a file's name to the disk.
fn sync_folder(path: &Path) -> io::Result<()> {
    let folder = path.parent().filter(|it| !it.as_os_str().is_empty());
    File::open(folder.unwrap_or(Path::new(".")))?.sync_all()
}
