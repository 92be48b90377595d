//! Values that last.

/// Spans that are kept; a value that flickers longer is drawn no more.
const SPANS_MAX: usize = 1000;

/// A value, and from when to when it lasted, s.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Span<T> {
    pub(crate) from_s: f64,
    pub(crate) to_s: f64,
    pub(crate) value: T,
}

/// A value over time, in the order of time.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Spans<T> {
    all: Vec<Span<T>>,
    /// True while the last one goes on.
    is_open: bool,
    /// How many were not kept.
    pub(crate) left_out: usize,
}

impl<T> Default for Spans<T> {
    fn default() -> Self {
        Self {
            all: Vec::new(),
            is_open: false,
            left_out: 0,
        }
    }
}

impl<T: PartialEq> Spans<T> {
    /// At this instant the value is this one; `None` for none.
    pub(crate) fn take(&mut self, t_s: f64, value: Option<T>) {
        let last = self.all.last_mut().filter(|_| self.is_open);
        let is_same = last.is_some_and(|last| {
            last.to_s = last.to_s.max(t_s);
            Some(&last.value) == value.as_ref()
        });
        if is_same {
            return;
        }
        self.is_open = false;
        let Some(value) = value else {
            return;
        };
        if self.all.len() >= SPANS_MAX {
            self.left_out += 1;
            return;
        }
        self.is_open = true;
        self.all.push(Span {
            from_s: t_s,
            to_s: t_s,
            value,
        });
    }

    /// All of them.
    pub(crate) fn all(&self) -> &[Span<T>] {
        &self.all
    }

    /// The value at the end.
    pub(crate) fn last(&self) -> Option<&T> {
        let last = self.all.last().filter(|_| self.is_open);
        last.map(|last| &last.value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_lasts_until_there_is_another() {
        let mut spans = Spans::default();
        for (t_s, value) in [(0.0, None), (1.0, Some(5)), (2.0, Some(5)), (3.0, Some(6))] {
            spans.take(t_s, value);
        }
        let ends = spans.all().iter().map(|it| (it.from_s, it.to_s, it.value));
        assert_eq!(ends.collect::<Vec<_>>(), [(1.0, 3.0, 5), (3.0, 3.0, 6)]);
        assert_eq!(spans.last(), Some(&6));
        spans.take(4.0, None);
        assert_eq!(spans.last(), None);
        for i in 0..3_000 {
            spans.take(5.0 + f64::from(i), Some(i));
        }
        assert_eq!(spans.all().len(), SPANS_MAX);
        assert_eq!(spans.left_out, 2_002);
    }
}
