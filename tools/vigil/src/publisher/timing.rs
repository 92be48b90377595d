//! Rate, jitter, gaps, clocks.

use vigil_cycle::Latency;

use super::{FrameArrival, Reception};
use crate::findings::{Finding, Status};

/// A rate may be off by this share.
const RATE_OFF_MAX: f64 = 0.05;
/// An interval may be off by this share of the period in one of a hundred frames.
const JITTER_MAX: f64 = 0.25;
/// Shortest time over which the rate of a clock is judged, s.
const CLOCK_S_MIN: f64 = 2.0;
/// A publisher that starts anew more often, in a second, does not mean it.
const STARTS_S_MAX: f64 = 0.5;
/// Frames may arrive by this much earlier or later than usual, s.
const ARRIVAL_OFF_MAX_S: f64 = 0.01;
/// Missing sequence numbers that are a loss, and no counter that is wrong.
const GAP_MAX: u64 = 10_000;
/// Frames from which bursts are judged; part of the mean interval within which two arrive together;
/// share of such frames beyond which the graph is late, as in its own test.
const BURST_FRAMES_MIN: usize = 20;
const TOGETHER: f64 = 0.2;
const BURSTS_MAX: f64 = 0.3;
/// A clock may be off by this share of time.
const CLOCK_OFF_MAX: f64 = 5e-4;

/// Findings about the times of the frames; there is at least one frame.
pub fn findings(rate_hz: f64, heard: &Reception) -> Vec<Finding> {
    let frames = &heard.frames;
    let mut all = vec![rate(rate_hz, heard)];
    all.extend(jitter(rate_hz, frames));
    all.push(gaps(heard));
    all.extend(starts(frames));
    all.extend(way(rate_hz, frames));
    all.extend(bursts(heard));
    all.push(capture(frames));
    all
}

/// Middle of a sorted list.
fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// Intervals between consecutive frames of one start, by `at`, s.
fn intervals(frames: &[FrameArrival], at: impl Fn(&FrameArrival) -> u64) -> Vec<f64> {
    let pairs = frames.windows(2);
    let same = pairs.filter(|p| p[0].frame.header.epoch == p[1].frame.header.epoch);
    same.map(|p| (at(&p[1]) as f64 - at(&p[0]) as f64) * 1e-9)
        .collect()
}

fn rate(expected_hz: f64, heard: &Reception) -> Finding {
    let frames = &heard.frames;
    let (Some(first), Some(last)) = (frames.first(), frames.last()) else {
        return Finding::new("rate", Status::Failure, "no frame");
    };
    let lasted_s = last.now_ns.saturating_sub(first.now_ns) as f64 * 1e-9;
    if frames.len() < 10 || lasted_s <= 0.0 {
        let detail = format!("{} frames are too few to tell", frames.len());
        return Finding::new("rate", Status::Warning, detail);
    }
    // Lost and refused frames were sent too.
    let others = match heard.border.and_then(|border| border.lost_at_socket) {
        Some(lost) => lost + heard.rejected.iter().sum::<u64>(),
        None => missing(frames).0,
    };
    // Those that come together with the first are before the time that is measured.
    let is_first = |f: &&FrameArrival| {
        (f.now_ns.saturating_sub(first.now_ns) as f64 * 1e-9) < TOGETHER / expected_hz
    };
    let after = frames.len() - frames.iter().take_while(is_first).count();
    let found_hz = (after as u64 + others) as f64 / lasted_s;
    let detail = format!("{found_hz:.2} Hz; graph.rate_hz is {expected_hz}");
    if (found_hz / expected_hz - 1.0).abs() <= RATE_OFF_MAX {
        return Finding::new("rate", Status::Ok, detail);
    }
    let advice = format!("start the graph with --rate {found_hz:.2}, or publish at that rate");
    let detail = format!("{detail}: {advice}");
    Finding::new("rate", Status::Failure, detail)
}

fn jitter(rate_hz: f64, frames: &[FrameArrival]) -> Option<Finding> {
    let mut latency = Latency::new().ok()?;
    let due = intervals(frames, |f| f.frame.header.t_schedule_ns);
    let middle_s = median(&mut due.clone())?;
    for interval_s in due {
        latency.record(((interval_s - middle_s).abs() * 1e9) as u64);
    }
    let found = latency.percentiles();
    let us = |ns: u64| ns as f64 * 1e-3;
    let detail = format!(
        "intervals of header.t_schedule_ns are {:.3} ms, off by {:.0} us in half of them, by \
         {:.0} us in one of a hundred, by {:.0} us at most",
        middle_s * 1e3,
        us(found.p50_ns),
        us(found.p99_ns),
        us(found.max_ns)
    );
    let is_steady = found.p99_ns as f64 * 1e-9 <= JITTER_MAX / rate_hz;
    Some(if is_steady {
        Finding::new("jitter", Status::Ok, detail)
    } else {
        let advice = "publish on an absolute schedule, and stamp when the frame was due";
        Finding::new("jitter", Status::Warning, format!("{detail}: {advice}"))
    })
}

/// Lost frames, by sequence number.
fn gaps(heard: &Reception) -> Finding {
    if let Some(lost) = heard.border.and_then(|border| border.lost_at_socket) {
        let detail = format!("{lost} frames were lost on their way to the socket");
        let status = if lost == 0 {
            Status::Ok
        } else {
            Status::Warning
        };
        return Finding::new("gaps", status, detail);
    }
    let (lost, longest) = missing(&heard.frames);
    if lost == 0 {
        return Finding::new("gaps", Status::Ok, "none: no sequence number is missing");
    }
    let detail =
        format!("{lost} frames are missing by their sequence numbers, {longest} in a row at most");
    Finding::new("gaps", Status::Warning, detail)
}

/// Frames that are missing by their sequence numbers: all, and the most in a row. A leap beyond
/// [`GAP_MAX`] is no loss.
fn missing(frames: &[FrameArrival]) -> (u64, u64) {
    let (mut lost, mut longest) = (0, 0);
    for pair in frames.windows(2) {
        let [before, after] = [0, 1].map(|i| &pair[i].frame.header);
        let missing = after.seq.saturating_sub(before.seq).saturating_sub(1);
        if before.epoch == after.epoch && missing <= GAP_MAX {
            lost += missing;
            longest = longest.max(missing);
        }
    }
    (lost, longest)
}

/// Frames that arrive together: in bursts, as a radio or a buffer makes them.
fn bursts(heard: &Reception) -> Option<Finding> {
    // Without an event this program wakes too late to tell.
    if heard.frames.len() < BURST_FRAMES_MIN || heard.is_silent() {
        return None;
    }
    let gaps_s = intervals(&heard.frames, |f| f.now_ns);
    let mean_s = gaps_s.iter().sum::<f64>() / gaps_s.len().max(1) as f64;
    let (mut together, mut at_once, mut most) = (0, 1, 1);
    for gap_s in &gaps_s {
        let is_together = *gap_s < TOGETHER * mean_s;
        together += usize::from(is_together);
        at_once = if is_together { at_once + 1 } else { 1 };
        most = most.max(at_once);
    }
    let share = together as f64 / gaps_s.len().max(1) as f64;
    let longest_ms = 1e3 * gaps_s.iter().copied().fold(0.0, f64::max);
    let detail = format!(
        "{:.0} % of the frames arrive together with the one before, {most} at once at most, after \
         pauses of up to {longest_ms:.0} ms",
        100.0 * share
    );
    Some(match share > BURSTS_MAX {
        true => {
            let advice = "the graph misses their deadlines: send each frame when it is captured, \
                          and let nothing collect them on the way";
            Finding::new("bursts", Status::Failure, format!("{detail}: {advice}"))
        }
        false => Finding::new("bursts", Status::Ok, detail),
    })
}

/// How often the filters are made to begin anew.
fn starts(frames: &[FrameArrival]) -> Option<Finding> {
    let (Some(first), Some(last)) = (frames.first(), frames.last()) else {
        return None;
    };
    let changes = |of: fn(&FrameArrival) -> u64| {
        let pairs = frames.windows(2);
        pairs.filter(|pair| of(&pair[0]) != of(&pair[1])).count()
    };
    let epochs = changes(|arrived| arrived.frame.header.epoch);
    let runs = changes(|arrived| arrived.frame.run_id);
    if epochs + runs == 0 {
        return None;
    }
    let seconds = last.now_ns.saturating_sub(first.now_ns) as f64 * 1e-9;
    let detail = format!(
        "header.epoch changed {epochs} times, run_id {runs} times: each time the filters forget \
         everything"
    );
    Some(if (epochs + runs) as f64 > STARTS_S_MAX * seconds + 1.0 {
        let advice = "set header.epoch once when the publisher starts, run_id once when a drive \
                      does";
        Finding::new("starts", Status::Failure, format!("{detail}; {advice}"))
    } else {
        Finding::new("starts", Status::Warning, detail)
    })
}

/// From when a frame was due to its arrival.
fn way(rate_hz: f64, frames: &[FrameArrival]) -> Option<Finding> {
    let mut latency = Latency::new().ok()?;
    for arrived in frames {
        let header = &arrived.frame.header;
        latency.record(arrived.now_ns.saturating_sub(header.t_schedule_ns));
    }
    let found = latency.percentiles();
    let us = |ns: u64| ns as f64 * 1e-3;
    let detail = format!(
        "from header.t_schedule_ns to the arrival: {:.0} us in half of the frames, {:.0} us in \
         one of a hundred, {:.0} us at most",
        us(found.p50_ns),
        us(found.p99_ns),
        us(found.max_ns)
    );
    if found.p50_ns as f64 * 1e-9 <= 1.0 / rate_hz {
        return Some(Finding::new("latency", Status::Ok, detail));
    }
    let advice = "most frames come after the next is due: the graph counts them as late";
    Some(Finding::new(
        "latency",
        Status::Warning,
        format!("{detail}: {advice}"),
    ))
}

/// The clock of the capture times against this machine's.
fn capture(frames: &[FrameArrival]) -> Finding {
    let times = intervals(frames, |f| f.frame.header.t_capture_ns);
    if !times.is_empty() && times.iter().all(|s| *s == 0.0) {
        let detail = "header.t_capture_ns never changes: it is when the data was captured, in ns \
                      of any clock that runs evenly";
        return Finding::new("capture clock", Status::Failure, detail);
    }
    let back = times.iter().filter(|s| **s < 0.0).count();
    if back > 0 {
        let detail = format!("header.t_capture_ns goes back {back} times within one start");
        return Finding::new("capture clock", Status::Failure, detail);
    }
    let (mut ours_s, mut theirs_s) = (0.0, 0.0);
    for (ours, theirs) in intervals(frames, |f| f.now_ns).iter().zip(&times) {
        ours_s += ours;
        theirs_s += theirs;
    }
    if ours_s < CLOCK_S_MIN {
        return Finding::new("capture clock", Status::Ok, "too short to judge its rate");
    }
    let off = theirs_s / ours_s - 1.0;
    let detail = format!("{:+.0} ppm against this machine's", off * 1e6);
    if off.abs() <= CLOCK_OFF_MAX + ARRIVAL_OFF_MAX_S / ours_s {
        return Finding::new("capture clock", Status::Ok, detail);
    }
    let units = [(1e3, "us"), (1e6, "ms"), (1e9, "s")];
    let is_unit = |(factor, _): &&(f64, &str)| (theirs_s / ours_s * factor - 1.0).abs() < 0.1;
    if let Some((_, unit)) = units.iter().find(is_unit) {
        let detail = format!("{detail}: it is in {unit}, ns are wanted");
        return Finding::new("capture clock", Status::Failure, detail);
    }
    let what = "the filters believe it: a recording that is played at another speed, or a clock \
                that is wrong";
    Finding::new(
        "capture clock",
        Status::Warning,
        format!("{detail}: {what}"),
    )
}

#[cfg(test)]
mod tests {
    use vigil_blocks::SensorFrame;

    use super::*;

    const MS: u64 = 1_000_000;

    /// Frames of 100 Hz that arrive when they are due; `change` spoils them.
    fn frames(count: u64, change: impl Fn(u64, &mut FrameArrival)) -> Vec<FrameArrival> {
        let one = |k: u64| {
            let mut frame = SensorFrame::default();
            let now_ns = 5_000 * MS + k * 10 * MS;
            (frame.header.epoch, frame.header.seq) = (1, k);
            (frame.header.t_schedule_ns, frame.header.t_capture_ns) = (now_ns, now_ns);
            let mut arrived = FrameArrival { now_ns, frame };
            change(k, &mut arrived);
            arrived
        };
        (0..count).map(one).collect()
    }

    fn found(rate_hz: f64, frames: Vec<FrameArrival>) -> Vec<(String, Status)> {
        let heard = Reception {
            frames,
            ..Reception::default()
        };
        let found = findings(rate_hz, &heard);
        found.into_iter().map(|f| (f.check, f.status)).collect()
    }

    fn status(found: &[(String, Status)], check: &str) -> Option<Status> {
        let one = found.iter().find(|(name, _)| name == check);
        one.map(|(_, status)| *status)
    }

    #[test]
    fn a_good_publisher_has_nothing_but_good_findings() {
        let found = found(100.0, frames(500, |_, _| {}));
        assert!(found.iter().all(|(_, s)| *s == Status::Ok), "{found:?}");
        assert_eq!(found.len(), 6);
    }

    #[test]
    fn each_fault_is_found_under_its_name() {
        let (warning, failure) = (Some(Status::Warning), Some(Status::Failure));
        let of = |change: fn(u64, &mut FrameArrival)| found(100.0, frames(500, change));
        assert_eq!(
            status(&found(50.0, frames(500, |_, _| {})), "rate"),
            failure
        );
        let shaky = of(|k, f| f.frame.header.t_schedule_ns += 8 * MS * (k % 2));
        assert_eq!(status(&shaky, "jitter"), warning);
        let lossy = of(|k, f| {
            f.frame.header.seq += k / 9;
            f.now_ns += 10 * MS * (k / 9);
        });
        assert_eq!(status(&lossy, "rate"), Some(Status::Ok));
        assert_eq!(status(&lossy, "gaps"), warning);
        let restarted = of(|k, f| f.frame.header.epoch += k / 250);
        assert_eq!(status(&restarted, "starts"), warning);
        let anew = of(|k, f| f.frame.header.epoch += k);
        assert_eq!(status(&anew, "starts"), failure);
        let runs = of(|k, f| f.frame.run_id = k);
        assert_eq!(status(&runs, "starts"), failure);
        let still = of(|_, f| f.frame.header.t_capture_ns = 7);
        assert_eq!(status(&still, "capture clock"), failure);
        let back = of(|k, f| f.frame.header.t_capture_ns -= 50 * MS * (k / 250));
        assert_eq!(status(&back, "capture clock"), failure);
        let bursts = of(|k, f| f.now_ns += 10 * MS * (9 - k % 10));
        assert_eq!(status(&bursts, "bursts"), failure);
        assert_eq!(status(&bursts, "rate"), Some(Status::Ok));
        let late = of(|_, f| f.now_ns += 30 * MS);
        assert_eq!(status(&late, "latency"), warning);
        let micros = of(|_, f| f.frame.header.t_capture_ns /= 1000);
        assert_eq!(status(&micros, "capture clock"), failure);
    }
}
