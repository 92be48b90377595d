//! The passes: what each mode says, every mode of every particle, the draw, the move.

use super::super::cloud::CHUNK;
use super::super::elementary::{ROUNDER, exp2};
use super::super::model::MODES_MAX;
use super::super::vector::{Block, Kernel, LANES, Lanes};
use super::model::{Differences, LinearModel};
use super::reference::Look;

/// Base-2 logarithm of what a pair must have of the likeliest pair's probability to be possible.
/// Far above the least number, so that what remains after subtracting it is a normal number.
const LOG2_MIN: f32 = -100.0;

/// What is far below this becomes 0. Distances between particles of equal modes shrink in every
/// step, and with numbers below the normal ones arithmetic is a hundred times slower.
const TINY: f32 = 1.0 / (1_u64 << 40) as f32;

/// A pair of mode and parent is one word: the mode above this many bits of the parent's index.
const INDEX_BITS: u32 = 24;

const _: () = assert!(
    super::super::steps::PARTICLES_MAX + LANES <= 1 << INDEX_BITS
        && MODES_MAX << INDEX_BITS <= 1 << 31
);

/// All buffers of a filter; none grows.
#[derive(Debug, Clone)]
pub(super) struct Cloud<const N: usize> {
    /// Distances from the reference, by dimension.
    pub state: [Vec<Block<f32>>; N],
    pub mode: Vec<Block<u32>>,
    /// Room for the children.
    next: [Vec<Block<f32>>; N],
    /// For each mode the weights of all particles in it.
    weights: Vec<Block<f32>>,
    /// Weights of the particles, all modes together.
    parents: Vec<Block<f32>>,
    /// At the first child of each pair that has one, the pair; 0 elsewhere. One block more, for
    /// those that have none.
    first: Vec<Block<u32>>,
}

impl<const N: usize> Cloud<N> {
    /// `blocks` times 16 particles at the reference, in mode 0.
    pub(super) fn new(blocks: usize, modes: usize) -> Self {
        let zeros = || vec![Block::splat(0.0); blocks];
        Self {
            state: std::array::from_fn(|_| zeros()),
            mode: vec![Block::splat(0); blocks],
            next: std::array::from_fn(|_| zeros()),
            weights: vec![Block::splat(0.0); blocks * modes],
            parents: zeros(),
            first: vec![Block::splat(0); blocks + 1],
        }
    }

    pub(super) const fn count(&self) -> usize {
        self.mode.len() * LANES
    }
}

/// What the look ahead found; weights are relative to the likeliest pair's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Found {
    /// Base-2 logarithm of the likeliest pair's weight.
    pub log2_unit: f32,
    /// Sum of the weights of each mode.
    pub modes: [f64; MODES_MAX],
    /// Sum of all.
    pub total: f64,
    /// Sum of the squares of the particles' weights.
    pub squares: f64,
    /// False if a child has left the range of numbers.
    pub stays_finite: bool,
}

impl Found {
    pub(super) const NOTHING: Self = Self {
        log2_unit: 0.0,
        modes: [0.0; MODES_MAX],
        total: 0.0,
        squares: 0.0,
        stays_finite: false,
    };

    /// True if there is a pair to draw.
    fn is_possible(&self) -> bool {
        self.log2_unit.is_finite() && self.total.is_finite() && self.total > 0.0
    }
}

/// One step of all particles, if any is possible.
pub(super) struct Advance<'a, const N: usize, const M: usize, const W: usize> {
    pub model: &'a LinearModel<N, M, W>,
    pub differences: &'a Differences<N, M, W>,
    pub look: &'a Look<N, M, W>,
    pub cloud: &'a mut Cloud<N>,
    /// Uniform in (0, 1).
    pub u: f64,
    pub found: &'a mut Found,
}

impl<const N: usize, const M: usize, const W: usize> Kernel for Advance<'_, N, M, W> {
    #[inline(always)]
    fn run<L: Lanes>(self, l: L) {
        let Self {
            model,
            differences,
            look,
            cloud,
            u,
            found,
        } = self;
        let by_mode = ByMode::new(l, look, differences);
        found.log2_unit = weigh(l, look, &by_mode, &model.log_p, cloud);
        sum_up(l, model.log_p.len(), cloud, found);
        if found.is_possible() {
            select(l, model.log_p.len(), cloud, u, found);
            found.stays_finite = follow(l, look, &by_mode, cloud);
        }
    }
}

/// A lane for each mode.
struct ByMode<const N: usize, const M: usize> {
    /// s.
    shift: [Block<f32>; M],
    /// `-½ s·s`, and what the rates say.
    log: Block<f32>,
    /// What is added to the distance from the reference.
    step: [Block<f32>; N],
}

impl<const N: usize, const M: usize> ByMode<N, M> {
    #[inline(always)]
    fn new<L: Lanes, const W: usize>(
        l: L,
        look: &Look<N, M, W>,
        differences: &Differences<N, M, W>,
    ) -> Self {
        let mut by_mode = Self {
            shift: [Block::splat(0.0); M],
            log: Block::splat(0.0),
            step: differences.shift,
        };
        let (half, mut log) = (l.real(-0.5), l.real(0.0));
        for (to, whiten) in by_mode.shift.iter_mut().zip(&look.whiten) {
            let mut shift = l.real(0.0);
            for (factor, offset) in whiten.iter().zip(&differences.offset) {
                shift = l.mul_add(l.real(*factor), l.load(offset), shift);
            }
            shift = settled(l, shift);
            log = l.mul_add(l.mul(shift, half), shift, log);
            l.store(shift, to);
        }
        for (rate, apart) in look.rates.iter().zip(&differences.rates) {
            if let Some(rate) = rate {
                let apart = l.load(apart);
                log = l.mul_add(l.mul_add(apart, half, l.real(*rate)), apart, log);
            }
        }
        l.store(log, &mut by_mode.log);
        for (to, back) in by_mode.step.iter_mut().zip(&look.back) {
            let mut step = l.load(to);
            for (factor, shift) in back.iter().zip(&by_mode.shift) {
                step = l.mul_add(l.real(-factor), l.load(shift), step);
            }
            l.store(step, to);
        }
        by_mode
    }
}

/// The number, or 0 far below [`TINY`].
#[inline(always)]
fn settled<L: Lanes>(l: L, value: L::Real) -> L::Real {
    l.sub(l.add(value, l.real(TINY)), l.real(TINY))
}

/// Base-2 logarithms of all weights, relative to the reference's density; returns the largest.
#[inline(always)]
fn weigh<L: Lanes, const N: usize, const M: usize, const W: usize>(
    l: L,
    look: &Look<N, M, W>,
    by_mode: &ByMode<N, M>,
    log_p: &[Block<f32>],
    cloud: &mut Cloud<N>,
) -> f32 {
    let blocks = cloud.mode.len();
    let mut highest = l.real(f32::MIN);
    for (b, mode) in cloud.mode.iter().enumerate() {
        let mode = l.load_word(mode);
        let (mut own, mut away) = (l.real(0.0), [l.real(0.0); M]);
        for (m, away) in away.iter_mut().enumerate() {
            let mut apart = l.real(0.0);
            for (n, state) in cloud.state.iter().enumerate() {
                apart = l.mul_add(l.real(look.sight[m][n]), l.load(&state[b]), apart);
            }
            let (apart, at) = (settled(l, apart), l.real(look.innovation[m]));
            own = l.mul_add(apart, l.mul_add(apart, l.real(-0.5), at), own);
            *away = l.sub(at, apart);
        }
        for (k, log_p) in log_p.iter().enumerate() {
            let mut log = l.add(l.look_up(log_p, mode), l.real(by_mode.log.0[k]));
            log = l.add(log, own);
            for (away, shift) in away.iter().zip(&by_mode.shift) {
                log = l.mul_add(*away, l.real(shift.0[k]), log);
            }
            // In this order what is not a number is never the highest.
            highest = l.max(log, highest);
            l.store(log, &mut cloud.weights[k * blocks + b]);
        }
    }
    let mut lanes = Block::splat(0.0);
    l.store(highest, &mut lanes);
    lanes
        .0
        .into_iter()
        .fold(f32::MIN, |a, b| if b > a { b } else { a })
}

/// Weights from their logarithms, and their sums.
#[inline(always)]
fn sum_up<L: Lanes, const N: usize>(l: L, modes: usize, cloud: &mut Cloud<N>, found: &mut Found) {
    let unit = l.real(found.log2_unit);
    let (lowest, zero) = (l.real(LOG2_MIN), l.real(0.0));
    // The lowest becomes exactly 0: what is impossible stays so.
    let least = exp2(l, lowest);
    cloud.parents.fill(Block::splat(0.0));
    found.modes = [0.0; MODES_MAX];
    let by_mode = cloud.weights.chunks_exact_mut(cloud.mode.len()).take(modes);
    for (to, weights) in found.modes.iter_mut().zip(by_mode) {
        let chunks = weights.chunks_mut(CHUNK);
        for (weights, parents) in chunks.zip(cloud.parents.chunks_mut(CHUNK)) {
            let mut sum = zero;
            for (weight, parent) in weights.iter_mut().zip(parents) {
                let log = l.max(l.sub(l.load(weight), unit), lowest);
                let found = l.max(l.sub(exp2(l, log), least), zero);
                sum = l.add(sum, found);
                l.store(found, weight);
                l.store(l.add(l.load(parent), found), parent);
            }
            *to += f64::from(l.last(l.prefix_sum(sum)));
        }
    }
    found.total = found.modes.iter().sum();
    found.squares = 0.0;
    for parents in cloud.parents.chunks(CHUNK) {
        let mut squares = zero;
        for parent in parents {
            let weight = settled(l, l.load(parent));
            squares = l.mul_add(weight, weight, squares);
        }
        found.squares += f64::from(l.last(l.prefix_sum(squares)));
    }
}

/// Where the weights before `sum` end among the children: whole ones, and the rest.
#[derive(Clone, Copy)]
struct Comb {
    per_weight: f64,
    u: f64,
}

impl Comb {
    #[inline(always)]
    fn split(self, sum: f64) -> (i32, f32) {
        let at = sum * self.per_weight + (self.u - 0.5);
        let whole = (at + 1.0) as i32 - 1;
        (whole, (at - f64::from(whole)) as f32)
    }

    /// The first child of what begins here, rounded exactly as the lanes round.
    #[inline(always)]
    fn first(self, sum: f64) -> i32 {
        let (whole, rest) = self.split(sum);
        whole + ((rest + ROUNDER) - ROUNDER) as i32
    }
}

/// Draws pairs of mode and parent: systematic, mode by mode. Modes without children are passed
/// over.
#[inline(always)]
fn select<L: Lanes, const N: usize>(
    l: L,
    modes: usize,
    cloud: &mut Cloud<N>,
    u: f64,
    found: &Found,
) {
    let count = cloud.count();
    let per_weight = count as f64 / found.total;
    let (comb, scale) = (Comb { per_weight, u }, l.real(per_weight as f32));
    let lane = l.load_word(&Block(std::array::from_fn(|lane| lane as u32)));
    let nowhere = l.word(count as u32);
    let (mut sum, mut first) = (0.0, 0);
    let by_mode = cloud.weights.chunks_exact(cloud.mode.len()).take(modes);
    for (mode, weights) in by_mode.enumerate() {
        let (mut at, end) = (sum, sum + found.modes[mode]);
        let next = if mode + 1 == modes {
            count as i32
        } else {
            comb.first(end)
        };
        if first < next {
            let mut pair = l.add_word(lane, l.word((mode as u32) << INDEX_BITS));
            for weights in weights {
                let weights = l.load(weights);
                let prefix = l.prefix_sum(weights);
                let (whole, rest) = comb.split(at);
                let slot = l.mul_add(l.before(prefix), scale, l.real(rest));
                let slot = l.bits(l.add(slot, l.real(ROUNDER)));
                let offset = (whole as u32).wrapping_sub(ROUNDER.to_bits());
                let slot = l.add_word(slot, l.word(offset));
                let slot = l.select_less(l.word(0), l.bits(weights), slot, nowhere);
                l.scatter(&mut cloud.first, slot, pair);
                pair = l.add_word(pair, l.word(LANES as u32));
                at += f64::from(l.last(prefix));
            }
        }
        (sum, first) = (end, next);
    }
}

/// Puts the children in the place of their parents, moved; false if one is beyond all numbers.
#[inline(always)]
fn follow<L: Lanes, const N: usize, const M: usize, const W: usize>(
    l: L,
    look: &Look<N, M, W>,
    by_mode: &ByMode<N, M>,
    cloud: &mut Cloud<N>,
) -> bool {
    let (mut latest, zero) = (l.word(0), l.real(0.0));
    let mut check = zero;
    for b in 0..cloud.mode.len() {
        let first = &mut cloud.first[b];
        let pair = l.max_word(l.prefix_max(l.load_word(first)), latest);
        l.store_word(l.word(0), first);
        latest = l.last_word(pair);
        let mode = l.shift_right(pair, INDEX_BITS);
        let parent = l.and(pair, l.word((1 << INDEX_BITS) - 1));
        let from: [L::Real; N] = std::array::from_fn(|n| l.pick(&cloud.state[n], parent));
        for (n, to) in cloud.next.iter_mut().enumerate() {
            let mut state = l.look_up(&by_mode.step[n], mode);
            for (from, factor) in from.iter().zip(&look.motion[n]) {
                state = l.mul_add(l.real(*factor), *from, state);
            }
            state = settled(l, state);
            // 0 unless it is not finite.
            check = l.mul_add(state, zero, check);
            l.store(state, &mut to[b]);
        }
        l.store_word(mode, &mut cloud.mode[b]);
    }
    std::mem::swap(&mut cloud.state, &mut cloud.next);
    l.last(l.prefix_sum(check)) == 0.0
}
