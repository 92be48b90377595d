//! The joint law of all channels against its whole covariance.

use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use vigil_robot::channel_model::directions::{covariances, directions, parted};
use vigil_robot::channel_model::law::{BLOCKS, Change, Direction, Law, Row};

/// A law of three channels, and the covariance of its window: channel by channel, then by block.
fn law() -> (Law, DMatrix<f64>) {
    let mixing = DMatrix::from_row_slice(3, 3, &[1.0, 0.6, 0.2, 0.1, 0.9, -0.5, 0.3, 0.0, 0.7]);
    let kept = [0.9, 0.5, 0.1];
    let at = |lag: usize| {
        let power = DMatrix::from_fn(3, 3, |i, j| match i == j {
            true => f64::powi(kept[i], lag as i32),
            false => 0.0,
        });
        &mixing * power * mixing.transpose()
    };
    let by_lag: Vec<DMatrix<f64>> = (0..BLOCKS).map(at).collect();
    let directions = directions(&by_lag);
    let by_lag = covariances(&directions, &[0, 1, 2]);
    let dense = DMatrix::from_fn(3 * BLOCKS, 3 * BLOCKS, |a, b| {
        by_lag[(a % BLOCKS).abs_diff(b % BLOCKS)][(a / BLOCKS, b / BLOCKS)]
    });
    (Law::new(&directions, 3, 0).unwrap(), dense)
}

fn rows(values: &DVector<f64>) -> Vec<Row> {
    let row = |i: usize| std::array::from_fn(|block| values[i * BLOCKS + block]);
    (0..3).map(row).collect()
}

#[test]
fn the_law_says_what_its_whole_covariance_says() {
    let (mut law, covariance) = law();
    let precision = covariance.clone().cholesky().unwrap().inverse();
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    let mut draw = || DVector::from_fn(3 * BLOCKS, |_, _| rng.sample::<f64, _>(StandardNormal));
    for _ in 0..20 {
        let (z, s) = (draw(), draw());
        law.take(&rows(&z).iter().map(|row| row.map(Some)).collect::<Vec<_>>());
        near(law.square(), z.dot(&(&precision * &z)));
        // The first blocks alone have the square of their own law.
        for first in 0..=BLOCKS {
            let there: Vec<usize> = (0..3 * BLOCKS).filter(|i| i % BLOCKS < first).collect();
            let of_there = DMatrix::from_fn(there.len(), there.len(), |i, j| {
                covariance[(there[i], there[j])]
            });
            let z_there = DVector::from_fn(there.len(), |i, _| z[there[i]]);
            let square = z_there.dot(&(of_there.cholesky().unwrap().inverse() * &z_there));
            near(law.parts()[..first].iter().sum(), square);
        }
        let signature = law.signature(&rows(&s));
        let changes = law.joint_change(&signature, None);
        for (first, Change { b, a }) in changes.into_iter().enumerate() {
            let s = from(&s, first);
            near(b, s.dot(&(&precision * &z)));
            near(a, s.dot(&(&precision * &s)));
        }
        let weighed = law.weighed(&rows(&s));
        let product: f64 = rows(&z).iter().zip(&weighed).map(|(a, b)| dot(a, b)).sum();
        near(product, s.dot(&(&precision * &z)));
        // Without the first channel: under the law of the others alone.
        let without = DVector::from_fn(s.len(), |i, _| if i < BLOCKS { 0.0 } else { s[i] });
        let changes = law.joint_change(&signature, Some(0));
        for (first, Change { b, a }) in changes.into_iter().enumerate() {
            let s = from(&without, first);
            near(b, s.dot(&(&precision * &z)));
            near(a, s.dot(&(&precision * &s)));
        }
        let mut changes = law.joint_change(&signature, None);
        law.silence(&mut changes, &signature, 0);
        let others = 2 * BLOCKS;
        let of_others = covariance
            .view((BLOCKS, BLOCKS), (others, others))
            .into_owned();
        let of_others = of_others.cholesky().unwrap().inverse();
        let z_others = z.rows(BLOCKS, others);
        for (first, Change { b, a }) in changes.into_iter().enumerate() {
            let s = from(&s, first);
            let s_others = s.rows(BLOCKS, others);
            near(b, s_others.dot(&(&of_others * z_others)));
            near(a, s_others.dot(&(&of_others * s_others)));
        }
        let s_others = s.rows(BLOCKS, others);
        let of_z = law.weighed(&rows(&z));
        let hidden = law.hidden(0, 0, [&weighed[0], &of_z[0]]);
        near(product - hidden, s_others.dot(&(&of_others * z_others)));
        // Completed so that they say nothing of the first.
        let mut silent = rows(&s);
        let added = law.completion(0, 0, &weighed[0]);
        silent[0].iter_mut().zip(added).for_each(|(a, b)| *a += b);
        law.weighed(&silent)[0]
            .into_iter()
            .for_each(|value| near(value, 0.0));
    }
}

#[test]
fn the_law_says_of_a_channel_what_its_whole_covariance_says() {
    let (mut law, covariance) = law();
    let precision = covariance.clone().cholesky().unwrap().inverse();
    let mut rng = Pcg64Mcg::seed_from_u64(4);
    let mut draw = || DVector::from_fn(3 * BLOCKS, |_, _| rng.sample::<f64, _>(StandardNormal));
    for _ in 0..20 {
        let (z, s) = (draw(), draw());
        law.take(&rows(&z).iter().map(|row| row.map(Some)).collect::<Vec<_>>());
        for channel in 0..3 {
            let [own, other] = [&s, &z].map(|values| law.own_row(channel, &rows(values)[channel]));
            let changes = law.change(channel, &own);
            for (first, Change { b, a }) in changes.into_iter().enumerate() {
                let (from, to) = (channel * BLOCKS + first, (channel + 1) * BLOCKS);
                let alone = DVector::from_fn(3 * BLOCKS, |i, _| match (from..to).contains(&i) {
                    true => s[i],
                    false => 0.0,
                });
                near(b, alone.dot(&(&precision * &z)));
                near(a, alone.dot(&(&precision * &alone)));
                near(own.square()[first], a);
                let of_z = DVector::from_fn(3 * BLOCKS, |i, _| match (from..to).contains(&i) {
                    true => z[i],
                    false => 0.0,
                });
                let product = own.product(&other)[first];
                near(product, alone.dot(&(&precision * &of_z)));
                // Without these readings: the square of the others under their own law.
                let rest: Vec<usize> = (0..3 * BLOCKS)
                    .filter(|i| !(from..to).contains(i))
                    .collect();
                let of_rest = DMatrix::from_fn(rest.len(), rest.len(), |i, j| {
                    covariance[(rest[i], rest[j])]
                });
                let z_rest = DVector::from_fn(rest.len(), |i, _| z[rest[i]]);
                let without = z_rest.dot(&(of_rest.cholesky().unwrap().inverse() * &z_rest));
                near(law.square() - law.silenced(channel)[first], without);
            }
        }
    }
}

fn near(a: f64, b: f64) {
    assert!((a - b).abs() < 1e-8 * (1.0 + b.abs()), "{a} {b}");
}

fn dot(a: &Row, b: &Row) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// A signature that begins with a block.
fn from(values: &DVector<f64>, first: usize) -> DVector<f64> {
    let begins = |i: usize| i % BLOCKS >= first;
    DVector::from_fn(values.len(), |i, _| if begins(i) { values[i] } else { 0.0 })
}

#[test]
fn a_window_that_has_just_begun_is_judged_by_the_law_of_what_is_there() {
    let (_, covariance) = law();
    let (whole, _) = law();
    let first = 5;
    let mut short = Law::new(whole.directions(), 3, first).unwrap();
    let there: Vec<usize> = (0..3 * BLOCKS).filter(|i| i % BLOCKS >= first).collect();
    let of_there = DMatrix::from_fn(there.len(), there.len(), |i, j| {
        covariance[(there[i], there[j])]
    });
    let precision = of_there.cholesky().unwrap().inverse();
    let value = |i: usize| (i as f64 * 0.7).sin();
    let z = DVector::from_fn(there.len(), |i, _| value(there[i]));
    let mut window = vec![[None; BLOCKS]; 3];
    for &i in &there {
        window[i / BLOCKS][i % BLOCKS] = Some(value(i));
    }
    short.take(&window);
    assert!((short.square() - z.dot(&(&precision * &z))).abs() < 1e-9);
    let Change { b, a } = short.change(1, &short.own_row(1, &[1.0; BLOCKS]))[0];
    let shift = DVector::from_fn(there.len(), |i, _| {
        f64::from(u8::from(there[i] / BLOCKS == 1))
    });
    assert!((b - shift.dot(&(&precision * &z))).abs() < 1e-9);
    assert!((a - shift.dot(&(&precision * &shift))).abs() < 1e-9);
}

#[test]
fn what_no_fault_explains_is_weighed_by_the_density_of_wider_laws() {
    let (law, _) = law();
    let n = (3 * BLOCKS) as f64;
    // Of a Student law with 30 degrees of freedom, but for what does not depend on the window.
    let log_density = |square: f64, factor: f64| {
        -0.5 * (30.0 + n) * (1.0 + square / (30.0 * factor * factor)).ln() - n * factor.ln()
    };
    for square in [0.0, n, 10.0 * n, 1e3 * n, 1e5 * n] {
        let mut mean = 0.0;
        for factor in [2.0, 4.0, 8.0, 16.0, 32.0] {
            let ratio = log_density(square, factor) - log_density(square, 1.0);
            assert!((law.log_ratio_larger(square, factor) - ratio).abs() < 1e-9);
            mean += ratio.exp() / 5.0;
        }
        // Where nothing is known of its blocks: only from the start.
        let throughout = law.log_ratio_unknown(square, &[]);
        assert!((throughout - (mean / 4.0).ln()).abs() < 1e-9);
        // From each of the onsets on, of which the last blocks hold all but one a block.
        let before = [1.0; 7];
        let mut all = 0.0;
        for first in [0, 4, 6, 7] {
            let later = 3.0 * (BLOCKS - first) as f64;
            for factor in [2.0, 4.0, 8.0, 16.0, 32.0] {
                let rest = square - first as f64;
                let scaled = first as f64 + rest / (factor * factor);
                let densities = [scaled, square].map(|square| log_density(square, 1.0));
                let ratio = densities[0] - densities[1] - later * f64::ln(factor);
                all += ratio.exp() / 20.0;
            }
        }
        if square >= n {
            assert!((law.log_ratio_unknown(square, &before) - all.ln()).abs() < 1e-9);
        }
    }
}

#[test]
fn likelihoods_of_several_changes_are_those_of_each() {
    let (mut law, _) = law();
    for size in [0.1, 4.0, 1e3] {
        law.take(&[[Some(size); BLOCKS], [Some(-size); BLOCKS], [None; BLOCKS]]);
        let square = law.square();
        let less = [-1e3, -square, 0.0, 0.3 * square, 0.98 * square, square];
        let density = [1.0, 0.3, 1e-4, 1.0, 1e-9, 0.01];
        let found = law.likelihoods(less, density);
        let each: Vec<f64> = less
            .iter()
            .zip(density)
            .map(|(less, density)| law.log_ratio(*less, -f64::ln(density)))
            .collect();
        let highest = each.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let sum: f64 = each.iter().map(|one| (one - highest).exp()).sum();
        let mean = highest + (sum / 6.0).ln();
        assert!((found.log_mean() - mean).abs() < 1e-9 * (1.0 + mean.abs()));
        assert_eq!(each[found.likeliest()], highest);
    }
    // What is no number says nothing.
    let found = law.likelihoods([f64::NAN, 1.0], [1.0; 2]);
    assert!((found.log_mean() - (law.log_ratio(1.0, 0.0) - f64::ln(2.0))).abs() < 1e-9);
    assert_eq!(
        law.likelihoods([f64::NAN], [1.0]).log_mean(),
        f64::NEG_INFINITY
    );
}

#[test]
fn what_a_change_leaves_follows_from_how_much_more_likely_it_makes_the_window() {
    let (mut law, _) = law();
    law.take(&[
        [Some(4.0); BLOCKS],
        [Some(-3.0); BLOCKS],
        [Some(0.5); BLOCKS],
    ]);
    for share in [0.0, 0.3, 0.99, 1.0] {
        let less = share * law.square();
        let left = law.left(law.log_ratio(less, 0.0));
        assert!((left - (law.square() - less)).abs() < 1e-9 * law.square());
    }
    // What speaks against it leaves all.
    assert_eq!(law.left(-5.0), law.square());
}

#[test]
fn what_was_not_measured_takes_the_mean_that_its_block_gives() {
    let (mut law, covariance) = law();
    let now = DMatrix::from_fn(3, 3, |i, j| covariance[(i * BLOCKS, j * BLOCKS)]);
    let mut window = vec![[Some(0.0); BLOCKS]; 3];
    window[0][5] = Some(1.0);
    window[1][5] = None;
    window[2][5] = Some(-2.0);
    law.take(&window);
    let others =
        DMatrix::from_row_slice(2, 2, &[now[(0, 0)], now[(0, 2)], now[(2, 0)], now[(2, 2)]]);
    let weights = others
        .cholesky()
        .unwrap()
        .solve(&DVector::from_vec(vec![1.0, -2.0]));
    let mean = now[(1, 0)] * weights[0] + now[(1, 2)] * weights[1];
    assert!(
        (law.row(1)[5] - mean).abs() < 1e-9,
        "{} {mean}",
        law.row(1)[5]
    );
    // A block that nothing was measured in says nothing.
    law.take(&[[None; BLOCKS]; 3]);
    assert_eq!(law.square(), 0.0);
}

#[test]
fn a_covariance_that_is_none_of_a_process_is_made_one() {
    let impossible = vec![DMatrix::from_element(1, 1, 2.0); BLOCKS];
    let found = directions(&impossible);
    assert!(found[0].correlation.iter().all(|&value| value < 0.9));
    assert!(Law::new(&found, 1, 0).is_some());
    let direction = Direction {
        vector: vec![1.0],
        variance: 1.0,
        correlation: [1.0; BLOCKS - 1],
    };
    assert!(Law::new(&[direction], 1, 0).is_none());
}

#[test]
fn channels_that_have_nothing_to_do_with_the_others_leave_them_their_own_law() {
    let (law, _) = law();
    let whole = covariances(law.directions(), &[0, 1, 2]);
    let apart = directions(&parted(&whole, |channel| channel == 0));
    let mut without = Law::new(&apart, 3, 0).unwrap();
    let of_others = directions(&covariances(law.directions(), &[1, 2]));
    let mut others = Law::new(&of_others, 2, 0).unwrap();
    let rows = [[1.0; BLOCKS], [-2.0; BLOCKS], [0.5; BLOCKS]].map(|row| row.map(Some));
    without.take(&[[None; BLOCKS], rows[1], rows[2]]);
    others.take(&rows[1..]);
    assert!((without.square() - others.square()).abs() < 1e-9);
    let change = without.change(2, &without.own_row(2, &[1.0; BLOCKS]))[3];
    let expected = others.change(1, &others.own_row(1, &[1.0; BLOCKS]))[3];
    assert!((change.a - expected.a).abs() < 1e-9 && (change.b - expected.b).abs() < 1e-9);
}
