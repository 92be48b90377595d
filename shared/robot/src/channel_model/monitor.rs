//! Is this still the robot that was learned, and if not, what of it is broken?
//!
//! The faults of the [`Bank`] fall into classes ([`Class`]). No class is as regular as its law: the
//! odds of each are tempered by the tail that they have on the log ([`Tail`]). Their sum is the
//! log-odds of a fault; their parts say of which component.
//!
//! All this is done at the prior fault rate at which the tails were found ([`FAULT_RATE_1_H`]).
//! Another rate adds its logarithm afterwards. Alarms do not depend on it, as their threshold moves
//! by as much.

mod explanation;
mod shares;

use vigil_checkpoint::Checkpoint;
use vigil_inference::logspace::{log_add, log_sum_exp};

use super::bank::{Bank, ChannelPlace, DrivePlace, IMPOSSIBLE, KINDS_MAX, Laws};
use super::belief::{ComponentBelief, NO_BELIEF, PairBelief};
use super::channel::{Channel, Scales, commands, lags};
use super::component::{Places, Target, components, drives, targets};
use super::context_change::ChangeWatch;
use super::coverage::{Combinations, Range, widening};
use super::declared_faults::{DeclaredFaults, Taught};
use super::directions::{covariances, directions, parted};
use super::law::{BLOCK_S, BLOCKS, Law};
use super::model::{Class, FAULT_RATE_1_H, Model, Tail};
use super::observation::History;
use super::orders::WheelOrders;
use super::scatter::ScatterLaw;
use super::signature::terms;
use super::watched::{Part, Watch, likeliest, watched};
use super::window::{Suspects, Window};
use super::{AXES, CHANNELS_MAX, COMPONENTS_MAX};
use crate::description::Description;
use crate::learned::channels::Channels;
use crate::learned::monitor::DetectionOutput;
use crate::slot::{SLOTS, Slot};
use shares::Shares;

/// Fewest blocks of a window that say anything.
const BLOCKS_MIN: usize = 2;
/// Observed motion after which evidence counts, s.
const READY_S: f64 = 1.0;
/// How much more frequent a fault with labelled runs is than any other. Chosen.
const RECORDED: f64 = 10.0;
/// By how much rarer two faults are than one, nats. Chosen.
const ANOTHER: f64 = 4.0;
/// Log-odds of a component from which on it may be broken.
const SUSPECT_LOG_ODDS: f64 = -2.0;

/// Log-odds of each component, then of the two faults at once for which most speaks.
type Odds = [f64; COMPONENTS_MAX + 1];
/// The same by class.
type ClassOdds = [[f64; Class::ALL.len()]; COMPONENTS_MAX + 1];

/// The detection filter, and what names its faults.
#[derive(Debug, Clone, Checkpoint)]
pub struct Monitor {
    bank: Bank,
    #[checkpoint(fixed)]
    ranges: Vec<Range>,
    /// Size of each axis of the command.
    sizes: [f64; AXES],
    #[checkpoint(fixed)]
    combinations: Combinations,
    /// Observations that a prediction looks back.
    lags: usize,
    /// False if the log did not show the robot at rest: then a rest says nothing.
    knows_rest: bool,
    /// Places of the channels in an observation.
    places: Vec<usize>,
    #[checkpoint(each)]
    watched: Vec<Watch>,
    #[checkpoint(fixed)]
    tails: [Option<Tail>; Class::ALL.len()],
    /// What the prior fault rate adds to the log-odds.
    prior_log_odds: f64,
    run_s: f64,
    /// Channels with which something may be wrong.
    suspects: Suspects,
    classes: [f64; Class::ALL.len()],
    beliefs: [ComponentBelief; COMPONENTS_MAX],
    pair: Option<PairBelief>,
    changes: ChangeWatch,
    report: DetectionOutput,
}

impl Monitor {
    /// A monitor of the channels of `model` that are among `channels`, with a prior fault rate;
    /// none if the model is not of this robot.
    #[must_use]
    pub fn new(
        model: &Model,
        robot: &Description,
        channels: Channels,
        fault_rate_1_h: f64,
    ) -> Option<Self> {
        let all = targets(robot);
        let is_used = |target: &Target| channels.use_wheels() || target.quantity.is_pose();
        let places: Vec<usize> = (0..all.len()).filter(|&i| is_used(&all[i])).collect();
        let scales = Scales::new(model.sizes(), drives(robot), model.interval_s);
        let used = places
            .iter()
            .map(|&place| Some((place, model.channel.get(place)?.clone())));
        let used = used.collect::<Option<Vec<_>>>()?;
        let sensed = sensed(robot, &used)?;
        let at = Places::new(robot);
        let driven = scales
            .drives
            .iter()
            .enumerate()
            .map(|(i, drive)| DrivePlace {
                component: at.drives + i,
                wheel: drive.wheel,
            });
        let driven = driven.collect();
        let laws = laws(model, &places, &sensed)?;
        let targets: Vec<Target> = sensed.iter().map(|one| one.target.clone()).collect();
        let taught = (places.len() == all.len()).then_some(Taught {
            signatures: &model.signatures,
            turning: &model.turning,
        });
        let changes = ChangeWatch::new(robot, taught.map(|_| &model.contexts));
        let declared = DeclaredFaults::new(robot, &targets, &laws.mean, taught);
        let watched = watched(at, &sensed, &declared);
        let tail = |class: Class| model.tail(channels, class).cloned();
        let window = Window::new(used, scales, model.interval_s);
        let mut monitor = Self {
            watched,
            bank: Bank::new(window, laws, sensed, driven, (declared, at.declared)),
            ranges: model.command.clone(),
            sizes: model.sizes(),
            combinations: model.combinations.clone(),
            lags: lags(model.interval_s),
            knows_rest: model.knows_rest(),
            places,
            tails: Class::ALL.map(tail),
            prior_log_odds: (fault_rate_1_h / FAULT_RATE_1_H).ln(),
            run_s: 0.0,
            suspects: Suspects::default(),
            classes: [IMPOSSIBLE; Class::ALL.len()],
            beliefs: [NO_BELIEF; COMPONENTS_MAX],
            pair: None,
            changes,
            report: DetectionOutput {
                log_odds: IMPOSSIBLE,
                channels: [IMPOSSIBLE; SLOTS],
                gains: [0.0; SLOTS],
                evidence: 0.0,
                degenerate_count: 0,
            },
        };
        monitor.reset();
        Some(monitor)
    }

    /// Forgets everything.
    pub fn reset(&mut self) {
        self.bank.reset();
        self.changes.clear();
        self.run_s = 0.0;
        self.sum_up();
        self.report.evidence = 0.0;
    }

    /// What the last observation did.
    #[must_use]
    pub const fn report(&self) -> &DetectionOutput {
        &self.report
    }

    /// True once evidence counts.
    #[must_use]
    pub fn is_ready(&self) -> bool {
        self.run_s >= READY_S
    }

    /// What is believed of each component, in the order of [`components`].
    #[must_use]
    pub fn beliefs(&self) -> &[ComponentBelief] {
        &self.beliefs[..self.watched.len()]
    }

    /// What is believed of two faults at once; of each alone say [`Self::beliefs`].
    #[must_use]
    pub const fn pair(&self) -> Option<PairBelief> {
        self.pair
    }

    /// Changes that are no fault.
    #[must_use]
    pub const fn changes(&self) -> &ChangeWatch {
        &self.changes
    }

    /// Log-odds of each class of faults at [`FAULT_RATE_1_H`], not tempered.
    #[must_use]
    pub const fn classes(&self) -> [f64; Class::ALL.len()] {
        self.classes
    }

    /// The bank.
    #[must_use]
    pub const fn bank(&self) -> &Bank {
        &self.bank
    }

    /// Takes the newest observation of `history`, and what the wheels show up to its end.
    pub fn step(&mut self, history: &History, orders: &[WheelOrders]) {
        let Some(now) = history.ago(0) else { return };
        self.bank.take_orders(orders, now.dt_s);
        // Before, nobody knows what was commanded.
        let is_known = now.moving || self.knows_rest;
        if history.ago(self.lags).is_none() || !is_known {
            self.bank.clear();
            return;
        }
        self.run_s += now.dt_s;
        let widening = widening(&self.ranges, &self.combinations, now);
        self.bank
            .window_mut()
            .push(history, &commands(history), (widening, self.suspects));
        if now.moving {
            self.changes.take(self.bank.window(), now.t_ns, now.dt_s);
        }
        let places = &self.places;
        let measured = |channel: usize| now.values[places[channel]].is_some();
        // After a break what was said before stands until there is something new to say.
        if self.bank.weigh(measured, terms(now, &self.sizes), now.dt_s) {
            self.sum_up();
            self.report.evidence = -0.5 * self.bank.mean_square();
        }
    }

    /// Log-odds by component and class before tempering, and those of components that have none.
    fn raw(&self, prior: f64) -> (ClassOdds, Odds) {
        let mut raw: ClassOdds = [[IMPOSSIBLE; Class::ALL.len()]; COMPONENTS_MAX + 1];
        let mut certain: Odds = [IMPOSSIBLE; COMPONENTS_MAX + 1];
        for (i, watched) in self.watched.iter().enumerate() {
            for (k, found) in self.bank.weighed(i).iter().enumerate() {
                let Some(kind) = watched.part.kind(k) else {
                    continue;
                };
                if found.log_ratio <= IMPOSSIBLE {
                    continue;
                }
                let log_odds = prior + found.log_ratio - (KINDS_MAX as f64).ln();
                match Class::from_kind(kind) {
                    Some(class) => add(&mut raw[i][class as usize], log_odds),
                    None => add(&mut certain[i], log_odds),
                }
            }
        }
        let turning = Class::Turning as usize;
        if let Some(([first, _], further)) = self.pair_components() {
            raw[self.watched.len()][turning] = raw[first][turning] + further - ANOTHER;
        }
        (raw, certain)
    }

    fn sum_up(&mut self) {
        let seen = self.watched.iter().filter(|watched| watched.is_seen);
        let prior = component_prior(seen.count());
        let (raw, certain) = self.raw(prior);
        let n = self.watched.len() + 1;
        let unknown = prior + self.bank.unknown();
        // Of what the window's means show, of what its noise shows, and of what is certain.
        let mut odds: Odds = [IMPOSSIBLE; COMPONENTS_MAX + 1];
        let mut odds_of_noise = certain;
        let (mut odds_unknown, mut unknown_noise) = (IMPOSSIBLE, IMPOSSIBLE);
        for class in Class::ALL {
            let tail = self.tails[class as usize].as_ref();
            let of_class = raw[..n].iter().map(|by_class| by_class[class as usize]);
            // Noise of several channels at once is of no component.
            let of_none = match class {
                Class::Pair => {
                    // Where no second fault is looked for, it is that of the sensor alone.
                    let alone = self.classes[Class::Erratic as usize];
                    let pair = self.bank.pair();
                    self.classes[class as usize] =
                        pair.map_or(alone, |pair| prior + pair.log_ratio);
                    continue;
                }
                Class::Unknown => {
                    self.classes[class as usize] = unknown.max(IMPOSSIBLE);
                    odds_unknown = tempered(tail, unknown);
                    continue;
                }
                Class::Noise => prior + self.bank.unknown_noise(),
                _ => IMPOSSIBLE,
            };
            let mut shares = Shares::new(of_class.chain([of_none]));
            let total = shares.total();
            self.classes[class as usize] = total;
            // A fault of which there are recordings does occur.
            let tempered = match class {
                Class::Signature | Class::Turning => tempered(tail, total) + RECORDED.ln(),
                _ => tempered(tail, total),
            };
            // The likelihoods tell the components apart no better than health from faults.
            let slope = tail.map_or(1.0, |tail| tail.slope);
            for (component, share) in shares.divide(slope, tempered) {
                let slot = match class {
                    Class::Noise if component == n => &mut unknown_noise,
                    Class::Noise => &mut odds_of_noise[component],
                    _ => &mut odds[component],
                };
                add(slot, share);
            }
        }
        self.divide_declared(&raw[..n], &mut odds[..n]);
        let explained = self.explained_alone(prior, &raw);
        let pair = self.explain(prior, explained, (&mut odds[..n], &mut odds_unknown));
        for (slot, value) in odds.iter_mut().zip(odds_of_noise).take(n) {
            *slot = log_add(*slot, value);
        }
        self.report_odds(&odds, log_add(odds_unknown, unknown_noise), pair);
    }

    /// Components of the two faults for which [`DeclaredFaults::pair`] speaks, and how much.
    fn pair_components(&self) -> Option<([usize; 2], f64)> {
        let first = self.watched.len() - self.bank.declared().len();
        let pair = self.bank.declared().pair()?;
        Some((pair.faults.map(|fault| first + fault), pair.further))
    }

    fn report_odds(&mut self, odds: &Odds, unknown: f64, pair: Option<[usize; 2]>) {
        let n = self.watched.len();
        let mut channels = [IMPOSSIBLE; SLOTS];
        channels[Slot::ANY] = log_add(unknown, odds[n]).max(IMPOSSIBLE);
        for (watched, odds) in self.watched.iter().zip(odds) {
            let slot = &mut channels[watched.slot];
            *slot = log_add(*slot, *odds).max(IMPOSSIBLE);
        }
        let total = log_sum_exp(&channels);
        for (i, (watched, odds)) in self.watched.iter().zip(odds).enumerate() {
            self.beliefs[i] = ComponentBelief {
                p: (odds - total).exp().clamp(0.0, 1.0),
                ..likeliest(self.bank.weighed(i), watched.part)
            };
        }
        self.pair = pair.map(|components| PairBelief {
            p: (odds[n] - total).exp().clamp(0.0, 1.0),
            components,
        });
        let is_suspect = |i: usize| odds[i] > SUSPECT_LOG_ODDS;
        let shared = (0..=n).any(|i| {
            let part = self.watched.get(i).map(|watched| watched.part);
            part.and_then(Part::quantity).is_none() && is_suspect(i)
        });
        let channels_of = self.bank.components().enumerate();
        let anything = shared || unknown > SUSPECT_LOG_ODDS;
        self.suspects = channels_of.fold(Suspects::default(), |held, (channel, component)| {
            // A charge falls on while something else is wrong.
            let is_of_pair = pair.is_some_and(|two| two.contains(&component)) && is_suspect(n);
            let own = u64::from(is_suspect(component) || is_of_pair) << channel;
            Suspects {
                context: held.context | own | u64::from(anything) << channel,
                level: held.level | own,
            }
        });
        let prior = self.prior_log_odds;
        self.report.log_odds = (total + prior).max(IMPOSSIBLE);
        let per_observation = 1.0 / (BLOCKS * self.bank.window().per_block()) as f64;
        self.report.channels = channels.map(|value| (value + prior).max(IMPOSSIBLE));
        self.report.gains = channels.map(|value| value * per_observation);
    }
}

/// Adds what log-odds say.
fn add(slot: &mut f64, log_odds: f64) {
    *slot = match *slot > IMPOSSIBLE {
        true => log_add(*slot, log_odds),
        false => log_odds,
    };
}

/// Log-odds of a class by its tail; as they are if none is known.
fn tempered(tail: Option<&Tail>, log_odds: f64) -> f64 {
    tail.map_or(log_odds, |tail| tail.tempered(log_odds))
}

/// Log-odds at [`FAULT_RATE_1_H`] that a fault of one of so many components has begun within a
/// window; as much is kept for a fault of none of them.
#[must_use]
pub fn component_prior(components: usize) -> f64 {
    let shares = 1.0 + components as f64;
    (FAULT_RATE_1_H / 3600.0 * BLOCK_S * BLOCKS as f64 / shares).ln()
}

/// The channels at these places of a description, with their components.
fn sensed(robot: &Description, used: &[(usize, Channel)]) -> Option<Vec<ChannelPlace>> {
    let (all, names) = (targets(robot), components(robot));
    let one = |(place, channel): &(usize, Channel)| {
        let target = all[*place].clone();
        let component = names
            .iter()
            .position(|one| one.name == target.component())?;
        Some(ChannelPlace {
            target,
            component,
            usual: channel.usual,
            silence_s: channel.silence_s,
        })
    };
    used.iter().map(one).collect()
}

/// The laws of these channels, which have these places; none if the model holds no laws.
fn laws(model: &Model, places: &[usize], sensed: &[ChannelPlace]) -> Option<Laws> {
    let by_lag = covariances(&model.direction, places);
    let (found, n) = (directions(&by_lag), places.len());
    let mean = (0..=BLOCKS - BLOCKS_MIN).map(|first| Law::new(&found, n, first));
    let last = sensed.iter().map(|sensed| sensed.component).max()?;
    let without = (0..=last).map(|component| {
        let is_apart = |i: usize| sensed[i].component == component;
        Law::new(&directions(&parted(&by_lag, is_apart)), n, 0)
    });
    Some(Laws {
        mean: mean.collect::<Option<_>>()?,
        without: without.collect::<Option<_>>()?,
        scatter: ScatterLaw::new(&model.scatter, places),
    })
}

// Each channel has a place in the arrays of a law.
const _: () = assert!(CHANNELS_MAX <= COMPONENTS_MAX);
