//! A robot and its log as far as they are guessed.

use super::places::Places;

/// Where a channel comes from.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct DraftChannel {
    /// Name in Vigil.
    pub name: String,
    /// Index of its table.
    pub table: usize,
    /// Columns with factors.
    pub terms: Vec<(String, f64)>,
    /// Keys besides: `unit`, `modulus`, `scale`, ..., as they are written.
    pub keys: Vec<(&'static str, String)>,
    /// What was seen, for a comment.
    pub note: String,
    /// Role and unit of a channel beside the standard ones.
    pub further: Option<(&'static str, &'static str)>,
}

impl DraftChannel {
    /// A channel from one column.
    pub fn new(name: impl Into<String>, table: usize, column: &str) -> Self {
        Self {
            name: name.into(),
            table,
            terms: vec![(column.to_owned(), 1.0)],
            keys: Vec::new(),
            note: String::new(),
            further: None,
        }
    }

    /// With a further key.
    pub fn with(mut self, key: &'static str, value: impl std::fmt::Display) -> Self {
        self.keys.push((key, value.to_string()));
        self
    }

    /// With a factor, unless it is 1.
    pub fn scaled(self, scale: f64) -> Self {
        match (scale - 1.0).abs() < 1e-9 {
            true => self,
            false => self.with("scale", number(scale)),
        }
    }

    /// With a comment.
    pub fn noted(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }
}

/// A number as TOML writes a float, to six digits.
pub(super) fn number(value: f64) -> String {
    let digits = 6 - value.abs().max(1e-9).log10().floor() as i32 - 1;
    let factor = 10.0_f64.powi(digits.clamp(0, 12));
    format!("{:?}", (value * factor).round() / factor)
}

/// An axis of the command: name, unit, largest magnitude.
pub(super) type DraftAxis = (&'static str, &'static str, f64);

/// A robot and its log.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Draft {
    /// Kinematics.
    pub kinematics: &'static str,
    /// Wheel radius, m.
    pub radius_m: f64,
    /// Name, x, y of each wheel, m.
    pub wheels: Vec<(String, f64, f64)>,
    /// Command.
    pub command: Vec<DraftAxis>,
    /// What is measured.
    pub measured: Measured,
    /// Channels.
    pub channels: Vec<DraftChannel>,
    /// Largest wheel rate, rad/s.
    pub rate_rad_s: f64,
    /// What is uncertain, and what was left out.
    pub unsure: Vec<String>,
}

/// What is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Measured {
    /// Pose.
    pub pose: bool,
    /// Wheel rates.
    pub wheel_rates: bool,
    /// Yaw rate.
    pub yaw_rate: bool,
    /// Currents.
    pub currents: bool,
}

/// A source of the log.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct DraftSource {
    /// Index of its table.
    pub table: usize,
    /// Name.
    pub name: String,
    /// Lines of its TOML.
    pub lines: Vec<String>,
}

/// What the texts say besides.
pub(super) struct Frame<'a> {
    /// Name of the robot.
    pub name: &'a str,
    /// File of its description, relative to that of the log.
    pub robot_file: &'a str,
    /// Rate of the frames, Hz.
    pub rate_hz: f64,
    /// Where the runs are.
    pub places: &'a Places,
    /// Column of the run.
    pub run_column: Option<&'a str>,
    /// Sources.
    pub sources: &'a [DraftSource],
}

/// Text in quotes, as TOML writes it.
pub(super) fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

impl Draft {
    /// The description of the log.
    pub fn log_text(&self, frame: &Frame<'_>) -> String {
        let runs: Vec<String> = frame.places.runs.iter().map(|run| quoted(run)).collect();
        let mut lines = vec![
            "# Suggested from the log: every number and sign here is to be checked.".to_owned(),
            format!("robot = {}", quoted(frame.robot_file)),
            format!("rate_hz = {}", number(frame.rate_hz)),
            format!("runs = [\n  {},\n]", runs.join(",\n  ")),
        ];
        lines.extend(
            frame
                .run_column
                .map(|column| format!("run_column = {}", quoted(column))),
        );
        for source in frame.sources {
            lines.push("\n[[source]]".to_owned());
            lines.push(format!("name = {}", quoted(&source.name)));
            lines.extend(source.lines.iter().cloned());
        }
        for channel in &self.channels {
            let source = frame
                .sources
                .iter()
                .find(|source| source.table == channel.table);
            lines.push(String::new());
            lines.extend(comment(&channel.note));
            lines.push("[[channel]]".to_owned());
            lines.push(format!("name = {}", quoted(&channel.name)));
            lines.push(format!(
                "source = {}",
                quoted(source.map_or("", |s| s.name.as_str()))
            ));
            lines.push(match channel.terms.as_slice() {
                [(column, factor)] if *factor == 1.0 => format!("column = {}", quoted(column)),
                terms => {
                    let term = |(column, factor): &(String, f64)| {
                        format!("{} = {}", quoted(column), number(*factor))
                    };
                    let terms: Vec<String> = terms.iter().map(term).collect();
                    format!("columns = {{ {} }}", terms.join(", "))
                }
            });
            lines.extend(
                channel
                    .keys
                    .iter()
                    .map(|(key, value)| format!("{key} = {value}")),
            );
        }
        lines.join("\n") + "\n"
    }

    /// The description of the robot.
    pub fn robot_text(&self, frame: &Frame<'_>) -> String {
        let mut lines = vec![
            "# Suggested from a log: every number and sign here is to be checked. Lengths in m from"
                .to_owned(),
            "# base_link (x forward, y left).".to_owned(),
        ];
        lines.extend(
            self.unsure
                .iter()
                .flat_map(|line| comment(&format!("Unsure: {line}"))),
        );
        lines.push(format!("name = {}", quoted(frame.name)));
        lines.push(format!("kinematics = {}", quoted(self.kinematics)));
        lines.push(format!("wheel_radius_m = {}", number(self.radius_m)));
        lines.push("noise = \"estimate\"".to_owned());
        lines.push("polynomial_order = 2".to_owned());
        // A model of channels wants some frames in an interval.
        let interval_s = (2.0 / frame.rate_hz).clamp(0.1, 0.3);
        lines.push(format!(
            "interval_s = {}\n\ncommand = [",
            number(interval_s)
        ));
        for (name, unit, limit) in &self.command {
            let limit = number(*limit);
            lines.push(format!(
                "  {{ name = \"{name}\", unit = \"{unit}\", limit = {limit} }},"
            ));
        }
        lines.push("]\n\nwheels = [".to_owned());
        for (name, x, y) in &self.wheels {
            let (name, x, y) = (quoted(name), number(*x), number(*y));
            lines.push(format!(
                "  {{ name = {name}, x = {x}, y = {y}, steered = false }},"
            ));
        }
        let Measured {
            pose,
            wheel_rates,
            yaw_rate,
            currents,
        } = self.measured;
        lines.push(format!(
            "]\n\n[measured]\npose = {pose}\nwheel_rates = {wheel_rates}\nsteer = false\n\
             yaw_rate = {yaw_rate}\ncurrents = {currents}\n"
        ));
        let limit = |unit: &str| {
            let axes = self.command.iter().filter(|(_, of, _)| *of == unit);
            let largest = axes.map(|(_, _, limit)| *limit).fold(0.0, f64::max);
            number(if largest > 0.0 { largest } else { 1.0 })
        };
        lines.push(format!(
            "[limits]\nspeed_m_s = {}\nyaw_rate_rad_s = {}\nwheel_rate_rad_s = {}",
            limit("m/s"),
            limit("rad/s"),
            number(self.rate_rad_s.max(1.0))
        ));
        for channel in &self.channels {
            let Some((role, unit)) = channel.further else {
                continue;
            };
            let name = quoted(&channel.name);
            lines.push(format!(
                "\n[[channel]]\nname = {name}\nrole = \"{role}\"\nunit = \"{unit}\""
            ));
        }
        lines.join("\n") + "\n"
    }
}

/// A comment, broken into lines.
fn comment(text: &str) -> Vec<String> {
    let (mut lines, mut line) = (Vec::new(), String::from("#"));
    for word in text.split_whitespace() {
        if line.len() + word.len() > 98 {
            lines.push(std::mem::replace(&mut line, String::from("#")));
        }
        line.push(' ');
        line.push_str(word);
    }
    if line.len() > 1 {
        lines.push(line);
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::number;

    #[test]
    fn numbers_are_floats_of_six_digits() {
        for (value, text) in [
            (1.0, "1.0"),
            (0.002_436_914_3, "0.00243691"),
            (-57.295_779_5, "-57.2958"),
            (0.0, "0.0"),
            (2e7, "20000000.0"),
        ] {
            assert_eq!(number(value), text);
        }
    }
}
