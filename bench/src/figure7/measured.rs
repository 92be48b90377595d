//! Heading rates of recorded runs.

use serde_json::{Value, json};
use vigil_recording::frames::Run;
use vigil_recording::labels::Label;
use vigil_robot::kinematics::wrap_angle;

/// Time after the onset until the motion is steady, s.
const SETTLING_S: f64 = 1.0;
/// Commanded radii that differ by less belong to one cell, share.
const SAME_RADIUS: f64 = 0.02;

/// The recorded runs of one cell.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// Change of heading per metre commanded against the nominal runs of the same turn, rad/m.
    pub rad_m: f64,
    /// The same in % of theirs.
    pub percent: f64,
    /// Standard error of `rad_m` over the runs, rad/m.
    pub error_rad_m: f64,
    /// Speeds of the runs, m/s.
    pub speeds_m_s: Vec<f64>,
}

impl Measured {
    /// The cell of a wheel and a signed radius among `runs`; `None` without two runs of it and one
    /// nominal run of the same turn.
    #[must_use]
    pub fn of(runs: &[(&Run, &Label)], radius_m: f64, wheel: usize) -> Option<Self> {
        let here =
            |label: &Label| (label.command_curvature_1_m * radius_m - 1.0).abs() < SAME_RADIUS;
        let is_stuck = |label: &Label| label.kind == "stuck" && label.wheel == Some(wheel);
        let per_metre = |wanted: &dyn Fn(&Label) -> bool| -> Vec<(f64, f64)> {
            let cell = runs
                .iter()
                .filter(|(_, label)| here(label) && wanted(label));
            cell.filter_map(|(run, label)| {
                heading_rad_m(run, label).map(|heading| (heading, label.command_speed_m_s))
            })
            .collect()
        };
        let nominal = per_metre(&Label::is_nominal);
        let stuck = per_metre(&is_stuck);
        if nominal.is_empty() || stuck.len() < 2 {
            return None;
        }
        let mean = |of: &[(f64, f64)]| of.iter().map(|(h, _)| h).sum::<f64>() / of.len() as f64;
        let (healthy, centre) = (mean(&nominal), mean(&stuck));
        let squares: f64 = stuck.iter().map(|(h, _)| (h - centre).powi(2)).sum();
        let n = stuck.len() as f64;
        Some(Self {
            rad_m: centre - healthy,
            percent: 100.0 * (centre - healthy) / healthy,
            error_rad_m: (squares / (n - 1.0) / n).sqrt(),
            speeds_m_s: stuck.iter().map(|(_, speed)| *speed).collect(),
        })
    }

    /// Raw data.
    #[must_use]
    pub fn json(&self) -> Value {
        json!({
            "rad_m": self.rad_m, "percent": self.percent,
            "standard_error_rad_m": self.error_rad_m, "runs": self.speeds_m_s.len(),
        })
    }
}

/// Least-squares slope of the yaw over the metres commanded, in the steady part of a run, rad/m.
fn heading_rad_m(run: &Run, label: &Label) -> Option<f64> {
    let from_s = label.onset_s.unwrap_or(0.0) + SETTLING_S;
    let mut yaw: Option<(f64, f64)> = None;
    let (mut n, mut sum_t, mut sum_yaw, mut sum_tt, mut sum_ty) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for frame in &run.frames {
        let t_s = frame.header.t_capture_ns as f64 * 1e-9;
        let turned = match yaw {
            None => 0.0,
            Some((last, turned)) => turned + wrap_angle(frame.pose[2] - last),
        };
        yaw = Some((frame.pose[2], turned));
        if t_s >= from_s {
            let t_s = t_s - from_s;
            n += 1.0;
            sum_t += t_s;
            sum_yaw += turned;
            sum_tt += t_s * t_s;
            sum_ty += t_s * turned;
        }
    }
    let spread = n * sum_tt - sum_t * sum_t;
    let slope_rad_s = (n * sum_ty - sum_t * sum_yaw) / spread;
    (n > 2.0).then_some(slope_rad_s / label.command_speed_m_s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use vigil_blocks::SensorFrame;

    fn run(id: u32, rad_m: f64, onset_s: Option<f64>) -> (Run, Label) {
        // 0.2 m/s; 0.5 rad/m before the onset and while it settles, `rad_m` after it, around +-pi.
        let frames = (1..=300).map(|k| {
            let t_s = f64::from(k) * 0.05;
            let late_s = onset_s.map_or(0.0, |onset_s| (t_s - onset_s - 0.9).max(0.0));
            let mut frame = SensorFrame::default();
            frame.header.t_capture_ns = (t_s * 1e9).round() as u64;
            frame.pose[2] = wrap_angle(3.0 + 0.2 * (0.5 * t_s + (rad_m - 0.5) * late_s));
            frame
        });
        let label = Label {
            run: id,
            mode: String::new(),
            kind: if onset_s.is_some() { "stuck" } else { "" }.to_owned(),
            wheel: onset_s.map(|_| 4),
            onset_s,
            command_curvature_1_m: 0.5,
            command_speed_m_s: 0.2,
            duration_s: 15.0,
        };
        let frames = frames.collect();
        (Run { id, frames }, label)
    }

    #[test]
    fn change_and_standard_error_are_those_of_the_steady_part() {
        let made = [
            run(0, 0.5, None),
            run(1, 0.2, Some(3.0)),
            run(2, 0.3, Some(4.0)),
            run(3, 0.4, Some(5.0)),
        ];
        let runs: Vec<(&Run, &Label)> = made.iter().map(|(run, label)| (run, label)).collect();
        let found = Measured::of(&runs, 2.0, 4);
        let found = found.unwrap_or_else(|| unreachable!("the cell is there"));
        assert!((found.rad_m + 0.2).abs() < 1e-9, "{found:?}");
        assert!((found.percent + 40.0).abs() < 1e-7);
        assert!((found.error_rad_m - 0.1 / f64::sqrt(3.0)).abs() < 1e-9);
        assert_eq!(Measured::of(&runs, -2.0, 4), None);
        assert_eq!(Measured::of(&runs, 2.0, 3), None);
    }
}
