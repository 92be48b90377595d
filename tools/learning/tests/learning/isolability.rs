//! Which faults of a synthetic robot are told apart, and by what.

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use vigil_blocks::SensorFrame;
use vigil_learning::channel_learning::{Isolability, Log, learn};
use vigil_recording::frames::Run;
use vigil_robot::Description;

use super::small::small;

const NOISE: f64 = 0.02;

fn robot(wheel_rates: bool) -> Description {
    small(&format!(
        "channel = [{{ name = 'speed', role = 'other', unit = 'm/s' }}]\n\
         measured = {{ pose = false, wheel_rates = {wheel_rates}, steer = false, \
         yaw_rate = true }}\n\
         polynomial_order = 2"
    ))
}

/// What learning says of ten minutes; `drive` gives speed and yaw rate commanded at a time.
fn report(wheel_rates: bool, drive: impl Fn(f64) -> [f64; 2]) -> Isolability {
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let mut frames = Vec::new();
    for i in 0..6000_u32 {
        let t_s = f64::from(i) / 10.0;
        let [v, w] = drive(t_s);
        let mut frame = SensorFrame::default();
        frame.header.t_capture_ns = (t_s * 1e9) as u64;
        (frame.header.seq, frame.run_id) = (u64::from(i), 1);
        frame.set_command(0, v);
        frame.set_command(1, w);
        let wheels = [v - 0.1 * w, v + 0.1 * w].map(|speed| speed / 0.1);
        let wheels = wheels.into_iter().filter(|_| wheel_rates);
        for (place, value) in wheels.chain([w, v]).enumerate() {
            frame.set_channel(place, value + NOISE * rng.sample::<f64, _>(StandardNormal));
        }
        frames.push(frame);
    }
    let runs = [Run { id: 0, frames }];
    let log = Log {
        isolability_at_h: Some(24.0),
        ..Log::of_healthy(&runs)
    };
    let (_, report) = learn(&log, &robot(wheel_rates)).unwrap();
    report.isolability.unwrap()
}

fn weave(t_s: f64) -> [f64; 2] {
    [0.5 + 0.3 * (0.5 * t_s).sin(), 0.8 * (0.37 * t_s).sin()]
}

fn are_grouped(found: &Isolability, pair: [&str; 2]) -> bool {
    let holds = |group: &Vec<String>| pair.iter().all(|name| group.iter().any(|of| of == name));
    found.groups.iter().any(holds)
}

#[test]
fn slip_and_loss_of_a_wheel_are_told_apart_by_its_rate_alone() {
    let pair = ["drive_R loss", "drive_R slip"];
    let blind = report(false, weave);
    assert!(are_grouped(&blind, pair), "{blind}");
    let named = |of: &str| {
        let sensor = blind.sensors.iter().find(|one| one.sensor == of);
        sensor.is_some_and(|one| one.pairs.iter().any(|found| *found == pair))
    };
    assert!(named("rate of wheel R"), "{blind}");
    assert!(!named("rate of wheel L") && !named("pose"), "{blind}");
    assert!(
        !blind.inseparable.iter().any(|found| *found == pair),
        "{blind}"
    );

    let seeing = report(true, weave);
    assert!(!are_grouped(&seeing, pair), "{seeing}");
    let fault = |kind: &str| {
        let mut faults = seeing.faults.iter();
        faults
            .find(|one| one.broken == "drive_R" && one.kind == kind)
            .unwrap()
    };
    // A slip shows in the body, a loss first in the wheel's own rate.
    assert!(
        !fault("slip").channels.contains(&"enc_R".to_owned()),
        "{seeing}"
    );
    assert_eq!(fault("loss").channels[0], "enc_R", "{seeing}");
}

#[test]
fn a_gyros_gain_waits_for_a_turn_and_a_test_drive_has_one() {
    // Two minutes of each three straight ahead, at steady speeds.
    let rare = |t_s: f64| {
        let turns = (t_s % 180.0) > 120.0;
        [
            0.4 + 0.2 * f64::from((t_s / 30.0) as u32 % 2),
            if turns { weave(t_s)[1] } else { 0.0 },
        ]
    };
    let found = report(true, rare);
    let of = |kind: &str| {
        let mut faults = found.faults.iter();
        faults
            .find(|one| one.broken == "yaw_rate" && one.kind == kind)
            .unwrap()
    };
    assert!(of("gain").shown_share < 0.3, "{found}");
    let [gain, bias] = ["gain", "bias"].map(|kind| of(kind).detected_after.unwrap());
    assert!(gain.half.motion_s > 4.0 * bias.half.motion_s, "{found}");
    // Nine of ten straight stretches end within two minutes, at about half a metre a second.
    assert!(gain.nine_of_ten.motion_s < 125.0, "{found}");
    let way_m = gain.nine_of_ten.way_m.unwrap();
    assert!(
        (0.4..0.6).contains(&(way_m / gain.nine_of_ten.motion_s)),
        "{found}"
    );
    assert!(found.to_string().lines().count() <= 30, "{found}");
}
