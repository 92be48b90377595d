//! Datagrams in a row, decoded and judged as at the graph's border: nothing panics, and nothing
//! that is not finite or out of bounds gets past it.
#![no_main]

use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use vigil_blocks::datagram::{self, DATAGRAM_SIZE};
use vigil_blocks::{Block, SensorFrame};
use vigil_cycle::{InputAccount, Writer};
use vigil_robot::frame_guard::{POSITION_MAX_M, STEER_MAX_RAD, YAW_MAX_RAD};
use vigil_robot::{Description, FrameGuard};

const PERIOD_NS: u64 = 10_000_000;

static GUARD: LazyLock<FrameGuard> = LazyLock::new(|| {
    let text = include_str!("../../../../config/robots/rover.toml");
    let Ok(robot) = toml::from_str::<Description>(text) else {
        // Without the rover's description nothing would be tested.
        std::process::abort();
    };
    FrameGuard::new(&robot)
});

/// Half of the time the fuzzer need not guess the checksum and the schema.
fn mended(bytes: &[u8]) -> Vec<u8> {
    let (first, rest) = bytes.split_first().map_or((0, bytes), |(f, r)| (*f, r));
    if first % 2 == 0 || rest.len() < size_of::<SensorFrame>() {
        return rest.to_vec();
    }
    let mut frame: SensorFrame =
        bytemuck::pod_read_unaligned(&rest[..size_of::<SensorFrame>()]);
    frame.header.schema = SensorFrame::SCHEMA;
    datagram::encode(&frame).to_vec()
}

fuzz_target!(|input: &[u8]| {
    let mut account = InputAccount::new(Writer::Stranger);
    let mut guard = GUARD.clone();
    let mut now_ns = 60_000_000_000;
    for bytes in input.chunks(DATAGRAM_SIZE + 1) {
        now_ns += PERIOD_NS;
        let frame = match datagram::decode(&mended(bytes)) {
            Ok(mut frame) => {
                if frame.header.t_schedule_ns == 0 {
                    frame.header.t_schedule_ns = now_ns;
                }
                frame
            }
            Err(rejection) => {
                assert!(!account.reject(rejection).is_taken());
                continue;
            }
        };
        let content = || guard.check(&frame);
        let arrival = account.admit::<SensorFrame>(&frame.header, now_ns, PERIOD_NS, content);
        if arrival.is_taken() {
            let numbers = frame.channel.iter().chain(&frame.command).chain(&frame.planned_pose);
            assert!(numbers.copied().all(f64::is_finite));
            // The rover: pose x, y, yaw in channels 0 to 2, steering angles in 9 to 12.
            let bounds = [(0..2, POSITION_MAX_M), (2..3, YAW_MAX_RAD), (9..13, STEER_MAX_RAD)];
            for (mut places, bound) in bounds {
                assert!(places.all(|i| frame.measured(i).is_none_or(|v| v.abs() <= bound)));
            }
        }
    }
});
