//! Are false alarms as rare as `e-detector` promises, and how much later are its alarms?
//!
//! The law by drives over the declared null (`bench/src/null_drive.rs`), and over laws outside it;
//! the delay by the scenarios of `bench/field.toml`, beside the calibrated default at the same
//! promised interval and tolerances.

use std::error::Error;

use serde_json::{Value, json};
use vigil_bench::archive::Archive;
use vigil_bench::field::{self, Detected, File, Graph, Library, MISSED_S, Scenario, select};
use vigil_bench::null_drive::{Declared, Law};
use vigil_bench::{load, quantile, root};
use vigil_diagnosis::detect::{Form, Settings};
use vigil_evaluation::parallel::in_parallel;
use vigil_robot::declared::Promise;
use vigil_terminal::output;

/// Forms that are compared.
const FORMS: [Form; 2] = [Form::LearnedBias, Form::EDetector];
/// Each law outside the null is driven for so long, as a share of the hours within.
const OUTSIDE: f64 = 0.02;
/// Delay over the calibrated form's up to which the form with a proof would be the default.
const RATIO_MAX: f64 = 1.5;
const SEED: u64 = 40_000;

/// How much is measured.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Hours of healthy driving over the null; 0: only the delays.
    #[arg(long, value_name = "H", default_value_t = 1000.0)]
    hours: f64,
    /// Factor on the number of runs of each scenario; 0: only the law.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    scale: f64,
    /// Only scenarios whose names begin with one of these.
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    only: Vec<String>,
    /// Archive a part, too. The whole always is.
    #[arg(long)]
    archive: bool,
}

/// Answers the question.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    if cfg!(debug_assertions) {
        return Err("a debug build takes hours: use scripts/bench".into());
    }
    let (mut lines, mut figures) = (Vec::new(), Vec::new());
    if args.hours > 0.0 {
        let (said, found) = law(args.hours)?;
        output::line(&said.join("\n"))?;
        lines.extend(said);
        figures.push(("law.json", found));
    }
    if args.scale > 0.0 {
        let (said, found) = delays(args)?;
        output::line(&said.join("\n"))?;
        lines.extend(said);
        figures.push(("delays.json", found));
    }
    if args.only.is_empty() && args.scale == 1.0 && args.hours >= 1000.0 || args.archive {
        Archive::keep("promise", &figures, &lines)?;
    }
    Ok(())
}

/// Alarms of so many hours over the corners of the null, and of some outside.
fn law(hours: f64) -> Result<(Vec<String>, Value), Box<dyn Error>> {
    let setup = load("rover.toml")?;
    let model = setup.model.clone().with_faults();
    let model = model.ok_or("the rover's model has no faults")?;
    let settings = Settings::default();
    let declared = Declared {
        model: &model,
        robot: &setup.robot,
        null: (&settings.null).into(),
        promise: Promise {
            interval_h: settings.false_alarm_interval_h,
            fault_rate_1_h: settings.fault_rate_1_h,
        },
    };
    let corners = Law::corners();
    let each_h = hours / corners.len() as f64;
    let within = alarms(&declared, &corners, each_h)?;
    let outside = alarms(&declared, &Law::outside(), OUTSIDE * hours)?;
    let interval_h = settings.false_alarm_interval_h;
    let count: u32 = within.iter().sum();
    let (most, promised) = (upper(count), hours / interval_h);
    let verdict = if most < promised { "kept" } else { "NOT kept" };
    let mut lines = vec![format!(
        "Promised: one false alarm in {interval_h} h. {hours} h over {} corners of the null: \
         {count} alarms, at most {most:.1} expected (95 %), promised {promised:.1}: {verdict}.\n",
        corners.len()
    )];
    lines.push("| law outside the null | hours | alarms | one in, h |".to_owned());
    lines.push("|---|---|---|---|".to_owned());
    for (law, count) in Law::outside().iter().zip(&outside) {
        let (name, hours) = (law.name, OUTSIDE * hours);
        let one_in = hours / f64::from(*count);
        lines.push(format!("| {name} | {hours:.0} | {count} | {one_in:.3} |"));
    }
    lines.push(String::new());
    let figures = json!({
        "hours": hours, "alarms": count, "upper_95": most, "by_corner": within,
        "hours_outside": OUTSIDE * hours, "outside": outside,
    });
    Ok((lines, figures))
}

/// Alarms of so many hours under each law.
fn alarms(declared: &Declared<'_>, laws: &[Law], hours: f64) -> Result<Vec<u32>, Box<dyn Error>> {
    let numbered: Vec<(u64, &Law)> = (SEED..).zip(laws).collect();
    let counts = in_parallel(&numbered, |(seed, law)| {
        declared.alarms(**law, hours, *seed)
    });
    Ok(counts.into_iter().collect::<Result<_, _>>()?)
}

/// Upper 95 % bound of a Poisson mean of which `count` were seen, by bisection.
fn upper(count: u32) -> f64 {
    let below = |mean: f64| {
        let mut term = (-mean).exp();
        let mut sum = term;
        for k in 1..=count {
            term *= mean / f64::from(k);
            sum += term;
        }
        sum
    };
    let (mut low, mut high) = (0.0, 10.0 + 3.0 * f64::from(count));
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        match below(middle) > 0.05 {
            true => low = middle,
            false => high = middle,
        }
    }
    high
}

/// What one form did in all runs of a scenario with one set of sensors.
struct FormResult {
    delays_s: Vec<f64>,
    healthy_h: f64,
    false_alarms: u32,
}

impl FormResult {
    fn new(found: &[Detected], sensors: &str, form: Form) -> Self {
        let mine = || {
            let is_mine = |it: &&Detected| it.sensors == sensors && it.form == form;
            found.iter().filter(is_mine)
        };
        Self {
            delays_s: mine().filter_map(|it| it.delay_s).collect(),
            healthy_h: mine().map(|it| it.healthy_s).sum::<f64>() / 3600.0,
            false_alarms: mine().map(|it| it.false_alarms).sum(),
        }
    }

    fn quantiles(&self) -> [f64; 2] {
        let mut delays_s = self.delays_s.clone();
        [0.5, 0.9].map(|q| quantile(&mut delays_s, q))
    }

    fn seen(&self) -> usize {
        self.delays_s.iter().filter(|it| it.is_finite()).count()
    }
}

/// Delays by scenario and sensors.
fn delays(args: &Args) -> Result<(Vec<String>, Value), Box<dyn Error>> {
    let file = File::read(&root().join("bench/field.toml"))?;
    let scenarios = select(&file, &args.only)?;
    let simulated = |it: &&Scenario| it.recorded.is_none() && !it.obeys;
    let scenarios: Vec<&Scenario> = scenarios.into_iter().filter(simulated).collect();
    let graph = Graph::read()?;
    let jobs = field::jobs(&scenarios, args.scale, &Library::new(), None);
    let found = in_parallel(&jobs, |job| field::detect(&graph, job, &FORMS));
    let found: Result<Vec<Vec<Detected>>, String> = found.into_iter().collect();
    let found = found?;
    let mut lines = vec![
        format!(
            "Delay of the first alarm, s: calibrated / with a proof. Missed after {MISSED_S} s."
        ),
        String::new(),
        "| scenario | sensors | runs | seen | p50 | p90 | ratio p50 | ratio p90 | false |"
            .to_owned(),
        "|---|---|---|---|---|---|---|---|---|".to_owned(),
    ];
    let (mut rows, mut pooled) = (Vec::new(), FORMS.map(|_| Vec::new()));
    for scenario in &scenarios {
        let both = jobs.iter().zip(&found);
        let mine: Vec<Detected> = both
            .filter(|(job, _)| std::ptr::eq(job.scenario, *scenario))
            .flat_map(|(_, found)| found.clone())
            .collect();
        for sensors in ["pose", "pose+encoders"] {
            let told = FORMS.map(|form| FormResult::new(&mine, sensors, form));
            if told[0].healthy_h == 0.0 {
                continue;
            }
            for (pooled, told) in pooled.iter_mut().zip(&told) {
                pooled.extend_from_slice(&told.delays_s);
            }
            let name = &scenario.name;
            let (line, row) = compared(name, sensors, &told);
            lines.push(line);
            rows.push(row);
        }
    }
    let [calibrated, proved] = pooled.map(|mut all| [0.5, 0.9].map(|q| quantile(&mut all, q)));
    let ratios = [proved[0] / calibrated[0], proved[1] / calibrated[1]];
    let is_default = ratios.iter().all(|ratio| *ratio <= RATIO_MAX);
    lines.push(format!(
        "\nAll faults: p50 {:.2} / {:.2} s, p90 {:.2} / {:.2} s; ratios {:.2} and {:.2}. {}",
        calibrated[0],
        proved[0],
        calibrated[1],
        proved[1],
        ratios[0],
        ratios[1],
        match is_default {
            true => "At most 1.5: it may be the default.",
            false => "Above 1.5: it stays an option.",
        }
    ));
    Ok((lines, json!({"ratios": ratios, "scenarios": rows})))
}

/// A line of the table.
fn compared(name: &str, sensors: &str, told: &[FormResult; 2]) -> (String, Value) {
    let [calibrated, proved] = told;
    let (before, after) = (calibrated.quantiles(), proved.quantiles());
    let pair = |i: usize| format!("{:.2} / {:.2}", before[i], after[i]);
    let ratio = |i: usize| match before[i].is_finite() {
        true => format!("{:.2}", after[i] / before[i]),
        // What neither sees, or only the form with a proof, has no ratio.
        false => "-".to_owned(),
    };
    let runs = calibrated.delays_s.len();
    let false_alarms = format!("{} / {}", calibrated.false_alarms, proved.false_alarms);
    let line = match runs {
        0 => format!(
            "| {name} | {sensors} | healthy {:.2} h | | | | | | {false_alarms} |",
            proved.healthy_h
        ),
        _ => format!(
            "| {name} | {sensors} | {runs} | {} / {} | {} | {} | {} | {} | {false_alarms} |",
            calibrated.seen(),
            proved.seen(),
            pair(0),
            pair(1),
            ratio(0),
            ratio(1),
        ),
    };
    let row = json!({
        "scenario": name, "sensors": sensors, "runs": runs,
        "p50_s": [before[0], after[0]], "p90_s": [before[1], after[1]],
        "seen": [calibrated.seen(), proved.seen()], "healthy_h": proved.healthy_h,
        "false_alarms": [calibrated.false_alarms, proved.false_alarms],
    });
    (line, row)
}

#[cfg(test)]
mod tests {
    use super::upper;

    #[test]
    fn the_bound_is_that_of_the_chi_square_table() {
        // Half of the 95 % points of chi-square with 2, 22 and 64 degrees of freedom.
        for (count, bound) in [(0, 2.996), (10, 16.962), (31, 41.84)] {
            assert!(
                (upper(count) - bound).abs() < 0.01,
                "{count}: {}",
                upper(count)
            );
        }
    }
}
