//! One number over the last minute.

use std::collections::VecDeque;

/// Seconds that are kept.
pub const SECONDS: usize = 60;
const SECOND_NS: u64 = 1_000_000_000;

/// The largest value of each of the last seconds.
#[derive(Debug, Clone, Default)]
pub struct History {
    /// The newest last; `None` where nothing was heard.
    seconds: VecDeque<Option<f64>>,
    /// Which second of the clock the newest is.
    newest_s: u64,
}

impl History {
    /// Adds a value of the instant `t_ns`; one that is older than the newest second counts there.
    pub fn push(&mut self, t_ns: u64, value: f64) {
        self.advance(t_ns / SECOND_NS);
        if let Some(newest) = self.seconds.back_mut() {
            *newest = Some(newest.map_or(value, |held| held.max(value)));
        }
    }

    fn advance(&mut self, second: u64) {
        if self.seconds.is_empty() {
            self.newest_s = second;
            self.seconds.push_back(None);
        }
        let new = second.saturating_sub(self.newest_s).min(SECONDS as u64);
        for _ in 0..new {
            self.seconds.push_back(None);
        }
        self.newest_s = self.newest_s.max(second);
        while self.seconds.len() > SECONDS {
            self.seconds.pop_front();
        }
    }

    /// The last minute before `now_ns` in so many columns, the newest last: the largest value of
    /// each, `None` where nothing was heard.
    pub fn columns(&self, columns: usize, now_ns: u64) -> Vec<Option<f64>> {
        let since = (now_ns / SECOND_NS).saturating_sub(self.newest_s) as usize;
        let at = |ago: usize| {
            let ago = ago.checked_sub(since)?;
            let index = self.seconds.len().checked_sub(ago + 1)?;
            self.seconds[index]
        };
        let largest = |column: usize| {
            let back = columns - 1 - column;
            let (from, to) = (back * SECONDS / columns, (back + 1) * SECONDS / columns);
            let values = (from..to.max(from + 1)).filter_map(at);
            values.reduce(f64::max)
        };
        (0..columns).map(largest).collect()
    }

    /// The largest value that is kept.
    pub fn largest(&self) -> Option<f64> {
        self.seconds.iter().flatten().copied().reduce(f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_column_holds_the_largest_of_its_seconds_and_silence_is_a_gap() {
        let mut history = History::default();
        let second = |s: u64| s * SECOND_NS;
        history.push(second(100), 0.25);
        history.push(second(100) + 5, 0.75);
        history.push(second(100) + 9, 0.5);
        history.push(second(103), 0.125);
        let last = |columns, now_s: u64| {
            let all = history.columns(columns, second(now_s));
            assert_eq!(all.len(), columns);
            all[columns - 5..].to_vec()
        };
        let at_103 = last(60, 103);
        assert_eq!(at_103, [None, Some(0.75), None, None, Some(0.125)]);
        assert_eq!(last(60, 105)[2], Some(0.125));
        assert_eq!(last(20, 103)[3..], [Some(0.75), Some(0.125)]);
        assert_eq!(history.largest(), Some(0.75));
        history.push(second(1000), 0.5);
        assert_eq!(history.largest(), Some(0.5));
    }
}
