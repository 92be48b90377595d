//! Elementary functions, normal draws and selection, on every processor.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::super::cloud::{Cloud, Sums};
use super::super::elementary::{exp2, negative_ln, sin_cos, wrap};
use super::super::kernels::{Ancestry, Origins, Reweigh, Select};
use super::super::model::PlanarModel;
use super::super::random::{Draws, Streams};
use super::super::vector::{Block, Bundle, Kernel, LANES, Lanes};
use super::super::weighing::{Observation, Weighing};
use super::{processors, rover};

/// Function of 16 numbers.
struct Apply<'a> {
    which: usize,
    block: &'a mut Block<f32>,
}

impl Kernel for Apply<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self, l: L) {
        let x = l.load(self.block);
        let y = match self.which {
            0 => negative_ln(l, x),
            1 => exp2(l, x),
            2 => sin_cos(l, x).0,
            3 => sin_cos(l, x).1,
            _ => wrap(l, x),
        };
        l.store(y, self.block);
    }
}

/// Largest error of function `which` at 16 000 places from `low` to `high`, as `error` has it.
fn worst(which: usize, low: f64, high: f64, error: impl Fn(f64, f64) -> f64) -> f64 {
    let mut worst = 0.0_f64;
    for (processor, _) in processors() {
        for i in 0..1000 {
            let at = |lane| low + (high - low) * f64::from(16 * i + lane) / 15_999.0;
            let x = Block(std::array::from_fn(|lane| at(lane as i32) as f32));
            let mut block = x;
            processor.run(Apply {
                which,
                block: &mut block,
            });
            for (x, y) in x.0.into_iter().zip(block.0) {
                worst = worst.max(error(f64::from(x), f64::from(y)));
            }
        }
    }
    worst
}

#[test]
fn elementary_functions_are_as_exact_as_they_say() {
    let relative = |y: f64, exact: f64| (y - exact).abs() / exact.abs().max(1e-30);
    assert!(worst(0, 1e-9, 0.999_999, |x, y| relative(y, -x.ln())) < 2e-6);
    assert!(worst(0, 1e-10, 1e-6, |x, y| relative(y, -x.ln())) < 2e-6);
    assert!(worst(0, 1.0, 1.0, |_, y| y.abs()) < 1e-9);
    assert!(worst(1, -126.0, 126.0, |x, y| relative(y, x.exp2())) < 3e-7);
    let span = 12.5;
    assert!(worst(2, -span, span, |x, y| (y - x.sin()).abs()) < 6e-7);
    assert!(worst(3, -span, span, |x, y| (y - x.cos()).abs()) < 6e-7);
    assert!(worst(4, -span, span, |x, y| (y.sin() - x.sin()).abs()) < 1e-6);
    assert!(worst(4, -span, span, |_, y| y.abs()) < 3.141_595);
}

/// Power sums and counts of exceedance over many draws.
struct Moments<'a> {
    draws: usize,
    found: &'a mut [f64; 7],
}

impl Kernel for Moments<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self, l: L) {
        let mut streams = Streams::new(5);
        let mut draws = Draws::begin(l, &streams);
        let mut blocks = [Block::splat(0.0); 2];
        for _ in 0..self.draws / 32 {
            let (a, b) = draws.normals();
            l.store(a, &mut blocks[0]);
            l.store(b, &mut blocks[1]);
            for (a, b) in blocks[0].0.into_iter().zip(blocks[1].0) {
                for x in [f64::from(a), f64::from(b)] {
                    let square = x * x;
                    let tails = [x.abs() > 3.0, x.abs() > 4.0].map(f64::from);
                    let terms = [x, square, square * x, square * square, tails[0], tails[1]];
                    for (sum, term) in self.found.iter_mut().zip(terms) {
                        *sum += term;
                    }
                }
                self.found[6] += f64::from(a) * f64::from(b);
            }
        }
        draws.end(&mut streams);
    }
}

#[test]
fn normal_draws_have_the_moments_and_tails_of_normal_draws() {
    // Fast enough everywhere only where it is compiled for the processor; bits are equal.
    const DRAWS: usize = 20_000_000;
    let (processor, _) = processors().into_iter().rev().nth(1).unwrap();
    let mut found = [0.0; 7];
    processor.run(Moments {
        draws: DRAWS,
        found: &mut found,
    });
    let [mean, variance, third, fourth, beyond_3, beyond_4, product] =
        found.map(|sum| sum / DRAWS as f64);
    assert!(mean.abs() < 6e-4, "{mean}");
    assert!((variance - 1.0).abs() < 1e-3, "{variance}");
    assert!(third.abs() < 3e-3, "{third}");
    assert!((fourth - 3.0).abs() < 1e-2, "{fourth}");
    assert!((beyond_3 - 2.6998e-3).abs() < 5e-5, "{beyond_3}");
    assert!((beyond_4 - 6.334e-5).abs() < 8e-6, "{beyond_4}");
    assert!(product.abs() < 1e-3, "{product}");
}

#[test]
fn streams_are_xoshiro128_plus_plus() {
    // The published algorithm, in its own words, from the same states.
    let streams = Streams::new(9);
    let mut state: [[u32; 4]; LANES] = [[0; 4]; LANES];
    let mut words = [Block::splat(0_u32); 3];
    super::super::processor::Processor::at_or_plain(super::super::Level::best()).run(Words {
        streams: &streams,
        state: &mut state,
        words: &mut words,
    });
    for (lane, mut s) in state.into_iter().enumerate() {
        for drawn in &words {
            let result = s[0].wrapping_add(s[3]).rotate_left(7).wrapping_add(s[0]);
            let t = s[1] << 9;
            s[2] ^= s[0];
            s[3] ^= s[1];
            s[1] ^= s[2];
            s[0] ^= s[3];
            s[2] ^= t;
            s[3] = s[3].rotate_left(11);
            assert_eq!(drawn.0[lane], result);
        }
    }
}

struct Words<'a> {
    streams: &'a Streams,
    state: &'a mut [[u32; 4]; LANES],
    words: &'a mut [Block<u32>; 3],
}

impl Kernel for Words<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self, l: L) {
        for (lane, state) in self.state.iter_mut().enumerate() {
            *state = self.streams.lane(lane);
        }
        let mut draws = Draws::begin(l, self.streams);
        for word in self.words {
            l.store_word(draws.word(), word);
        }
    }
}

/// Reads the ancestors that selection left.
struct Ancestors<'a> {
    cloud: &'a mut Cloud,
    found: &'a mut Vec<usize>,
}

impl Kernel for Ancestors<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self, l: L) {
        let mut block = Block::splat(0_u32);
        let count = self.cloud.bundles.len();
        let mut next = Origins::new(l, Ancestry::Selected, &[]);
        for first in &mut self.cloud.first[..count] {
            l.store_word(next.next(l, first).0, &mut block);
            let index = |at: u32| (at / 64 * 16 + at % 16) as usize;
            self.found.extend(block.0.map(index));
        }
    }
}

#[test]
fn selection_gives_every_particle_its_share() {
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    for (processor, _) in processors() {
        for bundles in [2, 6, 64, 200] {
            for kind in 0..4 {
                let n = bundles * LANES;
                let mut cloud = Cloud::new(bundles);
                let mut weights = vec![0.0_f32; n];
                for weight in &mut weights {
                    *weight = match kind {
                        0 => 1.0,
                        1 => rng.random(),
                        2 => rng.random::<f32>().powi(40),
                        _ => f32::from(u8::from(rng.random::<f32>() < 0.02)),
                    };
                }
                weights[n / 3] = 0.5;
                let blocks = weights.as_chunks::<LANES>().0;
                let mut total = 0.0;
                for (block, to) in blocks.iter().zip(&mut cloud.weights) {
                    let mut sum = 0.0;
                    *to = Block(block.map(|weight| {
                        sum += weight;
                        sum
                    }));
                    total += f64::from(sum);
                }
                let u = rng.random::<f64>().clamp(1e-7, 1.0 - 1e-7);
                let cloud = &mut cloud;
                processor.run(Select {
                    cloud: &mut *cloud,
                    total,
                    u,
                });
                let mut found = Vec::new();
                processor.run(Ancestors {
                    cloud: &mut *cloud,
                    found: &mut found,
                });
                assert_eq!(found.len(), n);
                assert!(found.is_sorted());
                let mut offspring = vec![0_usize; n];
                found.iter().for_each(|&i| offspring[i] += 1);
                for (count, weight) in offspring.iter().zip(&weights) {
                    let share = f64::from(*weight) / total * n as f64;
                    assert!((*count as f64 - share).abs() < 1.0 + 1e-3 * share.max(1.0));
                    assert!(*weight > 0.0 || *count == 0, "a dead particle went on");
                }
                // What was read is cleared.
                assert!(cloud.first[..bundles].iter().all(|f| f.0 == [0; LANES]));
            }
        }
    }
}

#[test]
fn weighing_again_equals_the_formula() {
    let parameters = rover::parameters();
    let model = PlanarModel::new(&parameters).unwrap();
    let z = Observation {
        pose: [0.5, -0.2, 3.1],
        wheel_rates: [0.9, 0.1, 0.9, 1.0, 1.2, 1.0, 7.0, 7.0],
    };
    let weighing = Weighing::new(&model, &z, [0.0; 3]);
    for (processor, _) in processors() {
        let mut cloud = Cloud::new(2);
        let mut expected = Vec::new();
        for (b, bundle) in cloud.bundles.iter_mut().enumerate() {
            let spread = |lane: usize, by: f32| (lane as f32 - 8.0) * by;
            *bundle = Bundle {
                x: Block(std::array::from_fn(|i| 0.5 + spread(i, 2e-3))),
                y: Block(std::array::from_fn(|i| -0.2 - spread(i, 1e-3))),
                // Across the cut at ±π.
                yaw: Block(std::array::from_fn(|i| if i < 8 { 3.1 } else { -3.13 })),
                mode: Block(std::array::from_fn(|i| ((i + b) % 13) as u32)),
            };
            for i in 0..LANES {
                let at = [bundle.x.0[i], bundle.y.0[i], bundle.yaw.0[i]].map(f64::from);
                let mode = bundle.mode.0[i] as usize;
                let model = rover::Rover(parameters.clone());
                expected.push(crate::hybrid::Sampled::log_likelihood(
                    &model, mode, &at, &z,
                ));
            }
        }
        let (mut sums, mut unit) = (Sums::ZERO, 0.0);
        processor.run(Reweigh {
            weighing: &weighing,
            ancestry: Ancestry::Selected,
            cloud: &mut cloud,
            sums: &mut sums,
            unit: &mut unit,
        });
        let log = weighing.log_best + (sums.weight.log2() + f64::from(unit)) * 2_f64.ln();
        let exact = crate::logspace::log_sum_exp(&expected);
        assert!((log - exact).abs() < 1e-3, "{log} {exact}");
        let squares: Vec<f64> = expected.iter().map(|log| 2.0 * (log - exact)).collect();
        let ratio = sums.squares / (sums.weight * sums.weight);
        assert!((ratio.ln() - crate::logspace::log_sum_exp(&squares)).abs() < 1e-3);
    }
}
