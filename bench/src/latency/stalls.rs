//! Stalls of known origin in a running graph: what does the report say of each?
//!
//! A stage that is stopped by a signal is to the report what a stage is that computes for too long:
//! Vigil's own. A process that keeps a core above the canaries' priority is what an interrupt, a
//! hypervisor or a kernel thread is: the machine's.

use std::error::Error;
use std::path::Path;
use std::time::{Duration, Instant};

use vigil_blocks::Action;
use vigil_cycle::canary::{Canary, Seen};
use vigil_cycle::placement::{self, Wanted};
use vigil_cycle::port::Link;
use vigil_cycle::{Clock, Domain, Graph, Monotonic, Topic, clock, signal};

use super::attribution::{self, Miss, Record};
use super::cell;
use super::cycles::{self, STAGE_NAMES, STAGES};
use super::graph::Prepared;

/// From the first action to the first stall, s.
const WARM_UP_S: f64 = 2.0;
/// Time that the graph may take to its first action, s.
const START_S: f64 = 10.0;
/// Between two stalls: what one leaves behind is done before the next.
const GAP: Duration = Duration::from_millis(250);
/// Time to start and stop the graph, s.
const AROUND_S: f64 = 60.0;
/// Priority of who makes stalls: above graph and canaries.
const MAKER_PRIORITY: u8 = 95;

/// Who made a stall.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// A stage of the graph: stopped by a signal, then continued.
    Graph,
    /// Another process, above the canaries, on a core of the graph.
    Machine,
}

/// One stall.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stall {
    /// Who made it.
    pub origin: Origin,
    /// How long it was to last.
    pub length: Duration,
    /// From when to when it may have lasted, ns.
    pub t_ns: [u64; 2],
}

/// What was said of stalls.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Told {
    /// Stalls.
    pub stalls: usize,
    /// Those of them in which no cycle was missed.
    pub unseen: usize,
    /// Missed cycles that were due or not yet done in a stall: said to be Vigil's own, the
    /// machine's.
    pub within: [usize; 2],
    /// Those due after a stall and before the next one: what it has left behind.
    pub after: [usize; 2],
}

impl Told {
    /// Of the stalls that are `wanted`, from all `stalls` in order and all `misses`.
    #[must_use]
    pub fn of(stalls: &[Stall], misses: &[Miss], wanted: impl Fn(&Stall) -> bool) -> Self {
        let mut told = Self::default();
        for (i, stall) in stalls.iter().enumerate().filter(|(_, s)| wanted(s)) {
            let [from_ns, to_ns] = stall.t_ns;
            let next_ns = stalls.get(i + 1).map_or(u64::MAX, |next| next.t_ns[0]);
            let within = |m: &&Miss| m.t_schedule_ns <= to_ns && m.t_done_ns >= from_ns;
            let after = |m: &&Miss| m.t_schedule_ns > to_ns && m.t_done_ns < next_ns;
            let (within, after) = (
                verdicts(misses.iter().filter(within)),
                verdicts(misses.iter().filter(after)),
            );
            told.stalls += 1;
            told.unseen += usize::from(within == [0; 2]);
            for verdict in 0..2 {
                told.within[verdict] += within[verdict];
                told.after[verdict] += after[verdict];
            }
        }
        told
    }
}

/// How many are said to be Vigil's own, and the machine's.
fn verdicts<'a>(misses: impl Iterator<Item = &'a Miss>) -> [usize; 2] {
    misses.fold([0; 2], |mut counts, miss| {
        counts[usize::from(miss.is_machine)] += 1;
        counts
    })
}

/// Runs the graph with `count` stalls of each origin for each of `lengths`; the stalls and all
/// missed cycles. Stops go round the stages, kept cores round the cores.
///
/// # Errors
/// If the graph fails, a service had to be restarted, or canaries or the keeper of a core may not
/// run above the graph.
pub fn run(
    prepared: &Prepared,
    (count, lengths): (usize, &[Duration]),
    folder: &Path,
) -> Result<(Vec<Stall>, Vec<Miss>), Box<dyn Error>> {
    let stalled: Duration = lengths.iter().sum();
    let all_s = 2.0 * count as f64 * (stalled + GAP * lengths.len() as u32).as_secs_f64();
    // The graph is to outlast the last one.
    let seconds = START_S + WARM_UP_S + 1.2 * all_s;
    let canaries = prepared.canaries(seconds + AROUND_S)?;
    let mut stalls = Vec::new();
    let domain = prepared.setup().domain()?;
    let ran = prepared.run(seconds, folder, || {
        prepared.wait_until_started()?;
        stalls = make(&domain, &prepared.cores(), (count, lengths))?;
        Ok(())
    })?;
    let seen: Vec<Seen> = canaries.into_iter().filter_map(Canary::finish).collect();
    if !cell::check(&ran.summary, &seen, &prepared.wanted())? {
        return Err("canaries may not run above the graph: nothing can be attributed".into());
    }
    let records: Vec<Record<'_>> = seen.iter().map(Record::of).collect();
    let cycles = cycles::join(&ran.stamps, prepared.setup().period_ns(), 0);
    let misses = attribution::misses(&cycles, prepared.deadline_ns(), &records);
    Ok((stalls, misses))
}

fn make(
    domain: &Domain,
    cores: &[usize],
    (count, lengths): (usize, &[Duration]),
) -> Result<Vec<Stall>, Box<dyn Error>> {
    wait_for_the_first_action(domain)?;
    let pids = pids(domain)?;
    let (cores, lengths) = (cores.to_vec(), lengths.to_vec());
    // One thread for all of them: to start one above everything else is a stall of its own.
    let maker = std::thread::spawn(move || {
        let placement = placement::apply(Wanted {
            core: cores[0],
            priority: MAKER_PRIORITY,
        });
        if placement.priority != u32::from(MAKER_PRIORITY) {
            return None;
        }
        std::thread::sleep(Duration::from_secs_f64(WARM_UP_S));
        let mut stalls = Vec::new();
        for i in 0..count {
            placement::pin(cores[i % cores.len()]);
            for &length in &lengths {
                for origin in [Origin::Graph, Origin::Machine] {
                    std::thread::sleep(GAP);
                    stalls.push(one(origin, pids[i % STAGES], length));
                }
            }
        }
        Some(stalls)
    });
    let stalls = maker.join().map_err(|_| "who makes stalls has died")?;
    Ok(stalls.ok_or("no stall may be made: real-time priority is not permitted")?)
}

/// Makes a stall: of this process, or of the core that we run on.
fn one(origin: Origin, pid: u32, length: Duration) -> Stall {
    let from_ns = Monotonic.now_ns();
    let until_ns = from_ns + length.as_nanos() as u64;
    match origin {
        Origin::Graph => {
            signal::hold(pid);
            clock::sleep_until(until_ns);
            signal::release(pid);
        }
        Origin::Machine => {
            while Monotonic.now_ns() < until_ns {
                std::hint::spin_loop();
            }
        }
    }
    Stall {
        origin,
        length,
        t_ns: [from_ns, Monotonic.now_ns()],
    }
}

fn wait_for_the_first_action(domain: &Domain) -> Result<(), Box<dyn Error>> {
    let until = Instant::now() + Duration::from_secs_f64(AROUND_S);
    let graph = Graph::SharedMemory(Link::join(domain, "stalls")?);
    let mut actions = graph.receiver::<Action>(Topic::Action)?;
    while !actions.advance() {
        if Instant::now() > until {
            return Err("the graph did nothing".into());
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    Ok(())
}

/// Process of each stage.
fn pids(domain: &Domain) -> Result<[u32; STAGES], Box<dyn Error>> {
    let text = std::fs::read_to_string(domain.processes_file())?;
    let mut pids = [0; STAGES];
    for (pid, name) in pids.iter_mut().zip(STAGE_NAMES) {
        let line = text.lines().find_map(|line| line.strip_prefix(name));
        *pid = line.ok_or("a service is not listed")?.trim().parse()?;
    }
    Ok(pids)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn misses_are_told_by_the_stall_that_they_touch_or_follow() {
        let stall = |origin, t_ns| Stall {
            origin,
            length: Duration::from_millis(20),
            t_ns,
        };
        let stalls = [
            stall(Origin::Graph, [100, 200]),
            stall(Origin::Machine, [500, 600]),
            stall(Origin::Graph, [800, 900]),
        ];
        let miss = |t_schedule_ns, t_done_ns, is_machine| Miss {
            t_schedule_ns,
            t_done_ns,
            overrun_ns: 1,
            is_machine,
            is_one_stall: is_machine,
        };
        let misses = [
            miss(10, 50, false), // before everything
            miss(90, 210, false),
            miss(150, 210, true),
            miss(210, 300, false), // after the first
            miss(450, 510, true),
            miss(610, 700, true), // after the second
        ];
        let of = |origin| Told::of(&stalls, &misses, |s| s.origin == origin);
        let graph = Told {
            stalls: 2,
            unseen: 1,
            within: [1, 1],
            after: [1, 0],
        };
        let machine = Told {
            stalls: 1,
            unseen: 0,
            within: [0, 1],
            after: [0, 1],
        };
        assert_eq!([of(Origin::Graph), of(Origin::Machine)], [graph, machine]);
    }
}
