//! What the kernel says of a process.

use std::fs;

/// Ticks of the kernel's account of computing time in a second, on every Linux.
const TICKS_1_S: f64 = 100.0;

/// Computing time of a process so far, s; 0 of one that is gone.
#[must_use]
pub fn cpu_s(pid: u32) -> f64 {
    let text = fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    // After the name in brackets: user time is the twelfth field, that of the system follows.
    let fields = text.rsplit(')').next().unwrap_or_default();
    let ticks = fields.split_ascii_whitespace().skip(11).take(2);
    let ticks = ticks.filter_map(|field| field.parse::<f64>().ok());
    ticks.sum::<f64>() / TICKS_1_S
}

/// The processes that a process has started, and which live.
#[must_use]
pub fn children(pid: u32) -> Vec<u32> {
    let text = fs::read_to_string(format!("/proc/{pid}/task/{pid}/children")).unwrap_or_default();
    let pids = text.split_ascii_whitespace();
    pids.filter_map(|pid| pid.parse().ok()).collect()
}

#[cfg(test)]
mod tests {
    use std::process::Command;
    use std::time::Instant;

    use super::*;

    #[test]
    fn children_are_found_and_computing_time_grows() {
        let mut shell = Command::new("sh")
            .args(["-c", "sleep 60 & wait"])
            .spawn()
            .unwrap();
        let began = Instant::now();
        let found = loop {
            match children(shell.id())[..] {
                [found] => break found,
                _ => assert!(began.elapsed().as_secs() < 60, "its child is not found"),
            }
        };
        for pid in [found, shell.id()] {
            vigil_cycle::signal::terminate(pid);
        }
        shell.wait().unwrap();
        let (own, before_s) = (std::process::id(), cpu_s(std::process::id()));
        while cpu_s(own) < before_s + 0.05 {
            assert!(began.elapsed().as_secs() < 120, "it computes all the time");
        }
        assert_eq!(cpu_s(shell.id()), 0.0);
    }
}
