use super::*;

const MS: u64 = 1_000_000;

fn detection(t_ms: u64, alarm: u32) -> DetectionBelief {
    let mut detection = DetectionBelief {
        alarm,
        alarm_count: alarm,
        alarm_t_capture_ns: u64::from(alarm) * MS,
        log_odds: -9.0,
        readiness: Readiness::Armed as u32,
        ..DetectionBelief::default()
    };
    detection.header.t_capture_ns = t_ms * MS;
    detection
}

fn diagnosis(p_nominal: f64) -> FaultBelief {
    let mut diagnosis = FaultBelief {
        identifying: 1,
        ..FaultBelief::default()
    };
    diagnosis.p[0] = p_nominal;
    diagnosis
}

fn take(fusion: &mut AlarmFusion, d: Option<&DetectionBelief>, f: Option<&FaultBelief>) {
    let inputs = Inputs {
        diagnosis: f,
        detection: d,
    };
    fusion.take(Entry::Frame(inputs), |_| true);
}

#[test]
fn the_published_alarm_counts_before_the_detectors() {
    let (alarm, none) = (detection(0, 1), detection(0, 0));
    let published = |alarm| Action {
        alarm,
        ..Action::default()
    };
    assert!(fused_alarm(&alarm, None) && !fused_alarm(&none, None));
    assert!(!fused_alarm(&alarm, Some(&published(0))));
    assert!(fused_alarm(&none, Some(&published(1))));
}

#[test]
fn an_identifier_that_is_lost_does_not_end_an_alarm() {
    // The third detection without a diagnosis counts as lost; then no motion ends the alarm.
    for (unanswered, stands) in [(2, false), (3, true)] {
        let mut fusion = AlarmFusion::new(0.5);
        take(&mut fusion, Some(&detection(0, 1)), Some(&diagnosis(1.0)));
        assert!(fusion.situation().alarm);
        for k in 1..=200 {
            let answer = (k % (unanswered + 1) == 0).then(|| diagnosis(1.0));
            take(&mut fusion, Some(&detection(10 * k, 1)), answer.as_ref());
        }
        assert_eq!(fusion.situation().alarm, stands, "{unanswered}");
    }
}

#[test]
fn the_alarm_of_a_detector_that_was_replaced_stands_until_the_next_one_can_tell() {
    let mut fusion = AlarmFusion::new(0.5);
    let mut first = detection(0, 1);
    (first.header.epoch, first.p_fault) = (1, 0.75);
    take(&mut fusion, Some(&first), Some(&diagnosis(0.0)));
    let mut next = |t_ms, readiness| {
        let mut next = detection(t_ms, 0);
        (next.header.epoch, next.readiness) = (2, readiness as u32);
        take(&mut fusion, Some(&next), Some(&diagnosis(0.0)));
        let Situation { alarm, p_fault, .. } = fusion.situation();
        (alarm, p_fault)
    };
    assert_eq!(next(100, Readiness::Arming), (true, 0.75));
    assert_eq!(next(5000, Readiness::Armed), (true, 0.75));
    assert_eq!(next(5400, Readiness::Armed), (true, 0.75));
    assert_eq!(next(5600, Readiness::Armed), (false, 0.0));
}

#[test]
fn beside_a_detector_that_arms_nothing_shows_that_an_alarm_has_ended() {
    let mut fusion = AlarmFusion::new(0.5);
    let mut first = detection(10, 1);
    (first.header.epoch, first.p_fault) = (1, 0.75);
    take(&mut fusion, Some(&first), Some(&diagnosis(0.0)));
    // An identifier that was replaced, too: it does not know of the alarm.
    let mut unaware = diagnosis(1.0);
    unaware.identifying = 0;
    let mut next = |t_ms, readiness| {
        let mut next = detection(t_ms, 0);
        (next.header.epoch, next.readiness) = (2, readiness as u32);
        take(&mut fusion, Some(&next), Some(&unaware));
        fusion.situation()
    };
    for step in 1..100 {
        let situation = next(100 * step, Readiness::Arming);
        assert!(situation.alarm && situation.rests && !situation.hearing.is_heard());
        assert_eq!(situation.p_fault, 0.75);
        assert!(
            situation.hearing.may_latch() == (step > 55) || (50..=55).contains(&step),
            "{step}"
        );
    }
    for step in 100..109 {
        let situation = next(100 * step, Readiness::Armed);
        assert!(situation.alarm && !situation.rests);
    }
    let situation = next(10_900, Readiness::Armed);
    assert_eq!(
        (situation.alarm, situation.hearing.is_heard()),
        (false, true)
    );
    assert!(situation.hearing.may_latch());
}

#[test]
fn the_alarm_that_an_earlier_supervisor_left_goes_on_and_is_left_again() {
    let left = Carryover {
        detected_t_capture_ns: 7,
        p_fault: 0.75,
        alarm_t_capture_ns: 8,
        alarm_count: 3,
        ..Carryover::default()
    };
    let mut arming = detection(100, 0);
    (arming.header.epoch, arming.readiness) = (2, Readiness::Arming as u32);
    let mut fusion = AlarmFusion::new(0.5);
    fusion.restore(&left);
    assert_eq!(fusion.carryover(), left);
    take(&mut fusion, Some(&arming), Some(&diagnosis(0.25)));
    assert_eq!(fusion.carryover(), left);
    assert!(fusion.situation().alarm);
    // In another run nothing is left of it but how many there were.
    arming.run_id = 5;
    take(&mut fusion, Some(&arming), Some(&diagnosis(0.25)));
    let next = Carryover {
        alarm_count: 3,
        ..Carryover::default()
    };
    assert_eq!(fusion.carryover(), next);
}

#[test]
fn an_alarm_that_the_identifier_had_ended_does_not_rise_as_the_supervisor_is_replaced() {
    let ended = Carryover {
        detected_t_capture_ns: MS,
        alarm_count: 3,
        ..Carryover::default()
    };
    let mut fusion = AlarmFusion::new(0.5);
    fusion.restore(&ended);
    let mut next = |t_ms, answer: Option<f64>| {
        let diagnosis = answer.map(diagnosis);
        take(&mut fusion, Some(&detection(t_ms, 1)), diagnosis.as_ref());
        fusion.situation().alarm
    };
    assert_eq!([10, 20].map(|t_ms| next(t_ms, None)), [false; 2]);
    assert!(!next(30, Some(0.9)));
    assert!(next(40, Some(0.2)), "the identifier doubts");
}

#[test]
fn beside_an_alarm_of_an_earlier_supervisor_help_is_called_after_five_seconds() {
    let left = Carryover {
        detected_t_capture_ns: 7,
        ..Carryover::default()
    };
    let mut fusion = AlarmFusion::new(0.5);
    fusion.restore(&left);
    let mut heard = diagnosis(0.0);
    heard.header.epoch = 8;
    for step in 1..=520 {
        let alarm = detection(10 * step, 1);
        take(&mut fusion, Some(&alarm), Some(&heard));
        let hearing = fusion.situation().hearing;
        assert!(hearing.is_heard(), "{step}");
        let is_between = (495..505).contains(&step);
        assert!(is_between || hearing.may_latch() == (step > 500), "{step}");
    }
    // Who has not seen how the alarm began finds neither health nor what is inexplicable.
    for (p_nominal, p_unknown) in [(0.7, 0.1), (0.1, 0.8), (0.4, 0.2)] {
        fusion.restore(&left);
        (heard.p[0], heard.p_unknown) = (p_nominal, p_unknown);
        for step in 1..=520 {
            take(&mut fusion, Some(&detection(10 * step, 1)), Some(&heard));
            let is_heard = fusion.situation().hearing.is_heard();
            let is_between = (495..505).contains(&step);
            assert!(is_between || is_heard == (step > 500), "{step}");
        }
    }
    // Nor does it call before that if no identifier comes; that is a loss from the third cycle on.
    fusion.restore(&left);
    for step in 1..=520 {
        take(&mut fusion, Some(&detection(10 * step, 1)), None);
        let hearing = fusion.situation().hearing;
        assert_eq!(hearing.is_lost(), step >= 3, "{step}");
        let is_between = (495..505).contains(&step);
        assert!(is_between || hearing.may_latch() == (step > 500), "{step}");
    }
}

#[test]
fn an_identifier_that_is_lost_is_waited_for_before_help_is_called() {
    let mut fusion = AlarmFusion::new(0.5);
    let (mut t_ms, heard) = (0, diagnosis(0.0));
    let mut next = |answer: Option<&FaultBelief>| {
        t_ms += 10;
        take(&mut fusion, Some(&detection(t_ms, 1)), answer);
        let hearing = fusion.situation().hearing;
        (hearing.is_heard(), hearing.may_latch())
    };
    assert_eq!(next(Some(&heard)), (true, true));
    assert_eq!([(); 2].map(|()| next(None)), [(true, true); 2]);
    // A diagnosis or two that know of nothing yet are no loss.
    let unaware = FaultBelief::default();
    assert_eq!(next(Some(&unaware)), (false, false));
    assert_eq!(next(Some(&heard)), (true, true));
    // The same one is waited for no longer than until it is heard again.
    assert_eq!([(); 9].map(|()| next(None)).last(), Some(&(false, false)));
    assert_eq!(next(Some(&heard)), (true, true));
    // Another one for five seconds from the loss on. Heard and lost again, it is waited for anew.
    let mut another = diagnosis(0.0);
    another.header.epoch = 8;
    for k in 0..400 {
        let is_there = k >= 300;
        let said = next(is_there.then_some(&another));
        assert_eq!((said.0, !said.1 || k < 3), (is_there || k < 2, true), "{k}");
    }
    for k in 0..497 {
        let said = next(None);
        assert_eq!(said, (k < 2, false), "{k}");
    }
    assert_eq!([(); 20].map(|()| next(None)).last(), Some(&(false, true)));
    assert_eq!(next(Some(&another)), (true, true));
    // So it is if yet another one answers before it is missed.
    another.header.epoch = 9;
    for k in 0..490 {
        assert_eq!(next(Some(&another)), (true, false), "{k}");
    }
    assert_eq!(
        [(); 20].map(|()| next(Some(&another))).last(),
        Some(&(true, true))
    );
    // One that names a fault now and then is not waited for again and again.
    (another.header.epoch, another.p_unknown) = (10, 0.4);
    let mut since = 0;
    for k in 0..1500 {
        let is_named = k % 20 < 10;
        another.p_unknown = if is_named { 0.4 } else { 0.6 };
        let may_latch = next(Some(&another)).1;
        since = if may_latch { since } else { k };
    }
    assert!((400..1020).contains(&since), "{since}");
    // What is not sound is no answer.
    let mut fusion = AlarmFusion::new(0.5);
    for k in 1..20 {
        let detection = detection(10 * k, 1);
        let inputs = Inputs {
            diagnosis: Some(&heard),
            detection: Some(&detection),
        };
        fusion.take(Entry::Frame(inputs), |_| false);
        assert!(!fusion.situation().hearing.is_heard());
    }
}

#[test]
fn a_gap_counts_for_half_a_second_of_motion() {
    let mut fusion = AlarmFusion::new(0.5);
    take(&mut fusion, Some(&detection(1, 1)), Some(&diagnosis(1.0)));
    take(
        &mut fusion,
        Some(&detection(9_000, 1)),
        Some(&diagnosis(1.0)),
    );
    assert!(fusion.situation().alarm);
    take(
        &mut fusion,
        Some(&detection(9_600, 1)),
        Some(&diagnosis(1.0)),
    );
    assert!(!fusion.situation().alarm);
}

#[test]
fn a_probability_that_is_none_is_no_word_of_health() {
    let mut fusion = AlarmFusion::new(0.5);
    take(&mut fusion, None, Some(&diagnosis(f64::NAN)));
    assert_eq!(fusion.p_nominal, 0.0);
    take(&mut fusion, None, Some(&diagnosis(0.25)));
    assert_eq!(fusion.p_nominal, 0.25);
    assert_eq!(fusion.faults, 0);
}

#[test]
fn faults_are_those_of_a_reported_set_while_the_identifier_sees() {
    let mut fusion = AlarmFusion::new(0.5);
    let mut faults = |p, set_count, mode| {
        let mut diagnosis = FaultBelief {
            set_count,
            mode,
            ..FaultBelief::default()
        };
        (diagnosis.sets[0].p, diagnosis.sets[0].leaves) = (p, 0b110);
        fusion.take_diagnosis(&diagnosis);
        fusion.faults
    };
    assert_eq!(faults(0.5, 1, 0), 2);
    assert_eq!(faults(0.49, 1, 0), 0);
    assert_eq!(faults(0.9, 0, 0), 0);
    assert_eq!(faults(0.9, 1, MODE_BLIND), 0);
}

#[test]
fn a_reset_or_a_new_run_ends_the_alarm() {
    let mut fusion = AlarmFusion::new(0.5);
    take(&mut fusion, Some(&detection(10, 1)), Some(&diagnosis(0.0)));
    fusion.take(Entry::Missed(9), |_| true);
    assert!(fusion.situation().alarm);
    fusion.take(Entry::Reset, |_| true);
    assert!(!fusion.situation().alarm);
    assert_eq!(
        (fusion.p_nominal, fusion.readiness),
        (1.0, Readiness::Arming as u32)
    );
    take(&mut fusion, Some(&detection(20, 1)), Some(&diagnosis(0.0)));
    assert!(fusion.situation().alarm);
    let mut next = detection(30, 0);
    next.run_id = 7;
    take(&mut fusion, Some(&next), Some(&diagnosis(0.0)));
    assert!(!fusion.situation().alarm);
    assert_eq!(fusion.run_id, 7);
}

#[test]
fn only_going_on_is_slowed_and_only_while_the_detector_arms() {
    let mut fusion = AlarmFusion::new(0.25);
    let scale = |fusion: &AlarmFusion, kind: RecoveryKind| {
        let mut action = Action {
            kind: kind as u32,
            speed_scale: 0.8,
            ..Action::default()
        };
        fusion.write(&mut action);
        action.speed_scale
    };
    assert_eq!(scale(&fusion, RecoveryKind::GoOn), 0.2);
    assert_eq!(scale(&fusion, RecoveryKind::Compensate), 0.8);
    take(&mut fusion, Some(&detection(0, 0)), None);
    assert_eq!(scale(&fusion, RecoveryKind::GoOn), 0.8);
}

#[test]
fn a_prediction_says_whether_the_detector_is_blind_and_nothing_else() {
    let mut fusion = AlarmFusion::new(0.5);
    let mut predicted = detection(5, 1);
    predicted.cause.kind = CauseKind::Missed as u32;
    predicted.blind = 2;
    let inputs = Inputs {
        diagnosis: None,
        detection: Some(&predicted),
    };
    assert!(matches!(
        fusion.take(Entry::Frame(inputs), |_| true),
        Entry::Missed(0)
    ));
    let situation = fusion.situation();
    assert!(situation.is_blind && !situation.alarm);
    let mut action = Action::default();
    fusion.write(&mut action);
    assert_eq!(action.blind, 2);
}
