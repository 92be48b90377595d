//! Messages are sent as a recording would hold them, and silence is told.

use std::convert::Infallible;
use std::path::Path;

use bytemuck::bytes_of;
use vigil_blocks::{Block, FaultRecord, FaultSource, FaultState, Faults, Header, OverallState};
use vigil_cycle::topic::Topic;
use vigil_flight::LiveMessages;
use vigil_setup::Setup;

const S: u64 = 1_000_000_000;
const SILENT: Option<&str> = Some("stale: nothing is heard");

fn setup() -> Setup {
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/rover.toml");
    vigil_setup::load_graph(&config, |_| {}).unwrap()
}

/// What came, by topic.
#[derive(Default)]
struct Inbox {
    messages: Vec<(&'static str, Vec<u8>)>,
}

impl Inbox {
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

    /// What the status of this name says in the last message of a topic.
    fn said(&self, topic: &str, name: &str) -> Option<&str> {
        let mut of_topic = self.messages.iter().filter(|(at, _)| *at == topic);
        let (_, cdr) = of_topic.next_back()?;
        let text = [name.as_bytes(), b"\0"].concat();
        let at = cdr.windows(text.len()).position(|it| it == text)?;
        // Its length comes first, at a multiple of four.
        let message = &cdr[(at + text.len()).next_multiple_of(4) + 4..];
        let end = message.iter().position(|byte| *byte == 0)?;
        std::str::from_utf8(&message[..end]).ok()
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
    let mut heard = Inbox::default();
    let (whole, fault) = ("vigil/rover", "vigil/rover/INPUT");
    let present = faults(&setup, OverallState::Fault, Some(FaultState::Active), 2);
    heard.take(&mut messages, |messages, heard| {
        heard.block(messages, Topic::Faults, &present, 2 * S);
    });
    for topic in ["/diagnostics", "/vigil/faults"] {
        assert_eq!(heard.said(topic, whole), Some("fault"));
        assert_eq!(heard.said(topic, fault), Some("active (fault), p 0.00"));
    }
    assert_eq!(heard.said("/diagnostics", "vigil/rover/diagnosis"), SILENT);

    heard.take(&mut messages, |messages, heard| heard.look(messages, 4 * S));
    assert_eq!(heard.said("/diagnostics", whole), SILENT);
    assert_eq!(heard.said("/diagnostics", fault), SILENT);
    let services = heard
        .messages
        .iter()
        .filter(|(at, _)| *at == "/vigil/health");
    assert_eq!(services.count(), 4);
    heard.take(&mut messages, |messages, heard| {
        heard.look(messages, 4 * S + 1)
    });
    assert!(heard.messages.is_empty(), "once a second");

    // After a new start the fault is kept no longer: it is over, once.
    let mut messages = messages.restarted(&setup, 5 * S);
    for (seq, said) in [(6, Some("over, and kept no longer")), (7, None)] {
        let gone = faults(&setup, OverallState::Ok, None, seq);
        heard.take(&mut messages, |messages, heard| {
            heard.block(messages, Topic::Faults, &gone, seq * S);
        });
        assert_eq!(heard.said("/diagnostics", whole), Some("ok"));
        assert_eq!(heard.said("/diagnostics", fault), said);
    }
}
