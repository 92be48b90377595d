//! A model in code, solved and acted on: a parcel lies in one of four rooms of a corridor.
//!
//! ```text
//! worth 7.15 to 7.16 at best
//! room 0: look -> nothing
//! room 0: go-on -> nothing
//! room 1: look -> nothing
//! room 1: go-on -> nothing
//! room 2: look -> parcel
//! room 2: take -> nothing
//! ```

use std::error::Error;

use vigil_pomdp::solver::{self, Options};
use vigil_pomdp::{Budget, PointBased, Policy, Pomdp, Process, Tracker};

const ROOMS: usize = 4;
const ACTIONS: [&str; 3] = ["go-on", "look", "take"];
/// A look shows a parcel that is there with this probability, and none that is not.
const SEEN: f64 = 0.8;

/// State: where the robot stands and where the parcel lies, `robot * ROOMS + parcel`.
struct Corridor;

impl Process for Corridor {
    fn discount(&self) -> f64 {
        0.95
    }

    fn states(&self) -> Vec<String> {
        let all = (0..ROOMS * ROOMS).map(|s| format!("robot{}-parcel{}", s / ROOMS, s % ROOMS));
        // The last state is the end.
        all.chain(["done".to_owned()]).collect()
    }

    fn actions(&self) -> Vec<String> {
        ACTIONS.map(str::to_owned).to_vec()
    }

    fn observations(&self) -> Vec<String> {
        ["nothing", "parcel"].map(str::to_owned).to_vec()
    }

    fn start(&self) -> Vec<(usize, f64)> {
        (0..ROOMS)
            .map(|parcel| (parcel, 1.0 / ROOMS as f64))
            .collect()
    }

    fn transition(&self, state: usize, action: usize) -> Vec<(usize, f64)> {
        let (robot, parcel) = (state / ROOMS, state % ROOMS);
        let next = match ACTIONS[action] {
            _ if robot == ROOMS => state,
            "go-on" => (robot + 1) % ROOMS * ROOMS + parcel,
            "take" => ROOMS * ROOMS,
            _ => state,
        };
        vec![(next, 1.0)]
    }

    fn observation(&self, action: usize, next: usize) -> Vec<(usize, f64)> {
        let is_there = next / ROOMS == next % ROOMS;
        let seen = if ACTIONS[action] == "look" && is_there {
            SEEN
        } else {
            0.0
        };
        vec![(0, 1.0 - seen), (1, seen)]
    }

    fn reward(&self, state: usize, action: usize) -> f64 {
        let (robot, parcel) = (state / ROOMS, state % ROOMS);
        match ACTIONS[action] {
            _ if robot == ROOMS => 0.0,
            "take" if robot == parcel => 10.0,
            "take" => -20.0,
            _ => -0.1,
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let model = Pomdp::from_process(&Corridor)?;

    let (mut stop, mut watch) = (|| false, |_: &solver::Progress| ());
    let options = Options {
        precision: 0.01,
        ..Options::default()
    };
    let found = solver::solve(&model, &options, &mut Budget::new(&mut stop), &mut watch)?;
    println!(
        "worth {:.2} to {:.2} at best",
        found.bracket.lower, found.bracket.upper
    );

    // The robot stands in room 0, the parcel lies in room 2.
    let (mut robot, parcel) = (0, 2);
    let mut policy = PointBased::new(&model, &found.vectors.ok_or("no policy yet")?)?;
    let mut tracker = Tracker::new(&model);
    let mut values = vec![0.0; model.actions().len()];
    for _ in 0..20 {
        let action = policy.evaluate(tracker.belief(), &mut values).action;
        let is_seen = ACTIONS[action] == "look" && robot == parcel;
        println!(
            "room {robot}: {} -> {}",
            ACTIONS[action],
            model.observations()[usize::from(is_seen)]
        );
        match ACTIONS[action] {
            "take" => break,
            "go-on" => robot = (robot + 1) % ROOMS,
            _ => {}
        }
        tracker.update(&model, action, usize::from(is_seen));
    }
    Ok(())
}
