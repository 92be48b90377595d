//! What a learned model of channels says when more than one thing is broken, or everything is.

use vigil_blocks::SensorFrame;
use vigil_recording::frames::Run;
use vigil_robot::Description;
use vigil_robot::channel_model::{Model, Monitor, Observer, components};
use vigil_robot::learned::channels::Channels;

use super::channel_sensing::{alarm, learned, robot, run, stop_and_go};

pub const ONSET_S: f64 = 10.0;

/// A run of a robot some of whose frames are spoilt since the onset.
fn spoilt(id: u32, spoil: impl Fn(&mut SensorFrame)) -> Run {
    let mut run = run(id, 60.0, stop_and_go, stop_and_go);
    for frame in &mut run.frames {
        if frame.header.t_capture_ns as f64 * 1e-9 >= ONSET_S {
            spoil(frame);
        }
    }
    run
}

/// Shares of the time since two seconds after the onset in which the log-odds are above zero and
/// more than half of them speak for each component alone, then for these two at once.
pub fn shares(
    model: &Model,
    robot: &Description,
    run: &Run,
    pair: [&str; 2],
) -> Vec<(String, f64)> {
    let names: Vec<String> = components(robot).into_iter().map(|one| one.name).collect();
    let mut counts = vec![0.0; names.len() + 1];
    let mut monitor = Monitor::new(model, robot, Channels::PoseEncoders, 1.0).unwrap();
    let mut observer = Observer::new(robot);
    let mut all = 0.0;
    for frame in &run.frames {
        let t_s = frame.header.t_capture_ns as f64 * 1e-9;
        if !observer.push(frame).complete {
            continue;
        }
        monitor.step(observer.history(), observer.orders());
        if t_s < ONSET_S + 2.0 || monitor.report().log_odds < 0.0 {
            continue;
        }
        all += 1.0;
        for (count, belief) in counts.iter_mut().zip(monitor.beliefs()) {
            *count += f64::from(u8::from(belief.p > 0.5));
        }
        let both = monitor.pair().filter(|both| both.p > 0.5);
        let is_pair = both.is_some_and(|both| {
            let mut found = both.components.map(|one| names[one].as_str());
            found.sort_unstable();
            found == pair
        });
        *counts.last_mut().unwrap() += f64::from(u8::from(is_pair));
    }
    assert!(all > 100.0, "{all} observations");
    let both = pair.join("+");
    let named = names.into_iter().chain([both]);
    named
        .zip(counts.into_iter().map(|count| count / all))
        .collect()
}

pub fn share(shares: &[(String, f64)], name: &str) -> f64 {
    shares.iter().find(|(one, _)| one == name).unwrap().1
}

#[test]
fn two_broken_sensors_are_two_and_one_is_one() {
    let robot = robot(true);
    let model = learned(&robot);
    let both = ["enc_L", "enc_R"];
    let two = spoilt(1, |frame| {
        frame.set_channel(3, 0.0);
        frame.set_channel(4, 1.6 * frame.channel[4] + 1.0);
    });
    let found = shares(&model, &robot, &two, both);
    assert!(share(&found, "enc_L+enc_R") > 0.8, "{found:?}");
    for (name, place) in [("enc_L", 3), ("enc_R", 4)] {
        for (i, spoil) in [|_| 0.0, |rate: f64| rate + 4.0, |rate: f64| -rate]
            .into_iter()
            .enumerate()
        {
            let one = spoilt(2 + i as u32, |frame| {
                frame.set_channel(place, spoil(frame.channel[place]));
            });
            let found = shares(&model, &robot, &one, both);
            assert!(share(&found, name) > 0.9, "{name}, {i}: {found:?}");
            assert!(
                share(&found, "enc_L+enc_R") < 0.02,
                "{name}, {i}: {found:?}"
            );
        }
    }
}

#[test]
fn a_robot_that_runs_away_from_a_rest_is_noticed_whatever_it_measures() {
    let robot = robot(true);
    let model = learned(&robot);
    for (id, unasked) in [
        (1, [0.02, 0.0]),
        (2, [0.1, 0.0]),
        (3, [0.8, 0.0]),
        (4, [0.3, 1.0]),
    ] {
        let told = |t_s: f64| {
            if t_s < ONSET_S {
                stop_and_go(t_s)
            } else {
                [0.0; 2]
            }
        };
        let obeys = |t_s: f64| match t_s {
            ..ONSET_S => stop_and_go(t_s),
            t_s if t_s < 2.0 * ONSET_S => [0.0; 2],
            _ => unasked,
        };
        let found = alarm(&model, &robot, &run(id, 40.0, told, obeys));
        let (found_s, _) = found.unwrap_or_else(|| panic!("{unasked:?} is not seen"));
        assert!((20.0..24.0).contains(&found_s), "{unasked:?}: {found_s} s");
    }
}

#[test]
fn a_pose_that_is_wrong_in_all_it_tells_is_one_fault() {
    let robot = robot(true);
    let model = learned(&robot);
    // It wanders off in a circle of its own.
    let wrong = spoilt(7, |frame| {
        let t_s = frame.header.t_capture_ns as f64 * 1e-9 - ONSET_S;
        frame.channel[0] += 0.5 * t_s;
        frame.channel[1] -= 0.4 * t_s;
        let yaw = frame.channel[2] + 0.5 * t_s;
        frame.channel[2] = vigil_inference::angle::wrap(yaw);
    });
    let found = shares(&model, &robot, &wrong, ["enc_L", "pose"]);
    assert!(share(&found, "pose") > 0.8, "{found:?}");
}
