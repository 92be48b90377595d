//! Order analysis: what the channels show in step with the turns of a wheel.
//!
//! What is wrong with a wheel comes back with each of its turns: a flat tyre, a bent axle, a broken
//! tooth. Of each channel `x` and each order `h` the sum `Σ |Δθ| x e^{-ihθ}` over the wheel's angle
//! `θ`, divided by the root of `Σ Δθ²`, has the variance of `x` if the channel knows nothing of the
//! wheel. Sums beside the order, at angles that no turn repeats, tell that variance in the same
//! turns. All is a function of the angle: a wheel at rest changes nothing.
//!
//! Only what a wheel shows as it turns forward is summed. On the way back the same fault shows with
//! another sign in one channel, and with the same in another.

use std::f64::consts::{PI, TAU};

use nalgebra::Complex;
use vigil_checkpoint::CheckpointValue;

use super::CHANNELS_MAX;

/// Orders: times that something comes back in a turn.
pub const ORDERS: usize = 5;
/// Turns over which sums are forgotten: a few show a fault soon, more show a small one.
pub const MEMORIES_TURNS: [f64; 2] = [8.0, 32.0];
/// Part of a memory that has to be filled before it says something.
const FILLED: f64 = 0.5;
/// Part of the last turns in which an order has to be seen, by squared steps.
const SEEN: f64 = 0.5;
/// Angle over which the mean is forgotten that is taken off a channel, twice, rad. Chosen: changes
/// of speed are slower. The first order keeps 0.4 of its amplitude, as does the noise beside it.
const MEAN_RAD: f64 = 0.7;
/// Where beside an order the noise is looked for.
const BESIDE: [f64; 4] = [-0.42, -0.3, 0.3, 0.42];
/// A reading of this magnitude or more is none: sums of it would not be finite for long.
const READING_MAX: f64 = 1e100;
/// A wheel whose rate was not read for this long stands, as far as anybody knows, s.
const UNREAD_S: f64 = 0.5;
/// Angle after which the phases of all orders and of what is beside them come back, rad: each of
/// [`BESIDE`] is a multiple of a fiftieth.
const PERIOD_RAD: f64 = 50.0 * TAU;

/// A number for each order.
pub type ByOrder = [Complex<f64>; ORDERS];

/// What the channels show in step with one wheel.
#[derive(Debug, Clone, PartialEq, CheckpointValue)]
pub struct WheelOrders {
    /// The wheel.
    pub wheel: usize,
    /// Turns over which sums are forgotten.
    pub memory_turns: f64,
    /// How far it has turned forward in this record, turns.
    pub turns: f64,
    /// By how much the amplitude of what comes back exceeds that in a single frame: the root of the
    /// number of frames that are remembered.
    pub gain: f64,
    /// Amplitude of each channel in each order, in the channel's unit: order by order within each
    /// channel.
    pub amplitudes: Vec<Complex<f64>>,
    /// Mean square of the amplitude beside each order, likewise; none if the last turns hardly show
    /// it.
    pub beside: Vec<Option<f64>>,
    /// What comes back with the turns of another wheel shows here, too: by that wheel, its
    /// amplitude here over that with its own wheel. As large on wheels that turn alike.
    pub shared: Vec<(usize, ByOrder)>,
}

impl WheelOrders {
    /// True if the wheel has turned far enough to say anything.
    #[must_use]
    pub fn is_told(&self) -> bool {
        self.is_filled_by(self.turns)
    }

    /// True if so many turns fill enough of the memory to say anything.
    #[must_use]
    pub fn is_filled_by(&self, turns: f64) -> bool {
        turns >= FILLED * self.memory_turns
    }

    /// The gain of what came back only in so many turns, the last ones.
    #[must_use]
    pub fn gain_since(&self, turns: f64) -> f64 {
        let remembered = |turns: f64| 1.0 - (-turns / self.memory_turns).exp();
        self.gain * over(remembered(turns), remembered(self.turns))
    }

    /// What the turns of another wheel leave here.
    #[must_use]
    pub fn shared_with(&self, wheel: usize) -> ByOrder {
        let shared = self.shared.iter().find(|(other, _)| *other == wheel);
        shared.map_or_else(ByOrder::default, |(_, by_order)| *by_order)
    }
}

/// Sums of one channel and order: at the order, beside it, and of the squared steps in which it was
/// seen.
#[derive(Debug, Clone, Copy, Default, CheckpointValue)]
struct Sums {
    at: Complex<f64>,
    beside: [Complex<f64>; BESIDE.len()],
    square: f64,
}

impl Sums {
    /// Forgets all but a part.
    fn fade(&mut self, kept: f64) {
        self.at *= kept;
        self.beside.iter_mut().for_each(|sum| *sum *= kept);
        self.square *= kept * kept;
    }

    /// Adds what a step of so much angle shows in a phase of the order.
    fn add(&mut self, angle_rad: f64, shown: Complex<f64>, aside: &[Complex<f64>; BESIDE.len()]) {
        self.at += shown * angle_rad;
        for (sum, aside) in self.beside.iter_mut().zip(aside) {
            *sum += shown * aside * angle_rad;
        }
        self.square += angle_rad * angle_rad;
    }
}

/// Means that are taken off a channel.
#[derive(Debug, Clone, Copy, Default, CheckpointValue)]
struct Means {
    /// Of the readings, and of what is left once that is taken off; none before the first reading.
    means: Option<[f64; 2]>,
    /// Angle since the last reading, rad.
    since_rad: f64,
}

impl Means {
    /// What is left of a reading once the means are taken off.
    fn taken_off(&mut self, reading: f64) -> f64 {
        let part = 1.0 - (-std::mem::take(&mut self.since_rad) / MEAN_RAD).exp();
        let [mean, rest] = self.means.get_or_insert([reading, 0.0]);
        let once = reading - *mean;
        *mean += part * once;
        let twice = once - *rest;
        *rest += part * twice;
        twice
    }
}

/// How a wheel turns.
#[derive(Debug, Clone, CheckpointValue)]
struct Turns {
    /// Place of the wheel's rate among the channels.
    rate: usize,
    wheel: usize,
    rate_rad_s: f64,
    unread_s: f64,
    /// Angle of the newest frame, rad.
    step_rad: f64,
    angle_rad: f64,
    turns: f64,
}

impl Turns {
    const fn new(rate: usize, wheel: usize) -> Self {
        Self {
            rate,
            wheel,
            rate_rad_s: 0.0,
            unread_s: 0.0,
            step_rad: 0.0,
            angle_rad: 0.0,
            turns: 0.0,
        }
    }

    /// Turns on for `dt_s`: a wheel whose rate is not read as before for a while.
    fn turn(&mut self, dt_s: f64, readings: &[Option<f64>; CHANNELS_MAX]) {
        self.unread_s += dt_s;
        match readings[self.rate] {
            Some(rate_rad_s) => (self.rate_rad_s, self.unread_s) = (rate_rad_s, 0.0),
            None if self.unread_s >= UNREAD_S => self.rate_rad_s = 0.0,
            None => {}
        }
        self.step_rad = self.rate_rad_s * dt_s;
        self.angle_rad = (self.angle_rad + self.step_rad) % PERIOD_RAD;
        self.turns += self.step_rad.max(0.0) / TAU;
    }
}

/// What one wheel shows of a frame in which it turns forward.
struct Shown {
    angle_rad: f64,
    phases: ByOrder,
    /// Orders for which frames come often enough.
    seen: usize,
    aside: [Complex<f64>; BESIDE.len()],
    /// What is left of the channels once their means are taken off.
    left: [Option<f64>; CHANNELS_MAX],
}

impl Shown {
    /// None if the wheel stands, or turns back.
    fn new(
        turns: &Turns,
        means: &mut [Means],
        readings: &[Option<f64>; CHANNELS_MAX],
    ) -> Option<Self> {
        let angle_rad = turns.step_rad.abs();
        let mut left = [None; CHANNELS_MAX];
        for ((left, means), reading) in left.iter_mut().zip(means).zip(readings) {
            means.since_rad += angle_rad;
            let reading = reading.filter(|reading| reading.abs() < READING_MAX);
            *left = reading.map(|reading| means.taken_off(reading));
        }
        // An order that comes back within two frames is not seen.
        let seen = (0..ORDERS).filter(|order| (*order as f64 + 1.5) * angle_rad < PI);
        let phase = |order: usize| -((order + 1) as f64) * turns.angle_rad;
        (turns.step_rad > 0.0).then(|| Self {
            angle_rad,
            phases: std::array::from_fn(|order| Complex::from_polar(1.0, phase(order))),
            seen: seen.count(),
            aside: BESIDE.map(|order| Complex::from_polar(1.0, -order * turns.angle_rad)),
            left,
        })
    }
}

/// What is remembered of one wheel's turns.
#[derive(Debug, Clone, CheckpointValue)]
struct Memory {
    turns: f64,
    sums: Vec<Sums>,
    /// Sums of all steps and of their squares.
    length: f64,
    square: f64,
    /// For each wheel what is left of its turns in the orders of this one.
    shared: Vec<ByOrder>,
}

impl Memory {
    fn new(turns: f64, wheels: usize, channels: usize) -> Self {
        Self {
            turns,
            sums: vec![Sums::default(); ORDERS * channels],
            length: 0.0,
            square: 0.0,
            shared: vec![ByOrder::default(); wheels],
        }
    }

    fn clear(&mut self) {
        self.sums.fill(Sums::default());
        self.shared.fill(ByOrder::default());
        (self.length, self.square) = (0.0, 0.0);
    }

    fn take(&mut self, own: usize, all: &[Turns], shown: &Shown) {
        let angle_rad = shown.angle_rad;
        let kept = (-angle_rad / (TAU * self.turns)).exp();
        self.length = kept * self.length + angle_rad;
        self.square = kept * kept * self.square + angle_rad * angle_rad;
        for (sums, left) in self.sums.chunks_mut(ORDERS).zip(&shown.left) {
            for (order, sums) in sums.iter_mut().enumerate() {
                sums.fade(kept);
                if let Some(left) = left.filter(|_| order < shown.seen) {
                    sums.add(angle_rad, shown.phases[order] * left, &shown.aside);
                }
            }
        }
        for (shared, other) in self.shared.iter_mut().zip(all) {
            let apart_rad = other.angle_rad - all[own].angle_rad;
            for (order, sum) in shared.iter_mut().enumerate() {
                let phase = Complex::from_polar(angle_rad, (order + 1) as f64 * apart_rad);
                *sum = *sum * kept + phase;
            }
        }
    }

    fn gain(&self) -> f64 {
        over(self.length, self.square.sqrt())
    }
}

/// The quotient; 0 if the denominator is 0.
pub(super) fn over(numerator: f64, denominator: f64) -> f64 {
    if denominator > 0.0 {
        numerator / denominator
    } else {
        0.0
    }
}

/// One wheel.
#[derive(Debug, Clone, CheckpointValue)]
struct TrackedWheel {
    means: Vec<Means>,
    memories: [Memory; MEMORIES_TURNS.len()],
}

/// Follows the turns of wheels.
#[derive(Debug, Clone, CheckpointValue)]
pub(super) struct OrderTracker {
    turns: Vec<Turns>,
    wheels: Vec<TrackedWheel>,
    found: Vec<WheelOrders>,
}

impl OrderTracker {
    /// Of wheels whose rates are at these places among so many channels.
    pub fn new(rates: &[(usize, usize)], channels: usize) -> Self {
        let turns: Vec<Turns> = rates
            .iter()
            .map(|&(rate, wheel)| Turns::new(rate, wheel))
            .collect();
        let tracked = || TrackedWheel {
            means: vec![Means::default(); channels],
            memories: MEMORIES_TURNS.map(|memory| Memory::new(memory, rates.len(), channels)),
        };
        let orders = |(turns, memory_turns): (&Turns, f64)| WheelOrders {
            wheel: turns.wheel,
            memory_turns,
            turns: 0.0,
            gain: 0.0,
            amplitudes: vec![Complex::default(); ORDERS * channels],
            beside: vec![None; ORDERS * channels],
            shared: rates
                .iter()
                .map(|&(_, wheel)| (wheel, ByOrder::default()))
                .collect(),
        };
        let all = turns.iter();
        Self {
            found: all
                .flat_map(|turns| MEMORIES_TURNS.map(|memory| orders((turns, memory))))
                .collect(),
            wheels: turns.iter().map(|_| tracked()).collect(),
            turns,
        }
    }

    /// Begins a new record.
    pub fn clear(&mut self) {
        for turns in &mut self.turns {
            *turns = Turns::new(turns.rate, turns.wheel);
        }
        for wheel in &mut self.wheels {
            wheel.means.fill(Means::default());
            wheel.memories.iter_mut().for_each(Memory::clear);
        }
    }

    /// Takes the readings of a frame that comes `dt_s` after the last one.
    pub fn take(&mut self, dt_s: f64, readings: &[Option<f64>; CHANNELS_MAX]) {
        for turns in &mut self.turns {
            turns.turn(dt_s, readings);
        }
        for (own, wheel) in self.wheels.iter_mut().enumerate() {
            let Some(shown) = Shown::new(&self.turns[own], &mut wheel.means, readings) else {
                continue;
            };
            for memory in &mut wheel.memories {
                memory.take(own, &self.turns, &shown);
            }
        }
    }

    /// What the last turns showed when it was summed up last: of each wheel with each of
    /// [`MEMORIES_TURNS`].
    pub fn found(&self) -> &[WheelOrders] {
        &self.found
    }

    /// Sums up what the last turns show.
    pub fn sum_up(&mut self) {
        for (i, found) in self.found.iter_mut().enumerate() {
            let (own, of) = (i / MEMORIES_TURNS.len(), i % MEMORIES_TURNS.len());
            let memory = &self.wheels[own].memories[of];
            (found.turns, found.gain) = (self.turns[own].turns, memory.gain());
            let places = found.amplitudes.iter_mut().zip(&mut found.beside);
            for ((amplitude, beside), sums) in places.zip(&memory.sums) {
                let is_seen = sums.square > SEEN * memory.square;
                let per = if is_seen { 1.0 / sums.square } else { 0.0 };
                let square: f64 = sums.beside.iter().map(Complex::norm_sqr).sum();
                *amplitude = sums.at * per.sqrt();
                *beside = is_seen.then(|| per * square / BESIDE.len() as f64);
            }
            for (other, (_, shared)) in found.shared.iter_mut().enumerate() {
                let gain = self.wheels[other].memories[of].gain();
                let per = over(1.0, gain * memory.square.sqrt());
                *shared = memory.shared[other].map(|sum| sum * per);
            }
        }
    }
}

#[cfg(test)]
mod tests;
