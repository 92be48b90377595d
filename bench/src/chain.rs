//! Four processes that do nothing but hand blocks on: what a hand-over costs by itself.
//!
//! The source is woken by the schedule, every other stage by its input; each reads its input, fills
//! a block and passes it on. What a carrier does to have its next block comes after that, as in a
//! service. A stage is this program again (or, over a queue, a thread of it), placed like the
//! service it stands for, and leaves stamps of the same form as a service.

use std::error::Error;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use vigil_cycle::placement::{self, PlacementRequest};
use vigil_cycle::{Clock, CycleStamps, Monotonic, Stamps, clock, signal, stamps};

use carriers::Carrier;

pub mod carriers;
mod futex;
mod payload;
mod queue;

/// Stages of the chain.
pub const STAGES: usize = 4;
/// Their names, in the order of the data.
pub const STAGE_NAMES: [&str; STAGES] = ["sensor-sim", "detector", "identifier", "supervisor"];

/// Silence after which a stage ends: the source is done, or has failed.
const SILENCE: Duration = Duration::from_secs(2);
const WAIT: Duration = Duration::from_millis(100);
/// Time for all stages to be ready before the first cycle, ns.
const START_NS: u64 = 400_000_000;

/// The word with which the program is a stage of a chain.
pub const STAGE_WORD: &str = "chain-stage";

/// What hands over what, where and how often.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Chain {
    /// How blocks are handed over.
    pub carrier: Carrier,
    /// Bytes that each stage writes in a cycle.
    pub sizes: [usize; STAGES],
    /// Core and priority of each stage.
    pub placed: [(usize, u8); STAGES],
    /// Period of the schedule, ns.
    pub period_ns: u64,
    /// Cycles.
    pub cycles: u64,
}

/// One stage of a chain, as its process gets it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Role {
    chain: Chain,
    stage: usize,
    first_ns: u64,
    /// Where what the carriers share lies.
    shared: PathBuf,
    /// Where stamps go.
    folder: PathBuf,
}

impl Chain {
    /// Runs the chain, its files in `folder`; the stamps of its stages.
    ///
    /// # Errors
    /// If a stage cannot be started, fails, or leaves no stamps.
    pub fn run(&self, folder: &Path) -> Result<[Vec<CycleStamps>; STAGES], Box<dyn Error>> {
        let shared = PathBuf::from(format!("/dev/shm/vigil-chain-{}", std::process::id()));
        std::fs::create_dir_all(&shared)?;
        let role = |stage| Role {
            chain: self.clone(),
            stage,
            first_ns: Monotonic.now_ns() + START_NS,
            shared: shared.clone(),
            folder: folder.to_owned(),
        };
        let roles: [Role; STAGES] = std::array::from_fn(role);
        let result = match self.carrier {
            Carrier::Queue => queue::run(&roles),
            _ => run_processes(&roles),
        };
        let _ = std::fs::remove_dir_all(&shared);
        payload::clean(&shared);
        result?;
        let read = |stage: usize| stamps::read(&roles[stage].file());
        Ok([read(0)?, read(1)?, read(2)?, read(3)?])
    }
}

impl Role {
    fn file(&self) -> PathBuf {
        let name = STAGE_NAMES[self.stage];
        self.folder.join(format!("chain-{name}.stamps"))
    }

    fn place(&self) {
        let (core, priority) = self.chain.placed[self.stage];
        let _ = placement::apply(PlacementRequest { core, priority });
    }

    /// Plays the role between these two; none before the source.
    fn play(
        &self,
        input: Option<&mut dyn Incoming>,
        output: &mut dyn Outgoing,
    ) -> Result<(), Box<dyn Error>> {
        let mut kept = Stamps::new(self.chain.cycles as usize);
        match input {
            None => self.drive(output, &mut kept)?,
            Some(input) => self.relay(input, output, &mut kept)?,
        }
        kept.write(&self.file())?;
        Ok(())
    }

    fn drive(&self, output: &mut dyn Outgoing, kept: &mut Stamps) -> Result<(), Box<dyn Error>> {
        let Chain {
            period_ns, cycles, ..
        } = self.chain;
        for cycle in 0..cycles {
            let t_schedule_ns = self.first_ns + cycle * period_ns;
            while Monotonic.now_ns() < t_schedule_ns {
                clock::sleep_until(t_schedule_ns);
            }
            let t_wake_ns = Monotonic.now_ns();
            // As in the graph, a source that has slept through an instant leaves it out.
            if t_wake_ns >= t_schedule_ns + period_ns && cycle + 1 < cycles {
                continue;
            }
            output.fill(cycle as u8);
            let t_publish_ns = output.publish(t_schedule_ns)?;
            kept.push(CycleStamps {
                t_schedule_ns,
                t_input_ns: t_schedule_ns,
                t_wake_ns,
                t_publish_ns,
            });
        }
        Ok(())
    }

    fn relay(
        &self,
        input: &mut dyn Incoming,
        output: &mut dyn Outgoing,
        kept: &mut Stamps,
    ) -> Result<(), Box<dyn Error>> {
        let mut silent = Duration::ZERO;
        while silent < SILENCE && !signal::stop_requested() {
            let Some((t_schedule_ns, t_input_ns)) = input.receive(WAIT)? else {
                silent += WAIT;
                continue;
            };
            let t_wake_ns = Monotonic.now_ns();
            silent = Duration::ZERO;
            output.fill(input.checksum() as u8);
            let t_publish_ns = output.publish(t_schedule_ns)?;
            kept.push(CycleStamps {
                t_schedule_ns,
                t_input_ns,
                t_wake_ns,
                t_publish_ns,
            });
        }
        Ok(())
    }
}

/// What a stage gets.
pub trait Incoming {
    /// Waits for a block, at most for `limit`; its scheduled and its publication instant, ns.
    ///
    /// # Errors
    /// The system's.
    fn receive(&mut self, limit: Duration) -> Result<Option<(u64, u64)>, Box<dyn Error>>;

    /// Sum over one byte of each cache line of the last block: what looking at it costs.
    fn checksum(&self) -> u64;
}

/// What a stage gives.
pub trait Outgoing {
    /// Fills the next block with one byte.
    fn fill(&mut self, byte: u8);

    /// Passes it on; returns the publication instant that it carries, ns.
    ///
    /// # Errors
    /// The system's.
    fn publish(&mut self, t_schedule_ns: u64) -> Result<u64, Box<dyn Error>>;
}

/// Sum over one byte of each cache line.
#[must_use]
pub fn sum_lines(bytes: &[u8]) -> u64 {
    bytes.iter().step_by(64).map(|b| u64::from(*b)).sum()
}

/// Processes that end with whoever started them.
struct Children(Vec<Child>);

impl Drop for Children {
    fn drop(&mut self) {
        for child in &mut self.0 {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

fn run_processes(roles: &[Role; STAGES]) -> Result<(), Box<dyn Error>> {
    let program = std::env::current_exe()?;
    let mut children = Children(Vec::new());
    // The last of the chain first: it waits.
    for role in roles.iter().rev() {
        let child = Command::new(&program)
            .arg(STAGE_WORD)
            .arg(serde_json::to_string(role)?)
            .stdin(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()?;
        children.0.push(child);
    }
    // One that fails leaves the others waiting for it.
    while !children.0.is_empty() {
        let mut running = Vec::new();
        while let Some(mut child) = children.0.pop() {
            match child.try_wait()? {
                None => running.push(child),
                Some(status) if status.success() => {}
                Some(status) => {
                    children.0.append(&mut running);
                    let said = said(&mut child);
                    return Err(format!("a stage ended with {status}: {said}").into());
                }
            }
        }
        children.0 = running;
        std::thread::sleep(WAIT / 10);
    }
    Ok(())
}

/// The last line that a stage which has ended printed.
fn said(child: &mut Child) -> String {
    let mut text = String::new();
    if let Some(mut stderr) = child.stderr.take() {
        let _ = stderr.read_to_string(&mut text);
    }
    text.lines().last().unwrap_or_default().to_owned()
}

/// Is a stage of a chain, as the argument after [`STAGE_WORD`] says.
///
/// # Errors
/// A wrong argument, or the system's.
pub fn be_stage(role: &str) -> Result<(), Box<dyn Error>> {
    let role: Role = serde_json::from_str(role)?;
    signal::install();
    role.place();
    let (carrier, sizes) = (role.chain.carrier, role.chain.sizes);
    // Readers open first, where that matters to the carrier.
    let mut input = match role.stage.checked_sub(1) {
        None => None,
        Some(before) => Some(carrier.incoming(&role.shared, before, sizes[before])?),
    };
    let mut output = carrier.outgoing(&role.shared, role.stage, sizes[role.stage])?;
    let input: Option<&mut dyn Incoming> = match &mut input {
        Some(input) => Some(input.as_mut()),
        None => None,
    };
    role.play(input, output.as_mut())
}
