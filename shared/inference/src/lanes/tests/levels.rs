//! All levels compute the same.

use super::super::{LaneFilter, Level, Observation, PlanarModel};
use super::processors;
use super::rover::{Rover, parameters};
use crate::bootstrap::ParticleFilter;
use crate::filter::Filter;
use crate::proposal::Proposal;
use crate::resample::Resampling;

/// Everything that a filter says, bit by bit.
fn bits(mut filter: LaneFilter, run: &[Observation]) -> Vec<u64> {
    let mut bits = Vec::new();
    for z in run {
        let step = filter.step(z);
        bits.push(step.log_evidence.to_bits());
        bits.push(step.effective_sample_size.to_bits());
        bits.extend(filter.posterior().iter().map(|p| p.to_bits()));
        bits.extend(filter.pose().map(f64::to_bits));
    }
    bits
}

/// A run with everything in it: missing channels, a jump, something absurd.
fn eventful() -> Vec<Observation> {
    let mut run = Rover(parameters()).drive(40, 8);
    run[10].pose[1] = f64::NAN;
    run[15].pose[0] += 0.3;
    run[20].pose = [1e5, 0.0, 0.0];
    run[25] = Observation::MISSING;
    run
}

#[test]
fn levels_with_fused_operations_agree_in_every_bit() {
    let model = PlanarModel::new(&parameters()).unwrap();
    for (share, count) in [(1.0, 1500), (0.4, 3000)] {
        let found = processors().into_iter().filter(|(_, is_fused)| *is_fused);
        let found = found.map(|(processor, _)| {
            let filter = LaneFilter::new(model.clone(), count, 6).resampling_below(share);
            bits(filter.on(processor), &eventful())
        });
        let found: Vec<_> = found.collect();
        for other in &found[1..] {
            assert!(found[0] == *other, "{share}");
        }
    }
}

#[test]
fn equal_seeds_give_equal_bits_and_others_do_not() {
    let model = PlanarModel::new(&parameters()).unwrap();
    let run = eventful();
    for level in Level::ALL.into_iter().filter(|level| level.is_available()) {
        let filter = |seed| {
            let filter = LaneFilter::new(model.clone(), 500, seed)
                .at_level(level)
                .unwrap();
            assert_eq!(filter.level(), level);
            filter
        };
        assert!(bits(filter(1), &run) == bits(filter(1), &run));
        assert!(bits(filter(1), &run) != bits(filter(2), &run));
    }
    assert!(Level::Plain.is_available() && Level::best().is_available());
}

#[test]
fn every_level_agrees_with_the_filter_in_double_precision() {
    let rover = Rover(parameters());
    let run = rover.drive(60, 21);
    let model = PlanarModel::new(&rover.0).unwrap();
    let count = 20_000;
    let mut reference = ParticleFilter::new(
        rover.clone(),
        Proposal::prior(&rover),
        Resampling::EVERY_STEP,
        count,
        5,
    );
    let mut expected = Vec::new();
    for z in &run {
        let step = reference.step(z);
        expected.push((step, reference.posterior().to_vec()));
    }
    for (processor, _) in processors() {
        for share in [1.0, 0.5] {
            let filter = LaneFilter::new(model.clone(), count, 9).resampling_below(share);
            let mut filter = filter.on(processor);
            let (mut l1, mut evidence, mut effective) = (0.0, 0.0, 0.0);
            for (z, (step, posterior)) in run.iter().zip(&expected) {
                let found = filter.step(z);
                assert_eq!(found.event, None);
                evidence += found.log_evidence - step.log_evidence;
                effective += found.effective_sample_size / step.effective_sample_size;
                let pairs = filter.posterior().iter().zip(posterior);
                l1 += pairs.map(|(a, b)| (a - b).abs()).sum::<f64>() / run.len() as f64;
            }
            assert!(l1 < 0.03, "{processor:?} {share}: {l1}");
            assert!(evidence.abs() < 0.6, "{processor:?} {share}: {evidence}");
            if share >= 1.0 {
                assert!(
                    (effective / run.len() as f64 - 1.0).abs() < 0.05,
                    "{effective}"
                );
            }
        }
    }
}
