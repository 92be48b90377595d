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
        noncentrality,alarmed_before,delay_s,mode_2s_after_alarm,p,mode_5s,p,mode_10s,p,unsolved";

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
