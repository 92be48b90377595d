//! When the size of a diagnosed fault goes into the timeline: once it is clear, and when it has
//! changed.

use vigil_blocks::{FaultBelief, SizeKind};

/// A size is clear when its standard deviation is this share of it or less. Chosen by hand:
/// smaller, a size would be reported late or never; larger, before it is worth reading.
const CLEAR: f64 = 0.1;
/// .. and the way has been the same for so many cycles: 0.2 s at 100 Hz, four observations.
const CYCLES: u32 = 20;
/// It is reported anew when it has changed by more than this share: two deviations of a clear one.
const CHANGED: f64 = 0.2;

/// The size of a component's fault: node of the fault tree, way, size and standard deviation.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct FaultSize {
    node: u32,
    kind: u32,
    size: f64,
    sd: f64,
}

/// A size as its event carries it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SizeEvent {
    /// Node of the fault tree + 256 x way.
    pub what: u32,
    /// In the way's unit.
    pub size: f64,
    /// Standard deviation of `size`.
    pub sd: f64,
}

/// Follows the size of the diagnosed fault, and what was reported of it last.
#[derive(Debug, Clone, Copy, Default)]
pub struct SizeReport {
    now: FaultSize,
    cycles: u32,
    reported: Option<FaultSize>,
}

impl SizeReport {
    /// Takes the next belief.
    pub fn take(&mut self, belief: &FaultBelief) {
        let node = belief.mode as usize;
        let next = FaultSize {
            node: belief.mode,
            kind: belief.size_kind.get(node).copied().unwrap_or_default(),
            size: belief.size.get(node).copied().unwrap_or_default(),
            sd: belief.size_sd.get(node).copied().unwrap_or_default(),
        };
        let is_same = (next.node, next.kind) == (self.now.node, self.now.kind);
        self.cycles = if is_same {
            self.cycles.saturating_add(1)
        } else {
            0
        };
        if next.node != self.now.node {
            self.reported = None;
        }
        self.now = next;
    }

    /// What is to be reported now, if anything is.
    pub fn news(&mut self) -> Option<SizeEvent> {
        let FaultSize {
            node,
            kind,
            size,
            sd,
        } = self.now;
        let way = SizeKind::from_wire(kind);
        // A stuck wheel's name says it all.
        let is_silent = matches!(way, SizeKind::None | SizeKind::Stuck);
        let is_clear = sd <= CLEAR * size.abs() && self.cycles >= CYCLES;
        let is_known = self.reported.is_some_and(|reported| {
            reported.kind == kind && (reported.size - size).abs() <= CHANGED * reported.size.abs()
        });
        if is_silent || !is_clear || is_known {
            return None;
        }
        self.reported = Some(self.now);
        Some(SizeEvent {
            what: node | kind << 8,
            size,
            sd,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gain(size: f64, sd: f64) -> FaultBelief {
        let mut belief = FaultBelief {
            mode: 11,
            ..FaultBelief::default()
        };
        belief.size_kind[11] = SizeKind::Gain as u32;
        (belief.size[11], belief.size_sd[11]) = (size, sd);
        belief
    }

    #[test]
    fn a_size_is_reported_once_it_is_clear_and_again_when_it_has_changed() {
        let mut report = SizeReport::default();
        let mut news = Vec::new();
        for cycle in 0..200 {
            let belief = match cycle {
                0..50 => gain(0.5, 0.1),
                50..120 => gain(0.52, 0.02),
                _ => gain(0.8, 0.02),
            };
            report.take(&belief);
            news.extend(report.news().map(|event| (cycle, event.what, event.size)));
        }
        let what = 11 | (SizeKind::Gain as u32) << 8;
        assert_eq!(news, [(50, what, 0.52), (120, what, 0.8)]);
        report.take(&FaultBelief::default());
        assert_eq!(report.news(), None);
    }
}
