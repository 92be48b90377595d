//! Messages are sent as a recording would hold them, and silence is told.

#![cfg(test)]

use std::convert::Infallible;
use std::path::Path;

use bytemuck::bytes_of;
use vigil_blocks::{Block, FaultRecord, FaultSource, FaultState, Faults, Header, OverallState};
use vigil_cycle::topic::Topic;
use vigil_flight::LiveMessages;
use vigil_setup::Setup;

const S: u64 = 1_000_000_000;
/// Levels of ROS 2.
const OK: u8 = 0;
const ERROR: u8 = 2;
const STALE: u8 = 3;

fn setup() -> Setup {
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/rover.toml");
    vigil_setup::load_graph(&config, |_| {}).unwrap()
}

/// What came, by topic.
#[derive(Default)]
struct Heard {
    messages: Vec<(&'static str, Vec<u8>)>,
}

impl Heard {
    /// Hands `act` who takes messages.
    fn take(&mut self, messages: &mut LiveMessages, act: impl Fn(&mut LiveMessages, &mut Self)) {
        self.messages.clear();
        act(messages, self);
    }

    fn block<B: Block>(&mut self, messages: &mut LiveMessages, topic: Topic, block: &B, at: u64) {
        let bytes = bytes_of(block);
        let sent = messages.block::<Infallible>(topic, bytes, at, &mut |it| {
            self.messages.push((it.topic.name, it.cdr.to_vec()));
            Ok(())
        });
        sent.unwrap();
    }

    fn look(&mut self, messages: &mut LiveMessages, at: u64) {
        let sent = messages.look::<Infallible>(at, &mut |it| {
            self.messages.push((it.topic.name, it.cdr.to_vec()));
            Ok(())
        });
        sent.unwrap();
    }

    /// Level of the status of this name in the last message of a topic.
    fn level(&self, topic: &str, name: &str) -> Option<u8> {
        let mut of_topic = self.messages.iter().filter(|(at, _)| *at == topic);
        let (_, cdr) = of_topic.next_back()?;
        let text = [name.as_bytes(), b"\0"].concat();
        let at = cdr.windows(text.len()).position(|it| it == text)?;
        // The length lies before the name, and before it the level with its padding.
        Some(cdr[at - 8])
    }
}

fn faults(setup: &Setup, overall: OverallState, state: Option<FaultState>, seq: u64) -> Faults {
    let mut faults = Faults {
        header: Header {
            schema: Faults::SCHEMA,
            epoch: 1,
            seq,
            t_publish_ns: seq * S,
            ..Header::default()
        },
        tree_hash: setup.tree.hash(),
        revision: seq,
        overall: overall as u32,
        ..Faults::default()
    };
    if let Some(state) = state {
        faults.records[0] = FaultRecord {
            number: 1,
            source: FaultSource::Input as u32,
            state: state as u32,
            severity: 2,
            ..FaultRecord::default()
        };
    }
    faults
}

#[test]
fn a_fault_is_told_until_it_is_over_and_silence_is_stale() {
    let setup = setup();
    let mut messages = LiveMessages::new(&setup, S / 10, S);
    let mut heard = Heard::default();
    let (whole, fault) = ("vigil/rover", "vigil/rover/INPUT");
    let present = faults(&setup, OverallState::Fault, Some(FaultState::Active), 2);
    heard.take(&mut messages, |messages, heard| {
        heard.block(messages, Topic::Faults, &present, 2 * S);
    });
    for topic in ["/diagnostics", "/vigil/faults"] {
        assert_eq!(heard.level(topic, whole), Some(ERROR));
        assert_eq!(heard.level(topic, fault), Some(ERROR));
    }
    assert_eq!(
        heard.level("/diagnostics", "vigil/rover/diagnosis"),
        Some(STALE)
    );

    heard.take(&mut messages, |messages, heard| heard.look(messages, 4 * S));
    assert_eq!(heard.level("/diagnostics", whole), Some(STALE));
    assert_eq!(heard.level("/diagnostics", fault), Some(STALE));
    let service = "vigil/rover/health/detector";
    assert_eq!(
        heard.level("/vigil/health", service),
        None,
        "the last is another"
    );
    heard.take(&mut messages, |messages, heard| {
        heard.look(messages, 4 * S + 1)
    });
    assert!(heard.messages.is_empty(), "once a second");

    // After a new start the fault is kept no longer: it is over, once.
    let mut messages = messages.restarted(&setup, 5 * S);
    for (seq, level) in [(6, Some(OK)), (7, None)] {
        let gone = faults(&setup, OverallState::Ok, None, seq);
        heard.take(&mut messages, |messages, heard| {
            heard.block(messages, Topic::Faults, &gone, seq * S);
        });
        assert_eq!(heard.level("/diagnostics", whole), Some(OK));
        assert_eq!(heard.level("/diagnostics", fault), level);
    }
}
