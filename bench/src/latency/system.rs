//! What the machine did meanwhile.

use std::fs;
use std::io::Read;

use flate2::read::GzDecoder;
use serde_json::{Value, json};
use vigil_cycle::{Clock, Monotonic};

/// Ticks of all cores and context switches since the start, from /proc/stat.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Ticks {
    busy: u64,
    steal: u64,
    total: u64,
    switches: u64,
    t_ns: u64,
}

impl Ticks {
    /// Now.
    #[must_use]
    pub fn now() -> Self {
        let text = fs::read_to_string("/proc/stat").unwrap_or_default();
        Self::parse(&text, Monotonic.now_ns())
    }

    /// From the text of /proc/stat, read at `t_ns`: user, nice, system, idle, iowait, irq, softirq,
    /// steal; and context switches in a line of their own.
    fn parse(text: &str, t_ns: u64) -> Self {
        let line = text.lines().next().unwrap_or_default();
        let fields: Vec<u64> = line
            .split_ascii_whitespace()
            .skip(1)
            .take(8)
            .filter_map(|field| field.parse().ok())
            .collect();
        let total = fields.iter().sum();
        let at = |i: usize| fields.get(i).copied().unwrap_or(0);
        let switches = text.lines().find_map(|line| line.strip_prefix("ctxt "));
        Self {
            busy: total - at(3) - at(4) - at(7),
            steal: at(7),
            total,
            switches: switches.map_or(0, |count| count.trim().parse().unwrap_or(0)),
            t_ns,
        }
    }

    /// Shares of the time since `before`, %: busy, and taken by other machines of the host; context
    /// switches of all programs, 1/s; and the load average now.
    #[must_use]
    pub fn since(self, before: Self) -> Value {
        // The kernel's counters of steal and waiting may run back by a tick.
        let total = self.total.saturating_sub(before.total).max(1) as f64;
        let percent = |ticks: u64| (1e3 * ticks as f64 / total).round() / 10.0;
        let switches = self.switches.saturating_sub(before.switches) as f64;
        let elapsed_s = self.t_ns.saturating_sub(before.t_ns).max(1) as f64 * 1e-9;
        json!({
            "busy_percent": percent(self.busy.saturating_sub(before.busy)),
            "steal_percent": percent(self.steal.saturating_sub(before.steal)),
            "context_switches_1_s": (switches / elapsed_s).round(),
            "load_average": load_average(),
        })
    }
}

fn load_average() -> String {
    let text = fs::read_to_string("/proc/loadavg").unwrap_or_default();
    text.trim().to_owned()
}

/// What a reader of latencies must know of this machine, beyond `machine::facts`.
#[must_use]
pub fn facts() -> Value {
    let read = |path: &str| {
        fs::read_to_string(path)
            .map(|text| text.trim().to_owned())
            .unwrap_or_else(|_| "not known".into())
    };
    let exists = |path: &str| fs::exists(path).unwrap_or(false);
    let command_line = read("/proc/cmdline");
    let word = |name: &str| {
        let found = command_line.split(' ').find(|word| word.starts_with(name));
        found.unwrap_or("absent").to_owned()
    };
    json!({
        "preemption": preemption(&word("preempt=")),
        "isolated_cores": read("/sys/devices/system/cpu/isolated"),
        "nohz_full": read("/sys/devices/system/cpu/nohz_full"),
        "rcu_nocbs": word("rcu_nocbs="),
        "idle_driver": read("/sys/devices/system/cpu/cpuidle/current_driver"),
        "frequency_governor": read("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor"),
        "realtime_kernel": exists("/sys/kernel/realtime"),
        "tick_rate_hz": tick_rate_hz().unwrap_or_else(|| "not known".into()),
        "memory_lock_limit": limit("Max locked memory"),
        "priority_limit": limit("Max realtime priority"),
    })
}

/// Preemption model: from debugfs where it is mounted, else what the kernel's version string and
/// its command line's `argument` say. `PREEMPT_DYNAMIC` alone leaves the model open.
fn preemption(argument: &str) -> String {
    if let Ok(text) = fs::read_to_string("/sys/kernel/debug/sched/preempt") {
        return text.trim().to_owned();
    }
    let version = fs::read_to_string("/proc/version").unwrap_or_default();
    match version.split(' ').find(|word| word.contains("PREEMPT")) {
        Some("PREEMPT_DYNAMIC") => {
            format!("PREEMPT_DYNAMIC, preempt= {argument}; the model in force is not readable")
        }
        Some(word) => word.to_owned(),
        None => "not known".into(),
    }
}

/// Rate of the kernel's tick, Hz; `None` if the kernel does not carry its configuration.
fn tick_rate_hz() -> Option<String> {
    let mut text = String::new();
    let packed = fs::File::open("/proc/config.gz").ok()?;
    GzDecoder::new(packed).read_to_string(&mut text).ok()?;
    configured(&text, "CONFIG_HZ=")
}

/// Value of the kernel's option of this name in its configuration.
fn configured(text: &str, name: &str) -> Option<String> {
    let value = text.lines().find_map(|line| line.strip_prefix(name))?;
    Some(value.trim().to_owned())
}

fn limit(name: &str) -> String {
    let text = fs::read_to_string("/proc/self/limits").unwrap_or_default();
    let line = text.lines().find(|line| line.starts_with(name));
    line.and_then(|line| line[name.len()..].split_ascii_whitespace().next())
        .unwrap_or("not known")
        .to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_of_all_ticks() {
        let before = "cpu  100 0 50 800 40 5 5 0 0 0\ncpu0 1 2\nctxt 5000\n";
        let after = "cpu  160 0 60 820 40 5 5 10 0 0\ncpu0 1 2\nctxt 8000\n";
        let before = Ticks::parse(before, 1_000_000_000);
        let after = Ticks::parse(after, 3_000_000_000);
        let shares = after.since(before);
        assert_eq!(shares["busy_percent"], 70.0);
        assert_eq!(shares["steal_percent"], 10.0);
        assert_eq!(shares["context_switches_1_s"], 1500.0);
        assert_eq!(before.since(after)["busy_percent"], 0.0);
        assert_eq!(before.since(after)["context_switches_1_s"], 0.0);
    }

    #[test]
    fn the_tick_rate_is_read_from_the_kernels_configuration() {
        let text = "# CONFIG_HZ_PERIODIC is not set\nCONFIG_HZ_250=y\nCONFIG_HZ=250\n";
        assert_eq!(configured(text, "CONFIG_HZ=").as_deref(), Some("250"));
        assert_eq!(configured("CONFIG_HZ_250=y\n", "CONFIG_HZ="), None);
    }
}
