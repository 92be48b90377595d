//! What goes wrong is told, and never spoils the belief.

use proptest::prelude::*;

use super::super::{Event, LaneFilter, ModelError, Observation, PlanarModel, PlanarParameters};
use super::rover::{Rover, parameters};

fn filter(particles: usize) -> LaneFilter {
    LaneFilter::new(PlanarModel::new(&parameters()).unwrap(), particles, 1)
}

fn assert_sound(filter: &LaneFilter) {
    let sum: f64 = filter.posterior().iter().sum();
    assert!((sum - 1.0).abs() < 1e-9, "{sum}");
    assert!(
        filter
            .posterior()
            .iter()
            .all(|p| (0.0..=1.0 + 1e-9).contains(p))
    );
    assert!(filter.pose().iter().all(|at| at.is_finite()));
}

#[test]
fn a_jump_is_weighed_again() {
    for share in [1.0, 0.5] {
        let mut filter = filter(1000).resampling_below(share);
        let mut run = Rover(parameters()).drive(6, 2);
        run[3].pose[0] += 0.4;
        let events: Vec<_> = run.iter().map(|z| filter.step(z)).collect();
        assert_eq!(events[2].event, None);
        assert_eq!(events[3].event, Some(Event::Redone));
        assert!(events[3].log_evidence < -100.0 && events[3].log_evidence.is_finite());
        assert_sound(&filter);
    }
}

#[test]
fn a_lost_track_is_taken_up_again() {
    for share in [1.0, 0.5] {
        let mut filter = filter(1000).resampling_below(share);
        let mut run = Rover(parameters()).drive(12, 2);
        for z in &mut run[2..] {
            z.pose[0] += 5e3;
        }
        let steps: Vec<_> = run.iter().map(|z| filter.step(z)).collect();
        let lost = Some(Event::Coasted);
        assert_eq!(steps[1].event, None);
        assert!(
            steps[2..6]
                .iter()
                .all(|s| s.event == lost && s.log_evidence == 0.0)
        );
        assert_eq!(steps[6].event, Some(Event::Restarted));
        assert_eq!(steps[7].event, None);
        assert!((filter.pose()[0] - 5e3).abs() < 2.0);
        assert_sound(&filter);
    }
}

#[test]
fn nothing_measured_is_nothing_learned() {
    for share in [1.0, 0.5] {
        let mut filter = filter(50_000).resampling_below(share);
        for _ in 0..10 {
            let step = filter.step(&Observation::MISSING);
            assert_eq!((step.event, step.log_evidence), (Some(Event::Coasted), 0.0));
            assert!((step.effective_sample_size / filter.count() as f64 - 1.0).abs() < 1e-5);
        }
        // Nominal before, and nominal after ten steps of the chain.
        let mut p = 1.0;
        for _ in 0..10 {
            p = 0.94 * p + 0.01 * (1.0 - p);
        }
        assert!((filter.posterior()[0] - p).abs() < 0.01, "{p}");
    }
}

#[test]
fn beginning_anew_gives_the_prior() {
    use crate::filter::Filter;
    let mut filter = filter(1000);
    for z in Rover(parameters()).drive(20, 3) {
        Filter::step(&mut filter, &z);
    }
    filter.reset();
    assert_eq!(Filter::posterior(&filter)[0], 1.0);
    assert_eq!(filter.pose(), [0.0; 3]);
}

fn refused(change: impl Fn(&mut PlanarParameters)) -> ModelError {
    let mut parameters = parameters();
    change(&mut parameters);
    PlanarModel::new(&parameters).unwrap_err()
}

#[test]
fn models_are_checked() {
    use ModelError::{Distribution, Length, Modes, Range, Wheels};
    assert_eq!(refused(|p| p.initial.clear()), Modes { found: 0 });
    assert_eq!(refused(|p| p.initial = vec![0.05; 20]), Modes { found: 20 });
    let table = "transition";
    let short = refused(|p| p.transition[3].truncate(12));
    assert_eq!(
        short,
        Length {
            table,
            found: 12,
            wanted: 13
        }
    );
    assert_eq!(
        refused(|p| p.transition[2][0] = 0.5),
        Distribution { table, row: 2 }
    );
    assert_eq!(
        refused(|p| p.transition[2][2] = f64::NAN),
        Distribution { table, row: 2 }
    );
    let table = "wheel_rates";
    assert_eq!(
        refused(|p| p.wheel_rates[5] = vec![1.0]),
        Length {
            table,
            found: 1,
            wanted: 6
        }
    );
    assert_eq!(
        refused(|p| p.wheel_rates[0] = vec![1.0; 9]),
        Wheels { found: 9 }
    );
    for bad in [f64::NAN, f64::INFINITY, -1.0, 1e308] {
        let is_range = |error| matches!(error, Range { .. });
        assert!(is_range(refused(|p| p.pose_sd[1] = bad)));
        assert!(is_range(refused(|p| p.motion_sd[2] = bad)));
        assert!(is_range(refused(|p| p.wheel_rate_sd = bad)));
        assert!(is_range(refused(|p| p.start_sd[0] = bad)));
        assert!(bad == -1.0 || is_range(refused(|p| p.motion[1][0] = bad)));
    }
    assert!(
        refused(|p| p.pose_sd[1] = 0.0)
            .to_string()
            .contains("pose_sd")
    );
}

fn number() -> impl Strategy<Value = f64> {
    let odd = [
        f64::NAN,
        f64::INFINITY,
        -1e308,
        5e-324,
        9.9e5,
        -1e5,
        3e3,
        0.0,
    ];
    prop_oneof![3 => -2.0..2.0, 1 => prop::sample::select(odd.to_vec()), 1 => any::<f64>()]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn the_belief_is_sound_whatever_is_observed(
        run in prop::collection::vec(
            (prop::array::uniform3(number()), prop::array::uniform8(number())), 1..20),
        particles in 1..200_usize,
        share in prop::sample::select(vec![0.0, 0.5, 1.0, f64::NAN]),
        motion_sd in prop::array::uniform3(prop::sample::select(vec![0.0, 1e-3, 5.0, 1e6])),
    ) {
        let mut parameters = parameters();
        parameters.motion_sd = motion_sd;
        let model = PlanarModel::new(&parameters).unwrap();
        for (processor, _) in super::processors() {
            let filter = LaneFilter::new(model.clone(), particles, 4).resampling_below(share);
            let mut filter = filter.on(processor);
            for &(pose, wheel_rates) in &run {
                let step = filter.step(&Observation { pose, wheel_rates });
                assert_sound(&filter);
                prop_assert!(step.log_evidence.is_finite());
                let size = step.effective_sample_size / filter.count() as f64;
                prop_assert!(size > 0.0 && size < 1.0 + 1e-4);
            }
        }
    }
}
