//! Several faults at once, and faults that come and go: the simulated rover, watched by detector
//! and identifier.
#![cfg(test)]

mod watched;

use vigil_blocks::{EVIDENCE, MODE_MULTIPLE};
use vigil_robot::{Fault, FaultKind};
use watched::WatchedRover;

/// Two different faults, of different wheels, in an order that uses every kind and wheel.
fn pair(trial: usize) -> [Fault; 2] {
    use FaultKind::{EncoderFrozen, EncoderNoise, EncoderZero, Stuck};
    let kinds = [
        [Stuck, EncoderZero],
        [EncoderNoise, EncoderFrozen],
        [Stuck, EncoderNoise],
        [EncoderFrozen, Stuck],
        [Stuck, Stuck],
    ];
    let (first, apart) = (trial % 6, 1 + trial / 6 % 5);
    let wheels = [first, (first + apart) % 6];
    let [a, b] = kinds[trial % kinds.len()];
    [(a, wheels[0]), (b, wheels[1])].map(|(kind, wheel)| Fault { kind, wheel })
}

#[test]
fn two_faults_at_once_are_both_named() {
    const TRIALS: usize = 60;
    let mut wrong = Vec::new();
    for trial in 0..TRIALS {
        let mut watched = WatchedRover::new(100 + trial as u64);
        let faults = pair(trial);
        watched.drive(3.0);
        watched.world.inject(faults[0]).unwrap();
        watched.drive(1.0);
        watched.world.inject(faults[1]).unwrap();
        watched.drive(5.0);
        let expected: u64 = faults
            .map(|fault| 1_u64 << watched.leaf(fault))
            .iter()
            .sum();
        let belief = &watched.diagnosis;
        if belief.mode != MODE_MULTIPLE || belief.sets[0].leaves != expected {
            let found = (belief.mode, belief.sets[0], belief.p_unknown);
            wrong.push(format!("{faults:?}: {found:?}"));
        }
    }
    assert!(wrong.len() * 20 <= TRIALS, "{}", wrong.join("\n"));
}

#[test]
fn two_wheels_that_stick_at_once_are_both_named() {
    const TRIALS: usize = 15;
    let pairs: Vec<[usize; 2]> = (0..6)
        .flat_map(|a| (a + 1..6).map(move |b| [a, b]))
        .collect();
    assert_eq!(pairs.len(), TRIALS);
    let mut wrong = Vec::new();
    for (trial, wheels) in pairs.into_iter().enumerate() {
        let mut watched = WatchedRover::new(200 + trial as u64);
        let faults = wheels.map(|wheel| Fault {
            kind: FaultKind::Stuck,
            wheel,
        });
        watched.drive(3.0);
        for fault in faults {
            watched.world.inject(fault).unwrap();
        }
        watched.drive(3.0);
        let leaves = faults.map(|fault| 1_u64 << watched.leaf(fault));
        let belief = &watched.diagnosis;
        if belief.sets[0].leaves != leaves[0] | leaves[1] {
            let found = (belief.mode, belief.sets[0], belief.p_unknown);
            wrong.push(format!("{faults:?}: {found:?}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_wheel_that_sticks_frees_itself_and_sticks_again_is_followed() {
    let mut watched = WatchedRover::new(7);
    let fault = Fault {
        kind: FaultKind::Stuck,
        wheel: 4,
    };
    let node = watched.leaf(fault) as u32;
    watched.drive(3.0);
    for _ in 0..3 {
        watched.world.inject(fault).unwrap();
        watched.drive(1.0);
        assert_eq!(watched.diagnosis.mode, node);
        watched.drive(2.0);
        watched.world.clear(fault.wheel).unwrap();
        watched.drive(1.0);
        assert_eq!(watched.diagnosis.mode, 0);
        watched.drive(2.0);
    }
}

#[test]
fn the_sensors_may_be_noisier_or_quieter_than_the_learned_ones() {
    for (seed, noise_scale) in [(20, 0.5), (21, 2.0)] {
        for (kind, name) in [
            (FaultKind::Stuck, "STUCK"),
            (FaultKind::EncoderNoise, "ENC"),
        ] {
            let mut watched = WatchedRover::with_noise(seed, noise_scale);
            watched.drive(30.0);
            assert_eq!(watched.detection.alarm_count, 0, "{noise_scale}");
            let fault = Fault { kind, wheel: 1 };
            watched.world.inject(fault).unwrap();
            watched.drive(2.0);
            let node = watched.diagnosis.mode as usize;
            let named = watched
                .setup
                .tree
                .nodes()
                .get(node)
                .map(|n| n.name.as_str());
            assert_eq!(named, Some(format!("LM_{name}").as_str()), "{noise_scale}");
        }
    }
}

#[test]
fn a_diagnosis_says_which_channels_speak_for_it() {
    let mut watched = WatchedRover::new(8);
    let fault = Fault {
        kind: FaultKind::Stuck,
        wheel: 4,
    };
    watched.drive(3.0);
    assert_eq!(watched.diagnosis.channel_evidence, [0.0; EVIDENCE]);
    watched.world.inject(fault).unwrap();
    watched.drive(2.0);
    let belief = &watched.diagnosis;
    assert_eq!(belief.mode, watched.leaf(fault) as u32);
    // The nearest rival reads the same encoder as broken: it is the motion that speaks, and the
    // other wheels, which the stuck one brakes.
    let evidence = &belief.channel_evidence;
    let total: f64 = evidence.iter().sum();
    const ENCODER_RM: usize = 7;
    let others = evidence.iter().enumerate();
    let others = others.filter(|(i, _)| *i != ENCODER_RM).map(|(_, e)| e);
    assert!(total > 5.0 && others.sum::<f64>() > 5.0, "{evidence:?}");
    assert_ne!(belief.runner_up, belief.mode);
}
