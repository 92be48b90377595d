//! Kobuki: a quarter of a wheel taped, seconds of driving judged one by one.

use std::error::Error;

use serde::Serialize;
use vigil_evaluation::learning_nominal::{self, Report};
use vigil_recording::frames::Run;
use vigil_robot::learned::Form;
use vigil_robot::learned::monitor::Channels;
use vigil_robot::nominal::{Model, Monitor, Observation, Observer};

use super::{FALSE_ALARM_INTERVAL_H, FAULT_RATE_1_H, Log, auc};

/// Beginning of the run without a fault that is learned from, s.
const LEARN_S: f64 = 40.0;
/// Length of a window, s.
const WINDOW_S: f64 = 1.0;
/// Part of a window in motion from which it counts.
const MOVING: f64 = 0.8;
/// Width of a bin of speed within which windows are compared, m/s.
const SPEED_BIN_M_S: f64 = 0.1;

/// One window.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Window {
    /// Highest log-odds in it, all evidence from before it forgotten.
    pub log_odds: f64,
    /// Root mean square of the gyro's yaw rate less that of the wheels, rad/s: what a monitor
    /// without a model would look at.
    pub yaw_rate_rms: f64,
    /// Mean speed of the wheels, m/s; not used for the score.
    pub speed_m_s: f64,
}

/// One faulty run.
#[derive(Debug, Serialize)]
pub struct Faulty {
    /// Its name.
    pub name: String,
    /// Windows.
    pub windows: Vec<Window>,
    /// Area under the curve against the windows without a fault.
    pub auc: f64,
    /// The same over pairs of windows within one bin of speed.
    pub auc_speed_matched: f64,
    /// Area by the plain root mean square of the yaw rates' difference, for comparison.
    pub auc_yaw_rate_rms: f64,
    /// Pairs behind it.
    pub pairs_matched: usize,
    /// Windows whose log-odds reach the alarm by themselves.
    pub alarms: usize,
    /// Time of the first alarm in the whole run, nothing forgotten, s.
    pub first_alarm_s: Option<f64>,
}

/// What was measured.
#[derive(Debug, Serialize)]
pub struct Kobuki {
    /// What was learned.
    pub learned: Report,
    /// Log-odds of the alarm.
    pub alarm_log_odds: f64,
    /// Windows without a fault.
    pub nominal: Vec<Window>,
    /// Windows without a fault that reach the alarm.
    pub nominal_alarms: usize,
    /// First alarm in the rest of the run without a fault, s.
    pub nominal_first_alarm_s: Option<f64>,
    /// Runs with a fault.
    pub faulty: Vec<Faulty>,
}

/// Learns from the beginning of the run without a fault and scores the rest.
///
/// # Errors
/// What is missing or malformed.
pub fn measure() -> Result<Kobuki, Box<dyn Error>> {
    let log = super::log("kobuki_wheel_fault", "kobuki")?;
    let (model, report) = learning_nominal::learn(&log.runs[..1], &[], LEARN_S, &log.robot)?;
    let calibration = model.calibration(Channels::PoseEncoders, Form::LearnedBias)?;
    let alarm = calibration.alarm_log_odds(FALSE_ALARM_INTERVAL_H, FAULT_RATE_1_H);
    let nominal = windows(&model, &log, &log.runs[0], LEARN_S);
    let alarms = |windows: &[Window]| windows.iter().filter(|w| w.log_odds > alarm).count();
    let mut faulty = Vec::new();
    for (run, name) in log.runs.iter().zip(&log.names).skip(1) {
        let windows = windows(&model, &log, run, 0.0);
        let of = |windows: &[Window]| windows.iter().map(|w| w.log_odds).collect::<Vec<_>>();
        let rms = |windows: &[Window]| windows.iter().map(|w| w.yaw_rate_rms).collect::<Vec<_>>();
        let (matched, pairs) = speed_matched(&nominal, &windows);
        faulty.push(Faulty {
            name: name.clone(),
            auc: auc(&of(&nominal), &of(&windows)).ok_or("no windows")?,
            auc_speed_matched: matched,
            auc_yaw_rate_rms: auc(&rms(&nominal), &rms(&windows)).ok_or("no windows")?,
            pairs_matched: pairs,
            alarms: alarms(&windows),
            first_alarm_s: first_alarm(&model, &log, run, 0.0, alarm),
            windows,
        });
    }
    Ok(Kobuki {
        learned: report,
        alarm_log_odds: alarm,
        nominal_alarms: alarms(&nominal),
        nominal_first_alarm_s: first_alarm(&model, &log, &log.runs[0], LEARN_S, alarm),
        nominal,
        faulty,
    })
}

fn monitor(model: &Model) -> Monitor {
    Monitor::new(
        model,
        Channels::PoseEncoders,
        Form::LearnedBias,
        FAULT_RATE_1_H,
    )
}

/// Windows of a run from a time on.
fn windows(model: &Model, log: &Log, run: &Run, from_s: f64) -> Vec<Window> {
    let (mut monitor, mut observer) = (monitor(model), Observer::new(&log.robot));
    let (mut out, mut in_window_s) = (Vec::new(), 0.0);
    let (mut highest, mut moving_s, mut speed) = (f64::NEG_INFINITY, 0.0, 0.0);
    let mut square = 0.0;
    for frame in &run.frames {
        if !observer.push(frame).complete {
            continue;
        }
        monitor.step(observer.history(), false);
        let Some(now) = observer.history().ago(0) else {
            continue;
        };
        if (now.t_ns as f64) * 1e-9 <= from_s {
            monitor.forget_evidence();
            continue;
        }
        highest = monitor.report().log_odds.max(highest);
        in_window_s += now.dt_s;
        moving_s += if now.moving { now.dt_s } else { 0.0 };
        let rates = now
            .wheels
            .iter()
            .flatten()
            .map(|rate| rate.abs())
            .sum::<f64>();
        square += yaw_apart(now, log).powi(2) * now.dt_s;
        speed += 0.5 * rates * log.robot.wheel_radius_m * now.dt_s;
        if in_window_s > WINDOW_S - 1e-6 {
            if moving_s >= MOVING * WINDOW_S {
                out.push(Window {
                    log_odds: highest,
                    yaw_rate_rms: (square / in_window_s).sqrt(),
                    speed_m_s: speed / in_window_s,
                });
            }
            monitor.forget_evidence();
            (in_window_s, highest, moving_s, speed) = (0.0, f64::NEG_INFINITY, 0.0, 0.0);
            square = 0.0;
        }
    }
    out
}

/// Yaw rate of the gyro less that of the wheels, rad/s.
fn yaw_apart(now: &Observation, log: &Log) -> f64 {
    let [Some(left), Some(right), ..] = now.wheels else {
        return 0.0;
    };
    let track_m = log.robot.wheels[0].y - log.robot.wheels[1].y;
    now.yaw_rate.unwrap_or(0.0) - (right - left) * log.robot.wheel_radius_m / track_m
}

/// Mean of the areas within bins of speed, weighted by pairs, and the pairs.
fn speed_matched(nominal: &[Window], faulty: &[Window]) -> (f64, usize) {
    let bin = |window: &Window| (window.speed_m_s / SPEED_BIN_M_S).floor() as usize;
    let of = |windows: &[Window], at: usize| -> Vec<f64> {
        let inside = windows.iter().filter(|w| bin(w) == at);
        inside.map(|w| w.log_odds).collect()
    };
    let (mut sum, mut pairs) = (0.0, 0);
    for at in 0..20 {
        let (a, b) = (of(nominal, at), of(faulty, at));
        if let Some(area) = auc(&a, &b) {
            sum += area * (a.len() * b.len()) as f64;
            pairs += a.len() * b.len();
        }
    }
    (sum / pairs.max(1) as f64, pairs)
}

/// First alarm from a time on, nothing forgotten after it.
fn first_alarm(model: &Model, log: &Log, run: &Run, from_s: f64, alarm: f64) -> Option<f64> {
    let (mut monitor, mut observer) = (monitor(model), Observer::new(&log.robot));
    for frame in &run.frames {
        if !observer.push(frame).complete {
            continue;
        }
        monitor.step(observer.history(), false);
        let t_s = frame.header.t_capture_ns as f64 * 1e-9;
        if !monitor.is_ready() || t_s <= from_s {
            monitor.forget_evidence();
        } else if monitor.report().log_odds > alarm {
            return Some(t_s);
        }
    }
    None
}

fn at(t_s: Option<f64>) -> String {
    t_s.map_or("none".to_owned(), |t_s| format!("{t_s:.1}"))
}

impl Kobuki {
    /// The summary.
    #[must_use]
    pub fn lines(&self) -> Vec<String> {
        let mut out = vec![
            format!("## Kobuki: learned from the first {LEARN_S} s of the run without a fault\n"),
            self.learned.to_string(),
            format!(
                "windows of {WINDOW_S} s, each judged alone; alarm at log-odds {:.1} \
                 ({} h between false alarms)\n",
                self.alarm_log_odds, FALSE_ALARM_INTERVAL_H
            ),
            "| run | windows | AUC | AUC, same speed (pairs) | AUC, plain rms of yaw rates | \
             windows that alarm alone | first alarm, s |"
                .into(),
            "|---|---|---|---|---|---|---|".into(),
            format!(
                "| rest of nonfaulty | {} | | | | {} | {} |",
                self.nominal.len(),
                self.nominal_alarms,
                at(self.nominal_first_alarm_s)
            ),
        ];
        for run in &self.faulty {
            out.push(format!(
                "| {} | {} | {:.3} | {:.3} ({}) | {:.3} | {} | {} |",
                run.name,
                run.windows.len(),
                run.auc,
                run.auc_speed_matched,
                run.pairs_matched,
                run.auc_yaw_rate_rms,
                run.alarms,
                at(run.first_alarm_s)
            ));
        }
        out
    }
}
