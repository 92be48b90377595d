//! A Kobuki by its geometry: its wheels turn as it is told.

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use vigil_blocks::SensorFrame;
use vigil_recording::frames::Run;
use vigil_robot::{Description, channel};

/// One that drives about.
pub struct Kobuki {
    robot_hash: u64,
    rng: Pcg64Mcg,
    /// From then on its left wheel stands, s.
    stuck_s: f64,
}

impl Kobuki {
    /// `inject` holds `stuck:L@S`, or nothing.
    pub fn new(robot: &Description, inject: &[&str], seed: u64) -> Self {
        assert!(inject.len() <= 1, "{inject:?}");
        let stuck = inject.first().map(|it| it.strip_prefix("stuck:L@"));
        Self {
            robot_hash: channel::hash(robot),
            rng: Pcg64Mcg::seed_from_u64(seed),
            stuck_s: stuck.map_or(f64::INFINITY, |it| it.unwrap().parse().unwrap()),
        }
    }

    pub fn fill(&mut self, frame: &mut SensorFrame, t_s: f64) {
        (frame.run_id, frame.robot_hash) = (1, self.robot_hash);
        let mut noise = |sd: f64| sd * self.rng.sample::<f64, _>(StandardNormal);
        frame.set_command(0, 0.25 + 0.1 * (0.5 * t_s).sin());
        frame.set_command(1, 0.5 * (0.37 * t_s).sin());
        for (wheel, side) in [(0, -1.0), (1, 1.0)] {
            let stands = wheel == 0 && t_s > self.stuck_s;
            let speed = frame.command[0] + side * 0.115 * frame.command[1];
            let rate = if stands { 0.0 } else { speed / 0.035 };
            frame.set_channel(wheel, rate + noise(0.1));
            frame.set_channel(3 + wheel, 0.03 + noise(0.005));
        }
        let difference = frame.channel[1] - frame.channel[0];
        frame.set_channel(2, difference * 0.035 / 0.23 + noise(0.02));
    }

    /// A recorded drive.
    pub fn drive(mut self, rate_hz: f64, until_s: f64) -> Run {
        let frames = (0..(until_s * rate_hz) as u64).map(|seq| {
            let (mut frame, t_s) = (SensorFrame::default(), seq as f64 / rate_hz);
            frame.header.seq = seq;
            frame.header.t_capture_ns = (t_s * 1e9) as u64;
            self.fill(&mut frame, t_s);
            frame
        });
        Run {
            id: 0,
            frames: frames.collect(),
        }
    }
}
