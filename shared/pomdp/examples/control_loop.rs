//! A control loop: a model and a policy from files, and a belief. A step allocates nothing.
//!
//! `control_loop [MODEL.pomdp POLICY.json]`; without them, the gearbox beside this program, solved
//! by `vigil pomdp solve gearbox.pomdp --out gearbox.policy.json`.
//!
//! ```text
//!      run  p(observation) 0.500  belief [0.950, 0.050]
//!      run  p(observation) 0.500  belief [0.902, 0.098]
//!  inspect  p(observation) 0.822  belief [0.988, 0.012]
//!      run  p(observation) 0.500  belief [0.939, 0.061]
//!  inspect  p(observation) 0.149  belief [0.630, 0.370]
//!  inspect  p(observation) 0.396  belief [0.159, 0.841]
//! ```

use std::error::Error;

use vigil_pomdp::policy_file::PolicyFile;
use vigil_pomdp::{Evidence, PointBased, Policy, Pomdp, Tracker};

/// Built once; all that a step needs is in here.
pub struct Controller {
    model: Pomdp,
    tracker: Tracker,
    policy: PointBased,
    values: Vec<f64>,
    action: usize,
}

impl Controller {
    /// A controller of a model and its policy, both as their files hold them.
    ///
    /// # Errors
    /// A text that is no model, bytes that are no policy of it.
    pub fn new(model: &str, policy: &[u8]) -> Result<Self, Box<dyn Error>> {
        let model = Pomdp::parse(model)?;
        let file = PolicyFile::read(policy, &model)?;
        let mut controller = Self {
            tracker: Tracker::new(&model),
            policy: PointBased::new(&model, &file.vectors)?,
            values: vec![0.0; model.actions().len()],
            action: 0,
            model,
        };
        controller.decide();
        Ok(controller)
    }

    fn decide(&mut self) {
        self.action = self
            .policy
            .evaluate(self.tracker.belief(), &mut self.values)
            .action;
    }

    /// Takes what was observed after the last action, and decides the next one.
    pub fn step(&mut self, observation: usize) -> Evidence {
        let evidence = self.tracker.update(&self.model, self.action, observation);
        self.decide();
        evidence
    }

    /// Name of the action that is due.
    pub fn action(&self) -> &str {
        &self.model.actions()[self.action]
    }

    /// The belief, one probability a state.
    pub fn belief(&self) -> &[f64] {
        self.tracker.belief()
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut files = std::env::args().skip(1);
    let mut controller = match (files.next(), files.next()) {
        (Some(model), Some(policy)) => {
            Controller::new(&std::fs::read_to_string(model)?, &std::fs::read(policy)?)?
        }
        _ => Controller::new(
            include_str!("gearbox.pomdp"),
            include_bytes!("gearbox.policy.json"),
        )?,
    };
    // What the sensors say, one observation a week.
    for observation in [0, 1, 0, 0, 1, 1] {
        print!("{:>8}", controller.action());
        match controller.step(observation) {
            Evidence::Taken(p) => print!("  p(observation) {p:.3}"),
            // The model is wrong, or a fault is not in it; the belief goes on from the prediction.
            Evidence::Impossible => print!("  impossible observation"),
        }
        println!("  belief {:.3?}", controller.belief());
    }
    Ok(())
}
