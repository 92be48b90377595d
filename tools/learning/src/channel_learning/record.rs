//! A run as observations, each with what came before it, and the parts that are predicted by models
//! that have not seen them.

use vigil_recording::frames::Run;
use vigil_robot::Description;
use vigil_robot::channel_model::{History, Observation, Observer, WheelOrders};

/// Parts into which a log is divided: each is judged by what was learned from the others.
pub(super) const FOLDS: usize = 5;
/// Pieces of a run that is divided itself, as there are too few runs.
const PIECES: usize = 2 * FOLDS;

/// One run.
#[derive(Debug, Clone)]
pub(super) struct Record {
    /// After each observation: it and those before it.
    pub histories: Vec<History>,
    /// After each observation: what the wheels show with whose turns a declared fault comes back.
    pub orders: Vec<Vec<WheelOrders>>,
    /// The part that each belongs to.
    pub folds: Vec<usize>,
}

impl Record {
    /// Time in motion, s.
    pub fn moving_s(&self) -> f64 {
        let newest = self.histories.iter().filter_map(|history| history.ago(0));
        newest.filter(|now| now.moving).map(|now| now.dt_s).sum()
    }
}

/// Longest time in which a channel was not measured, s.
pub(super) fn silence_s(records: &[Record], place: usize) -> f64 {
    let mut longest_s = 0.0;
    for record in records {
        let mut silent_s = 0.0;
        for now in record.histories.iter().filter_map(|history| history.ago(0)) {
            silent_s = match now.values[place] {
                Some(_) => 0.0,
                None => silent_s + now.dt_s,
            };
            longest_s = f64::max(longest_s, silent_s);
        }
    }
    longest_s
}

/// Part of a channel's readings beyond a quarter of its period.
pub(super) fn part_astray(records: &[Record], place: usize, period: f64) -> f64 {
    let newest = records.iter().flat_map(|record| &record.histories);
    let values = newest.filter_map(|history| history.ago(0)?.values[place]);
    let (astray, all) = values.fold((0.0, 0.0), |(astray, all), value| {
        let is_astray = value.abs() > 0.25 * period;
        (astray + f64::from(u8::from(is_astray)), all + 1.0)
    });
    astray / f64::max(all, 1.0)
}

/// Time at rest after all lags of the motion before, s.
pub(super) fn rest_s(records: &[Record], lags: usize) -> f64 {
    let all = records.iter().flat_map(|record| &record.histories);
    let rests_at = |then: Option<&Observation>| then.is_some_and(|then| !then.moving);
    let is_rest = |history: &&History| (0..=lags).all(|lag| rests_at(history.ago(lag)));
    let rests = all.filter(is_rest).filter_map(|history| history.ago(0));
    rests.map(|now| now.dt_s).sum()
}

/// The runs up to a time, s, each a group of its own.
pub(super) fn all(runs: &[&Run], until_s: f64, robot: &Description) -> Vec<Record> {
    grouped(runs, &[], until_s, robot)
}

/// Name of a run's group; one without is a group of its own.
pub(super) fn group(run: &Run, groups: &[(u32, String)]) -> String {
    let group = groups.iter().find(|(id, _)| *id == run.id);
    group.map_or_else(
        || format!("run {}", run.id),
        |(_, name)| format!("group {name}"),
    )
}

/// The runs up to a time, s. Those of one group are in one part, if there are groups enough.
pub(super) fn grouped(
    runs: &[&Run],
    groups: &[(u32, String)],
    until_s: f64,
    robot: &Description,
) -> Vec<Record> {
    let mut names: Vec<String> = Vec::new();
    let mut places = Vec::with_capacity(runs.len());
    for run in runs {
        let name = group(run, groups);
        let place = names.iter().position(|other| *other == name);
        places.push(place.unwrap_or(names.len()));
        if place.is_none() {
            names.push(name);
        }
    }
    let record = |(run, i): (&&Run, usize)| {
        let mut observer = Observer::new(robot);
        let (mut histories, mut orders) = (Vec::new(), Vec::new());
        for frame in &run.frames {
            if frame.header.t_capture_ns as f64 * 1e-9 > until_s {
                break;
            }
            if observer.push(frame).complete {
                histories.push(*observer.history());
                orders.push(observer.orders().to_vec());
            }
        }
        let length = histories.len().div_ceil(PIECES).max(1);
        let fold = |k: usize| match names.len() < FOLDS {
            true => (i + k / length) % FOLDS,
            false => i % FOLDS,
        };
        Record {
            folds: (0..histories.len()).map(fold).collect(),
            histories,
            orders,
        }
    };
    runs.iter().zip(places).map(record).collect()
}
