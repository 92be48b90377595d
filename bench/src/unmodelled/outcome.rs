//! What became of one run.

use serde_json::{Value, json};

use super::{Cell, JUDGED_S};
use crate::simulated::Said;

/// Probability above which a wrong name counts as confident.
const CONFIDENT: f64 = 0.9;

/// A diagnosis of something that no model contains.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Unknown; or the disturbed encoder's own fault.
    Right,
    /// Nominal.
    Nominal,
    /// A modelled fault, with no more than 0.9.
    Doubtful,
    /// A modelled fault with more than 0.9.
    Wrong,
}

/// One run of a cell with one set of sensors.
#[derive(Debug, Clone)]
pub struct Run {
    /// The cell.
    pub cell: Cell,
    /// Name of the set of sensors.
    pub sensors: &'static str,
    /// Frames per second.
    pub rate_hz: f64,
    /// Seed of the world.
    pub seed: u64,
    /// Onset, s.
    pub onset_s: f64,
    /// Noncentrality of this set of sensors over 2 s.
    pub noncentrality: f64,
    /// Equilibria that the simulator did not find.
    pub unsolved: u64,
    /// An alarm stood before the onset.
    pub alarmed_before: bool,
    /// Time from onset to alarm, s.
    pub delay_s: Option<f64>,
    /// What was said 2 s after the detection, and 5 and 10 s after the onset.
    pub said: [Option<Said>; JUDGED_S.len()],
}

impl Run {
    /// A run about to begin.
    #[must_use]
    pub fn new(cell: &Cell, sensors: &'static str, rate_hz: f64, seed: u64, onset_s: f64) -> Self {
        Self {
            cell: cell.clone(),
            sensors,
            rate_hz,
            seed,
            onset_s,
            noncentrality: 0.0,
            unsolved: 0,
            alarmed_before: false,
            delay_s: None,
            said: [const { None }; JUDGED_S.len()],
        }
    }

    /// Takes what a frame brought.
    pub fn take(&mut self, t_s: f64, alarm: bool, said: impl Fn() -> Said) {
        let since_s = t_s - self.onset_s;
        if since_s < 0.0 {
            self.alarmed_before |= alarm;
            return;
        }
        if alarm && self.delay_s.is_none() {
            self.delay_s = Some(since_s);
        }
        let due = |i: usize| match i {
            0 => self
                .delay_s
                .is_some_and(|delay_s| since_s >= delay_s + JUDGED_S[0]),
            i => since_s >= JUDGED_S[i],
        };
        let due: [bool; JUDGED_S.len()] = std::array::from_fn(due);
        for (slot, _) in self
            .said
            .iter_mut()
            .zip(due)
            .filter(|(slot, due)| *due && slot.is_none())
        {
            *slot = Some(said());
        }
    }

    /// True if an alarm came within `limit_s`.
    #[must_use]
    pub fn is_detected(&self, limit_s: f64) -> bool {
        self.delay_s.is_some_and(|delay_s| delay_s <= limit_s)
    }

    /// The diagnosis at one of [`JUDGED_S`], judged; `None` if it was never due.
    #[must_use]
    pub fn verdict(&self, instant: usize) -> Option<Verdict> {
        let said = self.said[instant].as_ref()?;
        let own = |wheel: &str| said.mode == format!("{wheel}_ENC");
        Some(match said.mode.as_str() {
            "UNKNOWN" => Verdict::Right,
            _ if self.cell.encoder.is_some_and(own) => Verdict::Right,
            "ND" => Verdict::Nominal,
            _ if said.names_a_fault(CONFIDENT) => Verdict::Wrong,
            _ => Verdict::Doubtful,
        })
    }

    /// Head of [`Self::line`].
    pub const HEAD: &'static str = "spec,curvature_1_m,speed_m_s,sensors,rate_hz,seed,onset_s,\
        noncentrality,alarmed_before,delay_s,mode_2s_after_alarm,p_2s,mode_5s,p_5s,mode_10s,\
        p_10s,unsolved";

    /// The run as a line of CSV.
    #[must_use]
    pub fn line(&self) -> String {
        let said = self.said.iter().map(|said| match said {
            Some(said) => format!("{},{:.4}", said.mode, said.p_mode),
            None => ",".to_owned(),
        });
        format!(
            "{},{},{},{},{},{},{:.3},{:.2},{},{},{},{}",
            self.cell.spec,
            self.cell.curvature_1_m,
            self.cell.speed_m_s,
            self.sensors,
            self.rate_hz,
            self.seed,
            self.onset_s,
            self.noncentrality,
            u8::from(self.alarmed_before),
            self.delay_s
                .map_or(String::new(), |delay_s| format!("{delay_s:.3}")),
            said.collect::<Vec<_>>().join(","),
            self.unsolved,
        )
    }

    /// The cell as raw data.
    #[must_use]
    pub fn cell_json(&self) -> Value {
        json!({
            "spec": self.cell.spec, "curvature_1_m": self.cell.curvature_1_m,
            "speed_m_s": self.cell.speed_m_s, "sensors": self.sensors,
            "noncentrality": self.noncentrality,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(mode: &str, p_mode: f64) -> Said {
        Said {
            alarm: true,
            mode: mode.to_owned(),
            p_mode,
            p_unknown: 0.0,
            fault_set: String::new(),
        }
    }

    fn run(encoder: Option<&'static str>) -> Run {
        let cell = Cell {
            kind: "encoder-scale",
            spec: String::new(),
            encoder,
            curvature_1_m: 0.0,
            speed_m_s: 0.2,
            weaves: false,
        };
        Run::new(&cell, "pose", 20.0, 1, 3.0)
    }

    #[test]
    fn unknown_and_the_disturbed_encoder_are_right_and_all_other_names_are_not() {
        for (mode, p, encoder, verdict) in [
            ("UNKNOWN", 0.6, None, Verdict::Right),
            ("LF_ENC", 0.95, Some("LF"), Verdict::Right),
            ("LF_ENC", 0.95, Some("LM"), Verdict::Wrong),
            ("LF_ENC", 0.95, None, Verdict::Wrong),
            ("LSS", 0.95, None, Verdict::Wrong),
            ("MULTIPLE", 0.95, None, Verdict::Wrong),
            ("LF_STUCK", 0.9, None, Verdict::Doubtful),
            ("ND", 1.0, None, Verdict::Nominal),
        ] {
            let mut run = run(encoder);
            run.said[1] = Some(said(mode, p));
            assert_eq!(run.verdict(1), Some(verdict), "{mode}");
            assert_eq!(run.verdict(0), None);
        }
    }

    #[test]
    fn each_instant_is_judged_once_when_it_is_due() {
        let mut run = run(None);
        for k in 0..300_i32 {
            let t_s = f64::from(k) * 0.05;
            let alarm = t_s >= 3.5;
            run.take(t_s, alarm, || said("UNKNOWN", t_s));
        }
        assert!(!run.alarmed_before);
        assert!(run.delay_s.is_some_and(|d| (d - 0.5).abs() < 1e-9));
        let at = run
            .said
            .each_ref()
            .map(|said| said.as_ref().map_or(0.0, |s| s.p_mode));
        for (at, expected) in at.into_iter().zip([5.5, 8.0, 13.0]) {
            assert!((at - expected).abs() < 0.051, "{at}");
        }
        let mut early = super::tests::run(None);
        early.take(2.0, true, || said("ND", 1.0));
        assert!(early.alarmed_before && early.delay_s.is_none());
    }
}
