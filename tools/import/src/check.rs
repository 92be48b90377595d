//! Whether a log's description makes sense, by itself and for the robot.

use super::ImportError;
use super::description::{ChannelSource, Clock, Delay, LogDescription, Source, Unit};

type CheckResult = Result<(), ImportError>;

fn wrong(key: impl Into<String>, message: impl Into<String>) -> CheckResult {
    Err(ImportError::description(key, message))
}

/// A time that may be as long as one likes.
fn limit(key: &str, value_s: f64) -> CheckResult {
    match value_s > 0.0 {
        true => Ok(()),
        false => wrong(
            key,
            format!("{value_s}: allowed is more than 0 s, inf included"),
        ),
    }
}

impl LogDescription {
    /// Checks that every number is one, every column has one channel, and every channel a source.
    pub(super) fn check(&self, columns: &[String]) -> CheckResult {
        if !(1.0..=1000.0).contains(&self.rate_hz) {
            let message = format!("{} is out of range: allowed is 1 to 1000 Hz", self.rate_hz);
            return wrong("rate_hz", message);
        }
        limit("hold_max_s", self.hold_max_s)?;
        limit("estimate_s", self.estimate_s)?;
        for (i, channel) in self.channel.iter().enumerate() {
            self.check_channel(&format!("channel.{i}"), channel, columns)?;
        }
        for column in columns {
            let count = self.channel.iter().filter(|c| c.name == *column).count();
            if count != 1 {
                let message = format!("{column} is described {count} times: once is needed");
                return wrong("channel", message);
            }
        }
        for (i, source) in self.source.iter().enumerate() {
            self.check_source(&format!("source.{i}"), source)?;
        }
        Ok(())
    }

    fn has_source(&self, name: &str) -> bool {
        self.source.iter().any(|source| source.name == name)
    }

    fn check_channel(&self, key: &str, channel: &ChannelSource, columns: &[String]) -> CheckResult {
        if !columns.contains(&channel.name) {
            let message = format!(
                "the robot has no channel '{}': allowed are {}",
                channel.name,
                columns.join(", ")
            );
            return wrong(format!("{key}.name"), message);
        }
        if !self.has_source(&channel.source) {
            let message = format!("there is no source '{}'", channel.source);
            return wrong(format!("{key}.source"), message);
        }
        if channel.column.is_empty() == channel.columns.is_empty() {
            let message = "is required, or `columns`, and not both";
            return wrong(format!("{key}.column"), message);
        }
        if channel.delay_s == Delay::Estimate && channel.delay_against.is_empty() {
            let message = "is required for delay_s = \"estimate\"";
            return wrong(format!("{key}.delay_against"), message);
        }
        let mut others = channel.delay_against.iter();
        if let Some((name, _)) = others.find(|(name, _)| !columns.contains(*name)) {
            let message = format!("the robot has no channel '{name}'");
            return wrong(format!("{key}.delay_against"), message);
        }
        if channel.unit.is_time() {
            let message = "is a unit of time: allowed are si, deg, mm, rpm";
            return wrong(format!("{key}.unit"), message);
        }
        if channel.scale == 0.0 {
            return wrong(
                format!("{key}.scale"),
                "0: allowed are finite numbers but 0",
            );
        }
        let finite = |name: &str, value: f64| match value.is_finite() {
            true => Ok(()),
            false => wrong(
                format!("{key}.{name}"),
                format!("{value}: allowed are finite numbers"),
            ),
        };
        finite("scale", channel.scale)?;
        finite("offset", channel.offset)?;
        finite("initial", channel.initial)?;
        for (name, factor) in &channel.columns {
            finite(&format!("columns.{name}"), *factor)?;
        }
        for (name, factor) in &channel.delay_against {
            finite(&format!("delay_against.{name}"), *factor)?;
        }
        check_modulus(key, channel.modulus)
    }

    fn check_source(&self, key: &str, source: &Source) -> CheckResult {
        if let Some([other, _]) = &source.time_as
            && !self.has_source(other)
        {
            let message = format!("there is no source '{other}'");
            return wrong(format!("{key}.time_as"), message);
        }
        if self.run_column.is_some() && source.topic.is_some() {
            let message = "parts CSV files only: a recording is one run";
            return wrong("run_column", message);
        }
        if !source.delimiter.is_ascii() {
            let message = "a single ASCII character is needed";
            return wrong(format!("{key}.delimiter"), message);
        }
        check_clock(&format!("{key}.time"), &source.time)?;
        source
            .device_clock
            .iter()
            .try_for_each(|clock| check_clock(&format!("{key}.device_clock"), clock))
    }
}

fn check_clock(key: &str, clock: &Clock) -> CheckResult {
    if !clock.unit.is_time() {
        let message = "is no unit of time: allowed are s, ms, us, ns";
        return wrong(format!("{key}.unit"), message);
    }
    check_modulus(key, clock.modulus)
}

fn check_modulus(key: &str, modulus: Option<f64>) -> CheckResult {
    match modulus.filter(|modulus| !(*modulus > 0.0 && modulus.is_finite())) {
        None => Ok(()),
        Some(found) => {
            let message = format!("{found}: allowed is a finite number above 0");
            wrong(format!("{key}.modulus"), message)
        }
    }
}

impl Unit {
    /// True for what a clock counts in.
    fn is_time(self) -> bool {
        matches!(self, Self::S | Self::Ms | Self::Us | Self::Ns)
    }
}
