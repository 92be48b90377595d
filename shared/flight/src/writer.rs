//! Blocks and events of a graph, into a file.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use vigil_blocks::Block;
use vigil_blocks::layout::Layout;
use vigil_cycle::topic::Topic;
use vigil_setup::Setup;
use vigil_timeline::{TimelineEntry, WallClock};

use crate::block_bytes::block_header;
use crate::container::{ChannelForm, Container, FOREIGN, RAW};
use crate::error::FlightError;
use crate::message_times::MessageTimes;
use crate::messages::message::Message;
use crate::sink::Sink;
use crate::summary::FlightSummary;
use crate::topics::RosTopic;
use crate::translation::{Outcome, Translation, write_event};

/// Writes what a graph published as an MCAP file.
///
/// The file has `.part` after its name until [`Self::finish`]. What was written up to the last
/// second of recorded time can be read from it, whatever happens to the process.
pub struct FlightWriter {
    file: BlockFile,
    translation: Translation,
    raw_only: u64,
}

/// The file with what its blocks are of.
struct BlockFile {
    container: Container,
    clock: WallClock,
}

/// What a block consists of, a line for each field.
fn layout_text<B: Block + Layout>() -> String {
    let head = format!("{}: {} bytes, little endian\n", B::NAME, size_of::<B>());
    let line = |field: &vigil_blocks::layout::Field| {
        format!("{} {}: {}\n", field.offset, field.name, field.type_text)
    };
    head + &B::FIELDS.iter().map(line).collect::<String>()
}

/// Channels of raw blocks: their bytes, little endian, without padding.
const fn block_form(type_name: &'static str, notes: BTreeMap<String, String>) -> ChannelForm {
    ChannelForm {
        message_encoding: "vigil-block",
        type_name,
        definition: String::new(),
        notes,
    }
}

impl Sink for BlockFile {
    type Error = FlightError;

    fn clock(&self) -> &WallClock {
        &self.clock
    }

    fn keep<B: Block + Layout>(
        &mut self,
        topic: Topic,
        bytes: &[u8],
    ) -> Result<Option<MessageTimes>, FlightError> {
        let name = topic.name();
        let file = &mut self.container;
        let Some(header) = block_header::<B>(bytes) else {
            // Nothing says when it was, so it is put after what came before it.
            let times = MessageTimes::at(file.last_ns().unwrap_or_else(unix_now_ns));
            let topic = format!("{FOREIGN}{name}");
            let form = || block_form("", BTreeMap::new());
            file.write_bytes(&topic, times, bytes, form)?;
            return Ok(None);
        };
        let times = MessageTimes::new(&header, &self.clock);
        let topic = format!("{RAW}{name}");
        let layout = || BTreeMap::from([("layout".to_owned(), layout_text::<B>())]);
        let form = || block_form(B::TYPE_NAME, layout());
        file.write_bytes(&topic, times, bytes, form)?;
        Ok(Some(times))
    }

    fn write(
        &mut self,
        topic: &'static RosTopic,
        times: MessageTimes,
        message: &impl Message,
    ) -> Result<(), FlightError> {
        self.container.write(topic, times, message)
    }
}

impl FlightWriter {
    /// Begins a file of `graph`, whose models give everything its name. `clock` says what the
    /// calendar said while the graph ran.
    ///
    /// # Errors
    /// The file cannot be created.
    pub fn create(path: &Path, graph: &Setup, clock: WallClock) -> Result<Self, FlightError> {
        Ok(Self {
            file: BlockFile {
                container: Container::create(path)?,
                clock,
            },
            translation: Translation::new(graph),
            raw_only: 0,
        })
    }

    /// Adds a block as it came from its topic: as it is, and as the messages that follow from it.
    /// One of another version, or about other models, is kept as it is and counted.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn block(&mut self, topic: Topic, bytes: &[u8]) -> Result<(), FlightError> {
        let outcome = self.translation.write(topic, bytes, &mut self.file)?;
        if outcome != Outcome::Messages {
            self.raw_only += 1;
        }
        Ok(())
    }

    /// Adds an event.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn event(&mut self, entry: &TimelineEntry) -> Result<(), FlightError> {
        let times = write_event(entry, &mut self.file)?;
        // An entry is made of numbers and texts, which always have a form in JSON.
        let json = serde_json::to_vec(entry).unwrap_or_default();
        let form = || ChannelForm {
            message_encoding: "json",
            type_name: "",
            definition: String::new(),
            notes: BTreeMap::new(),
        };
        let file = &mut self.file.container;
        file.write_bytes("/vigil/raw/events", times, &json, form)
    }

    /// Adds a file within the file, such as the graph's configuration.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn attach(
        &mut self,
        name: &str,
        media_type: &str,
        bytes: &[u8],
    ) -> Result<(), FlightError> {
        self.file
            .container
            .attach(name, media_type, bytes, unix_now_ns())
    }

    /// Adds named texts, such as why the file was written.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn metadata(
        &mut self,
        name: &str,
        texts: &BTreeMap<String, String>,
    ) -> Result<(), FlightError> {
        self.file.container.metadata(name, texts)
    }

    /// Closes the chunk under way, so that readers of the partial file find all that was written.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn flush(&mut self) -> Result<(), FlightError> {
        self.file.container.flush()
    }

    /// Ends the file, brings it to the disk and gives it its name. A file of that name is replaced.
    ///
    /// # Errors
    /// The file cannot be written, synchronised or renamed.
    pub fn finish(self) -> Result<FlightSummary, FlightError> {
        Ok(FlightSummary {
            raw_only: self.raw_only,
            ..self.file.container.finish()?
        })
    }
}

/// Since 1970, ns.
fn unix_now_ns() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.map_or(0, |since| {
        u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
    })
}
