//! Says that a graph waits for its first action, what for, and what to do.

use std::time::{Duration, Instant};

use vigil_blocks::{REJECTIONS, Rejection};
use vigil_cycle::topic::ServiceName;
use vigil_setup::Setup;

use crate::observer::HealthObserver;

/// A publisher that is there is heard within this time.
const FIRST: Duration = Duration::from_secs(1);
/// Interval at which it is said again.
const AGAIN: Duration = Duration::from_secs(30);

/// A graph whose drive has not begun.
pub struct Waiting {
    began: Instant,
    next: Duration,
    graph: String,
    config: String,
    /// The source, if frames come from outside.
    outside: Option<String>,
}

impl Waiting {
    /// Of a graph that starts now.
    pub fn new(setup: &Setup) -> Self {
        let (graph, source) = (&setup.file.graph, setup.file.sensor.source);
        Self {
            began: Instant::now(),
            next: FIRST,
            graph: graph.name.clone(),
            config: setup.path.display().to_string(),
            outside: source.is_outside().then(|| source.to_string()),
        }
    }

    /// True once it has lasted so long that people want to know.
    pub fn is_long(&self) -> bool {
        self.elapsed() > FIRST
    }

    /// How long it has lasted.
    pub fn elapsed(&self) -> Duration {
        self.began.elapsed()
    }

    /// What to say now; `None` before its time, and of frames that Vigil makes itself.
    pub fn say(&mut self, observer: &HealthObserver) -> Option<String> {
        let source = self.outside.as_ref()?;
        if self.elapsed() < self.next {
            return None;
        }
        self.next += AGAIN;
        let (graph, config, frames) = (&self.graph, &self.config, frames(observer));
        Some(format!(
            "graph '{graph}' waits for a publisher ({source}): {frames}; \
             `vigil check-publisher --config {config} --graph {graph} --source {source}` says \
             what does not fit"
        ))
    }
}

/// What is known of the frames that have come.
fn frames(observer: &HealthObserver) -> String {
    let entrances = [ServiceName::SensorSim, ServiceName::Detector];
    let (mut rejected, mut cycles) = ([0; REJECTIONS], 0);
    for service in observer.watched() {
        if entrances.contains(&service.name) {
            let counters = observer.counters(service);
            let sums = rejected.iter_mut().zip(counters.rejected);
            sums.for_each(|(sum, count)| *sum += count);
            cycles += counters.cycles;
        }
    }
    let causes = Rejection::ALL.iter();
    let causes = causes.map(|cause| (rejected[*cause as usize], cause.as_str()));
    let causes = causes.filter(|(count, _)| *count > 0);
    let causes: Vec<String> = causes.map(|(n, cause)| format!("{n} {cause}")).collect();
    match (causes.is_empty(), cycles) {
        (false, _) => format!("frames came and were refused: {}", causes.join(", ")),
        (true, 0) => "no frame has come".to_owned(),
        (true, _) => "frames came, and no action has come back".to_owned(),
    }
}
