//! The passes over the particles: move and weigh, weigh again, select.

use std::slice::Iter;

use super::cloud::{CHUNK, Cloud, Sums, address};
use super::elementary::{EXPONENT_MIN, ROUNDER, exp2, sin_cos, wrap};
use super::model::{MODES_MAX, PlanarModel};
use super::random::{Draws, Streams};
use super::vector::{Block, Bundle, Gathered, Kernel, LANES, Lanes};
use super::weighing::Weighing;

/// Where a particle of the next step comes from, and what weight it brings along.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Ancestry {
    /// From the particle of [`Cloud::first`], with weight 1.
    Selected,
    /// From the particle of the same index, with the weight of [`Cloud::logs`] times `2^-offset`;
    /// the mean of these is 1. Without logs they are 1.
    Same {
        /// Base-2 logarithm.
        offset: f32,
    },
}

/// Moves all particles by one step and weighs them; adds to `sums`.
pub(super) struct Advance<'a> {
    pub model: &'a PlanarModel,
    pub weighing: &'a Weighing,
    pub ancestry: Ancestry,
    pub cloud: &'a mut Cloud,
    pub streams: &'a mut Streams,
    pub sums: &'a mut Sums,
}

/// Weighs the particles as they are, with the largest weight as the unit; adds to `sums`.
pub(super) struct Reweigh<'a> {
    pub weighing: &'a Weighing,
    pub ancestry: Ancestry,
    pub cloud: &'a mut Cloud,
    pub sums: &'a mut Sums,
    /// Base-2 logarithm of the unit, for the caller.
    pub unit: &'a mut f32,
}

/// Draws ancestors by systematic resampling; `u` is uniform in (0, 1), `total` the sum of weights.
pub(super) struct Select<'a> {
    pub cloud: &'a mut Cloud,
    pub total: f64,
    pub u: f64,
}

/// Sums of one chunk, lane by lane.
struct Distances<L: Lanes>([L::Real; 3]);

impl<L: Lanes> Distances<L> {
    #[inline(always)]
    fn zero(l: L) -> Self {
        Self([l.real(0.0); 3])
    }

    #[inline(always)]
    fn add(&mut self, l: L, weight: L::Real, distance: [L::Real; 3]) {
        for (sum, distance) in self.0.iter_mut().zip(distance) {
            *sum = l.mul_add(weight, distance, *sum);
        }
    }

    #[inline(always)]
    fn flush(self, l: L, sums: &mut Sums) {
        for (sum, lanes) in sums.distance.iter_mut().zip(self.0) {
            *sum += l.total(lanes);
        }
    }
}

/// What weighs a particle, in registers.
#[derive(Clone, Copy)]
struct Scale<'a, L: Lanes> {
    reference: [L::Real; 3],
    /// Negative.
    precision: [L::Real; 3],
    modes: &'a Block<f32>,
}

impl<'a, L: Lanes> Scale<'a, L> {
    #[inline(always)]
    fn new(l: L, weighing: &'a Weighing) -> Self {
        Self {
            reference: weighing.reference.map(|at| l.real(at)),
            precision: weighing.precision.map(|precision| l.real(-precision)),
            modes: &weighing.modes,
        }
    }

    /// Base-2 logarithm of the likelihood, and the distance from the reference.
    #[inline(always)]
    fn weigh(self, l: L, at: &Gathered<L>) -> (L::Real, [L::Real; 3]) {
        let distance = [
            l.sub(self.reference[0], at.x),
            l.sub(self.reference[1], at.y),
            wrap(l, l.sub(self.reference[2], at.yaw)),
        ];
        let mut log = l.look_up(self.modes, at.mode);
        for (distance, precision) in distance.into_iter().zip(self.precision) {
            log = l.mul_add(l.mul(distance, distance), precision, log);
        }
        (log, distance)
    }
}

/// The weight `2^log`; what underflows counts as the least normal number.
#[inline(always)]
fn weight<L: Lanes>(l: L, log: L::Real) -> L::Real {
    exp2(l, l.max(log, l.real(EXPONENT_MIN)))
}

/// Bundles that go through one stage of a step before any goes through the next. In each stage
/// the calculations of several bundles overlap; what is handed over stays in the fastest cache.
const STAGED: usize = 16;

/// What one stage hands to the next, beside the bundles.
struct Staged {
    /// For each axis standard normal draws.
    normals: [[Block<f32>; 3]; STAGED],
    /// Uniform words.
    draws: [Block<u32>; STAGED],
    /// Base-2 logarithms of the weights that the particles bring along.
    brought: [Block<f32>; STAGED],
}

/// Draws for up to [`STAGED`] bundles, an even number.
#[inline(always)]
fn draw<L: Lanes>(l: L, from: &mut Draws<L>, bundles: usize, staged: &mut Staged) {
    let normals = staged.normals.as_chunks_mut::<2>().0.iter_mut();
    let words = staged.draws.as_chunks_mut::<2>().0;
    // In pairs: three draws for each of two bundles are three pairs of draws.
    for (normals, words) in normals.zip(words).take(bundles / 2) {
        let mut last = from.normals();
        for (normals, word) in normals.iter_mut().zip(words) {
            let (first, second) = from.normals();
            l.store(first, &mut normals[0]);
            l.store(second, &mut normals[1]);
            l.store(last.0, &mut normals[2]);
            last = (last.1, last.0);
            l.store_word(from.word(), word);
        }
    }
}

/// Fetches the ancestors into `next` and draws their next modes.
#[inline(always)]
fn fetch<L: Lanes>(
    l: L,
    origins: &mut Origins<'_, L>,
    (from, alias): (&[Bundle], &[u32; MODES_MAX * LANES]),
    (next, first): (&mut [Bundle], &mut [Block<u32>]),
    staged: &mut Staged,
) {
    let drawn = staged.draws.iter().zip(&mut staged.brought);
    for ((next, first), (draw, kept)) in next.iter_mut().zip(first).zip(drawn) {
        let (at, brought) = origins.next(l, first);
        l.store(brought, kept);
        let ancestor = l.gather(from, at);
        l.store(ancestor.x, &mut next.x);
        l.store(ancestor.y, &mut next.y);
        l.store(ancestor.yaw, &mut next.yaw);
        let draw = l.load_word(draw);
        let column = l.shift_right(draw, 28);
        let entry = l.look_up_entry(alias, l.or(l.shift_left(ancestor.mode, 4), column));
        let mode = l.select_less(
            l.and(draw, l.word(0x0fff_ffff)),
            l.shift_right(entry, 4),
            column,
            l.and(entry, l.word(15)),
        );
        l.store_word(mode, &mut next.mode);
    }
}

/// The pose after a step in the mode `at.mode`.
#[inline(always)]
fn moved<L: Lanes>(
    l: L,
    model: &PlanarModel,
    at: &Gathered<L>,
    normals: &[Block<f32>; 3],
) -> Gathered<L> {
    let mode = at.mode;
    let (sine, cosine) = sin_cos(l, at.yaw);
    let (dx, dy) = (l.look_up(&model.dx, mode), l.look_up(&model.dy, mode));
    let turn = l.look_up(&model.dyaw, mode);
    let [sx, sy, syaw] = model.motion_sd.map(|sd| l.real(sd));
    let [nx, ny, nyaw] = normals.each_ref().map(|n| l.load(n));
    let x = l.mul_add(sx, nx, at.x);
    let x = l.mul_add(cosine, dx, x);
    let x = l.sub(x, l.mul(sine, dy));
    let y = l.mul_add(sy, ny, at.y);
    let y = l.mul_add(sine, dx, y);
    let y = l.mul_add(cosine, dy, y);
    let yaw = wrap(l, l.mul_add(syaw, nyaw, l.add(at.yaw, turn)));
    Gathered { x, y, yaw, mode }
}

impl Kernel for Advance<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self, l: L) {
        let Self {
            model,
            weighing,
            ancestry,
            cloud,
            streams,
            sums,
        } = self;
        let mut draws = Draws::begin(l, streams);
        let scale = Scale::new(l, weighing);
        let mut origins = Origins::new(l, ancestry, &cloud.logs);
        let mut staged = Staged {
            normals: [[Block::splat(0.0); 3]; STAGED],
            draws: [Block::splat(0); STAGED],
            brought: [Block::splat(0.0); STAGED],
        };
        let from = (cloud.bundles.as_slice(), &model.alias);
        let mut next_logs = cloud.next_logs.chunks_mut(STAGED);
        let mut first = cloud.first.chunks_mut(STAGED);
        let chunks = cloud
            .next
            .chunks_mut(CHUNK)
            .zip(cloud.weights.chunks_mut(CHUNK));
        for (next, weights) in chunks {
            let mut distances = Distances::zero(l);
            let stages = next.chunks_mut(STAGED).zip(weights.chunks_mut(STAGED));
            for ((next, weights), first) in stages.zip(&mut first) {
                draw(l, &mut draws, next.len(), &mut staged);
                fetch(l, &mut origins, from, (next, first), &mut staged);
                let mut kept = next_logs.next().unwrap_or_default().iter_mut();
                let handed = staged.normals.iter().zip(&staged.brought);
                for ((bundle, weights), (normals, brought)) in
                    next.iter_mut().zip(weights).zip(handed)
                {
                    let at = moved(l, model, &loaded(l, bundle), normals);
                    l.store(at.x, &mut bundle.x);
                    l.store(at.y, &mut bundle.y);
                    l.store(at.yaw, &mut bundle.yaw);
                    let (log, distance) = scale.weigh(l, &at);
                    let log = l.add(log, l.load(brought));
                    if let Some(kept) = kept.next() {
                        l.store(log, kept);
                    }
                    let weight = weight(l, log);
                    distances.add(l, weight, distance);
                    l.store(weight, weights);
                }
            }
            distances.flush(l, sums);
            summarise(l, next, weights, sums);
        }
        draws.end(streams);
    }
}

/// Where the particles of one bundle after the other come from.
pub(super) struct Origins<'a, L: Lanes> {
    /// Latest address of a selected particle.
    latest: L::Word,
    /// Addresses in the bundle itself, if nothing was selected.
    own: Option<L::Word>,
    logs: Iter<'a, Block<f32>>,
    offset: L::Real,
}

impl<'a, L: Lanes> Origins<'a, L> {
    #[inline(always)]
    pub(super) fn new(l: L, ancestry: Ancestry, logs: &'a [Block<f32>]) -> Self {
        let lane = Block(std::array::from_fn(|lane| lane as u32));
        let (own, logs, offset) = match ancestry {
            Ancestry::Selected => (None, [].iter(), 0.0),
            Ancestry::Same { offset } => (Some(l.load_word(&lane)), logs.iter(), offset),
        };
        Self {
            latest: l.word(0),
            own,
            logs,
            offset: l.real(offset),
        }
    }

    /// Addresses of the ancestors, and the logarithms of the weights that they bring along. Clears
    /// `first`.
    #[inline(always)]
    pub(super) fn next(&mut self, l: L, first: &mut Block<u32>) -> (L::Word, L::Real) {
        if let Some(own) = self.own {
            self.own = Some(l.add_word(own, l.word(address(1))));
            let logs = self.logs.next();
            let brought = logs.map_or(l.real(0.0), |log| l.sub(l.load(log), self.offset));
            return (own, brought);
        }
        let at = l.max_word(l.prefix_max(l.load_word(first)), self.latest);
        l.store_word(l.word(0), first);
        self.latest = l.last_word(at);
        (at, l.real(0.0))
    }
}

/// Adds a chunk's weights to `sums`, and turns them into prefix sums within each block.
#[inline(always)]
fn summarise<L: Lanes>(l: L, bundles: &[Bundle], weights: &mut [Block<f32>], sums: &mut Sums) {
    let mut modes = [l.real(0.0); MODES_MAX];
    let mut squares = l.real(0.0);
    for (bundle, weights) in bundles.iter().zip(weights) {
        let (mode, weight) = (l.load_word(&bundle.mode), l.load(weights));
        for (k, sum) in modes.iter_mut().enumerate() {
            *sum = l.add_where_equal(*sum, weight, mode, l.word(k as u32));
        }
        squares = l.mul_add(weight, weight, squares);
        let prefix = l.prefix_sum(weight);
        // In the order in which selection adds them, so that both see the same total.
        sums.weight += f64::from(l.last(prefix));
        l.store(prefix, weights);
    }
    for (sum, lanes) in sums.modes.iter_mut().zip(modes) {
        *sum += l.total(lanes);
    }
    sums.squares += l.total(squares);
}

impl Kernel for Reweigh<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self, l: L) {
        let Self {
            weighing,
            ancestry,
            cloud,
            sums,
            unit,
        } = self;
        let scale = Scale::new(l, weighing);
        let selected = matches!(ancestry, Ancestry::Selected);
        let logs = if selected { &[] } else { cloud.logs.as_slice() };
        let offset = match ancestry {
            Ancestry::Selected => 0.0,
            Ancestry::Same { offset } => offset,
        };
        let brought = |i: usize| {
            let log = logs.get(i).map(|log| l.sub(l.load(log), l.real(offset)));
            log.unwrap_or(l.real(0.0))
        };
        let mut highest = l.real(f32::MIN);
        for (i, (bundle, to)) in cloud.bundles.iter().zip(&mut cloud.weights).enumerate() {
            let (log, _) = scale.weigh(l, &loaded(l, bundle));
            let log = l.add(log, brought(i));
            highest = l.max(highest, log);
            l.store(log, to);
            if let Some(kept) = cloud.next_logs.get_mut(i) {
                l.store(log, kept);
            }
        }
        let mut lanes = Block::splat(0.0);
        l.store(highest, &mut lanes);
        *unit = lanes.0.into_iter().fold(f32::MIN, f32::max);
        let chunks = cloud
            .bundles
            .chunks(CHUNK)
            .zip(cloud.weights.chunks_mut(CHUNK));
        for (bundles, weights) in chunks {
            let mut distances = Distances::zero(l);
            for (bundle, weights) in bundles.iter().zip(weights.iter_mut()) {
                let (_, distance) = scale.weigh(l, &loaded(l, bundle));
                let weight = weight(l, l.sub(l.load(weights), l.real(*unit)));
                distances.add(l, weight, distance);
                l.store(weight, weights);
            }
            distances.flush(l, sums);
            summarise(l, bundles, weights, sums);
        }
    }
}

#[inline(always)]
fn loaded<L: Lanes>(l: L, bundle: &Bundle) -> Gathered<L> {
    Gathered {
        x: l.load(&bundle.x),
        y: l.load(&bundle.y),
        yaw: l.load(&bundle.yaw),
        mode: l.load_word(&bundle.mode),
    }
}

impl Kernel for Select<'_> {
    /// Particle i goes on in the slots from `round(n C_(i-1) + u - ½)` to `round(n C_i + u - ½)`,
    /// C the cumulative normalised weights: within one of `n W_i` of them. All slots before the
    /// next particle's first belong to it, so that there are exactly n, whatever the rounding.
    #[inline(always)]
    fn run<L: Lanes>(self, l: L) {
        let Self { cloud, total, u } = self;
        let per_weight = cloud.count() as f64 / total;
        let scale = l.real(per_weight as f32);
        let lane: Block<u32> = Block(std::array::from_fn(|lane| lane as u32));
        let mut own = l.load_word(&lane);
        let mut sum = 0.0;
        for prefix in &cloud.weights {
            let prefix = l.load(prefix);
            // The block's first slot: whole ones in double precision, only the rest in single.
            let at = sum * per_weight + (u - 0.5);
            let whole = (at + 1.0) as i32 - 1;
            let rest = l.real((at - f64::from(whole)) as f32);
            let slot = l.add(l.mul_add(l.before(prefix), scale, rest), l.real(ROUNDER));
            let offset = (whole as u32).wrapping_sub(ROUNDER.to_bits());
            let slot = l.add_word(l.bits(slot), l.word(offset));
            l.scatter(&mut cloud.first, slot, own);
            own = l.add_word(own, l.word(address(1)));
            sum += f64::from(l.last(prefix));
        }
    }
}

const _: () =
    assert!(CHUNK.is_multiple_of(STAGED) && STAGED.is_multiple_of(2) && LANES == MODES_MAX);
