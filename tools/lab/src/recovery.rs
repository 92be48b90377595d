//! The supervisor over recorded runs: the actions that the robot would have got.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde::de::IntoDeserializer;
use serde::de::value::{Error as Refused, StrDeserializer};
use vigil_blocks::{Action, ControlMode, DetectionBelief, Entry, FaultBelief, RecoveryKind};
use vigil_decision::Recovery;
use vigil_decision::{Compensation, Inputs, Supervisor, SupervisorError};
use vigil_pomdp::Pomdp;
use vigil_robot::FaultTree;
use vigil_robot::{Description, RobotModel};

/// Misses in a row without any detection after which no belief is usable. Recorded frames have no
/// deadlines, so none is ever missed.
const BLIND_MISSES: u32 = 1;

/// What a supervisor is made of. It is made anew for every run.
#[derive(Debug, Clone)]
pub struct Recoverer {
    model: Pomdp,
    tree: FaultTree,
    robot: Description,
    settings: vigil_decision::Settings,
    compensation: Vec<Compensation>,
}

impl Recoverer {
    /// For a decision model whose states are the leaves of the tree and whose actions have the
    /// names of what they make the robot do (`go_on`, `slow_down`, `compensate`, ...).
    ///
    /// # Errors
    /// [`SupervisorError`] if model, tree and robot do not fit together.
    pub fn new(
        model: Pomdp,
        tree: &FaultTree,
        robot: &Description,
        learned: &RobotModel,
    ) -> Result<Self, SupervisorError> {
        let named = |name: &String| {
            let word: StrDeserializer<'_, Refused> = name.as_str().into_deserializer();
            let kind = Recovery::deserialize(word).ok()?;
            let action = vigil_decision::RecoveryAction {
                kind,
                speed_scale: None,
            };
            Some((name.clone(), action))
        };
        let actions: BTreeMap<String, vigil_decision::RecoveryAction> =
            model.actions().iter().filter_map(named).collect();
        let compensation = (0..robot.wheels.len()).map(|wheel| {
            let (curvature_gain, curvature_offset_1_m) = learned.compensation(wheel);
            Compensation {
                wheel,
                curvature_gain,
                curvature_offset_1_m,
            }
        });
        let recoverer = Self {
            compensation: compensation.collect(),
            settings: vigil_decision::Settings {
                actions,
                ..vigil_decision::Settings::default()
            },
            tree: tree.clone(),
            robot: robot.clone(),
            model,
        };
        recoverer.supervisor()?;
        Ok(recoverer)
    }

    fn supervisor(&self) -> Result<Supervisor, SupervisorError> {
        Supervisor::new(
            self.model.clone(),
            None,
            &self.tree,
            &self.robot,
            &self.settings,
            self.compensation.clone(),
            BLIND_MISSES,
        )
    }

    /// A supervisor at the beginning of a run.
    pub fn begin(&self) -> Option<RecoveryRun<'_>> {
        Some(RecoveryRun {
            of: self,
            supervisor: self.supervisor().ok()?,
            action: Box::default(),
        })
    }
}

/// A supervisor over one run.
pub struct RecoveryRun<'a> {
    of: &'a Recoverer,
    supervisor: Supervisor,
    action: Box<Action>,
}

impl RecoveryRun<'_> {
    /// Takes what both stages say of a frame.
    pub fn take(&mut self, detection: &DetectionBelief, diagnosis: &FaultBelief) {
        let inputs = Inputs {
            diagnosis: Some(diagnosis),
            detection: Some(detection),
        };
        self.supervisor.step(Entry::Frame(inputs), &mut self.action);
    }

    /// The block that stands.
    pub const fn action(&self) -> &Action {
        &self.action
    }

    /// The action: its name, and the wheel that it is about after a colon;
    /// `safe_stop` where nothing usable is believed.
    pub fn name(&self) -> String {
        let action = &self.action;
        let is_safe = action.control_mode == ControlMode::Safe as u32;
        if is_safe || RecoveryKind::from_repr(action.kind).is_none() {
            return vigil_evaluation::scoring::field::SAFE_STOP.to_owned();
        }
        let name = self.of.model.actions().get(action.action as usize);
        let name = name.map_or("?", String::as_str);
        match self.of.robot.wheels.get(action.wheel as usize) {
            Some(wheel) => format!("{name}:{}", wheel.name),
            None => name.to_owned(),
        }
    }
}
