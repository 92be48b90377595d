//! From the stamps of four stages to the latency of every cycle.

use std::collections::BTreeMap;

use vigil_cycle::{CycleStamps, Latency};

use crate::chain::STAGES;

/// One instant of the schedule.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cycle {
    /// When it was due, ns.
    pub t_schedule_ns: u64,
    /// When the last stage had published an answer, ns: to this instant or, if nothing answered
    /// it, to the next that was.
    pub t_done_ns: u64,
    /// How long stages computed for that answer, ns.
    pub answer_compute_ns: u64,
    /// Time of each stage from its wake-up to its publication, and before it from the publication
    /// of its input to its wake-up, ns; `None` if a stage did not answer this very instant.
    pub stages: Option<[Stage; STAGES]>,
}

/// What one stage did in a cycle, ns.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Stage {
    /// From the publication of the input (the schedule, for the source) to the wake-up.
    pub hand_over_ns: u64,
    /// From the wake-up to the publication.
    pub compute_ns: u64,
}

impl Cycle {
    /// From the schedule to the end, ns.
    #[must_use]
    pub const fn end_to_end_ns(&self) -> u64 {
        self.t_done_ns.saturating_sub(self.t_schedule_ns)
    }

    /// The part of it in which no stage computed for its answer, ns: also for an instant that only
    /// a later one's answer ended.
    #[must_use]
    pub const fn hand_over_ns(&self) -> u64 {
        self.end_to_end_ns().saturating_sub(self.answer_compute_ns)
    }

    /// True if only a later instant's answer ended it.
    #[must_use]
    pub const fn is_folded(&self) -> bool {
        self.stages.is_none()
    }
}

/// Every instant that one stage answered, by itself or with a later one: how long until then.
#[must_use]
pub fn of_stage(stamps: &[CycleStamps], period_ns: u64) -> Vec<Cycle> {
    joined([&[], &[], &[], stamps], period_ns, 0)
}

/// Every instant of the schedule from `from_ns` on that the stamps cover, in order: from the first
/// to the last that the last stage answered. Nothing is left out: an instant without a frame has
/// the latency until the next answer.
#[must_use]
pub fn join(stamps: &[Vec<CycleStamps>; STAGES], period_ns: u64, from_ns: u64) -> Vec<Cycle> {
    joined(
        std::array::from_fn(|i| stamps[i].as_slice()),
        period_ns,
        from_ns,
    )
}

fn joined(stamps: [&[CycleStamps]; STAGES], period_ns: u64, from_ns: u64) -> Vec<Cycle> {
    let by_instant = |stamps: &[CycleStamps]| -> BTreeMap<u64, CycleStamps> {
        stamps.iter().map(|s| (s.t_schedule_ns, *s)).collect()
    };
    let maps: [BTreeMap<u64, CycleStamps>; STAGES] =
        std::array::from_fn(|stage| by_instant(stamps[stage]));
    let done = &maps[STAGES - 1];
    let (Some((first_ns, _)), Some((last_ns, _))) =
        (done.range(from_ns..).next(), done.last_key_value())
    else {
        return Vec::new();
    };
    let count = last_ns.saturating_sub(*first_ns) / period_ns + 1;
    let cycle = |k: u64| {
        let t_schedule_ns = first_ns + k * period_ns;
        // The first answer that is no older than the instant.
        let (answered_ns, answer) = done.range(t_schedule_ns..).next()?;
        let parts = |at_ns: u64| {
            let of = |map: &BTreeMap<u64, CycleStamps>| map.get(&at_ns).copied().map(stage);
            [of(&maps[0]), of(&maps[1]), of(&maps[2]), of(&maps[3])]
        };
        let answer_parts = parts(*answered_ns);
        let complete = answer_parts.iter().all(Option::is_some) && *answered_ns == t_schedule_ns;
        Some(Cycle {
            t_schedule_ns,
            t_done_ns: answer.t_publish_ns,
            answer_compute_ns: answer_parts.iter().flatten().map(|s| s.compute_ns).sum(),
            stages: complete.then(|| answer_parts.map(Option::unwrap_or_default)),
        })
    };
    (0..count).filter_map(cycle).collect()
}

const fn stage(stamps: CycleStamps) -> Stage {
    Stage {
        hand_over_ns: stamps.t_wake_ns.saturating_sub(stamps.t_input_ns),
        compute_ns: stamps.t_publish_ns.saturating_sub(stamps.t_wake_ns),
    }
}

/// Histograms over cycles.
#[derive(Debug, Clone)]
pub struct Spectra {
    /// From the schedule to the action, every instant.
    pub end_to_end: Latency,
    /// The part in which stages computed for an answer, one for each answer.
    pub compute: Latency,
    /// The rest, every instant.
    pub hand_over: Latency,
    /// Both parts of each stage, of instants that have an answer of their own.
    pub stages: [(Latency, Latency); STAGES],
}

impl Spectra {
    /// Over these cycles.
    ///
    /// # Errors
    /// None in practice; see [`Latency::new`].
    pub fn new(cycles: &[Cycle]) -> Result<Self, Box<dyn std::error::Error>> {
        let pair = || Ok::<_, Box<dyn std::error::Error>>((Latency::new()?, Latency::new()?));
        let mut spectra = Self {
            end_to_end: Latency::new()?,
            compute: Latency::new()?,
            hand_over: Latency::new()?,
            stages: [pair()?, pair()?, pair()?, pair()?],
        };
        for cycle in cycles {
            spectra.end_to_end.record(cycle.end_to_end_ns());
            spectra.hand_over.record(cycle.hand_over_ns());
            let Some(stages) = cycle.stages else {
                continue;
            };
            spectra.compute.record(cycle.answer_compute_ns);
            for (histograms, stage) in spectra.stages.iter_mut().zip(stages) {
                histograms.0.record(stage.hand_over_ns);
                histograms.1.record(stage.compute_ns);
            }
        }
        Ok(spectra)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const P: u64 = 1000;

    /// Four stages that answer instant `k` with these hand-over and compute times.
    fn answered(stamps: &mut [Vec<CycleStamps>; STAGES], k: u64, times: [(u64, u64); STAGES]) {
        let mut at_ns = k * P;
        for (stage, (hand_over, compute)) in times.into_iter().enumerate() {
            let t_wake_ns = at_ns + hand_over;
            stamps[stage].push(CycleStamps {
                t_schedule_ns: k * P,
                t_input_ns: at_ns,
                t_wake_ns,
                t_publish_ns: t_wake_ns + compute,
            });
            at_ns = t_wake_ns + compute;
        }
    }

    #[test]
    fn parts_add_up_and_a_stall_shows_in_every_instant_it_delayed() {
        let mut stamps: [Vec<CycleStamps>; STAGES] = Default::default();
        let usual = [(5, 1), (6, 20), (7, 30), (8, 2)];
        answered(&mut stamps, 1, usual);
        answered(&mut stamps, 2, usual);
        // The source sleeps through 3, 4 and 5 and comes 200 ns late for 6.
        answered(&mut stamps, 6, [(200, 1), (6, 20), (7, 30), (8, 2)]);
        answered(&mut stamps, 7, usual);
        let cycles = join(&stamps, P, 2 * P);
        let end_to_end: Vec<u64> = cycles.iter().map(Cycle::end_to_end_ns).collect();
        assert_eq!(end_to_end, [79, 3274, 2274, 1274, 274, 79]);
        let hand_over: Vec<u64> = cycles.iter().map(Cycle::hand_over_ns).collect();
        assert_eq!(hand_over, [26, 3221, 2221, 1221, 221, 26]);
        assert!(cycles.iter().all(|c| c.answer_compute_ns == 53));
        let folded = cycles.iter().map(Cycle::is_folded).collect::<Vec<_>>();
        assert_eq!(folded, [false, true, true, true, false, false]);
        for stages in cycles.iter().filter_map(|c| c.stages) {
            assert_eq!(stages.iter().map(|s| s.compute_ns).sum::<u64>(), 53);
        }
        let spectra = Spectra::new(&cycles).ok();
        let counts = spectra.map(|s| (s.end_to_end.percentiles().n, s.compute.percentiles().n));
        assert_eq!(counts, Some((6, 3)));
    }

    #[test]
    fn a_frame_that_was_folded_into_the_next_has_its_latency_and_waits_for_all_but_one_answer() {
        let mut stamps: [Vec<CycleStamps>; STAGES] = Default::default();
        let usual = [(5, 1), (6, 20), (7, 30), (8, 2)];
        for k in 1..=4 {
            answered(&mut stamps, k, usual);
        }
        // The identifier took 2 and 3 together.
        stamps[2].remove(1);
        stamps[3].remove(1);
        let cycles = join(&stamps, P, 0);
        let found: Vec<_> = cycles
            .iter()
            .map(|c| (c.end_to_end_ns(), c.hand_over_ns()))
            .collect();
        assert_eq!(found, [(79, 26), (1079, 1026), (79, 26), (79, 26)]);
        assert!(join(&Default::default(), P, 0).is_empty());
    }
}
