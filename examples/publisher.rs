//! Publishes a recorded drive into a running graph, through shared memory:
//! `publisher FRAMES.csv.gz RUN [GRAPH] [HZ]`, after `scripts/up --source external --rate 20`.

use std::{error::Error, path::Path};

use vigil_cycle::{Clock, Monotonic, Publisher, clock};
use vigil_recording::frames;
use vigil_setup::load_robot;

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let word =
        |place: usize, otherwise: &'static str| words.get(place).map_or(otherwise, String::as_str);
    let path = words.first().ok_or("which recording?")?;
    let run: u32 = words.get(1).ok_or("which run?")?.parse()?;
    let hz: f64 = word(3, "20").parse()?;
    if !(hz.is_finite() && hz > 0.0) {
        return Err(format!("{hz} Hz is no rate").into());
    }
    // The recording's columns become channels by their names, as `Publisher::channels` does it.
    let runs = frames::read(
        Path::new(path),
        &load_robot("config/robots/rover.toml".as_ref())?,
    )?;
    let run = runs.iter().find(|r| r.id == run).ok_or("no such run")?;
    let mut publisher = Publisher::join(word(2, "rover"))?;
    println!("publishing; scripts/up shows 'alarm' and 'diagnosis'");
    let mut due_ns = Monotonic.now_ns();
    for frame in &run.frames {
        due_ns += (1e9 / hz) as u64;
        clock::sleep_until(due_ns);
        let mut frame = *frame;
        // From 1 on: a capture time of 0 is none.
        frame.header.t_capture_ns += 1;
        publisher.publish(&frame, due_ns)?;
    }
    Ok(())
}
