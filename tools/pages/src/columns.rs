//! Columns of time in bounded number, however long the time becomes.

/// What lies in one column of time.
pub trait Column {
    /// Takes in what comes after it.
    fn join(&mut self, next: Self);
}

/// Columns of equal width from the beginning on. They double their width when time runs beyond
/// them.
#[derive(Debug, Clone, PartialEq)]
pub struct Columns<C> {
    /// In the order of time, each with its number from the beginning.
    all: Vec<(u64, C)>,
    width_s: f64,
    most: u32,
}

impl<C: Column> Columns<C> {
    /// None yet; at most so many, and so wide at first.
    #[must_use]
    pub const fn new(most: u32, width_s: f64) -> Self {
        Self {
            all: Vec::new(),
            width_s,
            most,
        }
    }

    /// Adds what was at an instant; nothing if that is no time after the beginning. It stands alone
    /// if it `is_apart` from what came before.
    pub fn add(&mut self, t_s: f64, content: C, is_apart: bool) {
        if !(t_s.is_finite() && t_s >= 0.0) {
            return;
        }
        while t_s / self.width_s >= f64::from(self.most) {
            self.widen();
        }
        let at = (t_s / self.width_s) as u64;
        match self.all.last_mut() {
            // A clock that goes back stays in its column.
            Some((last, column)) if *last >= at && !is_apart => column.join(content),
            _ => self.all.push((at, content)),
        }
        // Contents that stand alone are more than columns.
        if self.all.len() > 2 * self.most as usize {
            self.widen();
        }
    }

    /// Doubles the width.
    pub fn widen(&mut self) {
        self.width_s *= 2.0;
        let mut merged: Vec<(u64, C)> = Vec::with_capacity(self.most as usize);
        for (at, column) in self.all.drain(..) {
            let at = at / 2;
            match merged.last_mut() {
                Some((last, before)) if *last >= at => before.join(column),
                _ => merged.push((at, column)),
            }
        }
        self.all = merged;
    }

    /// Width of a column, s.
    #[must_use]
    pub const fn width_s(&self) -> f64 {
        self.width_s
    }

    /// The columns in which something lies, in the order of time, each with its number.
    pub fn iter(&self) -> impl Iterator<Item = (u64, &C)> {
        self.all.iter().map(|(at, column)| (*at, column))
    }

    /// How many columns there are from the beginning to the last in which something lies.
    #[must_use]
    pub fn span(&self) -> u64 {
        self.all.last().map_or(0, |(at, _)| at.saturating_add(1))
    }
}
