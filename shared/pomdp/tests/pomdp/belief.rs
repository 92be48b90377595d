//! The tracker against a plain dense reference, on every public file.

use vigil_pomdp::{Evidence, Pomdp, Tracker};

use crate::public;

/// Uniform numbers in [0, 1), enough for drawing trajectories.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn draw(&mut self, weights: impl Iterator<Item = (usize, f64)>) -> usize {
        let mut left = self.next();
        let mut last = 0;
        for (index, weight) in weights.filter(|(_, weight)| *weight > 0.0) {
            last = index;
            left -= weight;
            if left < 0.0 {
                break;
            }
        }
        last
    }
}

/// b'(s') = Z(a,s',z) sum_s T(s,a,s') b(s) / p, over every pair of states; and p.
fn dense(model: &Pomdp, belief: &[f64], action: usize, z: usize) -> (Vec<f64>, f64) {
    let mut next = vec![0.0; belief.len()];
    for (s, b) in belief.iter().enumerate() {
        let mut row = vec![0.0; belief.len()];
        for &(to, p) in model.successors(s, action) {
            row[to] = p;
        }
        for (next, p) in next.iter_mut().zip(&row) {
            *next += b * p;
        }
    }
    for (next, l) in next.iter_mut().zip(model.likelihood(action, z)) {
        *next *= l;
    }
    let sum: f64 = next.iter().sum();
    (next.iter().map(|b| b / sum).collect(), sum)
}

#[test]
fn updates_agree_with_a_dense_reference_on_every_public_file() {
    let Some(folder) = public::folder() else {
        return;
    };
    let mut files = 0;
    for (path, model) in public::all(&folder) {
        files += 1;
        let steps = if model.states().len() > 100 { 100 } else { 400 };
        let mut numbers = Numbers(files);
        for _ in 0..3 {
            let mut tracker = Tracker::new(&model);
            let mut belief = model.start().to_vec();
            let sum: f64 = belief.iter().sum();
            belief.iter_mut().for_each(|b| *b /= sum);
            let mut state = numbers.draw(model.start().iter().copied().enumerate());
            for step in 0..steps {
                let action = (numbers.next() * model.actions().len() as f64) as usize;
                state = numbers.draw(model.successors(state, action).iter().copied());
                let z = 0..model.observations().len();
                let z = numbers.draw(z.map(|z| (z, model.likelihood(action, z)[state])));
                let (reference, p) = dense(&model, &belief, action, z);
                belief = reference;
                let evidence = tracker.update(&model, action, z);
                let Evidence::Taken(got) = evidence else {
                    panic!("{}: step {step} was refused", path.display());
                };
                assert!((got - p).abs() <= 1e-12, "{}: {got}, {p}", path.display());
                for (got, wanted) in tracker.belief().iter().zip(&belief) {
                    let message = || format!("{}: step {step}: {got}, {wanted}", path.display());
                    assert!((got - wanted).abs() <= 1e-12, "{}", message());
                }
                let support = tracker.belief().iter().filter(|b| **b > 0.0).count();
                assert_eq!(support, tracker.support().len());
            }
        }
    }
    assert!(files >= 16, "{files} files");
}

#[test]
fn a_model_too_large_for_joint_tables_is_followed_all_the_same() {
    let text = "discount: 0.9 states: 1100 actions: 2 observations: 1000\nT: 0 identity\n\
        T: 1 uniform O: * uniform O: 0 : 3 : * 0 O: 0 : 3 : 5 1\n";
    let model = Pomdp::parse(text).unwrap();
    let mut tracker = Tracker::new(&model);
    let Evidence::Taken(p) = tracker.update(&model, 0, 5) else {
        panic!("refused");
    };
    let likely = 1.0 / (1.0 + 1099.0 / 1000.0);
    assert!((p - 1.0 / 1100.0 / likely).abs() < 1e-13);
    assert!((tracker.belief()[3] - likely).abs() < 1e-13);
    // State 3 shows nothing else.
    tracker.update(&model, 0, 6);
    assert_eq!((tracker.belief()[3], tracker.support().len()), (0.0, 1099));
    let Evidence::Taken(p) = tracker.update(&model, 1, 7) else {
        panic!("refused");
    };
    assert!((p - 1e-3).abs() < 1e-13 && (tracker.belief()[3] - 1.0 / 1100.0).abs() < 1e-13);
}

#[test]
fn an_impossible_observation_leaves_the_prediction_with_a_little_of_the_start() {
    let text = "discount: 0.9 states: a b c actions: go observations: x y\nstart: 0.5 0.5 0\n\
        T: go : a : b 1 T: go : b : c 1 T: go : c : c 1\n\
        O: go : a : x 1 O: go : b : x 1 O: go : c : x 1\n";
    let model = Pomdp::parse(text).unwrap();
    let mut tracker = Tracker::new(&model);
    assert_eq!(tracker.update(&model, 0, 1), Evidence::Impossible);
    let wanted = [0.005, 0.99 * 0.5 + 0.005, 0.99 * 0.5];
    for (got, wanted) in tracker.belief().iter().zip(wanted) {
        assert!((got - wanted).abs() < 1e-15, "{got}, {wanted}");
    }
    let before = tracker.belief().to_vec();
    // Soft evidence predicts nothing.
    assert_eq!(tracker.weigh(&[0.0, 0.0, f64::NAN]), Evidence::Impossible);
    assert!((tracker.belief()[2] - 0.99 * before[2]).abs() < 1e-15);
}

#[test]
fn rare_faults_survive_import_and_tracking() {
    let text = "discount: 0.9 states: fine broken actions: go observations: quiet alarm\n\
        start: fine\nT: go : fine 0.999999999999 1e-12 T: go : broken 0 1\n\
        O: go : fine 0.999999999999 1e-12 O: go : broken 1e-12 0.999999999999\n";
    let model = Pomdp::parse(text).unwrap();
    let again = Pomdp::parse(&model.to_cassandra()).unwrap();
    assert_eq!(again.successors(0, 0), [(0, 0.999_999_999_999), (1, 1e-12)]);
    let mut tracker = Tracker::new(&again);
    // A thousand quiet steps: 1e-24 is left, the fault that came in the last step.
    for _ in 0..1000 {
        tracker.update(&again, 0, 0);
    }
    assert!((tracker.belief()[1] / 1e-24 - 1.0).abs() < 1e-9);
    // The fault that came before the alarm, or with it.
    tracker.update(&again, 0, 1);
    assert!((tracker.belief()[1] - 0.5).abs() < 1e-9);
}
