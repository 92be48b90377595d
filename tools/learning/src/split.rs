//! Which runs to learn from and which to leave out.

use std::collections::BTreeMap;

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64Mcg;

use vigil_recording::labels::Label;

/// Ids of the runs to leave out: about `test_fraction` of every mode and kind, drawn with `seed`,
/// in rising order. The same labels and seed give the same ids.
#[must_use]
pub fn split(labels: &[Label], test_fraction: f64, seed: u64) -> Vec<u32> {
    let mut strata: BTreeMap<(&str, &str), Vec<u32>> = BTreeMap::new();
    for label in labels {
        strata
            .entry((&label.mode, &label.kind))
            .or_default()
            .push(label.run);
    }
    let mut generator = Pcg64Mcg::seed_from_u64(seed);
    let mut held_out = Vec::new();
    for runs in strata.values_mut() {
        runs.sort_unstable();
        runs.shuffle(&mut generator);
        let count = (runs.len() as f64 * test_fraction.clamp(0.0, 1.0)).round() as usize;
        held_out.extend_from_slice(&runs[..count]);
    }
    held_out.sort_unstable();
    held_out
}

/// Ids to leave out of runs without labels: about `test_fraction` of them, drawn with `seed`, in
/// rising order.
#[must_use]
pub fn split_runs(runs: &[u32], test_fraction: f64, seed: u64) -> Vec<u32> {
    let mut held_out = runs.to_vec();
    held_out.sort_unstable();
    held_out.shuffle(&mut Pcg64Mcg::seed_from_u64(seed));
    held_out.truncate((runs.len() as f64 * test_fraction.clamp(0.0, 1.0)).round() as usize);
    held_out.sort_unstable();
    held_out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels() -> Vec<Label> {
        (0..90)
            .map(|run| Label {
                run,
                mode: ["ND", "LF_STUCK", "LF_ENC"][run as usize % 3].into(),
                kind: String::new(),
                wheel: None,
                onset_s: None,
                command_curvature_1_m: 0.0,
                command_speed_m_s: 0.2,
                duration_s: 15.0,
                group: String::new(),
            })
            .collect()
    }

    #[test]
    fn a_third_of_every_mode_is_left_out_the_same_each_time() {
        let labels = labels();
        let held_out = split(&labels, 1.0 / 3.0, 7);
        assert_eq!(held_out, split(&labels, 1.0 / 3.0, 7));
        assert_ne!(held_out, split(&labels, 1.0 / 3.0, 8));
        for mode in 0..3 {
            assert_eq!(held_out.iter().filter(|run| *run % 3 == mode).count(), 10);
        }
    }
}
