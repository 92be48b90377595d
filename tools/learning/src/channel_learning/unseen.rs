//! The windows of a log, each part seen through the model that has not seen it.

use vigil_robot::channel_model::channel::commands;
use vigil_robot::channel_model::window::{Suspects, Window};
use vigil_robot::channel_model::{Model, Scales};

use super::record::Record;

/// Blocks before a part in which a run's context is learned.
pub(super) const CONTEXT_BLOCKS: usize = 60;

/// A window, and where in the log it ends.
pub(super) struct Sight<'a> {
    /// The window.
    pub window: &'a Window,
    /// Its record.
    pub record: usize,
    /// Its newest observation in that.
    pub newest: usize,
}

/// Passes each window of a part to `take`, part by part and record by record.
pub(super) fn windows(
    models: &[Model],
    records: &[Record],
    scales: &Scales,
    mut take: impl FnMut(&Sight<'_>),
) {
    for (fold, model) in models.iter().enumerate() {
        let used = model.channel.iter().cloned().enumerate().collect();
        let mut window = Window::new(used, scales.clone(), model.interval_s);
        for (number, record) in records.iter().enumerate() {
            let ahead = CONTEXT_BLOCKS * window.per_block();
            window.reset();
            for (newest, history) in record.histories.iter().enumerate() {
                if history.ago(scales.lags).is_none() {
                    window.clear();
                    continue;
                }
                let last = (newest + ahead).min(record.folds.len() - 1);
                if !record.folds[newest..=last].contains(&fold) {
                    window.reset();
                    continue;
                }
                window.push(
                    history,
                    &commands(history),
                    (model.widening(history), Suspects::default()),
                );
                if record.folds[newest] == fold {
                    take(&Sight {
                        window: &window,
                        record: number,
                        newest,
                    });
                }
            }
        }
    }
}
