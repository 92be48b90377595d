//! Diagnosis of a robot whose faults nobody has modelled: nominal, or unknown.

use vigil_blocks::{DetectionBelief, Entry, FaultBelief, MODE_UNKNOWN, ParticleBlock, Readiness};
use vigil_robot::FaultTree;

use crate::identify::blindfold::Blindfold;
use crate::identify::identifier::{Identifier, Input};
use crate::identify::modes::Leaves;
use crate::identify::posterior::Posterior;
use crate::identify::reported::HeldName;
use crate::invariants;

/// Reports ND with 1 - p(fault) of the detector and the rest as unknown.
#[derive(Debug, Clone)]
pub struct Watcher {
    tree_hash: u64,
    node_count: u32,
    posterior: Posterior,
    leaves: Leaves,
    reported: HeldName,
    run_id: u64,
    /// Capture time of the last frame, ns, and motion in it, s, until it has been reported.
    t_ns: u64,
    moved_s: f64,
    alarm_t_ns: u64,
}

impl Watcher {
    /// A watcher that reports in the words of `tree`, of which it uses the nominal node alone.
    #[must_use]
    pub fn new(tree: &FaultTree) -> Self {
        Self {
            tree_hash: tree.hash(),
            node_count: tree.nodes().len() as u32,
            posterior: Posterior::nominal(),
            leaves: Leaves::none(),
            reported: HeldName::default(),
            run_id: 0,
            t_ns: 0,
            moved_s: 0.0,
            alarm_t_ns: 0,
        }
    }

    /// Takes one entry of the journal and fills the belief (headers and causes are the
    /// caller's); hypotheses it has none.
    pub fn step(
        &mut self,
        entry: Entry<Input<'_>>,
        belief: &mut FaultBelief,
        hypotheses: &mut ParticleBlock,
    ) {
        let mut predicted = self.posterior;
        match entry {
            Entry::Frame(input) => {
                if input.frame.run_id != self.run_id {
                    self.begin_run();
                    self.run_id = input.frame.run_id;
                    predicted = self.posterior;
                }
                let t_ns = input.frame.header.t_capture_ns;
                if let Some((detection, _)) = input.detection {
                    self.take(detection, t_ns.saturating_sub(self.t_ns) as f64 * 1e-9);
                }
                self.t_ns = t_ns;
            }
            Entry::Reset => self.begin_run(),
            Entry::Missed(_) | Entry::Budget(_) => {}
        }
        hypotheses.count = 0;
        self.report(&predicted, belief);
        invariants::fault_belief(belief, self.leaves.all());
    }

    fn begin_run(&mut self) {
        self.posterior = Posterior::nominal();
        self.reported.begin_run();
        (self.t_ns, self.alarm_t_ns) = (0, 0);
    }

    fn take(&mut self, detection: &DetectionBelief, dt_s: f64) {
        let moves = detection.readiness == Readiness::Armed as u32 && self.t_ns != 0;
        self.moved_s = if moves { dt_s } else { 0.0 };
        self.posterior = Posterior::watching(detection.p_fault);
        self.alarm_t_ns = match detection.alarm {
            0 => 0,
            _ => detection.alarm_t_capture_ns,
        };
    }

    /// Before the alarm the mode is nominal, whatever the odds are in passing. Its changes are
    /// counted where they are seen, by [`Blindfold`].
    fn report(&mut self, predicted: &Posterior, belief: &mut FaultBelief) {
        let posterior = &self.posterior;
        let alarm = self.alarm_t_ns != 0;
        let (mode, p_mode) = match alarm && posterior.unknown > 0.5 {
            true => (MODE_UNKNOWN, posterior.unknown),
            false => (0, posterior.nodes[0]),
        };
        let moved_s = std::mem::take(&mut self.moved_s);
        self.reported
            .take((mode, p_mode), posterior, &self.leaves, moved_s);
        belief.run_id = self.run_id;
        belief.p = posterior.nodes;
        belief.p_unknown = posterior.unknown;
        belief.p_predicted = predicted.nodes;
        belief.p_unknown_predicted = predicted.unknown;
        belief.node_count = self.node_count;
        belief.tree_hash = self.tree_hash;
        belief.entropy = posterior.entropy;
        belief.sets = posterior.sets;
        belief.set_count = posterior.set_count as u32;
        belief.mode = mode;
        belief.reported = self.reported.name();
        belief.p_mode = p_mode;
        belief.alarm_t_capture_ns = self.alarm_t_ns;
        belief.onset_t_capture_ns = 0;
        belief.identifying = u32::from(alarm);
    }
}

/// An identifier of either kind, which says so while the detector is blind.
#[derive(Debug, Clone)]
pub struct Diagnoser {
    of: Of,
    blindfold: Blindfold,
}

#[derive(Debug, Clone)]
enum Of {
    /// Tells faults apart.
    Identifier(Box<Identifier>),
    /// Tells nominal from unknown.
    Watcher(Box<Watcher>),
}

impl Diagnoser {
    /// See [`Identifier::particles`]; 0 without any.
    #[must_use]
    pub fn particles(&self) -> u32 {
        match &self.of {
            Of::Identifier(identifier) => identifier.particles(),
            Of::Watcher(_) => 0,
        }
    }

    /// See [`Identifier::particles_in_use`].
    #[must_use]
    pub fn particles_in_use(&self) -> u32 {
        match &self.of {
            Of::Identifier(identifier) => identifier.particles_in_use(),
            Of::Watcher(_) => 0,
        }
    }

    /// Takes one entry of the journal; see [`Identifier::step`].
    // Never merged into its caller, so that its instructions can be counted.
    #[inline(never)]
    pub fn step(
        &mut self,
        entry: Entry<Input<'_>>,
        belief: &mut FaultBelief,
        hypotheses: &mut ParticleBlock,
    ) {
        if let Entry::Frame(Input {
            detection: Some((detection, _)),
            ..
        }) = entry
        {
            self.look(detection);
        }
        match &mut self.of {
            Of::Identifier(identifier) => identifier.step(entry, belief, hypotheses),
            Of::Watcher(watcher) => watcher.step(entry, belief, hypotheses),
        }
        let p = belief.p;
        self.blindfold.cover(belief);
        invariants::held(&p, &belief.p);
        invariants::name(belief.mode, belief.node_count as usize);
        invariants::name(belief.reported, belief.node_count as usize);
    }

    /// Takes a detection without a frame behind it: of its words, only those of the detector's
    /// sight count.
    pub const fn look(&mut self, detection: &DetectionBelief) {
        self.blindfold.look(detection);
    }
}

impl From<Watcher> for Diagnoser {
    fn from(watcher: Watcher) -> Self {
        Self {
            of: Of::Watcher(Box::new(watcher)),
            blindfold: Blindfold::default(),
        }
    }
}

impl From<Identifier> for Diagnoser {
    fn from(identifier: Identifier) -> Self {
        Self {
            of: Of::Identifier(Box::new(identifier)),
            blindfold: Blindfold::default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vigil_blocks::SensorFrame;
    use vigil_robot::tree::Node;

    #[test]
    fn the_reported_name_outlasts_a_doubt_of_less_than_a_second_of_motion() {
        let nominal = Node {
            name: "ND".into(),
            parent: None,
            fault: None,
        };
        let mut watcher = Watcher::new(&FaultTree::new(vec![nominal]).unwrap());
        let mut belief = FaultBelief::default();
        let (block, mut out) = (Box::<ParticleBlock>::default(), Box::default());
        let mut t_ns = 0;
        let mut after = |alarm, p_fault, seconds: f64| {
            for _ in 0..(seconds * 20.0).round() as u32 {
                t_ns += 50_000_000;
                let mut frame = SensorFrame::default();
                frame.header.t_capture_ns = t_ns;
                let detection = DetectionBelief {
                    alarm,
                    p_fault,
                    alarm_t_capture_ns: 7,
                    readiness: Readiness::Armed as u32,
                    ..DetectionBelief::default()
                };
                let input = Input {
                    frame: &frame,
                    detection: Some((&detection, &*block)),
                };
                watcher.step(Entry::Frame(input), &mut belief, &mut out);
            }
            (belief.mode, belief.reported)
        };
        assert_eq!(after(0, 0.01, 5.0), (0, 0));
        assert_eq!(after(1, 0.99, 0.1), (MODE_UNKNOWN, MODE_UNKNOWN));
        assert_eq!(after(1, 0.1, 0.5), (0, MODE_UNKNOWN));
        assert_eq!(after(1, 0.9, 0.5), (MODE_UNKNOWN, MODE_UNKNOWN));
        assert_eq!(after(1, 0.1, 1.05), (0, 0));
    }
}
