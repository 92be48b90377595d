//! What was believed over time.

use vigil_blocks::{DetectionBelief, FaultBelief, MODE_UNKNOWN, mode_word};
use vigil_pages::chart::{Axis, Chart, Curve, Stroke};
use vigil_pages::colour::Colour;
use vigil_pages::page::{KeyEntry, key, remark, titled};
use vigil_pages::trace::Trace;
use vigil_robot::FaultTree;

/// A fault that is never more probable is not drawn.
const P_LEAST: f64 = 0.05;
/// Curves that are drawn in one chart.
const CURVES_MAX: usize = 12;
/// Silence after which a curve is interrupted, s.
const SILENCE_S: f64 = 0.5;
/// Width of all charts over time, and their heights.
pub(crate) const WIDTH: u32 = 1800;
const BELIEF_HEIGHT: u32 = 440;
const DETECTION_HEIGHT: u32 = 280;

/// A curve that ends where nothing was told.
#[derive(Debug, Clone, Default)]
pub(crate) struct TimedTrace(Trace);

impl TimedTrace {
    /// Adds a value.
    pub(crate) fn add(&mut self, t_s: f64, value: f64) {
        if self
            .0
            .last()
            .is_some_and(|(last_s, _)| t_s > last_s + SILENCE_S)
        {
            self.0.interrupt();
        }
        self.0.add(t_s, value);
    }

    /// The least and the greatest value.
    pub(crate) const fn bounds(&self) -> Option<[f64; 2]> {
        self.0.bounds()
    }

    /// The greatest value, or 0.
    pub(crate) fn max(&self) -> f64 {
        self.0.max()
    }

    /// True if there is no value.
    pub(crate) fn is_empty(&self) -> bool {
        self.0.last().is_none()
    }

    /// The curve, in its pieces.
    pub(crate) fn curves(&self, colour: Colour, stroke: Stroke) -> Vec<Curve> {
        let curve = |points| Curve {
            colour,
            stroke,
            points,
        };
        self.0.pieces().into_iter().map(curve).collect()
    }
}

/// What detector and identifier believe.
#[derive(Debug, Default)]
pub(crate) struct Beliefs {
    nodes: Vec<TimedTrace>,
    unknown: TimedTrace,
    p_fault: TimedTrace,
}

impl Beliefs {
    /// True if anything was believed.
    pub(crate) fn is_there(&self) -> bool {
        !(self.unknown.is_empty() && self.p_fault.is_empty())
    }

    /// Takes a belief of the identifier.
    pub(crate) fn take(&mut self, t_s: f64, belief: &FaultBelief, tree: &FaultTree) {
        self.nodes
            .resize_with(tree.nodes().len(), TimedTrace::default);
        for (trace, p) in self.nodes.iter_mut().zip(belief.p) {
            trace.add(t_s, p);
        }
        self.unknown.add(t_s, belief.p_unknown);
    }

    /// Takes a belief of the detector.
    pub(crate) fn take_detection(&mut self, t_s: f64, belief: &DetectionBelief) {
        self.p_fault.add(t_s, belief.p_fault);
    }

    /// The charts, above a common axis of time.
    pub(crate) fn charts(&self, tree: &FaultTree, time: &Axis, alarms: &[[f64; 2]]) -> String {
        let mut found = self.belief(tree, time);
        if !self.p_fault.is_empty() {
            let mut curves: Vec<Curve> = alarms.iter().map(|span| alarm(*span)).collect();
            curves.extend(self.p_fault.curves(Colour::Series(0), Stroke::Solid));
            let caption = "Probability of any fault, as the detector sees it";
            let names = [
                entry(Colour::Series(0), "p_fault of the detector"),
                entry(Colour::Alarm, "area: an alarm stands"),
            ];
            let svg = over_time(caption, DETECTION_HEIGHT, time, curves);
            found.push_str(&titled(caption, &key(&names), &svg));
        }
        found
    }

    fn belief(&self, tree: &FaultTree, time: &Axis) -> String {
        let leaf = |at: usize| {
            (
                &self.nodes[at],
                Colour::node(at),
                tree.nodes()[at].name.as_str(),
            )
        };
        let leaves = tree
            .leaves()
            .filter(|at| *at != 0 && *at < self.nodes.len());
        let healthy = (!self.nodes.is_empty()).then_some(0);
        let unknown = mode_word(MODE_UNKNOWN).unwrap_or_default();
        let all = healthy.into_iter().chain(leaves).map(leaf);
        let all = all.chain([(&self.unknown, Colour::Unknown, unknown)]);
        let mut drawn: Vec<_> = all.filter(|it| it.0.max() > P_LEAST).collect();
        if drawn.is_empty() {
            return remark("The recording holds no belief of the identifier.");
        }
        drawn.sort_by(|a, b| b.0.max().total_cmp(&a.0.max()));
        let further: Vec<&str> = drawn.iter().skip(CURVES_MAX).map(|it| it.2).collect();
        drawn.truncate(CURVES_MAX);
        let entries: Vec<KeyEntry> = drawn.iter().map(|it| entry(it.1, it.2)).collect();
        // The most probable one lies on top.
        let curves = drawn.iter().rev();
        let curves = curves.flat_map(|it| it.0.curves(it.1, it.1.stroke()));
        let caption = "Belief in the healthy robot and in each fault";
        let svg = over_time(caption, BELIEF_HEIGHT, time, curves.collect());
        let mut chart = titled(caption, &key(&entries), &svg);
        if !further.is_empty() {
            let names = further.join(", ");
            chart.push_str(&remark(&format!("Less probable, not drawn: {names}.")));
        }
        chart
    }
}

fn entry(colour: Colour, name: &str) -> KeyEntry {
    let mark = match colour {
        Colour::Healthy => " (healthy)",
        _ => "",
    };
    KeyEntry {
        colour,
        stroke: colour.stroke(),
        name: format!("{name}{mark}"),
    }
}

/// The area in which an alarm stands.
fn alarm(span: [f64; 2]) -> Curve {
    let [from_s, to_s] = span;
    let outline = [(from_s, 0.0), (from_s, 1.0), (to_s, 1.0), (to_s, 0.0)];
    Curve {
        colour: Colour::Alarm,
        stroke: Stroke::Area,
        points: outline.to_vec(),
    }
}

fn over_time(caption: &str, height: u32, time: &Axis, curves: Vec<Curve>) -> String {
    let chart = Chart {
        caption: caption.to_owned(),
        size: (WIDTH, height),
        x: time.clone(),
        y: Axis::share("probability"),
        curves,
        labels: Vec::new(),
    };
    chart.svg()
}
