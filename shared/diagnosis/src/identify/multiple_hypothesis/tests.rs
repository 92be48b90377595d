//! How hypotheses begin, against exact probabilities; and a belief that contradicts itself.

use super::*;
use crate::Sensors;
use crate::identify::encoders::DEAD;
use crate::identify::fault_rates::fault_rates;
use crate::rover::Rover;

/// A filter that has started at 7 ns.
fn filter() -> MultipleHypothesis {
    let Rover { model, robot, .. } = &Rover::new();
    let leaves = Rover::new().leaves(Sensors::PoseEncoders);
    let rates = fault_rates(&robot.fault_prior, &leaves, 0.01);
    let mut filter = MultipleHypothesis::new(model, robot, &leaves, true, rates);
    filter.restart(&Healthy::unsure(model, robot), 7);
    filter
}

/// Half a second after the start, by command alone: nothing is read.
fn drive() -> Observation {
    Observation {
        t_ns: 500_000_000,
        t_first_ns: 460_000_000,
        dt_s: 0.05,
        middles_s: 0.05,
        frame_s: 0.01,
        frames: 5,
        travel_m: 0.015,
        speed: 0.3,
        command: [0.0, 0.3],
        moving: true,
        ..Observation::default()
    }
}

#[test]
fn a_fault_that_may_begin_with_an_observation_has_its_first_frame_as_onset() {
    let mut filter = filter();
    assert_eq!((filter.onset_unknown(), filter.hypotheses().len()), (0, 1));
    filter.step(&drive(), NoiseScales::default());
    assert_eq!(filter.onset_unknown(), 460_000_000);
    let stuck = filter.leaves.stuck[2].unwrap();
    assert_eq!(filter.onset(stuck), 460_000_000);
    assert_eq!(filter.onset(0), 0);
    let all = filter.hypotheses();
    let total: f64 = all.map(|(_, hypothesis)| hypothesis.log_weight.exp()).sum();
    assert!((total - 1.0).abs() < 1e-12, "{total}");
}

#[test]
fn in_the_unknown_any_encoder_may_be_broken_and_after_it_all_are_whole() {
    let filter = filter();
    let all = filter.modes.iter();
    let unknown = all
        .clone()
        .position(|mode| mode.moved == Mover::UnknownAny)
        .unwrap();
    let nominal = all
        .clone()
        .position(|mode| mode.moved == Mover::Nominal)
        .unwrap();
    let (_, start) = filter.hypotheses().next().unwrap();
    let inside = Hypothesis {
        state: filter.changed(start, unknown, &drive()),
        mode: unknown,
        ..*start
    };
    let p_broken = |encoders: &Encoders| encoders.p_broken(2);
    let p = p_broken(&inside.state.encoders);
    assert!(p > 0.01, "{p}");
    assert_eq!(inside.state.encoders.onset(2), 460_000_000);
    let after = filter.changed(&inside, nominal, &drive());
    assert!(p_broken(&after.encoders) < 1e-9);
}

#[test]
#[should_panic(expected = "probabilities of all alternatives sum to one")]
fn an_encoder_whose_states_do_not_sum_to_one_ends_the_process() {
    let mut filter = filter();
    // The rover has six wheels: no reading makes this one sound again.
    for hypothesis in filter.bank.hypotheses_mut() {
        let encoders = &mut hypothesis.state.encoders;
        *encoders = encoders.with_states(WHEELS - 1, &[(0, 0.5)]);
    }
    filter.step(&drive(), NoiseScales::default());
}

#[test]
fn an_encoder_that_died_in_the_last_observation_may_be_a_wheel_that_sticks() {
    let filter = filter();
    let (before, after) = (Mover::Stuck(0b1), Mover::Stuck(0b11));
    let mode = |moved| filter.modes.iter().position(|mode| mode.moved == moved);
    let (one, two) = (mode(before).unwrap(), mode(after).unwrap());
    let now_ns = 20_000_000_000;
    let at = Observation {
        t_first_ns: now_ns,
        ..drive()
    };
    // Wheel 1 may have died so long ago, wheel 0 have stuck.
    let p_change = |died_ns: u64, stuck_ns: u64| {
        let mut from = filter.bank.hypotheses()[0];
        (from.mode, from.onset) = (one, now_ns - stuck_ns);
        let whole = Encoders::healthy(now_ns - died_ns);
        from.state.encoders = whole.with_states(1, &[(0, 0.625), (DEAD, 0.375)]);
        filter.p_change(&from, two, &at) / filter.modes[two].share
    };
    let by_itself = filter.rates.rate_1_s(before, after, 0.375) * 0.05;
    for (died_ns, stuck_ns, expected) in [
        (50_000_000, 5_000_000_000, by_itself + 0.375),
        (74_000_000, 5_000_000_000, by_itself + 0.375),
        (76_000_000, 5_000_000_000, by_itself),
        (0, 5_000_000_000, by_itself),
        (76_000_000, 999_000_000, 20.0 * by_itself),
        (50_000_000, 999_000_000, 20.0 * by_itself + 0.375),
        (76_000_000, 1_001_000_000, by_itself),
    ] {
        let found = p_change(died_ns, stuck_ns);
        assert!((found - expected).abs() < 1e-12, "{found}, not {expected}");
    }
}
