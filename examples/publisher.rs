//! Publishes a recorded drive into a running graph, through shared memory:
//! `publisher FRAMES.csv.gz RUN [GRAPH]`, after `scripts/up --source external --rate 20`.

use std::{error::Error, path::Path};

use vigil_blocks::SensorFrame;
use vigil_cycle::{Clock, Graph, Monotonic, Stamp, Topic, clock, port::Link};
use vigil_recording::frames;
use vigil_setup::GraphArgs;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("which recording?")?;
    let run: u32 = std::env::args().nth(2).ok_or("which run?")?.parse()?;
    let mut args = GraphArgs::default();
    (args.config, args.rate) = ("config/rover.toml".into(), Some(20.0));
    args.graph = std::env::args().nth(3);
    let setup = args.load()?;
    let runs = frames::read(Path::new(&path), &setup.robot)?;
    let run = runs.iter().find(|r| r.id == run).ok_or("no such run")?;
    let domain = setup.domain()?;
    while !domain.processes_file().exists() {
        clock::sleep_until(Monotonic.now_ns() + 100_000_000);
    }
    let graph = Graph::SharedMemory(Link::join(&domain, "publisher")?);
    let mut sender = graph.sender::<SensorFrame>(Topic::Sensor)?;
    println!("publishing; scripts/up shows 'alarm' and 'diagnosis'");
    let mut t_schedule_ns = Monotonic.now_ns();
    for frame in &run.frames {
        t_schedule_ns += setup.period_ns();
        clock::sleep_until(t_schedule_ns);
        // Written in place; schema, epoch, sequence number and publication time are the sender's.
        *sender.block() = *frame;
        let stamp = Stamp {
            t_schedule_ns,
            t_capture_ns: frame.header.t_capture_ns,
        };
        sender.send(stamp, &Monotonic)?;
    }
    Ok(())
}
