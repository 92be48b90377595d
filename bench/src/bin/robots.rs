//! Real robots through the same detector: a Kobuki with taped wheels and a Robotino that runs onto
//! another ground, each learned from its own log, with one rule for the alarm.

#![allow(missing_docs)]

use std::error::Error;

use serde_json::json;
use vigil_bench::archive::Archive;
use vigil_bench::real::{self, changes};

/// What the figures mean.
const NOTES: [&str; 5] = [
    "\nKobuki: a window counts if the robot moves in 80 % of it; its score is the highest log-odds \
     in it, evidence from before it forgotten. Same speed: areas within bins of 0.1 m/s of the \
     wheels' mean speed, weighted by pairs. With so few windows without a fault the standard error \
     of right_faulty's area is about 0.03 (Hanley and McNeil). Speed is no feature, and commands \
     that change fast widen the noise.",
    "\nRobotino: a boundary is crossed wheel by wheel, over up to 0.37 m: the change point is the \
     best step through a ramp. `earlier` counts alarms more than 1 s before it.",
    "\nWhat else was tried on Robotino, alarms within 1 s (and by 1 s after the change), of 46: \
     observations of 0.125 s 26 (28), of 0.5 s 20 (23); without wheel rates 35 (39); with wheel \
     rates from the ticks instead of the log's own 16 (16).",
    "\nOne false-alarm interval serves both robots; nothing was set per robot but what its two \
     descriptions say.",
    "\nNo threshold was fitted to the scored parts, but they were looked at while the method was \
     built: these are not blind figures.",
];

fn main() -> Result<(), Box<dyn Error>> {
    let mut archive = Archive::new("robots")?;
    let kobuki = real::kobuki::measure()?;
    for line in kobuki.lines() {
        archive.say(&line);
    }
    archive.store("kobuki.json", &json!(kobuki))?;
    let robotino = real::robotino::measure()?;
    for line in robotino.lines() {
        archive.say(&line);
    }
    for line in changes::lines(&robotino) {
        archive.say(&line);
    }
    archive.store("robotino.json", &json!(robotino))?;
    archive.store_text("robotino-changes.csv", &changes::csv(&robotino))?;
    for line in NOTES {
        archive.say(line);
    }
    println!("archived in {}", archive.close()?.display());
    Ok(())
}
