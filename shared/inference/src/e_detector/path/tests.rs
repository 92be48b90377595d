use super::*;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

const STEP_MAX: f64 = 0.02;
const STEP_SD: f64 = 0.01;
const NOISE_SD: f64 = 0.1;
const STEPS: u32 = 12;
/// Of each reading, and so of the step to it.
const ELAPSED_H: f64 = 1.0;

fn reading(apart: f64) -> PathReading {
    PathReading {
        apart,
        step_max: STEP_MAX,
        step_variance: STEP_SD * STEP_SD,
        noise_variance: NOISE_SD * NOISE_SD,
        elapsed_h: ELAPSED_H,
    }
}

/// What a block shows of these positions after its first reading.
fn shown(correlation: f64, positions: &[f64]) -> Slope {
    let mut path = Path::new(positions.len() as u32, correlation);
    path.begin(NOISE_SD * NOISE_SD, ELAPSED_H);
    let shown = positions
        .iter()
        .filter_map(|apart| path.step(&reading(*apart)));
    let all: Vec<Slope> = shown.collect();
    assert_eq!(all.len(), 1);
    all[0]
}

#[test]
fn a_context_at_its_edge_reaches_the_bound_and_none_exceeds_it() {
    for steps in [2_u32, 5, 12] {
        let edge: Vec<f64> = (1..=steps).map(|k| STEP_MAX * f64::from(k)).collect();
        let slope = shown(0.0, &edge);
        assert!(
            (slope.statistic - slope.mean_max).abs() < 1e-12,
            "{slope:?}"
        );
        for k in 0..1_u32 << steps.min(5) {
            let mut at = 0.0;
            let path: Vec<f64> = (0..steps)
                .map(|i| {
                    at += if k >> (i % 5) & 1 == 1 {
                        STEP_MAX
                    } else {
                        -STEP_MAX
                    };
                    at
                })
                .collect();
            let slope = shown(0.0, &path);
            assert!(slope.statistic.abs() <= slope.mean_max + 1e-12);
        }
    }
}

#[test]
fn the_variance_is_that_of_white_noise_and_no_less_than_that_of_any_declared() {
    let slope = shown(0.0, &[0.0; STEPS as usize]);
    let steps = f64::from(STEPS);
    let weight = |k: u32| f64::from(k) - 0.5 * steps;
    let squares: f64 = (0..=STEPS).map(|k| weight(k) * weight(k)).sum();
    // Σ over the steps of (Σ_(k>=j) h_k)², summed up as it stands.
    let after = |j: u32| -> f64 { (j..=STEPS).map(weight).sum() };
    let walks: f64 = (1..=STEPS).map(|j| after(j) * after(j)).sum();
    let exact = NOISE_SD * NOISE_SD * squares + STEP_SD * STEP_SD * walks;
    assert!((slope.variance / exact - 1.0).abs() < 1e-12);
    for most in [0.2, 0.7] {
        let allowed = shown(most, &[0.0; STEPS as usize]);
        for rho in [-most, -0.1, 0.0, 0.5 * most, most] {
            // Innovations of variance s² (1 - ρ²), each with all that it does to the readings.
            let of = |j: u32| -> f64 {
                (j..=STEPS)
                    .map(|k| weight(k) * rho.powi((k - j) as i32))
                    .sum()
            };
            let noise: f64 = (0..=STEPS).map(|j| of(j) * of(j)).sum();
            let noise = NOISE_SD * NOISE_SD * (1.0 - rho * rho) * noise;
            let exact = noise + STEP_SD * STEP_SD * walks;
            assert!(exact <= allowed.variance + 1e-12, "{most} {rho}");
            // What was before the block, at five deviations.
            let before: f64 = (0..=STEPS)
                .map(|k| weight(k) * rho.powi(k as i32 + 1))
                .sum();
            let room = allowed.mean_max - slope.mean_max;
            assert!(
                BOUND * NOISE_SD * before.abs() <= room + 1e-12,
                "{most} {rho}"
            );
        }
    }
}

/// A null law: readings of drives, from a source of noise that knows the blocks.
struct Drive {
    rng: Pcg64Mcg,
    rho: f64,
    /// Deviation of the noise over the declared one.
    scale: f64,
    noise: f64,
    position: f64,
    first: f64,
}

impl Drive {
    fn new(rho: f64, scale: f64, seed: u64) -> Self {
        Self {
            rng: Pcg64Mcg::seed_from_u64(seed),
            rho,
            scale,
            noise: 0.0,
            position: 0.0,
            first: 0.0,
        }
    }

    fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.rng)
    }

    /// The measured position after a step of the context.
    fn next(&mut self, context: f64) -> f64 {
        self.position += context + self.scale * STEP_SD * self.normal();
        let innovation = NOISE_SD * (1.0 - self.rho * self.rho).sqrt();
        let fresh = self.scale * innovation * self.normal();
        self.noise = (self.rho * self.noise + fresh).clamp(-BOUND * NOISE_SD, BOUND * NOISE_SD);
        self.position + self.noise
    }

    fn begin(&mut self, path: &mut Path) {
        self.first = self.next(0.0);
        path.begin(NOISE_SD * NOISE_SD, ELAPSED_H);
    }

    fn step(&mut self, path: &mut Path, context: f64) -> (f64, Option<Slope>) {
        let apart = self.next(context) - self.first;
        (apart, path.step(&reading(apart)))
    }
}

/// Mean and standard error of the E-value of the smallest tilt upwards.
fn mean_e(drive: &mut Drive, correlation: f64, context: impl Fn(f64) -> f64) -> (f64, f64) {
    const BLOCKS: u32 = 40_000;
    let mut path = Path::new(STEPS, correlation);
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..BLOCKS {
        drive.begin(&mut path);
        for _ in 0..STEPS {
            let step = context(drive.noise);
            if let (_, Some(slope)) = drive.step(&mut path, step) {
                let e = slope.log_e()[0][0].exp();
                sum += e;
                squares += e * e;
            }
        }
    }
    let mean = sum / f64::from(BLOCKS);
    let error = (squares / f64::from(BLOCKS) - mean * mean).max(0.0) / f64::from(BLOCKS);
    (mean, error.sqrt())
}

#[test]
fn the_mean_is_one_or_less_in_every_corner_of_the_null() {
    let most = 0.3;
    let contexts: [fn(f64) -> f64; 3] = [
        |_| STEP_MAX,
        |_| -STEP_MAX,
        // It knows the noise.
        |noise| STEP_MAX.copysign(noise),
    ];
    for context in contexts {
        for rho in [-most, 0.0, most] {
            for scale in [0.3, 1.0] {
                let mut drive = Drive::new(rho, scale, 11);
                let (mean, error) = mean_e(&mut drive, most, context);
                assert!(mean <= 1.0 + 4.0 * error, "{rho} {scale}: {mean} {error}");
            }
        }
    }
    // White noise and a context at its edge meet the bound; more noise exceeds it.
    let edge = |_: f64| STEP_MAX;
    let (mean, error) = mean_e(&mut Drive::new(0.0, 1.0, 12), 0.0, edge);
    assert!(
        (mean - 1.0).abs() < 4.0 * error && error < 0.05,
        "{mean} {error}"
    );
    let (mean, error) = mean_e(&mut Drive::new(0.0, 1.3, 13), 0.0, edge);
    assert!(mean > 1.0 + 4.0 * error, "{mean} {error}");
}

/// Alarms per promised one of a healthy drive, if who drives breaks off blocks that go badly.
fn alarms(drop: impl Fn(&mut Path)) -> f64 {
    const PROMISE_H: f64 = 2e4;
    let mut drive = Drive::new(0.0, 1.0, 14);
    let mut path = Path::new(STEPS, 0.0);
    let (mut alarms, mut elapsed_h) = (0, 0.0);
    for _ in 0..40_000 {
        drive.begin(&mut path);
        elapsed_h += ELAPSED_H;
        for k in 1..=STEPS {
            let (apart, _) = drive.step(&mut path, STEP_MAX);
            elapsed_h += ELAPSED_H;
            if k == STEPS - 1 && apart < STEP_MAX * f64::from(k) + 2.0 * NOISE_SD {
                drop(&mut path);
                break;
            }
        }
        if path.vouched_hours() >= PROMISE_H {
            alarms += 1;
            path.forget();
        }
    }
    f64::from(alarms) * PROMISE_H / elapsed_h
}

#[test]
fn who_breaks_off_bad_blocks_gains_no_alarm() {
    // Some 23 are promised at most: four deviations of their number.
    let abandoned = alarms(Path::abandon);
    assert!(abandoned < 1.84, "{abandoned}");
    // As if a reading lacked whenever the noise is low: good blocks alone would break the promise.
    let skipped = alarms(Path::skip);
    assert!(skipped > 5.0, "{skipped}");
}

#[test]
fn a_block_vouches_when_it_has_ended_and_breaking_it_off_costs_what_was_held() {
    let mut path = Path::new(2, 0.0);
    let drift = |path: &mut Path| {
        path.begin(NOISE_SD * NOISE_SD, ELAPSED_H);
        assert_eq!(path.vouched_hours(), 0.0);
        path.step(&reading(1.0));
        assert_eq!(path.vouched_hours(), 0.0);
        path.step(&reading(2.0));
    };
    drift(&mut path);
    let hours = path.hours();
    assert!(hours > 1e3 && path.vouched_hours() == hours && path.is_idle());
    // Without a block under way nothing is lost.
    path.abandon();
    assert_eq!(path.hours(), hours);
    path.begin(NOISE_SD * NOISE_SD, ELAPSED_H);
    path.skip();
    assert_eq!((path.hours(), path.vouched_hours()), (hours, hours));
    path.begin(NOISE_SD * NOISE_SD, ELAPSED_H);
    path.abandon();
    assert_eq!((path.hours(), path.is_idle()), (0.0, true));
    drift(&mut path);
    path.begin(NOISE_SD * NOISE_SD, ELAPSED_H);
    path.step(&reading(f64::NAN));
    assert_eq!((path.hours(), path.is_idle()), (0.0, true));
}

#[test]
fn all_time_is_counted_once_and_that_of_a_block_by_the_next() {
    let mut path = Path::new(2, 0.0);
    // E-values of no drift: the same for each block.
    let block = |path: &mut Path| {
        path.begin(NOISE_SD * NOISE_SD, 5.0);
        path.step(&reading(0.0));
        path.step(&reading(0.0))
    };
    let e = block(&mut path).map(|slope| slope.log_e().map(|of| of.map(f64::exp)));
    let e = e.unwrap();
    let mean = |of: &dyn Fn(f64) -> f64| e.iter().flatten().map(|e| of(*e)).sum::<f64>() / 6.0;
    assert!((path.hours() - mean(&|e| 5.0 * e)).abs() < 1e-12);
    // The two steps of the first block, and what a skipped one had.
    path.begin(NOISE_SD * NOISE_SD, 5.0);
    path.skip();
    block(&mut path);
    let expected = mean(&|e| e * (5.0 * e + 2.0 * ELAPSED_H + 10.0));
    assert!((path.hours() - expected).abs() < 1e-12);
}
