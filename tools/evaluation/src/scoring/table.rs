//! A score as text.

use std::fmt;

use super::{Ratio, Score, Spread};

impl fmt::Display for Ratio {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = self
            .fraction()
            .map_or("-".to_owned(), |p| format!("{:.1} %", 100.0 * p));
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
        let runs = self.runs.iter().map(|(kind, n)| format!("{n} {kind}"));
        writeln!(f, "runs            {}", runs.collect::<Vec<_>>().join(", "))?;
        self.detection_table(f)?;
        if !self.identifies {
            writeln!(
                f,
                "\nleaf, side, type and their calibration do not apply: the labels name no leaf of \
                 the fault tree"
            )?;
            self.confusion_table(f)?;
            return self.field_table(f);
        }
        for what in ["leaf", "side", "type", "unknown"] {
            self.identification_table(f, what)?;
        }
        self.isolation_table(f)?;
        self.confusion_table(f)?;
        self.calibration_table(f)?;
        self.field_table(f)
    }
}

/// Figures of every instant that the tables show; the document has all.
const FIELD: [&str; 13] = [
    "right_share",
    "right_side_share",
    "wrong_s",
    "mode_changes_per_min",
    "reported_changes_per_min",
    "settled_mode_changes_per_min",
    "alarms_per_h",
    "actions_per_h",
    "slow_per_h",
    "stop_per_h",
    "help_per_h",
    "other_per_h",
    "contradiction_s",
];

impl Score {
    fn field_table(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let heads = ["every instant", "class", "value", "95 %", "worst (run)"];
        let [figure, class, value, bounds, worst] = heads;
        write!(
            f,
            "\n\n{figure:<30} {class:<10} {value:>9} {bounds:>20} {worst:>16}"
        )?;
        for name in FIELD {
            for (class, figures) in self.field.iter().filter(|(class, _)| *class == "all") {
                let Some(figure) = figures.get(name) else {
                    continue;
                };
                let text = |value: Option<f64>| value.map_or("-".into(), |x| format!("{x:.3}"));
                let both = figure.lower_95.zip(figure.upper_95);
                let both = both.map_or("-".into(), |(a, b)| format!("{a:.3} to {b:.3}"));
                let worst = figure.worst.map_or("-".into(), |worst| {
                    format!("{} ({})", text(worst.value), worst.seed)
                });
                let value = text(figure.value);
                write!(
                    f,
                    "\n{name:<30} {class:<10} {value:>9} {both:>20} {worst:>16}"
                )?;
            }
        }
        Ok(())
    }

    fn detection_table(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let found = &self.false_alarms;
        let (alarms, exposure_h) = (found.alarms, found.exposure_h);
        let nominal = format!("{} of {}", found.nominal_runs_alarmed, found.nominal_runs);
        let before = found.faulty_runs_alarmed_before_onset;
        let faulty = format!("{before} of {}", found.faulty_runs);
        write!(
            f,
            "false alarms    {alarms} in {exposure_h:.2} h without a fault (and {:.2} h of \
             warm-up): ",
            found.warm_up_h
        )?;
        writeln!(f, "{nominal} nominal runs, {faulty} runs before the onset")?;
        let rate = &found.rate;
        let number = |value: Option<f64>| value.map_or("-".to_owned(), |x| format!("{x:.2}"));
        writeln!(
            f,
            "an hour         {} (95 %: {} to {})\n",
            number(rate.false_alarms_per_h),
            number(rate.lower_95_per_h),
            number(rate.upper_95_per_h)
        )?;
        let heads = ["detection", "detected", "missed", "delay, s"];
        writeln!(
            f,
            "{:<12} {:>9} {:>7} {:>23}",
            heads[0], heads[1], heads[2], heads[3]
        )?;
        writeln!(f, "{:<30} {:>7} {:>7} {:>7}", "", "p50", "p90", "max")?;
        for (class, found) in &self.detection {
            let detected = format!("{}/{}", found.detected, found.n);
            writeln!(
                f,
                "{class:<12} {detected:>9} {:>7} {}",
                found.missed, found.delay
            )?;
        }
        Ok(())
    }

    fn identification_table(&self, f: &mut fmt::Formatter<'_>, what: &str) -> fmt::Result {
        write!(f, "\n{what:<12}")?;
        for head in ["after 2 s", "after 5 s", "after 10 s", "at the end"] {
            write!(f, " {head:>18}")?;
        }
        writeln!(f)?;
        for (class, found) in &self.identification {
            let of = match what {
                "leaf" => &found.leaf,
                "side" => &found.side,
                "type" => &found.class,
                _ => &found.unknown,
            };
            write!(f, "{class:<12}")?;
            for ratio in [of.after_2_s, of.after_5_s, of.after_10_s, of.at_end] {
                write!(f, " {ratio:>18}")?;
            }
            writeln!(f)?;
        }
        Ok(())
    }

    fn isolation_table(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "\n{:<12} {:>7} {:>7} {:>7}",
            "isolation, s", "p50", "p90", "max"
        )?;
        for (class, found) in &self.identification {
            writeln!(f, "{class:<12} {}", found.isolation)?;
        }
        Ok(())
    }

    fn confusion_table(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "\nconfusion after 2 s (true: reported, runs)")?;
        for (truth, row) in &self.confusion {
            let row = row.iter().map(|(mode, n)| format!("{mode} {n}"));
            writeln!(f, "{truth:<12} {}", row.collect::<Vec<_>>().join(", "))?;
        }
        Ok(())
    }

    fn calibration_table(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "\n{:<12} {:>5} {:>18}",
            "calibration", "runs", "calibration error"
        )?;
        write!(
            f,
            " {:>16} {:>20}",
            "log score, nats", "confident and wrong"
        )?;
        let number = |value: Option<f64>| value.map_or("-".to_owned(), |x| format!("{x:.4}"));
        for (class, found) in &self.calibration {
            let error = number(found.expected_calibration_error);
            let (n, log_score) = (found.n, number(found.log_score_nats));
            let wrong = found.confident_wrong;
            write!(
                f,
                "\n{class:<12} {n:>5} {error:>18} {log_score:>16} {wrong:>20}"
            )?;
        }
        Ok(())
    }
}
