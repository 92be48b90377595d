//! The faults that a description declares, weighed over the last few seconds.

use vigil_checkpoint::Checkpoint;
use vigil_inference::logspace::log_sum_exp;

use super::component::Target;
use super::law::{BLOCKS, Law};
use super::model::Class;
use super::orders::WheelOrders;
use super::shift::ShiftLaw;
use super::signature::{Evidence, Features, Signature, Signatures, Terms, means};
use super::turning::{TurningFault, TurningSignatures};
use super::window::Window;
use crate::description::Description;
use crate::fault_table::{DECLARED_MAX, DeclaredFault};

/// One fault at work.
#[derive(Debug, Clone, Checkpoint)]
struct Declared {
    /// Shifts of the channels in which it is declared to show, for windows that begin with each
    /// block; empty if none are declared, or one of them is not in use.
    #[checkpoint(fixed)]
    shifts: Vec<ShiftLaw>,
    /// How it showed in labelled runs.
    #[checkpoint(fixed)]
    signature: Option<Signature>,
    /// How it came back in them with the turns of a wheel.
    #[checkpoint(fixed)]
    turning: Option<TurningFault>,
    evidence: Evidence,
}

/// How labelled runs taught that a fault comes back with the turns of its wheel.
fn turning(
    robot: &Description,
    fault: &DeclaredFault,
    learned: &TurningSignatures,
) -> Option<TurningFault> {
    let name = fault.wheel.as_ref()?;
    let mut signatures = learned.fault.iter();
    Some(TurningFault {
        wheel: robot.wheel_index(name)?,
        noise: learned.noise(name)?.clone(),
        signature: signatures.find(|one| one.fault == fault.name)?.clone(),
    })
}

/// What labelled runs taught of all faults.
#[derive(Debug, Clone, Copy)]
pub struct Taught<'a> {
    /// How they show in the last seconds.
    pub signatures: &'a Signatures,
    /// How they come back with the turns of a wheel.
    pub turning: &'a TurningSignatures,
}

impl Declared {
    /// True if labelled runs taught how it shows.
    const fn is_taught(&self) -> bool {
        self.signature.is_some() || self.turning.is_some()
    }
}

/// Two faults of different wheels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FaultPair {
    /// The likeliest one, and another.
    pub faults: [usize; 2],
    /// What speaks for the other beside the likeliest, nats.
    pub further: f64,
    /// What the evidence of both lacks because ratios are bounded, nats.
    pub beyond_bound: f64,
}

/// All of a robot's.
#[derive(Debug, Clone, Checkpoint)]
pub struct DeclaredFaults {
    #[checkpoint(each)]
    all: Vec<Declared>,
    /// Evidence of each by what the likeliest fault of another wheel does not explain.
    further: Vec<Evidence>,
    #[checkpoint(fixed)]
    signatures: Signatures,
    channels: usize,
}

impl DeclaredFaults {
    /// Those of `robot` over the channels in use, whose law is that of windows that begin with each
    /// block; nothing is taught of a part of the channels.
    #[must_use]
    pub fn new(
        robot: &Description,
        used: &[Target],
        laws: &[Law],
        taught: Option<Taught<'_>>,
    ) -> Self {
        let signatures = taught.map(|taught| taught.signatures.clone());
        let signatures = signatures.unwrap_or_default();
        let place = |name: &String| used.iter().position(|target| target.name == *name);
        let declared = robot.fault.iter().map(|fault| {
            let shown: Option<Vec<usize>> = fault.shows.iter().map(place).collect();
            let shown = shown.filter(|shown| !shown.is_empty());
            let shifts =
                shown.map(|shown| laws.iter().map(|law| ShiftLaw::new(law, &shown)).collect());
            let mut learned = signatures.fault.iter();
            Declared {
                shifts: shifts.unwrap_or_default(),
                signature: learned.find(|one| one.fault == fault.name).cloned(),
                turning: taught.and_then(|taught| turning(robot, fault, taught.turning)),
                evidence: Evidence::default(),
            }
        });
        Self {
            all: declared.collect(),
            further: vec![Evidence::default(); robot.fault.len()],
            signatures,
            channels: used.len(),
        }
    }

    /// How many there are.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.all.len()
    }

    /// True if there are none.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// True if something can show it.
    #[must_use]
    pub fn is_seen(&self, fault: usize) -> bool {
        let declared = &self.all[fault];
        declared.is_taught() || !declared.shifts.is_empty()
    }

    /// Forgets the record: not what the turns of the wheels said, as these go on.
    pub fn clear(&mut self) {
        for declared in self.all.iter_mut().filter(|one| one.turning.is_none()) {
            declared.evidence = Evidence::default();
        }
    }

    /// Forgets the run.
    pub fn reset(&mut self) {
        for declared in &mut self.all {
            declared.evidence = Evidence::default();
        }
        self.further.fill(Evidence::default());
    }

    /// Takes what the last turns of the wheels say; the last ones were those of `dt_s` ago.
    pub fn take_orders(&mut self, orders: &[WheelOrders], dt_s: f64) {
        for declared in &mut self.all {
            let turning = declared.turning.as_ref();
            if let Some(log_ratio) = turning.and_then(|turning| turning.log_ratio(orders)) {
                declared.evidence.take(log_ratio, dt_s);
            }
        }
        let first = self.likeliest().and_then(|i| self.all[i].turning.as_ref());
        let Some(first) = first else {
            return;
        };
        let explained = first.explained(orders);
        for (second, further) in self.all.iter().zip(&mut self.further) {
            let second = second.turning.as_ref();
            let other = second.filter(|other| other.wheel != first.wheel);
            let found = other.and_then(|other| other.log_ratio_beside(&explained, orders));
            if let Some(log_ratio) = found {
                further.take(log_ratio, dt_s);
            }
        }
    }

    /// The fault that comes back with the turns of a wheel for which most speaks; none if nothing
    /// does.
    fn likeliest(&self) -> Option<usize> {
        let of = |i: usize| self.all[i].evidence.unbounded();
        let turning = (0..self.all.len()).filter(|&i| self.is_turning(i) && of(i) > 0.0);
        turning.max_by(|&a, &b| of(a).total_cmp(&of(b)))
    }

    /// Takes the signatures' part of a window, which is `dt_s` newer than the last one, under a
    /// command.
    pub fn take(&mut self, window: &Window, terms: Terms, dt_s: f64) {
        if self.signatures.is_empty() || window.whole_blocks() < BLOCKS {
            return;
        }
        let seen = Features {
            means: self.signatures.standardized(&means(window, self.channels)),
            terms,
        };
        for declared in &mut self.all {
            if let Some(signature) = &declared.signature {
                declared.evidence.take(signature.log_ratio(&seen), dt_s);
            }
        }
    }

    /// Evidence of what labelled runs taught of a fault, nats; none if they taught nothing.
    #[must_use]
    pub fn evidence(&self, fault: usize) -> Option<f64> {
        let declared = &self.all[fault];
        declared.is_taught().then(|| declared.evidence.log_ratio())
    }

    /// What the evidence of each fault lacks beside that of the others because ratios are bounded,
    /// nats.
    #[must_use]
    pub fn beyond_bound(&self, fault: usize) -> f64 {
        self.all[fault].evidence.beyond_bound()
    }

    /// True if a fault comes back with the turns of a wheel.
    #[must_use]
    pub fn is_turning(&self, fault: usize) -> bool {
        self.all[fault].turning.is_some()
    }

    /// The two faults of different wheels that come back with their turns and for which most
    /// speaks; none if there is only one.
    #[must_use]
    pub fn pair(&self) -> Option<FaultPair> {
        let first = self.likeliest()?;
        let wheel = |i: usize| self.all[i].turning.as_ref().map(|turning| turning.wheel);
        let is_other = |&i: &usize| wheel(i).is_some() && wheel(i) != wheel(first);
        let others = (0..self.all.len()).filter(is_other);
        let unbounded = |i: &usize| self.further[*i].unbounded();
        let second = others.max_by(|a, b| unbounded(a).total_cmp(&unbounded(b)))?;
        let log_ratio = self.further[second].log_ratio();
        (log_ratio > 0.0).then(|| FaultPair {
            faults: [first, second],
            further: log_ratio,
            beyond_bound: self.beyond_bound(first) + self.further[second].beyond_bound(),
        })
    }

    /// Divides `odds`, what speaks for each fault and for two at once, by all that is known of
    /// each: how rarely a class says so much without a fault is no measure of which one it is.
    /// `raw`: the log-odds of each by class; `slope`: how much a nat of these counts.
    pub fn divide(&self, slope: f64, raw: &[[f64; Class::ALL.len()]], odds: &mut [f64]) {
        let total = log_sum_exp(odds);
        let pair = self.pair().map_or(0.0, |pair| pair.beyond_bound);
        let mut shares = [f64::NEG_INFINITY; DECLARED_MAX + 1];
        for (i, (share, raw)) in shares.iter_mut().zip(raw).enumerate() {
            let beyond = match i < self.len() {
                true => self.beyond_bound(i),
                false => pair,
            };
            let known = Class::DECLARED.map(|class| raw[class as usize]);
            *share = slope * (log_sum_exp(&known) + beyond);
        }
        let sum = log_sum_exp(&shares[..odds.len()]);
        for (odds, share) in odds.iter_mut().zip(shares) {
            *odds = total + share - sum;
        }
    }

    /// The law of a shift of a fault's channels in windows whose whole blocks begin with `begin`;
    /// none if no channels are declared.
    #[must_use]
    pub fn shift(&self, fault: usize, begin: usize) -> Option<&ShiftLaw> {
        let shifts = &self.all[fault].shifts;
        shifts.get(begin).or_else(|| shifts.last())
    }
}
