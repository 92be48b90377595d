//! Which wheel each channel of a kind reads: measured against what every wheel's should read.

use vigil_blocks::WHEELS;
use vigil_checkpoint::CheckpointValue;

/// Ratio of squared residuals below which one order fits and another does not: half the deviation.
const EXCHANGED: f64 = 0.25;
/// Squared residual that each changed channel must win, as a part of that of the order that fits
/// best: of orders that fit alike the one with the fewest changes is told.
const CHANGE: f64 = 0.5;
/// The same where the other wheel is not straight opposite.
const CHANGE_ASIDE: f64 = 0.6;
/// Least residual, as a part of that as named: sums are no more exact.
const EXACT: f64 = 1e-6;

/// How a channel's sign is known.
#[derive(Debug, Clone, Copy)]
pub(super) enum Gain {
    /// By these factors on what each channel reads.
    Known([f64; WHEELS]),
    /// Not at all: another test tells signs.
    EitherSign,
}

/// Sums of the channels of a kind, and of what each wheel's should read.
#[derive(Debug, Clone, Default, CheckpointValue)]
pub(super) struct OrderSums {
    /// Time over which they were taken, s.
    pub time_s: f64,
    /// Squares of each channel.
    squares: [f64; WHEELS],
    /// Products by channel and by the wheel whose value is expected.
    found: [[f64; WHEELS]; WHEELS],
    /// Products of expected values.
    expected: [[f64; WHEELS]; WHEELS],
}

/// Squared residuals by channel and by the wheel that it may read, and the order that fits best.
#[derive(Debug, Clone, CheckpointValue)]
pub(super) struct Order {
    costs: [[f64; WHEELS]; WHEELS],
    reads: [usize; WHEELS],
    /// Squared residuals of the channels that the best order changes: as named, in that order, and
    /// what exchanged channels would have as named.
    named: f64,
    exchanged: f64,
    difference: f64,
}

impl OrderSums {
    /// Takes what the channels of `wheels` read and should read.
    pub fn add(
        &mut self,
        wheels: &[usize],
        values: &[f64; WHEELS],
        expected: &[f64; WHEELS],
        dt_s: f64,
    ) {
        self.time_s += dt_s;
        for &i in wheels {
            self.squares[i] += values[i] * values[i] * dt_s;
            for &j in wheels {
                self.found[i][j] += values[i] * expected[j] * dt_s;
                self.expected[i][j] += expected[i] * expected[j] * dt_s;
            }
        }
    }

    /// Size of the channels beside what they should be, whatever their order.
    pub fn size(&self, wheels: &[usize]) -> f64 {
        let squares: f64 = wheels.iter().map(|&i| self.squares[i]).sum();
        let expected: f64 = wheels.iter().map(|&i| self.expected[i][i]).sum();
        (squares / expected.max(f64::MIN_POSITIVE)).sqrt()
    }

    /// Squared difference of what two wheels should read.
    fn difference(&self, i: usize, j: usize) -> f64 {
        (self.expected[i][i] - 2.0 * self.expected[i][j] + self.expected[j][j]).max(0.0)
    }

    fn cost(&self, channel: usize, wheel: usize, gain: Gain) -> f64 {
        let (square, product) = (self.squares[channel], self.found[channel][wheel]);
        let expected = self.expected[wheel][wheel];
        let residual = match gain {
            Gain::Known(factors) => {
                let factor = factors[channel];
                factor * factor * square - 2.0 * factor * product + expected
            }
            Gain::EitherSign => square - 2.0 * product.abs() + expected,
        };
        residual.max(0.0)
    }

    /// The order of `wheels` that fits best. `x_m`: where each wheel is.
    pub fn best(&self, wheels: &[usize], x_m: &[f64; WHEELS], gain: Gain) -> Order {
        let mut costs = [[0.0; WHEELS]; WHEELS];
        for &i in wheels {
            for &j in wheels {
                costs[i][j] = self.cost(i, j, gain);
            }
        }
        let sum = |reads: [usize; WHEELS]| wheels.iter().map(|&i| costs[i][reads[i]]).sum();
        let as_named: f64 = sum(std::array::from_fn(|i| i));
        let least: f64 = sum(assignment(wheels, &costs));
        let mut weighed = costs;
        for &i in wheels {
            for &j in wheels.iter().filter(|&&j| j != i) {
                let is_aside = (x_m[i] - x_m[j]).abs() > 1e-6;
                let change = if is_aside { CHANGE_ASIDE } else { CHANGE };
                weighed[i][j] += change * least.max(EXACT * as_named);
            }
        }
        let mut order = Order {
            costs,
            reads: assignment(wheels, &weighed),
            named: 0.0,
            exchanged: 0.0,
            difference: 0.0,
        };
        for &i in wheels.iter().filter(|&&i| order.reads[i] != i) {
            let wheel = order.reads[i];
            order.named += costs[i][i];
            order.exchanged += costs[i][wheel];
            order.difference += 0.5 * self.difference(i, wheel);
        }
        order
    }
}

impl Order {
    /// The wheel that a channel reads, if another order fits and the order as named does not.
    pub fn other_wheel(&self, channel: usize) -> Option<usize> {
        let is_other = self.exchanged < EXCHANGED * self.named && self.named > self.difference;
        let wheel = self.reads[channel];
        (is_other && wheel != channel).then_some(wheel)
    }

    /// True if exchanged channels would read the same wheels.
    pub fn is_exchange(&self, channel: usize) -> bool {
        self.reads[self.reads[channel]] == channel
    }

    /// True if two channels fit as named, and would not if they were exchanged.
    pub fn tells_apart(&self, i: usize, j: usize) -> bool {
        let named = self.costs[i][i] + self.costs[j][j];
        named < EXCHANGED * (self.costs[i][j] + self.costs[j][i])
    }

    /// Squared residual of the best order.
    pub fn residual(&self, wheels: &[usize]) -> f64 {
        wheels.iter().map(|&i| self.costs[i][self.reads[i]]).sum()
    }
}

/// The cheapest assignment of `wheels` to channels.
fn assignment(wheels: &[usize], costs: &[[f64; WHEELS]; WHEELS]) -> [usize; WHEELS] {
    let mut best: [usize; WHEELS] = std::array::from_fn(|i| i);
    // Each channel fits its own wheel best: no other order can be cheaper.
    let fits = |&i: &usize| wheels.iter().all(|&j| costs[i][i] <= costs[i][j]);
    if wheels.iter().all(fits) {
        return best;
    }
    // Cheapest assignment of the first channels, as many as a set has wheels, to these wheels; and
    // the wheel of the last of them.
    let mut least = [f64::INFINITY; 1 << WHEELS];
    let mut last = [0; 1 << WHEELS];
    least[0] = 0.0;
    let sets = 1 << wheels.len().min(WHEELS);
    for set in 1_usize..sets {
        let channel = wheels[set.count_ones() as usize - 1];
        for (place, &wheel) in wheels.iter().enumerate().filter(|(k, _)| set >> k & 1 == 1) {
            let cost = least[set ^ (1 << place)] + costs[channel][wheel];
            if cost < least[set] {
                (least[set], last[set]) = (cost, place);
            }
        }
    }
    let mut set = sets - 1;
    for &channel in wheels.iter().rev() {
        best[channel] = wheels[last[set]];
        set ^= 1 << last[set];
    }
    best
}
