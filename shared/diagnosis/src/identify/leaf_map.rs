//! Which leaf of the fault tree stands for which fault of the model.

use crate::sensors::Sensors;
use vigil_blocks::{FAULT_NODES, WHEELS};
use vigil_robot::FaultTree;
use vigil_robot::learned::{Model, ModelError, MotionMode, Mover};
use vigil_robot::{Description, Fault};

/// Why an identifier was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum IdentifierError {
    /// The model does not fit.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A leaf's fault is none that the model knows.
    #[error(
        "leaf '{leaf}': fault '{fault}' is not in the model: expected stuck:WHEEL, encoder:WHEEL \
         or pose; steer:WHEEL of a steered wheel, where encoders take part; with sensors = \"all\" \
         torque:WHEEL, current:WHEEL or gyro; WHEEL is one of {wheels}"
    )]
    Leaf {
        /// Name of the leaf.
        leaf: String,
        /// Its fault.
        fault: String,
        /// Wheels whose faults the model knows.
        wheels: String,
    },
    /// A leaf's fault is of no component of the robot.
    #[error("leaf '{leaf}': fault '{fault}' is of no component of the robot, which has {known}")]
    Component {
        /// Name of the leaf.
        leaf: String,
        /// Its fault.
        fault: String,
        /// Faults that the robot can have.
        known: String,
    },
    /// Two leaves stand for one fault.
    #[error("leaves '{0}' and '{1}' stand for the same fault")]
    Twice(String, String),
    /// The tree names no fault, and the model knows some.
    #[error("the fault tree has no leaf: a model with faults needs one to name them by")]
    NoLeaf,
    /// The filter cannot be built from these models.
    #[error("identifier.filter: {0}")]
    Build(String),
}

/// What a leaf stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LeafFault {
    /// This wheel is stuck.
    Stuck(usize),
    /// This wheel's encoder is broken.
    Encoder(usize),
    /// This wheel's steering servo does not do as it is told.
    Steer(usize),
    /// This wheel's motor has lost torque.
    Torque(usize),
    /// This wheel's current sensor is broken.
    Current(usize),
    /// The gyro is broken.
    Gyro,
    /// The pose is wrong.
    Pose,
}

/// The leaves of a tree, by fault.
#[derive(Debug, Clone, PartialEq)]
pub struct LeafMap {
    /// Node of each stuck wheel.
    pub stuck: [Option<usize>; WHEELS],
    /// Node of each broken encoder.
    pub encoder: [Option<usize>; WHEELS],
    /// Node of each steering servo that does not do as it is told.
    pub steer: [Option<usize>; WHEELS],
    /// Node of each motor that has lost torque.
    pub torque: [Option<usize>; WHEELS],
    /// Node of each broken current sensor.
    pub current: [Option<usize>; WHEELS],
    /// Node of the broken gyro.
    pub gyro: Option<usize>,
    /// Node of the wrong pose.
    pub pose: Option<usize>,
    /// Of each wheel: the others (bits) for which its side can be named.
    pub same_side: [u32; WHEELS],
    /// Number of leaves.
    pub count: usize,
    /// Depth of each node.
    pub depths: [usize; FAULT_NODES],
    /// Leaves at or below each node, as bits.
    pub below: [u64; FAULT_NODES],
    /// Number of nodes.
    pub nodes: usize,
    /// Hash of the tree.
    pub hash: u64,
}

impl LeafMap {
    /// Of a tree without any.
    pub(crate) const fn none() -> Self {
        Self {
            stuck: [None; WHEELS],
            encoder: [None; WHEELS],
            steer: [None; WHEELS],
            torque: [None; WHEELS],
            current: [None; WHEELS],
            gyro: None,
            pose: None,
            same_side: [0; WHEELS],
            count: 0,
            depths: [0; FAULT_NODES],
            below: [0; FAULT_NODES],
            nodes: 0,
            hash: 0,
        }
    }

    /// Of a tree, without its leaves yet.
    pub(crate) fn of_tree(tree: &FaultTree) -> Self {
        let mut leaves = Self {
            nodes: tree.nodes().len(),
            hash: tree.hash(),
            ..Self::none()
        };
        for i in 0..tree.nodes().len() {
            leaves.depths[i] = tree.depth(i);
        }
        leaves
    }

    /// Counts a leaf of the tree.
    pub(crate) fn add(&mut self, tree: &FaultTree, leaf: usize) {
        self.count += 1;
        let above = std::iter::successors(Some(leaf), |&at| tree.nodes()[at].parent);
        for at in above {
            self.below[at] |= 1 << leaf;
        }
    }

    /// Whether there are leaves of which the paper's filters know nothing: of steering servos and
    /// pose, and those that gyro and currents alone can show.
    #[must_use]
    pub fn need_hypotheses(&self) -> bool {
        let wheels = self.steer.iter().chain(&self.torque).chain(&self.current);
        wheels.chain([&self.gyro, &self.pose]).any(Option::is_some)
    }

    /// The nodes of all leaves.
    pub fn all(&self) -> impl Iterator<Item = usize> + Clone {
        let of_motion = self.stuck.iter().chain(&self.encoder).chain(&self.steer);
        let further = self.torque.iter().chain(&self.current);
        of_motion
            .chain(further)
            .chain([&self.gyro, &self.pose])
            .filter_map(|&leaf| leaf)
    }

    /// What may move the robot in a mode, and how probable each is.
    pub fn shares(&self, mode: &MotionMode) -> impl Iterator<Item = (Mover, f64)> + use<> {
        let alike = match mode.moved {
            Mover::Stuck(one) if mode.p_alike > 0.0 => {
                self.same_side[one.trailing_zeros() as usize]
            }
            _ => 0,
        };
        let count = f64::from(alike.count_ones());
        let (own, other) = match alike {
            0 => (1.0, 0.0),
            _ => (1.0 - mode.p_alike, mode.p_alike / count),
        };
        let others = (0..WHEELS).filter(move |wheel| alike >> wheel & 1 == 1);
        let others = others.map(move |wheel| (Mover::Stuck(1 << wheel), other));
        std::iter::once((mode.moved, own)).chain(others)
    }

    /// The other wheels (bits) on the side of `wheel` whose stuck leaves are below an abstract node
    /// above its own: that node can be named for all of them.
    fn beside(&self, robot: &Description, wheel: usize) -> u32 {
        let Some(leaf) = self.stuck[wheel] else {
            return 0;
        };
        let above = self.below[1..self.nodes].iter();
        let above = above.filter(|below| *below >> leaf & 1 == 1);
        let near = above.fold(0, |all, below| all | below);
        let is_beside = |&other: &usize| {
            let is_same_side = robot.wheels[other].y * robot.wheels[wheel].y > 0.0;
            let is_near = self.stuck[other].is_some_and(|leaf| near >> leaf & 1 == 1);
            other != wheel && is_same_side && is_near
        };
        let others = (0..robot.wheels.len().min(WHEELS)).filter(is_beside);
        others.fold(0, |bits, other| bits | 1 << other)
    }

    /// Reads the faults of the leaves; those of gyro and currents need these sensors.
    ///
    /// # Errors
    /// [`IdentifierError::Leaf`] for a fault that the model does not know,
    /// [`IdentifierError::Twice`] for one that appears twice, [`IdentifierError::NoLeaf`] for a
    /// tree that names none.
    pub fn new(
        tree: &FaultTree,
        model: &Model,
        robot: &Description,
        sensors: Sensors,
    ) -> Result<Self, IdentifierError> {
        let mut leaves = Self::of_tree(tree);
        for i in tree.leaves() {
            let node = &tree.nodes()[i];
            let fault = node.fault.as_deref().unwrap_or_default();
            let place = match leaf_fault(fault, model, robot, sensors) {
                Some(LeafFault::Stuck(wheel)) => &mut leaves.stuck[wheel],
                Some(LeafFault::Encoder(wheel)) => &mut leaves.encoder[wheel],
                Some(LeafFault::Steer(wheel)) => &mut leaves.steer[wheel],
                Some(LeafFault::Torque(wheel)) => &mut leaves.torque[wheel],
                Some(LeafFault::Current(wheel)) => &mut leaves.current[wheel],
                Some(LeafFault::Gyro) => &mut leaves.gyro,
                Some(LeafFault::Pose) => &mut leaves.pose,
                None => {
                    return Err(IdentifierError::Leaf {
                        leaf: node.name.clone(),
                        fault: fault.to_owned(),
                        wheels: model.wheels.join(" "),
                    });
                }
            };
            if let Some(other) = place.replace(i) {
                let other = tree.nodes()[other].name.clone();
                return Err(IdentifierError::Twice(other, node.name.clone()));
            }
            leaves.add(tree, i);
        }
        if leaves.count == 0 {
            return Err(IdentifierError::NoLeaf);
        }
        for wheel in 0..robot.wheels.len().min(WHEELS) {
            leaves.same_side[wheel] = leaves.beside(robot, wheel);
        }
        Ok(leaves)
    }

    /// Prior share of a node's leaves among all faults, the unknown having `prior_unknown`.
    #[must_use]
    pub fn share(&self, node: usize, prior_unknown: f64) -> f64 {
        let leaves = f64::from(self.below[node].count_ones());
        leaves * (1.0 - prior_unknown) / self.count.max(1) as f64
    }

    /// Wheels that may be stuck, as bits.
    #[must_use]
    pub fn stuck_wheels(&self) -> u32 {
        bits(&self.stuck)
    }

    /// Wheels whose steering servos may not do as they are told, as bits.
    #[must_use]
    pub fn steered_wheels(&self) -> u32 {
        bits(&self.steer)
    }

    /// Wheels whose encoders may be broken, as bits.
    #[must_use]
    pub fn encoder_wheels(&self) -> u32 {
        bits(&self.encoder)
    }
}

fn bits(leaves: &[Option<usize>; WHEELS]) -> u32 {
    let wheels = leaves.iter().enumerate();
    wheels.fold(0, |bits, (wheel, leaf)| {
        bits | u32::from(leaf.is_some()) << wheel
    })
}

fn leaf_fault(
    text: &str,
    model: &Model,
    robot: &Description,
    sensors: Sensors,
) -> Option<LeafFault> {
    let further = model.further.as_ref().filter(|_| sensors == Sensors::All);
    let currents = further.and_then(|further| further.currents.as_ref());
    if text == "pose" {
        return Some(LeafFault::Pose);
    }
    if text == "gyro" {
        let gyro = further.and_then(|further| further.yaw_rate);
        return gyro.map(|_| LeafFault::Gyro);
    }
    let (kind, wheel) = text.split_once(':')?;
    let wheel = Fault::wheel_of(wheel, robot).ok()?;
    match kind {
        "stuck" => model.stuck(wheel).map(|_| LeafFault::Stuck(wheel)),
        "encoder" => Some(LeafFault::Encoder(wheel)),
        "steer" => {
            let is_read = robot.wheels[wheel].steered && sensors != Sensors::Pose;
            is_read.then_some(LeafFault::Steer(wheel))
        }
        "torque" => currents.map(|_| LeafFault::Torque(wheel)),
        "current" => currents.map(|_| LeafFault::Current(wheel)),
        _ => None,
    }
}
