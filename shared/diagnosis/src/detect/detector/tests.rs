//! A detector whose state contradicts itself ends the process.

use super::*;
use crate::rover::Rover;

/// Steps a sound detector, and again after `corrupt`. The entry changes nothing by itself.
fn step_after(corrupt: impl FnOnce(&mut Detector)) {
    let Rover { robot, model, .. } = Rover::new();
    let mut detector = Detector::new(&model, &robot, &Settings::default()).unwrap();
    let (mut belief, mut hypotheses) = (DetectionBelief::default(), Box::default());
    detector.step(Entry::Budget(1), &mut belief, &mut hypotheses);
    assert_eq!((belief.alarm, belief.alarm_count), (0, 0));
    corrupt(&mut detector);
    detector.step(Entry::Budget(1), &mut belief, &mut hypotheses);
}

#[test]
#[should_panic(expected = "a probability is within [0, 1]")]
fn a_p_fault_that_is_no_number_ends_the_process() {
    step_after(|detector| detector.log_odds = f64::NAN);
}

#[test]
#[should_panic(expected = "log-odds are finite")]
fn infinite_log_odds_end_the_process() {
    step_after(|detector| detector.log_odds = f64::INFINITY);
}

#[test]
#[should_panic(expected = "an alarm has an onset")]
fn an_onset_without_an_alarm_ends_the_process() {
    step_after(|detector| detector.alarm_t_ns = 1);
}

#[test]
fn each_missed_deadline_adds_the_faults_that_may_have_begun() {
    let Rover { robot, model, .. } = Rover::new();
    let mut detector = Detector::new(&model, &robot, &Settings::default()).unwrap();
    (
        detector.log_odds,
        detector.fault_rate_1_s,
        detector.period_s,
    ) = (-2.0, 0.1, 0.05);
    let (mut belief, mut hypotheses) = (DetectionBelief::default(), Box::default());
    for missed in [0, 3] {
        detector.step(Entry::Missed(missed), &mut belief, &mut hypotheses);
        let healthy = 1.0 / (1.0 + (-2.0_f64).exp());
        let p_fault = 1.0 - healthy * (-0.1 * 0.05 * f64::from(missed)).exp();
        let is = |found: f64, expected: f64| {
            assert!((found - expected).abs() < 1e-12, "{found}, not {expected}");
        };
        is(belief.p_fault, p_fault);
        is(belief.log_odds, (p_fault / (1.0 - p_fault)).ln());
        let [nominal, unknown] = hypotheses.used() else {
            unreachable!("the detector has two hypotheses");
        };
        is(nominal.log_weight, (1.0 - p_fault).ln());
        is(unknown.log_weight, p_fault.ln());
        assert_eq!((nominal.mode, unknown.mode), (0, MODE_UNKNOWN));
    }
}
