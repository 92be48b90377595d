//! A score as text.

use std::fmt;

use super::{Instants, Ratio, Score, Spread};

impl fmt::Display for Ratio {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = self.fraction.map_or("-".to_owned(), |p| format!("{:.1} %", 100.0 * p));
        let text = format!("{percent} ({}/{})", self.right, self.n);
        f.pad(&text)
    }
}

impl fmt::Display for Spread {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = |value: Option<f64>| value.map_or("-".to_owned(), |s| format!("{s:.2}"));
        let [p50, p90, max] = [self.p50_s, self.p90_s, self.max_s].map(text);
        write!(f, "{p50:>7} {p90:>7} {max:>7}")
    }
}

impl fmt::Display for Score {
    /// Tables for reading; the serialised form is the complete one.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let runs: Vec<String> = self.runs.iter().map(|(kind, n)| format!("{n} {kind}")).collect();
        writeln!(f, "runs            {}", runs.join(", "))?;
        let alarms = &self.false_alarms;
        writeln!(
            f,
            "false alarms    {} in {:.2} h without a fault: {} of {} nominal runs, {} of {} runs \
             before the onset",
            alarms.alarms,
            alarms.exposure_h,
            alarms.nominal_runs_alarmed,
            alarms.nominal_runs,
            alarms.faulty_runs_alarmed_before_onset,
            alarms.faulty_runs,
        )?;
        writeln!(f, "\n{:<12} {:>9} {:>7} {:>23}", "detection", "detected", "missed", "delay, s")?;
        writeln!(f, "{:<12} {:>9} {:>7} {:>7} {:>7} {:>7}", "", "", "", "p50", "p90", "max")?;
        for (class, found) in &self.detection {
            let detected = format!("{}/{}", found.detected, found.n);
            writeln!(f, "{class:<12} {detected:>9} {:>7} {}", found.missed, found.delay)?;
        }
        for what in ["leaf", "side", "type", "unknown"] {
            let heads = ["after 2 s", "after 5 s", "after 10 s", "at the end"];
            write!(f, "\n{what:<12}")?;
            for head in heads {
                write!(f, " {head:>18}")?;
            }
            writeln!(f)?;
            for (class, found) in &self.identification {
                let Instants { after_2_s, after_5_s, after_10_s, at_end } = match what {
                    "leaf" => found.leaf,
                    "side" => found.side,
                    "type" => found.class,
                    _ => found.unknown,
                };
                writeln!(f, "{class:<12} {after_2_s:>18} {after_5_s:>18} {after_10_s:>18} {at_end:>18}")?;
            }
        }
        writeln!(f, "\n{:<12} {:>7} {:>7} {:>7}", "isolation, s", "p50", "p90", "max")?;
        for (class, found) in &self.identification {
            writeln!(f, "{class:<12} {}", found.isolation)?;
        }
        writeln!(f, "\nconfusion after 2 s (true: reported, runs)")?;
        for (truth, row) in &self.confusion {
            let row: Vec<String> = row.iter().map(|(mode, n)| format!("{mode} {n}")).collect();
            writeln!(f, "{truth:<12} {}", row.join(", "))?;
        }
        let number = |value: Option<f64>| value.map_or("-".to_owned(), |x| format!("{x:.4}"));
        let calibration = &self.calibration;
        write!(
            f,
            "\ncalibration after 2 s, {} runs: expected calibration error {}, log score {} nats, \
             confident and wrong {}",
            calibration.n,
            number(calibration.expected_calibration_error),
            number(calibration.log_score_nats),
            calibration.confident_wrong,
        )
    }
}
