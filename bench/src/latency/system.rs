//! What the machine did meanwhile.

use std::fs;

use serde_json::{Value, json};

/// Ticks of all cores since the start, from /proc/stat.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Ticks {
    busy: u64,
    steal: u64,
    total: u64,
}

impl Ticks {
    /// Now.
    #[must_use]
    pub fn now() -> Self {
        Self::of(&fs::read_to_string("/proc/stat").unwrap_or_default())
    }

    /// From the text of /proc/stat: user, nice, system, idle, iowait, irq, softirq, steal.
    fn of(text: &str) -> Self {
        let line = text.lines().next().unwrap_or_default();
        let fields: Vec<u64> = line
            .split_ascii_whitespace()
            .skip(1)
            .take(8)
            .filter_map(|field| field.parse().ok())
            .collect();
        let total = fields.iter().sum();
        let at = |i: usize| fields.get(i).copied().unwrap_or(0);
        Self {
            busy: total - at(3) - at(4) - at(7),
            steal: at(7),
            total,
        }
    }

    /// Shares of the time since `before`, %: busy, and taken by other machines of the host.
    #[must_use]
    pub fn since(self, before: Self) -> Value {
        // The kernel's counters of steal and waiting may run back by a tick.
        let total = self.total.saturating_sub(before.total).max(1) as f64;
        let percent = |ticks: u64| (1e3 * ticks as f64 / total).round() / 10.0;
        json!({
            "busy_percent": percent(self.busy.saturating_sub(before.busy)),
            "steal_percent": percent(self.steal.saturating_sub(before.steal)),
        })
    }
}

/// What a reader of latencies must know of this machine, beyond `machine.json`.
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
        "preemption": preemption(),
        "isolated_cores": read("/sys/devices/system/cpu/isolated"),
        "nohz_full": read("/sys/devices/system/cpu/nohz_full"),
        "rcu_nocbs": word("rcu_nocbs="),
        "idle_driver": read("/sys/devices/system/cpu/cpuidle/current_driver"),
        "frequency_governor": read("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor"),
        "realtime_kernel": exists("/sys/kernel/realtime"),
        "memory_lock_limit": limit("Max locked memory"),
        "priority_limit": limit("Max realtime priority"),
        "load_average": read("/proc/loadavg"),
    })
}

/// Preemption model: from debugfs where it is mounted, else from the kernel's version string.
fn preemption() -> String {
    fs::read_to_string("/sys/kernel/debug/sched/preempt").map_or_else(
        |_| {
            let version = fs::read_to_string("/proc/version").unwrap_or_default();
            let words = version.split(' ').filter(|word| word.contains("PREEMPT"));
            let words: Vec<&str> = words.collect();
            if words.is_empty() {
                "not known".into()
            } else {
                words.join(" ")
            }
        },
        |text| text.trim().to_owned(),
    )
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
        let before = Ticks::of("cpu  100 0 50 800 40 5 5 0 0 0\ncpu0 1 2\n");
        let after = Ticks::of("cpu  160 0 60 820 40 5 5 10 0 0\n");
        let shares = after.since(before);
        assert_eq!(shares["busy_percent"], 70.0);
        assert_eq!(shares["steal_percent"], 10.0);
        assert_eq!(before.since(after)["busy_percent"], 0.0);
    }
}
