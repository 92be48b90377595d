//! Real robots through the same detector: a Kobuki with taped wheels and a Robotino that runs onto
//! another ground, each learned from its own log, with one rule for the alarm.

#![allow(missing_docs)]

use std::error::Error;

use serde_json::json;
use vigil_bench::archive::Archive;
use vigil_bench::real;

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
    archive.store("robotino.json", &json!(robotino))?;
    println!("archived in {}", archive.close()?.display());
    Ok(())
}
