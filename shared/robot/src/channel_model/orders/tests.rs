use super::*;

const DT_S: f64 = 0.02;
const RATE_RAD_S: f64 = 8.0;

/// A wheel's rate, and what another channel reads at each angle.
fn turned(turns: f64, rate_rad_s: f64, dt_s: f64, reads: impl Fn(f64) -> f64) -> WheelOrders {
    let mut tracker = OrderTracker::new(&[(0, 0)], 2);
    let mut angle_rad = 0.0_f64;
    while angle_rad.abs() < TAU * turns {
        angle_rad += rate_rad_s * dt_s;
        let mut readings = [None; CHANNELS_MAX];
        (readings[0], readings[1]) = (Some(rate_rad_s), Some(reads(angle_rad)));
        tracker.take(dt_s, &readings);
    }
    tracker.sum_up();
    tracker.found()[0].clone()
}

#[test]
fn what_comes_back_three_times_a_turn_is_the_third_order() {
    let found = turned(60.0, RATE_RAD_S, DT_S, |angle| 0.5 * (3.0 * angle).cos());
    let amplitude = found.amplitudes[ORDERS + 2];
    // Of A cos(hθ) over many turns half of A is left, times the root of the number of steps
    // that are remembered: the square of a sum of powers over the sum of their squares. The
    // mean that is taken off passes (1 - z) / (1 - (1 - a) z), with z = e^{-ihΔθ}, twice.
    let step_rad = RATE_RAD_S * DT_S;
    let kept = (-step_rad / (TAU * MEMORIES_TURNS[0])).exp();
    let steps = (1.0 - kept * kept) / ((1.0 - kept) * (1.0 - kept));
    let (one, z) = (
        Complex::new(1.0, 0.0),
        Complex::from_polar(1.0, -3.0 * step_rad),
    );
    let once = (one - z) / (one - z * (-step_rad / MEAN_RAD).exp());
    let expected = once * once * 0.25 * steps.sqrt();
    assert!(
        (amplitude - expected).norm() < 0.01 * expected.norm(),
        "{amplitude} {expected}"
    );
    let others = (0..ORDERS).filter(|h| *h != 2);
    let aside = others.map(|h| found.amplitudes[ORDERS + h].norm());
    assert!(
        aside.fold(0.0, f64::max) < 0.1 * amplitude.norm(),
        "{found:?}"
    );
    assert!((found.turns - 60.0).abs() < 0.1 && found.is_told());
}

#[test]
fn noise_is_as_large_at_an_order_as_beside_it() {
    use rand::{RngExt, SeedableRng};
    let (mut at, mut beside) = (0.0, 0.0);
    for seed in 0..200 {
        let rng = std::cell::RefCell::new(rand_pcg::Pcg64Mcg::seed_from_u64(seed));
        let noise = |_| rng.borrow_mut().random_range(-1.0..1.0);
        let found = turned(20.0, RATE_RAD_S, DT_S, noise);
        at += found.amplitudes[ORDERS + 2].norm_sqr() / 200.0;
        beside += found.beside[ORDERS + 2].unwrap() / 200.0;
    }
    // The variance of uniform noise is 1/3; the mean that is taken off takes some of it.
    assert!((at / beside - 1.0).abs() < 0.2, "{at} {beside}");
    assert!((0.2..0.35).contains(&at), "{at}");
}

#[test]
fn a_wheel_at_rest_changes_nothing() {
    let mut tracker = OrderTracker::new(&[(0, 0)], 1);
    let mut readings = [None; CHANNELS_MAX];
    for _ in 0..500 {
        readings[0] = Some(RATE_RAD_S);
        tracker.take(DT_S, &readings);
    }
    tracker.sum_up();
    let before = tracker.found().to_vec();
    readings[0] = Some(0.0);
    for _ in 0..500 {
        tracker.take(DT_S, &readings);
    }
    tracker.sum_up();
    assert_eq!(tracker.found(), before);
}

/// Wheels that turn at rates which depend on the time, of which each channel reads something.
fn driven<const N: usize>(
    length_s: f64,
    rates_rad_s: impl Fn(f64) -> [f64; N],
    reads: impl Fn(&[f64; N]) -> Option<f64>,
) -> OrderTracker {
    let rates: Vec<(usize, usize)> = (0..N).map(|wheel| (wheel, wheel)).collect();
    let mut tracker = OrderTracker::new(&rates, N + 1);
    let mut angles_rad = [0.0; N];
    for frame in 0..(length_s / DT_S) as usize {
        let rates_rad_s = rates_rad_s(frame as f64 * DT_S);
        let mut readings = [None; CHANNELS_MAX];
        for ((angle, rate), reading) in angles_rad.iter_mut().zip(rates_rad_s).zip(&mut readings) {
            *angle += rate * DT_S;
            *reading = Some(rate);
        }
        readings[N] = reads(&angles_rad);
        tracker.take(DT_S, &readings);
    }
    tracker.sum_up();
    tracker
}

#[test]
fn what_a_wheel_shows_on_the_way_back_changes_nothing() {
    // What turns with the sense of the wheel, and what does not.
    let ripple = |angle: f64| (2.0 * angle + 0.4).cos();
    let back = |t_s: f64| (t_s / 9.0) as u64 % 3 == 2;
    let sense = |t_s: f64| if back(t_s) { -1.0 } else { 1.0 };
    let drive = |t_s: f64| [RATE_RAD_S * sense(t_s)];
    let on = driven(
        120.0,
        |_| [RATE_RAD_S],
        |angles: &[f64; 1]| Some(ripple(angles[0])),
    );
    let even = driven(120.0, drive, |angles: &[f64; 1]| Some(ripple(angles[0])));
    let t_s = std::cell::Cell::new(0.0);
    let odd = driven(120.0, drive, |angles: &[f64; 1]| {
        let now_s = t_s.replace(t_s.get() + DT_S);
        Some(sense(now_s) * ripple(angles[0]))
    });
    let of = |tracker: &OrderTracker| tracker.found()[0].amplitudes[ORDERS + 1];
    for both in [&even, &odd] {
        // Where it turns round the means are of the way before.
        let (on, both) = (of(&on), of(both));
        assert!((on - both).norm() < 0.15 * on.norm(), "{on} {both}");
    }
    assert!((even.found()[0].turns / on.found()[0].turns - 2.0 / 3.0).abs() < 0.05);
    let never = driven(
        120.0,
        |_| [-RATE_RAD_S],
        |angles: &[f64; 1]| Some(ripple(angles[0])),
    );
    assert!(!never.found()[0].is_told() && of(&never).norm() == 0.0);
}

#[test]
fn a_channel_that_is_hardly_read_says_nothing_and_one_read_in_part_as_much_as_in_full() {
    let frame = std::cell::Cell::new(0_u32);
    let every = |n: u32| {
        frame.set(0);
        let frame = &frame;
        driven(
            120.0,
            |_| [RATE_RAD_S],
            move |angles: &[f64; 1]| {
                frame.set(frame.get() + 1);
                (frame.get() % 4 < n).then(|| angles[0].cos())
            },
        )
    };
    let of = |tracker: &OrderTracker| tracker.found()[0].clone();
    let [full, part, hardly] = [4, 3, 1].map(|n| of(&every(n)));
    assert!(hardly.beside[ORDERS].is_none() && hardly.amplitudes[ORDERS].norm() == 0.0);
    let ratio = part.amplitudes[ORDERS].norm() / full.amplitudes[ORDERS].norm();
    // Of three readings in four as much as the root of their number.
    assert!((ratio / 0.75_f64.sqrt() - 1.0).abs() < 0.1, "{ratio}");
}

#[test]
fn a_wheel_whose_rate_is_lost_turns_on_and_then_stands() {
    let mut tracker = OrderTracker::new(&[(0, 0)], 1);
    let mut readings = [None; CHANNELS_MAX];
    readings[0] = Some(RATE_RAD_S);
    tracker.take(DT_S, &readings);
    readings[0] = None;
    for _ in 0..1000 {
        tracker.take(DT_S, &readings);
    }
    tracker.sum_up();
    let expected = RATE_RAD_S * UNREAD_S / TAU;
    let turns = tracker.found()[0].turns;
    assert!(
        (turns - expected).abs() < 2.0 * RATE_RAD_S * DT_S / TAU,
        "{turns}"
    );
}

#[test]
fn wheels_that_turn_alike_share_what_comes_back_and_others_do_not() {
    let reads = |angles: &[f64; 2]| Some((2.0 * angles[0] + 1.0).cos());
    // The second stands by 0.3 rad behind.
    let alike = |t_s: f64| {
        [
            RATE_RAD_S,
            if t_s < 0.3 / RATE_RAD_S {
                0.0
            } else {
                RATE_RAD_S
            },
        ]
    };
    let unlike = |_: f64| [RATE_RAD_S, 0.9 * RATE_RAD_S];
    for (tracker, is_alike) in [
        (driven(120.0, alike, reads), true),
        (driven(120.0, unlike, reads), false),
    ] {
        for (one, other) in [(0, 2), (1, 3)] {
            let [one, other] = [one, other].map(|i| &tracker.found()[i]);
            let (place, shared) = (2 * ORDERS + 1, other.shared_with(0)[1]);
            let (found, expected) = (other.amplitudes[place], one.amplitudes[place] * shared);
            let size = one.amplitudes[place].norm();
            if is_alike {
                assert!((shared.norm() - 1.0).abs() < 0.05, "{shared}");
                assert!(
                    (found - expected).norm() < 0.05 * size,
                    "{found} {expected}"
                );
            } else {
                assert!(shared.norm() < 0.3, "{shared}");
                assert!((found - expected).norm() < 0.1 * size, "{found} {expected}");
            }
            assert!((one.shared_with(0)[1].norm() - 1.0).abs() < 1e-9);
        }
    }
    assert_eq!(tracker_without(&[(0, 0)]), ByOrder::default());
}

fn tracker_without(rates: &[(usize, usize)]) -> ByOrder {
    OrderTracker::new(rates, 1).found()[0].shared_with(7)
}

#[test]
fn amplitudes_grow_with_the_frames_that_are_remembered() {
    let reads = |angles: &[f64; 1]| Some((3.0 * angles[0]).cos());
    let of =
        |turns: f64, rate_rad_s: f64| driven(turns * TAU / rate_rad_s, |_| [rate_rad_s], reads);
    let long = of(200.0, RATE_RAD_S);
    let per_gain = |found: &WheelOrders| found.amplitudes[ORDERS + 2].norm() / found.gain;
    let expected = per_gain(&long.found()[0]);
    // The mean that is taken off passes a little more of a slower wheel.
    for (turns, rate_rad_s) in [
        (6.0, 8.0),
        (16.0, 8.0),
        (40.0, 8.0),
        (40.0, 5.0),
        (40.0, 11.0),
    ] {
        for found in of(turns, rate_rad_s).found() {
            let ratio = per_gain(found) / expected;
            assert!((ratio - 1.0).abs() < 0.2, "{turns} {rate_rad_s} {ratio}");
        }
    }
    // Of the last turns alone as much as of a record that is no longer.
    let [short, long] = [of(6.0, RATE_RAD_S), long].map(|tracker| tracker.found()[0].clone());
    let ratio = long.gain_since(6.0) / short.gain;
    let root = (1.0 - (-12.0 / MEMORIES_TURNS[0]).exp()).sqrt();
    assert!((ratio - root).abs() < 0.02, "{ratio} {root}");
}
