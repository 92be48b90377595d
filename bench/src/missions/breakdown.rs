//! What breaks in a mission, and how it goes on.

use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use vigil_blocks::AnsweredWheels;

use super::kind::Kind;

/// Wheels, in the order of the robot's.
pub(super) const WHEELS: [&str; 6] = ["LF", "LM", "LR", "RF", "RM", "RR"];
/// Those that are steered.
const STEERED: [usize; 4] = [0, 2, 3, 5];
/// How an encoder breaks.
const BROKEN: [&str; 3] = ["zero", "frozen", "noise"];
/// What no model contains; `W` stands for a wheel, `S` for a steered one. Slopes and soils are
/// none of it: the robot's tolerances declare them healthy.
const UNMODELLED: [&str; 8] = [
    "steer-offset-hidden:S:0.2",
    "steer-offset-hidden:S:-0.3",
    "steer-jump:S:0.25",
    "steer-held:S:0.3",
    "tether:40",
    "brush:W:20",
    "puncture:W:0.8",
    "sinkage:W:10",
];
/// What grows, and to what; an encoder's addition grows by itself, rad/s².
const GROWING: [(&str, f64); 4] = [
    ("steer-offset-hidden:S", 0.3),
    ("tether", 50.0),
    ("brush:W", 40.0),
    ("encoder-drift:W", 0.05),
];
/// Where it begins, as a share of the path.
const ONSET: std::ops::Range<f64> = 0.1..0.8;
/// Time between two faults, s.
const APART_S: std::ops::Range<f64> = 0.0..10.0;
/// How long an intermittent fault is there, and how long it is not, s.
const ON_S: std::ops::Range<f64> = 1.0..8.0;
const OFF_S: std::ops::Range<f64> = 3.0..12.0;
/// How long what grows takes, s, and the time between two steps of it.
const GROWTH_S: std::ops::Range<f64> = 15.0..40.0;
const GROWTH_STEP_S: f64 = 0.5;
/// An encoder that adds so much is as good as broken, rad/s: half of what a slow wheel turns.
const ENCODER_BROKEN_RAD_S: f64 = 1.0;
/// No mission lasts longer, s.
const END_S: f64 = 300.0;

/// What is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cause {
    /// This wheel is stuck.
    Stuck(usize),
    /// This wheel's encoder is broken.
    Encoder(usize),
    /// Something that no model contains.
    Unmodelled,
}

impl Cause {
    /// The wheel that it is about, as an action answers it.
    #[must_use]
    pub fn wheels(self) -> AnsweredWheels {
        match self {
            Self::Stuck(wheel) => AnsweredWheels::one_stuck(wheel),
            Self::Encoder(wheel) => AnsweredWheels::one_encoder(wheel),
            Self::Unmodelled => AnsweredWheels::default(),
        }
    }
}

/// A fault that is there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PresentFault {
    /// What is wrong.
    pub cause: Cause,
    /// How much of it: 1 for all.
    pub severity: f64,
}

/// A step of a breakdown.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// Time after the onset, s.
    pub after_s: f64,
    /// Change of the world, as `vigil inject` takes it.
    pub change: Option<String>,
    /// What is wrong from then on.
    pub present: Vec<PresentFault>,
}

/// What breaks.
#[derive(Debug, Clone, PartialEq)]
pub struct Breakdown {
    /// Where it begins, metres along the path.
    pub onset_m: f64,
    /// What happens, in order of time; the first at the onset.
    pub steps: Vec<Step>,
    /// What is to be expected of the rest of the mission, for who is told: its severity is that of
    /// the worst to come, or the share of time for what comes and goes.
    pub expected: Vec<PresentFault>,
}

impl Breakdown {
    /// One of a kind of mission.
    pub(super) fn drawn(kind: Kind, length_m: f64, rng: &mut Pcg64Mcg) -> Option<Self> {
        let onset_m = length_m * rng.random_range(ONSET);
        let (steps, expected) = match kind {
            Kind::Nothing => return None,
            Kind::Stuck => lasting(stuck(drawn_wheel(rng))),
            Kind::Encoder => lasting(encoder(drawn_wheel(rng), rng)),
            Kind::Two => two(rng),
            Kind::Unmodelled => lasting(unmodelled(rng)),
            Kind::Intermittent => intermittent(rng),
            Kind::Growing => growing(rng),
        };
        Some(Self {
            onset_m,
            steps,
            expected,
        })
    }

    /// Its first change, for tables.
    #[must_use]
    pub fn name(&self) -> &str {
        let mut changes = self.steps.iter().filter_map(|step| step.change.as_deref());
        changes.next().unwrap_or_default()
    }
}

/// Steps, and what is to be expected.
type Course = (Vec<Step>, Vec<PresentFault>);

const fn whole(cause: Cause) -> PresentFault {
    PresentFault {
        cause,
        severity: 1.0,
    }
}

/// Any wheel.
pub fn drawn_wheel(rng: &mut Pcg64Mcg) -> usize {
    rng.random_range(0..WHEELS.len())
}

/// The change that makes a wheel stick, as `vigil inject` takes it, and what then is wrong.
#[must_use]
pub fn stuck(wheel: usize) -> (String, Cause) {
    (format!("stuck:{}", WHEELS[wheel]), Cause::Stuck(wheel))
}

/// The same for its encoder, broken in one of the ways that there are.
pub fn encoder(wheel: usize, rng: &mut Pcg64Mcg) -> (String, Cause) {
    let how = BROKEN[rng.random_range(0..BROKEN.len())];
    let change = format!("encoder:{}:{how}", WHEELS[wheel]);
    (change, Cause::Encoder(wheel))
}

fn unmodelled(rng: &mut Pcg64Mcg) -> (String, Cause) {
    let (change, _) = placed(UNMODELLED[rng.random_range(0..UNMODELLED.len())], rng);
    (change, Cause::Unmodelled)
}

/// A specification with a wheel for its letter, and that wheel.
fn placed(form: &str, rng: &mut Pcg64Mcg) -> (String, usize) {
    let any = drawn_wheel(rng);
    let steered = STEERED[rng.random_range(0..STEERED.len())];
    let text: Vec<&str> = form
        .split(':')
        .map(|part| match part {
            "W" => WHEELS[any],
            "S" => WHEELS[steered],
            other => other,
        })
        .collect();
    (text.join(":"), any)
}

fn lasting((change, cause): (String, Cause)) -> Course {
    let present = vec![whole(cause)];
    let step = Step {
        after_s: 0.0,
        change: Some(change),
        present: present.clone(),
    };
    (vec![step], present)
}

fn two(rng: &mut Pcg64Mcg) -> Course {
    let first = drawn_wheel(rng);
    let second = (first + rng.random_range(1..WHEELS.len())) % WHEELS.len();
    let [a, b] = match rng.random_range(0..3) {
        0 => [stuck(first), stuck(second)],
        1 => [stuck(first), encoder(second, rng)],
        _ => [encoder(first, rng), encoder(second, rng)],
    };
    let both = vec![whole(a.1), whole(b.1)];
    let steps = vec![
        Step {
            after_s: 0.0,
            change: Some(a.0),
            present: vec![whole(a.1)],
        },
        Step {
            after_s: rng.random_range(APART_S),
            change: Some(b.0),
            present: both.clone(),
        },
    ];
    (steps, both)
}

fn intermittent(rng: &mut Pcg64Mcg) -> Course {
    let wheel = drawn_wheel(rng);
    let (change, cause) = match rng.random_range(0..2) {
        0 => stuck(wheel),
        _ => encoder(wheel, rng),
    };
    let (mut steps, mut t_s, mut on_s) = (Vec::new(), 0.0, 0.0);
    while t_s < END_S {
        steps.push(Step {
            after_s: t_s,
            change: Some(change.clone()),
            present: vec![whole(cause)],
        });
        let lasts_s = rng.random_range(ON_S);
        on_s += lasts_s;
        t_s += lasts_s;
        steps.push(Step {
            after_s: t_s,
            change: Some(format!("clear:{}", WHEELS[wheel])),
            present: Vec::new(),
        });
        t_s += rng.random_range(OFF_S);
    }
    let severity = on_s / t_s;
    (steps, vec![PresentFault { cause, severity }])
}

fn growing(rng: &mut Pcg64Mcg) -> Course {
    let (form, most) = GROWING[rng.random_range(0..GROWING.len())];
    let (change, wheel) = placed(form, rng);
    let signed = form.starts_with("steer") || form.starts_with("encoder");
    let sign = match rng.random_range(0..2) {
        0 if signed => -1.0,
        _ => 1.0,
    };
    let grows_by_itself = form.starts_with("encoder");
    let (cause, growth_s) = match grows_by_itself {
        true => (Cause::Encoder(wheel), ENCODER_BROKEN_RAD_S / most),
        false => (Cause::Unmodelled, rng.random_range(GROWTH_S)),
    };
    let count = (growth_s / GROWTH_STEP_S).ceil() as u32;
    let step = |k: u32| {
        let after_s = f64::from(k) * GROWTH_STEP_S;
        let severity = (after_s / growth_s).min(1.0);
        let size = sign * most * if grows_by_itself { 1.0 } else { severity };
        let changes = if grows_by_itself { k == 0 } else { k > 0 };
        Step {
            after_s,
            change: changes.then(|| format!("{change}:{size}")),
            present: vec![PresentFault { cause, severity }],
        }
    };
    ((0..=count).map(step).collect(), vec![whole(cause)])
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    fn drawn(kind: Kind) -> impl Iterator<Item = Breakdown> {
        let mut rng = Pcg64Mcg::seed_from_u64(3);
        (0..200).filter_map(move |_| Breakdown::drawn(kind, 20.0, &mut rng))
    }

    #[test]
    fn two_faults_are_of_two_wheels_and_what_comes_and_goes_is_mended_in_between() {
        for breakdown in drawn(Kind::Two) {
            let [first, second] = &breakdown.steps[..] else {
                panic!("{breakdown:?}");
            };
            assert_eq!((first.present.len(), second.present.len()), (1, 2));
            let wheels = second.present.iter().map(|fault| match fault.cause {
                Cause::Stuck(wheel) | Cause::Encoder(wheel) => wheel,
                Cause::Unmodelled => panic!("{fault:?}"),
            });
            let wheels: Vec<usize> = wheels.collect();
            assert_ne!(wheels[0], wheels[1]);
        }
        for breakdown in drawn(Kind::Intermittent) {
            for (k, step) in breakdown.steps.iter().enumerate() {
                assert_eq!(step.present.is_empty(), k % 2 == 1);
            }
            let share = breakdown.expected[0].severity;
            // 4.5 s of 12 in the mean, over some 25 times.
            assert!((0.25..0.5).contains(&share), "{share}");
        }
    }

    #[test]
    fn what_grows_begins_with_nothing_and_ends_whole() {
        let mut causes = Vec::new();
        for breakdown in drawn(Kind::Growing) {
            let severities = breakdown.steps.iter().map(|step| step.present[0].severity);
            assert!(severities.clone().is_sorted());
            assert_eq!(severities.clone().next(), Some(0.0));
            assert_eq!(severities.clone().next_back(), Some(1.0));
            causes.push(matches!(breakdown.expected[0].cause, Cause::Unmodelled));
        }
        assert!(causes.contains(&true) && causes.contains(&false));
    }
}
