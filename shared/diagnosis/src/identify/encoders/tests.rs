//! The encoders' chain against exact steps.

use super::*;

#[test]
fn a_wheel_is_a_two_state_bayes_filter_when_every_breakage_reads_alike() {
    let likelihoods = Likelihoods::new(1, |_, state| if state == 0 { -3.0 } else { -1.0 });
    let (births, death) = ([0.1 / SHARES.iter().sum::<f64>(); WHEELS], 0.2);
    let mut encoders = Encoders::healthy(0);
    let (mut whole, mut broken) = (1.0_f64, 0.0_f64);
    for step in 1..=5 {
        (whole, broken) = (0.9 * whole + 0.2 * broken, 0.1 * whole + 0.8 * broken);
        let (a, b) = (whole * (-3.0_f64).exp(), broken * (-1.0_f64).exp());
        let evidence = encoders.step(&births, death, 0, &likelihoods, step);
        assert!((evidence - (a + b).ln()).abs() < 1e-12);
        (whole, broken) = (a / (a + b), b / (a + b));
        assert!((encoders.p_broken(0) - broken).abs() < 1e-12);
    }
    assert_eq!(encoders.onset(0), 1);
    assert_eq!(encoders.p_broken(1), 0.0);
}

#[test]
fn a_wheel_has_a_rate_of_its_own_in_the_unknown_only() {
    let own_rate = Likelihoods::new(1, |_, state| if state == OWN_RATE { 0.0 } else { -2.0 });
    let births = [1e-4; WHEELS];
    let mut known = Encoders::healthy(0);
    let mut unknown = Encoders::unsure(0);
    let (mut for_known, mut for_unknown) = (0.0, 0.0);
    for step in 1..=10 {
        for_known += known.step(&births, 0.0, 0, &own_rate, step);
        for_unknown += unknown.step(&births, 0.0, 0, &own_rate, step);
    }
    assert_eq!(known.p[0][OWN_RATE], 0.0);
    assert!(unknown.p[0][OWN_RATE] > 0.99);
    // Two nats a step, less the prior of such a wheel.
    let gain: f64 = for_unknown - for_known;
    assert!(
        (gain - (20.0 + (ANYTHING * ANYTHING_OWN_RATE).ln())).abs() < 0.1,
        "{gain}"
    );
}

#[test]
fn readings_that_cannot_tell_move_no_odds_in_an_hour() {
    // Noise about zero, then exact zeros: what a standing wheel's whole encoder may read.
    for (whole, alike) in [(0, DEAD), (SILENT, ZERO)] {
        let is_read = |state| state == whole || state == alike;
        let log = |_, state| if is_read(state) { -1.0 } else { -9.0 };
        let likelihoods = Likelihoods::new(1, log);
        let mut encoders = Encoders::healthy(0);
        encoders.stick(0);
        for step in 0..72_000 {
            encoders.step(&[4e-5; WHEELS], 8e-4, 1, &likelihoods, step);
        }
        let p_broken = encoders.p_broken(0);
        assert!(p_broken < 0.01, "{p_broken}");
        // Nor is a dead encoder forgotten whose wheel sticks.
        let mut encoders = Encoders::healthy(0);
        encoders.p[0] = [0.0; STATES];
        encoders.p[0][alike] = 1.0;
        encoders.stick(0);
        for step in 0..72_000 {
            encoders.step(&[4e-5; WHEELS], 8e-4, 1, &likelihoods, step);
        }
        assert!(encoders.p_broken(0) > 0.99);
    }
}

#[test]
fn encoders_that_cannot_break_stay_whole_whatever_they_read() {
    let impossible = Likelihoods::new(WHEELS, |_, state| if state == 0 { -1e5 } else { 0.0 });
    let mut encoders = Encoders::healthy(0);
    for step in 1..=20 {
        let evidence = encoders.step(&[0.0; WHEELS], 0.0, 0, &impossible, step);
        let expected = AGAINST_MAX * WHEELS as f64;
        assert!((evidence - expected).abs() < 1e-6, "{evidence}");
        assert_eq!(encoders.p_broken(0), 0.0);
    }
}

#[test]
fn a_wheel_that_sticks_divides_its_whole_encoder_and_turning_joins_it() {
    let mut stuck = Encoders::healthy(3).with_states(0, &[(0, 0.6), (DEAD, 0.4)]);
    stuck.stick(0);
    assert!((stuck.p[0][SILENT] - 0.6 * SILENT_SHARE).abs() < 1e-15);
    assert!((stuck.p_whole(0) - 0.6 * (1.0 - SILENT_SHARE)).abs() < 1e-15);
    stuck.release(0);
    assert!((stuck.p_whole(0) - 0.6).abs() < 1e-15 && stuck.p[0][SILENT] == 0.0);
    assert_eq!(stuck.p_dead(0), 0.4);
}

#[test]
fn a_size_is_forgotten_only_while_it_is_doubted() {
    let mut doubted = Encoders::healthy(3).with_states(0, &[(0, 0.6), (SIZED, 0.3), (LATE, 0.1)]);
    doubted.forget_doubted_size(0);
    assert!((doubted.p_whole(0) - 1.0).abs() < 1e-15 && doubted.p_sized(0, 0) == 0.0);
    let mut believed = Encoders::healthy(3).with_states(0, &[(0, 0.5), (SIZED, 0.5)]);
    believed.forget_doubted_size(0);
    assert_eq!((believed.p_whole(0), believed.p_sized(0, 0)), (0.5, 0.5));
}

#[test]
fn broken_is_what_is_neither_whole_nor_a_rate_of_its_own() {
    let mixed =
        Encoders::healthy(3).with_states(0, &[(0, 0.4), (ZERO, 0.2), (LATE, 0.1), (OWN_RATE, 0.3)]);
    assert!((mixed.p_broken(0) - 0.3).abs() < 1e-15);
    assert!((mixed.p_any_broken() - 0.3).abs() < 1e-15);
    let other = mixed.p_other_broken();
    assert!(other[0].abs() < 1e-15 && (other[1] - 0.3).abs() < 1e-15);
    let mut whole = mixed;
    whole.suppose_whole(0, 9);
    assert_eq!(
        (whole.p_whole(0), whole.p_broken(0), whole.onset(0)),
        (1.0, 0.0, 9)
    );
}

#[test]
fn the_unknown_may_break_each_encoder_and_sums_to_one() {
    let unsure = Encoders::unsure(5);
    let sum: f64 = unsure.states(2).iter().sum();
    assert!((sum - 1.0).abs() < 1e-12 && unsure.onset(2) == 5);
    assert!((unsure.p_whole(2) - (1.0 - ANYTHING)).abs() < 1e-15);
}

#[test]
fn however_often_faults_come_an_encoder_breaks_with_one_at_most() {
    let same = Likelihoods::new(WHEELS, |_, _| 0.0);
    let mut encoders = Encoders::healthy(0);
    encoders.step(&[BIRTH_MAX; WHEELS], 0.0, 0, &same, 1);
    assert!(encoders.p_whole(0).abs() < 1e-12 && (encoders.p_broken(0) - 1.0).abs() < 1e-12);
}

#[test]
fn a_late_encoder_neither_begins_nor_ends_while_nothing_shows_it() {
    let timely = Likelihoods::new(1, |_, _| 0.0).timely(1);
    let mut encoders = Encoders::healthy(3).with_states(0, &[(0, 0.9), (LATE, 0.1)]);
    encoders.step(&[1e-2; WHEELS], 0.5, 0, &timely, 1);
    assert!((encoders.p[0][LATE] - 0.1).abs() < 1e-12);
    assert!(encoders.p[0][ZERO] > 0.0);
    // While others drag, none begins to be off by a size.
    let mut dragged = Encoders::healthy(0);
    let same = Likelihoods::new(1, |_, _| 0.0);
    dragged.step(&[1e-2; WHEELS], 0.0, 0b10, &same, 1);
    assert_eq!(dragged.p_sized(0, GAIN), 0.0);
}

#[test]
fn on_a_standing_wheel_an_encoder_begins_to_read_noise_and_nothing_else() {
    let alike = Likelihoods::new(1, |_, _| 0.0);
    let states = [(0, 0.5), (SILENT, 0.125), (NOISE, 0.25), (DEAD, 0.125)];
    let mut encoders = Encoders::healthy(3).with_states(0, &states);
    let (birth, death) = (0.25, 0.5);
    let evidence = encoders.step(&[birth; WHEELS], death, 1, &alike, 9);
    let (born, mended) = (birth * SHARES[NOISE - 1], 0.25 * death);
    let is = |state: usize, expected: f64| {
        let found = encoders.states(0)[state];
        assert!(
            (found - expected).abs() < 1e-15,
            "{state}: {found}, not {expected}"
        );
    };
    is(0, 0.5 * (1.0 - born) + 0.9 * mended);
    is(SILENT, 0.125 * (1.0 - born) + 0.1 * mended);
    is(NOISE, 0.25 - mended + 0.625 * born);
    is(DEAD, 0.125);
    assert!(evidence.abs() < 1e-15 && encoders.onset(0) == 3);
}
