//! Frames that arrive at real sockets, under the virtual clock: who is believed, and for how long.

use std::net::UdpSocket;
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use vigil_blocks::{Action, Block, FaultBelief, Rejection, SensorFrame, Verdict, datagram};
use vigil_cycle::datagrams::Datagrams;
use vigil_cycle::placement::{PlacementRequest, read_back};
use vigil_cycle::port::Bus;
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{
    Clock, CycleAccount, DeadlineMonitor, Graph, HealthBoard, OnMiss, Receiver, Recorder, Schedule,
    Sender, Stage, StageCycle, Stamp, Topic, VirtualClock,
};
use vigil_robot::ChannelMap;
use vigil_sensor_sim::{SocketStage, VerdictNames};

const PERIOD_NS: u64 = 10_000_000;
const SCHEDULE: Schedule = Schedule {
    period_ns: PERIOD_NS,
    deadline_ns: PERIOD_NS,
    budget_ns: PERIOD_NS,
};

/// The stage with its sockets, and a reader of what it publishes.
struct Border {
    clock: VirtualClock,
    cycle: StageCycle,
    stage: SocketStage,
    published: Box<dyn Receiver<SensorFrame>>,
    beliefs: Box<dyn Sender<FaultBelief>>,
    actions: Box<dyn Sender<Action>>,
    datagrams: Rc<Datagrams>,
    file: PathBuf,
    robot_hash: u64,
}

impl Border {
    fn new(name: &str) -> Self {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let robot = vigil_setup::load_robot(&root.join("config/robots/rover.toml")).unwrap();
        let clock = VirtualClock::default();
        clock.set(60_000_000_000);
        let graph = Graph::InProcess(Bus::new(clock.clone()));
        let wanted = PlacementRequest {
            core: 0,
            priority: 1,
        };
        let sender = graph.sender(Topic::Health(ServiceName::SensorSim)).unwrap();
        let board = HealthBoard::new(sender, SCHEDULE, wanted, read_back(0));
        let file = std::env::temp_dir().join(format!("{name}-{}.sock", std::process::id()));
        // A port that is free, asked for by its number: such a one stays with the socket.
        let free = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr();
        let datagrams = Datagrams::bind(Some(free.unwrap()), Some(&file)).unwrap();
        let datagrams = Rc::new(datagrams);
        let published = graph.receiver(Topic::Sensor).unwrap();
        let names = VerdictNames::new(
            ["ND", "LF_STUCK"].into_iter(),
            ["stop", "go_on"].into_iter(),
        );
        let stage = SocketStage::new(Rc::clone(&datagrams), &robot, names, &graph).unwrap();
        let beliefs = graph.sender(Topic::Diagnosis).unwrap();
        let actions = graph.sender(Topic::Action).unwrap();
        let recorder = Recorder::new().unwrap();
        let account = CycleAccount::new(DeadlineMonitor::new(SCHEDULE), board, recorder)
            .with_on_miss(OnMiss::Count);
        Self {
            clock,
            cycle: StageCycle::new(account).with_input_of(stage.writer()),
            stage,
            published,
            beliefs,
            actions,
            datagrams,
            file,
            robot_hash: ChannelMap::new(&robot).hash(),
        }
    }

    /// A period passes, then a turn; the runs of the frames that went out.
    fn turn(&mut self) -> Vec<u64> {
        let next = self.cycle.turn(&mut self.stage, &self.clock).unwrap();
        assert!(next.is_continue());
        let mut runs = Vec::new();
        while let Some(frame) = self.published.take_next() {
            runs.push(frame.run_id);
        }
        self.clock.advance(PERIOD_NS);
        runs
    }

    /// A frame of this epoch, due now.
    fn frame(&self, epoch: u64, seq: u64) -> [u8; datagram::DATAGRAM_SIZE] {
        let mut frame = SensorFrame {
            run_id: 5,
            robot_hash: self.robot_hash,
            ..SensorFrame::default()
        };
        frame.header.schema = SensorFrame::SCHEMA;
        (frame.header.epoch, frame.header.seq) = (epoch, seq);
        frame.header.t_schedule_ns = self.clock.now_ns();
        frame.header.t_capture_ns = self.clock.now_ns();
        datagram::encode(&frame)
    }

    /// Another stage decides, on the frame captured at `t_capture_ns`, what is valid for 5 ms.
    fn decide(&mut self, t_capture_ns: u64, reported: u32) {
        let now_ns = self.clock.now_ns();
        let stamp = Stamp {
            t_schedule_ns: now_ns,
            t_capture_ns,
        };
        let belief = self.beliefs.block();
        (belief.reported, belief.p[1]) = (reported, 0.9);
        self.beliefs.send(stamp, &self.clock).unwrap();
        let action = self.actions.block();
        (action.action, action.valid_until_ns) = (1, now_ns + 5_000_000);
        self.actions.send(stamp, &self.clock).unwrap();
    }

    fn rejected(&self, cause: Rejection) -> u64 {
        self.cycle.account().health().view().rejected[cause as usize]
    }
}

#[test]
fn the_first_good_source_is_the_graphs_until_it_is_silent_for_a_second() {
    let mut border = Border::new("source");
    let to = border.datagrams.udp_address().unwrap();
    let [first, other] = [(); 2].map(|()| UdpSocket::bind("127.0.0.1:0").unwrap());
    // Garbage makes nobody a source.
    other.send_to(b"garbage", to).unwrap();
    assert!(border.turn().is_empty());
    assert_eq!(border.rejected(Rejection::Malformed), 1);
    first.send_to(&border.frame(1, 0), to).unwrap();
    let [run] = border.turn()[..] else {
        panic!("one frame")
    };
    assert_eq!(run & 0xffff, 5, "runs of a source can be told apart by eye");
    for seq in 1..50 {
        // The kernel refuses it, or the stage.
        let _ = other.send_to(&border.frame(2, seq), to);
        first.send_to(&border.frame(1, seq), to).unwrap();
        assert_eq!(border.turn(), [run]);
    }
    // Silent: for a second still the source.
    for _ in 0..100 {
        let _ = other.send_to(&border.frame(2, 50), to);
        assert!(border.turn().is_empty());
    }
    border.turn();
    // An old rejection may come back to the sender first.
    let _ = other.send_to(&border.frame(2, 60), to);
    other.send_to(&border.frame(2, 61), to).unwrap();
    // A new start is a new run, also for a service that begins just now.
    let next = border.turn().pop().unwrap();
    assert_ne!(next, run);
    for (epoch, run) in [(1, run), (2, next)] {
        let mut restarted = Border::new("restarted");
        let to = restarted.datagrams.udp_address().unwrap();
        first.send_to(&restarted.frame(epoch, 0), to).unwrap();
        assert_eq!(restarted.turn(), [run]);
    }
}

#[test]
fn a_flood_by_udp_does_not_shut_out_a_source_on_the_unix_socket() {
    let mut border = Border::new("flood");
    let to = border.datagrams.udp_address().unwrap();
    let flood = UdpSocket::bind("127.0.0.1:0").unwrap();
    let source = UnixDatagram::unbound().unwrap();
    for seq in 0..100 {
        for n in 0..100 {
            let _ = flood.send_to(&border.frame(0, n), to);
        }
        source.send_to(&border.frame(1, seq), &border.file).unwrap();
        assert_eq!(border.turn().len(), 1, "{seq}");
    }
    // From the first good frame on the kernel threw the others away.
    assert!(border.rejected(Rejection::NoEpoch) <= 64);
    assert!(border.rejected(Rejection::OtherWriter) <= 100);
}

#[test]
fn frames_that_come_together_all_go_out() {
    let mut border = Border::new("burst");
    let source = UnixDatagram::unbound().unwrap();
    let mut sent = Vec::new();
    for seq in 0..8 {
        sent.push(border.frame(1, seq));
        border.clock.advance(PERIOD_NS);
    }
    for bytes in &sent {
        source.send_to(bytes, &border.file).unwrap();
    }
    assert_eq!(border.turn().len(), 8);
    assert_eq!(border.cycle.account().health().view().lost, 0);
}

/// The verdicts that wait at a socket.
fn verdicts(of: &UdpSocket) -> Vec<Verdict> {
    of.set_nonblocking(true).unwrap();
    let mut buffer = [0; 2 * datagram::VERDICT_DATAGRAM_SIZE];
    let mut all = Vec::new();
    while let Ok(length) = of.recv(&mut buffer) {
        all.push(datagram::decode_verdict(&buffer[..length]).unwrap());
    }
    all
}

#[test]
fn each_decision_goes_to_the_source_and_to_nobody_else() {
    let mut border = Border::new("verdicts");
    let to = border.datagrams.udp_address().unwrap();
    let [first, other] = [(); 2].map(|()| UdpSocket::bind("127.0.0.1:0").unwrap());
    // Before there is a source, nobody is answered.
    border.decide(1, 0);
    border.turn();
    first.send_to(&border.frame(1, 0), to).unwrap();
    let _ = other.send_to(&border.frame(2, 0), to);
    border.turn();
    assert_eq!(verdicts(&first), []);
    border.decide(77, 1);
    border.turn();
    border.decide(78, vigil_blocks::MODE_UNKNOWN);
    // Without a new decision nothing is said again.
    border.turn();
    border.turn();
    let [known, unknown] = verdicts(&first).try_into().unwrap();
    assert_eq!((known.header.seq, known.header.t_capture_ns), (0, 77));
    assert_eq!((known.valid_for_ns, known.p_mode), (5_000_000, 0.9));
    assert_eq!(known.mode_name, vigil_blocks::fixed_name("LF_STUCK"));
    assert_eq!(known.runner_up_name, vigil_blocks::fixed_name("ND"));
    assert_eq!(known.action_name, vigil_blocks::fixed_name("go_on"));
    assert_eq!((unknown.header.seq, unknown.header.t_capture_ns), (1, 78));
    assert_eq!(unknown.mode_name, vigil_blocks::fixed_name("UNKNOWN"));
    assert_eq!(verdicts(&other), []);
}
