//! Blocks and events of a graph, into a file.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use vigil_blocks::layout::Layout;
use vigil_blocks::{Block, CheckpointPart, Control, Journal, ParticleBlock};
use vigil_cycle::topic::Topic;
use vigil_setup::Setup;
use vigil_timeline::{TimelineEntry, WallClock};

use crate::block_bytes::{block_header, read_block};
use crate::container::{ChannelForm, Container, FOREIGN, RAW};
use crate::error::FlightError;
use crate::message_times::MessageTimes;
use crate::summary::FlightSummary;
use crate::translation::{Outcome, Translation, write_event, write_truth};

/// Writes what a graph published as an MCAP file.
///
/// The file has `.part` after its name until [`Self::finish`]. What was written up to the last
/// second of recorded time can be read from it, whatever happens to the process.
pub struct FlightWriter {
    file: Container,
    translation: Translation,
    clock: WallClock,
    raw_only: u64,
}

/// A block that can be read, and when it was.
struct ReadBlock<B> {
    block: B,
    times: MessageTimes,
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

impl FlightWriter {
    /// Begins a file of `graph`, whose models give everything its name. `clock` says what the
    /// calendar said while the graph ran.
    ///
    /// # Errors
    /// The file cannot be created.
    pub fn create(path: &Path, graph: &Setup, clock: WallClock) -> Result<Self, FlightError> {
        Ok(Self {
            file: Container::create(path)?,
            translation: Translation::new(graph),
            clock,
            raw_only: 0,
        })
    }

    /// Adds a block as it came from its topic: as it is, and as the messages that follow from it.
    /// One of another version, or about other models, is kept as it is and counted.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn block(&mut self, topic: Topic, bytes: &[u8]) -> Result<(), FlightError> {
        let outcome = match topic {
            Topic::Sensor => self.read(topic, bytes)?.map(|it| {
                let file = &mut self.file;
                self.translation.frame.write(&it.block, it.times, file)
            }),
            Topic::Detection => self.read(topic, bytes)?.map(|it| {
                let file = &mut self.file;
                let written = self.translation.detection.write(&it.block, it.times, file);
                written.map(|()| Outcome::Messages)
            }),
            Topic::Diagnosis => self.read(topic, bytes)?.map(|it| {
                let file = &mut self.file;
                self.translation.diagnosis.write(&it.block, it.times, file)
            }),
            Topic::Action => self.read(topic, bytes)?.map(|it| {
                let file = &mut self.file;
                self.translation.action.write(&it.block, it.times, file)
            }),
            Topic::Faults => self.read(topic, bytes)?.map(|it| {
                let file = &mut self.file;
                self.translation.faults.write(&it.block, it.times, file)
            }),
            Topic::Truth => self.read(topic, bytes)?.map(|it| {
                let written = write_truth(&it.block, it.times, &mut self.file);
                written.map(|()| Outcome::Messages)
            }),
            Topic::Health(service) => self.read(topic, bytes)?.map(|it| {
                let (health, file) = (&mut self.translation.health, &mut self.file);
                let written = health.write(service, &it.block, it.times, file);
                written.map(|()| Outcome::Messages)
            }),
            Topic::DetectionParticles | Topic::DiagnosisParticles => {
                let times = self.keep::<ParticleBlock>(topic, bytes)?;
                times.map(|_| Ok(Outcome::Messages))
            }
            Topic::Control(_) => {
                let times = self.keep::<Control>(topic, bytes)?;
                times.map(|_| Ok(Outcome::Messages))
            }
            Topic::Journal(_) => {
                let times = self.keep::<Journal>(topic, bytes)?;
                times.map(|_| Ok(Outcome::Messages))
            }
            Topic::Checkpoint(_) => {
                let times = self.keep::<CheckpointPart>(topic, bytes)?;
                times.map(|_| Ok(Outcome::Messages))
            }
        };
        if outcome.transpose()? != Some(Outcome::Messages) {
            self.raw_only += 1;
        }
        Ok(())
    }

    /// Keeps a block as it is, and reads it; `None` if it is something else.
    fn read<B: Block + Layout>(
        &mut self,
        topic: Topic,
        bytes: &[u8],
    ) -> Result<Option<ReadBlock<B>>, FlightError> {
        let times = self.keep::<B>(topic, bytes)?;
        Ok(times
            .zip(read_block(bytes))
            .map(|(times, block)| ReadBlock { block, times }))
    }

    /// Keeps a block as it is, and says when it was; `None` if it is something else.
    fn keep<B: Block + Layout>(
        &mut self,
        topic: Topic,
        bytes: &[u8],
    ) -> Result<Option<MessageTimes>, FlightError> {
        let name = topic.name();
        let Some(header) = block_header::<B>(bytes) else {
            // Nothing says when it was, so it is put after what came before it.
            let times = MessageTimes::at(self.file.last_ns().unwrap_or_else(unix_now_ns));
            let topic = format!("{FOREIGN}{name}");
            let form = || block_form("", BTreeMap::new());
            self.file.write_bytes(&topic, times, bytes, form)?;
            return Ok(None);
        };
        let times = MessageTimes::new(&header, &self.clock);
        let topic = format!("{RAW}{name}");
        let layout = || BTreeMap::from([("layout".to_owned(), layout_text::<B>())]);
        let form = || block_form(B::TYPE_NAME, layout());
        self.file.write_bytes(&topic, times, bytes, form)?;
        Ok(Some(times))
    }

    /// Adds an event.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn event(&mut self, entry: &TimelineEntry) -> Result<(), FlightError> {
        write_event(entry, &self.clock, &mut self.file)
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
        self.file.attach(name, media_type, bytes, unix_now_ns())
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
        self.file.metadata(name, texts)
    }

    /// Closes the chunk under way, so that readers of the partial file find all that was written.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn flush(&mut self) -> Result<(), FlightError> {
        self.file.flush()
    }

    /// Ends the file, brings it to the disk and gives it its name. A file of that name is replaced.
    ///
    /// # Errors
    /// The file cannot be written, synchronised or renamed.
    pub fn finish(self) -> Result<FlightSummary, FlightError> {
        Ok(FlightSummary {
            raw_only: self.raw_only,
            ..self.file.finish()?
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
