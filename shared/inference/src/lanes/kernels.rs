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

/// Draws the next modes and moves the poses; `normals` are three independent draws.
#[inline(always)]
fn propagate<L: Lanes>(
    l: L,
    model: &PlanarModel,
    from: &Gathered<L>,
    draw: L::Word,
    normals: [L::Real; 3],
) -> Gathered<L> {
    let column = l.shift_right(draw, 28);
    let entry = l.look_up_entry(&model.alias, l.or(l.shift_left(from.mode, 4), column));
    let mode = l.select_less(
        l.and(draw, l.word(0x0fff_ffff)),
        l.shift_right(entry, 4),
        column,
        l.and(entry, l.word(15)),
    );
    let (sine, cosine) = sin_cos(l, from.yaw);
    let (dx, dy) = (l.look_up(&model.dx, mode), l.look_up(&model.dy, mode));
    let turn = l.look_up(&model.dyaw, mode);
    let [sx, sy, syaw] = model.motion_sd.map(|sd| l.real(sd));
    let x = l.mul_add(sx, normals[0], from.x);
    let x = l.mul_add(cosine, dx, x);
    let x = l.sub(x, l.mul(sine, dy));
    let y = l.mul_add(sy, normals[1], from.y);
    let y = l.mul_add(sine, dx, y);
    let y = l.mul_add(cosine, dy, y);
    let yaw = wrap(l, l.mul_add(syaw, normals[2], l.add(from.yaw, turn)));
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
        let from = cloud.bundles.as_slice();
        let mut next_logs = cloud.next_logs.chunks_mut(CHUNK);
        let mut first = cloud.first.chunks_mut(CHUNK);
        let chunks = cloud
            .next
            .chunks_mut(CHUNK)
            .zip(cloud.weights.chunks_mut(CHUNK));
        for ((next, weights), first) in chunks.zip(&mut first) {
            let next_logs = next_logs.next().unwrap_or_default();
            let mut distances = Distances::zero(l);
            // In pairs: three draws for each of two bundles are three pairs of normals.
            let mut pairs = next
                .as_chunks_mut::<2>()
                .0
                .iter_mut()
                .zip(weights.as_chunks_mut::<2>().0)
                .zip(first.as_chunks_mut::<2>().0)
                .enumerate();
            for (pair, ((next, weights), first)) in &mut pairs {
                let (n, m) = ([draws.normals(), draws.normals()], draws.normals());
                let normals = [[n[0].0, n[0].1, m.0], [n[1].0, n[1].1, m.1]];
                for half in 0..2 {
                    let (at, brought) = origins.next(l, &mut first[half]);
                    let moved =
                        propagate(l, model, &l.gather(from, at), draws.word(), normals[half]);
                    let (log, distance) = scale.weigh(l, &moved);
                    let log = l.add(log, brought);
                    let weight = weight(l, log);
                    distances.add(l, weight, distance);
                    l.store(moved.x, &mut next[half].x);
                    l.store(moved.y, &mut next[half].y);
                    l.store(moved.yaw, &mut next[half].yaw);
                    l.store_word(moved.mode, &mut next[half].mode);
                    l.store(weight, &mut weights[half]);
                    if let Some(kept) = next_logs.get_mut(2 * pair + half) {
                        l.store(log, kept);
                    }
                }
            }
            distances.flush(l, sums);
            summarise(l, next, weights, sums);
        }
        draws.end(streams);
    }
}

/// Where the particles of one bundle after the other come from.
struct Origins<'a, L: Lanes> {
    /// Latest address of a selected particle.
    latest: L::Word,
    /// Addresses in the bundle itself, if nothing was selected.
    own: Option<L::Word>,
    logs: Iter<'a, Block<f32>>,
    offset: L::Real,
}

impl<'a, L: Lanes> Origins<'a, L> {
    #[inline(always)]
    fn new(l: L, ancestry: Ancestry, logs: &'a [Block<f32>]) -> Self {
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
    fn next(&mut self, l: L, first: &mut Block<u32>) -> (L::Word, L::Real) {
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

const _: () = assert!(CHUNK.is_multiple_of(2) && LANES == MODES_MAX);
