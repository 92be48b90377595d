//! What breaks in a run, and what is therefore true.

use std::collections::{BTreeMap, BTreeSet};

use rand::seq::SliceRandom;
use rand::{Rng, RngExt};
use vigil_blocks::SizeKind;
use vigil_diagnosis::Sensors;
use vigil_evaluation::scoring::field::{Size, Stretch, Truth};
use vigil_robot::FaultTree;
use vigil_robot::injection::Change;
use vigil_robot::{Description, DisturbanceKind, FaultKind, Injection};

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
    others: BTreeSet<(DisturbanceKind, usize)>,
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
                    self.others.insert((this.kind, this.place));
                }
            },
            Change::Clear(wheel) => {
                self.stuck.remove(&wheel);
                self.encoders.remove(&wheel);
                self.sized.remove(&wheel);
                self.others
                    .retain(|(kind, place)| !(is_of_a_wheel(kind.spec().place) && *place == wheel));
            }
            Change::EndDisturbance(kind, at) => {
                let is_at = |place: usize| at.is_none_or(|at| at == place);
                let way = size_of(kind, 0.0).map(|size| size.kind);
                let calmed = |place: usize, size: &Size| way == Some(size.kind) && is_at(place);
                self.sized.retain(|place, size| !calmed(*place, size));
                self.others
                    .retain(|(other, place)| *other != kind || !is_at(*place));
            }
            Change::ClearAll => *self = Self::default(),
        }
    }

    fn truth(&self, tree: &FaultTree, robot: &Description, sensors: Sensors) -> Truth {
        // By the pose alone nothing can be seen of an encoder: the robot is as good as healthy.
        let sees_encoders = sensors != Sensors::Pose;
        let is_seen = |&&(kind, _): &&(DisturbanceKind, usize)| match seen_by(kind) {
            SeenBy::Pose => true,
            SeenBy::Wheels => sees_encoders,
            SeenBy::All => sensors == Sensors::All,
        };
        let others: Vec<_> = self.others.iter().filter(is_seen).collect();
        if !others.is_empty() {
            return self.others_truth(&others, tree, robot);
        }
        let leaf =
            |kind: &str, wheel: usize| leaf(tree, &format!("{kind}:{}", robot.wheels[wheel].name));
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
    /// What is true while these are on: their leaves if the tree has them all and nothing else is
    /// wrong.
    fn others_truth(
        &self,
        others: &[&(DisturbanceKind, usize)],
        tree: &FaultTree,
        robot: &Description,
    ) -> Truth {
        let is_alone = self.stuck.is_empty() && self.encoders.is_empty() && self.sized.is_empty();
        let leaf_of = |fault: Option<String>| fault.and_then(|fault| leaf(tree, &fault));
        let named = others.iter().map(|it| leaf_of(fault_of(it.0, it.1, robot)));
        match named.collect::<Option<Vec<String>>>() {
            Some(leaves) if is_alone => Truth::Faults(leaves),
            _ => Truth::Unmodelled {
                own: match others {
                    [(kind, place)] if is_alone => leaf_of(kin_of(*kind, *place, robot)),
                    _ => None,
                },
            },
        }
    }
}

/// Name of the leaf of a fault, if the tree has one.
fn leaf(tree: &FaultTree, fault: &str) -> Option<String> {
    let mut nodes = tree.nodes().iter();
    let node = nodes.find(|node| node.fault.as_deref() == Some(fault));
    node.map(|node| node.name.clone())
}

/// The fault, in a tree's words, that this is.
fn fault_of(kind: DisturbanceKind, place: usize, robot: &Description) -> Option<String> {
    use DisturbanceKind as D;
    let wheel = &robot.wheels.get(place)?.name;
    Some(match kind {
        D::TorqueLoss => format!("torque:{wheel}"),
        D::CurrentBias | D::CurrentScale | D::CurrentNoise => format!("current:{wheel}"),
        D::SteerJump | D::SteerHeld | D::SteerBias => format!("steer:{wheel}"),
        D::GyroBias | D::GyroScale | D::GyroNoise => "gyro".to_owned(),
        D::PoseJump | D::PoseHeld => "pose".to_owned(),
        _ => return None,
    })
}

/// The fault as which this may be named though nothing shows that it is: unknown is right, too.
fn kin_of(kind: DisturbanceKind, place: usize, robot: &Description) -> Option<String> {
    use DisturbanceKind as D;
    match kind {
        D::SteerOffsetHidden => Some(format!("steer:{}", robot.wheels.get(place)?.name)),
        D::PoseDrift | D::PoseDelay | D::PoseDrop | D::PoseScale | D::YawRateBias => {
            Some("pose".to_owned())
        }
        _ => None,
    }
}

/// Sensors that are needed to see a disturbance at all.
enum SeenBy {
    Pose,
    Wheels,
    All,
}

const fn seen_by(kind: DisturbanceKind) -> SeenBy {
    use DisturbanceKind as D;
    match kind {
        D::GyroBias | D::GyroScale | D::GyroNoise => SeenBy::All,
        D::CurrentBias | D::CurrentScale | D::CurrentNoise => SeenBy::All,
        D::SteerBias => SeenBy::Wheels,
        _ => SeenBy::Pose,
    }
}

const fn is_of_a_wheel(place: vigil_robot::disturbance_kind::Place) -> bool {
    use vigil_robot::disturbance_kind::Place;
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
