//! Runs made from recorded ones: an encoder that dies to noise, and noisier sensors.
//!
//! What is made is the sensor's part alone, where it is known exactly; the robot's motion is the
//! recorded one. The same run and seed give the same values, on a grid as fine as recordings have.

use std::io::{self, Write};

use rand::SeedableRng;
use rand_distr::{Distribution, Normal, NormalError};
use rand_pcg::Pcg64Mcg;
use vigil_blocks::SensorFrame;
use vigil_inference::angle::wrap;
use vigil_robot::Description;
use vigil_robot::learned::model::Noise;

use vigil_recording::frames::Run;
use vigil_recording::labels::Label;

/// Grid on which derived values lie, as the recorded ones do: parts of a unit.
const PER_UNIT: f64 = 1e4;

/// A run and what was wrong in it.
pub type Labelled = (Run, Label);

/// The nominal run with an encoder that reads nothing but noise of `sd_rad_s` from `onset_s` on:
/// unlike one that reads exactly 0, it looks like that of a wheel that stands. Kind `dead`.
///
/// # Errors
/// If `sd_rad_s` is no standard deviation.
pub fn dead_encoder(
    (run, label): (&Run, &Label),
    id: u32,
    (wheel, name): (usize, &str),
    onset_s: f64,
    (sd_rad_s, seed): (f64, u64),
) -> Result<Labelled, NormalError> {
    let noise = Normal::new(0.0, sd_rad_s)?;
    let mut rng = generator(id, seed);
    let mut run = run.clone();
    run.id = id;
    for frame in &mut run.frames {
        frame.run_id = u64::from(id) + 1;
        if seconds(frame) >= onset_s {
            frame.wheel_rate[wheel] = on_grid(noise.sample(&mut rng));
        }
    }
    let label = Label {
        run: id,
        mode: format!("{name}_ENC"),
        kind: "dead".into(),
        wheel: Some(wheel),
        onset_s: Some(onset_s),
        ..label.clone()
    };
    Ok((run, label))
}

/// The run with `factor` times the recorded noise on pose, wheel rates and steering angles: white
/// noise is added. `recorded` is the noise per sample of the recording. What a broken encoder
/// reads is left as it is.
///
/// # Errors
/// If `factor` is below 1 or not finite.
pub fn noisier(
    (run, label): (&Run, &Label),
    recorded: &Noise,
    robot: &Description,
    factor: f64,
    seed: u64,
) -> Result<Run, NormalError> {
    let more = (factor * factor - 1.0).sqrt();
    let noise = |sd: f64| Normal::new(0.0, more * sd);
    let (position, yaw) = (noise(recorded.position_m)?, noise(recorded.yaw_rad)?);
    let (rate, steer) = (
        noise(recorded.wheel_rate_rad_s)?,
        noise(recorded.steer_rad)?,
    );
    let mut rng = generator(run.id, seed);
    let mut run = run.clone();
    let broken = label.wheel.filter(|_| label.mode.ends_with("_ENC"));
    let onset_s = label.onset_s.unwrap_or(f64::INFINITY);
    for frame in &mut run.frames {
        let is_broken = seconds(frame) >= onset_s;
        for axis in 0..2 {
            frame.pose[axis] = on_grid(frame.pose[axis] + position.sample(&mut rng));
        }
        frame.pose[2] = on_grid(wrap(frame.pose[2] + yaw.sample(&mut rng)));
        for (i, wheel) in robot.wheels.iter().enumerate() {
            // Drawn in any case: other wheels' values do not depend on what is broken.
            let (rate, steer) = (rate.sample(&mut rng), steer.sample(&mut rng));
            if !(is_broken && broken == Some(i)) {
                frame.wheel_rate[i] = on_grid(frame.wheel_rate[i] + rate);
            }
            if wheel.steered {
                frame.steer[i] = on_grid(frame.steer[i] + steer);
            }
        }
    }
    Ok(run)
}

fn seconds(frame: &SensorFrame) -> f64 {
    frame.header.t_capture_ns as f64 * 1e-9
}

fn on_grid(value: f64) -> f64 {
    (value * PER_UNIT).round() / PER_UNIT
}

fn generator(run: u32, seed: u64) -> Pcg64Mcg {
    Pcg64Mcg::seed_from_u64(seed ^ u64::from(run).rotate_left(32))
}

/// Writes runs as [`vigil_recording::frames::read`] reads them.
///
/// # Errors
/// The writer's.
pub fn write_frames<'a>(
    to: &mut impl Write,
    robot: &Description,
    runs: impl IntoIterator<Item = &'a Run>,
) -> io::Result<()> {
    let wheels = || robot.wheels.iter().enumerate();
    write!(to, "run,t,x,y,yaw,cmd_curv,cmd_speed")?;
    for (_, wheel) in wheels() {
        write!(to, ",enc_{}", wheel.name)?;
    }
    for (_, wheel) in wheels().filter(|(_, wheel)| wheel.steered) {
        write!(to, ",steer_{}", wheel.name)?;
    }
    writeln!(to)?;
    for run in runs {
        for frame in &run.frames {
            let ([x, y, yaw], [curvature, speed, ..]) = (frame.pose, frame.command);
            let t_s = seconds(frame);
            write!(to, "{},{t_s:.9},{x},{y},{yaw},{curvature},{speed}", run.id)?;
            for (i, _) in wheels() {
                write!(to, ",{}", frame.wheel_rate[i])?;
            }
            for (i, _) in wheels().filter(|(_, wheel)| wheel.steered) {
                write!(to, ",{}", frame.steer[i])?;
            }
            writeln!(to)?;
        }
    }
    Ok(())
}

/// Writes labels as [`vigil_recording::labels::read`] reads them.
///
/// # Errors
/// The writer's.
pub fn write_labels<'a>(
    to: &mut impl Write,
    robot: &Description,
    labels: impl IntoIterator<Item = &'a Label>,
) -> io::Result<()> {
    writeln!(to, "run,mode,kind,wheel,onset_s,cmd_curv,cmd_speed,dur_s")?;
    for label in labels {
        let wheel = label
            .wheel
            .map_or("", |wheel| robot.wheels[wheel].name.as_str());
        let Label {
            run, mode, kind, ..
        } = label;
        let onset_s = label.onset_s.unwrap_or(-1.0);
        let (curvature, speed) = (label.command_curvature_1_m, label.command_speed_m_s);
        let duration_s = label.duration_s;
        writeln!(
            to,
            "{run},{mode},{kind},{wheel},{onset_s},{curvature},{speed},{duration_s}"
        )?;
    }
    Ok(())
}
