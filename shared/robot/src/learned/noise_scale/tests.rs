use super::*;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;

#[test]
fn the_ratio_follows_the_noise_and_ignores_jumps() {
    for ratio in [0.25, 0.5, 1.0, 2.0, 4.0, 16.0] {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(3);
        let mut scale = NoiseScale::default();
        for i in 0..3000 {
            let x: f64 = rng.sample(StandardNormal);
            let square = match i % 100 == 0 {
                true => f64::INFINITY,
                false => x * x * ratio,
            };
            scale.push(square, 1);
        }
        let found = scale.variance_ratio();
        assert!(
            found > 0.95 * ratio && found < 1.3 * ratio,
            "{ratio}: {found}"
        );
    }
}

#[test]
fn noise_that_is_hardly_known_is_seldom_believed_to_be_smaller_than_it_is() {
    const SEEDS: usize = 400;
    for ratio in [0.5, 4.0, 9.0] {
        for samples in [25, 50, 200] {
            let is_small = |seed: &usize| {
                let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(*seed as u64);
                let mut scale = NoiseScale::default();
                let noise: Vec<f64> = (0..samples + 2)
                    .map(|_| rng.sample(StandardNormal))
                    .collect();
                for w in noise.windows(3) {
                    let bend = w[0] - 2.0 * w[1] + w[2];
                    scale.push(ratio * bend * bend / 6.0, 2);
                }
                scale.variance_ratio() < ratio
            };
            let share = (0..SEEDS).filter(is_small).count() as f64 / SEEDS as f64;
            assert!(share < 0.12, "{samples} of {ratio}: {share}");
        }
    }
}

/// A healthy channel, then samples with a ratio, of which so many are suspected in turn.
fn suspected(ratio: f64, samples: u32, is_suspected: impl Fn(u32) -> bool) -> NoiseScale {
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(5);
    let mut scale = NoiseScale::default();
    let mut step = || {
        let x: f64 = rng.sample(StandardNormal);
        x * x
    };
    (0..600).for_each(|_| scale.push(step(), 1));
    for at in 0..samples {
        scale.suspect(is_suspected(at));
        scale.push(step() * ratio, 1);
    }
    scale.suspect(false);
    scale
}

#[test]
fn noise_of_a_fault_does_not_hide_its_return() {
    for ratio in [30.0, 36.0, 64.0, 100.0, 400.0] {
        for samples in [20, 100, 299, 301, 350, 500, 700, 3000] {
            let after = suspected(ratio, samples, |_| true);
            let (found, rate) = (after.variance_ratio(), after.outlier_rate());
            assert!(
                found < 1.3 && rate < 0.01,
                "{ratio} {samples}: {found} {rate}"
            );
        }
    }
}

#[test]
fn a_noisy_sensor_is_believed_once_it_has_settled_whether_its_suspicion_flickers_or_not() {
    let steady = suspected(9.0, 290, |_| true).variance_ratio();
    assert!(steady < 1.3, "{steady}");
    for (samples, period) in [(320, 1), (1000, 6), (3000, 2)] {
        // One of so many in a row is not suspected.
        let found = suspected(9.0, samples, |at| period == 1 || at / 20 % period > 0);
        let found = found.variance_ratio();
        assert!((7.0..12.0).contains(&found), "{samples} {period}: {found}");
    }
}

#[test]
fn outliers_that_are_suspected_one_by_one_are_counted() {
    let mut scale = NoiseScale::default();
    for at in 0..600 {
        // Suspected from the impulse on, for a second.
        scale.suspect(at % 60 < 20);
        let is_hit = at % 60 < 2;
        scale.push(if is_hit { 400.0 } else { 1.0 }, 1);
    }
    let rate = scale.outlier_rate();
    assert!((0.01..0.03).contains(&rate), "{rate}");
}

#[test]
fn one_channel_with_outliers_may_be_broken_and_two_warn_the_others() {
    let expected = EXPECTED / (2.0 * ASKED);
    let mut all = [NoiseScale::default(); 3];
    assert_eq!(outlier_rates(&all), [expected; 3]);
    for square in [1.0, 400.0, 400.0, 1.0] {
        all[0].push(square, 1);
    }
    let [own, other, _] = outlier_rates(&all);
    assert!(own > 0.01 && other < 2.0 * expected, "{own} {other}");
    all[1] = all[0];
    assert!(outlier_rates(&all)[2] > 0.01);
}

#[test]
fn an_impulse_is_an_outlier_and_a_step_is_none_in_differences_of_either_order() {
    // Squares of the differences that an impulse and a step leave.
    for (order, impulse, step) in [
        (1, [400.0, 400.0, 0.0], [400.0, 0.0, 0.0]),
        (2, [400.0, 1600.0, 400.0], [400.0, 400.0, 0.0]),
    ] {
        let rate = |seen: [f64; 3]| {
            let mut scale = NoiseScale::default();
            for square in [1.0; 50].into_iter().chain(seen).chain([1.0; 50]) {
                scale.push(square, order);
            }
            scale.outlier_rate()
        };
        assert!((0.005..0.02).contains(&rate(impulse)), "{order}");
        assert_eq!(rate(step), OUTLIER_RATE_MIN, "{order}");
    }
}
