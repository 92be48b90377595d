//! Diagnosis of a robot without fault models: nominal, or unknown.

use vigil_blocks::{DetectionBelief, Entry, FaultBelief, MODE_UNKNOWN, ParticleBlock, Readiness};
use vigil_robot::FaultTree;

use crate::identify::identifier::Input;
use crate::identify::leaf_map::LeafMap;
use crate::identify::reported::ReportedFault;
use crate::identify::tree_belief::TreeBelief;
use crate::invariants;

/// Reports ND with 1 - p(fault) of the detector, and the rest as unknown.
#[derive(Debug, Clone)]
pub struct NominalIdentifier {
    posterior: TreeBelief,
    leaves: LeafMap,
    reported: ReportedFault,
    run_id: u64,
    /// Capture time of the last frame, ns, and motion in it, s, until it has been reported.
    t_ns: u64,
    moved_s: f64,
    alarm_t_ns: u64,
}

impl NominalIdentifier {
    /// An identifier over `tree`, of which it uses the nominal node alone.
    #[must_use]
    pub fn new(tree: &FaultTree) -> Self {
        Self {
            posterior: TreeBelief::nominal(),
            leaves: LeafMap {
                hash: tree.hash(),
                nodes: tree.nodes().len(),
                ..LeafMap::none()
            },
            reported: ReportedFault::default(),
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
        self.posterior = TreeBelief::nominal();
        self.reported.begin_run();
        (self.t_ns, self.alarm_t_ns) = (0, 0);
    }

    fn take(&mut self, detection: &DetectionBelief, dt_s: f64) {
        let moves = detection.readiness == Readiness::Armed as u32 && self.t_ns != 0;
        self.moved_s = if moves { dt_s } else { 0.0 };
        self.posterior = TreeBelief::watching(detection.p_fault);
        self.alarm_t_ns = match detection.alarm {
            0 => 0,
            _ => detection.alarm_t_capture_ns,
        };
    }

    /// Before the alarm the mode is nominal, whatever the odds are in passing. Its changes are
    /// counted where they are seen, by [`BlindOverride`].
    fn report(&mut self, predicted: &TreeBelief, belief: &mut FaultBelief) {
        let posterior = &self.posterior;
        let alarm = self.alarm_t_ns != 0;
        let (mode, p_mode) = match alarm && posterior.unknown > 0.5 {
            true => (MODE_UNKNOWN, posterior.unknown),
            false => (0, posterior.nodes[0]),
        };
        let moved_s = std::mem::take(&mut self.moved_s);
        self.reported
            .take(mode, p_mode, posterior, &self.leaves, moved_s);
        belief.run_id = self.run_id;
        posterior.write(&self.leaves, belief);
        belief.p_predicted = predicted.nodes;
        belief.p_unknown_predicted = predicted.unknown;
        belief.mode = mode;
        belief.reported = self.reported.name();
        belief.p_mode = p_mode;
        belief.alarm_t_capture_ns = self.alarm_t_ns;
        belief.onset_t_capture_ns = 0;
        belief.identifying = u32::from(alarm);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vigil_blocks::SensorFrame;
    use vigil_robot::tree::Node;

    fn identifier() -> NominalIdentifier {
        let nominal = Node {
            name: "ND".into(),
            parent: None,
            fault: None,
        };
        NominalIdentifier::new(&FaultTree::new(vec![nominal]).unwrap())
    }

    #[test]
    #[should_panic(expected = "nominal, faults and unknown account for one")]
    fn a_belief_that_leaves_some_out_ends_the_process() {
        let mut identifier = identifier();
        identifier.posterior.nodes[0] = 0.5;
        identifier.step(
            Entry::Missed(1),
            &mut FaultBelief::default(),
            &mut Box::default(),
        );
    }

    #[test]
    fn the_reported_name_outlasts_a_doubt_of_less_than_a_second_of_motion() {
        let mut identifier = identifier();
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
                identifier.step(Entry::Frame(input), &mut belief, &mut out);
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
