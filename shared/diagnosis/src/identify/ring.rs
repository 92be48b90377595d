//! The last observations of a run, from which an identification starts.

use std::collections::VecDeque;

use vigil_checkpoint::{Checkpoint, CheckpointValue};
use vigil_robot::learned::{Healthy, NoiseScales, Observation};

use crate::invariants::{self, RingPlace};

/// A ring is worked off in about this time after an alarm, s. Chosen by hand: the name is two
/// observations late; smaller makes the first cycles after an alarm the longest ones.
const CATCH_UP_S: f64 = 0.1;

/// An observation kept for an identification, and what the detector believed after it.
#[derive(Debug, Clone, Copy, CheckpointValue)]
pub(crate) struct RingEntry {
    /// The run that it belongs to.
    pub run_id: u64,
    /// The observation.
    pub observation: Observation,
    /// How noisy the sensors were.
    pub noise: NoiseScales,
    /// What the detector believed of the robot as a healthy one, if it said so.
    pub healthy: Option<Healthy>,
}

impl RingEntry {
    const fn place(&self) -> RingPlace {
        RingPlace {
            run_id: self.run_id,
            t_ns: self.observation.t_ns,
            anchor: self.observation.anchor,
        }
    }
}

/// The ring: full, it gives up its oldest entry for a new one. Allocates once.
#[derive(Debug, Clone, Checkpoint)]
pub(crate) struct Ring {
    entries: VecDeque<RingEntry>,
    capacity: usize,
    /// Time of an entry, s.
    interval_s: f64,
    /// Newest time of the run so far, ns: a clock that is set back leaves onsets behind it.
    newest_ns: u64,
    /// The run has had a pose.
    has_pose: bool,
}

impl Ring {
    /// An empty ring of so many entries, each of `interval_s` of motion.
    pub(crate) fn new(capacity: usize, interval_s: f64) -> Self {
        Self {
            entries: VecDeque::with_capacity(capacity),
            capacity,
            interval_s,
            newest_ns: 0,
            has_pose: false,
        }
    }

    /// Entries to work off in a cycle of `frame_s`: one, or while behind more than arrive.
    pub(crate) fn catch_up(&self, frame_s: f64, is_behind: bool) -> usize {
        if !is_behind {
            return 1;
        }
        let arriving = frame_s / self.interval_s;
        let wanted = (self.capacity as f64 * frame_s / CATCH_UP_S).ceil() as usize;
        wanted.max(arriving as usize + 1).min(self.capacity)
    }

    /// Entries that it holds.
    pub(crate) fn len(&self) -> usize {
        self.entries.len()
    }

    /// Newest time of the run, ns.
    pub(crate) const fn newest_ns(&self) -> u64 {
        self.newest_ns
    }

    /// True once an entry of the run had a pose.
    pub(crate) const fn has_pose(&self) -> bool {
        self.has_pose
    }

    /// A new run begins.
    pub(crate) fn clear(&mut self) {
        self.entries.clear();
        (self.newest_ns, self.has_pose) = (0, false);
    }

    /// Adds an entry; true if the oldest gave way.
    pub(crate) fn push(&mut self, entry: RingEntry) -> bool {
        if let Some(last) = self.entries.back() {
            invariants::ring_order(last.place(), entry.place());
        }
        let is_full = self.entries.len() == self.capacity;
        if is_full {
            self.entries.pop_front();
        }
        self.newest_ns = self.newest_ns.max(entry.observation.t_ns);
        self.has_pose |= entry.observation.pose_frames > 0;
        self.entries.push_back(entry);
        invariants::within_capacity(self.entries.len(), self.capacity);
        is_full
    }

    /// The entry at a place, the oldest first.
    pub(crate) fn get(&self, place: usize) -> Option<&RingEntry> {
        self.entries.get(place)
    }

    /// Place of the oldest entry whose pose is known; of the oldest if none is.
    pub(crate) fn start(&self) -> usize {
        let is_known =
            |entry: &RingEntry| entry.healthy.is_some() || entry.observation.pose_frames > 0;
        self.entries.iter().position(is_known).unwrap_or(0)
    }

    /// Place of the last entry of `earliest..end` up to which all ended by `t_ns`; `earliest` if
    /// none did.
    pub(crate) fn last_by(&self, t_ns: u64, earliest: usize, end: usize) -> usize {
        let entries = self.entries.range(earliest..end);
        let by = entries.take_while(|entry| entry.observation.t_ns <= t_ns);
        earliest + by.count().saturating_sub(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ends at `t_ns`, with a pose or without.
    fn entry(t_ns: u64, pose_frames: u32) -> RingEntry {
        RingEntry {
            run_id: 1,
            observation: Observation {
                t_ns,
                pose_frames,
                ..Observation::default()
            },
            noise: NoiseScales::default(),
            healthy: None,
        }
    }

    fn times(ring: &Ring) -> Vec<u64> {
        let places = (0..ring.len()).filter_map(|place| ring.get(place));
        places.map(|entry| entry.observation.t_ns).collect()
    }

    #[test]
    fn the_oldest_gives_way_and_the_newest_time_stays() {
        let mut ring = Ring::new(3, 0.05);
        let full: Vec<bool> = (1..=5).map(|t_ns| ring.push(entry(t_ns, 0))).collect();
        assert_eq!(full, [false, false, false, true, true]);
        assert_eq!((times(&ring), ring.newest_ns()), (vec![3, 4, 5], 5));
        let mut back = entry(2, 1);
        back.observation.anchor = true;
        ring.push(back);
        assert_eq!((times(&ring), ring.newest_ns()), (vec![4, 5, 2], 5));
        ring.clear();
        assert_eq!((ring.len(), ring.newest_ns()), (0, 0));
    }

    #[test]
    fn what_waits_is_worked_off_within_a_tenth_of_a_second() {
        let ring = Ring::new(40, 0.05);
        let taken = |frame_s, is_behind| ring.catch_up(frame_s, is_behind);
        assert_eq!([taken(0.01, false), taken(0.01, true)], [1, 4]);
        assert_eq!([taken(0.0, true), taken(9.0, true)], [1, 40]);
    }

    #[test]
    fn an_identification_starts_where_the_pose_is_known() {
        let mut ring = Ring::new(8, 0.05);
        assert_eq!(ring.start(), 0);
        ring.push(entry(1, 0));
        assert_eq!((ring.start(), ring.has_pose()), (0, false));
        ring.push(entry(2, 1));
        ring.push(entry(3, 1));
        assert_eq!((ring.start(), ring.has_pose()), (1, true));
        ring.clear();
        assert!(!ring.has_pose());
    }

    #[test]
    fn the_last_entry_by_an_instant_is_found_within_the_range() {
        let mut ring = Ring::new(8, 0.05);
        for t_ns in [10, 20, 30, 40] {
            ring.push(entry(t_ns, 0));
        }
        for (t_ns, earliest, end, place) in [
            (30, 0, 4, 2),
            (29, 0, 4, 1),
            (5, 0, 4, 0),
            (99, 0, 4, 3),
            (99, 0, 3, 2),
            (15, 2, 4, 2),
        ] {
            assert_eq!(ring.last_by(t_ns, earliest, end), place, "{t_ns}");
        }
    }

    #[test]
    #[should_panic(expected = "the ring holds one run")]
    fn an_entry_of_another_run_ends_the_process() {
        let mut ring = Ring::new(3, 0.05);
        ring.push(entry(1, 0));
        ring.push(RingEntry {
            run_id: 2,
            ..entry(2, 0)
        });
    }

    #[test]
    #[should_panic(expected = "no more are kept than the capacity")]
    fn a_ring_that_holds_more_than_its_capacity_ends_the_process() {
        let mut ring = Ring::new(3, 0.05);
        ring.push(entry(1, 0));
        ring.push(entry(2, 0));
        ring.capacity = 1;
        ring.push(entry(3, 0));
    }
}
