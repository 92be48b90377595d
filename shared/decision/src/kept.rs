//! How what the decision library remembers becomes part of a step's state: it knows no checkpoints.

/// The tracked belief.
pub(crate) mod tracker {
    use vigil_checkpoint::{Checkpoint, CheckpointReader, CheckpointValue, CheckpointWriter};
    use vigil_pomdp::Tracker;

    pub(crate) fn save(tracker: &Tracker, to: &mut CheckpointWriter<'_>) {
        tracker.keep(&mut |number: f64| number.save(to));
    }

    pub(crate) fn load(tracker: &mut Tracker, from: &mut CheckpointReader<'_>) {
        tracker.resume(&mut || f64::read(from));
    }
}

/// The last decision, and what the policy remembers.
pub(crate) mod decider {
    use vigil_checkpoint::{Checkpoint, CheckpointReader, CheckpointValue, CheckpointWriter};
    use vigil_pomdp::Decider;

    pub(crate) fn save(decider: &Decider, to: &mut CheckpointWriter<'_>) {
        decider.keep(&mut |number: f64| number.save(to));
    }

    pub(crate) fn load(decider: &mut Decider, from: &mut CheckpointReader<'_>) {
        decider.resume(&mut || f64::read(from));
    }
}

/// The present choice.
pub(crate) mod choice {
    use vigil_checkpoint::{Checkpoint, CheckpointReader, CheckpointValue, CheckpointWriter};
    use vigil_pomdp::{Choice, Control};

    /// What an action may have been chosen for, by its code.
    const CONTROLS: [Control; 3] = [Control::Policy, Control::Dual, Control::Stalled];

    pub(crate) fn save(choice: &Choice, to: &mut CheckpointWriter<'_>) {
        choice.action.save(to);
        choice.margin.save(to);
        to.mark(choice.control as u32);
    }

    pub(crate) fn load(choice: &mut Choice, from: &mut CheckpointReader<'_>) {
        *choice = Choice {
            action: usize::read(from),
            margin: f64::read(from),
            control: CONTROLS[from.variant(0, CONTROLS.len() as u32, "Control") as usize],
        };
    }
}
