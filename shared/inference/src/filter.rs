//! The interface of the filters over modes.

/// A recursive Bayes filter over modes.
pub trait Filter {
    /// What is observed in one step.
    type Observation: ?Sized;

    /// Predicts one step and conditions on the observation.
    fn step(&mut self, z: &Self::Observation) -> Step;

    /// Posterior probability of each mode after the last step: finite, and its sum is 1.
    fn posterior(&self) -> &[f64];

    /// Begins anew from the prior, with the generator's present state.
    fn reset(&mut self);
}

/// The result of one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Estimate of `ln p(z_t | z_1 .. z_{t-1})`; 0 for a step without a usable observation.
    pub log_evidence: f64,
    /// `1 / Σ W²` over the normalised weights of particles or hypotheses, before resampling.
    pub effective_sample_size: f64,
    /// What went wrong, if something did.
    pub event: Option<Event>,
}

/// What kept a step from using its observation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    /// No particle or hypothesis explains the observation, or it is not finite: the belief was
    /// predicted, not updated.
    Coasted,
    /// The filter has coasted for too many steps in a row: the continuous state was drawn anew
    /// around the observation, and the belief over modes is the prior's.
    Restarted,
}

/// Largest error of a sum of probabilities. Rounding over 1e6 terms stays below 1e-9; tables of
/// models are written with six or more decimals.
pub(crate) const SUM_TOLERANCE: f64 = 1e-6;

/// True for probabilities that are not negative and whose sum is 1.
pub(crate) fn is_distribution(p: &[f64]) -> bool {
    // Not a number fails both comparisons.
    p.iter().all(|p| *p >= 0.0) && (p.iter().sum::<f64>() - 1.0).abs() <= SUM_TOLERANCE
}

impl Step {
    /// This result, once it and the belief behind it are what [`Filter`] promises. `count`:
    /// particles or hypotheses that share the weight.
    pub(crate) fn checked(self, posterior: &[f64], count: usize) -> Self {
        assert!(is_distribution(posterior), "a posterior is a distribution");
        assert!(
            self.log_evidence.is_finite(),
            "the log-evidence of a step is finite"
        );
        let (least, most) = (1.0 - SUM_TOLERANCE, count as f64 * (1.0 + SUM_TOLERANCE));
        assert!(
            (least..=most).contains(&self.effective_sample_size),
            "an effective sample size lies between one and the number of particles"
        );
        self
    }
}

/// Writes `exp(log_p)`, normalised, into `p`. False, and `p` unchanged, if no term is finite.
pub(crate) fn normalise_into(log_p: &[f64], p: &mut [f64]) -> bool {
    let highest = log_p.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if !highest.is_finite() {
        return false;
    }
    let mut sum = 0.0;
    for (p, log_p) in p.iter_mut().zip(log_p) {
        let value = (log_p - highest).exp();
        // Not a number is impossible.
        *p = if value.is_nan() { 0.0 } else { value };
        sum += *p;
    }
    for p in p.iter_mut() {
        *p /= sum;
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOUND: Step = Step {
        log_evidence: -1.0,
        effective_sample_size: 1.5,
        event: None,
    };

    #[test]
    fn a_sound_step_passes_up_to_its_bounds() {
        let lowest = Step {
            effective_sample_size: 1.0,
            ..SOUND
        };
        let highest = Step {
            effective_sample_size: 2.0,
            ..SOUND
        };
        for step in [SOUND, lowest, highest] {
            assert_eq!(step.checked(&[0.25, 0.75], 2), step);
        }
    }

    #[test]
    #[should_panic(expected = "a posterior is a distribution")]
    fn a_posterior_that_does_not_sum_to_one_is_caught() {
        SOUND.checked(&[0.25, 0.7], 2);
    }

    #[test]
    #[should_panic(expected = "the log-evidence of a step is finite")]
    fn infinite_evidence_is_caught() {
        let log_evidence = f64::NEG_INFINITY;
        Step {
            log_evidence,
            ..SOUND
        }
        .checked(&[1.0], 2);
    }

    #[test]
    #[should_panic(expected = "an effective sample size lies between one and")]
    fn more_effective_than_all_particles_is_caught() {
        SOUND.checked(&[1.0], 1);
    }

    #[test]
    fn only_probabilities_that_sum_to_one_are_a_distribution() {
        assert!(is_distribution(&[0.0, 1.0]));
        assert!(is_distribution(&[0.5, 0.5 + 0.9e-6]));
        for bad in [[0.5, 0.5 + 1.1e-6], [-0.1, 1.1], [f64::NAN, 1.0], [0.2; 2]] {
            assert!(!is_distribution(&bad), "{bad:?}");
        }
        assert!(!is_distribution(&[]));
    }

    #[test]
    fn logarithms_are_normalised_and_what_is_no_number_is_impossible() {
        let mut p = [0.5; 3];
        assert!(normalise_into(
            &[-1000.0, f64::NAN, -1000.0 + 3.0_f64.ln()],
            &mut p
        ));
        for (p, expected) in p.iter().zip([0.25, 0.0, 0.75]) {
            assert!((p - expected).abs() < 1e-12, "{p}, not {expected}");
        }
        let before = p;
        assert!(!normalise_into(&[f64::NEG_INFINITY; 3], &mut p));
        assert!(!normalise_into(&[0.0, f64::INFINITY, 0.0], &mut p));
        assert_eq!(p, before);
    }
}
