//! What breaks in a run, and what is therefore true.

use std::collections::{BTreeMap, BTreeSet};

use rand::seq::SliceRandom;
use rand::{Rng, RngExt};
use vigil_blocks::SizeKind;
use vigil_evaluation::scoring::field::{Size, Stretch, Truth};
use vigil_inference::FaultTree;
use vigil_robot::injection::Change;
use vigil_robot::{Description, DisturbanceKind, FaultKind, Injection};
use vigil_setup::schema::Sensors;

/// The names that stand for drawn places in a run.
#[derive(Debug, Clone)]
pub struct Places {
    wheels: Vec<String>,
    steered: String,
    side: &'static str,
}

impl Places {
    /// Every wheel comes first equally often over the runs; the others follow in any order.
    #[must_use]
    pub fn draw(robot: &Description, run: usize, rng: &mut impl Rng) -> Self {
        let mut wheels: Vec<String> = robot.wheels.iter().map(|w| w.name.clone()).collect();
        let steered = robot.wheels.iter().filter(|wheel| wheel.steered);
        let steered: Vec<&String> = steered.map(|wheel| &wheel.name).collect();
        let count = wheels.len().max(1);
        wheels.rotate_left(run % count);
        if let Some(rest) = wheels.get_mut(1..) {
            rest.shuffle(rng);
        }
        let side = if rng.random::<bool>() {
            "left"
        } else {
            "right"
        };
        let at = run % steered.len().max(1);
        Self {
            steered: steered
                .get(at)
                .map_or_else(String::new, |name| (*name).clone()),
            wheels,
            side,
        }
    }

    /// `text` with the drawn places.
    fn put(&self, text: &str) -> String {
        let word = |word: &str| match (word, word.strip_prefix('W')) {
            ("S1", _) => self.steered.clone(),
            ("SIDE", _) => self.side.to_owned(),
            (_, Some(digit)) => {
                let index = digit.parse::<usize>().ok().and_then(|n| n.checked_sub(1));
                let wheel = index.and_then(|index| self.wheels.get(index));
                wheel.cloned().unwrap_or_else(|| word.to_owned())
            }
            _ => word.to_owned(),
        };
        text.split(':').map(word).collect::<Vec<_>>().join(":")
    }
}

/// The changes of a list, in order of time, `later_s` later than they say.
///
/// # Errors
/// A change that the robot does not know.
pub fn changes(
    specs: &[String],
    places: &Places,
    robot: &Description,
    later_s: f64,
) -> Result<Vec<Injection>, String> {
    let one = |spec: &String| {
        let (what, at) = spec.rsplit_once('@').unwrap_or((spec, ""));
        // A time may be a sum: onset and duration.
        let terms = at.split('+').map(|term| term.parse::<f64>());
        let at_s: f64 = terms
            .sum::<Result<f64, _>>()
            .map_err(|e| format!("'{spec}': {e}"))?;
        let text = format!("{}@{at_s}", places.put(what));
        let found = Injection::parse(&text, robot).map_err(|error| format!("'{spec}': {error}"))?;
        Ok(Injection {
            at_s: found.at_s + later_s,
            ..found
        })
    };
    let mut all: Vec<Injection> = specs.iter().map(one).collect::<Result<_, String>>()?;
    all.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
    Ok(all)
}

/// What is wrong at an instant.
#[derive(Debug, Clone, Default)]
struct Wrong {
    stuck: BTreeSet<usize>,
    encoders: BTreeSet<usize>,
    /// Encoders that are off by a size: the wheel, and the last size of each.
    sized: BTreeMap<usize, Size>,
    /// Kind and place of what no model describes.
    others: BTreeSet<(u32, usize)>,
}

impl Wrong {
    fn take(&mut self, change: &Change) {
        match *change {
            Change::Inject(fault) => {
                let set = match fault.kind {
                    FaultKind::Stuck => &mut self.stuck,
                    _ => &mut self.encoders,
                };
                set.insert(fault.wheel);
            }
            Change::Disturb(this) => match size_of(this.kind, this.parameter[0]) {
                Some(size) => {
                    self.sized.insert(this.place, size);
                }
                None => {
                    self.others.insert((this.kind as u32, this.place));
                }
            },
            Change::Clear(wheel) => {
                self.stuck.remove(&wheel);
                self.encoders.remove(&wheel);
                self.sized.remove(&wheel);
                self.others.retain(|(kind, place)| {
                    let at_wheel = vigil_robot::DisturbanceKind::from_wire(*kind)
                        .is_some_and(|kind| is_of_a_wheel(kind.row().place));
                    !(at_wheel && *place == wheel)
                });
            }
            Change::Calm(kind, at) => {
                let is_at = |place: usize| at.is_none_or(|at| at == place);
                let way = size_of(kind, 0.0).map(|size| size.kind);
                let calmed = |place: usize, size: &Size| way == Some(size.kind) && is_at(place);
                self.sized.retain(|place, size| !calmed(*place, size));
                self.others
                    .retain(|(other, place)| *other != kind as u32 || !is_at(*place));
            }
            Change::ClearAll => *self = Self::default(),
        }
    }

    fn truth(&self, tree: &FaultTree, robot: &Description, sensors: Sensors) -> Truth {
        if sensors == Sensors::All
            && let Some(leaves) = self.further(tree, robot)
        {
            return Truth::Faults(leaves);
        }
        // By the pose alone nothing can be seen of an encoder: the robot is as good as healthy.
        let sees_encoders = sensors != Sensors::Pose;
        let leaf = |kind: &str, wheel: usize| {
            let fault = format!("{kind}:{}", robot.wheels[wheel].name);
            let node = tree.nodes().iter();
            let mut node = node.filter(|node| node.fault.as_deref() == Some(fault.as_str()));
            node.next().map(|node| node.name.clone())
        };
        let is_seen = |&(kind, _): &(u32, usize)| sensors == Sensors::All || !is_further(kind);
        if self.others.iter().any(is_seen) {
            return Truth::Unmodelled { own: None };
        }
        let stuck = self.stuck.iter().filter_map(|wheel| leaf("stuck", *wheel));
        let broken: BTreeSet<&usize> = self.encoders.iter().chain(self.sized.keys()).collect();
        let encoders = broken.into_iter().filter(|_| sees_encoders);
        let encoders = encoders.filter_map(|wheel| leaf("encoder", *wheel));
        let leaves: Vec<String> = stuck.chain(encoders).collect();
        match leaves.is_empty() {
            true => Truth::Healthy,
            false => Truth::Faults(leaves),
        }
    }
}

/// In which way an encoder is off, and by how much; None of anything else.
fn size_of(kind: DisturbanceKind, value: f64) -> Option<Size> {
    let kind = match kind {
        DisturbanceKind::EncoderScale => SizeKind::Gain,
        DisturbanceKind::EncoderBias => SizeKind::BiasRadS,
        DisturbanceKind::EncoderDrift => SizeKind::DriftRadS2,
        DisturbanceKind::EncoderDelay => SizeKind::DelayS,
        _ => return None,
    };
    Some(Size { kind, value })
}

impl Wrong {
    /// The leaves of weak motors, current sensors and the gyro, if nothing else is wrong.
    fn further(&self, tree: &FaultTree, robot: &Description) -> Option<Vec<String>> {
        let leaf = |(kind, place): &(u32, usize)| {
            use vigil_robot::DisturbanceKind as D;
            let wheel = &robot.wheels.get(*place)?.name;
            let fault = match D::from_wire(*kind)? {
                D::TorqueLoss => format!("torque:{wheel}"),
                D::CurrentBias | D::CurrentScale => format!("current:{wheel}"),
                D::GyroBias | D::GyroScale => "gyro".to_owned(),
                _ => return None,
            };
            let mut nodes = tree.nodes().iter();
            let node = nodes.find(|node| node.fault.as_deref() == Some(fault.as_str()));
            node.map(|node| node.name.clone())
        };
        let is_alone = self.stuck.is_empty() && self.encoders.is_empty();
        let leaves: Option<Vec<String>> = self.others.iter().map(leaf).collect();
        leaves.filter(|leaves| is_alone && !leaves.is_empty())
    }
}

/// True of a kind that gyro and currents alone can show.
fn is_further(kind: u32) -> bool {
    use vigil_robot::DisturbanceKind as D;
    matches!(
        D::from_wire(kind),
        Some(D::GyroBias | D::GyroScale | D::CurrentBias | D::CurrentScale)
    )
}

const fn is_of_a_wheel(place: vigil_robot::disturbance::Place) -> bool {
    use vigil_robot::disturbance::Place;
    matches!(place, Place::Wheel | Place::SteeredWheel)
}

/// What is true over a run, for what a set of sensors can see.
#[must_use]
pub fn truth(
    changes: &[Injection],
    tree: &FaultTree,
    robot: &Description,
    sensors: Sensors,
) -> Vec<Stretch> {
    let mut wrong = Wrong::default();
    let mut stretches = vec![Stretch {
        from_s: 0.0,
        truth: Truth::Healthy,
        size: None,
    }];
    for injection in changes {
        wrong.take(&injection.change);
        let truth = wrong.truth(tree, robot, sensors);
        let from_s = injection.at_s;
        // What changes at one instant is one change.
        stretches.retain(|stretch| stretch.from_s < from_s || stretch.from_s <= 0.0);
        if stretches.last().is_some_and(|last| last.truth != truth) {
            let is_one = matches!(&truth, Truth::Faults(leaves) if leaves.len() == 1);
            let size = wrong.sized.values().next().copied();
            let size = size.filter(|_| is_one && wrong.encoders.is_empty());
            stretches.push(Stretch {
                from_s,
                size: size.filter(|_| wrong.stuck.is_empty()),
                truth,
            });
        }
    }
    stretches
}
