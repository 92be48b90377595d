//! A robot of 24 channels and 36 components, simulated for the time that its diagnosis takes.

use std::error::Error;

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use vigil_blocks::SensorFrame;
use vigil_robot::{Description, channel};

/// Frames and observations a second.
pub const RATE_HZ: f64 = 10.0;
/// Wheels, three on each side.
const WHEELS: usize = 6;
/// Channels beside pose, wheel rates, currents and gyro.
const FURTHER: usize = 8;
/// Faults that it declares.
const DECLARED: usize = 8;
const RADIUS_M: f64 = 0.1;
const HALF_TRACK_M: f64 = 0.3;
/// Places of channels in a frame.
const RATES: usize = 3;
const YAW_RATE: usize = RATES + WHEELS;
const CURRENTS: usize = YAW_RATE + 1;
const OTHERS: usize = CURRENTS + WHEELS;

/// What is broken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Broken {
    /// Nothing.
    Nothing,
    /// A wheel's encoder.
    Encoder,
    /// An encoder, and the gyro beside it.
    EncoderAndGyro,
}

/// Its description.
///
/// # Errors
/// None that a user could mend.
pub fn description() -> Result<Description, Box<dyn Error>> {
    let wheels = (0..WHEELS).map(|i| {
        let (x, y) = (0.4 * (i / 2) as f64 - 0.4, side(i) * HALF_TRACK_M);
        format!("{{ name = \"W{i}\", x = {x}, y = {y}, steered = false }}")
    });
    let further =
        (0..FURTHER).map(|i| format!("[[channel]]\nname = \"further_{i}\"\nunit = \"bar\"\n"));
    let declared = (0..DECLARED).map(|i| {
        let (one, other) = (i % FURTHER, i % WHEELS);
        format!("[[fault]]\nname = \"F{i}\"\nshows = [\"further_{one}\", \"current_W{other}\"]\n")
    });
    let text = format!(
        "name = \"large\"\nkinematics = \"differential\"\nwheel_radius_m = {RADIUS_M}\n\
         polynomial_order = 2\ninterval_s = {}\n\
         command = [{{ name = \"v\", unit = \"m/s\", limit = 1.0 }}, \
         {{ name = \"w\", unit = \"rad/s\", limit = 1.5 }}]\n\
         wheels = [{}]\n\
         [measured]\npose = true\nwheel_rates = true\nsteer = false\nyaw_rate = true\n\
         currents = true\n\
         [limits]\nspeed_m_s = 1.0\nyaw_rate_rad_s = 1.5\nwheel_rate_rad_s = 30.0\n{}{}",
        1.0 / RATE_HZ,
        wheels.collect::<Vec<_>>().join(", "),
        further.collect::<String>(),
        declared.collect::<String>(),
    );
    Ok(toml::from_str(&text)?)
}

/// Left wheels have even numbers.
fn side(wheel: usize) -> f64 {
    if wheel.is_multiple_of(2) { 1.0 } else { -1.0 }
}

/// The robot as it drives.
#[derive(Debug)]
pub struct LargeRobot {
    robot_hash: u64,
    rng: Pcg64Mcg,
    frames: u64,
    pose: [f64; 3],
    twist: [f64; 2],
    told: [f64; 2],
}

impl LargeRobot {
    /// At rest.
    #[must_use]
    pub fn new(robot: &Description, seed: u64) -> Self {
        Self {
            robot_hash: channel::hash(robot),
            rng: Pcg64Mcg::seed_from_u64(seed),
            frames: 0,
            pose: [0.0; 3],
            twist: [0.0; 2],
            told: [0.0; 2],
        }
    }

    /// The next frame.
    pub fn frame(&mut self, broken: Broken) -> SensorFrame {
        if self.frames.is_multiple_of((4.0 * RATE_HZ) as u64) {
            self.told = match self.rng.random_range(0..5) {
                0 => [0.0; 2],
                _ => [
                    self.rng.random_range(-0.4..1.0),
                    self.rng.random_range(-1.0..1.0),
                ],
            };
        }
        for (is, told) in self.twist.iter_mut().zip(self.told) {
            *is += 0.3 * (told - *is);
        }
        let [v, w] = self.twist;
        let heading = self.pose[2] + 0.5 * w / RATE_HZ;
        self.pose[0] += v * heading.cos() / RATE_HZ;
        self.pose[1] += v * heading.sin() / RATE_HZ;
        self.pose[2] += w / RATE_HZ;
        let mut frame = SensorFrame::default();
        (frame.run_id, frame.robot_hash) = (1, self.robot_hash);
        frame.header.seq = self.frames;
        frame.header.t_capture_ns = (self.frames as f64 / RATE_HZ * 1e9) as u64;
        self.frames += 1;
        let mut noise = |sd: f64| sd * self.rng.sample::<f64, _>(StandardNormal);
        frame.set_command(0, self.told[0]);
        frame.set_command(1, self.told[1]);
        frame.set_channel(0, self.pose[0] + noise(0.01));
        frame.set_channel(1, self.pose[1] + noise(0.01));
        let yaw = vigil_inference::angle::wrap(self.pose[2] + noise(0.01));
        frame.set_channel(2, yaw);
        for wheel in 0..WHEELS {
            let rate = (v - side(wheel) * HALF_TRACK_M * w) / RADIUS_M;
            frame.set_channel(RATES + wheel, rate + noise(0.3));
            frame.set_channel(CURRENTS + wheel, 0.5 + 0.1 * rate + noise(0.1));
        }
        frame.set_channel(YAW_RATE, w + noise(0.03));
        for i in 0..FURTHER {
            let of_command = (i as f64 + 1.0) * v - 0.5 * w * side(i);
            frame.set_channel(OTHERS + i, of_command + noise(0.5));
        }
        if broken != Broken::Nothing {
            frame.set_channel(RATES, 0.0);
        }
        if broken == Broken::EncoderAndGyro {
            frame.set_channel(YAW_RATE, 2.0 * w + 0.7);
        }
        frame
    }
}
