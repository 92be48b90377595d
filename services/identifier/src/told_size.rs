//! When the size of a diagnosed fault is told in the timeline: once it is clear, and when it
//! changes.

use vigil_blocks::{FaultBelief, SizeKind};

/// A size is clear when its standard deviation is this share of it or less: two are a fifth, as
/// well as a size need be known.
const CLEAR: f64 = 0.1;
/// .. and the way has been the same for so many cycles: 0.2 s at 100 Hz, four observations.
const CYCLES: u32 = 20;
/// It is told anew when it has changed by more than this share. Two deviations of a clear one.
const CHANGED: f64 = 0.2;

/// What is said of a component: node of the fault tree, way, size and standard deviation.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct ReportedSize {
    node: u32,
    kind: u32,
    size: f64,
    sd: f64,
}

/// What was told last.
#[derive(Debug, Clone, Copy, Default)]
pub struct ToldSize {
    now: ReportedSize,
    cycles: u32,
    told: Option<ReportedSize>,
}

impl ToldSize {
    /// Takes the next belief.
    pub fn take(&mut self, belief: &FaultBelief) {
        let node = belief.mode as usize;
        let said = ReportedSize {
            node: belief.mode,
            kind: belief.size_kind.get(node).copied().unwrap_or_default(),
            size: belief.size.get(node).copied().unwrap_or_default(),
            sd: belief.size_sd.get(node).copied().unwrap_or_default(),
        };
        let is_same = (said.node, said.kind) == (self.now.node, self.now.kind);
        self.cycles = if is_same {
            self.cycles.saturating_add(1)
        } else {
            0
        };
        if said.node != self.now.node {
            self.told = None;
        }
        self.now = said;
    }

    /// What is to be told: node + 256 x way, size and its standard deviation in the way's unit.
    pub fn news(&mut self) -> Option<(u32, f64, f64)> {
        let ReportedSize {
            node,
            kind,
            size,
            sd,
        } = self.now;
        let way = SizeKind::from_wire(kind);
        // That a wheel is stuck says its name.
        let is_silent = matches!(way, SizeKind::None | SizeKind::Stuck);
        let is_clear = sd <= CLEAR * size.abs() && self.cycles >= CYCLES;
        let is_told = self.told.is_some_and(|told| {
            told.kind == kind && (told.size - size).abs() <= CHANGED * told.size.abs()
        });
        if is_silent || !is_clear || is_told {
            return None;
        }
        self.told = Some(self.now);
        Some((node | kind << 8, size, sd))
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
    fn a_size_is_told_once_it_is_clear_and_again_when_it_has_changed() {
        let mut told = ToldSize::default();
        let mut news = Vec::new();
        for cycle in 0..200 {
            let belief = match cycle {
                0..50 => gain(0.5, 0.1),
                50..120 => gain(0.52, 0.02),
                _ => gain(0.8, 0.02),
            };
            told.take(&belief);
            news.extend(told.news().map(|(what, size, _)| (cycle, what, size)));
        }
        let what = 11 | (SizeKind::Gain as u32) << 8;
        assert_eq!(news, [(50, what, 0.52), (120, what, 0.8)]);
        told.take(&FaultBelief::default());
        assert_eq!(told.news(), None);
    }
}
