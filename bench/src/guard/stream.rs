//! A publisher and the border that it sends to.

use vigil_blocks::datagram;
use vigil_blocks::{Block, REJECTIONS, Rejection, SensorFrame};
use vigil_cycle::{InputAccount, Writer};
use vigil_robot::{Description, FrameGuard};

/// Period of the schedule, ns.
pub const PERIOD_NS: u64 = 10_000_000;
/// When the stream begins, ns.
const START_NS: u64 = 1_000_000_000_000;

/// Good frames, one a period, and the border's account of them. Every frame travels as a datagram.
pub struct Stream<'a> {
    recorded: &'a [SensorFrame],
    account: InputAccount,
    content: FrameGuard,
    /// The publisher's next frame is of this period.
    pub period: u64,
    /// Its next sequence number.
    pub seq: u64,
    /// Its epoch.
    pub epoch: u64,
    /// Frames past the guard that hold a number that is not finite.
    pub not_finite_past: u64,
}

impl<'a> Stream<'a> {
    /// A stream of these frames, in a circle, of a robot.
    #[must_use]
    pub fn new(robot: &Description, recorded: &'a [SensorFrame]) -> Self {
        Self {
            recorded,
            account: InputAccount::of(Writer::Stranger),
            content: FrameGuard::new(robot),
            period: 0,
            seq: 0,
            epoch: 1,
            not_finite_past: 0,
        }
    }

    /// The receiver's clock, ns.
    #[must_use]
    pub const fn now_ns(&self) -> u64 {
        START_NS + self.period * PERIOD_NS
    }

    /// The frame that is due now.
    #[must_use]
    pub fn good(&self) -> SensorFrame {
        let count = self.recorded.len() as u64;
        // One run throughout: where the recording begins anew, the pose moves by a few metres.
        let mut frame = self.recorded[(self.period % count) as usize];
        let header = &mut frame.header;
        header.schema = SensorFrame::SCHEMA;
        (header.epoch, header.seq) = (self.epoch, self.seq);
        header.t_schedule_ns = self.now_ns();
        header.t_capture_ns = self.now_ns();
        header.t_publish_ns = self.now_ns();
        frame
    }

    /// A period passes; the publisher has sent what it was to send.
    pub const fn pass(&mut self) {
        self.period += 1;
        self.seq += 1;
    }

    /// Sends the good frame that is due; true if it was taken.
    pub fn send_good(&mut self) -> bool {
        let frame = self.good();
        let is_taken = self.send(&frame).is_none();
        self.pass();
        is_taken
    }

    /// Sends a frame now; why it was refused.
    pub fn send(&mut self, frame: &SensorFrame) -> Option<Rejection> {
        self.send_bytes(&datagram::encode(frame))
    }

    /// Sends bytes now; why they were refused.
    pub fn send_bytes(&mut self, bytes: &[u8]) -> Option<Rejection> {
        let before = self.account.rejected;
        let frame = match datagram::decode(bytes) {
            Ok(frame) => frame,
            Err(rejection) => {
                self.account.reject(rejection);
                return self.cause(before);
            }
        };
        let content = || self.content.check(&frame);
        let now_ns = START_NS + self.period * PERIOD_NS;
        let arrival = self
            .account
            .admit::<SensorFrame>(&frame.header, now_ns, PERIOD_NS, content);
        if arrival.is_taken() {
            self.not_finite_past += u64::from(numbers(&frame).any(|value| !value.is_finite()));
        }
        self.cause(before)
    }

    /// The one counter that rose.
    fn cause(&self, before: [u64; REJECTIONS]) -> Option<Rejection> {
        let rose = |cause: &Rejection| {
            let i = *cause as usize;
            self.account.rejected[i] > before[i]
        };
        Rejection::ALL.into_iter().find(rose)
    }

    /// Frames lost so far, by the border's account.
    #[must_use]
    pub const fn lost(&self) -> u64 {
        self.account.lost
    }

    /// True while the border trusts nothing of this publisher.
    #[must_use]
    pub const fn is_quarantined(&self) -> bool {
        self.account.is_quarantined()
    }
}

/// Every number of a frame that a filter may read.
fn numbers(frame: &SensorFrame) -> impl Iterator<Item = f64> {
    let groups: [&[f64]; 7] = [
        &frame.command,
        &frame.pose,
        &frame.planned_pose,
        std::slice::from_ref(&frame.yaw_rate),
        &frame.wheel_rate,
        &frame.steer,
        &frame.current,
    ];
    groups.into_iter().flatten().copied()
}
