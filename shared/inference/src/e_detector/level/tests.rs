use super::*;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

const PLAIN: LevelReading = LevelReading {
    residual: 0.0,
    tolerance: 0.3,
    change: 0.05,
    sd: 0.1,
    elapsed_h: 1.0,
};

/// Mean of a function of a Gaussian residual, by Simpson's rule over ten deviations either way.
fn mean(centre: f64, sd: f64, of: impl Fn(f64) -> f64) -> f64 {
    const STEPS: u32 = 4000;
    let width = 20.0 / f64::from(STEPS);
    let at = |i: u32| {
        let z = -10.0 + width * f64::from(i);
        (-0.5 * z * z).exp() * of(centre + sd * z)
    };
    let inner: f64 = (1..STEPS).map(|i| f64::from(2 + 2 * (i % 2)) * at(i)).sum();
    (at(0) + inner + at(STEPS)) * width / 3.0 / (2.0 * std::f64::consts::PI).sqrt()
}

#[test]
fn the_bounds_of_the_mean_are_those_of_a_search_over_the_null() {
    let grid = |most: f64| (-60..=60).map(move |i| most * f64::from(i) / 60.0);
    for (residual, change, sd, correlation) in [
        (0.2, 0.05, 0.1, [0.0, 0.0]),
        (0.2, 0.05, 0.1, [0.5, 0.9]),
        (-0.4, 0.6, 0.2, [-0.3, 0.3]),
        (0.1, 0.0, 0.05, [0.9, 0.9]),
    ] {
        let before = LevelReading { residual, ..PLAIN };
        let now = LevelReading {
            change,
            sd,
            ..PLAIN
        };
        let given = Conditional::new(&before, &now, correlation);
        let (mut lower, mut upper) = (f64::INFINITY, f64::NEG_INFINITY);
        for rho in grid(0.5).map(|x| (0.5 - x) * correlation[0] + (0.5 + x) * correlation[1]) {
            for was in grid(before.tolerance) {
                for is in grid(now.tolerance).filter(|is| (is - was).abs() <= change + 1e-12) {
                    let mean = is + rho * sd / before.sd * (residual - was);
                    (lower, upper) = (lower.min(mean), upper.max(mean));
                }
            }
        }
        // The grid misses the bend by half of its width at most.
        assert!((given.upper - upper).abs() < 5e-3, "{given:?} {upper}");
        assert!((given.lower - lower).abs() < 5e-3, "{given:?} {lower}");
        assert!(given.upper >= upper - 1e-12 && given.lower <= lower + 1e-12);
    }
}

#[test]
fn a_context_that_may_jump_is_bounded_by_its_tolerances_alone() {
    let any = |tolerance: f64| LevelReading {
        tolerance,
        change: f64::INFINITY,
        ..PLAIN
    };
    // From a wide bound to a narrow one: 0.1 + 0.5 (0.2 + 0.9), and mirrored 0.1 + 0.5 (0.9 - 0.2).
    let before = LevelReading {
        residual: 0.2,
        ..any(0.9)
    };
    let given = Conditional::new(&before, &any(0.1), [0.5; 2]);
    assert!((given.upper - 0.65).abs() < 1e-12 && (given.lower + 0.45).abs() < 1e-12);
    let mut level = Level::new([0.5; 2]);
    level.step(&before);
    level.step(&any(0.1));
    assert!(level.hours() > 0.0);
}

#[test]
fn a_slow_context_of_white_or_coloured_noise_has_the_bounds_by_hand() {
    let still = LevelReading {
        change: 0.0,
        ..PLAIN
    };
    let white = Conditional::new(&still, &still, [0.0; 2]);
    assert_eq!((white.lower, white.upper, white.sd), (-0.3, 0.3, 0.1));
    let coloured = Conditional::new(&still, &still, [0.8; 2]);
    // (1 - ρ) d, and s √(1 - ρ²).
    assert!((coloured.upper - 0.06).abs() < 1e-12 && (coloured.lower + 0.06).abs() < 1e-12);
    assert!((coloured.sd - 0.06).abs() < 1e-12);
}

#[test]
fn each_e_value_has_mean_one_or_less_in_every_corner() {
    let given = Conditional {
        lower: -0.3,
        upper: 0.3,
        sd: 0.1,
    };
    let means = |centre: f64, sd: f64| -> [f64; COUNT] {
        std::array::from_fn(|i| mean(centre, sd, |residual| given.log_e(residual)[i].exp()))
    };
    for centre in [-0.3, -0.1, 0.0, 0.3] {
        for sd in [0.1, 0.05, 0.01] {
            for e in means(centre, sd) {
                assert!(e <= 1.0 + 1e-6, "{centre} {sd}: {e}");
            }
        }
    }
    // At the edge with the largest noise a shift's is 1, but for what is cut off; the others' less.
    let edge = means(0.3, 0.1);
    for (e, expected) in [edge[0], edge[2], edge[4]]
        .into_iter()
        .zip([1.0, 1.0, 0.999])
    {
        assert!((e - expected).abs() < 2e-3, "{e}");
    }
    // θ = 4 is cut off at 8 nats, where half of its mean lies: Φ(0) + e^8 (1 - Φ(4)).
    assert!((edge[6] - 0.5944).abs() < 1e-3, "{}", edge[6]);
    // Scatter without a context is exact, but for what is cut off; half of it is on either side.
    let point = Conditional {
        lower: 0.0,
        upper: 0.0,
        sd: 0.1,
    };
    let scatter = mean(0.0, 0.1, |residual| point.log_e(residual)[COUNT - 1].exp());
    assert!((0.9..1.0).contains(&scatter), "{scatter}");
    // Beyond the null they are larger: the bound has no slack left.
    assert!(means(0.32, 0.1)[2] > 1.2 && means(0.3, 0.12)[4] > 1.5);
}

/// How a context moves that obeys its bound and its rate.
#[derive(Debug, Clone, Copy)]
enum Context {
    Edge,
    Swings,
    /// Up as fast as allowed while the noise is high, and down else: it knows the past.
    Follows,
}

/// One law of the null, or outside.
#[derive(Debug, Clone, Copy)]
struct Law {
    context: Context,
    rho: f64,
    /// Deviation over the declared one.
    sd: f64,
}

/// Mean of the largest mean of an E-value, its standard error, and alarms per promised one.
fn drive(law: Law, correlation: [f64; 2]) -> (f64, f64, f64) {
    const STEPS: u32 = 400_000;
    const PROMISE: f64 = 500.0;
    let mut rng = Pcg64Mcg::seed_from_u64(7);
    let mut level = Level::new(correlation);
    let (mut noise, mut context, mut before) = (0.0, 0.0_f64, None);
    let (mut sums, mut squares, mut alarms) = ([0.0; COUNT], [0.0; COUNT], 0);
    for step in 0..STEPS {
        let fresh: f64 = StandardNormal.sample(&mut rng);
        let up = match law.context {
            Context::Edge => true,
            Context::Swings => step / 12 % 2 == 0,
            Context::Follows => noise > 0.0,
        };
        let change = if up { PLAIN.change } else { -PLAIN.change };
        context = (context + change).clamp(-PLAIN.tolerance, PLAIN.tolerance);
        noise = law.rho * noise + law.sd * PLAIN.sd * (1.0 - law.rho * law.rho).sqrt() * fresh;
        let reading = LevelReading {
            residual: context + noise,
            ..PLAIN
        };
        if let Some(before) = before {
            let given = Conditional::new(&before, &reading, correlation);
            for (i, log_e) in given.log_e(reading.residual).into_iter().enumerate() {
                sums[i] += log_e.exp();
                squares[i] += (2.0 * log_e).exp();
            }
        }
        before = Some(reading);
        level.step(&reading);
        if level.hours() >= PROMISE {
            alarms += 1;
            level.forget();
        }
    }
    let steps = f64::from(STEPS - 1);
    let largest = (0..COUNT).max_by(|&a, &b| sums[a].total_cmp(&sums[b]));
    let largest = largest.unwrap_or(0);
    let mean = sums[largest] / steps;
    let error = ((squares[largest] / steps - mean * mean) / steps).sqrt();
    (mean, error, f64::from(alarms) * PROMISE / f64::from(STEPS))
}

#[test]
fn the_promise_holds_under_every_corner_of_the_null() {
    let declared = [-0.3, 0.6];
    for context in [Context::Edge, Context::Swings, Context::Follows] {
        for rho in [-0.3, 0.0, 0.6] {
            for sd in [0.2, 1.0] {
                let law = Law { context, rho, sd };
                let (mean, error, alarms) = drive(law, declared);
                assert!(mean <= 1.0 + 4.0 * error, "{law:?}: {mean} {error}");
                // Expected are 800 alarms at most: 4 deviations of their number.
                assert!(alarms <= 1.0 + 4.0 / 800.0_f64.sqrt(), "{law:?}: {alarms}");
            }
        }
    }
    // A known correlation is whitened. What the context gains by a step from d - δ, where it is
    // not, is (1 - ρ) d + ρ δ less (1 - ρ) d: 0.03, of a deviation of 0.08, at the tilt 0.5.
    let law = Law {
        context: Context::Edge,
        rho: 0.6,
        sd: 1.0,
    };
    let (mean, error, alarms) = drive(law, [0.6; 2]);
    let expected = (-0.5_f64 * 0.03 / 0.08).exp();
    assert!((mean - expected).abs() < 4.0 * error, "{mean} {error}");
    assert!(alarms > 0.0 && alarms <= 1.14, "{alarms}");
}

#[test]
fn outside_the_null_nothing_is_promised() {
    let law = |rho: f64, sd: f64| Law {
        context: Context::Edge,
        rho,
        sd,
    };
    for (law, declared) in [(law(0.0, 1.6), [0.0; 2]), (law(0.8, 1.0), [0.0, 0.2])] {
        let (_, _, alarms) = drive(law, declared);
        assert!(alarms > 1.3, "{law:?}: {alarms}");
    }
}

#[test]
fn a_shift_beyond_the_bound_is_seen_and_one_within_it_never() {
    let after = |residual: f64| {
        let mut level = Level::new([0.0; 2]);
        for _ in 0..100 {
            let reading = LevelReading { residual, ..PLAIN };
            level.step(&reading);
        }
        level.hours()
    };
    assert!(after(0.3) < 10.0 && after(-0.3) < 10.0);
    assert!(after(0.45) > 1e6 && after(-0.45) > 1e6);
}

#[test]
fn a_reading_that_is_none_interrupts_and_says_nothing() {
    let mut level = Level::new([0.0; 2]);
    for _ in 0..3 {
        level.step(&PLAIN);
    }
    let hours = level.hours();
    for residual in [f64::NAN, f64::INFINITY] {
        level.step(&LevelReading { residual, ..PLAIN });
        assert_eq!(level.hours(), hours);
        // The next is the first again.
        level.step(&LevelReading {
            residual: 9.0,
            ..PLAIN
        });
        assert_eq!(level.hours(), hours);
    }
    level.step(&LevelReading { sd: 0.0, ..PLAIN });
    level.step(&PLAIN);
    assert_eq!(level.hours(), hours);
    level.interrupt();
    level.step(&PLAIN);
    assert_eq!(level.hours(), hours);
    level.forget();
    assert_eq!(level.hours(), 0.0);
}
