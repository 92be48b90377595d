//! Who has not been heard for a while.

/// Time without a block after which nothing is known, ns: faults come ten times a second, Health
/// twenty times.
const SILENCE_NS: u64 = 2_000_000_000;
/// Shortest time after which it is said again, ns.
const REPEAT_NS: u64 = 1_000_000_000;

/// When something was heard last, and when its silence was told last.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Silence {
    heard_ns: u64,
    told_ns: u64,
}

impl Silence {
    /// Nothing was heard yet; counted from here.
    pub(crate) const fn since(now_ns: u64) -> Self {
        Self {
            heard_ns: now_ns,
            told_ns: 0,
        }
    }

    /// Something was heard.
    pub(crate) const fn hear(&mut self, now_ns: u64) {
        self.heard_ns = now_ns;
    }

    /// True if its silence is to be told now.
    pub(crate) const fn is_due(&mut self, now_ns: u64) -> bool {
        let is_silent = now_ns.saturating_sub(self.heard_ns) >= SILENCE_NS;
        let is_due = is_silent && now_ns.saturating_sub(self.told_ns) >= REPEAT_NS;
        if is_due {
            self.told_ns = now_ns;
        }
        is_due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn silence_is_told_after_two_seconds_and_once_a_second() {
        let ms = |ms: u64| (100_000 + ms) * 1_000_000;
        let mut silence = Silence::since(ms(0));
        assert!(!silence.is_due(ms(1_999)));
        assert!(silence.is_due(ms(2_000)));
        assert!(!silence.is_due(ms(2_999)));
        assert!(silence.is_due(ms(3_000)));
        silence.hear(ms(3_100));
        assert!(!silence.is_due(ms(5_000)));
    }
}
