//! Why something is believed, as keys and values.

use vigil_blocks::SizeKind;
use vigil_robot::Description;
use vigil_robot::channel::evidence_name;

/// How much is broken, and what speaks most for it.
pub(crate) struct Explanation<'a> {
    pub(crate) size_kind: u32,
    pub(crate) size: f64,
    pub(crate) size_sd: f64,
    /// nat; 0 or less: nothing speaks for it.
    pub(crate) evidence: f64,
    /// Place of the channel that says it.
    pub(crate) channel: usize,
    /// The next best explanation.
    pub(crate) runner_up: &'a str,
}

impl Explanation<'_> {
    /// Those of its keys that have a value.
    pub(crate) fn values(&self, robot: &Description) -> Vec<(&'static str, String)> {
        let size = SizeKind::from_wire(self.size_kind).text(self.size, self.size_sd);
        let mut values = vec![("runner-up", self.runner_up.to_owned())];
        if !size.is_empty() {
            values.push(("size", size));
        }
        if self.evidence > 0.0 {
            let channel = evidence_name(robot, self.channel);
            values.push(("evidence channel", channel));
            values.push(("evidence, nat", format!("{:.1}", self.evidence)));
        }
        values
    }
}
