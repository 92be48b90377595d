//! Closed forms of tiny robots.

use vigil_robot::channel_model::fault_kind::FaultKind;
use vigil_robot::channel_model::law::{BLOCKS, Direction, Law, Row};
use vigil_robot::channel_model::model::Class;
use vigil_robot::channel_model::{AXES, Quantity, Target};

use super::comparison::Products;
use super::fault::{Extent, Fault, Origin};
use super::rule::Rule;
use super::snapshot::{Place, Snapshot};
use super::wait::{Wait, Waits};

/// Rules over channels with these directions, white in time.
fn rule(directions: &[(Vec<f64>, f64)]) -> Rule {
    let direction = |(vector, variance): &(Vec<f64>, f64)| Direction {
        vector: vector.clone(),
        variance: *variance,
        correlation: [0.0; BLOCKS - 1],
    };
    let directions: Vec<Direction> = directions.iter().map(direction).collect();
    let channel = |i: usize| Target {
        name: format!("c{i}"),
        unit: "m/s".into(),
        quantity: Quantity::Other,
        place: i,
        wheel: None,
        largest: f64::MAX,
        period: None,
        drifts: false,
    };
    Rule {
        law: Law::new(&directions, directions.len(), 0).unwrap(),
        targets: (0..directions.len()).map(channel).collect(),
        prior: -10.0,
        alarm: 0.0,
        tails: Class::ALL.map(|_| None),
    }
}

fn fault(channel: usize, kind: FaultKind, size: f64) -> Fault {
    Fault {
        component: format!("c{channel}"),
        broken: format!("c{channel}"),
        kind,
        origin: Origin::Channel(channel),
        extent: Extent {
            size,
            bounds: [f64::NEG_INFINITY, f64::INFINITY],
            prior: 0.0,
        },
        unit: String::new(),
        price: 0.0,
        class: Class::Steady,
    }
}

/// A window without residuals, all channels predicted to read these values.
fn snapshot(channels: usize, predicted: Row) -> Snapshot {
    Snapshot {
        place: Place::default(),
        square: 8.0,
        parts: [1.0; BLOCKS],
        z: vec![[0.0; BLOCKS]; channels],
        unit: vec![[1.0; BLOCKS]; channels],
        predicted: vec![predicted; channels],
        late: vec![[0.0; BLOCKS]; channels],
        share: Vec::new(),
        offset: Vec::new(),
        command: [[0.0; AXES]; BLOCKS],
        residual: vec![Some(0.0); channels],
    }
}

/// What the second of two faults leaves of the first, by the sights of the window.
fn left(faults: &[Fault], snapshot: &Snapshot, rule: &Rule, first: usize) -> f64 {
    let products = Products::new(faults, first, snapshot, rule);
    let [own, rival] = products.sights(faults, [0, 1], rule, |_| 0.0);
    own.less - rival.less
}

#[test]
fn a_bias_and_a_gain_of_one_channel_differ_by_how_much_the_prediction_varies() {
    let rule = rule(&[(vec![1.0], 4.0)]);
    let faults = [
        fault(0, FaultKind::Bias, 3.0),
        fault(0, FaultKind::Gain, 2.0),
    ];
    let steady = snapshot(1, [5.0; BLOCKS]);
    let products = Products::new(&faults, 4, &steady, &rule);
    let [own, _] = products.sights(&faults, [0, 1], &rule, |_| 0.0);
    // d² of four blocks, each of 3 over a deviation of 2.
    assert!((own.own - 4.0 * 9.0 / 4.0).abs() < 1e-12);
    assert!((own.less - own.own).abs() < 1e-12 && (own.square - 17.0).abs() < 1e-12);
    assert!(left(&faults, &steady, &rule, 0).abs() < 1e-12);
    assert!(!products.exclude(&faults, [0, 1], &rule, |_| 0.0));
    // Of values u: n b² (1 - (Σu)² / (n Σu²)) over the variance.
    let varied = snapshot(1, [0.0, 4.0, 0.0, 4.0, 0.0, 4.0, 0.0, 4.0]);
    let exact = 8.0 * 9.0 / 4.0 * (1.0 - 16.0 * 16.0 / (8.0 * 64.0));
    assert!((left(&faults, &varied, &rule, 0) - exact).abs() < 1e-12);
    assert!(Products::new(&faults, 0, &varied, &rule).exclude(&faults, [0, 1], &rule, |_| 0.0));
}

#[test]
fn opposite_faults_of_two_like_sensors_need_a_third_to_be_told_apart() {
    // What all sensors have in common is not known: a large variance.
    let half = 0.5_f64.sqrt();
    let two = rule(&[(vec![half, half], 1e6), (vec![half, -half], 1.0)]);
    let faults = [
        fault(0, FaultKind::Bias, 5.0),
        fault(1, FaultKind::Bias, -5.0),
    ];
    let window = snapshot(2, [0.0; BLOCKS]);
    assert!(left(&faults, &window, &two, 0) < 1e-3);
    assert!(!Products::new(&faults, 0, &window, &two).exclude(&faults, [0, 1], &two, |_| 0.0));

    let third = 3.0_f64.sqrt().recip();
    let sixth = 6.0_f64.sqrt().recip();
    let three = rule(&[
        (vec![third; 3], 1e6),
        (vec![half, -half, 0.0], 1.0),
        (vec![sixth, sixth, -2.0 * sixth], 1.0),
    ]);
    let window = snapshot(3, [0.0; BLOCKS]);
    // Of the differences a fault has the direction (2, -1, -1) / 3: d² = 8 · 25 · 2/3, and the
    // cosine of two of them is -1/2.
    let exact = 8.0 * 25.0 * 2.0 / 3.0 * (1.0 - 0.25);
    assert!((left(&faults, &window, &three, 0) - exact).abs() < 0.1);
    assert!(Products::new(&faults, 0, &window, &three).exclude(&faults, [0, 1], &three, |_| 0.0));
}

#[test]
fn a_gain_of_what_reads_zero_is_not_seen() {
    let rule = rule(&[(vec![1.0], 1.0)]);
    let faults = [fault(0, FaultKind::Gain, 2.0)];
    let products = Products::new(&faults, 0, &snapshot(1, [0.0; BLOCKS]), &rule);
    let [own, _] = products.sights(&faults, [0, 0], &rule, |_| 0.0);
    assert!(own.own.abs() < 1e-300 && own.less.abs() < 1e-300);
}

#[test]
fn a_wait_ends_with_the_next_window_that_shows_it() {
    // Ten windows, ten seconds and five metres apart, of which the last shows it within a second.
    let log = (0..10).map(|i| Snapshot {
        place: Place {
            motion_s: 10.0 * f64::from(i),
            way_m: Some(5.0 * f64::from(i)),
            speed_m_s: 0.5,
        },
        ..snapshot(1, [0.0; BLOCKS])
    });
    let log: Vec<Snapshot> = log.collect();
    let mut blocks = [0; 10];
    assert_eq!(Waits::new(&log, &blocks), None);
    blocks[9] = 2;
    let wait = |motion_s: f64| Wait {
        motion_s,
        way_m: Some(0.5 * motion_s),
    };
    let expected = Waits {
        half: wait(41.0),
        nine_of_ten: wait(81.0),
    };
    assert_eq!(Waits::new(&log, &blocks), Some(expected));
}
