//! `vigil replay`: a recording, computed again and compared bit by bit.

use std::io::{self, BufRead};
use std::path::PathBuf;
use std::thread;
use std::time::{Duration, Instant};

use schemars::JsonSchema;
use serde::Serialize;
use vigil_blocks::OverallState;
use vigil_cycle::topic::ServiceName;
use vigil_replay::{Answer, Difference, Moment, Replay, Tally, What};
use vigil_setup::Setup;
use vigil_terminal::{CommandError, Outcome, output};
use vigil_timeline::unix_time_of_day;

/// Differences and gaps that are listed at most; all are counted.
const LISTED_MAX: usize = 20;
/// Longest time that is waited for, s: gaps of a recording are cut out.
const WAIT_S_MAX: f64 = 10.0;

/// Computes again what a recorded graph believed and did, and compares it bit by bit.
///
/// Prints each change of alarm, name and action as it is computed, and what differs from the
/// recording. A service is computed from its start, or from the first state that it handed out.
/// What was not recorded is named, and the service waits for its next state.
///
/// Ends with 1 if anything differs, or nothing could be compared.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A recording of the black box, such as `vigil recordings` lists.
    #[arg(value_name = "RECORDING")]
    recording: PathBuf,
    /// Only compare: print no changes.
    #[arg(long)]
    verify: bool,
    /// Times as fast as it was; without it as fast as it goes.
    #[arg(long, value_name = "FACTOR", conflicts_with = "verify", value_parser = factor)]
    speed: Option<f64>,
    /// Wait for Enter after each line.
    #[arg(long, conflicts_with_all = ["verify", "speed", "json"])]
    step: bool,
    /// Print one JSON document at the end, and nothing else.
    #[arg(long, conflicts_with = "speed")]
    json: bool,
}

fn factor(text: &str) -> Result<f64, String> {
    let factor = text.parse().ok();
    let allowed = factor.filter(|factor: &f64| (1e-3..=1e6).contains(factor));
    allowed.ok_or_else(|| "allowed is 0.001 to 1000000".to_owned())
}

/// What it prints with --json.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Document {
    /// Version of this document.
    schema_version: u32,
    /// Path of the recording.
    recording: String,
    /// Name of the graph that was recorded.
    graph: String,
    /// True if answers of each service were compared, and nothing differs.
    identical: bool,
    /// Time of the recording that was computed, s.
    recorded_s: f64,
    /// How many times as fast as it was.
    speed: f64,
    /// True if the file was cut short.
    is_cut: bool,
    /// Why the rest of the file cannot be read; null if all of it was.
    damaged: Option<String>,
    /// Blocks of another version, which nothing can be computed from.
    foreign_blocks: u64,
    /// The services whose steps are computed.
    services: Vec<ComparedService>,
    /// Up to 20 differences, by time; all are counted in `services`.
    differences: Vec<ListedDifference>,
    /// Up to 20 gaps; all are counted in `services`.
    gaps: Vec<ListedGap>,
}

/// What became of a service's answers.
#[derive(Debug, Serialize, JsonSchema)]
struct ComparedService {
    /// Its name.
    service: &'static str,
    /// Answers that the journal tells of.
    answers: u64,
    /// Those that were computed again, and whose block was recorded.
    compared: u64,
    /// Of these, the ones that are not the same to the last bit.
    different: u64,
    /// Answers that were computed again, and whose block was not recorded.
    unrecorded: u64,
    /// States that were compared with what was handed out.
    states: u64,
    /// Times at which the service began to be computed: its start, or a state.
    begun: u64,
    /// Gaps, after which it waits for its next start or state.
    gaps: u64,
}

/// An answer or state that is not the same to the last bit.
#[derive(Debug, Serialize, JsonSchema)]
struct ListedDifference {
    /// Name of the service.
    service: &'static str,
    /// When it was recorded, s since 1970.
    t_unix_s: f64,
    /// Sequence number of the recorded block; of the one before, for a state.
    block_seq: u64,
    /// The field, with an array's index; of a state, from which byte on.
    field: String,
    /// What was recorded.
    recorded: String,
    /// What was computed.
    computed: String,
}

/// Something that was not recorded.
#[derive(Debug, Serialize, JsonSchema)]
struct ListedGap {
    /// Name of the service.
    service: &'static str,
    /// When, s since 1970.
    t_unix_s: f64,
    /// What is missing.
    what: String,
}

/// What is told as it is computed.
struct Teller<'a> {
    args: &'a Args,
    began: Instant,
    /// The first moment, ns since 1970.
    first_ns: Option<u64>,
    last_ns: u64,
    alarm: Option<bool>,
    mode: Option<u32>,
    action: Option<u32>,
    overall: Option<u32>,
    differences: Vec<ListedDifference>,
    gaps: Vec<ListedGap>,
}

/// Computes it.
///
/// # Errors
/// A recording that cannot be read, or of another version.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let mut replay = Replay::open(&args.recording).map_err(CommandError::usage)?;
    let mut teller = Teller {
        args,
        began: Instant::now(),
        first_ns: None,
        last_ns: 0,
        alarm: None,
        mode: None,
        action: None,
        overall: None,
        differences: Vec::new(),
        gaps: Vec::new(),
    };
    let damaged = loop {
        match replay.next_moment() {
            Ok(Some(moment)) => teller.take(replay.setup(), moment)?,
            Ok(None) => break None,
            Err(error) => break Some(error.to_string()),
        }
    };
    let document = teller.document(&replay, damaged);
    let is_identical = document.identical;
    let printed = match args.json {
        true => output::json(&document),
        false => output::line(&summary(&document)),
    };
    printed.map_err(CommandError::failure)?;
    Ok(match is_identical {
        true => Outcome::Done,
        false => Outcome::Failed,
    })
}

impl Teller<'_> {
    fn take(&mut self, setup: &Setup, moment: Moment) -> Result<(), CommandError> {
        let Moment {
            t_ns,
            service,
            what,
        } = moment;
        let first_ns = *self.first_ns.get_or_insert(t_ns);
        self.last_ns = self.last_ns.max(t_ns);
        if let Some(speed) = self.args.speed {
            self.wait_until(t_ns.saturating_sub(first_ns) as f64 * 1e-9 / speed);
        }
        let told = match what {
            What::Begins => Some(format!("{} begins to be computed", service.as_str())),
            What::Answered(answer, difference) => {
                let told = difference.map(|it| self.differs(t_ns, service, it));
                told.or_else(|| self.change(setup, &answer))
            }
            What::StateDiffers(difference) => Some(self.differs(t_ns, service, difference)),
            What::Gap(what) => {
                let told = format!("{}: gap: {what}", service.as_str());
                if self.gaps.len() < LISTED_MAX {
                    self.gaps.push(ListedGap {
                        service: service.as_str(),
                        t_unix_s: t_ns as f64 * 1e-9,
                        what,
                    });
                }
                Some(told)
            }
        };
        match told.filter(|_| !self.args.verify && !self.args.json) {
            Some(text) => self.tell(t_ns, &text),
            None => Ok(()),
        }
    }

    fn tell(&self, t_ns: u64, text: &str) -> Result<(), CommandError> {
        let first_ns = self.first_ns.unwrap_or(t_ns);
        let time = unix_time_of_day(t_ns as f64 * 1e-9);
        let since_s = (t_ns as f64 - first_ns as f64) * 1e-9;
        let line = format!("{time} {since_s:9.3} s  {text}");
        output::line(&line).map_err(CommandError::failure)?;
        if self.args.step {
            let mut entered = String::new();
            let read = io::stdin().lock().read_line(&mut entered);
            read.map_err(CommandError::failure)?;
        }
        Ok(())
    }

    /// Waits until so much time has passed since it began; what would take longer is cut out.
    fn wait_until(&mut self, due_s: f64) {
        let ahead_s = due_s - self.began.elapsed().as_secs_f64();
        let cut_s = (ahead_s - WAIT_S_MAX).max(0.0);
        let cut_out = self.began.checked_sub(Duration::from_secs_f64(cut_s));
        self.began = cut_out.unwrap_or(self.began);
        if ahead_s > 0.0 {
            thread::sleep(Duration::from_secs_f64(ahead_s - cut_s));
        }
    }

    /// Keeps a difference, and says it.
    fn differs(&mut self, t_ns: u64, service: ServiceName, it: Difference) -> String {
        let service = service.as_str();
        let Difference {
            block,
            field,
            recorded,
            computed,
        } = it;
        let told = format!("{service}: differs: {field}: recorded {recorded}, computed {computed}");
        if self.differences.len() < LISTED_MAX {
            self.differences.push(ListedDifference {
                service,
                t_unix_s: t_ns as f64 * 1e-9,
                block_seq: block.seq,
                field,
                recorded,
                computed,
            });
        }
        told
    }

    /// What has changed, in words.
    fn change(&mut self, setup: &Setup, answer: &Answer) -> Option<String> {
        match answer {
            Answer::Detection(belief) => {
                let alarm = belief.alarm != 0;
                let before = self.alarm.replace(alarm);
                let word = match alarm {
                    true => "alarm",
                    false => "no alarm",
                };
                let p = belief.p_fault;
                (before != Some(alarm)).then(|| format!("detector: {word}, p {p:.4}"))
            }
            Answer::Diagnosis(belief) => {
                let before = self.mode.replace(belief.mode);
                let (name, p) = (setup.tree.mode_name(belief.mode), belief.p_mode);
                (before != Some(belief.mode)).then(|| format!("identifier: {name}, p {p:.3}"))
            }
            Answer::Action(action) => {
                let before = self.action.replace(action.action);
                let name = setup.decision.actions().get(action.action as usize);
                let name = name.map_or("?", String::as_str);
                (before != Some(action.action)).then(|| format!("supervisor: {name}"))
            }
            Answer::Faults(faults) => {
                let before = self.overall.replace(faults.overall);
                let name = OverallState::from_repr(faults.overall);
                let name = name.map_or("?", OverallState::name);
                (before != Some(faults.overall)).then(|| format!("supervisor: overall {name}"))
            }
        }
    }

    fn document(mut self, replay: &Replay, damaged: Option<String>) -> Document {
        let services = ServiceName::STEPPING.map(|service| {
            let tally: Tally = replay.tally(service);
            ComparedService {
                service: service.as_str(),
                answers: tally.answers,
                compared: tally.compared,
                different: tally.different,
                unrecorded: tally.unrecorded,
                states: tally.states,
                begun: tally.begun,
                gaps: tally.gaps,
            }
        });
        let first_ns = self.first_ns.unwrap_or(self.last_ns);
        let recorded_s = (self.last_ns - first_ns) as f64 * 1e-9;
        let differences = &mut self.differences;
        differences.sort_by(|a, b| a.t_unix_s.total_cmp(&b.t_unix_s));
        let is_compared = |it: &ComparedService| it.compared > 0 || it.answers == 0;
        let answers: u64 = services.iter().map(|it| it.answers).sum();
        let is_whole = damaged.is_none() && answers > 0 && services.iter().all(is_compared);
        Document {
            schema_version: 1,
            recording: self.args.recording.display().to_string(),
            graph: replay.setup().file.graph.name.clone(),
            identical: is_whole && services.iter().all(|it| it.different == 0),
            recorded_s,
            speed: recorded_s / self.began.elapsed().as_secs_f64().max(1e-9),
            is_cut: replay.is_cut(),
            damaged,
            foreign_blocks: replay.foreign_count(),
            services: services.into(),
            differences: self.differences,
            gaps: self.gaps,
        }
    }
}

/// The result in a few lines.
fn summary(document: &Document) -> String {
    let mut text = format!(
        "{:.1} s of graph {}, computed at {:.0} times their pace\n\n",
        document.recorded_s, document.graph, document.speed
    );
    let heads = [
        "answers",
        "compared",
        "different",
        "unrecorded",
        "states",
        "gaps",
    ];
    text += &format!("{:<12}", "service");
    heads.iter().for_each(|head| text += &format!("{head:>11}"));
    for it in &document.services {
        text += &format!("\n{:<12}", it.service);
        let compared = [it.answers, it.compared, it.different, it.unrecorded];
        let figures = compared.into_iter().chain([it.states, it.gaps]);
        figures.for_each(|figure| text += &format!("{figure:>11}"));
    }
    for it in document.differences.iter().take(1) {
        text += &format!(
            "\n\nfirst difference: {} block {}: {}: recorded {}, computed {}",
            it.service, it.block_seq, it.field, it.recorded, it.computed
        );
    }
    for it in &document.gaps {
        let time = unix_time_of_day(it.t_unix_s);
        text += &format!("\ngap: {time} {}: {}", it.service, it.what);
    }
    if document.foreign_blocks > 0 {
        text += &format!(
            "\n{} blocks are of another version",
            document.foreign_blocks
        );
    }
    if document.is_cut {
        text += "\nthe recording was cut short";
    }
    if let Some(damaged) = &document.damaged {
        text += &format!("\nthe rest cannot be read: {damaged}");
    }
    text + "\n\n" + &verdict(document)
}

fn verdict(document: &Document) -> String {
    let sum = |of: fn(&ComparedService) -> u64| document.services.iter().map(of).sum::<u64>();
    let left = sum(|it| it.answers) - sum(|it| it.compared);
    let alone = document
        .services
        .iter()
        .find(|it| it.compared == 0 && it.answers > 0);
    match alone {
        _ if sum(|it| it.different) > 0 => "NOT identical".to_owned(),
        Some(it) => format!(
            "nothing of the {} could be compared: no start, no state",
            it.service
        ),
        None if sum(|it| it.answers) == 0 => "there is no journal: nothing was compared".to_owned(),
        None if left > 0 => format!("identical to the last bit, but for {left} not compared"),
        None => "identical to the last bit".to_owned(),
    }
}
