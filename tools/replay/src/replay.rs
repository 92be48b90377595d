//! A recording that is computed again.

use std::collections::VecDeque;
use std::panic::{self, AssertUnwindSafe};
use std::path::Path;

use vigil_blocks::layout::Layout;
use vigil_blocks::{
    Action, Block, BlockId, CheckpointPart, DetectionBelief, FaultBelief, Faults, Journal,
    JournalEntry, JournalKind, STATE_BYTES_MAX,
};
use vigil_cycle::Topic;
use vigil_cycle::topic::ServiceName;
use vigil_flight::{FlightReader, Recorded, read_block};
use vigil_setup::Setup;

use crate::blocks::{Blocks, Hypotheses, Window};
use crate::difference::{self, Difference};
use crate::error::ReplayError;
use crate::service_replay::{ServiceReplay, Standing, Tally, begins};
use crate::step::{Answers, Step};

/// The file is read so far ahead of what is computed, ns: it holds topics one after the other, and
/// states in parts.
const AHEAD_NS: u64 = 10_000_000_000;

/// A state that somebody has forged may break any promise between its parts.
const ASSERTION_FAILED: &str = "the step has failed an assertion";
/// Places in [`ServiceName::STEPPING`].
const DETECTOR: usize = 0;
const IDENTIFIER: usize = 1;

/// What was computed.
#[derive(Debug, Clone, PartialEq)]
pub enum Answer {
    /// The detector's.
    Detection(Box<DetectionBelief>),
    /// The identifier's.
    Diagnosis(Box<FaultBelief>),
    /// The supervisor's.
    Action(Box<Action>),
    /// The supervisor's, about faults.
    Faults(Box<Faults>),
}

/// What happened at a moment of the replay.
#[derive(Debug, Clone, PartialEq)]
pub enum What {
    /// The step gave an answer; the difference from the recorded one, if that is another.
    Answered(Answer, Option<Difference>),
    /// The step begins: with the service, or with a state that it has handed out.
    Begins,
    /// The state is not the one that the service has handed out.
    StateDiffers(Difference),
    /// This was not recorded: the service waits for its next state.
    Gap(String),
}

/// A moment of the replay.
#[derive(Debug, Clone, PartialEq)]
pub struct Moment {
    /// When it was, ns since 1970.
    pub t_ns: u64,
    /// Whose step.
    pub service: ServiceName,
    /// What.
    pub what: What,
}

/// A recording that is computed again.
pub struct Replay {
    file: FlightReader,
    setup: Setup,
    services: [ServiceReplay; 3],
    blocks: Blocks,
    answers: Answers,
    moments: VecDeque<Moment>,
    /// Up to here the file is read, ns: by the journals, whose times nobody outside has written. 0
    /// before the first of them.
    read_ns: u64,
    /// True at its end.
    is_read: bool,
    /// Blocks that could not be read.
    foreign_count: u64,
    /// Room for a state.
    state: Box<[u8]>,
}

impl Replay {
    /// Opens a recording, and builds the steps that the graph ran.
    ///
    /// # Errors
    /// [`ReplayError`].
    pub fn open(path: &Path) -> Result<Self, ReplayError> {
        let file = FlightReader::open(path)?;
        let setup = file.setup()?;
        let begin =
            |service| Step::new(service, &setup).map(|step| ServiceReplay::new(service, step));
        let [first, second, third] = ServiceName::STEPPING;
        Ok(Self {
            file,
            services: [begin(first)?, begin(second)?, begin(third)?],
            blocks: Blocks::new(3 * AHEAD_NS),
            answers: Answers::default(),
            moments: VecDeque::new(),
            read_ns: 0,
            is_read: false,
            foreign_count: 0,
            state: vec![0; STATE_BYTES_MAX].into_boxed_slice(),
            setup,
        })
    }

    /// What the graph ran on.
    #[must_use]
    pub const fn setup(&self) -> &Setup {
        &self.setup
    }

    /// What became of a service's answers so far.
    #[must_use]
    pub fn tally(&self, service: ServiceName) -> Tally {
        let found = self
            .services
            .iter()
            .find(|replay| replay.service == service);
        found.map_or_else(Tally::default, |replay| replay.tally)
    }

    /// True if the file was cut short.
    #[must_use]
    pub fn is_cut(&self) -> bool {
        self.file.is_cut()
    }

    /// Blocks of another version, which nothing can be computed from.
    #[must_use]
    pub const fn foreign_count(&self) -> u64 {
        self.file.foreign_count() + self.foreign_count
    }

    /// What comes next; `None` at the end.
    ///
    /// # Errors
    /// The file's.
    pub fn next_moment(&mut self) -> Result<Option<Moment>, ReplayError> {
        loop {
            if let Some(moment) = self.moments.pop_front() {
                return Ok(Some(moment));
            }
            if let Some(place) = self.due() {
                self.turn(place)?;
            } else if self.is_read {
                return Ok(None);
            } else {
                self.read()?;
            }
        }
    }

    /// Reads on in the file.
    fn read(&mut self) -> Result<(), ReplayError> {
        let Some(recorded) = self.file.next()? else {
            self.is_read = true;
            return Ok(());
        };
        let Recorded::Block {
            topic,
            log_time_ns,
            bytes,
        } = recorded
        else {
            return Ok(());
        };
        let is_of =
            |service: ServiceName| move |replay: &&mut ServiceReplay| replay.service == service;
        match topic {
            Topic::Journal(service) => {
                let found = self.services.iter_mut().find(is_of(service));
                match found.zip(read_block::<Journal>(bytes)) {
                    Some((replay, block)) => {
                        replay.journal.push_back((log_time_ns, block));
                        if self.read_ns == 0 {
                            self.blocks.begin(log_time_ns);
                        }
                        self.read_ns = self.read_ns.max(log_time_ns);
                    }
                    None => self.foreign_count += 1,
                }
            }
            Topic::Checkpoint(service) => {
                let found = self.services.iter_mut().find(is_of(service));
                match found.zip(read_block::<CheckpointPart>(bytes)) {
                    Some((replay, part)) => replay.checkpoints.take(&part),
                    None => self.foreign_count += 1,
                }
            }
            _ => {
                let is_ours = self.blocks.take(topic, self.read_ns, bytes);
                self.foreign_count += u64::from(!is_ours);
            }
        }
        Ok(())
    }

    /// Whose journal goes on, if enough of the file is read: the oldest block of all; but the
    /// detector's, as long as it has not answered what the oldest one takes.
    fn due(&self) -> Option<usize> {
        let fronts = self.services.iter().map(|replay| replay.journal.front());
        let heads = fronts.enumerate().filter_map(|(place, front)| {
            let (t_ns, block) = front?;
            Some((*t_ns, place, block))
        });
        let (_, oldest, block) = heads.min_by_key(|(t_ns, place, _)| (*t_ns, *place))?;
        let place = match oldest == IDENTIFIER && self.waits(block) {
            true => DETECTOR,
            false => oldest,
        };
        let (t_ns, _) = self.services[place].journal.front()?;
        let is_read = self.is_read || t_ns.saturating_add(AHEAD_NS) <= self.read_ns;
        is_read.then_some(place)
    }

    /// True if the identifier takes a detection that the detector has yet to answer.
    fn waits(&self, block: &Journal) -> bool {
        let detector = &self.services[DETECTOR];
        // A writer that starts later has the larger epoch.
        let key = |id: BlockId| (id.epoch, id.seq);
        let answered = detector.answered.map(key);
        let mut taken = block.used().iter().filter_map(JournalEntry::detection);
        self.services[IDENTIFIER].standing == Standing::Following
            && !detector.journal.is_empty()
            && taken.any(|id| Some(key(id)) > answered)
    }

    /// Computes one block of a journal.
    fn turn(&mut self, place: usize) -> Result<(), ReplayError> {
        let Some((t_ns, block)) = self.services[place].journal.pop_front() else {
            return Ok(());
        };
        if let Some(what) = self.services[place].follow(&block) {
            self.gap(place, t_ns, what);
        }
        let (before, after) = block.around_answer();
        self.take(place, t_ns, before)?;
        if let Some(id) = block.answer() {
            self.answer(place, t_ns, id);
        }
        self.take(place, t_ns, after)?;
        self.compare_state(place, t_ns, block.header.id());
        Ok(())
    }

    /// Computes entries of a journal.
    fn take(
        &mut self,
        place: usize,
        t_ns: u64,
        entries: &[JournalEntry],
    ) -> Result<(), ReplayError> {
        for entry in entries {
            let replay = &mut self.services[place];
            if begins(entry) {
                let service = replay.service;
                replay.step = Step::new(service, &self.setup)?;
                replay.standing = Standing::Following;
                replay.tally.begun += 1;
                self.note(t_ns, service, What::Begins);
            } else if replay.standing == Standing::Following {
                let (blocks, answers) = (&self.blocks, &mut self.answers);
                let taken = panic::catch_unwind(AssertUnwindSafe(|| {
                    replay.step.take(entry, blocks, answers)
                }));
                match taken {
                    Ok(Ok(())) => {}
                    Ok(Err(missing)) => self.gap(place, t_ns, missing.as_str()),
                    // The service has answered: its journal is published after the step.
                    Err(_) => {
                        replay.tally.different += 1;
                        self.gap(place, t_ns, ASSERTION_FAILED);
                    }
                }
            }
            if entry.kind == JournalKind::Told as u32
                && let Some(id) = entry.input()
            {
                self.answer_faults(place, t_ns, id);
            }
        }
        Ok(())
    }

    fn note(&mut self, t_ns: u64, service: ServiceName, what: What) {
        self.moments.push_back(Moment {
            t_ns,
            service,
            what,
        });
    }

    /// Something is missing: the service waits, if it does not wait already.
    fn gap(&mut self, place: usize, t_ns: u64, what: &str) {
        let standing = &mut self.services[place].standing;
        if std::mem::replace(standing, Standing::Waiting) == Standing::Following {
            self.tell_gap(place, t_ns, what);
        }
    }

    fn tell_gap(&mut self, place: usize, t_ns: u64, what: &str) {
        let replay = &mut self.services[place];
        replay.tally.gaps += 1;
        let service = replay.service;
        self.note(t_ns, service, What::Gap(what.to_owned()));
    }

    /// Compares an answer with what was published.
    fn answer(&mut self, place: usize, t_ns: u64, id: BlockId) {
        let replay = &mut self.services[place];
        replay.tally.answers += 1;
        replay.answered = Some(id);
        if replay.standing == Standing::Waiting {
            return;
        }
        let (blocks, answers) = (&mut self.blocks, &mut self.answers);
        let (answer, compared) = match place {
            DETECTOR => {
                let hypotheses = Hypotheses::from(&*answers.particles);
                let hypotheses = Box::new(hypotheses);
                blocks.hypotheses.insert(id, self.read_ns, hypotheses);
                let answer = std::mem::take(&mut answers.detection);
                let compared = compared(&blocks.detections, id, &*answer);
                (Answer::Detection(answer), compared)
            }
            IDENTIFIER => {
                let answer = std::mem::take(&mut answers.diagnosis);
                let compared = compared(&blocks.diagnoses, id, &*answer);
                (Answer::Diagnosis(answer), compared)
            }
            _ => {
                replay.step.decided(&answers.action);
                let answer = std::mem::take(&mut answers.action);
                let compared = compared(&blocks.actions, id, &*answer);
                (Answer::Action(answer), compared)
            }
        };
        self.answered(place, t_ns, answer, compared);
    }

    /// Compares the faults with what was published of them.
    fn answer_faults(&mut self, place: usize, t_ns: u64, id: BlockId) {
        let replay = &mut self.services[place];
        replay.tally.answers += 1;
        if replay.standing == Standing::Following {
            let answer = std::mem::take(&mut self.answers.faults);
            let compared = compared(&self.blocks.faults, id, &*answer);
            self.answered(place, t_ns, Answer::Faults(answer), compared);
        }
    }

    /// Counts and tells what was computed.
    fn answered(
        &mut self,
        place: usize,
        t_ns: u64,
        answer: Answer,
        compared: Option<Option<Difference>>,
    ) {
        let replay = &mut self.services[place];
        let service = replay.service;
        replay.tally.compared += u64::from(compared.is_some());
        replay.tally.unrecorded += u64::from(compared.is_none());
        let difference = compared.flatten();
        replay.tally.different += u64::from(difference.is_some());
        self.note(t_ns, service, What::Answered(answer, difference));
    }

    /// Compares the state with the one that the service has handed out after this block, or begins
    /// with it.
    fn compare_state(&mut self, place: usize, t_ns: u64, id: BlockId) {
        // Its first input is what the detector answers from then on.
        let detector = self.services[DETECTOR].standing;
        let can_begin = place != IDENTIFIER || detector == Standing::Following;
        let replay = &mut self.services[place];
        let service = replay.service;
        if let Some(bytes) = replay.checkpoints.take_too_large()
            && replay.standing == Standing::Waiting
        {
            let what = format!("a state of {bytes} bytes is too large to be handed out");
            return self.tell_gap(place, t_ns, &what);
        }
        let Some(recorded) = replay.checkpoints.after(id) else {
            return;
        };
        if replay.standing == Standing::Waiting && !can_begin {
            return;
        }
        if replay.standing == Standing::Following {
            let computed = replay.step.state(&mut self.state);
            replay.tally.states += 1;
            if computed == Some(recorded.bytes.as_slice()) {
                return;
            }
            let computed = computed.unwrap_or_default();
            let difference = difference::of_states(id, &recorded.bytes, computed);
            replay.tally.different += 1;
            self.note(t_ns, service, What::StateDiffers(difference));
        }
        let replay = &mut self.services[place];
        replay.standing = Standing::Waiting;
        match panic::catch_unwind(AssertUnwindSafe(|| replay.step.load(&recorded.bytes))) {
            Ok(Ok(())) => {
                replay.standing = Standing::Following;
                replay.tally.begun += 1;
                self.note(t_ns, service, What::Begins);
            }
            Ok(Err(error)) => self.tell_gap(place, t_ns, &error.to_string()),
            Err(_) => self.tell_gap(place, t_ns, ASSERTION_FAILED),
        }
    }
}

/// What differs, if anything does; `None` if the block was not recorded.
fn compared<T: Block + Layout>(
    recorded: &Window<T>,
    id: BlockId,
    computed: &T,
) -> Option<Option<Difference>> {
    let recorded = recorded.get(id)?;
    Some(difference::of_blocks(recorded, computed))
}
