//! The floor: the graph's four processes, priorities and block sizes, handed over by a futex.
//!
//! A stage reads its input in place, fills a block as large as the graph's and wakes the next. Each
//! process is this program again, placed like the service it stands for; it leaves stamps of the
//! same form.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use vigil_blocks::{Action, DetectionBelief, FaultBelief, ParticleBlock, SensorFrame};
use vigil_cycle::futex::FutexBlock;
use vigil_cycle::placement::{self, Wanted};
use vigil_cycle::{Clock, CycleStamps, Monotonic, Stamps, clock, signal, stamps};

use super::cycles::{STAGE_NAMES, STAGES};

/// Bytes that each stage writes in a cycle.
const SIZES: [usize; STAGES] = [
    size_of::<SensorFrame>(),
    size_of::<DetectionBelief>() + size_of::<ParticleBlock>(),
    size_of::<FaultBelief>() + size_of::<ParticleBlock>(),
    size_of::<Action>(),
];
/// Silence after which a stage ends: the source is done, or has failed.
const SILENCE: Duration = Duration::from_secs(2);
const WAIT: Duration = Duration::from_millis(100);
/// Time for all processes to be ready before the first cycle, ns.
const START_NS: u64 = 300_000_000;

/// First argument of a process that is a stage of the floor.
pub const STAGE_WORD: &str = "floor-stage";

/// Where and how the floor runs.
#[derive(Debug, Clone)]
pub struct Floor {
    /// Core and priority of each stage.
    pub wanted: [Wanted; STAGES],
    /// Period of the schedule, ns.
    pub period_ns: u64,
    /// Cycles.
    pub cycles: u64,
}

/// Runs the floor in `folder`; the stamps of its stages.
///
/// # Errors
/// If a process cannot be started, fails, or leaves no stamps.
pub fn run(floor: &Floor, folder: &Path) -> Result<[Vec<CycleStamps>; STAGES], Box<dyn Error>> {
    let first_ns = Monotonic.now_ns() + START_NS;
    let program = std::env::current_exe()?;
    let blocks = shared_folder();
    std::fs::create_dir_all(&blocks)?;
    let result = (|| {
        // The last of the chain first: it waits.
        let mut children: Vec<Child> = Vec::new();
        for stage in (0..STAGES).rev() {
            let wanted = floor.wanted[stage];
            let numbers = [
                stage as u64,
                wanted.core as u64,
                u64::from(wanted.priority),
                floor.period_ns,
                floor.cycles,
                first_ns,
            ];
            let child = Command::new(&program)
                .arg(STAGE_WORD)
                .args(numbers.map(|n| n.to_string()))
                .arg(&blocks)
                .arg(folder)
                .stdin(Stdio::null())
                .spawn()?;
            children.push(child);
        }
        for mut child in children {
            let status = child.wait()?;
            if !status.success() {
                return Err(format!("a stage of the floor ended with {status}").into());
            }
        }
        let read = |stage: usize| stamps::read(&file(folder, stage));
        Ok([read(0)?, read(1)?, read(2)?, read(3)?])
    })();
    let _ = std::fs::remove_dir_all(&blocks);
    result
}

fn shared_folder() -> PathBuf {
    PathBuf::from(format!("/dev/shm/vigil-floor-{}", std::process::id()))
}

fn file(folder: &Path, stage: usize) -> PathBuf {
    folder.join(format!("floor-{}.stamps", STAGE_NAMES[stage]))
}

/// Is a stage of the floor, with the arguments after [`STAGE_WORD`].
///
/// # Errors
/// Wrong arguments, or the system's.
pub fn be_stage(arguments: &[String]) -> Result<(), Box<dyn Error>> {
    let number = |i: usize| -> Result<u64, Box<dyn Error>> {
        Ok(arguments.get(i).ok_or("too few arguments")?.parse()?)
    };
    let path = |i: usize| arguments.get(i).map(PathBuf::from).ok_or("no folder");
    let (stage, cycles) = (number(0)? as usize, number(4)?);
    let (blocks, folder) = (path(6)?, path(7)?);
    signal::install();
    let _ = placement::apply(Wanted {
        core: number(1)? as usize,
        priority: u8::try_from(number(2)?)?,
    });
    let open = |stage: usize| {
        let size = *SIZES.get(stage).ok_or("no such stage")?;
        Ok::<_, Box<dyn Error>>(FutexBlock::open(&blocks.join(stage.to_string()), size)?)
    };
    let mut output = open(stage)?;
    let mut kept = Stamps::new(cycles as usize);
    match stage.checked_sub(1) {
        None => drive(&mut output, number(3)?, cycles, number(5)?, &mut kept),
        Some(before) => relay(&open(before)?, &mut output, cycles, &mut kept),
    }
    kept.write(&file(&folder, stage))?;
    Ok(())
}

/// The source: woken by the schedule.
fn drive(output: &mut FutexBlock, period_ns: u64, cycles: u64, first_ns: u64, kept: &mut Stamps) {
    for cycle in 0..cycles {
        let t_schedule_ns = first_ns + cycle * period_ns;
        while Monotonic.now_ns() < t_schedule_ns {
            clock::sleep_until(t_schedule_ns);
        }
        // As in the graph, a source that has slept through an instant leaves it out.
        if Monotonic.now_ns() >= t_schedule_ns + period_ns && cycle + 1 < cycles {
            continue;
        }
        let t_wake_ns = Monotonic.now_ns();
        output.fill(cycle as u8);
        publish(output, (t_schedule_ns, t_schedule_ns, t_wake_ns), kept);
    }
}

/// Any other stage: woken by its input.
fn relay(input: &FutexBlock, output: &mut FutexBlock, cycles: u64, kept: &mut Stamps) {
    let (mut seen, mut silent) = (0, Duration::ZERO);
    let mut last_ns = 0;
    let mut answered = 0;
    while answered < cycles && silent < SILENCE && !signal::stop_requested() {
        let count = input.wait(seen, WAIT);
        if count == seen {
            silent += WAIT;
            continue;
        }
        let t_wake_ns = Monotonic.now_ns();
        (seen, silent) = (count, Duration::ZERO);
        let (t_schedule_ns, t_input_ns) = input.times_ns();
        if t_schedule_ns == last_ns {
            continue; // Woken between two stores of the writer.
        }
        last_ns = t_schedule_ns;
        output.fill(input.checksum() as u8);
        publish(output, (t_schedule_ns, t_input_ns, t_wake_ns), kept);
        answered += 1;
    }
}

fn publish(
    output: &FutexBlock,
    (t_schedule_ns, t_input_ns, t_wake_ns): (u64, u64, u64),
    kept: &mut Stamps,
) {
    let t_publish_ns = Monotonic.now_ns();
    output.publish(t_schedule_ns, t_publish_ns);
    kept.push(CycleStamps {
        t_schedule_ns,
        t_input_ns,
        t_wake_ns,
        t_publish_ns,
    });
}
