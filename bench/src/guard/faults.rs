//! What a publisher may send that is wrong.

use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use vigil_blocks::datagram::{self, DATAGRAM_SIZE};
use vigil_blocks::{Rejection, SensorFrame};

use super::stream::{PERIOD_NS, Stream};

/// Frames of a second.
const SECOND_PERIODS: u64 = 1_000_000_000 / PERIOD_NS;

/// A kind of fault: injects one, and says if the border found it by its right cause.
pub type Inject = fn(&mut Stream<'_>, &mut Pcg64Mcg) -> bool;

/// Every kind, with the faults of the threat list that it belongs to.
pub const KINDS: [(&str, Inject); 19] = [
    ("another schema", another_schema),
    ("no epoch", no_epoch),
    ("a second publisher", second_publisher),
    ("a frame repeated", repeated),
    ("frames in the wrong order", wrong_order),
    ("frames lost", lost),
    ("sequence numbers that wrap around", wrapped),
    ("a restart", restart),
    ("a flood of good frames", flood),
    ("NaN or infinity", not_finite),
    ("1e308", huge),
    (
        "steering angles of more than 3.2 degrees, in degrees",
        steering_in_degrees,
    ),
    ("a pose in millimetres, within a run", millimetres),
    ("a clock ahead", ahead),
    ("a clock behind", behind),
    ("a capture time that stands", standing),
    ("a capture clock that was set", clock_set),
    ("a flipped bit", flipped_bit),
    ("a wrong length", wrong_length),
];

fn spoilt(stream: &mut Stream<'_>, spoil: impl FnOnce(&mut SensorFrame)) -> Option<Rejection> {
    let mut frame = stream.good();
    spoil(&mut frame);
    let cause = stream.send(&frame);
    stream.pass();
    cause
}

fn another_schema(stream: &mut Stream<'_>, random: &mut Pcg64Mcg) -> bool {
    let other = random.random::<u64>() | 1;
    let cause = spoilt(stream, |frame| frame.header.schema ^= other);
    // It never counted: the next frame is after a gap, and taken.
    cause == Some(Rejection::Schema)
}

fn no_epoch(stream: &mut Stream<'_>, _: &mut Pcg64Mcg) -> bool {
    spoilt(stream, |frame| frame.header.epoch = 0) == Some(Rejection::NoEpoch)
}

fn second_publisher(stream: &mut Stream<'_>, random: &mut Pcg64Mcg) -> bool {
    let mut other = stream.good();
    other.header.epoch ^= random.random::<u64>() | 1;
    other.header.epoch = other.header.epoch.max(1);
    stream.send(&other) == Some(Rejection::OtherWriter) && stream.send_good()
}

fn repeated(stream: &mut Stream<'_>, _: &mut Pcg64Mcg) -> bool {
    let frame = stream.good();
    let first = stream.send(&frame);
    let second = stream.send(&frame);
    stream.pass();
    (first, second) == (None, Some(Rejection::Repeated))
}

fn wrong_order(stream: &mut Stream<'_>, random: &mut Pcg64Mcg) -> bool {
    let mut old = stream.good();
    old.header.seq -= random.random_range(2..=stream.seq);
    let cause = stream.send(&old);
    cause == Some(Rejection::WrongSequence) && stream.send_good()
}

fn lost(stream: &mut Stream<'_>, random: &mut Pcg64Mcg) -> bool {
    let (before, count) = (stream.lost(), random.random_range(1..=1000));
    for _ in 0..count {
        stream.pass();
    }
    stream.send_good() && stream.lost() - before == count
}

fn wrapped(stream: &mut Stream<'_>, _: &mut Pcg64Mcg) -> bool {
    stream.seq += 10_000;
    stream.send_good();
    // It counts from 0 again, in the same epoch: refused for a second, then believed.
    stream.seq = 0;
    let mut found = true;
    for _ in 0..SECOND_PERIODS {
        found &= stream.send(&stream.good()) == Some(Rejection::WrongSequence);
        stream.pass();
    }
    found && stream.send_good() && stream.send_good()
}

fn restart(stream: &mut Stream<'_>, random: &mut Pcg64Mcg) -> bool {
    stream.epoch += random.random_range(1..1_000_000);
    stream.seq = 0;
    let before = stream.lost();
    // Within a second it might be a second publisher; after it, it is believed.
    let too_soon = stream.send(&stream.good()) == Some(Rejection::OtherWriter);
    stream.period += SECOND_PERIODS + 1;
    stream.seq = 0;
    let is_taken = too_soon && stream.send_good();
    // So that an older frame can be sent later.
    (0..4).for_each(|_| {
        stream.send_good();
    });
    is_taken && stream.lost() == before
}

fn flood(stream: &mut Stream<'_>, random: &mut Pcg64Mcg) -> bool {
    let mut found = stream.send(&stream.good()).is_none();
    let extra = random.random_range(100..1000);
    for k in 1..=extra {
        stream.seq += 1;
        let mut frame = stream.good();
        frame.header.t_schedule_ns += random.random_range(0..PERIOD_NS / 4);
        // Each is captured after the one before it, and all before the next good one.
        frame.header.t_capture_ns += k;
        found &= stream.send(&frame) == Some(Rejection::Early);
    }
    stream.pass();
    found && stream.send_good() && !stream.is_quarantined()
}

/// One of the numbers that a filter may read.
fn any_number<'a>(frame: &'a mut SensorFrame, random: &mut Pcg64Mcg) -> &'a mut f64 {
    match random.random_range(0..7) {
        0 => &mut frame.command[random.random_range(0..4)],
        1 => &mut frame.pose[random.random_range(0..3)],
        2 => &mut frame.planned_pose[random.random_range(0..3)],
        3 => &mut frame.yaw_rate,
        4 => &mut frame.wheel_rate[random.random_range(0..8)],
        5 => &mut frame.steer[random.random_range(0..8)],
        _ => &mut frame.current[random.random_range(0..8)],
    }
}

fn not_finite(stream: &mut Stream<'_>, random: &mut Pcg64Mcg) -> bool {
    let values = [f64::NAN, -f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
    let value = values[random.random_range(0..values.len())];
    let cause = spoilt(stream, |frame| *any_number(frame, random) = value);
    cause == Some(Rejection::NotFinite)
}

fn huge(stream: &mut Stream<'_>, random: &mut Pcg64Mcg) -> bool {
    let value = if random.random::<bool>() {
        1e308
    } else {
        -1e308
    };
    let cause = spoilt(stream, |frame| {
        *any_number(frame, random) = value;
        // Only what is marked valid is read.
        frame.valid = u64::MAX;
    });
    cause == Some(Rejection::OutOfRange)
}

fn steering_in_degrees(stream: &mut Stream<'_>, random: &mut Pcg64Mcg) -> bool {
    // Smaller ones could be radians: no bound on a single frame tells them apart.
    let angle_deg: f64 = random.random_range(3.2..90.0);
    let wheel = [0, 2, 3, 5][random.random_range(0..4)];
    let cause = spoilt(stream, |frame| frame.steer[wheel] = angle_deg);
    cause == Some(Rejection::OutOfRange)
}

fn millimetres(stream: &mut Stream<'_>, random: &mut Pcg64Mcg) -> bool {
    // From one frame to the next, 0.2 m or more away from the origin.
    let place_m: f64 = random.random_range(0.2..100.0);
    let cause = spoilt(stream, |frame| frame.pose[0] += 1000.0 * place_m);
    // The way back is the same jump.
    cause == Some(Rejection::Jump) && spoilt(stream, |_| ()) == Some(Rejection::Jump)
}

/// Between one and another power of ten, evenly by the exponent.
fn between(random: &mut Pcg64Mcg, least: f64, most: f64) -> u64 {
    let exponent = random.random_range(least.log10()..most.log10());
    10.0_f64.powf(exponent) as u64
}

fn ahead(stream: &mut Stream<'_>, random: &mut Pcg64Mcg) -> bool {
    let by_ns = 2 * PERIOD_NS + between(random, 1e3, 1.8e18);
    let cause = spoilt(stream, |frame| frame.header.t_schedule_ns += by_ns);
    cause == Some(Rejection::Ahead)
}

fn behind(stream: &mut Stream<'_>, random: &mut Pcg64Mcg) -> bool {
    let by_ns = 10_000_000_000 + between(random, 1e3, 9e11);
    let cause = spoilt(stream, |frame| frame.header.t_schedule_ns -= by_ns);
    cause == Some(Rejection::Behind)
}

fn standing(stream: &mut Stream<'_>, random: &mut Pcg64Mcg) -> bool {
    let before_ns = stream.good().header.t_capture_ns;
    let frames = random.random_range(1..=50);
    stream.send_good()
        && (0..frames).all(|_| {
            let cause = spoilt(stream, |frame| frame.header.t_capture_ns = before_ns);
            cause == Some(Rejection::Clock)
        })
}

fn clock_set(stream: &mut Stream<'_>, random: &mut Pcg64Mcg) -> bool {
    // More than an hour ahead, or any time back; and after one frame right again.
    let hour_ns = 3_600_000_000_000;
    let t_ns = stream.good().header.t_capture_ns;
    let is_ahead = random.random();
    let set_ns = if is_ahead {
        t_ns.saturating_add(random.random_range(hour_ns + 1..=u64::MAX / 2))
    } else {
        t_ns - random.random_range(PERIOD_NS..=t_ns)
    };
    let set = spoilt(stream, |frame| frame.header.t_capture_ns = set_ns);
    // Setting it right sets it once more; from far ahead that is back, from little back it is not.
    let back = spoilt(stream, |_| ());
    let is_right = if is_ahead || t_ns - set_ns > hour_ns {
        back == Some(Rejection::Clock)
    } else {
        back.is_none()
    };
    set == Some(Rejection::Clock) && is_right
}

fn flipped_bit(stream: &mut Stream<'_>, random: &mut Pcg64Mcg) -> bool {
    let mut bytes = datagram::encode(&stream.good());
    let bit = random.random_range(0..8 * DATAGRAM_SIZE);
    bytes[bit / 8] ^= 1 << (bit % 8);
    let cause = stream.send_bytes(&bytes);
    stream.pass();
    let expected = if bit / 8 < 12 {
        Rejection::Malformed
    } else {
        Rejection::Corrupt
    };
    cause == Some(expected)
}

fn wrong_length(stream: &mut Stream<'_>, random: &mut Pcg64Mcg) -> bool {
    let mut bytes = datagram::encode(&stream.good()).to_vec();
    let length = random.random_range(0..2 * DATAGRAM_SIZE);
    bytes.resize(length + usize::from(length == DATAGRAM_SIZE), 0);
    let cause = stream.send_bytes(&bytes);
    stream.pass();
    cause == Some(Rejection::Malformed)
}
