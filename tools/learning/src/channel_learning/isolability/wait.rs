//! How long and how far a robot drives until a fault shows.

use schemars::JsonSchema;
use serde::Serialize;
use vigil_robot::channel_model::law::BLOCK_S;

use super::snapshot::{Place, Snapshot};

/// Time and way from an onset on.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Wait {
    /// Time in motion, s.
    pub motion_s: f64,
    /// Way, m; null if nothing tells the robot's speed.
    pub way_m: Option<f64>,
}

/// The wait that half of all onsets, and nine of ten, do not exceed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Waits {
    /// The wait that half of the onsets do not exceed.
    pub half: Wait,
    /// The wait that nine of ten do not exceed.
    pub nine_of_ten: Wait,
}

impl Waits {
    /// Of onsets that are spread over the log's motion, which begins again at its end. `blocks`
    /// says for each window after how many blocks it shows, zero if it does not; none if no window
    /// does.
    pub(super) fn new(log: &[Snapshot], blocks: &[u8]) -> Option<Self> {
        let (first, last) = (log.first()?.place, log.last()?.place);
        let mut waits: Vec<Wait> = Vec::new();
        // The next window that shows it, looking ahead from the second lap's end.
        let mut next: Option<Place> = None;
        for at in (0..2 * log.len()).rev() {
            let (lap, window) = (at / log.len(), at % log.len());
            let laps = lap as f64;
            let here = log[window].place;
            let here = Place {
                motion_s: here.motion_s + laps * (last.motion_s - first.motion_s),
                way_m: here.way_m.map(|way| way + laps * ways(first, last)),
                ..here
            };
            if blocks[window] > 0 {
                let more_s = BLOCK_S * f64::from(blocks[window]);
                next = Some(Place {
                    motion_s: here.motion_s + more_s,
                    way_m: here.way_m.map(|way| way + here.speed_m_s * more_s),
                    ..here
                });
            }
            let next = next.filter(|_| lap == 0);
            waits.extend(next.map(|next| Wait {
                motion_s: next.motion_s - here.motion_s,
                way_m: next.way_m.zip(here.way_m).map(|(to, from)| to - from),
            }));
        }
        let quantile = |share: f64| {
            let at = (share * waits.len() as f64).ceil() as usize;
            let at = at.max(1) - 1;
            let mut times: Vec<f64> = waits.iter().map(|wait| wait.motion_s).collect();
            times.sort_by(f64::total_cmp);
            let ways = waits.iter().filter_map(|wait| wait.way_m);
            let mut ways: Vec<f64> = ways.collect();
            ways.sort_by(f64::total_cmp);
            Some(Wait {
                motion_s: *times.get(at)?,
                way_m: ways.get(at).copied(),
            })
        };
        Some(Self {
            half: quantile(0.5)?,
            nine_of_ten: quantile(0.9)?,
        })
    }
}

fn ways(first: Place, last: Place) -> f64 {
    let both = first.way_m.zip(last.way_m);
    both.map_or(0.0, |(first, last)| last - first)
}
