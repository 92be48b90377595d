//! What the robot was told, and what it measured.

use std::collections::VecDeque;

use vigil_blocks::{COMMANDS, SensorFrame};
use vigil_pages::chart::{Axis, Chart, Stroke};
use vigil_pages::colour::{Colour, SERIES};
use vigil_pages::page::{KeyEntry, key, remark, titled};
use vigil_robot::Description;
use vigil_robot::channel::{Role, channels};

use crate::belief::{TimedTrace, WIDTH};

const HEIGHT: u32 = 280;
/// The speed is the way over so long, s: in less of it, the pose's noise is a large part.
const SPEED_S: f64 = 0.5;

/// A curve, and the chart in which it lies.
#[derive(Debug)]
struct Series {
    chart: String,
    name: String,
    trace: TimedTrace,
}

/// Commands and channels over time.
#[derive(Debug)]
pub(crate) struct Measured {
    commands: Vec<Series>,
    speed: Option<PoseSpeed>,
    /// Place among the channels of each that is drawn.
    channels: Vec<(usize, Series)>,
}

/// How fast the measured pose moves.
#[derive(Debug)]
struct PoseSpeed {
    /// Places of x and y among the channels.
    places: [usize; 2],
    /// Time, x and y of the last moments.
    last: VecDeque<[f64; 3]>,
    /// Run, and count of the pose's resets: only within one pair is a difference a way.
    frame_of_pose: (u64, u32),
    series: Series,
}

impl PoseSpeed {
    fn new(places: [usize; 2]) -> Self {
        Self {
            places,
            last: VecDeque::new(),
            frame_of_pose: (0, 0),
            series: Series::new("speed over ground, by the measured pose, m/s", "speed"),
        }
    }

    fn take(&mut self, t_s: f64, frame: &SensorFrame) {
        let [x, y] = self.places.map(|place| frame.measured(place));
        let Some((x, y)) = x.zip(y).filter(|(x, y)| x.is_finite() && y.is_finite()) else {
            return self.last.clear();
        };
        let frame_of_pose = (frame.run_id, frame.pose_reset_count);
        if frame_of_pose != self.frame_of_pose {
            self.frame_of_pose = frame_of_pose;
            self.last.clear();
        }
        while self
            .last
            .front()
            .is_some_and(|[then_s, ..]| t_s - then_s > 2.0 * SPEED_S)
        {
            self.last.pop_front();
        }
        self.last.push_back([t_s, x, y]);
        let then = self
            .last
            .iter()
            .rev()
            .find(|[then_s, ..]| t_s - then_s >= SPEED_S);
        if let Some([then_s, x_then, y_then]) = then {
            let speed = (x - x_then).hypot(y - y_then) / (t_s - then_s);
            self.series.trace.add(t_s, speed);
        }
    }
}

impl Series {
    fn new(chart: &str, name: &str) -> Self {
        Self {
            chart: chart.to_owned(),
            name: name.to_owned(),
            trace: TimedTrace::default(),
        }
    }
}

/// Name of a chart; none for what the path shows.
const fn words(role: Role) -> Option<&'static str> {
    match role {
        Role::PoseX | Role::PoseY => None,
        Role::PoseYaw => Some("yaw"),
        Role::BodyRate => Some("rates of the body"),
        Role::WheelRate => Some("wheel rates"),
        Role::SteeringAngle => Some("steering angles"),
        Role::Current => Some("currents"),
        Role::Voltage => Some("voltages"),
        Role::Acceleration => Some("accelerations"),
        Role::Attitude => Some("attitude"),
        Role::TrackingError => Some("tracking errors"),
        Role::Other => Some("other channels"),
    }
}

/// A chart's name with the unit of what it shows.
fn with_unit(name: &str, unit: &str) -> String {
    match unit {
        "" => name.to_owned(),
        unit => format!("{name}, {unit}"),
    }
}

impl Measured {
    /// Without a frame yet.
    pub(crate) fn new(robot: &Description) -> Self {
        let axes = robot.command.iter().take(COMMANDS);
        let commands = axes.map(|axis| Series::new(&with_unit("command", &axis.unit), &axis.name));
        let all = channels(robot);
        let place = |role: Role| all.iter().position(|channel| channel.role == role);
        let drawn = all.iter().enumerate().filter_map(|(at, channel)| {
            let chart = with_unit(words(channel.role)?, &channel.unit);
            Some((at, Series::new(&chart, &channel.name)))
        });
        Self {
            commands: commands.collect(),
            speed: place(Role::PoseX)
                .zip(place(Role::PoseY))
                .map(|(x, y)| PoseSpeed::new([x, y])),
            channels: drawn.collect(),
        }
    }

    /// Takes a frame of the graph's robot.
    pub(crate) fn take(&mut self, t_s: f64, frame: &SensorFrame) {
        for (axis, series) in self.commands.iter_mut().enumerate() {
            if let Some(value) = frame.commanded(axis) {
                series.trace.add(t_s, value);
            }
        }
        if let Some(speed) = &mut self.speed {
            speed.take(t_s, frame);
        }
        for (place, series) in &mut self.channels {
            if let Some(value) = frame.measured(*place) {
                series.trace.add(t_s, value);
            }
        }
    }

    /// A chart for each kind of command and channel, above a common axis of time.
    pub(crate) fn charts(&self, time: &Axis) -> String {
        let speed = self.speed.iter().map(|speed| &speed.series);
        let channels = self.channels.iter().map(|(_, series)| series);
        let all = self.commands.iter().chain(speed).chain(channels);
        let mut charts: Vec<(&str, Vec<&Series>)> = Vec::new();
        for series in all.filter(|series| !series.trace.is_empty()) {
            match charts.iter_mut().find(|(chart, _)| *chart == series.chart) {
                Some((_, group)) => group.push(series),
                None => charts.push((&series.chart, vec![series])),
            }
        }
        if charts.is_empty() {
            return remark("The recording holds no frames of this robot.");
        }
        let charts = charts.iter().map(|(name, group)| chart(name, group, time));
        charts.collect()
    }
}

/// One chart, and the names of what it has no room for.
fn chart(name: &str, group: &[&Series], time: &Axis) -> String {
    let drawn = group.iter().take(SERIES).enumerate();
    let bounds = drawn
        .clone()
        .filter_map(|(_, series)| series.trace.bounds());
    let [least, most] = bounds.fold([f64::INFINITY, f64::NEG_INFINITY], |ends, [least, most]| {
        [ends[0].min(least), ends[1].max(most)]
    });
    let margin = (0.05 * (most - least)).max(1e-3 * most.abs()).max(1e-3);
    let entries: Vec<KeyEntry> = drawn
        .clone()
        .map(|(i, series)| KeyEntry {
            colour: Colour::Series(i),
            stroke: Stroke::Solid,
            name: series.name.clone(),
        })
        .collect();
    let curves =
        drawn.flat_map(|(i, series)| series.trace.curves(Colour::Series(i), Stroke::Solid));
    let chart = Chart {
        caption: name.to_owned(),
        size: (WIDTH, HEIGHT),
        x: time.clone(),
        y: Axis::between("value", [least - margin, most + margin], 5.0),
        curves: curves.collect(),
        labels: Vec::new(),
    };
    let mut text = titled(name, &key(&entries), &chart.svg());
    let further: Vec<&str> = group
        .iter()
        .skip(SERIES)
        .map(|it| it.name.as_str())
        .collect();
    if !further.is_empty() {
        text.push_str(&remark(&format!("Not drawn: {}.", further.join(", "))));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot() -> Description {
        let path = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../config/robots/rover.toml"
        );
        vigil_setup::load_robot(std::path::Path::new(path)).unwrap()
    }

    #[test]
    fn commands_speed_and_channels_have_charts_by_their_kind() {
        let robot = robot();
        let mut measured = Measured::new(&robot);
        let wheel = channels(&robot)
            .iter()
            .position(|it| it.role == Role::WheelRate)
            .unwrap();
        for step in 0..200_u32 {
            let t_s = f64::from(step) * 0.01;
            let mut frame = SensorFrame::default();
            (0..2).for_each(|axis| frame.set_command(axis, 0.2));
            frame.set_channel(0, 0.2 * t_s);
            frame.set_channel(1, 1.0);
            frame.set_channel(wheel, 2.5);
            measured.take(t_s, &frame);
        }
        let bounds = measured
            .speed
            .as_ref()
            .unwrap()
            .series
            .trace
            .bounds()
            .unwrap();
        assert!(
            bounds.iter().all(|speed| (speed - 0.2).abs() < 1e-9),
            "{bounds:?}"
        );
        let charts = measured.charts(&Axis::linear("time, s", 2.0, 5.0));
        for title in ["command, m/s", "speed over ground", "wheel rates, rad/s"] {
            assert!(charts.contains(title), "{title}");
        }
        assert!(!charts.contains("currents") && !charts.contains("NaN"));
    }

    #[test]
    fn where_the_pose_jumps_or_is_missing_there_is_no_speed() {
        let mut speed = PoseSpeed::new([0, 1]);
        for step in 0..100_u32 {
            let mut frame = SensorFrame::default();
            if step % 10 != 9 {
                frame.set_channel(0, f64::from(step));
                frame.set_channel(1, 0.0);
            }
            speed.take(f64::from(step) * 0.1, &frame);
        }
        let fastest = speed.series.trace.max();
        assert!((fastest - 10.0).abs() < 1e-9, "{fastest}");
        let mut jumped = SensorFrame::default();
        jumped.set_channel(0, -500.0);
        jumped.set_channel(1, 0.0);
        jumped.pose_reset_count = 1;
        speed.take(10.0, &jumped);
        assert_eq!(speed.series.trace.max(), fastest);
    }

    #[test]
    fn without_frames_it_says_so() {
        let measured = Measured::new(&robot());
        let charts = measured.charts(&Axis::linear("time, s", 2.0, 5.0));
        assert!(charts.contains("holds no frames"), "{charts}");
    }
}
