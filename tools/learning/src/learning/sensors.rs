//! Noise of the sensors, and what encoders do in health and when broken.

use vigil_inference::angle::wrap;
use vigil_robot::Description;
use vigil_robot::learned::{Model, Observation};

use super::LearnError;
use super::bounds::{BROKEN_SD, CLIP, REPEAT_RATE};
use super::segments::Segments;

/// Fits sensor noise, command range, repeat rate and a broken encoder's noise.
///
/// # Errors
/// [`LearnError::Missing`] if nominal runs hold no pose.
pub fn fit(model: &mut Model, segments: &Segments, robot: &Description) -> Result<(), LearnError> {
    let missing = |missing| LearnError::Missing {
        mode: "ND".into(),
        missing,
    };
    let described = model.noise;
    let rate = described.reference_rate_hz;
    let position = pose_sd(segments, 0, described.position_m, rate);
    let second = pose_sd(segments, 1, described.position_m, rate);
    let yaw = pose_sd(segments, 2, described.yaw_rad, rate);
    let (Some(x), Some(y), Some(yaw)) = (position, second, yaw) else {
        return Err(missing("pose in motion"));
    };
    model.noise.position_m = (0.5 * (x * x + y * y)).sqrt();
    model.noise.yaw_rad = yaw;
    if let Some(sd) = wheel_sd(
        segments,
        described.wheel_rate_rad_s,
        rate,
        robot.wheels.len(),
    ) {
        model.noise.wheel_rate_rad_s = sd;
    }
    let moving = || segments.nominal.iter().flatten().filter(|o| o.moving);
    let largest = |value: fn(&Observation) -> f64| moving().map(value).fold(0.0, f64::max);
    model.command.curvature_max_1_m = largest(|o| o.command[0].abs());
    let slowest = moving()
        .map(|o| o.command[1].abs())
        .fold(f64::INFINITY, f64::min);
    model.command.speed_range_m_s = [slowest, largest(|o| o.command[1].abs())];
    fit_encoder(model, segments, robot);
    Ok(())
}

/// Root mean square second difference over √6, scaled to the reference rate.
fn pose_sd(segments: &Segments, axis: usize, described: f64, rate: f64) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0.0);
    for three in segments
        .nominal
        .iter()
        .flat_map(|segment| segment.windows(3))
    {
        if three
            .iter()
            .any(|o| !o.moving || o.anchor || o.pose_frames == 0)
        {
            continue;
        }
        let scale = f64::from(three[1].pose_frames) * three[1].frame_s * rate;
        let up = three[2].pose[axis] - three[1].pose[axis];
        let down = three[1].pose[axis] - three[0].pose[axis];
        let bend = if axis == 2 {
            wrap(wrap(up) - wrap(down))
        } else {
            up - down
        };
        let variance = bend * bend * scale / 6.0;
        if variance < CLIP * CLIP * described * described {
            sum += variance;
            count += 1.0;
        }
    }
    (count > 0.0 && sum > 0.0).then(|| f64::sqrt(sum / count))
}

fn wheel_sd(segments: &Segments, described: f64, rate: f64, wheels: usize) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0.0);
    for two in segments
        .nominal
        .iter()
        .flat_map(|segment| segment.windows(2))
    {
        for i in 0..wheels {
            let (a, b) = (&two[0].wheels[i], &two[1].wheels[i]);
            if a.plain == 0 || b.plain == 0 || !two.iter().all(|o| o.moving) {
                continue;
            }
            let step = b.mean - a.mean;
            let variance = step * step * f64::from(b.plain) * two[1].frame_s * rate / 2.0;
            if variance < CLIP * CLIP * described * described {
                sum += variance;
                count += 1.0;
            }
        }
    }
    (count > 0.0 && sum > 0.0).then(|| f64::sqrt(sum / count))
}

fn fit_encoder(model: &mut Model, segments: &Segments, robot: &Description) {
    let (mut repeats, mut samples) = (0.0, 0.0);
    for observation in segments.nominal.iter().flatten().filter(|o| o.moving) {
        for reading in &observation.wheels[..robot.wheels.len()] {
            repeats += f64::from(reading.repeats);
            samples += f64::from(reading.count());
        }
    }
    if samples > 0.0 {
        model.encoder.repeat_rate = REPEAT_RATE.hold((repeats + 1.0) / (samples + 2.0));
    }
    let (mut count, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for (wheel, segment) in &segments.noisy {
        for reading in segment
            .iter()
            .map(|o| &o.wheels[*wheel])
            .filter(|r| r.plain > 0)
        {
            let plain = f64::from(reading.plain);
            count += plain;
            sum += reading.mean * plain;
            squares += reading.squares + reading.mean * reading.mean * plain;
        }
    }
    if count > 10.0 {
        let mean = sum / count;
        model.encoder.broken_mean_rad_s = mean;
        let variance = squares / count - mean * mean;
        model.encoder.broken_sd_rad_s = BROKEN_SD.hold(variance.max(0.0).sqrt());
    }
}
